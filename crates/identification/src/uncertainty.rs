//! Uncertainty of θ: standard deviations and 95 % intervals, by `pilotage-inference`.

use super::FitOptions;
use nalgebra::{DMatrix, DVector};
use pilotage_collocation::{Collocation, Sensitivities};
use pilotage_inference::{Data, Inference, Interval, Method, Row, Run};
use pilotage_inference::{Direction, Noise, Spread};
use pilotage_sqp::Iterate;
use pilotage_text::counted;

/// Step along an undetermined direction, relative to a parameter.
const ALONG: f64 = 1e-3;
/// A derived quantity is undetermined if its relative change, per relative change of the parameters along such a
/// direction, exceeds this.
const TOUCHED: f64 = 0.01;

/// Uncertainty of θ, linearised at the solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Covariance of θ and its method.
    pub spread: Spread,
    /// Method behind the correlations: a different one if there are few runs.
    pub correlated_by: Method,
    /// Intervals of the components of θ; a stability condition that holds with equality removes its direction.
    pub intervals: Vec<Interval>,
    /// Correlations of θ.
    pub correlations: DMatrix<f64>,
    /// Cramér–Rao bounds `2√(H⁻¹)ᵢᵢ` relative to θ \[%\].
    pub cramer_rao: Vec<f64>,
    /// Insensitivities `√(1/Hᵢᵢ)` relative to θ \[%\].
    pub insensitivity: Vec<f64>,
    /// Number of conditions on θ that hold with equality.
    pub held: usize,
    /// Number of samples at which the limit of the stick is active.
    pub limited: usize,
    /// Directions that the data leave undetermined.
    pub open: Vec<Direction>,
}

impl Uncertainty {
    /// Computed at a solution of the paper's problem; `None` if its derivatives or its noise are not known.
    pub(super) fn of(problem: &Collocation, at: &Iterate, options: &FitOptions) -> Option<Self> {
        let data = data(problem, at)?;
        let inference = Inference::new(&data).ok()?;
        let covariance = inference.covariance(options.covariance);
        // If the requested method fails, the default is used, identified by its name.
        let covariance = covariance.or_else(|_| inference.covariance(None)).ok()?;
        let theta = problem.physical_theta(&at.z);
        let percent = |(value, theta): (f64, &f64)| 100.0 * value / theta.abs();
        let percents = |all: Vec<f64>| all.into_iter().zip(&theta).map(percent).collect();
        let sd = covariance.deviations();
        let open = [f64::NEG_INFINITY, f64::INFINITY];
        let interval = |k: usize| {
            let sd = if inference.flat[k] {
                f64::INFINITY
            } else {
                sd[k]
            };
            Interval::new(theta[k], sd, covariance.degrees[k], open, None)
        };
        Some(Self {
            correlated_by: covariance.correlated_by,
            intervals: (0..theta.len()).map(interval).collect(),
            correlations: covariance.correlations(),
            cramer_rao: percents(inference.cramer_rao()),
            insensitivity: percents(inference.insensitivity()),
            held: data.active.nrows(),
            limited: data.runs.iter().map(|run| run.active.nrows()).sum(),
            open: inference.directions.clone(),
            spread: Spread::of(&covariance),
        })
    }

    /// The covariance for derived quantities; `None` if the data leave a direction undetermined.
    pub fn determined(&self) -> Option<&Spread> {
        self.open.is_empty().then_some(&self.spread)
    }

    /// [`Spread::derived`]; quantities that change along an undetermined direction are flat.
    pub fn derived(
        &self,
        theta: &[f64],
        values: &[f64],
        of: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Vec<Interval> {
        let open = [f64::NEG_INFINITY, f64::INFINITY];
        let flat = |value: &f64| Interval::new(*value, f64::INFINITY, f64::INFINITY, open, None);
        let mut changes = vec![0.0_f64; values.len()];
        for Direction(parts) in &self.open {
            // Normalised by the component with the largest relative change.
            let relative = parts
                .iter()
                .zip(theta)
                .map(|(part, own)| (part / own).abs());
            let size = relative.filter(|own| own.is_finite()).fold(0.0, f64::max);
            let moved = |by: f64| {
                let moved = parts
                    .iter()
                    .zip(theta)
                    .map(|(part, own)| own + by * part / size);
                of(&moved.collect::<Vec<_>>())
            };
            let pairs = moved(ALONG).into_iter().zip(moved(-ALONG));
            for (change, (a, b)) in changes.iter_mut().zip(pairs) {
                let own = ((a - b) / (2.0 * ALONG)).abs();
                *change = if own.is_nan() {
                    f64::INFINITY
                } else {
                    change.max(own)
                };
            }
        }
        let intervals = self.spread.derived(theta, values, of);
        let all = values.iter().zip(&changes).zip(intervals);
        all.map(
            |((value, change), own)| match *change > TOUCHED * value.abs() {
                true => flat(value),
                false => own,
            },
        )
        .collect()
    }

    /// Notes for the user.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.held > 0 {
            notes.push(format!(
                "{} of the conditions for stability hold with equality: intervals are along what they leave free",
                self.held
            ));
        }
        if self.limited > 0 {
            notes.push(format!(
                "the limit of the stick holds at {} with equality: intervals are along what that leaves free, and a pilot who \
                 was at the stops there is another one than this",
                counted(self.limited, "sample")
            ));
        }
        for Direction(parts) in &self.open {
            let parts = parts.iter().enumerate().filter(|(_, part)| **part != 0.0);
            let sum: Vec<String> = parts
                .map(|(k, part)| format!("{part:.3} θ{}", k + 1))
                .collect();
            notes.push(format!(
                "nothing that is recorded changes along {}",
                sum.join(" + ")
            ));
        }
        notes
    }
}

/// The least-squares problem of a solution; `None` if its derivatives are not known.
pub(super) fn data(problem: &Collocation, at: &Iterate) -> Option<Data> {
    let found = Sensitivities::new(problem, at)?;
    let runs = found.runs.iter().enumerate();
    Some(Data {
        runs: runs.map(|(j, own)| run(problem, at, j, own)).collect(),
        prior: DMatrix::zeros(0, problem.n_parameters()),
        prior_residuals: Vec::new(),
        active: found.parameters.clone(),
        scales: DVector::from_column_slice(&problem.model.scales.parameters),
        is_scaled: false,
        levels: Vec::new(),
    })
}

/// Residuals and derivatives of a run.
fn run(
    problem: &Collocation,
    at: &Iterate,
    j: usize,
    own: &pilotage_collocation::Sensitivity,
) -> Run {
    let recording = &problem.runs[j].measured[0];
    let outputs = problem.outputs_at_samples(&at.z, j);
    let pairs = recording.values.iter().zip(&outputs[0]).enumerate();
    let there = pairs.filter(|(_, (y, _))| y.is_finite());
    let rows: Vec<(usize, Row)> = there
        .map(|(k, (y, h))| (k, Row::new(Noise::Normal, y - h, recording.weight)))
        .collect();
    let width = own.outputs[0].ncols();
    let all = DMatrix::from_fn(rows.len(), width, |i, c| {
        rows[i].1.location_scale * own.outputs[0][(rows[i].0, c)]
    });
    let p = problem.n_parameters();
    let residuals = DVector::from_iterator(rows.len(), rows.iter().map(|(_, row)| row.location));
    Run {
        own: all.columns(p, width - p).into_owned(),
        own_scales: own.scales.clone().into(),
        active: own.active.clone(),
        time: rows.iter().map(|(k, _)| problem.runs[j].time[*k]).collect(),
        ..Run::of(all.columns(0, p).into_owned(), residuals)
    }
}
