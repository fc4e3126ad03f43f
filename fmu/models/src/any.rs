//! The model that the shared library of exported FMUs runs: a model of this crate, or one from a model file.

use crate::model::{BadResource, MODEL_FILE};
use crate::text::TextModel;
use crate::{Model, Scalar, Table};
use pilotage_sdk::resources::{self, LoadError};
use pilotage_sdk::structure::Influences;
use pilotage_sdk::{At, Equations};

/// A model, by the place where its equations are defined.
#[derive(Debug, Clone)]
pub enum AnyModel {
    /// In this crate.
    BuiltIn(Model),
    /// In a model file.
    Text(TextModel),
}

impl AnyModel {
    /// Reads the model from [`MODEL_FILE`] in the `resources` folder.
    ///
    /// # Errors
    /// If the file is missing or is not one that was exported.
    pub fn from_resources(location: Option<&str>) -> Result<Self, LoadError> {
        let (file, text) = resources::read(location, MODEL_FILE)?;
        if pilotage_language::is_model(&text) {
            let read_table = |table: &str| {
                let read = resources::read(location, table);
                read.map(|(_, text)| text).map_err(std::io::Error::other)
            };
            let compiled = pilotage_language::parse(&text, MODEL_FILE, &read_table);
            return match compiled {
                Ok(compiled) => Ok(Self::Text(TextModel::of(compiled))),
                Err(error) => Err(format!("{}: {error}", file.display()).into()),
            };
        }
        let model = Model::from_file(&text).map_err(|source| BadResource { file, source })?;
        Ok(Self::BuiltIn(model))
    }
}

/// Forwards a call to the model.
macro_rules! either {
    ($own:expr, $model:ident => $call:expr) => {
        match $own {
            AnyModel::BuiltIn($model) => $call,
            AnyModel::Text($model) => $call,
        }
    };
}

impl Equations for AnyModel {
    fn table(&self) -> Table {
        either!(self, model => model.table())
    }

    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
        either!(self, model => model.derivative(at, dx));
    }

    fn output<T: Scalar>(&self, at: At<T>, y: &mut [T]) {
        either!(self, model => model.output(at, y));
    }

    fn is_linear(&self) -> bool {
        either!(self, model => model.is_linear())
    }

    fn start(&self, p: &[f64], x: &mut [f64]) {
        either!(self, model => model.start(p, x));
    }

    fn time_events(&self, u: &[f64], p: &[f64], times: &mut Vec<f64>) {
        either!(self, model => model.time_events(u, p, times));
    }

    fn delays(&self, p: &[f64], times: &mut Vec<f64>) {
        either!(self, model => model.delays(p, times));
    }

    fn signals<T: Scalar>(&self, at: At<T>, signals: &mut [T]) {
        either!(self, model => model.signals(at, signals));
    }

    fn trouble(&self, at: At<f64>) -> Option<String> {
        either!(self, model => model.trouble(at))
    }

    fn influences(&self) -> Option<Influences> {
        either!(self, model => model.influences())
    }
}
