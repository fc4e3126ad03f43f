//! Strong coupling: no lag, second order, algebraic loops solved; and the step-size control on it.

use super::blocks::RandomLoop;
use super::components::{Linear, Log, Signal, simulate};
use crate::command::example;
use crate::foreign;
use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{
    Abilities, Algorithm, Clock, Component, Control, Coupling, Divergence, Ending, Progress,
    SeriesRecorder, Source, System, Transfer, Variable, fmu_component, native_component, run,
};
use pilotage::models::{AnyModel, TextModel};
use pilotage::series::{Column, Series};

/// P controller `u = 2 (1 - y)` and integrator `ẏ = u`, with `y - 1` as the state.
fn controller_and_integrator(change: impl Fn(Linear) -> Linear) -> System {
    let mut system = System::new();
    let controller = change(Linear::new(0.0, 0.0, 0.0, -2.0));
    let integrator = change(Linear::new(0.0, 1.0, 1.0, 0.0).from(-1.0));
    system.add("controller", Box::new(controller)).unwrap();
    system.add("integrator", Box::new(integrator)).unwrap();
    system.connect("integrator.y", "controller.u").unwrap();
    system.connect("controller.y", "integrator.u").unwrap();
    system
}

fn last(recorder: &SeriesRecorder, name: &str) -> f64 {
    *recorder.series.column(name).unwrap().values.last().unwrap()
}

/// Exact is 0.864665, Jacobi gives 0.953920. What is found is the trapezoidal rule, whether the components
/// hold their inputs or follow ramps.
#[test]
fn the_published_example_is_right_within_two_parts_in_a_thousand() {
    let trapezoid = 1.0 - (0.9_f64 / 1.1).powi(10);
    for change in [Linear::revocable, |l: Linear| l.revocable().following()] {
        let system = controller_and_integrator(change);
        let (run, recorder) = simulate(system, 1.0, 0.1, Algorithm::Strong);
        let y = 1.0 + last(&recorder, "integrator.y");
        assert!((y - trapezoid).abs() < 1e-8, "{y}");
        assert!((y / 0.864_664_716_763 - 1.0).abs() < 2e-3, "{y}");
        assert!((last(&recorder, "controller.y") - 2.0 * (1.0 - y)).abs() < 1e-8);
        let steps = run.report.steps;
        assert_eq!((steps.accepted, steps.unconverged), (10, 0), "{steps:?}");
        // One matrix serves the whole run, one correction each step.
        assert_eq!((steps.corrections, steps.matrices), (10, 1));
        for connection in run.report.connections {
            assert_eq!(
                (connection.transfer, connection.lag),
                (Transfer::Interpolated, 0.0)
            );
        }
    }
}

/// `u = t` drives `ẋ = b u - a x` with inputs that are held, `y = c x + d u`: an integrator that does not say that its output
/// depends on the state alone, and a lag with direct feedthrough. Outputs of a step with the inputs' end values alone would
/// be wrong for one of both.
#[test]
fn held_inputs_are_right_for_states_and_for_direct_feedthrough() {
    let error = |own: Linear, step: f64, exact: f64| {
        let mut system = System::new();
        system
            .add("u", Box::new(Signal::new(|t| [t, 1.0])))
            .unwrap();
        system.add("own", Box::new(own)).unwrap();
        system.connect("u.y", "own.u").unwrap();
        let (run, recorder) = simulate(system, 2.0, step, Algorithm::Strong);
        assert_eq!(run.report.holding, ["own"]);
        (last(&recorder, "own.y") - exact).abs()
    };
    let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).undeclared().revocable();
    assert!(error(integrator, 0.5, 2.0) < 1e-12);
    let lag = || Linear::new(-1.0, 1.0, 1.0, 2.0).revocable();
    let exact = 1.0 + (-2.0_f64).exp() + 4.0;
    let [coarse, fine] = [0.2, 0.1].map(|step| error(lag(), step, exact));
    assert!(coarse < 5e-3 && coarse / fine > 3.5, "{coarse} {fine}");
}

