//! Instances of an FMU, each initialised with certain parameters.

use crate::layout::Layout;
use pilotage_fmi::fmu::Library;
use pilotage_fmi::instance::{MAX_EVENT_INDICATORS, MAX_EVENT_ROUNDS};
use pilotage_fmi::{CallError, FmuError, Instance, InterfaceType};
use std::ops::Range;
use std::sync::{Mutex, OnceLock, PoisonError};
use thiserror::Error;

/// Maximum number of idle instances: differences by parameters need two for each parameter.
const KEPT: usize = 64;

/// Why an FMU returns no values at a point.
#[derive(Debug, Error)]
pub enum PointError {
    /// No instance could be created.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// A call failed.
    #[error(transparent)]
    Call(#[from] CallError),
    /// Its event iteration does not end.
    #[error("its event iteration after initialisation did not end in {MAX_EVENT_ROUNDS} rounds")]
    Events,
    /// It has more or fewer states than its description lists.
    #[error("it has {states} continuous states, and its ModelStructure lists {listed} derivatives")]
    States {
        /// Derivatives in the ModelStructure.
        listed: usize,
        /// Number reported by the instance.
        states: usize,
    },
    /// It reports more event indicators than any model has.
    #[error(
        "it has {indicators} event indicators; {MAX_EVENT_INDICATORS} are the most that are taken"
    )]
    Indicators {
        /// Number of event indicators.
        indicators: usize,
    },
    /// It requests the end of the simulation at its start.
    #[error("it asks to end the simulation as it begins")]
    End,
    /// A call failed with a fatal error, after which the FMU must not be called.
    #[error("it is not called any more after a fatal error: {call}")]
    Dead {
        /// The failed call.
        call: String,
    },
}

/// An instance in continuous-time mode.
#[derive(Debug)]
pub(crate) struct Held {
    pub(crate) instance: Instance,
    parameters: Vec<f64>,
    /// Earliest time of evaluation \[s\].
    begin: f64,
    /// The states after initialisation.
    pub(crate) initial: Vec<f64>,
    /// The next time event \[s\].
    pub(crate) next_event: Option<f64>,
    pub(crate) indicators: usize,
    /// Current time, states and inputs.
    at: Vec<f64>,
}

/// Idle instances.
#[derive(Debug)]
pub(crate) struct Pool {
    library: Library,
    #[expect(
        clippy::vec_box,
        reason = "an instance is moved in and out for each point, and large"
    )]
    idle: Mutex<Vec<Box<Held>>>,
    /// Whether only one instance is allowed.
    is_single: bool,
    /// The call that ended with a fatal error.
    fatal: OnceLock<String>,
}

impl Pool {
    pub(crate) fn new(library: Library) -> Self {
        let me = library.description().model_exchange.as_ref();
        Self {
            is_single: me.is_some_and(|me| me.can_be_instantiated_only_once_per_process),
            library,
            idle: Mutex::default(),
            fatal: OnceLock::new(),
        }
    }

    /// Calls `ask` with an instance that has these parameters and can be evaluated from `begin` \[s\] on.
    pub(crate) fn with<T>(
        &self,
        layout: &Layout,
        parameters: &[f64],
        begin: f64,
        ask: impl FnOnce(&mut Held) -> Result<T, PointError>,
    ) -> Result<T, PointError> {
        if let Some(call) = self.fatal() {
            return Err(PointError::Dead { call });
        }
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |held: &Held| held.begin <= begin && same(&held.parameters, parameters);
        let known = idle.iter().rposition(|held| fits(held));
        let taken = match known {
            Some(place) => Some(idle.remove(place)),
            None if self.is_single || idle.len() >= KEPT => {
                (!idle.is_empty()).then(|| idle.remove(0))
            }
            None => None,
        };
        // If only one instance is allowed, others wait for it: the lock is held.
        let (guard, free) = match self.is_single {
            true => (Some(idle), None),
            false => (None, Some(idle)),
        };
        drop(free);
        let held = match (taken, known) {
            (Some(held), Some(_)) => Ok(held),
            (taken, _) => self.begin(layout, taken, parameters, begin.min(0.0)),
        };
        let mut held = held.inspect_err(|error| self.bury(error))?;
        let found = ask(&mut held);
        match &found {
            Err(error) if !is_discard(error) => self.bury(error),
            _ => match guard {
                Some(mut idle) => idle.push(held),
                None => (self.idle.lock().unwrap_or_else(PoisonError::into_inner)).push(held),
            },
        }
        found
    }

