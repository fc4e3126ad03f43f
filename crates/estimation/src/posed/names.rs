//! The expressions of a problem, compiled with its names.

use crate::posed::ranges::check_range;
use crate::posed::unknowns::{Meaning, Parameters, no_parameter};
use crate::problem::error::ProblemError;
use crate::problem::file::{Calibration, Deviation, Initial, ProblemFile, Quantity, matching};
use crate::system::joint::{Joint, unknown};
use pilotage_cosim::description::Spanned;
use pilotage_language::Expressions;
use pilotage_language::expressions::CompiledExpressions;
use pilotage_language::file::Formula;
use pilotage_language::syntax::column;
use pilotage_units::Product;
use std::collections::HashMap;

/// Name of the predicted value in a noise level.
pub const PREDICTED: &str = "y";

/// The expressions of a problem file.
#[derive(Debug)]
pub struct Named {
    /// Names of the signals, in the order of the graph's variables after time.
    pub signals: Vec<String>,
    /// Names of recorded columns, which come after the signals, each with the place where it is first named. The
    /// predicted value follows.
    pub columns: Vec<Spanned<String>>,
    /// Names of the parameters that are not tied, which come next.
    pub parameters: Vec<String>,
    /// The expressions.
    pub compiled: CompiledExpressions,
    /// Index of each formula in the compiled list.
    places: HashMap<Of, usize>,
}

/// Role of an expression.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Of {
    /// A tied parameter.
    Tied(String),
    /// The measured quantity of this number.
    Measured(usize),
    /// Its noise level.
    Deviation(usize),
    /// Density of process noise, by its number.
    Density(usize),
    /// Gain of its sensor.
    Gain(usize),
    /// Offset of its sensor.
    Offset(usize),
    /// A line of `[initial]`, by its number, for a state.
    Initial(usize, String),
    /// A constraint, by its number.
    Constraint(usize),
    /// A derived quantity.
    Derived(String),
    /// A value set by a run: the parameter or the state, and the expression as written.
    Set(String, String),
    /// What a run adds to a state: the state and the expression as written.
    Added(String, String),
}

impl Named {
    /// Compiles the expressions of a file.
    ///
    /// # Errors
    /// When a name is unknown, units are incompatible, or parameters are tied in a cycle.
    pub fn new(
        file: &ProblemFile,
        joint: &Joint,
        parameters: &Parameters,
    ) -> Result<Self, ProblemError> {
        let is_free = |name: &&String| parameters.names.contains(name);
        let mut builder = Builder {
            free_inputs: joint.model.inputs.iter().filter(is_free).cloned().collect(),
            expressions: Expressions::new(&file.file, &file.text),
            places: HashMap::new(),
            columns: Vec::new(),
        };
        let signals = joint.signals();
        // Inputs that are not driven are numbers, but also signals.
        for name in &signals {
            builder.expressions.add_signal(name, joint.unit(name));
        }
        add_all(&mut builder, file, joint, parameters)?;
        let columns = std::mem::take(&mut builder.columns);
        for name in &columns {
            builder.expressions.add_signal(&column(&name.value), None);
        }
        builder.expressions.add_signal(PREDICTED, None);
        let is_plain = |name: &&String| {
            !matches!(parameters.meanings[*name], Meaning::Tied(_)) && !signals.contains(name)
        };
        let names: Vec<String> = parameters.names.iter().filter(is_plain).cloned().collect();
        for name in &names {
            builder
                .expressions
                .add_parameter(name, parameters.unit(name, joint));
        }
        Ok(Self {
            compiled: builder.expressions.compile()?,
            places: builder.places,
            parameters: names,
            signals,
            columns,
        })
    }

    /// Index of an expression in the compiled list.
    pub fn place(&self, of: &Of) -> Option<usize> {
        self.places.get(of).copied()
    }
}

struct Builder {
    expressions: Expressions,
    places: HashMap<Of, usize>,
    columns: Vec<Spanned<String>>,
    /// Inputs that are not driven.
    free_inputs: Vec<String>,
}

