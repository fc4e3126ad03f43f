//! Integration tests: one binary, one module for each topic.

mod arrows;
mod bad_files;
mod command;
mod examples;
mod fmi;
mod fmpy;
mod fmu_binary;
mod python;
mod trials;
mod vehicle;
