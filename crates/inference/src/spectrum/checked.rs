//! Nonparametric responses of pilot and loop, compared with those of a model.

use super::{Point, Record, Unfit, response};
use nalgebra::Complex;

/// Significance level at which the error bar of an estimate excludes the model.
const UNLIKELY: f64 = 0.01;
/// Minimum relative difference of responses that is reported.
const MATTERS: f64 = 0.1;
/// Number of lines outside, and their share of all, from which on the model is doubtful.
const MANY: usize = 3;
const PART: f64 = 1.0 / 3.0;

/// A response at its lines, and the model's response there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Checked {
    /// The lines by ascending frequency.
    pub points: Vec<Point>,
    /// The model's response at each; NaN where there is none.
    pub fitted: Vec<Complex<f64>>,
    /// Mean square error of the model's response; 0 if not known.
    pub variance: Vec<f64>,
}

impl Checked {
    /// With the model's response at jω, given as a function of ω.
    pub fn new(points: Vec<Point>, model: impl Fn(f64) -> Complex<f64>) -> Self {
        Self {
            fitted: points.iter().map(|own| model(own.frequency)).collect(),
            variance: vec![0.0; points.len()],
            points,
        }
    }

    /// The same with the mean square error `variance` of the model's response at a frequency [rad/s].
    pub fn known_as(mut self, variance: impl Fn(f64) -> f64) -> Self {
        let of = |own: &Point| variance(own.frequency);
        self.variance = self.points.iter().map(of).collect();
        self
    }

    /// Lines with the model's response at each.
    pub fn lines(&self) -> impl Iterator<Item = (&Point, Complex<f64>)> {
        self.points.iter().zip(self.fitted.iter().copied())
    }

    /// Whether the model lies outside of the 99 % error bar of a line and differs by more than a tenth. The uncertainty
    /// of the model itself widens the bar.
    pub fn is_outside(&self, line: usize) -> bool {
        let (point, fitted) = (&self.points[line], self.fitted[line]);
        let differs = (fitted - point.response).norm() > MATTERS * point.response.norm();
        differs && point.likelihood_beside(fitted, self.variance[line]) < UNLIKELY
    }

    /// Frequencies of the lines at which the model is outside [rad/s], if these are at least three and a third of all.
    pub fn contradicted(&self) -> Option<Vec<f64>> {
        let outside = (0..self.points.len()).filter(|line| self.is_outside(*line));
        let outside: Vec<f64> = outside.map(|line| self.points[line].frequency).collect();
        let is_many =
            outside.len() >= MANY && outside.len() as f64 >= PART * self.points.len() as f64;
        is_many.then_some(outside)
    }
}

/// A flight to a target; all signals are at the same times.
#[derive(Debug, Clone)]
pub struct Flight<'a> {
    /// Its name.
    pub name: &'a str,
    /// Times of the samples \[s\].
    pub time: &'a [f64],
    /// External inputs of the loop: the target, disturbances.
    pub forcing: Vec<&'a [f64]>,
    /// Target minus position, in units of the position.
    pub error: Vec<f64>,
    /// The stick; `None` if it was not recorded.
    pub stick: Option<&'a [f64]>,
    /// Position of the vehicle.
    pub position: &'a [f64],
}

/// Describing functions of pilot and loop from flights driven by sums of sines.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Describing {
    /// The pilot's describing function from error to stick.
    pub pilot: Checked,
    /// That of the open loop of pilot and vehicle, from error to position.
    pub open_loop: Checked,
    /// Runs from which neither can be estimated, and why.
    pub left_out: Vec<(String, Unfit)>,
}

/// A response of a model at ω [rad/s].
pub type Model<'m> = &'m dyn Fn(f64) -> Complex<f64>;

impl Describing {
    /// From flights with the same forcing functions, compared with a model's responses of pilot and open loop.
    pub fn of(flights: &[Flight<'_>], [pilot, open_loop]: [Model<'_>; 2]) -> Self {
        let (points, left) = response(&records(flights, |own| Some(own.position)));
        let (sticks, _) = response(&records(flights, |own| own.stick));
        let named = |(run, why): (usize, Unfit)| (flights[run].name.to_owned(), why);
        Self {
            pilot: Checked::new(sticks, pilot),
            open_loop: Checked::new(points, open_loop),
            left_out: left.into_iter().map(named).collect(),
        }
    }

