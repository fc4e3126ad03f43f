//! docs/json.md has every key that a fit prints, and nothing else.

use crate::command::{Ended, Folder, example};
use crate::{compare, delays, describing, selection};
use serde_json::Value;
use std::collections::BTreeSet;

/// Keys of the docs, and those that were found.
struct Keys {
    documented: BTreeSet<String>,
    found: BTreeSet<String>,
}

/// Keys in the first column of the tables below these headings. `a[.LABEL]` stands for `a` and `a.LABEL`.
fn documented(titles: &[&str]) -> BTreeSet<String> {
    let text = include_str!("../../docs/json.md");
    let sections = text.split("\n## ").filter_map(|own| own.split_once('\n'));
    let own = sections.filter(|(title, _)| titles.contains(title));
    let rows = own.flat_map(|(_, text)| text.lines().filter(|line| line.starts_with("| `")));
    let first = rows.filter_map(|row| row.split('|').nth(1));
    let keys = first.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    let both = |key: &str| {
        [
            key.replace("[.LABEL]", ""),
            key.replace("[.LABEL]", ".LABEL"),
        ]
    };
    let keys: BTreeSet<String> = keys.flat_map(both).collect();
    assert!(!keys.is_empty(), "{titles:?}");
    keys
}

const FIT: [&str; 4] = ["The fit", "Parameters", "How sure it is", "Runs"];

impl Keys {
    fn of(titles: &[&str]) -> Self {
        let (documented, found) = (documented(titles), BTreeSet::new());
        Self { documented, found }
    }

    fn is_begin(&self, path: &str) -> bool {
        let mut keys = self.documented.iter();
        keys.any(|key| {
            key.strip_prefix(path)
                .is_some_and(|rest| rest.starts_with(['.', '[']))
        })
    }

    /// Walks an object, in which names of the problem are those in capitals of the docs.
    fn walk(&mut self, value: &Value, path: &str) {
        let objects = |list: &Vec<Value>| list.iter().all(Value::is_object) && !list.is_empty();
        match value {
            Value::Object(all) => {
                for (name, value) in all {
                    let own = [path, name].join(if path.is_empty() { "" } else { "." });
                    let own = match self.documented.contains(&own) || self.is_begin(&own) {
                        true => own,
                        false => self.named(path).unwrap_or(own),
                    };
                    self.walk(value, &own);
                }
            }
            Value::Array(all) if objects(all) => {
                all.iter()
                    .for_each(|own| self.walk(own, &format!("{path}[]")));
            }
            // Nothing where something may be.
            Value::Null | Value::Array(_) if self.is_begin(path) => {}
            _ => _ = self.found.insert(path.to_owned()),
        }
    }

    /// The key of the docs below this one that stands for a name.
    fn named(&self, path: &str) -> Option<String> {
        let below = |key: &String| {
            let rest = key.strip_prefix(path)?.strip_prefix('.')?;
            let name = rest.split(['.', '[']).next()?;
            let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_uppercase());
            is_name.then(|| format!("{path}.{name}"))
        };
        self.documented.iter().find_map(below)
    }

    /// Compares with the docs, beside which these keys are known.
    fn check(&self, known: &BTreeSet<String>) {
        let is_known = |key: &&String| {
            let group = key.split('.').next().unwrap_or_default();
            known.contains(*key) || known.contains(&format!("{group}.*"))
        };
        let new = self.found.difference(&self.documented);
        let new: Vec<_> = new.filter(|key| !is_known(key)).collect();
        assert!(new.is_empty(), "not in docs/json.md: {new:#?}");
    }

    fn check_all(&self) {
        self.check(&BTreeSet::new());
        let gone: Vec<_> = self.documented.difference(&self.found).collect();
        assert!(gone.is_empty(), "in docs/json.md, but in no fit: {gone:#?}");
    }
}

/// Seven runs of two people, the last for validation: a level that decays, and is fed.
fn decays(rest: &str) -> Folder {
    let folder = Folder::new();
    let model = "[model]\nname = \"m\"\n[inputs]\nu = 0\n[parameters]\nrate = 0.5\ngain = 0.9\nx0 = 2.0\ntwice = 1\n[states]\n\
                 x = { start = \"x0\", der = \"gain * u + 0 * twice - rate * x\" }\n\
                 y = { start = 0.2, der = \"-3 * y\" }\n[outputs]\nsum = \"x + y\"\n\
                 fed = { value = \"gain * u\", limit = [-0.6, 0.6] }\n";
    folder.write("m.toml", model);
    let mut problem = "[system.m]\nmodel = \"m.toml\"\n[inputs]\n\"m.u\" = \"u\"\n[[measured]]\nsignal = \"m.sum\"\n\
                       column = \"s\"\nsd = 0.05\n"
        .to_owned();
    problem += rest;
    for j in 0..7 {
        let mut rows = "time,u,s\n".to_owned();
        let (mut x, mut y) = (1.8 + 0.2 * f64::from(j % 2), 0.3);
        for k in 0..60 {
            let noise = (f64::from(k * k * 7) + 13.0 * f64::from(j)).sin();
            let t = 0.1 * f64::from(k);
            let u = (0.7 * t + f64::from(j)).sin();
            rows += &format!("{t},{u},{}\n", x + y + 0.05 * noise);
            x += 0.1 * (u - 0.7 * x);
            y *= (-0.3_f64).exp();
        }
        folder.write(&format!("run{j}.csv"), rows);
        let subject = ["A", "B"][j as usize % 2];
        problem += &format!("[[run]]\nfile = \"run{j}.csv\"\nsubject = \"{subject}\"\n");
    }
    folder.write("problem.toml", problem + "use = \"validation\"\n");
    folder
}

