//! Values and derivatives of the model at a group of points, in scaled variables.
//!
//! The equations and their derivatives are expression graphs, which show which derivatives are structurally nonzero and
//! which depend only on θ. Tapes evaluate them.

use super::simd::{LANES, Lanes, plus, scaled, times};
use nalgebra::DMatrix;
use num_dual::DualNum;
use pilotage_expression::{Node, Registers, System, Tape};
use std::sync::Arc;

/// Typical magnitudes by which variables are divided.
#[derive(Debug, Clone, PartialEq)]
pub struct Scales {
    /// Magnitudes of the states, in their units.
    pub states: Vec<f64>,
    /// Magnitudes of the parameters, in their units.
    pub parameters: Vec<f64>,
}

/// The tapes of a system: `[ẋ; y]`, and its derivatives with respect to states and parameters.
#[derive(Debug)]
pub struct Differentiated {
    /// The system.
    pub system: System,
    /// Structurally nonzero entries `(row, column)` of `∂f/∂[x; θ]`, column by column.
    entries: Vec<(usize, usize)>,
    /// For each output, the columns of `[x; θ]` at which its gradient is structurally nonzero.
    columns: Vec<Vec<usize>>,
    /// Pairs `i ≤ j` of variables `[x; θ]` with a second derivative.
    pairs: Vec<(usize, usize)>,
    pub(super) values: Tape,
    /// First the outputs, the Jacobian entries and the gradients; then, for each pair, the weighted sum of the second
    /// derivatives of all rows. The weights are variables that follow those of the system.
    derivatives: Tape,
}

/// The model in scaled variables `x̄ = x / s_x`, `θ̄ = θ / s_θ`.
#[derive(Debug, Clone)]
pub struct NodeModel {
    /// Its tapes, in physical units.
    pub tapes: Arc<Differentiated>,
    /// Scales of its variables.
    pub scales: Scales,
    /// Structurally nonzero entries `(row, column)` of `∂f̄/∂[x̄; θ̄]`, column by column.
    pub entries: Vec<(usize, usize)>,
    /// Number of those entries that belong to states; they come first.
    pub state_entries: usize,
    /// True for entries that depend only on θ and so have the same value at all points.
    pub shared: Vec<bool>,
    /// Pairs `i ≤ j` of variables `[x̄; θ̄]` with a second derivative.
    pub pairs: Vec<(usize, usize)>,
    /// `1 / s_x`.
    inverse: Vec<f64>,
    /// Factors for the values of the tape: Jacobian entries, gradients, pairs.
    entry_scales: Vec<f64>,
    gradient_scales: Vec<Vec<f64>>,
    pair_scales: Vec<f64>,
    /// Factors of the outputs: 1 for measured ones.
    output_factors: Vec<f64>,
}

/// The model's values at one θ.
#[derive(Debug)]
pub struct Values<'m> {
    model: &'m NodeModel,
    registers: Registers<LANES>,
}

/// The model's derivatives at one θ, at the group of points evaluated last.
#[derive(Debug)]
pub struct Derivatives<'m> {
    model: &'m NodeModel,
    registers: Registers<LANES>,
}

