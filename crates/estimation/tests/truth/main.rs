//! Parameters that are known come back.
mod help;
mod pilots;
