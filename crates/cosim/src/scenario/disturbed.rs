//! An instance whose inputs are given other values than it is told, and one that ends the run.

use super::{Effect, Starts};
use crate::component::{
    Abilities, Component, ComponentError, Experiment, Linear, Progress, Suggested, Value,
    ValueKind, Variable,
};
use crate::source::is_reached;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;

/// What happens to an input: number of the event, and how long \[s\].
#[derive(Debug, Clone, Copy)]
struct Own {
    event: usize,
    effect: Effect,
    duration: f64,
}

/// An input with what happens to it, in the order of the events.
#[derive(Debug)]
struct Input {
    handle: u32,
    all: Vec<Own>,
    is_wired: bool,
    /// What it was given: times and values, as far back as they are needed.
    given: VecDeque<(f64, f64)>,
    /// The value that it has, if it is not wired.
    has: f64,
}

/// An instance with disturbed inputs.
pub(super) struct Disturbed {
    inner: Box<dyn Component>,
    inputs: Vec<Input>,
    starts: Arc<Starts>,
    has_wired: bool,
    has_begun: bool,
    time: f64,
    saved: Vec<f64>,
    room: Vec<f64>,
}

/// What is kept beside the instance's own state.
#[derive(Serialize, Deserialize)]
struct Kept {
    inner: Vec<u8>,
    time: f64,
    given: Vec<(VecDeque<(f64, f64)>, f64)>,
    starts: Vec<(usize, f64)>,
}

impl Disturbed {
    /// `own`: events with handles, effects and durations; `wired`: handles of the inputs that are fed.
    pub(super) fn new(
        inner: Box<dyn Component>,
        own: Vec<(usize, u32, Effect, f64)>,
        wired: Vec<u32>,
        starts: Arc<Starts>,
    ) -> Self {
        let mut inputs: Vec<Input> = Vec::new();
        for (event, handle, effect, duration) in own {
            let own = Own {
                event,
                effect,
                duration,
            };
            match inputs.iter_mut().find(|input| input.handle == handle) {
                Some(input) => input.all.push(own),
                None => inputs.push(Input {
                    handle,
                    all: vec![own],
                    is_wired: wired.contains(&handle),
                    given: VecDeque::new(),
                    has: f64::NAN,
                }),
            }
        }
        Self {
            inner,
            inputs,
            starts,
            has_wired: !wired.is_empty(),
            has_begun: false,
            time: 0.0,
            saved: Vec::new(),
            room: Vec::new(),
        }
    }

    /// Sets the disturbed inputs that are not wired.
    fn set_free(&mut self) -> Result<(), ComponentError> {
        for input in self.inputs.iter_mut().filter(|own| !own.is_wired) {
            let given = input.given.back().map_or(f64::NAN, |own| own.1);
            let value = input.value(given, self.time, &self.starts);
            if value != input.has {
                input.has = value;
                self.inner.set_reals(&[input.handle], &[value])?;
            }
        }
        Ok(())
    }

    /// Numbers for some inputs, each multiplied by the slope of the input's disturbance.
    fn sloped(&mut self, handles: &[u32], numbers: &[f64]) {
        let (time, starts, inputs) = (self.time, &self.starts, &self.inputs);
        let pairs = handles.iter().zip(numbers);
        self.room.clear();
        self.room.extend(pairs.map(|(handle, number)| {
            let input = inputs.iter().find(|own| own.handle == *handle);
            input.map_or(*number, |own| number * own.slope(time, starts))
        }));
    }
}

impl Own {
    fn is_on(&self, time: f64, starts: &Starts) -> bool {
        let start = starts.of(self.event);
        has_come(start, time) && !has_come(start + self.duration, time)
    }
}

impl Input {
    /// What becomes of the value that it is given now.
    fn value(&self, given: f64, time: f64, starts: &Starts) -> f64 {
        let on = self.all.iter().filter(|own| own.is_on(time, starts));
        on.fold(given, |value, own| match own.effect {
            Effect::Set(number) => number,
            Effect::Freeze => self.at(starts.of(own.event)).unwrap_or(value),
            Effect::Live(number) => starts.live(number).unwrap_or(value),
            Effect::Bias(number) => value + number,
            Effect::Scale(number) => value * number,
            Effect::Delay(delay) => self.at(time - delay).unwrap_or(value),
            Effect::Noise { sd, seed } => value + sd * normal(seed, own.event, time),
        })
    }

