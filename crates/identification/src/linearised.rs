//! A model linearised about zero: `ẋ = A x + B w`, `y = C x`.

use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use pilotage_collocation::Differentiated;
use pilotage_models::lti::Transition;

/// The linear system.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    /// A, states × states.
    pub a: DMatrix<f64>,
    /// B, states × inputs.
    pub b: DMatrix<f64>,
    /// C, a row over the states.
    pub c: Vec<f64>,
}

impl Linear {
    /// Linearises a model and its first output at zero time, states and inputs, by dual numbers.
    pub fn of(model: &Differentiated, theta: &[f64]) -> Self {
        let (n, m) = (model.n_states(), model.n_inputs());
        let theta: Vec<Dual64> = theta.iter().map(|&t| t.into()).collect();
        let (mut a, mut b, mut c) = (DMatrix::zeros(n, n), DMatrix::zeros(n, m), vec![0.0; n]);
        for column in 0..n + m {
            let mut at = vec![Dual64::from(0.0); n + m];
            at[column].eps = 1.0;
            let (x, w) = at.split_at(n);
            let all = model.evaluate(Dual64::from(0.0), x, w, &theta);
            let dx = all[..n].iter().map(|dx| dx.eps);
            match column.checked_sub(n) {
                Some(input) => b.set_column(input, &DVector::from_iterator(n, dx)),
                None => {
                    a.set_column(column, &DVector::from_iterator(n, dx));
                    c[column] = all[n].eps;
                }
            }
        }
        Self { a, b, c }
    }

    /// The same system with an additional input for each of these states, which is added to its derivative.
    pub fn driven(self, states: &[usize]) -> Self {
        let m = self.b.ncols();
        let mut b = self.b.resize_horizontally(m + states.len(), 0.0);
        for (k, &state) in states.iter().enumerate() {
            b[(state, m + k)] = 1.0;
        }
        Self { b, ..self }
    }

    /// `A x + B w`.
    pub fn derivative(&self, x: &[f64], w: &[f64]) -> Vec<f64> {
        let of = |m: &DMatrix<f64>, row: usize, v: &[f64]| -> f64 {
            v.iter().enumerate().map(|(j, v)| m[(row, j)] * v).sum()
        };
        let rows = 0..self.a.nrows();
        rows.map(|row| of(&self.a, row, x) + of(&self.b, row, w))
            .collect()
    }

    /// The transition over one step; `None` if it cannot be computed.
    pub fn transition(&self, h: f64) -> Option<Transition> {
        let size = [self.a.nrows(), self.b.ncols()];
        let derivative =
            |x: &[f64], w: &[f64], dx: &mut [f64]| dx.copy_from_slice(&self.derivative(x, w));
        Transition::new(size, h, derivative).ok()
    }

    /// The outputs at `count` samples for each unit initial state: `C Φ^k`.
    pub fn responses(&self, transition: &Transition, count: usize) -> Vec<Vec<f64>> {
        let n = self.c.len();
        let no_input = vec![0.0; self.b.ncols()];
        let column = |j: usize| {
            let (mut unit, mut phi) = (vec![0.0; n], vec![0.0; n]);
            unit[j] = 1.0;
            transition.apply(&unit, &no_input, &no_input, &mut phi);
            phi
        };
        let phi: Vec<Vec<f64>> = (0..n).map(column).collect();
        let mut rows = vec![self.c.clone()];
        while rows.len() < count {
            let last = &rows[rows.len() - 1];
            rows.push(phi.iter().map(|column| dot(last, column)).collect());
        }
        rows
    }
}

/// The scalar product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
