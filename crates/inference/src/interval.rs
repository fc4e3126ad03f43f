//! Confidence intervals of one parameter.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Confidence level.
pub const LEVEL: f64 = 0.95;

/// Degrees of freedom beyond which Student's t equals the normal distribution to three digits.
const MANY: f64 = 1e4;

/// Standard deviation, relative to the value, below which it counts as rounding.
const ROUNDING: f64 = 1e-9;

/// Classification of an interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Class {
    /// Both ends are determined by the data.
    Finite,
    /// One end is that of the parameter's range: the data do not exclude it.
    OneSided,
    /// The data do not determine the parameter, at all or within its range.
    Flat,
    /// The estimate lies on an end of its range; the data determine the other end.
    OnBound,
    /// The parameter is not finite at the estimate.
    Undefined,
    /// Active constraints fix the parameter, or no unknown changes it: it has no deviation.
    Held,
}

impl Class {
    /// Name for scripts.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::OneSided => "one-sided",
            Self::Flat => "flat",
            Self::OnBound => "on-bound",
            Self::Undefined => "undefined",
            Self::Held => "held",
        }
    }
}

/// A 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Standard deviation with an active bound on the estimate released; infinite if undetermined.
    pub sd: f64,
    /// Lower end; -∞ if there is none.
    pub low: f64,
    /// Upper end; ∞ if there is none.
    pub high: f64,
    /// Classification.
    pub class: Class,
}

impl Interval {
    /// Interval around an estimate with this standard deviation (infinite if undetermined), within the parameter's
    /// range; `bound` is the end of the range that the estimate lies on, if any.
    pub fn new(value: f64, sd: f64, degrees: f64, range: [f64; 2], bound: Option<f64>) -> Self {
        let half = match sd.is_finite() {
            true => quantile(LEVEL, degrees) * sd,
            false => f64::INFINITY,
        };
        let [low, high] = [(value - half).max(range[0]), (value + half).min(range[1])];
        let own = |low, high, class| Self {
            sd,
            low,
            high,
            class,
        };
        let is_low =
            bound.is_some_and(|bound| (bound - range[0]).abs() <= (bound - range[1]).abs());
        if !value.is_finite() {
            // An undefined value has no deviation.
            let [low, high] = range;
            let (sd, class) = (f64::NAN, Class::Undefined);
            return Self {
                sd,
                low,
                high,
                class,
            };
        }
        match (bound.is_some(), is_low) {
            (true, true) => return own(range[0], high, Class::OnBound),
            (true, false) => return own(low, range[1], Class::OnBound),
            _ => {}
        }
        let ends = [value - half <= range[0], value + half >= range[1]];
        let class = match ends {
            _ if half.is_infinite() => Class::Flat,
            [true, true] => Class::Flat,
            [false, false] => Class::Finite,
            _ => Class::OneSided,
        };
        own(low, high, class)
    }
}

impl Interval {
    /// The interval of an estimate with this value, classified as held if its width is only rounding error: none has the width 0.
    pub fn or_held(self, value: f64) -> Self {
        let is_exact = self.class == Class::Finite && self.sd <= ROUNDING * value.abs();
        let is_held = is_exact || self.high - self.low <= ROUNDING * value.abs();
        match is_held {
            true => Self {
                sd: f64::NAN,
                low: f64::NAN,
                high: f64::NAN,
                class: Class::Held,
            },
            false => self,
        }
    }
}

/// Half width, in standard deviations, of an interval with this confidence level (0.95 for 95 %), by Student's t. Degrees
/// of freedom below 1 count as 1.
///
/// # Panics
/// If the level does not lie between 0 and 1.
pub fn quantile(level: f64, degrees: f64) -> f64 {
    assert!(level > 0.0 && level < 1.0, "a level between 0 and 1");
    let (probability, degrees) = (0.5 * (1.0 + level), degrees.max(1.0));
    if degrees > MANY {
        return Normal::standard().inverse_cdf(probability);
    }
    let student = StudentsT::new(0.0, 1.0, degrees);
    student.map_or(f64::NAN, |own| own.inverse_cdf(probability))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz & Stegun, table 26.10.
    #[test]
    fn quantiles_are_those_of_tables() {
        let table = [
            (1.0, 12.706),
            (2.0, 4.303),
            (3.0, 3.182),
            (5.0, 2.571),
            (60.0, 2.000),
            (9999.0, 1.960),
            (1e9, 1.960),
        ];
        for (degrees, t) in table {
            assert!(
                (quantile(0.95, degrees) - t).abs() < 6e-4,
                "{degrees}: {}",
                quantile(0.95, degrees)
            );
        }
    }

    #[test]
    fn classes_say_which_ends_are_the_datas() {
        let open = [f64::NEG_INFINITY, f64::INFINITY];
        let of = |sd, range, bound| Interval::new(1.0, sd, 1e9, range, bound);
        assert_eq!(of(0.1, open, None).class, Class::Finite);
        assert_eq!(of(0.1, [0.9, 9.0], None).class, Class::OneSided);
        assert_eq!(of(0.1, [0.9, 1.1], None).class, Class::Flat);
        assert_eq!(of(f64::INFINITY, open, None).class, Class::Flat);
        let on = of(0.1, [1.0, 9.0], Some(1.0));
        assert_eq!((on.class, on.low), (Class::OnBound, 1.0));
        assert!((on.high - 1.196).abs() < 1e-3);
        let on = of(f64::INFINITY, [1.0, f64::INFINITY], Some(1.0));
        assert_eq!((on.low, on.high), (1.0, f64::INFINITY));
    }
}
