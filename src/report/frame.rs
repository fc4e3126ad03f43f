//! The plot area of a panel in a drawing, and the mapping from data to it.

use super::axis::Scale;
use super::figure::{Axis, Look, Panel};
use super::html::{Html, html};
use super::palette::on_white;
use super::svg::at;
use std::fmt::Write;

/// Font size \[pt\].
pub const TEXT: f64 = 8.0;
/// Approximate width of a character relative to the font size.
pub const CHARACTER: f64 = 0.62;
/// Heights of the tick labels and of the axis label below the axes \[pt\].
const BELOW: (f64, f64) = (13.0, 12.0);
/// Margin on the right \[pt\].
const RIGHT: f64 = 10.0;

/// A horizontal or vertical axis in the drawing.
struct Ruler {
    scale: Scale,
    axis: Axis,
    /// Coordinates of its ends in the drawing.
    ends: [f64; 2],
}

impl Ruler {
    fn at(&self, value: f64) -> f64 {
        let value = if self.axis.log { value.log10() } else { value };
        self.ends[0] + self.scale.position(value) * (self.ends[1] - self.ends[0])
    }

    /// Positions and labels of the ticks.
    fn ticks(&self) -> Vec<(f64, String)> {
        let place =
            |value: f64| self.ends[0] + self.scale.position(value) * (self.ends[1] - self.ends[0]);
        if !self.axis.names.is_empty() {
            let names = self.axis.names.iter().enumerate();
            return names
                .map(|(k, name)| (place(k as f64), name.clone()))
                .collect();
        }
        let ticks = self.scale.ticks.iter();
        ticks
            .map(|tick| (place(*tick), self.scale.label(*tick)))
            .collect()
    }

    /// Length of its longest tick label in characters.
    fn longest(&self) -> usize {
        let ticks = self.ticks().into_iter();
        ticks
            .map(|(_, label)| label.chars().count())
            .max()
            .unwrap_or(0)
    }
}

/// The plot area with its scales.
pub struct Frame {
    x: Ruler,
    y: Ruler,
}

/// The scale of an axis over all drawn values.
fn scale(panel: &Panel, axis: &Axis, values: Vec<f64>, margin: f64) -> Scale {
    if !axis.names.is_empty() {
        return Scale::covering([-0.5, axis.names.len() as f64 - 0.5], 0.0);
    }
    if axis.log {
        let positive = values.into_iter().filter(|value| *value > 0.0);
        return Scale::covering(positive.map(f64::log10), margin).in_decades();
    }
    let has_stems = panel.series.iter().any(|own| own.look == Look::Stems);
    let zero = (has_stems && margin > 0.0).then_some(0.0);
    let scale = Scale::covering(values.into_iter().chain(zero), margin);
    match scale.range() < axis.least {
        true => scale.reaching(axis.least),
        false => scale,
    }
}

/// Values along an axis. Bands and ellipses extend the range of lines and points by at most half of it on each side:
/// poorly determined quantities must not hide the others.
fn reach(panel: &Panel, along: impl Fn((f64, f64)) -> f64) -> Vec<f64> {
    let of = |is_area: bool| -> Vec<f64> {
        let series = panel
            .series
            .iter()
            .filter(|own| (own.look == Look::Area) == is_area);
        series.flat_map(|own| own.points()).map(&along).collect()
    };
    let mut values = of(false);
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = match low < high {
        true => (1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low),
        false => (f64::NEG_INFINITY, f64::INFINITY),
    };
    values.extend(of(true).into_iter().map(|value| value.clamp(low, high)));
    values
}

impl Frame {
    /// The plot area of a panel, from the left margin `left` and between the edges `top` and `bottom`.
    pub fn new(panel: &Panel, left: f64, width: f64, [top, bottom]: [f64; 2]) -> Self {
        let x_margin = if panel.equal { 0.05 } else { 0.0 };
        let x = scale(panel, &panel.x, reach(panel, |point| point.0), x_margin);
        let y = scale(panel, &panel.y, reach(panel, |point| point.1), 0.05);
        let ruler = |scale, axis: &Axis, ends| Ruler {
            scale,
            axis: axis.clone(),
            ends,
        };
        let mut frame = Self {
            x: ruler(x, &panel.x, [left, width - RIGHT]),
            y: ruler(y, &panel.y, [bottom, top]),
        };
        if panel.equal {
            let [across, up] =
                [&frame.x, &frame.y].map(|ruler| (ruler.ends[1] - ruler.ends[0]).abs());
            let longest = (frame.x.scale.range() / across).max(frame.y.scale.range() / up);
            frame.x.scale = frame.x.scale.reaching(longest * across);
            frame.y.scale = frame.y.scale.reaching(longest * up);
        }
        frame
    }

