//! Jobs on the recorded flights. Each runs commands that the user could type, in separate processes.

use crate::cli::{system, terminal};
use crate::cosim::Component;
use crate::cosim::component::ComponentError;
use crate::file;
use crate::report::side_by_side;
use crate::series::{Series, flown};
use pilotage_fly::message::{JobKind, JobState, ToPage};
use pilotage_fly::session::{Board, Works};
use pilotage_process::program;
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Flags with which a fit prints its progress and result.
const OUTPUT_FLAGS: [&str; 2] = ["--json", "--verbose"];

/// Number of flights of a person below which a comparison notes that there are few.
const FEW: usize = 3;

/// The vehicle, as needed by jobs.
#[derive(Clone)]
pub struct Flown {
    /// Its name as an argument, valid in any folder.
    pub vehicle: OsString,
    /// First digits of its hash.
    pub hash: String,
    /// For each axis, whether a positive input moves the vehicle forward.
    pub forward: Vec<bool>,
}

/// The jobs of a session.
#[derive(Clone)]
pub struct Jobs {
    flown: Flown,
    folder: PathBuf,
    made: PathBuf,
    is_busy: Arc<AtomicBool>,
}

impl Jobs {
    /// Jobs on the flights in `folder`, with results in `made`.
    pub fn new(flown: Flown, folder: PathBuf, made: PathBuf) -> Self {
        Self {
            flown,
            folder,
            made,
            is_busy: Arc::default(),
        }
    }

    fn pilot(&self, subject: &str) -> PathBuf {
        self.made.join(format!("{subject}-pilot.toml"))
    }

    /// Valid flights of a person with this vehicle and without disturbances, which a fit from targets alone cannot
    /// model, and the number of flights with other vehicles.
    fn flights(&self, subject: &str) -> (Vec<PathBuf>, usize) {
        let all = entries(&self.folder).into_iter();
        let all = all.filter(|path| is_of(path, subject));
        let (own, others): (Vec<PathBuf>, Vec<PathBuf>) =
            all.partition(|path| self.is_ours(&comments(path)));
        let own = own.into_iter().filter(|path| !is_disturbed(path));
        (own.collect(), others.len())
    }

    /// Whether a flight with these header comments was flown with this vehicle, or names none.
    fn is_ours(&self, comments: &[String]) -> bool {
        flown::vehicle(comments).is_none_or(|hash| self.flown.hash == hash)
    }

    /// Number of flights in the folder with other vehicles.
    pub fn of_others(&self) -> usize {
        let all = entries(&self.folder).into_iter();
        let flights = all.filter(|path| path.extension().is_some_and(|own| own == "csv"));
        flights
            .filter(|path| !self.is_ours(&comments(path)))
            .count()
    }

    /// Codes of all persons with flights of this vehicle, each with the number of flights.
    fn subjects(&self) -> Vec<(String, usize)> {
        let mut counts = BTreeMap::<String, usize>::new();
        for path in entries(&self.folder) {
            let comments = comments(&path);
            let subject = flown::comment_value(&comments, "subject");
            let subject = subject.filter(|own| is_of(&path, own) && self.is_ours(&comments));
            if let Some(subject) = subject.filter(|_| !is_disturbed(&path)) {
                *counts.entry(subject.to_owned()).or_default() += 1;
            }
        }
        counts.into_iter().collect()
    }

    /// Runs a job; returns its result, and the page or file it has written.
    fn done(
        &self,
        kind: JobKind,
        subject: &str,
        progress: &dyn Fn(String),
    ) -> Result<(Came, Option<String>), String> {
        std::fs::create_dir_all(&self.made).map_err(|error| error.to_string())?;
        match kind {
            JobKind::Identify => {
                let came = self.identify(subject, progress)?;
                Ok((came, Some(format!("{subject}.html"))))
            }
            JobKind::Export => {
                let pilot = self.pilot(subject);
                if !pilot.is_file() {
                    return Err("identify first: there is no pilot yet".to_owned());
                }
                let file = format!("{subject}-pilot.fmu");
                let mut words = vec![os("export"), pilot.into(), os("-o")];
                words.extend([self.made.join(&file).into(), os("--force")]);
                let ended = one(&words, &self.folder, progress)?;
                Ok((Came::from_words(ended.text), Some(file)))
            }
            JobKind::Compare => Ok((self.compare(progress)?, Some("compare.html".to_owned()))),
            JobKind::Against => Ok((Came::default(), None)),
        }
    }

