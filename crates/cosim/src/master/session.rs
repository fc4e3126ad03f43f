//! A system that is stepped by calls, one communication step after the other, instead of by a clock: inside an FMU.

use super::initialize::{enter, exit, propagate};
use super::stepper::Stepper;
use super::wired::{Failure, Wired};
use super::{Ending, MasterError, Stage, State, check};
use crate::algorithms::Coupling;
use crate::component::{Component, ComponentError, Experiment, Value, ValueKind};
use crate::system::{Connection, Instance, Port, System};
use std::collections::HashMap;

/// A system that its owner initializes and steps. Where a run would read outputs, they are read; free inputs are set by the
/// owner between steps and keep their values.
///
/// After an error, and after a step that did not end where it should, the components stand at different times: only a
/// [restored](Self::restore) state or [renewal](Self::renew) leads on.
pub struct Session {
    stage: Now,
    coupling: Coupling,
    /// The system but for its components.
    plan: Plan,
}

/// How far a session is.
enum Now {
    /// Start values are collected.
    Before(System),
    /// The second says whether values on wires are consistent with what was set last.
    Initializing(System, bool),
    Running(Box<Stepper>),
    /// An error has occurred while components changed hands.
    Lost,
}

/// A system without its components.
struct Plan {
    instances: Vec<(String, Vec<usize>, u32, bool)>,
    connections: Vec<Connection>,
    settings: Vec<(Port, Value)>,
    /// Slots in the row of real outputs and of what is observed.
    slots: HashMap<Port, usize>,
}

impl Plan {
    fn of(system: &System) -> Self {
        let mut slots = HashMap::new();
        for (instance, own) in system.instances.iter().enumerate() {
            // As the row is laid out: reals first, then other numbers.
            let variables = own.component.variables().iter().enumerate();
            let read = variables.filter(|(variable, v)| {
                v.role == crate::component::Role::Output || own.observed.contains(variable)
            });
            let (reals, others): (Vec<_>, Vec<_>) =
                read.partition(|(_, v)| v.kind == ValueKind::Real);
            let first = slots.len();
            for (k, (variable, _)) in reals.iter().enumerate() {
                let variable = *variable;
                slots.insert(Port { instance, variable }, first + k);
            }
            let others = others.iter().filter(|(_, v)| v.kind != ValueKind::String);
            for (variable, _) in others {
                let (slot, variable) = (slots.len(), *variable);
                slots.insert(Port { instance, variable }, slot);
            }
        }
        let instances = system.instances.iter();
        Self {
            instances: instances
                .map(|own| {
                    (
                        own.name.clone(),
                        own.observed.clone(),
                        own.parts,
                        own.at_once,
                    )
                })
                .collect(),
            connections: system.connections.clone(),
            settings: system.settings.clone(),
            slots,
        }
    }

    /// The system of these components.
    fn system(&self, components: Vec<Box<dyn Component>>) -> System {
        let parts = self.instances.iter().zip(components);
        let instances = parts.map(|((name, observed, parts, at_once), component)| Instance {
            name: name.clone(),
            component,
            observed: observed.clone(),
            parts: *parts,
            at_once: *at_once,
        });
        System {
            instances: instances.collect(),
            connections: self.connections.clone(),
            settings: self.settings.clone(),
        }
    }
}

/// A copy of a session's state. Components keep theirs in the slot with which it was made, or as bytes in it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Kept {
    stage: KeptStage,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
enum KeptStage {
    Before(Vec<(usize, usize, Value)>),
    Initializing(bool),
    Running(Box<State>),
}

impl Session {
    /// A session of a wired system, before its initialization.
    ///
    /// # Errors
    /// If the components cannot be coupled so.
    pub fn new(system: System, coupling: Coupling) -> Result<Self, MasterError> {
        check(&coupling)?;
        Ok(Self {
            plan: Plan::of(&system),
            stage: Now::Before(system),
            coupling,
        })
    }

    fn component(&mut self, instance: usize) -> Result<&mut dyn Component, ComponentError> {
        match &mut self.stage {
            Now::Before(system) | Now::Initializing(system, _) => {
                Ok(system.instances[instance].component.as_mut())
            }
            Now::Running(stepper) => Ok(stepper.exchange.wired[instance].component.as_mut()),
            Now::Lost => Err("it was lost when an earlier call failed".into()),
        }
    }

    /// The components with their names.
    fn components(&mut self) -> Vec<Box<dyn Component>> {
        match std::mem::replace(&mut self.stage, Now::Lost) {
            Now::Before(system) | Now::Initializing(system, _) => {
                let own = system.components().into_iter();
                own.map(|(_, component)| component).collect()
            }
            Now::Running(stepper) => {
                let own = stepper.exchange.wired.into_iter();
                own.map(|own| own.component).collect()
            }
            Now::Lost => Vec::new(),
        }
    }

