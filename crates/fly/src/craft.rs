//! The flown vehicle: any component with an input for each hand axis and an output for each position.

use crate::protocol::Shape;
use pilotage_cosim::component::ComponentError;
use pilotage_cosim::{Component, Experiment, Progress, Role, ValueKind, Variable};
use thiserror::Error;

/// Simulation steps per second.
pub const STEPS: u32 = 1000;
/// Length of a step \[s\].
pub const STEP: f64 = 1.0 / STEPS as f64;
/// Duration for which full stick is held to determine its direction \[s\].
const TRIAL: f64 = 0.5;
/// Names of tilt angles.
const TILTS: [&str; 6] = ["theta", "pitch", "phi", "roll", "tilt", "attitude"];
/// Maximum number of hand axes.
const AXES: usize = 2;

/// Creates a vehicle in its initial state.
pub type Maker = Box<dyn Fn() -> Result<Box<dyn Component>, ComponentError> + Send>;

/// Why a vehicle cannot be flown.
#[derive(Debug, Error)]
pub enum CraftError {
    /// The vehicle lacks the input.
    #[error("{vehicle} has no input `{name}`; its inputs are {}", all.join(", "))]
    NoInput {
        /// The vehicle.
        vehicle: String,
        /// The requested name.
        name: String,
        /// The available inputs.
        all: Vec<String>,
    },
    /// The vehicle lacks the output.
    #[error("{vehicle} has no output `{name}`; its outputs are {}", all.join(", "))]
    NoOutput {
        /// The vehicle.
        vehicle: String,
        /// The requested name.
        name: String,
        /// The available outputs.
        all: Vec<String>,
    },
    /// The numbers of inputs and outputs differ or exceed two.
    #[error(
        "{inputs} inputs and {outputs} outputs: a hand has one axis or two, and each moves a position"
    )]
    Axes {
        /// Number of inputs moved by the hand.
        inputs: usize,
        /// Number of positions.
        outputs: usize,
    },
    /// Full stick does not move the vehicle.
    #[error("{vehicle}: full `{input}` for {TRIAL} s does not move `{output}`")]
    Unmoved {
        /// The vehicle.
        vehicle: String,
        /// The input.
        input: String,
        /// The output.
        output: String,
    },
    /// A call to the vehicle failed.
    #[error("{vehicle}: {source}")]
    Failed {
        /// The vehicle.
        vehicle: String,
        /// The vehicle's error.
        source: ComponentError,
    },
}

/// A real variable of the vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Its name.
    pub name: String,
    /// Its unit; `1` if not specified.
    pub unit: String,
    /// Handle used in calls.
    handle: u32,
}

/// The input moved by a hand axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Stick {
    /// The input.
    pub signal: Signal,
    /// Its value with the stick released.
    pub rest: f64,
    /// Its values at full stick: for motion to the left or down, and to the right or up.
    pub stops: [f64; 2],
}

/// A vehicle that can be flown.
pub struct Craft {
    /// Its display name.
    pub name: String,
    /// Its source, for the record: a file with its hash.
    pub origin: String,
    /// The input moved by each hand axis.
    pub sticks: Vec<Stick>,
    /// The position of each axis.
    pub positions: Vec<Signal>,
    /// The displayed angle of each axis; empty if there is none.
    pub tilts: Vec<Signal>,
    /// For each tilt, 1 if it increases as the vehicle leans forward, otherwise -1 (nose-up positive).
    pub lean: Vec<f64>,
    /// Other recorded outputs.
    pub others: Vec<Signal>,
    /// Initial position of each axis.
    pub origin_positions: Vec<f64>,
    make: Maker,
}

