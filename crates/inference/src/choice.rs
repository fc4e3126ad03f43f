//! Choice between several models of the same data: the smallest one that no other predicts better than.
//!
//! Information criteria assume white residuals and choose too large a model if they are coloured. Predictions of a run
//! that the model was not fitted to do not need this assumption, since runs share no noise. A larger model is therefore
//! chosen if it predicts held-out runs better, by Student's test on the differences between runs.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Probability of choosing a larger model that is no better.
pub const SIZE: f64 = 0.05;

/// Minimum number of runs for a test.
pub const FEWEST_RUNS: usize = 3;

/// Fit statistics of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Contender {
    /// Number of unknowns.
    pub unknowns: usize,
    /// Number of measured values.
    pub samples: usize,
    /// −2 log likelihood of the fit.
    pub surprise: f64,
    /// −2 log likelihood of each run by a fit to the other runs; NaN if there is none.
    pub held_out: Vec<f64>,
}

impl Contender {
    /// Akaike's criterion with the correction for few samples (Hurvich & Tsai, Biometrika 76, 1989); infinite if there
    /// are no more samples than unknowns.
    pub fn aicc(&self) -> f64 {
        let (n, k) = (self.samples as f64, self.unknowns as f64);
        match n > k + 1.0 {
            true => self.surprise + 2.0 * k * n / (n - k - 1.0),
            false => f64::INFINITY,
        }
    }

    /// Number of held-out runs without a prediction, and −2 log likelihood of the others.
    fn prediction(&self) -> (usize, f64) {
        let there = self.held_out.iter().filter(|run| run.is_finite());
        (self.held_out.len() - there.clone().count(), there.sum())
    }

    /// Schwarz's criterion (Ann. Stat. 6, 1978).
    pub fn bic(&self) -> f64 {
        self.surprise + self.unknowns as f64 * (self.samples as f64).ln()
    }
}

/// Comparison of a larger model with the one chosen before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Index of the model chosen before.
    pub before: usize,
    /// Index of the larger model, or of the later one of the same size.
    pub after: usize,
    /// Mean decrease of −2 log likelihood of a held-out run by the larger model; NaN if the larger model predicts too
    /// few runs.
    pub gain: f64,
    /// Probability of such a gain or a larger one if both models predict equally well.
    pub p: f64,
    /// Whether the larger model is chosen.
    pub is_taken: bool,
}

/// Chooses a model and returns its index and the comparisons; `None` if no model predicts enough runs.
///
/// Starting from the smallest model that predicts enough runs, each larger one is compared with the last one chosen. Of
/// models of the same size the one that predicts the runs best comes first: there is no reason to prefer another.
/// With m models the significance level of a comparison is [`SIZE`]`/(m - 1)` (Bonferroni), so that too large a model
/// is chosen with a probability of at most `SIZE`.
pub fn choose(all: &[Contender]) -> Option<(usize, Vec<Comparison>)> {
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|a, b| {
        let [a, b] = [a, b].map(|k| &all[*k]);
        let [(missing, sum), (others, other)] = [a, b].map(Contender::prediction);
        (a.unknowns.cmp(&b.unknowns))
            .then(missing.cmp(&others))
            .then(sum.total_cmp(&other))
    });
    let predicts = |k: &usize| {
        let runs = all[*k].held_out.iter();
        runs.filter(|run| run.is_finite()).count() >= FEWEST_RUNS
    };
    let first = order.iter().position(predicts)?;
    let (mut taken, larger) = (order[first], &order[first + 1..]);
    let mut comparisons = Vec::new();
    for after in larger {
        let both = || all[taken].held_out.iter().zip(&all[*after].held_out);
        let gains = both().map(|(before, after)| before - after);
        let gains: Vec<f64> = gains.filter(|gain| gain.is_finite()).collect();
        let has_enough_runs = gains.len() >= FEWEST_RUNS;
        let (gain, mut p) = match has_enough_runs {
            true => one_sided(&gains),
            false => (f64::NAN, 1.0),
        };
        if both().any(|(before, after)| before.is_finite() && !after.is_finite()) {
            // The larger model fails at a run that the smaller one predicts.
            p = 1.0;
        }
        let is_taken = p < SIZE / larger.len() as f64;
        comparisons.push(Comparison {
            before: taken,
            after: *after,
            gain,
            p,
            is_taken,
        });
        if is_taken {
            taken = *after;
        }
    }
    Some((taken, comparisons))
}

