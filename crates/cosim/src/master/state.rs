//! The state of a run at a communication point of the clock, from which it goes on as if it had not ended.

use super::controller::Controller;
use super::history::History;
use super::lu::Lu;
use super::stepper::Stepper;
use super::wired::{Failure, Wired};
use super::{MasterError, Stage};
use crate::system::System;
use serde::{Deserialize, Serialize};
use std::io;

/// The complete state of a run: that of all components and of the master.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct State {
    /// Number of completed steps of the clock.
    step: u64,
    /// Names of the real outputs, their values, and slopes of those that feed inputs.
    names: Vec<String>,
    row: Vec<f64>,
    slopes: Vec<f64>,
    history: History,
    strong: Option<[Lu; 2]>,
    controller: Option<Controller>,
    /// Counts of steps that end the run once there are too many.
    unconverged: u32,
    shortest: u32,
    components: Vec<Own>,
}

/// A component's part.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Own {
    name: String,
    bytes: Vec<u8>,
    /// Whether its output derivatives are used, and outputs observed within steps.
    has_slopes: bool,
    is_watchable: bool,
}

impl State {
    /// Number of completed steps of the clock.
    pub fn step(&self) -> u64 {
        self.step
    }
}

/// Keeps a state.
pub type Keep<'a> = &'a mut (dyn FnMut(Option<usize>, &State) -> io::Result<()> + Send);

/// Where a run begins, and which of its states are kept: from the clock's start and none by default.
#[derive(Default)]
pub struct Checkpoints<'a> {
    /// The state with which it begins, instead of that at the clock's start.
    pub from: Option<State>,
    /// Numbers of completed steps of the clock at which the state is kept.
    pub at: Vec<u64>,
    /// Whether it is kept where the run ends: at the stop, or where it is asked to stop.
    pub at_end: bool,
    /// Keeps the state with that index in `at`, or that at the end.
    pub keep: Option<Keep<'a>>,
}

impl Checkpoints<'_> {
    /// Refuses a component that cannot write its state.
    pub(super) fn check(&self, system: &System) -> Result<(), MasterError> {
        if self.from.is_none() && self.at.is_empty() && !self.at_end {
            return Ok(());
        }
        let mut instances = system.instances.iter();
        match instances.find(|own| !own.component.abilities().serialization) {
            Some(own) => Err(MasterError::NoState {
                instance: own.name.clone(),
            }),
            None => Ok(()),
        }
    }

    /// Keeps the state after a step, if it is wanted there.
    pub(super) fn after(&mut self, stepper: &mut Stepper, step: u64, time: f64) -> Kept {
        for k in 0..self.at.len() {
            if self.at[k] == step {
                self.keep(stepper, step, time, Some(k))?;
            }
        }
        Ok(())
    }

    /// Keeps the state at the end, if it is wanted there.
    pub(super) fn at_end(&mut self, stepper: &mut Stepper, step: u64, time: f64) -> Kept {
        match self.at_end {
            true => self.keep(stepper, step, time, None),
            false => Ok(()),
        }
    }

    fn keep(&mut self, stepper: &mut Stepper, step: u64, time: f64, which: Option<usize>) -> Kept {
        let state = stepper
            .state(step)
            .map_err(|failure| NotKept::Component(Box::new(failure)))?;
        let kept = (self.keep.as_mut()).map_or(Ok(()), |keep| keep(which, &state));
        kept.map_err(|source| NotKept::File(MasterError::Record { time, source }))
    }
}

/// Why a state is not kept.
pub(super) enum NotKept {
    Component(Box<Failure>),
    File(MasterError),
}

/// A state that is kept, if it is wanted.
pub(super) type Kept = Result<(), NotKept>;

impl Stepper {
    /// The state between two steps of the clock.
    pub(super) fn state(&mut self, step: u64) -> Result<State, Failure> {
        let bytes = |own: &mut Wired| {
            let bytes = own.component.serialize();
            bytes.map_err(|source| own.failure(Stage::Save, source))
        };
        self.state_with(step, bytes)
    }

    /// As [`state`](Self::state), with each component's part as `bytes` gives it.
    pub(super) fn state_with(
        &mut self,
        step: u64,
        mut bytes: impl FnMut(&mut Wired) -> Result<Vec<u8>, Failure>,
    ) -> Result<State, Failure> {
        let components = self.exchange.wired.iter_mut().map(|own| {
            Ok(Own {
                bytes: bytes(own)?,
                name: own.name.clone(),
                has_slopes: !own.within.sloped.is_empty(),
                is_watchable: own.within.is_watchable,
            })
        });
        let components = components.collect::<Result<_, Failure>>()?;
        let exchange = &self.exchange;
        Ok(State {
            step,
            names: exchange
                .signals
                .iter()
                .map(|own| own.name.clone())
                .collect(),
            row: exchange.values.row.clone(),
            slopes: exchange.values.slopes.clone(),
            history: exchange.history.clone(),
            strong: self.strong.as_ref().and_then(|own| own.kept()),
            controller: self.control.map(|(_, own)| own),
            unconverged: self.unconverged,
            shortest: self.shortest,
            components,
        })
    }

    /// Goes on from a state of the same system. Variables that are recorded now, and were not then, are read.
    pub(super) fn resume(&mut self, state: State) -> Result<(), MasterError> {
        let read = |own: &mut Wired, bytes: &[u8]| {
            let restored = own.component.deserialize(bytes);
            restored.map_err(|source| own.failure(Stage::Restore, source))
        };
        self.resume_with(state, read)
    }

    /// As [`resume`](Self::resume), where `restore` takes each component's part.
    pub(super) fn resume_with(
        &mut self,
        state: State,
        mut restore: impl FnMut(&mut Wired, &[u8]) -> Result<(), Failure>,
    ) -> Result<(), MasterError> {
        let fed = self.exchange.fed.len();
        let names = self.exchange.wired.iter().map(|own| &own.name);
        let fits = state.components.iter().map(|own| &own.name).eq(names)
            && state.slopes.len() == fed
            && state.history.fits(fed)
            && state.names.len() == state.row.len()
            && state.controller.is_some() == self.control.is_some();
        if !fits {
            return Err(MasterError::OtherState);
        }
        for (i, own) in state.components.iter().enumerate() {
            let wired = &mut self.exchange.wired[i];
            restore(wired, &own.bytes).map_err(Failure::at_start)?;
            if !own.has_slopes {
                wired.within.forget_slopes();
            }
            wired.within.is_watchable &= own.is_watchable;
            self.exchange.get_outputs(i).map_err(Failure::at_start)?;
        }
        let exchange = &mut self.exchange;
        for (signal, value) in exchange.signals.iter().zip(&mut exchange.values.row) {
            let mut before = state.names.iter().zip(&state.row);
            if let Some((_, kept)) = before.find(|(name, _)| **name == signal.name) {
                *value = *kept;
            }
        }
        exchange.values.slopes = state.slopes;
        exchange.values.lost_slopes.clear();
        exchange.history = state.history;
        let values = &exchange.values;
        exchange
            .wired
            .iter_mut()
            .for_each(|own| own.begin_changes(values));
        if let (Some((_, own)), Some(kept)) = (&mut self.control, state.controller) {
            *own = kept;
        }
        (self.unconverged, self.shortest) = (state.unconverged, state.shortest);
        match self
            .strong
            .as_mut()
            .is_none_or(|own| own.take(state.strong))
        {
            true => Ok(()),
            false => Err(MasterError::OtherState),
        }
    }
}
