//! FMUs for other platforms (docs/platforms.md): the libraries that `scripts/platforms.py` has put into the target folder are looked at
//! and, as far as there are emulators, run.

use crate::command::{Folder, example};
use crate::times;
use object::macho::{LC_BUILD_VERSION, LC_CODE_SIGNATURE, LinkeditDataCommand, MachHeader64};
use object::read::macho::{FatArch, MachHeader, MachOFatFile32, MachOFile64};
use object::{Endianness, Object};
use pilotage::export::{Export, Platform, Provenance, platform};
use pilotage::fmi::description::FmiVersion;
use pilotage::models::{Model, Quadcopter};
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where the script puts what it makes.
fn made() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    target.join("platforms")
}

/// The libraries with their platforms; none where the script has not run.
fn libraries() -> Vec<(Platform, Vec<u8>)> {
    let Ok(file) = std::fs::File::open(made().join("pilotage-fmu.zip")) else {
        let what = "libraries for other platforms are not looked at";
        times::missing("target/platforms (scripts/platforms.py)", what);
        return Vec::new();
    };
    let mut archive = zip::ZipArchive::new(file).unwrap();
    let libraries = (0..archive.len()).map(|at| {
        let mut file = archive.by_index(at).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        let name = file.name().unwrap().into_owned();
        (platform::named(&name).unwrap(), bytes)
    });
    libraries.collect()
}

fn is_mac(platform: &Platform) -> bool {
    platform.tuple.ends_with("darwin")
}

#[test]
fn libraries_are_whole_and_need_the_oldest_systems_alone() {
    for (platform, bytes) in libraries() {
        for version in [FmiVersion::V2, FmiVersion::V3] {
            platform::check(&platform, &bytes, version).unwrap();
        }
        let root = env!("CARGO_MANIFEST_DIR").as_bytes();
        assert!(!bytes.windows(root.len()).any(|window| window == root));
        match platform.tuple.split_once('-').unwrap().1 {
            "linux" => needs_no_newer_glibc(&bytes),
            "windows" => needs_windows_alone(&bytes),
            _ => needs_macos_11_and_is_signed(&bytes),
        }
    }
}

/// All versions of glibc that a library names are in it as text.
fn needs_no_newer_glibc(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let versions = text.split("GLIBC_2.").skip(1).filter_map(|rest| {
        let digits = rest.split(|c: char| !c.is_ascii_digit()).next()?;
        digits.parse::<u32>().ok()
    });
    let newest = versions.max().expect("it needs glibc");
    assert!(newest <= 17, "glibc 2.{newest}");
}

fn needs_windows_alone(bytes: &[u8]) {
    let file = object::File::parse(bytes).unwrap();
    let imports = file.imports().unwrap();
    assert!(!imports.is_empty());
    for import in imports {
        let library = String::from_utf8_lossy(import.library()).to_ascii_lowercase();
        let is_system = library.starts_with("api-ms-win-")
            || [
                "kernel32.dll",
                "ntdll.dll",
                "msvcrt.dll",
                "bcryptprimitives.dll",
            ]
            .contains(&&*library);
        assert!(is_system, "{library}");
    }
}

