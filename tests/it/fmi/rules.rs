//! The rules for descriptions that tools get wrong (1 to 16), each broken in a good description and
//! kept by every description that is exported here, in both versions.

use super::findings::findings;
use super::{faults2, faults3};
use pilotage::export::{Provenance, description};
use pilotage::fmi::description::*;
use pilotage::fmi_check::validate;
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter};
use pilotage_sdk::Interface;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// modelDescription.xml of each model in each version, with its text.
static EXPORTED: LazyLock<Vec<(ModelDescription, String)>> = LazyLock::new(|| {
    let models = [
        (Model::pilot(&PAPER_THETA, 1.0), Provenance::paper()),
        (
            Model::quadcopter(&Quadcopter::default()),
            Provenance::vehicle(None),
        ),
    ];
    let mut exported = Vec::new();
    for version in [FmiVersion::V2, FmiVersion::V3] {
        for (model, provenance) in &models {
            let interface = Interface::of(model);
            let text = description(&interface, provenance, version).to_xml();
            let reading = read(text.as_bytes()).unwrap();
            assert_eq!(validate(&reading), [], "{text}");
            exported.push((reading.into_usable().unwrap(), text));
        }
    }
    exported
});

fn descriptions() -> impl Iterator<Item = &'static ModelDescription> {
    EXPORTED.iter().map(|(description, _)| description)
}

fn of_version(version: FmiVersion) -> impl Iterator<Item = &'static ModelDescription> {
    descriptions().filter(move |d| d.fmi_version == version)
}

/// The variable of an index from 1.
fn at(description: &ModelDescription, index: u32) -> &ScalarVariable {
    &description.variables[index as usize - 1]
}

/// Asserts that a change of the good description of FMI 2.0 leads to a finding with this message.
#[track_caller]
fn breaks(from: &str, to: &str, message: &str) {
    assert_eq!(faults2::GOOD.matches(from).count(), 1, "{from}");
    let found = findings(&faults2::GOOD.replace(from, to));
    assert!(found.iter().any(|f| f.contains(message)), "{found:#?}");
}

/// FMI rule 1: fmiVersion is 2.0 for every release of 2.0; the date's form.
#[test]
fn version_and_date() {
    for (description, text) in EXPORTED.iter() {
        let written = format!("fmiVersion=\"{}\"", description.fmi_version);
        assert_eq!(text.matches(&written).count(), 1);
        assert_eq!(description.fmi_release, None);
    }
    breaks(
        "fmiVersion=\"2.0\"",
        "fmiVersion=\"2.0.5\"",
        "expected \"2.0\"",
    );
    breaks(
        "03:04:05Z",
        "03:04:05+00:00",
        "not of the form YYYY-MM-DDThh:mm:ssZ",
    );
}

/// FMI rule 2: the schema's order, and no empty lists.
#[test]
fn order_of_elements() {
    const ORDER: [&str; 9] = [
        "<ModelExchange",
        "<CoSimulation",
        "<UnitDefinitions",
        "<TypeDefinitions",
        "<LogCategories",
        "<DefaultExperiment",
        "<VendorAnnotations",
        "<ModelVariables",
        "<ModelStructure",
    ];
    for (_, text) in EXPORTED.iter() {
        let positions: Vec<usize> = ORDER
            .iter()
            .filter_map(|element| text.find(element))
            .collect();
        assert!(
            positions.len() >= 7 && positions.is_sorted(),
            "{positions:?}"
        );
    }
    breaks(
        "<LogCategories><Category name=\"logEvents\"/><Category name=\"logStatusError\"/></LogCategories>",
        "<LogCategories/>",
        "<LogCategories> is empty",
    );
    breaks(
        "<LogCategories>",
        "<VendorAnnotations><Tool name=\"t\"/></VendorAnnotations><LogCategories>",
        "<LogCategories> stands after <VendorAnnotations>",
    );
}

/// FMI rule 3: the guid is a hash of the interface, the same in both versions and another for another
/// interface. That the binary compares it is tested with the binaries.
#[test]
fn guid() {
    let guids = |version| -> Vec<&str> { of_version(version).map(|d| d.guid.as_str()).collect() };
    assert_eq!(guids(FmiVersion::V2), guids(FmiVersion::V3));
    let different: BTreeSet<&str> = guids(FmiVersion::V2).into_iter().collect();
    assert_eq!(different.len(), 2);
    breaks("guid=\"{1}\"", "guid=\"\"", "the guid is empty");
}

