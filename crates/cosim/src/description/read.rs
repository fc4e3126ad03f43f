//! Reads a description from a system file.

use super::{
    Experiment, InstanceDescription, InstanceSource, Interface, Setting, Spanned,
    SystemDescription, Transformation, Wire,
};
use crate::component::Conversion;
use pilotage_text::document::{self, Document, DocumentError, Item, Place, TomlTable};
use pilotage_text::is_identifier;
use pilotage_text::printable::{excerpt, is_hidden};
use pilotage_text::suggestion::{did_you_mean, suggestion};
use std::path::Path;
use thiserror::Error;

/// The tables of a system file.
pub const KEYS: [&str; 2] = ["system", "connect"];

/// Why a file does not describe a system.
#[derive(Debug, Error)]
pub enum DescriptionError {
    /// Not TOML, or a field that is unknown, missing or of the wrong kind.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// No instance.
    #[error(
        "{place}: the system is empty; expected an instance, such as [system.pilot] with model = \"pilot.fmu\""
    )]
    Empty {
        /// Place of the table, or the first line.
        place: Place,
    },
    /// An invalid instance name.
    #[error(
        "{place}: `{}` cannot name an instance; expected {expected}",
        excerpt(name)
    )]
    Name {
        /// Place of the name.
        place: Place,
        /// The name.
        name: String,
        /// What names consist of.
        expected: &'static str,
    },
    /// Neither a model nor a table.
    #[error(
        "{place}: `{name}` has no model; add model = \"FILE\", or table = \"FILE.csv\" for signals over time"
    )]
    NoModel {
        /// Place of the instance.
        place: Place,
        /// Its name.
        name: String,
    },
    /// An invalid order.
    #[error(
        "{place}: the order of `{name}` is {found}; expected a whole number from 1 to {}",
        u32::MAX
    )]
    Order {
        /// Place of the value.
        place: Place,
        /// Name of the instance.
        name: String,
        /// The given value.
        found: f64,
    },
    /// An unknown interface.
    #[error(
        "{place}: `{found}` is no kind of FMU{}; expected \"cs\" (co-simulation) or \"me\" (model exchange)",
        did_you_mean(suggestion.as_deref())
    )]
    Interface {
        /// Place of the value.
        place: Place,
        /// The given text.
        found: String,
        /// The interface that was probably meant.
        suggestion: Option<String>,
    },
}

impl SystemDescription {
    /// Reads a system file.
    ///
    /// # Errors
    /// If it cannot be read or does not describe a system; the error names file and line.
    pub fn read(path: &Path) -> Result<Self, DescriptionError> {
        Self::parse(&document::read(path)?, path)
    }

    /// Parses a description; file names in it are relative to the folder of `path`.
    ///
    /// # Errors
    /// If it does not describe a system; the error names file and line.
    pub fn parse(text: &str, path: &Path) -> Result<Self, DescriptionError> {
        let file = path.display().to_string();
        let document = Document::parse(text, &file)?;
        let root = document.root();
        root.only(&[KEYS[0], KEYS[1], "experiment"])?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut description = Self::named(root, folder, (is_instance_name, VISIBLE))?;
        if let Some(table) = root.table("experiment")? {
            table.only(&["start_time", "stop_time", "step"])?;
            description.experiment = Experiment {
                start: table.number("start_time")?,
                stop: table.number("stop_time")?,
                step: table.number("step")?,
            };
        }
        Ok(description)
    }

    /// Reads the tables `system` and `connect` of a file and ignores its other contents. Expressions name the instances,
    /// which are identifiers.
    ///
    /// # Errors
    /// If they do not describe a system; the error names file and line.
    pub fn of(root: TomlTable, folder: &Path) -> Result<Self, DescriptionError> {
        let expected = "letters, digits and `_`, and no digit first";
        Self::named(root, folder, (is_identifier, expected))
    }

    /// The same with names that fulfil a condition, which is said in words.
    fn named(root: TomlTable, folder: &Path, names: Names) -> Result<Self, DescriptionError> {
        let mut description = Self::default();
        if let Some(system) = root.table("system")? {
            for name in system.names() {
                description.add_instance(system, name, folder, names)?;
            }
        }
        if description.instances.is_empty() {
            let place = key_place(root, "system");
            return Err(DescriptionError::Empty { place });
        }
        if let Some(connect) = root.table("connect")? {
            wires(connect, "", &mut description.connections)?;
        }
        Ok(description)
    }

    fn add_instance(
        &mut self,
        system: TomlTable,
        name: &str,
        folder: &Path,
        (is_name, expected): Names,
    ) -> Result<(), DescriptionError> {
        let place = || key_place(system, name);
        if !is_name(name) {
            let (place, name) = (place(), name.to_owned());
            return Err(DescriptionError::Name {
                place,
                name,
                expected,
            });
        }
        let table = system.table(name)?;
        let table = system.required(name, table)?;
        let Some(source) = source(table, folder)? else {
            let (place, name) = (place(), name.to_owned());
            return Err(DescriptionError::NoModel { place, name });
        };
        if let Some(values) = table.table("set")? {
            settings(values, &format!("{name}."), &mut self.settings)?;
        }
        self.instances.push(InstanceDescription {
            name: name.to_owned(),
            source,
            order: order(table, name)?,
            interface: interface(table)?,
            at_once: table.boolean("at_once")?.unwrap_or(false),
        });
        Ok(())
    }
}

