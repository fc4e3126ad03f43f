//! The functions of FMI 3.0 in the same library.

use super::raw::Raw;
use super::{pilot, quadcopter};
use pilotage::models::Model;
use pilotage_abi::Part;
use pilotage_abi::fmi3::functions::pointers;
use pilotage_abi::fmi3::{self, DependencyKind, FmuState, Function, State, Status};
use pilotage_sdk::variable::reference as reference_of;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_void};
use std::ptr::{null, null_mut};

/// Calls of functions whose first argument is the instance.
macro_rules! call {
    ($instance:expr, $function:ident $(, $argument:expr)*) => {{
        // SAFETY: the pointer type belongs to the function of the same name; the arguments are those
        // that the test means to pass.
        unsafe {
            let f: pointers::$function = function($instance.raw, Function::$function);
            f($instance.pointer $(, $argument)*)
        }
    }};
}

/// Messages of one instance.
type Messages = RefCell<Vec<String>>;

unsafe extern "C" fn receive(
    environment: *mut c_void,
    status: Status,
    category: fmi3::String,
    message: fmi3::String,
) {
    // SAFETY: the environment is the `Messages` that the instance was made with; the rest are C strings.
    let (messages, category, message) = unsafe {
        (
            &*environment.cast::<Messages>(),
            CStr::from_ptr(category).to_string_lossy(),
            CStr::from_ptr(message).to_string_lossy(),
        )
    };
    let status = status.name().unwrap_or("?");
    messages
        .borrow_mut()
        .push(format!("{status} [{category}] {message}"));
}

/// What an instance is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum InstanceKind {
    CoSimulation { event_mode: bool },
    ModelExchange,
    Scheduled,
}

/// An instance, freed in the end.
struct Instance<'r> {
    raw: &'r Raw,
    pointer: fmi3::Instance,
    messages: Box<Messages>,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        call!(self, FreeInstance);
    }
}

/// The address of a function.
///
/// # Safety
/// `T` is the pointer type of this function.
unsafe fn function<T: Copy>(raw: &Raw, function: Function) -> T {
    // SAFETY: as the caller promises.
    *unsafe { raw.library.get::<T>(function.symbol()) }.unwrap()
}

/// An instance named `test`; the pointer may be NULL.
fn try_instantiate<'r>(raw: &'r Raw, kind: InstanceKind, token: &str) -> Instance<'r> {
    let token = CString::new(token).unwrap();
    let path = raw.folder.path().join("resources").display().to_string();
    let path = CString::new(format!("{path}/")).unwrap();
    let messages = Box::new(Messages::default());
    let environment = std::ptr::from_ref(&*messages).cast_mut().cast::<c_void>();
    let (name, token, path) = (c"test".as_ptr(), token.as_ptr(), path.as_ptr());
    let log: Option<fmi3::LogMessageCallback> = Some(receive);
    // SAFETY: the types are the functions'; all pointers are valid during the call, the messages longer.
    let pointer = unsafe {
        match kind {
            InstanceKind::CoSimulation { event_mode } => {
                let f: pointers::InstantiateCoSimulation =
                    function(raw, Function::InstantiateCoSimulation);
                let early = event_mode;
                f(
                    name,
                    token,
                    path,
                    false,
                    true,
                    event_mode,
                    early,
                    null(),
                    0,
                    environment,
                    log,
                    None,
                )
            }
            InstanceKind::ModelExchange => {
                let f: pointers::InstantiateModelExchange =
                    function(raw, Function::InstantiateModelExchange);
                f(name, token, path, false, true, environment, log)
            }
            InstanceKind::Scheduled => {
                let f: pointers::InstantiateScheduledExecution =
                    function(raw, Function::InstantiateScheduledExecution);
                f(
                    name,
                    token,
                    path,
                    false,
                    true,
                    environment,
                    log,
                    None,
                    None,
                    None,
                )
            }
        }
    };
    Instance {
        raw,
        pointer,
        messages,
    }
}

fn instantiate(raw: &Raw, kind: InstanceKind) -> Instance<'_> {
    let instance = try_instantiate(raw, kind, &raw.model.guid());
    assert!(!instance.pointer.is_null(), "{:?}", instance.messages);
    instance
}

const CO_SIMULATION: InstanceKind = InstanceKind::CoSimulation { event_mode: false };

