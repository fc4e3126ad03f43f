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
trial     use         weight  samples  missing     rate  target  rms error  final error  overshoot  peak stick
                                                 [1/s]     [m]        [m]          [m]        [%]         [1]
10m-run1  fit              1      301        0    20.00      10      4.255       -0.273       27.5       0.292
10m-run2  fit              1      301        0    20.00      10      4.170       -0.336       22.4       0.318
10m-run3  fit              1      301        0    20.00      10      4.209       -0.065       13.4       0.284
20m-run1  fit              1      301        0    20.00      20      8.187       -0.161       15.3       0.636
20m-run2  fit              1      301        0    20.00      20      8.406       -0.680       20.1       0.596
20m-run3  fit              1      301        0    20.00      20      8.235       -0.495       15.0       0.625

octaves of the target, and what of them comes back in the stick
frequency [rad/s]  target [m s]  coherence  remnant [1/(rad/s)]  phase sd [deg]
0.5924             37.7          0.991      0.000201             1.59
1.185              16.0          0.978      0.000449             1.75
2.370              7.33          0.942      0.000119             2.06
4.739              3.50          0.945      1.21e-5              1.41
9.478              1.75          0.919      3.37e-6              1.74
18.96              0.874         0.910      1.55e-7              1.84
29.29              0.546         0.886      7.96e-9              2.10
excitation: no sum of sines; the stick is coherent with what drives the loop up to 29.29 rad/s
from targets that stand still or jump, a pilot with lead is found with half of the human's crossover; a target that moves as a sum of sines determines crossover, lead and delay: \
`pilotage trials synth --target sines`, docs/guidance.md, section 1
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
    assert!((trial["rate_per_s"].as_f64().unwrap() - 20.0).abs() < 1e-9);
    assert_eq!(ended.json()["notes"], serde_json::json!([]));
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
    assert!(ended.code == 0 && ended.stdout.contains(note), "{ended:?}");
}

/// A sine to follow ends near zero and has no overshoot; nor has a hover.
#[test]
fn a_target_that_moves_has_a_range_and_no_overshoot() {
    let folder = Folder::new();
    let file = |target: fn(f64) -> f64, position: fn(f64) -> f64| -> String {
        let times = (0..=40).map(|k| f64::from(k) * std::f64::consts::PI / 20.0);
        let rows: String = times
            .map(|t| format!("{t},{},{}\n", target(t), position(t)))
            .collect();
        format!("time [s],target [m],position [m]\n{rows}")
    };
    folder.write("sine.csv", file(|t| 3.0 * t.sin(), |t| 3.0 * t.sin() + 0.5));
    folder.write("hover.csv", file(|_| 2.0, |t| 2.0 + 1e-9 + t.sin()));
    folder.write("down.csv", file(|_| -2.0, |t| -2.5 + 2.5 * t.cos()));
    let files = ["sine.csv", "hover.csv", "down.csv"];
    let json = folder
        .pilotage(&[&["trials", "check", "--json"], &files[..]].concat())
        .json();
    let number = |k: usize, name: &str| json["trials"][k][name].as_f64();
    assert_eq!([0, 1].map(|k| number(k, "overshoot")), [None; 2]);
    // From 0 to -5, with the target at -2.
    assert!((number(2, "overshoot").unwrap() - 1.5).abs() < 1e-12);
    assert!((number(0, "rms_error_m").unwrap() - 0.5).abs() < 1e-12);
    assert_eq!(
        json["trials"][0]["target_range_m"],
        serde_json::json!([-3.0, 3.0])
    );
    let text = folder
        .pilotage(&[&["trials", "check"], &files[..]].concat())
        .stdout;
    let rows: Vec<String> = text
        .lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    assert_eq!(rows[2], "sine fit 1 41 0 6.366 -3 to 3 0.500 0.500 - -");
    assert_eq!(rows[3], "hover fit 1 41 0 6.366 2 0.698 0.000 - -");
    assert_eq!(rows[4], "down fit 1 41 0 6.366 -2 1.841 2.000 150.0 -");
}

