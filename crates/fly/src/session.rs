//! A person's session: welcome, training, measured runs, and their results.

use crate::beside::Beside;
use crate::craft::Craft;
use crate::hand::{Device, Hand, Heard};
use crate::message::{
    About, AxisMessage, FromPage, Hello, JobKind, JoystickMessage, Phase, PhaseKind,
    ProtocolMessage, Recorded, ResultMessage, StateMessage, TaskMessage, ToPage, VehicleMessage,
};
use crate::protocol::Protocol;
use crate::record::{self, Growing, Header, LOGS};
use crate::run::{self, Flown, Listener, State, columns, of_log};
use crate::task::{Signal, Task};
use pilotage_cosim::Component;
use pilotage_cosim::component::ComponentError;
use pilotage_text::printable::excerpt;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{broadcast, watch};

/// Countdown before a run \[s\].
const COUNTDOWN: u32 = 3;
/// Interval between states while no run is in progress.
const IDLE: Duration = Duration::from_millis(33);
/// Interval between writes of the log of all steps.
const PACE: Duration = Duration::from_millis(200);
/// Folders of invalid runs, training runs, and runs together with a model.
const INVALID: &str = "invalid";
const TRAINING: &str = "training";
const AGAINST: &str = "against";
/// Drawn size of a vehicle relative to the farthest target.
const SIZE: f64 = 0.06;

/// Events of a session.
#[derive(Debug)]
pub enum Command {
    /// A message of the page that controls the stick.
    Page(FromPage),
    /// The end of the program.
    Quit,
}

/// Subscription of a page.
#[derive(Debug)]
pub struct Listening {
    /// Messages to send at once.
    pub first: Vec<Arc<str>>,
    /// Later messages.
    pub messages: broadcast::Receiver<Arc<str>>,
    /// States of the vehicle.
    pub states: watch::Receiver<Arc<StateMessage>>,
}

/// Public state of the session, also for pages that connect later.
#[derive(Debug)]
pub struct Board {
    messages: broadcast::Sender<Arc<str>>,
    states: watch::Sender<Arc<StateMessage>>,
    known: Mutex<(Hello, Phase)>,
}

impl Board {
    /// Subscribes a page.
    pub fn listen(&self) -> Listening {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let (hello, phase) = known.clone();
        let first = [ToPage::Hello(Box::new(hello)), ToPage::Phase(phase)];
        Listening {
            first: first.iter().map(text).collect(),
            messages: self.messages.subscribe(),
            states: self.states.subscribe(),
        }
    }

    /// Sends a message to all pages.
    pub fn send(&self, message: &ToPage) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        match message {
            ToPage::Phase(phase) => known.1 = phase.clone(),
            ToPage::Can { can } => known.0.can.clone_from(can),
            _ => {}
        }
        // Without a receiver the message is dropped; pages that connect later get the stored state.
        let _ = self.messages.send(text(message));
    }

    fn recorded(&self, own: Recorded) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.0.recorded.push(own);
    }

    fn show(&self, state: StateMessage) {
        self.states.send_replace(Arc::new(state));
    }
}

/// A message as text.
fn text(message: &ToPage) -> Arc<str> {
    // Consists of numbers and strings only, which always serialize.
    serde_json::to_string(message).unwrap_or_default().into()
}

/// Jobs provided to the session.
pub trait Works: Send {
    /// The jobs available with this subject's flights.
    fn can(&self, subject: &str) -> Vec<JobKind>;
    /// Starts a job, which reports to the board itself.
    fn begin(&mut self, kind: JobKind, subject: &str, board: &Arc<Board>);
    /// The subject's identified pilot, if there is one.
    fn pilot(&self, subject: &str) -> Option<Result<Box<dyn Component>, ComponentError>>;
}

/// Folder and metadata of flights.
#[derive(Debug, Clone)]
pub struct Place {
    /// The folder.
    pub folder: PathBuf,
    /// Version, machine and other metadata at the top of each flight.
    pub header: Header,
    /// Notes to read before the first run.
    pub notes: Vec<String>,
}

/// A session.
pub struct Session {
    craft: Craft,
    protocol: Protocol,
    place: Place,
    hand: Arc<Hand>,
    board: Arc<Board>,
    commands: Receiver<Command>,
    works: Box<dyn Works>,
    subject: String,
    device: Option<Device>,
    calibration: String,
    about: About,
    /// For each task, the rms errors of its training runs.
    trained: Vec<Vec<f64>>,
    best: Vec<f64>,
    beside: Option<Beside>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("craft", &self.craft)
            .finish_non_exhaustive()
    }
}

