//! Check of units: terms that are added, compared or assigned must have the same unit.

use crate::dimension::{Dimension, Quantity};
use crate::error::{Fault, ModelFileError};
use crate::file::{Formula, ModelFile, Variable};
use crate::functions::Name;
use crate::scope::{Scope, Symbol, is_spelt};
use crate::syntax::{Part, Term};
use crate::tables::Tables;
use Dimension::{Number, Of, Unchecked};

/// Rejects equations with inconsistent units.
pub(crate) fn check(
    file: &ModelFile,
    scope: &Scope<'_>,
    tables: &Tables,
) -> Result<(), ModelFileError> {
    let checker = Checker {
        file,
        scope,
        tables,
    };
    for state in &file.states {
        let rate = match declared(state) {
            Of(unit) => {
                // The derivative of a temperature in degrees is in kelvin per second.
                let unit = without_offset(&unit);
                Of(unit.times(&Quantity::second(), -1.0).unwrap_or(unit))
            }
            other => other,
        };
        if let Some(formula) = &state.value {
            let what = format!("the derivative of `{}`", state.name);
            checker.assigned(formula, &rate, &what)?;
        }
        let what = format!("the start value of `{}`", state.name);
        checker.assigned(&state.start, &declared(state), &what)?;
    }
    for variable in file.locals.iter().chain(&file.outputs) {
        let what = match is_spelt(&variable.name) {
            true => format!("`{}`", variable.name),
            false => variable.name.clone(),
        };
        for formula in variable.value.iter() {
            checker.assigned(formula, &declared(variable), &what)?;
        }
        for limit in variable.limit.iter().flatten() {
            let what = format!("the limit of {what}");
            checker.assigned(limit, &declared(variable), &what)?;
        }
    }
    Ok(())
}

/// The declared unit of a variable.
fn declared(variable: &Variable) -> Dimension {
    let unit = variable.unit.as_deref().and_then(Quantity::named);
    unit.map_or(Unchecked, Of)
}

fn without_offset(unit: &Quantity) -> Quantity {
    unit.sum(unit, -1.0).unwrap_or_else(|_| unit.clone())
}

struct Checker<'f> {
    file: &'f ModelFile,
    scope: &'f Scope<'f>,
    tables: &'f Tables,
}

/// A unit, or the reason why units do not fit.
type Found = Result<Dimension, String>;

impl Checker<'_> {
    /// Rejects an expression whose unit is not the expected one.
    fn assigned(
        &self,
        formula: &Formula,
        expected: &Dimension,
        what: &str,
    ) -> Result<(), ModelFileError> {
        let expression = &formula.expression;
        let mut known: Vec<Dimension> = Vec::with_capacity(expression.terms.len());
        for part in 0..expression.terms.len() {
            let found = self.of_part(formula, part, &known).map_err(|reason| {
                let shown = expression.shown(part);
                let shown = shortened(shown);
                let fault = Fault::Unit(format!("in `{shown}`, {reason}"));
                self.file.at(formula.byte(part), fault)
            })?;
            known.push(found);
        }
        let whole = expression.whole();
        match (&known[whole], expected) {
            (Of(found), Of(expected)) => found.check_same(expected).map_err(|reason| {
                let shown = shortened(expression.shown(whole));
                let fault = Fault::Unit(format!("{what} is `{shown}`, and {reason}"));
                self.file.at(formula.byte(whole), fault)
            }),
            _ => Ok(()),
        }
    }

    fn of_part(&self, formula: &Formula, part: Part, known: &[Dimension]) -> Found {
        let of = |part: &Part| &known[*part];
        match &formula.expression.terms[part] {
            Term::Number(number) => Ok(Number(*number)),
            Term::Text(_) => Ok(Unchecked),
            Term::Name(name) => Ok(self.of_name(name)),
            Term::Negate(a) => match of(a) {
                Number(number) => Ok(Number(-number)),
                Of(unit) => unit.scaled(-1.0).map(Of),
                Unchecked => Ok(Unchecked),
            },
            Term::Add(a, b) => sum(of(a), of(b), 1.0),
            Term::Subtract(a, b) => sum(of(a), of(b), -1.0),
            Term::Multiply(a, b) => product(of(a), of(b), 1.0),
            Term::Divide(a, b) => product(of(a), of(b), -1.0),
            Term::Power(a, b) => power(of(a), of(b)),
            Term::Compare(_, a, b) => joined(of(a), of(b)),
            Term::Call(name, arguments) => {
                let units: Vec<&Dimension> = arguments.iter().map(of).collect();
                let file = arguments
                    .first()
                    .map(|first| &formula.expression.terms[*first]);
                match (name, file) {
                    (Name::Table, Some(Term::Text(file))) => self.of_table(file, units[1]),
                    _ => call(*name, &units),
                }
            }
        }
    }

    fn of_name(&self, name: &str) -> Dimension {
        match self.scope.symbol(name) {
            Symbol::Time => Of(Quantity::second()),
            Symbol::Pi => Number(std::f64::consts::PI),
            Symbol::Input(k) => declared(&self.file.inputs[k]),
            Symbol::Parameter(k) => declared(&self.file.parameters[k]),
            Symbol::State(k) => declared(&self.file.states[k]),
            Symbol::Computed(k) => declared(self.scope.computed(k)),
        }
    }

    /// The unit of the second column of a table, if the argument fits the first one.
    fn of_table(&self, file: &str, at: &Dimension) -> Found {
        let [x, y] = self.tables.units(file);
        let unit = |name: &str| Quantity::named(name).map_or(Unchecked, Of);
        joined(at, &unit(x))?;
        Ok(unit(y))
    }
}

