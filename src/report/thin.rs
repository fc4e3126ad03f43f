//! Reduces the number of points of long lines without a visible change.

/// Keeps the first, minimum, maximum and last point of a long line in each of `parts` intervals of the abscissa, and
/// all gaps. `None` for a line that is short or whose abscissae are not sorted.
pub fn thinned(x: &[f64], y: &[f64], parts: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = x.len().min(y.len());
    if n <= 4 * parts || !x.is_sorted() {
        return None;
    }
    let (x, y) = (&x[..n], &y[..n]);
    let (first, width) = (x[0], (x[n - 1] - x[0]) / parts as f64);
    let part = |k: usize| ((x[k] - first) / width) as usize;
    let (mut xs, mut ys) = (Vec::new(), Vec::new());
    let mut from = 0;
    while from < n {
        let is_gap = y[from].is_nan();
        let alike = |&k: &usize| y[k].is_nan() == is_gap && part(k) == part(from);
        let to = from + (from..n).take_while(alike).count();
        let by_value = |a: &usize, b: &usize| y[*a].total_cmp(&y[*b]);
        let mut kept = vec![from, to - 1];
        kept.extend((from..to).min_by(by_value));
        kept.extend((from..to).max_by(by_value));
        kept.sort_unstable();
        kept.dedup();
        xs.extend(kept.iter().map(|&k| x[k]));
        ys.extend(kept.iter().map(|&k| y[k]));
        from = to;
    }
    Some((xs, ys))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARTS: usize = 1500;

    #[test]
    fn peaks_and_gaps_stay() {
        let n = 100_000;
        let x: Vec<f64> = (0..n).map(|k| k as f64 * 1e-3).collect();
        let mut y: Vec<f64> = x.iter().map(|t| t.sin()).collect();
        (y[33_333], y[77_777]) = (9.0, f64::NAN);
        let (xs, ys) = thinned(&x, &y, PARTS).unwrap();
        assert!(
            xs.len() == ys.len() && xs.len() <= 4 * PARTS + 8,
            "{}",
            xs.len()
        );
        assert!(ys.contains(&9.0) && ys.iter().any(|y| y.is_nan()));
        assert_eq!((xs[0], xs.last()), (0.0, x.last()));
        assert!(xs.is_sorted());
        assert_eq!(thinned(&x[..100], &y[..100], PARTS), None);
        let back: Vec<f64> = x.iter().map(|t| -t).collect();
        assert_eq!(thinned(&back, &y, PARTS), None);
    }

    #[test]
    fn a_line_at_one_abscissa_ends() {
        let (x, y) = (vec![1.0; 10_000], vec![2.0; 10_000]);
        assert_eq!(thinned(&x, &y, PARTS), Some((vec![1.0; 2], vec![2.0; 2])));
    }
}
