//! What the fed outputs were at the last communication points, and the polynomials through them.

/// Communication points that are kept: enough for a polynomial of degree 3 with the one to come.
const KEPT: usize = 3;

/// Values of all fed outputs at the last communication points, newest first.
#[derive(Debug, Default)]
pub(super) struct History {
    times: [f64; KEPT],
    values: [Vec<f64>; KEPT],
    len: usize,
    /// Largest magnitude of each so far, nominal values counted.
    pub(super) magnitudes: Vec<f64>,
}

impl History {
    pub(super) fn new(nominals: Vec<f64>) -> Self {
        let room = || vec![0.0; nominals.len()];
        Self {
            times: [0.0; KEPT],
            values: [room(), room(), room()],
            len: 0,
            magnitudes: nominals,
        }
    }

    /// Takes in a communication point.
    pub(super) fn push(&mut self, time: f64, values: impl Iterator<Item = f64>) {
        self.times.rotate_right(1);
        self.values.rotate_right(1);
        self.times[0] = time;
        let newest = self.values[0].iter_mut().zip(&mut self.magnitudes);
        for ((kept, magnitude), value) in newest.zip(values) {
            *kept = value;
            *magnitude = magnitude.max(value.abs());
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

    /// Mean over the next `h` [s] and value at its end, of the polynomial of that degree (or as many
    /// points as there are) through the last points.
    pub(super) fn extrapolated(&self, p: usize, degree: usize, h: f64) -> (f64, f64) {
        let y = self.values[0][p];
        let degree = degree.min(self.len - 1);
        if degree == 0 {
            return (y, y);
        }
        let first = self.first_difference(p);
        let (mut mean, mut end) = (y + 0.5 * h * first, y + h * first);
        if degree == 2 {
            let (h1, second) = (self.times[0] - self.times[1], self.second_difference(p));
            mean += second * h * (h / 3.0 + h1 / 2.0);
            end += second * h * (h + h1);
        }
        (mean, end)
    }

    /// Mean over the next `h` [s] of the polynomial of degree 1 or 2 (if there are points enough)
    /// through the last points and `end`: the trapezoidal rule, or the Adams-Moulton formula of
    /// order 3 for unequal steps.
    pub(super) fn interpolated(&self, p: usize, degree: usize, h: f64, end: f64) -> f64 {
        let mean = 0.5 * (self.values[0][p] + end);
        match degree.min(self.len) {
            0 | 1 => mean,
            _ => mean - h * h / 6.0 * self.difference_with(p, h, end),
        }
    }

    /// By how much the mean of degree 2 may be off: the difference to the one of degree 3, or, as long
    /// as there are too few points, of the next lower pair. After the very first step the change alone
    /// is known: an exponential that changes by a part `r` of its magnitude has an error of `r²/12`.
    pub(super) fn interpolation_error(&self, p: usize, h: f64, end: f64) -> f64 {
        match self.len {
            0 | 1 => (end - self.values[0][p]).powi(2) / (12.0 * self.magnitudes[p]),
            2 => h * h / 6.0 * self.difference_with(p, h, end).abs(),
            _ => {
                let span = h + self.times[0] - self.times[2];
                let change = self.difference_with(p, h, end) - self.second_difference(p);
                let h1 = self.times[0] - self.times[1];
                (change / span).abs() * h * h * (h / 12.0 + h1 / 6.0)
            }
        }
    }

    fn first_difference(&self, p: usize) -> f64 {
        (self.values[0][p] - self.values[1][p]) / (self.times[0] - self.times[1])
    }

    /// Second divided difference of the last three points.
    fn second_difference(&self, p: usize) -> f64 {
        let before = (self.values[1][p] - self.values[2][p]) / (self.times[1] - self.times[2]);
        (self.first_difference(p) - before) / (self.times[0] - self.times[2])
    }

    /// Second divided difference of the last two points and `end`, `h` after them.
    fn difference_with(&self, p: usize, h: f64, end: f64) -> f64 {
        let next = (end - self.values[0][p]) / h;
        (next - self.first_difference(p)) / (h + self.times[0] - self.times[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polynomials up to the degree in question come out exactly, on unequal steps.
    #[test]
    fn polynomials_are_exact() {
        let times = [0.3, 0.7, 0.8];
        let h = 0.25;
        let integral = |c: [f64; 4], t: f64| -> f64 {
            (0..4).map(|i| c[i] * t.powi(i as i32 + 1) / (i + 1) as f64).sum()
        };
        let value = |c: [f64; 4], t: f64| -> f64 { (0..4).map(|i| c[i] * t.powi(i as i32)).sum() };
        let history = |c| {
            let mut history = History::new(vec![1.0]);
            for t in times {
                history.push(t, std::iter::once(value(c, t)));
            }
            history
        };
        let (begin, end) = (times[2], times[2] + h);
        for (degree, c) in [
            (0, [3.0, 0.0, 0.0, 0.0]),
            (1, [3.0, -2.0, 0.0, 0.0]),
            (2, [3.0, -2.0, 5.0, 0.0]),
        ] {
            let mean = (integral(c, end) - integral(c, begin)) / h;
            let history = history(c);
            let found = history.extrapolated(0, degree, h);
            assert!((found.0 - mean).abs() < 1e-12, "{degree}: {found:?}");
            assert!((found.1 - value(c, end)).abs() < 1e-12, "{degree}: {found:?}");
            let found = history.interpolated(0, degree.max(1), h, value(c, end));
            assert!((found - mean).abs() < 1e-12, "{degree}: {found}");
            assert!(history.interpolation_error(0, h, value(c, end)) < 1e-12);
        }
        // The estimate is exact for a cubic.
        let c = [3.0, -2.0, 5.0, 7.0];
        let mean = (integral(c, end) - integral(c, begin)) / h;
        let history = history(c);
        let error = (history.interpolated(0, 2, h, value(c, end)) - mean).abs();
        let estimate = history.interpolation_error(0, h, value(c, end));
        assert!((error - estimate).abs() < 1e-12 && error > 1e-3);
    }
}
