//! The values of each sample, by its number alone, so that any order and any division into shards gives the same study.

use crate::SweepError;
use crate::vary::{Joint, Vary, standard_normal};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

/// How samples are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// All combinations of lists.
    Grid,
    /// Independent draws.
    Random,
    /// Each variable once in each of as many equally likely parts as there are samples.
    LatinHypercube,
    /// Points that fill the cube evenly: Sobol's sequence, scrambled by Owen's method.
    Sobol,
    /// Of `n` base samples the `n (k + 2)` from which Sobol' indices of `k` variables are estimated (Saltelli et al., 2010).
    Saltelli,
    /// The rows of a table.
    Table,
}

/// The samples of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Design {
    /// What is varied.
    pub vary: Vec<Vary>,
    /// Parameters of fits that are varied with it.
    pub joint: Vec<Joint>,
    /// How samples are chosen.
    pub method: Method,
    /// Number of samples, or of base samples.
    pub samples: usize,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Rows of a table: a value for each varied name.
    pub rows: Vec<Vec<f64>>,
}

/// Largest number of samples, and of those of a sequence whose points fill the cube evenly.
const MOST: usize = 100_000_000;
const MOST_EVEN: usize = 1 << 16;
/// Most dimensions of such a sequence.
const MOST_DIMENSIONS: usize = 128;

impl Design {
    /// Samples of variables; of a grid, all combinations of their lists.
    ///
    /// # Errors
    /// When there is nothing to vary, a name stands twice, or the method does not suit the variables.
    pub fn new(
        vary: Vec<Vary>,
        method: Method,
        samples: usize,
        seed: u32,
    ) -> Result<Self, SweepError> {
        Self {
            vary,
            joint: Vec::new(),
            method,
            samples,
            seed,
            rows: Vec::new(),
        }
        .checked()
    }

    /// The design if its parts suit each other.
    ///
    /// # Errors
    /// As [`Design::new`].
    pub fn checked(mut self) -> Result<Self, SweepError> {
        let fault = |words: String| Err(SweepError::Design(words));
        let names: Vec<&str> = self.names().collect();
        if names.is_empty() {
            return fault("nothing is varied; give --vary NAME=VALUES".to_owned());
        }
        if let Some(k) = (1..names.len()).find(|k| names[..*k].contains(&names[*k])) {
            return fault(format!("`{}` is varied twice", names[k]));
        }
        let own = self.vary.iter().find(|own| own.law.list().is_none());
        match self.method {
            Method::Grid => {
                if let Some(own) = own {
                    return fault(format!(
                        "a grid has lists of values, and `{}` has a distribution; give another --method",
                        own.name
                    ));
                }
                if !self.joint.is_empty() {
                    return fault("a grid has lists of values, and a fit has a covariance; give another --method".to_owned());
                }
                let sizes = self
                    .vary
                    .iter()
                    .map(|own| own.law.list().map_or(1, <[f64]>::len));
                let count = sizes.fold(1_usize, usize::saturating_mul);
                self.samples = count;
            }
            Method::Table => self.samples = self.rows.len(),
            Method::Sobol | Method::Saltelli if self.samples > MOST_EVEN => {
                return fault(format!("at most {MOST_EVEN} samples of a Sobol' sequence"));
            }
            Method::Sobol | Method::Saltelli if self.dimensions() > MOST_DIMENSIONS => {
                return fault(format!(
                    "at most {MOST_DIMENSIONS} variables of a Sobol' sequence"
                ));
            }
            Method::Saltelli if !self.joint.is_empty() => {
                return fault("Sobol' indices are those of independent variables, and parameters of a fit are correlated".to_owned());
            }
            _ => {}
        }
        match self.count() {
            0 => fault("there are no samples".to_owned()),
            count if count > MOST => fault(format!("{count} samples are too many; at most {MOST}")),
            _ => Ok(self),
        }
    }

