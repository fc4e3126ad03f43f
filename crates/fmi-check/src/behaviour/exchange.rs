//! Model exchange: events and time integration.
//!
//! The checks compare runs with each other and examine the behaviour of the model, not its solution; so forward Euler
//! with small steps is sufficient.

use super::subject::Subject;
use super::{Reporter, Stop};
use pilotage_fmi::instance::{EventUpdate, MAX_EVENT_ROUNDS};

/// Euler steps per step of the plan.
const SUBSTEPS: u32 = 10;

/// Data of model exchange besides the instance.
#[derive(Debug, Clone, Default)]
pub(super) struct Solver {
    states: Vec<f64>,
    indicators: Vec<f64>,
    next_event: Option<f64>,
}

impl Subject {
    /// First event iteration after initialization. `false` if the end is requested.
    pub(super) fn enter_continuous_time(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        let states = self.instance.number_of_continuous_states()?;
        let indicators = self.instance.number_of_event_indicators()?;
        self.solver.states = vec![0.0; states];
        self.solver.indicators = vec![0.0; indicators];
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
        let step = next - self.time();
        let mut slopes = vec![0.0; self.solver.states.len()];
        self.instance.get_derivatives(&mut slopes)?;
        for (i, (state, slope)) in self.solver.states.iter_mut().zip(&slopes).enumerate() {
            if !slope.is_finite() {
                let what = format!("the derivative of state {} is {slope}", i + 1);
                reporter.error(what);
                return Ok(false);
            }
            *state += slope * step;
        }
        self.set_time(next);
        self.instance.set_time(next)?;
        self.instance.set_continuous_states(&self.solver.states)?;
        let done = self
            .instance
            .completed_integrator_step(!self.facts.can_save)?;
        let mut indicators = vec![0.0; self.solver.indicators.len()];
        self.instance.get_event_indicators(&mut indicators)?;
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
}
