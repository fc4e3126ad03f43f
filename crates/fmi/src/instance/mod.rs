//! An instance of an FMU of FMI 2.0 or 3.0; its functions are safe to call in any order.
//!
//! | file | functions |
//! | --- | --- |
//! | `start`, `callbacks` | instantiation |
//! | `mod` | experiment, initialization, termination, reset, configuration mode, debug logging |
//! | `values` | getting and setting variables |
//! | `stepping` | `doStep`, asynchronous steps |
//! | `events` | event mode, continuous-time mode and other functions of model exchange |
//! | `derivatives` | directional and adjoint; time derivatives of inputs and outputs |
//! | `clocks` | intervals and shifts of clocks, model partitions, dependencies (FMI 3.0) |
//! | `states` | saving and restoring |

mod call;
mod callbacks;
mod clocks;
mod derivatives;
mod error;
mod events;
mod start;
mod states;
mod stepping;
mod values;

pub use clocks::{Dependency, Fraction, Interval};
pub use error::CallError;
pub use events::{EventUpdate, IntegratorStep, MAX_EVENT_INDICATORS, MAX_EVENT_ROUNDS};
pub use start::InstanceOptions;
pub use states::{Saved, Serialized};
pub use stepping::Step;
pub use values::Number;

use self::call::call;
use self::callbacks::Callbacks;
use self::start::Facts;
use crate::binding::{Functions, Loaded};
use crate::description::FmiVersion;
use crate::environment::Registered;
use crate::memory::PoisonedTexts;
use crate::message::Message;
use crate::version::{InterfaceType, State};
use pilotage_abi::fmi2::{FALSE, FmuState, TRUE};
use pilotage_abi::{fmi2, fmi3};
use pilotage_process::Place;
use std::ffi::{CString, c_char, c_void};
use std::sync::Arc;

/// Maximum number of states, indicators or dependencies accepted: an FMU may return any number.
const MOST: usize = 1 << 26;

/// An instance of an FMU.
///
/// Calls are checked against the standard's state machine (FMI 2.0, sections 3.2.3 and 4.2.4; FMI 3.0, sections 2.3,
/// 3.3, 4.3 and 5.3) before they are made. After a fatal error no function is called any more, not even that which
/// frees the instance.
///
/// # Foreign code
/// Nearly every function here calls the FMU, and so does the drop: see the [crate's page](crate#foreign-code).
#[derive(Debug)]
pub struct Instance {
    loaded: Arc<Loaded>,
    component: *mut c_void,
    /// Identifies the instance to the watching process.
    place: Place,
    /// Buffer of numbers that the FMU writes, with guard values at its end.
    room: Vec<u64>,
    /// The last value of `lastSuccessfulTime` (FMI 3.0) \[s\]; NaN without one.
    last_successful: f64,
    /// The FMU may keep their address.
    _callbacks: Option<Callbacks>,
    /// Freed after the FMU's instance, which may wrongly keep these addresses.
    _texts: PoisonedTexts,
    environment: Registered,
    kind: InterfaceType,
    state: State,
    facts: Facts,
    /// The state after initialization or reconfiguration (FMI 3.0).
    running: fmi3::State,
    /// Arguments of `fmi3EnterInitializationMode`, which replaces `fmi2SetupExperiment`.
    experiment: Experiment,
    saved: Vec<FmuState>,
    /// The FMU's message about the last call that it did not complete.
    words: Option<String>,
}

/// Tolerance, start and stop time.
#[derive(Debug, Clone, Copy, Default)]
struct Experiment {
    tolerance: Option<f64>,
    start: f64,
    stop: Option<f64>,
}

// SAFETY: by the standard an instance may be called from any thread, but not from two at once (FMI 2.0, section 2.1.5;
// FMI 3.0, section 2.2.3), which `&mut self` prevents; `&self` calls nothing.
unsafe impl Send for Instance {}

impl Instance {
    /// The FMI version of the FMU.
    #[inline]
    pub fn version(&self) -> FmiVersion {
        match self.state {
            State::Fmi2(_) => FmiVersion::V2,
            State::Fmi3(_) => FmiVersion::V3,
        }
    }

    /// Its interface type.
    pub fn kind(&self) -> InterfaceType {
        self.kind
    }

    /// Its current state.
    #[inline]
    pub fn state(&self) -> State {
        self.state
    }

    /// Takes the messages that the FMU has sent since the last call.
    pub fn take_messages(&self) -> Vec<Message> {
        self.environment.take()
    }

    /// `fmi2SetDebugLogging`, `fmi3SetDebugLogging`: selects the categories to be logged; empty for all.
    ///
    /// # Errors
    /// See [`CallError`], here and in all calls below.
    pub fn set_debug_logging(&mut self, on: bool, categories: &[&str]) -> Result<(), CallError> {
        let names = categories.iter().map(|name| c_string(name));
        let names: Vec<CString> = names.collect::<Result<_, _>>()?;
        let pointers: Vec<*const c_char> = names.iter().map(|n| n.as_ptr()).collect();
        let (n, p) = (pointers.len(), pointers.as_ptr());
        let on2 = if on { TRUE } else { FALSE };
        // SAFETY: the instance is alive; there are `n` strings, which live until the call returns.
        unsafe {
            call!(self, fmi2 SetDebugLogging.set_debug_logging(on2, n, p),
                        fmi3 SetDebugLogging.set_debug_logging(on, n, p))
        }
    }

