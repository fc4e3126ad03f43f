//! Local errors against those of analytic solutions, and meshes that are refined until they are small.

use num_dual::DualNum;
use pilotage_collocation::{
    Collocation, Differentiated, Loss, ParameterConstraints, Recording, Refined, Run, Scales,
    Scheme, refined, solve, solve_refined,
};
use pilotage_expression::System;
use pilotage_sqp::{Solution, SqpOptions, Status};
use std::ops::ControlFlow;
use std::sync::Arc;

fn uniform(intervals: u32, duration: f64) -> Vec<f64> {
    let at = |k| duration * f64::from(k) / f64::from(intervals);
    (0..=intervals).map(at).collect()
}

/// A run without inputs, of which the first outputs are recorded.
fn run(mesh: Vec<f64>, time: Vec<f64>, values: Vec<Vec<f64>>, initial: &[f64]) -> Run {
    let recorded = |values| Recording {
        values,
        weight: 1.0,
        loss: Loss::Square,
    };
    Run {
        mesh,
        inputs: vec![vec![]; time.len()],
        measured: values.into_iter().map(recorded).collect(),
        initial: initial.iter().map(|x| Some(*x)).collect(),
        time,
        steps: pilotage_collocation::Steps::default(),
    }
}

fn problem(system: &System, scheme: Scheme, run: Run) -> Collocation {
    let scales = Scales {
        states: vec![1.0; system.states],
        parameters: vec![1.0; system.parameters],
    };
    let model = Arc::new(Differentiated::new(system));
    let free = ParameterConstraints::default();
    Collocation::new(model, free, scheme, vec![run], scales, &[])
}

fn solved(problem: &Collocation, z: Vec<f64>) -> Solution {
    let quiet = &mut |_: &_| ControlFlow::Continue(());
    let solution = solve(problem, z, &SqpOptions::default(), quiet);
    assert_eq!(solution.status, Status::Converged, "{:?}", solution.kkt);
    solution
}

fn to_tolerance(problem: Collocation, z: Vec<f64>, tolerance: f64) -> Refined {
    let quiet = &mut |_: &_| ControlFlow::Continue(());
    let found = solve_refined(problem, z, &SqpOptions::default(), (tolerance, 12), quiet);
    let worst = found.errors.iter().flatten().fold(0.0, |m, e| e.max(m));
    assert_eq!(found.solution.status, Status::Converged);
    assert!(worst <= tolerance, "{worst}");
    found
}

/// `ẋ = -λ (x - cos t) - sin t`: `cos t` attracts at the rate λ (Prothero & Robinson, Math. Comp. 28, 1974).
fn attracted(rate: f64) -> System {
    let equations = |at: pilotage_expression::Point<'_>| {
        let rate = (at.time.cos() - at.x[0]) * rate - at.time.sin();
        [vec![rate], vec![]]
    };
    System::trace([1, 0, 0], equations).unwrap()
}

/// The solution from `x` at `from`.
fn flow(rate: f64, (from, to): (f64, f64), x: f64) -> f64 {
    to.cos() + (x - from.cos()) * (-rate * (to - from)).exp()
}

const SCHEMES: [Scheme; 9] = [
    Scheme::Euler,
    Scheme::Trapezoid,
    Scheme::HermiteSimpson,
    Scheme::Gauss(1),
    Scheme::Gauss(2),
    Scheme::Radau(2),
    Scheme::Lobatto(3),
    Scheme::Bernstein(3),
    Scheme::FiniteDifference(3),
];

/// The problem from 0 to 1 with samples at its ends, or between the mesh's boundaries too; its solution.
fn simulated(rate: f64, scheme: Scheme, intervals: u32, between: bool) -> (Collocation, Vec<f64>) {
    let mesh = uniform(intervals, 1.0);
    let mut time = mesh.clone();
    if between {
        time.extend(mesh.windows(2).map(|ends| 0.7 * ends[0] + 0.3 * ends[1]));
        time.sort_by(f64::total_cmp);
    }
    let problem = problem(&attracted(rate), scheme, run(mesh, time, vec![], &[1.5]));
    let states = vec![vec![vec![1.0]; problem.runs[0].time.len()]];
    let z = problem.variables(&states, &[]);
    let solution = solved(&problem, z);
    (problem, solution.iterate.z)
}

