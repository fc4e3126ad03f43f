//! Runs and the models that are fitted to them: names, times, what stands where a run begins, models at rest, and what
//! speaks against a fit.

use pilotage_estimation::evaluate::evaluate;
use pilotage_estimation::part::Part;
use pilotage_estimation::result::StartEnd;
use pilotage_estimation::validation::validated;
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_sdk::{At, Equations, Scalar, Table};
use std::ops::ControlFlow;
use std::path::Path;
use tempfile::TempDir;

/// A decay that can be stopped: ẋ = -rate x while nothing is set.
const DECAY: &str = r#"[model]
name = "decay"
[inputs]
flow = { unit = "1/h" }
[parameters]
rate = { start = 0.5, unit = "1/h" }
[states]
x = { start = 2, unit = "1", der = "(flow - rate * x) / hour" }
[parameters.hour]
start = 3600
"#;

const PROBLEM: &str = r#"[system.tank]
model = "tank.toml"
[[measured]]
signal = "tank.x"
column = "x"
[parameters]
"tank.rate" = {}
"#;

/// A folder with these files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, text).expect("written");
    }
    folder
}

/// The fit of a problem, or why there is none.
fn fitted(text: &str, folder: &Path) -> Result<Fit, String> {
    let shown = |error: pilotage_estimation::ProblemError| error.to_string();
    let file = ProblemFile::parse(text, &folder.join("problem.toml")).map_err(shown)?;
    let posed = Posed::new(&file, &part::open).map_err(shown)?;
    Ok(fit(&posed, &mut |_| ControlFlow::Continue(())))
}

fn found(text: &str, folder: &TempDir) -> Fit {
    fitted(text, folder.path()).unwrap_or_else(|error| panic!("{error}"))
}

fn codes(fit: &Fit) -> Vec<&'static str> {
    fit.diagnostics.iter().map(|own| own.code()).collect()
}

/// Samples of `f` under a header.
fn table(header: &str, times: impl Iterator<Item = f64>, f: impl Fn(f64) -> f64) -> String {
    let rows = times.map(|t| format!("{t},{}\n", f(t)));
    format!("{header}\n") + &rows.collect::<String>()
}

fn hours() -> impl Iterator<Item = f64> {
    (0..=20).map(|k| 0.25 * f64::from(k))
}

fn run(name: &str) -> String {
    format!("[[run]]\nfile = \"{name}\"\n")
}

#[test]
fn runs_are_called_by_the_end_of_their_path_that_tells_them_apart() {
    let data = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp());
    let files = ["a/run.csv", "b/run.csv", "b/c/run.csv", "other.csv"];
    let mut all: Vec<(&str, &str)> = files.iter().map(|name| (*name, data.as_str())).collect();
    all.push(("tank.toml", DECAY));
    let folder = folder(&all);
    let runs: String = files.iter().map(|name| run(name)).collect();
    let again = "[[run]]\nfile = \"./other.csv\"\nset = { \"tank.hour\" = 3601 }\n";
    let problem = format!("{PROBLEM}[\"initial\"]\n\"tank.x\" = \"free\"\n{runs}{again}");
    let fit = found(&problem, &folder);
    let names: Vec<&str> = fit.runs.iter().map(|run| run.name.as_str()).collect();
    let expected = [
        "a/run.csv",
        "b/run.csv",
        "c/run.csv",
        "other.csv",
        "other.csv#2",
    ];
    assert_eq!(names, expected);
}

#[test]
fn a_run_that_is_fitted_twice_is_refused() {
    let data = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp());
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let twice = |second: &str| {
        let other = format!("[[run]]\nfile = \"./run.csv\"\n{second}");
        fitted(
            &format!("{PROBLEM}{}{other}", run("run.csv")),
            folder.path(),
        )
    };
    let refused = twice("weight = 2\n").expect_err("it is the same");
    assert!(
        refused.ends_with(
            "problem.toml:11:8: run.csv stands twice with the same settings, and its data would count twice; leave one \
             out, or write weight = 2 at the other"
        ),
        "{refused}"
    );
    assert!(twice("use = \"validation\"\n").is_ok());
    assert!(twice("subject = \"B\"\n").is_ok());
}

