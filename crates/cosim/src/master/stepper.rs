//! Steps from one communication point of the clock to the next with the chosen algorithm.

mod errors;

use super::controller::Controller;
use super::exchange::Exchange;
use super::stopwatch::Sampler;
use super::strong::Strong;
use super::wired::Failure;
use super::{Ending, MasterError};
use crate::algorithms::{Algorithm, Control, Coupling};
use crate::report::Steps;

/// Number of successive rejected steps that indicate a jump.
const REJECTIONS_AT_A_JUMP: u32 = 3;

/// Error of a step relative to the tolerance, assumed if strong coupling did not converge.
const UNCONVERGED: f64 = 8.0;

/// Maximum number of successive very short steps whose corrections did not converge: no event, but a loop that has no solution.
const MOST_UNCONVERGED: u32 = 100;

/// Maximum number of successive steps of the shortest length, if this many times as many would be needed to the clock's next
/// point: an error that does not get smaller with the step.
const MOST_SHORTEST: u32 = 1000;

/// Maximum number of halvings of a fixed step, and shortest part of it that is halved.
const MAX_PARTS: u32 = 4096;
const SHORTEST_PART: f64 = 1e-7;

/// Shortest part of a fixed step that is halved because a component discards it.
const SHORTEST_AFTER_DISCARD: f64 = 1e-3;

/// Length of the step across a jump relative to the clock's step; the jump's ramp within it has no effect.
const OVER_A_JUMP: f64 = 1e-6;

/// Relative rounding error of counted times.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The components and how they are stepped.
pub(super) struct Stepper {
    pub(super) exchange: Exchange,
    coupling: Coupling,
    order: Vec<usize>,
    /// Whether every input is held at its newest value, with equal steps.
    pub(super) is_plain: bool,
    pub(super) strong: Option<Strong>,
    pub(super) control: Option<(Control, Controller)>,
    /// Whether inputs change within a step, which would turn jumps into ramps.
    pub(super) has_input_profiles: bool,
    /// Whether all components support rollback, and variable steps.
    can_reject: bool,
    can_vary: bool,
    /// Whether steps with held inputs are cut where a component's scenario changes something.
    is_cut: bool,
    pub(super) steps: Steps,
    /// Number of completed steps of the clock.
    points: u64,
    /// Remaining halvings of the current step.
    parts_left: u32,
    /// Number of successive very short steps whose corrections did not converge.
    pub(super) unconverged: u32,
    /// Number of successive shortest steps.
    pub(super) shortest: u32,
    room: Vec<f64>,
    /// Errors of the fed outputs in the last step.
    errors: Vec<f64>,
    /// Length \[s\] and errors of the longest step that was tried in the current step of the clock.
    longest_errors: (f64, Vec<f64>),
    /// For each of the fed outputs, in the current step of the clock.
    crossings: Vec<errors::Crossings>,
    /// Whether the components step concurrently.
    pub(super) parallel: bool,
    pub(super) sampler: Sampler,
}

impl Stepper {
    pub(super) fn new(
        exchange: Exchange,
        coupling: &Coupling,
        order: Vec<usize>,
    ) -> Result<Self, MasterError> {
        let is_strong = coupling.algorithm == Algorithm::Strong;
        let degree = coupling.extrapolation.unwrap_or(0);
        let has_parts = exchange.wired.iter().any(|w| w.parts > 1);
        let is_plain = !is_strong && degree == 0 && coupling.control.is_none() && !has_parts;
        if coupling.control.is_some()
            && let Some(fixed) = exchange.wired.iter().find(|w| !w.abilities.variable_steps)
        {
            let instance = fixed.name.clone();
            return Err(MasterError::FixedSteps { instance });
        }
        let order_of_error = if is_strong { 3 } else { degree as i32 + 1 };
        Ok(Self {
            coupling: *coupling,
            order,
            is_plain,
            strong: is_strong.then(|| Strong::new(&exchange, coupling)),
            control: (coupling.control).map(|c| (c, Controller::new(&c, order_of_error))),
            has_input_profiles: is_strong || degree > 0 || coupling.control.is_some(),
            can_vary: exchange.wired.iter().all(|w| w.abilities.variable_steps),
            is_cut: exchange.wired.iter().any(|w| w.abilities.cuts_steps),
            can_reject: exchange.wired.iter().all(|w| w.abilities.rollback),
            steps: Steps {
                shortest: f64::INFINITY,
                ..Steps::default()
            },
            points: 0,
            parts_left: 0,
            unconverged: 0,
            shortest: 0,
            room: vec![0.0; exchange.values.row.len()],
            errors: vec![0.0; exchange.fed.len()],
            longest_errors: (0.0, vec![0.0; exchange.fed.len()]),
            crossings: vec![errors::Crossings::default(); exchange.fed.len()],
            parallel: coupling.parallel && is_plain,
            sampler: Sampler::new(coupling.measure),
            exchange,
        })
    }

