//! The report page of a problem: each measured signal as recorded and as predicted by the model, and the residuals.

use super::summary::Outcomes;
use super::sure;
use super::tables::tables;
use crate::cli::fit::refits::Refitted;
use crate::estimation::describing::FittedLoop;
use crate::estimation::file::{Fed, Quantity};
use crate::estimation::result::RunFit;
use crate::estimation::result::courses::courses;
use crate::estimation::{Fit, OpenLoops, PilotPaths, Posed};
use crate::inference::Spread;
use crate::report::certainty::{correlation_figure, waterfall_figure};
use crate::report::describing::describing_figures;
use crate::report::figure::{Axis, Figure, Look, Panel, Series};
use crate::report::frequency::{Curve, crossover, loop_figure, path_figure};
use crate::report::palette::colour;
use crate::report::poles::wired_figure;
use crate::report::residuals::{Residuals, crossed_panel, residual_figure};
use crate::report::{Made, Overlay, overlay_page};
use crate::sqp::Status;
use nalgebra::Complex;
use pilotage_text::number::significant;
use pilotage_units::Unit;
use std::cell::RefCell;

/// The HTML page, with further figures after those of the runs.
pub fn page(outcomes: &Outcomes<'_>, others: Vec<Figure>, made: &Made) -> String {
    let Outcomes { posed, fit, .. } = outcomes;
    let verdict = fit.verdict();
    let class = match (fit.is_answer(), fit.diagnostics.is_empty()) {
        (false, _) => "bad",
        (true, false) => "doubtful",
        (true, true) => "good",
    };
    let diagnostics = fit.diagnostics.iter();
    let page = Overlay {
        title: &format!("fit of {}", posed.file.file),
        ending: (class, &verdict),
        diagnostics: diagnostics
            .map(|own| (own.code().to_owned(), own.to_string()))
            .collect(),
        facts: facts(outcomes),
        sureness: sure::in_a_sentence(fit),
        formula: formula(fit),
        figures: figures(outcomes, others),
        tables: tables(outcomes),
    };
    overlay_page(&page, made)
}

/// Amount of data and quality of the fit.
fn facts(outcomes: &Outcomes<'_>) -> Vec<(&'static str, String)> {
    let fit = outcomes.fit;
    let misfit = (fit.chi2 / fit.samples as f64).sqrt();
    vec![
        ("runs", fit.runs.len().to_string()),
        ("measured values", fit.samples.to_string()),
        (
            "rms residual over sd",
            match fit.is_met() {
                true => significant(misfit, 3),
                false => "none".to_owned(),
            },
        ),
        (
            "starts that agree",
            format!("{} of {}", fit.agreeing(), fit.starts.len()),
        ),
    ]
}

/// All figures of a fit, in page order.
fn figures(outcomes: &Outcomes<'_>, others: Vec<Figure>) -> Vec<Figure> {
    let fit = outcomes.fit;
    let mut all = vec![response(outcomes)];
    all.extend(signals(outcomes));
    all.extend(others);
    all.extend(bode(outcomes));
    all.extend(poles(outcomes));
    if fit.is_met() {
        all.extend((0..outcomes.posed.file.measured.len()).map(|k| residuals(outcomes, k)));
    }
    all.extend(beside(fit));
    if let Ok(own) = &fit.uncertainty {
        all.push(correlation_figure(&own.names, &own.correlations));
    }
    all.extend(outcomes.refitted.and_then(Refitted::figure));
    let starts = fit
        .starts
        .iter()
        .map(|own| (own.status == Status::Converged, own.objective));
    all.push(waterfall_figure("", &starts.collect::<Vec<_>>()));
    // A column may be measured twice, or have the name of another figure.
    for k in 1..all.len() {
        let (before, own) = (&all[..k], &all[k].name);
        let is_new = |name: &String| before.iter().all(|other| other.name != *name);
        let name = (0..).map(|count| numbered(own, count)).find(is_new);
        all[k].name = name.unwrap_or_default();
    }
    all
}

