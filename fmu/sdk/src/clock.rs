//! Communication points, counted instead of summed.

use crate::problem::Problem;

/// How far two times may differ to be the same, relative to their size.
const SAME_TIME: f64 = 1e-9;

/// How many units in the last place a communication point may be off by rounding.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Where an instance stands in time, and in which steps it came there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// The last communication point, as the importer gave it \[s\].
    pub time: f64,
    /// Where the experiment ends \[s\].
    pub stop: Option<f64>,
    /// First of the equal steps that led here \[s\].
    pub anchor: f64,
    /// The size of these steps \[s\]; 0 before the first step.
    pub step: f64,
    /// Their number.
    pub count: u64,
}

impl Clock {
    /// A clock that stands at `start`.
    pub fn new(start: f64, stop: Option<f64>) -> Self {
        Self {
            time: start,
            stop,
            anchor: start,
            step: 0.0,
            count: 0,
        }
    }

    /// The clock at another time, with the same end.
    pub fn moved_to(&self, time: f64) -> Self {
        Self::new(time, self.stop)
    }

    /// Checks a step from `time` by `step`. Gives the step to integrate, and the clock after it.
    ///
    /// Importers reach equal communication points by sums, products or differences, whose rounding
    /// differs. So a step that ends where one more of the last steps would end, but for rounding, is
    /// such a step: results do not depend on how the importer computes its times, and the time that is
    /// integrated never strays further than rounding from the importer's.
    ///
    /// # Errors
    /// When the step is not positive, does not begin here, or leads beyond the stop time.
    pub fn advance(&self, time: f64, step: f64) -> Result<(f64, Self), Problem> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(Problem::StepSize { step });
        }
        let scale = time.abs().max(self.time.abs()).max(step);
        // Written so that NaN is refused too.
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

    /// The steps that are integrated when the importer passes these times.
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
        // Late in time the differences are rough, by 1e-10 s; their sum must not run away.
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