    /// Names of all varied variables, in the order of [`Design::values`].
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let joint = self.joint.iter().flat_map(|own| &own.names);
        let own = self.vary.iter().map(|own| &own.name);
        own.chain(joint).map(String::as_str)
    }

    /// Number of variables.
    pub fn dimensions(&self) -> usize {
        self.vary.len() + self.joint.iter().map(|own| own.names.len()).sum::<usize>()
    }

    /// Number of runs.
    pub fn count(&self) -> usize {
        match self.method {
            Method::Saltelli => self.samples.saturating_mul(self.dimensions() + 2),
            _ => self.samples,
        }
    }

    /// The values of sample `k`.
    pub fn values(&self, k: usize) -> Vec<f64> {
        match self.method {
            Method::Grid => self.of_grid(k),
            Method::Table => self.rows[k].clone(),
            _ => {
                let parts: Vec<f64> = (0..self.dimensions()).map(|d| self.part(k, d)).collect();
                let own = self
                    .vary
                    .iter()
                    .zip(&parts)
                    .map(|(own, p)| own.law.quantile(*p));
                let mut values: Vec<f64> = own.collect();
                let mut rest = &parts[self.vary.len()..];
                for own in &self.joint {
                    let (first, others) = rest.split_at(own.names.len());
                    let normal: Vec<f64> = first.iter().map(|p| standard_normal(*p)).collect();
                    values.extend(own.values(&normal));
                    rest = others;
                }
                values
            }
        }
    }

    /// The last variable changes first.
    fn of_grid(&self, k: usize) -> Vec<f64> {
        let mut rest = k;
        let mut values: Vec<f64> = (self.vary.iter().rev())
            .filter_map(|own| {
                let list = own.law.list()?;
                let value = list[rest % list.len()];
                rest /= list.len();
                Some(value)
            })
            .collect();
        values.reverse();
        values
    }

    /// Coordinate `d` of sample `k` in the open unit cube.
    fn part(&self, k: usize, d: usize) -> f64 {
        match self.method {
            Method::LatinHypercube => {
                let place = permuted(k, self.samples, self.seed, d);
                (place as f64 + self.drawn(k, d)) / self.samples as f64
            }
            Method::Sobol => self.even(k, d),
            Method::Saltelli => {
                // A, B, then A with each column of B.
                let n = self.dimensions();
                let (base, j) = (k / (n + 2), k % (n + 2));
                let is_b = j == 1 || j == d + 2;
                self.even(base, if is_b { n + d } else { d })
            }
            _ => self.drawn(k, d),
        }
    }

    /// A draw that depends on sample, dimension and seed alone.
    fn drawn(&self, k: usize, d: usize) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(u64::from(self.seed));
        random.set_stream(k as u64);
        random.set_word_pos(2 * d as u128);
        // The middle of one of 2^53 parts, so that neither 0 nor 1 comes.
        ((random.next_u64() >> 11) as f64 + 0.5) / 9_007_199_254_740_992.0
    }

    fn even(&self, k: usize, d: usize) -> f64 {
        // The middle of the part that 24 bits tell apart.
        f64::from(sobol_burley::sample(k as u32, d as u32, self.seed)) + 0.5 / 16_777_216.0
    }
}

