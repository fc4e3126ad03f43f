//! The vehicle's coefficients as user data: a TOML file in which every field has a unit and a range.
