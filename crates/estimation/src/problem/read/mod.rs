//! Reads a problem from its file.
//!
//! | module | contents |
//! | --- | --- |
//! | `control` | controls, objective and horizon |
//! | `fields` | single fields |
//! | `signals` | inputs and measured signals |
//! | `noise` | noise that drives the system |
//! | `parameters` | parameters, initial states and derived quantities |
//! | `runs` | runs and constraints |
//! | `options` | stability and options |

mod control;
mod fields;
mod noise;
mod options;
mod parameters;
mod runs;
mod signals;

use crate::problem::error::ProblemError;
use crate::problem::file::ProblemFile;
use fields::{at, finite, place};
use options::{options, stability};
use pilotage_cosim::description::Spanned;
use pilotage_cosim::{DescriptionError, SystemDescription};
use pilotage_language::file::{Formula, LONGEST, formula};
use pilotage_systems::is_ssp;
use pilotage_text::document::{self, Document, DocumentError, TomlTable};
use pilotage_text::error_chain::error_chain;
use pilotage_text::suggestion::suggestion;
use std::path::Path;

/// The tables of a problem file.
const KEYS: [&str; 17] = [
    "system",
    "connect",
    "inputs",
    "measured",
    "process_noise",
    "parameters",
    "initial",
    "constraint",
    "derived",
    "stability",
    "run",
    "fit",
    "control",
    "objective",
    "horizon",
    "final",
    "guess",
];

/// Tables of a problem file that no other kind of file has.
pub const OWN_KEYS: [&str; 10] = [
    "measured",
    "process_noise",
    "fit",
    "constraint",
    "derived",
    "initial",
    "stability",
    "control",
    "objective",
    "horizon",
];

type Read<T> = Result<T, ProblemError>;

impl ProblemFile {
    /// Reads a problem file.
    ///
    /// # Errors
    /// When it cannot be read or contains a mistake. The error states file, line and column.
    pub fn read(path: &Path) -> Read<Self> {
        Self::parse(&document::read(path)?, path)
    }

    /// Parses the text of a problem file. Paths in it are relative to the folder of `path`.
    ///
    /// # Errors
    /// When it contains a mistake. The error states file, line and column.
    pub fn parse(text: &str, path: &Path) -> Read<Self> {
        let file = path.display().to_string();
        if text.len() > LONGEST {
            return Err(ProblemError::Part(format!(
                "{file}: {} bytes; a problem file has at most {LONGEST}",
                text.len()
            )));
        }
        let document = Document::parse(text, &file)?;
        let root = document.root();
        root.only(&KEYS)?;
        check_brackets(root)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let system = system(root, folder)?;
        let instances = system.instances.iter().map(|own| own.name.clone());
        let own = root
            .table("parameters")?
            .map(|table| table.names())
            .unwrap_or_default();
        let reader = Reader {
            file: &file,
            text,
            folder,
            instances: instances.collect(),
            own: own.into_iter().map(str::to_owned).collect(),
        };
        let optimal = reader.optimal(root)?;
        let measured = match &optimal {
            Some(_) => Vec::new(),
            None => reader.measured(root)?,
        };
        let process_noise = reader.process_noise(root)?;
        let options = options(root)?;
        noise::check_objective(root, &options, &process_noise, &measured)?;
        Ok(Self {
            inputs: reader.inputs(root)?,
            measured,
            process_noise,
            parameters: reader.parameters(root)?,
            initial: reader.initial(root)?,
            constraints: reader.constraints(root)?,
            derived: reader.derived(root)?,
            stability: stability(root)?,
            runs: match &optimal {
                Some(_) => Vec::new(),
                None => reader.runs(root)?,
            },
            optimal,
            options,
            mesh_place: root.table("fit")?.and_then(|fit| fit.place("mesh_step")),
            folder: folder.to_owned(),
            text: text.to_owned(),
            system,
            file: file.clone(),
        })
    }
}