    /// Reads the outputs at the start time [s].
    pub(super) fn begin(&mut self, time: f64) -> Result<(), MasterError> {
        for i in 0..self.exchange.wired.len() {
            let got = self.exchange.get_outputs(i);
            got.map_err(Failure::at_start)?;
        }
        self.exchange.complete_slopes().map_err(Failure::at_start)?;
        self.exchange.keep(time);
        self.exchange.history.at_clock();
        let Exchange { wired, values, .. } = &mut self.exchange;
        wired.iter_mut().for_each(|w| w.begin_changes(values));
        self.sampler = Sampler::new(self.coupling.measure);
        Ok(())
    }

    /// Advances from the communication point at `t` to the one at `end`, `h` [s] later.
    #[inline]
    pub(super) fn advance(&mut self, t: f64, end: f64, h: f64) -> Result<(), Ending> {
        match self.sampler.is_due() {
            false => self.step(t, end, h),
            true => self.step_timed(t, end, h),
        }
    }

    #[cold]
    fn step_timed(&mut self, t: f64, end: f64, h: f64) -> Result<(), Ending> {
        let begun = self.sampler.begin(&mut self.exchange.wired);
        let result = self.step(t, end, h);
        self.sampler.end(begun, &mut self.exchange.wired);
        result
    }

    #[inline]
    fn step(&mut self, t: f64, end: f64, h: f64) -> Result<(), Ending> {
        if self.is_plain {
            if self.is_cut && self.can_vary {
                return self.step_in_cuts(t, end, h);
            }
            let (algorithm, parallel) = (self.coupling.algorithm, self.parallel);
            (self.exchange).advance_held(algorithm, &self.order, parallel, t, h)?;
            // All steps are equally long.
            match self.steps.accepted {
                0 => self.count(h),
                _ => self.steps.accepted += 1,
            }
            return Ok(());
        }
        self.exchange.history.clock_step = h;
        self.longest_errors.0 = 0.0;
        self.crossings.fill(errors::Crossings::default());
        let stepped = match self.has_input_profiles {
            true => self.step_between_jumps(t, end, h),
            false => self.stride(t, end, h),
        };
        self.gather(h);
        stepped?;
        self.follow(end)
    }

    /// A step with held inputs, cut where scenarios change something.
    #[cold]
    fn step_in_cuts(&mut self, begin: f64, end: f64, h: f64) -> Result<(), Ending> {
        let mut t = begin;
        while t < end {
            let instances = self.exchange.wired.iter();
            let cut = instances.filter(|w| w.abilities.cuts_steps);
            let jumps = cut.filter_map(|w| w.component.next_jump(t));
            let next = jumps.filter(|jump| *jump < end - ROUNDING * end.abs());
            let next = next.fold(end, f64::min);
            let span = match (t, next) == (begin, end) {
                true => h,
                false => next - t,
            };
            let (algorithm, parallel) = (self.coupling.algorithm, self.parallel);
            (self.exchange).advance_held(algorithm, &self.order, parallel, t, span)?;
            self.count(span);
            t = next;
        }
        Ok(())
    }

    /// Tracks the changes of the fed outputs between the clock's points only: steps between these may grow, and the
    /// changes with them.
    fn follow(&mut self, end: f64) -> Result<(), Ending> {
        self.points += 1;
        self.exchange.history.at_clock();
        let Exchange { wired, values, .. } = &mut self.exchange;
        let mut all = wired.iter_mut();
        let followed = all.try_for_each(|w| w.follow(values, self.points));
        followed.map_err(|failure| failure.at(end))
    }

