//! What a fit of a problem leaves: fitted models, summaries, names of runs.

use crate::command::Folder;

/// A tank whose level relaxes: ẋ = (inflow - rate x) / area.
const TANK: &str = r#"[model]
name = "tank"
[inputs]
inflow = { unit = "1/s" }
[parameters]
rate = { start = 0.5, unit = "1/s", min = 0 }
area = { start = 2, unit = "1" }
other = 1
[states]
x = { der = "other * (inflow - rate * x) / area" }
y.der = "(x - y) / 2"
[outputs]
x = {}
"#;

const PROBLEM: &str = r#"[system.tank]
model = "tank.toml"
set = { other = 1.25 }
[[measured]]
signal = "tank.x"
column = "x"
[parameters]
"tank.rate" = {}
"tank.inflow" = {}
"tank.area" = { start = 4, fixed = true }
[initial]
"tank.x" = "free"
"tank.y" = 0.7
[[run]]
file = "run.csv"
"#;

/// Samples of the tank with those parameters, from `x`.
fn level(x: f64) -> String {
    let (rate, inflow, speed) = (0.8, 0.3, 1.25 / 4.0);
    let rest = inflow / rate;
    let rows = (0..21).map(|k| 0.1 * f64::from(k));
    let rows = rows.map(|t| format!("{t},{}\n", rest + (x - rest) * (-rate * speed * t).exp()));
    "time,x\n".to_owned() + &rows.collect::<String>()
}

fn tank(problem: &str) -> Folder {
    let folder = Folder::new();
    folder.write("tank.toml", TANK);
    folder.write("problem.toml", problem);
    folder.write("run.csv", level(2.0));
    folder
}

/// Column `x` of a result, by the master from the fitted model alone.
fn flown(folder: &Folder) -> Vec<f64> {
    let words = [
        "cosim",
        "tank=tank-fitted.toml",
        "--stop-time",
        "2",
        "--step",
        "0.1",
        "-o",
        "flown.csv",
    ];
    assert_eq!(folder.pilotage(&words).code, 0);
    let result = folder.read("flown.csv");
    let cells = result.lines().skip(1).map(|line| line.split(',').nth(1));
    cells.map(|cell| cell.unwrap().parse().unwrap()).collect()
}

#[test]
fn the_fitted_model_flies_the_run_that_was_fitted() {
    let folder = tank(PROBLEM);
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(ended.stdout.contains("initial state"), "{ended:?}");
    let fitted = folder.read("tank-fitted.toml");
    for line in [
        "area = { start = 4.0, unit",
        "other = 1.25\n",
        "y.start = 0.7\n",
    ] {
        assert!(fitted.contains(line), "{line}: {fitted}");
    }
    let run = level(2.0);
    for (found, line) in flown(&folder).iter().zip(run.lines().skip(1)) {
        let recorded: f64 = line.split(',').nth(1).unwrap().parse().unwrap();
        assert!((found - recorded).abs() < 1e-6, "{found} {line}");
    }
}

/// Of two runs the first one's start is written, and both are told.
#[test]
fn what_differs_between_runs_is_that_of_the_first_in_the_fitted_model() {
    let folder = tank(&format!("{PROBLEM}[[run]]\nfile = \"other.csv\"\n"));
    folder.write("other.csv", level(3.0));
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    let begin = |run: &str| json["initial"]["tank.x"][run].as_f64().unwrap();
    assert!((begin("run.csv") - 2.0).abs() < 1e-6, "{json}");
    assert!((begin("other.csv") - 3.0).abs() < 1e-6, "{json}");
    let fitted = folder.read("tank-fitted.toml");
    let comment = format!(
        "# x is the first of {} (run.csv), {} (other.csv)\n",
        begin("run.csv"),
        begin("other.csv")
    );
    assert!(fitted.contains(&comment), "{fitted}");
    assert!((flown(&folder)[0] - 2.0).abs() < 1e-6, "{fitted}");
}

