//! The declarations of a model file.

use crate::error::{Fault, ModelFileError};
use crate::fitted::{self, Fitted};
use crate::sure::{self, Uncertainty};
use crate::syntax::{Expression, Part};
use pilotage_text::document::{Document, DocumentError, Position, TomlTable, number};
use pilotage_text::is_identifier;
use pilotage_units::{Base, Product};
use std::collections::HashMap;
use std::ops::Range;

/// Maximum length of a file, in bytes.
pub const LONGEST: usize = 1 << 20;

/// Maximum number of variables of a model.
const MOST_VARIABLES: usize = 2000;

/// The declarations of a model file, with its expressions as written.
#[derive(Debug, Clone)]
pub struct ModelFile {
    /// Name of the file in messages.
    pub file: String,
    /// The whole text.
    pub text: String,
    /// Name of the model, a C identifier.
    pub name: String,
    /// Description of the model in one sentence.
    pub description: String,
    /// Reference for its equations.
    pub source: String,
    /// Variables provided from outside.
    pub inputs: Vec<Variable>,
    /// Variables that are constant in time.
    pub parameters: Vec<Variable>,
    /// Variables that are integrated.
    pub states: Vec<Variable>,
    /// Intermediate variables.
    pub locals: Vec<Variable>,
    /// Variables provided to the outside.
    pub outputs: Vec<Variable>,
    /// The fit that the start values come from, if they do.
    pub fit: Option<Fitted>,
    /// How uncertain that fit is of them.
    pub uncertainty: Option<Uncertainty>,
}

/// A declared variable.
#[derive(Debug, Clone)]
pub struct Variable {
    /// Name of the variable.
    pub name: String,
    /// Name of the unit; `None` if it is not checked.
    pub unit: Option<String>,
    /// Description in one line, without the unit.
    pub description: String,
    /// Start value of an input, parameter or state.
    pub start: Formula,
    /// Minimum.
    pub min: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Whether a parameter may be set between communication points.
    pub tunable: bool,
    /// Derivative of a state; value of a local or an output, if it has one.
    pub value: Option<Formula>,
    /// Limits of an output.
    pub limit: Option<[Formula; 2]>,
    /// Byte offset of the declaration in the text.
    pub(crate) byte: usize,
}

/// An expression and its position in the text.
#[derive(Debug, Clone)]
pub struct Formula {
    /// The expression.
    pub expression: Expression,
    /// Byte offset in the text of each part of the expression.
    bytes: Vec<usize>,
}

impl Formula {
    /// Byte offset in the text of a part.
    pub(crate) fn byte(&self, part: Part) -> usize {
        self.bytes[part]
    }

    /// A number without a position in a text.
    pub fn of_number(value: f64) -> Self {
        constant(value)
    }

    /// Line and column of its start in the text from which it was read.
    pub fn position(&self, text: &str) -> Position {
        let first = self.bytes.iter().min().copied();
        Position::of(text, first.unwrap_or_default())
    }

    /// The names used in the expression.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.expression.names().map(|(name, _)| name)
    }

    /// Its value, if it is written as a number.
    pub fn number(&self) -> Option<f64> {
        use crate::syntax::Term::{Negate, Number};
        match self.expression.terms[..] {
            [Number(number)] => Some(number),
            [Number(number), Negate(0)] => Some(-number),
            _ => None,
        }
    }
}

/// A table of a model file: its keys in addition to those of every variable, and the description of its variables.
struct Section {
    title: &'static str,
    keys: &'static [&'static str],
    role: &'static str,
}

const EVERY: [&str; 3] = ["unit", "nominal", "description"];

const SECTIONS: [Section; 5] = [
    Section {
        title: "inputs",
        keys: &["start", "min", "max"],
        role: "an input",
    },
    Section {
        title: "parameters",
        keys: &["start", "min", "max", "tunable"],
        role: "a parameter",
    },
    Section {
        title: "states",
        keys: &["der", "start", "min", "max"],
        role: "a state",
    },
    Section {
        title: "locals",
        keys: &["value"],
        role: "a local",
    },
    Section {
        title: "outputs",
        keys: &["value", "limit"],
        role: "an output",
    },
];

/// Names with a predefined meaning.
pub(crate) const RESERVED: [&str; 2] = ["time", "pi"];

