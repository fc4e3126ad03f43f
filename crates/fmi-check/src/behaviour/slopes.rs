//! Derivatives in co-simulation: those of outputs agree with the differences of these outputs, and those of inputs are used.

use super::subject::{Subject, is_double};
use super::{Reporter, Stop};
use pilotage_fmi::InterfaceType;
use pilotage_fmi::description::{Causality, ScalarVariable, Severity, Variability, VariableKind};
use pilotage_fmi::fmu::Library;

/// Differences of an output over two successive steps differ by at most this part where the steps resolve its motion.
const RESOLVED: f64 = 0.3;
/// A derivative is off if it differs from the mean of these differences by this part.
const OFF: f64 = 0.5;
/// Number of points from which on an output is judged, of which most must be off.
const FEWEST: usize = 3;

/// Outputs and their derivatives along a run.
pub(super) struct Slopes {
    names: Vec<String>,
    references: Vec<u32>,
    points: Vec<Point>,
}

struct Point {
    time: f64,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Slopes {
    /// The continuous real outputs, if the FMU gives derivatives.
    pub(super) fn of(subject: &Subject, kind: InterfaceType) -> Self {
        let cs = subject.description.co_simulation.as_ref();
        let is_there = kind == InterfaceType::CoSimulation
            && cs.is_some_and(|cs| cs.max_output_derivative_order > 0);
        let is_own = |v: &&ScalarVariable| {
            let is_output = v.causality == Causality::Output;
            is_there && is_output && v.variability == Variability::Continuous && is_double(v)
        };
        let outputs = || subject.description.variables.iter().filter(is_own);
        Self {
            names: outputs().map(|v| v.name.clone()).collect(),
            references: outputs().map(|v| v.value_reference).collect(),
            points: Vec::new(),
        }
    }

    /// Reads them after a step.
    pub(super) fn read(
        &mut self,
        subject: &mut Subject,
        reporter: &mut Reporter,
    ) -> Result<(), Stop> {
        if self.references.is_empty() {
            return Ok(());
        }
        reporter.stage("asking for the derivatives of the outputs");
        let count = self.references.len();
        let (mut values, mut slopes) = (vec![0.0; count], vec![0.0; count]);
        let instance = &mut subject.instance;
        instance.get_real(&self.references, &mut values)?;
        instance.get_output_derivatives(&self.references, &vec![1; count], &mut slopes)?;
        self.points.push(Point {
            time: subject.time(),
            values,
            slopes,
        });
        reporter.stage("stepping");
        Ok(())
    }

    /// Reports what is not finite, or does not agree.
    pub(super) fn compare(&self, reporter: &mut Reporter) {
        for (k, name) in self.names.iter().enumerate() {
            let slopes = || self.points.iter().map(move |own| (own.time, own.slopes[k]));
            if let Some((time, slope)) = slopes().find(|(_, slope)| !slope.is_finite()) {
                let what = format!("the derivative of `{name}` is {slope} at {time} s");
                // Importers that do not ask for it are not concerned.
                reporter.find(what, Severity::Warning, Some(name));
                continue;
            }
            let all: Vec<(f64, f64, f64)> = (self.points.windows(3))
                .filter_map(|points| differences(points, k))
                .collect();
            let off = all.iter().filter(|(_, slope, difference)| {
                (slope - difference).abs() > OFF * difference.abs()
            });
            let off: Vec<_> = off.collect();
            if all.len() >= FEWEST && 2 * off.len() > all.len() {
                let (time, slope, difference) = off[0];
                let what = format!(
                    "the derivative of `{name}` is {slope:.3e} at {time} s, and the output changes by {difference:.3e} per \
                     second there"
                );
                reporter.find(what, Severity::Warning, Some(name));
            }
        }
    }
}

impl Reporter<'_> {
    /// Whether derivatives of inputs have an effect on a step in which the inputs themselves have one (FMI 2.0.5, section 4.2.1).
    pub(super) fn input_slopes(&mut self, library: &Library) -> Result<(), Stop> {
        let description = self.description.clone();
        let takes =
            (description.co_simulation.as_ref()).is_some_and(|cs| cs.can_interpolate_inputs);
        if self.kind != InterfaceType::CoSimulation || !takes {
            return Ok(());
        }
        let is_free = |v: &ScalarVariable| match &v.kind {
            VariableKind::Real(real) => real.attributes.min.or(real.attributes.max).is_none(),
            _ => false,
        };
        let inputs: Vec<u32> = (description.variables.iter())
            .filter(|v| v.causality == Causality::Input && is_double(v) && is_free(v))
            .filter(|v| v.variability == Variability::Continuous)
            .map(|v| v.value_reference)
            .collect();
        if inputs.is_empty() {
            return Ok(());
        }
        let rest = self.stepped(library, &inputs, [0.0, 0.0])?;
        let moved = self.stepped(library, &inputs, [1.0, 0.0])?;
        let led = self.stepped(library, &inputs, [0.0, 1.0])?;
        if rest != moved && rest == led {
            self.warn(
                "it takes derivatives of its inputs, and a step is the same with them: importers that interpolate do so in vain"
                    .into(),
            );
        }
        Ok(())
    }

    /// The outputs after a step with other values of these inputs, and changes of these within the step.
    fn stepped(
        &mut self,
        library: &Library,
        inputs: &[u32],
        [by, change]: [f64; 2],
    ) -> Result<Vec<f64>, Stop> {
        let mut subject = Subject::start(library, "check", self)?;
        self.stage("changing inputs within a step");
        let mut values = vec![0.0; inputs.len()];
        let instance = &mut subject.instance;
        instance.get_real(inputs, &mut values)?;
        values.iter_mut().for_each(|value| *value += by);
        instance.set_real(inputs, &values)?;
        let orders = vec![1; inputs.len()];
        let slopes = vec![change / subject.plan.step; inputs.len()];
        subject
            .instance
            .set_input_derivatives(inputs, &orders, &slopes)?;
        subject.step(self)?;
        subject.outputs()
    }
}

/// Time of the middle one of three points, its derivative, and that by differences; `None` if the steps are too long for
/// these, or the derivative is 0, as it may be if the order of the solver is low (FMI 2.0.5, section 4.2.1).
fn differences(points: &[Point], k: usize) -> Option<(f64, f64, f64)> {
    let of = |a: &Point, b: &Point| (b.values[k] - a.values[k]) / (b.time - a.time);
    let (before, after) = (of(&points[0], &points[1]), of(&points[1], &points[2]));
    let largest = before.abs().max(after.abs());
    let slope = points[1].slopes[k];
    let is_resolved = (after - before).abs() <= RESOLVED * largest;
    // Beyond rounding.
    let step = points[2].time - points[0].time;
    let is_seen = largest * step > 1e-9 * points[1].values[k].abs();
    (is_resolved && is_seen && slope != 0.0).then_some((
        points[1].time,
        slope,
        0.5 * (before + after),
    ))
}
