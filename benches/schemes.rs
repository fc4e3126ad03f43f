//! Cost of each collocation scheme, and the bias of θ due to its discretisation alone: flights of the continuous-time
//! model with a known θ, without noise, are fitted with every scheme.
//!
//! ```text
//! cargo bench --bench schemes                             prints the table of docs/schemes.md
//! cargo bench --bench schemes -- --write docs/schemes.md  puts it into that page
//! ```

use pilotage::collocation::{Scheme, rk4};
use pilotage::estimation::file::{Mesh, Options};
use pilotage::flights::options::InitialPosition;
use pilotage::models::quadcopter::N_STATES;
use pilotage::models::{Pilot, Quadcopter};
use pilotage::sqp::Status;
use pilotage::{Fit, FlightOptions, Posed, Trial, TrialSet, fit, open};
use rayon::ThreadPoolBuilder;
use std::error::Error;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// θ of the flights: a lead of 2.75 s, and lags of some rad/s.
const THETA: [f64; 6] = [12.0, 17.0, 8.0, -0.2, -0.55, -0.05];
/// His structure.
const PILOT: Pilot = Pilot { order: 3 };
/// Targets [m].
const TARGETS: [f64; 2] = [10.0, 20.0];
/// Duration of a flight [s].
const DURATION: f64 = 15.0;
/// Samples per second [1/s].
const RATE: f64 = 20.0;
/// Integration step of the flights [s]: its error is far below every bias here.
const STEP: f64 = 2.5e-4;
/// Start of the fits relative to the true θ, per component.
const OFF: [f64; 6] = [1.05, 0.95, 1.03, 0.97, 1.05, 0.95];
/// Number of fits whose median time the table shows.
const REPETITIONS: usize = 5;

/// Lines between which `--write` puts the table.
const BEGIN: &str = "<!-- table: cargo bench --bench schemes -- --write docs/schemes.md -->\n";
const END: &str = "<!-- end of table -->\n";

/// The schemes and meshes that the table compares.
fn cases() -> Vec<(Scheme, Mesh)> {
    use Scheme::*;
    let on_samples = [
        Euler,
        Trapezoid,
        HermiteSimpson,
        Gauss(1),
        Gauss(2),
        Gauss(3),
        Radau(1),
        Radau(2),
        Radau(3),
        Lobatto(4),
        Bernstein(2),
        Bernstein(4),
        FiniteDifference(2),
        FiniteDifference(4),
    ];
    let apart = [
        (Euler, 0.0125),
        (Euler, 0.003_125),
        (Trapezoid, 0.0125),
        (HermiteSimpson, 0.1),
        (HermiteSimpson, 0.2),
        (Gauss(2), 0.2),
        (Gauss(3), 0.5),
        (Radau(3), 0.5),
        (Lobatto(8), 1.0),
        (FiniteDifference(4), 0.1),
    ];
    let on_samples = on_samples.map(|scheme| (scheme, Mesh::Samples));
    let apart = apart.map(|(scheme, step)| (scheme, Mesh::Step(step)));
    on_samples.into_iter().chain(apart).collect()
}

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let flights = TrialSet {
        fit: TARGETS.map(flight).into(),
        ..TrialSet::default()
    };
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut table = String::from(
        "| scheme | mesh | order | unknowns | iterations | ms | worst bias | θ1 | θ2 | θ3 | θ4 | θ5 | θ6 |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    print!("{table}");
    for (scheme, mesh) in cases() {
        let line = pool.install(|| line(&flights, scheme, mesh))?;
        print!("{line}");
        table += &line;
    }
    if let Some(page) = page() {
        let text = std::fs::read_to_string(&page)?;
        let (before, rest) = text.split_once(BEGIN).ok_or("no place for the table")?;
        let (_, after) = rest.split_once(END).ok_or("no end of the table")?;
        std::fs::write(&page, format!("{before}{BEGIN}{table}{END}{after}"))?;
    }
    Ok(())
}

/// The argument after `--write`.
fn page() -> Option<PathBuf> {
    let mut arguments = std::env::args().skip_while(|a| a != "--write");
    arguments.nth(1).map(PathBuf::from)
}

