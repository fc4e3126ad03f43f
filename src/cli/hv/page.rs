//! What is written of a map: tables, JSON, the figure and the page.

use super::{Args, counts};
use crate::cli::made::made;
use crate::cli::{format::aligned, terminal};
use crate::control::hv::{Class, Column, Map};
use crate::report::figure::{Axis, Figure, Look, Panel, Series};
use crate::report::{HvPage, hv_page};
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Value, json};

/// A map with what it is called, and the static gains that were divided out of its pilot.
pub struct Shown<'a> {
    pub name: &'a str,
    pub gain: Option<[f64; 2]>,
    pub map: Map,
}

/// Knots in a metre per second, feet in a metre.
const KNOTS: f64 = 3600.0 / 1852.0;
const FEET: f64 = 1.0 / 0.3048;

/// Units of the axes: name and factor of speeds, name and factor of heights.
fn units(args: &Args) -> [(&'static str, f64); 2] {
    match args.si {
        true => [("m/s", 1.0), ("m", 1.0)],
        false => [("kn", KNOTS), ("ft", FEET)],
    }
}

/// Low and high end of the unsafe range of a column that begins above safe heights; from its lowest point, if that is
/// unsafe while it is slower than the knee.
fn inner(column: &Column) -> Option<[f64; 2]> {
    let opens = column.crossings.iter().position(|own| own.opens)?;
    let closes = column.crossings.get(opens + 1)?;
    Some([column.crossings[opens].height, closes.height])
}

/// The unsafe heights over the ground at a speed, where these are unsafe from the lowest on.
fn strip(column: &Column) -> Option<f64> {
    let first = column
        .cells
        .iter()
        .find(|own| own.class != Class::Unknown)?;
    let crossing = column.crossings.first().filter(|own| !own.opens)?;
    (first.class == Class::Unsafe).then_some(crossing.height)
}

/// The boundary as lines of speeds and heights: that of the region at hover, by the low branch, the knee and the high
/// branch; and that of the strip over the ground.
fn lines(map: &Map) -> [Vec<[f64; 2]>; 2] {
    let region = || {
        map.columns
            .iter()
            .filter_map(|own| Some((own.speed, inner(own)?)))
    };
    let low = region().map(|(speed, [low, _])| [speed, low]);
    let high = region().map(|(speed, [_, high])| [speed, high]);
    let mut high: Vec<[f64; 2]> = high.collect();
    high.reverse();
    let strip = map
        .columns
        .iter()
        .filter_map(|own| Some([own.speed, strip(own)?]));
    [low.chain(map.knee).chain(high).collect(), strip.collect()]
}

/// All points as a table.
pub fn points(shown: &[Shown<'_>]) -> String {
    let mut text =
        String::from("case,speed [m/s],height [m],class,S,S of the replay,duration [s]\n");
    for own in shown {
        for column in &own.map.columns {
            for cell in &column.cells {
                let number = |value: f64| {
                    if value.is_finite() {
                        significant(value, 6)
                    } else {
                        String::new()
                    }
                };
                let numbers = [cell.s, cell.replayed, cell.duration].map(number);
                text += &format!(
                    "{},{},{},{},{}\n",
                    own.name,
                    significant(column.speed, 6),
                    significant(cell.height, 6),
                    cell.class.as_str(),
                    numbers.join(",")
                );
            }
        }
    }
    text
}

/// The boundary as a table.
pub fn boundary(shown: &[Shown<'_>]) -> String {
    let mut text = String::from("case,branch,speed [m/s],height [m],speed [kn],height [ft]\n");
    let mut row = |case: &str, branch: &str, [speed, height]: [f64; 2]| {
        let numbers =
            [speed, height, speed * KNOTS, height * FEET].map(|value| significant(value, 5));
        text += &format!("{case},{branch},{}\n", numbers.join(","));
    };
    for own in shown {
        for column in &own.map.columns {
            if let Some([low, high]) = inner(column) {
                row(own.name, "low", [column.speed, low]);
                row(own.name, "high", [column.speed, high]);
            }
            if let Some(height) = strip(column) {
                row(own.name, "strip", [column.speed, height]);
            }
        }
        if let Some(knee) = own.map.knee {
            row(own.name, "knee", knee);
        }
    }
    text
}

/// The map and what it was made of, as JSON.
pub fn to_json(args: &Args, shown: &[Shown<'_>]) -> Value {
    let crossing = |own: &crate::control::hv::Crossing| json!({ "height": own.height, "unsafe_above": own.opens });
    let column = |own: &Column| {
        let cells = own.cells.iter().map(|cell| {
            json!({ "height": cell.height, "class": cell.class.as_str(), "s": cell.s, "replayed": cell.replayed })
        });
        json!({
            "speed": own.speed,
            "points": cells.collect::<Vec<_>>(),
            "boundary": own.crossings.iter().map(crossing).collect::<Vec<_>>(),
        })
    };
    let case = |own: &Shown<'_>| {
        let [safe, not, unknown] = counts(&own.map);
        json!({
            "case": own.name,
            "static_gains": own.gain,
            "safe": safe,
            "unsafe": not,
            "unknown": unknown,
            "knee": own.map.knee.map(|[speed, height]| json!({ "speed": speed, "height": height })),
            "columns": own.map.columns.iter().map(column).collect::<Vec<_>>(),
        })
    };
    json!({
        "delay": args.delay,
        "sink": args.sink,
        "run_on": args.run_on,
        "tilt": args.tilt,
        "set": args.set.iter().map(|(name, value)| (name.clone(), json!(value))).collect::<serde_json::Map<_, _>>(),
        "pilot": args.pilot,
        "maps": shown.iter().map(case).collect::<Vec<_>>(),
        "words": words(args, shown),
    })
}

/// The figure: points of the last case, boundaries and knees of all.
pub fn figure(args: &Args, shown: &[Shown<'_>]) -> Figure {
    let [(speed_unit, knots), (height_unit, feet)] = units(args);
    let mut series = Vec::new();
    let looks = [
        (Class::Unsafe, Look::Dots, "line-2"),
        (Class::Safe, Look::Dots, "aid"),
        (Class::Unknown, Look::Crosses, "ink"),
    ];
    if let Some(last) = shown.last() {
        for (class, look, colour) in looks {
            let columns = last.map.columns.iter();
            let points: Vec<(f64, f64)> = columns
                .flat_map(|own| own.cells.iter().map(move |cell| (own.speed, cell)))
                .filter(|(_, cell)| cell.class == class)
                .map(|(speed, cell)| (knots * speed, feet * cell.height))
                .collect();
            if points.is_empty() {
                continue;
            }
            let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
            series.push(
                Series::line(
                    &format!("{}, {}", class.as_str(), last.name),
                    colour,
                    &x,
                    &y,
                )
                .looks(look),
            );
        }
    }
    for (k, own) in shown.iter().enumerate() {
        let (colour, look) = match k {
            0 if shown.len() > 1 => ("line-1", Look::Dashed),
            0 => ("line-1", Look::Line),
            _ => ("line-4", Look::Line),
        };
        for line in lines(&own.map).iter().filter(|line| line.len() > 1) {
            let x: Vec<f64> = line.iter().map(|at| knots * at[0]).collect();
            let y: Vec<f64> = line.iter().map(|at| feet * at[1]).collect();
            series
                .push(Series::line(&format!("boundary {}", own.name), colour, &x, &y).looks(look));
        }
        if let Some([speed, height]) = own.map.knee {
            let mut knee =
                Series::line("", colour, &[knots * speed], &[feet * height]).looks(Look::Rings);
            knee.words = vec!["knee".into()];
            series.push(knee);
        }
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
    let caption = format!(
        "Power fails at the point; the controls stay for {} s; then the best landing is flown. Computed with perfect \
         knowledge: no flight limitation.",
        significant(args.delay, 3)
    );
    Figure::of("hv", "Height–velocity map", &caption, panel)
}

/// What the map is, and what it is not.
fn words(args: &Args, shown: &[Shown<'_>]) -> Vec<String> {
    let mut all = vec![
        format!(
            "A point is safe if a flight was found that touches down at no more than {} m/s downwards and {} m/s over the \
             ground, and was integrated again with error control. It is unsafe if all starts of the optimiser converged to \
             landings beyond that, and unknown otherwise: a local solver's failure proves nothing.",
            significant(args.sink, 3),
            significant(args.run_on, 3)
        ),
        "The boundary is that of optimal control: of a pilot who knows the helicopter, the air and the moment perfectly and \
         makes no error. It lies inside any that was flown or certified, has no margin, and is no flight limitation."
            .to_owned(),
        "The model moves in the vertical plane without wind. It leaves out the fuselage's attitude and the tail, blade stall \
         beyond the limit of the thrust coefficient, and obstacles; its inflow near the vortex ring is empirical."
            .to_owned(),
    ];
    if let Some(gains) = shown.iter().find_map(|own| own.gain) {
        let gains = gains.map(|gain| significant(gain, 4));
        all.push(format!(
            "The pilot's linearisation stands between command and rotor on both axes; its static gains ({} and {}), which \
             scale its task, are divided out. The time of {} s is recognition alone: the pilot's own lag is in the pilot. \
             Limits hold for the command and for what the rotor sees; the command may jump, since the pilot does not.",
            gains[0],
            gains[1],
            significant(args.delay, 3)
        ));
    }
    all
}

/// Speed and height of a knee in words.
fn knee(args: &Args, map: &Map) -> String {
    let [(speed_unit, knots), (height_unit, feet)] = units(args);
    map.knee.map_or("none".into(), |[speed, height]| {
        format!(
            "{} {speed_unit}, {} {height_unit}",
            significant(knots * speed, 3),
            significant(feet * height, 3)
        )
    })
}

/// Low and high unsafe height at the lowest speed.
fn hover(args: &Args, map: &Map) -> String {
    let [_, (unit, feet)] = units(args);
    let found = map.columns.first().and_then(inner);
    found.map_or("none".into(), |own| {
        let [low, high] = own.map(|height| significant(feet * height, 3));
        format!("{low} to {high} {unit}")
    })
}

/// The page.
pub fn html(args: &Args, shown: &[Shown<'_>], figure: &Figure) -> String {
    let unknown: usize = shown.iter().map(|own| counts(&own.map)[2]).sum();
    let all: usize = shown
        .iter()
        .map(|own| counts(&own.map).iter().sum::<usize>())
        .sum();
    let verdict = match unknown {
        0 => format!("All {all} points are safe or unsafe."),
        unknown => format!("{unknown} of {all} points are unknown."),
    };
    let mut facts = Vec::new();
    for own in shown {
        let [unsafe_range, knee] = [hover(args, &own.map), knee(args, &own.map)];
        facts.push((
            if own.gain.is_some() {
                "unsafe at the lowest speed, with the pilot"
            } else {
                "unsafe at the lowest speed"
            },
            unsafe_range,
        ));
        facts.push((
            if own.gain.is_some() {
                "knee, with the pilot"
            } else {
                "knee"
            },
            knee,
        ));
    }
    let mut rows = boundary(shown);
    rows.truncate(rows.trim_end().len());
    let rows = rows
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(str::to_owned).collect());
    hv_page(&HvPage {
        title: "Height–velocity map after power loss",
        verdict: (&verdict, unknown == 0),
        facts: &facts,
        figure,
        boundary: (
            vec![
                "case",
                "branch",
                "speed [m/s]",
                "height [m]",
                "speed [kn]",
                "height [ft]",
            ],
            rows.collect(),
        ),
        words: &words(args, shown),
        made: &made(),
    })
}

/// The summary.
pub fn to_text(args: &Args, shown: &[Shown<'_>]) -> String {
    let mut rows = vec![
        [
            "",
            "safe",
            "unsafe",
            "unknown",
            "unsafe at the lowest speed",
            "knee",
        ]
        .map(str::to_owned),
    ];
    for own in shown {
        let [safe, not, unknown] = counts(&own.map).map(|count| count.to_string());
        rows.push([
            own.name.to_owned(),
            safe,
            not,
            unknown,
            hover(args, &own.map),
            knee(args, &own.map),
        ]);
    }
    let points: usize = shown
        .iter()
        .map(|own| counts(&own.map).iter().sum::<usize>())
        .sum();
    format!(
        "{}{} in {}: hv.html, hv.svg, map.csv, boundary.csv, hv.json\nno flight limitation: computed with perfect \
         knowledge, by a model\n",
        aligned(&rows),
        counted(points, "point"),
        terminal::shown(&args.output)
    )
}
