//! Whether the parameters are constant along the runs: a test against a change at an unknown time.
//!
//! Where a parameter changes by δ at a time τ, the predictions change by about `Jδ` from there on. With what constant parameters
//! and the runs' own unknowns can follow projected out, these are the columns of a regressor `R(τ)`, and `S(τ) = R(τ)ᵀ e` is the
//! score of the change. Its covariance is `G = RᵀΣR` with the noise Σ of [`Method::Ar`](crate::Method::Ar), so that coloured
//! residuals do not look like changes. The statistic is the largest `SᵀG⁻¹S` over τ (sup-LM: Andrews, *Tests for parameter
//! instability and structural change with unknown change point*, Econometrica 61, 1993) and a drift along the whole run. Its
//! distribution is that of draws from N(0, G) over all τ together, which no table has: it depends on where the runs inform.

use crate::autoregression::Autoregression;
use crate::data::Run;
use crate::inference::Inference;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pilotage_linear::svd::svd;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::ops::Range;

/// Part of a run at either end within which no change is looked for.
const MARGIN: f64 = 0.15;
/// Most and fewest times that are tried, and the multiplications that they may take.
const TIMES: [usize; 2] = [8, 29];
const WORK: f64 = 1e9;
/// Number of draws of the largest statistic.
const DRAWS: usize = 400;
/// Quantile of the draws from which the tail follows.
const TAIL: f64 = 0.9;
/// Eigenvalues of a normalised covariance below this are directions without a score.
const OPEN: f64 = 1e-6;
/// Parts of a run over which the size of its residuals is smoothed.
const PARTS: usize = 10;

/// How a parameter changes along a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Course {
    /// At this time after its beginning \[s\].
    Step(f64),
    /// Evenly from the beginning to the end.
    Drift,
}

impl Course {
    /// The part of the change that has been made, at a time since the beginning of a run that takes so long.
    fn at(self, time: f64, length: f64) -> f64 {
        match self {
            Self::Step(own) => f64::from(time > own),
            Self::Drift => time / length,
        }
    }
}

/// A change of parameters along the runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// The run that differs from the others; none if all change at the same time after their beginning.
    pub run: Option<usize>,
    /// How it changes.
    pub course: Course,
    /// The parameter that explains most of it.
    pub parameter: usize,
    /// Its value before and afterwards, minus the estimate: of one Gauss–Newton step.
    pub values: [f64; 2],
    /// Probability of such a change or a larger one, at any time and in any run, if all parameters are constant.
    pub p: f64,
}

/// Scores of several courses of the runs that may change.
struct Scores {
    courses: Vec<Course>,
    /// `S`, one column for each course.
    scores: DMatrix<f64>,
    /// `G` of all courses together.
    covariance: DMatrix<f64>,
    /// `RᵀR` of each course, and how much the constant part of the parameters follows its change, `H⁻¹JᵀD`.
    squares: Vec<DMatrix<f64>>,
    follows: Vec<DMatrix<f64>>,
}

impl Inference<'_> {
    /// The most significant change: of all runs at the same time, or of one. None if there are too few residuals to tell.
    pub fn change(&self) -> Option<Change> {
        let test = Test::of(self)?;
        let count = self.data.runs.len();
        let alone = (0..count).filter(|_| count > 1).map(Some);
        let tests = [None].into_iter().chain(alone);
        let found = tests.filter_map(|run| test.change(run));
        let best = found.min_by(|a, b| a.p.total_cmp(&b.p))?;
        // Half of the false alarms for changes of all runs, half for those of any one.
        let looks = match (count, best.run) {
            (1, _) => 1.0,
            (_, None) => 2.0,
            (_, Some(_)) => 2.0 * count as f64,
        };
        Some(Change {
            p: (looks * best.p).min(1.0),
            ..best
        })
    }
}

/// A problem with the noise of its residuals.
struct Test<'i> {
    of: &'i Inference<'i>,
    processes: Vec<Autoregression>,
    /// For each run, the size of its noise at each row relative to that of all.
    sizes: Vec<DVector<f64>>,
    /// For each run, `Jᵀe` and `JᵀΣJ`.
    parts: Vec<(DVector<f64>, DMatrix<f64>)>,
}

impl<'i> Test<'i> {
    fn of(of: &'i Inference<'i>) -> Option<Self> {
        let rows = of.data.residuals();
        if of.hessian.is_empty() || rows < 10 * of.determined {
            return None;
        }
        let mut own = Self {
            of,
            processes: of.coloured(),
            sizes: (0..of.data.runs.len()).map(|j| sizes(of, j)).collect(),
            parts: Vec::new(),
        };
        own.parts = (0..of.data.runs.len())
            .map(|j| {
                let projected = &of.all.runs[j].projected;
                let coloured = own.coloured(j, projected);
                let score = projected.tr_mul(&of.data.runs[j].residuals);
                (score, coloured.tr_mul(&coloured))
            })
            .collect();
        Some(own)
    }

