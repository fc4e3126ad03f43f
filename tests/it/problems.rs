//! Problem files: the textbook ones of `examples/problems` against SciPy (`problem_examples.json`, printed by
//! tests/python/problems_reference.py from right-hand sides written by hand), and the command.

use crate::command::{Folder, example};
use crate::compare::{RUNS, flights, problem};
use pilotage::collocation::Scheme;
use pilotage::estimation::file::Mesh;
use pilotage::estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage::flights::trials::sha256;
use pilotage::inference::Method;
use serde_json::Value;
use std::ops::ControlFlow;

fn references() -> Value {
    serde_json::from_str(include_str!("problem_examples.json")).unwrap()
}

/// The fit of an example on a mesh whose error is below the digits of the reference.
fn exact(name: &str, covariance: Method) -> Fit {
    let path = example("problems").join(name).join("problem.toml");
    let mut file = ProblemFile::read(&path).unwrap_or_else(|error| panic!("{error}"));
    file.options.scheme = Some(Scheme::Gauss(4));
    file.options.mesh = Mesh::Tolerance(1e-9);
    file.options.starts = Some(1);
    file.options.tolerance = 1e-9;
    file.options.covariance = Some(covariance);
    let posed = Posed::new(&file, &part::open).unwrap_or_else(|error| panic!("{error}"));
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

fn assert_near(what: &str, found: f64, expected: f64) {
    let error = (found - expected).abs() / expected.abs();
    assert!(error < 2e-8, "{what}: {found} and not {expected}");
}

/// The standard deviation of each parameter to 5 digits: the mesh costs the others. What a run alone tells is always with a
/// model of the noise, unless it is white.
fn assert_as_sure_as_scipy(name: &str, covariance: Method) {
    let found = exact(name, covariance);
    let sure = found.uncertainty.as_ref();
    let sure = sure.unwrap_or_else(|error| panic!("{name}: {error}"));
    let expected = &references()[name]["sd"][covariance.as_str()];
    let mut compared = 0;
    for (own, intervals) in found.parameters.iter().zip(&sure.intervals) {
        for ((label, _), interval) in own.values.iter().zip(intervals) {
            let is_of_run = label.as_ref().is_some_and(|label| label.ends_with(".csv"));
            if is_of_run && covariance != Method::Plain {
                continue;
            }
            let label = label.iter().map(|label| format!(" {label}"));
            let label = own.name.clone() + &label.collect::<String>();
            let Some(expected) = expected[&label].as_f64() else {
                continue;
            };
            let error = (interval.sd - expected).abs() / expected;
            assert!(error < 1e-5, "{label}: {} and not {expected}", interval.sd);
            compared += 1;
        }
    }
    assert!(compared > 0, "{name} has parameters");
}

#[test]
fn standard_deviations_are_those_of_scipy() {
    let names = references();
    for name in names.as_object().unwrap().keys() {
        assert_as_sure_as_scipy(name, Method::Plain);
        assert_as_sure_as_scipy(name, Method::Sidpac);
    }
}

/// Objective, every parameter and every sensor to 8 digits.
fn assert_as_scipy(name: &str) {
    let expected = &references()[name];
    let found = exact(name, Method::Plain);
    assert!(found.is_answer(), "{name}: {}", found.status);
    assert_eq!(Some(found.samples as u64), expected["samples"].as_u64());
    assert_near(
        name,
        found.objective,
        expected["objective"].as_f64().unwrap(),
    );
    let value = |name: &str, label: Option<&str>| {
        let own = found.parameters.iter().find(|own| own.name == name);
        let own = own.unwrap_or_else(|| panic!("no {name}"));
        let mut values = own.values.iter();
        let is_it = |(own, _): &&(Option<String>, f64)| own.as_deref() == label;
        values.find(is_it).expect("a value of its own").1
    };
    for (parameter, expected) in expected["parameters"].as_object().unwrap() {
        match expected {
            Value::Object(each) => each.iter().for_each(|(label, expected)| {
                assert_near(
                    parameter,
                    value(parameter, Some(label)),
                    expected.as_f64().unwrap(),
                );
            }),
            number => assert_near(parameter, value(parameter, None), number.as_f64().unwrap()),
        }
    }
    let sensors = expected["sensors"].as_object();
    for (signal, expected) in sensors.into_iter().flatten() {
        for (what, expected) in expected.as_object().unwrap() {
            let column = signal.rsplit('.').next().unwrap();
            let name = found.parameters.iter().map(|own| &own.name);
            let name = name
                .filter(|own| own.starts_with(&format!("{what}(")))
                .count();
            assert_eq!(name, 1, "one {what} is sought in this example");
            let own = found
                .parameters
                .iter()
                .find(|own| own.name.starts_with(what.as_str()));
            assert_near(column, own.unwrap().values[0].1, expected.as_f64().unwrap());
        }
    }
}

#[test]
fn hares_and_lynxes_are_those_of_scipy() {
    assert_as_scipy("hare_lynx");
}

#[test]
fn van_der_pols_oscillator_is_that_of_scipy() {
    assert_as_scipy("van_der_pol");
}

#[test]
fn a_nerve_cell_and_its_noise_are_those_of_scipy() {
    assert_as_scipy("fitzhugh_nagumo");
}

#[test]
fn a_battery_is_that_of_scipy() {
    assert_as_scipy("battery");
}

#[test]
fn a_motor_and_an_offset_are_those_of_scipy() {
    assert_as_scipy("dc_motor");
}

#[test]
fn a_reaction_at_two_temperatures_is_that_of_scipy() {
    assert_as_scipy("reaction");
}

#[test]
fn three_people_and_a_drug_are_those_of_scipy() {
    assert_as_scipy("drug");
}

/// A decay that is measured: ẋ = -k x, x(0) = 2.
const DECAY: &str = "[model]\nname = \"decay\"\n[parameters]\nrate = { start = 0.5, unit = \"1/s\", min = 0 }\n\
                     [states]\nx = { start = 2, der = \"-rate * x\" }\n[outputs]\nx = {}\n";
const PROBLEM: &str = "[system.tank]\nmodel = \"decay.toml\"\n[[measured]]\nsignal = \"tank.x\"\ncolumn = \"x\"\n\
                       [parameters]\n\"tank.rate\" = {}\n[[run]]\nfile = \"run.csv\"\n";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("decay.toml", DECAY);
    folder.write("problem.toml", PROBLEM);
    let rows = (0..21)
        .map(|k| 0.1 * f64::from(k))
        .map(|t| format!("{t},{}\n", 2.0 * (-0.8 * t).exp()));
    folder.write(
        "run.csv",
        &("time,x\n".to_owned() + &rows.collect::<String>()),
    );
    folder
}

