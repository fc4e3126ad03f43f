//! `pilotage pack`: a user's own model as an FMU, and libraries for other platforms.

use crate::command::{Folder, example, own_library, written};
use pilotage::export::{Export, ExportOptions, Provenance, interface, pack, platform};
use pilotage::fmi::description::FmiVersion;
use pilotage::fmi::instance::{self, Step};
use pilotage::fmi::{Fmu, InterfaceType};
use pilotage::models::{Model, Quadcopter};
use std::path::{Path, PathBuf};

/// Builds and packs a crate.
pub fn packed(crate_folder: &Path, version: FmiVersion, path: PathBuf) -> PathBuf {
    let options = ExportOptions {
        version,
        ..ExportOptions::default()
    };
    let (library, _) = pack::build(crate_folder, false).expect("it is built");
    pack::pack(&library, &Provenance::default(), &options, |_| {
        Ok::<_, pilotage::export::ExportError>(path)
    })
    .expect("it is packed")
}

fn names(fmu: &[u8]) -> Vec<String> {
    let archive = zip::ZipArchive::new(std::io::Cursor::new(fmu)).unwrap();
    archive
        .file_names()
        .map(|n| n.unwrap().into_owned())
        .collect()
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_crate_becomes_a_valid_fmu_of_either_version_with_equal_bytes_each_time() {
    let folder = Folder::new();
    let crate_folder = example("vehicle-fmu");
    let crate_folder = crate_folder.to_str().unwrap();
    for (version, library) in [("2", "linux64"), ("3", "x86_64-linux")] {
        let name = format!("drone{version}.fmu");
        let arguments = ["pack", crate_folder, "--fmi", version, "-o", &name];
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.stderr, "");
        assert_eq!(
            ended.stdout,
            format!(
                "{}next: pilotage validate {name}\n",
                written(&folder, &name)
            )
        );
        let once = std::fs::read(folder.path(&name)).unwrap();
        assert!(names(&once).contains(&format!("binaries/{library}/drone.so")));
        // It has the name of its file, and a picture.
        let info = folder.pilotage(&["info", &name, "--json"]).json();
        assert_eq!(info["modelName"], format!("drone{version}"));
        let pictures: &[&str] = match version {
            "2" => &["model.png"],
            _ => &[
                "terminalsAndIcons/icon.png",
                "terminalsAndIcons/terminalsAndIcons.xml",
            ],
        };
        assert!(
            pictures
                .iter()
                .all(|file| names(&once).contains(&(*file).to_owned()))
        );
        let validated = folder.pilotage(&["validate", "--strict", &name]);
        assert_eq!(validated.code, 0, "{}", validated.stdout);
        // The library alone, as cargo made it, gives the same.
        std::fs::remove_file(folder.path(&name)).unwrap();
        let (built, _) = pack::build(&example("vehicle-fmu"), false).unwrap();
        let built = built.to_str().unwrap();
        let ended = folder.pilotage(&["pack", built, "--fmi", version]);
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
        let again = std::fs::read(folder.path("drone.fmu")).unwrap();
        // But for the licence, which is the crate's.
        assert_eq!(names(&again), names(&once));
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.code, 0);
        assert!(std::fs::read(folder.path(&name)).unwrap() == once);
    }
}

