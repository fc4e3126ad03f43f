//! Value types, status codes and callbacks (FMI 3.0, sections 2.2.1 to 2.2.3; `fmi3PlatformTypes.h` and
//! `fmi3FunctionTypes.h`).

use std::ffi::{CStr, c_char, c_int, c_void};

/// What `fmi3GetVersion` returns, for every FMI 3.0.x.
pub const VERSION: &CStr = c"3.0";

/// `fmi3Instance`: opaque pointer to an instance, made by the FMU.
pub type Instance = *mut c_void;

/// `fmi3InstanceEnvironment`: opaque pointer of the importer, passed back in callbacks.
pub type InstanceEnvironment = *mut c_void;

/// `fmi3FMUState`: opaque pointer to a copy of an instance's complete state.
pub type FmuState = *mut c_void;

/// `fmi3ValueReference`: handle of a variable.
pub type ValueReference = u32;

/// `fmi3Float32`.
pub type Float32 = f32;

/// `fmi3Float64`.
pub type Float64 = f64;

/// `fmi3Int8`.
pub type Int8 = i8;

/// `fmi3UInt8`.
pub type UInt8 = u8;

/// `fmi3Int16`.
pub type Int16 = i16;

/// `fmi3UInt16`.
pub type UInt16 = u16;

/// `fmi3Int32`.
pub type Int32 = i32;

/// `fmi3UInt32`.
pub type UInt32 = u32;

/// `fmi3Int64`.
pub type Int64 = i64;

/// `fmi3UInt64`.
pub type UInt64 = u64;

/// `fmi3Boolean`.
pub type Boolean = bool;

/// `fmi3Char`.
pub type Char = c_char;

/// `fmi3String`: UTF-8, NUL-terminated.
pub type String = *const Char;

/// `fmi3Byte`.
pub type Byte = u8;

/// `fmi3Binary`: bytes; their number is passed separately.
pub type Binary = *const Byte;

/// `fmi3Clock`: whether the clock ticks.
pub type Clock = bool;

/// `fmi3Status`. Not a Rust enum: a foreign binary may return any number.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Status(pub c_int);

impl Status {
    /// Success.
    pub const OK: Self = Self(0);
    /// A minor problem; the computation can continue. The FMU has logged the reason.
    pub const WARNING: Self = Self(1);
    /// The call was not carried out, but the importer may try another one.
    pub const DISCARD: Self = Self(2);
    /// This instance cannot continue; it may be reset, freed or set to an earlier FMU state.
    pub const ERROR: Self = Self(3);
    /// No instance of this FMU can continue.
    pub const FATAL: Self = Self(4);

    /// The standard's name, such as `fmi3Error`; `None` for a number that FMI does not define.
    pub fn name(self) -> Option<&'static str> {
        let names = [
            "fmi3OK",
            "fmi3Warning",
            "fmi3Discard",
            "fmi3Error",
            "fmi3Fatal",
        ];
        usize::try_from(self.0)
            .ok()
            .and_then(|i| names.get(i).copied())
    }
}

/// `fmi3DependencyKind`. Not a Rust enum: a foreign binary may write any number.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DependencyKind(pub c_int);

impl DependencyKind {
    /// No dependency.
    pub const INDEPENDENT: Self = Self(0);
    /// Linear with a constant factor.
    pub const CONSTANT: Self = Self(1);
    /// Linear with a factor that is fixed after initialization.
    pub const FIXED: Self = Self(2);
    /// Linear with a factor that changes with tunable parameters.
    pub const TUNABLE: Self = Self(3);
    /// Linear with a factor that changes at events.
    pub const DISCRETE: Self = Self(4);
    /// Dependency of any form.
    pub const DEPENDENT: Self = Self(5);
}

/// `fmi3IntervalQualifier`. Not a Rust enum: a foreign binary may write any number.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IntervalQualifier(pub c_int);

impl IntervalQualifier {
    /// The interval is not known yet.
    pub const NOT_YET_KNOWN: Self = Self(0);
    /// The interval is unchanged.
    pub const UNCHANGED: Self = Self(1);
    /// The interval has changed.
    pub const CHANGED: Self = Self(2);
}

/// `fmi3LogMessageCallback`: environment, status, category, message.
pub type LogMessageCallback = unsafe extern "C" fn(InstanceEnvironment, Status, String, String);

/// `fmi3ClockUpdateCallback`: environment.
pub type ClockUpdateCallback = unsafe extern "C" fn(InstanceEnvironment);

/// `fmi3IntermediateUpdateCallback`: environment, time, variables may be set, variables may be read, step finished, can
/// return early; out: early return requested, and its time.
pub type IntermediateUpdateCallback = unsafe extern "C" fn(
    InstanceEnvironment,
    Float64,
    Boolean,
    Boolean,
    Boolean,
    Boolean,
    *mut Boolean,
    *mut Float64,
);

/// `fmi3LockPreemptionCallback` and `fmi3UnlockPreemptionCallback`.
pub type PreemptionCallback = unsafe extern "C" fn();
