//! Derivatives of states, outputs and event indicators of an FMU, and their derivatives by all arguments.

use crate::layout::Layout;
use crate::pool::{Held, PointError, Pool};
use pilotage_expression::{Opaque, Partial};
use pilotage_text::error_chain::error_chain;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::{Mutex, PoisonError};

/// Step of central differences of the FMU's derivatives, relative to the size of the argument.
const OUTER: f64 = 6e-6;

/// `[ẋ; y; z]` over time, states, inputs and parameters.
#[derive(Debug)]
pub(crate) struct Rates {
    pub(crate) layout: Layout,
    pub(crate) pool: Pool,
    /// Start value of each argument.
    pub(crate) start: Vec<f64>,
    /// Whether the FMU's directional derivatives by states and inputs are used.
    pub(crate) by_fmu: bool,
    /// Pairs of arguments, the lower first, with a nonzero second derivative.
    pub(crate) curved: Vec<Vec<bool>>,
    /// For each argument, the step of differences relative to its size.
    pub(crate) steps: Vec<f64>,
    /// Why the last evaluation failed.
    pub(crate) trouble: Mutex<Option<String>>,
}

impl Opaque for Rates {
    fn neutral(&self) -> &[f64] {
        &self.start
    }

    fn depends(&self, partial: Partial) -> bool {
        let listed = self.layout.depends.get(partial.value as usize);
        // The description lists no dependencies on parameters, nor of event indicators.
        let by = |place: usize| listed.is_none_or(|own| own.get(place).copied().unwrap_or(true));
        let mut places = partial.arguments();
        let is_curved = match (places.next(), places.next()) {
            (Some(first), Some(second)) => self.curved[first][second],
            _ => true,
        };
        is_curved && partial.arguments().all(by)
    }

    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) {
        out.fill(f64::NAN);
        if at.iter().any(|value| !value.is_finite()) {
            return;
        }
        if let Err(error) = self.fill(at, wanted, out) {
            out.fill(f64::NAN);
            self.remember(format!("at {} s: {}", at[0], error_chain(&error)));
        }
    }

    fn trouble(&self) -> Option<String> {
        self.trouble
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Rates {
    pub(crate) fn remember(&self, trouble: String) {
        let mut last = self.trouble.lock().unwrap_or_else(PoisonError::into_inner);
        *last = Some(trouble);
    }

    fn fill(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) -> Result<(), PointError> {
        let at = &*self.kept(at);
        let mut point = Point {
            rates: self,
            at,
            columns: BTreeMap::new(),
            pairs: BTreeMap::new(),
        };
        let unknowns = self.layout.unknowns();
        let (mut values, mut indicators): (Option<Vec<f64>>, Option<Vec<f64>>) = (None, None);
        for (out, partial) in out.iter_mut().zip(wanted) {
            let row = partial.value as usize;
            let mut places = partial.arguments();
            *out = match (places.next(), places.next()) {
                (None, _) if row >= unknowns => match &indicators {
                    Some(all) => all[row - unknowns],
                    None => indicators.insert(self.indicators(at)?)[row - unknowns],
                },
                (None, _) => match &values {
                    Some(values) => values[row],
                    None => values.insert(self.values(at)?)[row],
                },
                (Some(place), None) => point.column(place, None)?[row],
                (Some(first), Some(second)) => point.curvature(row, first, second)?,
            };
        }
        Ok(())
    }

    fn at<T>(
        &self,
        at: &[f64],
        ask: impl FnOnce(&mut Held) -> Result<T, PointError>,
    ) -> Result<T, PointError> {
        let parameters = &at[self.layout.parameter_arguments()];
        self.pool.with(&self.layout, parameters, at[0], |held| {
            held.put(&self.layout, at)?;
            ask(held)
        })
    }

    /// `[ẋ; y]` at a point.
    pub(crate) fn values(&self, at: &[f64]) -> Result<Vec<f64>, PointError> {
        let layout = &self.layout;
        let (n, m) = (layout.rates.len(), layout.outputs.len());
        let mut values = vec![0.0; n + m];
        self.at(at, |held| {
            // OpenModelica's outputs are outdated if derivatives are requested first.
            if m > 0 {
                held.instance
                    .get_real(&layout.output_references, &mut values[n..])?;
            }
            held.instance.get_derivatives(&mut values[..n])?;
            Ok(values)
        })
    }

    /// Event indicators at a point.
    fn indicators(&self, at: &[f64]) -> Result<Vec<f64>, PointError> {
        let mut indicators = vec![0.0; self.layout.indicators];
        self.at(at, |held| {
            held.instance.get_event_indicators(&mut indicators)?;
            Ok(indicators)
        })
    }

    /// Derivatives of `[ẋ; y]` by an argument.
    pub(crate) fn slopes(&self, at: &[f64], place: usize) -> Result<Vec<f64>, PointError> {
        let layout = &self.layout;
        let is_known = place > 0 && place < layout.parameter_arguments().start;
        match layout.argument(place).filter(|_| is_known && self.by_fmu) {
            Some(known) => {
                let mut column = vec![0.0; layout.unknown_references.len()];
                let ask = |held: &mut Held| {
                    let (unknowns, known) = (&layout.unknown_references, [known.reference]);
                    (held.instance).directional_derivative(
                        unknowns,
                        &known,
                        &[1.0],
                        &mut column,
                    )?;
                    Ok(column)
                };
                let mut column = self.at(at, ask)?;
                if column.len() < layout.unknowns() {
                    let all = self.differences(at, place, self.steps[place])?;
                    column.extend_from_slice(&all[column.len()..]);
                }
                Ok(column)
            }
            None => self.differences(at, place, self.steps[place]),
        }
    }

    /// As [`slopes`](Self::slopes), by fourth-order differences; at a bound, by second-order one-sided differences.
    pub(crate) fn differences(
        &self,
        at: &[f64],
        place: usize,
        step: f64,
    ) -> Result<Vec<f64>, PointError> {
        match self.room(at[place], place, step) {
            (true, true) => {
                let ends = [[step, -step], [0.5 * step, -0.5 * step]];
                self.extrapolated(at, place, ends, 1.0 / 3.0)
            }
            _ => self.one_sided(at, place, step, self.is_more_above(at[place], place)),
        }
    }

    /// As [`slopes`](Self::slopes), by second-order differences to one side: above or below.
    pub(crate) fn one_sided(
        &self,
        at: &[f64],
        place: usize,
        step: f64,
        up: bool,
    ) -> Result<Vec<f64>, PointError> {
        let step = if up { 0.1 * step } else { -0.1 * step };
        self.extrapolated(at, place, [[step, 0.0], [0.5 * step, 0.0]], 1.0)
    }

    /// Richardson extrapolation: the leading error terms of two steps cancel.
    fn extrapolated(
        &self,
        at: &[f64],
        place: usize,
        ends: [[f64; 2]; 2],
        weight: f64,
    ) -> Result<Vec<f64>, PointError> {
        let [whole, half] = ends.map(|ends| self.quotients(at, place, ends));
        let (whole, half) = (whole?, half?);
        let both = half.iter().zip(&whole);
        Ok(both
            .map(|(half, whole)| half + weight * (half - whole))
            .collect())
    }

    /// Differences of `[ẋ; y]` between two points along an argument, divided by its change.
    fn quotients(&self, at: &[f64], place: usize, ends: [f64; 2]) -> Result<Vec<f64>, PointError> {
        let [above, below] = ends.map(|step| self.moved(at, place, step));
        let change = above[place] - below[place];
        let (above, below) = (self.values(&above)?, self.values(&below)?);
        let pairs = above.iter().zip(&below).take(self.layout.unknowns());
        Ok(pairs
            .map(|(above, below)| (above - below) / change)
            .collect())
    }

    /// A point moved along an argument by a fraction of its size, at most to the bound of its range.
    pub(crate) fn moved(&self, at: &[f64], place: usize, step: f64) -> Vec<f64> {
        let mut moved = at.to_vec();
        moved[place] = self.moved_to(at[place], place, step);
        moved
    }

    /// The value to which an argument is moved.
    fn moved_to(&self, from: f64, place: usize, step: f64) -> f64 {
        let by = step * self.size(place).max(from.abs());
        self.within(from + by, from, place)
    }

    /// The value clamped to the range of an argument whose current value is `from`.
    pub(crate) fn within(&self, value: f64, from: f64, place: usize) -> f64 {
        let [least, most] = self.range(from, place);
        value.clamp(least, most)
    }

    /// A point moved up and down along an argument.
    pub(crate) fn ends(&self, at: &[f64], place: usize, step: f64) -> [Vec<f64>; 2] {
        [step, -step].map(|step| self.moved(at, place, step))
    }

    /// The point with its parameters clamped to their ranges: a search exceeds them by its tolerance, and an FMU need
    /// not accept such values.
    pub(crate) fn kept<'a>(&self, at: &'a [f64]) -> Cow<'a, [f64]> {
        let places = self.layout.parameter_arguments();
        let own = self.layout.parameters.iter();
        let mut kept = Cow::from(at);
        for (place, own) in places.zip(own) {
            let value = at[place].max(own.least()).min(own.most());
            if value != at[place] {
                kept.to_mut()[place] = value;
            }
        }
        kept
    }

    /// The interval in which an argument is moved: its range, or unbounded if its value lies outside.
    fn range(&self, value: f64, place: usize) -> [f64; 2] {
        let own = self.layout.argument(place);
        let range = own.map(|own| [own.least(), own.most()]);
        let known = range.filter(|[least, most]| (*least..=*most).contains(&value));
        known.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    }

    /// Whether an argument's range has room for a step up, and down.
    fn room(&self, value: f64, place: usize, step: f64) -> (bool, bool) {
        let [least, most] = self.range(value, place);
        let size = step * self.size(place).max(value.abs());
        (value + size <= most, value - size >= least)
    }

    /// Whether an argument's range extends further above than below.
    fn is_more_above(&self, value: f64, place: usize) -> bool {
        let [least, most] = self.range(value, place);
        most - value > value - least
    }

    /// Typical magnitude of an argument.
    pub(crate) fn size(&self, place: usize) -> f64 {
        let parameters = self.layout.parameter_arguments();
        let own = self.layout.argument(place);
        let nominal = own.and_then(|own| own.nominal);
        let start = own.filter(|own| parameters.contains(&place) && own.start != 0.0);
        nominal.or(start.map(|own| own.start.abs())).unwrap_or(1.0)
    }
}

