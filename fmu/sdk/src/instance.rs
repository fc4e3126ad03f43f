//! One instance of an FMU, without the calling order of a version of FMI: the safe code that the C functions call.

use crate::checkpoint::Checkpoint;
use crate::clock::Clock;
use crate::problem::Problem;
use crate::simulation::{Reached, SetError};
use crate::structure::{Structure, Unknown};
use crate::variable::{Role, index_of};
use crate::{Equations, Simulation, Variable};
use std::cell::OnceCell;

/// Purpose of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InterfaceType {
    /// The instance solves its equations itself.
    CoSimulation,
    /// The importer solves the equations.
    ModelExchange,
}

impl InterfaceType {
    /// Name.
    pub fn name(self) -> &'static str {
        match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "model exchange",
        }
    }
}

/// What may be set, and which variables are knowns and unknowns, in a state of the instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Before the simulation: all variables that are not calculated may be set, and are knowns.
    Start,
    /// Between steps and at events: inputs and tunable parameters may be set.
    Event,
    /// Model exchange, between events: inputs may be set.
    Continuous,
}

/// Times and accuracy of the simulation.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// Relative tolerance, if defined.
    pub tolerance: Option<f64>,
    /// Start time \[s\].
    pub start: f64,
    /// Stop time, if defined \[s\].
    pub stop: Option<f64>,
}

impl Experiment {
    /// Refuses times and tolerances that are none.
    ///
    /// # Errors
    /// With the argument's name.
    pub fn check(&self) -> Result<(), Problem> {
        let refuse = |name, value, expected| Problem::Experiment {
            name,
            value,
            expected,
        };
        let Self { start, .. } = *self;
        if !start.is_finite() {
            return Err(refuse("startTime", start, "pass a finite number"));
        }
        if let Some(stop) = (self.stop).filter(|stop| !(stop.is_finite() && *stop >= start)) {
            let expected = "pass a number not before startTime";
            return Err(refuse("stopTime", stop, expected));
        }
        let is_possible = |own: &f64| own.is_finite() && *own > 0.0;
        match self.tolerance.filter(|own| !is_possible(own)) {
            Some(own) => Err(refuse("tolerance", own, "pass a number greater than 0")),
            None => Ok(()),
        }
    }
}

/// The model with everything that an FMU adds to it.
#[derive(Debug)]
pub struct Instance<E> {
    /// Purpose.
    pub kind: InterfaceType,
    guid: String,
    /// Present after an experiment is set up.
    clock: Option<Clock>,
    simulation: Simulation<E>,
    /// Computed on first use.
    structure: OnceCell<Structure>,
}

/// Value references in the standard's type.
pub type References<'r> = &'r [u32];

impl<E: Equations> Instance<E> {
    /// An instance of the model, at its start values.
    pub fn new(equations: E, kind: InterfaceType) -> Self {
        let simulation = Simulation::new(equations);
        // An importer that solves the equations knows states alone.
        let simulation = match kind {
            InterfaceType::CoSimulation => simulation,
            InterfaceType::ModelExchange => simulation.with_states_for_delays(),
        };
        Self {
            kind,
            guid: simulation.table().guid(),
            clock: None,
            simulation,
            structure: OnceCell::new(),
        }
    }

    /// GUID of the FMU.
    pub fn guid(&self) -> &str {
        &self.guid
    }

    /// The running model.
    pub fn simulation(&self) -> &Simulation<E> {
        &self.simulation
    }

    /// Sets up an experiment.
    pub fn setup(&mut self, experiment: Experiment) -> Result<(), Problem> {
        experiment.check()?;
        if let Some(tolerance) = experiment.tolerance {
            self.simulation.set_tolerance(tolerance);
        }
        self.clock = Some(Clock::new(experiment.start, experiment.stop));
        self.simulation.set_time(experiment.start);
        Ok(())
    }

    /// Checks that an experiment is set up.
    pub fn check_setup(&self) -> Result<(), Problem> {
        self.clock.map(|_| ()).ok_or(Problem::NoExperiment)
    }

    /// Restores the state after instantiation.
    pub fn reset(&mut self) {
        self.simulation.reset();
        self.clock = None;
    }

    /// Values of real variables.
    pub fn get(&self, references: References<'_>, values: &mut [f64]) -> Result<(), Problem> {
        for reference in references {
            self.typed(*reference, false)?;
        }
        let indices = references.iter().map(|reference| index_of(*reference));
        self.simulation.get_all(indices, values);
        match values.iter().position(|value| !value.is_finite()) {
            Some(k) => self.explained(index_of(references[k]), values[k]),
            None => Ok(()),
        }
    }

