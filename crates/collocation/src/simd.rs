//! Groups of points or elements whose values are processed together by vector instructions.

/// Number of members of a group.
pub const LANES: usize = 4;

/// One value for each member of a group.
pub type Lanes = [f64; LANES];

/// A group of consecutive members from `first`: their indices and their number. Excess lanes repeat the last one.
#[inline(always)]
pub fn group(first: usize, limit: usize, end: usize) -> ([usize; LANES], usize) {
    let count = limit.min(LANES).min(end - first);
    let members = std::array::from_fn(|lane| first + lane.min(count - 1));
    (members, count)
}

/// Transposes the rows of a group's members: one [`Lanes`] per column.
#[inline(always)]
pub fn side_by_side(rows: [&[f64]; LANES], out: &mut [Lanes]) {
    let rows = rows.map(|row| &row[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        *out = rows.map(|row| row[i]);
    }
}

/// A few values at each of many points; those of a group of points are stored side by side.
#[derive(Debug, Clone, Default)]
pub struct Grouped {
    count: usize,
    values: Vec<Lanes>,
}

impl Grouped {
    /// Zeros: `count` values at each of these points.
    pub fn zeros(points: usize, count: usize) -> Self {
        Self {
            count,
            values: vec![[0.0; LANES]; points.div_ceil(LANES) * count],
        }
    }

    /// The values of a group.
    #[inline(always)]
    pub fn group(&self, group: usize) -> &[Lanes] {
        &self.values[group * self.count..(group + 1) * self.count]
    }

    /// The values of a group, mutable.
    #[inline(always)]
    pub fn group_mut(&mut self, group: usize) -> &mut [Lanes] {
        &mut self.values[group * self.count..(group + 1) * self.count]
    }

    /// The values of a point.
    #[inline(always)]
    pub fn of(&self, point: usize) -> impl Iterator<Item = f64> {
        let lane = point % LANES;
        self.group(point / LANES).iter().map(move |own| own[lane])
    }

    /// All values: value `k` of a point is at [`LANES`]` k` after its [`first`](Self::first).
    #[inline]
    pub fn flat(&self) -> &[f64] {
        self.values.as_flattened()
    }

    /// Index of the first value of a point.
    #[inline(always)]
    pub fn first(&self, point: usize) -> usize {
        point / LANES * self.count * LANES + point % LANES
    }
}

/// `factor · a` in each lane.
#[inline(always)]
pub fn scaled(factor: f64, a: Lanes) -> Lanes {
    times([factor; LANES], a)
}

/// `a + b · c` in each lane.
#[inline(always)]
pub fn plus(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    let mut out = a;
    for l in 0..LANES {
        out[l] = b[l].mul_add(c[l], out[l]);
    }
    out
}

/// `a · b` in each lane.
#[inline(always)]
pub fn times(a: Lanes, b: Lanes) -> Lanes {
    let mut out = a;
    for l in 0..LANES {
        out[l] *= b[l];
    }
    out
}

/// `a - b · c` in each lane.
#[inline(always)]
pub fn less(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    let mut out = a;
    for l in 0..LANES {
        out[l] = (-b[l]).mul_add(c[l], out[l]);
    }
    out
}

/// `a` in the lanes where `holds` is true, else `b`.
#[inline(always)]
pub fn select(holds: [bool; LANES], a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|l| if holds[l] { a[l] } else { b[l] })
}

/// A computation on rows of constant width, so that the compiler knows the length of the inner loops. Code that should
/// use vector instructions must be inlined into `run`.
pub trait Kernel {
    /// Result of the computation.
    type Output;

    /// The computation.
    fn run<const W: usize>(self) -> Self::Output;
}

/// Widths to which rows are padded.
const WIDTHS: [usize; 6] = [8, 16, 24, 36, 64, 128];

/// The width for rows of at least `columns`, if there is one.
pub fn width(columns: usize) -> Option<usize> {
    WIDTHS.into_iter().find(|width| columns <= *width)
}

/// Runs a kernel on rows of a [`width`], with the vector instructions of this machine. The results are bitwise
/// identical on all machines: the order of operations does not depend on the machine, and products fused with sums
/// (`mul_add`) are fused everywhere, by the C library if the processor lacks the instruction.
pub fn run<K: Kernel>(width: usize, kernel: K) -> K::Output {
    let machine = pulp::Arch::new();
    match width {
        8 => machine.dispatch(Wide::<K, 8>(kernel)),
        16 => machine.dispatch(Wide::<K, 16>(kernel)),
        24 => machine.dispatch(Wide::<K, 24>(kernel)),
        36 => machine.dispatch(Wide::<K, 36>(kernel)),
        64 => machine.dispatch(Wide::<K, 64>(kernel)),
        128 => machine.dispatch(Wide::<K, 128>(kernel)),
        other => unreachable!("no rows are {other} wide"),
    }
}

/// A computation on groups. Code that should use vector instructions must be inlined into `run`.
pub trait Task {
    /// Result of the computation.
    type Output;

    /// The computation.
    fn run(self) -> Self::Output;
}

/// Runs a computation with the vector instructions of this machine, as [`run`] does.
pub fn vectorised<T: Task>(task: T) -> T::Output {
    pulp::Arch::new().dispatch(Vectorised(task))
}

struct Vectorised<T>(T);

impl<T: Task> pulp::WithSimd for Vectorised<T> {
    type Output = T::Output;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> T::Output {
        self.0.run()
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
