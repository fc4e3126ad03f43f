//! The runs of a study, on all threads.

use super::plan::{Plan, event};
use super::store::{Row, Store};
use super::traces::Traced;
use super::{Args, Counter, Deadline, Failure};
use crate::cli::cosim::{self, ending, scenario};
use crate::cli::system::opened::{Renewal, checked, same_bits};
use crate::cli::{system, terminal};
use crate::cosim::{
    Clock, Ending, Role, Selection, SeriesRecorder, SystemDescription, Thinned, ValueKind,
};
use crate::fmi::Fmu;
use crate::series::Series;
use pilotage_sweep::Measure;
use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system of a study, opened.
pub struct Opened(system::opened::Opened);

impl Opened {
    /// Opens that of the arguments.
    pub fn of(args: &Args) -> Result<Self, Failure> {
        system::opened::Opened::new(&args.wiring).map(Self)
    }

    /// The system.
    pub fn description(&self) -> &SystemDescription {
        &self.0.description
    }

    /// Names of all outputs that are numbers, but for those of tables.
    pub fn outputs(&self) -> Vec<String> {
        let tables: Vec<&str> = self
            .0
            .built
            .tables
            .iter()
            .map(|own| own.name.as_str())
            .collect();
        let outputs = self.0.built.system.outputs();
        let is_number = |name: &str, kind: ValueKind| {
            let instance = name.split('.').next().unwrap_or_default();
            kind != ValueKind::String && !tables.contains(&instance)
        };
        outputs
            .filter(|(name, own)| is_number(name, own.kind))
            .map(|own| own.0)
            .collect()
    }

    /// Names and units of all variables.
    pub fn signals(&self) -> Vec<(String, String)> {
        let system = &self.0.built.system;
        let names: BTreeSet<String> = system.names().map(|own| own.1).collect();
        names
            .into_iter()
            .map(|name| (self.unit(&name), name))
            .map(|(unit, name)| (name, unit))
            .collect()
    }

    /// The unit of a variable; empty if it has none.
    pub fn unit(&self, name: &str) -> String {
        let found = self.0.built.system.find(name);
        let unit = found.ok().and_then(|own| own.unit.as_ref());
        unit.map(|own| own.name.clone()).unwrap_or_default()
    }

    /// The signals that match patterns, or all outputs if there are none.
    pub fn traced(&mut self, patterns: &str) -> Result<Vec<Traced>, Failure> {
        let patterns = match patterns {
            "" => self.outputs(),
            given => cosim::patterns(given),
        };
        let selection = Selection::new(&mut self.0.built.system, &patterns)?;
        let signals = selection.signals().map(|own| Traced {
            name: own.name.clone(),
            unit: own.unit.clone(),
            description: own.description.clone(),
        });
        Ok(signals.collect())
    }

    /// The name, with its instance, of a parameter or an input.
    pub fn varied(&self, name: &str) -> Result<String, Failure> {
        let system = &self.0.built.system;
        let name = system::full_name(system, name, system::only(system));
        match system.find(&name)?.role {
            Role::Parameter | Role::Input => Ok(name),
            role => Err(
                Failure::new(format!("`{name}` is {role} and cannot be varied"))
                    .hint("vary a parameter, or an input"),
            ),
        }
    }

    /// When a run begins and ends, and its steps.
    pub fn clock(&self, args: &Args) -> Result<(Clock, Option<String>), Failure> {
        let system = &self.0.built.system;
        args.times.clock(system, self.description().experiment)
    }

    /// Whether an FMU can be instantiated but once in a process.
    fn is_only_once(&self) -> bool {
        let files = self
            .description()
            .instances
            .iter()
            .filter_map(|own| own.source.value.file());
        files.filter_map(|file| Fmu::open(file).ok()).any(|fmu| {
            let description = fmu.description();
            let own = description
                .co_simulation
                .iter()
                .map(|own| own.can_be_instantiated_only_once_per_process);
            let other = description
                .model_exchange
                .iter()
                .map(|own| own.can_be_instantiated_only_once_per_process);
            own.chain(other).any(|own| own)
        })
    }
}

/// Samples of which one is to show whether components can be made new.
const TRIES: usize = 5;

/// What all runs of a study have in common.
pub struct Runs<'a> {
    args: &'a Args,
    plan: &'a Plan,
    /// What happens in each run.
    scenario: scenario::Read,
    clock: Clock,
    measures: Vec<Measure>,
    /// Variables that the measures need.
    recorded: Vec<String>,
    /// Whether components that are made new give what they gave at first.
    is_renewable: bool,
    /// Whether a sample gives the same numbers each time.
    pub is_repeatable: bool,
    is_only_once: bool,
    first: Mutex<Option<Opened>>,
}

/// A sample, and what was recorded.
type Recorded = Result<(Row, Series), Failure>;