impl Instance<'_> {
    fn set(&self, name: &str, value: f64) -> Status {
        let reference = reference_of(self.raw.model.index(name).unwrap());
        call!(
            self,
            SetFloat64,
            &raw const reference,
            1,
            &raw const value,
            1
        )
    }

    fn initialize(&self) {
        assert_eq!(
            call!(self, EnterInitializationMode, false, 0.0, 0.0, false, 0.0),
            Status::OK
        );
        assert_eq!(call!(self, ExitInitializationMode), Status::OK);
    }

    fn step(&self, time: f64, step: f64) -> (Status, f64) {
        let (mut event, mut terminate, mut early, mut last) = (true, true, true, f64::NAN);
        let (e, t, r) = (&raw mut event, &raw mut terminate, &raw mut early);
        let status = call!(self, DoStep, time, step, true, e, t, r, &raw mut last);
        if status == Status::OK {
            assert_eq!((event, terminate, early), (false, false, false));
        }
        (status, last)
    }

    fn values(&self) -> Vec<f64> {
        let n = self.raw.model.variables().len();
        let references: Vec<u32> = (1..=n as u32).collect();
        let mut values = vec![f64::NAN; n];
        let (r, v) = (references.as_ptr(), values.as_mut_ptr());
        assert_eq!(call!(self, GetFloat64, r, n, v, n), Status::OK);
        values
    }

    fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.messages.borrow_mut())
    }

    fn update(&self) -> bool {
        let (mut needed, mut terminate, mut nominals, mut values, mut defined) =
            (true, true, true, true, true);
        let mut next = f64::NAN;
        let status = call!(
            self,
            UpdateDiscreteStates,
            &raw mut needed,
            &raw mut terminate,
            &raw mut nominals,
            &raw mut values,
            &raw mut defined,
            &raw mut next
        );
        assert_eq!(status, Status::OK);
        assert_eq!(
            (needed, terminate, nominals, defined),
            (false, false, false, false)
        );
        values
    }
}

#[test]
fn both_versions_step_to_the_same_bits() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let (new, messages) = (instantiate(&raw, CO_SIMULATION), super::Messages::default());
        let old = raw.instantiate(&messages);
        let input = raw.model.variables()[0].name.clone();
        assert_eq!(new.set(&input, 0.3), Status::OK);
        assert_eq!(old.set(&input, 0.3), super::Status::OK);
        new.initialize();
        old.initialize();
        for k in 0..20 {
            let (time, h) = (f64::from(k) * 0.05, 0.05);
            assert_eq!(new.step(time, h), (Status::OK, time + h));
            assert_eq!(old.step(time, h), super::Status::OK);
            assert_eq!(new.values(), old.values());
        }
        assert_eq!(call!(new, Terminate), Status::OK);
        assert_eq!(new.take(), [""; 0]);
    }
}

#[test]
fn event_mode_is_there_for_those_who_use_it() {
    let raw = Raw::new(quadcopter());
    let instance = instantiate(&raw, InstanceKind::CoSimulation { event_mode: true });
    instance.initialize();
    assert_eq!(instance.step(0.0, 0.1).0, Status::ERROR);
    assert!(instance.take()[0].contains("not allowed in state \"Event Mode\""));
    assert_eq!(call!(instance, Reset), Status::OK);
    instance.initialize();
    assert!(!instance.update());
    assert_eq!(call!(instance, EnterStepMode), Status::OK);
    assert_eq!(instance.step(0.0, 0.1).0, Status::OK);
    assert_eq!(call!(instance, EnterEventMode), Status::OK);

    let without = instantiate(&raw, CO_SIMULATION);
    without.initialize();
    assert_eq!(call!(without, EnterEventMode), Status::ERROR);
    assert!(without.take()[0].contains("eventModeUsed = fmi3False"));
}

