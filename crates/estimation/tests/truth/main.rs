//! Parameters that are known come back.
mod features;
mod help;
mod pilots;
