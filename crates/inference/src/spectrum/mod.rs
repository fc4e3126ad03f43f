//! Nonparametric frequency responses from recordings of loops driven by sums of sines.
//!
//! In a closed loop the remnant feeds back into the input, so that the ratio of output to input is biased towards the
//! inverse of the vehicle. The part coherent with the forcing function f is unbiased (McRuer, Graham, Krendel &
//! Reisener, *Human Pilot Dynamics in Compensatory Systems*, AFFDL-TR-65-15, 1965). With cross spectra averaged over
//! runs,
//!
//! ```text
//! Y(jω) = S_fu(ω) / S_fe(ω)      at the lines of f, from input e to output u
//! ```
//!
//! | file | contents |
//! | --- | --- |
//! | `window` | whole periods of the forcing functions, and their lines |
//! | `fourier` | transforms of any length |
//! | `local` | lines without transients, and the remnant next to them |
//! | `excitation`, `bands` | excitation by any forcing function |
//! | `checked` | pilot and loop, compared with those of a model |

mod bands;
mod checked;
mod excitation;
mod fourier;
mod local;
mod window;

pub use checked::{Checked, Contradiction, Describing, Flight, Model};
pub use excitation::{Excitation, Row as Excited, Starved};
pub use fourier::fourier;
use local::{Line, line};
use nalgebra::Complex;
pub use window::{Unfit, Window};

/// Minimum number of runs for which their scatter is used as noise, if it is larger than that next to the lines.
const SCATTER: usize = 3;
/// Frequencies that differ by less than this part of a bin are equal.
const SAME: f64 = 0.25;

/// Recorded signals of a run.
#[derive(Debug, Clone)]
pub struct Record<'a> {
    /// Times of the samples \[s\].
    pub time: &'a [f64],
    /// External inputs of the loop, one signal each; the same in all runs.
    pub forcing: Vec<&'a [f64]>,
    /// Input e of the response.
    pub input: &'a [f64],
    /// Output u of the response.
    pub output: &'a [f64],
}

/// A response at a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Frequency [rad/s].
    pub frequency: f64,
    /// Index of the forcing function that has this line.
    pub forcing: usize,
    /// Its amplitude at the line, root mean square over the runs.
    pub amplitude: f64,
    /// Y, in units of the output per unit of the input.
    pub response: Complex<f64>,
    /// Relative standard deviation of the gain, and that of the phase \[rad\]: `√((1 - γ²) / (2 n γ²))` from n runs,
    /// where γ² is the coherence of u with `Y e` (Bendat & Piersol, *Random Data*, 4th ed., chapter 9).
    pub sd: f64,
    /// Coherence γ² of forcing function and output, from 0 to 1: the share of the output's power in a bin that is due
    /// to the forcing function, corrected for chance.
    pub coherence: f64,
    /// Probability of a coherence this large by chance, from the F distribution as in [`Self::likelihood_of`].
    pub chance: f64,
    /// One-sided spectral density of the remnant `u - Y e` at the line [units of the output squared per rad/s].
    pub remnant: f64,
    /// Number of runs.
    pub runs: usize,
    /// Number of independent complex values behind the remnant.
    pub degrees: f64,
}

impl Point {
    /// Probability of an estimate as far as this from `truth` if that is the true response: `(1 + d²/ν)^-ν`, from the F
    /// distribution with 2 and 2ν degrees of freedom.
    pub fn likelihood_of(&self, truth: Complex<f64>) -> f64 {
        self.likelihood_beside(truth, 0.0)
    }

    /// The same for a response that is known with this mean square error.
    pub fn likelihood_beside(&self, truth: Complex<f64>, variance: f64) -> f64 {
        let variance = variance + 2.0 * self.sd.powi(2) * self.response.norm_sqr();
        likelihood((truth - self.response).norm_sqr() / variance, self.degrees)
    }
}

/// Probability of a larger distance of a complex value, squared and over its variance, which has these degrees of
/// freedom.
fn likelihood(distance: f64, degrees: f64) -> f64 {
    (1.0 + distance / degrees).powf(-degrees)
}

