//! First and second derivatives at one θ: what all points share is set up once.

use super::jet::Jet;
use super::{Linear, MAX_SIZE, NodeModel, Numbers, Output, PARTS, Quadratic, Values, Weights};
use crate::lanes::{LANES, Lanes, plus, scaled, side_by_side};
use pilotage_models::Dynamics;

/// The model's derivatives at one θ, at the group of points that was evaluated last.
#[derive(Debug)]
pub struct Derivatives<'m, D> {
    model: &'m NodeModel<D>,
    /// States of the points, scaled.
    x: [Lanes; MAX_SIZE],
    values: Values<'m, D>,
    /// The affine part's constants with θ's terms: Jacobian, gradients of the outputs.
    affine: [Vec<f64>; 3],
    linear: Vec<Evaluated<Linear>>,
    quadratic: Vec<Evaluated<Quadratic>>,
    /// Columns of the Jacobian that are not affine, and where their derivatives stand.
    columns: Vec<(usize, Source)>,
    /// The same of each output's gradient, by the place among its columns.
    outputs: [Vec<(usize, Source)>; 2],
    /// True when the outputs have derivatives that are not affine.
    with_outputs: bool,
}

/// The model in some number type.
#[derive(Debug)]
pub(super) struct Evaluated<T> {
    pub at: Numbers<T>,
    /// Measured and bounded.
    pub outputs: [T; 2],
}

/// First derivatives by one variable: which evaluation has them, as which part.
#[derive(Debug, Clone, Copy)]
enum Source {
    Linear(usize, usize),
    Quadratic(usize, usize),
}

impl<D: Dynamics> NodeModel<D> {
    /// The derivatives at a scaled θ; those of second order only if `exact`.
    pub fn derivatives(&self, theta: &[f64], exact: bool) -> Derivatives<'_, D> {
        let mut out = Derivatives {
            model: self,
            x: [[0.0; LANES]; MAX_SIZE],
            values: self.values(theta),
            affine: std::array::from_fn(|k| self.affine.values[k].constants.clone()),
            linear: Vec::new(),
            quadratic: Vec::new(),
            columns: Vec::new(),
            outputs: [Vec::new(), Vec::new()],
            with_outputs: false,
        };
        for (own, values) in out.affine.iter_mut().zip(&self.affine.values) {
            for &(place, j, factor) in &values.parameters {
                own[place] += factor * theta[j];
            }
        }
        let mut known = Vec::new();
        if exact {
            for (k, group) in self.curved.iter().enumerate() {
                let at = self.jets(theta, &group.variables);
                out.quadratic.push(Evaluated::of(at));
                for (part, &j) in group.variables.iter().enumerate() {
                    if !known.contains(&j) {
                        known.push(j);
                        out.columns.push((j, Source::Quadratic(k, part)));
                    }
                }
            }
        }
        let others = self.affine.others.iter().copied();
        let rest: Vec<usize> = others.filter(|j| !known.contains(j)).collect();
        for (k, columns) in rest.chunks(PARTS).enumerate() {
            out.linear.push(Evaluated::of(self.jets(theta, columns)));
            let own = columns.iter().enumerate();
            (out.columns).extend(own.map(|(part, &j)| (j, Source::Linear(k, part))));
        }
        out.outputs = self.outputs.each_ref().map(|columns| {
            let place = |j: usize| columns.iter().position(|c| *c == j);
            let own = out.columns.iter();
            own.filter_map(|&(j, source)| Some((place(j)?, source)))
                .collect()
        });
        out.with_outputs = out.outputs.iter().any(|own| !own.is_empty());
        out
    }
}

impl<const N: usize, const M: usize> Evaluated<Jet<N, M>> {
    pub fn of(at: Numbers<Jet<N, M>>) -> Self {
        let outputs = [Jet::from(0.0); 2];
        Self { at, outputs }
    }

    /// Evaluates the model at the points of `values`.
    #[inline(always)]
    pub fn evaluate<D: Dynamics>(&mut self, values: &Values<'_, D>, with_outputs: bool) {
        let model = values.model;
        let states = self.at.x[..model.n_states()].iter_mut();
        let inputs = self.at.w.iter_mut().zip(&values.at.w);
        let pairs = states.zip(&values.at.x).chain(inputs);
        pairs.for_each(|(own, plain)| own.value = plain.value);
        model.evaluate(&mut self.at);
        if with_outputs {
            self.outputs = model.outputs_of(&self.at).into();
        }
    }
}