/// Place of `k` in a permutation of `0..count`: a cycle-walking Feistel network with random rounds, so that no list is kept.
fn permuted(k: usize, count: usize, seed: u32, d: usize) -> usize {
    const ROUNDS: u128 = 6;
    let half = (usize::BITS - (count - 1).leading_zeros())
        .div_ceil(2)
        .max(1);
    let mask = (1_u64 << half) - 1;
    let mut at = k as u64;
    loop {
        let (mut left, mut right) = (at >> half, at & mask);
        for round in 0..ROUNDS {
            let mut random = ChaCha8Rng::seed_from_u64(u64::from(seed) ^ (0x9e37_79b9 << 32));
            random.set_stream(d as u64);
            random.set_word_pos((round << 34) + 2 * u128::from(right));
            let mixed = left ^ (random.next_u64() & mask);
            (left, right) = (right, mixed);
        }
        at = (left << half) | right;
        if at < count as u64 {
            return at as usize;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn design(laws: &[&str], method: Method, samples: usize) -> Design {
        let vary = laws.iter().map(|own| Vary::parse(own).unwrap()).collect();
        Design::new(vary, method, samples, 7).unwrap()
    }

    #[test]
    fn a_grid_has_all_combinations() {
        let own = design(&["a=1:3:3", "b=10,20"], Method::Grid, 0);
        let all: Vec<Vec<f64>> = (0..own.count()).map(|k| own.values(k)).collect();
        assert_eq!(
            all[..3],
            [vec![1.0, 10.0], vec![1.0, 20.0], vec![2.0, 10.0]]
        );
        assert_eq!(all.len(), 6);
    }

    #[test]
    fn a_latin_hypercube_has_each_part_once() {
        for samples in [1, 2, 7, 100, 1000] {
            let own = design(
                &["a~uniform(0, 1)", "b~uniform(0, 1)"],
                Method::LatinHypercube,
                samples,
            );
            for d in 0..2 {
                let place = |k| (own.values(k)[d] * samples as f64) as usize;
                let mut places: Vec<usize> = (0..samples).map(place).collect();
                places.sort_unstable();
                assert!(places.into_iter().eq(0..samples), "{samples}");
            }
        }
    }

    /// Mean and variance of a product of uniforms: 1/4 and 7/144.
    #[test]
    fn even_points_integrate_better_than_random_ones() {
        let error = |method: Method| {
            let own = design(&["a~uniform(0, 1)", "b~uniform(0, 1)"], method, 1 << 12);
            let all = (0..own.count()).map(|k| own.values(k).iter().product::<f64>());
            (all.sum::<f64>() / own.count() as f64 - 0.25).abs()
        };
        assert!(error(Method::Sobol) < 1e-4, "{}", error(Method::Sobol));
        let random = error(Method::Random);
        assert!(random < 4.0 * (7.0_f64 / 144.0 / 4096.0).sqrt() && random > error(Method::Sobol));
    }

    #[test]
    fn laws_have_their_quantiles() {
        let quantile = |text: &str, p: f64| Vary::parse(text).unwrap().law.quantile(p);
        let near = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}")
        };
        // SciPy: norm.ppf(0.9, 1, 2), lognorm.ppf(0.9, 0.5, scale=3), triang.ppf(0.9, 0.25, 0, 4), loguniform.ppf(0.3, 1, 100).
        near(quantile("x~normal(1, 2)", 0.9), 3.563_103_131_1);
        near(quantile("x~lognormal(3, 0.5)", 0.9), 5.693_858_122_0);
        near(quantile("x~triangular(0, 1, 4)", 0.9), 2.904_554_884_99);
        near(quantile("x~loguniform(1, 100)", 0.3), 3.981_071_705_5);
        near(quantile("x=1,2,3", 0.5), 2.0);
    }

    #[test]
    fn what_is_no_study_is_refused() {
        let words = |given: &str| Vary::parse(given).unwrap_err().to_string();
        for (given, part) in [
            ("x", "expected NAME="),
            ("=1", "no name"),
            ("x=1,two", "`two`"),
            ("x=0:1:0", "0 values"),
            ("x~cauchy(0, 1)", "there are uniform"),
            ("x~normal(0, -1)", "above 0"),
            ("x~uniform(2, 1)", "larger"),
            ("x~uniform 2", "no distribution"),
        ] {
            assert!(words(given).contains(part), "{}", words(given));
        }
        let vary = |all: &[&str]| {
            all.iter()
                .map(|own| Vary::parse(own).unwrap())
                .collect::<Vec<_>>()
        };
        let fault = |all: &[&str], method| {
            Design::new(vary(all), method, 4, 1)
                .unwrap_err()
                .to_string()
        };
        assert!(fault(&[], Method::Grid).contains("nothing"));
        assert!(fault(&["x=1", "x=2"], Method::Grid).contains("twice"));
        assert!(fault(&["x~uniform(0, 1)"], Method::Grid).contains("--method"));
    }
}
