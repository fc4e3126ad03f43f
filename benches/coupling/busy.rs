//! Cost of a step from which it pays to step components in parallel.

use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{
    Algorithm, Clock, Component, Coupling, Progress, Role, System, ValueKind, Variable, run,
};
use std::time::{Duration, Instant};

/// Number of parallel components, and costs of their steps [µs].
const COMPONENTS: usize = 4;
const COSTS: [f64; 8] = [0.5, 1.0, 2.0, 5.0, 10.0, 50.0, 200.0, 1000.0];

/// Spins for the cost of a step and computes nothing.
struct Busy {
    cost: Duration,
    variables: [Variable; 1],
}

impl Component for Busy {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, _handles: &[u32], _values: &[f64]) -> Result<(), ComponentError> {
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values.fill(0.0);
        Ok(())
    }

    fn step(&mut self, _t: f64, _h: f64) -> Result<Progress, ComponentError> {
        let started = Instant::now();
        while started.elapsed() < self.cost {
            std::hint::spin_loop();
        }
        Ok(Progress::Done)
    }
}

/// Microseconds for a communication step of all components; the minimum of several runs.
fn step(cost: f64, parallel: bool) -> f64 {
    let steps = (5e4 / cost).clamp(50.0, 5000.0) as u64;
    let once = || {
        let mut system = System::new();
        for k in 0..COMPONENTS {
            let component = Busy {
                cost: Duration::from_nanos((1e3 * cost) as u64),
                variables: [Variable::new("y", 0, ValueKind::Real, Role::Output)],
            };
            system
                .add(format!("busy{k}"), Box::new(component))
                .expect("names differ");
        }
        let clock = Clock::new(0.0, steps as f64, 1.0).expect("it divides");
        let coupling = Coupling {
            parallel,
            ..Algorithm::Jacobi.into()
        };
        let started = Instant::now();
        run(system, &clock, None, coupling, &mut super::Nothing).expect("it begins");
        started.elapsed().as_secs_f64() * 1e6 / steps as f64
    };
    (0..5).map(|_| once()).fold(f64::INFINITY, f64::min)
}

/// Prints serial and parallel times for several costs, and the cost from which the parallel one is faster.
pub fn print() {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    println!(
        "{COMPONENTS} components one after another and at the same time, {threads} processors; µs per communication step:"
    );
    let mut pays_from = None;
    for cost in COSTS {
        let (serial, parallel) = (step(cost, false), step(cost, true));
        println!(
            "  a step takes {cost:6.1} µs {serial:9.1} {parallel:9.1} {:6.2} times as fast",
            serial / parallel
        );
        match serial > 1.1 * parallel {
            true => _ = pays_from.get_or_insert(cost),
            false => pays_from = None,
        }
    }
    match pays_from {
        Some(cost) => println!("--parallel pays where a step takes {cost} µs or more."),
        None => println!("--parallel did not pay here."),
    }
}