impl<D: Dynamics> Derivatives<'_, D> {
    /// Evaluates the model at a group of points with these scaled states and these inputs; returns the
    /// measured outputs and the bounded signals.
    #[inline(always)]
    pub fn evaluate(&mut self, x: [&[f64]; LANES], input: [&[f64]; LANES]) -> (Lanes, Lanes) {
        side_by_side(x, &mut self.x[..self.model.n_states()]);
        self.values.set(&self.x, input);
        for own in &mut self.linear {
            own.evaluate(&self.values, self.with_outputs);
        }
        for own in &mut self.quadratic {
            own.evaluate(&self.values, self.with_outputs);
        }
        self.values.outputs()
    }

    /// Writes `∂f̄/∂[x̄; θ̄]` at [`NodeModel::entries`].
    #[inline(always)]
    pub fn jacobian(&self, out: &mut [Lanes]) {
        let model = self.model;
        self.write_affine(0, out);
        for &(j, source) in &self.columns {
            let own = model.column_starts[j]..model.column_starts[j + 1];
            for (value, &(i, _)) in out[own.clone()].iter_mut().zip(&model.entries[own]) {
                let by = match source {
                    Source::Linear(k, part) => &self.linear[k].at.dx[i].first[part],
                    Source::Quadratic(k, part) => &self.quadratic[k].at.dx[i].first[part],
                };
                *value = scaled(model.inverse[i], *by);
            }
        }
    }

    /// Adds the derivatives of `omegaᵀ f̄` over `[x̄; θ̄]`, with the Jacobian's entries, to `out`.
    #[inline(always)]
    pub fn pull_back(&self, jacobian: &[Lanes], omega: &[Lanes], out: &mut [Lanes]) {
        for (value, &(l, c)) in jacobian.iter().zip(&self.model.entries) {
            out[c] = plus(out[c], omega[l], *value);
        }
    }

    /// Writes the gradient of an output at its [`columns`](NodeModel::columns).
    #[inline(always)]
    pub fn gradient(&self, output: Output, out: &mut [Lanes]) {
        let which = output as usize;
        self.write_affine(1 + which, out);
        for &(place, source) in &self.outputs[which] {
            out[place] = match source {
                Source::Linear(k, part) => self.linear[k].outputs[which].first[part],
                Source::Quadratic(k, part) => self.quadratic[k].outputs[which].first[part],
            };
        }
    }

    #[inline(always)]
    fn write_affine(&self, which: usize, out: &mut [Lanes]) {
        for (out, value) in out.iter_mut().zip(&self.affine[which]) {
            *out = [*value; LANES];
        }
        for &(place, j, factor) in &self.model.affine.values[which].states {
            out[place] = plus(out[place], [factor; LANES], self.x[j]);
        }
    }

    /// Writes the second derivatives of the weighted sum at [`NodeModel::pairs`] into `out`; zeros where
    /// they were not asked for.
    #[inline(always)]
    pub fn second_order(&self, weights: Weights<'_>, out: &mut [Lanes]) {
        let (model, n) = (self.model, self.model.n_states());
        out.fill([0.0; LANES]);
        for (pair, rows) in &model.constant {
            for &(row, v) in rows {
                let weight = match row.checked_sub(n) {
                    None => weights.f[row],
                    Some(0) => weights.measured,
                    Some(_) => weights.bounded,
                };
                out[*pair] = plus(out[*pair], weight, [v; LANES]);
            }
        }
        for (group, own) in model.curved.iter().zip(&self.quadratic) {
            for at in &group.pairs {
                for &row in &at.rows {
                    let (weight, jet) = match row.checked_sub(n) {
                        None => {
                            let weight = scaled(model.inverse[row], weights.f[row]);
                            (weight, &own.at.dx[row])
                        }
                        Some(0) => (weights.measured, &own.outputs[0]),
                        Some(_) => (weights.bounded, &own.outputs[1]),
                    };
                    out[at.pair] = plus(out[at.pair], weight, jet.second[at.place]);
                }
            }
        }
    }
}
