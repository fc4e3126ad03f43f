//! The nonlinear program: −2 log-likelihood over scaled unknowns. Its Hessian is the Fisher information, or is computed
//! by finite differences of the gradient.

use super::likelihood::Likelihood;
use super::limits::Limits;
use crate::posed::Posed;
use nalgebra::{DMatrix, DVector};
use pilotage_inference::normal_equations;
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{Hessian, Problem, SparseProblem};
use std::sync::{Arc, Mutex};

/// Step of the differences, in scaled unknowns: central differences of a gradient that is exact up to rounding.
const STEP: f64 = 1e-5;

/// Derivatives at a point, in scaled unknowns.
struct Linear {
    at: Vec<f64>,
    gradient: Vec<f64>,
    /// In the order of the pattern.
    hessian: Vec<f64>,
}

/// The program of a problem.
pub struct Program<'p> {
    /// The objective.
    pub likelihood: Likelihood<'p>,
    /// The constraints.
    pub limits: Limits<'p>,
    /// Magnitude of each unknown.
    pub scales: Vec<f64>,
    /// Scale factor of the objective, which makes it of the order of one per measured value.
    pub factor: f64,
    /// Whether the Hessian is computed by differences. Fisher information is the mean of the Hessian over data: it is
    /// cheaper, but a poor model for a density that the data do not distinguish from zero.
    pub is_exact: bool,
    /// An unknown held at a scaled value.
    pub fixed: Option<(usize, f64)>,
    /// Number of shared parameters, and index ranges of the unknowns of the runs.
    shared: usize,
    own: Vec<std::ops::Range<usize>>,
    /// Scaled limits, and their scale factors.
    ends: (Vec<f64>, Vec<f64>),
    sizes: Vec<f64>,
    weights: Vec<f64>,
    known: Mutex<Option<Arc<Linear>>>,
}

impl<'p> Program<'p> {
    /// For a problem's likelihood, with unknowns of these magnitudes around a point.
    pub fn new(
        posed: &'p Posed<'p>,
        likelihood: Likelihood<'p>,
        scales: Vec<f64>,
        about: &[f64],
    ) -> Self {
        let limits = Limits::of(posed, &likelihood);
        let recorded = posed.quantities.recorded.iter().flatten().flatten();
        let samples = recorded.filter(|y| y.is_finite()).count();
        let slopes = limits.slopes(about);
        let effect = |i: usize| {
            let effects = slopes
                .iter()
                .zip(&scales)
                .map(|(own, s)| (own[i] * s).abs());
            let most = effects.fold(0.0, f64::max);
            if most > 0.0 && most.is_finite() {
                most
            } else {
                1.0
            }
        };
        let (lower, upper) = limits.ends();
        let sizes: Vec<f64> = (0..lower.len()).map(effect).collect();
        let scaled = |ends: &[f64]| ends.iter().zip(&sizes).map(|(end, s)| end / s).collect();
        Self {
            ends: (scaled(lower), scaled(upper)),
            sizes,
            weights: vec![1.0; scales.len()],
            own: likelihood.own(),
            shared: posed.shared,
            is_exact: false,
            fixed: None,
            factor: 1.0 / samples.max(1) as f64,
            likelihood,
            limits,
            scales,
            known: Mutex::new(None),
        }
    }

    /// Unknowns from scaled ones.
    pub fn unknowns(&self, z: &[f64]) -> Vec<f64> {
        z.iter().zip(&self.scales).map(|(z, s)| z * s).collect()
    }

    /// Scaled unknowns.
    pub fn scaled(&self, unknowns: &[f64]) -> Vec<f64> {
        unknowns
            .iter()
            .zip(&self.scales)
            .map(|(v, s)| v / s)
            .collect()
    }

    /// Pairs of unknowns with a possibly nonzero second derivative: shared ones, and those of each run with these and
    /// with each other.
    fn pairs(&self) -> Pattern {
        let shared = 0..self.shared;
        let mut all: Pattern = shared
            .clone()
            .flat_map(|i| (i..self.shared).map(move |k| (i, k)))
            .collect();
        for own in &self.own {
            for k in own.clone() {
                all.extend(shared.clone().chain(own.start..k + 1).map(|i| (i, k)));
            }
        }
        all
    }

    /// The derivatives at a point, computed once.
    fn linear(&self, z: &[f64]) -> Arc<Linear> {
        let mut known = match self.known.lock() {
            Ok(known) => known,
            Err(poisoned) => poisoned.into_inner(),
        };
        if let Some(own) = known.as_ref().filter(|own| own.at == z) {
            return own.clone();
        }
        let own = Arc::new(self.linearised(z));
        *known = Some(own.clone());
        own
    }

    /// The Hessian by differences of the gradient, in the order of the pattern. None if it is not finite.
    fn differences(&self, z: &[f64]) -> Option<Vec<f64>> {
        let at = |k: usize, by: f64| {
            let mut moved = z.to_vec();
            moved[k] += by;
            self.linearised(&moved).gradient
        };
        let column = |k: usize| {
            let step = STEP * z[k].abs().max(1.0);
            let pairs = at(k, step).into_iter().zip(at(k, -step));
            pairs.map(|(up, down)| (up - down) / (2.0 * step)).collect()
        };
        let columns: Vec<Vec<f64>> = (0..z.len()).map(column).collect();
        let entry = |(i, k): (usize, usize)| 0.5 * (columns[k][i] + columns[i][k]);
        let all: Vec<f64> = self.pairs().into_iter().map(entry).collect();
        all.iter().all(|own| own.is_finite()).then_some(all)
    }

