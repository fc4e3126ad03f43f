//! A fit does not depend on the number of threads, to the last bit.

use crate::command::example;
use crate::fitted::{fitted, theta, with};
use pilotage::collocation::Scheme;
use pilotage::estimation::Fit;
use pilotage::estimation::file::Mesh;
use pilotage::flights::{FlightOptions, TrialSet};
use rayon::ThreadPoolBuilder;

/// Every number of a fit that is not a time, as bits.
fn bits(fit: &Fit) -> Vec<u64> {
    let runs = fit.runs.iter().flat_map(|run| {
        let states = run.states.iter().flatten();
        states.chain(run.predicted.iter().flatten()).copied()
    });
    let starts = fit
        .starts
        .iter()
        .flat_map(|own| [Some(own.objective), own.kkt]);
    (theta(fit).into_iter())
        .chain([fit.objective, fit.kkt.residual()])
        .chain(starts.flatten())
        .chain(runs)
        .map(f64::to_bits)
        .collect()
}

fn with_threads(threads: usize, options: &FlightOptions) -> Fit {
    let set = TrialSet::read(&[example("trials/trials.toml")]).unwrap();
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| fitted(&set.fit, options))
}

fn alike_for_any_number_of_threads(options: &FlightOptions) {
    let one = with_threads(1, options);
    assert!(one.is_met(), "{}", one.verdict());
    for threads in [2, 5] {
        let more = with_threads(threads, options);
        assert_eq!(one.iterations, more.iterations, "{threads} threads");
        assert!(bits(&one) == bits(&more), "{threads} threads: other bits");
    }
}

#[test]
fn the_shipped_trials_give_the_same_bits() {
    alike_for_any_number_of_threads(&FlightOptions::default());
}

#[test]
fn random_starts_give_the_same_bits() {
    alike_for_any_number_of_threads(&with(|own| own.fit.starts = Some(4)));
}

#[test]
fn a_mesh_apart_from_the_samples_gives_the_same_bits() {
    alike_for_any_number_of_threads(&with(|own| {
        own.fit.scheme = Some(Scheme::Gauss(2));
        own.fit.mesh = Mesh::Step(0.23);
    }));
}
