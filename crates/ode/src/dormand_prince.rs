//! The explicit Runge–Kutta method of order 5(4) of Dormand and Prince ("A family of embedded Runge-Kutta
//! formulae", J. Comput. Appl. Math. 6(1), 1980) with its dense output of order 4 and the detection of
//! stiffness, both after Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, sections
//! II.6 and IV.2 of volume II.

use super::{Attempt, Dynamics, Scale};
use pilotage_kit::integrate::{A, C, E};

const STAGES: usize = 7;

/// The dense output's last term.
const D: [f64; STAGES] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// The method and its memory of the last step.
#[derive(Debug)]
pub(super) struct DormandPrince {
    k: [Vec<f64>; STAGES],
    /// Argument of the sixth stage, then of the seventh.
    argument: Vec<f64>,
    sixth: Vec<f64>,
    dense: [Vec<f64>; 5],
    /// How many of the last steps looked stiff, and how many since then did not.
    stiff: u32,
    relaxed: u32,
}

impl DormandPrince {
    pub(super) fn new(n: usize) -> Self {
        Self {
            k: std::array::from_fn(|_| vec![0.0; n]),
            argument: vec![0.0; n],
            sixth: vec![0.0; n],
            dense: std::array::from_fn(|_| vec![0.0; n]),
            stiff: 0,
            relaxed: 0,
        }
    }

    /// Tries a step of length `h` from `(t, x)`, where the derivative is `f`; gives the state at its end,
    /// and the derivative there.
    #[expect(
        clippy::too_many_arguments,
        reason = "the step's two ends and what measures it"
    )]
    pub(super) fn attempt<D: Dynamics>(
        &mut self,
        system: &mut D,
        t: f64,
        h: f64,
        x: &[f64],
        f: &[f64],
        end: (&mut [f64], &mut [f64]),
        scale: &Scale,
    ) -> Result<Attempt, D::Error> {
        let n = x.len();
        self.k[0].copy_from_slice(f);
        for stage in 1..STAGES {
            for i in 0..n {
                let row = A[stage].iter().zip(&self.k);
                let sum: f64 = row.take(stage).map(|(a, k)| a * k[i]).sum();
                self.argument[i] = x[i] + h * sum;
            }
            if stage == 5 {
                self.sixth.copy_from_slice(&self.argument);
            }
            let at = t + C[stage] * h;
            if !system.derivatives(at, &self.argument, &mut self.k[stage])? {
                return Ok(Attempt::Impossible);
            }
        }
        let (to, derivative) = end;
        to.copy_from_slice(&self.argument);
        derivative.copy_from_slice(&self.k[STAGES - 1]);
        let error = |i: usize| -> f64 {
            let parts = E.iter().zip(&self.k);
            h * parts.map(|(e, k)| e * k[i]).sum::<f64>()
        };
        let error = scale.norm((0..n).map(error), x, to);
        Ok(match error.is_finite() {
            true => Attempt::Error(error),
            false => Attempt::Impossible,
        })
    }

    /// Takes the attempted step from `x` to `to` as done; says whether the problem has come to look stiff.
    pub(super) fn accept(&mut self, h: f64, x: &[f64], to: &[f64]) -> bool {
        for i in 0..x.len() {
            let difference = to[i] - x[i];
            let begin = h * self.k[0][i] - difference;
            let end = difference - h * self.k[STAGES - 1][i] - begin;
            let last: f64 = D.iter().zip(&self.k).map(|(d, k)| d * k[i]).sum();
            let terms = [x[i], difference, begin, end, h * last];
            for (dense, term) in self.dense.iter_mut().zip(terms) {
                dense[i] = term;
            }
        }
        self.looks_stiff(h, to)
    }

    /// Whether the method's stability, not its accuracy, has limited the last steps: `h·|λ|` is at its
    /// border of about 3.3.
    fn looks_stiff(&mut self, h: f64, to: &[f64]) -> bool {
        const BORDER: f64 = 3.25;
        let distance =
            |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum() };
        let change = distance(&self.k[6], &self.k[5]);
        let shift = distance(to, &self.sixth);
        if shift > 0.0 && h * (change / shift).sqrt() > BORDER {
            self.relaxed = 0;
            self.stiff += 1;
        } else {
            self.relaxed += 1;
            if self.relaxed == 6 {
                self.stiff = 0;
            }
        }
        self.stiff >= 15
    }

    /// The state at the fraction `theta` of the last step.
    pub(super) fn interpolate(&self, theta: f64, x: &mut [f64]) {
        let rest = 1.0 - theta;
        let [a, b, c, d, e] = &self.dense;
        for (i, x) in x.iter_mut().enumerate() {
            *x = a[i] + theta * (b[i] + rest * (c[i] + theta * (d[i] + rest * e[i])));
        }
    }
}
