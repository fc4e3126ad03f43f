//! One instance of a container.

use crate::grid::Grid;
use crate::inbox::Inbox;
use crate::load::Opener;
use crate::saved::{Saved, Slots};
use pilotage_cosim::container::TIME;
use pilotage_cosim::{
    Ending, Experiment as Times, MasterError, Port, Role, Session, Value, ValueKind,
};
use pilotage_sdk::clock::Clock;
use pilotage_sdk::instance::{Experiment, InterfaceType, Phase, References};
use pilotage_sdk::problem::{Problem, Severity};
use pilotage_sdk::resources::LoadError;
use pilotage_sdk::simulation::Reached;
use pilotage_sdk::simulation_unit::{Message, Now, SimulationUnit};
use pilotage_sdk::variable::index_of;
use pilotage_text::error_chain::error_chain;
use std::error::Error;
use std::ffi::CString;

/// Most communication steps of the parts in one step of the importer.
const MOST: f64 = 1e9;

/// A system inside an FMU.
pub struct Container {
    opener: Opener,
    pub(crate) session: Session,
    /// In the order of the value references; the time is behind them.
    variables: Vec<Seen>,
    can_vary: bool,
    /// The importer's communication points.
    pub(crate) clock: Option<Clock>,
    /// Those between the parts.
    pub(crate) grid: Grid,
    tolerance: Option<f64>,
    is_end_requested: bool,
    inbox: Inbox,
    pub(crate) slots: Slots,
}

/// A variable of a part.
struct Seen {
    port: Port,
    handle: u32,
    kind: ValueKind,
    /// Its place among the values of the last communication point.
    slot: Option<usize>,
    role: Role,
    is_tunable: bool,
    name: String,
}

impl Container {
    /// An instance with newly opened parts.
    pub fn new(opener: Opener, inbox: Inbox) -> Result<Self, LoadError> {
        let system = inbox.during(|| opener.system())?;
        let names = opener.manifest.variables.iter();
        let seen = names.filter(|name| *name != TIME).map(|name| {
            let port = system.resolve(name)?;
            let variable = system.variable(port);
            Ok(Seen {
                port,
                handle: variable.handle,
                kind: variable.kind,
                slot: None,
                role: variable.role,
                is_tunable: variable.is_tunable,
                name: name.clone(),
            })
        });
        let mut variables = seen.collect::<Result<Vec<Seen>, LoadError>>()?;
        let can_vary = system.abilities().all(|own| own.variable_steps);
        let coupling = opener.manifest.coupling()?;
        let session = Session::new(system, coupling).map_err(|why| error_chain(&why))?;
        let reals = variables
            .iter_mut()
            .filter(|own| own.kind == ValueKind::Real);
        reals.for_each(|own| own.slot = session.slot(own.port));
        Ok(Self {
            session,
            grid: Grid::new(0.0, opener.manifest.step),
            variables,
            can_vary,
            clock: None,
            tolerance: None,
            is_end_requested: false,
            inbox,
            slots: Slots::default(),
            opener,
        })
    }

    fn index(&self, reference: u32) -> Result<usize, Problem> {
        let index = index_of(reference);
        match index <= self.variables.len() {
            true => Ok(index),
            false => Err(Problem::NoVariable {
                reference,
                last: self.variables.len() + 1,
            }),
        }
    }

    /// The variable, if it has one of the types; `found` names them.
    fn typed(&self, reference: u32, kinds: &[ValueKind]) -> Result<&Seen, Problem> {
        let index = self.index(reference)?;
        let Some(variable) = self.variables.get(index) else {
            return Err(other_type(TIME, ValueKind::Real));
        };
        match kinds.contains(&variable.kind) {
            true => Ok(variable),
            false => Err(other_type(&variable.name, variable.kind)),
        }
    }

    /// The variable, if it may be set now.
    fn settable(&self, reference: u32, kinds: &[ValueKind], now: Now) -> Result<&Seen, Problem> {
        let variable = self.typed(reference, kinds)?;
        let refuse = |role, when| {
            Err(Problem::Fixed {
                name: variable.name.clone(),
                role,
                state: now.1,
                when,
            })
        };
        match variable.role {
            Role::Input => Ok(variable),
            Role::Parameter if now.0 == Phase::Start || variable.is_tunable => Ok(variable),
            Role::Parameter => refuse("fixed", "before initialization mode ends"),
            Role::Output | Role::Local => refuse("computed", "nowhere: set what it depends on"),
        }
    }

    fn get_one(&mut self, reference: u32, kinds: &[ValueKind]) -> Result<Value, Problem> {
        let variable = self.typed(reference, kinds)?;
        let (port, handle, kind) = (variable.port, variable.handle, variable.kind);
        let session = &mut self.session;
        let got = self.inbox.during(|| session.get(port, handle, kind));
        got.map_err(|why| self.refused(reference, why.as_ref()))
    }

