//! The terms of the objective: residuals of sensors, and priors.

use super::inputs::Key;
use super::{Assembly, Done};
use crate::posed::assembly::made::{Quantities, Stands};
use crate::posed::data::Rows;
use crate::posed::names::Of;
use crate::posed::unknowns::{Meaning, calibration};
use crate::problem::error::ProblemError;
use crate::problem::file::{Calibration, Deviation, Measured, Noise, Prior, Quantity};
use crate::system::joint::{Joint, unknown};
use pilotage_collocation::Loss;
use pilotage_expression::{Function, Node};

/// Half-width of the smoothing of Laplace's absolute value, in standard deviations.
const LAPLACE_SMOOTHING: f64 = 1e-3;

/// A term of the objective.
pub(super) struct Measurement {
    pub output: Node,
    pub loss: Loss,
    /// For each run, the values at its samples; NaN where there is no term.
    pub values: Vec<Vec<f64>>,
    /// Multiplied by the weight of the run, unless the term is a prior.
    pub weight: f64,
    pub is_prior: bool,
}

impl Assembly<'_> {
    /// The terms of all measured signals, over the signals and variables of the joint model.
    pub(super) fn measure(
        &mut self,
        signals: &[Node],
        joint: Vec<Node>,
        rows: &[Rows],
    ) -> Done<Quantities> {
        let mut quantities = Quantities {
            predicted: Vec::new(),
            deviations: Vec::new(),
            joint,
            tied: Vec::new(),
            derived: Vec::new(),
            seen: Vec::new(),
            recorded: Vec::new(),
        };
        for k in 0..self.file.measured.len() {
            let predicted = self.predicted(k, signals)?;
            let deviation = self.deviation(k, signals, predicted);
            let recorded = self.recorded(k, rows)?;
            self.check_deviation(k, deviation, &recorded, rows)?;
            let seen = self.add_residual(k, predicted, deviation, &recorded);
            quantities.seen.push(seen);
            quantities.predicted.push(predicted);
            quantities.deviations.push(deviation);
            quantities.recorded.push(recorded);
        }
        for name in &self.parameters.names {
            if let Meaning::Tied(_) = self.parameters.meanings[name] {
                quantities.tied.push((name.clone(), self.values[0][name]));
            }
        }
        let names = self.file.derived.iter().map(|(name, _)| &name.value);
        let of: Vec<Of> = names.clone().cloned().map(Of::Derived).collect();
        let values = self.values[0].clone();
        let nodes = self.expressions(&of, None, &values);
        quantities.derived = names.cloned().zip(nodes).collect();
        Ok(quantities)
    }

    /// Model output for a sensor.
    fn predicted(&mut self, k: usize, signals: &[Node]) -> Done<Node> {
        let measured = &self.file.measured[k];
        let zero = self.graph.constant(0.0);
        let plain = match &measured.of {
            Quantity::Signal(name) => {
                let place = self.named.signals.iter().position(|own| own == name);
                let place = place.ok_or_else(|| {
                    let fault = unknown("signal", name, &self.joint.measurable());
                    ProblemError::at(&measured.place, fault)
                })?;
                signals[place]
            }
            Quantity::Expression(..) => self.of_signals(&[Of::Measured(k)], signals, zero)[0],
        };
        let mut sensor = |what: &str, of: Of, calibrated: &Calibration| match calibrated {
            Calibration::Formula(_) => self.of_signals(&[of], signals, zero)[0],
            Calibration::Sought(_) | Calibration::Found(_) => {
                self.values[0][&calibration(what, &measured.column.value)]
            }
        };
        let gain = sensor("gain", Of::Gain(k), &measured.gain);
        let offset = sensor("offset", Of::Offset(k), &measured.offset);
        let scaled = self.graph.multiply(gain, plain);
        Ok(self.graph.add(scaled, offset))
    }

    /// Standard deviation of a sensor's noise.
    fn deviation(&mut self, k: usize, signals: &[Node], predicted: Node) -> Node {
        match &self.file.measured[k].sd {
            Deviation::Formula(_) => self.of_signals(&[Of::Deviation(k)], signals, predicted)[0],
            Deviation::Column(_) => self.input_node(&Key::Deviation(k)).expect("it was found"),
        }
    }

    /// Recorded values at each run's samples.
    fn recorded(&self, k: usize, rows: &[Rows]) -> Done<Vec<Vec<f64>>> {
        let measured = &self.file.measured[k];
        let name = &measured.column;
        let unit = measured.unit(self.joint);
        let mut all = Vec::new();
        for (run, rows) in self.data.iter().zip(rows) {
            let column = run.column(name, unit)?;
            let value = |row: &Option<usize>| row.map_or(f64::NAN, |row| column[row]);
            let values: Vec<f64> = rows.rows.iter().map(value).collect();
            let low = values.iter().position(|value| *value <= 0.0);
            if let (Noise::LogNormal, Some(sample)) = (measured.noise, low) {
                let fault = format!(
                    "{}: the column `{}` is {} at {} s, and log-normal noise has values above 0",
                    run.line.file.display(),
                    name.value,
                    values[sample],
                    rows.time[sample]
                );
                return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
            }
            all.push(values);
        }
        match all.iter().flatten().any(|value| value.is_finite()) {
            true => Ok(all),
            false => {
                let fault = format!("the column `{}` has no number in any run", name.value);
                Err(ProblemError::maybe_at(name.place.as_ref(), fault))
            }
        }
    }

    /// Adds the negative log-likelihood of a recording. Returns the input that holds the recorded value, if there is
    /// one.
    fn add_residual(
        &mut self,
        k: usize,
        predicted: Node,
        deviation: Node,
        recorded: &[Vec<f64>],
    ) -> Option<usize> {
        if let (false, Some(sd)) = (self.is_scaled(k), self.graph.value(deviation)) {
            self.recordings.push(Measurement {
                output: predicted,
                loss: Loss::Square,
                values: recorded.to_vec(),
                weight: sd.powi(-2),
                is_prior: false,
            });
            return None;
        }
        let [residual, deviation] = self.scaled_residual(k, predicted, deviation);
        let there = |value: &f64| if value.is_finite() { 0.0 } else { f64::NAN };
        let of_run = |own: &Vec<f64>| own.iter().map(there).collect();
        let values: Vec<Vec<f64>> = recorded.iter().map(of_run).collect();
        let term = |output, loss| Measurement {
            output,
            loss,
            values: values.clone(),
            weight: 1.0,
            is_prior: false,
        };
        let loss = loss(self.file.measured[k].noise);
        self.recordings.push(term(residual, loss));
        // A recorded level is the same at every iterate.
        let inputs = self.input_variables();
        if self.depends(deviation, |variable| !inputs.contains(&variable)) {
            let log = self.graph.unary(Function::Ln, deviation);
            let twice = self.graph.scale(2.0, log);
            self.recordings.push(term(twice, Loss::Linear));
        }
        self.sources
            .iter()
            .position(|(key, _)| *key == Key::Recorded(k))
    }

    /// The residual in standard deviations, and the standard deviation.
    fn scaled_residual(&mut self, k: usize, predicted: Node, deviation: Node) -> [Node; 2] {
        let mut seen = self.input_node(&Key::Recorded(k)).expect("it was found");
        // Where nothing was recorded both may be zero, and an infinite residual would not count as missing.
        let is_there = self.input_node(&Key::Presence(k)).expect("it was found");
        let one = self.graph.constant(1.0);
        let mut expected = self.graph.select(is_there, predicted, one);
        let deviation = self.graph.select(is_there, deviation, one);
        if self.file.measured[k].noise == Noise::LogNormal {
            seen = self.graph.unary(Function::Ln, seen);
            expected = self.graph.unary(Function::Ln, expected);
        }
        let difference = self.graph.subtract(expected, seen);
        [self.graph.divide(difference, deviation), deviation]
    }

    /// Adds the residuals of priors, once for each value.
    pub(super) fn expect_priors(&mut self, rows: &[Rows]) {
        let parameters = self.parameters;
        for (k, unknown) in parameters.unknowns.iter().enumerate() {
            let Some(prior) = unknown.prior else { continue };
            let is_state = matches!(self.stands[k], Stands::State(_));
            let data = self.data;
            let is_there = |j: usize| match is_state {
                true => !data[j].line.is_set(&unknown.name),
                false => j == 0,
            };
            for variable in self.stands[k].variables(self.first_shared()) {
                let variable = self.graph.variable(variable);
                let output = match (unknown.log, prior.log) {
                    (true, false) => self.graph.unary(Function::Exp, variable),
                    (false, true) => self.graph.unary(Function::Ln, variable),
                    _ => variable,
                };
                self.expect(output, prior, rows, is_there);
            }
        }
    }

    /// Adds a term at the start of some runs.
    pub(super) fn expect(
        &mut self,
        output: Node,
        prior: Prior,
        rows: &[Rows],
        is_there: impl Fn(usize) -> bool,
    ) {
        let values = rows.iter().enumerate().map(|(j, rows)| {
            let mut values = vec![f64::NAN; rows.time.len()];
            if is_there(j) {
                values[0] = prior.mean;
            }
            values
        });
        self.recordings.push(Measurement {
            output,
            loss: Loss::Square,
            values: values.collect(),
            weight: prior.sd.powi(-2),
            is_prior: true,
        });
    }
}

/// Loss of residuals in standard deviations.
fn loss(noise: Noise) -> Loss {
    match noise {
        Noise::Normal | Noise::LogNormal => Loss::Square,
        Noise::Laplace => Loss::Absolute {
            smoothing: LAPLACE_SMOOTHING,
        },
        Noise::Student(dof) => Loss::Student { dof },
        Noise::Huber(threshold) => Loss::Huber { threshold },
    }
}

impl Measured {
    /// Whether the sensor has neither gain nor offset.
    pub(crate) fn is_plain(&self) -> bool {
        let is = |calibrated: &Calibration, value: f64| matches!(calibrated, Calibration::Formula(formula) if formula.number() == Some(value));
        is(&self.gain, 1.0) && is(&self.offset, 0.0)
    }

    /// Name of the unit of the measured quantity, if it has one.
    pub(crate) fn unit<'u>(&'u self, joint: &'u Joint) -> Option<&'u str> {
        match &self.of {
            Quantity::Signal(name) => joint.unit(name),
            Quantity::Expression(_, unit) => unit.as_deref(),
        }
    }
}