/// What a problem fixes holds in the runs that are not fitted too, whatever the model file says.
#[test]
fn a_fixed_parameter_holds_in_validation_runs() {
    let tank = DECAY
        .replace("flow - rate * x", "flow + push - rate * x")
        .replace("[states]", "push = { start = 9, unit = \"1/h\" }\n[states]");
    let data = table("time [h],x", hours(), |t| 0.5 + 1.5 * (-0.8 * t).exp());
    let folder = folder(&[("tank.toml", &tank), ("run.csv", &data), ("own.csv", &data)]);
    let own = "\"tank.push\" = { value = \"0.4 * part\" }\npart = { start = 1, fixed = true }\n";
    for line in ["\"tank.push\" = { start = 0.4, fixed = true }\n", own] {
        let text = format!(
            "{PROBLEM}{line}{}[[run]]\nfile = \"own.csv\"\nuse = \"validation\"\n",
            run("run.csv")
        );
        let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("read");
        let posed = Posed::new(&file, &part::open).expect("posed");
        let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
        let judged = validated(&file, &found, &part::open, &|| ControlFlow::Continue(()));
        let judged = judged.expect("judged");
        for (own, fitted) in judged[0].run.predicted[0]
            .iter()
            .zip(&found.runs[0].predicted[0])
        {
            assert!((own - fitted).abs() < 1e-4, "{own} is not {fitted}");
        }
    }
}

/// The decay of the model file, in Rust.
struct Decay;

impl Equations for Decay {
    fn table(&self) -> Table {
        Table::new("decay", "It can be stopped.")
            .input("flow", "1/h", "What flows in")
            .parameter("rate", "1/h", 0.5, "What flows out")
            .parameter("full", "1", 5.0, "What the gauge shows at most")
            .output_state("x", "1", 2.0, "What is left")
            .output("gauge", "1", "What is shown")
            .limited("gauge", "full")
    }

    fn output<T: Scalar>(&self, at: At<T>, y: &mut [T]) {
        y[0] = at.x[0];
    }

    fn derivative<T: Scalar>(&self, At { x, u, p, .. }: At<T>, dx: &mut [T]) {
        dx[0] = (u[0] - p[0] * x[0]) / 3600.0;
    }
}

/// What is written in Rust is fitted as what is written in a file.
#[test]
fn equations_in_rust_are_fitted() {
    let data = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp());
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let text = format!("{PROBLEM}{}", run("run.csv"));
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("read");
    let posed = Posed::new(&file, &|_| Part::of_equations(&Decay)).expect("posed");
    let own = fit(&posed, &mut |_| ControlFlow::Continue(()));
    let other = found(&text, &folder);
    assert!(own.is_answer(), "{:?}", own.diagnostics);
    let rates = [&own, &other].map(|fit| fit.parameters[0].mean());
    assert!(
        (rates[0] - 0.8).abs() < 1e-5 && (rates[0] - rates[1]).abs() < 1e-9,
        "{rates:?}"
    );
    assert_eq!(own.parameters[0].unit.as_deref(), Some("1/h"));
    // Its limit as a constraint; by default it saturates, without one.
    let is_limit = |name: &String| name.contains("tank.gauge");
    assert!(!posed.names.bounds.iter().any(is_limit));
    let file = ProblemFile::parse(
        &(text + "[fit]\nlimits = \"constrain\"\n"),
        &folder.path().join("problem.toml"),
    );
    let file = file.expect("read");
    let posed = Posed::new(&file, &|_| Part::of_equations(&Decay)).expect("posed");
    assert!(posed.names.bounds.iter().any(is_limit), "{:?}", posed.names);
}

