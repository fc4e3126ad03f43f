//! What commands must not overwrite, and that they read what they write.

use crate::command::{Ended, Folder, example};
use crate::foreign;
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::process::Command;

/// A folder with one of each: two flights and a manifest, a pilot, a vehicle, FMUs, a table.
fn folder() -> Folder {
    let folder = Folder::new();
    let flight = std::fs::read(example("trials/10m-run1.csv")).unwrap();
    folder.write("run1.csv", &flight);
    folder.write("run2.csv", [&flight[..], b"# again\n"].concat());
    folder.write("set/run3.csv", [&flight[..], b"# and again\n"].concat());
    folder.write("set/all.toml", "[[run]]\nfile = \"run3.csv\"\n");
    folder.write("vehicle.toml", folder.pilotage(&["vehicle", "show"]).stdout);
    folder.write(
        "pilot.toml",
        "# by hand\n[theta]\ntheta1 = 1.0\ntheta2 = 2.0\n",
    );
    folder.write("good.fmu", foreign::fmu("good"));
    folder.write("other.fmu", foreign::fmu("good"));
    folder.write("course.csv", "time [s],good.u [m]\n0,1\n1,2\n");
    folder.write("old.csv.part", "time [s],good.u [m]\n0,1\n1,2\n");
    folder.write("values.toml", "[good]\nk = 2\n");
    folder.write(
        "drive.csv",
        "time,wheel,position\n0,0,0\n1,0.1,0.2\n2,0,0.3\n",
    );
    for name in ["models/car.toml", "models/tyre.csv"] {
        folder.write(
            name.trim_start_matches("models/"),
            std::fs::read(example(name)).unwrap(),
        );
    }
    for name in ["pelts.csv", "predator_prey.toml", "problem.toml"] {
        folder.write(
            name,
            std::fs::read(example(&format!("problems/hare_lynx/{name}"))).unwrap(),
        );
    }
    symlink("run2.csv", folder.path("link.csv")).unwrap();
    symlink("set", folder.path("sets")).unwrap();
    std::fs::hard_link(folder.path("run2.csv"), folder.path("hard.csv")).unwrap();
    folder
}

/// Every file's content, by name.
fn contents(folder: &Folder) -> Vec<(String, Vec<u8>)> {
    let names = folder.files().into_iter();
    let names = names.chain(["set/run3.csv", "set/all.toml"].map(str::to_owned));
    names
        .filter(|name| folder.path(name).is_file())
        .map(|name| (name.clone(), std::fs::read(folder.path(&name)).unwrap()))
        .collect()
}

fn run(folder: &Folder, command: &str) -> Ended {
    folder.pilotage(&command.split(' ').collect::<Vec<_>>())
}

const INPUT: &str = "would be overwritten\nhint: give the output another name\n";
const TWICE: &str = "hint: give each output a name of its own\n";
const FOREIGN: &str = "hint: give the output another name, or overwrite that file with --force\n";

