//! Whether a person changes within the runs: a change of a shared parameter along them.

use crate::posed::{Posed, Stands};
use crate::result::Fit;
use pilotage_inference::Inference;
use pilotage_inference::change::{Course, LEVEL};
use pilotage_text::number::short;
use std::fmt;

/// Change of a parameter, relative to its value, that matters.
const MATTERS: f64 = 0.2;

/// A parameter that is not constant along the runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Changed {
    /// The parameter that explains most of the change.
    pub name: String,
    /// About its value before and afterwards, or at the beginning and the end.
    pub values: [f64; 2],
    /// The run in which it changes; none if in all at the same time after their beginning.
    pub run: Option<String>,
    /// Time of the change, in the unit of the first such run's times, with that unit; none for a drift along the whole run.
    pub time: Option<(f64, String)>,
    /// Where runs change at times of their own: each of them with its time, as above.
    pub each: Vec<(String, String)>,
    /// Probability of such a change or a larger one, if all parameters are constant.
    pub p: f64,
}

/// A significant change of a parameter along the runs.
pub(crate) fn changed(
    posed: &Posed<'_>,
    fit: &Fit,
    theta: &[f64],
    inference: &Inference<'_>,
) -> Option<Changed> {
    if fit.chi2 <= fit.resolution {
        return None;
    }
    let found = inference.change().filter(|own| own.p < LEVEL)?;
    let holds = |stands: &Stands| match stands {
        Stands::Shared(k) => *k == found.parameter,
        Stands::Subjects(all) => all.iter().any(|(_, k)| *k == found.parameter),
        Stands::State(_) => false,
    };
    let (unknown, _) = posed.unknowns.iter().find(|(_, stands)| holds(stands))?;
    let at = theta[found.parameter];
    let values = found.values.map(|by| unknown.kept(unknown.found(at + by)));
    let size = values[0].abs().max(values[1].abs());
    let time = |(j, course): (usize, Course)| match course {
        Course::Drift => None,
        Course::Step(after) => {
            let first = posed.runs[j].time[0] + posed.origins[j];
            let shown = posed.data[j].shown(first + after);
            let (number, unit) = shown.split_once(' ')?;
            Some((number.parse().ok()?, unit.to_owned()))
        }
    };
    let each = found.each.iter().map(|own| {
        let time = time(*own).map(|(time, unit)| format!("{} {unit}", short(time, 3)));
        (
            posed.data[own.0].name(),
            time.unwrap_or_else(|| "all along".to_owned()),
        )
    });
    ((values[1] - values[0]).abs() > MATTERS * size).then(|| Changed {
        name: unknown.name.clone(),
        values,
        run: found.run.map(|j| posed.data[j].name()),
        time: time((found.run.unwrap_or(0), found.course)),
        each: each.collect(),
        p: found.p,
    })
}

impl fmt::Display for Changed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &self.name;
        let [before, after] = self.values.map(|own| short(own, 2));
        let (place, each) = match &self.run {
            Some(run) if self.each.is_empty() => (format!("in {run}"), "this"),
            _ => ("in the runs".to_owned(), "each"),
        };
        let p = match self.p < 1e-6 {
            true => "p < 1e-6".to_owned(),
            false => format!("p = {:.1e}", self.p),
        };
        write!(f, "`{name}` is not constant {place} ({p}): ")?;
        let times = self.each.iter().map(|(run, time)| format!("{run} {time}"));
        let times: Vec<String> = times.collect();
        let at = match &self.time {
            Some((time, _)) => short(*time, 3),
            None => "...".to_owned(),
        };
        match (&self.time, times.is_empty()) {
            (_, false) => write!(
                f,
                "it goes from about {before} to {after}, at times of their own ({})",
                times.join(", ")
            )?,
            (Some((_, unit)), true) => {
                write!(
                    f,
                    "about {before} before {at} {unit} and {after} afterwards"
                )?;
            }
            (None, true) => {
                return write!(
                    f,
                    "it drifts from about {before} to {after}, and the estimate is between them; let it vary: in [parameters], \
                     seek two parameters of the problem, say a and slope (per second), and tie it to them and the time by \"{name}\" = \
                     {{ value = \"a + slope * time\" }}, or fit the parts by themselves"
                );
            }
        }
        write!(
            f,
            ", and the estimate is between them; let it change: fix it in [parameters], seek two parameters of the problem there, say \
             a and b, and write set = {{ \"{name}\" = \"a\" }} in {each} [[run]], below it [[run.change]] with time = {at} and \
             set = {{ \"{name}\" = \"b\" }}"
        )
    }
}
