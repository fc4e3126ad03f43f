//! Event mode, and model exchange: states, derivatives, event indicators, time.

use super::{CallError, Instance, MOST, call};
use crate::binding::Functions;
use crate::description::FmiVersion;
use pilotage_abi::fmi2::{EventInfo, FALSE, TRUE};
use pilotage_abi::{fmi2, fmi3};

/// Result of a round of the event iteration (`fmi2NewDiscreteStates`, `fmi3UpdateDiscreteStates`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EventUpdate {
    /// Another round is needed.
    pub needs_another: bool,
    /// The model requests the end of the simulation.
    pub is_end_requested: bool,
    /// The nominal values of the states have changed.
    pub nominals_changed: bool,
    /// The states have changed discontinuously.
    pub states_changed: bool,
    /// Time of the next time event \[s\].
    pub next_time: Option<f64>,
}

/// Result of `fmi2CompletedIntegratorStep` after a step of the solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct IntegratorStep {
    /// There is an event: call [`Instance::enter_event_mode`].
    pub is_event: bool,
    /// The model requests the end of the simulation.
    pub is_end_requested: bool,
}

/// Maximum number of rounds of an event iteration, after which it is considered endless.
pub const MAX_EVENT_ROUNDS: u32 = 1000;

/// Maximum number of event indicators of an instance: a larger number means a damaged FMU and would exhaust memory.
pub const MAX_EVENT_INDICATORS: usize = 100_000;

impl Instance {
    /// The event iteration: rounds until none is needed or the end is requested (`fmi2NewDiscreteStates`: FMI 2.0.5,
    /// section 3.2.2; `fmi3UpdateDiscreteStates`). Changes of all rounds are combined; the next time event is that of
    /// the last round.
    ///
    /// `None` if it does not end within [`MAX_EVENT_ROUNDS`].
    pub fn iterate_event(&mut self) -> Result<Option<EventUpdate>, CallError> {
        let mut combined = EventUpdate::default();
        for _ in 0..MAX_EVENT_ROUNDS {
            let update = self.update_discrete_states()?;
            combined = EventUpdate {
                nominals_changed: combined.nominals_changed || update.nominals_changed,
                states_changed: combined.states_changed || update.states_changed,
                ..update
            };
            if update.is_end_requested || !update.needs_another {
                return Ok(Some(combined));
            }
        }
        Ok(None)
    }

