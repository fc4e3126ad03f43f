//! Comparisons with textbook formulas in nalgebra, finite differences and an ODE solver.

use nalgebra::{DMatrix, DVector};
use num_dual::DualNum;
use pilotage_expression::{Node, System};
use pilotage_filter::{Equations, Filter, Innovation, Jet, Matrix, Record, Transition};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

fn matrix<const N: usize>(of: &DMatrix<f64>) -> Matrix<N> {
    let mut own = Matrix::zeros(of.nrows(), of.ncols());
    for i in 0..of.nrows() {
        (0..of.ncols()).for_each(|j| *own.at(i, j) = Jet::constant(of[(i, j)]));
    }
    own
}

fn distance(own: &Matrix<0>, other: &DMatrix<f64>) -> f64 {
    let entry = |i: usize, j: usize| (own.row(i)[j].value - other[(i, j)]).abs();
    let entries = (0..other.nrows()).flat_map(|i| (0..other.ncols()).map(move |j| entry(i, j)));
    entries.fold(0.0, f64::max)
}

/// A system, its noises, and its measured signals.
type Noisy = (System, Vec<(Vec<Node>, Node)>, Vec<(Node, Node)>);

/// An oscillating pair and a fast pole.
fn plant() -> [DMatrix<f64>; 2] {
    let f = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, -4.0, -0.5, 1.0, 0.0, 0.3, -8.0]);
    let g = DMatrix::from_row_slice(3, 2, &[0.0, 0.0, 1.0, 0.2, 0.0, 2.0]);
    [
        f,
        &g * DMatrix::from_diagonal(&DVector::from_vec(vec![0.3, 0.7])) * g.transpose(),
    ]
}

/// `e^{Fh}` and the covariance of the noise, by Van Loan's block matrix.
fn van_loan(f: &DMatrix<f64>, q: &DMatrix<f64>, h: f64) -> [DMatrix<f64>; 2] {
    let n = f.nrows();
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&-f);
    block.view_mut((0, n), (n, n)).copy_from(q);
    block.view_mut((n, n), (n, n)).copy_from(&f.transpose());
    let e = (block * h).exp();
    let phi = e.view((n, n), (n, n)).transpose();
    let noise = &phi * e.view((0, n), (n, n));
    [phi, noise]
}

#[test]
fn transitions_are_those_of_van_loan() {
    let [f, q] = plant();
    // Van Loan's matrix contains the inverse of fast modes: its own rounding errors dominate beyond this time.
    for h in [1e-3, 0.05, 0.4] {
        let own = Transition::<0>::over(matrix(&f), matrix(&q), h);
        let [phi, noise] = van_loan(&f, &q, h);
        assert!(distance(&own.phi, &phi) < 1e-13, "{h}");
        assert!(distance(&own.noise, &noise) < 1e-13, "{h}");
        // F Ψ₁ = Φ - 1 and F Ψ₂ = Ψ₁ - h.
        let n = f.nrows();
        let first = &f * whole(&own.constant) - (&phi - DMatrix::identity(n, n));
        let second = &f * whole(&own.slope) - (whole(&own.constant) - DMatrix::identity(n, n) * h);
        assert!(first.amax() < 1e-13 && second.amax() < 1e-13, "{h}");
    }
}

fn whole(of: &Matrix<0>) -> DMatrix<f64> {
    DMatrix::from_fn(of.rows(), of.rows(), |i, j| of.row(i)[j].value)
}

