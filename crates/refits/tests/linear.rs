//! Refits of a line `x(t) = c + b t + a u(t)`, whose least squares have a formula.

use nalgebra::{DMatrix, DVector};
use pilotage_collocation::{
    Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme,
};
use pilotage_expression::System;
use pilotage_refits::bootstrap::{counts, random};
use pilotage_refits::study::{Study, Unknown};
use pilotage_refits::{
    Collocated, Coordinate, End, Kind, Profile, Solved, Sought, Threshold, Watch, profile, spread,
};
use pilotage_sqp::{SqpOptions, Status};
use rand_distr::{Distribution, StandardNormal};
use std::ops::ControlFlow;
use std::sync::Arc;

const SAMPLES: usize = 12;
const OPEN: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
const THRESHOLD: Threshold = Threshold {
    noise: 0.3,
    root: 2.1,
};

/// A regressor with a corner: the derivative of the line jumps there, and a node is there, too.
fn u(k: usize) -> f64 {
    if k < 5 { 0.0 } else { (k - 5) as f64 }
}

/// Run `j`: `ẋ = b + a v` with `v = u̇`, a parameter that does nothing, and `x(0)` free.
fn run(j: usize) -> Run {
    let mut random = random(7, j as u64);
    // Of two samples of one time the first is before a jump of the input.
    let samples: Vec<(usize, f64)> = (0..SAMPLES)
        .flat_map(|k| {
            if k == 5 {
                vec![(k, 0.0), (k, 1.0)]
            } else {
                vec![(k, f64::from(u8::from(k > 5)))]
            }
        })
        .collect();
    let value = |(i, (k, _)): (usize, &(usize, f64))| {
        let noise: f64 = StandardNormal.sample(&mut random);
        let x = 1.0 + 0.4 * *k as f64 - 0.7 * u(*k) + 0.5 * noise;
        if i == 6 { f64::NAN } else { x }
    };
    Run {
        mesh: (0..SAMPLES).map(|k| k as f64).collect(),
        time: samples.iter().map(|(k, _)| *k as f64).collect(),
        inputs: samples.iter().map(|(_, v)| vec![*v]).collect(),
        measured: vec![Recording {
            values: samples.iter().enumerate().map(value).collect(),
            weight: 1.0,
            loss: Loss::Square,
        }],
        initial: vec![None],
        steps: pilotage_collocation::Steps::default(),
    }
}

fn solved(runs: usize, constraints: ParameterConstraints) -> Solved {
    let line = System::trace([1, 1, 3], |at| {
        [
            vec![at.p[0] + at.p[1] * at.u[0] + at.p[2] * 0.0],
            vec![at.x[0]],
        ]
    });
    let model = Arc::new(Differentiated::new(&line.unwrap()));
    let scales = Scales {
        states: vec![1.0],
        parameters: vec![1.0; 3],
    };
    let runs: Vec<Run> = (0..runs).map(run).collect();
    let problem = Collocation::new(model, constraints, Scheme::Trapezoid, runs, scales, &[]);
    let options = SqpOptions::default();
    let z = vec![0.1; problem.layout.theta + 3];
    let found =
        pilotage_collocation::solve(&problem, z, &options, &mut |_| ControlFlow::Continue(()));
    assert_eq!(found.status, Status::Converged);
    Solved {
        problem,
        at: found.iterate,
        options,
    }
}

/// The regressors of `b`, `a` and each run's `c`, a row for each value; the values.
fn regression(runs: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for (place, j) in runs.iter().enumerate() {
        let own = run(*j);
        for (t, y) in own
            .time
            .iter()
            .zip(&own.measured[0].values)
            .filter(|(_, y)| y.is_finite())
        {
            let mut row = vec![0.0; 2 + runs.len()];
            (row[0], row[1], row[2 + place]) = (*t, u(*t as usize), 1.0);
            rows.push(DVector::from_vec(row).transpose());
            values.push(*y);
        }
    }
    (DMatrix::from_rows(&rows), DVector::from_vec(values))
}

fn sought(at: Coordinate, range: [f64; 2]) -> Sought {
    Sought {
        at,
        step: 0.2,
        range,
    }
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() < tolerance,
        "{found} is not {expected}"
    );
}