    /// Rejects a value that is not finite if the equations give the cause; otherwise it may be intended.
    fn explained(&self, index: usize, value: f64) -> Result<(), Problem> {
        match self.simulation.trouble() {
            Some(cause) => Err(Problem::NotFinite {
                cause: Some(cause),
                name: self.simulation.table().variables()[index].label(),
                value,
                time: self.time(),
            }),
            None => Ok(()),
        }
    }

    /// Value of a Boolean variable.
    pub fn get_boolean(&self, reference: u32) -> Result<bool, Problem> {
        let (index, _) = self.typed(reference, true)?;
        Ok(self.simulation.get(index) != 0.0)
    }

    /// Sets a Boolean variable, before the simulation.
    pub fn set_boolean(
        &mut self,
        reference: u32,
        value: bool,
        phase: Phase,
        state: &'static str,
    ) -> Result<(), Problem> {
        let (index, variable) = self.typed(reference, true)?;
        if phase != Phase::Start {
            return Err(Problem::Fixed {
                name: variable.label(),
                role: "changed by events alone",
                state,
                when: "before initialization mode ends",
            });
        }
        let value = f64::from(u8::from(value));
        Ok(self.simulation.set(index, value)?)
    }

    /// Sets real inputs and, in the phases that allow it, parameters.
    pub fn set(
        &mut self,
        references: References<'_>,
        values: &[f64],
        phase: Phase,
        state: &'static str,
    ) -> Result<(), Problem> {
        for (reference, value) in references.iter().zip(values) {
            let (index, variable) = self.typed(*reference, false)?;
            let refuse = |role, when| {
                Err(Problem::Fixed {
                    name: variable.label(),
                    role,
                    state,
                    when,
                })
            };
            match (variable.role, phase) {
                (Role::Fixed, Phase::Event | Phase::Continuous) => {
                    return refuse("fixed", "before initialization mode ends");
                }
                (Role::Tunable, Phase::Continuous) => return refuse("tunable", "in event mode"),
                _ => self.simulation.set(index, *value).map_err(|error| {
                    // A solver may try again with another step.
                    let may_retry =
                        self.kind == InterfaceType::ModelExchange && phase != Phase::Start;
                    match (may_retry, error) {
                        (true, SetError::Value(error)) => Problem::Refused(error),
                        (_, error) => Problem::Set(error),
                    }
                })?,
            }
        }
        Ok(())
    }

