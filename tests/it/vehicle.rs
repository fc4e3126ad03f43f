//! Vehicle files, and what `pilotage vehicle` says of them.

use crate::command::{Folder, example};

fn example_vehicle(name: &str) -> String {
    example("vehicles").join(name).to_str().unwrap().to_owned()
}

#[test]
fn the_default_vehicle_is_the_shipped_file_and_can_be_flown() {
    let folder = Folder::new();
    let shown = folder.pilotage(&["vehicle", "show"]);
    let file = std::fs::read_to_string(example_vehicle("quadcopter.toml")).unwrap();
    assert!(file.ends_with(&shown.stdout), "{file}");
    let ended = folder.pilotage(&["vehicle", "check", &example_vehicle("quadcopter.toml")]);
    assert_eq!(ended.code, 0, "{ended:?}");
    for line in [
        "  throttle above standstill 601 µs (pulse width 1601 µs where the motors start at 1000 µs)\n",
        "  -4.235 ± 3.176 i                  5.293    0.800\n",
        "\nSTABLE: propeller_lag · rate_gain = 155.8048 exceeds attitude_gain = 22.9600\n",
    ] {
        assert!(ended.stdout.contains(line), "{line}{}", ended.stdout);
    }
}

#[test]
fn the_gains_that_the_paper_prints_are_called_unstable() {
    let folder = Folder::new();
    let file = example_vehicle("paper-gains.toml");
    let ended = folder.pilotage(&["vehicle", "check", &file]);
    assert_eq!(ended.code, 1);
    let verdict = "\nUNSTABLE: propeller_lag · rate_gain = 14.7696 must exceed attitude_gain = 76.3700.\n\
                   Nobody can fly this vehicle: raise rate_gain above 5.2742, or lower attitude_gain.\n";
    assert!(ended.stdout.ends_with(verdict), "{}", ended.stdout);
    let ended = folder.pilotage(&["vehicle", "check", "--json", &file]);
    assert_eq!(
        (ended.code, &ended.json()["stable"]),
        (1, &serde_json::json!(false))
    );
    assert!(ended.json()["pitch_modes"][0]["pole"][0].as_f64().unwrap() > 0.8);
}

#[test]
fn what_show_prints_reads_back_to_the_same_bits() {
    let folder = Folder::new();
    let default = folder.pilotage(&["vehicle", "show"]).stdout;
    let third = default.replace("mass = 1.2 ", "mass = 0.30000000000000004 ");
    folder.write("v.toml", &third);
    let shown = folder.pilotage(&["vehicle", "show", "v.toml"]).stdout;
    assert!(shown.contains("mass = 0.30000000000000004 "), "{shown}");
    let json = folder
        .pilotage(&["vehicle", "show", "v.toml", "--json"])
        .json();
    assert_eq!(json["mass"], 0.30000000000000004);
    assert_eq!(json.as_object().unwrap().len(), 10);
}