/// Mean of the values, and the probability of one as large or larger if the true mean is 0 (Student's test).
fn one_sided(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let t = mean / (variance / n).sqrt();
    match StudentsT::new(0.0, 1.0, n - 1.0) {
        Ok(law) if t.is_finite() => (mean, law.sf(t)),
        // All values are equal: the mean is 0, or positive with certainty.
        _ if mean > 0.0 => (mean, 0.0),
        _ => (mean, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn contender(unknowns: usize, held_out: Vec<f64>) -> Contender {
        Contender {
            unknowns,
            samples: 100,
            surprise: 50.0,
            held_out,
        }
    }

    #[test]
    fn criteria_are_their_formulas() {
        let own = contender(3, Vec::new());
        assert!((own.aicc() - (50.0 + 6.0 + 24.0 / 96.0)).abs() < 1e-12);
        assert!((own.bic() - (50.0 + 3.0 * 100_f64.ln())).abs() < 1e-12);
        let crowded = Contender { samples: 4, ..own };
        assert_eq!(crowded.aicc(), f64::INFINITY);
    }

    /// Differences 1, 2, 3: t = 2 √3 with two degrees of freedom, whose law is 1/2 - t/(2 √(2 + t²)).
    #[test]
    fn a_larger_model_is_taken_by_students_test() {
        let all = [
            contender(2, vec![4.0, 5.0, 7.0]),
            contender(1, vec![5.0, 7.0, 10.0]),
        ];
        let (taken, comparisons) = choose(&all).expect("three runs");
        let t = 2.0 * 3_f64.sqrt();
        let p = 0.5 - 0.5 * t / (2.0 + t * t).sqrt();
        assert_eq!((comparisons[0].before, comparisons[0].after), (1, 0));
        assert!((comparisons[0].p - p).abs() < 1e-12);
        assert_eq!(taken, 0, "{p}");
        assert_eq!(
            choose(&[contender(1, vec![1.0; 2]), contender(2, vec![0.0; 2])]),
            None
        );
    }

    /// Of models of one size, the order in which they are given does not matter.
    #[test]
    fn of_equal_models_the_best_is_taken() {
        let good = contender(3, vec![1.0, 2.0, 3.0]);
        let bad = contender(3, vec![9.0, 2.0, 3.1]);
        let missing = contender(3, vec![f64::NAN, 1.0, 1.0]);
        for (all, best) in [
            ([&good, &bad, &missing], 0),
            ([&missing, &good, &bad], 1),
            ([&bad, &missing, &good], 2),
        ] {
            let all = all.map(Contender::clone);
            assert_eq!(choose(&all).expect("three runs").0, best);
        }
    }

    /// If no model is better, the smallest one is chosen in at least 95 of 100 cases.
    #[test]
    fn no_larger_model_is_taken_for_nothing() {
        let mut generator = ChaCha8Rng::seed_from_u64(7);
        let mut draw = || {
            let values = (0..6).map(|_| StandardNormal.sample(&mut generator));
            values.collect::<Vec<f64>>()
        };
        let sets = 2_000;
        let wrong = (0..sets).filter(|_| {
            let all: Vec<Contender> = (1..=4).map(|k| contender(k, draw())).collect();
            choose(&all).expect("six runs").0 != 0
        });
        let share = wrong.count() as f64 / f64::from(sets);
        assert!(share < SIZE + 0.01, "{share}");
    }
}
