//! Collocation schemes as data.
//!
//! An interval of length `h` has nodes at `t + c_j h`, `j = 0..=s`, with `c_0 = 0` and `c_s = 1`. Its
//! unknown nodes `i = 1..=s` satisfy
//!
//! ```text
//! X_i = X_0 + h Σ_j a_ij f(X_j)
//! ```
//!
//! that is, the implicit Runge–Kutta method whose stages are the nodes (Hairer & Wanner, *Solving
//! Ordinary Differential Equations II*, section IV.5).

/// Coefficients of a collocation scheme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scheme {
    /// Name, as on the command line.
    pub name: &'static str,
    /// Order of convergence of the states at the ends of intervals.
    pub order: usize,
    /// Abscissae `c_0 = 0 .. c_s = 1`.
    pub abscissae: &'static [f64],
    /// Weights `a_ij`, one row for each unknown node, one column for each node.
    pub weights: &'static [&'static [f64]],
    /// Where the coefficients come from.
    pub source: &'static str,
}

/// Forward Euler, explicit: the paper's matrix D.
pub const EULER: Scheme = Scheme {
    name: "euler",
    order: 1,
    abscissae: &[0.0, 1.0],
    weights: &[&[1.0, 0.0]],
    source: "Bonner & Kirchner 2026, matrix D",
};

/// Trapezoid: Lobatto IIIA with two nodes.
pub const TRAPEZOID: Scheme = Scheme {
    name: "trapezoid",
    order: 2,
    abscissae: &[0.0, 1.0],
    weights: &[&[0.5, 0.5]],
    source: "Betts, Practical Methods for Optimal Control, 2nd ed. 2010, eq. 3.109",
};

/// Hermite–Simpson, separated form: Lobatto IIIA with three nodes.
pub const HERMITE_SIMPSON: Scheme = Scheme {
    name: "hermite-simpson",
    order: 4,
    abscissae: &[0.0, 0.5, 1.0],
    weights: &[
        &[5.0 / 24.0, 8.0 / 24.0, -1.0 / 24.0],
        &[1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0],
    ],
    source: "Betts 2010, eqs. 4.146-4.147; Hairer & Wanner II, table 5.7 (Lobatto IIIA, s = 3)",
};

/// All schemes.
pub const SCHEMES: [&Scheme; 3] = [&EULER, &TRAPEZOID, &HERMITE_SIMPSON];

impl Scheme {
    /// Number of unknown nodes of an interval, `s`.
    pub fn unknown_nodes(&self) -> usize {
        self.weights.len()
    }

    /// True when no unknown node's derivative enters, so that an interval needs no linear solve.
    pub fn is_explicit(&self) -> bool {
        self.weights
            .iter()
            .all(|row| row[1..].iter().all(|a| *a == 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A collocation scheme integrates polynomials exactly: Σ_j a_ij c_j^(k-1) = c_i^k / k for every
    /// k up to the number of nodes with weight (Hairer & Wanner II, condition C), and the last row for
    /// every k up to the order (condition B).
    #[test]
    fn coefficients_satisfy_the_order_conditions() {
        for scheme in SCHEMES {
            let moment = |row: &[f64], k: usize| -> f64 {
                row.iter()
                    .zip(scheme.abscissae)
                    .map(|(a, c)| a * c.powi(k as i32 - 1))
                    .sum()
            };
            let last = scheme.weights[scheme.unknown_nodes() - 1];
            for k in 1..=scheme.order {
                assert!(
                    (moment(last, k) - 1.0 / k as f64).abs() < 1e-15,
                    "{}, B({k})",
                    scheme.name
                );
            }
            for (i, row) in scheme.weights.iter().enumerate() {
                let used = row.iter().filter(|a| **a != 0.0).count();
                for k in 1..=used {
                    let exact = scheme.abscissae[i + 1].powi(k as i32) / k as f64;
                    assert!(
                        (moment(row, k) - exact).abs() < 1e-15,
                        "{}, C({k})",
                        scheme.name
                    );
                }
            }
        }
    }
}
