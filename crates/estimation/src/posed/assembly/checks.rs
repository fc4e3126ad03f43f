//! Checks before the solve that concern more than a single line of the file.

use super::{Assembly, Done, Known, Made};
use crate::posed::assembly::made::Quantities;
use crate::posed::data::{Rows, RunData};
use crate::posed::interval::{Interval, intervals, shared};
use crate::posed::ranges::check_range;
use crate::posed::unknowns::Unknown;
use crate::posed::{MOST_INTERVALS, MOST_SAMPLES};
use crate::problem::error::ProblemError;
use crate::problem::file::{Constraint, Deviation, Holds, Mesh};
use crate::system::part::Part;
use pilotage_cosim::description::Spanned;
use pilotage_expression::{Graph, Node};

/// A constraint violated by less than this, relative to its value, holds up to rounding and the solver's tolerance.
const MET: f64 = 1e-6;

impl Assembly<'_> {
    /// Rejects more samples than a solve can hold.
    pub(super) fn check_samples(&self) -> Done<()> {
        let count = |run: &RunData<'_>| run.series.time.len();
        let found: usize = self.data.iter().map(count).sum();
        match self.data.iter().max_by_key(|run| count(run)) {
            Some(longest) if found > MOST_SAMPLES => {
                let part = found.div_ceil(MOST_SAMPLES);
                let fault = format!(
                    "the runs have {found} rows, more than {MOST_SAMPLES}, and a fit takes about 5 kB for each; \
                     keep one in {part} of them, or fewer runs"
                );
                Err(ProblemError::at(&longest.line.place, fault))
            }
            _ => Ok(()),
        }
    }

    /// Rejects a step for which the mesh has more intervals than a solve can hold.
    pub(super) fn check_mesh(&self) -> Done<()> {
        let Mesh::Step(step) = self.file.options.mesh else {
            return Ok(());
        };
        let durations = self.data.iter().map(|run| {
            let time = &run.series.time;
            time[time.len() - 1] - run.begin()
        });
        let duration: f64 = durations.sum();
        if duration / step <= MOST_INTERVALS as f64 {
            return Ok(());
        }
        let least = duration / MOST_INTERVALS as f64;
        let fault = format!(
            "the runs last {duration} s, which is more than {MOST_INTERVALS} such steps; write {least:.1e} or more"
        );
        let place = self.file.mesh_place.as_ref();
        Err(ProblemError::maybe_at(place, fault))
    }

    /// Rejects parameters tied to a value outside their range where the search begins.
    pub(super) fn check_tied(&self, quantities: &Quantities, rows: &[Rows]) -> Done<()> {
        for (name, node) in &quantities.tied {
            let range = self.parameters.range(name, self.joint);
            let mut lines = self.file.parameters.iter();
            let line = lines.find(|line| line.name.value == *name);
            let place = line.and_then(|line| line.name.place.as_ref());
            for rows in rows {
                check_range(name, self.number(*node, rows), range, place)?;
            }
            let mut parts = self.joint.parts.iter();
            let is_of_fmu = |(instance, part): &(String, Part)| {
                let own = name.strip_prefix(instance.as_str());
                part.fmu.is_some() && own.is_some_and(|rest| rest.starts_with('.'))
            };
            let is_parameter = self.joint.model.parameters.contains(name);
            if is_parameter && self.varies(*node) && parts.any(is_of_fmu) {
                let fault = format!(
                    "`{name}` is a parameter of an FMU, which is set before a run, and is tied to the time; tie an input of the FMU"
                );
                return Err(ProblemError::maybe_at(place, fault));
            }
        }
        Ok(())
    }

    /// Whether an expression of parameters is tied to the time.
    pub(super) fn varies(&self, node: Node) -> bool {
        self.depends(node, |variable| variable == 0)
    }

    /// Rejects noise levels that are not above 0: at recorded samples, or at the start if they depend on neither states
    /// nor time.
    pub(super) fn check_deviation(
        &self,
        k: usize,
        node: Node,
        recorded: &[Vec<f64>],
        rows: &[Rows],
    ) -> Done<()> {
        let formula = match &self.file.measured[k].sd {
            Deviation::Column(name) => {
                return self.check_deviation_column(k, name, recorded, rows);
            }
            Deviation::Formula(formula) => formula,
        };
        let states = self.joint.model.states.len();
        let start = self.number(node, &rows[0]);
        match start > 0.0 || self.depends(node, |variable| variable <= states) {
            true => Ok(()),
            false => {
                let fault =
                    format!("the standard deviation starts at {start}; expected a number above 0");
                Err(ProblemError::at(&self.file.place(formula), fault))
            }
        }
    }

    fn check_deviation_column(
        &self,
        k: usize,
        name: &Spanned<String>,
        recorded: &[Vec<f64>],
        rows: &[Rows],
    ) -> Done<()> {
        let unit = self.file.measured[k].unit(self.joint);
        for ((run, rows), recorded) in self.data.iter().zip(rows).zip(recorded) {
            let column = run.column(name, unit)?;
            for (sample, row) in rows.rows.iter().enumerate() {
                let Some(sd) = row.map(|row| column[row]) else {
                    continue;
                };
                if recorded[sample].is_finite() && (sd.is_nan() || sd <= 0.0) {
                    let fault = format!(
                        "{}: the column `{}` is {sd} at {} s; a standard deviation is above 0",
                        run.line.file.display(),
                        name.value,
                        rows.time[sample]
                    );
                    return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
                }
            }
        }
        Ok(())
    }

    /// Rejects constraints that cannot be satisfied within the ranges of sought and recorded quantities.
    pub(super) fn check_constraints(&self, nodes: &[Node], rows: &[Rows]) -> Done<()> {
        // Intervals at the start, at the end, and at the samples between.
        let mut found = [(); 3].map(|()| intervals(&self.graph, &self.ranges(rows)));
        for (line, node) in self.file.constraints.iter().zip(nodes) {
            if line.formula.names().next().is_none() {
                let fault = "a constraint on a number, which nothing changes; leave it out";
                return Err(ProblemError::at(&line.place, fault));
            }
            let places = match line.at {
                Holds::Start => 0..1,
                Holds::End => 1..2,
                Holds::Samples | Holds::Parameters => 0..3,
            };
            for found in &mut found[places] {
                let own = &mut found[node.index()];
                let both = shared(*own, [line.min, line.max]);
                *own = both.ok_or_else(|| contradiction(line, *own, ""))?;
            }
        }
        Ok(())
    }

    /// Rejects constraints that are violated at the start of a run for all values of the unknowns, given its known
    /// initial states.
    pub(super) fn check_begins(&self, nodes: &[Node], rows: &[Rows], known: &Known) -> Done<()> {
        let lines = self.file.constraints.iter().zip(nodes);
        let lines = lines.filter(|(line, _)| matches!(line.at, Holds::Start | Holds::Samples));
        let lines: Vec<(&Constraint, &Node)> = lines.collect();
        for ((run, rows), initial) in self.data.iter().zip(rows).zip(known) {
            if lines.is_empty() {
                break;
            }
            let mut ranges = self.ranges(std::slice::from_ref(rows));
            let inputs = self.input_variables().zip(&rows.inputs[0]);
            let states = (1..).zip(initial.iter().copied());
            let states = states.filter_map(|(variable, x)| Some((variable, x?)));
            let inputs = inputs.map(|(variable, value)| (variable, *value));
            for (variable, value) in [(0, rows.time[0])].into_iter().chain(inputs).chain(states) {
                ranges[variable] = [value; 2];
            }
            let found = intervals(&self.graph, &ranges);
            for (line, node) in &lines {
                let own = found[node.index()];
                let slack = MET * own.map(f64::abs).into_iter().fold(1.0, f64::max);
                if shared(own, [line.min - slack, line.max + slack]).is_none() {
                    let place = format!(" where {} begins", run.name());
                    return Err(contradiction(line, own, &place));
                }
            }
        }
        Ok(())
    }
}

