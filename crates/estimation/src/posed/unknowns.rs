//! The role of each parameter of a problem: a number, sought, or tied to others.

use crate::posed::ranges::{check_model_range, check_range, check_start};
use crate::problem::error::ProblemError;
use crate::problem::file::{Calibration, Measured, Per, Prior, ProblemFile, Quantity, Sought};
use crate::system::joint::{Joint, unknown};
use crate::system::part::About;
use pilotage_cosim::description::Spanned;
use pilotage_language::file::Formula;
use pilotage_text::document::Place;
use pilotage_text::is_identifier;
use std::collections::HashMap;

/// A sought parameter.
#[derive(Debug, Clone)]
pub struct Unknown {
    /// Its name.
    pub name: String,
    /// Name of its unit, if it has one.
    pub unit: Option<String>,
    /// Where the search starts.
    pub start: f64,
    /// Minimum value.
    pub min: Option<f64>,
    /// Maximum value.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// The search uses its logarithm.
    pub log: bool,
    /// Its prior.
    pub prior: Option<Prior>,
    /// What it has separate values for.
    pub per: Per,
    /// Its value in the model, if a pattern such as `instance.*` asks for it: it keeps that if nothing measured depends on it.
    pub unless_needed: Option<f64>,
    /// Its place in the file.
    pub place: Option<Place>,
}

/// Role of a parameter.
#[derive(Debug, Clone)]
pub enum Meaning {
    /// A number.
    Number(f64),
    /// Sought: its index among the unknowns.
    Unknown(usize),
    /// Tied to others.
    Tied(Formula),
}

/// All parameters of a problem: those of the instances, inputs that are not driven, and the problem's own.
#[derive(Debug)]
pub struct Parameters {
    /// Their names.
    pub names: Vec<String>,
    /// The role of each.
    pub meanings: HashMap<String, Meaning>,
    /// The sought parameters.
    pub unknowns: Vec<Unknown>,
    /// Units of the problem's own parameters.
    own_units: HashMap<String, Option<String>>,
}

/// Name of a sensor's sought gain or offset.
pub fn calibration(what: &str, column: &str) -> String {
    format!("{what}({column})")
}

/// Whether a line is for all parameters of an instance.
fn is_pattern(line: &Sought) -> bool {
    line.name.value.ends_with(".*")
}

/// Whether this is the name of the gain or offset of a measured column.
fn is_sensor(name: &str, file: &ProblemFile) -> bool {
    let mut columns = file.measured.iter().map(|own| &own.column.value);
    columns.any(|column| {
        ["gain", "offset"]
            .map(|what| calibration(what, column))
            .iter()
            .any(|own| own == name)
    })
}

impl Parameters {
    /// The parameters of a file with these instances.
    ///
    /// # Errors
    /// When a line refers to nothing, or a start is missing or out of range.
    pub fn new(file: &ProblemFile, joint: &Joint) -> Result<Self, ProblemError> {
        let fed = |name: &String| file.inputs.iter().any(|fed| fed.signal.value == *name);
        let inputs = joint
            .model
            .inputs
            .iter()
            .filter(|name| !fed(name) && !name.starts_with("wire "))
            .filter(|name| joint.delayed().all(|own| own.name != **name));
        let names: Vec<String> = joint
            .model
            .parameters
            .iter()
            .chain(inputs)
            .cloned()
            .collect();
        let start = |name: &String| joint.variables.get(name).map_or(0.0, |about| about.start);
        let meanings = names
            .iter()
            .map(|name| (name.clone(), Meaning::Number(start(name))));
        let mut all = Self {
            meanings: meanings.collect(),
            names,
            unknowns: Vec::new(),
            own_units: HashMap::new(),
        };
        all.set(file, joint)?;
        for line in file.parameters.iter().filter(|line| is_pattern(line)) {
            all.seek_all(line, file, joint)?;
        }
        for line in file.parameters.iter().filter(|line| !is_pattern(line)) {
            all.seek(line, false, file, joint)?;
        }
        for measured in &file.measured {
            all.calibrate(measured, joint)?;
        }
        Ok(all)
    }

    /// Name of a parameter's unit, if it has one.
    pub fn unit<'a>(&'a self, name: &str, joint: &'a Joint) -> Option<&'a str> {
        match self.own_units.get(name) {
            Some(unit) => unit.as_deref(),
            None => joint.unit(name),
        }
    }