#[test]
fn no_command_destroys_what_it_reads() {
    let folder = folder();
    let before = contents(&folder);
    let simulate = "--stop-time 1 --step 0.5";
    let cases = [
        (
            "fit run1.csv run2.csv -o run2.csv",
            format!("run2.csv is an input of this command, and {INPUT}"),
        ),
        (
            "fit run1.csv run2.csv -o link.csv",
            format!("link.csv is an input of this command (as run2.csv), and {INPUT}"),
        ),
        (
            "fit run1.csv run2.csv -o new.toml --report hard.csv",
            format!("hard.csv is an input of this command (as run2.csv), and {INPUT}"),
        ),
        (
            "fit run1.csv link.csv -o new.toml --log run2.csv",
            format!("run2.csv is an input of this command (as link.csv), and {INPUT}"),
        ),
        (
            "fit set/all.toml -o sets/run3.csv",
            format!("sets/run3.csv is an input of this command (as set/run3.csv), and {INPUT}"),
        ),
        (
            "fit set/all.toml -o set/all.toml",
            format!("set/all.toml is an input of this command, and {INPUT}"),
        ),
        (
            "fit run1.csv --vehicle vehicle.toml -o ./vehicle.toml",
            format!("./vehicle.toml is an input of this command (as vehicle.toml), and {INPUT}"),
        ),
        (
            "fit run1.csv -o x --report ./x",
            format!("two outputs go to ./x (as x)\n{TWICE}"),
        ),
        (
            "fit run1.csv -o set/x --log sets/x",
            format!("two outputs go to sets/x (as set/x)\n{TWICE}"),
        ),
        (
            "export pilot pilot.toml -o pilot.toml",
            format!("pilot.toml is an input of this command, and {INPUT}"),
        ),
        (
            "export quadcopter vehicle.toml -o vehicle.toml",
            format!("vehicle.toml is an input of this command, and {INPUT}"),
        ),
        (
            "export pilot pilot.toml --binary win64=good.fmu -o good.fmu",
            format!("good.fmu is an input of this command, and {INPUT}"),
        ),
        (
            "pack good.fmu -o good.fmu",
            format!("good.fmu is an input of this command, and {INPUT}"),
        ),
        (
            &format!("cosim good.fmu {simulate} -o good.fmu"),
            format!("good.fmu is an input of this command, and {INPUT}"),
        ),
        (
            &format!("cosim good.fmu --input course.csv {simulate} -o course.csv"),
            format!("course.csv is an input of this command, and {INPUT}"),
        ),
        (
            &format!("cosim good.fmu --input old.csv.part {simulate} -o old.csv"),
            "old.csv is written into old.csv.part until it is complete, and that is an input of this command\n\
             hint: give the output another name\n"
                .to_owned(),
        ),
        (
            &format!("cosim good.fmu --report old.csv.part {simulate} -o old.csv"),
            "old.csv is written into old.csv.part until it is complete, and that is another output of this \
             command\nhint: give the output another name\n"
                .to_owned(),
        ),
        (
            &format!("cosim good.fmu --parameters values.toml {simulate} -o set/../values.toml"),
            format!("set/../values.toml is an input of this command (as values.toml), and {INPUT}"),
        ),
        // What an input names is an input too.
        (
            "model step car.toml --csv tyre.csv",
            format!("tyre.csv is an input of this command, and {INPUT}"),
        ),
        (
            "cosim car.toml --stop-time 1 --step 0.5 -o tyre.csv",
            format!("tyre.csv is an input of this command, and {INPUT}"),
        ),
        (
            "export car.toml -o tyre.csv",
            format!("tyre.csv is an input of this command, and {INPUT}"),
        ),
        (
            "plot problem.toml --figure data -o pelts.csv",
            format!("pelts.csv is an input of this command, and {INPUT}"),
        ),
        (
            "fit problem.toml --report predator_prey.toml",
            format!("predator_prey.toml is an input of this command, and {INPUT}"),
        ),
        (
            "init drive.csv --model car.toml -o car.toml",
            format!("car.toml is an input of this command, and {INPUT}"),
        ),
        (
            "linearize good.fmu --csv good.fmu",
            format!("good.fmu is an input of this command, and {INPUT}"),
        ),
        (
            "linearize good.fmu --csv a --matlab a",
            format!("two outputs go to a\n{TWICE}"),
        ),
    ];
    for (command, message) in &cases {
        for force in [false, true] {
            let command = format!("{command}{}", if force { " --force" } else { "" });
            let ended = run(&folder, &command);
            assert_eq!(
                (ended.code, ended.stderr),
                (2, format!("error: {message}")),
                "{command}"
            );
            assert!(contents(&folder) == before, "{command}");
        }
    }
    folder.write("trials/10m-run1.csv", &before[0].1);
    std::fs::copy(
        folder.path("vehicle.toml"),
        folder.path("trials/trials.toml"),
    )
    .unwrap();
    let ended = run(&folder, "trials synth --vehicle trials/trials.toml --force");
    let message = format!("error: trials/trials.toml is an input of this command, and {INPUT}");
    assert_eq!((ended.code, ended.stderr), (2, message));
    assert_eq!(
        folder.read("trials/trials.toml"),
        folder.read("vehicle.toml")
    );
}

