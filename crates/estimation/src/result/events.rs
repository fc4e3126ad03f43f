//! Events of FMUs. Their equations hold only between events.

use crate::posed::Posed;
use crate::search::solved::Solved;
use crate::system::part::FmuPart;
use pilotage_collocation::Stop;
use pilotage_expression::Node;
use std::fmt;

/// An event in a run that the fit does not account for.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// The instance.
    pub instance: String,
    /// Its file.
    pub file: String,
    /// Name of its event indicator.
    pub indicator: String,
    /// Name of the run.
    pub run: String,
    /// The first point of the mesh after the event \[s\].
    pub time: f64,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "`{}` ({}) has an event up to {} s of {}, where {} changes its sign: the fit goes on with the equations \
             before it; fit the time before alone",
            self.instance, self.file, self.time, self.run, self.indicator
        )
    }
}

/// Indicators below this value at the start of a run are zero up to rounding.
const ROUNDING: f64 = 1e-14;

/// The events of a solution.
#[derive(Debug, Clone, Default)]
pub struct Events {
    /// The first event of each FMU in each run.
    pub found: Vec<Event>,
    /// Whether the search for events was completed.
    pub is_whole: bool,
}

/// The first event of each FMU in each run, searched at all points where the scheme evaluates the equations.
pub(crate) fn events(posed: &Posed<'_>, solved: &Solved, stop: &Stop<'_>) -> Events {
    let mut found = Vec::new();
    let is_seen = |j: usize| {
        let watched = watched(posed);
        watched.is_empty() || see_run(posed, solved, j, (watched, &mut found), stop)
    };
    let is_whole = (0..posed.runs.len()).all(is_seen);
    Events { found, is_whole }
}

/// The event indicators of an FMU in a run.
struct Watched<'p> {
    instance: &'p str,
    fmu: &'p FmuPart,
    /// Their nodes in the joint model.
    nodes: &'p [Node],
    /// Which indicators are positive at the start of the run. The FMU's own start is no reference: the run has other
    /// parameters and other initial states.
    begin: Vec<bool>,
}

/// The FMUs with event indicators.
fn watched<'p>(posed: &'p Posed<'_>) -> Vec<Watched<'p>> {
    let joint = &posed.joint.model;
    let parts = posed.joint.parts.iter();
    let own = parts.filter_map(|(instance, part)| {
        let fmu = part.fmu.as_ref()?;
        let first = format!("{instance}.{}", fmu.indicators.first()?);
        let first = joint.outputs.iter().position(|own| *own == first);
        // The indicators are consecutive outputs.
        let first = first.expect("an output of the instance");
        let nodes = &joint.system.outputs[first..][..fmu.indicators.len()];
        Some(Watched {
            instance,
            fmu,
            nodes,
            begin: Vec::new(),
        })
    });
    own.collect()
}

/// Finds the first event of each FMU in a run. Returns false if it was stopped.
fn see_run(
    posed: &Posed<'_>,
    solved: &Solved,
    j: usize,
    (mut open, found): (Vec<Watched<'_>>, &mut Vec<Event>),
    stop: &Stop<'_>,
) -> bool {
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let theta = problem.physical_theta(z);
    for (time, states, inputs) in problem.along(z, j) {
        if open.is_empty() {
            break;
        }
        if stop() {
            return false;
        }
        let at = [&[time], &states[..], &inputs, &theta].concat();
        let all = posed.model.system.graph.values(&at);
        let own: Vec<f64> = (posed.quantities.joint.iter())
            .map(|node| all[node.index()])
            .collect();
        let values = posed.joint.model.system.graph.values(&own);
        open.retain_mut(|watched| {
            let event = watched.see(&values);
            found.extend(event.map(|indicator| Event {
                instance: watched.instance.to_owned(),
                file: watched.fmu.path.display().to_string(),
                indicator: watched.fmu.indicators[indicator].clone(),
                run: posed.data[j].name(),
                time,
            }));
            event.is_none()
        });
    }
    true
}

impl Watched<'_> {
    /// The first indicator that has changed from above zero to zero or below, or vice versa (FMI 2.0.4, section 3.1),
    /// since the first point.
    fn see(&mut self, values: &[f64]) -> Option<usize> {
        let values = self.nodes.iter().map(|node| values[node.index()]);
        if self.begin.is_empty() {
            self.begin = values.map(|value| value > ROUNDING).collect();
            return None;
        }
        let has_changed = |(begin, value): (&bool, f64)| match begin {
            true => value <= 0.0,
            false => value > ROUNDING,
        };
        self.begin.iter().zip(values).position(has_changed)
    }
}
