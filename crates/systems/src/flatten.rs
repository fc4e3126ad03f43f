//! Makes a description of a tree: components get the names of the systems around them, connections become wires, and values
//! are applied to variables (section 5.2.3: outer bindings before inner ones, later before earlier ones).

use crate::Foreign;
use crate::error::{At, SspError};
use crate::read::Reader;
use crate::tree::{
    Component, Connection, Connector, Element, End, Entry, Flow, Reference, Root, System,
};
use crate::variables::Variables;
use crate::wiring::{Graph, Key, Leg, Owner, composite, composite_map, mapped_value};
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::{InstanceDescription, InstanceSource, Setting, Spanned, Wire};
use pilotage_fmi::description::Causality;
use pilotage_text::printable::excerpt;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_units::Unit;
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

/// Makes a description of a tree.
pub(crate) fn flatten(root: Root, reader: Reader) -> Result<Foreign, SspError> {
    let mut flat = Flat {
        reader,
        description: SystemDescription::default(),
        graph: Graph::default(),
        components: Vec::new(),
        variables: HashMap::new(),
        names: HashMap::new(),
        systems: Vec::new(),
        dictionaries: Vec::new(),
        scope: Vec::new(),
        settings: Vec::new(),
        set: HashMap::new(),
        given: HashMap::new(),
    };
    flat.system(&root.system, "")?;
    if flat.description.instances.is_empty() {
        return Err(root
            .at
            .fault("no component has an FMU; nothing is to be simulated"));
    }
    flat.wire()?;
    flat.description.experiment = root.experiment;
    flat.description.kept = flat.reader.kept.clone();
    let annotations = flat.reader.annotations.iter().cloned().collect();
    Ok(Foreign {
        description: flat.description,
        notes: flat.reader.into_notes(),
        annotations,
        folder: PathBuf::new(),
    })
}

/// Connectors of an element as its system sees them.
struct Seen<'a> {
    owner: Owner,
    connectors: HashMap<&'a str, &'a Connector>,
}

/// A description that is being made.
pub(crate) struct Flat {
    pub(crate) reader: Reader,
    pub(crate) description: SystemDescription,
    pub(crate) graph: Graph,
    pub(crate) components: Vec<Arc<Variables>>,
    pub(crate) variables: HashMap<PathBuf, Arc<Variables>>,
    /// Owners by full name.
    pub(crate) names: HashMap<String, Owner>,
    /// For each system the names of its connectors.
    pub(crate) systems: Vec<HashSet<String>>,
    /// For each dictionary its entries.
    pub(crate) dictionaries: Vec<HashMap<String, Option<Unit>>>,
    /// The dictionaries that a system sees.
    pub(crate) scope: Vec<(String, usize)>,
    /// Values of variables with the numbers of their components, and their positions by name.
    pub(crate) settings: Vec<(usize, Setting)>,
    pub(crate) set: HashMap<String, usize>,
    /// Values of connectors of systems.
    pub(crate) given: HashMap<Key, Entry>,
}

pub(crate) fn joined(path: &str, name: &str) -> String {
    match path {
        "" => name.to_owned(),
        _ => format!("{path}.{name}"),
    }
}

fn by_name(connectors: &[Connector]) -> HashMap<&str, &Connector> {
    connectors
        .iter()
        .map(|own| (own.name.as_str(), own))
        .collect()
}

impl Flat {
    /// Adds a system with all that it contains, and returns its number.
    fn system(&mut self, system: &System, path: &str) -> Result<usize, SspError> {
        let number = self.systems.len();
        let owner = Owner::System(number);
        self.systems.push(HashSet::new());
        for own in &system.connectors {
            if !self.systems[number].insert(own.name.clone()) {
                return Err(own
                    .at
                    .fault(format!("there are two connectors `{}`", excerpt(&own.name))));
            }
            self.graph
                .add((owner, own.name.clone()), own.unit.clone(), true);
        }
        let outside = self.scope.len();
        for own in &system.dictionaries {
            let dictionary = self.dictionaries.len();
            for (name, unit) in &own.entries {
                let key = (Owner::Dictionary(dictionary), name.clone());
                self.graph.add(key, unit.clone(), true);
            }
            self.dictionaries
                .push(own.entries.iter().cloned().collect());
            self.scope.push((own.name.clone(), dictionary));
        }
        let mut seen: HashMap<&str, Seen> = HashMap::new();
        for element in &system.elements {
            let (name, connectors, owner) = match element {
                Element::Component(own) => (&own.name, &own.connectors, self.component(own, path)?),
                Element::System(own) => {
                    let full = joined(path, &own.name);
                    (
                        &own.name,
                        &own.connectors,
                        Owner::System(self.inner(own, full)?),
                    )
                }
                Element::Reference(own) => (&own.name, &own.connectors, self.reference(own)?),
            };
            let connectors = by_name(connectors);
            seen.insert(name, Seen { owner, connectors });
        }
        let own = Seen {
            owner,
            connectors: by_name(&system.connectors),
        };
        for connection in &system.connections {
            self.connect(connection, &own, &seen)?;
        }
        self.scope.truncate(outside);
        for entry in &system.parameters {
            self.apply(entry, path, number)?;
        }
        Ok(number)
    }