/// The plant with an input and a gain as a parameter; two signals, with a noise level as another parameter.
fn equations() -> Noisy {
    let [f, _] = plant();
    let system = System::trace([3, 1, 3], |at| {
        let row = |i: usize| {
            let sum = at.x[0] * f[(i, 0)] + at.x[1] * f[(i, 1)] + at.x[2] * f[(i, 2)];
            if i == 1 { sum + at.u[0] * at.p[0] } else { sum }
        };
        let outputs = vec![at.x[0] + at.x[2] * at.p[0], at.x[1], at.p[1], at.p[2]];
        [(0..3).map(row).collect(), outputs]
    });
    let mut system = system.expect("a graph");
    let mut number = |value: f64| system.graph.constant(value);
    let columns = [
        [0.0, 1.0, 0.0].map(&mut number).to_vec(),
        [0.0, 0.2, 2.0].map(&mut number).to_vec(),
    ];
    let sds = [number(0.1), system.outputs[3]];
    let [first, second] = columns;
    let seven = system.graph.constant(0.7);
    let noises = vec![(first, system.outputs[2]), (second, seven)];
    let outputs = vec![(system.outputs[0], sds[0]), (system.outputs[1], sds[1])];
    (system, noises, outputs)
}

fn filter(of: &Noisy) -> Filter {
    Filter::new(&Equations {
        graph: &of.0.graph,
        variables: of.0.variables(),
        derivatives: &of.0.derivatives,
        noises: &of.1,
        outputs: &of.2,
    })
}

/// Samples at two distances, with replicates; every third value of the second signal is missing.
fn data() -> (Vec<f64>, Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut time = vec![0.0];
    for k in 1..60 {
        let step = [0.05, 0.05, 0.11, 0.0][k % 4];
        time.push(time[k - 1] + step);
    }
    let inputs = time.iter().map(|t: &f64| vec![(3.0 * t).sin()]).collect();
    let mut draw = || -> Vec<f64> {
        (0..60)
            .map(|_| StandardNormal.sample(&mut random))
            .collect()
    };
    let mut measured = vec![draw(), draw()];
    (0..60).step_by(3).for_each(|k| measured[1][k] = f64::NAN);
    (time, inputs, measured)
}

const THETA: [f64; 3] = [0.9, 0.3, 0.2];
const BEGIN: [f64; 3] = [0.5, -0.2, 0.1];

/// −2 log likelihood by the textbook formulas, with all signals of a sample at once.
fn textbook(time: &[f64], inputs: &[Vec<f64>], measured: &[Vec<f64>]) -> f64 {
    let [f, q] = plant();
    let h = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, THETA[0], 0.0, 1.0, 0.0]);
    let r = [0.01, THETA[2] * THETA[2]];
    let mut x = DVector::from_column_slice(&BEGIN);
    let mut p = DMatrix::zeros(3, 3);
    let mut sum = 0.0;
    for k in 0..time.len() {
        let step = if k > 0 { time[k] - time[k - 1] } else { 0.0 };
        if step > 0.0 {
            let [phi, noise] = van_loan(&f, &q, step);
            // The linear input as two additional states.
            let mut all = DMatrix::zeros(5, 5);
            all.view_mut((0, 0), (3, 3)).copy_from(&f);
            all[(1, 3)] = THETA[0];
            all[(3, 4)] = 1.0;
            let (a, b) = (inputs[k - 1][0], inputs[k][0]);
            let begin = DVector::from_vec(vec![x[0], x[1], x[2], a, (b - a) / step]);
            x = ((all * step).exp() * begin).rows(0, 3).into_owned();
            p = &phi * p * phi.transpose() + noise;
        }
        let seen: Vec<usize> = (0..2).filter(|i| measured[*i][k].is_finite()).collect();
        let h = h.select_rows(&seen);
        let r = DMatrix::from_diagonal(&DVector::from_iterator(
            seen.len(),
            seen.iter().map(|i| r[*i]),
        ));
        let y = DVector::from_iterator(seen.len(), seen.iter().map(|i| measured[*i][k]));
        let e = y - &h * &x;
        let s = &h * &p * h.transpose() + r;
        let inverse = s.clone().try_inverse().expect("positive");
        sum += s.determinant().ln() + (e.transpose() * &inverse * &e)[0];
        let gain = &p * h.transpose() * inverse;
        x += &gain * e;
        p = (DMatrix::identity(3, 3) - gain * h) * p;
    }
    sum
}

