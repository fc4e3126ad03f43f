//! Which attitude gains can a pilot live with? Sweeps the pitch-rate gain of the default vehicle.
//!
//!     cargo run --release --example flyable_gains

use pilotage::models::Quadcopter;
use pilotage::vehicle::PitchLoop;

fn main() {
    println!("rate_gain [µs·s/rad]  slowest mode: frequency [rad/s], damping");
    for rate_gain in [1.02, 1.5, 2.0, 4.0, 8.0, 10.76, 16.0] {
        let vehicle = Quadcopter {
            rate_gain,
            ..Quadcopter::default()
        };
        let pitch = PitchLoop::of(&vehicle);
        let slowest = pitch.modes[0];
        let verdict = if pitch.is_stable() { "" } else { "  unstable" };
        println!(
            "{rate_gain:>20}  {:>24.2}, {:>7.2}{verdict}",
            slowest.frequency, slowest.damping
        );
    }
}
