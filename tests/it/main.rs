//! Integration tests: one binary, one module for each topic.

mod arrows;
mod bad_files;
mod command;
mod fmi;
mod trials;
mod vehicle;
