//! Tests that take place in real time: one after another, and while no other test runs, since what else the computer does
//! would be measured too.
//!
//!     cargo test --release --test realtime

#[macro_use]
extern crate pilotage_timed;

#[expect(dead_code, reason = "others use the rest")]
#[path = "../it/command.rs"]
mod command;
mod fly;
#[expect(dead_code, reason = "others use the rest")]
#[path = "../it/tools/python.rs"]
mod python;
#[path = "../it/times.rs"]
mod times;
