//! Reads a tree of systems (section 5).

use crate::error::{At, SspError};
use crate::package::{Package, file_of};
use crate::parameters::bindings;
use crate::tree::{
    Component, Connection, Connector, Dictionary, Element, End, Flow, Reference, Root, System,
};
use crate::units::Units;
use crate::vocabulary;
use crate::xml::{Node, Xml};
use pilotage_cosim::description::{Experiment, Interface, Kept};
use pilotage_fmi::Fmu;
use pilotage_fmi::description::ModelDescription;
use pilotage_text::error_chain::error_chain;
use pilotage_text::printable::excerpt;
use pilotage_units::Unit;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Systems in systems.
const DEEPEST: usize = 40;

/// Elements of a system with all that it refers to: a system that is referred to twice counts twice.
const MOST: usize = 100_000;

/// What is known beside the tree.
pub(crate) struct Reader {
    pub(crate) notes: Vec<String>,
    pub(crate) annotations: BTreeSet<String>,
    pub(crate) kept: Kept,
    /// Names without a counterpart, by file.
    lost: Vec<(String, Vec<String>)>,
    fmus: HashMap<PathBuf, Arc<ModelDescription>>,
    count: usize,
}

/// Where something is read: the files, the units of this one, and how deep it lies.
#[derive(Clone, Copy)]
struct Context<'a> {
    package: &'a Package,
    units: &'a Units,
    depth: usize,
}

impl Reader {
    pub(crate) fn new(kept: Kept) -> Self {
        Self {
            notes: Vec::new(),
            annotations: BTreeSet::new(),
            kept,
            lost: Vec::new(),
            fmus: HashMap::new(),
            count: 0,
        }
    }

    pub(crate) fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Remembers a name that matches nothing.
    pub(crate) fn unmatched(&mut self, at: &At, name: &str) {
        let file = &at.place.file;
        let name = format!("`{}`", excerpt(name));
        match self.lost.iter_mut().find(|(own, _)| own == file) {
            Some((_, names)) => names.push(name),
            None => self.lost.push((file.clone(), vec![name])),
        }
    }

    /// The notes, with one for each file whose names match nothing.
    pub(crate) fn into_notes(mut self) -> Vec<String> {
        const SHOWN: usize = 3;
        for (file, names) in std::mem::take(&mut self.lost) {
            let shown = names[..names.len().min(SHOWN)].join(", ");
            let more = match names.len().saturating_sub(SHOWN) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            self.note(format!(
                "{file}: {shown}{more}: no such name here; left out"
            ));
        }
        self.notes
    }

    /// Notes what is not looked at: annotations, and names that are not in the standard.
    pub(crate) fn note_others(&mut self, node: Node<'_, '_>) {
        self.annotations
            .extend(node.annotations().map(str::to_owned));
        for note in vocabulary::unknown(node) {
            self.note(note);
        }
    }

    /// Refuses versions that did not exist when this was written.
    pub(crate) fn expect_version(&mut self, node: Node<'_, '_>) -> Result<(), SspError> {
        let version = node.attribute("version").unwrap_or("1.0");
        match version.split(['.', '-']).next() {
            Some("1" | "2") => Ok(()),
            _ => Err(node.fault(format!(
                "the version is `{}`; 1.0 and 2.0 are known",
                excerpt(version)
            ))),
        }
    }

    /// The unit that a type names.
    pub(crate) fn unit(&mut self, units: &Units, kind: Node<'_, '_>) -> Option<Unit> {
        let name = kind.attribute("unit");
        let unit = units.find(name);
        if let (None, Some(name)) = (&unit, name.filter(|name| !["", "None"].contains(name))) {
            let file = kind.place().file;
            self.note(format!(
                "{file}: the unit `{}` is not defined; values in it are not converted",
                excerpt(name)
            ));
        }
        unit
    }

    /// Reads an `.ssd` as the root.
    pub(crate) fn root(&mut self, package: &Package, file: &str) -> Result<Root, SspError> {
        self.structure(package, file, 0)
    }

