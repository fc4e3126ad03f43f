//! What the options of a fit of flights say about its problem, with their names on the command line and in files.

/// What is known about the states at the first sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitialState {
    /// Nothing: every state of every run is free (the paper's implicit states).
    Free,
    /// The vehicle hovers at the position given by [`InitialPosition`]; the pilot's states are free.
    VehicleAtRest,
    /// The vehicle hovers at the position given by [`InitialPosition`], and the pilot's states are zero.
    AtRest,
}

/// What is known about the vehicle's position at the first sample, if the vehicle is at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitialPosition {
    /// It is measured like every other sample, and estimated.
    Estimated,
    /// It equals the first recorded one exactly, as if set by a simulator.
    Known,
}

/// The signal whose residuals are minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Objective {
    /// The vehicle's response: sum of squared position residuals \[m²\] (the paper's).
    Response,
    /// The stick, with the pilot driven by the recorded error: sum of squared stick residuals \[1\].
    Stick,
}

impl InitialState {
    /// All values.
    pub const ALL: [Self; 3] = [Self::Free, Self::VehicleAtRest, Self::AtRest];

    /// `free`, `vehicle-at-rest` or `at-rest`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::VehicleAtRest => "vehicle-at-rest",
            Self::AtRest => "at-rest",
        }
    }
}

impl InitialPosition {
    /// All values.
    pub const ALL: [Self; 2] = [Self::Estimated, Self::Known];

    /// `estimated` or `known`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Known => "known",
        }
    }
}

impl Objective {
    /// All values.
    pub const ALL: [Self; 2] = [Self::Response, Self::Stick];

    /// `response` or `stick`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Response => "response",
            Self::Stick => "stick",
        }
    }

    /// Unit of its residuals: `m` or `1`.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Response => "m",
            Self::Stick => "1",
        }
    }
}