/// A component with an event that follows the stop time by rounding, which no step reaches.
struct Ahead(Linear);

impl Component for Ahead {
    fn variables(&self) -> &[Variable] {
        self.0.variables()
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        self.0.set_reals(handles, values)
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        self.0.get_reals(handles, values)
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.0.step(t, h)
    }

    fn abilities(&self) -> Abilities {
        self.0.abilities()
    }

    fn next_jump(&self, t: f64) -> Option<f64> {
        Some(1.0 + f64::EPSILON).filter(|jump| *jump > t)
    }
}

#[test]
fn an_event_behind_the_stop_time_ends_no_run() {
    let mut system = System::new();
    system
        .add("u", Box::new(Signal::new(|t| [t, 1.0])))
        .unwrap();
    system
        .add("own", Box::new(Ahead(Linear::new(0.0, 1.0, 1.0, 0.0))))
        .unwrap();
    system.connect("u.y", "own.u").unwrap();
    let (run, recorder) = simulate(system, 1.0, 0.25, Algorithm::Strong);
    assert!(matches!(run.ending, Ending::Completed));
    assert_eq!(run.steps, 4);
    assert_eq!(recorder.series.time.last(), Some(&1.0));
}

/// Components with derivatives of their outputs: those of the controller, which has direct feedthrough, are the ones for the
/// slope with which its input ends. The corrections converge and the error is of fourth order.
#[test]
fn a_loop_with_direct_feedthrough_is_of_fourth_order() {
    let system = |step: f64, control: Option<f64>| {
        let mut system = System::new();
        for (name, file) in [("controller", "proportional"), ("plant", "integral")] {
            let model = TextModel::read(&example("models").join(format!("{file}.toml"))).unwrap();
            let component = native_component::of_model(AnyModel::Text(model));
            system.add(name, component).unwrap();
        }
        system.connect("controller.u", "plant.u").unwrap();
        system.connect("plant.y", "controller.y").unwrap();
        let clock = Clock::new(0.0, 1.0, step).unwrap();
        let coupling = Coupling {
            control: control.map(|tolerance| Control::new(tolerance, &clock)),
            ..Algorithm::Strong.into()
        };
        let (run, recorder) = simulate(system, 1.0, step, coupling);
        assert_eq!(run.report.steps.unconverged, 0);
        let error = last(&recorder, "plant.y") - 1.0 + (-2.0_f64).exp();
        (error.abs(), run.report.steps.accepted)
    };
    let [(coarse, _), (fine, _)] = [0.1, 0.05].map(|step| system(step, None));
    assert!(coarse < 2e-6 && coarse / fine > 12.0, "{coarse} {fine}");
    let (error, steps) = system(0.1, Some(1e-6));
    assert!(error < 1e-6 && steps < 100, "{error} in {steps} steps");
}

/// Models of these texts, connected.
fn of_models(models: &[(&str, &str)], wires: &[(&str, &str)]) -> System {
    let mut system = System::new();
    for (name, text) in models {
        let text = format!("[model]\nname = \"{name}\"\n{text}");
        let model = TextModel::parse(&text, name).unwrap();
        let component = native_component::of_model(AnyModel::Text(model));
        system.add(*name, component).unwrap();
    }
    for (from, to) in wires {
        system.connect(from, to).unwrap();
    }
    system
}

