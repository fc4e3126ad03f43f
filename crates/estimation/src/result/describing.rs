//! Describing functions of pilot and loop, computed directly from runs whose target or disturbance is a sum of sines,
//! beside those of the fit ([`pilotage_inference::spectrum`]).
//!
//! They exist if two instances form a loop, the output of the instance that acts on the other (the vehicle) is
//! measured, and there is a target in its unit or a disturbance of it. The error is the target minus the measured
//! output. The fitted functions are the same ratios of responses to the forcing function. For a pilot that sees only
//! the error, that ratio is the pilot's transfer function.

use crate::posed::Posed;
use crate::posed::data::RunData;
use crate::posed::variables;
use crate::problem::file::{Fed, Quantity};
use crate::result::loops::{ends, instance, opening};
use crate::search::solved::Solved;
use nalgebra::{Complex, DMatrix};
use pilotage_cosim::description::{Spanned, Wire};
use pilotage_expression::Node;
use pilotage_inference::spectrum::{Describing, Excitation, Flight};
use pilotage_linear::StateSpace;
use pilotage_units::Unit;

/// Roles of the columns, by their numbers in the file.
#[derive(Debug, Clone)]
pub(crate) struct Roles {
    /// The input that is the target. None if only a disturbance drives the loop.
    pub target: Option<usize>,
    /// The measured signal.
    pub position: usize,
    /// What the pilot does, if it is recorded.
    pub stick: Option<Stick>,
}

/// What the pilot does.
#[derive(Debug, Clone)]
pub(crate) struct Stick {
    /// Its signal in the joint model.
    signal: Node,
    /// Its column, measured or not.
    pub column: Spanned<String>,
    /// Its unit.
    pub unit: Option<String>,
}

/// The columns of a run.
struct Columns {
    name: String,
    time: Vec<f64>,
    forcing: Vec<Vec<f64>>,
    position: Vec<f64>,
    stick: Option<Vec<f64>>,
}

/// Frequency responses of a fitted loop.
pub struct FittedLoop {
    roles: Roles,
    /// From the inputs of the file to the measured signals and the stick, in closed loop.
    closed: StateSpace,
}

impl FittedLoop {
    /// From a solution, linearised at the end of the first run. None if the problem has no such loop.
    pub fn new(posed: &Posed<'_>, solved: &Solved) -> Option<Self> {
        Self::with(posed, solved, &solved.theta())
    }

    /// The same with other shared parameters, at the same states.
    pub fn with(posed: &Posed<'_>, solved: &Solved, theta: &[f64]) -> Option<Self> {
        let roles = Roles::of(posed)?;
        let closed = linear(posed, solved, theta, roles.stick.as_ref())?;
        Some(Self { roles, closed })
    }

    /// From the error to the stick, for the loop driven by an input of the file, at ω [rad/s]. NaN if no stick is
    /// recorded.
    pub fn pilot(&self, omega: f64) -> Complex<f64> {
        match self.roles.stick {
            Some(_) => self.transfer(self.closed.outputs.len() - 1, omega) / self.error(omega),
            None => Complex::new(f64::NAN, f64::NAN),
        }
    }

    /// From the error to the position, as above.
    pub fn open_loop(&self, omega: f64) -> Complex<f64> {
        self.transfer(self.roles.position, omega) / self.error(omega)
    }

    fn error(&self, omega: f64) -> Complex<f64> {
        let target = f64::from(u8::from(self.roles.target.is_some()));
        target - self.transfer(self.roles.position, omega)
    }

    fn transfer(&self, measured: usize, omega: f64) -> Complex<f64> {
        let input = self.roles.target.unwrap_or(0);
        self.closed
            .transfer(measured, input, Complex::new(0.0, omega))
    }
}

