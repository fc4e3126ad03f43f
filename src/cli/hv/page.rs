//! What is written of a map: tables, JSON, the figure and the page.

use super::cases::Case;
use super::{Args, counts};
use crate::cli::made::made;
use crate::cli::{format::aligned, terminal};
use crate::control::hv::{Class, Column, Crossing, Map, Range};
use crate::report::figure::Figure;
use crate::report::{PlainPage, plain_page};
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Value, json};

/// A case with its map, the static gains that were divided out of its pilot, and the number of drawn pilots.
pub struct Shown {
    pub case: Case,
    pub gain: Option<[f64; 2]>,
    pub draws: usize,
    pub map: Map,
}

/// Knots in a metre per second, feet in a metre.
const KNOTS: f64 = 3600.0 / 1852.0;
const FEET: f64 = 1.0 / 0.3048;

/// Units of the axes: name and factor of speeds, name and factor of heights.
pub fn units(args: &Args) -> [(&'static str, f64); 2] {
    match args.si {
        true => [("m/s", 1.0), ("m", 1.0)],
        false => [("kn", KNOTS), ("ft", FEET)],
    }
}

/// A number of a table; empty where there is none.
fn number(value: f64, digits: usize) -> String {
    if value.is_finite() {
        significant(value, digits)
    } else {
        String::new()
    }
}

/// All points as a table.
pub fn points(shown: &[Shown]) -> String {
    let mut text = String::from(
        "case,speed [m/s],height [m],class,S,S of the replay,duration [s],share of drawn pilots that land\n",
    );
    for own in shown {
        for column in &own.map.columns {
            for cell in &column.cells {
                let numbers =
                    [cell.s, cell.replayed, cell.duration, cell.chance].map(|own| number(own, 6));
                text += &format!(
                    "{},{},{},{},{}\n",
                    own.case.name,
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

/// Header of the boundary's table.
const BOUNDARY: [&str; 8] = [
    "case",
    "branch",
    "speed [m/s]",
    "height [m]",
    "speed [kn]",
    "height [ft]",
    "lowest 95 % [m]",
    "highest 95 % [m]",
];

/// Rows of the boundary's table.
fn boundary_rows(shown: &[Shown]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for own in shown {
        let mut row = |branch: &str, speed: f64, height: f64, range: [f64; 2]| {
            let numbers = [
                speed,
                height,
                speed * KNOTS,
                height * FEET,
                range[0],
                range[1],
            ];
            let words = [own.case.name.clone(), branch.to_owned()].into_iter();
            rows.push(words.chain(numbers.map(|value| number(value, 5))).collect());
        };
        let (region, strip) = (own.map.region(), own.map.strip());
        for column in &own.map.columns {
            for range in column.ranges() {
                let is_of = |all: &[(f64, Range)]| {
                    let mut all = all.iter();
                    all.any(|at| at.0 == column.speed && at.1.heights == range.heights)
                };
                let names = match (is_of(&region), is_of(&strip)) {
                    (true, _) => ["low", "high"],
                    (_, true) => ["strip", "strip"],
                    _ => ["other low", "other high"],
                };
                for (name, end) in names.into_iter().zip([range.low, range.high]) {
                    if let Some(end) = end {
                        row(name, column.speed, end.height, end.range);
                    }
                }
            }
        }
        if let Some([speed, height]) = own.map.knee {
            row("knee", speed, height, [f64::NAN; 2]);
        }
    }
    rows
}

/// The boundary as a table.
pub fn boundary(shown: &[Shown]) -> String {
    let rows = boundary_rows(shown);
    let lines = rows.iter().map(|own| own.join(",") + "\n");
    BOUNDARY.join(",") + "\n" + &lines.collect::<String>()
}

/// The map and what it was made of, as JSON.
pub fn to_json(args: &Args, shown: &[Shown]) -> Value {
    let finite = |value: f64| value.is_finite().then_some(value);
    let range = |own: [f64; 2]| Some([finite(own[0])?, finite(own[1])?]);
    let crossing = |own: &Crossing| json!({ "height": own.height, "unsafe_above": own.opens, "range": range(own.range) });
    let column = |own: &Column| {
        let cells = own.cells.iter().map(|cell| {
            json!({
                "height": cell.height,
                "class": cell.class.as_str(),
                "s": cell.s,
                "replayed": cell.replayed,
                "chance": finite(cell.chance),
            })
        });
        json!({
            "speed": own.speed,
            "points": cells.collect::<Vec<_>>(),
            "boundary": own.crossings.iter().map(crossing).collect::<Vec<_>>(),
        })
    };
    let case = |own: &Shown| {
        let [safe, not, unknown] = counts(&own.map);
        json!({
            "case": own.case.name,
            "delay": own.case.delay.times(),
            "set": pairs(&own.case.set),
            "static_gains": own.gain,
            "draws": own.draws,
            "safe": safe,
            "unsafe": not,
            "unknown": unknown,
            "knee": own.map.knee.map(|[speed, height]| json!({ "speed": speed, "height": height })),
            "columns": own.map.columns.iter().map(column).collect::<Vec<_>>(),
        })
    };
    json!({
        "sink": args.sink,
        "run_on": args.run_on,
        "tilt": args.tilt,
        "pilot": args.pilot,
        "maps": shown.iter().map(case).collect::<Vec<_>>(),
        "words": words(args, shown),
    })
}

/// Values of parameters as JSON.
pub fn pairs(set: &[(String, f64)]) -> serde_json::Map<String, Value> {
    set.iter()
        .map(|(name, value)| (name.clone(), json!(value)))
        .collect()
}

/// What the map is, and what it is not.
fn words(args: &Args, shown: &[Shown]) -> Vec<String> {
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
    all.extend(shown.iter().find_map(|own| own.gain).map(pilot_words));
    if let Some(own) = shown.iter().find(|own| own.draws > 0) {
        all.push(format!(
            "The band is that of {} drawn from the covariance of the fit: 95 % of them have the boundary within it. It says what \
             the flights do not tell of this pilot in this linear model, and nothing of other pilots, other days, or what the \
             model leaves out.",
            counted(own.draws, "pilot")
        ));
    }
    if shown.iter().any(|own| own.draws == 0 && own.case.has_pilot) && args.draws > 0 {
        all.push("The pilot's file has no covariance, so there is no band.".to_owned());
    }
    all
}

/// How the pilot is in the loop.
pub fn pilot_words(gains: [f64; 2]) -> String {
    let [first, second] = gains.map(|gain| significant(gain, 4));
    format!(
        "The pilot's linearisation, where it begins, stands between command and rotor on both axes, each by itself: limits, dead zones \
         and rates of the pilot's own, and what one axis does to the other, are not in it. Its static gains ({first} and {second}), \
         which scale its task, are divided out. The delay is recognition alone: the pilot's own lag is in the pilot. Limits hold for \
         the command and for what the rotor sees; the command may jump, since the pilot does not."
    )
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
    let Some(column) = map.columns.first() else {
        return String::new();
    };
    let shown = |height: f64| significant(feet * height, 3);
    let region = map.region();
    let is_first = |own: &&(f64, Range)| own.0 == column.speed;
    match region
        .first()
        .filter(is_first)
        .map(|own| (own.1.low, own.1.high))
    {
        Some((Some(low), Some(high))) => {
            format!("{} to {} {unit}", shown(low.height), shown(high.height))
        }
        Some((Some(low), None)) => format!("{} {unit} and up", shown(low.height)),
        Some((None, Some(high))) => format!("up to {} {unit}", shown(high.height)),
        Some((None, None)) => "all heights".into(),
        None if column.cells.iter().all(|own| own.class == Class::Safe) => "none".into(),
        None => "none, or unknown".into(),
    }
}

/// The page.
pub fn html(args: &Args, shown: &[Shown], figure: &Figure) -> String {
    let unknown: usize = shown.iter().map(|own| counts(&own.map)[2]).sum();
    let all: usize = shown
        .iter()
        .map(|own| counts(&own.map).iter().sum::<usize>())
        .sum();
    let verdict = match unknown {
        0 => format!("All {all} points are safe or unsafe."),
        unknown => format!("{unknown} of {all} points are unknown."),
    };
    let names: Vec<[String; 2]> = shown
        .iter()
        .map(|own| {
            let name = &own.case.name;
            [
                format!("unsafe at the lowest speed, {name}"),
                format!("knee, {name}"),
            ]
        })
        .collect();
    let facts = shown.iter().zip(&names).flat_map(|(own, [range, point])| {
        [
            (range.as_str(), hover(args, &own.map)),
            (point.as_str(), knee(args, &own.map)),
        ]
    });
    plain_page(&PlainPage {
        title: "Height–velocity map after power loss",
        verdict: (&verdict, unknown == 0),
        facts: &facts.collect::<Vec<_>>(),
        figures: std::slice::from_ref(figure),
        tables: vec![("Boundary", (BOUNDARY.to_vec(), boundary_rows(shown)))],
        words: ("What this is", &words(args, shown)),
        made: &made(),
    })
}

/// The summary.
pub fn to_text(args: &Args, shown: &[Shown]) -> String {
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
            own.case.name.clone(),
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
        "{}{} in {}: hv.html, hv.svg, hv.png, map.csv, boundary.csv, hv.json\nno flight limitation: computed with perfect \
         knowledge, by a model\n",
        aligned(&rows),
        counted(points, "point"),
        terminal::shown(&args.output)
    )
}
