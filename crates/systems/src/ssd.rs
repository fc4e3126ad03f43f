//! Writes a description as an `.ssd`. It is one flat system; instances keep their names.
//!
//! The version is 1.0, which all tools read, unless a wire or value has a type or an array of 2.0.

use crate::package::uri_of;
use crate::variables::{Variables, elements};
use crate::write::{WriteError, file_of};
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::{InstanceDescription, Interface, Transformation};
use pilotage_fmi::Fmu;
use pilotage_fmi::description::{BaseType, Causality, IntegerType, Precision, Xml};
use pilotage_units::{BASE_UNITS, Base, Conversion};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// The namespaces, by their usual prefixes.
const NAMESPACES: [(&str, &str); 3] = [
    (
        "xmlns:ssd",
        "http://ssp-standard.org/SSP1/SystemStructureDescription",
    ),
    (
        "xmlns:ssc",
        "http://ssp-standard.org/SSP1/SystemStructureCommon",
    ),
    (
        "xmlns:ssv",
        "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    ),
];

/// The text of an `.ssd`; `sources` are the paths of the instances' FMUs from its folder.
///
/// # Errors
/// If SSP cannot say it, or an FMU cannot be read.
pub fn to_ssd(
    description: &SystemDescription,
    name: &str,
    sources: &[String],
) -> Result<String, WriteError> {
    let mut fmus: BTreeMap<&Path, Arc<Variables>> = BTreeMap::new();
    let mut components = Vec::new();
    for (instance, source) in description.instances.iter().zip(sources) {
        let file = file_of(instance)?;
        let variables = match fmus.get(file) {
            Some(known) => known.clone(),
            None => {
                let read = Arc::new(Variables::of(Fmu::open(file)?.description().clone()));
                fmus.insert(file, read.clone());
                read
            }
        };
        components.push(Component {
            instance,
            source,
            variables,
            connectors: Vec::new(),
        });
    }
    let mut writer = Writer {
        description,
        components,
        units: BTreeMap::new(),
        needs_two: false,
        xml: Xml::new(),
    };
    writer.find_connectors()?;
    writer.document(name)
}

/// An instance with the variables that are connectors.
struct Component<'a> {
    instance: &'a InstanceDescription,
    source: &'a str,
    variables: Arc<Variables>,
    connectors: Vec<String>,
}

struct Writer<'a> {
    description: &'a SystemDescription,
    components: Vec<Component<'a>>,
    units: BTreeMap<String, Base>,
    /// Whether something needs version 2.0.
    needs_two: bool,
    xml: Xml,
}

/// One end of a wire: the number of the component, the connector, and indices as in names.
struct End<'n> {
    component: usize,
    connector: &'n str,
    index: &'n str,
}