    /// Applies the values set by the system.
    fn set(&mut self, file: &ProblemFile, joint: &Joint) -> Result<(), ProblemError> {
        for setting in &file.system.settings {
            let name = &setting.name;
            let Some(Meaning::Number(value)) = self.meanings.get_mut(&name.value) else {
                return Err(no_parameter(name, file, joint, &self.names));
            };
            let number = setting
                .value
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite());
            *value = number.ok_or_else(|| {
                let fault = format!("`{}` is {}; expected a number", name.value, setting.value);
                ProblemError::maybe_at(name.place.as_ref(), fault)
            })?;
            let value = *value;
            let range = self.range(&name.value, joint);
            check_range(&name.value, value, range, name.place.as_ref())?;
        }
        Ok(())
    }

    /// Minimum and maximum value of a parameter, if any.
    pub fn range(&self, name: &str, joint: &Joint) -> [Option<f64>; 2] {
        match self.meanings.get(name) {
            Some(Meaning::Unknown(k)) => [self.unknowns[*k].min, self.unknowns[*k].max],
            _ => {
                let about = joint.variables.get(name);
                about.map_or([None; 2], |about| [about.min, about.max])
            }
        }
    }

    /// Seeks all parameters of an instance without lines of their own, except those of its FMU that are start values of
    /// states.
    fn seek_all(
        &mut self,
        line: &Sought,
        file: &ProblemFile,
        joint: &Joint,
    ) -> Result<(), ProblemError> {
        let instance = line.name.value.trim_end_matches('*');
        let own = joint.model.parameters.iter();
        let own = own.filter(|name| name.starts_with(instance));
        let own: Vec<&String> = own.filter(|name| !joint.is_start_parameter(name)).collect();
        if own.is_empty() {
            let named = instance.trim_end_matches('.');
            if joint.parts.iter().any(|(name, _)| name == named) {
                let fault = format!("`{named}` has no parameters; leave the line out");
                return Err(ProblemError::maybe_at(line.name.place.as_ref(), fault));
            }
            let known: Vec<String> = joint
                .parts
                .iter()
                .map(|(name, _)| format!("{name}.*"))
                .collect();
            let fault = unknown("instance with parameters", &line.name.value, &known);
            return Err(ProblemError::maybe_at(line.name.place.as_ref(), fault));
        }
        let has_line = |name: &&&String| {
            file.parameters
                .iter()
                .any(|line| line.name.value == ***name)
        };
        for name in own.iter().filter(|name| !has_line(name)).copied() {
            let mut one = line.clone();
            one.name.value.clone_from(name);
            self.seek(&one, true, file, joint)?;
        }
        Ok(())
    }

    fn seek(
        &mut self,
        line: &Sought,
        by_pattern: bool,
        file: &ProblemFile,
        joint: &Joint,
    ) -> Result<(), ProblemError> {
        let name = &line.name.value;
        let place = line.name.place.as_ref();
        let fault = |text: String| ProblemError::maybe_at(place, text);
        let is_part = self.names.contains(name);
        if !is_part {
            self.declare(line, file, joint)?;
        } else if line.unit.is_some() {
            return Err(fault(format!(
                "`{name}` has its model's unit; leave `unit` out"
            )));
        }
        if let Some(formula) = &line.value {
            self.meanings
                .insert(name.clone(), Meaning::Tied(formula.clone()));
            return Ok(());
        }
        let about = joint.variables.get(name).filter(|_| is_part);
        let none = About::default();
        let about = about.unwrap_or(&none);
        let before = match self.meanings.get(name) {
            Some(Meaning::Number(value)) if is_part => Some(*value),
            _ => None,
        };
        check_model_range(line, about, joint)?;
        let start = line.start.or(before).ok_or_else(|| {
            fault(format!(
                "`{name}` is the problem's own and has no start; write start = ..."
            ))
        })?;
        if line.fixed {
            let range = [line.min.or(about.min), line.max.or(about.max)];
            check_range(name, start, range, place)?;
            self.meanings.insert(name.clone(), Meaning::Number(start));
            return Ok(());
        }
        let unknown = Unknown {
            name: name.clone(),
            unit: self.unit(name, joint).map(str::to_owned),
            start,
            min: line.min.or(about.min).filter(|min| !line.log || *min > 0.0),
            max: line.max.or(about.max),
            nominal: line.nominal.or(about.nominal),
            log: line.log,
            prior: line.prior,
            per: line.per,
            unless_needed: before.filter(|_| by_pattern),
            place: line.name.place.clone(),
        };
        check_start(&unknown)?;
        self.add(unknown);
        Ok(())
    }

    /// Declares a parameter of the problem itself.
    fn declare(
        &mut self,
        line: &Sought,
        file: &ProblemFile,
        joint: &Joint,
    ) -> Result<(), ProblemError> {
        let name = &line.name.value;
        if !is_identifier(name) || ["time", "pi", "y"].contains(&name.as_str()) {
            return Err(match name.contains('.') {
                _ if is_sensor(name, file) => {
                    let fault = format!(
                        "`{name}` is sought without start, range or prior; to give it these, declare a parameter of the \
                         problem and name it in [[measured]], as in gain = \"g\""
                    );
                    ProblemError::maybe_at(line.name.place.as_ref(), fault)
                }
                true => no_parameter(&line.name, file, joint, &self.names),
                false => {
                    let fault = format!(
                        "`{name}` cannot name a parameter of the problem; expected letters, digits and `_`, no digit \
                         first, and neither `time` nor `pi` nor `y`"
                    );
                    ProblemError::maybe_at(line.name.place.as_ref(), fault)
                }
            });
        }
        self.names.push(name.clone());
        self.own_units.insert(name.clone(), line.unit.clone());
        Ok(())
    }

    /// Adds the sought gain and offset of a sensor.
    fn calibrate(&mut self, measured: &Measured, joint: &Joint) -> Result<(), ProblemError> {
        let unit = match &measured.of {
            Quantity::Signal(name) => joint.unit(name).map(str::to_owned),
            Quantity::Expression(_, unit) => unit.clone(),
        };
        let sensors = [
            ("gain", &measured.gain, 1.0, Some("1".to_owned())),
            ("offset", &measured.offset, 0.0, unit),
        ];
        for (what, calibrated, start, unit) in sensors {
            let name = calibration(what, &measured.column.value);
            match calibrated {
                Calibration::Formula(_) => continue,
                Calibration::Found(value) => {
                    (self.meanings).insert(name.clone(), Meaning::Number(*value));
                }
                Calibration::Sought(per) => self.add(Unknown {
                    name: name.clone(),
                    unit: unit.clone(),
                    start,
                    min: None,
                    max: None,
                    nominal: None,
                    log: false,
                    prior: None,
                    per: *per,
                    unless_needed: None,
                    place: Some(measured.place.clone()),
                }),
            }
            if self.own_units.insert(name.clone(), unit).is_some() {
                let fault = format!(
                    "the {what} of the column `{}` is sought twice",
                    measured.column.value
                );
                return Err(ProblemError::at(&measured.place, fault));
            }
            self.names.push(name);
        }
        Ok(())
    }

    /// Leaves out sought parameters that a pattern asks for: they keep their values in the model.
    pub fn leave_out(&mut self, names: &[String]) {
        for unknown in std::mem::take(&mut self.unknowns) {
            match unknown
                .unless_needed
                .filter(|_| names.contains(&unknown.name))
            {
                Some(value) => _ = self.meanings.insert(unknown.name, Meaning::Number(value)),
                None => self.add(unknown),
            }
        }
    }

    fn add(&mut self, unknown: Unknown) {
        let place = self.unknowns.len();
        self.meanings
            .insert(unknown.name.clone(), Meaning::Unknown(place));
        self.unknowns.push(unknown);
    }
}

/// Why a name is not one of the parameters with these names.
pub fn no_parameter(
    name: &Spanned<String>,
    file: &ProblemFile,
    joint: &Joint,
    names: &[String],
) -> ProblemError {
    let full = &name.value;
    let fed = file.inputs.iter().find(|fed| fed.signal.value == *full);
    let fault = match fed {
        Some(fed) => format!(
            "`{full}` is driven by the column `{}`; leave one of them out",
            fed.column.value
        ),
        None if joint.driven.contains_key(full) => {
            format!("`{full}` is driven by a wire; leave one of them out")
        }
        None if joint.model.states.contains(full) => {
            format!(
                "`{full}` is a state; how it begins stands in [initial], or in `set` of a run, and a change moves it by `add`"
            )
        }
        None if joint.signals().contains(full) => {
            format!("`{full}` follows from others; bound it by a [[constraint]]")
        }
        None => match joint.parameter_of_other_type(full) {
            Some(kind) => format!(
                "`{full}` is a parameter of type {kind} of its FMU; a fit takes single reals of double precision (Real, \
                 Float64) alone, and leaves the others as the FMU has them"
            ),
            None => unknown("parameter or free input", full, names),
        },
    };
    ProblemError::maybe_at(name.place.as_ref(), fault)
}
