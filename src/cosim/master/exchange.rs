//! The stepping loop's slaves and the values between them.

use super::{Ending, Look, MasterError, Stage};
use crate::cosim::algorithms::Algorithm;
use crate::cosim::recorder::Signal;
use crate::cosim::slave::{Conversion, Kind, Progress, Role, Slave, SlaveError, Value};
use crate::cosim::system::{Instance, System};
use std::collections::HashMap;
use std::ops::Range;

/// A slave with what it exchanges, so that each step needs one call for all its reals.
pub(super) struct Wired {
    pub(super) name: String,
    slave: Box<dyn Slave>,
    /// Handles of all real outputs, and where they go in the row.
    outputs: Vec<u32>,
    output_slots: Range<usize>,
    /// Handles of all other outputs, with slots in `others`.
    other_outputs: Vec<(u32, Kind, usize)>,
    /// Handles of the real inputs that are fed, the row's slots that feed them, and room for values.
    inputs: Vec<u32>,
    input_slots: Vec<usize>,
    input_values: Vec<f64>,
    /// Which of these values come in another unit.
    conversions: Vec<(usize, Conversion)>,
    /// Handles of the other inputs that are fed, and slots in `others`.
    other_inputs: Vec<(u32, usize)>,
}

/// The slaves and the values between them. Nothing is allocated after it is made, but for strings.
pub(super) struct Exchange {
    pub(super) wired: Vec<Wired>,
    /// The recorded values: of each slave the reals, then integers, enumerations and booleans.
    pub(super) row: Vec<f64>,
    pub(super) signals: Vec<Signal>,
    /// Outputs that are no reals, and their slots in the row; strings have none.
    others: Vec<Value>,
    other_slots: Vec<Option<usize>>,
    pub(super) unrecorded: Vec<String>,
}

/// A failed call.
pub(super) struct Failure {
    instance: String,
    stage: Stage,
    source: SlaveError,
}

impl Failure {
    pub(super) fn at_start(self) -> MasterError {
        MasterError::Initialization {
            instance: self.instance,
            stage: self.stage,
            source: self.source,
        }
    }

    pub(super) fn at(self, time: f64) -> Ending {
        Ending::Failed {
            instance: self.instance,
            time,
            stage: self.stage,
            source: self.source,
        }
    }
}

impl Exchange {
    pub(super) fn new(system: System) -> Self {
        let mut exchange = Self {
            wired: Vec::new(),
            row: Vec::new(),
            signals: Vec::new(),
            others: Vec::new(),
            other_slots: Vec::new(),
            unrecorded: Vec::new(),
        };
        // Slot of each output: in the row for reals, in `others` for the rest.
        let mut slots = HashMap::new();
        for (slave, instance) in system.instances.into_iter().enumerate() {
            exchange.add(slave, instance, &mut slots);
        }
        for connection in &system.connections {
            let target = &mut exchange.wired[connection.to.slave];
            let variable = &target.slave.variables()[connection.to.variable];
            let Some(&slot) = slots.get(&(connection.from.slave, connection.from.variable)) else {
                continue;
            };
            match variable.kind {
                Kind::Real => {
                    if connection.conversion != Conversion::NONE {
                        let position = target.inputs.len();
                        target.conversions.push((position, connection.conversion));
                    }
                    target.inputs.push(variable.handle);
                    target.input_slots.push(slot);
                    target.input_values.push(0.0);
                }
                _ => target.other_inputs.push((variable.handle, slot)),
            }
        }
        exchange
    }

    /// Takes in a slave; gives each of its outputs, and what else is to be recorded, a slot.
    fn add(
        &mut self,
        position: usize,
        instance: Instance,
        slots: &mut HashMap<(usize, usize), usize>,
    ) {
        let Instance {
            name,
            slave,
            observed,
        } = instance;
        let first = self.row.len();
        let (mut outputs, mut other_outputs) = (Vec::new(), Vec::new());
        let is_read = |index, role| role == Role::Output || observed.contains(&index);
        let all = || {
            let variables = slave.variables().iter().enumerate();
            variables.filter(|(index, variable)| is_read(*index, variable.role))
        };
        for (index, variable) in all().filter(|(_, v)| v.kind == Kind::Real) {
            slots.insert((position, index), self.row.len());
            outputs.push(variable.handle);
            let unit = variable.unit.as_ref();
            self.add_signal(&name, &variable.name, unit.map_or("", |u| &u.name));
        }
        let output_slots = first..self.row.len();
        for (index, variable) in all().filter(|(_, v)| v.kind != Kind::Real) {
            let slot = self.others.len();
            slots.insert((position, index), slot);
            other_outputs.push((variable.handle, variable.kind, slot));
            self.others.push(Value::Integer(0));
            if variable.kind == Kind::String {
                self.unrecorded.push(format!("{name}.{}", variable.name));
                self.other_slots.push(None);
            } else {
                self.other_slots.push(Some(self.row.len()));
                self.add_signal(&name, &variable.name, "");
            }
        }
        self.wired.push(Wired {
            name,
            slave,
            outputs,
            output_slots,
            other_outputs,
            inputs: Vec::new(),
            input_slots: Vec::new(),
            input_values: Vec::new(),
            conversions: Vec::new(),
            other_inputs: Vec::new(),
        });
    }

