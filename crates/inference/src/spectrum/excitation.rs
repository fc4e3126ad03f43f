//! Excitation by the forcing functions of flights, before any fit.

use super::bands::bands;
use super::checked::records;
use super::{Flight, Point, Unfit, response};
use crate::stepped::are_stepped;
use pilotage_text::counted;
use std::fmt;

/// Minimum coherence of a line or a band: half of the power is due to the forcing function.
const COHERENT: f64 = 0.5;
/// Probability that any row is coherent by chance.
const BY_CHANCE: f64 = 0.05;
/// Number of standard deviations of a delay that can be distinguished from zero.
const DISTINGUISHED: f64 = 1.96;

/// Excitation of flights, at lines or in bands.
#[derive(Debug, Clone, PartialEq)]
pub struct Excitation {
    /// Whether the forcing functions are sums of sines and rows are their lines; otherwise rows are octave bands.
    pub has_lines: bool,
    /// Why lines were not searched for, although there may be some.
    pub unseen: Option<Unfit>,
    /// Whether nothing drives the loops: no forcing function ever differs from the vehicle's initial position.
    pub is_undriven: bool,
    /// Whether the response never moves.
    pub is_motionless: bool,
    /// Whether no target moves after the start of the flight.
    pub is_still: bool,
    /// Whether they stand still or jump, and at least one jumps.
    pub jumps: bool,
    /// Whether the response is the stick; otherwise no flight has a stick, and it is the position.
    pub of_stick: bool,
    /// Rows by ascending frequency.
    pub rows: Vec<Row>,
}

/// A line or a band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Frequency of the line; geometric mean of the band's ends [rad/s].
    pub frequency: f64,
    /// Amplitude of the forcing function, root mean square over the flights: for a line in its unit, for a band that of
    /// the Fourier transform, in its unit times s.
    pub forcing: f64,
    /// Coherence of forcing function and response; `None` for a band with fewer than three flights.
    pub coherence: Option<f64>,
    /// Probability of a coherence this large by chance.
    pub chance: Option<f64>,
    /// One-sided spectral density of the part of the response not due to the forcing function [its unit squared per
    /// rad/s].
    pub remnant: Option<f64>,
    /// Standard deviation of a phase at this frequency \[rad\].
    pub sd: Option<f64>,
}

impl Excitation {
    /// From flights with the same forcing functions. `None` if no flight has three samples.
    pub fn of(flights: &[Flight<'_>]) -> Option<Self> {
        let of_stick = flights.iter().any(|own| own.stick.is_some());
        let (points, unfit) = match of_stick {
            true => response(&records(flights, |own| own.stick)),
            false => response(&records(flights, |own| Some(own.position))),
        };
        let has_lines = !points.is_empty();
        let rows = match has_lines {
            true => points.iter().map(Row::of).collect(),
            false => bands(flights, of_stick)?,
        };
        let is_still = flights
            .iter()
            .all(|own| own.forcing.iter().all(|own| stands_still(own)));
        let forcings = flights
            .iter()
            .flat_map(|own| own.forcing.iter().map(|all| (own.time, *all)));
        let unseen = unfit.iter().map(|(_, why)| why);
        let mut unseen = unseen.filter(|why| matches!(why, Unfit::Uneven | Unfit::Missing));
        let response = |own: &Flight<'_>| match of_stick {
            true => own.stick.is_none_or(stands_still),
            false => stands_still(own.position),
        };
        Some(Self {
            has_lines,
            unseen: unseen.next().copied().filter(|_| !has_lines),
            jumps: are_stepped(forcings),
            is_undriven: is_still && rows.iter().all(|own| own.forcing == 0.0),
            is_motionless: flights.iter().all(response),
            is_still,
            of_stick,
            rows,
        })
    }

    /// Rows in which at least half of the power is due to the forcing function, and not by chance. Bands end below the
    /// first one that is not coherent: higher ones reflect only the sampling.
    pub fn coherent(&self) -> impl Iterator<Item = &Row> {
        let most = BY_CHANCE / self.rows.len() as f64;
        let is_coherent = move |own: &&Row| {
            own.coherence.is_some_and(|own| own >= COHERENT)
                && own.chance.is_some_and(|own| own < most)
        };
        let first = self.rows.iter().position(|own| is_coherent(&own));
        let from = &self.rows[first.unwrap_or(self.rows.len())..];
        let below = from
            .iter()
            .take_while(move |own| self.has_lines || is_coherent(own));
        below.filter(is_coherent)
    }

