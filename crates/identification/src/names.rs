//! Names of the options on the command line and in the result file.

use super::{InitialPosition, InitialState, Objective};

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
