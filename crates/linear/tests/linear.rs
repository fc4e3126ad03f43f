//! Loops whose margins are known in closed form.

use nalgebra::{Complex, DMatrix};
use pilotage_linear::{Sampled, StateSpace, Wire};
use proptest::prelude::*;
use std::f64::consts::PI;

/// `gain / (s + pole)`, or an integrator for a pole of 0.
fn lag(name: &str, gain: f64, pole: f64) -> StateSpace {
    let one = |value| DMatrix::from_element(1, 1, value);
    StateSpace {
        a: one(-pole),
        b: one(gain),
        c: one(1.0),
        d: one(0.0),
        states: vec![format!("{name}.x")],
        inputs: vec![format!("{name}.u")],
        outputs: vec![format!("{name}.y")],
    }
}

/// `factor` times the input, without delay.
fn gain(name: &str, factor: f64) -> StateSpace {
    StateSpace {
        d: DMatrix::from_element(1, 1, factor),
        b: DMatrix::zeros(0, 1),
        c: DMatrix::zeros(1, 0),
        inputs: vec![format!("{name}.u")],
        outputs: vec![format!("{name}.y")],
        ..StateSpace::empty()
    }
}

fn wire(output: usize, input: usize) -> Wire {
    Wire {
        output,
        input,
        factor: 1.0,
    }
}

/// `L = k / (s (s + p))` with the negative sign in the wire that closes the loop.
fn first_order_and_integrator(k: f64, p: f64) -> (StateSpace, [Wire; 2]) {
    let parts = StateSpace::side_by_side(&[lag("lag", k, p), lag("integrator", 1.0, 0.0)]);
    let back = Wire {
        factor: -1.0,
        ..wire(1, 0)
    };
    (parts, [wire(0, 1), back])
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance * expected.abs().max(1.0),
        "{found} is not {expected}"
    );
}

/// `|L| = 1` where `ω² (ω² + p²) = k²`; the phase there is `-90° - atan(ω/p)`; it never reaches -180°.
#[test]
fn first_order_and_integrator_have_the_margin_of_the_formula() {
    for (k, p) in [(1.0, 1.0), (20.0, 3.0), (0.01, 5.0), (1e4, 2.0)] {
        let (parts, wires) = first_order_and_integrator(k, p);
        for cut in 0..2 {
            let (_, margins) = parts.open_loop(&wires, cut).unwrap().margins();
            let [crossing] = margins.gain_crossings[..] else {
                panic!("{margins:?}")
            };
            let square = 0.5 * ((p.powi(4) + 4.0 * k * k).sqrt() - p * p);
            let omega = square.sqrt();
            let margin = PI / 2.0 - (omega / p).atan();
            close(crossing.frequency, omega, 1e-12);
            close(crossing.phase_margin, margin, 1e-9);
            close(crossing.delay_margin, margin / omega, 1e-9);
            // The lag alone is the delay of the crossover model.
            close(crossing.effective_delay, (omega / p).atan() / omega, 1e-9);
            assert!(margins.phase_crossings.is_empty(), "{margins:?}");
        }
        // s² + p s + k = 0.
        let root = Complex::new(p * p - 4.0 * k, 0.0).sqrt();
        let poles = parts.closed(&wires).unwrap().poles();
        for pole in [(-p + root) / 2.0, (-p - root) / 2.0] {
            let nearest = poles.iter().map(|found| (found - pole).norm());
            assert!(
                nearest.fold(f64::INFINITY, f64::min) < 1e-9 * pole.norm(),
                "{poles:?}"
            );
        }
    }
}