    /// `fmi2SetupExperiment`; for FMI 3.0 the values are passed when initialization begins.
    pub fn setup_experiment(
        &mut self,
        tolerance: Option<f64>,
        start: f64,
        stop: impl Into<Option<f64>>,
    ) -> Result<(), CallError> {
        let stop = stop.into();
        self.experiment = Experiment {
            tolerance,
            start,
            stop,
        };
        if self.version() == FmiVersion::V3 {
            return Ok(());
        }
        let defined = |value: Option<f64>| if value.is_some() { TRUE } else { FALSE };
        // SAFETY: the instance is alive and in a state that allows the call, here and in the calls below.
        unsafe {
            call!(self, fmi2 SetupExperiment.setup_experiment(
                defined(tolerance), tolerance.unwrap_or(0.0), start, defined(stop), stop.unwrap_or(0.0)))
        }
    }

    /// `fmi2EnterInitializationMode`, `fmi3EnterInitializationMode`.
    pub fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        let Experiment {
            tolerance,
            start,
            stop,
        } = self.experiment;
        // SAFETY: as above.
        unsafe {
            call!(self, fmi2 EnterInitializationMode.enter_initialization_mode(),
                fmi3 EnterInitializationMode.enter_initialization_mode(
                    tolerance.is_some(), tolerance.unwrap_or(0.0), start,
                    stop.is_some(), stop.unwrap_or(0.0)))?;
        }
        self.enter(
            fmi2::State::InitializationMode,
            fmi3::State::InitializationMode,
        );
        Ok(())
    }

    /// `fmi2ExitInitializationMode`, `fmi3ExitInitializationMode`. The next state is the first communication point
    /// (co-simulation), event mode (model exchange, and co-simulation with [`InstanceOptions::event_mode_used`]) or
    /// clock activation mode.
    pub fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe {
            call!(self, fmi2 ExitInitializationMode.exit_initialization_mode(),
                        fmi3 ExitInitializationMode.exit_initialization_mode())?;
        }
        let state2 = match self.kind {
            InterfaceType::ModelExchange => fmi2::State::EventMode,
            InterfaceType::CoSimulation | InterfaceType::ScheduledExecution => {
                fmi2::State::StepComplete
            }
        };
        self.enter(state2, self.running);
        Ok(())
    }

    /// `fmi3EnterConfigurationMode`: allows setting structural parameters.
    pub fn enter_configuration_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe { call!(self, fmi3 EnterConfigurationMode.enter_configuration_mode())? };
        if let State::Fmi3(state) = self.state {
            if state == fmi3::State::Instantiated {
                self.state = State::Fmi3(fmi3::State::ConfigurationMode);
            } else {
                self.running = state;
                self.state = State::Fmi3(fmi3::State::ReconfigurationMode);
            }
        }
        Ok(())
    }

    /// `fmi3ExitConfigurationMode`: returns to the previous state.
    pub fn exit_configuration_mode(&mut self) -> Result<(), CallError> {
        let is_first = self.state == State::Fmi3(fmi3::State::ConfigurationMode);
        // SAFETY: as above.
        unsafe { call!(self, fmi3 ExitConfigurationMode.exit_configuration_mode())? };
        self.state = State::Fmi3(match is_first {
            true => fmi3::State::Instantiated,
            false => self.running,
        });
        Ok(())
    }

    /// `fmi2Terminate`, `fmi3Terminate`.
    pub fn terminate(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe { call!(self, fmi2 Terminate.terminate(), fmi3 Terminate.terminate())? };
        self.enter(fmi2::State::Terminated, fmi3::State::Terminated);
        Ok(())
    }

    /// `fmi2Reset`, `fmi3Reset`.
    pub fn reset(&mut self) -> Result<(), CallError> {
        // SAFETY: as above.
        unsafe { call!(self, fmi2 Reset.reset(), fmi3 Reset.reset())? };
        self.enter(fmi2::State::Instantiated, fmi3::State::Instantiated);
        self.running = start::running(self.kind, self.facts.event_mode_used);
        Ok(())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        self.end_pending_step();
        self.free_saved();
        // SAFETY: the instance is alive and is not called again.
        unsafe {
            match &self.loaded.binding.functions {
                Functions::Fmi2(f) => {
                    let function = fmi2::Function::FreeInstance.into();
                    let free = self.ready(function, f.free_instance);
                    let _ = free.map(|free| self.during(function, || free(self.component)));
                }
                Functions::Fmi3(f) => {
                    let function = fmi3::Function::FreeInstance.into();
                    let free = self.ready(function, f.free_instance);
                    let _ = free.map(|free| self.during(function, || free(self.component)));
                }
            }
        }
    }
}

fn c_string(text: &str) -> Result<CString, CallError> {
    CString::new(text).map_err(|_| CallError::Nul {
        text: text.to_owned(),
    })
}
