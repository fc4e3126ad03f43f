//! Model exchange: events and time integration.
//!
//! The checks compare runs with each other and examine the behaviour of the model, not its solution; so forward Euler is
//! sufficient, with steps that are shorter where derivatives change much, as in a stiff model, or where a step leaves the
//! domain of the model.

use super::subject::Subject;
use super::{Reporter, Stop};
use pilotage_abi::fmi2::Status;
use pilotage_fmi::CallError;
use pilotage_fmi::description::Severity;
use pilotage_fmi::instance::{EventUpdate, MAX_EVENT_ROUNDS};

/// Euler steps per step of the plan, at least, and at most in a check.
const SUBSTEPS: u32 = 10;
const MOST_SUBSTEPS: u32 = 20_000;
/// Largest difference to Heun's method in a step, relative to a state (or 1, if that is larger).
const ROUGH: f64 = 0.1;
/// Maximum number of halvings of a step.
const HALVINGS: u32 = 30;

/// Data of model exchange besides the instance.
#[derive(Debug, Clone, Default)]
pub(super) struct Solver {
    states: Vec<f64>,
    indicators: Vec<f64>,
    next_event: Option<f64>,
    /// Length of the last step \[s\]; 0 before.
    last: f64,
    /// Number of steps.
    count: u32,
}

impl Subject {
    /// First event iteration after initialization. `false` if the end is requested.
    pub(super) fn enter_continuous_time(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        let states = self.instance.number_of_continuous_states()?;
        let indicators = self.instance.number_of_event_indicators()?;
        self.solver = Solver {
            states: vec![0.0; states],
            indicators: vec![0.0; indicators],
            ..Solver::default()
        };
        let goes_on = self.iterate(reporter)?;
        reporter.stage("reading the nominal values of the states");
        let mut nominals = vec![1.0; states];
        self.instance.get_nominals(&mut nominals)?;
        for (i, nominal) in nominals.iter().enumerate() {
            if nominal.is_nan() || *nominal <= 0.0 {
                reporter.warn(format!("the nominal value of state {} is {nominal}", i + 1));
            }
        }
        Ok(goes_on)
    }

    /// Co-simulation in event mode: iterates and enters step mode. `false` if the end is requested.
    pub(super) fn enter_steps(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        if self.update(reporter)?.is_none() {
            return Ok(false);
        }
        self.instance.enter_step_mode()?;
        Ok(true)
    }

    /// Performs the event iteration; `None` if it does not end, or the end is requested.
    fn update(&mut self, reporter: &mut Reporter) -> Result<Option<EventUpdate>, Stop> {
        reporter.stage("iterating at an event");
        let update = self.instance.iterate_event()?;
        if update.is_none() {
            let rounds = MAX_EVENT_ROUNDS;
            reporter.error(format!("an event iteration did not end in {rounds} rounds"));
        }
        Ok(update.filter(|update| !update.is_end_requested))
    }

    /// In event mode: iterates and enters continuous-time mode. `false` if the end is requested.
    pub(super) fn iterate(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        let Some(update) = self.update(reporter)? else {
            return Ok(false);
        };
        self.solver.next_event = update.next_time;
        if let Some(next) = update.next_time.filter(|next| *next < self.time()) {
            reporter.error(format!(
                "at {} s its next time event is at {next} s, which is past",
                self.time()
            ));
            self.solver.next_event = None;
        }
        self.instance.enter_continuous_time_mode()?;
        let solver = &mut self.solver;
        self.instance.get_continuous_states(&mut solver.states)?;
        self.instance.get_event_indicators(&mut solver.indicators)?;
        Ok(true)
    }