/// Loops of outputs that depend on inputs at once, with gains of 3 and 0.5: values and slopes are both solved for.
#[test]
fn algebraic_loops_are_of_fourth_order_too() {
    let at_once = |step: f64, control: Option<f64>| {
        let a = "[inputs]\ny = {}\n[parameters]\nw = { start = 2, unit = \"rad/s\" }\n[outputs]\n\
                 u = { value = \"sin(w * time) - 3 * y\" }\n";
        let b = "[inputs]\nu = {}\n[outputs]\ny = { value = \"u\" }\n";
        let system = of_models(&[("a", a), ("b", b)], &[("a.u", "b.u"), ("b.y", "a.y")]);
        let clock = Clock::new(0.0, 2.0, step).unwrap();
        let coupling = Coupling {
            control: control.map(|tolerance| Control::new(tolerance, &clock)),
            ..Algorithm::Strong.into()
        };
        let (run, recorder) = simulate(system, 2.0, step, coupling);
        let pairs = recorder
            .series
            .time
            .iter()
            .zip(&recorder.series.column("a.u").unwrap().values);
        for (t, u) in pairs {
            assert!((u - 0.25 * (2.0 * t).sin()).abs() < 1e-9, "{u} at {t} s");
        }
        (run.report.steps.unconverged, run.report.steps.accepted)
    };
    assert_eq!(at_once(0.1, None), (0, 20));
    let (unconverged, steps) = at_once(0.1, Some(1e-6));
    assert!(unconverged == 0 && steps < 200, "{steps}");

    let error = |step: f64| {
        let controller = "[inputs]\ny = {}\n[states]\ni = { der = \"3 * (1 - y)\" }\n[outputs]\n\
                          u = { value = \"2 * (1 - y) + i\" }\n";
        let plant = "[inputs]\nu = {}\n[states]\nx = { der = \"u - x\" }\n[outputs]\n\
                     y = { value = \"x + 0.25 * u\" }\n";
        let models = [("controller", controller), ("plant", plant)];
        let wires = [("controller.u", "plant.u"), ("plant.y", "controller.y")];
        let (run, recorder) = simulate(of_models(&models, &wires), 2.0, step, Algorithm::Strong);
        assert_eq!(run.report.steps.unconverged, 0);
        // The joint equations, by Runge and Kutta with short steps.
        let rate = |[x, i]: [f64; 2]| {
            let u = (2.0 * (1.0 - x) + i) / 1.5;
            [u - x, 3.0 * (1.0 - x - 0.25 * u)]
        };
        let h = 1e-3;
        let after = |s: [f64; 2], k: [f64; 2], h: f64| [s[0] + h * k[0], s[1] + h * k[1]];
        let joint = (0..2000).fold([0.0, 0.0], |s, _| {
            let k1 = rate(s);
            let k2 = rate(after(s, k1, 0.5 * h));
            let k3 = rate(after(s, k2, 0.5 * h));
            let k4 = rate(after(s, k3, h));
            let sum = |j: usize| (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]) / 6.0;
            after(s, [sum(0), sum(1)], h)
        });
        let u = (2.0 * (1.0 - joint[0]) + joint[1]) / 1.5;
        (last(&recorder, "controller.u") - u).abs()
    };
    let [coarse, fine] = [0.1, 0.05].map(error);
    assert!(coarse < 1e-6 && coarse / fine > 10.0, "{coarse} {fine}");
}

/// A loop without a solution from 1 s on ends with an error instead of ever shorter steps.
#[test]
fn an_algebraic_loop_that_loses_its_solution_ends() {
    let a = "[inputs]\ny = {}\n[parameters]\nw = { start = 1, unit = \"1/s\" }\n[outputs]\n\
             u = { value = \"y^2 + 0.25 * w * time\" }\n";
    let b = "[inputs]\nu = {}\n[outputs]\ny = { value = \"u\" }\n";
    let system = of_models(&[("a", a), ("b", b)], &[("a.u", "b.u"), ("b.y", "a.y")]);
    let clock = Clock::new(0.0, 2.0, 0.1).unwrap();
    let coupling = Coupling {
        control: Some(Control::new(1e-4, &clock)),
        ..Algorithm::Strong.into()
    };
    let mut recorder = SeriesRecorder::default();
    let ended = run(system, &clock, None, coupling, &mut recorder).unwrap();
    let Ending::Failed { source, time, .. } = ended.ending else {
        panic!("{:?}", ended.ending);
    };
    assert!((0.9..1.1).contains(&time), "{time}");
    assert!(source.to_string().contains("do not converge"), "{source}");
}

