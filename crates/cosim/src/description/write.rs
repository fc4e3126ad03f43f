//! Writes a description as a system file.

use super::read::{VISIBLE, is_instance_name};
use super::{InstanceDescription, InstanceSource, SystemDescription, Transformation, Wire};
use crate::component::Conversion;
use pilotage_text::document::{self, Document, quoted};
use pilotage_text::is_identifier;
use std::path::{Component, Path, PathBuf, absolute};
use thiserror::Error;

/// First line of written files.
pub const HEADER: &str = "# A system of pilotage";

/// Why a description cannot be written as a file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SaveError {
    /// A name that is not allowed in a system file.
    #[error(
        "`{}` cannot name an instance in a system file: expected {VISIBLE}",
        pilotage_text::printable::excerpt(name)
    )]
    Name {
        /// The name.
        name: String,
    },
    /// A file name that is not UTF-8.
    #[error("the name of {} is not UTF-8", file.display())]
    File {
        /// The file.
        file: PathBuf,
    },
}

impl SystemDescription {
    /// The text of a system file stored in `folder`; read from there, it gives the same system. File names are relative
    /// to that folder where a relative path exists.
    ///
    /// # Errors
    /// If a name is not allowed in such a file.
    pub fn to_toml(&self, folder: &Path) -> Result<String, SaveError> {
        let mut text = format!("{HEADER}\n");
        let times = [
            ("start_time", self.experiment.start),
            ("stop_time", self.experiment.stop),
            ("step", self.experiment.step),
        ];
        let times = times
            .into_iter()
            .filter_map(|(key, time)| Some((key, time?)));
        let times: String = times
            .map(|(key, time)| format!("{key} = {}\n", document::number(time)))
            .collect();
        if !times.is_empty() {
            text += &format!("\n[experiment]\n{times}");
        }
        for instance in &self.instances {
            text += &self.instance(instance, folder)?;
        }
        if !self.connections.is_empty() {
            text += "\n[connect]\n";
        }
        let mut done: Vec<&str> = Vec::new();
        for wire in &self.connections {
            let from = wire.from.value.as_str();
            if !done.contains(&from) {
                text += &format!("{} = {}\n", quoted(from), self.ends_of(from));
                done.push(from);
            }
        }
        Ok(text)
    }

    fn instance(&self, instance: &InstanceDescription, folder: &Path) -> Result<String, SaveError> {
        let name = &instance.name;
        if !is_instance_name(name) {
            return Err(SaveError::Name { name: name.clone() });
        }
        let (key, source) = match &instance.source.value {
            InstanceSource::BuiltIn(model) => ("model", model.clone()),
            InstanceSource::Model(file) => ("model", model_file(file, folder)?),
            InstanceSource::Table(file) => ("table", file_name(file, folder)?),
        };
        let table = document::key(name);
        let mut text = format!("\n[system.{table}]\n{key} = {}\n", quoted(&source));
        if let Some(order) = &instance.order {
            text += &format!("order = {}\n", order.value);
        }
        if let Some(interface) = instance.interface {
            text += &format!("kind = \"{}\"\n", interface.name());
        }
        if instance.at_once {
            text += "at_once = true\n";
        }
        let lines: String = (self.settings_of(name))
            .map(|(variable, text)| format!("{} = {}\n", document::key(variable), value(text)))
            .collect();
        if !lines.is_empty() {
            text += &format!("[system.{table}.set]\n{lines}");
        }
        Ok(text)
    }

    /// The inputs that an output feeds: a string or a list of strings.
    fn ends_of(&self, from: &str) -> String {
        let wires = self
            .connections
            .iter()
            .filter(|wire| wire.from.value == from);
        let ends: Vec<String> = wires.map(end).collect();
        match ends.as_slice() {
            [one] => one.clone(),
            many => format!("[{}]", many.join(", ")),
        }
    }
}

/// The input of a wire, with what happens on the way.
fn end(wire: &Wire) -> String {
    let to = quoted(&wire.to.value);
    let Transformation {
        linear,
        converts_units,
        ref map,
    } = wire.transformation;
    let mut parts = String::new();
    if linear != Conversion::NONE {
        let [factor, offset] = [linear.factor, linear.offset].map(document::number);
        parts += &format!(", factor = {factor}, offset = {offset}");
    }
    if !converts_units {
        parts += ", convert_units = false";
    }
    if !map.is_empty() {
        let pair =
            |(from, to): &(String, String)| format!("{} = {}", document::key(from), value(to));
        let pairs: Vec<String> = map.iter().map(pair).collect();
        parts += &format!(", map = {{ {} }}", pairs.join(", "));
    }
    match parts.is_empty() {
        true => to,
        false => format!("{{ to = {to}{parts} }}"),
    }
}

/// A value as TOML that is read back as the same text; without quotes if possible.
fn value(text: &str) -> String {
    let line = format!("value = {text}");
    let read = Document::parse(&line, "").ok();
    let read = read.and_then(|document| match document.root().names().len() {
        1 => document.root().text("value").ok()?,
        _ => None,
    });
    match read.as_deref() == Some(text) && !text.contains(['"', '\'']) {
        true => text.to_owned(),
        false => quoted(text),
    }
}

