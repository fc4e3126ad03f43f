//! A slave with what it exchanges.

use super::change::Change;
use super::history::Outcome;
use super::stopwatch::Stopwatch;
use super::{Ending, MasterError, Stage};
use crate::algorithms::{Algorithm, Coupling};
use crate::report::{Calls, CouplingError};
use crate::slave::{Abilities, Conversion, Kind, Progress, Role, Slave, SlaveError, Value};
use std::ops::Range;

/// Where states are saved: at the begin of a communication step, before the last part of it, and at
/// its end.
pub(super) const BEGIN: usize = 0;
pub(super) const LAST_PART: usize = 1;
pub(super) const END: usize = 2;

/// How far a time that a slave tells may be off, relative to the step.
const TIME_TOLERANCE: f64 = 1e-9;

/// What is written where slaves are read.
#[derive(Debug, Default)]
pub(super) struct Values {
    /// The recorded values: of each slave the reals, then integers, enumerations and booleans.
    pub(super) row: Vec<f64>,
    /// Outputs that are no reals, and their slots in the row; strings have none.
    pub(super) others: Vec<Value>,
    pub(super) other_slots: Vec<Option<usize>>,
    /// Time derivatives of the fed outputs, where they are wanted and known.
    pub(super) slopes: Vec<f64>,
}

/// An output that is read by itself.
pub(super) struct Reading {
    pub(super) handle: u32,
    pub(super) kind: Kind,
    /// Type that it is wanted in.
    pub(super) wanted: Kind,
    /// Slot in [`Values::others`].
    pub(super) slot: usize,
}

/// A slave with what it exchanges, so that each step needs one call for all its reals.
pub(super) struct Wired {
    pub(super) name: String,
    pub(super) slave: Box<dyn Slave>,
    pub(super) abilities: Abilities,
    /// Parts that it takes each communication step in.
    pub(super) parts: u32,
    /// Handles of all real outputs, and where they go in the row.
    pub(super) outputs: Vec<u32>,
    pub(super) output_slots: Range<usize>,
    /// Slots of those that feed others, and their positions among all fed outputs.
    pub(super) fed: Vec<usize>,
    pub(super) fed_positions: Vec<usize>,
    /// Their slots again, and how they change between communication points.
    pub(super) changes: Vec<(usize, Change)>,
    /// Handles of these, if their derivatives are to be read too, and room for them.
    pub(super) sloped: Vec<u32>,
    pub(super) slope_values: Vec<f64>,
    /// Whether they can be seen within a step; what was seen of them last, in the middle, and where else they
    /// were others than there.
    pub(super) is_watchable: bool,
    pub(super) looked: Vec<Outcome>,
    pub(super) middle: Vec<Outcome>,
    pub(super) astray: Vec<Option<(f64, Outcome)>>,
    pub(super) look_values: Vec<f64>,
    /// Handles and slots of the real outputs without direct feedthrough from a fed input; and which of the
    /// other outputs have none.
    pub(super) settled: Vec<u32>,
    pub(super) settled_slots: Vec<usize>,
    pub(super) settled_values: Vec<f64>,
    pub(super) settled_others: Vec<usize>,
    /// Whether an output, or a fed one, has direct feedthrough from a fed input.
    pub(super) has_feedthrough: bool,
    pub(super) feeds_through: bool,
    /// All other outputs, and those that feed inputs of another type.
    pub(super) other_outputs: Vec<Reading>,
    /// Handles of the real inputs that are fed, the row's slots and the positions among all fed
    /// outputs that feed them, and room for values and slopes.
    pub(super) inputs: Vec<u32>,
    pub(super) input_slots: Vec<usize>,
    pub(super) input_positions: Vec<usize>,
    pub(super) input_values: Vec<f64>,
    pub(super) slopes: Vec<f64>,
    /// Means over the last step of what the inputs were given, in the outputs' units.
    pub(super) used: Vec<f64>,
    /// By how much each of these means is wrong.
    pub(super) defects: Vec<Defect>,
    /// Integral of the error of each of these means since the last point of the clock.
    pub(super) gathered: Vec<f64>,
    /// Integral of the magnitude, and largest magnitude over a step of the clock, of the error of each of these means, where inputs
    /// are not just held.
    pub(super) errors: Vec<CouplingError>,
    /// Which of the values come in another unit.
    pub(super) conversions: Vec<(usize, Conversion)>,
    /// Handles of the other inputs that are fed, and slots in `others`.
    pub(super) other_inputs: Vec<(u32, usize)>,
    pub(super) calls: Calls,
    pub(super) watch: Stopwatch,
    /// How its last step ended, if not well, where others stepped at the same time.
    pub(super) ended: Option<Ending>,
}

