//! Bounds on expressions along the runs, and constraints on the shared parameters.

use super::inputs::Span;
use super::{Assembly, Done, Known};
use crate::posed::assembly::made::Stands;
use crate::posed::data::Rows;
use crate::posed::interval::{ALL, Interval};
use crate::posed::names::Of;
use crate::posed::stability;
use crate::posed::unknowns::{Meaning, Unknown};
use crate::problem::error::ProblemError;
use crate::problem::file::{Constraint, Holds, Initial};
use pilotage_collocation::{Bound, BoundAt, ParameterConstraints};
use pilotage_expression::{Graph, Node};

impl Assembly<'_> {
    /// Bounds an expression; `name` is its name in messages.
    fn bound(&mut self, name: &str, node: Node, [lower, upper]: Interval, at: BoundAt) {
        let is_open = !(lower > f64::NEG_INFINITY || upper < f64::INFINITY);
        if !is_open && self.graph.value(node).is_none() {
            let everywhere = Bound::at_samples(lower, upper);
            let bound = Bound { at, ..everywhere };
            self.bounded.push((node, bound));
            self.names.bounds.push(name.to_owned());
        }
    }

    /// Bounds outputs by their limits at every sample.
    pub(super) fn limit(&mut self) {
        let mut first = 0;
        for (instance, part) in &self.joint.parts {
            let variables = self.part_variables(instance, part, Span::Run);
            for (k, limit) in part.limits.iter().enumerate() {
                let Some(limit) = limit else { continue };
                let graph = &part.model.system.graph;
                let ends = self.graph.import(graph, limit, &variables);
                let name = format!("the limit of `{instance}.{}`", part.model.outputs[k]);
                self.limit_output(&name, self.outputs[first + k], [ends[0], ends[1]]);
            }
            first += part.model.outputs.len();
        }
    }

    fn limit_output(&mut self, name: &str, output: Node, [low, high]: [Node; 2]) {
        match (self.graph.value(low), self.graph.value(high)) {
            (Some(low), Some(high)) => self.bound(name, output, [low, high], BoundAt::Samples),
            _ => {
                let above = self.graph.subtract(output, low);
                let below = self.graph.subtract(high, output);
                self.bound(name, above, [0.0, f64::INFINITY], BoundAt::Samples);
                self.bound(name, below, [0.0, f64::INFINITY], BoundAt::Samples);
            }
        }
    }

    /// Constrains states that are steady at the start.
    pub(super) fn hold_steady(&mut self, derivatives: &[Node]) {
        for (name, derivative) in self.joint.model.states.iter().zip(derivatives) {
            let line = self.initial_line(name);
            if let Some(Initial::Steady) = line.map(|line| &self.file.initial[line].1) {
                let name = format!("`{name} = \"steady\"`");
                self.bound(&name, *derivative, [0.0; 2], BoundAt::Start);
            }
        }
    }

    /// Bounds the unknowns by their ranges. Those of shared parameters are returned as expressions that must be
    /// nonnegative.
    pub(super) fn bound_unknowns(&mut self) -> Vec<(Node, String)> {
        let mut on_parameters = Vec::new();
        let parameters = self.parameters;
        for (k, unknown) in parameters.unknowns.iter().enumerate() {
            let range = unknown.searched_range();
            let is_state = matches!(self.stands[k], Stands::State(_));
            let name = format!("the range of `{}`", unknown.name);
            for variable in self.stands[k].variables(self.first_shared()) {
                let variable = self.graph.variable(variable);
                match is_state {
                    true => self.bound(&name, variable, range, BoundAt::Start),
                    false => on_parameters.extend(self.within(&name, variable, range)),
                }
            }
        }
        on_parameters
    }

    /// Bounds parameters that are tied, or set by expressions in runs, by the ranges of their models. Bounds on shared
    /// parameters alone are returned.
    pub(super) fn bound_expressions(&mut self) -> Vec<(Node, String)> {
        let mut on_parameters = Vec::new();
        let parameters = self.parameters;
        for name in &parameters.names {
            let is_tied = matches!(parameters.meanings[name], Meaning::Tied(_));
            let node = self.values[0][name];
            if !(is_tied || self.is_set_by_expression(name)) || !self.depends_on_sought(node) {
                continue;
            }
            let [min, max] = parameters.range(name, self.joint);
            let range = [min.unwrap_or(ALL[0]), max.unwrap_or(ALL[1])];
            let what = format!("the range of `{name}`");
            match self.is_shared(node) {
                true => on_parameters.extend(self.within(&what, node, range)),
                false => self.bound(&what, node, range, BoundAt::Samples),
            }
        }
        on_parameters
    }

    fn is_set_by_expression(&self, name: &str) -> bool {
        let mut sets = self.data.iter().flat_map(|run| run.line.sets());
        sets.any(|set| set.name.value == name && set.value.number().is_none())
    }

    /// Applies the file's constraints. Those on shared parameters alone are returned as expressions that must be
    /// nonnegative.
    pub(super) fn constrain(
        &mut self,
        signals: &[Node],
        rows: &[Rows],
        known: &Known,
    ) -> Done<Vec<(Node, String)>> {
        let mut on_parameters = Vec::new();
        let zero = self.graph.constant(0.0);
        let all = 0..self.file.constraints.len();
        let all: Vec<Of> = all.map(Of::Constraint).collect();
        let nodes = self.of_signals(&all, signals, zero);
        self.check_constraints(&nodes, rows)?;
        self.check_begins(&nodes, rows, known)?;
        for (line, node) in self.file.constraints.iter().zip(nodes) {
            let range = [line.min, line.max];
            let name = format!("the constraint on `{}`", line.formula.expression.text);
            let at = match line.at {
                Holds::Samples => BoundAt::Samples,
                Holds::Start => BoundAt::Start,
                Holds::End => BoundAt::End,
                Holds::Parameters if self.is_shared(node) => {
                    on_parameters.extend(self.within(&name, node, range));
                    continue;
                }
                Holds::Parameters => BoundAt::Start,
            };
            self.check_path_constraint(line)?;
            self.bound(&name, node, range, at);
        }
        Ok(on_parameters)
    }

    /// Rejects path constraints with process noise: the path is then known only at the start.
    fn check_path_constraint(&self, line: &Constraint) -> Done<()> {
        let is_along = matches!(line.at, Holds::Samples | Holds::End);
        match self.file.process_noise.is_empty() || !is_along {
            true => Ok(()),
            false => {
                let fault = "with process noise no path is known to bound: write at = \"start\" or \"parameters\", or \
                             leave the constraint out";
                Err(ProblemError::at(&line.place, fault))
            }
        }
    }

    /// Whether an expression depends only on shared parameters.
    fn is_shared(&self, node: Node) -> bool {
        let shared = self.first_shared();
        !self.depends(node, |variable| variable < shared)
    }

    /// `x - low` and `high - x`, for finite bounds.
    fn within(&mut self, name: &str, node: Node, [low, high]: Interval) -> Vec<(Node, String)> {
        let mut found = Vec::new();
        for (sign, end) in [(1.0, low), (-1.0, high)] {
            if end.is_finite() {
                let end = self.graph.constant(end);
                let above = self.graph.subtract(node, end);
                found.push((self.graph.scale(sign, above), name.to_owned()));
            }
        }
        found
    }

    /// Range of each variable of the equations.
    pub(super) fn ranges(&self, rows: &[Rows]) -> Vec<Interval> {
        let mut ranges = vec![ALL; self.variables()];
        for (k, variable) in self.input_variables().enumerate() {
            let samples = rows.iter().flat_map(|rows| &rows.inputs);
            let values = samples.map(|inputs| inputs[k]);
            ranges[variable] = [
                values.clone().fold(f64::INFINITY, f64::min),
                values.fold(f64::NEG_INFINITY, f64::max),
            ];
        }
        for (unknown, stands) in self.parameters.unknowns.iter().zip(&self.stands) {
            for variable in stands.variables(self.first_shared()) {
                ranges[variable] = unknown.searched_range();
            }
        }
        ranges
    }

    /// Constraints on the shared parameters, including stability.
    pub(super) fn parameter_constraints(
        &mut self,
        mut on_parameters: Vec<(Node, String)>,
        rows: &[Rows],
    ) -> Done<ParameterConstraints> {
        let at = stability::Point {
            joint: self.within,
            file: self.file,
            values: &self.values[0],
            initial: &self.operating_point(rows),
        };
        self.names.stability = on_parameters.len();
        on_parameters.extend(stability::conditions(&mut self.graph, &at)?);
        let (on_parameters, names): (Vec<Node>, _) = on_parameters.into_iter().unzip();
        self.names.parameters = names;
        // Only over the shared parameters. Runs' own values and numbers are taken at the start of the first run.
        let mut graph = Graph::default();
        let begin = self.begin_values(&rows[0]);
        let variables: Vec<Node> = (0..self.variables())
            .map(|k| match k.checked_sub(self.first_shared()) {
                Some(theta) => graph.variable(theta),
                None => graph.constant(begin[k]),
            })
            .collect();
        let nodes = graph.import(&self.graph, &on_parameters, &variables);
        Ok(ParameterConstraints::of(&graph, self.shared, &nodes))
    }
}

impl Unknown {
    /// Range of the search.
    pub(crate) fn searched_range(&self) -> Interval {
        let end = |end: Option<f64>, open: f64| end.map_or(open, |end| self.searched(end));
        [end(self.min, ALL[0]), end(self.max, ALL[1])]
    }
}
