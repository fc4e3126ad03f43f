//! Pilot and vehicle as one system: the closed loop ([`Joint`], paper eq. 3), and the pilot alone with the recorded
//! error as input ([`open_loop`], the stick fit that the paper argues against).

use pilotage_expression::{Model, System};
use pilotage_models::quadcopter::N_STATES;
use pilotage_models::traced::start_values;
use pilotage_models::{Pilot, Quadcopter, traced};

/// The closed loop `x = [x_v; x_p]`, `ẋ = [f_v(x_v, h_p(x_p)); f_p(x_p, ŷ - h_v(x_v))]` (paper, eq. 3).
///
/// Input: the target ŷ \[m\]. Outputs: the vehicle's position \[m\], which is measured, and the stick, which is
/// bounded. Parameters: θ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    /// The vehicle.
    pub vehicle: Quadcopter,
    /// The pilot's structure.
    pub pilot: Pilot,
}

impl Joint {
    /// Number of states.
    pub fn n_states(&self) -> usize {
        N_STATES + self.pilot.order
    }

    /// The system.
    pub fn system(&self) -> System {
        let vehicle = pilotage_models::Model::quadcopter(&self.vehicle);
        let values = start_values(vehicle.variable_table());
        let built_in = traced(&vehicle).expect("the equations are expressions");
        let vehicle = built_in.with_values(values).expect("its own parameters");
        let wires = [
            ("pilot.stick", "vehicle.stick"),
            ("vehicle.z", "pilot.position"),
        ];
        Model::join(
            &[("vehicle", vehicle), ("pilot", linear_pilot(self.pilot))],
            &wires,
        )
        .and_then(|joint| joint.observed(&["vehicle.z", "pilot.stick"]))
        .expect("the names of the built-in models")
    }
}

/// The pilot alone, whose input is the recorded error `ŷ - y_v(t)` \[m\]. Measured output and bounded signal are the
/// stick.
///
/// This is the model of earlier work that the paper contrasts with (its Fig. 2): it may follow the stick well and still
/// never bring the vehicle to the target.
pub fn open_loop(pilot: Pilot) -> System {
    let origin = Model::trace([&[], &[], &[], &["zero"]], |point| {
        [vec![], vec![point.time * 0.0]]
    });
    let origin = origin.expect("a constant is an expression");
    let parts = [("pilot", linear_pilot(pilot)), ("origin", origin)];
    Model::join(&parts, &[("origin.zero", "pilot.position")])
        .and_then(|alone| alone.observed(&["pilot.stick", "pilot.stick"]))
        .expect("the names of the built-in models")
}

/// The pilot with θ as its only parameters.
fn linear_pilot(pilot: Pilot) -> Model {
    let model = pilotage_models::Model::pilot(&vec![0.0; pilot.n_parameters()], 1.0);
    traced(&model)
        .expect("the equations are expressions")
        .with_values([("stick_limit", 1.0)])
        .expect("its own parameter")
}