    fn structure(&mut self, package: &Package, file: &str, depth: usize) -> Result<Root, SspError> {
        let (text, shown) = package.text(file)?;
        let xml = Xml::parse(&text, &shown)?;
        let root = xml.root("SystemStructureDescription")?;
        self.expect_version(root)?;
        self.note_others(root);
        let units = &Units::read(root)?;
        let system = root.child("System");
        let system = system.ok_or_else(|| root.fault("it has no <System>"))?;
        let mut experiment = match root.child("DefaultExperiment") {
            Some(own) => Experiment {
                start: time(own, "startTime")?,
                stop: time(own, "stopTime")?,
                step: None,
            },
            None => Experiment::default(),
        };
        experiment.step = self.tools_step(root, system);
        let context = Context {
            package,
            units,
            depth,
        };
        Ok(Root {
            at: system.at("System"),
            system: self.system(context, system)?,
            experiment,
        })
    }

    /// The communication step in the annotations of a tool: OMSimulator writes it in those of the system, libcosim and Ecos read
    /// it from those of the default experiment. The standard has none.
    fn tools_step(&mut self, root: Node<'_, '_>, system: Node<'_, '_>) -> Option<f64> {
        const PLACES: [[&str; 2]; 2] = [
            ["FixedStepMaster", "stepSize"],
            ["FixedStepAlgorithm", "baseStepSize"],
        ];
        for own in [Some(system), root.child("DefaultExperiment")]
            .into_iter()
            .flatten()
        {
            let mut annotations = own.all("Annotations");
            let annotated = annotations.find_map(|own| {
                PLACES.iter().find_map(|[element, attribute]| {
                    let node = own.below(element)?;
                    Some((node, node.attribute(attribute)?))
                })
            });
            let Some((node, text)) = annotated else {
                continue;
            };
            let step = text.trim().parse().ok();
            match step.filter(|step: &f64| step.is_finite() && *step > 0.0) {
                Some(step) => return Some(step),
                None => self.note(format!(
                    "{}: <{}>: `{}` is no communication step; ignored",
                    node.place(),
                    node.name(),
                    excerpt(text)
                )),
            }
        }
        None
    }

    fn system(&mut self, context: Context<'_>, node: Node<'_, '_>) -> Result<System, SspError> {
        if context.depth > DEEPEST {
            return Err(node.fault(format!(
                "systems are nested deeper than {DEEPEST} levels, perhaps in themselves"
            )));
        }
        let inner = Context {
            depth: context.depth + 1,
            ..context
        };
        let (mut elements, mut names) = (Vec::new(), HashSet::new());
        for own in node
            .all("Elements")
            .flat_map(|list| list.children().collect::<Vec<_>>())
        {
            self.count += 1;
            if self.count > MOST {
                return Err(own.fault(format!("there are more than {MOST} elements")));
            }
            // Names are unique within a system (section 5.3.1).
            if let Some(name) = own.attribute("name").filter(|name| !names.insert(*name)) {
                return Err(own.fault(format!("two elements are named `{}`", excerpt(name))));
            }
            match own.name() {
                "Component" => elements.push(self.component(inner, own)?),
                "System" => {
                    own.named()?;
                    elements.push(Element::System(self.system(inner, own)?));
                }
                "SignalDictionaryReference" => elements.push(Element::Reference(Reference {
                    at: own.at("SignalDictionaryReference"),
                    name: own.named()?.to_owned(),
                    dictionary: own.required("dictionary")?.to_owned(),
                    connectors: self.connectors(context, own)?,
                })),
                _ => {
                    return Err(
                        own.fault("expected <Component>, <System> or <SignalDictionaryReference>")
                    );
                }
            }
        }
        let mut connections = Vec::new();
        for own in node.listed("Connections", "Connection") {
            connections.push(connection(own)?);
        }
        let mut dictionaries = Vec::new();
        for own in node.listed("SignalDictionaries", "SignalDictionary") {
            dictionaries.push(self.dictionary(context, own)?);
        }
        Ok(System {
            // The root's name is in no other name, and some tools leave it out.
            name: node.attribute("name").unwrap_or_default().to_owned(),
            connectors: self.connectors(context, node)?,
            elements,
            connections,
            dictionaries,
            parameters: bindings(self, context.package, node, None)?,
        })
    }

