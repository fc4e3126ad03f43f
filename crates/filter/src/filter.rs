//! Extended Kalman filter: mean and covariance between samples, innovations at samples.

use crate::jet::{Jet, Number};
use crate::matrix::{Matrix, dot};
use crate::solve::solved;
use crate::transition::Transition;
use num_dual::DualSVec64;
use pilotage_expression::{Graph, Node, Tape};

/// Number of derivatives that one pass of the filter computes. Both variants, with none and with this many, are
/// compiled in this crate, which is optimised, not in the calling crate.
pub const SLOPES: usize = 4;

/// Number of cached transitions: samples have only a few different distances.
const KEPT: usize = 4;

/// A system with process noise, as expressions over time, filtered states and the remaining variables.
#[derive(Debug, Clone, Copy)]
pub struct Equations<'a> {
    /// The expressions.
    pub graph: &'a Graph,
    /// Number of its variables.
    pub variables: usize,
    /// Derivatives of the filtered states, which are the first variables after time.
    pub derivatives: &'a [Node],
    /// For each white noise, its contribution to these derivatives per unit, and its density.
    pub noises: &'a [(Vec<Node>, Node)],
    /// For each measured signal, its predicted value and the standard deviation of its noise.
    pub outputs: &'a [(Node, Node)],
}

/// The filter of a system.
#[derive(Debug, Clone)]
pub struct Filter {
    states: usize,
    variables: usize,
    /// Derivatives.
    drift: Tape,
    /// Jacobian of the derivatives with respect to the states, by rows, and the density of all noises together.
    linear: Tape,
    /// Signals, variances of their noise, and Jacobian of the signals with respect to the states.
    measure: Tape,
    /// Whether derivatives and noises are affine in the states.
    is_affine: bool,
}

/// A recorded run.
#[derive(Debug, Clone, Copy)]
pub struct Record<'a> {
    /// Times of the samples, ascending; rows with equal times are processed one after another.
    pub time: &'a [f64],
    /// Inputs at each sample; between two times they are linear from the last row of the first time to the first row of
    /// the second.
    pub inputs: &'a [Vec<f64>],
    /// Values of each signal at the samples, NaN where there is none; infinite ones are missing too.
    pub measured: &'a [Vec<f64>],
}

/// Innovation of a measured value.
#[derive(Debug, Clone, Copy)]
pub struct Innovation<const N: usize> {
    /// Index of the signal.
    pub signal: usize,
    /// Index of the sample.
    pub sample: usize,
    /// Measured value minus its prediction from all values before it, including other signals of the same sample.
    pub error: Jet<N>,
    /// Its variance.
    pub variance: Jet<N>,
}

impl<const N: usize> Innovation<N> {
    /// `ln s + e²/s`, −2 log likelihood up to its constant.
    pub fn surprise(&self) -> f64 {
        let (e, s) = (self.error.value, self.variance.value);
        s.ln() + e * e / s
    }

    /// `e/√s`.
    pub fn standardised(&self) -> f64 {
        self.error.value / self.variance.value.sqrt()
    }
}

/// A filtered run.
#[derive(Debug, Clone)]
pub struct Course<const N: usize> {
    /// Ordered by sample, then by signal.
    pub innovations: Vec<Innovation<N>>,
    /// For each signal, the prediction at each sample from the samples before it.
    pub predicted: Vec<Vec<f64>>,
}

/// Prediction of a value before it is measured.
struct Seen {
    signal: usize,
    sample: usize,
    /// From all values before it, including other signals of the same sample.
    expected: f64,
    variance: f64,
}

/// Current state of the filter within a run.
struct Place<'a, const N: usize> {
    /// All variables; the states are set before each evaluation.
    variables: Vec<Jet<N>>,
    record: &'a Record<'a>,
    /// Index of the first input among the variables.
    inputs: usize,
    mean: Vec<Jet<N>>,
    covariance: Matrix<N>,
    transitions: Vec<Transition<N>>,
}