/// Each subject's sensor keeps its gain in runs that are not fitted, and a run may set another.
#[test]
fn a_sensor_keeps_the_gain_of_its_subject_in_validation_runs() {
    let seen = |gain: f64| table("time [h],x", hours(), |t| gain * 2.0 * (-0.8 * t).exp());
    let folder = folder(&[
        ("tank.toml", DECAY),
        ("a.csv", &seen(1.2)),
        ("b.csv", &seen(0.7)),
        ("c.csv", &seen(3.0)),
    ]);
    let of = |name: &str, more: &str| format!("{}{more}", run(name));
    let judged = "use = \"validation\"\n";
    let runs = [
        of("a.csv", "subject = \"A\"\n"),
        of("b.csv", "subject = \"B\"\n"),
        of("b.csv", &format!("subject = \"B\"\n{judged}")),
        of("a.csv", &format!("subject = \"A\"\n{judged}")),
        of("c.csv", &format!("set = {{ \"gain(x)\" = 3 }}\n{judged}")),
    ];
    let problem = PROBLEM.replace("[parameters]", "gain = { per = \"subject\" }\n[parameters]");
    let text = problem + &runs.concat();
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("read");
    let posed = Posed::new(&file, &part::open).expect("posed");
    let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
    let judged = validated(&file, &found, &part::open, &|| ControlFlow::Continue(()));
    let judged = judged.expect("judged");
    assert_eq!(judged.len(), 3);
    for own in &judged {
        let largest = own
            .run
            .residuals(0, file.measured[0].noise)
            .iter()
            .fold(0.0, |most: f64, e| most.max(e.abs()));
        assert!(largest < 1e-5, "{}: {largest}", own.run.name);
    }
}

/// A run that sets a gain has no value of its own for it: the gain sought per run or subject is that of the others, also
/// in their mean, and the fit is in no doubt about it. A subject whom no fitted run knows gets the mean, and is named.
#[test]
fn runs_that_set_a_gain_do_not_seek_it() {
    let seen = |gain: f64| table("time [h],x", hours(), |t| gain * 2.0 * (-0.8 * t).exp());
    let folder = folder(&[
        ("tank.toml", DECAY),
        ("a.csv", &seen(1.2)),
        ("b.csv", &seen(0.8)),
        ("c.csv", &seen(3.0)),
        ("d.csv", &seen(1.0)),
    ]);
    let of = |name: &str, more: &str| format!("{}{more}", run(name));
    for per in ["run", "subject"] {
        let runs = [
            of("a.csv", "subject = \"A\"\n"),
            of("b.csv", "subject = \"B\"\n"),
            of("c.csv", "set = { \"gain(x)\" = 3 }\n"),
            of("d.csv", "subject = \"D\"\nuse = \"validation\"\n"),
        ];
        let problem = PROBLEM.replace(
            "[parameters]",
            &format!("gain = {{ per = \"{per}\" }}\n[parameters]"),
        );
        let text = problem + &runs.concat();
        let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("read");
        let posed = Posed::new(&file, &part::open).expect("posed");
        let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
        let gain = (found.parameters.iter()).find(|own| own.name == "gain(x)");
        let gain = gain.expect("sought");
        let values: Vec<f64> = gain.values.iter().map(|own| own.1).collect();
        assert_eq!(values.len(), 2, "{per}: {gain:?}");
        assert!(
            (values[0] - 1.2).abs() < 1e-5 && (values[1] - 0.8).abs() < 1e-5,
            "{values:?}"
        );
        assert!((gain.mean() - 1.0).abs() < 1e-5, "{per}: {gain:?}");
        assert!(found.is_answer(), "{:?}", found.diagnostics);
        assert!(
            !codes(&found).contains(&"undetermined"),
            "{:?}",
            found.diagnostics
        );
        let sure = found.uncertainty.as_ref().expect("intervals");
        let intervals: Vec<usize> = sure.intervals.iter().map(Vec::len).collect();
        let sizes: Vec<usize> = found
            .parameters
            .iter()
            .map(|own| own.values.len())
            .collect();
        assert_eq!(intervals, sizes);
        assert_eq!(posed.count(), 3, "rate and two gains");
        let goes_on = || ControlFlow::Continue(());
        let judged = validated(&file, &found, &part::open, &goes_on).expect("judged");
        let own = &judged[0];
        let residuals = own.run.residuals(0, file.measured[0].noise);
        assert!(residuals.iter().all(|e| e.abs() < 1e-5), "{per}");
        let averaged: &[&str] = if per == "subject" { &["gain(x)"] } else { &[] };
        assert_eq!(own.averaged, averaged);
    }
}

