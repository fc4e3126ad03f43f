//! The interface between the master and a simulation unit.

use pilotage_linear::StateSpace;
pub use pilotage_units::{Base, Conversion, Unit};
use serde::{Deserialize, Serialize};

/// Error of a component's call, with the component's own message.
pub type ComponentError = Box<dyn std::error::Error + Send + Sync>;

/// A simulation unit.
///
/// The master calls [`setup`](Self::setup), sets parameters, calls
/// [`enter_initialization`](Self::enter_initialization), exchanges values until they are consistent, and calls
/// [`exit_initialization`](Self::exit_initialization). Then it repeatedly sets inputs, [`step`](Self::step)s and gets
/// outputs, and finally calls [`terminate`](Self::terminate).
pub trait Component: Send {
    /// The variables, in a fixed order.
    fn variables(&self) -> &[Variable];

    /// Passes start time, stop time and tolerance of the simulation.
    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        let _ = experiment;
        Ok(())
    }

    /// Enters initialization, where initial values are made consistent.
    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        Ok(())
    }

    /// Exits initialization; the component is at the start time.
    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        Ok(())
    }

    /// The component's last message about a discarded step or evaluation.
    fn words_of_discard(&mut self) -> Option<String> {
        None
    }

    /// Sets reals by handle, in their units.
    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError>;

    /// Gets reals by handle, in their units.
    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError>;

    /// Sets a variable of any kind. The default suits components with numbers only.
    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        self.set_reals(&[handle], &[value.as_number()])
    }

    /// Gets a variable of any kind. The default suits components with reals only.
    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        let _ = kind;
        let mut value = [0.0];
        self.get_reals(&[handle], &mut value)?;
        Ok(Value::Real(value[0]))
    }

    /// Steps from time `t` by `h` \[s\], with the inputs set last.
    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError>;

    /// Times that it suggests for a run.
    fn suggested(&self) -> Suggested {
        Suggested::default()
    }

    /// What a user should know of what is not simulated.
    fn limitation(&self) -> Option<String> {
        None
    }

    /// Ends the simulation.
    fn terminate(&mut self) -> Result<(), ComponentError> {
        Ok(())
    }

    /// Ends the simulation and becomes as it was when it was made, for another run. Returns whether it can; if not, it is
    /// [terminated](Self::terminate).
    fn renew(&mut self) -> Result<bool, ComponentError> {
        self.terminate()?;
        Ok(false)
    }

    /// For another run: what this component was put around for a scenario, or nothing if it was only put beside others.
    /// `None` if it is one of the system itself.
    fn without_scenario(&mut self) -> Option<Option<Box<dyn Component>>> {
        None
    }

    /// The continuous-time linearization of the component about its current state, with the inputs set last. States
    /// have the component's own names; inputs and outputs are named as in [`variables`](Self::variables), and omitted
    /// ones count as constant. `step` \[s\] is used only by components known only by their response to steps.
    fn linearize(&mut self, step: f64) -> Result<Linear, ComponentError> {
        let _ = step;
        Err("it does not say how it depends on its states and inputs".into())
    }

    /// Optional capabilities. The methods below are called only if the corresponding ability is set.
    fn abilities(&self) -> Abilities {
        Abilities::default()
    }

    /// Saves the complete state in slot `place` and overwrites what was saved there. Slot numbers are few and small;
    /// saving again must not allocate.
    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        Err(format!("the state cannot be saved (in place {place})").into())
    }

    /// Restores the state saved in a slot, any number of times.
    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        Err(format!("the state cannot be restored (from place {place})").into())
    }

    /// The complete state as bytes.
    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        Err("the state cannot be written as bytes".into())
    }

    /// Restores a state from the bytes that this or another instance of the same component has written. The instance is
    /// initialized.
    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        Err(format!("the state cannot be read from {} bytes", bytes.len()).into())
    }

    /// As [`step`](Self::step), but the component can be restored to a state saved before the step.
    fn step_revocably(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.step(t, h)
    }

    /// Sets the first time derivatives of real inputs [their units per second] for the next step, at whose beginning
    /// the inputs have the values set last.
    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        let _ = slopes;
        Err(format!("the inputs {handles:?} cannot be given derivatives").into())
    }

    /// Gets the first time derivatives of real outputs [their units per second] at the end of the last step.
    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        let _ = slopes;
        Err(format!("the derivatives of the outputs {handles:?} are not known").into())
    }

    /// The next time after `t` \[s\] at which outputs jump, if known in advance.
    fn next_jump(&self, t: f64) -> Option<f64> {
        let _ = t;
        None
    }

    /// Directional derivatives of real outputs along `seed`, which has one entry per element of `inputs`: `Σ
    /// ∂output/∂input · seed` at the current time.
    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), ComponentError> {
        let _ = (inputs, seed, result);
        Err(format!("the outputs {outputs:?} have no directional derivatives").into())
    }
}