    fn add_signal(&mut self, instance: &str, variable: &str, unit: &str) {
        self.row.push(f64::NAN);
        self.signals.push(Signal {
            name: format!("{instance}.{variable}"),
            unit: unit.to_owned(),
        });
    }

    /// One communication step from `t` by `h`.
    pub(super) fn advance(
        &mut self,
        algorithm: Algorithm,
        order: &[usize],
        t: f64,
        h: f64,
    ) -> Result<(), Ending> {
        let failed = |failure: Failure| failure.at(t);
        match algorithm {
            Algorithm::Jacobi => {
                for &i in order {
                    self.set_inputs(i).map_err(failed)?;
                }
                for &i in order {
                    self.step(i, t, h)?;
                }
                for &i in order {
                    self.get_outputs(i).map_err(failed)?;
                }
            }
            Algorithm::GaussSeidel => {
                for &i in order {
                    self.set_inputs(i).map_err(failed)?;
                    self.step(i, t, h)?;
                    self.get_outputs(i).map_err(failed)?;
                }
            }
        }
        Ok(())
    }

    fn set_inputs(&mut self, i: usize) -> Result<(), Failure> {
        let wired = &mut self.wired[i];
        for (value, &slot) in wired.input_values.iter_mut().zip(&wired.input_slots) {
            *value = self.row[slot];
        }
        for &(position, conversion) in &wired.conversions {
            let value = &mut wired.input_values[position];
            *value = conversion.apply(*value);
        }
        let mut result = Ok(());
        if !wired.inputs.is_empty() {
            result = wired.slave.set_reals(&wired.inputs, &wired.input_values);
        }
        for &(handle, slot) in &wired.other_inputs {
            result = result.and_then(|()| wired.slave.set(handle, &self.others[slot]));
        }
        result.map_err(|source| wired.failure(Stage::SetInputs, source))
    }

    pub(super) fn get_outputs(&mut self, i: usize) -> Result<(), Failure> {
        let wired = &mut self.wired[i];
        let mut result = Ok(());
        if !wired.outputs.is_empty() {
            let values = &mut self.row[wired.output_slots.clone()];
            result = wired.slave.get_reals(&wired.outputs, values);
        }
        for &(handle, kind, slot) in &wired.other_outputs {
            result = result.and_then(|()| {
                self.others[slot] = wired.slave.get(handle, kind)?;
                if let Some(column) = self.other_slots[slot] {
                    self.row[column] = self.others[slot].as_number();
                }
                Ok(())
            });
        }
        result.map_err(|source| wired.failure(Stage::GetOutputs, source))
    }

    fn step(&mut self, i: usize, t: f64, h: f64) -> Result<(), Ending> {
        let wired = &mut self.wired[i];
        let instance = || wired.name.clone();
        match wired.slave.step(t, h) {
            Ok(Progress::Done) => Ok(()),
            Ok(Progress::Discarded { reached }) => Err(Ending::Discarded {
                instance: instance(),
                time: t,
                reached,
            }),
            Ok(Progress::EndRequested { reached }) => Err(Ending::EndRequested {
                instance: instance(),
                time: reached,
            }),
            Err(source) => Err(wired.failure(Stage::Step, source).at(t)),
        }
    }

    /// Gives every slave its inputs and shows it.
    pub(super) fn look(&mut self, look: Look) -> Result<(), Failure> {
        for i in 0..self.wired.len() {
            self.set_inputs(i)?;
            let wired = &mut self.wired[i];
            let seen = look(wired.slave.as_mut());
            seen.map_err(|source| wired.failure(Stage::Linearize, source))?;
        }
        Ok(())
    }

    /// Terminates the slaves that still can be, and says how the run ended at `time`.
    pub(super) fn end(&mut self, stopped: Option<Ending>, time: f64) -> Ending {
        let culprit = match &stopped {
            Some(Ending::Discarded { instance, .. } | Ending::Failed { instance, .. }) => instance,
            _ => "",
        };
        let mut failure = None;
        for wired in self.wired.iter_mut().filter(|w| w.name != culprit) {
            if let Err(source) = wired.slave.terminate() {
                failure.get_or_insert(wired.failure(Stage::Terminate, source));
            }
        }
        match (stopped, failure) {
            (Some(ending), _) => ending,
            (None, Some(failure)) => failure.at(time),
            (None, None) => Ending::Completed,
        }
    }
}

impl Wired {
    fn failure(&self, stage: Stage, source: SlaveError) -> Failure {
        Failure {
            instance: self.name.clone(),
            stage,
            source,
        }
    }
}
