//! Regularity of the steps of a vehicle that a person flies: 60 s on an idle machine, and 60 s beside as many busy
//! threads as there are processors. Meanwhile a joystick, read as by the program, moves 100 times a second, and the
//! time from its movement to a step is measured.

use pilotage_cosim::NativeComponent;
use pilotage_fly::craft::{Craft, Names};
use pilotage_fly::hand::Hand;
use pilotage_fly::joystick::{self, Reading};
use pilotage_fly::protocol::Protocol;
use pilotage_fly::run::{self, Listener, State};
use pilotage_models::{Model, Quadcopter};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

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
    // Cargo asks for the list of tests.
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
        let hand = Arc::new(Hand::new(1));
        let moving = moved(&hand, &goes_on);
        let flown = run::fly(&craft, &protocol.tasks[0], 1.0, &hand, None, &mut Nobody);
        goes_on.store(false, Ordering::Relaxed);
        moving.join().unwrap();
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
            "{busy} busy threads, {} steps: late by [ms] {}; {:.2} % within 1 ms; from the stick to a step [ms] {}",
            late.len(),
            flown.lateness,
            100.0 * within,
            flown.to_state
        );
    }
}

/// A pipe in place of a joystick; its axis 0 moves while `goes_on` is set.
fn moved(hand: &Arc<Hand>, goes_on: &Arc<AtomicBool>) -> std::thread::JoinHandle<()> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("js0");
    let made = std::process::Command::new("mkfifo").arg(&path).status();
    assert!(made.unwrap().success());
    let mut options = std::fs::OpenOptions::new();
    let mut pipe = options.read(true).write(true).open(&path).unwrap();
    let reading = Reading::new(vec![0], vec![false]);
    joystick::listen(&path, reading, hand.clone()).unwrap();
    let goes_on = goes_on.clone();
    std::thread::spawn(move || {
        let _folder = folder;
        let mut value = 0i16;
        while goes_on.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_micros(10_137));
            value = (value + 1) % 1000;
            let [low, high] = value.to_ne_bytes();
            pipe.write_all(&[0, 0, 0, 0, low, high, 2, 0]).unwrap();
        }
    })
}
