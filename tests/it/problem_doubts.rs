//! What a fit of a problem says where its answer is none, or where there can be none.

use crate::command::{Ended, Folder};
use serde_json::Value;

/// `ẋ = -k x + b`, with a tied parameter, from a given initial state.
const MODEL: &str = "[model]\nname = \"m\"\n[parameters]\nk = 1\nb = { start = 0, max = 0.5 }\n[states]\n\
                     x = { start = 1, der = \"b - k * x\" }\n";

/// A problem of the model, whose first sections are these, with one run.
fn problem(measured: &str, rest: &str, run: &str) -> Folder {
    let folder = Folder::new();
    folder.write("m.toml", MODEL);
    folder.write("run.csv", run);
    folder.write(
        "problem.toml",
        format!(
            "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n{measured}\n{rest}\n\
             [[run]]\nfile = \"run.csv\"\n"
        ),
    );
    folder
}

const RUN: &str = "time,x\n0,1\n0.5,0.8\n1,0.7\n2,0.9\n4,1.2\n";

fn fit(folder: &Folder) -> Ended {
    folder.pilotage(&["fit", "problem.toml", "--json", "--force"])
}

/// The words of the doubt of that code.
fn words(json: &Value, code: &str) -> Option<String> {
    let mut doubts = json["doubts"].as_array().unwrap().iter();
    let found = doubts.find(|own| own["code"] == code)?;
    found["words"].as_str().map(str::to_owned)
}

/// Four iterations solve a start in two goes, and no finer mesh; five solve both.
#[test]
fn a_refinement_that_the_iteration_limit_ended_has_not_converged() {
    let folder = Folder::new();
    let swung = MODEL.replace("b - k * x", "sin(w * time) - k * x^3");
    let swung = swung.replace("k = 1\n", "k = 1\nw = { start = 6, unit = \"rad/s\" }\n");
    folder.write("m.toml", swung);
    folder.write("run.csv", "time,x\n0,1\n1,0.5\n2,0.4\n4,0.13\n8,0.2\n");
    let ended = |limit: usize| {
        let text = format!(
            "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n[parameters]\n\"m.k\" = {{}}\n\
             [[run]]\nfile = \"run.csv\"\n[fit]\nmax_iterations = {limit}\nmesh_tolerance = 1e-10\n"
        );
        folder.write("problem.toml", text);
        fit(&folder)
    };
    let short = ended(4);
    let json = short.json();
    assert_eq!(
        (short.code, &json["status"]),
        (1, &"iteration-limit".into())
    );
    let why = words(&json, "mesh-error").unwrap();
    assert!(why.contains("ended by max_iterations"), "{why}");
    assert_eq!(ended(20).code, 0);
}

/// The data ask for `b` about 1.
#[test]
fn a_bound_that_a_tie_reaches_is_told() {
    let tied =
        "[parameters]\n\"m.k\" = {}\nhalf = { start = 0.1 }\n\"m.b\" = { value = \"2 * half\" }";
    let json = fit(&problem("", tied, RUN)).json();
    let half = json["parameters"]["half"]["value"].as_f64().unwrap();
    assert!((half - 0.25).abs() < 1e-6, "{json}");
    let why = words(&json, "at-bound").unwrap();
    assert!(
        why.starts_with("`m.b` lies on the end 0.5 of its range"),
        "{why}"
    );
}