#[test]
fn the_likelihood_is_that_of_the_textbook() {
    let (time, inputs, measured) = data();
    let filter = filter(&equations());
    let record = Record {
        time: &time,
        inputs: &inputs,
        measured: &measured,
    };
    let course = filter.run(&record, &BEGIN, &THETA, 1);
    let own: f64 = course.innovations.iter().map(Innovation::surprise).sum();
    let expected = textbook(&time, &inputs, &measured);
    assert!(
        (own - expected).abs() < 1e-9 * expected.abs(),
        "{own} {expected}"
    );
    // More parts change nothing, since the system is linear.
    let parts = filter.run(&record, &BEGIN, &THETA, 3);
    let more: f64 = parts.innovations.iter().map(Innovation::surprise).sum();
    assert!((own - more).abs() < 1e-9 * own.abs(), "{own} {more}");
}

/// The innovations of simulated values are the random numbers that they were drawn with, for any system.
#[test]
fn what_is_drawn_has_the_innovations_it_was_drawn_with() {
    let (time, inputs, measured) = data();
    for equations in [equations(), nonlinear()] {
        let filter = filter(&equations);
        let record = |measured| Record {
            time: &time,
            inputs: &inputs,
            measured,
        };
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut numbers = Vec::<f64>::new();
        let drawn = filter.simulated(&record(&measured), &BEGIN, &THETA, 2, &mut || {
            numbers.push(StandardNormal.sample(&mut random));
            numbers[numbers.len() - 1]
        });
        let pairs = drawn.iter().flatten().zip(measured.iter().flatten());
        assert!(pairs.clone().all(|(a, b)| a.is_finite() == b.is_finite()));
        assert!(pairs.filter(|(a, b)| a == b).count() == 0);
        let course = filter.run(&record(&drawn), &BEGIN, &THETA, 2);
        assert_eq!(course.innovations.len(), numbers.len());
        for (own, number) in course.innovations.iter().zip(&numbers) {
            let z = own.standardised();
            assert!((z - number).abs() < 1e-9, "{z} is not {number}");
        }
    }
}

/// Derivatives of the likelihood with respect to three parameters and an initial state.
#[test]
fn derivatives_are_those_of_differences() {
    let (time, inputs, measured) = data();
    for equations in [equations(), nonlinear()] {
        let filter = filter(&equations);
        let record = Record {
            time: &time,
            inputs: &inputs,
            measured: &measured,
        };
        let at = [THETA[0], THETA[1], THETA[2], BEGIN[1]];
        let sum = |at: [f64; 4]| -> f64 {
            let begin = [BEGIN[0], at[3], BEGIN[2]];
            let course = filter.run(&record, &begin, &at[..3], 2);
            course.innovations.iter().map(Innovation::surprise).sum()
        };
        let jet = |k: usize| Jet {
            value: at[k],
            slopes: std::array::from_fn(|i| f64::from(u8::from(i == k))),
        };
        let begin = [Jet::constant(BEGIN[0]), jet(3), Jet::constant(BEGIN[2])];
        let rest = [jet(0), jet(1), jet(2)];
        let course = filter.differentiated(&record, &begin, &rest, 2);
        for k in 0..4 {
            let own: f64 = course.innovations.iter().map(|i| slope(i, k)).sum();
            let moved = |by: f64| {
                let mut moved = at;
                moved[k] += by;
                sum(moved)
            };
            let d = 1e-3;
            let difference =
                (8.0 * (moved(d) - moved(-d)) - (moved(2.0 * d) - moved(-2.0 * d))) / (12.0 * d);
            assert!(
                (own - difference).abs() < 1e-6 * difference.abs(),
                "{k}: {own} {difference}"
            );
        }
    }
}

