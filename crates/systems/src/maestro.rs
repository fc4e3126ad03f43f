//! Systems of maestro and INTO-CPS: a multi-model (`mm.json`), and the times of a run in it or in a `coe.json` beside it.

use crate::Foreign;
use crate::error::SspError;
use crate::package::Package;
use crate::plain::{Plain, file_from, gives};
use pilotage_cosim::description::Experiment;
use pilotage_fmi::description::ModelDescription;
use pilotage_text::file;
use pilotage_text::printable::excerpt;
use pilotage_text::suggestion::suggestion;
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Times of a run, beside the multi-model.
const TIMES: &str = "coe.json";

/// Keys that are read.
const KEYS: [&str; 6] = [
    "fmus",
    "connections",
    "parameters",
    "algorithm",
    "startTime",
    "endTime",
];

/// Keys of maestro that resemble these.
const OTHERS: [&str; 1] = ["environmentParameters"];

/// Whether a file is a multi-model, by its keys.
pub(crate) fn is_maestro(path: &Path) -> bool {
    let is_json = (path.extension()).is_some_and(|own| own.eq_ignore_ascii_case("json"));
    let has = |text: &str| text.contains("\"fmus\"") && text.contains("\"connections\"");
    is_json && file::peek(path).is_ok_and(|text| has(&text))
}

/// The parts of `{key}.instance.variable`.
struct Name<'t> {
    key: &'t str,
    instance: &'t str,
    variable: &'t str,
}

struct Reader {
    shown: String,
    plain: Plain,
    fmus: BTreeMap<String, (PathBuf, Arc<ModelDescription>)>,
    /// Keys of the FMUs, by instance.
    instances: BTreeMap<String, String>,
}

/// Reads a system.
pub(crate) fn read(path: &Path) -> Result<Foreign, SspError> {
    let (package, file) = Package::beside(path);
    let (text, shown) = package.text(&file)?;
    let json = parsed(&text, &shown)?;
    let mut reader = Reader {
        shown,
        plain: Plain::default(),
        fmus: BTreeMap::new(),
        instances: BTreeMap::new(),
    };
    reader.system(&json, &package.path(""))?;
    let mut times = json;
    if times.get("endTime").is_none() && package.path(TIMES).is_file() {
        let (text, shown) = package.text(TIMES)?;
        times = parsed(&text, &shown)?;
    }
    let time = |name| times.pointer(name).and_then(Value::as_f64);
    reader.plain.description.experiment = Experiment {
        start: time("/startTime"),
        stop: time("/endTime"),
        step: time("/algorithm/size"),
    };
    let step = reader.plain.description.experiment.step;
    if step.is_some_and(|step| step <= 0.0) {
        return Err(reader.fault("`algorithm.size`: a communication step is above 0 s"));
    }
    let mut notes = Vec::new();
    for key in times.as_object().into_iter().flat_map(Map::keys) {
        let is_other = KEYS.contains(&key.as_str()) || OTHERS.contains(&key.as_str());
        if let Some(meant) = suggestion(key, KEYS).filter(|_| !is_other) {
            let (file, key) = (&reader.shown, excerpt(key));
            notes.push(format!(
                "{file}: `{key}` means nothing; did you mean `{meant}`?"
            ));
        }
    }
    let is_variable = times.pointer("/algorithm/type") == Some(&Value::from("var-step"));
    notes.extend(is_variable.then(|| format!(
        "{}: the variable step size there follows constraints of its own; here it follows `--tolerance`",
        reader.shown
    )));
    Ok(Foreign {
        folder: package.path(""),
        description: reader.plain.description,
        notes,
        annotations: Vec::new(),
    })
}

/// JSON, in whose objects no key stands twice: of two a reader takes the last one without a word.
struct Once(Value);

impl<'de> Deserialize<'de> for Once {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(Visit).map(Self)
    }
}

struct Visit;

impl<'de> Visitor<'de> for Visit {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, own: bool) -> Result<Value, E> {
        Ok(own.into())
    }

    fn visit_i64<E>(self, own: i64) -> Result<Value, E> {
        Ok(own.into())
    }

    fn visit_u64<E>(self, own: u64) -> Result<Value, E> {
        Ok(own.into())
    }

    fn visit_f64<E>(self, own: f64) -> Result<Value, E> {
        Ok(own.into())
    }

    fn visit_str<E>(self, own: &str) -> Result<Value, E> {
        Ok(own.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Once(own)) = all.next_element()? {
            values.push(own);
        }
        Ok(values.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut all: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = all.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(A::Error::custom(format!(
                    "`{}` stands twice",
                    excerpt(&key)
                )));
            }
            let Once(own) = all.next_value()?;
            object.insert(key, own);
        }
        Ok(object.into())
    }
}

fn parsed(text: &str, shown: &str) -> Result<Value, SspError> {
    let read = serde_json::from_str(text).map(|Once(own)| own);
    read.map_err(|error| {
        let position = (error.line() as u32, error.column() as u32);
        let fault = error.to_string();
        let words = fault.rfind(" at line").map_or(&*fault, |at| &fault[..at]);
        SspError::Malformed {
            file: shown.to_owned(),
            position: Some(position),
            fault: match error.is_data() {
                true => words.to_owned(),
                false => format!("not well-formed JSON: {words}"),
            },
        }
    })
}

