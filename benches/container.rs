//! Cost of a communication step of a container, beside that of `cosim` of its parts: pilot and quadcopter, as FMUs. Run with
//! `cargo bench --bench container`.

use pilotage::cosim::component::{Component, Experiment};
use pilotage::cosim::recorder::Signal;
use pilotage::cosim::{Algorithm, Clock, FmuComponent, Recorder, Role, System, ValueKind, run};
use std::io;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const STEPS: u64 = 50_000;
const H: f64 = 1e-3;
const REPETITIONS: usize = 7;
const WIRES: [(&str, &str); 2] = [
    ("pilot.stick", "quadcopter.stick"),
    ("quadcopter.z", "pilot.position"),
];

/// Takes rows and forgets them.
struct Nobody;

impl Recorder for Nobody {
    fn begin(&mut self, _: &[Signal]) -> io::Result<()> {
        Ok(())
    }

    fn row(&mut self, _: f64, row: &[f64]) -> io::Result<()> {
        std::hint::black_box(row);
        Ok(())
    }
}

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let pilotage = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pilotage"));
        let output = command.args(arguments).current_dir(folder.path()).output();
        let output = output.expect("the command runs");
        assert!(output.status.success(), "{output:?}");
    };
    pilotage(&["export", "pilot", "--preset", "paper", "-o", "pilot.fmu"]);
    pilotage(&["export", "quadcopter", "-o", "quadcopter.fmu"]);
    println!("ns a step           cosim  container  ratio");
    for algorithm in [Algorithm::Jacobi, Algorithm::Strong] {
        let name = algorithm.to_string();
        let wires = WIRES.map(|(from, to)| format!("{from}={to}"));
        let connect = ["--connect", &wires[0], "--connect", &wires[1]];
        let made = [
            "--step",
            "1e-3",
            "--algorithm",
            &name,
            "-o",
            "one.fmu",
            "--force",
        ];
        let fmus = [
            "container",
            "pilot.fmu",
            "quadcopter.fmu",
            "--set",
            "pilot.target=10",
        ];
        pilotage(&[&fmus[..], &connect, &made].concat());
        let of = |own: &str| folder.path().join(own);
        let parts = best(|| of_parts(&of("pilot.fmu"), &of("quadcopter.fmu"), algorithm));
        let container = best(|| of_container(&of("one.fmu")));
        println!(
            "{name:15} {parts:9.0} {container:10.0} {:6.2}",
            container / parts
        );
    }
}

/// The shortest of some times \[ns\] of a step.
fn best(mut run: impl FnMut() -> f64) -> f64 {
    (0..REPETITIONS)
        .map(|_| run())
        .fold(f64::INFINITY, f64::min)
}

fn of_parts(pilot: &Path, quadcopter: &Path, algorithm: Algorithm) -> f64 {
    let mut system = System::new();
    for (name, path) in [("pilot", pilot), ("quadcopter", quadcopter)] {
        let component = FmuComponent::open(path, name).expect("it opens");
        system.add(name, Box::new(component)).expect("a new name");
    }
    for (from, to) in WIRES {
        system.connect(from, to).expect("they fit");
    }
    system.set("pilot.target", "10").expect("a parameter");
    let clock = Clock::new(0.0, STEPS as f64 * H, H).expect("a clock");
    let begin = Instant::now();
    run(system, &clock, None, algorithm, &mut Nobody).expect("it runs");
    begin.elapsed().as_nanos() as f64 / STEPS as f64
}

/// As an importer does it: a step, then all outputs.
fn of_container(path: &Path) -> f64 {
    let mut own = FmuComponent::open(path, "one").expect("it opens");
    let outputs = own.variables().iter();
    let outputs = outputs.filter(|v| v.role == Role::Output && v.kind == ValueKind::Real);
    let outputs: Vec<u32> = outputs.map(|v| v.handle).collect();
    let mut values = vec![0.0; outputs.len()];
    let experiment = Experiment {
        start: 0.0,
        stop: STEPS as f64 * H,
        tolerance: None,
    };
    own.setup(&experiment).expect("set up");
    own.enter_initialization().expect("initialized");
    own.exit_initialization().expect("initialized");
    let begin = Instant::now();
    for k in 0..STEPS {
        own.step(k as f64 * H, H).expect("a step");
        own.get_reals(&outputs, &mut values).expect("outputs");
        std::hint::black_box(&values);
    }
    let time = begin.elapsed().as_nanos() as f64 / STEPS as f64;
    own.terminate().expect("terminated");
    time
}