#[test]
fn what_somebody_else_made_is_overwritten_by_force_alone() {
    let folder = folder();
    let before = contents(&folder);
    let simulate = "--stop-time 1 --step 0.5";
    let cases = [
        ("fit run1.csv -o run2.csv", "run2.csv", "a fitted model"),
        ("fit run1.csv -o pilot.toml", "pilot.toml", "a fitted model"),
        (
            "fit run1.csv -o new.toml --report run2.csv",
            "run2.csv",
            "a report",
        ),
        (
            "fit run1.csv -o new.toml --log run2.csv",
            "run2.csv",
            "a log",
        ),
        (
            "export pilot --preset paper -o other.fmu",
            "other.fmu",
            "an FMU",
        ),
        (
            "export quadcopter -o vehicle.toml",
            "vehicle.toml",
            "an FMU",
        ),
        (
            &format!("cosim good.fmu {simulate} -o other.fmu"),
            "other.fmu",
            "a result",
        ),
        (
            &format!("cosim good.fmu {simulate} -o link.csv"),
            "link.csv",
            "a result",
        ),
        (
            &format!("cosim good.fmu {simulate} -o course.csv"),
            "course.csv",
            "a result",
        ),
        (
            "linearize good.fmu --matlab run1.csv",
            "run1.csv",
            "a script",
        ),
        (
            "linearize good.fmu --csv run1.csv",
            "run1.csv",
            "a table of matrices",
        ),
    ];
    for (command, file, what) in cases {
        let ended = run(&folder, command);
        let message = format!("error: {file} exists and is not {what} of pilotage\n{FOREIGN}");
        assert_eq!((ended.code, ended.stderr), (2, message), "{command}");
        assert!(contents(&folder) == before, "{command}");
    }
    for command in [
        "export pilot --preset paper -o other.fmu --force",
        &format!("cosim good.fmu {simulate} -o link.csv --force"),
    ] {
        let ended = run(&folder, command);
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{command}");
    }
    // The link leads to the result; the flight is still there under its other name.
    assert!(folder.path("link.csv").is_symlink());
    assert!(folder.read("run2.csv").starts_with("time,good.y"));
    assert!(folder.read("hard.csv").contains("time [s],target"));
}

#[test]
fn a_command_replaces_what_it_wrote_before() {
    let folder = folder();
    folder.write("empty.csv", "");
    let fit = "fit run1.csv --scheme euler --max-iterations 1 --random-starts 0";
    let loops = "--connect a.stick=q.stick --connect q.z=a.position --loop a.stick=q.stick";
    for (command, code) in [
        (format!("{fit} -o p.toml --report p.html --log p.jsonl"), 1),
        ("export pilot --preset paper -o a.fmu".into(), 0),
        ("cosim good.fmu --stop-time 1 --step 0.5 -o r.csv".into(), 0),
        (
            "cosim good.fmu --stop-time 1 --step 0.5 -o empty.csv".into(),
            0,
        ),
        ("export quadcopter vehicle.toml -o q.fmu".into(), 0),
        (
            format!("linearize a.fmu q.fmu {loops} --csv l.csv --matlab l.m --report l.html"),
            // The published pilot does not fly this vehicle.
            1,
        ),
    ] {
        for time in ["first", "second"] {
            let ended = run(&folder, &command);
            assert_eq!(
                (ended.code, ended.stderr.as_str()),
                (code, ""),
                "{time}: {command}"
            );
        }
    }
}

