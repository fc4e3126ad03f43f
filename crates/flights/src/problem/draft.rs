//! Writes a problem: recorded runs of a pilot and a vehicle, or of a single model.

use super::instance::Instance;
use crate::trials::ColumnNames;
use pilotage_estimation::file::{Mesh, Options};
use pilotage_inference::are_stepped;
use pilotage_series::{Column, Series};
use pilotage_text::document::{key, number, quoted};
use pilotage_text::printable;
use std::fmt::Write;

/// What a problem file is written of.
pub struct Draft<'d> {
    /// Pilot and vehicle, which are connected, or a single model. The parameters of the first are sought.
    pub instances: &'d [Instance],
    /// Names of columns that are not those of inputs and outputs.
    pub names: &'d ColumnNames,
    /// The runs.
    pub runs: &'d [Recorded<'d>],
    /// Signals that are measured in any case, such as a pilot's stick.
    pub measured: Option<&'d str>,
    /// What is known about the initial states, as lines of `[initial]` with their comments.
    pub initial: Vec<(String, &'static str)>,
    /// Parameters of the problem itself, as lines of `[parameters]`.
    pub own: Vec<String>,
    /// Instances that are stable by themselves.
    pub stable: Vec<&'d str>,
    /// Whether the closed loop is stable.
    pub stable_loop: bool,
    /// Options of the fit.
    pub options: Options,
}

/// A run of a problem that is written.
pub struct Recorded<'d> {
    /// Its file, relative to the folder of the problem.
    pub file: String,
    /// Its columns.
    pub series: &'d Series,
    /// Weight of its residuals.
    pub weight: f64,
    /// False for a run used only for validation.
    pub fits: bool,
    /// Values of this run.
    pub set: Vec<(String, f64)>,
}

/// No column is called as an output of the models.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no column is called as an output of the models; the runs have {}", columns.join(", "))]
pub struct NothingMeasured {
    /// The columns that all runs have.
    pub columns: Vec<String>,
}

const HEAD: &str = "# A problem of pilotage: what was measured, what is sought.
#
#     pilotage fit THIS-FILE
#
# Every key is in docs/problems.md, other problems are in examples/problems.";

/// A line with a comment in the column of all comments.
fn commented(line: &str, comment: &str) -> String {
    match comment {
        "" => format!("{line}\n"),
        text => format!("{line:<40} {}", printable::comment(text)),
    }
}

