//! The page of a study.

use super::plan::Plan;
use super::store::Row;
use super::summary::{Dependence, Of, Summary};
use super::traces::{Fan, Traced};
use crate::cli::made::made;
use crate::inference::sample::quantile;
use crate::report::figure::{Axis, Figure, Look, Panel, Series};
use crate::report::{PlainPage, plain_page};
use pilotage_sweep::statistics::Interval;
use pilotage_text::number::significant;

/// Most measures, and variables of a measure, that are drawn.
pub const MOST: usize = 6;

/// The page.
pub fn html(plan: &Plan, rows: &[Row], found: &Summary, fans: &[Fan]) -> String {
    let mut figures = vec![distributions(found)];
    figures.extend(fan_chart(plan, fans));
    figures.extend(dependences(found));
    figures.extend((0..found.measures.len().min(MOST)).filter_map(|m| scatter(plan, rows, m)));
    let median = |own: &Of| {
        let parts = [0.05, 0.5, 0.95].map(|part| quantile(&own.ascending, part));
        let [low, middle, high] = parts.map(|own| {
            if own.is_finite() {
                significant(own, 3)
            } else {
                "-".to_owned()
            }
        });
        format!("{middle} ({low} to {high})")
    };
    let facts: Vec<(&str, String)> = found
        .measures
        .iter()
        .take(MOST)
        .map(|own| (own.name.as_str(), median(own)))
        .collect();
    let expressions = plan.measures.iter().map(|(name, given)| {
        match given.split_once('=').map(|own| own.0.trim() == name) {
            Some(true) => format!("{given}."),
            _ => format!("{name}: {given}."),
        }
    });
    let mut words: Vec<String> = expressions.collect();
    words.push(
        "Above each measure stands its median, with the range of nine in ten samples. A rank correlation is that of Spearman; a Sobol' index \
         of first order is the part of the variance that goes if the variable is known, the total one the part that stays if all others are."
            .to_owned(),
    );
    plain_page(&PlainPage {
        title: "Study of many runs",
        verdict: (&found.verdict(), found.failed == 0),
        facts: &facts,
        figures: &figures,
        tables: vec![
            ("Measures", found.quantiles()),
            ("What they depend on", found.dependences()),
        ],
        words: ("What this is", &words),
        made: &made(),
    })
}

/// Quantiles over time.
fn fan_chart(plan: &Plan, fans: &[Fan]) -> Option<Figure> {
    let panel = |(own, fan): (&Traced, &Fan)| {
        let [low, lower, middle, upper, high] = &fan.quantiles;
        // Where no sample has a value there is no area.
        let known: Vec<usize> = (0..fan.times.len())
            .filter(|k| middle[*k].is_finite())
            .collect();
        let of = |all: &[f64]| known.iter().map(|k| all[*k]).collect::<Vec<f64>>();
        let x = of(&fan.times);
        let band = |label: &str, low: &[f64], high: &[f64]| {
            Series::band(label, "line-1", &x, [&of(low), &of(high)])
        };
        let label = match own.unit.as_str() {
            "" => own.name.clone(),
            unit => format!("{} [{unit}]", own.name),
        };
        let series = vec![
            band("5 to 95 %", low, high),
            band("25 to 75 %", lower, upper),
            Series::line("50 %", "line-1", &x, &of(middle)),
        ];
        Panel::over_time(&label, 180.0, series)
    };
    let panels: Vec<Panel> = plan.traced.iter().zip(fans).map(panel).collect();
    (!panels.is_empty()).then(|| Figure {
        name: "fan".into(),
        title: "Trajectories".into(),
        caption: "Quantiles of the samples at each time.".into(),
        panels,
    })
}

/// The part of the samples below each value.
fn distributions(found: &Summary) -> Figure {
    let panel = |own: &Of| {
        let n = own.ascending.len() as f64;
        let parts: Vec<f64> = (0..own.ascending.len())
            .map(|k| (k as f64 + 0.5) / n)
            .collect();
        Panel {
            x: Axis::linear(own.name.as_str()),
            y: Axis::linear("part below"),
            height: 160.0,
            series: vec![Series::line("", "line-1", &own.ascending, &parts)],
            ..Panel::default()
        }
    };
    Figure {
        name: "distributions".into(),
        title: "Distributions".into(),
        caption: "Part of the samples below each value.".into(),
        panels: found
            .measures
            .iter()
            .take(MOST)
            .filter(|own| !own.ascending.is_empty())
            .map(panel)
            .collect(),
    }
}

/// Dependences with their intervals, the largest on top.
fn dependences(found: &Summary) -> Option<Figure> {
    let panel = |own: &Of| {
        let size = |on: &Dependence| match on {
            Dependence::Rank(own) => own.value.abs(),
            Dependence::Sobol(own) => own.total.value,
        };
        let mut on: Vec<&(String, Dependence)> = own.on.iter().collect();
        on.sort_by(|a, b| size(&a.1).total_cmp(&size(&b.1)));
        let mut series = Vec::new();
        for (k, (_, on)) in on.iter().enumerate() {
            let mut draw = |label: &str, colour: &str, own: Interval, by: f64| {
                let y = k as f64 + by;
                series.push(Series::line("", colour, &[own.low, own.high], &[y, y]));
                series.push(Series::line(label, colour, &[own.value], &[y]).looks(Look::Dots));
            };
            match on {
                Dependence::Rank(own) => draw("rank correlation", "line-1", *own, 0.0),
                Dependence::Sobol(own) => {
                    draw("first order", "line-1", own.first, 0.1);
                    draw("total", "line-4", own.total, -0.1);
                }
            }
        }
        Panel {
            x: Axis::linear(format!("dependence of {}", own.name)),
            y: Axis {
                names: on.iter().map(|own| own.0.clone()).collect(),
                ..Axis::linear("")
            },
            height: 60.0 + 28.0 * on.len() as f64,
            series,
            ..Panel::default()
        }
    };
    let panels: Vec<Panel> = found
        .measures
        .iter()
        .take(MOST)
        .filter(|own| !own.on.is_empty())
        .map(panel)
        .collect();
    (!panels.is_empty()).then(|| Figure {
        name: "dependences".into(),
        title: "What the measures depend on".into(),
        caption: "Points with 95 % intervals.".into(),
        panels,
    })
}

/// A measure over the variables.
fn scatter(plan: &Plan, rows: &[Row], m: usize) -> Option<Figure> {
    let name = &plan.measures[m].0;
    let panel = |(d, variable): (usize, &str)| {
        let done = rows.iter().filter(|own| own.measured[m].is_finite());
        let (x, y): (Vec<f64>, Vec<f64>) = done.map(|own| (own.values[d], own.measured[m])).unzip();
        Panel {
            x: Axis::linear(variable),
            y: Axis::linear(name.as_str()),
            height: 180.0,
            series: vec![Series::line("", "line-1", &x, &y).looks(Look::Dots)],
            ..Panel::default()
        }
    };
    let panels: Vec<Panel> = plan
        .design
        .names()
        .enumerate()
        .take(MOST)
        .map(panel)
        .collect();
    (!panels.is_empty()).then(|| Figure {
        name: format!("scatter-{}", m + 1),
        title: format!("{name} over what is varied"),
        caption: "A point for each sample.".into(),
        panels,
    })
}
