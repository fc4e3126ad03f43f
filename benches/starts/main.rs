//! How often a fit ends at the best known optimum without a start from the user, and what it costs: the default fit of the
//! flights of ten humans, with ten seeds each.
//!
//! ```text
//! cargo bench --bench starts -- --starts 40 --json all.json      # hours on one core
//! cargo bench --bench starts -- --pilot late --data-sets 3
//! cargo bench --bench starts -- --best all.json                  # after a change to the starts
//! ```
//!
//! Best known objectives are merged with `--best`: a JSON array of objects with `initial_state`, `scheme`, `pilot`, `seed` and
//! `best` \[m²\], as `--json` writes it. `benches/ipopt/best.py` lets IPOPT solve the same data sets and writes such a file.
//! `RAYON_NUM_THREADS` sets the number of threads. Seconds are those of the processor.

mod pilots;

use clap::Parser;
use pilotage::collocation::Scheme;
use pilotage::estimation::{Fit, Posed, fit};
use pilotage::flights::options::InitialState;
use pilotage::flights::{FlightOptions, TrialSet, open};
use pilotage::synthetic::Human;
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Relative distance to the best known objective that counts as the same.
const SAME: f64 = 1e-3;

/// How often the default fit leads to the best optimum known.
#[derive(Debug, Parser)]
struct Args {
    /// What is known of the states at the first sample.
    #[arg(long, default_value = FlightOptions::default().initial_state.as_str())]
    initial_state: String,
    /// Collocation scheme.
    #[arg(long, default_value_t = Scheme::HermiteSimpson)]
    scheme: Scheme,
    /// Data sets of each human.
    #[arg(long, default_value_t = 10)]
    data_sets: u64,
    /// Starts of a fit.
    #[arg(long, default_value_t = FlightOptions::default().fit.starts())]
    starts: usize,
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
}

/// Result for one data set.
struct Outcome {
    data: DataSet,
    fit: Fit,
    /// Time of the processor \[s\].
    seconds: f64,
    /// Smallest known objective, from all sources \[m²\].
    best: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let sets = args.data_sets();
    if let Some(folder) = &args.flights {
        return write(&sets, folder);
    }
    let options = args.options()?;
    let known = args.known()?;
    println!("{}", heading());
    let mut outcomes = Vec::new();
    for data in sets {
        let same = |entry: &&Value| {
            entry["pilot"] == data.pilot
                && entry["seed"] == data.seed
                && entry["initial_state"] == args.initial_state.as_str()
                && entry["scheme"] == args.scheme.to_string()
        };
        let values = known.iter().filter(same).filter_map(|e| e["best"].as_f64());
        let least = values.fold(f64::INFINITY, f64::min);
        let outcome = study(data, &options, least)?;
        println!("{}", outcome.line());
        outcomes.push(outcome);
    }
    print!("{}", verdict(&outcomes));
    if let Some(file) = &args.json {
        let results: Vec<Value> = outcomes.iter().map(|o| o.to_json(&args)).collect();
        std::fs::write(file, format!("{:#}\n", Value::from(results)))?;
    }
    Ok(())
}

impl Args {
    fn options(&self) -> Result<FlightOptions, String> {
        let state = (InitialState::ALL.into_iter()).find(|s| s.as_str() == self.initial_state);
        let mut options = FlightOptions {
            initial_state: state.ok_or("no such initial state")?,
            ..FlightOptions::default()
        };
        options.fit.scheme = Some(self.scheme);
        options.fit.starts = Some(self.starts);
        Ok(options)
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

    fn data_sets(&self) -> Vec<DataSet> {
        let (humans, before) = match self.tuning {
            true => (pilots::TUNING, 10),
            false => (pilots::STUDY, 0),
        };
        let wanted = |name: &str| self.pilot.as_ref().is_none_or(|pilot| pilot == name);
        let humans = humans.into_iter().filter(|(name, _)| wanted(name));
        let sets = humans.flat_map(|(pilot, human)| {
            let seeds = before + 1..=before + self.data_sets;
            seeds.map(move |seed| DataSet { pilot, human, seed })
        });
        sets.collect()
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

/// The fit of a data set, compared with the best objective known.
fn study(data: DataSet, options: &FlightOptions, known: f64) -> Result<Outcome, Box<dyn Error>> {
    let flights = TrialSet {
        fit: pilots::flights(&data.human, data.seed)?,
        ..TrialSet::default()
    };
    let before = processor();
    let problem = options.problem(&flights)?;
    let posed = Posed::new(&problem, &open)?;
    let fit = fit(&posed, &mut |_| ControlFlow::Continue(()));
    Ok(Outcome {
        data,
        seconds: processor() - before,
        best: match fit.is_answer() {
            true => known.min(fit.objective),
            false => known,
        },
        fit,
    })
}

/// Time of the processor that this process has taken \[s\].
fn processor() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

impl Outcome {
    /// Relative distance of the fit to the best known objective.
    fn gap(&self) -> f64 {
        self.fit.objective / self.best - 1.0
    }

    /// A lower iterate that has not converged is not a result.
    fn is_best(&self) -> bool {
        self.fit.is_answer() && self.gap() <= SAME
    }

    /// True if the fit itself reports that there may be a better optimum, or that it has not converged.
    fn reports_doubt(&self) -> bool {
        let is_alone = |code: &str| code == "alone";
        !self.fit.is_answer() || self.fit.diagnostics.iter().any(|d| is_alone(d.code()))
    }

    fn to_json(&self, args: &Args) -> Value {
        let starts = self.fit.starts.iter();
        let starts: Vec<Value> = starts
            .map(|s| json!([s.objective, s.status.as_str(), s.iterations]))
            .collect();
        let theta = self.fit.parameters.iter().map(|own| own.mean());
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
                "seconds": self.seconds,
                "theta": theta.collect::<Vec<f64>>(),
                "starts": starts,
            },
        })
    }

    fn line(&self) -> String {
        let fit = &self.fit;
        format!(
            "{:<12} {:>4} {:>14.6} {:<16} {:>6} {:>10} {:>8.2} {:>14.6} {:>9.1e}",
            self.data.pilot,
            self.data.seed,
            fit.objective,
            fit.status,
            format!("{}/{}", fit.agreeing(), fit.starts.len()),
            fit.iterations,
            self.seconds,
            self.best,
            self.gap()
        )
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

/// Number of fits at the best known optimum, the other fits, and the cost of all.
fn verdict(outcomes: &[Outcome]) -> String {
    let mut text = String::from("\n");
    let behind: Vec<&Outcome> = outcomes.iter().filter(|o| !o.is_best()).collect();
    if !behind.is_empty() {
        text += &format!("not at the best known:\n{}\n", heading());
        behind
            .iter()
            .for_each(|o| text += &format!("{}\n", o.line()));
    }
    let converged = outcomes.iter().filter(|o| o.fit.is_answer()).count();
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
    let seconds = outcomes.iter().map(|o| o.seconds).collect();
    text + &spread("iterations", iterations) + &spread("processor seconds", seconds)
}

/// Median, maximum and sum.
fn spread(name: &str, mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    match values.last() {
        Some(last) => format!(
            "{name}: median {:.3}, at most {last:.3}, in all {:.3}\n",
            values[values.len() / 2],
            values.iter().sum::<f64>()
        ),
        None => String::new(),
    }
}