/// A linear system, with a note on how it was found if not by derivatives.
#[derive(Debug, Clone)]
pub struct Linear {
    /// The system.
    pub system: StateSpace,
    /// How it was found.
    pub note: Option<String>,
    /// The system in which delays are not approximated, if there are any.
    pub delayed: Option<DelayedLinear>,
}

/// A linear system with delays.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayedLinear {
    /// The system. For each delay the delayed signal is an input after the others, and what is delayed an output.
    pub system: StateSpace,
    /// The delays \[s\].
    pub times: Vec<f64>,
}

impl From<StateSpace> for Linear {
    fn from(system: StateSpace) -> Self {
        Self {
            system,
            note: None,
            delayed: None,
        }
    }
}

/// Optional capabilities of a component; none by default.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Abilities {
    /// [`save`](Component::save) and [`restore`](Component::restore) its complete state (rollback).
    pub rollback: bool,
    /// Write its complete state [as bytes](Component::serialize).
    pub serialization: bool,
    /// Take communication steps of different lengths.
    pub variable_steps: bool,
    /// Accept [the derivatives of inputs](Component::set_input_derivatives), so that inputs are ramps within a step
    /// instead of held.
    pub input_derivatives: bool,
    /// Provide [the derivatives of outputs](Component::get_output_derivatives).
    pub output_derivatives: bool,
    /// Provide [directional derivatives](Component::directional_derivative), during initialization too.
    pub directional_derivatives: bool,
    /// Nothing that it does, but what is done to it: steps of every algorithm are cut at its [jumps](Component::next_jump).
    pub cuts_steps: bool,
}

/// Result of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Progress {
    /// The step is complete.
    Done,
    /// The component could not finish the step.
    Discarded {
        /// Time reached \[s\].
        reached: f64,
    },
    /// The component requests the end of the simulation.
    EndRequested {
        /// Time reached \[s\].
        reached: f64,
    },
}

/// Times of a run that a component suggests (FMI 2.0, section 2.2.5, and FMI 3.0, section 2.4.5: `DefaultExperiment`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Suggested {
    /// Stop time \[s\].
    pub stop: Option<f64>,
    /// Communication step \[s\].
    pub step: Option<f64>,
}

/// Start time, stop time and tolerance of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Start time \[s\].
    pub start: f64,
    /// Stop time \[s\]; infinite if there is none.
    pub stop: f64,
    /// Relative tolerance for components with error control; `None` leaves it to each component.
    pub tolerance: Option<f64>,
}

/// A variable of a component.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name, unique within the component.
    pub name: String,
    /// Aliases.
    pub aliases: Vec<String>,
    /// Handle used in calls.
    pub handle: u32,
    /// Type of its values.
    pub kind: ValueKind,
    /// Role in the simulation.
    pub role: Role,
    /// Whether the user may set its start value.
    pub settable: bool,
    /// Whether it may be set between steps: a tunable parameter.
    pub is_tunable: bool,
    /// What it is, in the words of its model.
    pub description: String,
    /// Whether it is piecewise constant between events, even if it is a real.
    pub is_discrete: bool,
    /// Unit of a real; `None` if not specified.
    pub unit: Option<Unit>,
    /// Smallest and largest start value allowed, in the unit; infinite if unlimited.
    pub range: [f64; 2],
    /// The names and values of an enumeration, if they are known.
    pub items: Vec<(String, i64)>,
    /// Nominal magnitude of a real, in its unit, to which tolerances refer if it is larger than the values; `None` if not
    /// specified (FMI 2.0, section 2.2.7, `nominal`), which leaves the values alone.
    pub nominal: Option<f64>,
    /// For an output: positions in [`Component::variables`] of the inputs with direct feedthrough to it.
    pub feedthrough: Vec<usize>,
    /// The same during initialization.
    pub initial_feedthrough: Vec<usize>,
}

impl Variable {
    /// Parses a value of its type as written by the user; that of an enumeration may be a name of its items.
    pub fn parse(&self, text: &str) -> Option<Value> {
        let item = || {
            let mut items = self.items.iter();
            let (_, value) = items.find(|(name, _)| name.trim() == text.trim())?;
            Some(Value::Integer(*value))
        };
        let number = Value::parse(text, self.kind);
        let is_one = |(_, value): &(String, i64)| number == Some(Value::Integer(*value));
        match self.items.iter().any(is_one) {
            true => number,
            false => item().or(number),
        }
    }

    /// Its name and its aliases.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let aliases = self.aliases.iter().map(String::as_str);
        std::iter::once(self.name.as_str()).chain(aliases)
    }

    /// A variable without unit and feedthrough; parameters and inputs are settable, and all kinds except reals are
    /// discrete.
    pub fn new(name: impl Into<String>, handle: u32, kind: ValueKind, role: Role) -> Self {
        Self {
            name: name.into(),
            aliases: Vec::new(),
            handle,
            kind,
            role,
            settable: matches!(role, Role::Parameter | Role::Input),
            is_tunable: false,
            description: String::new(),
            is_discrete: kind != ValueKind::Real,
            unit: None,
            range: [f64::NEG_INFINITY, f64::INFINITY],
            items: Vec::new(),
            nominal: None,
            feedthrough: Vec::new(),
            initial_feedthrough: Vec::new(),
        }
    }
}

