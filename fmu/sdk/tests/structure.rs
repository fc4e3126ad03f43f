//! Dependencies and derivatives of a model with every kind of dependency.

use pilotage_sdk::structure::{Dependency, Structure, Unknown};
use pilotage_sdk::{At, Equations, Interface, Scalar, Simulation, Table, Unit, Variable};
use proptest::prelude::*;

/// Time, a saturation, a product, a sine, a state without influence.
#[derive(Debug, Clone, Default)]
struct Mixed;

impl Equations for Mixed {
    fn table(&self) -> Table {
        let gain = Variable::parameter(
            "gain",
            Unit::of("1"),
            pilotage_sdk::Role::Tunable,
            0.0,
            "Gain, 0 at first",
        );
        Table::new("mixed", "Every kind of dependency")
            .input("a", "1", "First input")
            .input("b", "1", "Second input")
            .with(gain)
            .parameter("offset", "1", 2.0, "Offset")
            .output("product", "1", "A product that is 0 at first")
            .output("linear", "1", "A sum with fixed factors")
            .output("saturated", "1", "A state within limits")
            .output("clock", "1", "Something of time alone")
            .output_state("x", "1", 0.3, "First state")
            .state("y", "1", 0.0, "Second state")
            .state("idle", "1", 0.0, "A state that does not matter")
            .indicator("z", "1", "x and b")
    }

    fn derivative<T: Scalar>(&self, At { x, u, p, .. }: At<T>, dx: &mut [T]) {
        dx[0] = x[1];
        dx[1] = u[0] * p[0] - x[0].sin() + p[1];
        dx[2] = T::from(0.0);
    }

    fn output<T: Scalar>(&self, At { time, x, u, .. }: At<T>, y: &mut [T]) {
        y[0] = x[1] * u[1];
        y[1] = u[0] * 3.0 - x[1];
        y[2] = if x[0].re() > 0.5 { T::from(0.5) } else { x[0] };
        y[3] = time.cos();
    }

    fn indicators<T: Scalar>(&self, At { x, u, .. }: At<T>, z: &mut [T]) {
        z[0] = x[0] - u[1];
    }
}

/// `unknown: known known! ...`, with `!` for constant factors.
fn lines(table: &Table, unknowns: &[Unknown]) -> String {
    let name = |index: usize| table.variables()[index].name.as_str();
    unknowns
        .iter()
        .map(|u| {
            let on = u.dependencies.iter();
            let on = on.map(|d| format!(" {}{}", name(d.index), if d.constant { "!" } else { "" }));
            format!("{}:{}\n", name(u.index), on.collect::<String>())
        })
        .collect()
}

/// FMI rules 14, 15 and 16: outputs, derivatives and initial unknowns with their dependencies.
#[test]
fn every_dependency_is_found_and_no_other() {
    let table = Mixed.table();
    let structure = Structure::of(&Mixed, &table);
    assert_eq!(
        lines(&table, &structure.outputs),
        "product: b y\nlinear: a! y!\nsaturated: x\nclock: time\nx: x!\n"
    );
    assert_eq!(
        lines(&table, &structure.derivatives),
        "der(x): y!\nder(y): a x\nder(idle):\n"
    );
    assert_eq!(lines(&table, &structure.indicators), "z: b! x!\n");
    assert_eq!(
        lines(&table, &structure.initial),
        "product: b y_start\nlinear: a! y_start!\nsaturated: x_start\nclock: time\nx: x_start!\n\
         y: y_start!\nidle: idle_start!\nder(x): y_start!\nder(y): a gain offset! x_start\nder(idle):\n"
    );
    let ascending = |list: &[Unknown]| list.is_sorted_by_key(|u| u.index);
    assert!(ascending(&structure.initial));
    let knowns_ascend = |u: &Unknown| u.dependencies.is_sorted();
    assert!(structure.initial.iter().all(knowns_ascend));
}

/// FMI rule 3: every change of the interface changes the fingerprint.
#[test]
fn every_change_of_the_interface_changes_the_guid() {
    let base = Mixed.table();
    let mut guids = vec![base.guid()];
    let starts = base.variables().iter().filter(|v| v.start.is_some());
    for i in 0..starts.count() {
        let mut other = base.clone();
        if let Some((_, start)) = other.starts_mut().nth(i) {
            *start = f64::from_bits(start.to_bits() + 1);
        }
        guids.push(other.guid());
    }
    guids.push(base.clone().input("c", "1", "One more").guid());
    guids.push(base.clone().indicator("w", "1", "One more").guid());
    let n = guids.len();
    guids.sort();
    guids.dedup();
    assert_eq!((guids.len(), n), (n, 10));
    assert_eq!(Interface::of(&Mixed).guid, base.guid());
}