/// By how much the mean of an input over a step is wrong.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Defect {
    /// As well as it is known; with a sign if it was seen.
    pub(super) size: f64,
    /// With what it may be beside that, for steps that are to be short enough.
    pub(super) careful: f64,
    /// If the output was seen within the step, that; else 0.
    pub(super) seen: f64,
    /// If it was not, what it may be where slopes are no guide; else 0.
    pub(super) unseen: f64,
}

/// A failed call.
pub(super) struct Failure {
    pub(super) instance: String,
    pub(super) stage: Stage,
    pub(super) source: SlaveError,
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

impl Wired {
    /// Completes what follows from the wires: `fed_inputs` are positions of variables, `fed` the slots
    /// of all outputs that feed others.
    pub(super) fn finish(&mut self, fed_inputs: &[usize], fed: &[usize], coupling: &Coupling) {
        let n = self.inputs.len();
        self.input_values = vec![0.0; n];
        self.slopes = vec![0.0; n];
        self.used = vec![0.0; n];
        self.defects = vec![Defect::default(); n];
        self.gathered = vec![0.0; n];
        self.errors = vec![CouplingError::default(); n];
        for (position, slot) in fed.iter().enumerate() {
            if self.output_slots.contains(slot) {
                self.fed.push(*slot);
                self.fed_positions.push(position);
            }
        }
        let unchanged = self.fed.iter().map(|&slot| (slot, Change::default()));
        self.changes = unchanged.collect();
        let is_direct = |handle: u32, kind: Kind| {
            let mut variables = self.slave.variables().iter();
            variables
                .find(|v| v.handle == handle && v.role == Role::Output && v.kind == kind)
                .is_some_and(|v| v.feedthrough.iter().any(|input| fed_inputs.contains(input)))
        };
        for (k, reading) in self.other_outputs.iter().enumerate() {
            match is_direct(reading.handle, reading.kind) {
                true => self.has_feedthrough = true,
                false => self.settled_others.push(k),
            }
        }
        for (handle, slot) in self.outputs.iter().zip(self.output_slots.clone()) {
            if is_direct(*handle, Kind::Real) {
                self.has_feedthrough = true;
                self.feeds_through |= self.fed.contains(&slot);
            } else {
                self.settled.push(*handle);
                self.settled_slots.push(slot);
            }
        }
        self.settled_values = vec![0.0; self.settled.len()];
        let is_strong = coupling.algorithm == Algorithm::Strong;
        if is_strong && self.abilities.output_derivatives {
            let handle = |slot: &usize| self.outputs[slot - self.output_slots.start];
            self.sloped = self.fed.iter().map(handle).collect();
            self.slope_values = vec![0.0; self.sloped.len()];
            self.look_values = vec![0.0; self.sloped.len()];
            self.looked = vec![Outcome::default(); self.sloped.len()];
            self.middle = self.looked.clone();
            self.astray = vec![None; self.sloped.len()];
            self.is_watchable = self.can_be_watched();
        }
        if is_strong && coupling.control.is_some() && self.has_stairs() {
            self.parts *= 2;
        }
    }