/// Describing functions of pilot and loop from the runs, beside those of a solution. Empty if there is no such loop.
pub(crate) fn describing(posed: &Posed<'_>, solved: &Solved) -> Describing {
    let Some(fitted) = FittedLoop::new(posed, solved) else {
        return Describing::default();
    };
    let all: Vec<Columns> = (posed.data.iter())
        .filter_map(|run| Columns::of(posed, run, &fitted.roles))
        .collect();
    let flights: Vec<Flight<'_>> = all.iter().map(|own| own.flight(&fitted.roles)).collect();
    Describing::of(
        &flights,
        [&|omega| fitted.pilot(omega), &|omega| {
            fitted.open_loop(omega)
        }],
    )
}

/// What the runs of a problem excite in that loop. None if there is no such loop.
pub(crate) fn excitation(posed: &Posed<'_>) -> Option<Excitation> {
    let roles = Roles::of(posed)?;
    let runs = posed.data.iter();
    let all: Vec<Columns> = runs
        .filter_map(|run| Columns::of(posed, run, &roles))
        .collect();
    let flights: Vec<Flight<'_>> = all.iter().map(|own| own.flight(&roles)).collect();
    Excitation::of(&flights)
}

impl Roles {
    /// Roles in a problem in which two instances form a loop.
    pub fn of(posed: &Posed<'_>) -> Option<Self> {
        let description = &posed.file.system;
        opening(description)?;
        let wires = &description.connections;
        let pairs = wires
            .iter()
            .flat_map(|out| wires.iter().map(move |back| [out, back]));
        let pairs = pairs.filter(|[out, back]| {
            let ([a, b], [c, d]) = (ends(description, out), ends(description, back));
            a == d && b == c
        });
        let found: Vec<Self> = pairs
            .filter_map(|pair| Self::between(posed, pair))
            .collect();
        let rank = |own: &Self| (own.target.is_some(), own.stick.is_some());
        // The first of the best.
        found.into_iter().rev().max_by_key(rank)
    }

    /// Roles if a pilot acts through the wire `out` and sees through the wire `back`.
    fn between(posed: &Posed<'_>, [out, back]: [&Wire; 2]) -> Option<Self> {
        let description = &posed.file.system;
        let [pilot, vehicle] = ends(description, out);
        let position = measured(posed, back)?;
        let unit = posed.unit_of(position);
        let into = |own: &Fed, name: &str| instance(description, &own.signal.value) == name;
        let is_target =
            |own: &Fed| into(own, &pilot) && posed.joint.unit(&own.signal.value) == unit;
        let target = posed.file.inputs.iter().position(is_target);
        let is_disturbed = posed
            .file
            .inputs
            .first()
            .is_some_and(|own| into(own, &vehicle));
        (target.is_some() || is_disturbed).then(|| Self {
            target,
            position,
            stick: stick(posed, out),
        })
    }
}

/// The measured signal that a wire carries.
fn measured(posed: &Posed<'_>, wire: &Wire) -> Option<usize> {
    let carried = posed.joint.signal(&wire.from.value)?;
    let is_it = |quantity: &Quantity| match quantity {
        Quantity::Signal(name) => posed.joint.signal(name) == Some(carried),
        Quantity::Expression(..) => false,
    };
    posed.file.measured.iter().position(|own| is_it(&own.of))
}

/// What a wire carries, if it is recorded: in the column of a measured signal, or in one of its own name and unit that nothing
/// is compared with.
fn stick(posed: &Posed<'_>, wire: &Wire) -> Option<Stick> {
    let signal = posed.joint.signal(&wire.from.value)?;
    if let Some(k) = measured(posed, wire) {
        return Some(Stick {
            signal,
            column: posed.file.measured[k].column.clone(),
            unit: posed.unit_of(k).map(str::to_owned),
        });
    }
    let unit = posed.joint.unit(&wire.from.value);
    let name = wire.from.value.rsplit('.').next()?;
    let known = Unit::named(unit?);
    let has_it = |run: &RunData<'_>| {
        let own = run.series.column(name);
        own.is_some_and(|own| !own.unit.is_empty() && Unit::named(&own.unit) == known)
    };
    posed.data.iter().any(has_it).then(|| Stick {
        signal,
        column: Spanned {
            value: name.to_owned(),
            ..wire.from.clone()
        },
        unit: unit.map(str::to_owned),
    })
}

