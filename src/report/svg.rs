//! Figures as SVG for papers: width in millimetres, 8-point text, only basic styles for compatibility.

use super::figure::{Figure, Look, Panel, Series};
use super::frame::{CHARACTER, Frame, TEXT};
use super::html::{Html, html};
use super::palette::{of_value, on_white};
use std::fmt::Write;

/// Families of fonts, the first that is there.
pub(super) const FONTS: &str = "Arial, Helvetica, 'Liberation Sans', 'DejaVu Sans', sans-serif";
/// Points per millimetre.
const POINTS: f64 = 72.0 / 25.4;
/// Width of a panel on a page [px] to which heights refer.
const PAGE: f64 = 720.0;
/// Opacities of series with the same colour, used in turn.
const SHADES: [f64; 3] = [1.0, 0.65, 0.4];

/// A figure as an SVG document of the given width \[mm\].
pub fn to_svg(figure: &Figure, width: f64) -> String {
    let width = width * POINTS;
    let (legend, mut y) = legend(figure, width);
    let left = figure.panels.iter().map(Frame::left).fold(0.0, f64::max);
    let mut drawn = Vec::new();
    for (k, panel) in figure.panels.iter().enumerate() {
        let next = figure.panels.get(k + 1);
        let is_last = next.is_none_or(|next| next.x.label != panel.x.label);
        let height = (panel.height * (width / PAGE).powf(0.7)).min(1.2 * width);
        let frame = Frame::new(panel, left, width, [y, y + height]);
        drawn.push(frame.axes(is_last));
        drawn.push(within(panel, &frame, k));
        y += height + Frame::below(panel, is_last) + 4.0;
    }
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(format_args!("{:.2}mm", width / POINTS))
            height=(format_args!("{:.2}mm", y / POINTS)) viewBox=(format_args!("0 0 {width:.2} {y:.2}"))
            font-family=(FONTS) font-size=(TEXT) {
            title { (figure.title) }
            rect width="100%" height="100%" fill="#ffffff" {}
            (legend)
            @for own in drawn { (own) }
        }
        "\n"
    };
    svg.into_string()
}

/// A coordinate or length, with the digits that drawings need.
pub(super) fn at(value: f64) -> String {
    format!("{value:.2}")
}

/// The series of a panel, clipped at its edges.
fn within(panel: &Panel, frame: &Frame, number: usize) -> Html {
    let [x, y, width, height] = frame.area();
    let shade = |(k, series): (usize, &Series)| {
        let before = panel.series[..k].iter();
        let alike = before.filter(|own| own.colour == series.colour && own.look == series.look);
        SHADES[alike.count() % SHADES.len()]
    };
    html! {
        clipPath id={ "panel" (number) } {
            rect x=(at(x)) y=(at(y)) width=(at(width)) height=(at(height)) {}
        }
        g clip-path={ "url(#panel" (number) ")" } {
            @for own in panel.series.iter().enumerate() { (drawn(own.1, frame, shade(own))) "\n" }
        }
        (words(panel, frame))
    }
}

/// A series as a path, or a square for each cell.
fn drawn(series: &Series, frame: &Frame, shade: f64) -> Html {
    let colour = on_white(&series.colour);
    let (is_area, is_dots) = (series.look == Look::Area, series.look == Look::Dots);
    let (width, dashes, join) = match series.look {
        Look::Cells => return cells(series, frame),
        Look::Area => (Some(0.3), None, None),
        Look::Dots => (None, None, None),
        Look::Dashed => (Some(0.9), Some("4 3"), None),
        _ if series.colour == "data" => (Some(0.7), None, None),
        _ => (Some(1.1), None, Some("round")),
    };
    html! {
        path fill=(if is_area || is_dots { colour } else { "none" }) fill-opacity=[is_area.then_some(0.18)]
            stroke=(if is_dots { "none" } else { colour }) stroke-width=[width] stroke-dasharray=[dashes]
            stroke-linejoin=[join] opacity=(if is_area { 1.0 } else { shade }) d=(path(series, frame)) {
            title { (series.run) " " (series.label) }
        }
    }
}

/// The path of a series, with gaps at non-finite points.
fn path(series: &Series, frame: &Frame) -> String {
    const R: f64 = 2.2;
    let mut path = String::new();
    let mut is_down = false;
    for point in series.x.iter().copied().zip(series.y.iter().copied()) {
        let (x, y) = frame.place(point);
        let is_there = x.is_finite() && y.is_finite();
        let _ = match series.look {
            _ if !is_there => Ok(()),
            Look::Dots | Look::Rings => write!(
                path,
                "M{:.2} {y:.2}a{R} {R} 0 1 0 {} 0a{R} {R} 0 1 0 {} 0z",
                x - R,
                2.0 * R,
                -2.0 * R
            ),
            Look::Crosses => {
                let (x, y, d) = (x - R, y - R, 2.0 * R);
                write!(
                    path,
                    "M{x:.2} {y:.2}l{d} {d}M{x:.2} {:.2}l{d} {}",
                    y + d,
                    -d
                )
            }
            Look::Stems => {
                let zero = frame.place((point.0, 0.0)).1;
                write!(path, "M{x:.2} {zero:.2}V{y:.2}")
            }
            _ => write!(path, "{}{x:.2} {y:.2}", if is_down { 'L' } else { 'M' }),
        };
        is_down = is_there;
    }
    match series.look {
        Look::Area if !path.is_empty() => path + "z",
        _ => path,
    }
}