#[test]
fn profiles_of_a_linear_model_are_straight_and_end_where_formulas_say() {
    let solved = solved(2, ParameterConstraints::default());
    let all = [
        Coordinate::Shared(0),
        Coordinate::Shared(1),
        Coordinate::Initial { run: 0, state: 0 },
        Coordinate::Initial { run: 1, state: 0 },
    ];
    let found = profile(
        &solved,
        &all.map(|at| sought(at, OPEN)),
        THRESHOLD,
        &Watch::default(),
    );
    let (x, y) = regression(&[0, 1]);
    let covariance = x.tr_mul(&x).try_inverse().unwrap();
    let estimate = &covariance * x.tr_mul(&y);
    for (i, own) in found.iter().enumerate() {
        let sd = (THRESHOLD.noise * covariance[(i, i)]).sqrt();
        for point in &own.points {
            assert_near(point.root, (point.value - estimate[i]) / sd, 1e-5);
        }
        for (end, sign) in own.ends.iter().zip([-1.0, 1.0]) {
            let End::Crossed(end) = *end else {
                panic!("{end:?}")
            };
            assert_near(end, estimate[i] + sign * THRESHOLD.root * sd, 1e-6);
        }
        assert_eq!(own.lower, None);
    }
}

/// The line with a bound `a ≥ limit` that holds from some `b` on: there least squares are those with `a = limit`.
#[test]
fn points_on_which_another_parameter_meets_its_bound_are_marked() {
    let free = solved(1, ParameterConstraints::default());
    let limit = free.at.z[free.problem.layout.theta + 1] - 0.05;
    let bound = ParameterConstraints::trace(3, |p| vec![p[1] - limit]).unwrap();
    let solved = solved(1, bound);
    let own = sought(Coordinate::Shared(0), OPEN);
    let found: Profile = profile(&solved, &[own], THRESHOLD, &Watch::default()).remove(0);
    let (x, y) = regression(&[0]);
    let (mut on, mut off) = (0, 0);
    for point in &found.points {
        let squares = |held: bool| {
            // Without the columns that are fixed.
            let mut rest = &y - x.column(0) * point.value;
            let columns: Vec<usize> = if held { vec![2] } else { vec![1, 2] };
            if held {
                rest -= x.column(1) * limit;
            }
            let x = x.select_columns(&columns);
            let solution = x.tr_mul(&x).try_inverse().unwrap() * x.tr_mul(&rest);
            let is_within = held || solution[0] >= limit;
            ((&rest - x * solution).norm_squared(), is_within)
        };
        let is_held = !squares(false).1;
        assert_eq!(
            point.constraints,
            if is_held { vec![0] } else { vec![] },
            "{point:?}"
        );
        // A constraint holds with a clearance of 1e-7.
        assert_near(point.objective, squares(is_held).0, 1e-5);
        if is_held { on += 1 } else { off += 1 }
    }
    assert!(on > 1 && off > 1, "{on} {off}");
}

#[test]
fn ends_of_ranges_and_what_has_no_effect_are_told() {
    let solved = solved(1, ParameterConstraints::default());
    let b = solved.at.z[solved.problem.layout.theta];
    let within = sought(Coordinate::Shared(0), [b - 0.01, f64::INFINITY]);
    let nothing = sought(Coordinate::Shared(2), OPEN);
    let found = profile(&solved, &[within, nothing], THRESHOLD, &Watch::default());
    assert_eq!(found[0].ends[0], End::Range(b - 0.01));
    assert!(matches!(found[0].ends[1], End::Crossed(_)));
    assert!(
        matches!(found[1].ends, [End::Open(_), End::Open(_)]),
        "{:?}",
        found[1].ends
    );
    let stopped = Watch {
        stops: &|| true,
        done: &|| (),
    };
    let found = profile(&solved, &[within], THRESHOLD, &stopped);
    assert!(matches!(found[0].ends[1], End::Stopped(_)));
}

/// An estimate from which the search was ended too early has a lower objective beside it.
#[test]
fn a_better_optimum_is_told() {
    let mut solved = solved(1, ParameterConstraints::default());
    solved.at.f += 1.0;
    let own = sought(Coordinate::Shared(0), OPEN);
    let found = profile(&solved, &[own], THRESHOLD, &Watch::default());
    let lower = found[0].lower.expect("it is lower");
    assert!(found[0].points[lower].objective < solved.at.f);
}