/// The next run.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Next {
    task: usize,
    sign: f64,
    run: usize,
    of: Option<usize>,
    purpose: Purpose,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Training,
    Measured,
    Against,
}

/// The end was requested.
struct Quit;

impl Session {
    /// A session with that vehicle and protocol, and the board on which it publishes its state.
    pub fn new(
        craft: Craft,
        protocol: Protocol,
        place: Place,
        hand: Arc<Hand>,
        commands: Receiver<Command>,
        works: Box<dyn Works>,
    ) -> (Self, Arc<Board>) {
        let hello = hello(&craft, &protocol, &place, &hand);
        let welcome = Phase {
            phase: PhaseKind::Welcome,
            task: 0,
            run: 1,
            of: None,
            training: false,
            against: false,
            words: protocol.title.clone(),
            seconds: None,
            result: None,
        };
        let board = Arc::new(Board {
            messages: broadcast::channel(64).0,
            states: watch::channel(Arc::default()).0,
            known: Mutex::new((hello, welcome)),
        });
        let tasks = protocol.tasks.len();
        let own = Self {
            craft,
            protocol,
            place,
            hand,
            board: board.clone(),
            commands,
            works,
            subject: String::new(),
            device: None,
            calibration: String::new(),
            about: About::default(),
            trained: vec![Vec::new(); tasks],
            best: vec![f64::INFINITY; tasks],
            beside: None,
        };
        (own, board)
    }

    /// Runs until its end is requested.
    pub fn run(mut self) {
        let _ = self.all();
        let words = "The program has ended. Start it again, and open the address that it shows.";
        self.board.send(&ToPage::Over {
            words: words.to_owned(),
        });
    }

    fn all(&mut self) -> Result<(), Quit> {
        self.welcome()?;
        for task in 0..self.protocol.tasks.len() {
            while !self.protocol.training.is_over(&self.trained[task]) {
                let run = self.trained[task].len() + 1;
                let next = Next {
                    task,
                    sign: 1.0,
                    run,
                    of: None,
                    purpose: Purpose::Training,
                };
                self.until_counted(next)?;
            }
        }
        let runs = self.protocol.runs();
        for (k, (task, sign)) in runs.iter().enumerate() {
            let (run, of) = (k + 1, Some(runs.len()));
            let next = Next {
                task: *task,
                sign: *sign,
                run,
                of,
                purpose: Purpose::Measured,
            };
            self.until_counted(next)?;
        }
        loop {
            let words = format!("All {} runs are recorded. Thank you.", runs.len());
            self.show_phase(PhaseKind::End, None, words, None, None);
            // Only jobs and flights together with the model remain.
            self.wait_for_go(None)?;
        }
    }

    /// Waits for a subject code and consent.
    fn welcome(&mut self) -> Result<(), Quit> {
        loop {
            let Some(command) = self.next(None)? else {
                continue;
            };
            let FromPage::Begin {
                subject,
                consent,
                device,
                calibration,
                about,
            } = command
            else {
                continue;
            };
            let subject = subject.trim().to_owned();
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let trouble = match () {
                () if !consent => Some("without your consent nothing is recorded"),
                () if subject.is_empty()
                    || subject.len() > 32
                    || !subject.chars().all(is_plain) =>
                {
                    Some("the code names files: up to 32 letters, digits and _")
                }
                () => None,
            };
            if let Some(words) = trouble {
                self.board.send(&ToPage::Trouble {
                    words: words.to_owned(),
                });
                continue;
            }
            self.subject = subject;
            self.take(device, &calibration, &about);
            self.board.send(&ToPage::Can {
                can: self.works.can(&self.subject),
            });
            return Ok(());
        }
    }

    /// Repeats a run until it is valid.
    fn until_counted(&mut self, next: Next) -> Result<(), Quit> {
        let words = self.protocol.tasks[next.task].words.clone();
        self.show_phase(PhaseKind::Ready, Some(next), words, None, None);
        self.wait_for_go(Some(next))?;
        while !self.fly(next)? {
            self.wait_for_go(Some(next))?;
        }
        // The person looks at the result before the next run.
        self.wait_for_go(Some(next))
    }

