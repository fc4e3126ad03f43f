//! Figures about the uncertainty of a fit: correlations and profiles of its parameters, and the objectives of its
//! starts.

use super::figure::{Axis, Figure, Look, Panel, Series};
use nalgebra::DMatrix;

/// Relative difference of objectives within which starts agree.
const SAME: f64 = 1e-3;

/// Correlations as a colour map.
pub fn correlation_figure(names: &[String], correlations: &DMatrix<f64>) -> Figure {
    let n = names.len();
    let place =
        |of: fn(usize, usize) -> usize| (0..n * n).map(|k| of(k, n) as f64).collect::<Vec<_>>();
    let axis = |names: Vec<String>| Axis {
        names,
        ..Axis::default()
    };
    let longest = names.iter().map(|name| name.chars().count()).max();
    let turned = longest.filter(|longest| *longest > 6);
    // The first row is at the top, as in a matrix.
    let cells = Series {
        look: Look::Cells,
        x: place(|k, n| k % n),
        y: place(|k, n| n - 1 - k / n),
        values: (0..n * n).map(|k| correlations[(k / n, k % n)]).collect(),
        ..Series::default()
    };
    let panel = Panel {
        x: axis(names.to_vec()),
        y: axis(names.iter().rev().cloned().collect()),
        height: (36.0 * n as f64 + 60.0).min(620.0)
            + turned.map_or(0.0, |longest| 6.0 * longest as f64),
        series: vec![cells],
        ..Panel::default()
    };
    let caption = "Correlations of the parameters' estimates: near 1 (blue) or \u{2212}1 (orange), the data determine \
                   a combination of two better than each alone.";
    Figure::of("correlations", "Correlations", caption, panel)
}

/// The final objectives of the starts, best first; for each start, whether it converged and its objective.
pub fn waterfall_figure(unit: &str, starts: &[(bool, f64)]) -> Figure {
    let mut sorted: Vec<(bool, f64)> = starts
        .iter()
        .copied()
        .filter(|(_, own)| own.is_finite())
        .collect();
    sorted.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    let of = |wanted: bool, label: &str, colour: &str, look: Look| {
        let own = sorted
            .iter()
            .enumerate()
            .filter(|(_, (converged, _))| *converged == wanted);
        let (x, y): (Vec<f64>, Vec<f64>) = own.map(|(k, (_, own))| (k as f64, *own)).unzip();
        Series::line(label, colour, &x, &y).looks(look)
    };
    let series = [
        of(true, "converged", "line-1", Look::Dots),
        of(false, "not converged", "line-2", Look::Crosses),
    ];
    // Logarithmic if positive objectives differ by more than a power of ten.
    let (best, worst) = (sorted.first(), sorted.last());
    let is_wide = best
        .zip(worst)
        .is_some_and(|(best, worst)| best.1 > 0.0 && worst.1 > 10.0 * best.1);
    let panel = Panel {
        x: Axis {
            names: (1..=sorted.len()).map(|k| k.to_string()).collect(),
            ..Axis::linear("start, best first")
        },
        y: Axis {
            log: is_wide,
            least: SAME * best.map_or(0.0, |best| best.1.abs()),
            ..Axis::of("objective", unit)
        },
        height: 220.0,
        series: series.into_iter().filter(|own| !own.x.is_empty()).collect(),
        ..Panel::default()
    };
    let caption = "Where each start ended. A step at the left with several starts on it is an optimum found more than once.";
    Figure::of("waterfall", "Starts", caption, panel)
}

/// The profile of a parameter.
#[derive(Debug, Clone)]
pub struct ProfileShown {
    /// Name of the parameter.
    pub name: String,
    /// Parameter value, ζ, and whether a limit is active that is not active at the estimate.
    pub points: Vec<(f64, f64, bool)>,
}

