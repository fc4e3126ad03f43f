//! Linearization of a coupled system about its current state.

use super::algorithms::Coupling;
use super::clock::Clock;
use super::component::{Component, Linear};
use super::master::{Checkpoints, Look, MasterError, Run, run_and_look};
use super::recorder::Recorder;
use super::system::System;
use nalgebra::Complex;
use pilotage_linear::{AlgebraicLoop, Margins, Response, Sampled, StateSpace, Wire};
use pilotage_text::suggestion::{did_you_mean, suggestion};
use thiserror::Error;

/// Number of phase crossings of a loop with delays that are kept.
const PHASE_CROSSINGS: usize = 5;

/// Why a coupled system cannot be linearized.
#[derive(Debug, Error)]
pub enum LinearizeError {
    /// There is no connection at which the loop can be cut.
    #[error("there is no connection `{from}={to}`{}", did_you_mean(suggestion.as_deref()))]
    NoConnection {
        /// Output.
        from: String,
        /// Input.
        to: String,
        /// A similar connection.
        suggestion: Option<String>,
    },
    /// The connection carries no changes.
    #[error(
        "the connection `{from}={to}` changes at events alone, so that there is no frequency response; cut the loop at \
         a connection of continuous reals"
    )]
    Discrete {
        /// Output.
        from: String,
        /// Input.
        to: String,
    },
    /// The connection is not in a loop.
    #[error("the connection `{from}={to}` is in no loop: what goes in there does not come back")]
    NoLoop {
        /// Output.
        from: String,
        /// Input.
        to: String,
    },
    /// An algebraic loop without a solution.
    #[error(transparent)]
    AlgebraicLoop(#[from] AlgebraicLoop),
}

/// The components' linear systems and the wires between them.
#[derive(Debug, Clone)]
pub struct Linearization {
    /// The components side by side; names are `instance.variable`.
    pub parts: StateSpace,
    /// Wires between them.
    pub wires: Vec<Wire>,
    /// Connections that carry no changes: not of reals, of discrete reals, or of variables that a component treats as
    /// constant.
    pub constant: Vec<String>,
    /// For parts without known derivatives: how they were linearized.
    pub notes: Vec<String>,
    /// The same with the delays of the parts, if there are any that `parts` approximate.
    pub delayed: Option<Delayed>,
}

/// Linear systems with delays and the wires between them.
#[derive(Debug, Clone)]
pub struct Delayed {
    /// The components side by side, with inputs and outputs for delays.
    pub parts: StateSpace,
    /// Wires between them, in the order of those of the approximation.
    pub wires: Vec<Wire>,
    /// Output, input and time \[s\] of each delay.
    pub delays: Vec<(usize, usize, f64)>,
}

/// Frequency response of a loop at the cut.
#[derive(Debug, Clone)]
pub struct Loop {
    /// `L(jω)`; the closed loop's characteristic equation is `1 + L = 0`.
    pub response: Response,
    /// Its margins.
    pub margins: Margins,
}

/// Runs a system to the clock's stop and linearizes it there. There is no linearization if the run ends earlier or a
/// component cannot be linearized; [`Run::ending`] gives the reason. The components are not terminated, as in
/// [`run_open`](super::run_open).
///
/// # Errors
/// As [`run`](super::run).
pub fn linearize(
    system: System,
    clock: &Clock,
    tolerance: Option<f64>,
    coupling: impl Into<Coupling>,
    recorder: &mut dyn Recorder,
) -> Result<(Run, Option<Linearization>), MasterError> {
    let names: Vec<String> = system.instance_names().map(str::to_owned).collect();
    // Connections as names of output and input; connections of continuous reals with their factor.
    let connections: Vec<(String, String, Option<f64>)> = (system.connections.iter())
        .map(|c| {
            let is_continuous = system.is_real(c) && !system.variable(c.from).is_discrete;
            let factor = is_continuous.then_some(c.conversion.factor);
            (system.port_name(c.from), system.port_name(c.to), factor)
        })
        .collect();
    let mut parts: Vec<StateSpace> = Vec::new();
    let mut exact: Vec<StateSpace> = Vec::new();
    let mut delays: Vec<(usize, usize, f64)> = Vec::new();
    let mut notes = Vec::new();
    let mut look = |component: &mut dyn Component| {
        let Linear {
            system,
            note,
            delayed,
        } = component.linearize(clock.step())?;
        system.check_finite()?;
        let instance = &names[parts.len()];
        notes.extend(note.map(|note| format!("`{instance}` {note}")));
        let count = |of: fn(&StateSpace) -> usize| -> usize { exact.iter().map(of).sum() };
        let outputs = count(|own| own.outputs.len()) + system.outputs.len();
        let inputs = count(|own| own.inputs.len()) + system.inputs.len();
        let times = delayed.iter().flat_map(|own| own.times.iter().copied());
        let ends = times.enumerate();
        delays.extend(ends.map(|(k, time)| (outputs + k, inputs + k, time)));
        if let Some(own) = &delayed {
            own.system.check_finite()?;
            notes.push(format!(
                "`{instance}` has delays without an order: loops have them as e^(-jωτ), poles and matrices as Padé's approximation"
            ));
        }
        let own = delayed.map_or_else(|| system.clone(), |own| own.system);
        exact.push(prefixed(own, instance));
        parts.push(prefixed(system, instance));
        Ok(())
    };
    let look: Option<Look> = Some(&mut look);
    let mut checkpoints = Checkpoints::default();
    let coupling = coupling.into();
    let run = run_and_look(
        system,
        clock,
        tolerance,
        coupling,
        recorder,
        &mut checkpoints,
        look,
    )?;
    let is_complete = parts.len() == names.len();
    let linearization = is_complete.then(|| Linearization {
        notes,
        delayed: (!delays.is_empty()).then(|| {
            let Linearization { parts, wires, .. } = wired(&exact, &connections);
            Delayed {
                parts,
                wires,
                delays,
            }
        }),
        ..wired(&parts, &connections)
    });
    Ok((run, linearization))
}

