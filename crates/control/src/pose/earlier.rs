//! An earlier answer, where the search begins.

use super::{Posed, Variable};
use crate::program::{Program, Shape};
use pilotage_estimation::ProblemError;
use pilotage_series::Series;
use pilotage_series::flown::comment_value;
use std::path::Path;

/// States and controls over time, and parameters.
#[derive(Debug, Clone)]
pub struct Earlier {
    /// Times, from 0 to 1.
    time: Vec<f64>,
    /// Of each state and control, if it has a column.
    states: Vec<Option<Vec<f64>>>,
    controls: Vec<Option<Vec<f64>>>,
    /// Parameters, with the duration.
    parameters: Vec<f64>,
}

fn fault(path: &Path, text: &str) -> ProblemError {
    ProblemError::Part(format!("{}: {text}", path.display()))
}

impl Earlier {
    /// Reads the trajectory table of an earlier answer, with parameters in its comments (`# name: value`). Columns that
    /// it lacks begin as without it.
    ///
    /// # Errors
    /// When the file cannot be read, has no column of the problem or one in another unit.
    pub fn read(path: &Path, posed: &Posed) -> Result<Self, ProblemError> {
        let table =
            Series::read_table(path).map_err(|error| ProblemError::Part(error.to_string()))?;
        let columns = |of: &[Variable]| -> Result<Vec<Option<Vec<f64>>>, ProblemError> {
            of.iter().map(|own| column(path, &table, own)).collect()
        };
        let (states, controls) = (columns(&posed.states)?, columns(&posed.controls)?);
        if states.iter().chain(&controls).all(Option::is_none) {
            let names: Vec<&str> = posed.states.iter().map(|own| own.name.as_str()).collect();
            let text = format!(
                "no column is a state or a control; there are {}",
                names.join(", ")
            );
            return Err(fault(path, &text));
        }
        let [from, .., to] = table.time[..] else {
            return Err(fault(path, "a trajectory has two rows at least"));
        };
        if to <= from {
            return Err(fault(path, "the time does not increase"));
        }
        let parameter = |own: &Variable| -> Result<f64, ProblemError> {
            if own.name == "duration" {
                return Ok((to - from).clamp(own.limits.0, own.limits.1));
            }
            let Some(text) = comment_value(&table.comments, &own.name) else {
                return Ok(own.guess[0]);
            };
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value.clamp(own.limits.0, own.limits.1)),
                _ => Err(fault(path, &format!("`{}: {text}` is no number", own.name))),
            }
        };
        Ok(Self {
            time: table
                .time
                .iter()
                .map(|time| (time - from) / (to - from))
                .collect(),
            states,
            controls,
            parameters: posed
                .parameters
                .iter()
                .map(parameter)
                .collect::<Result<_, _>>()?,
        })
    }

    /// Variables of a program.
    pub(crate) fn variables(&self, posed: &Posed, program: &Program) -> Vec<f64> {
        let states = |tau: f64| -> Vec<f64> {
            let pairs = self.states.iter().zip(&posed.states);
            let value = |(own, state): (&Option<Vec<f64>>, &Variable)| match own {
                Some(values) => self.at(values, tau),
                None => state.guess[0] + tau * (state.guess[1] - state.guess[0]),
            };
            pairs.map(value).collect()
        };
        let controls = |tau: f64| -> Vec<f64> {
            let all = self.controls.iter().zip(&posed.controls);
            let value = |((own, control), of): ((&Option<Vec<f64>>, &Variable), _)| {
                let value = match (own, of) {
                    (None, _) => control.guess[0],
                    (Some(values), Shape::Linear) => self.at(values, tau),
                    // A program has at a node the value of the interval before.
                    (Some(values), Shape::Constant) => {
                        let k = self.time.partition_point(|time| *time < tau);
                        values[k.saturating_sub(1)]
                    }
                };
                value.clamp(control.limits.0, control.limits.1)
            };
            let shapes = program.controls.iter().map(|own| own.shape);
            all.zip(shapes).map(value).collect()
        };
        posed.variables(program, &states, &controls, &self.parameters)
    }

    fn at(&self, values: &[f64], tau: f64) -> f64 {
        let k = self
            .time
            .partition_point(|time| *time <= tau)
            .clamp(1, self.time.len() - 1);
        let width = self.time[k] - self.time[k - 1];
        let part = if width > 0.0 {
            (tau - self.time[k - 1]) / width
        } else {
            0.0
        };
        values[k - 1] + part * (values[k] - values[k - 1])
    }
}

/// The finite values of a variable's column, if there is one.
fn column(path: &Path, table: &Series, own: &Variable) -> Result<Option<Vec<f64>>, ProblemError> {
    let Some(column) = table.columns.iter().find(|column| column.name == own.name) else {
        return Ok(None);
    };
    let unit = own.unit.as_deref().unwrap_or_default();
    if column.unit != unit {
        let text = format!(
            "`{}` is in [{}] here and in [{unit}] in the problem",
            own.name, column.unit
        );
        return Err(fault(path, &text));
    }
    match column.values.iter().all(|value| value.is_finite()) {
        true => Ok(Some(column.values.clone())),
        false => Err(fault(
            path,
            &format!("`{}` has cells without a number", own.name),
        )),
    }
}
