//! A variable is declared once; the XML, value references, listings and plot labels are derived from it.

use crate::{Unit, json};

/// Role of a variable (FMI 2.0.5, section 2.2.7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Provided by another model; continuous.
    Input,
    /// Provided to other models; continuous, calculated from states and inputs, or itself a state.
    Output,
    /// A Boolean output that changes only at events: 1 for true, 0 for false. Its start value may be set.
    Mode,
    /// A parameter, constant in time.
    Fixed,
    /// A parameter that may be set between communication points.
    Tunable,
    /// A continuous state that is not an output.
    State,
    /// Continuous and calculated, but neither an output nor a state.
    Local,
    /// The time derivative of a state.
    Derivative,
    /// Indicates an event by its sign.
    Indicator,
    /// Time itself.
    Time,
}

impl Role {
    /// All roles with their names.
    pub const NAMES: [(Self, &str); 10] = [
        (Self::Input, "input"),
        (Self::Output, "output"),
        (Self::Mode, "mode"),
        (Self::Fixed, "parameter"),
        (Self::Tunable, "tunable parameter"),
        (Self::State, "state"),
        (Self::Local, "local"),
        (Self::Derivative, "derivative"),
        (Self::Indicator, "event indicator"),
        (Self::Time, "time"),
    ];

    /// Name of the role in tables.
    pub fn name(self) -> &'static str {
        let found = Self::NAMES.iter().find(|(role, _)| *role == self);
        found.map_or("", |(_, name)| name)
    }
}

/// Value reference of the variable at that index of the table. They start at 1: some importers take 0 for none, others
/// take those of FMI 3.0 for positions in the list, which start at 1.
pub fn reference(index: usize) -> u32 {
    u32::try_from(index + 1).unwrap_or(u32::MAX)
}

/// Index of the variable with that value reference; an index that no table has if there is none.
pub fn index_of(reference: u32) -> usize {
    (reference as usize).wrapping_sub(1)
}

/// One variable of a model: Boolean if its role is [`Role::Mode`], otherwise real. Its value reference follows from
/// [its index](reference()) in the model's table.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name, unique in the model.
    pub name: String,
    /// Unit of all values of the variable.
    pub unit: Unit,
    /// Role.
    pub role: Role,
    /// Start value; `None` if the variable is calculated.
    pub start: Option<f64>,
    /// Smallest allowed value.
    pub min: Option<f64>,
    /// Largest allowed value.
    pub max: Option<f64>,
    /// Typical magnitude, by which the integrator scales its absolute tolerance.
    pub nominal: Option<f64>,
    /// Description in one line, without the unit.
    pub description: String,
}

impl Variable {
    fn new(name: &str, unit: Unit, role: Role, start: Option<f64>, description: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit,
            role,
            start,
            min: None,
            max: None,
            nominal: None,
            description: description.to_owned(),
        }
    }

    /// An input that is 0 until it is set.
    pub fn input(name: &str, unit: Unit, description: &str) -> Self {
        Self::new(name, unit, Role::Input, Some(0.0), description)
    }

    /// An output, a state, or another calculated variable.
    pub fn calculated(name: &str, unit: Unit, role: Role, description: &str) -> Self {
        Self::new(name, unit, role, None, description)
    }

    /// A parameter, [`Role::Fixed`] or [`Role::Tunable`].
    pub fn parameter(name: &str, unit: Unit, role: Role, start: f64, description: &str) -> Self {
        Self::new(name, unit, role, Some(start), description)
    }

    /// Sets the allowed range.
    pub fn range(mut self, min: Option<f64>, max: Option<f64>) -> Self {
        (self.min, self.max) = (min, max);
        self
    }

    /// Sets the typical magnitude.
    pub fn nominal(mut self, nominal: f64) -> Self {
        self.nominal = Some(nominal);
        self
    }

    /// A mode, true or false at the start.
    pub fn mode(name: &str, start: bool, description: &str) -> Self {
        let start = Some(f64::from(u8::from(start)));
        Self::new(name, Unit::of("1"), Role::Mode, start, description)
    }

    /// True for an output.
    pub fn is_output(&self) -> bool {
        matches!(self.role, Role::Output | Role::Mode)
    }

    /// True for a Boolean of FMI.
    pub fn is_boolean(&self) -> bool {
        self.role == Role::Mode
    }

    /// True for a variable that cannot be set: neither an input nor a parameter nor a mode.
    pub fn is_calculated(&self) -> bool {
        !matches!(
            self.role,
            Role::Input | Role::Mode | Role::Fixed | Role::Tunable
        )
    }

    /// `name [unit]`, as tables and plots show it.
    pub fn label(&self) -> String {
        match self.unit.symbol().as_str() {
            "" => self.name.clone(),
            symbol => format!("{} [{symbol}]", self.name),
        }
    }

    /// The allowed range in words, if it has one: `0 to 1`, `from 0`, `up to 1`.
    pub fn allowed(&self) -> Option<String> {
        match (self.min, self.max) {
            (Some(min), Some(max)) => Some(format!("{min} to {max}")),
            (Some(min), None) => Some(format!("from {min}")),
            (None, Some(max)) => Some(format!("up to {max}")),
            (None, None) => None,
        }
    }

    pub(crate) fn to_json(&self) -> String {
        json::object([
            ("name", json::string(&self.name)),
            ("unit", json::string(&self.unit.name)),
            ("role", json::string(self.role.name())),
            ("start", json::number(self.start)),
            ("min", json::number(self.min)),
            ("max", json::number(self.max)),
            ("nominal", json::number(self.nominal)),
            ("description", json::string(&self.description)),
        ])
    }

    /// Checks that the variable allows a value.
    ///
    /// Inputs may be out of range: masters and solvers evaluate points beyond it.
    ///
    /// # Errors
    /// If the value is not finite or out of range, or a Boolean's value is neither 0 nor 1.
    pub fn check(&self, value: f64) -> Result<(), ValueError> {
        if !value.is_finite() {
            return Err(ValueError::NotFinite {
                name: self.label(),
                value,
            });
        }
        if self.is_boolean() && value != 0.0 && value != 1.0 {
            return Err(ValueError::NoBoolean {
                name: self.label(),
                value,
            });
        }
        let (min, max) = (
            self.min.unwrap_or(f64::NEG_INFINITY),
            self.max.unwrap_or(f64::INFINITY),
        );
        match self.role == Role::Input || (min..=max).contains(&value) {
            true => Ok(()),
            false => Err(ValueError::OutOfRange {
                name: self.label(),
                value,
                min,
                max,
            }),
        }
    }
}

/// Why a variable does not allow a value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// NaN or infinite.
    #[error("{name} = {value} is not a finite number; check what computes it")]
    NotFinite {
        /// The variable, with its unit.
        name: String,
        /// The value.
        value: f64,
    },
    /// Neither 0 nor 1.
    #[error("{name} = {value} is no Boolean; set 0 for false or 1 for true")]
    NoBoolean {
        /// The variable.
        name: String,
        /// The value.
        value: f64,
    },
    /// Outside `min` to `max`.
    #[error("{name} = {value} is out of its range {min} to {max}; set a value within it")]
    OutOfRange {
        /// The variable, with its unit.
        name: String,
        /// The value.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
}
