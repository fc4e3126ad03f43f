//! The linear systems of the interior-point method, whose cost is linear in the number of intervals.
//!
//! In each interval its midpoint and the states at its end are eliminated by the linearised defects, in several intervals at
//! once (`eliminate`); what remains is a linear-quadratic control problem in `s = [x u θ]` at the nodes, with the controls
//! `w` at the next node as decisions, solved by a Riccati recursion (`riccati`; Rao, Wright & Rawlings, *Application of
//! Interior-Point Methods to Model Predictive Control*, JOTA 99, 1998; Vanroye et al., *FATROP*, IROS 2023). Its Cholesky
//! factors exist exactly where the reduced Hessian is positive definite. Equations at the ends are few: they are penalised,
//! which changes neither solution nor multipliers, and met by their Schur complement, which the recursion carries along
//! (Bryson & Ho, *Applied Optimal Control*, 1975, section 5.3).

mod combine;
mod eliminate;
mod first;
mod riccati;
mod solve;

use crate::evaluation::{Derivatives, Evaluator};
use crate::program::{Place, Program, Row, Shape};
use crate::rows::Jacobian;
use pilotage_collocation::simd::{LANES, Lanes, vectorised};

/// Weight of the penalty on the equations at the ends.
const PENALTY: f64 = 1e4;
/// Pivot of their Schur complement, relative to its diagonal, below which one depends on the others.
const DEPENDENT: f64 = 1e-8;

/// A step in all variables, with new multipliers of the equations.
#[derive(Debug, Clone, Default)]
pub(crate) struct Step {
    pub z: Vec<f64>,
    /// Of the defects, in groups.
    pub c: Vec<Lanes>,
    pub e: Vec<f64>,
}

/// What is factored: a linearised program with barriers.
#[derive(Debug)]
pub(crate) struct Linearised {
    pub derivatives: Derivatives,
    /// Barrier weights of the limited quantities.
    pub sigma: Vec<f64>,
    /// The same at the outputs, in lanes.
    pub of_outputs: Vec<Lanes>,
    pub limited: Jacobian,
    pub equations: Jacobian,
    /// Added to the Hessian of all variables.
    pub damping: f64,
    /// Whether the curvature of the Lagrangian is taken.
    pub is_exact: bool,
    /// Weight of the squared steps of the controls.
    pub smooth: f64,
}

/// The columns on which an entry of `[x u θ]` at a point depends, with factors: of `[x u θ | w]`.
type Spread = [(usize, f64); 2];

/// The factored system; allocated once for a mesh.
pub(crate) struct Kkt<'p> {
    program: &'p Program,
    rows: &'p (Vec<Row>, Vec<Row>),
    n: usize,
    m: usize,
    /// Length of `s`, and of `[s w]`.
    size: usize,
    all: usize,
    /// Groups of columns of `[s w ν]`: ν are the multipliers of the equations at the ends.
    wide: usize,
    /// Whether the last node has an equation, rather than the first.
    is_last: Vec<bool>,
    /// Controls and parameters at each point, as columns.
    spreads: [Vec<Spread>; 3],
    /// Entries of the rates' Jacobian: row, column, index.
    entries: Vec<(usize, usize, usize)>,
    /// Places `i ≤ j` of second derivatives at a point.
    pattern: Vec<(usize, usize)>,
    /// Of each pair of the model, its place; of each product of an output's gradients, output, both and place.
    pairs: Vec<usize>,
    products: Vec<[usize; 4]>,
    /// Eliminated midpoints and ends.
    eliminated: eliminate::Eliminated,
    stages: riccati::Stages,
    first: first::First,
    offsets: solve::Offsets,
}

