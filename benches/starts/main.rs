//! How often the fit ends at the best known optimum without a start from the user: ten humans times ten seeds, the
//! default fit of each compared with the best of many random starts.
//!
//! ```text
//! cargo bench --bench starts -- --json all.json            # hours on one core
//! cargo bench --bench starts -- --pilot late --data-sets 3 --random-starts 10
//! cargo bench --bench starts -- --random-starts 0 --best all.json    # after a change to the starts
//! ```
//!
//! Best known objectives of other solvers are merged with `--best`: a JSON array of objects with
//! `initial_state`, `scheme`, `pilot`, `seed` and `best`, as `--json` writes it.
//! `benches/ipopt/best.py` lets IPOPT solve the same data sets and writes such a file.
//! `RAYON_NUM_THREADS` sets the number of threads.

mod pilots;

use clap::Parser;
use pilotage::collocation::Scheme;
use pilotage::identification::solve::Iterate;
use pilotage::identification::{
    Diagnostic, Fit, FitOptions, InitialState, Progress, Trial, fit, random_starts,
};
use pilotage::sqp::Status;
use pilotage::synthetic::Human;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Relative distance to the best known objective that counts as the same.
const SAME: f64 = 1e-3;
/// Constraint violation above which an objective is meaningless.
const FEASIBLE: f64 = 1e-6;
/// Iterations within which a random start must halve its distance to the best objective.
const WINDOW: usize = 10;

/// How often the default start leads to the best optimum known.
#[derive(Debug, Parser)]
struct Args {
    /// What is known of the states at the first sample.
    #[arg(long, default_value = FitOptions::default().initial_state.as_str())]
    initial_state: String,
    /// Collocation scheme.
    #[arg(long, default_value_t = FitOptions::default().scheme)]
    scheme: Scheme,
    /// Data sets of each human.
    #[arg(long, default_value_t = 10)]
    data_sets: u64,
    /// Random starts for each data set.
    #[arg(long, default_value_t = 40)]
    random_starts: usize,
    /// One human alone, by name.
    #[arg(long)]
    pilot: Option<String>,
    /// The humans and seeds with whom the starts were worked out, in place of the study's.
    #[arg(long)]
    tuning: bool,
    /// Write the flights of each data set as trials, with a list of the data sets, and end.
    #[arg(long, value_name = "FOLDER")]
    flights: Option<PathBuf>,
    /// Results with best known objectives.
    #[arg(long, value_name = "FILE")]
    best: Vec<PathBuf>,
    /// Write the results, too.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Cargo says so.
    #[arg(long, hide = true)]
    bench: bool,
}

/// The flights of one human with one seed.
struct DataSet {
    pilot: &'static str,
    human: Human,
    seed: u64,
    trials: Vec<Trial>,
}

/// Result for one data set.
struct Outcome<'a> {
    data: &'a DataSet,
    fit: Fit,
    /// Objective and θ of the best random start.
    random: Option<(f64, Vec<f64>)>,
    /// Random starts that converged.
    converged: usize,
    /// Smallest known objective, from all sources.
    best: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    if let Some(folder) = &args.flights {
        return write(&args.data_sets()?, folder);
    }
    let options = args.options()?;
    let known = args.known()?;
    let sets = args.data_sets()?;
    println!("{}", heading());
    let mut outcomes: Vec<Outcome> = (sets.par_iter())
        .map(|data| {
            let outcome = study(data, &options, args.random_starts);
            println!("{}", line(&outcome));
            outcome
        })
        .collect();
    for outcome in &mut outcomes {
        let same = |entry: &&Value| {
            entry["pilot"] == outcome.data.pilot
                && entry["seed"] == outcome.data.seed
                && entry["initial_state"] == args.initial_state.as_str()
                && entry["scheme"] == args.scheme.to_string()
        };
        let values = known.iter().filter(same).filter_map(|e| e["best"].as_f64());
        outcome.best = values.fold(outcome.best, f64::min);
    }
    print!("{}", verdict(&outcomes));
    if let Some(file) = &args.json {
        let results: Vec<Value> = outcomes.iter().map(|o| o.to_json(&args)).collect();
        std::fs::write(file, format!("{:#}\n", Value::from(results)))?;
    }
    Ok(())
}

