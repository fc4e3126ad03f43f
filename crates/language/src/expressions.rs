//! Expressions outside model files: over the variables of a system such as `pilot.gain`, and recorded columns.

use crate::build;
use crate::error::{Fault, ModelFileError};
use crate::file::{Formula, ModelFile, Variable, constant};
use crate::scope::Scope;
use crate::syntax::Term;
use crate::tables::Tables;
use crate::{functions, units};
use pilotage_expression::{Graph, Node};

/// Names and expressions of a file before compilation.
#[derive(Debug, Clone)]
pub struct Expressions {
    file: ModelFile,
    /// For each expression that must be constant in time, its description in messages.
    constants: Vec<Option<&'static str>>,
    /// Whether it may depend on the time, too, directly or by another such expression.
    over_time: Vec<bool>,
}

/// Expressions over the variables time, signals and parameters, in this order.
#[derive(Debug, Clone)]
pub struct CompiledExpressions {
    /// The expressions.
    pub graph: Graph,
    /// The node of each added expression.
    pub nodes: Vec<Node>,
}

impl Expressions {
    /// An empty list for a file with this name in messages and this text.
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
                fit: None,
                uncertainty: None,
            },
            constants: Vec::new(),
            over_time: Vec::new(),
        }
    }

    /// Adds the name of a signal, which changes in time.
    pub fn add_signal(&mut self, name: &str, unit: Option<&str>) {
        self.file.inputs.push(variable(name, unit, None));
    }

    /// Adds the name of a parameter, which is constant in time.
    pub fn add_parameter(&mut self, name: &str, unit: Option<&str>) {
        self.file.parameters.push(variable(name, unit, None));
    }

    /// Adds an expression and returns its index. Other expressions may refer to it by its name; a name that contains a
    /// blank is only used in messages. With `constant` it may depend only on parameters, and messages call it by that
    /// description.
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
        self.over_time.push(false);
        self.constants.len() - 1
    }

    /// Lets a constant expression depend on the time as well. Other constant ones cannot refer to it then.
    pub fn may_take_time(&mut self, index: usize) {
        self.over_time[index] = true;
    }

    /// Compiles the expressions.
    ///
    /// # Errors
    /// If a name is unknown, units do not fit, or expressions form a circle. The message contains file, line and
    /// column.
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
        let scope = Scope::of(file).map_err(|error| reworded(error, false))?;
        for (k, (local, constant)) in file.locals.iter().zip(&self.constants).enumerate() {
            if let (Some(what), Some(formula)) = (constant, &local.value) {
                let over_time: &[bool] = if self.over_time[k] {
                    &self.over_time
                } else {
                    &[]
                };
                let checked = scope.check_constant_but(what, formula, None, over_time);
                checked.map_err(|error| reworded(error, self.over_time[k]))?;
            }
        }
        let tables = Tables::default();
        units::check(file, &scope, &tables)?;
        let built = build::build(file, &scope, &tables, &[])?;
        Ok(CompiledExpressions {
            graph: built.graph,
            nodes: built.computed,
        })
    }
}

/// Rewords mistakes for files without a model: all signals are inputs here, and there are no states.
fn reworded(error: ModelFileError, may_take_time: bool) -> ModelFileError {
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
        Fault::NotConstant { what, name, role } => {
            let role = match role {
                "an input" => "a signal, which changes in time",
                "a local" => "tied to the time",
                other => other,
            };
            match may_take_time {
                true => Fault::NotOfTime { what, name, role },
                false => Fault::NotConstant { what, name, role },
            }
        }
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
