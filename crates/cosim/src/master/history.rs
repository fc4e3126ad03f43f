//! History of the fed outputs at the last communication points, and polynomials through it.

use serde::{Deserialize, Serialize};

/// Number of stored communication points: with the next one, enough for a polynomial of degree 3.
const KEPT: usize = 3;

/// If the slope at the beginning differs from the slope of the chord by more than this factor times all other changes,
/// it belongs to a transient that decays within the step: for an exponential, this is a decay below `e⁻³`, where both
/// profiles are equally wrong.
const TRANSIENT: f64 = 2.0;

/// Approximation of a value within a step: its mean, the line `mean ± lean` with the same first moment (the projection
/// on polynomials of degree 1), and its value and time derivative at the end.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct InputProfile {
    pub(super) mean: f64,
    pub(super) lean: f64,
    pub(super) end: f64,
    pub(super) slope: f64,
}

impl InputProfile {
    /// A constant.
    pub(super) fn held(value: f64) -> Self {
        Self {
            mean: value,
            lean: 0.0,
            end: value,
            slope: 0.0,
        }
    }

    pub(super) fn is_held(&self) -> bool {
        self.lean == 0.0 && self.mean == self.end
    }

    /// Whether the line does not end at the end value.
    pub(super) fn is_curved(&self) -> bool {
        let size = self.mean.abs() + self.lean.abs() + self.end.abs();
        (self.mean + self.lean - self.end).abs() > 1e-12 * size
    }

    /// The line's value after a fraction `at` of the step.
    pub(super) fn line(&self, at: f64) -> f64 {
        self.mean + (2.0 * at - 1.0) * self.lean
    }

    /// The line with the same mean that ends at the end value.
    pub(super) fn to_end(self) -> Self {
        Self {
            lean: self.end - self.mean,
            ..self
        }
    }
}

/// An output at the end of a step: its value and, if available, its time derivative.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) value: f64,
    pub(super) slope: f64,
}

/// A decay `height·exp(-t/(length·h))` at the beginning of a step of `h` [s], added to the line on which the value
/// ends: the response of a fast pole to a jump. Both follow from the values and slopes at the ends, if the remainder of
/// the decay at the end is neglected. The longer the step, the more only the end counts, as in an L-stable method.
struct Transient {
    height: f64,
    length: f64,
}

impl Transient {
    fn profile(&self, h: f64, end: Outcome) -> InputProfile {
        let (rise, part) = (h * end.slope, self.height * self.length);
        InputProfile {
            mean: end.value - 0.5 * rise + part,
            lean: 0.5 * rise + 3.0 * part * (2.0 * self.length - 1.0),
            end: end.value,
            slope: end.slope,
        }
    }
}

/// Properties of an output other than its values.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Traits {
    /// Whether its slopes are known.
    pub(super) has_slope: bool,
    /// Whether it is piecewise constant, although it is a real.
    pub(super) is_discrete: bool,
}

/// Values of all fed outputs at the last communication points, newest first.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct History {
    times: [f64; KEPT],
    points: [Vec<Outcome>; KEPT],
    len: usize,
    /// Traits of each output.
    traits: Vec<Traits>,
    /// The nominal value of each output, if it has one.
    nominals: Vec<Option<f64>>,
    /// Largest magnitude of each output at the clock's points so far, including nominal values. Pulses between these
    /// points do not count, since they say nothing about later values.
    magnitudes: Vec<f64>,
    /// Smallest magnitude to which errors of each output are relative, since shorter steps or further corrections do not
    /// make them smaller: they are noise.
    noise: Vec<f64>,
    /// The clock's step \[s\].
    pub(super) clock_step: f64,
}

/// Magnitude without a nominal value (FMI 2.0, section 2.2.7, `nominal`), for what needs no more than an order of magnitude.
const NOMINAL: f64 = 1.0;

/// The noise assumed is higher than the one found by this factor, and is halved at each of the clock's points: for some of them
/// noise has no effect on the steps, and is found anew then.
const NOISIER: f64 = 1000.0;