    /// Steps that are cut at the jumps of signals: one step ends shortly before the jump, a very short one crosses it,
    /// and earlier values are not used afterwards.
    fn step_between_jumps(&mut self, begin: f64, end: f64, h: f64) -> Result<(), Ending> {
        let short = (OVER_A_JUMP * h).max(16.0 * ROUNDING * end.abs());
        let mut t = begin;
        // A jump that follows the end by rounding belongs to it, and may stay ahead: no step goes beyond the stop time.
        while t < end
            && let Some(jump) = self.jump_within(t, end)
        {
            if !self.can_vary {
                self.steps.ramps += 1;
                break;
            }
            let before = jump - short;
            if before > t + short {
                self.stride(t, before, before - t)?;
                t = before;
            }
            let after = if jump > end - short { end } else { jump };
            self.stride_once(t, after, after - t)?;
            self.exchange.history.restart();
            self.steps.jumps += 1;
            t = after;
        }
        match t {
            t if t == begin => self.stride(t, end, h),
            t if t < end => self.stride(t, end, end - t),
            _ => Ok(()),
        }
    }

    /// The first jump after `t` and not after `end`.
    fn jump_within(&self, t: f64, end: f64) -> Option<f64> {
        let instances = self.exchange.wired.iter();
        let jumps = instances.filter_map(|w| w.component.next_jump(t));
        let last = end + ROUNDING * end.abs();
        jumps.filter(|&jump| jump <= last).reduce(f64::min)
    }

    /// Advances from `t` to `end`, `h` [s] later: in one step, or in as many as the step-size control chooses.
    fn stride(&mut self, t: f64, end: f64, h: f64) -> Result<(), Ending> {
        let Some((control, mut controller)) = self.control.take() else {
            return self.stride_once(t, end, h);
        };
        let result = self.advance_controlled(&control, &mut controller, t, end);
        self.control = Some((control, controller));
        result
    }

    /// Whether all components can return to the beginning of a fixed step.
    fn can_go_back(&self) -> bool {
        self.strong.is_some() && self.can_reject
    }

    fn stride_once(&mut self, t: f64, end: f64, h: f64) -> Result<(), Ending> {
        self.parts_left = MAX_PARTS;
        let result = self.stride_in_halves(t, end, h, 1.0);
        if let Err(Ending::Discarded { .. }) = &result
            && self.can_go_back()
            && self.can_vary
        {
            // No shorter step succeeds: the longest one ends the run where the component comes farthest.
            let begin = self.exchange.history.time();
            (self.exchange.restore()).map_err(|failure| failure.at(begin))?;
            let has_converged = self.attempt(end - begin, false)?;
            self.accept(end, end - begin, has_converged);
            return Ok(());
        }
        result
    }

    /// One step, which is this part of a fixed step. If it is too long for strong coupling, or for a component that
    /// discards it, it is replaced by two halves, which may be halved again. If it cannot be halved, a meaningless result
    /// ends the run, and smaller errors are reported.
    fn stride_in_halves(&mut self, t: f64, end: f64, h: f64, part: f64) -> Result<(), Ending> {
        if self.strong.is_some() {
            self.exchange.save().map_err(|failure| failure.at(t))?;
        }
        let can_halve = self.can_vary && self.parts_left > 0 && part > SHORTEST_PART;
        let can_go_back = self.can_go_back();
        match self.attempt(h, false) {
            // A shorter step may succeed.
            Err(Ending::Discarded { .. })
                if can_halve && can_go_back && part > SHORTEST_AFTER_DISCARD => {}
            Err(ending) => return Err(ending),
            Ok(has_converged) => match can_go_back.then(|| self.misled(part)).flatten() {
                Some(_) if can_halve => {}
                Some((instance, input)) if self.is_nonsense() => {
                    return Err(self.exchange.wired[instance].misled(input, t, h));
                }
                _ => {
                    self.accept(end, h, has_converged);
                    return Ok(());
                }
            },
        }
        self.parts_left -= 1;
        self.exchange.restore().map_err(|failure| failure.at(t))?;
        self.steps.rejected += 1;
        let middle = t + 0.5 * h;
        self.stride_in_halves(t, middle, 0.5 * h, 0.5 * part)?;
        self.stride_in_halves(middle, end, 0.5 * h, 0.5 * part)
    }