    /// The derivative of that by the value.
    fn slope(&self, time: f64, starts: &Starts) -> f64 {
        let on = self.all.iter().filter(|own| own.is_on(time, starts));
        on.fold(1.0, |slope, own| match own.effect {
            Effect::Set(_) | Effect::Freeze | Effect::Delay(_) => 0.0,
            Effect::Live(number) if starts.live(number).is_some() => 0.0,
            Effect::Scale(number) => slope * number,
            Effect::Live(_) | Effect::Bias(_) | Effect::Noise { .. } => slope,
        })
    }

    /// What it was given at a time, or first.
    fn at(&self, time: f64) -> Option<f64> {
        let before = self.given.iter().rev().find(|own| has_come(own.0, time));
        before.or(self.given.front()).map(|own| own.1)
    }

    /// Notes what it is given; what was noted of later times did not happen.
    fn note(&mut self, time: f64, value: f64, starts: &Starts) {
        while self.given.back().is_some_and(|own| own.0 >= time) {
            self.given.pop_back();
        }
        self.given.push_back((time, value));
        // A step may be repeated from its beginning, the last point but one.
        while let Some(k) =
            (0..self.given.len().saturating_sub(2)).find(|k| !self.needs(*k, starts))
        {
            self.given.remove(k);
        }
    }

    /// Whether an entry, none of the last two, may be asked for once more.
    fn needs(&self, k: usize, starts: &Starts) -> bool {
        let (own, next) = (self.given[k].0, self.given[k + 1].0);
        let last = self.given[self.given.len() - 2].0;
        self.all.iter().any(|one| match one.effect {
            Effect::Freeze => {
                let start = starts.of(one.event);
                k == 0 && !has_come(own, start) || has_come(own, start) && !has_come(next, start)
            }
            Effect::Delay(delay) => !has_come(next, last - delay),
            _ => false,
        })
    }
}

/// Whether a time has come; what is infinite never does.
fn has_come(event: f64, time: f64) -> bool {
    event.is_finite() && is_reached(event, time)
}

/// A normally distributed number: another one for each seed, event and time.
fn normal(seed: u64, event: usize, time: f64) -> f64 {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    bytes[8..16].copy_from_slice(&(event as u64).to_le_bytes());
    bytes[16..24].copy_from_slice(&time.to_bits().to_le_bytes());
    StandardNormal.sample(&mut ChaCha8Rng::from_seed(bytes))
}

impl Component for Disturbed {
    fn variables(&self) -> &[Variable] {
        self.inner.variables()
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        self.time = experiment.start;
        self.inner.setup(experiment)
    }

    fn enter_initialization(&mut self) -> Result<(), ComponentError> {
        self.inner.enter_initialization()
    }

    fn exit_initialization(&mut self) -> Result<(), ComponentError> {
        self.inner.exit_initialization()?;
        self.has_begun = true;
        for input in &mut self.inputs {
            let mut value = [0.0];
            self.inner.get_reals(&[input.handle], &mut value)?;
            input.given.push_back((self.time, value[0]));
            input.has = value[0];
        }
        Ok(())
    }

    fn words_of_discard(&mut self) -> Option<String> {
        self.inner.words_of_discard()
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        if !self.has_begun {
            return self.inner.set_reals(handles, values);
        }
        // Derivatives of inputs refer to the last call, which is that of the wired ones.
        self.set_free()?;
        self.room.clear();
        self.room.extend_from_slice(values);
        for (handle, value) in handles.iter().zip(&mut self.room) {
            if let Some(input) = self.inputs.iter_mut().find(|own| own.handle == *handle) {
                input.note(self.time, *value, &self.starts);
                *value = input.value(*value, self.time, &self.starts);
            }
        }
        self.inner.set_reals(handles, &self.room)
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        self.inner.get_reals(handles, values)
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        match value {
            Value::Real(value) if self.has_begun => self.set_reals(&[handle], &[*value]),
            _ => self.inner.set(handle, value),
        }
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        self.inner.get(handle, kind)
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        if !self.has_wired {
            self.set_free()?;
        }
        self.time = t + h;
        self.inner.step(t, h)
    }

    fn suggested(&self) -> Suggested {
        self.inner.suggested()
    }

    fn limitation(&self) -> Option<String> {
        self.inner.limitation()
    }

    fn terminate(&mut self) -> Result<(), ComponentError> {
        self.inner.terminate()
    }

    fn without_scenario(&mut self) -> Option<Option<Box<dyn Component>>> {
        Some(Some(std::mem::replace(
            &mut self.inner,
            Box::new(End::default()),
        )))
    }