impl std::fmt::Debug for Craft {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Craft")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Names of inputs and outputs given by the user; empty for the defaults.
#[derive(Debug, Clone, Default)]
pub struct Names {
    /// Inputs moved by the hand.
    pub inputs: Vec<String>,
    /// The positions.
    pub outputs: Vec<String>,
}

impl Craft {
    /// Determines the stick inputs, the position outputs, and the direction in which full stick moves the vehicle.
    ///
    /// # Errors
    /// If there is no such input or output, or the vehicle does not move.
    pub fn new(name: &str, origin: String, names: &Names, make: Maker) -> Result<Self, CraftError> {
        let failed = |source| CraftError::Failed {
            vehicle: name.to_owned(),
            source,
        };
        let component = make().map_err(failed)?;
        let reals = |role: Role| -> Vec<&Variable> {
            let all = component.variables().iter();
            all.filter(|own| own.role == role && own.kind == ValueKind::Real)
                .collect()
        };
        let (inputs, outputs) = (reals(Role::Input), reals(Role::Output));
        let found = |asked: &[String],
                     usual: &[[&str; AXES]],
                     all: &[&Variable]|
         -> Result<Vec<usize>, String> {
            let place = |name: &str| {
                all.iter()
                    .position(|own| own.names().any(|known| known == name))
            };
            if !asked.is_empty() {
                return asked
                    .iter()
                    .map(|name| place(name).ok_or_else(|| name.clone()))
                    .collect();
            }
            let known = usual.iter().map(|set| {
                set.iter()
                    .filter_map(|name| place(name))
                    .collect::<Vec<_>>()
            });
            let known = known.into_iter().find(|found| !found.is_empty());
            known
                .or((!all.is_empty()).then(|| vec![0]))
                .ok_or_else(|| usual[0][0].to_owned())
        };
        let all = |variables: &[&Variable]| variables.iter().map(|own| own.name.clone()).collect();
        let sticks = found(&names.inputs, &[["stick", "stick2"]], &inputs).map_err(|missing| {
            CraftError::NoInput {
                vehicle: name.to_owned(),
                name: missing,
                all: all(&inputs),
            }
        })?;
        let places = found(
            &names.outputs,
            &[["position", "position2"], ["z", "z2"]],
            &outputs,
        );
        let places = places.map_err(|missing| CraftError::NoOutput {
            vehicle: name.to_owned(),
            name: missing,
            all: all(&outputs),
        })?;
        if sticks.len() != places.len() || sticks.len() > AXES {
            return Err(CraftError::Axes {
                inputs: sticks.len(),
                outputs: places.len(),
            });
        }
        let is_angle = |own: &&&Variable| {
            let unit = own.unit.as_ref().is_some_and(|unit| unit.name == "rad");
            unit && TILTS
                .iter()
                .any(|tilt| own.name.to_lowercase().contains(tilt))
        };
        let locals = reals(Role::Local);
        let angles = outputs.iter().chain(&locals).filter(is_angle);
        let others = (outputs.iter().enumerate())
            .filter(|(place, own)| !places.contains(place) && !is_column(&own.name));
        let mut own = Self {
            name: name.to_owned(),
            origin,
            sticks: sticks.iter().map(|k| stick(inputs[*k])).collect(),
            positions: places.iter().map(|k| signal(outputs[*k])).collect(),
            lean: vec![1.0; places.len()],
            tilts: angles.map(|own| signal(own)).take(places.len()).collect(),
            others: others.map(|(_, own)| signal(own)).collect(),
            origin_positions: Vec::new(),
            make,
        };
        drop(component);
        let origin = own.begin()?.positions();
        own.origin_positions = origin.map_err(|source| own.failed(source))?;
        for axis in 0..own.sticks.len() {
            own.look(axis)?;
        }
        Ok(own)
    }

    /// Number of axes.
    pub fn axes(&self) -> usize {
        self.sticks.len()
    }

    /// For each axis, whether a larger input moves the vehicle forward.
    pub fn forward(&self) -> Vec<bool> {
        let is_forward = |stick: &Stick| stick.stops[0] < stick.stops[1];
        self.sticks.iter().map(is_forward).collect()
    }

    /// Properties on which tasks depend.
    pub fn shape(&self) -> Shape<'_> {
        Shape {
            axes: self.axes(),
            unit: &self.positions[0].unit,
        }
    }

    /// A new vehicle in its initial state.
    ///
    /// # Errors
    /// If the vehicle fails.
    pub fn begin(&self) -> Result<Flying, CraftError> {
        Flying::new(self).map_err(|source| self.failed(source))
    }

    /// Wraps the vehicle's error.
    pub fn failed(&self, source: ComponentError) -> CraftError {
        CraftError::Failed {
            vehicle: self.name.clone(),
            source,
        }
    }