/// `y(1)` to 1e-6 in at most 300 steps.
#[test]
fn error_control_keeps_the_tolerance_in_few_steps() {
    let exact = 1.0 - (-2.0_f64).exp();
    for change in [Linear::revocable, |l: Linear| l.revocable().following()] {
        let mut counts = Vec::new();
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
            let coupling = Coupling {
                control: Some(Control::new(tolerance, &clock)),
                ..Algorithm::Strong.into()
            };
            let (run, recorder) = simulate(controller_and_integrator(change), 1.0, 0.1, coupling);
            let error = (1.0 + last(&recorder, "integrator.y") - exact).abs();
            assert!(error < tolerance, "{error} > {tolerance}");
            assert_eq!(
                recorder.series.time,
                (0..=10).map(|k| clock.time(k)).collect::<Vec<_>>()
            );
            let steps = run.report.steps;
            assert_eq!((steps.over_tolerance, steps.unconverged), (0, 0));
            counts.push((steps.accepted, steps.rejected));
        }
        assert!(counts[1].0 <= 300, "{counts:?}");
        insta::allow_duplicates! {
            insta::assert_snapshot!(format!("{counts:?}"), @"[(40, 0), (107, 0), (386, 1)]");
        }
    }
}

/// The order of convergence of each algorithm, on random loops of 2 to 20 blocks with exact solutions.
#[test]
fn orders_of_convergence_on_random_loops() {
    let following = Abilities {
        rollback: true,
        input_derivatives: true,
        ..Abilities::default()
    };
    let holding = Abilities {
        input_derivatives: false,
        ..following
    };
    let with = |algorithm, degree| Coupling {
        extrapolation: Some(degree),
        ..Coupling::from(algorithm)
    };
    for (n, seed) in [(2, 1), (3, 2), (5, 3), (8, 4), (13, 5), (20, 6)] {
        for (coupling, abilities, order) in [
            (with(Algorithm::Jacobi, 0), holding, 1.0),
            (with(Algorithm::Jacobi, 1), holding, 2.0),
            (with(Algorithm::Jacobi, 1), following, 2.0),
            (with(Algorithm::Jacobi, 2), following, 2.0),
            (with(Algorithm::GaussSeidel, 0), holding, 1.0),
            (with(Algorithm::GaussSeidel, 1), holding, 2.0),
            (with(Algorithm::GaussSeidel, 1), following, 2.0),
            (with(Algorithm::Strong, 2), holding, 2.0),
            (with(Algorithm::Strong, 0), following, 2.0),
        ] {
            // Extrapolation around an algebraic loop multiplies errors; only strong coupling solves it.
            let is_strong = coupling.algorithm == Algorithm::Strong;
            let random = RandomLoop::new(seed, n, abilities, is_strong);
            let exact = random.exact(1.0);
            let errors = [64.0, 128.0, 256.0].map(|steps: f64| {
                let (run, recorder) = simulate(random.system(), 1.0, 1.0 / steps, coupling);
                assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
                let columns = recorder.series.columns.iter();
                let found = columns.map(|c| *c.values.last().unwrap());
                let squares = found
                    .zip(exact.iter())
                    .map(|(y, exact)| (y - exact).powi(2));
                squares.sum::<f64>().sqrt()
            });
            for pair in errors.windows(2) {
                let found = (pair[0] / pair[1]).log2();
                assert!(
                    found > order - 0.25,
                    "{n} blocks, {coupling:?}, {abilities:?}: {found}, {errors:?}"
                );
            }
        }
    }
}

