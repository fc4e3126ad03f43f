//! Starts from the data: parameters with which the measured parts of a system need the least correction.
//!
//! A loop with wrong parameters leaves its recordings at once, so that their fit has many local optima. Instances without
//! sought parameters, such as a known vehicle, are therefore corrected by what was measured of them,
//! `ẋ = f(x, u; θ) + K (y(t) - h(x))`, with the steady gain of a Kalman filter whose noise drives their wired inputs (R. E.
//! Kalman and R. S. Bucy, "New results in linear filtering and prediction theory", J. Basic Eng. 83, 1961). The corrected
//! vehicle stays beside its recording, a pilot in the loop with it sees what it saw in the run, and its parameters are those
//! that predict the next movement best. States and unknowns are those of the problem itself, so that an optimum of one is a
//! start of the other (Ljung, *System Identification*, 2nd ed., section 7.3: models with and without noise in the loop).

use crate::posed::data::filled;
use crate::posed::{Posed, variables};
use crate::search::begin::initial;
use crate::search::starts::given;
use nalgebra::{DMatrix, DVector};
use pilotage_collocation::{Collocation, Differentiated, Run, is_rough, stays_long};
use pilotage_expression::{Node, System};
use std::ops::Range;
use std::sync::Arc;

/// Error of a sample of a measured signal, relative to how far the signal moves: the larger, the less is corrected. With close
/// corrections the pilot's own noise, which has gone round the loop, is taken for its answer (Ljung, section 13.4), and where
/// that noise is a third of what he does, his parameters are too far off to lead back.
const ERROR: f64 = 2.0;

/// Noise of each state relative to its size in the whole run. It only keeps the gain defined for states that no input moves.
const FLOOR: f64 = 1e-4;

/// A system with corrected instances.
#[derive(Debug)]
pub struct Observed {
    /// The equations. The recordings that correct are inputs after the others.
    model: Arc<Differentiated>,
    /// Whether only rough meshes stand for the runs, on which its fits lead less far.
    pub is_rough: bool,
    /// For each run, these recordings at its samples.
    recorded: Vec<Vec<Vec<f64>>>,
}

impl Observed {
    /// The corrected system; None if no instance can be corrected, or if its fits could not be on a coarse mesh: they would
    /// cost as much as the search itself.
    pub fn new(posed: &Posed<'_>) -> Option<Self> {
        let is_rough = posed.runs.iter().any(is_rough);
        if is_rough && posed.runs.iter().any(stays_long) {
            return None;
        }
        let point = Point::new(posed);
        let mut first = 0;
        let mut gains: Vec<Gain> = Vec::new();
        for (name, part) in &posed.joint.parts {
            let states = first..first + part.model.states.len();
            first = states.end;
            gains.extend(point.gains(name, states));
        }
        if gains.is_empty() {
            return None;
        }
        let recorded = gains.iter().map(|own| {
            let runs = posed
                .runs
                .iter()
                .zip(&posed.quantities.recorded[own.measured]);
            runs.map(|(run, values)| filled(&run.time, values))
                .collect()
        });
        Some(Self {
            model: Arc::new(Differentiated::new(&corrected(posed, &gains))),
            recorded: recorded.collect(),
            is_rough,
        })
    }

    /// A problem of these runs with the corrected equations, which has the same variables.
    pub fn of(&self, problem: &Collocation, runs: &[usize]) -> Collocation {
        let with_recordings = |(j, run): (&usize, &Run)| {
            let mut run = run.clone();
            for own in &self.recorded {
                let pairs = run.inputs.iter_mut().zip(&own[*j]);
                pairs.for_each(|(inputs, value)| inputs.push(*value));
            }
            run
        };
        let runs = runs.iter().zip(&problem.runs).map(with_recordings);
        problem.with_equations(self.model.clone(), runs.collect())
    }
}

/// Correction of some states by a measured signal.
struct Gain {
    measured: usize,
    states: Range<usize>,
    gain: DVector<f64>,
}

