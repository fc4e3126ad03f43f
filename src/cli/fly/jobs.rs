//! Jobs on the recorded flights: each is a command that the user could type, in a separate process.

use crate::cli::{system, terminal};
use crate::cosim::Component;
use crate::cosim::component::ComponentError;
use crate::report::significant;
use pilotage_fly::message::{JobKind, JobState, ToPage};
use pilotage_fly::session::{Board, Works};
use serde_json::Value;
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Makes a fit tell its progress and its result.
const TOLD: [&str; 2] = ["--json", "--verbose"];

/// Jobs of a session.
#[derive(Clone)]
pub struct Jobs {
    vehicle: OsString,
    folder: PathBuf,
    made: PathBuf,
    is_quadcopter: bool,
    is_busy: Arc<AtomicBool>,
}

impl Jobs {
    /// On the flights of that folder; what they make goes to `made`.
    pub fn new(vehicle: OsString, folder: PathBuf, made: PathBuf, is_quadcopter: bool) -> Self {
        Self {
            vehicle,
            folder,
            made,
            is_quadcopter,
            is_busy: Arc::default(),
        }
    }

    fn pilot(&self, subject: &str) -> PathBuf {
        self.made.join(format!("{subject}-pilot.toml"))
    }

    /// Valid flights of a person without disturbances, which a fit by the targets alone does not know.
    fn flights(&self, subject: &str) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .flatten();
        let paths = entries.map(|entry| entry.path());
        let is_own = |path: &PathBuf| {
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            name.strip_prefix(&format!("{subject}-"))
                .is_some_and(|rest| rest.ends_with(".csv"))
        };
        let mut all: Vec<PathBuf> = paths
            .filter(is_own)
            .filter(|path| !is_disturbed(path))
            .collect();
        all.sort();
        all
    }

    /// Codes of all persons who have flights here.
    fn subjects(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .flatten();
        let mut all: Vec<String> = entries
            .filter_map(|entry| said(&entry.path(), "subject"))
            .collect();
        all.sort();
        all.dedup();
        all
    }

    /// The commands of a job, each with its arguments, and the page that comes of them.
    fn commands(
        &self,
        kind: JobKind,
        subject: &str,
    ) -> Result<(Vec<Vec<OsString>>, Option<String>), String> {
        match kind {
            JobKind::Identify => {
                let page = format!("{subject}.html");
                Ok((self.identify(subject)?, Some(page)))
            }
            JobKind::Export => {
                let pilot = self.pilot(subject);
                if !pilot.is_file() {
                    return Err("identify first: there is no pilot yet".to_owned());
                }
                let file = format!("{subject}-pilot.fmu");
                let mut words = vec![os("export")];
                words.extend(self.is_quadcopter.then(|| os("pilot")));
                words.extend([pilot.into(), os("-o"), self.made.join(&file).into()]);
                Ok((vec![words], Some(file)))
            }
            JobKind::Compare => self.compare(),
            JobKind::Against => Ok((Vec::new(), None)),
        }
    }

    fn identify(&self, subject: &str) -> Result<Vec<Vec<OsString>>, String> {
        let flights = self.flights(subject);
        if flights.is_empty() {
            return Err("no flight counts so far that is without disturbances".to_owned());
        }
        let report = [
            os("--report"),
            self.made.join(format!("{subject}.html")).into(),
        ];
        let flights: Vec<OsString> = flights.into_iter().map(OsString::from).collect();
        if self.is_quadcopter {
            let mut fit = vec![os("fit")];
            fit.extend(flights);
            if Path::new(&self.vehicle).is_file() {
                fit.extend([os("--vehicle"), self.vehicle.clone()]);
            }
            fit.extend([os("-o"), self.pilot(subject).into()]);
            fit.extend(report);
            fit.extend(TOLD.map(os));
            return Ok(vec![fit]);
        }
        let problem: OsString = self.made.join(format!("{subject}-problem.toml")).into();
        let mut init = vec![os("init")];
        init.extend(flights);
        init.extend([
            os("--pilot"),
            os("lead_lag"),
            os("--vehicle"),
            self.vehicle.clone(),
            os("-o"),
            problem.clone(),
        ]);
        let mut fit = vec![os("fit"), problem, os("-o"), self.pilot(subject).into()];
        fit.extend(report);
        fit.extend(TOLD.map(os));
        Ok(vec![init, fit])
    }

    /// Each person's fit, and a page that has them side by side.
    fn compare(&self) -> Result<(Vec<Vec<OsString>>, Option<String>), String> {
        let subjects = self.subjects();
        if subjects.len() < 2 {
            return Err("one person has flown here so far: a comparison wants two".to_owned());
        }
        let mut all = Vec::new();
        for subject in &subjects {
            all.extend(self.identify(subject)?);
        }
        let frames = subjects.iter().map(|subject| {
            format!("<iframe data-page=\"{subject}.html\" title=\"{subject}\"></iframe>")
        });
        let page = format!(
            "<!doctype html><meta charset=\"utf-8\"><title>Side by side</title><style>body{{margin:0;display:flex;height:100vh}}\
             iframe{{flex:1;border:0;border-right:1px solid gray;min-width:0}}</style>{}<script>for (const own of document.querySelectorAll('iframe')) own.src = own.dataset.page + location.search</script>",
            frames.collect::<String>()
        );
        std::fs::create_dir_all(&self.made).map_err(|error| error.to_string())?;
        std::fs::write(self.made.join("compare.html"), page).map_err(|error| error.to_string())?;
        Ok((all, Some("compare.html".to_owned())))
    }
}

