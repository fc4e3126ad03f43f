//! The pilot of a problem alone: from each input to each output, linearised at the end of the first run.

use crate::posed::Posed;
use crate::result::loops::{Response, ends, instance, pilots};
use crate::result::opened::Opened;
use crate::search::solved::Solved;
use nalgebra::Complex;

/// Frequencies at which paths are compared \[rad/s\].
const LOOKED_AT: [f64; 3] = [0.3, 1.0, 5.0];
/// Negligible fraction of a response.
const NEGLIGIBLE: f64 = 1e-9;
const MINUS: &str = " − ";

/// The paths through the pilot of a problem, as functions of the shared parameters.
pub struct PilotPaths<'p> {
    opened: Opened<'p>,
    x: Vec<f64>,
    /// Number of the input and number of the signal for each path.
    pairs: Vec<[usize; 2]>,
    /// For each path, the name of the input, or of two inputs whose difference acts, and of the output.
    ends: Vec<[String; 2]>,
}

impl std::fmt::Debug for PilotPaths<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("PilotPaths").field(&self.ends).finish()
    }
}

impl<'p> PilotPaths<'p> {
    /// Linearised at the end of the first run. None if no instance is a pilot whose output closes a loop, or if none of
    /// its inputs has an effect.
    pub fn new(posed: &'p Posed<'p>, solved: &Solved) -> Option<Self> {
        let description = &posed.file.system;
        let wires = pilots(posed);
        let [pilot, _] = ends(description, &description.connections[*wires.first()?]);
        let (mut into, mut signals) = (Vec::new(), Vec::new());
        for (k, wire) in description.connections.iter().enumerate() {
            let [from, to] = ends(description, wire);
            if to == pilot {
                into.push(k);
            }
            if from == pilot && to != pilot && !signals.contains(&wire.from.value) {
                signals.push(wire.from.value.clone());
            }
        }
        let is_own = |name: &str| instance(description, name) == pilot;
        let opened = Opened::new(posed, &into, is_own, signals)?;
        let z = &solved.solution.iterate.z;
        let x = solved.problem.states_at_samples(z, 0).pop()?;
        let linear = opened.linear(&x, &solved.theta())?;
        // At three frequencies, since a response may vanish at one.
        let at = |[input, signal]: [usize; 2]| {
            LOOKED_AT.map(|omega| linear.transfer(signal, input, Complex::new(0.0, omega)))
        };
        let size = |[input, signal]: [usize; 2]| {
            let own = at([input, signal]);
            own.iter().map(|own| own.norm()).fold(0.0, f64::max)
        };
        let (mut pairs, mut ends): (Vec<[usize; 2]>, Vec<[String; 2]>) = Default::default();
        for signal in 0..opened.signals.len() {
            let begin = pairs.len();
            let all = (0..opened.inputs.len()).map(|input| size([input, signal]));
            let largest = all.filter(|size| size.is_finite()).fold(0.0, f64::max);
            for input in 0..opened.inputs.len() {
                let own = at([input, signal]);
                // Smaller responses are rounding errors.
                let is_there = size([input, signal]) > NEGLIGIBLE * largest;
                if own.iter().any(|own| !own.is_finite()) || !is_there {
                    continue;
                }
                // Two inputs that act by their difference, such as target and position by the error, are one path.
                let name = &opened.inputs[input];
                let opposite = pairs[begin..]
                    .iter()
                    .position(|pair| is_opposite(&at(*pair), &own));
                match opposite {
                    Some(k) if !ends[begin + k][0].contains(MINUS) => {
                        ends[begin + k][0] += &format!("{MINUS}{name}");
                    }
                    _ => {
                        pairs.push([input, signal]);
                        ends.push([name.clone(), opened.signals[signal].clone()]);
                    }
                }
            }
        }
        (!pairs.is_empty()).then_some(Self {
            opened,
            x,
            pairs,
            ends,
        })
    }

    /// For each path, the name of the input, or of two inputs whose difference acts, and of the output.
    pub fn ends(&self) -> &[[String; 2]] {
        &self.ends
    }

    /// The responses with these shared parameters, at the same states. None if the pilot cannot be linearised there.
    pub fn with(&self, theta: &[f64]) -> Option<Vec<Response>> {
        let linear = self.opened.linear(&self.x, theta)?;
        let of = |[input, signal]: &[usize; 2]| -> Response {
            let (own, input, signal) = (linear.clone(), *input, *signal);
            Box::new(move |omega| own.transfer(signal, input, Complex::new(0.0, omega)))
        };
        Some(self.pairs.iter().map(of).collect())
    }
}

fn is_opposite(a: &[Complex<f64>], b: &[Complex<f64>]) -> bool {
    let mut pairs = a.iter().zip(b);
    pairs.all(|(a, b)| (a + b).norm() <= NEGLIGIBLE * a.norm())
}
