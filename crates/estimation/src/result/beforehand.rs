//! Analysis of a problem before it is solved: what its runs excite, and which parameters do not affect any measured
//! signal where the search begins.

use crate::posed::{Posed, Stands};
use crate::result::Fit;
use crate::result::describing::excitation;
use crate::result::diagnostic::Diagnostic;
use crate::result::recordings::hopeless;
use crate::result::through::{Contradicting, contradicting};
use crate::result::uncertainty::{linearised, names, words};
use crate::search::begin::begin_whole;
use crate::search::starts::{Start, starts};
use pilotage_collocation::{Stop, reduced};
use pilotage_inference::spectrum::{Excitation, Starved};
use pilotage_inference::{Data, Direction, Inference};
use pilotage_sqp::Iterate;
use pilotage_text::counted;
use pilotage_text::number::short;

/// Maximum number of starts at which the problem is linearised.
const STARTS: usize = 3;
/// A parameter is poorly determined if its standard deviation exceeds this multiple of its size.
const WEAK: f64 = 10.0;

/// Analysis of a problem before it is solved.
#[derive(Debug, Clone)]
pub struct Beforehand {
    /// What the runs excite. None if the instances do not form a single loop of a pilot and a vehicle.
    pub excitation: Option<Excitation>,
    /// Present if more is sought than the excitation determines.
    pub starved: Option<Starved>,
    /// Identifiability of the parameters. None if it is unknown, for FMUs, since a call may end them, and if noise
    /// drives the system.
    pub identifiability: Option<Identifiability>,
    /// The inputs of the system, if nothing drives any of them.
    pub undriven: Vec<String>,
    /// Instances that do not answer their recorded inputs as recorded.
    pub contradicting: Vec<Contradicting>,
}

/// Local identifiability where the search begins: the sensitivity of the measured signals to the parameters, at several
/// starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Identifiability {
    /// Number of starts that were looked at: no more than it takes to see all parameters determined.
    pub starts: usize,
    /// Singular values of the sensitivity at the given start, in descending order. Each parameter's column has length
    /// 1.
    pub singular_values: Vec<f64>,
    /// For each shared parameter, in the coordinates of the search, the least standard deviation over the starts with
    /// the noise given by `sd`. Infinite if it is not identifiable.
    pub deviations: Vec<(String, f64)>,
    /// Directions that do not affect any measured signal at the given start, in words. Only those whose parameters are
    /// part of such a direction at all other starts.
    pub flat: Vec<String>,
    /// Parameters whose standard deviation exceeds ten times their size, in words. Empty if an `sd` is missing.
    pub weak: Vec<String>,
}

/// Analyses a problem by one linearisation at each of a few starts.
pub fn beforehand(posed: &Posed<'_>, stop: &Stop<'_>) -> Beforehand {
    let excitation = excitation(posed);
    let is_shared = |stands: &Stands| !matches!(stands, Stands::State(_));
    let asked = posed
        .unknowns
        .iter()
        .filter(|(_, stands)| is_shared(stands))
        .count();
    let signals = posed.file.measured.len();
    // Where no search can lead to an answer, the reason is all there is to say.
    let is_hopeless = !hopeless(posed).is_empty();
    let has_fmu = posed.joint.parts.iter().any(|(_, part)| part.fmu.is_some());
    let identifiability = || match has_fmu || posed.filter.is_some() || is_hopeless {
        // Process noise does not affect a simulation.
        true => None,
        false => identifiability(posed, stop),
    };
    let contradicting = || match is_hopeless {
        true => Vec::new(),
        false => contradicting(posed),
    };
    let (identifiability, contradicting) = rayon::join(identifiability, contradicting);
    Beforehand {
        starved: excitation
            .as_ref()
            .and_then(|own| own.starved(asked, signals))
            .filter(|_| !is_hopeless),
        identifiability,
        undriven: match posed.file.inputs.is_empty()
            && posed.filter.is_none()
            && !sets_inputs(posed)
        {
            true => posed.joint.model.inputs.clone(),
            false => Vec::new(),
        },
        contradicting,
        excitation,
    }
}

impl Beforehand {
    /// Diagnostics of a fit: more is sought than the spectral lines determine, or a parameter that was not identifiable
    /// before the solve is still undetermined after it and the fit does not report this itself.
    pub fn doubts(&self, fit: &Fit) -> Vec<Diagnostic> {
        let is_flat = fit.diagnostics.iter().any(|own| {
            matches!(
                own,
                Diagnostic::Undetermined {
                    curvature: Some(_),
                    ..
                }
            )
        });
        let is_open = match &fit.uncertainty {
            Ok(own) => fit
                .parameters
                .iter()
                .zip(&own.intervals)
                .any(|(_, all)| all.iter().any(|interval| !interval.sd.is_finite())),
            Err(_) => true,
        };
        let flat = self
            .identifiability
            .iter()
            .flat_map(|own| own.flat.iter().cloned());
        let flat = flat.filter(|_| is_open && !is_flat);
        let starved = self.starved.into_iter().map(Diagnostic::Starved);
        let contradicting = self.contradicting.iter().cloned();
        let contradicting = contradicting.map(Diagnostic::Contradicting);
        starved
            .chain(contradicting)
            .chain(flat.map(Diagnostic::Unidentifiable))
            .collect()
    }

