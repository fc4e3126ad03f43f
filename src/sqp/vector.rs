//! Sums and maxima over long vectors, in eight parts that are added at the end: one chain of additions
//! takes as long as its latency. The order is the same on any machine.

/// Parts of a sum.
const PARTS: usize = 8;

/// `Σ_i term(a_i, b_i, ..)` over vectors of one length.
///
/// # Panics
/// If the lengths differ.
pub fn sum<const K: usize>(vectors: [&[f64]; K], term: impl Fn([f64; K]) -> f64) -> f64 {
    let length = vectors.first().map_or(0, |v| v.len());
    assert!(vectors.iter().all(|v| v.len() == length), "lengths differ");
    let chunks = vectors.map(|v| v.as_chunks::<PARTS>());
    let mut parts = [0.0; PARTS];
    for i in 0..length / PARTS {
        let own = chunks.map(|(whole, _)| &whole[i]);
        for (k, part) in parts.iter_mut().enumerate() {
            *part += term(own.map(|values| values[k]));
        }
    }
    for i in 0..length % PARTS {
        parts[i] += term(chunks.map(|(_, rest)| rest[i]));
    }
    parts.iter().sum()
}

/// Scalar product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum([a, b], |[a, b]| a * b)
}

/// Largest magnitude; NaN if there is one.
pub fn largest(v: &[f64]) -> f64 {
    let (mut parts, mut nan) = ([0.0_f64; PARTS], [false; PARTS]);
    let (whole, rest) = v.as_chunks::<PARTS>();
    let mut take = |k: usize, value: f64| {
        parts[k] = if value.abs() > parts[k] {
            value.abs()
        } else {
            parts[k]
        };
        nan[k] |= value.is_nan();
    };
    for own in whole {
        own.iter().enumerate().for_each(|(k, v)| take(k, *v));
    }
    rest.iter().enumerate().for_each(|(k, v)| take(k, *v));
    match nan.contains(&true) {
        true => f64::NAN,
        false => parts.into_iter().fold(0.0, f64::max),
    }
}

/// True when every value is finite.
pub fn is_finite(v: &[f64]) -> bool {
    // Zero times infinity or NaN is NaN.
    sum([v], |[v]| 0.0 * v) == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_maxima_of_any_length() {
        for n in 0..40 {
            let a: Vec<f64> = (0..n).map(|i| f64::from(i) - 20.5).collect();
            let b: Vec<f64> = (0..n).map(|i| f64::from(i * i)).collect();
            let expected: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&a, &b), expected);
            let expected = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            assert_eq!(largest(&a), expected);
            assert!(is_finite(&a));
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                for i in 0..a.len() {
                    let mut a = a.clone();
                    a[i] = bad;
                    assert!(!is_finite(&a));
                    assert_eq!(largest(&a).is_nan(), bad.is_nan());
                    assert!(bad.is_nan() || largest(&a) == f64::INFINITY);
                }
            }
        }
    }
}
