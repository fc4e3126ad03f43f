//! Checks a description against the rules of FMI 2.0 and FMI 3.0 that the schema does not contain.
//!
//! All rules are checked; checking does not stop at the first finding. The time is proportional to the size of the
//! description: names and references are looked up in tables.

mod aliases;
mod arrays;
mod clocks;
mod combination;
mod dates;
mod interfaces;
mod names;
mod start;
mod states;
mod structure;
mod units;
mod unknowns;
mod variables;

pub use dates::is_date_and_time;
pub(crate) use start::shown;

use pilotage_fmi::description::*;
use std::collections::{BTreeSet, HashMap, HashSet};

/// All findings about a description, of schema and rules, in the order of the file.
pub fn validate(reading: &Reading) -> Vec<Finding> {
    let description = &reading.description;
    let mut checker = Checker {
        description,
        version: description.fmi_version,
        places: &reading.places,
        units: first_of_each(description.units.iter().map(|u| (u.name.as_str(), u))),
        types: first_of_each(description.types.iter().map(|t| (t.name.as_str(), &t.kind))),
        states: states::states(description),
        doubtful: doubtful(&reading.findings),
        findings: reading.findings.clone(),
    };
    checker.root();
    checker.interfaces();
    checker.experiment();
    checker.log_categories();
    checker.units();
    checker.types();
    checker.variables();
    checker.states();
    match description.fmi_version {
        FmiVersion::V2 => checker.aliases(),
        FmiVersion::V3 => {
            checker.references();
            checker.arrays();
            checker.clocks();
        }
    }
    checker.structure();
    checker.findings.sort_by_key(|finding| finding.place);
    checker.findings
}

/// Data shared by the checks.
struct Checker<'r> {
    description: &'r ModelDescription,
    version: FmiVersion,
    places: &'r Places,
    units: HashMap<&'r str, &'r Unit>,
    types: HashMap<&'r str, &'r TypeKind>,
    /// Indices (from 1) of the continuous states.
    states: BTreeSet<u32>,
    /// Names of the variables with values that the reader could not parse: consequences of the default in their place
    /// are not reported.
    doubtful: HashSet<&'r str>,
    findings: Vec<Finding>,
}

impl<'r> Checker<'r> {
    fn report(&mut self, place: Place, rule: Rule) {
        self.findings.push(Finding {
            version: self.version,
            place,
            variable: None,
            rule,
        });
    }

    /// Records the violation of a rule at the variable at that position (from 0).
    fn report_variable(&mut self, position: usize, rule: Rule) {
        let place = self.places.variables.get(position);
        self.findings.push(Finding {
            version: self.version,
            place: place.copied().unwrap_or(self.places.root),
            variable: Some(self.description.variables[position].name.clone()),
            rule,
        });
    }

    /// Whether the reader has reported that the element at that place lacks an attribute.
    fn is_missing(&self, at: Place, wanted: &str) -> bool {
        let mut findings = self.findings.iter();
        findings.any(|finding| match &finding.rule {
            Rule::MissingAttribute { attribute, .. } => finding.place == at && *attribute == wanted,
            _ => false,
        })
    }

    /// The variable with that index (from 1).
    fn at(&self, index: u32) -> Option<&'r ScalarVariable> {
        let position = (index as usize).checked_sub(1)?;
        self.description.variables.get(position)
    }

    fn is_v3(&self) -> bool {
        self.version == FmiVersion::V3
    }

    fn root(&mut self) {
        let description = self.description;
        let place = self.places.root;
        let attribute = match self.version {
            FmiVersion::V2 => "guid",
            FmiVersion::V3 => "instantiationToken",
        };
        if description.guid.is_empty() && !self.is_missing(place, attribute) {
            self.report(place, Rule::EmptyGuid { attribute });
        }
        if let Some(date) = &description.generation_date_and_time {
            let found = date.clone();
            match dates::form(date) {
                dates::Form::Standard => {}
                dates::Form::Other => self.report(place, Rule::DateFormat { found }),
                dates::Form::Wrong => self.report(place, Rule::NotADate { found }),
            }
        }
    }

    fn experiment(&mut self) {
        let Some(experiment) = &self.description.default_experiment else {
            return;
        };
        let place = self.places.default_experiment;
        let start = experiment.start_time.unwrap_or(0.0);
        if let Some(stop) = experiment.stop_time {
            let duration = stop - start;
            let step = experiment.step_size.filter(|&step| step > duration);
            if stop < start {
                self.report(place, Rule::StopBeforeStart { start, stop });
            } else if stop == start {
                self.report(place, Rule::StopAtStart { stop });
            } else if let Some(step) = step {
                self.report(place, Rule::StepBeyondStop { step, duration });
            }
        }
        for (attribute, value) in [
            ("startTime", experiment.start_time),
            ("stopTime", experiment.stop_time),
            ("tolerance", experiment.tolerance),
            ("stepSize", experiment.step_size),
        ] {
            let is_size = matches!(attribute, "tolerance" | "stepSize");
            match value {
                Some(found) if is_size && (found <= 0.0 || found.is_nan()) => {
                    let found = found.to_string();
                    self.report(place, Rule::NotPositive { attribute, found });
                }
                Some(found) if !found.is_finite() => {
                    self.report(place, Rule::NotFinite { attribute, found });
                }
                _ => {}
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

fn doubtful(findings: &[Finding]) -> HashSet<&str> {
    let blocking = findings.iter().filter(|f| f.rule.leaves_value_unknown());
    blocking.filter_map(|f| f.variable.as_deref()).collect()
}

/// A table of items by name; the first of several with the same name.
fn first_of_each<'a, T>(items: impl Iterator<Item = (&'a str, T)>) -> HashMap<&'a str, T> {
    let mut table = HashMap::new();
    for (name, item) in items {
        table.entry(name).or_insert(item);
    }
    table
}

/// Indices of the items whose name occurred before.
fn duplicates<'a>(names: impl Iterator<Item = &'a str>) -> Vec<usize> {
    let mut seen = HashMap::new();
    names
        .enumerate()
        .filter(|&(index, name)| *seen.entry(name).or_insert(index) != index)
        .map(|(index, _)| index)
        .collect()
}
