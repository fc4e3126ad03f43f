//! Derivatives of states, outputs and event indicators of an FMU, and how they change with all that they depend on.

use crate::layout::Layout;
use crate::pool::{Held, PointError, Pool};
use pilotage_expression::{Opaque, Partial};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// `[ẋ; y; z]` over time, states, inputs and parameters.
#[derive(Debug)]
pub(crate) struct Rates {
    pub(crate) layout: Layout,
    pub(crate) pool: Pool,
    /// Whether derivatives by states and inputs are asked of the FMU.
    pub(crate) by_fmu: bool,
    /// Pairs of arguments, the lower one first, for which something has a second derivative.
    pub(crate) curved: Vec<Vec<bool>>,
    /// For each argument the step of central differences, per its size.
    pub(crate) steps: Vec<f64>,
    pub(crate) trouble: Mutex<Option<String>>,
}

impl Opaque for Rates {
    fn arguments(&self) -> usize {
        self.layout.arguments()
    }

    fn neutral(&self, argument: usize) -> f64 {
        self.layout.argument(argument).map_or(0.0, |own| own.start)
    }

    fn depends(&self, partial: Partial) -> bool {
        let listed = self.layout.depends.get(partial.value as usize);
        // Parameters and event indicators are not told of.
        let by = |place: usize| listed.is_none_or(|own| own.get(place).copied().unwrap_or(true));
        let places: Vec<usize> = partial.arguments().collect();
        let is_curved = match places[..] {
            [first, second] => self.curved[first][second],
            _ => true,
        };
        is_curved && places.into_iter().all(by)
    }

    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) {
        out.fill(f64::NAN);
        if at.iter().any(|value| !value.is_finite()) {
            return;
        }
        if let Err(error) = self.fill(at, wanted, out) {
            out.fill(f64::NAN);
            let mut trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner);
            *trouble = Some(format!("at {} s: {}", at[0], chain(&error)));
        }
    }

    fn trouble(&self) -> Option<String> {
        self.trouble
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// An error with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

impl Rates {
    fn fill(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) -> Result<(), PointError> {
        let mut point = Point {
            rates: self,
            at: at.to_vec(),
            columns: HashMap::new(),
            pairs: HashMap::new(),
        };
        let mut values: Option<Vec<f64>> = None;
        for (out, partial) in out.iter_mut().zip(wanted) {
            let row = partial.value as usize;
            let places: Vec<usize> = partial.arguments().collect();
            *out = match places[..] {
                [] => match &values {
                    Some(values) => values[row],
                    None => values.insert(self.values(at)?)[row],
                },
                [place] => point.column(place, None)?[row],
                [first, second] => point.curvature(row, first, second)?,
                _ => unreachable!("two derivatives at most"),
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

    /// `[ẋ; y; z]` at a point.
    pub(crate) fn values(&self, at: &[f64]) -> Result<Vec<f64>, PointError> {
        let layout = &self.layout;
        let (n, m) = (layout.rates.len(), layout.outputs.len());
        let mut values = vec![0.0; n + m + layout.indicators];
        self.at(at, |held| {
            // OpenModelica's outputs stay behind where derivatives are asked for first.
            if m > 0 {
                held.instance
                    .get_real(&layout.output_references, &mut values[n..n + m])?;
            }
            held.instance.get_derivatives(&mut values[..n])?;
            if layout.indicators > 0 {
                held.instance.get_event_indicators(&mut values[n + m..])?;
            }
            Ok(values)
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
                self.at(at, ask)
            }
            None => self.differences(at, place, self.steps[place]),
        }
    }

    /// The same by central differences.
    pub(crate) fn differences(
        &self,
        at: &[f64],
        place: usize,
        step: f64,
    ) -> Result<Vec<f64>, PointError> {
        let [(up, above), (down, below)] = self.ends(at, place, step);
        let (above, below) = (self.values(&above)?, self.values(&below)?);
        let slope = |(above, below): (&f64, &f64)| (above - below) / (up - down);
        Ok(above
            .iter()
            .zip(&below)
            .map(slope)
            .take(self.layout.unknowns())
            .collect())
    }

    /// A point moved up and down along an argument, with the argument's values there; parameters stay in their ranges.
    fn ends(&self, at: &[f64], place: usize, step: f64) -> [(f64, Vec<f64>); 2] {
        let size = self.size(place).max(at[place].abs());
        let is_parameter = self.layout.parameter_arguments().contains(&place);
        let own = self.layout.argument(place).filter(|_| is_parameter);
        let least = own.and_then(|own| own.min).unwrap_or(f64::NEG_INFINITY);
        let most = own.and_then(|own| own.max).unwrap_or(f64::INFINITY);
        let (least, most) = (least.min(at[place]), most.max(at[place]));
        [step, -step].map(|step| {
            let mut moved = at.to_vec();
            moved[place] = (at[place] + step * size).clamp(least, most);
            (moved[place], moved)
        })
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

/// What is known of a point and of those beside it.
struct Point<'r> {
    rates: &'r Rates,
    at: Vec<f64>,
    /// Derivatives by an argument, at the point or moved along another one.
    columns: HashMap<(usize, Option<(usize, bool)>), Vec<f64>>,
    /// Second derivatives by two arguments.
    pairs: HashMap<(usize, usize), Vec<f64>>,
}

impl Point<'_> {
    /// Derivatives by an argument at the point, or moved along another one.
    fn column(
        &mut self,
        place: usize,
        moved: Option<(usize, bool)>,
    ) -> Result<&Vec<f64>, PointError> {
        let key = (place, moved);
        if !self.columns.contains_key(&key) {
            let at = match moved {
                None => self.at.clone(),
                Some((other, up)) => {
                    let [above, below] = self.rates.ends(&self.at, other, self.rates.steps[other]);
                    if up { above.1 } else { below.1 }
                }
            };
            self.columns.insert(key, self.rates.slopes(&at, place)?);
        }
        Ok(&self.columns[&key])
    }

    /// A second derivative.
    fn curvature(&mut self, row: usize, first: usize, second: usize) -> Result<f64, PointError> {
        let rates = self.rates;
        let parameters = rates.layout.parameter_arguments().start;
        if !rates.by_fmu || first >= parameters || first == 0 {
            if !self.pairs.contains_key(&(first, second)) {
                let pair = rates.second_differences(&self.at, first, second)?;
                self.pairs.insert((first, second), pair);
            }
            return Ok(self.pairs[&(first, second)][row]);
        }
        // The FMU's derivatives by a state or an input, moved along the other.
        let [(up, _), (down, _)] = rates.ends(&self.at, second, rates.steps[second]);
        let above = self.column(first, Some((second, true)))?[row];
        let below = self.column(first, Some((second, false)))?[row];
        Ok((above - below) / (up - down))
    }
}

impl Rates {
    /// Second derivatives from values alone.
    fn second_differences(
        &self,
        at: &[f64],
        first: usize,
        second: usize,
    ) -> Result<Vec<f64>, PointError> {
        // From the cube root to the fourth root of the rounding.
        let step = |place: usize| self.steps[place].powf(0.75);
        let [(up, above), (down, below)] = self.ends(at, second, step(second));
        let combined = |terms: [(&[f64], f64); 3]| -> Vec<f64> {
            let sum = |k: usize| {
                terms
                    .iter()
                    .map(|(values, weight)| weight * values[k])
                    .sum()
            };
            (0..self.layout.unknowns()).map(sum).collect()
        };
        if first == second {
            let square = 0.25 * (up - down) * (up - down);
            let (above, below) = (self.values(&above)?, self.values(&below)?);
            let weight = 1.0 / square;
            let mut middle = at.to_vec();
            middle[second] = 0.5 * (up + down);
            let middle = self.values(&middle)?;
            return Ok(combined([
                (&above, weight),
                (&below, weight),
                (&middle, -2.0 * weight),
            ]));
        }
        let slopes = |at: &[f64]| self.differences(at, first, step(first));
        let (above, below) = (slopes(&above)?, slopes(&below)?);
        let weight = 1.0 / (up - down);
        Ok(combined([
            (&above, weight),
            (&below, -weight),
            (&below, 0.0),
        ]))
    }
}
