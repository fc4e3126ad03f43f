//! Compares directional derivatives with differences, and finds dependencies that the description does not declare.
//!
//! Derivatives by inputs are taken in initialization mode, where outputs depend directly on inputs in both kinds of
//! FMU; those by states in continuous-time mode.

use super::subject::{Subject, is_double};
use super::{Reporter, Stop};
use pilotage_abi::fmi2::Status;
use pilotage_fmi::description::{Causality, ScalarVariable, Severity, Variability, VariableKind};
use pilotage_fmi::fmu::Library;
use pilotage_fmi::{CallError, InterfaceType};
use pilotage_text::number::rounded;

/// Relative size of the change of a known.
const CHANGE: f64 = 1e-4;

/// Maximum accepted relative deviation of a derivative from a difference.
const TOLERANCE: f64 = 1e-3;

/// Relative difference of the one-sided slopes above which a point is a kink.
const KINK: f64 = 0.05;

/// What is changed, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Inputs in initialization mode.
    Initial,
    /// Inputs afterwards.
    Inputs,
    /// States in continuous-time mode.
    States,
}

/// A known or an unknown.
#[derive(Debug, Clone)]
struct Place {
    /// Index of the variable in the description, from 1.
    index: u32,
    reference: u32,
    name: String,
    /// Position among the states, for a state.
    state: Option<usize>,
    /// Smallest and largest value.
    range: [f64; 2],
}

impl Place {
    fn new((index, variable): (u32, &ScalarVariable)) -> Self {
        Self {
            index,
            reference: variable.value_reference,
            name: variable.name.clone(),
            state: None,
            range: match &variable.kind {
                VariableKind::Real(real) => [
                    real.attributes.min.unwrap_or(f64::NEG_INFINITY),
                    real.attributes.max.unwrap_or(f64::INFINITY),
                ],
                _ => [f64::NEG_INFINITY, f64::INFINITY],
            },
        }
    }
}

