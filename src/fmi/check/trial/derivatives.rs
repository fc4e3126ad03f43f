//! Directional derivatives against differences, and dependencies that the description does not declare.
//!
//! Both in initialization mode, where outputs follow inputs at once in both kinds of FMU.

use super::subject::{Subject, is_double};
use super::{Stop, Teller};
use crate::fmi::description::{Causality, Variability};
use crate::fmi::fmu::Library;

/// Relative size of the change of an input.
const CHANGE: f64 = 1e-4;

/// Largest relative difference between a derivative and a difference that is no fault.
const TOLERANCE: f64 = 1e-3;

/// A variable by its index in the description.
#[derive(Debug, Clone)]
struct Place {
    /// From 1.
    index: u32,
    reference: u32,
    name: String,
}

impl Teller<'_> {
    /// Compares the derivative of each output by each input.
    pub(super) fn derivatives(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::instantiate(library, "trial", self)?;
        subject.enter_initialization(self)?;
        let inputs = places(&subject, Causality::Input);
        let outputs = places(&subject, Causality::Output);
        for input in &inputs {
            self.stage(&format!("changing the input `{}`", input.name));
            let slopes = slopes(&mut subject, input, &outputs)?;
            for (output, slope) in outputs.iter().zip(&slopes) {
                self.undeclared(&subject, input, output, *slope);
            }
            if subject.facts.has_derivatives {
                self.stage(&format!("asking for derivatives by `{}`", input.name));
                self.compare_with(&mut subject, input, &outputs, &slopes)?;
            }
        }
        self.unknown_reference(&mut subject);
        Ok(())
    }

    /// An output that changes with an input must declare it.
    fn undeclared(&mut self, subject: &Subject, input: &Place, output: &Place, slope: Slope) {
        let structure = &subject.description.structure;
        let declared = (structure.initial_unknowns.iter().chain(&structure.outputs))
            .filter(|unknown| unknown.index == output.index)
            .all(|unknown| {
                (unknown.dependencies.as_ref()).is_none_or(|d| d.contains(&input.index))
            });
        if slope.value != 0.0 && slope.is_smooth && !declared {
            let (y, u) = (&output.name, &input.name);
            let what = format!(
                "`{y}` changes with `{u}` at once, which <ModelStructure> does not declare"
            );
            self.find(what, true, Some(y));
        }
    }

    fn compare_with(
        &mut self,
        subject: &mut Subject,
        input: &Place,
        outputs: &[Place],
        slopes: &[Slope],
    ) -> Result<(), Stop> {
        let unknowns: Vec<u32> = outputs.iter().map(|o| o.reference).collect();
        let mut found = vec![f64::NAN; unknowns.len()];
        let known = [input.reference];
        let instance = &mut subject.instance;
        instance.directional_derivative(&unknowns, &known, &[1.0], &mut found)?;
        for ((output, slope), found) in outputs.iter().zip(slopes).zip(found) {
            let difference = (found - slope.value).abs();
            let allowed = TOLERANCE * slope.value.abs().max(slope.scale);
            // Written so that NaN differs too.
            if slope.is_smooth && !(difference <= allowed) {
                let (y, u) = (&output.name, &input.name);
                let what = format!(
                    "the directional derivative of `{y}` by `{u}` is {found}, differences give {}",
                    slope.value
                );
                self.find(what, true, Some(y));
            }
        }
        Ok(())
    }
}

/// Scalar continuous reals of that causality.
fn places(subject: &Subject, causality: Causality) -> Vec<Place> {
    (1..)
        .zip(&subject.description.variables)
        .filter(|(_, v)| v.causality == causality && is_double(v))
        .filter(|(_, v)| v.variability == Variability::Continuous)
        .map(|(index, v)| Place {
            index,
            reference: v.value_reference,
            name: v.name.clone(),
        })
        .collect()
}

/// How an output changes with an input.
#[derive(Debug, Clone, Copy)]
struct Slope {
    /// By the smaller of two changes.
    value: f64,
    /// Both changes give the same.
    is_smooth: bool,
    /// Slopes below this are lost in rounding.
    scale: f64,
}

/// The slopes of the outputs by one input, which has its value again afterwards.
fn slopes(subject: &mut Subject, input: &Place, outputs: &[Place]) -> Result<Vec<Slope>, Stop> {
    let references: Vec<u32> = outputs.iter().map(|o| o.reference).collect();
    let known = [input.reference];
    let mut start = [0.0];
    subject.instance.get_real(&known, &mut start)?;
    let change = CHANGE * start[0].abs().max(1.0);
    let mut at = |value: f64| -> Result<Vec<f64>, Stop> {
        let mut values = vec![0.0; references.len()];
        subject.instance.set_real(&known, &[value])?;
        subject.instance.get_real(&references, &mut values)?;
        Ok(values)
    };
    let mut central = |change: f64| -> Result<Vec<f64>, Stop> {
        let (above, below) = (at(start[0] + change)?, at(start[0] - change)?);
        let slope = |(a, b): (f64, f64)| (a - b) / (2.0 * change);
        Ok(above.into_iter().zip(below).map(slope).collect())
    };
    let (coarse, fine) = (central(2.0 * change)?, central(change)?);
    let values = at(start[0])?;
    let slope = |((coarse, fine), value): ((f64, f64), f64)| {
        let scale = f64::EPSILON * value.abs().max(1.0) / change / TOLERANCE;
        Slope {
            value: fine,
            is_smooth: (coarse - fine).abs() <= TOLERANCE * fine.abs().max(scale),
            scale,
        }
    };
    Ok((coarse.into_iter().zip(fine).zip(values).map(slope)).collect())
}
