//! What is asked of a component in another process, and what it answers.

use crate::component::{ComponentError, Experiment, Linear, Progress, Value, ValueKind};
use nalgebra::DMatrix;
use pilotage_linear::StateSpace;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::error::Error;
use std::fmt;

/// Reals to be set, and then a question: an exchange between processes takes longer than setting.
#[derive(Debug, Serialize, Deserialize)]
pub struct Asked<'a> {
    /// Handles and values of calls of [`set_reals`](crate::Component::set_reals), one after another.
    pub sets: Cow<'a, [Set]>,
    #[serde(borrow)]
    pub question: Question<'a>,
}

/// Handles and values.
pub type Set = (Vec<u32>, Vec<f64>);

/// A call of [`Component`](crate::Component), or one more.
#[derive(Debug, Serialize, Deserialize)]
pub enum Question<'a> {
    /// Makes the component. The first question; the bytes of a path as the system has them.
    Open {
        path: Cow<'a, [u8]>,
        name: Cow<'a, str>,
        wanted: Option<Wanted>,
    },
    Setup(Experiment),
    EnterInitialization,
    ExitInitialization,
    /// To set reals is all that is asked.
    Nothing,
    WordsOfDiscard,
    GetReals(Cow<'a, [u32]>),
    Set(u32, Cow<'a, Value>),
    Get(u32, ValueKind),
    Step {
        t: f64,
        h: f64,
        is_revocable: bool,
        /// Reals that are told with the answer, if the step comes to its end.
        outputs: Cow<'a, [u32]>,
    },
    Terminate,
    Linearize(f64),
    Save(usize),
    Restore(usize),
    SetInputDerivatives(Cow<'a, [u32]>, Cow<'a, [f64]>),
    GetOutputDerivatives(Cow<'a, [u32]>),
    DirectionalDerivative {
        outputs: Cow<'a, [u32]>,
        inputs: Cow<'a, [u32]>,
        seed: Cow<'a, [f64]>,
    },
    /// Frees it. The last question.
    Free,
}

/// What an FMU is wanted for.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub enum Wanted {
    CoSimulation,
    ModelExchange,
}

/// What came of it.
#[derive(Debug, Serialize, Deserialize)]
pub enum Answer {
    Done,
    Reals(Vec<f64>),
    Value(Value),
    Words(Option<String>),
    /// How far a step came; when outputs jump next, after it and after whatever else moves in time; and the reals that
    /// were to be told, if they could be.
    Moved(Progress, Option<f64>, Option<Vec<f64>>),
    Linear(System),
    /// The error, and what it comes from, each in words.
    Failed(Vec<String>),
}

/// A linear system.
#[derive(Debug, Serialize, Deserialize)]
pub struct System {
    matrices: [Matrix; 4],
    names: [Vec<String>; 3],
    note: Option<String>,
}

/// Rows, columns, and the values column by column.
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
        let Linear { system, note } = own;
        Self {
            matrices: [system.a, system.b, system.c, system.d].map(Matrix::from),
            names: [system.states, system.inputs, system.outputs],
            note,
        }
    }
}

impl System {
    /// The linear system; none where its parts do not fit.
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
        fits.then_some(Linear {
            system,
            note: self.note,
        })
    }
}

/// An error and what it comes from, in words.
pub fn words(error: &(dyn Error + 'static)) -> Vec<String> {
    let mut all = vec![error.to_string()];
    let mut next = error.source();
    while let Some(error) = next {
        all.push(error.to_string());
        next = error.source();
    }
    all
}

/// An error that another process has told.
#[derive(Debug)]
struct Told {
    words: String,
    source: Option<Box<Told>>,
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

impl Error for Told {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source
            .as_deref()
            .map(|own| own as &(dyn Error + 'static))
    }
}

/// The error of these words.
pub fn error(words: Vec<String>) -> ComponentError {
    let told = words.into_iter().rev().fold(None, |source, words| {
        let source = source.map(Box::new);
        Some(Told { words, source })
    });
    match told {
        Some(told) => Box::new(told),
        None => "it failed, and does not say why".into(),
    }
}

/// A question or an answer as bytes, in place of what is there.
pub fn write(what: &impl Serialize, bytes: &mut Vec<u8>) -> Result<(), ComponentError> {
    bytes.clear();
    postcard::to_io(what, bytes)?;
    Ok(())
}

/// What the bytes say.
pub fn read<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, ComponentError> {
    Ok(postcard::from_bytes(bytes)?)
}