/// FMI rule 4: modelIdentifier is an identifier of C, and one library serves both interface types.
#[test]
fn model_identifier() {
    for description in descriptions() {
        let cs = description.co_simulation.as_ref().unwrap();
        let me = description.model_exchange.as_ref().unwrap();
        assert_eq!(cs.model_identifier, me.model_identifier);
    }
    for bad in ["1m", "a b", "a.b", "größe", ""] {
        breaks(
            "modelIdentifier=\"m\"",
            &format!("modelIdentifier=\"{bad}\""),
            "is not a C identifier",
        );
    }
}

/// FMI rule 5: unique names that follow the convention, escaped in the XML.
#[test]
fn names() {
    for description in descriptions() {
        let names: BTreeSet<&str> = description
            .variables
            .iter()
            .map(|v| v.name.as_str())
            .collect();
        assert_eq!(names.len(), description.variables.len());
    }
    breaks("name=\"y\"", "name=\"u\"", "variable `u` is defined twice");
    breaks(
        "name=\"y\"",
        "name=\"a-b\"",
        "does not follow variableNamingConvention",
    );
    let escaped = faults2::GOOD.replace("name=\"y\"", "name=\"'a&lt;b&amp;&gt;c'\"");
    let reading = read(escaped.as_bytes()).unwrap();
    assert_eq!(validate(&reading), []);
    assert!(reading.description.variable("'a<b&>c'").is_some());
    assert!(reading.description.to_xml().contains("'a&lt;b&amp;&gt;c'"));
}

/// FMI rule 6: value references are unique, and what shares one fits together.
#[test]
fn value_references() {
    for description in descriptions() {
        let references: BTreeSet<u32> = description
            .variables
            .iter()
            .map(|v| v.value_reference)
            .collect();
        assert_eq!(references.len(), description.variables.len());
    }
    breaks(
        "valueReference=\"2\"",
        "valueReference=\"1\"",
        "only one of them may be settable",
    );
    breaks(
        "valueReference=\"2\"",
        "valueReference=\"1\"",
        "only one of them may have a start value",
    );
    breaks(
        "valueReference=\"4\"",
        "valueReference=\"5\"",
        "whose unit is",
    );
    // Reals, integers, booleans and strings have references of their own: there are four 0.
    assert_eq!(faults2::GOOD.matches("valueReference=\"0\"").count(), 4);
    assert_eq!(findings(faults2::GOOD), Vec::<String>::new());
}

/// FMI rule 7: variability is written, since its default fits reals alone.
#[test]
fn variability() {
    for (description, text) in EXPORTED.iter() {
        let variables = text.split("<ModelVariables>").nth(1).unwrap();
        let variables = variables.split("</ModelVariables>").next().unwrap();
        let written = variables.matches(" variability=\"").count();
        assert_eq!(written, description.variables.len());
    }
    breaks(
        "variability=\"discrete\" ",
        "",
        "variability=\"continuous\" is for reals",
    );
}