/// ẋ = flow - 0.8 x in hours, with a flow of 1 from 2 h on, begun an hour before the first row: the solution by hand.
#[test]
fn times_of_a_problem_have_the_unit_of_the_runs() {
    let level = |t: f64| {
        let before = |t: f64| 2.0 * (-0.8 * (t + 1.0)).exp();
        match t <= 2.0 {
            true => before(t),
            false => 1.25 + (before(2.0) - 1.25) * (-0.8 * (t - 2.0)).exp(),
        }
    };
    let settings = |start: &str, change: &str| {
        format!(
            "start_time = {start}\n[[run.change]]\ntime = {change}\nset = {{ \"tank.flow\" = 1 }}\n"
        )
    };
    let shipped = [
        ("h", 1.0, settings("-1", "2")),
        ("min", 60.0, settings("-60", "120")),
        ("s", 3600.0, settings("-3600", "7200")),
        (
            "d",
            1.0 / 24.0,
            settings("-0.0416666666666666667", "0.0833333333333333333"),
        ),
    ];
    for (unit, units, settings) in shipped {
        let data = table(
            &format!("time [{unit}],x"),
            hours().map(|t| t * units),
            |t| level(t / units),
        );
        let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
        let fit = found(&format!("{PROBLEM}{}{settings}", run("run.csv")), &folder);
        let rate = fit.parameters[0].mean();
        assert!((rate - 0.8).abs() < 1e-5, "{unit}: {rate}");
    }
}

#[test]
fn times_out_of_a_run_are_told_in_its_unit() {
    let data = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp());
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let change = "[[run.change]]\ntime = 7200\nset = { \"tank.flow\" = 1 }\n";
    let message = fitted(
        &format!("{PROBLEM}{}{change}", run("run.csv")),
        folder.path(),
    )
    .expect_err("late");
    assert!(
        message.contains("a change at 7200 h is not within")
            && message.ends_with("run.csv, from 0 h to before 5 h"),
        "{message}"
    );
}

/// What was recorded later is no initial value: of the start counts what stands there, of replicates their mean.
#[test]
fn the_first_sample_is_that_of_the_start() {
    let later =
        table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp()).replace("\n0,2\n", "\n0,\n");
    let twice = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp())
        .replace("\n0,2\n", "\n0,1.9\n0,2.2\n");
    let folder = folder(&[
        ("tank.toml", DECAY),
        ("later.csv", &later),
        ("twice.csv", &twice),
    ]);
    let problem = |name: &str| {
        format!(
            "{PROBLEM}[initial]\n\"tank.x\" = \"first sample\"\n{}",
            run(name)
        )
    };
    let fit = found(&problem("twice.csv"), &folder);
    assert!(
        (fit.runs[0].states[0][0] - 2.05).abs() < 1e-9,
        "{:?}",
        fit.runs[0].states[0][0]
    );
    let before = problem("twice.csv") + "start_time = -1\n";
    for (problem, when) in [(problem("later.csv"), "0 h"), (before, "-1 h")] {
        let message = fitted(&problem, folder.path()).expect_err("nothing stands there");
        let end =
            format!("the column `x` has no sample at {when}, where the run begins; write \"free\"");
        assert!(
            message.ends_with(&end) && message.contains("problem.toml:9:1: "),
            "{message}"
        );
    }
}

