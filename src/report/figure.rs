//! Data of a figure: panels of series over common axes. The page draws it with uPlot (`page.js`); files are written as
//! SVG (`svg.rs`) or CSV with the same content.

use super::thin::thinned;
use pilotage_text::number::rounded;
use serde::{Deserialize, Serialize};

/// Approximate maximum number of points of all series of a panel: more than a screen shows.
const POINTS: usize = 60_000;
/// Significant digits of a point.
const DIGITS: usize = 9;

/// A figure on a page or in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// Name on the command line.
    pub name: String,
    /// Heading.
    pub title: String,
    /// A sentence of explanation.
    pub caption: String,
    /// Panels from top to bottom. Those with the same abscissa are zoomed together.
    pub panels: Vec<Panel>,
}

/// Series over common axes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// The abscissa.
    pub x: Axis,
    /// The ordinate.
    pub y: Axis,
    /// Whether both axes have the same scale.
    pub equal: bool,
    /// Height on a page 720 px wide \[px\].
    pub height: f64,
    /// The series, in drawing order.
    pub series: Vec<Series>,
}

/// An axis.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Quantity with its unit in brackets: `position [m]`.
    pub label: String,
    /// Whether the axis is logarithmic; values are not transformed.
    pub log: bool,
    /// Category labels at the integers from 0; empty for a numeric axis.
    #[serde(default)]
    pub names: Vec<String>,
    /// Minimum range of a linear axis, below which differences are not shown.
    #[serde(default)]
    pub least: f64,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// A line through all points.
    #[default]
    Line,
    /// A dashed line.
    Dashed,
    /// The closed polygon of the points, lightly filled: bands, ellipses.
    Area,
    /// Filled circles.
    Dots,
    /// Circles.
    Rings,
    /// Oblique crosses.
    Crosses,
    /// Vertical lines from zero to the points.
    Stems,
    /// Unit squares centred at integers, coloured by `values` from -1 to 1.
    Cells,
}

/// Data drawn in one colour.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Legend entry, shared by series with the same label; empty for none.
    pub label: String,
    /// Name of the run; empty if the series belongs to none.
    #[serde(default)]
    pub run: String,
    /// Name in the [palette](super::palette).
    pub colour: String,
    /// Drawing style.
    pub look: Look,
    /// Abscissae.
    #[serde(with = "gaps")]
    pub x: Vec<f64>,
    /// Ordinates; NaN leaves a gap.
    #[serde(with = "gaps")]
    pub y: Vec<f64>,
    /// Text labels of the points; one for each, or none.
    #[serde(default)]
    pub words: Vec<String>,
    /// Values that determine the colours of the points; one for each, or none.
    #[serde(default, with = "gaps")]
    pub values: Vec<f64>,
}

impl Panel {
    /// Lines over time, with this label of the ordinate.
    pub fn over_time(label: &str, height: f64, series: Vec<Series>) -> Self {
        Self {
            x: Axis::time(),
            y: Axis::linear(label),
            height,
            series,
            ..Self::default()
        }
    }
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// An axis of time.
    pub fn time() -> Self {
        Self::linear("time [s]")
    }

    /// A logarithmic axis of frequency.
    pub fn frequency() -> Self {
        Self {
            log: true,
            ..Self::linear("frequency [rad/s]")
        }
    }

    /// A linear axis for a quantity with a unit name; `1` and an empty unit are not shown.
    pub fn of(what: &str, unit: &str) -> Self {
        Self::linear(match unit {
            "" | "1" => what.to_owned(),
            unit => format!("{what} [{}]", pilotage_units::pretty(unit)),
        })
    }
}

impl Series {
    /// A line.
    pub fn line(label: &str, colour: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self {
            label: label.into(),
            colour: colour.into(),
            x: x.to_vec(),
            y: y.to_vec(),
            ..Self::default()
        }
    }

    /// Sets the drawing style.
    pub fn looks(self, look: Look) -> Self {
        Self { look, ..self }
    }

    /// Sets the run.
    pub fn of(self, run: &str) -> Self {
        Self {
            run: run.into(),
            ..self
        }
    }

    /// The area between two lines.
    pub fn band(label: &str, colour: &str, x: &[f64], [low, high]: [&[f64]; 2]) -> Self {
        let back = |values: &[f64]| values.iter().rev().copied().collect::<Vec<_>>();
        let (x, y) = ([x, &back(x)].concat(), [low, &back(high)].concat());
        Self::line(label, colour, &x, &y).looks(Look::Area)
    }

