//! `--profile` and `--bootstrap`: refits of a fit.

mod output;
mod resume;

use crate::cli::deadline::Deadline;
use crate::cli::overwrite::OutputKind;
use crate::cli::progress::Counter;
use crate::cli::shard::Shard;
use crate::cli::{Failure, terminal};
use crate::inference::LEVEL;
use crate::refits::study::ENOUGH_RUNS;
use crate::refits::{Kind, Profile, Replicate, Spread, Study, Watch, spread};
use crate::suggestion::{did_you_mean, suggestion};
pub use output::HEAD;
use pilotage_text::counted;
use resume::Kept;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Arguments of what solves a fit again.
#[derive(Debug, clap::Args)]
pub struct Refits {
    /// Profile these parameters (NAME,NAME; all if none is named): fix each at other values, estimate the others
    /// again, and report the interval in which the objective is not significantly larger.
    #[arg(long, value_name = "NAMES", num_args = 0..=1, default_missing_value = "all")]
    profile: Option<String>,
    /// Fit this number of replicates of the data, and report the spread of the estimates.
    #[arg(long, value_name = "N", value_parser = replicates, allow_hyphen_values = true)]
    bootstrap: Option<u64>,
    /// Kind of the replicates: whole `runs`, drawn with replacement, or `parametric`, with residuals drawn from a
    /// model of the noise [default: runs for four or more runs, else parametric].
    #[arg(long, value_name = "KIND", requires = "bootstrap",
          value_parser = super::named(Kind::ALL, Kind::as_str))]
    bootstrap_kind: Option<Kind>,
    /// Seed of the bootstrap [default: 0].
    #[arg(long, value_name = "SEED", requires = "bootstrap", value_parser = crate::cli::number::whole::<u64>,
          allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Store the refits of the bootstrap in this file as they complete, and reuse those already in it.
    #[arg(long, value_name = "FILE", requires = "bootstrap")]
    resume: Option<PathBuf>,
    /// Only part I of N of the bootstrap, into the file of --resume. The files of all parts, one after the other in one file, are
    /// what --resume of the whole goes on with.
    #[arg(long, value_name = "I/N", requires = "resume")]
    shard: Option<Shard>,
}

/// Maximum number of replicates.
const MOST: u64 = 1_000_000;

fn replicates(text: &str) -> Result<u64, String> {
    let value = text.parse().ok().filter(|count| (2..=MOST).contains(count));
    value.ok_or_else(|| format!("expected a whole number from 2 to {MOST}, such as 200"))
}

/// Note if a fit cannot be refitted.
pub const NOTHING: &str =
    "the fit does not say how sure it is, so it is not solved again: no profile, no bootstrap";

/// The requested refits.
#[derive(Debug)]
pub struct Plan {
    /// Indices of the unknowns to profile.
    profile: Vec<usize>,
    /// Number of replicates, kind of resampling, seed.
    bootstrap: Option<(u64, Kind, u64)>,
    resume: Option<PathBuf>,
    shard: Shard,
}

/// Results of the refits.
pub struct Refitted {
    /// Name and label of each unknown, followed by the derived quantities.
    names: Vec<(String, Option<String>)>,
    /// Number of unknowns.
    unknowns: usize,
    /// Names of constraints and bounds.
    limits: [Vec<String>; 2],
    /// Ratio of the solver's objective to the problem's.
    factor: f64,
    /// Threshold, variance of the residuals, and its degrees of freedom.
    threshold: (f64, f64, Option<f64>),
    profiles: Vec<(usize, Profile)>,
    bootstrap: Option<Bootstrapped>,
    /// Unknowns that the data do not determine.
    flat: Vec<String>,
    /// Whether the likelihood of predictions was minimised (process noise).
    is_predicted: bool,
}

/// Results of a bootstrap.
struct Bootstrapped {
    asked: u64,
    kind: Kind,
    /// What was resampled, in words.
    drawn: &'static str,
    seed: u64,
    replicates: Vec<Replicate>,
}

