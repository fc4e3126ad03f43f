//! Writes fitted instances as model files, the inputs of all other commands.

use super::kept;
use crate::cli::{Failure, overwrite};
use crate::cosim::SystemDescription;
use crate::cosim::description::{InstanceDescription, InstanceSource, Setting};
use crate::estimation::part::Part;
use crate::estimation::result::Found;
use crate::estimation::{Fit, Posed};
use pilotage_language::{with_results, with_starts};
use pilotage_text::printable::{comment, one_line};
use std::path::{Path, PathBuf};

/// Beginning of the file of a fitted model.
pub const HEAD: &str = "# Fitted by pilotage";

/// An instance with estimated parameters, and its output file.
pub struct Fitted {
    /// Name of the instance.
    pub instance: String,
    /// Output file.
    pub path: PathBuf,
    /// Whether it is an FMU; the output file is then a system that contains it.
    pub is_fmu: bool,
}

/// The instances with estimated parameters. A single one is written to `output`, several into `output` as a folder:
/// [`make_folder`].
pub fn planned(posed: &Posed<'_>, output: Option<&Path>) -> Result<Vec<Fitted>, Failure> {
    let is_fitted = |instance: &str| {
        let prefix = format!("{instance}.");
        let sought = posed.unknowns.iter().map(|(unknown, _)| &unknown.name);
        let names: Vec<&String> = sought
            .chain(posed.quantities.tied.iter().map(|(name, _)| name))
            .collect();
        names.iter().any(|name| name.starts_with(&prefix))
    };
    let instances: Vec<&(String, Part)> = (posed.joint.parts.iter())
        .filter(|(name, part)| is_fitted(name) && (part.file.is_some() || part.fmu.is_some()))
        .collect();
    if let (Some(output), true) = (output, instances.is_empty()) {
        let message = format!(
            "nothing is sought in an instance with a model, so there is nothing to write to {}",
            output.display()
        );
        return Err(Failure::new(message).hint("leave -o out; --json and --report give the result"));
    }
    let is_folder = output.is_some_and(|output| is_folder(output, instances.len()));
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
        return Err(Failure::new(message).hint("give -o a folder"));
    }
    Ok((instances.into_iter())
        .map(|(instance, part)| Fitted {
            instance: instance.clone(),
            path: path(instance),
            is_fmu: part.fmu.is_some(),
        })
        .collect())
}

/// Whether models are written into a folder of that name: one that is there or is written as one, or, of several models, one without
/// an ending.
fn is_folder(output: &Path, models: usize) -> bool {
    let may_be_new = !output.exists() && models > 1 && output.extension().is_none();
    let is_written_as_one = output.as_os_str().as_encoded_bytes().ends_with(b"/");
    may_be_new || is_written_as_one || output.is_dir()
}

/// Makes the folder of several models, if it is not there.
pub fn make_folder(output: Option<&Path>, models: &[Fitted]) -> Result<(), Failure> {
    match output.filter(|output| is_folder(output, models.len())) {
        Some(folder) => std::fs::create_dir_all(folder).map_err(|error| {
            let shown = folder.display();
            Failure::new(format!("cannot create the folder {shown}: {error}"))
        }),
        None => Ok(()),
    }
}