    /// Shows the vehicle at rest until the person starts the run; handles jobs meanwhile.
    fn wait_for_go(&mut self, next: Option<Next>) -> Result<(), Quit> {
        loop {
            match self.next(next)? {
                Some(FromPage::Go) if next.is_some() => return Ok(()),
                Some(FromPage::Job {
                    kind: JobKind::Against,
                }) => self.against(next)?,
                Some(FromPage::Job { kind }) => self.works.begin(kind, &self.subject, &self.board),
                Some(FromPage::Begin {
                    device,
                    calibration,
                    about,
                    ..
                }) => self.take(device, &calibration, &about),
                _ => {}
            }
        }
    }

    /// Sets the device used from now on. A change of device is reported.
    fn take(&mut self, device: Device, calibration: &serde_json::Value, about: &About) {
        let short = |words: &str| excerpt(words).into_owned();
        let read = serde_json::from_value(calibration.clone()).ok();
        let held = self.hand.calibrate(read);
        let held = held.and_then(|held| serde_json::to_value(held).ok());
        self.calibration = short(&held.as_ref().unwrap_or(calibration).to_string());
        self.about = About {
            browser: short(&about.browser),
            screen: short(&about.screen),
        };
        let device = self.hand.holds(device);
        // A disconnected device remains the chosen one.
        if device == Device::None {
            return;
        }
        if self.device.is_some_and(|before| before != device) {
            let words = format!(
                "another stick than before: a {device}; a fit of both would mix two ways to move the hand"
            );
            self.board.send(&ToPage::Trouble { words });
        }
        self.device = Some(device);
    }

    /// Flies the task once more, together with the identified pilot.
    fn against(&mut self, next: Option<Next>) -> Result<(), Quit> {
        let words = "identify first: there is no model of you yet";
        let pilot = self
            .works
            .pilot(&self.subject)
            .unwrap_or_else(|| Err(words.into()));
        match pilot.and_then(|pilot| Beside::new(pilot, &self.craft)) {
            Ok(beside) => self.beside = Some(beside),
            Err(error) => {
                self.board.send(&ToPage::Trouble {
                    words: error.to_string(),
                });
                return Ok(());
            }
        }
        let task = next.map_or(0, |next| next.task);
        let own = Next {
            task,
            sign: 1.0,
            run: 1,
            of: None,
            purpose: Purpose::Against,
        };
        self.fly(own).map(drop)
    }

    /// Waits for a command and shows the state at rest meanwhile.
    fn next(&mut self, next: Option<Next>) -> Result<Option<FromPage>, Quit> {
        match self.commands.recv_timeout(IDLE) {
            Ok(Command::Page(command)) => Ok(Some(command)),
            Ok(Command::Quit) | Err(RecvTimeoutError::Disconnected) => Err(Quit),
            Err(RecvTimeoutError::Timeout) => {
                self.show_rest(next);
                Ok(None)
            }
        }
    }

    /// The vehicle at its initial state, and the current stick.
    fn show_rest(&self, next: Option<Next>) {
        let next = next.unwrap_or(Next {
            task: 0,
            sign: 1.0,
            run: 1,
            of: None,
            purpose: Purpose::Training,
        });
        let task = &self.protocol.tasks[next.task];
        let (input, _) = self.hand.now();
        let origin = self.craft.origin_positions.iter();
        self.board.show(StateMessage {
            t: 0.0,
            left: task.seconds,
            x: self.craft.origin_positions.clone(),
            tilt: vec![0.0; self.craft.tilts.len()],
            target: origin
                .zip(task.targets(0.0, next.sign))
                .map(|(origin, target)| origin + target)
                .collect(),
            stick: input.stick,
            raw: self.hand.raw(),
            n: input.n,
            at: input.t,
            beside: Vec::new(),
        });
    }

    fn show_phase(
        &self,
        phase: PhaseKind,
        next: Option<Next>,
        words: String,
        seconds: Option<f64>,
        result: Option<ResultMessage>,
    ) {
        self.board.send(&ToPage::Phase(Phase {
            phase,
            task: next.map_or(0, |next| next.task),
            run: next.map_or(1, |next| next.run),
            of: next.and_then(|next| next.of),
            training: next.is_some_and(|next| next.purpose == Purpose::Training),
            against: next.is_some_and(|next| next.purpose == Purpose::Against),
            words,
            seconds,
            result,
        }));
    }