impl Draft<'_> {
    /// The text of the problem file.
    ///
    /// # Errors
    /// If nothing is measured.
    pub fn text(&self) -> Result<String, NothingMeasured> {
        let mut text = format!("{HEAD}\n");
        self.write_system(&mut text);
        let wires = wires(self.instances);
        if !wires.is_empty() {
            text += "\n[connect]                                # from = to\n";
            for (from, to) in &wires {
                let _ = writeln!(text, "{} = {}", quoted(from), quoted(to));
            }
        }
        self.write_inputs(&mut text, &wires);
        self.write_measured(&mut text)?;
        self.write_recorded(&mut text, &wires);
        self.write_parameters(&mut text);
        text += "\n[initial]                                # else what the models start with\n";
        for (line, comment) in &self.initial {
            text += &commented(line, comment);
        }
        self.write_stability(&mut text);
        for run in self.runs {
            run.write(&mut text, self.names.given("time"));
        }
        self.write_options(&mut text);
        Ok(text)
    }

    fn write_system(&self, text: &mut String) {
        for own in self.instances {
            let _ = writeln!(
                text,
                "\n[system.{}]\nmodel = {}",
                own.name,
                quoted(&own.model)
            );
            if let Some(order) = own.order {
                *text += &commented(&format!("order = {order}"), "of the transfer function");
            }
            if !own.set.is_empty() {
                let _ = writeln!(text, "set = {}", inline(&own.set));
            }
        }
    }

    fn is_column(&self, name: &str) -> bool {
        self.column(name).is_some()
    }

    /// The column of all runs that has this name, as the first one spells it.
    fn column(&self, name: &str) -> Option<&str> {
        let columns = self.runs.iter().map(|run| run.series.column(name));
        let columns: Vec<&Column> = columns.collect::<Option<_>>()?;
        columns.first().map(|own| own.name.as_str())
    }

    fn write_inputs(&self, text: &mut String, wires: &[(String, String)]) {
        *text += "\n[inputs]                                 # columns of the runs that drive the system\n";
        for own in self.instances {
            for input in &own.inputs {
                let full = format!("{}.{input}", own.name);
                let column = self.names.of(input);
                if wires.iter().any(|(_, to)| *to == full) {
                    continue;
                }
                let full = quoted(&full);
                let _ = match self.column(column) {
                    Some(column) if self.jumps(column) => writeln!(
                        text,
                        "{full} = {{ column = {}, hold = \"zero-order\" }}   # it jumps at samples, and keeps its values between",
                        quoted(column)
                    ),
                    Some(column) => writeln!(text, "{full} = {}", quoted(column)),
                    None => writeln!(
                        text,
                        "# {full} = \"COLUMN\"                # no column is called so: it keeps its start value"
                    ),
                };
            }
        }
    }

    /// Whether a column keeps its values and jumps in some of the runs, and does nothing else in the others.
    fn jumps(&self, column: &str) -> bool {
        are_stepped(self.runs.iter().filter_map(|run| {
            let values = &run.series.column(column)?.values;
            Some((run.series.time.as_slice(), values.as_slice()))
        }))
    }

    /// Measured signals: outputs with the names of columns, and the position.
    fn write_measured(&self, text: &mut String) -> Result<(), NothingMeasured> {
        let mut measured: Vec<(String, &str)> = Vec::new();
        if let Some(signal) = self.measured {
            let output = signal.rsplit('.').next().unwrap_or(signal);
            measured.push((signal.to_owned(), self.names.of(output)));
        }
        for own in self.instances.iter().filter(|own| own.name != "pilot") {
            for signal in &own.outputs {
                let column = self.column(signal);
                measured.extend(column.map(|column| (format!("{}.{signal}", own.name), column)));
            }
            for axis in ["", "2"] {
                let column = self.column(self.names.of(&format!("position{axis}")));
                let is_new = |column: &&str| measured.iter().all(|(_, own)| own != column);
                if let (Some(column), Some(position)) = (column.filter(is_new), own.position(axis))
                {
                    measured.push((format!("{}.{position}", own.name), column));
                }
            }
        }
        if measured.is_empty() {
            let first = self.runs.first().into_iter();
            let columns = first.flat_map(|run| &run.series.columns);
            let columns = columns.map(|own| own.name.clone());
            let columns = columns.filter(|name| self.is_column(name)).collect();
            return Err(NothingMeasured { columns });
        }
        for (signal, column) in measured {
            let _ = writeln!(
                text,
                "\n[[measured]]\nsignal = {}\ncolumn = {}",
                quoted(&signal),
                quoted(column)
            );
            *text += &commented(
                "# sd = 0.05",
                "of the noise, in the unit of the signal; 1 unless given",
            );
        }
        Ok(())
    }

    /// What the runs have of the wires to the vehicle, and why it is not measured.
    fn write_recorded(&self, text: &mut String, wires: &[(String, String)]) {
        for (from, to) in wires.iter().filter(|(_, to)| to.starts_with("vehicle.")) {
            let column = self.names.of(to.rsplit('.').next().unwrap_or(to));
            if !self.is_column(column) || self.measured == Some(from) {
                continue;
            }
            let _ = writeln!(
                text,
                "\n# The column {} is not fitted, since its noise moves the vehicle too. Before the fit it is put through `vehicle`\n\
                 # alone, and the response is compared with what was recorded (diagnostic `open-loop`). To fit it as well:\n\
                 # [[measured]]\n# signal = {}\n# column = {0}",
                quoted(column),
                quoted(from)
            );
        }
    }

    fn write_parameters(&self, text: &mut String) {
        *text += "\n[parameters]                             # what is sought; each starts at its model's value unless given\n";
        let sought = &self.instances[0];
        if !sought.is_known {
            *text += "# What of the FMU is sought is yours to say: take the `#` away.\n";
        }
        for own in &sought.parameters {
            let start = number(own.start);
            let unit = match own.unit.as_str() {
                "" => String::new(),
                unit => format!("[{unit}]"),
            };
            let about = [own.description.as_str(), &unit];
            let about: Vec<&str> = about.into_iter().filter(|own| !own.is_empty()).collect();
            let fixed = match own.name.ends_with("_limit") {
                true => ", fixed = true",
                false => "",
            };
            let idle = if sought.is_known { "" } else { "# " };
            let name = quoted(&format!("{}.{}", sought.name, own.name));
            let line = format!("{idle}{name} = {{ start = {start}{fixed} }}");
            *text += &commented(&line, &about.join(" "));
        }
        for line in &self.own {
            *text += &commented(line, "");
        }
    }

    fn write_stability(&self, text: &mut String) {
        if self.stable.is_empty() && !self.stable_loop {
            return;
        }
        *text += "\n[stability]\n";
        if !self.stable.is_empty() {
            let names: Vec<String> = self.stable.iter().map(|name| quoted(name)).collect();
            let _ = writeln!(text, "models = [{}]", names.join(", "));
        }
        if self.stable_loop {
            *text += "closed_loop = true\n";
        }
    }

    /// The options of the fit; those that nobody chose as comments.
    fn write_options(&self, text: &mut String) {
        let (own, usual) = (self.options, Options::default());
        *text += "\n[fit]\n";
        if let Some(scheme) = own.scheme {
            let _ = writeln!(text, "scheme = {}", quoted(&scheme.to_string()));
        }
        match own.mesh {
            Mesh::Samples => {
                *text += &commented("mesh = \"samples\"", "nodes at the samples alone")
            }
            Mesh::Step(step) => {
                let line = format!("mesh_step = {}", number(step));
                *text += &commented(&line, "about so far apart [s]");
            }
            Mesh::Tolerance(tolerance) => {
                *text += &commented("# mesh = \"samples\"", "nodes at the samples alone");
                let line = format!("mesh_tolerance = {}", short(tolerance));
                let comment = "nodes between them until the states' relative error is below";
                *text += &commented(&line, comment);
            }
        }
        if own.tolerance != usual.tolerance {
            let _ = writeln!(text, "tolerance = {}", short(own.tolerance));
        }
        if own.max_iterations != usual.max_iterations {
            let _ = writeln!(text, "max_iterations = {}", own.max_iterations);
        }
        if own.limits != usual.limits {
            let _ = writeln!(text, "limits = {}", quoted(own.limits.as_str()));
        }
        if let Some(covariance) = own.covariance {
            let _ = writeln!(text, "covariance = {}", quoted(covariance.as_str()));
        }
        *text += &match own.starts {
            None => commented(
                "# starts = 1",
                "from the given start values alone, in less time; 8 unless given",
            ),
            Some(starts) => commented(&format!("starts = {starts}"), ""),
        };
    }
}