    /// A component: an FMU, or another system (section 5.4).
    fn component(&mut self, context: Context<'_>, node: Node<'_, '_>) -> Result<Element, SspError> {
        let name = node.named()?.to_owned();
        let Some(source) = node.attribute("source") else {
            let place = node.place();
            self.note(format!(
                "{place}: `{}` has no source; nothing computes its outputs",
                excerpt(&name)
            ));
            return Ok(Element::System(System {
                name,
                connectors: self.connectors(context, node)?,
                elements: Vec::new(),
                connections: Vec::new(),
                dictionaries: Vec::new(),
                parameters: bindings(self, context.package, node, None)?,
            }));
        };
        let (file, fragment) = file_of(source).map_err(|fault| node.fault(fault))?;
        let kind = node
            .attribute("type")
            .unwrap_or("application/x-fmu-sharedlibrary");
        let is = |ending: &str| file.to_ascii_lowercase().ends_with(ending);
        let is_system = kind.starts_with("application/x-ssp-") || is(".ssp") || is(".ssd");
        if is_system || (file.is_empty() && fragment.is_some()) {
            return self
                .referred(context, node, &file, fragment)
                .map(Element::System);
        }
        if kind != "application/x-fmu-sharedlibrary" {
            return Err(node.fault(format!(
                "`{}` cannot be simulated; only FMUs and systems can",
                excerpt(kind)
            )));
        }
        let path = context.package.path(&file);
        let fmu = self.fmu(node, &file, &path)?;
        Ok(Element::Component(Component {
            at: node.at("Component"),
            name,
            fmu,
            interface: interface(node)?,
            connectors: self.connectors(context, node)?,
            parameters: bindings(self, context.package, node, Some(&path))?,
            file: path,
        }))
    }

    /// The description of an FMU, read once.
    fn fmu(
        &mut self,
        node: Node<'_, '_>,
        file: &str,
        path: &Path,
    ) -> Result<Arc<ModelDescription>, SspError> {
        if let Some(known) = self.fmus.get(path) {
            return Ok(known.clone());
        }
        if file.is_empty() || !path.exists() {
            return Err(node.fault(format!("there is no file `{}`", excerpt(file))));
        }
        let fmu = Fmu::open(path).map_err(|error| {
            // The unpacked file is not the user's.
            let words = error_chain(&error).replace(&*path.to_string_lossy(), file);
            node.fault(words)
        })?;
        self.fmus.insert(path.to_owned(), fmu.description().clone());
        Ok(fmu.description().clone())
    }

    /// The system of another file or element, under the name of the component that refers to it. Bindings of the component
    /// come after those of the system (section 5.2.3).
    fn referred(
        &mut self,
        context: Context<'_>,
        node: Node<'_, '_>,
        file: &str,
        fragment: Option<&str>,
    ) -> Result<System, SspError> {
        let depth = context.depth;
        if depth > DEEPEST {
            return Err(node.fault(format!(
                "systems are nested deeper than {DEEPEST} levels, perhaps in themselves"
            )));
        }
        let mut system = match (file, fragment) {
            ("", Some(id)) => {
                let other = node.system_of_id(id);
                let missing = || {
                    node.fault(format!(
                        "there is no <System> with the id `{}`",
                        excerpt(id)
                    ))
                };
                self.system(context, other.ok_or_else(missing)?)?
            }
            _ => {
                let inner = context.package.inner(file, fragment);
                let (package, name, kept) =
                    inner.map_err(|error| node.fault(error_chain(&error)))?;
                self.kept.push(kept);
                self.structure(&package, &name, depth)?.system
            }
        };
        system.name = node.named()?.to_owned();
        for own in self.connectors(context, node)? {
            if system.connectors.iter().all(|known| known.name != own.name) {
                system.connectors.push(own);
            }
        }
        system
            .parameters
            .extend(bindings(self, context.package, node, None)?);
        Ok(system)
    }

