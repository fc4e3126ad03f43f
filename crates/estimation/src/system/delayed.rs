//! What stands in the instances for delays without an order.

use crate::problem::file::{ProblemFile, Sought, matching};
use crate::system::part::Part;
use pilotage_expression::{Function, Node, Operation, Operator, System};
use pilotage_language::{Delayed, ModelFileError};

/// An input of an instance that stands for a delay, and the outputs that say of what, and by how much.
#[derive(Debug, Clone)]
pub struct DelayedInput {
    /// The input.
    pub name: String,
    /// The delayed signal.
    pub signal: String,
    /// The delay \[s\].
    pub tau: String,
}

/// The instances with inputs in place of delays without an order that take recorded inputs alone, and with Padé's approximation in
/// place of the others; of this order, if any.
///
/// # Errors
/// If a model has no room for the states of that order.
pub fn with_delays(
    file: &ProblemFile,
    parts: Vec<(String, Part)>,
    order: Option<usize>,
) -> Result<Vec<(String, Part)>, ModelFileError> {
    let changed = |(name, part): (String, Part)| {
        let Some(compiled) = part.file.as_ref().filter(|own| !own.free_delays.is_empty()) else {
            return Ok((name, part));
        };
        let exact = exact(file, &name, &part);
        let own = compiled.free_delays.iter().zip(exact);
        let by: Vec<Delayed> = own
            .map(|(own, is_exact)| match (is_exact, order, own.by) {
                (true, ..) => Delayed::Input,
                (false, Some(order), _) => Delayed::Pade(order),
                (false, None, Delayed::Pade(order)) => Delayed::Pade(order),
                (false, None, Delayed::Input) => Delayed::Pade(Delayed::ORDER),
            })
            .collect();
        let is_same = compiled
            .free_delays
            .iter()
            .zip(&by)
            .all(|(own, by)| own.by == *by);
        match is_same {
            true => Ok((name, part)),
            false => Ok((name, Part::of_file(compiled.with_delays(&by)?))),
        }
    };
    parts.into_iter().map(changed).collect()
}

/// For each delay without an order of an instance whether it takes recorded inputs alone, besides parameters, which are not sought
/// unless it is a line in the inputs. A filter linearises between samples and sees no shift by a part of one.
fn exact(file: &ProblemFile, instance: &str, part: &Part) -> Vec<bool> {
    let Some(compiled) = &part.file else {
        return Vec::new();
    };
    let system = &compiled.model.system;
    let declared = &compiled.file.inputs;
    let name = |own: usize| format!("{instance}.{}", declared[own].name);
    let is_wired = |name: &String| {
        let mut wires = file.system.connections.iter();
        wires.any(|wire| wire.to.value == *name)
    };
    let is_fed = |name: &String| file.inputs.iter().any(|fed| fed.signal.value == *name);
    let own = |signal| {
        let needed = system.graph.ancestors(&[signal]);
        let takes = |variable: usize| {
            let node = system.graph.known_variable(variable);
            node.is_some_and(|node| needed[node.index()])
        };
        let (inputs, parameters) = (system.input(0), system.parameter(0));
        let taken: Vec<usize> = (inputs..parameters)
            .filter(|k| takes(*k))
            .map(|k| k - inputs)
            .collect();
        let is_recorded = |own: &usize| *own < declared.len() && !is_wired(&name(*own));
        let sought = |place: usize| {
            let full = [format!(
                "{instance}.{}",
                compiled.model.parameters[place - parameters]
            )];
            let is_own = |line: &Sought| !matching(&line.name.value, &full).is_empty();
            takes(place) && file.parameters.iter().any(is_own)
        };
        let is_given = || !(parameters..system.variables()).any(sought);
        !(0..inputs).any(takes)
            && taken.iter().all(is_recorded)
            && taken.iter().any(|own| is_fed(&name(*own)))
            && (is_given() || is_line(system, signal))
    };
    let all = compiled.free_delays.iter();
    all.map(|delay| file.process_noise.is_empty() && own(delay.signal))
        .collect()
}

/// Whether the derivatives of an expression with respect to all inputs do not depend on any.
fn is_line(system: &System, signal: Node) -> bool {
    let mut graph = system.graph.clone();
    let inputs = system.input(0)..system.parameter(0);
    let slopes: Vec<Node> = inputs
        .clone()
        .map(|input| graph.derivatives(&[signal], input)[0])
        .collect();
    let varies = graph.dependants(|variable| inputs.contains(&variable));
    // A step function has zero slope but is no line.
    let needed = graph.ancestors(&[signal]);
    let is_bent = |(k, own): (usize, &Operation)| {
        let is_kink = matches!(
            own,
            Operation::Select(..)
                | Operation::Lookup(..)
                | Operation::Unary(Function::Abs | Function::Sign, _)
                | Operation::Binary(Operator::Less | Operator::Equal | Operator::Remainder, ..)
        );
        needed[k] && varies[k] && is_kink
    };
    !slopes.iter().any(|own| varies[own.index()])
        && !graph
            .operations()
            .iter()
            .enumerate()
            .take(needed.len())
            .any(is_bent)
}