/// θ of the linear pilot, if nothing else is asked of a pilot.
fn formula(fit: &Fit) -> Option<Vec<f64>> {
    let of_pilot = fit
        .parameters
        .iter()
        .filter(|own| own.name.starts_with("pilot."));
    let theta: Vec<(Option<usize>, f64)> = of_pilot
        .map(|own| {
            let number = own.name.strip_prefix("pilot.theta");
            (number.and_then(|own| own.parse().ok()), own.mean())
        })
        .collect();
    let is_whole = theta
        .iter()
        .enumerate()
        .all(|(k, own)| own.0 == Some(k + 1));
    let is_even = theta.len() >= 2 && theta.len().is_multiple_of(2);
    (is_whole && is_even).then(|| theta.into_iter().map(|own| own.1).collect())
}

/// A panel for each measured signal, with all runs.
fn response(outcomes: &Outcomes<'_>) -> Figure {
    let posed = outcomes.posed;
    let panel = |(k, label): (usize, &String)| {
        let mut series = goals(outcomes, k);
        for own in outcomes.runs() {
            let (run, name) = (own.run, own.name());
            series.push(recorded(&run.time, &run.recorded[k]).of(&name));
            if own.has_figures {
                let (label, colour) = match own.judged {
                    None => ("model", "line-1"),
                    Some(_) => ("model, validation", "line-2"),
                };
                series.push(Series::line(label, colour, &run.time, &run.predicted[k]).of(&name));
                series.extend(run.ahead.as_ref().map(|own| {
                    Series::line("one step ahead", "line-3", &run.time, &own.predicted[k]).of(&name)
                }));
            }
        }
        Panel {
            x: Axis::time(),
            y: Axis::of(label, posed.unit_of(k).unwrap_or_default()),
            height: 260.0,
            series,
            ..Panel::default()
        }
    };
    let labels: Vec<String> = posed
        .file
        .measured
        .iter()
        .map(|own| own.column.value.clone())
        .collect();
    let caption = match outcomes.fit.is_met() {
        true => "What was recorded, and what the fitted model says.",
        false => "What was recorded; what was found does not fulfil the equations.",
    };
    Figure {
        panels: labels.iter().enumerate().map(panel).collect(),
        ..Figure::of("response", "Response", caption, Panel::default())
    }
}

/// The columns that drive inputs of a measured signal's unit: a target, beside what follows it.
fn goals(outcomes: &Outcomes<'_>, k: usize) -> Vec<Series> {
    let posed = outcomes.posed;
    let is_alike = |own: &&Fed| {
        let unit = posed.joint.unit(&own.signal.value);
        unit.is_some() && unit == posed.unit_of(k)
    };
    let alike: Vec<&Fed> = posed.file.inputs.iter().filter(is_alike).collect();
    let names: Vec<&str> = alike.iter().map(|own| own.signal.value.as_str()).collect();
    let mut all = Vec::new();
    for (own, course) in alike.iter().zip(along(outcomes, &names)) {
        for (run, values) in outcomes.fit.runs.iter().zip(course.into_iter().flatten()) {
            let line = Series::line(&own.column.value, "goal", &run.time, &values);
            all.push(line.of(&run.name).looks(Look::Dashed));
        }
    }
    all
}

/// Signals along the solution, for each run; none if there is no solution.
fn along(outcomes: &Outcomes<'_>, names: &[&str]) -> Vec<Option<Vec<Vec<f64>>>> {
    let solved = outcomes.fit.solved.as_deref();
    let solved = solved.filter(|_| outcomes.fit.is_met() && !names.is_empty());
    solved.map_or(Vec::new(), |solved| {
        let at = (&solved.problem, &solved.solution.iterate.z[..]);
        courses(outcomes.posed, at, names)
    })
}

