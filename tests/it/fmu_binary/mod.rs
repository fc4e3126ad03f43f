//! The library inside exported FMUs, called as C would call it.

mod fmi3;
mod legality;
mod misuse;
mod model_exchange;
mod raw;
mod states;

use crate::command::own_library;
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter};
use pilotage_abi::fmi2::{Function, Status, Type};
use raw::{Instance, Messages, Raw, call};

fn pilot() -> Model {
    Model::pilot(&PAPER_THETA, 1.0)
}

fn quadcopter() -> Model {
    Model::quadcopter(&Quadcopter::default())
}

/// Flies ten steps with changing inputs; every value after each step, as bits.
fn fly(instance: &Instance, phase: usize) -> Vec<Vec<u64>> {
    let input = instance.raw.model.variables()[0].name.clone();
    (0..10)
        .map(|k| {
            let value = ((k + phase) as f64 * 0.7).sin();
            assert_eq!(instance.set(&input, value), Status::OK);
            assert_eq!(instance.slope(&input, 0.1 * value), Status::OK);
            assert_eq!(instance.step(k as f64 * 0.05, 0.05), Status::OK);
            instance.bits()
        })
        .collect()
}

/// A whole life: instantiated, initialised, flown, freed.
fn life(raw: &Raw, phase: usize) -> Vec<Vec<u64>> {
    let messages = Messages::default();
    let instance = raw.instantiate(&messages);
    instance.initialize();
    let flight = fly(&instance, phase);
    assert_eq!(call!(instance, Terminate), Status::OK);
    drop(instance);
    assert_eq!(messages.take(), [""; 0]);
    flight
}

/// FMI rules 4, 18 and 20: every function of both versions is there, and nothing else.
#[test]
#[cfg(target_os = "linux")]
fn library_exports_the_standard_and_nothing_else_and_needs_the_system_alone() {
    use object::Endianness;
    let library = own_library();
    use object::read::elf::{Dyn, ElfFile64};
    let file = ElfFile64::<Endianness>::parse(&*library).unwrap();
    use object::Object;
    let mut found: Vec<_> = (file.exports().unwrap().iter())
        .map(|e| String::from_utf8_lossy(e.name()).into_owned())
        .collect();
    let fmi2 = Function::ALL.iter().map(|f| f.name());
    let fmi3 = pilotage_abi::fmi3::Function::ALL.iter().map(|f| f.name());
    let mut expected: Vec<_> = fmi2.chain(fmi3).map(str::to_owned).collect();
    found.sort();
    expected.sort();
    assert_eq!(found, expected);

    let endian = file.endian();
    let (entries, strings) = file
        .elf_section_table()
        .dynamic(endian, file.data())
        .unwrap()
        .map(|(entries, strings)| {
            let strings = file
                .elf_section_table()
                .strings(endian, file.data(), strings);
            (entries, strings.unwrap())
        })
        .unwrap();
    for entry in entries
        .iter()
        .filter(|e| e.tag(endian) == object::elf::DT_NEEDED)
    {
        let needed = entry.string(endian, strings).unwrap();
        let needed = String::from_utf8_lossy(needed);
        // All of these are glibc's.
        let system = ["libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0"];
        let loader = needed.starts_with("ld-linux");
        assert!(loader || system.contains(&&*needed), "{needed}");
    }
}

#[test]
fn library_holds_no_path_of_the_machine_that_built_it() {
    let library = own_library();
    let root = env!("CARGO_MANIFEST_DIR").as_bytes();
    assert!(!library.windows(root.len()).any(|w| w == root));
}

/// FMI rule 28: instances share nothing.
#[test]
fn eight_threads_fly_as_one_does() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let serial: Vec<_> = (0..8).map(|i| life(&raw, i)).collect();
        assert_ne!(serial[0], serial[1]);
        let parallel: Vec<_> = std::thread::scope(|scope| {
            let raw = &raw;
            let threads: Vec<_> = (0..8)
                .map(|i| scope.spawn(move || [(); 20].map(|()| life(raw, i))))
                .collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        for (alone, among_others) in serial.iter().zip(parallel) {
            assert!(among_others.iter().all(|flight| flight == alone));
        }
    }
}

/// FMI rule 28: nor do two FMUs with the same library.
#[test]
fn the_same_library_loaded_twice_serves_two_models() {
    let (one, other) = (
        Raw::new(pilot()),
        Raw::new(Model::pilot(&[1.0, 2.0, 0.1, 0.2], 0.5)),
    );
    let alone = (life(&one, 0), life(&other, 0));
    let (m1, m2) = (Messages::default(), Messages::default());
    let (a, b) = (one.instantiate(&m1), other.instantiate(&m2));
    a.initialize();
    b.initialize();
    assert!((fly(&a, 0), fly(&b, 0)) == alone);
}

