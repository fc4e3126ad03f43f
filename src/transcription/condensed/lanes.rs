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

/// Runs `work` with the widest vector instructions that this machine has. What is to gain by them must be
/// inlined into `work`. The results are the same bits on any machine: the order of operations does not
/// depend on it, and no product is fused with a sum.
#[inline(always)]
pub fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