impl Refits {
    /// The first given flag that requests refits.
    pub fn flag(&self) -> Option<&'static str> {
        let given = [
            ("--profile", self.profile.is_some()),
            ("--bootstrap", self.bootstrap.is_some()),
        ];
        given.into_iter().find(|own| own.1).map(|own| own.0)
    }

    /// The output file.
    pub fn output(&self) -> Option<(&Path, OutputKind)> {
        let path = self.resume.as_deref()?;
        Some((path, OutputKind::Refits))
    }

    /// The refits requested for a fit with these unknowns and this number of runs; `None` if there are none.
    pub fn plan(
        &self,
        names: &[(String, Option<String>)],
        runs: usize,
    ) -> Result<Option<Plan>, Failure> {
        if self.flag().is_none() {
            return Ok(None);
        }
        let kind = self.bootstrap_kind.unwrap_or(Kind::of(runs));
        if self.bootstrap.is_some() && kind == Kind::Runs && runs < ENOUGH_RUNS {
            let message = format!(
                "--bootstrap-kind runs draws whole runs, and of {runs} there are too few; it takes {ENOUGH_RUNS}"
            );
            return Err(Failure::new(message).hint("--bootstrap-kind parametric draws residuals"));
        }
        let seed = self.seed.unwrap_or(0);
        Ok(Some(Plan {
            profile: match &self.profile {
                Some(list) => chosen(list, names)?,
                None => Vec::new(),
            },
            bootstrap: self.bootstrap.map(|count| (count, kind, seed)),
            resume: self.resume.clone(),
            shard: self.shard.unwrap_or(Shard::WHOLE),
        }))
    }
}

