//! The figure of maps.

use super::Args;
use super::overlay::Curve;
use super::page::{Shown, units};
use crate::control::hv::{Class, Crossing, Map, Range};
use crate::report::figure::{Axis, Figure, Look, Panel, Series};

/// The boundary as lines of speeds and heights: that of the region at hover, by the low branch, the knee and the high
/// branch; and that of the strip over the ground.
fn lines(map: &Map) -> [Vec<[f64; 2]>; 2] {
    let region = map.region();
    let ends = |end: fn(&Range) -> Option<Crossing>| {
        let all = region
            .iter()
            .filter_map(move |(speed, own)| Some([*speed, end(own)?.height]));
        all.collect::<Vec<_>>()
    };
    let (low, mut high) = (ends(|own| own.low), ends(|own| own.high));
    high.reverse();
    let strip = map
        .strip()
        .into_iter()
        .filter_map(|(speed, own)| Some([speed, own.high?.height]));
    [
        low.into_iter().chain(map.knee).chain(high).collect(),
        strip.collect(),
    ]
}

/// The outlines of the bands of both ends of the region, where they are known.
fn bands(map: &Map) -> [Vec<[f64; 2]>; 2] {
    let region = map.region();
    let outline = |end: fn(&Range) -> Option<Crossing>| {
        let known = || {
            region
                .iter()
                .filter_map(move |(speed, own)| Some((*speed, end(own)?.range)))
        };
        let [low, mut high] = [0, 1].map(|k| {
            known()
                .map(|(speed, range)| [speed, range[k]])
                .collect::<Vec<_>>()
        });
        high.reverse();
        let all = low.into_iter().chain(high);
        all.filter(|own| own[1].is_finite()).collect()
    };
    [outline(|own| own.low), outline(|own| own.high)]
}

/// Colours of cases that differ in delay or parameters.
const COLOURS: [&str; 6] = ["line-1", "line-4", "line-3", "line-5", "line-6", "line-2"];

/// The figure: points of the last case, boundaries and knees of all, bands where pilots were drawn, and curves of others.
pub fn figure(args: &Args, shown: &[Shown], overlays: &[Curve]) -> Figure {
    let [(speed_unit, knots), (height_unit, feet)] = units(args);
    let drawn = |label: &str, colour: &str, points: &[[f64; 2]], look: Look| {
        let x: Vec<f64> = points.iter().map(|at| knots * at[0]).collect();
        let y: Vec<f64> = points.iter().map(|at| feet * at[1]).collect();
        Series::line(label, colour, &x, &y).looks(look)
    };
    let mut series = Vec::new();
    let looks = [
        (Class::Unsafe, Look::Dots, "line-2"),
        (Class::Safe, Look::Dots, "aid"),
        (Class::Unknown, Look::Crosses, "ink"),
    ];
    if let Some(last) = shown.last() {
        for (class, look, colour) in looks {
            let columns = last.map.columns.iter();
            let points: Vec<[f64; 2]> = columns
                .flat_map(|own| own.cells.iter().map(move |cell| (own.speed, cell)))
                .filter(|(_, cell)| cell.class == class)
                .map(|(speed, cell)| [speed, cell.height])
                .collect();
            if !points.is_empty() {
                let label = format!("{}, {}", class.as_str(), last.case.name);
                series.push(drawn(&label, colour, &points, look));
            }
        }
    }
    // Dashed without a pilot where there are maps with one; a colour for each family.
    let has_pilot = shown.iter().any(|own| own.case.has_pilot);
    let families = shown.len() / if has_pilot { 2 } else { 1 };
    for (k, own) in shown.iter().enumerate() {
        let is_alone = families == 1 && own.case.has_pilot;
        let colour = COLOURS[(k % families + usize::from(is_alone)) % COLOURS.len()];
        let look = match has_pilot && !own.case.has_pilot {
            true => Look::Dashed,
            false => Look::Line,
        };
        for outline in bands(&own.map).iter().filter(|own| own.len() > 2) {
            series.push(drawn(
                &format!("95 % {}", own.case.name),
                colour,
                outline,
                Look::Area,
            ));
        }
        for line in lines(&own.map).iter().filter(|line| line.len() > 1) {
            series.push(drawn(
                &format!("boundary {}", own.case.name),
                colour,
                line,
                look,
            ));
        }
        if let Some(knee) = own.map.knee {
            let mut knee = drawn("", colour, &[knee], Look::Rings);
            knee.words = vec!["knee".into()];
            series.push(knee);
        }
    }
    for own in overlays {
        series.push(drawn(&own.name, "ink", &own.points, Look::Line));
        series.push(drawn("", "ink", &own.points, Look::Rings));
    }
    let panel = Panel {
        x: Axis::of("speed", speed_unit),
        y: Axis {
            log: true,
            ..Axis::of("height above ground", height_unit)
        },
        height: 420.0,
        series,
        ..Panel::default()
    };
    let delays: Vec<String> = args.delay.iter().map(ToString::to_string).collect();
    let caption = format!(
        "Power fails at the point; the controls stay for {}; then the best landing is flown. Computed with perfect \
         knowledge: no flight limitation.",
        delays.join(", or ")
    );
    Figure::of("hv", "Height–velocity map", &caption, panel)
}
