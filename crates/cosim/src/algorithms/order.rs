//! Execution orders from declared dependencies: of instances, and of connections during initialization.

use crate::system::System;

/// Maximum size of a cycle for exact search; larger cycles are ordered greedily.
const MAX_EXACT: usize = 12;

/// Cost of a connection whose value is one step late; direct feedthrough propagates the lag.
const LATE: u32 = 1;
const LATE_FEEDTHROUGH: u32 = 1000;

/// The Gauss-Seidel order of the instances, as positions.
///
/// An instance comes after the instances that feed it, so that it receives their newest outputs. Within a cycle, the
/// order has the fewest late connections, where late inputs with direct feedthrough count above all others, since they
/// propagate the lag. Ties are resolved in favour of the order in which instances were added. In cycles of more than
/// twelve instances, the next one is always the instance that waits for the fewest others.
pub fn gauss_seidel_order(system: &System) -> Vec<usize> {
    let costs = costs(system);
    let reach = reach(&costs);
    let mut order = Vec::with_capacity(costs.len());
    let mut waiting: Vec<usize> = (0..costs.len()).collect();
    while !waiting.is_empty() {
        let cycle = next_cycle(&reach, &waiting);
        match cycle.len() <= MAX_EXACT {
            true => order.extend(cheapest(&costs, &cycle)),
            false => order.extend(greedy(&costs, &cycle)),
        }
        waiting.retain(|instance| !cycle.contains(instance));
    }
    order
}

/// `[to][from]`: cost of placing `to` before `from`.
fn costs(system: &System) -> Vec<Vec<u32>> {
    let n = system.instances.len();
    let mut costs = vec![vec![0; n]; n];
    for connection in &system.connections {
        let (from, to) = (connection.from.instance, connection.to.instance);
        if from == to {
            continue;
        }
        let mut variables = system.instances[to].component.variables().iter();
        let is_direct = variables.any(|v| v.feedthrough.contains(&connection.to.variable));
        costs[to][from] += if is_direct { LATE_FEEDTHROUGH } else { LATE };
    }
    costs
}

/// `[to][from]`: whether values flow from `from` to `to`, directly or indirectly (Warshall's algorithm).
fn reach(costs: &[Vec<u32>]) -> Vec<Vec<bool>> {
    let row = |row: &Vec<u32>| row.iter().map(|&cost| cost > 0).collect();
    let mut reach: Vec<Vec<bool>> = costs.iter().map(row).collect();
    for via in 0..reach.len() {
        let onward = reach[via].clone();
        for row in reach.iter_mut().filter(|row| row[via]) {
            row.iter_mut()
                .zip(&onward)
                .for_each(|(to, &from)| *to |= from);
        }
    }
    reach
}

/// The cycle of the first instance that waits for no instance outside its cycle; usually that instance alone.
fn next_cycle(reach: &[Vec<bool>], waiting: &[usize]) -> Vec<usize> {
    let is_free = |&&instance: &&usize| {
        let mut feeders = waiting.iter().filter(|&&from| reach[instance][from]);
        feeders.all(|&from| reach[from][instance])
    };
    let Some(&instance) = waiting.iter().find(is_free) else {
        return waiting.to_vec();
    };
    let is_member =
        |&&other: &&usize| other == instance || (reach[instance][other] && reach[other][instance]);
    waiting.iter().filter(is_member).copied().collect()
}

/// The order of least cost, the lexicographically first if several: dynamic programming over the sets of instances that
/// remain to be placed.
fn cheapest(costs: &[Vec<u32>], cycle: &[usize]) -> Vec<usize> {
    let n = cycle.len();
    let all = (1_usize << n) - 1;
    let members = |set: usize| (0..n).filter(move |i| set >> i & 1 == 1);
    // `best[rest]`: least cost of placing the instances of `rest` after all others.
    let mut best = vec![0_u32; all + 1];
    let late = |first: usize, rest: usize| -> u32 {
        let later = members(rest & !(1 << first));
        later.map(|from| costs[cycle[first]][cycle[from]]).sum()
    };
    for rest in 1..=all {
        let cost = |first| late(first, rest) + best[rest & !(1 << first)];
        best[rest] = members(rest).map(cost).min().unwrap_or(0);
    }
    let (mut rest, mut order) = (all, Vec::with_capacity(n));
    while rest != 0 {
        let is_best = |&first: &usize| late(first, rest) + best[rest & !(1 << first)] == best[rest];
        let Some(first) = members(rest).find(is_best) else {
            break;
        };
        order.push(cycle[first]);
        rest &= !(1 << first);
    }
    order
}

/// Always places the instance with the fewest late connections next.
fn greedy(costs: &[Vec<u32>], cycle: &[usize]) -> Vec<usize> {
    let (mut waiting, mut order) = (cycle.to_vec(), Vec::with_capacity(cycle.len()));
    while !waiting.is_empty() {
        let late = |&instance: &usize| {
            let late: u32 = waiting.iter().map(|&from| costs[instance][from]).sum();
            (late, instance)
        };
        let Some(next) = waiting.iter().copied().min_by_key(late) else {
            break;
        };
        order.push(next);
        waiting.retain(|&instance| instance != next);
    }
    order
}

/// The order in which connections carry values during initialization: a connection comes after all those on which its
/// output directly depends.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Propagation {
    /// Positions of connections that carry a value once, in this order.
    pub(crate) once: Vec<usize>,
    /// Positions of connections in or behind an algebraic loop, repeated until nothing changes.
    pub(crate) repeated: Vec<usize>,
}

impl Propagation {
    pub(crate) fn of(system: &System) -> Self {
        let connections = &system.connections;
        // Connection `a` before `b`: `a` feeds an input that the output of `b` depends on.
        let before = |a: usize, b: usize| {
            let from = connections[b].from;
            let to = connections[a].to;
            to.instance == from.instance
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
