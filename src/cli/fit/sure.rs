//! The uncertainty of a problem fit, for people and for scripts.

use crate::cli::terminal;
use crate::estimation::result::{Found, RunFit};
use crate::estimation::uncertainty::Uncertainty;
use crate::estimation::{Fit, Posed};
use crate::inference::{Class, Interval, LEVEL, Method};
use nalgebra::DMatrix;
use pilotage_text::number::significant;
use serde_json::{Map, Value, json};

/// A field of an interval in JSON.
type Field = fn(&Interval) -> Value;

/// The fields of an interval in JSON, by name.
const FIELDS: [(&str, Field); 4] = [
    ("sd", |own| json!(own.sd)),
    ("low", |own| json!(own.low)),
    ("high", |own| json!(own.high)),
    ("class", |own| json!(own.class.as_str())),
];

/// Description of the intervals of a method.
fn how(method: Method) -> &'static str {
    match method {
        Method::Plain => "95 % intervals (plain: for residuals without colour)",
        Method::Sidpac => "95 % intervals (sidpac: with the autocorrelations of the residuals)",
        Method::Ar => "95 % intervals (ar: with autoregressive noise)",
        Method::Cr3 => "95 % intervals (cr3: by leaving out one run at a time)",
    }
}

/// The rows of a matrix for `--json`.
fn reals(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect()).collect()
}

/// Ratio of standard deviation to value below which a parameter is well determined: half of the limit of Tischler &
/// Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., section 12.3, for the Cramér–Rao bound, which is
/// twice a standard deviation.
const WELL_DETERMINED: f64 = 0.1;

/// A sentence with the number of well-determined parameters.
fn well_determined<'i>(all: impl Iterator<Item = (f64, &'i Interval)>) -> String {
    let (mut well, mut count) = (0, 0);
    for (value, interval) in all {
        count += 1;
        well += usize::from(interval.sd < WELL_DETERMINED * value.abs());
    }
    format!(
        "{well} of {count} parameters are well determined, by a standard deviation of their intervals below {:.0} % of the \
         value.",
        100.0 * WELL_DETERMINED
    )
}

/// Each parameter with the intervals of its values; `None` if not known.
pub fn of(fit: &Fit) -> impl Iterator<Item = (&Found, Option<&[Interval]>)> {
    let known = fit.uncertainty.as_ref().ok();
    let parameters = fit.parameters.iter().enumerate();
    parameters.map(move |(k, found)| (found, known.map(|own| own.intervals[k].as_slice())))
}

/// The same for quantities derived from the parameters.
pub fn derived(fit: &Fit) -> impl Iterator<Item = (&Found, Option<&[Interval]>)> {
    let known = fit.uncertainty.as_ref().ok();
    let derived = fit.derived.iter().enumerate();
    derived.map(move |(k, found)| (found, known.map(|own| own.derived[k].as_slice())))
}

/// The interval of each estimated initial state in each run.
pub fn initial(posed: &Posed<'_>, fit: &Fit) -> Value {
    let known = fit.uncertainty.as_ref().ok();
    let all = fit
        .initial(posed)
        .into_iter()
        .enumerate()
        .map(|(k, found)| {
            let of_run = |(j, run): (usize, &RunFit)| {
                let own = known.and_then(|known| known.initial[k][j].as_ref())?;
                let fields = FIELDS.map(|(name, field)| (name.to_owned(), field(own)));
                Some((
                    run.name.clone(),
                    Value::Object(fields.into_iter().collect()),
                ))
            };
            let runs = fit.runs.iter().enumerate().filter_map(of_run);
            (found.name, Value::Object(runs.collect()))
        });
    Value::Object(all.collect())
}

/// Adds the fields `sd`, `low`, `high` and `class` of a parameter.
pub fn add_to(entry: &mut Map<String, Value>, found: &Found, intervals: &[Interval]) {
    for (name, field) in FIELDS {
        let value = match (found.values.as_slice(), intervals) {
            ([(None, _)], [one]) => field(one),
            (values, all) => {
                let pairs = values.iter().zip(all);
                let all =
                    pairs.map(|((label, _), own)| (label.clone().unwrap_or_default(), field(own)));
                Value::Object(all.collect())
            }
        };
        entry.insert(name.into(), value);
    }
}

/// The uncertainty of the fit as a whole.
pub fn to_json(fit: &Fit) -> Value {
    let own = match &fit.uncertainty {
        Ok(own) => own,
        Err(reason) => return json!({ "reason": reason.to_string() }),
    };
    let covariance = &own.covariance;
    json!({
        "method": own.method.as_str(),
        "level": LEVEL,
        "penalised": own.is_penalised,
        "degrees_of_freedom": covariance.degrees,
        "noise": own.noise,
        "parameters": own.names,
        "covariance": reals(&covariance.matrix),
        "correlations": reals(&own.correlations),
        "correlated_by": own.correlated_by.as_str(),
        "cramer_rao_percent": own.cramer_rao,
        "insensitivity_percent": own.insensitivity,
        "mesh_error": own.mesh_errors,
        "notes": own.notes,
    })
}

/// Standard deviation, lower and upper bound, and remark, as table cells; empty if not known.
pub fn cells(interval: Option<&Interval>) -> [String; 4] {
    let Some(own) = interval else {
        return Default::default();
    };
    let remark = match own.class {
        Class::Finite => "",
        Class::OneSided => "one-sided: the data do not exclude the end of its range",
        Class::Flat => "flat: the data do not determine it",
        Class::OnBound => "one-sided, on its bound",
        Class::Held => {
            "held: by active constraints, nothing that is sought changes it, or residuals are rounding errors"
        }
        Class::Undefined => "no finite number with what was found",
    };
    let [low, high] = [own.low, own.high].map(|end| cell(end, 5));
    [cell(own.sd, 3), low, high, remark.to_owned()]
}

/// A number with the given number of digits; a dash if it is not finite.
fn cell(value: f64, digits: usize) -> String {
    match value.is_finite() {
        true => significant(value, digits),
        false => "-".to_owned(),
    }
}

/// Cramér–Rao bound and insensitivity of a shared parameter \[%\], as table cells.
pub fn percents(fit: &Fit, name: &str) -> [String; 2] {
    let known = fit.uncertainty.as_ref().ok().and_then(|own| {
        let place = own
            .names
            .iter()
            .position(|own| own.trim_start_matches("ln ") == name)?;
        Some([own.cramer_rao[place], own.insensitivity[place]])
    });
    known.map_or_else(Default::default, |own| own.map(|percent| cell(percent, 3)))
}

/// A sentence about the uncertainty of a fit.
pub fn in_a_sentence(fit: &Fit) -> String {
    match &fit.uncertainty {
        Ok(own) => {
            let all = fit.parameters.iter().zip(&own.intervals);
            let values = all
                .flat_map(|(found, intervals)| found.values.iter().map(|own| own.1).zip(intervals));
            well_determined(values)
        }
        Err(reason) => format!("How sure it is is not known: {reason}."),
    }
}

/// The text below the table of parameters.
pub fn to_text(fit: &Fit) -> String {
    let own = match &fit.uncertainty {
        Ok(own) => own,
        Err(reason) => return format!("no intervals: {reason}\n"),
    };
    let mut text = format!("{}\n", method(own));
    for note in &own.notes {
        text += &terminal::labelled("note", note);
    }
    text
}

/// One line about the method of the intervals.
fn method(own: &Uncertainty) -> String {
    let penalised = if own.is_penalised { "penalised " } else { "" };
    format!("{penalised}{}", how(own.method))
}
