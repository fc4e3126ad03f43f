//! What can be done with flights on the spot: each a command that the user could type, in a process of its own.

use crate::cli::{system, terminal};
use crate::cosim::Component;
use crate::cosim::component::ComponentError;
use pilotage_fly::message::{JobKind, JobState, ToPage};
use pilotage_fly::session::{Board, Works};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

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
            move |state, words: String, link| {
                board.say(&ToPage::Job {
                    kind,
                    state,
                    words,
                    link,
                })
            }
        };
        if self.is_busy.swap(true, Ordering::SeqCst) {
            return say(
                JobState::Failed,
                "another job goes on; it is a moment".to_owned(),
                None,
            );
        }
        let (commands, page) = match self.commands(kind, subject) {
            Ok(commands) => commands,
            Err(words) => {
                self.is_busy.store(false, Ordering::SeqCst);
                return say(JobState::Failed, words, None);
            }
        };
        say(JobState::Running, "begun".to_owned(), None);
        let (is_busy, board, folder) = (self.is_busy.clone(), board.clone(), self.folder.clone());
        let (own, subject) = (self.clone(), subject.to_owned());
        std::thread::spawn(move || {
            let told =
                std::fs::create_dir_all(folder.join("made")).map_err(|error| error.to_string());
            let told = told.and_then(|()| {
                let mut last = String::new();
                for words in &commands {
                    last = one(words, &folder, &|words| say(JobState::Running, words, None))?;
                }
                Ok(last)
            });
            is_busy.store(false, Ordering::SeqCst);
            match told {
                Ok(words) => {
                    say(
                        JobState::Done,
                        words,
                        page.map(|page| format!("/made/{page}")),
                    );
                    board.say(&ToPage::Can {
                        can: own.can(&subject),
                    });
                }
                Err(words) => say(JobState::Failed, words, None),
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

/// Runs one command; the last line of what it says. A fit that has not converged, exit code 1, has a page that tells.
fn one(words: &[OsString], folder: &Path, say: &dyn Fn(String)) -> Result<String, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut child = Command::new(program)
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| error.to_string())?;
    let said = Arc::new(Mutex::new(String::new()));
    let (errors, told) = (child.stderr.take(), said.clone());
    let listening = std::thread::spawn(move || {
        let mut text = String::new();
        if let Some(mut errors) = errors {
            let _ = errors.read_to_string(&mut text);
        }
        if let Ok(mut said) = told.lock() {
            *said = text;
        }
    });
    let mut lines = Vec::new();
    for line in BufReader::new(child.stdout.take().ok_or("no output")?)
        .lines()
        .map_while(Result::ok)
    {
        if !line.trim().is_empty() {
            say(line.clone());
            lines.push(line);
        }
    }
    let status = child.wait().map_err(|error| error.to_string())?;
    let _ = listening.join();
    let errors = said.lock().map(|said| said.clone()).unwrap_or_default();
    match status.code() {
        Some(0 | 1) => {
            // How a fit ended, before what the data excite.
            let verdict = lines.iter().find(|line| line.contains("converged"));
            let told = verdict.or(lines.first()).cloned();
            Ok(told.unwrap_or_else(|| "done".to_owned()))
        }
        _ => {
            terminal::tell(&errors);
            Err(errors.lines().next().unwrap_or("it failed").to_owned())
        }
    }
}
