//! Reads parameters and initial states.

use super::fields::{at, finite, per, positive, range, unit, word};
use super::{Entry, Read, Reader};
use crate::problem::file::{Initial, Per, Prior, Sought};
use pilotage_cosim::description::Spanned;
use pilotage_language::file::Formula;
use pilotage_linear::Figure;
use pilotage_text::document::TomlTable;
use pilotage_text::is_identifier;

impl Reader<'_> {
    pub(super) fn parameters(&self, root: TomlTable<'_>) -> Read<Vec<Sought>> {
        let entries = self.section(root, "parameters")?;
        entries
            .into_iter()
            .map(|entry| self.sought(entry))
            .collect()
    }

    /// Derived quantities: names and expressions of parameters.
    pub(super) fn derived(&self, root: TomlTable<'_>) -> Read<Vec<(Spanned<String>, Formula)>> {
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
            if Figure::is_name(field) {
                let fault = format!(
                    "`{field}` is what the figure of the loop itself is called; take another name"
                );
                return Err(at(table, field, fault));
            }
            let formula = self.formula(table, field)?;
            let name = Spanned {
                value: field.to_owned(),
                place: table.key_place(field),
            };
            all.push((name, table.required(field, formula)?));
        }
        Ok(all)
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

    pub(super) fn initial(&self, root: TomlTable<'_>) -> Read<Vec<(Spanned<String>, Initial)>> {
        self.states(root, "initial")
    }

    /// Conditions on states, in a table of this name.
    pub(super) fn states(
        &self,
        root: TomlTable<'_>,
        table: &str,
    ) -> Read<Vec<(Spanned<String>, Initial)>> {
        let mut all = Vec::new();
        for (table, field, name) in self.section(root, table)? {
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
}

/// Rejects contradictory settings of a sought parameter.
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
