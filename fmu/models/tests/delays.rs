//! Delays without an order in model files: exact in steps of co-simulation, whatever the step. Solutions are known, or computed
//! with steps of a ten-thousandth of the delay.

use pilotage_models::TextModel;
use pilotage_sdk::Simulation;
use pilotage_sdk::instance::{Experiment, Instance, InterfaceType};

fn model(text: &str) -> TextModel {
    TextModel::parse(text, "m.toml").expect("a model")
}

/// A lag of 0.2 s behind a delay of 0.3 s, and the delayed input itself.
fn lag() -> TextModel {
    model(
        "[model]\nname = \"m\"\n[inputs]\nu = 0\n[parameters]\ntau = { start = 0.3, min = 0 }\n\
         [states]\nx.der = \"(delay(u, tau) - x) / 0.2\"\n[outputs]\ny.value = \"2 * delay(u, tau) + 1\"\n",
    )
}

fn value(of: &Simulation<TextModel>, name: &str) -> f64 {
    of.get(of.table().index(name).expect("a variable"))
}

/// The response to a step of the input at 0.
#[test]
fn an_input_is_delayed_whatever_the_step() {
    let after = |t: f64| {
        if t > 0.3 {
            1.0 - (-(t - 0.3) / 0.2).exp()
        } else {
            0.0
        }
    };
    for h in [0.01, 0.07, 0.3, 0.7, 2.0] {
        let mut own = Simulation::new(lag());
        own.set(0, 1.0).expect("an input");
        assert_eq!(value(&own, "y"), 1.0);
        while own.snapshot().time < 2.0 - 1e-9 {
            own.step(h).expect("a step");
            let t = own.snapshot().time;
            let x = value(&own, "x");
            assert!((x - after(t)).abs() < 1e-8, "{h}, {t}: {x} {}", after(t));
            let y = if t > 0.3 - 1e-9 { 3.0 } else { 1.0 };
            assert!((value(&own, "y") - y).abs() < 1e-12, "{h}, {t}");
        }
    }
}

/// A ramp, with the slope that the master gives, and then a jump; outputs have the derivative of what was.
#[test]
fn slopes_and_jumps_of_inputs_are_delayed() {
    for h in [0.05, 0.4, 0.8] {
        let mut own = Simulation::new(lag());
        let steps = (0.8 / h + 0.5) as usize;
        for _ in 0..steps {
            own.set_slope(0, 2.0).expect("an input");
            own.step(h).expect("a step");
        }
        // u = 2 t, delayed: x = 2 (s - 0.2 + 0.2 exp(-s/0.2)), s = t - 0.3.
        let ramp = |s: f64| 2.0 * (s - 0.2 + 0.2 * (-s / 0.2).exp());
        assert!((value(&own, "x") - ramp(0.5)).abs() < 1e-8, "{h}");
        assert!(
            (value(&own, "y") - (2.0 * 2.0 * 0.5 + 1.0)).abs() < 1e-9,
            "{h}"
        );
        let y = own.table().index("y").expect("an output");
        assert!((own.output_derivative(y) - 4.0).abs() < 1e-8, "{h}");
        assert_eq!(own.directional_derivative(&[y], &[(0, 1.0)]), [0.0]);
        own.set(0, 0.0).expect("an input");
        own.step(0.3).expect("a step");
        assert!((value(&own, "x") - ramp(0.8)).abs() < 1e-8, "{h}");
        own.step(0.2).expect("a step");
        let expected = ramp(0.8) * (-1.0_f64).exp();
        assert!((value(&own, "x") - expected).abs() < 1e-8, "{h}");
    }
}

/// ẋ = -x(t - 1) from 1, with x = 0 before: Σ (-1)ᵏ (t - k)ᵏ/k! (Bellman & Cooke, *Differential-Difference Equations*, section 3.1),
/// and x(t - 1)(t - 0.5) as a delay of a delay.
#[test]
fn a_delayed_state_follows_the_method_of_steps() {
    let text = "[model]\nname = \"m\"\n[states]\nx = { start = 1, der = \"-delay(x, 1)\" }\n\
                [outputs]\ntwice.value = \"delay(delay(x, 1), 0.5)\"\nhigh.value = \"delay(x, 1, 3)\"\n";
    let exact = |t: f64| {
        let (mut sum, mut factorial) = (0.0, 1.0);
        for k in 0..=(t.max(0.0) as usize) {
            factorial *= if k > 0 { k as f64 } else { 1.0 };
            let own = (t - k as f64).powi(k as i32) / factorial;
            sum += if k % 2 == 0 { own } else { -own };
        }
        if t < 0.0 { 0.0 } else { sum }
    };
    for h in [0.1, 0.75, 6.0] {
        let mut own = Simulation::new(model(text));
        while own.snapshot().time < 6.0 - 1e-9 {
            own.step(h).expect("a step");
            let t = own.snapshot().time;
            let (x, twice) = (value(&own, "x"), value(&own, "twice"));
            assert!((x - exact(t)).abs() < 1e-8, "{h}, {t}: {x} {}", exact(t));
            assert!(
                (twice - exact(t - 1.5)).abs() < 1e-8 || (t - 1.5).abs() < 1e-9,
                "{h}, {t}"
            );
        }
    }
}

