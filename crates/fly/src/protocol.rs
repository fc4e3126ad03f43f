//! Protocols: tasks, their order, and the end of training.

use crate::task::{DISTURBANCE_LINES, Display, PERIOD, Signal, TARGET_LINES, Task};
use pilotage_text::document::{self, Document, DocumentError, TomlTable};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::path::Path;

/// Rows per second of a task with a constant target.
const RATE: f64 = 20.0;
/// Rows per second of tasks with sines: 2048 rows per period.
const SINES_RATE: f64 = 25.0;
/// Minimum number of rows of a run after its run-in.
const FEWEST: f64 = 10.0;
/// Maximum length of a task name, which is part of file names.
const LONGEST_NAME: usize = 64;
/// Run-in before sines are evaluated, for transients to decay \[s\].
const RUN_IN: f64 = 8.0;

/// Why a protocol is invalid.
#[derive(Debug, thiserror::Error)]
pub enum ProtocolError {
    /// The file cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// An invalid value.
    #[error("{file}:{line}: `{field}` {fault}")]
    Value {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// The field.
        field: String,
        /// The fault and what is expected.
        fault: String,
    },
}

/// Training is complete when the error no longer decreases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Training {
    /// Minimum number of runs; 0 for no training.
    pub least: usize,
    /// Maximum number of runs.
    pub most: usize,
    /// Relative decrease of a run's rms error below the previous best; if it is smaller, training is complete.
    pub improvement: f64,
}

impl Training {
    /// Whether training is complete after runs with these rms errors.
    pub fn is_over(&self, errors: &[f64]) -> bool {
        if errors.len() < self.least {
            return false;
        }
        let Some((last, before)) = errors.split_last() else {
            return true;
        };
        let best = before.iter().copied().fold(f64::INFINITY, f64::min);
        errors.len() >= self.most || *last > (1.0 - self.improvement) * best
    }
}

/// Order of the measured runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// All runs of a task in sequence.
    Given,
    /// Tasks alternate in rounds, and each round begins with another task.
    Balanced,
    /// Random.
    Random,
}

/// The tasks of a session and their order.
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// Its title for display.
    pub title: String,
    /// The tasks.
    pub tasks: Vec<Task>,
    /// Training before the measured runs of each task.
    pub training: Training,
    /// The order of the measured runs.
    pub order: Order,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Declaration of consent.
    pub consent: String,
}

/// Properties of the vehicle on which tasks depend.
#[derive(Debug, Clone, Copy)]
pub struct Shape<'a> {
    /// Number of axes.
    pub axes: usize,
    /// Unit of the positions.
    pub unit: &'a str,
}

/// Default declaration of consent.
const CONSENT: &str = "I agree that how I move the stick is recorded in files on this computer, under the code above and without my name.";

/// Maximum distance of a target, in the unit of the position.
const FARTHEST: f64 = 1e6;
/// Maximum duration of a run \[s\].
const LONGEST: f64 = 3600.0;

impl Protocol {
    /// The default: targets at 10 and 20 units of position, then tracking of sines, and disturbance by sines on the
    /// stick.
    pub fn usual(shape: Shape<'_>) -> Self {
        let steps = [10.0, 20.0].map(|size| step(shape, size));
        let tracking = sines(shape, Some(2.0), None, 1);
        let disturbed = sines(shape, None, Some(0.1), 1);
        Self {
            title: "Steps, then tracking".to_owned(),
            tasks: steps.into_iter().chain([tracking, disturbed]).collect(),
            training: Training {
                least: 2,
                most: 6,
                improvement: 0.05,
            },
            order: Order::Balanced,
            seed: 1,
            consent: CONSENT.to_owned(),
        }
    }

    /// Reads a protocol from a file.
    ///
    /// # Errors
    /// If it cannot be read, or a value is invalid; the error names the line.
    pub fn read(path: &Path, shape: Shape<'_>) -> Result<Self, ProtocolError> {
        Self::parse(&document::read(path)?, &path.display().to_string(), shape)
    }