#[test]
fn a_problem_becomes_a_fitted_model_that_is_exported() {
    let folder = folder();
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    assert_eq!(json["status"], "converged");
    let rate = json["parameters"]["tank.rate"]["value"].as_f64().unwrap();
    assert!((rate - 0.8).abs() < 1e-5, "{rate}");
    assert_eq!(json["parameters"]["tank.rate"]["unit"], "1/s");
    let text = folder.read("tank-fitted.toml");
    assert!(
        text.starts_with("# Fitted by pilotage from problem.toml: converged\n"),
        "{text}"
    );
    assert!(
        text.contains(&format!("rate = {{ start = {rate}, unit")),
        "{text}"
    );
    assert_eq!(folder.pilotage(&["export", "tank-fitted.toml"]).code, 0);
    assert_eq!(folder.pilotage(&["validate", "decay.fmu"]).code, 0);
    // Once more over what it wrote before, but not over somebody else's file.
    assert_eq!(folder.pilotage(&["fit", "problem.toml"]).code, 0);
    let refused = folder.pilotage(&["fit", "problem.toml", "-o", "decay.toml"]);
    assert_eq!(refused.code, 2, "{refused:?}");
    assert_eq!(folder.read("decay.toml"), DECAY);
}

/// The covariance in a model file is in the parameters' own units, of one that is sought by its logarithm too.
#[test]
fn a_fitted_model_keeps_how_sure_it_is() {
    let folder = flights(2, 4);
    let sought = "\"m.fast\" = { scale = \"log\" }\n\"m.slow\" = { start = 4 }";
    let text = problem("two", RUNS).replace("\"m.*\" = {}", sought);
    folder.write("log.toml", &text);
    folder.write("again.toml", text.replace("two.toml", "m-fitted.toml"));
    for (input, output) in [
        ("log.toml", "m-fitted.toml"),
        ("again.toml", "again-fitted.toml"),
    ] {
        let json = folder
            .pilotage(&["fit", input, "--json", "-o", output])
            .json();
        let table: toml::Table = folder.read(output).parse().unwrap();
        let own = &table["uncertainty"];
        assert_eq!(own["method"].as_str(), Some("cr3"));
        assert_eq!(
            own["correlated_by"],
            toml::Value::from(json["uncertainty"]["correlated_by"].as_str().unwrap())
        );
        for (k, name) in ["fast", "slow"].into_iter().enumerate() {
            assert_eq!(own["parameters"][k].as_str(), Some(name));
            let sd = own["intervals"][name]["sd"].as_float().unwrap();
            assert_eq!(
                json["parameters"][format!("m.{name}")]["sd"].as_f64(),
                Some(sd)
            );
            let variance = own["covariance"][k][k].as_float().unwrap();
            assert!(
                (variance.sqrt() / sd - 1.0).abs() < 1e-9,
                "{name}: {variance} {sd}"
            );
        }
        let across = own["covariance"][0][1].as_float().unwrap();
        assert_eq!(own["covariance"][1][0].as_float(), Some(across));
        assert_eq!(folder.pilotage(&["model", "check", output]).code, 0);
    }
}