    /// Width that a panel's ordinate needs on its left \[pt\].
    pub fn left(panel: &Panel) -> f64 {
        let frame = Self::new(panel, 0.0, 100.0, [0.0, 100.0]);
        let label = if panel.y.label.is_empty() {
            0.0
        } else {
            1.6 * TEXT
        };
        CHARACTER * TEXT * frame.y.longest() as f64 + 6.0 + label
    }

    /// Height below a panel \[pt\]; only the last panel shows the label of the abscissa.
    pub fn below(panel: &Panel, is_last: bool) -> f64 {
        let names = panel.x.names.iter().map(|name| name.chars().count());
        let names = CHARACTER * TEXT * names.max().unwrap_or(0) as f64;
        BELOW.0.max(names) + if is_last { BELOW.1 } else { 0.0 }
    }

    /// Position of a point in the drawing.
    pub fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    /// Whether an abscissa lies in the right part of the drawing.
    pub fn is_right(&self, x: f64) -> bool {
        let [from, to] = self.x.ends;
        x > from + 0.7 * (to - from)
    }

    /// Left and top edge of the plot area, its width and its height.
    pub fn area(&self) -> [f64; 4] {
        let [left, right] = self.x.ends;
        let [bottom, top] = self.y.ends;
        [left, top, right - left, bottom - top]
    }

    /// Grid, tick labels and axis labels.
    pub fn axes(&self, is_last: bool) -> Html {
        let [left, top, width, height] = self.area();
        let mut grid = format!("M{left:.1} {top:.1}h{width:.1}v{height:.1}h{:.1}z", -width);
        for (x, _) in self.x.ticks() {
            let _ = write!(grid, "M{x:.1} {top:.1}v{height:.1}");
        }
        for (y, _) in self.y.ticks() {
            let _ = write!(grid, "M{left:.1} {y:.1}h{width:.1}");
        }
        let middle = left + 0.5 * width;
        let below = top + height + Self::below(&self.named(), true) - 2.0;
        html! {
            g stroke="#e3e7ec" stroke-width="0.5" fill="none" { path d=(grid) {} }
            g fill=(on_white("quiet")) { (self.tick_labels()) }
            g fill=(on_white("ink")) {
                @if is_last {
                    text x=(at(middle)) y=(at(below)) text-anchor="middle" { (self.x.axis.label) }
                }
                text transform=(turned(TEXT, top + 0.5 * height)) text-anchor="middle" { (self.y.axis.label) }
            }
        }
    }

    /// Labels of the ticks; long names below an abscissa are turned.
    fn tick_labels(&self) -> Html {
        let [left, top, _, height] = self.area();
        let names = &self.x.axis.names;
        let is_turned = names.iter().any(|name| name.chars().count() > 4);
        let y = top + height + 1.3 * TEXT;
        html! {
            @for (x, label) in self.x.ticks() {
                @if is_turned {
                    text transform=(turned(x + 0.3 * TEXT, y - TEXT)) text-anchor="end" { (label) }
                } @else {
                    text x=(at(x)) y=(at(y)) text-anchor="middle" { (label) }
                }
            }
            @for (y, label) in self.y.ticks() {
                text x=(at(left - 4.0)) y=(at(y + 0.35 * TEXT)) text-anchor="end" { (label) }
            }
        }
    }

    /// A panel with only this abscissa.
    fn named(&self) -> Panel {
        Panel {
            x: self.x.axis.clone(),
            ..Panel::default()
        }
    }
}

/// The transformation of text that reads upwards from a point.
fn turned(x: f64, y: f64) -> String {
    format!("translate({x:.1} {y:.1}) rotate(-90)")
}