    /// Time derivatives of inputs for the next step.
    pub fn set_slopes(
        &mut self,
        references: References<'_>,
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), Problem> {
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let (index, variable) = self.variable(*reference)?;
            check_order(variable, *order)?;
            self.simulation.set_slope(index, *value)?;
        }
        Ok(())
    }

    /// Values of the inputs.
    pub fn inputs(&self) -> &[f64] {
        let simulation = &self.simulation;
        &simulation.snapshot().values[simulation.table().inputs()]
    }

    /// Makes the inputs change linearly from `before` to their current values in the next step of `h` \[s\].
    pub fn lead_inputs(&mut self, before: &[f64], h: f64) -> Result<(), Problem> {
        let inputs = self.simulation.table().inputs();
        for (index, &begin) in inputs.zip(before) {
            let end = self.simulation.get(index);
            self.simulation.set(index, begin)?;
            self.simulation.set_slope(index, (end - begin) / h)?;
        }
        Ok(())
    }

    /// Time derivatives of outputs at the end of the last step.
    pub fn get_slopes(
        &self,
        references: References<'_>,
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), Problem> {
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let (index, variable) = self.typed(*reference, false)?;
            check_order(variable, *order)?;
            if !variable.is_output() {
                return Err(Problem::NoOutput {
                    name: variable.label(),
                });
            }
            *value = self.simulation.output_derivative(index);
        }
        Ok(())
    }

    /// `Σ ∂unknown/∂known · seed` for each unknown.
    pub fn directional_derivative(
        &self,
        unknowns: References<'_>,
        knowns: References<'_>,
        seed: &[f64],
        result: &mut [f64],
        at: (Phase, &'static str),
    ) -> Result<(), Problem> {
        let unknowns = self.unknowns(unknowns, at)?;
        let knowns = self.knowns(knowns, at)?;
        let table = self.simulation.table();
        // Who asks for those of states linearises the FMU, and needs the states that approximate delays.
        let is_linear = |index: &usize| {
            table.state_at(*index).is_some() || table.derivatives().any(|own| own == *index)
        };
        let is_linear = unknowns.iter().chain(&knowns).any(is_linear);
        let seeds: Vec<_> = knowns.into_iter().zip(seed.iter().copied()).collect();
        result.copy_from_slice(&match is_linear {
            true => self.simulation.linear_derivative(&unknowns, &seeds),
            false => self.simulation.directional_derivative(&unknowns, &seeds),
        });
        Ok(())
    }

    /// `Σ seed · ∂unknown/∂known` for each known.
    pub fn adjoint_derivative(
        &self,
        unknowns: References<'_>,
        knowns: References<'_>,
        seed: &[f64],
        result: &mut [f64],
        at: (Phase, &'static str),
    ) -> Result<(), Problem> {
        let unknowns = self.unknowns(unknowns, at)?;
        let knowns = self.knowns(knowns, at)?;
        let seeds: Vec<_> = unknowns.into_iter().zip(seed.iter().copied()).collect();
        result.copy_from_slice(&self.simulation.adjoint_derivative(&seeds, &knowns));
        Ok(())
    }

    /// Dependencies of an unknown: while the simulation runs or, for states, at its start.
    pub fn dependencies(&self, reference: u32, state: &'static str) -> Result<&Unknown, Problem> {
        let (index, variable) = self.variable(reference)?;
        let simulation = &self.simulation;
        let structure = self
            .structure
            .get_or_init(|| Structure::of(simulation.model(), simulation.table()));
        let initial = || structure.initial.iter().find(|u| u.index == index);
        structure
            .unknown(index)
            .or_else(initial)
            .ok_or_else(|| Problem::NoUnknown {
                name: variable.label(),
                state,
            })
    }

    /// One step of co-simulation, on request only up to the first event.
    pub fn step(&mut self, time: f64, step: f64, stop_at_event: bool) -> Result<Reached, Problem> {
        let clock = self.clock.ok_or(Problem::NoExperiment)?;
        let (step, next) = clock.advance(time, step)?;
        self.simulation.set_time(clock.time);
        let advanced = self.simulation.advance(step, stop_at_event);
        let (reached, complete) = match &advanced {
            Ok(reached) => (reached.time, reached.time == step),
            Err(error) => (error.reached, false),
        };
        let clock = match complete {
            true => next,
            false if reached > 0.0 => clock.moved_to(clock.time + reached),
            false => clock,
        };
        self.simulation.set_time(clock.time);
        self.clock = Some(clock);
        advanced.map_err(|source| Problem::Step { time, source })
    }

    /// Time \[s\]: the last communication point, or what the importer set.
    pub fn time(&self) -> f64 {
        self.clock.map_or(0.0, |clock| clock.time)
    }

    /// Handles pending events. Returns whether a state has changed.
    pub fn handle_event(&mut self) -> Result<bool, Problem> {
        self.simulation.handle_event().map_err(Problem::Event)
    }

    /// The next time at which a condition on time changes, after events were handled.
    pub fn next_event(&self) -> Option<f64> {
        self.simulation.next_time_event()
    }

    /// Model exchange: sets the time.
    pub fn set_time(&mut self, time: f64) -> Result<(), Problem> {
        let clock = self.clock.as_mut().ok_or(Problem::NoExperiment)?;
        let start = clock.anchor;
        if !(time.is_finite() && time >= start) {
            return Err(Problem::Time { time, start });
        }
        clock.time = time;
        self.simulation.set_time(time);
        Ok(())
    }

    /// Model exchange: sets the states.
    pub fn set_states(&mut self, states: &[f64]) -> Result<(), Problem> {
        let variables = self.simulation.table().states();
        self.check(states, variables, "nx")?;
        self.simulation.set_states(states);
        Ok(())
    }

    /// Model exchange: the states.
    pub fn get_states(&self, states: &mut [f64]) -> Result<(), Problem> {
        check_number("nx", states.len(), self.simulation.table().n_states())?;
        let n = states.len();
        states.copy_from_slice(&self.simulation.snapshot().states[..n]);
        Ok(())
    }

    /// Model exchange: typical magnitudes of the states.
    pub fn nominals(&self, nominals: &mut [f64]) -> Result<(), Problem> {
        check_number("nx", nominals.len(), self.simulation.table().n_states())?;
        nominals.copy_from_slice(&self.simulation.table().nominals());
        Ok(())
    }

    /// Model exchange: the derivatives of the states.
    pub fn derivatives(&self, derivatives: &mut [f64]) -> Result<(), Problem> {
        let table = self.simulation.table();
        check_number("nx", derivatives.len(), table.n_states())?;
        self.simulation.derivatives(derivatives);
        self.check(derivatives, table.derivatives(), "nx")
    }

    /// Model exchange: the event indicators.
    pub fn indicators(&self, indicators: &mut [f64]) -> Result<(), Problem> {
        let expected = self.simulation.table().n_indicators();
        check_number("ni", indicators.len(), expected)?;
        self.simulation.indicators(indicators);
        Ok(())
    }

    /// A copy of the instance, with the given state of the calling order.
    pub fn checkpoint(&self, version: u8, state: u16) -> Checkpoint {
        Checkpoint {
            guid: self.guid.clone(),
            version,
            kind: self.kind,
            state,
            clock: self.clock,
            snapshot: self.simulation.snapshot().clone(),
        }
    }

    /// Restores a copy.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), Problem> {
        if checkpoint.guid != self.guid {
            return Err(Problem::ForeignState {
                found: checkpoint.guid.clone(),
                expected: self.guid.clone(),
            });
        }
        if checkpoint.kind != self.kind {
            return Err(Problem::WrongKind {
                needed: checkpoint.kind.name(),
                found: self.kind.name(),
            });
        }
        self.clock = checkpoint.clock;
        self.simulation.restore(&checkpoint.snapshot);
        Ok(())
    }

    /// Rejects a wrong number of values, and values that are not finite.
    fn check(
        &self,
        values: &[f64],
        variables: impl Iterator<Item = usize>,
        argument: &'static str,
    ) -> Result<(), Problem> {
        let table = self.simulation.table();
        check_number(argument, values.len(), table.n_states())?;
        for (index, value) in variables.zip(values) {
            if !value.is_finite() {
                return Err(Problem::NotFinite {
                    cause: self.simulation.trouble(),
                    name: table.variables()[index].label(),
                    value: *value,
                    time: self.time(),
                });
            }
        }
        Ok(())
    }

    fn variable(&self, reference: u32) -> Result<(usize, &Variable), Problem> {
        let variables = self.simulation.table().variables();
        let index = index_of(reference);
        match variables.get(index) {
            Some(variable) => Ok((index, variable)),
            None => Err(Problem::NoVariable {
                reference,
                last: variables.len(),
            }),
        }
    }

    /// As [`variable`](Self::variable), and checks the type.
    fn typed(&self, reference: u32, boolean: bool) -> Result<(usize, &Variable), Problem> {
        let (index, variable) = self.variable(reference)?;
        match variable.is_boolean() == boolean {
            true => Ok((index, variable)),
            false => Err(Problem::OtherType {
                name: variable.label(),
                found: if boolean { "real" } else { "Boolean" },
            }),
        }
    }

    /// Indices of unknowns: outputs and derivatives, before the simulation also states (FMI 2.0.5, section 2.1.9).
    fn unknowns(
        &self,
        references: References<'_>,
        (phase, state): (Phase, &'static str),
    ) -> Result<Vec<usize>, Problem> {
        let index = |reference: &u32| {
            let (index, variable) = self.variable(*reference)?;
            let unknown = match variable.role {
                Role::Output | Role::Derivative | Role::Indicator => true,
                Role::State => phase == Phase::Start,
                _ => false,
            };
            unknown.then_some(index).ok_or_else(|| Problem::NoUnknown {
                name: variable.label(),
                state,
            })
        };
        mapped(references, index)
    }

    /// Indices of knowns: inputs; before the simulation parameters and start values, later states.
    fn knowns(
        &self,
        references: References<'_>,
        (phase, state): (Phase, &'static str),
    ) -> Result<Vec<usize>, Problem> {
        let index = |reference: &u32| {
            let (index, variable) = self.variable(*reference)?;
            let is_state = self.simulation.table().state_at(index).is_some();
            let known = match variable.role {
                Role::Input => true,
                Role::Fixed | Role::Tunable => phase == Phase::Start,
                _ => is_state && phase != Phase::Start,
            };
            known.then_some(index).ok_or_else(|| Problem::NoKnown {
                name: variable.label(),
                state,
            })
        };
        mapped(references, index)
    }
}

/// Each reference mapped, or the first error. A collected `Result` would not know its length, and grow.
fn mapped(
    references: References<'_>,
    of: impl Fn(&u32) -> Result<usize, Problem>,
) -> Result<Vec<usize>, Problem> {
    let mut all = Vec::with_capacity(references.len());
    for reference in references.iter() {
        all.push(of(reference)?);
    }
    Ok(all)
}

fn check_order(variable: &Variable, order: i32) -> Result<(), Problem> {
    (order == 1).then_some(()).ok_or_else(|| Problem::Order {
        name: variable.label(),
        order,
    })
}

/// Rejects a wrong number of values.
pub fn check_number(argument: &'static str, found: usize, expected: usize) -> Result<(), Problem> {
    match found == expected {
        true => Ok(()),
        false => Err(Problem::WrongNumber {
            argument,
            found,
            expected,
        }),
    }
}
