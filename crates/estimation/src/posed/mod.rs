//! A problem as one system of equations, whose states, inputs and parameters are sought or recorded.
//!
//! Values that differ between runs are inputs that are constant in each run or jump at a change. A parameter sought per
//! run is a state with zero derivative and a free initial value, so that it is eliminated run by run like the other
//! states. An initial state that depends on sought parameters is added to its state, which then starts at zero.

mod assembly;
pub mod data;
mod delayed;
pub(crate) mod followed;
pub(crate) mod interval;
pub(crate) mod names;
pub(crate) mod ranges;
pub(crate) mod stability;
mod stops;
pub(crate) mod switches;
pub mod unknowns;

use crate::posed::assembly::Assembly;
pub use crate::posed::assembly::made::{Names, Quantities, Stands, State};
use crate::posed::data::{RunData, check_times};
use crate::posed::followed::{Followed, Recorded};
use crate::posed::names::Named;
use crate::posed::switches::Switches;
use crate::posed::unknowns::{Parameters, Unknown};
use crate::problem::error::ProblemError;
use crate::problem::file::{Initial, Limits, ProblemFile};
use crate::system::delayed::with_delays;
use crate::system::joint::Joint;
use crate::system::part::{Part, with_locals};
use nalgebra::{Complex, DMatrix};
use pilotage_collocation::{Bound, Differentiated, Loss, ParameterConstraints, Run};
use pilotage_cosim::description::InstanceDescription;
use pilotage_expression::{Function, Graph, Operation, System};
use pilotage_filter::Filter;
use pilotage_language::Delayed;
use pilotage_linear::eigenvalues;
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

/// Maximum number of mesh intervals of all runs together.
pub(crate) const MOST_INTERVALS: usize = 400_000;

/// Maximum number of samples of all runs together. A fit takes about 5 kB for each, of an algebraic model.
pub(crate) const MOST_SAMPLES: usize = 1_000_000;

/// Iteration limit of a search that only leads on.
const LEADING: usize = 100;

/// A problem that is ready to be discretised.
#[derive(Debug)]
pub struct Posed<'f> {
    /// The problem file.
    pub file: &'f ProblemFile,
    /// The connected instances.
    pub joint: Joint,
    /// The same problem without limits of outputs, if these saturate there: linear analysis applies within the limits, and a
    /// search begins without them.
    pub(crate) free: Option<Box<Self>>,
    /// The equations: measured outputs first, then bounded ones.
    pub model: Arc<Differentiated>,
    /// Bounds of the bounded outputs.
    pub bounds: Vec<Bound>,
    /// Constraints on the parameters.
    pub constraints: ParameterConstraints,
    /// Names of bounds and constraints in messages.
    pub names: Names,
    /// The fitted runs. Their mesh consists of their samples.
    pub runs: Vec<Run>,
    /// The unknowns, and their places in the equations.
    pub unknowns: Vec<(Unknown, Stands)>,
    /// Number of shared parameters.
    pub shared: usize,
    /// The states. Those for the runs' own parameters come last.
    pub states: Vec<State>,
    /// Expressions to evaluate at a solution.
    pub quantities: Quantities,
    /// The solver's objective divided by that of the problem.
    pub factor: f64,
    /// The filter that predicts a sample from earlier ones, if noise drives the system.
    pub filter: Option<Filter>,
    /// The system with measured states as inputs, for the initial guess of a search.
    pub followed: Option<Followed>,
    /// Data of each fitted run, as read.
    pub data: Vec<RunData<'f>>,
    /// What is added to the times of each run to have those of its file \[s\].
    pub origins: Vec<f64>,
    /// Conditions on time, which are inputs of the equations; None if there is none, or noise drives the system.
    pub(crate) switches: Option<Switches>,
    /// Parameters that a pattern such as `instance.*` asks for, and on which nothing measured depends: they keep their values.
    pub left_out: Vec<String>,
    /// Iteration limit of each start: that of the file; less without the limits of outputs, where a solve only leads on.
    pub(crate) most_iterations: usize,
    /// Whether the recordings alone make any fit meaningless, once that has been looked for.
    pub(crate) is_hopeless: OnceLock<bool>,
}

/// Whether expressions of these variables are selected between, or have magnitudes.
fn has_kinks(graph: &Graph, variables: &[usize]) -> bool {
    let varies = graph.dependants(|variable| variables.contains(&variable));
    let mut operations = graph.operations().iter().zip(&varies);
    operations.any(|(operation, varies)| {
        let is_kink = matches!(
            operation,
            Operation::Select(..) | Operation::Lookup(..) | Operation::Unary(Function::Abs, _)
        );
        is_kink && *varies
    })
}

