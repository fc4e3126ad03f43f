//! Initialization: from newly created components to consistent values at the start time.

use super::{MasterError, Stage, algebraic_loop};
use crate::algorithms::Propagation;
use crate::component::{Component, ComponentError, Experiment, Role, Value};
use crate::system::{Connection, System};
use thiserror::Error;

/// Initializes all components with consistent values at the start time.
pub(super) fn initialize(system: &mut System, experiment: &Experiment) -> Result<(), MasterError> {
    enter(system, experiment)?;
    propagate(system)?;
    exit(system)
}

/// Enters initialization with the system's start values; values on wires are not yet consistent.
pub(super) fn enter(system: &mut System, experiment: &Experiment) -> Result<(), MasterError> {
    each(system, Stage::Setup, |component| {
        component.setup(experiment)
    })?;
    apply_settings(system, |role| role != Role::Input)?;
    each(system, Stage::EnterInitialization, |component| {
        component.enter_initialization()
    })?;
    apply_settings(system, |role| role == Role::Input)
}

/// Exits initialization.
pub(super) fn exit(system: &mut System) -> Result<(), MasterError> {
    each(system, Stage::ExitInitialization, |component| {
        component.exit_initialization()
    })
}

fn each(
    system: &mut System,
    stage: Stage,
    mut call: impl FnMut(&mut dyn Component) -> Result<(), ComponentError>,
) -> Result<(), MasterError> {
    for instance in &mut system.instances {
        call(instance.component.as_mut()).map_err(|source| MasterError::Initialization {
            instance: instance.name.clone(),
            stage: stage.clone(),
            source,
        })?;
    }
    Ok(())
}

/// Sets the start values of variables with the wanted roles.
fn apply_settings(system: &mut System, wanted: impl Fn(Role) -> bool) -> Result<(), MasterError> {
    for (port, value) in &system.settings {
        let instance = &mut system.instances[port.instance];
        let variable = &instance.component.variables()[port.variable];
        if !wanted(variable.role) {
            continue;
        }
        let (handle, name) = (variable.handle, variable.name.clone());
        let failed = |source| MasterError::Initialization {
            instance: instance.name.clone(),
            stage: Stage::Set(name),
            source,
        };
        instance.component.set(handle, value).map_err(failed)?;
    }
    Ok(())
}

/// Passes values along the connections until they are consistent.
pub(super) fn propagate(system: &mut System) -> Result<(), MasterError> {
    let propagation = Propagation::of(system);
    for &c in &propagation.once {
        pass(system, &system.connections[c].clone())?;
    }
    let repeated = &propagation.repeated;
    let is_real = |c: &usize| system.is_real(&system.connections[*c]);
    match repeated.iter().all(is_real) {
        true => algebraic_loop::solve(system, repeated),
        false => sweep(system, repeated),
    }
}

/// Maximum number of sweeps through an algebraic loop with non-real values.
const MAX_SWEEPS: usize = 100;

/// Passes values around repeatedly until they no longer change.
fn sweep(system: &mut System, repeated: &[usize]) -> Result<(), MasterError> {
    let mut last: Vec<Option<Value>> = vec![None; repeated.len()];
    for _ in 0..MAX_SWEEPS {
        let mut has_settled = true;
        for (&c, last) in repeated.iter().zip(&mut last) {
            let value = pass(system, &system.connections[c].clone())?;
            has_settled &= last.as_ref().is_some_and(|last| is_close(last, &value));
            *last = Some(value);
        }
        if has_settled {
            return Ok(());
        }
    }
    let names = repeated.iter();
    Err(MasterError::Unsettled {
        names: names
            .map(|&c| system.port_name(system.connections[c].from))
            .collect(),
        sweeps: MAX_SWEEPS,
    })
}

fn is_close(a: &Value, b: &Value) -> bool {
    const TOLERANCE: f64 = 1e-12;
    match (a, b) {
        (Value::Real(a), Value::Real(b)) => (a - b).abs() <= TOLERANCE * (1.0 + b.abs()),
        _ => a == b,
    }
}

/// A value that could not be passed through a connection.
#[derive(Debug, Error)]
#[error("`{from}` -> `{to}`")]
struct Lost {
    from: String,
    to: String,
    source: ComponentError,
}

/// Passes one value along one connection.
fn pass(system: &mut System, connection: &Connection) -> Result<Value, MasterError> {
    let (from, to) = (
        system.variable(connection.from),
        system.variable(connection.to),
    );
    let (from_handle, kind, to_handle, to_kind) = (from.handle, from.kind, to.handle, to.kind);
    let (name, target_name) = (from.name.clone(), to.name.clone());
    let ends = [connection.from, connection.to].map(|port| system.port_name(port));
    let lost = |source: ComponentError| -> ComponentError {
        let [from, to] = ends.clone();
        Box::new(Lost { from, to, source })
    };
    let failed = |instance: &str| {
        let instance = instance.to_owned();
        move |source| MasterError::Initialization {
            instance,
            stage: Stage::Propagate(name),
            source,
        }
    };
    let source = &mut system.instances[connection.from.instance];
    let got = source.component.get(from_handle, kind);
    let got = got.and_then(|value| value.mapped(&connection.map, to_kind).map_err(lost));
    let value = match got.map_err(failed.clone()(&source.name))? {
        Value::Real(value) => Value::Real(connection.conversion.apply(value)),
        other => other,
    };
    let target = &mut system.instances[connection.to.instance];
    let set = target.component.set(to_handle, &value);
    set.map_err(|why| MasterError::Initialization {
        instance: target.name.clone(),
        stage: Stage::Set(target_name),
        source: lost(why),
    })?;
    Ok(value)
}
