//! The Jacobian of the limited quantities, or of the equations at the ends, row by row.

use crate::evaluation::Evaluator;
use crate::program::{Duration, Place, Program, Row};

/// An entry that is a number, and a row that is linear.
const NONE: usize = usize::MAX;

/// A sparse Jacobian, whose structure is found once.
#[derive(Debug)]
pub(crate) struct Jacobian {
    /// First entry of each row, and the number of all.
    starts: Vec<usize>,
    columns: Vec<usize>,
    /// Of each entry, the index among all gradients, in lanes, and a factor.
    sources: Vec<(usize, f64)>,
    values: Vec<f64>,
    /// Of each row, what is added to a linear quantity.
    constants: Vec<f64>,
    /// Of each row, the index among all outputs, in lanes.
    outputs: Vec<usize>,
}

impl Jacobian {
    pub fn new(evaluator: &Evaluator<'_>, program: &Program, rows: &[Row]) -> Self {
        let mut own = Self {
            starts: vec![0],
            columns: Vec::new(),
            sources: Vec::new(),
            values: Vec::new(),
            constants: vec![0.0; rows.len()],
            outputs: Vec::new(),
        };
        for (r, row) in rows.iter().enumerate() {
            own.constants[r] = own.add(evaluator, program, row.place);
            own.starts.push(own.columns.len());
            own.outputs
                .push(evaluator.output(row.place).unwrap_or(NONE));
        }
        own.values = own.sources.iter().map(|own| own.1).collect();
        own
    }

    /// Adds the entries of a row, and returns what its quantity has beside them.
    fn add(&mut self, evaluator: &Evaluator<'_>, program: &Program, place: Place) -> f64 {
        let (n, m) = (program.n(), program.m());
        let mut push = |column: usize, source: usize, factor: f64| {
            if factor != 0.0 {
                self.columns.push(column);
                self.sources.push((source, factor));
            }
        };
        let control = |node: usize, control: usize| program.node(node) + n + control;
        match place {
            Place::Control { node, control: c } => push(control(node, c), NONE, 1.0),
            Place::Parameter(k) => push(program.theta() + k, NONE, 1.0),
            Place::Rate {
                interval,
                control: c,
                falls,
            } => {
                push(control(interval, c), NONE, -1.0);
                push(control(interval + 1, c), NONE, 1.0);
                let size = program.allowance(interval, c, falls);
                match program.duration {
                    Duration::Number(seconds) => return -size * seconds,
                    Duration::Sought(k) => {
                        let scale = program.model.scales.parameters[k];
                        push(program.theta() + k, NONE, -size * scale);
                    }
                }
            }
            Place::Path { .. } | Place::Start(_) | Place::End(_) => {
                let (k, at) = match place {
                    Place::Path { point, .. } => (point / 3, point % 3),
                    Place::Start(_) => (0, 3),
                    _ => (program.intervals(), 3),
                };
                let (columns, first) = evaluator.gradient(place).expect("an output");
                for (index, q) in columns.iter().enumerate() {
                    let source = first + index * pilotage_collocation::simd::LANES;
                    match (q.checked_sub(n + m), q.checked_sub(n)) {
                        (Some(parameter), _) => push(program.theta() + parameter, source, 1.0),
                        (None, Some(_)) if at == 3 => push(program.node(k) + q, source, 1.0),
                        (None, Some(c)) => {
                            let (first, second) = program.weights(c, at);
                            push(control(k, c), source, first);
                            push(control(k + 1, c), source, second);
                        }
                        (None, None) => {
                            let x = match at {
                                0 | 3 => program.node(k),
                                1 => program.middle(k),
                                _ => program.node(k + 1),
                            };
                            push(x + q, source, 1.0);
                        }
                    }
                }
            }
        }
        0.0
    }

    /// Takes the values of these gradients.
    pub fn update(&mut self, gradients: &[f64]) {
        for (own, (source, factor)) in self.values.iter_mut().zip(&self.sources) {
            if *source != NONE {
                *own = factor * gradients[*source];
            }
        }
    }

    /// Columns and values of a row.
    pub fn row(&self, r: usize) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let own = self.starts[r]..self.starts[r + 1];
        let columns = self.columns[own.clone()].iter().copied();
        columns.zip(self.values[own].iter().copied())
    }

    /// The product of a row.
    pub fn times(&self, r: usize, d: &[f64]) -> f64 {
        self.row(r).map(|(column, value)| value * d[column]).sum()
    }

    /// Adds `weight` times a row to `out`.
    pub fn add_row(&self, r: usize, weight: f64, out: &mut [f64]) {
        self.row(r)
            .for_each(|(column, value)| out[column] += weight * value);
    }

    /// The quantity of a row, with all outputs at a point and its variables.
    pub fn value(&self, r: usize, outputs: &[f64], z: &[f64]) -> f64 {
        match self.outputs[r] {
            NONE => self.constants[r] + self.times(r, z),
            output => outputs[output],
        }
    }

    /// Scatters a value of each row to its output.
    pub fn scatter(&self, values: impl Iterator<Item = f64>, outputs: &mut [f64]) {
        for (output, value) in self.outputs.iter().zip(values) {
            if *output != NONE {
                outputs[*output] += value;
            }
        }
    }
}