/// A stick that rounding or calibration puts a little beyond its stops is clipped, and one told about.
#[test]
fn a_stick_a_little_beyond_its_stops_is_clipped_and_told() {
    let folder = Folder::new();
    let file = |stick: &str| {
        let rows: String = (0..12)
            .map(|k| {
                format!(
                    "{},10,{k},{}\n",
                    f64::from(k) * 0.5,
                    if k % 4 == 0 { stick } else { "1" }
                )
            })
            .collect();
        format!("time [s],target [m],position [m],stick\n{rows}")
    };
    folder.write("a.csv", file("-1.0004"));
    let note = "a.csv: 3 of 12 samples of the stick are beyond its stops, the farthest at -1.0004; they are taken for full";
    let ended = folder.pilotage(&["trials", "check", "a.csv"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert!(
        ended.stdout.contains(&format!("\nnote: {note}\n")),
        "{ended:?}"
    );
    let json = folder
        .pilotage(&["trials", "check", "--json", "a.csv"])
        .json();
    assert_eq!(json["trials"][0]["peak_stick"], 1.0);
    assert_eq!(json["trials"][0]["stick_at_stop"], 1.0);
    let stops = "note: a: 100 % of the stick's samples are at its stops";
    assert!(ended.stdout.contains(stops), "{ended:?}");
    assert_eq!(json["notes"], serde_json::json!([note]));
    folder.write("a.csv", file("-1.0201"));
    let ended = folder.pilotage(&["trials", "check", "a.csv"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .stderr
            .starts_with("error: a.csv: stick = -1.0201 at 0 s;"),
        "{ended:?}"
    );
}

/// 301 samples of 50 ms are 15 s and not 15,000; a header that names the unit is believed.
#[test]
fn times_that_are_probably_milliseconds_are_doubted() {
    let folder = Folder::new();
    let rows: String = (0..301).map(|k| format!("{},10,{k}\n", 50 * k)).collect();
    let file = |unit: &str| format!("time{unit},target [m],position [m]\n{rows}");
    let note = "note: a.csv: the times have no unit and are taken for seconds: 301 samples in 15000 s, one every 50 s; \
                head the column `time [ms]` if they are milliseconds, and `time [s]` if they are not\n";
    folder.write("a.csv", file(""));
    let ended = folder.pilotage(&["trials", "check", "a.csv"]);
    assert!(ended.code == 0 && ended.stdout.contains(note), "{ended:?}");
    let ended = folder.pilotage(&[
        "fit",
        "a.csv",
        "--max-iterations=1",
        "--random-starts=0",
        "--scheme=euler",
    ]);
    assert!(ended.stderr.starts_with(note), "{ended:?}");
    for (unit, rate) in [(" [ms]", 20.0), (" [s]", 0.02)] {
        folder.write("a.csv", file(unit));
        let json = folder
            .pilotage(&["trials", "check", "--json", "a.csv"])
            .json();
        assert_eq!(json["notes"], serde_json::json!([]), "{unit}");
        let found = json["trials"][0]["rate_per_s"].as_f64().unwrap();
        assert!((found / rate - 1.0).abs() < 1e-9, "{unit}: {found}");
    }
}

/// What `synth` writes, `check` reads: odd targets, the shortest of runs, a vehicle of an odd name.
#[test]
fn what_is_made_is_read_again() {
    let folder = Folder::new();
    let vehicle = folder.pilotage(&["vehicle", "show"]).stdout;
    folder.write("odd\n[name].toml", vehicle);
    let synth = [
        "trials",
        "synth",
        "--runs=2",
        "--duration=1",
        "--rate=9",
        "--vehicle=odd\n[name].toml",
    ];
    let ended =
        folder.pilotage(&[&synth[..], &["--targets=0.1,-0.30000000000000004,99999.9"]].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let ended = folder.pilotage(&["trials", "check", "--json", "trials/trials.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert_eq!(ended.json()["trials"].as_array().unwrap().len(), 6);
    for (more, message) in [
        (
            "--targets=10,20,10",
            "error: target 10 m is given twice; `runs` says how often each is flown to\n",
        ),
        (
            "--rate=8",
            "error: duration · rate = 8 is out of range; expected 9 to 36000000\n",
        ),
    ] {
        let ended = folder.pilotage(
            &[
                &["trials", "synth", "--duration=1", "-o", "new"],
                &[more][..],
            ]
            .concat(),
        );
        assert_eq!((ended.code, ended.stderr.as_str()), (2, message));
    }
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

/// Columns of other names, in other letters, with units in parentheses: the same flights.
#[test]
fn files_of_one_name_are_told_apart_by_their_folders_and_copies_are_told() {
    let folder = Folder::new();
    let flight = |shift: i32| -> String {
        let rows: String = (0..12)
            .map(|k| format!("{},10,{}\n", 0.05 * f64::from(k), k + shift))
            .collect();
        format!("time [s],target [m],position [m]\n{rows}")
    };
    for (file, shift) in [("run.csv", 0), ("monday/run.csv", 1), ("friday/run.csv", 0)] {
        folder.write(file, flight(shift));
    }
    let files = ["run.csv", "monday/run.csv", "friday/run.csv"];
    let ended = folder.pilotage(&[&["trials", "check", "--json"], &files[..]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let json = ended.json();
    let names = json["trials"]
        .as_array()
        .unwrap()
        .iter()
        .map(|trial| trial["name"].as_str().unwrap());
    assert_eq!(
        names.collect::<Vec<_>>(),
        ["run", "monday/run", "friday/run"]
    );
    assert_eq!(
        json["notes"][0],
        "friday/run.csv is the same recording as run.csv"
    );
}

#[test]
fn columns_of_other_names_are_the_same_flights() {
    let folder = Folder::new();
    let rows: String = (0..12)
        .map(|k| format!("{},10,{k},0.5,7\n", 50 * k))
        .collect();
    let plain = "time [ms],target [m],position [cm],stick,other";
    for (file, header) in [
        ("plain.csv", plain),
        (
            "capitals.csv",
            "Time [ms],TARGET [m],Position [cm],Stick,other",
        ),
        (
            "parentheses.csv",
            "time (ms),target (m),position (cm),stick,other",
        ),
        ("named.csv", "t [ms],goal [m],z [cm],lever,position"),
    ] {
        folder.write(file, format!("{header}\n{rows}"));
    }
    let check = |file: &str, more: &[&str]| {
        let ended = folder.pilotage(&[&["trials", "check", "--json", file], more].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let mut trial = ended.json()["trials"][0].clone();
        for own in ["name", "file", "sha256"] {
            trial.as_object_mut().unwrap().remove(own);
        }
        trial
    };
    let expected = check("plain.csv", &[]);
    assert_eq!(expected["final_error_m"], 0.11 - 10.0);
    assert_eq!(expected["peak_stick"], 0.5);
    assert_eq!(check("capitals.csv", &[]), expected);
    assert_eq!(check("parentheses.csv", &[]), expected);
    let names = ["time=t", "target=goal", "position=z", "stick=lever"];
    let names: Vec<&str> = names.iter().flat_map(|name| ["--column", name]).collect();
    assert_eq!(check("named.csv", &names), expected);
}

/// Moving targets, a model as the vehicle, two axes: what is flown is recorded, and its command makes it again.
#[test]
fn a_vehicle_of_two_axes_is_flown_after_targets_that_move() {
    let folder = Folder::new();
    let options = "trials synth --vehicle hover --target ramps --amplitude 3 --runs 1 --gain 0.1,0.09 --coupling 0.2";
    let words: Vec<&str> = options.split(' ').collect();
    let ended = folder.pilotage(&words);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert_eq!(
        ended.stdout,
        "1 flight in trials, listed in trials/trials.toml\n"
    );
    let made = folder.read("trials/run1.csv");
    assert_eq!(
        made.lines().nth(2).unwrap(),
        "time [s],target [m],position [m],stick [1],target2 [m],position2 [m],stick2 [1],\
         velocity [m/s],velocity2 [m/s],pitch [rad],roll [rad]"
    );
    let comment = made
        .lines()
        .next()
        .unwrap()
        .strip_prefix("# made by: pilotage ")
        .unwrap();
    assert!(
        comment.contains("--gain 0.1,0.09 --lead 2.53 "),
        "{comment}"
    );
    let again: Vec<&str> = comment.split(' ').chain(["-o", "again"]).collect();
    assert_eq!(folder.pilotage(&again).code, 0);
    assert_eq!(folder.read("again/run1.csv"), made);
    assert_eq!(
        folder.read("again/trials.toml"),
        folder.read("trials/trials.toml")
    );
    assert_eq!(
        folder
            .pilotage(&["trials", "check", "trials/trials.toml"])
            .code,
        0
    );
}

/// A model file whose position has another name and unit, beside it a vehicle file of the quadcopter.
#[test]
fn model_files_and_vehicle_files_are_flown() {
    let folder = Folder::new();
    let model = "[model]\nname = \"turret\"\n[inputs]\nstick = { min = -1, max = 1 }\n\
                 [states]\nangle = { unit = \"rad\", der = \"-0.5 * stick\" }\n[outputs]\nangle = {}\n";
    folder.write("turret.toml", model);
    folder.write(
        "quadcopter.toml",
        folder.pilotage(&["vehicle", "show"]).stdout,
    );
    let synth = |more: &str| {
        let words = ["trials", "synth", "--runs=1", "--force"];
        folder.pilotage(&[&words[..], &more.split(' ').collect::<Vec<_>>()].concat())
    };
    let ended = synth("--vehicle turret.toml --measure angle --target steps --amplitude 0.3");
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let made = folder.read("trials/run1.csv");
    assert_eq!(
        made.lines().nth(2),
        Some("time [s],target [rad],position [rad],stick [1]")
    );
    assert_eq!(synth("--vehicle quadcopter.toml -o a").code, 0);
    assert_eq!(synth("-o b").code, 0);
    let rows = |file: &str| {
        folder
            .read(file)
            .lines()
            .skip(2)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(rows("a/10m-run1.csv"), rows("b/10m-run1.csv"));
}

#[test]
fn what_means_nothing_to_a_synthetic_human_is_refused_with_a_hint() {
    let folder = Folder::new();
    let cases = [
        (
            "--target steps --bandwidth 1",
            "steps have no bandwidth\nhint: leave --bandwidth out, or take --target sines",
        ),
        (
            "--coupling 0.1",
            "a vehicle with one axis has no other hand to leak into\n\
             hint: leave --coupling out, or take one with two, such as --vehicle hover",
        ),
        (
            "--vehicle hover --gain 1,2,3",
            "--gain has 3 numbers, and the vehicle has 2 axis or axes\n\
             hint: give one number, or one for each axis",
        ),
        (
            "--vehicle hovr",
            "`hovr` is neither a file nor a built-in model; did you mean `hover`?\n\
             hint: `pilotage models` lists the built-in ones",
        ),
        (
            "--vehicle quadcopter",
            "`quadcopter` has no output `position`; its outputs are z, phi, v, q, omega_f, omega_b\n\
             hint: --measure NAME says which output is the position",
        ),
        (
            "--vehicle integrator --gain 3",
            "human and vehicle swing up: about the start their loop is unstable\n\
             hint: a lower --gain, more --lead or a shorter --delay may hold it",
        ),
        (
            "--target sines --count 100",
            "100 of them do not fit into a run of 300 samples: 2164 are needed\n\
             hint: take fewer (--count), a longer --duration or a higher --rate",
        ),
    ];
    for (options, message) in cases {
        let words: Vec<&str> = ["trials", "synth"]
            .into_iter()
            .chain(options.split(' '))
            .collect();
        let ended = folder.pilotage(&words);
        assert_eq!(
            (ended.code, ended.stderr),
            (2, format!("error: {message}\n")),
            "{options}"
        );
    }
    for options in [
        "--count 3",
        "--amplitude 2",
        "--target sines --targets 5",
        "--measure z",
    ] {
        let words: Vec<&str> = ["trials", "synth"]
            .into_iter()
            .chain(options.split(' '))
            .collect();
        assert_eq!(folder.pilotage(&words).code, 2, "{options}");
    }
    assert!(folder.files().is_empty());
}
