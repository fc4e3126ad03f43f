//! Frequency responses straight from recordings, without a model: where what drives a loop is a sum of sines.
//!
//! In a closed loop the remnant comes round into the input, so that the ratio of output to input is biased towards the
//! inverse of the vehicle. What is coherent with the forcing function f is not (McRuer, Graham, Krendel & Reisener, *Human
//! Pilot Dynamics in Compensatory Systems*, AFFDL-TR-65-15, 1965): with cross spectra averaged over runs,
//!
//! ```text
//! Y(jω) = S_fu(ω) / S_fe(ω)      at the lines of f, from input e to output u
//! ```
//!
//! | file | what it holds |
//! | --- | --- |
//! | `window` | whole periods of the forcing functions, and their lines |
//! | `fourier` | transforms of any length |
//! | `local` | lines without transients, and the remnant between them |
//! | `excitation`, `bands` | what flights excite, whatever drives them |
//! | `checked` | pilot and loop, beside those of a model |

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

/// Runs from which their scatter is taken for noise, where it is larger than that between the lines.
const SCATTER: usize = 3;
/// Frequencies that differ by less than this part of a bin are one.
const SAME: f64 = 0.25;

/// What was recorded in a run.
#[derive(Debug, Clone)]
pub struct Record<'a> {
    /// Times of the samples \[s\].
    pub time: &'a [f64],
    /// What drives the loop from outside, a signal each: the same ones in all runs.
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
    /// The forcing function that has this line.
    pub forcing: usize,
    /// Its amplitude there, root mean square over the runs.
    pub amplitude: f64,
    /// Y, in units of the output over the input.
    pub response: Complex<f64>,
    /// Standard deviation of the gain, relative, and of the phase \[rad\]: `√((1 - γ²) / (2 n γ²))` from n runs, where γ²
    /// is the coherence of u with `Y e` (Bendat & Piersol, *Random Data*, 4th ed., chapter 9).
    pub sd: f64,
    /// Coherence γ² of forcing function and output, from 0 to 1: the part of the output's power in a bin that is the
    /// forcing function's, without what is there by chance.
    pub coherence: f64,
    /// How likely as much would be there by chance: from the F distribution, as [`Self::likelihood_of`].
    pub chance: f64,
    /// One-sided spectral density of the remnant `u - Y e` there [units of the output squared per rad/s].
    pub remnant: f64,
    /// Number of runs.
    pub runs: usize,
    /// Independent complex values that tell the remnant.
    pub degrees: f64,
}

impl Point {
    /// How likely an estimate as far as this from a response is, if that is the true one: `(1 + d²/ν)^-ν`, from the F
    /// distribution with 2 and 2ν degrees of freedom.
    pub fn likelihood_of(&self, truth: Complex<f64>) -> f64 {
        self.likelihood_beside(truth, 0.0)
    }

    /// The same of a response that is known with an error of this mean square.
    pub fn likelihood_beside(&self, truth: Complex<f64>, variance: f64) -> f64 {
        let variance = variance + 2.0 * self.sd.powi(2) * self.response.norm_sqr();
        likelihood((truth - self.response).norm_sqr() / variance, self.degrees)
    }
}

/// How likely a complex value is further off than this, squared and over its variance, which so many values tell.
fn likelihood(distance: f64, degrees: f64) -> f64 {
    (1.0 + distance / degrees).powf(-degrees)
}

/// The response from input to output at all lines, by ascending frequency; and for each run that tells nothing of it, by
/// its number, why.
///
/// Lines of runs whose frequencies agree are averaged. Noise is what is left between lines, and from three runs on
/// what differs from run to run, whichever is larger: that is what the loop does not do linearly, and a human who changes.
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

/// A line of a run: of forcing function, input and output.
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

    /// `Σ |u - Y e|²` of the bins beside it.
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

/// The response at one frequency. None where the input has nothing of the forcing function.
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
    // Of the output alone: what the loop makes of the remnant.
    let slope = output / driven;
    let (noise, told) = noise(seen, Complex::new(0.0, 0.0), |own| {
        own.line.values[2] - slope * own.forcing()
    });
    // Of the slope by chance.
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
        chance: likelihood(slope.norm_sqr() / scatter, told),
        remnant: remnant / (2.0 * seen[0].spacing),
        runs: seen.len(),
        degrees,
    };
    (point.sd.is_finite() && point.coherence.is_finite()).then_some(point)
}

/// Variance of the noise of `u - Y e` in a bin, and how many complex values tell it.
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
