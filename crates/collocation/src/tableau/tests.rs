//! Compares the coefficients with their order conditions, published values and exact polynomials.

use std::sync::Arc;

use super::scheme::every_scheme;
use super::{Interpolant, Row, Scheme, Tableau, Value, dot};

/// A mesh with pairwise different intervals [s].
fn uneven(intervals: usize) -> Vec<f64> {
    let place = |k: usize| k as f64 + 0.3 * (1.7 * k as f64).sin();
    (0..=intervals).map(place).collect()
}

fn tableau(scheme: Scheme) -> Arc<Tableau> {
    scheme.elements(&uneven(14)).remove(0).tableau
}

fn assert_close(a: f64, b: f64, tolerance: f64, what: &str) {
    assert!((a - b).abs() <= tolerance, "{what}: {a:e} and {b:e}");
}

/// Magnitude of the terms of a row, to which its rounding is proportional.
fn size(row: &Row) -> f64 {
    row.iter().map(|(_, w)| w.abs()).sum()
}

/// Degree up to which a tableau and its interpolant are exact for polynomials.
fn degree(tableau: &Tableau) -> usize {
    match &tableau.interpolant {
        Interpolant::Integral(_) => tableau.points.len(),
        Interpolant::Bernstein => tableau.unknowns(),
        Interpolant::Nodes(degree) => *degree,
    }
}

/// The coefficients `V` of the polynomial `c^k`.
fn power(tableau: &Tableau, k: usize) -> Vec<f64> {
    let d = tableau.unknowns();
    // Farouki 2012: the coefficient of c^k is (j over k) / (d over k).
    let choose = |n: usize| (0..k).map(|i| n as f64 - i as f64).product::<f64>();
    match tableau.interpolant {
        Interpolant::Bernstein => (0..=d).map(|j| choose(j) / choose(d)).collect(),
        _ => tableau.abscissae.iter().map(|c| c.powi(k as i32)).collect(),
    }
}

fn is_sparse_row(row: &Row, columns: usize) -> bool {
    row.iter()
        .all(|(j, w)| *j < columns && *w != 0.0 && w.is_finite())
        && row.windows(2).all(|w| w[0].0 < w[1].0)
}

#[test]
fn tableaus_are_well_formed() {
    for scheme in every_scheme() {
        let t = tableau(scheme);
        let (s, m) = (t.unknowns(), t.points.len());
        assert_eq!((t.abscissae[0], t.abscissae[s]), (0.0, 1.0), "{scheme}");
        assert!(t.abscissae.windows(2).all(|w| w[0] < w[1]), "{scheme}");
        assert_eq!(t.defects.len(), s, "{scheme}");
        for point in &t.points {
            match &point.value {
                Value::Unknown(j) => assert_eq!(t.abscissae[*j], point.c, "{scheme}"),
                Value::Combination(p) => assert!(is_sparse_row(p, s + 1), "{scheme}"),
            }
        }
        for defect in &t.defects {
            assert!(
                is_sparse_row(&defect.e, s + 1) && is_sparse_row(&defect.a, m),
                "{scheme}"
            );
        }
    }
}

/// Constants have a zero derivative, and `x = t` has the derivative 1.
#[test]
fn defects_and_points_are_exact_for_straight_lines() {
    for scheme in every_scheme() {
        let t = tableau(scheme);
        let place = |j: usize| t.abscissae[j];
        let what = scheme.name();
        for defect in &t.defects {
            let rounding = 1e-14 * (1.0 + size(&defect.e));
            assert_close(dot(&defect.e, |_| 1.0), 0.0, rounding, &what);
            assert_close(
                dot(&defect.e, place),
                dot(&defect.a, |_| 1.0),
                rounding,
                &what,
            );
        }
        for point in &t.points {
            if let Value::Combination(p) = &point.value {
                assert_close(dot(p, |_| 1.0), 1.0, 1e-14, &what);
                assert_close(dot(p, place), point.c, 1e-14, &what);
            }
        }
    }
}

