//! Events of FMUs, between which alone their equations hold.

use crate::data::RunData;
use crate::error::ProblemError;
use crate::file::ProblemFile;
use crate::fit::Solved;
use crate::joint::Joint;
use crate::part::FmuPart;
use crate::posed::Posed;
use std::fmt;

/// An event that a run would have, which the fit does not know of.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// The instance.
    pub instance: String,
    /// Its file.
    pub file: String,
    /// Name of its indicator.
    pub indicator: String,
    /// Name of the run.
    pub run: String,
    /// The first point of the mesh behind the event \[s\].
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

/// Refuses runs in which an FMU has a time event.
pub(crate) fn check_times(
    file: &ProblemFile,
    joint: &Joint,
    data: &[RunData<'_>],
) -> Result<(), ProblemError> {
    for (instance, part) in &joint.parts {
        let Some((fmu, event)) = part
            .fmu
            .as_ref()
            .and_then(|fmu| Some((fmu, fmu.next_event?)))
        else {
            continue;
        };
        if let Some(run) = data.iter().find(|run| run.end() > event) {
            let source = file
                .system
                .instances
                .iter()
                .find(|own| own.name == *instance);
            let place = source.and_then(|own| own.source.place.as_ref());
            let fault = format!(
                "{} has an event at {event} s, and {} goes on to {} s; a fit takes equations without events: cut the \
                 runs there",
                fmu.path.display(),
                run.name(),
                run.end()
            );
            return Err(ProblemError::maybe_at(place, fault));
        }
    }
    Ok(())
}

/// The first event of each FMU in each run, wherever the scheme takes the equations.
pub(crate) fn events(posed: &Posed<'_>, solved: &Solved) -> Vec<Event> {
    let fmus = posed.joint.parts.iter();
    let fmus = fmus.filter_map(|(instance, part)| Some((instance, part.fmu.as_ref()?)));
    let fmus: Vec<(&String, &FmuPart)> =
        fmus.filter(|(_, fmu)| !fmu.indicators.is_empty()).collect();
    if fmus.is_empty() {
        return Vec::new();
    }
    let mut found = Vec::new();
    for j in 0..posed.runs.len() {
        let points = joint_values(posed, solved, j);
        for (instance, fmu) in &fmus {
            let event = first_event(posed, instance, fmu, &points);
            found.extend(event.map(|(time, indicator)| Event {
                instance: (*instance).clone(),
                file: fmu.path.display().to_string(),
                indicator,
                run: posed.data[j].name(),
                time,
            }));
        }
    }
    found
}

/// Times \[s\] of a run, and the values of all expressions of the joint model there.
fn joint_values(posed: &Posed<'_>, solved: &Solved, j: usize) -> Vec<(f64, Vec<f64>)> {
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let theta = problem.physical_theta(z);
    let along = problem.along(z, j).into_iter();
    let values = |(time, states, inputs): (f64, Vec<f64>, Vec<f64>)| {
        let at = [&[time], &states[..], &inputs, &theta].concat();
        let all = posed.model.system.graph.values(&at);
        let own = posed.told.joint.iter().map(|node| all[node.index()]);
        let own: Vec<f64> = own.collect();
        (time, posed.joint.model.system.graph.values(&own))
    };
    along.map(values).collect()
}

/// Where an indicator first has another sign than where the run begins, and which. An FMU's own start says nothing: the
/// run has other parameters and begins elsewhere.
fn first_event(
    posed: &Posed<'_>,
    instance: &str,
    fmu: &FmuPart,
    points: &[(f64, Vec<f64>)],
) -> Option<(f64, String)> {
    let events = fmu.indicators.iter().filter_map(|name| {
        let node = posed.joint.model.signal(&format!("{instance}.{name}"));
        let node = node.expect("an output of the instance").index();
        let begin = points.iter().map(|(_, all)| all[node]);
        let begin = begin.into_iter().find(|value| *value != 0.0)?;
        let behind = points.iter().find(|(_, all)| all[node] * begin < 0.0)?;
        Some((behind.0, name.clone()))
    });
    events.min_by(|a, b| a.0.total_cmp(&b.0))
}