/// Extrapolation by lines around a loop of gain -0.4: with Gauss-Seidel `y⁺ = -0.4 (2 y - y⁻)`, whose roots are
/// 0.35 and -1.15; with Jacobi the loop takes two steps, and the swing four.
/// Held values converge, as does strong coupling.
#[test]
fn extrapolation_around_an_algebraic_loop_that_diverges_is_named() {
    let run_with = |algorithm, degree| {
        let mut system = System::new();
        let a = Linear::new(-1.0, 1.0, 1.0, 0.8).from(1.0).revocable();
        let b = Linear::new(0.0, 0.0, 0.0, -0.5).revocable();
        system.add("a", Box::new(a)).unwrap();
        system.add("b", Box::new(b)).unwrap();
        system.connect("a.y", "b.u").unwrap();
        system.connect("b.y", "a.u").unwrap();
        let coupling = Coupling {
            extrapolation: Some(degree),
            ..Coupling::from(algorithm)
        };
        let (run, _) = simulate(system, 2.0, 0.01, coupling);
        let connections = run.report.connections.into_iter();
        connections.map(|c| c.divergence).collect::<Vec<_>>()
    };
    let (alternating, growing) = (Some(Divergence::Alternating), Some(Divergence::Growing));
    assert_eq!(run_with(Algorithm::GaussSeidel, 1), [alternating; 2]);
    assert_eq!(run_with(Algorithm::Jacobi, 1), [growing; 2]);
    for (algorithm, degree) in [
        (Algorithm::Jacobi, 0),
        (Algorithm::GaussSeidel, 0),
        (Algorithm::Strong, 1),
    ] {
        assert_eq!(
            run_with(algorithm, degree),
            [None; 2],
            "{algorithm} {degree}"
        );
    }
}

/// Two gains of 2 in a ring: substitution diverges, Newton's method solves the loop at each point.
#[test]
fn algebraic_loops_are_solved_at_communication_points() {
    let mut system = System::new();
    // y_a = x_a + 2 y_b with ẋ_a = y_b, y_b = 1 + 2 y_a: y_b = (1 + 2 x_a)/(1 - 4).
    let a = Linear::new(0.0, 1.0, 1.0, 2.0).from(1.0).revocable();
    let b = Linear::new(0.0, 0.0, 1.0, 2.0).from(1.0).revocable();
    system.add("a", Box::new(a)).unwrap();
    system.add("b", Box::new(b)).unwrap();
    system.connect("a.y", "b.u").unwrap();
    system.connect("b.y", "a.u").unwrap();
    let (run, recorder) = simulate(system, 1.0, 0.01, Algorithm::Strong);
    assert_eq!(run.report.steps.unconverged, 0);
    // ẋ = -(1 + 2 x)/3 from 1: x = 1.5 e^{-2t/3} - 0.5.
    let x = 1.5 * (-2.0_f64 / 3.0).exp() - 0.5;
    let y_b = -(1.0 + 2.0 * x) / 3.0;
    let (found_a, found_b) = (last(&recorder, "a.y"), last(&recorder, "b.y"));
    assert!((found_b - y_b).abs() < 1e-5, "{found_b} {y_b}");
    assert!((found_a - (x + 2.0 * y_b)).abs() < 2e-5, "{found_a}");
    assert!((found_b - (1.0 + 2.0 * found_a)).abs() < 1e-8);
}

/// A component that cannot go back gets held inputs, is named, and the error that it causes is estimated.
#[test]
fn components_that_cannot_go_back_are_named_with_their_error() {
    let exact = 1.0 - (-2.0_f64).exp();
    let run_with = |degree| {
        let mut system = System::new();
        let controller = Linear::new(0.0, 0.0, 0.0, -2.0);
        let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).from(-1.0).revocable();
        system.add("controller", Box::new(controller)).unwrap();
        system.add("integrator", Box::new(integrator)).unwrap();
        system.connect("integrator.y", "controller.u").unwrap();
        system.connect("controller.y", "integrator.u").unwrap();
        let coupling = Coupling {
            extrapolation: Some(degree),
            measure: true,
            ..Algorithm::Strong.into()
        };
        let (run, recorder) = simulate(system, 1.0, 0.01, coupling);
        let error = (1.0 + last(&recorder, "integrator.y") - exact).abs();
        (run.report, error)
    };
    let (report, error) = run_with(0);
    assert_eq!(report.irrevocable, ["controller"]);
    let [to_controller, to_integrator] = &report.connections[..] else {
        panic!("two connections")
    };
    assert_eq!(
        (to_controller.transfer, to_controller.lag),
        (Transfer::Held, 0.005)
    );
    assert_eq!(
        (to_integrator.transfer, to_integrator.lag),
        (Transfer::Interpolated, 0.0)
    );
    // In the mean y is late by h/2: by 0.005 (1 - e^{-2}).
    let late = to_controller.error.unwrap().mean;
    assert!((late / (0.005 * exact) - 1.0).abs() < 0.02, "{late}");
    assert!(to_integrator.error.unwrap().mean < 0.02 * late);
    let (extrapolated, smaller) = run_with(1);
    assert_eq!(extrapolated.connections[0].transfer, Transfer::Extrapolated);
    assert!(smaller < 0.1 * error, "{smaller} {error}");
}