impl Writer<'_> {
    fn end<'n>(&self, name: &'n str) -> Result<End<'n>, WriteError> {
        let unknown = || WriteError::Unknown {
            name: name.to_owned(),
        };
        let (instance, variable) = self.description.split(name).ok_or_else(unknown)?;
        let own = self
            .components
            .iter()
            .position(|own| own.instance.name == instance);
        let component = own.ok_or_else(unknown)?;
        let found = self.components[component].variables.find(variable);
        let (connector, index) = match found.ok_or_else(unknown)?.is_element {
            true => variable.split_at(variable.rfind('[').unwrap_or(variable.len())),
            false => (variable, ""),
        };
        Ok(End {
            component,
            connector,
            index,
        })
    }

    /// Connectors are the ends of wires, and outputs, which other tools then record.
    fn find_connectors(&mut self) -> Result<(), WriteError> {
        for wire in &self.description.connections {
            for name in [&wire.from.value, &wire.to.value] {
                let End {
                    component,
                    connector,
                    index,
                } = self.end(name)?;
                self.needs_two |= !index.is_empty();
                let known = &mut self.components[component].connectors;
                if known.iter().all(|own| own != connector) {
                    known.push(connector.to_owned());
                }
            }
        }
        for own in &mut self.components {
            for variable in &own.variables.fmu.variables {
                let kind = variable.kind.base_type();
                let is_plain =
                    type_of(kind).is_some_and(|(_, is_new)| !is_new) && kind != BaseType::String;
                let is_output = variable.causality == Causality::Output;
                if is_output
                    && is_plain
                    && variable.dimensions.is_empty()
                    && !own.connectors.contains(&variable.name)
                {
                    own.connectors.push(variable.name.clone());
                }
            }
        }
        for own in &self.components {
            for found in own
                .connectors
                .iter()
                .filter_map(|name| own.variables.find(name))
            {
                let is_new =
                    type_of(found.variable.kind.base_type()).is_some_and(|(_, is_new)| is_new);
                self.needs_two |= is_new || !found.variable.dimensions.is_empty();
                if let Some(unit) = found.unit
                    && let Some(base) = unit.base
                {
                    self.units.insert(unit.name, base);
                }
            }
        }
        Ok(())
    }

    /// An attribute, if XML can hold it.
    fn text(&mut self, name: &str, value: &str) -> Result<(), WriteError> {
        let is_none = |c: char| matches!(c, '\0'..='\x08' | '\x0b' | '\x0c' | '\x0e'..='\x1f' | '\u{fffe}' | '\u{ffff}');
        if value.contains(is_none) {
            let text = value.to_owned();
            return Err(WriteError::Character { text });
        }
        self.xml.text(name, value);
        Ok(())
    }

    fn document(mut self, name: &str) -> Result<String, WriteError> {
        self.needs_two |= self.has_whole_arrays();
        let version = if self.needs_two { "2.0" } else { "1.0" };
        self.xml.open("ssd:SystemStructureDescription");
        for (prefix, namespace) in NAMESPACES {
            self.xml.text(prefix, namespace);
        }
        self.text("version", version)?;
        self.text("name", name)?;
        let tool = concat!("pilotage ", env!("CARGO_PKG_VERSION"));
        self.text("generationTool", tool)?;
        self.xml.open("ssd:System");
        self.text("name", name)?;
        if !self.components.is_empty() {
            self.xml.open("ssd:Elements");
            for k in 0..self.components.len() {
                self.component(k, version)?;
            }
            self.xml.close();
        }
        self.connections()?;
        let times = self.description.experiment;
        if let Some(step) = times.step {
            self.write_step(step)?;
        }
        self.xml.close();
        self.write_units()?;
        if times.start.is_some() || times.stop.is_some() {
            self.xml.open("ssd:DefaultExperiment");
            self.xml.real_if("startTime", times.start);
            self.xml.real_if("stopTime", times.stop);
            self.xml.close();
        }
        self.xml.close();
        Ok(self.xml.finish())
    }

    /// The communication step as OMSimulator writes it, with the tolerances that it has by default: the standard has no place
    /// for it.
    fn write_step(&mut self, step: f64) -> Result<(), WriteError> {
        self.xml.open("ssd:Annotations");
        self.xml.open("ssc:Annotation");
        self.text("type", "org.openmodelica")?;
        self.xml.open("oms:Annotations");
        let schema =
            "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd";
        self.text("xmlns:oms", schema)?;
        self.xml.open("oms:SimulationInformation");
        self.xml.open("oms:FixedStepMaster");
        self.text("description", "oms-ma")?;
        self.xml.real_if("stepSize", Some(step));
        self.xml.real_if("absoluteTolerance", Some(1e-4));
        self.xml.real_if("relativeTolerance", Some(1e-4));
        for _ in 0..5 {
            self.xml.close();
        }
        Ok(())
    }

    /// Whether all elements of an array are set, which is then one value.
    fn has_whole_arrays(&self) -> bool {
        let own = self.components.iter();
        own.flat_map(|own| self.values(own))
            .any(|(_, values)| values.len() > 1)
    }

    /// The values of a component: names, and one value each, or those of a whole array.
    fn values(&self, own: &Component) -> Vec<(String, Vec<String>)> {
        let mut all: Vec<(String, Vec<String>)> = Vec::new();
        let set: Vec<(&str, &str)> = self.description.settings_of(&own.instance.name).collect();
        for (name, value) in &set {
            let array = (own.variables.find(name)).filter(|found| found.is_element);
            let Some(found) = array else {
                all.push((name.to_string(), vec![value.to_string()]));
                continue;
            };
            let base = &name[..name.rfind('[').unwrap_or(name.len())];
            let sizes = own.variables.fmu.sizes(found.variable).unwrap_or_default();
            let ends = elements(&sizes, set.len());
            let value_of = |end: &String| {
                let whole = format!("{base}{end}");
                set.iter()
                    .find(|(name, _)| *name == whole)
                    .map(|(_, value)| value.to_string())
            };
            match ends.iter().map(value_of).collect::<Option<Vec<String>>>() {
                Some(values) if ends.len() > 1 => {
                    if all.iter().all(|(known, _)| known != base) {
                        all.push((base.to_owned(), values));
                    }
                }
                _ => all.push((name.to_string(), vec![value.to_string()])),
            }
        }
        all
    }

    fn component(&mut self, k: usize, version: &str) -> Result<(), WriteError> {
        let own = &self.components[k];
        let (name, source) = (own.instance.name.clone(), uri_of(own.source));
        let (interface, connectors) = (own.instance.interface, own.connectors.clone());
        let (variables, values) = (own.variables.clone(), self.values(own));
        self.xml.open("ssd:Component");
        self.text("name", &name)?;
        self.text("type", "application/x-fmu-sharedlibrary")?;
        self.text("source", &source)?;
        if let Some(interface) = interface {
            self.xml.text(
                "implementation",
                match interface {
                    Interface::CoSimulation => "CoSimulation",
                    Interface::ModelExchange => "ModelExchange",
                },
            );
        }
        if !connectors.is_empty() {
            self.xml.open("ssd:Connectors");
            for name in &connectors {
                self.connector(name, &variables)?;
            }
            self.xml.close();
        }
        if !values.is_empty() {
            self.xml.open("ssd:ParameterBindings");
            self.xml.open("ssd:ParameterBinding");
            self.xml.open("ssd:ParameterValues");
            self.xml.open("ssv:ParameterSet");
            self.text("version", version)?;
            // One name for all, by which Ecos applies them.
            self.text("name", "initialValues")?;
            self.xml.open("ssv:Parameters");
            for (name, values) in &values {
                self.parameter(name, values, &variables)?;
            }
            for _ in 0..5 {
                self.xml.close();
            }
        }
        self.xml.close();
        Ok(())
    }

    fn connector(&mut self, name: &str, variables: &Variables) -> Result<(), WriteError> {
        let Some(found) = variables.find(name) else {
            return Ok(());
        };
        self.xml.open("ssd:Connector");
        self.text("name", name)?;
        self.text("kind", found.variable.causality.as_str())?;
        if let Some((kind, _)) = type_of(found.variable.kind.base_type()) {
            self.xml.open(kind);
            if let Some(unit) = found.unit.filter(|unit| unit.base.is_some()) {
                self.text("unit", &unit.name)?;
            }
            self.xml.close();
        }
        if !found.variable.dimensions.is_empty() {
            for size in variables.fmu.sizes(found.variable).unwrap_or_default() {
                self.xml.open("ssc:Dimension");
                self.text("size", &size.to_string())?;
                self.xml.close();
            }
        }
        self.xml.close();
        Ok(())
    }

    fn parameter(
        &mut self,
        name: &str,
        values: &[String],
        variables: &Variables,
    ) -> Result<(), WriteError> {
        let unknown = || WriteError::Unknown {
            name: name.to_owned(),
        };
        let found = variables.find(name).ok_or_else(unknown)?;
        let first = values.first().map_or("", |value| value.trim());
        let kind = match found.variable.kind.base_type() {
            BaseType::Real(_) => "ssv:Real",
            BaseType::Integer(_) => "ssv:Integer",
            BaseType::Boolean => "ssv:Boolean",
            // An enumeration by its number, or by an item's name.
            BaseType::Enumeration if first.parse::<i64>().is_ok() => "ssv:Integer",
            BaseType::Enumeration => "ssv:Enumeration",
            _ => "ssv:String",
        };
        let texts: Vec<String> = values.iter().map(|value| lexical(value, kind)).collect();
        self.xml.open("ssv:Parameter");
        self.text("name", name)?;
        self.xml.open(kind);
        match kind == "ssv:String" && texts.len() > 1 {
            true => {
                for text in &texts {
                    self.xml.open("ssv:Value");
                    self.text("value", text)?;
                    self.xml.close();
                }
            }
            false => self.text("value", &texts.join(" "))?,
        }
        self.xml.close();
        if texts.len() > 1 {
            for size in variables.fmu.sizes(found.variable).unwrap_or_default() {
                self.xml.open("ssc:Dimension");
                self.text("size", &size.to_string())?;
                self.xml.close();
            }
        }
        self.xml.close();
        Ok(())
    }

    fn connections(&mut self) -> Result<(), WriteError> {
        let description = self.description;
        if description.connections.is_empty() {
            return Ok(());
        }
        self.xml.open("ssd:Connections");
        for wire in &description.connections {
            self.xml.open("ssd:Connection");
            for (which, name) in [("start", &wire.from.value), ("end", &wire.to.value)] {
                let end = self.end(name)?;
                let element = &description.instances[end.component].name;
                self.text(&format!("{which}Element"), element)?;
                self.text(&format!("{which}Connector"), end.connector)?;
                if !end.index.is_empty() {
                    let places = end.index.trim_matches(['[', ']']).replace(',', " ");
                    self.text(&format!("{which}Indices"), &places)?;
                }
            }
            let Transformation {
                linear,
                converts_units,
                ref map,
            } = wire.transformation;
            if !converts_units {
                self.text("suppressUnitConversion", "true")?;
            }
            if linear != Conversion::NONE {
                self.xml.open("ssc:LinearTransformation");
                self.xml.real_if("factor", Some(linear.factor));
                self.xml.real_if("offset", Some(linear.offset));
                self.xml.close();
            }
            if !map.is_empty() {
                self.map(map)?;
            }
            self.xml.close();
        }
        self.xml.close();
        Ok(())
    }

    /// Other values in place of some (sections 4.5.2.2 to 4.5.2.4).
    fn map(&mut self, map: &[(String, String)]) -> Result<(), WriteError> {
        let mut texts = map.iter().flat_map(|(from, to)| [from, to]);
        let kind = match (
            texts
                .clone()
                .all(|text| ["true", "false"].contains(&text.as_str())),
            texts.all(|text| text.parse::<i64>().is_ok()),
        ) {
            (true, _) => "ssc:BooleanMappingTransformation",
            (_, true) => "ssc:IntegerMappingTransformation",
            _ => "ssc:EnumerationMappingTransformation",
        };
        self.xml.open(kind);
        for (from, to) in map {
            self.xml.open("ssc:MapEntry");
            self.text("source", from)?;
            self.text("target", to)?;
            self.xml.close();
        }
        self.xml.close();
        Ok(())
    }

    fn write_units(&mut self) -> Result<(), WriteError> {
        let units = std::mem::take(&mut self.units);
        if units.is_empty() {
            return Ok(());
        }
        self.xml.open("ssd:Units");
        for (name, base) in &units {
            self.xml.open("ssc:Unit");
            self.text("name", name)?;
            self.xml.open("ssc:BaseUnit");
            for (unit, exponent) in BASE_UNITS.into_iter().zip(base.exponents) {
                if exponent != 0 {
                    self.text(unit, &exponent.to_string())?;
                }
            }
            let other = |value: f64, default: f64| (value != default).then_some(value);
            self.xml.real_if("factor", other(base.factor, 1.0));
            self.xml.real_if("offset", other(base.offset, 0.0));
            self.xml.close();
            self.xml.close();
        }
        self.xml.close();
        Ok(())
    }
}

