//! First and second derivatives at one θ: what all points share is set up once.

use super::{BLOCK, Dual, HyperDual, MAX_SIZE, NodeModel, Numbers, Output, PARTS, Values, Weights};
use nalgebra::SMatrix;
use pilotage_models::Dynamics;

/// The model's derivatives at one θ, at the point that was evaluated last.
#[derive(Debug)]
pub struct Derivatives<'m, D> {
    model: &'m NodeModel<D>,
    /// States of the point, scaled.
    x: [f64; MAX_SIZE],
    values: Values<'m, D>,
    /// The affine part's constants with θ's terms: Jacobian, gradients of the outputs.
    affine: [Vec<f64>; 3],
    duals: Vec<Evaluated<Dual>>,
    hyper: Vec<Evaluated<HyperDual>>,
    /// Columns of the Jacobian that are not affine, and where their derivatives stand.
    columns: Vec<(usize, Source)>,
    /// The same of each output's gradient, by the place among its columns.
    outputs: [Vec<(usize, Source)>; 2],
    /// True when the outputs have derivatives that are not affine.
    with_outputs: bool,
}

/// The model in some number type.
#[derive(Debug)]
struct Evaluated<T> {
    at: Numbers<T>,
    measured: T,
    bounded: T,
}

#[derive(Debug, Clone, Copy)]
enum Source {
    /// Part of one of the dual numbers.
    Dual(usize, usize),
    /// First part of one of the hyper-dual numbers.
    Hyper(usize, usize),
}

