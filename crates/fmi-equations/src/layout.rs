//! The variables of an FMU's description that make up the equations.

use crate::EquationsError;
use pilotage_fmi::description::{
    Causality, Initial, ModelDescription, Precision, RealAttributes, ScalarVariable, TypeKind,
    Unknown, Variability, VariableKind,
};
use std::collections::HashSet;
use std::ops::Range;

/// A variable of the equations.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    pub(crate) reference: u32,
    /// Index in the description, from 1.
    index: u32,
    /// Name of its unit.
    pub unit: Option<String>,
    /// Start value; for states that the FMU computes, the value after initialisation.
    pub start: f64,
    /// Minimum.
    pub min: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Whether the FMU computes the start value.
    pub(crate) is_computed: bool,
}

impl Variable {
    /// Minimum, negative infinity if none is declared.
    pub(crate) fn least(&self) -> f64 {
        self.min.unwrap_or(f64::NEG_INFINITY)
    }

    /// Maximum, infinity if none is declared.
    pub(crate) fn most(&self) -> f64 {
        self.max.unwrap_or(f64::INFINITY)
    }
}

/// The variables and their dependencies.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) states: Vec<Variable>,
    /// Value reference of each state's derivative.
    pub(crate) rates: Vec<u32>,
    pub(crate) inputs: Vec<Variable>,
    pub(crate) input_references: Vec<u32>,
    pub(crate) parameters: Vec<Variable>,
    /// Parameters of other types, each with its type.
    pub(crate) others: Vec<(String, String)>,
    /// Outputs that are not states, followed by the requested locals.
    pub(crate) outputs: Vec<Variable>,
    /// Names of all locals that may be requested.
    pub(crate) locals: Vec<String>,
    /// Value references of derivatives and outputs, excluding locals.
    pub(crate) unknown_references: Vec<u32>,
    pub(crate) output_references: Vec<u32>,
    pub(crate) indicators: usize,
    /// For each derivative, then each output, whether it depends on time, each state, each input.
    pub(crate) depends: Vec<Vec<bool>>,
    pub(crate) has_derivatives: bool,
}

impl Layout {
    /// Builds the layout of an FMU for model exchange, with these of its locals as outputs.
    pub(crate) fn new(
        description: &ModelDescription,
        wanted: &[String],
    ) -> Result<Self, EquationsError> {
        let me = description
            .model_exchange
            .as_ref()
            .ok_or(EquationsError::NoEquations)?;
        let units = description.units_of_variables();
        let about = |index: u32| about(description, index, &units);
        let mut own = Self {
            states: Vec::new(),
            rates: Vec::new(),
            inputs: Vec::new(),
            input_references: Vec::new(),
            parameters: Vec::new(),
            others: Vec::new(),
            outputs: Vec::new(),
            locals: Vec::new(),
            unknown_references: Vec::new(),
            output_references: Vec::new(),
            indicators: 0,
            depends: Vec::new(),
            has_derivatives: me.provides_directional_derivative,
        };
        let structure = &description.structure;
        let mut unknowns: Vec<Option<&Unknown>> = Vec::new();
        for unknown in &structure.derivatives {
            let (rate, state) = state_of(description, unknown.index)?;
            own.rates.push(rate);
            own.states.push(about(state));
            unknowns.push(Some(unknown));
        }
        for (index, variable) in (1..).zip(&description.variables) {
            if !is_number(variable) {
                if variable.causality == Causality::Parameter {
                    own.others.push((variable.name.clone(), type_of(variable)));
                }
                continue;
            }
            let is_continuous = variable.variability == Variability::Continuous;
            match variable.causality {
                Causality::Input if is_continuous => own.inputs.push(about(index)),
                Causality::Output if own.states.iter().all(|state| state.index != index) => {
                    own.outputs.push(about(index));
                    unknowns.push(structure.outputs.iter().find(|own| own.index == index));
                }
                Causality::Parameter if is_settable(variable) => own.parameters.push(about(index)),
                _ => {}
            }
        }
        let outputs = own.outputs.len();
        for (index, variable) in (1..).zip(&description.variables) {
            if !own.is_local(variable, index) {
                continue;
            }
            own.locals.push(variable.name.clone());
            if wanted.contains(&variable.name) {
                own.outputs.push(about(index));
                unknowns.push(None);
            }
        }
        if let Some(name) = wanted.iter().find(|name| !own.locals.contains(name)) {
            return Err(EquationsError::NoLocal { name: name.clone() });
        }
        own.check_names()?;
        own.check_states(description)?;
        own.input_references = own.inputs.iter().map(|input| input.reference).collect();
        own.output_references = own.outputs.iter().map(|output| output.reference).collect();
        own.unknown_references = [&own.rates[..], &own.output_references[..outputs]].concat();
        own.depends = unknowns
            .into_iter()
            .map(|unknown| own.listed(unknown))
            .collect();
        Ok(own)
    }

