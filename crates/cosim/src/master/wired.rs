//! A component with its exchanged values.

use super::change::Change;
use super::history::Outcome;
use super::stopwatch::Stopwatch;
use super::wires::{Inputs, Outputs, Reading, Within};
use super::{Ending, MasterError, Stage};
use crate::algorithms::{Algorithm, Coupling};
use crate::component::{Abilities, Component, ComponentError, Progress, Value, ValueKind};
use crate::report::Calls;

/// Slots of saved states: at the beginning of a communication step, before its last part, and at its end.
pub(super) const BEGIN: usize = 0;
pub(super) const LAST_PART: usize = 1;
pub(super) const END: usize = 2;

/// Tolerance for times reported by a component, relative to the step.
const TIME_TOLERANCE: f64 = 1e-9;

/// Values read from components.
#[derive(Debug, Default)]
pub(super) struct Values {
    /// The recorded values: for each component the reals, then integers, enumerations and booleans.
    pub(super) row: Vec<f64>,
    /// Non-real outputs and their slots in the row; strings have none.
    pub(super) others: Vec<Value>,
    pub(super) other_slots: Vec<Option<usize>>,
    /// Time derivatives of the fed outputs, if used and available.
    pub(super) slopes: Vec<f64>,
    /// Fed outputs whose derivatives turned out to be none.
    pub(super) lost_slopes: Vec<usize>,
}

/// A component with its exchanged values, arranged so that each step needs one call for all reals.
pub(super) struct Wired {
    pub(super) name: String,
    pub(super) component: Box<dyn Component>,
    pub(super) abilities: Abilities,
    /// Number of parts into which it divides each communication step.
    pub(super) parts: u32,
    /// Whether its outputs are read with the inputs of the same time.
    pub(super) at_once: bool,
    pub(super) inputs: Inputs,
    pub(super) outputs: Outputs,
    pub(super) within: Within,
    pub(super) calls: Calls,
    pub(super) watch: Stopwatch,
    /// Why its last step failed, if it did, when components step concurrently.
    pub(super) ended: Option<Ending>,
}

/// A failed call.
pub(super) struct Failure {
    pub(super) instance: String,
    pub(super) stage: Stage,
    pub(super) source: ComponentError,
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
    /// `parts`: number of parts per communication step, as chosen by the user.
    pub(super) fn new(
        name: String,
        component: Box<dyn Component>,
        parts: u32,
        at_once: bool,
        inputs: Inputs,
        outputs: Outputs,
        coupling: &Coupling,
    ) -> Self {
        let abilities = component.abilities();
        let is_strong = coupling.algorithm == Algorithm::Strong;
        let reads_slopes = is_strong && abilities.output_derivatives;
        let within = Within::new(&inputs, &outputs, reads_slopes, abilities, parts);
        let is_halved =
            is_strong && coupling.control.is_some() && inputs.have_hold_error(abilities);
        Self {
            name,
            component,
            abilities,
            parts: if is_halved { 2 * parts } else { parts },
            at_once,
            inputs,
            outputs,
            within,
            calls: Calls::default(),
            watch: Stopwatch::default(),
            ended: None,
        }
    }

    /// Whether inputs that change within a step are held piecewise.
    pub(super) fn has_hold_error(&self) -> bool {
        self.inputs.have_hold_error(self.abilities)
    }

    /// Whether inputs that change within a step are given their values at the end: outputs have direct feedthrough, and
    /// without rollback and steps of any length nothing can separate them from the state.
    pub(super) fn is_given_ends(&self) -> bool {
        let can_separate = self.abilities.rollback || self.abilities.variable_steps;
        !self.abilities.input_derivatives && self.outputs.feeds_through && !can_separate
    }

    #[cold]
    #[inline(never)]
    pub(super) fn failure(&self, stage: Stage, source: ComponentError) -> Failure {
        Failure {
            instance: self.name.clone(),
            stage,
            source,
        }
    }

