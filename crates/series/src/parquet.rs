//! Parquet: tables in columns, for pandas, DuckDB, Matlab and others.
//!
//! Units and descriptions are in the file's metadata under the key `PANDAS_ATTRS`, as JSON
//! (`{"units": {"vehicle.z": "m"}, "descriptions": {...}}`), which pandas gives as `DataFrame.attrs`.

use super::read::name_and_unit;
use super::{Column, Series, SeriesError, TextColumn};
use parquet::basic::{
    Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical,
};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result as Read};
use parquet::file::metadata::{FileMetaData, KeyValue};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnDescriptor, Type, TypePtr};
use pilotage_text::file;
use pilotage_text::printable::one_line;
use pilotage_units::Unit;
use serde_json::{Map, Value, json};
use std::collections::HashMap;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::sync::Arc;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"PAR1";
/// Key of the metadata with units and descriptions; pandas reads and writes it (`pandas/io/parquet.py`).
const ATTRIBUTES: &str = "PANDAS_ATTRS";
/// Who has made a file, before the version.
const OWN: &str = "pilotage version ";
/// Largest number of values of a file that is read.
const MOST: usize = 1 << 30;

/// A column that is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name, without unit.
    pub name: String,
    /// Its unit; empty if there is none.
    pub unit: String,
    /// What it is; empty if nobody said it.
    pub description: String,
    /// Type of its values.
    pub kind: Kind,
}

/// Type of a column's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Numbers, of which some may be NaN.
    Real,
    /// Numbers; where one is not finite it is missing (null).
    Known,
    /// Whole numbers.
    Whole,
    /// Texts; an empty one is missing (null).
    Text,
}

/// Values of a column.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Of a [`Kind::Real`] or [`Kind::Known`].
    Numbers(&'a [f64]),
    /// Of a [`Kind::Whole`].
    Whole(&'a [i64]),
    /// Of a [`Kind::Text`].
    Texts(&'a [&'a str]),
}

impl Field {
    /// A column of numbers.
    pub fn real(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            description: String::new(),
            kind: Kind::Real,
        }
    }

    fn schema(&self) -> Read<TypePtr> {
        let (physical, converted) = match self.kind {
            Kind::Real | Kind::Known => (Physical::DOUBLE, ConvertedType::NONE),
            Kind::Whole => (Physical::INT64, ConvertedType::NONE),
            Kind::Text => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
        };
        let repetition = match self.kind {
            Kind::Known | Kind::Text => Repetition::OPTIONAL,
            Kind::Real | Kind::Whole => Repetition::REQUIRED,
        };
        let built = Type::primitive_type_builder(&self.name, physical)
            .with_repetition(repetition)
            .with_converted_type(converted);
        built.build().map(Arc::new)
    }
}