/// The oldest version (`LC_BUILD_VERSION`), and a signature (Apple's `cs_blobs.h`) that is ad hoc and whose sums are those of the file.
fn needs_macos_11_and_is_signed(bytes: &[u8]) {
    const CODE_DIRECTORY: u32 = 0xfade_0c02;
    const AD_HOC: u32 = 2;
    let file = MachOFile64::<Endianness>::parse(bytes).unwrap();
    let endian = file.endian();
    let header: &MachHeader64<Endianness> = file.macho_header();
    let mut commands = header.load_commands(endian, bytes, 0).unwrap();
    let (mut oldest, mut signature) = (0, None);
    while let Some(command) = commands.next().unwrap() {
        if let (LC_BUILD_VERSION, Some(version)) = (command.cmd(), command.build_version().unwrap())
        {
            oldest = version.minos.get(endian);
        }
        if command.cmd() == LC_CODE_SIGNATURE {
            let place: &LinkeditDataCommand<Endianness> = command.data().unwrap();
            signature = Some(place.dataoff.get(endian) as usize);
        }
    }
    assert_eq!(oldest, 11 << 16, "{oldest:#x}");
    // Intel's Macs load what is not signed.
    let Some(at) = signature else {
        return assert_eq!(file.architecture(), object::Architecture::X86_64);
    };
    let word = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    // The directory is the first of the blobs.
    let directory = at + word(at + 16) as usize;
    assert_eq!(word(directory), CODE_DIRECTORY);
    assert_eq!(word(directory + 12) & AD_HOC, AD_HOC);
    let (sums, count, limit) = (
        word(directory + 16),
        word(directory + 28),
        word(directory + 32),
    );
    let [size, kind] = [bytes[directory + 36], bytes[directory + 37]];
    assert_eq!(
        (limit as usize, size, kind),
        (at, 32, 2),
        "SHA-256 of all before"
    );
    let page = 1_usize << bytes[directory + 39];
    let pages = bytes[..at].chunks(page);
    assert_eq!(pages.len(), count as usize);
    for (k, page) in pages.enumerate() {
        let sum = directory + sums as usize + 32 * k;
        assert_eq!(Sha256::digest(page)[..], bytes[sum..sum + 32], "page {k}");
    }
}

/// FMI 2.0 has one folder for both processors of Macs.
#[test]
fn a_mac_fmu_of_fmi_2_has_one_universal_library() {
    let macs: Vec<_> = libraries()
        .into_iter()
        .filter(|(own, _)| is_mac(own))
        .collect();
    if macs.is_empty() {
        return;
    }
    let model = Model::quadcopter(&Quadcopter::default());
    let provenance = Provenance::default();
    let mut export = Export::new(&model, &provenance).version(FmiVersion::V2);
    for (platform, bytes) in &macs {
        export = export.binary(*platform, bytes.clone());
    }
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(export.bytes().unwrap())).unwrap();
    assert!(
        archive
            .by_name("binaries/aarch64-darwin/quadcopter.dylib")
            .is_err()
    );
    let mut universal = Vec::new();
    let mut file = archive
        .by_name("binaries/darwin64/quadcopter.dylib")
        .unwrap();
    file.read_to_end(&mut universal).unwrap();
    let fat = MachOFatFile32::parse(&*universal).unwrap();
    assert_eq!(fat.arches().len(), 2);
    for arch in fat.arches() {
        let (_, bytes) = (macs.iter())
            .find(|(own, _)| own.architecture == arch.architecture())
            .unwrap();
        assert!(arch.data(&*universal).unwrap() == bytes);
        assert_eq!(arch.file_range().0 % (1 << 14), 0);
    }
}

/// What starts a program of another platform, where it is installed.
fn emulator(platform: &Platform, folder: &Folder) -> Option<Command> {
    let mut command = match platform.tuple {
        "aarch64-linux" => {
            let mut qemu = Command::new("qemu-aarch64");
            qemu.args(["-L", "/usr/aarch64-linux-gnu"]);
            qemu
        }
        _ => {
            let beside = Path::new("/usr/lib/wine/wine64");
            let wine = if beside.exists() {
                beside
            } else {
                Path::new("wine64")
            };
            let mut wine = Command::new(wine);
            wine.env("WINEPREFIX", folder.path("wine"))
                .env("WINEDEBUG", "-all");
            wine
        }
    };
    let is_here = Command::new(command.get_program())
        .arg("--version")
        .output()
        .is_ok();
    command.current_dir(folder.path("."));
    is_here.then_some(command)
}

/// Wine 8 lacks a library of Windows; one for tests is put beside the program.
fn add_what_wine_lacks(folder: &Folder) -> bool {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/tools/bcryptprimitives.c");
    let mut compiler = Command::new("x86_64-w64-mingw32-gcc");
    compiler
        .args(["-shared", "-o", "bcryptprimitives.dll"])
        .arg(source);
    let done = compiler.current_dir(folder.path(".")).status();
    done.is_ok_and(|status| status.success())
}

