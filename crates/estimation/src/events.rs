//! Events of FMUs, between which alone their equations hold.

use crate::data::RunData;
use crate::error::ProblemError;
use crate::file::ProblemFile;
use crate::fit::Solved;
use crate::joint::Joint;
use crate::part::FmuPart;
use crate::posed::Posed;
use crate::result::variables;
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
    /// The first sample behind the event \[s\].
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

/// The first event of each FMU in each run, at the samples.
pub(crate) fn events(posed: &Posed<'_>, solved: &Solved) -> Vec<Event> {
    let fmus: Vec<(&String, &FmuPart)> = (posed.joint.parts.iter())
        .filter_map(|(instance, part)| Some((instance, part.fmu.as_ref()?)))
        .filter(|(_, fmu)| !fmu.indicators.is_empty())
        .collect();
    if fmus.is_empty() {
        return Vec::new();
    }
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let theta = problem.physical_theta(z);
    let joint = &posed.joint.model;
    let mut found: Vec<Event> = Vec::new();
    for j in 0..posed.runs.len() {
        for (sample, x) in problem.states_at_samples(z, j).iter().enumerate() {
            let all = (posed.model.system.graph).values(&variables(posed, j, sample, x, &theta));
            let own: Vec<f64> = posed
                .told
                .joint
                .iter()
                .map(|node| all[node.index()])
                .collect();
            let values = joint.system.graph.values(&own);
            for (instance, fmu) in &fmus {
                let is_other = |(name, start): &&(String, f64)| {
                    let name = format!("{instance}.{name}");
                    let node = joint.signal(&name).expect("an output of the instance");
                    values[node.index()] * start < 0.0
                };
                let event = fmu.indicators.iter().find(is_other);
                let run = posed.data[j].name();
                let is_first =
                    !(found.iter()).any(|own| own.instance == **instance && own.run == run);
                if let (Some((indicator, _)), true) = (event, is_first) {
                    found.push(Event {
                        instance: (*instance).clone(),
                        file: fmu.path.display().to_string(),
                        indicator: indicator.clone(),
                        run,
                        time: posed.runs[j].time[sample],
                    });
                }
            }
        }
    }
    found
}