    /// Flies one run; returns whether it is valid.
    fn fly(&mut self, next: Next) -> Result<bool, Quit> {
        let task = self.protocol.tasks[next.task].clone();
        for left in (1..=COUNTDOWN).rev() {
            self.show_phase(
                PhaseKind::Countdown,
                Some(next),
                task.words.clone(),
                Some(f64::from(left)),
                None,
            );
            let end = Instant::now() + Duration::from_secs(1);
            while Instant::now() < end {
                let is_stopped = matches!(self.next(Some(next))?, Some(FromPage::Stop));
                if is_stopped || self.hand.is_without_device() {
                    self.show_phase(PhaseKind::Ready, Some(next), task.words.clone(), None, None);
                    self.wait_for_go(Some(next))?;
                    return self.fly(next);
                }
            }
        }
        let name = self.free_name(&task);
        let path = self.place.folder.join(format!("{name}.csv"));
        let (header, columns) = (self.header(&task, None), columns(&self.craft, &task));
        let log = self.place.folder.join(LOGS).join(format!("{name}.csv"));
        let begun = Growing::create(&log, &header, &of_log(&columns), PACE);
        let begun =
            begun.and_then(
                |log| match Growing::create(&path, &header, &columns, Duration::ZERO) {
                    Ok(growing) => Ok((growing, log)),
                    Err(error) => log.discard().and(Err(error)),
                },
            );
        let (growing, log) = match begun {
            Ok(begun) => begun,
            Err(error) => {
                let folder = self.place.folder.display();
                return Ok(self.failed(next, format!("{folder} cannot be written: {error}")));
            }
        };
        self.show_phase(PhaseKind::Fly, Some(next), task.words.clone(), None, None);
        let mut beside = self.beside.take();
        let mut watch = Watch {
            board: &self.board,
            commands: &self.commands,
            hand: &self.hand,
            growing: &growing,
            log: &log,
            quit: false,
        };
        let flown = run::fly(
            &self.craft,
            &task,
            next.sign,
            &self.hand,
            beside.as_mut(),
            &mut watch,
        );
        let quit = watch.quit;
        let counts = match flown {
            Ok(flown) => self.keep(next, &task, &name, (growing, log), &flown),
            Err(error) => self.failed(next, error.to_string()),
        };
        if quit { Err(Quit) } else { Ok(counts) }
    }

    /// Stores a run in its folder and reports the result; returns whether it is valid.
    fn keep(
        &mut self,
        next: Next,
        task: &Task,
        name: &str,
        (growing, log): (Growing, Growing),
        flown: &Flown,
    ) -> bool {
        let why = self.fault(next, flown);
        let is_valid = why.is_none();
        let below = match next.purpose {
            _ if !is_valid => Some(INVALID),
            Purpose::Training => Some(TRAINING),
            Purpose::Against => Some(AGAINST),
            Purpose::Measured => None,
        };
        let folder = below.map_or_else(
            || self.place.folder.clone(),
            |below| self.place.folder.join(below),
        );
        let path = folder.join(format!("{name}.csv"));
        let header = self.header(task, Some((next, flown)));
        let written = growing.finish(Some(&path), &header, &flown.flight);
        let written = written.map_err(|error| format!("{}: {error}", path.display()));
        let logs = self.place.folder.join(LOGS);
        let logged = record::logs(&logs, name, &header, flown).and_then(|()| log.discard());
        let logged = logged.map_err(|error| format!("the log of all steps: {error}"));
        if let Err(error) = written.and(logged) {
            return self.failed(next, format!("it cannot be written: {error}"));
        }
        if is_valid && next.purpose != Purpose::Against {
            self.best[next.task] = self.best[next.task].min(flown.rms);
        }
        if is_valid && next.purpose == Purpose::Training {
            self.trained[next.task].push(flown.rms);
        }
        let file = path
            .strip_prefix(&self.place.folder)
            .unwrap_or(&path)
            .display()
            .to_string();
        self.board.recorded(Recorded {
            file: file.clone(),
            task: task.name.clone(),
            rms: flown.rms,
            training: next.purpose == Purpose::Training,
            valid: is_valid,
            why: why.clone(),
        });
        self.board.send(&ToPage::Can {
            can: self.works.can(&self.subject),
        });
        let training_done = self.protocol.training.is_over(&self.trained[next.task]);
        let words = match &why {
            Some(why) if next.purpose == Purpose::Against => {
                format!("This run does not count: {why}.")
            }
            Some(why) => format!("This run does not count: {why}. It is flown again."),
            None if next.purpose == Purpose::Training && !training_done => {
                "Once more, for training.".to_owned()
            }
            None if next.purpose == Purpose::Training => "You are in practice.".to_owned(),
            None => "Recorded.".to_owned(),
        };
        let unit = &self.craft.positions[0].unit;
        let words = match flown.rms_beside {
            Some(own) if is_valid => format!(
                "{words} Typical distance of your model: {} {unit}, yours: {} {unit}.",
                three(own),
                three(flown.rms)
            ),
            _ => words,
        };
        let best = self.best[next.task];
        let result = ResultMessage {
            file,
            rms: flown.rms,
            unit: self.craft.positions[0].unit.clone(),
            score: self.score(task, next.sign, flown.rms),
            valid: is_valid,
            why,
            best: best.is_finite().then_some(best),
            training_done,
        };
        self.show_phase(PhaseKind::After, Some(next), words, None, Some(result));
        is_valid
    }

