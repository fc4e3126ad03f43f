//! Conditions on time, as inputs that jump where they change.
//!
//! A condition such as `time > start` becomes an input that is 1 or 0 and jumps at a boundary of the mesh, so that no pulse is too
//! short to be seen and no interval contains a jump. If the time T depends on what is sought, its boundary s stays where it is
//! during a solve, and the states jump there by what the other equations would have done to them from s to T,
//!
//! ```text
//! x⁺ = x⁻ + (f⁻ - f⁺) (T - s),   f⁻ and f⁺ before and after the change
//! ```
//!
//! whose derivative with respect to T is that of the solution where T = s (the saltation matrix: Leine & Nijmeijer, *Dynamics and
//! Bifurcations of Non-Smooth Mechanical Systems*). Between solves the boundary is moved to T, until both agree. The
//! jump is an integral over a short interval behind s, so that any scheme has it.

use crate::posed::assembly::Made;
use pilotage_collocation::{Run, Steps};
use pilotage_expression::{Node, System, Tape};
use std::collections::HashMap;

/// Length of the interval of a jump, relative to the distance to the next sample or time.
const SHORT: f64 = 1e-6;

/// Smallest distance of two times, relative to the length of a run; also that of a boundary from its time at which both agree.
const NEAR: f64 = 1e-9;

/// Conditions on time, over the variables of the equations.
#[derive(Debug)]
pub struct Switches {
    /// The conditions, then the times at which they change.
    tape: Tape,
    /// Number of conditions.
    conditions: usize,
    /// For each time whether it depends on what is sought.
    sought: Vec<bool>,
    /// For each time the conditions that may change there.
    changed: Vec<Vec<usize>>,
    /// Index of the first of the inputs that stand for conditions.
    first: usize,
    /// Inputs on which conditions depend, constant in each run or jumping at changes.
    steady: Vec<usize>,
}

/// Times at which conditions change in a run, increasing; with the numbers of those that are sought.
type Stops = Vec<(f64, Vec<usize>)>;

impl Made {
    /// Replaces the conditions on time in the equations by inputs. `is_constant` tells inputs that are constant in each run
    /// between changes, `states` is the number of states that are not parameters of runs. None if there is none.
    pub fn replace_conditions(
        &mut self,
        states: usize,
        is_constant: impl Fn(usize) -> bool,
    ) -> Option<Switches> {
        let system = &mut self.system;
        let rows = [&system.derivatives[..], &system.outputs].concat();
        let (inputs, own) = (system.input(0), system.state(states));
        let parameters = system.parameter(0);
        let is_sought =
            |variable: usize| variable >= parameters || (own..inputs).contains(&variable);
        let is_given = |variable: usize| {
            (inputs..parameters).contains(&variable) && is_constant(variable - inputs)
        };
        let found = system
            .graph
            .switches(&rows, |variable| is_sought(variable) || is_given(variable));
        if found.times.is_empty() {
            return None;
        }
        let depends = system.graph.dependants(is_sought);
        let sought: Vec<bool> = found
            .times
            .iter()
            .map(|node| depends[node.index()])
            .collect();
        let steady = inputs_of(system, &found.times);
        let (first, conditions) = (system.inputs, found.conditions.len());
        let moving = sought.iter().filter(|own| **own).count();
        // Values after and, within jumps, before them; for each sought time the height of the jump's rate, and that times s.
        let added = match moving {
            0 => conditions,
            _ => 2 * (conditions + moving),
        };
        let mut all = [found.conditions, found.times].concat();
        self.with_inputs(added, &mut all);
        let count = all.len() - sought.len();
        let (literal, times) = all.split_at(count);
        let system = &mut self.system;
        let tape = Tape::new(&system.graph, system.variables(), |_| false, &[&all]);
        let times = times.iter().zip(&sought).filter(|(_, sought)| **sought);
        let switched = Switched {
            conditions: literal,
            times: times.map(|(time, _)| *time).collect(),
            first,
        };
        switched.replace(system);
        for run in &mut self.runs {
            run.inputs
                .iter_mut()
                .for_each(|row| row.resize(first + added, 0.0));
        }
        Some(Switches {
            tape,
            conditions,
            sought,
            changed: found.changed,
            first,
            steady,
        })
    }

    /// Adds inputs after the others to all expressions, and to these.
    fn with_inputs(&mut self, added: usize, more: &mut Vec<Node>) {
        let from = self.system.clone();
        let mut graph = pilotage_expression::Graph::default();
        let parameters = from.parameter(0);
        let all: Vec<Node> = (0..from.variables() + added)
            .map(|k| graph.variable(k))
            .collect();
        let variables: Vec<Node> = (0..from.variables())
            .map(|k| all[if k < parameters { k } else { k + added }])
            .collect();
        let mut moved = |nodes: &mut Vec<Node>| {
            *nodes = graph.import(&from.graph, nodes, &variables);
        };
        moved(more);
        moved(&mut self.system.derivatives);
        moved(&mut self.system.outputs);
        moved(&mut self.measured);
        let quantities = &mut self.quantities;
        moved(&mut quantities.predicted);
        moved(&mut quantities.deviations);
        moved(&mut quantities.joint);
        let named = quantities.tied.iter_mut().chain(&mut quantities.derived);
        let shifts = self
            .states
            .iter_mut()
            .filter_map(|state| state.shift.as_mut());
        for node in named.map(|(_, node)| node).chain(shifts) {
            let mut one = vec![*node];
            moved(&mut one);
            *node = one[0];
        }
        self.system.graph = graph;
        self.system.inputs += added;
    }
}

