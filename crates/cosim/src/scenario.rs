//! What happens in a run: signals that are replaced, frozen, shifted, scaled, delayed or noisy from some time on, and the end.
//!
//! The instance that has the input is wrapped: it is given other values than the wire carries. So there is no lag, and
//! the master knows nothing of it but that steps are cut where something changes.

mod disturbed;

use self::disturbed::{Disturbed, End};
use super::component::{Component, Role, ValueKind};
use super::recorder::{Recorder, Signal};
use super::system::{Port, System, SystemError};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use thiserror::Error;

/// Name of the instance that ends a run.
pub const NAME: &str = "scenario";

/// Events, each at a time or under a condition.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scenario {
    /// The events.
    pub events: Vec<Event>,
}

/// What happens, from when on and until when.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// When it begins.
    pub start: Start,
    /// How long it lasts \[s\]; infinite if it does not end.
    pub duration: f64,
    /// What happens.
    pub what: What,
}

/// Beginning of an event.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// At a time \[s\].
    Time(f64),
    /// At the first communication point where an output is above or below a number, in its unit.
    When {
        /// `instance.output`.
        output: String,
        /// Whether above.
        is_above: bool,
        /// The number.
        level: f64,
    },
}

/// What happens.
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// An input, `instance.input`, is given other values.
    Input(String, Effect),
    /// The run ends.
    End,
}

/// What becomes of an input's values, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// They are this number.
    Set(f64),
    /// They stay what they were.
    Freeze,
    /// This number is added.
    Bias(f64),
    /// They are multiplied by this number.
    Scale(f64),
    /// They are those of so long before \[s\]; before the start, those at the start.
    Delay(f64),
    /// They are what has come from outside for the input of this number, counted from 0.
    Live(usize),
    /// Normally distributed numbers are added, another one at each time.
    Noise {
        /// Standard deviation.
        sd: f64,
        /// Seed of the numbers.
        seed: u64,
    },
}

/// Why a scenario is not one of a system; the events are counted from 0.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// A name that is none.
    #[error(transparent)]
    Name(SystemError),
    /// A variable that cannot be disturbed.
    #[error("`{name}` is {role}; expected an input of an instance")]
    NoInput {
        /// Its name.
        name: String,
        /// What it is.
        role: Role,
    },
    /// A condition of something that is no output.
    #[error("`{name}` is {role}; expected an output in a condition")]
    NoOutput {
        /// Its name.
        name: String,
        /// What it is.
        role: Role,
    },
    /// An input of another type.
    #[error("`{name}` is of type {kind}; scenarios change Reals")]
    NotReal {
        /// Its name.
        name: String,
        /// Its type.
        kind: ValueKind,
    },
}

/// When events have begun \[s\], infinite for those that have not; and what has come from outside, NaN until then.
#[derive(Debug, Default)]
pub(crate) struct Starts {
    begun: Vec<AtomicU64>,
    live: Vec<AtomicU64>,
}

/// Where values from outside are put.
pub struct Inlets(Arc<Starts>);

impl Inlets {
    /// Puts a value for each [`Effect::Live`], in their order; they are given from the next step on.
    pub fn set(&self, values: &[f64]) {
        for (own, value) in self.0.live.iter().zip(values) {
            own.store(value.to_bits(), Ordering::Relaxed);
        }
    }
}

impl Starts {
    pub(crate) fn of(&self, event: usize) -> f64 {
        f64::from_bits(self.begun[event].load(Ordering::Relaxed))
    }

    pub(crate) fn set(&self, event: usize, time: f64) {
        self.begun[event].store(time.to_bits(), Ordering::Relaxed);
    }

    /// What has come from outside, if anything has.
    pub(crate) fn live(&self, number: usize) -> Option<f64> {
        let value = f64::from_bits(self.live[number].load(Ordering::Relaxed));
        (!value.is_nan()).then_some(value)
    }
}

