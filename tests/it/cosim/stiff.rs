//! Signals that change much faster than they are exchanged.

use super::components::{Linear, Signal, simulate};
use crate::joint_ode::{Loop, Point};
use pilotage::cosim::{
    Algorithm, Clock, Control, Coupling, CouplingError, Ending, Run, Selection, SeriesRecorder,
    System, Thinned, native_component, run,
};
use pilotage::models::{AnyModel, Model, Quadcopter};

const TARGET: f64 = 10.0;
const STOP: f64 = 15.0;
const H: f64 = 0.05;

/// `-a (0.06 s² + 0.05 s + 0.01) / ((s + a) (s² + 1.6 s + 1))`: the faster the pole at `-a` [1/s] is, the more
/// the pilot behaves like direct feedthrough.
fn theta(a: f64) -> [f64; 6] {
    [a, 1.0 + 1.6 * a, 1.6 + a, -0.01 * a, -0.05 * a, -0.06 * a]
}

fn closed_loop(theta: &[f64]) -> System {
    let mut system = System::new();
    for (name, model) in [
        ("pilot", Model::pilot(theta, 1.0)),
        ("quadcopter", Model::quadcopter(&Quadcopter::default())),
    ] {
        system
            .add(name, native_component::of_model(AnyModel::BuiltIn(model)))
            .unwrap();
    }
    system.connect("pilot.stick", "quadcopter.stick").unwrap();
    system.connect("quadcopter.z", "pilot.position").unwrap();
    system.set("pilot.target", &TARGET.to_string()).unwrap();
    system
}

/// Largest error of the position at the communication points, every `h` [s], in metres, and the run.
fn error(theta: &[f64], h: f64, exact: &[Point], coupling: impl Into<Coupling>) -> (f64, Run) {
    let (run, recorder) = simulate(closed_loop(theta), STOP, h, coupling);
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    let z = &recorder.series.column("quadcopter.z").unwrap().values;
    assert_eq!(z.len(), exact.len());
    let errors = z.iter().zip(exact).map(|(z, exact)| (z - exact.z[0]).abs());
    (errors.fold(0.0, f64::max), run)
}

/// The slope of the stick at the start is that of a jump which is over within a thousandth of the step and
/// less; a cubic with that slope at its begin would throw the vehicle down by metres.
#[test]
fn strong_coupling_of_fast_pilots_is_better_than_gauss_seidel() {
    for a in [1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6] {
        let pilot = Loop {
            theta: theta(a).to_vec(),
            limit: 1.0,
            target: TARGET,
        };
        let exact = pilot.solve(H, STOP);
        let (simple, _) = error(&theta(a), H, &exact, Algorithm::GaussSeidel);
        let (strong, run) = error(&theta(a), H, &exact, Algorithm::Strong);
        assert!((0.09..0.3).contains(&simple), "pole -{a}: {simple}");
        assert!(strong < 5e-3, "pole -{a}: {strong}");
        let steps = run.report.steps;
        assert_eq!((steps.unconverged, steps.rejected), (0, 0), "pole -{a}");
        // From rest with very short steps, every change is many times the one before.
        let clock = Clock::new(0.0, STOP, H).unwrap();
        let controlled = Coupling {
            control: Some(Control::new(1e-6, &clock)),
            ..Algorithm::Strong.into()
        };
        let (controlled, run) = error(&theta(a), H, &exact, controlled);
        assert!(controlled < 1e-4, "pole -{a}: {controlled}");
        for connection in run.report.connections {
            assert_eq!(connection.divergence, None, "pole -{a}: {connection:?}");
        }
    }
}

/// What the vehicle and a pilot with these parameters give each other, by how much the means over the steps are
/// wrong: on average and at most, as reported and in truth. What an input was given in the mean is seen by an
/// integrator; what it should have been, the joint equations make of the states at the begin of each step.
struct LocalErrors {
    reported: [CouplingError; 2],
    truth: [CouplingError; 2],
}

