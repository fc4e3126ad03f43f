//! FMUs of tools that are not ours, made here: `pythonfmu` (FMI 2.0) and `pythonfmu3` (FMI 3.0).

use super::python;
use crate::command::{Ended, Folder};

/// A folder with `Lag.fmu` and `Decay.fmu`, and the library of Python that they expect in their host.
fn made() -> (Folder, String) {
    let folder = Folder::new();
    let printed = python::run("build.py", [folder.path(".")]);
    let library = printed.lines().last().unwrap_or_default().to_owned();
    assert!(
        !library.is_empty(),
        "this Python has no shared library, which FMUs of pythonfmu need; install one that has"
    );
    (folder, library)
}

/// Runs `pilotage` as their users do: with Python in the process.
fn pilotage(folder: &Folder, library: &str, arguments: &[&str]) -> Ended {
    folder.pilotage_with(arguments, &[("LD_PRELOAD", library)])
}

/// The findings without those that depend on the tool's binaries for other platforms.
fn findings(ended: &Ended) -> Vec<String> {
    let json = ended.json();
    let findings = json["fmus"][0]["findings"].as_array().unwrap().clone();
    (findings.iter())
        .map(|f| {
            format!(
                "{}: {}",
                f["severity"].as_str().unwrap(),
                f["message"].as_str().unwrap()
            )
        })
        .collect()
}

#[test]
#[cfg(target_os = "linux")]
fn pythonfmu_is_described_checked_and_run() {
    let (folder, library) = made();
    let info = pilotage(&folder, &library, &["info", "--json", "Lag.fmu"]).json();
    assert_eq!(info["modelName"], "Lag");
    assert_eq!(info["variables"][2]["name"], "T");

    // fmpy finds the same error: the builder leaves out <InitialUnknowns>.
    let ended = pilotage(&folder, &library, &["validate", "--json", "Lag.fmu"]);
    let found = findings(&ended);
    let errors: Vec<_> = found.iter().filter(|f| f.starts_with("error")).collect();
    let lacks = |f: &&String| f.starts_with("error: <InitialUnknowns> lacks");
    assert!(!errors.is_empty() && errors.iter().all(lacks), "{found:#?}");
    assert_eq!(ended.code, 1);

    let arguments = [
        "cosim",
        "Lag.fmu",
        "--set",
        "Lag.u=1",
        "--stop-time",
        "1",
        "--step",
        "0.25",
    ];
    let ended = pilotage(&folder, &library, &arguments);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let csv = folder.read("result.csv");
    assert_eq!(csv.lines().next().unwrap(), "time,Lag.y,Lag.steps,Lag.high");
    let last: Vec<f64> = csv
        .lines()
        .last()
        .unwrap()
        .split(',')
        .map(|v| v.parse().unwrap())
        .collect();
    let exact = 1.0 - (-1.0_f64 / 0.5).exp();
    assert!((last[1] - exact).abs() < 1e-12, "{last:?}");
    assert_eq!(last[2..], [4.0, 1.0]);
}

#[test]
#[cfg(target_os = "linux")]
fn pythonfmu3_is_described_checked_and_run() {
    let (folder, library) = made();
    let info = pilotage(&folder, &library, &["info", "Decay.fmu"]).stdout;
    assert!(
        info.contains("FMI 3.0, co-simulation and model exchange"),
        "{info}"
    );

    let ended = pilotage(&folder, &library, &["validate", "--json", "Decay.fmu"]);
    let found = findings(&ended);
    let errors: Vec<_> = found.iter().filter(|f| f.starts_with("error")).collect();
    assert!(errors.is_empty(), "{found:#?}");
    assert_eq!(ended.code, 0);

    // Its own forward Euler, step by step.
    let arguments = ["cosim", "Decay.fmu", "--stop-time", "1", "--step", "0.25"];
    let ended = pilotage(&folder, &library, &arguments);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let csv = folder.read("result.csv");
    let last = csv
        .lines()
        .last()
        .unwrap()
        .rsplit(',')
        .next()
        .unwrap()
        .parse::<f64>()
        .unwrap();
    assert!((last - 0.75_f64.powi(4)).abs() < 1e-12, "{last}");
}
