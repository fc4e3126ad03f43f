//! The interface types (FMI 2.0, sections 3.3.1 and 4.3.1; FMI 3.0, sections 2.4.2, 4.4 and 5.4).

use super::*;

impl Checker<'_> {
    pub(super) fn interfaces(&mut self) {
        let description = self.description;
        if let Some(me) = &description.model_exchange {
            let place = self.places.model_exchange;
            self.interface(place, &me.model_identifier, &me.flags(self.version));
            self.sources(place, &me.source_files);
        }
        if let Some(cs) = &description.co_simulation {
            let place = self.places.co_simulation;
            self.interface(place, &cs.model_identifier, &cs.flags(self.version));
            self.sources(place, &cs.source_files);
            self.co_simulation(place, cs);
        }
        if let Some(se) = &description.scheduled_execution {
            let place = self.places.scheduled_execution;
            self.interface(place, &se.model_identifier, &se.flags(self.version));
        }
        let has_interface = description.model_exchange.is_some()
            || description.co_simulation.is_some()
            || description.scheduled_execution.is_some();
        if !has_interface {
            let expected = match self.version {
                FmiVersion::V2 => "<ModelExchange> and <CoSimulation>",
                FmiVersion::V3 => "<ModelExchange>, <CoSimulation> and <ScheduledExecution>",
            };
            self.report(self.places.root, Rule::NoInterface { expected });
        }
    }

    fn interface(&mut self, place: Place, identifier: &str, flags: &[(&'static str, bool)]) {
        let is_set = |name| flags.contains(&(name, true));
        let is_missing = self.is_missing(place, "modelIdentifier");
        if !is_missing && !names::is_c_identifier(identifier) {
            let found = identifier.to_owned();
            self.report(place, Rule::NotAnIdentifier { found });
        }
        if is_set("needsExecutionTool") {
            self.report(place, Rule::NeedsExecutionTool);
        }
        for (flag, needed) in [
            ("canSerializeFMUstate", "canGetAndSetFMUstate"),
            ("canSerializeFMUState", "canGetAndSetFMUState"),
            (
                "canReturnEarlyAfterIntermediateUpdate",
                "providesIntermediateUpdate",
            ),
        ] {
            if is_set(flag) && !is_set(needed) {
                self.report(place, Rule::FlagNeedsFlag { flag, needed });
            }
        }
    }

    fn co_simulation(&mut self, place: Place, cs: &CoSimulation) {
        if let Some(found) = cs.fixed_internal_step_size {
            let attribute = "fixedInternalStepSize";
            if found <= 0.0 || found.is_nan() {
                let found = found.to_string();
                self.report(place, Rule::NotPositive { attribute, found });
            } else if found.is_infinite() {
                self.report(place, Rule::NotFinite { attribute, found });
            }
        }
        let mut variables = self.description.variables.iter();
        let clock = variables.find(|v| v.kind.base_type() == BaseType::Clock);
        if let Some(clock) = clock.filter(|_| !cs.has_event_mode) {
            let clock = clock.name.clone();
            self.report(place, Rule::ClocksWithoutEventMode { clock });
        }
    }

    fn sources(&mut self, place: Place, files: &[String]) {
        for index in duplicates(files.iter().map(String::as_str)) {
            let name = files[index].clone();
            self.report(place, Rule::DuplicateSource { name });
        }
        let is_outside = |name: &&String| {
            name.is_empty()
                || name.starts_with('/')
                || name.contains(['\\', ':'])
                || name.split('/').any(|part| part == "..")
        };
        for name in files.iter().filter(is_outside).cloned() {
            self.report(place, Rule::SourceOutside { name });
        }
    }
}
