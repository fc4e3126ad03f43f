//! Line plots as SVG with a style and a legend of their own, so that one copied out of its page still is as it was.
//! They follow the reader's light or dark theme and keep their text legible on narrow screens.

use super::axis::Scale;
use super::frame::Frame;
use super::html::escape;
use super::thin::thinned;
use std::borrow::Cow;
use std::fmt::Write;

/// Width of a plot's drawing [px in the drawing's own units; the page scales it].
pub(super) const WIDTH: f64 = 720.0;
/// Number of colours of lines.
pub(super) const N_COLOURS: usize = 8;
/// Number of shades of one colour.
const N_SHADES: usize = 3;
/// Points of all lines of a figure that tell their values under the pointer, about.
const POINTS: usize = 1500;

/// One line.
#[derive(Debug, Clone)]
pub struct Line {
    /// Its entry in the legend; lines with the same one share it.
    pub label: String,
    /// Its own name, shown under the pointer: the run, say.
    pub name: String,
    /// CSS class: colour and stroke.
    pub class: String,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates; NaN leaves a gap.
    pub y: Vec<f64>,
}

/// A point with words of its own.
#[derive(Debug, Clone)]
pub struct Mark {
    /// Abscissa.
    pub x: f64,
    /// Ordinate.
    pub y: f64,
    /// What it is.
    pub text: String,
}

/// How the axes are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// Both linear.
    Linear,
    /// The abscissae are decimal logarithms, labelled with the numbers themselves.
    Decades,
    /// Both linear, and a unit as long on the one as on the other.
    Equal,
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
    /// How the axes are divided.
    pub axes: Axes,
    /// Height of the drawing \[px\].
    pub height: f64,
    /// The lines, drawn in this order.
    pub lines: Vec<Line>,
    /// Points with words, drawn last.
    pub marks: Vec<Mark>,
}

/// The CSS class of the line with that number, counted from 0; colours come again after [`N_COLOURS`].
pub(super) fn colour(number: usize) -> String {
    format!("line-{}", number % N_COLOURS + 1)
}