/// FMI rule 8: the whole table of causality, variability and initial, in both versions.
#[test]
fn combinations() {
    use Causality as C;
    use Variability as V;
    let allowed = |causality, variability, version| -> &[&str] {
        match (causality, variability) {
            (C::Parameter | C::StructuralParameter, V::Fixed | V::Tunable) => &["exact"],
            (C::CalculatedParameter, V::Fixed | V::Tunable) => &["approx", "calculated"],
            (C::Input, V::Discrete | V::Continuous) if version == FmiVersion::V3 => &["exact"],
            (C::Output | C::Local, V::Constant) => &["exact"],
            (C::Local, V::Fixed | V::Tunable) => &["approx", "calculated"],
            (C::Output | C::Local, V::Discrete | V::Continuous) => {
                &["exact", "approx", "calculated"]
            }
            _ => &[],
        }
    };
    let exists = |causality, variability, version| {
        !allowed(causality, variability, version).is_empty()
            || matches!(
                (causality, variability),
                (C::Input, V::Discrete | V::Continuous) | (C::Independent, V::Continuous)
            )
    };
    let mut count = 0;
    for version in [FmiVersion::V2, FmiVersion::V3] {
        for &causality in Causality::all(version) {
            for &variability in Variability::ALL {
                for initial in [None, Some("exact"), Some("approx"), Some("calculated")] {
                    let attribute = initial.map_or(String::new(), |i| format!(" initial=\"{i}\""));
                    let common = format!(
                        "name=\"v\" valueReference=\"9\" causality=\"{causality}\" variability=\"{variability}\"{attribute}"
                    );
                    let xml = match version {
                        FmiVersion::V2 => format!(
                            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\"><ModelExchange modelIdentifier=\"m\"/><ModelVariables><ScalarVariable {common}><Real/></ScalarVariable></ModelVariables><ModelStructure/></fmiModelDescription>"
                        ),
                        FmiVersion::V3 => format!(
                            "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"m\" instantiationToken=\"g\"><ModelExchange modelIdentifier=\"m\"/><ModelVariables><Float64 {common}/></ModelVariables><ModelStructure/></fmiModelDescription>"
                        ),
                    };
                    let is_about_combination = |finding: &Finding| {
                        matches!(
                            finding.rule,
                            Rule::CausalityVariability { .. } | Rule::InitialNotAllowed { .. }
                        )
                    };
                    let reading = read(xml.as_bytes()).unwrap();
                    let is_refused = validate(&reading).iter().any(is_about_combination);
                    let is_allowed = exists(causality, variability, version)
                        && initial
                            .is_none_or(|i| allowed(causality, variability, version).contains(&i));
                    assert_eq!(is_refused, !is_allowed, "{version}: {common}");
                    count += 1;
                }
            }
        }
    }
    assert_eq!(count, (6 + 7) * 5 * 4);
}

/// FMI rule 9: start values are there exactly where they must be.
#[test]
fn start_values() {
    for description in descriptions() {
        for variable in &description.variables {
            let must = match variable.effective_initial() {
                Some(Initial::Exact | Initial::Approx) => true,
                Some(Initial::Calculated) => false,
                None => variable.causality == Causality::Input,
            };
            assert_eq!(variable.kind.has_start(), must, "{}", variable.name);
        }
    }
    breaks(
        "<String start=\"hello\"/>",
        "<String/>",
        "the start value is missing",
    );
    breaks(
        "causality=\"independent\"><Real/>",
        "causality=\"independent\"><Real start=\"1\"/>",
        "a start value is not allowed",
    );
}

/// FMI rule 10: how numbers and booleans are written; limits; declared types of enumerations.
#[test]
fn numbers() {
    for (value, text) in [
        (f64::INFINITY, "INF"),
        (f64::NEG_INFINITY, "-INF"),
        (f64::NAN, "NaN"),
        (1e300, "1e300"),
        (0.1, "0.1"),
    ] {
        let mut description = descriptions().next().unwrap().clone();
        description.default_experiment = Some(DefaultExperiment {
            stop_time: Some(value),
            ..DefaultExperiment::default()
        });
        let xml = description.to_xml();
        assert!(xml.contains(&format!("stopTime=\"{text}\"")), "{xml}");
    }
    for bad in [
        "inf", "nan", "Infinity", "+INF", "1e", "0x1", "1_000", "1,0", ".",
    ] {
        breaks(
            "stopTime=\"1\"",
            &format!("stopTime=\"{bad}\""),
            "expected a number (xs:double)",
        );
    }
    for good in ["+1", "1.", ".5", "1E+2", " 1 "] {
        let xml = faults2::GOOD.replace("stopTime=\"1\"", &format!("stopTime=\"{good}\""));
        assert_eq!(findings(&xml), Vec::<String>::new(), "{good}");
    }
    for bad in ["True", "FALSE", "yes", "2"] {
        breaks(
            "<Boolean start=\"false\"/>",
            &format!("<Boolean start=\"{bad}\"/>"),
            "expected true or false",
        );
    }
    breaks(
        "min=\"0\" max=\"2\" start=\"1\"",
        "min=\"0\" max=\"2\" start=\"3\"",
        "start=3 is outside min=0, max=2",
    );
    breaks(
        "declaredType=\"Mode\" ",
        "",
        "lacks the attribute `declaredType`",
    );
}

