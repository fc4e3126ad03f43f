//! Commands that call FMUs run in a child process that this one supervises: however an FMU ends it, the end is
//! reported.
//!
//! An FMU that ends the process with `exit(0)` or by a signal, or replaces it by another program, never looks like
//! success: only what the process itself [reports](pilotage_process::finished) counts.

use super::{Failure, call, recognise, terminal};
use crate::file;
use crate::fmi::call_name;
use pilotage_process::{Child, Ended, Going, Page, program};
use pilotage_systems::is_foreign;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// Prefix of the record with the path of the rows.
pub const ROWS: &str = "rows ";

/// Maximum time for freeing FMUs when the work is done.
const AFTERWARDS: Duration = Duration::from_secs(5);

/// Time of a call that is told.
const LATE: Duration = Duration::from_secs(10);

/// Interval between looks at the calls.
const LOOKS: Duration = Duration::from_millis(100);

/// Exit code of a command that an FMU has ended.
const FAILED: u8 = 1;

/// Exit code of a process killed by Ctrl-C, as in shells: 128 + SIGINT.
const KILLED: u8 = 130;

/// Time within which a signal that is sent to both processes reaches both.
#[cfg(unix)]
const MOMENT: Duration = Duration::from_millis(100);

/// Starts this program again with the same arguments, waits for it, and reports how it ended.
pub fn watched() -> Result<u8, Failure> {
    let cannot = |error: std::io::Error| {
        let why = format!("cannot start a process for the FMUs: {error}");
        Failure::new(why).hint("is there room in the temporary folder, and may it be written?")
    };
    let command = program::again().map_err(cannot)?;
    let mut child = Child::start(command, false).map_err(cannot)?;
    // If interrupts cannot be forwarded, the child ends by itself shortly after this process.
    let _ = child.hand_on_interrupts();
    let mut late = Late::default();
    let say_late = |page: &Page| {
        for going in late.look(page, Instant::now()) {
            let who = whose(&[going]).unwrap_or_default();
            let what = format!("{who} has not come back for {} s", LATE.as_secs());
            terminal::say("warning", &what);
            terminal::say(
                "hint",
                "Ctrl-C, pressed twice or three times, ends it; with --isolate a call has a limit, and the rows until then are kept",
            );
        }
    };
    let ended = child.wait(None, AFTERWARDS, say_late).map_err(cannot)?;
    pilotage_process::leftovers::stay_if_ending();
    let going = child.page().going();
    Ok(match ended {
        // Second Ctrl-C.
        Ended::Done {
            code,
            badly: Some(_),
        } if code == KILLED && child.interrupts() > 0 => interrupted(&going, &child),
        Ended::Done { code, badly } => {
            if let Some(status) = badly {
                let how = match status {
                    Some(status) => format!("ended the process ({status})"),
                    None => format!("did not come back within {} s", AFTERWARDS.as_secs()),
                };
                let who = whose(&going).unwrap_or_else(|| "an FMU".to_owned());
                terminal::say(
                    "warning",
                    &format!("{who} {how} when the work was done; nothing is lost"),
                );
            }
            code
        }
        Ended::Early(status) => early(status, &going, &child),
        Ended::Late => FAILED,
    })
}

/// Calls that have not come back for long.
#[derive(Default)]
struct Late {
    /// When a look was due last.
    looked: Option<Instant>,
    /// Names and numbers of the calls in progress, since when, and whether they were told.
    going: Vec<(String, u32, Instant, bool)>,
}

impl Late {
    /// Calls that are to be told now, each once.
    fn look(&mut self, page: &Page, now: Instant) -> Vec<Going> {
        if self.looked.is_some_and(|last| now - last < LOOKS) {
            return Vec::new();
        }
        self.looked = Some(now);
        self.of(page.going(), now)
    }

    fn of(&mut self, going: Vec<Going>, now: Instant) -> Vec<Going> {
        let before = std::mem::take(&mut self.going);
        let mut late = Vec::new();
        for own in going {
            let mut known = before.iter();
            let known = known.find(|(name, count, ..)| (name, *count) == (&own.name, own.count));
            let (since, was_told) = known.map_or((now, false), |own| (own.2, own.3));
            let is_told = now - since >= LATE;
            self.going
                .push((own.name.clone(), own.count, since, is_told));
            if is_told && !was_told {
                late.push(own);
            }
        }
        late
    }
}

/// The child ended before its work was done.
fn early(status: ExitStatus, going: &[Going], child: &Child) -> u8 {
    let who = whose(going);
    #[cfg(unix)]
    if let Some(code) = asked_for(status) {
        // A signal sent to both processes also reaches this one; a signal raised by an FMU reaches only the child.
        std::thread::sleep(MOMENT);
        pilotage_process::leftovers::stay_if_ending();
        if child.interrupts() > 0 && code == KILLED {
            return interrupted(going, child);
        }
    }
    let what = match &who {
        Some(who) if child.interrupts() >= 3 => {
            format!("{who} did not come back, and was killed with its process")
        }
        Some(who) => format!("{who} ended the process ({status})"),
        // A panic has printed its own message.
        None if status.code() == Some(101) => return FAILED,
        None => format!(
            "the process ended before its work was done, and in no call of an FMU ({status}): one of an FMU's threads, or an \
             alarm or a limit that it has set, may have ended it"
        ),
    };
    terminal::say("error", &what);
    say_rows(child);
    FAILED
}

