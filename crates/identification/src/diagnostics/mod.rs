//! Diagnostics: why a fit may be less reliable than it seems. The flights or the vehicle may be implausible, other
//! starts may end elsewhere, or the data may not determine some of the pilot's parameters.

mod diagnostic;
mod flights;
mod flown;
mod samples;
mod solution;

pub use diagnostic::Diagnostic;

use super::{Fit, FitOptions, Trial, frequency};
use pilotage_flights::Check;
use pilotage_flights::trials::driven;
use pilotage_inference::spectrum::Excitation;

/// Diagnostics of a fit, the most severe first.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let mut diagnostics = flights::diagnostics(fit, options, trials);
    diagnostics.extend(samples::diagnostics(fit, options, trials));
    diagnostics.extend(flown::diagnostics(fit, options, trials));
    diagnostics.extend(solution::diagnostics(fit, options));
    diagnostics.extend(contradicted(fit, options, trials));
    diagnostics.extend(starved(fit, trials));
    // Where nothing moves, neither samples nor the properties of a pilot are of interest.
    if diagnostics.contains(&Check::ConstantData.into()) {
        diagnostics.retain(Diagnostic::is_fatal);
    }
    let rank = |diagnostic: &Diagnostic| {
        (
            !matches!(diagnostic, Diagnostic::UnstableLoop { .. }),
            !diagnostic.is_fatal(),
        )
    };
    diagnostics.sort_by_key(rank);
    diagnostics
}

/// Whether the fit contradicts the describing functions of the flights.
fn contradicted(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    let describing = frequency::describing(fit, trials, options);
    let found = describing.contradicted().filter(|_| fit.converged)?;
    Some(Diagnostic::Contradicted(found))
}

/// Whether the target's sines determine fewer parameters than θ has.
fn starved(fit: &Fit, trials: &[Trial]) -> Option<Diagnostic> {
    let excitation = Excitation::of(&driven(trials))?;
    let found = excitation.starved(fit.theta.len(), 1)?;
    Some(Diagnostic::Starved(found))
}
