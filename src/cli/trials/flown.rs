//! The vehicle and the equalisation of the synthetic human.

use super::super::model::open::ModelArgs;
use super::super::recognise::{self, FileKind};
use super::super::{Failure, vehicle};
use crate::models::Quadcopter;
use crate::synthetic::{
    Flight, Flights, Given, Hands, Human, ModelVehicle, SyntheticError, Vehicle,
};
use std::path::PathBuf;

/// The vehicle given by `--vehicle`.
pub enum Flown {
    /// The vehicle of a vehicle file, or the default one.
    Quadcopter(Box<Quadcopter>),
    /// A built-in model or a model file.
    Model(Box<ModelVehicle>),
}

/// Gain, lead and lag per axis as given: none, one for all axes, or one for each.
pub struct Equalisation<'a> {
    pub gain: &'a [f64],
    pub lead: &'a [f64],
    pub lag: &'a [f64],
}

impl Flown {
    /// Opens the vehicle; `measured` names the outputs that are the positions.
    pub fn open(name: Option<&str>, measured: &[String]) -> Result<Self, Failure> {
        let file = file(name);
        let is_quadcopter = match (&file, name) {
            (None, None) => true,
            (Some(file), _) => !recognise::is_model(file),
            (None, Some(_)) => false,
        };
        if is_quadcopter {
            if !measured.is_empty() {
                let failure = Failure::new("the quadcopter of a vehicle file has one position");
                return Err(failure.hint("--measure is for models: leave it out"));
            }
            let kinds = [FileKind::Vehicle, FileKind::Model];
            recognise::expect(&file, &kinds, "a vehicle file or a model file (TOML)")?;
            return Ok(Self::Quadcopter(Box::new(vehicle::resolve(
                file.as_deref(),
            )?)));
        }
        let model = ModelArgs {
            model: name.unwrap_or_default().to_owned(),
            order: None,
        };
        let opened = ModelVehicle::new(model.open()?, measured).map_err(explained)?;
        Ok(Self::Model(Box::new(opened)))
    }

    /// Number of axes.
    pub fn axes(&self) -> usize {
        match self {
            Self::Quadcopter(_) => 1,
            Self::Model(model) => model.axes(),
        }
    }

    /// Unit of the first position.
    pub fn unit(&self) -> &str {
        match self {
            Self::Quadcopter(_) => "m",
            Self::Model(model) => model.unit(0),
        }
    }

    /// The human in each axis: for the quadcopter as given or by default, for a model adapted to it.
    pub fn humans(&self, human: &Human, given: &Equalisation) -> Result<Vec<Human>, Failure> {
        let axes = 0..self.axes();
        let humans = axes.map(|axis| {
            let own = given.of(axis);
            match self {
                Self::Quadcopter(_) => Ok(Human {
                    gain: own.gain.unwrap_or(human.gain),
                    lead: own.lead.unwrap_or(human.lead),
                    lag: own.lag.unwrap_or(human.lag),
                    ..*human
                }),
                Self::Model(model) => human.suited(model, axis, own).map_err(explained),
            }
        });
        humans.collect()
    }

    /// Simulates the flights.
    pub fn fly(&self, flights: &Flights, hands: &Hands) -> Result<Vec<Flight>, Failure> {
        let flown = match self {
            Self::Quadcopter(vehicle) => flights.fly_hands(hands, &**vehicle),
            Self::Model(model) => flights.fly_hands(hands, &**model),
        };
        flown.map_err(explained)
    }
}

impl Equalisation<'_> {
    fn of(&self, axis: usize) -> Given {
        let at = |given: &[f64]| given.get(axis).or(given.first()).copied();
        Given {
            gain: at(self.gain),
            lead: at(self.lead),
            lag: at(self.lag),
        }
    }
}

/// The file given by `--vehicle`, if it is a file.
pub fn file(name: Option<&str>) -> Option<PathBuf> {
    let name = name?;
    let model = ModelArgs {
        model: name.to_owned(),
        order: None,
    };
    let is_named = !name.contains(['.', '/', '\\']);
    let path = model.file()?;
    (path.exists() || !is_named).then_some(path)
}

/// The failure with a hint.
fn explained(error: SyntheticError) -> Failure {
    let hint = match &error {
        SyntheticError::NoStick { .. } => {
            "name the input that the human moves `stick` in the model file; `pilotage models` lists vehicles that have one"
        }
        SyntheticError::NoOutput { .. } => "--measure NAME says which output is the position",
        SyntheticError::Axes { .. } => {
            "--measure takes one output for each stick, with commas between them"
        }
        SyntheticError::Unsuited { .. } => {
            "--gain and --lead give them; more --lead or a shorter --delay may help"
        }
        SyntheticError::Crowded { .. } => {
            "take fewer (--count), a longer --duration or a higher --rate"
        }
        SyntheticError::Unstable => "a lower --gain, more --lead or a shorter --delay may hold it",
        SyntheticError::Diverged { command, .. } if *command != "pilotage vehicle check" => {
            "a lower --gain or a shorter --delay may hold it"
        }
        _ => return Failure::from(error),
    };
    Failure::from(error).hint(hint)
}