/// Writes a file, some rows at a time. What it writes depends on the rows and on how they are divided alone.
pub struct ParquetWriter<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    kinds: Vec<Kind>,
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins a file of these columns; `more` are further keys of its metadata.
    ///
    /// # Errors
    /// If it cannot be written, here and below.
    pub fn new(to: W, fields: &[Field], more: &[(&str, String)]) -> io::Result<Self> {
        let named = |of: fn(&Field) -> &str| -> Map<String, Value> {
            let said = fields.iter().filter(|own| !of(own).is_empty());
            said.map(|own| (own.name.clone(), json!(of(own)))).collect()
        };
        let about = json!({ "units": named(|own| &own.unit), "descriptions": named(|own| &own.description) });
        let more = more
            .iter()
            .map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone()));
        let metadata = more.chain([KeyValue::new(ATTRIBUTES.to_owned(), about.to_string())]);
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(format!("{OWN}{}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(Some(metadata.collect()))
            .build();
        let columns = fields.iter().map(Field::schema).collect::<Read<_>>()?;
        let schema = Type::group_type_builder("table")
            .with_fields(columns)
            .build()?;
        let writer = SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))?;
        let kinds = fields.iter().map(|own| own.kind).collect();
        Ok(Self { writer, kinds })
    }

    /// Writes rows, as values of each column.
    pub fn rows(&mut self, columns: &[Values]) -> io::Result<()> {
        let mut group = self.writer.next_row_group()?;
        for (values, kind) in columns.iter().zip(&self.kinds) {
            let Some(mut column) = group.next_column()? else {
                break;
            };
            match values {
                Values::Numbers(all) if *kind == Kind::Known => {
                    let levels: Vec<i16> =
                        all.iter().map(|own| i16::from(own.is_finite())).collect();
                    let known: Vec<f64> =
                        all.iter().copied().filter(|own| own.is_finite()).collect();
                    column
                        .typed::<DoubleType>()
                        .write_batch(&known, Some(&levels), None)?;
                }
                Values::Numbers(all) => {
                    column.typed::<DoubleType>().write_batch(all, None, None)?;
                }
                Values::Whole(all) => {
                    column.typed::<Int64Type>().write_batch(all, None, None)?;
                }
                Values::Texts(all) => {
                    let levels: Vec<i16> =
                        all.iter().map(|own| i16::from(!own.is_empty())).collect();
                    let said = all.iter().filter(|own| !own.is_empty());
                    let said: Vec<ByteArray> = said.map(|own| ByteArray::from(*own)).collect();
                    column
                        .typed::<ByteArrayType>()
                        .write_batch(&said, Some(&levels), None)?;
                }
            }
            column.close()?;
        }
        group.close()?;
        Ok(())
    }

    /// Writes the end, without which the file cannot be read.
    pub fn finish(self) -> io::Result<W> {
        let mut to = self.writer.into_inner()?;
        to.flush()?;
        Ok(to)
    }
}

/// Whether a file is one that [`ParquetWriter`] wrote.
pub fn is_own(path: &Path) -> bool {
    let made = || {
        let reader = SerializedFileReader::new(file::regular(path).ok()?).ok()?;
        let own = reader.metadata().file_metadata().created_by()?;
        Some(own.starts_with(OWN))
    };
    std::panic::catch_unwind(made).is_ok_and(|own| own == Some(true))
}

impl Series {
    /// The series as a Parquet file: `time`, and the signals. Comments are not kept.
    ///
    /// # Errors
    /// If a column has no name that such a file can hold.
    pub fn to_parquet(&self) -> io::Result<Vec<u8>> {
        let time = std::iter::once(Field::real("time", "s"));
        let fields: Vec<Field> = time
            .chain(
                self.columns
                    .iter()
                    .map(|own| Field::real(&own.name, &own.unit)),
            )
            .collect();
        let mut writer = ParquetWriter::new(Vec::new(), &fields, &[])?;
        let values = self.columns.iter().map(|own| Values::Numbers(&own.values));
        let all: Vec<Values> = std::iter::once(Values::Numbers(&self.time))
            .chain(values)
            .collect();
        writer.rows(&all)?;
        writer.finish()
    }
}

