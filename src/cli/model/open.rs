//! Opens a model from a command-line argument: a model file, or the name of a built-in model.

use super::super::Failure;
use super::super::recognise::{self, FileKind};
use crate::flights::kind::Numbers;
use crate::models::TextModel;
use crate::models::library::{self, BuiltIn, MAX_ORDER};
use crate::suggestion::{did_you_mean, suggestion};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// A model that is named on the command line.
#[derive(Debug, clap::Args)]
pub struct ModelArgs {
    /// Model file (TOML, docs/models.md), or name of a built-in model (see `pilotage models`).
    #[arg(value_name = "FILE|NAME")]
    pub model: String,
    /// Order of a built-in model that has one [default: 3].
    #[arg(long)]
    pub order: Option<usize>,
}

impl ModelArgs {
    /// The path, if the argument is a file.
    pub fn file(&self) -> Option<PathBuf> {
        let path = Path::new(&self.model);
        let is_name = library::find(&self.model).is_some() && !path.is_file();
        (!is_name).then(|| path.to_owned())
    }

    /// Opens the model.
    pub fn open(&self) -> Result<TextModel, Failure> {
        match self.file() {
            Some(file) if self.order.is_some() => {
                let message = format!("{} has no order: it is a file", file.display());
                Err(Failure::new(message).hint("leave --order out"))
            }
            Some(file) if file.exists() || file.extension().is_some() => read(&file),
            _ => named(&self.model, self.order),
        }
    }
}

/// Reads a model file.
pub fn read(file: &Path) -> Result<TextModel, Failure> {
    recognise::expect(
        [&file.to_owned()],
        &[FileKind::Model],
        "a model file (TOML with [model])",
    )?;
    Ok(TextModel::read(file)?)
}

/// Reads a model file, or a pilot or vehicle file as the built-in model with its numbers.
pub fn read_any(file: &Path) -> Result<TextModel, Failure> {
    let numbers = match recognise::of(file) {
        Some(FileKind::Pilot | FileKind::Vehicle) => Numbers::read(file)?,
        _ => None,
    };
    let name = file.display().to_string();
    match numbers {
        Some(numbers) => Ok(TextModel::parse(&numbers.text(&name)?, &name)?),
        None => read(file),
    }
}

/// Opens a built-in model.
pub fn named(name: &str, order: Option<usize>) -> Result<TextModel, Failure> {
    let text = text(built_in(name)?, order)?;
    Ok(TextModel::parse(&text, &format!("{name}.toml"))?)
}

/// Finds a built-in model by name.
pub fn built_in(name: &str) -> Result<&'static BuiltIn, Failure> {
    library::find(name).ok_or_else(|| {
        let names = library::all().iter().map(|model| model.name);
        let near = did_you_mean(suggestion(name, names));
        let message = format!("`{name}` is neither a file nor a built-in model{near}");
        Failure::new(message).hint("`pilotage models` lists the built-in ones")
    })
}

/// The model file of a built-in model.
pub fn text(model: &BuiltIn, order: Option<usize>) -> Result<String, Failure> {
    match order {
        None => Ok(model.text.to_owned()),
        Some(_) if !model.has_order => {
            let message = format!("`{}` has no order", model.name);
            Err(Failure::new(message).hint("leave the order out"))
        }
        Some(order) if (1..=MAX_ORDER).contains(&order) => Ok(library::linear(order)),
        Some(order) => {
            let message = format!("order {order} of `{}` is out of range", model.name);
            Err(Failure::new(message).hint(format!("give a number from 1 to {MAX_ORDER}")))
        }
    }
}

/// The name under which a value is set; for a state, that of its start value.
pub fn settable<'a>(model: &'a TextModel, name: &'a str) -> Cow<'a, str> {
    let table = model.variables();
    let all = table.variables();
    let mut states = table.states().map(|index| &all[index].name);
    match states.position(|state| state == name) {
        Some(state) => (&all[table.starts().start + state].name).into(),
        None => name.into(),
    }
}
