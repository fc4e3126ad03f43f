//! Steps of co-simulation, and events.

use super::Simulation;
use super::fault::{StepError, StepFault, not_finite};
use super::flow::Flow;
use super::time_events::Window;
use crate::lti::Transition;
use crate::{At, Equations};
use pilotage_ode::{Advance, Solver};

/// Maximum number of integrator steps within one step.
const MAX_STEPS: usize = 1_000_000;

/// Maximum number of events within one step; more of them occur faster than time passes.
const MAX_EVENTS: usize = 1000;

/// Work of an implicit step, in evaluations of `n` derivatives: some of itself, and a few Jacobians by dual numbers and
/// factorisations of dense matrices. An explicit step takes six, and is stable up to three time constants of the fastest mode. So
/// where one works as much as the other, the fastest rate times the length of a step is about half of this.
fn implicit_work(n: usize) -> f64 {
    let n = n as f64;
    100.0 + 4.0 * (2.0 * n + n * n / 6.0)
}

/// Evaluations of an explicit step.
const EXPLICIT_WORK: f64 = 6.0;

/// Maximum number of calls of the event handler at one instant.
const MAX_ITERATIONS: usize = 100;

/// Result of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached {
    /// Elapsed time \[s\].
    pub time: f64,
    /// Whether an event is pending there.
    pub event: bool,
}

impl<E: Equations> Simulation<E> {
    /// Advances by `h` > 0 seconds, with constant inputs or, where a slope is set, linear ones. Afterwards the inputs
    /// have the values that they reached, and the slopes are 0. Events are handled.
    ///
    /// # Errors
    /// If the step fails; the state reached is kept.
    ///
    /// # Panics
    /// If `h` is negative or not finite.
    pub fn step(&mut self, h: f64) -> Result<(), StepError> {
        self.advance(h, false).map(|_| ())
    }

    /// As [`step`](Self::step), but if `stop_at_event` is set, it ends at the first event, which
    /// [`handle_event`](Self::handle_event) must then handle.
    ///
    /// # Errors
    /// If the step fails; the state reached is kept.
    ///
    /// # Panics
    /// If `h` is negative or not finite.
    pub fn advance(&mut self, h: f64, stop_at_event: bool) -> Result<Reached, StepError> {
        assert!(h >= 0.0 && h.is_finite(), "a step of {h} s");
        if self.table.n_x() == 0 && self.table.n_indicators() == 0 {
            self.arrive(h);
            return Ok(Reached {
                time: h,
                event: false,
            });
        }
        let is_linear = self.n_delays == 0 && self.equations.is_linear();
        if is_linear && self.table.modes().next().is_none() {
            self.step_exactly(h).map_err(|fault| StepError {
                fault,
                reached: 0.0,
            })?;
            self.arrive(h);
            return Ok(Reached {
                time: h,
                event: false,
            });
        }
        let mut elapsed = 0.0;
        self.space.trouble = None;
        let result = self.integrate(h, stop_at_event, &mut elapsed);
        let result = result.map_err(|fault| self.with_trouble(fault));
        self.arrive(elapsed);
        match result {
            Ok(event) => Ok(Reached {
                time: elapsed,
                event,
            }),
            Err(fault) => Err(StepError {
                fault,
                reached: elapsed,
            }),
        }
    }

    /// Replaces a fault by the expression that caused it, if there is one.
    fn with_trouble(&mut self, fault: StepFault) -> StepFault {
        match (fault, self.space.trouble.take()) {
            (StepFault::Integration(_), Some((time, cause))) => StepFault::Trouble { time, cause },
            (fault, _) => fault,
        }
    }

    /// Handles pending events. Returns whether a state or mode has changed.
    ///
    /// # Errors
    /// If the handler keeps changing the states.
    pub fn handle_event(&mut self) -> Result<bool, StepFault> {
        let mut changed = false;
        self.now.handled = self.now.time;
        for _ in 0..MAX_ITERATIONS {
            let mut next = std::mem::take(&mut self.space.next);
            next.copy_from_slice(&self.now.states);
            self.equations.event(self.at(&self.inputs()), &mut next);
            self.space.next = next;
            let next = &self.space.next;
            if let Some(i) = next.iter().position(|v| !v.is_finite()) {
                return Err(not_finite(&self.table, i, next[i], 0.0));
            }
            for mode in &mut self.space.next[self.table.n_states()..] {
                *mode = f64::from(u8::from(*mode != 0.0));
            }
            if self.space.next == self.now.states {
                self.remember_signs();
                return Ok(changed);
            }
            std::mem::swap(&mut self.space.next, &mut self.now.states);
            changed = true;
        }
        Err(StepFault::EndlessEvent {
            time: self.now.time,
            limit: MAX_ITERATIONS,
        })
    }