fn json(ended: &Ended) -> Value {
    assert!(ended.code < 2, "{ended:?}");
    ended.json()
}

#[test]
fn every_key_of_a_fit_is_in_the_docs_and_every_key_of_the_docs_in_a_fit() {
    let mut keys = Keys::of(&FIT);
    let folder = decays(
        "[parameters]\n\"m.rate\" = {}\n\"m.gain\" = {}\n\"m.x0\" = { per = \"subject\" }\n\"m.twice\" = { value = \"2 * m.rate\" }\n\
         [initial]\n\"m.y\" = \"free\"\n[derived]\nhalf_life = \"log(2) / m.rate\"\ndouble = \"2 * m.x0\"\n\
         [fit]\nstarts = 2\n",
    );
    let flags = [
        "--profile=all",
        "--bootstrap",
        "6",
        "--per-run",
        "--leave-one-out",
        "--json",
        "--log=fit.jsonl",
    ];
    let fit = json(&folder.pilotage(&[&["fit", "problem.toml"], &flags[..]].concat()));
    assert_eq!(fit["schema"], 3);
    keys.walk(&fit, "");

    let mut log = Keys::of(&["Lines of a log"]);
    for line in folder.read("fit.jsonl").lines() {
        log.walk(&serde_json::from_str(line).unwrap(), "");
    }
    log.check_all();

    let mut evaluation = Keys::of(&["An evaluation"]);
    evaluation.walk(
        &json(&folder.pilotage(&["fit", "problem.toml", "--evaluate", "--json"])),
        "",
    );
    evaluation.check_all();

    // A parameter at its bound; noise in the loop; a fit that does not converge.
    for rest in [
        "[parameters]\n\"m.rate\" = {}\n\"m.gain\" = { max = 0.95 }\n",
        "[parameters]\n\"m.rate\" = {}\nq = { start = 1e-3, min = 1e-6 }\n[process_noise]\n\"m.x\" = { density = \"q\" }\n\
         [fit]\nstarts = 1\nobjective = \"prediction-error\"\n",
        "[parameters]\n\"m.*\" = {}\n[fit]\nmax_iterations = 1\n",
    ] {
        let rest = rest.replace("\"m.*\"", "\"m.rate\"");
        keys.walk(
            &json(&decays(&rest).pilotage(&["fit", "problem.toml", "--json"])),
            "",
        );
    }

    let folder = compare::flights(1, 3);
    folder.write("linear.toml", selection::linear(compare::RUNS));
    for limit in ["500", "1"] {
        let words = [
            "fit",
            "linear.toml",
            "--orders=1..2",
            "--max-iterations",
            limit,
            "--json",
        ];
        keys.walk(&json(&folder.pilotage(&words)), "");
    }

    keys.walk(
        &json(&delays::folder().pilotage(&["fit", "p.toml", "--json"])),
        "",
    );

    let folder = describing::flown();
    let third = folder.read("sines/run3.csv");
    let half: Vec<&str> = third.lines().take(400).collect();
    folder.write("sines/run3.csv", half.join("\n"));
    folder.write(
        "problem.toml",
        describing::PROBLEM
            .replace("DELAY", "0.15")
            .replace("starts = 2", "starts = 1"),
    );
    keys.walk(
        &json(&folder.pilotage(&["fit", "problem.toml", "--json"])),
        "",
    );
    keys.check_all();
}

/// Flights have the same, and of two fits both.
#[test]
fn every_key_of_flights_is_in_the_docs() {
    let folder = Folder::new();
    let trials = example("trials/trials.toml").display().to_string();
    let mut keys = Keys::of(&FIT);
    let both = json(&folder.pilotage(&["fit", &trials, "--objective=both", "--json"]));
    let own: Vec<&String> = both.as_object().unwrap().keys().collect();
    assert_eq!(own, ["flown_alone", "response", "stick"]);
    keys.walk(&both["response"], "");
    keys.walk(&both["stick"], "");
    keys.check(&BTreeSet::new());
    let runs = both["flown_alone"].as_array().unwrap();
    assert_eq!(runs.len(), 6);
    let text = include_str!("../../docs/json.md");
    for key in runs[0].as_object().unwrap().keys() {
        assert!(text.contains(&format!("`{key}`")), "{key}");
    }
}
