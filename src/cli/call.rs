//! Commands as calls of the program that this library is a part of, such as a Python interpreter: what a command would
//! print is handed over instead, with the numbers behind it.
//!
//! The command runs in the thread that calls it. Where it would load FMUs into this process, it runs in one of its own, as
//! it does for users of the command line.

use super::{Cli, Command, terminal};
use crate::file;
use crate::series::Series;
use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches};
use pilotage_process::{Folder, program};
use std::cell::RefCell;
use std::ffi::OsString;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Tells the process of a command the folder into which it writes its [tables](Done::tables).
const FOLDER: &str = "PILOTAGE_TABLES";
/// First comment of the file of a table, before its name.
const NAME: &str = "table ";
/// Ending of the file of a text, which is named like it.
const TEXT: &str = "txt";
/// File with how much of the work is done, and how much there is.
const COUNT: &str = "count";
/// Interval between two counts of another process.
const BETWEEN: Duration = Duration::from_millis(50);
/// Exit code of a command that was ended.
const KILLED: u8 = 130;

/// What a command leaves.
#[derive(Debug, Default, Clone)]
pub struct Done {
    /// The exit code.
    pub code: u8,
    /// What it would print on stdout.
    pub stdout: String,
    /// What it would print on stderr: lines that begin with `error: `, `hint: `, `warning: `, `note: `.
    pub stderr: String,
    /// Names and contents of tables: the rows of a simulation, the runs of a fit.
    pub tables: Vec<(String, Series)>,
    /// Names and contents of texts, such as the summary of a fit beside its JSON.
    pub texts: Vec<(String, String)>,
}

struct Call {
    words: Vec<OsString>,
    done: Done,
    shared: &'static Shared,
}

thread_local! {
    static OWN: RefCell<Option<Call>> = const { RefCell::new(None) };
}

/// Asks a call to stop, from any thread: as the first Ctrl-C does on the command line.
#[derive(Debug, Clone)]
pub struct Stop(Arc<Lent>);

