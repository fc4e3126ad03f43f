//! A fit does not depend on the number of threads, to the last bit.

use crate::command::example;
use pilotage::collocation::Scheme;
use pilotage::identification::{Fit, FitOptions, Mesh, TrialSet, fit};
use rayon::ThreadPoolBuilder;
use std::ops::ControlFlow;

/// Every number of a fit that is not a time, as bits.
fn bits(fit: &Fit) -> Vec<u64> {
    let runs = fit.runs.iter().flat_map(|run| {
        let states = run.states.iter().flatten();
        let signals = [&run.position, &run.stick, &run.residual];
        states.chain(signals.into_iter().flatten())
    });
    let starts = fit.starts.iter().flat_map(|s| [&s.objective, &s.kkt]);
    (fit.theta.iter())
        .chain([&fit.objective, &fit.kkt])
        .chain(starts)
        .chain(runs)
        .map(|number| number.to_bits())
        .collect()
}

fn with_threads(threads: usize, options: &FitOptions) -> Fit {
    let set = TrialSet::read(&[example("trials/trials.toml")]).unwrap();
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    let fit = pool.install(|| fit(&set.fit, options, &mut |_| ControlFlow::Continue(())));
    fit.unwrap()
}

fn alike_for_any_number_of_threads(options: &FitOptions) {
    let one = with_threads(1, options);
    assert!(one.converged, "{}", one.status);
    for threads in [2, 5] {
        let more = with_threads(threads, options);
        assert_eq!(one.iterations, more.iterations, "{threads} threads");
        assert!(bits(&one) == bits(&more), "{threads} threads: other bits");
    }
}

#[test]
fn the_shipped_trials_give_the_same_bits() {
    alike_for_any_number_of_threads(&FitOptions::default());
}

#[test]
fn random_starts_give_the_same_bits() {
    alike_for_any_number_of_threads(&FitOptions {
        random_starts: Some(3),
        ..FitOptions::default()
    });
}

#[test]
fn a_mesh_apart_from_the_samples_gives_the_same_bits() {
    alike_for_any_number_of_threads(&FitOptions {
        scheme: Scheme::Gauss(2),
        mesh: Mesh::Step(0.23),
        ..FitOptions::default()
    });
}
