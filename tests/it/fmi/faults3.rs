//! A good description of FMI 3.0, and what can be wrong with it.

pub const GOOD: &str = include_str!("good3.xml");

/// What is replaced by what, as TOML.
pub const FAULTS: &str = include_str!("faults3.toml");
