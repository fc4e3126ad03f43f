//! Reads a modelDescription.xml.
//!
//! Reading gathers findings instead of stopping at the first; [`Reading::into_usable`] is for those who
//! want to run the FMU and not to judge the file.

use super::element::{Context, Element};
use super::text::decode;
use super::*;

/// Reads the bytes of a modelDescription.xml.
///
/// # Errors
/// If it is no XML, or not of FMI 2.0. All else is in [`Reading::findings`].
pub fn read(bytes: &[u8]) -> Result<Reading, ReadError> {
    let text = decode(bytes)?;
    let document = roxmltree::Document::parse(&text)?;
    let context = Context::new(&text);
    let root = context.element(document.root_element());
    if root.name() != "fmiModelDescription" {
        return Err(ReadError::WrongRoot {
            place: root.place(),
            found: root.name().to_owned(),
        });
    }
    check_version(&root)?;
    let mut places = Places::new(root.place());
    let description = read_root(&root, &mut places);
    drop(root);
    Ok(Reading {
        description,
        places,
        findings: context.findings.into_inner(),
    })
}

fn check_version(root: &Element) -> Result<(), ReadError> {
    match root.required_text("fmiVersion").as_str() {
        // Absent: already reported.
        "2.0" | "" => Ok(()),
        found if found.starts_with("2.") => {
            root.report(Rule::FmiVersion {
                found: found.to_owned(),
            });
            Ok(())
        }
        found => Err(ReadError::WrongVersion {
            found: found.to_owned(),
        }),
    }
}

/// Children of the root in the schema's order.
const ROOT_CHILDREN: [&str; 9] = [
    "ModelExchange",
    "CoSimulation",
    "UnitDefinitions",
    "TypeDefinitions",
    "LogCategories",
    "DefaultExperiment",
    "VendorAnnotations",
    "ModelVariables",
    "ModelStructure",
];

fn read_root(root: &Element, places: &mut Places) -> ModelDescription {
    let mut description = ModelDescription {
        model_name: root.required_text("modelName"),
        guid: root.required_text("guid"),
        description: root.text("description"),
        author: root.text("author"),
        version: root.text("version"),
        copyright: root.text("copyright"),
        license: root.text("license"),
        generation_tool: root.text("generationTool"),
        generation_date_and_time: root.text("generationDateAndTime"),
        naming_convention: root
            .parsed(
                "variableNamingConvention",
                "flat or structured",
                NamingConvention::parse,
            )
            .unwrap_or_default(),
        number_of_event_indicators: root.unsigned("numberOfEventIndicators"),
        ..ModelDescription::default()
    };
    root.finish();
    let mut last = 0;
    let mut seen = [false; ROOT_CHILDREN.len()];
    for child in root.children() {
        let Some(position) = ROOT_CHILDREN.iter().position(|n| *n == child.name()) else {
            child.unexpected();
            continue;
        };
        if position < last {
            child.report(Rule::MisplacedElement {
                element: child.name().to_owned(),
                after: ROOT_CHILDREN[last].to_owned(),
            });
        }
        if std::mem::replace(&mut seen[position], true) {
            child.unexpected();
            continue;
        }
        last = last.max(position);
        read_root_child(&child, &mut description, places);
    }
    for required in ["ModelVariables", "ModelStructure"] {
        let position = ROOT_CHILDREN.iter().position(|n| *n == required);
        if position.is_some_and(|p| !seen[p]) {
            root.report(Rule::MissingElement {
                parent: root.name().to_owned(),
                element: required,
            });
        }
    }
    description
}

fn read_root_child(child: &Element, into: &mut ModelDescription, places: &mut Places) {
    match child.name() {
        "ModelExchange" => {
            places.model_exchange = child.place();
            into.model_exchange = Some(read_model_exchange(child));
        }
        "CoSimulation" => {
            places.co_simulation = child.place();
            into.co_simulation = Some(read_co_simulation(child));
        }
        "UnitDefinitions" => {
            into.units = read_list(child, "Unit", &mut places.units, read_types::unit);
        }
        "TypeDefinitions" => {
            let places = &mut places.types;
            into.types = read_list(child, "SimpleType", places, read_types::simple_type);
        }
        "LogCategories" => {
            let places = &mut places.log_categories;
            into.log_categories = read_list(child, "Category", places, |e| LogCategory {
                name: e.required_text("name"),
                description: e.text("description"),
            });
        }
        "DefaultExperiment" => {
            places.default_experiment = child.place();
            into.default_experiment = Some(DefaultExperiment {
                start_time: child.real("startTime"),
                stop_time: child.real("stopTime"),
                tolerance: child.real("tolerance"),
                step_size: child.real("stepSize"),
            });
            child.finish();
        }
        "VendorAnnotations" => into.vendor_annotations = read_tools(child),
        "ModelVariables" => {
            let places = &mut places.variables;
            into.variables = read_list(child, "ScalarVariable", places, read_variable::variable);
        }
        _ => {
            places.structure = child.place();
            into.structure = read_structure(child, places);
        }
    }
}

