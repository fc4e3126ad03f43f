//! Several elements at once: numbers in groups of four, which vector instructions take together.

/// Elements in a group.
pub const LANES: usize = 4;

/// One number of each element of a group.
pub type Lanes = [f64; LANES];

/// `a · b` of each lane.
#[inline(always)]
pub fn times(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|l| a[l] * b[l])
}

/// `a - b · c` of each lane.
#[inline(always)]
pub fn less(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    std::array::from_fn(|l| a[l] - b[l] * c[l])
}

/// A computation on rows whose width is a constant, so that the inner loops have a length that the
/// compiler knows. What is to gain by vector instructions must be inlined into `run`.
pub trait Kernel {
    /// What it gives.
    type Output;

    /// The computation.
    fn run<const W: usize>(self) -> Self::Output;
}

/// Widths that rows are padded to.
const WIDTHS: [usize; 4] = [8, 16, 24, 36];

/// The width for rows of at least `columns`.
///
/// # Panics
/// Beyond 16 states and 16 parameters, which [`NodeModel`](crate::transcription::node::NodeModel) refuses.
pub fn width(columns: usize) -> usize {
    let fits = WIDTHS.into_iter().find(|width| columns <= *width);
    fits.expect("at most 16 states, 16 parameters and an offset")
}

/// Runs a kernel on rows of a [`width`], with the widest vector instructions that this machine has. The
/// results are the same bits on any machine: the order of operations does not depend on it, and no
/// product is fused with a sum.
pub fn run<K: Kernel>(width: usize, kernel: K) -> K::Output {
    let machine = pulp::Arch::new();
    match width {
        8 => machine.dispatch(Wide::<K, 8>(kernel)),
        16 => machine.dispatch(Wide::<K, 16>(kernel)),
        24 => machine.dispatch(Wide::<K, 24>(kernel)),
        36 => machine.dispatch(Wide::<K, 36>(kernel)),
        other => unreachable!("no rows are {other} wide"),
    }
}

struct Wide<K, const W: usize>(K);

impl<K: Kernel, const W: usize> pulp::WithSimd for Wide<K, W> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> K::Output {
        self.0.run::<W>()
    }
}
