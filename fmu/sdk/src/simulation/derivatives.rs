//! Derivatives with dual numbers: exact, wherever these are defined.

use super::Simulation;
use crate::structure::evaluate;
use crate::{At, Equations, Table};
use num_dual::Dual64;

impl<E: Equations> Simulation<E> {
    /// Time derivative of an output at the end of the last step [its unit per second], along the derivatives of the
    /// states and the slopes that the inputs had in that step.
    ///
    /// # Panics
    /// When the variable is no output.
    pub fn output_derivative(&self, index: usize) -> f64 {
        assert!(
            self.table.outputs().contains(&index),
            "{index} is no output"
        );
        self.along_flow(&self.now.last_slopes)[index]
    }

    /// Current time derivatives of the event indicators, with the slopes that are set for the inputs.
    pub(super) fn indicator_rates(&self) -> Vec<f64> {
        self.along_flow(&self.now.slopes)[self.table.indicators()].to_vec()
    }

    /// Time derivatives of all variables for these slopes of the inputs.
    fn along_flow(&self, slopes: &[f64]) -> Vec<f64> {
        let (mut values, mut states) = self.lifted();
        let mut rates = vec![0.0; self.table.n_states()];
        self.derivatives(&mut rates);
        for (state, rate) in states.iter_mut().zip(rates) {
            state.eps = rate;
        }
        for (value, slope) in values.iter_mut().zip(slopes) {
            value.eps = *slope;
        }
        let time = Dual64::new(self.now.time, 1.0);
        let delayed = self.delayed().map(|own| Dual64::new(own[0], own[1]));
        let all = self.evaluated(time, &values, &states, &delayed.collect::<Vec<_>>());
        all.iter().map(|v| v.eps).collect()
    }

    /// Derivatives of any variables in the direction of `seeds`, pairs of a known's index and its part:
    /// `Σ ∂unknown/∂known · part`. Knowns are inputs, parameters, start values (which also change their state) and
    /// states.
    ///
    /// # Panics
    /// If there is no such variable, or a seed is for a variable that is not a known.
    pub fn directional_derivative(&self, unknowns: &[usize], seeds: &[(usize, f64)]) -> Vec<f64> {
        let all = self.forward(seeds, true);
        unknowns.iter().map(|index| all[*index].eps).collect()
    }

    /// The same for linear analysis: of delays that are exact it sees the states that approximate them.
    ///
    /// # Panics
    /// As [`directional_derivative`](Self::directional_derivative).
    pub fn linear_derivative(&self, unknowns: &[usize], seeds: &[(usize, f64)]) -> Vec<f64> {
        let all = self.forward(seeds, false);
        unknowns.iter().map(|index| all[*index].eps).collect()
    }

    /// Times of the delays that are exact \[s\].
    pub fn delay_times(&self) -> Vec<f64> {
        let mut times = Vec::new();
        if self.n_delays > 0 {
            let p = &self.now.values[self.table.parameters()];
            self.equations.delays(p, &mut times);
        }
        times
    }

    /// As [`directional_derivative`](Self::directional_derivative) with a change of one of the delayed signals, too, if any: the
    /// unknowns, then the signals that are delayed.
    ///
    /// # Panics
    /// As [`directional_derivative`](Self::directional_derivative).
    pub fn delayed_derivative(
        &self,
        unknowns: &[usize],
        seeds: &[(usize, f64)],
        delayed: Option<usize>,
    ) -> Vec<f64> {
        let (values, states) = self.seeded(seeds);
        let parts = self
            .delayed()
            .enumerate()
            .map(|(k, own)| Dual64::new(own[0], if delayed == Some(k) { 1.0 } else { 0.0 }));
        let parts: Vec<Dual64> = parts.collect();
        let time = Dual64::from_re(self.now.time);
        let all = self.evaluated(time, &values, &states, &parts);
        let mut signals = vec![Dual64::from_re(0.0); parts.len()];
        let at = At {
            time,
            x: &states,
            u: &[&values[self.table.inputs()], &parts].concat(),
            p: &values[self.table.parameters()],
        };
        self.equations.signals(at, &mut signals);
        let unknowns = unknowns.iter().map(|index| all[*index].eps);
        unknowns.chain(signals.iter().map(|own| own.eps)).collect()
    }