fn os(word: &str) -> OsString {
    word.into()
}

/// A line at the top of a flight.
fn said(path: &Path, key: &str) -> Option<String> {
    let is_flight = path.extension().is_some_and(|own| own == "csv");
    let file = std::fs::File::open(path).ok().filter(|_| is_flight)?;
    let lines = BufReader::new(file).lines().map_while(Result::ok);
    let mut lines = lines.take_while(|line| line.starts_with('#'));
    lines.find_map(|line| line.strip_prefix(&format!("# {key}: ")).map(str::to_owned))
}

fn is_disturbed(path: &Path) -> bool {
    let Ok(file) = std::fs::File::open(path) else {
        return true;
    };
    let mut lines = BufReader::new(file).lines().map_while(Result::ok);
    lines
        .find(|line| !line.starts_with('#'))
        .is_none_or(|line| line.contains("disturbance"))
}

impl Works for Jobs {
    fn can(&self, subject: &str) -> Vec<JobKind> {
        let has_flights = !self.flights(subject).is_empty();
        let has_pilot = self.pilot(subject).is_file();
        let has_others = self.subjects().len() > 1;
        let all = [
            (JobKind::Identify, has_flights),
            (JobKind::Export, has_pilot),
            (JobKind::Against, has_pilot),
            (JobKind::Compare, has_others),
        ];
        all.into_iter()
            .filter(|own| own.1)
            .map(|own| own.0)
            .collect()
    }

    fn begin(&mut self, kind: JobKind, subject: &str, board: &Arc<Board>) {
        let say = {
            let board = board.clone();
            move |state, came: Came, link| {
                board.say(&ToPage::Job {
                    kind,
                    state,
                    words: came.words,
                    verdict: came.verdict,
                    link,
                })
            }
        };
        if self.is_busy.swap(true, Ordering::SeqCst) {
            let words = "another job goes on; wait a moment".to_owned();
            return say(JobState::Failed, Came::says(words), None);
        }
        let (commands, page) = match self.commands(kind, subject) {
            Ok(commands) => commands,
            Err(words) => {
                self.is_busy.store(false, Ordering::SeqCst);
                return say(JobState::Failed, Came::says(words), None);
            }
        };
        say(JobState::Running, Came::says("begun".to_owned()), None);
        let (is_busy, board, folder) = (self.is_busy.clone(), board.clone(), self.folder.clone());
        let (own, subject) = (self.clone(), subject.to_owned());
        std::thread::spawn(move || {
            let told =
                std::fs::create_dir_all(folder.join("made")).map_err(|error| error.to_string());
            let told = told.and_then(|()| {
                let progress = |words| say(JobState::Running, Came::says(words), None);
                let all = commands.iter().map(|words| one(words, &folder, &progress));
                let all: Vec<Came> = all.collect::<Result<_, String>>()?;
                Ok(match kind {
                    JobKind::Compare => Came::side_by_side(own.subjects(), all),
                    _ => all.into_iter().last().unwrap_or_default(),
                })
            });
            is_busy.store(false, Ordering::SeqCst);
            match told {
                Ok(came) => {
                    say(
                        JobState::Done,
                        came,
                        page.map(|page| format!("/made/{page}")),
                    );
                    board.say(&ToPage::Can {
                        can: own.can(&subject),
                    });
                }
                Err(words) => say(JobState::Failed, Came::says(words), None),
            }
        });
    }

    fn pilot(&self, subject: &str) -> Option<Result<Box<dyn Component>, ComponentError>> {
        let pilot = self.pilot(subject);
        let open = || {
            system::open_one(pilot.as_os_str(), false)
                .map_err(|failure| failure.message().to_owned().into())
        };
        pilot.is_file().then(open)
    }
}

