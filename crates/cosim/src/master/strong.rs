//! Strong coupling: the step is repeated until the values at its end are consistent.

use super::Ending;
use super::exchange::Exchange;
use super::history::Outcome;
use super::lu::{Lu, SINGULAR};
use super::wired::{BEGIN, Failure};
use crate::algorithms::{Coupling, Iteration, MAX_EXTRAPOLATION};
use crate::report::Steps;

/// A correction that leaves more than this part of the difference triggers a new matrix.
const SLOW: f64 = 0.1;

/// With the last matrix, a correction that leaves more than this part is the last.
const HOPELESS: f64 = 0.9;

/// Maximum number of matrices per step.
const MAX_MATRICES: u32 = 3;

/// Change of a value for finite differences, relative to its magnitude: far above the noise of components that
/// integrate with error control.
const DIFFERENCE: f64 = 1e-5;

/// Least magnitude for these: differences of smaller values are not normal numbers.
const TINY: f64 = 1e-100;

/// Maximum number of repetitions of a step because non-real values changed within it.
const MAX_REPETITIONS: u32 = 4;

/// Finds the outputs `z` at the end of a step with `F(z) = z`, where `F` is one step of all components whose inputs go
/// from the outputs at its beginning to `z`.
pub(super) struct Strong {
    iteration: Iteration,
    /// Degree of the input polynomials.
    degree: usize,
    /// Degrees of extrapolation: for the first pass, and for components without rollback.
    predictor: usize,
    fallback: usize,
    /// Components with rollback: those that depend on `z` and are repeated, and the others.
    repeated: Vec<usize>,
    once: Vec<usize>,
    /// Components without rollback.
    irrevocable: Vec<usize>,
    /// Non-real outputs that feed components with rollback.
    others: Vec<usize>,
    /// Positions of the outputs `z` among the fed outputs, positions of discrete outputs, which keep their value
    /// through the step, and index in `z` of each fed output.
    unknowns: Vec<usize>,
    discrete: Vec<usize>,
    place: Vec<Option<usize>>,
    tried: Vec<Outcome>,
    found: Vec<Outcome>,
    /// Corrections of the values and of the slopes.
    correction: Vec<f64>,
    slope_correction: Vec<f64>,
    /// `I - ∂F/∂z`, and the same for the slopes: through direct feedthrough only.
    matrix: Lu,
    slope_matrix: Lu,
    has_matrix: bool,
}

impl Strong {
    pub(super) fn new(exchange: &Exchange, coupling: &Coupling) -> Self {
        let wired = &exchange.wired;
        let all = 0..wired.len();
        let (able, irrevocable): (Vec<usize>, Vec<usize>) =
            all.partition(|&i| wired[i].abilities.rollback);
        let feeds_repeated =
            |p: &usize| able.iter().any(|&i| wired[i].inputs.positions.contains(p));
        let unknowns = able
            .iter()
            .flat_map(|&i| wired[i].outputs.fed_positions.iter().copied());
        let (discrete, unknowns): (Vec<usize>, Vec<usize>) = unknowns
            .filter(feeds_repeated)
            .partition(|&p| exchange.history.is_discrete(p));
        let mut place = vec![None; exchange.fed.len()];
        for (k, &p) in unknowns.iter().enumerate() {
            place[p] = Some(k);
        }
        let depends = |&i: &usize| {
            wired[i]
                .inputs
                .positions
                .iter()
                .any(|&p| place[p].is_some())
        };
        let others = (able.iter()).flat_map(|&i| wired[i].inputs.others.iter());
        let others = others.map(|&(_, slot)| slot).collect();
        let (repeated, once) = able.into_iter().partition(depends);
        let n = unknowns.len();
        Self {
            iteration: coupling.iteration,
            degree: if coupling.control.is_some() { 2 } else { 1 },
            predictor: coupling.extrapolation.unwrap_or(MAX_EXTRAPOLATION),
            fallback: coupling.extrapolation.unwrap_or(0),
            repeated,
            once,
            irrevocable,
            others,
            unknowns,
            discrete,
            place,
            tried: vec![Outcome::default(); n],
            found: vec![Outcome::default(); n],
            correction: vec![0.0; n],
            slope_correction: vec![0.0; n],
            matrix: Lu::new(n),
            slope_matrix: Lu::new(n),
            has_matrix: false,
        }
    }

