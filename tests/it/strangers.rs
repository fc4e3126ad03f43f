//! FMUs that crash, exit, hang or change what is not theirs: how each command ends, and what it says. The table is
//! strangers.txt, the FMU foreign/hostile.c.

use crate::command::{Folder, example, waiting};
use crate::foreign;
use rayon::prelude::*;
use std::io::Read;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// A folder with `a.fmu` that does that.
fn folder(act: &str) -> Folder {
    let folder = Folder::new();
    folder.write("a.fmu", foreign::hostile(act));
    folder
}

/// A command by its name in the table.
fn arguments(command: &str) -> &'static [&'static str] {
    match command {
        "cosim" => &[
            "cosim",
            "a.fmu",
            "--stop-time",
            "0.5",
            "--step",
            "0.1",
            "-o",
            "r.csv",
        ],
        "allowed" => &[
            "cosim",
            "a.fmu",
            "--allow-nan",
            "--stop-time",
            "0.5",
            "--step",
            "0.1",
            "-o",
            "r.csv",
        ],
        "isolated" => &[
            "cosim",
            "a.fmu",
            "--isolate",
            "all",
            "--memory-limit",
            "200",
            "--stop-time",
            "0.5",
            "--step",
            "0.1",
            "-o",
            "r.csv",
        ],
        "isolhang" => &[
            "cosim",
            "a.fmu",
            "--isolate",
            "all",
            "--step-limit",
            "0.5",
            "--stop-time",
            "0.5",
            "--step",
            "0.1",
            "-o",
            "r.csv",
        ],
        "isolfed" => &[
            "cosim",
            "a=a.fmu",
            "b=a.fmu",
            "--connect",
            "b.x=a.u",
            "--isolate",
            "a",
            "--stop-time",
            "0.5",
            "--step",
            "0.1",
            "-o",
            "r.csv",
        ],
        "isolin" => &[
            "linearize",
            "a.fmu",
            "--isolate",
            "a",
            "--at",
            "0.5",
            "--step",
            "0.1",
        ],
        "isolinhang" => &[
            "linearize",
            "a.fmu",
            "--isolate",
            "a",
            "--step-limit",
            "0.5",
            "--at",
            "0.5",
            "--step",
            "0.1",
        ],
        "linearize" => &["linearize", "a.fmu", "--at", "0.5", "--step", "0.1"],
        "validate" => &["validate", "a.fmu"],
        "hurried" => &["validate", "a.fmu", "--time-limit", "0.5"],
        other => panic!("no command {other}"),
    }
}

/// Every row of the table: `act@place command => exit code: words, words`. The exit code, all words and an empty
/// temporary folder.
#[test]
fn endings() {
    let rows: Vec<&str> = (include_str!("strangers.txt").lines())
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .collect();
    let wrong: Vec<String> = waiting(|| rows.par_iter().filter_map(|row| misses(row)).collect());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(rows.len() >= 60, "{} rows", rows.len());
}

/// What an FMU does to the process that is not its own changes no byte of the result, nor who may read it.
#[test]
fn results_are_those_of_one_that_does_no_harm() {
    use std::os::unix::fs::PermissionsExt;
    let result = |act: &str| {
        let folder = folder(act);
        let ended = folder.pilotage(arguments("cosim"));
        assert_eq!(ended.code, 0, "{act}: {}", ended.stderr);
        let mode = std::fs::metadata(folder.path("r.csv")).unwrap();
        (folder.read("r.csv"), mode.permissions().mode())
    };
    let good = result("good@nowhere");
    for act in [
        "close@fmi2DoStep",
        "steal@fmi2DoStep",
        "forkboth@fmi2DoStep",
        "umask@fmi2Instantiate",
        "umask@constructor",
        "chdir@fmi2DoStep",
        "rounding@fmi2DoStep",
        "locale@constructor",
        "handlers@constructor",
        "closeout@fmi2DoStep",
    ] {
        assert_eq!(result(act), good, "{act}");
    }
}

