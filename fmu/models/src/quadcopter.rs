//! The vehicle: pitch axis of a quadcopter with its attitude controller (paper, section
//! "Quadcopter Vehicle Model"; the signs and coefficients that the paper prints inconsistently or
//! does not print are settled in `docs/method.md`).
//!
//! States `x_v = [z, φ, v, q, ω_f, ω_b]`, input the stick `u ∈ [-1, 1]`, output the position `z`:
//!
//! ```text
//! ż   = v
//! φ̇   = q
//! v̇   = -(2/m) (T_f + T_b) sin φ          φ is nose-up positive
//! q̇   = (√2 ℓ / I_yy) (T_f - T_b)
//! ω̇_f = -a ω_f + b e                      ω: rotor-speed perturbation from hover
//! ω̇_b = -a ω_b - b e                      e: throttle perturbation, µs of pulse width
//! e   = k_φ (φ_max u - φ) - k_q q
//! T(ω) = (m g / 4) (1 + ω/ω_0)²           per motor
//! ```

use crate::Scalar;
use std::ops::Mul;

/// Number of states of the vehicle.
pub const N_STATES: usize = 6;

/// Number of coefficients of the vehicle.
pub const N_COEFFICIENTS: usize = 10;

/// Names of the states in their order, as the FMU and the tables show them.
pub const STATE_NAMES: [&str; N_STATES] = ["z", "phi", "v", "q", "omega_f", "omega_b"];

/// Coefficients of the quadcopter's pitch axis.
///
/// [`Quadcopter::default`] is the project's own vehicle: the paper does not publish its
/// coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quadcopter {
    /// Mass `m` \[kg\].
    pub mass: f64,
    /// Arm length `ℓ` from the centre to a motor \[m\].
    pub arm_length: f64,
    /// Pitch moment of inertia `I_yy` [kg·m²].
    pub inertia: f64,
    /// Gravitational acceleration `g` [m/s²].
    pub gravity: f64,
    /// Rotor speed at hover `ω_0` [krad/s].
    pub hover_speed: f64,
    /// Propeller lag `a` [1/s] (paper: 14.48).
    pub propeller_lag: f64,
    /// Propeller gain `b` [krad/s² per µs] (paper: 0.0222).
    pub propeller_gain: f64,
    /// Attitude gain `k_φ` [µs/rad].
    pub attitude_gain: f64,
    /// Pitch-rate gain `k_q` [µs·s/rad].
    pub rate_gain: f64,
    /// Pitch angle commanded by full stick `φ_max` \[rad\] (paper: π/4).
    pub max_pitch: f64,
}

impl Default for Quadcopter {
    fn default() -> Self {
        Self {
            mass: 1.2,
            arm_length: 0.225,
            inertia: 0.0123,
            gravity: 9.80665,
            hover_speed: 0.9214,
            propeller_lag: 14.48,
            propeller_gain: 0.0222,
            attitude_gain: 22.96,
            rate_gain: 10.76,
            max_pitch: std::f64::consts::FRAC_PI_4,
        }
    }
}

impl Quadcopter {
    /// Writes `f_v(x, u)` into `dx` (both of length [`N_STATES`]); `u` is the stick [-1, 1].
    #[inline(always)]
    pub fn derivative<T: Scalar>(&self, x: &[T], u: T, dx: &mut [T]) {
        derivative(self.coefficients(), x, u, dx);
    }

    /// Thrust of one motor `T(ω)` \[N\] at the rotor-speed perturbation `omega` [krad/s].
    pub fn thrust(&self, omega: f64) -> f64 {
        thrust(
            1.0 / self.hover_speed,
            self.mass * self.gravity / 4.0,
            omega,
        )
    }

    /// The coefficients in the order of the fields.
    #[inline(always)]
    fn coefficients(&self) -> [f64; N_COEFFICIENTS] {
        [
            self.mass,
            self.arm_length,
            self.inertia,
            self.gravity,
            self.hover_speed,
            self.propeller_lag,
            self.propeller_gain,
            self.attitude_gain,
            self.rate_gain,
            self.max_pitch,
        ]
    }

    /// The controlled output `y_v = h_v(x, u)`: the position `z` \[m\].
    #[inline(always)]
    pub fn output<T: Scalar>(&self, x: &[T]) -> T {
        x[0]
    }

    /// The states at hover at position `z` \[m\]: the trim of the vehicle.
    pub fn hover(z: f64) -> [f64; N_STATES] {
        [z, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    /// Gain `β` from throttle to pitch acceleration rate at hover [rad/s³ per µs]: the pitch loop's
    /// characteristic polynomial is `s³ + a s² + β k_q s + β k_φ` (docs/method.md).
    pub fn pitch_effectiveness(&self) -> f64 {
        std::f64::consts::SQRT_2 * self.arm_length / self.inertia
            * (self.mass * self.gravity / self.hover_speed)
            * self.propeller_gain
    }

    /// Coefficients `[c0, c1, c2]` of the pitch loop's monic characteristic polynomial
    /// `s³ + c2 s² + c1 s + c0`.
    pub fn pitch_polynomial(&self) -> [f64; 3] {
        let beta = self.pitch_effectiveness();
        [
            beta * self.attitude_gain,
            beta * self.rate_gain,
            self.propeller_lag,
        ]
    }
}

/// Writes `f_v(x, u)` into `dx`, with the coefficients in the order of the fields of [`Quadcopter`]: numbers,
/// or dual numbers where derivatives with respect to them are wanted.
#[inline(always)]
pub fn derivative<T, C>(coefficients: [C; N_COEFFICIENTS], x: &[T], u: T, dx: &mut [T])
where
    T: Scalar + Mul<C, Output = T>,
    C: Scalar,
{
    let [
        mass,
        arm_length,
        inertia,
        gravity,
        hover_speed,
        propeller_lag,
        propeller_gain,
        attitude_gain,
        rate_gain,
        max_pitch,
    ] = coefficients;
    let times = |x: T, c: C| <T as Mul<C>>::mul(x, c);
    let (slowness, weight) = (hover_speed.recip(), mass * gravity / C::from(4.0));
    let (phi, v, q, omega_f, omega_b) = (x[1], x[2], x[3], x[4], x[5]);
    let (front, back) = (
        thrust(slowness, weight, omega_f),
        thrust(slowness, weight, omega_b),
    );
    let throttle = times(times(u, max_pitch) - phi, attitude_gain) - times(q, rate_gain);
    let torque_gain = C::from(std::f64::consts::SQRT_2) * arm_length / inertia;
    dx[0] = v;
    dx[1] = q;
    dx[2] = times((front + back) * phi.sin(), C::from(-2.0) / mass);
    dx[3] = times(front - back, torque_gain);
    dx[4] = times(throttle, propeller_gain) - times(omega_f, propeller_lag);
    dx[5] = times(-throttle, propeller_gain) - times(omega_b, propeller_lag);
}

/// `T(ω)` of one motor; `slowness` is `1/ω_0` and `weight` `m g / 4`.
#[inline(always)]
fn thrust<T, C>(slowness: C, weight: C, omega: T) -> T
where
    T: Scalar + Mul<C, Output = T>,
    C: Scalar,
{
    let relative = <T as Mul<C>>::mul(omega, slowness) + 1.0;
    <T as Mul<C>>::mul(relative * relative, weight)
}
