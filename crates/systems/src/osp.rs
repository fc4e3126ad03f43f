//! Systems of the Open Simulation Platform: `OspSystemStructure.xml`, with variable groups from
//! `*_OspModelDescription.xml`. Functions become models of equations.

use crate::Foreign;
use crate::error::SspError;
use crate::package::Package;
use crate::plain::{Plain, file_from, gives};
use crate::vocabulary;
use crate::xml::{Node, Xml};
use pilotage_cosim::description::Experiment;
use pilotage_fmi::description::ModelDescription;
use pilotage_text::printable::excerpt;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_text::{file, is_identifier};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const ROOT: &str = "OspSystemStructure";

/// Inputs of a function.
const MOST: usize = 1000;

/// The file of a system: that in a folder, or the file itself.
fn file_in(path: &Path) -> PathBuf {
    match path.is_dir() {
        true => path.join(format!("{ROOT}.xml")),
        false => path.to_owned(),
    }
}

/// Whether a path is a system of OSP, by its name or its root element.
pub(crate) fn is_osp(path: &Path) -> bool {
    let path = &file_in(path);
    let is_named = (path.file_stem()).is_some_and(|own| own == ROOT) && path.is_file();
    let is_xml = (path.extension()).is_some_and(|own| own.eq_ignore_ascii_case("xml"));
    is_xml && (is_named || file::peek(path).is_ok_and(|text| text.contains(&format!("<{ROOT}"))))
}

/// What connections end at.
enum Part {
    Fmu {
        model: Arc<ModelDescription>,
        /// Groups of variables by name.
        groups: HashMap<String, Vec<String>>,
    },
    /// A function: its variables, and its groups.
    Function {
        variables: Vec<String>,
        groups: HashMap<String, Vec<String>>,
    },
}

impl Part {
    fn gives(&self, part: &str, name: &str) -> Result<bool, String> {
        match self {
            Self::Fmu { model, .. } => gives(model, part, name),
            Self::Function { variables, .. } => match variables.iter().any(|own| own == name) {
                true => Ok(name.starts_with("out")),
                false => Err(format!(
                    "`{}` has no signal `{}`; it has {}",
                    excerpt(part),
                    excerpt(name),
                    variables.join(", ")
                )),
            },
        }
    }

    fn group(&self, part: &str, name: &str) -> Result<&[String], String> {
        let (Self::Fmu { groups, .. } | Self::Function { groups, .. }) = self;
        groups.get(name).map(Vec::as_slice).ok_or_else(|| {
            let hint = did_you_mean(suggestion(name, groups.keys().map(String::as_str)));
            let (part, name) = (excerpt(part), excerpt(name));
            match (self, groups.is_empty()) {
                (Self::Fmu { model, .. }, true) => format!(
                    "`{part}` has no variable groups; they are looked for in `{}_OspModelDescription.xml`",
                    excerpt(&model.model_name)
                ),
                _ => format!("`{part}` has no variable group `{name}`{hint}"),
            }
        })
    }
}

struct Reader {
    package: Package,
    plain: Plain,
    parts: HashMap<String, Part>,
    notes: Vec<String>,
    annotations: BTreeSet<String>,
}

/// Reads a system.
pub(crate) fn read(path: &Path) -> Result<Foreign, SspError> {
    let (package, file) = Package::beside(&file_in(path));
    let (text, shown) = package.text(&file)?;
    let xml = Xml::parse(&text, &shown)?;
    let root = xml.root(ROOT)?;
    let mut reader = Reader {
        package,
        plain: Plain::default(),
        parts: HashMap::new(),
        notes: vocabulary::unknown_of_osp(root),
        annotations: BTreeSet::new(),
    };
    reader.system(root)?;
    Ok(Foreign {
        folder: reader.package.path(""),
        description: reader.plain.description,
        notes: reader.notes,
        annotations: reader.annotations.into_iter().collect(),
    })
}