impl Builder {
    fn add(
        &mut self,
        file: &ProblemFile,
        of: Of,
        unit: Option<&str>,
        formula: &Formula,
        constant: Option<&'static str>,
    ) -> Result<(), ProblemError> {
        if self.places.contains_key(&of) {
            return Ok(());
        }
        for name in formula.names().filter(|_| constant.is_some()) {
            self.check_constant(file, formula, name)?;
        }
        for name in formula.names() {
            let quoted = name
                .strip_prefix("column(\"")
                .and_then(|rest| rest.strip_suffix("\")"));
            let is_known = |quoted: &&str| self.columns.iter().any(|own| own.value == *quoted);
            if let Some(quoted) = quoted.filter(|quoted| !is_known(quoted)) {
                self.columns.push(Spanned {
                    value: quoted.to_owned(),
                    place: Some(file.place(formula)),
                });
            }
        }
        let name = of.name();
        let place = self.expressions.add(&name, unit, formula, constant);
        self.places.insert(of, place);
        Ok(())
    }

    /// Rejects an input that is not driven where only parameters are allowed: it is a number, but its name is that of a
    /// signal.
    fn check_constant(
        &self,
        file: &ProblemFile,
        formula: &Formula,
        name: &str,
    ) -> Result<(), ProblemError> {
        if !self.free_inputs.iter().any(|own| own == name) {
            return Ok(());
        }
        let own = name.rsplit('.').next().unwrap_or(name);
        let fault = format!(
            "`{name}` is an input, which an expression of parameters cannot take; write a parameter of the problem's own, \
             such as {own} = {{ start = ... }}, with \"{name}\" = {{ value = \"{own}\" }}, and take `{own}` here"
        );
        Err(ProblemError::at(&file.place(formula), fault))
    }
}

fn add_all(
    builder: &mut Builder,
    file: &ProblemFile,
    joint: &Joint,
    parameters: &Parameters,
) -> Result<(), ProblemError> {
    for name in &parameters.names {
        if let Meaning::Tied(formula) = &parameters.meanings[name] {
            let unit = parameters.unit(name, joint);
            let of = Of::Tied(name.clone());
            builder.add(file, of.clone(), unit, formula, Some("a tied parameter"))?;
            builder.expressions.may_take_time(builder.places[&of]);
        }
    }
    for (k, measured) in file.measured.iter().enumerate() {
        if let Quantity::Expression(formula, unit) = &measured.of {
            check_prediction(file, formula)?;
            builder.add(file, Of::Measured(k), unit.as_deref(), formula, None)?;
        }
        if let Deviation::Formula(formula) = &measured.sd {
            builder.add(file, Of::Deviation(k), None, formula, None)?;
        }
        for (of, calibrated, what) in [
            (Of::Gain(k), &measured.gain, "the gain of a sensor"),
            (Of::Offset(k), &measured.offset, "the offset of a sensor"),
        ] {
            if let Calibration::Formula(formula) = calibrated {
                builder.add(file, of, None, formula, Some(what))?;
            }
        }
    }
    for (k, noise) in file.process_noise.iter().enumerate() {
        let unit = density_unit(&noise.signal.value, joint);
        let what = Some("a density");
        builder.add(file, Of::Density(k), unit.as_deref(), &noise.density, what)?;
    }
    for (k, (name, initial)) in file.initial.iter().enumerate() {
        let states = matching(&name.value, &joint.model.states);
        if states.is_empty() {
            let fault = unknown("state", &name.value, &joint.model.states);
            return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
        }
        if let Initial::Formula(formula) = initial {
            for state in states {
                let of = Of::Initial(k, state.clone());
                builder.add(
                    file,
                    of,
                    joint.unit(state),
                    formula,
                    Some("an initial state"),
                )?;
            }
        }
    }
    for (k, constraint) in file.constraints.iter().enumerate() {
        check_prediction(file, &constraint.formula)?;
        let constant = (constraint.at == crate::problem::file::Holds::Parameters)
            .then_some("a constraint at the parameters");
        builder.add(file, Of::Constraint(k), None, &constraint.formula, constant)?;
    }
    for (name, formula) in &file.derived {
        if parameters.names.contains(&name.value) {
            let fault = format!("`{}` is a parameter; take another name", name.value);
            return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
        }
        let of = Of::Derived(name.value.clone());
        builder.add(file, of, None, formula, Some("a derived quantity"))?;
    }
    for run in &file.runs {
        for set in run.sets() {
            let name = &set.name.value;
            let is_begin = run.set.iter().any(|own| std::ptr::eq(own, set));
            if joint.model.states.contains(name) && is_begin {
                let line = file.initial_line(name).map(|line| &file.initial[line].1);
                if let Some(Initial::Steady) = line {
                    let fault = format!(
                        "`{name}` begins steady in all runs; write it as \"free\" to set it in some"
                    );
                    return Err(ProblemError::maybe_at(set.name.place.as_ref(), fault));
                }
                let what = Some("an initial state");
                let unit = joint.unit(name);
                builder.add(file, Of::set(name, &set.value), unit, &set.value, what)?;
                continue;
            }
            if !parameters.names.contains(name) {
                return Err(no_parameter(&set.name, file, joint, &parameters.names));
            }
            if let Meaning::Tied(_) = parameters.meanings[name] {
                let fault = format!("`{name}` is tied to others; a run cannot set it");
                return Err(ProblemError::maybe_at(set.name.place.as_ref(), fault));
            }
            if let Some(number) = set.value.number() {
                let range = parameters.range(name, joint);
                check_range(name, number, range, set.name.place.as_ref())?;
            }
            let unit = parameters.unit(name, joint);
            builder.add(
                file,
                Of::set(name, &set.value),
                unit,
                &set.value,
                Some("a value of a run"),
            )?;
        }
        for add in run.added() {
            let name = &add.name.value;
            if !joint.model.states.contains(name) {
                let fault = match parameters.names.contains(name) {
                    true => format!("`{name}` is no state; `set` changes it"),
                    false => unknown("state", name, &joint.model.states),
                };
                return Err(ProblemError::maybe_at(add.name.place.as_ref(), fault));
            }
            let (of, unit) = (Of::added(name, &add.value), joint.unit(name));
            builder.add(file, of, unit, &add.value, Some("what is added to a state"))?;
        }
    }
    Ok(())
}