/// Runs of one base name keep their own parameters and lines.
#[test]
fn runs_with_equal_base_names_are_told_apart() {
    let both = "[[run]]\nfile = \"b/run.csv\"\n";
    let problem = PROBLEM.replace("\"tank.rate\" = {}", "\"tank.rate\" = { per = \"run\" }");
    let folder = tank(&(problem + both));
    folder.write("b/run.csv", level(3.0));
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    let rates = json["parameters"]["tank.rate"]["value"]
        .as_object()
        .unwrap();
    assert_eq!(rates.len(), 2, "{json}");
    for (name, x) in [("run.csv", 2.0), ("b/run.csv", 3.0)] {
        assert!((rates[name].as_f64().unwrap() - 0.8).abs() < 1e-4, "{json}");
        let found = json["initial"]["tank.x"][name].as_f64().unwrap();
        assert!((found - x).abs() < 1e-6, "{json}");
    }
    let text = folder.pilotage(&["fit", "problem.toml"]).stdout;
    for line in [
        "tank.rate (run.csv) ",
        "tank.rate (b/run.csv) ",
        "b/run.csv  x",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
}

/// Residuals at the start values, by hand: rate 0.5 and area 4 where the run has 0.8.
#[test]
fn an_evaluation_sums_up_its_residuals() {
    let folder = tank(&PROBLEM.replace(
        "\"tank.inflow\" = {}\n",
        "\"tank.inflow\" = { start = 0.3 }\n",
    ));
    let text = folder
        .pilotage(&["fit", "problem.toml", "--evaluate"])
        .stdout;
    let speed = 1.25 / 4.0;
    let x = |rate: f64, t: f64| 0.3 / rate + (2.0 - 0.3 / rate) * (-rate * speed * t).exp();
    let times = (0..21).map(|k| 0.1 * f64::from(k));
    let sum: f64 = times.map(|t| (x(0.8, t) - x(0.5, t)).powi(2)).sum();
    let line = text.lines().last().unwrap();
    let cells: Vec<&str> = line.split_whitespace().collect();
    assert_eq!(cells[..3], ["run.csv", "x", "21"], "{text}");
    let rms: f64 = cells[3].parse().unwrap();
    assert!((rms / (sum / 21.0).sqrt() - 1.0).abs() < 1e-3, "{text}");
}

/// `init` writes a file that is to be edited, and leaves it alone then.
#[test]
fn init_does_not_write_over_what_was_edited() {
    let folder = tank(PROBLEM);
    let init = |force: &[&str]| {
        let words = ["init", "run.csv", "--model", "tank.toml", "-o", "mine.toml"];
        folder.pilotage(&[&words, force].concat())
    };
    assert_eq!(init(&[]).code, 0);
    assert_eq!(init(&[]).code, 0);
    let edited = folder.read("mine.toml") + "# edited\n";
    folder.write("mine.toml", &edited);
    let refused = init(&[]);
    assert_eq!(refused.code, 2, "{refused:?}");
    assert!(refused.stderr.contains("--force"), "{refused:?}");
    assert_eq!(folder.read("mine.toml"), edited);
    assert_eq!(init(&["--force"]).code, 0);
    assert!(folder.read("mine.toml") != edited);
}

/// A device that never ends is no run.
#[cfg(target_os = "linux")]
#[test]
fn a_run_without_end_is_refused() {
    let folder = tank(&PROBLEM.replace("\"run.csv\"", "\"/dev/zero\""));
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    assert!(
        ended
            .stderr
            .contains("/dev/zero:1: a line longer than 16 MiB"),
        "{ended:?}"
    );
}

/// A file that nothing would be written to is told before the fit.
#[test]
fn an_output_without_a_fitted_instance_is_refused() {
    let problem = PROBLEM
        .replace("\"tank.rate\" = {}\n\"tank.inflow\" = {}\n", "")
        .replace("column = \"x\"\n", "column = \"x\"\ngain = \"free\"\n");
    let folder = tank(&problem);
    let ended = folder.pilotage(&["fit", "problem.toml", "-o", "found.toml"]);
    assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
    let why = "error: nothing is sought in an instance with a model, so there is nothing to write to found.toml";
    assert!(ended.stderr.starts_with(why), "{ended:?}");
    assert_eq!(folder.pilotage(&["fit", "problem.toml"]).code, 0);
}

/// A tied parameter stays in its model's range, so that what is written is read again.
#[test]
fn a_tied_parameter_keeps_its_models_range() {
    // Without the range the area of the best fit is 3.2, of which the tank's rate is a part.
    let problem = PROBLEM
        .replace(
            "\"tank.area\" = { start = 4, fixed = true }",
            "\"tank.area\" = { value = \"4 * share\" }\nshare = { start = 1.2 }",
        )
        .replace(
            "\"tank.rate\" = {}\n",
            "\"tank.rate\" = { start = 0.8, fixed = true }\n",
        );
    let folder = tank(&problem);
    let limited = TANK.replace(
        "area = { start = 2, unit = \"1\" }",
        "area = { start = 5, unit = \"1\", min = 4.4 }",
    );
    folder.write("tank.toml", limited);
    let ended = folder.pilotage(&["fit", "problem.toml", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let area = ended.json()["parameters"]["tank.area"]["value"]
        .as_f64()
        .unwrap();
    assert!((area - 4.4).abs() < 1e-6, "{area}");
    let checked = folder.pilotage(&["model", "check", "tank-fitted.toml"]);
    assert_eq!(checked.code, 0, "{checked:?}");
}

const DECAY: &str = r#"[model]
name = "d"
[parameters]
k = 1
[states]
x = { start = 1, der = "-k * x" }
"#;

/// A decay with four samples, and what is known beforehand of its rate.
fn decay(prior: &str) -> Folder {
    let problem = format!(
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n[parameters]\n\
         \"m.k\" = {{ prior = {{ normal = {prior} }} }}\n[[run]]\nfile = \"run.csv\"\n"
    );
    let folder = Folder::new();
    folder.write("m.toml", DECAY);
    folder.write("run.csv", "time,x\n0,1\n0.5,0.8\n1,0.4\n2,0.13\n");
    folder.write("problem.toml", problem);
    folder
}

/// Where the decay is over at the second sample: `0.8² + 0.4² + 0.13²`.
const OVER: f64 = 0.8169;

#[test]
fn the_answer_is_that_of_the_refined_mesh() {
    let json = decay("[1e6, 1e-9]").pilotage(&["fit", "problem.toml", "--json"]);
    let json = json.json();
    assert!((json["objective"].as_f64().expect("a number") - OVER).abs() < 1e-4);
}

#[test]
fn an_objective_that_no_simulation_has_is_doubted_whatever_ended_the_fit() {
    let json = decay("[100, 1e-3]").pilotage(&["fit", "problem.toml", "--json"]);
    let json = json.json();
    let objective = json["objective"].as_f64();
    let is_true = objective.is_none_or(|own| (own - OVER).abs() < 1e-2);
    let doubts = json["doubts"].as_array().expect("a list");
    assert!(
        is_true || doubts.iter().any(|own| own["code"] == "simulation"),
        "{json}"
    );
}
