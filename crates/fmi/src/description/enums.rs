//! The enumerated attributes, and the versions of the standard.

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

            /// The value as spelled in XML.
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $text),+ }
            }

            /// The value with that spelling.
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
    /// Role of a variable (FMI 2.0, section 2.2.7).
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
        /// FMI 3.0: a parameter that may size arrays; set in configuration mode.
        StructuralParameter = "structuralParameter",
    }
}

impl Causality {
    /// The values defined by a version of the standard.
    pub fn all(version: FmiVersion) -> &'static [Self] {
        match version {
            FmiVersion::V2 => &Self::ALL[..Self::ALL.len() - 1],
            FmiVersion::V3 => Self::ALL,
        }
    }
}

xml_enum! {
    /// How a variable may change over time (FMI 2.0, section 2.2.7).
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
    /// How names are structured (FMI 2.0, section 2.2.9).
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

xml_enum! {
    /// How the interval of a clock is determined (FMI 3.0, section 2.2.8.3, table of clock types).
    IntervalVariability {
        /// Periodic, with the interval in the description.
        Constant = "constant",
        /// Periodic; the interval may be set until initialization ends.
        Fixed = "fixed",
        /// Periodic; the interval may be set at events.
        Tunable = "tunable",
        /// The FMU provides the next interval at each tick.
        Changing = "changing",
        /// The FMU provides the interval at events.
        Countdown = "countdown",
        /// Ticks at events, without an interval.
        Triggered = "triggered",
    }
}

xml_enum! {
    /// The integer types; FMI 2.0 has only `Int32` and calls it `Integer`.
    IntegerType {
        /// 8 bits, signed.
        Int8 = "Int8",
        /// 8 bits, unsigned.
        UInt8 = "UInt8",
        /// 16 bits, signed.
        Int16 = "Int16",
        /// 16 bits, unsigned.
        UInt16 = "UInt16",
        /// 32 bits, signed.
        Int32 = "Int32",
        /// 32 bits, unsigned.
        UInt32 = "UInt32",
        /// 64 bits, signed.
        Int64 = "Int64",
        /// 64 bits, unsigned.
        UInt64 = "UInt64",
    }
}

impl IntegerType {
    /// The values that fit.
    pub fn range(self) -> std::ops::RangeInclusive<i128> {
        match self {
            Self::Int8 => i8::MIN.into()..=i8::MAX.into(),
            Self::UInt8 => 0..=u8::MAX.into(),
            Self::Int16 => i16::MIN.into()..=i16::MAX.into(),
            Self::UInt16 => 0..=u16::MAX.into(),
            Self::Int32 => i32::MIN.into()..=i32::MAX.into(),
            Self::UInt32 => 0..=u32::MAX.into(),
            Self::Int64 => i64::MIN.into()..=i64::MAX.into(),
            Self::UInt64 => 0..=u64::MAX.into(),
        }
    }
}

xml_enum! {
    /// The floating-point types; FMI 2.0 has only `Float64` and calls it `Real`.
    Precision {
        /// 64 bits.
        Double = "Float64",
        /// 32 bits.
        Single = "Float32",
    }
}

/// A version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub enum FmiVersion {
    /// FMI 2.0 and its maintenance releases, which all write `2.0`.
    #[default]
    V2,
    /// FMI 3.0 and later minor versions.
    V3,
}

impl std::fmt::Display for FmiVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::V2 => "2.0",
            Self::V3 => "3.0",
        })
    }
}

impl Default for Precision {
    /// The type that exists in both versions.
    fn default() -> Self {
        Self::Double
    }
}

impl Default for IntegerType {
    /// The type that exists in both versions.
    fn default() -> Self {
        Self::Int32
    }
}

impl Default for NamingConvention {
    /// The schema's default.
    fn default() -> Self {
        Self::Flat
    }
}
