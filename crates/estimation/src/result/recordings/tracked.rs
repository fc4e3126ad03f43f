//! Whether what a person moves follows its target, as far as people do.

use super::{Column, PILOT, Recorded, width};
use crate::posed::Posed;
use crate::problem::file::Fed;
use crate::result::describing::Roles;
use crate::result::diagnostic::Diagnostic;
use pilotage_inference::outliers::resolution;
use pilotage_inference::sampling::median_step;

/// A run is driven if its target is at least this part of its largest error away from its start; outliers are excluded
/// by the quantile below.
const DRIVEN: f64 = 0.5;
const NEARLY_ALL: f64 = 0.85;
/// Longest delay \[s\] between targets and positions, and number of delays tried.
const LONGEST_DELAY: f64 = 1.5;
const DELAYS: u32 = 15;
/// Minimum correlation of positions with targets for a meaningful slope.
const FOLLOWS: f64 = 0.7;
/// Slopes of positions over targets that humans produce; initially they are small. Slopes outside indicate another
/// unit: feet give 3.28.
const SLOPES: std::ops::RangeInclusive<f64> = -0.1..=2.5;
/// Slope of positions that follow targets closely, with a larger correlation, below which the targets have another unit:
/// centimetres give 0.01.
const SMALL: f64 = 0.05;
const CLOSELY: f64 = 0.8;
/// Positions follow targets from another origin if they do so with a larger correlation and one of these slopes, and are
/// beside them by this part of the targets' range.
const FOLLOWED: f64 = 0.9;
const NEAR_ONE: std::ops::RangeInclusive<f64> = 0.5..=1.5;
const BESIDE: f64 = 0.5;
/// Maximum number of samples by which a target differs in error, ...
const FLICKER: usize = 2;
/// ... its maximum change next to them, relative to their deviation, ...
const QUIET: f64 = 0.1;
/// ... and the multiple of its resolution by which it differs at least.
const LEVELS: f64 = 2.5;

/// What is recorded of a person.
pub(super) struct Person {
    /// What is to be followed, in the unit of what follows it.
    pub target: Option<Column>,
    /// What the person moves.
    pub position: Column,
    /// Whether that drives an input of the person alone, without a loop.
    pub sees_column: bool,
    /// What the person does, if nothing is compared with it.
    pub stick: Option<Column>,
}

impl Person {
    /// None if no instance is a person, or what it moves is not recorded.
    pub fn of(posed: &Posed<'_>) -> Option<Self> {
        let file = posed.file;
        if !posed.joint.parts.iter().any(|(name, _)| name == PILOT) {
            return None;
        }
        let fed = |own: &Fed| Column::of(posed, &own.column, posed.joint.unit(&own.signal.value));
        let Some(roles) = Roles::of(posed) else {
            let input = |name: &str| {
                let mut inputs = file.inputs.iter();
                let is_it = |own: &&Fed| own.signal.value.strip_prefix(PILOT) == Some(name);
                fed(inputs.find(is_it)?)
            };
            return Some(Self {
                target: input(".target"),
                position: input(".position")?,
                sees_column: true,
                stick: None,
            });
        };
        let position = &file.measured[roles.position].column;
        let is_free = |name: &str| file.measured.iter().all(|own| own.column.value != name);
        let stick = roles.stick.filter(|own| is_free(&own.column.value));
        Some(Self {
            target: roles.target.and_then(|k| fed(&file.inputs[k])),
            position: Column::of(posed, position, posed.unit_of(roles.position))?,
            sees_column: false,
            stick: stick.and_then(|own| Column::of(posed, &own.column, own.unit.as_deref())),
        })
    }

    /// What motion and target give to doubt.
    pub fn diagnostics(&self, recorded: &Recorded<'_>) -> Vec<Diagnostic> {
        let Some(target) = &self.target else {
            return Vec::new();
        };
        let runs: Vec<Run<'_>> = (0..target.runs.len())
            .map(|run| Run {
                time: recorded.time(run),
                target: &target.runs[run],
                position: &self.position.runs[run],
            })
            .collect();
        let unit = self.position.unit.clone();
        let columns = || [self.position.name.clone(), target.name.clone()];
        let is_one = runs.len() == 1;
        let of_one = |(k, run): (usize, &Run<'_>)| {
            let factor = wrong_scale(std::slice::from_ref(run))?;
            Some((factor, Some(recorded.name(k))))
        };
        let scale = wrong_scale(&runs).map(|factor| (factor, None));
        let mut each = runs.iter().enumerate().filter(|_| !is_one);
        let scale = scale.or_else(|| each.find_map(of_one));
        let mut all = Vec::new();
        if let Some((factor, run)) = scale {
            all.push(Diagnostic::WrongScale {
                columns: columns(),
                factor,
                run,
            });
        } else if is_alone(recorded, target) && !runs.iter().any(Run::is_driven) {
            all.push(Diagnostic::NoForcing { columns: columns() });
        }
        let beside = |(k, run): (usize, &Run<'_>)| {
            Some(Diagnostic::Origin {
                columns: columns(),
                run: recorded.name(k),
                offset: run.beside()?,
                unit: unit.clone(),
            })
        };
        all.extend(runs.iter().enumerate().find_map(beside));
        all
    }
}

