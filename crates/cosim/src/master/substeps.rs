//! A communication step of one component with inputs that change within it.

use super::history::InputProfile;
use super::wired::{BEGIN, END, Failure, LAST_PART, Values, Wired};
use super::{Ending, Stage};
use crate::component::Value;

/// Limits of [`Wired::last_piece`].
const SHORTEST_PIECE: f64 = 0.01;
const LONGEST_PIECE: f64 = 1.0 / 3.0;

impl Wired {
    /// Takes the communication step from `t` by `h` in `parts` equal steps, with inputs along `profiles`, and reads the
    /// outputs.
    ///
    /// For the states, inputs are ramps or the middle of each part's line. Outputs with direct feedthrough need the
    /// input values at the end; if these differ, they are taken from an extra last part that ends there, before the
    /// component is restored and takes the actual last part. Held inputs have their end values in the last piece of that
    /// part alone, if the component takes steps of any length: many FMUs do not say on which inputs outputs depend, and
    /// those of states follow from the mean. A component without rollback takes this part as the actual one. The derivatives
    /// of these outputs are those for the inputs' derivatives at the end too, if the component has directional derivatives.
    pub(super) fn substeps(
        &mut self,
        values: &mut Values,
        profiles: &[InputProfile],
        (t, h): (f64, f64),
        parts: u32,
        is_revocable: bool,
    ) -> Result<(), Ending> {
        let failed = |failure: Failure| failure.at(t);
        let mut own = self.inputs.positions.iter().map(|&p| &profiles[p]);
        let is_held = own.clone().all(InputProfile::is_held);
        let is_ramp = self.abilities.input_derivatives && !is_held;
        let ends_elsewhere = match is_ramp {
            true => own.any(InputProfile::is_curved),
            false => !is_held,
        };
        let needs_ends = self.outputs.has_feedthrough && ends_elsewhere;
        let can_split = needs_ends && !is_ramp && self.abilities.variable_steps;
        let has_two_passes = needs_ends && self.abilities.rollback;
        let is_split = can_split && !has_two_passes;
        let only_ends = needs_ends && !has_two_passes && !is_split && self.outputs.feeds_through;
        let place = if only_ends && !is_ramp { 1.0 } else { 0.5 };
        self.note_used(profiles, (2.0 * place - 1.0) / f64::from(parts));
        let step = h / f64::from(parts);
        for part in 0..parts {
            let begin = t + f64::from(part) * step;
            let at = |place: f64| (f64::from(part) + place) / f64::from(parts);
            let is_last = part + 1 == parts;
            if has_two_passes && is_last {
                self.save(LAST_PART).map_err(failed)?;
                if !(can_split && self.split(profiles, at(0.5), (begin, step), true)?) {
                    match is_ramp {
                        true => self.set_ramps(profiles, true, at(0.0), h).map_err(failed)?,
                        false => self.hold(profiles, true, 1.0).map_err(failed)?,
                    }
                    self.step(begin, step, true)?;
                }
                self.get_outputs(values).map_err(failed)?;
                let given = |p: usize| match is_ramp {
                    true => 2.0 * profiles[p].to_end().lean / h,
                    false => 0.0,
                };
                self.add_slopes(values, |p| profiles[p].slope - given(p))
                    .map_err(failed)?;
                self.restore(LAST_PART).map_err(failed)?;
            }
            if is_split && is_last && self.split(profiles, at(0.5), (begin, step), false)? {
                self.get_outputs(values).map_err(failed)?;
                return (self.add_slopes(values, |p| profiles[p].slope)).map_err(failed);
            }
            match is_ramp {
                true => self
                    .set_ramps(profiles, only_ends, at(0.0), h)
                    .map_err(failed)?,
                false => self.hold(profiles, only_ends, at(place)).map_err(failed)?,
            }
            self.step(begin, step, is_revocable)?;
        }
        match has_two_passes {
            true => self.get_settled(values).map_err(failed),
            false => self.get_outputs(values).map_err(failed),
        }
    }

    /// Takes a part of a communication step from `begin` by `step` \[s\] with held inputs that keep the mean of their lines,
    /// whose middle is at the fraction `middle` of the communication step, and end at their end values
    /// ([`Self::last_piece`]). Returns false, in the state before it, if a revocable component discards steps of these
    /// lengths.
    fn split(
        &mut self,
        profiles: &[InputProfile],
        middle: f64,
        (begin, step): (f64, f64),
        is_revocable: bool,
    ) -> Result<bool, Ending> {
        let failed = |failure: Failure| failure.at(begin);
        let piece = self.last_piece(profiles, middle);
        let turn = begin + (1.0 - piece) * step;
        // With the end value in the last piece, the mean is that of the line.
        let before = |own: &InputProfile| (own.line(middle) - piece * own.end) / (1.0 - piece);
        self.set_to(profiles, before).map_err(failed)?;
        let mut stepped = self.step(begin, turn - begin, is_revocable);
        if stepped.is_ok() {
            self.hold(profiles, true, 1.0).map_err(failed)?;
            stepped = self.step(turn, begin + step - turn, is_revocable);
        }
        match stepped {
            Err(Ending::Discarded { .. }) if is_revocable => {
                self.restore(LAST_PART).map_err(failed)?;
                Ok(false)
            }
            other => other.map(|()| true),
        }
    }