    /// Stores the signs of the event indicators. An indicator that is 0 gets the sign that it is about to take: a ball
    /// that leaves the ground counts as above it, so that its next contact is detected, however soon it occurs.
    fn remember_signs(&mut self) {
        let mut indicators = std::mem::take(&mut self.space.indicators);
        self.indicators(&mut indicators);
        let rates = match indicators.contains(&0.0) {
            true => self.indicator_rates(),
            false => Vec::new(),
        };
        for (i, positive) in self.now.positive.iter_mut().enumerate() {
            *positive = indicators[i] > 0.0 || (indicators[i] == 0.0 && rates[i] > 0.0);
        }
        self.space.indicators = indicators;
    }

    /// Moves time and inputs to the end of the step.
    fn arrive(&mut self, elapsed: f64) {
        self.now.has_started = true;
        std::mem::swap(&mut self.now.last_slopes, &mut self.now.slopes);
        self.now.slopes.fill(0.0);
        for (value, slope) in self.now.values.iter_mut().zip(&self.now.last_slopes) {
            *value += slope * elapsed;
        }
        self.now.time += elapsed;
        self.now.handled = self.now.time;
        if self.n_delays > 0 {
            let mut times = Vec::new();
            let p = &self.now.values[self.table.parameters()];
            self.equations.delays(p, &mut times);
            let longest = times.into_iter().fold(0.0, f64::max);
            self.now.history.cut(self.now.time, longest);
        }
    }

    /// Exact step of a linear model.
    fn step_exactly(&mut self, h: f64) -> Result<(), StepFault> {
        let Self {
            equations,
            table,
            now,
            ..
        } = self;
        let p = &now.values[table.parameters()];
        let known = |(key, _): &(Vec<f64>, Transition)| key[0] == h && key[1..] == *p;
        if !self.transitions[0].as_ref().is_some_and(known) {
            self.transitions.swap(0, 1);
        }
        if !self.transitions[0].as_ref().is_some_and(known) {
            let time = now.time;
            let size = [table.n_states(), table.inputs().len()];
            let [x, u] = size.map(|n| vec![0.0; n]);
            let mut rates = vec![0.0; size[0]];
            equations.derivative(
                At {
                    time,
                    x: &x,
                    u: &u,
                    p,
                },
                &mut rates,
            );
            assert!(
                // What is no number is told below, with the state that it spoils.
                rates.iter().all(|rate| *rate == 0.0 || !rate.is_finite()),
                "`is_linear` holds, and the derivatives are {rates:?} where states and inputs are 0"
            );
            let transition = Transition::new(size, h, |x, u, dx| {
                equations.derivative(At { time, x, u, p }, dx);
            })?;
            let key = std::iter::once(h).chain(p.iter().copied());
            self.transitions[0] = Some((key.collect(), transition));
        }
        if let Some((_, transition)) = &self.transitions[0] {
            let u = &now.values[table.inputs()];
            transition.apply(&now.states, u, &now.slopes, &mut self.space.next);
        }
        if let Some(i) = self.space.next.iter().position(|v| !v.is_finite()) {
            return Err(not_finite(&self.table, i, self.space.next[i], h));
        }
        std::mem::swap(&mut self.now.states, &mut self.space.next);
        Ok(())
    }

    /// Integrates over `h`, event by event; `elapsed` is set to the time reached. Returns whether it stopped at an
    /// event.
    fn integrate(&mut self, h: f64, stop: bool, elapsed: &mut f64) -> Result<bool, StepFault> {
        let (start, mut events) = (self.now.time, 0);
        // A jump of an input may have caused an event.
        let mut event =
            self.table.n_indicators() > 0 && self.with_flow(|flow, x, _| flow.has_jumped(x));
        loop {
            if event {
                if stop {
                    return Ok(true);
                }
                self.handle_event_at(start, *elapsed)?;
                events += 1;
                if events > MAX_EVENTS {
                    return Err(StepFault::TooManyEvents {
                        limit: MAX_EVENTS,
                        step: h,
                    });
                }
            }
            if *elapsed >= h {
                return Ok(false);
            }
            event = self.integrate_to_event(h, elapsed)?;
        }
    }

