//! What the master knows of a simulation unit.

use crate::linear::StateSpace;

/// Why a slave's call failed, in the slave's own words.
pub type SlaveError = Box<dyn std::error::Error + Send + Sync>;

/// A simulation unit.
///
/// The master calls [`setup`](Self::setup), sets parameters, then
/// [`enter_initialization`](Self::enter_initialization), exchanges values until they are consistent,
/// [`exit_initialization`](Self::exit_initialization), then in turn sets inputs,
/// [`step`](Self::step)s and gets outputs, and at the end [`terminate`](Self::terminate)s.
pub trait Slave {
    /// The variables, in an order that never changes.
    fn variables(&self) -> &[Variable];

    /// Says when the simulation starts and ends and how exact it shall be.
    fn setup(&mut self, experiment: &Experiment) -> Result<(), SlaveError>;

    /// Begins to solve for consistent initial values.
    fn enter_initialization(&mut self) -> Result<(), SlaveError>;

    /// Ends it; the slave is at the start time.
    fn exit_initialization(&mut self) -> Result<(), SlaveError>;

    /// Sets reals by their handles, in their units.
    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), SlaveError>;

    /// Gets reals by their handles, in their units.
    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), SlaveError>;

    /// Sets a variable of any kind.
    fn set(&mut self, handle: u32, value: &Value) -> Result<(), SlaveError>;

    /// Gets a variable of any kind.
    fn get(&mut self, handle: u32, kind: Kind) -> Result<Value, SlaveError>;

    /// Advances from time `t` by `h` [s], inputs as they were set last.
    fn step(&mut self, t: f64, h: f64) -> Result<Progress, SlaveError>;

    /// Ends the simulation.
    fn terminate(&mut self) -> Result<(), SlaveError>;

    /// The linear system that the slave is in continuous time for small changes about where it stands, with
    /// its inputs as they were set last. States have names of its own; inputs and outputs are named as in
    /// [`variables`](Self::variables), and those that are left out count as constant.
    fn linearize(&mut self) -> Result<StateSpace, SlaveError> {
        Err("it does not say how it depends on its states and inputs".into())
    }
}

/// How far a step came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// To its end.
    Done,
    /// The slave could not finish the step; it stands at this time [s].
    Discarded {
        /// Where it stands [s].
        reached: f64,
    },
    /// The slave wants the simulation to end at this time [s].
    EndRequested {
        /// Where it stands [s].
        reached: f64,
    },
}

/// When a simulation starts and ends and how exact it shall be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// Start time [s].
    pub start: f64,
    /// Stop time [s].
    pub stop: f64,
    /// Relative tolerance for slaves with error control; `None` leaves it to each slave.
    pub tolerance: Option<f64>,
}

/// A variable of a slave.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name, unique within the slave.
    pub name: String,
    /// What calls refer to it by.
    pub handle: u32,
    /// Type of its values.
    pub kind: Kind,
    /// What it is for.
    pub role: Role,
    /// Whether a user may give its start value.
    pub settable: bool,
    /// Whether it keeps its value between instants at which it jumps, though it may be a real.
    pub is_discrete: bool,
    /// Unit of a real; `None` if the slave does not say.
    pub unit: Option<Unit>,
    /// Of an output: positions in [`Slave::variables`] of the inputs that it depends on at once
    /// (direct feedthrough).
    pub feedthrough: Vec<usize>,
    /// The same during initialization.
    pub initial_feedthrough: Vec<usize>,
}

impl Variable {
    /// A variable without unit and feedthrough; parameters and inputs are settable, all but reals are
    /// discrete.
    pub fn new(name: impl Into<String>, handle: u32, kind: Kind, role: Role) -> Self {
        Self {
            name: name.into(),
            handle,
            kind,
            role,
            settable: matches!(role, Role::Parameter | Role::Input),
            is_discrete: kind != Kind::Real,
            unit: None,
            feedthrough: Vec::new(),
            initial_feedthrough: Vec::new(),
        }
    }
}

/// Type of a variable's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
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

impl std::fmt::Display for Kind {
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
    /// Fed by another slave, or kept at its start value.
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

/// A unit by its name and, where the slave defines it, its meaning in SI base units and radian.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Name, for example `m/s`.
    pub name: String,
    /// Meaning.
    pub base: Option<Base>,
}

/// `value in base units = factor·value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Base {
    /// Exponents of kg, m, s, A, K, mol, cd, rad.
    pub exponents: [i32; 8],
    /// Factor to the base units.
    pub factor: f64,
    /// Offset to the base units.
    pub offset: f64,
}

/// How a value in one unit becomes one in another: `factor·value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub factor: f64,
    /// Offset, in the second unit.
    pub offset: f64,
}

impl Conversion {
    /// The same unit.
    pub const NONE: Self = Self {
        factor: 1.0,
        offset: 0.0,
    };

    /// The value in the second unit; unchanged bits if both are the same.
    pub fn apply(self, value: f64) -> f64 {
        match self == Self::NONE {
            true => value,
            false => self.factor * value + self.offset,
        }
    }
}

impl Unit {
    /// How values in this unit become values in `other` (FMI 2.0.5, section 2.2.2); `None` if they
    /// mean different things, or one has no definition and the names differ.
    pub fn conversion(&self, other: &Self) -> Option<Conversion> {
        match (&self.base, &other.base) {
            (Some(from), Some(to)) if from.exponents == to.exponents => Some(match from == to {
                true => Conversion::NONE,
                false => Conversion {
                    factor: from.factor / to.factor,
                    offset: (from.offset - to.offset) / to.factor,
                },
            }),
            (Some(_), Some(_)) => None,
            _ => (self.name == other.name).then_some(Conversion::NONE),
        }
    }
}

/// A value of any kind; an enumeration's is an integer.
#[derive(Debug, Clone, PartialEq)]
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
    pub fn parse(text: &str, kind: Kind) -> Option<Self> {
        Some(match kind {
            Kind::Real => Self::Real(text.trim().parse().ok()?),
            Kind::Integer | Kind::Enumeration => Self::Integer(text.trim().parse().ok()?),
            Kind::Boolean => Self::Boolean(match text.trim() {
                "true" | "1" => true,
                "false" | "0" => false,
                _ => return None,
            }),
            Kind::String => Self::String(text.to_owned()),
        })
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
