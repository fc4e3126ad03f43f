//! Where each unknown and each constraint stands in the NLP's vectors.
//!
//! ```text
//! z = [X¹ | X² | ... | X^M | θ]     X^j: the run's nodes in time order, all states of a node together
//! c = [run 1 | run 2 | ...]         a run: its known initial states, then the defects of each interval
//! g = [run 1 | run 2 | ... | g(θ)]  a run: the bounded signal at each interval boundary
//! ```

use super::mesh::Run;

/// Offsets of one run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunLayout {
    /// First variable.
    pub z: usize,
    /// First equality.
    pub c: usize,
    /// First inequality.
    pub g: usize,
    /// Number of known initial states: the run's first equalities.
    pub known: usize,
    /// Number of nodes.
    pub nodes: usize,
}

/// Offsets of everything.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// The runs.
    pub runs: Vec<RunLayout>,
    /// First parameter in `z`.
    pub theta: usize,
    /// First parameter constraint in `g`.
    pub parameter_constraints: usize,
    /// Number of equalities.
    pub n_equalities: usize,
}

impl Layout {
    /// Layout of runs with `n` states and `s` unknown nodes in each interval.
    pub fn new(runs: &[Run], n: usize, s: usize) -> Self {
        let (mut z, mut c, mut g) = (0, 0, 0);
        let runs = runs
            .iter()
            .map(|run| {
                let known = run.initial.iter().flatten().count();
                let nodes = 1 + s * run.intervals();
                let layout = RunLayout {
                    z,
                    c,
                    g,
                    known,
                    nodes,
                };
                z += n * nodes;
                c += known + n * s * run.intervals();
                g += run.time.len();
                layout
            })
            .collect();
        Self {
            runs,
            theta: z,
            parameter_constraints: g,
            n_equalities: c,
        }
    }
}