/// The inputs on which expressions of a system depend.
fn inputs_of(system: &System, nodes: &[Node]) -> Vec<usize> {
    let needed = system.graph.ancestors(nodes);
    let is_used = |k: &usize| {
        let node = system.graph.known_variable(system.input(*k));
        node.is_some_and(|node| needed[node.index()])
    };
    (0..system.inputs).filter(is_used).collect()
}

/// Conditions in a system, and the sought times among those of their changes.
struct Switched<'a> {
    conditions: &'a [Node],
    times: Vec<Node>,
    first: usize,
}

impl Switched<'_> {
    /// Puts inputs in place of the conditions.
    fn replace(&self, system: &mut System) {
        let literal = system.graph.clone();
        let all: Vec<Node> = (0..system.variables())
            .map(|k| system.graph.variable(k))
            .collect();
        let first = system.input(self.first);
        let input = |k: usize| all[first + k];
        let count = self.conditions.len();
        let graph = &mut system.graph;
        let by = |offset: usize| -> HashMap<Node, Node> {
            let own = self.conditions.iter().enumerate();
            own.map(|(k, node)| (*node, input(offset + k))).collect()
        };
        let after = by(0);
        let rates = &system.derivatives;
        let replaced = graph.import_with(&literal, rates, &all, &after);
        let other = match self.times.is_empty() {
            true => replaced.clone(),
            false => graph.import_with(&literal, rates, &all, &by(count)),
        };
        system.outputs = graph.import_with(&literal, &system.outputs, &all, &after);
        // Σ (T - s) over the length of the jump.
        let mut part = graph.constant(0.0);
        for (k, time) in self.times.iter().enumerate() {
            let [height, moment] = [0, 1].map(|own| input(2 * count + 2 * k + own));
            let own = graph.multiply(height, *time);
            let own = graph.subtract(own, moment);
            part = graph.add(part, own);
        }
        let pairs = replaced.into_iter().zip(other);
        let rates = pairs.map(|(after, before)| {
            let difference = graph.subtract(before, after);
            let jump = graph.multiply(part, difference);
            graph.add(after, jump)
        });
        system.derivatives = rates.collect();
    }
}

impl Switches {
    /// Whether any time depends on what is sought.
    pub fn are_sought(&self) -> bool {
        self.sought.contains(&true)
    }

    /// Writes the conditions as they are at a point of the equations' variables, in place of the inputs.
    pub fn fill(&self, system: &System, at: &mut [f64]) {
        let values = self.tape.evaluate(at);
        let first = system.input(self.first);
        at[first..][..self.conditions].copy_from_slice(&values[..self.conditions]);
    }

    /// A run whose conditions change where they do for this θ and these initial states, with boundaries of its mesh there.
    pub fn placed(&self, system: &System, run: &Run, theta: &[f64], initial: &[f64]) -> Run {
        let mut run = run.clone();
        let before = run.steps.clone();
        // Without the boundaries of before, unless they are samples.
        let is_left = |time: &f64| !before.time.contains(time) || run.time.contains(time);
        run.mesh.retain(is_left);
        let point = |time: f64, row: usize| -> Vec<f64> {
            [&[time], initial, &run.inputs[row], theta].concat()
        };
        let stops = self.stops(&run, &point);
        run.steps = self.steps(&run, &stops, &point);
        let rows = (0..run.time.len()).map(|k| {
            let mut at = point(run.time[k], k);
            self.fill(system, &mut at);
            at[system.input(0)..system.parameter(0)].to_vec()
        });
        run.inputs = rows.collect();
        run.mesh = run.steps.on(&run.mesh);
        run
    }

    /// The times at which conditions change within a run, and changes of the inputs on which they depend.
    fn stops(&self, run: &Run, point: &impl Fn(f64, usize) -> Vec<f64>) -> Stops {
        let last = run.time.len() - 1;
        let (begin, end) = (run.time[0], run.time[last]);
        let least = NEAR * (end - begin);
        let is_jump = |k: &usize| {
            let rows = [&run.inputs[*k], &run.inputs[k + 1]];
            self.steady
                .iter()
                .any(|input| rows[0][*input] != rows[1][*input])
        };
        let mut ends: Vec<(usize, f64)> = (0..last)
            .filter(is_jump)
            .map(|k| (k + 1, run.time[k + 1]))
            .collect();
        let mut stops: Stops = ends.iter().map(|(_, time)| (*time, Vec::new())).collect();
        ends.insert(0, (0, begin));
        for (k, (row, from)) in ends.iter().enumerate() {
            let to = ends.get(k + 1).map_or(end, |(_, time)| *time);
            let values = self.tape.evaluate(&point(*from, *row));
            for (number, time) in values[self.conditions..].iter().enumerate() {
                if from + least < *time && *time < to - least {
                    stops.push((
                        *time,
                        self.sought[number].then_some(number).into_iter().collect(),
                    ));
                }
            }
        }
        stops.sort_by(|a, b| a.0.total_cmp(&b.0));
        stops.dedup_by(|b, a| {
            let is_same = b.0 - a.0 <= least;
            if is_same {
                a.1.append(&mut b.1);
            }
            is_same
        });
        stops
    }

