//! Linear systems in state space: `ẋ = A x + B u`, `y = C x + D u`.

use nalgebra::{Complex, DMatrix, DVector};
use thiserror::Error;

/// A linear system with named signals. Values are deviations from the point of linearisation.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// From the states to their derivatives [1/s, times units].
    pub a: DMatrix<f64>,
    /// From the inputs to the derivatives of the states.
    pub b: DMatrix<f64>,
    /// From the states to the outputs.
    pub c: DMatrix<f64>,
    /// From the inputs to the outputs (direct feedthrough).
    pub d: DMatrix<f64>,
    /// Names of the states.
    pub states: Vec<String>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Names of the outputs.
    pub outputs: Vec<String>,
}

/// A connection: an input receives `factor` times an output, in addition to its external signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wire {
    /// Position of the output.
    pub output: usize,
    /// Position of the input.
    pub input: usize,
    /// Factor, for different units.
    pub factor: f64,
}

/// An entry of a linearisation is not finite.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the derivative of {of} with respect to `{by}` is {value} where it stands; linearise it where the model is \
     smooth: at another time, or with other start values or parameters"
)]
pub struct NotFinite {
    /// The quantity that is differentiated.
    pub of: String,
    /// The state or input with respect to which it is differentiated.
    pub by: String,
    /// Value of the entry.
    pub value: f64,
}

/// The connections close a loop of direct feedthrough that has no unique solution.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the connections close a loop of direct feedthrough that has no solution (det(I - D K) is 0), through {}",
    .through.join(", ")
)]
pub struct AlgebraicLoop {
    /// Names of the wired inputs.
    pub through: Vec<String>,
}

impl StateSpace {
    /// A system without states, inputs and outputs.
    pub fn empty() -> Self {
        Self {
            a: DMatrix::zeros(0, 0),
            b: DMatrix::zeros(0, 0),
            c: DMatrix::zeros(0, 0),
            d: DMatrix::zeros(0, 0),
            states: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
        }
    }

    /// The system with these names of states, inputs and outputs. `column(k)` returns the response to a unit change of
    /// the `k`-th variable: the derivatives of all states, then all outputs. The variables are the states, followed by
    /// the inputs.
    ///
    /// # Errors
    /// The first error of `column`.
    ///
    /// # Panics
    /// If a column has a different length.
    pub fn from_columns<E>(
        [states, inputs, outputs]: [Vec<String>; 3],
        column: impl FnMut(usize) -> Result<Vec<f64>, E>,
    ) -> Result<Self, E> {
        let (n, m, p) = (states.len(), inputs.len(), outputs.len());
        let columns: Vec<Vec<f64>> = (0..n + m).map(column).collect::<Result<_, E>>()?;
        assert!(columns.iter().all(|column| column.len() == n + p));
        let part = |row: usize, rows: usize, first: usize, width: usize| {
            DMatrix::from_fn(rows, width, |i, j| columns[first + j][row + i])
        };
        Ok(Self {
            a: part(0, n, 0, n),
            b: part(0, n, n, m),
            c: part(n, p, 0, n),
            d: part(n, p, n, m),
            states,
            inputs,
            outputs,
        })
    }

    /// Checks that all entries are finite, since results from others are meaningless.
    ///
    /// # Errors
    /// For the first entry that is not finite.
    pub fn check_finite(&self) -> Result<(), NotFinite> {
        let rate = |state: &String| format!("the rate of `{state}`");
        let output = |output: &String| format!("`{output}`");
        let rates: Vec<String> = self.states.iter().map(rate).collect();
        let outputs: Vec<String> = self.outputs.iter().map(output).collect();
        for (matrix, rows, columns) in [
            (&self.a, &rates, &self.states),
            (&self.b, &rates, &self.inputs),
            (&self.c, &outputs, &self.states),
            (&self.d, &outputs, &self.inputs),
        ] {
            // Entries are ordered column by column.
            if let Some(at) = matrix.iter().position(|value| !value.is_finite()) {
                let (row, column) = (at % matrix.nrows(), at / matrix.nrows());
                return Err(NotFinite {
                    of: rows[row].clone(),
                    by: columns[column].clone(),
                    value: matrix[(row, column)],
                });
            }
        }
        Ok(())
    }

