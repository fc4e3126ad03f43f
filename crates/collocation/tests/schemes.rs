//! Every collocation scheme, solved through its tableau by a small dense Newton method: the order on a
//! problem with a known solution, between the nodes too, and stability.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, Matrix2, Matrix2xX, Vector2};
use pilotage_collocation::tableau::{Element, Row, Scheme, Tableau, Value};

/// An ODE of two states.
trait Ode {
    fn derivative(&self, x: Vector2<f64>, t: f64) -> Vector2<f64>;
    fn jacobian(&self, x: Vector2<f64>) -> Matrix2<f64>;
    /// The solution that begins at `at(0)`.
    fn at(&self, t: f64) -> Vector2<f64>;
}

/// `ṙ = μ r (1 - r²)`, `φ̇ = ω + b r²` in Cartesian coordinates: a nonlinear oscillator that grows into
/// its limit cycle, with a closed solution (the Hopf normal form).
struct Hopf;

const MU: f64 = 0.7;
const OMEGA: f64 = 1.3;
const B: f64 = 0.9;
/// `1/r(0)² - 1`.
const K: f64 = 3.0;

impl Ode for Hopf {
    fn derivative(&self, x: Vector2<f64>, _: f64) -> Vector2<f64> {
        let square = x.norm_squared();
        let turned = Vector2::new(-x.y, x.x);
        MU * (1.0 - square) * x + (OMEGA + B * square) * turned
    }

    fn jacobian(&self, x: Vector2<f64>) -> Matrix2<f64> {
        let square = x.norm_squared();
        let turned = Vector2::new(-x.y, x.x);
        let turn = Matrix2::new(0.0, -1.0, 1.0, 0.0);
        MU * (1.0 - square) * Matrix2::identity()
            + (OMEGA + B * square) * turn
            + (2.0 * B * turned - 2.0 * MU * x) * x.transpose()
    }

    fn at(&self, t: f64) -> Vector2<f64> {
        let grown = (2.0 * MU * t).exp();
        let radius = (grown / (grown + K)).sqrt();
        let angle = OMEGA * t + B / (2.0 * MU) * ((grown + K) / (1.0 + K)).ln();
        radius * Vector2::new(angle.cos(), angle.sin())
    }
}

/// The same oscillator under the force that makes it run through a pulse, at rest before and after.
struct Pulse;

impl Pulse {
    /// The solution and its derivative.
    fn with_slope(t: f64) -> (Vector2<f64>, Vector2<f64>) {
        let z = (t - 0.5 * DURATION) / 0.4;
        let bell = (-z * z).exp();
        let (x, slope) = (Vector2::new(1.0, z), Vector2::new(0.0, 1.0));
        (bell * x, bell * (slope - 2.0 * z * x) / 0.4)
    }
}

impl Ode for Pulse {
    fn derivative(&self, x: Vector2<f64>, t: f64) -> Vector2<f64> {
        let (solution, slope) = Self::with_slope(t);
        slope + Hopf.derivative(x, t) - Hopf.derivative(solution, t)
    }

    fn jacobian(&self, x: Vector2<f64>) -> Matrix2<f64> {
        Hopf.jacobian(x)
    }

    fn at(&self, t: f64) -> Vector2<f64> {
        Self::with_slope(t).0
    }
}

/// `ẋ = λ x` with complex λ, as two real states.
struct Linear {
    re: f64,
    im: f64,
}

impl Ode for Linear {
    fn derivative(&self, x: Vector2<f64>, _: f64) -> Vector2<f64> {
        self.jacobian(x) * x
    }

    fn jacobian(&self, _: Vector2<f64>) -> Matrix2<f64> {
        Matrix2::new(self.re, -self.im, self.im, self.re)
    }

    fn at(&self, t: f64) -> Vector2<f64> {
        (self.re * t).exp() * Vector2::new((self.im * t).cos(), (self.im * t).sin())
    }
}

/// An element with its solution.
struct Solved {
    element: Element,
    start: f64,
    length: f64,
    v: Vec<Vector2<f64>>,
    slopes: Vec<Vector2<f64>>,
}