/// FMI rule 24: a reset instance is as good as a new one.
#[test]
fn reset_is_as_good_as_new() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let fresh = life(&raw, 3);
        let messages = Messages::default();
        let instance = raw.instantiate(&messages);
        let last = raw.model.variables()[raw.model.starts()].last().unwrap();
        assert_eq!(instance.set(&last.name, 0.5), Status::OK);
        instance.initialize();
        fly(&instance, 5);
        assert_eq!(call!(instance, Reset), Status::OK);
        instance.initialize();
        assert!(fly(&instance, 3) == fresh);
        // Also after an error.
        assert_eq!(instance.step(99.0, 0.1), Status::ERROR);
        assert_eq!(call!(instance, Reset), Status::OK);
        instance.initialize();
        assert!(fly(&instance, 3) == fresh);
    }
}

/// FMI rule 25: steps are counted, so that results do not depend on rounding.
#[test]
fn rounding_of_the_importers_times_leaves_no_trace() {
    let h = 0.1;
    let n = 150;
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let run = |points: &mut dyn FnMut(usize) -> (f64, f64)| {
            let messages = Messages::default();
            let instance = raw.instantiate(&messages);
            let input = raw.model.variables()[0].name.clone();
            assert_eq!(instance.set(&input, 0.3), Status::OK);
            instance.initialize();
            for k in 0..n {
                let (time, step) = points(k);
                assert_eq!(
                    instance.step(time, step),
                    Status::OK,
                    "{:?}",
                    messages.take()
                );
            }
            // All but time itself, which is the importer's.
            let mut bits = instance.bits();
            bits.truncate(raw.model.variable_table().time());
            bits
        };
        let products = run(&mut |k| (k as f64 * h, h));
        let mut sum = 0.0;
        let sums = run(&mut |_| {
            let point = (sum, h);
            sum += h;
            point
        });
        let differences = run(&mut |k| (k as f64 * h, (k + 1) as f64 * h - k as f64 * h));
        assert!(products == sums && products == differences);
    }
}

/// FMI rule 30: 5,000 cycles. Runs in a process of its own, since other tests use memory too: the test starts itself again.
#[test]
#[cfg(target_os = "linux")]
fn five_thousand_lives_leave_nothing_behind() {
    const INSIDE: &str = "PILOTAGE_TEST_FIVE_THOUSAND_LIVES";
    if std::env::var_os(INSIDE).is_some() {
        return five_thousand_lives();
    }
    let name = "fmu_binary::five_thousand_lives_leave_nothing_behind";
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture"])
        .env(INSIDE, "1")
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}\n{errors}");
    assert!(printed.contains("1 passed"), "{printed}");
}

#[cfg(target_os = "linux")]
fn five_thousand_lives() {
    let resident_pages = || -> usize {
        let text = std::fs::read_to_string("/proc/self/statm").unwrap();
        text.split(' ').nth(1).unwrap().parse().unwrap()
    };
    let files = || std::fs::read_dir("/proc/self/fd").unwrap().count();
    let mut raw = Raw::new(pilot());
    let path = Raw::binary(&raw.model, raw.folder.path());
    let mut lives = |n: usize| {
        for _ in 0..n {
            life(&raw, 0);
            let messages = Messages::default();
            let instance = raw.instantiate(&messages);
            instance.initialize();
            let state = instance.get_state(std::ptr::null_mut());
            let (status, copy) = instance.deserialize(&instance.serialize(state));
            assert_eq!(status, Status::OK);
            instance.free_state(copy);
            instance.free_state(state);
            assert_eq!(instance.step(1.0, 0.1), Status::ERROR);
            drop(instance);
            assert!(
                raw.try_instantiate(Some("x"), Type::CO_SIMULATION, Some("wrong"), None, None)
                    .is_null()
            );
            // Loaded anew: thread-local storage and file handles must come back too.
            // SAFETY: the library is ours; its initialization does nothing.
            raw.library = unsafe { libloading::Library::new(&path) }.unwrap();
        }
    };
    lives(500);
    let before = (resident_pages(), files());
    lives(5000);
    let after = (resident_pages(), files());
    assert_eq!(after.1, before.1, "open files");
    // 5,000 lives that each left 100 bytes behind would be 122 pages.
    assert!(
        after.0 < before.0 + 100,
        "{} pages, then {}",
        before.0,
        after.0
    );
}
