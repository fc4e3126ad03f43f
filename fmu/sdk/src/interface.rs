//! The interface of a model, from which an exporter describes it, in memory and as text.

use crate::structure::{Structure, Unknown};
use crate::variable::Variable;
use crate::{Equations, guard, json};

/// The interface of a model: the content of its modelDescription.xml.
#[derive(Debug, Clone, PartialEq)]
pub struct Interface {
    /// Name: FMI's `modelIdentifier`.
    pub name: String,
    /// Description in one sentence.
    pub description: String,
    /// FMI's `guid` and `instantiationToken`.
    pub guid: String,
    /// The variables, in the order of their value references.
    pub variables: Vec<Variable>,
    /// Index of each state's variable, in the order of the states.
    pub states: Vec<usize>,
    /// Dependencies of the unknowns.
    pub structure: Structure,
}

impl Interface {
    /// The interface of a model.
    pub fn of<E: Equations>(equations: &E) -> Self {
        let table = equations.table();
        Self {
            structure: Structure::of(equations, &table),
            name: table.name().to_owned(),
            description: table.description().to_owned(),
            guid: table.guid(),
            states: table.states().collect(),
            variables: table.variables().to_vec(),
        }
    }

    /// Index of the state of which the variable is the derivative.
    pub fn state_of(&self, derivative: usize) -> Option<usize> {
        let list = &self.structure.derivatives;
        let state = list.iter().position(|d| d.index == derivative)?;
        self.states.get(state).copied()
    }

    /// The interface as JSON, which `pilotage pack` reads from the library of a model.
    pub fn to_json(&self) -> String {
        let unknowns = |list: &[Unknown]| json::array(list.iter().map(unknown));
        json::object([
            ("format", "2".to_owned()),
            ("name", json::string(&self.name)),
            ("description", json::string(&self.description)),
            ("guid", json::string(&self.guid)),
            (
                "variables",
                json::array(self.variables.iter().map(Variable::to_json)),
            ),
            (
                "states",
                json::array(self.states.iter().map(usize::to_string)),
            ),
            ("outputs", unknowns(&self.structure.outputs)),
            ("derivatives", unknowns(&self.structure.derivatives)),
            ("indicators", unknowns(&self.structure.indicators)),
            ("initial", unknowns(&self.structure.initial)),
        ])
    }
}

fn unknown(unknown: &Unknown) -> String {
    let on = unknown.dependencies.iter();
    json::object([
        ("index", unknown.index.to_string()),
        (
            "dependencies",
            json::array(on.clone().map(|d| d.index.to_string())),
        ),
        ("constant", json::array(on.map(|d| d.constant.to_string()))),
    ])
}

/// The text of a model's interface, for the C function that `export!` makes; if the model panics, its message:
/// `{"panic": "..."}`.
pub fn text_of<E: Equations + Default>() -> std::ffi::CString {
    // A library has its own panic hook; the importer's is not changed. The hook is silent here, since a panic is
    // reported in the text or occurs outside the domain of the equations.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let text = std::panic::catch_unwind(|| Interface::of(&E::default()).to_json());
    std::panic::set_hook(hook);
    let text = text.unwrap_or_else(|panic| {
        json::object([("panic", json::string(&guard::message(panic.as_ref())))])
    });
    // JSON has no zero byte: it is escaped.
    std::ffi::CString::new(text).unwrap_or_default()
}

/// Loads a model that is part of the library: see [`Load`](crate::Load).
///
/// # Errors
/// Never.
pub fn compiled_in<E: Equations + Default>(
    _resources: Option<&str>,
) -> Result<E, crate::resources::LoadError> {
    Ok(E::default())
}
