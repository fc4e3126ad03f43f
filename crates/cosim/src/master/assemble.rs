//! Sets up the exchange of values: each output gets a slot, each input refers to the slot that feeds it.

use super::exchange::Exchange;
use super::history::{History, InputProfile, Traits};
use super::wired::{Values, Wired};
use super::wires::{Inputs, Outlets, Outputs, Reading, Wire};
use crate::algorithms::{Coupling, gauss_seidel_order};
use crate::component::{Role, Value, ValueKind};
use crate::recorder::Signal;
use crate::system::{Connection, Instance, System};
use std::collections::HashMap;

impl Exchange {
    pub(super) fn new(system: System, coupling: &Coupling) -> Self {
        let mut assembly = Assembly::default();
        let instances = &system.instances;
        let mut outlets: Vec<Outlets> = (instances.iter().enumerate())
            .map(|(position, instance)| assembly.outlets(position, instance))
            .collect();
        let mut wires: Vec<Vec<Wire>> = instances.iter().map(|_| Vec::new()).collect();
        for connection in &system.connections {
            let wire = assembly.wire(connection, instances, &mut outlets);
            wires[connection.to.instance].extend(wire);
        }
        let Assembly {
            values,
            signals,
            unrecorded,
            fed,
            nominals,
            mut traits,
            ..
        } = assembly;
        let has_any = system.instances.iter().any(|own| own.at_once);
        let order = has_any.then(|| gauss_seidel_order(&system));
        let order = order.into_iter().flatten();
        let at_once: Vec<usize> = order.filter(|&i| system.instances[i].at_once).collect();
        let parts = system.instances.into_iter().zip(outlets).zip(wires);
        let wired = parts
            .enumerate()
            .map(|(position, ((instance, outlets), wires))| {
                let inputs = system
                    .connections
                    .iter()
                    .filter(|c| c.to.instance == position);
                let inputs: Vec<usize> = inputs.map(|c| c.to.variable).collect();
                let outputs = Outputs::new(outlets, instance.component.as_ref(), &inputs, &fed);
                let Instance {
                    name,
                    component,
                    parts,
                    at_once,
                    ..
                } = instance;
                Wired::new(
                    name,
                    component,
                    parts,
                    at_once,
                    Inputs::new(&wires),
                    outputs,
                    coupling,
                )
            });
        let wired: Vec<Wired> = wired.collect();
        for wired in wired.iter().filter(|w| !w.within.sloped.is_empty()) {
            for &p in &wired.outputs.fed_positions {
                traits[p].has_slope = !traits[p].is_discrete;
            }
        }
        let n = fed.len();
        Self {
            wired,
            at_once,
            signals,
            unrecorded,
            fed,
            history: History::new(nominals, traits),
            profiles: vec![InputProfile::default(); n],
            seen: vec![None; n],
            others_before: values.others.clone(),
            others_given: values.others.clone(),
            values: Values {
                slopes: vec![0.0; n],
                ..values
            },
        }
    }
}

/// Data collected from the instances and connections.
#[derive(Default)]
struct Assembly {
    values: Values,
    signals: Vec<Signal>,
    unrecorded: Vec<String>,
    /// Slot of each output by instance and variable: in the row for reals, in `others` for other types.
    slots: HashMap<(usize, usize), usize>,
    /// Slots in the row of real outputs that feed inputs, with nominal values and traits.
    fed: Vec<usize>,
    nominals: Vec<Option<f64>>,
    traits: Vec<Traits>,
}

impl Assembly {
    /// Assigns a slot to each output of an instance and each additional recorded variable.
    fn outlets(&mut self, position: usize, instance: &Instance) -> Outlets {
        let Instance {
            name,
            component,
            observed,
            ..
        } = instance;
        let first = self.values.row.len();
        let mut handles = Vec::new();
        let is_read = |index, role| role == Role::Output || observed.contains(&index);
        let all = || {
            let variables = component.variables().iter().enumerate();
            variables.filter(|(index, variable)| is_read(*index, variable.role))
        };
        for (index, variable) in all().filter(|(_, v)| v.kind == ValueKind::Real) {
            self.slots.insert((position, index), self.values.row.len());
            handles.push(variable.handle);
            self.add_signal(name, variable);
        }
        let slots = first..self.values.row.len();
        let mut others = Vec::new();
        for (index, variable) in all().filter(|(_, v)| v.kind != ValueKind::Real) {
            let is_text = variable.kind == ValueKind::String;
            let column = (!is_text).then_some(self.values.row.len());
            let reading = self.reading(variable.handle, variable.kind, variable.kind, column);
            self.slots.insert((position, index), reading.slot);
            others.push(reading);
            match is_text {
                true => self.unrecorded.push(format!("{name}.{}", variable.name)),
                false => self.add_signal(name, variable),
            }
        }
        Outlets {
            handles,
            slots,
            others,
        }
    }

    /// Allocates a slot for a non-real value, and optionally links it to a column of the row.
    fn reading(
        &mut self,
        handle: u32,
        kind: ValueKind,
        wanted: ValueKind,
        column: Option<usize>,
    ) -> Reading {
        let slot = self.values.others.len();
        self.values.others.push(Value::Integer(0));
        self.values.other_slots.push(column);
        Reading {
            handle,
            kind,
            wanted,
            map: Vec::new(),
            slot,
            wire: String::new(),
        }
    }

    fn add_signal(&mut self, instance: &str, variable: &crate::Variable) {
        self.values.row.push(f64::NAN);
        let unit = variable.unit.as_ref();
        self.signals.push(Signal {
            name: format!("{instance}.{}", variable.name),
            unit: unit.map_or(String::new(), |own| own.name.clone()),
            description: variable.description.clone(),
        });
    }

    /// The wire of a connection. An output of another type than the input is read as a value of the input's type.
    fn wire(
        &mut self,
        connection: &Connection,
        instances: &[Instance],
        outlets: &mut [Outlets],
    ) -> Option<Wire> {
        let (from, to) = (connection.from, connection.to);
        let slot = *self.slots.get(&(from.instance, from.variable))?;
        let output = &instances[from.instance].component.variables()[from.variable];
        let input = &instances[to.instance].component.variables()[to.variable];
        let handle = input.handle;
        let end = |instance: &Instance, name: &str| format!("`{}.{name}`", instance.name);
        let (begin, end) = (
            end(&instances[from.instance], &output.name),
            end(&instances[to.instance], &input.name),
        );
        let name = format!("{begin} -> {end}");
        if output.kind == ValueKind::Real && input.kind == ValueKind::Real {
            let position = self.position(slot, output.nominal, output.is_discrete);
            return Some(Wire {
                handle,
                slot,
                name,
                real: Some((position, connection.conversion)),
            });
        }
        let mut wire = Wire {
            handle,
            slot,
            name,
            real: None,
        };
        if output.kind != input.kind || !connection.map.is_empty() {
            let reading = self.reading(output.handle, output.kind, input.kind, None);
            wire.slot = reading.slot;
            outlets[from.instance].others.push(Reading {
                wire: wire.name.clone(),
                map: connection.map.clone(),
                ..reading
            });
        }
        Some(wire)
    }

    /// Position of a real output among those that feed inputs.
    fn position(&mut self, slot: usize, nominal: Option<f64>, is_discrete: bool) -> usize {
        let known = self.fed.iter().position(|&fed| fed == slot);
        known.unwrap_or_else(|| {
            self.fed.push(slot);
            self.nominals.push(nominal);
            self.traits.push(Traits {
                has_slope: false,
                is_discrete,
            });
            self.fed.len() - 1
        })
    }
}
