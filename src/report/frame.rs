//! The rectangle between the axes of a plot, and what maps data into it.

use super::axis::Scale;
use super::html::escape;
use std::fmt::Write;

/// Margins around the axes: right, top, bottom. Text is up to 24 units high where the screen is narrow: two
/// such lines are below.
const MARGINS: (f64, f64, f64) = (20.0, 38.0, 64.0);

/// Width of a digit where the screen is narrow.
const DIGIT: f64 = 13.5;

/// The rectangle in the drawing's units, with its scales.
pub struct Frame {
    x: Scale,
    y: Scale,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Frame {
    /// In a drawing of that size.
    pub fn new(x: Scale, y: Scale, width: f64, height: f64) -> Self {
        let (right, top, bottom) = MARGINS;
        let digits = |tick: &f64| y.label(*tick).chars().count();
        let longest = y.ticks.iter().map(digits).max().unwrap_or(0).max(4);
        Self {
            left: DIGIT * longest as f64 + 12.0,
            x,
            y,
            right: width - right,
            top,
            bottom: height - bottom,
        }
    }

    /// With abscissae that are decimal logarithms.
    pub fn in_decades(self) -> Self {
        Self {
            x: self.x.in_decades(),
            ..self
        }
    }

    /// With a unit as long on the one axis as on the other: the one that has room reaches further.
    pub fn equal(self) -> Self {
        let (width, height) = (self.right - self.left, self.bottom - self.top);
        let (across, up) = (self.x.range() / width, self.y.range() / height);
        let longest = across.max(up);
        Self {
            x: self.x.reaching(longest * width),
            y: self.y.reaching(longest * height),
            ..self
        }
    }

    /// Where a value is drawn across.
    pub fn px(&self, x: f64) -> f64 {
        self.left + self.x.position(x) * (self.right - self.left)
    }

    /// Where a value is drawn down.
    pub fn py(&self, y: f64) -> f64 {
        self.bottom - self.y.position(y) * (self.bottom - self.top)
    }

    /// Grid lines and tick labels; the zero line is drawn stronger. Every other label across may be left
    /// out where the screen is narrow.
    pub fn grid(&self) -> String {
        let mut svg = String::from("<g class=\"grid\">\n");
        let (left, right, top, bottom) = (self.left, self.right, self.top, self.bottom);
        for (i, &tick) in self.x.ticks.iter().enumerate() {
            let x = self.px(tick);
            let class = if i % 2 == 1 { " class=\"between\"" } else { "" };
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {top}V{bottom}\"/><text{class} x=\"{x:.1}\" y=\"{bottom}\" dy=\"1.2em\" text-anchor=\"middle\">{}</text>",
                self.x.label(tick)
            );
        }
        for &tick in &self.y.ticks {
            let y = self.py(tick);
            let class = if tick == 0.0 { " class=\"zero\"" } else { "" };
            let _ = writeln!(
                svg,
                "<path{class} d=\"M{left} {y:.1}H{right}\"/><text x=\"{:.1}\" y=\"{y:.1}\" dy=\"0.35em\" text-anchor=\"end\">{}</text>",
                left - 6.0,
                self.y.label(tick)
            );
        }
        svg + "</g>\n"
    }

    /// The axes' labels: one below, one above the ordinate, where it is read without turning the head.
    pub fn labels(&self, x_label: &str, y_label: &str) -> String {
        let middle = (self.left + self.right) / 2.0;
        format!(
            "<text class=\"axis\" x=\"{middle:.1}\" y=\"{:.1}\" dy=\"2.4em\" text-anchor=\"middle\">{}</text>\n\
             <text class=\"axis\" x=\"6\" y=\"{:.1}\">{}</text>\n",
            self.bottom,
            escape(x_label),
            self.top - 10.0,
            escape(y_label)
        )
    }

    /// The path through the points that are numbers; a gap where one is not.
    pub fn path(&self, x: &[f64], y: &[f64]) -> String {
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

    /// Words beside a point, on its right unless that is near the end; nothing where there is no number.
    pub fn words(&self, x: f64, y: f64, text: &str) -> String {
        if !(x.is_finite() && y.is_finite()) {
            return String::new();
        }
        let (dx, anchor) = match self.x.position(x) < 0.7 {
            true => (9.0, "start"),
            false => (-9.0, "end"),
        };
        let (x, y) = (self.px(x) + dx, self.py(y) - 6.0);
        let text = escape(text);
        format!(
            "<text class=\"axis\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{text}</text>\n"
        )
    }

    /// A spot with words for the pointer; nothing where there is no number.
    pub fn spot(&self, class: &str, radius: f64, x: f64, y: f64, text: &str) -> String {
        if !(x.is_finite() && y.is_finite()) {
            return String::new();
        }
        let (x, y, text) = (self.px(x), self.py(y), escape(text));
        format!(
            "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"><title>{text}</title></circle>\n"
        )
    }
}
