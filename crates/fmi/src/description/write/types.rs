//! Writes units, type definitions and the attributes common to types and variables.

use super::xml::{Xml, xs_float};
use super::*;
use pilotage_units::BASE_UNITS;

impl Unit {
    pub(super) fn write(&self, xml: &mut Xml) {
        xml.open("Unit");
        xml.text("name", &self.name);
        if let Some(base) = &self.base {
            xml.open("BaseUnit");
            for (name, exponent) in BASE_UNITS.into_iter().zip(base.exponents) {
                xml.int_if(name, (exponent != 0).then_some(exponent));
            }
            write_factor_offset(xml, base.factor, base.offset);
            xml.close();
        }
        for display in &self.display_units {
            xml.open("DisplayUnit");
            xml.text("name", &display.name);
            write_factor_offset(xml, display.factor, display.offset);
            xml.flag("inverse", display.inverse);
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
    /// In FMI 2.0 the element of the base type is nested in that of the type; in FMI 3.0 one element serves both.
    pub(super) fn write(&self, version: FmiVersion, xml: &mut Xml) {
        let base = self.kind.base_type();
        xml.open(match version {
            FmiVersion::V2 => "SimpleType",
            FmiVersion::V3 => type_element(base),
        });
        xml.text("name", &self.name);
        xml.text_if("description", self.description.as_deref());
        if version == FmiVersion::V2 {
            xml.open(base.name(version));
        }
        self.kind.write(version, xml);
        if version == FmiVersion::V2 {
            xml.close();
        }
        xml.close();
    }
}

/// Name of the element of a type definition in FMI 3.0.
fn type_element(base: BaseType) -> &'static str {
    match base {
        BaseType::Real(Precision::Double) => "Float64Type",
        BaseType::Real(Precision::Single) => "Float32Type",
        BaseType::Integer(integer) => match integer {
            IntegerType::Int8 => "Int8Type",
            IntegerType::UInt8 => "UInt8Type",
            IntegerType::Int16 => "Int16Type",
            IntegerType::UInt16 => "UInt16Type",
            IntegerType::Int32 => "Int32Type",
            IntegerType::UInt32 => "UInt32Type",
            IntegerType::Int64 => "Int64Type",
            IntegerType::UInt64 => "UInt64Type",
        },
        BaseType::Boolean => "BooleanType",
        BaseType::String => "StringType",
        BaseType::Binary => "BinaryType",
        BaseType::Enumeration => "EnumerationType",
        BaseType::Clock => "ClockType",
    }
}

impl TypeKind {
    fn write(&self, version: FmiVersion, xml: &mut Xml) {
        match self {
            Self::Real {
                precision,
                attributes,
            } => attributes.write(*precision, xml),
            Self::Integer { attributes, .. } => attributes.write(xml),
            Self::Boolean | Self::String => {}
            Self::Binary(attributes) => attributes.write(xml),
            Self::Enumeration { attributes, items } => {
                match version {
                    FmiVersion::V2 => xml.text_if("quantity", attributes.quantity.as_deref()),
                    FmiVersion::V3 => attributes.write(xml),
                }
                items.iter().for_each(|item| item.write(xml));
            }
            Self::Clock(attributes) => attributes.write(xml),
        }
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

impl RealAttributes {
    pub(super) fn write(&self, precision: Precision, xml: &mut Xml) {
        xml.text_if("quantity", self.quantity.as_deref());
        xml.text_if("unit", self.unit.as_deref());
        xml.text_if("displayUnit", self.display_unit.as_deref());
        xml.bool_if("relativeQuantity", self.relative_quantity);
        for (name, value) in [
            ("min", self.min),
            ("max", self.max),
            ("nominal", self.nominal),
        ] {
            let text = value.map(|value| precision.format(value));
            xml.text_if(name, text.as_deref());
        }
        xml.bool_if("unbounded", self.unbounded);
    }
}

impl Precision {
    /// The shortest decimal that reads back as the same number of this size.
    pub(super) fn format(self, value: f64) -> String {
        match self {
            Self::Double => xs_float(value),
            Self::Single => xs_float(value as f32),
        }
    }
}

impl IntegerAttributes {
    pub(super) fn write(&self, xml: &mut Xml) {
        xml.text_if("quantity", self.quantity.as_deref());
        xml.int_if("min", self.min);
        xml.int_if("max", self.max);
    }
}

impl BinaryAttributes {
    pub(super) fn write(&self, xml: &mut Xml) {
        xml.text_if("mimeType", self.mime_type.as_deref());
        xml.int_if("maxSize", self.max_size);
    }
}

impl ClockAttributes {
    pub(super) fn write(&self, xml: &mut Xml) {
        xml.flag("canBeDeactivated", self.can_be_deactivated);
        xml.int_if("priority", self.priority);
        xml.text("intervalVariability", self.interval_variability.as_str());
        xml.text_if(
            "intervalDecimal",
            self.interval_decimal.map(xs_float).as_deref(),
        );
        let shift = (self.shift_decimal != 0.0).then_some(self.shift_decimal);
        xml.text_if("shiftDecimal", shift.map(xs_float).as_deref());
        xml.flag("supportsFraction", self.supports_fraction);
        xml.int_if("resolution", self.resolution);
        xml.int_if("intervalCounter", self.interval_counter);
        let shift = self.shift_counter;
        xml.int_if("shiftCounter", (shift != 0).then_some(shift));
    }
}