/// The system, described in this file or in another.
fn system(root: TomlTable<'_>, folder: &Path) -> Read<SystemDescription> {
    if root.has("system") && !root.is_table("system") {
        let name = root.required("system", root.string("system")?)?;
        if root.has("connect") {
            let fault = format!("the wires stand in {name}; leave [connect] out");
            return Err(at(root, "connect", fault));
        }
        let file = folder.join(name);
        if is_ssp(&file) {
            let read = pilotage_systems::read(&file, None);
            return read
                .map(|read| read.description)
                .map_err(|error| at(root, "system", error_chain(&error)));
        }
        let unread = |error| match error {
            DescriptionError::Document(error @ DocumentError::Read { .. }) => {
                ProblemError::unread(root.place("system").as_ref(), &file, &error)
            }
            error => error.into(),
        };
        return SystemDescription::read(&file).map_err(unread);
    }
    Ok(SystemDescription::of(root, folder)?)
}

/// Rejects single brackets where entries are listed, and double brackets elsewhere.
fn check_brackets(root: TomlTable<'_>) -> Read<()> {
    for name in root.names() {
        let is_list = ["measured", "constraint", "run", "control"].contains(&name);
        let fault = match root.is_table(name) {
            true if is_list => format!("there may be several `{name}`; write [[{name}]]"),
            false if !is_list && root.tables(name).is_ok() => {
                format!("there is one table `{name}`; write [{name}]")
            }
            _ => continue,
        };
        return Err(at(root, name, fault));
    }
    Ok(())
}

struct Reader<'t> {
    file: &'t str,
    text: &'t str,
    folder: &'t Path,
    instances: Vec<String>,
    /// Names listed in `[parameters]`.
    own: Vec<String>,
}

/// A table, one of its fields, and the full name of that field: `instance.variable`.
type Entry<'a> = (TomlTable<'a>, &'a str, Spanned<String>);

impl Reader<'_> {
    /// The fields of a table. Fields of `[section.instance]` are prefixed with the instance's name.
    fn entries<'a>(&self, table: TomlTable<'a>) -> Read<Vec<Entry<'a>>> {
        let spanned = |table: TomlTable<'_>, field: &str, value: String| Spanned {
            value,
            place: table.key_place(field),
        };
        let mut found: Vec<Entry<'a>> = Vec::new();
        for name in table.names() {
            let is_instance = self.instances.iter().any(|own| own == name);
            match table.table(name) {
                Ok(Some(inner)) if is_instance => {
                    for field in inner.names() {
                        let full = format!("{name}.{field}");
                        found.push((inner, field, spanned(inner, field, full)));
                    }
                }
                _ => found.push((table, name, spanned(table, name, name.to_owned()))),
            }
        }
        for (k, (table, field, name)) in found.iter().enumerate() {
            if found[..k]
                .iter()
                .any(|(_, _, before)| before.value == name.value)
            {
                let fault = format!("`{}` stands twice; leave one out", name.value);
                return Err(ProblemError::at(&place(*table, field), fault));
            }
        }
        Ok(found)
    }

    fn section<'a>(&self, root: TomlTable<'a>, name: &str) -> Read<Vec<Entry<'a>>> {
        match root.table(name)? {
            Some(table) => self.entries(table),
            None => Ok(Vec::new()),
        }
    }

    fn formula(&self, table: TomlTable<'_>, key: &str) -> Read<Option<Formula>> {
        if let Ok(Some(_)) = table.number(key) {
            finite(table, key)?;
        }
        Ok(formula((self.file, self.text), table, key)?)
    }

    /// Accepts one of these words or an expression. A word similar to one of them is a mistake, unless it is the name
    /// of one of the problem's own parameters.
    fn check_word(&self, table: TomlTable<'_>, field: &str, words: &[&str]) -> Read<()> {
        let Ok(Some(found)) = table.string(field) else {
            return Ok(());
        };
        let is_word = found.chars().all(|c| c.is_alphabetic() || c == ' ');
        let near = suggestion(found, words.iter().copied());
        let is_known = words.contains(&found) || self.own.iter().any(|own| own == found);
        match near.filter(|_| is_word && !is_known) {
            Some(near) => {
                let fault = format!(
                    "\"{found}\" is neither \"{near}\" nor a parameter; did you mean `{near}`?"
                );
                Err(at(table, field, fault))
            }
            None => Ok(()),
        }
    }
}
