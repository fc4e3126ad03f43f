//! Creating an instance.

use super::callbacks::Callbacks;
use super::{CallError, Experiment, Instance, c_string};
use crate::binding::{Functions, Loaded};
use crate::description::{Dimension, ModelDescription, ScalarVariable, Unknown};
use crate::environment::{self, IntermediateUpdate, Registered};
use crate::logger;
use crate::memory::{self, PoisonedTexts};
use crate::surroundings;
use crate::version::{Function, InterfaceType, State};
use pilotage_abi::fmi2::{CallbackFunctions, FALSE, TRUE, Type};
use pilotage_abi::{fmi2, fmi3};
use pilotage_process::Place;
use std::collections::HashMap;
use std::ffi::c_void;
use std::path::{MAIN_SEPARATOR, Path};
use std::sync::Arc;

/// Options passed to an instance at creation, besides its name. All are off by default.
#[derive(Debug, Default)]
pub struct InstanceOptions {
    /// The instance may show a window.
    pub visible: bool,
    /// Co-simulation of FMI 3.0: events are handled in event mode, not hidden within steps.
    pub event_mode_used: bool,
    /// Co-simulation of FMI 3.0: a step may end early.
    pub early_return_allowed: bool,
    /// Co-simulation of FMI 3.0: the variables that [`Self::intermediate_update`] reads or sets.
    pub required_intermediate_variables: Vec<u32>,
    /// Co-simulation of FMI 3.0: called within steps.
    pub intermediate_update: Option<IntermediateUpdate>,
}

/// Values of the description that the calls need.
#[derive(Debug, Clone, Default)]
pub(super) struct Facts {
    pub(super) event_mode_used: bool,
    /// Steps of FMI 2.0 may go on after they have returned.
    pub(super) can_pend: bool,
    pub(super) can_save: bool,
    pub(super) can_serialize: bool,
    /// Directional derivatives.
    pub(super) directional: bool,
    /// Adjoint derivatives (FMI 3.0).
    pub(super) adjoint: bool,
    /// Number of continuous states, as listed in the description.
    pub(super) states: usize,
    /// Number of event indicators, as listed in the description.
    pub(super) indicators: usize,
    /// FMI 3.0: number of values of the listed derivatives; `None` if structural parameters determine it.
    pub(super) listed_states: Option<usize>,
    /// The same for the listed event indicators.
    pub(super) listed_indicators: Option<usize>,
    /// FMI 3.0: number of values of each array by its value reference; `None` if a structural parameter determines it.
    pub(super) arrays: HashMap<u32, Option<usize>>,
}

impl Facts {
    /// The values for this kind, if the FMU supports it.
    fn of(description: &ModelDescription, kind: InterfaceType) -> Option<Self> {
        let mut co_simulation = description.co_simulation.iter();
        let common = Self {
            can_pend: co_simulation.any(|cs| cs.can_run_asynchronously),
            states: description.structure.derivatives.len(),
            indicators: description.number_of_event_indicators.unwrap_or(0) as usize,
            listed_states: values_of(description, &description.structure.derivatives),
            listed_indicators: values_of(description, &description.structure.event_indicators),
            arrays: (description.variables.iter())
                .filter(|variable| !variable.dimensions.is_empty())
                .map(|variable| (variable.value_reference, fixed_size(description, variable)))
                .collect(),
            ..Self::default()
        };
        macro_rules! facts {
            ($interface:ident) => {
                description.$interface.as_ref().map(|x| Self {
                    can_save: x.can_get_and_set_fmu_state,
                    can_serialize: x.can_serialize_fmu_state,
                    directional: x.provides_directional_derivative,
                    adjoint: x.provides_adjoint_derivatives,
                    ..common
                })
            };
        }
        match kind {
            InterfaceType::CoSimulation => facts!(co_simulation),
            InterfaceType::ModelExchange => facts!(model_exchange),
            InterfaceType::ScheduledExecution => facts!(scheduled_execution),
        }
    }
}

/// Total number of values of unknowns; `None` if it depends on a structural parameter, which may change.
fn values_of(description: &ModelDescription, unknowns: &[Unknown]) -> Option<usize> {
    let value = |unknown: &Unknown| {
        let position = (unknown.index as usize).checked_sub(1)?;
        fixed_size(description, description.variables.get(position)?)
    };
    unknowns
        .iter()
        .try_fold(0usize, |sum, unknown| sum.checked_add(value(unknown)?))
}

/// Number of values of a variable; `None` if it depends on a structural parameter.
fn fixed_size(description: &ModelDescription, variable: &ScalarVariable) -> Option<usize> {
    let is_fixed = |dimension: &Dimension| matches!(dimension, Dimension::Fixed(_));
    let is_known = variable.dimensions.iter().all(is_fixed);
    usize::try_from(is_known.then(|| description.size(variable))??).ok()
}