/// Profiles of the objective, a panel for each parameter; the interval is where ζ² is below the threshold.
pub fn profile_figure(profiles: &[ProfileShown], threshold: f64) -> Figure {
    let panel = |own: &ProfileShown| {
        let of = |on_limit: bool| -> (Vec<f64>, Vec<f64>) {
            let own = own.points.iter().filter(|point| point.2 == on_limit);
            own.map(|(value, root, _)| (*value, root * root)).unzip()
        };
        let (x, y) = between(&own.points);
        let ends = [x[0], x[x.len() - 1]];
        let ((free, above), (held, on)) = (of(false), of(true));
        let mut series = vec![
            Series::line("95 %", "goal", &ends, &[threshold; 2]).looks(Look::Dashed),
            Series::line("profile", "line-1", &x, &y),
            Series::line("refit", "line-1", &free, &above).looks(Look::Dots),
            Series::line("refit on another limit", "line-2", &held, &on).looks(Look::Crosses),
        ];
        series.retain(|own| !own.x.is_empty());
        Panel {
            x: Axis::linear(&own.name),
            y: Axis::linear("\u{3b6}\u{b2}"),
            height: 200.0,
            series,
            ..Panel::default()
        }
    };
    Figure {
        name: "profiles".into(),
        title: "Profiles".into(),
        caption: "The least objective with a parameter fixed, above the least of all, per variance of the residuals: the \
                  parabola of a linear model, or what is there instead. The interval is where it is below the broken \
                  line."
            .into(),
        panels: profiles.iter().filter(|own| own.points.len() > 1).map(panel).collect(),
    }
}

/// ζ² between refits, with ζ interpolated linearly: the exact parabola for a linear model.
fn between(points: &[(f64, f64, bool)]) -> (Vec<f64>, Vec<f64>) {
    const PARTS: usize = 12;
    let at = |pair: &[(f64, f64, bool)], k: usize| {
        let part = k as f64 / PARTS as f64;
        let mix = |a: f64, b: f64| a + part * (b - a);
        let root = mix(pair[0].1, pair[1].1);
        (mix(pair[0].0, pair[1].0), root * root)
    };
    let parts = points
        .windows(2)
        .flat_map(|pair| (0..PARTS).map(move |k| at(pair, k)));
    let last = points.last().map(|own| (own.0, own.1 * own.1));
    parts.chain(last).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_map_is_the_matrix() {
        let names = ["a", "b"].map(str::to_owned);
        let figure = correlation_figure(&names, &dmatrix![1.0, 0.25; -0.5, 1.0]);
        let cells = &figure.panels[0].series[0];
        let at = |x: f64, y: f64| {
            let place = cells.points().position(|point| point == (x, y)).unwrap();
            cells.values[place]
        };
        // Row a is above row b.
        assert_eq!(
            [at(0.0, 1.0), at(1.0, 1.0), at(0.0, 0.0), at(1.0, 0.0)],
            [1.0, 0.25, -0.5, 1.0]
        );
    }

    #[test]
    fn profiles_tell_the_points_on_limits() {
        let own = |name: &str, points: &[(f64, f64, bool)]| ProfileShown {
            name: name.into(),
            points: points.to_vec(),
        };
        let points = [(1.0, -2.0, true), (2.0, 0.0, false), (3.5, 3.0, false)];
        let figure = profile_figure(&[own("gain", &points), own("none", &points[..1])], 3.84);
        assert_eq!(figure.panels.len(), 1);
        let [threshold, line, refits, limits] = &figure.panels[0].series[..] else {
            panic!("{figure:?}");
        };
        assert_eq!(
            (&threshold.x, &threshold.y),
            (&vec![1.0, 3.5], &vec![3.84; 2])
        );
        // ζ = 2 (value - 2).
        assert!(
            line.points()
                .all(|(x, y)| (y - 4.0 * (x - 2.0).powi(2)).abs() < 1e-12)
        );
        assert_eq!((&refits.x, &refits.y), (&vec![2.0, 3.5], &vec![0.0, 9.0]));
        assert_eq!((&limits.x, &limits.y), (&vec![1.0], &vec![4.0]));
    }

    #[test]
    fn starts_are_ranked_by_their_objective() {
        let figure = waterfall_figure(
            "m²",
            &[(true, 3.0), (false, 1.0), (true, 2.0), (false, f64::NAN)],
        );
        let series = &figure.panels[0].series;
        assert_eq!(
            (&series[0].x, &series[0].y),
            (&vec![1.0, 2.0], &vec![2.0, 3.0])
        );
        assert_eq!((&series[1].x, &series[1].y), (&vec![0.0], &vec![1.0]));
    }
}
