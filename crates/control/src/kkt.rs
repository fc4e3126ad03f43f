//! The linear systems of the interior-point method, whose cost is linear in the number of intervals.
//!
//! In each interval its midpoint and the states at its end are eliminated by the linearised defects; what remains is a
//! linear-quadratic control problem in `[x u θ]` at the nodes, with the controls at the next node as decisions, solved by a
//! Riccati recursion (Rao, Wright & Rawlings, *Application of Interior-Point Methods to Model Predictive Control*, JOTA 99,
//! 1998; Vanroye et al., *FATROP*, IROS 2023). Its Cholesky factors exist exactly where the reduced Hessian is positive
//! definite. Equations at the ends are few: they are penalised, which changes neither solution nor multipliers, and met by
//! their Schur complement.

use crate::dense::{Cholesky, Lu, Matrix, add, dot};
use crate::evaluation::{Derivatives, derivatives_at};
use crate::program::{Duration, Place, Program, Row};
use pilotage_collocation::node::NodeModel;

/// Weight of the penalty on the equations at the ends.
const PENALTY: f64 = 1e4;
/// Pivot of their Schur complement, relative to the largest, below which one depends on the others.
const DEPENDENT: f64 = 1e-8;

/// A linearised program.
pub(crate) struct Linearised<'p> {
    program: &'p Program,
    rows: &'p (Vec<Row>, Vec<Row>),
    z: Vec<f64>,
    path: Derivatives,
    start: Derivatives,
    end: Derivatives,
    /// Limited outputs of each point: row and output.
    limited: Vec<Vec<(usize, usize)>>,
}

/// Multipliers: of the defects, of the equations at the ends, and of the limited quantities.
#[derive(Debug, Clone, Default)]
pub(crate) struct Multipliers {
    pub c: Vec<f64>,
    pub e: Vec<f64>,
    pub g: Vec<f64>,
}

/// A step in all variables, with new multipliers of the equations.
#[derive(Debug, Clone, Default)]
pub(crate) struct Step {
    pub z: Vec<f64>,
    pub c: Vec<f64>,
    pub e: Vec<f64>,
}

/// What the objective is.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Aim<'a> {
    /// That of the program, times a factor.
    Objective(f64),
    /// Half the squared distance from a point, times a factor.
    Near(&'a [f64], f64),
}

/// Gradient of an output over `[x u θ]`: columns and values.
fn gradient<'d>(
    model: &'d NodeModel,
    values: &'d [f64],
    point: usize,
    output: usize,
) -> impl Iterator<Item = (usize, f64)> + Clone + 'd {
    let width = |k: usize| model.columns(k).len();
    let before: usize = (0..output).map(width).sum();
    let all: usize = before + (output..model.n_outputs()).map(width).sum::<usize>();
    let own = &values[point * all + before..];
    model
        .columns(output)
        .iter()
        .copied()
        .zip(own.iter().copied())
}

impl<'p> Linearised<'p> {
    /// At these variables and multipliers; the objective is multiplied by a factor.
    pub fn new(
        program: &'p Program,
        rows: &'p (Vec<Row>, Vec<Row>),
        z: &[f64],
        multipliers: &Multipliers,
        factor: f64,
    ) -> Self {
        let (n, m) = (program.n(), program.m());
        let intervals = program.intervals();
        let outputs = program.limits[0].len();
        let mut rates = vec![0.0; 3 * intervals * (n + m)];
        for k in 0..intervals {
            let h = program.h(k);
            let own = &multipliers.c[2 * n * k..2 * n * (k + 1)];
            for i in 0..n {
                let (first, second) = (h / 8.0 * own[i], h / 6.0 * own[n + i]);
                let weights = [-first - second, -4.0 * second, first - second];
                for (at, weight) in weights.into_iter().enumerate() {
                    rates[(3 * k + at) * (n + m) + i] = weight;
                }
            }
        }
        let mut of_path = vec![0.0; 3 * intervals * outputs];
        let mut of_start = vec![0.0; program.start.n_outputs()];
        let mut of_end = vec![0.0; program.end.n_outputs()];
        of_end[0] = factor;
        let mut limited = vec![Vec::new(); 3 * intervals];
        let weights = multipliers.g.iter().chain(&multipliers.e);
        for (r, (row, weight)) in rows.0.iter().chain(&rows.1).zip(weights).enumerate() {
            match row.place {
                Place::Path { point, output } => {
                    of_path[point * outputs + output] = *weight;
                    limited[point].push((r, output));
                }
                Place::Start(k) => of_start[k] += weight,
                Place::End(k) => of_end[k] += weight,
                Place::Control { .. } | Place::Rate { .. } | Place::Parameter(_) => {}
            }
        }
        let theta = &z[program.theta()..];
        let zero = vec![0.0; n + m];
        let at = |is_end: bool| program.end_point(z, is_end);
        Self {
            path: derivatives_at(
                &program.model,
                theta,
                &program.points(z),
                [&rates, &of_path],
            ),
            start: derivatives_at(&program.start, theta, &at(false), [&zero, &of_start]),
            end: derivatives_at(&program.end, theta, &at(true), [&zero, &of_end]),
            z: z.to_vec(),
            limited,
            program,
            rows,
        }
    }

