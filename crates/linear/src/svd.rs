//! Singular value decomposition by one-sided Jacobi rotations (M. R. Hestenes, "Inversion of matrices by
//! biorthogonalization and related results", J. SIAM 6(1), 1958; J. Demmel, K. Veselić, "Jacobi's method is more accurate
//! than QR", SIAM J. Matrix Anal. Appl. 13(4), 1992). nalgebra's own has wrong vectors for a tenth of the matrices of rank
//! one, without a word.

use nalgebra::{DMatrix, DVector};

/// Maximum number of times that each pair of columns is rotated; 5 to 10 are usual.
const SWEEPS: usize = 60;

/// `matrix = u diag(singular) vᵀ`.
#[derive(Debug, Clone)]
pub struct Svd {
    /// Left singular vectors as columns. Those of singular values that are zero are zero.
    pub u: DMatrix<f64>,
    /// Singular values, the largest first: as many as the smaller of the numbers of rows and columns.
    pub singular: DVector<f64>,
    /// Right singular vectors as columns. Those of singular values that are zero may be zero.
    pub v: DMatrix<f64>,
}

/// Decomposes a matrix; `None` if it has values that are not finite, or the rotations do not converge.
pub fn svd(matrix: &DMatrix<f64>) -> Option<Svd> {
    if matrix.nrows() < matrix.ncols() {
        let Svd { u, singular, v } = svd(&matrix.transpose())?;
        return Some(Svd {
            u: v,
            singular,
            v: u,
        });
    }
    let largest = matrix.amax();
    if !largest.is_finite() {
        return None;
    }
    let scale = if largest > 0.0 { largest } else { 1.0 };
    let mut w = matrix / scale;
    let mut v = DMatrix::identity(matrix.ncols(), matrix.ncols());
    // Columns of this length are what is left of others by rounding; they have no direction.
    let nothing = (f64::EPSILON * w.norm()).powi(2);
    let mut sweeps = 0;
    while rotate_all(&mut w, &mut v, nothing) {
        sweeps += 1;
        if sweeps == SWEEPS {
            return None;
        }
    }
    Some(ordered(&w, &v, scale))
}

/// Rotates each pair of columns until they are orthogonal to each other; whether any was not.
fn rotate_all(w: &mut DMatrix<f64>, v: &mut DMatrix<f64>, nothing: f64) -> bool {
    let mut has_rotated = false;
    for i in 0..w.ncols() {
        for j in i + 1..w.ncols() {
            let (a, b) = (w.column(i).norm_squared(), w.column(j).norm_squared());
            let product = w.column(i).dot(&w.column(j));
            let allowed = (f64::EPSILON * w.nrows() as f64 * (a * b).sqrt()).max(nothing);
            if product.abs() > allowed {
                let zeta = (b - a) / (2.0 * product);
                let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                rotate(w, (i, j), cosine, cosine * tangent);
                rotate(v, (i, j), cosine, cosine * tangent);
                has_rotated = true;
            }
        }
    }
    has_rotated
}

fn rotate(matrix: &mut DMatrix<f64>, (i, j): (usize, usize), cosine: f64, sine: f64) {
    for row in 0..matrix.nrows() {
        let (x, y) = (matrix[(row, i)], matrix[(row, j)]);
        matrix[(row, i)] = cosine * x - sine * y;
        matrix[(row, j)] = sine * x + cosine * y;
    }
}

/// The columns by their length, the longest first.
fn ordered(w: &DMatrix<f64>, v: &DMatrix<f64>, scale: f64) -> Svd {
    let lengths: Vec<f64> = w.column_iter().map(|column| column.norm()).collect();
    let mut order: Vec<usize> = (0..lengths.len()).collect();
    order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]));
    let unit = |i: usize, k: usize| match lengths[order[k]] {
        0.0 => 0.0,
        length => w[(i, order[k])] / length,
    };
    Svd {
        u: DMatrix::from_fn(w.nrows(), order.len(), unit),
        singular: DVector::from_iterator(order.len(), order.iter().map(|&k| scale * lengths[k])),
        v: DMatrix::from_fn(v.nrows(), order.len(), |i, k| v[(i, order[k])]),
    }
}

impl Svd {
    /// Moore and Penrose's inverse; singular values up to `tolerance` count as zero.
    pub fn pseudo_inverse(&self, tolerance: f64) -> DMatrix<f64> {
        let kept = self.singular.iter().filter(|&&own| own > tolerance).count();
        let inverse = DMatrix::from_diagonal(&self.singular.rows(0, kept).map(f64::recip));
        self.v.columns(0, kept) * inverse * self.u.columns(0, kept).transpose()
    }
}
