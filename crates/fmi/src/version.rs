//! Names and numbers that differ between the versions of FMI, as one type each.

use pilotage_abi::{Part, fmi2, fmi3};

/// The interface type of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum InterfaceType {
    /// It has its own solver.
    CoSimulation,
    /// The importer solves its equations.
    ModelExchange,
    /// The importer schedules its partitions (FMI 3.0).
    ScheduledExecution,
}

impl InterfaceType {
    /// Every interface type.
    pub const ALL: [Self; 3] = [
        Self::CoSimulation,
        Self::ModelExchange,
        Self::ScheduledExecution,
    ];

    /// The part of the API that it adds to the common one.
    pub fn part(self) -> Part {
        match self {
            Self::CoSimulation => Part::CoSimulation,
            Self::ModelExchange => Part::ModelExchange,
            Self::ScheduledExecution => Part::ScheduledExecution,
        }
    }

    /// Name of its element in the description.
    pub fn element(self) -> &'static str {
        match self {
            Self::CoSimulation => "CoSimulation",
            Self::ModelExchange => "ModelExchange",
            Self::ScheduledExecution => "ScheduledExecution",
        }
    }
}

impl std::fmt::Display for InterfaceType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "model exchange",
            Self::ScheduledExecution => "scheduled execution",
        })
    }
}

/// A function of either version.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Function {
    /// Of FMI 2.0.
    Fmi2(fmi2::Function),
    /// Of FMI 3.0.
    Fmi3(fmi3::Function),
}

impl Function {
    /// Its name, such as `fmi2DoStep`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fmi2(function) => function.name(),
            Self::Fmi3(function) => function.name(),
        }
    }

    /// A unique number, for [`call_name`].
    #[inline(always)]
    pub(crate) const fn number(self) -> u32 {
        match self {
            Self::Fmi2(function) => FMI2 + function as u32,
            Self::Fmi3(function) => FMI3 + function as u32,
        }
    }

    /// Whether it may be called in `state`.
    #[inline]
    pub fn is_legal_in(self, state: State) -> bool {
        match (self, state) {
            (Self::Fmi2(function), State::Fmi2(state)) => function.is_legal_in(state),
            (Self::Fmi3(function), State::Fmi3(state)) => function.is_legal_in(state),
            _ => false,
        }
    }

    /// The standard's name of a status that it returned, or the number if FMI defines no name.
    pub(crate) fn name_of(self, status: fmi2::Status) -> String {
        let (name, prefix) = match self {
            Self::Fmi2(_) => (status.name(), "fmi2"),
            Self::Fmi3(_) => (fmi3::Status(status.0).name(), "fmi3"),
        };
        match name {
            Some(name) => name.to_owned(),
            None => format!("{}, which is no {prefix}Status", status.0),
        }
    }
}

/// A library is being loaded: its initialization runs.
pub(crate) const LOADING: u32 = 1;
/// A library is being unloaded: its finalization runs.
pub(crate) const UNLOADING: u32 = 2;
/// A request to an FMU in a separate process is pending.
pub const ASKING: u32 = 3;
const FMI2: u32 = 1000;
const FMI3: u32 = 2000;

/// Name of a call, by the number [recorded](pilotage_process::Place::call) in a process that loads FMUs.
pub fn call_name(number: u32) -> &'static str {
    let name = match number {
        LOADING => Some("the initialization of its library"),
        UNLOADING => Some("the finalization of its library"),
        ASKING => Some("a question to its process"),
        FMI2..FMI3 => {
            let function = fmi2::Function::ALL.get((number - FMI2) as usize);
            function.map(|function| function.name())
        }
        FMI3.. => {
            let function = fmi3::Function::ALL.get((number - FMI3) as usize);
            function.map(|function| function.name())
        }
        _ => None,
    };
    name.unwrap_or("a call")
}

impl From<fmi2::Function> for Function {
    fn from(function: fmi2::Function) -> Self {
        Self::Fmi2(function)
    }
}

impl From<fmi3::Function> for Function {
    fn from(function: fmi3::Function) -> Self {
        Self::Fmi3(function)
    }
}

/// A state of an instance of either version.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// Of FMI 2.0.
    Fmi2(fmi2::State),
    /// Of FMI 3.0.
    Fmi3(fmi3::State),
}

impl State {
    /// The standard's name of the state.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fmi2(state) => state.name(),
            Self::Fmi3(state) => state.name(),
        }
    }
}

impl From<fmi2::State> for State {
    fn from(state: fmi2::State) -> Self {
        Self::Fmi2(state)
    }
}

impl From<fmi3::State> for State {
    fn from(state: fmi3::State) -> Self {
        Self::Fmi3(state)
    }
}
