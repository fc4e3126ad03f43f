//! Messages between a component in another process and its caller.

use crate::component::{ComponentError, Experiment, Linear, Progress, Value, ValueKind};
use nalgebra::DMatrix;
use pilotage_linear::StateSpace;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::error::Error;
use std::fmt;

/// Reals to be set, then a question; combined, since an exchange between processes takes longer than setting values.
#[derive(Debug, Serialize, Deserialize)]
pub struct Asked<'a> {
    /// Handles and values of successive calls of [`set_reals`](crate::Component::set_reals).
    pub sets: Cow<'a, [Set]>,
    #[serde(borrow)]
    pub question: Question<'a>,
}

/// Handles and values.
pub type Set = (Vec<u32>, Vec<f64>);

/// A call of [`Component`](crate::Component), or one of `Open`, `Nothing` and `Free`.
#[derive(Debug, Serialize, Deserialize)]
pub enum Question<'a> {
    /// Creates the component. The first question; `path` holds the bytes of the system's representation.
    Open {
        path: Cow<'a, [u8]>,
        name: Cow<'a, str>,
        wanted: Option<Wanted>,
    },
    Setup(Experiment),
    EnterInitialization,
    ExitInitialization,
    /// Only sets reals.
    Nothing,
    WordsOfDiscard,
    GetReals(Cow<'a, [u32]>),
    Set(u32, Cow<'a, Value>),
    Get(u32, ValueKind),
    Step {
        t: f64,
        h: f64,
        is_revocable: bool,
        /// Handles of reals returned with the answer if the step is complete.
        outputs: Cow<'a, [u32]>,
    },
    Terminate,
    Renew,
    Linearize(f64),
    Save(usize),
    Restore(usize),
    Serialize,
    Deserialize(Cow<'a, [u8]>),
    SetInputDerivatives(Cow<'a, [u32]>, Cow<'a, [f64]>),
    GetOutputDerivatives(Cow<'a, [u32]>),
    DirectionalDerivative {
        outputs: Cow<'a, [u32]>,
        inputs: Cow<'a, [u32]>,
        seed: Cow<'a, [f64]>,
    },
    /// Frees the component. The last question.
    Free,
}

/// Requested interface of an FMU.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub enum Wanted {
    CoSimulation,
    ModelExchange,
}

/// Answer to a question.
#[derive(Debug, Serialize, Deserialize)]
pub enum Answer {
    Done,
    Reals(Vec<f64>),
    Value(Value),
    Words(Option<String>),
    Bytes(Vec<u8>),
    /// Whether it is as it was when it was made.
    Renewed(bool),
    /// Result of a step; time of the next jump of outputs, after a step or any other change of time; and the requested
    /// reals, if available.
    Moved(Progress, Option<f64>, Option<Vec<f64>>),
    Linear(System),
    /// The error chain, as text.
    Failed(Vec<String>),
}

/// A linear system.
#[derive(Debug, Serialize, Deserialize)]
pub struct System {
    matrices: [Matrix; 4],
    names: [Vec<String>; 3],
    note: Option<String>,
}

/// Rows, columns, and the values in column-major order.
#[derive(Debug, Serialize, Deserialize)]
struct Matrix(usize, usize, Vec<f64>);

impl From<DMatrix<f64>> for Matrix {
    fn from(own: DMatrix<f64>) -> Self {
        Self(own.nrows(), own.ncols(), own.as_slice().to_vec())
    }
}

impl Matrix {
    fn read(self) -> Option<DMatrix<f64>> {
        let Self(rows, columns, values) = self;
        let is_whole = rows.checked_mul(columns) == Some(values.len());
        is_whole.then(|| DMatrix::from_vec(rows, columns, values))
    }
}

impl From<Linear> for System {
    fn from(own: Linear) -> Self {
        let Linear { system, note, .. } = own;
        Self {
            matrices: [system.a, system.b, system.c, system.d].map(Matrix::from),
            names: [system.states, system.inputs, system.outputs],
            note,
        }
    }
}

impl System {
    /// The linear system; `None` if the dimensions do not match.
    pub fn read(self) -> Option<Linear> {
        let [a, b, c, d] = self.matrices.map(Matrix::read);
        let [states, inputs, outputs] = self.names;
        let (a, b, c, d) = (a?, b?, c?, d?);
        let (x, u, y) = (states.len(), inputs.len(), outputs.len());
        let fits = [a.shape(), b.shape(), c.shape(), d.shape()] == [(x, x), (x, u), (y, x), (y, u)];
        let system = StateSpace {
            a,
            b,
            c,
            d,
            states,
            inputs,
            outputs,
        };
        fits.then(|| Linear {
            note: self.note,
            ..system.into()
        })
    }
}

/// The error chain, as text.
pub fn words(error: &(dyn Error + 'static)) -> Vec<String> {
    let mut all = vec![error.to_string()];
    let mut next = error.source();
    while let Some(error) = next {
        all.push(error.to_string());
        next = error.source();
    }
    all
}

/// An error reported by another process.
#[derive(Debug)]
struct ReportedError {
    words: String,
    source: Option<Box<ReportedError>>,
}

impl fmt::Display for ReportedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

impl Error for ReportedError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source
            .as_deref()
            .map(|own| own as &(dyn Error + 'static))
    }
}

/// Rebuilds an error from its chain of messages.
pub fn error(words: Vec<String>) -> ComponentError {
    let reported = words.into_iter().rev().fold(None, |source, words| {
        let source = source.map(Box::new);
        Some(ReportedError { words, source })
    });
    match reported {
        Some(reported) => Box::new(reported),
        None => "it failed, and does not say why".into(),
    }
}

/// Serializes a question or an answer; overwrites `bytes`.
pub fn write(what: &impl Serialize, bytes: &mut Vec<u8>) -> Result<(), ComponentError> {
    bytes.clear();
    postcard::to_io(what, bytes)?;
    Ok(())
}

/// Deserializes a question or an answer.
pub fn read<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, ComponentError> {
    Ok(postcard::from_bytes(bytes)?)
}
