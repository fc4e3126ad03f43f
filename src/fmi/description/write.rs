//! Writes a modelDescription.xml, elements in the schema's order.

use super::xml::{Xml, xs_double};
use super::*;

impl ModelDescription {
    /// The text of modelDescription.xml, in UTF-8.
    ///
    /// Absent optional attributes and empty lists are not written, since the schema forbids empty
    /// list elements.
    pub fn to_xml(&self) -> String {
        let mut xml = Xml::new();
        xml.open("fmiModelDescription");
        self.write_root_attributes(&mut xml);
        if let Some(me) = &self.model_exchange {
            me.write(&mut xml);
        }
        if let Some(cs) = &self.co_simulation {
            cs.write(&mut xml);
        }
        list(&mut xml, "UnitDefinitions", &self.units, Unit::write);
        list(&mut xml, "TypeDefinitions", &self.types, SimpleType::write);
        list(
            &mut xml,
            "LogCategories",
            &self.log_categories,
            write_category,
        );
        if let Some(experiment) = &self.default_experiment {
            experiment.write(&mut xml);
        }
        list(
            &mut xml,
            "VendorAnnotations",
            &self.vendor_annotations,
            Tool::write,
        );
        // Required by the schema even when there is nothing in them.
        xml.open("ModelVariables");
        for variable in &self.variables {
            variable.write(&mut xml);
        }
        xml.close();
        self.structure.write(&mut xml);
        xml.finish()
    }

    fn write_root_attributes(&self, xml: &mut Xml) {
        xml.text("fmiVersion", "2.0");
        xml.text("modelName", &self.model_name);
        xml.text("guid", &self.guid);
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
        xml.int_if("numberOfEventIndicators", self.number_of_event_indicators);
    }
}

/// A list element, or nothing if the list is empty.
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

fn write_source_files(xml: &mut Xml, names: &[String]) {
    list(xml, "SourceFiles", names, |name, xml| {
        xml.open("File");
        xml.text("name", name);
        xml.close();
    });
}

impl CoSimulation {
    fn write(&self, xml: &mut Xml) {
        xml.open("CoSimulation");
        xml.text("modelIdentifier", &self.model_identifier);
        for (name, value) in self.flags() {
            xml.flag(name, value);
        }
        let order = self.max_output_derivative_order;
        xml.int_if("maxOutputDerivativeOrder", (order != 0).then_some(order));
        write_source_files(xml, &self.source_files);
        xml.close();
    }
}

impl ModelExchange {
    fn write(&self, xml: &mut Xml) {
        xml.open("ModelExchange");
        xml.text("modelIdentifier", &self.model_identifier);
        for (name, value) in self.flags() {
            xml.flag(name, value);
        }
        write_source_files(xml, &self.source_files);
        xml.close();
    }
}

impl Unit {
    fn write(&self, xml: &mut Xml) {
        xml.open("Unit");
        xml.text("name", &self.name);
        if let Some(base) = &self.base {
            xml.open("BaseUnit");
            for (name, exponent) in base.exponents() {
                xml.int_if(name, (exponent != 0).then_some(exponent));
            }
            write_factor_offset(xml, base.factor, base.offset);
            xml.close();
        }
        for display in &self.display_units {
            xml.open("DisplayUnit");
            xml.text("name", &display.name);
            write_factor_offset(xml, display.factor, display.offset);
            xml.close();
        }
        xml.close();
    }
}

fn write_factor_offset(xml: &mut Xml, factor: f64, offset: f64) {
    xml.real_if("factor", (factor != 1.0).then_some(factor));
    xml.real_if("offset", (offset != 0.0).then_some(offset));
}

impl SimpleType {
    fn write(&self, xml: &mut Xml) {
        xml.open("SimpleType");
        xml.text("name", &self.name);
        xml.text_if("description", self.description.as_deref());
        match &self.kind {
            TypeKind::Real(attributes) => {
                xml.open("Real");
                attributes.write(xml);
            }
            TypeKind::Integer(attributes) => {
                xml.open("Integer");
                attributes.write(xml);
            }
            TypeKind::Boolean => xml.open("Boolean"),
            TypeKind::String => xml.open("String"),
            TypeKind::Enumeration { quantity, items } => {
                xml.open("Enumeration");
                xml.text_if("quantity", quantity.as_deref());
                items.iter().for_each(|item| item.write(xml));
            }
        }
        xml.close();
        xml.close();
    }
}

