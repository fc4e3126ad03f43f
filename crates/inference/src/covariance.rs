//! Covariances of the parameters.

use crate::autoregression::Autoregression;
use crate::inference::{Inference, Obstacle};
use crate::meat::Processes;
use nalgebra::{DMatrix, DVector};
use std::fmt;
use std::sync::OnceLock;

/// Runs from which on leaving out one at a time tells more than a model of the noise.
pub const ENOUGH_RUNS: usize = 4;
/// Part of the largest effect on a run from which on it tells of a parameter.
const TELLS: f64 = 1e-6;

/// How residuals become a covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// `s² H⁻¹`: for white residuals.
    Plain,
    /// `H⁻¹ Σ J_iᵀ R(i - j) J_j H⁻¹` with the residuals' autocorrelations (Morelli & Klein, J. Aircr. 34, 1997).
    Sidpac,
    /// The same with an autoregressive process for each signal, without the bias that the fit leaves in residuals.
    Ar,
    /// The jackknife over runs: nothing is said of the noise but that runs share none.
    Cr3,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Plain, Self::Sidpac, Self::Ar, Self::Cr3];

    /// One word, as on the command line.
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

/// A model of the noise, and what it makes of the score; the same with white noise of the same variances.
#[derive(Debug, Clone)]
struct Model {
    processes: Processes,
    meat: DMatrix<f64>,
    white: Processes,
    white_meat: DMatrix<f64>,
}

/// A covariance of the shared parameters, and what intervals need.
#[derive(Debug, Clone)]
pub struct Covariance {
    /// How it was computed.
    pub method: Method,
    /// p × p; zero for what constraints hold, without the directions that the data leave open. It has full rank in what
    /// is determined: where runs are too few for that, correlations are those of [`Method::Ar`].
    pub matrix: DMatrix<f64>,
    /// Whose correlations they are.
    pub correlated_by: Method,
    /// Degrees of freedom of Student's t for each parameter.
    pub degrees: Vec<f64>,
    /// Method behind the variance of each parameter: [`Method::Ar`] for those that fewer runs tell than [`Method::Cr3`]
    /// asks for.
    pub methods: Vec<Method>,
    /// The model of the noise, once it is asked for.
    model: OnceLock<Model>,
}

impl Covariance {
    /// Standard deviations.
    pub fn deviations(&self) -> Vec<f64> {
        self.matrix.diagonal().iter().map(|v| v.sqrt()).collect()
    }

    /// Correlations; zero beside what has no variance.
    pub fn correlations(&self) -> DMatrix<f64> {
        let sd = self.deviations();
        let n = sd.len();
        DMatrix::from_fn(n, n, |i, j| match sd[i] * sd[j] > 0.0 {
            true => (self.matrix[(i, j)] / (sd[i] * sd[j])).clamp(-1.0, 1.0),
            false => f64::from(i == j),
        })
    }

    /// Variance of what has this gradient over the shared parameters (delta method), and the least degrees of freedom of
    /// what it takes part of.
    pub fn along(&self, gradient: &DVector<f64>) -> (f64, f64) {
        along(&self.matrix, &self.degrees, gradient)
    }
}