    /// The points with finite coordinates.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let all = self.x.iter().copied().zip(self.y.iter().copied());
        all.filter(|(x, y)| x.is_finite() && y.is_finite())
    }
}

impl Figure {
    /// A figure with one panel.
    pub fn of(name: &str, title: &str, caption: &str, panel: Panel) -> Self {
        Self {
            name: name.into(),
            title: title.into(),
            caption: caption.into(),
            panels: vec![panel],
        }
    }

    /// Names of the runs of its series, in order of appearance.
    pub fn runs(&self) -> Vec<&str> {
        let mut runs: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !series.run.is_empty() && !runs.contains(&series.run.as_str()) {
                runs.push(&series.run);
            }
        }
        runs
    }

    /// Reduces points and digits without a visible change on a screen.
    pub fn thinned(&self) -> Self {
        let mut figure = self.clone();
        for panel in &mut figure.panels {
            let parts = (POINTS / panel.series.len().max(1) / 4).clamp(50, 1500);
            for series in &mut panel.series {
                let is_line = matches!(series.look, Look::Line | Look::Dashed);
                if let Some((x, y)) = thinned(&series.x, &series.y, parts).filter(|_| is_line) {
                    (series.x, series.y) = (x, y);
                }
                let values = series.x.iter_mut().chain(&mut series.y);
                values.for_each(|value| *value = rounded(*value, DIGITS));
            }
        }
        figure
    }

    /// Keeps the series of one run and those of none.
    pub fn of_run(mut self, run: &str) -> Self {
        for panel in &mut self.panels {
            (panel.series).retain(|series| series.run.is_empty() || series.run == run);
        }
        self
    }

    /// All points as a CSV table: panel, run and label of the series, abscissa, ordinate, value.
    pub fn to_csv(&self) -> String {
        let mut rows = vec![["panel", "run", "series", "x", "y", "value"].map(str::to_owned)];
        for panel in &self.panels {
            for series in &panel.series {
                for (k, (x, y)) in series.x.iter().zip(&series.y).enumerate() {
                    let value = series.values.get(k).map_or(String::new(), f64::to_string);
                    let (x, y) = (x.to_string(), y.to_string());
                    let (run, label) = (series.run.clone(), series.label.clone());
                    rows.push([panel.y.label.clone(), run, label, x, y, value]);
                }
            }
        }
        super::csv(&rows)
    }
}

/// JSON arrays of numbers with `null` for gaps, since JSON has no NaN.
mod gaps {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
        let shown = values
            .iter()
            .map(|value| value.is_finite().then_some(value));
        serializer.collect_seq(shown)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
        let values = Vec::<Option<f64>>::deserialize(deserializer)?;
        let value = |value: Option<f64>| value.unwrap_or(f64::NAN);
        Ok(values.into_iter().map(value).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure() -> Figure {
        let line = Series::line("a", "data", &[0.0, 1.0, 2.0], &[0.1 + 0.2, f64::NAN, 3.0]);
        let panel = Panel {
            series: vec![line.clone().of("run 1"), line.clone().of("run 2"), line],
            ..Panel::default()
        };
        Figure::of("response", "Response", "", panel)
    }

    #[test]
    fn json_keeps_gaps_and_all_else() {
        let text = serde_json::to_string(&figure().thinned()).unwrap();
        assert!(text.contains("[0.3,null,3.0]"), "{text}");
        let back: Figure = serde_json::from_str(&text).unwrap();
        assert!(back.panels[0].series[0].y[1].is_nan());
        assert_eq!(back.panels[0].series[0].x, [0.0, 1.0, 2.0]);
        assert_eq!(back.runs(), ["run 1", "run 2"]);
    }

    #[test]
    fn one_run_stays_with_what_belongs_to_none() {
        let one = figure().of_run("run 2");
        let runs: Vec<&str> = one.panels[0].series.iter().map(|s| &*s.run).collect();
        assert_eq!(runs, ["run 2", ""]);
    }

    #[test]
    fn a_band_is_a_polygon() {
        let band = Series::band("", "aid", &[1.0, 2.0], [&[3.0, 4.0], &[5.0, 6.0]]);
        let points: Vec<_> = band.points().collect();
        assert_eq!(points, [(1.0, 3.0), (2.0, 4.0), (2.0, 6.0), (1.0, 5.0)]);
    }

    #[test]
    fn a_table_has_a_row_for_each_point() {
        let csv = figure().to_csv();
        assert_eq!(csv.lines().count(), 10);
        assert!(csv.contains("\n,run 1,a,1,NaN,\n"), "{csv}");
    }
}
