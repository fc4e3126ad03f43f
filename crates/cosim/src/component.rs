//! What the master knows of a simulation unit.

use pilotage_linear::StateSpace;
pub use pilotage_units::{Base, Conversion, Unit};
use serde::{Deserialize, Serialize};

/// Why a component's call failed, in the component's own words.
pub type ComponentError = Box<dyn std::error::Error + Send + Sync>;

/// A simulation unit.
///
/// The master calls [`setup`](Self::setup), sets parameters, then
/// [`enter_initialization`](Self::enter_initialization), exchanges values until they are consistent,
/// [`exit_initialization`](Self::exit_initialization), then in turn sets inputs,
/// [`step`](Self::step)s and gets outputs, and at the end [`terminate`](Self::terminate)s.
pub trait Component: Send {
    /// The variables, in an order that never changes.
    fn variables(&self) -> &[Variable];

    /// Says when the simulation starts and ends and how exact it shall be.
    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        let _ = experiment;
        Ok(())
    }

    /// Begins to solve for consistent initial values.
    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        Ok(())
    }

    /// Ends it; the component is at the start time.
    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        Ok(())
    }

    /// What it said last of a step or an evaluation that it could not do, for messages.
    fn words_of_discard(&mut self) -> Option<String> {
        None
    }

    /// Sets reals by their handles, in their units.
    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError>;

    /// Gets reals by their handles, in their units.
    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError>;

    /// Sets a variable of any kind: as it stands here, of a component that has numbers alone.
    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        self.set_reals(&[handle], &[value.as_number()])
    }

    /// Gets a variable of any kind: as it stands here, of a component that has reals alone.
    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        let _ = kind;
        let mut value = [0.0];
        self.get_reals(&[handle], &mut value)?;
        Ok(Value::Real(value[0]))
    }

    /// Advances from time `t` by `h` \[s\], inputs as they were set last.
    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError>;

    /// When the component suggests to end the simulation \[s\].
    fn suggested_stop(&self) -> Option<f64> {
        None
    }

    /// Ends the simulation.
    fn terminate(&mut self) -> Result<(), ComponentError> {
        Ok(())
    }

    /// The linear system that the component is in continuous time for small changes about where it stands, with
    /// its inputs as they were set last. States have names of its own; inputs and outputs are named as in
    /// [`variables`](Self::variables), and those that are left out count as constant. `step` \[s\] is for components
    /// of which nothing is known but what they do in steps; all others take none.
    fn linearize(&mut self, step: f64) -> Result<Linear, ComponentError> {
        let _ = step;
        Err("it does not say how it depends on its states and inputs".into())
    }

    /// What the component can do beyond these calls. The calls below are made only where it says so.
    fn abilities(&self) -> Abilities {
        Abilities::default()
    }

    /// Saves the complete state in a place of that number, over what was saved there before. The
    /// places used are few and small numbers; saving again shall not allocate.
    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        Err(format!("the state cannot be saved (in place {place})").into())
    }

    /// Goes back to what was saved in a place, any number of times.
    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        Err(format!("the state cannot be restored (from place {place})").into())
    }

    /// As [`step`](Self::step), but the component may be restored to a state saved before it.
    fn step_revocably(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.step(t, h)
    }

    /// Sets the first time derivatives of real inputs [their units per second] for the next step, at
    /// whose begin they have the values that were set.
    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        let _ = slopes;
        Err(format!("the inputs {handles:?} cannot be given derivatives").into())
    }

    /// Gets the first time derivatives of real outputs [their units per second] at the end of the last
    /// step.
    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        let _ = slopes;
        Err(format!("the derivatives of the outputs {handles:?} are not known").into())
    }

    /// The next time after `t` \[s\] at which outputs jump, where that is known beforehand.
    fn next_jump(&self, t: f64) -> Option<f64> {
        let _ = t;
        None
    }

    /// The derivatives of real outputs in the direction of `seed`, a part for each of `inputs`:
    /// `Σ ∂output/∂input · part` at this instant.
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

/// A linear system, and how it was found where that is not by derivatives.
#[derive(Debug, Clone)]
pub struct Linear {
    /// The system.
    pub system: StateSpace,
    /// How it was found.
    pub note: Option<String>,
}

impl From<StateSpace> for Linear {
    fn from(system: StateSpace) -> Self {
        Self { system, note: None }
    }
}