#[test]
fn what_the_problem_says_itself_is_no_flag() {
    let folder = folder();
    for (words, hint) in [
        (vec!["fit", "problem.toml", "--order", "2"], "--order"),
        (
            vec!["fit", "problem.toml", "--column", "time=t"],
            "--column",
        ),
        (vec!["fit", "problem.toml", "run.csv"], "alone"),
    ] {
        let ended = folder.pilotage(&words);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains(hint), "{ended:?}");
    }
}

/// A fitted model says which fit it is from, and what is to be doubted; other commands read that.
#[test]
fn a_fitted_model_says_how_the_fit_ended() {
    let folder = folder();
    let fit = ["fit", "problem.toml", "--random-starts=0"];
    let cut = folder.pilotage(&[&fit[..], &["--max-iterations=1"]].concat());
    assert_eq!(cut.code, 1, "{cut:?}");
    assert!(
        cut.stdout.contains("      --max-iterations above 1\n"),
        "{cut:?}"
    );
    let go_on = "      --start tank.rate=";
    assert!(cut.stdout.contains(go_on), "{cut:?}");
    let kept = |name: &str| folder.read(name).parse::<toml::Table>().unwrap()["fit"].clone();
    let own = kept("tank-fitted.toml");
    assert_eq!(own["converged"].as_bool(), Some(false));
    assert_eq!(own["status"].as_str(), Some("iteration-limit"));
    assert_eq!(own["doubt"][0]["code"].as_str(), Some("not-converged"));
    let sum = sha256(&std::fs::read(folder.path("run.csv")).unwrap());
    assert_eq!(own["data"][0]["sha256"].as_str(), Some(sum.as_str()));
    let checked = folder.pilotage(&["model", "check", "tank-fitted.toml"]);
    for words in [
        "  start values of a fit: iteration-limit\n",
        "  diagnostic [not-converged]: ",
    ] {
        assert!(checked.stdout.contains(words), "{checked:?}");
    }
    let cosim = [
        "cosim",
        "tank-fitted.toml",
        "--stop-time=1",
        "--step=0.1",
        "-o",
        "tank.csv",
    ];
    assert_eq!(folder.pilotage(&cosim).code, 0);
    let refused = folder.pilotage(&["export", "tank-fitted.toml"]);
    let message = "error: tank-fitted.toml: the fit did not converge\n";
    assert!(
        refused.code == 2 && refused.stderr.starts_with(message),
        "{refused:?}"
    );
    let allowed = folder.pilotage(&["export", "tank-fitted.toml", "--allow-unconverged"]);
    assert!(
        allowed.stdout.contains("note: The fit did NOT converge"),
        "{allowed:?}"
    );
    // What a fit of the fitted model says takes the place of that.
    folder.write(
        "again.toml",
        PROBLEM.replace("decay.toml", "tank-fitted.toml"),
    );
    assert_eq!(
        folder
            .pilotage(&["fit", "again.toml", "-o", "again-fitted.toml"])
            .code,
        0
    );
    let own = kept("again-fitted.toml");
    assert_eq!(own["status"].as_str(), Some("converged"));
    assert_eq!(
        (own.get("doubt"), own["data"].as_array().map(Vec::len)),
        (None, Some(1))
    );
    assert_eq!(folder.pilotage(&["export", "again-fitted.toml"]).code, 0);
}

