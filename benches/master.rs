//! Overhead of the master per communication step: pilot and quadcopter as exported FMUs, coupled by the master and by a
//! bare loop over the same functions; and the additional cost of watching and of isolation. Run with
//! `cargo bench --bench master`.

use libloading::Library;
use pilotage::cosim::recorder::Signal;
use pilotage::cosim::{
    Algorithm, Clock, CsvRecorder, Ending, FmuComponent, Isolated, Limits, Program, Recorder,
    System, fmu_component::isolated, run,
};
use pilotage::export::{Export, Provenance};
use pilotage::fmi::{Fmu, fmu};
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter};
use pilotage_abi::fmi2::functions::pointers;
use pilotage_abi::fmi2::{CallbackFunctions, Component, FALSE, Function, Status, TRUE, Type};
use pilotage_process::Page;
use std::ffi::CString;
use std::fs::File;
use std::hint::black_box;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;

const STEPS: u64 = 50_000;
const H: f64 = 1e-3;
const REPETITIONS: usize = 9;
const TARGET: f64 = 10.0;
/// Value references of the pilot (target, position; stick, error) and of the quadcopter (stick; z and
/// five more).
const PILOT_OUTPUTS: [u32; 2] = [3, 4];
const VEHICLE_OUTPUTS: [u32; 6] = [2, 3, 4, 5, 6, 7];

/// The argument of a process that serves an isolated FMU.
const SERVES: &str = "isolated";

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, word, channel] = arguments.as_slice()
        && word == SERVES
    {
        pilotage_process::end_with_parent().expect("its parent is there");
        isolated::serve(Path::new(channel)).expect("there is a channel");
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = ["pilot.fmu", "quadcopter.fmu"].map(|name| folder.path().join(name));
    let models = [
        (Model::pilot(&PAPER_THETA, 1.0), Provenance::paper()),
        (
            Model::quadcopter(&Quadcopter::default()),
            Provenance::vehicle(None),
        ),
    ];
    for ((model, provenance), file) in models.iter().zip(&files) {
        let export = Export::new(model, provenance);
        export.write(file).expect("the model is exported");
    }
    let libraries = files.each_ref().map(|file| {
        let mut fmu = Fmu::open(file).expect("the FMU opens");
        fmu.load().expect("the FMU loads")
    });
    // In turn, so that other load on the machine affects all of them; the minimum counts.
    let mut least = [f64::INFINITY; 5];
    for _ in 0..REPETITIONS {
        let times = [
            bare(&libraries),
            coupled(inside(&libraries), &mut Nothing),
            coupled(
                inside(&libraries),
                &mut CsvRecorder::new(BufWriter::new(file())),
            ),
            coupled(one_isolated(&libraries, &files), &mut Nothing),
            coupled(files.each_ref().map(|file| outside(file)), &mut Nothing),
        ];
        for (least, time) in least.iter_mut().zip(times) {
            *least = least.min(time);
        }
    }
    // From here on the library notes its calls.
    let page = Page::create().expect("a page");
    pilotage_process::attach(page.path()).expect("it is one");
    let watched = (0..REPETITIONS).map(|_| coupled(inside(&libraries), &mut Nothing));
    let watched = watched.fold(f64::INFINITY, f64::min);
    let [bare, master, csv, one, both] = least;
    println!("{STEPS} Jacobi steps of {H} s, pilot and quadcopter FMU, µs per communication step:");
    println!("  bare loop over the FMUs' functions {bare:8.3}");
    println!(
        "  master                             {master:8.3}  overhead {:6.3}",
        master - bare
    );
    println!(
        "  master, rows into a CSV file      {csv:8.3}  overhead {:6.3}",
        csv - bare
    );
    println!(
        "  master, calls noted (watched)      {watched:8.3}  over master {:6.3}",
        watched - master
    );
    println!(
        "  master, the quadcopter isolated    {one:8.3}  over master {:6.3}",
        one - master
    );
    println!(
        "  master, both isolated              {both:8.3}  over master {:6.3}",
        both - master
    );
}

