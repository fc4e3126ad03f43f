//! Poles and zeros of a fitted pilot and poles of its closed loop, with confidence ellipses.

use super::figure::{Axis, Figure, Look, Panel, Series};
use super::frequency::Fitted;
use crate::inference::{LEVEL, Open, Spread, quantile};
use crate::linear::eigenvalues;
use crate::vehicle::ClosedLoop;
use nalgebra::{Complex, DMatrix, DVector, Matrix2, SymmetricEigen};
use std::f64::consts::PI;

/// Step of finite differences in standard deviations.
const STEP: f64 = 1e-3;
/// Roots with a magnitude above this multiple of the pilot's largest pole are not shown.
const FAR: f64 = 10.0;

/// Roots as a function of θ.
pub type Roots<'a> = &'a dyn Fn(&[f64]) -> Vec<Complex<f64>>;

/// The map of poles and zeros.
pub fn pole_figure(fitted: &Fitted<'_>) -> Figure {
    let Fitted {
        pilot,
        theta,
        vehicle,
        sure,
    } = *fitted;
    let poles = |theta: &[f64]| pilot.poles(theta);
    let zeros = |theta: &[f64]| roots(&theta[pilot.order..]);
    let largest = poles(theta)
        .iter()
        .map(|pole| pole.norm())
        .fold(0.0, f64::max);
    let mut series = Vec::new();
    let mut hidden = 0;
    let mut add = |label: &str, colour: &str, look: Look, of: Roots<'_>| {
        let all = of(theta);
        let near: Vec<Complex<f64>> = (all.iter().copied())
            .filter(|root| root.norm() <= FAR * largest)
            .collect();
        hidden += all.len() - near.len();
        let ellipses = sure
            .iter()
            .flat_map(|sure| ellipses(sure, theta, of, &near));
        series
            .extend(ellipses.map(|[x, y]| Series::line("95 %", colour, &x, &y).looks(Look::Area)));
        let (x, y): (Vec<f64>, Vec<f64>) = near.iter().map(|root| (root.re, root.im)).unzip();
        series.push(Series::line(label, colour, &x, &y).looks(look));
    };
    if let Some(vehicle) = vehicle {
        let of = |theta: &[f64]| ClosedLoop::of(*vehicle, pilot, theta).poles;
        add("poles of the closed loop", "line-3", Look::Crosses, &of);
    }
    add("zeros of the pilot", "line-2", Look::Rings, &zeros);
    add("poles of the pilot", "line-1", Look::Crosses, &poles);
    let far = match hidden {
        0 => String::new(),
        count => format!(" {count} further out are not shown."),
    };
    let panel = Panel {
        x: Axis::linear("real part [1/s]"),
        y: Axis::linear("imaginary part [1/s]"),
        equal: true,
        height: 480.0,
        series,
    };
    let caption = format!("Ellipses hold a root with 95 % (delta method).{far}");
    Figure::of("poles", "Poles and zeros", &caption, panel)
}

/// The poles of a connected system as a function of θ; `None` if there are none.
pub fn wired_figure(of: Roots<'_>, theta: &[f64], sure: Option<&Spread>) -> Option<Figure> {
    let all = of(theta);
    let ellipses = sure
        .into_iter()
        .flat_map(|sure| ellipses(sure, theta, of, &all));
    let mut series: Vec<Series> = ellipses
        .filter(|[x, y]| x.iter().chain(y).all(|value| value.is_finite()))
        .map(|[x, y]| Series::line("95 %", "line-1", &x, &y).looks(Look::Area))
        .collect();
    let ellipse_note = match series.is_empty() {
        true => "",
        false => " Ellipses hold a pole with 95 % (delta method).",
    };
    let (x, y): (Vec<f64>, Vec<f64>) = all.iter().map(|pole| (pole.re, pole.im)).unzip();
    series.push(Series::line("", "line-1", &x, &y).looks(Look::Crosses));
    let panel = Panel {
        x: Axis::linear("real part [1/s]"),
        y: Axis::linear("imaginary part [1/s]"),
        equal: true,
        height: 380.0,
        series,
    };
    let caption =
        format!("Of the wired system, linearised where the first run ends.{ellipse_note}");
    (!x.is_empty()).then(|| Figure::of("poles", "Poles", &caption, panel))
}

/// Roots of a polynomial with ascending coefficients, as eigenvalues of its companion matrix.
fn roots(c: &[f64]) -> Vec<Complex<f64>> {
    let Some(degree) = c
        .iter()
        .rposition(|c| *c != 0.0)
        .filter(|degree| *degree > 0)
    else {
        return Vec::new();
    };
    let companion = DMatrix::from_fn(degree, degree, |i, j| match (j + 1 == degree, i == j + 1) {
        (true, _) => -c[i] / c[degree],
        (false, true) => 1.0,
        (false, false) => 0.0,
    });
    eigenvalues(&companion)
}

