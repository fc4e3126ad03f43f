//! Loading, instantiating and freeing again and again; many instances at once.

use crate::foreign;
use pilotage::fmi::{Fmu, Instance, InterfaceType};
use std::process::Command;
use tempfile::tempdir;

/// Set in the process that counts what it holds: other tests would hold more.
const ALONE: &str = "PILOTAGE_TEST_CYCLES_ALONE";

fn initialize(instance: &mut Instance) {
    instance.setup_experiment(None, 0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
}

/// Open files, mappings, threads and unpacked folders of this process.
#[cfg(target_os = "linux")]
fn held() -> [usize; 4] {
    let count = |path: &str| std::fs::read_dir(path).unwrap().count();
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let temporary = std::env::temp_dir();
    [
        count("/proc/self/fd"),
        maps.lines().count(),
        count("/proc/self/task"),
        count(temporary.to_str().unwrap()),
    ]
}

// FMI rule 28, and the crash of other importers after some 1,020 cycles.
#[test]
#[cfg(target_os = "linux")]
fn five_thousand_cycles_leave_nothing_behind() {
    if std::env::var_os(ALONE).is_none() {
        // In memory if there is such a place: unpacking and deleting would mostly wait for the disk.
        let temporary = tempfile::tempdir_in("/dev/shm").or_else(|_| tempdir());
        let temporary = temporary.unwrap();
        let done = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "fmi::cycles::five_thousand_cycles_leave_nothing_behind",
            ])
            .env(ALONE, "1")
            .env("TMPDIR", temporary.path())
            .output()
            .unwrap();
        let output = String::from_utf8_lossy(&done.stdout);
        assert!(
            done.status.success() && output.contains("1 passed"),
            "{output}"
        );
        return;
    }
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    let content = foreign::fmu_of(foreign::DESCRIPTION, foreign::binary_needing_libm());
    std::fs::write(&path, content).unwrap();
    let mut after_some = [0; 4];
    for cycle in 1..=5000 {
        let library = Fmu::open(&path).unwrap().load().unwrap();
        let mut instance = library
            .instantiate("here", InterfaceType::CoSimulation)
            .unwrap();
        drop(library);
        initialize(&mut instance);
        instance.do_step(0.0, 1.0).unwrap();
        drop(instance);
        if cycle == 100 {
            after_some = held();
        }
    }
    let [files, maps, threads, folders] = held();
    assert_eq!(
        [files, threads, folders],
        [after_some[0], after_some[2], after_some[3]]
    );
    // The allocator may split its own mappings.
    assert!(
        maps <= after_some[1] + 4,
        "{maps} mappings, {after_some:?} after 100 cycles"
    );
}

/// `y` of the foreign FMU after steps of 1 s with `u` held, from 0.
fn expected(u: f64, steps: u32) -> f64 {
    u * (1.0 - (-f64::from(steps)).exp())
}

// FMI rule 28: 8 threads make, run and free instances of one loaded library.
#[test]
fn eight_threads_share_a_library() {
    let folder = tempdir().unwrap();
    let path = foreign::file(folder.path(), "good");
    let library = Fmu::open(&path).unwrap().load().unwrap();
    std::thread::scope(|scope| {
        for thread in 0..8 {
            let library = &library;
            scope.spawn(move || {
                for round in 1..=50 {
                    let many =
                        (0..4).map(|_| library.instantiate("here", InterfaceType::CoSimulation));
                    let mut many: Vec<Instance> = many.map(Result::unwrap).collect();
                    many.iter_mut().for_each(initialize);
                    for step in 0..round % 5 {
                        for (k, instance) in many.iter_mut().enumerate() {
                            let u = f64::from(thread * 100 + round) + k as f64;
                            instance.set_real(&[0], &[u]).unwrap();
                            instance.do_step(f64::from(step), 1.0).unwrap();
                        }
                    }
                    for (k, instance) in many.iter_mut().enumerate() {
                        let u = f64::from(thread * 100 + round) + k as f64;
                        let mut y = [f64::NAN];
                        instance.get_real(&[1], &mut y).unwrap();
                        let wanted = expected(u, (round % 5) as u32);
                        assert!((y[0] - wanted).abs() <= 1e-12 * u, "{} {wanted}", y[0]);
                    }
                }
            });
        }
    });
}

// FMI rule 28: a library that keeps its instance in a static is there twice when it is loaded twice.
#[test]
fn a_library_loaded_twice_does_not_share_its_statics() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("foreign.fmu");
    let content = foreign::fmu_of(foreign::DESCRIPTION, foreign::binary_needing_libm());
    std::fs::write(&path, content).unwrap();
    let loaded = || Fmu::open(&path).unwrap().load().unwrap();
    let made = || {
        loaded()
            .instantiate("here", InterfaceType::CoSimulation)
            .unwrap()
    };
    let (mut first, mut second) = (made(), made());
    initialize(&mut first);
    initialize(&mut second);
    first.do_step(0.0, 0.25).unwrap();
    second.do_step(0.0, 0.5).unwrap();
    let mut values = [[0.0]; 2];
    first.get_real(&[1], &mut values[0]).unwrap();
    second.get_real(&[1], &mut values[1]).unwrap();
    assert_eq!(values, [[0.25f64.tanh()], [0.5f64.tanh()]]);
}

/// An instance may go to another thread between calls.
#[test]
fn instances_travel_between_threads() {
    let folder = tempdir().unwrap();
    let path = foreign::file(folder.path(), "good");
    let library = Fmu::open(&path).unwrap().load().unwrap();
    let mut instance = library
        .instantiate("here", InterfaceType::CoSimulation)
        .unwrap();
    initialize(&mut instance);
    instance.set_real(&[0], &[1.0]).unwrap();
    for k in 0..4 {
        let there = std::thread::spawn(move || {
            instance.do_step(f64::from(k), 1.0).unwrap();
            instance
        });
        instance = there.join().unwrap();
    }
    let mut y = [f64::NAN];
    instance.get_real(&[1], &mut y).unwrap();
    assert!((y[0] - expected(1.0, 4)).abs() < 1e-12);
}