    fn inner(&mut self, system: &System, full: String) -> Result<usize, SspError> {
        let number = self.system(system, &full)?;
        self.names.entry(full).or_insert(Owner::System(number));
        Ok(number)
    }

    fn component(&mut self, own: &Component, path: &str) -> Result<Owner, SspError> {
        let full = joined(path, &own.name);
        let number = self.components.len();
        let owner = Owner::Component(number);
        if let Some(Owner::Component(_)) = self.names.insert(full.clone(), owner) {
            return Err(own
                .at
                .fault(format!("two components are named `{}`", excerpt(&full))));
        }
        let known = self.variables.entry(own.file.clone());
        let variables = known
            .or_insert_with(|| Arc::new(Variables::of(own.fmu.clone())))
            .clone();
        self.components.push(variables.clone());
        for connector in &own.connectors {
            let found = variables.find(&connector.name);
            let is_lost = found.is_none();
            let unit = found.and_then(|found| found.unit);
            let is_own = unit.is_some();
            let unit = unit.or_else(|| connector.unit.clone());
            self.graph
                .add((owner, connector.name.clone()), unit, is_own);
            if is_lost {
                let name = joined(&full, &connector.name);
                self.reader.unmatched(&connector.at, &name);
            }
        }
        self.description.instances.push(InstanceDescription {
            name: full,
            source: Spanned {
                value: InstanceSource::Model(own.file.clone()),
                place: Some(own.at.place.clone()),
            },
            order: None,
            interface: own.interface,
            at_once: false,
        });
        for entry in &own.parameters {
            if !self.set(number, &entry.name, entry)? {
                self.reader.unmatched(&entry.at, &entry.name);
            }
        }
        Ok(owner)
    }

    fn reference(&mut self, own: &Reference) -> Result<Owner, SspError> {
        let found = self
            .scope
            .iter()
            .rev()
            .find(|(name, _)| *name == own.dictionary);
        let (_, number) = found.ok_or_else(|| {
            let near = suggestion(
                &own.dictionary,
                self.scope.iter().map(|(name, _)| name.as_str()),
            );
            let name = excerpt(&own.dictionary);
            own.at.fault(format!(
                "there is no signal dictionary `{name}`{}",
                did_you_mean(near)
            ))
        })?;
        let entries = &self.dictionaries[*number];
        if let Some(other) = own
            .connectors
            .iter()
            .find(|own| !entries.contains_key(&own.name))
        {
            let name = excerpt(&other.name);
            return Err(other
                .at
                .fault(format!("`{name}` is no entry of the signal dictionary")));
        }
        Ok(Owner::Dictionary(*number))
    }

    fn connect(
        &mut self,
        connection: &Connection,
        own: &Seen<'_>,
        seen: &HashMap<&str, Seen<'_>>,
    ) -> Result<(), SspError> {
        let at = &connection.at;
        let [start, end] = &connection.ends;
        let (start, end) = (
            self.end(start, at, own, seen)?,
            self.end(end, at, own, seen)?,
        );
        let (from, to) = match (start.1, end.1) {
            (Flow::Out, Flow::Out) | (Flow::In, Flow::In) => {
                let what = if start.1 == Flow::Out { "give" } else { "take" };
                let (start, end) = (excerpt(&start.0.1), excerpt(&end.0.1));
                return Err(at.fault(format!("`{start}` and `{end}` both {what} values here")));
            }
            (Flow::In, _) | (Flow::Any, Flow::Out) => (end.0, start.0),
            _ => (start.0, end.0),
        };
        for key in [&from, &to] {
            self.know_unit(key);
        }
        self.graph.connect(from, to, connection.step.clone(), at)
    }

