//! A single call into an FMU: whether it is allowed, whether the function exists, and the meaning of its status.

use super::{CallError, Instance};
use crate::version::{Function, State};
use crate::{Message, surroundings};
use pilotage_abi::{fmi2, fmi3};

/// Calls the function of the FMU's version, if the instance's state allows it; an error if the version has no such
/// function. Returns a `Result<(), CallError>`.
///
/// It is unsafe like the call itself: pointers and lengths must be what the function expects.
macro_rules! call {
    ($self:ident, fmi2 $F2:ident.$f2:ident($($a2:expr),*), fmi3 $F3:ident.$f3:ident($($a3:expr),*)) => {
        match &$self.loaded.binding.functions {
            $crate::binding::Functions::Fmi2(f) => {
                let function = $crate::Function::Fmi2(pilotage_abi::fmi2::Function::$F2);
                let call = $self.ready(function, f.$f2)?;
                let status = $self.during(function, || call($self.component $(, $a2)*));
                $self.check(function, status)
            }
            $crate::binding::Functions::Fmi3(f) => {
                let function = $crate::Function::Fmi3(pilotage_abi::fmi3::Function::$F3);
                let call = $self.ready(function, f.$f3)?;
                let status = $self.during(function, || call($self.component $(, $a3)*));
                $self.check(function, pilotage_abi::fmi2::Status(status.0))
            }
        }
    };
    ($self:ident, fmi2 $F2:ident.$f2:ident($($a2:expr),*)) => {
        match &$self.loaded.binding.functions {
            $crate::binding::Functions::Fmi2(f) => {
                let function = $crate::Function::Fmi2(pilotage_abi::fmi2::Function::$F2);
                let call = $self.ready(function, f.$f2)?;
                let status = $self.during(function, || call($self.component $(, $a2)*));
                $self.check(function, status)
            }
            $crate::binding::Functions::Fmi3(_) => Err($crate::CallError::OtherVersion {
                function: $crate::Function::Fmi2(pilotage_abi::fmi2::Function::$F2),
                version: $crate::FmiVersion::V3,
            }),
        }
    };
    ($self:ident, fmi3 $F3:ident.$f3:ident($($a3:expr),*)) => {
        match &$self.loaded.binding.functions {
            $crate::binding::Functions::Fmi2(_) => Err($crate::CallError::OtherVersion {
                function: $crate::Function::Fmi3(pilotage_abi::fmi3::Function::$F3),
                version: $crate::FmiVersion::V2,
            }),
            $crate::binding::Functions::Fmi3(f) => {
                let function = $crate::Function::Fmi3(pilotage_abi::fmi3::Function::$F3);
                let call = $self.ready(function, f.$f3)?;
                let status = $self.during(function, || call($self.component $(, $a3)*));
                $self.check(function, pilotage_abi::fmi2::Status(status.0))
            }
        }
    };
}
pub(super) use call;

impl Instance {
    /// The function's address, if the state allows the call and the binary has the function.
    #[inline]
    pub(super) fn ready<T>(&self, function: Function, pointer: Option<T>) -> Result<T, CallError> {
        match pointer {
            Some(pointer) if function.is_legal_in(self.state) => Ok(pointer),
            _ => Err(self.not_ready(function)),
        }
    }

    #[cold]
    #[inline(never)]
    fn not_ready(&self, function: Function) -> CallError {
        match function.is_legal_in(self.state) {
            true => CallError::MissingFunction { function },
            false => CallError::NotAllowed {
                function,
                state: self.state,
            },
        }
    }

    /// Makes a call and records it for the watching process; restores the rounding mode afterwards.
    #[inline(always)]
    pub(super) fn during<T>(&self, function: Function, call: impl FnOnce() -> T) -> T {
        let done = self.place.call(function.number(), call);
        surroundings::keep();
        done
    }

    /// Converts a returned status into a result and, if it is an error, into a state.
    #[inline]
    pub(super) fn check(
        &mut self,
        function: Function,
        status: fmi2::Status,
    ) -> Result<(), CallError> {
        match status {
            fmi2::Status::OK | fmi2::Status::WARNING => Ok(()),
            _ => Err(self.failed(function, status)),
        }
    }

    /// Takes the messages of a call that was not completed, and stores the last one.
    pub(super) fn take_words(&mut self) -> Vec<Message> {
        let messages = self.environment.take();
        if let Some(last) = messages.last() {
            self.words = Some(last.text.clone());
        }
        messages
    }

    /// The FMU's last message about a call that it did not complete (`fmi2Discard`, `fmi3Discard`).
    pub fn words_of_discard(&self) -> Option<&str> {
        self.words.as_deref()
    }

    /// Separated from the path of successful calls.
    #[cold]
    #[inline(never)]
    fn failed(&mut self, function: Function, status: fmi2::Status) -> CallError {
        use fmi2::Status;
        match status {
            // The value or the information is not available; the instance stays usable.
            Status::DISCARD => {
                let messages = self.take_words();
                return CallError::Failed {
                    function,
                    status,
                    messages,
                };
            }
            Status::FATAL => self.enter(fmi2::State::Fatal, fmi3::State::Fatal),
            _ => self.enter(fmi2::State::Error, fmi3::State::Error),
        }
        CallError::Failed {
            function,
            status,
            messages: self.environment.take(),
        }
    }

    /// Enters the state of its version.
    pub(super) fn enter(&mut self, state2: fmi2::State, state3: fmi3::State) {
        self.state = match self.state {
            State::Fmi2(_) => State::Fmi2(state2),
            State::Fmi3(_) => State::Fmi3(state3),
        };
    }
}
