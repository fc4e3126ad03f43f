//! Stiff model files, in steps of co-simulation, compared with `solve_ivp` of SciPy 1.17.1 (`method='Radau'`, `rtol=1e-10` or less).
//! An explicit method needs more than the million steps that one step of co-simulation may take.

use pilotage_models::TextModel;
use pilotage_sdk::Simulation;

fn model(states: &str) -> TextModel {
    let text = format!(
        "[model]\nname = \"m\"\n[parameters]\nw = {{ start = 6283.18530718, unit = \"rad/s\" }}\n[states]\n{states}"
    );
    TextModel::parse(&text, "m.toml").expect("a model")
}

fn states(simulation: &Simulation<TextModel>) -> &[f64] {
    &simulation.snapshot().states
}

/// Simulates with steps of both numbers and compares the states at the end.
#[track_caller]
fn assert_ends(of: &TextModel, stop: f64, expected: &[f64]) {
    for steps in [1, 100] {
        let mut own = Simulation::new(of.clone());
        for _ in 0..steps {
            own.step(stop / f64::from(steps)).expect("it is possible");
        }
        assert!(own.snapshot().is_stiff);
        for (x, expected) in states(&own).iter().zip(expected) {
            let error = (x - expected).abs();
            assert!(
                error <= 1e-6 * expected.abs() + 1e-14,
                "{steps}: {x} {expected}"
            );
        }
    }
}

#[test]
fn van_der_pol_relaxes_within_a_step() {
    let of = model("x = { start = 2, der = \"y\" }\ny = { der = \"1e6 * ((1 - x^2) * y) - x\" }\n");
    assert_ends(&of, 2e6, &[1.70554622, -8.93476363e-7]);
}

#[test]
fn robertson_reacts_for_days() {
    let of = model(
        "a = { start = 1, der = \"-0.04 * a + 1e4 * b * c\" }\nb = { der = \"0.04 * a - 1e4 * b * c - 3e7 * b^2\" }\n\
         c = { der = \"3e7 * b^2\" }\n",
    );
    assert_ends(&of, 4e5, &[4.93827452e-3, 1.98499409e-8, 9.95061706e-1]);
}

#[test]
fn a_chain_of_reactions_has_rates_from_slow_to_fast() {
    let of = model(
        "a = { start = 1, der = \"-1e8 * a\" }\nb = { der = \"1e8 * a - 1e-2 * b\" }\nc = { der = \"1e-2 * b - 1e6 * c^2\" }\n\
         d = { der = \"1e6 * c^2 - d\" }\ne = { der = \"d - 1e4 * e\" }\nf = { der = \"1e4 * e\" }\n",
    );
    let expected = [
        0.0,
        0.6065306597732891,
        7.788257827091006e-5,
        0.0061269636781199075,
        6.126969804894034e-7,
        0.38726388127334155,
    ];
    assert_ends(&of, 50.0, &expected);
}

/// A source of 1 kHz behind a nanosecond, with a diode.
#[test]
fn a_circuit_has_a_time_constant_of_a_nanosecond() {
    let of = model(
        "v = { der = \"((5 + sin(w * time) - v) - (v - w1) / 1000 - 1e-12 * (exp(v / 0.5) - 1)) / 1e-9\" }\n\
         w1 = { der = \"(v - w1) / 1000 / 1e-6\" }\n",
    );
    assert_ends(&of, 0.01, &[4.999838564317537, 4.844701959174879]);
}

/// Whether the equations are stiff is a part of the state, so that a step repeated from it has the same bits.
#[test]
fn stiff_steps_are_repeated_to_the_bit() {
    let of = model("x = { start = 2, der = \"y\" }\ny = { der = \"1e6 * ((1 - x^2) * y) - x\" }\n");
    let mut own = Simulation::new(of.clone());
    own.step(1e3).expect("a step");
    let saved = own.snapshot().clone();
    let mut ends = Vec::new();
    for _ in 0..2 {
        own.restore(&saved);
        own.step(1e3).expect("a step");
        ends.push(own.snapshot().clone());
    }
    let mut other = Simulation::new(of);
    other.restore(&saved);
    other.step(1e3).expect("a step");
    assert_eq!(ends[0], ends[1]);
    assert_eq!(&ends[0], other.snapshot());
}

/// A relay in a stiff circuit: it switches on at 1 s, between steps, and nothing else changes.
#[test]
fn conditions_on_time_are_met_in_stiff_models() {
    let of = model(
        "v = { der = \"1e7 * (if(time > 1, 2, 0) + u - v)\" }\nu = { start = 1, der = \"-u^2\" }\n",
    );
    for h in [0.3, 2.5] {
        let mut own = Simulation::new(of.clone());
        while own.snapshot().time < 2.4 {
            own.step(h).expect("a step");
        }
        let u = 1.0 / (1.0 + own.snapshot().time);
        assert!((states(&own)[1] - u).abs() < 1e-8, "{h}");
        assert!((states(&own)[0] - (2.0 + u)).abs() < 1e-6, "{h}");
    }
}

/// Heat in a rod of many cells, in steps that are short for it: matrices of that size would cost more than explicit steps do.
#[test]
fn many_states_are_stepped_explicitly_while_that_is_less_work() {
    const CELLS: usize = 100;
    let mut text = String::new();
    for k in 0..CELLS {
        let [left, right] = [k.checked_sub(1), Some(k + 1).filter(|k| *k < CELLS)]
            .map(|own| own.map_or("0".to_owned(), |own| format!("t{own}")));
        text += &format!(
            "t{k} = {{ start = {}, der = \"100 * ({left} - 2 * t{k} + {right}) - 1e-9 * t{k}^2\" }}\n",
            (std::f64::consts::PI * (k + 1) as f64 / (CELLS + 1) as f64).sin()
        );
    }
    let mut own = Simulation::new(model(&text));
    own.step(1.0).expect("a step");
    assert!(!own.snapshot().is_stiff);
    // A sine decays by an eigenvalue of the second difference.
    let rate = 400.0
        * (std::f64::consts::PI / (2.0 * (CELLS + 1) as f64))
            .sin()
            .powi(2);
    let start = (std::f64::consts::PI * 50.0 / 101.0).sin();
    assert!((states(&own)[49] - start * (-rate).exp()).abs() < 1e-7);
    own.step(1000.0).expect("a step");
    assert!(own.snapshot().is_stiff);
}
