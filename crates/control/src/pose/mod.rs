//! A problem file as a program: one system of equations, with the controls among its states.

mod assembly;
mod earlier;
mod equations;
mod guess;
mod limits;
mod objective;

use crate::program::Control;
use crate::program::Duration;
use crate::program::Limits;
use crate::program::Program;
use assembly::Assembly;
pub use earlier::Earlier;
use pilotage_collocation::Differentiated;
use pilotage_collocation::Run;
use pilotage_collocation::Steps;
use pilotage_collocation::node::NodeModel;
use pilotage_collocation::node::Scales;
use pilotage_estimation::ProblemError;
use pilotage_estimation::posed::Open;
use pilotage_estimation::posed::opened;
use pilotage_estimation::posed::unknowns::Parameters;
use pilotage_estimation::problem::file::Limits as OfOutputs;
use pilotage_estimation::problem::file::ProblemFile;
use pilotage_estimation::system::joint::Joint;
use pilotage_expression::Graph;
use pilotage_text::document::Place;
use std::collections::HashMap;
use std::sync::Arc;

/// A variable: a state, a control or a parameter.
#[derive(Debug, Clone)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Name of its unit, if it has one.
    pub unit: Option<String>,
    /// Typical magnitude.
    pub scale: f64,
    /// First and last value where the search begins; of a parameter its start, twice.
    pub guess: [f64; 2],
    /// Its limits: of a control, a parameter.
    pub limits: Limits,
}

/// A limited quantity.
#[derive(Debug, Clone)]
pub struct Limited {
    /// What is limited, in the words of the file.
    pub name: String,
    /// Where the file says so.
    pub place: Option<Place>,
    /// Its limits, in its unit.
    pub limits: Limits,
    /// Its magnitude, by which it is divided.
    pub size: f64,
    /// What it is at the start, where that depends on known initial states alone.
    pub start: Option<f64>,
}

/// A problem of optimal control, ready to be discretised.
#[derive(Debug)]
pub struct Posed {
    /// States, with those that integrate parts of the objective at their end.
    pub states: Vec<Variable>,
    /// Controls.
    pub controls: Vec<Variable>,
    /// Parameters that are sought: those of the problem, the duration, initial values in the objective, and the bound on
    /// all that is under a maximum.
    pub parameters: Vec<Variable>,
    /// Limited quantities along the path, at the start and at the end.
    pub limited: [Vec<Limited>; 3],
    /// The duration.
    pub duration: Duration,
    /// Whether the objective is maximised.
    pub is_maximised: bool,
    /// Number of intervals of the first mesh.
    pub intervals: usize,
    /// Initial states, where they are known.
    pub initial: Vec<Option<f64>>,
    /// Tolerance of the solver, and permitted local error of the states.
    pub tolerance: f64,
    /// Names, units and nodes of signals that are no states: for the trajectory.
    pub signals: Vec<(String, Option<String>)>,
    /// The equations: along the path, at the start, at the end.
    pub equations: [Arc<Differentiated>; 3],
    /// The same with all signals as outputs.
    pub shown: Arc<Differentiated>,
    /// Whether the search begins with a simulation.
    pub is_simulated: bool,
    /// An earlier answer, where it begins instead.
    pub earlier: Option<Earlier>,
    of_controls: Vec<Control>,
    regularise: f64,
}

type Done<T> = Result<T, ProblemError>;

impl Posed {
    /// Poses the problem of a file with an objective.
    ///
    /// # Errors
    /// When anything in it is inconsistent. The error states file, line and column.
    pub fn new(file: &ProblemFile, open: Open<'_>) -> Done<Self> {
        let Some(optimal) = &file.optimal else {
            let fault = format!(
                "{}: nothing is optimised; add [objective] with minimise = \"...\", or fit it with `pilotage fit`",
                file.file
            );
            return Err(ProblemError::Part(fault));
        };
        let mut parts = opened(file, open)?;
        if file.options.limits == OfOutputs::Saturate {
            parts.iter_mut().for_each(|(_, part)| part.saturate());
        }
        let joint = Joint::new(&file.system, parts)?;
        let parameters = Parameters::new(file, &joint)?;
        let mut posed = Assembly {
            file,
            optimal,
            joint,
            parameters,
            graph: Graph::default(),
            states: Vec::new(),
            controls: Vec::new(),
            sought: Vec::new(),
            values: HashMap::new(),
            limited: [const { Vec::new() }; 3],
        }
        .finish()?;
        if let Some(table) = &optimal.guess.table {
            posed.earlier = Some(Earlier::read(&file.folder.join(table), &posed)?);
        }
        Ok(posed)
    }

