//! Tests in real time: they run one after another, and while no other test runs, since other load on the computer would
//! be measured too.
//!
//!     cargo test --profile quick --test realtime

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