fn local_errors(theta: &[f64], limit: f64, target: f64, stop: f64) -> LocalErrors {
    let mut system = System::new();
    let pilot = Model::pilot(theta, limit);
    let quadcopter = Model::quadcopter(&Quadcopter::default());
    for (name, model) in [("pilot", pilot), ("quadcopter", quadcopter)] {
        system
            .add(name, native_component::of_model(AnyModel::BuiltIn(model)))
            .unwrap();
    }
    let fed = [
        ("quadcopter.z", "pilot.position"),
        ("pilot.stick", "quadcopter.stick"),
    ];
    for (k, (from, to)) in fed.into_iter().enumerate() {
        let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).revocable().following();
        system
            .add(format!("seen{k}"), Box::new(integrator))
            .unwrap();
        system.connect(from, to).unwrap();
        system.connect(from, &format!("seen{k}.u")).unwrap();
    }
    system.set("pilot.target", &target.to_string()).unwrap();
    let vehicle = ["z", "phi", "v", "q", "omega_f", "omega_b"].map(|x| format!("quadcopter.{x}"));
    let own = (1..=theta.len() / 2).map(|i| format!("pilot.x{i}"));
    let states: Vec<String> = vehicle.into_iter().chain(own).collect();
    let selection = Selection::new(&mut system, &[&states[..], &["seen?.y".into()]].concat());
    let clock = Clock::new(0.0, stop, H).unwrap();
    let mut recorder = SeriesRecorder::default();
    let mut recorded = Thinned::new(&mut recorder, Some(selection.unwrap()), 1);
    let run = run(system, &clock, None, Algorithm::Strong, &mut recorded).unwrap();
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    let series = recorder.series;
    let at = |name: &str, k: usize| series.column(name).unwrap().values[k];
    let mut pilot = Loop {
        theta: theta.to_vec(),
        limit,
        target,
    };
    let mut truth = [CouplingError::default(); 2];
    for k in 1..series.time.len() {
        let before: Vec<f64> = states.iter().map(|name| at(name, k - 1)).collect();
        let exact = pilot.means(&before, H);
        for (i, (truth, exact)) in truth.iter_mut().zip(exact).enumerate() {
            let name = format!("seen{i}.y");
            let error = ((at(&name, k) - at(&name, k - 1)) / H - exact).abs();
            truth.mean += error * H / stop;
            truth.max = truth.max.max(error);
        }
    }
    let reported = fed.map(|(from, to)| {
        let mut connections = run.report.connections.iter();
        let found = connections.find(|c| c.from == from && c.to == to);
        found.unwrap().error.unwrap()
    });
    LocalErrors { reported, truth }
}

/// `-a b (k + d s) / ((s + a) (s + b))`: after a step of the target the stick is a pulse as high as `d a b / (a + b)`,
/// and after each change of the position's slope it has its new value within `1/a + 1/b`.
fn two_poles(a: f64, b: f64, k: f64, d: f64) -> Vec<f64> {
    vec![a * b, a + b, -k * a * b, -d * a * b]
}

/// The values and slopes at the ends of the steps say next to nothing of most of these sticks: the errors are seen
/// within the steps, and where they are large, these are cut.
#[test]
fn local_errors_of_fast_pilots_are_true() {
    let mut pilots: Vec<Vec<f64>> = [1.0, 10.0, 1e2, 1e3, 1e4, 1e6]
        .map(|a| theta(a).to_vec())
        .into();
    for a in [10.0, 1e2, 1e3, 1e4] {
        for (k, d) in [(0.003, 0.0), (0.003, 0.02), (0.01, 0.05)] {
            pilots.push(two_poles(a, 1.3 * a, k, d));
        }
    }
    // Poles at -50 ± 500i.
    let square = 50.0 * 50.0 + 500.0 * 500.0;
    for (k, d) in [(0.003, 0.0), (0.003, 0.02)] {
        pilots.push(vec![square, 100.0, -k * square, -d * square]);
    }
    // Without a limit; and from one to the other, as often as it takes.
    for (limit, target) in [(1e9, 0.5), (1.0, 10.0)] {
        for theta in &pilots {
            let found = local_errors(theta, limit, target, 5.0);
            let [z, stick] = [0, 1].map(|i| {
                let (reported, truth) = (found.reported[i], found.truth[i]);
                [reported.mean / truth.mean, reported.max / truth.max]
            });
            // What a wrong stick does to the position within the step is no error of the position's course.
            let is_limited = limit == 1.0;
            let ratios = [
                stick[0],
                stick[1],
                z[0],
                if is_limited { 1.0 } else { z[1] },
            ];
            assert!(
                ratios.iter().all(|ratio| (0.5..2.0).contains(ratio)),
                "{theta:?}, limit {limit}: stick {stick:?}, z {z:?}"
            );
        }
    }
}

