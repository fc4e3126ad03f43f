//! Whether the parameters are constant along the runs: a test against a change at an unknown time.
//!
//! Where a parameter changes by δ at a time τ, the predictions change by about `Jδ` from there on. With what other constant
//! parameters and unknowns of the run can follow projected out, these are the columns of a regressor `R(τ)`, and `S(τ) = R(τ)ᵀ e` is
//! the score of the change. Runs may differ from each other: each has constants of its own here. The score's covariance is
//! `G = RᵀΣR` with the noise Σ of [`Method::Ar`](crate::Method::Ar), so that coloured residuals do not look like changes. The statistic is the largest `SᵀG⁻¹S` over τ (sup-LM: Andrews, *Tests for parameter
//! instability and structural change with unknown change point*, Econometrica 61, 1993) and a drift along the whole run. Its
//! distribution is that of draws from N(0, G) over all τ together, which no table has: it depends on where the runs inform.

use crate::autoregression::Autoregression;
use crate::data::Run;
use crate::elimination::basis;
use crate::inference::Inference;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pilotage_linear::svd::svd;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Residuals for each unknown from which on changes are looked for.
const ROWS: usize = 10;
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

/// What a run says about each course.
#[derive(Clone)]
struct Scores {
    /// `S`, one column for each course.
    scores: DMatrix<f64>,
    /// `G` of all courses together.
    covariance: DMatrix<f64>,
    /// `RᵀR` of each course.
    squares: Vec<DMatrix<f64>>,
    /// `JᵀJ`, and `JᵀD` of all courses: how much constants follow a change.
    information: DMatrix<f64>,
    moved: DMatrix<f64>,
}

impl Scores {
    /// What two runs say together.
    fn with(mut self, other: &Self) -> Self {
        self.scores += &other.scores;
        self.covariance += &other.covariance;
        self.information += &other.information;
        self.moved += &other.moved;
        let pairs = self.squares.iter_mut().zip(&other.squares);
        pairs.for_each(|(own, other)| *own += other);
        self
    }

    fn is_finite(&self) -> bool {
        let all = self.covariance.iter().chain(self.scores.iter());
        all.chain(self.moved.iter()).all(|own| own.is_finite())
    }
}

impl Inference<'_> {
    /// The most significant change: of all runs at the same time, or of one. None if there are too few residuals to tell.
    pub fn change(&self) -> Option<Change> {
        let test = Test::of(self)?;
        let count = self.data.runs.len();
        let runs: Vec<Scores> = (0..count).map(|j| test.scores(j)).collect();
        let all = runs[1..].iter().fold(runs[0].clone(), Scores::with);
        let alone = runs.iter().enumerate().filter(|_| count > 1);
        let alone = alone.map(|(j, own)| (Some(j), own));
        let tests = [(None, &all)].into_iter().chain(alone);
        let found = tests.filter_map(|(run, own)| test.change(run, own));
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

/// A problem with the noise of its residuals, and the courses that are tried.
struct Test<'i> {
    of: &'i Inference<'i>,
    processes: Vec<Autoregression>,
    courses: Vec<Course>,
}

impl<'i> Test<'i> {
    fn of(of: &'i Inference<'i>) -> Option<Self> {
        let rows = of.data.residuals();
        if of.hessian.is_empty() || rows < ROWS * of.determined {
            return None;
        }
        let most = (WORK / rows as f64).sqrt() / of.hessian.nrows() as f64;
        let count = (most as usize).clamp(TIMES[0], TIMES[1]);
        let length = of.data.runs.iter().map(|run| span(run)[1]);
        let length = length.fold(0.0, f64::max);
        let time = |k: usize| MARGIN + (1.0 - 2.0 * MARGIN) * k as f64 / (count - 1) as f64;
        let steps = (0..count).map(|k| Course::Step(length * time(k)));
        Some(Self {
            of,
            processes: of.coloured(),
            courses: steps.chain([Course::Drift]).collect(),
        })
    }