    fn linearize(&mut self, step: f64) -> Result<Linear, ComponentError> {
        self.inner.linearize(step)
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            cuts_steps: true,
            ..self.inner.abilities()
        }
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        if self.saved.len() <= place {
            self.saved.resize(place + 1, self.time);
        }
        self.saved[place] = self.time;
        self.inner.save(place)
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        self.time = self.saved.get(place).copied().unwrap_or(self.time);
        // What it has then is not known.
        self.inputs.iter_mut().for_each(|own| own.has = f64::NAN);
        self.inner.restore(place)
    }

    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        let events = self.inputs.iter().flat_map(|own| &own.all);
        let kept = Kept {
            inner: self.inner.serialize()?,
            time: self.time,
            given: self
                .inputs
                .iter()
                .map(|own| (own.given.clone(), own.has))
                .collect(),
            starts: events
                .map(|own| (own.event, self.starts.of(own.event)))
                .collect(),
        };
        Ok(postcard::to_stdvec(&kept)?)
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        let kept: Kept = postcard::from_bytes(bytes)?;
        let mut events = self.inputs.iter().flat_map(|own| &own.all);
        let is_same = kept.given.len() == self.inputs.len()
            && kept
                .starts
                .iter()
                .all(|own| events.next().is_some_and(|e| e.event == own.0));
        if !is_same {
            return Err("the state is that of another scenario".into());
        }
        self.inner.deserialize(&kept.inner)?;
        self.time = kept.time;
        for (input, (given, has)) in self.inputs.iter_mut().zip(kept.given) {
            (input.given, input.has) = (given, has);
        }
        for (event, time) in kept.starts {
            self.starts.set(event, time);
        }
        Ok(())
    }

    fn step_revocably(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        if !self.has_wired {
            self.set_free()?;
        }
        self.time = t + h;
        self.inner.step_revocably(t, h)
    }

    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        self.sloped(handles, slopes);
        self.inner.set_input_derivatives(handles, &self.room)
    }

    fn get_output_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), ComponentError> {
        self.inner.get_output_derivatives(handles, slopes)
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        let events = self.inputs.iter().flat_map(|own| &own.all);
        let ends = events.flat_map(|own| {
            let start = self.starts.of(own.event);
            [start, start + own.duration]
        });
        let ends = ends.filter(|time| time.is_finite() && !has_come(*time, t));
        ends.chain(self.inner.next_jump(t)).reduce(f64::min)
    }

    fn directional_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), ComponentError> {
        self.sloped(inputs, seed);
        (self.inner).directional_derivative(outputs, inputs, &self.room, result)
    }
}

/// An instance that ends the run.
#[derive(Default)]
pub(super) struct End {
    events: Vec<usize>,
    starts: Arc<Starts>,
}

impl End {
    pub(super) fn new(events: Vec<usize>, starts: Arc<Starts>) -> Self {
        Self { events, starts }
    }

    fn time(&self) -> f64 {
        let times = self.events.iter().map(|own| self.starts.of(*own));
        times.fold(f64::INFINITY, f64::min)
    }
}

impl Component for End {
    fn variables(&self) -> &[Variable] {
        &[]
    }

    fn set_reals(&mut self, _handles: &[u32], _values: &[f64]) -> Result<(), ComponentError> {
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], _values: &mut [f64]) -> Result<(), ComponentError> {
        Ok(())
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        let end = self.time();
        Ok(match end < t + h && !has_come(t + h, end) {
            true => Progress::EndRequested {
                reached: end.max(t),
            },
            false => Progress::Done,
        })
    }

    fn without_scenario(&mut self) -> Option<Option<Box<dyn Component>>> {
        Some(None)
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            rollback: true,
            serialization: true,
            variable_steps: true,
            cuts_steps: true,
            ..Abilities::default()
        }
    }

    fn save(&mut self, _place: usize) -> Result<(), ComponentError> {
        Ok(())
    }

    fn restore(&mut self, _place: usize) -> Result<(), ComponentError> {
        Ok(())
    }

    fn serialize(&mut self) -> Result<Vec<u8>, ComponentError> {
        Ok(self.time().to_le_bytes().to_vec())
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Result<(), ComponentError> {
        let time = f64::from_le_bytes(bytes.try_into()?);
        if time < self.time() {
            self.events
                .iter()
                .take(1)
                .for_each(|own| self.starts.set(*own, time));
        }
        Ok(())
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        let end = self.time();
        (end.is_finite() && !has_come(end, t)).then_some(end)
    }
}
