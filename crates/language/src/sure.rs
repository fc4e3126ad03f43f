//! Check of `[uncertainty]`, the results of a fit for the parameters of a model. The equations do not depend on it, but
//! people and other tools read it, so inconsistent values are rejected.

use crate::error::Fault;
use pilotage_text::document::{DocumentError, TomlTable};

/// The table in which a fit reports the uncertainty of its parameters.
pub const TITLE: &str = "uncertainty";
/// Largest standard deviation of a held parameter, relative to the reported one.
const HELD: f64 = 1e-9;

/// Relative rounding of written values.
const ROUNDED: f64 = 1e-6;

/// What a fit left about the uncertainty of its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Names of the parameters, among which starts of states and inputs may be.
    pub parameters: Vec<String>,
    /// Their covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl Uncertainty {
    /// Reads the table, which was [checked](check); `None` without a covariance.
    ///
    /// # Errors
    /// If a value has the wrong type.
    pub(crate) fn read(table: TomlTable<'_>) -> Result<Option<Self>, DocumentError> {
        let names = table.strings("parameters")?.unwrap_or_default();
        let covariance = table.rows("covariance")?.unwrap_or_default();
        Ok((!names.is_empty()).then(|| Self {
            parameters: names.into_iter().map(|(name, _)| name.to_owned()).collect(),
            covariance,
        }))
    }
}

/// A fault and its byte offset in the text.
pub type Misplaced = (usize, Fault);

/// Checks the table; `is_known` tests the names of the file.
///
/// # Errors
/// If a value has the wrong type.
pub fn check(
    table: TomlTable<'_>,
    is_known: &dyn Fn(&str) -> bool,
) -> Result<Option<Misplaced>, DocumentError> {
    table.only(&[
        "method",
        "correlated_by",
        "parameters",
        "degrees_of_freedom",
        "covariance",
        "intervals",
    ])?;
    table.string("method")?;
    table.string("correlated_by")?;
    let names = table.strings("parameters")?.unwrap_or_default();
    let fault = |field: &str, words: String| {
        let byte = table.byte_of_name(field);
        Ok(Some((byte, Fault::Uncertainty(words))))
    };
    if let Some(k) = names.iter().position(|(name, _)| !is_known(name)) {
        let words = format!("`{}` is no variable of the model", names[k].0);
        let byte = table.content("parameters", Some(k)).byte(0);
        return Ok(Some((byte, Fault::Uncertainty(words))));
    }
    let is_again = |k: &usize| names[..*k].iter().any(|own| own.0 == names[*k].0);
    if let Some(k) = (0..names.len()).find(is_again) {
        let words = format!("`{}` stands twice among its parameters", names[k].0);
        let byte = table.content("parameters", Some(k)).byte(0);
        return Ok(Some((byte, Fault::Uncertainty(words))));
    }
    let count = names.len();
    let degrees = table.numbers("degrees_of_freedom")?.unwrap_or_default();
    let is_positive = degrees.iter().all(|own| *own > 0.0);
    if degrees.len() != count || !is_positive {
        let words = format!("degrees_of_freedom is not {count} numbers above 0");
        return fault("degrees_of_freedom", words);
    }
    let rows = table.rows("covariance")?.unwrap_or_default();
    if let Some(words) = wrong(&rows, count) {
        return fault("covariance", format!("covariance {words}"));
    }
    let Some(intervals) = table.table("intervals")? else {
        return Ok(None);
    };
    for name in intervals.names() {
        if !is_known(name) {
            let words = format!("`{name}` is no variable of the model");
            let byte = intervals.byte_of_name(name);
            return Ok(Some((byte, Fault::Uncertainty(words))));
        }
        let own = intervals.required(name, intervals.table(name)?)?;
        own.only(&["sd", "low", "high"])?;
        let [sd, low, high] = [own.number("sd")?, own.number("low")?, own.number("high")?];
        let place = names.iter().position(|(own, _)| *own == name);
        // A parameter on a bound is held, and has no variance apart from rounding errors.
        let variance = place.map(|k| rows[k][k]);
        let variance = variance.filter(|own| own.sqrt() > HELD * sd.unwrap_or(0.0));
        let words = match (sd, low, high) {
            (Some(sd), ..) if sd.is_nan() || sd < 0.0 => Some(format!("sd of `{name}` is {sd}")),
            (_, Some(low), Some(high)) if low.is_nan() || high.is_nan() || low > high => {
                Some(format!("of `{name}` low is {low} and high {high}"))
            }
            (Some(sd), ..) => variance.filter(|own| !is_near(own.sqrt(), sd)).map(|own| {
                let other = own.sqrt();
                format!("`{name}` has sd = {sd}, and the covariance says {other}")
            }),
            _ => None,
        };
        if let Some(words) = words {
            let byte = intervals.byte_of_name(name);
            return Ok(Some((byte, Fault::Uncertainty(words))));
        }
    }
    Ok(None)
}

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDED * a.abs().max(b.abs())
}

/// Why a matrix is not a covariance of `count` parameters.
fn wrong(rows: &[Vec<f64>], count: usize) -> Option<String> {
    if rows.len() != count || rows.iter().any(|row| row.len() != count) {
        return Some(format!("is not {count} rows of {count} numbers"));
    }
    if rows.iter().flatten().any(|value| !value.is_finite()) {
        return Some("is not finite".to_owned());
    }
    for i in 0..count {
        for j in 0..=i {
            let most = (rows[i][i] * rows[j][j]).sqrt();
            if rows[i][i] < 0.0 || rows[i][j].abs() > most * (1.0 + ROUNDED) {
                return Some(format!(
                    "has {} in row {}, more than its variances allow",
                    rows[i][j],
                    i + 1
                ));
            }
            if !is_near(rows[i][j], rows[j][i]) {
                return Some(format!(
                    "is not symmetric: row {} has {}, row {} has {}",
                    i + 1,
                    rows[i][j],
                    j + 1,
                    rows[j][i]
                ));
            }
        }
    }
    None
}
