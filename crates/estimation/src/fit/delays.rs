//! Delays without an order of which no recording is exact: the order of Padé's approximation belongs to the numerics, as the mesh
//! does, and is raised until the estimates stay.

use super::solve::solve;
use super::{Observer, fit, fitted};
use crate::fit::race::Raced;
use crate::fit::search::Searched;
use crate::fit::watch::Watch;
use crate::posed::Posed;
use crate::result::Fit;
use crate::result::delays::DelayOrder;
use crate::search::begin::{Point, at_point};
use crate::search::solved::Solved;
use crate::search::starts::given;
use pilotage_language::Delayed;

/// Orders after the first: each so much higher that what the estimates move by tells how far they are from those of the delay. That
/// of an approximation of a jump falls with the order itself.
const ORDERS: [usize; 6] = [3, 5, 8, 12, 18, Delayed::HIGHEST];

/// Move of an estimate, in its standard deviations, below which an order is high enough.
const LITTLE: f64 = 0.1;

/// Fits a problem. If delays have no order and are not exact, the order is raised until no estimate moves by a tenth of its standard
/// deviation, each time from the last optimum; the problem with the last order is returned, too, to which the fit belongs.
pub fn fit_delays<'f>(posed: &Posed<'f>, observer: &mut Observer<'_>) -> (Option<Posed<'f>>, Fit) {
    let mut found = fit(posed, observer);
    let Some(order) = posed.delay_order() else {
        return (None, found);
    };
    let mut delays = DelayOrder {
        order,
        moved: None,
        is_enough: false,
    };
    let mut last = None;
    // A filter keeps the order with which its initial guess was found.
    let orders = ORDERS.into_iter().filter(|_| posed.filter.is_none());
    for order in orders.filter(|own| *own > order) {
        let before = last.as_ref().unwrap_or(posed);
        let from = found.solved.clone().filter(|_| found.is_answer());
        let raised = from.and_then(|from| Some((before.raised(order).ok()?, from)));
        let Some((next, from)) = raised else {
            break;
        };
        let mut own = fitted(&next, Some((before, &from)), observer);
        let Some((most, name)) = moved(&found, &own).filter(|_| own.is_answer()) else {
            break;
        };
        own.take_search(found);
        delays = DelayOrder {
            moved: Some((delays.order, most, name)),
            is_enough: most < LITTLE,
            order,
        };
        (found, last) = (own, Some(next));
        if delays.is_enough {
            break;
        }
    }
    found.delays = Some(delays);
    (last, found)
}

/// The largest move of an estimate between two fits, in standard deviations of the second, and its name. None without deviations.
fn moved(before: &Fit, after: &Fit) -> Option<(f64, String)> {
    let sure = after.uncertainty.as_ref().ok()?;
    let all = after.parameters.iter().zip(&sure.intervals);
    let moves = all.flat_map(|(own, intervals)| {
        let before = before
            .parameters
            .iter()
            .find(|other| other.name == own.name);
        let values = own
            .values
            .iter()
            .zip(before.map_or(&[][..], |own| &own.values));
        let moves = values.zip(intervals).map(|((after, before), interval)| {
            let moved = (after.1 - before.1).abs() / interval.sd;
            (
                if moved.is_finite() { moved } else { 0.0 },
                own.name.clone(),
            )
        });
        moves.collect::<Vec<_>>()
    });
    moves.max_by(|a, b| a.0.total_cmp(&b.0))
}

impl Fit {
    /// Takes over how the search went of which this is the continuation.
    fn take_search(&mut self, before: Self) {
        self.refinement.iterations += before.refinement.iterations;
        (self.starts, self.others) = (before.starts, before.others);
        let (own, other) = (&mut self.seconds, before.seconds);
        own.search += other.search;
        own.solve += other.solve;
        own.uncertainty += other.uncertainty;
        own.diagnostics += other.diagnostics;
    }
}

/// The solution from an optimum with another order, instead of a search: the same parameters, and initial states where they are not
/// those of the delays.
pub(super) fn continued<'a, 'o>(
    posed: &Posed<'_>,
    (before, from): (&Posed<'_>, &Solved),
    watch: Watch<'a, 'o>,
) -> Searched<'a, 'o> {
    let theta = from.theta();
    let known = from.initial();
    let initial = |j: usize| {
        let own = posed.states.iter().zip(&posed.runs[j].initial);
        let own = own.map(|(state, known_here)| {
            let place = before
                .states
                .iter()
                .position(|other| other.name == state.name);
            known_here
                .or_else(|| Some(known[j][place?]))
                .unwrap_or(state.guesses[j])
        });
        own.collect()
    };
    let point = Point {
        theta: &theta,
        runs: (0..posed.runs.len()).collect(),
        initial: (0..posed.runs.len()).map(initial).collect(),
        follows: false,
        is_fitted: true,
        is_raised: false,
        is_kept: false,
    };
    let watch = watch.of(1);
    let scheme = Some(from.problem.scheme);
    let from = at_point(posed, &point, scheme, &|| watch.is_over());
    let see = |iteration: &_| watch.see(0, 0, iteration);
    let solved = match watch.is_over() {
        true => None,
        false => Some(solve(posed, from, posed.file.options.max_iterations, &see)),
    };
    Searched {
        raced: Raced {
            solved: vec![solved],
            same: vec![0],
        },
        starts: vec![given(posed)],
        watch,
    }
}