/// Every polynomial of the scheme's degree satisfies the defects, and its interpolant reproduces it.
#[test]
fn polynomials_are_reproduced() {
    for scheme in every_scheme() {
        let t = tableau(scheme);
        for k in 1..=degree(&t) {
            let v = power(&t, k);
            let f = |i: usize| k as f64 * t.points[i].c.powi(k as i32 - 1);
            let what = format!("{scheme}, power {k}");
            for defect in &t.defects {
                let rounding = 1e-14 * (1.0 + size(&defect.e) + k as f64 * size(&defect.a));
                assert_close(dot(&defect.e, |j| v[j]), dot(&defect.a, f), rounding, &what);
            }
            for c in [0.0, 1e-3, 0.13, 0.5, 0.77, 1.0 - 1e-3, 1.0] {
                let (p, q) = t.interpolate(c);
                assert!(
                    is_sparse_row(&p, v.len()) && is_sparse_row(&q, t.points.len()),
                    "{what}"
                );
                let rounding = 1e-14 * (1.0 + size(&p) + k as f64 * size(&q));
                assert_close(
                    dot(&p, |j| v[j]) + dot(&q, f),
                    c.powi(k as i32),
                    rounding,
                    &what,
                );
            }
        }
    }
}

/// The coefficients follow from the states of `c^k` at the abscissae.
#[test]
fn polynomials_are_drawn_through_states() {
    for scheme in every_scheme() {
        let t = tableau(scheme);
        for k in 1..=t.unknowns().min(4) {
            let states = t.abscissae.iter().map(|c| vec![c.powi(k as i32), 1.0]);
            let found = t.through(states.collect());
            for (found, exact) in found.iter().zip(power(&t, k)) {
                assert_close(found[0], exact, 1e-11, &scheme.name());
                assert_close(found[1], 1.0, 1e-11, &scheme.name());
            }
        }
    }
}

/// B(k): Σ b_j c_j^(k-1) = 1/k up to the order and not beyond (Hairer & Wanner II, IV.5); the previous test checks
/// C(k).
#[test]
fn the_weights_of_the_end_have_the_stated_order_and_no_more() {
    for scheme in every_scheme() {
        let t = tableau(scheme);
        if !matches!(t.interpolant, Interpolant::Integral(_)) {
            continue;
        }
        let end = &t.defects[t.unknowns() - 1].a;
        let excess = |k: usize| dot(end, |i| t.points[i].c.powi(k as i32 - 1)) - 1.0 / k as f64;
        let order = scheme.order();
        for k in 1..=order {
            assert_close(excess(k), 0.0, 1e-14, &format!("{scheme}, B({k})"));
        }
        // Above this order the quadrature error of the next power is below rounding.
        if order <= 20 {
            assert!(
                excess(order + 1).abs() > 1e-14,
                "{scheme}, B({})",
                order + 1
            );
        }
    }
}

/// Hairer & Wanner II, section IV.5.
#[test]
fn small_methods_have_the_published_coefficients() {
    let r3 = 3f64.sqrt();
    expect(
        Scheme::Gauss(2),
        &[0.5 - r3 / 6.0, 0.5 + r3 / 6.0],
        &[
            &[0.25, 0.25 - r3 / 6.0],
            &[0.25 + r3 / 6.0, 0.25],
            &[0.5, 0.5],
        ],
    );
    expect(
        Scheme::Radau(2),
        &[1.0 / 3.0, 1.0],
        &[&[5.0 / 12.0, -1.0 / 12.0], &[0.75, 0.25]],
    );
    let r6 = 6f64.sqrt();
    expect(
        Scheme::Radau(3),
        &[(4.0 - r6) / 10.0, (4.0 + r6) / 10.0, 1.0],
        &[
            &[
                (88.0 - 7.0 * r6) / 360.0,
                (296.0 - 169.0 * r6) / 1800.0,
                (-2.0 + 3.0 * r6) / 225.0,
            ],
            &[
                (296.0 + 169.0 * r6) / 1800.0,
                (88.0 + 7.0 * r6) / 360.0,
                (-2.0 - 3.0 * r6) / 225.0,
            ],
            &[(16.0 - r6) / 36.0, (16.0 + r6) / 36.0, 1.0 / 9.0],
        ],
    );
    // LGL with five nodes: the last row is the quadrature.
    let t = tableau(Scheme::Lobatto(4));
    let r = (3f64 / 7.0).sqrt();
    for (c, exact) in t
        .abscissae
        .iter()
        .zip([0.0, 0.5 - 0.5 * r, 0.5, 0.5 + 0.5 * r, 1.0])
    {
        assert_close(*c, exact, 1e-15, "lgl-4 node");
    }
    let weights = [
        1.0 / 20.0,
        49.0 / 180.0,
        16.0 / 45.0,
        49.0 / 180.0,
        1.0 / 20.0,
    ];
    for ((_, b), exact) in t.defects[3].a.iter().zip(weights) {
        assert_close(*b, exact, 1e-15, "lgl-4 weight");
    }
}