/// Whoever presses Ctrl-C for the third time gets out, whatever the FMU does with signals.
#[test]
fn the_third_interrupt_kills() {
    let folder = folder("deaf@fmi2DoStep");
    let temporary = tempfile::tempdir().unwrap();
    let variables = [("TMPDIR", temporary.path().to_str().unwrap())];
    let mut child = folder.start(arguments("cosim"), &variables);
    let id = child.id().to_string();
    // Until it is in the call from which it does not come back.
    while !folder.files().iter().any(|name| name == "r.csv.part") {
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(300));
    for _ in 0..3 {
        assert!(child.try_wait().unwrap().is_none());
        let sent = Command::new("kill").args(["-INT", &id]).output().unwrap();
        assert!(sent.status.success());
        std::thread::sleep(Duration::from_millis(300));
    }
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(1));
    assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0);
}

/// The second one ends what hangs: who did not come back is told, and where the rows are, isolated or not.
#[test]
fn the_second_interrupt_tells_who_hangs() {
    for more in [&[][..], &["--isolate", "all"]] {
        let folder = folder("hang@fmi2DoStep");
        let arguments = [arguments("cosim"), more].concat();
        let mut child = folder.start(&arguments, &[]);
        let id = child.id().to_string();
        while !folder.files().iter().any(|name| name == "r.csv.part") {
            std::thread::sleep(Duration::from_millis(10));
        }
        for _ in 0..2 {
            std::thread::sleep(Duration::from_millis(400));
            let sent = Command::new("kill").args(["-INT", &id]).output().unwrap();
            assert!(sent.status.success());
        }
        let mut stderr = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut stderr)
            .unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{stderr}");
        assert!(
            stderr.contains("at 0.2 s, had not come back when Ctrl-C ended it"),
            "{stderr}"
        );
        assert!(
            stderr.contains("hint: the rows until then are in r.csv.part"),
            "{stderr}"
        );
        assert_eq!(folder.read("r.csv.part").lines().count(), 4);
    }
}

/// After 10 s it is told who does not come back, in which call and when; then the run is as it was.
#[test]
fn who_does_not_come_back_is_told_in_time() {
    let folder = folder("hang@fmi2DoStep");
    let begun = std::time::Instant::now();
    let mut child = folder.start(arguments("cosim"), &[]);
    let mut stderr = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    waiting(|| std::io::BufRead::read_line(&mut stderr, &mut line)).unwrap();
    assert_eq!(
        line,
        "warning: `a` of a.fmu, in fmi2DoStep at 0.2 s, has not come back for 10 s\n"
    );
    assert!(begun.elapsed() >= Duration::from_secs(10));
    assert!(child.try_wait().unwrap().is_none());
    child.kill().unwrap();
    child.wait().unwrap();
}

/// What is not as a row says.
fn misses(row: &str) -> Option<String> {
    let (what, expected) = row.split_once(" => ").unwrap();
    let (act, command) = what.split_once(' ').unwrap();
    let (code, words) = expected.split_once(':').unwrap();
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path().to_str().unwrap().to_owned();
    let folder = folder(act.trim());
    let ended = folder.pilotage_with(arguments(command.trim()), &[("TMPDIR", &path)]);
    let text = format!("{}{}", ended.stdout, ended.stderr);
    let missing: Vec<&str> = (words.split('|').map(str::trim))
        .filter(|word| !word.is_empty() && !text.contains(word))
        .collect();
    let left = std::fs::read_dir(temporary.path()).unwrap().count();
    let is_right = ended.code.to_string() == code.trim() && missing.is_empty() && left == 0;
    (!is_right).then(|| {
        format!(
            "{row}\n  exit code {}, not said: {missing:?}, {left} left in the temporary folder\n  {}\n",
            ended.code,
            text.replace('\n', "\n  ")
        )
    })
}

/// With `--json`, what an FMU prints goes to stderr: stdout is one JSON value, also where the FMU closes it.
#[test]
fn what_an_fmu_prints_is_no_result() {
    for act in ["flood", "closeout"] {
        let folder = folder(&format!("{act}@fmi2Instantiate"));
        for command in ["cosim", "isolated"] {
            let ended = folder.pilotage(&[arguments(command), &["--json", "--force"]].concat());
            assert!(ended.json().is_object(), "{act}, {command}");
        }
    }
}

