//! Values and derivatives at a point, and where a solve begins.

use super::Multipliers;
use super::Solver;
use super::point;
use super::point::Point;
use crate::evaluation::add_pulled;
use crate::kkt::is_known;
use pilotage_collocation::simd::LANES;

/// Largest gradient of the objective before it is scaled down.
const STEEPEST: f64 = 100.0;
/// Largest multiplier of an equation that is taken as an estimate.
const MOST_MULTIPLIER: f64 = 1e3;

impl Solver<'_> {
    /// Slacks and multipliers of the first point, and the factor of the objective.
    pub(super) fn begin(&mut self) {
        let mut here = std::mem::take(&mut self.here);
        self.evaluate(&mut here);
        let pairs = self.rows.0.iter().zip(&here.g);
        here.s = pairs.map(|(row, g)| point::inside(*g, row)).collect();
        let of = |room: f64| self.mu / room;
        let pairs = || self.rows.0.iter().zip(&here.s);
        self.multipliers = Multipliers {
            c: vec![[0.0; LANES]; here.values.c.len()],
            e: vec![0.0; here.e.len()],
            low: pairs().map(|(row, s)| of(s - row.lower)).collect(),
            high: pairs().map(|(row, s)| of(row.upper - s)).collect(),
        };
        self.here = here;
        self.linearise();
        let steepest = self.aim.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        if steepest > STEEPEST {
            self.factor = STEEPEST / steepest;
            self.linearise();
        }
        self.estimate();
        let violation = self.here.violation();
        self.most_violation = 1e4 * violation.max(1.0);
        self.least_violation = 1e-4 * violation.max(1.0);
    }

    /// Multipliers of the equations that make the gradient of the Lagrangian least (the paper, section 3.6). Those
    /// of the equations are 0 before.
    pub(super) fn estimate(&mut self) {
        let own = &mut self.linearised;
        own.sigma.clear();
        own.sigma.resize(self.rows.0.len(), 0.0);
        own.of_outputs.clear();
        own.of_outputs
            .resize(self.weights.outputs.len(), [0.0; LANES]);
        (own.is_exact, own.smooth, own.damping) = (false, 0.0, 1.0);
        let (c, e) = (&self.multipliers.c, &self.multipliers.e);
        let (gradient, step) = (&mut self.lagrangian, &mut self.direction.step);
        if !self.kkt.factor(&self.evaluator, own)
            || !self.kkt.solve(&self.evaluator, own, (c, e), gradient, step)
        {
            return;
        }
        let all = step.c.as_flattened().iter().chain(&step.e);
        if all.fold(0.0_f64, |m, l| m.max(l.abs())) <= MOST_MULTIPLIER {
            self.multipliers.c.clone_from(&step.c);
            self.multipliers.e.clone_from(&step.e);
        }
        self.linearise();
    }

    /// Values at a point's variables.
    pub(super) fn evaluate(&mut self, at: &mut Point) {
        self.evaluator.values(&at.z, &mut at.values);
        let outputs = at.values.outputs.as_flattened();
        at.g.clear();
        at.g.extend(
            (0..self.rows.0.len()).map(|r| self.linearised.limited.value(r, outputs, &at.z)),
        );
        at.e.clear();
        let rows = self.rows.1.iter().enumerate();
        at.e.extend(
            rows.map(|(r, row)| self.linearised.equations.value(r, outputs, &at.z) - row.lower),
        );
    }

    /// Derivatives at the point, the gradients of objective and Lagrangian.
    pub(super) fn linearise(&mut self) {
        let own = &self.multipliers;
        self.evaluator.weigh(&own.c, &mut self.weights);
        let outputs = self.weights.outputs.as_flattened_mut();
        let at = &mut self.linearised;
        at.limited.scatter(own.of_limits(), outputs);
        at.equations.scatter(own.e.iter().copied(), outputs);
        let objective = outputs.len() - LANES * self.program.end.n_outputs();
        outputs[objective] = self.factor;
        self.evaluator
            .derivatives(&self.here.z, &self.weights, &mut at.derivatives);
        let gradients = at.derivatives.gradients.as_flattened();
        at.limited.update(gradients);
        at.equations.update(gradients);
        self.aim.fill(0.0);
        self.add_objective();
        let (own, at) = (&self.multipliers, &self.linearised);
        let out = &mut self.lagrangian;
        out.copy_from_slice(&self.aim);
        for (r, weight) in own.of_limits().enumerate() {
            at.limited.add_row(r, weight, out);
        }
        for (r, weight) in own.e.iter().enumerate() {
            at.equations.add_row(r, *weight, out);
        }
        add_pulled(&self.evaluator, &at.derivatives, &own.c, out);
        let known = self.program.n() + self.program.m();
        for i in (0..known).filter(|i| is_known(self.program, *i)) {
            out[i] = 0.0;
        }
    }

    /// Adds the gradient of the objective, with its factor.
    pub(super) fn add_objective(&mut self) {
        let program = self.program;
        let (n, m, last) = (program.n(), program.m(), program.node(program.intervals()));
        let (columns, first) = self
            .evaluator
            .gradient(crate::program::Place::End(0))
            .expect("the objective");
        let values = &self.linearised.derivatives.gradients.as_flattened()[first..];
        for (q, value) in columns.iter().zip(values.iter().step_by(LANES)) {
            let at = match q.checked_sub(n + m) {
                Some(parameter) => program.theta() + parameter,
                None => last + q,
            };
            self.aim[at] += self.factor * value;
        }
        for k in (0..program.intervals()).filter(|_| program.regularise > 0.0) {
            for c in n..n + m {
                let [a, b] = [k, k + 1].map(|k| program.node(k) + c);
                let step = self.here.z[b] - self.here.z[a];
                let slope = 2.0 * self.factor * program.regularise * step;
                self.aim[b] += slope;
                self.aim[a] -= slope;
            }
        }
    }
}
