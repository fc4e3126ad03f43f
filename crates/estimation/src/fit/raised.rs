//! Starts of a linear model of an order, from a fit of the order below.
//!
//! A transfer function with many coefficients has optima in which poles lie on zeros, and starts far from the data end there. One
//! of second order is found from almost any start. With a pole and a zero that cancel it is one of the next order that does the
//! same; moving the pair apart can only improve the fit. The pair tells the solver nothing about its best place, so that it begins
//! at several: slow, in the middle, and fast.

use super::Progress;
use super::race::{best_of, has_answer, raced};
use super::tumbles::Tumbles;
use super::watch::Watch;
use crate::posed::Posed;
use crate::posed::unknowns::Unknown;
use crate::problem::file::{Limits, Measured, ProblemFile, Quantity};
use crate::problem::order::{check, instance, number, with_order, with_pair};
use crate::search::observed::Observed;
use crate::search::solved::{SAME, Solved};
use crate::search::starts::{BLOCK, Start, given, recorded, starts};
use crate::system::part;
use pilotage_cosim::description::InstanceDescription;
use pilotage_inference::sampling::median_step;
use pilotage_series::Series;
use pilotage_sqp::Status;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Places of the pair, relative to the magnitude of the lower order's poles.
const PAIRS: [f64; 5] = [1.1, 0.075, 7.5, 0.3, 40.0];

/// Place of another pair where states begin anywhere, and how many times as far from 0 its zero is: a model that integrates has an
/// optimum of its own there, to which no pair that cancels leads.
const INTEGRATING: (f64, f64) = (1e-3, 100.0);

/// Scaled KKT residual at which the fit of a lower order ends.
const ROUGH: f64 = 1e-4;

/// Maximum number of rows of each run that the fit of a lower order takes: a loop with wrong parameters carries the states far
/// away in a long run, and what the rows behind say is left to the order that is asked for.
const ROWS: usize = 1000;

/// The lowest order with starts from the order below.
const LOWEST: u32 = 3;

/// Where a search begins.
pub(super) struct Begin {
    /// Starts that are tried as they are.
    pub raised: Vec<Start>,
    /// The others.
    pub drawn: Vec<Start>,
    /// The same as they are, where data lead the others on rough meshes alone.
    pub unled: Vec<Start>,
    /// The system with corrected instances, if it leads these.
    pub observed: Option<Observed>,
}

impl Begin {
    /// The starts of a problem: those from the order below if there is one, after the given one if it is another than the
    /// model's. Where initial states are free there are many optima, and the given and drawn ones are tried, too; and where there
    /// is no order below, these alone.
    pub fn new(posed: &Posed<'_>, watch: &Watch<'_, '_>) -> Self {
        // Where states begin anywhere and nothing tumbles.
        let is_many = has_free_states(posed) && Tumbles::of(posed).is_none();
        let raised = raised(posed, is_many, watch).unwrap_or_default();
        match raised.is_empty() || is_many {
            true => Self {
                raised,
                ..Self::drawn(posed)
            },
            false => Self {
                raised,
                drawn: Vec::new(),
                unled: Vec::new(),
                observed: None,
            },
        }
    }

    /// The given and drawn starts alone.
    pub fn drawn(posed: &Posed<'_>) -> Self {
        let starts = posed.file.options.starts();
        let none = Self {
            raised: Vec::new(),
            drawn: Vec::new(),
            unled: Vec::new(),
            observed: Observed::new(posed).filter(|own| !own.is_rough || starts > 1),
        };
        none.next(posed, 0, starts.min(BLOCK))
    }

