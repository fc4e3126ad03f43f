//! How a fit is watched, limited and stopped.

use crate::command::{Ended, Folder, example};
use crate::fitted::{codes, with};
use pilotage::estimation::fit::Progress;
use pilotage::estimation::{Fit, Posed, fit};
use pilotage::flights::options::InitialState;
use pilotage::flights::{FlightOptions, TrialSet, open};
use pilotage::sqp::Status;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::ops::ControlFlow;
use std::process::{Command, Stdio};

fn manifest() -> String {
    example("trials/trials.toml").to_str().unwrap().to_owned()
}

fn lines(text: &str) -> Vec<Value> {
    let parse = |line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
    text.lines().map(parse).collect()
}

fn of<'a>(log: &'a [Value], event: &str) -> Vec<&'a Value> {
    log.iter().filter(|line| line["event"] == event).collect()
}

#[test]
fn the_log_tells_each_iteration_and_how_it_ended() {
    let folder = Folder::new();
    let ended = folder.pilotage(&["fit", &manifest(), "--log=fit.jsonl", "--json", "--verbose"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let log = lines(&folder.read("fit.jsonl"));
    let (iterations, starts) = (of(&log, "iteration"), of(&log, "start"));
    assert_eq!(log.len(), iterations.len() + starts.len() + 1);

    let numbers: Vec<_> = starts
        .iter()
        .map(|start| start["start"].as_u64().unwrap())
        .collect();
    assert_eq!(numbers, (1..=starts.len() as u64).collect::<Vec<_>>());
    let of_start = |start: &Value| -> Vec<_> {
        let own = iterations.iter().filter(|i| i["start"] == start["start"]);
        own.collect()
    };
    // Those of the search without limits, and of what goes on from there with them.
    let count = |start: &Value| -> u64 {
        let own = of_start(start);
        let is_last = |k: &usize| own.get(k + 1).is_none_or(|next| next["iteration"] == 0);
        let lasts = (0..own.len()).filter(is_last);
        lasts.map(|k| own[k]["iteration"].as_u64().unwrap()).sum()
    };
    let counts: Vec<u64> = starts.iter().map(|start| count(start)).collect();
    assert_eq!(starts[0]["iterations"], counts[0]);
    for start in &starts {
        let own = of_start(start);
        let first = own.first().unwrap();
        assert_eq!(
            (&first["iteration"], &first["hessian"]),
            (&0.into(), &"start".into())
        );
        // Its own, or those of another start that ended there.
        let iterations_of = start["iterations"].as_u64().unwrap();
        assert!(counts.contains(&iterations_of), "{start} {counts:?}");
        // The result is the best iterate, which need not be the last, or that of another start that ended there.
        let [objective, kkt] = ["objective", "kkt"].map(|key| start[key].as_f64().unwrap());
        let is_it = |line: &Value| {
            let parts = ["primal", "dual", "complementarity"];
            let parts = parts.map(|part| line[part].as_f64().unwrap());
            line["objective"] == objective && kkt == parts.into_iter().fold(0.0, f64::max)
        };
        assert!(iterations.iter().any(|line| is_it(line)), "{start}");
        for key in ["step", "change", "damping", "penalty", "active"] {
            assert!(own.iter().all(|i| i[key].as_f64().unwrap() >= 0.0), "{key}");
        }
        let known = ["start", "exact", "gauss-newton", "curvature"].map(Value::from);
        assert!(own.iter().all(|i| known.contains(&i["hessian"])));
    }
    // The optimum has an active limit, a curvature, and the numbers of the summary.
    let (closing, summary) = (log.last().unwrap(), ended.json());
    for key in [
        "status",
        "iterations",
        "objective",
        "kkt",
        "curvature",
        "skipped",
    ] {
        assert_eq!(closing[key], summary[key], "{key}");
    }
    assert_eq!(closing["seconds"], summary["seconds"]["total"]);
    assert_eq!(
        (&closing["event"], &closing["skipped"]),
        (&"fit".into(), &0.into())
    );
    assert!(summary["curvature"].as_f64().unwrap() > 0.0, "{summary}");

    // The table has the same lines.
    let rows = (ended.stderr.lines()).filter(|line| !line.starts_with("start  mesh"));
    assert_eq!(rows.count(), iterations.len(), "{}", ended.stderr);
}

/// Problem files have the same lines; the solver's objective is scaled, and that of the lines is not.
#[test]
fn the_log_of_a_problem_has_the_same_lines() {
    let folder = Folder::new();
    let problem = example("problems/hare_lynx/problem.toml")
        .display()
        .to_string();
    let fit = ["fit", &problem, "--random-starts=3", "-o=m.toml"];
    let ended = folder.pilotage(&[&fit[..], &["--log=fit.jsonl", "--json", "--verbose"]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let (log, summary) = (lines(&folder.read("fit.jsonl")), ended.json());
    let (iterations, starts) = (of(&log, "iteration"), of(&log, "start"));
    assert_eq!(log.len(), iterations.len() + starts.len() + 1);
    assert_eq!(starts.len(), 4);
    for (start, own) in starts.iter().zip(summary["starts"].as_array().unwrap()) {
        for key in ["start", "status", "iterations", "objective", "kkt"] {
            assert_eq!(start[key], own[key], "{key}");
        }
        let is_own = |line: &&&Value| line["start"] == start["start"] && line["refinement"] == 0;
        let last = iterations.iter().rfind(is_own).unwrap();
        assert_eq!(last["iteration"], start["iterations"]);
        if start["status"] == "converged" {
            assert_eq!(last["objective"], start["objective"]);
        }
    }
    // The refined mesh has the last iterate, and that is the result.
    let (last, closing) = (iterations.last().unwrap(), log.last().unwrap());
    assert!(last["refinement"].as_u64().unwrap() > 0, "{last}");
    assert_eq!(last["objective"], summary["objective"]);
    for key in [
        "status",
        "converged",
        "iterations",
        "objective",
        "kkt",
        "curvature",
        "skipped",
    ] {
        assert_eq!(closing[key], summary[key], "{key}");
    }
    let rows = (ended.stderr.lines()).filter(|line| !line.starts_with("start  mesh"));
    assert_eq!(rows.count(), iterations.len(), "{}", ended.stderr);

    // On stdout it is alone there.
    let ended = folder.pilotage(&[&fit[..], &["--log=-"]].concat());
    assert_eq!(lines(&ended.stdout).last().unwrap()["status"], "converged");
    assert!(ended.stderr.starts_with("converged: "), "{}", ended.stderr);
    let ended = folder.pilotage(&[&fit[..], &["--log=-", "--json"]].concat());
    let message = "error: --json and --log - both want stdout\n";
    assert!(
        ended.code == 2 && ended.stderr.starts_with(message),
        "{ended:?}"
    );
    let ended = folder.pilotage(&[&fit[..], &["--evaluate", "--log=fit.jsonl"]].concat());
    assert!(
        ended.code == 2 && ended.stderr.contains("--evaluate makes none"),
        "{ended:?}"
    );
}

#[test]
fn a_log_on_stdout_is_alone_there() {
    let folder = Folder::new();
    let ended = folder.pilotage(&["fit", &manifest(), "--log=-"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert_eq!(lines(&ended.stdout).last().unwrap()["status"], "converged");
    assert!(
        ended.stderr.starts_with("converged, in doubt (1): "),
        "{}",
        ended.stderr
    );
    assert!(
        ended.stderr.contains("\nwrote pilot.toml\n"),
        "{}",
        ended.stderr
    );

    let ended = folder.pilotage(&["fit", &manifest(), "--log=-", "--json"]);
    let message = "error: --json and --log - both want stdout\n\
                   hint: give --log a file; or leave --json out: the log's last line has the result\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, message));

    let ended = folder.pilotage(&["fit", &manifest(), "--log=no/such/fit.jsonl"]);
    let message = "error: cannot write no/such/fit.jsonl: No such file or directory (os error 2)\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, message));
}

/// Asserts that a fit was cut short: written and marked, with what to do next.
fn assert_cut_short(folder: &Folder, ended: &Ended, summary: &str, status: &str) {
    assert_eq!(ended.code, 1, "{ended:?}");
    assert!(
        summary.contains(&format!("NOT CONVERGED ({status}): ")),
        "{summary}"
    );
    let file: toml::Table = folder.read("pilot.toml").parse().unwrap();
    assert_eq!(file["fit"]["converged"].as_bool(), Some(false));
    let theta = (1..=6).map(|i| {
        let value = &file["parameters"][&format!("theta{i}")]["start"];
        let whole = value.as_integer().map(|own| own as f64);
        let value = value.as_float().or(whole).unwrap();
        format!("pilot.theta{i}={value}")
    });
    let theta: Vec<String> = theta.collect();
    let next = format!("      --start {}, to go on from here\n", theta.join(","));
    assert!(summary.contains(&next), "{summary}");
}

#[test]
fn a_time_limit_keeps_the_best_so_far() {
    let folder = Folder::new();
    let ended = folder.pilotage(&["fit", &manifest(), "--time-limit=1e-9", "--log=fit.jsonl"]);
    assert_cut_short(&folder, &ended, &ended.stdout, "time-limit");
    assert!(
        ended
            .stdout
            .ends_with("      --time-limit above 0.000000001\n"),
        "{}",
        ended.stdout
    );
    let log = lines(&folder.read("fit.jsonl"));
    assert!(of(&log, "iteration").len() <= 1);
    let skipped = log.last().unwrap()["skipped"].as_u64().unwrap();
    assert!(
        skipped > 0 && ended.stdout.contains("diagnostic [cut]: "),
        "{}",
        ended.stdout
    );
}

/// Flights enough for a fit of many seconds, which the signal of the test below cannot miss.
fn many_flights(folder: &Folder) {
    let names = [
        "10m-run1", "10m-run2", "10m-run3", "20m-run1", "20m-run2", "20m-run3",
    ];
    let mut manifest = String::new();
    for copy in 0..15 {
        for name in names {
            let content = std::fs::read_to_string(example(&format!("trials/{name}.csv"))).unwrap();
            let content = format!("# copy {copy}\n{content}");
            let file = format!("{name}-{copy}.csv");
            folder.write(&file, content);
            manifest += &format!("[[run]]\nfile = '{file}'\n");
        }
    }
    folder.write("many.toml", manifest);
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_best_so_far() {
    let folder = Folder::new();
    many_flights(&folder);
    let mut child = folder
        .listening(&["fit", "many.toml", "--scheme=hermite-simpson", "--log=-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The first line says that the fit runs, and that it listens.
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    let mut log = String::new();
    stdout.read_line(&mut log).unwrap();
    let signal = ["-INT", &child.id().to_string()];
    assert!(
        Command::new("kill")
            .args(signal)
            .status()
            .unwrap()
            .success()
    );
    stdout.read_to_string(&mut log).unwrap();
    let mut stderr = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut stderr)
        .unwrap();
    let ended = Ended {
        code: child.wait().unwrap().code().unwrap_or(-1),
        stdout: log,
        stderr,
    };
    let note = "note: stopping; Ctrl-C again kills\n";
    let summary = ended
        .stderr
        .strip_prefix(note)
        .unwrap_or_else(|| panic!("{}", ended.stderr));
    assert_cut_short(&folder, &ended, summary, "interrupted");
    let log = lines(&ended.stdout);
    assert_eq!(log.last().unwrap()["status"], "interrupted");
}

/// The fit of the shipped flights with an observer.
fn watched(
    options: &FlightOptions,
    observer: &mut (dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + Send),
) -> Fit {
    let set = TrialSet::read(&[example("trials/trials.toml")]).unwrap();
    let file = options.problem(&set).unwrap();
    let posed = Posed::new(&file, &open).unwrap();
    fit(&posed, observer)
}

/// Whoever stops a fit waits for no other solve, and gets what was found until then.
#[test]
fn a_stop_before_anything_has_converged_gives_the_best_iterate() {
    for initial_state in InitialState::ALL {
        let mut asked = 0;
        let options = with(|own| own.initial_state = initial_state);
        let stopped = watched(&options, &mut |progress| {
            asked += usize::from(progress.iteration.is_some());
            match asked {
                0..6 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(Status::TimeLimit),
            }
        });
        assert!(!stopped.is_answer());
        assert_eq!(stopped.ending(), "time-limit");
        assert!(asked < 30, "{asked} iterations after the end");
        assert_eq!(stopped.curvature, None);
        assert!(codes(&stopped).contains(&"cut"), "{:?}", codes(&stopped));
    }
}

#[test]
fn what_has_converged_is_the_result_though_the_rest_is_stopped() {
    let whole = watched(
        &FlightOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    );
    let mut is_over = false;
    let stopped = watched(&FlightOptions::default(), &mut |progress| {
        let has_converged = |own: &pilotage::sqp::Iteration| own.kkt.residual() <= 1e-8;
        is_over |= progress.iteration.is_some_and(has_converged);
        match is_over {
            true => ControlFlow::Break(Status::Interrupted),
            false => ControlFlow::Continue(()),
        }
    });
    assert_eq!(stopped.ending(), "interrupted");
    assert!(stopped.is_met(), "{}", stopped.verdict());
    assert!((stopped.objective / whole.objective - 1.0).abs() < 1e-3);
}
