//! What a fit is not sure of: correlations of its parameters, and where its starts ended.

use super::figure::{Axis, Figure, Look, Panel, Series};
use nalgebra::DMatrix;

/// Part of the objective within which starts agree.
const SAME: f64 = 1e-3;

/// Correlations as a map of colours.
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
    let caption = "Correlations of the parameters' estimates: near 1 (blue) or \u{2212}1 (orange), the data tell a \
                   combination of two, and each alone less well.";
    Figure::of("correlations", "Correlations", caption, panel)
}

/// The objectives at which starts ended, best first; `has_converged` for each.
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
    // Objectives of one sign that differ by more than a power of ten.
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