/// FMI rule 11: units and display units are defined, with their base units.
#[test]
fn units() {
    for description in descriptions() {
        assert!(description.units.iter().all(|unit| unit.base.is_some()));
        let degrees = description.units.iter().filter(|unit| unit.name == "rad");
        for shown in degrees
            .flat_map(|unit| &unit.display_units)
            .filter(|d| d.name == "deg")
        {
            // From the unit to the display unit.
            assert!((shown.factor - 180.0 / std::f64::consts::PI).abs() < 1e-12);
        }
    }
    breaks(
        "unit=\"m/s\"",
        "unit=\"knot\"",
        "unit `knot` is not defined",
    );
    breaks(
        "displayUnit=\"ft\"",
        "displayUnit=\"yd\"",
        "display unit `yd` is not defined under unit `m`",
    );
}

/// FMI rule 12: what is for Model Exchange is not said without it; the spelling of the flag of
/// directional derivatives in each version.
#[test]
fn attributes_of_model_exchange() {
    for (description, text) in EXPORTED.iter() {
        let flag = match description.fmi_version {
            FmiVersion::V2 => " providesDirectionalDerivative=\"true\"",
            FmiVersion::V3 => " providesDirectionalDerivatives=\"true\"",
        };
        assert_eq!(text.matches(flag).count(), 2);
    }
    breaks(
        "start=\"0\"/></ScalarVariable>\n    <ScalarVariable name=\"der(x)\"",
        "start=\"0\" reinit=\"true\"/></ScalarVariable>\n    <ScalarVariable name=\"der(x)\"",
        "reinit is for continuous-time states of Model Exchange",
    );
    breaks(
        "causality=\"input\"",
        "causality=\"input\" canHandleMultipleSetPerTimeInstant=\"false\"",
        "is for inputs of Model Exchange",
    );
    breaks(
        "providesDirectionalDerivative=",
        "providesDirectionalDerivatives=",
        "no attribute `providesDirectionalDerivatives`",
    );
}

/// FMI rule 13: the capabilities that importers look at.
#[test]
fn capabilities() {
    for description in descriptions() {
        let cs = description.co_simulation.as_ref().unwrap();
        let me = description.model_exchange.as_ref().unwrap();
        assert!(!cs.needs_execution_tool && !me.needs_execution_tool);
        assert!(cs.can_get_and_set_fmu_state && cs.can_serialize_fmu_state);
        assert!(me.can_get_and_set_fmu_state && me.can_serialize_fmu_state);
        if description.fmi_version == FmiVersion::V2 {
            assert!(cs.can_not_use_memory_management_functions);
            assert!(me.can_not_use_memory_management_functions);
            assert!(!cs.can_run_asynchronously);
        }
    }
    breaks(
        "canGetAndSetFMUstate=\"true\" ",
        "",
        "canSerializeFMUstate=\"true\" needs canGetAndSetFMUstate=\"true\"",
    );
    breaks(
        "canGetAndSetFMUstate=\"true\" ",
        "canGetAndSetFMUstate=\"true\" needsExecutionTool=\"1\" ",
        "several tools refuse it",
    );
    breaks(
        "canGetAndSetFMUstate=\"true\" ",
        "canGetAndSetFMUstate=\"true\" canRunAsynchronously=\"false\" ",
        "no attribute `canRunAsynchronously`",
    );
}

/// FMI rule 14: outputs are listed, all and alone; derivatives say whose they are.
#[test]
fn outputs_and_derivatives() {
    for description in descriptions() {
        let structure = &description.structure;
        let listed: Vec<u32> = structure.outputs.iter().map(|u| u.index).collect();
        let outputs = (1..).zip(&description.variables);
        let outputs = outputs.filter(|(_, v)| v.causality == Causality::Output);
        let outputs: Vec<u32> = outputs.map(|(index, _)| index).collect();
        assert_eq!(listed, outputs);
        for unknown in &structure.derivatives {
            let VariableKind::Real(real) = &at(description, unknown.index).kind else {
                panic!("a derivative is a real");
            };
            assert!(real.derivative.is_some());
        }
    }
    breaks(
        "<Unknown index=\"8\" dependencies=\"\"/>",
        "",
        "<Outputs> lacks index 8, `flag`",
    );
    breaks(
        "<Unknown index=\"8\" dependencies=\"\"/>",
        "<Unknown index=\"0\" dependencies=\"\"/>",
        "<Outputs> refers to index 0",
    );
    breaks("derivative=\"5\"", "", "has no attribute `derivative`");
}