/// The model file of a fit with a parameter on the end of its range is a model file like others: its covariance holds that
/// parameter, its interval does not.
#[test]
fn a_fitted_model_with_a_parameter_at_its_bound_is_read_again() {
    let sought = "[parameters]\n\"m.k\" = {}\n\"m.b\" = {}\n";
    let folder = problem("", sought, RUN);
    let json = fit(&folder).json();
    assert!(words(&json, "at-bound").is_some(), "{json}");
    assert!(
        json["parameters"]["m.b"]["sd"].as_f64().unwrap() > 0.0,
        "{json}"
    );
    let ended = folder.pilotage(&["model", "check", "m-fitted.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    // As an earlier version wrote it, with what rounding errors left.
    let text = folder.read("m-fitted.toml");
    let rounded = text.replacen("[0.0, 0.0]", "[0.0, 1e-34]", 1);
    assert_ne!(rounded, text);
    folder.write("m-fitted.toml", rounded);
    let ended = folder.pilotage(&["model", "check", "m-fitted.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
}

/// Flights say at their top with what they were flown, by whom, and whether they count.
#[test]
fn flights_that_do_not_go_together_are_told() {
    let second = "[[run]]\nfile = \"2.csv\"\n";
    let folder = problem(
        "",
        "[parameters]\n\"m.k\" = {}\n[[run]]\nfile = \"2.csv\"",
        RUN,
    );
    let text = folder.read("problem.toml");
    assert!(text.contains(second));
    let other = "time,x\n0,1\n0.5,0.7\n1,0.6\n2,0.8\n4,1.1\n";
    let top =
        |device: &str| format!("# device: {device} (its name)\n# subject: P1\n# valid: yes\n");
    let mixed = |first: &str, then: &str| {
        folder.write("run.csv", top(first) + RUN);
        folder.write("2.csv", top(then) + other);
        words(&fit(&folder).json(), "mixed")
    };
    assert_eq!(mixed("mouse", "mouse"), None);
    let why = mixed("mouse", "gamepad").unwrap();
    assert!(why.contains("gamepad (2.csv), mouse (run.csv)"), "{why}");
}

/// Whatever is sought, the run begins at 1.
#[test]
fn a_constraint_that_no_given_begin_fulfils_is_refused() {
    let refused = |limits: &str, why: &str| {
        let rest = format!(
            "[parameters]\n\"m.k\" = {{}}\n[[constraint]]\nexpression = \"m.x + 1\"\n{limits}"
        );
        let ended = fit(&problem("", &rest, RUN));
        let expected = format!(
            "error: problem.toml:10:14: `m.x + 1` is always 2 where run.csv begins, {why}; change one of them\n"
        );
        assert_eq!((ended.code, ended.stderr), (2, expected));
    };
    refused("min = 2.5\nat = \"start\"", "never from 2.5 to inf");
    refused("max = 1.5", "never from -inf to 1.5");
    let free = "[parameters]\n\"m.k\" = {}\n[initial]\n\"m.x\" = \"free\"\n[[constraint]]\nexpression = \"m.x + 1\"\n\
                min = 2.5\nat = \"start\"";
    let ended = fit(&problem("", free, RUN));
    assert_eq!(ended.code, 0, "{ended:?}");
    // On the limit, up to rounding.
    let on = "[parameters]\n\"m.k\" = {}\n[[constraint]]\nexpression = \"0.1 * m.x + 0.2\"\nmax = 0.3\nat = \"start\"";
    assert_eq!(fit(&problem("", on, RUN)).code, 0);
}

#[test]
fn what_is_undefined_is_named() {
    let sought = "[parameters]\n\"m.k\" = {}";
    let json = fit(&problem("sd = 1e-200", sought, RUN)).json();
    assert_eq!(json["status"], "undefined-start");
    let why = words(&json, "undefined").unwrap();
    assert!(
        why.starts_with(
            "where the search begins, in run.csv at 1 s: the column `x` has 0.7 where 0.7"
        ),
        "{why}"
    );
    assert!(
        why.contains("; with the standard deviation 1e-200 the residual is too large"),
        "{why}"
    );
    let negative = "offset = -2\nnoise = \"log-normal\"";
    let json = fit(&problem(negative, sought, RUN)).json();
    let why = words(&json, "undefined").unwrap();
    assert_eq!(
        why,
        "where the search begins, in run.csv at 0 s: the column `x` has 1.0 where -1.0 is predicted; log-normal noise has \
         values above 0"
    );
}

/// One thing is no plural.
#[test]
fn one_run_is_one_run() {
    let ended = problem("", "[parameters]\n\"m.k\" = {}", RUN).pilotage(&["fit", "problem.toml"]);
    assert!(
        ended.stdout.contains("\n1 run, 5 measured values: "),
        "{ended:?}"
    );
}

/// With a tolerance of 1e-3 the swung model's parameter moves by 3 parts in a thousand at the last refinement: the mesh is refined
/// further, so that it is as near as with 1e-4.
#[test]
fn a_refinement_that_moves_a_parameter_is_not_the_last() {
    let folder = Folder::new();
    let swung = MODEL.replace("b - k * x", "sin(w * time) - k * x^3");
    let swung = swung.replace(
        "b = { start = 0, max = 0.5 }",
        "w = { start = 6, unit = \"rad/s\" }",
    );
    folder.write("m.toml", swung);
    folder.write("run.csv", "time,x\n0,1\n1,0.5\n2,0.4\n4,0.13\n8,0.2\n");
    let mesh_moves = |tolerance: &str| {
        let text = format!(
            "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n[parameters]\n\"m.k\" = {{}}\n\
             [[run]]\nfile = \"run.csv\"\n[fit]\nmesh_tolerance = {tolerance}\n"
        );
        folder.write("problem.toml", text);
        let found = fit(&folder).json();
        assert_eq!(words(&found, "mesh-error"), None);
        found["parameters"]["m.k"]["value"].as_f64().unwrap()
    };
    let [rough, fine] = ["1e-3", "1e-4"].map(mesh_moves);
    assert!((rough / fine - 1.0).abs() < 1e-4, "{rough} {fine}");
}

/// From 1, decaying no slower than with 0.5, x is not above 0.9 at 4 s; with nothing to decay it is.
#[test]
fn equations_and_constraints_that_are_not_met_are_told() {
    let solve = |least: f64| {
        let rest = format!(
            "[parameters]\n\"m.k\" = {{ min = {least}, max = 2 }}\n[[constraint]]\nexpression = \"m.x\"\nmin = 0.9\n"
        );
        let json = fit(&problem("", &rest, RUN)).json();
        (words(&json, "not-converged"), json)
    };
    let (not_met, json) = solve(0.5);
    assert!(
        not_met
            .unwrap()
            .contains("do not fulfil equations and constraints"),
        "{json}"
    );
    assert_eq!(json["objective"], Value::Null);
    let (not_met, json) = solve(0.0);
    assert_eq!(not_met, None, "{json}");
    assert!(json["objective"].is_number());
}

/// What grows asks for a pole on the right, which `[stability]` keeps away; what decays does not.
#[test]
fn a_model_that_is_kept_stable_is_told() {
    let sought = "[parameters]\n\"m.k\" = { start = 0.5 }\n[stability]\nmodels = [\"m\"]\n";
    let growing = "time,x\n0,1\n1,1.2\n2,1.5\n4,2.2\n";
    let why = words(&fit(&problem("", sought, growing)).json(), "model-on-bound").unwrap();
    assert!(
        why.starts_with("`m`") && why.contains("lies on the bound"),
        "{why}"
    );
    let json = fit(&problem("", sought, "time,x\n0,1\n1,0.6\n2,0.4\n4,0.2\n")).json();
    assert_eq!(words(&json, "model-on-bound"), None, "{json}");
}

/// With process noise a limit of an output is no constraint: the response to 1 goes beyond 0.6, not beyond 2.
#[test]
fn an_output_beyond_its_limit_is_told_where_noise_drives() {
    let folder = Folder::new();
    let rows = (0..60).map(|k| {
        let t = 0.1 * f64::from(k);
        let noise = 0.03 * (7.0 * t).sin() + 0.02 * (17.0 * t * t).cos();
        format!("{t},1,{}\n", 1.0 - (-t).exp() + noise)
    });
    folder.write("run.csv", format!("time,u,y\n{}", rows.collect::<String>()));
    let beyond_limit = |limit: f64| {
        folder.write(
            "m.toml",
            format!(
                "[model]\nname = \"m\"\n[inputs]\nu = {{}}\nw = {{}}\n[parameters]\nk = {{ start = 1, min = 0.1, max = 5 }}\n\
                 [states]\nx = {{ der = \"k * (u - x) + w\" }}\n[outputs]\ny = {{ value = \"x\", limit = [-{limit}, {limit}] }}\n"
            ),
        );
        folder.write(
            "problem.toml",
            "[system.m]\nmodel = \"m.toml\"\n[inputs]\n\"m.u\" = \"u\"\n[process_noise]\n\"m.w\" = { density = 0.001 }\n\
             [[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = 0.03\n[parameters]\n\"m.k\" = {}\n\
             [[run]]\nfile = \"run.csv\"\n[fit]\nobjective = \"prediction-error\"\nlimits = \"constrain\"\n",
        );
        let json = fit(&folder).json();
        assert_eq!(json["status"], "converged", "{json}");
        words(&json, "beyond-limit")
    };
    let why = beyond_limit(0.6).unwrap();
    assert!(why.contains("m.y"), "{why}");
    assert_eq!(beyond_limit(2.0), None);
}

#[test]
fn a_derived_quantity_has_no_name_of_the_loop_s_figures() {
    let derived = "[parameters]\n\"m.k\" = {}\n[derived]\nphase_margin = \"2 * m.k\"";
    let ended = fit(&problem("", derived, RUN));
    let why = "`phase_margin` is what the figure of the loop itself is called; take another name";
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains(why), "{}", ended.stderr);
}

/// Decays with noise in steps of 0.001, to which something is added.
fn decays(added: impl Fn(usize, usize) -> f64) -> Folder {
    let folder = Folder::new();
    folder.write(
        "m.toml",
        "[model]\nname = \"m\"\n[parameters]\nk = { start = 1, min = 0.1, max = 5 }\n[states]\nx = { start = 1, der = \"-k * x\" }\n",
    );
    let mut problem =
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n\
                       [parameters]\n\"m.k\" = {}\n"
            .to_owned();
    // A linear congruential generator: the uniform noise of any seed will do.
    let mut seed = 1_u32;
    let mut noise = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.04 * (f64::from(seed >> 8) / f64::from(1 << 24) - 0.5)
    };
    for run in 0..4 {
        let rows = (0..60).map(|row| {
            let t = 0.05 * row as f64;
            let x = (-0.8 * t).exp() + noise() + added(run, row);
            format!("{t},{}\n", (1000.0 * x).round() / 1000.0)
        });
        folder.write(
            &format!("{run}.csv"),
            format!("time,x\n{}", rows.collect::<String>()),
        );
        problem += &format!("[[run]]\nfile = \"{run}.csv\"\n");
    }
    folder.write("problem.toml", problem);
    folder
}

#[test]
fn samples_and_runs_that_stand_out_are_told() {
    let doubts = |added: &dyn Fn(usize, usize) -> f64| {
        let json = fit(&decays(added)).json();
        assert_eq!(json["status"], "converged", "{json}");
        ["outlier", "jump", "misfit"].map(|code| words(&json, code))
    };
    assert_eq!(doubts(&|_, _| 0.0), [None, None, None]);
    let spikes = |run, row| f64::from(run == 2 && (row == 20 || row == 40)) * 0.5;
    let [outlier, jump, _] = doubts(&spikes);
    let outlier = outlier.unwrap();
    assert!(outlier.starts_with("x of 2.csv at "), "{outlier}");
    assert!(outlier.contains("2 such samples"), "{outlier}");
    assert_eq!(jump, None);
    let steps = |run, row| f64::from(run == 1 && row >= 30) * 0.5;
    let [outlier, jump, _] = doubts(&steps);
    let jump = jump.unwrap();
    assert!(
        jump.contains("of 1.csv jumps by 0.5") && jump.contains("at 1.5 s"),
        "{jump}"
    );
    assert_eq!(outlier, None);
    let drifts = |run, row| f64::from(run == 3) * 0.01 * row as f64;
    let [outlier, jump, misfit] = doubts(&drifts);
    let misfit = misfit.unwrap();
    assert!(misfit.starts_with("x of 3.csv is fitted "), "{misfit}");
    assert_eq!([outlier, jump], [None, None]);
    // A sensor that stands still at what it is in row 10.
    let stays = |run, row| {
        let of = |row: usize| (-0.04 * row as f64).exp();
        f64::from(run == 2 && (11..30).contains(&row)) * (of(10) - of(row))
    };
    let folder = decays(stays);
    let text = folder.read("2.csv");
    let value = text.lines().nth(11).unwrap().split_once(',').unwrap().1;
    let frozen = text.lines().enumerate().map(|(line, text)| {
        let time = text.split_once(',').unwrap().0;
        match (12..31).contains(&line) {
            true => format!("{time},{value}\n"),
            false => format!("{text}\n"),
        }
    });
    folder.write("2.csv", frozen.collect::<String>());
    let json = fit(&folder).json();
    let frozen = words(&json, "frozen").unwrap();
    assert!(
        frozen.contains(&format!("x of 2.csv stays at {value} from 0.5 s to 1.45")),
        "{frozen}"
    );
    assert_eq!(words(&json, "jump"), None);
    // A stop within the runs.
    let folder = decays(|_, _| 0.0);
    for run in 0..4 {
        let file = format!("{run}.csv");
        let text = folder.read(&file);
        let (head, rows) = text.split_once('\n').unwrap();
        let clipped = rows.lines().enumerate().map(|(row, line)| {
            let (t, x) = line.split_once(',').unwrap();
            let x: f64 = x.parse().unwrap();
            // Of the first samples one is lower.
            let x = if row == 0 { 0.5 } else { x.min(0.8) };
            format!("{t},{x}\n")
        });
        folder.write(&file, format!("{head}\n{}", clipped.collect::<String>()));
    }
    let clipped = words(&fit(&folder).json(), "clipped").unwrap();
    assert!(
        clipped.contains("of the samples of x in 3.csv stay at the ends"),
        "{clipped}"
    );
    assert!(clipped.contains("such as 0.8"), "{clipped}");
    // A file that is there twice.
    let folder = decays(|_, _| 0.0);
    let json = fit(&folder).json();
    assert_eq!(
        ["copy", "clipped"].map(|code| words(&json, code)),
        [None, None]
    );
    folder.write("3.csv", folder.read("1.csv"));
    let copy = words(&fit(&folder).json(), "copy").unwrap();
    assert!(
        copy.starts_with("3.csv has the samples of 1.csv: "),
        "{copy}"
    );
    // Student's noise has such samples.
    let folder = decays(spikes);
    let text = folder.read("problem.toml").replace(
        "column = \"x\"\n",
        "column = \"x\"\nsd = 0.01\nnoise = \"student\"\n",
    );
    folder.write("problem.toml", text);
    assert_eq!(words(&fit(&folder).json(), "outlier"), None);
}

/// A flag for flights is refused with its default too: the file may say something else.
#[test]
fn flags_of_flights_are_refused_whatever_their_value() {
    let folder = problem("", "[parameters]\n\"m.k\" = {}\n", RUN);
    for (flag, place) in [
        ("--order=3", "`order` of the pilot's instance in [system]"),
        ("--objective=response", "[[measured]]"),
        ("--column=time=t", "[inputs] and `column` of [[measured]]"),
        ("--vehicle=m.toml", "`model` of an instance in [system]"),
        ("--initial-state=free", "[initial]"),
        ("--initial-position=known", "[initial]"),
        ("--allow-unstable-loop", "`closed_loop` in [stability]"),
        ("--stick-limit=1", "`limit` of the output in its model"),
    ] {
        let ended = folder.pilotage(&["fit", "problem.toml", flag]);
        assert_eq!(ended.code, 2, "{ended:?}");
        let name = flag.split('=').next().unwrap();
        let expected = format!(
            "error: {name} belongs to `pilotage fit run*.csv`\nhint: in a problem file {place}"
        );
        assert!(ended.stderr.starts_with(&expected), "{ended:?}");
    }
}

/// A column that is measured twice, and one with the name of another figure, have figures of their own.
#[test]
fn each_figure_of_a_problem_has_its_own_name() {
    let measured = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n";
    let folder = problem(measured, "[parameters]\n\"m.k\" = {}\n", RUN);
    let ended = folder.pilotage(&["fit", "problem.toml", "--report", "page.html"]);
    assert!(ended.code < 2, "{ended:?}");
    let listed = folder.pilotage(&["plot", "page.html"]);
    for name in [
        "response",
        "poles",
        "residuals-x",
        "residuals-x-2",
        "waterfall",
    ] {
        let count = listed
            .stdout
            .split_whitespace()
            .filter(|word| *word == name)
            .count();
        assert_eq!(count, 1, "{name}: {}", listed.stdout);
    }
}

/// Of two lags in series the data do not tell which comes first; of two gains they do not tell anything, which is another doubt.
#[test]
fn optima_of_the_same_height_are_told() {
    let folder = Folder::new();
    let lags = "[model]\nname = \"lags\"\n[parameters]\na = { start = 0.5, min = 0.01, max = 10 }\n\
                b = { start = 0.6, min = 0.01, max = 10 }\nk = 1\nl = 1\n\
                [states]\nx = { der = \"(k - x) / a\" }\ny = { der = \"(l * x - y) / b\" }\n";
    folder.write("lags.toml", lags);
    let (a, b) = (0.3, 1.1);
    let row = |k: u32| {
        let t = 0.04 * f64::from(k);
        let y = 1.3 * (1.0 - (a * (-t / a).exp() - b * (-t / b).exp()) / (a - b));
        format!("{t},{}\n", y + 0.01 * (f64::from(k * k) * 0.7).sin())
    };
    let rows: String = (0..260).map(row).collect();
    folder.write("run.csv", format!("time,y\n{rows}"));
    let ended = |sought: &str| {
        let text = format!(
            "[system.m]\nmodel = \"lags.toml\"\n[[measured]]\nsignal = \"m.y\"\ncolumn = \"y\"\nsd = 0.01\n[parameters]\n{sought}\n\
             [[run]]\nfile = \"run.csv\"\n"
        );
        folder.write("problem.toml", text);
        fit(&folder).json()
    };
    let json = ended("\"m.a\" = {}\n\"m.b\" = {}\n\"m.k\" = {}");
    let told = words(&json, "other-optimum").unwrap();
    let value = |name: &str| json["parameters"][name]["value"].as_f64().unwrap();
    let (first, second) = (value("m.a"), value("m.b"));
    assert!((first + second - a - b).abs() < 0.05 && (first - second).abs() > 0.5);
    assert!(
        told.contains("`m.a`") && told.contains("`m.b`") && !told.contains("`m.k`"),
        "{told}"
    );
    // Both are among the starts.
    let starts = json["starts"].as_array().unwrap();
    let ends_with = |value: f64| {
        let ends = starts
            .iter()
            .filter_map(|own| own["parameters"]["m.a"].as_f64());
        ends.filter(|own| (own - value).abs() < 1e-3).count()
    };
    assert!(ends_with(first) > 0 && ends_with(second) > 0, "{starts:?}");
    // Those at the other one do not agree with this one.
    let agreeing = json["starts_agreeing"].as_u64().unwrap();
    assert_eq!(agreeing, ends_with(first) as u64, "{starts:?}");
    // In this order there is one optimum.
    let ordered = "\"m.a\" = { max = 0.6 }\n\"m.b\" = { start = 2, min = 0.6 }\n\"m.k\" = {}";
    assert_eq!(words(&ended(ordered), "other-optimum"), None);
    // Two gains are a direction along which nothing changes, with as many starts as ends.
    let json = ended("\"m.b\" = {}\n\"m.k\" = {}\n\"m.l\" = {}");
    assert_eq!(words(&json, "other-optimum"), None);
    assert!(words(&json, "undetermined").is_some());
}