/// A function that opens an instance.
pub type Open<'o> = &'o dyn Fn(&InstanceDescription) -> Result<Part, ProblemError>;

impl<'f> Posed<'f> {
    /// Whether derivatives of the equations may jump with states or parameters: they have kinks, or are those of FMUs.
    pub(crate) fn may_have_kinks(&self) -> bool {
        let mut parts = self.joint.parts.iter();
        parts.any(|(_, part)| part.fmu.is_some() || !part.delayed.is_empty()) || self.has_kinks()
    }

    /// Whether the equations select between expressions of states or parameters, take magnitudes of them or look them up in
    /// tables.
    pub(crate) fn has_kinks(&self) -> bool {
        let system = &self.model.system;
        let states = (0..self.joint.model.states.len()).map(|k| system.state(k));
        let parameters = (0..self.shared).map(|k| system.parameter(k));
        let variables: Vec<usize> = states.chain(parameters).collect();
        has_kinks(&system.graph, &variables)
    }

    /// Whether those of an instance with this name do, or select between expressions of its inputs.
    pub(crate) fn has_kinks_in(&self, instance: &str) -> bool {
        let mut parts = self.joint.parts.iter();
        let part = parts.find(|(name, _)| name == instance);
        part.is_some_and(|(_, part)| {
            let (model, system) = (&part.model, &part.model.system);
            let states = (0..model.states.len()).map(|k| system.state(k));
            let inputs = (0..model.inputs.len()).map(|k| system.input(k));
            has_kinks(&system.graph, &states.chain(inputs).collect::<Vec<_>>())
        })
    }

