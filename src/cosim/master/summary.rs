//! What a run is reported to have done.

use super::stepper::Stepper;
use crate::cosim::algorithms::{Algorithm, Coupling};
use crate::cosim::report::{ConnectionReport, CouplingError, Report, SlaveReport, Steps, Transfer};
use crate::cosim::slave::Kind;
use crate::cosim::system::System;
use std::time::Duration;

/// The connections of reals, by name and by position.
pub(super) struct Wires(Vec<Wire>);

struct Wire {
    from: String,
    to: String,
    unit: String,
    /// Positions of the slaves.
    source: usize,
    target: usize,
    /// Which of the target's real inputs.
    input: usize,
}

impl Wires {
    pub(super) fn of(system: &System) -> Self {
        let mut inputs = vec![0; system.instances.len()];
        let mut wires = Vec::new();
        for connection in &system.connections {
            let variable = system.variable(connection.from);
            if variable.kind != Kind::Real {
                continue;
            }
            let target = connection.to.slave;
            let unit = variable.unit.as_ref();
            wires.push(Wire {
                from: system.port_name(connection.from),
                to: system.port_name(connection.to),
                unit: unit.map_or_else(String::new, |u| u.name.clone()),
                source: connection.from.slave,
                target,
                input: inputs[target],
            });
            inputs[target] += 1;
        }
        Self(wires)
    }

    /// The report of a run that took `duration` [s].
    pub(super) fn report(self, stepper: &Stepper, coupling: &Coupling, duration: f64) -> Report {
        let wired = &stepper.exchange.wired;
        let steps = match stepper.steps.accepted {
            0 => Steps::default(),
            _ => stepper.steps,
        };
        let needs_rollback = coupling.algorithm == Algorithm::Strong || coupling.control.is_some();
        let irrevocable = (wired.iter())
            .filter(|w| needs_rollback && !w.abilities.rollback && !w.inputs.is_empty());
        let slaves = wired.iter().map(|w| SlaveReport {
            name: w.name.clone(),
            calls: w.calls,
            seconds: w.time.map(|time| time.as_secs_f64()),
        });
        let in_slaves: Duration = wired.iter().filter_map(|w| w.time).sum();
        let elapsed = stepper.started.map(|started| started.elapsed());
        Report {
            steps,
            slaves: slaves.collect(),
            connections: (self.0.iter())
                .map(|wire| wire.report(stepper, coupling, duration))
                .collect(),
            irrevocable: irrevocable.map(|w| w.name.clone()).collect(),
            master_seconds: elapsed.map(|time| time.saturating_sub(in_slaves).as_secs_f64()),
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
            // The value at the end of each part of the step is held in it.
            Transfer::Extrapolated | Transfer::Interpolated if target.is_given_ends() => {
                -h / (2.0 * f64::from(target.parts))
            }
            Transfer::Extrapolated | Transfer::Interpolated => 0.0,
        };
        let error = stepper.errors[self.target][self.input];
        ConnectionReport {
            from: self.from.clone(),
            to: self.to.clone(),
            unit: self.unit.clone(),
            transfer,
            lag,
            error: (coupling.measure && duration > 0.0).then(|| CouplingError {
                mean: error.mean / duration,
                max: error.max,
            }),
        }
    }

    fn transfer(&self, stepper: &Stepper, coupling: &Coupling) -> Transfer {
        let wired = &stepper.exchange.wired;
        let place = |slave| stepper.order().iter().position(|&i| i == slave);
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