/// Mackey and Glass's equation (Science 197, 1977), by the classical Runge–Kutta method with fine steps, which takes the past from
/// cubic polynomials.
#[test]
fn a_nonlinear_equation_agrees_with_fine_steps() {
    let text = "[model]\nname = \"m\"\n[states]\nx = { start = 0.5, der = \"0.2 * past / (1 + past^10) - 0.1 * x\" }\n\
                [locals]\npast = \"delay(x - 0.5, 17) + 0.5\"\n";
    let (n, tau) = (10_000, 17.0);
    let h = tau / f64::from(n);
    let f = |x: f64, past: f64| 0.2 * past / (1.0 + past.powi(10)) - 0.1 * x;
    let mut all = vec![0.5; n as usize + 1];
    let mut rates = vec![0.0; n as usize + 1];
    // The derivative jumps at 0, where the past ends.
    rates.push(f(0.5, 0.5));
    all.push(0.5);
    let n = n as usize;
    let steps = (100.0 / h).round() as usize;
    for k in 0..steps {
        let place = |j: usize| if j < n { j } else { j + 1 };
        let (a, b) = (place(k), if k + 1 == n { n } else { place(k + 1) });
        let middle = 0.5 * (all[a] + all[b]) + h / 8.0 * (rates[a] - rates[b]);
        let x = all[all.len() - 1];
        let k1 = f(x, all[a]);
        let k2 = f(x + 0.5 * h * k1, middle);
        let k3 = f(x + 0.5 * h * k2, middle);
        let k4 = f(x + h * k3, all[b]);
        all.push(x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4));
        let past = if k + 2 <= n { 0.5 } else { all[b] };
        rates.push(f(all[all.len() - 1], past));
    }
    let mut own = Simulation::new(model(text));
    own.step(40.0).expect("a step");
    own.step(steps as f64 * h - 40.0).expect("a step");
    let (found, expected) = (value(&own, "x"), all[all.len() - 1]);
    assert!((found - expected).abs() < 1e-7, "{found} {expected}");
}

/// A copy, a restored snapshot and one that was bytes go on with the same bits; what was before a snapshot is not that after it.
#[test]
fn the_past_is_part_of_the_state() {
    let mut own = Instance::new(lag(), InterfaceType::CoSimulation);
    let experiment = Experiment {
        tolerance: None,
        start: 0.0,
        stop: None,
    };
    own.setup(experiment).expect("an experiment");
    let u = own.simulation().table().variables()[0].name.clone();
    assert_eq!(u, "u");
    let set = |own: &mut Instance<TextModel>, value: f64| {
        let reference = pilotage_sdk::variable::reference(0);
        let phase = pilotage_sdk::instance::Phase::Event;
        own.set(&[reference], &[value], phase, "step mode")
            .expect("an input");
    };
    set(&mut own, 1.0);
    own.step(0.0, 0.4, false).expect("a step");
    let saved = own.checkpoint(2, 8);
    let bytes = saved.to_bytes();
    let state = |own: &Instance<TextModel>| own.simulation().snapshot().states[0].to_bits();
    let mut ends = Vec::new();
    for value in [3.0, -2.0, 3.0] {
        let table = own.simulation().table().clone();
        let read = pilotage_sdk::checkpoint::Checkpoint::from_bytes(&bytes, &table, own.guid());
        let read = read.expect("they are its own");
        assert_eq!(read, saved);
        own.restore(&read).expect("its own");
        set(&mut own, value);
        own.step(0.4, 0.25, false).expect("a step");
        // Until 0.7 s the lag sees what was before the snapshot alone.
        ends.push(state(&own));
        own.step(0.65, 0.35, false).expect("a step");
        ends.push(state(&own));
    }
    assert_eq!(ends[0], ends[2]);
    assert_ne!(ends[1], ends[3]);
    assert_eq!(ends[..2], ends[4..]);
    let mut copy = own.simulation().clone();
    assert_eq!(copy.snapshot(), own.simulation().snapshot());
    copy.reset();
    assert_eq!(copy.snapshot().history, Default::default());
}

/// An importer that solves the equations knows states alone: there the delay is an approximation.
#[test]
fn model_exchange_has_states_for_a_delay() {
    let me = Instance::new(lag(), InterfaceType::ModelExchange);
    let mut rates = [0.0; 5];
    let simulation = me.simulation();
    simulation.derivatives(&mut rates);
    // The lag, and two for each delay.
    assert_eq!(simulation.table().n_states(), 5);
    let y = simulation.table().index("y").expect("an output");
    // Of order 2, which passes its input on at once.
    assert_eq!(simulation.directional_derivative(&[y], &[(0, 1.0)]), [2.0]);
}

/// A delay without duration is said, and steps nothing.
#[test]
fn a_delay_takes_time() {
    let mut own = Simulation::new(lag());
    let tau = own.table().parameters().start;
    own.set(tau, 0.0).expect("in its range");
    let error = own.step(0.1).expect_err("no time");
    assert!(
        error
            .to_string()
            .contains("the time of a delay is 0 s; it must be above 0"),
        "{error}"
    );
}
