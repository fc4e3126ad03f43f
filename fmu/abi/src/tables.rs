//! Macros for the tables of both versions.

/// Declares the functions of a version, by part: name, symbol, legal states, pointer type.
macro_rules! functions {
    (
        common { $($common:tt)* }
        co_simulation { $($co_simulation:tt)* }
        model_exchange { $($model_exchange:tt)* }
        scheduled_execution { $($scheduled_execution:tt)* }
    ) => {
        $crate::tables::functions! { @split
            [Common $($common)*]
            [CoSimulation $($co_simulation)*]
            [ModelExchange $($model_exchange)*]
            [ScheduledExecution $($scheduled_execution)*]
        }
    };
    (@split $([$part:ident
        $($(#[$doc:meta])* $name:ident, $c_name:literal, $states:expr,
            ($($arg:ty),* $(,)?) -> $returns:ty;)*
    ])*) => {
        /// Pointer types of the functions, named after them without the version's prefix.
        pub mod pointers {
            use super::*;
            $($($(#[$doc])* pub type $name = unsafe extern "C" fn($($arg),*) -> $returns;)*)*
        }

        /// A function of the interface.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Function {
            $($($(#[$doc])* $name,)*)*
        }

        impl Function {
            /// All functions, the common ones first.
            pub const ALL: &[Self] = &[$($(Self::$name,)*)*];

            /// Name of the exported symbol.
            pub const fn symbol(self) -> &'static CStr {
                match self {
                    $($(Self::$name => $c_name,)*)*
                }
            }

            /// The states in which the function may be called.
            pub const fn legal_states(self) -> States {
                match self {
                    $($(Self::$name => $states,)*)*
                }
            }

            /// The part of the interface that the function belongs to.
            pub const fn part(self) -> $crate::Part {
                match self {
                    $($(Self::$name => $crate::Part::$part,)*)*
                }
            }

            /// Name of the function.
            pub fn name(self) -> &'static str {
                self.symbol().to_str().unwrap_or_default()
            }

            /// Whether the function may be called in `state`.
            pub const fn is_legal_in(self, state: State) -> bool {
                self.legal_states().contains(state)
            }
        }
    };
}

/// Declares the set type of a state enum whose values are single bits.
macro_rules! states {
    ($State:ident, $bits:ty) => {
        /// A set of states.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct States($bits);

        impl States {
            /// The set of the given states.
            pub const fn of(states: &[$State]) -> Self {
                let mut bits = 0;
                let mut i = 0;
                while i < states.len() {
                    bits |= states[i] as $bits;
                    i += 1;
                }
                Self(bits)
            }

            /// Whether `state` is in the set.
            pub const fn contains(self, state: $State) -> bool {
                self.0 & state as $bits != 0
            }

            /// The states of the set, in the order of the standard's tables.
            pub fn iter(self) -> impl Iterator<Item = $State> {
                $State::ALL.into_iter().filter(move |s| self.contains(*s))
            }
        }
    };
}

pub(crate) use {functions, states};