    /// Whether a variable is a continuous local that is neither a state nor the derivative of a state.
    fn is_local(&self, variable: &ScalarVariable, index: u32) -> bool {
        variable.causality == Causality::Local
            && variable.variability == Variability::Continuous
            && is_number(variable)
            && self.states.iter().all(|state| state.index != index)
            && !self.rates.contains(&variable.value_reference)
    }

    fn check_names(&self) -> Result<(), EquationsError> {
        let mut seen = HashSet::new();
        let all = [&self.states, &self.inputs, &self.parameters, &self.outputs];
        match all
            .into_iter()
            .flatten()
            .find(|own| !seen.insert(&own.name))
        {
            Some(own) => Err(EquationsError::Same {
                name: own.name.clone(),
            }),
            None => Ok(()),
        }
    }

    /// Rejects an FMU that lists no states although it has derivatives of variables: its states would be constants. The
    /// derivative of an input defines no state (FMI 2.0.4, section 2.2.7).
    fn check_states(&self, description: &ModelDescription) -> Result<(), EquationsError> {
        let variable = |index: u32| description.variables.get((index as usize).checked_sub(1)?);
        let unlisted = description.variables.iter().find_map(|own| {
            let VariableKind::Real(real) = &own.kind else {
                return None;
            };
            let state = variable(real.derivative?)?;
            (state.causality != Causality::Input).then_some((own, state))
        });
        match unlisted.filter(|_| self.states.is_empty()) {
            Some((derivative, state)) => Err(EquationsError::Unlisted {
                derivative: derivative.name.clone(),
                state: state.name.clone(),
            }),
            None => Ok(()),
        }
    }

    /// Whether an unknown depends on time, each state, each input; on all if no dependencies are listed.
    fn listed(&self, unknown: Option<&Unknown>) -> Vec<bool> {
        let listed = unknown.and_then(|unknown| unknown.dependencies.as_ref());
        let is_listed = |index: u32| listed.is_none_or(|listed| listed.contains(&index));
        let others = self.states.iter().chain(&self.inputs);
        let by_others = others.map(|own| is_listed(own.index));
        // Tools do not list the time.
        [true].into_iter().chain(by_others).collect()
    }

    /// Number of arguments: time, states, inputs, parameters.
    pub(crate) fn arguments(&self) -> usize {
        1 + self.states.len() + self.inputs.len() + self.parameters.len()
    }

    /// The arguments that are states.
    pub(crate) fn state_arguments(&self) -> Range<usize> {
        1..1 + self.states.len()
    }

    /// The arguments that are inputs.
    pub(crate) fn input_arguments(&self) -> Range<usize> {
        let first = 1 + self.states.len();
        first..first + self.inputs.len()
    }

    /// The arguments that are parameters.
    pub(crate) fn parameter_arguments(&self) -> Range<usize> {
        self.input_arguments().end..self.arguments()
    }

    /// The variable of an argument; `None` for time.
    pub(crate) fn argument(&self, place: usize) -> Option<&Variable> {
        let mut place = place.checked_sub(1)?;
        for own in [&self.states, &self.inputs, &self.parameters] {
            match place.checked_sub(own.len()) {
                None => return own.get(place),
                Some(rest) => place = rest,
            }
        }
        None
    }

