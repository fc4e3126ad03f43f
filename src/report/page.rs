//! The report page of a pilot fit.

use super::figure::Figure;
use super::figures::{self, ClosedLoop};
use super::html::{
    Html, Made, choice, diagnostic, facts, figure, header, html, paragraph, section, whole,
};
use super::number;
use super::overlay::{self, Parameters};
use super::tables;
use crate::identification::{Diagnostic, Fit, Identification};
use crate::inference::Interval;
use crate::models::Pilot;
use pilotage_inference::statistics::rms;
use pilotage_text::number::significant;

/// Ratio of standard deviation to value below which a parameter is well determined: half of the limit of Tischler &
/// Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., section 12.3, for the Cramér–Rao bound, which is
/// twice a standard deviation.
const WELL_DETERMINED: f64 = 0.1;

/// Contents of the report page.
#[derive(Debug, Clone)]
pub struct Report<'a> {
    /// The fit with its context.
    pub found: &'a Identification,
    /// Table of refits; `None` if there are none.
    pub refits: Option<Parameters>,
    /// Profiles; `None` if not requested.
    pub profiles: Option<Figure>,
    /// Co-simulations of the exported FMUs; empty if none were run.
    pub loops: &'a [ClosedLoop<'a>],
    /// Origin of the page.
    pub made: &'a Made,
}

/// The page as a self-contained HTML file.
pub fn page(report: &Report) -> String {
    let body = html! {
        (head(report))
        (choice())
        @for own in figures::all(report) { (figure(&own)) }
        (numbers(report))
    };
    whole("identified pilot", &body, report.made)
}

/// Title, verdict, and the result as a formula and a few figures.
fn head(report: &Report) -> Html {
    let Identification { fit, options, .. } = report.found;
    let trials = &report.found.trials.fit;
    let (class, verdict) = match (fit.converged, fit.diagnostics.first()) {
        (false, _) => ("bad", format!("not converged: {}", fit.status)),
        (true, Some(diagnostic)) if diagnostic.is_fatal() => {
            ("bad", format!("no answer: {}", diagnostic.code()))
        }
        (true, Some(diagnostic)) => (
            "doubtful",
            format!("converged, in doubt: {}", diagnostic.code()),
        ),
        (true, None) => ("good", "converged".to_owned()),
    };
    let unit = match options.objective.unit() {
        "1" => String::new(),
        unit => format!(" {unit}"),
    };
    let residuals = || fit.runs.iter().flat_map(|run| &run.residual);
    let samples = residuals().filter(|residual| residual.is_finite()).count();
    let facts = facts(&[
        ("runs", trials.len().to_string()),
        ("samples", samples.to_string()),
        (
            "rms residual",
            match fit.is_feasible() {
                true => significant(rms(residuals()), 3) + &unit,
                false => "none: the last iterate violates the equations".into(),
            },
        ),
        (
            "starts that agree",
            format!("{} of {}", fit.agreeing(), fit.tried),
        ),
    ]);
    html! {
        (header("Identified pilot", class, &verdict))
        @if !fit.converged {
            p class="warning" {
                "The numbers below are the best iterate of a solve that did not converge. Do not use them as a result: try \
                 another " code { "--start" } ", " code { "--initial-state vehicle-at-rest" } " or a higher "
                code { "--max-iterations" } "."
            }
        }
        @for own in &fit.diagnostics { (diagnostic(class_of(own), own.code(), &own.to_string())) }
        div class="formula" { (transfer_function(options.pilot, &fit.theta)) }
        (facts)
        (paragraph(None, &sureness(fit)))
    }
}

/// A sentence about the uncertainty of the fit.
fn sureness(fit: &Fit) -> String {
    let Some(sure) = &fit.uncertainty else {
        return "How sure it is is not known: see the diagnostics.".into();
    };
    let values = fit.theta.iter().copied();
    well_determined(values.zip(&sure.intervals))
}

/// A sentence with the number of well-determined parameters.
pub fn well_determined<'i>(all: impl Iterator<Item = (f64, &'i Interval)>) -> String {
    let (mut well, mut count) = (0, 0);
    for (value, interval) in all {
        count += 1;
        well += usize::from(interval.sd < WELL_DETERMINED * value.abs());
    }
    format!(
        "{well} of {count} parameters are well determined, by a standard deviation of their intervals below {:.0} % of the \
         value.",
        100.0 * WELL_DETERMINED
    )
}

fn class_of(diagnostic: &Diagnostic) -> &'static str {
    match diagnostic.is_fatal() {
        true => "warning",
        false => "caution",
    }
}

/// The pilot's transfer function from the error [m] to the stick, as a fraction.
fn transfer_function(pilot: Pilot, theta: &[f64]) -> Html {
    let (denominator, numerator) = theta.split_at(pilot.order);
    let mut denominator = denominator.to_vec();
    denominator.push(1.0);
    html! {
        span { i { "y" } sub { "p" } " / " i { "u" } sub { "p" } " =" }
        span class="fraction" { span { (polynomial(numerator)) } span { (polynomial(&denominator)) } }
    }
}