impl Reader {
    fn fault(&self, fault: impl Into<String>) -> SspError {
        SspError::Malformed {
            file: self.shown.clone(),
            position: None,
            fault: fault.into(),
        }
    }

    /// The object of a key; an empty one where there is none.
    fn object<'j>(
        &self,
        json: &'j Value,
        key: &str,
    ) -> Result<Option<&'j Map<String, Value>>, SspError> {
        match json.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::Object(own)) => Ok(Some(own)),
            Some(_) => Err(self.fault(format!("`{key}` is no object"))),
        }
    }

    fn system(&mut self, json: &Value, folder: &Path) -> Result<(), SspError> {
        for (key, file) in self.object(json, "fmus")?.into_iter().flatten() {
            let uri = file.as_str();
            let uri =
                uri.ok_or_else(|| self.fault(format!("`fmus.{}` is no text", excerpt(key))))?;
            let found =
                file_from(folder, uri).and_then(|file| Ok((self.plain.fmu(&file, uri)?, file)));
            let (model, file) =
                found.map_err(|fault| self.fault(format!("`fmus.{}`: {fault}", excerpt(key))))?;
            self.fmus.insert(key.clone(), (file, model));
        }
        let mut wires = Vec::new();
        for (from, to) in self.object(json, "connections")?.into_iter().flatten() {
            let targets = match to {
                Value::Array(own) => own.iter().map(Value::as_str).collect(),
                own => own
                    .as_str()
                    .map(|own| vec![Some(own)])
                    .unwrap_or(vec![None]),
            };
            for to in targets {
                let wrong = || {
                    self.fault(format!(
                        "`connections.{}` is no list of names",
                        excerpt(from)
                    ))
                };
                wires.push((from.as_str(), to.ok_or_else(wrong)?));
            }
        }
        let parameters = self.object(json, "parameters")?;
        let named = wires.iter().flat_map(|(from, to)| [*from, *to]);
        let named: Vec<&str> = named
            .chain(
                parameters
                    .into_iter()
                    .flat_map(|own| own.keys().map(String::as_str)),
            )
            .collect();
        for name in named {
            self.meet(name)?;
        }
        if self.instances.is_empty() {
            return Err(self.fault(
                "no connection and no parameter names an instance; nothing is to be simulated",
            ));
        }
        for (from, to) in wires {
            let [(a, gives), (b, takes)] = [self.end(from)?, self.end(to)?];
            if !gives || takes {
                return Err(self.fault(format!(
                    "`connections`: `{a}` -> `{b}` is not from an output to an input"
                )));
            }
            self.plain.wire(a, b, None);
        }
        for (name, value) in parameters.into_iter().flatten() {
            let (name, _) = self.end(name)?;
            let value = match value {
                Value::String(own) => own.clone(),
                Value::Number(_) | Value::Bool(_) => value.to_string(),
                _ => {
                    return Err(
                        self.fault(format!("`parameters`: `{}` is no value", excerpt(&name)))
                    );
                }
            };
            self.plain.set(name, value, None);
        }
        Ok(())
    }

    /// `{key}.instance.variable`.
    fn split<'t>(&self, name: &'t str) -> Result<Name<'t>, SspError> {
        let parts = || {
            let (key, rest) = name.split_at(name.find('}')? + 1);
            let (instance, variable) = rest.strip_prefix('.')?.split_once('.')?;
            let is_whole = key.starts_with('{') && !instance.is_empty() && !variable.is_empty();
            is_whole.then_some(Name {
                key,
                instance,
                variable,
            })
        };
        parts().ok_or_else(|| {
            self.fault(format!(
                "`{}` is not of the form {{fmu}}.instance.variable",
                excerpt(name)
            ))
        })
    }

    /// Adds the instance of a name, if it is new.
    fn meet(&mut self, name: &str) -> Result<(), SspError> {
        let own = self.split(name)?;
        let Some((file, _)) = self.fmus.get(own.key) else {
            return Err(self.fault(format!(
                "`{}`: `fmus` has no `{}`",
                excerpt(name),
                excerpt(own.key)
            )));
        };
        match self.instances.get(own.instance) {
            Some(known) if known == own.key => {}
            Some(known) => {
                let (instance, a, b) = (excerpt(own.instance), excerpt(known), excerpt(own.key));
                return Err(self.fault(format!(
                    "`{instance}` is an instance of `{a}` and of `{b}`; here names are of one"
                )));
            }
            None => {
                self.plain.instance(own.instance, file.clone(), None, false);
                self.instances
                    .insert(own.instance.to_owned(), own.key.to_owned());
            }
        }
        Ok(())
    }

    /// `instance.variable`, and whether it gives values.
    fn end(&self, name: &str) -> Result<(String, bool), SspError> {
        let own = self.split(name)?;
        let full = format!("{}.{}", own.instance, own.variable);
        let (_, model) = &self.fmus[own.key];
        let gives = gives(model, own.instance, own.variable);
        Ok((full, gives.map_err(|fault| self.fault(fault))?))
    }
}
