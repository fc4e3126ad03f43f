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
    let told = format!(
        "# x is the first of {} (run.csv), {} (other.csv)\n",
        begin("run.csv"),
        begin("other.csv")
    );
    assert!(fitted.contains(&told), "{fitted}");
    assert!((flown(&folder)[0] - 2.0).abs() < 1e-6, "{fitted}");
}