    /// Whether inputs that change within a step become staircases.
    pub(super) fn has_stairs(&self) -> bool {
        !self.inputs.is_empty() && !self.abilities.input_derivatives && self.abilities.rollback
    }

    /// Whether its outputs within a step are what they are where a shorter step ends there: it takes such steps, and
    /// follows lines, of which its outputs show no more than its states do.
    fn can_be_watched(&self) -> bool {
        let follows = self.inputs.is_empty() || self.abilities.input_derivatives;
        let can_go_there = self.abilities.rollback && self.abilities.variable_steps;
        can_go_there && follows && self.parts == 1 && !self.feeds_through && !self.fed.is_empty()
    }

    /// Whether, of inputs that change within a step, it is given the values at the end: its outputs have
    /// direct feedthrough, and no second step can tell these apart from its state.
    pub(super) fn is_given_ends(&self) -> bool {
        !self.abilities.input_derivatives && self.feeds_through && !self.abilities.rollback
    }

    #[cold]
    #[inline(never)]
    pub(super) fn failure(&self, stage: Stage, source: SlaveError) -> Failure {
        Failure {
            instance: self.name.clone(),
            stage,
            source,
        }
    }

    /// That what an input got in the step from `t` by `h` [s] is nonsense, and no shorter step helps.
    #[cold]
    pub(super) fn misled(&self, input: usize, t: f64, h: f64) -> Ending {
        let mut variables = self.slave.variables().iter();
        let variable = variables.find(|v| v.handle == self.inputs[input] && v.kind == Kind::Real);
        let name = variable.map_or("an input", |v| v.name.as_str());
        let source = format!(
            "in a step of {h} s, what is known of `{name}` between the ends of the step is wrong by as much as \
             its value: it changes too fast for strong coupling; take a shorter --step, or another --algorithm"
        );
        self.failure(Stage::SetInputs, source.into()).at(t)
    }

    /// Gives the inputs the values in the row.
    #[inline(always)]
    pub(super) fn set_newest(&mut self, values: &Values) -> Result<(), Failure> {
        for (value, &slot) in self.input_values.iter_mut().zip(&self.input_slots) {
            *value = values.row[slot];
        }
        // In this order: what is set along lines refers to the call that comes last.
        self.set_others(&values.others)?;
        self.set_reals()
    }

    /// Gives the inputs that are no reals their values.
    #[inline]
    pub(super) fn set_others(&mut self, others: &[Value]) -> Result<(), Failure> {
        match self.other_inputs.is_empty() {
            true => Ok(()),
            false => self.set_each_other(others),
        }
    }

    fn set_each_other(&mut self, others: &[Value]) -> Result<(), Failure> {
        for k in 0..self.other_inputs.len() {
            let (handle, slot) = self.other_inputs[k];
            self.calls.sets += 1;
            let set = self.watch.time(|| self.slave.set(handle, &others[slot]));
            set.map_err(|source| self.failure(Stage::SetInputs, source))?;
        }
        Ok(())
    }

    /// Converts `input_values` and sets them.
    #[inline(always)]
    pub(super) fn set_reals(&mut self) -> Result<(), Failure> {
        if self.inputs.is_empty() {
            return Ok(());
        }
        if !self.conversions.is_empty() {
            self.convert();
        }
        self.calls.sets += 1;
        let (inputs, values) = (&self.inputs, &self.input_values);
        let set = self.watch.time(|| self.slave.set_reals(inputs, values));
        set.map_err(|source| self.failure(Stage::SetInputs, source))
    }

    #[inline(never)]
    fn convert(&mut self) {
        for &(position, conversion) in &self.conversions {
            let value = &mut self.input_values[position];
            *value = conversion.apply(*value);
        }
    }

    /// Reads all outputs.
    pub(super) fn get_outputs(&mut self, values: &mut Values) -> Result<(), Failure> {
        self.read_outputs(values)?;
        self.check_finite(values)
    }