impl<'a> Runs<'a> {
    /// Runs a sample after another one, with components that are made new in between, and with opened ones.
    pub fn new(
        args: &'a Args,
        plan: &'a Plan,
        scenario: scenario::Read,
        measures: Vec<Measure>,
        opened: Opened,
    ) -> Result<Self, Failure> {
        let used = measures
            .iter()
            .flat_map(|own| own.signals().iter().cloned());
        let mut used: BTreeSet<String> = used.collect();
        let traced = || plan.traced.iter().map(|own| own.name.clone());
        traced().for_each(|name| {
            used.remove(&name);
        });
        let mut own = Self {
            clock: opened.clock(args)?.0,
            is_only_once: opened.is_only_once(),
            args,
            plan,
            scenario,
            measures,
            // All outputs are compared.
            recorded: used
                .iter()
                .cloned()
                .chain(traced())
                .chain(opened.outputs())
                .collect(),
            is_renewable: true,
            is_repeatable: true,
            first: Mutex::new(None),
        };
        let mut place = Some(opened);
        let mut renewal = Renewal::Works;
        let count = own.plan.design.count();
        let is_same = |a: &Recorded, b: &Recorded| match (a, b) {
            (Ok(a), Ok(b)) => same_bits([&a.1], [&b.1]),
            _ => false,
        };
        // Of those that fail, what is left is not used again.
        for k in 0..count.min(TRIES) {
            if own.traced(&mut place, k)?.0.failure.is_some() {
                continue;
            }
            let last = |place: &mut _| own.traced(place, count - 1);
            let (opened, found) = checked(&mut place, last, is_same);
            opened?;
            renewal = found;
            break;
        }
        if let Some(doubt) = renewal.doubt(&args.wiring) {
            terminal::say("warning", &doubt);
        }
        own.is_renewable = renewal == Renewal::Works;
        own.is_repeatable = renewal != Renewal::Remembers;
        own.recorded = used.into_iter().chain(traced()).collect();
        own.first = Mutex::new(place.filter(|_| own.is_renewable));
        Ok(own)
    }

    /// Runs samples. False if it was stopped.
    pub fn all(
        &self,
        wanted: &[usize],
        counter: &Counter,
        deadline: &Deadline,
        store: &mut Store,
    ) -> Result<bool, Failure> {
        let next = AtomicUsize::new(0);
        let kept = Mutex::new((store, None));
        let work = || {
            let mut place = self
                .first
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            loop {
                let is_failed = || {
                    kept.lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .1
                        .is_some()
                };
                if deadline.ask().is_break() || is_failed() {
                    return;
                }
                let Some(k) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) else {
                    return;
                };
                let done = self.traced(&mut place, *k);
                if !self.is_renewable {
                    place = None;
                }
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                if let Err(failure) = done.and_then(|(row, series)| kept.0.add(row, &series)) {
                    kept.1.get_or_insert(failure);
                }
                counter.count();
            }
        };
        let threads = match self.is_only_once {
            true => 1,
            false => crate::collocation::threads().min(wanted.len()),
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(work);
            }
            work();
        });
        match kept.into_inner().unwrap_or_else(PoisonError::into_inner) {
            (_, Some(failure)) => Err(failure),
            (store, None) => Ok(wanted.iter().all(|k| store.has(*k))),
        }
    }

    /// Runs a sample with the components in a place, or with new ones; leaves them there if they can be used again.
    fn traced(&self, place: &mut Option<Opened>, k: usize) -> Recorded {
        let mut opened = match place.take() {
            Some(own) => own.0,
            None => Opened::of(self.args)?.0,
        };
        let values = self.plan.design.values(k);
        let failed = |words: String| {
            let row = Row {
                sample: k,
                values: values.clone(),
                measured: vec![f64::NAN; self.measures.len()],
                failure: Some(words),
            };
            (row, Series::default())
        };
        let (mut settings, mut scenario) = (Vec::new(), self.scenario.clone());
        for (name, value) in self.plan.design.names().zip(&values) {
            if let Some(own) = event(name).filter(|_| self.args.scenario.is_some()) {
                if let Err(failure) = scenario.set(own, *value) {
                    *place = Some(Opened(opened));
                    return Ok(failed(failure.message().to_owned()));
                }
                continue;
            }
            let kind = opened
                .built
                .system
                .find(name)
                .map_or(ValueKind::Real, |own| own.kind);
            // Other numbers than reals are written without a point.
            let is_whole = kind != ValueKind::Real && value.fract() == 0.0;
            let text = if is_whole {
                format!("{value:.0}")
            } else {
                format!("{value:?}")
            };
            settings.push((name.to_owned(), text));
        }
        if let Err(failure) = opened.wire(&settings) {
            return Ok(failed(failure.message().to_owned()));
        }
        let mut built = opened.take();
        self.args.coupling.apply_parts(&mut built.system)?;
        let selection = Selection::new(&mut built.system, &self.recorded)?;
        let mut recorder = SeriesRecorder::with_capacity(self.clock.steps() as usize + 2);
        let mut thinned = Thinned::new(&mut recorder, Some(selection), 1);
        let coupling = self.args.coupling.coupling(&self.clock)?;
        let mut system = std::mem::take(&mut built.system);
        let triggers = scenario.apply(&mut system)?;
        let mut conditions = triggers.over(&mut thinned);
        let tolerance = self.args.coupling.component_tolerance();
        let run = crate::cosim::run_open(system, &self.clock, tolerance, coupling, &mut conditions);
        let run = match run {
            Ok(run) => run,
            Err(error) => {
                return Ok(failed(
                    system::explain(error, &built.description)
                        .message()
                        .to_owned(),
                ));
            }
        };
        if let Ending::Failed { .. } | Ending::Discarded { .. } | Ending::Stopped { .. } =
            run.ending
        {
            return Ok(failed(ending::Words::of(&run).message.unwrap_or_default()));
        }
        let measured = self
            .measures
            .iter()
            .map(|own| own.of(&recorder.series))
            .collect();
        *place = opened.renewed(built, run.components)?.map(Opened);
        let row = Row {
            sample: k,
            values,
            measured,
            failure: None,
        };
        Ok((row, recorder.series))
    }
}
