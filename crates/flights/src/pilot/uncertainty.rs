//! The uncertainty of θ in a pilot file.

use super::PilotError;
use nalgebra::DMatrix;
use pilotage_inference::{Method, Open, Spread};
use pilotage_text::document::TomlTable;

/// Reads the table of the uncertainty; `None` if it has no covariance, as when the data leave a direction
/// undetermined.
pub(super) fn of_table(table: &TomlTable<'_>, n: usize) -> Result<Option<Spread>, PilotError> {
    let fields = ["method", "degrees_of_freedom", "covariance"].map(str::to_owned);
    let fields: Vec<String> = (fields.into_iter())
        .chain((1..=n).map(|i| format!("theta{i}")))
        .collect();
    table.only(&fields.iter().map(String::as_str).collect::<Vec<_>>())?;
    for i in 1..=n {
        if let Some(own) = table.table(&format!("theta{i}"))? {
            check_interval(&own)?;
        }
    }
    covariance(table, n)
}

/// The same of a fitted model with n coefficients alone; `None` if the data do not determine all of them.
pub(super) fn of_model(table: &TomlTable<'_>, n: usize) -> Result<Option<Spread>, PilotError> {
    let known = table.strings("parameters")?.unwrap_or_default();
    let mut pairs = known.iter().zip(1..);
    let is_whole = known.len() == n && pairs.all(|((own, _), k)| *own == format!("theta{k}"));
    match is_whole {
        true => covariance(table, n),
        false => Ok(None),
    }
}

/// The covariance of n coefficients, with the intervals that stand beside it.
fn covariance(table: &TomlTable<'_>, n: usize) -> Result<Option<Spread>, PilotError> {
    let fault = |field: &str, fault: String| PilotError::Uncertainty {
        file: table.file().to_owned(),
        line: table.line(field),
        fault: format!("{field} {fault}"),
    };
    let Some(rows) = table.rows("covariance")? else {
        return Ok(None);
    };
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        let found = format!("is not {n} rows of {n} numbers, as [theta] has {n} parameters");
        return Err(fault("covariance", found));
    }
    let covariance = DMatrix::from_row_iterator(n, n, rows.into_iter().flatten());
    if let Some(trouble) = trouble(&covariance) {
        return Err(fault("covariance", trouble.to_owned()));
    }
    for i in 1..=n {
        let field = format!("theta{i}");
        let sd = match table.table(&field)? {
            Some(own) => own.number("sd")?,
            None => None,
        };
        let expected = covariance[(i - 1, i - 1)].sqrt();
        let differs = |sd: &f64| sd.is_finite() && (sd - expected).abs() > 1e-6 * expected;
        if let Some(sd) = sd.filter(differs) {
            let found = format!("has sd = {sd}, and the covariance says {expected}");
            return Err(fault(&field, found));
        }
    }
    let degrees = table.numbers("degrees_of_freedom")?;
    let degrees = table.required("degrees_of_freedom", degrees)?;
    if degrees.len() != n || degrees.iter().any(|own| own.is_nan() || *own <= 0.0) {
        let found = format!("is not {n} numbers above 0");
        return Err(fault("degrees_of_freedom", found));
    }
    let method = table.required("method", table.string("method")?)?;
    let known = Method::ALL.into_iter().find(|own| own.as_str() == method);
    let names = Method::ALL.map(Method::as_str).join(", ");
    let method =
        known.ok_or_else(|| fault("method", format!("is `{method}`; known are {names}")))?;
    Ok(Some(Spread {
        method,
        covariance,
        degrees,
        open: Open::default(),
    }))
}

/// Rejects an invalid interval `{ sd, low, high }`.
fn check_interval(table: &TomlTable<'_>) -> Result<(), PilotError> {
    table.only(&["sd", "low", "high"])?;
    let fault = |field: &str, fault: String| PilotError::Uncertainty {
        file: table.file().to_owned(),
        line: table.line(field),
        fault: format!("{field} {fault}"),
    };
    let [sd, low, high] = ["sd", "low", "high"].map(|field| table.number(field));
    let (sd, low, high) = (sd?, low?, high?);
    if let Some(sd) = sd.filter(|sd| *sd < 0.0) {
        return Err(fault("sd", format!("is {sd}, below 0")));
    }
    match low.zip(high) {
        Some((low, high)) if low > high => {
            Err(fault("low", format!("is {low}, above high = {high}")))
        }
        _ => Ok(()),
    }
}

