//! Expressions of files that are no models: over the variables of a system, `pilot.gain`, and recorded columns.

use crate::build;
use crate::error::{Fault, ModelFileError};
use crate::file::{Formula, ModelFile, Variable, constant};
use crate::scope::Scope;
use crate::syntax::Term;
use crate::tables::Tables;
use crate::{functions, units};
use pilotage_expression::{Graph, Node};

/// Names and expressions of a file, before they are compiled.
#[derive(Debug, Clone)]
pub struct Expressions {
    file: ModelFile,
    /// For each expression, what it is called where it must not change in time.
    constants: Vec<Option<&'static str>>,
}

/// Expressions over the variables time, signals and parameters, in this order.
#[derive(Debug, Clone)]
pub struct CompiledExpressions {
    /// The expressions.
    pub graph: Graph,
    /// Each expression that was added.
    pub nodes: Vec<Node>,
}

impl Expressions {
    /// None yet, of a file with that name in messages and that text.
    pub fn new(file: &str, text: &str) -> Self {
        Self {
            file: ModelFile {
                file: file.to_owned(),
                text: text.to_owned(),
                name: String::new(),
                description: String::new(),
                source: String::new(),
                inputs: Vec::new(),
                parameters: Vec::new(),
                states: Vec::new(),
                locals: Vec::new(),
                outputs: Vec::new(),
            },
            constants: Vec::new(),
        }
    }

    /// A name of what changes in time.
    pub fn add_signal(&mut self, name: &str, unit: Option<&str>) {
        self.file.inputs.push(variable(name, unit, None));
    }

    /// A name of what does not.
    pub fn add_parameter(&mut self, name: &str, unit: Option<&str>) {
        self.file.parameters.push(variable(name, unit, None));
    }

    /// An expression, which others may call by that name; one with a blank in it is for messages alone. With `constant` it may depend on parameters alone, and
    /// that is what messages call it. Its number in the list is returned.
    pub fn add(
        &mut self,
        name: &str,
        unit: Option<&str>,
        formula: &Formula,
        constant: Option<&'static str>,
    ) -> usize {
        let byte = formula.byte(0);
        let formula = Some(formula.clone());
        self.file.locals.push(Variable {
            byte,
            ..variable(name, unit, formula)
        });
        self.constants.push(constant);
        self.constants.len() - 1
    }

    /// Compiles them.
    ///
    /// # Errors
    /// When a name means nothing, units do not fit, or expressions go in a circle: with file, line and column.
    pub fn compile(&self) -> Result<CompiledExpressions, ModelFileError> {
        let file = &self.file;
        for local in &file.locals {
            let formula = local.value.as_ref().into_iter();
            let calls = formula.flat_map(|formula| {
                let terms = formula.expression.terms.iter().enumerate();
                terms.map(move |(part, term)| (formula.byte(part), term))
            });
            for (byte, term) in calls {
                match term {
                    Term::Call(functions::Name::Delay, _) => {
                        return Err(file.at(byte, Fault::DelayOutside));
                    }
                    Term::Call(functions::Name::Table, _) => {
                        return Err(file.at(byte, Fault::TableOutside));
                    }
                    _ => {}
                }
            }
        }
        let scope = Scope::of(file).map_err(reworded)?;
        for (local, constant) in file.locals.iter().zip(&self.constants) {
            if let (Some(what), Some(formula)) = (constant, &local.value) {
                let checked = scope.check_constant(what, formula, None);
                checked.map_err(reworded)?;
            }
        }
        let tables = Tables::default();
        units::check(file, &scope, &tables)?;
        let built = build::build(file, &scope, &tables)?;
        Ok(CompiledExpressions {
            graph: built.graph,
            nodes: built.computed,
        })
    }
}

/// What a mistake is called outside of a model: inputs stand for all signals, and there are no states.
fn reworded(error: ModelFileError) -> ModelFileError {
    let ModelFileError::At {
        file,
        position,
        fault,
    } = error
    else {
        return error;
    };
    let fault = match *fault {
        Fault::Circle(names) => Fault::TiedCircle(names),
        Fault::NotConstant { what, name, role } => Fault::NotConstant {
            what,
            name,
            role: match role {
                "an input" => "a signal, which changes in time",
                other => other,
            },
        },
        other => other,
    };
    ModelFileError::At {
        file,
        position,
        fault: Box::new(fault),
    }
}

fn variable(name: &str, unit: Option<&str>, value: Option<Formula>) -> Variable {
    Variable {
        name: name.to_owned(),
        unit: unit.map(str::to_owned),
        description: String::new(),
        start: constant(0.0),
        min: None,
        max: None,
        nominal: None,
        tunable: false,
        value,
        limit: None,
        byte: 0,
    }
}
