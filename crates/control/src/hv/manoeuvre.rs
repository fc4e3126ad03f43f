//! A landing as a flight from the failure on, and as models that repeat it.

use super::helicopter::INPUTS;
use super::point::{Landing, Landings};
use crate::optimise::{self, even};
use pilotage_language::with_starts;

/// A landing as a flight.
#[derive(Debug, Clone)]
pub struct Manoeuvre {
    /// What it is worth.
    pub landing: Landing,
    /// Times from the failure \[s\]; equal ones where the commands jump.
    pub time: Vec<f64>,
    /// States of the helicopter: name, unit, values.
    pub states: Vec<(String, String, Vec<f64>)>,
    /// Commands for thrust coefficient and tilt: the pilot's, or without one the rotor's.
    pub commands: [Vec<f64>; 2],
    /// What the rotor sees of them.
    pub rotor: [Vec<f64>; 2],
    /// Model file of the helicopter, which begins where the engine fails.
    pub helicopter: String,
    /// Model file of the pilot, which begins at rest; its inputs are `cz_command` and `alpha_command`, its outputs `cz` and `alpha`.
    pub pilot: Option<String>,
}

/// Time \[s\], states of the helicopter, commands, and what the rotor sees of them.
type Instant = (f64, Vec<f64>, [f64; 2], [f64; 2]);

impl Landings {
    /// The softest landing as a flight. None if there is no trim.
    pub fn manoeuvre(&self, height: f64, speed: f64, delay: f64) -> Option<Manoeuvre> {
        let landing = self.from(height, speed, delay, None)?;
        let trim = self.trim(height, speed)?;
        let course = self
            .helicopter()
            .frozen(&trim, delay, self.settings().runs_down);
        let controls = [trim.cz, trim.alpha];
        let mut rows: Vec<Instant> = (course.time.iter().zip(&course.states))
            .map(|(time, x)| (*time, x.clone(), controls, controls))
            .collect();
        let (mesh, z) = match &landing.finer {
            Some((mesh, z)) => (mesh.clone(), z),
            None => (even(self.settings().intervals), &landing.z),
        };
        if let Some((posed, program)) = self
            .program([height, speed, delay], mesh)
            .filter(|_| !z.is_empty())
        {
            for at in optimise::trajectory(posed, &program, z) {
                let x = self
                    .places()
                    .iter()
                    .map(|place| at.states[*place])
                    .collect();
                let commands = [at.controls[0], at.controls[1]];
                let mut rotor = commands;
                if let Some(pilot) = self.pilot() {
                    for ((own, axis), (first, command)) in rotor
                        .iter_mut()
                        .zip(&pilot.axes)
                        .zip(self.hands().into_iter().zip(commands))
                    {
                        let states = &at.states[first..first + axis.b.len()];
                        *own = axis.output(states, command);
                    }
                }
                rows.push((delay + at.time, x, commands, rotor));
            }
        }
        let model = &self.helicopter().part.model;
        let states = model.states.iter().enumerate().map(|(k, name)| {
            let about = self.helicopter().part.variables.get(name);
            let unit = about.and_then(|own| own.unit.clone()).unwrap_or_default();
            (
                name.clone(),
                unit,
                rows.iter().map(|own| own.1[k]).collect(),
            )
        });
        let starts = model
            .states
            .iter()
            .cloned()
            .zip(course.states[0].iter().copied());
        let inputs = INPUTS.map(str::to_owned).into_iter().zip(controls);
        let starts = self
            .helicopter()
            .set
            .iter()
            .cloned()
            .chain(starts)
            .chain(inputs);
        let text = self
            .helicopter()
            .part
            .file
            .as_ref()
            .map(|own| own.file.text.clone());
        Some(Manoeuvre {
            landing,
            time: rows.iter().map(|own| own.0).collect(),
            states: states.collect(),
            commands: [0, 1].map(|k| rows.iter().map(|own| own.2[k]).collect()),
            rotor: [0, 1].map(|k| rows.iter().map(|own| own.3[k]).collect()),
            helicopter: with_starts(&text.unwrap_or_default(), &starts.collect::<Vec<_>>()),
            pilot: self.pilot().map(|own| own.resting(controls)),
        })
    }
}