    /// Enters initialization with the start values set so far.
    ///
    /// # Errors
    /// If a component fails.
    pub fn enter_initialization(&mut self, experiment: &Experiment) -> Result<(), MasterError> {
        if let Now::Before(system) = &mut self.stage {
            enter(system, experiment)?;
        }
        self.stage = match std::mem::replace(&mut self.stage, Now::Lost) {
            Now::Before(system) => Now::Initializing(system, false),
            other => other,
        };
        Ok(())
    }

    /// Exits initialization with consistent values; the components stand at the start time.
    ///
    /// # Errors
    /// If a component fails, or an algebraic loop has no solution.
    pub fn exit_initialization(&mut self, start: f64) -> Result<(), MasterError> {
        self.settle()?;
        if let Now::Initializing(system, _) = &mut self.stage {
            exit(system)?;
        }
        self.stage = match std::mem::replace(&mut self.stage, Now::Lost) {
            Now::Initializing(system, _) => {
                let mut stepper = Stepper::of(system, &self.coupling)?;
                stepper.begin(start)?;
                Now::Running(Box::new(stepper))
            }
            other => other,
        };
        Ok(())
    }

    /// During initialization: makes the values on wires consistent.
    fn settle(&mut self) -> Result<(), MasterError> {
        if let Now::Initializing(system, is_settled) = &mut self.stage
            && !*is_settled
        {
            propagate(system)?;
            *is_settled = true;
        }
        Ok(())
    }

    /// Sets a start value, a free input or a tunable parameter.
    ///
    /// # Errors
    /// If the component refuses it.
    pub fn set(&mut self, port: Port, handle: u32, value: &Value) -> Result<(), ComponentError> {
        if let Now::Before(system) = &mut self.stage {
            let known = system.settings.iter_mut().find(|(own, _)| *own == port);
            match known {
                Some((_, own)) => *own = value.clone(),
                None => system.settings.push((port, value.clone())),
            }
            return Ok(());
        }
        if let Now::Initializing(_, is_settled) = &mut self.stage {
            *is_settled = false;
        }
        self.component(port.instance)?.set(handle, value)
    }

    /// Sets a real as [`set`](Self::set) does.
    ///
    /// # Errors
    /// If the component refuses it.
    #[inline]
    pub fn set_real(&mut self, port: Port, handle: u32, value: f64) -> Result<(), ComponentError> {
        match &mut self.stage {
            Now::Running(stepper) => {
                let component = &mut stepper.exchange.wired[port.instance].component;
                component.set_reals(&[handle], &[value])
            }
            _ => self.set(port, handle, &Value::Real(value)),
        }
    }

    /// The value of a variable: of an output, that at the last communication point.
    ///
    /// # Errors
    /// If a component fails.
    pub fn get(
        &mut self,
        port: Port,
        handle: u32,
        kind: ValueKind,
    ) -> Result<Value, ComponentError> {
        self.settle()?;
        if let Now::Before(system) = &self.stage
            && let Some((_, value)) = system.settings.iter().find(|(own, _)| *own == port)
        {
            return Ok(value.clone());
        }
        self.component(port.instance)?.get(handle, kind)
    }

    /// The current value of a real of a component; those of a communication point are in the [`row`](Self::row).
    ///
    /// # Errors
    /// If a component fails.
    #[inline]
    pub fn get_real(&mut self, port: Port, handle: u32) -> Result<f64, ComponentError> {
        match &mut self.stage {
            Now::Running(stepper) => {
                let mut value = [0.0];
                let component = &mut stepper.exchange.wired[port.instance].component;
                component.get_reals(&[handle], &mut value)?;
                Ok(value[0])
            }
            _ => Ok(self.get(port, handle, ValueKind::Real)?.as_number()),
        }
    }

    /// Place in the [`row`](Self::row) of a real output, or of what is observed.
    pub fn slot(&self, port: Port) -> Option<usize> {
        self.plan.slots.get(&port).copied()
    }

    /// The values at the last communication point; `None` before the end of initialization.
    #[inline]
    pub fn row(&self) -> Option<&[f64]> {
        match &self.stage {
            Now::Running(stepper) => Some(&stepper.exchange.values.row),
            _ => None,
        }
    }

    /// Steps all components from the communication point at `t` to that at `end`, `h` later \[s\].
    ///
    /// # Errors
    /// If a component does not reach the end.
    #[inline]
    pub fn advance(&mut self, t: f64, end: f64, h: f64) -> Result<(), Ending> {
        match &mut self.stage {
            Now::Running(stepper) => stepper.advance(t, end, h),
            _ => Err(Ending::Stopped { time: t }),
        }
    }

