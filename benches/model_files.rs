//! Cost of a model as text or as an FMU: the export of a ten-line model, a step of its FMU and an iteration of a fit,
//! compared with the same equations compiled in; and the fit of the shipped flights with the quadcopter's own FMU as
//! vehicle:
//!
//! ```text
//! cargo bench --bench model_files
//! ```

use pilotage::cosim::{Component, fmu_component};
use pilotage::estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage::export::compile::{Compiler, compile, plan};
use pilotage::export::{Export, Provenance};
use pilotage::flights::TrialSet;
use pilotage::fmi::Fmu;
use pilotage::models::{Model, Pilot, Quadcopter, TextModel, library, traced};
use pilotage_collocation::{
    Bound, Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme,
    solve,
};
use pilotage_cosim::component::Experiment;
use pilotage_expression::Model as Expressions;
use pilotage_models::traced::start_values;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

#[path = "../tests/it/shipped.rs"]
mod shipped;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The ten-line model that is exported.
const CROSSOVER: &str = r#"[model]
name = "crossover"
[inputs]
error = { unit = "m" }
[parameters]
gain = { start = 0.1, unit = "1/m" }
lag = { start = 0.1, unit = "s" }
[states]
arm = { unit = "1", der = "(gain * delay(error, 0.3, 2) - arm) / lag" }
[outputs]
stick = "arm"
"#;

const EXPORTS: usize = 15;
const STEPS: usize = 20_000;
const H: f64 = 0.01;
const ROUNDS: usize = 7;

fn main() -> Result<(), Failure> {
    // One core, so that the figures do not depend on the number of cores.
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()?;
    let folder = tempfile::tempdir()?;
    let seconds = export(folder.path())?;
    println!("export of a ten-line model      {:8.1} ms", 1e3 * seconds);
    let [compiled, text, sources] = steps(folder.path())?;
    println!(
        "step of {H} s of the quadcopter's FMU, µs: compiled in {:.2}, model file {:.2}, ratio {:.2}; its C99 sources {:.2}",
        1e6 * compiled,
        1e6 * text,
        text / compiled,
        1e6 * sources
    );
    let [compiled, text] = iterations()?;
    println!(
        "iteration of the SQP, shipped flights, ms: compiled in {:.3} ({} iterations), model file {:.3} ({}), ratio {:.2}",
        1e3 * compiled.0,
        compiled.1,
        1e3 * text.0,
        text.1,
        text.0 / compiled.0
    );
    println!("fit of the shipped flights, samples as mesh, one start:");
    let file = fitted(folder.path(), "quadcopter")?;
    print_fit("model file", &file, &file);
    print_fit("FMU", &fitted(folder.path(), "text.fmu")?, &file);
    print_fit(
        "FMU without derivatives",
        &fitted(folder.path(), "plain.fmu")?,
        &file,
    );
    Ok(())
}

/// Prints a fit's time, iterations and largest relative difference of a parameter from another fit.
fn print_fit(vehicle: &str, (seconds, fit): &(f64, Fit), (least, file): &(f64, Fit)) {
    let pairs = fit.parameters.iter().zip(&file.parameters);
    let errors = pairs.map(|(own, other)| (own.mean() / other.mean() - 1.0).abs());
    println!(
        "  {vehicle:<24} {seconds:7.3} s, ratio {:4.1}, {:3} iterations, {}, parameters within {:.0e}",
        seconds / least,
        fit.iterations,
        fit.status,
        errors.fold(0.0, f64::max)
    );
}

/// The fastest of several fits with a vehicle, with its time.
fn fitted(folder: &Path, vehicle: &str) -> Result<(f64, Fit), Failure> {
    let path = folder.join("problem.toml");
    std::fs::write(&path, shipped::problem(vehicle))?;
    let file = ProblemFile::read(&path)?;
    let posed = Posed::new(&file, &part::open)?;
    let mut best: Option<(f64, Fit)> = None;
    for _ in 0..7 {
        let fit = fit(&posed, &mut |_| ControlFlow::Continue(()));
        if best
            .as_ref()
            .is_none_or(|best| fit.seconds.total() < best.0)
        {
            best = Some((fit.seconds.total(), fit));
        }
    }
    best.ok_or_else(|| "no fit".into())
}

/// Median time of the whole process [s].
fn export(folder: &Path) -> Result<f64, Failure> {
    std::fs::write(folder.join("crossover.toml"), CROSSOVER)?;
    let mut times = Vec::new();
    for _ in 0..EXPORTS {
        let clock = Instant::now();
        let ended = Command::new(env!("CARGO_BIN_EXE_pilotage"))
            .args(["export", "crossover.toml", "-o", "crossover.fmu"])
            .current_dir(folder)
            .output()?;
        times.push(clock.elapsed().as_secs_f64());
        if !ended.status.success() {
            return Err(String::from_utf8_lossy(&ended.stderr).into());
        }
    }
    times.sort_by(f64::total_cmp);
    Ok(times[EXPORTS / 2])
}