/// The state after initialization (FMI 3.0).
pub(super) fn running(kind: InterfaceType, event_mode_used: bool) -> fmi3::State {
    match kind {
        InterfaceType::CoSimulation if !event_mode_used => fmi3::State::StepMode,
        InterfaceType::CoSimulation | InterfaceType::ModelExchange => fmi3::State::EventMode,
        InterfaceType::ScheduledExecution => fmi3::State::ClockActivationMode,
    }
}

impl Instance {
    /// Creates an instance.
    ///
    /// # Errors
    /// If the FMU refuses, usually because the GUIDs (instantiation tokens) of description and binary differ.
    pub(crate) fn new(
        loaded: Arc<Loaded>,
        description: &ModelDescription,
        name: &str,
        kind: InterfaceType,
        options: InstanceOptions,
    ) -> Result<Self, CallError> {
        let place = Place::new(&format!("`{name}` of {}", loaded.fmu.display()));
        let facts = Facts::of(description, kind).ok_or(CallError::OtherKind { kind })?;
        let environment = Registered::new(name, loaded.clone(), options.intermediate_update);
        let run = (options.event_mode_used, options.early_return_allowed);
        let start = Start {
            loaded: &loaded,
            place: &place,
            environment: environment.pointer(),
            name,
            token: &description.guid,
            kind,
            visible: options.visible,
        };
        let variables = &options.required_intermediate_variables;
        let (made, callbacks, texts, function, state) = match &loaded.binding.functions {
            Functions::Fmi2(f) => {
                let (made, callbacks, texts) = start.fmi2(f.instantiate)?;
                let function = Function::Fmi2(fmi2::Function::Instantiate);
                let state = State::Fmi2(fmi2::State::Instantiated);
                (made, Some(callbacks), texts, function, state)
            }
            Functions::Fmi3(f) => {
                let ((made, function), texts) = start.fmi3(f, run, variables)?;
                let state = State::Fmi3(fmi3::State::Instantiated);
                (made, None, texts, Function::Fmi3(function), state)
            }
        };
        if made.is_null() {
            let messages = environment.take();
            return Err(CallError::NotInstantiated { function, messages });
        }
        environment.made(made);
        let event_mode_used = options.event_mode_used;
        let mut instance = Self {
            loaded,
            component: made,
            place,
            room: Vec::new(),
            last_successful: f64::NAN,
            _callbacks: callbacks,
            _texts: texts,
            environment,
            kind,
            state,
            facts: Facts {
                event_mode_used,
                ..facts
            },
            running: running(kind, event_mode_used),
            experiment: Experiment::default(),
            saved: Vec::new(),
            words: None,
        };
        instance.log_trouble_only(description);
        Ok(instance)
    }

    /// Reduces logging: it was on during instantiation, so that a refusal has a reason. From now on, only the
    /// standard's categories for warnings and errors are requested, as far as the FMU has them.
    fn log_trouble_only(&mut self, description: &ModelDescription) {
        const TROUBLE: [&str; 4] = [
            "logStatusWarning",
            "logStatusDiscard",
            "logStatusError",
            "logStatusFatal",
        ];
        let declared = description.log_categories.iter().map(|c| c.name.as_str());
        let wanted: Vec<&str> = declared.filter(|name| TROUBLE.contains(name)).collect();
        let before = self.state;
        // Whether the FMU complies, or has the function at all, does not matter.
        let failed = self.set_debug_logging(!wanted.is_empty(), &wanted).is_err();
        let is_fatal = matches!(
            self.state,
            State::Fmi2(fmi2::State::Fatal) | State::Fmi3(fmi3::State::Fatal)
        );
        if failed && !is_fatal {
            self.state = before;
        }
    }
}

/// Arguments of instantiation common to both versions.
struct Start<'a> {
    loaded: &'a Loaded,
    place: &'a Place,
    environment: *mut c_void,
    name: &'a str,
    token: &'a str,
    kind: InterfaceType,
    visible: bool,
}

