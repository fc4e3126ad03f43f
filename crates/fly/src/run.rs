//! One run: the vehicle in real time, controlled by the hand.

use crate::beside::Beside;
use crate::craft::{Craft, CraftError, Flying, STEP, STEPS};
use crate::distribution::Distribution;
use crate::hand::{GAP, Hand, Heard};
use crate::task::Task;
use std::time::{Duration, Instant};

/// Displayed states per second.
const SHOWN: u32 = 120;
/// A step that is later than this makes the run invalid.
const LATE: Duration = Duration::from_millis(50);
/// A larger deflection at the beginning of a run is too early: models begin at rest.
const EARLY: f64 = 0.1;
/// A step that is later than this ends the run: the computer is too slow.
const HOPELESS: Duration = Duration::from_secs(2);

/// The displayed state of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Time from the beginning of the run \[s\].
    pub time: f64,
    /// Remaining time \[s\].
    pub left: f64,
    /// Position of each axis.
    pub positions: Vec<f64>,
    /// Angle of each axis \[rad\].
    pub tilts: Vec<f64>,
    /// Target of each axis.
    pub targets: Vec<f64>,
    /// Deflection of the hand, -1 to 1.
    pub hand: Vec<f64>,
    /// Number and page time \[ms\] of the last input frame included.
    pub seen: (u64, f64),
    /// Positions of the vehicle flown by the identified pilot, if there is one.
    pub beside: Vec<f64>,
}

/// A table of numbers, stored by columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Name and unit of each column.
    pub names: Vec<(String, String)>,
    /// Values of each column.
    pub columns: Vec<Vec<f64>>,
}

impl Table {
    fn new(names: Vec<(String, String)>) -> Self {
        let columns = vec![Vec::new(); names.len()];
        Self { names, columns }
    }

    fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        for (column, value) in self.columns.iter_mut().zip(row) {
            column.push(value);
        }
    }

    /// A row.
    pub fn row(&self, k: usize) -> Vec<f64> {
        self.columns.iter().map(|column| column[k]).collect()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A completed run.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// The flight: time, target, position and stick of each axis, disturbances, and the vehicle's other outputs.
    pub flight: Table,
    /// Log of all steps.
    pub log: Table,
    /// Data received from the page.
    pub heard: Heard,
    /// Lateness of steps \[ms\].
    pub lateness: Distribution,
    /// Time from a frame's arrival to the first step with it \[ms\].
    pub to_state: Distribution,
    /// Root mean square distance to the target after the run-in, over all axes.
    pub rms: f64,
    /// The same for the identified pilot, if it flew too.
    pub rms_beside: Option<f64>,
    /// Duration \[s\].
    pub seconds: f64,
    /// Whether the stick was deflected at the beginning.
    pub is_early: bool,
    /// Whether the stick was never deflected.
    pub is_still: bool,
    /// Whether it ended early.
    pub is_short: bool,
    /// Why it ended early, if it did.
    pub ended: Option<String>,
}

impl Flown {
    /// Why the run is invalid, if it is.
    pub fn fault(&self) -> Option<String> {
        let late = Duration::from_secs_f64(self.lateness.most / 1e3);
        let slow = || format!("the simulation was late by {:.0} ms", self.lateness.most);
        let heard = || self.heard.fault(self.seconds);
        let early = || "the stick was moved before the start".to_owned();
        let early = || self.is_early.then(early);
        let short = || {
            format!(
                "nothing came from the page for {:.0} ms",
                1e3 * GAP.as_secs_f64()
            )
        };
        self.ended
            .clone()
            .or_else(heard)
            .or_else(early)
            .or_else(|| (late > LATE).then(slow))
            .or_else(|| self.is_short.then(short))
    }
}

/// Receiver of a run's data.
pub trait Listener {
    /// Receives a state for display.
    fn state(&mut self, state: State);
    /// Receives a row of the flight.
    fn row(&mut self, row: &[f64]);
    /// Receives a row of the log, one per step.
    fn step(&mut self, row: &[f64]);
    /// Why the run must stop now, if it must.
    fn stop(&mut self) -> Option<String>;
}

/// Columns of a flight.
pub fn columns(craft: &Craft, task: &Task) -> Vec<(String, String)> {
    let mut all = vec![("time".to_owned(), "s".to_owned())];
    for (axis, (stick, position)) in craft.sticks.iter().zip(&craft.positions).enumerate() {
        let called = |name: &str| match axis {
            0 => name.to_owned(),
            _ => format!("{name}{}", axis + 1),
        };
        all.push((called("target"), position.unit.clone()));
        all.push((called("position"), position.unit.clone()));
        all.push((called("stick"), stick.signal.unit.clone()));
        if task.is_disturbed() {
            all.push((called("disturbance"), stick.signal.unit.clone()));
        }
    }
    let others = craft.others.iter();
    all.extend(others.map(|own| (own.name.clone(), own.unit.clone())));
    all
}

