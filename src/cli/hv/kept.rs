//! The columns of a map that are done, so that a run which was stopped goes on: a line for each, numbers with all digits.

use super::Args;
use super::cases::Hands;
use crate::cli::{Failure, overwrite};
use crate::control::hv::{Cell, Class, Column, Crossing, Helicopter};
use std::fmt::Write;
use std::path::PathBuf;

/// The file in the output folder.
const FILE: &str = "progress.txt";

/// The columns of an earlier run, and of this one.
pub struct Kept {
    path: PathBuf,
    text: String,
    columns: Vec<(String, Column)>,
    is_resumed: bool,
    is_of_others: bool,
}

impl Kept {
    /// Reads those of an earlier run with the same settings.
    pub fn open(
        args: &Args,
        helicopter: &Helicopter,
        hands: Option<&Hands>,
    ) -> Result<Self, Failure> {
        let path = args.output.join(FILE);
        // Everything on which a column depends.
        let model = helicopter
            .part
            .file
            .as_ref()
            .map(|own| own.file.text.clone());
        let pilots = hands.map(|own| {
            let all = std::iter::once(&own.pilot).chain(&own.drawn);
            all.map(|own| &own.axes).collect::<Vec<_>>()
        });
        let settings = format!(
            "{:?} {pilots:?} {:?} {:?} {:?} {:?}",
            args.set,
            args.delay,
            args.speeds,
            args.heights,
            super::cases::settings(args),
        );
        let mut hash = std::hash::DefaultHasher::new();
        std::hash::Hash::hash(&(model, settings, env!("CARGO_PKG_VERSION")), &mut hash);
        let first = format!("{:x}\n", std::hash::Hasher::finish(&hash));
        let earlier = match path.is_file() {
            true => crate::file::text(&path).map_err(|error| {
                Failure::new(format!("cannot read {}: {error}", path.display()))
            })?,
            false => String::new(),
        };
        let rest = earlier.strip_prefix(&first);
        let is_of_others = rest.is_none() && !earlier.is_empty();
        let columns = rest.map_or(Vec::new(), |rest| rest.lines().filter_map(read).collect());
        Ok(Self {
            is_resumed: rest.is_some(),
            is_of_others,
            text: if rest.is_some() { earlier } else { first },
            path,
            columns,
        })
    }

    /// Whether an earlier run goes on.
    pub fn is_resumed(&self) -> bool {
        self.is_resumed
    }

    /// Whether there is a run with other settings that was stopped.
    pub fn is_of_others(&self) -> bool {
        self.is_of_others
    }

    /// Number of columns that are done.
    pub fn count(&self) -> usize {
        self.columns.len()
    }

    /// Those of a case.
    pub fn columns(&self, case: &str) -> Vec<Column> {
        let own = self.columns.iter().filter(|(name, _)| name == case);
        own.map(|(_, column)| column.clone()).collect()
    }

    /// Keeps a column.
    pub fn add(&mut self, case: &str, column: &Column) -> Result<(), Failure> {
        self.text += &line(case, column);
        self.columns.push((case.to_owned(), column.clone()));
        overwrite::save(&self.path, &self.text)
    }

    /// Removes the file when the map is written.
    pub fn remove(&self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A column as a line: case, speed, then cells, then crossings, by tabs. Rust writes a number so that it is read as the same.
fn line(case: &str, column: &Column) -> String {
    let mut text = format!("{case}\t{:?}", column.speed);
    for own in &column.cells {
        let _ = write!(
            text,
            "\t{} {:?} {:?} {:?} {:?} {:?}",
            own.class.as_str(),
            own.height,
            own.s,
            own.replayed,
            own.duration,
            own.chance
        );
    }
    for own in &column.crossings {
        let [low, high] = own.range;
        let _ = write!(
            text,
            "\tcrossing {:?} {} {low:?} {high:?}",
            own.height, own.opens
        );
    }
    text + "\n"
}

fn read(line: &str) -> Option<(String, Column)> {
    let mut fields = line.split('\t');
    let case = fields.next()?.to_owned();
    let mut column = Column {
        speed: fields.next()?.parse().ok()?,
        cells: Vec::new(),
        crossings: Vec::new(),
    };
    for field in fields {
        let words: Vec<&str> = field.split(' ').collect();
        match words[..] {
            ["crossing", height, opens, low, high] => column.crossings.push(Crossing {
                height: height.parse().ok()?,
                opens: opens.parse().ok()?,
                range: [low.parse().ok()?, high.parse().ok()?],
            }),
            [class, height, s, replayed, duration, chance] => column.cells.push(Cell {
                class: [Class::Safe, Class::Unsafe, Class::Unknown]
                    .into_iter()
                    .find(|own| own.as_str() == class)?,
                height: height.parse().ok()?,
                s: s.parse().ok()?,
                replayed: replayed.parse().ok()?,
                duration: duration.parse().ok()?,
                chance: chance.parse().ok()?,
            }),
            _ => return None,
        }
    }
    Some((case, column))
}
