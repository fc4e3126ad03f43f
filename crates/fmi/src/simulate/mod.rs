//! Time integration of a model exchange instance (FMI 2.0, section 3.2; FMI 3.0, section 3): an error-controlled solver
//! for the continuous states, with state, time and step events.
//!
//! ```text
//! instance in event mode -> ModelExchangeRun::begin -> set inputs, step_to(t), read outputs, ... -> terminate
//! ```

mod error;
mod model;

pub use error::RunError;

use self::model::{Inputs, Model};
use super::description::ModelDescription;
use super::instance::{Instance, MAX_EVENT_INDICATORS, MAX_EVENT_ROUNDS, Saved, Serialized};
use super::version::State;
use pilotage_abi::{fmi2, fmi3};
use pilotage_ode::{Advance, Method, Solver};
use serde::{Deserialize, Serialize};

/// A time event within this part of a step after its end is at its end: times that are counted and times that are added up
/// differ by rounding.
const AT_TARGET: f64 = 1e-9;

/// Solver options of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunOptions {
    /// Error tolerance of a solver step, relative to each state; in addition, a hundredth of it relative to the nominal
    /// value of the state.
    pub tolerance: f64,
    /// Integration method.
    pub method: Method,
    /// Maximum step of the solver \[s\].
    pub longest_step: f64,
}

impl Default for RunOptions {
    /// Tolerance 1e-6, steps limited only by the error, method selected according to the problem.
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            method: Method::default(),
            longest_step: f64::INFINITY,
        }
    }
}

/// Result of [`ModelExchangeRun::step_to`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reached {
    /// The requested time was reached.
    Target,
    /// The model requested the end of the simulation at this time \[s\].
    EndRequested(f64),
}

/// Work statistics of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RunWork {
    /// The solver's work.
    pub solver: pilotage_ode::Work,
    /// Number of events at which an indicator changed sign.
    pub state_events: u64,
    /// Number of events at times given by the model.
    pub time_events: u64,
    /// Number of events requested by the model after a step.
    pub step_events: u64,
    /// Number of events at which inputs jumped.
    pub input_events: u64,
}

/// A state saved by [`ModelExchangeRun::save`]; valid for the run that created it.
#[derive(Debug, Clone)]
pub struct SavedRun {
    instance: Saved,
    time: f64,
    x: Vec<f64>,
    inputs: Inputs,
    next_time: Option<f64>,
    is_over: bool,
    cluster: (f64, u32),
}

/// A state of a run for another process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptRun {
    bytes: Vec<u8>,
    is_in_event_mode: bool,
    time: f64,
    x: Vec<f64>,
    inputs: (Vec<u32>, Vec<f64>, Vec<f64>, f64),
    next_time: Option<f64>,
    is_over: bool,
    cluster: (f64, u32),
}

/// The simulation of a model exchange instance. Outputs may be read after each step.
#[derive(Debug)]
pub struct ModelExchangeRun {
    model: Model,
    solver: Solver,
    options: RunOptions,
    /// Whether `completedIntegratorStep` must be called.
    needs_completed_step: bool,
    next_time: Option<f64>,
    x: Vec<f64>,
    nominals: Vec<f64>,
    is_over: bool,
    /// Stop time, beyond which the instance is not evaluated [s].
    stop: f64,
    /// Time of the first event of the current cluster of events, and their number.
    cluster: (f64, u32),
    work: RunWork,
}

impl ModelExchangeRun {
    /// Takes an instance for model exchange that is not initialized yet; initialize it by [`Self::instance`].
    ///
    /// # Panics
    /// If the tolerance or the longest step is not a number above 0.
    pub fn new(instance: Instance, description: &ModelDescription, options: RunOptions) -> Self {
        let me = description.model_exchange.as_ref();
        Self {
            model: Model::new(instance, description),
            solver: solver(0, &[], options),
            options,
            needs_completed_step: !me.is_some_and(|me| me.completed_integrator_step_not_needed),
            next_time: None,
            x: Vec::new(),
            nominals: Vec::new(),
            is_over: false,
            stop: f64::INFINITY,
            cluster: (f64::NEG_INFINITY, 0),
            work: RunWork::default(),
        }
    }

    /// The instance. Once the run has begun, variables should be set in event mode: see [`Self::event_mode`].
    pub fn instance(&mut self) -> &mut Instance {
        &mut self.model.instance
    }

