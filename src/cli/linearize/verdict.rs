//! The stability of a linear system.

use crate::linear::Mode;
use pilotage_text::number::significant;

/// Real parts below this magnitude \[1/s\] (a factor e in twelve days) count as zero, or below this part of the fastest
/// mode of a slow system, but not below the second one (a factor e in 300 years), if all modes are integrators: rounding
/// moves the poles of integrators by less.
const BORDER: f64 = 1e-6;
const LEAST: f64 = 1e-10;

/// Location of the poles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// All in the left half-plane, or none at all.
    Stable,
    /// Some on the imaginary axis, none to the right of it.
    Border,
    /// Some in the right half-plane.
    Unstable,
}

impl Verdict {
    /// The verdict for a system with these modes.
    pub fn of(modes: &[Mode]) -> Self {
        match rightmost(modes) {
            None => Self::Stable,
            Some(re) if re < -border(modes) => Self::Stable,
            Some(re) if re <= border(modes) => Self::Border,
            Some(_) => Self::Unstable,
        }
    }

    /// One word for scripts and titles.
    pub fn word(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Border => "border",
            Self::Unstable => "unstable",
        }
    }

    /// CSS class on a page.
    pub fn class(self) -> &'static str {
        match self {
            Self::Stable => "good",
            Self::Border => "doubtful",
            Self::Unstable => "bad",
        }
    }

    /// One line for people.
    pub fn words(self, modes: &[Mode], in_steps: &str) -> String {
        let Some(re) = rightmost(modes) else {
            return format!("STABLE{in_steps}: the system has no states, and so no poles");
        };
        let time = significant(1.0 / re.abs(), 3);
        match self {
            Self::Stable => format!(
                "STABLE{in_steps}: every pole is left of the imaginary axis; the slowest fades with a time \
                 constant of {time} s"
            ),
            Self::Border => format!(
                "ON THE BORDER{in_steps}: {} on the imaginary axis, as of integrators, and none right of it: \
                 what is in there never fades",
                poles(modes, |re| re.abs() <= border(modes))
            ),
            Self::Unstable if re.is_infinite() => {
                format!("UNSTABLE{in_steps}: the poles cannot be found; margins mean little then")
            }
            Self::Unstable => format!(
                "UNSTABLE{in_steps}: {} right of the imaginary axis, the fastest grows by a factor e in {time} s; \
                 margins mean little then",
                poles(modes, |re| re > border(modes))
            ),
        }
    }
}

fn border(modes: &[Mode]) -> f64 {
    let fastest = modes.iter().map(|mode| mode.frequency).fold(0.0, f64::max);
    (BORDER * fastest.min(1.0)).max(LEAST)
}

fn rightmost(modes: &[Mode]) -> Option<f64> {
    modes.iter().map(|mode| mode.pole.re).reduce(f64::max)
}

/// The number of poles whose real part satisfies `is_such`, in words; a pair counts as two.
fn poles(modes: &[Mode], is_such: impl Fn(f64) -> bool) -> String {
    let such = modes.iter().filter(|mode| is_such(mode.pole.re));
    let count: usize = such.map(|mode| 1 + usize::from(mode.pole.im > 0.0)).sum();
    match count {
        1 => "1 pole is".to_owned(),
        n => format!("{n} poles are"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    #[test]
    fn verdicts_and_their_words() {
        let verdict = |poles: &[(f64, f64)]| {
            let poles: Vec<_> = poles.iter().map(|&(re, im)| Complex::new(re, im)).collect();
            let modes = Mode::of_poles(&poles);
            Verdict::of(&modes).words(&modes, "")
        };
        for (poles, words) in [
            (vec![], "STABLE: the system has no states"),
            (
                vec![(-0.5, 0.0), (-2.0, 0.0)],
                "STABLE: every pole is left of the imaginary axis; the slowest fades with a time constant of 2.00 s",
            ),
            (
                vec![(0.0, 0.0), (1e-9, 0.0), (-1.0, 0.0)],
                "ON THE BORDER: 2 poles are on",
            ),
            (
                vec![(-1.3e-7, 0.0), (-2e-5, 0.0)],
                "STABLE: every pole is left of the imaginary axis; the slowest fades with a time constant of 7.69e6 s",
            ),
            (vec![(0.0, 0.0)], "ON THE BORDER: 1 pole is on"),
            (vec![(7e-14, 0.0)], "ON THE BORDER: 1 pole is on"),
            (
                vec![(0.25, 1.0), (0.25, -1.0), (-1.0, 0.0)],
                "UNSTABLE: 2 poles are right of the imaginary axis, the fastest grows by a factor e in 4.00 s",
            ),
            (
                vec![(f64::INFINITY, 0.0)],
                "UNSTABLE: the poles cannot be found",
            ),
        ] {
            let found = verdict(&poles);
            assert!(found.starts_with(words), "{found}");
        }
    }
}
