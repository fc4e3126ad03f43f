//! The samples of a study that are done: a line for each in a file, so that a study which was stopped or killed goes on, and
//! shards are joined.

use super::Failure;
use super::plan::Plan;
use super::traces::Traces;
use crate::cli::overwrite;
use crate::cli::shard::Shard;
use crate::file;
use crate::series::parquet::{Field, Kind, ParquetWriter, Values};
use crate::series::{Series, cell};
use pilotage_text::number::significant;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A sample that is done.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its number, from 0.
    pub sample: usize,
    /// What was varied.
    pub values: Vec<f64>,
    /// Its measures; NaN where there are none.
    pub measured: Vec<f64>,
    /// Why it failed.
    pub failure: Option<String>,
}

impl Row {
    /// Whether both have the same numbers, to the last bit.
    pub fn is_same(&self, other: &Self) -> bool {
        let bits = |own: &Self| {
            own.measured
                .iter()
                .map(|value| value.to_bits())
                .collect::<Vec<_>>()
        };
        bits(self) == bits(other) && self.failure == other.failure
    }

    fn status(&self) -> &'static str {
        match self.failure {
            Some(_) => "failed",
            None => "done",
        }
    }

    fn reason(&self) -> &str {
        self.failure.as_deref().unwrap_or_default()
    }

    fn line(&self) -> String {
        let numbers = self.measured.iter().map(|value| format!("\t{value:?}"));
        let reason = self.failure.as_deref().map_or(String::new(), |own| {
            format!("\t{}", own.replace(['\t', '\n', '\r'], " "))
        });
        format!(
            "{}\t{}{}{reason}\n",
            self.sample,
            self.status(),
            numbers.collect::<String>()
        )
    }

    fn read(line: &str, plan: &Plan) -> Option<Self> {
        let mut fields = line.split('\t');
        let sample = fields.next()?.parse().ok()?;
        if sample >= plan.design.count() {
            return None;
        }
        let is_failed = match fields.next()? {
            "done" => false,
            "failed" => true,
            _ => return None,
        };
        let measured = (0..plan.measures.len())
            .map(|_| fields.next()?.parse().ok())
            .collect::<Option<_>>()?;
        let failure = if is_failed {
            Some(fields.next()?.to_owned())
        } else {
            None
        };
        fields.next().is_none().then(|| Self {
            sample,
            values: plan.design.values(sample),
            measured,
            failure,
        })
    }
}

/// The file of a study, or of a part of it.
pub struct Store {
    path: PathBuf,
    header: String,
    shard: Shard,
    rows: BTreeMap<usize, Row>,
    file: Option<File>,
    traces: Option<Traces>,
    is_resumed: bool,
    is_of_others: bool,
}

/// Ending of the file of trajectories beside it.
const TRACES: &str = "bin";

/// Name of the file of a part.
fn name(shard: Shard) -> String {
    match shard {
        Shard::WHOLE => "progress.txt".to_owned(),
        Shard { own, of } => format!("shard-{own}-of-{of}.txt"),
    }
}

impl Store {
    /// Reads what an earlier run of the same study has done.
    pub fn open(folder: &Path, plan: &Plan, shard: Shard) -> Result<Self, Failure> {
        let path = folder.join(name(shard));
        let header = format!("{}\n", serde_json::to_string(plan)?);
        let mut own = Self {
            header,
            shard,
            rows: BTreeMap::new(),
            file: None,
            traces: None,
            is_resumed: false,
            is_of_others: false,
            path,
        };
        if own.path.is_file() {
            let bytes = file::bytes(&own.path).map_err(|error| own.unreadable(&error))?;
            // Lines that were damaged are no rows.
            let text = String::from_utf8_lossy(&bytes);
            own.is_of_others = true;
            if let Some(rest) = text.strip_prefix(&own.header) {
                own.rows = rows(rest, plan).map(|row| (row.sample, row)).collect();
                (own.is_resumed, own.is_of_others) = (true, false);
                own.open_traces(plan)?;
                // Without a line that was cut off.
                own.finish(&own.rows())?;
                own.append()?;
            }
        }
        Ok(own)
    }

    fn unreadable(&self, error: &std::io::Error) -> Failure {
        Failure::new(format!("cannot read {}: {error}", self.path.display()))
    }

    /// Whether an earlier run goes on.
    pub fn is_resumed(&self) -> bool {
        self.is_resumed
    }

    /// Whether another study was stopped there.
    pub fn is_of_others(&self) -> bool {
        self.is_of_others
    }

