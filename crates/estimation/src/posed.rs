//! A problem as equations: one system whose states, inputs and parameters are those that are sought or recorded.
//!
//! What differs from run to run is an input that is constant in the run, or jumps where it changes. What is sought
//! for each run is a state whose derivative is zero and whose initial value is free, so that it is eliminated run by
//! run as the others are. An initial state that depends on sought parameters is added to its state, which then
//! begins at zero.

use crate::assembly::Assembly;
use crate::data::RunData;
use crate::error::ProblemError;
use crate::events::check_times;
use crate::file::{Initial, ProblemFile};
use crate::fit::factor;
use crate::followed::{Followed, Recorded};
use crate::joint::Joint;
use crate::names::Named;
use crate::part::{Part, with_locals};
use crate::unknowns::{Parameters, Unknown};
use pilotage_collocation::{Bound, Differentiated, ParameterConstraints, Run};
use pilotage_cosim::description::InstanceDescription;
use pilotage_expression::Node;
use pilotage_filter::Filter;
use std::sync::Arc;

/// A problem that is ready to be discretised.
#[derive(Debug)]
pub struct Posed<'f> {
    /// What the file says.
    pub file: &'f ProblemFile,
    /// The instances.
    pub joint: Joint,
    /// The equations: measured outputs first, then bounded ones.
    pub model: Arc<Differentiated>,
    /// Bounds of the latter.
    pub bounds: Vec<Bound>,
    /// What parameters must fulfil.
    pub constraints: ParameterConstraints,
    /// What messages call bounds and constraints.
    pub names: Names,
    /// The runs that are fitted; their mesh is their samples.
    pub runs: Vec<Run>,
    /// What is sought, and where it stands.
    pub unknowns: Vec<(Unknown, Stands)>,
    /// Number of shared parameters.
    pub shared: usize,
    /// The states, those of the runs' own parameters behind.
    pub states: Vec<State>,
    /// What is told of a solution.
    pub told: Told,
    /// What the solver's objective is, per unit of the problem's.
    pub factor: f64,
    /// What predicts a sample from those before it, where noise drives the system.
    pub filter: Option<Filter>,
    /// Measured states as inputs, for the start of a search.
    pub followed: Option<Followed>,
    /// What was read, of each run that is fitted.
    pub data: Vec<RunData<'f>>,
}

/// What messages call bounds and constraints.
#[derive(Debug, Clone, Default)]
pub struct Names {
    /// The bounds, in their order.
    pub bounds: Vec<String>,
    /// The constraints on the shared parameters, in their order.
    pub parameters: Vec<String>,
    /// Number of the first of these that is a condition of stability; all behind it are, and called by what is kept
    /// stable.
    pub stability: usize,
}

/// A state of the equations.
#[derive(Debug, Clone)]
pub struct State {
    /// Its name; that of the parameter, of a run's own one.
    pub name: String,
    /// Typical magnitude, where one is known.
    pub nominal: Option<f64>,
    /// For each run, what it begins with where that is not known.
    pub guesses: Vec<f64>,
    /// What is added to it, where it begins at zero by that.
    pub shift: Option<Node>,
}

impl State {
    /// One that is 0 throughout so many runs, where a problem has none.
    pub(crate) fn at_rest(runs: usize) -> Self {
        Self {
            name: "no state".to_owned(),
            nominal: Some(1.0),
            guesses: vec![0.0; runs],
            shift: None,
        }
    }
}

/// Where an unknown stands among the variables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stands {
    /// Among the shared parameters.
    Shared(usize),
    /// Among the shared parameters, one for each subject.
    Subjects(Vec<(String, usize)>),
    /// Among the states.
    State(usize),
}

impl Stands {
    /// Its variables in the equations, where the shared parameters begin at that one.
    pub(crate) fn variables(&self, shared: usize) -> Vec<usize> {
        match self {
            Self::Shared(k) => vec![shared + k],
            Self::Subjects(all) => all.iter().map(|(_, k)| shared + k).collect(),
            Self::State(k) => vec![1 + k],
        }
    }
}