fn study(runs: usize) -> Study<'static> {
    let solved = solved(runs, ParameterConstraints::default());
    let whole = solved.problem.runs.clone();
    let unknown = |k: usize| Unknown {
        name: format!("p{k}"),
        label: None,
        at: Coordinate::Shared(k),
        is_log: false,
        half: 0.2,
        range: OPEN,
        informed_by: vec![true; runs],
    };
    Study {
        unknowns: (0..2).map(unknown).collect(),
        factor: 1.0,
        threshold: THRESHOLD,
        degrees: None,
        constraints: Vec::new(),
        bounds: Vec::new(),
        is_predicted: false,
        derived: vec!["difference".to_owned()],
        derive: Box::new(|theta| vec![theta[0] - theta[1]]),
        solved: Box::new(Collocated {
            solved,
            signals: 1,
            simulate: Box::new(move |_| whole.clone()),
        }),
    }
}

/// A run that is drawn twice stands twice in the least squares.
#[test]
fn replicates_are_the_least_squares_of_the_runs_that_are_drawn() {
    let study = study(5);
    let numbers = [3, 0, 8];
    let found = study.bootstrap((Kind::Runs, 11), &numbers, &|_| (), &Watch::default());
    for (number, own) in numbers.iter().zip(&found) {
        let drawn = counts(5, &mut random(11, *number));
        let (mut x, mut y): (Vec<_>, Vec<f64>) = (Vec::new(), Vec::new());
        let runs: Vec<usize> = (0..5).flat_map(|j| vec![j; drawn[j]]).collect();
        let (rows, values) = regression(&runs);
        // Copies of a run share its initial state.
        let mut first = vec![0; runs.len()];
        (0..runs.len()).for_each(|k| first[k] = runs.iter().position(|j| *j == runs[k]).unwrap());
        for (row, value) in rows.row_iter().zip(values.iter()) {
            let mut row = row.into_owned();
            for k in 0..runs.len() {
                if row[2 + k] == 1.0 && first[k] != k {
                    (row[2 + k], row[2 + first[k]]) = (0.0, 1.0);
                }
            }
            x.push(row);
            y.push(*value);
        }
        let (x, y) = (DMatrix::from_rows(&x), DVector::from_vec(y));
        let kept: Vec<usize> = (0..x.ncols())
            .filter(|k| x.column(*k).amax() > 0.0)
            .collect();
        let x = x.select_columns(&kept);
        let expected = x.tr_mul(&x).try_inverse().unwrap() * x.tr_mul(&y);
        let values = own.values.as_ref().unwrap();
        assert_eq!(own.number, *number);
        assert_near(values[0], expected[0], 1e-7);
        assert_near(values[1], expected[1], 1e-7);
        assert_near(values[2], expected[0] - expected[1], 1e-7);
    }
}

/// Draws with replacement: each run is drawn once on average, with the variance of a multinomial distribution.
#[test]
fn runs_are_drawn_with_equal_probabilities() {
    const DRAWS: u64 = 20_000;
    let (mut sum, mut squares) = ([0.0; 6], 0.0);
    for number in 0..DRAWS {
        let drawn = counts(6, &mut random(1, number));
        assert_eq!(drawn.iter().sum::<usize>(), 6);
        for (sum, count) in sum.iter_mut().zip(drawn) {
            *sum += count as f64;
            squares += (count as f64 - 1.0).powi(2);
        }
    }
    let sd = (5.0 / 6.0 / DRAWS as f64).sqrt();
    sum.iter()
        .for_each(|sum| assert_near(sum / DRAWS as f64, 1.0, 4.0 * sd));
    assert_near(squares / (6 * DRAWS) as f64, 5.0 / 6.0, 0.02);
}

/// NumPy: `np.quantile([1, 2, 4, 8, 16], [0.025, 0.975])`, `np.std(..., ddof=1)`.
#[test]
fn spreads_are_those_of_numpy() {
    let values = [8.0, f64::NAN, 1.0, 16.0, 2.0, 4.0];
    let found = spread(values.into_iter(), 0.95).unwrap();
    assert_near(found.low, 1.1, 1e-12);
    assert_near(found.high, 15.2, 1e-12);
    assert_near(found.sd, 6.099_180_272_790_763, 1e-12);
    assert_eq!(found.count, 5);
    assert_eq!(spread([1.0, f64::NAN].into_iter(), 0.95), None);
}
