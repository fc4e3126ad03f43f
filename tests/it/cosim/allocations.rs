//! The stepping loop does not allocate.

use super::slaves::Linear;
use pilotage::cosim::{
    Algorithm, Clock, Control, Coupling, CsvRecorder, Recorder, SeriesRecorder, System, Thinned,
    run,
};
use std::alloc::{GlobalAlloc, Layout, System as Heap};
use std::cell::Cell;

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

/// Number of allocations of a run with that many steps of two slaves that hold or follow their inputs.
fn allocations(steps: u32, coupling: Coupling, follow: bool, recorder: &mut dyn Recorder) -> u64 {
    let mut system = System::new();
    for (name, from) in [("a", 1.0), ("b", -1.0)] {
        let slave = Linear::new(-1.0, 0.5, 1.0, 0.1).from(from).revocable();
        let slave = if follow { slave.following() } else { slave };
        system.add(name, Box::new(slave)).unwrap();
    }
    system.connect("a.y", "b.u").unwrap();
    system.connect("b.y", "a.u").unwrap();
    let clock = Clock::new(0.0, 0.1 * f64::from(steps), 0.1).unwrap();
    let before = ALLOCATIONS.get();
    run(system, &clock, None, coupling, recorder).unwrap();
    ALLOCATIONS.get() - before
}

#[test]
fn more_steps_allocate_no_more() {
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
    for coupling in couplings {
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
                let csv = CsvRecorder::new(Dropping);
                allocations(steps, coupling, follow, &mut Thinned::new(csv, None, 3))
            };
            assert_eq!(thinned(10), thinned(1000), "{coupling:?}");
        }
    }
}