impl Args {
    fn options(&self) -> Result<FitOptions, String> {
        let state = (InitialState::ALL.into_iter()).find(|s| s.as_str() == self.initial_state);
        Ok(FitOptions {
            initial_state: state.ok_or("no such initial state")?,
            scheme: self.scheme,
            ..FitOptions::default()
        })
    }

    /// Entries of the files with best known objectives.
    fn known(&self) -> Result<Vec<Value>, Box<dyn Error>> {
        let mut all = Vec::new();
        for file in &self.best {
            let entries: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(file)?)?;
            let fields = ["initial_state", "scheme", "pilot", "seed", "best"];
            let missing = |entry: &Value| fields.into_iter().find(|f| entry.get(f).is_none());
            if let Some(field) = entries.iter().find_map(missing) {
                return Err(format!("{}: an entry has no {field}", file.display()).into());
            }
            all.extend(entries);
        }
        Ok(all)
    }

    fn data_sets(&self) -> Result<Vec<DataSet>, Box<dyn Error>> {
        let (humans, before) = match self.tuning {
            true => (pilots::TUNING, 10),
            false => (pilots::STUDY, 0),
        };
        let wanted = |name: &str| self.pilot.as_ref().is_none_or(|pilot| pilot == name);
        let mut sets = Vec::new();
        for (pilot, human) in humans.iter().filter(|(name, _)| wanted(name)) {
            for seed in before + 1..=before + self.data_sets {
                let trials = pilots::flights(human, seed)?;
                sets.push(DataSet {
                    pilot,
                    human: *human,
                    seed,
                    trials,
                });
            }
        }
        Ok(sets)
    }
}

/// Writes a folder of trials with their manifest for each data set, and `sets.json`, which lists them.
fn write(sets: &[DataSet], folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut list = Vec::new();
    for data in sets {
        let name = format!("{}-{}", data.pilot, data.seed);
        let own = folder.join(&name);
        std::fs::create_dir_all(&own)?;
        let mut manifest = String::new();
        for flight in pilots::flown(&data.human, data.seed)? {
            let file = format!("{}.csv", flight.name);
            manifest += &format!("[[run]]\nfile = \"{file}\"\n");
            std::fs::write(own.join(file), flight.series.to_csv())?;
        }
        std::fs::write(own.join("trials.toml"), manifest)?;
        let manifest = format!("{name}/trials.toml");
        list.push(json!({ "pilot": data.pilot, "seed": data.seed, "manifest": manifest }));
    }
    std::fs::write(
        folder.join("sets.json"),
        format!("{:#}\n", Value::from(list)),
    )?;
    Ok(())
}

/// The default fit and the random starts.
fn study<'a>(data: &'a DataSet, options: &FitOptions, count: usize) -> Outcome<'a> {
    let fit = fit(&data.trials, options, &mut |_| ControlFlow::Continue(()))
        .expect("six flights can be fitted");
    let mut outcome = Outcome {
        data,
        best: if fit.converged {
            fit.objective
        } else {
            f64::INFINITY
        },
        fit,
        random: None,
        converged: 0,
    };
    for start in random_starts::draw(options, data.seed, count) {
        let Some(fit) = random_fit(&data.trials, options, start, outcome.best) else {
            continue;
        };
        outcome.converged += usize::from(fit.converged);
        outcome.best = outcome.best.min(fit.objective);
        if (outcome.random.as_ref()).is_none_or(|(least, _)| fit.objective < *least) {
            outcome.random = Some((fit.objective, fit.theta));
        }
    }
    outcome
}

/// The fit from one random start; `None` if its last iterate is infeasible. It stops early if it approaches the best
/// objective so far too slowly.
fn random_fit(trials: &[Trial], options: &FitOptions, start: Vec<f64>, best: f64) -> Option<Fit> {
    let options = FitOptions {
        start: Some(start),
        ..options.clone()
    };
    let (mut objectives, mut violation) = (Vec::new(), f64::INFINITY);
    let fit = fit(trials, &options, &mut |progress| {
        let Progress::Iterate(Iterate { iteration, .. }) = progress else {
            return ControlFlow::Continue(());
        };
        let f = iteration.objective;
        violation = iteration.kkt.primal;
        objectives.push(f);
        let earlier = objectives.len().checked_sub(WINDOW + 1);
        let crawls = earlier.is_some_and(|k| (objectives[k] - f).abs() < 0.5 * (f - best));
        match violation < 1e-2 && f > best * (1.0 + SAME) && crawls {
            true => ControlFlow::Break(Status::TimeLimit),
            false => ControlFlow::Continue(()),
        }
    });
    (violation <= FEASIBLE).then_some(fit.expect("a random start is finite"))
}