    /// Several systems combined into one, without connections.
    pub fn side_by_side(parts: &[Self]) -> Self {
        let diagonal = |of: fn(&Self) -> &DMatrix<f64>| {
            let (rows, columns) = parts.iter().fold((0, 0), |(rows, columns), part| {
                (rows + of(part).nrows(), columns + of(part).ncols())
            });
            let mut whole = DMatrix::zeros(rows, columns);
            let mut at = (0, 0);
            for part in parts.iter().map(of) {
                // A part without rows may start beyond the last row, where nalgebra has no view.
                if !part.is_empty() {
                    whole.view_mut(at, part.shape()).copy_from(part);
                }
                at = (at.0 + part.nrows(), at.1 + part.ncols());
            }
            whole
        };
        let names = |of: fn(&Self) -> &Vec<String>| {
            parts.iter().flat_map(of).cloned().collect::<Vec<String>>()
        };
        Self {
            a: diagonal(|part| &part.a),
            b: diagonal(|part| &part.b),
            c: diagonal(|part| &part.c),
            d: diagonal(|part| &part.d),
            states: names(|part| &part.states),
            inputs: names(|part| &part.inputs),
            outputs: names(|part| &part.outputs),
        }
    }

    /// The system with outputs wired to inputs: `u = K y + w`, with `w` the external inputs. All inputs are kept, so
    /// that signals can still be added.
    ///
    /// ```text
    /// y = (I - D K)⁻¹ (C x + D w)        ẋ = A x + B (K y + w)
    /// ```
    ///
    /// # Errors
    /// If `I - D K` is singular.
    ///
    /// # Panics
    /// If a wire's output or input does not exist.
    pub fn closed(&self, wires: &[Wire]) -> Result<Self, AlgebraicLoop> {
        if self.outputs.is_empty() {
            return Ok(self.clone());
        }
        let mut k = DMatrix::zeros(self.inputs.len(), self.outputs.len());
        for wire in wires {
            k[(wire.input, wire.output)] += wire.factor;
        }
        let outputs = self.outputs.len();
        let at_once = (DMatrix::identity(outputs, outputs) - &self.d * &k).lu();
        let no_solution = || AlgebraicLoop {
            through: (wires.iter().map(|wire| self.inputs[wire.input].clone())).collect(),
        };
        let c = at_once.solve(&self.c).ok_or_else(no_solution)?;
        let d = at_once.solve(&self.d).ok_or_else(no_solution)?;
        let bk = &self.b * &k;
        Ok(Self {
            a: &self.a + &bk * &c,
            b: &self.b + &bk * &d,
            c,
            d,
            ..self.clone()
        })
    }

    /// The same system with only the given inputs, in this order.
    ///
    /// # Panics
    /// If an input does not exist.
    pub fn from_inputs(&self, inputs: &[usize]) -> Self {
        Self {
            b: self.b.select_columns(inputs),
            d: self.d.select_columns(inputs),
            inputs: inputs.iter().map(|&i| self.inputs[i].clone()).collect(),
            ..self.clone()
        }
    }

    /// The open loop at a wire, with one input and one output: the signal that returns to the cut, with its sign
    /// inverted, so that `1 + L = 0` is the closed loop. All other wires stay connected.
    ///
    /// # Errors
    /// If the other wires close an algebraic loop.
    ///
    /// # Panics
    /// If there is no wire with that number.
    pub fn open_loop(&self, wires: &[Wire], cut: usize) -> Result<Self, AlgebraicLoop> {
        let others = wires.iter().enumerate().filter(|(w, _)| *w != cut);
        let others: Vec<Wire> = others.map(|(_, wire)| *wire).collect();
        let open = self.closed(&others)?;
        let Wire {
            output,
            input,
            factor,
        } = wires[cut];
        Ok(Self {
            a: open.a,
            b: open.b.columns(input, 1).into_owned(),
            c: open.c.rows(output, 1) * -factor,
            d: open.d.view((output, input), (1, 1)) * -factor,
            states: open.states,
            inputs: vec![self.inputs[input].clone()],
            outputs: vec![self.outputs[output].clone()],
        })
    }

