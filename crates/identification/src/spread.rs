//! The covariance of θ, its propagation to derived quantities, and its storage in a pilot file.

use crate::pilot_file::PilotFileError;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pilotage_inference::{Interval, Method};
use pilotage_text::document::{TomlTable, number};

/// Step of finite differences, in standard deviations.
const STEP: f64 = 1e-3;

/// What intervals of quantities derived from θ require; a pilot file stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Method of the covariance.
    pub method: Method,
    /// Covariance of θ.
    pub covariance: DMatrix<f64>,
    /// Degrees of freedom of Student's t for each component.
    pub degrees: Vec<f64>,
}

impl Spread {
    /// Intervals of quantities derived from θ, such as margins or poles, with these values at θ (delta method, by
    /// central differences of `of`). Differences are taken along the axes of the ellipsoid, not along each component:
    /// if a pole diverges, the components are individually far less certain than in combination, and their
    /// contributions would not cancel.
    pub fn derived(
        &self,
        theta: &[f64],
        values: &[f64],
        of: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Vec<Interval> {
        let mut variances = DVector::zeros(values.len());
        for axis in self.axes() {
            let moved = |by: f64| {
                let moved = DVector::from_column_slice(theta) + by * &axis;
                DVector::from_vec(of(moved.as_slice()))
            };
            let slopes = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            variances += slopes.component_mul(&slopes);
        }
        let interval = |(value, variance): (&f64, &f64)| {
            let open = [f64::NEG_INFINITY, f64::INFINITY];
            Interval::new(*value, variance.sqrt(), self.least_degrees(), open, None)
        };
        values.iter().zip(&variances).map(interval).collect()
    }

    /// Axes of the ellipsoid of one standard deviation: the sum of `a aᵀ` over them is the covariance.
    fn axes(&self) -> Vec<DVector<f64>> {
        let sd = self.covariance.diagonal().map(f64::sqrt);
        let n = sd.len();
        let correlation = DMatrix::from_fn(n, n, |i, j| match sd[i] * sd[j] > 0.0 {
            true => self.covariance[(i, j)] / (sd[i] * sd[j]),
            false => 0.0,
        });
        let eigen = SymmetricEigen::new(correlation);
        let pairs = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        let is_there = |own: &(&f64, _)| *own.0 > 0.0;
        pairs
            .filter(is_there)
            .map(|(value, vector)| value.sqrt() * vector.component_mul(&sd))
            .collect()
    }

    /// Degrees of freedom of a quantity that depends on all components.
    pub fn least_degrees(&self) -> f64 {
        self.degrees.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Reads the table of the uncertainty; `None` if it has no covariance, as when the data leave a direction
    /// undetermined.
    pub(super) fn of_table(
        table: &TomlTable<'_>,
        n: usize,
    ) -> Result<Option<Self>, PilotFileError> {
        let fields = ["method", "degrees_of_freedom", "covariance"].map(str::to_owned);
        let fields: Vec<String> = (fields.into_iter())
            .chain((1..=n).map(|i| format!("theta{i}")))
            .collect();
        table.only(&fields.iter().map(String::as_str).collect::<Vec<_>>())?;
        let fault = |field: &str, fault: String| PilotFileError::Uncertainty {
            file: table.file().to_owned(),
            line: table.line(field),
            fault: format!("{field} {fault}"),
        };
        for i in 1..=n {
            if let Some(own) = table.table(&format!("theta{i}"))? {
                check_interval(&own)?;
            }
        }
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
        Ok(Some(Self {
            method,
            covariance,
            degrees,
        }))
    }

    /// The fields that [`Spread::of_table`] reads, except the method.
    pub(super) fn to_toml(&self) -> String {
        let row = |row: Vec<f64>| -> String {
            let all: Vec<String> = row.into_iter().map(number).collect();
            format!("[{}]", all.join(", "))
        };
        let rows = self.covariance.row_iter();
        let rows: String = rows
            .map(|own| format!("    {},\n", row(own.iter().copied().collect())))
            .collect();
        format!(
            "degrees_of_freedom = {}\ncovariance = [                     # of theta1, theta2, ...\n{rows}]\n",
            row(self.degrees.clone())
        )
    }
}

/// Rejects an invalid interval `{ sd, low, high }`.
fn check_interval(table: &TomlTable<'_>) -> Result<(), PilotFileError> {
    table.only(&["sd", "low", "high"])?;
    let fault = |field: &str, fault: String| PilotFileError::Uncertainty {
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
    use super::*;

    /// Two components with an uncertainty of five times their size, whose ratio is certain to a hundredth.
    #[test]
    fn what_components_are_together_is_surer_than_they_are() {
        let half = 0.5_f64.sqrt();
        let along = 5e7 * DVector::from_vec(vec![half, half]);
        let across = 1e5 * DVector::from_vec(vec![half, -half]);
        let covariance = &along * along.transpose() + &across * across.transpose();
        let spread = Spread {
            method: Method::Plain,
            covariance,
            degrees: vec![1e9; 2],
        };
        let ratio = |theta: &[f64]| vec![theta[0] / theta[1], theta[0]];
        let theta = [1e7, 1e7];
        let found = spread.derived(&theta, &ratio(&theta), ratio);
        let expected = [2.0 * half * 1e5 / 1e7, half * (5e7_f64.hypot(1e5))];
        for (own, expected) in found.iter().zip(expected) {
            assert!(
                (own.sd / expected - 1.0).abs() < 1e-4,
                "{own:?}, {expected}"
            );
        }
    }
}
