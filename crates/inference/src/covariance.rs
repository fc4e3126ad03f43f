//! Covariances of the parameters.

use crate::autoregression::Autoregression;
use crate::inference::{Inference, Obstacle};
use crate::meat::Processes;
use nalgebra::{DMatrix, DVector};
use std::fmt;
use std::sync::OnceLock;

/// Number of runs from which on the jackknife is more reliable than a model of the noise.
pub const ENOUGH_RUNS: usize = 4;
/// A run informs about a parameter if its effect exceeds this part of the largest one on any run.
const INFORMS: f64 = 1e-6;

/// How the covariance is computed from the residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// `s² H⁻¹`: for white residuals.
    Plain,
    /// `H⁻¹ Σ J_iᵀ R(i - j) J_j H⁻¹` with the residuals' autocorrelations (Morelli & Klein, J. Aircr. 34, 1997).
    Sidpac,
    /// The same with an autoregressive process per signal, estimated without the bias of the fit.
    Ar,
    /// The jackknife over runs: assumes only that runs share no noise.
    Cr3,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 4] = [Self::Plain, Self::Sidpac, Self::Ar, Self::Cr3];

    /// Name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Sidpac => "sidpac",
            Self::Ar => "ar",
            Self::Cr3 => "cr3",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A model of the noise and the covariance of the score that it implies; the same for white noise of the same
/// variances.
#[derive(Debug, Clone)]
struct Model {
    processes: Processes,
    meat: DMatrix<f64>,
    white: Processes,
    white_meat: DMatrix<f64>,
}

/// Covariance of the shared parameters, and what intervals need.
#[derive(Debug, Clone)]
pub struct Covariance {
    /// Method of computation.
    pub method: Method,
    /// p × p; zero for parameters fixed by constraints and without the undetermined directions. It has full rank in the
    /// determined directions: if runs are too few for that, the correlations are those of [`Method::Ar`].
    pub matrix: DMatrix<f64>,
    /// Method behind the correlations.
    pub correlated_by: Method,
    /// Degrees of freedom of Student's t for each parameter.
    pub degrees: Vec<f64>,
    /// Method behind the variance of each parameter: [`Method::Ar`] for those informed by fewer runs than
    /// [`Method::Cr3`] requires.
    pub methods: Vec<Method>,
    /// The model of the noise, computed on demand.
    model: OnceLock<Model>,
}

impl Covariance {
    /// Standard deviations; 0 along what the data do not determine ([`Inference::flat`](crate::Inference::flat)), so that
    /// a parameter of which they say nothing has 0 too.
    pub fn deviations(&self) -> Vec<f64> {
        self.matrix.diagonal().iter().map(|v| v.sqrt()).collect()
    }

    /// Correlations; zero for parameters without variance.
    pub fn correlations(&self) -> DMatrix<f64> {
        let sd = self.deviations();
        let n = sd.len();
        DMatrix::from_fn(n, n, |i, j| match sd[i] * sd[j] > 0.0 {
            true => (self.matrix[(i, j)] / (sd[i] * sd[j])).clamp(-1.0, 1.0),
            false => f64::from(i == j),
        })
    }

    /// The signals whose noise [wanders](Autoregression::wanders) in the model of the noise that was used.
    pub fn wandering(&self) -> Vec<usize> {
        let processes = self.model.get().map_or(&[][..], |own| &own.processes);
        let all = processes.iter().enumerate();
        all.filter(|(_, own)| own.wanders())
            .map(|(k, _)| k)
            .collect()
    }

    /// Variance of a quantity with this gradient over the shared parameters (delta method), and the smallest degrees of
    /// freedom of the parameters involved.
    pub fn along(&self, gradient: &DVector<f64>) -> (f64, f64) {
        along(&self.matrix, &self.degrees, gradient)
    }
}