/// The element of a connector's type, and whether it is of version 2.0. Enumerations would need definitions, and a connector
/// without a type has that of its variable (section 5.2.1).
fn type_of(kind: BaseType) -> Option<(&'static str, bool)> {
    Some(match kind {
        BaseType::Real(Precision::Double) => ("ssc:Real", false),
        BaseType::Real(Precision::Single) => ("ssc:Float32", true),
        BaseType::Integer(own) => match own {
            IntegerType::Int8 => ("ssc:Int8", true),
            IntegerType::UInt8 => ("ssc:UInt8", true),
            IntegerType::Int16 => ("ssc:Int16", true),
            IntegerType::UInt16 => ("ssc:UInt16", true),
            IntegerType::Int32 => ("ssc:Integer", false),
            IntegerType::UInt32 => ("ssc:UInt32", true),
            IntegerType::Int64 => ("ssc:Int64", true),
            IntegerType::UInt64 => ("ssc:UInt64", true),
        },
        BaseType::Boolean => ("ssc:Boolean", false),
        BaseType::String => ("ssc:String", false),
        BaseType::Binary | BaseType::Enumeration | BaseType::Clock => return None,
    })
}

/// A value as XML has it: infinities are written otherwise there.
fn lexical(value: &str, kind: &str) -> String {
    let number = value.trim().parse::<f64>().ok();
    match number.filter(|number| kind == "ssv:Real" && !number.is_finite()) {
        Some(number) if number.is_nan() => "NaN".to_owned(),
        Some(number) if number > 0.0 => "INF".to_owned(),
        Some(_) => "-INF".to_owned(),
        None if kind == "ssv:String" => value.to_owned(),
        None => value.trim().to_owned(),
    }
}
