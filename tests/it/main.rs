//! Integration tests: one binary, one module for each topic, in two tiers. Those in [`tools`] need Python, the
//! network, cargo or valgrind; all others need Rust alone:
//!
//!     cargo test --profile quick --test it -- --skip tools::
//!     cargo test --profile quick --test it tools::

#[macro_use]
extern crate pilotage_timed;

mod ahead_of_tools;
mod arrows;
mod bad_files;
mod bad_fmus;
mod casadi;
mod closed_loop;
mod codes;
mod command;
mod compare;
mod container;
mod cosim;
mod cosim_command;
mod defaults;
mod delays;
mod demo;
mod describing;
mod diagnostics;
mod excitation;
mod explained;
mod export;
#[cfg(target_os = "linux")]
mod files;
mod fit;
mod fit_log;
mod fitted;
mod flights;
mod fmi;
mod fmu_binary;
mod fmu_commands;
mod foreign;
mod hv;
mod init;
mod invariance;
mod isolated;
mod joint_ode;
mod json;
mod kinks;
mod linearize;
mod live;
mod mistakes;
mod model_commands;
mod model_examples;
mod model_library;
mod mutation;
mod next;
mod one_reader;
mod open_loop;
mod optimal;
mod other_fmus;
#[path = "../paragraphs.rs"]
mod paragraphs;
mod parquet;
mod plot;
mod printable;
mod problem_doubts;
mod problem_flights;
mod problem_fmus;
mod problem_outcomes;
mod problems;
mod recordings;
mod recovery;
mod refits;
mod scenarios;
mod selection;
mod shipped;
mod sources;
mod ssp;
mod starts;
mod states;
#[cfg(target_os = "linux")]
mod strangers;
mod sweep;
mod system_examples;
mod systems;
mod threads;
mod time_conditions;
mod times;
mod tools;
mod trials;
mod unpacked;
mod vehicle;
