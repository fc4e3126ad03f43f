//! An instance during a simulation, of either kind.

use super::exchange::Solver;
use super::{Facts, Reporter, Stop};
use pilotage_fmi::description::{
    BaseType, Causality, ModelDescription, Precision, RealAttributes, ScalarVariable, Severity,
    TypeKind, VariableKind,
};
use pilotage_fmi::fmu::Library;
use pilotage_fmi::instance::{Saved, Serialized};
use pilotage_fmi::{CallError, Instance, InstanceOptions, InterfaceType, Message, Step};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Times and steps of a simulation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    pub(super) tolerance: Option<f64>,
    start: f64,
    stop: f64,
    /// Communication step [s].
    pub(super) step: f64,
    /// Number of steps in a check.
    pub(super) steps: u32,
}

impl Plan {
    /// The plan suggested by the description, with a limited number of steps. Each check has room for its steps before the
    /// stop time, after which an FMU may return an error (FMI 2.0.5, section 2.1.6): the steps are shorter, or where the
    /// FMU has a fixed one the stop time is later.
    fn of(description: &ModelDescription) -> Self {
        const MOST: f64 = 20.0;
        const LEAST: f64 = 6.0;
        let experiment = description.default_experiment.unwrap_or_default();
        let start = experiment.start_time.unwrap_or(0.0);
        let stop = experiment.stop_time.filter(|&stop| stop > start);
        let stop = stop.unwrap_or(start + 1.0);
        let fixed = (description.co_simulation.as_ref()).and_then(|cs| cs.fixed_internal_step_size);
        let step = (fixed.or(experiment.step_size))
            .filter(|&h| h > 0.0)
            .unwrap_or((stop - start) / 100.0);
        let can_vary = (description.co_simulation.as_ref())
            .is_none_or(|cs| cs.can_handle_variable_communication_step_size);
        let longest = (stop - start) / LEAST;
        let step = match fixed.is_none() && can_vary {
            true => step.min(longest),
            false => step,
        };
        let stop = stop.max(start + LEAST * step);
        Self {
            tolerance: experiment.tolerance,
            start,
            stop,
            step,
            steps: ((stop - start) / step + 1e-9).clamp(1.0, MOST) as u32,
        }
    }
}

/// An initialized instance.
pub(super) struct Subject {
    pub(super) description: Arc<ModelDescription>,
    /// The name given to the instance.
    pub(super) name: String,
    pub(super) instance: Instance,
    pub(super) facts: Facts,
    /// Co-simulation: whether events are handled between steps.
    event_mode_used: bool,
    pub(super) plan: Plan,
    pub(super) solver: Solver,
    time: f64,
    /// Value references and names of the real outputs.
    outputs: Vec<u32>,
    pub(super) names: Vec<String>,
    /// Names of those that were reported as not finite or beyond these.
    reported: BTreeSet<String>,
    /// Whether it was reported that a step ends elsewhere.
    is_elsewhere: bool,
}

/// The outputs after each step.
pub(super) type Trace = Vec<Vec<f64>>;

/// A state that can be restored.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub(super) saved: Saved,
    solver: Solver,
    time: f64,
}

impl Subject {
    /// Instantiates and initializes; compares the start values in between.
    pub(super) fn start(
        library: &Library,
        name: &str,
        reporter: &mut Reporter,
    ) -> Result<Self, Stop> {
        let mut subject = Self::instantiate(library, name, reporter)?;
        subject.initialize(reporter)?;
        Ok(subject)
    }

    /// Instantiates.
    pub(super) fn instantiate(
        library: &Library,
        name: &str,
        reporter: &mut Reporter,
    ) -> Result<Self, Stop> {
        reporter.stage("instantiating");
        let description = library.description().clone();
        let event_mode_used = needs_event_mode(&description, reporter.kind);
        let options = InstanceOptions {
            event_mode_used,
            ..InstanceOptions::default()
        };
        let instance = library.instantiate_with(name, reporter.kind, options)?;
        let facts = Facts::of(&description, reporter.kind).ok_or(CallError::OtherKind {
            kind: reporter.kind,
        })?;
        let outputs = || description.variables.iter().filter(is_real_output);
        let plan = Plan::of(&description);
        Ok(Self {
            outputs: outputs().map(|v| v.value_reference).collect(),
            names: outputs().map(|v| v.name.clone()).collect(),
            reported: BTreeSet::new(),
            is_elsewhere: false,
            name: name.to_owned(),
            facts,
            event_mode_used,
            solver: Solver::default(),
            time: plan.start,
            plan,
            instance,
            description,
        })
    }

    /// Initializes an instantiated FMU up to the first step; compares the start values in between.
    pub(super) fn initialize(&mut self, reporter: &mut Reporter) -> Result<(), Stop> {
        self.enter_initialization(reporter)?;
        reporter.start_values(self)?;
        reporter.stage("reading all variables");
        self.instance.exit_initialization_mode()?;
        reporter.read_all(self)?;
        match self.begin(reporter)? {
            true => Ok(()),
            // Nothing can be tested after the end.
            false => Err(Stop::Reported),
        }
    }

