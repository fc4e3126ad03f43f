//! Delays of recorded inputs: the recording itself, shifted.
//!
//! Where a delay without an order takes nothing but recorded inputs, `v(t) = u(t - τ)` needs no approximation. At a sample it is
//! the shifted interpolant. At the collocation points of a part of the mesh from a to b it is the line that has its integral and
//! its first moment there,
//!
//! ```text
//! v(t) = I₀/h + 12 (t - m) I₁/h³,   I₀ = ∫ u(s - τ) ds,   I₁ = ∫ (s - m) u(s - τ) ds,   h = b - a,   m = (a + b)/2
//! ```
//!
//! (Legendre's projection). Both integrals are exact whatever samples lie within a and b, so that a shift by a part of a sample is
//! seen by states on any mesh, and they have derivatives with respect to τ where the interpolant jumps:
//!
//! ```text
//! I₀' = u(a - τ) - u(b - τ),   I₁' = I₀ - h (u(b - τ) + u(a - τ))/2
//! ```
//!
//! Before the run began the signal was 0, as for Padé's approximation.

use pilotage_expression::{Opaque, Partial};

/// Arguments of [`Shifted`]: time since the begin of the run, at the begin and end of a part of the mesh and at the point \[s\]; the
/// number of the run; τ \[s\].
pub const ARGUMENTS: usize = 5;

/// The argument with respect to which it has derivatives.
const TAU: usize = ARGUMENTS - 1;

/// A recorded input of all runs, shifted.
#[derive(Debug)]
pub struct Shifted {
    runs: Vec<Vec<Piece>>,
}

/// A line from one time to a later one.
#[derive(Debug, Clone, Copy)]
struct Piece {
    from: f64,
    to: f64,
    value: f64,
    slope: f64,
}

impl Piece {
    fn at(&self, time: f64) -> f64 {
        self.value + self.slope * (time - self.from)
    }
}

impl Shifted {
    /// The input with these samples in each run: times since its begin, and values. Two samples at one time are a jump.
    pub fn new(runs: impl Iterator<Item = (Vec<f64>, Vec<f64>)>) -> Self {
        Self {
            runs: runs.map(|(time, values)| pieces(&time, &values)).collect(),
        }
    }

    /// Value and the first two derivatives with respect to τ.
    fn of(&self, [begin, end, time, run, tau]: [f64; ARGUMENTS]) -> [f64; 3] {
        let pieces = &self.runs[run as usize];
        let (a, b) = (begin - tau, end - tau);
        if b <= a {
            let [value, slope] = sides(pieces, time - tau)[1];
            return [value, -slope, 0.0];
        }
        let (h, m) = (b - a, 0.5 * (a + b));
        let [area, moment] = integrals(pieces, (a, b), m);
        let [[first, rise], [last, fall]] = [sides(pieces, a)[1], sides(pieces, b)[0]];
        let areas = [area, first - last, fall - rise];
        let half = 0.5 * h;
        let moments = [
            moment,
            area - half * (last + first),
            half * (fall + rise) - (last - first),
        ];
        let place = 12.0 * (time - tau - m) / (h * h * h);
        [0, 1, 2].map(|k| areas[k] / h + place * moments[k])
    }
}

/// The lines between samples, and the last value beyond them.
fn pieces(time: &[f64], values: &[f64]) -> Vec<Piece> {
    let pairs = time.windows(2).zip(values.windows(2));
    let lines = pairs
        .filter(|(times, _)| times[0] < times[1])
        .map(|(times, values)| Piece {
            from: times[0],
            to: times[1],
            value: values[0],
            slope: (values[1] - values[0]) / (times[1] - times[0]),
        });
    let last = Piece {
        from: time[time.len() - 1],
        to: f64::INFINITY,
        value: values[values.len() - 1],
        slope: 0.0,
    };
    lines.chain([last]).collect()
}