/// What a component can do beyond stepping forward; by default nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Abilities {
    /// [`save`](Component::save) and [`restore`](Component::restore) its complete state (rollback).
    pub rollback: bool,
    /// Take communication steps of different lengths.
    pub variable_steps: bool,
    /// Take [the derivatives of inputs](Component::set_input_derivatives), so that these are ramps within
    /// a step instead of held.
    pub input_derivatives: bool,
    /// Give [the derivatives of outputs](Component::get_output_derivatives).
    pub output_derivatives: bool,
    /// Give [directional derivatives](Component::directional_derivative), during initialization too.
    pub directional_derivatives: bool,
}

/// How far a step came.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Progress {
    /// To its end.
    Done,
    /// The component could not finish the step; it stands at this time \[s\].
    Discarded {
        /// Where it stands \[s\].
        reached: f64,
    },
    /// The component wants the simulation to end at this time \[s\].
    EndRequested {
        /// Where it stands \[s\].
        reached: f64,
    },
}

/// When a simulation starts and ends and how exact it shall be.
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
    /// Other names of it.
    pub aliases: Vec<String>,
    /// What calls refer to it by.
    pub handle: u32,
    /// Type of its values.
    pub kind: ValueKind,
    /// What it is for.
    pub role: Role,
    /// Whether a user may give its start value.
    pub settable: bool,
    /// Whether it keeps its value between instants at which it jumps, though it may be a real.
    pub is_discrete: bool,
    /// Unit of a real; `None` if the component does not say.
    pub unit: Option<Unit>,
    /// Smallest and largest start value that a user may give, in the unit; infinite where there is no limit.
    pub range: [f64; 2],
    /// Magnitude of a real that counts as not small, in its unit: what tolerances refer to. 1 where
    /// the component does not say (FMI 2.0, section 2.2.7, `nominal`).
    pub nominal: f64,
    /// Of an output: positions in [`Component::variables`] of the inputs that it depends on at once
    /// (direct feedthrough).
    pub feedthrough: Vec<usize>,
    /// The same during initialization.
    pub initial_feedthrough: Vec<usize>,
}

impl Variable {
    /// Its name and its aliases.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let aliases = self.aliases.iter().map(String::as_str);
        std::iter::once(self.name.as_str()).chain(aliases)
    }

    /// A variable without unit and feedthrough; parameters and inputs are settable, all but reals are
    /// discrete.
    pub fn new(name: impl Into<String>, handle: u32, kind: ValueKind, role: Role) -> Self {
        Self {
            name: name.into(),
            aliases: Vec::new(),
            handle,
            kind,
            role,
            settable: matches!(role, Role::Parameter | Role::Input),
            is_discrete: kind != ValueKind::Real,
            unit: None,
            range: [f64::NEG_INFINITY, f64::INFINITY],
            nominal: 1.0,
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
    /// Integer, of 32 bits in FMI 2.0.
    Integer,
    /// True or false.
    Boolean,
    /// Text.
    String,
    /// Integer with names.
    Enumeration,
}

impl ValueKind {
    /// Whether outputs of this type may feed inputs of another one. A real may feed an integer, which is an
    /// error at the time where its value is not whole.
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

/// What a variable is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Constant while the simulation runs.
    Parameter,
    /// Fed by another component, or kept at its start value.
    Input,
    /// May feed inputs, and is recorded.
    Output,
    /// Neither.
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

/// A value of any kind; an enumeration's is an integer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// Of a real.
    Real(f64),
    /// Of an integer or an enumeration.
    Integer(i64),
    /// Of a boolean.
    Boolean(bool),
    /// Of a string.
    String(String),
}

impl Value {
    /// The value of that kind which a user wrote.
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

    /// Its type; that of an enumeration's value is an integer.
    pub fn kind(&self) -> ValueKind {
        match self {
            Self::Real(_) => ValueKind::Real,
            Self::Integer(_) => ValueKind::Integer,
            Self::Boolean(_) => ValueKind::Boolean,
            Self::String(_) => ValueKind::String,
        }
    }

    /// As a value for an input of type `kind`, which its own type [may feed](ValueKind::feeds).
    ///
    /// # Errors
    /// If something would be lost: it is a real that is not whole, or too large, and an integer is wanted; or an
    /// integer of more digits than a real has.
    pub fn converted(self, kind: ValueKind) -> Result<Self, ComponentError> {
        // All whole reals in between are of type i64.
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

    /// As a number for a table; booleans are 0 and 1, a string is NaN.
    pub fn as_number(&self) -> f64 {
        match self {
            Self::Real(value) => *value,
            Self::Integer(value) => *value as f64,
            Self::Boolean(value) => f64::from(u8::from(*value)),
            Self::String(_) => f64::NAN,
        }
    }
}
