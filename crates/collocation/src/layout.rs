//! Positions of the unknowns and constraints in the vectors of the NLP.
//!
//! ```text
//! z = [V¹ | V² | ... | V^M | θ]     V^j: the run's coefficient vectors in time order, n numbers each
//! c = [run 1 | run 2 | ...]         a run: its known initial states, then the defects of each element
//! g = [run 1 | run 2 | ... | g(θ)]  a run: each bounded output at all samples
//! ```

use super::grid::Grid;
use super::mesh::Run;
use std::ops::Range;

/// Offsets and sizes of one run.
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
    /// Number of coefficient vectors.
    pub nodes: usize,
    /// Number of samples.
    pub samples: usize,
    /// Number of bounded outputs.
    pub bounded: usize,
    /// Number of states.
    pub n: usize,
}

impl RunLayout {
    /// Range of its variables.
    #[inline]
    pub fn variables(&self) -> Range<usize> {
        self.z..self.z + self.n * self.nodes
    }

    /// Range of its equalities.
    #[inline]
    pub fn equalities(&self) -> Range<usize> {
        self.c..self.c + self.known + self.n * (self.nodes - 1)
    }

    /// Range of its inequalities.
    #[inline]
    pub fn inequalities(&self) -> Range<usize> {
        self.g..self.g + self.samples * self.bounded
    }
}

/// Offsets of all runs and of the parameters.
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
    /// Layout of runs with `n` states and this number of bounded outputs.
    pub fn new(runs: &[Run], grids: &[Grid], n: usize, bounded: usize) -> Self {
        let (mut z, mut c, mut g) = (0, 0, 0);
        let one = |(run, grid): (&Run, &Grid)| {
            let layout = RunLayout {
                z,
                c,
                g,
                known: run.initial.iter().flatten().count(),
                nodes: grid.nodes(),
                samples: run.time.len(),
                bounded,
                n,
            };
            z = layout.variables().end;
            c = layout.equalities().end;
            g = layout.inequalities().end;
            layout
        };
        let runs = runs.iter().zip(grids).map(one).collect();
        Self {
            runs,
            theta: z,
            parameter_constraints: g,
            n_equalities: c,
        }
    }
}