    /// Variables of the node `[x u]`, then θ.
    fn at_node(&self, k: usize, q: usize) -> usize {
        let own = self.program.n() + self.program.m();
        match q.checked_sub(own) {
            None => self.program.node(k) + q,
            Some(parameter) => self.program.theta() + parameter,
        }
    }

    /// The gradient of a quantity at the start or the end, with its node.
    fn of_end(&self, place: Place) -> (usize, Vec<(usize, f64)>) {
        let program = self.program;
        match place {
            Place::Start(k) => (
                0,
                gradient(&program.start, &self.start.gradients, 0, k).collect(),
            ),
            Place::End(k) => {
                let own = gradient(&program.end, &self.end.gradients, 0, k);
                (program.intervals(), own.collect())
            }
            _ => unreachable!("quantities at the ends alone"),
        }
    }

    /// Adds `Gᵀ weights` of the limited quantities (then of the equations at the ends) to `out`.
    fn add_rows(&self, weights: impl Iterator<Item = f64>, out: &mut [f64]) {
        let program = self.program;
        let n = program.n();
        for (row, weight) in self.rows.0.iter().chain(&self.rows.1).zip(weights) {
            match row.place {
                Place::Path { point, output } => {
                    for (q, value) in gradient(&program.model, &self.path.gradients, point, output)
                    {
                        self.add_at_point(point, q, weight * value, out);
                    }
                }
                Place::Control { node, control } => out[program.node(node) + n + control] += weight,
                Place::Rate {
                    interval,
                    control,
                    falls,
                } => {
                    out[program.node(interval + 1) + n + control] += weight;
                    out[program.node(interval) + n + control] -= weight;
                    if let Duration::Sought(k) = program.duration {
                        let scale = program.model.scales.parameters[k];
                        let size = program.allowance(interval, control, falls) * scale;
                        out[program.theta() + k] -= weight * size;
                    }
                }
                Place::Parameter(k) => out[program.theta() + k] += weight,
                Place::Start(_) | Place::End(_) => {
                    let (node, own) = self.of_end(row.place);
                    for (q, value) in own {
                        out[self.at_node(node, q)] += weight * value;
                    }
                }
            }
        }
    }

    /// Adds to the variable on which entry `q` of `[x u θ]` at a point depends.
    fn add_at_point(&self, point: usize, q: usize, value: f64, out: &mut [f64]) {
        let program = self.program;
        let (n, m) = (program.n(), program.m());
        let (k, at) = (point / 3, point % 3);
        if q >= n + m {
            out[program.theta() + q - n - m] += value;
        } else if q >= n {
            let (first, second) = program.weights(q - n, at);
            out[program.node(k) + q] += first * value;
            out[program.node(k + 1) + q] += second * value;
        } else {
            let x = [program.node(k), program.middle(k), program.node(k + 1)][at];
            out[x + q] += value;
        }
    }

    /// The gradient of the objective.
    pub fn aim_gradient(&self, aim: Aim<'_>) -> Vec<f64> {
        let program = self.program;
        let mut out = vec![0.0; self.z.len()];
        match aim {
            Aim::Near(from, weight) => {
                let pairs = self.z.iter().zip(from);
                let own = out.iter_mut().zip(pairs);
                own.for_each(|(out, (z, from))| *out = weight * (z - from));
            }
            Aim::Objective(factor) => {
                let (node, own) = self.of_end(Place::End(0));
                for (q, value) in own {
                    out[self.at_node(node, q)] += factor * value;
                }
                let (n, m) = (program.n(), program.m());
                for k in (0..program.intervals()).filter(|_| program.regularise > 0.0) {
                    for c in n..n + m {
                        let [a, b] = [k, k + 1].map(|k| program.node(k) + c);
                        let slope = 2.0 * factor * program.regularise * (self.z[b] - self.z[a]);
                        out[b] += slope;
                        out[a] -= slope;
                    }
                }
            }
        }
        out
    }

