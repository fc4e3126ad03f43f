//! Values and derivatives of a model at many points, several at once.

use pilotage_collocation::node::NodeModel;
use pilotage_collocation::simd::{self, LANES, Lanes, Task};

/// Scaled states at points, and the inputs there, followed by the time.
#[derive(Debug, Clone)]
pub(crate) struct Points {
    states: usize,
    inputs: usize,
    x: Vec<f64>,
    given: Vec<f64>,
    pub count: usize,
}

impl Points {
    pub fn new(states: usize, inputs: usize) -> Self {
        Self {
            states,
            inputs,
            x: Vec::new(),
            given: Vec::new(),
            count: 0,
        }
    }

    /// Adds a point, with inputs of 0.
    pub fn push(&mut self, x: &[f64], u: impl Iterator<Item = f64>, time: f64) {
        self.x.extend_from_slice(x);
        self.x.extend(u);
        self.given.extend((0..self.inputs).map(|_| 0.0));
        self.given.push(time);
        self.count += 1;
    }

    fn x(&self, i: usize) -> &[f64] {
        &self.x[i * self.states..(i + 1) * self.states]
    }

    fn given(&self, i: usize) -> &[f64] {
        &self.given[i * (self.inputs + 1)..(i + 1) * (self.inputs + 1)]
    }
}

/// Derivatives at points: entries of the Jacobian, gradients of the outputs, and second derivatives of the weighted sum.
#[derive(Debug, Clone, Default)]
pub(crate) struct Derivatives {
    pub entries: Vec<f64>,
    /// All gradients, output after output.
    pub gradients: Vec<f64>,
    pub pairs: Vec<f64>,
}

/// Scaled rates and outputs at all points.
pub(crate) fn values_at(model: &NodeModel, theta: &[f64], at: &Points) -> (Vec<f64>, Vec<f64>) {
    simd::vectorised(Evaluate { model, theta, at })
}

/// Derivatives at all points, with the weights of rates and outputs at each.
pub(crate) fn derivatives_at(
    model: &NodeModel,
    theta: &[f64],
    at: &Points,
    weights: [&[f64]; 2],
) -> Derivatives {
    simd::vectorised(Differentiate {
        model,
        theta,
        at,
        weights,
    })
}

struct Evaluate<'a> {
    model: &'a NodeModel,
    theta: &'a [f64],
    at: &'a Points,
}

impl Task for Evaluate<'_> {
    type Output = (Vec<f64>, Vec<f64>);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, theta, at } = self;
        let (n, outputs) = (model.n_states(), model.n_outputs());
        let mut values = model.values(theta);
        let (mut f, mut y) = (vec![[0.0; LANES]; n], vec![[0.0; LANES]; outputs]);
        let mut all = (vec![0.0; at.count * n], vec![0.0; at.count * outputs]);
        for first in (0..at.count).step_by(LANES) {
            let (members, count) = simd::group(first, LANES, at.count);
            let [x, given] = [members.map(|i| at.x(i)), members.map(|i| at.given(i))];
            values.evaluate(x, given, &mut f, &mut y);
            for lane in 0..count {
                write(&f, lane, &mut all.0[(first + lane) * n..]);
                write(&y, lane, &mut all.1[(first + lane) * outputs..]);
            }
        }
        all
    }
}

#[inline(always)]
fn write(values: &[Lanes], lane: usize, out: &mut [f64]) {
    let own = out.iter_mut().zip(values);
    own.for_each(|(out, value)| *out = value[lane]);
}

struct Differentiate<'a> {
    model: &'a NodeModel,
    theta: &'a [f64],
    at: &'a Points,
    weights: [&'a [f64]; 2],
}

impl Task for Differentiate<'_> {
    type Output = Derivatives;

    #[inline(always)]
    fn run(self) -> Derivatives {
        let Self {
            model,
            theta,
            at,
            weights,
        } = self;
        let (n, outputs) = (model.n_states(), model.n_outputs());
        let widths: Vec<usize> = (0..outputs).map(|k| model.columns(k).len()).collect();
        let width: usize = widths.iter().sum();
        let (entries, pairs) = (model.entries.len(), model.pairs.len());
        let mut derivatives = model.derivatives(theta);
        let sized = |count: usize| vec![[0.0; LANES]; count];
        let [mut y, mut jacobian, mut gradients, mut second] =
            [outputs, entries, width, pairs].map(sized);
        let [mut of_rates, mut of_outputs] = [n, outputs].map(sized);
        let mut all = Derivatives {
            entries: vec![0.0; at.count * entries],
            gradients: vec![0.0; at.count * width],
            pairs: vec![0.0; at.count * pairs],
        };
        for first in (0..at.count).step_by(LANES) {
            let (members, count) = simd::group(first, LANES, at.count);
            let [x, given] = [members.map(|i| at.x(i)), members.map(|i| at.given(i))];
            derivatives.evaluate(x, given, &mut y);
            derivatives.jacobian(&mut jacobian);
            let mut before = 0;
            for (k, width) in widths.iter().enumerate() {
                derivatives.gradient(k, &mut gradients[before..before + width]);
                before += width;
            }
            for (i, weight) in of_rates.iter_mut().enumerate() {
                *weight = members.map(|point| weights[0][point * n + i]);
            }
            for (i, weight) in of_outputs.iter_mut().enumerate() {
                *weight = members.map(|point| weights[1][point * outputs + i]);
            }
            derivatives.second_order(&of_rates, &of_outputs, &mut second);
            for lane in 0..count {
                let point = first + lane;
                write(&jacobian, lane, &mut all.entries[point * entries..]);
                write(&gradients, lane, &mut all.gradients[point * width..]);
                write(&second, lane, &mut all.pairs[point * pairs..]);
            }
        }
        all
    }
}