/// What is told of a solution, in the graph of the equations.
#[derive(Debug, Clone)]
pub struct Told {
    /// What each sensor should show, in the unit of the signal.
    pub predicted: Vec<Node>,
    /// The standard deviation of each one's noise.
    pub deviations: Vec<Node>,
    /// The variables of the joint model: time, states, inputs, parameters.
    pub joint: Vec<Node>,
    /// Parameters that are tied to others.
    pub tied: Vec<(String, Node)>,
    /// What the file derives from parameters.
    pub derived: Vec<(String, Node)>,
    /// For each measured signal, the input that is what was recorded, where its residual is an expression of that.
    pub seen: Vec<Option<usize>>,
    /// For each measured signal, the recorded values of each run's samples, in the unit of the signal.
    pub recorded: Vec<Vec<Vec<f64>>>,
}

/// How an instance is opened.
pub type Open<'o> = &'o dyn Fn(&InstanceDescription) -> Result<Part, ProblemError>;

impl<'f> Posed<'f> {
    /// Where an unknown stands among the parameters of a [start](crate::starts::Start).
    pub(crate) fn places(&self, stands: &Stands) -> Vec<usize> {
        match stands {
            Stands::State(k) => vec![self.shared + k - self.joint.model.states.len()],
            shared => shared.variables(0),
        }
    }

    /// Names of the states whose initial values each run leaves open: those that are `free`. Ones that are `steady` are
    /// searched too, and their equations tell them.
    pub fn free_states(&self) -> impl Iterator<Item = &String> {
        let is_free = |state: &&String| {
            let line = self.file.initial_line(state);
            line.is_some_and(|line| matches!(self.file.initial[line].1, Initial::Free))
        };
        self.joint.model.states.iter().filter(is_free)
    }

    /// Number of unknowns: shared parameters, those of runs, and free initial states.
    pub fn count(&self) -> usize {
        let stands = self.unknowns.iter().map(|(_, stands)| stands);
        let own = stands
            .filter(|stands| matches!(stands, Stands::State(_)))
            .count();
        self.shared + self.runs.len() * (own + self.free_states().count())
    }

    /// Name of the unit of what was measured, by its number, where it has one.
    pub fn unit_of(&self, k: usize) -> Option<&str> {
        self.file.measured[k].unit(&self.joint)
    }

    /// The problem of a file.
    ///
    /// # Errors
    /// When anything in it does not fit: with file, line and column.
    pub fn new(file: &'f ProblemFile, open: Open<'_>) -> Result<Self, ProblemError> {
        let mut parts = Vec::new();
        let named = file.named_signals();
        for instance in &file.system.instances {
            let part = with_locals(instance, open(instance)?, &named)?;
            parts.push((instance.name.clone(), part));
        }
        let joint = Joint::new(&file.system, parts)?;
        let parameters = Parameters::new(file, &joint)?;
        let named = Named::new(file, &joint, &parameters)?;
        let runs = file.runs.iter().filter(|run| run.fits);
        let data: Vec<RunData<'f>> = runs.map(RunData::read).collect::<Result<_, _>>()?;
        check_times(file, &joint, &data)?;
        let made = Assembly::new(file, &joint, &parameters, &named, &data)?.finish()?;
        let recorded = made.followed.iter();
        let recorded = recorded.map(|(state, k)| (*state, &made.told.recorded[*k][..]));
        let recorded: Vec<Recorded<'_>> = recorded.collect();
        Ok(Self {
            model: Arc::new(Differentiated::new(&made.system)),
            followed: Followed::new(&made.system, &made.runs, &recorded),
            factor: factor(&made.runs),
            filter: made.filter(joint.model.states.len()),
            bounds: made.bounds,
            constraints: made.constraints,
            names: made.names,
            runs: made.runs,
            unknowns: made.unknowns,
            shared: made.shared,
            states: made.states,
            told: made.told,
            file,
            joint,
            data,
        })
    }
}
