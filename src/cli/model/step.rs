//! `pilotage model step`: step responses of a model.

use super::super::call;
use super::super::made::made;
use super::super::number::{number, positive};
use super::super::overwrite::{self, OutputKind, Overwrite};
use super::super::progress::Counter;
use super::super::{Failure, Outcome, terminal};
use super::open::{ModelArgs, settable};
use crate::cosim::native_component;
use crate::linear::Mode;
use crate::models::{AnyModel, TextModel};
use crate::report::{StepFigure, step_page};
use crate::series::{Column, Series};
use crate::suggestion::{did_you_mean, suggestion};
use pilotage_sdk::Simulation;
use pilotage_text::number::significant;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Number of evenly spaced points of a step response.
const POINTS: usize = 1000;

/// Further points from the start on, each later than the one before by this fraction: far from the start, modes are others.
const GROWTH: f64 = 0.01;

/// Further points for each mode: their number in its time constant, or in a radian of its oscillation, and the largest of
/// all of them.
const POINTS_OF_MODE: f64 = 40.0;
const MOST_POINTS_OF_MODE: f64 = 10_000.0;

/// Duration of a step response in time constants of the slowest mode.
const TIME_CONSTANTS: f64 = 6.0;

/// A mode whose rate is smaller than this fraction of the fastest one's does not decay.
const ROUNDING: f64 = 1e-12;
/// The same for several poles at 0, of which rounding makes the root.
const MULTIPLE: f64 = 1e-6;

/// Duration of a step response if no mode determines it \[s\].
const SHOWN: f64 = 10.0;

/// Change of a response between two points, relative to its range, above which there are more points between them, and
/// their number; how often it is looked at.
const COARSE: f64 = 0.02;
const PARTS: usize = 10;
const ROUNDS: usize = 5;

/// A response that ends below this fraction of its largest deviation has returned.
const RETURNED: f64 = 1e-3;

/// Relative band around the final value within which a response counts as settled.
const SETTLED: f64 = 0.02;

/// Arguments of `pilotage model step`.
#[derive(Debug, clap::Args)]
pub struct StepArgs {
    /// Input with the step; may be repeated [default: each in turn].
    #[arg(long, value_name = "NAME")]
    input: Vec<String>,
    /// Size of the step, in the unit of the input, from its start value.
    #[arg(long, value_name = "NUMBER", default_value_t = 1.0, value_parser = number, allow_hyphen_values = true)]
    size: f64,
    /// Set a parameter or a start value; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair)]
    set: Vec<(String, f64)>,
    /// Stop time [s] [default: six time constants of the slowest mode].
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    stop_time: Option<f64>,
    /// Write the responses as a table over time, closer where the model's modes are fast.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a page with plots.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

fn pair(text: &str) -> Result<(String, f64), String> {
    let (name, value) = super::super::system::flags::pair(text)?;
    Ok((name, number(&value)?))
}

/// The response of an output to a step.
struct Response {
    input: String,
    output: String,
    unit: String,
    /// Deviation from the run without a step, at each time.
    values: Vec<f64>,
}

/// Characteristics of a response that settles.
struct Settled {
    /// Rise time from 10 % to 90 % of the final value \[s\].
    rise: f64,
    /// Overshoot relative to the final value.
    overshoot: f64,
    /// Settling time into the band [`SETTLED`] \[s\].
    settling: f64,
}

impl Response {
    /// Deviation at the end.
    fn end(&self) -> f64 {
        self.values.last().copied().unwrap_or_default()
    }

    /// The deviation with the largest magnitude.
    fn peak(&self) -> f64 {
        let larger = |a: f64, b: &f64| if b.abs() > a.abs() { *b } else { a };
        self.values.iter().fold(0.0, larger)
    }