/// Type of a variable's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ValueKind {
    /// Floating point.
    Real,
    /// Integer; 32 bits in FMI 2.0.
    Integer,
    /// True or false.
    Boolean,
    /// Text.
    String,
    /// Integer with names.
    Enumeration,
}

impl ValueKind {
    /// Whether outputs of this type may feed inputs of another type. A real may feed an integer; a value that is not
    /// whole is an error when it occurs.
    pub fn feeds(self, input: Self) -> bool {
        use ValueKind::*;
        self == input
            || matches!(
                (self, input),
                (Integer, Real | Enumeration)
                    | (Enumeration, Integer)
                    | (Boolean, Integer | Real)
                    | (Real, Integer)
            )
    }
}

impl std::fmt::Display for ValueKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Real => "Real",
            Self::Integer => "Integer",
            Self::Boolean => "Boolean",
            Self::String => "String",
            Self::Enumeration => "Enumeration",
        })
    }
}

/// Role of a variable in the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Constant during the simulation.
    Parameter,
    /// Fed by another component, or constant at its start value.
    Input,
    /// May feed inputs; recorded.
    Output,
    /// None of the above.
    Local,
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Parameter => "a parameter",
            Self::Input => "an input",
            Self::Output => "an output",
            Self::Local => "a local variable",
        })
    }
}

/// A value of any kind; enumerations have integer values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// A real.
    Real(f64),
    /// An integer or an enumeration.
    Integer(i64),
    /// A boolean.
    Boolean(bool),
    /// A string.
    String(String),
}

impl std::fmt::Display for Value {
    /// As it is [parsed](Value::parse).
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Real(value) => write!(f, "{value:?}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Boolean(value) => write!(f, "{value}"),
            Self::String(value) => f.write_str(value),
        }
    }
}

impl Value {
    /// Parses a value of that kind as written by the user.
    pub fn parse(text: &str, kind: ValueKind) -> Option<Self> {
        Some(match kind {
            ValueKind::Real => Self::Real(text.trim().parse().ok()?),
            ValueKind::Integer | ValueKind::Enumeration => Self::Integer(text.trim().parse().ok()?),
            ValueKind::Boolean => Self::Boolean(match text.trim() {
                "true" | "1" => true,
                "false" | "0" => false,
                _ => return None,
            }),
            ValueKind::String => Self::String(text.to_owned()),
        })
    }

    /// Its type; `Integer` for an enumeration's value.
    pub fn kind(&self) -> ValueKind {
        match self {
            Self::Real(_) => ValueKind::Real,
            Self::Integer(_) => ValueKind::Integer,
            Self::Boolean(_) => ValueKind::Boolean,
            Self::String(_) => ValueKind::String,
        }
    }

    /// Converts to a value for an input of type `kind`, which this value's type [may feed](ValueKind::feeds).
    ///
    /// # Errors
    /// If information would be lost: a real that is not whole or too large for an integer, or an integer with more
    /// digits than a real has.
    pub fn converted(self, kind: ValueKind) -> Result<Self, ComponentError> {
        // All whole reals within this limit fit into an i64.
        const LIMIT: f64 = (1_u64 << 63) as f64;
        match (self, kind) {
            (Self::Integer(value), ValueKind::Real) => {
                match i128::from(value) == value as f64 as i128 {
                    true => Ok(Self::Real(value as f64)),
                    false => Err(format!("{value} has more digits than a Real can hold").into()),
                }
            }
            (Self::Boolean(value), ValueKind::Real) => Ok(Self::Real(value.into())),
            (Self::Boolean(value), ValueKind::Integer) => Ok(Self::Integer(value.into())),
            (Self::Real(value), ValueKind::Integer) => {
                match value.fract() == 0.0 && value.abs() < LIMIT {
                    true => Ok(Self::Integer(value as i64)),
                    false => {
                        Err(format!("{value:?} is no whole number that an Integer can hold").into())
                    }
                }
            }
            (same, _) => Ok(same),
        }
    }

    /// The value that a map has in place of this one, or this one [converted](Self::converted).
    ///
    /// # Errors
    /// If it is not in the map, and information would be lost.
    pub(crate) fn mapped(
        self,
        map: &[(Self, Self)],
        kind: ValueKind,
    ) -> Result<Self, ComponentError> {
        match map.iter().find(|(from, _)| *from == self) {
            Some((_, to)) => Ok(to.clone()),
            None => self.converted(kind),
        }
    }

    /// As a number for a table; booleans become 0 or 1, strings NaN.
    pub fn as_number(&self) -> f64 {
        match self {
            Self::Real(value) => *value,
            Self::Integer(value) => *value as f64,
            Self::Boolean(value) => f64::from(u8::from(*value)),
            Self::String(_) => f64::NAN,
        }
    }
}