    /// Error: an input was meaningless in the step from `t` by `h` [s], and no shorter step helps.
    #[cold]
    pub(super) fn misled(&self, input: usize, t: f64, h: f64) -> Ending {
        let mut variables = self.component.variables().iter();
        let variable =
            variables.find(|v| v.handle == self.inputs.handles[input] && v.kind == ValueKind::Real);
        let name = variable.map_or("an input", |v| v.name.as_str());
        let source = format!(
            "in a step of {h} s, what is known of `{name}` between the ends of the step is wrong by as much as \
             its value: it changes too fast for strong coupling; take a shorter --step, or another --algorithm"
        );
        self.failure(Stage::SetInputs, source.into()).at(t)
    }

    /// Error: the corrections do not converge however short the steps to `t`, the last by `h` [s].
    #[cold]
    pub(super) fn diverged(&self, t: f64, h: f64) -> Ending {
        let source = format!(
            "the corrections of strong coupling do not converge, even in steps of {h:.1e} s: is there a loop of outputs that \
             depend on inputs at once, without a solution or with several? Set --min-step to go on with a warning, or put a lag \
             into the loop"
        );
        self.failure(Stage::SetInputs, source.into()).at(t)
    }

    /// Error: the errors stay as large as the tolerance however short the steps to `t`, the last by `h` [s].
    #[cold]
    pub(super) fn uncontrolled(&self, t: f64, h: f64) -> Ending {
        let source = format!(
            "errors stay as large as the tolerance, even in steps of {h:.1e} s: a loop of outputs that depend on inputs at once \
             does not settle so, or values without a nominal value grow far beyond 1 within the first step of the clock; take \
             --algorithm strong, no --extrapolation, a larger --tolerance, or a --min-step to go on with a warning"
        );
        self.failure(Stage::SetInputs, source.into()).at(t)
    }

    /// Sets the inputs to the values in the row.
    #[inline(always)]
    pub(super) fn set_newest(&mut self, values: &Values) -> Result<(), Failure> {
        for (value, &slot) in self.inputs.values.iter_mut().zip(&self.inputs.slots) {
            *value = values.row[slot];
        }
        // The order matters: input derivatives refer to the last call.
        self.set_others(&values.others)?;
        self.set_reals()
    }

    /// Sets the non-real inputs.
    #[inline]
    pub(super) fn set_others(&mut self, others: &[Value]) -> Result<(), Failure> {
        match self.inputs.others.is_empty() {
            true => Ok(()),
            false => self.set_each_other(others),
        }
    }

    fn set_each_other(&mut self, others: &[Value]) -> Result<(), Failure> {
        for k in 0..self.inputs.others.len() {
            let (handle, slot) = self.inputs.others[k];
            self.calls.sets += 1;
            let set = self
                .watch
                .time(|| self.component.set(handle, &others[slot]));
            set.map_err(|why| self.lost(Stage::SetInputs, &self.inputs.other_names[k], &why))?;
        }
        Ok(())
    }

    /// Converts `inputs.values` and sets them.
    #[inline(always)]
    pub(super) fn set_reals(&mut self) -> Result<(), Failure> {
        if self.inputs.handles.is_empty() {
            return Ok(());
        }
        if !self.inputs.conversions.is_empty() {
            self.convert();
        }
        self.calls.sets += 1;
        let (inputs, values) = (&self.inputs.handles, &self.inputs.values);
        let set = self.watch.time(|| self.component.set_reals(inputs, values));
        set.map_err(|source| self.failure(Stage::SetInputs, source))
    }

    #[inline(never)]
    fn convert(&mut self) {
        for &(position, conversion) in &self.inputs.conversions {
            let value = &mut self.inputs.values[position];
            *value = conversion.apply(*value);
        }
    }

    /// Reads all outputs.
    pub(super) fn get_outputs(&mut self, values: &mut Values) -> Result<(), Failure> {
        self.read_outputs(values)?;
        self.check_finite(values)
    }