/// A constraint whose range does not intersect that of its expression.
fn contradiction(line: &Constraint, [low, high]: Interval, place: &str) -> ProblemError {
    let shown = &line.formula.expression.text;
    let is = match low == high {
        true => format!("always {low}{place}"),
        false => format!("from {low} to {high}{place} by what else is said"),
    };
    let (min, max) = (line.min, line.max);
    let fault = format!("`{shown}` is {is}, never from {min} to {max}; change one of them");
    ProblemError::at(&line.place, fault)
}

impl Made {
    /// The unknowns on which no measured signal depends.
    fn idle(&self) -> Vec<&Unknown> {
        let graph = &self.system.graph;
        let noises = self.noises.iter();
        let noises = noises.flat_map(|own| own.column.iter().chain([&own.density]));
        let wanted = self.measured.iter().chain(noises).copied().collect();
        let needed = needed(graph, &self.system.derivatives, wanted);
        let is_needed = |variable: &usize| {
            let node = graph.known_variable(*variable);
            node.is_some_and(|node| needed[node.index()])
        };
        let shared = self.system.parameter(0);
        let idle = self.unknowns.iter().filter(|(_, stands)| {
            let variables = stands.variables(shared);
            !variables.iter().any(is_needed)
        });
        idle.map(|(unknown, _)| unknown).collect()
    }

    /// Names of those that a pattern asks for together with others, on which measured signals do depend.
    pub fn to_leave_out(&self) -> Vec<String> {
        let idle = self.idle();
        let is_idle = |own: &Unknown| idle.iter().any(|other| other.name == own.name);
        let has_needed = |own: &&&Unknown| {
            let mut all = self.unknowns.iter().map(|(other, _)| other);
            // Those that start elsewhere than the pattern says (`ProblemFile::begin_at`) have its place too.
            all.any(|other| other.place == own.place && !is_idle(other))
        };
        let all = idle.iter().filter(|own| own.unless_needed.is_some());
        all.filter(has_needed).map(|own| own.name.clone()).collect()
    }

    /// Rejects unknowns on which no measured signal depends.
    pub fn check_dependence(&self) -> Done<()> {
        let idle = self.idle();
        let Some(unknown) = idle.first() else {
            return Ok(());
        };
        let fault = format!(
            "no measured signal depends on `{}`; leave it out, or write fixed = true",
            unknown.name
        );
        Err(ProblemError::maybe_at(unknown.place.as_ref(), fault))
    }
}

/// Whether these nodes depend on each node: directly, or through the derivatives of states.
pub(super) fn needed(graph: &Graph, derivatives: &[Node], mut nodes: Vec<Node>) -> Vec<bool> {
    loop {
        let needed = graph.ancestors(&nodes);
        let is_needed = |state: &usize| {
            let variable = graph.known_variable(1 + state);
            variable.is_some_and(|node| needed[node.index()])
        };
        let states = (0..derivatives.len()).filter(is_needed);
        let derivatives = states.map(|state| derivatives[state]);
        let before = nodes.len();
        nodes.extend(derivatives.filter(|node| !needed[node.index()]));
        if nodes.len() == before {
            return needed;
        }
    }
}