impl Solved {
    fn at(&self, c: f64) -> Vector2<f64> {
        let (p, q) = self.element.tableau.interpolate(c);
        combine(&p, &self.v) + self.length * combine(&q, &self.slopes)
    }
}

fn combine(row: &Row, of: &[Vector2<f64>]) -> Vector2<f64> {
    row.iter().map(|(j, w)| *w * of[*j]).sum()
}

/// `f` at all points, and its Jacobian with respect to all V (2 × 2(s + 1) for each point).
fn evaluate(
    ode: &impl Ode,
    tableau: &Tableau,
    (start, h): (f64, f64),
    v: &[Vector2<f64>],
) -> (Vec<Vector2<f64>>, Vec<Matrix2xX<f64>>) {
    let mut slopes: Vec<Vector2<f64>> = Vec::new();
    let mut jacobians: Vec<Matrix2xX<f64>> = Vec::new();
    for point in &tableau.points {
        let p = match &point.value {
            Value::Unknown(j) => vec![(*j, 1.0)],
            Value::Combination(p) => p.clone(),
        };
        let y = combine(&p, v);
        let mut dy = Matrix2xX::zeros(2 * v.len());
        for (j, w) in p {
            dy.fixed_view_mut::<2, 2>(0, 2 * j).fill_diagonal(w);
        }
        slopes.push(ode.derivative(y, start + point.c * h));
        jacobians.push(ode.jacobian(y) * dy);
    }
    (slopes, jacobians)
}

/// Newton's method on the defects of one element.
fn solve(ode: &impl Ode, element: Element, mesh: &[f64], first: Vector2<f64>) -> Solved {
    let start = mesh[element.first];
    let length = mesh[element.first + element.intervals] - start;
    let tableau = element.tableau.clone();
    let s = tableau.unknowns();
    // From the exact solution, that nobody mistakes a bad start for a bad scheme.
    let mut v: Vec<_> = tableau
        .abscissae
        .iter()
        .map(|c| ode.at(start + c * length))
        .collect();
    v[0] = first;
    for _ in 0..30 {
        let (slopes, jacobians) = evaluate(ode, &tableau, (start, length), &v);
        let mut residual = DVector::zeros(2 * s);
        let mut matrix = DMatrix::zeros(2 * s, 2 * (s + 1));
        for (r, defect) in tableau.defects.iter().enumerate() {
            let value = combine(&defect.e, &v) - length * combine(&defect.a, &slopes);
            residual.fixed_rows_mut::<2>(2 * r).copy_from(&value);
            let mut rows = matrix.rows_mut(2 * r, 2);
            for (i, w) in &defect.a {
                rows -= length * *w * &jacobians[*i];
            }
            for (j, w) in &defect.e {
                rows[(0, 2 * j)] += w;
                rows[(1, 2 * j + 1)] += w;
            }
        }
        let square = matrix.columns(2, 2 * s).into_owned();
        let step = square
            .lu()
            .solve(&residual)
            .expect("the element's equations are regular");
        for (j, v) in v[1..].iter_mut().enumerate() {
            *v -= step.fixed_rows::<2>(2 * j);
        }
        // The next step would be of the order of its square.
        if step.amax() < 1e-9 {
            break;
        }
    }
    let (slopes, _) = evaluate(ode, &tableau, (start, length), &v);
    Solved {
        element,
        start,
        length,
        v,
        slopes,
    }
}

/// The whole run, element by element.
fn march(ode: &impl Ode, scheme: Scheme, mesh: &[f64]) -> Vec<Solved> {
    let mut state = ode.at(mesh[0]);
    let mut run = Vec::new();
    for element in scheme.elements(mesh) {
        let solved = solve(ode, element, mesh, state);
        state = solved.v[solved.v.len() - 1];
        run.push(solved);
    }
    run
}

/// Length of a run [s].
const DURATION: f64 = 3.0;

