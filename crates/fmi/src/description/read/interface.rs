//! Reads the interface types.

use super::element::Element;
use super::*;

pub(super) fn co_simulation(e: &Element) -> CoSimulation {
    let mut value = CoSimulation {
        model_identifier: e.required_text("modelIdentifier"),
        max_output_derivative_order: e.unsigned("maxOutputDerivativeOrder").unwrap_or(0),
        ..CoSimulation::default()
    };
    value.set_flags(e.version(), |name| e.flag(name));
    match e.version() {
        FmiVersion::V2 => value.source_files = source_files(e),
        FmiVersion::V3 => {
            value.fixed_internal_step_size = e.real("fixedInternalStepSize");
            value.recommended_intermediate_input_smoothness =
                e.int("recommendedIntermediateInputSmoothness").unwrap_or(0);
            skip_annotations(e);
        }
    }
    finish(e);
    value
}

pub(super) fn model_exchange(e: &Element) -> ModelExchange {
    let mut value = ModelExchange {
        model_identifier: e.required_text("modelIdentifier"),
        ..ModelExchange::default()
    };
    value.set_flags(e.version(), |name| e.flag(name));
    match e.version() {
        FmiVersion::V2 => value.source_files = source_files(e),
        FmiVersion::V3 => {
            value.completed_integrator_step_not_needed = !e.flag("needsCompletedIntegratorStep");
            skip_annotations(e);
        }
    }
    finish(e);
    value
}

pub(super) fn scheduled_execution(e: &Element) -> ScheduledExecution {
    let mut value = ScheduledExecution {
        model_identifier: e.required_text("modelIdentifier"),
        ..ScheduledExecution::default()
    };
    value.set_flags(e.version(), |name| e.flag(name));
    skip_annotations(e);
    finish(e);
    value
}

/// The schema of FMI 3.0 allows attributes of other standards here.
fn finish(e: &Element) {
    match e.version() {
        FmiVersion::V2 => e.finish(),
        FmiVersion::V3 => e.finish_open(),
    }
}

fn source_files(parent: &Element) -> Vec<String> {
    let lists = Element::first_of_each(parent.children_named("SourceFiles"));
    let files = lists.iter().flat_map(|list| {
        read_list(list, &["File"], &mut Vec::new(), |e| {
            e.children_in_order(&[]);
            e.required_text("name")
        })
    });
    files.collect()
}
