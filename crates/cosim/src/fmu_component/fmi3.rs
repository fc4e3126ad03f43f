//! Features of FMI 3.0 co-simulation beyond FMI 2.0: events handled by the master, early return from steps, and inputs
//! that change within a step.

use super::Access;
use crate::component::{ComponentError, Progress, Value};
use pilotage_fmi::description::{
    Causality, ModelDescription, ScalarVariable, Variability, VariableKind,
};
use pilotage_fmi::instance::MAX_EVENT_ROUNDS;
use pilotage_fmi::{Instance, InstanceOptions, Intermediate, IntermediateUpdate, Step};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of early returns within a step.
const MAX_STOPS: u32 = 10_000;

/// Tolerance for the end of a step, relative to the step.
const ROUNDING: f64 = 1e-12;

/// FMI 3.0 instance options and stepping (FMI 3.0, sections 4.1.2 and 4.2).
#[derive(Debug)]
pub(super) struct Fmi3 {
    /// Whether the FMU has event mode: events within steps end these and are handled here, where discrete inputs are
    /// set.
    has_event_mode: bool,
    /// Value references of reals set in event mode.
    discrete: HashSet<u32>,
    /// Discrete inputs to be set, with their values.
    pending: Vec<(u32, Value)>,
    has_begun: bool,
    is_end_requested: bool,
    /// Time of the next time event [s].
    pub(super) next_event: Option<f64>,
    /// Input ramps within steps, if the FMU requests intermediate updates.
    ramps: Option<Arc<Mutex<Ramps>>>,
}

/// Linear inputs within a step. An intermediate update gets the values at its own time (FMI 3.0, section 4.2.2).
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
struct Ramps {
    is_on: bool,
    handles: Vec<u32>,
    /// Values at the beginning, slopes [1/s], buffer for intermediate values.
    values: Vec<f64>,
    slopes: Vec<f64>,
    room: Vec<f64>,
    begin: f64,
    end: f64,
    /// Whether the FMU has asked for inputs within the step. `None` before the first one.
    is_asked: Option<bool>,
    /// Whether it did not within the last step. It then holds the inputs from the beginning, and gets their mean.
    is_holding: bool,
}

/// What is kept of [`Fmi3`] beside the FMU's own state.
#[derive(Serialize, Deserialize)]
pub(super) struct KeptFmi3 {
    next_event: Option<f64>,
    ramps: Option<Ramps>,
}

impl Ramps {
    /// The values at `time`.
    fn at(&mut self, time: f64) -> (&[u32], &[f64]) {
        let since = time - self.begin;
        self.room.clear();
        let lines = self.values.iter().zip(&self.slopes);
        (self.room).extend(lines.map(|(value, slope)| value + since * slope));
        (&self.handles, &self.room)
    }

    fn begin(&mut self, begin: f64, end: f64) {
        self.is_holding = self.is_asked == Some(false);
        (self.begin, self.end, self.is_asked) = (begin, end, Some(false));
    }

    fn update(&mut self, intermediate: &mut Intermediate) {
        if intermediate.can_set {
            self.is_asked = Some(true);
        }
        if self.is_on && intermediate.can_set {
            let (handles, values) = self.at(intermediate.time);
            // An FMU that rejects the value keeps its previous one.
            let _ = intermediate.set_real(handles, values);
        }
    }
}