fn expect(scheme: Scheme, c: &[f64], a: &[&[f64]]) {
    let t = tableau(scheme);
    assert_eq!((t.points.len(), t.defects.len()), (c.len(), a.len()));
    for (point, c) in t.points.iter().zip(c) {
        assert_close(point.c, *c, 1e-15, &scheme.name());
    }
    for (defect, row) in t.defects.iter().zip(a) {
        for ((_, found), exact) in defect.a.iter().zip(*row) {
            assert_close(*found, *exact, 1e-15, &scheme.name());
        }
    }
}

#[test]
fn lobatto_with_two_and_three_nodes_are_the_classics() {
    for (n, classic) in [(1, Scheme::Trapezoid), (2, Scheme::HermiteSimpson)] {
        let (lobatto, classic) = (tableau(Scheme::Lobatto(n)), tableau(classic));
        assert_eq!(lobatto.abscissae, classic.abscissae);
        for (ours, theirs) in lobatto.defects.iter().zip(&classic.defects) {
            assert_eq!(ours.e, theirs.e);
            for ((_, a), (_, exact)) in ours.a.iter().zip(&theirs.a) {
                assert_close(*a, *exact, 1e-15, "Lobatto IIIA");
            }
        }
    }
}

/// BDF2, and the generalised BDFs of orders 3 and 4, as h f = Σ α_j x_j.
#[test]
fn finite_differences_within_a_uniform_mesh_are_the_generalised_bdfs() {
    let stencils: [(usize, &[f64]); 4] = [
        (1, &[-1.0, 1.0]),
        (2, &[0.5, -2.0, 1.5]),
        (3, &[1.0 / 6.0, -1.0, 0.5, 1.0 / 3.0]),
        (4, &[-1.0 / 12.0, 0.5, -1.5, 5.0 / 6.0, 0.25]),
    ];
    let mesh: Vec<f64> = (0..=20).map(f64::from).collect();
    for (p, weights) in stencils {
        let elements = Scheme::FiniteDifference(p).elements(&mesh);
        let e = &elements[0].tableau.defects[9].e;
        assert_eq!(e[0].0, 10 - (p + 2) / 2, "order {p}");
        assert_eq!(e.len(), p + 1);
        for ((_, found), exact) in e.iter().zip(weights) {
            assert_close(found / 20.0, *exact, 1e-13, "weight");
        }
    }
}

/// The boundary locus `Σ α_j e^(i (j - ν) θ)` of every stencil stays in the right half-plane: for `λh` in the left one,
/// the number of roots inside the unit circle equals the number of past nodes of the stencil.
#[test]
fn finite_differences_are_stable_in_the_left_half_plane() {
    let mesh: Vec<f64> = (0..=40).map(f64::from).collect();
    for p in 1..=8 {
        let elements = Scheme::FiniteDifference(p).elements(&mesh);
        let e = &elements[0].tableau.defects[19].e;
        for k in 0..=1000 {
            let angle = std::f64::consts::PI * f64::from(k) / 1000.0;
            let real = dot(e, |j| (angle * (j as f64 - 20.0)).cos());
            assert!(real > -1e-11, "order {p}, angle {angle}: {real:e}");
        }
        // Damping of sawteeth: a symmetric stencil has 0 here.
        let sawtooth = dot(e, |j| if j % 2 == 0 { 1.0 } else { -1.0 }) / 40.0;
        assert!(sawtooth > 0.5, "order {p}: {sawtooth}");
    }
}