impl Differentiated {
    /// The tapes of a system.
    pub fn new(system: &System) -> Self {
        let mut graph = system.graph.clone();
        let rows = [&system.derivatives[..], &system.outputs].concat();
        let variables: Vec<usize> = (0..system.states)
            .map(|k| system.state(k))
            .chain((0..system.parameters).map(|k| system.parameter(k)))
            .collect();
        let jacobian: Vec<Vec<Node>> = (variables.iter())
            .map(|variable| graph.derivatives(&rows, *variable))
            .collect();
        let (mut entries, mut first) = (Vec::new(), system.outputs.clone());
        for (j, column) in jacobian.iter().enumerate() {
            for (i, node) in column[..system.states].iter().enumerate() {
                if !graph.is_zero(*node) {
                    entries.push((i, j));
                    first.push(*node);
                }
            }
        }
        let mut columns = vec![Vec::new(); system.outputs.len()];
        for (k, own) in columns.iter_mut().enumerate() {
            for (j, column) in jacobian.iter().enumerate() {
                let node = column[system.states + k];
                if !graph.is_zero(node) {
                    own.push(j);
                    first.push(node);
                }
            }
        }
        // Contribution of a point to the Lagrangian, and its gradient.
        let mut sum = graph.constant(0.0);
        for (k, row) in rows.iter().enumerate() {
            let weight = graph.variable(system.variables() + k);
            let part = graph.multiply(weight, *row);
            sum = graph.add(sum, part);
        }
        let nodes: Vec<Node> = (variables.iter()).map(|v| graph.variable(*v)).collect();
        let gradient = graph.gradient(sum, &nodes);
        let (mut pairs, mut second) = (Vec::new(), Vec::new());
        for (j, variable) in variables.iter().enumerate() {
            let column = graph.derivatives(&gradient[..=j], *variable);
            for (i, node) in column.into_iter().enumerate() {
                if !graph.is_zero(node) {
                    pairs.push((i, j));
                    second.push(node);
                }
            }
        }
        let mut order: Vec<usize> = (0..pairs.len()).collect();
        order.sort_by_key(|k| pairs[*k]);
        let is_early =
            |variable: usize| (system.parameter(0)..system.variables()).contains(&variable);
        let all = system.variables() + rows.len();
        Self {
            system: system.clone(),
            entries,
            columns,
            values: Tape::new(&graph, system.variables(), is_early, &[&rows]),
            derivatives: {
                let second: Vec<Node> = order.iter().map(|k| second[*k]).collect();
                Tape::new(&graph, all, is_early, &[&first, &second])
            },
            pairs: order.iter().map(|k| pairs[*k]).collect(),
        }
    }

    /// Structurally nonzero entries `(row, column)` of `∂f/∂[x; θ]`, column by column.
    pub fn entries(&self) -> &[(usize, usize)] {
        &self.entries
    }

    /// Pairs `i ≤ j` of variables `[x; θ]` with a second derivative.
    pub fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }

    /// The same at a known θ, without parameters.
    pub fn at(&self, theta: &[f64]) -> Self {
        let values: Vec<Option<f64>> = theta.iter().map(|value| Some(*value)).collect();
        Self::new(&self.system.with_parameters(&values))
    }

    /// `[ẋ; y]` at one point, in any number type.
    pub fn evaluate<T: DualNum<Primitive = f64> + Copy>(
        &self,
        time: T,
        x: &[T],
        u: &[T],
        theta: &[T],
    ) -> Vec<T> {
        self.values.evaluate(&[&[time], x, u, theta].concat())
    }

    /// `∂f/∂x` at one point, n × n.
    pub fn jacobian(&self, time: f64, x: &[f64], u: &[f64], theta: &[f64]) -> DMatrix<f64> {
        let tape = &self.derivatives;
        let mut registers = tape.registers::<1>();
        let variables = [&[time], x, u, theta].concat();
        let values = variables.into_iter().enumerate();
        values.for_each(|(k, value)| registers.set(k, [value]));
        tape.run(0, &mut registers);
        tape.run(1, &mut registers);
        let mut out = DMatrix::zeros(x.len(), x.len());
        let own = tape.outputs(0)[self.n_outputs()..].iter();
        let by_states = self
            .entries
            .iter()
            .zip(own)
            .filter(|((_, j), _)| *j < x.len());
        by_states.for_each(|(at, register)| [out[*at]] = registers.get(*register));
        out
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.system.states
    }

    /// Number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.system.inputs
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.system.parameters
    }

    /// Number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.system.outputs.len()
    }
}

