//! Jacobi and Gauss-Seidel are the textbook's, to the last bit and to their order.

use super::components::{Linear, Log, Sum, simulate};
use pilotage::cosim::{Algorithm, Coupling, Ending, System, Transfer};

/// `u = 2 (1 - y)`: a P controller, without state.
fn controller() -> Linear {
    Linear::new(0.0, 0.0, 0.0, -2.0)
}

/// Two states in a loop, without direct feedthrough.
fn loop_of_two() -> (Linear, Linear) {
    let first = Linear::new(-1.0, 1.0, 1.0, 0.0).from(1.0);
    let second = Linear::new(-0.5, -2.0, 1.0, 0.0).from(0.25);
    (first, second)
}

fn wired(first: Linear, second: Linear) -> System {
    let mut system = System::new();
    system.add("first", Box::new(first)).unwrap();
    system.add("second", Box::new(second)).unwrap();
    system.connect("first.y", "second.u").unwrap();
    system.connect("second.y", "first.u").unwrap();
    system
}

#[test]
fn both_are_the_textbook_to_the_last_bit() {
    const STEPS: usize = 50;
    const H: f64 = 0.1;
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel] {
        let (mut a, mut b) = loop_of_two();
        let mut expected = vec![(a.y(), b.y())];
        for _ in 0..STEPS {
            let (y_a, y_b) = (a.y(), b.y());
            a.u = y_b;
            a.advance(H);
            b.u = match algorithm {
                Algorithm::Jacobi => y_a,
                _ => a.y(),
            };
            b.advance(H);
            expected.push((a.y(), b.y()));
        }
        let (first, second) = loop_of_two();
        let (run, recorder) = simulate(wired(first, second), STEPS as f64 * H, H, algorithm);
        assert!(matches!(run.ending, Ending::Completed));
        assert_eq!(run.order, ["first", "second"]);
        let [y_a, y_b] = &recorder.series.columns[..] else {
            panic!("two signals")
        };
        let found: Vec<_> = y_a
            .values
            .iter()
            .copied()
            .zip(y_b.values.iter().copied())
            .collect();
        assert_eq!(found, expected, "{algorithm}");
        let times: Vec<f64> = (0..=STEPS).map(|k| k as f64 * H).collect();
        assert_eq!(recorder.series.time, times);
    }
}

/// The published example: P controller and integrator, h = 0.1 s, y(1) (exact: 0.864665). All masters
/// that exchange once a step get 0.953920; Gauss-Seidel from the controller on gets 0.892626.
#[test]
fn known_values_of_controller_and_integrator() {
    let y_at_1 = |algorithm| {
        let mut system = System::new();
        // `1 - y` as state of the integrator, so that the loop needs no constant.
        let integrator = Linear::new(0.0, 1.0, 1.0, 0.0).from(-1.0);
        system.add("controller", Box::new(controller())).unwrap();
        system.add("integrator", Box::new(integrator)).unwrap();
        system.connect("integrator.y", "controller.u").unwrap();
        system.connect("controller.y", "integrator.u").unwrap();
        let (_, recorder) = simulate(system, 1.0, 0.1, algorithm);
        let y = recorder.series.column("integrator.y").unwrap();
        1.0 + y.values[10]
    };
    assert!((y_at_1(Algorithm::Jacobi) - 0.953_920).abs() < 5e-7);
    assert!((y_at_1(Algorithm::GaussSeidel) - 0.892_626).abs() < 5e-7);
}

/// Error of the loop of two against its matrix exponential at t = 1.
fn error(h: f64, algorithm: Algorithm) -> f64 {
    // ẋ = [[-1, 1], [-2, -0.5]] x from [1, 0.25]: a fine Taylor series of the exponential.
    let matrix = [[-1.0, 1.0], [-2.0, -0.5]];
    let mut term = [1.0, 0.25];
    let mut exact = term;
    for k in 1..40 {
        let product = [0, 1].map(|i| matrix[i][0] * term[0] + matrix[i][1] * term[1]);
        term = product.map(|p| p / f64::from(k));
        exact = [exact[0] + term[0], exact[1] + term[1]];
    }
    let (first, second) = loop_of_two();
    let (_, recorder) = simulate(wired(first, second), 1.0, h, algorithm);
    let last = |column: usize| *recorder.series.columns[column].values.last().unwrap();
    (last(0) - exact[0]).hypot(last(1) - exact[1])
}

#[test]
fn both_are_of_first_order() {
    for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel] {
        for h in [1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0] {
            let order = (error(h, algorithm) / error(h / 2.0, algorithm)).log2();
            assert!((order - 1.0).abs() < 0.05, "{algorithm}, h = {h}: {order}");
        }
    }
}