/// A table drives an FMU `y' = k (u - y)` that drives another one. FMUs of OpenModelica declare derivatives of outputs and give NaN: they count as
/// such that have none.
#[test]
fn derivatives_of_outputs_that_are_nan_are_none() {
    let run_with = |behaviour: &str, capability: &str| {
        let folder = tempfile::tempdir().unwrap();
        let mut system = System::new();
        for name in ["a", "b"] {
            let path = folder.path().join(format!("{name}.fmu"));
            let text = foreign::DESCRIPTION
                .replace("guid=\"good\"", &format!("guid=\"{behaviour}\""))
                .replace(
                    "canGetAndSetFMUstate",
                    &format!("{capability}canGetAndSetFMUstate"),
                );
            std::fs::write(&path, foreign::fmu_of(&text, foreign::binary())).unwrap();
            let component = fmu_component::open(&path, name, None).unwrap();
            system.add(name, component).unwrap();
        }
        let columns = vec![Column {
            name: "u".into(),
            unit: String::new(),
            values: vec![0.0, 1.0, -1.0],
        }];
        let series = Series {
            texts: Vec::new(),
            note: None,
            comments: Vec::new(),
            time_unit: "s".into(),
            time: vec![0.0, 0.5, 1.0],
            columns,
        };
        system
            .add("table", Box::new(Source::new(series).unwrap()))
            .unwrap();
        system.connect("table.u", "a.u").unwrap();
        system.connect("a.y", "b.u").unwrap();
        system.set("a.k", "2").unwrap();
        let (run, recorder) = simulate(system, 1.0, 0.1, Algorithm::Strong);
        let errors = run
            .report
            .connections
            .iter()
            .map(|own| own.error.unwrap().mean);
        assert!(errors.clone().all(f64::is_finite));
        ["a.y", "b.y"].map(|name| last(&recorder, name))
    };
    let order = "maxOutputDerivativeOrder=\"1\" ";
    let (none, nan) = (run_with("good", ""), run_with("no-slopes", order));
    assert!(none[1].abs() > 0.05, "{none:?}");
    for (none, nan) in none.iter().zip(nan) {
        assert!((none - nan).abs() < 1e-9, "{none} {nan}");
    }
}

/// After initialization no value is got after a set without a step between them.
#[test]
fn no_set_is_followed_by_a_get_without_a_step() {
    let log = Log::default();
    let system = controller_and_integrator(|l| {
        let name = if l.d == 0.0 {
            "integrator"
        } else {
            "controller"
        };
        l.revocable().logged(name, &log)
    });
    let clock = Clock::new(0.0, 0.5, 0.1).unwrap();
    let coupling = Coupling {
        control: Some(Control::new(1e-3, &clock)),
        ..Algorithm::Strong.into()
    };
    simulate(system, 0.5, 0.1, coupling);
    let calls = log.take();
    let end = calls
        .iter()
        .rposition(|call| call.ends_with("exit"))
        .unwrap();
    for name in ["controller", "integrator"] {
        let own = calls[end..]
            .iter()
            .filter_map(|call| call.strip_prefix(name));
        let own: Vec<&str> = own.collect();
        for pair in own.windows(2) {
            assert!(
                !(pair[0].starts_with(".set") && pair[1].starts_with(".get")),
                "{name}: {pair:?}"
            );
        }
        assert!(own.contains(&".restore"));
    }
}