    /// Takes one step by `h`; returns whether the outputs at its end are consistent.
    fn attempt(&mut self, h: f64, is_revocable: bool) -> Result<bool, Ending> {
        let is_consistent = match &mut self.strong {
            Some(strong) => strong.advance(&mut self.exchange, h, &mut self.steps)?,
            None => {
                let degree = self.coupling.extrapolation.unwrap_or(0);
                let (algorithm, order) = (self.coupling.algorithm, &self.order);
                (self.exchange).advance(algorithm, order, degree, h, is_revocable)?;
                true
            }
        };
        if self.strong.is_some() {
            self.exchange.watch(h)?;
        }
        self.examine(h);
        Ok(is_consistent)
    }

    fn accept(&mut self, end: f64, h: f64, has_converged: bool) {
        self.steps.unconverged += u64::from(!has_converged);
        self.measure(h);
        self.count(h);
        self.exchange.keep(end);
    }

    fn count(&mut self, h: f64) {
        self.steps.accepted += 1;
        self.steps.shortest = self.steps.shortest.min(h);
        self.steps.longest = self.steps.longest.max(h);
    }

    /// Advances from one point of the clock to the next in steps as long as the error allows.
    fn advance_controlled(
        &mut self,
        control: &Control,
        controller: &mut Controller,
        begin: f64,
        end: f64,
    ) -> Result<(), Ending> {
        let (mut t, mut rejections) = (begin, 0);
        while t < end {
            let (h, is_last) = controller.step_within(end - t);
            let next = if is_last { end } else { t + h };
            let failed = |failure: Failure| failure.at(t);
            self.exchange.save().map_err(failed)?;
            // Equal parts of the remainder may be longer by rounding.
            let may_reject = self.can_reject && h > 1.01 * control.min_step;
            let mut has_converged = true;
            // The estimate of the error takes steps too, which may be discarded.
            let attempted = self.attempt(h, self.can_reject);
            let relative = |own| {
                let error = self.error(h, control.tolerance)?;
                Ok((own, error / control.tolerance))
            };
            let error = match attempted.and_then(relative) {
                Ok((is_consistent, error)) => {
                    has_converged = is_consistent;
                    if has_converged {
                        error
                    } else {
                        error.max(UNCONVERGED)
                    }
                }
                // The component can step to the time it reached.
                Err(Ending::Discarded { reached, .. }) if may_reject => {
                    controller.shorten(h, reached - t);
                    f64::INFINITY
                }
                Err(ending) => return Err(ending),
            };
            if error > 1.0 && may_reject {
                self.exchange.restore().map_err(failed)?;
                self.steps.rejected += 1;
                rejections += 1;
                if rejections == REJECTIONS_AT_A_JUMP {
                    self.exchange.history.restart();
                }
                controller.reject(h, error);
                continue;
            }
            self.accept(next, h, has_converged);
            self.unconverged = match has_converged || h > SHORTEST_PART * control.max_step {
                true => 0,
                false => self.unconverged + 1,
            };
            if self.unconverged == MOST_UNCONVERGED {
                return Err(self.exchange.wired[0].diverged(next, h));
            }
            let is_hopeless = (end - next) / h > f64::from(MOST_SHORTEST).powi(2);
            self.shortest = match h < 2.0 * control.min_step && is_hopeless {
                true => self.shortest + 1,
                false => 0,
            };
            if self.shortest == MOST_SHORTEST {
                return Err(self.exchange.wired[0].uncontrolled(next, h));
            }
            controller.accept(h, error);
            if error > 1.0 {
                self.steps.over_tolerance += 1;
                self.exchange.history.restart();
            }
            (t, rejections) = (next, 0);
        }
        Ok(())
    }

    /// Positions of the instances in stepping order.
    pub(super) fn order(&self) -> &[usize] {
        &self.order
    }
}
