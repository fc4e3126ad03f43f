//! The vehicle alone, simulated.

use pilotage_models::{Quadcopter, quadcopter::N_STATES};

/// Maximum integration step \[s\]: small compared with the vehicle's attitude loop.
pub const MAX_STEP: f64 = 2e-3;

/// Distance that a vehicle covers from hover in `duration` seconds with the stick at `limit` \[m\].
pub fn at_full_stick(vehicle: &Quadcopter, limit: f64, duration: f64) -> f64 {
    let mut x = Quadcopter::hover(0.0);
    let steps = (duration / MAX_STEP).ceil().max(1.0);
    for _ in 0..steps as usize {
        fly(vehicle, &mut x, limit, limit, duration / steps);
    }
    vehicle.output(&x).abs()
}

/// One step of the vehicle by the classical Runge–Kutta method, with the stick going from `before` to `after`.
pub fn fly(vehicle: &Quadcopter, x_v: &mut [f64], before: f64, after: f64, h: f64) {
    let derivative = |x: &[f64], part: f64| {
        let mut dx = [0.0; N_STATES];
        vehicle.derivative(x, before + part * (after - before), &mut dx);
        dx
    };
    let along = |dx: &[f64; N_STATES], h: f64| -> [f64; N_STATES] {
        std::array::from_fn(|i| x_v[i] + h * dx[i])
    };
    let k1 = derivative(x_v, 0.0);
    let k2 = derivative(&along(&k1, h / 2.0), 0.5);
    let k3 = derivative(&along(&k2, h / 2.0), 0.5);
    let k4 = derivative(&along(&k3, h), 1.0);
    for i in 0..N_STATES {
        x_v[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}