    /// Checks that constraints hold at the known start.
    ///
    /// # Errors
    /// When one does not: whatever is sought, nothing meets it. The error states its line.
    pub fn check(&self) -> Result<(), ProblemError> {
        for own in self.limited.iter().flatten() {
            let (min, max) = own.limits;
            if let Some(value) = own.start.filter(|value| !(min..=max).contains(value)) {
                let fault = format!(
                    "`{}` is {value} at the start, which is known, and not within {min} to {max}; nothing meets that",
                    own.name
                );
                return Err(at(own.place.as_ref(), fault));
            }
        }
        Ok(())
    }

    /// The program on a mesh in τ.
    pub fn program(&self, mesh: Vec<f64>) -> Program {
        let scales = Scales {
            states: self
                .states
                .iter()
                .chain(&self.controls)
                .map(|own| own.scale)
                .collect(),
            parameters: self.parameters.iter().map(|own| own.scale).collect(),
        };
        let limits = |own: &Limited| (own.limits.0 / own.size, own.limits.1 / own.size);
        let [path, start, end] = &self.limited;
        let all = |of: &[Limited]| of.iter().map(limits).collect();
        let model = |k: usize| NodeModel::new(self.equations[k].clone(), scales.clone());
        let scaled = |own: &Variable| (own.limits.0 / own.scale, own.limits.1 / own.scale);
        let known = self.initial.iter().zip(&self.states);
        Program {
            model: model(0),
            start: model(1),
            end: model(2),
            limits: [all(path), all(start), all(end)],
            controls: self.of_controls.clone(),
            initial: known
                .map(|(own, state)| own.map(|own| own / state.scale))
                .collect(),
            parameters: self.parameters.iter().map(scaled).collect(),
            duration: self.duration,
            regularise: self.regularise,
            mesh,
        }
    }

    /// The parameters where the search begins.
    pub fn theta(&self) -> Vec<f64> {
        self.parameters.iter().map(|own| own.guess[0]).collect()
    }

    /// Variables where the search begins, from states at the nodes and midpoints, from controls and parameters, all in
    /// their units.
    pub fn variables(
        &self,
        program: &Program,
        states: &dyn Fn(f64) -> Vec<f64>,
        controls: &dyn Fn(f64) -> Vec<f64>,
        theta: &[f64],
    ) -> Vec<f64> {
        let (n, m) = (program.n(), program.m());
        let mut z = vec![0.0; program.variables()];
        let scaled = |values: Vec<f64>, of: &[Variable]| -> Vec<f64> {
            values
                .iter()
                .zip(of)
                .map(|(value, own)| value / own.scale)
                .collect()
        };
        for k in 0..=program.intervals() {
            let time = program.mesh[k];
            z[program.node(k)..][..n].copy_from_slice(&scaled(states(time), &self.states));
            z[program.node(k) + n..][..m].copy_from_slice(&scaled(controls(time), &self.controls));
            if k < program.intervals() {
                let middle = 0.5 * (time + program.mesh[k + 1]);
                z[program.middle(k)..][..n].copy_from_slice(&scaled(states(middle), &self.states));
            }
        }
        for (i, known) in program.initial.iter().enumerate() {
            z[i] = known.unwrap_or(z[i]);
        }
        for (c, control) in program.controls.iter().enumerate() {
            z[n + c] = control.first.unwrap_or(z[n + c]);
        }
        let at = program.theta();
        z[at..].copy_from_slice(&scaled(theta.to_vec(), &self.parameters));
        z
    }

    /// Number of seconds at these parameters.
    pub fn seconds(&self, theta: &[f64]) -> f64 {
        match self.duration {
            Duration::Number(seconds) => seconds,
            Duration::Sought(k) => theta[k],
        }
    }
}

fn at(place: Option<&Place>, fault: impl Into<String>) -> ProblemError {
    ProblemError::maybe_at(place, fault)
}

/// A run without data over an interval in τ, with slopes of the controls.
pub(crate) fn bare_run([from, to]: [f64; 2], slopes: Vec<f64>, states: usize) -> Run {
    Run {
        mesh: vec![from, to],
        time: vec![from, to],
        inputs: vec![slopes.clone(), slopes],
        measured: Vec::new(),
        initial: vec![None; states],
        steps: Steps::default(),
    }
}
