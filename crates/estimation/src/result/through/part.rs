//! An instance as a problem of its own, driven by the columns of what is wired to it.

use crate::posed::Posed;
use crate::posed::data::RunData;
use crate::problem::file::{
    Deviation, Fed, Initial, Measured, Mesh, Noise, Objective, ProblemFile, Quantity, RunLine, Set,
};
use crate::system::part::Part;
use pilotage_cosim::description::{Spanned, Wire};
use pilotage_language::file::Formula;

/// An instance by itself.
pub struct Alone {
    /// The problem: its inputs and outputs are columns, nothing is sought but initial states.
    pub file: ProblemFile,
    /// The columns in place of its wires, which drive its first inputs.
    pub columns: Vec<String>,
}

impl Alone {
    /// None if something in the instance is sought, if an input or all outputs were not recorded, if no wire ends there, and for
    /// FMUs, which a call may end.
    pub fn of(posed: &Posed<'_>, instance: &str, part: &Part) -> Option<Self> {
        let own = |name: &str| {
            let rest = name.strip_prefix(instance);
            rest.is_some_and(|rest| rest.starts_with('.'))
        };
        let mut sought = posed.unknowns.iter().map(|(unknown, _)| &unknown.name);
        let mut tied = posed.quantities.tied.iter().map(|(name, _)| name);
        let mut noises = posed.file.process_noise.iter();
        let is_open = part.fmu.is_some()
            || sought.any(|name| own(name))
            || tied.any(|name| own(name))
            || noises.any(|noise| own(&noise.signal.value));
        if is_open {
            return None;
        }
        let mut file = posed.file.clone();
        let wires = std::mem::take(&mut file.system.connections);
        let wires: Vec<Wire> = wires
            .into_iter()
            .filter(|wire| own(&wire.to.value))
            .collect();
        let wired = |wire: &Wire| {
            Some(Fed {
                signal: wire.to.clone(),
                column: recorded(posed, wire)?,
                hold: None,
            })
        };
        let mut inputs: Vec<Fed> = wires.iter().map(wired).collect::<Option<_>>()?;
        let columns: Vec<String> = inputs.iter().map(|fed| fed.column.value.clone()).collect();
        inputs.extend(file.inputs.into_iter().filter(|fed| own(&fed.signal.value)));
        file.inputs = inputs;
        let measured = file.measured.into_iter();
        file.measured = measured
            .filter_map(|measured| response(posed, part, instance, measured))
            .collect();
        if columns.is_empty() || file.measured.is_empty() {
            return None;
        }
        file.system.instances.retain(|other| other.name == instance);
        file.system.settings.retain(|set| own(&set.name.value));
        (file.parameters).retain(|line| line.fixed && own(&line.name.value));
        file.initial = match part.model.states.is_empty() {
            true => Vec::new(),
            false => vec![(Spanned::from(format!("{instance}.*")), Initial::Free)],
        };
        file.process_noise.clear();
        file.constraints.clear();
        file.derived.clear();
        file.stability = Default::default();
        file.options.mesh = Mesh::Samples;
        file.options.objective = Objective::Response;
        file.runs.retain(|run| run.fits);
        let mut runs = file.runs.iter_mut().zip(&posed.data);
        let are_numbers = runs.all(|(run, data)| keep_own(run, data, &own));
        are_numbers.then_some(Self { file, columns })
    }
}

/// Keeps what a run sets in the instance. Returns whether all of that are numbers.
fn keep_own(run: &mut RunLine, data: &RunData<'_>, own: &dyn Fn(&str) -> bool) -> bool {
    run.recorded = Some(data.series.clone());
    let is_own = |set: &Set| own(&set.name.value);
    run.set.retain(is_own);
    for change in &mut run.changes {
        change.set.retain(is_own);
        change.add.retain(is_own);
    }
    run.changes
        .retain(|change| !(change.set.is_empty() && change.add.is_empty()));
    let mut all = run.sets().chain(run.added());
    all.all(|set| set.value.number().is_some())
}

/// The column of what a wire carries: that of a measured signal at one of its ends, or one of all runs that has the name of an end
/// and no other use.
fn recorded(posed: &Posed<'_>, wire: &Wire) -> Option<Spanned<String>> {
    let file = posed.file;
    let ends = [&wire.from.value, &wire.to.value];
    let is_there = |own: &&Measured| match &own.of {
        Quantity::Signal(name) => own.is_plain() && ends.contains(&name),
        Quantity::Expression(..) => false,
    };
    if let Some(measured) = file.measured.iter().find(is_there) {
        return Some(measured.column.clone());
    }
    let is_used = |name: &str| {
        let mut measured = file.measured.iter().map(|own| &own.column.value);
        let mut inputs = file.inputs.iter().map(|own| &own.column.value);
        measured.any(|own| own == name) || inputs.any(|own| own == name)
    };
    let has_it = |name: &str| {
        let mut runs = posed.data.iter();
        runs.all(|run| {
            run.series
                .column(name)
                .is_some_and(|own| own.values.iter().any(|y| y.is_finite()))
        })
    };
    let names = ends.into_iter().filter_map(|end| end.rsplit('.').next());
    let mut found = names.filter(|name| has_it(name) && !is_used(name));
    found.next().map(|name| Spanned::from(name.to_owned()))
}

/// A measured signal as one of the instance, of unit noise; none if it is another's, or an input.
fn response(
    posed: &Posed<'_>,
    part: &Part,
    instance: &str,
    measured: Measured,
) -> Option<Measured> {
    let Quantity::Signal(name) = &measured.of else {
        return None;
    };
    let source = posed.joint.driven.get(name).unwrap_or(name);
    let own = source.strip_prefix(instance)?.strip_prefix('.')?;
    let is_input = part.model.inputs.iter().any(|input| input == own);
    (measured.is_plain() && !is_input).then(|| Measured {
        of: Quantity::Signal(source.clone()),
        sd: Deviation::Formula(Formula::of_number(1.0)),
        noise: Noise::Normal,
        ..measured
    })
}