    /// The gradient of the Lagrangian over the variables that are not known.
    pub fn lagrangian_gradient(&self, multipliers: &Multipliers, aim: Aim<'_>) -> Vec<f64> {
        let program = self.program;
        let (n, m) = (program.n(), program.m());
        let mut out = self.aim_gradient(aim);
        let weights = multipliers.g.iter().chain(&multipliers.e).copied();
        self.add_rows(weights, &mut out);
        let entries = &program.model.entries;
        for k in 0..program.intervals() {
            let h = program.h(k);
            let (first, second) = multipliers.c[2 * n * k..2 * n * (k + 1)].split_at(n);
            let (a, b, middle) = (program.node(k), program.node(k + 1), program.middle(k));
            for i in 0..n {
                out[middle + i] += first[i];
                out[a + i] -= 0.5 * first[i] + second[i];
                out[b + i] += second[i] - 0.5 * first[i];
            }
            for at in 0..3 {
                let point = 3 * k + at;
                let own = &self.path.entries[point * entries.len()..];
                for (&(row, q), value) in entries.iter().zip(own).filter(|(e, _)| e.0 < n) {
                    let weight = match at {
                        0 => -h / 8.0 * first[row] - h / 6.0 * second[row],
                        1 => -4.0 * h / 6.0 * second[row],
                        _ => h / 8.0 * first[row] - h / 6.0 * second[row],
                    };
                    self.add_at_point(point, q, weight * value, &mut out);
                }
            }
        }
        for i in (0..n + m).filter(|i| is_known(program, *i)) {
            out[i] = 0.0;
        }
        out
    }

    /// The Jacobian's product `G d` of the limited quantities.
    pub fn times(&self, d: &[f64]) -> Vec<f64> {
        let product = |row: &Row| self.row_times(row, d);
        self.rows.0.iter().map(product).collect()
    }

    fn row_times(&self, row: &Row, d: &[f64]) -> f64 {
        let program = self.program;
        let n = program.n();
        match row.place {
            Place::Path { point, output } => {
                let own = gradient(&program.model, &self.path.gradients, point, output);
                own.map(|(q, value)| value * self.at_point(point, q, d))
                    .sum()
            }
            Place::Control { node, control } => d[program.node(node) + n + control],
            Place::Rate {
                interval,
                control,
                falls,
            } => {
                let [a, b] = [interval, interval + 1].map(|k| d[program.node(k) + n + control]);
                let more = match program.duration {
                    Duration::Sought(k) => {
                        d[program.theta() + k] * program.model.scales.parameters[k]
                    }
                    Duration::Number(_) => 0.0,
                };
                b - a - program.allowance(interval, control, falls) * more
            }
            Place::Parameter(k) => d[program.theta() + k],
            Place::Start(_) | Place::End(_) => {
                let (node, own) = self.of_end(row.place);
                let terms = own
                    .iter()
                    .map(|(q, value)| value * d[self.at_node(node, *q)]);
                terms.sum()
            }
        }
    }

    fn at_point(&self, point: usize, q: usize, d: &[f64]) -> f64 {
        let program = self.program;
        let (n, m) = (program.n(), program.m());
        let (k, at) = (point / 3, point % 3);
        if q >= n + m {
            d[program.theta() + q - n - m]
        } else if q >= n {
            let (first, second) = program.weights(q - n, at);
            first * d[program.node(k) + q] + second * d[program.node(k + 1) + q]
        } else {
            d[[program.node(k), program.middle(k), program.node(k + 1)][at] + q]
        }
    }

    /// Second derivatives at a point over `[x u θ]`, with those of the limited outputs' barriers; `exact` says whether the
    /// curvature of the Lagrangian is taken.
    fn hessian(&self, point: usize, sigma: &[f64], exact: bool, out: &mut Matrix) {
        out.clear();
        let model = &self.program.model;
        if exact {
            let own = &self.path.pairs[point * model.pairs.len()..];
            add_pairs(&model.pairs, own, out);
        }
        for &(row, output) in &self.limited[point] {
            let own = gradient(model, &self.path.gradients, point, output);
            add_square(sigma[row], own, out);
        }
    }

    /// The entries of the rates' Jacobian over `[x u θ]` at a point, dense.
    fn jacobian(&self, point: usize, out: &mut Matrix) {
        out.clear();
        let entries = &self.program.model.entries;
        let own = &self.path.entries[point * entries.len()..];
        let n = self.program.n();
        for (at, value) in entries.iter().zip(own).filter(|(at, _)| at.0 < n) {
            out[*at] = *value;
        }
    }
}

/// Whether a variable of the first node is known.
fn is_known(program: &Program, i: usize) -> bool {
    let n = program.n();
    match i.checked_sub(n) {
        None => program.initial[i].is_some(),
        Some(c) => {
            let own = &program.controls[c];
            own.first.is_some() || own.shape == crate::program::Shape::Constant
        }
    }
}

