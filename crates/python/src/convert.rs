//! Series to arrays and back. An array comes as bytes, of which NumPy makes one without another copy.

use pilotage::cli::call::Done;
use pilotage_series::{Column, Series};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use std::path::PathBuf;

/// Name, unit, and the bytes of the doubles.
type Array<'py> = (String, String, Bound<'py, PyByteArray>);

/// The bytes of the times, and the columns.
type Table<'py> = (Bound<'py, PyByteArray>, Vec<Array<'py>>);

/// Exit code, stdout, stderr, tables and texts of a command.
pub type Left<'py> = (
    u8,
    String,
    String,
    Vec<(String, Table<'py>)>,
    Vec<(String, String)>,
);

/// What a command left, for Python.
pub fn left(py: Python<'_>, done: Done) -> PyResult<Left<'_>> {
    let tables = done.tables.into_iter();
    let tables = tables.map(|(name, series)| Ok((name, table(py, series)?)));
    let tables = tables.collect::<PyResult<_>>()?;
    Ok((done.code, done.stdout, done.stderr, tables, done.texts))
}

fn table(py: Python<'_>, series: Series) -> PyResult<Table<'_>> {
    let column = |own: Column| Ok((own.name, own.unit, bytes(py, &own.values)?));
    let columns = series.columns.into_iter().map(column);
    Ok((bytes(py, &series.time)?, columns.collect::<PyResult<_>>()?))
}

fn bytes<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, size_of_val(values), |bytes| {
        let (places, _) = bytes.as_chunks_mut();
        for (place, value) in places.iter_mut().zip(values) {
            *place = value.to_ne_bytes();
        }
        Ok(())
    })
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    let (values, _) = bytes.as_chunks();
    values
        .iter()
        .map(|value| f64::from_ne_bytes(*value))
        .collect()
}

/// Writes a table over time as CSV: comments, the bytes of the times, then name, unit and bytes of each column. Numbers read
/// back as they are.
#[pyfunction]
pub fn write_table(
    path: PathBuf,
    comments: Vec<String>,
    time: &[u8],
    columns: Vec<(String, String, Vec<u8>)>,
) -> PyResult<()> {
    let time = doubles(time);
    let column = |(name, unit, bytes): (String, String, Vec<u8>)| {
        let values = doubles(&bytes);
        match values.len() == time.len() {
            true => Ok(Column { name, unit, values }),
            false => Err(PyValueError::new_err(format!(
                "`{name}` has {} values, and there are {} times",
                values.len(),
                time.len()
            ))),
        }
    };
    let columns = columns.into_iter().map(column).collect::<PyResult<_>>()?;
    let series = Series {
        comments,
        time,
        columns,
        ..Series::default()
    };
    Ok(std::fs::write(path, series.to_csv())?)
}

/// Reads a table over time, of any form that the command reads: the comments, the bytes of the times, and the columns.
#[pyfunction]
pub fn read_table(py: Python<'_>, path: PathBuf) -> PyResult<(Vec<String>, Table<'_>)> {
    let read = py.detach(|| Series::read_table(&path));
    let mut series = read.map_err(|error| PyValueError::new_err(error.to_string()))?;
    let comments = std::mem::take(&mut series.comments);
    Ok((comments, table(py, series)?))
}