    /// A communication step by `h` from the history's last point, where the states were saved; returns whether the
    /// corrections converged.
    ///
    /// Non-real values initially keep their values from the beginning. If they differ at the end, the step is repeated
    /// with the new values until they settle. If they do not settle, the values from the beginning are used.
    pub(super) fn advance(
        &mut self,
        exchange: &mut Exchange,
        h: f64,
        steps: &mut Steps,
    ) -> Result<bool, Ending> {
        exchange.keep_others();
        self.advance_irrevocable(exchange, h)?;
        for &p in &self.discrete {
            exchange.profiles[p] = exchange.history.extrapolated(p, 0, h);
        }
        for (tried, &p) in self.tried.iter_mut().zip(&self.unknowns) {
            *tried = Outcome {
                value: exchange.history.extrapolated(p, self.predictor, h).end,
                slope: exchange.history.slope_after(p, h),
            };
        }
        let mut has_converged = self.solve(exchange, h, steps)?;
        for repetition in 0..=MAX_REPETITIONS {
            if self.others_fit(exchange) {
                break;
            }
            let is_last = repetition == MAX_REPETITIONS;
            steps.repeated += 1;
            steps.unsettled += u64::from(is_last);
            let others = match is_last {
                true => &exchange.others_before,
                false => &exchange.values.others,
            };
            exchange.others_given.clone_from_slice(others);
            for &i in self.once.iter().chain(&self.repeated) {
                go_back(exchange, i)?;
            }
            has_converged = self.solve(exchange, h, steps)?;
        }
        Ok(has_converged)
    }

    /// The matrices that the next steps go on with.
    pub(super) fn kept(&self) -> Option<[Lu; 2]> {
        let matrices = [&self.matrix, &self.slope_matrix];
        self.has_matrix.then(|| matrices.map(Lu::clone))
    }

    /// Goes on with them; `false` if they are of another system.
    pub(super) fn take(&mut self, kept: Option<[Lu; 2]>) -> bool {
        self.has_matrix = kept.is_some();
        let Some([matrix, slope_matrix]) = kept else {
            return true;
        };
        let fits = matrix.fits(&self.matrix) && slope_matrix.fits(&self.slope_matrix);
        (self.matrix, self.slope_matrix) = (matrix, slope_matrix);
        fits
    }

    /// Whether the non-real values at the end equal those given to the components.
    fn others_fit(&self, exchange: &Exchange) -> bool {
        let (given, found) = (&exchange.others_given, &exchange.values.others);
        self.others.iter().all(|&slot| given[slot] == found[slot])
    }

    /// Steps from the beginning with `tried`, and corrects it until it converges.
    fn solve(
        &mut self,
        exchange: &mut Exchange,
        h: f64,
        steps: &mut Steps,
    ) -> Result<bool, Ending> {
        self.set_profiles(exchange, h);
        for k in 0..self.once.len() {
            substeps(exchange, self.once[k], h)?;
        }
        self.substeps(exchange, h)?;
        let (mut size, mut before) = (self.difference(exchange, h), f64::INFINITY);
        let (mut is_slow, mut matrices) = (false, 0);
        for _ in 0..self.iteration.max {
            if size <= self.iteration.tolerance {
                return Ok(true);
            }
            if size > HOPELESS * before && matrices > 0 && self.is_noise(exchange, h) {
                return Ok(true);
            }
            if size > HOPELESS * before && matrices == MAX_MATRICES {
                break;
            }
            if is_slow && matrices < MAX_MATRICES || !self.has_matrix {
                self.renew(exchange, h)?;
                steps.matrices += 1;
                matrices += 1;
            }
            self.correct(exchange, h)?;
            steps.corrections += 1;
            before = std::mem::replace(&mut size, self.difference(exchange, h));
            is_slow = size > SLOW * before;
        }
        Ok(size <= self.iteration.tolerance || self.is_noise(exchange, h))
    }

    /// Steps components without rollback first, with extrapolated inputs; their outputs are then known.
    fn advance_irrevocable(&self, exchange: &mut Exchange, h: f64) -> Result<(), Ending> {
        if self.irrevocable.is_empty() {
            return Ok(());
        }
        exchange.extrapolate(self.fallback, h);
        for &i in &self.irrevocable {
            substeps(exchange, i, h)?;
        }
        for &i in &self.irrevocable {
            exchange.interpolate(i, self.degree, h);
        }
        Ok(())
    }

    /// Sets the profiles of the fed outputs to end at the trial values.
    fn set_profiles(&self, exchange: &mut Exchange, h: f64) {
        for (&p, &end) in self.unknowns.iter().zip(&self.tried) {
            exchange.profiles[p] = exchange.history.interpolated(p, self.degree, h, end);
        }
    }

    /// One step of all components that depend on the trial values, from their current state.
    fn substeps(&mut self, exchange: &mut Exchange, h: f64) -> Result<(), Ending> {
        for k in 0..self.repeated.len() {
            substeps(exchange, self.repeated[k], h)?;
        }
        for (found, &p) in self.found.iter_mut().zip(&self.unknowns) {
            *found = exchange.outcome(p);
        }
        Ok(())
    }

    /// Differences between `found` and `tried`, by position: of the values, or of the effect of the slopes on the means, if
    /// that is larger.
    fn differences(&self, h: f64) -> impl Iterator<Item = (usize, f64)> {
        let pairs = self.found.iter().zip(&self.tried).zip(&self.unknowns);
        pairs.map(move |((found, tried), &p)| {
            let value = (found.value - tried.value).abs();
            let slope = h / 12.0 * (found.slope - tried.slope).abs();
            (p, value.max(slope))
        })
    }