#[test]
fn local_errors_are_those_of_the_exact_solution() {
    for scheme in SCHEMES {
        for (rate, between) in [(1.0, false), (1.0, true), (8.0, true), (40.0, false)] {
            let (problem, z) = simulated(rate, scheme, 10, between);
            let (time, mesh) = (&problem.runs[0].time, &problem.runs[0].mesh);
            let states = problem.states_at_samples(&z, 0);
            let at = |t: f64| states[time.iter().position(|s| *s == t).unwrap()][0];
            let largest = mesh.iter().fold(0.0_f64, |m, t| m.max(at(*t).abs()));
            let found = problem.mesh_errors(&z, 1e-8, &|| false).remove(0);
            assert_eq!(found.len(), 10);
            for (ends, found) in mesh.windows(2).zip(found) {
                let stops = time.iter().filter(|t| (ends[0]..=ends[1]).contains(t));
                let errors = stops.map(|t| at(*t) - flow(rate, (ends[0], *t), at(ends[0])));
                let exact = errors.fold(0.0_f64, |m, e| m.max(e.abs())) / (largest + 1e-3);
                let error = (found - exact).abs();
                assert!(error < 1e-9 + 1e-6 * exact, "{scheme}: {found} for {exact}");
            }
        }
    }
}

/// `ẋ = u - x` where u jumps from 1 to -1 at 0.5, which is a boundary of the mesh.
#[test]
fn inputs_jump_where_errors_are_estimated() {
    let system = System::trace([1, 1, 0], |at| [vec![at.u[0] - at.x[0]], vec![]]).unwrap();
    let mut own = run(
        vec![0.0, 0.5, 1.0],
        vec![0.0, 0.5, 0.5, 1.0],
        vec![],
        &[0.0],
    );
    own.inputs = [1.0, 1.0, -1.0, -1.0].map(|u| vec![u]).to_vec();
    let problem = problem(&system, Scheme::Gauss(2), own);
    let z = problem.variables(&[vec![vec![0.5]; 4]], &[]);
    let z = solved(&problem, z).iterate.z;
    let x: Vec<f64> = problem.states_at_samples(&z, 0).concat();
    let decay = (-0.5_f64).exp();
    let exact = [1.0 - decay, (x[1] + 1.0) * decay - 1.0];
    let largest = x.iter().fold(0.0_f64, |m, x| m.max(x.abs())) + 1e-3;
    let found = &problem.mesh_errors(&z, 1e-8, &|| false)[0];
    for (found, error) in found.iter().zip([x[1] - exact[0], x[3] - exact[1]]) {
        assert!(
            (found - error.abs() / largest).abs() < 1e-9,
            "{found} {error}"
        );
        assert!(*found > 1e-6);
    }
}

/// One power more than the order; than the degree of the interpolant where there are samples within the intervals.
#[test]
fn local_errors_fall_with_the_order_of_the_scheme() {
    for scheme in SCHEMES {
        for between in [false, true] {
            let intervals = if scheme.order() > 4 { 3 } else { 12 };
            // Of the first interval, which begins alike.
            let error = |intervals: u32| {
                let (problem, z) = simulated(2.0, scheme, intervals, between);
                problem.mesh_errors(&z, 1e-8, &|| false)[0][0]
            };
            let order = if between {
                scheme.degree()
            } else {
                scheme.order()
            };
            let found = (error(intervals) / error(2 * intervals)).log2();
            let expected = order as f64 + 1.0;
            assert!(
                (found - expected).abs() < 0.6,
                "{scheme}, {between}: {found} for {expected}"
            );
        }
    }
}