impl History {
    pub(super) fn new(nominals: Vec<Option<f64>>, traits: Vec<Traits>) -> Self {
        let room = || vec![Outcome::default(); nominals.len()];
        Self {
            times: [0.0; KEPT],
            points: [room(), room(), room()],
            len: 0,
            traits,
            magnitudes: nominals.iter().map(|own| own.unwrap_or(0.0)).collect(),
            noise: vec![0.0; nominals.len()],
            nominals,
            clock_step: 0.0,
        }
    }

    /// Whether it is one of this number of outputs.
    pub(super) fn fits(&self, outputs: usize) -> bool {
        let points = self.points.iter().map(Vec::len);
        let others = [
            self.traits.len(),
            self.nominals.len(),
            self.magnitudes.len(),
            self.noise.len(),
        ];
        self.len <= KEPT && points.chain(others).all(|own| own == outputs)
    }

    /// Adds a communication point.
    pub(super) fn push(&mut self, time: f64, points: impl Iterator<Item = Outcome>) {
        self.times.rotate_right(1);
        self.points.rotate_right(1);
        self.times[0] = time;
        for (kept, point) in self.points[0].iter_mut().zip(points) {
            *kept = point;
        }
        self.len = (self.len + 1).min(KEPT);
    }

    /// Marks the last point as one of the clock.
    pub(super) fn at_clock(&mut self) {
        for (magnitude, point) in self.magnitudes.iter_mut().zip(&self.points[0]) {
            *magnitude = magnitude.max(point.value.abs());
        }
        self.noise.iter_mut().for_each(|noise| *noise *= 0.5);
    }

    /// Order of magnitude of an output: its largest so far, but not below its nominal value or 1.
    pub(super) fn magnitude(&self, p: usize) -> f64 {
        match self.nominals[p] {
            Some(_) => self.magnitudes[p],
            None => self.magnitudes[p].max(NOMINAL),
        }
    }

    /// What the errors of an output are relative to, in a step by `h` \[s\] to the value `end`. Without a nominal value it is
    /// the output's own size, so far and as expected within a step of the clock: errors of small values are small.
    pub(super) fn scale(&self, p: usize, h: f64, end: f64) -> f64 {
        let (seen, most) = (self.magnitudes[p], self.magnitude(p));
        if self.nominals[p].is_some() {
            return seen;
        }
        let expected = (end - self.value(0, p)).abs() * (self.clock_step / h).max(1.0);
        let own = seen.max(end.abs()).max(expected).max(self.noise[p]);
        match own > 0.0 {
            true => own.min(most),
            false => most,
        }
    }

    /// Notes that an error of this size, with the tolerance `tolerance`, is noise.
    pub(super) fn note_noise(&mut self, p: usize, error: f64, tolerance: f64) {
        self.noise[p] = self.noise[p].max(NOISIER * error / tolerance);
    }

    /// Goes on without the slopes of an output.
    pub(super) fn forget_slopes(&mut self, p: usize) {
        self.traits[p].has_slope = false;
        self.points
            .iter_mut()
            .for_each(|points| points[p].slope = 0.0);
    }

    /// Discards all but the last point, since values before a jump do not predict later ones.
    pub(super) fn restart(&mut self) {
        self.len = self.len.min(1);
    }

    /// An output at the last point.
    pub(super) fn last(&self, p: usize) -> Outcome {
        self.points[0][p]
    }

    pub(super) fn time(&self) -> f64 {
        self.times[0]
    }

    pub(super) fn is_discrete(&self, p: usize) -> bool {
        self.traits[p].is_discrete
    }

