//! The problem that flights pose: the text that `pilotage init` writes too, and the same in memory, with the recordings that
//! were read.
//!
//! | module | content |
//! | --- | --- |
//! | `instance` | pilot and vehicle, by their variables |
//! | `draft` | the text of a problem |

mod draft;
mod instance;

pub use draft::{Draft, NothingMeasured, Recorded};
pub use instance::{Instance, Parameter};

use crate::options::{InitialPosition, InitialState, Objective};
use crate::trials::{ColumnNames, Trial, TrialSet};
use pilotage_estimation::file::{Mesh, Options};
use pilotage_estimation::{ProblemError, ProblemFile};
use pilotage_models::{COEFFICIENTS, Quadcopter, TextModel, library};
use pilotage_series::Series;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a fit of flights may choose, with its defaults: the linear pilot of third order and the default vehicle at rest, whose
/// response is fitted.
#[derive(Debug, Clone)]
pub struct FlightOptions {
    /// Order of the pilot.
    pub order: usize,
    /// θ where the search starts; `None`: the values of the built-in pilot.
    pub theta: Option<Vec<f64>>,
    /// Limit on |y_p|, dimensionless.
    pub stick_limit: f64,
    /// The vehicle.
    pub vehicle: Quadcopter,
    /// The vehicle's file; `None`: the problem states the coefficients that are not those of the built-in quadcopter.
    pub vehicle_file: Option<PathBuf>,
    /// What is known about the states at the first sample.
    pub initial_state: InitialState,
    /// What is known about the position at the first sample, if the vehicle is at rest.
    pub initial_position: InitialPosition,
    /// Whether a fit of the response keeps the closed loop stable.
    pub stable_loop: bool,
    /// The signal whose residuals are minimised.
    pub objective: Objective,
    /// Names of the columns.
    pub columns: ColumnNames,
    /// Options of the fit.
    pub fit: Options,
}

impl Default for FlightOptions {
    fn default() -> Self {
        Self {
            order: 3,
            theta: None,
            stick_limit: 1.0,
            vehicle: Quadcopter::default(),
            vehicle_file: None,
            initial_state: InitialState::AtRest,
            initial_position: InitialPosition::Estimated,
            stable_loop: true,
            objective: Objective::Response,
            columns: ColumnNames::default(),
            fit: Options {
                mesh: Mesh::Samples,
                ..Options::default()
            },
        }
    }
}

/// Why flights pose no problem.
#[derive(Debug, thiserror::Error)]
pub enum FlightProblemError {
    /// A value out of range.
    #[error("{0}")]
    Value(String),
    /// The flights have no column that is measured.
    #[error(transparent)]
    Nothing(#[from] NothingMeasured),
    /// What is written is no problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
}

/// The parameter of a problem that holds the position of each run at its start.
const START: &str = "start_position";

/// The comment of a position that is sought like the others.
pub const ESTIMATED: &str = "the first sample is a measurement like the others";

impl FlightOptions {
    /// The problem of these flights, with paths relative to the working directory. The recordings are those of the flights:
    /// no file is read.
    ///
    /// # Errors
    /// If the options and the flights do not fit each other.
    pub fn problem(&self, flights: &TrialSet) -> Result<ProblemFile, FlightProblemError> {
        if flights.fit.is_empty() {
            return Err(FlightProblemError::Value("no trial to fit".to_owned()));
        }
        let all: Vec<&Trial> = flights.all().collect();
        let series: Vec<Series> = all.iter().map(|own| self.recorded(own)).collect();
        let text = self.text(flights, &series)?;
        let mut file = ProblemFile::parse(&text, Path::new("flights"))?;
        for ((run, series), own) in file.runs.iter_mut().zip(series).zip(all) {
            run.recorded = Some(Arc::new(series));
            run.name.clone_from(&own.name);
        }
        Ok(file)
    }

    /// The text of the problem, in which the columns have the names of these series, one for each flight.
    ///
    /// # Errors
    /// As [`Self::problem`].
    fn text(&self, flights: &TrialSet, series: &[Series]) -> Result<String, FlightProblemError> {
        let instances = self.instances()?;
        let is_unknown =
            |own: &&Trial| !own.position.first().is_some_and(|first| first.is_finite());
        let is_set = self.knows_position() && flights.fit.iter().any(|own| is_unknown(&own));
        let run = |(k, own): (usize, &Trial)| Recorded {
            file: own.origin.clone(),
            series: &series[k],
            weight: own.weight,
            fits: k < flights.fit.len(),
            set: match is_set {
                true => vec![(START.to_owned(), own.origin())],
                false => Vec::new(),
            },
        };
        let runs: Vec<Recorded<'_>> = flights.all().enumerate().map(run).collect();
        let draft = Draft {
            instances: &instances,
            names: &self.columns,
            runs: &runs,
            measured: (self.objective == Objective::Stick).then_some("pilot.stick"),
            initial: self.initial(is_set),
            own: match is_set {
                true => vec![format!(
                    "{START} = {{ start = 0.0, unit = \"m\", fixed = true }}"
                )],
                false => Vec::new(),
            },
            stable: vec!["pilot"],
            stable_loop: self.stable_loop && self.objective == Objective::Response,
            options: self.fit,
        };
        Ok(draft.text()?)
    }

