//! Checks that two problems have the same data: likelihoods of different data cannot be compared.

use crate::posed::Posed;
use crate::problem::error::ProblemError;
use crate::problem::file::Quantity;
use pilotage_units::Unit;
use std::path::PathBuf;

/// Relative difference of recorded values that is attributed to rounding in unit conversions.
const ROUNDING: f64 = 1e-9;

/// Rejects a problem whose runs, weights or recorded values differ from those of the first. Recorded values are
/// compared in the unit of the signal, on which their density depends.
///
/// # Errors
/// With both files, what differs, and how to correct it.
pub(crate) fn check_same(first: &Posed<'_>, other: &Posed<'_>) -> Result<(), ProblemError> {
    let (own, before) = (&other.file.file, &first.file.file);
    let differs = if paths(first) != paths(other) {
        Some("other runs are fitted, or in another order")
    } else if columns(first) != columns(other) {
        Some("other columns are measured")
    } else {
        None
    };
    let fault = differs.map(|differs| {
        format!(
            "{differs} than in {before}: likelihoods of different data cannot be compared; name the same `[[run]]` and \
             `[[measured]]` columns in both"
        )
    });
    let fault = fault.or_else(|| weights(first, other));
    match fault.or_else(|| values(first, other)) {
        Some(fault) => Err(ProblemError::Part(format!("{own}: {fault}"))),
        None => Ok(()),
    }
}

fn paths(posed: &Posed<'_>) -> Vec<PathBuf> {
    let path = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    posed.data.iter().map(|run| path(&run.line.file)).collect()
}

/// The measured columns with the numbers of their lines, sorted: their order in the file does not matter.
fn lines<'p>(posed: &'p Posed<'_>) -> Vec<(&'p str, usize)> {
    let lines = posed.file.measured.iter().enumerate();
    let mut all: Vec<(&str, usize)> = lines
        .map(|(k, own)| (own.column.value.as_str(), k))
        .collect();
    all.sort_unstable();
    all
}

fn columns<'p>(posed: &'p Posed<'_>) -> Vec<&'p str> {
    lines(posed).into_iter().map(|(column, _)| column).collect()
}

/// A run with a different weight, in words.
fn weights(first: &Posed<'_>, other: &Posed<'_>) -> Option<String> {
    let mut pairs = first.data.iter().zip(&other.data);
    let (before, own) = pairs.find(|(before, own)| before.line.weight != own.line.weight)?;
    Some(format!(
        "the run {} has the weight {}, and {} in {}: weighted likelihoods cannot be compared unless the weights are the \
         same; write the same `weight` in both",
        own.name(),
        own.line.weight,
        before.line.weight,
        first.file.file
    ))
}

/// A column whose values differ from those of the first problem, in words.
fn values(first: &Posed<'_>, other: &Posed<'_>) -> Option<String> {
    let mut pairs = lines(first).into_iter().zip(lines(other));
    let differ = |((_, k), (_, own)): &((&str, usize), (&str, usize))| {
        !are_near(&recorded(first, *k), &recorded(other, *own))
    };
    let ((column, k), (_, own)) = pairs.find(differ)?;
    let unit = |posed: &Posed<'_>, k: usize| posed.unit_of(k).unwrap_or("no unit").to_owned();
    let (before, unit) = (unit(first, k), unit(other, own));
    let difference = format!(
        "the column `{column}` is read in {unit}, and in {before} in {}",
        first.file.file
    );
    let advice = match Unit::named(&unit).conversion(&Unit::named(&before)) {
        Some(conversion) if unit != before => format!(
            "; write expression = \"{} * {}\" with unit = \"{before}\" and its sd here",
            conversion.factor,
            name(&other.file.measured[own].of)
        ),
        _ => String::new(),
    };
    Some(format!(
        "{difference}: a density depends on the unit, and likelihoods of different data cannot be compared{advice}"
    ))
}

/// The measured quantity, as written in the file.
fn name(quantity: &Quantity) -> String {
    match quantity {
        Quantity::Signal(name) => name.clone(),
        Quantity::Expression(formula, _) => format!("({})", formula.expression.text),
    }
}

/// The recorded numbers of a measured signal in all runs, in the unit of the signal.
fn recorded(posed: &Posed<'_>, k: usize) -> Vec<Vec<f64>> {
    let finite = |run: &Vec<f64>| run.iter().copied().filter(|y| y.is_finite()).collect();
    posed.quantities.recorded[k].iter().map(finite).collect()
}

/// Whether numbers are equal up to rounding.
fn are_near(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
    let is_run =
        |(a, b): (&Vec<f64>, &Vec<f64>)| a.len() == b.len() && a.iter().zip(b).all(is_near);
    a.len() == b.len() && a.iter().zip(b).all(is_run)
}
