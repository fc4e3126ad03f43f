//! Communication points, counted rather than summed.

use crate::problem::Problem;

/// Largest difference of two times that count as equal, relative to their size.
const SAME_TIME: f64 = 1e-9;

/// Largest rounding error of a communication point, relative to its size.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Position of an instance in time, and the steps that led to it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// The last communication point, as the importer gave it \[s\].
    pub time: f64,
    /// End of the experiment \[s\].
    pub stop: Option<f64>,
    /// Start of the sequence of equal steps that led here \[s\].
    pub anchor: f64,
    /// Size of these steps \[s\]; 0 before the first step.
    pub step: f64,
    /// Number of these steps.
    pub count: u64,
}

impl Clock {
    /// A clock at time `start`.
    pub fn new(start: f64, stop: Option<f64>) -> Self {
        Self {
            time: start,
            stop,
            anchor: start,
            step: 0.0,
            count: 0,
        }
    }

    /// The clock at another time, with the same stop time.
    pub fn moved_to(&self, time: f64) -> Self {
        Self::new(time, self.stop)
    }

    /// Checks a step from `time` by `step`. Returns the step to integrate, and the clock after it.
    ///
    /// Importers compute equal communication points as sums, products or differences, which round differently. A step
    /// that ends, up to rounding, where one more of the previous steps would end is therefore treated as such a step:
    /// results do not depend on how the importer computes its times, and the integrated time deviates from the
    /// importer's by rounding only.
    ///
    /// # Errors
    /// If the step is not positive, does not start at the current time, or goes beyond the stop time.
    pub fn advance(&self, time: f64, step: f64) -> Result<(f64, Self), Problem> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(Problem::StepSize { step });
        }
        let scale = time.abs().max(self.time.abs()).max(step);
        // Written so that NaN is rejected too.
        if !matches!((time - self.time).abs().partial_cmp(&(SAME_TIME * scale)), Some(o) if o.is_le())
        {
            return Err(Problem::WrongTime {
                found: time,
                expected: self.time,
            });
        }
        let end = time + step;
        match self.stop {
            Some(stop) if end - stop > SAME_TIME * stop.abs().max(step) => {
                return Err(Problem::BeyondStop { time, step, stop });
            }
            _ => {}
        }
        let counted = self.anchor + (self.count + 1) as f64 * self.step;
        let next = match (end - counted).abs() <= ROUNDING * end.abs().max(scale) {
            true if self.count > 0 => Self {
                time: end,
                count: self.count + 1,
                ..*self
            },
            _ => Self {
                time: end,
                anchor: time,
                step,
                count: 1,
                ..*self
            },
        };
        Ok((next.step, next))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integrated steps if the importer passes these times.
    fn steps(points: impl IntoIterator<Item = (f64, f64)>) -> Vec<f64> {
        let mut clock = Clock::new(0.0, None);
        let mut steps = Vec::new();
        for (time, step) in points {
            let (step, next) = clock
                .advance(time, step)
                .expect("the points follow each other");
            clock = next;
            steps.push(step);
        }
        steps
    }

    #[test]
    fn rounding_of_the_importer_leaves_no_trace() {
        let h = 0.1;
        let n = 1000;
        let counted = |k: usize| k as f64 * h;
        let mut sum = 0.0;
        let summed = steps((0..n).map(|_| {
            let point = (sum, h);
            sum += h;
            point
        }));
        let differences = steps((0..n).map(|k| (counted(k), counted(k + 1) - counted(k))));
        let products = steps((0..n).map(|k| (counted(k), h)));
        assert_eq!(products, vec![h; n]);
        assert_eq!(summed, products);
        assert_eq!(differences, products);
    }

    #[test]
    fn steps_that_truly_differ_are_kept() {
        let points = [(0.0, 0.1), (0.1, 0.1 + 1e-13), (0.2 + 1e-13, 0.1)];
        assert_eq!(steps(points), [0.1, 0.1 + 1e-13, 0.1]);
    }

    #[test]
    fn integrated_time_stays_with_the_importers() {
        // At late times the differences have errors of 1e-10 s; their sum must not drift.
        let (start, h) = (1e6, 1e-3);
        let mut clock = Clock::new(start, None);
        let mut elapsed = 0.0;
        for k in 0..10_000 {
            let (t, next) = (start + k as f64 * h, start + (k + 1) as f64 * h);
            let (step, after) = clock.advance(t, next - t).expect("it follows");
            clock = after;
            elapsed += step;
        }
        assert!((elapsed - 10.0).abs() < 1e-8, "{elapsed}");
    }

    #[test]
    fn tolerances_are_relative() {
        let clock = Clock::new(100.0, Some(101.0));
        assert!(clock.advance(100.0 + 5e-8, 1.0).is_ok());
        assert!(clock.advance(100.0 + 5e-7, 1.0).is_err());
        assert!(clock.advance(100.0, 1.0 + 1e-8).is_ok());
        assert!(clock.advance(100.0, 1.0 + 1e-5).is_err());
        for step in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                clock.advance(100.0, step),
                Err(Problem::StepSize { .. })
            ));
        }
        assert!(clock.advance(f64::NAN, 0.1).is_err());
    }
}
