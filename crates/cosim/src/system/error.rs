//! Why components cannot be wired as asked.

use crate::component::{Role, ValueKind};
use pilotage_text::suggestion::did_you_mean;
use thiserror::Error;

/// Why components cannot be wired as asked.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SystemError {
    /// Two instances of one name.
    #[error("two instances are named `{name}`; give one another name")]
    DuplicateInstance {
        /// The name.
        name: String,
    },
    /// A name that is no file's stem either.
    #[error("`{name}` cannot name an instance: it must not be empty")]
    EmptyInstance {
        /// The name.
        name: String,
    },
    /// A communication step in no parts.
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
        /// As given.
        text: String,
        /// What was taken for the instance's name.
        instance: String,
        /// The most similar name.
        suggestion: Option<String>,
        /// All names.
        known: Vec<String>,
    },
    /// A name without a variable.
    #[error("`{text}` names no variable; expected INSTANCE.VARIABLE{}", did_you_mean(suggestion.as_deref()))]
    NoVariable {
        /// As given.
        text: String,
        /// The one variable of that name.
        suggestion: Option<String>,
    },
    /// No such variable.
    #[error(
        "`{text}`: `{instance}` has no variable `{variable}`{}",
        did_you_mean(suggestion.as_deref())
    )]
    UnknownVariable {
        /// As given.
        text: String,
        /// Name of the instance.
        instance: String,
        /// What was taken for the variable's name.
        variable: String,
        /// The most similar name, with the instance.
        suggestion: Option<String>,
    },
    /// A connection does not begin at an output.
    #[error("`{from}` -> `{to}`: `{from}` is {role}, a connection begins at an output{}", other_way_round(*swapped, from, to))]
    NotAnOutput {
        /// Where the connection begins.
        from: String,
        /// Where it ends.
        to: String,
        /// What `from` is.
        role: Role,
        /// Whether it would be right the other way round.
        swapped: bool,
    },
    /// A connection does not end at an input.
    #[error("`{from}` -> `{to}`: `{to}` is {role}, a connection ends at an input")]
    NotAnInput {
        /// Where the connection begins.
        from: String,
        /// Where it ends.
        to: String,
        /// What `to` is.
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
    /// The ends are of different types.
    #[error("`{from}` -> `{to}`: {from_kind} cannot feed {to_kind}")]
    KindMismatch {
        /// Where the connection begins.
        from: String,
        /// Where it ends.
        to: String,
        /// Type of the output.
        from_kind: ValueKind,
        /// Type of the input.
        to_kind: ValueKind,
    },
    /// The ends are of different units.
    #[error(
        "`{from}` is in {from_unit} and `{to}` is in {to_unit}: one cannot be converted into the other"
    )]
    UnitMismatch {
        /// Where the connection begins.
        from: String,
        /// Where it ends.
        to: String,
        /// Unit of the output.
        from_unit: String,
        /// Unit of the input.
        to_unit: String,
    },
    /// An input is fed by two connections.
    #[error("`{to}` is fed twice: by `{first}` and by `{second}`")]
    FedTwice {
        /// The input.
        to: String,
        /// The first output.
        first: String,
        /// The second output.
        second: String,
    },
    /// A start value for an input that is fed by a connection.
    #[error("`{name}` is fed by `{from}`, so that its value cannot be set")]
    SetWhileFed {
        /// The input.
        name: String,
        /// The output that feeds it.
        from: String,
    },
    /// A start value for something that cannot have one.
    #[error("`{name}` is {role} and cannot be set; parameters and inputs can")]
    NotSettable {
        /// The variable.
        name: String,
        /// What it is.
        role: Role,
    },
    /// A start value that is no value of the variable's type.
    #[error("`{name}` is of type {kind}, `{text}` is not")]
    BadValue {
        /// The variable.
        name: String,
        /// Its type.
        kind: ValueKind,
        /// As given.
        text: String,
    },
    /// A start value that is no number.
    #[error("`{name}` cannot be NaN")]
    NotANumber {
        /// The variable.
        name: String,
    },
    /// A start value that the variable must not have.
    #[error("`{name}` cannot be {text}: it is from {} to {}{unit}", short(range[0]), short(range[1]))]
    OutOfRange {
        /// The variable.
        name: String,
        /// As given.
        text: String,
        /// Smallest and largest value.
        range: [f64; 2],
        /// A space and the unit, or nothing.
        unit: String,
    },
    /// Two start values for one variable.
    #[error("`{name}` is set twice")]
    SetTwice {
        /// The variable.
        name: String,
    },
}

/// A number as people write it.
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
