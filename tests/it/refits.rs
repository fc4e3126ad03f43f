//! `pilotage fit --profile` and `--bootstrap`: what is told, which threads and kills change nothing, what is refused.

use crate::command::{Ended, Folder, example};
use serde_json::Value;
use std::fmt::Write;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

/// A problem that is solved in no time: decays with deterministic noise.
fn decay(folder: &Folder, runs: usize) {
    let model = "[model]\nname = \"decay\"\n[parameters]\nrate = 0.5\nx0 = 2.0\n[states]\n\
                 x = { start = \"x0\", der = \"-rate * x\" }\n";
    folder.write("decay.toml", model);
    let mut problem =
        "[system.m]\nmodel = \"decay.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n\
                       [parameters]\n\"m.rate\" = {}\n\"m.x0\" = { per = \"subject\" }\n\
                       [derived]\nhalf_life = \"log(2) / m.rate\"\n"
            .to_owned();
    for j in 0..runs {
        let mut rows = "time,x\n".to_owned();
        for k in 0..40 {
            let noise = (f64::from(k * k * 7) + 13.0 * j as f64).sin();
            let t = 0.1 * f64::from(k);
            writeln!(rows, "{t},{}", 3.0 * (-0.7 * t).exp() + 0.1 * noise).unwrap();
        }
        folder.write(&format!("run{j}.csv"), rows);
        let subject = ["A", "B"][j % 2];
        write!(
            problem,
            "[[run]]\nfile = \"run{j}.csv\"\nsubject = \"{subject}\"\n"
        )
        .unwrap();
    }
    folder.write("problem.toml", problem);
}