impl Filter {
    /// The filter of a system.
    pub fn new(of: &Equations<'_>) -> Self {
        let mut graph = of.graph.clone();
        let n = of.derivatives.len();
        let is_whole = |(column, _): &(Vec<Node>, Node)| column.len() == n;
        assert!(of.noises.iter().all(is_whole), "columns of {n} states");
        let mut linear = jacobian(&mut graph, of.derivatives, n);
        for i in 0..n {
            for j in 0..n {
                let terms = of
                    .noises
                    .iter()
                    .map(|(column, q)| (column[i], column[j], *q));
                let mut sum = graph.constant(0.0);
                for (a, b, q) in terms {
                    let product = graph.multiply(a, b);
                    let term = graph.multiply(product, q);
                    sum = graph.add(sum, term);
                }
                linear.push(sum);
            }
        }
        let shown: Vec<Node> = of.outputs.iter().map(|(node, _)| *node).collect();
        let mut measure = shown.clone();
        measure.extend(of.outputs.iter().map(|(_, sd)| graph.multiply(*sd, *sd)));
        measure.extend(jacobian(&mut graph, &shown, n));
        let varies = graph.dependants(|variable| (1..=n).contains(&variable));
        let tape = |nodes: &[Node]| Tape::new(&graph, of.variables, |_| false, &[nodes]);
        Self {
            states: n,
            variables: of.variables,
            drift: tape(of.derivatives),
            linear: tape(&linear),
            measure: tape(&measure),
            is_affine: linear.iter().all(|node| !varies[node.index()]),
        }
    }

    /// Filters a run from a known initial state, which begins with the filtered states; `rest` holds the variables
    /// after the inputs. Each interval between samples is divided into `parts` steps; one suffices if the system is
    /// linear, for which the filter is exact.
    ///
    /// # Panics
    /// If the number of variables differs from that of the equations; if `parts` is 0; if the record's times are not
    /// ascending, or the numbers of its rows or signals differ from those of its times or of the equations.
    pub fn run(
        &self,
        record: &Record<'_>,
        initial: &[f64],
        rest: &[f64],
        parts: usize,
    ) -> Course<0> {
        let recorded = |at: &Seen| record.measured[at.signal][at.sample];
        let from = (&constants(initial)[..], &constants(rest)[..]);
        self.learning::<f64, 0>(record, from, parts, &mut &recorded)
    }

    /// The same with derivatives.
    ///
    /// # Panics
    /// As [`Filter::run`].
    pub fn differentiated(
        &self,
        record: &Record<'_>,
        initial: &[Jet<SLOPES>],
        rest: &[Jet<SLOPES>],
        parts: usize,
    ) -> Course<SLOPES> {
        let recorded = |at: &Seen| record.measured[at.signal][at.sample];
        self.learning::<DualSVec64<SLOPES>, SLOPES>(record, (initial, rest), parts, &mut &recorded)
    }

    /// Simulates a record with values at the same samples: each value is drawn from its prediction by the values before
    /// it, with a random number of unit variance. Missing values stay missing (NaN).
    ///
    /// # Panics
    /// As [`Filter::run`].
    pub fn simulated(
        &self,
        record: &Record<'_>,
        initial: &[f64],
        rest: &[f64],
        parts: usize,
        gauss: &mut dyn FnMut() -> f64,
    ) -> Vec<Vec<f64>> {
        let missing = record.measured.iter().map(|own| vec![f64::NAN; own.len()]);
        let mut drawn: Vec<Vec<f64>> = missing.collect();
        let mut draw = |at: &Seen| {
            let value = at.expected + at.variance.sqrt() * gauss();
            drawn[at.signal][at.sample] = value;
            value
        };
        let from = (&constants(initial)[..], &constants(rest)[..]);
        self.learning::<f64, 0>(record, from, parts, &mut draw);
        drawn
    }

    fn learning<T: Number<N>, const N: usize>(
        &self,
        record: &Record<'_>,
        (initial, rest): (&[Jet<N>], &[Jet<N>]),
        parts: usize,
        see: &mut dyn FnMut(&Seen) -> f64,
    ) -> Course<N> {
        assert!(parts > 0, "an interval between samples has a step at least");
        self.check(record);
        let mut place = Place::new(self, record, initial, rest);
        let mut found = Course {
            innovations: Vec::new(),
            predicted: vec![Vec::new(); record.measured.len()],
        };
        for sample in 0..record.time.len() {
            if sample > 0 && record.time[sample] > record.time[sample - 1] {
                self.predict::<T, N>(&mut place, sample, parts);
            }
            self.update::<T, N>(&mut place, sample, &mut found, see);
        }
        found
    }