impl Inference<'_> {
    /// The covariance by a method. Without one: [`Method::Cr3`] from [`ENOUGH_RUNS`] runs on if no parameter depends on
    /// a single run, otherwise [`Method::Ar`].
    ///
    /// # Errors
    /// If the given method yields no covariance: [`Obstacle::FewRuns`], [`Obstacle::Negative`].
    pub fn covariance(&self, method: Option<Method>) -> Result<Covariance, Obstacle> {
        match method {
            None if self.data.runs.len() < ENOUGH_RUNS => self.by(Method::Ar),
            None => self.by(Method::Cr3).or_else(|_| self.by(Method::Ar)),
            Some(method) => self.by(method),
        }
    }

    fn by(&self, method: Method) -> Result<Covariance, Obstacle> {
        let model = OnceLock::new();
        let mut matrix = match method {
            Method::Plain | Method::Ar => self.modelled(model.get_or_init(|| self.model(method))),
            Method::Sidpac => self.over_parameters(&self.sandwiched(&self.sidpac_meat())),
            Method::Cr3 => self.over_parameters(&self.jackknife()?),
        };
        if matrix.diagonal().iter().any(|variance| *variance < 0.0) {
            return Err(Obstacle::Negative);
        }
        let p = matrix.nrows();
        let mut found = Covariance {
            degrees: match method {
                Method::Cr3 => vec![self.data.runs.len() as f64 - 1.0; p],
                Method::Plain | Method::Sidpac => vec![self.degrees(); p],
                Method::Ar => self.degrees_left(model.get_or_init(|| self.model(method))),
            },
            methods: vec![method; p],
            correlated_by: method,
            method,
            matrix: DMatrix::zeros(0, 0),
            model,
        };
        if method == Method::Cr3 {
            self.mend(&mut matrix, &mut found);
        }
        found.matrix = matrix;
        Ok(found)
    }

    /// The model of the noise that a method uses.
    fn model(&self, method: Method) -> Model {
        let processes = match method {
            Method::Plain => self.white(),
            Method::Sidpac | Method::Ar | Method::Cr3 => self.coloured(),
        };
        let white: Processes = processes.iter().map(Autoregression::white).collect();
        Model {
            meat: self.meat(&processes),
            white_meat: self.meat(&white),
            processes,
            white,
        }
    }

    /// Covariance of the shared parameters by a model of the noise.
    fn modelled(&self, model: &Model) -> DMatrix<f64> {
        self.over_parameters(&self.sandwiched(&model.meat))
    }

    /// Degrees of freedom of Student's t: number of values minus unknowns. Coloured noise counts as the number of
    /// values for which white noise of its variance has the same standard deviation.
    fn degrees_left(&self, model: &Model) -> Vec<f64> {
        let coloured = self.modelled(model);
        let white = self.over_parameters(&self.sandwiched(&model.white_meat));
        let count = (self.data.residuals(), self.determined);
        let of = |i: usize| left([white[(i, i)], coloured[(i, i)]], count);
        (0..coloured.nrows()).map(of).collect()
    }

    fn over_parameters(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        &self.all.free * covariance * self.all.free.transpose()
    }

    /// Uses the noise model's variance for parameters that few runs inform about, and its correlations if there are too
    /// few runs for the rank of the sandwich.
    fn mend(&self, matrix: &mut DMatrix<f64>, found: &mut Covariance) {
        let (p, all) = (matrix.nrows(), self.data.runs.len());
        let informing: Vec<usize> = (0..p).map(|i| self.informing_runs(i)).collect();
        let is_informed = |i: usize| informing[i] >= ENOUGH_RUNS.min(all);
        found.degrees = informing
            .iter()
            .map(|runs| (*runs as f64 - 1.0).max(1.0))
            .collect();
        if (0..p).all(is_informed) && all > self.hessian.nrows() {
            return;
        }
        let model = found.model.get_or_init(|| self.model(Method::Ar));
        let (other, degrees) = (self.modelled(model), self.degrees_left(model));
        let mut scale = vec![1.0; p];
        for i in 0..p {
            if !is_informed(i) {
                (found.methods[i], found.degrees[i]) = (Method::Ar, degrees[i]);
            } else if other[(i, i)] > 0.0 {
                scale[i] = (matrix[(i, i)] / other[(i, i)]).sqrt();
            }
        }
        found.correlated_by = Method::Ar;
        *matrix = DMatrix::from_fn(p, p, |i, j| scale[i] * other[(i, j)] * scale[j]);
    }

    /// Number of runs that inform about a parameter.
    fn informing_runs(&self, parameter: usize) -> usize {
        let effects = self
            .data
            .runs
            .iter()
            .map(|run| run.shared.column(parameter).norm());
        let effects: Vec<f64> = effects.collect();
        let most = effects.iter().copied().fold(0.0, f64::max);
        effects.iter().filter(|own| **own > INFORMS * most).count()
    }

    /// Covariance of the shared parameters and a run's own unknowns.
    ///
    /// # Panics
    /// If there is no such run.
    pub fn joint(&self, covariance: &Covariance, run: usize) -> Joint {
        let model = covariance
            .model
            .get_or_init(|| self.model(covariance.method));
        let matrix = self.joint_by(&model.processes, &model.meat, run);
        let whitened = self.joint_by(&model.white, &model.white_meat, run);
        let p = self.data.parameters();
        // The level of the noise is estimated from all runs, also where only one informs about an unknown.
        let count = (self.data.residuals(), self.determined);
        let of_own = (p..matrix.nrows()).map(|i| left([whitened[(i, i)], matrix[(i, i)]], count));
        Joint {
            degrees: covariance.degrees.iter().copied().chain(of_own).collect(),
            matrix,
        }
    }

    fn joint_by(
        &self,
        processes: &[Autoregression],
        meat: &DMatrix<f64>,
        run: usize,
    ) -> DMatrix<f64> {
        let own = &self.all.runs[run];
        // Effect of the run's residuals on the shared coordinates, and of these on its own unknowns.
        let effect = &self.inverse * own.projected.transpose();
        let follows = &own.follows - &own.inverse * &own.shared;
        let stacked = |above: DMatrix<f64>, below: DMatrix<f64>| {
            let (p, m) = (above.nrows(), below.nrows());
            let mut all = above.resize_vertically(p + m, 0.0);
            all.rows_mut(p, m).copy_from(&below);
            all
        };
        let by_run = stacked(&self.all.free * &effect, &own.inverse + &follows * &effect);
        let by_shared = stacked(self.all.free.clone(), follows);
        let coloured = self.coloured_rows(run, &by_run.transpose(), processes);
        let others = self.sandwiched(&(meat - self.run_meat(run, processes)));
        coloured.tr_mul(&coloured) + &by_shared * others * by_shared.transpose()
    }
}

