//! A pilot as an actuator between command and rotor: a linear system for each axis, with a static gain of 1.

use crate::dense::{Lu, Matrix, dot};
use nalgebra::{DMatrix, DVector};
use pilotage_estimation::ProblemError;
use pilotage_estimation::system::part::Part;
use pilotage_inference::sample::square_root;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;

/// A linear system with one input and one output, `ẋ = A x + B c`, `y = C x + D c`.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// A, row by row.
    pub a: Vec<Vec<f64>>,
    /// B.
    pub b: Vec<f64>,
    /// C, divided by the static gain.
    pub c: Vec<f64>,
    /// D, divided by the static gain.
    pub d: f64,
    /// Static gain by which the output was divided.
    pub gain: f64,
}

/// The same pilot on both axes, or one for each.
#[derive(Debug, Clone, PartialEq)]
pub struct Pilot {
    /// Its name, for people.
    pub name: String,
    /// For `cz` and for `alpha`.
    pub axes: [Axis; 2],
}

/// Growth \[1/s\] from which a pole is unstable, beyond rounding.
const LEAST_GROWTH: f64 = 1e-9;
/// Largest gain at any frequency over the static one, of a pilot that can be an actuator.
const MOST_GAIN: f64 = 10.0;

impl Axis {
    /// With its static gain, `D - C A⁻¹ B`, divided out. None if it has none: it integrates, or its gain is 0.
    pub fn new(a: Vec<Vec<f64>>, b: Vec<f64>, c: Vec<f64>, d: f64) -> Option<Self> {
        const LEAST: f64 = 1e-9;
        let mut own = Self {
            a,
            b,
            c,
            d,
            gain: 1.0,
        };
        let rest = own.rest(1.0)?;
        let gain = dot(&own.c, &rest) + own.d;
        if !gain.is_finite() || gain.abs() < LEAST {
            return None;
        }
        own.c.iter_mut().for_each(|c| *c /= gain);
        own.d /= gain;
        own.gain = gain;
        Some(own)
    }

    /// The states at rest under a command.
    pub fn rest(&self, command: f64) -> Option<Vec<f64>> {
        let n = self.b.len();
        let mut matrix = Matrix::zeros(n, n);
        matrix.values = self.a.concat();
        let mut right = Matrix::zeros(n, 1);
        right.values = self.b.iter().map(|b| -b * command).collect();
        Lu::of(matrix)?.solve(&mut right);
        right
            .values
            .iter()
            .all(|x| x.is_finite())
            .then_some(right.values)
    }

    /// The output with these states under a command.
    pub fn output(&self, states: &[f64], command: f64) -> f64 {
        dot(&self.c, states) + self.d * command
    }