/// What the command says takes precedence over `[fit]`.
#[test]
fn flags_take_precedence_over_the_file() {
    let folder = folder();
    let options = "[fit]\nstarts = 4\nmax_iterations = 500\nscheme = \"trapezoid\"\n";
    folder.write("problem.toml", PROBLEM.to_owned() + options);
    let fit = |flags: &[&str]| {
        let words = [&["fit", "problem.toml", "--json"], flags].concat();
        folder.pilotage(&words).json()
    };
    let own = fit(&[]);
    let count = |fit: &Value| fit["starts"].as_array().unwrap().len();
    assert_eq!(
        (count(&own), &own["mesh"]["scheme"]),
        (4, &"trapezoid".into())
    );
    let other = fit(&["--random-starts=1", "--scheme=euler", "--mesh-step=0.02"]);
    assert_eq!(
        (count(&other), &other["mesh"]["scheme"]),
        (2, &"euler".into())
    );
    assert_eq!(other["mesh"]["intervals"], 100);
    let cut = fit(&["--max-iterations=1", "--random-starts=0"]);
    assert_eq!(cut["status"], "iteration-limit");
    let rough = fit(&["--tolerance=0.1", "--random-starts=0"]);
    let is_less = |key: &str| rough[key].as_f64() < own[key].as_f64();
    assert!(count(&rough) == 1 && is_less("iterations"), "{rough} {own}");
}

/// The recording has the rate 0.8, the model 0.5.
#[test]
fn a_problem_begins_where_the_command_says() {
    let folder = folder();
    let at = |start: &str| {
        let words = [
            "fit",
            "problem.toml",
            "--evaluate",
            "--json",
            "--start",
            start,
        ];
        folder.pilotage(&words)
    };
    for start in ["0.8", "tank.rate=0.8"] {
        let objective = at(start).json()["objective"].as_f64().unwrap();
        assert!(objective < 1e-10, "{objective}");
    }
    // One that stands in a pattern, and has a range in its model.
    let all = PROBLEM.replace("\"tank.rate\" = {}", "\"tank.*\" = {}");
    folder.write("problem.toml", all);
    assert!(at("tank.rate=0.8").json()["objective"].as_f64().unwrap() < 1e-10);
    for (start, words) in [
        (
            "1,2",
            "--start has 2 values, and 1 parameter is sought: tank.rate",
        ),
        (
            "tank.rat=1",
            "nothing that is sought is called `tank.rat`; did you mean `tank.rate`?",
        ),
        ("tank.rate=1,tank.rate=2", "--start has `tank.rate` twice"),
        (
            "tank.rate=1,2",
            "--start has values with a name and values without one",
        ),
        (
            "tank.rate=-1",
            "`tank.rate` starts at -1, out of its range 0 to inf",
        ),
    ] {
        let ended = at(start);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains(words), "{ended:?}");
    }
    let sensor = PROBLEM.replace("column = \"x\"", "column = \"x\"\ngain = \"free\"");
    folder.write("problem.toml", sensor);
    let ended = at("gain(x)=2");
    assert!(
        ended.code == 2 && ended.stderr.contains("`gain(x)` is of a sensor"),
        "{ended:?}"
    );
}