/// The text of a model file with these tables of a fit, `[uncertainty]` and `[fit]`, at its end, replacing existing ones.
pub fn with_results(text: &str, tables: &str) -> String {
    let mut is_old = false;
    let mut kept = String::new();
    let is_of_fit = |line: &str| {
        let name = line.trim_start_matches('[').split([']', '.']).next();
        name.is_some_and(|name| [sure::TITLE, fitted::TITLE].contains(&name))
    };
    for line in text.split_inclusive('\n') {
        if line.starts_with('[') {
            is_old = is_of_fit(line);
        }
        if !is_old {
            kept += line;
        }
    }
    let whole = format!("{}\n\n{tables}", kept.trim_end());
    // A table written in another way, which no fit does, is kept.
    match Document::parse(&whole, "") {
        Ok(_) => whole,
        Err(_) => text.to_owned(),
    }
}

/// The text of a model file with other start values of inputs, parameters and states. Other names are ignored, and a
/// byte-order mark is removed.
pub fn with_starts(text: &str, values: &[(String, f64)]) -> String {
    let text = text.trim_start_matches('\u{feff}');
    let Ok(document) = Document::parse(text, "") else {
        return text.to_owned();
    };
    let mut edits: Vec<_> = (values.iter())
        .filter_map(|(name, value)| start_edit(text, document.root(), name, &number(*value)))
        .collect();
    edits.sort_by_key(|(place, _)| place.start);
    let mut changed = text.to_owned();
    for (place, written) in edits.into_iter().rev() {
        changed.replace_range(place, &written);
    }
    changed
}

/// The byte range of the start value of a variable in a text, and its replacement.
fn start_edit(
    text: &str,
    root: TomlTable<'_>,
    name: &str,
    value: &str,
) -> Option<(Range<usize>, String)> {
    let mut sections = ["inputs", "parameters", "states"]
        .into_iter()
        .filter_map(|title| root.table(title).ok()?);
    let section = sections.find(|section| section.has(name))?;
    let whole = section.bytes(name)?;
    // `gain = 0.5`, short for `gain = { start = 0.5 }`.
    let Ok(Some(own)) = section.table(name) else {
        return Some((whole, value.to_owned()));
    };
    if let Some(place) = own.bytes("start") {
        return Some((place, value.to_owned()));
    }
    let Some(first) = own.names().first().map(|key| own.byte_of_name(key)) else {
        let is_inline = text[whole.clone()].starts_with('{');
        let empty = (whole.clone(), format!("{{ start = {value} }}"));
        let headed = (whole.end..whole.end, format!("\nstart = {value}"));
        return Some(if is_inline { empty } else { headed });
    };
    let line = text[..first].rfind('\n').map_or(0, |end| end + 1);
    let before = &text[line..first];
    // Within braces, or on a new line that repeats the prefix of the first key: `gain.` of `gain.unit = "1"`.
    let written = match before.trim_end().ends_with('{') {
        true => format!("start = {value}, "),
        false => format!("start = {value}\n{before}"),
    };
    Some((first..first, written))
}

/// True if a text is a model file: TOML with a table `[model]`.
pub fn is_model(text: &str) -> bool {
    Document::parse(text, "").is_ok_and(|document| document.root().is_table("model"))
}

impl ModelFile {
    /// Reads the declarations of a text; `file` is its name in messages.
    pub(crate) fn declared(text: &str, file: &str) -> Result<Self, ModelFileError> {
        if text.len() > LONGEST {
            return Err(ModelFileError::TooLong {
                file: file.to_owned(),
                size: text.len(),
                limit: LONGEST,
            });
        }
        let document = Document::parse(text, file)?;
        let root = document.root();
        root.only(&[
            "model",
            "inputs",
            "parameters",
            "states",
            "locals",
            "outputs",
            sure::TITLE,
            fitted::TITLE,
        ])?;
        // Results of a fit for the parameters, which do not affect the equations.
        root.table(sure::TITLE)?;
        let reader = Reader {
            file,
            text,
            roles: roles(root)?,
        };
        let model = root.required("model", root.table("model")?)?;
        model.only(&["name", "description", "source"])?;
        let name = model.required("name", model.string("name")?)?;
        if !is_identifier(name) {
            let fault = Fault::NoName(name.to_owned());
            return Err(reader.at(model.content("name", None).byte(0), fault));
        }
        let mut sections = SECTIONS
            .iter()
            .map(|section| match root.table(section.title)? {
                Some(table) => reader.section(section, table),
                None => Ok(Vec::new()),
            });
        let mut next = || sections.next().unwrap_or_else(|| Ok(Vec::new()));
        let own = |key: &str| -> Result<String, DocumentError> {
            Ok(model.string(key)?.unwrap_or_default().trim().to_owned())
        };
        let mut declared = Self {
            file: file.to_owned(),
            text: text.to_owned(),
            name: name.to_owned(),
            description: own("description")?,
            source: own("source")?,
            inputs: next()?,
            parameters: next()?,
            states: next()?,
            locals: next()?,
            outputs: next()?,
            fit: Fitted::read(root)?,
            uncertainty: None,
        };
        declared.check_names(&reader)?;
        if let Some(table) = root.table(sure::TITLE)? {
            // A fit may also estimate a constant input, or the start value of a state.
            let is_known = |name: &str| declared.variables().any(|own| own.0.name == name);
            if let Some((byte, fault)) = sure::check(table, &is_known)? {
                return Err(reader.at(byte, fault));
            }
            declared.uncertainty = Uncertainty::read(table)?;
        }
        Ok(declared)
    }

