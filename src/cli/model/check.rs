//! `pilotage model check`: prints how a model file was interpreted.

use super::super::linearize::files;
use super::super::{Failure, Outcome, format, terminal};
use crate::cosim::native_component;
use crate::linear::{Mode, StateSpace};
use crate::models::{AnyModel, Role, TextModel, Variable};
use nalgebra::DMatrix;
use pilotage_sdk::Simulation;
use pilotage_text::number::significant;
use serde_json::{Value, json};

/// Relative to a state's nominal value, derivatives at the start values below this count as rest.
const REST: f64 = 1e-9;

/// A model and its computed properties.
struct Checked {
    model: TextModel,
    /// Linearisation at the start values.
    linear: StateSpace,
    modes: Vec<Mode>,
    /// Derivatives at the start values.
    rates: Vec<f64>,
    /// Expressions that are not finite at the start values.
    trouble: Option<String>,
}

/// Runs the command.
pub fn run(model: TextModel, json: bool) -> Result<Outcome, Failure> {
    let checked = Checked::of(model)?;
    match json {
        true => terminal::print(&format!("{:#}\n", checked.to_json()))?,
        false => terminal::print(&checked.to_text())?,
    }
    Ok(match checked.trouble {
        Some(_) => Outcome::No,
        None => Outcome::Done,
    })
}

impl Checked {
    fn of(model: TextModel) -> Result<Self, Failure> {
        let simulation = Simulation::new(model.clone());
        let mut rates = vec![0.0; simulation.table().n_states()];
        simulation.derivatives(&mut rates);
        let trouble = simulation.trouble();
        let linear = match native_component::of_model(AnyModel::Text(model.clone())).linearize(0.0)
        {
            Ok(linear) if trouble.is_none() => linear.system,
            Err(error) if trouble.is_none() => return Err(Failure::new(error.to_string())),
            _ => StateSpace::empty(),
        };
        let trouble = trouble.or_else(|| infinite(&linear));
        let is_known = linear.a.iter().all(|slope| slope.is_finite());
        Ok(Self {
            modes: match is_known {
                true => Mode::of_poles(&linear.poles()),
                false => Vec::new(),
            },
            linear,
            rates,
            trouble,
            model,
        })
    }

    fn variables(&self) -> impl Iterator<Item = &Variable> {
        let variables = self.model.variables().variables().iter();
        variables.filter(|variable| {
            !matches!(variable.role, Role::Derivative | Role::Time)
                && !self.is_start(&variable.name)
        })
    }

    /// Whether a variable is the start value of a state.
    fn is_start(&self, name: &str) -> bool {
        let table = self.model.variables();
        let starts = &table.variables()[table.starts()];
        starts.iter().any(|start| start.name == name)
    }

    /// States that are not at rest at the start, with their rates and units.
    fn moving(&self) -> Vec<(String, f64, String)> {
        let table = self.model.variables();
        let states = table.states().map(|index| &table.variables()[index]);
        let rates = table.derivatives().map(|index| &table.variables()[index]);
        let all = states.zip(rates).zip(&self.rates);
        let moving =
            all.filter(|((state, _), rate)| rate.abs() > REST * state.nominal.unwrap_or(1.0));
        moving
            .map(|((state, own), rate)| (state.name.clone(), *rate, own.unit.symbol()))
            .collect()
    }

    fn start_of(&self, variable: &Variable) -> Option<f64> {
        let table = self.model.variables();
        let own = table.index(&variable.name)?;
        match table.state_at(own) {
            Some(state) => table.variables()[table.starts().start + state].start,
            None => variable.start,
        }
    }

    fn to_text(&self) -> String {
        let file = &self.model.compiled().file;
        let mut text = terminal::labelled(&terminal::line(&file.file), &file.name);
        for line in [&file.description, &file.source] {
            if !line.is_empty() {
                text += &format!("  {}\n", terminal::line(line));
            }
        }
        if let Some(fit) = &file.fit {
            text += &format!("  start values of a fit: {}\n", fit.status);
            for (code, words) in &fit.doubts {
                text += &format!("  diagnostic [{code}]: {words}\n");
            }
        }
        text += &self.table();
        text += "\nEquations\n";
        for line in file.equations().lines() {
            text += &format!("  {line}\n");
        }
        text += &self.limits();
        for note in self.notes() {
            text += &terminal::labelled("note", &note);
        }
        text + &self.at_start()
    }

