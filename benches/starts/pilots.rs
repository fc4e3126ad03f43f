//! The humans of the study and their flights. The tests use them too.

use pilotage::flights::Trial;
use pilotage::models::Quadcopter;
use pilotage::synthetic::{Flight, Flights, Human, SyntheticError};

/// A human by name.
pub type Named = (&'static str, Human);

/// Gain [1/m], lead [s], delay [s], arm [rad/s], its damping, remnant, its correlation time [s].
const fn human(numbers: [f64; 7]) -> Human {
    let [gain, lead, delay, frequency, damping, remnant, remnant_time] = numbers;
    Human {
        gain,
        lead,
        delay,
        frequency,
        damping,
        remnant,
        remnant_time,
        lag: 0.0,
        stick_rate: f64::INFINITY,
    }
}

/// The ten humans of the study. Crossover between 0.35 and 0.9 rad/s, delays and arms as reported by McRuer and Jex
/// (IEEE Trans. HFE-8, 1967); remnant from almost none to a tenth of the first command.
pub const STUDY: [Named; 10] = [
    ("plain", human([0.030, 2.5, 0.15, 10.0, 0.7, 0.04, 0.5])),
    ("gentle", human([0.016, 3.2, 0.20, 8.0, 0.8, 0.04, 0.6])),
    ("eager", human([0.045, 2.2, 0.14, 12.0, 0.6, 0.05, 0.4])),
    ("late", human([0.022, 2.8, 0.32, 9.0, 0.7, 0.03, 0.5])),
    (
        "foresighted",
        human([0.024, 4.2, 0.18, 11.0, 0.9, 0.04, 0.7]),
    ),
    ("swinging", human([0.032, 1.7, 0.16, 10.0, 0.7, 0.03, 0.5])),
    ("noisy", human([0.028, 2.6, 0.18, 9.0, 0.6, 0.10, 0.3])),
    ("precise", human([0.034, 2.4, 0.12, 15.0, 0.8, 0.01, 0.5])),
    ("slow-armed", human([0.026, 2.7, 0.22, 5.0, 0.9, 0.05, 1.0])),
    ("wandering", human([0.020, 3.0, 0.25, 7.0, 0.5, 0.06, 1.5])),
];

/// Ten other humans, with which the starts were developed. The study does not use them.
pub const TUNING: [Named; 10] = [
    ("t1", human([0.027, 2.3, 0.17, 9.5, 0.75, 0.05, 0.4])),
    ("t2", human([0.018, 2.6, 0.24, 7.5, 0.6, 0.03, 0.8])),
    ("t3", human([0.040, 2.0, 0.13, 13.0, 0.7, 0.03, 0.6])),
    ("t4", human([0.021, 3.6, 0.28, 8.5, 0.8, 0.05, 0.5])),
    ("t5", human([0.036, 2.8, 0.16, 11.0, 0.5, 0.06, 0.3])),
    ("t6", human([0.025, 1.9, 0.20, 10.0, 0.9, 0.02, 0.5])),
    ("t7", human([0.032, 2.6, 0.15, 6.0, 0.8, 0.08, 0.6])),
    ("t8", human([0.023, 3.0, 0.12, 14.0, 0.7, 0.01, 0.4])),
    ("t9", human([0.015, 3.8, 0.22, 6.5, 0.7, 0.07, 1.2])),
    ("t10", human([0.038, 1.8, 0.18, 12.0, 0.6, 0.04, 0.9])),
];

/// Six flights of the default vehicle, three to 10 m and three to 20 m: 15 s at 20 Hz.
///
/// # Errors
/// If the loop of human and vehicle is unstable.
pub fn flown(human: &Human, seed: u64) -> Result<Vec<Flight>, SyntheticError> {
    let flights = Flights {
        seed,
        ..Flights::default()
    };
    flights.fly(human, &Quadcopter::default())
}

/// [`flown`] as trials for the fit.
///
/// # Errors
/// As [`flown`].
pub fn flights(human: &Human, seed: u64) -> Result<Vec<Trial>, SyntheticError> {
    let trial = |flight: &Flight| {
        let csv = flight.series.to_csv();
        Trial::parse(csv.as_bytes(), &flight.name).expect("a flight is a trial")
    };
    Ok(flown(human, seed)?.iter().map(trial).collect())
}