    /// Fits the pilot of a person: a compensatory pilot, who sees the error, if there are flights with moving targets;
    /// otherwise a pursuit pilot, who sees marker and vehicle (docs/guidance.md, sections 1 and 2).
    fn identify(&self, subject: &str, progress: &dyn Fn(String)) -> Result<Came, String> {
        let (flights, others) = self.flights(subject);
        if flights.is_empty() {
            return Err(match others {
                0 => "no flight counts so far that is without disturbances".to_owned(),
                _ => "all flights that count so far are of another vehicle, or with disturbances"
                    .to_owned(),
            });
        }
        let (moving, still): (Vec<PathBuf>, Vec<PathBuf>) =
            flights.into_iter().partition(|path| moves(path));
        let (is_moving, is_one) = (!moving.is_empty(), self.flown.forward.len() == 1);
        let start = self.made.join(format!("{subject}-start.toml"));
        let (pilot, text) = match (is_moving, is_one) {
            (true, true) => (os("lead_lag"), None),
            (true, false) => (os("crossover2"), None),
            (false, true) => (
                start.clone().into(),
                Some(include_str!("pilots/pursuit.toml")),
            ),
            (false, false) => (
                start.clone().into(),
                Some(include_str!("pilots/pursuit2.toml")),
            ),
        };
        if let Some(text) = text {
            std::fs::write(&start, text).map_err(|error| error.to_string())?;
        }
        let (flights, left) = match is_moving {
            true => (moving, still.len()),
            false => (still, 0),
        };
        let ended = self.fit(subject, &flights, &pilot, progress)?;
        if ended.json["status"] != "converged" {
            // A pilot that is no result must not be flown against or exported.
            let _ = std::fs::remove_file(self.pilot(subject));
        }
        let mut came = Came::of(&ended);
        if left > 0 {
            let flights = counted(left, "flight");
            came.words +=
                &format!("\n{flights} to targets that stand still left out: they say less.");
        }
        if others > 0 {
            let flights = counted(others, "flight");
            came.words += &format!("\n{flights} of another vehicle left out.");
        }
        Ok(came)
    }

    /// One fit of a built-in pilot or a pilot file.
    fn fit(
        &self,
        subject: &str,
        flights: &[PathBuf],
        pilot: &OsStr,
        progress: &dyn Fn(String),
    ) -> Result<Ended, String> {
        let problem = self.made.join(format!("{subject}-problem.toml"));
        let mut init = vec![os("init")];
        init.extend(flights.iter().map(|path| path.clone().into_os_string()));
        init.extend([os("--pilot"), pilot.to_owned()]);
        init.extend([os("--vehicle"), self.flown.vehicle.clone()]);
        init.extend([os("-o"), problem.clone().into(), os("--force")]);
        one(&init, &self.folder, progress)?;
        let text = std::fs::read_to_string(&problem).map_err(|error| error.to_string())?;
        // A loop that was flown is stable, and conditions on all its states hamper the search.
        let text = self.turned(&text).replace("closed_loop = true\n", "");
        std::fs::write(&problem, text).map_err(|error| error.to_string())?;
        let mut fit = vec![os("fit"), problem.into(), os("--force")];
        fit.extend([os("-o"), self.pilot(subject).into()]);
        let page = self.made.join(format!("{subject}.html"));
        fit.extend([os("--report"), page.into()]);
        fit.extend(OUTPUT_FLAGS.map(os));
        one(&fit, &self.folder, progress)
    }

    /// Sets the signs of the initial gains such that the vehicle moves forward.
    fn turned(&self, problem: &str) -> String {
        let names = [
            "\"pilot.gain\" = { start = ",
            "\"pilot.gain2\" = { start = ",
        ];
        let turned = names.iter().zip(&self.flown.forward).filter(|own| !own.1);
        turned.fold(problem.to_owned(), |text, (begin, _)| {
            text.replace(begin, &format!("{begin}-"))
        })
    }

    /// Fits all persons and writes a page that shows the results side by side.
    fn compare(&self, progress: &dyn Fn(String)) -> Result<Came, String> {
        let subjects = self.subjects();
        if subjects.len() < 2 {
            return Err(
                "one person has flown this vehicle here so far: a comparison wants two".to_owned(),
            );
        }
        let mut lines = Vec::new();
        for (subject, count) in &subjects {
            let came = self.identify(subject, progress)?;
            let few = match count < &FEW {
                true => format!(" Of {} alone.", counted(*count, "flight")),
                false => String::new(),
            };
            let verdict = came.verdict.unwrap_or_default();
            let figures: Vec<&str> = came.words.lines().take(2).collect();
            lines.push(format!("{subject}: {verdict}{few}\n{}", figures.join(", ")));
        }
        let pages: Vec<_> = (subjects.iter())
            .map(|(own, count)| {
                (
                    own.as_str(),
                    counted(*count, "flight"),
                    format!("{own}.html"),
                )
            })
            .collect();
        std::fs::write(self.made.join("compare.html"), side_by_side(&pages))
            .map_err(|error| error.to_string())?;
        Ok(Came {
            verdict: Some("Their pages stand side by side.".to_owned()),
            words: lines.join("\n"),
        })
    }
}