/// What `crates/fmi/examples/values.rs` prints.
fn values(mut command: Command, fmus: &[String]) -> String {
    let output = command.args(fmus).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).replace('\r', "");
    assert!(
        output.status.success(),
        "{text}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    text
}

/// Pilot, quadcopter and a model file, by co-simulation and model exchange of both versions: each value is that of Linux, but for the last
/// digits of functions that each system has of its own (sine, exponential, power).
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn other_platforms_compute_what_this_one_does() {
    let libraries = libraries();
    let folder = Folder::new();
    let mut fmus = Vec::new();
    for version in ["2", "3"] {
        let motor = example("models/dc_motor.toml");
        for (name, model) in [
            ("pilot", &["pilot", "--preset", "paper"][..]),
            ("quadcopter", &["quadcopter"]),
            ("motor", &[motor.to_str().unwrap()]),
        ] {
            let file = format!("{name}{version}.fmu");
            let mut arguments = [&["export"], model, &["--fmi", version, "-o", &file]].concat();
            let given: Vec<String> = (libraries.iter())
                .filter(|(own, _)| Platform::host() != Some(*own) && !is_mac(own))
                .map(|(own, bytes)| {
                    folder.write(own.tuple, bytes);
                    format!("--binary={0}={0}", own.tuple)
                })
                .collect();
            arguments.extend(given.iter().map(String::as_str));
            assert_eq!(folder.pilotage(&arguments).code, 0);
            fmus.push(file);
        }
    }
    let beside = Path::new(env!("CARGO_BIN_EXE_pilotage")).with_file_name("examples/values");
    let mut host = Command::new(beside);
    host.current_dir(folder.path("."));
    let expected = values(host, &fmus);
    assert_eq!(expected.lines().count(), 6 * 2 * 201);
    for name in ["aarch64-linux", "x86_64-windows"] {
        let platform = platform::named(name).unwrap();
        let program = ["", ".exe"].map(|ending| made().join(format!("values-{name}{ending}")));
        let Some(program) = program.iter().find(|program| program.exists()) else {
            times::missing(
                &format!("values-{name} (scripts/platforms.py --values)"),
                "FMUs are not run there",
            );
            continue;
        };
        let here = folder.path(program.file_name().unwrap().to_str().unwrap());
        std::fs::copy(program, &here).unwrap();
        let is_whole = !name.ends_with("windows") || add_what_wine_lacks(&folder);
        let Some(mut command) = emulator(&platform, &folder).filter(|_| is_whole) else {
            let tools = [
                "qemu-user and libc6-arm64-cross",
                "wine64 and gcc-mingw-w64-x86-64",
            ];
            let tool = tools[usize::from(name.ends_with("windows"))];
            times::missing(tool, &format!("FMUs are not run on {name}"));
            continue;
        };
        command.arg(here);
        let [cs, me] = compared(&expected, &values(command, &fmus));
        eprintln!("{name}: values differ by at most {cs:e}, in model exchange {me:e}");
        assert!(cs <= 1e-14, "{name}: {cs:e}");
        // Here the solver's steps differ as well: their lengths are powers of its errors.
        assert!(me <= 1e-12, "{name}: {me:e}");
    }
}

/// By how much numbers of co-simulation, and of model exchange, differ at most, relative to those above 1.
fn compared(expected: &str, found: &str) -> [f64; 2] {
    let (mut at, mut largest) = (0, [0.0_f64; 2]);
    assert_eq!(expected.lines().count(), found.lines().count(), "{found}");
    for (expected, found) in expected.lines().zip(found.lines()) {
        let numbers = |line: &str| -> Option<Vec<f64>> {
            line.split(' ').map(|word| word.parse().ok()).collect()
        };
        let (Some(expected), Some(found)) = (numbers(expected), numbers(found)) else {
            assert_eq!(expected, found);
            at = usize::from(found.contains("model exchange"));
            continue;
        };
        assert_eq!(expected.len(), found.len());
        for (a, b) in expected.into_iter().zip(found) {
            let apart = (a - b).abs() / a.abs().max(1.0);
            assert!(!apart.is_nan());
            largest[at] = largest[at].max(apart);
        }
    }
    largest
}