    /// Current time \[s\].
    pub fn time(&self) -> f64 {
        self.solver.time()
    }

    /// Time of the next time event \[s\], if the instance has announced one.
    pub fn next_event(&self) -> Option<f64> {
        self.next_time
    }

    /// Continuous states at the current time.
    pub fn states(&self) -> &[f64] {
        self.solver.state()
    }

    /// Work statistics so far.
    pub fn work(&self) -> RunWork {
        RunWork {
            solver: self.solver.work(),
            ..self.work
        }
    }

    /// Sets the tolerance, until the run begins.
    ///
    /// # Panics
    /// If it is not a number above 0.
    pub fn set_tolerance(&mut self, tolerance: f64) {
        assert!(
            tolerance > 0.0 && tolerance.is_finite(),
            "a tolerance of {tolerance}"
        );
        self.options.tolerance = tolerance;
    }

    /// Sets the stop time of the experiment \[s\], beyond which the instance is not evaluated.
    pub fn set_stop(&mut self, stop: Option<f64>) {
        self.stop = stop.unwrap_or(f64::INFINITY);
    }

    /// Begins at `start` \[s\]: the instance has just left initialization mode and is in event mode.
    ///
    /// # Errors
    /// See [`RunError`], here and below.
    pub fn begin(&mut self, start: f64) -> Result<(), RunError> {
        let n = self.model.instance.number_of_continuous_states()?;
        let indicators = self.model.instance.number_of_event_indicators()?;
        if indicators > MAX_EVENT_INDICATORS {
            return Err(RunError::Indicators { indicators });
        }
        (self.x, self.nominals) = (vec![0.0; n], vec![1.0; n]);
        self.solver = solver(indicators, &self.nominals, self.options);
        self.solver.restart(start, &self.x, true);
        self.read_nominals()?;
        self.finish_event(true)
    }

    /// Sets real inputs from now on: held, or linear with `slopes` (in their units per second). If one of them jumps,
    /// an event is triggered.
    ///
    /// # Panics
    /// If the numbers of values or slopes and references differ.
    pub fn set_inputs(
        &mut self,
        references: &[u32],
        values: &[f64],
        slopes: Option<&[f64]>,
    ) -> Result<(), RunError> {
        assert_eq!(references.len(), values.len());
        assert!(slopes.is_none_or(|slopes| slopes.len() == references.len()));
        let t = self.time();
        if self.model.plan_inputs(t, references, values, slopes) {
            self.event_mode()?;
            self.model.set_inputs(t)?;
        }
        Ok(())
    }

    /// Saves the complete state, which can be restored any number of times; overwrites `old` if given.
    pub fn save(&mut self, old: Option<SavedRun>) -> Result<SavedRun, RunError> {
        let (solver, instance) = (&self.solver, &mut self.model.instance);
        let (mut x, saved) = match old {
            Some(old) => (old.x, instance.save_into(old.instance)?),
            None => (Vec::new(), instance.save()?),
        };
        x.clear();
        x.extend_from_slice(solver.state());
        Ok(SavedRun {
            instance: saved,
            time: solver.time(),
            x,
            inputs: self.model.inputs(),
            next_time: self.next_time,
            is_over: self.is_over,
            cluster: self.cluster,
        })
    }

    /// Restores a saved state.
    pub fn restore(&mut self, saved: &SavedRun) -> Result<(), RunError> {
        self.model.instance.restore(saved.instance)?;
        self.model.set_back(&saved.inputs);
        self.x.copy_from_slice(&saved.x);
        self.solver.restart(saved.time, &self.x, false);
        (self.next_time, self.is_over) = (saved.next_time, saved.is_over);
        self.cluster = saved.cluster;
        Ok(())
    }

    /// The complete state as bytes, for another process. The solver begins anew here, as it does there: both go on with the same
    /// bits.
    pub fn serialize(&mut self) -> Result<KeptRun, RunError> {
        let instance = &mut self.model.instance;
        let saved = instance.save()?;
        let serialized = instance.serialize(saved)?;
        instance.free(saved)?;
        let kept = KeptRun {
            bytes: serialized.bytes,
            is_in_event_mode: self.is_in_event_mode(),
            time: self.solver.time(),
            x: self.solver.state().to_vec(),
            inputs: self.model.kept_inputs(),
            next_time: self.next_time,
            is_over: self.is_over,
            cluster: self.cluster,
        };
        self.begin_anew(&kept)?;
        Ok(kept)
    }