    fn check(&self, record: &Record<'_>) {
        let samples = record.time.len();
        assert!(record.time.is_sorted_by(|a, b| a <= b), "ascending times");
        assert_eq!(
            record.inputs.len(),
            samples,
            "a row of inputs for each sample"
        );
        let inputs = record.inputs.first().map_or(0, Vec::len);
        assert!(
            record.inputs.iter().all(|row| row.len() == inputs),
            "rows of {inputs} inputs"
        );
        let signals = self.measure.outputs(0).len() / (2 + self.states);
        assert_eq!(record.measured.len(), signals, "the measured signals");
        let is_whole = |own: &Vec<f64>| own.len() == samples;
        assert!(
            record.measured.iter().all(is_whole),
            "a value for each sample"
        );
    }

    /// Propagates mean and covariance to a sample.
    fn predict<T: Number<N>, const N: usize>(
        &self,
        place: &mut Place<'_, N>,
        sample: usize,
        parts: usize,
    ) {
        let [from, to] = [sample - 1, sample].map(|k| place.record.time[k]);
        let h = (to - from) / parts as f64;
        for part in 0..parts {
            let at = |part: f64| part / parts as f64;
            let [begin, middle, end] = [0.0, 0.5, 1.0].map(|p| at(part as f64 + p));
            let about = self.midpoint::<T, N>(place, (sample, begin), h);
            let rates = [begin, end].map(|p| {
                place.set(sample, p, &about);
                computed::<T, N>(&self.drift, &place.variables)
            });
            place.set(sample, middle, &about);
            let linear = computed::<T, N>(&self.linear, &place.variables);
            place.step(&about, rates, &linear, h);
        }
    }

    /// Point of linearisation: the state after half the step by the implicit Euler method, which is stable for fast
    /// poles. It is irrelevant for affine equations.
    fn midpoint<T: Number<N>, const N: usize>(
        &self,
        place: &mut Place<'_, N>,
        (sample, part): (usize, f64),
        h: f64,
    ) -> Vec<Jet<N>> {
        let mean = place.mean.clone();
        if self.is_affine {
            return mean;
        }
        place.set(sample, part, &mean);
        let rates = computed::<T, N>(&self.drift, &place.variables);
        let linear = computed::<T, N>(&self.linear, &place.variables);
        let mut matrix = Matrix::identity(self.states);
        matrix.add(&square(&linear, self.states).scaled(-0.5 * h));
        let moves = solved(
            matrix,
            rates.iter().map(|own| own.scaled(0.5 * h)).collect(),
        );
        mean.iter().zip(moves).map(|(x, d)| *x + d).collect()
    }

    /// Updates with the values measured at a sample, signal by signal, each linearised at the prediction.
    fn update<T: Number<N>, const N: usize>(
        &self,
        place: &mut Place<'_, N>,
        sample: usize,
        found: &mut Course<N>,
        see: &mut dyn FnMut(&Seen) -> f64,
    ) {
        let (n, m) = (self.states, place.record.measured.len());
        let before = place.mean.clone();
        place.set(sample, 1.0, &before);
        let values = computed::<T, N>(&self.measure, &place.variables);
        let (shown, others) = values.split_at(m);
        let (variances, slopes) = others.split_at(m);
        for signal in 0..m {
            found.predicted[signal].push(shown[signal].value);
            if !place.record.measured[signal][sample].is_finite() {
                continue;
            }
            let slope = &slopes[signal * n..][..n];
            let moved = place.mean.iter().zip(&before).map(|(x, b)| *x - *b);
            let moved: Vec<Jet<N>> = moved.collect();
            let expected = shown[signal] + dot(slope, &moved);
            let variance = place.variance(slope) + variances[signal];
            let seen = see(&Seen {
                signal,
                sample,
                expected: expected.value,
                variance: variance.value,
            });
            let innovation = Innovation {
                signal,
                sample,
                error: Jet::constant(seen) - expected,
                variance,
            };
            place.learn(slope, &innovation);
            found.innovations.push(innovation);
        }
    }
}

impl<'a, const N: usize> Place<'a, N> {
    fn new(filter: &Filter, record: &'a Record<'a>, initial: &[Jet<N>], rest: &[Jet<N>]) -> Self {
        let mut variables = vec![Jet::constant(0.0)];
        variables.extend_from_slice(initial);
        let inputs = variables.len();
        let count = record.inputs.first().map_or(0, Vec::len);
        variables.extend(std::iter::repeat_n(Jet::constant(0.0), count));
        variables.extend_from_slice(rest);
        assert_eq!(variables.len(), filter.variables, "the filter's variables");
        Self {
            variables,
            record,
            inputs,
            mean: initial[..filter.states].to_vec(),
            covariance: Matrix::zeros(filter.states, filter.states),
            transitions: Vec::new(),
        }
    }