/// The equations with these corrections.
fn corrected(posed: &Posed<'_>, gains: &[Gain]) -> System {
    let system = &posed.model.system;
    let mut own = System {
        inputs: system.inputs + gains.len(),
        ..system.clone()
    };
    let first = 1 + system.states + system.inputs;
    let place = |k: usize| if k < first { k } else { k + gains.len() };
    let all: Vec<Node> = (0..own.variables())
        .map(|k| own.graph.variable(k))
        .collect();
    let variables: Vec<Node> = (0..system.variables()).map(|k| all[place(k)]).collect();
    let mut import = |nodes: &[Node]| own.graph.import(&system.graph, nodes, &variables);
    let mut derivatives = import(&system.derivatives);
    let outputs = import(&system.outputs);
    let predicted = import(&posed.quantities.predicted);
    for (k, correction) in gains.iter().enumerate() {
        let recorded = all[first + k];
        let error = own.graph.subtract(recorded, predicted[correction.measured]);
        for (state, gain) in correction.states.clone().zip(&correction.gain) {
            let part = own.graph.scale(*gain, error);
            derivatives[state] = own.graph.add(derivatives[state], part);
        }
    }
    System {
        derivatives,
        outputs,
        ..own
    }
}

/// Where a search begins: the point at which instances are linearised.
struct Point<'p, 'f> {
    posed: &'p Posed<'f>,
    /// Variables of the equations, and of the joint model.
    all: Vec<f64>,
    joint: Vec<f64>,
}

impl<'p, 'f> Point<'p, 'f> {
    fn new(posed: &'p Posed<'f>) -> Self {
        let start = given(posed);
        let (theta, own) = start.parameters.split_at(posed.shared);
        let all = variables(posed, 0, 0, &initial(posed, own, 0), theta);
        let values = posed.model.system.graph.values(&all);
        let joint = posed.quantities.joint.iter();
        let joint = joint.map(|node| values[node.index()]).collect();
        Self { posed, all, joint }
    }

    /// The corrections of an instance with these states. None where it has sought parameters, no wired input, or no recording.
    fn gains(&self, name: &str, states: Range<usize>) -> Vec<Gain> {
        self.linear(name, &states)
            .and_then(|linear| linear.gains(states))
            .unwrap_or_default()
    }

    /// Whether parameters of an instance are sought.
    fn is_sought(&self, name: &str) -> bool {
        let joint = &self.posed.joint.model;
        let system = &self.posed.model.system;
        let first = joint.system.parameter(0);
        let varies = system.graph.dependants(|variable| {
            let is_state = (1..=system.states).contains(&variable);
            is_state || variable >= system.parameter(0)
        });
        let mut parameters = joint
            .parameters
            .iter()
            .zip(&self.posed.quantities.joint[first..]);
        parameters.any(|(own, node)| {
            let is_own = own
                .strip_prefix(name)
                .is_some_and(|rest| rest.starts_with('.'));
            is_own && varies[node.index()]
        })
    }

    fn linear(&self, name: &str, states: &Range<usize>) -> Option<Linear> {
        let posed = self.posed;
        let (_, part) = posed.joint.parts.iter().find(|(own, _)| own == name)?;
        let joint = &posed.joint;
        let system = &part.model.system;
        let is_wired = |input: &&usize| {
            joint
                .driven
                .contains_key(&format!("{name}.{}", part.model.inputs[**input]))
        };
        let all: Vec<usize> = (0..part.model.inputs.len()).collect();
        let wired: Vec<usize> = all.iter().filter(is_wired).copied().collect();
        if part.fmu.is_some() || states.is_empty() || wired.is_empty() || self.is_sought(name) {
            return None;
        }
        // The instance alone, at its own variables.
        let values = joint.model.system.graph.values(&self.joint);
        let input = |own: &String| {
            let node = joint.signal(&format!("{name}.{own}"));
            node.map_or(0.0, |node| values[node.index()])
        };
        let first = joint.model.system.parameter(0);
        let parameter = |own: &String| {
            let full = format!("{name}.{own}");
            let place = joint.model.parameters.iter().position(|own| *own == full);
            place.map_or(0.0, |place| self.joint[first + place])
        };
        let mut at = vec![self.joint[0]];
        at.extend(&self.joint[1 + states.start..1 + states.end]);
        at.extend(part.model.inputs.iter().map(input));
        at.extend(part.model.parameters.iter().map(parameter));
        let columns = |variables: Vec<usize>| {
            let mut graph = system.graph.clone();
            let derivatives = variables
                .iter()
                .map(|v| graph.derivatives(&system.derivatives, *v));
            let columns: Vec<Vec<Node>> = derivatives.collect();
            let values = graph.values(&at);
            DMatrix::from_fn(states.len(), columns.len(), |i, j| {
                values[columns[j][i].index()]
            })
        };
        let a = columns((0..states.len()).map(|k| system.state(k)).collect());
        let b = columns(wired.into_iter().map(|k| system.input(k)).collect());
        let seen = (0..posed.file.measured.len()).filter_map(|k| self.seen(k, states));
        Linear {
            sizes: states.clone().map(|k| self.size(k)).collect(),
            duration: self.duration(),
            step: self.duration() / (posed.runs[0].time.len() - 1) as f64,
            a,
            b,
            seen: seen.collect(),
        }
        .finite()
    }