/// Unit of a density: the square of the unit of the noise, times seconds. None if that has no unit.
fn density_unit(signal: &str, joint: &Joint) -> Option<String> {
    let unit = Product::parse(joint.unit(signal)?)?;
    let added = match joint.model.states.iter().any(|own| own == signal) {
        true => unit.rate(),
        false => unit,
    };
    Some(added.density().to_string())
}

/// Rejects the predicted value outside noise levels.
fn check_prediction(file: &ProblemFile, formula: &Formula) -> Result<(), ProblemError> {
    match formula.names().any(|name| name == PREDICTED) {
        true => {
            let fault =
                "`y` is what the model predicts, and stands in `sd` alone; name the signal instead";
            Err(ProblemError::at(&file.place(formula), fault))
        }
        false => Ok(()),
    }
}

impl Of {
    /// Its name in messages. It contains a space if no expression can refer to it.
    fn name(&self) -> String {
        match self {
            Self::Tied(name) => name.clone(),
            Self::Measured(_) => "what is measured".into(),
            Self::Deviation(_) => "the standard deviation".into(),
            Self::Density(_) => "the density".into(),
            Self::Gain(_) => "the gain".into(),
            Self::Offset(_) => "the offset".into(),
            Self::Initial(_, state) => format!("the initial value of `{state}`"),
            Self::Constraint(_) => "the constraint".into(),
            Self::Derived(name) => name.clone(),
            Self::Set(name, _) => format!("the value of `{name}`"),
            Self::Added(name, _) => format!("what is added to `{name}`"),
        }
    }

    /// A value set by a run.
    pub fn set(name: &str, value: &Formula) -> Self {
        Self::Set(name.to_owned(), value.expression.text.clone())
    }

    /// What a run adds to a state.
    pub fn added(name: &str, value: &Formula) -> Self {
        Self::Added(name.to_owned(), value.expression.text.clone())
    }
}