    /// Parses a protocol; `file` is the name used in messages.
    ///
    /// # Errors
    /// As [`Protocol::read`].
    pub fn parse(text: &str, file: &str, shape: Shape<'_>) -> Result<Self, ProtocolError> {
        let document = Document::parse(text, file)?;
        let root = document.root();
        root.only(&["title", "order", "seed", "consent", "training", "task"])?;
        let usual = Self::usual(shape);
        let tasks = root.tables("task")?;
        if tasks.is_empty() {
            return Err(fault(
                root,
                "task",
                "is missing: a protocol has tables [[task]]",
            ));
        }
        let tasks: Vec<Task> =
            (tasks.into_iter().map(|table| task(table, shape))).collect::<Result<_, _>>()?;
        for (k, own) in tasks.iter().enumerate() {
            if tasks[..k].iter().any(|other| other.name == own.name) {
                let why = format!(
                    "has two tasks named `{}`; give each `name` of its own",
                    own.name
                );
                return Err(fault(root, "task", why));
            }
        }
        Ok(Self {
            title: (root.string("title")?).map_or_else(|| stem(file), str::to_owned),
            tasks,
            training: match root.table("training")? {
                Some(table) => training(table, usual.training)?,
                None => usual.training,
            },
            order: match root.string("order")? {
                None | Some("balanced") => Order::Balanced,
                Some("given") => Order::Given,
                Some("random") => Order::Random,
                Some(_) => {
                    return Err(fault(
                        root,
                        "order",
                        "is none of \"balanced\", \"given\", \"random\"",
                    ));
                }
            },
            seed: whole(root, "seed", 0.0)?.map_or(usual.seed, |seed| seed as u64),
            consent: match root.string("consent")? {
                Some(words) if words.trim().is_empty() => {
                    return Err(fault(
                        root,
                        "consent",
                        "is empty: it says what a person agrees to",
                    ));
                }
                words => words.map_or(usual.consent, str::to_owned),
            },
        })
    }

    /// The measured runs in the order in which they are flown: task number and sign of the targets.
    pub fn runs(&self) -> Vec<(usize, f64)> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let count = self.tasks.len();
        let most = self.tasks.iter().map(|task| task.runs).max().unwrap_or(0);
        let mut all: Vec<usize> = match self.order {
            Order::Given => (0..count)
                .flat_map(|task| vec![task; self.tasks[task].runs])
                .collect(),
            Order::Balanced | Order::Random => (0..most)
                .flat_map(|turn| (0..count).map(move |k| (turn, (turn + k) % count)))
                .filter(|(turn, task)| *turn < self.tasks[*task].runs)
                .map(|(_, task)| task)
                .collect(),
        };
        if self.order == Order::Random {
            for k in (1..all.len()).rev() {
                all.swap(k, random.next_u32() as usize % (k + 1));
            }
        }
        let mut sign =
            |task: &usize| match self.tasks[*task].is_signed && random.next_u32() % 2 == 1 {
                true => -1.0,
                false => 1.0,
            };
        all.iter().map(|task| (*task, sign(task))).collect()
    }
}