    /// Reads all outputs at a communication point and tracks their changes.
    #[inline(always)]
    pub(super) fn get_next_outputs(&mut self, values: &mut Values) -> Result<(), Failure> {
        self.read_outputs(values)?;
        self.follow(values, self.calls.steps)
    }

    /// Starts tracking with the outputs before the first step.
    pub(super) fn begin_changes(&mut self, values: &Values) {
        for (slot, change) in &mut self.outputs.changes {
            *change = Change::from(values.row[*slot]);
        }
    }

    /// Tracks the changes of the fed outputs to their values after step number `step`.
    #[inline(always)]
    pub(super) fn follow(&mut self, values: &Values, step: u64) -> Result<(), Failure> {
        let mut is_finite = true;
        for (slot, change) in &mut self.outputs.changes {
            is_finite &= change.to(values.row[*slot], step);
        }
        match is_finite {
            true => Ok(()),
            false => self.check_finite(values),
        }
    }

    #[inline(always)]
    fn read_outputs(&mut self, values: &mut Values) -> Result<(), Failure> {
        if !self.outputs.handles.is_empty() {
            self.calls.gets += 1;
            let (outputs, row) = (
                &self.outputs.handles,
                &mut values.row[self.outputs.slots.clone()],
            );
            let got = self.watch.time(|| self.component.get_reals(outputs, row));
            got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        }
        self.get_slopes(values)?;
        self.get_others(values)
    }

    /// Reads the derivatives of the fed outputs.
    #[inline]
    fn get_slopes(&mut self, values: &mut Values) -> Result<(), Failure> {
        match self.within.sloped.is_empty() {
            true => Ok(()),
            false => self.get_each_slope(values),
        }
    }

    fn get_each_slope(&mut self, values: &mut Values) -> Result<(), Failure> {
        self.calls.gets += 1;
        let (handles, room) = (&self.within.sloped, &mut self.within.slope_values);
        let got = self
            .watch
            .time(|| self.component.get_output_derivatives(handles, room));
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        let positions = &self.outputs.fed_positions;
        for (&p, &slope) in positions.iter().zip(&self.within.slope_values) {
            values.slopes[p] = slope;
        }
        // FMUs of some tools declare derivatives, and give NaN.
        let is_lost = |(slope, &slot): (&f64, &usize)| slope.is_nan() && !values.row[slot].is_nan();
        let mut slopes = self.within.slope_values.iter().zip(&self.outputs.fed);
        if slopes.any(is_lost) {
            for &p in positions {
                values.slopes[p] = 0.0;
                values.lost_slopes.push(p);
            }
            self.within.forget_slopes();
        }
        Ok(())
    }

    /// Reads the fed outputs and their derivatives, for the master only.
    pub(super) fn look(&mut self) -> Result<(), Failure> {
        self.calls.gets += 2;
        let (handles, values, slopes) = (
            &self.within.sloped,
            &mut self.within.look_values,
            &mut self.within.slope_values,
        );
        let component = &mut self.component;
        let got = self.watch.time(|| {
            component.get_reals(handles, values)?;
            component.get_output_derivatives(handles, slopes)
        });
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        let pairs = self
            .within
            .look_values
            .iter()
            .zip(&self.within.slope_values);
        for (looked, (&value, &slope)) in self.within.looked.iter_mut().zip(pairs) {
            *looked = Outcome { value, slope };
        }
        Ok(())
    }

    /// Reads the non-real outputs.
    #[inline]
    pub(super) fn get_others(&mut self, values: &mut Values) -> Result<(), Failure> {
        match self.outputs.others.is_empty() {
            true => Ok(()),
            false => self.get_each_other(values),
        }
    }

    fn get_each_other(&mut self, values: &mut Values) -> Result<(), Failure> {
        (0..self.outputs.others.len()).try_for_each(|k| self.get_other(k, values))
    }