#[test]
fn calls_stand_in_the_standards_order() {
    let calls = |algorithm| {
        let log = Log::default();
        let mut system = System::new();
        let first = Linear::new(-1.0, 1.0, 1.0, 0.0).logged("a", &log);
        let second = Linear::new(-1.0, 1.0, 1.0, 0.0).logged("b", &log);
        system.add("a", Box::new(first)).unwrap();
        system.add("b", Box::new(second)).unwrap();
        system.connect("a.y", "b.u").unwrap();
        system.set("a.x0", "3").unwrap();
        system.set("a.u", "0.5").unwrap();
        simulate(system, 1.0, 1.0, algorithm);
        log.take().join(" ")
    };
    let begin = "a.setup b.setup a.set x0 a.enter b.enter a.set u a.get y b.set u a.exit b.exit \
                 a.get y b.get y";
    assert_eq!(
        calls(Algorithm::Jacobi),
        format!("{begin} b.set u a.step b.step a.get y b.get y a.terminate b.terminate")
    );
    assert_eq!(
        calls(Algorithm::GaussSeidel),
        format!("{begin} a.step a.get y b.set u b.step b.get y a.terminate b.terminate")
    );
}

/// The Gauss-Seidel order of components with or without feedthrough, wired as given.
fn order(components: &[(&str, bool)], wires: &[(&str, &str)]) -> String {
    let mut system = System::new();
    for (name, has_feedthrough) in components {
        let d = if *has_feedthrough { 1.0 } else { 0.0 };
        system
            .add(*name, Box::new(Linear::new(-1.0, 1.0, 0.5, 0.1 * d)))
            .unwrap();
    }
    for (from, to) in wires {
        system
            .connect(&format!("{from}.y"), &format!("{to}.u"))
            .unwrap();
    }
    simulate(system, 1.0, 1.0, Algorithm::GaussSeidel)
        .0
        .order
        .join(" ")
}

#[test]
fn dependencies_give_the_gauss_seidel_order() {
    // Feedthrough waits for what feeds it, whatever the order of the command line.
    assert_eq!(
        order(&[("a", true), ("b", false)], &[("b", "a"), ("a", "b")]),
        "b a"
    );
    assert_eq!(
        order(
            &[("c", true), ("b", true), ("a", false)],
            &[("a", "b"), ("b", "c"), ("c", "a")]
        ),
        "a b c"
    );
    // Without feedthrough, along the wires.
    assert_eq!(
        order(
            &[("c", false), ("b", false), ("a", false)],
            &[("a", "b"), ("b", "c")]
        ),
        "a b c"
    );
    // A loop without feedthrough, and a loop of feedthrough: as they were added.
    assert_eq!(
        order(&[("b", false), ("a", false)], &[("b", "a"), ("a", "b")]),
        "b a"
    );
    assert_eq!(
        order(&[("b", true), ("a", true)], &[("b", "a"), ("a", "b")]),
        "b a"
    );
    // Nothing is wired.
    assert_eq!(order(&[("b", true), ("a", false)], &[]), "b a");
}

/// Two components in a loop are coupled more tightly when one takes its steps in parts: its inputs go on
/// within the step instead of standing still.
#[test]
fn parts_of_steps_follow_the_inputs() {
    let log = Log::default();
    let system = |parts| {
        let mut system = System::new();
        let a = Linear::new(-1.0, 1.0, 1.0, 0.0).from(1.0).revocable();
        let b = Linear::new(-9.0, 9.0, 1.0, 0.0)
            .revocable()
            .logged("b", &log);
        system.add("a", Box::new(a)).unwrap();
        system.add("b", Box::new(b)).unwrap();
        system.connect("a.y", "b.u").unwrap();
        system.set_parts("b", parts).unwrap();
        system
    };
    // x_b of ẋ_a = -x_a, ẋ_b = 9 (x_a - x_b) from (1, 0).
    let exact = 9.0 / 8.0 * ((-1.0_f64).exp() - (-9.0_f64).exp());
    let coupling = Coupling {
        extrapolation: Some(1),
        ..Algorithm::GaussSeidel.into()
    };
    let error = |parts| {
        log.take();
        let (_, recorder) = simulate(system(parts), 1.0, 0.125, coupling);
        let b = recorder.series.column("b.y").unwrap();
        let steps = log.take().iter().filter(|call| *call == "b.step").count();
        assert_eq!(steps, 8 * parts as usize);
        (b.values[8] - exact).abs()
    };
    // What is left with many parts is that the input goes along straight lines between the points.
    let left = error(64);
    let errors = [1, 2, 4].map(|parts| error(parts) - left);
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.2, "{errors:?}, {left}");
    }
    assert_eq!(
        System::new().set_parts("c", 0).unwrap_err().to_string(),
        "`c` cannot take a step in 0 parts; 1 is the communication step itself"
    );
    assert_eq!(
        system(1).set_parts("c", 2).unwrap_err().to_string(),
        "`c`: there is no instance `c`, known are `a`, `b`"
    );
}

