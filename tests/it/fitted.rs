//! Fits of flights as the command makes them, without its files.

use pilotage::estimation::result::recordings::before;
use pilotage::estimation::{Diagnostic, Fit, Posed, fit};
use pilotage::flights::checks::doubts;
use pilotage::flights::{FlightOptions, Trial, TrialSet, open};
use std::ops::ControlFlow;

/// The default options with a change.
pub fn with(change: impl FnOnce(&mut FlightOptions)) -> FlightOptions {
    let mut options = FlightOptions::default();
    change(&mut options);
    options
}

/// These flights and no others.
pub fn set(trials: &[Trial]) -> TrialSet {
    TrialSet {
        fit: trials.to_vec(),
        validation: Vec::new(),
        notes: Vec::new(),
        files: Vec::new(),
    }
}

/// The fit of these flights, with all that speaks against it.
pub fn fitted(trials: &[Trial], options: &FlightOptions) -> Fit {
    let file = options
        .problem(&set(trials))
        .expect("flights with positions");
    let posed = Posed::new(&file, &open).expect("a problem");
    let mut found = fit(&posed, &mut |_| ControlFlow::Continue(()));
    let doubts = doubts(&found, &set(trials), options);
    found.diagnostics.extend(doubts);
    found.diagnostics.sort_by_key(|own| !own.is_fatal());
    found
}

/// What these flights give to doubt before any fit.
pub fn recorded(trials: &[Trial]) -> Vec<Diagnostic> {
    let file = FlightOptions::default().problem(&set(trials));
    let file = file.expect("flights with positions");
    before(&Posed::new(&file, &open).expect("a problem"))
}

/// θ of the fitted pilot.
pub fn theta(fit: &Fit) -> Vec<f64> {
    let all = (1..).map_while(|k| fit.value(&format!("pilot.theta{k}")));
    all.collect()
}

/// Those of its diagnostics.
pub fn codes(fit: &Fit) -> Vec<&'static str> {
    fit.diagnostics.iter().map(|own| own.code()).collect()
}
