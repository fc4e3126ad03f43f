//! Line plots as inline SVG. Colours are CSS classes, so that a plot follows the page's light or dark
//! theme.

use super::axis::Scale;
use super::html::escape;
use std::fmt::Write;

/// Width of a plot's drawing [px in the drawing's own units; the page scales it].
const WIDTH: f64 = 920.0;
/// Margins around the axes: left, right, top, bottom.
const MARGINS: (f64, f64, f64, f64) = (64.0, 16.0, 12.0, 46.0);

/// One line, or several drawn alike.
#[derive(Debug, Clone)]
pub struct Line {
    /// Its entry in the legend; lines with the same one share it.
    pub label: String,
    /// CSS class: colour and stroke.
    pub class: String,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates; NaN leaves a gap.
    pub y: Vec<f64>,
}

/// A plot of lines over common axes.
#[derive(Debug, Clone)]
pub struct Plot {
    /// What the figure shows, for those who cannot see it.
    pub description: String,
    /// Label of the abscissa, with unit.
    pub x_label: String,
    /// Label of the ordinate, with unit.
    pub y_label: String,
    /// Whether the abscissae are decimal logarithms, to be labelled with the numbers themselves.
    pub x_in_decades: bool,
    /// Height of the drawing [px].
    pub height: f64,
    /// The lines, drawn in this order.
    pub lines: Vec<Line>,
}

impl Plot {
    /// The plot as an `<svg>` element below its legend.
    pub fn to_svg(&self) -> String {
        let x = Scale::covering(
            self.lines.iter().flat_map(|line| line.x.iter().copied()),
            0.0,
        );
        let x = match self.x_in_decades {
            true => x.in_decades(),
            false => x,
        };
        let y = Scale::covering(
            self.lines.iter().flat_map(|line| line.y.iter().copied()),
            0.05,
        );
        let frame = Frame::new(x, y, self.height);
        let mut svg = self.legend();
        let _ = writeln!(
            svg,
            "<svg viewBox=\"0 0 {WIDTH} {}\" role=\"img\" aria-label=\"{}\">",
            self.height,
            escape(&self.description)
        );
        svg += &frame.grid();
        svg += &frame.labels(&self.x_label, &self.y_label);
        for line in &self.lines {
            let _ = writeln!(
                svg,
                "<path class=\"line {}\" d=\"{}\"><title>{}</title></path>",
                line.class,
                frame.path(&line.x, &line.y),
                escape(&line.label)
            );
        }
        svg + "</svg>\n"
    }

    /// One entry for each different label, in order of appearance.
    fn legend(&self) -> String {
        let mut seen: Vec<&str> = Vec::new();
        let mut html = String::from("<ul class=\"legend\">\n");
        for line in &self.lines {
            if seen.contains(&line.label.as_str()) {
                continue;
            }
            seen.push(&line.label);
            let _ = writeln!(
                html,
                "<li><svg viewBox=\"0 0 28 10\" aria-hidden=\"true\"><path class=\"line {}\" d=\"M1 5H27\"/></svg>{}</li>",
                line.class,
                escape(&line.label)
            );
        }
        html + "</ul>\n"
    }
}

/// The rectangle between the axes, and what maps data into it.
struct Frame {
    x: Scale,
    y: Scale,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Frame {
    fn new(x: Scale, y: Scale, height: f64) -> Self {
        let (left, right, top, bottom) = MARGINS;
        Self {
            x,
            y,
            left,
            right: WIDTH - right,
            top,
            bottom: height - bottom,
        }
    }

    fn px(&self, x: f64) -> f64 {
        self.left + self.x.position(x) * (self.right - self.left)
    }

    fn py(&self, y: f64) -> f64 {
        self.bottom - self.y.position(y) * (self.bottom - self.top)
    }

    /// Grid lines and tick labels; the zero line is drawn stronger.
    fn grid(&self) -> String {
        let mut svg = String::from("<g class=\"grid\">\n");
        let (left, right, top, bottom) = (self.left, self.right, self.top, self.bottom);
        for &tick in &self.x.ticks {
            let x = self.px(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {top}V{bottom}\"/><text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 18.0,
                self.x.label(tick)
            );
        }
        for &tick in &self.y.ticks {
            let y = self.py(tick);
            let class = if tick == 0.0 { " class=\"zero\"" } else { "" };
            let _ = writeln!(
                svg,
                "<path{class} d=\"M{left} {y:.1}H{right}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 8.0,
                y + 4.5,
                self.y.label(tick)
            );
        }
        svg + "</g>\n"
    }

    fn labels(&self, x_label: &str, y_label: &str) -> String {
        let (x, y) = (
            (self.left + self.right) / 2.0,
            (self.top + self.bottom) / 2.0,
        );
        format!(
            "<text class=\"axis\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text class=\"axis\" transform=\"translate(16 {y:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
            self.bottom + 40.0,
            escape(x_label),
            escape(y_label)
        )
    }

    /// The path through the points that are numbers; a gap where one is not.
    fn path(&self, x: &[f64], y: &[f64]) -> String {
        let mut path = String::new();
        let mut pen_down = false;
        for (&x, &y) in x.iter().zip(y) {
            let drawable = x.is_finite() && y.is_finite();
            if drawable {
                let command = if pen_down { 'L' } else { 'M' };
                let _ = write!(path, "{command}{:.1} {:.1}", self.px(x), self.py(y));
            }
            pen_down = drawable;
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(y: Vec<f64>) -> String {
        let line = Line {
            label: "a < b".into(),
            class: "data".into(),
            x: (0..y.len()).map(|k| k as f64).collect(),
            y,
        };
        let plot = Plot {
            description: "test".into(),
            x_label: "time [s]".into(),
            y_label: "position [m]".into(),
            x_in_decades: false,
            height: 300.0,
            lines: vec![line.clone(), line],
        };
        plot.to_svg()
    }

    #[test]
    fn a_missing_sample_leaves_a_gap_and_a_label_appears_once_in_the_legend() {
        let svg = plot(vec![0.0, 1.0, f64::NAN, 3.0, 4.0]);
        let drawn: Vec<&str> = svg
            .split("<path class=\"line data\" d=\"")
            .skip(2)
            .collect();
        let path = drawn[0].split('"').next().unwrap_or("");
        assert_eq!(path.matches('M').count(), 2, "{path}");
        assert_eq!(path.matches('L').count(), 2, "{path}");
        assert_eq!(svg.matches("<li>").count(), 1);
        assert!(svg.contains("a &lt; b") && !svg.contains("a < b") && !svg.contains("NaN"));
    }
}