fn os(word: &str) -> OsString {
    word.into()
}

/// Whether a file is a flight of the person, by its name.
fn is_of(path: &Path, subject: &str) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let rest = name.strip_prefix(subject);
    rest.is_some_and(|rest| rest.starts_with('-') && rest.ends_with(".csv"))
}

/// The files of a folder, sorted by name.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let all = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let all = all.map(|entry| entry.path());
    // A pipe in the folder is no flight, and reading it would not end.
    let mut all: Vec<PathBuf> = all.filter(|path| path.is_file()).collect();
    all.sort();
    all
}

/// The comment lines at the top of a flight; none for other files.
fn comments(path: &Path) -> Vec<String> {
    let is_flight = path.extension().is_some_and(|own| own == "csv");
    let Some(file) = file::regular(path).ok().filter(|_| is_flight) else {
        return Vec::new();
    };
    let lines = BufReader::new(file).lines().map_while(Result::ok);
    lines
        .map_while(|line| Some(line.strip_prefix('#')?.trim().to_owned()))
        .collect()
}

/// Whether a flight has a moving target.
fn moves(path: &Path) -> bool {
    let Ok(flight) = Series::read(path) else {
        return false;
    };
    let targets = flight
        .columns
        .iter()
        .filter(|own| own.name.starts_with("target"));
    targets
        .into_iter()
        .any(|own| own.values.iter().any(|value| *value != own.values[0]))
}

fn is_disturbed(path: &Path) -> bool {
    let Ok(file) = file::regular(path) else {
        return true;
    };
    let mut lines = BufReader::new(file).lines().map_while(Result::ok);
    lines
        .find(|line| !line.starts_with('#'))
        .is_none_or(|line| line.contains("disturbance"))
}