/// A polynomial in s, highest power first; `c[i]` is the coefficient of s^i.
fn polynomial(c: &[f64]) -> Html {
    let term = |(i, &value): (usize, &f64)| {
        let sign = match (value < 0.0, i + 1 == c.len()) {
            (true, true) => "\u{2212}",
            (true, false) => " \u{2212} ",
            (false, true) => "",
            (false, false) => " + ",
        };
        html! {
            (sign)
            @if value != 1.0 || i == 0 { (number::html(value.abs(), 4)) }
            @if i > 0 { " " (tables::power(i)) }
        }
    };
    html! { @for own in c.iter().enumerate().rev() { (term(own)) } }
}

fn numbers(report: &Report) -> Html {
    let Identification { fit, options, .. } = report.found;
    let trials = &report.found.trials.fit;
    let files = trials.iter().map(|run| (&*run.origin, &*run.sha256));
    html! {
        (section("Parameters", &tables::theta(fit, options.pilot)))
        (overlay::refits(report.refits.as_ref()))
        (section("Active constraints", &tables::active(report.found)))
        (section("Poles of the pilot", &tables::poles(fit, options.pilot)))
        (section("Poles of the closed loop", &tables::closed_loop(fit)))
        (section("Margins of the closed loop", &tables::derived(report.found)))
        (section("Runs", &tables::runs(report.found)))
        (section("Solve", &tables::solve(fit, options)))
        (section("Vehicle", &tables::vehicle(options)))
        (section("Data", &tables::files(files)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::joint::Joint;
    use crate::identification::{FitOptions, Trial, TrialSet, simulate};
    use crate::synthetic::{Flights, Human};

    /// A plausible fit: the trials flown in closed loop.
    fn plausible_fit(options: &FitOptions, trials: &[Trial], theta: &[f64]) -> Fit {
        let joint = Joint {
            vehicle: options.vehicle,
            pilot: options.pilot,
        };
        let runs = trials
            .iter()
            .map(|trial| simulate(&joint, theta, trial).unwrap());
        Fit {
            theta: theta.to_vec(),
            objective: 1234.5,
            converged: false,
            status: crate::sqp::Status::IterationLimit,
            kkt: 1e-3,
            iterations: 200,
            seconds: 1.5,
            unknowns: 16_260,
            starts: Vec::new(),
            tried: 0,
            skipped: 0,
            curvature: None,
            violation: 0.0,
            runs: runs.collect(),
            closed_loop: None,
            unbounded: None,
            uncertainty: None,
            diagnostics: Vec::new(),
        }
    }

    #[test]
    fn a_page_holds_all_its_parts_and_nothing_from_outside() {
        let options = FitOptions::default();
        let flights = Flights::default()
            .fly(&Human::default(), &options.vehicle)
            .unwrap();
        let trials: Vec<Trial> = (flights.iter())
            .map(|flight| {
                Trial::parse(
                    flight.series.to_csv().as_bytes(),
                    &format!("<{}>.csv", flight.name),
                )
                .unwrap()
            })
            .collect();
        let theta = [0.267, 1.18, 0.94, -0.0045, -0.028, -0.042];
        let fit = plausible_fit(&options, &trials, &theta);
        let loops = [ClosedLoop {
            target: 10.0,
            series: &flights[0].series,
            position: "position",
            stick: "stick",
        }];
        let trials = TrialSet {
            fit: trials,
            validation: Vec::new(),
            notes: Vec::new(),
            files: Vec::new(),
        };
        let found = Identification::of(fit, options, trials);
        let report = Report {
            found: &found,
            refits: None,
            profiles: None,
            loops: &loops,
            made: &Made {
                command: "pilotage fit <x>".into(),
                date: "2026-03-01 09:30 UTC".into(),
            },
        };
        let html = page(&report);
        let names: Vec<String> = super::super::read::figures(&html)
            .into_iter()
            .map(|figure| figure.name)
            .collect();
        let expected = [
            "response",
            "stick",
            "closed-loop",
            "bode",
            "open-loop",
            "poles",
            "residuals",
            "waterfall",
        ];
        assert_eq!(names, expected);
        assert_eq!(html.matches("<tr><td>θ").count(), 6);
        for part in [
            "not converged: iteration-limit",
            "model, 10 m",
            "model, 20 m",
            "FMUs, 10 m",
            "&lt;10m-run1&gt;.csv",
            "The MIT License (MIT)",
            "2026-03-01 09:30 UTC",
            "pilotage fit &lt;x&gt;",
        ] {
            assert!(html.contains(part), "{part}");
        }
        // Nothing is fetched: uPlot mentions its URL only in a comment.
        for outside in ["src=", "href=", "fetch(", "import(", "<10m", "NaN,", "url("] {
            assert!(!html.contains(outside), "{outside}");
        }
    }
}
