//! Violated constraints, and active stability constraints.

use crate::posed::Posed;
use crate::search::solved::Solved;
use pilotage_sqp::Problem;

/// Scaled violations above this are reported.
const VIOLATED: f64 = 1e-6;

/// A scaled stability condition is active within this distance of its limit.
const ON_LIMIT: f64 = 1e-6;

/// Maximum number of reported constraints.
const MOST: usize = 3;

/// The most violated constraints and their scaled violations: equations of states, bounds, constraints on parameters.
pub(crate) fn violated(posed: &Posed<'_>, solved: &Solved) -> Vec<(String, f64)> {
    let all = equations(posed, solved).into_iter();
    let all = all.chain(limits(posed, solved));
    let mut worst: Vec<(String, f64)> = Vec::new();
    for (name, by) in all.filter(|(_, by)| *by > VIOLATED) {
        match worst.iter_mut().find(|(own, _)| *own == name) {
            Some((_, most)) => *most = most.max(by),
            None => worst.push((name, by)),
        }
    }
    worst.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    worst.truncate(MOST);
    worst
}

/// For each run and state, the violation of its equation.
fn equations(posed: &Posed<'_>, solved: &Solved) -> Vec<(String, f64)> {
    let c = &solved.solution.iterate.c;
    let mut all = Vec::new();
    for (at, run) in solved.problem.layout.runs.iter().zip(&posed.data) {
        let defects = &c[at.equalities()][at.known..];
        for (k, state) in posed.states.iter().enumerate() {
            let own = defects.iter().skip(k).step_by(posed.states.len());
            let most = own.fold(0.0, |most: f64, defect| most.max(defect.abs()));
            all.push((
                format!("the equation of `{}` in {}", state.name, run.name()),
                most,
            ));
        }
    }
    all
}

/// The violation of each inequality.
fn limits(posed: &Posed<'_>, solved: &Solved) -> Vec<(String, f64)> {
    let (problem, g) = (&solved.problem, &solved.solution.iterate.g);
    let (lower, upper) = problem.limits();
    let by = |i: usize| (lower[i] - g[i]).max(g[i] - upper[i]);
    let mut all = Vec::new();
    for (at, run) in problem.layout.runs.iter().zip(&posed.data) {
        for (k, name) in posed.names.bounds.iter().enumerate() {
            let first = at.g + k * at.samples;
            let most = (first..first + at.samples).map(by).fold(0.0, f64::max);
            all.push((format!("{name} in {}", run.name()), most));
        }
    }
    let first = problem.layout.parameter_constraints;
    let on_parameters = posed.names.parameters.iter().enumerate();
    all.extend(
        on_parameters.map(|(k, name)| match k < posed.names.stability {
            true => (name.clone(), by(first + k)),
            false => (format!("the stability of {name}"), by(first + k)),
        }),
    );
    all
}

/// Limits of outputs that are exceeded, and the largest excess.
pub(crate) fn beyond(posed: &Posed<'_>, solved: &Solved) -> Vec<(String, f64)> {
    let all = limits(posed, solved).into_iter();
    let is_beyond = |(name, by): &(String, f64)| name.starts_with("the limit of") && *by > VIOLATED;
    all.filter(is_beyond).take(MOST).collect()
}

/// Limits of outputs that are active, and the number of samples at which they are.
pub(crate) fn held(posed: &Posed<'_>, solved: &Solved) -> Vec<(String, usize)> {
    let eta = &solved.solution.iterate.eta;
    let of_name = |(k, name): (usize, &String)| {
        let runs = solved.problem.layout.runs.iter();
        let samples = runs.flat_map(|at| at.g + k * at.samples..at.g + (k + 1) * at.samples);
        (name.clone(), samples.filter(|i| eta[*i] != 0.0).count())
    };
    let names = posed.names.bounds.iter().enumerate();
    let limits = names.filter(|(_, name)| name.starts_with("the limit of"));
    limits
        .map(of_name)
        .filter(|(_, count)| *count > 0)
        .collect()
}

/// Systems that are stable only because of a constraint: stability conditions that lie on their limits with a nonzero
/// multiplier.
pub(crate) fn on_stability_bound(posed: &Posed<'_>, solved: &Solved) -> Vec<String> {
    let iterate = &solved.solution.iterate;
    let first = solved.problem.layout.parameter_constraints;
    let lower = solved.problem.limits().0;
    let is_active = |k: &usize| {
        let i = first + k;
        iterate.eta[i] != 0.0 && iterate.g[i] <= lower[i] + ON_LIMIT
    };
    let names = &posed.names.parameters;
    let active = (posed.names.stability..names.len()).filter(is_active);
    let mut all: Vec<String> = active.map(|k| names[k].clone()).collect();
    all.dedup();
    all
}