/// Value and slope just before and just after a time.
fn sides(pieces: &[Piece], time: f64) -> [[f64; 2]; 2] {
    let own = |k: usize| {
        let piece = k.checked_sub(1).and_then(|k| pieces.get(k));
        piece.map_or([0.0; 2], |own| [own.at(time), own.slope])
    };
    [
        own(pieces.partition_point(|own| own.from < time)),
        own(pieces.partition_point(|own| own.from <= time)),
    ]
}

/// Integral from a to b, and that of the moment about m.
fn integrals(pieces: &[Piece], (a, b): (f64, f64), m: f64) -> [f64; 2] {
    let first = pieces.partition_point(|own| own.to <= a);
    let mut found = [0.0; 2];
    for own in pieces[first..].iter().take_while(|own| own.from < b) {
        let (from, to) = (own.from.max(a), own.to.min(b));
        let (length, middle) = (to - from, 0.5 * (from + to));
        let area = length * own.at(middle);
        found[0] += area;
        found[1] += area * (middle - m) + own.slope * length.powi(3) / 12.0;
    }
    found
}

impl Opaque for Shifted {
    fn neutral(&self) -> &[f64] {
        &[0.0, 0.0, 0.0, 0.0, 1.0]
    }

    fn depends(&self, _: Partial) -> bool {
        true
    }

    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) {
        let at: [f64; ARGUMENTS] = std::array::from_fn(|k| at[k]);
        let values = self.of(at);
        for (out, partial) in out.iter_mut().zip(wanted) {
            let others = partial.arguments().any(|own| own != TAU);
            *out = match others {
                true => f64::NAN,
                false => values[partial.arguments().count()],
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stair and a line, at times that are not even.
    fn signals() -> Shifted {
        let stair = [0.0, 0.3, 0.3, 0.7, 0.7, 1.5].to_vec();
        let steps = [1.0, 1.0, -2.0, -2.0, 0.5, 0.5].to_vec();
        let line = [0.0, 0.3, 0.7, 0.8, 1.5].to_vec();
        let values = [1.0, -2.0, 0.5, 0.7, -1.0].to_vec();
        Shifted::new([(stair, steps), (line, values)].into_iter())
    }

    /// Integral and first moment of the line are those of the signal, by fine sums.
    #[test]
    fn the_line_has_integral_and_moment_of_the_signal() {
        let own = signals();
        for run in [0.0, 1.0] {
            for (a, b, tau) in [
                (0.5, 1.3, 0.123),
                (0.1, 0.2, 0.6),
                (0.9, 1.0, 0.77),
                (0.0, 2.5, 0.4),
            ] {
                let count = 100_000;
                let h: f64 = (b - a) / f64::from(count);
                let (mut line, mut signal) = ([0.0; 2], [0.0; 2]);
                for k in 0..count {
                    let t = a + h * (f64::from(k) + 0.5);
                    let values = [own.of([a, b, t, run, tau]), own.of([t, t, t, run, tau])];
                    for (sum, value) in [&mut line, &mut signal].into_iter().zip(values) {
                        sum[0] += h * value[0];
                        sum[1] += h * (t - a) * value[0];
                    }
                }
                for k in 0..2 {
                    let off = (line[k] - signal[k]).abs();
                    assert!(
                        off < 1e-4 * (b - a),
                        "{run}, {a} to {b}: {line:?}, {signal:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        const STEP: f64 = 1e-5;
        let own = signals();
        for run in [0.0, 1.0] {
            for (a, b, t, tau) in [
                (0.5, 1.3, 0.6, 0.123),
                (0.9, 1.05, 1.0, 0.77),
                (0.1, 0.9, 0.1, 0.31),
            ] {
                let [_, first, second] = own.of([a, b, t, run, tau]);
                let [low, high] = [-STEP, STEP].map(|step| own.of([a, b, t, run, tau + step]));
                for (found, k) in [(first, 0), (second, 1)] {
                    let expected = (high[k] - low[k]) / (2.0 * STEP);
                    let off = (found - expected).abs();
                    assert!(
                        off < 1e-5 * (1.0 + expected.abs()),
                        "{k}: {found}, {expected}"
                    );
                }
            }
        }
    }
}