    /// Duration of the first run \[s\].
    fn duration(&self) -> f64 {
        let time = &self.posed.runs[0].time;
        time[time.len() - 1] - time[0]
    }

    fn size(&self, state: usize) -> f64 {
        self.posed.states[state].nominal.unwrap_or(1.0)
    }

    /// A measured signal that these states alone determine: its gradient and the variance of its recordings.
    fn seen(&self, k: usize, states: &Range<usize>) -> Option<Seen> {
        let posed = self.posed;
        let system = &posed.model.system;
        let mut graph = system.graph.clone();
        let predicted = posed.quantities.predicted[k];
        let is_other = |variable: usize| {
            let own = 1 + states.start..1 + states.end;
            let is_state = (1..=system.states).contains(&variable);
            is_state && !own.contains(&variable) || variable >= system.parameter(0)
        };
        if graph.dependants(is_other)[predicted.index()] {
            return None;
        }
        let nodes: Vec<Node> = states
            .clone()
            .map(|k| graph.variable(system.state(k)))
            .collect();
        let gradient = graph.gradient(predicted, &nodes);
        let values = graph.values(&self.all);
        let row = gradient.iter().map(|node| values[node.index()]);
        let variances = posed.quantities.recorded[k].iter().map(|run| variance(run));
        let variances: Vec<f64> = variances.collect::<Option<_>>()?;
        let variance = variances.iter().sum::<f64>() / variances.len() as f64;
        let row = DVector::from_iterator(states.len(), row);
        (variance > 0.0 && row.iter().any(|own| *own != 0.0)).then_some(Seen {
            measured: k,
            row,
            variance,
        })
    }
}

/// Variance of a recording. None if it is empty.
fn variance(values: &[f64]) -> Option<f64> {
    let known: Vec<f64> = values.iter().copied().filter(|y| y.is_finite()).collect();
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    let squares = known.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    (!known.is_empty()).then(|| squares / known.len() as f64)
}

/// A measured signal of an instance.
struct Seen {
    measured: usize,
    row: DVector<f64>,
    variance: f64,
}

/// An instance by itself, `ẋ = a x + b w`, and what is measured of it.
struct Linear {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    seen: Vec<Seen>,
    sizes: Vec<f64>,
    duration: f64,
    step: f64,
}

impl Linear {
    fn finite(self) -> Option<Self> {
        let rows = self.seen.iter().flat_map(|own| own.row.iter());
        let mut all = self.a.iter().chain(self.b.iter()).chain(rows);
        let is_finite = all.all(|value| value.is_finite());
        (is_finite && !self.seen.is_empty() && self.duration > 0.0).then_some(self)
    }

    /// The steady gains with noise at the inputs that alone would move the signals as far as they move in a run.
    fn gains(mut self, states: Range<usize>) -> Option<Vec<Gain>> {
        // In units of the states' sizes.
        let n = self.sizes.len();
        for i in 0..n {
            for j in 0..n {
                self.a[(i, j)] *= self.sizes[j] / self.sizes[i];
            }
            self.b.row_mut(i).unscale_mut(self.sizes[i]);
            self.seen
                .iter_mut()
                .for_each(|own| own.row[i] *= self.sizes[i]);
        }
        let moved = self.moved();
        let density = self.seen.iter().filter_map(|own| {
            let most = (own.row.transpose() * &moved * &own.row)[(0, 0)];
            (most > 0.0).then(|| own.variance / most)
        });
        let density = density.fold(0.0, f64::max);
        if !(density > 0.0 && density.is_finite()) {
            return None;
        }
        let floor = FLOOR / self.duration;
        let noise =
            &self.b * self.b.transpose() * density + DMatrix::identity(n, n) * floor * floor;
        let mut information = DMatrix::zeros(n, n);
        let weight = |own: &Seen| 1.0 / (ERROR * ERROR * own.variance * self.step);
        for own in &self.seen {
            information += &own.row * own.row.transpose() * weight(own);
        }
        let covariance = steady(&self.a, &noise, &information)?;
        let gain = |own: &Seen| {
            let mut gain = &covariance * &own.row * weight(own);
            gain.iter_mut()
                .zip(&self.sizes)
                .for_each(|(own, size)| *own *= size);
            Gain {
                measured: own.measured,
                states: states.clone(),
                gain,
            }
        };
        let all: Vec<Gain> = self.seen.iter().map(gain).collect();
        all.iter()
            .all(|own| own.gain.iter().all(|g| g.is_finite()))
            .then_some(all)
    }

