//! Why a fit may say less than it seems to: something is odd about the flights or the vehicle, other starts
//! ended elsewhere, or the data cannot tell some of the pilot's parameters.

mod diagnostic;
mod flights;
mod flown;
mod samples;
mod solution;

pub use diagnostic::Diagnostic;

use super::{Fit, FitOptions, Trial, frequency};
use pilotage_inference::spectrum::Excitation;

/// What speaks against taking `fit` at its word, the gravest first.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let mut diagnostics = flights::diagnostics(fit, options, trials);
    diagnostics.extend(samples::diagnostics(fit, options, trials));
    diagnostics.extend(flown::diagnostics(fit, options, trials));
    diagnostics.extend(solution::diagnostics(fit, options));
    diagnostics.extend(contradicted(fit, options, trials));
    diagnostics.extend(starved(fit, trials));
    if diagnostics.contains(&Diagnostic::ConstantData) {
        // What a pilot of nothing is like, nobody needs to know.
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

/// Where what was fitted is not what the flights say of pilot and loop without a model.
fn contradicted(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    let describing = frequency::describing(fit, trials, options);
    let found = describing.contradicted().filter(|_| fit.converged)?;
    Some(Diagnostic::Contradicted(found))
}

/// Where sines tell fewer numbers than θ has.
fn starved(fit: &Fit, trials: &[Trial]) -> Option<Diagnostic> {
    let excitation = Excitation::of(&frequency::flights(trials))?;
    let found = excitation.starved(fit.theta.len(), 1)?;
    Some(Diagnostic::Starved(found))
}