#[derive(Debug)]
struct Lent(&'static Shared);

/// What a call and its caller tell each other meanwhile.
#[derive(Debug)]
struct Shared {
    stop: AtomicBool,
    done: AtomicU64,
    total: AtomicU64,
}

/// Those that no call has at the moment; each is made once.
static FREE: Mutex<Vec<&'static Shared>> = Mutex::new(Vec::new());

impl Default for Stop {
    fn default() -> Self {
        let mut free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || &*Box::leak(Box::new(Shared::new()));
        Self(Arc::new(Lent(free.pop().unwrap_or_else(made))))
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        self.0.stop.store(false, Ordering::SeqCst);
        self.0.done.store(0, Ordering::SeqCst);
        self.0.total.store(0, Ordering::SeqCst);
        let mut free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(self.0);
    }
}

impl Stop {
    /// The call is to stop with what it has.
    pub fn ask(&self) {
        self.0.0.stop.store(true, Ordering::SeqCst);
    }

    /// Whether it was asked to.
    pub fn is_asked(&self) -> bool {
        self.0.0.stop.load(Ordering::SeqCst)
    }

    /// How much of the work is done, and how much there is; both are 0 until that is known.
    pub fn progress(&self) -> (u64, u64) {
        let own = self.0.0;
        (
            own.done.load(Ordering::Relaxed),
            own.total.load(Ordering::Relaxed),
        )
    }
}

impl Shared {
    const fn new() -> Self {
        Self {
            stop: AtomicBool::new(false),
            done: AtomicU64::new(0),
            total: AtomicU64::new(0),
        }
    }

    fn count(&self, done: u64, total: u64) {
        // Several threads count the same work, and may say so in another order.
        match self.total.swap(total, Ordering::Relaxed) == total {
            true => self.done.fetch_max(done, Ordering::Relaxed),
            false => self.done.swap(done, Ordering::Relaxed),
        };
    }
}

/// Takes how much work is done, from any thread.
#[derive(Debug, Clone, Copy)]
pub struct Count(Option<&'static Shared>);

impl Count {
    /// For who calls the command of this thread.
    pub fn to_caller() -> Self {
        Self(with(|call| call.shared))
    }

    /// So much of so much is done.
    pub fn say(self, done: u64, total: u64) {
        if let Some(shared) = self.0 {
            shared.count(done, total);
        } else if let Some(folder) = folder() {
            write_count(folder, done, total);
        }
    }
}

/// Writes how much work this process has done, for who has started it: now and then, and at the end.
fn write_count(folder: &Path, done: u64, total: u64) {
    static OWN: Shared = Shared::new();
    static LAST: Mutex<Option<Instant>> = Mutex::new(None);
    OWN.count(done, total);
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if done == total || last.is_none_or(|last| last.elapsed() > BETWEEN) {
        *last = Some(Instant::now());
        let done = OWN.done.load(Ordering::Relaxed);
        // The next one may be written.
        let _ = std::fs::write(folder.join(COUNT), format!("{done} {total}\n"));
    }
}

/// The folder of the tables, in the process of a command that was called.
fn folder() -> Option<&'static Path> {
    static OWN: OnceLock<Option<PathBuf>> = OnceLock::new();
    OWN.get_or_init(|| std::env::var_os(FOLDER).map(PathBuf::from))
        .as_deref()
}

/// Runs a command, given as its words without the name of the program.
pub fn call(words: Vec<OsString>, stop: &Stop) -> Done {
    let words: Vec<OsString> = std::iter::once("pilotage".into()).chain(words).collect();
    within(words, stop, |words| {
        let command = match parsed(words) {
            Ok(command) => command,
            Err(error) => return refused(&error),
        };
        match command.loads_fmus() {
            true => apart(words, None, stop),
            false => super::run(command),
        }
    })
}

/// Runs a command in a process of its own, with one thread and this working folder: as one of several of this machine.
pub fn call_within(folder: &Path, words: Vec<OsString>, stop: &Stop) -> Done {
    let words: Vec<OsString> = std::iter::once("pilotage".into()).chain(words).collect();
    within(words, stop, |words| apart(words, Some(folder), stop))
}

/// Does work whose words are handed over as those of a command.
pub(super) fn within(
    words: Vec<OsString>,
    stop: &Stop,
    work: impl FnOnce(&[OsString]) -> u8,
) -> Done {
    let call = Call {
        words: words.clone(),
        done: Done::default(),
        shared: stop.0.0,
    };
    OWN.set(Some(call));
    let code = work(&words);
    let mut done = OWN.take().map(|call| call.done).unwrap_or_default();
    done.code = code;
    done
}

fn parsed(words: &[OsString]) -> Result<Command, clap::Error> {
    let matches = Cli::command().try_get_matches_from(words)?;
    let mut command = Cli::from_arg_matches(&matches)?.command;
    if let (Command::Fit(args), Some((_, own))) = (&mut command, matches.subcommand()) {
        args.note_given(own);
    }
    Ok(command)
}

/// Says what is wrong with the words.
fn refused(error: &clap::Error) -> u8 {
    let is_help = matches!(
        error.kind(),
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion
    );
    match is_help {
        true => terminal::print(&error.to_string()).map_or(2, |()| 0),
        false => {
            terminal::eprint(&error.to_string());
            2
        }
    }
}

impl Command {
    /// Whether FMUs would be loaded into this process.
    fn loads_fmus(&self) -> bool {
        match self {
            // By those who call it.
            Self::Cosim(_) | Self::Linearize(_) => false,
            Self::Fly(_) | Self::Demo(_) | Self::Pack(_) => true,
            _ => self.may_call_fmus(),
        }
    }
}

/// Runs the command in a process of its own.
fn apart(words: &[OsString], within: Option<&Path>, stop: &Stop) -> u8 {
    let ran = ran_apart(&words[1..], within, stop).unwrap_or_else(|error| Done {
        code: 2,
        stderr: format!("error: cannot start a process for the FMUs: {error}\n"),
        ..Done::default()
    });
    let code = ran.code;
    with(|call| call.done = ran);
    code
}

fn ran_apart(words: &[OsString], within: Option<&Path>, stop: &Stop) -> std::io::Result<Done> {
    let folder = Folder::create()?;
    let mut command = program::command()?;
    if let Some(within) = within {
        command.current_dir(within).env("RAYON_NUM_THREADS", "1");
    }
    let mut child = command
        .args(words)
        .env(FOLDER, folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let streams = (child.stdout.take(), child.stderr.take());
    let (code, stdout, stderr) = std::thread::scope(|scope| {
        let stdout = scope.spawn(move || all(streams.0));
        let stderr = scope.spawn(move || all(streams.1));
        let code = ended(&mut child, folder.path(), stop);
        let text = |thread: std::thread::ScopedJoinHandle<'_, String>| thread.join();
        let streams = (text(stdout), text(stderr));
        (
            code,
            streams.0.unwrap_or_default(),
            streams.1.unwrap_or_default(),
        )
    });
    Ok(Done {
        code: code?,
        stdout,
        stderr,
        tables: tables(folder.path()),
        texts: texts(folder.path()),
    })
}

fn all(stream: Option<impl Read>) -> String {
    let mut bytes = Vec::new();
    if let Some(mut stream) = stream {
        let _ = stream.read_to_end(&mut bytes);
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Waits for a process, to which the wish to stop is passed on.
fn ended(child: &mut Child, folder: &Path, stop: &Stop) -> std::io::Result<u8> {
    let mut is_told = false;
    let mut last = Instant::now();
    loop {
        let ended = child.try_wait()?;
        if ended.is_some() || last.elapsed() > BETWEEN {
            last = Instant::now();
            pass_on(folder, stop);
        }
        if let Some(status) = ended {
            let code = status.code().and_then(|code| u8::try_from(code).ok());
            return Ok(code.unwrap_or(KILLED));
        }
        if !is_told && stop.is_asked() {
            is_told = true;
            #[cfg(unix)]
            pilotage_process::child::interrupt(child.id());
            #[cfg(not(unix))]
            child.kill()?;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// How much of its work a process has done.
fn pass_on(folder: &Path, stop: &Stop) {
    let text = file::text(&folder.join(COUNT)).unwrap_or_default();
    let numbers = text.trim_end().split_once(' ');
    if let Some((Ok(done), Ok(total))) = numbers.map(|own| (own.0.parse(), own.1.parse())) {
        stop.0.0.count(done, total);
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<_> = entries.map(|entry| entry.path()).collect();
    files.sort();
    files
}

/// The texts of a folder.
fn texts(folder: &Path) -> Vec<(String, String)> {
    let of = |path: PathBuf| {
        let name = path
            .file_stem()
            .filter(|_| path.extension().is_some_and(|own| own == TEXT));
        Some((name?.to_str()?.to_owned(), file::text(&path).ok()?))
    };
    files(folder).into_iter().filter_map(of).collect()
}

/// The tables of a folder, in the order of its files.
fn tables(folder: &Path) -> Vec<(String, Series)> {
    let table = |file: &PathBuf| {
        let series = Series::read_table(file).ok()?;
        let name = series
            .comments
            .first()?
            .trim()
            .strip_prefix(NAME)?
            .to_owned();
        Some((name, series))
    };
    files(folder).iter().filter_map(table).collect()
}

fn with<R>(work: impl FnOnce(&mut Call) -> R) -> Option<R> {
    OWN.with_borrow_mut(|call| call.as_mut().map(work))
}

/// Whether this thread runs a command for another program.
pub fn is_on() -> bool {
    OWN.with_borrow(Option::is_some)
}

/// The words of the command, with the program's name as the first.
pub fn arguments() -> Vec<OsString> {
    with(|call| call.words.clone()).unwrap_or_else(program::arguments)
}

/// The flag that asks this thread's call to stop.
pub fn stop() -> Option<&'static AtomicBool> {
    with(|call| &call.shared.stop)
}

/// Takes what is printed on stdout. Returns whether somebody takes it.
pub fn print(text: &str) -> bool {
    with(|call| call.done.stdout += text).is_some()
}

/// Takes what is printed on stderr. Returns whether somebody takes it.
pub fn eprint(text: &str) -> bool {
    with(|call| call.done.stderr += text).is_some()
}

/// Whether somebody takes tables.
pub fn takes_tables() -> bool {
    is_on() || folder().is_some()
}

/// Hands over a text.
pub fn keep_text(name: &str, text: String) {
    let mut text = Some(text);
    with(|call| (call.done.texts).extend(text.take().map(|text| (name.to_owned(), text))));
    if let (Some(text), Some(folder)) = (text, folder()) {
        // Without the file the caller has no text.
        let _ = std::fs::write(folder.join(name).with_extension(TEXT), text);
    }
}

/// Hands over a table.
pub fn keep(name: &str, table: Series) {
    let mut table = Some(table);
    with(|call| {
        call.done
            .tables
            .extend(table.take().map(|table| (name.to_owned(), table)))
    });
    if let (Some(mut table), Some(folder)) = (table, folder()) {
        static COUNT: Mutex<usize> = Mutex::new(0);
        let mut count = COUNT.lock().unwrap_or_else(PoisonError::into_inner);
        *count += 1;
        table.comments = vec![format!("{NAME}{name}")];
        let file = folder.join(format!("{:06}.csv", *count));
        // Without the file the caller has no table, and says so.
        let _ = std::fs::write(file, table.to_csv());
    }
}
