//! Repeated co-simulations of pilot and quadcopter, 15 s in steps of 0.05 s, of FMUs that are loaded once: what
//! `benches/python.py` compares with. `cargo bench --bench repeated -- PILOT.fmu QUADCOPTER.fmu COUNT` prints the seconds.

use pilotage::cosim::{
    Algorithm, Clock, Component, Ending, FmuComponent, SeriesRecorder, System, run_open,
};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

const STOP: f64 = 15.0;
const STEP: f64 = 0.05;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    // Cargo says `--bench` to each.
    let given: Vec<&String> = arguments[1..]
        .iter()
        .filter(|own| !own.starts_with("--"))
        .collect();
    let [pilot, quadcopter, count] = given[..] else {
        println!("this is driven by benches/python.py");
        return;
    };
    let count: u32 = count.parse().expect("a number");
    let open = |name: &str, path: &str| -> (String, Box<dyn Component>) {
        let component = FmuComponent::open(Path::new(path), name).expect("the FMU opens");
        (name.to_owned(), Box::new(component))
    };
    let mut components = vec![open("pilot", pilot), open("quadcopter", quadcopter)];
    let clock = Clock::new(0.0, STOP, STEP).expect("it divides");
    let began = Instant::now();
    let mut sum = 0.0;
    for k in 0..count {
        let mut system = System::new();
        for (name, component) in std::mem::take(&mut components) {
            system.add(name, component).expect("names differ");
        }
        let wires = [
            ("pilot.stick", "quadcopter.stick"),
            ("quadcopter.z", "pilot.position"),
        ];
        for (from, to) in wires {
            system.connect(from, to).expect("they fit");
        }
        let target = 5.0 + 10.0 * f64::from(k) / f64::from(count);
        system
            .set("pilot.target", &target.to_string())
            .expect("it fits");
        let mut recorder = SeriesRecorder::with_capacity(302);
        let run =
            run_open(system, &clock, None, Algorithm::Jacobi, &mut recorder).expect("it begins");
        assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
        let height = recorder.series.column("quadcopter.z").expect("an output");
        sum += height.values.last().copied().unwrap_or_default();
        components = run.components.renewed().expect("they can be reset");
    }
    println!("{} {}", began.elapsed().as_secs_f64(), black_box(sum));
}
