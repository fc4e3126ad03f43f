//! Runs this machine's binary: does it behave as the standard requires and as its description declares?
//!
//! Each [`BehaviourCheck`] performs one test on separate instances and reports each stage before it begins, so that a
//! caller that runs it in another process knows in which stage it crashed or hung.

mod clocks;
mod derivatives;
mod exchange;
mod misuses;
mod repeats;
mod slopes;
mod subject;
mod values;

use super::Finding;
use pilotage_fmi::archive::{ArchiveError, Unpacked};
use pilotage_fmi::binding::{BindingError, Missing};
use pilotage_fmi::description::{ModelDescription, Severity};
use pilotage_fmi::fmu::Library;
use pilotage_fmi::memory::{self, Watch};
use pilotage_fmi::surroundings::Surroundings;
use pilotage_fmi::{CallError, Fmu, FmuError, InterfaceType, take_misuses};
use pilotage_text::error_chain::error_chain;
use slopes::Slopes;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use subject::Subject;

/// What is tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The library is loaded.
    Load,
    /// An instance is created, initialized, stepped, terminated and freed; values are read.
    Simulate,
    /// An instance with a wrong GUID is rejected.
    Guid,
    /// After a reset, the same results are obtained again.
    Reset,
    /// After restoring a saved state, the same results are obtained again; also after serialization.
    State,
    /// Instances do not affect each other.
    Instances,
    /// Steps of other lengths are taken.
    Steps,
    /// Directional derivatives agree with the outputs, dependencies are declared, and derivatives of inputs are used.
    Derivatives,
    /// Input clocks tick.
    Clocks,
}

impl What {
    const ALL: [Self; 9] = [
        Self::Load,
        Self::Simulate,
        Self::Guid,
        Self::Reset,
        Self::State,
        Self::Instances,
        Self::Steps,
        Self::Derivatives,
        Self::Clocks,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Simulate => "simulate",
            Self::Guid => "guid",
            Self::Reset => "reset",
            Self::State => "state",
            Self::Instances => "instances",
            Self::Steps => "steps",
            Self::Derivatives => "derivatives",
            Self::Clocks => "clocks",
        }
    }
}

/// A test of one interface of the FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BehaviourCheck {
    /// The interface.
    pub kind: InterfaceType,
    /// What is tested.
    pub what: What,
}

impl fmt::Display for BehaviourCheck {
    /// As parsed by [`FromStr`]: `cs:reset`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", short(self.kind), self.what.name())
    }
}

impl FromStr for BehaviourCheck {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let (kind, what) = text.split_once(':')?;
            let kinds = [InterfaceType::CoSimulation, InterfaceType::ModelExchange];
            Some(Self {
                kind: kinds.into_iter().find(|k| short(*k) == kind)?,
                what: What::ALL.into_iter().find(|w| w.name() == what)?,
            })
        };
        parse().ok_or_else(|| format!("`{text}` is no check, expected such as cs:simulate"))
    }
}

const fn short(kind: InterfaceType) -> &'static str {
    match kind {
        InterfaceType::CoSimulation => "cs",
        InterfaceType::ModelExchange => "me",
        InterfaceType::ScheduledExecution => "se",
    }
}

/// The tests that apply to an FMU, in order; the first is whether it loads.
pub fn all(description: &ModelDescription) -> Vec<BehaviourCheck> {
    let mut checks = Vec::new();
    let kinds = [
        (
            InterfaceType::CoSimulation,
            Facts::co_simulation(description),
        ),
        (
            InterfaceType::ModelExchange,
            Facts::model_exchange(description),
        ),
    ];
    for (kind, facts) in kinds {
        let Some(facts) = facts else { continue };
        let is_wanted = |what: &What| match what {
            What::Load => checks.is_empty(),
            What::Simulate | What::Guid | What::Reset => true,
            What::State => facts.can_save,
            What::Instances => !facts.is_single,
            What::Steps => facts.can_vary_steps,
            What::Derivatives => true,
            What::Clocks => clocks::are_there(description, kind),
        };
        let wanted: Vec<What> = What::ALL.into_iter().filter(is_wanted).collect();
        checks.extend(wanted.into_iter().map(|what| BehaviourCheck { kind, what }));
    }
    checks
}

/// Capabilities of an interface according to the description.
#[derive(Debug, Clone, Copy)]
struct Facts {
    can_save: bool,
    can_serialize: bool,
    is_single: bool,
    can_vary_steps: bool,
    has_derivatives: bool,
}

impl Facts {
    fn co_simulation(description: &ModelDescription) -> Option<Self> {
        let cs = description.co_simulation.as_ref()?;
        Some(Self {
            can_save: cs.can_get_and_set_fmu_state,
            can_serialize: cs.can_serialize_fmu_state,
            is_single: cs.can_be_instantiated_only_once_per_process,
            can_vary_steps: cs.can_handle_variable_communication_step_size,
            has_derivatives: cs.provides_directional_derivative,
        })
    }