    /// Terminates all components that were initialized; the first failure.
    ///
    /// # Errors
    /// If a component fails.
    pub fn terminate(&mut self) -> Result<(), Ending> {
        let Now::Running(stepper) = &mut self.stage else {
            return Ok(());
        };
        let time = stepper.exchange.history.time();
        let mut failed = Ok(());
        for own in &mut stepper.exchange.wired {
            if let Err(source) = own.component.terminate() {
                let failure = own.failure(Stage::Terminate, source).at(time);
                failed = failed.and(Err(failure));
            }
        }
        failed
    }

    /// A copy of the state, for which each component keeps its own in the slot `place` ([`Component::save`]): from 3 on, since
    /// the first are those of the master.
    ///
    /// # Errors
    /// If a component cannot save its state.
    pub fn save(&mut self, place: usize) -> Result<Kept, MasterError> {
        let stage = match &mut self.stage {
            Now::Running(stepper) => {
                let save = |own: &mut Wired| own.save(place).map(|()| Vec::new());
                let state = stepper.state_with(0, save).map_err(Failure::at_start)?;
                KeptStage::Running(Box::new(state))
            }
            Now::Before(system) | Now::Initializing(system, _) => {
                for own in &mut system.instances {
                    let saved = own.component.save(place);
                    saved.map_err(|source| failed(&own.name, Stage::Save, source))?;
                }
                self.early()
            }
            Now::Lost => self.early(),
        };
        Ok(Kept { stage })
    }

    fn early(&self) -> KeptStage {
        match &self.stage {
            Now::Initializing(_, is_settled) => KeptStage::Initializing(*is_settled),
            Now::Before(system) => {
                let settings = system.settings.iter();
                let flat =
                    |(port, value): &(Port, Value)| (port.instance, port.variable, value.clone());
                KeptStage::Before(settings.map(flat).collect())
            }
            Now::Running(_) | Now::Lost => KeptStage::Before(Vec::new()),
        }
    }

    /// A copy of the state in which the components' own are bytes. `None` before the end of initialization.
    ///
    /// # Errors
    /// If a component cannot write its state.
    pub fn serialize(&mut self) -> Result<Option<Kept>, MasterError> {
        let Now::Running(stepper) = &mut self.stage else {
            return Ok(None);
        };
        let state = stepper.state(0).map_err(Failure::at_start)?;
        let stage = KeptStage::Running(Box::new(state));
        Ok(Some(Kept { stage }))
    }

    /// Restores a copy: of the components from their slot `place`, or from bytes.
    ///
    /// # Errors
    /// If a component cannot restore its state, or the state is another system's.
    pub fn restore(&mut self, kept: &Kept, place: Option<usize>) -> Result<(), MasterError> {
        let is_running = matches!(self.stage, Now::Running(_));
        match &kept.stage {
            KeptStage::Running(state) => {
                if !is_running {
                    let components = self.components();
                    let system = self.plan.system(components);
                    let stepper = Stepper::of(system, &self.coupling)?;
                    self.stage = Now::Running(Box::new(stepper));
                }
                let Now::Running(stepper) = &mut self.stage else {
                    return Err(MasterError::OtherState);
                };
                match place {
                    None => stepper.resume(State::clone(state)),
                    Some(place) => stepper
                        .resume_with(State::clone(state), |own: &mut Wired, _| own.restore(place)),
                }
            }
            early => {
                let components = self.components();
                let mut system = self.plan.system(components);
                for own in &mut system.instances {
                    let restored = match place {
                        Some(place) => own.component.restore(place),
                        None => Err("a state before the end of initialization has no bytes".into()),
                    };
                    restored.map_err(|source| failed(&own.name, Stage::Restore, source))?;
                }
                self.stage = match early {
                    KeptStage::Initializing(is_settled) => Now::Initializing(system, *is_settled),
                    KeptStage::Before(settings) => {
                        let port = |(instance, variable, value): &(usize, usize, Value)| {
                            let (instance, variable) = (*instance, *variable);
                            (Port { instance, variable }, value.clone())
                        };
                        system.settings = settings.iter().map(port).collect();
                        Now::Before(system)
                    }
                    KeptStage::Running(_) => Now::Lost,
                };
                Ok(())
            }
        }
    }

    /// Makes the session as it was when it was made. Returns whether all components [can](Component::renew); if not, the session
    /// is of no more use.
    pub fn renew(&mut self) -> bool {
        let mut components = self.components();
        for own in &mut components {
            if !own.renew().unwrap_or(false) {
                return false;
            }
        }
        self.stage = Now::Before(self.plan.system(components));
        true
    }
}

fn failed(instance: &str, stage: Stage, source: ComponentError) -> MasterError {
    MasterError::Initialization {
        instance: instance.to_owned(),
        stage,
        source,
    }
}