    /// Reads all outputs at a communication point and follows how they change.
    #[inline(always)]
    pub(super) fn get_next_outputs(&mut self, values: &mut Values) -> Result<(), Failure> {
        self.read_outputs(values)?;
        self.follow(values, self.calls.steps)
    }

    /// The outputs before the first step.
    pub(super) fn begin_changes(&mut self, values: &Values) {
        for (slot, change) in &mut self.changes {
            *change = Change::from(values.row[*slot]);
        }
    }

    /// Follows how the fed outputs change, to those after a step of that number.
    #[inline(always)]
    pub(super) fn follow(&mut self, values: &Values, step: u64) -> Result<(), Failure> {
        let mut is_finite = true;
        for (slot, change) in &mut self.changes {
            is_finite &= change.to(values.row[*slot], step);
        }
        match is_finite {
            true => Ok(()),
            false => self.check_finite(values),
        }
    }

    #[inline(always)]
    fn read_outputs(&mut self, values: &mut Values) -> Result<(), Failure> {
        if !self.outputs.is_empty() {
            self.calls.gets += 1;
            let (outputs, row) = (&self.outputs, &mut values.row[self.output_slots.clone()]);
            let got = self.watch.time(|| self.slave.get_reals(outputs, row));
            got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        }
        self.get_slopes(values)?;
        self.get_others(values)
    }

    /// Reads the derivatives of the fed outputs.
    #[inline]
    fn get_slopes(&mut self, values: &mut Values) -> Result<(), Failure> {
        match self.sloped.is_empty() {
            true => Ok(()),
            false => self.get_each_slope(values),
        }
    }

    fn get_each_slope(&mut self, values: &mut Values) -> Result<(), Failure> {
        self.calls.gets += 1;
        let (handles, room) = (&self.sloped, &mut self.slope_values);
        let got = self
            .watch
            .time(|| self.slave.get_output_derivatives(handles, room));
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        for (&p, &slope) in self.fed_positions.iter().zip(&self.slope_values) {
            values.slopes[p] = slope;
        }
        Ok(())
    }

    /// Reads the fed outputs and their derivatives, for nobody but the master.
    pub(super) fn look(&mut self) -> Result<(), Failure> {
        self.calls.gets += 2;
        let (handles, values, slopes) =
            (&self.sloped, &mut self.look_values, &mut self.slope_values);
        let slave = &mut self.slave;
        let got = self.watch.time(|| {
            slave.get_reals(handles, values)?;
            slave.get_output_derivatives(handles, slopes)
        });
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        let pairs = self.look_values.iter().zip(&self.slope_values);
        for (looked, (&value, &slope)) in self.looked.iter_mut().zip(pairs) {
            *looked = Outcome { value, slope };
        }
        Ok(())
    }

    /// Reads the outputs that are no reals.
    #[inline]
    pub(super) fn get_others(&mut self, values: &mut Values) -> Result<(), Failure> {
        match self.other_outputs.is_empty() {
            true => Ok(()),
            false => self.get_each_other(values),
        }
    }

    fn get_each_other(&mut self, values: &mut Values) -> Result<(), Failure> {
        (0..self.other_outputs.len()).try_for_each(|k| self.get_other(k, values))
    }

    fn get_other(&mut self, k: usize, values: &mut Values) -> Result<(), Failure> {
        let Reading {
            handle,
            kind,
            wanted,
            slot,
        } = self.other_outputs[k];
        self.calls.gets += 1;
        let got = self.watch.time(|| self.slave.get(handle, kind));
        let value = got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        let converted = value.converted(wanted);
        values.others[slot] = converted.map_err(|why| self.not_whole(handle, &why))?;
        if let Some(column) = values.other_slots[slot] {
            values.row[column] = values.others[slot].as_number();
        }
        Ok(())
    }