impl EnumerationItem {
    fn write(&self, xml: &mut Xml) {
        xml.open("Item");
        xml.text("name", &self.name);
        xml.text("value", &self.value.to_string());
        xml.text_if("description", self.description.as_deref());
        xml.close();
    }
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

impl Tool {
    fn write(&self, xml: &mut Xml) {
        xml.open("Tool");
        xml.text("name", &self.name);
        xml.close_with(&self.content);
    }
}

impl RealAttributes {
    fn write(&self, xml: &mut Xml) {
        xml.text_if("quantity", self.quantity.as_deref());
        xml.text_if("unit", self.unit.as_deref());
        xml.text_if("displayUnit", self.display_unit.as_deref());
        xml.bool_if("relativeQuantity", self.relative_quantity);
        xml.real_if("min", self.min);
        xml.real_if("max", self.max);
        xml.real_if("nominal", self.nominal);
        xml.bool_if("unbounded", self.unbounded);
    }
}

impl IntegerAttributes {
    fn write(&self, xml: &mut Xml) {
        xml.text_if("quantity", self.quantity.as_deref());
        xml.int_if("min", self.min);
        xml.int_if("max", self.max);
    }
}

impl ScalarVariable {
    fn write(&self, xml: &mut Xml) {
        xml.open("ScalarVariable");
        xml.text("name", &self.name);
        xml.text("valueReference", &self.value_reference.to_string());
        xml.text_if("description", self.description.as_deref());
        xml.text("causality", self.causality.as_str());
        // Written always: the default, continuous, is wrong for every type but Real.
        xml.text("variability", self.variability.as_str());
        xml.text_if("initial", self.initial.map(Initial::as_str));
        xml.bool_if(
            "canHandleMultipleSetPerTimeInstant",
            self.can_handle_multiple_set_per_time_instant,
        );
        self.kind.write(xml);
        list(xml, "Annotations", &self.annotations, Tool::write);
        xml.close();
    }
}

impl VariableKind {
    fn write(&self, xml: &mut Xml) {
        match self {
            Self::Real(real) => {
                xml.open("Real");
                xml.text_if("declaredType", real.declared_type.as_deref());
                real.attributes.write(xml);
                xml.text_if("start", real.start.map(xs_double).as_deref());
                xml.int_if("derivative", real.derivative);
                xml.flag("reinit", real.reinit);
            }
            Self::Integer {
                declared_type,
                attributes,
                start,
            } => {
                xml.open("Integer");
                xml.text_if("declaredType", declared_type.as_deref());
                attributes.write(xml);
                xml.int_if("start", *start);
            }
            Self::Boolean {
                declared_type,
                start,
            } => {
                xml.open("Boolean");
                xml.text_if("declaredType", declared_type.as_deref());
                xml.bool_if("start", *start);
            }
            Self::String {
                declared_type,
                start,
            } => {
                xml.open("String");
                xml.text_if("declaredType", declared_type.as_deref());
                xml.text_if("start", start.as_deref());
            }
            Self::Enumeration {
                declared_type,
                attributes,
                start,
            } => {
                xml.open("Enumeration");
                xml.text("declaredType", declared_type);
                attributes.write(xml);
                xml.int_if("start", *start);
            }
        }
        xml.close();
    }
}

impl ModelStructure {
    fn write(&self, xml: &mut Xml) {
        xml.open("ModelStructure");
        list(xml, "Outputs", &self.outputs, Unknown::write);
        list(xml, "Derivatives", &self.derivatives, Unknown::write);
        list(
            xml,
            "InitialUnknowns",
            &self.initial_unknowns,
            Unknown::write,
        );
        xml.close();
    }
}

impl Unknown {
    fn write(&self, xml: &mut Xml) {
        xml.open("Unknown");
        xml.text("index", &self.index.to_string());
        if let Some(dependencies) = &self.dependencies {
            xml.text("dependencies", &joined(dependencies));
        }
        if let Some(kinds) = &self.dependencies_kind {
            xml.text("dependenciesKind", &joined(kinds));
        }
        xml.close();
    }
}

/// The items with blanks between them.
fn joined<T: ToString>(items: &[T]) -> String {
    let words: Vec<String> = items.iter().map(T::to_string).collect();
    words.join(" ")
}