#[test]
fn what_is_not_there_is_refused() {
    let raw = Raw::new(pilot());
    let scheduled = try_instantiate(&raw, InstanceKind::Scheduled, &raw.model.guid());
    assert!(scheduled.pointer.is_null());
    assert!(scheduled.take()[0].contains("fmi3InstantiateScheduledExecution: this FMU is for co-"));
    let other = try_instantiate(&raw, CO_SIMULATION, "{x}");
    assert!(other.pointer.is_null());
    assert!(other.take()[0].contains("instantiationToken is {x}, but the model has {"));

    let message = |wrong: &dyn Fn(&Instance) -> Status| {
        let instance = instantiate(&raw, CO_SIMULATION);
        instance.initialize();
        assert_eq!(wrong(&instance), Status::ERROR);
        instance.take().concat()
    };
    let references = [1_u32, 2];
    let (r, mut values) = (references.as_ptr(), [0.0; 2]);
    let v = values.as_mut_ptr();
    for (logged, expected) in [
        (
            message(&|i| call!(i, GetFloat64, r, 2, v, 1)),
            "fmi3GetFloat64: nValues = 1, but there are 2",
        ),
        (
            message(&|i| call!(i, GetInt64, r, 1, null_mut(), 1)),
            "fmi3GetInt64: this FMU has no Int64 variables, 1 asked for; use the functions for Float64",
        ),
        (
            message(&|i| call!(i, SetClock, r, 1, null())),
            "fmi3SetClock: this FMU has no Clock variables, 1 asked for; use the functions for Float64",
        ),
        (
            message(&|i| call!(i, EnterConfigurationMode)),
            "fmi3EnterConfigurationMode: this FMU has no structural parameters, so there is nothing to \
             configure",
        ),
        (
            message(&|i| call!(i, ActivateModelPartition, 0, 0.0)),
            "fmi3ActivateModelPartition: not allowed in state \"Step Mode\"; it is allowed in Clock \
             Activation Mode",
        ),
        (
            message(&|i| call!(i, GetNumberOfContinuousStates, null_mut())),
            "fmi3GetNumberOfContinuousStates: it is for model exchange, but this instance was made for \
             co-simulation",
        ),
        (
            message(&|i| i.step(0.5, 0.1).0),
            "fmi3DoStep: currentCommunicationPoint = 0.5 s, but this instance stands at 0 s; pass that \
             time, or go back with an FMU state",
        ),
    ] {
        assert!(logged.ends_with(expected), "{logged}\n{expected}");
    }
}

/// FMI rule 16: what the functions say is what the XML says.
#[test]
fn dependencies_are_those_of_the_description() {
    for model in [pilot(), quadcopter()] {
        let raw = Raw::new(model);
        let instance = instantiate(&raw, InstanceKind::ModelExchange);
        let structure = pilotage_sdk::Interface::of(&raw.model).structure;
        for unknown in structure.outputs.iter().chain(&structure.derivatives) {
            let (reference, mut n) = (reference_of(unknown.index), 99);
            assert_eq!(
                call!(
                    instance,
                    GetNumberOfVariableDependencies,
                    reference,
                    &raw mut n
                ),
                Status::OK
            );
            let mut elements = [vec![9_usize; n], vec![9_usize; n]];
            let mut on = vec![99_u32; n];
            let mut kinds = vec![DependencyKind::INDEPENDENT; n];
            let [d, i] = elements.each_mut().map(Vec::as_mut_ptr);
            let (o, k) = (on.as_mut_ptr(), kinds.as_mut_ptr());
            assert_eq!(
                call!(instance, GetVariableDependencies, reference, d, o, i, k, n),
                Status::OK
            );
            let expected: Vec<_> = (unknown.dependencies.iter())
                .map(|d| (reference_of(d.index), d.constant))
                .collect();
            let found: Vec<_> = on
                .into_iter()
                .zip(kinds.iter().map(|k| *k == DependencyKind::CONSTANT))
                .collect();
            assert_eq!(found, expected);
            assert_eq!(elements.concat(), vec![0; 2 * n]);
        }
    }
}