    /// Goes on from such a state; the run has begun.
    pub fn deserialize(&mut self, kept: &KeptRun) -> Result<(), RunError> {
        if kept.x.len() != self.x.len() {
            return Err(RunError::OtherStates {
                found: kept.x.len(),
                expected: self.x.len(),
            });
        }
        let state = match (self.model.instance.state(), kept.is_in_event_mode) {
            (State::Fmi2(_), true) => State::Fmi2(fmi2::State::EventMode),
            (State::Fmi2(_), false) => State::Fmi2(fmi2::State::ContinuousTimeMode),
            (State::Fmi3(_), true) => State::Fmi3(fmi3::State::EventMode),
            (State::Fmi3(_), false) => State::Fmi3(fmi3::State::ContinuousTimeMode),
        };
        let bytes = kept.bytes.clone();
        let instance = &mut self.model.instance;
        let saved = instance.deserialize(&Serialized { bytes, state })?;
        instance.restore(saved)?;
        instance.free(saved)?;
        self.begin_anew(kept)
    }

    fn begin_anew(&mut self, kept: &KeptRun) -> Result<(), RunError> {
        self.model.take_inputs(&kept.inputs);
        self.x.copy_from_slice(&kept.x);
        self.read_nominals()?;
        self.solver.restart(kept.time, &self.x, true);
        (self.next_time, self.is_over) = (kept.next_time, kept.is_over);
        self.cluster = kept.cluster;
        Ok(())
    }

    /// Enters event mode, to set discrete variables; the event is handled when the simulation continues.
    pub fn event_mode(&mut self) -> Result<&mut Instance, RunError> {
        if !self.is_in_event_mode() {
            self.model.instance.enter_event_mode()?;
            self.work.input_events += 1;
        }
        Ok(&mut self.model.instance)
    }

    /// Time derivatives of real outputs at the current time [their units per second], with the inputs continued: by
    /// second-order differences over `span` \[s\], forward or, at the stop time, backward, ignoring events, with the states
    /// extrapolated along their derivatives. 0 after the model has requested the end.
    ///
    /// # Panics
    /// If the numbers of slopes and references differ.
    pub fn output_slopes(
        &mut self,
        references: &[u32],
        span: f64,
        slopes: &mut [f64],
    ) -> Result<(), RunError> {
        assert_eq!(references.len(), slopes.len());
        slopes.fill(0.0);
        if self.is_in_event_mode() {
            return Ok(());
        }
        let (t, x) = (self.time(), self.states().to_vec());
        let mut rates = vec![0.0; x.len()];
        self.model.put(t, &x)?;
        if !x.is_empty() {
            self.model.instance.get_derivatives(&mut rates)?;
        }
        let mut values = vec![0.0; references.len()];
        // An FMU may know nothing of times beyond the stop time.
        let span = match t + 2.0 * span > self.stop {
            true => -span,
            false => span,
        };
        for (part, weight) in [(0.0, -1.5), (1.0, 2.0), (2.0, -0.5)] {
            let ahead = part * span;
            let states = x.iter().zip(&rates).map(|(x, rate)| x + ahead * rate);
            let states: Vec<f64> = states.collect();
            self.model.put(t + ahead, &states)?;
            self.model.instance.get_real(references, &mut values)?;
            for (slope, value) in slopes.iter_mut().zip(&values) {
                *slope += weight / span * value;
            }
        }
        Ok(self.model.put(t, &x)?)
    }

    fn is_in_event_mode(&self) -> bool {
        let state = self.model.instance.state();
        state == State::Fmi2(fmi2::State::EventMode) || state == State::Fmi3(fmi3::State::EventMode)
    }

    /// Integrates to `target` \[s\], and handles all events up to and at that time. A time event that differs from it by
    /// rounding is at that time: the run then ends at the event's.
    ///
    /// # Errors
    /// If a call or the solver fails, if events accumulate, or if the target is before the current time or NaN.
    pub fn step_to(&mut self, target: f64) -> Result<Reached, RunError> {
        // By rounding it may be where an event was.
        let time = self.time();
        if target.is_nan() || target < time - AT_TARGET * time.abs().max(1.0) {
            return Err(RunError::Backwards { time, target });
        }
        if self.is_in_event_mode() {
            self.finish_event(false)?;
        }
        let near = AT_TARGET * (target - self.time()) + 8.0 * f64::EPSILON * target.abs();
        while !self.is_over && self.time() < target {
            let is_near = |next: &f64| *next <= (target + near).min(self.stop);
            let event = self.next_time.filter(is_near);
            self.advance(event.map_or(target, |next| next.max(target)))?;
        }
        Ok(match self.is_over {
            true => Reached::EndRequested(self.time()),
            false => Reached::Target,
        })
    }

