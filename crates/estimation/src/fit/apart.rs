//! Other optima: solutions of about the same objective with other parameters, in what the data determine.

use crate::posed::{Posed, Stands};
use crate::result::uncertainty::{linearised, method};
use crate::result::{Fit, StartEnd};
use crate::search::solved::Solved;
use nalgebra::DMatrix;
use pilotage_inference::{Data, Inference, Method};
use pilotage_sqp::Status;

/// Difference of two values, in standard deviations, from which on they are different.
const FEW: f64 = 4.0;
/// Relative difference up to which two values are the same, and up to which those of unfinished solves may be.
const SAME: f64 = 0.01;
const ROUGHLY: f64 = 0.2;
/// Difference of objectives, in variances of the noise, of parameters on the edge of a 95 % region of one parameter.
const REGION: f64 = 3.84;

/// Whether all parameters of unfinished solves are about the same.
pub(super) fn are_near(a: &[f64], b: &[f64]) -> bool {
    are_within(a, b, ROUGHLY)
}

/// Whether all parameters are the same up to this relative difference.
pub(super) fn are_within(a: &[f64], b: &[f64], relative: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| !is_other(*a, *b, relative))
}

/// Whether two converged solutions of the same objective have other parameters than a direction that the data leave open
/// leads to.
pub(super) fn are_apart(posed: &Posed<'_>, a: &Solved, b: &Solved) -> bool {
    let (here, there) = (a.theta(), b.theta());
    if are_within(&here, &there, SAME) {
        return false;
    }
    let linear = linearised(posed, &a.problem, &a.solution.iterate);
    let sd = linear.and_then(|own| deviations(posed, &own.data));
    sd.is_some_and(|sd| differ(&here, &there, &sd))
}

/// Starts at other optima.
#[derive(Default)]
pub(super) struct Others {
    /// The first at each.
    pub first: Vec<usize>,
    pub all: Vec<usize>,
}

/// The converged starts at other optima than that of start `best`, of which the data do not tell which is right. The data are
/// those of the result. `objective` is that of a simulation with other parameters, if it can be had: where it does not rise
/// between two, they lie in one valley.
pub(super) fn others(
    posed: &Posed<'_>,
    (fit, best): (&Fit, usize),
    thetas: &[Option<Vec<f64>>],
    data: &Data,
    objective: &dyn Fn(&[f64]) -> Option<f64>,
) -> Others {
    let Some(here) = &thetas[best] else {
        return Others::default();
    };
    let is_here = |own: &Vec<f64>| are_within(own, here, SAME);
    if thetas.iter().flatten().all(is_here) {
        return Others::default();
    }
    let noise = Inference::new(data).map(|own| own.noise());
    let Some((sd, noise)) = deviations(posed, data).zip(noise.ok()) else {
        return Others::default();
    };
    let least = fit.starts[best].objective;
    let near = (REGION * noise).max(fit.resolution);
    let is_as_good =
        |own: &StartEnd| own.status == Status::Converged && (own.objective - least).abs() <= near;
    let rises = |own: &[f64]| {
        let middle: Vec<f64> = own
            .iter()
            .zip(here)
            .map(|(a, b)| f64::midpoint(*a, *b))
            .collect();
        let pair = objective(&middle).zip(fit.simulated_objective);
        pair.is_none_or(|(between, here)| between - here > near)
    };
    let mut found = Others::default();
    for (k, own) in thetas.iter().enumerate() {
        let Some(own) = own.as_ref().filter(|_| is_as_good(&fit.starts[k])) else {
            continue;
        };
        let mut known = found.first.iter().filter_map(|k| thetas[*k].as_ref());
        if differ(here, own, &sd) && rises(own) {
            let is_new = known.all(|other| differ(other, own, &sd));
            found.all.push(k);
            found.first.extend(is_new.then_some(k));
        }
    }
    found
}

impl Fit {
    /// Notes which starts ended at other optima.
    pub(super) fn take_others(&mut self, others: Others) {
        (others.all.iter()).for_each(|k| self.starts[*k].is_elsewhere = true);
        self.others = others.first;
    }
}

/// Values of the shared parameters with their names, in their units.
pub(super) fn named(posed: &Posed<'_>, theta: &[f64]) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (unknown, stands) in &posed.unknowns {
        let found = |k: usize| unknown.kept(unknown.found(theta[k]));
        match stands {
            Stands::Shared(k) => all.push((unknown.name.clone(), found(*k))),
            Stands::Subjects(subjects) => all.extend(
                (subjects.iter()).map(|(who, k)| (format!("{} ({who})", unknown.name), found(*k))),
            ),
            Stands::State(_) => {}
        }
    }
    all
}

fn is_other(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() > relative * a.abs().max(b.abs())
}

/// Whether a parameter differs by a few of these standard deviations, and by more than solves of one optimum do.
fn differ(a: &[f64], b: &[f64], sd: &[f64]) -> bool {
    let mut all = a.iter().zip(b).zip(sd);
    all.any(|((a, b), sd)| is_other(*a, *b, SAME) && (a - b).abs() > FEW * sd)
}

/// Standard deviations of the shared parameters, infinite where the data leave them open. Bounds are released: a parameter may
/// lie on one at one optimum and beside it at the next, which is no other as long as the data do not tell.
fn deviations(posed: &Posed<'_>, data: &Data) -> Option<Vec<f64>> {
    let released = Data {
        active: DMatrix::zeros(0, data.parameters()),
        ..data.clone()
    };
    let inference = Inference::new(&released).ok()?;
    let known = inference.covariance(method(posed));
    let known = known
        .or_else(|_| inference.covariance(Some(Method::Plain)))
        .ok()?;
    let pairs = known.deviations().into_iter().zip(&inference.flat);
    let sd = pairs.map(|(sd, flat)| if *flat { f64::INFINITY } else { sd });
    Some(sd.collect())
}