/// The process that holds the lock here is this test.
#[test]
fn who_else_is_writing_an_output_is_named() {
    let folder = folder();
    let simulate = "cosim good.fmu --stop-time 1 --step 0.5 -o r.csv";
    for (command, locked, hint) in [
        (
            simulate,
            "r.csv.part",
            "wait for it, or give this run another --output",
        ),
        (
            "fit run1.csv --scheme euler --max-iterations 1 --random-starts 0 -o p.toml --log l.jsonl",
            "l.jsonl",
            "wait for it, or give --log another file",
        ),
    ] {
        let file = File::create(folder.path(locked)).unwrap();
        file.lock().unwrap();
        let ended = run(&folder, command);
        let message = format!(
            "error: cannot write {}: process {} is writing it\nhint: {hint}\n",
            locked.trim_end_matches(".part"),
            std::process::id()
        );
        assert_eq!((ended.code, ended.stderr), (2, message), "{command}");
    }
    // Nobody writes it any more, and nothing was in it.
    let ended = run(&folder, simulate);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert!(
        !folder
            .files()
            .iter()
            .any(|name| name.contains("interrupted"))
    );
}

/// Where a command looks at what an input or an earlier output is, a pipe is left as it is: it can be read once.
#[test]
fn a_pipe_is_not_read_to_look_at_it() {
    let folder = folder();
    let text = std::fs::read(example("models/car.toml")).unwrap();
    let path = folder.path("pipe.toml");
    let made = Command::new("mkfifo").arg(&path).status();
    assert!(made.unwrap().success());
    std::thread::scope(|scope| {
        scope.spawn(|| std::fs::write(&path, &text).unwrap());
        let ended = run(&folder, "model check pipe.toml");
        assert_eq!(ended.code, 0, "{ended:?}");
    });
}

/// Sparse files: they take no room, and nothing of them is read.
#[test]
fn no_file_is_read_without_end() {
    let folder = folder();
    let long = |name: &str| {
        let file = File::create(folder.path(name)).unwrap();
        file.set_len((1 << 30) + 1).unwrap();
    };
    for name in ["long.csv", "long.toml", "tyre.csv"] {
        long(name);
    }
    for (command, file) in [
        ("trials check long.csv", "long.csv"),
        ("trials check long.toml", "long.toml"),
        ("fit long.csv -o new.toml", "long.csv"),
        ("fit run1.csv --vehicle long.toml -o new.toml", "long.toml"),
        ("vehicle check long.toml", "long.toml"),
        ("model check car.toml", "tyre.csv"),
        (
            "cosim good.fmu --input long.csv --stop-time 1 --step 0.5",
            "long.csv",
        ),
        (
            "cosim good.fmu --parameters long.toml --stop-time 1 --step 0.5",
            "long.toml",
        ),
        ("plot long.csv -o new.svg", "long.csv"),
        (
            "export pilot pilot.toml --binary win64=long.csv -o new.fmu",
            "long.csv",
        ),
    ] {
        let ended = run(&folder, command);
        assert_eq!(ended.code, 2, "{command}: {ended:?}");
        let is_said = ended.stderr.contains(file)
            && ended
                .stderr
                .contains("more than 1 GiB, the most that is read of one file");
        assert!(is_said, "{command}: {ended:?}");
    }
}