impl Reporter<'_> {
    /// Compares the derivative of each unknown by each known.
    pub(super) fn derivatives(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::instantiate(library, "check", self)?;
        subject.enter_initialization(self)?;
        let unknowns = unknowns(&subject, self.kind);
        let inputs = inputs(&subject);
        self.compare_by(&mut subject, &inputs, &unknowns, Phase::Initial)?;
        self.stage("leaving initialization mode");
        subject.instance.exit_initialization_mode()?;
        let initial: Vec<u32> = (subject.description.structure.initial_unknowns.iter())
            .map(|entry| entry.index)
            .collect();
        if subject.begin(self)? {
            // The others are known from the initialization.
            let is_open = |own: &&Place| initial.contains(&own.index);
            let open: Vec<Place> = unknowns.iter().filter(is_open).cloned().collect();
            self.compare_by(&mut subject, &inputs, &open, Phase::Inputs)?;
            if self.kind == InterfaceType::ModelExchange {
                let states = states(&subject);
                self.compare_by(&mut subject, &states, &unknowns, Phase::States)?;
            }
        }
        self.unknown_reference(&mut subject);
        Ok(())
    }

    fn compare_by(
        &mut self,
        subject: &mut Subject,
        knowns: &[Place],
        unknowns: &[Place],
        phase: Phase,
    ) -> Result<(), Stop> {
        for known in knowns {
            self.stage(&format!("changing `{}`", known.name));
            let start = subject.value(known)?;
            let slopes = slopes(subject, known, unknowns)?;
            for (unknown, slope) in unknowns.iter().zip(&slopes) {
                self.undeclared(subject, known, unknown, *slope, phase);
            }
            // Between steps outputs may be those of the last one.
            if subject.facts.has_derivatives && phase != Phase::Inputs {
                self.stage(&format!("asking for derivatives by `{}`", known.name));
                self.compare_with(subject, known, unknowns, &slopes)?;
            }
            subject.set(known, start)?;
        }
        Ok(())
    }

    /// Reports a dependency that is not declared: in initialization mode among the initial unknowns, if the unknown is
    /// listed there, else among the outputs and derivatives (FMI 2.0.5, section 2.2.8).
    fn undeclared(
        &mut self,
        subject: &Subject,
        known: &Place,
        unknown: &Place,
        slope: Slope,
        phase: Phase,
    ) {
        // A state trivially depends on itself. Most slopes are zero, and need no search for what is declared.
        if slope.value == 0.0 || !slope.is_smooth || known.index == unknown.index {
            return;
        }
        let structure = &subject.description.structure;
        let mut initial = (structure.initial_unknowns.iter())
            .filter(|entry| phase == Phase::Initial && entry.index == unknown.index)
            .peekable();
        let is_initial = initial.peek().is_some();
        let running = (structure.outputs.iter().chain(&structure.derivatives))
            .filter(|entry| !is_initial && entry.index == unknown.index);
        let is_declared = initial.chain(running).all(|entry| {
            let names = entry.dependencies.as_ref();
            names.is_none_or(|names| names.contains(&known.index))
        });
        if !is_declared {
            let (y, u) = (&unknown.name, &known.name);
            let what = format!(
                "`{y}` changes with `{u}` at once, which <ModelStructure> does not declare"
            );
            self.find(what, Severity::Error, Some(y));
        }
    }

    fn compare_with(
        &mut self,
        subject: &mut Subject,
        known: &Place,
        unknowns: &[Place],
        slopes: &[Slope],
    ) -> Result<(), Stop> {
        let references: Vec<u32> = unknowns.iter().map(|o| o.reference).collect();
        let mut found = vec![f64::NAN; references.len()];
        let instance = &mut subject.instance;
        instance.directional_derivative(&references, &[known.reference], &[1.0], &mut found)?;
        for ((unknown, slope), found) in unknowns.iter().zip(slopes).zip(found) {
            let difference = (found - slope.value).abs();
            let allowed = TOLERANCE * slope.value.abs().max(slope.scale);
            let differs = difference.is_nan() || difference > allowed;
            // Solvers do not need the derivative of a state by itself, and some FMUs do not support it.
            let is_itself = unknown.index == known.index;
            if slope.is_smooth && differs && !is_itself {
                let (y, u) = (&unknown.name, &known.name);
                let what = format!(
                    "the directional derivative of `{y}` by `{u}` is {found}, differences give {}",
                    rounded(slope.value, 6)
                );
                self.find(what, Severity::Error, Some(y));
            }
        }
        Ok(())
    }
}

/// The description's variables with their indices from 1.
fn numbered(subject: &Subject) -> impl Iterator<Item = (u32, &ScalarVariable)> {
    (1..).zip(&subject.description.variables)
}

/// Scalar continuous real inputs.
fn inputs(subject: &Subject) -> Vec<Place> {
    numbered(subject)
        .filter(|(_, v)| v.causality == Causality::Input && is_double(v))
        .filter(|(_, v)| v.variability == Variability::Continuous)
        .map(Place::new)
        .collect()
}

/// The states, in the order of their derivatives; empty if any is an array.
fn states(subject: &Subject) -> Vec<Place> {
    let description = &subject.description;
    let at = |index: u32| {
        let variable = description
            .variables
            .get((index as usize).checked_sub(1)?)?;
        is_double(variable).then_some((index, variable))
    };
    let state = |(position, entry): (usize, &pilotage_fmi::description::Unknown)| {
        let (_, derivative) = at(entry.index)?;
        let VariableKind::Real(real) = &derivative.kind else {
            return None;
        };
        Some(Place {
            state: Some(position),
            ..Place::new(at(real.derivative?)?)
        })
    };
    let derivatives = description.structure.derivatives.iter().enumerate();
    derivatives
        .map(state)
        .collect::<Option<_>>()
        .unwrap_or_default()
}

