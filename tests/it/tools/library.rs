//! What the libraries of FMUs are made of and what they need, by cargo and binutils.

use crate::command::{example, own_library};
use crate::export;
use pilotage::export::pack;
use std::path::Path;
use std::process::Command;

/// FMI rule 18: libraries run with the C library of systems from 2013 on (glibc 2.17: RHEL 7, Debian 8), be
/// they ours or a user's.
#[test]
#[cfg(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64"))]
fn libraries_need_no_new_glibc() {
    let example = example("vehicle-fmu");
    let (users, _) = pack::build(&example, false).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let ours = folder.path().join("ours.so");
    std::fs::write(&ours, own_library()).unwrap();
    for library in [ours, users] {
        asks_for_no_new_glibc(&library);
    }
}

/// What a library or a program needs of a newer C library than 2.17 would keep it from being loaded.
pub fn asks_for_no_new_glibc(library: &Path) {
    if !cfg!(all(
        target_os = "linux",
        target_env = "gnu",
        target_arch = "x86_64"
    )) {
        return;
    }
    let listed = Command::new("objdump")
        .args(["-T", "-p"])
        .arg(library)
        .output()
        .expect("objdump, which comes with the linker");
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(!listed.contains("libgcc_s"), "{listed}");
    let needed: Vec<&str> = listed.lines().filter(|l| l.contains("*UND*")).collect();
    assert!(needed.len() > 20, "{listed}");
    for line in needed {
        let version = line
            .split_once("(GLIBC_")
            .and_then(|(_, v)| v.split_once(')'));
        let Some((version, _)) = version else {
            // Without a version there may be what the library can do without, and what Python has.
            assert!(
                line.contains(" w ") || line.contains(" Py") || line.contains(" _Py"),
                "{line}"
            );
            continue;
        };
        let numbers = version.split('.').map(|n| n.parse().unwrap());
        let numbers: Vec<u32> = numbers.collect();
        assert!(numbers <= vec![2, 17], "{line}");
    }
}

/// The list in the FMU is that of what the library is made of, and the licence is one of theirs.
#[test]
fn licences_name_every_crate_in_the_library() {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--package",
            "pilotage-fmu",
            "--edges",
            "normal,no-proc-macro",
        ])
        .args([
            "--prefix",
            "none",
            "--format",
            "{p}|{l}",
            "--offline",
            "--locked",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let tree = String::from_utf8(output.stdout).unwrap();
    // By the licence that is taken: the Apache License, the Unlicense or the MIT licence.
    let mut names: [Vec<&str>; 3] = Default::default();
    for line in tree.lines() {
        let (package, license) = line.split_once('|').unwrap();
        let name = package.split(' ').next().unwrap();
        if !name.starts_with("pilotage") {
            let taken = ["Apache-2.0", "Unlicense", "MIT"];
            let taken = taken.iter().position(|own| license.contains(own));
            names[taken.expect(line)].push(name);
        }
    }
    for names in &mut names {
        names.sort_unstable();
        names.dedup();
    }
    let (model, provenance) = &export::models()[0];
    let files = export::files(&export::package(model, provenance).unwrap());
    let listed = export::text(&files, "documentation/licenses/license.txt");
    let heads = [
        "Apache-2.0.txt:\n\n",
        "Unlicense, or under the MIT licence:\n\n",
        "MIT.txt:\n\n",
    ];
    for (head, names) in heads.into_iter().zip(names) {
        let (_, listed) = listed.split_once(head).unwrap();
        let listed = listed.lines().take_while(|line| !line.is_empty());
        assert_eq!(listed.collect::<Vec<_>>(), names);
    }
}
