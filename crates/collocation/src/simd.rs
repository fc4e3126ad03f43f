//! Several points or elements at once: numbers in groups, which vector instructions take together.

/// Members of a group.
pub const LANES: usize = 4;

/// One number of each member of a group.
pub type Lanes = [f64; LANES];

/// A group of members that follow each other, from `first`: their numbers, and how many they are. The lanes
/// beyond repeat the last.
#[inline(always)]
pub fn group(first: usize, limit: usize, end: usize) -> ([usize; LANES], usize) {
    let count = limit.min(LANES).min(end - first);
    let members = std::array::from_fn(|lane| first + lane.min(count - 1));
    (members, count)
}

/// Rows of a group's members, number by number.
#[inline(always)]
pub fn side_by_side(rows: [&[f64]; LANES], out: &mut [Lanes]) {
    let rows = rows.map(|row| &row[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        *out = rows.map(|row| row[i]);
    }
}

/// A few numbers at each of many points: those of a group of points stand side by side.
#[derive(Debug, Clone, Default)]
pub struct Grouped {
    count: usize,
    values: Vec<Lanes>,
}

impl Grouped {
    /// Zeros: `count` at each of these points.
    pub fn zeros(points: usize, count: usize) -> Self {
        Self {
            count,
            values: vec![[0.0; LANES]; points.div_ceil(LANES) * count],
        }
    }

    /// Those of a group.
    #[inline(always)]
    pub fn group(&self, group: usize) -> &[Lanes] {
        &self.values[group * self.count..(group + 1) * self.count]
    }

    /// The same, to write.
    #[inline(always)]
    pub fn group_mut(&mut self, group: usize) -> &mut [Lanes] {
        &mut self.values[group * self.count..(group + 1) * self.count]
    }

    /// Those of a point, one after the other.
    #[inline(always)]
    pub fn of(&self, point: usize) -> impl Iterator<Item = f64> {
        let lane = point % LANES;
        self.group(point / LANES).iter().map(move |own| own[lane])
    }

    /// All numbers: number `k` of a point is [`LANES`]` k` behind its [`first`](Self::first).
    #[inline]
    pub fn flat(&self) -> &[f64] {
        self.values.as_flattened()
    }

    /// Place of a point's first number.
    #[inline(always)]
    pub fn first(&self, point: usize) -> usize {
        point / LANES * self.count * LANES + point % LANES
    }
}

/// `factor · a` of each lane.
#[inline(always)]
pub fn scaled(factor: f64, a: Lanes) -> Lanes {
    times([factor; LANES], a)
}

/// `a + b · c` of each lane.
#[inline(always)]
pub fn plus(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    let mut out = a;
    (0..LANES).for_each(|l| out[l] = b[l].mul_add(c[l], out[l]));
    out
}

/// `a · b` of each lane.
#[inline(always)]
pub fn times(a: Lanes, b: Lanes) -> Lanes {
    let mut out = a;
    (0..LANES).for_each(|l| out[l] *= b[l]);
    out
}

/// `a - b · c` of each lane.
#[inline(always)]
pub fn less(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    let mut out = a;
    (0..LANES).for_each(|l| out[l] = (-b[l]).mul_add(c[l], out[l]));
    out
}

/// `a` in the lanes where something holds, else `b`.
#[inline(always)]
pub fn select(holds: [bool; LANES], a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|l| if holds[l] { a[l] } else { b[l] })
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
const WIDTHS: [usize; 6] = [8, 16, 24, 36, 64, 128];

/// The width for rows of at least `columns`, where there is one.
pub fn width(columns: usize) -> Option<usize> {
    WIDTHS.into_iter().find(|width| columns <= *width)
}

/// Runs a kernel on rows of a [`width`], with the vector instructions that this machine has. The results are
/// the same bits on any machine: the order of operations does not depend on it, and where a product is
/// fused with a sum (`mul_add`), it is so everywhere, by the C library where the processor cannot.
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

/// A computation on groups. What is to gain by vector instructions must be inlined into `run`.
pub trait Task {
    /// What it gives.
    type Output;

    /// The computation.
    fn run(self) -> Self::Output;
}

/// Runs a computation with the vector instructions that this machine has, as [`run`].
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
