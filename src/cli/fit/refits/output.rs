//! Output of profiles and bootstraps, for people and for scripts.

use super::{Bootstrapped, Refitted, full_name};
use crate::cli::format::aligned;
use crate::inference::LEVEL;
use crate::refits::{End, Point, Profile};
use crate::report::certainty::{ProfileShown, profile_figure};
use crate::report::{Figure, Parameters};
use pilotage_text::number::significant;
use serde_json::{Map, Value, json};

pub use super::resume::HEAD;

/// Columns of the table.
const HEADER: [&str; 7] = [
    "parameter",
    "profile low",
    "profile high",
    "bootstrap sd",
    "bootstrap low",
    "bootstrap high",
    "",
];

impl Refitted {
    /// Adds `profile` and `bootstrap` to the entry of a parameter.
    pub fn add_to(&self, name: &str, entry: &mut Map<String, Value>) {
        let own: Vec<usize> = (0..self.names.len())
            .filter(|k| self.names[*k].0 == name)
            .collect();
        let mut add = |field: &str, of: &dyn Fn(usize) -> Option<Value>| {
            let known: Vec<(usize, Value)> =
                own.iter().filter_map(|k| Some((*k, of(*k)?))).collect();
            let value = match known.as_slice() {
                [] => return,
                [(k, value)] if self.names[*k].1.is_none() => value.clone(),
                all => {
                    let label = |k: usize| self.names[k].1.clone().unwrap_or_default();
                    let all = all.iter().map(|(k, value)| (label(*k), value.clone()));
                    Value::Object(all.collect())
                }
            };
            entry.insert(field.into(), value);
        };
        add("profile", &|k| Some(self.profile_json(self.profile(k)?)));
        add("bootstrap", &|k| {
            let own = self.bootstrap.as_ref()?.spread(k)?;
            Some(json!({ "sd": own.sd, "low": own.low, "high": own.high, "count": own.count }))
        });
    }

    /// Adds the methods to the entry `uncertainty`.
    pub fn add_methods(&self, entry: &mut Value) {
        let (root, noise, degrees) = self.threshold;
        if !self.profiles.is_empty() {
            entry["profile"] = json!({
                "level": LEVEL,
                "threshold": root,
                "noise_variance": noise,
                "degrees_of_freedom": degrees,
            });
        }
        if let Some(own) = &self.bootstrap {
            entry["bootstrap"] = json!({
                "level": LEVEL,
                "kind": own.kind.as_str(),
                "seed": own.seed,
                "replicates": own.asked,
                "converged": own.converged(),
                "not_converged": own.replicates.len() - own.converged(),
                "missing": own.missing(),
            });
        }
    }

    fn profile(&self, unknown: usize) -> Option<&Profile> {
        let own = self.profiles.iter().find(|(k, _)| *k == unknown)?;
        Some(&own.1)
    }

    fn profile_json(&self, own: &Profile) -> Value {
        let point = |point: &Point| {
            json!({
                "value": point.value,
                "objective": point.objective / self.factor,
                "root": point.root,
                "held": self.held(point),
            })
        };
        let [low, high] = own.ends;
        json!({
            "low": limit(low),
            "high": limit(high),
            "low_end": word(low),
            "high_end": word(high),
            "class": class(own),
            "lower_objective_at": own.lower.map(|k| own.points[k].value),
            "points": own.points.iter().map(point).collect::<Vec<_>>(),
        })
    }

    /// Names of the limits of parameters that are active at a point.
    fn held(&self, point: &Point) -> Vec<&str> {
        let [constraints, bounds] = &self.limits;
        let on = point.constraints.iter().map(|k| constraints[*k].as_str());
        let mut names: Vec<&str> = on
            .chain(point.bounds.iter().map(|k| bounds[*k].as_str()))
            .collect();
        names.dedup();
        names
    }

    /// Indices of the columns for the requested refits.
    fn columns(&self) -> Vec<usize> {
        let known = [!self.profiles.is_empty(), self.bootstrap.is_some()];
        let asked = |k: &usize| match k {
            1..3 => known[0],
            3..6 => known[1],
            _ => true,
        };
        (0..HEADER.len()).filter(asked).collect()
    }

    /// The header, and a row for each unknown with results.
    pub fn rows(&self) -> Vec<[String; 7]> {
        let mut rows = vec![HEADER.map(str::to_owned)];
        for (k, name) in self.names.iter().enumerate() {
            let profile = self.profile(k);
            let spread = self.bootstrap.as_ref().and_then(|own| own.spread(k));
            let is_pole = k >= self.unknowns && name.0.starts_with("pole");
            if profile.is_none() && spread.is_none() || is_pole {
                continue;
            }
            let ends = profile.map(|own| own.ends.map(|end| shown(limit(end), 5)));
            let [low, high] = ends.unwrap_or_default();
            let spread = spread.map_or_else(Default::default, |own| {
                [
                    shown(Some(own.sd), 3),
                    shown(Some(own.low), 5),
                    shown(Some(own.high), 5),
                ]
            });
            let [sd, from, to] = spread;
            let remark = profile.map_or(String::new(), |own| self.remark(own));
            rows.push([full_name(name), low, high, sd, from, to, remark]);
        }
        rows
    }

