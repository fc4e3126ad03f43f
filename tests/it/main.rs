//! Integration tests: one binary, one module for each topic.

mod arrows;
mod bad_files;
mod bad_fmus;
mod casadi;
mod closed_loop;
mod command;
mod condensed;
mod cosim;
mod demo;
mod derivatives;
mod examples;
mod export;
mod fit;
mod fmi;
mod fmpy;
mod fmu_binary;
mod fmu_commands;
mod foreign;
mod python;
mod random_collocation;
mod recovery;
mod sqp_problems;
mod starts;
mod trials;
mod vehicle;