    /// Last piece of a part in which the inputs have their end values, as a fraction of it. The values before keep the
    /// mean. A third keeps the first moment of a line too, so that the states have an error of third order; it is shorter
    /// if an input is elsewhere than its line at the end, so that no value before is beyond the line by much.
    fn last_piece(&self, profiles: &[InputProfile], middle: f64) -> f64 {
        let of = |p: &usize| {
            let profile = &profiles[*p];
            let beyond = profile.end - profile.line(middle);
            let rise = profile.line(1.0) - profile.line(middle);
            match beyond == 0.0 {
                true => LONGEST_PIECE,
                false => (rise / (3.0 * beyond)).clamp(SHORTEST_PIECE, LONGEST_PIECE),
            }
        };
        let all = self.inputs.positions.iter().map(of);
        all.fold(LONGEST_PIECE, f64::min)
    }

    /// Adds the effect of these changes of the inputs' derivatives to the derivatives of the fed outputs, if derivatives
    /// of inputs act on them at once.
    fn add_slopes(
        &mut self,
        values: &mut Values,
        change: impl Fn(usize) -> f64,
    ) -> Result<(), Failure> {
        if self.passes_slopes() {
            for (p, effect) in self.effect_on_slopes(change)? {
                values.slopes[p] += effect;
            }
        }
        Ok(())
    }

    /// Whether derivatives of inputs act on those of outputs at once, and these are used.
    pub(super) fn passes_slopes(&self) -> bool {
        let is_able = self.abilities.directional_derivatives && self.outputs.feeds_through;
        is_able && !self.within.sloped.is_empty()
    }

    /// Positions of the fed outputs of a component that [passes slopes](Self::passes_slopes), and the effect on their
    /// derivatives of these changes of the inputs' derivatives, by the position of the output that feeds them.
    pub(super) fn effect_on_slopes(
        &mut self,
        change: impl Fn(usize) -> f64,
    ) -> Result<impl Iterator<Item = (usize, f64)>, Failure> {
        for (slope, &p) in self.inputs.slopes.iter_mut().zip(&self.inputs.positions) {
            *slope = change(p);
        }
        for &(position, conversion) in &self.inputs.conversions {
            self.inputs.slopes[position] *= conversion.factor;
        }
        self.calls.gets += 1;
        let (outputs, inputs) = (&self.within.sloped, &self.inputs.handles);
        let (seed, effect) = (&self.inputs.slopes, &mut self.within.slope_values);
        let component = &mut self.component;
        let asked = || component.directional_derivative(outputs, inputs, seed, effect);
        let got = self.watch.time(asked);
        got.map_err(|source| self.failure(Stage::GetOutputs, source))?;
        let positions = self.outputs.fed_positions.iter().copied();
        let effects = positions.zip(self.within.slope_values.iter().copied());
        Ok(effects.filter(|(_, effect)| effect.is_finite()))
    }

    fn note_used(&mut self, profiles: &[InputProfile], shift: f64) {
        for (used, &p) in self.within.used.iter_mut().zip(&self.inputs.positions) {
            let profile = &profiles[p];
            *used = profile.mean + shift * (profile.end - profile.mean);
        }
    }

    /// Sets the inputs to the values of their lines after a fraction `at` of the step, with lines to the end values if
    /// `to_ends`.
    pub(super) fn hold(
        &mut self,
        profiles: &[InputProfile],
        to_ends: bool,
        at: f64,
    ) -> Result<(), Failure> {
        self.set_to(profiles, |own| match to_ends {
            true => own.to_end().line(at),
            false => own.line(at),
        })
    }

    fn set_to(
        &mut self,
        profiles: &[InputProfile],
        value: impl Fn(&InputProfile) -> f64,
    ) -> Result<(), Failure> {
        for (own, &p) in self.inputs.values.iter_mut().zip(&self.inputs.positions) {
            *own = value(&profiles[p]);
        }
        self.set_reals()
    }

    /// As `hold`, also with the slopes of the lines in a step of `h` [s].
    pub(super) fn set_ramps(
        &mut self,
        profiles: &[InputProfile],
        to_ends: bool,
        at: f64,
        h: f64,
    ) -> Result<(), Failure> {
        self.hold(profiles, to_ends, at)?;
        for (slope, &p) in self.inputs.slopes.iter_mut().zip(&self.inputs.positions) {
            let profile = match to_ends {
                true => profiles[p].to_end(),
                false => profiles[p],
            };
            *slope = 2.0 * profile.lean / h;
        }
        for &(position, conversion) in &self.inputs.conversions {
            self.inputs.slopes[position] *= conversion.factor;
        }
        self.calls.sets += 1;
        let (inputs, slopes) = (&self.inputs.handles, &self.inputs.slopes);
        let set = self
            .watch
            .time(|| self.component.set_input_derivatives(inputs, slopes));
        set.map_err(|source| self.failure(Stage::SetInputs, source))
    }

    /// Effect on the fed outputs of taking the step in half as many parts: 3 times the error of holding the inputs
    /// within each part. `others` are the non-real inputs; `room` holds at least one value per output.
    ///
    /// The component is at the end of the step before and after.
    pub(super) fn effect_of_hold_error(
        &mut self,
        values: &mut Values,
        profiles: &[InputProfile],
        others: &[Value],
        span: (f64, f64),
        room: &mut [f64],
    ) -> Result<(), Ending> {
        let failed = |failure: Failure| failure.at(span.0);
        let slots = self.outputs.slots.clone();
        let room = &mut room[..slots.len()];
        self.save(END).map_err(failed)?;
        room.copy_from_slice(&values.row[slots.clone()]);
        self.restore(BEGIN).map_err(failed)?;
        self.set_others(others).map_err(failed)?;
        self.substeps(values, profiles, span, self.parts / 2, true)?;
        self.restore(END).map_err(failed)?;
        for (fine, coarse) in room.iter_mut().zip(&mut values.row[slots]) {
            (*fine, *coarse) = (*fine - *coarse, *fine);
        }
        self.get_others(values).map_err(failed)
    }
}
