//! Single fields of a problem file.

use super::Read;
use crate::problem::error::ProblemError;
use crate::problem::file::Per;
use pilotage_cosim::description::Spanned;
use pilotage_text::document::{Place, TomlTable};
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_units::Base;

/// A mistake at a field's value, or at its name if the value is a separate table.
pub(super) fn at(table: TomlTable<'_>, field: &str, fault: impl Into<String>) -> ProblemError {
    ProblemError::at(&place(table, field), fault)
}

pub(super) fn place(table: TomlTable<'_>, field: &str) -> Place {
    let own = match table.is_table(field) {
        true => table.key_place(field),
        false => table.place(field),
    };
    own.or_else(|| table.key_place(field))
        .unwrap_or_else(|| place_of(table))
}

/// Place of a table.
pub(super) fn place_of(table: TomlTable<'_>) -> Place {
    let position = table.position("");
    Place {
        file: table.file().to_owned(),
        line: position.line,
        column: Some(position.column),
    }
}

/// A field whose value is one of several words.
pub(super) fn word<T: Copy>(
    table: TomlTable<'_>,
    field: &str,
    words: &[(&str, T)],
    default: T,
) -> Read<T> {
    let Some(found) = table.string(field)? else {
        return Ok(default);
    };
    one_of(words, found).map_err(|fault| at(table, field, fault))
}

fn one_of<T: Copy>(words: &[(&str, T)], found: &str) -> Result<T, String> {
    let names = || words.iter().map(|(name, _)| *name);
    let known = words.iter().find(|(name, _)| *name == found);
    known.map(|(_, value)| *value).ok_or_else(|| {
        let all: Vec<String> = names().map(|name| format!("\"{name}\"")).collect();
        let near = did_you_mean(suggestion(found, names()));
        format!("\"{found}\" is none of {}{near}", all.join(", "))
    })
}

pub(super) fn finite(table: TomlTable<'_>, field: &str) -> Read<Option<f64>> {
    let number = table.number(field)?;
    match number.filter(|number| !number.is_finite()) {
        Some(number) => {
            let fault =
                format!("`{field} = {number}` is not a finite number; leave it out, or write one");
            Err(at(table, field, fault))
        }
        None => Ok(number),
    }
}

pub(super) fn positive(table: TomlTable<'_>, field: &str) -> Read<Option<f64>> {
    let number = finite(table, field)?;
    match number.filter(|number| *number <= 0.0) {
        Some(number) => Err(at(
            table,
            field,
            format!("`{field} = {}`; expected a number above 0", shown(number)),
        )),
        None => Ok(number),
    }
}

/// A number in its shorter form: 1e-8 and 3, not 0.00000001 or 3.0.
fn shown(number: f64) -> String {
    let [plain, other] = [format!("{number}"), format!("{number:?}")];
    match other.len() < plain.len() {
        true => other,
        false => plain,
    }
}

/// A tolerance within floating-point resolution and at most one, since the quantity it bounds is scaled to the order of
/// one.
pub(super) fn tolerance(table: TomlTable<'_>, field: &str) -> Read<Option<f64>> {
    const LEAST: f64 = 1e-14;
    const MOST: f64 = 1.0;
    match positive(table, field)? {
        Some(number) if number < LEAST => {
            let number = shown(number);
            let fault =
                format!("`{field} = {number}` is finer than numbers are; write {LEAST:?} or more");
            Err(at(table, field, fault))
        }
        Some(number) if number > MOST => {
            let number = shown(number);
            let fault =
                format!("`{field} = {number}` would let anything pass; write {MOST:?} or less");
            Err(at(table, field, fault))
        }
        other => Ok(other),
    }
}

/// The name of a unit.
pub(super) fn unit(table: TomlTable<'_>) -> Read<Option<String>> {
    let name = table.string("unit")?;
    match name.filter(|name| Base::in_modelicas_spelling(name).is_none()) {
        Some(name) => {
            let near = did_you_mean(pilotage_units::respelt(name).as_deref());
            let fault = format!(
                "unknown unit `{name}`{near}; write it as in m/s2 or 1/(m.s), `1` where there is no dimension, or leave \
                 it out"
            );
            Err(at(table, "unit", fault))
        }
        None => Ok(name.map(str::to_owned)),
    }
}

pub(super) fn whole(table: TomlTable<'_>, field: &str, default: usize, most: usize) -> Read<usize> {
    let Some(number) = finite(table, field)? else {
        return Ok(default);
    };
    match number.fract() == 0.0 && (1.0..=most as f64).contains(&number) {
        true => Ok(number as usize),
        false => {
            let number = shown(number);
            let fault = format!("`{field} = {number}`; expected a whole number from 1 to {most}");
            Err(at(table, field, fault))
        }
    }
}

pub(super) fn range(table: TomlTable<'_>) -> Read<[Option<f64>; 2]> {
    let [min, max] = [finite(table, "min")?, finite(table, "max")?];
    match (min, max) {
        (Some(least), Some(most)) if least > most => {
            let fault = format!("`min = {least}` is above `max = {most}`; exchange them");
            Err(at(table, "max", fault))
        }
        _ => Ok([min, max]),
    }
}

pub(super) fn column(table: TomlTable<'_>, field: &str) -> Read<Spanned<String>> {
    let name = table.required(field, table.string(field)?)?;
    Ok(Spanned {
        value: name.to_owned(),
        place: table.place(field),
    })
}

pub(super) fn per(table: TomlTable<'_>) -> Read<Per> {
    word(
        table,
        "per",
        &[("run", Per::Run), ("subject", Per::Subject)],
        Per::All,
    )
}
