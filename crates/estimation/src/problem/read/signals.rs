//! Reads signals: columns that drive the system, and measured signals.

use super::fields::{at, column, per, place, place_of, positive, unit, word};
use super::{Read, Reader};
use crate::problem::error::ProblemError;
use crate::problem::file::{Calibration, Deviation, Fed, Hold, Measured, Noise, Per, Quantity};
use pilotage_language::file::Formula;
use pilotage_text::document::TomlTable;

impl Reader<'_> {
    pub(super) fn inputs(&self, root: TomlTable<'_>) -> Read<Vec<Fed>> {
        const HOLDS: [(&str, Option<Hold>); 4] = [
            ("linear", Some(Hold::Linear)),
            ("zero-order", Some(Hold::Zero)),
            ("foh", Some(Hold::Linear)),
            ("zoh", Some(Hold::Zero)),
        ];
        let mut all = Vec::new();
        for (table, field, signal) in self.section(root, "inputs")? {
            let (own, key) = match table.is_table(field) {
                true => (table.required(field, table.table(field)?)?, "column"),
                false => (table, field),
            };
            let mut hold = None;
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

    pub(super) fn measured(&self, root: TomlTable<'_>) -> Read<Vec<Measured>> {
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
            "threshold",
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
            noise: noise(table)?,
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
            return match per(own)? {
                Per::All => {
                    let fault = "expected { per = \"run\" } or { per = \"subject\" }; one value for all runs is \"free\"";
                    Err(at(table, field, fault))
                }
                per => Ok(Calibration::Sought(per)),
            };
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
}

/// The noise of a measured signal, with its degrees of freedom or threshold.
fn noise(table: TomlTable<'_>) -> Read<Noise> {
    const WORDS: [(&str, Noise); 5] = [
        ("normal", Noise::Normal),
        ("log-normal", Noise::LogNormal),
        ("laplace", Noise::Laplace),
        ("student", Noise::Student(4.0)),
        // With normal noise, the mean then has 95 % of the efficiency of least squares.
        ("huber", Noise::Huber(1.345)),
    ];
    let noise = word(table, "noise", &WORDS, Noise::Normal)?;
    let (dof, threshold) = (positive(table, "dof")?, positive(table, "threshold")?);
    match (noise, dof, threshold) {
        (Noise::Student(default), dof, None) => Ok(Noise::Student(dof.unwrap_or(default))),
        (Noise::Huber(default), None, threshold) => Ok(Noise::Huber(threshold.unwrap_or(default))),
        (_, Some(_), _) => {
            let fault = "degrees of freedom belong to noise = \"student\"; leave `dof` out";
            Err(at(table, "dof", fault))
        }
        (_, _, Some(_)) => {
            let fault = "a threshold belongs to noise = \"huber\"; leave `threshold` out";
            Err(at(table, "threshold", fault))
        }
        (other, None, None) => Ok(other),
    }
}