    fn model_exchange(description: &ModelDescription) -> Option<Self> {
        let me = description.model_exchange.as_ref()?;
        Some(Self {
            can_save: me.can_get_and_set_fmu_state,
            can_serialize: me.can_serialize_fmu_state,
            is_single: me.can_be_instantiated_only_once_per_process,
            can_vary_steps: false,
            has_derivatives: me.provides_directional_derivative,
        })
    }

    fn of(description: &ModelDescription, kind: InterfaceType) -> Option<Self> {
        match kind {
            InterfaceType::CoSimulation => Self::co_simulation(description),
            InterfaceType::ModelExchange => Self::model_exchange(description),
            InterfaceType::ScheduledExecution => None,
        }
    }
}

/// A report of a running check.
#[derive(Debug, Clone, PartialEq)]
pub enum Report {
    /// It begins this stage.
    Stage(String),
    /// It has this finding.
    Finding(Finding),
}

/// Severity if the process ends in a stage: FMI 2.0 does not define the behaviour for value references without
/// variable, and many FMUs do not check them.
pub fn severity_of_crash(stage: &str) -> Severity {
    match stage == values::BEYOND {
        true => Severity::Warning,
        false => Severity::Error,
    }
}

/// Why a check ended early.
#[derive(Debug)]
enum Stop {
    /// A call failed.
    Call(CallError),
    /// The FMU cannot be loaded or instantiated.
    Fmu(FmuError),
    /// The reason was reported.
    Reported,
}

impl From<CallError> for Stop {
    fn from(error: CallError) -> Self {
        Self::Call(error)
    }
}

impl From<FmuError> for Stop {
    fn from(error: FmuError) -> Self {
        Self::Fmu(error)
    }
}

/// Runs a check. Unpacks the FMU unless this is already done.
///
/// # Foreign code
/// The FMU's code runs in this process, with its rights, and may end it: [`Fmu::load`].
///
/// # Errors
/// Errors that are not the FMU's fault: it cannot be unpacked here.
pub fn run(
    path: &Path,
    unpacked: Option<PathBuf>,
    check: BehaviourCheck,
    report: &mut dyn FnMut(Report),
) -> Result<(), FmuError> {
    let mut reporter = Reporter {
        report,
        stage: String::new(),
        kind: check.kind,
        description: Arc::default(),
    };
    if let Err(stop) = reporter.run(path, unpacked, check) {
        let why = match &stop {
            Stop::Call(error) => error_chain(error),
            Stop::Fmu(error) => error_chain(error),
            Stop::Reported => return Ok(()),
        };
        if let Stop::Fmu(
            error @ (FmuError::Read { .. }
            | FmuError::Archive(ArchiveError::Write { .. } | ArchiveError::Open { .. })),
        ) = stop
        {
            return Err(error);
        }
        let severity = match &stop {
            Stop::Fmu(error) if reporter.is_no_fault(error) => Severity::Note,
            _ => Severity::Error,
        };
        let what = format!("while {}: {why}", reporter.stage);
        reporter.find(what, severity, None);
    }
    Ok(())
}

/// Reports stages and findings of one check.
struct Reporter<'a> {
    report: &'a mut dyn FnMut(Report),
    stage: String,
    kind: InterfaceType,
    /// Set once the FMU is open.
    description: Arc<ModelDescription>,
}