#[test]
fn what_cannot_be_packed_says_why_and_leaves_nothing() {
    let folder = Folder::new();
    folder.write("text.so", "no library");
    folder.write("own.so", own_library());
    std::fs::create_dir(folder.path("empty")).unwrap();
    std::fs::create_dir_all(folder.path("rlib/src")).unwrap();
    folder.write("rlib/src/lib.rs", "");
    folder.write(
        "rlib/Cargo.toml",
        "[package]\nname = \"rlib\"\nedition = \"2024\"\n[workspace]\n",
    );
    let before = folder.files();
    for (arguments, message) in [
        (
            &["pack", "none.so"][..],
            "error: none.so cannot be read: No such file",
        ),
        (
            &["pack", "text.so"],
            "error: the library for x86_64-linux cannot be used: ",
        ),
        (
            &["pack", "own.so"],
            "error: own.so does not say what its model is: it was not made by pilotage_sdk::export!",
        ),
        (
            &["pack", "empty"],
            "error: empty/Cargo.toml cannot be read: ",
        ),
        (
            &["pack", "rlib"],
            "error: rlib makes no shared library; its Cargo.toml needs `crate-type = [\"cdylib\"]` below `[lib]`",
        ),
        (
            &["export", "quadcopter", "--binary", "win64"],
            "error: --binary win64 has no file\nhint: write --binary win64=model.dll",
        ),
        (
            &["export", "quadcopter", "--binary", "amiga=text.so"],
            "error: there is no platform \"amiga\"; known are x86_64-linux, ",
        ),
        (
            &["export", "quadcopter", "--binary", "win64=own.so"],
            "error: the library for x86_64-windows cannot be used: it is made for (Elf, X86_64)",
        ),
        (
            &["export", "quadcopter", "--binary", "linux64=own.so"],
            "error: two libraries are given for binaries/linux64/quadcopter.so; give one",
        ),
        (
            &["export", "quadcopter", "--platforms", "win64"],
            "error: this command has no library for x86_64-windows, but for linux64; ",
        ),
        (
            &["export", "quadcopter", "--platforms", "linux64,amiga"],
            "error: there is no platform \"amiga\"; known are x86_64-linux, ",
        ),
    ] {
        let ended = folder.pilotage(arguments);
        assert!(ended.stderr.starts_with(message), "{}", ended.stderr);
        assert_eq!(ended.code, 2);
        let left: Vec<_> = folder.files();
        let left = left
            .into_iter()
            .filter(|f| !f.contains("rlib/") || before.contains(f));
        assert_eq!(left.collect::<Vec<_>>(), before);
    }
}

/// FMI rule 18: a library for another platform is put where importers look.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_library_of_another_platform_is_taken_if_it_is_one() {
    // Our own library, said to be for another processor of the same system: the check reads the header.
    let mut arm = own_library();
    let machine = 18;
    arm[machine..machine + 2].copy_from_slice(&object::elf::EM_AARCH64.to_le_bytes());
    let model = Model::quadcopter(&Quadcopter::default());
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let fmu = Export::new(&model, &Provenance::default())
            .version(version)
            .binary(platform::named("aarch64-linux").unwrap(), arm.clone())
            .bytes()
            .unwrap();
        let path = "binaries/aarch64-linux/quadcopter.so".to_owned();
        assert!(names(&fmu).contains(&path));
    }
    // One function less.
    let at = |name: &[u8]| {
        let found = arm.windows(name.len()).position(|w| w == name);
        found.expect("the symbol's name")
    };
    let name = at(b"\0fmi2GetReal\0");
    arm[name + 5] = b'X';
    let error = Export::new(&model, &Provenance::default())
        .binary(platform::named("aarch64-linux").unwrap(), arm)
        .bytes()
        .unwrap_err();
    assert!(
        error
            .to_string()
            .contains("it lacks the function fmi2GetReal"),
        "{error}"
    );
}

#[test]
fn the_interface_survives_its_way_through_the_library() {
    let bytes = std::fs::read(pack::build(&example("landing-fmu"), false).unwrap().0).unwrap();
    let (library, _) = pack::build(&example("landing-fmu"), false).unwrap();
    let found = pack::ask(&library, &bytes, FmiVersion::V3).unwrap();
    assert_eq!(interface::read(&found.to_json()), Ok(found.clone()));
    assert_eq!((found.name.as_str(), found.states.len()), ("lander", 6));
    assert_eq!(found.structure.indicators.len(), 2);
}

/// Co-simulation of FMI 3.0 with an importer that handles events: each step ends at the bounce, which is
/// then handled in event mode; in the end all is as where the FMU handles it.
#[test]
fn events_end_steps_for_importers_that_handle_them() {
    let folder = Folder::new();
    let path = folder.path("lander.fmu");
    let path = packed(&example("landing-fmu"), FmiVersion::V3, path);
    let mut fmu = Fmu::open(&path).unwrap();
    let library = fmu.load().unwrap();
    let reference = |name: &str| {
        let (_, variable) = library.description().variable(name).unwrap();
        variable.value_reference
    };
    let (height, landed) = (reference("height"), reference("landed"));
    let run = |handles: bool| {
        let options = instance::InstanceOptions {
            event_mode_used: handles,
            early_return_allowed: handles,
            ..instance::InstanceOptions::default()
        };
        let kind = InterfaceType::CoSimulation;
        let mut lander = library.instantiate_with("lander", kind, options).unwrap();
        lander.setup_experiment(None, 0.0, None).unwrap();
        lander.enter_initialization_mode().unwrap();
        lander.exit_initialization_mode().unwrap();
        if handles {
            assert!(!lander.update_discrete_states().unwrap().states_changed);
            lander.enter_step_mode().unwrap();
        }
        let (mut time, mut events) = (0.0, Vec::new());
        while time < 2.5 {
            match lander.do_step(time, 2.5 - time).unwrap() {
                Step::Done => time = 2.5,
                Step::Stopped {
                    reached, is_event, ..
                } => {
                    assert!(is_event && reached < 2.5);
                    time = reached;
                    events.push(time);
                    lander.enter_event_mode().unwrap();
                    assert!(lander.update_discrete_states().unwrap().states_changed);
                    lander.enter_step_mode().unwrap();
                }
                discarded => panic!("{discarded:?}"),
            }
        }
        let mut values = [f64::NAN];
        lander.get_real(&[height], &mut values).unwrap();
        ((values, lander.get_boolean(landed).unwrap()), events)
    };
    let (inside, none) = run(false);
    let (outside, events) = run(true);
    assert_eq!((none.len(), inside), (0, ([0.0], true)));
    assert_eq!(outside, inside);
    // It falls for sqrt(2/g), then each flight is half as long as the one before.
    let fall = (2.0 / 9.80665_f64).sqrt();
    assert!(events.len() > 4, "{events:?}");
    for (k, found) in events.iter().enumerate() {
        let exact = fall * (1.0 + 2.0 * (1.0 - 0.5_f64.powi(k as i32)));
        assert!((found - exact).abs() < 1e-9, "{found} {exact}");
    }
}