/// A condition on names, and what they consist of.
type Names = (fn(&str) -> bool, &'static str);

/// What names in a system file consist of.
pub(super) const VISIBLE: &str = "visible characters, and no space at an end";

/// Whether an instance can have that name in a system file.
pub(super) fn is_instance_name(name: &str) -> bool {
    !name.is_empty() && name.trim() == name && !name.contains(is_hidden)
}

/// Place of a key, or of the table if the key is missing.
fn key_place(table: TomlTable, name: &str) -> Place {
    table.key_place(name).unwrap_or_else(|| Place {
        file: table.file().to_owned(),
        line: table.line(name),
        column: None,
    })
}

/// Source of an instance. With `table`, no other fields are allowed.
fn source(
    table: TomlTable,
    folder: &Path,
) -> Result<Option<Spanned<InstanceSource>>, DocumentError> {
    let spanned = |key: &str, value| Spanned {
        value,
        place: table.place(key),
    };
    if let Some(file) = table.string("table")? {
        table.only(&["table"])?;
        let source = InstanceSource::Table(folder.join(file));
        return Ok(Some(spanned("table", source)));
    }
    table.only(&["model", "set", "order", "kind", "at_once", "table"])?;
    let source = |model: &str| match is_identifier(model) {
        true => InstanceSource::BuiltIn(model.to_owned()),
        false => InstanceSource::Model(folder.join(model)),
    };
    let model = table.string("model")?.filter(|model| !model.is_empty());
    Ok(model.map(|model| spanned("model", source(model))))
}

fn order(table: TomlTable, name: &str) -> Result<Option<Spanned<u32>>, DescriptionError> {
    let Some(found) = table.number("order")? else {
        return Ok(None);
    };
    if found.fract() != 0.0 || !(1.0..=f64::from(u32::MAX)).contains(&found) {
        let place = key_place(table, "order");
        let name = name.to_owned();
        return Err(DescriptionError::Order { place, name, found });
    }
    let (value, place) = (found as u32, table.place("order"));
    Ok(Some(Spanned { value, place }))
}

fn interface(table: TomlTable) -> Result<Option<Interface>, DescriptionError> {
    let Some(found) = table.string("kind")? else {
        return Ok(None);
    };
    let known = Interface::ALL.into_iter().find(|i| i.name() == found);
    known.map(Some).ok_or_else(|| DescriptionError::Interface {
        place: table
            .place("kind")
            .unwrap_or_else(|| key_place(table, "kind")),
        found: found.to_owned(),
        suggestion: suggestion(found, Interface::ALL.map(Interface::name)).map(str::to_owned),
    })
}

/// Collects the values of a table and its nested tables, with names prefixed by `prefix`.
fn settings(table: TomlTable, prefix: &str, found: &mut Vec<Setting>) -> Result<(), DocumentError> {
    for name in table.names() {
        let full = format!("{prefix}{name}");
        if table.is_table(name) {
            if let Some(inner) = table.table(name)? {
                settings(inner, &format!("{full}."), found)?;
            }
        } else if let Some(value) = table.text(name)? {
            let place = table.key_place(name);
            found.push(Setting {
                name: Spanned { value: full, place },
                value,
            });
        }
    }
    Ok(())
}

/// Collects the wires of a table and its nested tables: `a.b = "c.d"` is equivalent to `"a.b" = "c.d"`.
fn wires(table: TomlTable, prefix: &str, found: &mut Vec<Wire>) -> Result<(), DocumentError> {
    for name in table.names() {
        let from = format!("{prefix}{name}");
        if let Some(inner) = table.table(name).ok().flatten()
            && !is_end(inner)
        {
            wires(inner, &format!("{from}."), found)?;
            continue;
        }
        for (item, place) in table.items(name)?.unwrap_or_default() {
            let (to, place, transformation) = match item {
                Item::Text(to) => (to, place, Transformation::default()),
                Item::Table(end) => transformed(end)?,
            };
            found.push(Wire {
                from: Spanned {
                    value: from.clone(),
                    place: table.key_place(name),
                },
                to: Spanned {
                    value: to.to_owned(),
                    place: Some(place),
                },
                transformation,
            });
        }
    }
    Ok(())
}

/// Whether a table is the end of a wire, `{ to = "b.u", factor = 2 }`, and holds no names of outputs: these have no
/// numbers.
fn is_end(table: TomlTable) -> bool {
    let is_number = |key| table.number(key).is_ok_and(|value| value.is_some());
    let is_boolean = |key| table.boolean(key).is_ok_and(|value| value.is_some());
    let is_changed = is_number("factor")
        || is_number("offset")
        || is_boolean("convert_units")
        || table.is_table("map");
    table.has("to") && is_changed
}

/// The end of a wire with what happens on the way.
fn transformed<'a>(end: TomlTable<'a>) -> Result<(&'a str, Place, Transformation), DocumentError> {
    end.only(&["to", "factor", "offset", "convert_units", "map"])?;
    let to = end.required("to", end.string("to")?)?;
    let mut map = Vec::new();
    if let Some(table) = end.table("map")? {
        for name in table.names() {
            let value = table.required(name, table.text(name)?)?;
            map.push((name.to_owned(), value));
        }
    }
    let transformation = Transformation {
        linear: Conversion {
            factor: end.number("factor")?.unwrap_or(1.0),
            offset: end.number("offset")?.unwrap_or(0.0),
        },
        converts_units: end.boolean("convert_units")?.unwrap_or(true),
        map,
    };
    Ok((to, end.required("to", end.place("to"))?, transformation))
}