/// A jump of an input from 0 to 1 at 0.55 s, between two points of the clock: steps are rejected until a
/// very short one bridges it, and grow again.
#[test]
fn jumps_are_found_by_the_error() {
    let mut surprise = Signal::new(|t| [f64::from(u8::from(t > 0.55)), 0.0]);
    surprise.gives_slope = false;
    let mut system = System::new();
    let follower = Linear::new(-1.0, 1.0, 1.0, 0.0).revocable().following();
    system.add("table", Box::new(surprise)).unwrap();
    system.add("follower", Box::new(follower)).unwrap();
    system.connect("table.y", "follower.u").unwrap();
    let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
    let coupling = Coupling {
        control: Some(Control::new(1e-4, &clock)),
        ..Algorithm::Strong.into()
    };
    let (run, recorder) = simulate(system, 1.0, 0.1, coupling);
    let error = last(&recorder, "follower.y") - (1.0 - (-0.45_f64).exp());
    assert!(error.abs() < 1e-6, "{error}");
    let steps = run.report.steps;
    assert_eq!(steps.over_tolerance, 0, "{steps:?}");
    assert!(steps.rejected > 3 && steps.accepted < 200, "{steps:?}");
    assert!(steps.shortest < 1e-8 && steps.longest > 0.04, "{steps:?}");
}

/// No step is repeated, and the next ones are shorter: the error is near the tolerance all the same.
#[test]
fn a_component_without_rollback_only_shortens_the_next_steps() {
    let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
    let coupling = Coupling {
        control: Some(Control::new(1e-3, &clock)),
        ..Algorithm::Jacobi.into()
    };
    let (run, recorder) = simulate(controller_and_integrator(|l| l), 1.0, 0.1, coupling);
    let steps = run.report.steps;
    assert_eq!(steps.rejected, 0);
    assert_eq!(run.report.irrevocable, ["controller", "integrator"]);
    let error = (1.0 + last(&recorder, "integrator.y") - 1.0 + (-2.0_f64).exp()).abs();
    assert!(error < 5e-3, "{error}, {steps:?}");
}

#[test]
fn components_of_fixed_steps_are_refused_under_control() {
    let random = RandomLoop::new(1, 2, Abilities::default(), false);
    let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
    let coupling = Coupling {
        control: Some(Control::new(1e-3, &clock)),
        ..Algorithm::Jacobi.into()
    };
    let mut recorder = SeriesRecorder::default();
    let error = run(random.system(), &clock, None, coupling, &mut recorder).unwrap_err();
    assert_eq!(
        error.to_string(),
        "`b0` cannot take communication steps of different lengths, which step-size control needs; \
         run without a tolerance"
    );
}

#[test]
fn couplings_that_cannot_be_are_refused() {
    let refused = |coupling: Coupling| {
        let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
        let system = controller_and_integrator(Linear::revocable);
        let mut recorder = SeriesRecorder::default();
        let result = run(system, &clock, None, coupling, &mut recorder);
        result.unwrap_err().to_string()
    };
    let extrapolation = Coupling {
        extrapolation: Some(3),
        ..Algorithm::Jacobi.into()
    };
    assert_eq!(
        refused(extrapolation),
        "extrapolation of degree 3; the highest is 2"
    );
    let control = Control {
        tolerance: 1e-3,
        min_step: 1.0,
        max_step: 0.1,
    };
    let bounds = Coupling {
        control: Some(control),
        ..Algorithm::Strong.into()
    };
    assert_eq!(
        refused(bounds),
        "step-size control with a tolerance of 0.001 and steps from 1 s to 0.1 s; expected a positive \
         tolerance, and a shortest step that is positive and no longer than the longest"
    );
}