/// FMI rule 29: forward and adjoint derivatives are those of one matrix.
#[test]
fn adjoint_derivatives_are_the_transpose_of_directional_ones() {
    let raw = Raw::new(quadcopter());
    let instance = instantiate(&raw, InstanceKind::ModelExchange);
    instance.initialize();
    let table = raw.model.variable_table();
    let unknowns: Vec<u32> = table.derivatives().map(reference_of).collect();
    let knowns: Vec<u32> = (table.inputs().chain(table.states()))
        .map(reference_of)
        .collect();
    let (u, nu) = (unknowns.as_ptr(), unknowns.len());
    let (k, nk) = (knowns.as_ptr(), knowns.len());
    let unit = |n: usize, i: usize| {
        let mut unit = vec![0.0; n];
        unit[i] = 1.0;
        unit
    };
    let forward: Vec<Vec<f64>> = (0..nk)
        .map(|i| {
            let (seed, mut column) = (unit(nk, i), vec![f64::NAN; nu]);
            let (s, r) = (seed.as_ptr(), column.as_mut_ptr());
            let status = call!(
                instance,
                GetDirectionalDerivative,
                u,
                nu,
                k,
                nk,
                s,
                nk,
                r,
                nu
            );
            assert_eq!(status, Status::OK);
            column
        })
        .collect();
    for i in 0..nu {
        let (seed, mut row) = (unit(nu, i), vec![f64::NAN; nk]);
        let (s, r) = (seed.as_ptr(), row.as_mut_ptr());
        let status = call!(instance, GetAdjointDerivative, u, nu, k, nk, s, nu, r, nk);
        assert_eq!(status, Status::OK);
        let column: Vec<f64> = forward.iter().map(|column| column[i]).collect();
        assert_eq!(row, column);
    }
    assert!(forward.concat().iter().filter(|v| **v != 0.0).count() > 10);
}

#[test]
fn states_repeat_to_the_last_bit_and_belong_to_their_version() {
    let raw = Raw::new(quadcopter());
    let messages = super::Messages::default();
    let (instance, other) = (
        instantiate(&raw, CO_SIMULATION),
        instantiate(&raw, CO_SIMULATION),
    );
    assert_eq!(instance.set("stick", -0.4), Status::OK);
    instance.initialize();
    instance.step(0.0, 0.2);
    let mut state: FmuState = null_mut();
    assert_eq!(call!(instance, GetFmuState, &raw mut state), Status::OK);
    let mut size = 0;
    assert_eq!(
        call!(instance, SerializedFmuStateSize, state, &raw mut size),
        Status::OK
    );
    let mut bytes = vec![0_u8; size];
    assert_eq!(
        call!(instance, SerializeFmuState, state, bytes.as_mut_ptr(), size),
        Status::OK
    );
    instance.step(0.2, 0.3);
    let mut copy: FmuState = null_mut();
    let source = bytes.as_ptr();
    assert_eq!(
        call!(other, DeserializeFmuState, source, size, &raw mut copy),
        Status::OK
    );
    assert_eq!(call!(other, SetFmuState, copy), Status::OK);
    assert_eq!(other.step(0.2, 0.3).0, Status::OK);
    assert_eq!(other.values(), instance.values());

    let old = raw.instantiate(&messages);
    assert_eq!(old.deserialize(&bytes).0, super::Status::ERROR);
    assert!(messages.take()[0].contains("64 of FMI 3, expected that of an instance of FMI 2"));
    assert_eq!(call!(instance, FreeFmuState, &raw mut state), Status::OK);
    assert_eq!(call!(other, FreeFmuState, &raw mut copy), Status::OK);
    assert!(state.is_null() && copy.is_null());
}

#[test]
fn a_step_that_fails_says_how_far_it_came() {
    let raw = Raw::new(Model::pilot(&[-1e3, 1.0], 1.0));
    let instance = instantiate(&raw, CO_SIMULATION);
    assert_eq!(instance.set("target", 1.0), Status::OK);
    instance.initialize();
    assert_eq!(instance.step(0.0, 0.01), (Status::OK, 0.01));
    assert_eq!(instance.step(0.01, 10.0), (Status::DISCARD, 0.01));
    // It stands where it stood: a shorter step is possible.
    assert_eq!(instance.step(0.01, 0.01), (Status::OK, 0.02));
}

