//! A problem from its file.

use crate::error::ProblemError;
use crate::file::{
    Calibration, Change, Constraint, Deviation, Fed, Hold, Holds, Initial, Measured, Mesh, Noise,
    Options, Per, Prior, ProblemFile, Quantity, RunLine, Set, Sought, Stability,
};
use crate::runs;
use pilotage_collocation::Scheme;
use pilotage_cosim::description::Said;
use pilotage_cosim::{DescriptionError, SystemDescription};
use pilotage_inference::Method;
use pilotage_language::file::{Formula, LONGEST, formula};
use pilotage_text::document::{self, Document, DocumentError, Place, TomlTable};
use pilotage_text::is_identifier;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use pilotage_units::Base;
use std::path::Path;

/// The tables of a problem file.
const KEYS: [&str; 11] = [
    "system",
    "connect",
    "inputs",
    "measured",
    "parameters",
    "initial",
    "constraint",
    "derived",
    "stability",
    "run",
    "fit",
];

/// Tables of a problem file that no other kind of file has.
pub const OWN_KEYS: [&str; 6] = [
    "measured",
    "fit",
    "constraint",
    "derived",
    "initial",
    "stability",
];

type Read<T> = Result<T, ProblemError>;

impl ProblemFile {
    /// Reads a problem file.
    ///
    /// # Errors
    /// When it cannot be read or there is a mistake in it: with file, line and column.
    pub fn read(path: &Path) -> Read<Self> {
        Self::parse(&document::read(path)?, path)
    }

    /// The problem that a text says; files that it names are beside `path`.
    ///
    /// # Errors
    /// When there is a mistake in it: with file, line and column.
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
        Ok(Self {
            inputs: reader.inputs(root)?,
            measured: reader.measured(root)?,
            parameters: reader.parameters(root)?,
            initial: reader.initial(root)?,
            constraints: reader.constraints(root)?,
            derived: reader.derived(root)?,
            stability: stability(root)?,
            runs: reader.runs(root)?,
            options: options(root)?,
            mesh_place: root.table("fit")?.and_then(|fit| fit.place("mesh_step")),
            folder: folder.to_owned(),
            text: text.to_owned(),
            system,
            file: file.clone(),
        })
    }
}