/// The 95 % region of each root: `{s: (s - r)ᵀ C⁻¹ (s - r) ≤ 2 F(2, ν)}`, with the covariance C by the delta method;
/// for a real root, an interval by Student's t on the real axis.
fn ellipses(
    sure: &Spread,
    theta: &[f64],
    of: Roots<'_>,
    at: &[Complex<f64>],
) -> Vec<[Vec<f64>; 2]> {
    let along = |direction: &DVector<f64>| slopes(theta, of, at, direction);
    let component = |k: usize| {
        let mut axis = DVector::zeros(theta.len());
        axis[k] = sure.covariance[(k, k)].sqrt();
        let changes = along(&axis).into_iter();
        let slope = |change: Complex<f64>| match axis[k] > 0.0 {
            true => change / axis[k],
            false => Complex::new(0.0, 0.0),
        };
        changes.map(slope).collect()
    };
    let slopes: Vec<Vec<Complex<f64>>> = (0..theta.len()).map(component).collect();
    let open: Vec<Vec<Complex<f64>>> = sure.open.directions.iter().map(along).collect();
    let degrees = sure.least_degrees();
    let region = |(r, root): (usize, &Complex<f64>)| {
        let mut covariance = Matrix2::zeros();
        for (i, a) in slopes.iter().enumerate() {
            for (j, b) in slopes.iter().enumerate() {
                let (a, b) = (a[r], b[r]);
                covariance += sure.covariance[(i, j)]
                    * Matrix2::new(a.re * b.re, a.re * b.im, a.im * b.re, a.im * b.im);
            }
        }
        let sd = covariance.trace().sqrt();
        if open
            .iter()
            .any(|own| Open::is_moved(own[r].norm(), sd, root.norm()))
        {
            return None;
        }
        let reach = match root.im == 0.0 {
            true => quantile(LEVEL, degrees),
            // The quantile of F with two numerator degrees of freedom has a closed form.
            false if degrees.is_finite() => {
                (degrees * ((1.0 - LEVEL).powf(-2.0 / degrees) - 1.0)).sqrt()
            }
            false => (-2.0 * (1.0 - LEVEL).ln()).sqrt(),
        };
        outline(*root, covariance, reach)
    };
    at.iter().enumerate().filter_map(region).collect()
}

/// Derivative of each root along a direction of θ (central differences; perturbed roots are matched by distance).
fn slopes(
    theta: &[f64],
    of: Roots<'_>,
    at: &[Complex<f64>],
    direction: &DVector<f64>,
) -> Vec<Complex<f64>> {
    let moved = |by: f64| {
        let moved = DVector::from_column_slice(theta) + by * direction;
        of(moved.as_slice())
    };
    let [up, down] = [STEP, -STEP].map(moved);
    let nearest = |all: &[Complex<f64>], root: &Complex<f64>| {
        let by_distance = |a: &&Complex<f64>, b: &&Complex<f64>| {
            (*a - root).norm().total_cmp(&(*b - root).norm())
        };
        all.iter().min_by(by_distance).copied().unwrap_or(*root)
    };
    let own = |root: &Complex<f64>| (nearest(&up, root) - nearest(&down, root)) / (2.0 * STEP);
    at.iter().map(own).collect()
}

/// The points of an ellipse; `None` if the covariance is not finite.
fn outline(middle: Complex<f64>, covariance: Matrix2<f64>, reach: f64) -> Option<[Vec<f64>; 2]> {
    if !covariance.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(covariance);
    let axes = eigen.eigenvectors
        * Matrix2::from_diagonal(&eigen.eigenvalues.map(|v| reach * v.max(0.0).sqrt()));
    let angles = (0..=72).map(|k| f64::from(k) * PI / 36.0);
    let points = angles.map(|angle| {
        let by = axes * nalgebra::Vector2::new(angle.cos(), angle.sin());
        (middle.re + by.x, middle.im + by.y)
    });
    let (x, y) = points.unzip();
    Some([x, y])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Factors: (s + 1)(s + 2)(s + 3) and 2 (s² + 4).
    #[test]
    fn roots_are_those_of_the_factors() {
        let mut found: Vec<f64> = roots(&[6.0, 11.0, 6.0, 1.0])
            .iter()
            .map(|root| root.re)
            .collect();
        found.sort_by(f64::total_cmp);
        for (found, exact) in found.iter().zip([-3.0, -2.0, -1.0]) {
            assert!((found - exact).abs() < 1e-12, "{found}");
        }
        assert!(
            roots(&[8.0, 0.0, 2.0, 0.0])
                .iter()
                .all(|root| (root.im.abs() - 2.0).abs() < 1e-12)
        );
        assert!(roots(&[1.0, 0.0]).is_empty());
    }

    /// All points of an outline have the same Mahalanobis distance.
    #[test]
    fn an_ellipse_is_where_the_covariance_says() {
        let covariance = Matrix2::new(4.0, 1.0, 1.0, 2.0);
        let [x, y] = outline(Complex::new(1.0, -1.0), covariance, 2.5).unwrap();
        let inverse = covariance.try_inverse().unwrap();
        for (x, y) in x.iter().zip(&y) {
            let by = nalgebra::Vector2::new(x - 1.0, y + 1.0);
            assert!(((inverse * by).dot(&by) - 6.25).abs() < 1e-9);
        }
        assert_eq!(
            outline(Complex::new(0.0, 0.0), covariance * f64::NAN, 1.0),
            None
        );
    }
}