/// Of three components that all feed each other, the order is the one with the fewest late values; in rings
/// of many components it is found by a rule.
#[test]
fn cycles_are_broken_where_the_least_is_late() {
    // b feeds c and a, c feeds a; a closes the ring to b: only a -> b is late in b c a.
    let mut system = System::new();
    for name in ["a", "b", "c"] {
        system.add(name, Box::new(Sum::new())).unwrap();
    }
    for (from, to) in [
        ("b.y", "c.u0"),
        ("b.y", "a.u0"),
        ("c.y", "a.u1"),
        ("a.y", "b.u0"),
    ] {
        system.connect(from, to).unwrap();
    }
    let (run, _) = simulate(system, 1.0, 1.0, Algorithm::GaussSeidel);
    assert_eq!(run.order, ["b", "c", "a"]);
    let late: Vec<_> = (run.report.connections.iter())
        .filter(|c| c.transfer == Transfer::Held)
        .map(|c| (c.from.as_str(), c.to.as_str(), c.lag))
        .collect();
    assert_eq!(late, [("a.y", "b.u0", 0.5)]);
    let mut ring = System::new();
    for k in (0..30).rev() {
        ring.add(format!("s{k}"), Box::new(Sum::new())).unwrap();
    }
    for k in 0..30 {
        ring.connect(&format!("s{k}.y"), &format!("s{}.u0", (k + 1) % 30))
            .unwrap();
    }
    let (run, _) = simulate(ring, 1.0, 1.0, Algorithm::GaussSeidel);
    let late = run
        .report
        .connections
        .iter()
        .filter(|c| c.transfer == Transfer::Held);
    assert_eq!(late.count(), 1);
}

/// 200 components in a ring, by every algorithm: all give what the first-order equations give.
#[test]
fn two_hundred_components_in_one_system() {
    const N: usize = 200;
    let ring = || {
        let mut system = System::new();
        for k in 0..N {
            // ẋ = -2 x + u, one of them started.
            let x = if k == 0 { 1.0 } else { 0.0 };
            let component = Linear::new(-2.0, 1.0, 1.0, 0.0).from(x).revocable();
            system.add(format!("s{k}"), Box::new(component)).unwrap();
        }
        for k in 0..N {
            let to = format!("s{}.u", (k + 1) % N);
            system.connect(&format!("s{k}.y"), &to).unwrap();
        }
        system
    };
    // Without the return around the ring, too small to be seen: x_k = t^k/k! e^{-2t}.
    let exact = |k: u32| (-2.0_f64).exp() / (1..=k).map(f64::from).product::<f64>();
    for (algorithm, tolerance) in [
        (Algorithm::Jacobi, 0.02),
        (Algorithm::GaussSeidel, 0.02),
        (Algorithm::Strong, 2e-4),
    ] {
        let (run, recorder) = simulate(ring(), 1.0, 1.0 / 32.0, algorithm);
        assert_eq!((run.steps, run.report.instances.len()), (32, N));
        for k in 0..6 {
            let found = recorder.series.columns[k as usize].values[32];
            assert!(
                (found - exact(k)).abs() < tolerance,
                "{algorithm} {k}: {found}"
            );
        }
    }
}

/// Jacobi on several threads: the same bits as on one.
#[test]
fn parallel_steps_change_nothing() {
    let fly = |parallel| {
        let mut system = System::new();
        for k in 0..9 {
            let block = Linear::new(-1.0 - 0.1 * f64::from(k), 1.0, 1.0, 0.0).from(f64::from(k));
            system.add(format!("s{k}"), Box::new(block)).unwrap();
        }
        for k in 0..9 {
            let from = format!("s{k}.y");
            system
                .connect(&from, &format!("s{}.u", (k + 1) % 9))
                .unwrap();
        }
        let coupling = Coupling {
            parallel,
            ..Algorithm::Jacobi.into()
        };
        let (run, recorder) = simulate(system, 1.0, 0.01, coupling);
        assert_eq!(run.steps, 100);
        let columns = recorder.series.columns.into_iter();
        columns
            .flat_map(|column| column.values.into_iter().map(f64::to_bits))
            .collect::<Vec<u64>>()
    };
    let bits = fly(false);
    assert_eq!(bits.len(), 9 * 101);
    assert_eq!(fly(true), bits);
}

/// Components that panic while others step on other threads: the panic arrives where the run was asked for.
#[test]
#[should_panic(expected = "as it was told")]
fn a_panic_in_a_parallel_step_is_one_of_the_run() {
    let mut system = System::new();
    for name in ["a", "b", "c"] {
        let mut component = Linear::new(0.0, 1.0, 1.0, 0.0);
        component.panics = name == "b";
        system.add(name, Box::new(component)).unwrap();
    }
    let coupling = Coupling {
        parallel: true,
        ..Algorithm::Jacobi.into()
    };
    simulate(system, 1.0, 0.1, coupling);
}