/// For the next power the error of the derivative is `ν! (p - ν)! h^p`: the order is exactly p.
#[test]
fn finite_differences_have_the_leading_error_of_their_order() {
    let mesh: Vec<f64> = (0..=40).map(f64::from).collect();
    for p in 1..=8 {
        let elements = Scheme::FiniteDifference(p).elements(&mesh);
        let e = &elements[0].tableau.defects[19].e;
        let found = dot(e, |j| (j as f64 - 20.0).powi(p as i32 + 1)) / 40.0;
        let factorial = |n: usize| (1..=n).product::<usize>() as f64;
        let before = (p + 2) / 2;
        let exact = factorial(before) * factorial(p - before);
        assert_close(found.abs() / exact, 1.0, 1e-10, &format!("order {p}"));
    }
}

#[test]
fn a_run_shorter_than_the_stencil_uses_all_its_nodes() {
    let element = Scheme::FiniteDifference(6)
        .elements(&[0.0, 0.4, 1.0])
        .remove(0);
    assert_eq!(element.intervals, 2);
    assert!(element.tableau.defects.iter().all(|d| d.e.len() <= 3));
    let v = power(&element.tableau, 2);
    for (defect, node) in element.tableau.defects.iter().zip([0.4, 1.0]) {
        assert_close(dot(&defect.e, |j| v[j]), 2.0 * node, 1e-14, "parabola");
    }
}

/// At the ends, and at nodes among the unknowns, the interpolant is that unknown, even if the time of a sample has
/// rounding errors.
#[test]
fn interpolants_pass_through_the_unknown_nodes() {
    for scheme in every_scheme() {
        let t = tableau(scheme);
        for (j, c) in t.abscissae.iter().enumerate() {
            let end = j == 0 || j == t.unknowns();
            for c in [c - 3e-12, *c, c + 3e-12] {
                let (p, q) = t.interpolate(c);
                if end || !matches!(scheme, Scheme::Bernstein(_)) {
                    assert_eq!((p, q), (vec![(j, 1.0)], vec![]), "{scheme} at {c}");
                } else {
                    assert_eq!(p.len(), t.unknowns() + 1, "{scheme} at {c}");
                }
            }
        }
    }
}

#[test]
fn elements_tile_the_mesh_and_share_their_tableau() {
    let mesh = uneven(9);
    for scheme in every_scheme() {
        let elements = scheme.elements(&mesh);
        let mut next = 0;
        for element in &elements {
            assert_eq!(element.first, next, "{scheme}");
            assert!(element.intervals > 0, "{scheme}");
            assert!(
                Arc::ptr_eq(&element.tableau, &elements[0].tableau),
                "{scheme}"
            );
            next += element.intervals;
        }
        assert_eq!(next, 9, "{scheme}");
        assert!(scheme.elements(&mesh[..1]).is_empty() && scheme.elements(&[]).is_empty());
    }
    let [a, b] = [2, 3].map(|n| Scheme::Radau(3).elements(&uneven(n)).remove(0).tableau);
    assert!(Arc::ptr_eq(&a, &b), "runs share too");
}

#[test]
fn every_name_is_read_back() {
    for scheme in every_scheme() {
        assert_eq!(scheme.name().parse(), Ok(scheme));
        assert!(!scheme.source().is_empty());
        assert!(scheme.interpolant_order() <= scheme.order());
        assert_eq!(scheme.degree(), degree(&tableau(scheme)), "{scheme}");
    }
}

#[test]
fn a_name_that_no_scheme_has_is_answered_with_those_there_are() {
    for name in [
        "", "gauss", "gauss-0", "gauss-11", "gauss-02", "gauss-+2", "lgl-65", "Euler", "euler-1",
    ] {
        let error = name.parse::<Scheme>().unwrap_err();
        assert_eq!(
            error.to_string(),
            format!(
                "no scheme is called '{name}'; there are euler, trapezoid, hermite-simpson, \
                 gauss-1 to gauss-10, radau-1 to radau-10, lgl-1 to lgl-64, \
                 bernstein-1 to bernstein-12, finite-difference-1 to finite-difference-8"
            )
        );
    }
}

#[test]
#[should_panic(expected = "no scheme is called 'radau-0'")]
fn a_size_that_no_scheme_has_is_refused() {
    Scheme::Radau(0).elements(&[0.0, 1.0]);
}