    /// Why a run is invalid, if it is.
    fn fault(&self, next: Next, flown: &Flown) -> Option<String> {
        let held = flown.heard.device().map(|(device, _)| device);
        let is_other = |held: Device| self.device.is_some_and(|chosen| chosen != held);
        let other = held.filter(|held| is_other(*held)).map(|held| {
            let chosen = self.device.unwrap_or(Device::None);
            format!("the hand held a {held}, and what was chosen is a {chosen}")
        });
        // Together with a model, the stick may rest, so that only the model flies.
        let is_still = flown.is_still && next.purpose != Purpose::Against;
        let still = is_still.then(|| "the stick did not move".to_owned());
        flown.fault().or(other).or(still)
    }

    fn score(&self, task: &Task, sign: f64, rms: f64) -> u32 {
        let idle = run::idle(&self.craft, task, sign).unwrap_or(0.0);
        match idle > 0.0 {
            true => (100.0 * (1.0 - rms / idle)).clamp(0.0, 100.0).round() as u32,
            false => 0,
        }
    }

    /// Reports a failed run.
    fn failed(&self, next: Next, words: String) -> bool {
        self.board.send(&ToPage::Trouble {
            words: words.clone(),
        });
        self.show_phase(PhaseKind::Ready, Some(next), words, None, None);
        false
    }

    /// The first unused file name for this subject and task.
    fn free_name(&self, task: &Task) -> String {
        let folders = ["", INVALID, TRAINING, AGAINST, LOGS];
        let folders = folders.map(|below| self.place.folder.join(below));
        let is_free = |name: &str| {
            let endings = [".csv", ".csv.part", ".parquet"];
            let is_there = |folder: &PathBuf| {
                endings
                    .iter()
                    .any(|ending| folder.join(format!("{name}{ending}")).exists())
            };
            !folders.iter().any(is_there)
        };
        let names = (1..).map(|k| format!("{}-{}-{k}", self.subject, task.name));
        names
            .into_iter()
            .find(|name| is_free(name))
            .unwrap_or_default()
    }