    /// Largest difference, relative to the outputs' scales.
    fn difference(&self, exchange: &Exchange, h: f64) -> f64 {
        let all = self.differences(h).zip(&self.found);
        all.fold(0.0, |max, ((p, difference), found)| {
            let scale = exchange.history.scale(p, h, found.value);
            max.max(difference / scale.max(found.value.abs()))
        })
    }

    /// Whether the differences are within the tolerance of outputs with nominal values of 1, at least. What exceeds it then by
    /// its own scale does not get smaller: it is noise.
    fn is_noise(&self, exchange: &mut Exchange, h: f64) -> bool {
        let tolerance = self.iteration.tolerance;
        let history = &mut exchange.history;
        let is_small = |(p, own): (usize, f64)| own <= tolerance * history.magnitude(p);
        if !self.differences(h).all(is_small) {
            return false;
        }
        for ((p, difference), found) in self.differences(h).zip(&self.found) {
            if difference > tolerance * history.scale(p, h, found.value) {
                history.note_noise(p, difference, tolerance);
            }
        }
        true
    }

    /// A step of the simplified Newton method, followed by a step of the components with its result.
    fn correct(&mut self, exchange: &mut Exchange, h: f64) -> Result<(), Ending> {
        let pairs = self.found.iter().zip(&self.tried);
        let corrections = self.correction.iter_mut().zip(&mut self.slope_correction);
        for ((value, slope), (found, tried)) in corrections.zip(pairs) {
            (*value, *slope) = (found.value - tried.value, found.slope - tried.slope);
        }
        self.matrix.solve(&mut self.correction);
        self.slope_matrix.solve(&mut self.slope_correction);
        let pairs = self.correction.iter().zip(&self.slope_correction);
        for (tried, (value, slope)) in self.tried.iter_mut().zip(pairs) {
            tried.value += value;
            tried.slope += slope;
        }
        self.set_profiles(exchange, h);
        for &i in &self.repeated {
            go_back(exchange, i)?;
        }
        self.substeps(exchange, h)
    }

    /// Forms `I - ∂F/∂z` by finite differences: one repeated step of a component for each output that feeds it. If the
    /// matrix is singular, the identity is used, which gives a fixed-point iteration.
    fn renew(&mut self, exchange: &mut Exchange, h: f64) -> Result<(), Ending> {
        self.matrix.set_identity();
        for k in 0..self.repeated.len() {
            let i = self.repeated[k];
            for input in 0..exchange.wired[i].inputs.distinct.len() {
                let p = exchange.wired[i].inputs.distinct[input];
                if let Some(column) = self.place[p] {
                    self.differentiate(exchange, h, i, p, column)?;
                }
            }
        }
        let place = |p: usize| self.place[p];
        let added = exchange.add_feedthrough(&mut self.slope_matrix, place);
        added.map_err(|failure| failure.at(exchange.history.time()))?;
        for matrix in [&mut self.matrix, &mut self.slope_matrix] {
            if !matrix.factor(SINGULAR) {
                matrix.set_identity();
                let is_regular = matrix.factor(SINGULAR);
                debug_assert!(is_regular, "the identity");
            }
        }
        self.has_matrix = true;
        Ok(())
    }

    /// Adds a component's entries to the matrix column of the output at position `p`.
    fn differentiate(
        &mut self,
        exchange: &mut Exchange,
        h: f64,
        i: usize,
        p: usize,
        column: usize,
    ) -> Result<(), Ending> {
        let profile = exchange.profiles[p];
        let scale = exchange.history.scale(p, h, profile.end);
        let size = DIFFERENCE * scale.max(profile.end.abs()).max(TINY);
        // Towards 0: an input at the end of its range stays in it.
        let change = if profile.end > 0.0 { -size } else { size };
        let mut end = self.tried[column];
        end.value += change;
        exchange.profiles[p] = exchange.history.interpolated(p, self.degree, h, end);
        go_back(exchange, i)?;
        substeps(exchange, i, h)?;
        exchange.profiles[p] = profile;
        for &q in &exchange.wired[i].outputs.fed_positions {
            if let Some(row) = self.place[q] {
                let changed = exchange.values.row[exchange.fed[q]];
                let slope = (changed - self.found[row].value) / change;
                self.matrix.add(row, column, -slope);
            }
        }
        Ok(())
    }
}

/// A communication step of one component by `h`, with its inputs along their profiles.
fn substeps(exchange: &mut Exchange, i: usize, h: f64) -> Result<(), Ending> {
    let t = exchange.history.time();
    let wired = &mut exchange.wired[i];
    let is_set = wired.set_others(&exchange.others_given);
    is_set.map_err(|failure: Failure| failure.at(t))?;
    let (parts, is_revocable) = (wired.parts, wired.abilities.rollback);
    let (values, profiles) = (&mut exchange.values, &exchange.profiles);
    wired.substeps(values, profiles, (t, h), parts, is_revocable)
}

fn go_back(exchange: &mut Exchange, i: usize) -> Result<(), Ending> {
    let t = exchange.history.time();
    let restored = exchange.wired[i].restore(BEGIN);
    restored.map_err(|failure| failure.at(t))
}
