//! Creates the report of a run.

use super::change::Change;
use super::stepper::Stepper;
use crate::algorithms::{Algorithm, Coupling};
use crate::report::{ConnectionReport, CouplingError, InstanceReport, Report, Steps, Transfer};
use crate::system::{Connection, System};

/// The connections of reals, with names and positions, and source and target of all connections.
pub(super) struct Wires {
    reals: Vec<Wire>,
    all: Vec<(usize, usize)>,
}

struct Wire {
    from: String,
    to: String,
    unit: String,
    /// Positions of the instances.
    source: usize,
    target: usize,
    /// Position among the target's real inputs.
    input: usize,
}

impl Wires {
    pub(super) fn of(system: &System) -> Self {
        let mut inputs = vec![0; system.instances.len()];
        let mut wires = Vec::new();
        for connection in &system.connections {
            if !system.is_real(connection) {
                continue;
            }
            let variable = system.variable(connection.from);
            let target = connection.to.instance;
            let unit = variable.unit.as_ref();
            wires.push(Wire {
                from: system.port_name(connection.from),
                to: system.port_name(connection.to),
                unit: unit.map_or_else(String::new, |u| u.name.clone()),
                source: connection.from.instance,
                target,
                input: inputs[target],
            });
            inputs[target] += 1;
        }
        let ends = |own: &Connection| (own.from.instance, own.to.instance);
        Self {
            reals: wires,
            all: system.connections.iter().map(ends).collect(),
        }
    }

    /// Whether what goes from one instance to another comes back to it.
    fn is_in_loop(&self, (source, target): (usize, usize)) -> bool {
        let (mut reached, mut waiting) = (vec![target], vec![target]);
        while let Some(own) = waiting.pop() {
            let next = self.all.iter().filter(|(from, _)| *from == own);
            for &(_, to) in next {
                if !reached.contains(&to) {
                    reached.push(to);
                    waiting.push(to);
                }
            }
        }
        reached.contains(&source)
    }

    /// The report of a run of this many steps of the clock and `duration` [s] of simulated time.
    pub(super) fn report(
        self,
        stepper: &Stepper,
        coupling: &Coupling,
        clock_steps: u64,
        duration: f64,
    ) -> Report {
        let wired = &stepper.exchange.wired;
        let steps = match stepper.steps.accepted {
            0 => Steps::default(),
            _ => stepper.steps,
        };
        let needs_rollback = coupling.algorithm == Algorithm::Strong || coupling.control.is_some();
        let irrevocable = (wired.iter())
            .filter(|w| needs_rollback && !w.abilities.rollback && w.inputs.are_fed());
        let scale = stepper.sampler.scale(clock_steps);
        let instances = wired.iter().map(|w| InstanceReport {
            name: w.name.clone(),
            calls: w.calls,
            seconds: scale * w.watch.seconds,
        });
        let instances: Vec<InstanceReport> = instances.collect();
        let in_instances: f64 = instances.iter().map(|i| i.seconds).sum();
        Report {
            steps,
            instances,
            connections: (self.reals.iter())
                .map(|wire| {
                    let mut report = wire.report(stepper, coupling, duration);
                    // What does not come back may grow, but no coupling diverges.
                    let is_in_loop = || self.is_in_loop((wire.source, wire.target));
                    report.divergence = report.divergence.filter(|_| is_in_loop());
                    report
                })
                .collect(),
            fixed: (wired.iter())
                .filter(|w| steps.ramps > 0 && !w.abilities.variable_steps)
                .map(|w| w.name.clone())
                .collect(),
            holding: (wired.iter())
                .filter(|w| stepper.has_input_profiles && w.inputs.are_fed())
                .filter(|w| !w.abilities.input_derivatives)
                .map(|w| w.name.clone())
                .collect(),
            irrevocable: irrevocable.map(|w| w.name.clone()).collect(),
            master_seconds: (stepper.sampler.elapsed() - in_instances).max(0.0),
            timed_steps: stepper.sampler.timed,
        }
    }
}

impl Wire {
    fn report(&self, stepper: &Stepper, coupling: &Coupling, duration: f64) -> ConnectionReport {
        let transfer = self.transfer(stepper, coupling);
        let h = match stepper.steps.accepted {
            0 => 0.0,
            accepted => duration / accepted as f64,
        };
        let target = &stepper.exchange.wired[self.target];
        let lag = match transfer {
            Transfer::Held => h / 2.0,
            Transfer::Ahead => -h / 2.0,
            Transfer::AtOnce => 0.0,
            // In each part of the step, the value at its end is held.
            Transfer::Extrapolated | Transfer::Interpolated if target.is_given_ends() => {
                -h / (2.0 * f64::from(target.parts))
            }
            Transfer::Extrapolated | Transfer::Interpolated => 0.0,
        };
        let source = &stepper.exchange.wired[self.source];
        let is_fed = |&p: &usize| p == target.inputs.positions[self.input];
        let change = source.outputs.fed_positions.iter().position(is_fed);
        let change = change.map_or_else(Change::default, |k| source.outputs.changes[k].1);
        // A value held through a step is wrong by half of its change in the step.
        let error = match stepper.is_plain {
            true if transfer == Transfer::AtOnce => CouplingError::default(),
            true => CouplingError {
                mean: 0.5 * h * change.sum,
                max: 0.5 * change.largest,
            },
            false => target.within.errors[self.input],
        };
        ConnectionReport {
            from: self.from.clone(),
            to: self.to.clone(),
            unit: self.unit.clone(),
            transfer,
            lag,
            error: (duration > 0.0).then(|| CouplingError {
                mean: error.mean / duration,
                max: error.max,
            }),
            divergence: change.divergence(),
        }
    }

    fn transfer(&self, stepper: &Stepper, coupling: &Coupling) -> Transfer {
        let wired = &stepper.exchange.wired;
        let place = |instance| stepper.order().iter().position(|&i| i == instance);
        if wired[self.target].at_once && coupling.algorithm == Algorithm::Jacobi {
            return Transfer::AtOnce;
        }
        let is_known = match coupling.algorithm {
            Algorithm::Jacobi => false,
            Algorithm::GaussSeidel => place(self.source) < place(self.target),
            Algorithm::Strong => wired[self.target].abilities.rollback,
        };
        let is_polynomial = coupling.algorithm == Algorithm::Strong && is_known
            || coupling.extrapolation.unwrap_or(0) > 0;
        match (is_known, is_polynomial) {
            (false, false) => Transfer::Held,
            (true, false) => Transfer::Ahead,
            (false, true) => Transfer::Extrapolated,
            (true, true) => Transfer::Interpolated,
        }
    }
}
