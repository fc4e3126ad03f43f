//! A step from a saddle point along a direction of negative curvature (McCormick, *A modification of Armijo's step-size
//! rule for negative curvature*, Math. Program. 13, 1977).

use super::Problem;
use super::curvature::{Activity, Curvature, activities};
use super::iterate::{Iterate, violation};
use super::qp::QpSolver;
use super::solution::StepModel;
use super::solver::{Accepted, Sqp};

/// Fraction of the decrease `½ α² dᵀWd` that a step must achieve.
const SUFFICIENT: f64 = 0.1;
/// Shortest step, as the largest change of a variable. The longest step is one, the order of the variables.
const SHORTEST: f64 = 1e-6;

impl<P: Problem + ?Sized, Q: QpSolver<P>> Sqp<'_, P, Q> {
    /// The longest step of either sign that lowers the augmented Lagrangian as its curvature predicts. None if there is
    /// none, or if this saddle point is no better than the last.
    pub(super) fn leave_saddle(&mut self, curvature: &Curvature) -> Option<Accepted> {
        if self.current.f >= self.saddle {
            return None;
        }
        let measure = Lagrangian::new(self.problem, &self.current, self.merit.penalty());
        let here = measure.value(&self.current);
        let length = curvature
            .direction
            .iter()
            .fold(0.0, |m: f64, d| m.max(d.abs()));
        let mut alpha = 1.0 / length;
        while alpha * length >= SHORTEST {
            let promised = SUFFICIENT * 0.5 * alpha * alpha * curvature.along;
            for signed in [alpha, -alpha] {
                self.move_trial(signed, &curvature.direction);
                if measure.value(&self.trial) <= here + promised {
                    self.saddle = self.current.f;
                    self.damping = self.damping.max(self.options.initial_damping);
                    self.work.curvature_steps += 1;
                    self.take_trial();
                    return Some(Accepted {
                        alpha,
                        damping: 0.0,
                        model: StepModel::Curvature,
                    });
                }
            }
            alpha *= 0.5;
        }
        None
    }

    /// Sets `trial` to `current + alpha d`, with the current multipliers.
    fn move_trial(&mut self, alpha: f64, d: &[f64]) {
        self.trial.clone_from(&self.current);
        (self.trial.z.iter_mut().zip(d)).for_each(|(z, d)| *z += alpha * d);
        self.trial.evaluate(self.problem);
        self.work.evaluations += 1;
    }
}

/// The augmented Lagrangian at a KKT point in all its strongly active constraints, with the multipliers of that point;
/// the other inequalities are penalised by their violation. Unlike the merit, it has the curvature of the Lagrangian on
/// both sides of an inequality.
struct Lagrangian {
    lambda: Vec<f64>,
    rows: Vec<Row>,
    penalty: f64,
    cost: f64,
}

/// The contribution of an inequality.
enum Row {
    /// `η (g - value) + ½ ρ (g - value)²`.
    Held { eta: f64, value: f64 },
    /// A multiple of the violation.
    Limited { lower: f64, upper: f64 },
}

impl Lagrangian {
    fn new<P: Problem + ?Sized>(problem: &P, at: &Iterate, penalty: f64) -> Self {
        let (lower, upper) = problem.limits();
        let rows = activities(problem, at).into_iter().enumerate();
        let multipliers = at.lambda.iter().chain(&at.eta);
        Self {
            lambda: at.lambda.clone(),
            rows: rows
                .map(|(i, activity)| match activity {
                    Activity::Strong => Row::Held {
                        eta: at.eta[i],
                        value: at.g[i],
                    },
                    Activity::Weak(_) | Activity::Free => Row::Limited {
                        lower: lower[i],
                        upper: upper[i],
                    },
                })
                .collect(),
            penalty: penalty.max(1.0),
            cost: 1.0 + multipliers.fold(0.0, |m: f64, v| m.max(v.abs())),
        }
    }

    /// The value at an iterate; infinite outside the problem's domain.
    fn value(&self, at: &Iterate) -> f64 {
        if !at.is_finite() {
            return f64::INFINITY;
        }
        let augmented = |multiplier: f64, c: f64| c * (multiplier + 0.5 * self.penalty * c);
        let equalities = at.c.iter().zip(&self.lambda);
        let inequalities = at.g.iter().zip(&self.rows);
        let held: f64 = equalities.map(|(c, lambda)| augmented(*lambda, *c)).sum();
        let rows = inequalities.map(|(g, row)| match row {
            Row::Held { eta, value } => augmented(*eta, g - value),
            Row::Limited { lower, upper } => self.cost * violation(*g, *lower, *upper),
        });
        at.f + held + rows.sum::<f64>()
    }
}