impl Recorded<'_> {
    fn write(&self, text: &mut String, time: Option<&str>) {
        let _ = writeln!(text, "\n[[run]]\nfile = {}", quoted(&self.file));
        if let Some(time) = time {
            let _ = writeln!(text, "time_column = {}", quoted(time));
        }
        if !self.fits {
            *text += "use = \"validation\"\n";
        }
        if self.weight != 1.0 {
            let _ = writeln!(text, "weight = {}", number(self.weight));
        }
        if !self.set.is_empty() {
            let _ = writeln!(text, "set = {}", inline(&self.set));
        }
    }
}

/// Names and values as an inline table.
fn inline(values: &[(String, f64)]) -> String {
    let pair = |(name, value): &(String, f64)| format!("{} = {}", key(name), number(*value));
    let pairs: Vec<String> = values.iter().map(pair).collect();
    format!("{{ {} }}", pairs.join(", "))
}

/// A small number as people write it: 1e-6.
fn short(value: f64) -> String {
    format!("{value:e}")
}

/// Connections of pilot and vehicle: stick forward, position back, and whatever else has one name in both.
fn wires(instances: &[Instance]) -> Vec<(String, String)> {
    let [pilot, vehicle] = instances else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let common = |from: &Instance, to: &Instance| -> Vec<(String, String)> {
        let both = from.outputs.iter().filter(|name| to.inputs.contains(name));
        let wire = |name: &String| {
            (
                format!("{}.{name}", from.name),
                format!("{}.{name}", to.name),
            )
        };
        both.map(wire).collect()
    };
    // What both have by one name, and the position by the names that vehicles have for it.
    all.extend(common(pilot, vehicle));
    all.extend(common(vehicle, pilot));
    for axis in ["", "2"] {
        let seen = format!("pilot.position{axis}");
        let is_open = all.iter().all(|(_, to)| *to != seen);
        let is_seen = pilot.inputs.contains(&format!("position{axis}"));
        if let (true, Some(position)) = (is_open && is_seen, vehicle.position(axis)) {
            all.push((format!("vehicle.{position}"), seen));
        }
    }
    all
}