    /// The variables as a table.
    fn table(&self) -> String {
        let rows: Vec<[String; 5]> = self
            .variables()
            .map(|variable| {
                let start = self.start_of(variable).map(|start| significant(start, 5));
                [
                    variable.role.name().to_owned(),
                    variable.name.clone(),
                    match variable.unit.is_some() {
                        true => variable.unit.name.clone(),
                        false => "not checked".to_owned(),
                    },
                    match variable.allowed() {
                        None => start.unwrap_or_default(),
                        Some(range) => format!("{} ({range})", start.unwrap_or_default()),
                    },
                    variable.description.clone(),
                ]
            })
            .collect();
        let lines = format::aligned(&rows);
        let lines = lines.lines().map(|line| format!("  {line}\n"));
        "\nVariables\n".to_owned() + &lines.collect::<String>()
    }

    /// The states of delays, which are not declared in the file.
    fn limits(&self) -> String {
        let delays = &self.model.compiled().delays;
        match delays.len() {
            0 => String::new(),
            n => format!("  and {n} states of Padé's approximation of the delays\n"),
        }
    }

    fn at_start(&self) -> String {
        if let Some(trouble) = &self.trouble {
            return format!(
                "\nAt the start values an expression is no finite number: {trouble}\n\
                 Choose other start values, or an expression that holds there.\n"
            );
        }
        let moving = self.moving();
        let mut text = match moving.is_empty() {
            true => "\nAt rest at the start values.\n".to_owned(),
            false => "\nNot at rest at the start values:\n".to_owned(),
        };
        for (name, rate, unit) in moving {
            text += &format!("  d{name}/dt = {} {unit}\n", significant(rate, 5));
        }
        if self.model.variables().n_states() == 0 {
            return text + "No states: outputs follow inputs at once.\n";
        }
        text += match self.model.compiled().is_linear() {
            true if !self.model.compiled().free_delays.is_empty() => {
                "Linear in states and inputs; in co-simulation delays without an order are exact.\n"
            }
            true => "Linear in states and inputs; steps of co-simulation are exact.\n",
            false => "Poles of the linearisation there:\n",
        };
        text += "  pole [1/s]            frequency [rad/s]  damping\n";
        text + &self.modes.iter().map(format::mode).collect::<String>()
    }

    /// How the files of tables were taken where they are not plain.
    fn notes(&self) -> impl Iterator<Item = String> {
        let tables = self.model.compiled().tables.iter();
        tables.filter_map(|(file, table)| Some(format!("{file}: {}", table.note.as_ref()?)))
    }

    fn to_json(&self) -> Value {
        let file = &self.model.compiled().file;
        let variables: Vec<Value> = self
            .variables()
            .map(|variable| {
                json!({
                    "name": variable.name,
                    "role": variable.role.name(),
                    "unit": variable.unit.is_some().then_some(&variable.unit.name),
                    "start": self.start_of(variable),
                    "min": variable.min,
                    "max": variable.max,
                    "nominal": variable.nominal,
                    "description": variable.description,
                })
            })
            .collect();
        let equations = file.equations();
        let system = &self.linear;
        let poles = system.poles();
        json!({
            "file": file.file,
            "name": file.name,
            "description": file.description,
            "source": file.source,
            "fit": file.fit.as_ref().map(|fit| json!({
                "status": fit.status,
                "converged": fit.converged,
                "doubts": (fit.doubts.iter())
                    .map(|(code, words)| json!({ "code": code, "words": words }))
                    .collect::<Vec<_>>(),
            })),
            "variables": variables,
            "equations": equations.lines().collect::<Vec<_>>(),
            "notes": self.notes().collect::<Vec<_>>(),
            "is_linear": self.model.compiled().is_linear(),
            "at_rest": self.trouble.is_none() && self.moving().is_empty(),
            "trouble": self.trouble,
            "linear": {
                "states": system.states,
                "inputs": system.inputs,
                "outputs": system.outputs,
                "a": files::rows(&system.a),
                "b": files::rows(&system.b),
                "c": files::rows(&system.c),
                "d": files::rows(&system.d),
                "poles": poles.iter().map(|pole| [pole.re, pole.im]).collect::<Vec<_>>(),
            },
        })
    }
}

/// What an infinite slope of the equations is, if one is.
fn infinite(linear: &StateSpace) -> Option<String> {
    let matrices = [
        ("der of states with states", &linear.a),
        ("der of states with inputs", &linear.b),
        ("outputs with states", &linear.c),
        ("outputs with inputs", &linear.d),
    ];
    let odd = |(what, matrix): (&str, &DMatrix<f64>)| {
        let slope = matrix.iter().find(|slope| !slope.is_finite())?;
        Some(format!("a slope of {what} is {slope}"))
    };
    matrices.into_iter().find_map(odd)
}