    /// Profile over the next `h` [s] by the polynomial of that degree (or lower, if there are too few points) through
    /// the last points.
    pub(super) fn extrapolated(&self, p: usize, degree: usize, h: f64) -> InputProfile {
        let y = self.value(0, p);
        let degree = degree.min(self.len - 1);
        if degree == 0 || self.traits[p].is_discrete {
            return InputProfile::held(y);
        }
        let first = self.first_difference(p);
        let (mut mean, mut end, mut slope) = (y + 0.5 * h * first, y + h * first, first);
        if degree == 2 {
            let (h1, second) = (self.times[0] - self.times[1], self.second_difference(p));
            mean += second * h * (h / 3.0 + h1 / 2.0);
            end += second * h * (h + h1);
            slope += second * (2.0 * h + h1);
        }
        InputProfile {
            mean,
            lean: 0.5 * (end - y),
            end,
            slope,
        }
    }

    /// Predicted slope after the next `h` [s]; 0 if it would exceed the output's magnitude within the step, since it
    /// then belongs to a transient, which has decayed by then.
    pub(super) fn slope_after(&self, p: usize, h: f64) -> f64 {
        let slope = self.points[0][p].slope;
        let expected = match self.len {
            0 | 1 => slope,
            _ => {
                let change = slope - self.points[1][p].slope;
                slope + change * h / (self.times[0] - self.times[1])
            }
        };
        match h * expected.abs() > self.magnitude(p) {
            true => 0.0,
            false => expected,
        }
    }

    /// Profile over the next `h` [s] from the last point to `end`. With slopes: the cubic Hermite polynomial, or a
    /// [transient](Transient) plus a line. Otherwise: the polynomial of degree 1 or 2 (if there are enough points),
    /// whose means are the trapezoidal rule and the Adams-Moulton formula of order 3 for unequal steps. Discrete
    /// outputs are held at their value at the beginning.
    pub(super) fn interpolated(
        &self,
        p: usize,
        degree: usize,
        h: f64,
        end: Outcome,
    ) -> InputProfile {
        if self.traits[p].is_discrete {
            return InputProfile::held(self.value(0, p));
        }
        if let Some(transient) = self.transient(p, h, end) {
            return transient.profile(h, end);
        }
        let begin = self.points[0][p];
        let half = 0.5 * (end.value - begin.value);
        let (mut mean, mut lean) = (0.5 * (begin.value + end.value), half);
        let mut slope = 2.0 * half / h;
        if self.traits[p].has_slope {
            mean += h / 12.0 * (begin.slope - end.slope);
            lean = (6.0 * half - 0.25 * h * (begin.slope + end.slope)) / 5.0;
            slope = end.slope;
        } else if degree.min(self.len) >= 2 {
            let second = self.difference_with(p, h, end.value);
            mean -= h * h / 6.0 * second;
            slope += second * h;
        }
        InputProfile {
            mean,
            lean,
            end: end.value,
            slope,
        }
    }

    /// The transient that decays long before the end of the step, if the slopes indicate one. The cubic would be wrong
    /// by that slope times `h²/12`, whatever the value at the end.
    fn transient(&self, p: usize, h: f64, end: Outcome) -> Option<Transient> {
        if !self.traits[p].has_slope {
            return None;
        }
        let begin = self.points[0][p];
        let (change, rise) = (end.value - begin.value, h * end.slope);
        let (at_begin, at_end) = (h * begin.slope - change, rise - change);
        let is_over = at_begin.abs() > TRANSIENT * (change.abs() + rise.abs());
        is_over.then(|| Transient {
            height: at_end,
            length: at_end / (at_end - at_begin),
        })
    }

    /// Error of the interpolated mean, estimated from the communication points. With slopes it is [that of a smooth
    /// output](Self::smooth_error) or, after the first step, that of an exponential with these second and third
    /// derivatives. This is sharper than [`coarse`](Self::interpolation_error), but not conservative.
    pub(super) fn mean_error(&self, p: usize, h: f64, end: Outcome, coarse: f64) -> f64 {
        if !self.traits[p].has_slope || self.transient(p, h, end).is_some() {
            return coarse;
        }
        if let Some(error) = self.smooth_error(p, h, end) {
            return error;
        }
        // `coarse` is h³/72 times the third derivative, `bend` h² times the second.
        let bend = h * (end.slope - self.points[0][p].slope).abs();
        (7.2 * coarse * coarse / bend).min(coarse)
    }

