//! `--objective both`: fits the response and the stick, and lets both pilots fly alone (the paper's Fig. 2).

use super::summary::{to_json, verdict};
use super::watch::Watch;
use super::{Args, open, save};
use crate::cli::deadline::Deadline;
use crate::cli::format::aligned;
use crate::cli::made::made;
use crate::cli::{Failure, Outcome, terminal};
use crate::identification::{
    FitOptions, Identification, Objective, RunFit, Trial, TrialSet, pilot_file,
};
use crate::report::figure::{Axis, Figure, Look, Panel, Series};
use crate::report::{Overlay, Parameters, overlay_page};
use pilotage_text::number::significant;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Both fits.
struct Both {
    response: Identification,
    stick: Identification,
}

/// A trial as recorded, and as flown alone by both pilots.
struct Flown<'a> {
    trial: &'a Trial,
    response: Option<&'a RunFit>,
    stick: Option<&'a RunFit>,
    /// Rms deviation from the recording \[m\] of either pilot.
    rms: [Option<f64>; 2],
}

/// Output path for the pilot of the stick fit, next to the other one.
pub fn stick_file(args: &Args) -> PathBuf {
    let output = args.output();
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-stick.toml"))
}

/// Computes and reports both fits.
pub fn run(
    args: &Args,
    set: TrialSet,
    options: &FitOptions,
    deadline: Deadline,
) -> Result<Outcome, Failure> {
    let stick_path = stick_file(args);
    let outputs = [open(args.output())?, open(&stick_path)?];
    let page = args
        .report
        .as_deref()
        .map(|path| Ok::<_, Failure>((path, open(path)?)));
    let page = page.transpose()?;
    let fitted = |objective: Objective, set: TrialSet| {
        let mut watch = Watch::new(deadline, None, args.verbose);
        // `--objective both` compares flights, so the default vehicle is accepted if no other is given.
        let options = FitOptions {
            objective,
            vehicle_assumed: false,
            ..options.clone()
        };
        let found = Identification::new(set, options, &mut |progress| watch.flights(progress));
        watch.end();
        found
    };
    let both = Both {
        response: fitted(Objective::Response, set.clone())?,
        stick: fitted(Objective::Stick, set)?,
    };
    let [response, stick] = outputs;
    save(
        response,
        args.output(),
        &pilot_file::to_toml(&both.response),
    )?;
    save(stick, &stick_path, &pilot_file::to_toml(&both.stick))?;
    if let Some((path, output)) = page {
        save(output, path, &both.page())?;
    }
    terminal::print(&match args.json {
        true => format!("{:#}\n", both.json()),
        false => both.text(args),
    })?;
    Ok(
        match both.response.fit.is_answer() && both.stick.fit.converged {
            true => Outcome::Done,
            false => Outcome::No,
        },
    )
}