impl Reporter<'_> {
    fn run(
        &mut self,
        path: &Path,
        unpacked: Option<PathBuf>,
        check: BehaviourCheck,
    ) -> Result<(), Stop> {
        self.stage("opening");
        let mut fmu = Fmu::open(path)?;
        self.description = fmu.description().clone();
        self.stage("loading");
        let before = Surroundings::look();
        take_misuses();
        let library = fmu.load_from(unpacked.map(Unpacked::of_others))?;
        let unresolved = library.bindings().find_map(|binding| binding.unresolved());
        if let Some(unresolved) = unresolved.filter(|_| check.what == What::Load) {
            self.warn(format!(
                "a symbol is missing, calling it would end the process: {unresolved}"
            ));
        }
        let done = self.run_check(check, &library);
        // Its finalization runs too.
        drop(library);
        self.misuses(take_misuses());
        for what in before.changed() {
            self.warn(format!(
                "it changes {what}, which is the whole process's and not its own"
            ));
        }
        done
    }

    fn run_check(&mut self, check: BehaviourCheck, library: &Library) -> Result<(), Stop> {
        match check.what {
            What::Load => Ok(()),
            What::Guid => self.guid(library),
            What::Simulate => self.simulate(library),
            What::Reset => self.reset(library),
            What::State => self.state(library),
            What::Instances => self.instances(library),
            What::Steps => self.steps(library),
            What::Derivatives => {
                self.derivatives(library)?;
                self.input_slopes(library)
            }
            What::Clocks => self.clocks(library),
        }
    }

    /// Whether the FMU cannot be tested on this machine, but elsewhere: it is for other machines, or needs a tool or
    /// library, as it declares, that is missing here.
    fn is_no_fault(&self, error: &FmuError) -> bool {
        let cs = self.description.co_simulation.iter();
        let me = self.description.model_exchange.iter();
        let needs_tool = cs
            .map(|cs| cs.needs_execution_tool)
            .chain(me.map(|me| me.needs_execution_tool))
            .any(|needs| needs);
        match error {
            FmuError::NoPlatform { .. } => true,
            FmuError::Binding {
                source:
                    BindingError::Missing {
                        missing: Missing::Library(_),
                    },
                ..
            } => true,
            FmuError::Binding { .. } => needs_tool,
            _ => false,
        }
    }

    fn stage(&mut self, what: &str) {
        self.stage = what.to_owned();
        (self.report)(Report::Stage(self.stage.clone()));
    }

    fn error(&mut self, what: String) {
        self.find(what, Severity::Error, None);
    }

    fn warn(&mut self, what: String) {
        self.find(what, Severity::Warning, None);
    }

    fn find(&mut self, what: String, severity: Severity, variable: Option<&str>) {
        let finding = Finding {
            variable: variable.map(str::to_owned),
            ..Finding::behaviour(&self.description, self.kind, severity, what)
        };
        (self.report)(Report::Finding(finding));
    }

    /// A wrong GUID must be rejected (FMI 2.0.5, section 2.1.5; FMI 3.0, section 2.3.1).
    fn guid(&mut self, library: &Library) -> Result<(), Stop> {
        self.stage("instantiating with a wrong guid");
        if library.accepts_wrong_guid(self.kind) {
            self.warn("an instance is made though the guid is wrong".into());
        }
        Ok(())
    }

    /// A normal simulation run, and its log messages.
    fn simulate(&mut self, library: &Library) -> Result<(), Stop> {
        let watch = Watch::new();
        let mut subject = Subject::start(library, "check", self)?;
        let held = self.held(&mut subject)?;
        let limits = subject.limits();
        self.stage("stepping");
        let mut slopes = Slopes::of(&subject, self.kind);
        let mut goes_on = true;
        for _ in 0..subject.plan.steps {
            goes_on = subject.step(self)?;
            subject.check_limits(&limits, self)?;
            if !goes_on {
                break;
            }
            slopes.read(&mut subject, self)?;
        }
        slopes.compare(self);
        if goes_on {
            self.compare_held(&mut subject, &held)?;
        }
        self.stage("terminating");
        subject.terminate()?;
        self.messages(&mut subject);
        self.stage("freeing the instance");
        drop(subject);
        self.memory(&watch);
        Ok(())
    }

    /// An instance frees the memory that it has allocated, and no other (FMI 2.0.5, section 2.1.5).
    fn memory(&mut self, watch: &Watch) {
        match watch.kept() {
            0 => {}
            kept => self.warn(format!(
                "freeing the instance left memory behind that it got by allocateMemory, {kept} block(s)"
            )),
        }
        if watch.strays() > 0 {
            self.error("it calls freeMemory with what it did not get by allocateMemory".into());
        }
    }

    /// Messages have declared categories and the instance's name (FMI 2.0.5, section 2.1.5).
    fn messages(&mut self, subject: &mut Subject) {
        let messages = subject.messages();
        let declared = &subject.description.log_categories;
        let is_odd = |c: &&String| !c.is_empty() && !declared.iter().any(|known| known.name == **c);
        let categories: BTreeSet<&String> = (messages.iter().map(|m| &m.category))
            .filter(is_odd)
            .collect();
        for category in categories {
            self.warn(format!(
                "it logs under the category `{category}`, which <LogCategories> does not declare"
            ));
        }
        let names = messages.iter().filter_map(|m| m.instance_name.as_ref());
        let others: BTreeSet<&String> = names.filter(|name| **name != subject.name).collect();
        for name in others {
            self.warn(match name.bytes().all(|byte| byte == memory::POISON) {
                true => "it did not copy the instance name, but kept the address of the text, \
                         which was its own only while it was instantiated"
                    .into(),
                false => format!(
                    "it logs under the instance name `{name}`, not under that which it was given"
                ),
            });
        }
    }

    /// Steps of other lengths are possible if the description declares so.
    fn steps(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::start(library, "check", self)?;
        for part in [1.0, 0.5, 0.25, 1.5] {
            self.stage(&format!("taking a step of {} s", part * subject.plan.step));
            if !subject.step_by(part, self)? {
                break;
            }
        }
        Ok(())
    }
}
