//! The components in the stepping loop and the values exchanged between them.

use super::history::{History, InputProfile, Outcome};
use super::lu::{Lu, SINGULAR};
use super::wired::{BEGIN, Failure, Values, Wired};
use super::{Ending, Look, Stage};
use crate::algorithms::Algorithm;
use crate::component::Value;
use crate::recorder::Signal;
use rayon::prelude::*;

/// The components and the exchanged values. Nothing is allocated after construction, except for strings.
pub(super) struct Exchange {
    pub(super) wired: Vec<Wired>,
    /// Positions of the components whose outputs are read with the inputs of the same time, each after those that feed it.
    pub(super) at_once: Vec<usize>,
    pub(super) values: Values,
    pub(super) signals: Vec<Signal>,
    pub(super) unrecorded: Vec<String>,
    /// Slots in the row of real outputs that feed inputs. Positions refer to this list.
    pub(super) fed: Vec<usize>,
    pub(super) history: History,
    /// Input profiles of the fed outputs within the step, by position.
    pub(super) profiles: Vec<InputProfile>,
    /// Means of the fed outputs over the last step, if they were observed within it.
    pub(super) seen: Vec<Option<f64>>,
    /// Non-real outputs at the beginning of the step, and the values given to components for them.
    pub(super) others_before: Vec<Value>,
    pub(super) others_given: Vec<Value>,
}

impl Exchange {
    pub(super) fn get_outputs(&mut self, i: usize) -> Result<(), Failure> {
        self.wired[i].get_outputs(&mut self.values)
    }

    /// A communication step from `t` by `h` with every input held at its newest value.
    pub(super) fn advance_held(
        &mut self,
        algorithm: Algorithm,
        order: &[usize],
        parallel: bool,
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
        match parallel {
            true => step_in_parallel(&mut self.wired, t, h)?,
            false => (self.wired.iter_mut()).try_for_each(|wired| wired.step(t, h, false))?,
        }
        for wired in self.wired.iter_mut().filter(|own| !own.at_once) {
            wired.get_next_outputs(values).map_err(failed)?;
        }
        for &i in &self.at_once {
            let wired = &mut self.wired[i];
            wired.set_newest(values).map_err(failed)?;
            wired.get_next_outputs(values).map_err(failed)?;
        }
        Ok(())
    }