/// Pulses and swings from limit to limit after the step of the target. Steps of fixed length are cut, and under control
/// the errors go down with the tolerance, however long the steps may be.
#[test]
fn sticks_that_pulse_and_swing_within_a_step_are_not_missed() {
    let square = 50.0 * 50.0 + 500.0 * 500.0;
    let swings = vec![square, 100.0, -0.003 * square, -0.02 * square];
    let pulses = two_poles(1e3, 1.3e3, 0.003, 0.02);
    for theta in [swings, pulses] {
        let exact = |h| {
            let pilot = Loop {
                theta: theta.clone(),
                limit: 1.0,
                target: TARGET,
            };
            pilot.solve(h, STOP)
        };
        let (fixed, run) = error(&theta, H, &exact(H), Algorithm::Strong);
        assert!(fixed < 0.06, "{theta:?}: {fixed}");
        assert!(run.report.steps.rejected > 0, "{theta:?}");
        for h in [0.5, 1.0] {
            let clock = Clock::new(0.0, STOP, h).unwrap();
            for (tolerance, most) in [(1e-4, 0.01), (1e-6, 1e-4)] {
                let coupling = Coupling {
                    control: Some(Control::new(tolerance, &clock)),
                    ..Algorithm::Strong.into()
                };
                let (found, _) = error(&theta, h, &exact(h), coupling);
                assert!(found < most, "{theta:?}, {h} s, {tolerance}: {found}");
            }
        }
    }
}

/// An integrator of a signal, for 1 s in steps of 0.1 s.
fn integrated(signal: Signal) -> (Run, SeriesRecorder) {
    let mut system = System::new();
    system.add("signal", Box::new(signal)).unwrap();
    let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).revocable().following();
    system.add("integrator", Box::new(integrator)).unwrap();
    system.connect("signal.y", "integrator.u").unwrap();
    simulate(system, 1.0, 0.1, Algorithm::Strong)
}

/// `cos(1000 t)`, sixteen periods in each step: what lies between two points and slopes is nonsense, and the
/// steps are halved until it is none.
fn fast(t: f64) -> [f64; 2] {
    [(1000.0 * t).cos(), -1000.0 * (1000.0 * t).sin()]
}

#[test]
fn steps_whose_error_is_as_large_as_the_signal_are_halved() {
    let (run, recorder) = integrated(Signal::new(fast));
    let y = &recorder.series.column("integrator.y").unwrap().values;
    assert_eq!(recorder.series.time.len(), 11);
    for (t, y) in recorder.series.time.iter().zip(y) {
        let exact = (1000.0 * t).sin() / 1000.0;
        // No step is wrong by more than the signal is large; the first one was, by three times that.
        assert!((y - exact).abs() <= *t, "{t}: {y} {exact}");
    }
    let steps = run.report.steps;
    assert!(steps.rejected > 0 && steps.accepted < 1000, "{steps:?}");
}

#[test]
fn where_steps_cannot_be_halved_the_run_ends() {
    let mut signal = Signal::new(fast);
    signal.can_vary = false;
    let (run, _) = integrated(signal);
    let Ending::Failed {
        instance, source, ..
    } = run.ending
    else {
        panic!("{:?}", run.ending)
    };
    assert_eq!(instance, "integrator");
    let message = source.to_string();
    assert!(
        message.starts_with("in a step of 0.1 s, what is known of `u` between the ends"),
        "{message}"
    );
    assert!(message.ends_with("take a shorter --step, or another --algorithm"));
}

/// A sample of the time that is taken every 0.1 s, at the communication points, and kept: a real, but no line.
fn sampled(t: f64) -> [f64; 2] {
    [(10.0 * t + 1e-9).floor(), 3.0]
}

#[test]
fn a_discrete_real_is_held_in_strong_coupling() {
    let mut signal = Signal::new(sampled);
    signal.variables[0].is_discrete = true;
    let (run, recorder) = integrated(signal);
    assert_eq!(run.report.steps.rejected, 0);
    let y = &recorder.series.column("integrator.y").unwrap().values;
    let mut exact = 0.0;
    for (k, y) in y.iter().enumerate() {
        assert!((y - exact).abs() < 1e-12, "{k}: {y} {exact}");
        exact += 0.1 * k as f64;
    }
}
