//! Poles and their frequency and damping.

use nalgebra::{Complex, DMatrix, Schur};
use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

/// One real pole, or one pair of conjugate poles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// The pole; for a pair, the one with the positive imaginary part [1/s].
    pub pole: Complex<f64>,
    /// Natural frequency `|s|` [rad/s].
    pub frequency: f64,
    /// Damping ratio `-Re s / |s|`; 1 for a stable real pole, negative when unstable, 0 for an
    /// integrator.
    pub damping: f64,
}

impl Mode {
    /// The modes of a set of poles that is closed under conjugation, slowest first.
    pub fn of_poles(poles: &[Complex<f64>]) -> Vec<Self> {
        let mut modes: Vec<Self> = (poles.iter())
            .filter(|pole| pole.im >= 0.0)
            .map(|&pole| Self {
                pole,
                frequency: pole.norm(),
                damping: match pole.norm() {
                    0.0 => 0.0,
                    f64::INFINITY => -pole.re.signum(),
                    frequency => -pole.re / frequency,
                },
            })
            .collect();
        modes.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
        modes
    }
}

/// Maximum number of iterations per eigenvalue; LAPACK allows 30 (`dhseqr`).
const MAX_ITERATIONS: usize = 100;

/// Eigenvalues, sorted by magnitude, then imaginary part. All are infinite if they cannot be computed, because the
/// matrix is not finite or the iteration does not converge, so that an unknown system is never called stable.
///
/// The matrix is scaled first (`balance`): states in metres and in kiloradians per second differ by orders of
/// magnitude, which would cost the small eigenvalues their digits.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let mut values = match iterate(matrix) {
        Some(values) => values,
        None => vec![Complex::new(f64::INFINITY, 0.0); matrix.nrows()],
    };
    values.sort_by(|a, b| {
        let close = (a.norm() - b.norm()).abs() <= 1e-12 * a.norm().max(b.norm());
        match close {
            true => a.im.total_cmp(&b.im),
            false => a.norm().total_cmp(&b.norm()),
        }
    });
    values
}

/// The eigenvalues, unsorted; `None` if the iteration does not converge or a value is not finite.
fn iterate(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    // The iteration does not end if a value is not finite.
    if matrix.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let mut values: Vec<Complex<f64>> = Vec::with_capacity(matrix.nrows());
    for block in blocks(matrix) {
        let mut balanced = matrix.select_rows(&block).select_columns(&block);
        balance(&mut balanced);
        let limit = MAX_ITERATIONS * block.len();
        let schur = Schur::try_new(balanced, f64::EPSILON, limit)?;
        values.extend(schur.complex_eigenvalues().iter());
    }
    let are_finite = values.iter().all(|s| s.re.is_finite() && s.im.is_finite());
    are_finite.then_some(values)
}

/// The diagonal blocks of a matrix that is block-triangular after a permutation; their eigenvalues are its own. They are
/// the strongly connected components of the states, two of which are connected if one acts on the other. Elements in
/// series are thus separate: of n equal ones, rounding would move the n-fold eigenvalue by its n-th root, and all at once
/// would cost n³.
fn blocks(matrix: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let mut graph = DiGraph::<(), ()>::new();
    let nodes: Vec<NodeIndex> = (0..matrix.nrows()).map(|_| graph.add_node(())).collect();
    for (column, from) in matrix.column_iter().zip(&nodes) {
        let acts = column
            .iter()
            .zip(&nodes)
            .filter(|(slope, _)| **slope != 0.0);
        acts.for_each(|(_, to)| {
            graph.add_edge(*from, *to, ());
        });
    }
    let mut blocks: Vec<Vec<usize>> = kosaraju_scc(&graph)
        .into_iter()
        .map(|block| block.into_iter().map(NodeIndex::index).collect())
        .collect();
    blocks.iter_mut().for_each(|block| block.sort_unstable());
    blocks
}

/// `e^matrix`; `None` if the matrix is not finite, for which nalgebra's algorithm would square without end, or if the
/// result would have no correct digits, which happens far below overflow.
pub(super) fn exponential(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    const MAX_NORM: f64 = 1e8;
    let is_usual = matrix.iter().all(|value| value.abs() <= MAX_NORM);
    is_usual.then(|| matrix.exp())
}

/// Scales rows and columns by powers of two until they are of similar size (B. N. Parlett, C. Reinsch, "Balancing a
/// matrix for calculation of eigenvalues and eigenvectors", Numer. Math. 13, 1969). The eigenvalues are unchanged to
/// the last bit.
fn balance(matrix: &mut DMatrix<f64>) {
    const RADIX: f64 = 2.0;
    let n = matrix.nrows();
    loop {
        let mut is_balanced = true;
        for i in 0..n {
            let others = || (0..n).filter(move |&j| j != i);
            let column: f64 = others().map(|j| matrix[(j, i)].abs()).sum();
            let row: f64 = others().map(|j| matrix[(i, j)].abs()).sum();
            if column == 0.0 || row == 0.0 || !(column + row).is_finite() {
                continue;
            }
            let factor = RADIX.powf((0.5 * (row / column).log2()).round());
            if column * factor + row / factor < 0.95 * (column + row) {
                is_balanced = false;
                for j in 0..n {
                    matrix[(j, i)] *= factor;
                    matrix[(i, j)] /= factor;
                }
            }
        }
        if is_balanced {
            return;
        }
    }
}