fn add_pairs(pairs: &[(usize, usize)], values: &[f64], out: &mut Matrix) {
    for (&(i, j), value) in pairs.iter().zip(values) {
        out[(i, j)] += value;
        if i != j {
            out[(j, i)] += value;
        }
    }
}

fn add_square(weight: f64, g: impl Iterator<Item = (usize, f64)> + Clone, out: &mut Matrix) {
    for (i, a) in g.clone() {
        for (j, b) in g.clone() {
            out[(i, j)] += weight * a * b;
        }
    }
}

/// An eliminated interval.
struct Stage {
    /// Hessian at the midpoint, and of all that follows the interval over the end's `[x u θ]`.
    of_middle: Matrix,
    following: Matrix,
    /// Maps from `[x u θ | w]` to the midpoint's and the end's states.
    to_middle: Matrix,
    to_end: Matrix,
    /// `∂f̄/∂x̄`, `∂x̄/∂x₁` and the factors of the end's equation.
    rate: Matrix,
    half: Matrix,
    factors: Lu,
    /// The decisions: `w = gain s + ...`, the factors of their Hessian, and their second derivatives with `s`.
    gain: Matrix,
    decisions: Cholesky,
    cross: Matrix,
}

/// What is known of an interval after the way back: offsets of midpoint, end and decisions, and the gradient of all that
/// follows over the states at its end.
#[derive(Default)]
struct Offsets {
    middle: Vec<f64>,
    end: Vec<f64>,
    decisions: Vec<f64>,
    following: Vec<f64>,
}

/// The factored system.
pub(crate) struct Factored<'l, 'p> {
    of: &'l Linearised<'p>,
    stages: Vec<Stage>,
    /// Free entries of the first node's `[x u θ]`, and the factors of their Hessian.
    free: Vec<usize>,
    first: Cholesky,
    /// Responses to the equations at the ends, and their Schur complement.
    responses: Vec<Step>,
    schur: Option<Lu>,
    /// Those of the equations that do not depend on others.
    independent: Vec<usize>,
}

impl<'l, 'p> Factored<'l, 'p> {
    /// Factors the system with barrier weights `sigma` of the limited quantities and a damping of all variables. `None` if
    /// the reduced Hessian is not positive definite.
    pub fn new(of: &'l Linearised<'p>, sigma: &[f64], damping: f64, aim: Aim<'_>) -> Option<Self> {
        let program = of.program;
        let (n, m, p) = (program.n(), program.m(), program.p());
        let (size, all) = (n + m + p, n + 2 * m + p);
        let (exact, near, smooth) = match aim {
            Aim::Objective(factor) => (true, 0.0, factor * program.regularise),
            Aim::Near(_, weight) => (false, weight, 0.0),
        };
        let damping = damping + near;
        // Second derivatives that belong to nodes alone: first and last, and the limits of controls.
        let mut last = Matrix::zeros(size, size);
        let mut first = Matrix::zeros(size, size);
        if exact {
            add_pairs(&program.start.pairs, &of.start.pairs, &mut first);
            add_pairs(&program.end.pairs, &of.end.pairs, &mut last);
        }
        let mut bounds = vec![0.0; (program.intervals() + 1) * m];
        let mut rates: Vec<Vec<(usize, bool, f64)>> = vec![Vec::new(); program.intervals()];
        for (row, sigma) in of.rows.0.iter().zip(sigma) {
            match row.place {
                Place::Control { node, control } => bounds[node * m + control] += sigma,
                Place::Rate {
                    interval,
                    control,
                    falls,
                } => rates[interval].push((control, falls, *sigma)),
                Place::Parameter(k) => first[(n + m + k, n + m + k)] += sigma,
                Place::Start(_) => {
                    add_square(*sigma, of.of_end(row.place).1.into_iter(), &mut first)
                }
                Place::End(_) => add_square(*sigma, of.of_end(row.place).1.into_iter(), &mut last),
                Place::Path { .. } => {}
            }
        }
        for row in &of.rows.1 {
            let own = of.of_end(row.place).1.into_iter();
            let to = match row.place {
                Place::Start(_) => &mut first,
                _ => &mut last,
            };
            add_square(PENALTY, own, to);
        }
        let node = |k: usize, matrix: &mut Matrix| {
            for i in 0..n + m {
                matrix[(i, i)] += damping;
            }
            for c in 0..m {
                matrix[(n + c, n + c)] += bounds[k * m + c];
            }
        };
        let mut following = last;
        let mut stages = Vec::with_capacity(program.intervals());
        let mut parts = Parts::new(size, all, n);
        for k in (0..program.intervals()).rev() {
            node(k + 1, &mut following);
            let weights = Weights {
                sigma,
                exact,
                damping,
                smooth,
                rates: &rates[k],
            };
            let stage = parts.eliminate((of, k), &weights, following)?;
            following = parts.reduced(&stage);
            stages.push(stage);
        }
        stages.reverse();
        node(0, &mut following);
        for (own, more) in following.values.iter_mut().zip(&first.values) {
            *own += more;
        }
        for i in n + m..size {
            following[(i, i)] += damping;
        }
        let free: Vec<usize> = (0..size)
            .filter(|i| *i >= n + m || !is_known(program, *i))
            .collect();
        let mut reduced = Matrix::zeros(free.len(), free.len());
        for (a, i) in free.iter().enumerate() {
            for (b, j) in free.iter().enumerate() {
                reduced[(a, b)] = following[(*i, *j)];
            }
        }
        let mut own = Self {
            of,
            stages,
            first: { Cholesky::of(reduced)? },
            free,
            responses: Vec::new(),
            schur: None,
            independent: Vec::new(),
        };
        own.add_equations();
        Some(own)
    }

