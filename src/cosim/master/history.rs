//! What the fed outputs were at the last communication points, and the polynomials through them.

/// Communication points that are kept: enough for a polynomial of degree 3 with the one to come.
const KEPT: usize = 3;

/// How a value goes within a step, as far as a slave can be told: its mean; the line `mean ± lean`
/// with the same first moment (the projection on polynomials of degree 1); and its value at the end.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Course {
    pub(super) mean: f64,
    pub(super) lean: f64,
    pub(super) end: f64,
}

impl Course {
    /// A constant.
    pub(super) fn held(value: f64) -> Self {
        Self {
            mean: value,
            lean: 0.0,
            end: value,
        }
    }

    pub(super) fn is_held(&self) -> bool {
        self.lean == 0.0 && self.mean == self.end
    }

    /// Whether the line does not end where the value does.
    pub(super) fn is_curved(&self) -> bool {
        let size = self.mean.abs() + self.lean.abs() + self.end.abs();
        (self.mean + self.lean - self.end).abs() > 1e-12 * size
    }

    /// The line after a part `at` of the step.
    pub(super) fn line(&self, at: f64) -> f64 {
        self.mean + (2.0 * at - 1.0) * self.lean
    }

    /// The line with the same mean that ends where the value does.
    pub(super) fn to_end(self) -> Self {
        Self {
            lean: self.end - self.mean,
            ..self
        }
    }
}

/// An output at the end of a step: its value and, if its slave gives it, its time derivative.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Outcome {
    pub(super) value: f64,
    pub(super) slope: f64,
}

/// Values of all fed outputs at the last communication points, newest first.
#[derive(Debug, Default)]
pub(super) struct History {
    times: [f64; KEPT],
    points: [Vec<Outcome>; KEPT],
    len: usize,
    /// Whether slopes are known, for each output.
    has_slope: Vec<bool>,
    /// Largest magnitude of each so far, nominal values counted.
    pub(super) magnitudes: Vec<f64>,
}

impl History {
    pub(super) fn new(nominals: Vec<f64>, has_slope: Vec<bool>) -> Self {
        let room = || vec![Outcome::default(); nominals.len()];
        Self {
            times: [0.0; KEPT],
            points: [room(), room(), room()],
            len: 0,
            has_slope,
            magnitudes: nominals,
        }
    }

    /// Takes in a communication point.
    pub(super) fn push(&mut self, time: f64, points: impl Iterator<Item = Outcome>) {
        self.times.rotate_right(1);
        self.points.rotate_right(1);
        self.times[0] = time;
        let newest = self.points[0].iter_mut().zip(&mut self.magnitudes);
        for ((kept, magnitude), point) in newest.zip(points) {
            *kept = point;
            *magnitude = magnitude.max(point.value.abs());
        }
        self.len = (self.len + 1).min(KEPT);
    }

    /// Forgets all but the last point: what lies before a jump says nothing about what comes.
    pub(super) fn restart(&mut self) {
        self.len = self.len.min(1);
    }

    pub(super) fn time(&self) -> f64 {
        self.times[0]
    }

    /// The next `h` [s] along the polynomial of that degree (or as many points as there are) through
    /// the last points.
    pub(super) fn extrapolated(&self, p: usize, degree: usize, h: f64) -> Course {
        let y = self.value(0, p);
        let degree = degree.min(self.len - 1);
        if degree == 0 {
            return Course::held(y);
        }
        let first = self.first_difference(p);
        let (mut mean, mut end) = (y + 0.5 * h * first, y + h * first);
        if degree == 2 {
            let (h1, second) = (self.times[0] - self.times[1], self.second_difference(p));
            mean += second * h * (h / 3.0 + h1 / 2.0);
            end += second * h * (h + h1);
        }
        let lean = 0.5 * (end - y);
        Course { mean, lean, end }
    }

    /// The slope to be expected after the next `h` [s].
    pub(super) fn slope_after(&self, p: usize, h: f64) -> f64 {
        let slope = self.points[0][p].slope;
        match self.len {
            0 | 1 => slope,
            _ => {
                let change = slope - self.points[1][p].slope;
                slope + change * h / (self.times[0] - self.times[1])
            }
        }
    }

    /// The next `h` [s] from the last point to `end`: along the cubic with the slopes at both ends
    /// (Hermite's) where these are known; else along the polynomial of degree 1 or 2 (if there are
    /// points enough), whose means are the trapezoidal rule and the Adams-Moulton formula of order 3
    /// for unequal steps.
    pub(super) fn interpolated(&self, p: usize, degree: usize, h: f64, end: Outcome) -> Course {
        let begin = self.points[0][p];
        let half = 0.5 * (end.value - begin.value);
        let (mut mean, mut lean) = (0.5 * (begin.value + end.value), half);
        if self.has_slope[p] {
            mean += h / 12.0 * (begin.slope - end.slope);
            lean = (6.0 * half - 0.25 * h * (begin.slope + end.slope)) / 5.0;
        } else if degree.min(self.len) >= 2 {
            mean -= h * h / 6.0 * self.difference_with(p, h, end.value);
        }
        Course {
            mean,
            lean,
            end: end.value,
        }
    }

    /// By how much the mean of that with degree 2 may be off. With slopes it is the difference to the
    /// parabola with the slope at the begin; else the difference to degree 3, or, as long as there are
    /// too few points, of the next lower pair. After the very first step the change alone is known: an
    /// exponential that changes by a part `r` of its magnitude has an error of `r²/12`.
    pub(super) fn interpolation_error(&self, p: usize, h: f64, end: Outcome) -> f64 {
        let begin = self.points[0][p];
        let change = end.value - begin.value;
        match self.len {
            _ if self.has_slope[p] => (change / 6.0 - h / 12.0 * (begin.slope + end.slope)).abs(),
            0 | 1 => change * change / (12.0 * self.magnitudes[p]),
            2 => h * h / 6.0 * self.difference_with(p, h, end.value).abs(),
            _ => {
                let span = h + self.times[0] - self.times[2];
                let change = self.difference_with(p, h, end.value) - self.second_difference(p);
                let h1 = self.times[0] - self.times[1];
                (change / span).abs() * h * h * (h / 12.0 + h1 / 6.0)
            }
        }
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
mod tests {
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
        let mut history = History::new(vec![1.0], vec![has_slope]);
        for t in TIMES {
            history.push(t, std::iter::once(at(c, t)));
        }
        history
    }

    /// Mean, lean and end over the next step by Simpson's rule, which is exact for them in many parts.
    fn exact(c: [f64; 4]) -> Course {
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
        Course {
            mean,
            lean: 3.0 * moment,
            end: at(c, TIMES[2] + H).value,
        }
    }

    fn assert_close(found: Course, expected: Course) {
        for (found, expected) in [
            (found.mean, expected.mean),
            (found.lean, expected.lean),
            (found.end, expected.end),
        ] {
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        }
    }

    /// Polynomials up to the degree in question come out exactly, on unequal steps.
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
}