/// The unwinder lies in the library itself: a model's panic becomes a status, and all else goes on.
#[test]
fn a_model_that_panics_says_so_and_ends_nothing_but_itself() {
    let folder = Folder::new();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/panicking-fmu");
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let mut fmu = Fmu::open(&packed(&model, version, folder.path("panicking.fmu"))).unwrap();
        let library = fmu.load().unwrap();
        let (_, u) = library.description().variable("u").unwrap();
        for (input, panics) in [(-1.0, false), (1.0, true), (-1.0, false)] {
            let mut instance = library
                .instantiate("panicking", InterfaceType::CoSimulation)
                .unwrap();
            instance.setup_experiment(None, 0.0, None).unwrap();
            instance.enter_initialization_mode().unwrap();
            instance.exit_initialization_mode().unwrap();
            instance.set_real(&[u.value_reference], &[input]).unwrap();
            let stepped = instance.do_step(0.0, 0.1);
            assert_eq!(stepped.is_err(), panics, "{version}: {stepped:?}");
        }
    }
}

/// Panic messages and the like name neither the folder of the crate nor that of cargo.
#[test]
fn a_packed_library_holds_no_path_of_the_machine_that_built_it() {
    let (library, _) = pack::build(&example("landing-fmu"), false).unwrap();
    let bytes = std::fs::read(library).unwrap();
    let home = std::env::home_dir().unwrap();
    for folder in [home, example("landing-fmu").canonicalize().unwrap()] {
        // With what follows it: `src/root.rs` is no folder of root's.
        let name = format!("{}/", folder.display());
        let is_found = bytes.windows(name.len()).any(|w| w == name.as_bytes());
        assert!(!is_found, "{name}");
    }
}

/// Wherever the example's folder is copied, it is packed: the SDK is found. The same model as from its own place.
#[test]
fn an_example_copied_elsewhere_is_packed() {
    let folder = Folder::new();
    for file in ["Cargo.toml", "src/lib.rs"] {
        let text = std::fs::read(example("vehicle-fmu").join(file)).unwrap();
        folder.write(&format!("mine/{file}"), text);
    }
    let target = folder.path("target");
    let variables = [
        ("CARGO_TARGET_DIR", target.to_str().unwrap()),
        // Nothing of it runs long.
        ("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0"),
    ];
    let ended = folder.pilotage_with(&["pack", "mine", "-o", "mine.fmu"], &variables);
    assert_eq!(ended.code, 0, "{ended:?}");
    let own = example("vehicle-fmu");
    let ended = folder.pilotage(&["pack", own.to_str().unwrap(), "-o", "own.fmu"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let description =
        |file: &str| folder.pilotage(&["info", file, "--json"]).json()["variables"].clone();
    assert!(description("mine.fmu").as_array().unwrap().len() > 5);
    assert_eq!(description("mine.fmu"), description("own.fmu"));
    // One that says itself where the SDK is, and is wrong, is not set right.
    let text = folder
        .read("mine/Cargo.toml")
        .replace("\"0.1\"", "{ path = \"nowhere\" }");
    folder.write("mine/Cargo.toml", text);
    let ended = folder.pilotage_with(&["pack", "mine"], &variables);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("nowhere"), "{ended:?}");
}
