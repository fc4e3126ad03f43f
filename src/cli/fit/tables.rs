//! Tables of the report page of a problem.

use super::summary::{Outcomes, run_header};
use super::sure;
use crate::cli::fit::refits::Refitted;
use crate::cli::made::with_sums;
use crate::estimation::Fit;
use crate::estimation::file::{Limits, Mesh, Objective, Options};
use crate::linear::Mode;
use crate::report::{Parameters, modes};
use nalgebra::Complex;
use pilotage_text::number::{short, significant};
use std::path::PathBuf;

/// All tables, in page order.
pub fn tables(outcomes: &Outcomes<'_>) -> Vec<(&'static str, Parameters)> {
    let fit = outcomes.fit;
    let mut all = vec![("Parameters", parameters(fit))];
    all.extend((outcomes.refitted).map(|own| ("Profiles and bootstrap", Refitted::table(own))));
    all.push(("Active constraints", active(fit)));
    all.extend(outcomes.checked.iter().flat_map(|own| own.tables(fit)));
    let poles = fit.poles.iter().map(|own| Complex::new(own[0], own[1]));
    let poles = Mode::of_poles(&poles.collect::<Vec<_>>());
    all.extend((!poles.is_empty()).then(|| ("Poles of the system", modes(&poles))));
    all.push(("Data", data(outcomes)));
    all.push(("Solve", solve(outcomes)));
    all.push(("Starts", starts(fit)));
    all.push(("Files", files(outcomes)));
    all
}

fn parameters(fit: &Fit) -> Parameters {
    let mut rows = Vec::new();
    for (found, intervals) in sure::of(fit).chain(sure::derived(fit)) {
        for (k, (name, value)) in found.named().enumerate() {
            let unit = found.unit.clone().unwrap_or_default();
            let [sd, low, high, meaning] = sure::cells(intervals.and_then(|all| all.get(k)));
            let [bound, insensitivity] = sure::percents(fit, &name);
            let value = significant(value, 7);
            rows.push(vec![
                name,
                value,
                sd,
                low,
                high,
                unit,
                bound,
                insensitivity,
                meaning,
            ]);
        }
    }
    let header = [
        "parameter",
        "value",
        "sd",
        "95 % low",
        "95 % high",
        "unit",
        "Cramér–Rao [%]",
        "insensitivity [%]",
        "",
    ];
    Parameters {
        header: header.to_vec(),
        numeric: vec![1, 2, 3, 4, 6, 7],
        rows,
        notes: sure::to_text(fit).lines().map(str::to_owned).collect(),
    }
}

/// Parameters at a bound of their range.
fn active(fit: &Fit) -> Parameters {
    let on_bound = fit
        .parameters
        .iter()
        .filter_map(|own| Some((own, own.bound?)));
    let rows: Vec<Vec<String>> = on_bound
        .map(|(own, bound)| {
            let unit = own.unit.clone().unwrap_or_default();
            vec![own.name.clone(), significant(bound, 6), unit]
        })
        .collect();
    let notes = if rows.is_empty() {
        vec!["No parameter is at an end of its range.".to_owned()]
    } else {
        Vec::new()
    };
    Parameters {
        header: vec!["parameter", "at its bound", "unit"],
        numeric: vec![1],
        rows,
        notes,
    }
}

const ONE_STEP: &str = "One step: variance accounted for by the model and an autoregressive process of its residuals, each \
                        sample predicted from those before it; vaf is that of the model alone.";

/// The runs, with the residuals of each signal.
fn data(outcomes: &Outcomes<'_>) -> Parameters {
    let header = run_header(outcomes);
    let rows = super::summary::run_rows(outcomes.posed, outcomes)
        .into_iter()
        .skip(1);
    Parameters {
        header: header.to_vec(),
        numeric: (2..header.len()).collect(),
        rows: rows.collect(),
        notes: match outcomes.posed.filter {
            Some(_) => Vec::new(),
            None => std::iter::once(ONE_STEP.to_owned())
                .chain(outcomes.carried())
                .collect(),
        },
    }
}