    /// Metadata at the top of a flight.
    fn header(&self, task: &Task, flown: Option<(Next, &Flown)>) -> Header {
        let mut all = self.place.header.clone();
        all.extend([
            (
                "vehicle",
                format!("{} ({})", self.craft.name, self.craft.origin),
            ),
            ("protocol", self.protocol.title.clone()),
            ("task", task.name.clone()),
            ("subject", self.subject.clone()),
            (
                "display",
                serde_json::to_string(&task.display)
                    .unwrap_or_default()
                    .replace('"', ""),
            ),
        ]);
        let Some((next, flown)) = flown else {
            all.push(("unfinished", "yes".to_owned()));
            return all;
        };
        let heard: &Heard = &flown.heard;
        let device = heard
            .device()
            .map_or_else(String::new, |(device, name)| format!("{device} ({name})"));
        let purpose = match next.purpose {
            Purpose::Training => "training",
            Purpose::Measured => "measured",
            Purpose::Against => "against the model",
        };
        let times =
            |own: &dyn Fn() -> Vec<f64>| crate::distribution::Distribution::of(own()).to_string();
        all.extend([
            ("purpose", purpose.to_owned()),
            (
                "valid",
                self.fault(next, flown)
                    .map_or_else(|| "yes".to_owned(), |why| format!("no: {why}")),
            ),
            ("device", device),
            ("calibration", self.calibration.clone()),
            ("browser", self.about.browser.clone()),
            ("screen", self.about.screen.clone()),
            (
                "events",
                match flown.heard.events() {
                    events if events.is_empty() => "none".to_owned(),
                    events => events.join("; "),
                },
            ),
            (
                "rms",
                match flown.rms.is_finite() {
                    true => format!("{:.4} {}", flown.rms, self.craft.positions[0].unit),
                    false => "none".to_owned(),
                },
            ),
            ("frames of the display [ms]", heard.display().to_string()),
            (
                "frames dropped",
                format!("{:.2} %", 100.0 * heard.dropped()),
            ),
            (
                "round trip of the socket [ms]",
                times(&|| heard.round_trips.clone()),
            ),
            ("from input to state [ms]", flown.to_state.to_string()),
            (
                "from input to picture, by the page [ms]",
                times(&|| heard.shown.iter().map(|own| own.latency).collect()),
            ),
            ("lateness of steps [ms]", flown.lateness.to_string()),
        ]);
        all
    }
}

/// Displays a run, writes its rows, and checks whether it must stop.
struct Watch<'w> {
    board: &'w Board,
    commands: &'w Receiver<Command>,
    hand: &'w Hand,
    growing: &'w Growing,
    log: &'w Growing,
    quit: bool,
}

impl Listener for Watch<'_> {
    fn state(&mut self, state: State) {
        let (n, at) = state.seen;
        self.board.show(StateMessage {
            t: state.time,
            left: state.left,
            x: state.positions,
            tilt: state.tilts,
            target: state.targets,
            stick: state.hand,
            raw: self.hand.raw(),
            n,
            at,
            beside: state.beside,
        });
    }

    fn row(&mut self, row: &[f64]) {
        self.growing.row(row);
    }

    fn step(&mut self, row: &[f64]) {
        self.log.row(row);
    }

    fn stop(&mut self) -> Option<String> {
        match self.commands.try_recv() {
            Ok(Command::Page(FromPage::Stop)) => Some("it was stopped".to_owned()),
            Ok(Command::Quit) | Err(TryRecvError::Disconnected) => {
                self.quit = true;
                Some("the program was ended".to_owned())
            }
            _ => None,
        }
    }
}

/// The value with three significant digits.
fn three(value: f64) -> String {
    let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0);
    format!("{value:.*}", digits as usize)
}

fn hello(craft: &Craft, protocol: &Protocol, place: &Place, hand: &Hand) -> Hello {
    let axes = craft.sticks.iter().zip(&craft.positions);
    let tasks: Vec<TaskMessage> = protocol.tasks.iter().map(task_message).collect();
    let reach = tasks.iter().map(|task| task.reach).fold(0.0, f64::max);
    Hello {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        vehicle: VehicleMessage {
            name: craft.name.clone(),
            axes: axes
                .map(|(stick, position)| AxisMessage {
                    position: position.name.clone(),
                    unit: position.unit.clone(),
                    stick: stick.signal.name.clone(),
                })
                .collect(),
            view: if craft.axes() == 1 { "side" } else { "above" },
            tilts: !craft.tilts.is_empty(),
            size: if reach > 0.0 { SIZE * reach } else { 1.0 },
        },
        protocol: ProtocolMessage {
            title: protocol.title.clone(),
            tasks,
            consent: protocol.consent.clone(),
        },
        recorded: Vec::new(),
        folder: place.folder.display().to_string(),
        notes: place.notes.clone(),
        can: Vec::new(),
        joystick: hand
            .joystick()
            .map(|(name, reading)| JoystickMessage { name, reading }),
    }
}

fn task_message(task: &Task) -> TaskMessage {
    let farthest = |own: &Signal| match own {
        Signal::Constant(place) => place.abs(),
        Signal::Sines(sines) => sines.iter().map(|sine| sine[0]).sum(),
    };
    TaskMessage {
        name: task.name.clone(),
        title: task.title.clone(),
        kind: if task.is_tracking { "sines" } else { "step" },
        display: task.display,
        seconds: task.seconds,
        reach: task.target.iter().map(farthest).fold(0.0, f64::max),
    }
}