/// The system, in this file or another.
fn system(root: TomlTable<'_>, folder: &Path) -> Read<SystemDescription> {
    if root.has("system") && !root.is_table("system") {
        let name = root.required("system", root.string("system")?)?;
        if root.has("connect") {
            let fault = format!("the wires stand in {name}; leave [connect] out");
            return Err(at(root, "connect", fault));
        }
        let file = folder.join(name);
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

/// Refuses single brackets where entries are listed, and double ones elsewhere.
fn check_brackets(root: TomlTable<'_>) -> Read<()> {
    for name in root.names() {
        let is_list = ["measured", "constraint", "run"].contains(&name);
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

/// A mistake at a field's value, or at its name where that is a table of its own.
fn at(table: TomlTable<'_>, field: &str, fault: impl Into<String>) -> ProblemError {
    ProblemError::at(&place(table, field), fault)
}

fn place(table: TomlTable<'_>, field: &str) -> Place {
    let own = match table.is_table(field) {
        true => table.key_place(field),
        false => table.place(field),
    };
    own.or_else(|| table.key_place(field))
        .unwrap_or_else(|| place_of(table))
}

/// Where a table of its own stands.
fn place_of(table: TomlTable<'_>) -> Place {
    let position = table.position("");
    Place {
        file: table.file().to_owned(),
        line: position.line,
        column: Some(position.column),
    }
}

/// One of several words.
fn word<T: Copy>(table: TomlTable<'_>, field: &str, words: &[(&str, T)], default: T) -> Read<T> {
    let Some(found) = table.string(field)? else {
        return Ok(default);
    };
    one_of(words, found).map_err(|fault| at(table, field, fault))
}

fn one_of<T: Copy>(words: &[(&str, T)], found: &str) -> Result<T, String> {
    let names = || words.iter().map(|(name, _)| *name);
    let known = words.iter().find(|(name, _)| *name == found);
    known.map(|(_, value)| *value).ok_or_else(|| {
        let all: Vec<String> = names().map(|name| format!("\"{name}\"")).collect();
        let near = did_you_mean(suggestion(found, names()));
        format!("\"{found}\" is none of {}{near}", all.join(", "))
    })
}

fn finite(table: TomlTable<'_>, field: &str) -> Read<Option<f64>> {
    let number = table.number(field)?;
    match number.filter(|number| !number.is_finite()) {
        Some(number) => {
            let fault =
                format!("`{field} = {number}` is not a finite number; leave it out, or write one");
            Err(at(table, field, fault))
        }
        None => Ok(number),
    }
}

fn positive(table: TomlTable<'_>, field: &str) -> Read<Option<f64>> {
    let number = finite(table, field)?;
    match number.filter(|number| *number <= 0.0) {
        Some(number) => Err(at(
            table,
            field,
            format!("`{field} = {}`; expected a number above 0", shown(number)),
        )),
        None => Ok(number),
    }
}

/// A number, short: 1e-8 and 3, neither 0.00000001 nor 3.0.
fn shown(number: f64) -> String {
    let [plain, other] = [format!("{number}"), format!("{number:?}")];
    match other.len() < plain.len() {
        true => other,
        false => plain,
    }
}

/// A tolerance that numbers can resolve, and that means something: what it bounds is scaled to the order of one.
fn tolerance(table: TomlTable<'_>, field: &str) -> Read<Option<f64>> {
    const LEAST: f64 = 1e-14;
    const MOST: f64 = 1.0;
    match positive(table, field)? {
        Some(number) if number < LEAST => {
            let number = shown(number);
            let fault =
                format!("`{field} = {number}` is finer than numbers are; write {LEAST:?} or more");
            Err(at(table, field, fault))
        }
        Some(number) if number > MOST => {
            let number = shown(number);
            let fault =
                format!("`{field} = {number}` would let anything pass; write {MOST:?} or less");
            Err(at(table, field, fault))
        }
        other => Ok(other),
    }
}

/// The name of a unit.
fn unit(table: TomlTable<'_>) -> Read<Option<String>> {
    let name = table.string("unit")?;
    match name.filter(|name| Base::in_modelicas_spelling(name).is_none()) {
        Some(name) => {
            let near = did_you_mean(pilotage_units::respelt(name).as_deref());
            let fault = format!(
                "unknown unit `{name}`{near}; write it as in m/s2 or 1/(m.s), `1` where there is no dimension, or leave \
                 it out"
            );
            Err(at(table, "unit", fault))
        }
        None => Ok(name.map(str::to_owned)),
    }
}

fn whole(table: TomlTable<'_>, field: &str, default: usize, most: usize) -> Read<usize> {
    let Some(number) = finite(table, field)? else {
        return Ok(default);
    };
    match number.fract() == 0.0 && (1.0..=most as f64).contains(&number) {
        true => Ok(number as usize),
        false => {
            let number = shown(number);
            let fault = format!("`{field} = {number}`; expected a whole number from 1 to {most}");
            Err(at(table, field, fault))
        }
    }
}

fn range(table: TomlTable<'_>) -> Read<[Option<f64>; 2]> {
    let [min, max] = [finite(table, "min")?, finite(table, "max")?];
    match (min, max) {
        (Some(least), Some(most)) if least > most => {
            let fault = format!("`min = {least}` is above `max = {most}`; exchange them");
            Err(at(table, "max", fault))
        }
        _ => Ok([min, max]),
    }
}

struct Reader<'t> {
    file: &'t str,
    text: &'t str,
    folder: &'t Path,
    instances: Vec<String>,
    /// What `[parameters]` names.
    own: Vec<String>,
}

/// A table, one of its fields, and the name that the field means: `instance.variable`.
type Entry<'a> = (TomlTable<'a>, &'a str, Said<String>);

impl Reader<'_> {
    /// The fields of a table; those of `[section.instance]` have the instance's name before theirs.
    fn entries<'a>(&self, table: TomlTable<'a>) -> Read<Vec<Entry<'a>>> {
        let said = |table: TomlTable<'_>, field: &str, value: String| Said {
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
                        found.push((inner, field, said(inner, field, full)));
                    }
                }
                _ => found.push((table, name, said(table, name, name.to_owned()))),
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

    fn inputs(&self, root: TomlTable<'_>) -> Read<Vec<Fed>> {
        const HOLDS: [(&str, Hold); 4] = [
            ("linear", Hold::Linear),
            ("zero-order", Hold::Zero),
            ("foh", Hold::Linear),
            ("zoh", Hold::Zero),
        ];
        let mut all = Vec::new();
        for (table, field, signal) in self.section(root, "inputs")? {
            let (own, key) = match table.is_table(field) {
                true => (table.required(field, table.table(field)?)?, "column"),
                false => (table, field),
            };
            let mut hold = Hold::Linear;
            if table.is_table(field) {
                own.only(&["column", "hold"])?;
                hold = word(own, "hold", &HOLDS, hold)?;
            }
            all.push(Fed {
                signal,
                column: column(own, key)?,
                hold,
            });
        }
        Ok(all)
    }

    /// One of these words, or an expression that is none: a word that is nearly one is a mistake, but for names of
    /// the problem's own parameters.
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

    fn measured(&self, root: TomlTable<'_>) -> Read<Vec<Measured>> {
        let tables = root.tables("measured")?;
        if tables.is_empty() {
            let fault = "nothing is measured; add [[measured]] with signal = \"instance.variable\" and column = \"...\"";
            return Err(at(root, "measured", fault));
        }
        tables
            .into_iter()
            .map(|table| self.one_measured(table))
            .collect()
    }

    fn one_measured(&self, table: TomlTable<'_>) -> Read<Measured> {
        table.only(&[
            "signal",
            "expression",
            "unit",
            "column",
            "sd",
            "gain",
            "offset",
            "noise",
            "dof",
        ])?;
        let of = match (table.string("signal")?, self.formula(table, "expression")?) {
            (Some(_), Some(_)) => {
                let fault = "a signal and an expression are measured in one entry; leave one out";
                return Err(at(table, "expression", fault));
            }
            (Some(signal), None) => Quantity::Signal(signal.to_owned()),
            (None, Some(formula)) => Quantity::Expression(formula, unit(table)?),
            (None, None) => {
                let fault = "nothing is measured; write signal = \"instance.variable\", or expression = \"...\"";
                return Err(ProblemError::at(&place_of(table), fault));
            }
        };
        if table.has("unit") && matches!(of, Quantity::Signal(_)) {
            return Err(at(
                table,
                "unit",
                "a signal has its model's unit; leave `unit` out",
            ));
        }
        let noise = word(
            table,
            "noise",
            &[
                ("normal", Noise::Normal),
                ("log-normal", Noise::LogNormal),
                ("laplace", Noise::Laplace),
                ("student", Noise::Student(4.0)),
            ],
            Noise::Normal,
        )?;
        let dof = positive(table, "dof")?;
        let noise = match (noise, dof) {
            (Noise::Student(default), dof) => Noise::Student(dof.unwrap_or(default)),
            (_, Some(_)) => {
                let fault = "degrees of freedom belong to noise = \"student\"; leave `dof` out";
                return Err(at(table, "dof", fault));
            }
            (other, None) => other,
        };
        Ok(Measured {
            place: place(
                table,
                if table.has("signal") {
                    "signal"
                } else {
                    "expression"
                },
            ),
            of,
            column: column(table, "column")?,
            sd: self.deviation(table)?,
            gain: self.calibration(table, "gain", 1.0)?,
            offset: self.calibration(table, "offset", 0.0)?,
            noise,
        })
    }

    fn deviation(&self, table: TomlTable<'_>) -> Read<Deviation> {
        if table.is_table("sd") {
            let own = table.required("sd", table.table("sd")?)?;
            own.only(&["column"])?;
            return Ok(Deviation::Column(column(own, "column")?));
        }
        let formula = self
            .formula(table, "sd")?
            .unwrap_or_else(|| Formula::of_number(1.0));
        if let Some(number) = formula
            .number()
            .filter(|number| *number <= 0.0 || !number.is_finite())
        {
            let fault =
                format!("the noise's standard deviation is {number}; expected a number above 0");
            return Err(at(table, "sd", fault));
        }
        Ok(Deviation::Formula(formula))
    }

    fn calibration(&self, table: TomlTable<'_>, field: &str, default: f64) -> Read<Calibration> {
        if table.is_table(field) {
            let own = table.required(field, table.table(field)?)?;
            own.only(&["per"])?;
            return Ok(Calibration::Sought(per(own)?));
        }
        self.check_word(table, field, &["free"])?;
        let formula = match table.string(field) {
            Ok(Some("free")) => return Ok(Calibration::Sought(Per::All)),
            _ => self.formula(table, field)?,
        };
        let number = formula.as_ref().and_then(Formula::number);
        if field == "gain" && number == Some(0.0) {
            let fault =
                "the sensor shows nothing of what it measures; write another number, or \"free\"";
            return Err(at(table, field, fault));
        }
        Ok(Calibration::Formula(
            formula.unwrap_or_else(|| Formula::of_number(default)),
        ))
    }

    fn parameters(&self, root: TomlTable<'_>) -> Read<Vec<Sought>> {
        let entries = self.section(root, "parameters")?;
        entries
            .into_iter()
            .map(|entry| self.sought(entry))
            .collect()
    }

    fn sought(&self, (table, field, name): Entry<'_>) -> Read<Sought> {
        let Ok(Some(own)) = table.table(field) else {
            let name = &name.value;
            let fault = format!(
                "`{name}` is no table; write {{ start = ... }}, with fixed = true for a number"
            );
            return Err(at(table, field, fault));
        };
        own.only(&[
            "start",
            "min",
            "max",
            "nominal",
            "unit",
            "fixed",
            "value",
            "per",
            "scale",
            "prior",
            "description",
        ])?;
        let [min, max] = range(own)?;
        let sought = Sought {
            start: finite(own, "start")?,
            min,
            max,
            nominal: positive(own, "nominal")?,
            unit: unit(own)?,
            fixed: own.boolean("fixed")?.unwrap_or_default(),
            value: self.formula(own, "value")?,
            per: per(own)?,
            log: word(own, "scale", &[("linear", false), ("log", true)], false)?,
            prior: prior(own)?,
            name,
        };
        check_sought(own, &sought)?;
        Ok(sought)
    }

    fn initial(&self, root: TomlTable<'_>) -> Read<Vec<(Said<String>, Initial)>> {
        let mut all = Vec::new();
        for (table, field, name) in self.section(root, "initial")? {
            self.check_word(table, field, &["free", "steady", "first sample"])?;
            let initial = match table.string(field) {
                Ok(Some("free")) => Initial::Free,
                Ok(Some("steady")) => Initial::Steady,
                Ok(Some("first sample")) => Initial::FirstSample,
                _ => {
                    let formula = self.formula(table, field)?;
                    Initial::Formula(table.required(field, formula)?)
                }
            };
            all.push((name, initial));
        }
        Ok(all)
    }

    fn derived(&self, root: TomlTable<'_>) -> Read<Vec<(Said<String>, Formula)>> {
        let mut all = Vec::new();
        let Some(table) = root.table("derived")? else {
            return Ok(all);
        };
        for field in table.names() {
            if !is_identifier(field) || ["time", "pi", "y"].contains(&field) {
                let fault =
                    format!("`{field}` cannot be a name; take another of letters, digits and _");
                return Err(at(table, field, fault));
            }
            let formula = self.formula(table, field)?;
            let name = Said {
                value: field.to_owned(),
                place: table.key_place(field),
            };
            all.push((name, table.required(field, formula)?));
        }
        Ok(all)
    }

    fn constraints(&self, root: TomlTable<'_>) -> Read<Vec<Constraint>> {
        const PLACES: [(&str, Holds); 4] = [
            ("samples", Holds::Samples),
            ("start", Holds::Start),
            ("end", Holds::End),
            ("parameters", Holds::Parameters),
        ];
        let mut all = Vec::new();
        for table in root.tables("constraint")? {
            table.only(&["expression", "min", "max", "at"])?;
            let formula = table.required("expression", self.formula(table, "expression")?)?;
            let [min, max] = range(table)?;
            if min.is_none() && max.is_none() {
                let fault = "nothing is bounded; write `min`, `max` or both";
                return Err(ProblemError::at(&place_of(table), fault));
            }
            let holds = word(table, "at", &PLACES, Holds::Samples)?;
            if holds == Holds::Parameters && min == max {
                let fault = "an equation of parameters; tie one of them by `value = \"...\"` in [parameters]";
                return Err(at(table, "min", fault));
            }
            all.push(Constraint {
                place: place(table, "expression"),
                formula,
                min: min.unwrap_or(f64::NEG_INFINITY),
                max: max.unwrap_or(f64::INFINITY),
                at: holds,
            });
        }
        Ok(all)
    }

    fn runs(&self, root: TomlTable<'_>) -> Read<Vec<RunLine>> {
        let mut runs = Vec::new();
        for table in root.tables("run")? {
            runs.push(self.run(table)?);
        }
        if !runs.iter().any(|run| run.fits) {
            let fault = "no run to fit; add [[run]] with file = \"run.csv\"";
            return Err(at(root, "run", fault));
        }
        runs::name(&mut runs);
        runs::check_twice(&runs)?;
        Ok(runs)
    }

    fn run(&self, table: TomlTable<'_>) -> Read<RunLine> {
        table.only(&[
            "file",
            "use",
            "weight",
            "subject",
            "set",
            "change",
            "start_time",
        ])?;
        let file = table.required("file", table.string("file")?)?;
        let mut changes: Vec<Change> = Vec::new();
        for change in table.tables("change")? {
            change.only(&["time", "set"])?;
            let time = change.required("time", finite(change, "time")?)?;
            if changes.last().is_some_and(|before| time <= before.time) {
                let fault = "changes stand in the order of their times; this one is not later than the one before";
                return Err(at(change, "time", fault));
            }
            let set = change.required("set", change.table("set")?)?;
            changes.push(Change {
                time,
                place: place(change, "time"),
                set: self.set(set)?,
            });
        }
        Ok(RunLine {
            file: self.folder.join(file),
            name: String::new(),
            place: place(table, "file"),
            fits: word(table, "use", &[("fit", true), ("validation", false)], true)?,
            weight: positive(table, "weight")?.unwrap_or(1.0),
            subject: table.text("subject")?,
            start_time: finite(table, "start_time")?.map(|value| Said {
                value,
                place: table.place("start_time"),
            }),
            set: match table.table("set")? {
                Some(set) => self.set(set)?,
                None => Vec::new(),
            },
            changes,
        })
    }

    fn set(&self, table: TomlTable<'_>) -> Read<Vec<Set>> {
        let mut all = Vec::new();
        for (table, field, name) in self.entries(table)? {
            let value = table.required(field, self.formula(table, field)?)?;
            all.push(Set { name, value });
        }
        Ok(all)
    }
}