    /// The inputs between these times.
    fn steps(&self, run: &Run, stops: &Stops, point: &impl Fn(f64, usize) -> Vec<f64>) -> Steps {
        let end = run.time[run.time.len() - 1];
        let least = NEAR * (end - run.time[0]);
        let mut steps = Steps {
            first: self.first,
            window: run.steps.window,
            ..Steps::default()
        };
        let truth = |from: f64, to: f64| {
            let middle = 0.5 * (from + to);
            let row = run.time.partition_point(|time| *time <= middle).max(1) - 1;
            let mut values = self.tape.evaluate(&point(middle, row));
            values.truncate(self.conditions);
            values
        };
        let next = |k: usize| stops.get(k).map_or(end, |(time, _)| *time);
        let mut before = truth(run.time[0], next(0));
        steps.values.push(self.row(&before, &before, None));
        for (k, (time, numbers)) in stops.iter().enumerate() {
            let after = truth(*time, next(k + 1));
            let mut begin = *time;
            // One jump for each sought time, by the conditions that change there; the others have changed before.
            let is_own = |condition: &usize| {
                numbers
                    .iter()
                    .any(|own| self.changed[*own].contains(condition))
            };
            let others = (0..self.conditions).filter(|own| !is_own(own));
            others.for_each(|own| before[own] = after[own]);
            for number in numbers {
                let sample = run.time.partition_point(|own| *own <= begin + least);
                let sample = run.time.get(sample).copied().unwrap_or(end);
                let rounding = 1e3 * f64::EPSILON * time.abs();
                let length = (SHORT * (sample.min(next(k + 1)) - begin)).max(rounding);
                let mut during = before.clone();
                (self.changed[*number].iter()).for_each(|own| during[*own] = after[*own]);
                let to = begin + length;
                steps.time.push(begin);
                let jump = Some((*number, *time, to - begin));
                steps.values.push(self.row(&during, &before, jump));
                (begin, before) = (to, during);
            }
            steps.time.push(begin);
            steps.values.push(self.row(&after, &after, None));
            before = after;
        }
        steps
    }

    /// The inputs of a part of a run: conditions, those before a jump, and its height for the sought time, place and length.
    fn row(&self, after: &[f64], before: &[f64], jump: Option<(usize, f64, f64)>) -> Vec<f64> {
        if !self.are_sought() {
            return after.to_vec();
        }
        let mut row = [after, before].concat();
        let numbers = (0..self.sought.len()).filter(|k| self.sought[*k]);
        for number in numbers {
            let own = jump.filter(|(own, ..)| *own == number);
            let height = own.map_or(0.0, |(_, _, length)| 1.0 / length);
            row.extend([height, own.map_or(0.0, |(_, time, _)| height * time)]);
        }
        row
    }

    /// How far the sought times of a run are from their boundaries \[s\], relative to its length, with this θ and these initial
    /// states: one for each time, 0 without a boundary, and whether it is within the run.
    pub fn offsets(&self, run: &Run, theta: &[f64], initial: &[f64]) -> Vec<(f64, bool)> {
        let last = run.time.len() - 1;
        let (begin, end) = (run.time[0], run.time[last]);
        let count = 2 * self.conditions;
        let mut found = Vec::new();
        let mut place = count;
        for (number, _) in self.sought.iter().enumerate().filter(|own| *own.1) {
            let mut jumps = run.steps.values.iter().enumerate();
            let jump = jumps.find(|(_, row)| row[place] > 0.0);
            place += 2;
            found.push(match jump {
                None => (0.0, true),
                Some((k, _)) => {
                    let s = run.steps.time[k - 1];
                    let row = run.time.partition_point(|time| *time <= s).max(1) - 1;
                    let at = [&[s], initial, &run.inputs[row], theta].concat();
                    let time = self.tape.evaluate(&at)[self.conditions + number];
                    let least = NEAR * (end - begin);
                    let is_inside = begin + least < time && time < end - least;
                    ((time - s) / (end - begin), is_inside)
                }
            });
        }
        found
    }

    /// Whether times agree with their boundaries.
    pub fn agree(offsets: &[(f64, bool)]) -> bool {
        offsets.iter().all(|(offset, _)| offset.abs() <= NEAR)
    }
}
