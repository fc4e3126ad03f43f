//! A fit with all results derived from it; reports and files are generated from this.

use super::joint::Joint;
use super::simulate::{LONGEST, at_rest};
use super::solve::Observer;
use super::{Fit, FitError, FitOptions, Objective, RunFit, Trial, TrialSet};
use super::{derived, fit, frequency, simulate, simulate_from};
use pilotage_flights::trials::driven;
use pilotage_inference::Interval;
use pilotage_inference::spectrum::{Describing, Excitation};
use pilotage_inference::statistics::rms;
use pilotage_linear::Figure;

/// A pilot identified from trials.
#[derive(Debug, Clone)]
pub struct Identification {
    /// The fit.
    pub fit: Fit,
    /// The options of the fit.
    pub options: FitOptions,
    /// The trials of the fit and those for validation.
    pub trials: TrialSet,
    /// The figures of its closed loop, each with its interval ([`derived`](derived::derived)).
    pub derived: Vec<(Figure, Interval)>,
    /// Describing functions of pilot and loop from the trials of the fit.
    pub describing: Describing,
    /// Excitation by the trials; `None` if no flight has three samples.
    pub excitation: Option<Excitation>,
    /// All trials simulated with the pilot alone, from rest at the initial position of the solution, in the order of
    /// [`TrialSet::all`]: `None` if the vehicle is not known, if a trial is longer than [`LONGEST`], or if the pilot is
    /// too fast to be simulated.
    flown: Vec<Option<RunFit>>,
}

/// A trial and its simulation with the identified pilot.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<'a> {
    /// The trial.
    pub trial: &'a Trial,
    /// The run in the optimiser's solution; `None` for a validation run.
    pub solution: Option<&'a RunFit>,
    /// The run simulated with the pilot alone.
    pub alone: Option<&'a RunFit>,
}

impl Outcome<'_> {
    /// Errors of the pilot alone: rms distance from the recording, and final distance from the last target \[m\].
    pub fn errors(&self) -> Option<(f64, f64)> {
        let run = self.alone?;
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        Some((rms(&run.residual), last(&run.position) - last(&run.target)))
    }
}

impl Identification {
    /// Fits a pilot to the trials, as [`fit`](fit()) does, and simulates it.
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

    /// Builds the results of a fit to the trials of a set.
    pub fn of(fit: Fit, options: FitOptions, trials: TrialSet) -> Self {
        let solutions = fit.runs.iter().map(Some).chain(std::iter::repeat(None));
        let flown = (trials.all().zip(solutions))
            .map(|(trial, solution)| fly(&fit, &options, trial, solution))
            .collect();
        Self {
            derived: derived::derived(&fit, &options),
            excitation: Excitation::of(&driven(&trials.fit)),
            describing: frequency::describing(&fit, &trials.fit, &options),
            fit,
            options,
            trials,
            flown,
        }
    }

    /// The outcome of each trial: those of the fit, then those for validation.
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

/// Simulates a trial with the pilot alone.
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
        // The first position is a measurement like the others, so the estimated one is used.
        Some(run) if options.objective == Objective::Response => {
            let states = at_rest(&joint, run.position[0]);
            simulate_from(&joint, &fit.theta, trial, &states)
        }
        _ => simulate(&joint, &fit.theta, trial),
    };
    run.ok()
}