impl Start<'_> {
    fn during<T>(&self, function: Function, make: impl FnOnce() -> T) -> T {
        let number = function.number();
        surroundings::kept(|| self.place.call(number, make))
    }

    /// `fmi2Instantiate`, with all callbacks: some FMUs crash if the memory callbacks are NULL.
    fn fmi2(
        &self,
        instantiate: Option<fmi2::functions::pointers::Instantiate>,
    ) -> Result<(*mut c_void, Callbacks, PoisonedTexts), CallError> {
        let function = Function::Fmi2(fmi2::Function::Instantiate);
        let instantiate = instantiate.ok_or(CallError::MissingFunction { function })?;
        let (allocate, free) = memory::callbacks();
        let callbacks = Callbacks::new(CallbackFunctions {
            logger: Some(logger::fmi2::callback()),
            allocate_memory: Some(allocate),
            free_memory: Some(free),
            step_finished: None,
            component_environment: self.environment,
        });
        let (name, guid) = (c_string(self.name)?, c_string(self.token)?);
        let resources = c_string(&file_uri(&self.loaded.folder.path().join("resources")))?;
        let kind = match self.kind {
            InterfaceType::ModelExchange => Type::MODEL_EXCHANGE,
            InterfaceType::CoSimulation | InterfaceType::ScheduledExecution => Type::CO_SIMULATION,
        };
        let visible = if self.visible { TRUE } else { FALSE };
        // SAFETY: all strings are NUL-terminated and live until the call returns; the callbacks are never freed.
        let make = || unsafe {
            instantiate(
                name.as_ptr(),
                kind,
                guid.as_ptr(),
                resources.as_ptr(),
                callbacks.pointer(),
                visible,
                TRUE,
            )
        };
        let made = self.during(function, make);
        Ok((made, callbacks, PoisonedTexts::new([name, guid, resources])))
    }

    /// `fmi3InstantiateXXX`. `run`: whether event mode is used and early return is allowed.
    fn fmi3(
        &self,
        f: &crate::binding::fmi3::Functions,
        run: (bool, bool),
        variables: &[u32],
    ) -> Result<((*mut c_void, fmi3::Function), PoisonedTexts), CallError> {
        use fmi3::Function as F;
        let missing = |function: F| CallError::MissingFunction {
            function: Function::Fmi3(function),
        };
        let (name, token) = (c_string(self.name)?, c_string(self.token)?);
        let resources = c_string(&folder_path(&self.loaded.folder.path().join("resources")))?;
        let given = [name, token, resources];
        let [name, token, resources] = given.each_ref().map(|text| text.as_ptr());
        let (visible, environment) = (self.visible, self.environment);
        let log = Some(logger::fmi3::callback());
        // SAFETY: all strings are NUL-terminated and live until the call returns, as do the `len` variables; the
        // callbacks are functions of this program.
        let made = unsafe {
            match self.kind {
                InterfaceType::ModelExchange => {
                    let function = F::InstantiateModelExchange;
                    let call = f.instantiate_model_exchange;
                    let call = call.ok_or(missing(function))?;
                    let make = || call(name, token, resources, visible, true, environment, log);
                    let made = self.during(Function::Fmi3(function), make);
                    (made, function)
                }
                InterfaceType::CoSimulation => {
                    let function = F::InstantiateCoSimulation;
                    let call = f.instantiate_co_simulation;
                    let call = call.ok_or(missing(function))?;
                    let update = Some(environment::intermediate_update());
                    let (events, early) = run;
                    let (list, len) = (variables.as_ptr(), variables.len());
                    let make = || {
                        call(
                            name,
                            token,
                            resources,
                            visible,
                            true,
                            events,
                            early,
                            list,
                            len,
                            environment,
                            log,
                            update,
                        )
                    };
                    let made = self.during(Function::Fmi3(function), make);
                    (made, function)
                }
                InterfaceType::ScheduledExecution => {
                    let function = F::InstantiateScheduledExecution;
                    let call = f.instantiate_scheduled_execution;
                    let call = call.ok_or(missing(function))?;
                    let update = Some(environment::clock_update as _);
                    let lock = Some(environment::no_preemption as _);
                    let make = || {
                        call(
                            name,
                            token,
                            resources,
                            visible,
                            true,
                            environment,
                            log,
                            update,
                            lock,
                            lock,
                        )
                    };
                    let made = self.during(Function::Fmi3(function), make);
                    (made, function)
                }
            }
        };
        Ok((made, PoisonedTexts::new(given)))
    }
}

/// The absolute path of a folder with a trailing separator, as FMI 3.0 requires for `resourcePath` (section 2.2.3).
fn folder_path(path: &Path) -> String {
    let mut text = path.to_string_lossy().into_owned();
    text.push(MAIN_SEPARATOR);
    text
}

/// `file:` URI of an absolute path (RFC 8089), with special characters percent-encoded, as FMI 2.0 requires for
/// `fmuResourceLocation` (section 2.1.5).
fn file_uri(path: &Path) -> String {
    let path = path.to_string_lossy().replace('\\', "/");
    let slash = if path.starts_with('/') { "" } else { "/" };
    let mut uri = format!("file://{slash}");
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' | b':' => {
                uri.push(char::from(byte));
            }
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    // FMI rule 19: location of the resources passed to an FMU.
    #[test]
    fn paths_become_uris() {
        for (path, uri) in [
            ("/tmp/a b/ä", "file:///tmp/a%20b/%C3%A4"),
            ("C:\\x\\y", "file:///C:/x/y"),
            ("/a%20b", "file:///a%2520b"),
        ] {
            assert_eq!(file_uri(Path::new(path)), uri);
        }
        let folder = folder_path(Path::new("/tmp/a b"));
        assert_eq!(folder, format!("/tmp/a b{MAIN_SEPARATOR}"));
    }
}