/// Time of a step of each FMU, the last one of the model file's sources, compiled by `cc`, alternating; the minimum of several
/// rounds [s].
fn steps(folder: &Path) -> Result<[f64; 3], Failure> {
    let files: [PathBuf; 3] =
        ["compiled.fmu", "text.fmu", "sources.fmu"].map(|name| folder.join(name));
    let compiled = Model::quadcopter(&Quadcopter::default());
    Export::new(&compiled, &Provenance::vehicle(None)).write(&files[0])?;
    let text = text("quadcopter")?;
    Export::text(&text, &Provenance::default()).write(&files[1])?;
    Export::text(&text, &Provenance::default())
        .sources()
        .write(&files[2])?;
    let mut fmu = Fmu::open(&files[2])?;
    let builds = plan(&mut fmu)?;
    let compiler = Compiler {
        command: vec!["cc".to_owned()],
        limit: 60.0,
    };
    std::fs::write(&files[2], compile(&mut fmu, &builds, &compiler)?)?;
    let plain = shipped::without_derivatives(&std::fs::read(&files[1])?);
    std::fs::write(folder.join("plain.fmu"), plain)?;
    let mut components = Vec::new();
    for file in &files {
        let mut component = fmu_component::open(file, "vehicle", None)?;
        component.setup(&Experiment {
            start: 0.0,
            stop: f64::INFINITY,
            tolerance: None,
        })?;
        component.enter_initialization()?;
        component.exit_initialization()?;
        components.push(component);
    }
    let mut least = [f64::INFINITY; 3];
    let mut begin = 0;
    for _ in 0..ROUNDS {
        for (component, least) in components.iter_mut().zip(&mut least) {
            let seconds = flown(component.as_mut(), begin)?;
            *least = least.min(seconds / STEPS as f64);
        }
        begin += STEPS;
    }
    Ok(least)
}

/// Time of steps with a moving stick and all outputs read [s].
fn flown(component: &mut dyn Component, begin: usize) -> Result<f64, Failure> {
    let handle = |name: &str| {
        let mut variables = component.variables().iter();
        let found = variables.find(|variable| variable.name == name);
        found.map(|variable| variable.handle)
    };
    let stick = handle("stick").ok_or("no stick")?;
    let outputs = ["z", "phi", "v", "q"].map(|name| handle(name).unwrap_or_default());
    let mut values = [0.0; 4];
    let clock = Instant::now();
    for k in begin..begin + STEPS {
        let t = k as f64 * H;
        component.set_reals(&[stick], &[0.1 * (3.0 * t).sin()])?;
        component.step(t, H)?;
        component.get_reals(&outputs, &mut values)?;
    }
    Ok(clock.elapsed().as_secs_f64())
}

fn text(name: &str) -> Result<TextModel, Failure> {
    let model = library::find(name).ok_or("no such model")?;
    Ok(TextModel::parse(model.text, name)?)
}

/// Seconds per iteration and number of iterations, for pilot and vehicle compiled in and as model files.
fn iterations() -> Result<[(f64, usize); 2], Failure> {
    let pilot = Pilot::default();
    let vehicle = Model::quadcopter(&Quadcopter::default());
    let values: Vec<(&str, f64)> = start_values(vehicle.variable_table()).collect();
    let own = Model::pilot(&vec![0.0; pilot.n_parameters()], 1.0);
    let compiled = joint(traced(&vehicle)?, traced(&own)?, &values)?;
    let texts = ["quadcopter", "linear"].map(text);
    let [vehicle, pilot] = texts.map(|text| text.map(|text| text.compiled().model.clone()));
    let text = joint(vehicle?, pilot?, &values)?;
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/trials/trials.toml");
    let trials = TrialSet::read(&[manifest])?;
    let mut least = [(f64::INFINITY, 0); 2];
    for _ in 0..ROUNDS {
        for (model, least) in [&compiled, &text].into_iter().zip(&mut least) {
            let found = solved(model, &trials);
            least.0 = least.0.min(found.0);
            least.1 = found.1;
        }
    }
    Ok(least)
}

/// The closed loop with θ as its parameters.
fn joint(
    vehicle: Expressions,
    pilot: Expressions,
    values: &[(&str, f64)],
) -> Result<Arc<Differentiated>, Failure> {
    let parts = [
        ("vehicle", vehicle.with_values(values.iter().copied())?),
        ("pilot", pilot.with_values([("stick_limit", 1.0)])?),
    ];
    let wires = [
        ("pilot.stick", "vehicle.stick"),
        ("vehicle.z", "pilot.position"),
    ];
    let joint = Expressions::join(&parts, &wires)?;
    let system = joint.observed(&["vehicle.z", "pilot.stick"])?;
    Ok(Arc::new(Differentiated::new(&system)))
}

/// A fit of the shipped flights from rest: seconds per iteration, and number of iterations.
fn solved(model: &Arc<Differentiated>, trials: &TrialSet) -> (f64, usize) {
    let start = [2.0, 4.0, 3.0, 0.02, 0.2, 0.1];
    let runs: Vec<Run> = (trials.fit.iter())
        .map(|trial| Run {
            mesh: trial.time.clone(),
            time: trial.time.clone(),
            inputs: trial.target.iter().map(|target| vec![*target]).collect(),
            measured: vec![Recording {
                values: trial.position.clone(),
                weight: trial.weight,
                loss: Loss::Square,
            }],
            initial: vec![Some(0.0); 9],
            steps: pilotage_collocation::Steps::default(),
        })
        .collect();
    let states: Vec<_> = (runs.iter())
        .map(|run| model.simulate(run, &start, &[0.0; 9]))
        .collect();
    let scales = Scales::of(&states, &start);
    let free = ParameterConstraints::default();
    let bounds = [Bound::at_samples(-1.0, 1.0)];
    let problem = Collocation::new(
        model.clone(),
        free,
        Scheme::Trapezoid,
        runs,
        scales,
        &bounds,
    );
    let z = problem.variables(&states, &start);
    let options = pilotage_sqp::SqpOptions::default();
    let clock = Instant::now();
    let solution = solve(&problem, z, &options, &mut |_| ControlFlow::Continue(()));
    let iterations = solution.work.iterations;
    (
        clock.elapsed().as_secs_f64() / iterations as f64,
        iterations,
    )
}