/// `L = k / (s + 1)³`: phase -180° at `ω = √3`, gain there `k/8`; `|L| = 1` at `ω² = k^(2/3) - 1`.
#[test]
fn three_lags_have_the_gain_margin_of_the_formula() {
    for k in [2.0, 8.0 - 1e-6, 30.0] {
        let parts = [lag("a", k, 1.0), lag("b", 1.0, 1.0), lag("c", -1.0, 1.0)];
        let parts = StateSpace::side_by_side(&parts);
        let wires = [wire(0, 1), wire(1, 2), wire(2, 0)];
        let (_, margins) = parts.open_loop(&wires, 2).unwrap().margins();
        let [crossing] = margins.phase_crossings[..] else {
            panic!("{margins:?}")
        };
        close(crossing.frequency, 3f64.sqrt(), 1e-9);
        close(crossing.gain_margin, 8.0 / k, 1e-9);
        let [crossing] = margins.gain_crossings[..] else {
            panic!("{margins:?}")
        };
        let omega = (k.powf(2.0 / 3.0) - 1.0).sqrt();
        close(crossing.frequency, omega, 1e-9);
        close(crossing.phase_margin, PI - 3.0 * omega.atan(), 1e-8);
    }
}

/// A sharp resonance between the points of a coarse grid still has its crossings.
#[test]
fn a_sharp_resonance_is_not_overlooked() {
    // L = 1e-3·0.5 / (s² + 2e-5·s + 1): |L| = 1 at |1 - ω²| ≈ 5e-4.
    let parts = StateSpace {
        a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -2e-5]),
        b: DMatrix::from_row_slice(2, 1, &[0.0, 5e-4]),
        c: DMatrix::from_row_slice(1, 2, &[-1.0, 0.0]),
        d: DMatrix::zeros(1, 1),
        states: vec!["x".into(), "v".into()],
        inputs: vec!["u".into()],
        outputs: vec!["y".into()],
    };
    let (_, margins) = parts.open_loop(&[wire(0, 0)], 0).unwrap().margins();
    let found: Vec<f64> = margins.gain_crossings.iter().map(|c| c.frequency).collect();
    // (1 - w)² + 4e-10 w = 2.5e-7 with w = ω².
    let (half, rest): (f64, f64) = (1.0 - 2e-10, 1.0 - 2.5e-7);
    let root = (half * half - rest).sqrt();
    assert_eq!(found.len(), 2);
    close(found[0], (half - root).sqrt(), 1e-12);
    close(found[1], (half + root).sqrt(), 1e-12);
}

#[test]
fn a_loop_of_direct_feedthrough_is_solved_or_refused() {
    // y = 0.5 (y + w) gives 1 w; y = 1 (y + w) has no solution.
    let solved = gain("a", 0.5).closed(&[wire(0, 0)]).unwrap();
    assert_eq!(solved.d[(0, 0)], 1.0);
    let message = gain("a", 1.0)
        .closed(&[wire(0, 0)])
        .unwrap_err()
        .to_string();
    assert_eq!(
        message,
        "the connections close a loop of direct feedthrough that has no solution (det(I - D K) is 0), \
         through a.u"
    );
}

/// Gain `u = g (-y)` and integrator `ẏ = u`, each with inputs held for a step: `y` changes by `h u`, and the gain's
/// output is that of the previous step, so that `z² - z + g h = 0`.
#[test]
fn held_parts_have_the_poles_of_the_difference_equation() {
    let parts = StateSpace::side_by_side(&[gain("p", -2.0), lag("i", 1.0, 0.0)]);
    let wires = [wire(0, 1), wire(1, 0)];
    let h = 0.1;
    let sampled = Sampled::new(&parts, h);
    let root = Complex::new(1.0 - 4.0 * 2.0 * h, 0.0).sqrt();
    for z in [(1.0 + root) / 2.0, (1.0 - root) / 2.0] {
        let pole = z.ln() / h;
        let poles = sampled.poles(&wires).unwrap();
        let nearest = poles.iter().map(|found| (found - pole).norm());
        assert!(
            nearest.fold(f64::INFINITY, f64::min) < 1e-9,
            "{poles:?} {pole}"
        );
    }
    // L(z) = g h z⁻¹ / (z - 1): phase -90° - 3/2 ω h, |L| = g h / (2 sin(ω h/2)).
    let (_, margins) = sampled.margins(&wires, 1).unwrap();
    let crossing = margins.phase_margin().unwrap();
    let omega = 2.0 / h * (2.0 * h / 2.0f64).asin();
    close(crossing.frequency, omega, 1e-10);
    close(crossing.phase_margin, PI / 2.0 - 1.5 * omega * h, 1e-9);
    close(crossing.effective_delay, 1.5 * h, 1e-9);
    close(
        margins.gain_margin().unwrap().frequency,
        PI / (3.0 * h),
        1e-9,
    );
}