#[test]
fn intervals_are_divided_as_the_order_asks_for() {
    let mut own = run(vec![0.0, 1.0, 3.0, 4.0], vec![0.0, 2.0, 4.0], vec![], &[]);
    let mesh = |own: &Run, errors: &[f64]| refined(own, errors, Scheme::Radau(2), 1e-6);
    // Order 3, aiming at half of the tolerance: an error of 80 times that takes 80^(1/4), so 3 parts.
    assert_eq!(
        mesh(&own, &[1e-6, 0.0, 40e-6]),
        [0.0, 1.0, 3.0, 3.0 + 1.0 / 3.0, 3.0 + 2.0 / 3.0, 4.0]
    );
    assert_eq!(mesh(&own, &[f64::INFINITY, 0.0, 0.0]).len(), 4 + 15);
    assert_eq!(
        mesh(&own, &[2e-6, 2e-6, f64::NAN]),
        [0.0, 0.5, 1.0, 2.0, 3.0, 4.0]
    );
    // Gauss's method with three stages has the order 6, but draws cubics.
    own.time = vec![0.0, 0.5, 4.0];
    let parts = |order: f64| (1e3_f64 / 0.5).powf(1.0 / (order + 1.0)).ceil() as usize;
    let finer = refined(&own, &[1e-3, 0.0, 1e-3], Scheme::Gauss(3), 1e-6);
    assert_eq!(finer.len(), 4 + (parts(3.0) - 1) + (parts(6.0) - 1));
}

/// A transient of 1 ms, then a second of calm.
#[test]
fn a_fast_transient_is_resolved_and_the_calm_is_not() {
    for scheme in [
        Scheme::HermiteSimpson,
        Scheme::Radau(3),
        Scheme::Bernstein(2),
    ] {
        let coarse = run(uniform(4, 1.0), vec![0.0, 1.0], vec![], &[1.5]);
        let coarse = problem(&attracted(1000.0), scheme, coarse);
        let z = coarse.variables(&[vec![vec![1.0]; 2]], &[]);
        let found = to_tolerance(coarse, z, 1e-7);
        let problem = &found.problem;
        let intervals = problem.runs[0].mesh.len() - 1;
        let error = |problem: &Collocation, z: &[f64]| {
            let mut dense = problem.clone();
            dense.runs[0].time = problem.runs[0].mesh.clone();
            dense.runs[0].inputs = vec![vec![]; dense.runs[0].time.len()];
            let dense = dense.with_meshes(vec![problem.runs[0].mesh.clone()]);
            let states = dense.states_at_samples(z, 0);
            let errors = dense.runs[0].time.iter().zip(states);
            errors.fold(0.0_f64, |m, (t, x)| {
                m.max((x[0] - flow(1000.0, (0.0, *t), 1.5)).abs())
            })
        };
        let own = error(problem, &found.solution.iterate.z);
        assert!(own < 1e-5, "{scheme}: {own} with {intervals} intervals");
        // Uniform, with three times as many.
        let mesh = uniform(3 * intervals as u32, 1.0);
        let even = problem.with_meshes(vec![mesh]);
        let z = even.variables(&[vec![vec![1.0]; 2]], &[]);
        let uniform = error(&even, &solved(&even, z).iterate.z);
        assert!(
            uniform > 100.0 * own,
            "{scheme}: {uniform} and {own}, {intervals}"
        );
    }
}

/// Where Van der Pol's oscillator with μ = 10 is 20 s after (2, 0): Taylor series of order 24 with 40 digits, in steps of
/// 5 ms and 4 ms alike.
const END: [f64; 2] = [1.939_358_532_782_651_7, -0.070_081_505_735_807_4];

/// Past two of its jumps.
#[test]
fn the_jumps_of_a_relaxation_oscillation_are_found() {
    let system = System::trace([2, 0, 0], |at| {
        let (x, v) = (at.x[0], at.x[1]);
        [vec![v, (-x * x + 1.0) * v * 10.0 - x], vec![]]
    })
    .unwrap();
    let time = uniform(40, 20.0);
    let run = run(time.clone(), time, vec![], &[2.0, 0.0]);
    let states = vec![Differentiated::new(&system).simulate(&run, &[], &[2.0, 0.0])];
    let coarse = problem(&system, Scheme::Radau(3), run);
    let z = coarse.variables(&states, &[]);
    let found = to_tolerance(coarse, z, 1e-7);
    let intervals = found.problem.runs[0].mesh.len() - 1;
    let end = |problem: &Collocation, z: &[f64]| problem.states_at_samples(z, 0)[40].clone();
    let own = end(&found.problem, &found.solution.iterate.z);
    let error = |x: &[f64]| (x[0] - END[0]).abs().max((x[1] - END[1]).abs());
    assert!(error(&own) < 1e-5, "{own:?} with {intervals} intervals");
    // A uniform mesh with twice as many is far worse.
    let even = found
        .problem
        .with_meshes(vec![uniform(2 * intervals as u32, 20.0)]);
    let z = found.problem.carried(&found.solution.iterate.z, &even);
    let uniform = end(&even, &solved(&even, z).iterate.z);
    assert!(
        error(&uniform) > 10.0 * error(&own),
        "{uniform:?} {own:?} {intervals}"
    );
}

