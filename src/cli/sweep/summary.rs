//! What a study says: quantiles of the measures, and what they depend on.

use super::plan::Plan;
use super::store::{Row, shown};
use crate::cli::format::aligned;
use crate::cli::terminal;
use crate::inference::sample::quantile;
use pilotage_sweep::Method;
use pilotage_sweep::statistics::{Indices, Interval, moments, rank_correlation, sobol_indices};
use pilotage_text::counted;
use serde_json::{Value, json};
use std::path::Path;

/// Quantiles that are given.
const PARTS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];
/// Fewest samples from which a dependence is computed.
const FEWEST: usize = 8;

/// A measure of all samples.
pub struct Of {
    /// Its name.
    pub name: String,
    /// Finite values, ascending.
    pub ascending: Vec<f64>,
    /// What it depends on: for each varied variable that has more than one value.
    pub on: Vec<(String, Dependence)>,
}

/// How a measure depends on a variable.
#[derive(Debug, Clone, Copy)]
pub enum Dependence {
    /// Rank correlation.
    Rank(Interval),
    /// Sobol' indices.
    Sobol(Indices),
}

/// A study.
pub struct Summary {
    /// Its measures.
    pub measures: Vec<Of>,
    /// Number of samples, and of those that failed, with the reason of the first.
    pub count: usize,
    pub failed: usize,
    pub reason: Option<(usize, String)>,
    /// Whether a sample gives the same numbers each time.
    pub is_repeatable: bool,
    /// Whether trajectories are kept.
    has_trajectories: bool,
}

impl Summary {
    /// That of these samples.
    pub fn of(plan: &Plan, rows: &[Row]) -> Self {
        let names: Vec<&str> = plan.design.names().collect();
        let one = |(m, (name, _)): (usize, &(String, String))| {
            let measured: Vec<f64> = rows.iter().map(|own| own.measured[m]).collect();
            let mut ascending: Vec<f64> = measured
                .iter()
                .copied()
                .filter(|own| own.is_finite())
                .collect();
            ascending.sort_by(f64::total_cmp);
            let varies = ascending.first() != ascending.last();
            let indices = (plan.design.method == Method::Saltelli && varies)
                .then(|| sobol_indices(&measured, names.len(), u64::from(plan.design.seed)));
            let on = names.iter().enumerate().filter_map(|(d, name)| {
                if let Some(found) = &indices {
                    return Some(((*name).to_owned(), Dependence::Sobol(found[d])));
                }
                let known = rows.iter().filter(|own| own.measured[m].is_finite());
                let (x, y): (Vec<f64>, Vec<f64>) =
                    known.map(|own| (own.values[d], own.measured[m])).unzip();
                let has_values = x.iter().any(|own| *own != x[0]);
                let is_known = x.len() >= FEWEST
                    && has_values
                    && varies
                    && plan.design.method != Method::Saltelli;
                is_known.then(|| {
                    (
                        (*name).to_owned(),
                        Dependence::Rank(rank_correlation(&x, &y)),
                    )
                })
            });
            Of {
                name: name.clone(),
                on: on.collect(),
                ascending,
            }
        };
        let failed = rows
            .iter()
            .filter_map(|own| Some((own.sample, own.failure.clone()?)));
        Self {
            measures: plan.measures.iter().enumerate().map(one).collect(),
            count: rows.len(),
            failed: failed.clone().count(),
            reason: failed.into_iter().next(),
            is_repeatable: plan.is_repeatable,
            has_trajectories: !plan.traced.is_empty(),
        }
    }

