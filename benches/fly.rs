//! How regular the steps of a vehicle are that somebody flies: 60 s on an idle machine, and 60 s beside as many busy threads
//! as there are processors.

use pilotage_cosim::NativeComponent;
use pilotage_fly::craft::{Craft, Names};
use pilotage_fly::hand::Hand;
use pilotage_fly::protocol::Protocol;
use pilotage_fly::run::{self, Listener, State};
use pilotage_models::{Model, Quadcopter};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

struct Nobody;

impl Listener for Nobody {
    fn state(&mut self, _state: State) {}
    fn row(&mut self, _row: &[f64]) {}
    fn step(&mut self, _row: &[f64]) {}
    fn stop(&mut self) -> Option<String> {
        None
    }
}

fn main() {
    // Cargo asks what tests there are.
    if std::env::args().any(|argument| argument == "--list") {
        return;
    }
    let make = || {
        Ok(Box::new(NativeComponent::new(Model::quadcopter(
            &Quadcopter::default(),
        ))) as _)
    };
    let craft = Craft::new(
        "quadcopter",
        String::new(),
        &Names::default(),
        Box::new(make),
    )
    .unwrap();
    let text = "[[task]]\nkind = \"step\"\ntarget = 10\nseconds = 60\n";
    let protocol = Protocol::parse(text, "bench", craft.shape()).unwrap();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    for busy in [0, threads] {
        let goes_on = Arc::new(AtomicBool::new(true));
        let spinning: Vec<_> = (0..busy)
            .map(|_| {
                let goes_on = goes_on.clone();
                std::thread::spawn(move || {
                    while goes_on.load(Ordering::Relaxed) {
                        std::hint::spin_loop();
                    }
                })
            })
            .collect();
        let flown = run::fly(
            &craft,
            &protocol.tasks[0],
            1.0,
            &Hand::new(1),
            None,
            &mut Nobody,
        );
        goes_on.store(false, Ordering::Relaxed);
        for thread in spinning {
            thread.join().unwrap();
        }
        let flown = flown.unwrap();
        let place = flown
            .log
            .names
            .iter()
            .position(|own| own.0 == "late")
            .unwrap();
        let late = &flown.log.columns[place];
        let within = late.iter().filter(|late| **late < 1.0).count() as f64 / late.len() as f64;
        println!(
            "{busy} busy threads, {} steps: late by [ms] {}; {:.2} % within 1 ms",
            late.len(),
            flown.lateness,
            100.0 * within
        );
    }
}