/// What runs along the wires and is not measured, such as the stick; `None` if there is nothing.
fn signals(outcomes: &Outcomes<'_>) -> Option<Figure> {
    let posed = outcomes.posed;
    let is_measured = |name: &str| {
        let mut measured = posed.file.measured.iter();
        measured.any(|own| matches!(&own.of, Quantity::Signal(of) if of == name))
    };
    let mut names: Vec<&str> = Vec::new();
    for wire in &posed.file.system.connections {
        let name = wire.from.value.as_str();
        let is_seen = is_measured(name) || is_measured(&wire.to.value);
        if !is_seen && !names.contains(&name) {
            names.push(name);
        }
    }
    let known = names.iter().zip(along(outcomes, &names));
    let panel = |(name, course): (&&str, Option<Vec<Vec<f64>>>)| {
        let runs = outcomes.fit.runs.iter().zip(course?);
        let line = |(run, values): (&RunFit, Vec<f64>)| {
            Series::line("model", "line-1", &run.time, &values).of(&run.name)
        };
        Some(Panel {
            x: Axis::time(),
            y: Axis::of(name, posed.joint.unit(name).unwrap_or_default()),
            height: 220.0,
            series: recordings(posed, name).chain(runs.map(line)).collect(),
            ..Panel::default()
        })
    };
    let panels: Vec<Panel> = known.filter_map(panel).collect();
    let caption = "Signals between the models that are not measured, as the fitted models say them, and as a column of the same \
                   name recorded them.";
    (!panels.is_empty()).then(|| Figure {
        panels,
        ..Figure::of("signals", "Signals", caption, Panel::default())
    })
}

/// What a column of the signal's own name recorded, which is compared with nothing else.
fn recordings(posed: &Posed<'_>, signal: &str) -> impl Iterator<Item = Series> {
    let name = signal.rsplit('.').next().unwrap_or_default().to_owned();
    let unit = posed.joint.unit(signal).unwrap_or_default().to_owned();
    posed.data.iter().filter_map(move |run| {
        let own = run.series.column(&name)?;
        let is_alike = Unit::named(&own.unit) == Unit::named(&unit);
        is_alike.then(|| recorded(&run.series.time, &own.values).of(&run.name()))
    })
}

/// A recorded signal: a line if there are many samples, otherwise circles.
fn recorded(time: &[f64], values: &[f64]) -> Series {
    const FEW: usize = 60;
    let known = time.iter().zip(values).filter(|(_, y)| y.is_finite());
    let (x, y): (Vec<f64>, Vec<f64>) = known.unzip();
    let look = if x.len() <= FEW {
        Look::Rings
    } else {
        Look::Line
    };
    Series::line("recorded", "data", &x, &y).looks(look)
}

/// Bode plots of pilot and loop with their nonparametric estimates, if available, otherwise of the loops alone.
fn bode(outcomes: &Outcomes<'_>) -> Vec<Figure> {
    let Outcomes { posed, fit, .. } = outcomes;
    let Some(solved) = fit.solved.as_deref() else {
        return Vec::new();
    };
    let (theta, sure) = (solved.theta(), spread(fit));
    let with = |theta: &[f64]| FittedLoop::with(posed, solved, theta);
    if with(&theta).is_some() {
        let known = Linearised::new(&with);
        let pilot = |theta: &[f64], omega: f64| known.at(theta, &|own| own.pilot(omega));
        let open_loop = |theta: &[f64], omega: f64| known.at(theta, &|own| own.open_loop(omega));
        let models: [Curve<'_>; 2] = [&pilot, &open_loop];
        let figures = describing_figures(&fit.describing, models, &theta, sure.as_ref());
        if !figures.is_empty() {
            let has_pilot = figures.iter().any(|own| own.name == "bode");
            let middle = crossover(&open_loop, &theta).unwrap_or(1.0);
            let alone = (!has_pilot).then(|| paths(outcomes, middle));
            return alone.into_iter().flatten().chain(figures).collect();
        }
    }
    let Some(loops) = OpenLoops::new(posed, solved) else {
        return Vec::new();
    };
    let with = |theta: &[f64]| loops.with(theta);
    let known = Linearised::new(&with);
    let open = |k: usize| {
        let known = &known;
        move |theta: &[f64], omega: f64| known.at(theta, &|own| own[k](omega))
    };
    let mut figures = paths(outcomes, crossover(&open(0), &theta).unwrap_or(1.0));
    let figure = |(k, cut): (usize, &String)| {
        loop_figure(
            &numbered("open-loop", k),
            cut,
            &open(k),
            &theta,
            sure.as_ref(),
        )
    };
    figures.extend(fit.cuts.iter().enumerate().map(figure));
    figures
}

/// Frequency responses of the paths through the pilot, around this frequency \[rad/s\].
fn paths(outcomes: &Outcomes<'_>, middle: f64) -> Vec<Figure> {
    let Outcomes { posed, fit, .. } = outcomes;
    let Some(solved) = fit.solved.as_deref() else {
        return Vec::new();
    };
    let Some(paths) = PilotPaths::new(posed, solved) else {
        return Vec::new();
    };
    let (theta, sure) = (solved.theta(), spread(fit));
    let with = |theta: &[f64]| paths.with(theta);
    let known = Linearised::new(&with);
    let figure = |(k, ends): (usize, &[String; 2])| {
        let of = |theta: &[f64], omega: f64| known.at(theta, &|own| own[k](omega));
        path_figure(
            &numbered("bode", k),
            ends,
            &of,
            &theta,
            sure.as_ref(),
            middle,
        )
    };
    paths.ends().iter().enumerate().map(figure).collect()
}

/// The name of a figure that may occur several times.
fn numbered(name: &str, k: usize) -> String {
    match k {
        0 => name.to_owned(),
        _ => format!("{name}-{}", k + 1),
    }
}

/// A linearisation as a function of the shared parameters, cached for all frequencies.
struct Linearised<'a, T> {
    with: &'a dyn Fn(&[f64]) -> Option<T>,
    known: RefCell<Vec<(Vec<f64>, Option<T>)>>,
}