fn trials() -> String {
    example("trials/trials.toml").to_str().unwrap().to_owned()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// What of the answer is not of the clock.
fn timeless(ended: &Ended) -> Value {
    assert_eq!(ended.code, 0, "{ended:?}");
    let mut json = ended.json();
    json["seconds"] = Value::Null;
    json["starts"] = Value::Null;
    json
}

const BOTH: [&str; 5] = ["--profile=all", "--bootstrap", "12", "--seed", "3"];

#[test]
fn problems_tell_profiles_and_bootstraps_of_each_value() {
    let folder = Folder::new();
    decay(&folder, 6);
    let page = ["--report", "fit.html", "--resume", "refits.csv"];
    let fit = ["fit", "problem.toml", "--json"];
    let ended = folder.pilotage(&[&fit[..], &BOTH, &page].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{ended:?}");
    let json = ended.json();
    let rate = &json["parameters"]["m.rate"];
    let profile = &rate["profile"];
    assert_eq!(profile["class"], "finite");
    assert!(number(&profile["low"]) < number(&rate["value"]));
    assert!(number(&profile["high"]) > number(&rate["value"]));
    assert!(profile["points"].as_array().unwrap().len() > 8);
    let x0 = &json["parameters"]["m.x0"];
    for subject in ["A", "B"] {
        assert_eq!(x0["profile"][subject]["class"], "finite");
        assert!(number(&x0["bootstrap"][subject]["sd"]) > 0.0);
    }
    // Not all draws of six runs have a subject's.
    let bootstrap = &json["uncertainty"]["bootstrap"];
    assert_eq!(
        (&bootstrap["kind"], &bootstrap["seed"]),
        (&"runs".into(), &3.into())
    );
    assert_eq!(
        number(&bootstrap["converged"]) + number(&bootstrap["not_converged"]),
        12.0
    );
    let half_life = &json["derived"]["half_life"];
    assert!(number(&half_life["bootstrap"]["low"]) < number(&half_life["bootstrap"]["high"]));
    assert!(number(&json["uncertainty"]["profile"]["threshold"]) > 1.95);
    assert_eq!(folder.read("refits.csv").lines().count(), 13);
    assert!(folder.read("fit.html").contains("Profiles and bootstrap"));
}

#[test]
fn flights_tell_them_too() {
    let folder = Folder::new();
    let some = ["--profile", "theta3,theta6", "--bootstrap", "4"];
    let fit = ["fit", &trials(), "--json", "--report", "fit.html"];
    let ended = folder.pilotage(&[&fit[..], &some].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{ended:?}");
    let json = ended.json();
    let theta = |k: usize| &json["parameters"][&format!("pilot.theta{k}")];
    assert!(theta(1)["profile"].is_null() && theta(6)["profile"]["class"] == "finite");
    assert!(number(&theta(1)["bootstrap"]["sd"]) > 0.0);
    let crossover = &json["derived"]["crossover_frequency"];
    let spread = &crossover["bootstrap"];
    assert!(
        number(&spread["low"]) < 1.1 * number(&crossover["value"]),
        "{crossover}"
    );
    assert!(
        number(&spread["high"]) > 0.9 * number(&crossover["value"]),
        "{crossover}"
    );
    assert!(folder.read("fit.html").contains("Profiles and bootstrap"));
    // In words, too.
    let text = folder
        .pilotage(&["fit", &trials(), "--bootstrap", "2"])
        .stdout;
    assert!(
        text.contains("bootstrap: 2 refits, runs drawn with replacement, seed 0"),
        "{text}"
    );
}

#[test]
fn numbers_are_the_same_for_any_number_of_threads() {
    let folder = Folder::new();
    decay(&folder, 5);
    let fit = ["fit", "problem.toml", "--json"];
    let with = |threads: &str, kind: &str| {
        let kind = ["--bootstrap-kind", kind];
        let arguments = [&fit[..], &BOTH, &kind].concat();
        timeless(&folder.pilotage_with(&arguments, &[("RAYON_NUM_THREADS", threads)]))
    };
    for kind in ["runs", "parametric"] {
        assert_eq!(with("1", kind), with("3", kind), "{kind}");
    }
}

/// Parts of a bootstrap, made on several machines and joined by `cat`, are the whole.
#[test]
fn parts_of_a_bootstrap_are_the_whole() {
    let folder = Folder::new();
    decay(&folder, 4);
    let fit = |more: &[&str]| {
        let words = ["fit", "problem.toml", "--json", "--bootstrap", "20"];
        timeless(&folder.pilotage(&[&words, more].concat()))
    };
    let whole = fit(&[]);
    let mut lines = 0;
    let joined: String = ["1/3", "2/3", "3/3"]
        .map(|part| {
            let file = format!("part{}.csv", &part[..1]);
            fit(&["--resume", &file, "--shard", part]);
            let text = folder.read(&file);
            lines += text.lines().count() - 1;
            text
        })
        .concat();
    assert_eq!(lines, 20);
    folder.write("all.csv", &joined);
    assert_eq!(fit(&["--resume", "all.csv"]), whole);
    // Nothing was left to do.
    assert_eq!(folder.read("all.csv"), joined);
}

/// A command that is killed goes on where it was, whatever of a line was written, and ends with the same numbers.
#[test]
fn a_killed_bootstrap_goes_on_with_the_same_numbers() {
    let folder = Folder::new();
    decay(&folder, 4);
    let count = ["--bootstrap", "60", "--seed", "3"];
    let whole =
        timeless(&folder.pilotage(&[&["fit", "problem.toml", "--json"], &count[..]].concat()));
    let kept = [
        &["fit", "problem.toml", "--json", "--resume", "kept.csv"],
        &count[..],
    ]
    .concat();
    let mut child = Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .args(&kept)
        .env("RAYON_NUM_THREADS", "1")
        .current_dir(folder.path(""))
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let lines = || match folder.files().iter().any(|name| name == "kept.csv") {
        true => folder.read("kept.csv").lines().count(),
        false => 0,
    };
    while lines() < 3 && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let text = folder.read("kept.csv");
    assert!(text.lines().count() >= 3, "{text}");
    // Half of a line is left.
    folder.write("kept.csv", &text[..text.len() - 7]);
    let resumed = folder.pilotage(&kept);
    assert_eq!(timeless(&resumed), whole);
    assert_eq!(folder.read("kept.csv").lines().count(), 61);
    // More replicates begin with those that are there.
    let more = [
        "fit",
        "problem.toml",
        "--json",
        "--resume",
        "kept.csv",
        "--bootstrap",
        "64",
        "--seed",
        "3",
    ];
    assert_eq!(folder.pilotage(&more).code, 0);
    assert_eq!(folder.read("kept.csv").lines().count(), 65);
}

/// The fit is there, and not all that was asked for.
#[test]
fn refits_that_a_limit_ends_are_told_and_exit_with_1() {
    let folder = Folder::new();
    decay(&folder, 4);
    let fit = [
        "fit",
        "problem.toml",
        "--json",
        "--force",
        "--time-limit",
        "0.5",
    ];
    let ended = folder.pilotage(&[&fit[..], &["--bootstrap", "1000000"]].concat());
    let json = ended.json();
    assert_eq!((ended.code, &json["status"]), (1, &"converged".into()));
    let bootstrap = &json["uncertainty"]["bootstrap"];
    assert!(bootstrap["missing"].as_u64().unwrap() > 0, "{bootstrap}");
    assert!(
        ended.stderr.contains("the bootstrap was stopped with "),
        "{ended:?}"
    );
    let whole = folder.pilotage(&[&fit[..], &["--profile"]].concat());
    assert_eq!(whole.code, 0, "{whole:?}");
}

#[test]
fn what_cannot_be_is_refused() {
    let folder = Folder::new();
    decay(&folder, 3);
    folder.write("other.csv", "time,x\n0,1\n");
    let problem = ["fit", "problem.toml"];
    let refused = |more: &[&str], expected: &str| {
        let ended = folder.pilotage(&[&problem[..], more].concat());
        assert_eq!(ended.code, 2, "{more:?}: {ended:?}");
        assert!(
            ended.stderr.contains(expected),
            "{more:?}: {}",
            ended.stderr
        );
    };
    refused(
        &["--profile", "m.rat"],
        "nothing that is sought is called `m.rat`; did you mean `m.rate`?; there are m.rate, m.x0",
    );
    refused(
        &["--profile", "run0.csv"],
        "write --profile=all, or --profile behind the files",
    );
    refused(
        &["--bootstrap", "0"],
        "expected a whole number from 2 to 1000000, such as 200",
    );
    refused(
        &["--bootstrap", "-3"],
        "expected a whole number from 2 to 1000000, such as 200",
    );
    refused(
        &["--bootstrap", "9", "--bootstrap-kind", "runs"],
        "of 3 there are too few; it takes 4",
    );
    refused(
        &["--bootstrap", "9", "--bootstrap-kind", "cases"],
        "possible values: runs, parametric",
    );
    refused(&["--seed", "1"], "--bootstrap <N>");
    refused(&["--resume", "kept.csv"], "--bootstrap <N>");
    refused(
        &["--profile", "m.rate", "--evaluate"],
        "--profile solves again, and --evaluate solves nothing",
    );
    refused(&["--bootstrap", "9", "--resume", "other.csv"], "other.csv");
    refused(
        &["--bootstrap", "9", "--resume", "nowhere/kept.csv"],
        "cannot write nowhere/kept.csv",
    );
    let some = ["--bootstrap", "2", "--resume", "kept.csv"];
    assert_eq!(folder.pilotage(&[&problem[..], &some].concat()).code, 0);
    let text = folder.read("kept.csv");
    refused(
        &["--bootstrap", "2", "--resume", "kept.csv", "--seed", "1"],
        "holds refits of another fit, kind or seed",
    );
    folder.write("kept.csv", text.replace("\n0,", "\nx,"));
    refused(&["--bootstrap", "2", "--resume", "kept.csv"], "`x,");
    // A value that somebody wrote there.
    let (at, line) = (text.find("\n0,").unwrap(), text.rfind(',').unwrap());
    let changed = format!("{}0,NaN{}", &text[..=at], &text[line..]);
    folder.write("kept.csv", changed);
    refused(
        &["--bootstrap", "2", "--resume", "kept.csv"],
        "was changed since",
    );
    folder.write("kept.csv", text.replace('\n', "\r\n"));
    refused(
        &["--bootstrap", "2", "--resume", "kept.csv"],
        "kept.csv was changed since: its lines end with CR LF",
    );
    let both = ["fit", &trials(), "--objective", "both", "--bootstrap", "9"];
    let ended = folder.pilotage(&both);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .stderr
            .contains("--bootstrap takes one fit, and --objective both are two"),
        "{ended:?}"
    );
}

/// A fit without intervals is told as it is, and not solved again.
#[test]
fn a_fit_that_did_not_converge_is_not_solved_again() {
    let folder = Folder::new();
    let ended = folder.pilotage(&[
        "fit",
        &trials(),
        "--max-iterations",
        "2",
        "--bootstrap",
        "4",
        "--json",
    ]);
    assert_eq!(ended.code, 1, "{ended:?}");
    assert!(
        ended.stderr.contains("no profile, no bootstrap"),
        "{ended:?}"
    );
    assert!(ended.json()["parameters"]["theta1"]["bootstrap"].is_null());
}

/// Where noise drives the system its predictions are solved again, and the same numbers come for any number of threads.
#[test]
fn predictions_are_solved_again_too() {
    let folder = Folder::new();
    let example = example("problems/remnant/problem.toml");
    let fit = |threads: &str| {
        let output = folder.path(".").display().to_string();
        let example = example.display().to_string();
        let mut words = vec!["fit", &example, "-o", &output, "--json", "--force"];
        words.extend(["--profile", "q", "--bootstrap", "3"]);
        words.extend(["--bootstrap-kind", "parametric"]);
        let ended = folder.pilotage_with(&words, &[("RAYON_NUM_THREADS", threads)]);
        assert_eq!(ended.code, 0, "{ended:?}");
        timeless(&ended)
    };
    let json = fit("1");
    let own = &json["parameters"]["q"];
    let [low, value, high] = [
        &own["profile"]["low"],
        &own["value"],
        &own["profile"]["high"],
    ]
    .map(number);
    // A density is skewed: it may be larger than found by more than it may be smaller.
    assert!(
        low < value && value < high && high - value > value - low,
        "{own}"
    );
    assert!(number(&own["bootstrap"]["sd"]) > 0.0, "{own}");
    assert_eq!(json, fit("2"));
}