/// Why a matrix is not a covariance. Rounding may leave an eigenvalue of a correlation matrix slightly below 0.
fn trouble(covariance: &DMatrix<f64>) -> Option<&'static str> {
    if covariance.iter().any(|own| !own.is_finite()) {
        return Some("has an entry that is no finite number");
    }
    let variances = covariance.diagonal();
    if variances.iter().any(|own| *own < 0.0) {
        return Some("has a variance below 0");
    }
    let correlations = DMatrix::from_fn(variances.len(), variances.len(), |i, j| {
        let size = variances[i].sqrt() * variances[j].sqrt();
        if size > 0.0 {
            covariance[(i, j)] / size
        } else {
            covariance[(i, j)]
        }
    });
    if (&correlations - correlations.transpose()).amax() > 1e-6 {
        return Some("is not symmetric");
    }
    let least = correlations.symmetric_eigenvalues().min();
    (least < -1e-6).then_some("is not positive semidefinite")
}

#[cfg(test)]
mod tests {
    use crate::pilot::PilotFile;

    const THREE: &str = "[theta]\ntheta1 = 1\ntheta2 = 2\n[uncertainty]\nmethod = \"cr3\"\n\
        degrees_of_freedom = [5, inf]\ncovariance = [[4, 1.9], [1.9, 1]]\ntheta1 = { sd = 2 }\n";

    #[test]
    fn how_sure_it_is_is_read() {
        let spread = PilotFile::parse(THREE, "pilot.toml")
            .unwrap()
            .spread
            .unwrap();
        assert_eq!(spread.covariance, nalgebra::dmatrix![4.0, 1.9; 1.9, 1.0]);
        assert_eq!(spread.degrees, [5.0, f64::INFINITY]);
        // Older files contain only intervals.
        let lines = THREE.lines().filter(|line| !line.starts_with("covariance"));
        let text: String = lines.map(|line| format!("{line}\n")).collect();
        assert_eq!(PilotFile::parse(&text, "pilot.toml").unwrap().spread, None);
    }

    #[test]
    fn what_is_no_covariance_is_told() {
        for (old, new, message) in [
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 2.1], [2.1, 1]]",
                ":7: [uncertainty] covariance is not positive semidefinite",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 1.9], [1.8, 1]]",
                "is not symmetric",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 1.9], [nan, 1]]",
                "no finite number",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[-4, 0], [0, 1]]",
                "a variance below 0",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 1.9]]",
                "is not 2 rows of 2 numbers",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[4, 1.9]",
                "an array of rows of numbers",
            ),
            (
                "[5, inf]",
                "[5, 0]",
                ":6: [uncertainty] degrees_of_freedom is not 2 numbers above 0",
            ),
            ("[5, inf]", "5", "an array of numbers"),
            ("cr3", "cr4", "known are plain, sidpac, ar, cr3"),
            ("theta1 = {", "theta3 = {", "theta3"),
            ("sd = 2", "sd = -2", ":8: [uncertainty] sd is -2, below 0"),
            (
                "sd = 2",
                "sd = 3",
                ":8: [uncertainty] theta1 has sd = 3, and the covariance says 2",
            ),
            (
                "sd = 2",
                "sd = 2, low = 3, high = 1",
                ":8: [uncertainty] low is 3, above high = 1",
            ),
            ("sd = 2", "sd = 2, foo = 1", "foo"),
        ] {
            let text = THREE.replace(old, new);
            assert_ne!(text, THREE, "{old}");
            let error = PilotFile::parse(&text, "pilot.toml")
                .unwrap_err()
                .to_string();
            assert!(error.contains(message), "{new}: {error}");
        }
    }
}