/// What of a sought parameter contradicts itself.
fn check_sought(own: TomlTable<'_>, sought: &Sought) -> Read<()> {
    if sought.value.is_some() {
        for field in [
            "start", "min", "max", "nominal", "fixed", "per", "scale", "prior",
        ] {
            if own.has(field) {
                let fault = format!(
                    "a tied parameter has no `{field}`; bound it by a [[constraint]], or leave `value` out"
                );
                return Err(at(own, field, fault));
            }
        }
    }
    if sought.fixed && sought.per != Per::All {
        return Err(at(
            own,
            "per",
            "a fixed parameter has one value; give others by `set` in a [[run]]",
        ));
    }
    if sought.fixed && sought.prior.is_some() {
        let fault = "a fixed parameter has no prior; leave `fixed` or `prior` out";
        return Err(at(own, "prior", fault));
    }
    let is_log_normal = sought.prior.is_some_and(|prior| prior.log);
    if is_log_normal && sought.min.is_some_and(|min| min < 0.0) {
        let fault = "a log-normal prior is of a value above 0; raise `min`, or write prior = { normal = ... }";
        return Err(at(own, "min", fault));
    }
    if sought.log {
        for (field, value) in [("start", sought.start), ("min", sought.min)] {
            if value.is_some_and(|value| value <= 0.0) {
                let fault =
                    format!("a parameter on a logarithmic scale is above 0; change `{field}`");
                return Err(at(own, field, fault));
            }
        }
    }
    let within = sought.min.unwrap_or(f64::NEG_INFINITY)..=sought.max.unwrap_or(f64::INFINITY);
    match sought.start {
        Some(start) if !within.contains(&start) => {
            let fault = format!(
                "`start = {start}` is out of the range {} to {}; move it or the range",
                within.start(),
                within.end()
            );
            Err(at(own, "start", fault))
        }
        _ => Ok(()),
    }
}

