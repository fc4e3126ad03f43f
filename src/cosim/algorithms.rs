//! In which order slaves are set, stepped and read.

use super::system::System;

/// How slaves that step side by side exchange values (Kübler & Schiehlen, "Two methods of simulator
/// coupling", Math. Comput. Model. Dyn. Syst. 6(2), 2000). Both are of first order in the
/// communication step `h`, inputs being held during a step: with Jacobi every input lags by `h/2` on
/// average; with Gauss-Seidel of two slaves in a loop, the first one's inputs are `h/2` late and the
/// second one's `h/2` early, which cancels around the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// All slaves get the others' outputs at `t_k`, then all step to `t_{k+1}`.
    #[default]
    Jacobi,
    /// One slave after another gets the newest outputs there are, steps and gives its own.
    GaussSeidel,
}

impl std::fmt::Display for Algorithm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Jacobi => "jacobi",
            Self::GaussSeidel => "gauss-seidel",
        })
    }
}

/// The Gauss-Seidel order of the slaves, by their positions.
///
/// A slave with direct feedthrough from an input that is fed stands after the slave that feeds it,
/// so that its output belongs to that input's newest value. Where this leaves a choice, the slave
/// that waits for the fewest others comes first, then the one that was added first. A cycle of direct
/// feedthrough is broken by the same two rules.
pub fn gauss_seidel_order(system: &System) -> Vec<usize> {
    let n = system.instances.len();
    let mut direct = vec![vec![false; n]; n];
    let mut any = vec![vec![false; n]; n];
    for connection in &system.connections {
        let (from, to) = (connection.from.slave, connection.to.slave);
        if from == to {
            continue;
        }
        any[to][from] = true;
        let variables = system.instances[to].slave.variables();
        direct[to][from] |= variables
            .iter()
            .any(|v| v.feedthrough.contains(&connection.to.variable));
    }
    let mut order = Vec::with_capacity(n);
    let mut waiting: Vec<usize> = (0..n).collect();
    while !waiting.is_empty() {
        let waits_for = |table: &[Vec<bool>], slave: usize| {
            waiting.iter().filter(|&&other| table[slave][other]).count()
        };
        let rank = |&slave: &usize| (waits_for(&direct, slave), waits_for(&any, slave), slave);
        let Some(next) = waiting.iter().copied().min_by_key(rank) else {
            break;
        };
        order.push(next);
        waiting.retain(|&slave| slave != next);
    }
    order
}

/// The order in which connections carry values during initialization: after everything that their
/// output depends on at once.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Propagation {
    /// Positions of connections that need to carry a value once, in this order.
    pub(super) once: Vec<usize>,
    /// Positions of connections in an algebraic loop or behind one: to be repeated until nothing
    /// changes.
    pub(super) repeated: Vec<usize>,
}

impl Propagation {
    pub(super) fn of(system: &System) -> Self {
        let connections = &system.connections;
        // Connection `a` before `b`: `a` feeds an input that the output of `b` depends on.
        let before = |a: usize, b: usize| {
            let from = connections[b].from;
            let to = connections[a].to;
            to.slave == from.slave
                && system
                    .variable(from)
                    .initial_feedthrough
                    .contains(&to.variable)
        };
        let mut waiting: Vec<usize> = (0..connections.len()).collect();
        let mut once = Vec::new();
        loop {
            let is_free = |&&b: &&usize| !waiting.iter().any(|&a| before(a, b));
            let Some(&next) = waiting.iter().find(is_free) else {
                break;
            };
            once.push(next);
            waiting.retain(|&c| c != next);
        }
        Self {
            once,
            repeated: waiting,
        }
    }
}