    fn linearised(&self, z: &[f64]) -> Linear {
        let unknowns = self.unknowns(z);
        let count = unknowns.len();
        let mut gradient = DVector::<f64>::zeros(count);
        let mut blocks = Vec::new();
        for (j, run) in self.likelihood.rows(&unknowns).iter().enumerate() {
            let width = run.errors.ncols();
            let mut block = DMatrix::zeros(width, width);
            for (rows, residuals) in run.scored() {
                let weight = 2.0 * self.likelihood.weight(j);
                let (matrix, right) = normal_equations(&rows, &residuals);
                block += matrix * weight;
                let score = right * -weight;
                let places = (0..self.shared).chain(self.own[j].clone());
                places
                    .zip(&score)
                    .for_each(|(place, own)| gradient[place] += own);
            }
            blocks.push(block);
        }
        let mut diagonal = vec![0.0; count];
        for term in self.likelihood.priors(&unknowns) {
            gradient[term.place] += 2.0 * term.residual * term.slope;
            diagonal[term.place] += 2.0 * term.slope * term.slope;
        }
        let entry = |&(i, k): &(usize, usize)| {
            let sum = self.entry(&blocks, i, k) + if i == k { diagonal[i] } else { 0.0 };
            self.factor * self.scales[i] * self.scales[k] * sum
        };
        let scaled = gradient.iter().zip(&self.scales);
        Linear {
            at: z.to_vec(),
            gradient: scaled.map(|(own, s)| self.factor * s * own).collect(),
            hessian: self.pairs().iter().map(entry).collect(),
        }
    }

    /// Keeps the own unknowns of a run that does not count in place: their curvature is that of the scales.
    fn hold_uncounted(&self, values: &mut [f64]) {
        let uncounted = (0..self.own.len()).filter(|j| !self.likelihood.counts(*j));
        let held: Vec<usize> = uncounted.flat_map(|j| self.own[j].clone()).collect();
        if held.is_empty() {
            return;
        }
        for (value, (i, k)) in values.iter_mut().zip(self.pairs()) {
            if i == k && held.contains(&k) {
                *value += 1.0;
            }
        }
    }

    /// Sum over the runs of the information on two unknowns.
    fn entry(&self, blocks: &[DMatrix<f64>], i: usize, k: usize) -> f64 {
        let runs = self.own.iter().zip(blocks);
        let place = |own: &std::ops::Range<usize>, k: usize| match k < self.shared {
            true => Some(k),
            false => own.contains(&k).then(|| self.shared + k - own.start),
        };
        let of_run =
            |(own, block): (_, &DMatrix<f64>)| Some(block[(place(own, i)?, place(own, k)?)]);
        runs.filter_map(of_run).sum()
    }
}

impl Problem for Program<'_> {
    fn n_variables(&self) -> usize {
        self.scales.len()
    }

    fn n_equalities(&self) -> usize {
        usize::from(self.fixed.is_some())
    }

    fn limits(&self) -> (&[f64], &[f64]) {
        (&self.ends.0, &self.ends.1)
    }

    fn damping_weights(&self) -> &[f64] {
        &self.weights
    }

    fn evaluate(&self, z: &[f64], c: &mut [f64], g: &mut [f64]) -> f64 {
        if let Some((k, value)) = self.fixed {
            c[0] = z[k] - value;
        }
        let unknowns = self.unknowns(z);
        let values = self.limits.values(&unknowns).into_iter().zip(&self.sizes);
        g.iter_mut()
            .zip(values)
            .for_each(|(g, (own, size))| *g = own / size);
        self.factor * self.likelihood.value(&unknowns)
    }
}

impl SparseProblem for Program<'_> {
    fn gradient(&self, z: &[f64], gradient: &mut [f64]) {
        gradient.copy_from_slice(&self.linear(z).gradient);
    }

    fn equality_pattern(&self) -> Pattern {
        self.fixed.iter().map(|(k, _)| (0, *k)).collect()
    }

    fn inequality_pattern(&self) -> Pattern {
        let columns = self.scales.len();
        let rows = 0..self.sizes.len();
        rows.flat_map(|i| (0..columns).map(move |k| (i, k)))
            .collect()
    }

    fn jacobians(&self, z: &[f64], equality: &mut [f64], inequality: &mut [f64]) {
        equality.fill(1.0);
        let slopes = self.limits.slopes(&self.unknowns(z));
        let entries = self.inequality_pattern().into_iter().zip(inequality);
        for ((i, k), entry) in entries {
            *entry = slopes[k][i] * self.scales[k] / self.sizes[i];
        }
    }

    fn hessian_pattern(&self) -> Pattern {
        self.pairs()
    }

    fn hessian(&self, z: &[f64], _: &[f64], eta: &[f64], kind: Hessian, values: &mut [f64]) {
        let is_exact = kind != Hessian::GaussNewton;
        let exact = (is_exact && self.is_exact).then(|| self.differences(z));
        match exact.flatten() {
            Some(own) => values.copy_from_slice(&own),
            None => values.copy_from_slice(&self.linear(z).hessian),
        }
        self.hold_uncounted(values);
        if !is_exact || eta.iter().all(|own| *own == 0.0) {
            return;
        }
        let unknowns = self.unknowns(z);
        let eta: Vec<f64> = eta
            .iter()
            .zip(&self.sizes)
            .map(|(own, s)| own / s)
            .collect();
        for (value, (i, k)) in values.iter_mut().zip(self.pairs()) {
            let curvature = self.limits.curvature(&unknowns, &eta, [i, k]);
            *value += self.scales[i] * self.scales[k] * curvature;
        }
    }
}
