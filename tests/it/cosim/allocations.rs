//! The stepping loop does not allocate.

use super::components::Linear;
use crate::foreign;
use pilotage::cosim::{
    Algorithm, Clock, Control, Coupling, CsvRecorder, FmuComponent, Recorder, SeriesRecorder,
    System, Thinned, run,
};
use pilotage::export::{Export, Provenance};
use pilotage::fmi::FmiVersion;
use pilotage::models::{Model, Quadcopter};
use std::alloc::{GlobalAlloc, Layout, System as Heap};
use std::cell::Cell;
use std::path::{Path, PathBuf};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts the allocations of each thread.
struct Counting;

// SAFETY: every call goes to the system's allocator as it is; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: handed on from the caller.
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: handed on from the caller.
        unsafe { Heap.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Drops bytes that were formatted; `std::io::sink` would skip the formatting.
struct Dropping;

impl std::io::Write for Dropping {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Number of allocations of a run with that many steps of two components that hold or follow their inputs.
fn allocations(steps: u32, coupling: Coupling, follow: bool, recorder: &mut dyn Recorder) -> u64 {
    let mut system = System::new();
    for (name, from) in [("a", 1.0), ("b", -1.0)] {
        let component = Linear::new(-1.0, 0.5, 1.0, 0.1).from(from).revocable();
        let component = if follow {
            component.following()
        } else {
            component
        };
        system.add(name, Box::new(component)).unwrap();
    }
    system.connect("a.y", "b.u").unwrap();
    system.connect("b.y", "a.u").unwrap();
    let clock = Clock::new(0.0, 0.1 * f64::from(steps), 0.1).unwrap();
    let before = ALLOCATIONS.get();
    run(system, &clock, None, coupling, recorder).unwrap();
    ALLOCATIONS.get() - before
}

/// All algorithms, with and without extrapolation and control of the steps.
fn couplings() -> Vec<Coupling> {
    let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
    let mut couplings = Vec::new();
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel, Algorithm::Strong] {
        for extrapolation in [None, Some(2)] {
            for control in [None, Some(Control::new(1e-3, &clock))] {
                couplings.push(Coupling {
                    extrapolation,
                    control,
                    measure: control.is_some(),
                    ..algorithm.into()
                });
            }
        }
    }
    couplings
}

#[test]
fn more_steps_allocate_no_more() {
    for coupling in couplings() {
        for follow in [false, true] {
            let into_series = |steps| {
                let mut recorder = SeriesRecorder::with_capacity(2000);
                allocations(steps, coupling, follow, &mut recorder)
            };
            assert_eq!(into_series(10), into_series(1000), "{coupling:?}");
            let into_csv =
                |steps| allocations(steps, coupling, follow, &mut CsvRecorder::new(Dropping));
            assert_eq!(into_csv(10), into_csv(1000), "{coupling:?}");
            let thinned = |steps| {
                let mut csv = CsvRecorder::new(Dropping);
                allocations(
                    steps,
                    coupling,
                    follow,
                    &mut Thinned::new(&mut csv, None, 3),
                )
            };
            assert_eq!(thinned(10), thinned(1000), "{coupling:?}");
        }
    }
}

#[path = "../../../benches/coupling/fmus.rs"]
#[allow(dead_code)]
mod in_c;

/// Pairs of FMUs and how they are wired: made in C, of another tool with integers and booleans, and ours of both
/// versions of FMI.
fn pairs(folder: &Path) -> Vec<([PathBuf; 2], Vec<[&'static str; 2]>)> {
    let ring = vec![["a.y", "b.u"], ["b.y", "a.u"]];
    let mut pairs = vec![(in_c::make(folder, 2), ring.clone())];
    let other = folder.join("other.fmu");
    // Texts are allocated: those are left out.
    let is_text = |line: &&str| line.contains("<String") || line.contains("index=\"12\"");
    let lines: Vec<&str> = foreign::DESCRIPTION
        .lines()
        .filter(|line| !is_text(line))
        .collect();
    std::fs::write(
        &other,
        foreign::fmu_of(&lines.join("\n"), foreign::binary()),
    )
    .unwrap();
    let discrete = [
        ["a.n", "b.n_in"],
        ["a.flag", "b.flag_in"],
        ["b.n", "a.n_in"],
    ];
    pairs.push(([other.clone(), other], [ring, discrete.to_vec()].concat()));
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let models = [
            Model::pilot(&[0.3, 1.2, 1.0, -0.006, -0.03, -0.04], 1.0),
            Model::quadcopter(&Quadcopter::default()),
        ];
        let files = ["pilot", "vehicle"].map(|name| folder.join(format!("{name}{version}.fmu")));
        for (model, file) in models.iter().zip(&files) {
            let provenance = Provenance::vehicle(None);
            let export = Export::new(model, &provenance).version(version);
            export.write(file).unwrap();
        }
        pairs.push((files, vec![["a.stick", "b.stick"], ["b.z", "a.position"]]));
    }
    pairs
}

#[test]
fn steps_of_fmus_allocate_nothing_in_the_master() {
    let folder = tempfile::tempdir().unwrap();
    for (files, wires) in pairs(folder.path()) {
        for coupling in couplings() {
            let allocations = |steps: u32| {
                let mut system = System::new();
                for (name, file) in ["a", "b"].iter().zip(&files) {
                    let component = FmuComponent::open(file, name).unwrap();
                    system.add(*name, Box::new(component)).unwrap();
                }
                for [from, to] in &wires {
                    system.connect(from, to).unwrap();
                }
                let clock = Clock::new(0.0, 0.01 * f64::from(steps), 0.01).unwrap();
                let mut recorder = CsvRecorder::new(Dropping);
                let before = ALLOCATIONS.get();
                run(system, &clock, None, coupling, &mut recorder).unwrap();
                ALLOCATIONS.get() - before
            };
            assert_eq!(allocations(5), allocations(100), "{files:?} {coupling:?}");
        }
    }
}