    /// The highest coherent frequency [rad/s].
    pub fn highest(&self) -> Option<f64> {
        self.coherent().last().map(|own| own.frequency)
    }

    /// Maximum number of parameters of a response from error to stick that the lines can determine: a gain and a phase
    /// each (Ljung, *System Identification*, 2nd ed., section 13.2: n sines excite persistently of order 2n). `None`
    /// for bands.
    pub fn most_parameters(&self) -> Option<usize> {
        self.has_lines.then(|| 2 * self.coherent().count())
    }

    /// The shortest delay that can be distinguished from zero \[s\] if all else is known: `1.96 / √Σ (ω/σ)²` with the
    /// standard deviations σ of the phases.
    pub fn least_delay(&self) -> Option<f64> {
        let weights = self
            .coherent()
            .filter_map(|own| Some((own.frequency / own.sd?).powi(2)));
        let sum: f64 = weights.sum();
        (sum > 0.0).then(|| DISTINGUISHED / sum.sqrt())
    }

    /// Compares the number of sought parameters with what the lines can determine, for this number of measured signals.
    pub fn starved(&self, asked: usize, signals: usize) -> Option<Starved> {
        let determined = self.most_parameters()? * signals.max(1);
        (asked > determined).then_some(Starved { determined, asked })
    }

    /// Recommended flights if targets do not move, or jump alone.
    pub fn advice(&self) -> Option<&'static str> {
        (self.is_still || self.jumps).then_some(
            "from targets that stand still or jump, a pilot with lead is found with half of the human's crossover; a target that moves \
             as a sum of sines determines crossover, lead and delay: `pilotage trials synth --target sines`, docs/guidance.md, section 1",
        )
    }
}

/// More parameters are sought than the lines can determine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the target's lines that come back determine {determined} numbers, gain and phase each, and {asked} are sought: fly after more \
     sines (`pilotage trials synth --target sines --count 8`; docs/guidance.md, section 1), or seek fewer"
)]
pub struct Starved {
    /// Number of parameters that the lines can determine.
    pub determined: usize,
    /// Number of parameters sought.
    pub asked: usize,
}

/// Summary in one line.
impl fmt::Display for Excitation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let signal = if self.of_stick { "stick" } else { "position" };
        write!(f, "excitation: ")?;
        if self.is_undriven {
            return write!(
                f,
                "nothing drives the loop: no target ever differs from where the vehicle begins"
            );
        }
        if self.is_motionless {
            return write!(f, "the {signal} never moves");
        }
        match (self.has_lines, &self.unseen) {
            (true, _) => write!(f, "{}; ", counted(self.rows.len(), "line"))?,
            (false, Some(why)) => {
                write!(f, "a recording {why}, so that no lines are looked for; ")?
            }
            (false, None) => write!(f, "no sum of sines; ")?,
        }
        match self.highest() {
            _ if self.rows.iter().all(|own| own.coherence.is_none()) => {
                write!(f, "coherence is not known of fewer than three flights")?;
            }
            Some(highest) => write!(
                f,
                "the {signal} is coherent with what drives the loop up to {highest:.2} rad/s"
            )?,
            None => write!(f, "the {signal} is not coherent with what drives the loop")?,
        }
        if let Some(most) = self.most_parameters() {
            write!(f, "; at most {most} parameters from error to {signal}")?;
        }
        // After identical steps a delay cannot be distinguished from a lag.
        self.least_delay()
            .filter(|_| self.has_lines)
            .map_or(Ok(()), |least| write!(f, "; delays from {least:.3} s on"))
    }
}

impl Row {
    fn of(point: &Point) -> Self {
        Self {
            frequency: point.frequency,
            forcing: point.amplitude,
            coherence: Some(point.coherence),
            chance: Some(point.chance),
            remnant: Some(point.remnant),
            sd: Some(point.sd),
        }
    }
}

fn stands_still(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[0] == pair[1])
}