    /// `C` with `CᵀC = RᵀΣR`, for rows of a run.
    fn coloured(&self, run: usize, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let sized = DMatrix::from_fn(rows.nrows(), rows.ncols(), |t, k| {
            self.sizes[run][t] * rows[(t, k)]
        });
        self.of.coloured_rows(run, &sized, &self.processes)
    }

    /// The change that explains most, in all runs or in this one.
    fn change(&self, run: Option<usize>) -> Option<Change> {
        let runs = match run {
            Some(j) => j..j + 1,
            None => 0..self.of.data.runs.len(),
        };
        let scores = self.scores(runs)?;
        let d = self.of.hessian.nrows();
        let blocks: Vec<Block> = (0..scores.courses.len())
            .map(|k| Block::new(scores.covariance.view((k * d, k * d), (d, d)).into_owned()))
            .collect();
        let rank = blocks
            .iter()
            .map(|own| own.rank)
            .max()
            .filter(|rank| *rank > 0)?;
        let statistics = blocks.iter().zip(scores.scores.column_iter());
        let statistics = statistics.map(|(own, score)| own.statistic(&score.into_owned()));
        let (best, most) = statistics.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (parameter, values) = self.largest(&scores, best)?;
        Some(Change {
            run,
            course: scores.courses[best],
            parameter,
            values,
            p: probability(most, rank, &largest_draws(&scores.covariance, &blocks, d)),
        })
    }

    /// The courses that are tried in these runs.
    fn courses(&self, runs: Range<usize>) -> Vec<Course> {
        let all = &self.of.data.runs[runs];
        let rows: usize = all.iter().map(|run| run.residuals.len()).sum();
        let most = (WORK / rows.max(1) as f64).sqrt() / self.of.hessian.nrows() as f64;
        let count = (most as usize).clamp(TIMES[0], TIMES[1]);
        let length = all.iter().map(|run| span(run)[1]).fold(0.0, f64::max);
        let time = |k: usize| MARGIN + (1.0 - 2.0 * MARGIN) * k as f64 / (count - 1) as f64;
        let steps = (0..count).map(|k| Course::Step(length * time(k)));
        steps.chain([Course::Drift]).collect()
    }

    /// `D` of a course in a run: the effect of the change on its residuals, without what its own unknowns follow.
    fn effect(&self, j: usize, course: Course) -> DMatrix<f64> {
        let (run, own) = (&self.of.data.runs[j], &self.of.all.runs[j]);
        let [first, length] = span(run);
        let mut effect = DMatrix::zeros(own.shared.nrows(), own.shared.ncols());
        let signals = run.signals.iter().enumerate();
        for (_, rows) in signals.filter(|(k, _)| !self.of.data.levels.contains(k)) {
            for t in rows.clone() {
                effect.set_row(
                    t,
                    &(course.at(run.time[t] - first, length) * own.shared.row(t)),
                );
            }
        }
        let inside = &own.basis * own.basis.tr_mul(&effect);
        effect - inside
    }

    fn scores(&self, runs: Range<usize>) -> Option<Scores> {
        let courses = self.courses(runs.clone());
        let (of, d) = (self.of, self.of.hessian.nrows());
        let width = d * courses.len();
        let effects = |j: usize| {
            let mut all = DMatrix::zeros(of.data.runs[j].residuals.len(), width);
            for (k, course) in courses.iter().enumerate() {
                all.columns_mut(k * d, d)
                    .copy_from(&self.effect(j, *course));
            }
            all
        };
        let mut moved = DMatrix::zeros(d, width);
        for j in runs.clone() {
            moved += of.all.runs[j].projected.tr_mul(&effects(j));
        }
        let follows = &of.inverse * moved;
        // The other runs see only what the constant part follows.
        let zero = (DVector::zeros(d), DMatrix::zeros(d, d));
        let others = self
            .parts
            .iter()
            .enumerate()
            .filter(|(j, _)| !runs.contains(j));
        let (score, meat) = others.fold(zero, |sum, (_, own)| (sum.0 + &own.0, sum.1 + &own.1));
        let mut scores = -follows.tr_mul(&score);
        let mut covariance = follows.tr_mul(&(meat * &follows));
        let mut squares = vec![DMatrix::zeros(d, d); courses.len()];
        for j in runs {
            let rows = effects(j) - &of.all.runs[j].projected * &follows;
            scores += rows.tr_mul(&of.data.runs[j].residuals);
            let coloured = self.coloured(j, &rows);
            covariance += coloured.tr_mul(&coloured);
            for (k, own) in squares.iter_mut().enumerate() {
                let rows = rows.columns(k * d, d);
                *own += rows.tr_mul(&rows);
            }
        }
        let is_known = covariance
            .iter()
            .chain(scores.iter())
            .all(|own| own.is_finite());
        is_known.then(|| Scores {
            scores: DMatrix::from_column_slice(d, courses.len(), scores.as_slice()),
            squares,
            follows: (0..courses.len())
                .map(|k| follows.columns(k * d, d).into_owned())
                .collect(),
            courses,
            covariance,
        })
    }