/// `ẋ = -1000 (x - y)`, `ẏ = -θ x` with six samples of y, whose sum of exponentials is known.
#[test]
fn a_parameter_of_a_stiff_model_comes_from_few_samples() {
    let (fast, theta) = (1000.0_f64, 0.7_f64);
    let system = System::trace([2, 0, 1], |at| {
        let (x, y) = (at.x[0], at.x[1]);
        [vec![(y - x) * fast, -at.p[0] * x], vec![y]]
    });
    // The roots of s² + 1000 s + 1000 θ, the slow one without cancellation; x(0) = 0, y(0) = 1, ẏ(0) = 0.
    let quick = -0.5 * (fast + (fast * fast - 4.0 * fast * theta).sqrt());
    let slow = fast * theta / quick;
    let exact = |t: f64| ((slow * t).exp() * quick - (quick * t).exp() * slow) / (quick - slow);
    let time = uniform(5, 4.0);
    let values = time.iter().map(|t| exact(*t)).collect();
    let run = run(time.clone(), time, vec![values], &[0.0, 1.0]);
    let coarse = problem(&system.unwrap(), Scheme::Radau(3), run);
    let z = coarse.variables(&[vec![vec![1.0, 1.0]; 6]], &[1.0]);
    let on_samples = solved(&coarse, z.clone()).iterate.z;
    let error = |problem: &Collocation, z: &[f64]| (problem.physical_theta(z)[0] - theta).abs();
    assert!(error(&coarse, &on_samples) > 2e-6);
    let found = to_tolerance(coarse, z, 1e-8);
    let own = error(&found.problem, &found.solution.iterate.z);
    let intervals = found.problem.runs[0].mesh.len() - 1;
    assert!(
        own < 1e-6 && intervals < 200,
        "{own} with {intervals} intervals"
    );
}

/// What is carried are the same states where the other mesh divides this one, and the same variables on the same mesh,
/// in their scales.
#[test]
fn a_solution_is_carried_onto_other_meshes_and_scales() {
    for scheme in SCHEMES {
        let (problem, z) = simulated(3.0, scheme, 8, true);
        let same = problem.carried(&z, &problem);
        let distance = |a: &[f64], b: &[f64]| {
            a.iter()
                .zip(b)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()))
        };
        assert!(distance(&same, &z) < 1e-13, "{scheme}");
        let mut other = problem.clone();
        other.model.scales.states[0] = 4.0;
        let other = other.with_meshes(vec![uniform(8, 1.0)]);
        let scaled: Vec<f64> = problem
            .carried(&z, &other)
            .iter()
            .map(|x| 4.0 * x)
            .collect();
        assert!(distance(&scaled, &z) < 1e-13, "{scheme}");
        let finer = problem.with_meshes(vec![uniform(16, 1.0)]);
        let carried = problem.carried(&z, &finer);
        let states = |problem: &Collocation, z: &[f64]| problem.states_at_samples(z, 0).concat();
        let (after, before) = (states(&finer, &carried), states(&problem, &z));
        // Every other sample is on a boundary; between them only polynomials as such are the same.
        let step = if matches!(scheme, Scheme::Bernstein(_)) {
            1
        } else {
            2
        };
        let pairs = after.iter().zip(&before).step_by(step);
        let change = pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(change < 1e-13, "{scheme}: {change}");
        let begin = finer.runs[0].initial[0].unwrap();
        assert_eq!(finer.coefficients(&carried, 0)[0], begin);
    }
}
