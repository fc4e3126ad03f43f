//! One instance of an FMU: safe code under the C functions.

use crate::checkpoint::Checkpoint;
use crate::clock::Clock;
use crate::log::Log;
use crate::problem::Problem;
use pilotage_abi::fmi2::{Function, Integer, Real, State, Status, StatusKind, ValueReference};
use pilotage_models::variable::Role;
use pilotage_models::{Model, Simulation, Variable};

/// What `fmi2Component` points to.
#[derive(Debug)]
pub struct Instance {
    log: Log,
    guid: String,
    state: State,
    /// Present after `fmi2SetupExperiment`.
    clock: Option<Clock>,
    simulation: Simulation,
}

/// What `fmi2SetupExperiment` is told.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// Relative tolerance, if defined.
    pub tolerance: Option<f64>,
    /// Start time [s].
    pub start: f64,
    /// Stop time, if defined [s].
    pub stop: Option<f64>,
}

impl Instance {
    /// An instance of the model, at its start values.
    pub fn new(model: Model, log: Log) -> Self {
        Self {
            log,
            guid: model.guid(),
            state: State::Instantiated,
            clock: None,
            simulation: Simulation::new(model),
        }
    }

    /// Runs the body of a function if it may be called now; reports what went wrong, and goes into
    /// the state that this leads to.
    pub fn call(
        &mut self,
        function: Function,
        body: impl FnOnce(&mut Self) -> Result<(), Problem>,
    ) -> Status {
        let result = match function.is_legal_in(self.state) {
            true => body(self),
            false => Err(Problem::IllegalState {
                function,
                state: self.state,
            }),
        };
        match result {
            Ok(()) => Status::OK,
            Err(problem) => self.fail(function, &problem),
        }
    }

    /// Reports a problem, goes into the state that it leads to, and gives the status to return.
    pub fn fail(&mut self, function: Function, problem: &Problem) -> Status {
        let status = problem.status();
        self.state = match (status, problem) {
            _ if self.state == State::Fatal => State::Fatal,
            (Status::FATAL, _) => State::Fatal,
            (Status::ERROR, _) => State::Error,
            (_, Problem::Step { .. }) => State::StepFailed,
            _ => self.state,
        };
        self.log.report(function, problem);
        status
    }

    /// The log, to be switched.
    pub fn log(&mut self) -> &mut Log {
        &mut self.log
    }

    /// `fmi2SetupExperiment`.
    pub fn setup(&mut self, experiment: Experiment) -> Result<(), Problem> {
        let Experiment {
            tolerance,
            start,
            stop,
        } = experiment;
        let refuse = |name, value, expected| Problem::Experiment {
            name,
            value,
            expected,
        };
        if !start.is_finite() {
            return Err(refuse("startTime", start, "pass a finite number"));
        }
        if let Some(stop) = stop.filter(|stop| !(stop.is_finite() && *stop >= start)) {
            return Err(refuse(
                "stopTime",
                stop,
                "pass a number not before startTime",
            ));
        }
        if let Some(tolerance) = tolerance {
            if !(tolerance.is_finite() && tolerance > 0.0) {
                return Err(refuse(
                    "tolerance",
                    tolerance,
                    "pass a number greater than 0",
                ));
            }
            self.simulation.set_tolerance(tolerance);
        }
        self.clock = Some(Clock::new(start, stop));
        Ok(())
    }

    /// `fmi2EnterInitializationMode`.
    pub fn enter_initialization(&mut self) -> Result<(), Problem> {
        self.clock.ok_or(Problem::NoExperiment)?;
        self.state = State::InitializationMode;
        Ok(())
    }

    /// `fmi2ExitInitializationMode`.
    pub fn exit_initialization(&mut self) {
        self.state = State::StepComplete;
    }

    /// `fmi2Terminate`.
    pub fn terminate(&mut self) {
        self.state = State::Terminated;
    }

    /// `fmi2Reset`: as just instantiated.
    pub fn reset(&mut self) {
        self.simulation.reset();
        self.clock = None;
        self.state = State::Instantiated;
    }

    /// `fmi2GetReal`.
    pub fn get(&self, references: &[ValueReference], values: &mut [Real]) -> Result<(), Problem> {
        for (reference, value) in references.iter().zip(values) {
            let (index, _) = self.variable(*reference)?;
            *value = self.simulation.get(index);
        }
        Ok(())
    }

    /// `fmi2SetReal`.
    pub fn set(&mut self, references: &[ValueReference], values: &[Real]) -> Result<(), Problem> {
        for (reference, value) in references.iter().zip(values) {
            let (index, variable) = self.variable(*reference)?;
            let early = matches!(self.state, State::Instantiated | State::InitializationMode);
            if variable.role == Role::Fixed && !early {
                return Err(Problem::Fixed {
                    name: variable.label(),
                    state: self.state,
                });
            }
            self.simulation.set(index, *value)?;
        }
        Ok(())
    }