/// A mesh whose intervals grow and shrink smoothly.
fn graded(intervals: usize) -> Vec<f64> {
    let place = |k: usize| {
        let x = k as f64 / intervals as f64;
        DURATION * (x + 0.04 * (2.0 * PI * x).sin())
    };
    (0..=intervals).map(place).collect()
}

/// Largest error at the ends of the mesh's intervals, and anywhere.
fn errors(ode: &impl Ode, scheme: Scheme, mesh: &[f64]) -> [f64; 2] {
    let mut errors = [0.0f64; 2];
    for solved in march(ode, scheme, mesh) {
        let error = |c: f64| (solved.at(c) - ode.at(solved.start + c * solved.length)).norm();
        let intervals = solved.element.intervals;
        let ends = &mesh[solved.element.first..=solved.element.first + intervals];
        for end in ends {
            errors[0] = errors[0].max(error((end - solved.start) / solved.length));
        }
        let samples = 7 * intervals;
        for k in 0..=samples {
            errors[1] = errors[1].max(error(k as f64 / samples as f64));
        }
    }
    errors
}

/// Orders observed between the two finest meshes whose errors stand clear of rounding: at the ends, and
/// anywhere.
fn observed(ode: &impl Ode, scheme: Scheme, intervals: &[usize]) -> [f64; 2] {
    let runs: Vec<_> = intervals
        .iter()
        .map(|n| errors(ode, scheme, &graded(*n)))
        .collect();
    [0, 1].map(|kind| {
        let clear = runs.iter().take_while(|e| e[kind] > 1e-12).count();
        assert!(clear >= 2, "{scheme}: all errors are rounding");
        let ratio = runs[clear - 2][kind] / runs[clear - 1][kind];
        let refinement = intervals[clear - 1] as f64 / intervals[clear - 2] as f64;
        ratio.ln() / refinement.ln()
    })
}

/// Every scheme of an order that shows above rounding.
fn schemes() -> Vec<Scheme> {
    let sized = [
        (5, Scheme::Gauss as fn(usize) -> Scheme),
        (5, Scheme::Radau),
        (5, Scheme::Lobatto),
        (8, Scheme::Bernstein),
    ];
    let single = [Scheme::Euler, Scheme::Trapezoid, Scheme::HermiteSimpson];
    let sized = sized.iter().flat_map(|(n, scheme)| (1..=*n).map(scheme));
    single.into_iter().chain(sized).collect()
}

/// Finite differences of every size.
fn finite_differences() -> impl Iterator<Item = Scheme> {
    (1..=8).map(Scheme::FiniteDifference)
}

/// Asserts that an observed order is the stated one.
fn assert_order(scheme: Scheme, what: &str, observed: f64, stated: usize) {
    let off = (observed - stated as f64).abs();
    assert!(
        off < 0.15,
        "{scheme}, {what}: order {observed:.3} instead of {stated}"
    );
}

#[test]
fn every_scheme_converges_with_its_order() {
    let intervals = [
        3, 5, 6, 8, 11, 14, 18, 24, 31, 41, 53, 69, 90, 118, 153, 199, 400, 800,
    ];
    for scheme in schemes() {
        let [ends, anywhere] = observed(&Hopf, scheme, &intervals);
        assert_order(scheme, "ends", ends, scheme.order());
        assert_order(scheme, "anywhere", anywhere, scheme.interpolant_order());
    }
}

/// The rows at the ends of a run have larger errors than those within, of one order more: they vanish in the
/// end, but for wide stencils that end lies below rounding, and until then the observed order is too high. So
/// it is bounded from both sides up to order 5, on a pulse that is at rest at the ends; beyond, from below.
/// That those are of no higher order either is in their leading error (the tests beside the coefficients).
#[test]
fn finite_differences_converge_with_their_order() {
    let intervals = [60, 90, 130, 190, 280];
    for scheme in finite_differences() {
        let stated = scheme.order();
        let pulse = observed(&Pulse, scheme, &intervals);
        let oscillator = observed(&Hopf, scheme, &intervals);
        for observed in pulse.into_iter().chain(oscillator) {
            assert!(
                observed > stated as f64 - 0.15,
                "{scheme}: order {observed:.3}"
            );
        }
        if stated <= 5 {
            assert_order(scheme, "nodes", pulse[0], stated);
            assert_order(scheme, "anywhere", pulse[1], scheme.interpolant_order());
        }
    }
}

