//! The words of the standard. What is misspelled is optional in most places, and would be left out without a word.

use crate::xml::Node;
use pilotage_text::printable::excerpt;
use pilotage_text::suggestion::{did_you_mean, suggestion};

/// Elements of versions 1.0 to 2.0 (the schemas of the standard), whatever their parent.
const ELEMENTS: &str = "Annotation Annotations BaseUnit Binary Boolean BooleanMappingTransformation Clock Component \
    Connection ConnectionGeometry Connections Connector ConnectorGeometry Connectors Content DefaultExperiment \
    DictionaryEntry Dimension ElementGeometry Elements Enumeration EnumerationMappingTransformation Enumerations Float32 \
    Float64 GraphicalElements Int16 Int32 Int64 Int8 Integer IntegerMappingTransformation Item LinearTransformation \
    MapEntry MappingEntry MetaData Note Parameter ParameterBinding ParameterBindings ParameterMapping ParameterSet \
    ParameterValues Parameters Real SSDVariant SignalDictionaries SignalDictionary SignalDictionaryReference Signature \
    String System SystemGeometry SystemStructureDescription UInt16 UInt32 UInt64 UInt8 Unit Units Value";

/// Their attributes, but those of pictures.
const ATTRIBUTES: &str = "A K author baseSSD cd copyright description dictionary endConnector endElement endIndices factor \
    fileversion generationDateAndTime generationTool id implementation intervalCounter intervalDecimal \
    intervalVariability kg kind license m mime-type mol name offset prefix priority rad resolution role s \
    shiftCounter shiftDecimal size sizeConnector source sourceBase startConnector startElement startIndices startTime \
    stopTime suppressUnitConversion supportsFraction target type unit value version";

/// Elements and attributes of OSP's `OspSystemStructure.xsd`.
const OSP: [&str; 2] = [
    "AbsoluteTolerance Algorithm BaseStepSize Boolean Connections EccoConfiguration EndTime Functions InitialValue \
     InitialValues Integer IntegralGain LinearTransformation MaximumChangeRate MaximumStepSize MinimumChangeRate \
     MinimumStepSize OspSystemStructure ProportionalGain Real RelativeTolerance SafetyFactor Signal SignalConnection \
     SignalGroup SignalGroupConnection Simulator Simulators StartTime StepSize String Sum Variable VariableConnection \
     VariableGroup VariableGroupConnection VectorSum",
    "causality dimension factor function inputCount name numericType offset powerBond simulator source stepSize value \
     variable version",
];

/// Elements whose content or attributes are others' or change no number.
const OTHERS: [&str; 9] = [
    "Annotations",
    "MetaData",
    "Signature",
    "GraphicalElements",
    "ConnectionGeometry",
    "ConnectorGeometry",
    "ElementGeometry",
    "SystemGeometry",
    "SSDVariant",
];

/// What is said of the words that are not in the standard: of the first three, and whether there are more.
pub(crate) fn unknown(root: Node<'_, '_>) -> Vec<String> {
    unknown_of([ELEMENTS, ATTRIBUTES], root)
}

/// As [`unknown`], for a system of OSP.
pub(crate) fn unknown_of_osp(root: Node<'_, '_>) -> Vec<String> {
    unknown_of(OSP, root)
}

fn unknown_of([elements, attributes]: [&'static str; 2], root: Node<'_, '_>) -> Vec<String> {
    const SHOWN: usize = 3;
    let mut notes = Vec::new();
    let mut open = vec![root];
    while let Some(node) = open.pop() {
        let place = node.place();
        let mut check = |name: &str, what: String, words: &'static str| {
            let is_known = words.split_whitespace().any(|word| word == name);
            if !is_known && notes.len() < SHOWN {
                let hint = did_you_mean(suggestion(name, words.split_whitespace()));
                notes.push(format!(
                    "{place}: {what} is not in the standard; ignored{hint}"
                ));
            } else if !is_known && notes.len() == SHOWN {
                let file = &place.file;
                notes.push(format!(
                    "{file}: more names are not in the standard; ignored"
                ));
            }
            is_known
        };
        let name = excerpt(node.name());
        if !check(node.name(), format!("<{name}>"), elements) {
            continue;
        }
        for own in node.attributes() {
            check(own, format!("`{}` of <{name}>", excerpt(own)), attributes);
        }
        let at = open.len();
        open.extend((node.children()).filter(|own| !OTHERS.contains(&own.name())));
        open[at..].reverse();
    }
    notes
}