    /// All variables with their kind: inputs, parameters, states, locals, outputs.
    pub fn variables(&self) -> impl Iterator<Item = (&Variable, &'static str)> {
        let lists = [
            &self.inputs,
            &self.parameters,
            &self.states,
            &self.locals,
            &self.outputs,
        ];
        let lists = lists.into_iter().zip(&SECTIONS);
        lists.flat_map(|(list, section)| list.iter().map(|variable| (variable, section.role)))
    }

    /// An error at a byte offset of the text.
    pub(crate) fn at(&self, byte: usize, fault: Fault) -> ModelFileError {
        at(&self.file, &self.text, byte, fault)
    }

    /// Rejects duplicate names.
    fn check_names(&self, reader: &Reader<'_>) -> Result<(), ModelFileError> {
        let mut known: HashMap<&str, &'static str> = HashMap::new();
        for (variable, role) in self.variables() {
            let name = variable.name.as_str();
            let before = known.get(name);
            let renamed = role == "an output" && variable.value.is_none();
            match before {
                Some(&("a state" | "a local")) if renamed => {}
                Some(before) => {
                    let name = name.to_owned();
                    return Err(reader.at(variable.byte, Fault::Twice { name, before }));
                }
                None if renamed => {
                    let name = name.to_owned();
                    return Err(reader.at(variable.byte, Fault::NoValue { name }));
                }
                None => {
                    known.insert(name, role);
                }
            }
        }
        let mut outputs = self.outputs.iter();
        if let Some(output) = outputs.find(|own| own.limit.is_some() && own.value.is_none()) {
            let fault = Fault::LimitWithoutValue(output.name.clone());
            return Err(reader.at(output.byte, fault));
        }
        let found = self.variables().count();
        if found > MOST_VARIABLES {
            let limit = MOST_VARIABLES;
            return Err(reader.at(0, Fault::TooMany { found, limit }));
        }
        let lists = [&self.states, &self.locals, &self.outputs];
        match lists.iter().all(|list| list.is_empty()) {
            true => Err(reader.at(0, Fault::NothingDeclared)),
            false => Ok(()),
        }
    }
}

/// File name and text, for the position of errors.
struct Reader<'t> {
    file: &'t str,
    text: &'t str,
    /// Kind of each declared name.
    roles: HashMap<&'t str, &'static str>,
}

