//! Sums and maxima over long vectors, in eight parts that are added at the end: a single chain of additions is limited
//! by their latency. The order of additions is the same on any machine.

/// Number of parts of a sum.
const PARTS: usize = 8;

/// `Σ_i term(a_i, b_i, ..)` over vectors of equal length.
///
/// # Panics
/// If the lengths differ.
pub fn sum<const K: usize>(vectors: [&[f64]; K], term: impl Fn([f64; K]) -> f64) -> f64 {
    let length = vectors.first().map_or(0, |v| v.len());
    assert!(vectors.iter().all(|v| v.len() == length), "lengths differ");
    pulp::Arch::new().dispatch(Sum {
        vectors,
        length,
        term,
    })
}

struct Sum<'a, const K: usize, F> {
    vectors: [&'a [f64]; K],
    length: usize,
    term: F,
}

impl<const K: usize, F: Fn([f64; K]) -> f64> pulp::WithSimd for Sum<'_, K, F> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f64 {
        let chunks = self.vectors.map(|v| v.as_chunks::<PARTS>());
        let mut parts = [0.0; PARTS];
        for i in 0..self.length / PARTS {
            let own = chunks.map(|(whole, _)| &whole[i]);
            for (k, part) in parts.iter_mut().enumerate() {
                *part += (self.term)(own.map(|values| values[k]));
            }
        }
        for i in 0..self.length % PARTS {
            parts[i] += (self.term)(chunks.map(|(_, rest)| rest[i]));
        }
        parts.iter().sum()
    }
}

/// `out_i = of(a_i, b_i, ..)` for vectors of equal length.
///
/// # Panics
/// If the lengths differ.
pub fn each<const K: usize>(out: &mut [f64], vectors: [&[f64]; K], of: impl Fn([f64; K]) -> f64) {
    assert!(
        vectors.iter().all(|v| v.len() == out.len()),
        "lengths differ"
    );
    pulp::Arch::new().dispatch(Each { out, vectors, of });
}

struct Each<'a, const K: usize, F> {
    out: &'a mut [f64],
    vectors: [&'a [f64]; K],
    of: F,
}

impl<const K: usize, F: Fn([f64; K]) -> f64> pulp::WithSimd for Each<'_, K, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let vectors = self.vectors.map(|v| &v[..self.out.len()]);
        for (i, out) in self.out.iter_mut().enumerate() {
            *out = (self.of)(vectors.map(|v| v[i]));
        }
    }
}

/// Scalar product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum([a, b], |[a, b]| a * b)
}

/// Largest magnitude; NaN if any entry is NaN.
pub fn largest(v: &[f64]) -> f64 {
    largest_of([v], |[v]| v)
}

/// Largest magnitude of `term(a_i, b_i, ..)` over vectors of equal length; NaN if any term is NaN.
///
/// # Panics
/// If the lengths differ.
pub fn largest_of<const K: usize>(vectors: [&[f64]; K], term: impl Fn([f64; K]) -> f64) -> f64 {
    let length = vectors.first().map_or(0, |v| v.len());
    assert!(vectors.iter().all(|v| v.len() == length), "lengths differ");
    pulp::Arch::new().dispatch(Largest {
        vectors,
        length,
        term,
    })
}

struct Largest<'a, const K: usize, F> {
    vectors: [&'a [f64]; K],
    length: usize,
    term: F,
}

impl<const K: usize, F: Fn([f64; K]) -> f64> pulp::WithSimd for Largest<'_, K, F> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f64 {
        let chunks = self.vectors.map(|v| v.as_chunks::<PARTS>());
        // Comparison with NaN is false.
        let (mut parts, mut nan) = ([0.0_f64; PARTS], [0.0; PARTS]);
        let mut take = |k: usize, values: [f64; K]| {
            let value = (self.term)(values).abs();
            nan[k] += if value.is_nan() { 1.0 } else { 0.0 };
            parts[k] = if value > parts[k] { value } else { parts[k] };
        };
        for i in 0..self.length / PARTS {
            let own = chunks.map(|(whole, _)| &whole[i]);
            (0..PARTS).for_each(|k| take(k, own.map(|values| values[k])));
        }
        for i in 0..self.length % PARTS {
            take(i, chunks.map(|(_, rest)| rest[i]));
        }
        match nan == [0.0; PARTS] {
            true => parts.into_iter().fold(0.0, f64::max),
            false => f64::NAN,
        }
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