/// Name of a model file, written so that it cannot be mistaken for a built-in model.
fn model_file(file: &Path, folder: &Path) -> Result<String, SaveError> {
    let name = file_name(file, folder)?;
    Ok(match is_identifier(&name) {
        true => format!("./{name}"),
        false => name,
    })
}

fn file_name(file: &Path, folder: &Path) -> Result<String, SaveError> {
    let path = relative(file, folder).or_else(|| absolute(file).ok());
    let path = path.unwrap_or_else(|| file.to_owned());
    // All systems accept slashes.
    let name = path.to_str().map(|name| match cfg!(windows) {
        true => name.replace('\\', "/"),
        false => name.to_owned(),
    });
    let file = file.to_owned();
    name.ok_or(SaveError::File { file })
}

/// Relative path from a folder to a file, if there is one; a link at the file itself is not resolved.
fn relative(file: &Path, folder: &Path) -> Option<PathBuf> {
    let here = |path: &Path| match path.as_os_str().is_empty() {
        true => PathBuf::from("."),
        false => path.to_owned(),
    };
    let from = here(folder).canonicalize().ok()?;
    let whole = match file.file_name() {
        Some(name) => here(file.parent()?).canonicalize().ok()?.join(name),
        None => file.canonicalize().ok()?,
    };
    let shared = from.components().zip(whole.components());
    let shared = shared.take_while(|(a, b)| a == b).count();
    let is_root = |part: &Component| matches!(part, Component::Prefix(_) | Component::RootDir);
    if from.components().skip(shared).any(|part| is_root(&part)) {
        return None;
    }
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(whole.components().skip(shared)).collect();
    Some(here(&path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{Setting, Wire};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 512,
            rng_seed: proptest::test_runner::RngSeed::Fixed(47),
            ..ProptestConfig::default()
        })]
        /// FMUs call their variables as they like.
        #[test]
        fn whatever_names_and_values_are_the_file_reads_back(
            (variable, value, end, file) in ("(?s).{1,12}", "(?s).{0,12}", "(?s).{1,12}", "[^/\\\\\0.]{1,12}"),
            (factor, offset, converts_units) in (-9.0..9.0, -9.0..9.0, any::<bool>()),
        ) {
            let linear = Conversion { factor, offset };
            let map = vec![(variable.clone(), value.clone())];
            let transformation = Transformation { linear, converts_units, map };
            let [variable, end] = [variable, end].map(|name| format!("a.{name}"));
            let instance = InstanceDescription {
                name: "a".into(),
                source: InstanceSource::Model(PathBuf::from(format!("/{file}.fmu"))).into(),
                order: None,
                interface: None,
                at_once: true,
            };
            let described = SystemDescription {
                instances: vec![instance],
                connections: vec![Wire { from: variable.clone().into(), to: end.into(), transformation: transformation.clone() }],
                settings: vec![Setting { name: variable.into(), value }],
                ..SystemDescription::default()
            };
            let text = described.to_toml(Path::new("/")).unwrap();
            prop_assert_eq!(text.lines().count(), 10, "{}", text);
            let read = SystemDescription::parse(&text, Path::new("/s.toml")).unwrap();
            prop_assert_eq!(&read.connections[0].from.value, &described.connections[0].from.value);
            prop_assert_eq!(&read.connections[0].to.value, &described.connections[0].to.value);
            prop_assert_eq!(&read.connections[0].transformation, &transformation);
            prop_assert_eq!(&read.settings[0].name.value, &described.settings[0].name.value);
            prop_assert_eq!(&read.settings[0].value, &described.settings[0].value);
            prop_assert!(read.instances[0].at_once);
            prop_assert_eq!(&read.instances[0].source.value, &described.instances[0].source.value);
        }
    }

    #[test]
    fn files_are_named_from_the_folder_of_the_system() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("a/b")).unwrap();
        for (file, from, expected) in [
            ("m.fmu", "", "m.fmu"),
            ("m.fmu", "a/b", "../../m.fmu"),
            ("a/m.fmu", "a/b", "../m.fmu"),
            ("a/b/m.fmu", "a", "b/m.fmu"),
            ("a/b", "", "a/b"),
            ("a", "", "./a"),
            ("a/b/..", "a/b", ".."),
        ] {
            let found = model_file(&at(file), &at(from)).unwrap();
            assert_eq!(found, expected, "{file} from {from}");
        }
        // Without a relative path, the file keeps its name.
        let nowhere = model_file(&at("none/m.fmu"), &at("a")).unwrap();
        assert_eq!(Path::new(&nowhere), at("none/m.fmu"));
    }

    #[test]
    fn values_are_read_as_they_were_said() {
        for text in [
            "10",
            "1.5",
            "-1e-3",
            "true",
            "+1",
            "1_000",
            "0x10",
            "",
            " 1",
            "a\nb = 2",
            "1 # one",
            "'1'",
            "\"",
            "[1]",
            "nan",
            "1979-05-27",
            "größe",
            "{a=1}",
            "1\n",
        ] {
            let line = format!("value = {}", value(text));
            let document = Document::parse(&line, "").unwrap();
            assert_eq!(
                document.root().text("value").unwrap().as_deref(),
                Some(text),
                "{line}"
            );
        }
        assert_eq!(["10", "true", "ten"].map(value), ["10", "true", "\"ten\""]);
    }
}
