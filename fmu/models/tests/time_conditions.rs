//! Conditions on time in model files: steps stop where they change, whatever the step. Solutions are known.

use pilotage_models::TextModel;
use pilotage_sdk::Simulation;
use pilotage_sdk::instance::{Experiment, Instance, InterfaceType};

fn model(input: &str) -> TextModel {
    let text = format!(
        "[model]\nname = \"m\"\n[inputs]\nlevel = 0\n[parameters]\nbegin = 61.23\n[states]\n\
         x = {{ start = 1, der = \"-0.02 * x + {input}\" }}\n"
    );
    TextModel::parse(&text, "m.toml").expect("a model")
}

/// The response to a pulse of 50.
fn solution(begin: f64, end: f64, t: f64) -> f64 {
    let k: f64 = 0.02;
    let step = |from: f64| 50.0 / k * (1.0 - (-k * (t - from).max(0.0)).exp());
    (-k * t).exp() + step(begin) - step(end)
}

#[test]
fn no_pulse_is_too_short_for_a_step() {
    let spellings = [
        ("if(time > begin, if(time < begin + 0.02, 50, 0), 0)", 0.02),
        (
            "50 * if(time >= begin, 1, 0) - 50 * if(time >= begin + 1e-6, 1, 0)",
            1e-6,
        ),
        ("if(abs(time - begin - 0.001) <= 0.001, 50, 0)", 0.002),
        (
            "if(3 * time / begin > 3, if(time - 0.02 < begin, 50, 0), 0)",
            0.02,
        ),
    ];
    for (spelling, width) in spellings {
        let of = model(spelling);
        for h in [100.0, 10.0, 61.23, 0.5] {
            let mut own = Simulation::new(of.clone());
            while own.snapshot().time < 99.0 {
                own.step(h).expect("a step");
            }
            let (x, t) = (own.snapshot().states[0], own.snapshot().time);
            let expected = solution(61.23, 61.23 + width, t);
            assert!(
                (x - expected).abs() < 1e-8,
                "{spelling}, {h}: {x} {expected}"
            );
        }
    }
}

/// `time > level` with a level that rises by 0.5 /s from 10: it changes at 20 s.
#[test]
fn a_time_moves_with_the_slope_of_an_input() {
    let mut own = Simulation::new(model("if(time > level, if(time < level + 0.01, 50, 0), 0)"));
    own.set(0, 10.0).expect("an input");
    own.set_slope(0, 0.5).expect("an input");
    own.step(30.0).expect("a step");
    // The end rises too: t = 10.01 + t / 2.
    let expected = solution(20.0, 20.02, 30.0);
    let x = own.snapshot().states[0];
    assert!((x - expected).abs() < 1e-8, "{x} {expected}");
}

/// Model exchange: an importer is told the next time, and the derivative changes when the event is handled there.
#[test]
fn an_importer_is_told_the_next_time() {
    let of = model("if(time > begin, if(time < begin + 0.02, 50, 0), 0)");
    let mut own = Instance::new(of, InterfaceType::ModelExchange);
    let experiment = Experiment {
        tolerance: None,
        start: 0.0,
        stop: None,
    };
    own.setup(experiment).expect("an experiment");
    own.handle_event().expect("an event");
    let rate = |own: &Instance<TextModel>| {
        let mut rate = [0.0];
        own.derivatives(&mut rate).expect("a derivative");
        rate[0]
    };
    for (time, before, after) in [(61.23, -0.02, 49.98), (61.25, 49.98, -0.02)] {
        let next = own.next_event().expect("an event");
        assert!((next - time).abs() < 1e-12, "{next}");
        own.set_time(next).expect("a time");
        assert_eq!(rate(&own), before);
        let saved = own.checkpoint(2, 0);
        own.handle_event().expect("an event");
        assert_eq!(rate(&own), after);
        own.restore(&saved).expect("a state of its own");
        assert_eq!(rate(&own), before);
        own.handle_event().expect("an event");
        assert_eq!(rate(&own), after);
    }
    assert_eq!(own.next_event(), None);
}

/// A table of time with a spike between two steps, and a ramp that is cut off.
#[test]
fn kinks_in_time_are_stops_too() {
    let table = |_: &str| Ok("t,y\n0,0\n61.23,0\n61.24,50\n61.25,0\n".to_owned());
    let text = "[model]\nname = \"m\"\n[states]\nx = { der = \"table('spike.csv', time)\" }\n\
                y = { der = \"max(0, sat(1000 * (time - 61.23), -1, 1)) * max(0, 61.25 - time)\" }\n";
    let compiled = pilotage_language::parse(text, "m.toml", &table).expect("a model");
    let mut own = Simulation::new(TextModel::of(compiled));
    own.step(100.0).expect("a step");
    let [x, y] = own.snapshot().states[..] else {
        panic!("two states");
    };
    assert!((x - 0.5).abs() < 1e-12, "{x}");
    // ∫ 1000 s (0.02 - s) over the first millisecond, and ∫ (0.02 - s) over the rest.
    let expected = 1e3 * (0.01 * 1e-6 - 1e-9 / 3.0) + 0.019_f64.powi(2) / 2.0;
    assert!((y - expected).abs() < 1e-12, "{y} {expected}");
}