/// Derivative of `ln s + e²/s`.
fn slope(of: &Innovation<4>, k: usize) -> f64 {
    let (e, s) = (of.error, of.variance);
    let z = e.value / s.value;
    s.slopes[k] / s.value + 2.0 * z * e.slopes[k] - z * z * s.slopes[k]
}

/// A pendulum with a lag, of the same dimensions.
fn nonlinear() -> Noisy {
    let system = System::trace([3, 1, 3], |at| {
        let rate = at.x[0].sin() * -4.0 - at.x[1] * at.p[0] + at.x[2];
        let lag = (at.u[0] - at.x[2]) * 5.0;
        let outputs = vec![at.x[0].sin(), at.x[1], at.p[1], at.p[2]];
        [vec![at.x[1], rate, lag], outputs]
    });
    let mut system = system.expect("a graph");
    let zero = system.graph.constant(0.0);
    let column = vec![zero, system.graph.constant(1.0), zero];
    let noises = vec![(column, system.outputs[2])];
    let sd = system.graph.constant(0.3);
    let outputs = vec![
        (system.outputs[0], sd),
        (system.outputs[1], system.outputs[3]),
    ];
    (system, noises, outputs)
}

/// Mean and variance of the pendulum by the Runge–Kutta method with small steps, with a measurement only at the end.
#[test]
fn between_samples_mean_and_covariance_follow_their_differential_equations() {
    let (end, steps) = (0.8, 4000);
    let rates = |t: f64, v: &DVector<f64>| {
        let (x, p) = (
            v.rows(0, 3),
            DMatrix::from_iterator(3, 3, v.rows(3, 9).iter().copied()),
        );
        let f = DMatrix::from_row_slice(
            3,
            3,
            &[
                0.0,
                1.0,
                0.0,
                -4.0 * x[0].cos(),
                -THETA[0],
                1.0,
                0.0,
                0.0,
                -5.0,
            ],
        );
        let mut q = DMatrix::zeros(3, 3);
        q[(1, 1)] = THETA[1];
        let dp = &f * &p + &p * f.transpose() + q;
        let dx = [
            x[1],
            -4.0 * x[0].sin() - THETA[0] * x[1] + x[2],
            5.0 * (t - x[2]),
        ];
        DVector::from_iterator(12, dx.into_iter().chain(dp.iter().copied()))
    };
    let mut v = DVector::zeros(12);
    v.rows_mut(0, 3).copy_from_slice(&BEGIN);
    let h = end / f64::from(steps);
    for k in 0..steps {
        let t = f64::from(k) * h;
        let a = rates(t, &v);
        let b = rates(t + 0.5 * h, &(&v + &a * (0.5 * h)));
        let c = rates(t + 0.5 * h, &(&v + &b * (0.5 * h)));
        let d = rates(t + h, &(&v + &c * h));
        v += (a + b * 2.0 + c * 2.0 + d) * (h / 6.0);
    }
    let slope = v[0].cos();
    let (error, variance) = (0.2 - v[0].sin(), slope * slope * v[3] + 0.09);
    let filter = filter(&nonlinear());
    let (inputs, measured) = (
        vec![vec![0.0], vec![end]],
        vec![vec![f64::NAN, 0.2], vec![f64::NAN; 2]],
    );
    let record = Record {
        time: &[0.0, end],
        inputs: &inputs,
        measured: &measured,
    };
    let off = |parts: usize| {
        let course = filter.run(&record, &BEGIN, &THETA, parts);
        let own = course.innovations[0];
        [
            (own.error.value - error).abs(),
            (own.variance.value - variance).abs(),
        ]
    };
    let (coarse, fine) = (off(16), off(64));
    // Second order: at most about a sixteenth.
    for (coarse, fine) in coarse.into_iter().zip(fine) {
        assert!(fine < 1e-4 && coarse > 12.0 * fine, "{coarse} {fine}");
    }
}
