//! The second tier: tests that need more than Rust. Python with fmpy and other tools, which the tests install
//! themselves (network); cargo, which builds models, what is released, and finds the built examples; binutils; valgrind.

mod book;
mod container;
mod dependencies;
mod describing;
mod dist;
mod examples;
mod fmpy;
mod guidance;
mod library;
mod margins;
mod masters;
mod model_fmus;
mod modes;
mod module;
mod other_tools;
mod pack;
mod pages;
mod platforms;
pub mod python;
mod references;
mod regression;
mod remnant;
mod results;
mod sources;
mod ssp;
mod third_party;
mod valgrind;