impl<'p> Kkt<'p> {
    pub fn new(program: &'p Program, rows: &'p (Vec<Row>, Vec<Row>)) -> Self {
        let (n, m, p) = (program.n(), program.m(), program.p());
        let (size, all) = (n + m + p, n + 2 * m + p);
        let model = &program.model;
        let spread = |at: usize, q: usize| -> Spread {
            match q.checked_sub(n) {
                Some(c) if c < m => {
                    let (first, second) = program.weights(c, at);
                    match first {
                        0.0 => [(size + c, second), (q, 0.0)],
                        _ => [(q, first), (size + c, second)],
                    }
                }
                _ => [(q, 1.0), (q, 0.0)],
            }
        };
        let mut pattern: Vec<(usize, usize)> = model.pairs.clone();
        pattern.extend((0..n).map(|i| (i, i)));
        let products = || {
            let outputs = 0..model.n_outputs();
            let before = move |k: usize| (0..k).map(|k| model.columns(k).len()).sum::<usize>();
            outputs.flat_map(move |k| {
                let own = model.columns(k);
                (0..own.len()).flat_map(move |a| {
                    (0..=a).map(move |b| [k, before(k) + b, before(k) + a, own[b], own[a]])
                })
            })
        };
        pattern.extend(products().map(|own| (own[3], own[4])));
        pattern.sort_unstable();
        pattern.dedup();
        let place = |at: (usize, usize)| pattern.binary_search(&at).expect("it is there");
        let wide = combine::wide(all + rows.1.len());
        let entries = model.entries.iter().enumerate();
        Self {
            pairs: model.pairs.iter().map(|at| place(*at)).collect(),
            products: products()
                .map(|[k, b, a, i, j]| [k, b, a, place((i, j))])
                .collect(),
            is_last: rows
                .1
                .iter()
                .map(|row| matches!(row.place, Place::End(_)))
                .collect(),
            spreads: [0, 1, 2].map(|at| (0..size).map(|q| spread(at, q)).collect()),
            entries: entries
                .filter(|(_, at)| at.0 < n)
                .map(|(e, &(row, q))| (row, q, e))
                .collect(),
            eliminated: eliminate::Eliminated::new(program, pattern.len()),
            stages: riccati::Stages::new(program, wide),
            first: first::First::default(),
            offsets: solve::Offsets::new(program),
            pattern,
            program,
            rows,
            n,
            m,
            size,
            all,
            wide,
        }
    }

    /// Variables of the node `[x u]`, then θ, as entry of `s`.
    fn entry(&self, variable: usize, node: usize) -> usize {
        match variable.checked_sub(self.program.theta()) {
            Some(parameter) => self.n + self.m + parameter,
            None => variable - self.program.node(node),
        }
    }

    /// Factors the system. False if the reduced Hessian is not positive definite.
    pub fn factor(&mut self, evaluator: &Evaluator<'p>, of: &Linearised) -> bool {
        macro_rules! with {
            ($block:literal, $wide:literal) => {
                vectorised(riccati::Factor::<$block, $wide> {
                    own: self,
                    evaluator,
                    of,
                })
            };
        }
        match self.wide {
            1 => with!(1, 1),
            2 => with!(2, 2),
            3 => with!(3, 3),
            4 => with!(4, 4),
            5 => with!(5, 5),
            6 => with!(6, 6),
            _ => with!(4, 0),
        }
    }

    /// The step for the residuals of the defects `c` and of the equations at the ends `e`, and the gradient over all
    /// variables of all else. False if numbers are not finite.
    pub fn solve(
        &mut self,
        evaluator: &Evaluator<'p>,
        of: &Linearised,
        (c, e): (&[Lanes], &[f64]),
        gradient: &mut [f64],
        out: &mut Step,
    ) -> bool {
        e.iter()
            .enumerate()
            .for_each(|(r, e)| of.equations.add_row(r, PENALTY * e, gradient));
        out.z.resize(gradient.len(), 0.0);
        out.c.resize(c.len(), [0.0; LANES]);
        out.e.resize(e.len(), 0.0);
        vectorised(solve::Solve {
            own: self,
            evaluator,
            derivatives: &of.derivatives,
            c,
            e,
            gradient,
            out,
        });
        out.z.iter().all(|d| d.is_finite())
    }
}

/// Whether a variable of the first node is known.
pub(crate) fn is_known(program: &Program, i: usize) -> bool {
    let n = program.n();
    match i.checked_sub(n) {
        None => program.initial[i].is_some(),
        Some(c) => {
            let own = &program.controls[c];
            own.first.is_some() || own.shape == Shape::Constant
        }
    }
}