fn lock(ramps: &Mutex<Ramps>) -> std::sync::MutexGuard<'_, Ramps> {
    ramps.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Fmi3 {
    /// The FMU's features, and the options to instantiate it.
    pub(super) fn of(description: &ModelDescription) -> (Self, InstanceOptions) {
        let cs = description.co_simulation.as_ref();
        let has_event_mode = cs.is_some_and(|cs| cs.has_event_mode);
        let inputs = || {
            description
                .variables
                .iter()
                .filter(|v| v.causality == Causality::Input)
        };
        let is_real = |v: &&ScalarVariable| {
            matches!(v.kind, VariableKind::Real(_)) && v.dimensions.is_empty()
        };
        let discrete = inputs()
            .filter(is_real)
            .filter(|v| v.variability == Variability::Discrete);
        let continuous = || {
            inputs()
                .filter(is_real)
                .filter(|v| v.variability == Variability::Continuous)
        };
        let is_updated = cs.is_some_and(|cs| cs.provides_intermediate_update)
            && continuous().all(|v| v.intermediate_update)
            && continuous().next().is_some()
            && inputs().all(|v| v.dimensions.is_empty());
        let ramps = is_updated.then(|| Arc::new(Mutex::new(Ramps::default())));
        let update = ramps.clone().map(|ramps| {
            IntermediateUpdate::new(move |intermediate| {
                lock(&ramps).update(intermediate);
                None
            })
        });
        let options = InstanceOptions {
            event_mode_used: has_event_mode,
            early_return_allowed: cs.is_some_and(|cs| cs.might_return_early_from_do_step),
            required_intermediate_variables: match is_updated {
                true => continuous().map(|v| v.value_reference).collect(),
                false => Vec::new(),
            },
            intermediate_update: update,
            ..InstanceOptions::default()
        };
        let fmi3 = Self {
            has_event_mode,
            discrete: match has_event_mode {
                true => discrete.map(|v| v.value_reference).collect(),
                false => HashSet::new(),
            },
            pending: Vec::new(),
            has_begun: false,
            is_end_requested: false,
            next_event: None,
            ramps,
        };
        (fmi3, options)
    }

    /// Whether inputs can change within a step.
    pub(super) fn has_ramps(&self) -> bool {
        self.ramps.is_some()
    }

    /// Leaves event mode after initialization.
    pub(super) fn begin(&mut self, instance: &mut Instance) -> Result<(), ComponentError> {
        self.has_begun = true;
        match self.has_event_mode {
            true => self.settle(instance),
            false => Ok(()),
        }
    }

    /// Whether this variable can be set only in event mode.
    pub(super) fn is_for_events(&self, handle: u32, value: &Value) -> bool {
        let is_discrete = !matches!(value, Value::Real(_)) || self.discrete.contains(&handle);
        self.has_begun && self.has_event_mode && is_discrete
    }

    /// Defers a discrete input to the next event if its value changes.
    pub(super) fn defer(
        &mut self,
        access: &Access,
        instance: &mut Instance,
        handle: u32,
        value: &Value,
    ) -> Result<(), ComponentError> {
        access.check(handle, value)?;
        self.pending.retain(|(other, _)| *other != handle);
        if access.get(instance, handle, value.kind())? != *value {
            self.pending.push((handle, value.clone()));
        }
        Ok(())
    }

    /// Sets reals; they are held until a ramp is set. Not inlined, to keep the FMI 2.0 path short; likewise the step.
    #[inline(never)]
    pub(super) fn set_reals(
        &mut self,
        access: &Access,
        instance: &mut Instance,
        handles: &[u32],
        values: &[f64],
    ) -> Result<(), ComponentError> {
        if let Some(ramps) = &self.ramps {
            let mut ramps = lock(ramps);
            ramps.is_on = false;
            ramps.values.clear();
            ramps.values.extend_from_slice(values);
        }
        if self.discrete.is_empty() || !self.has_begun {
            return access.set_reals(instance, handles, values);
        }
        for (&handle, &value) in handles.iter().zip(values) {
            let real = Value::Real(value);
            match self.is_for_events(handle, &real) {
                true => self.defer(access, instance, handle, &real)?,
                false => access.set_reals(instance, &[handle], &[value])?,
            }
        }
        Ok(())
    }

    /// Makes the inputs set last continue along lines.
    pub(super) fn set_slopes(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        let Some(ramps) = &self.ramps else {
            return Err("its inputs cannot change within a step".into());
        };
        let mut ramps = lock(ramps);
        ramps.is_on = true;
        ramps.handles.clear();
        ramps.handles.extend_from_slice(handles);
        ramps.slopes.clear();
        ramps.slopes.extend_from_slice(slopes);
        Ok(())
    }

    /// Sets the pending discrete inputs in one event.
    pub(super) fn flush(
        &mut self,
        access: &Access,
        instance: &mut Instance,
    ) -> Result<(), ComponentError> {
        if self.pending.is_empty() {
            return Ok(());
        }
        instance.enter_event_mode()?;
        for (handle, value) in self.pending.drain(..) {
            access.set(instance, handle, &value)?;
        }
        self.settle(instance)
    }

    /// Discards pending inputs after a rollback.
    pub(super) fn forget(&mut self) {
        self.pending.clear();
        self.is_end_requested = false;
    }

    /// What goes on between two steps; nothing is pending.
    pub(super) fn kept(&self) -> KeptFmi3 {
        KeptFmi3 {
            next_event: self.next_event,
            ramps: self.ramps.as_ref().map(|ramps| lock(ramps).clone()),
        }
    }

    /// Goes on from there.
    pub(super) fn take(&mut self, kept: KeptFmi3) {
        self.forget();
        self.next_event = kept.next_event;
        if let (Some(ramps), Some(kept)) = (&self.ramps, kept.ramps) {
            *lock(ramps) = kept;
        }
    }

    /// Iterates the event, then returns to step mode.
    fn settle(&mut self, instance: &mut Instance) -> Result<(), ComponentError> {
        let Some(update) = instance.iterate_event()? else {
            return Err(format!("an event does not settle in {MAX_EVENT_ROUNDS} rounds").into());
        };
        self.is_end_requested |= update.is_end_requested;
        self.next_event = update.next_time;
        Ok(instance.enter_step_mode()?)
    }

    /// Steps from `t` by `h` [s], including all events.
    #[inline(never)]
    pub(super) fn step(
        &mut self,
        access: &Access,
        instance: &mut Instance,
        (t, h): (f64, f64),
        is_revocable: bool,
    ) -> Result<Progress, ComponentError> {
        self.flush(access, instance)?;
        let (mut at, end) = (t, t + h);
        if let Some(ramps) = &self.ramps {
            lock(ramps).begin(t, end);
        }
        for _ in 0..MAX_STOPS {
            self.lead(access, instance, at)?;
            let step = match is_revocable {
                true => instance.do_step_revocably(at, end - at)?,
                false => instance.do_step(at, end - at)?,
            };
            let Step::Stopped {
                reached,
                is_event,
                is_end_requested,
            } = step
            else {
                return Ok(self.ended(super::progress(step, t), end));
            };
            if is_end_requested {
                return Ok(Progress::EndRequested { reached });
            }
            if is_event && self.has_event_mode {
                instance.enter_event_mode()?;
                self.settle(instance)?;
            }
            if self.is_end_requested || end - reached <= ROUNDING * h {
                return Ok(self.ended(Progress::Done, reached));
            }
            at = reached;
        }
        Err(format!(
            "the step from {t} s to {end} s ended early {MAX_STOPS} times, at last at {at} s"
        )
        .into())
    }

    fn ended(&self, progress: Progress, reached: f64) -> Progress {
        match (progress, self.is_end_requested) {
            (Progress::Done, true) => Progress::EndRequested { reached },
            (other, _) => other,
        }
    }

    /// Sets the inputs on ramps for the interval after `time`.
    fn lead(
        &self,
        access: &Access,
        instance: &mut Instance,
        time: f64,
    ) -> Result<(), ComponentError> {
        if let Some(ramps) = &self.ramps {
            let mut ramps = lock(ramps);
            if ramps.is_on {
                let time = match ramps.is_holding {
                    true => 0.5 * (time + ramps.end),
                    false => time,
                };
                let (handles, values) = ramps.at(time);
                access.set_reals(instance, handles, values)?;
            }
        }
        Ok(())
    }
}