/// What became of `ẋ = λ x`, `|x(0)| = 1`, in 300 steps of one second.
struct Course {
    largest: f64,
    last: f64,
    /// Largest distance to the exact solution.
    error: f64,
}

fn course(scheme: Scheme, re: f64, im: f64) -> Course {
    let ode = Linear { re, im };
    let mesh: Vec<f64> = (0..=300).map(f64::from).collect();
    let mut course = Course {
        largest: 0.0,
        last: 1.0,
        error: 0.0,
    };
    for solved in march(&ode, scheme, &mesh) {
        for k in 0..=solved.element.intervals {
            let c = k as f64 / solved.element.intervals as f64;
            let x = solved.at(c);
            let exact = ode.at(solved.start + c * solved.length);
            course.last = x.norm();
            course.largest = course.largest.max(course.last);
            course.error = course.error.max((x - exact).norm());
        }
    }
    course
}

#[test]
fn a_slow_mode_is_followed_over_many_steps() {
    for scheme in schemes().into_iter().chain(finite_differences()) {
        let error = course(scheme, -0.01, 0.0).error;
        let bound = 0.2 * 0.01f64.powi(scheme.order() as i32) + 1e-12;
        assert!(error < bound, "{scheme}: {error:e}");
    }
}

/// Fast, stiff and oscillating modes: nothing grows, and what is damped dies.
#[test]
fn damped_modes_die_and_no_parasitic_ones_grow() {
    let damped = [(-1.0, 0.0), (-50.0, 0.0), (-0.1, 1.0), (-0.1, -1.0)];
    for scheme in schemes().into_iter().chain(finite_differences()) {
        // Explicit: 1 + λh is outside the unit circle for all but the first.
        let damped = if scheme == Scheme::Euler {
            &damped[..1]
        } else {
            &damped
        };
        // The first rows of the widest differences overshoot once.
        let overshoot = if matches!(scheme, Scheme::FiniteDifference(_)) {
            0.1
        } else {
            1e-12
        };
        for (re, im) in damped {
            let Course { largest, last, .. } = course(scheme, *re, *im);
            assert!(
                largest < 1.0 + overshoot,
                "{scheme}, {re} + {im} i: {largest:e}"
            );
            assert!(last < 1e-10, "{scheme}, {re} + {im} i: {last:e}");
        }
    }
}

/// An oscillation without damping, at three steps a period: finite differences damp it away, one-step methods
/// that are stable in the whole left half-plane keep or damp it, and Bernstein polynomials of degree 3 and 4
/// are not of those.
#[test]
fn fast_undamped_oscillations_grow_where_the_docs_say_so_alone() {
    for scheme in schemes().into_iter().chain(finite_differences()) {
        let Course { largest, last, .. } = course(scheme, 0.0, 2.0);
        match scheme {
            Scheme::Euler | Scheme::Bernstein(3 | 4) => assert!(last > 10.0, "{scheme}: {last:e}"),
            Scheme::Bernstein(3..) => {}
            Scheme::FiniteDifference(_) => {
                assert!(
                    largest < 1.1 && last < 1e-20,
                    "{scheme}: {largest:e}, {last:e}"
                );
            }
            _ => assert!(largest < 1.0 + 1e-12, "{scheme}: {largest:e}"),
        }
    }
}

/// One element for the whole run: what pseudospectral methods are for.
#[test]
fn high_degrees_solve_the_whole_run_at_once() {
    for (degree, bound) in [
        (8, 1e-3),
        (16, 1e-7),
        (24, 1e-11),
        (32, 1e-13),
        (48, 1e-13),
        (64, 1e-13),
    ] {
        let [_, anywhere] = errors(&Hopf, Scheme::Lobatto(degree), &[0.0, DURATION]);
        assert!(anywhere < bound, "degree {degree}: {anywhere:e}");
    }
}