impl Outcome<'_> {
    /// Relative distance of the default fit to the best known objective.
    fn gap(&self) -> f64 {
        self.fit.objective / self.best - 1.0
    }

    /// A lower iterate that has not converged is not a result.
    fn is_best(&self) -> bool {
        self.fit.converged && self.gap() <= SAME
    }

    /// True if the fit itself reports that there may be a better optimum, or that it has not converged.
    fn reports_doubt(&self) -> bool {
        let of_starts = |d: &Diagnostic| {
            matches!(
                d,
                Diagnostic::OneStart { .. }
                    | Diagnostic::Lower { .. }
                    | Diagnostic::WildStart { .. }
            )
        };
        !self.fit.converged || self.fit.diagnostics.iter().any(of_starts)
    }

    fn to_json(&self, args: &Args) -> Value {
        let starts: Vec<Value> = (self.fit.starts.iter())
            .map(|s| json!([s.objective, s.status.as_str(), s.iterations]))
            .collect();
        json!({
            "initial_state": args.initial_state,
            "scheme": args.scheme.to_string(),
            "pilot": self.data.pilot,
            "seed": self.data.seed,
            "best": self.best,
            "default": {
                "objective": self.fit.objective,
                "status": self.fit.status.as_str(),
                "iterations": self.fit.iterations,
                "seconds": self.fit.seconds,
                "theta": self.fit.theta,
                "starts": starts,
            },
            "random": {
                "objective": self.random.as_ref().map(|(f, _)| f),
                "theta": self.random.as_ref().map(|(_, theta)| theta),
                "converged": self.converged,
            },
        })
    }
}

fn heading() -> String {
    format!(
        "{:<12} {:>4} {:>14} {:<16} {:>6} {:>10} {:>8} {:>14} {:>9}",
        "pilot",
        "seed",
        "default [m²]",
        "status",
        "agree",
        "iterations",
        "seconds",
        "best [m²]",
        "gap"
    )
}

fn line(outcome: &Outcome) -> String {
    let fit = &outcome.fit;
    format!(
        "{:<12} {:>4} {:>14.6} {:<16} {:>6} {:>10} {:>8.2} {:>14.6} {:>9.1e}",
        outcome.data.pilot,
        outcome.data.seed,
        fit.objective,
        fit.status,
        format!("{}/{}", fit.agreeing(), fit.tried),
        fit.iterations,
        fit.seconds,
        outcome.best,
        outcome.gap()
    )
}

/// Number of fits at the best known optimum, the other fits, and the cost of the default fits.
fn verdict(outcomes: &[Outcome]) -> String {
    let mut text = String::from("\n");
    let behind: Vec<&Outcome> = outcomes.iter().filter(|o| !o.is_best()).collect();
    if !behind.is_empty() {
        text += "not at the best known:\n";
        text += &format!("{}\n", heading());
        behind
            .iter()
            .for_each(|o| text += &format!("{}\n", line(o)));
    }
    let converged = outcomes.iter().filter(|o| o.fit.converged).count();
    let silent = behind.iter().filter(|o| !o.reports_doubt()).count();
    let doubted = (outcomes.iter())
        .filter(|o| o.is_best() && o.reports_doubt())
        .count();
    text += &format!(
        "{} of {} within {} % of the best known, {doubted} of them in doubt; {converged} converged; \
         {silent} are behind and do not say so\n",
        outcomes.len() - behind.len(),
        outcomes.len(),
        SAME * 100.0
    );
    let iterations = outcomes.iter().map(|o| o.fit.iterations as f64).collect();
    let seconds = outcomes.iter().map(|o| o.fit.seconds).collect();
    text + &spread("iterations", iterations) + &spread("seconds", seconds)
}

/// Median and maximum.
fn spread(name: &str, mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    match values.last() {
        Some(last) => format!(
            "{name}: median {:.3}, at most {last:.3}\n",
            values[values.len() / 2]
        ),
        None => String::new(),
    }
}