/// What is still there of a command that a signal ended at some moment: nothing that is half, nothing in the temporary
/// folder once the next command has begun, and no process. `PILOTAGE_MOMENTS` says at how many moments.
#[test]
fn signals_leave_nothing_behind() {
    let moments = std::env::var("PILOTAGE_MOMENTS");
    let moments: u64 = moments.map_or(3, |count| count.parse().unwrap());
    let hang = foreign::hostile("hang@fmi2DoStep");
    let good = foreign::hostile("good@nowhere");
    let trials = example("trials/trials.toml");
    let fit = trials.to_str().unwrap();
    let steps = ["--stop-time", "100000", "--step", "0.1", "-o", "r.csv"];
    let long = [&["cosim", "a.fmu"], &steps[..]].concat();
    let isolated = [&long[..], &["--isolate", "all"]].concat();
    let commands: [(&[&str], &Vec<u8>); 8] = [
        (&long, &good),
        (&isolated, &good),
        (arguments("cosim"), &hang),
        (arguments("isolated"), &hang),
        (&["validate", "a.fmu"], &hang),
        (
            &["fit", fit, "-o", "pilot.toml", "--report", "fit.html"],
            &good,
        ),
        (&["export", "quadcopter"], &good),
        (&["demo", "-o", "out"], &good),
    ];
    let signals = ["TERM", "HUP", "KILL"];
    let all = commands.iter().flat_map(|command| {
        let moments = signals
            .iter()
            .flat_map(move |signal| (0..moments).map(move |k| (signal, k)));
        moments.map(move |(signal, k)| (command, *signal, k))
    });
    // As under `nohup`, whose children ignore it too.
    let all = all.filter(|(_, signal, _)| *signal != "HUP" || !is_hangup_ignored());
    let all: Vec<_> = all.enumerate().collect();
    let wrong = all
        .into_par_iter()
        .filter_map(|(number, ((command, fmu), signal, _))| {
            // Moments from the start of the process to the midst of its work, the same each time.
            let wait = (3 + 37 * number as u64) % 211;
            left_by(command, fmu, signal, wait)
        });
    let wrong: Vec<String> = waiting(|| wrong.collect());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What is wrong after a signal that a command gets so many milliseconds after its start.
fn left_by(command: &[&str], fmu: &[u8], signal: &str, wait: u64) -> Option<String> {
    let temporary = tempfile::tempdir().unwrap();
    let variables = [("TMPDIR", temporary.path().to_str().unwrap())];
    let folder = Folder::new();
    folder.write("a.fmu", fmu);
    let mut child = folder.start(command, &variables);
    std::thread::sleep(Duration::from_millis(wait));
    let id = child.id().to_string();
    let name = format!("-{signal}");
    let killed = Command::new("kill").args([&name, &id]).output().unwrap();
    let status = child.wait().unwrap();
    // A process that was watched notices within a moment that it is alone.
    std::thread::sleep(Duration::from_millis(300));
    let left = |folder: &Path| -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect()
    };
    if signal == "KILL" {
        // Whoever is next clears it up.
        let next = ["validate", "a.fmu", "--time-limit", "0.01"];
        folder.pilotage_with(&next, &variables);
    }
    let kept = left(temporary.path());
    let inside: Vec<_> = kept
        .iter()
        .map(|name| left(&temporary.path().join(name)))
        .collect();
    let outputs = [
        "a.fmu",
        "r.csv",
        "r.csv.part",
        "pilot.toml",
        "fit.html",
        "quadcopter.fmu",
        "out",
    ];
    let files = folder.files();
    let is_strange = |name: &&String| {
        let is_hidden = signal == "KILL" && name.starts_with(".pilotage-");
        !outputs.contains(&name.as_str()) && !is_hidden
    };
    let strange: Vec<&String> = files.iter().filter(is_strange).collect();
    // An FMU is there as a whole or not at all.
    let is_half = files
        .iter()
        .any(|name| name == "quadcopter.fmu" && folder.pilotage(&["info", name]).code != 0);
    let is_good = kept.is_empty() && strange.is_empty() && !is_half;
    (!is_good).then(|| {
        format!(
            "{command:?}, SIG{signal} after {wait} ms: {status}, {killed:?}: in the temporary folder {kept:?} \
             {inside:?}, beside {strange:?}, half an FMU: {is_half}"
        )
    })
}

/// Whether this process ignores SIGHUP, the first bit of the mask.
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    u64::from_str_radix(mask.unwrap().trim(), 16).unwrap() & 1 != 0
}
