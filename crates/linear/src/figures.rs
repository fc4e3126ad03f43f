//! Figures of merit of a loop, and their changes for a slightly different loop.

use super::margins::{GainCrossing, Margins, PhaseCrossing, Response};
use nalgebra::Complex;

/// Standard figures of a closed loop: its stability margins and its poles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoopFigures {
    /// The crossover with the smallest phase margin; none if the gain is never 1.
    pub crossover: Option<GainCrossing>,
    /// The crossing of -180° whose gain margin is nearest to 1; none if there is no crossing.
    pub gain_margin: Option<PhaseCrossing>,
    /// Poles of the closed loop [1/s].
    pub poles: Vec<Complex<f64>>,
}

/// A loop that is cut open at one connection.
#[derive(Debug, Clone)]
pub struct OpenLoop<L> {
    /// `L(jω)`, such that `1 + L = 0` is the closed loop.
    pub response: L,
    /// Poles of the open loop [1/s].
    pub open: Vec<Complex<f64>>,
    /// Poles of the closed loop [1/s].
    pub closed: Vec<Complex<f64>>,
}

impl<L: Fn(f64) -> Complex<f64>> OpenLoop<L> {
    /// The figures of this loop.
    pub fn figures(&self) -> LoopFigures {
        let poles = [&self.open[..], &self.closed].concat();
        let response = Response::of(&self.response, &poles, None);
        let margins = Margins::of(&response, &self.response);
        LoopFigures {
            crossover: margins.phase_margin().copied(),
            gain_margin: margins.gain_margin().copied(),
            poles: self.closed.clone(),
        }
    }

    /// The figures of this loop, with each pole in the place of the given pole to which it is nearest.
    pub fn figures_with(&self, poles: &[Complex<f64>]) -> LoopFigures {
        let own = self.figures();
        LoopFigures {
            poles: matched(poles, own.poles),
            ..own
        }
    }

    /// The figures of this loop that correspond to those of a nearly identical loop: the crossings and poles nearest to
    /// them. None for a crossing that has disappeared.
    pub fn figures_near(&self, before: &LoopFigures) -> LoopFigures {
        let crossing = |from: f64, function: fn(Complex<f64>) -> f64| {
            let omega = root_near(from, |omega| function((self.response)(omega)))?;
            Some((omega, (self.response)(omega)))
        };
        let gain = |own: GainCrossing| crossing(own.frequency, |value| value.norm().ln());
        // The phase relative to -180°, which is nearly 0 here.
        let phase = |own: PhaseCrossing| crossing(own.frequency, |value| (-value).arg());
        LoopFigures {
            crossover: before.crossover.and_then(gain).map(GainCrossing::at),
            gain_margin: before.gain_margin.and_then(phase).map(PhaseCrossing::at),
            poles: matched(&before.poles, self.closed.clone()),
        }
    }
}

/// Root of a function near a frequency where it is nearly 0, by the secant method.
fn root_near(from: f64, function: impl Fn(f64) -> f64) -> Option<f64> {
    const FIRST: f64 = 1e-4;
    const CLOSE: f64 = 1e-13;
    let mut last = (from * (1.0 + FIRST), function(from * (1.0 + FIRST)));
    let mut own = (from, function(from));
    for _ in 0..20 {
        let slope = (own.1 - last.1) / (own.0 - last.0);
        if own.1 == 0.0 || !slope.is_normal() {
            break;
        }
        let next = own.0 - own.1 / slope;
        last = own;
        own = (next, function(next));
        if (own.0 - last.0).abs() <= CLOSE * own.0.abs() {
            break;
        }
    }
    let is_root = own.1.abs() < 1e-9 && own.0 > 0.0;
    is_root.then_some(own.0)
}

/// The poles, each in the place of the pole `before` to which it is nearest.
fn matched(before: &[Complex<f64>], mut poles: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    let mut found = Vec::new();
    for old in before {
        let distance = |k: usize| (poles[k] - old).norm();
        let nearest = (0..poles.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        found.extend(nearest.map(|k| poles.swap_remove(k)));
    }
    found
}

/// A named figure of a loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Its name: `crossover_frequency`, `phase_margin`, `effective_delay`, `gain_margin`, `pole1_re`, `pole1_im`.
    pub name: String,
    /// Name of the unit.
    pub unit: &'static str,
    /// Value in that unit.
    pub value: f64,
}

impl Figure {
    /// True if a figure of a loop has this name; with several loops, `(the loop)` is appended except for poles.
    pub fn is_name(name: &str) -> bool {
        let own = name.split_once('(').map_or(name, |(own, _)| own);
        [
            "crossover_frequency",
            "phase_margin",
            "effective_delay",
            "gain_margin",
        ]
        .contains(&own)
            || is_of_pole(name)
    }

    /// True if this is the real or imaginary part of a pole.
    pub fn is_of_pole(&self) -> bool {
        is_of_pole(&self.name)
    }

    /// The value of the figure with the same name in `others`; NaN if there is none.
    pub fn value_in(&self, others: &[Self]) -> f64 {
        let own = others.iter().find(|other| other.name == self.name);
        own.map_or(f64::NAN, |own| own.value)
    }
}

fn is_of_pole(name: &str) -> bool {
    let rest = name.strip_prefix("pole").unwrap_or_default();
    let number = ["_re", "_im"]
        .into_iter()
        .find_map(|part| rest.strip_suffix(part));
    number.is_some_and(|number| number.parse::<u32>().is_ok())
}

impl LoopFigures {
    /// The figures with their names: crossover frequency [rad/s], phase margin \[deg\], effective delay \[s\] (of
    /// McRuer's crossover model, see [`GainCrossing::effective_delay`]), gain margin \[dB\], and the poles [1/s]; for a
    /// conjugate pair, the one with the positive imaginary part.
    pub fn named(&self) -> Vec<Figure> {
        let figure = |name: &str, unit, value| Figure {
            name: name.to_owned(),
            unit,
            value,
        };
        let mut all = Vec::new();
        if let Some(own) = self.crossover {
            all.extend([
                figure("crossover_frequency", "rad/s", own.frequency),
                figure("phase_margin", "deg", own.phase_margin.to_degrees()),
                figure("effective_delay", "s", own.effective_delay),
            ]);
        }
        if let Some(own) = self.gain_margin {
            let decibels = 20.0 * own.gain_margin.log10();
            all.push(figure("gain_margin", "dB", decibels));
        }
        let upper = self.poles.iter().filter(|pole| pole.im >= 0.0);
        for (k, pole) in upper.enumerate() {
            all.push(figure(&format!("pole{}_re", k + 1), "1/s", pole.re));
            if pole.im > 0.0 {
                all.push(figure(&format!("pole{}_im", k + 1), "1/s", pole.im));
            }
        }
        all
    }
}