/// Of squares `Σ (y - x)²` with `x = 2 e^(-k t)`: value and derivative by hand.
#[test]
fn a_problem_is_evaluated_at_its_start() {
    let json = folder()
        .pilotage(&["fit", "problem.toml", "--evaluate", "--json"])
        .json();
    let times = (0..21).map(|k| 0.1 * f64::from(k));
    let (mut objective, mut slope) = (0.0, 0.0);
    for t in times {
        let (y, x) = (2.0 * (-0.8 * t).exp(), 2.0 * (-0.5 * t).exp());
        objective += (y - x).powi(2);
        slope += 2.0 * (y - x) * t * x;
    }
    let value = |value: &Value| value.as_f64().unwrap();
    assert!((value(&json["objective"]) / objective - 1.0).abs() < 1e-5);
    assert!((value(&json["gradient"]["tank.rate"]) / slope - 1.0).abs() < 1e-4);
    let residual = value(&json["runs"][0]["residuals"]["x"][20]);
    assert!((residual - (2.0 * (-1.6_f64).exp() - 2.0 * (-1.0_f64).exp())).abs() < 1e-5);
}

/// More rows than a fit can hold are refused as soon as they are read.
#[test]
fn too_many_rows_are_refused_with_a_number_that_is_not() {
    let folder = Folder::new();
    let rows = (0..1_000_001).map(|k| format!("{k},1\n"));
    folder.write(
        "rows.csv",
        "time,u\n".to_owned() + &rows.collect::<String>(),
    );
    folder.write("gain.toml", "[model]\nname = \"gain\"\n[inputs]\nu = {}\n[parameters]\nk = { start = 2 }\n[outputs]\ny = { value = \"k * u\" }\n");
    folder.write(
        "problem.toml",
        "[system.m]\nmodel = \"gain.toml\"\n[inputs]\n\"m.u\" = { column = \"u\" }\n[[measured]]\nsignal = \"m.y\"\n\
         column = \"u\"\n[parameters]\n\"m.k\" = {}\n[[run]]\nfile = \"rows.csv\"\n",
    );
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    let message = "the runs have 1000001 rows, more than 1000000, and a fit takes about 5 kB for each; keep one in 2 of them";
    assert!(ended.stderr.contains(message), "{ended:?}");
}

/// A run that is kept out of the fit is simulated with what was found, from its own numbers.
#[test]
fn a_validation_run_judges_the_fit() {
    let folder = folder();
    let problem = format!("{PROBLEM}[[run]]\nfile = \"other.csv\"\nuse = \"validation\"\n");
    folder.write("problem.toml", &problem);
    // Off by 0.1 everywhere.
    let rows = (0..11).map(|k| 0.3 * f64::from(k));
    let rows = rows.map(|t| format!("{t},{}\n", 2.0 * (-0.8 * t).exp() + 0.1));
    folder.write(
        "other.csv",
        "time,x\n".to_owned() + &rows.collect::<String>(),
    );
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    let rate = json["parameters"]["tank.rate"]["value"].as_f64().unwrap();
    assert!((rate - 0.8).abs() < 1e-5, "{rate}");
    let [fitted, other] = [0, 1].map(|k| json["runs"][k].clone());
    assert_eq!(
        (fitted["use"].as_str(), other["use"].as_str()),
        (Some("fit"), Some("validation"))
    );
    let rms = other["measured"]["x"]["rms_residual"].as_f64().unwrap();
    assert!((rms - 0.1).abs() < 1e-4, "{rms}");
}

