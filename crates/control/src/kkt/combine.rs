//! Sums of multiples of rows, kept in registers.

use pilotage_collocation::simd::{LANES, Lanes, plus};

/// Number of [`Lanes`] of a block of long rows, and of the longest row that is one block.
const BLOCK: usize = 4;
const LONGEST: usize = 6;

/// Length of rows of so many columns, in [`Lanes`].
pub(super) fn wide(columns: usize) -> usize {
    let wide = columns.div_ceil(LANES);
    if wide <= LONGEST {
        wide
    } else {
        wide.next_multiple_of(BLOCK)
    }
}

/// `out += Σ factor(j) · row j`, for so many rows of whole blocks.
#[inline(always)]
pub(super) fn combine<const B: usize>(
    out: &mut [Lanes],
    rows: &[Lanes],
    count: usize,
    factor: impl Fn(usize) -> f64,
) {
    let wide = out.len();
    for (b, out) in out.as_chunks_mut::<B>().0.iter_mut().enumerate() {
        let mut sum = *out;
        for j in 0..count {
            let row = rows[j * wide + b * B..].first_chunk::<B>();
            let factor = [factor(j); LANES];
            for (sum, row) in sum.iter_mut().zip(row.expect("whole blocks")) {
                *sum = plus(*sum, factor, *row);
            }
        }
        *out = sum;
    }
}

/// `out += Σ factor · row`, lane by lane, over these rows of `columns` from `first` on; factors are `stride` apart.
#[inline(always)]
pub(super) fn combine_lanes(
    out: &mut [Lanes],
    (rows, columns, first): (&[Lanes], usize, usize),
    (factors, stride): (&[Lanes], usize),
    chosen: &[usize],
) {
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let mut at = first;
    for out in blocks {
        let mut sum = *out;
        for j in chosen {
            let factor = factors[j * stride];
            let row = rows[j * columns + at..]
                .first_chunk::<BLOCK>()
                .expect("a block");
            for (sum, row) in sum.iter_mut().zip(row) {
                *sum = plus(*sum, factor, *row);
            }
        }
        *out = sum;
        at += BLOCK;
    }
    for (k, out) in rest.iter_mut().enumerate() {
        for j in chosen {
            *out = plus(*out, factors[j * stride], rows[j * columns + at + k]);
        }
    }
}

/// Rows whose factors are not 0 throughout.
#[inline(always)]
pub(super) fn choose(rows: &[usize], (factors, stride): (&[Lanes], usize), out: &mut Vec<usize>) {
    out.clear();
    for j in rows {
        if factors[j * stride] != [0.0; LANES] {
            out.push(*j);
        }
    }
}
