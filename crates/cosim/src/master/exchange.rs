//! The stepping loop's slaves and the values between them.

use super::crew::Crew;
use super::history::{Course, History, Outcome, Traits};
use super::stopwatch::Stopwatch;
use super::wired::{BEGIN, Failure, Reading, Values, Wired};
use super::{Ending, Look, Stage};
use crate::algorithms::{Algorithm, Coupling};
use crate::recorder::Signal;
use crate::report::Calls;
use crate::slave::{Conversion, Kind, Role, Value};
use crate::system::{Instance, System};
use std::collections::HashMap;

/// The slaves and the values between them. Nothing is allocated after it is made, but for strings.
pub(super) struct Exchange {
    pub(super) wired: Vec<Wired>,
    pub(super) values: Values,
    pub(super) signals: Vec<Signal>,
    pub(super) unrecorded: Vec<String>,
    /// Slots in the row of the real outputs that feed others. A position is one in this list.
    pub(super) fed: Vec<usize>,
    pub(super) history: History,
    /// How the fed outputs go within the step, by position.
    pub(super) courses: Vec<Course>,
    /// Their means over the last step, of those that were seen within it.
    pub(super) seen: Vec<Option<f64>>,
    /// Outputs that are no reals, at the begin of the step, and what the slaves are given for them.
    pub(super) others_before: Vec<Value>,
    pub(super) others_given: Vec<Value>,
}