impl Columns {
    fn of(posed: &Posed<'_>, run: &RunData<'_>, roles: &Roles) -> Option<Self> {
        let driven = |own: &Fed| {
            let unit = posed.joint.unit(&own.signal.value);
            run.column(&own.column, unit).ok()
        };
        let measured = |k: usize| {
            let column = &posed.file.measured[k].column;
            run.column(column, posed.unit_of(k)).ok()
        };
        Some(Self {
            name: run.name(),
            time: run.series.time.clone(),
            forcing: posed
                .file
                .inputs
                .iter()
                .map(driven)
                .collect::<Option<_>>()?,
            position: measured(roles.position)?,
            stick: (roles.stick.as_ref())
                .and_then(|own| run.column(&own.column, own.unit.as_deref()).ok()),
        })
    }

    fn flight(&self, roles: &Roles) -> Flight<'_> {
        let target = |k: usize| roles.target.map_or(0.0, |target| self.forcing[target][k]);
        let error = self
            .position
            .iter()
            .enumerate()
            .map(|(k, own)| target(k) - own);
        Flight {
            name: &self.name,
            time: &self.time,
            forcing: self.forcing.iter().map(Vec::as_slice).collect(),
            error: error.collect(),
            stick: self.stick.as_deref(),
            position: &self.position,
        }
    }
}

/// From the inputs of the file to the measured signals and the stick, at the end of the first run. None if a derivative is
/// not finite.
fn linear(
    posed: &Posed<'_>,
    solved: &Solved,
    theta: &[f64],
    stick: Option<&Stick>,
) -> Option<StateSpace> {
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let x = problem.states_at_samples(z, 0).pop()?;
    let last = posed.runs[0].time.len() - 1;
    let point = variables(posed, 0, last, &x, theta);
    let system = &posed.model.system;
    let inputs: Vec<usize> = (posed.file.inputs.iter())
        .map(|own| input(posed, &own.signal.value))
        .collect::<Option<_>>()?;
    let mut graph = system.graph.clone();
    let mut of = [&system.derivatives[..], &posed.quantities.predicted].concat();
    if let Some(stick) = stick {
        let joint = &posed.joint.model.system.graph;
        of.extend(graph.import(joint, &[stick.signal], &posed.quantities.joint));
    }
    let (n, m) = (system.states, of.len() - system.states);
    let columns: Vec<Vec<Node>> = (0..n)
        .map(|k| system.state(k))
        .chain(inputs.iter().copied())
        .map(|variable| graph.derivatives(&of, variable))
        .collect();
    let values = graph.values(&point);
    let entry = |i: usize, j: usize| values[columns[j][i].index()];
    let names = |count: usize| (0..count).map(|k| k.to_string()).collect();
    let found = StateSpace {
        a: DMatrix::from_fn(n, n, entry),
        b: DMatrix::from_fn(n, inputs.len(), |i, j| entry(i, n + j)),
        c: DMatrix::from_fn(m, n, |i, j| entry(n + i, j)),
        d: DMatrix::from_fn(m, inputs.len(), |i, j| entry(n + i, n + j)),
        states: names(n),
        inputs: names(inputs.len()),
        outputs: names(m),
    };
    found.check_finite().ok().map(|()| found)
}

/// The variable of the equations that corresponds to an input of the joint model.
fn input(posed: &Posed<'_>, name: &str) -> Option<usize> {
    let (model, system) = (&posed.joint.model, &posed.model.system);
    let place = model.inputs.iter().position(|own| own == name)?;
    let node = posed.quantities.joint[1 + model.states.len() + place];
    let mut all = (0..system.inputs).map(|k| system.input(k));
    all.find(|variable| system.graph.known_variable(*variable) == Some(node))
}
