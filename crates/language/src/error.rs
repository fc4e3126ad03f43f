//! Errors in model files.

use pilotage_text::document::{DocumentError, Position};
use pilotage_text::suggestion::did_you_mean;
use std::path::PathBuf;

/// Why a file is not a valid model.
#[derive(Debug, thiserror::Error)]
pub enum ModelFileError {
    /// Not TOML, or an unknown key.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A mistake at a position in the file.
    #[error("{file}:{position}: {fault}")]
    At {
        /// The file as named by the user.
        file: String,
        /// Line and column.
        position: Position,
        /// The mistake and its remedy.
        fault: Box<Fault>,
    },
    /// The file is too long.
    #[error("{file}: {size} bytes; a model file has at most {limit}")]
    TooLong {
        /// The file.
        file: String,
        /// Length in bytes.
        size: usize,
        /// Maximum length in bytes.
        limit: usize,
    },
}

/// A mistake at a position in a model file. Each message gives a remedy.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum Fault {
    // Lexical and syntax errors.
    #[error("`{0}` means nothing in an expression{hint}", hint = hint_for(.0))]
    Character(String),
    #[error("`{0}` is no number; write 12, 0.5 or 1e-3")]
    Number(String),
    #[error("expected {expected}, found {found}")]
    Expected { expected: String, found: String },
    #[error("brackets and signs are nested more than {limit} deep; put a part of it into a local")]
    TooDeep { limit: usize },
    #[error("the expression is empty; write a number, a name or a formula")]
    Empty,

    // The results of a fit.
    #[error("[uncertainty] {0}")]
    Uncertainty(String),

    // Names.
    #[error("unknown name `{name}`{}; known are {known}", did_you_mean(suggestion.as_deref()))]
    UnknownName {
        name: String,
        suggestion: Option<String>,
        known: String,
    },
    #[error("unknown function `{name}`{}; known are {known}", did_you_mean(suggestion.as_deref()))]
    UnknownFunction {
        name: String,
        suggestion: Option<String>,
        known: String,
    },
    #[error("`{name}` is {role}, not a function; for a product write `{name} * (...)`")]
    NoFunction { name: String, role: &'static str },
    #[error("`{name}` is a function; write `{form}`")]
    Uncalled {
        name: &'static str,
        form: &'static str,
    },
    #[error("`{name}` takes {takes}, found {found}; write `{form}`")]
    Arity {
        name: &'static str,
        takes: String,
        found: usize,
        form: &'static str,
    },
    #[error(
        "a comparison stands in the first place of `if(condition, a, b)` alone; write it there"
    )]
    StrayComparison,
    #[error("the first place of `if` takes a comparison, such as `x > 0`")]
    NoCondition,
    #[error("a text in quotes stands in `table(\"file.csv\", x)` alone")]
    StrayText,
    #[error("a circle without a state: {0}; put a state (a lag) between, or solve it by hand")]
    Circle(String),
    #[error("a circle: {0}; tie one of them to something else, or give it a start")]
    TiedCircle(String),
    #[error(
        "`{0}` has a limit, beyond which it saturates in a simulation and not in a fit; put what stands before \
         the limit into a local and use that"
    )]
    LimitedUsed(String),
    #[error(
        "{what} is computed once, from parameters and numbers; `{name}` is {role}{hint}",
        hint = if *.role == "a local" || *.role == "an output" { " that depends on others" } else { "" }
    )]
    NotConstant {
        what: &'static str,
        name: String,
        role: &'static str,
    },
    #[error("{what} follows from parameters, numbers and `time`; `{name}` is {role}")]
    NotOfTime {
        what: &'static str,
        name: String,
        role: &'static str,
    },

    // Delays and tables.
    #[error("the order of a delay is a whole number from 1 to {limit}; found `{found}`")]
    DelayOrder { found: String, limit: usize },
    #[error("a delay has states of its own: put it into a model file")]
    DelayOutside,
    #[error("a table belongs into a model file: put it into one")]
    TableOutside,
    #[error("the time of a delay is {0} s; it must be above 0")]
    DelayTime(f64),
    #[error("the first place of `table` is a file in quotes: `table(\"drag.csv\", speed)`")]
    NoTableFile,
    #[error(
        "the file of a table stands beside the model file: write its name alone, not `{0}`, and no other folder"
    )]
    TablePlace(String),
    #[error("the table `{file}` cannot be read: {source}")]
    TableUnread {
        file: String,
        source: std::io::Error,
    },
    #[error("the table `{file}`, line {line}: {reason}")]
    TableContent {
        file: String,
        line: usize,
        reason: String,
    },

    // Declarations.
    #[error(
        "`{0}` is no name; a name begins with a letter or `_` and goes on with letters, digits and `_`"
    )]
    NoName(String),
    #[error("`{0}` has a meaning of its own everywhere; choose another name")]
    Reserved(String),
    #[error("`{name}` is declared twice: it is {before} already; choose another name")]
    Twice { name: String, before: &'static str },
    #[error(
        "`{name}` is the name of a state that comes with a delay in `{of}`; choose another one"
    )]
    Clash { name: String, of: String },
    #[error(
        "the output `{name}` has no value, and no state or local is called so; write `{name} = {{ value = \"...\" }}`"
    )]
    NoValue { name: String },
    #[error(
        "the output `{0}` has a limit but no value of its own; write `{0} = {{ value = \"...\", limit = ... }}` \
         under a name that no state or local has"
    )]
    LimitWithoutValue(String),
    #[error("`{field} = {value}` is not a finite number; write a number such as 0.5")]
    NotFinite { field: String, value: f64 },
    #[error("`start = {start}` is out of the range {min} to {max}; move it or the range")]
    StartRange { start: f64, min: f64, max: f64 },
    #[error("`min = {min}` is above `max = {max}`; exchange them")]
    Range { min: f64, max: f64 },
    #[error("`nominal = {0}` is a typical magnitude; write a number above 0")]
    Nominal(f64),
    #[error("the limit goes from {low} to {high}; write the lower one first")]
    Limit { low: f64, high: f64 },
    #[error("the start value of `{name}` is {value}; it must be a finite number")]
    StartValue { name: String, value: f64 },
    #[error(
        "unknown unit `{unit}`{}; write it as in m/s2 or 1/(m.s), with the symbols {known}; `1` is without a dimension",
        did_you_mean(pilotage_units::respelt(.unit).as_deref())
    )]
    UnknownUnit { unit: String, known: String },
    #[error("the model declares nothing; add [states], [locals] or [outputs]")]
    NothingDeclared,
    #[error(
        "the model declares {found} variables, more than {limit}; divide it into several models"
    )]
    TooMany { found: usize, limit: usize },
    #[error("the model has {found} operations, more than {limit}; divide it into several models")]
    TooLarge { found: usize, limit: usize },

    // Units.
    #[error("the unit does not fit: {0}")]
    Unit(String),
}

/// A hint for unsupported characters.
fn hint_for(text: &str) -> &'static str {
    match text {
        "**" => "; a power is written x^2",
        "=" => "; a comparison for equality is written ==",
        "&&" | "||" | "&" | "|" | "!" => {
            "; conditions are combined by an `if` within an `if`, and by min and max"
        }
        "%" => "; there is no remainder",
        "[" | "]" | "{" | "}" => "; use round brackets",
        ";" => "; arguments are separated by commas",
        _ => "",
    }
}

/// A file that cannot be read.
pub(crate) fn unread(file: PathBuf, source: std::io::Error) -> ModelFileError {
    ModelFileError::Document(DocumentError::Read { file, source })
}