/// Pipes, and a link such as `/dev/stdout`. Those of the system are left alone: a failure might replace them.
#[test]
fn pipes_are_written_straight() {
    let folder = folder();
    let path = folder.path("pipe");
    let made = Command::new("mkfifo").arg(&path).status();
    assert!(made.unwrap().success());
    // Open for both, so that neither side waits for the other.
    let mut both = File::options().read(true).write(true).open(&path).unwrap();
    for (command, code, begin) in [
        (
            "cosim good.fmu --stop-time 1 --step 0.5 -o pipe",
            0,
            "time,good.y [m],",
        ),
        (
            "fit run1.csv --scheme euler --max-iterations 1 --random-starts 0 -o pipe",
            1,
            "# Fitted by pilotage from flights: ",
        ),
        (
            "linearize good.fmu --step 0.5 --csv pipe --matlab pipe",
            0,
            "% dx/dt",
        ),
    ] {
        let ended = run(&folder, command);
        assert_eq!((ended.code, ended.stderr.as_str()), (code, ""), "{command}");
        let is_pipe = std::fs::metadata(&path).unwrap().file_type().is_fifo();
        assert!(is_pipe, "{command}");
        let mut bytes = vec![0; 1 << 16];
        let read = both.read(&mut bytes).unwrap();
        assert!(bytes[..read].starts_with(begin.as_bytes()), "{command}");
    }
    symlink("/proc/self/fd/1", folder.path("stdout")).unwrap();
    let result = run(&folder, "cosim good.fmu --stop-time 1 --step 0.5 -o stdout");
    assert_eq!((result.code, result.stderr.as_str()), (0, ""));
    assert!(result.stdout.starts_with("time,good.y [m],"), "{result:?}");
    // Into a file that the shell has opened.
    let file = File::create(folder.path("out.csv")).unwrap();
    let status = Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .args([
            "cosim",
            "good.fmu",
            "--stop-time",
            "1",
            "--step",
            "0.5",
            "-o",
            "stdout",
        ])
        .current_dir(folder.path("."))
        .stdout(file)
        .status();
    assert!(status.unwrap().success());
    assert_eq!(folder.read("out.csv").lines().count(), 4);
}

/// A result feeds the next run in its units, whatever else it holds.
#[test]
fn a_result_is_an_input_with_its_units() {
    let folder = folder();
    let simulate = "--stop-time 1 --step 0.5";
    let run = |command: &str| {
        let ended = run(&folder, command);
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{command}");
        ended.stdout
    };
    run(&format!(
        "cosim good.fmu {simulate} --set good.u=3 --record good.u,good.y -o r.csv"
    ));
    assert!(
        folder
            .read("r.csv")
            .starts_with("time,good.u [m],good.y [m]\n0,3,0\n")
    );
    // In feet, as an FMU of another tool has it.
    let feet = folder.read("r.csv").replace("good.u [m]", "good.u [ft]");
    folder.write("feet.csv", feet);
    for (input, expected) in [("r.csv", "3"), ("feet.csv", "0.9144")] {
        run(&format!(
            "cosim good.fmu {simulate} --input {input} --record good.u -o again.csv"
        ));
        let last = format!("\n1,{expected}\n");
        assert!(
            folder
                .read("again.csv")
                .replace("0.9144000000000001", "0.9144")
                .ends_with(&last),
            "{input}"
        );
    }
    // Without bound: it is written, and read where nobody asks for those columns.
    run(&format!(
        "cosim good.fmu {simulate} --allow-nan --set good.k=-1e308 --set good.u=1 --record good.u,good.y -o wild.csv"
    ));
    let wild = folder.read("wild.csv");
    assert!(wild.contains("inf") || wild.contains("NaN"), "{wild}");
    let output = run(&format!(
        "cosim good.fmu {simulate} --input wild.csv --record good.u -o again.csv"
    ));
    assert!(
        output.contains("note: wild.csv: nothing uses `good.y`\n"),
        "{output}"
    );
    assert!(folder.read("again.csv").ends_with("\n1,1\n"));
    let asked = format!("cosim good.fmu {simulate} --input w=wild.csv --connect w.good.y=good.u");
    let asked = folder.pilotage(&asked.split(' ').collect::<Vec<_>>());
    assert_eq!(asked.code, 2, "{asked:?}");
    let message = "error: wild.csv: column `good.y` is ";
    assert!(asked.stderr.starts_with(message), "{asked:?}");
}