impl Reader<'_> {
    fn at(&self, byte: usize, fault: Fault) -> ModelFileError {
        at(self.file, self.text, byte, fault)
    }

    /// The variables of a section.
    fn section(
        &self,
        section: &Section,
        table: TomlTable<'_>,
    ) -> Result<Vec<Variable>, ModelFileError> {
        let names = table.names().into_iter();
        names
            .map(|name| self.variable(section, table, name))
            .collect()
    }

    fn variable(
        &self,
        section: &Section,
        table: TomlTable<'_>,
        name: &str,
    ) -> Result<Variable, ModelFileError> {
        let byte = table.byte_of_name(name);
        if !is_identifier(name) {
            return Err(self.at(byte, Fault::NoName(name.to_owned())));
        }
        if RESERVED.contains(&name) {
            return Err(self.at(byte, Fault::Reserved(name.to_owned())));
        }
        let plain = Variable {
            name: name.to_owned(),
            unit: None,
            description: String::new(),
            start: constant(0.0),
            min: None,
            max: None,
            nominal: None,
            tunable: false,
            value: None,
            limit: None,
            byte,
        };
        match (table.is_table(name), section.title) {
            (false, "inputs" | "parameters") => Ok(Variable {
                start: constant(self.finite(table, name)?.unwrap_or_default()),
                ..plain
            }),
            (false, "locals" | "outputs") => Ok(Variable {
                value: self.formula(table, name)?,
                ..plain
            }),
            _ => {
                let own = table.required(name, table.table(name)?)?;
                self.detailed(section, own, plain)
            }
        }
    }

    /// A variable declared as a table.
    fn detailed(
        &self,
        section: &Section,
        own: TomlTable<'_>,
        plain: Variable,
    ) -> Result<Variable, ModelFileError> {
        own.only(&[section.keys, &EVERY].concat())?;
        let (value, start) = match section.title {
            "states" => (
                Some(own.required("der", self.formula(own, "der")?)?),
                self.formula(own, "start")?,
            ),
            "locals" => (
                Some(own.required("value", self.formula(own, "value")?)?),
                None,
            ),
            "outputs" => (self.formula(own, "value")?, None),
            "parameters" => {
                let start = own.required("start", self.finite(own, "start")?)?;
                (None, Some(constant(start)))
            }
            _ => (None, self.finite(own, "start")?.map(constant)),
        };
        let variable = Variable {
            unit: self.unit(own)?,
            description: own
                .string("description")?
                .unwrap_or_default()
                .trim()
                .to_owned(),
            start: start.unwrap_or_else(|| constant(0.0)),
            min: self.finite(own, "min")?,
            max: self.finite(own, "max")?,
            nominal: self.finite(own, "nominal")?,
            tunable: own.boolean("tunable")?.unwrap_or_default(),
            limit: self.limit(own)?,
            value,
            ..plain
        };
        self.check_range(own, &variable)?;
        Ok(variable)
    }

    fn check_range(&self, own: TomlTable<'_>, variable: &Variable) -> Result<(), ModelFileError> {
        let byte = |key: &str| own.content(key, None).byte(0);
        if let Some(nominal) = variable.nominal.filter(|nominal| *nominal <= 0.0) {
            return Err(self.at(byte("nominal"), Fault::Nominal(nominal)));
        }
        let min = variable.min.unwrap_or(f64::NEG_INFINITY);
        let max = variable.max.unwrap_or(f64::INFINITY);
        if min > max {
            return Err(self.at(byte("max"), Fault::Range { min, max }));
        }
        match variable.start.number() {
            Some(start) if !(min..=max).contains(&start) && variable.value.is_none() => {
                let key = match own.has("start") {
                    true => byte("start"),
                    false => variable.byte,
                };
                Err(self.at(key, Fault::StartRange { start, min, max }))
            }
            _ => Ok(()),
        }
    }

    fn unit(&self, own: TomlTable<'_>) -> Result<Option<String>, ModelFileError> {
        let Some(unit) = own.string("unit")? else {
            return Ok(None);
        };
        if Base::in_modelicas_spelling(unit).is_none() {
            let fault = Fault::UnknownUnit {
                unit: unit.to_owned(),
                known: Product::known(),
            };
            return Err(self.at(own.content("unit", None).byte(0), fault));
        }
        Ok(Some(unit.to_owned()))
    }

    fn finite(&self, table: TomlTable<'_>, key: &str) -> Result<Option<f64>, ModelFileError> {
        let number = table.number(key)?;
        if let Some(value) = number.filter(|value| !value.is_finite()) {
            let field = key.to_owned();
            let byte = table.content(key, None).byte(0);
            return Err(self.at(byte, Fault::NotFinite { field, value }));
        }
        Ok(number)
    }

    fn limit(&self, own: TomlTable<'_>) -> Result<Option<[Formula; 2]>, ModelFileError> {
        let Some([low, high]) = own.pair("limit")? else {
            return Ok(None);
        };
        Ok(Some([
            self.parsed(own, "limit", Some(0), &low)?,
            self.parsed(own, "limit", Some(1), &high)?,
        ]))
    }

    /// Replaces the fault of an unknown function that has the name of a variable: a product was probably meant.
    fn called(&self, fault: Fault) -> Fault {
        let Fault::UnknownFunction { name, .. } = &fault else {
            return fault;
        };
        let (role, name) = (self.roles.get(name.as_str()), name.clone());
        match role {
            Some(role) => Fault::NoFunction { name, role },
            None => fault,
        }
    }

    /// An expression: a string or a number.
    fn formula(&self, table: TomlTable<'_>, key: &str) -> Result<Option<Formula>, ModelFileError> {
        let Some(text) = table.expression(key)? else {
            return Ok(None);
        };
        self.parsed(table, key, None, &text).map(Some)
    }

    fn parsed(
        &self,
        table: TomlTable<'_>,
        key: &str,
        entry: Option<usize>,
        text: &str,
    ) -> Result<Formula, ModelFileError> {
        let content = table.content(key, entry);
        let parsed = Expression::parse(text);
        let expression =
            parsed.map_err(|(fault, offset)| self.at(content.byte(offset), self.called(fault)))?;
        let places = expression.places.iter();
        let bytes = places.map(|place| content.byte(place.start)).collect();
        Ok(Formula { expression, bytes })
    }
}