/// Limits at the ends of the frequencies, where the phase reaches -180° and does not cross it.
#[test]
fn a_loop_may_have_its_limit_at_no_frequency_and_at_that_of_nyquist() {
    // 1 + k / (s - 1) has the pole 1 - k: the gain may fall to 1/k. A positive feedback of g < 1 may rise to 1.
    for (pole, k, limit) in [(-1.0, 3.0, 1.0 / 3.0), (-1.0, 0.5, 2.0), (1.0, -0.5, 2.0)] {
        let closing = Wire {
            factor: -1.0,
            ..wire(0, 0)
        };
        let (_, margins) = lag("a", k, pole)
            .open_loop(&[closing], 0)
            .unwrap()
            .margins();
        let [crossing] = margins.phase_crossings[..] else {
            panic!("{margins:?}")
        };
        assert_eq!(crossing.frequency, 0.0);
        close(crossing.gain_margin, limit, 1e-12);
    }
    // x_{i+1} = x_i - k h x_i has the pole 1 - k h, which is -1 for k h = 2.
    for (k, h) in [(0.5, 1.0), (1.99, 1.0), (2.01, 1.0), (7.0, 0.1)] {
        let integrator = lag("integrator", 1.0, 0.0);
        let closing = Wire {
            factor: -k,
            ..wire(0, 0)
        };
        let (_, margins) = Sampled::new(&integrator, h).margins(&[closing], 0).unwrap();
        let [crossing] = margins.phase_crossings[..] else {
            panic!("{margins:?}")
        };
        close(crossing.frequency, PI / h, 1e-12);
        close(crossing.gain_margin, 2.0 / (k * h), 1e-9);
    }
}

/// Product of polynomials, coefficients of the highest power first.
fn product(a: &[Complex<f64>], b: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let mut c = vec![Complex::new(0.0, 0.0); a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            c[i + j] += *x * *y;
        }
    }
    c
}

/// Value of a polynomial.
fn value(polynomial: &[Complex<f64>], at: Complex<f64>) -> Complex<f64> {
    (polynomial.iter()).fold(Complex::new(0.0, 0.0), |sum, c| sum * at + c)
}

/// The roots of a polynomial with real coefficients between 1e-5 and 1e5: sign changes over a dense grid, which is denser
/// around one place.
fn roots(coefficients: &[f64], around: f64) -> Vec<f64> {
    let value = |x: f64| coefficients.iter().fold(0.0, |sum, c| sum * x + c);
    let everywhere = (0..20_000).map(|i| 10_f64.powf(f64::from(i) / 2000.0 - 5.0));
    let beside = (0..5000).flat_map(|i| {
        let distance = 10_f64.powf(f64::from(i) / 500.0 - 10.0);
        [around * (1.0 - distance), around * (1.0 + distance)]
    });
    let mut grid: Vec<f64> = everywhere.chain(beside).filter(|x| *x > 0.0).collect();
    grid.sort_by(f64::total_cmp);
    let changes = grid
        .windows(2)
        .filter(|ends| value(ends[0]) * value(ends[1]) < 0.0);
    let bisected = changes.map(|ends| {
        let (mut low, mut high) = (ends[0], ends[1]);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            match value(middle) * value(low) > 0.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        0.5 * (low + high)
    });
    bisected.collect()
}