    /// Largest real part of a pole \[1/s\].
    pub fn growth(&self) -> f64 {
        let n = self.b.len();
        if n == 0 {
            return f64::NEG_INFINITY;
        }
        let poles = DMatrix::from_fn(n, n, |i, j| self.a[i][j]).complex_eigenvalues();
        poles
            .iter()
            .map(|own| own.re)
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The frequency \[rad/s\] and the gain where the latter is largest, from 0.01 to 100 rad/s. The static gain is 1.
    pub fn peak(&self) -> (f64, f64) {
        let n = self.b.len();
        let gain = |w: f64| {
            // (A - jω) x = -b, as a real system of twice the size.
            let mut matrix = Matrix::zeros(2 * n, 2 * n);
            let mut right = Matrix::zeros(2 * n, 1);
            for i in 0..n {
                for j in 0..n {
                    matrix[(i, j)] = self.a[i][j];
                    matrix[(n + i, n + j)] = self.a[i][j];
                }
                matrix[(i, n + i)] += w;
                matrix[(n + i, i)] -= w;
                right.values[i] = -self.b[i];
            }
            let Some(factors) = Lu::of(matrix) else {
                return f64::INFINITY;
            };
            factors.solve(&mut right);
            let (real, imaginary) = right.values.split_at(n);
            (dot(&self.c, real) + self.d).hypot(dot(&self.c, imaginary))
        };
        let all = (0..=80).map(|k| 0.01 * 10_f64.powf(f64::from(k) / 20.0));
        let all = all.map(|w| (w, gain(w)));
        all.fold(
            (0.0, 1.0),
            |most, own| if own.1 > most.1 { own } else { most },
        )
    }

    /// Butterworth's low pass of order 3 with this frequency \[rad/s\]: a stand-in, with a delay of 2/ω at low frequency.
    pub fn butterworth(frequency: f64) -> Self {
        let w = frequency;
        let a = vec![
            vec![0.0, w, 0.0],
            vec![0.0, 0.0, w],
            vec![-w, -2.0 * w, -2.0 * w],
        ];
        let own = Self::new(a, vec![0.0, 0.0, w], vec![1.0, 0.0, 0.0], 0.0);
        own.expect("its static gain is 1")
    }
}

impl Pilot {
    /// A model's linearisation where it begins, from `target` (or its only input) to `stick` (or its only output), and from
    /// `target2` to `stick2` for the second axis if it has these; what it sees of the vehicle's position stays 0, since the
    /// command takes its place.
    ///
    /// # Errors
    /// When there is no such input or output, or no static gain.
    pub fn of(part: &Part, name: &str) -> Result<Self, ProblemError> {
        let first = axis(part, name, ["target", "stick"])?;
        let has_second = part.model.inputs.iter().any(|own| own == "target2");
        let second = match has_second {
            true => axis(part, name, ["target2", "stick2"])?,
            false => first.clone(),
        };
        Ok(Self {
            name: name.to_owned(),
            axes: [first, second],
        })
    }

    /// Pilots whose parameters are drawn from the covariance that a fit left in the model file, around the fitted values; a
    /// draw beyond the parameters' limits, or that is no actuator, is drawn again. Draw `k` is the same whatever `count` is.
    /// None if the file has no covariance.
    ///
    /// # Errors
    /// When a draw's tries are all used up.
    pub fn drawn(part: &Part, name: &str, count: usize) -> Result<Option<Vec<Self>>, ProblemError> {
        const TRIES: usize = 100;
        let sure = part
            .file
            .as_ref()
            .and_then(|own| own.file.uncertainty.as_ref());
        let Some(sure) = sure else {
            return Ok(None);
        };
        let n = sure.covariance.len();
        let root = square_root(&DMatrix::from_fn(n, n, |i, j| sure.covariance[i][j]));
        let one = |k: usize| {
            let mut random = ChaCha8Rng::seed_from_u64(k as u64);
            for _ in 0..TRIES {
                let normal: Vec<f64> = (0..root.ncols())
                    .map(|_| StandardNormal.sample(&mut random))
                    .collect();
                let moved = &root * DVector::from_vec(normal);
                let mut other = part.clone();
                let is_inside = sure.parameters.iter().zip(&moved).all(|(name, by)| {
                    let Some(own) = other.variables.get_mut(name) else {
                        return true;
                    };
                    own.start += by;
                    own.min.is_none_or(|min| own.start >= min)
                        && own.max.is_none_or(|max| own.start <= max)
                });
                if let Some(found) = is_inside.then(|| Self::of(&other, name).ok()).flatten() {
                    return Ok(found);
                }
            }
            let words = format!(
                "{name}: in {TRIES} draws of its covariance there is no pilot between its parameters' limits"
            );
            Err(ProblemError::Part(words))
        };
        (0..count).map(one).collect::<Result<_, _>>().map(Some)
    }

    /// Its model file, at rest under these commands.
    pub(crate) fn resting(&self, commands: [f64; 2]) -> String {
        let mut starts = Vec::new();
        for ((axis, input), command) in self
            .axes
            .iter()
            .zip(super::helicopter::INPUTS)
            .zip(commands)
        {
            starts.push((format!("{input}_command"), command));
            let rest = axis.rest(command).unwrap_or_default();
            starts.extend(
                rest.into_iter()
                    .enumerate()
                    .map(|(k, x)| (format!("{input}_{k}"), x)),
            );
        }
        pilotage_language::with_starts(&self.text(), &starts)
    }