    /// The change that explains most of these scores.
    fn change(&self, run: Option<usize>, own: &Scores) -> Option<Change> {
        let d = self.of.hessian.nrows();
        let block = |k: usize| Block::new(&own.covariance.view((k * d, k * d), (d, d)).into());
        let blocks: Vec<Block> = (0..self.courses.len()).map(block).collect();
        let rank = blocks.iter().map(|own| own.root.nrows()).max();
        let rank = rank.filter(|rank| *rank > 0 && own.is_finite())?;
        let statistics = blocks.iter().zip(own.scores.column_iter());
        let statistics = statistics.map(|(block, score)| block.statistic(&score.into_owned()));
        let (best, most) = (statistics.enumerate()).max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (parameter, values) = self.largest(own, best)?;
        Some(Change {
            run,
            course: self.courses[best],
            parameter,
            values,
            p: probability(most, rank, &largest_draws(&own.covariance, &blocks, d)?),
        })
    }

    /// `D` of a course in a run: the effect of the change on its residuals.
    fn effect(&self, j: usize, course: Course) -> DMatrix<f64> {
        let (run, own) = (&self.of.data.runs[j], &self.of.all.runs[j]);
        let [first, length] = span(run);
        let mut effect = DMatrix::zeros(own.shared.nrows(), own.shared.ncols());
        let signals = run.signals.iter().enumerate();
        for (_, rows) in signals.filter(|(k, _)| !self.of.data.levels.contains(k)) {
            for t in rows.clone() {
                let part = course.at(run.time[t] - first, length);
                effect.set_row(t, &(part * own.shared.row(t)));
            }
        }
        effect
    }

    fn scores(&self, j: usize) -> Scores {
        let (run, own) = (&self.of.data.runs[j], &self.of.all.runs[j]);
        let d = own.shared.ncols();
        let mut rows = DMatrix::zeros(run.residuals.len(), d * self.courses.len());
        for (k, course) in self.courses.iter().enumerate() {
            rows.columns_mut(k * d, d)
                .copy_from(&self.effect(j, *course));
        }
        let moved = own.projected.tr_mul(&rows);
        // What constants of the run and its own unknowns follow.
        for constant in [&own.basis, &basis(&own.projected)] {
            let inside = constant * constant.tr_mul(&rows);
            rows -= inside;
        }
        let sizes = sizes(self.of, j);
        let sized = DMatrix::from_fn(rows.nrows(), rows.ncols(), |t, k| sizes[t] * rows[(t, k)]);
        let coloured = self.of.coloured_rows(j, &sized, &self.processes);
        let scores = rows.tr_mul(&run.residuals);
        let square = |k: usize| {
            let rows = rows.columns(k * d, d);
            rows.tr_mul(&rows)
        };
        Scores {
            scores: DMatrix::from_column_slice(d, self.courses.len(), scores.as_slice()),
            covariance: coloured.tr_mul(&coloured),
            squares: (0..self.courses.len()).map(square).collect(),
            information: own.information(),
            moved,
        }
    }

    /// The parameter whose change alone explains most of a course, and its values before and afterwards, minus the estimate.
    fn largest(&self, own: &Scores, k: usize) -> Option<(usize, [f64; 2])> {
        let inverse = |of: &DMatrix<f64>| {
            let found = svd(of)?;
            Some(found.pseudo_inverse(OPEN * found.singular[0]))
        };
        let free = &self.of.all.free;
        let d = free.ncols();
        let (directions, constant) = (inverse(free)?, inverse(&own.information)?);
        let covariance = own.covariance.view((k * d, k * d), (d, d));
        let (score, moved) = (own.scores.column(k), own.moved.columns(k * d, d));
        let of = |i: usize| {
            let along = directions.column(i);
            let by_score = along.dot(&score);
            let explains = by_score * by_score / along.dot(&(covariance * along));
            let change = by_score / along.dot(&(&own.squares[k] * along));
            let before = -(free * (&constant * (moved * along)))[i] * change;
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
struct Block {
    root: DMatrix<f64>,
}

impl Block {
    fn new(covariance: &DMatrix<f64>) -> Self {
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

    fn statistic(&self, score: &DVector<f64>) -> f64 {
        (&self.root * score).norm_squared()
    }
}

/// The largest statistic of each draw, in increasing order.
fn largest_draws(covariance: &DMatrix<f64>, blocks: &[Block], d: usize) -> Option<Vec<f64>> {
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
