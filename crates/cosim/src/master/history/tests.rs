//! Tests of the polynomials and their errors against exact values.

use super::*;

const TIMES: [f64; 3] = [0.3, 0.7, 0.8];
const H: f64 = 0.25;

/// A cubic with its slope.
fn at(c: [f64; 4], t: f64) -> Outcome {
    Outcome {
        value: c[0] + t * (c[1] + t * (c[2] + t * c[3])),
        slope: c[1] + t * (2.0 * c[2] + t * 3.0 * c[3]),
    }
}

fn history(c: [f64; 4], has_slope: bool) -> History {
    let mut history = History::new(
        vec![Some(1.0)],
        vec![Traits {
            has_slope,
            is_discrete: false,
        }],
    );
    for t in TIMES {
        history.push(t, std::iter::once(at(c, t)));
    }
    history
}

/// Mean, lean and end over the next step by Simpson's rule with many intervals.
fn exact(c: [f64; 4]) -> InputProfile {
    let n = 1000;
    let (mut mean, mut moment) = (0.0, 0.0);
    for k in 0..=2 * n {
        let weight = match k {
            0 => 1.0,
            k if k == 2 * n => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let part = f64::from(k) / f64::from(2 * n);
        let value = at(c, TIMES[2] + part * H).value * weight / f64::from(6 * n);
        mean += value;
        moment += value * (2.0 * part - 1.0);
    }
    InputProfile {
        mean,
        lean: 3.0 * moment,
        end: at(c, TIMES[2] + H).value,
        slope: at(c, TIMES[2] + H).slope,
    }
}

fn assert_close(found: InputProfile, expected: InputProfile) {
    for (found, expected) in [
        (found.mean, expected.mean),
        (found.lean, expected.lean),
        (found.end, expected.end),
        (found.slope, expected.slope),
    ] {
        assert!((found - expected).abs() < 1e-11, "{found} {expected}");
    }
}

/// A fast decay plus a line; value and slope at the end no longer show the decay. The cubic's mean would be wrong by
/// `h/12` times the slope at the beginning.
#[test]
fn transients_are_not_taken_for_cubics() {
    for rate in [20.0, 1e2, 1e3, 1e6] {
        let at = |t: f64| {
            let decay = (-rate * t).exp();
            Outcome {
                value: 1.0 + 2.0 * t - 3.0 * decay,
                slope: 2.0 + 3.0 * rate * decay,
            }
        };
        let traits = Traits {
            has_slope: true,
            is_discrete: false,
        };
        let mut history = History::new(vec![Some(1.0)], vec![traits]);
        history.push(0.0, std::iter::once(at(0.0)));
        let profile = history.interpolated(0, 1, H, at(H));
        let (length, rest) = (1.0 / (rate * H), (-rate * H).exp());
        // ∫ e^{-x/length} and ∫ (2 x - 1) e^{-x/length} over 0 to 1.
        let decay = length * (1.0 - rest);
        let moment = 2.0 * length * (decay - rest) - decay;
        let (mean, lean) = (1.0 + H - 3.0 * decay, H - 9.0 * moment);
        let found = [profile.mean - mean, profile.lean - lean];
        assert!(
            found.iter().all(|e| e.abs() < 0.4 * length),
            "{rate}: {found:?}"
        );
        assert!(history.interpolation_error(0, H, at(H)) <= 4.0 * length);
    }
}

/// The error of a cubic's mean for a quartic: `h⁴/30` times its fourth coefficient.
#[test]
fn the_error_of_the_cubic_is_exact_for_a_quartic() {
    let at = |t: f64| Outcome {
        value: 2.0 - t + 5.0 * t.powi(4),
        slope: -1.0 + 20.0 * t.powi(3),
    };
    let traits = Traits {
        has_slope: true,
        is_discrete: false,
    };
    let mut history = History::new(vec![Some(1.0)], vec![traits]);
    for t in TIMES {
        history.push(t, std::iter::once(at(t)));
    }
    let end = at(TIMES[2] + H);
    let error = history.mean_error(0, H, end, history.interpolation_error(0, H, end));
    assert!((error / (H.powi(4) / 6.0) - 1.0).abs() < 1e-9, "{error}");
}

/// Polynomials up to the given degree are reproduced exactly on unequal steps.
#[test]
fn polynomials_are_exact() {
    for (degree, c) in [
        (0, [3.0, 0.0, 0.0, 0.0]),
        (1, [3.0, -2.0, 0.0, 0.0]),
        (2, [3.0, -2.0, 5.0, 0.0]),
    ] {
        let (history, exact) = (history(c, false), exact(c));
        let end = at(c, TIMES[2] + H);
        assert_close(history.extrapolated(0, degree, H), exact);
        assert_close(history.interpolated(0, degree.max(1), H, end), exact);
        assert!(history.interpolation_error(0, H, end) < 1e-12);
    }
    let c = [3.0, -2.0, 5.0, 7.0];
    let end = at(c, TIMES[2] + H);
    let with_slopes = history(c, true).interpolated(0, 1, H, end);
    assert_close(with_slopes, exact(c));
    // Without slopes, the estimate is exact for a cubic.
    let history = history(c, false);
    let error = (history.interpolated(0, 2, H, end).mean - exact(c).mean).abs();
    let estimate = history.interpolation_error(0, H, end);
    assert!((error - estimate).abs() < 1e-12 && error > 1e-3);
}