impl Reader {
    fn system(&mut self, root: Node<'_, '_>) -> Result<(), SspError> {
        for own in root.listed("Simulators", "Simulator") {
            self.simulator(own)?;
        }
        if self.parts.is_empty() {
            return Err(root.fault("it has no <Simulator>; nothing is to be simulated"));
        }
        let functions = root.all("Functions").flat_map(|own| own.children());
        let functions: Vec<Node> = functions.collect();
        if !functions.is_empty() {
            self.functions(&functions)?;
        }
        for own in root.all("Connections").flat_map(|own| own.children()) {
            self.connection(own)?;
        }
        let base = number_in(root, "BaseStepSize")?;
        if let Some(own) = root
            .child("BaseStepSize")
            .filter(|_| base.is_some_and(|step| step <= 0.0))
        {
            return Err(own.fault("a communication step is above 0 s"));
        }
        self.plain.description.experiment = Experiment {
            start: number_in(root, "StartTime")?,
            stop: number_in(root, "EndTime")?,
            step: base,
        };
        let simulators = root.listed("Simulators", "Simulator");
        let mut steps = simulators.filter_map(|own| own.attribute("stepSize"));
        if steps.any(|own| own.trim().parse().ok() != base) {
            let place = root.place().file;
            self.notes.push(format!(
                "{place}: components have step sizes of their own there; here all have the same communication points"
            ));
        }
        Ok(())
    }

    fn add(&mut self, node: Node<'_, '_>, name: &str, part: Part) -> Result<(), SspError> {
        match self.parts.insert(name.to_owned(), part) {
            None => Ok(()),
            Some(_) => Err(node.fault(format!("two are named `{}`", excerpt(name)))),
        }
    }

    fn simulator(&mut self, node: Node<'_, '_>) -> Result<(), SspError> {
        let (name, source) = (node.named()?, node.required("source")?);
        let fault = |fault: String| node.fault(fault);
        let file = file_from(&self.package.path(""), source).map_err(fault)?;
        let model = self.plain.fmu(&file, source).map_err(fault)?;
        let groups = self.groups(&file, &model)?;
        self.add(node, name, Part::Fmu { model, groups })?;
        self.plain.instance(name, file, Some(node.place()), false);
        if let Some(own) = node.child("InitialValue") {
            return Err(own.fault("it stands in <InitialValues>"));
        }
        for own in node.listed("InitialValues", "InitialValue") {
            let variable = own.required("variable")?;
            let kind = own.children().next();
            let kind =
                kind.ok_or_else(|| own.fault("it has no value, such as <Real value=\"1\"/>"))?;
            let (full, value) = (format!("{name}.{variable}"), kind.required("value")?);
            self.plain.set(full, value.to_owned(), Some(own.place()));
        }
        Ok(())
    }

    /// The variable groups of an FMU: in a file named after its model or its file, beside the system or beside the FMU.
    fn groups(
        &self,
        fmu: &Path,
        model: &ModelDescription,
    ) -> Result<HashMap<String, Vec<String>>, SspError> {
        let stem = fmu.file_stem().unwrap_or_default().to_string_lossy();
        let beside = fmu.parent().unwrap_or(Path::new(""));
        let mut groups = HashMap::new();
        for folder in [&*self.package.path(""), beside] {
            for name in [&*model.model_name, &*stem] {
                let file = format!("{name}_OspModelDescription.xml");
                if name.contains(['/', '\\', '\0']) || !folder.join(&file).is_file() {
                    continue;
                }
                let (package, file) = Package::beside(&folder.join(file));
                let (text, shown) = package.text(&file)?;
                let xml = Xml::parse(&text, &shown)?;
                let root = xml.root("OspModelDescription")?;
                for list in root.all("VariableGroups") {
                    list.children().for_each(|own| gather(own, &mut groups));
                }
                return Ok(groups);
            }
        }
        Ok(groups)
    }

