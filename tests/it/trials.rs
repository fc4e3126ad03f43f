//! Trials: the shipped ones, and what the commands say of them.

use crate::command::{Folder, example};

#[test]
fn the_shipped_trials_are_made_again_byte_for_byte_by_their_command() {
    let folder = Folder::new();
    let ended = folder.pilotage(&["trials", "synth", "-o", "trials"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let shipped = std::fs::read_dir(example("trials")).unwrap();
    let mut count = 0;
    for entry in shipped {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let expected = std::fs::read_to_string(example("trials").join(&name)).unwrap();
        assert!(
            folder.read(&format!("trials/{name}")) == expected,
            "{name} differs"
        );
        count += 1;
    }
    assert_eq!(count, 7);
}

#[test]
fn the_command_in_a_trials_comment_makes_that_trial() {
    let folder = Folder::new();
    let options = [
        "--targets",
        "-5,7.5",
        "--runs",
        "1",
        "--seed",
        "7",
        "--gain",
        "0.05",
        "-o",
        "a",
    ];
    let ended = folder.pilotage(&[&["trials", "synth"], &options[..]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let made = folder.read("a/7.5m-run1.csv");
    let comment = made
        .lines()
        .next()
        .unwrap()
        .strip_prefix("# made by: pilotage ")
        .unwrap();
    let again: Vec<&str> = comment.split(' ').chain(["-o", "b"]).collect();
    assert_eq!(folder.pilotage(&again).code, 0);
    assert_eq!(folder.read("b/7.5m-run1.csv"), made);
    assert_eq!(
        folder.read("b/minus5m-run1.csv"),
        folder.read("a/minus5m-run1.csv")
    );
}

#[test]
fn a_check_shows_each_trial_in_a_few_numbers() {
    let folder = Folder::new();
    let manifest = example("trials/trials.toml");
    let ended = folder.pilotage(&["trials", "check", manifest.to_str().unwrap()]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert_eq!(
        ended.stdout,
        "\
trial     use         weight  samples  missing   rate  target  final error  overshoot  peak stick
                                               [1/s]     [m]          [m]        [%]         [1]
10m-run1  fit              1      301        0  20.00      10       -0.273       27.5       0.292
10m-run2  fit              1      301        0  20.00      10       -0.336       22.4       0.318
10m-run3  fit              1      301        0  20.00      10       -0.065       13.4       0.284
20m-run1  fit              1      301        0  20.00      20       -0.161       15.3       0.636
20m-run2  fit              1      301        0  20.00      20       -0.680       20.1       0.596
20m-run3  fit              1      301        0  20.00      20       -0.495       15.0       0.625
"
    );
}

#[test]
fn units_are_converted_and_missing_samples_counted() {
    let folder = Folder::new();
    let rows: String = (0..12)
        .map(|k| format!("{},100,{},{}\n", 50 * k, 10 * k, 5 * k))
        .collect();
    let rows = rows.replacen(",10,", ",,", 1);
    folder.write(
        "a.csv",
        format!("time [ms],target [ft],position [cm],stick [%]\n{rows}"),
    );
    folder.write(
        "set.toml",
        "[[run]]\nfile = \"a.csv\"\nweight = 2\nuse = \"validation\"\n",
    );
    let ended = folder.pilotage(&["trials", "check", "--json", "set.toml"]);
    let trial = &ended.json()["trials"][0];
    assert_eq!(trial["target_m"], 30.48);
    assert_eq!(trial["peak_stick"], 0.55);
    assert_eq!(trial["missing"], 1);
    assert_eq!(trial["weight"], 2.0);
    assert_eq!(trial["use"], "validation");
    let error = trial["final_error_m"].as_f64().unwrap();
    assert!((error - (1.1 - 30.48)).abs() < 1e-12);
}

#[test]
fn a_lost_stretch_of_a_recording_is_pointed_out() {
    let folder = Folder::new();
    let times = (0..20)
        .filter(|k| !(5..15).contains(k))
        .map(|k| f64::from(k) * 0.5);
    let rows: String = times.map(|t| format!("{t},10,{t}\n")).collect();
    folder.write("a.csv", format!("time [s],target [m],position [m]\n{rows}"));
    let ended = folder.pilotage(&["trials", "check", "a.csv"]);
    let note = "note: a: the longest time step is 11.0 times the usual one; is a stretch of the recording lost?\n";
    assert!(ended.code == 0 && ended.stdout.ends_with(note), "{ended:?}");
}

#[test]
fn a_folder_that_is_not_empty_is_written_into_only_by_force() {
    let folder = Folder::new();
    folder.write("trials/10m-run1.csv", "mine");
    let ended = folder.pilotage(&["trials", "synth"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.stderr,
        "error: the folder trials is not empty\n\
         hint: name another folder with -o, or overwrite with --force\n"
    );
    assert_eq!(folder.read("trials/10m-run1.csv"), "mine");
    assert_eq!(folder.pilotage(&["trials", "synth", "--force"]).code, 0);
    assert_ne!(folder.read("trials/10m-run1.csv"), "mine");
}