    /// The error of the cubic's mean, `h⁴/720` times the fourth derivative, estimated with one more point, if slopes
    /// are known and there is no transient.
    pub(super) fn smooth_error(&self, p: usize, h: f64, end: Outcome) -> Option<f64> {
        let is_smooth = self.traits[p].has_slope && self.len > 1;
        (is_smooth && self.transient(p, h, end).is_none())
            .then(|| h.powi(4) / 30.0 * self.fourth_difference(p, h, end).abs())
    }

    /// Conservative error of the mean of degree 2. For a transient it is the transient's whole part of the mean; for a
    /// discrete output half of its change, since the time of the change is unknown. With slopes it is the difference to
    /// the parabola with the slope at the beginning; otherwise the difference to degree 3 or, with too few points, of
    /// the next lower pair. After the first step only the change is known: an exponential that changes by a part `r` of
    /// its magnitude has an error of `r²/12`.
    pub(super) fn interpolation_error(&self, p: usize, h: f64, end: Outcome) -> f64 {
        if let Some(transient) = self.transient(p, h, end) {
            return (transient.height * transient.length).abs();
        }
        let begin = self.points[0][p];
        let change = end.value - begin.value;
        if self.traits[p].is_discrete {
            return 0.5 * change.abs();
        }
        match self.len {
            _ if self.traits[p].has_slope => {
                (change / 6.0 - h / 12.0 * (begin.slope + end.slope)).abs()
            }
            0 | 1 => change * change / (12.0 * self.magnitude(p)),
            2 => h * h / 6.0 * self.difference_with(p, h, end.value).abs(),
            _ => {
                let span = h + self.times[0] - self.times[2];
                let change = self.difference_with(p, h, end.value) - self.second_difference(p);
                let h1 = self.times[0] - self.times[1];
                (change / span).abs() * h * h * (h / 12.0 + h1 / 6.0)
            }
        }
    }

    /// Of the first step, [`interpolation_error`](Self::interpolation_error) relative to the output's own scale: not less for
    /// small values.
    pub(super) fn first_error(&self, p: usize, h: f64, end: Outcome) -> f64 {
        match self.len > 1 || self.traits[p].has_slope {
            true => 0.0,
            false => (end.value - self.value(0, p)).powi(2) / (12.0 * self.scale(p, h, end.value)),
        }
    }

    /// Fourth divided difference at the last two points and `end`, `h` later, with slopes at the later two.
    fn fourth_difference(&self, p: usize, h: f64, end: Outcome) -> f64 {
        let (begin, h1) = (self.points[0][p], self.times[0] - self.times[1]);
        let [before, next] = [self.first_difference(p), (end.value - begin.value) / h];
        let second = [
            (begin.slope - before) / h1,
            (next - begin.slope) / h,
            (end.slope - next) / h,
        ];
        let third = [
            (second[1] - second[0]) / (h1 + h),
            (second[2] - second[1]) / h,
        ];
        (third[1] - third[0]) / (h1 + h)
    }

    fn value(&self, point: usize, p: usize) -> f64 {
        self.points[point][p].value
    }

    fn first_difference(&self, p: usize) -> f64 {
        (self.value(0, p) - self.value(1, p)) / (self.times[0] - self.times[1])
    }

    /// Second divided difference of the last three points.
    fn second_difference(&self, p: usize) -> f64 {
        let before = (self.value(1, p) - self.value(2, p)) / (self.times[1] - self.times[2]);
        (self.first_difference(p) - before) / (self.times[0] - self.times[2])
    }

    /// Second divided difference of the last two points and `end`, `h` after them.
    fn difference_with(&self, p: usize, h: f64, end: f64) -> f64 {
        let next = (end - self.value(0, p)) / h;
        (next - self.first_difference(p)) / (h + self.times[0] - self.times[1])
    }
}

#[cfg(test)]
mod tests;
