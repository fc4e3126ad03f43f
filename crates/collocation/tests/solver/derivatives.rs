//! Every derivative of random problems against central differences.

use crate::differences::check_problem;
use crate::random_collocation::{iterate, problem};
use proptest::prelude::*;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 48,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn derivatives_of_random_collocation_problems_are_exact(seed: u64) {
        let problem = problem(seed);
        check_problem(&problem, &iterate(&problem, seed));
    }
}
