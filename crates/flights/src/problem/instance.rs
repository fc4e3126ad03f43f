//! An instance of a problem that is written: its variables for connections, measurements and estimation.

use pilotage_models::{Role, TextModel};

/// An instance of the problem.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Its name.
    pub name: String,
    /// Its model, as the problem names it: a built-in model, or a file relative to the problem's folder.
    pub model: String,
    /// Order, for a built-in model that has one.
    pub order: Option<usize>,
    /// Values of its model that differ.
    pub set: Vec<(String, f64)>,
    /// Names of its inputs.
    pub inputs: Vec<String>,
    /// Names of outputs and states.
    pub outputs: Vec<String>,
    /// Names of its states.
    pub states: Vec<String>,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// Whether the parameters are known to be suited for estimation.
    pub is_known: bool,
}

/// A parameter that may be estimated.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value in the model.
    pub start: f64,
    /// Name of its unit; empty if it has none.
    pub unit: String,
    /// What it means.
    pub description: String,
}

impl Instance {
    /// The instance of a model file or a built-in model, which the problem names `model`.
    pub fn of_model(name: &str, model: &str, own: &TextModel) -> Self {
        let table = own.variables();
        let all = table.variables();
        let named = |is_it: &dyn Fn(Role) -> bool| -> Vec<String> {
            let own = all.iter().filter(|variable| is_it(variable.role));
            own.map(|variable| variable.name.clone()).collect()
        };
        let parameter = |index: usize| Parameter {
            name: all[index].name.clone(),
            start: all[index].start.unwrap_or_default(),
            unit: all[index].unit.name.to_string(),
            description: all[index].description.to_string(),
        };
        let state = |index: usize| all[index].name.clone();
        Self {
            name: name.to_owned(),
            model: model.to_owned(),
            order: None,
            set: Vec::new(),
            inputs: named(&|role| role == Role::Input),
            outputs: named(&|role| matches!(role, Role::Output | Role::State)),
            states: table.states().map(state).collect(),
            parameters: table.parameters().map(parameter).collect(),
            is_known: true,
        }
    }

    /// Name of its position along an axis (`""` or `"2"`), as a pilot sees it.
    pub fn position(&self, axis: &str) -> Option<&str> {
        let own = &self.outputs;
        let candidates = ["position", "z", "x"].map(|name| format!("{name}{axis}"));
        let found = (candidates.iter()).find_map(|name| own.iter().find(|own| *own == name));
        let found = found.or_else(|| own.first().filter(|_| axis.is_empty()));
        found.map(String::as_str)
    }
}
