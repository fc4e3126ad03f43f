//! The folder of an unpacked FMU is taken where its file is, with the same results.

use crate::command::{CONNECTIONS, Ended, Folder};
use std::fs;
use std::path::Path;
use zip::ZipArchive;

/// Unpacks an FMU beside itself, into a folder of its name.
fn unpack(folder: &Folder, name: &str) {
    let file = fs::File::open(folder.path(&format!("{name}.fmu"))).unwrap();
    let mut archive = ZipArchive::new(file).unwrap();
    archive.extract(folder.path(name)).unwrap();
}

/// Pilot and quadcopter of that version, packed and unpacked.
fn exported(version: &str) -> Folder {
    let folder = Folder::new();
    for model in [&["pilot", "--preset", "paper"][..], &["quadcopter"]] {
        let export = [&["export"], model, &["--fmi", version]].concat();
        assert_eq!(folder.pilotage(&export).code, 0);
        unpack(&folder, model[0]);
    }
    folder
}

/// All files below a folder with their content.
fn content(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files.extend(content(&path)),
            false => files.push((path.display().to_string(), fs::read(&path).unwrap())),
        }
    }
    files.sort();
    files
}

/// A command with the files and with the folders; what it wrote into `file` is the same.
fn assert_same(folder: &Folder, command: &[&str], file: &str) -> Ended {
    let target = ["--set", "pilot.target=10"];
    let run = |fmus: [&str; 2]| {
        let parts = [&command[..1], &fmus, &CONNECTIONS, &target, &command[1..]];
        let ended = folder.pilotage(&parts.concat());
        let written = fs::read(folder.path(file)).unwrap_or_else(|_| panic!("{ended:?}"));
        fs::remove_file(folder.path(file)).unwrap();
        (ended, written)
    };
    let (packed, unpacked) = (
        run(["pilot.fmu", "quadcopter.fmu"]),
        run(["pilot", "quadcopter/"]),
    );
    assert_eq!(packed.0.code, unpacked.0.code, "{unpacked:?}");
    assert!(packed.1 == unpacked.1);
    unpacked.0
}

#[test]
fn a_folder_is_taken_as_the_file_that_it_was() {
    for version in ["2", "3"] {
        let folder = exported(version);
        let before = content(&folder.path("quadcopter"));
        let info = |name: &str| {
            let mut info = folder.pilotage(&["info", name, "--json"]).json();
            let mut files: Vec<String> = serde_json::from_value(info["files"].take()).unwrap();
            files.sort();
            info["file"].take();
            (info, files)
        };
        assert_eq!(info("quadcopter"), info("quadcopter.fmu"));
        let validated = folder.pilotage(&["validate", "--strict", "quadcopter", "pilot"]);
        assert_eq!(validated.code, 0, "{}", validated.stdout);
        let fly = ["cosim", "--stop-time", "5", "--step", "0.05", "-o", "r.csv"];
        assert_eq!(assert_same(&folder, &fly, "r.csv").code, 0);
        assert_same(&folder, &["linearize", "--csv", "m.csv"], "m.csv");
        assert!(content(&folder.path("quadcopter")) == before, "left alone");
    }
}

/// What is wrong inside is found as in the file.
#[test]
fn faults_in_a_folder_are_found() {
    let folder = exported("2");
    fs::remove_dir_all(folder.path("quadcopter/binaries")).unwrap();
    let ended = folder.pilotage(&["validate", "quadcopter"]);
    assert_eq!(ended.code, 1, "{}", ended.stdout);
    assert!(
        ended.stdout.contains("neither a binary nor source code"),
        "{}",
        ended.stdout
    );
    folder.write("pilot/modelDescription.xml", "<fmiModelDescription>");
    let ended = folder.pilotage(&["info", "pilot"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.stderr.starts_with("error: pilot: "),
        "{}",
        ended.stderr
    );
}

/// A link may lead anywhere: it is refused, as in an archive.
#[test]
#[cfg(unix)]
fn links_in_a_folder_are_refused() {
    let folder = exported("2");
    let link = folder.path("pilot/resources");
    fs::create_dir_all(&link).unwrap();
    std::os::unix::fs::symlink("/etc/passwd", link.join("numbers.txt")).unwrap();
    let ended = folder.pilotage(&["info", "pilot"]);
    let expected = "error: pilot: entry `resources/numbers.txt` is a link; nothing was unpacked\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, expected));
}

/// The folder is an input, and so is what is in it, whatever `--force` says.
#[test]
fn nothing_is_written_into_a_folder_that_is_read() {
    let folder = exported("2");
    unpack(&folder, "pilot");
    let before = content(&folder.path("pilot"));
    for output in [
        "pilot/modelDescription.xml",
        "pilot/new.csv",
        "./pilot/resources/../new.csv",
    ] {
        let ended = folder.pilotage(&["cosim", "pilot", "--step=0.1", "--force", "-o", output]);
        assert_eq!(ended.code, 2, "{ended:?}");
        let message = "is an input of this command (as pilot), and would be overwritten";
        assert!(ended.stderr.contains(message), "{ended:?}");
    }
    assert!(content(&folder.path("pilot")) == before);
}