/// FMI rule 15: the initial unknowns, in ascending order and with the kinds that are allowed there.
#[test]
fn initial_unknowns() {
    for description in descriptions() {
        let structure = &description.structure;
        let listed: Vec<u32> = structure.initial_unknowns.iter().map(|u| u.index).collect();
        assert!(listed.is_sorted_by(|a, b| a < b), "{listed:?}");
        let kinds = structure.initial_unknowns.iter();
        let mut kinds = kinds.flat_map(|u| u.dependencies_kind.iter().flatten());
        assert!(kinds.all(|k| matches!(k, DependencyKind::Dependent | DependencyKind::Constant)));
    }
    let unknowns = "<Unknown index=\"6\" dependencies=\"4\"/><Unknown index=\"7\" dependencies=\"4 5\"/></InitialUnknowns>";
    for (to, message) in [
        (
            "<Unknown index=\"6\" dependencies=\"4\"/></InitialUnknowns>",
            "<InitialUnknowns> lacks index 7, `y`",
        ),
        (
            "<Unknown index=\"7\" dependencies=\"4 5\"/><Unknown index=\"6\" dependencies=\"4\"/></InitialUnknowns>",
            "expected ascending order",
        ),
        (
            "<Unknown index=\"6\" dependencies=\"4\"/><Unknown index=\"6\" dependencies=\"4\"/><Unknown index=\"7\" dependencies=\"4 5\"/></InitialUnknowns>",
            "<InitialUnknowns> has index 6 twice",
        ),
        (
            "<Unknown index=\"6\" dependencies=\"4\" dependenciesKind=\"discrete\"/><Unknown index=\"7\" dependencies=\"4 5\"/></InitialUnknowns>",
            "expected `dependent` or `constant`",
        ),
    ] {
        breaks(unknowns, to, message);
    }
}

/// FMI rule 16: dependencies are declared, sorted and on what is known; as many kinds as dependencies.
#[test]
fn dependencies() {
    for description in descriptions() {
        let structure = &description.structure;
        let lists = [
            &structure.outputs,
            &structure.derivatives,
            &structure.initial_unknowns,
        ];
        for unknown in lists.into_iter().flatten() {
            let dependencies = unknown.dependencies.as_ref().unwrap();
            assert!(dependencies.is_sorted_by(|a, b| a < b));
            if let Some(kinds) = &unknown.dependencies_kind {
                assert_eq!(kinds.len(), dependencies.len());
            }
        }
    }
    let good = "dependencies=\"4 5\" dependenciesKind=\"dependent constant\"";
    for (to, message) in [
        ("", "does not declare the dependencies"),
        ("dependencies=\"5 4\"", "not in ascending order"),
        (
            "dependencies=\"2 4\"",
            "depends on 2, `k`, which is not a known there",
        ),
        (
            "dependencies=\"4 5\" dependenciesKind=\"dependent\"",
            "2 dependencies and 1 dependenciesKind",
        ),
    ] {
        breaks(good, to, message);
    }
    // In FMI 3.0 parameters are knowns, and nothing need be in order.
    assert_eq!(findings(faults3::GOOD), Vec::<String>::new());
}

/// Every one of the 30 rules that exporters get wrong has a test that names it, `FMI rule N:`.
#[test]
fn every_rule_has_a_test_that_names_it() {
    let mut named = BTreeSet::new();
    let mut folders = vec![
        std::path::PathBuf::from("tests"),
        "src".into(),
        "fmu".into(),
    ];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(path).unwrap();
                // The words of the rule's heading up to its colon or full stop.
                for rest in text.split("/// FMI rule").skip(1) {
                    let heading = rest.split([':', '.', '\n']).next().unwrap();
                    let words = heading.split(|c: char| !c.is_ascii_digit());
                    named.extend(words.filter_map(|word| word.parse::<u32>().ok()));
                }
            }
        }
    }
    let missing: Vec<u32> = (1..=30).filter(|rule| !named.contains(rule)).collect();
    assert_eq!(missing, Vec::<u32>::new());
}
