//! Fitted instances as model files, from which everything else begins.

use crate::cli::{Failure, overwrite};
use crate::estimation::result::Found;
use crate::estimation::{Fit, Posed};
use pilotage_language::with_starts;
use std::path::{Path, PathBuf};

/// First words of a fitted model's file.
pub const HEAD: &str = "# Fitted by pilotage";

/// An instance whose parameters are sought, and the file that it becomes.
pub struct Fitted {
    /// Name of the instance.
    pub instance: String,
    /// Its file.
    pub path: PathBuf,
}

/// The instances with sought parameters. One is written to `output`, several into that folder.
pub fn planned(posed: &Posed<'_>, output: Option<&Path>) -> Result<Vec<Fitted>, Failure> {
    let is_fitted = |instance: &str| {
        let prefix = format!("{instance}.");
        let sought = posed.unknowns.iter().map(|(unknown, _)| &unknown.name);
        let names: Vec<&String> = sought
            .chain(posed.told.tied.iter().map(|(name, _)| name))
            .collect();
        names.iter().any(|name| name.starts_with(&prefix))
    };
    let instances: Vec<&String> = (posed.joint.parts.iter())
        .filter(|(name, part)| is_fitted(name) && part.file.is_some())
        .map(|(name, _)| name)
        .collect();
    let is_folder = output.is_some_and(|output| output.is_dir());
    let path = |instance: &str| match (output, is_folder) {
        (Some(output), true) => output.join(format!("{instance}-fitted.toml")),
        (Some(output), false) => output.to_owned(),
        (None, _) => PathBuf::from(format!("{instance}-fitted.toml")),
    };
    if let (Some(output), false, true) = (output, is_folder, instances.len() > 1) {
        let message = format!(
            "{} models are fitted, and {} is one file",
            instances.len(),
            output.display()
        );
        return Err(Failure::new(message).hint("give -o a folder that is there"));
    }
    Ok((instances.into_iter())
        .map(|instance| Fitted {
            instance: instance.clone(),
            path: path(instance),
        })
        .collect())
}

impl Fitted {
    /// Writes the model with what was found as its start values, and its tables beside it.
    pub fn write(&self, posed: &Posed<'_>, fit: &Fit, problem: &Path) -> Result<(), Failure> {
        let parts = posed.joint.parts.iter();
        let mut parts = parts.filter(|(name, _)| *name == self.instance);
        let Some(compiled) = parts.find_map(|(_, part)| part.file.as_ref()) else {
            return Ok(());
        };
        let prefix = format!("{}.", self.instance);
        let mut head = format!("{HEAD} from {}: {}\n", problem.display(), fit.ending());
        let mut values: Vec<(String, f64)> = Vec::new();
        for found in &fit.parameters {
            let Some(name) = found.name.strip_prefix(&prefix) else {
                continue;
            };
            if let [(_, _), _, ..] = found.values.as_slice() {
                head += &format!("# {name} is the mean of {}\n", each(found));
            }
            values.push((name.to_owned(), found.mean()));
        }
        for setting in posed.file.system.settings_of(&self.instance) {
            let is_found = values.iter().any(|(name, _)| name == setting.0);
            if let (false, Ok(value)) = (is_found, setting.1.parse()) {
                values.push((setting.0.to_owned(), value));
            }
        }
        overwrite::save(
            &self.path,
            head + &with_starts(&compiled.file.text, &values),
        )?;
        for (name, table) in &compiled.tables {
            let beside = self.path.with_file_name(name);
            let is_there = std::fs::read_to_string(&beside).is_ok_and(|text| text == table.text);
            if !is_there {
                refuse_other(&beside)?;
                overwrite::save(&beside, &table.text)?;
            }
        }
        Ok(())
    }
}

/// A table of that name with another content is somebody's.
fn refuse_other(path: &Path) -> Result<(), Failure> {
    match path.exists() {
        true => {
            let message = format!(
                "{} is there already, and is not the table of the fitted model",
                path.display()
            );
            Err(Failure::new(message).hint("give -o a file in another folder"))
        }
        false => Ok(()),
    }
}

fn each(found: &Found) -> String {
    let label = |label: &Option<String>| label.clone().unwrap_or_default();
    let all = found
        .values
        .iter()
        .map(|(own, value)| format!("{value} ({})", label(own)));
    all.collect::<Vec<_>>().join(", ")
}