/// The transfer function in controllable form; the denominator begins with 1 and is longer than the numerator.
fn realized(numerator: &[f64], denominator: &[f64]) -> StateSpace {
    let n = denominator.len() - 1;
    let a = DMatrix::from_fn(n, n, |i, j| match i {
        0 => -denominator[j + 1],
        _ => f64::from(u8::from(i == j + 1)),
    });
    let names = |letter: &str, n: usize| (0..n).map(|i| format!("{letter}{i}")).collect();
    let lacking = n - numerator.len();
    StateSpace {
        a,
        b: DMatrix::from_fn(n, 1, |i, _| f64::from(u8::from(i == 0))),
        c: DMatrix::from_fn(1, n, |_, j| match j.checked_sub(lacking) {
            Some(j) => numerator[j],
            None => 0.0,
        }),
        d: DMatrix::zeros(1, 1),
        states: names("x", n),
        inputs: names("u", 1),
        outputs: names("y", 1),
    }
}

/// `s² + 2 ζ ω s + ω²`.
fn pair(frequency: f64, damping: f64) -> Vec<Complex<f64>> {
    let real = |value| Complex::new(value, 0.0);
    vec![
        real(1.0),
        real(2.0 * damping * frequency),
        real(frequency * frequency),
    ]
}

/// What gains in series hold is gone after as many steps: z = 0.
#[test]
fn gains_in_series_have_no_poles_of_their_own() {
    let parts = [
        lag("lag", 1.0, 1.0),
        gain("a", 1.0),
        gain("b", 1.0),
        gain("c", 1.0),
        gain("d", 1.0),
    ];
    let parts = StateSpace::side_by_side(&parts);
    for first in [0, 1] {
        let wires: Vec<Wire> = (first..4)
            .map(|k| Wire {
                factor: 0.9,
                ..wire(k, k + 1)
            })
            .collect();
        let poles = Sampled::new(&parts, 0.1).poles(&wires).unwrap();
        let [pole] = poles[..] else {
            panic!("{poles:?}")
        };
        close(pole.re, -1.0, 1e-12);
    }
}

/// Elements in series are blocks of their own, whatever their order: n equal ones have an n-fold pole, exactly, and in a
/// loop beside them nothing changes. All at once, rounding moves the pole by its n-th root, and the time grows with n³.
#[test]
fn poles_of_elements_in_series_are_those_of_each() {
    const N: usize = 400;
    // Its place among the states is that of a permutation.
    let at = |k: usize| (k * 7 + 3) % (2 * N);
    let mut a = DMatrix::zeros(2 * N, 2 * N);
    for k in 0..N {
        let (x, v) = (at(2 * k), at(2 * k + 1));
        a[(x, v)] = 1.0;
        a[(v, x)] = -25.0;
        a[(v, v)] = -6.0;
        for before in 0..k {
            a[(v, at(2 * before))] = 1e3;
        }
    }
    let poles = pilotage_linear::eigenvalues(&a);
    assert_eq!(poles.len(), 2 * N);
    for pole in poles {
        close(pole.re, -3.0, 1e-12);
        close(pole.im.abs(), 4.0, 1e-12);
    }
}