    /// The given and drawn starts from one of them on, alone.
    pub fn next(self, posed: &Posed<'_>, first: usize, count: usize) -> Self {
        let of =
            |all: fn(&Posed<'_>, usize) -> Vec<Start>| all(posed, first + count).split_off(first);
        let is_rough = self.observed.as_ref().is_some_and(|own| own.is_rough);
        Self {
            raised: Vec::new(),
            drawn: of(match self.observed {
                Some(_) => recorded,
                None => starts,
            }),
            unled: if is_rough { of(starts) } else { Vec::new() },
            ..self
        }
    }

    /// Number of all starts.
    pub fn count(&self) -> usize {
        self.raised.len() + self.drawn.len() + self.unled.len()
    }

    /// All starts, in the order of their numbers.
    pub fn starts(&self) -> Vec<Start> {
        let all = self.raised.iter().chain(&self.drawn);
        all.chain(&self.unled).cloned().collect()
    }
}

/// Whether states begin anywhere that are not measured.
fn has_free_states(posed: &Posed<'_>) -> bool {
    let is_measured = |name: &String| {
        let mut measured = posed.file.measured.iter();
        measured.any(|own| matches!(&own.of, Quantity::Signal(of) if of == name))
    };
    posed.free_states().any(|name| !is_measured(name))
}

/// The starts from the order below. None if no model has an order above it, if one start alone is asked for, or if the lower
/// order has no answer.
fn raised(posed: &Posed<'_>, is_many: bool, watch: &Watch<'_, '_>) -> Option<Vec<Start>> {
    let instance = instance(posed.file).ok()?;
    let file = lower(posed, &instance)?;
    let parts = &posed.joint.parts;
    let open = |own: &InstanceDescription| match own.name == instance {
        true => part::open(own),
        false => {
            let (_, part) =
                (parts.iter().find(|(name, _)| *name == own.name)).expect("an instance");
            Ok(part.clone())
        }
    };
    let below = match posed.file.options.limits {
        Limits::Saturate => Posed::unlimited(&file, &open),
        Limits::Constrain => Posed::new(&file, &open),
    };
    let below = below.ok()?;
    let mut ask = |_: &Progress<'_>| match watch.is_over() {
        true => ControlFlow::Break(watch.over().unwrap_or(Status::Stopped)),
        false => ControlFlow::Continue(()),
    };
    let quiet = Watch::new(&mut ask, 1);
    let begin = Begin::new(&below, &quiet);
    let mut solved = raced(&below, &begin, &quiet).solved;
    if !has_answer(&solved) {
        return None;
    }
    let (best, _) = best_of(&below, &solved, &quiet);
    let best = solved[best].take()?;
    let other = another(&best, &solved);
    let order = file.order_of(&instance)? as usize;
    let first = given(posed);
    let integrating = is_many.then_some(INTEGRATING);
    let pairs = PAIRS.iter().map(|place| (*place, 1.0)).chain(integrating);
    let pairs: Vec<(f64, f64)> = pairs.collect();
    let mut all: Vec<Start> = is_chosen(posed)
        .then(|| first.clone())
        .into_iter()
        .collect();
    for own in [Some(&best), other].into_iter().flatten() {
        let theta = own.theta();
        let shared = below.unknowns.iter().filter_map(|(unknown, stands)| {
            let value = below.places(stands).first().and_then(|k| theta.get(*k));
            Some((unknown.name.as_str(), *value?))
        });
        let shared: HashMap<&str, f64> = shared.collect();
        let coefficients =
            (1..=2 * order).map(|k| shared.get(&*format!("{instance}.theta{k}")).copied());
        let coefficients: Vec<f64> = coefficients.collect::<Option<_>>()?;
        let is_first = std::ptr::eq(own, &best);
        let raised = |(place, apart): &(f64, f64)| {
            let all = with_pair(&coefficients, *place, *apart);
            let value = |name: &str| match number(name, &instance) {
                Some(k) => all.get(k - 1).copied(),
                None => shared.get(name).copied(),
            };
            begun(posed, &first, &value)
        };
        all.extend(pairs.iter().map(raised));
        if is_first && !runs_away(posed, &coefficients) {
            break;
        }
    }
    Some(all)
}

/// Whether a pole is faster than the samples resolve.
fn runs_away(posed: &Posed<'_>, coefficients: &[f64]) -> bool {
    let step = posed.runs.iter().filter_map(|run| median_step(&run.time));
    let step = step.fold(f64::INFINITY, f64::min);
    // The sum of the poles.
    coefficients[coefficients.len() / 2 - 1].abs() * step > PI
}

/// The next best optimum of the order below. Where the best one has a pole that runs away, that leads to no better one of the next
/// order.
fn another<'s>(best: &Solved, solved: &'s [Option<Solved>]) -> Option<&'s Solved> {
    let objective = |own: &Solved| own.solution.iterate.f;
    let is_another = |own: &&Solved| {
        own.solution.status == Status::Converged
            && objective(own) > objective(best) + SAME * objective(best).abs()
    };
    let others = solved.iter().flatten().filter(is_another);
    others.min_by(|a, b| objective(a).total_cmp(&objective(b)))
}

/// A start with these values in place of those of the first.
fn begun(posed: &Posed<'_>, first: &Start, value: &dyn Fn(&str) -> Option<f64>) -> Start {
    let mut start = Start {
        follows: posed.followed.is_some(),
        is_fitted: true,
        is_raised: true,
        ..first.clone()
    };
    for (unknown, stands) in &posed.unknowns {
        if let Some(value) = value(&unknown.name) {
            let places = posed.places(stands).into_iter();
            places.for_each(|k| start.parameters[k] = value);
        }
    }
    start
}

/// The problem with the order below; None if there is none, or it would not be the same problem.
fn lower(posed: &Posed<'_>, instance: &str) -> Option<ProblemFile> {
    let file = posed.file;
    check(file, instance).ok()?;
    let order = file.order_of(instance).filter(|order| *order >= LOWEST)?;
    let is_sought = |k: u32| {
        let name = format!("{instance}.theta{k}");
        posed.unknowns.iter().any(|(own, _)| own.name == name)
    };
    let prefix = format!("{instance}.");
    let is_own =
        |own: &Measured| matches!(&own.of, Quantity::Signal(of) if of.starts_with(&prefix));
    // A fit of long runs costs as much as the search itself, and where its output is recorded a model is found without.
    let is_needless = file.measured.iter().any(is_own);
    let is_alone = file.options.starts() < 2 || posed.filter.is_some();
    if is_needless || is_alone || !(1..=2 * order).all(is_sought) {
        return None;
    }
    let mut lower = with_order(file, instance, order - 1, None);
    lower.options.tolerance = lower.options.tolerance.max(ROUGH);
    lower.runs.retain(|run| run.fits);
    for (run, data) in lower.runs.iter_mut().zip(&posed.data) {
        run.recorded = Some(match data.series.time.len() > ROWS {
            true => Arc::new(beginning(&data.series)),
            false => data.series.clone(),
        });
    }
    Some(lower)
}

/// The first rows of a recording.
fn beginning(whole: &Series) -> Series {
    let mut own = whole.clone();
    own.time.truncate(ROWS);
    (own.columns.iter_mut()).for_each(|column| column.values.truncate(ROWS));
    own
}

/// Whether some parameter begins elsewhere than in its model.
fn is_chosen(posed: &Posed<'_>) -> bool {
    let differs = |(unknown, _): &(Unknown, _)| {
        let own = posed.joint.variables.get(&unknown.name);
        own.is_some_and(|own| own.start != unknown.start)
    };
    posed.unknowns.iter().any(differs)
}