    fn add_equations(&mut self) {
        let count = self.of.rows.1.len();
        if count == 0 {
            return;
        }
        let zero = vec![0.0; 2 * self.of.program.n() * self.stages.len()];
        let mut schur = Matrix::zeros(count, count);
        for r in 0..count {
            let mut gradient = vec![0.0; self.of.z.len()];
            let weights =
                (0..self.of.rows.0.len() + count).map(|k| f64::from(k == self.of.rows.0.len() + r));
            self.of.add_rows(weights, &mut gradient);
            let response = self.solve_free(&zero, &gradient);
            for (i, row) in self.of.rows.1.iter().enumerate() {
                schur[(i, r)] = self.of.row_times(row, &response.z);
            }
            self.responses.push(response);
        }
        self.independent = independent(&schur);
        let count = self.independent.len();
        let mut reduced = Matrix::zeros(count, count);
        for (a, i) in self.independent.iter().enumerate() {
            for (b, j) in self.independent.iter().enumerate() {
                reduced[(a, b)] = schur[(*i, *j)];
            }
        }
        self.schur = Lu::of(reduced);
    }

    /// The step for the residuals of the defects `c` and of the equations at the ends `e`, with weights of the limited
    /// quantities' gradients and the gradient of the objective. `None` if the equations contradict each other.
    pub fn solve(&self, c: &[f64], e: &[f64], weights: &[f64], aim: &[f64]) -> Option<Step> {
        let mut gradient = aim.to_vec();
        let penalties = e.iter().map(|e| PENALTY * e);
        let all = weights.iter().copied().chain(penalties);
        self.of.add_rows(all, &mut gradient);
        let mut step = self.solve_free(c, &gradient);
        if !e.is_empty() {
            let left = |k: &usize| -(e[*k] + self.of.row_times(&self.of.rows.1[*k], &step.z));
            let mut right = Matrix::zeros(self.independent.len(), 1);
            right.values = self.independent.iter().map(left).collect();
            self.schur.as_ref()?.solve(&mut right);
            step.e = vec![0.0; e.len()];
            for (nu, k) in right.values.iter().zip(&self.independent) {
                add(*nu, &self.responses[*k].z, &mut step.z);
                add(*nu, &self.responses[*k].c, &mut step.c);
                step.e[*k] = *nu;
            }
        }
        step.z.iter().all(|d| d.is_finite()).then_some(step)
    }

