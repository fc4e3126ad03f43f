//! Mutations of a good system file: whatever it becomes, nothing panics, and what is read is written as the same.

use crate::command::exported;
use crate::mutation::Mutator;
use pilotage::cosim::{System, SystemDescription, native_component};
use pilotage::models::{AnyModel, Model, Quadcopter};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::path::Path;

const GOOD: &str = "\
[system.pilot]
model = \"pilot.fmu\"
kind = \"cs\"
set = { target = 10, \"theta1\" = 0.5 }
[system.vehicle]
model = \"quadcopter.fmu\"
[system.vehicle.set]
mass = 1.3 # kg
[system.course]
table = \"course.csv\"
[connect]
\"pilot.stick\" = [\"vehicle.stick\"]
vehicle.z = \"pilot.position\"
";

const OTHER: &[u8] = b"order = 3\n[connect]\n'a.b' = ['''c''', \"\\u00e4\"]\n[[system]]\nset.x.y = -inf\n0x7f = 1e999\n";

fn mutations() -> impl Iterator<Item = Vec<u8>> {
    let mut mutator = Mutator(ChaCha8Rng::seed_from_u64(7));
    std::iter::repeat_with(move || {
        let mut bytes = GOOD.as_bytes().to_vec();
        mutator.mutate(&mut bytes, OTHER);
        bytes
    })
}

/// Reads and wires it; whether that went well.
fn wired(description: &SystemDescription) -> bool {
    let mut system = System::new();
    for instance in &description.instances {
        let model = match instance.name.as_str() {
            "pilot" => Model::pilot(&[0.3, 1.2, 1.0, -0.006, -0.03, -0.04], 1.0),
            _ => Model::quadcopter(&Quadcopter::default()),
        };
        let component = native_component::of_model(AnyModel::BuiltIn(model));
        system.add(&instance.name, component).unwrap();
    }
    let wired = description.wire(&mut system);
    wired.map_err(|error| error.to_string()).is_ok()
}

/// A description without the places, which a saved file has elsewhere.
fn essence(description: &SystemDescription) -> String {
    let text = description
        .to_toml(Path::new(""))
        .unwrap_or_else(|error| error.to_string());
    let names: Vec<&str> = description
        .instances
        .iter()
        .map(|i| i.name.as_str())
        .collect();
    format!("{names:?} {text}")
}

#[test]
fn ten_thousand_mutations_do_not_panic() {
    let (mut read, mut usable) = (0, 0);
    for bytes in mutations().take(10_000) {
        let text = String::from_utf8_lossy(&bytes);
        match SystemDescription::parse(&text, Path::new("system.toml")) {
            Err(error) => assert!(
                error.to_string().starts_with("system.toml:"),
                "{error}\n{text}"
            ),
            Ok(description) => {
                read += 1;
                usable += usize::from(wired(&description));
                let saved = description.to_toml(Path::new("")).unwrap();
                let again = SystemDescription::parse(&saved, Path::new("saved.toml")).unwrap();
                assert_eq!(essence(&again), essence(&description), "{text}");
            }
        }
    }
    assert!(
        (500..9500).contains(&read) && usable > 20,
        "{read} read, {usable} usable"
    );
}

/// Some of them through the command, with files that are there.
#[test]
fn the_command_does_not_panic_either() {
    let folder = exported();
    folder.write("course.csv", "time [s],pilot.target [m]\n0,0\n1,10\n");
    let mut good = 0;
    for bytes in mutations().take(150) {
        folder.write("system.toml", &bytes);
        let ended = folder.pilotage(&["info", "system.toml"]);
        assert!([0, 2].contains(&ended.code), "{ended:?}");
        good += usize::from(ended.code == 0);
    }
    assert!((1..149).contains(&good), "{good}");
}