/// Columns of the log: those of the flight, then lateness and input of each step.
pub fn of_log(columns: &[(String, String)]) -> Vec<(String, String)> {
    let own = [
        ("late", "ms"),
        ("input", "1"),
        ("input_time", "ms"),
        ("input_age", "ms"),
    ];
    let own = own.map(|(name, unit)| (name.to_owned(), unit.to_owned()));
    columns.iter().cloned().chain(own).collect()
}

/// Targets and inputs at a time, with their recorded values.
struct Acting {
    targets: Vec<f64>,
    sticks: Vec<f64>,
    disturbances: Vec<f64>,
    inputs: Vec<f64>,
}

impl Acting {
    fn at(time: f64, hand: &[f64], craft: &Craft, task: &Task, sign: f64, origin: &[f64]) -> Self {
        let pushed = task.disturbances(time);
        let both: Vec<f64> = hand
            .iter()
            .zip(&pushed)
            .map(|(hand, push)| hand + push)
            .collect();
        let (sticks, inputs) = (craft.inputs(hand), craft.inputs(&both));
        let targets = task.targets(time, sign);
        Self {
            targets: targets
                .iter()
                .zip(origin)
                .map(|(target, origin)| origin + target)
                .collect(),
            disturbances: inputs
                .iter()
                .zip(&sticks)
                .map(|(all, own)| all - own)
                .collect(),
            sticks,
            inputs,
        }
    }

    /// Square of the distance to the targets, over all axes.
    fn square(&self, positions: &[f64]) -> f64 {
        let errors = positions.iter().zip(&self.targets).map(|(x, w)| x - w);
        errors.map(|error| error * error).sum()
    }

    fn row(&self, time: f64, positions: &[f64], others: &[f64], is_disturbed: bool) -> Vec<f64> {
        let mut row = vec![time];
        for (axis, position) in positions.iter().enumerate() {
            row.extend([self.targets[axis], *position, self.sticks[axis]]);
            row.extend(is_disturbed.then_some(self.disturbances[axis]));
        }
        row.extend(others);
        row
    }
}

/// Flies a run in real time.
///
/// # Errors
/// If the vehicle fails before the run begins; later failures end the run, whose data is kept.
pub fn fly(
    craft: &Craft,
    task: &Task,
    sign: f64,
    hand: &Hand,
    beside: Option<&mut Beside>,
    listener: &mut dyn Listener,
) -> Result<Flown, CraftError> {
    let mut flying = craft.begin()?;
    let origin = craft.origin_positions.clone();
    let flight = Table::new(columns(craft, task));
    let mut run = Run {
        log: Table::new(of_log(&flight.names)),
        flight,
        late: Vec::new(),
        to_state: Vec::new(),
        is_early: false,
        is_still: true,
        squares: (0.0, 0),
        squares_beside: 0.0,
        craft,
        task,
        sign,
        origin,
    };
    let begun = Instant::now();
    let has_beside = beside.is_some();
    hand.begin(begun);
    let (time, ended) = run.go(&mut flying, begun, hand, beside, listener);
    let heard = hand.end();
    let (sum, count) = run.squares;
    let mean = |sum: f64| (sum / count as f64).sqrt();
    Ok(Flown {
        flight: run.flight,
        log: run.log,
        heard,
        lateness: Distribution::of(run.late),
        to_state: Distribution::of(run.to_state),
        rms: mean(sum),
        rms_beside: has_beside.then(|| mean(run.squares_beside)),
        seconds: time,
        is_early: run.is_early,
        is_still: run.is_still,
        is_short: time < task.seconds,
        ended,
    })
}

/// Data collected during a run.
struct Run<'r> {
    flight: Table,
    log: Table,
    late: Vec<f64>,
    to_state: Vec<f64>,
    is_early: bool,
    is_still: bool,
    squares: (f64, usize),
    squares_beside: f64,
    craft: &'r Craft,
    task: &'r Task,
    sign: f64,
    origin: Vec<f64>,
}