/// Coloured squares with their values as text.
fn cells(series: &Series, frame: &Frame) -> Html {
    let ((x0, y0), (x1, y1)) = (frame.place((0.0, 0.0)), frame.place((1.0, 1.0)));
    let (width, height) = ((x1 - x0).abs(), (y1 - y0).abs());
    let cell = |(point, value): ((f64, f64), &f64)| {
        let (x, y) = frame.place(point);
        let (fill, ink) = match value.is_finite() {
            true if value.abs() > 0.6 => (of_value(*value), "#ffffff"),
            true => (of_value(*value), on_white("ink")),
            false => ("#edf0f3".to_owned(), on_white("ink")),
        };
        html! {
            rect x=(at(x - 0.5 * width)) y=(at(y - 0.5 * height)) width=(at(width)) height=(at(height)) fill=(fill)
                stroke="#ffffff" stroke-width="0.5" {}
            @if width > 2.5 * TEXT && value.is_finite() {
                text x=(at(x)) y=(at(y + 0.35 * TEXT)) text-anchor="middle" fill=(ink) {
                    (format!("{value:.2}").replace('-', "\u{2212}"))
                }
            }
        }
    };
    html! { @for own in series.points().zip(&series.values) { (cell(own)) } }
}

/// Text labels of points, omitted where they would overlap.
fn words(panel: &Panel, frame: &Frame) -> Html {
    const ROOM: (f64, f64) = (60.0, 10.0);
    let mut placed: Vec<(f64, f64)> = Vec::new();
    let mut drawn = Vec::new();
    for series in &panel.series {
        for (point, text) in series.points().zip(&series.words) {
            let (x, y) = frame.place(point);
            let is_near = |(a, b): &(f64, f64)| (a - x).abs() < ROOM.0 && (b - y).abs() < ROOM.1;
            if placed.iter().any(is_near) {
                continue;
            }
            placed.push((x, y));
            let (by, anchor) = match frame.is_right(x) {
                true => (-5.0, "end"),
                false => (5.0, "start"),
            };
            let (x, y) = (x + by, (y - 3.0).max(frame.area()[1] + TEXT));
            drawn.push(html! {
                text x=(at(x)) y=(at(y)) text-anchor=(anchor) fill=(on_white("ink")) { (text) }
            });
        }
    }
    html! { @for own in drawn { (own) } }
}

/// The legend above the panels, an entry for each distinct label, and its height.
fn legend(figure: &Figure, width: f64) -> (Html, f64) {
    const ROW: f64 = 12.0;
    const KEY: f64 = 16.0;
    let mut entries: Vec<&Series> = Vec::new();
    for series in figure.panels.iter().flat_map(|panel| &panel.series) {
        let is_known = entries.iter().any(|entry| entry.label == series.label);
        if !is_known && !series.label.is_empty() {
            entries.push(series);
        }
    }
    let (mut x, mut row) = (4.0, 0);
    let mut drawn = Vec::new();
    for entry in &entries {
        let room = ((width - 4.0 - KEY) / (CHARACTER * TEXT)) as usize;
        let label = shortened(&entry.label, room);
        let text = CHARACTER * TEXT * label.chars().count() as f64;
        if x > 4.0 && x + KEY + text + 12.0 > width {
            (x, row) = (4.0, row + 1);
        }
        let y = ROW * (f64::from(row) + 0.6);
        drawn.push(html! {
            (key(entry, x, y))
            text x=(at(x + KEY)) y=(at(y + 0.35 * TEXT)) fill=(on_white("ink")) { (label) }
        });
        x += KEY + text + 12.0;
    }
    let rows = if entries.is_empty() { 0 } else { row + 1 };
    let height = ROW * f64::from(rows) + 6.0;
    (html! { @for own in drawn { (own) } }, height)
}

/// The sample of an entry's look, from the left and around that height.
fn key(entry: &Series, x: f64, y: f64) -> Html {
    let colour = on_white(&entry.colour);
    let line = format!("M{x:.1} {y:.1}h12");
    let cross = format!("M{:.1} {:.1}l4.4 4.4m0 -4.4l-4.4 4.4", x + 4.0, y - 2.2);
    html! {
        @match entry.look {
            Look::Area => rect x=(at(x)) y=(at(y - 3.5)) width="12" height="7" fill=(colour) opacity="0.3" {},
            Look::Dots => circle cx=(at(x + 6.0)) cy=(at(y)) r="2.2" fill=(colour) {},
            Look::Rings => circle cx=(at(x + 6.0)) cy=(at(y)) r="2.2" fill="none" stroke=(colour) {},
            Look::Crosses => path d=(cross) stroke=(colour) {},
            Look::Dashed => path d=(line) stroke=(colour) stroke-dasharray="4 3" {},
            _ => path d=(line) stroke=(colour) stroke-width="1.2" {},
        }
    }
}

