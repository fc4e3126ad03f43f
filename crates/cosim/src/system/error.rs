//! Errors in the connections and start values of a system.

use crate::component::{Role, ValueKind};
use pilotage_text::suggestion::did_you_mean;
use thiserror::Error;

/// Why components cannot be connected or set as requested.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SystemError {
    /// Two instances with the same name.
    #[error("two instances are named `{name}`; give one another name")]
    DuplicateInstance {
        /// The name.
        name: String,
    },
    /// An empty name, such as that of a file without a stem.
    #[error("`{name}` cannot name an instance: it must not be empty")]
    EmptyInstance {
        /// The name.
        name: String,
    },
    /// A communication step divided into 0 parts.
    #[error("`{name}` cannot take a step in 0 parts; 1 is the communication step itself")]
    NoParts {
        /// Name of the instance.
        name: String,
    },
    /// No such instance.
    #[error(
        "`{text}`: there is no instance `{instance}`{}, known are {}",
        did_you_mean(suggestion.as_deref()),
        list(known)
    )]
    UnknownInstance {
        /// The given text.
        text: String,
        /// The part taken as the instance's name.
        instance: String,
        /// The most similar name.
        suggestion: Option<String>,
        /// All names.
        known: Vec<String>,
    },
    /// A name without a variable.
    #[error("`{text}` names no variable; expected INSTANCE.VARIABLE{}", did_you_mean(suggestion.as_deref()))]
    NoVariable {
        /// The given text.
        text: String,
        /// The variable with that name, if there is exactly one.
        suggestion: Option<String>,
    },
    /// No such variable.
    #[error(
        "`{text}`: `{instance}` has no variable `{variable}`{}",
        did_you_mean(suggestion.as_deref())
    )]
    UnknownVariable {
        /// The given text.
        text: String,
        /// Name of the instance.
        instance: String,
        /// The part taken as the variable's name.
        variable: String,
        /// The most similar name, prefixed by the instance.
        suggestion: Option<String>,
    },
    /// The source of a connection is not an output.
    #[error("`{from}` -> `{to}`: `{from}` is {role}, a connection begins at an output{}", other_way_round(*swapped, from, to))]
    NotAnOutput {
        /// The source.
        from: String,
        /// The target.
        to: String,
        /// Role of `from`.
        role: Role,
        /// Whether the reversed connection would be valid.
        swapped: bool,
    },
    /// The target of a connection is not an input.
    #[error("`{from}` -> `{to}`: `{to}` is {role}, a connection ends at an input")]
    NotAnInput {
        /// The source.
        from: String,
        /// The target.
        to: String,
        /// Role of `to`.
        role: Role,
    },
    /// Arrays of different dimensions.
    #[error(
        "`{from}` -> `{to}`: the arrays have {from_elements} and {to_elements} elements, or different \
         dimensions; connect single elements, such as `{from}[1]`"
    )]
    SizeMismatch {
        /// The output.
        from: String,
        /// Number of its elements.
        from_elements: usize,
        /// The input.
        to: String,
        /// Number of its elements.
        to_elements: usize,
    },
    /// The types of the ends do not match.
    #[error("`{from}` -> `{to}`: {from_kind} cannot feed {to_kind}")]
    KindMismatch {
        /// The source.
        from: String,
        /// The target.
        to: String,
        /// Type of the output.
        from_kind: ValueKind,
        /// Type of the input.
        to_kind: ValueKind,
    },
    /// The units of the ends do not match.
    #[error(
        "`{from}` is in {from_unit} and `{to}` is in {to_unit}: one cannot be converted into the other"
    )]
    UnitMismatch {
        /// The source.
        from: String,
        /// The target.
        to: String,
        /// Unit of the output.
        from_unit: String,
        /// Unit of the input.
        to_unit: String,
    },
    /// A factor or an offset for values that are not real.
    #[error("`{from}` -> `{to}`: a factor and an offset are for Reals alone")]
    NotTransformed {
        /// The source.
        from: String,
        /// The target.
        to: String,
    },
    /// Other values for those of an output that is real or a text.
    #[error("`{from}` -> `{to}`: a map is for Booleans, integers and enumerations")]
    NotMapped {
        /// The source.
        from: String,
        /// The target.
        to: String,
    },
    /// A map with two values for one.
    #[error("the map of a wire from `{name}` names its value `{value}` twice")]
    MappedTwice {
        /// The output.
        name: String,
        /// The value.
        value: String,
    },
    /// An input with two connections.
    #[error("`{to}` is fed twice: by `{first}` and by `{second}`")]
    FedTwice {
        /// The input.
        to: String,
        /// The first output.
        first: String,
        /// The second output.
        second: String,
    },
    /// A start value for a connected input.
    #[error("`{name}` is fed by `{from}`, so that its value cannot be set")]
    SetWhileFed {
        /// The input.
        name: String,
        /// The output that feeds it.
        from: String,
    },
    /// A start value for a variable that cannot be set.
    #[error("`{name}` is {role} and cannot be set; parameters and inputs can")]
    NotSettable {
        /// The variable.
        name: String,
        /// Its role.
        role: Role,
    },
    /// A start value that is not valid for the variable's type.
    #[error("`{name}` is of type {kind}, `{text}` is not")]
    BadValue {
        /// The variable.
        name: String,
        /// Its type.
        kind: ValueKind,
        /// The given text.
        text: String,
        /// The names and values of an enumeration.
        items: Vec<(String, i64)>,
    },
    /// A start value that is not a number.
    #[error("`{name}` cannot be NaN")]
    NotANumber {
        /// The variable.
        name: String,
    },
    /// A start value outside the variable's range.
    #[error("`{name}` cannot be {text}: it is from {} to {}{unit}", short(range[0]), short(range[1]))]
    OutOfRange {
        /// The variable.
        name: String,
        /// The given text.
        text: String,
        /// Smallest and largest value.
        range: [f64; 2],
        /// A space and the unit, or an empty string.
        unit: String,
    },
    /// Two start values for the same variable.
    #[error("`{name}` is set twice")]
    SetTwice {
        /// The variable.
        name: String,
    },
}

/// A number in short notation.
fn short(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").unwrap_or(&text).to_owned()
}

fn other_way_round(swapped: bool, from: &str, to: &str) -> String {
    match swapped {
        true => format!("; did you mean `{to}` -> `{from}`?"),
        false => String::new(),
    }
}

fn list(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    quoted.join(", ")
}