    /// Performs one step of the solver, and handles the event at its end, if any.
    fn advance(&mut self, target: f64) -> Result<(), RunError> {
        let limit = self.next_time.map_or(target, |next| next.min(target));
        let mut is_state_event = false;
        let mut is_step_event = false;
        // The next time event may be due already.
        if limit > self.time() {
            let advance = self.solver.advance(&mut self.model, limit)?;
            is_state_event = advance == Advance::Event;
            self.model.put(self.solver.time(), self.solver.state())?;
            if self.needs_completed_step {
                let completed = self.model.instance.completed_integrator_step(true)?;
                self.is_over |= completed.is_end_requested;
                is_step_event = completed.is_event;
            }
        }
        let is_time_event = self.next_time.is_some_and(|next| self.time() >= next);
        self.work.state_events += u64::from(is_state_event);
        self.work.step_events += u64::from(is_step_event);
        self.work.time_events += u64::from(is_time_event);
        if self.is_over || !(is_state_event || is_step_event || is_time_event) {
            return Ok(());
        }
        self.check_chattering()?;
        self.model.instance.enter_event_mode()?;
        self.finish_event(is_state_event || is_time_event)
    }

    /// Performs the event iteration and returns to continuous-time mode. `is_new`: the equations may have changed, so
    /// that the solver selects a new step size.
    fn finish_event(&mut self, is_new: bool) -> Result<(), RunError> {
        let Some(update) = self.model.instance.iterate_event()? else {
            let (time, rounds) = (self.time(), MAX_EVENT_ROUNDS);
            return Err(RunError::EventIteration { time, rounds });
        };
        self.next_time = update.next_time;
        if update.is_end_requested {
            self.is_over = true;
            return Ok(());
        }
        self.model.instance.enter_continuous_time_mode()?;
        if update.nominals_changed {
            self.read_nominals()?;
        }
        if !self.x.is_empty() {
            self.model.instance.get_continuous_states(&mut self.x)?;
        }
        let t = self.time();
        self.solver
            .restart(t, &self.x, is_new || update.states_changed);
        Ok(())
    }

    /// Computes absolute tolerances from the nominal values of the states.
    fn read_nominals(&mut self) -> Result<(), RunError> {
        if self.nominals.is_empty() {
            return Ok(());
        }
        self.model.instance.get_nominals(&mut self.nominals)?;
        let absolute = absolute(&self.nominals, self.options.tolerance);
        self.solver.set_tolerances(self.options.tolerance, absolute);
        Ok(())
    }

    /// An error if too many events follow each other immediately: the simulation would not progress.
    fn check_chattering(&mut self) -> Result<(), RunError> {
        const EVENTS: u32 = 200;
        let (t, span) = (self.time(), 1e-10 * (1.0 + self.time().abs()));
        let (first, count) = self.cluster;
        self.cluster = if t - first > span {
            (t, 1)
        } else {
            (first, count + 1)
        };
        match self.cluster.1 > EVENTS {
            true => Err(RunError::Chattering {
                time: t,
                events: EVENTS,
                span,
            }),
            false => Ok(()),
        }
    }
}

fn solver(indicators: usize, nominals: &[f64], options: RunOptions) -> Solver {
    let options = pilotage_ode::SolverOptions {
        relative: options.tolerance,
        absolute: absolute(nominals, options.tolerance),
        method: options.method,
        longest_step: options.longest_step,
    };
    Solver::new(indicators, options)
}

/// The nominal value of a state may be invalid in an FMU: zero or negative values are replaced by 1.
fn absolute(nominals: &[f64], tolerance: f64) -> Vec<f64> {
    let usable = |nominal: f64| {
        if nominal > 0.0 && nominal.is_finite() {
            nominal
        } else {
            1.0
        }
    };
    nominals
        .iter()
        .map(|&n| 0.01 * tolerance * usable(n))
        .collect()
}