    /// Integrates over `h` seconds; `false` if the end is requested.
    pub(super) fn integrate(&mut self, h: f64, reporter: &mut Reporter) -> Result<bool, Stop> {
        let begin = self.time();
        for k in 1..=SUBSTEPS {
            let next = begin + h * f64::from(k) / f64::from(SUBSTEPS);
            while self.time() < next {
                // Steps end exactly at time events (FMI 2.0.5, section 3.2.2).
                let event = self.solver.next_event.filter(|event| *event > self.time());
                let target = event.map_or(next, |event| event.min(next));
                if !self.substep(target, reporter)? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    fn substep(&mut self, next: f64, reporter: &mut Reporter) -> Result<bool, Stop> {
        let mut slopes = vec![0.0; self.solver.states.len()];
        self.instance.get_derivatives(&mut slopes)?;
        if let Some(what) = not_finite(&slopes) {
            reporter.error(what);
            return Ok(false);
        }
        self.solver.count += 1;
        let reached = match self.solver.count > MOST_SUBSTEPS {
            true => Reached::TooFar,
            false => self.try_steps(next, &slopes)?,
        };
        match reached {
            Reached::Done => {}
            Reached::NotFinite(what) => {
                reporter.error(what);
                return Ok(false);
            }
            Reached::TooFar => {
                let what = format!(
                    "it is not simulated beyond {} s: the explicit solver of this check gets no further, as with a stiff model",
                    self.time()
                );
                reporter.find(what, Severity::Note, None);
                return Ok(false);
            }
        }
        let next = self.time();
        let done = self
            .instance
            .completed_integrator_step(!self.facts.can_save)?;
        let mut indicators = vec![0.0; self.solver.indicators.len()];
        self.instance.get_event_indicators(&mut indicators)?;
        if let Some(k) = indicators.iter().position(|own| own.is_nan()) {
            reporter.error(format!("event indicator {} is NaN at {next} s", k + 1));
            return Ok(false);
        }
        let crossed = (indicators.iter().zip(&self.solver.indicators))
            .any(|(new, old)| (*new > 0.0) != (*old > 0.0));
        self.solver.indicators = indicators;
        let is_due = self.solver.next_event.is_some_and(|event| event <= next);
        if done.is_end_requested {
            return Ok(false);
        }
        if done.is_event || crossed || is_due {
            self.instance.enter_event_mode()?;
            return self.iterate(reporter);
        }
        Ok(true)
    }

    /// A step to `next` \[s\], or to an earlier time if that is too far. At the point before, if none succeeds.
    fn try_steps(&mut self, next: f64, slopes: &[f64]) -> Result<Reached, Stop> {
        let (begin, before) = (self.time(), self.solver.states.clone());
        let mut step = next - begin;
        if self.solver.last > 0.0 {
            step = step.min(2.0 * self.solver.last);
        }
        let mut reached = Reached::TooFar;
        for _ in 0..HALVINGS {
            let end = if step < next - begin {
                begin + step
            } else {
                next
            };
            reached = self.try_step(end, step, &before, slopes)?;
            if reached == Reached::Done {
                self.solver.last = step;
                self.set_time(end);
                return Ok(reached);
            }
            step *= 0.5;
        }
        self.instance.set_time(begin)?;
        self.instance.set_continuous_states(&before)?;
        self.solver.states = before;
        Ok(reached)
    }

    /// A step of forward Euler, if its end is in the domain of the model and close to that of Heun's method.
    fn try_step(
        &mut self,
        end: f64,
        step: f64,
        before: &[f64],
        slopes: &[f64],
    ) -> Result<Reached, Stop> {
        let pairs = before.iter().zip(slopes);
        self.solver.states = pairs.map(|(x, slope)| x + slope * step).collect();
        let mut then = vec![0.0; slopes.len()];
        let set = (self.instance.set_time(end))
            .and_then(|()| self.instance.set_continuous_states(&self.solver.states))
            .and_then(|()| self.instance.get_derivatives(&mut then));
        match set {
            // The solver should take a smaller step (FMI 2.0.5, section 2.1.3).
            Err(CallError::Failed { status, .. }) if status == Status::DISCARD => {
                return Ok(Reached::TooFar);
            }
            other => other?,
        }
        if let Some(what) = not_finite(&then) {
            return Ok(Reached::NotFinite(what));
        }
        let states = self.solver.states.iter().zip(before);
        let mut all = states.zip(slopes.iter().zip(&then));
        let is_close = all.all(|((x, x0), (slope, then))| {
            0.5 * step * (then - slope).abs() <= ROUGH * x.abs().max(x0.abs()).max(1.0)
        });
        match is_close {
            true => Ok(Reached::Done),
            false => Ok(Reached::TooFar),
        }
    }
}

/// How a step ended.
#[derive(Debug, Clone, PartialEq)]
enum Reached {
    Done,
    /// A shorter one may succeed.
    TooFar,
    /// A derivative is not finite at its end.
    NotFinite(String),
}

/// A derivative that is not finite, in words.
fn not_finite(slopes: &[f64]) -> Option<String> {
    let k = slopes.iter().position(|slope| !slope.is_finite())?;
    let (state, slope) = (k + 1, slopes[k]);
    Some(format!("the derivative of state {state} is {slope}"))
}