/// Covariance of the shared parameters, followed by one run's own unknowns, by the model of the noise: the jackknife
/// does not apply to what only one run determines.
#[derive(Debug, Clone)]
pub struct Joint {
    /// (p + m) × (p + m).
    pub matrix: DMatrix<f64>,
    /// Degrees of freedom of Student's t for each entry.
    pub degrees: Vec<f64>,
}

impl Joint {
    /// Variance of a quantity with this gradient (delta method), and the smallest degrees of freedom of the entries
    /// involved.
    pub fn along(&self, gradient: &DVector<f64>) -> (f64, f64) {
        along(&self.matrix, &self.degrees, gradient)
    }
}

fn along(matrix: &DMatrix<f64>, degrees: &[f64], gradient: &DVector<f64>) -> (f64, f64) {
    let parts = gradient.iter().zip(degrees).filter(|(g, _)| **g != 0.0);
    let least = parts.map(|(_, own)| *own).fold(f64::INFINITY, f64::min);
    (gradient.dot(&(matrix * gradient)).max(0.0), least)
}

/// Degrees of freedom left by this many values and unknowns, given the variance with white noise and the actual one.
fn left([white, coloured]: [f64; 2], (values, unknowns): (usize, usize)) -> f64 {
    let part = if coloured > 0.0 {
        (white / coloured).min(1.0)
    } else {
        1.0
    };
    (part * values as f64 - unknowns as f64).max(1.0)
}