    /// A communication step by `h` from the history's last point. Inputs are extrapolated with that degree or, with
    /// Gauss-Seidel, interpolated if the next values are known.
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
            wired.substeps(&mut self.values, &self.profiles, span, parts, is_revocable)?;
            if algorithm == Algorithm::GaussSeidel {
                self.interpolate(i, degree, h);
            }
        }
        for &i in &self.at_once {
            let wired = &mut self.wired[i];
            wired.set_newest(&self.values).map_err(failed)?;
            wired.get_outputs(&mut self.values).map_err(failed)?;
        }
        Ok(())
    }

    /// Extrapolates all fed outputs by polynomials of that degree.
    pub(super) fn extrapolate(&mut self, degree: usize, h: f64) {
        for p in 0..self.fed.len() {
            self.profiles[p] = self.history.extrapolated(p, degree, h);
        }
    }

    /// Interpolates the fed outputs of a component at the end of the step; with degree 0, the values at the end are
    /// held.
    pub(super) fn interpolate(&mut self, i: usize, degree: usize, h: f64) {
        for k in 0..self.wired[i].outputs.fed_positions.len() {
            let p = self.wired[i].outputs.fed_positions[k];
            let end = self.outcome(p);
            self.profiles[p] = match degree {
                0 => InputProfile::held(end.value),
                _ => self.history.interpolated(p, degree, h, end),
            };
        }
    }

    /// A fed output at its component's current time.
    pub(super) fn outcome(&self, p: usize) -> Outcome {
        self.values.outcome(&self.fed, p)
    }

    /// If a component ended the run after `time`, the last point, reads its outputs and returns the time reached;
    /// `None` otherwise, or if the outputs are no longer available.
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
        let position = self.wired.iter().position(|w| w.name == *instance)?;
        (*reached > time && self.get_outputs(position).is_ok()).then_some(*reached)
    }

    /// Sets the inputs of every component and passes it to `look`.
    pub(super) fn look(&mut self, look: Look) -> Result<(), Failure> {
        for i in 0..self.wired.len() {
            let wired = &mut self.wired[i];
            wired.set_newest(&self.values)?;
            let seen = look(wired.component.as_mut());
            seen.map_err(|source| wired.failure(Stage::Linearize, source))?;
        }
        Ok(())
    }

    /// Stores the non-real outputs at the beginning of a step.
    pub(super) fn keep_others(&mut self) {
        self.others_before.clone_from_slice(&self.values.others);
        self.others_given.clone_from_slice(&self.values.others);
    }

    /// Saves the states of all components with rollback.
    pub(super) fn save(&mut self) -> Result<(), Failure> {
        let mut able = self.wired.iter_mut().filter(|w| w.abilities.rollback);
        able.try_for_each(|wired| wired.save(BEGIN))
    }

    /// Restores the beginning of the step.
    pub(super) fn restore(&mut self) -> Result<(), Failure> {
        self.values.others.clone_from_slice(&self.others_before);
        let mut able = self.wired.iter_mut().filter(|w| w.abilities.rollback);
        able.try_for_each(|wired| wired.restore(BEGIN))
    }

    /// Before the first step, components know no derivatives of their inputs: adds their effect on the derivatives of
    /// outputs with direct feedthrough, `(I - D) s = s₀`.
    pub(super) fn complete_slopes(&mut self) -> Result<(), Failure> {
        if !self.wired.iter().any(Wired::passes_slopes) {
            return Ok(());
        }
        let mut matrix = Lu::new(self.fed.len());
        self.add_feedthrough(&mut matrix, Some)?;
        if matrix.factor(SINGULAR) {
            matrix.solve(&mut self.values.slopes);
        }
        Ok(())
    }

    /// Sets a matrix to `I - D`, where D has the derivatives of the fed outputs by the fed outputs of others through direct
    /// feedthrough, as far as components have them and use derivatives of outputs; `place` is the row of a position.
    pub(super) fn add_feedthrough(
        &mut self,
        matrix: &mut Lu,
        place: impl Fn(usize) -> Option<usize>,
    ) -> Result<(), Failure> {
        matrix.set_identity();
        for wired in self.wired.iter_mut().filter(|own| own.passes_slopes()) {
            for input in 0..wired.inputs.distinct.len() {
                let p = wired.inputs.distinct[input];
                let Some(column) = place(p) else {
                    continue;
                };
                let effects = wired.effect_on_slopes(|own| f64::from(u8::from(own == p)))?;
                for (q, effect) in effects {
                    if let Some(row) = place(q) {
                        matrix.add(row, column, -effect);
                    }
                }
            }
        }
        Ok(())
    }

    /// Appends the values in the row to the history as a communication point.
    pub(super) fn keep(&mut self, time: f64) {
        for p in self.values.lost_slopes.drain(..) {
            self.history.forget_slopes(p);
        }
        let (row, slopes) = (&self.values.row, &self.values.slopes);
        let points = self.fed.iter().zip(slopes);
        let points = points.map(|(&slot, &slope)| Outcome {
            value: row[slot],
            slope,
        });
        self.history.push(time, points);
    }
}

/// Steps all components concurrently. If several fail, the error of the first in order is reported.
fn step_in_parallel(components: &mut [Wired], t: f64, h: f64) -> Result<(), Ending> {
    let step = |wired: &mut Wired| wired.ended = wired.step(t, h, false).err();
    components.par_iter_mut().with_max_len(1).for_each(step);
    let mut ended = components.iter_mut().filter_map(|wired| wired.ended.take());
    ended.next().map_or(Ok(()), Err)
}