    /// The same without the equations at the ends, for a gradient over all variables.
    fn solve_free(&self, c: &[f64], gradient: &[f64]) -> Step {
        let program = self.of.program;
        let (n, m, p) = (program.n(), program.m(), program.p());
        let size = n + m + p;
        let count = self.stages.len();
        // Gradients of nodes; that of θ is taken at the first.
        let node = |k: usize| &gradient[program.node(k)..][..n + m];
        let mut following = vec![0.0; size];
        let mut offsets: Vec<Offsets> = Vec::new();
        offsets.resize_with(count, Offsets::default);
        for k in (0..count).rev() {
            add(1.0, node(k + 1), &mut following);
            let stage = &self.stages[k];
            let h = program.h(k);
            let (first, second) = c[2 * n * k..2 * n * (k + 1)].split_at(n);
            let mut right = Matrix::zeros(n, 1);
            right.values.fill(0.0);
            stage.rate.add_times(first, &mut right.values);
            for (own, second) in right.values.iter_mut().zip(second) {
                *own = -4.0 * h / 6.0 * *own - second;
            }
            stage.factors.solve(&mut right);
            let end = right.values;
            let mut middle: Vec<f64> = first.iter().map(|c| -c).collect();
            stage.half.add_times(&end, &mut middle);
            let plain = following[..n].to_vec();
            // Gradients at midpoint and end, with the offsets.
            let mut of_middle = vec![0.0; size];
            of_middle[..n].copy_from_slice(&gradient[program.middle(k)..][..n]);
            for (i, own) in of_middle.iter_mut().enumerate() {
                *own += dot(&stage.of_middle.row(i)[..n], &middle);
            }
            for (i, own) in following.iter_mut().enumerate() {
                *own += dot(&stage.following.row(i)[..n], &end);
            }
            let mut own = vec![0.0; size + m];
            stage
                .to_middle
                .add_transposed_times(&of_middle[..n], &mut own);
            stage.to_end.add_transposed_times(&following[..n], &mut own);
            for c in 0..m {
                let (first, second) = program.weights(c, 1);
                own[n + c] += first * of_middle[n + c];
                own[size + c] += second * of_middle[n + c] + following[n + c];
            }
            for i in n + m..size {
                own[i] += of_middle[i] + following[i];
            }
            let mut decision: Vec<f64> = own[size..].iter().map(|g| -g).collect();
            let state = &mut own[..size];
            // Gradient of the rest: that of the states, with the decisions' feedback.
            stage.decisions.solve(&mut decision);
            stage.cross.add_transposed_times(&decision, state);
            following = state.to_vec();
            offsets[k] = Offsets {
                middle,
                end,
                decisions: decision,
                following: plain,
            };
        }
        add(1.0, node(0), &mut following);
        add(1.0, &gradient[program.theta()..], &mut following[n + m..]);
        let mut begin: Vec<f64> = self.free.iter().map(|i| -following[*i]).collect();
        self.first.solve(&mut begin);
        let mut s = vec![0.0; size];
        for (i, value) in self.free.iter().zip(&begin) {
            s[*i] = *value;
        }
        let mut step = Step {
            z: vec![0.0; gradient.len()],
            c: vec![0.0; c.len()],
            e: Vec::new(),
        };
        step.z[program.theta()..].copy_from_slice(&s[n + m..]);
        step.z[..n + m].copy_from_slice(&s[..n + m]);
        for (k, (stage, own)) in self.stages.iter().zip(offsets).enumerate() {
            let Offsets {
                mut middle,
                mut end,
                decisions: mut decision,
                following,
            } = own;
            stage.gain.add_times(&s, &mut decision);
            let all = [s.as_slice(), &decision].concat();
            stage.to_middle.add_times(&all, &mut middle);
            stage.to_end.add_times(&all, &mut end);
            step.z[program.middle(k)..][..n].copy_from_slice(&middle);
            step.z[program.node(k + 1)..][..n].copy_from_slice(&end);
            step.z[program.node(k + 1) + n..][..m].copy_from_slice(&decision);
            s[..n].copy_from_slice(&end);
            s[n..n + m].copy_from_slice(&decision);
            self.costates(k, gradient, (following, &s), &mut step);
        }
        step
    }

    /// Multipliers of the defects of an interval, from the stationarity of its midpoint and its end `s`.
    fn costates(
        &self,
        k: usize,
        gradient: &[f64],
        (mut following, s): (Vec<f64>, &[f64]),
        step: &mut Step,
    ) {
        let program = self.of.program;
        let (n, m) = (program.n(), program.m());
        let (stage, h) = (&self.stages[k], program.h(k));
        stage.following.add_times(s, &mut following);
        let [a, b] = [k, k + 1].map(|k| program.node(k));
        let mut point = step.z[program.middle(k)..][..n].to_vec();
        point.extend((0..m).map(|c| {
            let (first, second) = program.weights(c, 1);
            first * step.z[a + n + c] + second * step.z[b + n + c]
        }));
        point.extend_from_slice(&step.z[program.theta()..]);
        let mut middle = gradient[program.middle(k)..][..n].to_vec();
        stage.of_middle.add_times(&point, &mut middle);
        let mut right = vec![0.0; n];
        add(-1.0, &following, &mut right);
        let mut halved = vec![0.0; n];
        stage.half.add_transposed_times(&middle, &mut halved);
        add(-1.0, &halved, &mut right);
        let second = stage.factors.solve_transposed(&right);
        let mut pulled = vec![0.0; n];
        stage.rate.add_transposed_times(&second, &mut pulled);
        let own = &mut step.c[2 * n * k..2 * n * (k + 1)];
        for i in 0..n {
            own[i] = 4.0 * h / 6.0 * pulled[i] - middle[i];
            own[n + i] = second[i];
        }
    }
}