impl Works for Jobs {
    fn can(&self, subject: &str) -> Vec<JobKind> {
        let has_flights = !self.flights(subject).0.is_empty();
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
        let send = {
            let board = board.clone();
            move |state, came: Came, link| {
                board.send(&ToPage::Job {
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
            return send(JobState::Failed, Came::from_words(words), None);
        }
        send(
            JobState::Running,
            Came::from_words("begun".to_owned()),
            None,
        );
        let (is_busy, board) = (self.is_busy.clone(), board.clone());
        let (own, subject) = (self.clone(), subject.to_owned());
        std::thread::spawn(move || {
            let progress = |words| send(JobState::Running, Came::from_words(words), None);
            let result = own.done(kind, &subject, &progress);
            is_busy.store(false, Ordering::SeqCst);
            match result {
                Ok((came, page)) => {
                    send(
                        JobState::Done,
                        came,
                        page.map(|page| format!("/made/{page}")),
                    );
                    board.send(&ToPage::Can {
                        can: own.can(&subject),
                    });
                }
                Err(words) => send(JobState::Failed, Came::from_words(words), None),
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

/// Maximum length of a line of progress.
const LINE: usize = 160;

/// Output of a command.
struct Ended {
    /// First line of stdout.
    text: String,
    /// The JSON object of a fit.
    json: Value,
    /// Notes on stderr.
    notes: Vec<String>,
}

impl Ended {
    /// Codes and texts of the diagnostics of a fit.
    fn doubts(&self) -> impl Iterator<Item = (&str, &str)> {
        let doubts = self.json["doubts"].as_array().into_iter().flatten();
        doubts.filter_map(|own| Some((own["code"].as_str()?, own["words"].as_str()?)))
    }
}

/// Runs a command and reports the last line of its progress. Exit code 1 (fit not converged) is no error, since its
/// page explains it.
fn one(words: &[OsString], folder: &Path, progress: &dyn Fn(String)) -> Result<Ended, String> {
    let mut program = program::command().map_err(|error| error.to_string())?;
    let mut child = program
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| error.to_string())?;
    let mut output = child.stdout.take().ok_or("no output")?;
    let read = move || {
        let mut text = String::new();
        let _ = output.read_to_string(&mut text);
        text
    };
    let reading = std::thread::Builder::new().spawn(read);
    let reading = reading.map_err(|error| error.to_string())?;
    let errors = BufReader::new(child.stderr.take().ok_or("no output")?);
    let (mut last_report, mut lines) = (Instant::now(), Vec::new());
    for line in errors.lines().map_while(Result::ok) {
        if ["note: ", "warning: ", "error: ", "hint: "]
            .iter()
            .any(|own| line.starts_with(own))
        {
            lines.push(line.clone());
        }
        if last_report.elapsed() > BETWEEN {
            last_report = Instant::now();
            // The solver's numbers are only for the terminal.
            let words = line.split(':').next().unwrap_or_default();
            progress(words.trim().chars().take(LINE).collect());
        }
    }
    let status = child.wait().map_err(|error| error.to_string())?;
    let text = reading.join().unwrap_or_default();
    match status.code() {
        Some(0 | 1) => {
            let notes = lines.iter().filter_map(|line| line.strip_prefix("note: "));
            Ok(Ended {
                json: serde_json::from_str(&text).unwrap_or_default(),
                notes: notes.map(str::to_owned).collect(),
                text: text.lines().next().unwrap_or("done").to_owned(),
            })
        }
        _ => {
            terminal::eprint(&format!("{}\n", lines.join("\n")));
            let error = lines.iter().find(|line| line.starts_with("error: "));
            Err(error.or(lines.first()).map_or_else(
                || "it failed".to_owned(),
                |line| line.trim_start_matches("error: ").to_owned(),
            ))
        }
    }
}

/// Minimum time between two progress reports.
const BETWEEN: Duration = Duration::from_millis(200);

/// Result of a command.
#[derive(Debug, Default)]
struct Came {
    /// One sentence.
    verdict: Option<String>,
    /// Details.
    words: String,
}

impl Came {
    fn from_words(words: String) -> Self {
        Self {
            verdict: None,
            words,
        }
    }

    /// The result of a fit.
    fn of(fit: &Ended) -> Self {
        let doubts: Vec<&str> = fit.doubts().map(|(_, words)| words).collect();
        let status = fit.json["status"].as_str().unwrap_or("without an answer");
        let (figures, is_determined) = figures(&fit.json);
        let verdict = match (status, is_determined, doubts.is_empty()) {
            ("converged", true, true) => "A model of you is found.".to_owned(),
            ("converged", true, false) => "A model of you is found, with doubts.".to_owned(),
            ("converged", false, _) => {
                "These flights say little of you: fly targets that move.".to_owned()
            }
            _ => format!("No model of you is found ({status}): fly more runs, and try again."),
        };
        let mut words: String = figures.iter().map(|own| format!("{own}\n")).collect();
        words += &match doubts.is_empty() {
            true if is_determined => "Nothing speaks against it.".to_owned(),
            true => String::new(),
            false => format!("What speaks against it:\n– {}.", doubts.join("\n– ")),
        };
        fit.notes
            .iter()
            .for_each(|note| words += &format!(" Note: {note}."));
        Self {
            verdict: Some(verdict),
            words,
        }
    }
}

/// The main figures with intervals, and whether the data determine all of them.
fn figures(fit: &Value) -> (Vec<String>, bool) {
    const NAMES: [(&str, &str); 6] = [
        ("crossover_frequency", "crossover at"),
        ("phase_margin", "phase margin"),
        ("effective_delay", "effective delay of the loop"),
        ("pilot.gain", "gain"),
        ("pilot.lead", "lead"),
        ("pilot.delay", "your own delay"),
    ];
    let mut is_determined = true;
    let mut all = Vec::new();
    let tables = [&fit["derived"], &fit["parameters"]];
    let values = tables
        .iter()
        .filter_map(|table| table.as_object())
        .flatten();
    let values: Vec<(&String, &Value)> = values.collect();
    for (name, words) in NAMES {
        let is_own = |key: &str| key == name || key.starts_with(&format!("{name}("));
        for (key, own) in values.iter().filter(|(key, _)| is_own(key)) {
            let number = |field: &str| own[field].as_f64();
            let (Some(value), unit) = (number("value"), own["unit"].as_str().unwrap_or("")) else {
                continue;
            };
            let axis = if key.ends_with("2)") {
                "second axis, "
            } else {
                ""
            };
            let mut line = format!("{axis}{words} {} {unit}", significant(value, 3));
            if let (Some(low), Some(high)) = (number("low"), number("high")) {
                line += &format!(" ({} to {})", significant(low, 3), significant(high, 3));
                is_determined &= high - low < 2.0 * value.abs() || !name.contains('_');
            } else {
                is_determined &= !name.contains('_');
            }
            all.push(line);
        }
    }
    (all, is_determined)
}