impl Plot {
    /// The plot as an `<svg>` element, with its legend above the axes.
    pub fn to_svg(&self) -> String {
        let frame = self.frame();
        let (legend, above) = self.legend();
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 {} {WIDTH} {}\" role=\"img\" aria-label=\"{}\">\n\
             <style>\n{}</style>\n<rect class=\"ground\" y=\"{}\" width=\"100%\" height=\"100%\"/>\n{legend}",
            -above,
            self.height + above,
            escape(&self.description),
            include_str!("plot.css"),
            -above
        );
        svg += &frame.grid();
        svg += &frame.labels(&self.x_label, &self.y_label);
        let points = (POINTS / self.lines.len().max(1)).clamp(4, 60);
        for (line, shade) in self.lines.iter().zip(self.shades()) {
            svg += &self.drawn(line, shade, &frame, points);
        }
        svg += &self.marked(&frame);
        svg + "</svg>\n"
    }

    /// The marks, with words beside those that leave room for them; the others tell theirs to the pointer.
    fn marked(&self, frame: &Frame) -> String {
        const ROOM: (f64, f64) = (150.0, 26.0);
        let mut told: Vec<(f64, f64)> = Vec::new();
        let mut svg = String::new();
        for mark in &self.marks {
            svg += &frame.spot("mark", 4.5, mark.x, mark.y, &mark.text);
            let at = (frame.px(mark.x), frame.py(mark.y));
            let is_near = |other: &(f64, f64)| {
                (at.0 - other.0).abs() < ROOM.0 && (at.1 - other.1).abs() < ROOM.1
            };
            if !told.iter().any(is_near) {
                svg += &frame.words(mark.x, mark.y, &mark.text);
                told.push(at);
            }
        }
        svg
    }

    fn frame(&self) -> Frame {
        let lines = || self.lines.iter();
        let x_margin = if self.axes == Axes::Equal { 0.05 } else { 0.0 };
        let x = Scale::covering(lines().flat_map(|line| line.x.iter().copied()), x_margin);
        let y = Scale::covering(lines().flat_map(|line| line.y.iter().copied()), 0.05);
        let frame = Frame::new(x, y, WIDTH, self.height);
        match self.axes {
            Axes::Linear => frame,
            Axes::Decades => frame.in_decades(),
            Axes::Equal => frame.equal(),
        }
    }

    /// A line, and points on it that tell its name and values.
    fn drawn(&self, line: &Line, shade: usize, frame: &Frame, points: usize) -> String {
        let (x, y) = match thinned(&line.x, &line.y) {
            Some((x, y)) => (Cow::Owned(x), Cow::Owned(y)),
            None => (Cow::Borrowed(&line.x), Cow::Borrowed(&line.y)),
        };
        let mut svg = format!(
            "<g class=\"run\"><path class=\"line {} shade-{shade}\" d=\"{}\"><title>{}</title></path>\n",
            line.class,
            frame.path(&x, &y),
            escape(&line.name)
        );
        let every = line.x.len().div_ceil(points).max(1);
        for (&x, &y) in line.x.iter().zip(&line.y).skip(every / 2).step_by(every) {
            let shown = match self.axes {
                Axes::Decades => 10f64.powf(x),
                _ => x,
            };
            let values = [value(&self.x_label, shown), value(&self.y_label, y)];
            let text = format!("{}\n{}", line.name, values.join("\n"));
            svg += &frame.spot("point", 6.0, x, y, &text);
        }
        svg + "</g>\n"
    }

    /// Lines of one colour in turn in its shades, from 1.
    fn shades(&self) -> impl Iterator<Item = usize> {
        (0..self.lines.len()).map(|i| {
            let before = self.lines[..i].iter();
            let alike = before.filter(|line| line.class == self.lines[i].class);
            alike.count() % N_SHADES + 1
        })
    }

    /// One entry for each different label, in order of appearance, in rows above the drawing; and their height.
    fn legend(&self) -> (String, f64) {
        // Of the largest text, that of narrow screens; and what is before and behind a label.
        const ROW: f64 = 30.0;
        const LETTER: f64 = 12.5;
        const AROUND: f64 = 60.0;
        let mut entries: Vec<&Line> = Vec::new();
        for line in &self.lines {
            if !entries.iter().any(|entry| entry.label == line.label) {
                entries.push(line);
            }
        }
        let letters = entries.iter().map(|line| line.label.chars().count());
        let widest = AROUND + LETTER * letters.max().unwrap_or(0) as f64;
        let columns = (WIDTH / widest).max(1.0) as usize;
        let above = ROW * entries.len().div_ceil(columns) as f64;
        let mut svg = String::new();
        for (i, line) in entries.iter().enumerate() {
            let x = widest * (i % columns) as f64 + 6.0;
            let y = ROW * ((i / columns) as f64 + 0.5) - above;
            let _ = writeln!(
                svg,
                "<path class=\"line {}\" d=\"M{x:.1} {y:.1}h28\"/><text class=\"axis\" x=\"{:.1}\" y=\"{y:.1}\" dy=\"0.35em\">{}</text>",
                line.class,
                x + 36.0,
                escape(&line.label)
            );
        }
        (svg, above)
    }
}

