//! Growth of time and memory of a fit with the number of runs and of samples; each size runs in a separate process,
//! whose peak memory is printed.
//!
//! ```text
//! cargo bench --bench scale                         the default fit, all starts counted
//! cargo bench --bench scale -- --start 9,8,7,...    one start, at that θ
//! cargo bench --bench scale -- --scheme trapezoid   with another scheme
//! RAYON_NUM_THREADS=1 cargo bench --bench scale     on one core
//! ```

use clap::Parser;
use pilotage::collocation::Scheme;
use pilotage::models::Quadcopter;
use pilotage::synthetic::{Flight, Flights, Human};
use pilotage::{FlightOptions, Posed, Trial, TrialSet, fit, open};
use serde_json::{Value, json};
use std::error::Error;
use std::ops::ControlFlow;
use std::process::{Command, Stdio};

/// Numbers of runs, half of them to each target.
const RUNS: [usize; 5] = [6, 18, 60, 200, 600];
/// Samples per second [1/s], and the number of runs for which they vary.
const RATES: [usize; 3] = [20, 40, 80];
const RUNS_OF_RATES: usize = 60;

/// How time and memory grow.
#[derive(Debug, Parser)]
struct Args {
    /// Where θ starts; estimated from the data where it is missing.
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    start: Option<Vec<f64>>,
    /// Collocation scheme.
    #[arg(long, default_value_t = Scheme::HermiteSimpson)]
    scheme: Scheme,
    /// One size alone, printed as JSON: runs.
    #[arg(long, requires = "rate")]
    runs: Option<usize>,
    /// And samples per second.
    #[arg(long, requires = "runs")]
    rate: Option<usize>,
    /// Cargo says so.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Cost of one size.
struct Cost {
    unknowns: f64,
    seconds_per_iteration: f64,
    /// Peak [MB]; `None` if the system does not report it.
    memory: Option<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    if let (Some(runs), Some(rate)) = (args.runs, args.rate) {
        println!("{}", measured(runs, rate, args.start, args.scheme)?);
        return Ok(());
    }
    println!("threads: {}", rayon::current_num_threads());
    println!(
        "{:>5} {:>8} {:>9} {:>10} {:>8} {:>12} {:>9}  status",
        "runs", "samples", "unknowns", "iterations", "seconds", "ms/iteration", "peak [MB]"
    );
    let series = |sizes: &[(usize, usize)]| -> Result<Vec<Cost>, Box<dyn Error>> {
        sizes
            .iter()
            .map(|&(runs, rate)| apart(runs, rate, &args.start, args.scheme))
            .collect()
    };
    let runs = series(&RUNS.map(|runs| (runs, RATES[0])))?;
    println!("{}", growth("runs", &runs));
    let rates = series(&RATES.map(|rate| (RUNS_OF_RATES, rate)))?;
    println!("{}", growth("samples", &rates));
    Ok(())
}

/// Fits one size in this process.
fn measured(
    runs: usize,
    rate: usize,
    start: Option<Vec<f64>>,
    scheme: Scheme,
) -> Result<Value, Box<dyn Error>> {
    let flights = TrialSet {
        fit: flights(runs, rate)?,
        ..TrialSet::default()
    };
    let before = peak_memory();
    let mut options = FlightOptions::default();
    options.fit.scheme = Some(scheme);
    if start.is_some() {
        options.fit.starts = Some(1);
        options.theta = start;
    }
    let problem = options.problem(&flights)?;
    let posed = Posed::new(&problem, &open)?;
    let fit = fit(&posed, &mut |_| ControlFlow::Continue(()));
    let solved = fit.solved.as_ref().ok_or("a fit without its solution")?;
    Ok(json!({
        "samples": flights.fit[0].time.len(),
        "unknowns": solved.solution.iterate.z.len(),
        "iterations": fit.starts.iter().map(|own| own.iterations).sum::<usize>(),
        "seconds": fit.seconds.total(),
        "status": fit.status.as_str(),
        "memory_before": before,
        "memory": peak_memory(),
    }))
}

/// Fits one size in a separate process and prints a line.
fn apart(
    runs: usize,
    rate: usize,
    start: &Option<Vec<f64>>,
    scheme: Scheme,
) -> Result<Cost, Box<dyn Error>> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["--runs", &runs.to_string(), "--rate", &rate.to_string()]);
    command.arg(format!("--scheme={scheme}"));
    if let Some(start) = start {
        let start: Vec<String> = start.iter().map(f64::to_string).collect();
        command.arg(format!("--start={}", start.join(",")));
    }
    let output = command.stderr(Stdio::inherit()).output()?;
    if !output.status.success() {
        return Err(format!("{runs} runs at {rate} 1/s: {}", output.status).into());
    }
    let result: Value = serde_json::from_slice(&output.stdout)?;
    let number = |key: &str| {
        let value = result[key].as_f64();
        value.ok_or_else(|| format!("no {key} in {result}"))
    };
    let cost = Cost {
        unknowns: number("unknowns")?,
        seconds_per_iteration: number("seconds")? / number("iterations")?,
        memory: result["memory"].as_f64(),
    };
    println!(
        "{runs:>5} {:>8} {:>9} {:>10} {:>8.2} {:>12.2} {:>9}  {}",
        number("samples")?,
        cost.unknowns,
        number("iterations")?,
        number("seconds")?,
        1e3 * cost.seconds_per_iteration,
        cost.memory
            .map_or("-".into(), |megabytes| format!("{megabytes:.0}")),
        result["status"].as_str().unwrap_or("-")
    );
    Ok(cost)
}

/// Flights of the synthetic human.
fn flights(runs: usize, rate: usize) -> Result<Vec<Trial>, Box<dyn Error>> {
    let flights = Flights {
        runs: runs / 2,
        rate: rate as f64,
        ..Flights::default()
    };
    let flights = flights.fly(&Human::default(), &Quadcopter::default())?;
    let trial = |own: &Flight| Trial::parse(own.series.to_csv().as_bytes(), &own.name);
    let trials: Result<_, _> = flights.iter().map(trial).collect();
    Ok(trials?)
}

/// Peak resident memory of this process [MB], on Linux.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().trim_end_matches(" kB").parse().ok()?;
    Some(kilobytes / 1e3)
}

/// Exponents of time per iteration and of memory as functions of the unknowns.
fn growth(what: &str, costs: &[Cost]) -> String {
    let time = exponent(costs.iter().map(|c| (c.unknowns, c.seconds_per_iteration)));
    let known = costs.iter().filter_map(|c| Some((c.unknowns, c.memory?)));
    let memory = exponent(known);
    format!("over {what}: time per iteration grows as n^{time:.2}, memory as n^{memory:.2}\n")
}

/// Slope of the regression line in logarithms; NaN for fewer than two points.
fn exponent(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let points: Vec<(f64, f64)> = points.map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean =
        |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let product = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>();
    product / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}
