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
use crate::residuals::autocorrelation;
use crate::supremum::{Block, OPEN, largest_draws, probability};
use nalgebra::{DMatrix, RowDVector};
use pilotage_linear::svd::svd;

/// Residuals for each unknown from which on changes are looked for.
const ROWS: usize = 10;
/// Part of a run at either end within which no change is looked for.
const MARGIN: f64 = 0.15;
/// Most and fewest times that are tried, and the multiplications that they may take.
const TIMES: [usize; 2] = [8, 29];
const WORK: f64 = 2.5e8;
/// Most legs of a run beside which the noise is estimated, and rows of a leg for each parameter.
const LEGS: usize = 3;
const LEG: usize = 15;
/// Independent values for each direction from which on there is a test.
const VALUES: usize = 5;
/// Parts of a run whose scores are compared.
const PARTS: usize = 10;

/// Level at which a change is significant.
pub const LEVEL: f64 = 0.01;
/// What a time of its own explains more by chance, in a run whose parameters change.
const MORE: f64 = 10.0;

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
    /// Where runs change at times of their own: each of those in which that is significant by itself, with its course.
    pub each: Vec<(usize, Course)>,
    /// `SᵀG⁻¹S`: about the number of parameters if they are constant.
    pub statistic: f64,
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
    /// Number of independent values that its residuals count as.
    values: f64,
}

impl Scores {
    /// What two runs say together.
    fn with(mut self, other: &Self) -> Self {
        self.scores += &other.scores;
        self.covariance += &other.covariance;
        self.information += &other.information;
        self.moved += &other.moved;
        self.values += other.values;
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
        let looks = 2.0 * count as f64;
        let alone = alone.filter_map(|(run, own)| test.change(run, own));
        // Half of the false alarms for changes of all runs, half for those of any one.
        let alone: Vec<Change> = alone.map(|own| own.among(looks)).collect();
        let all = test.change(None, &all);
        let all = all.map(|own| own.among(if count > 1 { 2.0 } else { 1.0 }));
        let largest = alone
            .iter()
            .max_by(|a, b| a.statistic.total_cmp(&b.statistic));
        match (all, largest.cloned()) {
            // One run explains more where the others are constant.
            (Some(all), Some(one)) if one.statistic > all.statistic || all.p > one.p.max(LEVEL) => {
                Some(one.with(&alone, 0.0))
            }
            (Some(all), _) => Some(all.with(&alone, MORE * count as f64)),
            (None, one) => one,
        }
    }
}

impl Change {
    /// Among so many looks.
    fn among(self, looks: f64) -> Self {
        Self {
            p: (looks * self.p).min(1.0),
            ..self
        }
    }

    /// With the changes of single runs, if they explain so much more together.
    fn with(self, alone: &[Self], more: f64) -> Self {
        let significant = alone.iter().filter(|own| own.p < LEVEL);
        let each = significant.filter_map(|own| Some((own.run?, own.course)));
        let each: Vec<(usize, Course)> = each.collect();
        let total: f64 = alone.iter().map(|own| own.statistic).sum();
        let is_apart = each.len() > 1 && total > self.statistic + more;
        Self {
            each: if is_apart { each } else { Vec::new() },
            ..self
        }
    }
}