/// Reads a table over time. `file` is its name in messages, `time` that of its column of times.
pub(crate) fn read(
    mut from: impl BufRead,
    file: &str,
    may_be_infinite: bool,
    time: &str,
) -> Result<Series, SeriesError> {
    let mut bytes = Vec::new();
    from.read_to_end(&mut bytes)
        .map_err(|source| SeriesError::Read {
            file: file.into(),
            source,
        })?;
    let fault = |words: String| SeriesError::Parquet {
        file: file.to_owned(),
        words,
    };
    // Damaged files have made the reader panic.
    let read = std::panic::catch_unwind(|| columns(bytes));
    let (read, texts) = match read {
        Ok(Ok(read)) => read,
        Ok(Err(error)) => return Err(fault(error.to_string())),
        Err(_) => return Err(fault("it is damaged".to_owned())),
    };
    let mut columns = read;
    let is_time = |own: &Column| own.name.eq_ignore_ascii_case(time);
    let position = columns.iter().position(is_time);
    let position =
        position.ok_or_else(|| fault(format!("no column of numbers is called `{time}`")))?;
    let own = columns.remove(position);
    let factor = match own.unit.as_str() {
        "" => 1.0,
        unit => {
            let to = Unit::named(unit).conversion(&Unit::named("s"));
            to.ok_or_else(|| fault(format!("`{unit}` is no unit of time")))?
                .apply(1.0)
        }
    };
    let times: Vec<f64> = own.values.iter().map(|value| value * factor).collect();
    if let Some(k) = times.iter().position(|own| !own.is_finite()) {
        return Err(fault(format!("row {} has no time", k + 1)));
    }
    if let Some(k) = (1..times.len()).find(|k| times[*k] < times[k - 1]) {
        return Err(fault(format!(
            "the time of row {} is before that of row {k}",
            k + 1
        )));
    }
    if times.is_empty() {
        return Err(SeriesError::NoSamples {
            file: file.to_owned(),
        });
    }
    let mut names: Vec<&str> = columns.iter().map(|own| own.name.as_str()).collect();
    names.sort_unstable();
    if let Some(twice) = names.windows(2).find(|own| own[0] == own[1]) {
        return Err(fault(format!("two columns are called `{}`", twice[0])));
    }
    let is_infinite = |own: &&Column| own.values.iter().any(|value| value.is_infinite());
    if let Some(own) = columns
        .iter()
        .find(is_infinite)
        .filter(|_| !may_be_infinite)
    {
        return Err(fault(format!("`{}` has infinite values", own.name)));
    }
    Ok(Series {
        time: times,
        time_unit: own.unit,
        columns,
        texts,
        ..Series::default()
    })
}

/// Columns of numbers, and those of words.
fn columns(bytes: Vec<u8>) -> Read<(Vec<Column>, Vec<TextColumn>)> {
    let reader = SerializedFileReader::new(bytes::Bytes::from(bytes))?;
    // The reader panics at these.
    let mut chunks = (reader.metadata().row_groups().iter()).flat_map(|own| own.columns());
    if chunks.any(|own| {
        own.compressed_size() < 0
            || own
                .dictionary_page_offset()
                .unwrap_or(own.data_page_offset())
                < 0
    }) {
        return Err(ParquetError::General("it is damaged".to_owned()));
    }
    let about = reader.metadata().file_metadata();
    let units = units(about);
    let durations = durations(about);
    let schema = about.schema_descr();
    let rows = usize::try_from(about.num_rows()).unwrap_or(usize::MAX);
    if rows.saturating_mul(schema.num_columns()) > MOST {
        return Err(ParquetError::General(format!("more than {MOST} values")));
    }
    let (mut numbers, mut texts) = (Vec::new(), Vec::new());
    for (k, column) in schema.columns().iter().enumerate() {
        let given = column.path().string();
        let (name, unit) = match units.get(&given).and_then(Value::as_str) {
            Some(unit) => (given.clone(), unit.to_owned()),
            None => name_and_unit(&given).unwrap_or_else(|| (given.clone(), String::new())),
        };
        // The index of a pandas frame, and what is no table.
        if given.starts_with("__index_level_") || column.max_rep_level() > 0 {
            continue;
        }
        // Times of the calendar count from the first row on, as in a CSV file; 2^53 ns are 104 days.
        let tick = tick(column).or_else(|| durations.get(&given).copied());
        let unit = if tick.is_some() { "s".to_owned() } else { unit };
        let mut first = None;
        let mut whole = |x: i64| match tick {
            None => x as f64,
            Some(tick) => x.wrapping_sub(*first.get_or_insert(x)) as f64 * tick,
        };
        let mut values = Vec::new();
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group)?;
            let count = usize::try_from(group.metadata().num_rows())
                .unwrap_or(0)
                .min(MOST);
            let levels = column.max_def_level();
            let read = &mut values;
            match group.get_column_reader(k)? {
                ColumnReader::BoolColumnReader(own) => {
                    append(own, count, levels, read, |x| f64::from(u8::from(x)))?
                }
                ColumnReader::Int32ColumnReader(own) => {
                    append(own, count, levels, read, |x| whole(i64::from(x)))?
                }
                ColumnReader::Int64ColumnReader(own) => {
                    append(own, count, levels, read, &mut whole)?
                }
                ColumnReader::FloatColumnReader(own) => {
                    append(own, count, levels, read, f64::from)?
                }
                ColumnReader::DoubleColumnReader(own) => append(own, count, levels, read, |x| x)?,
                _ => break,
            }
        }
        if values.len() == rows {
            numbers.push(Column { name, unit, values });
        } else {
            let found = "text".to_owned();
            texts.push(TextColumn {
                name: one_line(&name).into_owned(),
                line: 1,
                found,
                unclear: None,
            });
        }
    }
    Ok((numbers, texts))
}

