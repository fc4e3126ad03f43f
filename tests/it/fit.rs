//! `pilotage fit` on the shipped trials, and what it does when it cannot or does not.

use crate::command::{Folder, example};
use serde_json::Value;
use std::process::Command;

fn manifest() -> String {
    example("trials/trials.toml").to_str().unwrap().to_owned()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn the_shipped_trials_give_a_pilot_that_brings_the_vehicle_to_the_target() {
    let folder = Folder::new();
    let ended = folder.pilotage(&[
        "fit",
        &manifest(),
        "--initial-state",
        "at-rest",
        "-o",
        "pilot.toml",
        "--report",
        "fit.html",
        "--json",
    ]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{ended:?}");
    assert_eq!(folder.files(), ["fit.html", "pilot.toml"]);

    let json = ended.json();
    assert_eq!(
        (&json["status"], &json["converged"]),
        (&"converged".into(), &true.into())
    );
    assert_eq!(json["parameters"].as_object().unwrap().len(), 6);
    assert!(number(&json["kkt"]) <= 1e-8 && number(&json["seconds"]["total"]) > 0.0);
    assert!(number(&json["iterations"]) > 0.0);
    for pole in json["closed_loop"]["poles"].as_array().unwrap() {
        assert!(number(&pole[0]) < 0.0, "{pole}");
    }
    // The sum of squares is that of the runs' residuals.
    let of = |run: &Value, key: &str| number(&run["measured"]["position"][key]);
    let squares = |run: &Value| 301.0 * of(run, "rms_residual").powi(2);
    let runs = json["runs"].as_array().unwrap();
    let sum: f64 = runs.iter().map(squares).sum();
    assert!(
        (sum / number(&json["objective"]) - 1.0).abs() < 1e-9,
        "{sum} {json}"
    );
    // A pilot flown alone is worth something when it ends near the target.
    assert_eq!(runs.len(), 6);
    for run in runs {
        assert!(of(run, "rms_alone") < 1.5, "{run}");
    }
    let page = folder.read("fit.html");
    assert!(page.contains(">converged, in doubt (1)</p>") && page.matches("<figure>").count() == 8);

    let file: toml::Table = folder.read("pilot.toml").parse().unwrap();
    for k in 1..=6 {
        let value = &json["parameters"][format!("pilot.theta{k}")]["value"];
        let written = &file["parameters"][&format!("theta{k}")]["start"];
        assert_eq!(written.as_float(), value.as_f64());
    }
    assert_eq!(file["fit"]["data"].as_array().unwrap().len(), 6);
    assert_eq!(file["fit"]["scheme"].as_str(), Some("hermite-simpson"));
    assert_eq!(
        file["fit"]["tool"].as_str(),
        Some(concat!("pilotage ", env!("CARGO_PKG_VERSION")))
    );
}

#[test]
fn the_summary_names_every_parameter_and_says_what_to_type_next() {
    let folder = Folder::new();
    let ended = folder.pilotage(&[
        "fit",
        &manifest(),
        "--scheme=euler",
        "--initial-state=at-rest",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    // Forward Euler at 20 Hz is not the equations.
    let verdict = "converged, in doubt (3): ";
    assert!(ended.stdout.contains(verdict), "{}", ended.stdout);
    assert!(ended.stdout.contains("\ndiagnostic [mesh-error]: "));
    assert!(
        ended
            .stdout
            .contains("\ndiagnostic [loop-on-bound]: the closed loop lies on the bound")
    );
    for unit in [
        "  1/s3\n",
        "  1/s2\n",
        "  1/s\n",
        "  1/(m.s3)\n",
        "  1/(m.s2)\n",
        "  1/(m.s)\n",
    ] {
        assert!(ended.stdout.contains(unit), "{unit}{}", ended.stdout);
    }
    for figure in [
        "crossover_frequency",
        "phase_margin",
        "effective_delay",
        "gain_margin",
    ] {
        assert!(ended.stdout.contains(figure), "{figure}{}", ended.stdout);
    }
    let method = "\n95 % intervals (cr3: by leaving out one run at a time)\n";
    assert!(ended.stdout.contains(method), "{}", ended.stdout);
    let next = "\nwrote pilot.toml\nnext: pilotage export pilot.toml -o pilot.fmu\n";
    assert!(ended.stdout.ends_with(next), "{}", ended.stdout);
}

/// Flights, and the problem that they pose, on another mesh: the same intervals.
#[test]
fn a_problem_file_is_as_sure_as_its_flights() {
    let folder = Folder::new();
    let flights = (1..=2).map(|k| example(&format!("trials/20m-run{k}.csv")));
    let flights: Vec<String> = flights.map(|path| path.display().to_string()).collect();
    let flights: Vec<&str> = flights.iter().map(String::as_str).collect();
    let init = [&["init"], &flights[..], &["-o", "problem.toml"]].concat();
    assert_eq!(folder.pilotage(&init).code, 0);
    for method in ["plain", "ar"] {
        let parameters = |what: &[&str]| {
            let words = [&["fit"], what, &["--json", "--covariance", method]].concat();
            let json: Value = serde_json::from_str(&folder.pilotage(&words).stdout).unwrap();
            assert_eq!(json["uncertainty"]["method"], method);
            json["parameters"].clone()
        };
        let (short, problem) = (parameters(&flights), parameters(&["problem.toml"]));
        for k in 1..=6 {
            let sd = |of: &Value, name: String| of[name]["sd"].as_f64().unwrap();
            let own = sd(&short, format!("pilot.theta{k}"));
            let other = sd(&problem, format!("pilot.theta{k}"));
            assert!(
                (own / other - 1.0).abs() < 1e-2,
                "theta{k}: {own} and {other}"
            );
        }
        let file: toml::Table = folder.read("pilot.toml").parse().unwrap();
        let written = file["uncertainty"]["intervals"]["theta1"]["high"]
            .as_float()
            .unwrap();
        assert_eq!(Some(written), short["pilot.theta1"]["high"].as_f64());
    }
}

#[test]
fn a_pilot_that_lives_on_its_initial_states_is_pointed_out() {
    let folder = Folder::new();
    let ended = folder.pilotage(&[
        "fit",
        &manifest(),
        "--scheme=euler",
        "--initial-state=vehicle-at-rest",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let note = "they carry the runs; if nobody moved before the target did";
    assert!(ended.stdout.contains(note), "{}", ended.stdout);
}

#[test]
fn a_solve_that_does_not_converge_is_written_marked_and_ends_with_code_1() {
    let folder = Folder::new();
    let ended = folder.pilotage(&[
        "fit",
        &manifest(),
        "--max-iterations",
        "1",
        "--report",
        "fit.html",
    ]);
    assert_eq!((ended.code, ended.stderr.as_str()), (1, ""), "{ended:?}");
    assert!(
        ended.stdout.contains("\nNOT CONVERGED (iteration-limit): "),
        "{}",
        ended.stdout
    );
    assert!(
        ended.stdout.ends_with("      --max-iterations above 1\n"),
        "{}",
        ended.stdout
    );
    let file = folder.read("pilot.toml");
    assert!(
        file.contains("NOT CONVERGED (iteration-limit)\n")
            && file.contains("\nconverged = false\n"),
        "{file}"
    );
    assert!(
        folder
            .read("fit.html")
            .contains("NOT CONVERGED (iteration-limit)")
    );
}

#[test]
fn a_validation_run_is_flown_but_not_fitted() {
    let folder = Folder::new();
    let file = |name: &str| example("trials").join(name).to_str().unwrap().to_owned();
    folder.write(
        "set.toml",
        format!(
            "[[run]]\nfile = '{}'\n[[run]]\nfile = '{}'\nuse = \"validation\"\n",
            file("10m-run1.csv"),
            file("20m-run1.csv")
        ),
    );
    let ended = folder.pilotage(&["fit", "set.toml", "--initial-state=at-rest", "--json"]);
    let json = ended.json();
    let uses: Vec<_> = json["runs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|run| &run["use"])
        .collect();
    assert_eq!(uses, ["fit", "validation"]);
    let flown = &json["runs"][1]["measured"]["position"];
    assert!(number(&flown["rms_residual"]) > 0.0);
    // The same as the other would be fitted.
    let file: toml::Table = folder.read("pilot.toml").parse().unwrap();
    assert_eq!(file["fit"]["data"][1]["use"].as_str(), Some("validation"));
}

#[test]
fn failures_leave_what_stood_there_before() {
    let manifest = manifest();
    let cases: &[(&[&str], &str)] = &[
        (
            &["gone.csv"],
            "error: cannot read gone.csv: No such file or directory (os error 2)\n",
        ),
        (
            &["bad.csv"],
            "error: bad.csv: a header but no samples below it\n",
        ),
        (&["validation.toml"], "error: no trial to fit\n"),
        (
            &[&manifest, "--vehicle", "gone.toml"],
            "error: cannot read gone.toml: No such file or directory (os error 2)\n",
        ),
        (
            &[&manifest, "--start", "1,2,3"],
            "error: the start has 3 parameters; a pilot of order 3 has 6\n",
        ),
        (
            &[&manifest, "--start", "1,2,3,4,5,inf"],
            "error: start parameter theta6 = inf; expected finite numbers, not all zero\n",
        ),
        (
            &[&manifest, "--report", "no/such/folder.html"],
            "error: cannot write no/such/folder.html: No such file or directory (os error 2)\n",
        ),
        (
            &[&manifest, "--report", "."],
            "error: cannot write .: is a directory\n",
        ),
    ];
    for (arguments, message) in cases {
        let folder = Folder::new();
        folder.write("pilot.toml", "# A pilot: mine");
        folder.write("bad.csv", "time [s],target [m],position [m]\n");
        let trial = example("trials/10m-run1.csv");
        let run = format!(
            "[[run]]\nfile = '{}'\nuse = \"validation\"\n",
            trial.display()
        );
        folder.write("validation.toml", run);
        let ended = folder.pilotage(&[&["fit"], *arguments].concat());
        assert_eq!(
            (ended.code, ended.stderr.as_str()),
            (2, *message),
            "{arguments:?}"
        );
        assert_eq!(folder.read("pilot.toml"), "# A pilot: mine");
        assert_eq!(folder.files(), ["bad.csv", "pilot.toml", "validation.toml"]);
    }
}

#[test]
fn names_and_numbers_of_options_are_checked() {
    for option in [
        "--scheme=rk4",
        "--initial-state=moving",
        "--objective=speed",
        "--order=0",
        "--order=7",
        "--tolerance=0",
        "--stick-limit=-1",
        "--max-iterations=-3",
        "--start=a,b",
    ] {
        let folder = Folder::new();
        let ended = folder.pilotage(&["fit", "gone.csv", option]);
        let name = option.split('=').next().unwrap();
        assert_eq!(ended.code, 2, "{option}");
        assert!(
            ended.stderr.starts_with("error: invalid value") && ended.stderr.contains(name),
            "{ended:?}"
        );
    }
}

/// A limit below what the program takes when it is loaded ends it before it can say anything: such limits are left out.
#[test]
fn out_of_memory_is_a_message() {
    let folder = Folder::new();
    let limited = |megabytes: u32, arguments: &[&str]| {
        let limit = format!("ulimit -v {} && exec \"$0\" \"$@\"", 1024 * megabytes);
        let mut command = Command::new("sh");
        command
            .args(["-c", &limit, env!("CARGO_BIN_EXE_pilotage")])
            .args(arguments)
            .current_dir(folder.path("."));
        command.output().unwrap()
    };
    let manifest = manifest();
    let fit = [
        "fit",
        &manifest,
        "--max-iterations",
        "1",
        "--random-starts",
        "0",
        "-o",
        "p.toml",
    ];
    let mut said = 0;
    for megabytes in (32..=96).step_by(8) {
        if limited(megabytes, &["vehicle", "show"]).status.code() != Some(0) {
            continue;
        }
        let ended = limited(megabytes, &fit);
        let stderr = String::from_utf8_lossy(&ended.stderr);
        let is_told = [
            "error: out of memory: ",
            "error: cannot start threads: ",
            "error: cannot listen",
        ]
        .iter()
        .any(|begin| stderr.starts_with(begin));
        match ended.status.code() {
            Some(2) if is_told => said += 1,
            // There was enough: one iteration does not converge.
            Some(1) => {}
            _ => panic!("{megabytes} MB: {ended:?}"),
        }
    }
    assert!(said > 0);
}