/// Prefixes a part's names with its instance's name.
fn prefixed(mut part: StateSpace, instance: &str) -> StateSpace {
    for names in [&mut part.states, &mut part.inputs, &mut part.outputs] {
        for name in names {
            *name = format!("{instance}.{name}");
        }
    }
    part
}

fn wired(parts: &[StateSpace], connections: &[(String, String, Option<f64>)]) -> Linearization {
    let parts = StateSpace::side_by_side(parts);
    let (mut wires, mut constant) = (Vec::new(), Vec::new());
    for (from, to, factor) in connections {
        let output = parts.outputs.iter().position(|name| name == from);
        let input = parts.inputs.iter().position(|name| name == to);
        match (output, input, factor) {
            (Some(output), Some(input), &Some(factor)) => wires.push(Wire {
                output,
                input,
                factor,
            }),
            // An input fed by a table is an external input.
            (None, Some(_), Some(_)) => {}
            _ => constant.push(format!("{from}={to}")),
        }
    }
    Linearization {
        parts,
        wires,
        constant,
        notes: Vec::new(),
        delayed: None,
    }
}

impl Linearization {
    /// The coupled system. Its inputs are the unconnected ones, its outputs all outputs.
    ///
    /// # Errors
    /// If there is an algebraic loop without a solution.
    pub fn coupled(&self) -> Result<StateSpace, AlgebraicLoop> {
        let is_fed = |input: &usize| self.wires.iter().any(|wire| wire.input == *input);
        let free: Vec<usize> = (0..self.parts.inputs.len())
            .filter(|input| !is_fed(input))
            .collect();
        Ok(self.parts.closed(&self.wires)?.from_inputs(&free))
    }

    /// The index of a connection's wire.
    ///
    /// # Errors
    /// If there is no such connection, or if it carries no continuous real.
    pub fn wire(&self, from: &str, to: &str) -> Result<usize, LinearizeError> {
        let name = |wire: &Wire| {
            let (output, input) = (
                &self.parts.outputs[wire.output],
                &self.parts.inputs[wire.input],
            );
            format!("{output}={input}")
        };
        let names: Vec<String> = self.wires.iter().map(name).collect();
        let wanted = format!("{from}={to}");
        if self.constant.contains(&wanted) {
            let (from, to) = (from.to_owned(), to.to_owned());
            return Err(LinearizeError::Discrete { from, to });
        }
        (names.iter().position(|name| *name == wanted)).ok_or_else(|| {
            LinearizeError::NoConnection {
                from: from.to_owned(),
                to: to.to_owned(),
                suggestion: suggestion(&wanted, names.iter().map(String::as_str))
                    .map(str::to_owned),
            }
        })
    }

    /// The loop cut at a wire, in continuous time, with the delays themselves.
    ///
    /// # Errors
    /// If there is no loop, or an algebraic loop has no solution.
    ///
    /// # Panics
    /// If there is no such wire.
    pub fn loop_at(&self, wire: usize) -> Result<Loop, LinearizeError> {
        let open = self.parts.open_loop(&self.wires, wire)?;
        let (response, margins) = match &self.delayed {
            None => open.margins(),
            Some(own) => {
                let others = own.wires.iter().enumerate().filter(|(w, _)| *w != wire);
                let others: Vec<Wire> = others.map(|(_, wire)| *wire).collect();
                let closed = own.parts.closed(&others)?;
                let Wire {
                    output,
                    input,
                    factor,
                } = own.wires[wire];
                let (response, margins) = open.margins_of(|omega| {
                    let value = closed.transfer_with_delays((output, input), &own.delays, omega);
                    value * -factor
                });
                (response, margins.limited(PHASE_CROSSINGS))
            }
        };
        self.looped(wire, response, margins)
    }

    /// The same loop in a co-simulation with Jacobi's scheme and a step of `step` \[s\].
    ///
    /// # Errors
    /// As [`loop_at`](Self::loop_at).
    ///
    /// # Panics
    /// If there is no such wire.
    pub fn loop_in_steps(&self, wire: usize, step: f64) -> Result<Loop, LinearizeError> {
        let (response, margins) = Sampled::new(&self.parts, step).margins(&self.wires, wire)?;
        self.looped(wire, response, margins)
    }

    /// Poles of the coupled system in a co-simulation with Jacobi's scheme and a step of `step` \[s\], as equivalent
    /// continuous-time poles [1/s].
    ///
    /// # Errors
    /// Not because of algebraic loops: held inputs close none.
    pub fn poles_in_steps(&self, step: f64) -> Result<Vec<Complex<f64>>, AlgebraicLoop> {
        Sampled::new(&self.parts, step).poles(&self.wires)
    }

    fn looped(
        &self,
        wire: usize,
        response: Response,
        margins: Margins,
    ) -> Result<Loop, LinearizeError> {
        let Wire { output, input, .. } = self.wires[wire];
        match response.value.iter().any(|value| value.norm() > 0.0) {
            true => Ok(Loop { response, margins }),
            false => Err(LinearizeError::NoLoop {
                from: self.parts.outputs[output].clone(),
                to: self.parts.inputs[input].clone(),
            }),
        }
    }
}