    /// Pilot and vehicle; the pilot alone, which sees the recorded error, if its stick is fitted.
    fn instances(&self) -> Result<Vec<Instance>, FlightProblemError> {
        let order = 1..=library::MAX_ORDER;
        if !order.contains(&self.order) {
            let text = format!(
                "order {} of the pilot is not from 1 to {}",
                self.order,
                order.end()
            );
            return Err(FlightProblemError::Value(text));
        }
        let model = |text: &str| TextModel::parse(text, "built in").expect("a built-in model");
        let mut pilot = Instance::of_model("pilot", "linear", &model(&library::linear(self.order)));
        pilot.order = Some(self.order);
        let theta = self.theta.iter().flatten().copied();
        let given = theta.clone().count();
        if given > 0 && given != 2 * self.order {
            let (expected, order) = (2 * self.order, self.order);
            let text = format!(
                "the start has {given} parameters; a pilot of order {order} has {expected}"
            );
            return Err(FlightProblemError::Value(text));
        }
        let wrong = theta.clone().position(|own| !own.is_finite());
        let is_zero = given > 0 && theta.clone().all(|own| own == 0.0);
        if let Some(k) = wrong.or(is_zero.then_some(0)) {
            let value = theta.clone().nth(k).unwrap_or_default();
            let text = format!(
                "start parameter theta{} = {value}; expected finite numbers, not all zero",
                k + 1
            );
            return Err(FlightProblemError::Value(text));
        }
        for (parameter, value) in pilot.parameters.iter_mut().zip(theta) {
            parameter.start = value;
        }
        let limit = pilot
            .parameters
            .iter_mut()
            .find(|own| own.name == "stick_limit");
        limit.expect("the pilot's own").start = self.stick_limit;
        if self.objective == Objective::Stick {
            return Ok(vec![pilot]);
        }
        let quadcopter = library::find("quadcopter").expect("a built-in model");
        let mut vehicle = Instance::of_model("vehicle", "quadcopter", &model(quadcopter.text));
        match &self.vehicle_file {
            Some(file) => vehicle.model = file.display().to_string(),
            None => {
                let usual = Quadcopter::default();
                let differs = COEFFICIENTS
                    .iter()
                    .filter(|own| (own.get)(&self.vehicle) != (own.get)(&usual));
                vehicle.set =
                    (differs.map(|own| (own.name.to_owned(), (own.get)(&self.vehicle)))).collect();
            }
        }
        Ok(vec![pilot, vehicle])
    }

    /// Whether the vehicle begins at the first recorded position.
    fn knows_position(&self) -> bool {
        self.objective == Objective::Response
            && self.initial_state != InitialState::Free
            && self.initial_position == InitialPosition::Known
    }

    /// The lines of the initial states; `is_set`: each run states its position.
    fn initial(&self, is_set: bool) -> Vec<(String, &'static str)> {
        let free = |name: &str| format!("\"{name}\" = \"free\"");
        let mut lines = Vec::new();
        if self.initial_state != InitialState::AtRest {
            lines.push((free("pilot.*"), ""));
        }
        if self.objective == Objective::Stick {
            return lines;
        }
        lines.push(match self.initial_state {
            InitialState::Free => (free("vehicle.*"), ""),
            _ if is_set => (
                format!("\"vehicle.z\" = \"{START}\""),
                "the first one recorded",
            ),
            _ if self.knows_position() => ("\"vehicle.z\" = \"first sample\"".to_owned(), ""),
            _ => (free("vehicle.z"), ESTIMATED),
        });
        lines
    }

    /// A flight as the columns of a run. If the pilot is driven by the recorded position, missing samples are filled.
    fn recorded(&self, flight: &Trial) -> Series {
        let mut series = flight.series(&self.columns);
        if self.objective == Objective::Stick {
            let position = self.columns.of("position");
            for column in series.columns.iter_mut().filter(|own| own.name == position) {
                column.values = flight.filled_position();
            }
        }
        series
    }
}
