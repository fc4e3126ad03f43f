//! Integration tests: one binary, one module for each topic.

mod arrows;
mod bad_files;
mod command;
mod examples;
mod fmi;
mod sqp_problems;
mod trials;
mod vehicle;
