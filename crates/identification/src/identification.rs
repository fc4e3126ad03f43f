//! A fit with all that belongs to it: what people and files are told comes from here.

use super::joint::Joint;
use super::simulate::{LONGEST, at_rest};
use super::solve::Observer;
use super::statistics::rms;
use super::{Fit, FitError, FitOptions, Objective, RunFit, Trial, TrialSet};
use super::{derived, fit, frequency, simulate, simulate_from};
use pilotage_inference::Interval;
use pilotage_inference::spectrum::{Describing, Excitation};
use pilotage_linear::Figure;

/// A pilot identified from trials.
#[derive(Debug, Clone)]
pub struct Identification {
    /// The fit.
    pub fit: Fit,
    /// What it was asked to do.
    pub options: FitOptions,
    /// The trials that it was fitted to, and those that it was not.
    pub trials: TrialSet,
    /// The figures of its closed loop, each with its interval ([`derived`](derived::derived)).
    pub derived: Vec<(Figure, Interval)>,
    /// What the trials of the fit say of pilot and loop without a model.
    pub describing: Describing,
    /// What they excite; none where no flight has three samples.
    pub excitation: Option<Excitation>,
    /// All trials as the pilot flies them alone, from rest where the solution begins, in the order of
    /// [`TrialSet::all`]: none where nobody said which vehicle was flown, where a trial is longer than
    /// [`LONGEST`], or where the pilot is too fast to be simulated.
    flown: Vec<Option<RunFit>>,
}

/// A trial, and what the identified pilot makes of it.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<'a> {
    /// The trial.
    pub trial: &'a Trial,
    /// The run in the optimiser's solution; none for a validation run.
    pub solution: Option<&'a RunFit>,
    /// The run as the pilot flies it alone.
    pub alone: Option<&'a RunFit>,
}

impl Outcome<'_> {
    /// Of the pilot alone: rms distance from the recording, and where it ends, from the last target \[m\].
    pub fn errors(&self) -> Option<(f64, f64)> {
        let run = self.alone?;
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        Some((rms(&run.residual), last(&run.position) - last(&run.target)))
    }
}

impl Identification {
    /// Fits a pilot to the trials, as [`fit`](fit()) does, and flies it.
    ///
    /// # Errors
    /// As [`fit`](fit()).
    pub fn new(
        trials: TrialSet,
        options: FitOptions,
        observer: &mut Observer<'_>,
    ) -> Result<Self, FitError> {
        let fit = fit(&trials.fit, &options, observer)?;
        Ok(Self::of(fit, options, trials))
    }

    /// Of a fit to the trials of a set.
    pub fn of(fit: Fit, options: FitOptions, trials: TrialSet) -> Self {
        let solutions = fit.runs.iter().map(Some).chain(std::iter::repeat(None));
        let flown = (trials.all().zip(solutions))
            .map(|(trial, solution)| fly(&fit, &options, trial, solution))
            .collect();
        Self {
            derived: derived::derived(&fit, &options),
            excitation: Excitation::of(&frequency::flights(&trials.fit)),
            describing: frequency::describing(&fit, &trials.fit, &options),
            fit,
            options,
            trials,
            flown,
        }
    }

    /// What became of each trial: those of the fit, then the others.
    pub fn outcomes(&self) -> impl Iterator<Item = Outcome<'_>> {
        let solutions = self.fit.runs.iter().map(Some);
        let solutions = solutions.chain(std::iter::repeat(None));
        let all = self.trials.all().zip(solutions).zip(&self.flown);
        all.map(|((trial, solution), alone)| Outcome {
            trial,
            solution,
            alone: alone.as_ref(),
        })
    }
}

/// A trial flown by the pilot alone.
fn fly(
    fit: &Fit,
    options: &FitOptions,
    trial: &Trial,
    solution: Option<&RunFit>,
) -> Option<RunFit> {
    let joint = Joint {
        vehicle: *options.loop_vehicle()?,
        pilot: options.pilot,
    };
    if trial.duration() > LONGEST {
        return None;
    }
    let run = match solution {
        // The first sample is a measurement like the others.
        Some(run) if options.objective == Objective::Response => {
            let states = at_rest(&joint, run.position[0]);
            simulate_from(&joint, &fit.theta, trial, &states)
        }
        _ => simulate(&joint, &fit.theta, trial),
    };
    run.ok()
}