    /// Functions as models in files of their own.
    fn functions(&mut self, functions: &[Node<'_, '_>]) -> Result<(), SspError> {
        let unwritten = |source| SspError::Read {
            file: "a folder for functions".to_owned(),
            source,
        };
        let folder = tempfile::tempdir().map_err(unwritten)?;
        for (k, own) in functions.iter().enumerate() {
            let name = own.named()?;
            let function = Function::of(*own)?;
            let stem = match is_identifier(name) {
                true => name.to_owned(),
                false => k.to_string(),
            };
            let file = folder.path().join(stem + ".toml");
            fs::write(&file, &function.text).map_err(unwritten)?;
            let (variables, groups) = (function.variables, function.groups);
            self.add(*own, name, Part::Function { variables, groups })?;
            // Its signals are computed as values are exchanged.
            self.plain.instance(name, file, Some(own.place()), true);
        }
        self.plain.description.kept.push(folder);
        Ok(())
    }

    fn connection(&mut self, node: Node<'_, '_>) -> Result<(), SspError> {
        let mut ends = Vec::new();
        for end in node.children() {
            let owner = match end.name() {
                "Variable" | "VariableGroup" => end.required("simulator")?,
                "Signal" | "SignalGroup" => end.required("function")?,
                _ => {
                    return Err(end
                        .fault("expected <Variable>, <VariableGroup>, <Signal> or <SignalGroup>"));
                }
            };
            let part = self.parts.get(owner).ok_or_else(|| {
                let hint = did_you_mean(suggestion(owner, self.parts.keys().map(String::as_str)));
                end.fault(format!("there is no `{}`{hint}", excerpt(owner)))
            })?;
            let name = signal(end.named()?, part);
            let names = match end.name().ends_with("Group") {
                true => (part.group(owner, &name).map_err(|fault| end.fault(fault))?).to_vec(),
                false => vec![name],
            };
            let flows = names.iter().map(|name| part.gives(owner, name));
            let flows: Result<Vec<bool>, String> = flows.collect();
            let flows = flows.map_err(|fault| end.fault(fault))?;
            let full = names.iter().map(|name| format!("{owner}.{name}"));
            ends.push(full.zip(flows).collect::<Vec<(String, bool)>>());
        }
        let [a, b] = <[_; 2]>::try_from(ends)
            .map_err(|ends| node.fault(format!("it has {} ends; expected 2", ends.len())))?;
        if a.len() != b.len() {
            let (a, b) = (a.len(), b.len());
            return Err(node.fault(format!("one end has {a} variables, the other {b}")));
        }
        for ((a, a_gives), (b, b_gives)) in a.into_iter().zip(b) {
            let (from, to) = match (a_gives, b_gives) {
                (true, false) => (a, b),
                (false, true) => (b, a),
                (true, true) => return Err(node.fault(format!("`{a}` and `{b}` are both outputs"))),
                (false, false) => {
                    return Err(node.fault(format!("`{a}` and `{b}` are both inputs")));
                }
            };
            self.plain.wire(from, to, Some(node.place()));
        }
        Ok(())
    }
}

/// A signal of a function under the name of its variable: `in[0][2]` is `in_0_2`. Names of an FMU's variables stay.
fn signal(name: &str, part: &Part) -> String {
    match part {
        Part::Fmu { .. } => name.to_owned(),
        Part::Function { .. } => name.replace('[', "_").replace(']', ""),
    }
}

/// Variables of a group and of those in it. Both ends of a connection name the groups of a port by kind (force, velocity),
/// in any order.
fn gather(node: Node<'_, '_>, groups: &mut HashMap<String, Vec<String>>) {
    if let Some(name) = node.attribute("name") {
        groups.insert(name.to_owned(), variables(node));
    }
    for own in node.children().filter(|own| own.name() != "Variable") {
        gather(own, groups);
    }
}