    /// Leaves the first event mode, if there is one. `false` if the end is requested.
    pub(super) fn begin(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        match reporter.kind {
            InterfaceType::ModelExchange => self.enter_continuous_time(reporter),
            _ if self.event_mode_used => self.enter_steps(reporter),
            _ => Ok(true),
        }
    }

    /// Leaves a later event mode. `false` if the end is requested.
    pub(super) fn leave_event_mode(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        match reporter.kind {
            InterfaceType::ModelExchange => self.iterate(reporter),
            _ => self.enter_steps(reporter),
        }
    }

    /// Whether steps can reach any time.
    pub(super) fn can_go_anywhere(&self, kind: InterfaceType) -> bool {
        kind == InterfaceType::ModelExchange || self.facts.can_vary_steps
    }

    /// Steps to that time; `false` if it is not reached.
    pub(super) fn step_to(&mut self, time: f64, reporter: &mut Reporter) -> Result<bool, Stop> {
        reporter.stage(&format!("going on to {time} s"));
        let rest = time - self.time;
        self.step_by(rest / self.plan.step, reporter)
    }

    /// Stop time of the experiment [s].
    pub(super) fn stop(&self) -> f64 {
        self.plan.stop
    }

    /// Enters initialization mode after instantiation.
    pub(super) fn enter_initialization(&mut self, reporter: &mut Reporter) -> Result<(), Stop> {
        let Plan {
            tolerance,
            start,
            stop,
            ..
        } = self.plan;
        reporter.stage("initializing");
        self.time = start;
        self.instance.setup_experiment(tolerance, start, stop)?;
        self.instance.enter_initialization_mode()?;
        Ok(())
    }

    /// Performs one step of the plan; `false` if the FMU requests the end of the simulation or discards the step.
    pub(super) fn step(&mut self, reporter: &mut Reporter) -> Result<bool, Stop> {
        self.step_by(1.0, reporter)
    }

    /// Performs a step whose length is that fraction of the plan's step.
    pub(super) fn step_by(&mut self, part: f64, reporter: &mut Reporter) -> Result<bool, Stop> {
        let h = part * self.plan.step;
        let went_on = match reporter.kind {
            InterfaceType::ModelExchange => self.integrate(h, reporter)?,
            _ => self.communicate(h, reporter)?,
        };
        self.check_outputs(reporter)?;
        Ok(went_on)
    }

    fn communicate(&mut self, h: f64, reporter: &mut Reporter) -> Result<bool, Stop> {
        // Checks of saved states return to earlier times.
        let ended = match self.facts.can_save {
            true => self.instance.do_step_revocably(self.time, h)?,
            false => self.instance.do_step(self.time, h)?,
        };
        match ended {
            Step::Done => {
                self.check_reached(h, reporter);
                self.time += h;
                Ok(true)
            }
            Step::Discarded {
                is_end_requested,
                last_successful,
            } => {
                if last_successful.is_none() {
                    reporter.error(format!(
                        "the step of {h} s from {} s was discarded, and the FMU does not report the time \
                         that it reached",
                        self.time
                    ));
                }
                if !is_end_requested {
                    reporter.warn(format!(
                        "the step of {h} s from {} s was discarded",
                        self.time
                    ));
                }
                Ok(false)
            }
            // Early returns were not allowed, but the end of the simulation may lie within the step.
            Step::Stopped {
                reached,
                is_end_requested,
                is_event,
            } => {
                let is_early = (reached - self.time - h).abs() > 1e-9 * (h + self.time.abs());
                if is_early && !is_end_requested {
                    reporter.error(format!(
                        "the step of {h} s from {} s ended at {reached} s, though early returns \
                         were not allowed",
                        self.time
                    ));
                    return Ok(false);
                }
                self.time = reached;
                if is_event && self.event_mode_used && !is_end_requested {
                    reporter.stage("entering event mode");
                    self.instance.enter_event_mode()?;
                    return self.enter_steps(reporter);
                }
                Ok(!is_end_requested)
            }
        }
    }

    /// A step that ends without an early return has reached its end, but for a fixed step of the FMU's own. A time at or before
    /// the beginning is one that it does not write.
    fn check_reached(&mut self, h: f64, reporter: &mut Reporter) {
        let (end, last) = (self.time + h, self.instance.last_successful_time());
        let own =
            (self.description.co_simulation.as_ref()).and_then(|cs| cs.fixed_internal_step_size);
        let differs = (last - end).abs() > 1e-6 * h + 1.001 * own.unwrap_or(0.0);
        if last > self.time && differs && !std::mem::replace(&mut self.is_elsewhere, true) {
            reporter.warn(format!(
                "the step of {h} s from {} s ended without an early return, with {last} s as its last successful time",
                self.time
            ));
        }
    }