impl NodeModel {
    /// The model with scales.
    pub fn new(tapes: Arc<Differentiated>, scales: Scales) -> Self {
        let inverse: Vec<f64> = scales.states.iter().map(|s| 1.0 / s).collect();
        let scale = |variable: usize| match variable.checked_sub(tapes.n_states()) {
            None => scales.states[variable],
            Some(parameter) => scales.parameters[parameter],
        };
        let entries = tapes.entries.iter();
        let gradients = tapes.columns.iter();
        let first = tapes.n_outputs();
        Self {
            entry_scales: entries.map(|&(i, j)| scale(j) * inverse[i]).collect(),
            gradient_scales: gradients
                .map(|own| own.iter().map(|j| scale(*j)).collect())
                .collect(),
            pair_scales: (tapes.pairs.iter())
                .map(|&(a, b)| scale(a) * scale(b))
                .collect(),
            entries: tapes.entries.clone(),
            state_entries: tapes
                .entries
                .iter()
                .filter(|e| e.1 < tapes.n_states())
                .count(),
            shared: tapes.derivatives.is_early(0)[first..first + tapes.entries.len()].to_vec(),
            pairs: tapes.pairs.clone(),
            output_factors: vec![1.0; first],
            inverse,
            scales,
            tapes,
        }
    }

    /// The model with the outputs from `first` on multiplied by these factors.
    pub(super) fn with_factors(mut self, first: usize, factors: &[f64]) -> Self {
        for (output, factor) in (first..).zip(factors) {
            self.output_factors[output] = *factor;
            let scales = &mut self.gradient_scales[output];
            scales.iter_mut().for_each(|scale| *scale *= factor);
        }
        self
    }

    /// The factor by which an output's values are multiplied.
    pub(super) fn output_factor(&self, output: usize) -> f64 {
        self.output_factors[output]
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.tapes.n_states()
    }

    /// Number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.tapes.n_inputs()
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.tapes.n_parameters()
    }

    /// Number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.tapes.n_outputs()
    }

    /// Columns of an output's gradient over `[x̄; θ̄]`.
    pub fn columns(&self, output: usize) -> &[usize] {
        &self.tapes.columns[output]
    }

    /// The model's values at a scaled θ.
    pub fn values(&self, theta: &[f64]) -> Values<'_> {
        Values {
            model: self,
            registers: self.begin(&self.tapes.values, theta),
        }
    }

    /// The derivatives at a scaled θ.
    pub fn derivatives(&self, theta: &[f64]) -> Derivatives<'_> {
        Derivatives {
            model: self,
            registers: self.begin(&self.tapes.derivatives, theta),
        }
    }

    /// The registers of a tape at a scaled θ.
    fn begin(&self, tape: &Tape, theta: &[f64]) -> Registers<LANES> {
        let mut registers = tape.registers();
        let values = theta.iter().zip(&self.scales.parameters);
        for (k, (value, scale)) in values.enumerate() {
            registers.set(self.tapes.system.parameter(k), [value * scale; LANES]);
        }
        tape.run(0, &mut registers);
        registers
    }

    /// Sets the values at a group of points: scaled states, and inputs followed by the time.
    #[inline(always)]
    fn set(&self, registers: &mut Registers<LANES>, x: [&[f64]; LANES], input: [&[f64]; LANES]) {
        let (system, n) = (&self.tapes.system, self.scales.states.len());
        let x = x.map(|own| &own[..n]);
        for (i, scale) in self.scales.states.iter().enumerate() {
            registers.set(system.state(i), scaled(*scale, x.map(|own| own[i])));
        }
        let inputs = system.inputs;
        let input = input.map(|own| &own[..=inputs]);
        for i in 0..inputs {
            registers.set(system.input(i), input.map(|own| own[i]));
        }
        registers.set(0, input.map(|own| own[inputs]));
    }
}