/// Response from input to output at all lines, by ascending frequency; and the indices of runs that yield no estimate,
/// with the reason.
///
/// Lines of runs with equal frequencies are averaged. Noise is estimated next to the lines and, from three runs on,
/// from the scatter between runs, whichever is larger: the scatter includes nonlinear behaviour and a human who
/// changes.
pub fn response(records: &[Record<'_>]) -> (Vec<Point>, Vec<(usize, Unfit)>) {
    let (mut seen, mut unfit) = (Vec::new(), Vec::new());
    for (run, record) in records.iter().enumerate() {
        match lines(record) {
            Ok(own) => seen.extend(own),
            Err(why) => unfit.push((run, why)),
        }
    }
    seen.sort_by(|a: &Seen, b| {
        (a.forcing, a.frequency)
            .partial_cmp(&(b.forcing, b.frequency))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let is_same = |a: &Seen, b: &Seen| {
        let spacing = a.spacing.min(b.spacing);
        a.forcing == b.forcing && (a.frequency - b.frequency).abs() < SAME * spacing
    };
    let mut points: Vec<Point> = seen.chunk_by(is_same).filter_map(averaged).collect();
    points.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    (points, unfit)
}

/// A line of a run in forcing function, input and output.
struct Seen {
    frequency: f64,
    forcing: usize,
    spacing: f64,
    line: Line,
}

impl Seen {
    fn forcing(&self) -> Complex<f64> {
        self.line.values[0]
    }

    /// `S_fe` and `S_fu` of this run alone.
    fn cross(&self) -> [Complex<f64>; 2] {
        [1, 2].map(|k| self.forcing().conj() * self.line.values[k])
    }

    /// `Σ |u - Y e|²` of the bins next to it.
    fn beside(&self, response: Complex<f64>) -> f64 {
        let columns = self.line.beside.column_iter();
        columns
            .map(|own| (own[2] - response * own[1]).norm_sqr())
            .sum()
    }
}

fn lines(record: &Record<'_>) -> Result<Vec<Seen>, Unfit> {
    let window = Window::of(record.time, &record.forcing)?;
    let [input, output] = [record.input, record.output].map(|own| window.amplitudes(own));
    let (input, output) = input.zip(output).ok_or(Unfit::Missing)?;
    let mut all = Vec::new();
    for (forcing, signal) in record.forcing.iter().enumerate() {
        let own = window.amplitudes(signal).ok_or(Unfit::Missing)?;
        let spectra = [own, input.clone(), output.clone()];
        for k in &window.lines[forcing] {
            let spacing = window.spacing();
            let seen = |line| Seen {
                frequency: *k as f64 * spacing,
                forcing,
                spacing,
                line,
            };
            all.extend(line(&spectra, *k, &window.excited).map(seen));
        }
    }
    Ok(all)
}

/// The response at one frequency. `None` if the input does not contain the forcing function.
fn averaged(seen: &[Seen]) -> Option<Point> {
    let count = seen.len() as f64;
    let sum = |k: usize| seen.iter().map(|own| own.cross()[k]).sum::<Complex<f64>>();
    let (input, output) = (sum(0), sum(1));
    let response = output / input;
    let driven: f64 = seen.iter().map(|own| own.forcing().norm_sqr()).sum();
    let inflated: f64 = seen
        .iter()
        .map(|own| own.line.inflation * own.forcing().norm_sqr())
        .sum();
    let (remnant, degrees) = noise(seen, response, |own| {
        own.line.values[2] - response * own.line.values[1]
    });
    // Noise of the output alone: the remnant as the loop shapes it.
    let slope = output / driven;
    let (noise, noise_degrees) = noise(seen, Complex::new(0.0, 0.0), |own| {
        own.line.values[2] - slope * own.forcing()
    });
    // Variance of the slope by chance.
    let scatter = noise * inflated / driven.powi(2);
    let coherent = (slope.norm_sqr() - scatter).max(0.0) * driven / count;
    let variance = remnant * inflated / input.norm_sqr();
    let point = Point {
        frequency: seen.iter().map(|own| own.frequency).sum::<f64>() / count,
        forcing: seen[0].forcing,
        amplitude: (driven / count).sqrt(),
        response,
        sd: (0.5 * variance).sqrt() / response.norm(),
        coherence: coherent / (coherent + noise),
        chance: likelihood(slope.norm_sqr() / scatter, noise_degrees),
        remnant: remnant / (2.0 * seen[0].spacing),
        runs: seen.len(),
        degrees,
    };
    (point.sd.is_finite() && point.coherence.is_finite()).then_some(point)
}

/// Variance of the noise of `u - Y e` in a bin, and its number of independent complex values.
fn noise(
    seen: &[Seen],
    response: Complex<f64>,
    left: impl Fn(&Seen) -> Complex<f64>,
) -> (f64, f64) {
    let squares: f64 = seen.iter().map(|own| own.beside(response)).sum();
    let degrees: f64 = seen.iter().map(|own| own.line.degrees).sum();
    let between = (squares / degrees, degrees);
    let runs = (seen.len() - 1) as f64;
    let scatter = seen
        .iter()
        .map(|own| left(own).norm_sqr() / own.line.inflation)
        .sum::<f64>()
        / runs;
    match seen.len() >= SCATTER && scatter > between.0 {
        true => (scatter, runs),
        false => between,
    }
}