    /// Checks that the outputs are finite.
    fn check_outputs(&mut self, reporter: &mut Reporter) -> Result<(), Stop> {
        let values = self.outputs()?;
        for (name, value) in self.names.iter().zip(values) {
            if !value.is_finite() && self.reported.insert(name.clone()) {
                let what = format!("`{name}` is {value} at {} s", self.time);
                reporter.find(what, Severity::Warning, Some(name));
            }
        }
        Ok(())
    }

    /// The limits and nominal values of the real outputs by the description.
    pub(super) fn limits(&self) -> Vec<RealAttributes> {
        let variables = self.description.variables.iter().filter(is_real_output);
        variables.map(|v| limits(&self.description, v)).collect()
    }

    /// Whether the real outputs are within these limits.
    pub(super) fn check_limits(
        &mut self,
        limits: &[RealAttributes],
        reporter: &mut Reporter,
    ) -> Result<(), Stop> {
        // What rounding does to values at a limit.
        const ROUNDING: f64 = 1e-6;
        let values = self.outputs()?;
        let all = self.names.iter().zip(limits).zip(values);
        for ((name, limits), value) in all {
            let nominal = limits.nominal.unwrap_or(1.0).abs();
            let slack = |limit: &f64| ROUNDING * limit.abs().max(nominal);
            let below = limits.min.filter(|min| value < min - slack(min));
            let above = limits.max.filter(|max| value > max + slack(max));
            let limit = match (below, above) {
                (Some(min), _) => format!("below its min of {min}"),
                (_, Some(max)) => format!("above its max of {max}"),
                _ => continue,
            };
            if self.reported.insert(name.clone()) {
                let what = format!("`{name}` is {value} at {} s, {limit}", self.time);
                reporter.find(what, Severity::Warning, Some(name));
            }
        }
        Ok(())
    }

    /// All real outputs.
    pub(super) fn outputs(&mut self) -> Result<Vec<f64>, Stop> {
        let mut values = vec![0.0; self.outputs.len()];
        self.instance.get_real(&self.outputs, &mut values)?;
        Ok(values)
    }

    /// Takes some steps; returns the outputs after each.
    pub(super) fn trace(&mut self, steps: u32, reporter: &mut Reporter) -> Result<Trace, Stop> {
        let mut trace = Trace::new();
        for _ in 0..steps {
            let goes_on = self.step(reporter)?;
            trace.push(self.outputs()?);
            if !goes_on {
                break;
            }
        }
        Ok(trace)
    }

    /// Current time of the instance [s].
    pub(super) fn time(&self) -> f64 {
        self.time
    }

    pub(super) fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    /// Saves the complete state.
    pub(super) fn save(&mut self) -> Result<Point, Stop> {
        Ok(Point {
            saved: self.instance.save()?,
            solver: self.solver.clone(),
            time: self.time,
        })
    }

    /// The same point in time, with the deserialized state.
    pub(super) fn with_bytes(&mut self, point: &Point, bytes: &Serialized) -> Result<Point, Stop> {
        Ok(Point {
            saved: self.instance.deserialize(bytes)?,
            ..point.clone()
        })
    }

    /// Restores a saved point.
    pub(super) fn restore(&mut self, point: &Point) -> Result<(), Stop> {
        self.instance.restore(point.saved)?;
        self.solver = point.solver.clone();
        self.time = point.time;
        Ok(())
    }

    pub(super) fn terminate(&mut self) -> Result<(), Stop> {
        Ok(self.instance.terminate()?)
    }

    pub(super) fn messages(&mut self) -> Vec<Message> {
        self.instance.take_messages()
    }
}

/// Whether co-simulation must use event mode: clocks tick only in event mode (FMI 3.0, section 4.2).
fn needs_event_mode(description: &ModelDescription, kind: InterfaceType) -> bool {
    let cs = description.co_simulation.as_ref();
    let mut variables = description.variables.iter();
    kind == InterfaceType::CoSimulation
        && cs.is_some_and(|cs| cs.has_event_mode)
        && variables.any(|v| v.kind.base_type() == BaseType::Clock)
}

/// A scalar of type `Real` or `Float64`.
pub(super) fn is_double(variable: &ScalarVariable) -> bool {
    let is_double = variable.kind.base_type() == BaseType::Real(Precision::Double);
    is_double && variable.dimensions.is_empty()
}

fn is_real_output(variable: &&ScalarVariable) -> bool {
    variable.causality == Causality::Output && is_double(variable)
}

/// The limits and the nominal value of a real, its own or those of its type (FMI 2.0.5, section 2.2.7).
fn limits(description: &ModelDescription, variable: &ScalarVariable) -> RealAttributes {
    let VariableKind::Real(real) = &variable.kind else {
        return RealAttributes::default();
    };
    let own = real.attributes.clone();
    let name = real.declared_type.as_deref();
    let declared = description
        .types
        .iter()
        .find(|t| Some(t.name.as_str()) == name);
    match declared.map(|t| &t.kind) {
        Some(TypeKind::Real { attributes, .. }) => RealAttributes {
            min: own.min.or(attributes.min),
            max: own.max.or(attributes.max),
            nominal: own.nominal.or(attributes.nominal),
            ..own
        },
        _ => own,
    }
}