    /// A real that is not among the values of the last communication point.
    fn get_now(&mut self, reference: u32) -> Result<f64, Problem> {
        if index_of(reference) == self.variables.len() {
            return Ok(self.time());
        }
        let variable = self.typed(reference, REAL)?;
        let (port, handle) = (variable.port, variable.handle);
        let session = &mut self.session;
        let got = self.inbox.during(|| session.get_real(port, handle));
        got.map_err(|why| self.refused(reference, why.as_ref()))
    }

    fn set_one(
        &mut self,
        reference: u32,
        kinds: &[ValueKind],
        value: &Value,
        now: Now,
    ) -> Result<(), Problem> {
        let variable = self.settable(reference, kinds, now)?;
        let (port, handle) = (variable.port, variable.handle);
        let session = &mut self.session;
        let set = self.inbox.during(|| session.set(port, handle, value));
        set.map_err(|why| self.refused(reference, why.as_ref()))
    }

    #[cold]
    fn refused(&self, reference: u32, why: &(dyn Error + 'static)) -> Problem {
        let variable = self.variables.get(index_of(reference));
        let name = variable.map_or(TIME, |own| own.name.as_str());
        inside(format!("`{name}`: {}", error_chain(why)))
    }

    #[cold]
    fn ended(&mut self, ending: Ending) -> Problem {
        let (severity, message) = match ending {
            Ending::Completed | Ending::Stopped { .. } => {
                (Severity::Error, "the parts are not initialized".to_owned())
            }
            Ending::EndRequested { instance, time } => {
                self.is_end_requested = true;
                let message =
                    format!("`{instance}` asks for the end of the simulation at {time} s");
                (Severity::Discard, message)
            }
            Ending::Discarded {
                instance,
                time,
                reached,
                words,
            } => {
                let words = words.map_or(String::new(), |words| format!(": {words}"));
                let message = format!(
                    "`{instance}` could not finish the step from {time} s, it came to {reached} s{words}"
                );
                (Severity::Discard, message)
            }
            Ending::Failed {
                instance,
                time,
                stage,
                source,
            } => {
                let cause = error_chain(source.as_ref());
                let message = format!("`{instance}` failed to {stage} at {time} s: {cause}");
                (Severity::Error, message)
            }
        };
        Problem::Inside { severity, message }
    }
}

/// An error of a part, or about one.
pub fn inside(message: String) -> Problem {
    let severity = Severity::Error;
    Problem::Inside { severity, message }
}

pub fn of_master(error: &MasterError) -> Problem {
    inside(error_chain(error))
}

fn other_type(name: &str, kind: ValueKind) -> Problem {
    let found = match kind {
        ValueKind::Real => "real",
        ValueKind::Integer => "integer",
        ValueKind::Enumeration => "enumeration",
        ValueKind::Boolean => "Boolean",
        ValueKind::String => "string",
    };
    let name = name.to_owned();
    Problem::OtherType { name, found }
}

const REAL: &[ValueKind] = &[ValueKind::Real];
const INTEGER: &[ValueKind] = &[ValueKind::Integer, ValueKind::Enumeration];
const BOOLEAN: &[ValueKind] = &[ValueKind::Boolean];
const STRING: &[ValueKind] = &[ValueKind::String];

impl SimulationUnit for Container {
    type State = Saved;
    const HAS_ALL_TYPES: bool = true;

    fn kind(&self) -> InterfaceType {
        InterfaceType::CoSimulation
    }

    fn guid(&self) -> &str {
        &self.opener.manifest.guid
    }

    fn setup(&mut self, experiment: Experiment) -> Result<(), Problem> {
        experiment.check()?;
        self.tolerance = experiment.tolerance;
        self.clock = Some(Clock::new(experiment.start, experiment.stop));
        self.grid = Grid::new(experiment.start, self.opener.manifest.step);
        Ok(())
    }

    fn check_setup(&self) -> Result<(), Problem> {
        self.clock.map(|_| ()).ok_or(Problem::NoExperiment)
    }

    fn enter_initialization(&mut self) -> Result<(), Problem> {
        let clock = self.clock.ok_or(Problem::NoExperiment)?;
        let times = Times {
            start: clock.time,
            stop: clock.stop.unwrap_or(f64::INFINITY),
            tolerance: self.opener.manifest.part_tolerance.or(self.tolerance),
        };
        let session = &mut self.session;
        let entered = (self.inbox).during(|| session.enter_initialization(&times));
        entered.map_err(|why| of_master(&why))
    }

    fn exit_initialization(&mut self) -> Result<(), Problem> {
        let (session, start) = (&mut self.session, self.grid.time());
        let exited = self.inbox.during(|| session.exit_initialization(start));
        exited.map_err(|why| of_master(&why))
    }

    fn terminate(&mut self) -> Result<(), Problem> {
        let session = &mut self.session;
        let terminated = self.inbox.during(|| session.terminate());
        terminated.map_err(|why| self.ended(why))
    }