    /// Covariance of the states at the end of a run through white noise of density 1 at the inputs, by doubling.
    fn moved(&self) -> DMatrix<f64> {
        let n = self.sizes.len();
        let speed = self.a.norm().max(1.0 / self.duration);
        let doublings = (self.duration * speed * 100.0).log2().ceil().max(1.0);
        let h = self.duration / doublings.exp2();
        let mut transition = (&self.a * h).exp();
        let mut covariance = &self.b * self.b.transpose() * h;
        covariance = 0.5 * (&covariance + &transition * &covariance * transition.transpose());
        for _ in 0..doublings as usize {
            covariance += &transition * &covariance * transition.transpose();
            transition = &transition * &transition;
        }
        debug_assert_eq!(covariance.nrows(), n);
        covariance
    }
}

/// The solution P of `A P + P Aᵀ + Q - P S P = 0` with which `A - P S` is stable, by the sign of the Hamiltonian matrix (J. D.
/// Roberts, Int. J. Control 32, 1980).
fn steady(
    a: &DMatrix<f64>,
    noise: &DMatrix<f64>,
    information: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    const MOST: usize = 60;
    const SETTLED: f64 = 1e-12;
    let n = a.nrows();
    let mut sign = DMatrix::zeros(2 * n, 2 * n);
    sign.view_mut((0, 0), (n, n)).copy_from(&a.transpose());
    sign.view_mut((0, n), (n, n)).copy_from(&-information);
    sign.view_mut((n, 0), (n, n)).copy_from(&-noise);
    sign.view_mut((n, n), (n, n)).copy_from(&-a);
    for _ in 0..MOST {
        let inverse = sign.clone().try_inverse()?;
        // Scaled towards eigenvalues of size 1.
        let scale = (inverse.norm() / sign.norm()).sqrt();
        let next = 0.5 * (&sign * scale + inverse / scale);
        let change = (&next - &sign).norm();
        let is_settled = change <= SETTLED * next.norm();
        sign = next;
        if is_settled {
            break;
        }
    }
    let identity = DMatrix::<f64>::identity(n, n);
    let mut left = DMatrix::zeros(2 * n, n);
    left.view_mut((0, 0), (n, n))
        .copy_from(&sign.view((0, n), (n, n)));
    left.view_mut((n, 0), (n, n))
        .copy_from(&(sign.view((n, n), (n, n)) + &identity));
    let mut right = DMatrix::zeros(2 * n, n);
    right
        .view_mut((0, 0), (n, n))
        .copy_from(&-(sign.view((0, 0), (n, n)) + &identity));
    right
        .view_mut((n, 0), (n, n))
        .copy_from(&-sign.view((n, 0), (n, n)));
    let solution = left.svd(true, true).solve(&right, 1e-14).ok()?;
    Some(0.5 * (&solution + solution.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A double integrator with noise q at its input and noise r of its measured position has the gain `[√2 w, w²]` with `w⁴ =
    /// q/r`.
    #[test]
    fn the_gain_of_a_double_integrator_is_known() {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        let noise = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 16.0]);
        let information = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]);
        let covariance = steady(&a, &noise, &information).expect("a solution");
        let gain = [covariance[(0, 0)], covariance[(1, 0)]];
        assert!((gain[0] - 2.0 * 2_f64.sqrt()).abs() < 1e-9, "{gain:?}");
        assert!((gain[1] - 4.0).abs() < 1e-9, "{gain:?}");
    }
}