    /// Begins the file.
    pub fn begin(&mut self, plan: &Plan) -> Result<(), Failure> {
        let _ = std::fs::remove_file(self.path.with_extension(TRACES));
        self.open_traces(plan)?;
        overwrite::save(&self.path, &self.header)?;
        self.append()
    }

    /// Opens the trajectories, if they are kept; a sample without its own is not done.
    fn open_traces(&mut self, plan: &Plan) -> Result<(), Failure> {
        if plan.traced.is_empty() {
            return Ok(());
        }
        let path = self.path.with_extension(TRACES);
        let traces = Traces::open(&path, plan);
        let traces = traces.map_err(|error| Failure::cannot_write(&path, &error))?;
        self.rows
            .retain(|sample, row| row.failure.is_some() || traces.has(*sample));
        self.traces = Some(traces);
        Ok(())
    }

    /// The trajectories.
    pub fn traces(&self) -> Option<&Traces> {
        self.traces.as_ref()
    }

    fn append(&mut self) -> Result<(), Failure> {
        let file = OpenOptions::new().append(true).open(&self.path);
        self.file = Some(file.map_err(|error| Failure::cannot_write(&self.path, &error))?);
        Ok(())
    }

    /// Number of samples that are done.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// Whether a sample is done.
    pub fn has(&self, sample: usize) -> bool {
        self.rows.contains_key(&sample)
    }

    /// Keeps a sample.
    pub fn add(&mut self, row: Row, series: &Series) -> Result<(), Failure> {
        if let Some(traces) = self.traces.as_mut().filter(|_| row.failure.is_none()) {
            let written = traces.add(row.sample, series);
            let path = self.path.with_extension(TRACES);
            written.map_err(|error| Failure::cannot_write(&path, &error))?;
        }
        if let Some(file) = &mut self.file {
            let written = file.write_all(row.line().as_bytes());
            written.map_err(|error| Failure::cannot_write(&self.path, &error))?;
        }
        self.rows.insert(row.sample, row);
        Ok(())
    }

    /// All samples, by number.
    pub fn rows(&self) -> Vec<Row> {
        let own = self.rows.values();
        own.filter(|own| self.shard.has(own.sample))
            .cloned()
            .collect()
    }

    /// Writes the file anew, by number.
    pub fn finish(&self, rows: &[Row]) -> Result<(), Failure> {
        let lines = rows.iter().map(Row::line);
        overwrite::save(&self.path, self.header.clone() + &lines.collect::<String>())
    }

    /// Removes the file.
    pub fn remove(self) {
        let _ = std::fs::remove_file(&self.path);
        if let Some(traces) = self.traces {
            traces.remove();
        }
    }
}

/// The whole lines of a file that can be read.
fn rows<'a>(text: &'a str, plan: &'a Plan) -> impl Iterator<Item = Row> + 'a {
    let lines = text
        .split_inclusive('\n')
        .filter_map(|line| line.strip_suffix('\n'));
    lines.filter_map(|line| Row::read(line, plan))
}