/// `position 5.31 m` of the label `position [m]`.
fn value(label: &str, value: f64) -> String {
    let number = super::number::significant(value, 4).replace('-', "\u{2212}");
    match label.split_once(" [") {
        Some((name, unit)) => match unit.trim_end_matches(']') {
            "1" => format!("{name} {number}"),
            unit => format!("{name} {number} {unit}"),
        },
        None => format!("{label} {number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str, y: Vec<f64>) -> Line {
        Line {
            label: "a < b".into(),
            name: name.into(),
            class: "data".into(),
            x: (0..y.len()).map(|k| k as f64).collect(),
            y,
        }
    }

    fn plot(lines: Vec<Line>, axes: Axes) -> Plot {
        Plot {
            description: "test".into(),
            x_label: "time [s]".into(),
            y_label: "position [m]".into(),
            axes,
            height: 300.0,
            lines,
            marks: Vec::new(),
        }
    }

    #[test]
    fn a_missing_sample_leaves_a_gap_and_a_label_appears_once_in_the_legend() {
        let line = line("run 1", vec![0.0, 1.0, f64::NAN, 3.0, 4.0]);
        let svg = plot(vec![line.clone(), line], Axes::Linear).to_svg();
        let drawn: Vec<&str> = (svg.split("<path class=\"line data shade-1\" d=\""))
            .skip(1)
            .collect();
        let path = drawn[0].split('"').next().unwrap_or("");
        assert_eq!(path.matches('M').count(), 2, "{path}");
        assert_eq!(path.matches('L').count(), 2, "{path}");
        assert_eq!(svg.matches(">a &lt; b</text>").count(), 1);
        assert!(svg.contains("a &lt; b") && !svg.contains("a < b") && !svg.contains("NaN"));
    }

    /// A run can be told from its neighbours: by its shade, and by its name with time and value.
    #[test]
    fn runs_of_one_colour_have_names_values_and_shades() {
        let lines = (1..=4).map(|i| line(&format!("run {i}"), vec![-0.5, 2.0 * f64::from(i)]));
        let svg = plot(lines.collect(), Axes::Linear).to_svg();
        for text in [
            "<title>run 1\ntime 0 s\nposition \u{2212}0.5000 m</title>",
            "<title>run 4\ntime 1.000 s\nposition 8.000 m</title>",
        ] {
            assert!(svg.contains(text), "{text}\n{svg}");
        }
        for (shade, count) in [(1, 2), (2, 1), (3, 1)] {
            let class = format!("\"line data shade-{shade}\"");
            assert_eq!(svg.matches(&class).count(), count, "{class}");
        }
    }

    /// What is copied out of the page is a document of its own.
    #[test]
    fn a_plot_is_a_whole_document_with_its_own_style() {
        let html = plot(vec![line("r", vec![0.0, 1.0])], Axes::Linear).to_svg();
        let document = roxmltree::Document::parse(&html).unwrap();
        let root = document.root_element();
        assert_eq!(
            root.tag_name().namespace(),
            Some("http://www.w3.org/2000/svg")
        );
        let style = root.children().find(|node| node.has_tag_name("style"));
        let style = style.and_then(|node| node.text()).unwrap_or_default();
        for class in root
            .descendants()
            .filter_map(|node| node.attribute("class"))
        {
            for class in class.split(' ').filter(|class| *class != "shade-1") {
                assert!(style.contains(&format!(".{class}")), "{class} has no style");
            }
        }
        assert!(!style.contains("var("), "a variable of the page");
    }

    /// Each label once beside a line of its look, above the axes and inside the drawing, in as many rows as it takes.
    #[test]
    fn the_legend_is_in_the_drawing() {
        for (labels, columns) in [
            (["a", "b", "c"], 3),
            (["a", "quadcopter.omega_f [krad/s]", "c"], 1),
        ] {
            let lines = labels.map(|label| Line {
                label: label.into(),
                class: format!("line-{}", label.len()),
                ..line("r", vec![0.0, 1.0])
            });
            let svg = plot([&lines[..], &lines[..1]].concat(), Axes::Linear).to_svg();
            let document = roxmltree::Document::parse(&svg).unwrap();
            let root = document.root_element();
            let view = root.attribute("viewBox").unwrap().split(' ');
            let view: Vec<f64> = view.map(|number| number.parse().unwrap()).collect();
            let rows = (3.0 / f64::from(columns)).ceil();
            assert_eq!(view, [0.0, -30.0 * rows, WIDTH, 300.0 + 30.0 * rows]);
            for line in &lines {
                let is_entry = |node: &roxmltree::Node| node.text() == Some(line.label.as_str());
                let entries: Vec<_> = root.children().filter(is_entry).collect();
                assert_eq!(entries.len(), 1, "{svg}");
                let y: f64 = entries[0].attribute("y").unwrap().parse().unwrap();
                assert!(y > view[1] && y < 0.0, "{y}");
                let key = entries[0].prev_sibling_element().unwrap();
                assert_eq!(
                    key.attribute("class"),
                    Some(&*format!("line {}", line.class))
                );
            }
        }
    }

    #[test]
    fn equal_axes_have_units_of_one_length() {
        let mut wide = line("r", vec![-0.1, 0.3]);
        wide.x = vec![-3.0, 5.0];
        let frame = plot(vec![wide], Axes::Equal).frame();
        let across = frame.px(1.0) - frame.px(0.0);
        let up = frame.py(0.0) - frame.py(1.0);
        assert!((across - up).abs() < 1e-9 && across > 0.0, "{across} {up}");
    }

    #[test]
    fn a_long_recording_is_drawn_with_a_bounded_number_of_points() {
        let y = (0..200_000).map(|k| f64::from(k % 977)).collect();
        let svg = plot(vec![line("long", y)], Axes::Linear).to_svg();
        assert!(svg.len() < 200_000, "{}", svg.len());
    }
}
