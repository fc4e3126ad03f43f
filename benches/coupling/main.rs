//! Overhead of the master with FMUs that cost nothing: P controller and integrator in C, 10,000 steps, by a bare loop
//! over their functions, by the master, by the whole command, and by a loop in fmpy, all in one run; and the cost of a
//! step from which `--parallel` pays. Needs a C compiler (`cc`) and Python 3. Run with `cargo bench --bench coupling`;
//! with `-- --long` it also runs 10 million steps and prints the memory that they take.

mod busy;
mod fmus;
// Its other function runs scripts of the tests.
#[allow(dead_code)]
#[path = "../../tests/it/tools/python.rs"]
mod python;

use pilotage::cosim::recorder::Signal;
use pilotage::cosim::{
    Algorithm, Clock, Coupling, CsvRecorder, Ending, FmuComponent, Recorder, SeriesRecorder,
    System, run,
};
use pilotage::fmi::{Fmu, fmu};
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const STEPS: u64 = 10_000;
const H: f64 = 1e-3;
const REPETITIONS: usize = 15;

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // FMUs with one output each, and with four.
    let [few, many] = [1, 4].map(|n| fmus::make(folder.path(), n));
    let libraries = [&few, &many].map(|files| {
        files.each_ref().map(|file| {
            let mut fmu = Fmu::open(file).expect("the FMU opens");
            fmu.load().expect("the FMU loads")
        })
    });
    let csv = || CsvRecorder::in_portions(tempfile::tempfile().expect("a file"), 1 << 18);
    let series = || SeriesRecorder::with_capacity(STEPS as usize + 1);
    // In turn, so that other load on the machine affects all of them; the minimum counts.
    let mut least = [f64::INFINITY; 6];
    for _ in 0..REPETITIONS {
        let times = [
            printed(fmus::bare_loop(folder.path()).args(steps())),
            coupled(&libraries[0], Algorithm::Jacobi.into(), &mut Nothing),
            coupled(&libraries[1], Algorithm::Jacobi.into(), &mut Nothing),
            coupled(&libraries[1], Algorithm::Jacobi.into(), &mut series()),
            into_csv(&libraries[1], csv()),
            command(&many, folder.path()),
        ];
        for (least, time) in least.iter_mut().zip(times) {
            *least = least.min(time);
        }
    }
    let fmpy = (0..3).map(|_| in_fmpy(&few)).fold(f64::INFINITY, f64::min);
    let [bare, master, read, memory, file, command] = least;
    println!("{STEPS} Jacobi steps of {H} s, two FMUs written in C; per communication step:");
    let row = |what: &str, time: f64| {
        println!("  {what:42} {time:9.4} µs {:9.1} x bare loop", time / bare);
    };
    row("bare loop over the FMUs' functions", bare);
    row("master, nothing recorded", master);
    row("master, 8 outputs read, nothing recorded", read);
    row("master, 8 signals kept in memory", memory);
    row("master, 8 signals into a CSV file", file);
    row("loop in fmpy", fmpy);
    println!(
        "fmpy's loop takes {:.0} times as long as the master.",
        fmpy / master
    );
    println!(
        "The whole command, 8 signals into a CSV file: {:.1} ms.",
        command / 1e3
    );
    busy::print();
    if std::env::args().any(|argument| argument == "--long") {
        long(&libraries[0]);
    }
}

/// Discards all rows.
struct Nothing;

impl Recorder for Nothing {
    fn begin(&mut self, _signals: &[Signal]) -> std::io::Result<()> {
        Ok(())
    }

    fn row(&mut self, _time: f64, values: &[f64]) -> std::io::Result<()> {
        black_box(values);
        Ok(())
    }
}

/// Microseconds per step by the master, including initialization, which is small.
fn coupled(libraries: &[fmu::Library; 2], coupling: Coupling, recorder: &mut dyn Recorder) -> f64 {
    let system = system(libraries);
    let clock = Clock::new(0.0, STEPS as f64 * H, H).expect("it divides");
    let started = Instant::now();
    let run = run(system, &clock, None, coupling, recorder).expect("it begins");
    let elapsed = started.elapsed();
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    elapsed.as_secs_f64() * 1e6 / STEPS as f64
}

