//! FMUs in processes of their own: the same results, and what is refused. What they do to their process is in
//! strangers.txt.

use crate::command::{Folder, exported};

/// Wires of pilot and quadcopter.
const LOOP: [&str; 6] = [
    "--connect",
    "pilot.stick=quadcopter.stick",
    "--connect",
    "quadcopter.z=pilot.position",
    "--set",
    "pilot.target=10",
];

/// Both FMUs, for both versions of FMI.
fn folder() -> Folder {
    let folder = exported();
    for words in [
        ["pilot", "--preset", "paper", "-o", "pilot3.fmu"].as_slice(),
        &["quadcopter", "-o", "quadcopter3.fmu"],
    ] {
        let ended = folder.pilotage(&[&["export"], words, &["--fmi", "3"]].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    folder
}

const FMUS: [[&str; 2]; 2] = [
    ["pilot=pilot.fmu", "quadcopter=quadcopter.fmu"],
    ["pilot=pilot3.fmu", "quadcopter=quadcopter3.fmu"],
];

#[test]
fn results_are_the_same_to_the_last_bit() {
    let folder = folder();
    let algorithms: [&[&str]; 5] = [
        &["--algorithm", "jacobi", "--extrapolation", "1"],
        &["--algorithm", "gauss-seidel"],
        &["--algorithm", "strong"],
        &["--algorithm", "strong", "--tolerance", "1e-5"],
        &["--parts", "quadcopter=3"],
    ];
    for fmus in FMUS {
        for kind in ["cs", "me"] {
            for algorithm in algorithms {
                let run = |isolation: &[&str], output: &str| {
                    let rest = [
                        "--stop-time",
                        "3",
                        "--step",
                        "0.05",
                        "--kind",
                        kind,
                        "-o",
                        output,
                    ];
                    let words =
                        [&["cosim"], &fmus[..], &LOOP, &rest, algorithm, isolation].concat();
                    let ended = folder.pilotage(&[&words[..], &["--force"]].concat());
                    assert_eq!(ended.code, 0, "{words:?}: {ended:?}");
                    folder.read(output)
                };
                let inside = run(&[], "inside.csv");
                let what = format!("{fmus:?} {kind} {algorithm:?}");
                assert!(run(&["--isolate", "all"], "all.csv") == inside, "{what}");
                assert!(run(&["--isolate", "pilot"], "one.csv") == inside, "{what}");
            }
        }
    }
}

#[test]
fn linear_systems_are_the_same() {
    let folder = folder();
    for fmus in FMUS {
        for kind in ["cs", "me"] {
            let linearized = |isolation: &[&str]| {
                let rest = ["--at", "2", "--step", "0.05", "--kind", kind, "--json"];
                let words = [&["linearize"], &fmus[..], &LOOP, &rest, isolation].concat();
                let ended = folder.pilotage(&words);
                // The loop of the paper's pilot is unstable.
                assert_eq!(ended.code, 1, "{words:?}: {ended:?}");
                ended.json()
            };
            let limits = [
                "--isolate",
                "all",
                "--step-limit",
                "5",
                "--memory-limit",
                "500",
            ];
            assert_eq!(linearized(&limits), linearized(&[]), "{fmus:?} {kind}");
        }
    }
}

#[test]
fn what_cannot_be_isolated_is_told() {
    let folder = exported();
    let run = [
        "cosim",
        "pilot.fmu",
        "vehicle=quadcopter",
        "--stop-time",
        "1",
        "--step",
        "0.1",
    ];
    for (words, why) in [
        (
            "--isolate pilo",
            "error: --isolate: there is no instance `pilo`; did you mean `pilot`?\nhint: there are pilot, vehicle, or all\n",
        ),
        (
            "--isolate vehicle",
            "error: --isolate: `vehicle` is no FMU, and runs no code of others\nhint: leave it out\n",
        ),
        (
            "--step-limit 1",
            "error: the following required arguments were not provided:\n  --isolate <INSTANCE>\n",
        ),
        (
            "--isolate all --step-limit 0",
            "error: invalid value '0' for '--step-limit <SECONDS>'",
        ),
        (
            "--isolate all --memory-limit -1",
            "error: invalid value '-1' for '--memory-limit <MB>'",
        ),
        (
            "--isolate all --memory-limit 0.1",
            "error: `pilot` of pilot.fmu: ",
        ),
    ] {
        let ended = folder.pilotage(&[&run[..], &words.split(' ').collect::<Vec<_>>()].concat());
        let code = if words.ends_with("0.1") { 1 } else { 2 };
        assert_eq!(ended.code, code, "{words}: {ended:?}");
        assert!(ended.stderr.starts_with(why), "{words}: {}", ended.stderr);
    }
    assert!(!folder.files().contains(&"result.csv".to_owned()));
}
