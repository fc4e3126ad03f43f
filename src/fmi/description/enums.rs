//! The enumerated attributes of variables and dependencies.

/// Declares an enum whose variants are spelled in XML as given, with both conversions.
macro_rules! xml_enum {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $name {
            $($(#[$vdoc])* $variant,)+
        }

        impl $name {
            /// Every value, in the standard's order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The value as it is spelled in XML.
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $text),+ }
            }

            /// The value of that spelling.
            pub fn parse(text: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|v| v.as_str() == text)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }
    };
}

xml_enum! {
    /// What a variable is for (FMI 2.0, section 2.2.7).
    Causality {
        /// Set by the environment, constant in time.
        Parameter = "parameter",
        /// Computed by the FMU from parameters.
        CalculatedParameter = "calculatedParameter",
        /// Provided by another model.
        Input = "input",
        /// May be used by another model.
        Output = "output",
        /// Internal; not to be connected.
        Local = "local",
        /// The independent variable, usually time.
        Independent = "independent",
    }
}

xml_enum! {
    /// How a variable may change in time (FMI 2.0, section 2.2.7).
    Variability {
        /// Never changes.
        Constant = "constant",
        /// Fixed after initialization.
        Fixed = "fixed",
        /// A parameter that may change between communication points.
        Tunable = "tunable",
        /// Changes at events or communication points only.
        Discrete = "discrete",
        /// May change at any time; reals only.
        Continuous = "continuous",
    }
}

xml_enum! {
    /// How a variable gets its value at initialization (FMI 2.0, section 2.2.7).
    Initial {
        /// It is the start value.
        Exact = "exact",
        /// The start value is a guess for an iteration.
        Approx = "approx",
        /// Computed from other variables; no start value.
        Calculated = "calculated",
    }
}

xml_enum! {
    /// How names are built (FMI 2.0, section 2.2.9).
    NamingConvention {
        /// Any string.
        Flat = "flat",
        /// Hierarchical names, `body.q[1]`, `der(x)`.
        Structured = "structured",
    }
}

xml_enum! {
    /// How an unknown depends on a known (FMI 2.0, section 2.2.8).
    DependencyKind {
        /// No particular structure.
        Dependent = "dependent",
        /// Linear with a constant factor.
        Constant = "constant",
        /// Linear with a factor fixed after initialization.
        Fixed = "fixed",
        /// Linear with a tunable factor.
        Tunable = "tunable",
        /// Linear with a factor that changes at events.
        Discrete = "discrete",
    }
}

impl Default for NamingConvention {
    /// The schema's default.
    fn default() -> Self {
        Self::Flat
    }
}