    fn get_other(&mut self, k: usize, values: &mut Values) -> Result<(), Failure> {
        let Reading {
            handle,
            kind,
            wanted,
            slot,
            ref map,
            ..
        } = self.outputs.others[k];
        self.calls.gets += 1;
        let got = self.watch.time(|| self.component.get(handle, kind));
        let value = got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        let converted = value.mapped(map, wanted);
        values.others[slot] = converted
            .map_err(|why| self.lost(Stage::GetOutputs, &self.outputs.others[k].wire, &why))?;
        if let Some(column) = values.other_slots[slot] {
            values.row[column] = values.others[slot].as_number();
        }
        Ok(())
    }

    /// Reads the outputs without direct feedthrough.
    pub(super) fn get_settled(&mut self, values: &mut Values) -> Result<(), Failure> {
        for k in 0..self.outputs.settled_others.len() {
            self.get_other(self.outputs.settled_others[k], values)?;
        }
        if self.outputs.settled.is_empty() {
            return Ok(());
        }
        self.calls.gets += 1;
        let (handles, room) = (&self.outputs.settled, &mut self.outputs.settled_values);
        let got = self.watch.time(|| self.component.get_reals(handles, room));
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        for (&slot, &value) in self
            .outputs
            .settled_slots
            .iter()
            .zip(&self.outputs.settled_values)
        {
            values.row[slot] = value;
        }
        self.check_finite(values)
    }

    /// A non-finite output must not feed inputs: it would spread, and its origin would be unknown.
    fn check_finite(&self, values: &Values) -> Result<(), Failure> {
        match self
            .outputs
            .fed
            .iter()
            .find(|&&slot| !values.row[slot].is_finite())
        {
            None => Ok(()),
            Some(&slot) => Err(self.not_finite(slot, values.row[slot])),
        }
    }

    /// Error: a value cannot be converted on a wire.
    #[cold]
    fn lost(&self, stage: Stage, wire: &str, why: &ComponentError) -> Failure {
        self.failure(stage, format!("{wire}: {why}").into())
    }

    #[cold]
    fn not_finite(&self, slot: usize, value: f64) -> Failure {
        let handle = self.outputs.handle(slot);
        let name = self.real_output(handle);
        let source = format!("`{name}` is {value} and feeds others");
        self.failure(Stage::GetOutputs, source.into())
    }

    /// Name of the real output with that handle.
    fn real_output(&self, handle: u32) -> &str {
        let mut variables = self.component.variables().iter();
        let variable = variables.find(|v| v.handle == handle && v.kind == ValueKind::Real);
        variable.map_or("an output", |v| v.name.as_str())
    }

    /// Takes a step with the inputs set last.
    #[inline(always)]
    pub(super) fn step(&mut self, t: f64, h: f64, is_revocable: bool) -> Result<(), Ending> {
        self.calls.steps += 1;
        let stepped = self.watch.time(|| match is_revocable {
            false => self.component.step(t, h),
            true => self.component.step_revocably(t, h),
        });
        match stepped {
            Ok(Progress::Done) => Ok(()),
            other => Err(self.ending(other, t, h)),
        }
    }

    #[cold]
    fn ending(&mut self, stepped: Result<Progress, ComponentError>, t: f64, h: f64) -> Ending {
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
                words: self.component.words_of_discard(),
            },
            // Not an ending; the caller handles `Done`.
            Ok(Progress::Done) => Ending::Completed,
            Err(source) => {
                let source = match self.component.words_of_discard() {
                    Some(words) => format!("{source}; its last message: {words}").into(),
                    None => source,
                };
                self.failure(Stage::Step, source).at(t)
            }
        }
    }

    pub(super) fn save(&mut self, place: usize) -> Result<(), Failure> {
        self.calls.saves += 1;
        let saved = self.watch.time(|| self.component.save(place));
        saved.map_err(|source| self.failure(Stage::Save, source))
    }

    pub(super) fn restore(&mut self, place: usize) -> Result<(), Failure> {
        self.calls.restores += 1;
        let restored = self.watch.time(|| self.component.restore(place));
        restored.map_err(|source| self.failure(Stage::Restore, source))
    }
}