impl Values<'_> {
    /// Writes `f̄` and the outputs at a group of points with these scaled states and inputs; the last input is the
    /// time.
    #[inline(always)]
    pub fn evaluate(
        &mut self,
        x: [&[f64]; LANES],
        input: [&[f64]; LANES],
        f: &mut [Lanes],
        outputs: &mut [Lanes],
    ) {
        let (model, tape) = (self.model, &self.model.tapes.values);
        model.set(&mut self.registers, x, input);
        tape.run(1, &mut self.registers);
        let (rates, own) = tape.outputs(0).split_at(model.tapes.n_states());
        for ((f, register), inverse) in f.iter_mut().zip(rates).zip(&model.inverse) {
            *f = scaled(*inverse, self.registers.get(*register));
        }
        let own = own.iter().zip(&model.output_factors);
        for (output, (register, factor)) in outputs.iter_mut().zip(own) {
            *output = scaled(*factor, self.registers.get(*register));
        }
    }
}

impl Derivatives<'_> {
    /// Evaluates the model at a group of points with these scaled states and inputs, the last of which is the time, and
    /// writes its outputs.
    #[inline(always)]
    pub fn evaluate(&mut self, x: [&[f64]; LANES], input: [&[f64]; LANES], outputs: &mut [Lanes]) {
        let tape = &self.model.tapes.derivatives;
        self.model.set(&mut self.registers, x, input);
        tape.run(1, &mut self.registers);
        let own = tape.outputs(0).iter().zip(&self.model.output_factors);
        for (output, (register, factor)) in outputs.iter_mut().zip(own) {
            *output = scaled(*factor, self.registers.get(*register));
        }
    }

    /// Writes `∂f̄/∂[x̄; θ̄]` at [`NodeModel::entries`].
    #[inline(always)]
    pub fn jacobian(&self, out: &mut [Lanes]) {
        let model = self.model;
        let own = &model.tapes.derivatives.outputs(0)[model.tapes.n_outputs()..];
        for ((out, register), scale) in out.iter_mut().zip(own).zip(&model.entry_scales) {
            *out = scaled(*scale, self.registers.get(*register));
        }
    }

    /// Writes the gradient of an output at its [`columns`](NodeModel::columns).
    #[inline(always)]
    pub fn gradient(&self, output: usize, out: &mut [Lanes]) {
        let model = self.model;
        let before: usize = model.tapes.columns[..output].iter().map(Vec::len).sum();
        let first = model.tapes.n_outputs() + model.entries.len() + before;
        let own = &model.tapes.derivatives.outputs(0)[first..];
        let scales = &model.gradient_scales[output];
        for ((out, register), scale) in out.iter_mut().zip(own).zip(scales) {
            *out = scaled(*scale, self.registers.get(*register));
        }
    }

    /// Writes the second derivatives of `Σ f_i f̄_i + Σ y_k output_k` with these weights at
    /// [`NodeModel::pairs`].
    #[inline(always)]
    pub fn second_order(&mut self, f: &[Lanes], outputs: &[Lanes], out: &mut [Lanes]) {
        let (model, tape) = (self.model, &self.model.tapes.derivatives);
        let first = model.tapes.system.variables();
        let n = model.tapes.n_states();
        for (k, (weight, inverse)) in f.iter().zip(&model.inverse).enumerate() {
            self.registers
                .set(first + k, times(*weight, [*inverse; LANES]));
        }
        for (k, (weight, factor)) in outputs.iter().zip(&model.output_factors).enumerate() {
            let weight = scaled(*factor, *weight);
            self.registers.set(first + n + k, weight);
        }
        tape.run(2, &mut self.registers);
        let own = out.iter_mut().zip(tape.outputs(1));
        for ((out, register), scale) in own.zip(&model.pair_scales) {
            *out = scaled(*scale, self.registers.get(*register));
        }
    }
}

/// Adds the derivatives of `ωᵀ f̄` over `[x̄; θ̄]` at a group of points to `out`, given the Jacobian's values at these
/// entries; `omega` returns the weights of a state derivative.
#[inline(always)]
pub fn pull_back(
    entries: &[(usize, usize)],
    jacobian: &[Lanes],
    omega: impl Fn(usize) -> Lanes,
    out: &mut [Lanes],
) {
    for (value, &(l, c)) in jacobian.iter().zip(entries) {
        out[c] = plus(out[c], omega(l), *value);
    }
}