impl Inference<'_> {
    /// The covariance by a method; without one, [`Method::Cr3`] from [`ENOUGH_RUNS`] runs on where none of them alone
    /// tells a parameter, and [`Method::Ar`] else.
    ///
    /// # Errors
    /// Where a method that was named does not give one: [`Obstacle::FewRuns`], [`Obstacle::Negative`].
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

    /// The model of the noise that goes with a method.
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

    /// The covariance of the shared parameters by a model of the noise.
    fn modelled(&self, model: &Model) -> DMatrix<f64> {
        self.over_parameters(&self.sandwiched(&model.meat))
    }

    /// Degrees of freedom for Student's t: values less unknowns, of which a coloured noise leaves as many as white noise
    /// of its variance would need for the same standard deviation.
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

    /// Where few runs tell of a parameter, its variance is that of the model of the noise; where runs are too few for
    /// the rank of a sandwich, so are the correlations.
    fn mend(&self, matrix: &mut DMatrix<f64>, found: &mut Covariance) {
        let (p, all) = (matrix.nrows(), self.data.runs.len());
        let told: Vec<usize> = (0..p).map(|i| self.told_by(i)).collect();
        let is_told = |i: usize| told[i] >= ENOUGH_RUNS.min(all);
        found.degrees = told
            .iter()
            .map(|runs| (*runs as f64 - 1.0).max(1.0))
            .collect();
        if (0..p).all(is_told) && all > self.hessian.nrows() {
            return;
        }
        let model = found.model.get_or_init(|| self.model(Method::Ar));
        let (other, degrees) = (self.modelled(model), self.degrees_left(model));
        let mut scale = vec![1.0; p];
        for i in 0..p {
            if !is_told(i) {
                (found.methods[i], found.degrees[i]) = (Method::Ar, degrees[i]);
            } else if other[(i, i)] > 0.0 {
                scale[i] = (matrix[(i, i)] / other[(i, i)]).sqrt();
            }
        }
        found.correlated_by = Method::Ar;
        *matrix = DMatrix::from_fn(p, p, |i, j| scale[i] * other[(i, j)] * scale[j]);
    }

    /// How many runs tell of a parameter.
    fn told_by(&self, parameter: usize) -> usize {
        let effects = self
            .data
            .runs
            .iter()
            .map(|run| run.shared.column(parameter).norm());
        let effects: Vec<f64> = effects.collect();
        let most = effects.iter().copied().fold(0.0, f64::max);
        effects.iter().filter(|own| **own > TELLS * most).count()
    }

    /// The covariance of the shared parameters and a run's own unknowns.
    ///
    /// # Panics
    /// Where there is no such run.
    pub fn joint(&self, covariance: &Covariance, run: usize) -> Joint {
        let model = covariance
            .model
            .get_or_init(|| self.model(covariance.method));
        let matrix = self.joint_by(&model.processes, &model.meat, run);
        let whitened = self.joint_by(&model.white, &model.white_meat, run);
        let (p, own) = (self.data.parameters(), &self.data.runs[run]);
        let count = (own.residuals.len(), self.all.runs[run].basis.ncols());
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
        // What the run's residuals make of the shared coordinates, and these of its own unknowns.
        let told = &self.inverse * own.projected.transpose();
        let follows = &own.follows - &own.inverse * &own.shared;
        let stacked = |above: DMatrix<f64>, below: DMatrix<f64>| {
            let (p, m) = (above.nrows(), below.nrows());
            let mut all = above.resize_vertically(p + m, 0.0);
            all.rows_mut(p, m).copy_from(&below);
            all
        };
        let by_run = stacked(&self.all.free * &told, &own.inverse + &follows * &told);
        let by_shared = stacked(self.all.free.clone(), follows);
        let coloured = self.coloured_rows(run, &by_run.transpose(), processes);
        let others = self.sandwiched(&(meat - self.run_meat(run, processes)));
        coloured.tr_mul(&coloured) + &by_shared * others * by_shared.transpose()
    }
}

/// A covariance of shared parameters and one run's own unknowns behind them, by the model of the noise: what a run alone
/// tells no other run confirms.
#[derive(Debug, Clone)]
pub struct Joint {
    /// (p + m) × (p + m).
    pub matrix: DMatrix<f64>,
    /// Degrees of freedom of Student's t for each.
    pub degrees: Vec<f64>,
}

impl Joint {
    /// Variance of what has this gradient (delta method), and the least degrees of freedom of what it takes part of.
    pub fn along(&self, gradient: &DVector<f64>) -> (f64, f64) {
        along(&self.matrix, &self.degrees, gradient)
    }
}

fn along(matrix: &DMatrix<f64>, degrees: &[f64], gradient: &DVector<f64>) -> (f64, f64) {
    let parts = gradient.iter().zip(degrees).filter(|(g, _)| **g != 0.0);
    let least = parts.map(|(_, own)| *own).fold(f64::INFINITY, f64::min);
    (gradient.dot(&(matrix * gradient)).max(0.0), least)
}

/// Degrees of freedom that so many values and unknowns leave where the variance would be the first with white noise, and
/// is the second.
fn left([white, coloured]: [f64; 2], (values, unknowns): (usize, usize)) -> f64 {
    let part = if coloured > 0.0 {
        (white / coloured).min(1.0)
    } else {
        1.0
    };
    (part * values as f64 - unknowns as f64).max(1.0)
}
