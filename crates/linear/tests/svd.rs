//! The singular value decomposition against what defines it.

use nalgebra::{DMatrix, DVector};
use pilotage_linear::svd::{Svd, svd};

/// Error of the product, and of the orthogonality of the vectors whose singular values are above rounding.
fn errors(matrix: &DMatrix<f64>, found: &Svd) -> [f64; 3] {
    let product = &found.u * DMatrix::from_diagonal(&found.singular) * found.v.transpose();
    let rank = (found.singular.iter())
        .filter(|own| **own > 1e-10 * matrix.amax())
        .count();
    let orthogonal = |of: &DMatrix<f64>| {
        let of = of.columns(0, rank);
        (of.transpose() * of - DMatrix::identity(rank, rank)).amax()
    };
    let size = matrix.amax().max(f64::MIN_POSITIVE);
    [
        (product - matrix).amax() / size,
        orthogonal(&found.u),
        orthogonal(&found.v),
    ]
}

fn assert_right(matrix: &DMatrix<f64>, what: &str) {
    let found = svd(matrix).unwrap_or_else(|| panic!("{what}: no decomposition"));
    let errors = errors(matrix, &found);
    assert!(errors.iter().all(|own| *own < 1e-12), "{what}: {errors:?}");
    let sizes = found.singular.as_slice();
    assert!(sizes.windows(2).all(|pair| pair[0] >= pair[1]), "{what}");
    let inverse = found.pseudo_inverse(1e-10 * matrix.amax());
    let again = (matrix * inverse * matrix - matrix).amax();
    assert!(again <= 1e-11 * matrix.amax(), "{what}: {again:e}");
}

/// Pulse responses of one mode: of these Hankel matrices nalgebra's decomposition has wrong vectors in a tenth.
#[test]
fn matrices_of_rank_one() {
    for n in [1, 2, 5, 20, 40, 60] {
        for k in 0..80 {
            let decay = (-1.0 / (0.1 * 1.12_f64.powi(k))).exp();
            let matrix = DMatrix::from_fn(n, n, |i, j| decay.powi((i + j) as i32));
            assert_right(&matrix, &format!("{n}, {decay}"));
        }
        assert_right(&DMatrix::from_element(n, n + 3, 0.1), "equal");
    }
}

/// Sums of modes, also close to each other, of few and many rows and columns, of all sizes.
#[test]
fn matrices_of_every_shape_and_rank() {
    let mut seed = 1_u32;
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed >> 8) / f64::from(1 << 24) - 0.5
    };
    for (rows, columns) in [(1, 7), (7, 1), (3, 3), (12, 30), (30, 12), (40, 40)] {
        for rank in 0..=4 {
            for size in [1e-200, 1e-9, 1.0, 1e200] {
                let mut matrix = DMatrix::zeros(rows, columns);
                for mode in 0..rank {
                    let column = DVector::from_fn(rows, |_, _| random());
                    let row = DVector::from_fn(columns, |_, _| random());
                    matrix += column * row.transpose() * 0.1_f64.powi(mode);
                }
                assert_right(&(matrix * size), &format!("{rows} {columns} {rank} {size}"));
            }
        }
    }
    assert!(svd(&DMatrix::from_element(2, 2, f64::NAN)).is_none());
    // Known: the singular values of [[3, 0], [4, 5]] are √45 and √5.
    let found = svd(&DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 4.0, 5.0])).unwrap();
    let error = found.singular - DVector::from_vec(vec![45_f64.sqrt(), 5_f64.sqrt()]);
    assert!(error.amax() < 1e-14);
}