/// A label of at most that many characters, of at least its first one.
fn shortened(label: &str, most: usize) -> String {
    match label.chars().count() > most {
        false => label.to_owned(),
        true => {
            let kept: String = label.chars().take(most.saturating_sub(1).max(1)).collect();
            kept + "\u{2026}"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::Axis;
    use roxmltree::{Document, Node};

    fn figure(series: Vec<Series>, equal: bool) -> Figure {
        let panel = Panel {
            x: Axis::time(),
            y: Axis::linear("position [m]"),
            equal,
            height: 300.0,
            series,
        };
        Figure::of("test", "Te<st", "", panel)
    }

    fn line(label: &str, y: &[f64]) -> Series {
        let x: Vec<f64> = (0..y.len()).map(|k| k as f64).collect();
        Series::line(label, "line-1", &x, y)
    }

    fn numbers(path: &str) -> Vec<f64> {
        let words = path.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'));
        words.filter_map(|word| word.parse().ok()).collect()
    }

    fn paths<'a>(document: &'a Document<'a>) -> impl Iterator<Item = &'a str> {
        let is_series = |node: &Node| node.has_tag_name("path") && node.has_attribute("opacity");
        (document.descendants().filter(is_series)).filter_map(|node| node.attribute("d"))
    }

    #[test]
    fn a_missing_sample_leaves_a_gap_and_a_label_appears_once_in_the_legend() {
        let one = line("a < b", &[0.0, 1.0, f64::NAN, 3.0, 4.0]);
        let svg = to_svg(&figure(vec![one.clone(), one], false), 85.0);
        let document = Document::parse(&svg).unwrap();
        let path = paths(&document).next().unwrap();
        assert_eq!(
            (path.matches('M').count(), path.matches('L').count()),
            (2, 2)
        );
        let entries = document
            .descendants()
            .filter(|node| node.has_tag_name("text"));
        assert_eq!(
            entries.filter(|node| node.text() == Some("a < b")).count(),
            1
        );
        assert!(!svg.contains("NaN"));
    }

    /// The ends of the axes are the edges of the area, with points in between.
    #[test]
    fn points_are_where_the_axes_say() {
        let svg = to_svg(&figure(vec![line("a", &[0.0, 5.0, 10.0])], false), 85.0);
        let document = Document::parse(&svg).unwrap();
        let area = document
            .descendants()
            .find(|node| node.has_tag_name("clipPath"))
            .unwrap();
        let area = area.first_element_child().unwrap();
        let [left, top, width, height] = ["x", "y", "width", "height"]
            .map(|name| area.attribute(name).unwrap().parse::<f64>().unwrap());
        let points = numbers(paths(&document).next().unwrap());
        // The margins above and below are a twentieth of the range.
        let expected = [
            left,
            top + height / 1.1 * 1.05,
            left + width / 2.0,
            top + height / 2.0,
            left + width,
        ];
        for (found, expected) in points.iter().zip(expected) {
            assert!((found - expected).abs() < 0.2, "{points:?} {expected}");
        }
        assert!(svg.contains("width=\"85.00mm\""));
    }

    #[test]
    fn equal_axes_have_units_of_one_length() {
        let square = Series::line("", "aid", &[0.0, 1.0, 1.0, 40.0], &[0.0, 0.0, 1.0, 1.0]);
        let svg = to_svg(&figure(vec![square], true), 120.0);
        let document = Document::parse(&svg).unwrap();
        let p = numbers(paths(&document).next().unwrap());
        let (across, up) = (p[2] - p[0], p[3] - p[5]);
        assert!((across - up).abs() < 0.03 && across > 1.0, "{across} {up}");
    }

    #[test]
    fn cells_have_the_colours_of_their_values() {
        let cells = Series {
            look: Look::Cells,
            x: vec![0.0, 1.0, 0.0, 1.0],
            y: vec![0.0, 0.0, 1.0, 1.0],
            values: vec![1.0, 0.0, -1.0, f64::NAN],
            ..Series::default()
        };
        let mut figure = figure(vec![cells], false);
        figure.panels[0].x.names = vec!["a".into(), "b".into()];
        figure.panels[0].y.names = vec!["a".into(), "b".into()];
        let svg = to_svg(&figure, 85.0);
        for part in ["#0072b2", "#ffffff", "#d55e00", "#edf0f3", ">\u{2212}1.00<"] {
            assert!(svg.contains(part), "{part}");
        }
    }
}