impl<D: Dynamics> NodeModel<D> {
    /// The derivatives at a scaled θ; those of second order only if `exact`.
    pub fn derivatives(&self, theta: &[f64], exact: bool) -> Derivatives<'_, D> {
        let mut out = Derivatives {
            model: self,
            x: [0.0; MAX_SIZE],
            values: self.values(theta),
            affine: std::array::from_fn(|k| self.affine.values[k].constants.clone()),
            duals: Vec::new(),
            hyper: Vec::new(),
            columns: Vec::new(),
            outputs: [Vec::new(), Vec::new()],
            with_outputs: false,
        };
        for (own, values) in out.affine.iter_mut().zip(&self.affine.values) {
            for &(place, j, factor) in &values.parameters {
                own[place] += factor * theta[j];
            }
        }
        if exact {
            for (k, block) in self.curved_blocks.iter().enumerate() {
                out.hyper.push(Evaluated::of(
                    self.hyper_duals(theta, (block.rows, block.columns)),
                ));
                if block.rows == block.columns {
                    let members = self.block(block.rows).iter().enumerate();
                    (out.columns).extend(members.map(|(part, &j)| (j, Source::Hyper(k, part))));
                }
            }
        }
        let known: Vec<usize> = out.columns.iter().map(|(j, _)| *j).collect();
        let others = self.affine.others.iter().copied();
        let rest: Vec<usize> = others.filter(|j| !known.contains(j)).collect();
        for (k, columns) in rest.chunks(PARTS).enumerate() {
            out.duals.push(Evaluated::of(self.duals(theta, columns)));
            let own = columns.iter().enumerate();
            (out.columns).extend(own.map(|(part, &j)| (j, Source::Dual(k, part))));
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

impl<T: pilotage_models::Scalar> Evaluated<T> {
    fn of(at: Numbers<T>) -> Self {
        let zero = T::from(0.0);
        Self {
            at,
            measured: zero,
            bounded: zero,
        }
    }

    fn evaluate<D: Dynamics>(&mut self, model: &NodeModel<D>, input: &[f64], with_outputs: bool) {
        model.evaluate(&mut self.at, input);
        if with_outputs {
            (self.measured, self.bounded) = model.outputs_of(&self.at, input);
        }
    }
}

impl<D: Dynamics> Derivatives<'_, D> {
    /// Evaluates the model at a point with scaled states `x`; returns the measured output and the bounded
    /// signal.
    pub fn evaluate(&mut self, x: &[f64], input: &[f64]) -> (f64, f64) {
        let model = self.model;
        self.x[..x.len()].copy_from_slice(x);
        self.values.set(x);
        let unscaled = &self.values.at.x[..x.len()];
        let with_outputs = self.with_outputs;
        for own in &mut self.duals {
            let states = own.at.x.iter_mut().zip(unscaled);
            states.for_each(|(x, v)| x.re = *v);
            own.evaluate(model, input, with_outputs);
        }
        for own in &mut self.hyper {
            let states = own.at.x.iter_mut().zip(unscaled);
            states.for_each(|(x, v)| x.re = *v);
            own.evaluate(model, input, with_outputs);
        }
        model.outputs_of(&self.values.at, input)
    }

    /// Writes `∂f̄/∂[x̄; θ̄]` at [`NodeModel::entries`].
    pub fn jacobian(&self, out: &mut [f64]) {
        let model = self.model;
        self.write_affine(0, out);
        for &(j, source) in &self.columns {
            let own = model.column_starts[j]..model.column_starts[j + 1];
            for (value, &(i, _)) in out[own.clone()].iter_mut().zip(&model.entries[own]) {
                *value = model.inverse[i]
                    * match source {
                        Source::Dual(k, part) => first(&self.duals[k].at.dx[i], part),
                        Source::Hyper(k, part) => first_of_two(&self.hyper[k].at.dx[i], part),
                    };
            }
        }
    }

    /// Adds the derivatives of `omegaᵀ f̄` over `[x̄; θ̄]`, with the Jacobian's entries, to `out`.
    pub fn pull_back(&self, jacobian: &[f64], omega: &[f64], out: &mut [f64]) {
        let model = self.model;
        for (column, out) in model.column_starts.windows(2).zip(out) {
            let own = column[0]..column[1];
            let entries = model.entries[own.clone()].iter().zip(&jacobian[own]);
            *out += entries.map(|((l, _), v)| omega[*l] * v).sum::<f64>();
        }
    }

    /// Writes the gradient of an output at its [`columns`](NodeModel::columns).
    pub fn gradient(&self, output: Output, out: &mut [f64]) {
        self.write_affine(1 + output as usize, out);
        for &(place, source) in &self.outputs[output as usize] {
            out[place] = match (source, output) {
                (Source::Dual(k, part), Output::Measured) => first(&self.duals[k].measured, part),
                (Source::Dual(k, part), Output::Bounded) => first(&self.duals[k].bounded, part),
                (Source::Hyper(k, part), Output::Measured) => {
                    first_of_two(&self.hyper[k].measured, part)
                }
                (Source::Hyper(k, part), Output::Bounded) => {
                    first_of_two(&self.hyper[k].bounded, part)
                }
            };
        }
    }

    fn write_affine(&self, which: usize, out: &mut [f64]) {
        out.copy_from_slice(&self.affine[which]);
        for &(place, j, factor) in &self.model.affine.values[which].states {
            out[place] += factor * self.x[j];
        }
    }

    /// Writes the second derivatives of the weighted sum at [`NodeModel::pairs`] into `out`; zeros where
    /// they were not asked for.
    pub fn second_order(&self, weights: Weights<'_>, out: &mut [f64]) {
        let (model, n) = (self.model, self.model.n_states());
        out.fill(0.0);
        let weight = |row: usize| match row.checked_sub(n) {
            None => weights.f[row],
            Some(0) => weights.measured,
            Some(_) => weights.bounded,
        };
        for (pair, rows) in &model.constant {
            out[*pair] = rows.iter().map(|&(row, v)| v * weight(row)).sum();
        }
        for (block, own) in model.curved_blocks.iter().zip(&self.hyper) {
            for at in &block.pairs {
                let term = |row: &usize| match row.checked_sub(n) {
                    None => {
                        weights.f[*row] * model.inverse[*row] * second(&own.at.dx[*row], at.i, at.j)
                    }
                    Some(0) => weights.measured * second(&own.measured, at.i, at.j),
                    Some(_) => weights.bounded * second(&own.bounded, at.i, at.j),
                };
                out[at.pair] = at.rows.iter().map(term).sum();
            }
        }
    }
}

fn first(value: &Dual, part: usize) -> f64 {
    value.eps.0.map_or(0.0, |parts| parts[part])
}

fn first_of_two(value: &HyperDual, part: usize) -> f64 {
    value.eps1.0.map_or(0.0, |parts| parts[part])
}

pub(super) fn second(value: &HyperDual, i: usize, j: usize) -> f64 {
    let parts: Option<SMatrix<f64, BLOCK, BLOCK>> = value.eps1eps2.0;
    parts.map_or(0.0, |parts| parts[(i, j)])
}