impl Scenario {
    /// Lets it happen in a system that is wired; the run's recorder is put [behind](Triggers::over) the result.
    ///
    /// # Errors
    /// With the number of the event, if it is none of this system.
    pub fn apply(&self, system: &mut System) -> Result<Triggers, (usize, ScenarioError)> {
        let at_start = |event: &Event| match event.start {
            Start::Time(time) => time,
            Start::When { .. } => f64::INFINITY,
        };
        let starts = self.events.iter().map(at_start);
        let atomic = |t: f64| AtomicU64::new(t.to_bits());
        let is_live = |own: &&Event| matches!(own.what, What::Input(_, Effect::Live(_)));
        let live = self.events.iter().filter(is_live);
        let starts = Arc::new(Starts {
            begun: starts.map(atomic).collect(),
            live: live.map(|_| atomic(f64::NAN)).collect(),
        });
        let (mut waiting, mut inputs) = (Vec::new(), Vec::new());
        for (number, event) in self.events.iter().enumerate() {
            let port = check(system, event).map_err(|error| (number, error))?;
            if let (Some(port), What::Input(_, effect)) = (port, &event.what) {
                inputs.push((port, number, *effect, event.duration));
            }
            if let Start::When {
                output,
                is_above,
                level,
            } = &event.start
            {
                waiting.push((number, output.clone(), *is_above, *level));
            }
        }
        for position in 0..system.instances.len() {
            let variables = system.instances[position].component.variables();
            let handle = |port: Port| variables[port.variable].handle;
            let own = inputs.iter().filter(|own| own.0.instance == position);
            let own: Vec<_> = own
                .map(|(port, number, effect, duration)| {
                    (*number, handle(*port), *effect, *duration)
                })
                .collect();
            let wires = system.connections.iter().map(|own| own.to);
            let wired = wires
                .filter(|to| to.instance == position)
                .map(handle)
                .collect();
            if !own.is_empty() {
                let starts = Arc::clone(&starts);
                let wrap = |inner| -> Box<dyn Component> {
                    Box::new(Disturbed::new(inner, own, wired, starts))
                };
                let component = &mut system.instances[position].component;
                let inner = std::mem::replace(component, Box::new(End::default()));
                *component = wrap(inner);
            }
        }
        let ends: Vec<usize> = (0..self.events.len())
            .filter(|k| self.events[*k].what == What::End)
            .collect();
        if let Some(first) = ends.first() {
            let end = Box::new(End::new(ends.clone(), Arc::clone(&starts)));
            let added = system.add(NAME, end);
            added.map_err(|error| (*first, ScenarioError::Name(error)))?;
        }
        Ok(Triggers { waiting, starts })
    }
}

/// The input of an event that is one of a system.
fn check(system: &System, event: &Event) -> Result<Option<Port>, ScenarioError> {
    if let Start::When { output, .. } = &event.start {
        let variable = system.find(output).map_err(ScenarioError::Name)?;
        if variable.role != Role::Output || variable.kind == ValueKind::String {
            let (name, role) = (output.clone(), variable.role);
            return Err(ScenarioError::NoOutput { name, role });
        }
    }
    let What::Input(name, _) = &event.what else {
        return Ok(None);
    };
    let port = system.resolve(name).map_err(ScenarioError::Name)?;
    let variable = system.variable(port);
    let (name, role, kind) = (name.clone(), variable.role, variable.kind);
    match (role, kind) {
        (Role::Input, ValueKind::Real) => Ok(Some(port)),
        (Role::Input, _) => Err(ScenarioError::NotReal { name, kind }),
        _ => Err(ScenarioError::NoInput { name, role }),
    }
}

/// The events of a run that wait for conditions.
pub struct Triggers {
    /// Numbers of events with their outputs, whether these have to be above the level, and the level.
    waiting: Vec<(usize, String, bool, f64)>,
    starts: Arc<Starts>,
}

impl Triggers {
    /// Where values from outside are put.
    pub fn inlets(&self) -> Inlets {
        Inlets(Arc::clone(&self.starts))
    }

    /// Sees all rows of a run before this recorder does.
    pub fn over(self, inner: &mut dyn Recorder) -> Conditions<'_> {
        let (triggers, slots) = (self, Vec::new());
        Conditions {
            inner,
            triggers,
            slots,
        }
    }
}

/// A recorder that sees at each communication point whether conditions are true, before another one gets the row.
pub struct Conditions<'r> {
    inner: &'r mut dyn Recorder,
    triggers: Triggers,
    /// Places of the outputs in the row.
    slots: Vec<Option<usize>>,
}

impl Recorder for Conditions<'_> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        let slot = |name: &String| signals.iter().position(|own| own.name == *name);
        self.slots = self
            .triggers
            .waiting
            .iter()
            .map(|own| slot(&own.1))
            .collect();
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        for ((number, _, is_above, level), slot) in self.triggers.waiting.iter().zip(&self.slots) {
            let Some(slot) = slot else { continue };
            let is_true = match is_above {
                true => values[*slot] > *level,
                false => values[*slot] < *level,
            };
            if is_true && self.triggers.starts.of(*number) == f64::INFINITY {
                self.triggers.starts.set(*number, time);
            }
        }
        self.inner.row(time, values)
    }

    fn end_rows(&mut self) -> io::Result<()> {
        self.inner.end_rows()
    }

    fn is_stop_asked(&mut self) -> bool {
        self.inner.is_stop_asked()
    }
}
