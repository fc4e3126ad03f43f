//! The identified pilot, which performs the same task on a second vehicle.

use crate::craft::{Craft, Flying, STEP};
use pilotage_cosim::component::ComponentError;
use pilotage_cosim::{Component, Experiment, Progress, Role};

/// A pilot with inputs `target` and `position` and output `stick`; those of a second axis end in 2.
pub struct Beside {
    pilot: Box<dyn Component>,
    targets: Vec<u32>,
    positions: Vec<u32>,
    sticks: Vec<u32>,
    vehicle: Flying,
    stops: Vec<[f64; 2]>,
}

impl std::fmt::Debug for Beside {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Beside").finish_non_exhaustive()
    }
}

impl Beside {
    /// A pilot and a vehicle in their initial states.
    ///
    /// # Errors
    /// If the pilot lacks an input or output, or one of them fails.
    pub fn new(mut pilot: Box<dyn Component>, craft: &Craft) -> Result<Self, ComponentError> {
        let find = |role: Role, name: &str| -> Result<Vec<u32>, ComponentError> {
            let axes = (1..=craft.axes()).map(|axis| match axis {
                1 => name.to_owned(),
                _ => format!("{name}{axis}"),
            });
            let found = axes.map(|name| {
                let mut all = pilot.variables().iter().filter(|own| own.role == role);
                let own = all.find(|own| own.names().any(|known| known == name));
                own.map(|own| own.handle)
                    .ok_or_else(|| format!("the pilot has no `{name}`").into())
            });
            found.collect()
        };
        let (targets, positions) = (find(Role::Input, "target")?, find(Role::Input, "position")?);
        let sticks = find(Role::Output, "stick")?;
        pilot.setup(&Experiment {
            start: 0.0,
            stop: f64::INFINITY,
            tolerance: None,
        })?;
        pilot.enter_initialization()?;
        pilot.exit_initialization()?;
        let vehicle = craft.begin().map_err(|error| error.to_string())?;
        let stops = craft.sticks.iter().map(|stick| {
            let [a, b] = stick.stops;
            [a.min(b), a.max(b)]
        });
        Ok(Self {
            pilot,
            targets,
            positions,
            sticks,
            vehicle,
            stops: stops.collect(),
        })
    }

    /// Steps with these targets and stick disturbances; returns the positions before the step.
    ///
    /// # Errors
    /// If the pilot or the vehicle fails.
    pub fn step(
        &mut self,
        time: f64,
        targets: &[f64],
        disturbances: &[f64],
    ) -> Result<Vec<f64>, ComponentError> {
        let positions = self.vehicle.positions()?;
        self.pilot.set_reals(&self.targets, targets)?;
        self.pilot.set_reals(&self.positions, &positions)?;
        if let Progress::Discarded { reached } | Progress::EndRequested { reached } =
            self.pilot.step(time, STEP)?
        {
            return Err(format!("the pilot stopped at {reached} s").into());
        }
        let mut sticks = vec![0.0; self.sticks.len()];
        self.pilot.get_reals(&self.sticks, &mut sticks)?;
        let pushed = sticks.iter().zip(disturbances).zip(&self.stops);
        let inputs: Vec<f64> = pushed
            .map(|((stick, push), [low, high])| (stick + push).clamp(*low, *high))
            .collect();
        self.vehicle.step(time, &inputs)?;
        Ok(positions)
    }
}
