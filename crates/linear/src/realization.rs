//! Identification of a linear system from its responses: the eigensystem realization algorithm.

use super::modes::exponential;
use super::state_space::StateSpace;
use super::svd::{Svd, svd};
use nalgebra::DMatrix;
use thiserror::Error;

/// A system identified from responses.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// The system in continuous time; its state coordinates have no physical meaning.
    pub system: StateSpace,
    /// The Hankel matrix's singular values relative to the largest: as many as the order, and the next one, which
    /// counts as noise.
    pub singular_values: Vec<f64>,
}

/// Why no continuous-time system was found for the responses.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RealizationError {
    /// A response is not finite.
    #[error(
        "its `{output}` is {value} after a pulse of `{input}`, so that nothing can be found of its states; run \
         it to a time at which it is finite"
    )]
    NotFinite {
        /// The output.
        output: String,
        /// The input with the pulse.
        input: String,
        /// The value of the response.
        value: f64,
    },
    /// The order cannot be determined: the singular values do not fall to a noise level.
    #[error(
        "its responses over {steps} steps look like more than {order} states, or are too noisy to tell; \
         try another step"
    )]
    Order {
        /// Number of steps of each response.
        steps: usize,
        /// Largest order that can be distinguished from noise with that many steps.
        order: usize,
    },
    /// A pole in discrete time has no logarithm.
    #[error(
        "in steps of {step} s it has modes that die within one or turn by half a turn in one, so that \
         nothing is known of them between the steps; take a shorter step"
    )]
    Logarithm {
        /// The step \[s\].
        step: f64,
    },
}

/// Singular values below this fraction of the largest never count as states.
const ROUNDING: f64 = 1e-11;

/// Factor by which the singular values of states exceed the noise level, taken from the middle singular value.
const ABOVE_NOISE: f64 = 100.0;

/// Maximum number of rows and columns of the Hankel matrix.
const LARGEST: usize = 240;

/// Maximum number of steps of a response.
const LONGEST: usize = 80;

/// Number of steps for which the response to each pulse is needed.
pub fn steps_needed(inputs: usize, outputs: usize) -> usize {
    let blocks = (LARGEST / inputs.max(outputs).max(1)).clamp(2, LONGEST / 2);
    2 * blocks + 1
}

/// Identifies a system from pulse responses. `pulses` holds the outputs after each step; each column is the response to
/// a pulse of one input with height 1 in the first step and 0 afterwards. An output depends on the input of the
/// previous step: `y_1 = (C Γ + D) u`, `y_i = C Φ^(i-1) Γ u`.
///
/// The minimal `Φ`, `Γ`, `C` follow from the singular values of the Hankel matrix of the sequence (J.-N. Juang, R. S.
/// Pappa, "An eigensystem realization algorithm for modal parameter identification and model reduction", J. Guidance
/// 8(5), 1985). The order is the number of singular values above the noise. The matrix logarithm gives the
/// continuous-time system, for inputs that are held during a step of `step` \[s\].
///
/// # Errors
/// If a response is not finite, the order cannot be determined, or there is no logarithm.
///
/// # Panics
/// If there are fewer than [`steps_needed`] steps, a response has another shape, or the step is not a number above 0.
pub fn realize(
    pulses: &[DMatrix<f64>],
    step: f64,
    inputs: Vec<String>,
    outputs: Vec<String>,
) -> Result<Realization, RealizationError> {
    let (p, m) = (outputs.len(), inputs.len());
    assert!(pulses.len() >= steps_needed(m, p));
    assert!(step > 0.0 && step.is_finite(), "a step of {step} s");
    assert!(
        pulses.iter().all(|y| y.shape() == (p, m)),
        "responses of {p} outputs to {m} inputs"
    );
    check_finite(pulses, &inputs, &outputs)?;
    let scales = Scales::of(pulses);
    let scaled: Vec<DMatrix<f64>> = pulses.iter().map(|y| scales.apply(y)).collect();
    let blocks = (pulses.len() - 1) / 2;
    let hankel = |first: usize| {
        DMatrix::from_fn(blocks * p, blocks * m, |i, j| {
            scaled[first + i / p + j / m][(i % p, j % m)]
        })
    };
    // The Hankel matrix starts at the second step: the first one includes direct feedthrough.
    let (rows, columns) = (blocks * p, blocks * m);
    let found = svd(&hankel(1));
    // If the rotations do not converge, the responses are treated as noise.
    let unclear = RealizationError::Order {
        steps: pulses.len(),
        order: rows.min(columns) / 2,
    };
    let Some(Svd { u, singular, v }) = found else {
        return Err(unclear);
    };
    let largest = singular.iter().copied().fold(0.0, f64::max);
    let most = singular.len() / 2;
    let noise = singular.get(most).copied().unwrap_or(0.0);
    let floor = (ABOVE_NOISE * noise).max(ROUNDING * largest);
    let n = singular.iter().filter(|&&value| value > floor).count();
    if n >= most && n > 0 || n == 0 && noise > 0.0 {
        return Err(unclear);
    }
    let root = DMatrix::from_diagonal(&singular.rows(0, n).map(f64::sqrt));
    let inverse = DMatrix::from_diagonal(&singular.rows(0, n).map(|value| 1.0 / value.sqrt()));
    let (u, v) = (u.columns(0, n), v.columns(0, n));
    let phi = &inverse * u.transpose() * hankel(2) * v * &inverse;
    let c = (u.rows(0, p) * &root).into_owned();
    // The sequence begins with C Φ Γ.
    let phi_gamma = &root * v.rows(0, m).transpose();
    let no_logarithm = RealizationError::Logarithm { step };
    let (a, b, gamma) = match n {
        0 => (phi, phi_gamma.clone(), phi_gamma),
        _ => {
            let gamma = phi.clone().lu().solve(&phi_gamma);
            let gamma = gamma.ok_or_else(|| no_logarithm.clone())?;
            let (a, b) = continuous(&phi, &gamma, step).ok_or(no_logarithm)?;
            (a, b, gamma)
        }
    };
    let d = &scaled[0] - &c * &gamma;
    let rounding = 1e-7 * scaled[0].amax();
    let d = d.map(|value| if value.abs() > rounding { value } else { 0.0 });
    Ok(Realization {
        system: StateSpace {
            b: scales.undo_inputs(&b),
            c: scales.undo_outputs(&c),
            d: scales.undo_inputs(&scales.undo_outputs(&d)),
            a,
            states: (1..=n).map(|k| format!("found{k}")).collect(),
            inputs,
            outputs,
        },
        singular_values: (singular.iter().take(n + 1))
            .map(|value| value / largest.max(f64::MIN_POSITIVE))
            .collect(),
    })
}