impl Both {
    fn flown(&self) -> Vec<Flown<'_>> {
        let pairs = self.response.outcomes().zip(self.stick.outcomes());
        pairs
            .map(|(response, stick)| Flown {
                trial: response.trial,
                response: response.alone,
                stick: stick.alone,
                rms: [response, stick].map(|own| own.errors().map(|(rms, _)| rms)),
            })
            .collect()
    }

    fn json(&self) -> Value {
        let flown = self.flown();
        let flown = flown.iter().map(|run| {
            json!({
                "name": run.trial.name,
                "response_rms_m": run.rms[0],
                "stick_rms_m": run.rms[1],
            })
        });
        json!({
            "response": to_json(&self.response, None),
            "stick": to_json(&self.stick, None),
            "flown_alone": flown.collect::<Vec<_>>(),
        })
    }

    fn text(&self, args: &Args) -> String {
        let mut text = String::new();
        for (name, found) in [("response", &self.response), ("stick", &self.stick)] {
            let theta: Vec<String> = found
                .fit
                .theta
                .iter()
                .map(|own| significant(*own, 5))
                .collect();
            text += &format!(
                "{name} fit: {}, theta = {}\n",
                verdict(&found.fit),
                theta.join(", ")
            );
        }
        let mut rows = vec![
            [
                "flown alone, rms from the recording",
                "response fit",
                "stick fit",
            ]
            .map(str::to_owned),
        ];
        let shown = |rms: Option<f64>| match rms {
            Some(rms) if rms.is_finite() => format!("{} m", significant(rms, 3)),
            _ => "out of bounds".to_owned(),
        };
        rows.extend(self.flown().iter().map(|run| {
            let [response, stick] = run.rms.map(shown);
            [run.trial.name.clone(), response, stick]
        }));
        text += "\n";
        text += &aligned(&rows);
        text += &format!(
            "\nwrote {}\nwrote {}\n",
            terminal::shown(args.output()),
            terminal::shown(&stick_file(args))
        );
        if let Some(report) = &args.report {
            text += &format!("wrote {}\n", terminal::shown(report));
        }
        text
    }

    fn page(&self) -> String {
        let mut rows = Vec::new();
        for (name, found) in [("response fit", &self.response), ("stick fit", &self.stick)] {
            let units = pilot_file::units(found.options.pilot);
            for ((k, value), unit) in found.fit.theta.iter().enumerate().zip(units) {
                let name = format!("theta{} ({name})", k + 1);
                rows.push(vec![name, significant(*value, 6), unit]);
            }
        }
        let parameters = Parameters {
            header: vec!["parameter", "value", "unit"],
            numeric: vec![1],
            rows,
            notes: Vec::new(),
        };
        let verdict = verdict(&self.response.fit);
        let class = match (
            self.response.fit.is_answer(),
            self.response.fit.diagnostics.is_empty(),
        ) {
            (false, _) => "bad",
            (true, false) => "doubtful",
            (true, true) => "good",
        };
        let diagnostics = self.response.fit.diagnostics.iter();
        let page = Overlay {
            title: "fits of response and stick",
            ending: (class, &verdict),
            diagnostics: diagnostics
                .map(|own| (own.code().to_owned(), own.to_string()))
                .collect(),
            facts: vec![("runs", self.response.trials.fit.len().to_string())],
            sureness: String::new(),
            figures: vec![self.figure()],
            tables: vec![("Parameters", parameters)],
        };
        overlay_page(&page, &made())
    }

    /// Both pilots flying alone, with the recordings.
    fn figure(&self) -> Figure {
        let (mut positions, mut sticks) = (Vec::new(), Vec::new());
        for run in &self.flown() {
            let trial = run.trial;
            let line = |label: &str, colour: &str, time: &[f64], y: &[f64]| {
                Series::line(label, colour, time, y).of(&trial.name)
            };
            positions.push(line("target", "goal", &trial.time, &trial.target).looks(Look::Dashed));
            positions.push(line("recorded", "data", &trial.time, &trial.position));
            sticks.extend(
                (trial.stick.iter()).map(|stick| line("recorded", "data", &trial.time, stick)),
            );
            let fits = [
                ("response fit", "line-1", run.response),
                ("stick fit", "line-2", run.stick),
            ];
            for (name, colour, own) in fits {
                positions.extend(own.map(|own| line(name, colour, &own.time, &own.position)));
                sticks.extend(own.map(|own| line(name, colour, &own.time, &own.stick)));
            }
        }
        let panel = |label: &str, height: f64, series| Panel {
            x: Axis::time(),
            y: Axis::linear(label),
            height,
            series,
            ..Panel::default()
        };
        let caption = "Each pilot flies alone, from rest; nothing is left of the optimiser here.";
        let mut figure = Figure::of(
            "response",
            "Response",
            caption,
            panel("position [m]", 340.0, positions),
        );
        figure.panels.push(panel("stick", 240.0, sticks));
        figure
    }
}