fn column(table: TomlTable<'_>, field: &str) -> Read<Said<String>> {
    let name = table.required(field, table.string(field)?)?;
    Ok(Said {
        value: name.to_owned(),
        place: table.place(field),
    })
}

fn per(table: TomlTable<'_>) -> Read<Per> {
    word(
        table,
        "per",
        &[("run", Per::Run), ("subject", Per::Subject)],
        Per::All,
    )
}

fn prior(table: TomlTable<'_>) -> Read<Option<Prior>> {
    let Some(own) = table.table("prior")? else {
        return Ok(None);
    };
    own.only(&["normal", "log-normal"])?;
    let mut found = None;
    for (field, log) in [("normal", false), ("log-normal", true)] {
        if !own.has(field) {
            continue;
        }
        if found.is_some() {
            let fault = "a parameter has one prior; leave this one or the other out";
            return Err(at(own, field, fault));
        }
        let pair = own.pair(field).ok().flatten();
        let numbers = pair.and_then(|[mean, sd]| Some((mean.parse().ok()?, sd.parse().ok()?)));
        let good = |(mean, sd): &(f64, f64)| mean.is_finite() && sd.is_finite() && *sd > 0.0;
        let Some((mean, sd)) = numbers.filter(good) else {
            let fault = "a prior is [mean, standard deviation], two numbers, the latter above 0";
            return Err(at(own, field, fault));
        };
        found = Some(Prior { mean, sd, log });
    }
    match found {
        Some(prior) => Ok(Some(prior)),
        None => Err(at(
            table,
            "prior",
            "the prior is empty; write prior = { normal = [mean, sd] }",
        )),
    }
}