    fn remark(&self, own: &Profile) -> String {
        let mut words: Vec<String> = Vec::new();
        match class(own) {
            "finite" => {}
            "unfinished" if own.ends.iter().any(|end| matches!(end, End::Failed(_))) => {
                words.push("refits beyond did not converge".into());
            }
            class => words.push(class.into()),
        }
        let held = self.meets(own).into_iter().filter(|meets| *meets).count();
        if held > 0 {
            words.push(format!(
                "{held} of {} points on another limit",
                own.points.len()
            ));
        }
        if let Some(k) = own.lower {
            let at = significant(own.points[k].value, 5);
            words.push(format!("a lower objective at {at}: fit again from there"));
        }
        words.join("; ")
    }

    /// For each point of a profile, whether a limit is active that is not active at the estimate.
    fn meets(&self, own: &Profile) -> Vec<bool> {
        let estimate = own.points.iter().find(|point| point.root == 0.0);
        let known = estimate.map_or(Vec::new(), |point| self.held(point));
        let is_new = |point: &Point| self.held(point).iter().any(|name| !known.contains(name));
        own.points.iter().map(is_new).collect()
    }

    /// The profiles as a figure, if there are any.
    pub fn figure(&self) -> Option<Figure> {
        let shown = |(k, own): &(usize, Profile)| ProfileShown {
            name: full_name(&self.names[*k]),
            points: (own.points.iter().zip(self.meets(own)))
                .map(|(point, meets)| (point.value, point.root, meets))
                .collect(),
        };
        let all: Vec<ProfileShown> = self.profiles.iter().map(shown).collect();
        let figure = profile_figure(&all, self.threshold.0.powi(2));
        (!figure.panels.is_empty()).then_some(figure)
    }

    /// The table and notes as text for people.
    pub fn to_text(&self) -> String {
        let columns = self.columns();
        let chosen = |row: &[String; 7]| columns.iter().map(|k| row[*k].clone()).collect();
        let rows: Vec<Vec<String>> = self.rows().iter().map(chosen).collect();
        let mut text = format!("\n{}", aligned(&rows));
        self.notes()
            .iter()
            .for_each(|note| text += &format!("{note}\n"));
        text
    }

    /// The table for the HTML page.
    pub fn table(&self) -> Parameters {
        let (columns, rows) = (self.columns(), self.rows());
        let chosen = |row: &[String; 7]| columns.iter().map(|k| row[*k].clone()).collect();
        Parameters {
            header: columns.iter().map(|k| HEADER[*k]).collect(),
            numeric: (1..columns.len() - 1).collect(),
            rows: rows.iter().skip(1).map(chosen).collect(),
            notes: self.notes(),
        }
    }

    /// One line for each method.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.profiles.is_empty() {
            let of = match self.is_predicted {
                true => "of the likelihood",
                false => "for residuals without colour",
            };
            notes.push(format!("95 % intervals by profiles, {of}"));
        }
        notes.extend(self.bootstrap.as_ref().map(Bootstrapped::note));
        if self.bootstrap.is_some() && !self.flat.is_empty() {
            notes.push(format!(
                "the data do not determine {}: there the refits spread as their starts do",
                self.flat.join(", ")
            ));
        }
        notes
    }
}

impl Bootstrapped {
    fn note(&self) -> String {
        let failed = self.replicates.len() - self.converged();
        let failed = match failed {
            0 => String::new(),
            failed => format!("; {failed} did not converge and are left out"),
        };
        let failed = match self.missing() {
            0 => failed,
            missing => format!("{failed}; stopped, {missing} of {} are missing", self.asked),
        };
        format!(
            "bootstrap: {} refits, {}, seed {}{failed}",
            self.converged(),
            self.drawn,
            self.seed
        )
    }
}

/// A bound of an interval; `None` if the data give none.
fn limit(end: End) -> Option<f64> {
    match end {
        End::Crossed(at) => Some(at),
        End::Range(at) => Some(at).filter(|at| at.is_finite()),
        End::Open(_) | End::Failed(_) | End::Stopped(_) => None,
    }
}

fn word(end: End) -> &'static str {
    match end {
        End::Crossed(_) => "threshold",
        End::Range(_) => "range",
        End::Open(_) => "open",
        End::Failed(_) => "not-converged",
        End::Stopped(_) => "stopped",
    }
}

fn class(own: &Profile) -> &'static str {
    let crossed = own
        .ends
        .iter()
        .filter(|end| matches!(end, End::Crossed(_)))
        .count();
    let is_cut = |end: &End| matches!(end, End::Failed(_) | End::Stopped(_));
    match (own.ends.iter().any(is_cut), crossed) {
        (true, _) => "unfinished",
        (false, 2) => "finite",
        (false, 1) => "one-sided",
        (false, _) => "flat",
    }
}

fn shown(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| significant(value, digits))
}