/// One line of the table.
fn line(flights: &TrialSet, scheme: Scheme, mesh: Mesh) -> Result<String, Failure> {
    let options = FlightOptions {
        // The flights start exactly at the first sample, and only the scheme's error is of interest.
        initial_position: InitialPosition::Known,
        stable_loop: false,
        theta: Some(THETA.iter().zip(OFF).map(|(t, off)| t * off).collect()),
        fit: Options {
            scheme: Some(scheme),
            mesh,
            starts: Some(1),
            ..Options::default()
        },
        ..FlightOptions::default()
    };
    let problem = options.problem(flights)?;
    let posed = Posed::new(&problem, &open)?;
    let once = || fit(&posed, &mut |_| ControlFlow::Continue(()));
    let fit = once();
    let mut times = vec![fit.seconds.total()];
    times.extend((1..REPETITIONS).map(|_| once().seconds.total()));
    times.sort_by(f64::total_cmp);
    let theta = (1..).map_while(|k| fit.value(&format!("pilot.theta{k}")));
    let biases: Vec<f64> = (theta.zip(THETA))
        .map(|(fitted, truth)| 100.0 * (fitted / truth - 1.0))
        .collect();
    let worst = biases.iter().fold(0.0_f64, |m, b| m.max(b.abs()));
    let mesh = match mesh {
        Mesh::Step(step) => format!("{step} s"),
        _ => "samples".into(),
    };
    let each: Vec<String> = biases.iter().map(|b| percent(*b, true)).collect();
    Ok(format!(
        "| {scheme} | {mesh} | {} | {} | {} | {:.1} | {} | {} |\n",
        scheme.order(),
        fit.solved
            .as_ref()
            .map_or(0, |own| own.solution.iterate.z.len()),
        iterations(&fit),
        1e3 * times[REPETITIONS / 2],
        percent(worst, false),
        each.join(" | ")
    ))
}

/// Iterations, and how the fit ended if it did not converge.
fn iterations(fit: &Fit) -> String {
    match fit.status == Status::Converged {
        true => fit.iterations.to_string(),
        false => format!("{} ({})", fit.iterations, fit.status),
    }
}

/// Two significant digits, if they are meaningful.
fn percent(value: f64, sign: bool) -> String {
    let size = value.abs();
    if size > 1e3 {
        return "> 1000 %".into();
    }
    let decimals = (1.0 - size.log10().floor()).max(0.0) as usize;
    match (size < 1e-4, sign) {
        (true, _) => "< 0.0001 %".into(),
        (_, true) => format!("{value:+.decimals$} %"),
        (_, false) => format!("{value:.decimals$} %"),
    }
}

/// A flight of pilot and vehicle in continuous time from rest, by the classical Runge–Kutta method.
fn flight(target: f64) -> Trial {
    let substeps = (1.0 / (RATE * STEP)).round() as usize;
    let samples = (DURATION * RATE).round() as usize + 1;
    let mut x = vec![0.0; N_STATES + PILOT.order];
    let (mut position, mut stick) = (Vec::new(), Vec::new());
    for _ in 0..samples {
        position.push(x[0]);
        stick.push(PILOT.output(&x[N_STATES..], &THETA));
        (0..substeps).for_each(|_| rk4(&mut x, STEP, 1, |x, _| slope(x, target)));
    }
    let largest = stick.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    assert!(
        largest < 0.99,
        "{target} m: the stick stays off its limits, but reaches {largest}"
    );
    Trial {
        note: None,
        time_unit: "s".into(),
        name: format!("{target} m"),
        origin: format!("{target} m"),
        sha256: String::new(),
        time: (0..samples).map(|k| k as f64 / RATE).collect(),
        target: vec![target; samples],
        position,
        stick: Some(stick),
        weight: 1.0,
    }
}

/// Slopes of the states of vehicle and pilot.
fn slope(x: &[f64], target: f64) -> Vec<f64> {
    let vehicle = Quadcopter::default();
    let (of_vehicle, of_pilot) = x.split_at(N_STATES);
    let mut dx = vec![0.0; x.len()];
    let (vehicle_slope, pilot_slope) = dx.split_at_mut(N_STATES);
    let stick = PILOT.output(of_pilot, &THETA);
    vehicle.derivative(of_vehicle, stick, vehicle_slope);
    let error = target - vehicle.output(of_vehicle);
    PILOT.derivative(of_pilot, error, &THETA, pilot_slope);
    dx
}
