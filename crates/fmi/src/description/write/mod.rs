//! Writes a modelDescription.xml, with elements in the schema's order.

mod interface;
mod types;
mod variable;
mod xml;

use super::*;
pub use xml::Xml;

impl ModelDescription {
    /// The text of modelDescription.xml, in UTF-8, for the version of
    /// [`fmi_version`](Self::fmi_version).
    ///
    /// Absent optional attributes and empty lists are not written, since the schema forbids empty list elements. FMI
    /// 3.0 refers to variables by value reference: an index without variable becomes 4294967295.
    pub fn to_xml(&self) -> String {
        let mut xml = Xml::new();
        xml.open("fmiModelDescription");
        self.write_root_attributes(&mut xml);
        self.write_interfaces(&mut xml);
        let version = self.fmi_version;
        list(&mut xml, "UnitDefinitions", &self.units, |unit, xml| {
            unit.write(xml);
        });
        list(&mut xml, "TypeDefinitions", &self.types, |simple, xml| {
            simple.write(version, xml);
        });
        list(
            &mut xml,
            "LogCategories",
            &self.log_categories,
            write_category,
        );
        if let Some(experiment) = &self.default_experiment {
            experiment.write(&mut xml);
        }
        if version == FmiVersion::V2 {
            write_annotations(&mut xml, version, &self.vendor_annotations, true);
        }
        // Required by the schema even if empty.
        xml.open("ModelVariables");
        for variable in &self.variables {
            match version {
                FmiVersion::V2 => variable.write2(&mut xml),
                FmiVersion::V3 => variable.write3(self, &mut xml),
            }
        }
        xml.close();
        xml.open("ModelStructure");
        match version {
            FmiVersion::V2 => self.structure.write2(&mut xml),
            FmiVersion::V3 => self.structure.write3(self, &mut xml),
        }
        xml.close();
        if version == FmiVersion::V3 {
            write_annotations(&mut xml, version, &self.vendor_annotations, true);
        }
        xml.finish()
    }

    fn write_root_attributes(&self, xml: &mut Xml) {
        let version = self.fmi_version.to_string();
        xml.text("fmiVersion", self.fmi_release.as_ref().unwrap_or(&version));
        xml.text("modelName", &self.model_name);
        let token = match self.fmi_version {
            FmiVersion::V2 => "guid",
            FmiVersion::V3 => "instantiationToken",
        };
        xml.text(token, &self.guid);
        xml.text_if("description", self.description.as_deref());
        xml.text_if("author", self.author.as_deref());
        xml.text_if("version", self.version.as_deref());
        xml.text_if("copyright", self.copyright.as_deref());
        xml.text_if("license", self.license.as_deref());
        xml.text_if("generationTool", self.generation_tool.as_deref());
        xml.text_if(
            "generationDateAndTime",
            self.generation_date_and_time.as_deref(),
        );
        xml.text("variableNamingConvention", self.naming_convention.as_str());
        if self.fmi_version == FmiVersion::V2 {
            xml.int_if("numberOfEventIndicators", self.number_of_event_indicators);
        }
    }

    /// Value reference of the variable with that index (from 1).
    fn reference(&self, index: u32) -> u32 {
        let position = (index as usize).checked_sub(1);
        let variable = position.and_then(|p| self.variables.get(p));
        variable.map_or(u32::MAX, |v| v.value_reference)
    }
}

/// Writes a list element, or nothing if the list is empty.
fn list<T>(xml: &mut Xml, name: &'static str, items: &[T], write: impl Fn(&T, &mut Xml)) {
    if items.is_empty() {
        return;
    }
    xml.open(name);
    for item in items {
        write(item, xml);
    }
    xml.close();
}

fn write_category(category: &LogCategory, xml: &mut Xml) {
    xml.open("Category");
    xml.text("name", &category.name);
    xml.text_if("description", category.description.as_deref());
    xml.close();
}

/// Writes annotations of the root element or of a variable.
fn write_annotations(xml: &mut Xml, version: FmiVersion, tools: &[Tool], is_root: bool) {
    let (name, item, attribute) = match (version, is_root) {
        (FmiVersion::V2, true) => ("VendorAnnotations", "Tool", "name"),
        (FmiVersion::V2, false) => ("Annotations", "Tool", "name"),
        (FmiVersion::V3, _) => ("Annotations", "Annotation", "type"),
    };
    list(xml, name, tools, |tool, xml| {
        xml.open(item);
        xml.text(attribute, &tool.name);
        xml.close_with(&tool.content);
    });
}

impl DefaultExperiment {
    fn write(&self, xml: &mut Xml) {
        xml.open("DefaultExperiment");
        xml.real_if("startTime", self.start_time);
        xml.real_if("stopTime", self.stop_time);
        xml.real_if("tolerance", self.tolerance);
        xml.real_if("stepSize", self.step_size);
        xml.close();
    }
}

impl ModelStructure {
    fn write2(&self, xml: &mut Xml) {
        for (name, unknowns) in [
            ("Outputs", &self.outputs),
            ("Derivatives", &self.derivatives),
            ("InitialUnknowns", &self.initial_unknowns),
        ] {
            list(xml, name, unknowns, |unknown, xml| {
                unknown.write("Unknown", "index", |index| index, xml);
            });
        }
    }

    fn write3(&self, description: &ModelDescription, xml: &mut Xml) {
        for (name, unknowns) in [
            ("Output", &self.outputs),
            ("ContinuousStateDerivative", &self.derivatives),
            ("ClockedState", &self.clocked_states),
            ("InitialUnknown", &self.initial_unknowns),
            ("EventIndicator", &self.event_indicators),
        ] {
            for unknown in unknowns {
                let reference = |index| description.reference(index);
                unknown.write(name, "valueReference", reference, xml);
            }
        }
    }
}

impl Unknown {
    fn write(
        &self,
        element: &'static str,
        attribute: &str,
        number: impl Fn(u32) -> u32,
        xml: &mut Xml,
    ) {
        xml.open(element);
        xml.text(attribute, &number(self.index).to_string());
        if let Some(dependencies) = &self.dependencies {
            xml.text(
                "dependencies",
                &joined(dependencies.iter().map(|&d| number(d))),
            );
        }
        if let Some(kinds) = &self.dependencies_kind {
            xml.text("dependenciesKind", &joined(kinds));
        }
        xml.close();
    }
}

/// The items separated by spaces.
fn joined<T: ToString>(items: impl IntoIterator<Item = T>) -> String {
    let words: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    words.join(" ")
}