    /// The parameter whose change alone explains most of a course, and its values before and afterwards, minus the estimate.
    fn largest(&self, scores: &Scores, k: usize) -> Option<(usize, [f64; 2])> {
        let free = &self.of.all.free;
        let d = free.ncols();
        let inverse = svd(free).map(|own| own.pseudo_inverse(OPEN * own.singular[0]))?;
        let covariance = scores.covariance.view((k * d, k * d), (d, d)).into_owned();
        let score = scores.scores.column(k).into_owned();
        let of = |i: usize| {
            let along = inverse.column(i).into_owned();
            let own = along.dot(&score);
            let explains = own * own / along.dot(&(&covariance * &along));
            let change = own / along.dot(&(&scores.squares[k] * &along));
            let before = -(free * (&scores.follows[k] * &along))[i] * change;
            (i, explains, [before, before + change])
        };
        let all = (0..free.nrows()).filter(|i| !self.of.flat[*i]).map(of);
        let known = all.filter(|own| own.1.is_finite());
        let best = known.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((best.0, best.2))
    }
}

/// Time of the first residual of a run, and from there to the last \[s\].
fn span(run: &Run) -> [f64; 2] {
    let times = || {
        run.signals
            .iter()
            .flat_map(|rows| &run.time[rows.clone()])
            .copied()
    };
    let [first, last] = [
        times().fold(f64::INFINITY, f64::min),
        times().fold(f64::NEG_INFINITY, f64::max),
    ];
    [first, (last - first).max(f64::MIN_POSITIVE)]
}

/// The size of a run's residuals around each row, relative to that of all runs: the noise of a human grows with the activity.
fn sizes(of: &Inference<'_>, j: usize) -> DVector<f64> {
    let run = &of.data.runs[j];
    let mut sizes = DVector::from_element(run.residuals.len(), 1.0);
    for (k, rows) in run.signals.iter().enumerate() {
        let all = of.data.runs.iter().map(|run| {
            let own = run.signals[k].clone();
            (own.len(), run.residuals.rows_range(own).norm_squared())
        });
        let (count, squares) = all.fold((0, 0.0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
        let mean = squares / count.max(1) as f64;
        let half = rows.len() / PARTS;
        if mean <= 0.0 || half == 0 {
            continue;
        }
        for t in rows.clone() {
            let near = t.saturating_sub(half).max(rows.start)..(t + half + 1).min(rows.end);
            let own = run.residuals.rows_range(near.clone()).norm_squared() / near.len() as f64;
            sizes[t] = (own / mean).sqrt();
        }
    }
    sizes
}

/// The inverse square root of a covariance in the directions that have a score.
struct Block {
    root: DMatrix<f64>,
    rank: usize,
}

impl Block {
    fn new(covariance: DMatrix<f64>) -> Self {
        let root = |own: f64| if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 };
        let scale = covariance.diagonal().map(root);
        let unit = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
            scale[i] * covariance[(i, j)] * scale[j]
        });
        let eigen = SymmetricEigen::new(unit);
        let known = (0..scale.len()).filter(|k| eigen.eigenvalues[*k] > OPEN);
        let rows: Vec<_> = known
            .map(|k| {
                let own = eigen.eigenvectors.column(k).component_mul(&scale);
                (own / eigen.eigenvalues[k].sqrt()).transpose()
            })
            .collect();
        Self {
            rank: rows.len(),
            root: match rows.is_empty() {
                true => DMatrix::zeros(0, scale.len()),
                false => DMatrix::from_rows(&rows),
            },
        }
    }

    fn statistic(&self, score: &DVector<f64>) -> f64 {
        (&self.root * score).norm_squared()
    }
}

/// The largest statistic of each draw, in increasing order.
fn largest_draws(covariance: &DMatrix<f64>, blocks: &[Block], d: usize) -> Vec<f64> {
    let eigen = SymmetricEigen::new(covariance.clone());
    let roots = eigen.eigenvalues.map(|own| own.max(0.0).sqrt());
    let root = &eigen.eigenvectors * DMatrix::from_diagonal(&roots);
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
    let draws = DMatrix::from_fn(covariance.nrows(), DRAWS, |_, _| gauss());
    let drawn = root * draws;
    let largest = drawn.column_iter().map(|draw| {
        let own = |(k, block): (usize, &Block)| block.statistic(&draw.rows(k * d, d).into_owned());
        blocks.iter().enumerate().map(own).fold(0.0, f64::max)
    });
    let mut all: Vec<f64> = largest.collect();
    all.sort_by(f64::total_cmp);
    all
}

/// Probability of a largest statistic beyond this one: beyond the draws it falls like that of as many independent χ² as give their
/// quantile.
fn probability(statistic: f64, rank: usize, draws: &[f64]) -> f64 {
    let at = draws[(TAIL * draws.len() as f64) as usize];
    if statistic <= at {
        let below = draws.partition_point(|own| *own < statistic);
        return 1.0 - below as f64 / draws.len() as f64;
    }
    let Ok(law) = ChiSquared::new(rank as f64) else {
        return f64::NAN;
    };
    let looks = TAIL.ln() / (-law.sf(at)).ln_1p();
    -(looks * (-law.sf(statistic)).ln_1p()).exp_m1()
}