/// A problem with the noise of its residuals, and the courses that are tried.
struct Test<'i> {
    of: &'i Inference<'i>,
    processes: Vec<Autoregression>,
    courses: Vec<Course>,
    /// The variance of scores over that of the model.
    excess: f64,
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
        let legs: Vec<DMatrix<f64>> = (0..of.data.runs.len()).map(|j| legs(of, j)).collect();
        let none: Vec<_> = legs
            .iter()
            .map(|own| DMatrix::zeros(own.nrows(), 0))
            .collect();
        let effects = some(of).into_iter().map(|j| (j, [&legs[j], &none[j]]));
        let effects: Vec<_> = effects.collect();
        let mut test = Self {
            of,
            processes: of.coloured_beside(&effects),
            courses: steps.chain([Course::Drift]).collect(),
            excess: 1.0,
        };
        test.excess = test.excess();
        Some(test)
    }

    /// By how much the variance of scores exceeds that of the model of the noise, where a human's noise grows with what is done and
    /// so with the sensitivities: that of the differences of successive parts of each run, from which a change vanishes but once.
    fn excess(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (j, run) in self.of.data.runs.iter().enumerate() {
            let own = &self.of.all.runs[j];
            let [first, length] = span(run);
            let part = |t: usize| (PARTS as f64 * (run.time[t] - first) / length) as usize;
            for k in 1..PARTS {
                let sign = |t: usize| f64::from(part(t) == k) - f64::from(part(t) + 1 == k);
                let rows = self.seen(j, |t| sign(t) * own.projected.row(t));
                let score = rows.tr_mul(&run.residuals);
                let coloured = self.of.coloured_rows(j, &rows, &self.processes);
                for (score, column) in score.iter().zip(coloured.column_iter()) {
                    let variance = column.norm_squared();
                    if variance > 0.0 {
                        sum += score * score / variance;
                        count += 1.0;
                    }
                }
            }
        }
        if count > 0.0 {
            (sum / count).max(1.0)
        } else {
            1.0
        }
    }

    /// Rows of a run; 0 for the terms of noise levels and for priors.
    fn seen(&self, j: usize, row: impl Fn(usize) -> RowDVector<f64>) -> DMatrix<f64> {
        let (run, own) = (&self.of.data.runs[j], &self.of.all.runs[j]);
        let mut rows = DMatrix::zeros(own.shared.nrows(), own.shared.ncols());
        let signals = run.signals.iter().enumerate();
        let signals = signals.filter(|(k, _)| !self.of.data.levels.contains(k));
        for t in signals.flat_map(|(_, own)| own.clone()) {
            rows.set_row(t, &row(t));
        }
        rows
    }

    /// The change that explains most of these scores.
    fn change(&self, run: Option<usize>, own: &Scores) -> Option<Change> {
        let d = self.of.hessian.nrows();
        let block = |k: usize| Block::new(&own.covariance.view((k * d, k * d), (d, d)).into());
        let blocks: Vec<Block> = (0..self.courses.len()).map(block).collect();
        let rank = blocks.iter().map(|own| own.root.nrows()).max();
        let rank = rank.filter(|rank| *rank > 0 && own.is_finite())?;
        let left = own.values - rank as f64;
        if left < (VALUES * rank) as f64 {
            return None;
        }
        let statistics = blocks.iter().zip(own.scores.column_iter());
        let statistics =
            statistics.map(|(block, score)| block.statistic(&score.into_owned()) / self.excess);
        let (best, most) = (statistics.enumerate()).max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (parameter, values) = self.largest(own, best)?;
        Some(Change {
            run,
            course: self.courses[best],
            each: Vec::new(),
            statistic: most,
            parameter,
            values,
            p: probability(
                most,
                (rank, left),
                &largest_draws(&own.covariance, &blocks, d)?,
            ),
        })
    }

    /// `D` of a course in a run: the effect of the change on its residuals.
    fn effect(&self, j: usize, course: Course) -> DMatrix<f64> {
        let (run, own) = (&self.of.data.runs[j], &self.of.all.runs[j]);
        let [first, length] = span(run);
        self.seen(j, |t| {
            course.at(run.time[t] - first, length) * own.shared.row(t)
        })
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
            let inside = constant * (constant.transpose() * &rows);
            rows -= inside;
        }
        let coloured = self.of.coloured_rows(j, &rows, &self.processes);
        let scores = rows.tr_mul(&run.residuals);
        let square = |k: usize| {
            let rows = rows.columns(k * d, d);
            rows.tr_mul(&rows)
        };
        Scores {
            scores: DMatrix::from_column_slice(d, self.courses.len(), scores.as_slice()),
            covariance: coloured.transpose() * &coloured,
            squares: (0..self.courses.len()).map(square).collect(),
            information: own.information(),
            moved,
            values: independent(self.of, j, &legs(self.of, j)),
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

/// Runs that together tell the noise: all, or some over all of them if these have many residuals.
fn some(of: &Inference<'_>) -> Vec<usize> {
    const ENOUGH: usize = 8000;
    let count = of.data.runs.len();
    let rows = of.data.residuals();
    let taken = (ENOUGH * count / rows.max(1)).clamp(count.min(3), count);
    (0..taken).map(|k| k * count / taken).collect()
}

/// Orthonormal columns of what a run's own unknowns can follow, and parameters of its own in each of some legs. Beside them the noise
/// is estimated: beside constant parameters alone a large change would pass for noise, and hide itself.
fn legs(of: &Inference<'_>, j: usize) -> DMatrix<f64> {
    let (run, own) = (&of.data.runs[j], &of.all.runs[j]);
    let [first, length] = span(run);
    let (n, d) = own.shared.shape();
    let count = (n / (LEG * d.max(1))).clamp(1, LEGS);
    let leg = |t: usize| {
        let part = count as f64 * (run.time[t] - first) / length;
        (part as usize).min(count - 1)
    };
    let width = own.basis.ncols();
    let all = DMatrix::from_fn(n, width + count * d, |t, k| match k.checked_sub(width) {
        None => own.basis[(t, k)],
        Some(k) if leg(t) == k / d => own.shared[(t, k % d)],
        Some(_) => 0.0,
    });
    basis(&all)
}

/// Number of independent values of the same variance as a run's residuals: `n/(1 + 2 Σ r²)` with their autocorrelations r (Bartlett,
/// *On the theoretical specification and sampling properties of autocorrelated time-series*, J. R. Stat. Soc. Suppl. 8, 1946).
fn independent(of: &Inference<'_>, j: usize, legs: &DMatrix<f64>) -> f64 {
    let run = &of.data.runs[j];
    let residuals = &run.residuals - legs * legs.tr_mul(&run.residuals);
    let signals = run.signals.iter().enumerate();
    let own = signals.filter(|(k, _)| !of.data.levels.contains(k));
    let count = own.map(|(_, rows)| {
        let values = residuals.rows_range(rows.clone());
        let r = autocorrelation(values.as_slice(), rows.len() / 4);
        let squares = r.iter().skip(1).map(|r| r * r).sum::<f64>();
        rows.len() as f64 / (1.0 + 2.0 * squares)
    });
    count.sum()
}