    /// `fmi2EnterEventMode`, `fmi3EnterEventMode`.
    pub fn enter_event_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: the instance is alive and in a state that allows the call, here and below.
        unsafe {
            call!(self, fmi2 EnterEventMode.enter_event_mode(),
                        fmi3 EnterEventMode.enter_event_mode())?;
        }
        self.enter(fmi2::State::EventMode, fmi3::State::EventMode);
        Ok(())
    }

    /// `fmi2NewDiscreteStates`, `fmi3UpdateDiscreteStates`: one round of the event iteration.
    pub fn update_discrete_states(&mut self) -> Result<EventUpdate, CallError> {
        let mut info = EventInfo {
            new_discrete_states_needed: FALSE,
            terminate_simulation: FALSE,
            nominals_of_continuous_states_changed: FALSE,
            values_of_continuous_states_changed: FALSE,
            next_event_time_defined: FALSE,
            next_event_time: f64::INFINITY,
        };
        // Bytes, since a Rust `bool` must be 0 or 1 and an FMU may write other values.
        let mut flags = [0u8; 5];
        let mut next = f64::INFINITY;
        let [again, end, nominals, values, has_next] =
            flags.each_mut().map(|flag| (&raw mut *flag).cast::<bool>());
        // SAFETY: as above, and all pointers are valid for writes.
        unsafe {
            call!(self, fmi2 NewDiscreteStates.new_discrete_states(&raw mut info),
                        fmi3 UpdateDiscreteStates.update_discrete_states(
                            again, end, nominals, values, has_next, &raw mut next))?;
        }
        let update = match &self.loaded.binding.functions {
            Functions::Fmi2(_) => EventUpdate {
                needs_another: info.new_discrete_states_needed != FALSE,
                is_end_requested: info.terminate_simulation != FALSE,
                nominals_changed: info.nominals_of_continuous_states_changed != FALSE,
                states_changed: info.values_of_continuous_states_changed != FALSE,
                next_time: (info.next_event_time_defined != FALSE).then_some(info.next_event_time),
            },
            Functions::Fmi3(_) => EventUpdate {
                needs_another: flags[0] != 0,
                is_end_requested: flags[1] != 0,
                nominals_changed: flags[2] != 0,
                states_changed: flags[3] != 0,
                next_time: (flags[4] != 0).then_some(next),
            },
        };
        match update.next_time {
            Some(time) if time.is_nan() => Err(CallError::Absurd {
                function: match self.version() {
                    FmiVersion::V2 => fmi2::Function::NewDiscreteStates.into(),
                    FmiVersion::V3 => fmi3::Function::UpdateDiscreteStates.into(),
                },
                what: "NaN as the time of the next event".to_owned(),
            }),
            _ => Ok(update),
        }
    }

    /// `fmi3EvaluateDiscreteStates`: updates discrete states for new inputs, without ending the iteration.
    pub fn evaluate_discrete_states(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe { call!(self, fmi3 EvaluateDiscreteStates.evaluate_discrete_states()) }
    }

    /// `fmi3EnterStepMode`: ends event handling; steps may follow.
    pub fn enter_step_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe { call!(self, fmi3 EnterStepMode.enter_step_mode())? };
        self.enter(fmi2::State::StepComplete, fmi3::State::StepMode);
        Ok(())
    }

    /// `fmi2EnterContinuousTimeMode`, `fmi3EnterContinuousTimeMode`.
    pub fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe {
            call!(self, fmi2 EnterContinuousTimeMode.enter_continuous_time_mode(),
                        fmi3 EnterContinuousTimeMode.enter_continuous_time_mode())?;
        }
        self.enter(
            fmi2::State::ContinuousTimeMode,
            fmi3::State::ContinuousTimeMode,
        );
        Ok(())
    }

    /// `fmi2CompletedIntegratorStep`, `fmi3CompletedIntegratorStep`. `is_final`: the simulation will not return to a
    /// time before this one.
    pub fn completed_integrator_step(
        &mut self,
        is_final: bool,
    ) -> Result<IntegratorStep, CallError> {
        let (mut event2, mut end2) = (FALSE, FALSE);
        let (mut event3, mut end3) = (0u8, 0u8);
        let is_final2 = if is_final { TRUE } else { FALSE };
        // SAFETY: as above, and all pointers are valid for writes.
        unsafe {
            call!(self, fmi2 CompletedIntegratorStep.completed_integrator_step(
                            is_final2, &raw mut event2, &raw mut end2),
                        fmi3 CompletedIntegratorStep.completed_integrator_step(
                            is_final, (&raw mut event3).cast(), (&raw mut end3).cast()))?;
        }
        Ok(IntegratorStep {
            is_event: event2 != FALSE || event3 != 0,
            is_end_requested: end2 != FALSE || end3 != 0,
        })
    }

    /// `fmi2SetTime`, `fmi3SetTime` \[s\].
    pub fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        self.place.at(time);
        // SAFETY: as above.
        unsafe { call!(self, fmi2 SetTime.set_time(time), fmi3 SetTime.set_time(time)) }
    }

    /// `fmi2SetContinuousStates`, `fmi3SetContinuousStates`.
    ///
    /// # Panics
    /// If the numbers of values and states differ, here and in the calls below.
    pub fn set_continuous_states(&mut self, values: &[f64]) -> Result<(), CallError> {
        self.check_states(values.len());
        if values.is_empty() {
            return Ok(());
        }
        let (v, n) = (values.as_ptr(), values.len());
        // SAFETY: as above, and there are `n` values, here and below.
        unsafe {
            call!(self, fmi2 SetContinuousStates.set_continuous_states(v, n),
                        fmi3 SetContinuousStates.set_continuous_states(v, n))
        }
    }

    /// `fmi2GetContinuousStates`, `fmi3GetContinuousStates`.
    pub fn get_continuous_states(&mut self, values: &mut [f64]) -> Result<(), CallError> {
        self.check_states(values.len());
        if values.is_empty() {
            return Ok(());
        }
        let n = values.len();
        let functions = (
            Some(fmi2::Function::GetContinuousStates),
            fmi3::Function::GetContinuousStates,
        );
        // SAFETY: as above.
        self.guarded(values, functions, |own, v| unsafe {
            call!(own, fmi2 GetContinuousStates.get_continuous_states(v, n),
                        fmi3 GetContinuousStates.get_continuous_states(v, n))
        })
    }

    /// `fmi2GetDerivatives`, `fmi3GetContinuousStateDerivatives`.
    pub fn get_derivatives(&mut self, values: &mut [f64]) -> Result<(), CallError> {
        self.check_states(values.len());
        if values.is_empty() {
            return Ok(());
        }
        let n = values.len();
        let functions = (
            Some(fmi2::Function::GetDerivatives),
            fmi3::Function::GetContinuousStateDerivatives,
        );
        // SAFETY: as above.
        self.guarded(values, functions, |own, v| unsafe {
            call!(own, fmi2 GetDerivatives.get_derivatives(v, n),
                        fmi3 GetContinuousStateDerivatives.get_continuous_state_derivatives(v, n))
        })
    }

    /// `fmi2GetNominalsOfContinuousStates`, `fmi3GetNominalsOfContinuousStates`.
    pub fn get_nominals(&mut self, values: &mut [f64]) -> Result<(), CallError> {
        self.check_states(values.len());
        if values.is_empty() {
            return Ok(());
        }
        let n = values.len();
        let functions = (
            Some(fmi2::Function::GetNominalsOfContinuousStates),
            fmi3::Function::GetNominalsOfContinuousStates,
        );
        // SAFETY: as above.
        self.guarded(values, functions, |own, v| unsafe {
            call!(own, fmi2 GetNominalsOfContinuousStates.get_nominals_of_continuous_states(v, n),
                        fmi3 GetNominalsOfContinuousStates.get_nominals_of_continuous_states(v, n))
        })
    }

    /// `fmi2GetEventIndicators`, `fmi3GetEventIndicators`.
    ///
    /// # Panics
    /// If the numbers of values and indicators differ.
    pub fn get_event_indicators(&mut self, values: &mut [f64]) -> Result<(), CallError> {
        assert_eq!(values.len(), self.facts.indicators, "event indicators");
        if values.is_empty() {
            return Ok(());
        }
        let n = values.len();
        let functions = (
            Some(fmi2::Function::GetEventIndicators),
            fmi3::Function::GetEventIndicators,
        );
        // SAFETY: as above.
        self.guarded(values, functions, |own, v| unsafe {
            call!(own, fmi2 GetEventIndicators.get_event_indicators(v, n),
                        fmi3 GetEventIndicators.get_event_indicators(v, n))
        })
    }

    /// Number of continuous states: that of the description's derivatives, or `fmi3GetNumberOfContinuousStates`, since
    /// structural parameters change it.
    ///
    /// # Errors
    /// Errors of the call; also if the description, without structural parameters, lists another number.
    pub fn number_of_continuous_states(&mut self) -> Result<usize, CallError> {
        if let Functions::Fmi3(_) = self.loaded.binding.functions {
            let mut n = 0usize;
            // SAFETY: as above.
            unsafe {
                call!(self, fmi3 GetNumberOfContinuousStates.get_number_of_continuous_states(&raw mut n))?;
            }
            let functions = (
                fmi2::Function::GetContinuousStates,
                fmi3::Function::GetNumberOfContinuousStates,
            );
            self.check_number(n, self.facts.listed_states, functions)?;
            self.facts.states = n;
        }
        Ok(self.facts.states)
    }

    /// Number of event indicators: that of the description, or `fmi3GetNumberOfEventIndicators`.
    ///
    /// # Errors
    /// As for [`Self::number_of_continuous_states`].
    pub fn number_of_event_indicators(&mut self) -> Result<usize, CallError> {
        if let Functions::Fmi3(_) = self.loaded.binding.functions {
            let mut n = 0usize;
            // SAFETY: as above.
            unsafe {
                call!(self, fmi3 GetNumberOfEventIndicators.get_number_of_event_indicators(&raw mut n))?;
            }
            let functions = (
                fmi2::Function::GetEventIndicators,
                fmi3::Function::GetNumberOfEventIndicators,
            );
            self.check_number(n, self.facts.listed_indicators, functions)?;
            self.facts.indicators = n;
        }
        Ok(self.facts.indicators)
    }

    fn check_number(
        &self,
        reported: usize,
        listed: Option<usize>,
        functions: (fmi2::Function, fmi3::Function),
    ) -> Result<(), CallError> {
        match listed {
            _ if reported > MOST => Err(self.absurd(functions, format!("{reported}"))),
            Some(listed) if listed != reported => {
                let what = format!("{reported}, where its description lists {listed}");
                Err(self.absurd(functions, what))
            }
            _ => Ok(()),
        }
    }

    fn check_states(&self, values: usize) {
        assert_eq!(values, self.facts.states, "continuous states");
    }
}