/// Appends the values of a column in a group of rows; a missing one is NaN.
fn append<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    count: usize,
    most: i16,
    to: &mut Vec<f64>,
    mut number: impl FnMut(T::T) -> f64,
) -> Read<()> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    let mut left = count;
    while left > 0 {
        levels.clear();
        values.clear();
        let (records, ..) = reader.read_records(left, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Err(ParquetError::General(
                "it has fewer values than it says".to_owned(),
            ));
        }
        left = left.saturating_sub(records);
        let mut known = values.drain(..).map(&mut number);
        match most {
            0 => to.extend(known),
            _ => to.extend(levels.iter().map(|own| match *own == most {
                true => known.next().unwrap_or(f64::NAN),
                false => f64::NAN,
            })),
        }
    }
    Ok(())
}

/// Seconds in one of a column of points in time.
fn tick(column: &ColumnDescriptor) -> Option<f64> {
    let unit = match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Timestamp(own)), _) => &own.unit,
        (Some(LogicalType::Time(own)), _) => &own.unit,
        (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => &TimeUnit::MILLIS,
        (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => &TimeUnit::MICROS,
        _ => return None,
    };
    Some(match unit {
        TimeUnit::MILLIS => 1e-3,
        TimeUnit::MICROS => 1e-6,
        TimeUnit::NANOS => 1e-9,
    })
}

/// Seconds in one of the columns that are durations: Parquet has no type for them, pandas says it beside.
fn durations(about: &FileMetaData) -> HashMap<String, f64> {
    let all = about.key_value_metadata().into_iter().flatten();
    let own = all.into_iter().find(|own| own.key == "pandas");
    let read = own.and_then(|own| serde_json::from_str::<Value>(own.value.as_deref()?).ok());
    let columns = read.as_ref().and_then(|own| own["columns"].as_array());
    let duration = |own: &Value| {
        let name = own["field_name"].as_str().or(own["name"].as_str())?;
        let tick = match own["numpy_type"].as_str()? {
            "timedelta64[s]" => 1.0,
            "timedelta64[ms]" => 1e-3,
            "timedelta64[us]" => 1e-6,
            "timedelta64[ns]" => 1e-9,
            _ => return None,
        };
        Some((name.to_owned(), tick))
    };
    columns.into_iter().flatten().filter_map(duration).collect()
}

