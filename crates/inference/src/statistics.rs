//! Statistics of values; missing ones (NaN) are ignored.

/// Root mean square; NaN if there are no values.
pub fn rms<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let (sum, count) = finite.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
    (sum / f64::from(count)).sqrt()
}

/// Minimum and maximum.
pub fn range(values: &[f64]) -> [f64; 2] {
    let present = || values.iter().copied();
    [
        present().fold(f64::INFINITY, f64::min),
        present().fold(f64::NEG_INFINITY, f64::max),
    ]
}