/// The common unit, if both are the same.
fn joined(a: &Dimension, b: &Dimension) -> Found {
    match (a, b) {
        (Of(a), Of(b)) => {
            a.check_same(b)?;
            Ok(Of(a.clone()))
        }
        (Unchecked, _) | (_, Unchecked) => Ok(Unchecked),
        (Of(unit), Number(_)) | (Number(_), Of(unit)) => Ok(Of(unit.clone())),
        (Number(a), Number(_)) => Ok(Number(*a)),
    }
}

fn sum(a: &Dimension, b: &Dimension, sign: f64) -> Found {
    match (a, b) {
        (Of(a), Of(b)) => a.sum(b, sign).map(Of),
        (Number(a), Number(b)) => Ok(Number(a + sign * b)),
        (Of(unit), Number(number)) => Ok(Of(unit.shifted(sign * number))),
        (Number(number), Of(unit)) if sign > 0.0 => Ok(Of(unit.shifted(*number))),
        (Number(_), Of(unit)) => unit.scaled(-1.0).map(Of),
        _ => joined(a, b),
    }
}

fn product(a: &Dimension, b: &Dimension, power: f64) -> Found {
    match (a, b) {
        (Unchecked, _) | (_, Unchecked) => Ok(Unchecked),
        (Of(a), Of(b)) => a.times(b, power).map(Of),
        (Of(a), Number(b)) => a.scaled(b.powf(power)).map(Of),
        (Number(a), Of(b)) => {
            let one = Quantity::one().scaled(*a)?;
            one.times(b, power).map(Of)
        }
        (Number(a), Number(b)) => Ok(Number(a * b.powf(power))),
    }
}

fn power(a: &Dimension, b: &Dimension) -> Found {
    match (a, b) {
        (Number(a), Number(b)) => Ok(Number(a.powf(*b))),
        (Of(a), Number(b)) if !b.is_nan() => a.power(*b).map(Of),
        (Of(base), Number(_)) => base.check_plain().map(|()| Of(Quantity::one())),
        (Unchecked, Of(exponent)) => plain_exponent(exponent).map(|()| Unchecked),
        (Number(_), Of(exponent)) => plain_exponent(exponent).map(|()| Of(Quantity::one())),
        (Of(base), Of(exponent)) => {
            plain_exponent(exponent)?;
            let plain = base.check_plain();
            plain.map_err(|_| {
                let base = base.in_words();
                format!(
                    "a power whose exponent is no number takes a base without a unit, not {base}"
                )
            })?;
            Ok(Of(Quantity::one()))
        }
        (Unchecked, _) | (_, Unchecked) => Ok(Unchecked),
    }
}

fn plain_exponent(exponent: &Quantity) -> Result<(), String> {
    let plain = exponent.check_plain();
    plain.map_err(|_| format!("an exponent is without a unit, not {}", exponent.in_words()))
}

fn call(name: Name, units: &[&Dimension]) -> Found {
    let word = name.function().word;
    let plain = |unit: &Dimension, takes: &str| match unit {
        Of(unit) => {
            let checked = unit.check_plain();
            checked.map_err(|_| {
                let hint = unit.plain_hint().unwrap_or_default();
                format!("`{word}` takes {takes}, not {}{hint}", unit.in_words())
            })
        }
        _ => Ok(()),
    };
    let mut all = units.iter().skip(1);
    match name {
        Name::Sin | Name::Cos | Name::Tan => {
            plain(units[0], "radians (1 deg is pi/180 of them)")?;
            Ok(Of(Quantity::one()))
        }
        Name::Asin
        | Name::Acos
        | Name::Atan
        | Name::Sinh
        | Name::Cosh
        | Name::Tanh
        | Name::Exp
        | Name::Log => {
            plain(units[0], "a number without a unit")?;
            Ok(Of(Quantity::one()))
        }
        Name::Sqrt => power(units[0], &Number(0.5)),
        Name::Abs => Ok(units[0].clone()),
        Name::Sign => Ok(Of(Quantity::one())),
        Name::Atan2 => {
            joined(units[0], units[1])?;
            Ok(Of(Quantity::one()))
        }
        Name::Min | Name::Max | Name::Sat | Name::Deadzone => {
            let found = all.try_fold(units[0].clone(), |found, unit| joined(&found, unit))?;
            Ok(without_value(found))
        }
        Name::If => joined(units[1], units[2]).map(without_value),
        Name::Delay => {
            if let Of(tau) = units[1] {
                tau.check_same(&Quantity::second())
                    .map_err(|reason| format!("a delay is in seconds, but {reason}"))?;
            }
            Ok(units[0].clone())
        }
        Name::Table => Ok(Unchecked),
    }
}

/// If one of two numbers is selected, the value is unknown.
fn without_value(found: Dimension) -> Dimension {
    match found {
        Number(_) => Number(f64::NAN),
        other => other,
    }
}

/// The start of a long expression.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 60;
    match text.chars().count() > LONGEST {
        true => text.chars().take(LONGEST).chain(['…']).collect(),
        false => text.to_owned(),
    }
}
