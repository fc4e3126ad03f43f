//! Writes the interface types.

use super::xml::Xml;
use super::*;

impl ModelDescription {
    pub(super) fn write_interfaces(&self, xml: &mut Xml) {
        let version = self.fmi_version;
        if let Some(me) = &self.model_exchange {
            open(
                xml,
                "ModelExchange",
                &me.model_identifier,
                &me.flags(version),
            );
            match version {
                FmiVersion::V2 => write_source_files(xml, &me.source_files),
                FmiVersion::V3 => xml.flag(
                    "needsCompletedIntegratorStep",
                    !me.completed_integrator_step_not_needed,
                ),
            }
            xml.close();
        }
        if let Some(cs) = &self.co_simulation {
            open(
                xml,
                "CoSimulation",
                &cs.model_identifier,
                &cs.flags(version),
            );
            let order = cs.max_output_derivative_order;
            xml.int_if("maxOutputDerivativeOrder", (order != 0).then_some(order));
            match version {
                FmiVersion::V2 => write_source_files(xml, &cs.source_files),
                FmiVersion::V3 => {
                    xml.real_if("fixedInternalStepSize", cs.fixed_internal_step_size);
                    let smoothness = cs.recommended_intermediate_input_smoothness;
                    xml.int_if(
                        "recommendedIntermediateInputSmoothness",
                        (smoothness != 0).then_some(smoothness),
                    );
                }
            }
            xml.close();
        }
        if let (FmiVersion::V3, Some(se)) = (version, &self.scheduled_execution) {
            let flags = se.flags(version);
            open(xml, "ScheduledExecution", &se.model_identifier, &flags);
            xml.close();
        }
    }
}

/// Opens the element of an interface type, with the common attributes.
fn open(xml: &mut Xml, name: &'static str, identifier: &str, flags: &[(&'static str, bool)]) {
    xml.open(name);
    xml.text("modelIdentifier", identifier);
    for &(name, value) in flags {
        xml.flag(name, value);
    }
}

fn write_source_files(xml: &mut Xml, names: &[String]) {
    list(xml, "SourceFiles", names, |name, xml| {
        xml.open("File");
        xml.text("name", name);
        xml.close();
    });
}
