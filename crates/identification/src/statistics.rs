//! Values in a number. What is missing (NaN) does not count.

/// Root mean square; NaN of none.
pub fn rms<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let (sum, count) = finite.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
    (sum / f64::from(count)).sqrt()
}

/// Least and greatest.
pub fn range(values: &[f64]) -> [f64; 2] {
    let present = || values.iter().copied();
    [
        present().fold(f64::INFINITY, f64::min),
        present().fold(f64::NEG_INFINITY, f64::max),
    ]
}
