//! `pilotage cosim`: inputs from tables, values from files, the choice of what is recorded, and results
//! that survive.

use crate::command::{CONNECTIONS, Ended, Folder};
use crate::foreign;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A folder with foreign FMUs of these behaviours, named after them up to `@`; they solve
/// `ẏ = k (u - y)` exactly, with `u` held.
pub fn folder(behaviours: &[&str]) -> Folder {
    let folder = Folder::new();
    for behaviour in behaviours {
        let name = behaviour.split('@').next().unwrap();
        folder.write(&format!("{name}.fmu"), foreign::fmu(behaviour));
    }
    folder
}

/// A run to 2 s in steps of 0.5 s.
pub fn short_run(folder: &Folder, more: &[&str]) -> Ended {
    let fixed = ["cosim", "good.fmu", "--stop-time", "2", "--step", "0.5"];
    folder.pilotage(&[&fixed, more].concat())
}

/// The rows of a result, as numbers.
fn rows(folder: &Folder, name: &str) -> Vec<Vec<f64>> {
    let text = folder.read(name);
    let cells = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    text.lines().skip(1).map(cells).collect()
}

#[test]
fn a_table_feeds_inputs_of_every_type_in_their_units() {
    let folder = folder(&["good"]);
    folder.write(
        "flight.csv",
        "time [ms],good.u [ft],good.n_in,good.flag_in,remark\n\
         0,0,3,0,7\n\
         1000,10,4,1,7\n\
         1000,100,4,1,7\n\
         1500,,5,,7\n",
    );
    let ended = short_run(&folder, &["--input", "flight.csv"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    // What follows tells times.
    let (summary, report) = ended.stdout.split_once("4 communication").unwrap();
    let steps = " steps taken, 0 rejected, in ";
    assert!(report.starts_with(steps), "{report}");
    for line in [
        "  good: 4 steps, ",
        "  flight.good.u -> good.u: held, 0.250000 s late, off by ",
    ] {
        assert!(report.contains(line), "{report}");
    }
    assert_eq!(
        summary,
        "4 steps of 0.5 s from 0 s to 2 s (jacobi)\n\
         5 rows of 9 signals in result.csv\n\
         note: `flight.good.u` [ft] is converted for `good.u` [m]\n\
         note: flight.csv: nothing uses `remark`\n\
         note: flight.csv ends at 1.5 s; from then on its last values are held\n\
         note: nothing feeds `good.text_in`; it keeps its start value\n\
         note: `good.text` is text and not in the table\n"
    );
    let header = "time,good.u [m],good.y [m],good.tolerance,good.start,good.stop,good.n_in,good.n,good.flag_in,good.flag";
    assert_eq!(folder.read("result.csv").lines().next().unwrap(), header);
    let rows = rows(&folder, "result.csv");
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<_>>();
    let u = [0.0, 5.0, 100.0, 100.0, 100.0].map(|feet| feet * 0.3048);
    for (found, expected) in column(1).iter().zip(u) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    assert_eq!(column(6), [3.0, 3.0, 4.0, 5.0, 5.0]);
    assert_eq!(column(8), [0.0, 0.0, 1.0, 1.0, 1.0]);
    // The FMU holds what it gets at the begin of each step; k = 1/s.
    let mut y = 0.0;
    for (k, found) in column(2).into_iter().enumerate() {
        assert!((found - y).abs() < 1e-12, "{k}: {found} {y}");
        y = u[k] + (y - u[k]) * (-0.5f64).exp();
    }
}

/// A real that the description calls discrete jumps at samples, and nowhere else.
#[test]
fn a_discrete_real_is_held_between_samples() {
    let continuous = "valueReference=\"0\" causality=\"input\"><Real";
    assert!(foreign::DESCRIPTION.contains(continuous));
    let discrete = continuous.replace("><Real", " variability=\"discrete\"><Real");
    let description = foreign::DESCRIPTION.replace(continuous, &discrete);
    let folder = Folder::new();
    folder.write("good.fmu", foreign::fmu_of(&description, foreign::binary()));
    folder.write("t.csv", "time,good.u\n0,1\n2,3\n");
    let ended = short_run(&folder, &["--input", "t.csv", "--record", "good.u"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let u: Vec<f64> = rows(&folder, "result.csv")
        .iter()
        .map(|row| row[1])
        .collect();
    assert_eq!(u, [1.0, 1.0, 1.0, 1.0, 3.0]);
}

#[test]
fn a_column_of_any_name_is_wired_and_the_table_has_a_name_too() {
    let folder = folder(&["good"]);
    folder.write("good.csv", "time,height [m],good.y\n0,1,5\n2,1,5\n");
    let wired = [
        "--input",
        "given=good.csv",
        "--connect",
        "given.height=good.u",
    ];
    let ended = short_run(
        &folder,
        &[&wired[..], &["--record", "good.u,good.y"]].concat(),
    );
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert!(
        ended
            .stdout
            .contains("note: good.csv: nothing uses `good.y`\n")
    );
    let last = rows(&folder, "result.csv").pop().unwrap();
    assert_eq!(last[..2], [2.0, 1.0]);
    assert!(
        (last[2] - (1.0 - (-2.0f64).exp())).abs() < 1e-12,
        "{last:?}"
    );
}

#[test]
fn tables_that_do_not_fit() {
    let folder = folder(&["good"]);
    for (table, more, message) in [
        (
            "time,good.uu\n0,1\n",
            vec![],
            "t.csv: `good.uu`: `good` has no variable `uu`",
        ),
        (
            "time,good.flag_in\n0,2\n",
            vec![],
            "t.csv: column `good.flag_in` is 2 at 0 s, which is no Boolean",
        ),
        (
            "time,good.text_in\n0,2\n",
            vec![],
            "t.csv: column `good.text_in` holds numbers and cannot feed a String",
        ),
        (
            "time,a\n0,2\n",
            vec![],
            "t.csv: no column is named like an input",
        ),
        (
            "time,good.u\n1,2\n0,2\n",
            vec![],
            "t.csv:3: time 0 s does not come after 1 s",
        ),
        (
            "time,good.u\n1,\n2,\n",
            vec![],
            "t.csv: column `good.u` has no samples",
        ),
        (
            "time,good.u [s]\n0,1\n",
            vec![],
            "`t.good.u` is in s and `good.u` is in m: one cannot be converted into the other",
        ),
        (
            "time,good.u\n0,1\n",
            vec!["--set", "good.u=1"],
            "`good.u` is fed by `t.good.u`, so that its value cannot be set",
        ),
        (
            "time,good.u\n0,1\n",
            vec!["--input", "good=t.csv"],
            "two instances are named `good`; give one another name",
        ),
    ] {
        folder.write("t.csv", table);
        let ended = short_run(&folder, &[&["--input", "t.csv"], &more[..]].concat());
        assert_eq!(ended.code, 2, "{table}");
        let error = ended.stderr.strip_prefix("error: ").unwrap();
        assert!(error.starts_with(message), "{error}");
    }
    assert_eq!(folder.files(), ["good.fmu", "t.csv"]);
}

#[test]
fn values_come_from_files_and_the_command_line_comes_first() {
    let folder = folder(&["good"]);
    folder.write(
        "a.toml",
        "\"good.u\" = 4\n[good]\nk = 0.5\ntext_in = \"a\"\nflag_in = true\n",
    );
    folder.write("b.csv", "# by hand\nname,value,unit\ngood.n_in,3,\n");
    folder.write("c.csv", "name,value,unit\ngood.u,100,ft\n");
    let record = ["--record", "good.u,good.k,good.n_in,good.flag_in"];
    let files = [
        "--parameters",
        "a.toml",
        "--parameters",
        "b.csv",
        "--set",
        "good.k=2",
    ];
    let ended = short_run(&folder, &[&record[..], &files].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    assert_eq!(rows(&folder, "result.csv")[4], [2.0, 4.0, 2.0, 3.0, 1.0]);
    let ended = short_run(&folder, &["--record", "good.u", "--parameters", "c.csv"]);
    assert_eq!(ended.code, 0);
    assert!((rows(&folder, "result.csv")[4][1] - 30.48).abs() < 1e-12);
}

#[test]
fn files_of_values_that_are_wrong_name_the_line() {
    let folder = folder(&["good"]);
    for (file, text, message) in [
        (
            "v.toml",
            "[good]\nk = 1\nuu = 2\n",
            "v.toml:3: `good.uu`: `good` has no variable `uu`",
        ),
        (
            "v.toml",
            "[good]\nn_in = 1.5\n",
            "v.toml:2: `good.n_in` is of type Integer, `1.5` is not",
        ),
        (
            "v.toml",
            "[good]\ny = 1\n\"k\" = 1\nk = 2\n",
            "v.toml:4:1: not TOML: `k` stands twice",
        ),
        (
            "v.toml",
            "good.y = [1]\n",
            "v.toml:1:10: `y` is an array; expected a number, true, false or a string",
        ),
        (
            "v.csv",
            "name,value\n\ngood.k,1\ngood.k,1\n",
            "v.csv:4: `good.k` is set twice",
        ),
        (
            "v.csv",
            "\u{feff}name,value\r\n# of the type plate\r\n\r\ngood.uu,1\r\n",
            "v.csv:4: `good.uu`: `good` has no variable `uu`",
        ),
        (
            "v.csv",
            "name|value\n",
            "v.csv:1: the header is `name|value`; expected `name,value` or `name,value,unit`",
        ),
        (
            "v.csv",
            "name,value,unit\ngood.u,1,s\n",
            "v.csv:2: `good.u` is in m: s cannot be converted into it",
        ),
        (
            "v.csv",
            "name,value,unit\ngood.u,a,ft\n",
            "v.csv:2: `good.u` is `a`; expected a number",
        ),
        (
            "v.csv",
            "name,value\ngood.u\n",
            "v.csv:2: 1 cells; expected 2, as in the header",
        ),
        ("none.toml", "", "cannot read none.csv: No such file"),
    ] {
        folder.write(file, text);
        let asked = file.replace("none.toml", "none.csv");
        let ended = short_run(&folder, &["--parameters", &asked]);
        assert_eq!(ended.code, 2, "{text}");
        let error = ended.stderr.strip_prefix("error: ").unwrap();
        assert!(error.starts_with(message), "{error}");
    }
}

#[test]
fn signals_and_rows_are_chosen() {
    let folder = folder(&["good"]);
    let chosen = ["--record", "good.k,*.y,good.?", "--record-every", "1"];
    let ended = short_run(
        &folder,
        &[&chosen[..], &["--set", "good.u=1", "--json"]].concat(),
    );
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let json = ended.json();
    assert_eq!(
        (json["steps"].as_u64(), json["rows"].as_u64()),
        (Some(4), Some(3))
    );
    assert_eq!(json["signals"][0]["unit"], "1/s");
    let text = folder.read("result.csv");
    assert_eq!(
        text.lines().next(),
        Some("time,good.k [1/s],good.y [m],good.u [m],good.n")
    );
    let rows = rows(&folder, "result.csv");
    assert_eq!(rows.len(), 3);
    let (y, last) = (1.0 - (-2.0f64).exp(), &rows[2]);
    assert!((last[2] - y).abs() < 1e-12);
    assert_eq!((last[0], last[1], last[3], last[4]), (2.0, 1.0, 1.0, 1.0));
    // Parameters only where nothing else fits.
    for (pattern, header) in [
        ("good.?", "time,good.u [m],good.y [m],good.n"),
        ("*.k*", "time,good.k [1/s]"),
    ] {
        assert_eq!(short_run(&folder, &["--record", pattern]).code, 0);
        assert_eq!(folder.read("result.csv").lines().next(), Some(header));
    }
    for (more, message) in [
        (
            ["--record", "godo.y"],
            "error: no variable is named like `godo.y`; did you mean `good.y`?\n",
        ),
        (
            ["--record", "*.text"],
            "error: `*.text` is text and cannot be in a table of numbers\n",
        ),
        (
            ["--record-every", "0.7"],
            "error: --record-every 0.7 s is no multiple of the step of 0.5 s\n",
        ),
    ] {
        let ended = short_run(&folder, &more);
        assert_eq!((ended.code, ended.stderr.as_str()), (2, message));
    }
}

/// However the run ends: 4 steps, and one that an FMU gives up.
#[test]
fn the_last_row_is_recorded_whatever_lies_between_rows() {
    let folder = folder(&["good", "discard@1.6"]);
    let times = |name: &str, every: &str, code: i32| -> Vec<f64> {
        let ended = folder.pilotage(&[
            "cosim",
            name,
            "--stop-time",
            "2",
            "--step",
            "0.5",
            "--record-every",
            every,
        ]);
        assert_eq!(ended.code, code, "{ended:?}");
        rows(&folder, "result.csv")
            .iter()
            .map(|row| row[0])
            .collect()
    };
    assert_eq!(times("good.fmu", "1.5", 0), [0.0, 1.5, 2.0]);
    assert_eq!(times("good.fmu", "1", 0), [0.0, 1.0, 2.0]);
    assert_eq!(times("good.fmu", "5", 0), [0.0, 2.0]);
    assert_eq!(times("discard.fmu", "5", 1), [0.0, 1.6]);
}

#[test]
fn rows_survive_a_crash_and_the_next_run_says_so() {
    let folder = folder(&["good", "crash@1.25"]);
    folder.write("result.csv", "time,a.b\n0,1\n");
    let run = |fmu| folder.pilotage(&["cosim", fmu, "--stop-time", "2", "--step", "0.25"]);
    let ended = run("crash.fmu");
    assert_eq!(ended.code, 1, "{ended:?}");
    assert_eq!(
        ended.stderr,
        "error: `crash` of crash.fmu, in fmi2DoStep at 1.25 s, ended the process (signal: 6 (SIGABRT))\n\
         hint: the rows until then are in result.csv.part\n"
    );
    assert_eq!(folder.read("result.csv"), "time,a.b\n0,1\n");
    // All rows until the step in which the FMU crashed.
    let part = rows(&folder, "result.csv.part");
    assert_eq!((part.len(), part[5][0]), (6, 1.25));
    let ended = run("good.fmu");
    assert_eq!(ended.code, 0);
    assert_eq!(
        ended.stderr,
        "note: an earlier run of result.csv was killed or crashed; its rows are in \
         result.csv.interrupted-1\n"
    );
    assert_eq!(rows(&folder, "result.csv").len(), 9);
    assert_eq!(rows(&folder, "result.csv.interrupted-1").len(), 6);
    let expected = [
        "crash.fmu",
        "good.fmu",
        "result.csv",
        "result.csv.interrupted-1",
    ];
    assert_eq!(folder.files(), expected);
    assert_eq!(run("good.fmu").stderr, "");
}

#[test]
fn progress_as_json_lines() {
    let folder = folder(&["good"]);
    let ended = short_run(&folder, &["--progress", "json"]);
    let lines: Vec<serde_json::Value> = (ended.stderr.lines())
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let (first, last) = (&lines[0], &lines[lines.len() - 1]);
    assert_eq!(
        (&first["status"], first["fraction"].as_f64()),
        (&"begin".into(), Some(0.0))
    );
    assert_eq!(
        (&last["status"], last["fraction"].as_f64()),
        (&"completed".into(), Some(1.0))
    );
    assert_eq!(
        (last["rows"].as_u64(), last["time"].as_f64()),
        (Some(5), Some(2.0))
    );
    assert_eq!(last["report"]["steps"]["accepted"], 4);
}

#[test]
fn outputs_that_depend_on_time_are_the_same_in_both_kinds_up_to_the_end() {
    let folder = Folder::new();
    let c = "[model]\nname = \"c\"\n[inputs]\ny = {}\n[parameters]\nw = { start = 3, unit = \"rad/s\" }\n\
             [outputs]\nu = { value = \"2 * (sin(w * time) - y)\" }\n";
    let p = "[model]\nname = \"p\"\n[inputs]\nu = {}\n[states]\nx = { der = \"u\" }\n[outputs]\n\
             y = { value = \"x\" }\n";
    for (name, text) in [("c", c), ("p", p)] {
        folder.write(&format!("{name}.toml"), text);
        let ended = folder.pilotage(&["export", &format!("{name}.toml"), "--fmi", "3"]);
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    let last = |kind: &str| -> f64 {
        let words = [
            "cosim",
            "c.fmu",
            "p.fmu",
            "--kind",
            kind,
            "--algorithm",
            "strong",
        ];
        let wires = ["--connect", "c.u=p.u", "--connect", "p.y=c.y"];
        let rest = [
            "--stop-time",
            "3",
            "--step",
            "0.1",
            "-o",
            "r.csv",
            "--force",
        ];
        let ended = folder.pilotage(&[&words[..], &wires, &rest].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let text = folder.read("r.csv");
        let row = text.lines().next_back().unwrap();
        row.rsplit(',').next().unwrap().parse().unwrap()
    };
    let [cs, me] = ["cs", "me"].map(last);
    assert!((cs - me).abs() < 1e-7, "{cs} {me}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_stops_cleanly_and_keeps_the_rows() {
    let folder = folder(&["good"]);
    // It ends by itself within a minute or two: a child of a killed test would fill the disk.
    let long = [
        "--stop-time",
        "1e4",
        "--step",
        "0.001",
        "--record",
        "good.y",
    ];
    let mut child = folder
        .listening(&[&["cosim", "good.fmu"], &long[..]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begin = Instant::now();
    let part = folder.path("result.csv.part");
    while std::fs::metadata(&part).map_or(0, |file| file.len()) < 1000 {
        assert!(begin.elapsed() < Duration::from_secs(60), "no rows came");
        std::thread::sleep(Duration::from_millis(5));
    }
    let kill = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let ended = child.wait_with_output().unwrap();
    let last = rows(&folder, "result.csv").pop().unwrap()[0];
    assert_eq!(
        String::from_utf8(ended.stderr).unwrap(),
        format!(
            "note: stopping after this step; Ctrl-C again kills\n\
             note: stopped at {last} s; the rows until {last} s are kept\n"
        )
    );
    assert!(last < 1e4);
    assert_eq!(folder.files(), ["good.fmu", "result.csv"]);
}

#[test]
fn models_run_without_being_exported() {
    let folder = Folder::new();
    let vehicle = folder.pilotage(&["vehicle", "show"]).stdout;
    folder.write("quadcopter.toml", vehicle);
    folder.write(
        "pilot.toml",
        "[theta]\ntheta1 = 0.3\ntheta2 = 1.2\ntheta3 = 1.0\n\
         theta4 = -0.006\ntheta5 = -0.03\ntheta6 = -0.04\n",
    );
    for (model, file) in [("pilot", "pilot.toml"), ("quadcopter", "quadcopter.toml")] {
        assert_eq!(folder.pilotage(&["export", model, file]).code, 0);
    }
    let run = |kind: &str, to: &str| {
        let [pilot, quadcopter] = ["pilot", "quadcopter"].map(|name| format!("{name}.{kind}"));
        let flight = [
            "--set",
            "pilot.target=10",
            "--stop-time",
            "5",
            "--step",
            "0.05",
        ];
        let files = ["cosim", &pilot, &quadcopter];
        let ended = folder.pilotage(&[&files[..], &CONNECTIONS, &flight, &["-o", to]].concat());
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
        folder.read(to)
    };
    let (native, exported) = (run("toml", "a.csv"), run("fmu", "b.csv"));
    assert_eq!(native.lines().count(), 102);
    assert_eq!(native, exported);
}

#[cfg(target_os = "linux")]
/// Names as the system has them, whatever bytes are in them.
#[test]
#[cfg(target_os = "linux")]
fn files_have_names_of_any_bytes() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = folder(&["good"]);
    let wild = |bytes: &'static [u8]| OsStr::from_bytes(bytes);
    std::fs::rename(
        folder.path("good.fmu"),
        folder.path("").join(wild(b"g\xff.fmu")),
    )
    .unwrap();
    folder.write("u.csv", "time,u\n0,1\n1,1\n");
    std::fs::rename(
        folder.path("u.csv"),
        folder.path("").join(wild(b"u\xff.csv")),
    )
    .unwrap();
    let run = |more: &[&'static [u8]]| {
        let words = [
            b"cosim",
            b"good=g\xff.fmu".as_slice(),
            b"--stop-time",
            b"1",
            b"--step",
            b"0.5",
        ];
        let words = words.iter().chain(more).map(|own| wild(own));
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_pilotage"))
            .args(words)
            .current_dir(folder.path(""))
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), stderr)
    };
    let one: [&[u8]; 5] = [b"--input", b"u\xff.csv", b"-o", b"r\xff.csv", b"--force"];
    let isolated: [&[u8]; 2] = [b"--isolate", b"all"];
    for more in [one.to_vec(), [&one[..], &isolated].concat()] {
        assert_eq!(run(&more), (Some(0), String::new()));
        let result = folder.path("").join(wild(b"r\xff.csv"));
        assert!(
            std::fs::read_to_string(&result)
                .unwrap()
                .contains("good.y [m]")
        );
        std::fs::remove_file(result).unwrap();
    }
    let (code, stderr) = run(&[b"--save-system", b"s.toml"]);
    assert_eq!(code, Some(2));
    assert!(
        stderr.ends_with(
            "is not UTF-8\nhint: TOML is UTF-8: rename the file, or leave --save-system out\n"
        ),
        "{stderr}"
    );
}

#[test]
fn a_full_disk_is_told() {
    let folder = folder(&["good"]);
    let ended = short_run(&folder, &["-o", "/dev/full"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.stderr,
        "error: cannot write the result at 0 s: No space left on device (os error 28)\n"
    );
    assert_eq!(folder.files(), ["good.fmu"]);
}