    /// The system without the states on which nothing acts and that act on nothing.
    #[must_use]
    pub fn without_idle_states(&self) -> Self {
        let is_idle = |k: usize| {
            let acts = self
                .a
                .column(k)
                .iter()
                .chain(self.c.column(k).iter())
                .any(|own| *own != 0.0);
            let is_moved = self
                .a
                .row(k)
                .iter()
                .chain(self.b.row(k).iter())
                .any(|own| *own != 0.0);
            !acts && !is_moved
        };
        let kept: Vec<usize> = (0..self.states.len()).filter(|k| !is_idle(*k)).collect();
        Self {
            a: self.a.select_rows(&kept).select_columns(&kept),
            b: self.b.select_rows(&kept),
            c: self.c.select_columns(&kept),
            states: kept.iter().map(|k| self.states[*k].clone()).collect(),
            ..self.clone()
        }
    }

    /// The poles, eigenvalues of `A` [1/s], sorted by magnitude, conjugates adjacent. Infinite if they cannot be
    /// computed, as for entries that are not finite.
    pub fn poles(&self) -> Vec<Complex<f64>> {
        super::modes::eigenvalues(&self.a)
    }

    /// The transfer from an input to an output at the complex frequency `s`: `C (s I - A)⁻¹ B + D`.
    /// Infinite at a pole.
    ///
    /// # Panics
    /// If the output or the input does not exist.
    pub fn transfer(&self, output: usize, input: usize, s: Complex<f64>) -> Complex<f64> {
        transfer(self, output, input, s)
    }
}

impl StateSpace {
    /// The transfer from an input to an output at `jω` if other outputs come back to other inputs after delays `(output, input, τ)`:
    /// with G from `(u, w)` to `(y, z)` and `w = E z`, `E = diag(e^(-jωτ))`,
    ///
    /// ```text
    /// G_yu + G_yw E (I - G_zw E)⁻¹ G_zu
    /// ```
    ///
    /// Infinite at a pole.
    ///
    /// # Panics
    /// If an output or an input does not exist.
    pub fn transfer_with_delays(
        &self,
        (output, input): (usize, usize),
        delays: &[(usize, usize, f64)],
        omega: f64,
    ) -> Complex<f64> {
        let s = Complex::new(0.0, omega);
        let own = [(output, input, 0.0)];
        let ends: Vec<_> = own.iter().chain(delays).collect();
        let outputs: Vec<usize> = ends.iter().map(|own| own.0).collect();
        let inputs: Vec<usize> = ends.iter().map(|own| own.1).collect();
        let all = self.from_inputs(&inputs);
        let g = DMatrix::from_fn(outputs.len(), inputs.len(), |i, j| {
            transfer(&all, outputs[i], j, s)
        });
        let n = delays.len();
        let e = DVector::from_fn(n, |k, _| (-s * delays[k].2).exp());
        let e = DMatrix::from_diagonal(&e);
        let back = DMatrix::identity(n, n) - g.view((1, 1), (n, n)) * &e;
        match back.lu().solve(&g.view((1, 0), (n, 1)).into_owned()) {
            Some(z) => g[(0, 0)] + (g.view((0, 1), (1, n)) * e * z)[(0, 0)],
            None => Complex::new(f64::INFINITY, 0.0),
        }
    }
}

/// `C (s I - A)⁻¹ B + D`; for a sampled system with `z` instead of `s`.
pub(super) fn transfer(
    system: &StateSpace,
    output: usize,
    input: usize,
    s: Complex<f64>,
) -> Complex<f64> {
    let n = system.states.len();
    let lift = |value: f64| Complex::new(value, 0.0);
    // The LU decomposition panics for an empty matrix.
    if n == 0 {
        return lift(system.d[(output, input)]);
    }
    let resolvent = DMatrix::from_diagonal_element(n, n, s) - system.a.map(lift);
    let b: DVector<Complex<f64>> = system.b.column(input).map(lift);
    match resolvent.lu().solve(&b) {
        Some(x) => {
            let states = system.c.row(output).map(lift);
            (states * x)[0] + system.d[(output, input)]
        }
        None => Complex::new(f64::INFINITY, 0.0),
    }
}