fn variables(node: Node<'_, '_>) -> Vec<String> {
    let own = node.all("Variable").filter_map(|own| own.attribute("ref"));
    let mut all: Vec<String> = own.map(str::to_owned).collect();
    let mut inner: Vec<Node> = (node.children().filter(|own| own.name() != "Variable")).collect();
    inner.sort_by_key(|own| own.name());
    all.extend(inner.into_iter().flat_map(variables));
    all
}

/// A function as a model.
struct Function {
    text: String,
    variables: Vec<String>,
    groups: HashMap<String, Vec<String>>,
}

impl Function {
    fn of(node: Node<'_, '_>) -> Result<Self, SspError> {
        let count = |name| {
            let text = node.required(name)?;
            let count = text.trim().parse().ok();
            let count = count.filter(|own| (1..=MOST).contains(own));
            count.ok_or_else(|| {
                let text = excerpt(text);
                node.fault(format!("`{name}` is `{text}`; expected 1 to {MOST}"))
            })
        };
        let sums = |inputs: usize, dimension: Option<usize>| {
            let ends = match dimension {
                None => vec![String::new()],
                Some(dimension) => (0..dimension).map(|d| format!("_{d}")).collect(),
            };
            let group = |begin: String| -> (String, Vec<String>) {
                let all = ends.iter().map(|end| format!("{begin}{end}")).collect();
                (begin, all)
            };
            let into = (0..inputs).map(|k| group(format!("in_{k}")));
            let groups: Vec<(String, Vec<String>)> =
                into.chain([group("out".to_owned())]).collect();
            let value = |d: usize| {
                let all: Vec<&str> = groups[..inputs].iter().map(|(_, own)| &*own[d]).collect();
                all.join(" + ")
            };
            let outputs = (0..ends.len()).map(|d| (groups[inputs].1[d].clone(), value(d)));
            (outputs.collect::<Vec<_>>(), groups)
        };
        let mut parameters = String::new();
        let (outputs, groups) = match node.name() {
            "Sum" => sums(count("inputCount")?, None),
            "VectorSum" => {
                let (inputs, dimension) = (count("inputCount")?, count("dimension")?);
                if inputs * dimension > MOST {
                    return Err(node.fault(format!("more than {MOST} inputs")));
                }
                sums(inputs, Some(dimension))
            }
            "LinearTransformation" => {
                for (name, default) in [("factor", 1.0), ("offset", 0.0)] {
                    let start = node.number(name, default)?;
                    let _ = writeln!(parameters, "{name} = {{ start = {start:?} }}");
                }
                let value = "factor * in + offset".to_owned();
                let groups = ["in", "out"].map(|own| (own.to_owned(), vec![own.to_owned()]));
                (vec![("out".to_owned(), value)], groups.to_vec())
            }
            _ => return Err(node.fault("expected <LinearTransformation>, <Sum> or <VectorSum>")),
        };
        let mut text = format!("[model]\nname = \"{}\"\n[inputs]\n", node.name());
        let variables: Vec<String> = groups.iter().flat_map(|(_, own)| own.clone()).collect();
        for own in variables.iter().filter(|own| own.starts_with("in")) {
            let _ = writeln!(text, "{own} = {{}}");
        }
        let _ = write!(text, "[parameters]\n{parameters}[outputs]\n");
        for (name, value) in outputs {
            let _ = writeln!(text, "{name} = {{ value = \"{value}\" }}");
        }
        let groups = groups.into_iter().collect();
        Ok(Self {
            text,
            variables,
            groups,
        })
    }
}

fn number_in(root: Node<'_, '_>, name: &'static str) -> Result<Option<f64>, SspError> {
    let Some(own) = root.child(name) else {
        return Ok(None);
    };
    let number = own.text().trim().parse().ok();
    let number = number.filter(|own: &f64| own.is_finite());
    let wrong = || own.fault(format!("`{}` is no number", excerpt(own.text())));
    number.map(Some).ok_or_else(wrong)
}