/// Ctrl-C ended the child: reports the call that had not returned, and the path of the rows.
fn interrupted(going: &[Going], child: &Child) -> u8 {
    // The first Ctrl-C only requests a stop.
    let who = whose(going).filter(|_| child.interrupts() > 1);
    if let Some(who) = who {
        let what = format!("{who} had not come back when Ctrl-C ended it");
        terminal::say("error", &what);
    }
    say_rows(child);
    KILLED
}

/// Prints a hint to the rows written by a process that was interrupted, if there are any.
fn say_rows(child: &Child) {
    let (records, _) = child.page().records();
    let rows = records.iter().find_map(|record| record.strip_prefix(ROWS));
    let has_some = |rows: &&Path| {
        rows.metadata()
            .is_ok_and(|metadata| metadata.is_file() && metadata.len() > 0)
    };
    let rows = rows.map(Path::new).filter(has_some);
    if let Some(rows) = rows {
        let hint = format!("the rows until then are in {}", rows.display());
        terminal::say("hint", &hint);
    }
}

/// The pending calls: instance, function and time.
fn whose(going: &[Going]) -> Option<String> {
    let one = |going: &Going| {
        let time = going
            .time
            .map_or_else(String::new, |time| format!(" at {time} s"));
        format!("{}, in {}{time},", going.name, call_name(going.call))
    };
    let all: Vec<String> = going.iter().map(one).collect();
    (!all.is_empty()).then(|| all.join(" or "))
}

/// The exit code, as in shells, of a process ended by the user.
#[cfg(unix)]
fn asked_for(status: ExitStatus) -> Option<u8> {
    use std::os::unix::process::ExitStatusExt;
    const HANGUP: i32 = 1;
    const INTERRUPT: i32 = 2;
    const TERMINATE: i32 = 15;
    let signal = status.signal()?;
    let is_asked = [HANGUP, INTERRUPT, TERMINATE].contains(&signal);
    is_asked.then(|| u8::try_from(128 + signal).unwrap_or(1))
}

/// Maximum number of files between an argument and an FMU.
const DEEP: usize = 4;

/// Whether an argument is a system file that refers to an FMU.
pub fn systems_name_fmus() -> bool {
    let mut arguments = call::arguments().into_iter().skip(2);
    arguments.any(|path| {
        let path = Path::new(&path);
        recognise::may_be_system(path) && names_fmu(path, DEEP)
    })
}

/// Whether an argument is an FMU, or a file that refers to one.
pub fn arguments_name_fmus() -> bool {
    call::arguments().into_iter().skip(2).any(|argument| {
        // Arguments of the form `--vehicle=path` and `name=path`.
        let text = argument.to_string_lossy().into_owned();
        let value = text
            .rsplit_once('=')
            .map(|(_, value)| OsString::from(value));
        [Some(argument), value]
            .into_iter()
            .flatten()
            .any(|path| names_fmu(Path::new(&path), DEEP))
    })
}

fn names_fmu(path: &Path, deep: usize) -> bool {
    let is = |ending: &str| {
        path.extension()
            .is_some_and(|own| own.eq_ignore_ascii_case(ending))
    };
    if is("fmu")
        || is("ssp")
        || is("ssd")
        || path.join("modelDescription.xml").is_file()
        || is_foreign(path)
    {
        return true;
    }
    if deep == 0 || !is("toml") {
        return false;
    }
    let Ok(text) = file::peek(path) else {
        return false;
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = text.split(['"', '\'']).skip(1).step_by(2);
    let named = named.filter(|name| !name.is_empty() && !name.contains('\n'));
    let paths: Vec<PathBuf> = named.map(|name| folder.join(name)).collect();
    paths
        .iter()
        .any(|named| named != path && names_fmu(named, deep - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_call_is_told_once_and_many_short_ones_are_not() {
        let going = |count: u32| {
            let (name, time) = ("`a`".to_owned(), Some(1.0));
            vec![Going {
                name,
                call: 1,
                count,
                time,
            }]
        };
        let (mut late, begin) = (Late::default(), Instant::now());
        let mut told = |count: u32, seconds: f64| {
            let now = begin + Duration::from_secs_f64(seconds);
            late.of(going(count), now).len()
        };
        // Each of these came back between two looks.
        assert_eq!((0..30).map(|k| told(k, f64::from(k))).sum::<usize>(), 0);
        let found: Vec<usize> = (30..60).map(|k| told(99, f64::from(k))).collect();
        let expected: Vec<usize> = (30..60).map(|k| usize::from(k == 40)).collect();
        assert_eq!(found, expected);
        // The next call.
        assert_eq!(
            [told(100, 60.0), told(100, 69.9), told(100, 70.0)],
            [0, 0, 1]
        );
    }
}