    /// Simulates briefly to determine which stop moves the vehicle forward, and the sign of its tilt.
    fn look(&mut self, axis: usize) -> Result<(), CraftError> {
        let moved = |end: usize| -> Result<(f64, f64), CraftError> {
            let mut flying = self.begin()?;
            let mut hand = vec![0.0; self.axes()];
            hand[axis] = [-1.0, 1.0][end];
            for k in 0..(TRIAL / STEP) as u32 {
                flying
                    .step(f64::from(k) * STEP, &self.inputs(&hand))
                    .map_err(|source| self.failed(source))?;
            }
            let position = flying.positions().map_err(|source| self.failed(source))?[axis];
            let tilts = flying.tilts().map_err(|source| self.failed(source))?;
            Ok((position, tilts.get(axis).copied().unwrap_or(0.0)))
        };
        let [(down, tilt_down), (up, tilt_up)] = [moved(0)?, moved(1)?];
        if up == down || !(up - down).is_finite() {
            return Err(CraftError::Unmoved {
                vehicle: self.name.clone(),
                input: self.sticks[axis].signal.name.clone(),
                output: self.positions[axis].name.clone(),
            });
        }
        if up < down {
            self.sticks[axis].stops.reverse();
        }
        if (up - down) * (tilt_up - tilt_down) < 0.0 {
            self.lean[axis] = -1.0;
        }
        Ok(())
    }

    /// The vehicle's inputs for hand deflections: -1 to 1 for each axis, from left or down to right or up.
    pub fn inputs(&self, hand: &[f64]) -> Vec<f64> {
        let of = |(stick, hand): (&Stick, &f64)| {
            let hand = hand.clamp(-1.0, 1.0);
            let stop = stick.stops[usize::from(hand > 0.0)];
            stick.rest + hand.abs() * (stop - stick.rest)
        };
        self.sticks.iter().zip(hand).map(of).collect()
    }

    /// The hand deflections for these inputs, for a model that flies alongside a person.
    pub fn hand(&self, inputs: &[f64]) -> Vec<f64> {
        let of = |(stick, input): (&Stick, &f64)| {
            let part = |stop: f64| (input - stick.rest) / (stop - stick.rest);
            let [down, up] = stick.stops.map(part);
            match up >= 0.0 {
                true => up.min(1.0),
                false => -down.min(1.0),
            }
        };
        self.sticks.iter().zip(inputs).map(of).collect()
    }
}

fn signal(own: &Variable) -> Signal {
    Signal {
        name: own.name.clone(),
        unit: own
            .unit
            .as_ref()
            .map_or_else(|| "1".to_owned(), |unit| unit.name.clone()),
        handle: own.handle,
    }
}

/// If the vehicle does not limit an input, full stick is at ±1.
fn stick(own: &Variable) -> Stick {
    let [low, high] = own.range;
    let is_known = low.is_finite() && high.is_finite() && low < high;
    let stops = if is_known { [low, high] } else { [-1.0, 1.0] };
    let middle = (stops[0] + stops[1]) / 2.0;
    Stick {
        signal: signal(own),
        rest: if stops[0] < 0.0 && stops[1] > 0.0 {
            0.0
        } else {
            middle
        },
        stops,
    }
}

/// Whether the name is one of a flight's standard columns.
fn is_column(name: &str) -> bool {
    let stem = name.trim_end_matches('2');
    ["time", "target", "position", "stick", "disturbance"].contains(&stem)
}

/// A running vehicle.
pub struct Flying {
    /// Names of the positions.
    names: Vec<String>,
    component: Box<dyn Component>,
    inputs: Vec<u32>,
    positions: Vec<u32>,
    tilts: Vec<u32>,
    lean: Vec<f64>,
    others: Vec<u32>,
}

impl Flying {
    fn new(craft: &Craft) -> Result<Self, ComponentError> {
        let mut component = (craft.make)()?;
        let handles = |signals: &[Signal]| signals.iter().map(|own| own.handle).collect();
        let inputs: Vec<u32> = craft
            .sticks
            .iter()
            .map(|stick| stick.signal.handle)
            .collect();
        component.setup(&Experiment {
            start: 0.0,
            stop: f64::INFINITY,
            tolerance: None,
        })?;
        component.enter_initialization()?;
        let rest: Vec<f64> = craft.sticks.iter().map(|stick| stick.rest).collect();
        component.set_reals(&inputs, &rest)?;
        component.exit_initialization()?;
        Ok(Self {
            names: craft.positions.iter().map(|own| own.name.clone()).collect(),
            inputs,
            positions: handles(&craft.positions),
            tilts: handles(&craft.tilts),
            lean: craft.lean.clone(),
            others: handles(&craft.others),
            component,
        })
    }