/// The items of a list element, which must not be empty.
fn read_list<T>(
    list: &Element,
    name: &'static str,
    places: &mut Vec<Place>,
    read: impl Fn(&Element) -> T,
) -> Vec<T> {
    list.finish();
    let elements = list.children_named(name);
    if elements.is_empty() {
        list.report(Rule::EmptyElement {
            element: list.name().to_owned(),
        });
    }
    places.extend(elements.iter().map(Element::place));
    let read_one = |element: &Element| {
        let value = read(element);
        element.finish();
        value
    };
    elements.iter().map(read_one).collect()
}

/// `<Tool>` annotations; their content is not ours to judge.
pub(super) fn read_tools(list: &Element) -> Vec<Tool> {
    read_list(list, "Tool", &mut Vec::new(), |e| Tool {
        name: e.required_text("name"),
        content: e.inner_xml().to_owned(),
    })
}

fn read_co_simulation(e: &Element) -> CoSimulation {
    let value = CoSimulation {
        model_identifier: e.required_text("modelIdentifier"),
        needs_execution_tool: e.flag("needsExecutionTool"),
        can_handle_variable_communication_step_size: e
            .flag("canHandleVariableCommunicationStepSize"),
        can_interpolate_inputs: e.flag("canInterpolateInputs"),
        max_output_derivative_order: e.unsigned("maxOutputDerivativeOrder").unwrap_or(0),
        can_run_asynchronously: e.flag("canRunAsynchronuously"),
        can_be_instantiated_only_once_per_process: e.flag("canBeInstantiatedOnlyOncePerProcess"),
        can_not_use_memory_management_functions: e.flag("canNotUseMemoryManagementFunctions"),
        can_get_and_set_fmu_state: e.flag("canGetAndSetFMUstate"),
        can_serialize_fmu_state: e.flag("canSerializeFMUstate"),
        provides_directional_derivative: e.flag("providesDirectionalDerivative"),
        source_files: read_source_files(e),
    };
    e.finish();
    value
}

fn read_model_exchange(e: &Element) -> ModelExchange {
    let value = ModelExchange {
        model_identifier: e.required_text("modelIdentifier"),
        needs_execution_tool: e.flag("needsExecutionTool"),
        completed_integrator_step_not_needed: e.flag("completedIntegratorStepNotNeeded"),
        can_be_instantiated_only_once_per_process: e.flag("canBeInstantiatedOnlyOncePerProcess"),
        can_not_use_memory_management_functions: e.flag("canNotUseMemoryManagementFunctions"),
        can_get_and_set_fmu_state: e.flag("canGetAndSetFMUstate"),
        can_serialize_fmu_state: e.flag("canSerializeFMUstate"),
        provides_directional_derivative: e.flag("providesDirectionalDerivative"),
        source_files: read_source_files(e),
    };
    e.finish();
    value
}

fn read_source_files(parent: &Element) -> Vec<String> {
    let lists = parent.children_named("SourceFiles");
    let files = lists
        .iter()
        .flat_map(|list| read_list(list, "File", &mut Vec::new(), |e| e.required_text("name")));
    files.collect()
}

fn read_structure(e: &Element, places: &mut Places) -> ModelStructure {
    let mut structure = ModelStructure::default();
    for list in e.children() {
        let (unknowns, places) = match list.name() {
            "Outputs" => (&mut structure.outputs, &mut places.outputs),
            "Derivatives" => (&mut structure.derivatives, &mut places.derivatives),
            "InitialUnknowns" => (
                &mut structure.initial_unknowns,
                &mut places.initial_unknowns,
            ),
            _ => {
                list.unexpected();
                continue;
            }
        };
        unknowns.extend(read_list(&list, "Unknown", places, read_unknown));
    }
    e.finish();
    structure
}

fn read_unknown(e: &Element) -> Unknown {
    let indices = |text: &str| text.split_whitespace().map(|w| w.parse().ok()).collect();
    let kinds = |text: &str| text.split_whitespace().map(DependencyKind::parse).collect();
    Unknown {
        index: e.required("index", e.unsigned("index")).unwrap_or(0),
        dependencies: e.parsed("dependencies", "a list of indices", indices),
        dependencies_kind: e.parsed(
            "dependenciesKind",
            "a list of dependent, constant, fixed, tunable and discrete",
            kinds,
        ),
    }
}