/// An expression of a file, in quotes or a number; none if the table has no such key.
///
/// # Errors
/// If it is not a valid expression. The message contains file, line and column.
pub fn formula(
    (file, text): (&str, &str),
    table: TomlTable<'_>,
    key: &str,
) -> Result<Option<Formula>, ModelFileError> {
    let reader = Reader {
        file,
        text,
        roles: HashMap::new(),
    };
    reader.formula(table, key)
}

/// A part of an expression in quotes, as `shown`: the text with what is no part of it replaced by as many other bytes.
///
/// # Errors
/// If it is not a valid expression. The message contains file, line and column.
pub fn formula_in(
    (file, text): (&str, &str),
    table: TomlTable<'_>,
    key: &str,
    shown: &str,
) -> Result<Formula, ModelFileError> {
    let reader = Reader {
        file,
        text,
        roles: HashMap::new(),
    };
    reader.parsed(table, key, None, shown)
}

fn at(file: &str, text: &str, byte: usize, fault: Fault) -> ModelFileError {
    ModelFileError::At {
        file: file.to_owned(),
        position: Position::of(text, byte),
        fault: Box::new(fault),
    }
}

/// Kind of each declared name.
fn roles<'t>(root: TomlTable<'t>) -> Result<HashMap<&'t str, &'static str>, DocumentError> {
    let mut roles = HashMap::new();
    for section in &SECTIONS {
        let table: Option<TomlTable<'t>> = root.table(section.title)?;
        let names = table.map(|table| table.names());
        let names = names.into_iter().flatten();
        roles.extend(names.map(|name| (name, section.role)));
    }
    Ok(roles)
}

pub(crate) fn constant(value: f64) -> Formula {
    Formula {
        expression: Expression::number(value),
        bytes: vec![0],
    }
}

#[cfg(test)]
mod tests {
    use super::{ModelFile, with_starts};

    fn changed(text: &str, values: &[(&str, f64)]) -> String {
        let values = values
            .iter()
            .map(|(name, value)| ((*name).to_owned(), *value));
        with_starts(text, &values.collect::<Vec<_>>())
    }

    #[test]
    fn starts_are_changed_however_they_are_written() {
        let text = "[parameters]\na = 0.5 # short\n\"b\" = 1\nc = { start = 2.0, min = 0 }\n[parameters.d]\nstart = 3\n";
        let values = [("a", 7.0), ("b", 8.0), ("c", 9.0), ("d", 10.0), ("e", 11.0)];
        let expected = "[parameters]\na = 7.0 # short\n\"b\" = 8.0\nc = { start = 9.0, min = 0 }\n[parameters.d]\nstart = 10.0\n";
        assert_eq!(changed(text, &values), expected);
        // A byte-order mark does not shift the positions.
        assert_eq!(changed(&format!("\u{feff}{text}"), &values), expected);
    }

    /// Inputs and states have no start unless one is given; an added one is read back correctly.
    #[test]
    fn starts_are_added_where_there_was_none() {
        let head = "[model]\nname = \"m\"\n";
        let text = "[inputs]\nu = {}\nw.unit = \"1\"\n[inputs.v]\nunit = \"m\"\n[inputs.t]\n[states]\nx = { der = \"-x\" }\ny.der = \"-y\"\n\
                    [states.z]\nder = \"w\"\n";
        let names = ["u", "w", "v", "t", "x", "y", "z"];
        let values: Vec<(&str, f64)> = names.into_iter().zip((1..).map(f64::from)).collect();
        let written = changed(&format!("{head}{text}"), &values);
        let file = ModelFile::declared(&written, "m.toml")
            .unwrap_or_else(|error| panic!("{error}: {written}"));
        let found: Vec<(&str, f64)> = (file.inputs.iter().chain(&file.states))
            .map(|own| (own.name.as_str(), own.start.number().expect("a number")))
            .collect();
        for value in values {
            assert!(found.contains(&value), "{value:?}: {written}");
        }
    }
}