    /// A run with its inputs for this θ and these initial states: conditions on time change where they say.
    pub(crate) fn run_at(&self, j: usize, theta: &[f64], initial: &[f64]) -> Cow<'_, Run> {
        let run = &self.runs[j];
        match &self.switches {
            Some(switches) => Cow::Owned(switches.placed(&self.model.system, run, theta, initial)),
            None => Cow::Borrowed(run),
        }
    }

    /// Indices of an unknown among the parameters of a [start](crate::search::starts::Start).
    pub(crate) fn places(&self, stands: &Stands) -> Vec<usize> {
        match stands {
            Stands::State(k) => vec![self.shared + k - self.joint.model.states.len()],
            shared => shared.variables(0),
        }
    }

    /// Names of the states with `free` initial values in each run. Those with `steady` are searched too, but determined
    /// by their equations.
    pub fn free_states(&self) -> impl Iterator<Item = &String> {
        self.states_that(|own| matches!(own, Initial::Free))
    }

    /// Names of the states with `steady` initial values in each run.
    pub fn steady_states(&self) -> impl Iterator<Item = &String> {
        self.states_that(|own| matches!(own, Initial::Steady))
    }

    fn states_that(&self, begin: fn(&Initial) -> bool) -> impl Iterator<Item = &String> {
        let is_such = move |state: &&String| {
            let line = self.file.initial_line(state);
            line.is_some_and(|line| begin(&self.file.initial[line].1))
        };
        self.joint.model.states.iter().filter(is_such)
    }

    /// Number of unknowns: shared parameters, those of runs, and free initial states.
    pub fn count(&self) -> usize {
        let stands = self.unknowns.iter().map(|(_, stands)| stands);
        let own = stands.map(|stands| match stands {
            Stands::State(k) => self.seeking(*k).count(),
            Stands::Shared(_) | Stands::Subjects(_) => 0,
        });
        self.shared + own.sum::<usize>() + self.runs.len() * self.free_states().count()
    }

    /// Indices of the runs that seek the state of a parameter per run; the others set the parameter.
    pub(crate) fn seeking(&self, state: usize) -> impl Iterator<Item = usize> {
        let runs = self.runs.iter().enumerate();
        runs.filter(move |(_, run)| run.initial[state].is_none())
            .map(|(j, _)| j)
    }

    /// What [`Self::left_out`] means, for people; `None` if there is nothing.
    pub fn words_of_left_out(&self) -> Option<String> {
        let names: Vec<String> = self
            .left_out
            .iter()
            .map(|name| format!("`{name}`"))
            .collect();
        let verb = if names.len() == 1 { "is" } else { "are" };
        (!names.is_empty()).then(|| {
            format!(
                "nothing measured depends on {}, which {verb} not sought",
                names.join(", ")
            )
        })
    }

    /// Name of the unit of a measured quantity, by its number, if it has one.
    pub fn unit_of(&self, k: usize) -> Option<&str> {
        self.file.measured[k].unit(&self.joint)
    }

    /// Poses the problem of a file.
    ///
    /// # Errors
    /// When anything in it is inconsistent. The error states file, line and column.
    pub fn new(file: &'f ProblemFile, open: Open<'_>) -> Result<Self, ProblemError> {
        if let Some(optimal) = &file.optimal {
            let fault = "nothing is measured here: `pilotage optimise` solves a problem with an [objective]";
            return Err(ProblemError::at(&optimal.objective.place, fault));
        }
        Self::with_parts(file, opened(file, open)?, None)
    }

    /// The same with another order of the delays that have none and are not exact.
    ///
    /// # Errors
    /// If a model has no room for the states of that order.
    pub(crate) fn raised(&self, order: usize) -> Result<Self, ProblemError> {
        let parts = self.within_limits().joint.parts.clone();
        Self::with_parts(self.file, parts, Some(order))
    }

    /// The highest order of the delays that have none and are not exact; None if there are no such.
    pub fn delay_order(&self) -> Option<usize> {
        let files = self
            .joint
            .parts
            .iter()
            .filter_map(|(_, part)| part.file.as_ref());
        let orders = files
            .flat_map(|file| &file.free_delays)
            .filter_map(|own| match own.by {
                Delayed::Pade(order) => Some(order),
                Delayed::Input => None,
            });
        orders.max()
    }

    /// Its instance of this name as it is here, with the order of its delays, if it is a model file with delays that have none.
    pub fn delaying(&self, instance: &InstanceDescription) -> Option<Part> {
        let mut parts = self.within_limits().joint.parts.iter();
        let (_, part) = parts.find(|(name, _)| *name == instance.name)?;
        let file = part.file.as_ref()?;
        (!file.free_delays.is_empty()).then(|| part.clone())
    }

    /// Poses the problem of a file with these instances, and this order of their delays if they have none.
    fn with_parts(
        file: &'f ProblemFile,
        parts: Vec<(String, Part)>,
        order: Option<usize>,
    ) -> Result<Self, ProblemError> {
        let joint = Joint::new(&file.system, with_delays(file, parts, order)?)?;
        let is_limited = |(_, part): &(String, Part)| part.limits.iter().any(Option::is_some);
        if file.options.limits == Limits::Constrain || !joint.parts.iter().any(is_limited) {
            return Self::of(file, joint, None);
        }
        let mut parts = joint.parts.clone();
        let mut free = Self::of(file, joint, None)?;
        free.most_iterations = free.most_iterations.min(LEADING);
        parts.iter_mut().for_each(|(_, part)| part.saturate());
        let joint = Joint::new(&file.system, parts)?;
        Self::of(file, joint, Some(Box::new(free)))
    }

    /// The same without limits of outputs.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn unlimited(file: &'f ProblemFile, open: Open<'_>) -> Result<Self, ProblemError> {
        let parts = with_delays(file, opened(file, open)?, None)?;
        Self::of(file, Joint::new(&file.system, parts)?, None)
    }

    /// The problem without limits of outputs if these saturate, otherwise itself.
    pub(crate) fn within_limits(&self) -> &Self {
        self.free.as_deref().unwrap_or(self)
    }

    fn of(
        file: &'f ProblemFile,
        joint: Joint,
        free: Option<Box<Self>>,
    ) -> Result<Self, ProblemError> {
        let mut parameters = Parameters::new(file, &joint)?;
        let named = Named::new(file, &joint, &parameters)?;
        let data: Vec<RunData<'f>> = match &free {
            Some(free) => free.data.clone(),
            None => {
                let runs = file.runs.iter().filter(|run| run.fits);
                runs.map(RunData::read).collect::<Result<_, _>>()?
            }
        };
        check_times(file, &joint, &data)?;
        let within = free.as_ref().map_or(&joint, |free| &free.joint);
        let made = |parameters: &Parameters| {
            Assembly::new(file, (&joint, within), parameters, &named, &data)?.finish()
        };
        // A pattern does not ask for limits: recordings say nothing of one that they do not reach.
        let mut left_out = free
            .as_ref()
            .map_or(Vec::new(), |free| free.left_out.clone());
        parameters.leave_out(&left_out);
        let mut all = made(&parameters)?;
        if free.is_none() {
            left_out = all.to_leave_out();
        }
        if free.is_none() && !left_out.is_empty() {
            parameters.leave_out(&left_out);
            all = made(&parameters)?;
        }
        all.check_dependence()?;
        let mut made = all;
        let given = std::mem::take(&mut made.given);
        let switches = match made.noises.is_empty() {
            true => made.replace_conditions(joint.model.states.len(), |input| given[input]),
            false => {
                made.add_stops(|input| given[input]);
                None
            }
        };
        let origins = begin_near_zero(&made.system, &mut made.runs);
        let recorded = made.followed.iter();
        let recorded = recorded.map(|(state, k)| (*state, &made.quantities.recorded[*k][..]));
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
            quantities: made.quantities,
            file,
            joint,
            free,
            data,
            origins,
            switches,
            left_out,
            most_iterations: file.options.max_iterations,
            is_hopeless: OnceLock::new(),
        })
    }
}