    /// As JSON.
    pub fn to_json(&self, plan: &Plan) -> Value {
        let finite = |value: f64| value.is_finite().then_some(value);
        let dependence = |(name, own): &(String, Dependence)| {
            let value = match own {
                Dependence::Rank(own) => json!({ "rank_correlation": own }),
                Dependence::Sobol(own) => json!({ "first": own.first, "total": own.total }),
            };
            (name.clone(), value)
        };
        let measure = |(own, (_, given)): (&Of, &(String, String))| {
            let [mean, sd] = moments(&own.ascending);
            let quantiles = PARTS.map(|part| {
                (
                    part.to_string(),
                    json!(finite(quantile(&own.ascending, part))),
                )
            });
            json!({
                "name": own.name,
                "expression": given,
                "values": own.ascending.len(),
                "mean": finite(mean),
                "sd": finite(sd),
                "min": own.ascending.first(),
                "max": own.ascending.last(),
                "quantiles": quantiles.into_iter().collect::<serde_json::Map<_, _>>(),
                "depends_on": own.on.iter().map(dependence).collect::<serde_json::Map<_, _>>(),
            })
        };
        json!({
            "samples": self.count,
            "failed": self.failed,
            "repeatable": self.is_repeatable,
            "method": plan.design.method,
            "seed": plan.design.seed,
            "varied": plan.design.names().collect::<Vec<_>>(),
            "measures": self.measures.iter().zip(&plan.measures).map(measure).collect::<Vec<_>>(),
        })
    }

    /// Rows of a table of quantiles, with a header.
    pub fn quantiles(&self) -> (Vec<&'static str>, Vec<Vec<String>>) {
        let header = vec![
            "measure", "values", "mean", "sd", "min", "5 %", "25 %", "50 %", "75 %", "95 %", "max",
        ];
        let row = |own: &Of| {
            let [mean, sd] = moments(&own.ascending);
            let [low, high] = [own.ascending.first(), own.ascending.last()]
                .map(|own| own.copied().unwrap_or(f64::NAN));
            let parts = PARTS.map(|part| quantile(&own.ascending, part));
            let numbers = [mean, sd, low]
                .into_iter()
                .chain(parts)
                .chain([high])
                .map(shown);
            [own.name.clone(), own.ascending.len().to_string()]
                .into_iter()
                .chain(numbers)
                .collect()
        };
        (header, self.measures.iter().map(row).collect())
    }

    /// Rows of a table of dependences, with a header.
    pub fn dependences(&self) -> (Vec<&'static str>, Vec<Vec<String>>) {
        let interval = |own: Interval| {
            [
                shown(own.value),
                format!("{} to {}", shown(own.low), shown(own.high)),
            ]
        };
        let mut header = vec!["measure", "variable", "rank correlation", "95 %"];
        let mut rows = Vec::new();
        for own in &self.measures {
            for (name, dependence) in &own.on {
                let mut row = vec![own.name.clone(), name.clone()];
                match dependence {
                    Dependence::Rank(own) => row.extend(interval(*own)),
                    Dependence::Sobol(own) => {
                        header = vec![
                            "measure",
                            "variable",
                            "first order",
                            "95 %",
                            "total",
                            "95 %",
                        ];
                        row.extend(interval(own.first));
                        row.extend(interval(own.total));
                    }
                }
                rows.push(row);
            }
        }
        (header, rows)
    }

    /// In words: how many samples there are, and what became of them.
    pub fn verdict(&self) -> String {
        let all = counted(self.count, "sample");
        let mut words = match &self.reason {
            None => format!("{all}, none failed."),
            Some((sample, reason)) => {
                format!("{all}, {} failed: sample {sample}: {reason}.", self.failed)
            }
        };
        let done = self.count - self.failed;
        for own in self
            .measures
            .iter()
            .filter(|own| own.ascending.len() < done)
        {
            let missing = done - own.ascending.len();
            words += &format!(" {missing} without a number of {}.", own.name);
        }
        if !self.is_repeatable {
            words += " A sample gives other numbers each time.";
        }
        words
    }

    /// As text.
    pub fn to_text(&self, output: &Path) -> String {
        let table = |(header, rows): (Vec<&str>, Vec<Vec<String>>)| {
            let header = header.iter().map(|own| (*own).to_owned()).collect();
            let rows: Vec<Vec<String>> = std::iter::once(header).chain(rows).collect();
            if rows.len() > 1 {
                aligned(&rows) + "\n"
            } else {
                String::new()
            }
        };
        format!(
            "{}{}{}\nwrote {}: sweep.html, sweep.csv, sweep.parquet, sweep.json{}\n",
            table(self.quantiles()),
            table(self.dependences()),
            terminal::line(&self.verdict()),
            terminal::shown(output),
            if self.has_trajectories {
                ", trajectories.parquet"
            } else {
                ""
            }
        )
    }
}