fn stability(root: TomlTable<'_>) -> Read<Stability> {
    let Some(table) = root.table("stability")? else {
        return Ok(Stability::default());
    };
    table.only(&["models", "closed_loop"])?;
    let models = table.strings("models")?.unwrap_or_default();
    let models = models.into_iter().map(|(name, place)| Said {
        value: name.to_owned(),
        place: Some(place),
    });
    let closed = table.boolean("closed_loop")?.unwrap_or_default();
    Ok(Stability {
        models: models.collect(),
        closed_loop: closed.then(|| place(table, "closed_loop")),
    })
}

/// Most iterations of a start.
const MOST: usize = 100_000;

/// Most starts of a fit: each is held until the best is known.
const MOST_STARTS: usize = 1000;

fn options(root: TomlTable<'_>) -> Read<Options> {
    let mut options = Options::default();
    let Some(table) = root.table("fit")? else {
        return Ok(options);
    };
    let meshes = ["mesh_tolerance", "mesh_step", "mesh"];
    table.only(&[
        "scheme",
        meshes[0],
        meshes[1],
        meshes[2],
        "tolerance",
        "starts",
        "max_iterations",
        "covariance",
    ])?;
    if let Some(name) = table.string("scheme")? {
        let scheme: Result<Scheme, _> = name.parse();
        let known = ["euler", "trapezoid", "hermite-simpson"];
        let near = did_you_mean(suggestion(name, known));
        let scheme = scheme.map_err(|error| at(table, "scheme", format!("{error}{near}")));
        options.scheme = Some(scheme?);
    }
    let mut given = meshes.iter().filter(|field| table.has(field));
    if let (Some(first), Some(second)) = (given.next(), given.next()) {
        let fault = format!("`{first}` and `{second}` both say where the nodes are; leave one out");
        return Err(at(table, second, fault));
    }
    if let Some(tolerance) = tolerance(table, "mesh_tolerance")? {
        options.mesh = Mesh::Tolerance(tolerance);
    }
    if let Some(step) = positive(table, "mesh_step")? {
        options.mesh = Mesh::Step(step);
    }
    options.mesh = word(table, "mesh", &[("samples", Mesh::Samples)], options.mesh)?;
    options.tolerance = tolerance(table, "tolerance")?.unwrap_or(options.tolerance);
    options.starts = whole(table, "starts", options.starts, MOST_STARTS)?;
    options.max_iterations = whole(table, "max_iterations", options.max_iterations, MOST)?;
    let methods = Method::ALL.map(|method| (method.as_str(), Some(method)));
    options.covariance = word(table, "covariance", &methods, options.covariance)?;
    Ok(options)
}
