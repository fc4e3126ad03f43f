//! A user-defined vehicle as an FMU: a quadcopter in a vertical plane.
//! `pilotage pack examples/vehicle-fmu` makes `drone.fmu`.

use pilotage_sdk::{At, Equations, Scalar, Table};

/// The vehicle. Its parameters are in the table.
#[derive(Default)]
struct Drone;

impl Equations for Drone {
    fn table(&self) -> Table {
        Table::new("drone", "A quadcopter in a vertical plane.")
            .input("left", "N", "Thrust of the left rotors")
            .input("right", "N", "Thrust of the right rotors")
            .parameter("mass", "kg", 1.2, "Mass")
            .parameter("inertia", "kg.m2", 0.0123, "Moment of inertia")
            .parameter("arm", "m", 0.16, "From the centre to the rotors")
            .parameter("gravity", "m/s2", 9.80665, "Acceleration of gravity")
            .output_state("x", "m", 0.0, "Position to the right")
            .output_state("height", "m", 1.0, "Height above the ground")
            .output_state("pitch", "rad", 0.0, "Pitch angle, left up is positive")
            .state("vx", "m/s", 0.0, "Velocity to the right")
            .state("vz", "m/s", 0.0, "Velocity upwards")
            .state("rate", "rad/s", 0.0, "Pitch rate")
    }

    fn derivative<T: Scalar>(&self, At { x, u, p, .. }: At<T>, dx: &mut [T]) {
        dx[..3].copy_from_slice(&x[3..]);
        dx[3] = (u[0] + u[1]) * x[2].sin() / p[0];
        dx[4] = (u[0] + u[1]) * x[2].cos() / p[0] - p[3];
        dx[5] = (u[0] - u[1]) * p[2] / p[1];
    }
}

pilotage_sdk::export!(Drone);