/// The instances of a file, with the locals that it names.
///
/// # Errors
/// When one does not exist or contains a mistake.
pub fn opened(file: &ProblemFile, open: Open<'_>) -> Result<Vec<(String, Part)>, ProblemError> {
    let named = file.named_signals();
    let part = |instance: &InstanceDescription| {
        let part = with_locals(instance, open(instance)?, &named)?;
        Ok((instance.name.clone(), part))
    };
    file.system.instances.iter().map(part).collect()
}

/// Times of a clock that began long before a run, such as seconds since 1970, are rounded to more than a solver's tolerance.
/// Where no equation depends on time, such runs begin at 0 instead. Returns what was subtracted from the times of each.
fn begin_near_zero(system: &System, runs: &mut [Run]) -> Vec<f64> {
    const LONG_BEFORE: f64 = 100.0;
    let depends = system.graph.dependants(|variable| variable == 0);
    let mut operations = system.graph.operations().iter().zip(&depends);
    let is_taken =
        |(own, depends): (&Operation, &bool)| *depends && !matches!(own, Operation::Variable(_));
    let mut rows = system.derivatives.iter().chain(&system.outputs);
    if operations.any(is_taken) || rows.any(|row| depends[row.index()]) {
        return vec![0.0; runs.len()];
    }
    let origin = |run: &mut Run| {
        let (first, last) = (run.time[0], run.time[run.time.len() - 1]);
        if first.abs() <= LONG_BEFORE * (last - first) {
            return 0.0;
        }
        let times = run.time.iter_mut().chain(&mut run.mesh);
        times.for_each(|time| *time -= first);
        first
    };
    runs.iter_mut().map(origin).collect()
}

/// All variables of the graph at a sample.
pub(crate) fn variables(
    posed: &Posed<'_>,
    j: usize,
    sample: usize,
    x: &[f64],
    theta: &[f64],
) -> Vec<f64> {
    let run = &posed.runs[j];
    let mut all = vec![run.time[sample]];
    all.extend_from_slice(x);
    all.extend_from_slice(&run.inputs[sample]);
    all.extend_from_slice(theta);
    if let Some(switches) = &posed.switches {
        switches.fill(&posed.model.system, &mut all);
    }
    all
}

/// Eigenvalues of the joint system's Jacobian with these states at the end of the first run. Empty if it is not finite.
pub(crate) fn poles(posed: &Posed<'_>, x: &[f64], theta: &[f64]) -> Vec<Complex<f64>> {
    poles_at(posed, posed.runs[0].time.len() - 1, x, theta)
}

/// The same at a sample of the first run. Empty, too, for systems with so many states that their eigenvalues would take longer than the
/// search, and nobody reads them.
pub(crate) fn poles_at(
    posed: &Posed<'_>,
    sample: usize,
    x: &[f64],
    theta: &[f64],
) -> Vec<Complex<f64>> {
    const MOST: usize = 300;
    let system = &posed.model.system;
    let n = posed.joint.model.states.len();
    if n > MOST {
        return Vec::new();
    }
    let at = variables(posed, 0, sample, x, theta);
    let mut graph = system.graph.clone();
    let mut matrix = DMatrix::zeros(n, n);
    let columns: Vec<_> = (0..n)
        .map(|k| graph.derivatives(&system.derivatives[..n], system.state(k)))
        .collect();
    let values = graph.values(&at);
    for (j, column) in columns.iter().enumerate() {
        for (i, node) in column.iter().enumerate() {
            matrix[(i, j)] = values[node.index()];
        }
    }
    match n > 0 && matrix.iter().all(|value| value.is_finite()) {
        true => eigenvalues(&matrix),
        false => Vec::new(),
    }
}

/// Scale factor of the objective. It keeps residuals above the solver's tolerance if no noise level is given and the
/// data are small.
fn factor(runs: &[Run]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for recording in runs.iter().flat_map(|run| &run.measured) {
        if recording.loss != Loss::Square {
            return 1.0;
        }
        let known = recording.values.iter().copied();
        let known: Vec<f64> = known.filter(|y| y.is_finite()).collect();
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        sum += recording.weight * known.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        count += known.len() as f64;
    }
    match sum > 0.0 {
        true => (count / sum).max(1.0),
        false => 1.0,
    }
}