/// A temporary file; `std::io::sink` would skip the formatting.
fn file() -> File {
    tempfile::tempfile().expect("a temporary file")
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

type Both = [Box<dyn pilotage::cosim::Component>; 2];

/// Instances in this process.
fn inside(libraries: &[fmu::Library; 2]) -> Both {
    libraries.each_ref().map(|library| {
        let component = FmuComponent::new(library, "own").expect("the FMU instantiates");
        Box::new(component) as Box<dyn pilotage::cosim::Component>
    })
}

/// An instance in a separate process.
fn outside(file: &Path) -> Box<dyn pilotage::cosim::Component> {
    let program = Program {
        path: std::env::current_exe().expect("it is known"),
        arguments: vec![SERVES.into()],
    };
    let isolated = Isolated::open(&program, Limits::default(), file, "own", None);
    Box::new(isolated.expect("the FMU instantiates"))
}

/// The pilot in this process, the vehicle isolated.
fn one_isolated(libraries: &[fmu::Library; 2], files: &[PathBuf; 2]) -> Both {
    let [pilot, _] = inside(libraries);
    [pilot, outside(&files[1])]
}

/// Microseconds per step, coupled by the master, including initialization, which is small.
fn coupled(components: Both, recorder: &mut dyn Recorder) -> f64 {
    let mut system = System::new();
    for (component, name) in components.into_iter().zip(["pilot", "quadcopter"]) {
        system.add(name, component).expect("names differ");
    }
    system
        .connect("pilot.stick", "quadcopter.stick")
        .expect("they fit");
    system
        .connect("quadcopter.z", "pilot.position")
        .expect("they fit");
    system
        .set("pilot.target", &TARGET.to_string())
        .expect("it fits");
    let clock = Clock::new(0.0, STEPS as f64 * H, H).expect("it divides");
    let started = Instant::now();
    let run = run(system, &clock, None, Algorithm::Jacobi, recorder).expect("it begins");
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    started.elapsed().as_secs_f64() * 1e6 / STEPS as f64
}

/// The functions of an FMU that a loop needs, and an instance.
struct Bare {
    component: Component,
    get: pointers::GetReal,
    set: pointers::SetReal,
    step: pointers::DoStep,
    free: pointers::FreeInstance,
    _library: Library,
}

impl Bare {
    fn new(library: &fmu::Library) -> Self {
        let path = library.bindings().next().expect("a binary").path();
        // SAFETY: the library is loaded already and is our own.
        let own = unsafe { Library::new(path) }.expect("it loads again");
        let description = library.description();
        let guid = CString::new(description.guid.as_str()).expect("no NUL");
        let resources = path
            .ancestors()
            .nth(3)
            .expect("binaries/platform/file")
            .join("resources");
        let uri = CString::new(format!("file://{}", resources.display())).expect("no NUL");
        let callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: std::ptr::null_mut(),
        };
        // SAFETY: each symbol has the type that the standard gives to the function of its name.
        let (instantiate, setup, enter, exit, get, set, step, free) = unsafe {
            (
                *own.get::<pointers::Instantiate>(Function::Instantiate.symbol())
                    .expect("there"),
                *own.get::<pointers::SetupExperiment>(Function::SetupExperiment.symbol())
                    .expect("there"),
                *own.get::<pointers::EnterInitializationMode>(
                    Function::EnterInitializationMode.symbol(),
                )
                .expect("there"),
                *own.get::<pointers::ExitInitializationMode>(
                    Function::ExitInitializationMode.symbol(),
                )
                .expect("there"),
                *own.get::<pointers::GetReal>(Function::GetReal.symbol())
                    .expect("there"),
                *own.get::<pointers::SetReal>(Function::SetReal.symbol())
                    .expect("there"),
                *own.get::<pointers::DoStep>(Function::DoStep.symbol())
                    .expect("there"),
                *own.get::<pointers::FreeInstance>(Function::FreeInstance.symbol())
                    .expect("there"),
            )
        };
        let tolerance = description
            .default_experiment
            .and_then(|e| e.tolerance)
            .unwrap_or(1e-9);
        let stop = STEPS as f64 * H;
        // SAFETY: our own FMU accepts NULL callbacks and copies what it is given; the calls are in the
        // standard's order on an instance that is alive.
        let component = unsafe {
            let name = c"bare".as_ptr();
            let kind = Type::CO_SIMULATION;
            let component = instantiate(
                name,
                kind,
                guid.as_ptr(),
                uri.as_ptr(),
                &raw const callbacks,
                FALSE,
                FALSE,
            );
            assert!(!component.is_null());
            assert_eq!(
                setup(component, TRUE, tolerance, 0.0, TRUE, stop),
                Status::OK
            );
            assert_eq!(enter(component), Status::OK);
            assert_eq!(exit(component), Status::OK);
            component
        };
        Self {
            component,
            get,
            set,
            step,
            free,
            _library: own,
        }
    }

    fn set(&self, references: &[u32], values: &[f64]) {
        // SAFETY: the instance is alive, both arrays are of that length.
        let status = unsafe {
            (self.set)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_ptr(),
            )
        };
        assert_eq!(status, Status::OK);
    }

    fn get(&self, references: &[u32], values: &mut [f64]) {
        // SAFETY: the instance is alive, both arrays are of that length.
        let status = unsafe {
            (self.get)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_mut_ptr(),
            )
        };
        assert_eq!(status, Status::OK);
    }

    fn step(&self, t: f64) {
        // SAFETY: the instance is alive and between steps.
        let status = unsafe { (self.step)(self.component, t, H, TRUE) };
        assert_eq!(status, Status::OK);
    }
}

impl Drop for Bare {
    fn drop(&mut self) {
        // SAFETY: the instance is alive and not used again.
        unsafe { (self.free)(self.component) };
    }
}

/// Microseconds per step of the loop that the master replaces: the same calls, nothing else.
fn bare(libraries: &[fmu::Library; 2]) -> f64 {
    let [pilot, vehicle] = [Bare::new(&libraries[0]), Bare::new(&libraries[1])];
    let (mut pilot_row, mut vehicle_row) = ([0.0; 2], [0.0; 6]);
    pilot.set(&[1], &[TARGET]);
    pilot.get(&PILOT_OUTPUTS, &mut pilot_row);
    vehicle.get(&VEHICLE_OUTPUTS, &mut vehicle_row);
    let started = Instant::now();
    for k in 0..STEPS {
        let t = k as f64 * H;
        pilot.set(&[2], &[vehicle_row[0]]);
        vehicle.set(&[1], &[pilot_row[0]]);
        pilot.step(t);
        vehicle.step(t);
        pilot.get(&PILOT_OUTPUTS, &mut pilot_row);
        vehicle.get(&VEHICLE_OUTPUTS, &mut vehicle_row);
        black_box((&pilot_row, &vehicle_row));
    }
    started.elapsed().as_secs_f64() * 1e6 / STEPS as f64
}
