//! The nonlinear program of flights: pilot, vehicle, stability of both. Here, where it is optimised, what it is compared
//! with takes a tenth of the time.

mod derivatives;
#[path = "../../../collocation/tests/solver/differences.rs"]
mod differences;
mod flown;
mod stability;
mod steps;

use pilotage_collocation::Collocation;
use pilotage_estimation::Posed;
use pilotage_estimation::file::Limits;
use pilotage_estimation::search::begin::begin;
use pilotage_estimation::starts::starts;
use pilotage_flights::{FlightOptions, Trial, TrialSet, open};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};

/// Uniform numbers in `[-1, 1]` from a seed.
struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn vector(&mut self, n: usize) -> Vec<f64> {
        let unit = Uniform::new_inclusive(-1.0, 1.0).expect("not empty");
        unit.sample_iter(&mut self.0).take(n).collect()
    }
}

/// A short flight.
fn short() -> [Trial; 1] {
    [Trial {
        name: "short".into(),
        origin: String::new(),
        sha256: String::new(),
        time_unit: "s".into(),
        note: None,
        position: vec![0.0, 0.1, f64::NAN, 0.4, 0.7],
        target: vec![10.0; 5],
        stick: Some(vec![0.0, -0.2, -0.3, -0.1, 0.2]),
        weight: 0.7,
        time: (0..5).map(|k| 0.1 * f64::from(k)).collect(),
    }]
}

/// What these flights pose.
fn posed<T>(trials: &[Trial], options: &FlightOptions, see: impl FnOnce(&Posed<'_>) -> T) -> T {
    let set = TrialSet {
        fit: trials.to_vec(),
        ..TrialSet::default()
    };
    let mut file = options.problem(&set).unwrap();
    // As in the paper.
    file.options.limits = Limits::Constrain;
    see(&Posed::new(&file, &open).unwrap())
}

/// Their program, and its variables with the θ of the options.
fn program(trials: &[Trial], options: &FlightOptions) -> (Collocation, Vec<f64>) {
    posed(trials, options, |posed| {
        begin(posed, &starts(posed, 1)[0], &|| false)
    })
}
