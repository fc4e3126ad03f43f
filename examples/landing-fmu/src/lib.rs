//! A vehicle with events as an FMU: the quadcopter of `examples/vehicle-fmu` with the ground, on which it bounces and
//! comes to rest. `pilotage pack examples/landing-fmu` makes `lander.fmu`.

use pilotage_sdk::{At, Equations, Scalar, Table};

/// The vehicle. Its parameters are in the table.
#[derive(Default)]
struct Lander;

impl Equations for Lander {
    fn table(&self) -> Table {
        Table::new(
            "lander",
            "A quadcopter in a vertical plane, with the ground.",
        )
        .input("left", "N", "Thrust of the left rotors")
        .input("right", "N", "Thrust of the right rotors")
        .parameter("mass", "kg", 1.2, "Mass")
        .parameter("inertia", "kg.m2", 0.0123, "Moment of inertia")
        .parameter("arm", "m", 0.16, "Distance from the centre to the rotors")
        .parameter("gravity", "m/s2", 9.80665, "Gravitational acceleration")
        .parameter(
            "restitution",
            "1",
            0.5,
            "Part of the speed that a bounce leaves",
        )
        .parameter(
            "landing_speed",
            "m/s",
            0.2,
            "Speed below which it stays on the ground",
        )
        .output_state("x", "m", 0.0, "Position to the right")
        .output_state("height", "m", 1.0, "Height above the ground")
        .output_state("pitch", "rad", 0.0, "Pitch angle, left up is positive")
        .state("vx", "m/s", 0.0, "Velocity to the right")
        .state("vz", "m/s", 0.0, "Velocity upwards")
        .state("rate", "rad/s", 0.0, "Pitch rate")
        .mode("landed", false, "Whether it lies on the ground")
        .output("power", "W", "Mechanical power of the thrust")
        .indicator("gap", "m", "Distance to the ground, while in the air")
        .indicator("lift", "N", "Thrust beyond the weight, while on the ground")
    }

    fn derivative<T: Scalar>(&self, At { x, u, p, .. }: At<T>, dx: &mut [T]) {
        // `landed` follows the six states, as 1 or 0.
        let (thrust, airborne) = (u[0] + u[1], -x[6] + 1.0);
        dx[..3].copy_from_slice(&x[3..6]);
        dx[3] = thrust * x[2].sin() / p[0] * airborne;
        dx[4] = (thrust * x[2].cos() / p[0] - p[3]) * airborne;
        dx[5] = (u[0] - u[1]) * p[2] / p[1] * airborne;
    }

    fn output<T: Scalar>(&self, At { x, u, .. }: At<T>, y: &mut [T]) {
        y[0] = (u[0] + u[1]) * (x[3] * x[2].sin() + x[4] * x[2].cos());
    }

    fn indicators<T: Scalar>(&self, At { x, u, p, .. }: At<T>, z: &mut [T]) {
        z[0] = x[1] + x[6];
        z[1] = (u[0] + u[1] - p[0] * p[3]) * x[6] + x[6] - 1.0;
    }

    fn event(&self, At { x, u, p, .. }: At<f64>, after: &mut [f64]) {
        let landed = x[6] > 0.5;
        if landed && u[0] + u[1] > p[0] * p[3] {
            after[6] = 0.0;
        } else if !landed && x[1] <= 0.0 && x[4] < 0.0 {
            let stays = -x[4] < p[5];
            let bounced = [x[0], 0.0, 0.0, 0.0, -p[4] * x[4], 0.0, 0.0];
            let resting = [x[0], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
            after.copy_from_slice(if stays { &resting } else { &bounced });
        }
    }
}

pilotage_sdk::export!(Lander);