/// y = gain u + offset: the regression line by hand.
#[test]
fn a_model_without_states_is_fitted() {
    let model = "[model]\nname = \"line\"\n[inputs]\nu = {}\n[parameters]\ngain = 1\noffset = 0\n[outputs]\n\
                 y = \"gain * u + offset\"\n";
    let (u, y) = ([0.0, 1.0, 2.0, 3.0, 5.0], [0.9, 3.2, 4.8, 7.1, 11.0]);
    let rows = u.iter().zip(&y).enumerate();
    let rows: String = rows.map(|(k, (u, y))| format!("{k},{u},{y}\n")).collect();
    let folder = folder(&[
        ("line.toml", model),
        ("run.csv", &format!("time,u,y\n{rows}")),
    ]);
    let problem = "[system.line]\nmodel = \"line.toml\"\n[inputs]\n\"line.u\" = \"u\"\n[[measured]]\nsignal = \"line.y\"\n\
                   column = \"y\"\n[parameters]\n\"line.*\" = {}\n[[run]]\nfile = \"run.csv\"\n";
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    let (mu, my) = (mean(&u), mean(&y));
    let pairs = || u.iter().zip(&y).map(|(u, y)| (u - mu, y - my));
    let slope = pairs().map(|(u, y)| u * y).sum::<f64>() / pairs().map(|(u, _)| u * u).sum::<f64>();
    let fit = found(problem, &folder);
    assert!(fit.is_answer(), "{}", fit.status);
    let [gain, offset] = [0, 1].map(|k| fit.parameters[k].mean());
    assert!((gain - slope).abs() < 1e-8, "{gain} {slope}");
    assert!((offset - (my - slope * mu)).abs() < 1e-8, "{offset}");
    assert!(fit.poles.is_empty(), "{:?}", fit.poles);
}

/// Limits at the start and at the end of a run are of different instants.
#[test]
fn limits_at_the_start_and_at_the_end_may_differ() {
    let data = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp());
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let constraint = |at: &str, min: f64, max: f64| {
        format!(
            "[[constraint]]\nexpression = \"tank.x\"\nmin = {min}\nmax = {max}\nat = \"{at}\"\n"
        )
    };
    let problem = |all: &[String]| {
        let all = all.concat();
        format!(
            "{PROBLEM}[initial]\n\"tank.x\" = \"free\"\n{all}{}",
            run("run.csv")
        )
    };
    let [start, end] = [constraint("start", 1.5, 3.0), constraint("end", 0.1, 0.2)];
    let fit = found(&problem(&[start.clone(), end]), &folder);
    assert!(fit.is_answer(), "{}", fit.status);
    let states = &fit.runs[0].states[0];
    assert!(
        states[0] > 1.5 && states[states.len() - 1] > 0.1 - 1e-7,
        "{states:?}"
    );
    // What holds at all samples holds at the first one.
    for all in [
        [start.clone(), constraint("samples", 0.0, 1.0)],
        [constraint("samples", 0.0, 1.0), start],
    ] {
        let message =
            fitted(&problem(&all), folder.path()).expect_err("they contradict each other");
        assert!(
            message.contains("by what else is said, never from"),
            "{message}"
        );
    }
}

/// A fast decay on its few samples: each interval is some time constants long.
#[test]
fn a_coarse_mesh_is_told_whoever_asked_for_it() {
    let data = table("time [h],x", hours().map(|t| 4.0 * t), |t| {
        2.0 * (-0.8 * t).exp()
    });
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let with = |mesh: &str| {
        codes(&found(
            &format!("{PROBLEM}{}[fit]\n{mesh}\n", run("run.csv")),
            &folder,
        ))
    };
    assert!(with("mesh = \"samples\"\nscheme = \"euler\"").contains(&"mesh-error"));
    assert!(with("mesh_step = 7200\nscheme = \"euler\"").contains(&"mesh-error"));
    for fine in ["mesh_step = 60", "mesh_tolerance = 1e-6"] {
        assert!(!with(fine).contains(&"mesh-error"), "{fine}");
    }
}