    /// Steps with these inputs.
    ///
    /// # Errors
    /// If the vehicle fails or requests the end.
    pub fn step(&mut self, time: f64, inputs: &[f64]) -> Result<(), ComponentError> {
        self.component.set_reals(&self.inputs, inputs)?;
        match self.component.step(time, STEP)? {
            Progress::Done => Ok(()),
            Progress::Discarded { reached } => {
                let words = self.component.words_of_discard().unwrap_or_default();
                Err(format!("it discarded the step from {time} s at {reached} s {words}").into())
            }
            Progress::EndRequested { reached } => {
                Err(format!("it wants to end at {reached} s").into())
            }
        }
    }

    /// The current positions.
    ///
    /// # Errors
    /// If the vehicle fails, or a position is not finite.
    pub fn positions(&mut self) -> Result<Vec<f64>, ComponentError> {
        let values = self.reals(&self.positions.clone())?;
        match values.iter().position(|value| !value.is_finite()) {
            Some(k) => Err(format!("`{}` is {}", self.names[k], values[k]).into()),
            None => Ok(values),
        }
    }

    /// The tilt angles, positive forward.
    ///
    /// # Errors
    /// If the vehicle fails.
    pub fn tilts(&mut self) -> Result<Vec<f64>, ComponentError> {
        let tilts = self.reals(&self.tilts.clone())?;
        let pairs = tilts.iter().zip(&self.lean);
        Ok(pairs.map(|(tilt, lean)| tilt * lean).collect())
    }

    /// The other recorded outputs.
    ///
    /// # Errors
    /// If the vehicle fails.
    pub fn others(&mut self) -> Result<Vec<f64>, ComponentError> {
        self.reals(&self.others.clone())
    }

    fn reals(&mut self, handles: &[u32]) -> Result<Vec<f64>, ComponentError> {
        let mut values = vec![0.0; handles.len()];
        if !handles.is_empty() {
            self.component.get_reals(handles, &mut values)?;
        }
        Ok(values)
    }
}

impl Drop for Flying {
    fn drop(&mut self) {
        // The run is over: errors no longer matter.
        let _ = self.component.terminate();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_cosim::NativeComponent;
    use pilotage_models::Quadcopter;

    fn quadcopter() -> Craft {
        let make: Maker = Box::new(|| {
            Ok(Box::new(NativeComponent::new(
                pilotage_models::Model::quadcopter(&Quadcopter::default()),
            )))
        });
        Craft::new("quadcopter", String::new(), &Names::default(), make).unwrap()
    }

    /// Whatever the sign of the vehicle's stick, moving the hand to the right increases the position.
    #[test]
    fn the_hand_leads_where_it_points() {
        let craft = quadcopter();
        assert_eq!(craft.axes(), 1);
        for hand in [-1.0, 1.0] {
            let mut flying = craft.begin().unwrap();
            for k in 0..1000 {
                flying
                    .step(f64::from(k) * STEP, &craft.inputs(&[hand]))
                    .unwrap();
            }
            let position = flying.positions().unwrap()[0];
            assert!(position * hand > 0.0, "{hand}: {position}");
        }
        for hand in [-1.0, -0.3, 0.0, 0.7] {
            assert!((craft.hand(&craft.inputs(&[hand]))[0] - hand).abs() < 1e-12);
        }
    }

    #[test]
    fn what_it_lacks_is_named_with_what_it_has() {
        let make = || -> Maker {
            Box::new(|| {
                Ok(Box::new(NativeComponent::new(
                    pilotage_models::Model::quadcopter(&Quadcopter::default()),
                )))
            })
        };
        let named = |inputs: &[&str], outputs: &[&str]| Names {
            inputs: inputs.iter().map(|&name| name.to_owned()).collect(),
            outputs: outputs.iter().map(|&name| name.to_owned()).collect(),
        };
        let message = |names: Names| {
            Craft::new("q", String::new(), &names, make())
                .unwrap_err()
                .to_string()
        };
        assert!(
            message(named(&["elevator"], &[]))
                .starts_with("q has no input `elevator`; its inputs are stick")
        );
        assert!(
            message(named(&[], &["height"]))
                .starts_with("q has no output `height`; its outputs are z")
        );
        assert!(message(named(&["stick"], &["z", "z"])).starts_with("1 inputs and 2 outputs"));
    }
}