    /// Sets the variables at a fraction of the time since the previous sample, with these states.
    fn set(&mut self, sample: usize, part: f64, states: &[Jet<N>]) {
        let (time, inputs) = (self.record.time, self.record.inputs);
        let before = sample.saturating_sub(1);
        // Exact at the end, where a replicate may have other inputs.
        let between = |a: f64, b: f64| if part == 1.0 { b } else { a + part * (b - a) };
        self.variables[0] = Jet::constant(between(time[before], time[sample]));
        self.variables[1..=states.len()].copy_from_slice(states);
        let pairs = inputs[before].iter().zip(&inputs[sample]);
        for (own, (a, b)) in self.variables[self.inputs..].iter_mut().zip(pairs) {
            *own = Jet::constant(between(*a, *b));
        }
    }

    /// Propagates over a time `h`, linearised at `about`, with these derivatives there at the start and the end.
    fn step(&mut self, about: &[Jet<N>], rates: [Vec<Jet<N>>; 2], linear: &[Jet<N>], h: f64) {
        let n = about.len();
        let (f, q) = linear.split_at(n * n);
        let (f, q) = (square(f, n), square(q, n));
        let off = self.mean.iter().zip(about).map(|(x, a)| *x - *a);
        let off = f.apply(&off.collect::<Vec<_>>());
        let constant: Vec<Jet<N>> = rates[0].iter().zip(&off).map(|(r, o)| *r + *o).collect();
        let slope = rates[1].iter().zip(&rates[0]);
        let slope: Vec<Jet<N>> = slope.map(|(b, a)| (*b - *a).scaled(1.0 / h)).collect();
        let known = self.transition(f, q, h);
        let over = &self.transitions[known];
        let moves = over.constant.apply(&constant).into_iter();
        let moves = moves.zip(over.slope.apply(&slope));
        let moves: Vec<Jet<N>> = moves.map(|(a, b)| a + b).collect();
        let mut covariance = over.phi.around(&self.covariance);
        covariance.add(&over.noise);
        self.covariance = covariance;
        self.mean.iter_mut().zip(moves).for_each(|(x, d)| *x += d);
    }

    /// Index of the transition of a system over a time, computed or cached.
    fn transition(&mut self, f: Matrix<N>, q: Matrix<N>, h: f64) -> usize {
        let mut kept = self.transitions.iter();
        kept.position(|own| own.is_of(&f, &q, h))
            .unwrap_or_else(|| {
                self.transitions.truncate(KEPT - 1);
                self.transitions.insert(0, Transition::over(f, q, h));
                0
            })
    }

    /// Variance of a quantity with these derivatives with respect to the states.
    fn variance(&self, slope: &[Jet<N>]) -> Jet<N> {
        dot(&self.covariance.apply(slope), slope)
    }

    /// Updates mean and covariance with an innovation.
    fn learn(&mut self, slope: &[Jet<N>], of: &Innovation<N>) {
        let shared = self.covariance.apply(slope);
        let step = of.error / of.variance;
        let pairs = self.mean.iter_mut().zip(&shared);
        pairs.for_each(|(x, own)| *x += *own * step);
        self.covariance.subtract_square(&shared, of.variance);
    }
}

/// Jacobian of expressions with respect to the first variables after time, by rows.
fn jacobian(graph: &mut Graph, of: &[Node], states: usize) -> Vec<Node> {
    let columns: Vec<Vec<Node>> = (1..=states).map(|k| graph.derivatives(of, k)).collect();
    let row = |i: usize| columns.iter().map(move |column| column[i]);
    (0..of.len()).flat_map(row).collect()
}

/// The first entries as a square matrix, by rows.
fn square<const N: usize>(entries: &[Jet<N>], size: usize) -> Matrix<N> {
    let mut own = Matrix::zeros(size, size);
    for i in 0..size {
        (0..size).for_each(|j| *own.at(i, j) = entries[i * size + j]);
    }
    own
}

fn constants(values: &[f64]) -> Vec<Jet<0>> {
    values.iter().map(|own| Jet::constant(*own)).collect()
}

fn computed<T: Number<N>, const N: usize>(tape: &Tape, variables: &[Jet<N>]) -> Vec<Jet<N>> {
    let variables: Vec<T> = variables.iter().map(|own| T::of(*own)).collect();
    tape.evaluate(&variables).into_iter().map(T::jet).collect()
}