    /// Whether no run yielded an estimate.
    pub fn is_empty(&self) -> bool {
        self.pilot.points.is_empty() && self.open_loop.points.is_empty()
    }

    /// The contradiction of the pilot's response, otherwise of the open loop's, if many lines are outside of their
    /// error bars.
    pub fn contradicted(&self) -> Option<Contradiction> {
        let both = [("pilot", &self.pilot), ("open loop", &self.open_loop)];
        let contradiction = |(what, own): (&'static str, &Checked)| {
            let (frequencies, lines) = (own.contradicted()?, own.points.len());
            Some(Contradiction {
                what,
                frequencies,
                lines,
            })
        };
        both.into_iter().find_map(contradiction)
    }
}

/// A fitted response that contradicts the nonparametric estimate from the recordings.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "the fitted {what} lies outside of the error bars of the describing function, which needs no model, at {} of {lines} \
     lines ({}): pilot or vehicle have another structure, another one flew, or columns have different clocks",
    frequencies.len(),
    shown(frequencies)
)]
pub struct Contradiction {
    /// Name of the response.
    pub what: &'static str,
    /// The lines at which it is outside [rad/s].
    pub frequencies: Vec<f64>,
    /// Number of lines.
    pub lines: usize,
}

fn shown(frequencies: &[f64]) -> String {
    match frequencies {
        [first, .., last] => format!("from {first:.2} to {last:.2} rad/s"),
        _ => String::new(),
    }
}

/// The flights that have this output.
pub(super) fn records<'a>(
    flights: &'a [Flight<'a>],
    output: impl Fn(&Flight<'a>) -> Option<&'a [f64]>,
) -> Vec<Record<'a>> {
    let record = |own: &'a Flight<'a>| {
        Some(Record {
            time: own.time,
            forcing: own.forcing.clone(),
            input: &own.error,
            output: output(own)?,
        })
    };
    flights.iter().filter_map(record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(k: usize) -> Point {
        Point {
            frequency: k as f64,
            forcing: 0,
            amplitude: 1.0,
            response: Complex::new(0.0, 2.0),
            sd: 0.02,
            coherence: 0.9,
            chance: 0.0,
            remnant: 0.1,
            runs: 3,
            degrees: 15.0,
        }
    }

    #[test]
    fn many_lines_outside_contradict_a_model() {
        let of = |wrong: usize, by: Complex<f64>| {
            let model = |frequency: f64| match frequency < wrong as f64 {
                true => Complex::new(0.0, 2.0) * by,
                false => Complex::new(0.0, 2.02),
            };
            Checked::new((0..8).map(point).collect(), model).contradicted()
        };
        assert_eq!(of(3, Complex::new(1.3, 0.0)), Some(vec![0.0, 1.0, 2.0]));
        assert_eq!(
            of(3, Complex::from_polar(1.0, 0.3)),
            Some(vec![0.0, 1.0, 2.0])
        );
        assert_eq!(of(2, Complex::new(1.3, 0.0)), None, "two of eight are few");
        assert_eq!(
            of(8, Complex::new(1.09, 0.0)),
            None,
            "a difference of no importance"
        );
    }

    /// A model with a large uncertainty of its own is not contradicted.
    #[test]
    fn what_the_model_may_be_off_by_is_allowed_for() {
        let model = |_| Complex::new(0.0, 2.6);
        let sure = Checked::new((0..8).map(point).collect(), model);
        assert!(sure.contradicted().is_some());
        assert!(sure.clone().known_as(|_| 0.01).contradicted().is_some());
        assert_eq!(sure.known_as(|_| 0.16).contradicted(), None);
    }

    /// F distribution with 2 and 2ν degrees of freedom: its 95 % quantile for ν = 15 is 3.316 (tables), equal to `d²`.
    #[test]
    fn likelihoods_are_those_of_the_f_distribution() {
        let far = 2.0 + 2.0 * (2.0 * 3.316_f64).sqrt() * 0.02;
        let found = point(1).likelihood_of(Complex::new(0.0, far));
        assert!((found - 0.05).abs() < 1e-4, "{found}");
    }
}
