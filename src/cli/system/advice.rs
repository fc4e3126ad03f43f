//! Hints for connections and values that do not fit.

use super::super::Failure;
use crate::cosim::description::EntryError;
use crate::cosim::{SystemError, ValueKind};
use crate::document;

/// The failure for an entry, with its place and a hint.
pub fn explain(entry: EntryError) -> Failure {
    let advice = advice(&entry.error);
    let failure = Failure::from(*entry.error).at(entry.place.as_ref());
    match advice {
        Some(advice) => failure.hint(advice),
        None => failure,
    }
}

fn advice(error: &SystemError) -> Option<String> {
    Some(match error {
        SystemError::UnknownVariable {
            suggestion: None, ..
        } => "`pilotage info FILE` lists the variables of an FMU".into(),
        SystemError::NotAnOutput { swapped: false, .. } | SystemError::NotAnInput { .. } => {
            "`pilotage info FILE` lists inputs and outputs".into()
        }
        SystemError::KindMismatch { .. } => {
            "Integers feed Reals and Enumerations, Booleans feed Integers and Reals, Enumerations and whole Reals \
             feed Integers; connect a variable of such a type"
                .into()
        }
        SystemError::OutOfRange { .. } => "give it a value within, or change the model's limits".into(),
        SystemError::NotANumber { .. } => value(ValueKind::Real, ""),
        SystemError::UnitMismatch { .. } => {
            "connect what means the same quantity, or put a model between them".into()
        }
        SystemError::FedTwice { .. } => "an input has one source: leave one of the two out".into(),
        SystemError::SetWhileFed { .. } => "leave the value or the connection out".into(),
        SystemError::SetTwice { .. } => "leave one of the two values out".into(),
        SystemError::BadValue { items, .. } if !items.is_empty() => one_of(items),
        SystemError::BadValue { kind, text, .. } => value(*kind, text),
        _ => return None,
    })
}

/// The items of an enumeration, of which a long list is shortened.
fn one_of(items: &[(String, i64)]) -> String {
    const SHOWN: usize = 8;
    let shown = items.iter().take(SHOWN);
    let shown: Vec<String> = shown
        .map(|(name, value)| format!("`{name}` ({value})"))
        .collect();
    let more = match items.len() > SHOWN {
        true => " and more; `pilotage info FILE` lists them",
        false => "",
    };
    format!(
        "write the name or the number of one: {}{more}",
        shown.join(", ")
    )
}

/// How a value of this type is written.
fn value(kind: ValueKind, text: &str) -> String {
    if let Some(number) = document::with_point(text) {
        return format!("write a decimal point: {number}");
    }
    match kind {
        ValueKind::Real => "write a number, such as 1.5".into(),
        ValueKind::Integer | ValueKind::Enumeration => "write a whole number, such as 2".into(),
        ValueKind::Boolean => "write true or false".into(),
        ValueKind::String => "write text".into(),
    }
}