    /// Derivatives of the weighted sum of `seeds`, pairs of an unknown's index and its part, with respect to each
    /// known: `Σ part · ∂unknown/∂known`.
    ///
    /// # Panics
    /// As [`directional_derivative`](Self::directional_derivative).
    pub fn adjoint_derivative(&self, seeds: &[(usize, f64)], knowns: &[usize]) -> Vec<f64> {
        let sum = |known: &usize| {
            let all = self.forward(&[(*known, 1.0)], true);
            let parts = seeds.iter().map(|(index, part)| part * all[*index].eps);
            parts.sum()
        };
        knowns.iter().map(sum).collect()
    }

    /// All variables with their derivatives in the direction of `seeds`.
    fn forward(&self, seeds: &[(usize, f64)], is_exact: bool) -> Vec<Dual64> {
        let (values, states) = self.seeded(seeds);
        let delayed = self.delayed().filter(|_| is_exact);
        let delayed: Vec<Dual64> = delayed.map(|own| Dual64::from_re(own[0])).collect();
        self.evaluated(Dual64::from_re(self.now.time), &values, &states, &delayed)
    }

    /// Values and states with their parts of `seeds`.
    fn seeded(&self, seeds: &[(usize, f64)]) -> (Vec<Dual64>, Vec<Dual64>) {
        let (mut values, mut states) = self.lifted();
        for &(index, part) in seeds {
            match known(&self.table, index) {
                (Some(value), None) => values[value].eps += part,
                (Some(value), Some(state)) => {
                    values[value].eps += part;
                    states[state].eps += part;
                }
                (None, Some(state)) => states[state].eps += part,
                (None, None) => panic!("variable {index} is no known"),
            }
        }
        (values, states)
    }

    /// All variables with their derivatives. Dual numbers have none for `√u + x` by `x` where `u` is 0, since 0·∞ is not a
    /// number; such derivatives are central differences, which have eight digits and more.
    fn evaluated(
        &self,
        time: Dual64,
        values: &[Dual64],
        states: &[Dual64],
        delayed: &[Dual64],
    ) -> Vec<Dual64> {
        let of = (&self.equations, &self.table);
        let mut all = evaluate(of, time, values, states, delayed);
        if all.iter().all(|own| !own.eps.is_nan()) {
            return all;
        }
        let change = |(size, change): (f64, f64), own: &Dual64| {
            (
                f64::max(size, own.re.abs()),
                f64::max(change, own.eps.abs()),
            )
        };
        let moved = values.iter().chain(states).chain(delayed).chain([&time]);
        let (size, change) = moved.filter(|own| own.eps != 0.0).fold((1.0, 0.0), change);
        let h = f64::EPSILON.cbrt() * size / change;
        let [after, before] = [h, -h].map(|h| {
            let at = |own: &Dual64| own.re + h * own.eps;
            let [values, states, delayed] =
                [values, states, delayed].map(|all| all.iter().map(at).collect::<Vec<_>>());
            evaluate(of, at(&time), &values, &states, &delayed)
        });
        for (own, (after, before)) in all.iter_mut().zip(after.iter().zip(&before)) {
            if own.eps.is_nan() {
                own.eps = (after - before) / (2.0 * h);
            }
        }
        all
    }

    fn lifted(&self) -> (Vec<Dual64>, Vec<Dual64>) {
        let lift = |values: &[f64]| values.iter().map(|&v| Dual64::from_re(v)).collect();
        (lift(&self.now.values), lift(&self.now.states))
    }
}

/// Indices of the value and the state that a known changes.
fn known(table: &Table, index: usize) -> (Option<usize>, Option<usize>) {
    if table.starts().contains(&index) {
        return (Some(index), Some(index - table.starts().start));
    }
    match table.x().position(|i| i == index) {
        Some(state) => (None, Some(state)),
        None if table.variables()[index].is_calculated() => (None, None),
        None => (Some(index), None),
    }
}