#[test]
#[should_panic(expected = "a is declared twice")]
fn names_are_unique() {
    let _ = Mixed.table().input("a", "1", "Again");
}

#[test]
#[should_panic(expected = "unit \"furlong\" cannot be read; write it as in m/s2")]
fn units_are_known() {
    let _ = Table::new("m", "").input("a", "furlong", "");
}

#[test]
#[should_panic(expected = "variable name \"x y\" is no identifier")]
fn names_are_identifiers() {
    let _ = Table::new("m", "").input("x y", "1", "");
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        cases: 64,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// FMI rule 29: directional derivatives agree with differences, and adjoint ones with both.
    #[test]
    fn derivatives_agree_with_differences(
        values in prop::collection::vec(-0.4..0.4_f64, 7),
        seeds in prop::collection::vec(-1.0..1.0_f64, 7),
        weights in prop::collection::vec(-1.0..1.0_f64, 9),
    ) {
        let table = Mixed.table();
        let knowns: Vec<usize> = table.inputs().chain(table.parameters()).chain(table.starts()).collect();
        let unknowns: Vec<usize> = table.outputs().chain(table.derivatives()).chain(table.indicators()).collect();
        let at = |h: f64| {
            let mut simulation = Simulation::new(Mixed);
            simulation.set_time(0.7);
            for ((known, value), seed) in knowns.iter().zip(&values).zip(&seeds) {
                simulation.set(*known, value + h * seed).expect("it is settable");
            }
            let all: Vec<f64> = unknowns.iter().map(|i| simulation.get(*i)).collect();
            (simulation, all)
        };
        let (here, _) = at(0.0);
        let direction: Vec<_> = knowns.iter().copied().zip(seeds.iter().copied()).collect();
        let exact = here.directional_derivative(&unknowns, &direction);
        let h = 1e-5;
        for ((plus, minus), exact) in at(h).1.iter().zip(at(-h).1).zip(&exact) {
            let difference = (plus - minus) / (2.0 * h);
            prop_assert!((difference - exact).abs() < 1e-8, "{difference} {exact}");
        }
        // w · (J s) = (w J) · s
        let weights: Vec<_> = unknowns.iter().copied().zip(weights).collect();
        let adjoint = here.adjoint_derivative(&weights, &knowns);
        let forward: f64 = weights.iter().zip(&exact).map(|((_, w), e)| w * e).sum();
        let backward: f64 = adjoint.iter().zip(&seeds).map(|(a, s)| a * s).sum();
        prop_assert!((forward - backward).abs() < 1e-12);
    }
}

/// Equations that are defined in a part of their inputs' range only, and panic outside it.
#[derive(Default)]
struct Guarded;

impl Equations for Guarded {
    fn table(&self) -> Table {
        Table::new("guarded", "Panics when its input is positive.")
            .input("u", "1", "Input")
            .output_state("x", "1", 0.0, "Integral of the input")
    }

    fn derivative<T: Scalar>(&self, At { u, .. }: At<T>, dx: &mut [T]) {
        assert!(u[0].re() <= 0.0, "u is {}", u[0].re());
        dx[0] = u[0] * u[0];
    }
}

#[test]
fn points_where_the_equations_panic_are_left_out() {
    let table = Guarded.table();
    let structure = Structure::of(&Guarded, &table);
    let on_input = [Dependency {
        index: table.inputs().start,
        constant: false,
    }];
    assert_eq!(structure.derivatives[0].dependencies, on_input);
}

/// A model that is undefined even at its start values.
#[derive(Default)]
struct Impossible;

impl Equations for Impossible {
    fn table(&self) -> Table {
        Table::new("impossible", "Always panics.").output_state("x", "1", 0.0, "State")
    }

    fn derivative<T: Scalar>(&self, _: At<T>, _: &mut [T]) {
        panic!("no \"equations\"");
    }
}

#[test]
fn a_model_that_always_panics_says_so_in_its_interface() {
    let text = pilotage_sdk::interface::text_of::<Impossible>();
    assert_eq!(text.to_str(), Ok(r#"{"panic": "no \"equations\""}"#));
}