fn check_finite(
    pulses: &[DMatrix<f64>],
    inputs: &[String],
    outputs: &[String],
) -> Result<(), RealizationError> {
    let entries = pulses.iter().flat_map(|y| y.iter().enumerate());
    let mut strange = entries.filter(|(_, value)| !value.is_finite());
    // Entries are ordered column by column.
    match strange.next() {
        None => Ok(()),
        Some((at, &value)) => Err(RealizationError::NotFinite {
            output: outputs[at % outputs.len()].clone(),
            input: inputs[at / outputs.len()].clone(),
            value,
        }),
    }
}

/// Largest response of each output, then of each input, so that units do not determine what counts as noise.
struct Scales {
    outputs: Vec<f64>,
    inputs: Vec<f64>,
}

impl Scales {
    fn of(pulses: &[DMatrix<f64>]) -> Self {
        let (p, m) = pulses[0].shape();
        let positive = |value: f64| if value > 0.0 { value } else { 1.0 };
        let largest = |of: &dyn Fn(&DMatrix<f64>) -> f64| pulses.iter().map(of).fold(0.0, f64::max);
        let outputs: Vec<f64> = (0..p)
            .map(|i| positive(largest(&|y| y.row(i).amax())))
            .collect();
        let of_column = |j: usize| {
            largest(&|y| {
                let column = y.column(j);
                let relative = column
                    .iter()
                    .zip(&outputs)
                    .map(|(value, scale)| value.abs() / scale);
                relative.fold(0.0, f64::max)
            })
        };
        let inputs = (0..m).map(|j| positive(of_column(j))).collect();
        Self { outputs, inputs }
    }

    fn apply(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = |i, j| y[(i, j)] / (self.outputs[i] * self.inputs[j]);
        DMatrix::from_fn(y.nrows(), y.ncols(), scaled)
    }

    fn undo_outputs(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            matrix[(i, j)] * self.outputs[i]
        })
    }

    fn undo_inputs(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            matrix[(i, j)] * self.inputs[j]
        })
    }
}

/// `A` and `B` of `Φ = e^(A h)`, `Γ = ∫ e^(A t) dt B`: the logarithm of `[Φ Γ; 0 I]`.
fn continuous(
    phi: &DMatrix<f64>,
    gamma: &DMatrix<f64>,
    step: f64,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let (n, m) = gamma.shape();
    let mut all = DMatrix::identity(n + m, n + m);
    all.view_mut((0, 0), (n, n)).copy_from(phi);
    all.view_mut((0, n), (n, m)).copy_from(gamma);
    let logarithm = logarithm(all.clone())?;
    // Checks that this is a logarithm of the matrix.
    let back = (exponential(&logarithm)? - &all).amax();
    let is_right = back <= 1e-9 * all.amax();
    is_right.then(|| {
        let part = |column, width| logarithm.view((0, column), (n, width)) / step;
        (part(0, n), part(n, m))
    })
}

/// The principal logarithm by inverse scaling and squaring: square roots (E. D. Denman, A. N. Beavers, "The matrix sign
/// function and computations in systems", Appl. Math. Comput. 2(1), 1976) until the matrix is near the identity, then
/// the series of `2 artanh((X - I)(X + I)⁻¹)`. `None` if a real eigenvalue is not positive.
fn logarithm(mut x: DMatrix<f64>) -> Option<DMatrix<f64>> {
    const MAX_ROOTS: i32 = 40;
    const NEAR: f64 = 0.1;
    const TERMS: i32 = 12;
    let one = DMatrix::identity(x.nrows(), x.ncols());
    let mut roots = 0;
    while (&x - &one).amax() > NEAR {
        roots += 1;
        if roots > MAX_ROOTS {
            return None;
        }
        x = square_root(x)?;
    }
    let z = (&x + &one).lu().solve(&(&x - &one))?;
    let square = &z * &z;
    let (mut power, mut sum) = (z.clone(), z);
    for k in 1..TERMS {
        power = &power * &square;
        sum += &power / f64::from(2 * k + 1);
    }
    Some(sum * 2.0_f64.powi(roots + 1))
}

fn square_root(x: DMatrix<f64>) -> Option<DMatrix<f64>> {
    const MAX_STEPS: usize = 60;
    let (mut y, mut z) = (x.clone(), DMatrix::identity(x.nrows(), x.ncols()));
    for _ in 0..MAX_STEPS {
        let next = 0.5 * (&y + z.clone().try_inverse()?);
        z = 0.5 * (&z + y.clone().try_inverse()?);
        let change = (&next - &y).amax();
        y = next;
        if change <= 4.0 * f64::EPSILON * y.amax() {
            break;
        }
    }
    // Without a root, the iteration does not converge.
    let is_root = (&y * &y - &x).amax() <= 1e-10 * x.amax();
    is_root.then_some(y)
}