/// Zeros of little damping, near which the phase turns by half a circle at once: the loop's limit may lie there.
#[test]
fn crossings_near_zeros_of_little_damping_are_found() {
    let loop_of = realized(
        &[
            16.398231311592898,
            -0.0010902568509866953,
            0.3893201543245366,
        ],
        &[
            1.0,
            0.06927631460791178,
            0.06930162702841039,
            0.0028408391593498887,
            0.0001833905963999431,
        ],
    );
    let (_, margins) = loop_of.margins();
    let margin = margins.gain_margin().unwrap().gain_margin;
    close(margin, 1.1002489376, 1e-9);
    let rightmost = |factor: f64| -> f64 {
        let closed = &loop_of.a - &loop_of.b * &loop_of.c * factor;
        let poles = closed.complex_eigenvalues();
        poles.iter().map(|pole| pole.re).fold(f64::MIN, f64::max)
    };
    assert!(rightmost(0.999 * margin) < 0.0 && rightmost(1.001 * margin) > 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(7), cases: 300, ..ProptestConfig::default() })]

    /// The crossings are the roots of two polynomials in ω: |N|² - |D|², and the imaginary part of N times the conjugate of D.
    #[test]
    fn crossings_are_roots_of_polynomials(
        zero in -1.0..1.0_f64, damping in -5.0..-1.0_f64, sign in any::<bool>(),
        pairs in prop::collection::vec((-1.5..1.5_f64, 0.02..1.0_f64), 1..3), lags in prop::collection::vec(-1.5..1.5_f64, 1..3),
        size in -2.0..2.0_f64,
    ) {
        let real = |value| Complex::new(value, 0.0);
        let mut denominator = vec![real(1.0)];
        for (frequency, damping) in pairs {
            denominator = product(&denominator, &pair(10_f64.powf(frequency), damping));
        }
        for pole in lags {
            denominator = product(&denominator, &[real(1.0), real(10_f64.powf(pole))]);
        }
        let frequency = 10_f64.powf(zero);
        let mut numerator = pair(frequency, 10_f64.powf(damping));
        // The gain somewhat above the zeros.
        let above = Complex::new(0.0, 1.02 * frequency);
        let gain = (value(&numerator, above) / value(&denominator, above)).norm();
        let factor = 10_f64.powf(size) / gain * if sign { 1.0 } else { -1.0 };
        numerator.iter_mut().for_each(|c| *c *= factor);
        // Both as polynomials in ω, and their conjugates for a real ω.
        let along = |polynomial: &[Complex<f64>]| -> Vec<Complex<f64>> {
            let n = polynomial.len() as i32 - 1;
            (0..).zip(polynomial).map(|(i, c)| c * Complex::new(0.0, 1.0).powi(n - i)).collect()
        };
        let conjugate = |polynomial: &[Complex<f64>]| polynomial.iter().map(Complex::conj).collect::<Vec<_>>();
        let (n, d) = (along(&numerator), along(&denominator));
        let [above, below] = [&n, &d].map(|own| product(own, &conjugate(own)));
        let lacking = below.len() - above.len();
        let excess: Vec<f64> = (0..below.len())
            .map(|i| i.checked_sub(lacking).map_or(0.0, |i| above[i].re) - below[i].re)
            .collect();
        let imaginary: Vec<f64> = product(&n, &conjugate(&d)).iter().map(|c| c.im).collect();
        let transfer = |omega: f64| {
            let s = Complex::new(0.0, omega);
            value(&numerator, s) / value(&denominator, s)
        };
        let is_limit = |omega: &f64| {
            let value = transfer(*omega);
            value.re < 0.0 && (1e-8..1e8).contains(&value.norm())
        };
        let parts = |own: &[Complex<f64>]| own.iter().map(|c| c.re).collect::<Vec<_>>();
        let (_, margins) = realized(&parts(&numerator), &parts(&denominator)).margins();
        let found: Vec<f64> = margins.gain_crossings.iter().map(|own| own.frequency).collect();
        let expected = roots(&excess, frequency);
        let has = |all: &[f64], own: f64| all.iter().any(|other| (other / own - 1.0).abs() < 1e-5);
        for omega in &expected {
            prop_assert!(has(&found, *omega), "gain {omega}: {found:?}, {expected:?}");
        }
        prop_assert!(found.iter().all(|own| (transfer(*own).norm() - 1.0).abs() < 1e-6), "{found:?}");
        let found: Vec<f64> = margins.phase_crossings.iter().map(|own| own.frequency).collect();
        let expected: Vec<f64> = roots(&imaginary, frequency).into_iter().filter(is_limit).collect();
        for omega in &expected {
            prop_assert!(has(&found, *omega), "phase {omega}: {found:?}, {expected:?}");
        }
        let is_real = |own: &f64| *own == 0.0 || (transfer(*own).im / transfer(*own).norm()).abs() < 1e-6;
        prop_assert!(found.iter().all(is_real), "{found:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(5), cases: 64, ..ProptestConfig::default() })]

    /// Compares the transfer of the coupled system with that of its parts: `Y = G (K Y + W)` at some frequency.
    #[test]
    fn the_coupled_transfer_is_that_of_the_parts(
        numbers in prop::collection::vec(-1.0..1.0f64, 2 * (3 * 3 + 3 * 2 + 2 * 3 + 2 * 2)),
        factors in prop::collection::vec(-0.5..0.5f64, 3),
        omega in 0.01..100.0f64,
    ) {
        let mut numbers = numbers.into_iter();
        let mut matrix = |rows, columns, scale: f64| {
            DMatrix::from_fn(rows, columns, |_, _| scale * numbers.next().unwrap())
        };
        let mut part = |name: &str| StateSpace {
            a: matrix(3, 3, 1.0) - DMatrix::identity(3, 3) * 2.0,
            b: matrix(3, 2, 1.0),
            c: matrix(2, 3, 1.0),
            d: matrix(2, 2, 0.3),
            states: (0..3).map(|i| format!("{name}.x{i}")).collect(),
            inputs: (0..2).map(|i| format!("{name}.u{i}")).collect(),
            outputs: (0..2).map(|i| format!("{name}.y{i}")).collect(),
        };
        let parts = StateSpace::side_by_side(&[part("a"), part("b")]);
        let wires = [
            Wire { output: 0, input: 2, factor: factors[0] },
            Wire { output: 3, input: 1, factor: factors[1] },
            Wire { output: 2, input: 0, factor: factors[2] },
        ];
        let closed = parts.closed(&wires).unwrap();
        let s = Complex::new(0.0, omega);
        let transfer = |system: &StateSpace| {
            DMatrix::from_fn(4, 4, |i, j| system.transfer(i, j, s))
        };
        let (open, closed) = (transfer(&parts), transfer(&closed));
        let mut k = DMatrix::zeros(4, 4);
        for wire in wires {
            k[(wire.input, wire.output)] = Complex::new(wire.factor, 0.0);
        }
        let expected = &open + &open * &k * &closed;
        prop_assert!((expected - closed).norm() < 1e-9);
    }
}

/// Values that are not finite or overflow neither hang the computation nor yield stable poles.
#[test]
fn what_has_no_poles_in_numbers_has_infinite_ones() {
    let infinite = Complex::new(f64::INFINITY, 0.0);
    let with = |value: f64| {
        let names = |prefix: &str, n: usize| (1..=n).map(|k| format!("{prefix}{k}")).collect();
        let mut a = DMatrix::from_fn(3, 3, |i, j| (i as f64 - 2.0 * j as f64).cos());
        a[(1, 2)] = value;
        StateSpace {
            a,
            b: DMatrix::from_element(3, 1, 1.0),
            c: DMatrix::from_element(1, 3, 1.0),
            d: DMatrix::zeros(1, 1),
            states: names("x", 3),
            inputs: names("u", 1),
            outputs: names("y", 1),
        }
    };
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let system = with(value);
        assert_eq!(system.poles(), [infinite; 3]);
        let (response, _) = system.margins();
        assert!(!response.frequency.is_empty());
        let error = system.check_finite().unwrap_err().to_string();
        let begin = format!("the derivative of the rate of `x2` with respect to `x3` is {value} ");
        assert!(error.starts_with(&begin), "{error}");
    }
    for value in [1e300, -1e308, f64::MAX] {
        let system = with(value);
        assert_eq!(system.check_finite(), Ok(()));
        assert_eq!(system.poles().len(), 3);
        let sampled = Sampled::new(&system, 1e6).poles(&[]).unwrap();
        assert!(sampled.iter().all(|pole| pole.re == f64::INFINITY));
    }
}