/// Calls a function with arguments that are right wherever it is allowed; `None` for those that make
/// instances or need none.
fn poke(
    instance: &Instance,
    function: Function,
    state: FmuState,
    saved: &mut [u8],
) -> Option<Status> {
    use Function as F;
    let mut flags = [true; 5];
    let [a, b, c, d, e] = flags.each_mut().map(std::ptr::from_mut);
    let (mut x, mut n, mut copy) = (0.0, 0, null_mut());
    let (x, n) = (&raw mut x, &raw mut n);
    let nothing = null();
    /// Functions of four arguments that are about no variable at all.
    macro_rules! none {
        ($($name:ident)*; $($clock:ident)*) => {
            match function {
                $(F::$name => Some(call!(instance, $name, nothing, 0, null_mut(), 0)),)*
                $(F::$clock => Some(call!(instance, $clock, nothing, 0, null_mut())),)*
                _ => None,
            }
        };
    }
    let about_none = none!(GetFloat32 GetFloat64 GetInt8 GetUInt8 GetInt16 GetUInt16 GetInt32 GetUInt32
        GetInt64 GetUInt64 GetBoolean GetString SetFloat32 SetFloat64 SetInt8 SetUInt8 SetInt16 SetUInt16
        SetInt32 SetUInt32 SetInt64 SetUInt64 SetBoolean SetString; GetClock SetClock GetShiftDecimal
        SetIntervalDecimal SetShiftDecimal);
    let status = about_none.or_else(|| {
        Some(match function {
            F::SetDebugLogging => call!(instance, SetDebugLogging, true, 0, null()),
            F::EnterInitializationMode => {
                call!(
                    instance,
                    EnterInitializationMode,
                    false,
                    0.0,
                    0.0,
                    false,
                    0.0
                )
            }
            F::ExitInitializationMode => call!(instance, ExitInitializationMode),
            F::EnterEventMode => call!(instance, EnterEventMode),
            F::Terminate => call!(instance, Terminate),
            F::Reset => call!(instance, Reset),
            F::GetBinary => call!(instance, GetBinary, nothing, 0, null_mut(), null_mut(), 0),
            F::SetBinary => call!(instance, SetBinary, nothing, 0, null(), null(), 0),
            F::GetNumberOfVariableDependencies => {
                call!(instance, GetNumberOfVariableDependencies, 3, n)
            }
            F::GetVariableDependencies => {
                let (mut on, mut kind) = (0, DependencyKind::CONSTANT);
                let (o, k) = (&raw mut on, &raw mut kind);
                call!(instance, GetVariableDependencies, 3, n, o, n, k, 1)
            }
            F::GetFmuState => call!(instance, GetFmuState, &raw mut copy),
            F::SetFmuState => call!(instance, SetFmuState, state),
            F::FreeFmuState => call!(instance, FreeFmuState, &raw mut copy),
            F::SerializedFmuStateSize => call!(instance, SerializedFmuStateSize, state, n),
            F::SerializeFmuState => {
                call!(
                    instance,
                    SerializeFmuState,
                    state,
                    saved.as_mut_ptr(),
                    saved.len()
                )
            }
            F::DeserializeFmuState => {
                let bytes = saved.as_ptr();
                call!(
                    instance,
                    DeserializeFmuState,
                    bytes,
                    saved.len(),
                    &raw mut copy
                )
            }
            F::GetDirectionalDerivative => {
                let v = null_mut();
                call!(
                    instance,
                    GetDirectionalDerivative,
                    nothing,
                    0,
                    nothing,
                    0,
                    null(),
                    0,
                    v,
                    0
                )
            }
            F::GetAdjointDerivative => {
                let v = null_mut();
                call!(
                    instance,
                    GetAdjointDerivative,
                    nothing,
                    0,
                    nothing,
                    0,
                    null(),
                    0,
                    v,
                    0
                )
            }
            F::GetIntervalDecimal => {
                call!(
                    instance,
                    GetIntervalDecimal,
                    nothing,
                    0,
                    null_mut(),
                    null_mut()
                )
            }
            F::GetIntervalFraction => {
                let v = null_mut();
                call!(
                    instance,
                    GetIntervalFraction,
                    nothing,
                    0,
                    null_mut(),
                    null_mut(),
                    v
                )
            }
            F::GetShiftFraction => {
                call!(
                    instance,
                    GetShiftFraction,
                    nothing,
                    0,
                    null_mut(),
                    null_mut()
                )
            }
            F::SetIntervalFraction => {
                call!(instance, SetIntervalFraction, nothing, 0, null(), null())
            }
            F::SetShiftFraction => call!(instance, SetShiftFraction, nothing, 0, null(), null()),
            F::EvaluateDiscreteStates => call!(instance, EvaluateDiscreteStates),
            F::UpdateDiscreteStates => call!(instance, UpdateDiscreteStates, a, b, c, d, e, x),
            F::EnterStepMode => call!(instance, EnterStepMode),
            F::GetOutputDerivatives => {
                call!(
                    instance,
                    GetOutputDerivatives,
                    nothing,
                    0,
                    null(),
                    null_mut(),
                    0
                )
            }
            F::DoStep => call!(instance, DoStep, 0.0, 1e-3, true, a, b, c, x),
            F::EnterContinuousTimeMode => call!(instance, EnterContinuousTimeMode),
            F::CompletedIntegratorStep => call!(instance, CompletedIntegratorStep, true, a, b),
            F::SetTime => call!(instance, SetTime, 0.0),
            F::SetContinuousStates => call!(instance, SetContinuousStates, x, 1),
            F::GetContinuousStateDerivatives => {
                call!(instance, GetContinuousStateDerivatives, x, 1)
            }
            F::GetEventIndicators => call!(instance, GetEventIndicators, null_mut(), 0),
            F::GetContinuousStates => call!(instance, GetContinuousStates, x, 1),
            F::GetNominalsOfContinuousStates => {
                call!(instance, GetNominalsOfContinuousStates, x, 1)
            }
            F::GetNumberOfEventIndicators => call!(instance, GetNumberOfEventIndicators, n),
            F::GetNumberOfContinuousStates => call!(instance, GetNumberOfContinuousStates, n),
            F::ActivateModelPartition => call!(instance, ActivateModelPartition, 0, 0.0),
            // Without structural parameters they are refused everywhere.
            F::EnterConfigurationMode | F::ExitConfigurationMode => return None,
            _ => return None,
        })
    });
    if !copy.is_null() {
        call!(instance, FreeFmuState, &raw mut copy);
    }
    status
}