/// ẋ = growth x, which no wire leads back.
#[test]
fn a_system_that_grows_is_told_though_it_has_no_wires() {
    let data = table("time [h],x", hours(), |t| 2.0 * (0.3 * t).exp());
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let problem = format!("{PROBLEM}{}", run("run.csv"));
    let fit = found(&problem, &folder);
    assert!(
        (fit.parameters[0].mean() + 0.3).abs() < 1e-5,
        "{:?}",
        fit.parameters
    );
    assert_eq!(codes(&fit), ["unstable-loop"]);
    assert!(fit.diagnostics[0].to_string().contains("add [stability]"));
    // Kept stable it is not what was recorded, and says so.
    let kept = found(
        &format!("{problem}[stability]\nclosed_loop = true\n"),
        &folder,
    );
    assert_eq!(kept.status, pilotage_sqp::Status::Converged);
    assert!(!kept.is_answer());
    assert_eq!(codes(&kept), ["loop-on-bound", "nothing-explained"]);
}

/// x = 1 at the start and at least 3 at the end, but the rate is at least 0: nothing fulfils that.
#[test]
fn what_cannot_be_fulfilled_is_named() {
    let data = table("time [h],x", hours(), |t| 2.0 * (-0.8 * t).exp());
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let problem = PROBLEM.replace("\"tank.rate\" = {}", "\"tank.rate\" = { min = 0 }");
    let constraint = "[[constraint]]\nexpression = \"tank.x\"\nmin = 3\nat = \"end\"\n";
    let fit = found(&format!("{problem}{constraint}{}", run("run.csv")), &folder);
    assert_eq!(fit.status.as_str(), "infeasible");
    assert!(codes(&fit).contains(&"violated"), "{:?}", fit.diagnostics);
    let words: Vec<String> = fit.diagnostics.iter().map(|own| own.to_string()).collect();
    // Either of the two gives way, whichever start comes nearest.
    let either = [
        "the range of `tank.rate` is violated by ",
        "the constraint on `tank.x` in run.csv is violated by ",
    ];
    let is_either = |own: &String| either.iter().any(|words| own.starts_with(words));
    assert!(words.iter().any(is_either), "{words:?}");
}

/// y = sin(5 t) begun at 5 rad/s and far from it, where other waves are optima of their own.
#[test]
fn an_optimum_that_one_start_alone_has_found_is_told() {
    let model = "[model]\nname = \"wave\"\n[parameters]\nomega = { start = 5, unit = \"rad/s\", min = 0.5, max = 50 }\n\
                 [outputs]\ny = \"sin(omega * time)\"\n";
    let data = table("time [s],y", (0..100).map(|k| 0.1 * f64::from(k)), |t| {
        (5.0 * t).sin() + 0.1 * (17.0 * t).cos()
    });
    let folder = folder(&[("wave.toml", model), ("run.csv", &data)]);
    let problem = "[system.wave]\nmodel = \"wave.toml\"\n[[measured]]\nsignal = \"wave.y\"\ncolumn = \"y\"\n[parameters]\n\
                   \"wave.omega\" = {}\n[[run]]\nfile = \"run.csv\"\n[fit]\nstarts = 4\n";
    let fit = found(problem, &folder);
    assert!(
        (fit.parameters[0].mean() - 5.0).abs() < 0.01,
        "{:?}",
        fit.parameters
    );
    assert_eq!(
        (fit.agreeing(), codes(&fit)),
        (1, vec!["alone"]),
        "{:?}",
        fit.starts
    );
    // One that has not converged is no optimum, whatever its objective.
    let mut other = fit.clone();
    other.starts.push(StartEnd {
        status: pilotage_sqp::Status::IterationLimit,
        objective: 0.0,
        ..other.starts[0].clone()
    });
    assert_eq!(other.agreeing(), 1);
}

/// At the start x = 2 e^(-t/2): the residuals of log-normal noise are those of the logarithms.
#[test]
fn an_evaluation_has_the_residuals_of_its_noise() {
    let recorded = |t: f64| 2.0 * (-0.8 * t).exp();
    let data = table("time [h],x", hours(), recorded);
    let folder = folder(&[("tank.toml", DECAY), ("run.csv", &data)]);
    let noise = "column = \"x\"\nsd = 0.1\nnoise = \"log-normal\"\n";
    let problem = PROBLEM.replace("column = \"x\"\n", noise) + &run("run.csv");
    let file =
        ProblemFile::parse(&problem, &folder.path().join("problem.toml")).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    let run = &evaluate(&posed).runs[0];
    let residuals = run.residuals(0, file.measured[0].noise);
    for (t, residual) in hours().zip(residuals) {
        assert!(
            (residual - (0.5 - 0.8) * t / 0.1).abs() < 1e-5,
            "{t}: {residual}"
        );
    }
}