impl Fitted {
    /// Writes the model with the estimates as start values, and its tables next to it. An FMU is not changed; a system
    /// with these values is written instead.
    pub fn write(&self, posed: &Posed<'_>, fit: &Fit) -> Result<(), Failure> {
        let mut parts = posed.joint.parts.iter();
        let Some((_, part)) = parts.find(|(name, _)| *name == self.instance) else {
            return Ok(());
        };
        let prefix = format!("{}.", self.instance);
        let first = format!("{HEAD} from {}: {}", posed.file.file, fit.verdict());
        let mut head = one_line(&first).into_owned() + "\n";
        let mut values: Vec<(String, f64)> = Vec::new();
        for (found, is_sought) in all_of(posed, fit) {
            let Some(name) = found.name.strip_prefix(&prefix) else {
                continue;
            };
            let (value, is) = match is_sought {
                true => (found.mean(), "the mean"),
                // A mean over values given to the runs would be a value that no run had.
                false => (found.values[0].1, "the first"),
            };
            if found.values.len() > 1 {
                head += &comment(&format!("{name} is {is} of {}", each(&found)));
            }
            let delays = part.file.iter().flat_map(|compiled| &compiled.delays);
            if delays.into_iter().any(|delay| delay.name == name) {
                head += &comment(&format!(
                    "{name} began at {value}, which a model file cannot say"
                ));
            }
            values.push((name.to_owned(), value));
        }
        let Some(compiled) = &part.file else {
            for own in &fit.diagnostics {
                head += &comment(&format!("diagnostic [{}]: {own}", own.code()));
            }
            let (kept, lost) = settable(part, values);
            for (name, value) in lost {
                head += &comment(&format!(
                    "{name} began at {value}; the FMU computes it, and it cannot be set"
                ));
            }
            return self.write_system(posed, head, &kept);
        };
        let mut text = with_starts(&compiled.file.text, &values);
        let sureness = kept::table(fit, &prefix).map_or(String::new(), |table| table + "\n");
        text = with_results(
            &text,
            &(sureness + &kept::provenance(posed, fit, &self.instance)),
        );
        overwrite::save(&self.path, head + &text)?;
        for (name, table) in &compiled.tables {
            let beside = self.path.with_file_name(name);
            // Another run may write the same table at this moment.
            match beside.exists() && !overwrite::holds(&beside, &table.text) {
                true => refuse_other(&beside)?,
                false => overwrite::save(&beside, &table.text)?,
            }
        }
        Ok(())
    }

    /// Writes a system of this instance alone with these values.
    fn write_system(
        &self,
        posed: &Posed<'_>,
        head: String,
        values: &[(String, f64)],
    ) -> Result<(), Failure> {
        let system = &posed.file.system;
        let own = system.instances.iter();
        let own = own.filter(|own| own.name == self.instance).cloned();
        let mut own: Vec<InstanceDescription> = own.collect();
        // An FMU that is unpacked for this command alone is put beside.
        for instance in own.iter_mut().filter(|_| !system.kept.is_empty()) {
            let Some(unpacked) = instance.source.value.file() else {
                continue;
            };
            let (bytes, beside) = (
                pilotage_systems::fmu(unpacked)?,
                self.path.with_extension("fmu"),
            );
            if beside.exists() && crate::file::bytes(&beside).ok().as_ref() != Some(&bytes) {
                refuse_other(&beside)?;
            }
            overwrite::save(&beside, bytes)?;
            instance.source = InstanceSource::Model(beside).into();
        }
        let set = |(name, value): &(String, f64)| Setting {
            name: format!("{}.{name}", self.instance).into(),
            value: value.to_string(),
        };
        let fitted = SystemDescription {
            instances: own,
            settings: values.iter().map(set).collect(),
            ..SystemDescription::default()
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let text = head + &fitted.to_toml(folder)?;
        overwrite::save(&self.path, text)
    }
}

/// Names and values of variables.
type Values = Vec<(String, f64)>;

/// Splits values into those that can be set on an FMU, and those that cannot: a computed initial state can be set only
/// through its start parameter, if it has one.
fn settable(part: &Part, values: Values) -> (Values, Values) {
    let (states, graph) = (&part.model.states, &part.model.system.graph);
    let place = |name: &String| states.iter().position(|state| state == name);
    let is_set = |(name, _): &(String, f64)| {
        place(name).is_none_or(|place| graph.value(part.starts[place]).is_some())
    };
    let (mut kept, computed): (Values, Values) = values.into_iter().partition(is_set);
    let starts = part.fmu.iter().flat_map(|fmu| &fmu.start_parameters);
    let starts: Vec<&(String, String)> = starts.collect();
    let mut lost = Vec::new();
    for (name, value) in computed {
        match starts.iter().find(|(state, _)| *state == name) {
            Some((_, start)) => {
                kept.retain(|(own, _)| own != start);
                kept.push((start.clone(), value));
            }
            None => lost.push((name, value)),
        }
    }
    (kept, lost)
}

/// Estimated values and values given by the runs but not in the models, each with whether it was estimated.
fn all_of(posed: &Posed<'_>, fit: &Fit) -> impl Iterator<Item = (Found, bool)> {
    let sought = fit.parameters.iter().cloned().map(|found| (found, true));
    sought.chain(fit.given(posed).into_iter().map(|found| (found, false)))
}

/// Refuses to overwrite an existing table of the same name with different content.
fn refuse_other(path: &Path) -> Result<(), Failure> {
    match path.exists() {
        true => {
            let message = format!(
                "{} is there already, and is not what the fitted model needs beside it",
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
