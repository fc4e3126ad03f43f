//! The stepping loop's components and the values between them.

use super::history::{History, InputProfile, Outcome};
use super::wired::{BEGIN, Failure, Values, Wired};
use super::{Ending, Look, Stage};
use crate::algorithms::Algorithm;
use crate::component::Value;
use crate::recorder::Signal;
use rayon::prelude::*;

/// The components and the values between them. Nothing is allocated after it is made, but for strings.
pub(super) struct Exchange {
    pub(super) wired: Vec<Wired>,
    pub(super) values: Values,
    pub(super) signals: Vec<Signal>,
    pub(super) unrecorded: Vec<String>,
    /// Slots in the row of the real outputs that feed others. A position is one in this list.
    pub(super) fed: Vec<usize>,
    pub(super) history: History,
    /// How the fed outputs go within the step, by position.
    pub(super) profiles: Vec<InputProfile>,
    /// Their means over the last step, of those that were seen within it.
    pub(super) seen: Vec<Option<f64>>,
    /// Outputs that are no reals, at the begin of the step, and what the components are given for them.
    pub(super) others_before: Vec<Value>,
    pub(super) others_given: Vec<Value>,
}

impl Exchange {
    pub(super) fn get_outputs(&mut self, i: usize) -> Result<(), Failure> {
        self.wired[i].get_outputs(&mut self.values)
    }

    /// A communication step from `t` by `h` in which every input is held at the newest value.
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
            wired.substeps(&mut self.values, &self.profiles, span, parts, is_revocable)?;
            if algorithm == Algorithm::GaussSeidel {
                self.interpolate(i, degree, h);
            }
        }
        Ok(())
    }

    /// Continues all fed outputs by polynomials of that degree.
    pub(super) fn extrapolate(&mut self, degree: usize, h: f64) {
        for p in 0..self.fed.len() {
            self.profiles[p] = self.history.extrapolated(p, degree, h);
        }
    }

    /// Interpolates the fed outputs of a component that stands at the end of the step; with degree 0 the
    /// values at the end are held.
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

    /// A fed output where its component stands.
    pub(super) fn outcome(&self, p: usize) -> Outcome {
        self.values.outcome(&self.fed, p)
    }

    /// Reads the outputs of a component that ended the run later than at `time`, the last point, and tells where it
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
        let position = self.wired.iter().position(|w| w.name == *instance)?;
        (*reached > time && self.get_outputs(position).is_ok()).then_some(*reached)
    }

    /// Gives every component its inputs and shows it.
    pub(super) fn look(&mut self, look: Look) -> Result<(), Failure> {
        for i in 0..self.wired.len() {
            let wired = &mut self.wired[i];
            wired.set_newest(&self.values)?;
            let seen = look(wired.component.as_mut());
            seen.map_err(|source| wired.failure(Stage::Linearize, source))?;
        }
        Ok(())
    }

    /// Keeps the outputs that are no reals, as they are at the begin of a step.
    pub(super) fn keep_others(&mut self) {
        self.others_before.clone_from_slice(&self.values.others);
        self.others_given.clone_from_slice(&self.values.others);
    }

    /// Saves the state of all components that can.
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
}

/// Lets all components step at the same time. Of several failures the first component's is told, whichever came first.
fn step_in_parallel(components: &mut [Wired], t: f64, h: f64) -> Result<(), Ending> {
    let step = |wired: &mut Wired| wired.ended = wired.step(t, h, false).err();
    components.par_iter_mut().with_max_len(1).for_each(step);
    let mut ended = components.iter_mut().filter_map(|wired| wired.ended.take());
    ended.next().map_or(Ok(()), Err)
}
