//! Sampled loops as in a co-simulation: the parts hold their inputs during a communication step.

use super::margins::{Margins, Response};
use super::modes::{eigenvalues, exponential};
use super::state_space::{AlgebraicLoop, StateSpace, Wire, transfer};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;

/// Parts in discrete time, coupled by Jacobi's scheme: at `t_k` every part receives the outputs of the others at `t_k`
/// and holds them until `t_{k+1} = t_k + h`.
///
/// ```text
/// x_{k+1} = Φ x_k + Γ u_k        y_{k+1} = C x_{k+1} + D u_k        u_k = K y_k + w_k
/// ```
///
/// Its state consists of `x_k` and the inputs of the last step, `u_{k-1}`, which direct feedthrough still shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    system: StateSpace,
    step: f64,
}

impl Sampled {
    /// Samples parts placed [side by side](StateSpace::side_by_side), in steps of `step` \[s\]: `Φ = e^(A h)`,
    /// `Γ = ∫ e^(A t) dt B`, both from one exponential (C. F. Van Loan, IEEE Trans. Automatic Control 23(3), 1978). If
    /// the exponential would have no correct digits (`|A h|` above 1e8), all poles are infinite.
    ///
    /// # Panics
    /// If the step is not a number above 0.
    pub fn new(parts: &StateSpace, step: f64) -> Self {
        assert!(step > 0.0 && step.is_finite(), "a step above 0");
        let (n, m) = (parts.states.len(), parts.inputs.len());
        let mut exponent = DMatrix::zeros(n + m, n + m);
        exponent.view_mut((0, 0), (n, n)).copy_from(&parts.a);
        exponent.view_mut((0, n), (n, m)).copy_from(&parts.b);
        let unknown = || DMatrix::from_element(n + m, n + m, f64::NAN);
        let exponential = exponential(&(exponent * step)).unwrap_or_else(unknown);
        let mut a = DMatrix::zeros(n + m, n + m);
        a.view_mut((0, 0), (n, n))
            .copy_from(&exponential.view((0, 0), (n, n)));
        let mut b = DMatrix::zeros(n + m, m);
        b.view_mut((0, 0), (n, m))
            .copy_from(&exponential.view((0, n), (n, m)));
        b.view_mut((n, 0), (m, m)).fill_with_identity();
        let mut c = DMatrix::zeros(parts.outputs.len(), n + m);
        c.view_mut((0, 0), parts.c.shape()).copy_from(&parts.c);
        c.view_mut((0, n), parts.d.shape()).copy_from(&parts.d);
        let held = parts.inputs.iter().map(|input| format!("{input} (held)"));
        Self {
            system: StateSpace {
                a,
                b,
                c,
                d: DMatrix::zeros(parts.outputs.len(), m),
                states: parts.states.iter().cloned().chain(held).collect(),
                inputs: parts.inputs.clone(),
                outputs: parts.outputs.clone(),
            },
            step,
        }
    }

    /// Communication step \[s\].
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Poles of the wired parts, expressed as those of a continuous-time system with the same values at the
    /// communication points: `s = ln z / h` [1/s]. Poles at `z = 0`, which decay within a step, are omitted.
    ///
    /// # Errors
    /// As [`StateSpace::closed`], but never for an algebraic loop, since held inputs close none.
    pub fn poles(&self, wires: &[Wire]) -> Result<Vec<Complex<f64>>, AlgebraicLoop> {
        let alive = |z: &Complex<f64>| z.norm() > 1e-12;
        let poles = eigenvalues(&self.system.closed(wires)?.a).into_iter();
        let mut poles: Vec<_> = (poles.filter(alive)).map(|z| z.ln() / self.step).collect();
        poles.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        Ok(poles)
    }

    /// Response and margins of the loop at a wire, as in [`StateSpace::margins`], up to the Nyquist frequency `π/h`.
    ///
    /// # Errors
    /// As [`poles`](Self::poles).
    ///
    /// # Panics
    /// If there is no wire with that number.
    pub fn margins(
        &self,
        wires: &[Wire],
        cut: usize,
    ) -> Result<(Response, Margins), AlgebraicLoop> {
        let open = self.system.open_loop(wires, cut)?;
        let evaluate = |omega| transfer(&open, 0, 0, Complex::new(0.0, omega * self.step).exp());
        let mut others = wires.to_vec();
        others.remove(cut);
        let mut poles = self.poles(&others)?;
        poles.extend(self.poles(wires)?);
        let response = Response::of(evaluate, &poles, Some(PI / self.step));
        let highest = PI / self.step;
        let margins = Margins::of(&response, evaluate)
            .with_steady(&response, evaluate)
            .with_end(highest, evaluate(highest));
        Ok((response, margins))
    }
}