    /// Number of derivatives and outputs.
    pub(crate) fn unknowns(&self) -> usize {
        self.rates.len() + self.outputs.len()
    }
}

impl Layout {
    /// States and the parameters that set their start values, which FMUs of pilotage call `STATE_start`, or `STATE.start` where the
    /// model has a `STATE_start` of its own.
    pub(crate) fn start_parameters(&self, description: &ModelDescription) -> Vec<(String, String)> {
        let tool = description.generation_tool.as_deref();
        if !tool.is_some_and(|tool| tool.starts_with("pilotage ")) {
            return Vec::new();
        }
        let states = self.states.iter().map(|state| &state.name);
        let is_there = |start: &String| self.parameters.iter().any(|own| own.name == *start);
        let named = |name: &String| {
            let names = [".start", "_start"].map(|end| format!("{name}{end}"));
            Some((name.clone(), names.into_iter().find(is_there)?))
        };
        states.filter_map(named).collect()
    }
}

/// Value reference of a listed derivative, and index of its state.
fn state_of(description: &ModelDescription, index: u32) -> Result<(u32, u32), EquationsError> {
    let variable = |index: u32| description.variables.get((index as usize).checked_sub(1)?);
    let derivative = variable(index).ok_or(EquationsError::Structure { index })?;
    let array = || EquationsError::Array {
        name: derivative.name.clone(),
    };
    let VariableKind::Real(real) = &derivative.kind else {
        return Err(array());
    };
    let state = real.derivative.ok_or_else(array)?;
    let is_scalar = |v: &ScalarVariable| v.dimensions.is_empty();
    let are_scalars = is_scalar(derivative) && variable(state).is_some_and(is_scalar);
    match are_scalars {
        true => Ok((derivative.value_reference, state)),
        false => Err(array()),
    }
}

fn about<'d>(
    description: &'d ModelDescription,
    index: u32,
    unit: &impl Fn(&'d ScalarVariable) -> Option<&'d str>,
) -> Variable {
    let variable = &description.variables[index as usize - 1];
    let VariableKind::Real(real) = &variable.kind else {
        unreachable!("only reals are asked for")
    };
    let declared = description
        .types
        .iter()
        .find_map(|declared| match &declared.kind {
            TypeKind::Real { attributes, .. }
                if Some(&declared.name) == real.declared_type.as_ref() =>
            {
                Some(attributes)
            }
            _ => None,
        });
    let of = |what: fn(&RealAttributes) -> Option<f64>| {
        what(&real.attributes).or_else(|| what(declared?))
    };
    Variable {
        name: variable.name.clone(),
        reference: variable.value_reference,
        index,
        unit: unit(variable).map(str::to_owned),
        start: real.start.first().copied().unwrap_or_default(),
        min: of(|own| own.min),
        max: of(|own| own.max),
        nominal: of(|own| own.nominal).map(f64::abs).filter(|own| *own > 0.0),
        is_computed: variable.effective_initial() != Some(Initial::Exact),
    }
}

/// Whether a variable is a double-precision scalar.
fn is_number(variable: &ScalarVariable) -> bool {
    let is_double = match &variable.kind {
        VariableKind::Real(real) => real.precision == Precision::Double,
        _ => false,
    };
    is_double && variable.dimensions.is_empty()
}

/// Name of the type of a variable that is not a double-precision scalar.
fn type_of(variable: &ScalarVariable) -> String {
    let kind = match &variable.kind {
        VariableKind::Real(real) if real.precision == Precision::Double => "Real",
        VariableKind::Real(_) => "Float32",
        VariableKind::Integer { .. } => "Integer",
        VariableKind::Boolean { .. } => "Boolean",
        VariableKind::Enumeration { .. } => "Enumeration",
        _ => "other than Real",
    };
    match variable.dimensions.is_empty() {
        true => kind.to_owned(),
        false => format!("array of {kind}"),
    }
}

fn is_settable(variable: &ScalarVariable) -> bool {
    let initial = variable.effective_initial();
    let changes = matches!(
        variable.variability,
        Variability::Fixed | Variability::Tunable
    );
    changes && initial == Some(Initial::Exact)
}