/// The same, until all rows are in the file, which is closed, and thereby deleted, only afterwards.
fn into_csv(libraries: &[fmu::Library; 2], mut recorder: CsvRecorder<std::fs::File>) -> f64 {
    let stepping = coupled(libraries, Algorithm::Jacobi.into(), &mut recorder);
    let started = Instant::now();
    let file = recorder.finish().expect("there is room");
    let finishing = started.elapsed().as_secs_f64() * 1e6 / STEPS as f64;
    drop(file);
    stepping + finishing
}

fn system(libraries: &[fmu::Library; 2]) -> System {
    let mut system = System::new();
    for (library, name) in libraries.iter().zip(["controller", "integrator"]) {
        let component = FmuComponent::new(library, name).expect("the FMU instantiates");
        system.add(name, Box::new(component)).expect("names differ");
    }
    for (from, to) in [
        ("controller.y", "integrator.u"),
        ("integrator.y", "controller.u"),
    ] {
        system.connect(from, to).expect("they fit");
    }
    system
}

/// Microseconds for the whole command.
fn command(files: &[std::path::PathBuf; 2], folder: &Path) -> f64 {
    let started = Instant::now();
    let ended = Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .arg("cosim")
        .args(
            ["controller", "integrator"]
                .iter()
                .zip(files)
                .map(|(n, f)| format!("{n}={}", f.display())),
        )
        .args(["--connect", "controller.y=integrator.u"])
        .args(["--connect", "integrator.y=controller.u"])
        .args([
            "--stop-time",
            &(STEPS as f64 * H).to_string(),
            "--step",
            &H.to_string(),
            "-o",
        ])
        .arg(folder.join("result.csv"))
        .output()
        .expect("the command runs");
    let elapsed = started.elapsed();
    assert!(
        ended.status.success(),
        "{}",
        String::from_utf8_lossy(&ended.stderr)
    );
    elapsed.as_secs_f64() * 1e6
}

/// Microseconds per step of a loop in fmpy.
fn in_fmpy(files: &[std::path::PathBuf; 2]) -> f64 {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/coupling/fmpy_loop.py");
    let mut command = Command::new(python::interpreter());
    printed(
        command
            .args(["-I", "-B"])
            .arg(script)
            .args(files)
            .args(steps()),
    )
}

/// Number and length of the steps, for another program.
fn steps() -> [String; 2] {
    [STEPS.to_string(), H.to_string()]
}

/// Runs a program that prints its time per step and its result, which must be correct.
fn printed(program: &mut Command) -> f64 {
    let ended = program.output().expect("it runs");
    assert!(
        ended.status.success(),
        "{}",
        String::from_utf8_lossy(&ended.stderr)
    );
    let printed = String::from_utf8_lossy(&ended.stdout);
    let numbers: Vec<f64> = printed
        .split_whitespace()
        .map(|n| n.parse().expect("a number"))
        .collect();
    let [time, y] = numbers[..] else {
        panic!("two numbers, not {printed}")
    };
    assert!((y - 1.0).abs() < 1e-3, "{y} after {} s", STEPS as f64 * H);
    time
}

/// Ten million steps: their time, and their memory beyond that of a run of ten thousand.
fn long(libraries: &[fmu::Library; 2]) {
    let resident = || -> f64 {
        let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
        let pages = text
            .split_whitespace()
            .nth(1)
            .and_then(|n| n.parse::<f64>().ok());
        pages.unwrap_or(f64::NAN) * 4096.0 / 1e6
    };
    let before = resident();
    let clock = Clock::new(0.0, 1e4, H).expect("it divides");
    let started = Instant::now();
    let run = run(
        system(libraries),
        &clock,
        None,
        Algorithm::Jacobi,
        &mut Nothing,
    )
    .expect("it begins");
    println!(
        "{} steps: {:.2} s, {before:.1} MB resident before, {:.1} MB after.",
        run.steps,
        started.elapsed().as_secs_f64(),
        resident()
    );
}