    /// Both axes as a model file, with the commands as inputs.
    pub(crate) fn text(&self) -> String {
        let mut text = String::from(
            "[model]\nname = \"hand\"\n[inputs]\ncz_command = {}\nalpha_command = {}\n[states]\n",
        );
        let mut outputs = String::from("[outputs]\n");
        for (axis, input) in self.axes.iter().zip(super::helicopter::INPUTS) {
            let sum = |factors: &[f64], last: f64| {
                let terms = factors
                    .iter()
                    .enumerate()
                    .filter(|(_, factor)| **factor != 0.0);
                let mut sum = terms.fold(String::new(), |mut sum, (k, factor)| {
                    let _ = write!(sum, "({factor:e}) * {input}_{k} + ");
                    sum
                });
                let _ = write!(sum, "({last:e}) * {input}_command");
                sum
            };
            for (k, row) in axis.a.iter().enumerate() {
                let _ = writeln!(
                    text,
                    "{input}_{k} = {{ der = \"{}\" }}",
                    sum(row, axis.b[k])
                );
            }
            let _ = writeln!(
                outputs,
                "{input} = {{ value = \"{}\" }}",
                sum(&axis.c, axis.d)
            );
        }
        text + &outputs
    }
}

fn axis(part: &Part, name: &str, [input, output]: [&str; 2]) -> Result<Axis, ProblemError> {
    let fault = |words: String| ProblemError::Part(format!("{name}: {words}"));
    let model = &part.model;
    let place = |all: &[String], wanted: &str, what: &str| {
        let found = all.iter().position(|own| own == wanted);
        let only = (all.len() == 1).then_some(0);
        let known = all.join(", ");
        found.or(only).ok_or_else(|| {
            fault(format!(
                "no {what} `{wanted}` for a pilot; there are {known}"
            ))
        })
    };
    let input = place(&model.inputs, input, "input")?;
    // What an output's name shares with a state is the state.
    let signals = [&model.outputs[..], &model.states].concat();
    let output = match model.outputs.len() {
        1 => 0,
        _ => place(&signals, output, "output")?,
    };
    let system = &model.system;
    let n = system.states;
    let mut graph = system.graph.clone();
    let mut rows = system.derivatives.clone();
    rows.push(match output.checked_sub(model.outputs.len()) {
        None => system.outputs[output],
        Some(state) => graph.variable(system.state(state)),
    });
    let start = |own: &String| part.variables.get(own).map_or(0.0, |about| about.start);
    let mut point = vec![0.0; 1 + n + system.inputs];
    point.extend(model.parameters.iter().map(start));
    let variables: Vec<_> = (0..system.variables()).map(|k| graph.variable(k)).collect();
    let starts = graph.import(&system.graph, &part.starts, &variables);
    let known = graph.values(&point);
    for (k, node) in starts.iter().enumerate() {
        point[1 + k] = known[node.index()];
    }
    let columns: Vec<Vec<_>> = (0..n)
        .map(|k| system.state(k))
        .chain([system.input(input)])
        .map(|variable| graph.derivatives(&rows, variable))
        .collect();
    let values = graph.values(&point);
    let at = |i: usize, j: usize| values[columns[j][i].index()];
    let a = (0..n).map(|i| (0..n).map(|j| at(i, j)).collect()).collect();
    let b = (0..n).map(|i| at(i, n)).collect();
    let c = (0..n).map(|j| at(n, j)).collect();
    let own = Axis::new(a, b, c, at(n, n)).ok_or_else(|| {
        fault("its linearisation has no static gain: it integrates, or its output does not follow its input".into())
    })?;
    let fastest = own.growth();
    if fastest > LEAST_GROWTH {
        return Err(fault(format!(
            "its linearisation is unstable: a pole at +{fastest:.3} 1/s; a pilot between command and rotor is stable by itself"
        )));
    }
    let (frequency, gain) = own.peak();
    match gain <= MOST_GAIN {
        true => Ok(own),
        false => Err(fault(format!(
            "its gain at {frequency:.2} rad/s is {gain:.0} times its static one: it resonates, or differentiates what it sees, as \
             for a vehicle that integrates several times, and is no actuator between command and rotor; identify it on a \
             vehicle that follows the stick, as `pilotage trials synth --vehicle integrator` has it"
        ))),
    }
}
