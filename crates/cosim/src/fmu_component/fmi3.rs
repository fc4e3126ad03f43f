//! What co-simulation of FMI 3.0 has beyond that of FMI 2.0: events that the master handles, steps that
//! end early, and inputs that change within a step.

use super::Access;
use crate::component::{ComponentError, Progress, Value};
use pilotage_fmi::description::{
    Causality, ModelDescription, ScalarVariable, Variability, VariableKind,
};
use pilotage_fmi::instance::MAX_EVENT_ROUNDS;
use pilotage_fmi::{Instance, InstanceOptions, Intermediate, IntermediateUpdate, Step};
use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

/// How often a step may be interrupted.
const MAX_STOPS: u32 = 10_000;

/// How near to the end of a step is its end, relative to the step.
const ROUNDING: f64 = 1e-12;

/// What an instance of FMI 3.0 is asked for and how it is stepped (FMI 3.0, sections 4.1.2 and 4.2).
#[derive(Debug)]
pub(super) struct Fmi3 {
    /// The FMU has event mode: events within steps end these and are handled here, discrete inputs are
    /// set there.
    has_event_mode: bool,
    /// Value references of reals that are set in event mode.
    discrete: HashSet<u32>,
    /// Discrete inputs that are to be set, with the values that they shall have.
    pending: Vec<(u32, Value)>,
    has_begun: bool,
    is_end_requested: bool,
    /// When the next time event comes [s].
    pub(super) next_event: Option<f64>,
    /// Inputs within steps, if the FMU asks for them.
    ramps: Option<Arc<Mutex<Ramps>>>,
}

/// Lines along which the inputs go in a step.
#[derive(Debug, Default)]
struct Ramps {
    is_on: bool,
    /// The FMU wants inputs that are smooth within a step: what it gets counts at that time alone, and it finds
    /// what is between. Else that is held.
    is_smooth: bool,
    handles: Vec<u32>,
    /// Values at the begin, slopes [1/s], room for the values in between.
    values: Vec<f64>,
    slopes: Vec<f64>,
    room: Vec<f64>,
    begin: f64,
    end: f64,
    /// The last time that the FMU asked, and how long after the one before: until it asks again, what it
    /// gets counts.
    last: f64,
    between: f64,
    /// The time after the begin whose values it got then, and by how much the integral of that over the
    /// step is short of what it should be: it asked sooner or later than was thought.
    given: f64,
    short: f64,
}

impl Ramps {
    /// The values at `time` or, if these count until the FMU asks again, those in the middle of that.
    fn at(&mut self, time: f64) -> (&[u32], &[f64]) {
        let is_end = self.end - time <= ROUNDING * (self.end - self.begin);
        let next = (time + self.between).min(self.end);
        self.given = match is_end {
            true => self.end - self.begin,
            false if self.is_smooth => time - self.begin,
            false => 0.5 * (time + next) - self.begin + self.short / (next - time),
        };
        self.room.clear();
        let lines = self.values.iter().zip(&self.slopes);
        self.room
            .extend(lines.map(|(value, slope)| value + self.given * slope));
        (&self.handles, &self.room)
    }

    fn update(&mut self, intermediate: &mut Intermediate) {
        if !self.is_on {
            return;
        }
        let time = intermediate.time;
        if intermediate.is_step_finished && time > self.last {
            let middle = 0.5 * (self.last + time) - self.begin;
            self.short += (middle - self.given) * (time - self.last);
            (self.between, self.last) = (time - self.last, time);
        }
        if intermediate.can_set {
            let (handles, values) = self.at(time);
            // An FMU that refuses keeps the value that it has.
            let _ = intermediate.set_real(handles, values);
        }
    }
}

fn lock(ramps: &Mutex<Ramps>) -> std::sync::MutexGuard<'_, Ramps> {
    ramps.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Fmi3 {
    /// What the FMU can, and how an instance is asked for it.
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
        let is_smooth = cs.is_some_and(|cs| cs.recommended_intermediate_input_smoothness > 0);
        let ramps = Ramps {
            is_smooth,
            ..Ramps::default()
        };
        let ramps = is_updated.then(|| Arc::new(Mutex::new(ramps)));
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

    /// After initialization: leaves event mode.
    pub(super) fn begin(&mut self, instance: &mut Instance) -> Result<(), ComponentError> {
        self.has_begun = true;
        match self.has_event_mode {
            true => self.settle(instance),
            false => Ok(()),
        }
    }

    /// Whether this is set in event mode alone.
    pub(super) fn is_for_events(&self, handle: u32, value: &Value) -> bool {
        let is_discrete = !matches!(value, Value::Real(_)) || self.discrete.contains(&handle);
        self.has_begun && self.has_event_mode && is_discrete
    }

    /// Sets a discrete input in the next event, if it is new.
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

    /// Sets reals; those that are held until a ramp is set. Kept out of the way of FMI 2.0, as is the step.
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

    /// Lets the inputs that were set last go on along lines.
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

    /// Sets the discrete inputs that wait, all in one event.
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

    /// Forgets what was to be set: the instance goes back.
    pub(super) fn forget(&mut self) {
        self.pending.clear();
    }

    /// Event iteration, and back to step mode.
    fn settle(&mut self, instance: &mut Instance) -> Result<(), ComponentError> {
        let Some(update) = instance.iterate_event()? else {
            return Err(format!("an event does not settle in {MAX_EVENT_ROUNDS} rounds").into());
        };
        self.is_end_requested |= update.is_end_requested;
        self.next_event = update.next_time;
        Ok(instance.enter_step_mode()?)
    }

    /// Takes a step from `t` by `h` [s], with all events in it.
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
        self.begin_ramps(t, end);
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

    fn begin_ramps(&self, begin: f64, end: f64) {
        if let Some(ramps) = &self.ramps {
            let mut ramps = lock(ramps);
            (ramps.begin, ramps.end, ramps.last) = (begin, end, begin);
            ramps.short = 0.0;
            // An FMU that never asks gets the middle.
            if ramps.between == 0.0 {
                ramps.between = end - begin;
            }
        }
    }

    /// Sets the inputs that go along lines for what comes after `time`.
    fn lead(
        &self,
        access: &Access,
        instance: &mut Instance,
        time: f64,
    ) -> Result<(), ComponentError> {
        if let Some(ramps) = &self.ramps {
            let mut ramps = lock(ramps);
            if ramps.is_on {
                let (handles, values) = ramps.at(time);
                access.set_reals(instance, handles, values)?;
            }
        }
        Ok(())
    }
}