    /// The call that ended with a fatal error, if one has.
    pub(crate) fn fatal(&self) -> Option<String> {
        self.fatal.get().cloned()
    }

    /// After a fatal error no function of an FMU may be called (FMI 2.0, section 2.1.3; FMI 3.0, section 2.2.3).
    fn bury(&self, error: &PointError) {
        if let PointError::Call(CallError::Failed { status, .. }) = error
            && *status == pilotage_abi::fmi2::Status::FATAL
        {
            // Another thread may have set it first.
            let _ = self.fatal.set(error.to_string());
        }
    }

    /// Initialises an instance; reuses `used` if possible.
    fn begin(
        &self,
        layout: &Layout,
        used: Option<Box<Held>>,
        parameters: &[f64],
        begin: f64,
    ) -> Result<Box<Held>, PointError> {
        let before = used.as_ref().map(|held| held.parameters.clone());
        let reset =
            used.and_then(|mut held| held.instance.reset().is_ok().then_some(held.instance));
        let mut instance = match reset {
            Some(instance) => instance,
            None => self
                .library
                .instantiate("fit", InterfaceType::ModelExchange)?,
        };
        instance.setup_experiment(None, begin, None)?;
        for (k, (own, value)) in layout.parameters.iter().zip(parameters).enumerate() {
            // Some FMUs keep their parameters on reset.
            let is_moved = before.as_ref().is_some_and(|before| before[k] != own.start);
            if is_moved || own.start.to_bits() != value.to_bits() {
                instance.set_real(&[own.reference], &[*value])?;
            }
        }
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        let update = instance.iterate_event()?.ok_or(PointError::Events)?;
        if update.is_end_requested {
            return Err(PointError::End);
        }
        instance.enter_continuous_time_mode()?;
        // Each instance of FMI 3.0 must be asked for the numbers of indicators and states before their values are.
        let indicators = instance.number_of_event_indicators()?;
        if indicators > MAX_EVENT_INDICATORS {
            return Err(PointError::Indicators { indicators });
        }
        let states = instance.number_of_continuous_states()?;
        if states != layout.states.len() {
            let listed = layout.states.len();
            return Err(PointError::States { listed, states });
        }
        let mut initial = vec![0.0; layout.states.len()];
        instance.get_continuous_states(&mut initial)?;
        Ok(Box::new(Held {
            instance,
            parameters: parameters.to_vec(),
            begin,
            initial,
            next_event: update.next_time,
            indicators,
            at: vec![f64::NAN; layout.parameter_arguments().start],
        }))
    }
}

impl Held {
    /// Sets time, states and inputs.
    pub(crate) fn put(&mut self, layout: &Layout, at: &[f64]) -> Result<(), PointError> {
        let put = self.moved(layout, at);
        match &put {
            Ok(()) => self
                .at
                .iter_mut()
                .zip(at)
                .for_each(|(own, new)| *own = *new),
            // The instance is only partly set.
            Err(_) => self.at.fill(f64::NAN),
        }
        put
    }

    fn moved(&mut self, layout: &Layout, at: &[f64]) -> Result<(), PointError> {
        let (states, inputs) = (layout.state_arguments(), layout.input_arguments());
        let before = &self.at;
        let is_new = |range: Range<usize>| !same(&before[range.clone()], &at[range]);
        let instance = &mut self.instance;
        if is_new(0..1) {
            instance.set_time(at[0])?;
        }
        if is_new(inputs.clone()) {
            instance.set_real(&layout.input_references, &at[inputs])?;
        }
        if is_new(states.clone()) {
            instance.set_continuous_states(&at[states])?;
        }
        Ok(())
    }
}

fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

fn is_discard(error: &PointError) -> bool {
    let discard = pilotage_abi::fmi2::Status::DISCARD;
    matches!(error, PointError::Call(CallError::Failed { status, .. }) if *status == discard)
}