/// The study of which these folders have the parts.
pub fn merged(folders: &[PathBuf]) -> Result<(Plan, Vec<Row>, Option<Traces>), Failure> {
    let mut traced = Vec::new();
    let mut header: Option<(String, PathBuf)> = None;
    let mut all: BTreeMap<usize, Row> = BTreeMap::new();
    for folder in folders {
        let entries = std::fs::read_dir(folder);
        let entries = entries
            .map_err(|error| Failure::new(format!("cannot read {}: {error}", folder.display())))?;
        let is_part = |path: &PathBuf| {
            let name = path
                .file_name()
                .map(|own| own.to_string_lossy().into_owned())
                .unwrap_or_default();
            name == "progress.txt" || (name.starts_with("shard-") && name.ends_with(".txt"))
        };
        let mut files: Vec<PathBuf> = entries
            .flatten()
            .map(|own| own.path())
            .filter(is_part)
            .collect();
        files.sort();
        if files.is_empty() {
            let message = format!("{} has no part of a study", folder.display());
            return Err(
                Failure::new(message).hint("`pilotage sweep --shard I/N -o FOLDER` writes one")
            );
        }
        for path in files {
            let text = file::text(&path).map_err(|error| {
                Failure::new(format!("cannot read {}: {error}", path.display()))
            })?;
            let (first, rest) = text.split_once('\n').unwrap_or((&text, ""));
            let plan: Plan = serde_json::from_str(first).map_err(|error| {
                Failure::new(format!(
                    "{}: line 1 is no plan of a study: {error}",
                    path.display()
                ))
            })?;
            match &header {
                Some((known, other)) if known != first => {
                    let message = format!(
                        "{} and {} are parts of different studies",
                        other.display(),
                        path.display()
                    );
                    return Err(Failure::new(message)
                        .hint("all parts have the same files, options and version of pilotage"));
                }
                Some(_) => {}
                None => header = Some((first.to_owned(), path.clone())),
            }
            traced.push(path.with_extension(TRACES));
            for row in rows(rest, &plan) {
                let sample = row.sample;
                if let Some(other) = all.insert(sample, row)
                    && !other.is_same(&all[&sample])
                {
                    let message = format!(
                        "{} has other numbers of sample {sample} than a part before it",
                        path.display()
                    );
                    return Err(Failure::new(message)
                        .hint("an FMU that remembers earlier runs does that: --isolate all"));
                }
            }
        }
    }
    let (first, _) = header.ok_or_else(|| Failure::new("there are no parts"))?;
    let plan: Plan = serde_json::from_str(&first)?;
    plan.design.clone().checked()?;
    let count = plan.design.count();
    if let Some(missing) = (0..count).find(|k| !all.contains_key(k)) {
        let message = format!(
            "{} of {count} samples are missing, the first is sample {missing}",
            count - all.len()
        );
        return Err(Failure::new(message)
            .hint("name the folders of all parts, and let each come to its end"));
    }
    if plan.traced.is_empty() {
        return Ok((plan, all.into_values().collect(), None));
    }
    let traces = Traces::of_parts(&traced, &plan)
        .map_err(|error| Failure::new(format!("cannot read trajectories: {error}")))?;
    let is_missing = |own: &&Row| own.failure.is_none() && !traces.has(own.sample);
    if let Some(own) = all.values().find(is_missing) {
        let message = format!("the trajectory of sample {} is missing", own.sample);
        return Err(Failure::new(message).hint("each folder of a part has a .bin file with them"));
    }
    Ok((plan, all.into_values().collect(), Some(traces)))
}

/// All samples as a table.
pub fn table(plan: &Plan, rows: &[Row]) -> String {
    let names = plan
        .design
        .names()
        .chain(plan.measures.iter().map(|own| own.0.as_str()));
    let mut text = String::from("sample");
    names.for_each(|name| text += &format!(",{}", cell(name)));
    text += ",status,reason\n";
    for row in rows {
        text += &row.sample.to_string();
        for value in &row.values {
            text += &format!(",{value:?}");
        }
        for value in &row.measured {
            let shown = if value.is_finite() {
                format!("{value:?}")
            } else {
                String::new()
            };
            text += &format!(",{shown}");
        }
        text += &format!(",{},{}\n", row.status(), cell(row.reason()));
    }
    text
}

/// The same as Parquet.
pub fn parquet(plan: &Plan, rows: &[Row]) -> std::io::Result<Vec<u8>> {
    let of_kind = |name: &str, kind| Field {
        kind,
        ..Field::real(name, "")
    };
    let varied = plan.design.names().zip(&plan.units);
    let measured = plan.measures.iter().map(|(name, given)| Field {
        description: given.clone(),
        ..of_kind(name, Kind::Known)
    });
    let fields: Vec<Field> = [of_kind("sample", Kind::Whole)]
        .into_iter()
        .chain(varied.map(|(name, unit)| Field::real(name, unit)))
        .chain(measured)
        .chain(["status", "reason"].map(|name| of_kind(name, Kind::Text)))
        .collect();
    let mut writer = ParquetWriter::new(Vec::new(), &fields, &[])?;
    let samples: Vec<i64> = rows.iter().map(|own| own.sample as i64).collect();
    let column = |of: &dyn Fn(&Row) -> f64| -> Vec<f64> { rows.iter().map(of).collect() };
    let values = (0..plan.design.dimensions()).map(|k| column(&|own| own.values[k]));
    let numbers = values.chain((0..plan.measures.len()).map(|k| column(&|own| own.measured[k])));
    let numbers: Vec<Vec<f64>> = numbers.collect();
    let (status, reason): (Vec<&str>, Vec<&str>) =
        rows.iter().map(|own| (own.status(), own.reason())).unzip();
    let all: Vec<Values> = [Values::Whole(&samples)]
        .into_iter()
        .chain(numbers.iter().map(|own| Values::Numbers(own)))
        .chain([Values::Texts(&status), Values::Texts(&reason)])
        .collect();
    writer.rows(&all)?;
    writer.finish()
}

/// A number for people.
pub fn shown(value: f64) -> String {
    if value.is_finite() {
        significant(value, 4)
    } else {
        "-".to_owned()
    }
}