/// Rows of a negative semidefinite matrix that are independent, by a Cholesky factorisation with pivots.
fn independent(matrix: &Matrix) -> Vec<usize> {
    let n = matrix.columns;
    let mut rest = matrix.clone();
    let mut left: Vec<usize> = (0..n).collect();
    let mut chosen = Vec::new();
    let mut largest = 0.0;
    while let Some(at) = (0..left.len()).min_by(|a, b| {
        let pivot = |k: usize| rest[(left[k], left[k])];
        pivot(*a).total_cmp(&pivot(*b))
    }) {
        let k = left.swap_remove(at);
        let pivot = rest[(k, k)];
        largest = f64::max(largest, -pivot);
        if -pivot <= DEPENDENT * largest || pivot.is_nan() {
            break;
        }
        chosen.push(k);
        for i in &left {
            let factor = rest[(*i, k)] / pivot;
            for j in &left {
                let value = factor * rest[(k, *j)];
                rest[(*i, *j)] -= value;
            }
        }
    }
    chosen.sort_unstable();
    chosen
}

/// What weighs in an interval's Hessian.
struct Weights<'a> {
    sigma: &'a [f64],
    exact: bool,
    damping: f64,
    smooth: f64,
    /// Limits of rates: control, whether it falls, and the barrier's weight.
    rates: &'a [(usize, bool, f64)],
}

/// Workspace of the elimination.
struct Parts {
    jacobians: [Matrix; 3],
    hessian: Matrix,
    /// The interval's quadratic model over `[x u θ | w]`.
    all: Matrix,
    product: Matrix,
}

impl Parts {
    fn new(size: usize, all: usize, n: usize) -> Self {
        let jacobian = || Matrix::zeros(n, size);
        Self {
            jacobians: [jacobian(), jacobian(), jacobian()],
            hessian: Matrix::zeros(size, size),
            all: Matrix::zeros(all, all),
            product: Matrix::zeros(size, all),
        }
    }