    /// Whether it ends where it began: it has no final value to which its course is relative.
    fn has_returned(&self) -> bool {
        self.end().abs() <= RETURNED * self.peak().abs()
    }
}

/// Runs `pilotage model step`.
pub fn run(model: &ModelArgs, args: &StepArgs) -> Result<Outcome, Failure> {
    let outputs = [
        (&args.csv, OutputKind::Result),
        (&args.report, OutputKind::Page),
    ];
    let outputs = outputs.map(|(path, kind)| path.as_deref().map(|path| (path, kind)));
    let outputs: Vec<(&Path, OutputKind)> = outputs.into_iter().flatten().collect();
    let inputs: Vec<PathBuf> = model.file().into_iter().collect();
    args.overwrite.check(&inputs, &outputs)?;
    let model = model.open()?;
    let steps = steps(&model, args)?;
    let modes = modes(&model, args)?;
    let stop = args.stop_time.unwrap_or_else(|| shown(&modes));
    let mut time = times(stop, &modes);
    let progress = Counter::new("points of time", 0);
    // The duration may be that of a mode which is rounding, or of no interest.
    let too_long = |failure: Failure| match args.stop_time {
        Some(_) => failure,
        None => failure.hint(format!(
            "the slowest mode asks for {stop} s; give a shorter --stop-time"
        )),
    };
    let mut responses = stepped(&model, args, &steps, &time, &progress).map_err(too_long)?;
    for _ in 0..ROUNDS {
        let are_coarse = coarse(&responses, time.len() - 1);
        let Some(last) = are_coarse.iter().rposition(|is_coarse| *is_coarse) else {
            break;
        };
        // What comes later stays as it is.
        let (begin, later) = time.split_at(last + 2);
        let begin = finer(begin, &are_coarse);
        let mut again = stepped(&model, args, &steps, &begin, &progress).map_err(too_long)?;
        for (own, before) in again.iter_mut().zip(&responses) {
            own.values.extend_from_slice(&before.values[last + 2..]);
        }
        time = [&begin, later].concat();
        responses = again;
    }
    progress.clear();
    if let Some(path) = &args.csv {
        overwrite::save_table(path, &series(&time, &responses))?;
    }
    if call::takes_tables() {
        call::keep("responses", series(&time, &responses));
    }
    if let Some(path) = &args.report {
        let title = format!("step responses of {}", model.compiled().file.name);
        let page = step_page(&title, &figures(&time, &responses), &made());
        overwrite::save(path, page)?;
    }
    terminal::print(&match args.json {
        true => format!("{:#}\n", to_json(&responses, &time)),
        false => to_text(&model, args, &responses, &time),
    })?;
    Ok(Outcome::Done)
}

/// The responses to a step in each of these inputs.
fn stepped(
    model: &TextModel,
    args: &StepArgs,
    steps: &[usize],
    time: &[f64],
    progress: &Counter,
) -> Result<Vec<Response>, Failure> {
    progress.expect((time.len() * (1 + steps.len())) as u64);
    let rest = simulated(model, args, None, time, progress)?;
    let mut responses = Vec::new();
    for &input in steps {
        let with = simulated(model, args, Some(input), time, progress)?;
        responses.extend(compared(model, input, &rest, &with));
    }
    Ok(responses)
}

/// For each interval, whether a response moves far within it: a step can lead to modes that are faster than those of the
/// start.
fn coarse(responses: &[Response], intervals: usize) -> Vec<bool> {
    let mut coarse = vec![false; intervals];
    for own in responses {
        let far = COARSE * own.peak().abs();
        for (coarse, ends) in coarse.iter_mut().zip(own.values.windows(2)) {
            *coarse |= (ends[1] - ends[0]).abs() > far;
        }
    }
    coarse
}

/// The times with more of them in coarse intervals.
fn finer(time: &[f64], coarse: &[bool]) -> Vec<f64> {
    let mut finer = vec![time[0]];
    for (ends, coarse) in time.windows(2).zip(coarse) {
        let parts = if *coarse { PARTS } else { 1 };
        let part = (ends[1] - ends[0]) / parts as f64;
        finer.extend((1..parts).map(|i| ends[0] + part * i as f64));
        finer.push(ends[1]);
    }
    finer
}

/// The model with the values of `--set`.
fn prepared(model: &TextModel, args: &StepArgs) -> Result<Simulation<TextModel>, Failure> {
    let mut simulation = Simulation::new(model.clone());
    for (name, value) in &args.set {
        let index = found(model, settable(model, name).as_ref())?;
        simulation.set(index, *value)?;
    }
    Ok(simulation)
}

fn found(model: &TextModel, name: &str) -> Result<usize, Failure> {
    let table = model.variables();
    table.index(name).ok_or_else(|| {
        let names = table.variables().iter().map(|own| own.name.as_str());
        let near = did_you_mean(suggestion(name, names));
        Failure::new(format!("the model has no variable `{name}`{near}"))
            .hint("`pilotage model check` lists them")
    })
}

/// Indices of the inputs to which steps are applied.
fn steps(model: &TextModel, args: &StepArgs) -> Result<Vec<usize>, Failure> {
    let inputs = model.variables().inputs();
    if inputs.is_empty() {
        let message = format!("{} has no inputs", model.compiled().file.file);
        return Err(Failure::new(message).hint("`pilotage model simulate` runs it as it is"));
    }
    if args.input.is_empty() {
        return Ok(inputs.collect());
    }
    let index = |name: &String| {
        let index = found(model, name)?;
        match inputs.contains(&index) {
            true => Ok(index),
            false => Err(Failure::new(format!("`{name}` is no input"))
                .hint("`pilotage model check` lists them")),
        }
    };
    args.input.iter().map(index).collect()
}

/// Modes of the model, linearised at its start; none if it cannot be linearised there.
fn modes(model: &TextModel, args: &StepArgs) -> Result<Vec<Mode>, Failure> {
    let mut component = native_component::of_model(AnyModel::Text(model.clone()));
    for (name, value) in &args.set {
        let index = found(model, settable(model, name).as_ref())?;
        let index = u32::try_from(index).unwrap_or(u32::MAX);
        component
            .set_reals(&[index], &[*value])
            .map_err(|error| Failure::new(error.to_string()))?;
    }
    Ok(match component.linearize(0.0) {
        Ok(linear) => Mode::of_poles(&linear.system.poles()),
        Err(_) => Vec::new(),
    })
}

/// Duration of the responses \[s\]: until the slowest decaying mode has decayed.
fn shown(modes: &[Mode]) -> f64 {
    let fastest = modes.iter().map(|mode| mode.pole.norm());
    let fastest = fastest.fold(0.0, f64::max);
    // Several poles at 0 are computed as poles around 0, whose sum is as small as rounding.
    let near = modes
        .iter()
        .filter(|mode| mode.pole.norm() < MULTIPLE * fastest);
    let near: Vec<f64> = near.map(|mode| mode.pole.re).collect();
    let farthest = near.iter().fold(0.0_f64, |most, re| most.max(re.abs()));
    let is_multiple = near.len() > 1 && near.iter().sum::<f64>().abs() < 0.1 * farthest;
    let zero = if is_multiple {
        farthest
    } else {
        ROUNDING * fastest
    };
    let decays = modes.iter().map(|mode| -mode.pole.re);
    let slowest = decays
        .filter(|rate| *rate > zero)
        .fold(f64::INFINITY, f64::min);
    match slowest.is_finite() {
        true => rounded(TIME_CONSTANTS / slowest),
        false => SHOWN,
    }
}

/// Times of the responses \[s\]: evenly spaced, close after the start, and closer where modes are fast, until these have
/// decayed.
fn times(stop: f64, modes: &[Mode]) -> Vec<f64> {
    let even = stop / POINTS as f64;
    let mut times: Vec<f64> = (0..=POINTS)
        .map(|k| stop * k as f64 / POINTS as f64)
        .collect();
    let fastest = modes.iter().map(|mode| 1.0 / mode.pole.norm());
    let first = fastest.fold(even, f64::min).max(1e-9 * even) / POINTS_OF_MODE;
    let growing = std::iter::successors(Some(first), |time| Some(time * (1.0 + GROWTH)));
    times.extend(growing.take_while(|time| *time < stop));
    for mode in modes {
        let spacing = 1.0 / (POINTS_OF_MODE * mode.pole.norm());
        let decay = -mode.pole.re;
        let lasts = if decay > 0.0 {
            TIME_CONSTANTS / decay
        } else {
            stop
        };
        let count = (lasts.min(stop) / spacing).min(MOST_POINTS_OF_MODE);
        if spacing < even && count.is_finite() {
            times.extend((1..=count as usize).map(|k| spacing * k as f64));
        }
    }
    times.retain(|time| *time <= stop);
    times.sort_by(f64::total_cmp);
    times.dedup_by(|after, before| *after - *before <= 1e-9 * *after);
    times
}

/// Rounds up to 1, 2 or 5 times a power of ten.
fn rounded(time: f64) -> f64 {
    let decade = 10_f64.powf(time.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    steps.into_iter().find(|step| *step >= time).unwrap_or(time)
}

/// The outputs at each time, with a step in `input` if given.
fn simulated(
    model: &TextModel,
    args: &StepArgs,
    input: Option<usize>,
    time: &[f64],
    progress: &Counter,
) -> Result<Vec<Vec<f64>>, Failure> {
    let mut simulation = prepared(model, args)?;
    if let Some(input) = input {
        simulation.set(input, simulation.get(input) + args.size)?;
    }
    let outputs: Vec<usize> = model.variables().outputs().collect();
    let mut rows = Vec::with_capacity(time.len());
    for k in 0..time.len() {
        if k > 0 {
            let h = time[k] - time[k - 1];
            simulation.step(h).map_err(|error| {
                let at = time[k - 1] + error.reached;
                Failure::new(format!("the simulation ends at {at} s: {error}"))
            })?;
        }
        let mut row = vec![0.0; outputs.len()];
        simulation.get_all(outputs.iter().copied(), &mut row);
        if let Some(place) = row.iter().position(|value| !value.is_finite()) {
            let name = &model.variables().variables()[outputs[place]].name;
            let cause = simulation.trouble();
            let cause = cause.unwrap_or_else(|| format!("`{name}` is {}", row[place]));
            return Err(Failure::new(format!("at {} s: {cause}", time[k])));
        }
        rows.push(row);
        progress.count();
    }
    Ok(rows)
}

/// The response of each output to a step.
fn compared(
    model: &TextModel,
    input: usize,
    rest: &[Vec<f64>],
    stepped: &[Vec<f64>],
) -> Vec<Response> {
    let table = model.variables();
    let outputs = table.outputs().enumerate();
    outputs
        .map(|(column, index)| {
            let pairs = stepped.iter().zip(rest);
            let values: Vec<f64> = pairs
                .map(|(with, without)| with[column] - without[column])
                .collect();
            let variable = &table.variables()[index];
            Response {
                input: table.variables()[input].name.clone(),
                output: variable.name.clone(),
                unit: variable.unit.name.clone(),
                values,
            }
        })
        .collect()
}

/// Characteristics of a response, if it stays near its final value during the last tenth of the time.
fn settled(response: &Response, time: &[f64]) -> Option<Settled> {
    let (end, stop) = (response.end(), *time.last()?);
    if response.has_returned() {
        return None;
    }
    let relative: Vec<f64> = response.values.iter().map(|value| value / end).collect();
    let outside = relative
        .iter()
        .rposition(|value| (value - 1.0).abs() > SETTLED);
    let from = outside.map_or(0, |last| last + 1);
    if time[from] > 0.9 * stop {
        return None;
    }
    // Linear between two points, here and below.
    let settling = match outside {
        None => time[0],
        Some(last) => {
            let edge = 1.0 + SETTLED.copysign(relative[last] - 1.0);
            let share = (edge - relative[last]) / (relative[from] - relative[last]);
            time[last] + share * (time[from] - time[last])
        }
    };
    let reaches = |part: f64| {
        let k = relative.iter().position(|value| *value >= part)?;
        let Some(before) = k.checked_sub(1) else {
            return Some(time[0]);
        };
        let share = (part - relative[before]) / (relative[k] - relative[before]);
        Some(time[before] + share * (time[k] - time[before]))
    };
    let largest = relative.iter().copied().fold(1.0, f64::max);
    Some(Settled {
        rise: reaches(0.9)? - reaches(0.1)?,
        overshoot: largest - 1.0,
        settling,
    })
}

fn to_text(model: &TextModel, args: &StepArgs, responses: &[Response], time: &[f64]) -> String {
    let stop = time[time.len() - 1];
    let mut text = format!(
        "step responses of {} to {} in each input, over {stop} s\n\n",
        model.compiled().file.name,
        args.size
    );
    let width = |of: fn(&Response) -> usize, least: usize| {
        responses.iter().map(of).max().unwrap_or(0).max(least)
    };
    let inputs = width(|own| own.input.chars().count(), 5);
    let outputs = width(
        |own| own.output.chars().count() + own.unit.chars().count() + 3,
        6,
    );
    text += &format!(
        "  {:inputs$}  {:outputs$}  {:>11}  {:>9}  {:>9}  {:>12}\n",
        "input", "output", "at the end", "rise [s]", "overshoot", "settling [s]"
    );
    for own in responses {
        let output = match own.unit.as_str() {
            "" | "1" => own.output.clone(),
            unit => format!("{} [{unit}]", own.output),
        };
        let end = significant(own.end(), 4);
        let rest = match settled(own, time) {
            Some(settled) => format!(
                "{:>9}  {:>8.1}%  {:>12}",
                significant(settled.rise, 3),
                100.0 * settled.overshoot,
                significant(settled.settling, 3)
            ),
            None if own.peak() == 0.0 => "no answer".to_owned(),
            None if own.has_returned() => {
                format!("returns; {} at most", significant(own.peak(), 4))
            }
            None => "still moving at the end".to_owned(),
        };
        text += &format!(
            "  {:inputs$}  {output:outputs$}  {end:>11}  {rest}\n",
            own.input
        );
    }
    text
}

fn to_json(responses: &[Response], time: &[f64]) -> Value {
    let all: Vec<Value> = responses
        .iter()
        .map(|own| {
            let settled = settled(own, time);
            json!({
                "input": own.input,
                "output": own.output,
                "unit": own.unit,
                "end": own.end(),
                "peak": own.peak(),
                "settled": settled.is_some(),
                "rise_time": settled.as_ref().map(|known| known.rise),
                "overshoot": settled.as_ref().map(|known| known.overshoot),
                "settling_time": settled.as_ref().map(|known| known.settling),
            })
        })
        .collect();
    json!({ "stop_time": time.last(), "responses": all })
}

fn series(time: &[f64], responses: &[Response]) -> Series {
    let column = |own: &Response| Column {
        name: format!("{}.{}", own.input, own.output),
        unit: own.unit.clone(),
        values: own.values.clone(),
    };
    Series {
        time: time.to_vec(),
        columns: responses.iter().map(column).collect(),
        ..Series::default()
    }
}

fn figures<'a>(time: &'a [f64], responses: &'a [Response]) -> Vec<StepFigure<'a>> {
    let figure = |own: &'a Response| StepFigure {
        input: &own.input,
        output: &own.output,
        unit: &own.unit,
        time,
        values: &own.values,
    };
    responses.iter().map(figure).collect()
}