#[test]
fn without_states_the_transfer_is_the_feedthrough() {
    let mut gain = StateSpace::empty();
    (gain.b, gain.c) = (DMatrix::zeros(0, 1), DMatrix::zeros(1, 0));
    gain.d = DMatrix::from_element(1, 1, 3.0);
    assert_eq!(
        gain.transfer(0, 0, Complex::new(0.0, 2.0)),
        Complex::from(3.0)
    );
}

/// Two integrators in a row behind a delay each, with feedback from the second to the first through the delays: by hand, and the
/// margins of K e^(-jωτ)/(jω): ω_c = K, 90° - K τ, and 1/K times where the phase passes -180°, π/(2 τ) and every 2 π/τ from there.
#[test]
fn delays_turn_the_phase() {
    let single = |b: f64| StateSpace {
        a: DMatrix::zeros(1, 1),
        b: DMatrix::from_row_slice(1, 2, &[b, 1.0]),
        c: DMatrix::from_row_slice(2, 1, &[1.0, 0.0]),
        d: DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 2.0, 0.0]),
        states: names("x", 1),
        inputs: names("u", 2),
        outputs: names("y", 2),
    };
    // ẋ = w, w = 2 u(t - τ), in front of ẋ = x_before + w, w = 2 u(t - τ) of an input that is 0; and back.
    let both = StateSpace::side_by_side(&[single(0.0), single(1.0)]);
    let wire = |output, input, factor| Wire {
        output,
        input,
        factor,
    };
    let closed = both.closed(&[wire(0, 2, 1.0), wire(2, 0, -0.3)]).unwrap();
    let delays = [(1, 1, 0.4), (3, 3, 0.7)];
    for omega in [0.3, 1.7, 9.0] {
        let s = Complex::new(0.0, omega);
        let [e, f] = [0.4, 0.7].map(|tau| (-s * tau).exp());
        // s x = 2 e (u - 0.3 y), s y = (1 + 2 f) x.
        let forward = (f * 2.0 + 1.0) * e * 2.0 / (s * s);
        let expected = forward / (forward * 0.3 + 1.0);
        let found = closed.transfer_with_delays((2, 0), &delays, omega);
        assert!(
            (found - expected).norm() < 1e-12 * expected.norm(),
            "{omega}: {found} {expected}"
        );
    }
    let (gain, tau) = (1.5, 0.4);
    let evaluate =
        |omega: f64| single(0.0).transfer_with_delays((0, 0), &[(1, 1, tau)], omega) * 0.5 * gain;
    let open = StateSpace {
        b: DMatrix::from_element(1, 1, gain),
        c: DMatrix::from_element(1, 1, 1.0),
        d: DMatrix::zeros(1, 1),
        inputs: names("u", 1),
        outputs: names("y", 1),
        ..single(0.0)
    };
    let (_, margins) = open.margins_of(evaluate);
    let margins = margins.limited(3);
    let crossing = margins.phase_margin().unwrap();
    assert!((crossing.frequency - gain).abs() < 1e-12);
    assert!((crossing.phase_margin - (PI / 2.0 - gain * tau)).abs() < 1e-12);
    assert_eq!(margins.phase_crossings.len(), 3);
    for (k, own) in margins.phase_crossings.iter().enumerate() {
        let omega = (PI / 2.0 + 2.0 * PI * k as f64) / tau;
        assert!((own.frequency - omega).abs() < 1e-9 * omega, "{own:?}");
        assert!(
            (own.gain_margin - omega / gain).abs() < 1e-9 * omega,
            "{own:?}"
        );
    }
}

#[test]
fn idle_states_are_left_out() {
    let mut all = StateSpace::side_by_side(&[three(), three()]);
    all.b.rows_mut(3, 3).fill(0.0);
    all.a.view_mut((3, 3), (3, 3)).fill(0.0);
    // They are seen, and would keep what they begin with.
    assert_eq!(all.without_idle_states(), all);
    all.c.columns_mut(3, 3).fill(0.0);
    assert_eq!(all.without_idle_states().a, three().a);
    assert_eq!(all.without_idle_states().states, all.states[..3]);
}

fn three() -> StateSpace {
    StateSpace {
        a: DMatrix::from_fn(3, 3, |i, j| (i as f64 - 2.0 * j as f64).cos()),
        b: DMatrix::from_element(3, 1, 1.0),
        c: DMatrix::from_element(1, 3, 1.0),
        d: DMatrix::zeros(1, 1),
        states: names("x", 3),
        inputs: names("u", 1),
        outputs: names("y", 1),
    }
}

fn names(of: &str, count: usize) -> Vec<String> {
    (1..=count).map(|k| format!("{of}{k}")).collect()
}
