//! Checks a description against the rules of FMI 2.0 that no schema holds.
//!
//! Every rule is checked; nothing stops at the first finding.

mod aliases;
mod names;
mod structure;
mod units;
mod variables;

use super::*;
use std::collections::{BTreeSet, HashMap};

/// Everything that is wrong with a description, schema and rules, in the order of the file.
pub fn validate(reading: &Reading) -> Vec<Finding> {
    let mut checker = Checker {
        description: &reading.description,
        places: &reading.places,
        states: structure::states(&reading.description),
        findings: reading.findings.clone(),
    };
    checker.root();
    checker.interfaces();
    checker.experiment();
    checker.units();
    checker.types();
    checker.log_categories();
    checker.variables();
    checker.aliases();
    checker.structure();
    checker.findings.sort_by_key(|finding| finding.place);
    checker.findings
}

/// What the checks share.
struct Checker<'r> {
    description: &'r ModelDescription,
    places: &'r Places,
    /// Indices (from 1) of the continuous states.
    states: BTreeSet<u32>,
    findings: Vec<Finding>,
}

impl Checker<'_> {
    fn report(&mut self, place: Place, rule: Rule) {
        self.findings.push(Finding {
            version: self.description.fmi_version,
            place,
            variable: None,
            rule,
        });
    }

    /// Notes a broken rule at the variable of that index (from 0).
    fn report_variable(&mut self, index: usize, rule: Rule) {
        let place = self.places.variables.get(index);
        self.findings.push(Finding {
            version: self.description.fmi_version,
            place: place.copied().unwrap_or(self.places.root),
            variable: Some(self.description.variables[index].name.clone()),
            rule,
        });
    }

    fn root(&mut self) {
        let description = self.description;
        let place = self.places.root;
        if description.guid.is_empty() {
            self.report(place, Rule::EmptyGuid);
        }
        if let Some(date) = &description.generation_date_and_time
            && !is_date_time(date)
        {
            let found = date.clone();
            self.report(place, Rule::DateFormat { found });
        }
        if description.model_exchange.is_none() && description.co_simulation.is_none() {
            self.report(place, Rule::NoInterface);
        }
    }

    fn interfaces(&mut self) {
        if let Some(me) = &self.description.model_exchange {
            let place = self.places.model_exchange;
            let flags = me.flags(self.description.fmi_version);
            self.interface(place, &me.model_identifier, &flags);
        }
        if let Some(cs) = &self.description.co_simulation {
            let place = self.places.co_simulation;
            let flags = cs.flags(self.description.fmi_version);
            self.interface(place, &cs.model_identifier, &flags);
        }
    }

    fn interface(&mut self, place: Place, identifier: &str, flags: &[(&str, bool)]) {
        let is_set = |name| flags.contains(&(name, true));
        if !names::is_c_identifier(identifier) {
            let found = identifier.to_owned();
            self.report(place, Rule::NotAnIdentifier { found });
        }
        if is_set("needsExecutionTool") {
            self.report(place, Rule::NeedsExecutionTool);
        }
        if is_set("canSerializeFMUstate") && !is_set("canGetAndSetFMUstate") {
            self.report(place, Rule::SerializeWithoutGet);
        }
    }

    fn experiment(&mut self) {
        let Some(experiment) = &self.description.default_experiment else {
            return;
        };
        let place = self.places.default_experiment;
        let start = experiment.start_time.unwrap_or(0.0);
        if let Some(stop) = experiment.stop_time.filter(|&stop| stop < start) {
            self.report(place, Rule::StopBeforeStart { start, stop });
        }
        for (attribute, value) in [
            ("tolerance", experiment.tolerance),
            ("stepSize", experiment.step_size),
        ] {
            if let Some(found) = value.filter(|&v| v <= 0.0 || v.is_nan()) {
                self.report(place, Rule::NotPositive { attribute, found });
            }
        }
    }

    fn log_categories(&mut self) {
        let categories = &self.description.log_categories;
        for index in duplicates(categories.iter().map(|c| c.name.as_str())) {
            let name = categories[index].name.clone();
            let place = self.places.log_categories[index];
            self.report(place, Rule::DuplicateCategory { name });
        }
    }
}

/// Indices of the items that were there before.
fn duplicates<'a>(names: impl Iterator<Item = &'a str>) -> Vec<usize> {
    let mut seen = HashMap::new();
    names
        .enumerate()
        .filter(|&(index, name)| *seen.entry(name).or_insert(index) != index)
        .map(|(index, _)| index)
        .collect()
}

/// Whether a text is `YYYY-MM-DDThh:mm:ssZ` with fields in range.
fn is_date_time(text: &str) -> bool {
    const SHAPE: &[u8] = b"0000-00-00T00:00:00Z";
    let bytes = text.as_bytes();
    let fits = |(b, shape): (&u8, &u8)| match shape {
        b'0' => b.is_ascii_digit(),
        _ => b == shape,
    };
    if bytes.len() != SHAPE.len() || !bytes.iter().zip(SHAPE).all(fits) {
        return false;
    }
    let field = |from: usize| text[from..from + 2].parse().unwrap_or(0u8);
    (1..=12).contains(&field(5))
        && (1..=31).contains(&field(8))
        && field(11) < 24
        && field(14) < 60
        && field(17) <= 60
}