/// Units by column, as the metadata has them.
fn units(about: &FileMetaData) -> Map<String, Value> {
    let all = about.key_value_metadata().into_iter().flatten();
    let own = all.into_iter().find(|own| own.key == ATTRIBUTES);
    let read = own.and_then(|own| serde_json::from_str(own.value.as_deref()?).ok());
    match read {
        Some(Value::Object(mut object)) => match object.remove("units") {
            Some(Value::Object(units)) => units,
            _ => Map::new(),
        },
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: usize) -> Series {
        let column = |name: &str, unit: &str, of: fn(usize) -> f64| Column {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values: (0..rows).map(of).collect(),
        };
        Series {
            time: (0..rows).map(|k| (k / 2) as f64 * 0.1).collect(),
            time_unit: "s".to_owned(),
            columns: vec![
                column("vehicle.z", "m", |k| (k as f64).sin()),
                column(
                    "a.q[1]",
                    "",
                    |k| if k % 3 == 0 { f64::NAN } else { k as f64 },
                ),
                column("b.der(x) of \"y\", µ", "rad/s", |k| {
                    f64::INFINITY * if k % 2 == 0 { 1.0 } else { -1.0 }
                }),
            ],
            ..Series::default()
        }
    }

    fn bits(own: &Series) -> Vec<(String, String, Vec<u64>)> {
        let bits = |all: &[f64]| all.iter().map(|x| x.to_bits()).collect();
        let columns = own.columns.iter();
        let columns = columns.map(|own| (own.name.clone(), own.unit.clone(), bits(&own.values)));
        columns
            .chain([("time".to_owned(), own.time_unit.clone(), bits(&own.time))])
            .collect()
    }

    #[test]
    fn a_table_reads_back_to_the_same_bits() {
        let own = table(2500);
        let bytes = own.to_parquet().unwrap();
        let back = read(&bytes[..], "r.parquet", true, "time").unwrap();
        assert_eq!(bits(&back), bits(&own));
        let words = |form: bool, time: &str| {
            read(&bytes[..], "r.parquet", form, time)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            words(false, "time"),
            "r.parquet: `b.der(x) of \"y\", µ` has infinite values"
        );
        assert_eq!(
            words(true, "t"),
            "r.parquet: no column of numbers is called `t`"
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r");
        std::fs::write(&path, &bytes).unwrap();
        assert!(is_own(&path));
        // A file is recognised by its content.
        assert_eq!(bits(&Series::read_table(&path).unwrap()), bits(&own));
        std::fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        assert!(!is_own(&path));
    }

    #[test]
    fn values_that_are_missing_and_texts() {
        let field = |name: &str, kind| Field {
            kind,
            ..Field::real(name, "ms")
        };
        let fields = [
            field("time", Kind::Known),
            field("n", Kind::Whole),
            field("word", Kind::Text),
            field("x", Kind::Known),
        ];
        let mut writer =
            ParquetWriter::new(Vec::new(), &fields, &[("run", "7".to_owned())]).unwrap();
        for k in 0..3 {
            let values = [k as f64, f64::NAN];
            let time = [1000.0 * k as f64, 1000.0 * k as f64];
            let columns = [
                Values::Numbers(&time),
                Values::Whole(&[k, -k]),
                Values::Texts(&["", "ä"]),
                Values::Numbers(&values),
            ];
            writer.rows(&columns).unwrap();
        }
        let bytes = writer.finish().unwrap();
        let back = read(&bytes[..], "r.parquet", false, "time").unwrap();
        assert_eq!(back.time, [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]);
        assert_eq!(back.columns[0].values, [0.0, 0.0, 1.0, -1.0, 2.0, -2.0]);
        assert_eq!(
            back.columns[1]
                .values
                .iter()
                .filter(|own| own.is_nan())
                .count(),
            3
        );
        assert_eq!((back.texts.len(), back.texts[0].name.as_str()), (1, "word"));
    }

    /// Files that are damaged are refused or read, but nothing panics or takes gigabytes.
    #[test]
    fn damaged_files_are_refused() {
        let bytes = table(40).to_parquet().unwrap();
        let mut state = 7_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize
        };
        let mut refused = 0;
        for k in 0..1000 {
            let mut own = bytes.clone();
            for _ in 0..=k % 3 {
                let at = next() % own.len();
                own[at] = next() as u8;
            }
            if k % 5 == 0 {
                own.truncate(next() % bytes.len());
            }
            refused += usize::from(read(&own[..], "r.parquet", true, "time").is_err());
        }
        assert!((300..1000).contains(&refused), "{refused}");
    }
}