/// What `init` writes for the shipped flights is the problem of the short form: the same optimum.
#[test]
fn init_writes_the_problem_of_the_short_form() {
    let folder = Folder::new();
    let mut runs: Vec<String> = [
        "10m-run1", "10m-run2", "10m-run3", "20m-run1", "20m-run2", "20m-run3",
    ]
    .map(|name| {
        example("trials")
            .join(format!("{name}.csv"))
            .display()
            .to_string()
    })
    .to_vec();
    let mut init: Vec<&str> = vec!["init", "-o", "problem.toml"];
    init.extend(runs.iter().map(String::as_str));
    let ended = folder.pilotage(&init);
    assert_eq!(ended.code, 0, "{ended:?}");
    // It prints the same, and writes over nothing that it has not written.
    init[1] = "--pilot";
    init[2] = "linear";
    assert_eq!(folder.pilotage(&init).stdout, folder.read("problem.toml"));
    folder.write("problem.toml", "[mine]\n");
    init[1] = "-o";
    init[2] = "problem.toml";
    assert_eq!(folder.pilotage(&init).code, 2);
    init.push("--force");
    assert_eq!(folder.pilotage(&init).code, 0);
    // From near the optimum, on the mesh of the short form.
    let theta = [1.9, 3.7, 2.7, -1e-4, -0.1, -0.065];
    let mut text = folder
        .read("problem.toml")
        .replace("mesh_tolerance = 1e-6", "mesh = \"samples\"\nstarts = 1");
    for (k, (theta, start)) in theta
        .iter()
        .zip(["216.0", "108.0", "18.0", "21.6", "0.0", "0.0"])
        .enumerate()
    {
        let line = |value: &str| format!("\"pilot.theta{}\" = {{ start = {value} }}", k + 1);
        let (old, new) = (line(start), line(&theta.to_string()));
        assert!(text.contains(&old), "{text}");
        text = text.replace(&old, &new);
    }
    folder.write("near.toml", &text);
    let found = folder.pilotage(&["fit", "near.toml", "--json"]).json();
    runs.insert(0, "fit".into());
    runs.extend(["-o", "short.toml", "--json"].map(str::to_owned));
    let short: Vec<&str> = runs.iter().map(String::as_str).collect();
    let short = folder.pilotage(&short).json();
    let [own, other] = [&found, &short].map(|json| json["objective"].as_f64().unwrap());
    assert!((own / other - 1.0).abs() < 1e-6, "{own} {other}");
}

/// The paper's Fig. 2 on the shipped flights: each fit is the better one at what it was asked for.
#[test]
fn response_and_stick_are_fitted_side_by_side() {
    let folder = Folder::new();
    let trials = example("trials").join("trials.toml").display().to_string();
    let words = [
        "fit",
        &trials,
        "--objective",
        "both",
        "--report",
        "both.html",
        "--json",
    ];
    let json = folder.pilotage(&words).json();
    assert_eq!(
        folder.files(),
        ["both.html", "pilot-stick.toml", "pilot.toml"]
    );
    let sum = |name: &str| -> f64 {
        let runs = json["flown_alone"].as_array().unwrap().iter();
        runs.map(|run| run[name].as_f64().unwrap().powi(2)).sum()
    };
    assert!(sum("response_rms_m") < sum("stick_rms_m"));
    assert!(folder.read("both.html").contains("stick fit"));
    let alone = folder
        .pilotage(&["fit", &trials, "-o", "alone.toml", "--json"])
        .json();
    assert_eq!(json["response"]["theta"], alone["theta"]);
}