    fn connectors(
        &mut self,
        context: Context<'_>,
        node: Node<'_, '_>,
    ) -> Result<Vec<Connector>, SspError> {
        let mut all = Vec::new();
        for own in node.listed("Connectors", "Connector") {
            let flow = match own.attribute("kind") {
                Some("input" | "parameter" | "structuralParameter") => Flow::In,
                Some("output" | "calculatedParameter" | "constant" | "local") => Flow::Out,
                None | Some("inout" | "unspecified") => Flow::Any,
                Some(other) => {
                    return Err(own.fault(format!("the kind `{}` is not known", excerpt(other))));
                }
            };
            let kind = own
                .children()
                .find(|child| child.attribute("unit").is_some());
            all.push(Connector {
                at: own.at("Connector"),
                name: own.named()?.to_owned(),
                flow,
                unit: kind.and_then(|kind| self.unit(context.units, kind)),
            });
        }
        Ok(all)
    }

    /// A signal dictionary, here or in a file of its own (sections 5.3.3 and 8).
    fn dictionary(
        &mut self,
        context: Context<'_>,
        node: Node<'_, '_>,
    ) -> Result<Dictionary, SspError> {
        let name = node.named()?.to_owned();
        let entries = match node.attribute("source") {
            Some(uri) => {
                let (file, _) = file_of(uri).map_err(|fault| node.fault(fault))?;
                if !context.package.path(&file).is_file() {
                    return Err(node.fault(format!("there is no file `{}`", excerpt(&file))));
                }
                let (text, shown) = context.package.text(&file)?;
                let xml = Xml::parse(&text, &shown)?;
                self.signals(xml.root("SignalDictionary")?)?
            }
            None => {
                let inline = node.child("SignalDictionary");
                self.signals(inline.ok_or_else(|| node.fault("neither `source` nor entries"))?)?
            }
        };
        Ok(Dictionary { name, entries })
    }

    fn signals(&mut self, node: Node<'_, '_>) -> Result<Vec<(String, Option<Unit>)>, SspError> {
        self.expect_version(node)?;
        self.note_others(node);
        let units = Units::read(node)?;
        let mut entries = Vec::new();
        for entry in node.all("DictionaryEntry") {
            let kind = entry
                .children()
                .find(|child| child.attribute("unit").is_some());
            let unit = kind.and_then(|kind| self.unit(&units, kind));
            entries.push((entry.named()?.to_owned(), unit));
        }
        Ok(entries)
    }
}

fn time(node: Node<'_, '_>, name: &str) -> Result<Option<f64>, SspError> {
    match node.attribute(name) {
        Some(_) => node.number(name, 0.0).map(Some),
        None => Ok(None),
    }
}

fn interface(node: Node<'_, '_>) -> Result<Option<Interface>, SspError> {
    match node.attribute("implementation") {
        None | Some("any") => Ok(None),
        Some("CoSimulation") => Ok(Some(Interface::CoSimulation)),
        Some("ModelExchange") => Ok(Some(Interface::ModelExchange)),
        Some(other) => {
            let other = excerpt(other);
            Err(node.fault(format!(
                "the implementation `{other}` cannot be used; CoSimulation, ModelExchange and any can"
            )))
        }
    }
}

fn connection(node: Node<'_, '_>) -> Result<Connection, SspError> {
    let end = |which: &str| -> Result<End, SspError> {
        let connector = node.required(&format!("{which}Connector"))?.to_owned();
        let index = match node.attribute(&format!("{which}Indices")) {
            Some(text) => index(node, text)?,
            None => String::new(),
        };
        Ok(End {
            element: node
                .attribute(&format!("{which}Element"))
                .map(str::to_owned),
            connector,
            index,
        })
    };
    Ok(Connection {
        at: node.at("Connection"),
        ends: [end("start")?, end("end")?],
        step: node.transformation()?,
    })
}

/// The indices of an array's element as in names of variables: `[1,2]`. The standard does not say from where they count; as
/// those of names, they count from 1.
fn index(node: Node<'_, '_>, text: &str) -> Result<String, SspError> {
    let places: Vec<&str> = text.split_whitespace().collect();
    let is_good = |place: &&str| place.parse::<u32>().is_ok_and(|place| place > 0);
    match !places.is_empty() && places.iter().all(is_good) {
        true => Ok(format!("[{}]", places.join(","))),
        false => Err(node.fault(format!(
            "`{}` are no indices; expected numbers from 1",
            excerpt(text)
        ))),
    }
}
