//! The distribution of the largest of several correlated quadratic forms.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Number of draws of the largest statistic.
const DRAWS: usize = 400;
/// Quantile of the draws from which the tail follows.
const TAIL: f64 = 0.9;
/// Eigenvalues of a normalised covariance below this are directions without a score.
pub const OPEN: f64 = 1e-6;

/// Scales with which a covariance has a unit diagonal.
fn unit(covariance: &DMatrix<f64>) -> DVector<f64> {
    let root = |own: f64| if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 };
    covariance.diagonal().map(root)
}

fn scaled(covariance: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    let n = scale.len();
    DMatrix::from_fn(n, n, |i, j| scale[i] * covariance[(i, j)] * scale[j])
}

/// The inverse square root of a covariance in the directions that have a score.
pub struct Block {
    pub root: DMatrix<f64>,
}

impl Block {
    pub fn new(covariance: &DMatrix<f64>) -> Self {
        let scale = unit(covariance);
        let eigen = SymmetricEigen::new(scaled(covariance, &scale));
        let known = (0..scale.len()).filter(|k| eigen.eigenvalues[*k] > OPEN);
        let row = |k: usize| {
            let own = eigen.eigenvectors.column(k).component_mul(&scale);
            (own / eigen.eigenvalues[k].sqrt()).transpose()
        };
        let rows: Vec<_> = known.map(row).collect();
        Self {
            root: match rows.is_empty() {
                true => DMatrix::zeros(0, scale.len()),
                false => DMatrix::from_rows(&rows),
            },
        }
    }

    pub fn statistic(&self, score: &DVector<f64>) -> f64 {
        (&self.root * score).norm_squared()
    }
}

/// The largest statistic of each draw, in increasing order.
pub fn largest_draws(covariance: &DMatrix<f64>, blocks: &[Block], d: usize) -> Option<Vec<f64>> {
    let (n, scale) = (covariance.nrows(), unit(covariance));
    // Times close to each other have nearly the same score.
    let widened = scaled(covariance, &scale) + OPEN * 0.01 * DMatrix::identity(n, n);
    let mut root = widened.cholesky()?.l();
    for (mut row, scale) in root.row_iter_mut().zip(scale.iter()) {
        row *= if *scale > 0.0 { 1.0 / scale } else { 0.0 };
    }
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let drawn = root * DMatrix::from_fn(n, DRAWS, |_, _| gauss());
    let largest = drawn.column_iter().map(|draw| {
        let own = |(k, block): (usize, &Block)| block.statistic(&draw.rows(k * d, d).into());
        blocks.iter().enumerate().map(own).fold(0.0, f64::max)
    });
    let mut all: Vec<f64> = largest.collect();
    all.sort_by(f64::total_cmp);
    Some(all)
}

/// Probability of a largest statistic beyond this one: in the tail that of as many independent looks as give the draws' quantile,
/// by F since the noise is estimated from so many values.
pub fn probability(statistic: f64, (rank, left): (usize, f64), draws: &[f64]) -> f64 {
    let rank = rank as f64;
    let (Ok(known), Ok(law)) = (ChiSquared::new(rank), FisherSnedecor::new(rank, left)) else {
        return f64::NAN;
    };
    let at = draws[(TAIL * draws.len() as f64) as usize];
    let looks = TAIL.ln() / (-known.sf(at)).ln_1p();
    -(looks * (-law.sf(statistic / rank)).ln_1p()).exp_m1()
}