    /// Reads the outputs without direct feedthrough.
    pub(super) fn get_settled(&mut self, values: &mut Values) -> Result<(), Failure> {
        for k in 0..self.settled_others.len() {
            self.get_other(self.settled_others[k], values)?;
        }
        if self.settled.is_empty() {
            return Ok(());
        }
        self.calls.gets += 1;
        let (handles, room) = (&self.settled, &mut self.settled_values);
        let got = self.watch.time(|| self.slave.get_reals(handles, room));
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        for (&slot, &value) in self.settled_slots.iter().zip(&self.settled_values) {
            values.row[slot] = value;
        }
        self.check_finite(values)
    }

    /// An output that is not finite must not feed others: it would be theirs from then on, and nobody
    /// would know whose it was.
    fn check_finite(&self, values: &Values) -> Result<(), Failure> {
        match self.fed.iter().find(|&&slot| !values.row[slot].is_finite()) {
            None => Ok(()),
            Some(&slot) => Err(self.not_finite(slot, values.row[slot])),
        }
    }

    #[cold]
    fn not_whole(&self, handle: u32, why: &SlaveError) -> Failure {
        let source = format!("`{}` feeds an Integer, but {why}", self.real_output(handle));
        self.failure(Stage::GetOutputs, source.into())
    }

    #[cold]
    fn not_finite(&self, slot: usize, value: f64) -> Failure {
        let handle = self.outputs[slot - self.output_slots.start];
        let name = self.real_output(handle);
        let source = format!("`{name}` is {value} and feeds others");
        self.failure(Stage::GetOutputs, source.into())
    }

    /// Name of the real output of that handle.
    fn real_output(&self, handle: u32) -> &str {
        let mut variables = self.slave.variables().iter();
        let variable = variables.find(|v| v.handle == handle && v.kind == Kind::Real);
        variable.map_or("an output", |v| v.name.as_str())
    }

    /// Takes a step with the inputs that are set.
    #[inline(always)]
    pub(super) fn step(&mut self, t: f64, h: f64, is_revocable: bool) -> Result<(), Ending> {
        self.calls.steps += 1;
        let stepped = self.watch.time(|| match is_revocable {
            false => self.slave.step(t, h),
            true => self.slave.step_revocably(t, h),
        });
        match stepped {
            Ok(Progress::Done) => Ok(()),
            other => Err(self.ending(other, t, h)),
        }
    }

    #[cold]
    fn ending(&self, stepped: Result<Progress, SlaveError>, t: f64, h: f64) -> Ending {
        let slack = TIME_TOLERANCE * h.max(t.abs());
        let is_within = |reached: f64| (t - slack..=t + h + slack).contains(&reached);
        let instance = self.name.clone();
        match stepped {
            Ok(Progress::Discarded { reached } | Progress::EndRequested { reached })
                if !is_within(reached) =>
            {
                let end = t + h;
                let source = format!(
                    "it says that it stands at {reached} s, outside the step from {t} s to {end} s"
                );
                self.failure(Stage::Step, source.into()).at(t)
            }
            Ok(Progress::EndRequested { reached }) => Ending::EndRequested {
                instance,
                time: reached,
            },
            Ok(Progress::Discarded { reached }) => Ending::Discarded {
                instance,
                time: t,
                reached,
            },
            // Done is no ending; the caller has sorted it out.
            Ok(Progress::Done) => Ending::Completed,
            Err(source) => self.failure(Stage::Step, source).at(t),
        }
    }

    pub(super) fn save(&mut self, place: usize) -> Result<(), Failure> {
        self.calls.saves += 1;
        let saved = self.watch.time(|| self.slave.save(place));
        saved.map_err(|source| self.failure(Stage::Save, source))
    }

    pub(super) fn restore(&mut self, place: usize) -> Result<(), Failure> {
        self.calls.restores += 1;
        let restored = self.watch.time(|| self.slave.restore(place));
        restored.map_err(|source| self.failure(Stage::Restore, source))
    }
}
