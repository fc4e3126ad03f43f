//! Instances without unknowns whose inputs and outputs are recorded: before any fit, the recorded inputs go through their
//! equations and the response is compared with what was recorded of it. A sign, a unit, a gain, a delay or dynamics that the model
//! has not show there, whatever the rest of the loop makes up for.
//!
//! | module | contents |
//! | --- | --- |
//! | `part` | the instance as a problem of its own |
//! | `windows` | pieces of the runs, simulated from initial states that fit best |
//! | `judged` | factor and delay of the response, and what they leave |

mod judged;
mod part;
mod windows;

use crate::posed::Posed;
use judged::{Response, judged};
use part::Alone;
use pilotage_text::number::short;
use std::fmt::{Display, Formatter};

/// Deviation of a factor from 1 that is told.
const FACTOR: f64 = 0.15;
/// Part of the variance of the response that a factor or a delay must be about, and part that may be left without a doubt.
const SEEN: f64 = 0.01;
const LEFT: f64 = 0.5;
/// Part of the variance that is explained where nothing else moves the instance.
const ALL: f64 = 0.9;
/// Factor and delay leave at most this part of the squares, ...
const BETTER: f64 = 0.5;
/// ... and a delay is more than this number of samples: half a one is a matter of how they are held.
const SAMPLES: f64 = 1.5;

/// An instance that does not answer its recorded inputs as recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradicting {
    /// Its name.
    pub instance: String,
    /// The column that drives it.
    pub input: String,
    /// The measured columns of its response.
    pub measured: Vec<String>,
    /// How many times as far as the model it moves, if that is part of it.
    pub factor: Option<f64>,
    /// Time by which it is later than the model \[s\], if that is part of it.
    pub later: Option<f64>,
    /// Part of the variance of the response to the input that the model explains, and that it explains with the best factor and
    /// delay; 0 at least.
    pub explained: [f64; 2],
}

/// All such instances of a problem.
pub fn contradicting(posed: &Posed<'_>) -> Vec<Contradicting> {
    let parts = posed.joint.parts.iter();
    parts.flat_map(|part| of_part(posed, part)).collect()
}

fn of_part(
    posed: &Posed<'_>,
    (instance, part): &(String, crate::system::part::Part),
) -> Option<Contradicting> {
    let alone = Alone::of(posed, instance, part)?;
    let own = Posed::new(&alone.file, &|_| Ok(part.clone())).ok()?;
    let response = judged(&own, alone.columns.len())?;
    let input = response.worst();
    let Response { explained, .. } = response;
    let left = 1.0 - explained[0];
    let is_better = response.ratio < BETTER && left > SEEN;
    let later = Some(response.later).filter(|own| own.abs() > SAMPLES * response.step);
    let factor = Some(response.factors[input]).filter(|own| (own - 1.0).abs() > FACTOR);
    let is_told = is_better && (later.is_some() || factor.is_some());
    let is_other = left > LEFT;
    let column = |own: &crate::problem::file::Measured| own.column.value.clone();
    (is_told || is_other).then(|| Contradicting {
        instance: instance.clone(),
        input: alone.columns[input].clone(),
        measured: alone.file.measured.iter().map(column).collect(),
        factor: factor.filter(|_| is_told),
        later: later.filter(|_| is_told),
        explained,
    })
}

impl Contradicting {
    /// Whether so much is left that a disturbance may be the reason, of anything but a sign.
    fn is_moved_otherwise(&self) -> bool {
        self.explained[1] < ALL && self.factor.is_none_or(|own| own > 0.0)
    }
}

impl Display for Contradicting {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self {
            instance, input, ..
        } = self;
        let measured = self.measured.join(", ");
        let percent = |part: f64| 100.0 * part.max(0.0);
        write!(
            f,
            "the recorded {input}, put through `{instance}` alone, explains {:.0} % of how {measured} answers it",
            percent(self.explained[0])
        )?;
        let mut ways = Vec::new();
        ways.extend(self.factor.map(|own| match own < 0.0 {
            true => format!("moves {} times as far, the other way", short(-own, 3)),
            false => format!("moves {} times as far", short(own, 3)),
        }));
        ways.extend(self.later.map(|own| match own < 0.0 {
            true => format!("is {} s earlier", short(-own, 2)),
            false => format!("is {} s later", short(own, 2)),
        }));
        if !ways.is_empty() {
            write!(
                f,
                "; what was recorded {}, with which it explains {:.0} %",
                ways.join(" and "),
                percent(self.explained[1])
            )?;
        }
        let what = match (self.factor, self.later) {
            (None, None) => "the dynamics of the model are others than those of the recording",
            (Some(factor), None) if factor < 0.0 => {
                "the sign of the column or of the model is wrong"
            }
            (Some(_), None) => "a unit of the columns or a gain of the model is wrong",
            (None, _) => "the model lacks a delay or a lag, or the columns have different clocks",
            (Some(_), Some(_)) => "the model has another gain, and another lag or delay",
        };
        write!(
            f,
            ": {what}{}; the sought parameters make up for it: mend the model or the column",
            match self.is_moved_otherwise() {
                true => ", or something that is not recorded moves it too",
                false => "",
            }
        )
    }
}