/// The name of a file without folder and extension.
fn stem(file: &str) -> String {
    let stem = Path::new(file).file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// A task with a constant target.
fn step(shape: Shape<'_>, size: f64) -> Task {
    let shown = format!("{size} {}", shape.unit);
    Task {
        name: format!("step-{size}"),
        title: shown.clone(),
        words: match shape.axes {
            1 => format!("Bring the vehicle to the marker, {shown} away, and hold it there"),
            _ => format!(
                "Bring the vehicle to the marker, {shown} forward and {shown} to the right, and hold it there"
            ),
        },
        target: vec![Signal::Constant(size); shape.axes],
        disturbance: vec![Signal::Constant(0.0); shape.axes],
        seconds: 15.0,
        run_in: 0.0,
        rate: RATE,
        display: Display::Scene,
        runs: 3,
        is_signed: false,
        is_tracking: false,
    }
}

/// A task with sines as target, on the stick, or both; their phases are random.
fn sines(shape: Shape<'_>, target: Option<f64>, disturbance: Option<f64>, seed: u64) -> Task {
    let of = |rms: Option<f64>, lines: &[u32], own: u64| -> Vec<Signal> {
        let axes = 0..shape.axes as u64;
        axes.map(|axis| match rms {
            Some(rms) => Signal::sines(lines, rms, 1000 * (seed - 1) + own + axis),
            None => Signal::Constant(0.0),
        })
        .collect()
    };
    let (name, title, words) = match (target, disturbance) {
        (Some(_), None) => (
            "tracking",
            "Tracking",
            "Keep the vehicle on the marker, which moves",
        ),
        (None, _) => (
            "disturbance",
            "Holding",
            "Hold the vehicle at the marker, whatever pushes it",
        ),
        (Some(_), Some(_)) => (
            "both",
            "Tracking in gusts",
            "Keep the vehicle on the marker, which moves, whatever pushes it",
        ),
    };
    Task {
        name: name.to_owned(),
        title: title.to_owned(),
        words: words.to_owned(),
        target: of(target, &TARGET_LINES, 1),
        disturbance: of(disturbance, &DISTURBANCE_LINES, 101),
        seconds: RUN_IN + PERIOD,
        run_in: RUN_IN,
        rate: SINES_RATE,
        display: match target {
            Some(_) => Display::Pursuit,
            None => Display::Compensatory,
        },
        runs: 2,
        is_signed: false,
        is_tracking: true,
    }
}

fn task(table: TomlTable<'_>, shape: Shape<'_>) -> Result<Task, ProtocolError> {
    table.only(&[
        "name",
        "title",
        "words",
        "kind",
        "target",
        "disturbance",
        "seconds",
        "run_in",
        "rate",
        "display",
        "runs",
        "random_sign",
        "seed",
    ])?;
    let [target, disturbance] = ["target", "disturbance"].map(|field| table.number(field));
    let (target, disturbance) = (target?, disturbance?);
    if target.is_some_and(|target| !(target.is_finite() && target.abs() <= FARTHEST)) {
        let why = format!("is not within {FARTHEST} of the begin");
        return Err(fault(table, "target", why));
    }
    if disturbance.is_some_and(|rms| !(rms > 0.0 && rms <= 1.0)) {
        let why = "is no part of full stick: above 0, and at most 1";
        return Err(fault(table, "disturbance", why));
    }
    if table.string("kind")? == Some("step") && disturbance.is_some() {
        return Err(fault(table, "disturbance", "belongs to kind = \"sines\""));
    }
    if table.string("kind")? == Some("sines") && target.is_some_and(|rms| rms <= 0.0) {
        let why = "is the rms of sines, above 0; leave it out where nothing is to be followed";
        return Err(fault(table, "target", why));
    }
    let usual = match table.required("kind", table.string("kind")?)? {
        "step" => step(shape, table.required("target", target)?),
        "sines" if target.is_none() && disturbance.is_none() => {
            return Err(fault(
                table,
                "kind",
                "\"sines\" wants target = RMS, or disturbance = RMS, or both",
            ));
        }
        "sines" => {
            let seed = whole(table, "seed", 1.0)?.map_or(1, |seed| seed as u64);
            sines(shape, target, disturbance, seed)
        }
        _ => return Err(fault(table, "kind", "is neither \"step\" nor \"sines\"")),
    };
    if usual.target.iter().all(|own| *own == Signal::Constant(0.0)) && !usual.is_disturbed() {
        return Err(fault(table, "target", "is 0: there is nothing to do"));
    }
    let is_tracking = usual.is_tracking;
    let name = table
        .string("name")?
        .map_or(usual.name.clone(), str::to_owned);
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if name.is_empty()
        || name.len() > LONGEST_NAME
        || name.starts_with(['.', '-'])
        || !name.chars().all(is_plain)
    {
        let why = format!("names files: up to {LONGEST_NAME} letters, digits, - and _ alone");
        return Err(fault(table, "name", why));
    }
    let run_in = table.number("run_in")?.unwrap_or(usual.run_in);
    let after_run_in = usual.seconds - usual.run_in;
    let seconds = match positive(table, "seconds")? {
        Some(seconds) => seconds,
        None if is_tracking => run_in + after_run_in,
        None => usual.seconds,
    };
    if seconds > LONGEST {
        let why = format!("is more than {LONGEST}, an hour");
        return Err(fault(table, "seconds", why));
    }
    let periods = (seconds - run_in) / PERIOD;
    let is_whole = periods > 0.5 && (periods - periods.round()).abs() < 1e-6;
    if is_tracking && table.has("seconds") && !is_whole {
        let why = format!(
            "is not the run-in of {run_in} s and whole periods of the sines of {PERIOD} s, such as {}",
            run_in + PERIOD
        );
        return Err(fault(table, "seconds", why));
    }
    if !(run_in >= 0.0 && run_in < seconds) {
        return Err(fault(
            table,
            "run_in",
            format!("is not from 0 to {seconds} s"),
        ));
    }
    let rate = positive(table, "rate")?.unwrap_or(usual.rate);
    if (1000.0 / rate).fract() != 0.0 {
        return Err(fault(
            table,
            "rate",
            "does not divide 1000, the steps per second",
        ));
    }
    if rate * (seconds - run_in) < FEWEST {
        let field = if table.has("seconds") {
            "seconds"
        } else {
            "rate"
        };
        let why = format!("leaves fewer than {FEWEST} rows to a run");
        return Err(fault(table, field, why));
    }
    Ok(Task {
        name,
        title: table
            .string("title")?
            .map_or(usual.title.clone(), str::to_owned),
        words: table
            .string("words")?
            .map_or(usual.words.clone(), str::to_owned),
        seconds,
        run_in,
        rate,
        display: match table.string("display")? {
            None => usual.display,
            Some("scene") => Display::Scene,
            Some("compensatory") => Display::Compensatory,
            Some("pursuit") => Display::Pursuit,
            Some(_) => {
                return Err(fault(
                    table,
                    "display",
                    "is none of \"scene\", \"compensatory\", \"pursuit\"",
                ));
            }
        },
        runs: whole(table, "runs", 1.0)?.map_or(usual.runs, |runs| runs as usize),
        is_signed: table.boolean("random_sign")?.unwrap_or(false),
        ..usual
    })
}

fn training(table: TomlTable<'_>, usual: Training) -> Result<Training, ProtocolError> {
    table.only(&["least", "most", "improvement"])?;
    let least = whole(table, "least", 0.0)?.map_or(usual.least, |least| least as usize);
    let most = whole(table, "most", 0.0)?.map_or(usual.most.max(least), |most| most as usize);
    if most < least {
        return Err(fault(table, "most", "is less than `least`"));
    }
    let improvement = table.number("improvement")?.unwrap_or(usual.improvement);
    if !(0.0..1.0).contains(&improvement) {
        return Err(fault(table, "improvement", "is a part: from 0 to 1"));
    }
    Ok(Training {
        least,
        most,
        improvement,
    })
}

fn positive(table: TomlTable<'_>, field: &str) -> Result<Option<f64>, ProtocolError> {
    match table.number(field)? {
        Some(value) if !(value > 0.0 && value.is_finite()) => {
            Err(fault(table, field, "is not above 0"))
        }
        value => Ok(value),
    }
}

/// A whole number of at least `least`.
fn whole(table: TomlTable<'_>, field: &str, least: f64) -> Result<Option<f64>, ProtocolError> {
    const MOST: f64 = 1e6;
    match table.number(field)? {
        Some(value) if !((least..=MOST).contains(&value) && value.fract() == 0.0) => Err(fault(
            table,
            field,
            format!("is no whole number from {least} to {MOST}"),
        )),
        value => Ok(value),
    }
}

fn fault(table: TomlTable<'_>, field: &str, fault: impl Into<String>) -> ProtocolError {
    ProtocolError::Value {
        file: table.file().to_owned(),
        line: table.line(field),
        field: field.to_owned(),
        fault: fault.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: Shape<'_> = Shape { axes: 1, unit: "m" };

    #[test]
    fn tasks_take_turns_and_each_turn_begins_with_another() {
        let usual = Protocol::usual(SHAPE);
        let tasks: Vec<usize> = usual.runs().iter().map(|run| run.0).collect();
        assert_eq!(tasks, [0, 1, 2, 3, 1, 2, 3, 0, 0, 1]);
        let random = Protocol {
            order: Order::Random,
            ..usual.clone()
        };
        let mut drawn: Vec<usize> = random.runs().iter().map(|run| run.0).collect();
        assert_ne!(drawn, tasks);
        drawn.sort_unstable();
        assert_eq!(drawn, [0, 0, 0, 1, 1, 1, 2, 2, 3, 3]);
    }

    #[test]
    fn training_is_over_when_the_error_does_not_fall() {
        let training = Protocol::usual(SHAPE).training;
        let cases: [(&[f64], bool); 6] = [
            (&[], false),
            (&[3.0], false),
            (&[3.0, 2.0], false),
            (&[3.0, 2.0, 1.95], true),
            (&[3.0, 2.0, 2.5], true),
            (&[6.0, 5.0, 4.0, 3.0, 2.0, 1.0], true),
        ];
        for (errors, is_over) in cases {
            assert_eq!(training.is_over(errors), is_over, "{errors:?}");
        }
    }

    #[test]
    fn a_file_says_all_or_what_differs() {
        let text = "title = \"two\"\norder = \"given\"\nseed = 7\n[training]\nleast = 0\nmost = 0\n[[task]]\nkind = \"step\"\ntarget = 5\n\
                    seconds = 4\nruns = 2\nrandom_sign = true\n[[task]]\nname = \"gusts\"\nkind = \"sines\"\ndisturbance = 0.2\n";
        let own = Protocol::parse(text, "p.toml", SHAPE).unwrap();
        assert_eq!(
            (own.title.as_str(), own.seed, own.tasks.len()),
            ("two", 7, 2)
        );
        assert!(own.training.is_over(&[]));
        assert_eq!(own.tasks[0].name, "step-5");
        assert_eq!(own.tasks[0].targets(1.0, -1.0), [-5.0]);
        assert_eq!(own.tasks[1].display, Display::Compensatory);
        assert!(own.tasks[1].is_disturbed());
        assert_eq!(own.runs().len(), 4);
    }

    /// The run-in can have any length and is followed by one period; another seed gives other phases.
    #[test]
    fn sines_take_a_period_after_their_run_in() {
        let of = |more: &str| {
            let text = format!("[[task]]\nkind = \"sines\"\ntarget = 5\n{more}");
            let protocol = Protocol::parse(&text, "p.toml", SHAPE).unwrap();
            protocol.tasks.into_iter().next().unwrap()
        };
        let [usual, short, long] = ["", "run_in = 1", "run_in = 1\nseconds = 164.84"].map(of);
        assert_eq!(
            [usual.seconds, short.seconds, long.seconds],
            [89.92, 82.92, 164.84]
        );
        assert_eq!(usual.target, short.target);
        assert_ne!(usual.target, of("seed = 2").target);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, message) in [
            ("", "p.toml:1: `task` is missing"),
            ("[[task]]\nkind = \"hop\"", "p.toml:2: `kind` is neither"),
            (
                "[[task]]\nkind = \"sines\"",
                "p.toml:2: `kind` \"sines\" wants target",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 0",
                "p.toml:3: `target` is 0",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 5\nrate = 30",
                "p.toml:4: `rate` does not divide",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 5\nname = \"../x\"",
                "p.toml:4: `name` names files",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 5\nruns = 0",
                "p.toml:4: `runs` is no whole number",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 5\nseconds = -1",
                "p.toml:4: `seconds` is not above 0",
            ),
            (
                "[[task]]\nkind = \"sines\"\ntarget = 5\nseconds = 20",
                "p.toml:4: `seconds` is not the run-in of 8 s and whole periods of the sines of 81.92 s, such as 89.92",
            ),
            (
                "[[task]]\nkind = \"sines\"\ntarget = 5\nrun_in = -1",
                "p.toml:4: `run_in` is not from 0 to",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = inf",
                "p.toml:3: `target` is not within 1000000 of the begin",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 5\nseconds = 1e5",
                "p.toml:4: `seconds` is more than 3600",
            ),
            (
                "[[task]]\nkind = \"sines\"\ndisturbance = 50",
                "p.toml:3: `disturbance` is no part of full stick",
            ),
            (
                "[[task]]\nkind = \"step\"\ntarget = 5\n[[task]]\nkind = \"step\"\ntarget = 5",
                "p.toml:1: `task` has two tasks named `step-5`",
            ),
            (
                "[[task]]\nkind = \"step\"\ntraget = 5",
                "unknown field `traget`",
            ),
        ] {
            let error = Protocol::parse(text, "p.toml", SHAPE)
                .unwrap_err()
                .to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