/// A point moved up (or down) along an argument.
type Moved = (usize, bool);

/// Values computed so far at a point and at points next to it.
struct Point<'r> {
    rates: &'r Rates,
    at: &'r [f64],
    /// Derivatives by an argument, at the point or moved along another one.
    columns: BTreeMap<(usize, Option<Moved>), Vec<f64>>,
    /// Second derivatives by two arguments.
    pairs: BTreeMap<(usize, usize), Vec<f64>>,
}

impl Point<'_> {
    /// Derivatives by an argument at the point, or moved along another one.
    fn column(&mut self, place: usize, moved: Option<Moved>) -> Result<&Vec<f64>, PointError> {
        let key = (place, moved);
        Ok(match self.columns.entry(key) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(open) => open.insert(match moved {
                None => self.rates.slopes(self.at, place)?,
                Some((other, up)) => {
                    let step = if up { OUTER } else { -OUTER };
                    let at = self.rates.moved(self.at, other, step);
                    self.rates.slopes(&at, place)?
                }
            }),
        })
    }

    /// A second derivative.
    fn curvature(&mut self, row: usize, first: usize, second: usize) -> Result<f64, PointError> {
        let rates = self.rates;
        let parameters = rates.layout.parameter_arguments().start;
        if !rates.by_fmu || first >= parameters || first == 0 {
            if !self.pairs.contains_key(&(first, second)) {
                let pair = self.second_differences(first, second)?;
                self.pairs.insert((first, second), pair);
            }
            return Ok(self.pairs[&(first, second)][row]);
        }
        // The FMU's derivatives by a state or an input, moved along the other.
        let from = self.at[second];
        let [up, down] = [OUTER, -OUTER].map(|step| rates.moved_to(from, second, step));
        let above = self.column(first, Some((second, true)))?[row];
        let below = self.column(first, Some((second, false)))?[row];
        Ok((above - below) / (up - down))
    }

    /// Second derivatives by two arguments from values only, at points that first derivatives by parameters need too:
    /// each new value of a parameter requires an initialisation.
    fn second_differences(&self, first: usize, second: usize) -> Result<Vec<f64>, PointError> {
        let (rates, at) = (self.rates, self.at);
        let step = |place: usize| 0.5 * rates.steps[place];
        let rooms = [first, second].map(|place| rates.room(at[place], place, 2.0 * step(place)));
        let above = [first, second].map(|place| rates.is_more_above(at[place], place));
        let is_up = |k: usize| rooms[k].0 || above[k];
        let signs = [0, 1].map(|k| if is_up(k) { 1.0 } else { -1.0 });
        let value = |a: f64, b: f64| {
            let moved = rates.moved(at, first, a * signs[0] * step(first));
            rates.values(&rates.moved(&moved, second, b * signs[1] * step(second)))
        };
        let size =
            |place: usize, sign: f64| rates.moved(at, place, sign * step(place))[place] - at[place];
        let area = size(first, signs[0]) * size(second, signs[1]);
        let (middle, a) = (rates.values(at)?, value(1.0, 0.0)?);
        let terms = match first == second {
            true if rooms[0] == (true, true) => {
                vec![(a, 1.0), (value(-1.0, 0.0)?, 1.0), (middle, -2.0)]
            }
            true => vec![(value(2.0, 0.0)?, 1.0), (a, -2.0), (middle, 1.0)],
            false => {
                let (b, both) = (value(0.0, 1.0)?, value(1.0, 1.0)?);
                vec![(both, 1.0), (a, -1.0), (b, -1.0), (middle, 1.0)]
            }
        };
        let sum = |k: usize| {
            terms
                .iter()
                .map(|(values, weight)| weight * values[k])
                .sum::<f64>()
        };
        Ok((0..rates.layout.unknowns())
            .map(|k| sum(k) / area)
            .collect())
    }
}
