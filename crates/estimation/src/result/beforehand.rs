//! What a problem can tell, before it is solved: what its runs excite, and which parameters nothing that is measured depends
//! on where the search begins.

use crate::posed::{Posed, Stands};
use crate::problem::file::Deviation;
use crate::result::Fit;
use crate::result::describing::excitation;
use crate::result::diagnostic::Diagnostic;
use crate::result::uncertainty::{linearised, names, words};
use crate::search::begin::begin;
use crate::search::starts::{Start, starts};
use pilotage_collocation::Stop;
use pilotage_inference::spectrum::{Excitation, Starved};
use pilotage_inference::{Data, Direction, Inference};
use pilotage_sqp::Iterate;
use pilotage_text::counted;

/// Starts at which the problem is linearised.
const STARTS: usize = 3;
/// A parameter whose standard deviation is so many times its size is hardly told.
const WEAK: f64 = 10.0;

/// What a problem can tell.
#[derive(Debug, Clone)]
pub struct Beforehand {
    /// What the runs excite; none where instances do not close one loop of a pilot and a vehicle.
    pub excitation: Option<Excitation>,
    /// What is more than that tells.
    pub starved: Option<Starved>,
    /// What is measured, by the parameters; none where that is not known, of FMUs, which calls may end, and
    /// where noise drives the system.
    pub identifiability: Option<Identifiability>,
}

/// Local identifiability where the search begins: the sensitivity of what is measured to the parameters, at several starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Identifiability {
    /// At how many starts.
    pub starts: usize,
    /// Singular values of the sensitivities at the given start, each parameter's of length 1, the largest first.
    pub singular_values: Vec<f64>,
    /// For each shared parameter, as the search sees it, the least standard deviation over the starts with noise as large as
    /// `sd` says; infinite where it cannot be told.
    pub deviations: Vec<(String, f64)>,
    /// Directions that nothing measured changes along at the given start, in words, whose parameters take part in such a
    /// direction at all others.
    pub flat: Vec<String>,
    /// Parameters whose standard deviation is ten times their size and more, likewise; none where a `sd` is missing.
    pub weak: Vec<String>,
}

/// What a problem can tell, by one linearisation at each of a few starts.
pub fn beforehand(posed: &Posed<'_>, stop: &Stop<'_>) -> Beforehand {
    let excitation = excitation(posed);
    let is_shared = |stands: &Stands| !matches!(stands, Stands::State(_));
    let asked = posed
        .unknowns
        .iter()
        .filter(|(_, stands)| is_shared(stands))
        .count();
    let signals = posed.file.measured.len();
    let has_fmu = posed.joint.parts.iter().any(|(_, part)| part.fmu.is_some());
    Beforehand {
        starved: excitation
            .as_ref()
            .and_then(|own| own.starved(asked, signals)),
        // Noise that drives the system moves nothing that is simulated.
        identifiability: match has_fmu || posed.filter.is_some() {
            true => None,
            false => identifiability(posed, stop),
        },
        excitation,
    }
}

impl Beforehand {
    /// What speaks against a fit: more is sought than lines tell; what nothing depends on before the solve is open after it,
    /// and the fit does not say so by itself.
    pub fn doubts(&self, fit: &Fit) -> Vec<Diagnostic> {
        let is_flat = fit
            .diagnostics
            .iter()
            .any(|own| matches!(own, Diagnostic::Flat(_)));
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
        starved
            .chain(flat.map(Diagnostic::Unidentifiable))
            .collect()
    }

    /// What speaks against a fit, before the solve.
    pub fn words(&self) -> Vec<String> {
        let mut all: Vec<String> = self.starved.iter().map(ToString::to_string).collect();
        if let Some(own) = &self.identifiability {
            let at = counted(own.starts, "start");
            let both = own.flat.iter().chain(&own.weak);
            all.extend(both.map(|words| format!("at {at} of the search, {words}")));
        }
        all
    }
}

/// None where no start has finite derivatives.
fn identifiability(posed: &Posed<'_>, stop: &Stop<'_>) -> Option<Identifiability> {
    if posed.shared == 0 {
        return None;
    }
    let count = posed.file.options.starts.min(STARTS);
    let all = starts(posed, count).into_iter();
    let known: Vec<Data> = all
        .filter_map(|start| at_start(posed, &start, stop))
        .collect();
    let names = names(posed);
    let each: Vec<Inference<'_>> = known
        .iter()
        .filter_map(|own| Inference::new(own).ok())
        .collect();
    let first = each.first()?;
    let least = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).map(|(a, b)| a.min(*b)).collect();
    let deviations: Vec<f64> = each.iter().map(deviations).reduce(least)?;
    let is_open = |k: usize| each.iter().all(|own| own.flat[k]);
    let is_flat = |own: &&Direction| {
        let mut parts = own.0.iter().enumerate().filter(|(_, part)| **part != 0.0);
        parts.all(|(k, _)| is_open(k))
    };
    let flat = first.directions.iter().filter(is_flat);
    Some(Identifiability {
        starts: each.len(),
        singular_values: first.singular_values.clone(),
        flat: flat.map(|own| words::direction(own, &names)).collect(),
        weak: weak(posed, &names, &deviations, first.data),
        deviations: names.into_iter().zip(deviations).collect(),
    })
}

/// The problem, linearised at a start. None where that is not finite.
fn at_start(posed: &Posed<'_>, start: &Start, stop: &Stop<'_>) -> Option<Data> {
    let (problem, z) = begin(posed, start, stop);
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

/// Parameters that are hardly told at any start, in words.
fn weak(posed: &Posed<'_>, names: &[String], deviations: &[f64], data: &Data) -> Vec<String> {
    // One that is missing is 1.
    let is_missing =
        |sd: &Deviation| matches!(sd, Deviation::Formula(own) if own.number() == Some(1.0));
    if posed.file.measured.iter().any(|own| is_missing(&own.sd)) {
        return Vec::new();
    }
    let told = (names.iter().zip(deviations)).zip(data.scales.iter());
    let is_weak =
        |((_, sd), size): &((&String, &f64), &f64)| sd.is_finite() && **sd > WEAK * **size;
    let words = |((name, sd), size): ((&String, &f64), &f64)| {
        format!(
            "`{name}` is hardly told: with noise as large as `sd` says its standard deviation is {sd:.1e}, and its size {size:.1e}"
        )
    };
    told.filter(is_weak).map(words).collect()
}
