//! FMUs in a fit: as vehicle, as pilot, alone; against the same models as files, and with what speaks against them.

use crate::command::{Folder, example};
use crate::{foreign, shipped};
use pilotage::estimation::{Posed, ProblemFile, fit, part};
use pilotage::sqp::Status;
use serde_json::Value;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Fits a problem that converges.
fn fitted(folder: &Folder, problem: &str) -> Value {
    folder.write("problem.toml", problem);
    let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    ended.json()
}

fn value(fit: &Value, name: &str) -> f64 {
    fit["parameters"][name]["value"].as_f64().unwrap()
}

fn assert_same(found: &Value, expected: &Value, digits: f64) {
    let names = expected["parameters"].as_object().unwrap().keys();
    for name in names {
        let (found, expected) = (value(found, name), value(expected, name));
        let error = (found - expected).abs() / expected.abs().max(1e-3);
        assert!(error < digits, "{name}: {found} and not {expected}");
    }
}

/// The words of a doubt, if there is one of that code.
fn doubt(fit: &Value, code: &str) -> Option<String> {
    let mut all = fit["doubts"].as_array().unwrap().iter();
    let found = all.find(|doubt| doubt["code"] == code)?;
    found["words"].as_str().map(str::to_owned)
}

#[test]
fn the_quadcopters_own_fmu_gives_the_pilot_of_the_model_file() {
    let folder = Folder::new();
    let expected = fitted(&folder, &shipped::problem("quadcopter"));
    for version in ["3", "2"] {
        let to = ["-o", "vehicle.fmu", "--fmi", version, "--force"];
        let ended = folder.pilotage(&[&["export", "quadcopter"], &to[..]].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let found = fitted(&folder, &shipped::problem("vehicle.fmu"));
        assert_same(&found, &expected, 1e-8);
        assert_eq!(found["doubts"], expected["doubts"]);
    }
    let bytes = std::fs::read(folder.path("vehicle.fmu")).unwrap();
    folder.write("vehicle.fmu", shipped::without_derivatives(&bytes));
    let found = fitted(&folder, &shipped::problem("vehicle.fmu"));
    assert_same(&found, &expected, 1e-6);
}

/// A pilot whose FMU has the parameters that are sought: each value of them is an initialisation. What its FMU flies is
/// the recording.
#[test]
fn a_pilots_fmu_gives_the_parameters_of_its_model_file() {
    let folder = Folder::new();
    let shown = folder.pilotage(&["models", "show", "lead_lag"]).stdout;
    // An FMU stops its stick; of a model file the limit is a constraint.
    let free = shown.replace(", limit = [-1, 1]", "");
    assert_ne!(shown, free);
    folder.write("pilot.toml", free);
    for (model, fmu) in [("pilot.toml", "pilot.fmu"), ("quadcopter", "vehicle.fmu")] {
        let ended = folder.pilotage(&["export", model, "-o", fmu]);
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    let flight = "cosim pilot.fmu vehicle.fmu --connect pilot.stick=vehicle.stick --connect vehicle.z=pilot.position \
                  --set pilot.target=2 --set pilot.gain=-0.03 --stop-time 15 --step 0.05 --algorithm strong -o run.csv";
    let flown = folder.pilotage(&flight.split_whitespace().collect::<Vec<_>>());
    assert_eq!(flown.code, 0, "{flown:?}");
    let problem = |pilot: &str| {
        format!(
            r#"
[system.pilot]
model = "{pilot}"
set = {{ target = 2 }}
[system.vehicle]
model = "quadcopter"
[connect]
"pilot.stick" = "vehicle.stick"
"vehicle.z" = "pilot.position"
[[measured]]
signal = "vehicle.z"
column = "vehicle.z"
sd = 0.01
[parameters]
"pilot.gain" = {{ start = -0.02 }}
"pilot.lead" = {{ start = 2 }}
"pilot.lag" = {{}}
[[run]]
file = "run.csv"
[fit]
mesh = "samples"
starts = 1
"#
        )
    };
    let solved = |pilot: &str| {
        folder.write("problem.toml", problem(pilot));
        let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
        ended.json()
    };
    let expected = solved("pilot.toml");
    let found = solved("pilot.fmu");
    assert_same(&found, &expected, 1e-6);
    assert!((value(&found, "pilot.gain") / -0.03 - 1.0).abs() < 0.02);
    // What it found is a system with that FMU.
    let system = folder.read("pilot-fitted.toml");
    let line = format!("gain = {}", value(&found, "pilot.gain"));
    assert!(
        system.contains("model = \"pilot.fmu\"") && system.contains(&line),
        "{system}"
    );
    let flown = folder.pilotage(&[
        "cosim",
        "pilot-fitted.toml",
        "--step",
        "0.1",
        "--stop-time",
        "1",
    ]);
    assert_eq!(flown.code, 0, "{flown:?}");
}

/// The decay `exp(-1.3 t)`, each half a second.
const DECAY: &str = "time,x\n0,1\n0.5,0.522045776761016\n1,0.272531793034013\n1.5,0.142274071586514\n2,0.074273578214334\n";

/// An FMU of `me.rs` alone, whose first state was measured.
fn alone(folder: &Folder, model: &str, indicators: usize, rest: &str) -> String {
    folder.write("own.fmu", foreign::model_exchange(model, 1, indicators));
    folder.write("run.csv", DECAY);
    format!(
        "[system.own]\nmodel = \"own.fmu\"\n[[measured]]\nsignal = \"own.x0\"\ncolumn = \"x\"\n{rest}\n[[run]]\n\
         file = \"run.csv\"\n"
    )
}

#[test]
fn anybodys_fmu_is_fitted_with_its_derivatives_or_without() {
    let folder = Folder::new();
    for model in [
        "decay",
        "decay-by-differences",
        "decay-kinked",
        "decay-wrongly",
    ] {
        let model = format!("{model}@0.4");
        let start = "[parameters]\n\"own.p\" = { start = 0.4 }";
        let found = fitted(&folder, &alone(&folder, &model, 0, start));
        assert!((value(&found, "own.p") - 1.3).abs() < 2e-5, "{found}");
        let diagnostic = doubt(&found, "fmu-description");
        let is_wrong = model.starts_with("decay-wrongly");
        assert_eq!(diagnostic.is_some(), is_wrong, "{diagnostic:?}");
        let words =
            "the FMU of `own`: it says that the derivative of `x0` changes with `x0` by -0.8";
        assert!(diagnostic.is_none_or(|diagnostic| diagnostic.starts_with(words)));
    }
}

#[test]
fn events_of_fmus_are_named_with_their_time() {
    let folder = Folder::new();
    let sensor = "gain = \"free\"\n[initial]\n\"own.x0\" = ";
    let problem = alone(&folder, "jump", 0, &format!("{sensor} \"free\""));
    folder.write("problem.toml", problem);
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
    assert_eq!(
        ended.stderr,
        "error: problem.toml:2:9: own.fmu has an event at 0.5 s, and run.csv goes on to 2 s; a fit takes equations \
         without events: cut the runs there\n"
    );
    // The state rises by 1 in a second; the indicator is positive between 0.475 and 0.525. Samples are half a second
    // apart, and the mesh has a point in the middle.
    let event = |begin: &str| {
        let problem = alone(&folder, "pulse", 1, &format!("{sensor} {begin}"));
        doubt(&fitted(&folder, &problem), "event")
    };
    for (begin, until) in [("0.0", "0.5"), ("0.25", "0.25"), ("0.5", "0.25")] {
        let words = event(begin).unwrap();
        let expected = format!(
            "`own` (own.fmu) has an event up to {until} s of run.csv, where event indicator 1 changes its sign"
        );
        assert!(words.starts_with(&expected), "{words}");
    }
    assert_eq!(event("0.6"), None);
}

/// An indicator that is zero but for rounding has no sign; one that rises from zero has an event there (FMI 2.0.4,
/// section 3.1: from `z <= 0` to `z > 0`).
#[test]
fn an_event_begins_at_zero_and_rounding_is_none() {
    let folder = Folder::new();
    let event = |model: &str| {
        let free = "offset = \"free\"\n[initial]\n\"own.x0\" = \"free\"";
        let problem = alone(&folder, model, 1, free);
        doubt(&fitted(&folder, &problem), "event")
    };
    assert_eq!(event("flicker"), None);
    let words = event("riser").unwrap();
    assert!(words.contains("has an event up to 0.25 s"), "{words}");
}

/// Of many event indicators each is looked at once, and what ends a fit ends the look. The limit counts from the last
/// iterate, so that a slow machine has time for the solve.
#[test]
fn a_limit_of_time_ends_the_look_at_many_event_indicators() {
    const LIMIT: Duration = Duration::from_secs(1);
    let folder = Folder::new();
    let start = "[parameters]\n\"own.p\" = { start = 0.4 }\n[fit]\nmesh_step = 0.0002\nstarts = 1";
    folder.write("problem.toml", alone(&folder, "decay@0.4", 100_000, start));
    let file = ProblemFile::read(&folder.path("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    let mut last = Instant::now();
    let ended = fit(&posed, &mut |progress| {
        if progress.iteration.is_some() {
            last = Instant::now();
        }
        match last.elapsed() < LIMIT {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(Status::TimeLimit),
        }
    });
    assert_eq!(ended.cut, Some(Status::TimeLimit));
    assert!(ended.refinement.is_done && !ended.events.is_whole);
    let words = ended.diagnostics[0].to_string();
    let undone = "the search for events was complete: this is the best result so far";
    assert!(words.ends_with(undone), "{words}");
}

/// The FMU has an error for each value out of its range, and the best one lies there.
#[test]
fn an_fmu_is_called_within_its_ranges_alone() {
    let folder = Folder::new();
    for (name, end) in [("own.p", 1.2), ("own.u", 0.0)] {
        let sought = format!("[parameters]\n\"{name}\" = {{}}");
        let found = fitted(&folder, &alone(&folder, "ranged@1", 0, &sought));
        assert!((value(&found, name) - end).abs() < 1e-6, "{found}");
        assert!(doubt(&found, "at-bound").is_some(), "{found}");
        assert_eq!(doubt(&found, "fmu-failed"), None);
        let evaluated = folder.pilotage(&["fit", "problem.toml", "--evaluate", "--json"]);
        assert_eq!(evaluated.code, 0, "{evaluated:?}");
    }
}

/// After a fatal error no call is made; the fit says which it was.
#[test]
fn a_fatal_call_ends_a_fit_by_its_name() {
    let folder = Folder::new();
    let start = "[parameters]\n\"own.p\" = { start = 0.4 }";
    folder.write("problem.toml", alone(&folder, "fatal@0.4", 0, start));
    let ended = folder.pilotage(&["fit", "problem.toml", "--json"]);
    assert_eq!(ended.code, 1, "{ended:?}");
    let json = ended.json();
    let words = doubt(&json, "fmu-failed").unwrap();
    let call = "the FMU of `own` failed on the way, fmi2GetDerivatives returned fmi2Fatal";
    assert!(words.starts_with(call), "{words}");
    assert_eq!(doubt(&json, "undefined"), None);
}

/// Torricelli's law discards negative levels.
#[test]
fn an_fmu_that_fails_is_named() {
    let folder = Folder::new();
    let free = "gain = \"free\"\n[initial]\n\"own.x0\" = -1";
    folder.write("problem.toml", alone(&folder, "torricelli", 0, free));
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!(ended.code, 1, "{ended:?}");
    let why = "diagnostic [undefined]: where the search begins, in run.csv at 0 s: `own`, own.fmu, at 0 s: fmi2GetDerivatives returned fmi2Discard without a message";
    assert!(ended.stdout.contains(why), "{ended:?}");
    // What is not finite has no figures.
    let none = "5 measured values: no objective, since not all is finite at the start";
    assert!(ended.stdout.contains(none), "{ended:?}");
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    let figures = ["objective", "simulated_objective", "chi2", "nllh"].map(|name| &json[name]);
    assert!(figures.iter().all(|own| own.is_null()), "{json}");
    assert!(
        json["runs"][0]["measured"]["x"]["rms_residual"].is_null(),
        "{json}"
    );
}

#[test]
fn fmus_without_equations_are_refused() {
    let folder = Folder::new();
    let refused = |why: &str| {
        let ended = folder.pilotage(&["fit", "problem.toml"]);
        assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
        assert_eq!(ended.stderr, format!("error: problem.toml:2:9: {why}\n"));
    };
    let sought = "[parameters]\n\"own.p\" = {}";
    folder.write("problem.toml", alone(&folder, "decay@1", 0, sought));
    folder.write("own.fmu", foreign::fmu("good"));
    refused(
        "own.fmu: it is not for model exchange: a fit needs its equations, which co-simulation hides; export it for \
         model exchange",
    );
    folder.write("own.fmu", foreign::model_exchange("endless", 0, 0));
    refused(
        "own.fmu: it gives no values at its start: its event iteration after initialisation did not end in 1000 rounds",
    );
    folder.write("own.fmu", foreign::model_exchange("decay@1", 1, 200_000));
    refused(
        "own.fmu: it gives no values at its start: it has 200000 event indicators; 100000 are the most that are taken",
    );
    folder.write("own.fmu", b"");
    refused("own.fmu is no FMU: the file is empty");
    folder.write("own.fmu", "no archive");
    refused("own.fmu is no FMU: it is no zip archive");
    folder.write("own.fmu", b"PK\x03\x04 and no more");
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
    let why = "own.fmu is no zip archive, or a damaged one (copy it again, or name another file)";
    assert!(ended.stderr.contains(why), "{ended:?}");
    let plain = folder.read("problem.toml");
    let problem = plain.replace("\"own.fmu\"", "\"own.fmu\"\norder = 3");
    folder.write("problem.toml", problem);
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    let why = "error: problem.toml:3:9: own.fmu has no order; leave `order` out\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, why));
    let problem = plain.replace("\"own.fmu\"", "\"own.fmu\"\nkind = \"cs\"");
    folder.write("problem.toml", problem);
    refused(
        "own.fmu is taken for co-simulation here, which hides its equations; a fit needs kind = \"me\"",
    );
}

/// An FMU that lists no derivatives is a map without states, unless a variable says that it is the derivative of one.
#[test]
fn an_fmu_whose_states_are_not_listed_is_refused() {
    let folder = Folder::new();
    let problem = alone(&folder, "counter", 0, "offset = \"free\"");
    folder.write("problem.toml", problem.replace("own.x0", "own.y"));
    let run = || folder.pilotage(&["fit", "problem.toml", "--evaluate"]);
    folder.write("own.fmu", foreign::model_exchange("stateless", 0, 0));
    let ended = run();
    assert_eq!(ended.code, 0, "{ended:?}");
    let hidden = r#"<ScalarVariable name="level" valueReference="0" causality="local"><Real/></ScalarVariable>
<ScalarVariable name="der(level)" valueReference="10" causality="local"><Real derivative="5"/></ScalarVariable>"#;
    let fmu = foreign::model_exchange_with("stateless", 0, 0, hidden);
    folder.write("own.fmu", fmu);
    let ended = run();
    let why = "error: problem.toml:2:9: own.fmu: its ModelStructure lists no derivatives of states, and `der(level)` is \
               that of `level`: a fit needs model exchange with all states and derivatives declared\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, why));
}

/// Parameters that a fit does not take are told with their type, ranges beyond the FMU's with both.
#[test]
fn parameters_that_an_fmu_does_not_offer_are_refused() {
    let folder = Folder::new();
    let more = r#"<ScalarVariable name="steps" valueReference="7" causality="parameter" variability="fixed"><Integer start="1"/></ScalarVariable>
<ScalarVariable name="on" valueReference="7" causality="parameter" variability="fixed"><Boolean start="true"/></ScalarVariable>"#;
    let refused = |line: &str, why: &str| {
        let text = alone(&folder, "decay@0.4", 0, &format!("[parameters]\n{line}"));
        let fmu = foreign::model_exchange_with("decay@0.4", 1, 0, more);
        folder.write("own.fmu", fmu);
        folder.write("problem.toml", text);
        let ended = folder.pilotage(&["fit", "problem.toml"]);
        assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
        assert_eq!(ended.stderr, format!("error: problem.toml:{why}\n"));
    };
    let takes = "of its FMU; a fit takes single reals of double precision (Real, Float64) alone, and leaves the others as \
                 the FMU has them";
    refused(
        "\"own.steps\" = {}",
        &format!("7:1: `own.steps` is a parameter of type Integer {takes}"),
    );
    refused(
        "\"own.on\" = {}",
        &format!("7:1: `own.on` is a parameter of type Boolean {takes}"),
    );
}

/// An FMU that says that it has 4 thousand million event indicators has none of the memory that they need.
#[test]
fn too_many_event_indicators_are_refused_by_the_master_too() {
    let folder = Folder::new();
    folder.write(
        "own.fmu",
        foreign::model_exchange("decay@1", 1, 4_000_000_000),
    );
    let run = "cosim own.fmu --stop-time 1 --step 0.1";
    let ended = folder.pilotage(&run.split_whitespace().collect::<Vec<_>>());
    assert_eq!(ended.code, 2, "{ended:?}");
    let why = "it has 4000000000 event indicators; 100000 are the most that are taken";
    assert!(ended.stderr.contains(why), "{ended:?}");
}

/// A local is no output, and measured all the same; its derivatives are differences.
#[test]
fn a_local_of_an_fmu_is_measured() {
    let folder = Folder::new();
    let more = "<ScalarVariable name=\"tripled\" valueReference=\"23\" causality=\"local\"><Real/></ScalarVariable>";
    for model in ["decay@0.4", "decay-by-differences@0.4"] {
        let start = "[parameters]\n\"own.p\" = { start = 0.4 }";
        let problem = alone(&folder, model, 0, start);
        folder.write("own.fmu", foreign::model_exchange_with(model, 1, 0, more));
        let tripled = problem.replace("signal = \"own.x0\"", "expression = \"own.tripled / 3\"");
        let found = fitted(&folder, &tripled);
        assert!((value(&found, "own.p") - 1.3).abs() < 2e-5, "{found}");
        assert_eq!(doubt(&found, "fmu-description"), None);
        // As a signal, with the sensor that undoes it.
        let tripled = problem.replace("\"own.x0\"", "\"own.tripled\"\ngain = 0.3333333333333333");
        let found = fitted(&folder, &tripled);
        assert!((value(&found, "own.p") - 1.3).abs() < 2e-5, "{found}");
    }
    let misspelt = folder
        .read("problem.toml")
        .replace("own.tripled", "own.trippled");
    folder.write("problem.toml", misspelt);
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    let why = "did you mean `own.tripled`?; there are own.y, own.x0, own.u, own.tripled\n";
    assert!(ended.stderr.ends_with(why), "{ended:?}");
}

/// `ẋ = -rate x`, of pilotage's own making: its start value is a parameter, which is no part of `own.*`.
#[test]
fn a_fitted_fmu_of_our_own_begins_where_it_was_found_to() {
    let folder = Folder::new();
    let model = "[model]\nname = \"decay\"\n[parameters]\nrate = { start = 0.4, unit = \"1/s\" }\n[states]\n\
                 x0 = { start = 3, der = \"-rate * x0\" }\n[outputs]\ny = \"x0\"\n";
    let rest = "[parameters]\n\"own.*\" = {}\n[initial]\n\"own.x0\" = \"free\"";
    let problem = alone(&folder, "decay@1", 0, rest);
    folder.write("decay.toml", model);
    let exported = folder.pilotage(&["export", "decay.toml", "-o", "own.fmu", "--force"]);
    assert_eq!(exported.code, 0, "{exported:?}");
    let found = fitted(&folder, &problem);
    let names: Vec<&String> = found["parameters"].as_object().unwrap().keys().collect();
    assert_eq!(names, ["own.rate"]);
    assert!((value(&found, "own.rate") - 1.3).abs() < 2e-5, "{found}");
    let flown = "cosim own-fitted.toml --stop-time 2 --step 0.5 -o flown.csv";
    let ended = folder.pilotage(&flown.split_whitespace().collect::<Vec<_>>());
    assert_eq!(ended.code, 0, "{ended:?}");
    let result = folder.read("flown.csv");
    let flown = result.lines().skip(1);
    let recorded = DECAY.lines().skip(1);
    for (line, expected) in flown.zip(recorded) {
        let number = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
        assert!((number(line) - number(expected)).abs() < 1e-4, "{result}");
    }
}

/// FMUs are wired by names; the parameters of our own are sought, those of other tools are suggestions.
#[test]
fn init_takes_fmus_as_pilot_and_vehicle() {
    let folder = Folder::new();
    for (model, fmu) in [("lead_lag", "pilot.fmu"), ("quadcopter", "vehicle.fmu")] {
        assert_eq!(folder.pilotage(&["export", model, "-o", fmu]).code, 0);
    }
    let run = example("trials").join("10m-run1.csv").display().to_string();
    let init = [
        "init",
        &run,
        "--pilot",
        "pilot.fmu",
        "--vehicle",
        "vehicle.fmu",
    ];
    let to = ["-o", "problem.toml"];
    let ended = folder.pilotage(&[&init[..], &to].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let text = folder.read("problem.toml");
    for line in [
        "model = \"pilot.fmu\"\n",
        "\"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.z\" = \"pilot.position\"\n",
        "\"pilot.target\" = \"target\"\n",
        "signal = \"vehicle.z\"\ncolumn = \"position\"\n",
        "\n\"pilot.lag\" = { start = 0.1 }",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    assert!(!text.contains("lagged_start"), "{text}");
    let ended = folder.pilotage(&["fit", "problem.toml", "--evaluate"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    folder.write("run.csv", DECAY.replace("time,x", "time,x0"));
    folder.write("own.fmu", foreign::model_exchange("decay@0.4", 1, 0));
    let init = ["init", "run.csv", "--model", "own.fmu"];
    let text = folder.pilotage(&init).stdout;
    for line in [
        "signal = \"model.x0\"\n",
        "\n# \"model.p\" = { start = 1.0 }",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    // What is suggested is sought when it is asked for.
    folder.write("problem.toml", text.replace("# \"model.p\"", "\"model.p\""));
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    assert!((value(&json, "model.p") - 1.3).abs() < 2e-5, "{json}");
}