/// Scalar continuous real outputs, and in model exchange the derivatives of the states.
fn unknowns(subject: &Subject, kind: InterfaceType) -> Vec<Place> {
    let derivatives = &subject.description.structure.derivatives;
    let is_derivative = |index: u32| {
        kind == InterfaceType::ModelExchange && derivatives.iter().any(|entry| entry.index == index)
    };
    numbered(subject)
        .filter(|(index, v)| v.causality == Causality::Output || is_derivative(*index))
        .filter(|(_, v)| is_double(v) && v.variability == Variability::Continuous)
        .map(Place::new)
        .collect()
}

/// Derivative of an unknown by a known.
#[derive(Debug, Clone, Copy)]
struct Slope {
    /// By the smaller of two changes.
    value: f64,
    /// Whether both changes give the same slope.
    is_smooth: bool,
    /// Slopes below this are lost in rounding errors.
    scale: f64,
}

/// The slopes of the unknowns by one known, at its value, or at one from which all changes stay in its range. It keeps that.
fn slopes(subject: &mut Subject, known: &Place, unknowns: &[Place]) -> Result<Vec<Slope>, Stop> {
    let references: Vec<u32> = unknowns.iter().map(|o| o.reference).collect();
    let start = subject.value(known)?;
    let change = CHANGE * start.abs().max(1.0);
    let [low, high] = [known.range[0] + 2.0 * change, known.range[1] - 2.0 * change];
    let start = if low <= high {
        start.clamp(low, high)
    } else {
        start
    };
    // Outside of its domain an FMU has no value, and may be evaluated again elsewhere (FMI 2.0.5, section 2.1.3).
    let is_discarded = |stop: &Stop| matches!(stop, Stop::Call(CallError::Failed { status, .. }) if *status == Status::DISCARD);
    let mut at = |value: f64| -> Result<Vec<f64>, Stop> {
        let mut values = vec![0.0; references.len()];
        let set = subject.set(known, value);
        let got = set.and_then(|()| Ok(subject.instance.get_real(&references, &mut values)?));
        match got {
            Err(stop) if is_discarded(&stop) => values.fill(f64::NAN),
            other => other?,
        }
        Ok(values)
    };
    let far = [at(start + 2.0 * change)?, at(start - 2.0 * change)?];
    let near = [at(start + change)?, at(start - change)?];
    let values = at(start)?;
    let slope = |k: usize| {
        let value = values[k];
        let scale = f64::EPSILON * value.abs().max(1.0) / change / TOLERANCE;
        let coarse = (far[0][k] - far[1][k]) / (4.0 * change);
        let fine = (near[0][k] - near[1][k]) / (2.0 * change);
        // At a kink, e.g. a knot of a table, the one-sided slopes differ.
        let sides = [near[0][k] - value, value - near[1][k]].map(|step| step / change);
        let kink = (sides[0] - sides[1]).abs() > KINK * fine.abs().max(sides[0].abs()).max(scale);
        Slope {
            value: fine,
            is_smooth: !kink && (coarse - fine).abs() <= TOLERANCE * fine.abs().max(scale),
            scale,
        }
    };
    Ok((0..references.len()).map(slope).collect())
}

impl Subject {
    fn value(&mut self, known: &Place) -> Result<f64, Stop> {
        if let Some(state) = known.state {
            let mut states = vec![0.0; self.instance.number_of_continuous_states()?];
            self.instance.get_continuous_states(&mut states)?;
            return Ok(states.get(state).copied().unwrap_or(f64::NAN));
        }
        let mut value = [0.0];
        self.instance.get_real(&[known.reference], &mut value)?;
        Ok(value[0])
    }

    fn set(&mut self, known: &Place, value: f64) -> Result<(), Stop> {
        let Some(state) = known.state else {
            return Ok(self.instance.set_real(&[known.reference], &[value])?);
        };
        let mut states = vec![0.0; self.instance.number_of_continuous_states()?];
        self.instance.get_continuous_states(&mut states)?;
        if let Some(place) = states.get_mut(state) {
            *place = value;
        }
        Ok(self.instance.set_continuous_states(&states)?)
    }
}
