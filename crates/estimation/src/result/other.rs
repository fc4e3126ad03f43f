//! Another optimum that fits as well as the one found.

use crate::result::{Fit, Found};
use pilotage_inference::Class;
use pilotage_text::number::short;
use std::fmt;

/// Relative difference of a value that is told.
const DIFFERS: f64 = 0.01;

/// Other parameters with an objective of which the data do not tell which is better.
#[derive(Debug, Clone, PartialEq)]
pub struct Other {
    /// Its objective.
    pub objective: f64,
    /// The parameters that differ: name, value there, value here.
    pub values: Vec<(String, f64, f64)>,
    /// Number of such optima, of which this is the first.
    pub count: usize,
}

impl Other {
    /// The first one of a fit, with the parameters that are others there and that the data determine here.
    pub(crate) fn of(fit: &Fit) -> Option<Self> {
        let first = &fit.starts[*fit.others.first()?];
        let known = fit.uncertainty.as_ref().ok();
        let is_flat = |k: usize| {
            known.is_some_and(|own| own.intervals[k].iter().any(|own| own.class == Class::Flat))
        };
        let here = fit
            .parameters
            .iter()
            .enumerate()
            .filter(|(k, _)| !is_flat(*k));
        let here: Vec<(String, f64)> = here.flat_map(|(_, own): (_, &Found)| own.named()).collect();
        let beside = |(name, there): &(String, f64)| {
            let (_, here) = here.iter().find(|(own, _)| own == name)?;
            Some((name.clone(), *there, *here))
        };
        let values = first.parameters.iter().filter_map(beside);
        let differ =
            |(_, there, here): &(String, f64, f64)| (there - here).abs() > DIFFERS * here.abs();
        Some(Self {
            objective: first.objective,
            values: values.filter(differ).collect(),
            count: fit.others.len(),
        })
    }
}

impl fmt::Display for Other {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pairs = self.values.iter().map(|(name, there, here)| {
            format!("`{name}` {} (here {})", short(*there, 4), short(*here, 4))
        });
        let pairs: Vec<String> = pairs.collect();
        let more = match self.count {
            1 => String::new(),
            count => format!(", and there are {} more", count - 1),
        };
        write!(
            f,
            "another optimum fits as well (objective {:.6e}): {}{more}; intervals are those of the one found alone: give an order or a \
             range that excludes the others ([[constraint]] with at = \"parameters\", `max`), a prior, or fix one",
            self.objective,
            pairs.join(", ")
        )
    }
}