    /// Parts that cannot be reset are opened again.
    fn reset(&mut self) -> Result<(), Problem> {
        (self.clock, self.tolerance, self.is_end_requested) = (None, None, false);
        let session = &mut self.session;
        if self.inbox.during(|| session.renew()) {
            return Ok(());
        }
        let opened = self.inbox.during(|| self.opener.open());
        self.session = opened.map_err(Problem::Load)?;
        self.slots.forget();
        Ok(())
    }

    fn get(&mut self, references: References<'_>, values: &mut [f64]) -> Result<(), Problem> {
        for (&reference, value) in references.iter().zip(values) {
            let seen = self.variables.get(index_of(reference));
            *value = match (seen.and_then(|own| own.slot), self.session.row()) {
                (Some(slot), Some(row)) => row[slot],
                _ => self.get_now(reference)?,
            };
        }
        Ok(())
    }

    fn set(&mut self, references: References<'_>, values: &[f64], now: Now) -> Result<(), Problem> {
        let inbox = self.inbox.clone();
        inbox.during(|| {
            for (&reference, &value) in references.iter().zip(values) {
                let variable = self.settable(reference, REAL, now)?;
                let (port, handle) = (variable.port, variable.handle);
                let set = self.session.set_real(port, handle, value);
                set.map_err(|why| self.refused(reference, why.as_ref()))?;
            }
            Ok(())
        })
    }

    fn get_boolean(&mut self, reference: u32) -> Result<bool, Problem> {
        Ok(self.get_one(reference, BOOLEAN)? == Value::Boolean(true))
    }

    fn set_boolean(&mut self, reference: u32, value: bool, now: Now) -> Result<(), Problem> {
        self.set_one(reference, BOOLEAN, &Value::Boolean(value), now)
    }

    fn get_integer(&mut self, reference: u32) -> Result<i64, Problem> {
        match self.get_one(reference, INTEGER)? {
            Value::Integer(value) => Ok(value),
            other => Err(inside(format!("{other:?} is no integer"))),
        }
    }

    fn set_integer(&mut self, reference: u32, value: i64, now: Now) -> Result<(), Problem> {
        self.set_one(reference, INTEGER, &Value::Integer(value), now)
    }

    fn get_string(&mut self, reference: u32) -> Result<CString, Problem> {
        match self.get_one(reference, STRING)? {
            Value::String(text) => Ok(CString::new(text.replace('\0', " ")).unwrap_or_default()),
            other => Err(inside(format!("{other:?} is no string"))),
        }
    }

    fn set_string(&mut self, reference: u32, value: &str, now: Now) -> Result<(), Problem> {
        self.set_one(reference, STRING, &Value::String(value.to_owned()), now)
    }

    fn step(&mut self, time: f64, step: f64, _stop_at_event: bool) -> Result<Reached, Problem> {
        let clock = self.clock.ok_or(Problem::NoExperiment)?;
        let (_, next) = clock.advance(time, step)?;
        let (session, mut grid) = (&mut self.session, self.grid);
        let (can_vary, own) = (self.can_vary, self.opener.manifest.step);
        if step / own > MOST {
            return Err(inside(format!(
                "communicationStepSize = {step:?} s is more than {MOST:e} of the steps of {own:?} s between the parts"
            )));
        }
        let done = self.inbox.during(|| {
            while let Some((span, after)) = grid.next(next.time) {
                if !(can_vary || grid.is_whole(span)) {
                    return Ok(false);
                }
                let (begin, end, h) = span;
                session.advance(begin, end, h)?;
                grid = after;
            }
            Ok(true)
        });
        self.grid = grid;
        match done {
            Ok(true) => {
                self.clock = Some(next);
                let event = false;
                Ok(Reached { time: step, event })
            }
            Ok(false) => Err(inside(format!(
                "communicationStepSize = {step} s, but a part takes steps of {own} s alone; pass a multiple of that"
            ))),
            Err(ending) => {
                self.clock = Some(clock.moved_to(grid.time()));
                Err(self.ended(ending))
            }
        }
    }

    fn time(&self) -> f64 {
        self.clock.map_or(0.0, |clock| clock.time)
    }

    fn is_end_requested(&self) -> bool {
        self.is_end_requested
    }

    #[inline]
    fn take_messages(&mut self) -> Vec<Message> {
        self.inbox.take()
    }

    fn checkpoint(&mut self, version: u8, state: u16) -> Result<Saved, Problem> {
        let inbox = self.inbox.clone();
        inbox.during(|| Saved::of(self, version, state))
    }

    fn origin(state: &Saved) -> (u8, u16) {
        state.origin()
    }

    fn restore(&mut self, state: &Saved) -> Result<(), Problem> {
        let inbox = self.inbox.clone();
        self.is_end_requested = false;
        inbox.during(|| state.restore(self))
    }

    fn to_bytes(&mut self, state: &Saved) -> Result<Vec<u8>, Problem> {
        let inbox = self.inbox.clone();
        inbox.during(|| state.to_bytes(self))
    }

    fn read_bytes(&mut self, bytes: &[u8]) -> Result<Saved, Problem> {
        Saved::from_bytes(bytes, self.guid())
    }
}