    fn eliminate(
        &mut self,
        (of, k): (&Linearised<'_>, usize),
        weights: &Weights<'_>,
        mut following: Matrix,
    ) -> Option<Stage> {
        let program = of.program;
        let (n, m, p) = (program.n(), program.m(), program.p());
        let (size, h) = (n + m + p, program.h(k));
        let Weights { sigma, exact, .. } = *weights;
        for (at, jacobian) in self.jacobians.iter_mut().enumerate() {
            of.jacobian(3 * k + at, jacobian);
        }
        let [start, middle, end] = &self.jacobians;
        // A row over `[x u θ]` at a point as one over `[x u θ | w]`, without the states unless they are those of the start.
        let spread = |row: &[f64], at: usize, factor: f64, out: &mut [f64]| {
            if at == 0 {
                add(factor, &row[..n], &mut out[..n]);
            }
            for c in 0..m {
                let (first, second) = program.weights(c, at);
                out[n + c] += factor * first * row[n + c];
                out[size + c] += factor * second * row[n + c];
            }
            add(factor, &row[n + m..size], &mut out[n + m..size]);
        };
        let mut to_middle = Matrix::zeros(n, size + m);
        let mut to_end = Matrix::zeros(n, size + m);
        let mut half = Matrix::zeros(n, n);
        let mut rate = Matrix::zeros(n, n);
        let mut own = Matrix::zeros(n, n);
        for i in 0..n {
            to_middle[(i, i)] = 0.5;
            spread(start.row(i), 0, h / 8.0, to_middle.row_mut(i));
            spread(end.row(i), 2, -h / 8.0, to_middle.row_mut(i));
            to_end[(i, i)] = 1.0;
            spread(start.row(i), 0, h / 6.0, to_end.row_mut(i));
            spread(end.row(i), 2, h / 6.0, to_end.row_mut(i));
            spread(middle.row(i), 1, 4.0 * h / 6.0, to_end.row_mut(i));
            half[(i, i)] = 0.5;
            add(-h / 8.0, &end.row(i)[..n], half.row_mut(i));
            rate.row_mut(i).copy_from_slice(&middle.row(i)[..n]);
            own[(i, i)] = 1.0;
            add(-h / 6.0, &end.row(i)[..n], own.row_mut(i));
        }
        for i in 0..n {
            for j in 0..n {
                let factor = 4.0 * h / 6.0 * rate[(i, j)];
                add(factor, to_middle.row(j), to_end.row_mut(i));
                add(-factor, half.row(j), own.row_mut(i));
            }
        }
        let factors = Lu::of(own)?;
        factors.solve(&mut to_end);
        for i in 0..n {
            for j in 0..n {
                add(half[(i, j)], to_end.row(j), to_middle.row_mut(i));
            }
        }
        self.all.clear();
        of.hessian(3 * k, sigma, exact, &mut self.hessian);
        self.add_at_start(program);
        of.hessian(3 * k + 1, sigma, exact, &mut self.hessian);
        for i in 0..n {
            self.hessian[(i, i)] += weights.damping;
        }
        let of_middle = self.hessian.clone();
        self.add_mapped(program, &of_middle, &to_middle, 1);
        of.hessian(3 * k + 2, sigma, exact, &mut self.hessian);
        add(1.0, &self.hessian.values, &mut following.values);
        self.add_mapped(program, &following, &to_end, 2);
        self.add_steps(program, k, weights);
        let mut decisions = Matrix::zeros(m, m);
        let mut cross = Matrix::zeros(m, size);
        for c in 0..m {
            decisions
                .row_mut(c)
                .copy_from_slice(&self.all.row(size + c)[size..]);
            cross
                .row_mut(c)
                .copy_from_slice(&self.all.row(size + c)[..size]);
        }
        let decisions = Cholesky::of(decisions)?;
        let mut gain = Matrix::zeros(m, size);
        for j in 0..size {
            let mut column: Vec<f64> = (0..m).map(|c| -cross[(c, j)]).collect();
            decisions.solve(&mut column);
            (0..m).for_each(|c| gain[(c, j)] = column[c]);
        }
        Some(Stage {
            of_middle,
            following,
            to_middle,
            to_end,
            rate,
            half,
            factors,
            gain,
            decisions,
            cross,
        })
    }

    /// Adds the Hessian at the start of the interval.
    fn add_at_start(&mut self, program: &Program) {
        let (n, m) = (program.n(), program.m());
        let size = n + m + program.p();
        // Each entry of a point's variables is one of the interval's, or shared by the controls of both nodes.
        let place = |q: usize| match q {
            q if q >= n && q < n + m && program.weights(q - n, 0).0 == 0.0 => size + q - n,
            q => q,
        };
        for i in 0..size {
            for j in 0..size {
                self.all[(place(i), place(j))] += self.hessian[(i, j)];
            }
        }
    }

    /// Adds a Hessian at the midpoint or the end, whose states depend on the interval's variables by `map`.
    fn add_mapped(&mut self, program: &Program, hessian: &Matrix, map: &Matrix, at: usize) {
        let (n, m) = (program.n(), program.m());
        let size = n + m + program.p();
        self.product.clear();
        for i in 0..size {
            let (from, to) = (hessian.row(i), self.product.row_mut(i));
            for (j, value) in from[..n].iter().enumerate() {
                add(*value, map.row(j), to);
            }
            for c in 0..m {
                let (first, second) = program.weights(c, at);
                to[n + c] += first * from[n + c];
                to[size + c] += second * from[n + c];
            }
            add(1.0, &from[n + m..], &mut to[n + m..size]);
        }
        for i in 0..n {
            let own = self.product.row(i);
            for (j, value) in map.row(i).iter().enumerate() {
                add(*value, own, self.all.row_mut(j));
            }
        }
        for c in 0..m {
            let (first, second) = program.weights(c, at);
            add(first, self.product.row(n + c), self.all.row_mut(n + c));
            add(second, self.product.row(n + c), self.all.row_mut(size + c));
        }
        for i in n + m..size {
            add(1.0, self.product.row(i), self.all.row_mut(i));
        }
    }

    /// Adds what depends on the change of the controls in the interval.
    fn add_steps(&mut self, program: &Program, k: usize, weights: &Weights<'_>) {
        let (n, m) = (program.n(), program.m());
        let size = n + m + program.p();
        for c in (0..m).filter(|_| weights.smooth > 0.0) {
            let own = [(size + c, 1.0), (n + c, -1.0)];
            add_square(2.0 * weights.smooth, own.into_iter(), &mut self.all);
        }
        for &(c, falls, sigma) in weights.rates {
            let mut own = vec![(size + c, 1.0), (n + c, -1.0)];
            if let Duration::Sought(t) = program.duration {
                let scale = program.model.scales.parameters[t];
                own.push((n + m + t, -program.allowance(k, c, falls) * scale));
            }
            add_square(sigma, own.into_iter(), &mut self.all);
        }
    }

    /// The Hessian over the start's `[x u θ]`, with the decisions eliminated.
    fn reduced(&self, stage: &Stage) -> Matrix {
        let size = self.hessian.columns;
        let mut out = Matrix::zeros(size, size);
        for i in 0..size {
            let own = out.row_mut(i);
            own.copy_from_slice(&self.all.row(i)[..size]);
            for c in 0..stage.gain.values.len() / size {
                add(stage.cross[(c, i)], stage.gain.row(c), own);
            }
        }
        // Rounding leaves it not quite symmetric, and grows from interval to interval.
        for i in 0..size {
            for j in 0..i {
                let mean = 0.5 * (out[(i, j)] + out[(j, i)]);
                (out[(i, j)], out[(j, i)]) = (mean, mean);
            }
        }
        out
    }
}