/// How the problem was solved.
fn solve(outcomes: &Outcomes<'_>) -> Parameters {
    let fit = outcomes.fit;
    let options = outcomes.posed.file.options;
    let refinement = &fit.refinement;
    let solved = fit.solved.as_deref();
    let unknowns = solved.map(|own| own.solution.iterate.z.len().to_string());
    let rows = [
        ("status", fit.ending().to_owned()),
        ("objective", significant(fit.objective, 8)),
        (
            "objective of a simulation",
            fit.simulated_objective
                .map_or("-".into(), |own| significant(own, 8)),
        ),
        (
            "scaled KKT residual",
            format!(
                "{:.2e} (tolerance {:e})",
                fit.kkt.residual(),
                options.tolerance
            ),
        ),
        (
            "smallest scaled curvature",
            fit.curvature.map_or("-".into(), |own| significant(own, 3)),
        ),
        (
            "iterations",
            format!(
                "{} (limit {} for each solve)",
                refinement.iterations, options.max_iterations
            ),
        ),
        ("unknowns", unknowns.unwrap_or("-".into())),
        (
            "wall time",
            format!("{} s", significant(fit.seconds.total(), 3)),
        ),
        (
            "collocation",
            format!(
                "{} (order {})",
                refinement.scheme,
                refinement.scheme.order()
            ),
        ),
        ("mesh", mesh(&options)),
        (
            "mesh intervals",
            format!(
                "{} after {} refinements",
                refinement.intervals, refinement.rounds
            ),
        ),
        (
            "estimated relative error of the states",
            short(refinement.error, 2),
        ),
        ("what is minimised", objective(options.objective).into()),
        ("limits of outputs", limits(options.limits).into()),
    ];
    Parameters {
        header: vec!["", ""],
        numeric: Vec::new(),
        rows: rows
            .map(|(what, value)| vec![what.to_owned(), value])
            .into(),
        notes: Vec::new(),
    }
}

fn mesh(options: &Options) -> String {
    match options.mesh {
        Mesh::Samples => "the samples".into(),
        Mesh::Step(step) => format!("intervals of about {step} s"),
        Mesh::Tolerance(tolerance) => format!("the samples, refined to an error of {tolerance:e}"),
    }
}

fn objective(objective: Objective) -> &'static str {
    match objective {
        Objective::Response => "the deviation from a simulation without noise",
        Objective::PredictionError => "the deviation from predictions from earlier samples",
    }
}

fn limits(limits: Limits) -> &'static str {
    match limits {
        Limits::Constrain => "constraints at all samples",
        Limits::Saturate => "outputs saturate there",
    }
}

/// How each start ended, best first.
fn starts(fit: &Fit) -> Parameters {
    let mut all: Vec<_> = fit.starts.iter().enumerate().collect();
    all.sort_by(|(_, a), (_, b)| a.objective.total_cmp(&b.objective));
    let row = |(k, own): (usize, &crate::estimation::result::StartEnd)| {
        let known = Some(own.objective).filter(|own| own.is_finite());
        vec![
            (k + 1).to_string(),
            own.status.as_str().to_owned(),
            own.iterations.to_string(),
            known.map_or("-".into(), |own| significant(own, 8)),
            own.kkt.map_or("-".into(), |own| significant(own, 2)),
        ]
    };
    Parameters {
        header: vec![
            "start",
            "ended",
            "iterations",
            "objective",
            "scaled KKT residual",
        ],
        numeric: vec![0, 2, 3, 4],
        rows: all.into_iter().map(row).collect(),
        notes: Vec::new(),
    }
}

/// The files of the runs, with their SHA-256.
fn files(outcomes: &Outcomes<'_>) -> Parameters {
    let mut files: Vec<PathBuf> = Vec::new();
    for run in &outcomes.posed.file.runs {
        if !files.contains(&run.file) {
            files.push(run.file.clone());
        }
    }
    let rows = with_sums(&files)
        .into_iter()
        .map(|(name, sum)| vec![name, sum]);
    Parameters {
        header: vec!["file", "SHA-256"],
        numeric: Vec::new(),
        rows: rows.collect(),
        notes: Vec::new(),
    }
}