    /// Integrates to the end of the step `h` or to the first event; returns whether there is one. Times at which
    /// conditions on time change are stops on the way.
    fn integrate_to_event(&mut self, h: f64, elapsed: &mut f64) -> Result<bool, StepFault> {
        while *elapsed < h {
            let window = self.window(*elapsed, h);
            let end = (window.stop - self.now.time).clamp(*elapsed, h);
            let end = if window.stop.is_finite() { end } else { h };
            if self.integrate_smoothly((end, h), window, elapsed)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Integrates to `end` or to the first event, without a stop on the way, in a step of length `h`.
    ///
    /// The first trial step is the whole rest, and the method is the one with which the last step ended: a call depends on its
    /// arguments and the state only, so that equal calls give identical bits.
    fn integrate_smoothly(
        &mut self,
        (end, h): (f64, f64),
        window: Window,
        elapsed: &mut f64,
    ) -> Result<bool, StepFault> {
        let (from, relative) = (*elapsed, self.now.tolerance);
        self.check_delays(from)?;
        let was_stiff = self.now.is_stiff;
        let work = implicit_work(self.table.n_states());
        let (result, is_stiff) = self.with_flow(|flow, x, solver| {
            flow.window = window;
            let absolute = flow.nominals.iter().map(|nominal| relative * nominal);
            solver.set_tolerances(relative, absolute);
            solver.restart(from, x, true);
            // No longer than the implicit method would take: so the choice costs at most twice the better one.
            solver.begin_with(was_stiff, (work / EXPLICIT_WORK) as u32);
            solver.try_first(end - from);
            solver.remember(flow.positive);
            let result = run(solver, flow, end);
            x.copy_from_slice(solver.state());
            *elapsed = solver.time();
            let fastest = solver.fastest_rate();
            (result, fastest.is_some_and(|rate| rate * h > work))
        });
        self.now.is_stiff = is_stiff;
        result
    }

    /// Handles an event within a step, with the inputs at its time.
    fn handle_event_at(&mut self, start: f64, elapsed: f64) -> Result<(), StepFault> {
        let inputs = self.table.inputs();
        let before = self.now.values[inputs.clone()].to_vec();
        for (value, slope) in self.now.values.iter_mut().zip(&self.now.slopes) {
            *value += slope * elapsed;
        }
        self.now.time = start + elapsed;
        let result = self.handle_event();
        self.now.values[inputs].copy_from_slice(&before);
        self.now.time = start;
        result.map(|_| ())
    }

    /// Rejects delays that are not above 0.
    fn check_delays(&self, elapsed: f64) -> Result<(), StepFault> {
        let mut times = Vec::new();
        if self.n_delays > 0 {
            let p = &self.now.values[self.table.parameters()];
            self.equations.delays(p, &mut times);
        }
        match times.into_iter().find(|tau| tau.is_nan() || *tau <= 0.0) {
            Some(tau) => Err(StepFault::Trouble {
                time: self.now.time + elapsed,
                cause: format!("the time of a delay is {tau} s; it must be above 0"),
            }),
            None => Ok(()),
        }
    }

    /// Calls `f` with the equations of a step, the states and the solver.
    fn with_flow<R>(
        &mut self,
        f: impl FnOnce(&mut Flow<'_, E>, &mut [f64], &mut Solver) -> R,
    ) -> R {
        let Self {
            equations,
            table,
            now,
            solver,
            nominals,
            space,
            n_delays,
            ..
        } = self;
        let mut delays = Vec::new();
        if *n_delays > 0 {
            equations.delays(&now.values[table.parameters()], &mut delays);
        }
        space.inputs.resize(table.inputs().len() + *n_delays, 0.0);
        let mut flow = Flow {
            delays,
            begin: now.time,
            history: &mut now.history,
            equations,
            n_states: table.n_states(),
            nominals,
            start: now.time,
            held: &now.values[table.inputs()],
            slopes: &now.slopes,
            p: &now.values[table.parameters()],
            positive: &now.positive,
            space,
            window: Window::default(),
        };
        f(&mut flow, &mut now.states, solver)
    }
}

/// Advances to the end of the step or to the first event; returns whether there is one.
fn run<E: Equations>(
    solver: &mut Solver,
    flow: &mut Flow<'_, E>,
    h: f64,
) -> Result<bool, StepFault> {
    for _ in 0..MAX_STEPS {
        let advance = match flow.delays.is_empty() {
            true => solver.advance(flow, h)?,
            false => advance_with_delays(solver, flow, h)?,
        };
        if advance == Advance::Event || solver.time() >= h {
            return Ok(advance == Advance::Event);
        }
    }
    Err(StepFault::TooManySteps {
        time: solver.time(),
        step: h,
        limit: MAX_STEPS,
    })
}

/// One step of the integrator, no longer than the shortest delay and up to where a delayed signal jumps at most, whose signals are
/// then part of the history.
fn advance_with_delays<E: Equations>(
    solver: &mut Solver,
    flow: &mut Flow<'_, E>,
    h: f64,
) -> Result<Advance, StepFault> {
    let from = solver.time();
    let limit = flow.limit(from, h);
    flow.begin = flow.start + from;
    let starts = flow.signals(from, solver.state(), true);
    let advance = solver.advance(flow, limit)?;
    let to = solver.time();
    let ends = flow.signals(to, solver.state(), false);
    let times = (flow.start + from, flow.start + to);
    flow.history.push(times, &starts, &ends);
    if advance == Advance::Step && to >= limit && limit < h {
        // The derivative is another one after a jump.
        let state = solver.state().to_vec();
        solver.restart(to, &state, false);
    }
    Ok(advance)
}