impl Exchange {
    pub(super) fn new(system: System, coupling: &Coupling) -> Self {
        let mut exchange = Self {
            wired: Vec::new(),
            values: Values::default(),
            signals: Vec::new(),
            unrecorded: Vec::new(),
            fed: Vec::new(),
            history: History::default(),
            courses: Vec::new(),
            seen: Vec::new(),
            others_before: Vec::new(),
            others_given: Vec::new(),
        };
        // Slot of each output: in the row for reals, in `others` for the rest.
        let mut slots = HashMap::new();
        for (slave, instance) in system.instances.into_iter().enumerate() {
            exchange.add(slave, instance, &mut slots);
        }
        let (mut nominals, mut traits) = (Vec::new(), Vec::new());
        for connection in &system.connections {
            let Some(&slot) = slots.get(&(connection.from.slave, connection.from.variable)) else {
                continue;
            };
            let source = &exchange.wired[connection.from.slave];
            let output = &source.slave.variables()[connection.from.variable];
            let (nominal, is_discrete) = (output.nominal, output.is_discrete);
            let (from_handle, from) = (output.handle, output.kind);
            let target = &mut exchange.wired[connection.to.slave];
            let variable = &target.slave.variables()[connection.to.variable];
            let (handle, to) = (variable.handle, variable.kind);
            if from != Kind::Real || to != Kind::Real {
                let slot = match from == to {
                    true => slot,
                    false => exchange.convert(connection.from.slave, from_handle, from, to),
                };
                exchange.wired[connection.to.slave]
                    .other_inputs
                    .push((handle, slot));
                continue;
            }
            if connection.conversion != Conversion::NONE {
                let position = target.inputs.len();
                target.conversions.push((position, connection.conversion));
            }
            let known = exchange.fed.iter().position(|&fed| fed == slot);
            let position = known.unwrap_or_else(|| {
                exchange.fed.push(slot);
                nominals.push(nominal);
                traits.push(Traits {
                    has_slope: false,
                    is_discrete,
                });
                exchange.fed.len() - 1
            });
            target.inputs.push(handle);
            target.input_slots.push(slot);
            target.input_positions.push(position);
        }
        for slave in 0..exchange.wired.len() {
            let fed = system.connections.iter().filter(|c| c.to.slave == slave);
            let fed: Vec<usize> = fed.map(|c| c.to.variable).collect();
            exchange.wired[slave].finish(&fed, &exchange.fed, coupling);
        }
        let n = exchange.fed.len();
        for wired in exchange.wired.iter().filter(|w| !w.sloped.is_empty()) {
            for &p in &wired.fed_positions {
                traits[p].has_slope = !traits[p].is_discrete;
            }
        }
        exchange.history = History::new(nominals, traits);
        exchange.courses = vec![Course::default(); n];
        exchange.seen = vec![None; n];
        exchange.values.slopes = vec![0.0; n];
        exchange.others_before = exchange.values.others.clone();
        exchange.others_given = exchange.values.others.clone();
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
            parts,
            observed,
        } = instance;
        let first = self.values.row.len();
        let (mut outputs, mut other_outputs) = (Vec::new(), Vec::new());
        let is_read = |index, role| role == Role::Output || observed.contains(&index);
        let all = || {
            let variables = slave.variables().iter().enumerate();
            variables.filter(|(index, variable)| is_read(*index, variable.role))
        };
        for (index, variable) in all().filter(|(_, v)| v.kind == Kind::Real) {
            slots.insert((position, index), self.values.row.len());
            outputs.push(variable.handle);
            let unit = variable.unit.as_ref();
            self.add_signal(&name, &variable.name, unit.map_or("", |u| &u.name));
        }
        let output_slots = first..self.values.row.len();
        for (index, variable) in all().filter(|(_, v)| v.kind != Kind::Real) {
            let slot = self.values.others.len();
            slots.insert((position, index), slot);
            other_outputs.push(Reading {
                handle: variable.handle,
                kind: variable.kind,
                wanted: variable.kind,
                slot,
            });
            self.values.others.push(Value::Integer(0));
            if variable.kind == Kind::String {
                self.unrecorded.push(format!("{name}.{}", variable.name));
                self.values.other_slots.push(None);
            } else {
                self.values.other_slots.push(Some(self.values.row.len()));
                self.add_signal(&name, &variable.name, "");
            }
        }
        self.wired.push(Wired {
            name,
            abilities: slave.abilities(),
            slave,
            parts,
            outputs,
            output_slots,
            fed: Vec::new(),
            fed_positions: Vec::new(),
            changes: Vec::new(),
            sloped: Vec::new(),
            slope_values: Vec::new(),
            is_watchable: false,
            looked: Vec::new(),
            middle: Vec::new(),
            astray: Vec::new(),
            look_values: Vec::new(),
            settled: Vec::new(),
            settled_slots: Vec::new(),
            settled_values: Vec::new(),
            settled_others: Vec::new(),
            has_feedthrough: false,
            feeds_through: false,
            other_outputs,
            inputs: Vec::new(),
            input_slots: Vec::new(),
            input_positions: Vec::new(),
            input_values: Vec::new(),
            slopes: Vec::new(),
            used: Vec::new(),
            defects: Vec::new(),
            gathered: Vec::new(),
            errors: Vec::new(),
            conversions: Vec::new(),
            other_inputs: Vec::new(),
            calls: Calls::default(),
            watch: Stopwatch::default(),
            ended: None,
        });
    }

    /// Has an output read as a value of another type; its slot.
    fn convert(&mut self, slave: usize, handle: u32, kind: Kind, wanted: Kind) -> usize {
        let slot = self.values.others.len();
        self.values.others.push(Value::Integer(0));
        self.values.other_slots.push(None);
        self.wired[slave].other_outputs.push(Reading {
            handle,
            kind,
            wanted,
            slot,
        });
        slot
    }

    fn add_signal(&mut self, instance: &str, variable: &str, unit: &str) {
        self.values.row.push(f64::NAN);
        self.signals.push(Signal {
            name: format!("{instance}.{variable}"),
            unit: unit.to_owned(),
        });
    }

    pub(super) fn get_outputs(&mut self, i: usize) -> Result<(), Failure> {
        self.wired[i].get_outputs(&mut self.values)
    }

    /// A communication step from `t` by `h` in which every input is held at the newest value.
    pub(super) fn advance_held(
        &mut self,
        algorithm: Algorithm,
        order: &[usize],
        crew: Option<&mut Crew>,
        t: f64,
        h: f64,
    ) -> Result<(), Ending> {
        let failed = |failure: Failure| failure.at(t);
        let values = &mut self.values;
        if algorithm == Algorithm::GaussSeidel {
            for &i in order {
                let wired = &mut self.wired[i];
                wired.set_newest(values).map_err(failed)?;
                wired.step(t, h, false)?;
                wired.get_next_outputs(values).map_err(failed)?;
            }
            return Ok(());
        }
        for wired in &mut self.wired {
            wired.set_newest(values).map_err(failed)?;
        }
        match crew {
            Some(crew) => crew.step(&mut self.wired, t, h)?,
            None => (self.wired.iter_mut()).try_for_each(|wired| wired.step(t, h, false))?,
        }
        for wired in &mut self.wired {
            wired.get_next_outputs(values).map_err(failed)?;
        }
        Ok(())
    }

    /// A communication step from the history's last point by `h`, inputs extrapolated with that degree
    /// and, with Gauss-Seidel, interpolated where the next values are known.
    pub(super) fn advance(
        &mut self,
        algorithm: Algorithm,
        order: &[usize],
        degree: usize,
        h: f64,
        is_revocable: bool,
    ) -> Result<(), Ending> {
        let t = self.history.time();
        let failed = |failure: Failure| failure.at(t);
        self.extrapolate(degree, h);
        self.keep_others();
        for &i in order {
            let wired = &mut self.wired[i];
            let others = match algorithm {
                Algorithm::GaussSeidel => &self.values.others,
                _ => &self.others_before,
            };
            wired.set_others(others).map_err(failed)?;
            let (parts, span) = (wired.parts, (t, h));
            wired.travel(&mut self.values, &self.courses, span, parts, is_revocable)?;
            if algorithm == Algorithm::GaussSeidel {
                self.interpolate(i, degree, h);
            }
        }
        Ok(())
    }

    /// Continues all fed outputs by polynomials of that degree.
    pub(super) fn extrapolate(&mut self, degree: usize, h: f64) {
        for p in 0..self.fed.len() {
            self.courses[p] = self.history.extrapolated(p, degree, h);
        }
    }

    /// Interpolates the fed outputs of a slave that stands at the end of the step; with degree 0 the
    /// values at the end are held.
    pub(super) fn interpolate(&mut self, i: usize, degree: usize, h: f64) {
        for k in 0..self.wired[i].fed_positions.len() {
            let p = self.wired[i].fed_positions[k];
            let end = self.outcome(p);
            self.courses[p] = match degree {
                0 => Course::held(end.value),
                _ => self.history.interpolated(p, degree, h, end),
            };
        }
    }

    /// A fed output where its slave stands.
    pub(super) fn outcome(&self, p: usize) -> Outcome {
        self.values.outcome(&self.fed, p)
    }

    /// Reads the outputs of a slave that ended the run later than at `time`, the last point, and tells where it
    /// stands; `None` if it did not, or no longer gives them.
    pub(super) fn read_at_end(&mut self, ending: &Ending, time: f64) -> Option<f64> {
        let (Ending::EndRequested {
            instance,
            time: reached,
        }
        | Ending::Discarded {
            instance, reached, ..
        }) = ending
        else {
            return None;
        };
        let slave = self.wired.iter().position(|w| w.name == *instance)?;
        (*reached > time && self.get_outputs(slave).is_ok()).then_some(*reached)
    }

    /// Gives every slave its inputs and shows it.
    pub(super) fn look(&mut self, look: Look) -> Result<(), Failure> {
        for i in 0..self.wired.len() {
            let wired = &mut self.wired[i];
            wired.set_newest(&self.values)?;
            let seen = look(wired.slave.as_mut());
            seen.map_err(|source| wired.failure(Stage::Linearize, source))?;
        }
        Ok(())
    }

    /// Keeps the outputs that are no reals, as they are at the begin of a step.
    pub(super) fn keep_others(&mut self) {
        self.others_before.clone_from_slice(&self.values.others);
        self.others_given.clone_from_slice(&self.values.others);
    }

    /// Saves the state of all slaves that can.
    pub(super) fn save(&mut self) -> Result<(), Failure> {
        let mut able = self.wired.iter_mut().filter(|w| w.abilities.rollback);
        able.try_for_each(|wired| wired.save(BEGIN))
    }

    /// Goes back to the begin of the step.
    pub(super) fn restore(&mut self) -> Result<(), Failure> {
        self.values.others.clone_from_slice(&self.others_before);
        let mut able = self.wired.iter_mut().filter(|w| w.abilities.rollback);
        able.try_for_each(|wired| wired.restore(BEGIN))
    }

    /// Takes the values in the row for those of a communication point.
    pub(super) fn keep(&mut self, time: f64) {
        let (row, slopes) = (&self.values.row, &self.values.slopes);
        let points = self.fed.iter().zip(slopes);
        let points = points.map(|(&slot, &slope)| Outcome {
            value: row[slot],
            slope,
        });
        self.history.push(time, points);
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
