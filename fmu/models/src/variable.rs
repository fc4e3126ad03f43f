//! A variable is declared once: the XML, value references, listings and plot labels derive from it.

use crate::Unit;

/// What a variable is for (FMI 2.0.5, section 2.2.7), and what goes with that.
#[derive(Debug, Clone, PartialEq)]
pub enum Role {
    /// Provided by another model; continuous.
    Input,
    /// For other models; continuous, calculated from the states.
    Output {
        /// What it depends on at any instant, apart from the states: inputs, by index.
        dependencies: Vec<Dependency>,
        /// What its first value depends on: inputs and parameters, by index.
        initial_dependencies: Vec<Dependency>,
    },
    /// Constant in time.
    Fixed,
    /// A parameter that may be set between communication points.
    Tunable,
}

/// That an unknown depends on a known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Dependency {
    /// Index of the known in the table.
    pub index: usize,
    /// True when it enters linearly, with a factor that never changes.
    pub constant: bool,
}

/// One real variable of a model. Its value reference is its index in the model's table.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name, unique in the model.
    pub name: String,
    /// Unit of all numbers here.
    pub unit: Unit,
    /// What it is for.
    pub role: Role,
    /// Value before anything is set; `None` for outputs, which are calculated.
    pub start: Option<f64>,
    /// Smallest allowed value.
    pub min: Option<f64>,
    /// Largest allowed value.
    pub max: Option<f64>,
    /// Typical magnitude, by which the integrator scales its absolute tolerance.
    pub nominal: Option<f64>,
    /// One line, without the unit.
    pub description: String,
}

impl Variable {
    fn new(name: String, unit: Unit, role: Role, start: Option<f64>, description: String) -> Self {
        Self {
            name,
            unit,
            role,
            start,
            min: None,
            max: None,
            nominal: None,
            description,
        }
    }

    /// An input that is 0 until it is set.
    pub fn input(name: &str, unit: Unit, description: &str) -> Self {
        Self::new(
            name.into(),
            unit,
            Role::Input,
            Some(0.0),
            description.into(),
        )
    }

    /// An output with what it depends on: [`Role::Output`].
    pub fn output(
        name: &str,
        unit: Unit,
        dependencies: Vec<Dependency>,
        initial_dependencies: Vec<Dependency>,
        description: &str,
    ) -> Self {
        let role = Role::Output {
            dependencies,
            initial_dependencies,
        };
        Self::new(name.into(), unit, role, None, description.into())
    }

    /// A parameter, [`Role::Fixed`] or [`Role::Tunable`].
    pub fn parameter(
        name: impl Into<String>,
        unit: Unit,
        role: Role,
        start: f64,
        description: impl Into<String>,
    ) -> Self {
        Self::new(name.into(), unit, role, Some(start), description.into())
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

    /// True for an output.
    pub fn is_output(&self) -> bool {
        matches!(self.role, Role::Output { .. })
    }

    /// `name [unit]`, as tables and plots show it.
    pub fn label(&self) -> String {
        match self.unit.symbol().as_str() {
            "" => self.name.clone(),
            symbol => format!("{} [{symbol}]", self.name),
        }
    }

    /// Refuses a value that this variable cannot have.
    ///
    /// # Errors
    /// When the value is not a finite number or out of the variable's range.
    pub fn check(&self, value: f64) -> Result<(), ValueError> {
        if !value.is_finite() {
            return Err(ValueError::NotFinite {
                name: self.label(),
                value,
            });
        }
        let (min, max) = (
            self.min.unwrap_or(f64::NEG_INFINITY),
            self.max.unwrap_or(f64::INFINITY),
        );
        match (min..=max).contains(&value) {
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

/// Why a variable cannot have a value.
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
    /// Beyond `min` or `max`.
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