    /// Diagnostics before the solve, in words.
    pub fn words(&self) -> Vec<String> {
        let mut all: Vec<String> = self.starved.iter().map(ToString::to_string).collect();
        all.extend(self.contradicting.iter().map(ToString::to_string));
        if let Some(first) = self.undriven.first() {
            let more = match self.undriven.len() {
                1 => "its start value",
                _ => "its start value, as do all other inputs",
            };
            all.push(format!(
                "nothing drives `{first}`, which keeps {more}: [inputs] names the columns that drive inputs"
            ));
        }
        if let Some(own) = &self.identifiability {
            let at = counted(own.starts, "start");
            let both = own.flat.iter().chain(&own.weak);
            all.extend(both.map(|words| format!("at {at} of the search, {words}")));
        }
        all
    }
}

/// Whether a run gives an input a value.
fn sets_inputs(posed: &Posed<'_>) -> bool {
    let mut sets = posed.file.runs.iter().flat_map(|run| run.sets());
    sets.any(|set| posed.joint.model.inputs.contains(&set.name.value))
}

/// None if no start has finite derivatives and states that follow the equations.
fn identifiability(posed: &Posed<'_>, stop: &Stop<'_>) -> Option<Identifiability> {
    if posed.shared == 0 {
        return None;
    }
    let count = posed.file.options.starts().min(STARTS);
    let names = names(posed);
    let mut found: Option<Identifiability> = None;
    let mut directions = Vec::new();
    let mut is_open = vec![true; names.len()];
    for start in starts(posed, count) {
        let Some(data) = at_start(posed, &start, stop) else {
            continue;
        };
        let Ok(own) = Inference::new(&data) else {
            continue;
        };
        let pairs = is_open.iter_mut().zip(&own.flat);
        pairs.for_each(|(open, flat)| *open &= flat);
        let mut least = deviations(&own);
        match &found {
            None => directions = own.directions.clone(),
            Some(before) => {
                let pairs = least.iter_mut().zip(&before.deviations);
                pairs.for_each(|(own, (_, before))| *own = own.min(*before));
            }
        }
        let is_flat = |own: &&Direction| {
            let mut parts = own.0.iter().enumerate().filter(|(_, part)| **part != 0.0);
            parts.all(|(k, _)| is_open[k])
        };
        let flat = directions.iter().filter(is_flat);
        let next = Identifiability {
            starts: found.as_ref().map_or(0, |own| own.starts) + 1,
            flat: flat.map(|own| words::direction(own, &names)).collect(),
            weak: weak(posed, &names, &least, &data),
            deviations: names.iter().cloned().zip(least).collect(),
            singular_values: match found {
                Some(before) => before.singular_values,
                None => own.singular_values.clone(),
            },
        };
        let is_clear = next.flat.is_empty() && next.weak.is_empty();
        found = Some(next);
        if is_clear {
            break;
        }
    }
    found
}

/// The problem, linearised at a start. None if that is not finite, or the states there do not follow the equations.
fn at_start(posed: &Posed<'_>, start: &Start, stop: &Stop<'_>) -> Option<Data> {
    let (whole, z) = begin_whole(posed, start, stop)?;
    // Of long runs means of a few samples say the same.
    let (problem, z) = reduced(&whole, &z).unwrap_or((whole, z));
    let at = Iterate::new(&problem, z);
    Some(linearised(posed, &problem, &at)?.data)
}

/// Standard deviations with unit noise.
fn deviations(inference: &Inference<'_>) -> Vec<f64> {
    let inverse = inference.inverse_information();
    let of = |k: usize| match inference.flat[k] {
        true => f64::INFINITY,
        false => inverse[(k, k)].max(0.0).sqrt(),
    };
    (0..inference.flat.len()).map(of).collect()
}

/// Parameters that are poorly determined at all starts, in words.
fn weak(posed: &Posed<'_>, names: &[String], deviations: &[f64], data: &Data) -> Vec<String> {
    if posed.file.measured.iter().any(|own| own.sd.is_missing()) {
        return Vec::new();
    }
    let candidates = (names.iter().zip(deviations)).zip(data.scales.iter());
    let is_weak =
        |((_, sd), size): &((&String, &f64), &f64)| sd.is_finite() && **sd > WEAK * **size;
    let words = |((name, sd), size): ((&String, &f64), &f64)| {
        format!(
            "`{name}` is poorly determined: with noise as large as `sd` says its standard deviation is {}, and its size {}",
            short(*sd, 2),
            short(*size, 2)
        )
    };
    candidates.filter(is_weak).map(words).collect()
}