impl<'a, T> Linearised<'a, T> {
    fn new(with: &'a dyn Fn(&[f64]) -> Option<T>) -> Self {
        Self {
            with,
            known: RefCell::default(),
        }
    }

    /// A value of the linearisation; NaN if there is none.
    fn at(&self, theta: &[f64], of: &dyn Fn(&T) -> Complex<f64>) -> Complex<f64> {
        let mut known = self.known.borrow_mut();
        let place = known.iter().position(|own| own.0 == theta);
        let place = place.unwrap_or_else(|| {
            known.push((theta.to_vec(), (self.with)(theta)));
            known.len() - 1
        });
        let nothing = Complex::new(f64::NAN, f64::NAN);
        known[place].1.as_ref().map_or(nothing, of)
    }
}

/// The covariance of the shared parameters, with what the data leave open.
fn spread(fit: &Fit) -> Option<Spread> {
    let own = fit.uncertainty.as_ref().ok()?;
    let is_known = own.covariance.matrix.iter().all(|value| value.is_finite());
    is_known.then(|| Spread::of(&own.covariance, &own.open))
}

/// The poles of the connected system; `None` if it has none.
fn poles(outcomes: &Outcomes<'_>) -> Option<Figure> {
    let Outcomes { posed, fit, .. } = outcomes;
    let solved = fit.solved.as_deref()?;
    let of = |theta: &[f64]| solved.poles_with(posed, theta);
    wired_figure(&of, &solved.theta(), spread(fit).as_ref())
}

/// The residuals of a measured signal.
fn residuals(outcomes: &Outcomes<'_>, k: usize) -> Figure {
    let measured = &outcomes.posed.file.measured[k];
    let signal = &measured.column.value;
    let all: Vec<Residuals<'_>> = (outcomes.fit.runs.iter())
        .map(|run| Residuals {
            run: &run.name,
            label: String::new(),
            colour: colour(0),
            time: &run.time,
            values: run.residuals(k, measured.noise),
        })
        .collect();
    let (name, title) = (
        format!("residuals-{signal}"),
        format!("Residuals of {signal}"),
    );
    let caption = "In standard deviations of the noise: over time, by lag and by frequency.";
    residual_figure(&name, &title, caption, "", &all)
}

/// Cross-correlations of residuals and inputs, a panel for each pair; `None` if there are none.
fn beside(fit: &Fit) -> Option<Figure> {
    let panels = fit.beside.iter().map(|own| {
        let label = format!("{}, {}", own.measured, own.input);
        crossed_panel(&label, &own.crossed)
    });
    let panels: Vec<Panel> = panels.collect();
    let caption = "Correlations of residuals with what the input was so long before; below 0, after. Outside of the band \
                   the model may lack a path or a delay.";
    (!panels.is_empty()).then(|| Figure {
        panels,
        ..Figure::of(
            "residuals-inputs",
            "Residuals and inputs",
            caption,
            Panel::default(),
        )
    })
}