/// A loop of ten lags whose time constant grows to ten times its start: the condition that the loop is stable does not hold
/// it back, though its polynomial then is smaller by ten powers of ten.
#[test]
fn stability_of_many_states_holds_no_time_constant_back() {
    const LAGS: usize = 10;
    let lags = (1..=LAGS).map(|k| {
        let before = match k {
            1 => "gain * (target - z)".to_owned(),
            k => format!("l{}", k - 1),
        };
        format!("l{k} = {{ unit = \"1\", der = \"({before} - l{k}) * {LAGS} / tau\" }}\n")
    });
    let model = format!(
        "[model]\nname = \"chain\"\n[inputs]\ntarget = {{ unit = \"1\" }}\n[parameters]\n\
         gain = {{ start = 1, unit = \"1\", min = 0.01, max = 20 }}\n\
         tau = {{ start = 0.1, unit = \"s\", min = 0.01, max = 5 }}\nsecond = {{ start = 1, unit = \"s\" }}\n\
         [states]\n{}z = {{ unit = \"1\", der = \"l{LAGS} / second\" }}\n",
        lags.collect::<String>()
    );
    let (gain, tau) = (0.8, 1.0);
    let target = |t: f64| (0.6 * t).sin() + 0.8 * (1.6 * t + 1.0).sin();
    let derivative = |t: f64, x: &[f64]| -> Vec<f64> {
        let input = |k: usize| match k {
            0 => gain * (target(t) - x[LAGS]),
            k => x[k - 1],
        };
        let lag = |k: usize| (input(k) - x[k]) * LAGS as f64 / tau;
        (0..LAGS).map(lag).chain([x[LAGS - 1]]).collect()
    };
    // Runge-Kutta in steps of 5 ms, one row every 0.1 s.
    let (mut x, mut rows) = (vec![0.0; LAGS + 1], String::from("time,target,z\n"));
    for i in 0..=4000 {
        let (t, h) = (0.005 * f64::from(i), 0.005);
        if i % 20 == 0 {
            rows += &format!("{t},{},{}\n", target(t), x[LAGS]);
        }
        let moved =
            |k: &[f64], h: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + h * k).collect() };
        let k1 = derivative(t, &x);
        let k2 = derivative(t + h / 2.0, &moved(&k1, h / 2.0));
        let k3 = derivative(t + h / 2.0, &moved(&k2, h / 2.0));
        let k4 = derivative(t + h, &moved(&k3, h));
        for j in 0..x.len() {
            x[j] += h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
        }
    }
    let folder = folder(&[("chain.toml", &model), ("run.csv", &rows)]);
    let problem = "[system.m]\nmodel = \"chain.toml\"\n[inputs]\n\"m.target\" = { column = \"target\", hold = \"linear\" }\n\
                   [[measured]]\nsignal = \"m.z\"\ncolumn = \"z\"\n[parameters]\n\"m.gain\" = {}\n\"m.tau\" = {}\n\
                   [fit]\nstarts = 1\n";
    for stability in ["", "[stability]\nclosed_loop = true\n"] {
        let fit = found(&format!("{problem}{stability}{}", run("run.csv")), &folder);
        assert!(fit.is_answer(), "{stability}: {:?}", fit.diagnostics);
        let values: Vec<f64> = fit.parameters.iter().map(|own| own.mean()).collect();
        // The target is linear between rows: the two are found to a thousandth.
        let is_near = (values[0] - gain).abs() < 1e-2 && (values[1] - tau).abs() < 1e-2;
        assert!(is_near, "{stability}: {values:?}");
    }
}