/// Whether nothing but the target can have moved what follows it: no other input, no change, no initial state of its own, and no
/// noise that is part of the model.
fn is_alone(recorded: &Recorded<'_>, target: &Column) -> bool {
    let posed = recorded.posed;
    let others = recorded.inputs.iter().filter(|own| own.name != target.name);
    let mut others = others.filter(|own| {
        let person = recorded.person.as_ref();
        person.is_none_or(|person| person.position.name != own.name)
    });
    let is_own = |state: &&String| {
        state
            .strip_prefix(PILOT)
            .is_some_and(|own| own.starts_with('.'))
    };
    let states = posed.joint.model.states.iter().filter(|own| !is_own(own));
    posed.filter.is_none()
        && others.all(Column::is_still)
        && posed.data.iter().all(|run| run.changes().next().is_none())
        && states
            .filter(|own| posed.file.initial_line(own).is_some())
            .count()
            <= 1
}

/// A run of a person.
struct Run<'r> {
    time: &'r [f64],
    target: &'r [f64],
    position: &'r [f64],
}

impl Run<'_> {
    /// The first recorded position.
    fn origin(&self) -> f64 {
        let recorded = self.position.iter().find(|z| z.is_finite());
        recorded.copied().unwrap_or(0.0)
    }

    /// Whether the target is away from where the run begins, or moves, by more than the person strays from it.
    fn is_driven(&self) -> bool {
        let errors = self.target.iter().zip(self.position);
        let errors = errors.map(|(w, z)| (w - z).abs());
        let mut errors: Vec<f64> = errors.filter(|e| e.is_finite()).collect();
        errors.sort_by(f64::total_cmp);
        let last = (NEARLY_ALL * errors.len() as f64) as usize;
        let origin = self.origin();
        let ways = self.target.iter().map(|w| (w - origin).abs());
        let forcing = ways.fold(width(self.target), f64::max);
        forcing > 0.0 && forcing >= DRIVEN * errors.get(last).copied().unwrap_or(0.0)
    }

    /// Targets and the positions that come `delay` seconds later.
    fn pairs(&self, delay: f64) -> impl Iterator<Item = (f64, f64)> {
        let step = median_step(self.time).unwrap_or(f64::INFINITY);
        let late = (delay / step).round() as usize;
        let pairs = self.target.iter().zip(self.position.iter().skip(late));
        let known = pairs.filter(|(w, z)| w.is_finite() && z.is_finite());
        known.map(|(w, z)| (*w, *z))
    }

    /// Mean of the positions minus that of the targets that they follow from another origin.
    fn beside(&self) -> Option<f64> {
        let all = delays().map(|delay| line(&self.pairs(delay).collect::<Vec<_>>()));
        let best = all.max_by(|a, b| a.correlation.total_cmp(&b.correlation))?;
        let is_beside = best.offset.abs() > BESIDE * width(self.target)
            && best.correlation > FOLLOWED
            && NEAR_ONE.contains(&best.slope);
        is_beside.then_some(best.offset)
    }
}

fn delays() -> impl Iterator<Item = f64> {
    (0..=DELAYS).map(|k| LONGEST_DELAY * f64::from(k) / f64::from(DELAYS))
}

/// Slope of positions over targets, both relative to the start, at the delay with the highest correlation, if no human
/// produces it. A negative slope is used only if no delay gives a positive correlation.
fn wrong_scale(runs: &[Run<'_>]) -> Option<f64> {
    let all: Vec<[f64; 2]> = delays().map(|delay| followed(runs, delay)).collect();
    let best = |sign: f64| {
        let all = all.iter().filter(move |own| sign * own[0] > FOLLOWS);
        all.max_by(|a, b| (sign * a[0]).total_cmp(&(sign * b[0])))
    };
    let [correlation, slope] = *best(1.0).or_else(|| best(-1.0))?;
    let is_small = slope.abs() < SMALL && correlation.abs() > CLOSELY;
    (!SLOPES.contains(&slope) || is_small).then_some(slope)
}

/// Correlation of positions with the targets `delay` seconds earlier, and the slope between them.
fn followed(runs: &[Run<'_>], delay: f64) -> [f64; 2] {
    let (mut product, mut targets, mut positions) = (0.0, 0.0, 0.0);
    for run in runs {
        let origin = run.origin();
        for (target, z) in run.pairs(delay) {
            let (target, z) = (target - origin, z - origin);
            product += target * z;
            targets += target * target;
            positions += z * z;
        }
    }
    [product / (targets * positions).sqrt(), product / targets]
}

/// Second values over first ones.
struct Line {
    correlation: f64,
    slope: f64,
    /// Difference of the means.
    offset: f64,
}

fn line(pairs: &[(f64, f64)]) -> Line {
    let count = pairs.len() as f64;
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
    let (a, b) = (sum(&|own| own.0) / count, sum(&|own| own.1) / count);
    let product = sum(&|own| (own.0 - a) * (own.1 - b));
    let first = sum(&|own| (own.0 - a).powi(2));
    let second = sum(&|own| (own.1 - b).powi(2));
    Line {
        correlation: product / (first * second).sqrt(),
        slope: product / first,
        offset: b - a,
    }
}

/// The first row at which a target leaves its value for a few rows and returns to it, constant before and after.
pub(super) fn flicker(target: &[f64]) -> Option<usize> {
    let is_one = |k: usize, count: usize| {
        let (before, after) = (target[k - 1], target[k + count]);
        let away = target[k..k + count].iter().map(|w| (w - before).abs());
        let size = away.fold(f64::INFINITY, f64::min);
        let changes = [
            after - before,
            before - target[k - 2],
            target[k + count + 1] - after,
        ];
        let others = || [&target[..k], &target[k + count..]].concat();
        size > 0.0
            && changes.iter().all(|change| change.abs() <= QUIET * size)
            && size > LEVELS * resolution(&others())
    };
    (1..=FLICKER)
        .find_map(|count| (2..target.len().saturating_sub(count + 1)).find(|k| is_one(*k, count)))
}
