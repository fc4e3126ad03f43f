//! Writes variables.

use super::xml::Xml;
use super::*;

impl ScalarVariable {
    /// `<ScalarVariable>` containing the element of the base type.
    pub(super) fn write2(&self, xml: &mut Xml) {
        xml.open("ScalarVariable");
        self.write_common(xml);
        xml.text_if("initial", self.initial.map(Initial::as_str));
        xml.open(self.kind.base_type().name(FmiVersion::V2));
        self.kind.write(xml);
        if let VariableKind::Real(real) = &self.kind {
            xml.int_if("derivative", real.derivative);
        }
        // An element in FMI 3.0, an attribute here.
        if let VariableKind::String { start, .. } = &self.kind {
            xml.text_if("start", start.first().map(String::as_str));
        }
        xml.close();
        write_annotations(xml, FmiVersion::V2, &self.annotations, false);
        xml.close();
    }

    /// The element of the base type, containing dimensions and aliases.
    pub(super) fn write3(&self, description: &ModelDescription, xml: &mut Xml) {
        let reference = |&index: &u32| description.reference(index);
        xml.open(self.kind.base_type().name(FmiVersion::V3));
        self.write_common(xml);
        if !matches!(self.kind, VariableKind::Clock { .. }) {
            xml.text_if("initial", self.initial.map(Initial::as_str));
        }
        if !self.clocks.is_empty() {
            xml.text("clocks", &joined(self.clocks.iter().map(reference)));
        }
        xml.flag("intermediateUpdate", self.intermediate_update);
        xml.int_if("previous", self.previous.as_ref().map(reference));
        self.kind.write(xml);
        if let VariableKind::Real(real) = &self.kind {
            xml.int_if("derivative", real.derivative.as_ref().map(reference));
        }
        write_annotations(xml, FmiVersion::V3, &self.annotations, false);
        for dimension in &self.dimensions {
            xml.open("Dimension");
            match dimension {
                Dimension::Fixed(size) => xml.text("start", &size.to_string()),
                Dimension::Variable(index) => {
                    xml.text("valueReference", &reference(index).to_string());
                }
            }
            xml.close();
        }
        self.kind.write_start_elements(xml);
        for alias in &self.aliases {
            xml.open("Alias");
            xml.text("name", &alias.name);
            xml.text_if("description", alias.description.as_deref());
            xml.text_if("displayUnit", alias.display_unit.as_deref());
            xml.close();
        }
        xml.close();
    }

    fn write_common(&self, xml: &mut Xml) {
        xml.text("name", &self.name);
        xml.text("valueReference", &self.value_reference.to_string());
        xml.text_if("description", self.description.as_deref());
        xml.text("causality", self.causality.as_str());
        // Always written: the default of FMI 2.0, continuous, is wrong for all types except Real.
        xml.text("variability", self.variability.as_str());
        xml.bool_if(
            "canHandleMultipleSetPerTimeInstant",
            self.can_handle_multiple_set_per_time_instant,
        );
    }
}

impl VariableKind {
    /// Writes the attributes of the base type that are the same in both versions.
    fn write(&self, xml: &mut Xml) {
        xml.text_if("declaredType", self.declared_type());
        match self {
            Self::Real(real) => {
                real.attributes.write(real.precision, xml);
                write_start(xml, real.start.iter().map(|&v| real.precision.format(v)));
                xml.flag("reinit", real.reinit);
            }
            Self::Integer {
                attributes, start, ..
            }
            | Self::Enumeration {
                attributes, start, ..
            } => {
                attributes.write(xml);
                write_start(xml, start);
            }
            Self::Boolean { start, .. } => write_start(xml, start),
            Self::String { .. } => {}
            Self::Binary { attributes, .. } => attributes.write(xml),
            Self::Clock { attributes, .. } => attributes.write(xml),
        }
    }

    /// `<Start>` elements of the types whose values are not written as list items.
    fn write_start_elements(&self, xml: &mut Xml) {
        let values: Vec<String> = match self {
            Self::String { start, .. } => start.clone(),
            Self::Binary { start, .. } => start.iter().map(|bytes| hex(bytes)).collect(),
            _ => Vec::new(),
        };
        for value in values {
            xml.open("Start");
            xml.text("value", &value);
            xml.close();
        }
    }
}

fn write_start<T: ToString>(xml: &mut Xml, values: impl IntoIterator<Item = T>) {
    let text = joined(values);
    xml.text_if("start", (!text.is_empty()).then_some(text.as_str()));
}

/// `xs:hexBinary`.
fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}