    /// Adds the unit of an FMU's variable that its component does not list as a connector.
    fn know_unit(&mut self, key: &Key) {
        if let Owner::Component(number) = key.0
            && self.graph.unit_of(key).is_none()
        {
            let unit = self.components[number]
                .find(&key.1)
                .and_then(|own| own.unit);
            self.graph.add(key.clone(), unit, true);
        }
    }

    /// The connector of a connection's end, and whether it gives or takes values there.
    fn end(
        &self,
        end: &End,
        at: &At,
        own: &Seen<'_>,
        seen: &HashMap<&str, Seen<'_>>,
    ) -> Result<(Key, Flow), SspError> {
        let of = match &end.element {
            None => own,
            Some(name) => seen.get(name.as_str()).ok_or_else(|| {
                let near = suggestion(name, seen.keys().copied());
                at.fault(format!(
                    "there is no element `{}`{}",
                    excerpt(name),
                    did_you_mean(near)
                ))
            })?,
        };
        let connector = of.connectors.get(end.connector.as_str());
        let mut flow = connector.map_or(Flow::Any, |own| own.flow);
        if end.element.is_none() {
            flow = flow.inside();
        }
        match of.owner {
            Owner::Component(number) => {
                let variables = &self.components[number];
                let Some(found) = variables.find(&end.connector) else {
                    let known = variables.by_name.keys().map(String::as_str);
                    let near = did_you_mean(suggestion(&end.connector, known));
                    let (element, name) =
                        (end.element.as_deref().unwrap_or_default(), &end.connector);
                    return Err(at.fault(format!(
                        "the FMU of `{}` has no variable `{}`{near}",
                        excerpt(element),
                        excerpt(name)
                    )));
                };
                if flow == Flow::Any {
                    flow = match found.variable.causality {
                        Causality::Input
                        | Causality::Parameter
                        | Causality::StructuralParameter => Flow::In,
                        _ => Flow::Out,
                    };
                }
            }
            Owner::Dictionary(number) if self.dictionaries[number].contains_key(&end.connector) => {
            }
            _ if connector.is_none() => {
                let near = did_you_mean(suggestion(&end.connector, of.connectors.keys().copied()));
                let name = excerpt(&end.connector);
                return Err(at.fault(format!("there is no connector `{name}`{near}")));
            }
            _ => {}
        }
        Ok(((of.owner, format!("{}{}", end.connector, end.index)), flow))
    }

    /// Makes wires of connections, and values of what is connected to a system's connector that has one.
    fn wire(&mut self) -> Result<(), SspError> {
        let mut fed = HashSet::new();
        for sink in std::mem::take(&mut self.graph.sinks) {
            let trace = self.graph.trace(&sink)?;
            let Owner::Component(to) = sink.0 else {
                continue;
            };
            let Some((last, _)) = trace.hops.last() else {
                continue;
            };
            if let Owner::Component(from) = trace.from.0 {
                let transformation = self.graph.transformation(&trace)?;
                let place = Some(last.at.place.clone());
                let end = |number: usize, name: &str| Spanned {
                    value: format!("{}.{name}", self.description.instances[number].name),
                    place: place.clone(),
                };
                let (from, to) = (end(from, &trace.from.1), end(to, &sink.1));
                fed.insert(to.value.clone());
                self.description.connections.push(Wire {
                    from,
                    to,
                    transformation,
                });
            } else if let Some(entry) = self.given.get(&trace.from).cloned() {
                let first = Leg {
                    unit: self.graph.unit_of(&trace.from),
                    step: entry.step.clone(),
                    at: entry.at.clone(),
                };
                let mut legs = vec![first];
                legs.extend(self.graph.legs(&trace));
                let conversion = composite(entry.unit.clone(), &legs)?;
                let map = composite_map(&legs);
                let values = entry.values.iter().map(|value| mapped_value(&map, value));
                let entry = Entry {
                    values: values.collect(),
                    ..entry
                };
                self.set_to(to, &sink.1, &entry, conversion)?;
            }
        }
        // What is fed needs no start value.
        let is_fed = |name: &str| {
            let array = || name.strip_suffix(']')?.rfind('[').map(|at| &name[..at]);
            fed.contains(name) || array().is_some_and(|array| fed.contains(array))
        };
        let mut settings = std::mem::take(&mut self.settings);
        settings.retain(|(_, setting)| !is_fed(&setting.name.value));
        settings.sort_by_key(|(component, _)| *component);
        let settings = settings.into_iter().map(|(_, setting)| setting);
        self.description.settings = settings.collect();
        Ok(())
    }
}