/// Longest line of progress.
const LINE: usize = 160;

/// Runs one command, telling the last line of its progress; what it came to. A fit that has not converged, exit code 1, has
/// a page that tells.
fn one(words: &[OsString], folder: &Path, say: &dyn Fn(String)) -> Result<Came, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut child = Command::new(program)
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| error.to_string())?;
    let mut output = child.stdout.take().ok_or("no output")?;
    let reading = std::thread::spawn(move || {
        let mut text = String::new();
        let _ = output.read_to_string(&mut text);
        text
    });
    let errors = BufReader::new(child.stderr.take().ok_or("no output")?);
    let (mut told, mut lines) = (Instant::now(), Vec::new());
    for line in errors.lines().map_while(Result::ok) {
        if ["note: ", "warning: ", "error: ", "hint: "]
            .iter()
            .any(|own| line.starts_with(own))
        {
            lines.push(line.clone());
        }
        if told.elapsed() > BETWEEN {
            told = Instant::now();
            say(line.trim().chars().take(LINE).collect());
        }
    }
    let status = child.wait().map_err(|error| error.to_string())?;
    let text = reading.join().unwrap_or_default();
    match status.code() {
        Some(0 | 1) => {
            let mut came = Came::of(&text);
            let notes = lines.iter().filter_map(|line| line.strip_prefix("note: "));
            notes.for_each(|note| came.words += &format!(" Note: {note}."));
            Ok(came)
        }
        _ => {
            terminal::tell(&format!("{}\n", lines.join("\n")));
            let error = lines.iter().find(|line| line.starts_with("error: "));
            Err(error.or(lines.first()).map_or_else(
                || "it failed".to_owned(),
                |line| line.trim_start_matches("error: ").to_owned(),
            ))
        }
    }
}

/// Between two words of progress.
const BETWEEN: Duration = Duration::from_millis(200);

/// What a command came to.
#[derive(Debug, Default)]
struct Came {
    /// In a sentence.
    verdict: Option<String>,
    /// In detail.
    words: String,
}

impl Came {
    fn says(words: String) -> Self {
        Self {
            verdict: None,
            words,
        }
    }

    /// Of fits of several people, in their order.
    fn side_by_side(people: Vec<String>, all: Vec<Self>) -> Self {
        let verdicts = all.into_iter().filter_map(|own| own.verdict);
        let lines: Vec<String> = (people.iter().zip(verdicts))
            .map(|(person, verdict)| format!("{person}: {verdict}"))
            .collect();
        Self {
            verdict: Some(lines.join(" ")),
            words: "Their pages stand side by side.".to_owned(),
        }
    }

    /// Of what it printed: of a fit one JSON object.
    fn of(text: &str) -> Self {
        let Ok(fit) = serde_json::from_str::<Value>(text) else {
            return Self {
                verdict: None,
                words: text.lines().next().unwrap_or("done").to_owned(),
            };
        };
        let status = fit["status"].as_str().unwrap_or("without an answer");
        let verdict = match status {
            "converged" => match figures(&fit) {
                all if all.is_empty() => "A model of you is found.".to_owned(),
                all => format!("A model of you is found: {}.", all.join(", ")),
            },
            _ => format!("No model of you is found ({status}): fly more runs, and try again."),
        };
        let doubts = fit["doubts"].as_array().into_iter().flatten();
        let doubts = doubts.filter_map(|doubt| doubt["words"].as_str());
        let doubts: Vec<&str> = doubts.collect();
        let words = match doubts.is_empty() {
            true => "Nothing speaks against it.".to_owned(),
            false => format!("What speaks against it: {}.", doubts.join("; ")),
        };
        Self {
            verdict: Some(verdict),
            words,
        }
    }
}

/// What people ask for first, each with its interval.
fn figures(fit: &Value) -> Vec<String> {
    const NAMES: [(&str, &str); 3] = [
        ("crossover_frequency", "crossover at"),
        ("phase_margin", "phase margin"),
        ("effective_delay", "delay"),
    ];
    let derived = fit["derived"].as_object();
    let figure = |(name, words): (&str, &str)| {
        let own = derived?.iter().find(|(key, _)| key.ends_with(name))?.1;
        let number = |key: &str| own[key].as_f64().map(|value| significant(value, 3));
        let unit = own["unit"].as_str().unwrap_or("");
        let value = number("value")?;
        let interval = match (number("low"), number("high")) {
            (Some(low), Some(high)) => format!(" ({low} to {high})"),
            _ => String::new(),
        };
        Some(format!("{words} {value} {unit}{interval}"))
    };
    NAMES.into_iter().filter_map(figure).collect()
}