/// The unknowns in a list of names, with or without label.
fn chosen(list: &str, names: &[(String, Option<String>)]) -> Result<Vec<usize>, Failure> {
    if list == "all" {
        return Ok((0..names.len()).collect());
    }
    let mut found = Vec::new();
    // Tables write θ.
    let list = list.replace('θ', "theta");
    for name in list.split(',').map(str::trim) {
        let is_meant = |k: &usize| names[*k].0 == name || full_name(&names[*k]) == name;
        let mut own: Vec<usize> = (0..names.len()).filter(is_meant).collect();
        if own.is_empty() {
            // Without its instance, if that is clear.
            let plain = |k: &usize| names[*k].0.rsplit_once('.').map(|own| own.1) == Some(name);
            own = (0..names.len()).filter(plain).collect();
            let is_one = own
                .windows(2)
                .all(|pair| names[pair[0]].0 == names[pair[1]].0);
            own.retain(|_| is_one);
        }
        if own.is_empty() {
            return Err(unknown(name, names));
        }
        found.extend(own);
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

fn unknown(name: &str, names: &[(String, Option<String>)]) -> Failure {
    let mut known: Vec<&str> = names.iter().map(|(name, _)| name.as_str()).collect();
    known.dedup();
    let near = did_you_mean(suggestion(name, known.iter().copied()));
    let message = format!(
        "--profile: nothing that is sought is called `{name}`{near}; there are {}",
        known.join(", ")
    );
    match Path::new(name).exists() {
        true => Failure::new(message).hint("write --profile=all, or --profile behind the files"),
        false => Failure::new(message),
    }
}

fn full_name((name, label): &(String, Option<String>)) -> String {
    match label {
        Some(label) => format!("{name} ({label})"),
        None => name.clone(),
    }
}

impl Plan {
    /// Runs the requested refits until they are done or the deadline.
    ///
    /// # Errors
    /// If the file of refits belongs to another fit, or cannot be written.
    pub fn run(&self, study: &Study<'_>, deadline: Deadline) -> Result<Refitted, Failure> {
        let stops = || deadline.ask().is_break();
        let names = study.unknowns.iter();
        let names = names.map(|own| (own.name.clone(), own.label.clone()));
        let derived = study.derived.iter().map(|name| (name.clone(), None));
        let profiles = self.profiles(study, &stops);
        let stopped = profiles.iter().filter(|(_, own)| own.is_stopped()).count();
        if stopped > 0 {
            let profiles = counted(stopped, "profile");
            terminal::note(&format!(
                "{profiles} of {} stopped before the end",
                self.profile.len()
            ));
        }
        Ok(Refitted {
            names: names.chain(derived).collect(),
            unknowns: study.unknowns.len(),
            limits: [study.constraints.clone(), study.bounds.clone()],
            factor: study.factor,
            threshold: (
                study.threshold.root,
                study.threshold.noise / study.factor,
                study.degrees,
            ),
            profiles,
            bootstrap: self.bootstrapped(study, &stops)?,
            flat: (study.unknowns.iter())
                .filter(|own| !own.half.is_finite())
                .map(crate::refits::Unknown::full_name)
                .collect(),
            is_predicted: study.is_predicted,
        })
    }

    fn profiles(
        &self,
        study: &Study<'_>,
        stops: &(dyn Fn() -> bool + Sync),
    ) -> Vec<(usize, Profile)> {
        let counter = Counter::new("sides of profiles", 2 * self.profile.len() as u64);
        let done = || counter.count();
        let watch = Watch { stops, done: &done };
        let found = study.profiles(&self.profile, &watch);
        counter.clear();
        self.profile.iter().copied().zip(found).collect()
    }

    fn bootstrapped(
        &self,
        study: &Study<'_>,
        stops: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Bootstrapped>, Failure> {
        let Some((asked, kind, seed)) = self.bootstrap else {
            return Ok(None);
        };
        let kept = self.resume.as_deref();
        let kept = kept
            .map(|path| Kept::open(path, study, kind, seed))
            .transpose()?;
        let (mut replicates, kept) =
            kept.map_or((Vec::new(), None), |(read, own)| (read, Some(own)));
        let is_own = |number: u64| number < asked && self.shard.has(number as usize);
        replicates.retain(|own| is_own(own.number));
        let missing = |number: &u64| replicates.iter().all(|own| own.number != *number);
        let own = || (0..asked).filter(|number| is_own(*number));
        let numbers: Vec<u64> = own().filter(missing).collect();
        let counter = Counter::new("bootstrap refits", numbers.len() as u64);
        let kept = Mutex::new((kept, Ok(())));
        let has_failed = || kept.lock().is_ok_and(|own| own.1.is_err());
        let see = |replicate: &Replicate| {
            if let Ok(mut own) = kept.lock()
                && let (Some(file), Ok(())) = &mut *own
                && let Err(error) = file.add(replicate)
            {
                own.1 = Err(error);
            }
        };
        let (stops, done) = (|| stops() || has_failed(), || counter.count());
        let watch = Watch {
            stops: &stops,
            done: &done,
        };
        replicates.extend(study.bootstrap((kind, seed), &numbers, &see, &watch));
        counter.clear();
        if let Ok((_, Err(error))) = kept.into_inner() {
            return Err(error);
        }
        replicates.sort_by_key(|own| own.number);
        let found = Bootstrapped {
            asked: own().count() as u64,
            kind,
            drawn: match kind {
                Kind::Runs => "runs drawn with replacement",
                Kind::Parametric if study.is_predicted => {
                    "values drawn from what is predicted, sample by sample"
                }
                Kind::Parametric => "residuals drawn from autoregressive noise",
            },
            seed,
            replicates,
        };
        if found.missing() > 0 {
            terminal::note(&found.stopped(self.resume.as_deref()));
        }
        Ok(Some(found))
    }
}

impl Refitted {
    /// Whether all requested refits were completed.
    pub fn is_whole(&self) -> bool {
        let bootstrap = self.bootstrap.as_ref();
        bootstrap.is_none_or(|own| own.missing() == 0)
            && !self.profiles.iter().any(|(_, own)| own.is_stopped())
    }
}

impl Bootstrapped {
    /// The spread of the values of an unknown.
    fn spread(&self, unknown: usize) -> Option<Spread> {
        let all = self.replicates.iter();
        spread(
            all.filter_map(|own| Some(own.values.as_ref()?[unknown])),
            LEVEL,
        )
    }

    fn converged(&self) -> usize {
        self.replicates
            .iter()
            .filter(|own| own.values.is_some())
            .count()
    }

    fn missing(&self) -> u64 {
        self.asked - self.replicates.len() as u64
    }

    fn stopped(&self, resume: Option<&Path>) -> String {
        let next = match resume {
            Some(path) => format!("; the same command goes on with {}", path.display()),
            None => "; with --resume FILE it could go on from there".to_owned(),
        };
        format!(
            "the bootstrap was stopped with {} of {} refits{next}",
            self.replicates.len(),
            self.asked
        )
    }
}