fn reach(instance: &Instance, state: State) {
    if state == State::Instantiated {
        return;
    }
    assert_eq!(
        call!(
            instance,
            EnterInitializationMode,
            false,
            0.0,
            0.0,
            false,
            0.0
        ),
        Status::OK
    );
    if state == State::InitializationMode {
        return;
    }
    assert_eq!(call!(instance, ExitInitializationMode), Status::OK);
    match state {
        State::EventMode => {}
        State::StepMode => assert_eq!(call!(instance, EnterStepMode), Status::OK),
        State::ContinuousTimeMode => {
            assert_eq!(call!(instance, EnterContinuousTimeMode), Status::OK);
        }
        State::Terminated => assert_eq!(call!(instance, Terminate), Status::OK),
        State::Error => assert_eq!(instance.set("stick", 1.0), Status::ERROR),
        _ => panic!("{} cannot be reached", state.name()),
    }
}

/// FMI rule 20: every function is there, and is allowed where the table says (rule 24).
#[test]
fn the_table_of_legal_states_is_obeyed() {
    let raw = Raw::new(Model::pilot(&[1.0, 1.0], 1.0));
    let kinds = [
        (
            InstanceKind::CoSimulation { event_mode: true },
            Part::ModelExchange,
            State::StepMode,
        ),
        (
            InstanceKind::ModelExchange,
            Part::CoSimulation,
            State::ContinuousTimeMode,
        ),
    ];
    let (mut allowed, mut refused) = (0, 0);
    for (kind, other, running) in kinds {
        let keeper = instantiate(&raw, kind);
        let mut state: FmuState = null_mut();
        assert_eq!(call!(keeper, GetFmuState, &raw mut state), Status::OK);
        let mut size = 0;
        call!(keeper, SerializedFmuStateSize, state, &raw mut size);
        let mut saved = vec![0_u8; size];
        call!(keeper, SerializeFmuState, state, saved.as_mut_ptr(), size);
        for &function in Function::ALL {
            for at in [
                State::Instantiated,
                State::InitializationMode,
                State::EventMode,
                running,
                State::Terminated,
                State::Error,
            ] {
                let instance = instantiate(&raw, kind);
                reach(&instance, at);
                instance.take();
                let Some(status) = poke(&instance, function, state, &mut saved) else {
                    continue;
                };
                let logged = instance.take();
                let place = format!("{} in {}: {logged:?}", function.name(), at.name());
                match function.is_legal_in(at) && function.part() != other {
                    true => {
                        allowed += 1;
                        assert_eq!(status, Status::OK, "{place}");
                    }
                    false => {
                        refused += 1;
                        assert_eq!(status, Status::ERROR, "{place}");
                        let start = format!("fmi3Error [logStatusError] {}: ", function.name());
                        assert!(logged[0].starts_with(&start), "{place}");
                    }
                }
            }
        }
        call!(keeper, FreeFmuState, &raw mut state);
    }
    assert_eq!((allowed, refused), (507, 309));
}