    /// `fmi2SetRealInputDerivatives`.
    pub fn set_slopes(
        &mut self,
        references: &[ValueReference],
        orders: &[Integer],
        values: &[Real],
    ) -> Result<(), Problem> {
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let (index, variable) = self.variable(*reference)?;
            check_order(variable, *order)?;
            self.simulation.set_slope(index, *value)?;
        }
        Ok(())
    }

    /// `fmi2GetRealOutputDerivatives`.
    pub fn get_slopes(
        &self,
        references: &[ValueReference],
        orders: &[Integer],
        values: &mut [Real],
    ) -> Result<(), Problem> {
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let (index, variable) = self.variable(*reference)?;
            check_order(variable, *order)?;
            *value = self.simulation.output_derivative(output(index, variable)?);
        }
        Ok(())
    }

    /// `fmi2GetDirectionalDerivative`.
    pub fn directional_derivative(
        &self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[Real],
        result: &mut [Real],
    ) -> Result<(), Problem> {
        let outputs = unknowns
            .iter()
            .map(|reference| {
                let (index, variable) = self.variable(*reference)?;
                output(index, variable)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let seeds = knowns
            .iter()
            .zip(seed)
            .map(|(reference, part)| Ok((self.known(*reference)?, *part)))
            .collect::<Result<Vec<_>, Problem>>()?;
        let derivatives = self.simulation.directional_derivative(&outputs, &seeds);
        result.copy_from_slice(&derivatives);
        Ok(())
    }

    /// `fmi2DoStep`.
    pub fn step(&mut self, time: f64, step: f64) -> Result<(), Problem> {
        let clock = self.clock.ok_or(Problem::NoExperiment)?;
        let (step, next) = clock.advance(time, step)?;
        self.simulation
            .step(step)
            .map_err(|source| Problem::Step { time, source })?;
        self.clock = Some(next);
        Ok(())
    }

    /// `fmi2GetStatus`: how the last step ended.
    pub fn step_status(&self, kind: StatusKind) -> Result<Status, Problem> {
        match (kind, self.state) {
            (StatusKind::DO_STEP_STATUS, State::StepFailed) => Ok(Status::DISCARD),
            (StatusKind::DO_STEP_STATUS, _) => Ok(Status::OK),
            _ => Err(Problem::NoStatus { kind }),
        }
    }

    /// `fmi2GetRealStatus`: how far the last step came [s].
    pub fn last_successful_time(&self, kind: StatusKind) -> Result<f64, Problem> {
        match (kind, self.clock) {
            (StatusKind::LAST_SUCCESSFUL_TIME, Some(clock)) => Ok(clock.time),
            _ => Err(Problem::NoStatus { kind }),
        }
    }

    /// `fmi2GetBooleanStatus`: whether the FMU wants the run to end, which it never does.
    pub fn wants_to_end(&self, kind: StatusKind) -> Result<bool, Problem> {
        match kind {
            StatusKind::TERMINATED => Ok(false),
            _ => Err(Problem::NoStatus { kind }),
        }
    }

    /// `fmi2GetFMUstate`.
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            guid: self.guid.clone(),
            state: self.state,
            clock: self.clock,
            snapshot: self.simulation.snapshot().clone(),
        }
    }

    /// `fmi2SetFMUstate`.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), Problem> {
        if checkpoint.guid != self.guid {
            return Err(Problem::ForeignState {
                found: checkpoint.guid.clone(),
                expected: self.guid.clone(),
            });
        }
        self.state = checkpoint.state;
        self.clock = checkpoint.clock;
        self.simulation.restore(&checkpoint.snapshot);
        Ok(())
    }

    /// `fmi2DeSerializeFMUstate`.
    pub fn deserialize(&self, bytes: &[u8]) -> Result<Checkpoint, Problem> {
        Checkpoint::from_bytes(bytes, self.simulation.model(), &self.guid)
    }

    fn variable(&self, reference: ValueReference) -> Result<(usize, &Variable), Problem> {
        let variables = self.simulation.model().variables();
        let index = reference as usize;
        match variables.get(index) {
            Some(variable) => Ok((index, variable)),
            None => Err(Problem::NoVariable {
                reference,
                last: variables.len() - 1,
            }),
        }
    }

    /// Index of a known: an input, or in initialization mode a parameter (FMI 2.0.5, section 2.1.9).
    fn known(&self, reference: ValueReference) -> Result<usize, Problem> {
        let (index, variable) = self.variable(reference)?;
        let known = match variable.role {
            Role::Input => true,
            Role::Output { .. } => false,
            Role::Fixed | Role::Tunable => self.state == State::InitializationMode,
        };
        known.then_some(index).ok_or_else(|| Problem::NoKnown {
            name: variable.label(),
            state: self.state,
        })
    }
}

fn output(index: usize, variable: &Variable) -> Result<usize, Problem> {
    variable
        .is_output()
        .then_some(index)
        .ok_or_else(|| Problem::NoOutput {
            name: variable.label(),
        })
}

fn check_order(variable: &Variable, order: Integer) -> Result<(), Problem> {
    (order == 1).then_some(()).ok_or_else(|| Problem::Order {
        name: variable.label(),
        order,
    })
}