impl Run<'_> {
    /// Steps until the end; returns the time reached, and why the run ended early if it did.
    fn go(
        &mut self,
        flying: &mut Flying,
        begun: Instant,
        hand: &Hand,
        mut beside: Option<&mut Beside>,
        listener: &mut dyn Listener,
    ) -> (f64, Option<String>) {
        let steps = (self.task.seconds * f64::from(STEPS)).round() as u32;
        let (per_row, per_state) = ((f64::from(STEPS) / self.task.rate) as u32, STEPS / SHOWN);
        let mut held = vec![0.0; self.craft.axes()];
        let (mut last, mut positions_beside) = (begun, Vec::new());
        for k in 0..=steps {
            let time = f64::from(k) * STEP;
            let due = begun + Duration::from_millis(u64::from(k) * 1000 / u64::from(STEPS));
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            let late = due.elapsed();
            if late > HOPELESS {
                return (
                    time,
                    Some("the computer did not keep up with the vehicle".to_owned()),
                );
            }
            let (n, at, arrived) = hand.read(&mut held);
            self.is_still &= held.iter().all(|held| *held == 0.0);
            self.is_early |= k == 0 && held.iter().any(|held| held.abs() > EARLY);
            let acting = Acting::at(time, &held, self.craft, self.task, self.sign, &self.origin);
            let seen = match see(flying) {
                Ok(seen) => seen,
                Err(error) => return (time, Some(self.craft.failed(error).to_string())),
            };
            let age = 1e3 * arrived.elapsed().as_secs_f64();
            // Input that arrived before the beginning does not count.
            if arrived > last {
                last = arrived;
                self.to_state.push(age);
            }
            let row = acting.row(
                time,
                &seen.positions,
                &seen.others,
                self.task.is_disturbed(),
            );
            self.late.push(1e3 * late.as_secs_f64());
            let mut logged = row.clone();
            logged.extend([1e3 * late.as_secs_f64(), n as f64, at, age]);
            listener.step(&logged);
            self.log.push(logged);
            if k % per_row == 0 {
                self.flight.push(row.iter().copied());
                listener.row(&row);
            }
            self.measure(time, &acting, &seen.positions);
            if let Some(own) = &mut beside {
                match own.step(time, &acting.targets, &acting.disturbances) {
                    Ok(positions) => {
                        self.measure_beside(time, &acting, &positions);
                        positions_beside = positions;
                    }
                    Err(error) => return (time, Some(format!("the model beside: {error}"))),
                }
            }
            if k % per_state == 0 {
                listener.state(State {
                    time,
                    left: self.task.seconds - time,
                    positions: seen.positions,
                    tilts: seen.tilts,
                    targets: acting.targets.clone(),
                    hand: held.clone(),
                    seen: (n, at),
                    beside: positions_beside.clone(),
                });
                if let Some(why) = listener.stop() {
                    return (time, Some(why));
                }
                // The rest would be invalid.
                if hand.is_spoilt() {
                    return (time, None);
                }
            }
            if k < steps
                && let Err(error) = flying.step(time, &acting.inputs)
            {
                return (time, Some(self.craft.failed(error).to_string()));
            }
        }
        (self.task.seconds, None)
    }

    fn measure_beside(&mut self, time: f64, acting: &Acting, positions: &[f64]) {
        if time >= self.task.run_in {
            self.squares_beside += acting.square(positions);
        }
    }

    fn measure(&mut self, time: f64, acting: &Acting, positions: &[f64]) {
        if time >= self.task.run_in {
            self.squares.0 += acting.square(positions);
            self.squares.1 += 1;
        }
    }
}

/// Outputs read from a vehicle.
struct Seen {
    positions: Vec<f64>,
    tilts: Vec<f64>,
    others: Vec<f64>,
}

fn see(flying: &mut Flying) -> Result<Seen, pilotage_cosim::component::ComponentError> {
    Ok(Seen {
        positions: flying.positions()?,
        tilts: flying.tilts()?,
        others: flying.others()?,
    })
}

/// The root mean square distance to the target with the stick at rest, as reference for the score.
///
/// # Errors
/// If the vehicle fails.
pub fn idle(craft: &Craft, task: &Task, sign: f64) -> Result<f64, CraftError> {
    let failed = |source| craft.failed(source);
    let mut flying = craft.begin()?;
    let origin = craft.origin_positions.clone();
    let hand = vec![0.0; craft.axes()];
    let (mut sum, mut count) = (0.0, 0.0);
    for k in 0..(task.seconds * f64::from(STEPS)) as u32 {
        let time = f64::from(k) * STEP;
        let acting = Acting::at(time, &hand, craft, task, sign, &origin);
        if time >= task.run_in {
            let positions = flying.positions().map_err(failed)?;
            sum += acting.square(&positions);
            count += 1.0;
        }
        flying.step(time, &acting.inputs).map_err(failed)?;
    }
    Ok((sum / f64::max(count, 1.0)).sqrt())
}
