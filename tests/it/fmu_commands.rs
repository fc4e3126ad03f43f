//! `pilotage cosim`, `info` and `validate` on FMUs of another tool.

use crate::command::Folder;
use crate::foreign;

/// A folder with FMUs of these behaviours, named after them up to `@`.
fn folder(behaviours: &[&str]) -> Folder {
    let folder = Folder::new();
    for behaviour in behaviours {
        let name = behaviour.split('@').next().unwrap();
        folder.write(&format!("{name}.fmu"), foreign::fmu(behaviour));
    }
    folder
}

#[test]
fn a_loop_is_simulated_and_recorded() {
    let folder = folder(&["good"]);
    let ended = folder.pilotage(&[
        "cosim",
        "good.fmu",
        "other=good.fmu",
        "--connect",
        "good.y=other.u",
        "--connect",
        "other.y=good.u",
        "--set",
        "good.k=0.5",
        "--stop-time",
        "1",
        "--step",
        "0.25",
        "--algorithm",
        "gauss-seidel",
    ]);
    assert_eq!(ended.stderr, "");
    // What follows tells times.
    let (summary, _) = ended.stdout.split_once("4 communication steps").unwrap();
    assert_eq!(
        summary,
        "4 steps of 0.25 s from 0 s to 1 s (gauss-seidel, in the order good, other)\n\
         5 rows of 12 signals in result.csv\n\
         note: nothing feeds `good.n_in`; it keeps its start value\n\
         note: nothing feeds `good.flag_in`; it keeps its start value\n\
         note: nothing feeds `good.text_in`; it keeps its start value\n\
         note: nothing feeds `other.n_in`; it keeps its start value\n\
         note: nothing feeds `other.flag_in`; it keeps its start value\n\
         note: nothing feeds `other.text_in`; it keeps its start value\n\
         note: `good.text` is text and not in the table\n\
         note: `other.text` is text and not in the table\n"
    );
    assert_eq!(ended.code, 0);
    let csv = folder.read("result.csv");
    assert_eq!(
        csv.lines().next().unwrap(),
        "time,good.y [m],good.tolerance,good.start,good.stop,good.n,good.flag,\
         other.y [m],other.tolerance,other.start,other.stop,other.n,other.flag"
    );
    assert_eq!(csv.lines().count(), 6);
    assert!(csv.lines().nth(5).unwrap().starts_with("1,0,0.001,0,1,"));
    assert_eq!(folder.files(), ["good.fmu", "result.csv"]);
}

#[test]
fn the_summary_as_json() {
    let folder = folder(&["good"]);
    let ended = folder.pilotage(&[
        "cosim",
        "good.fmu",
        "--stop-time",
        "1",
        "--step",
        "0.5",
        "--json",
        "-o",
        "a.csv",
    ]);
    let json = ended.json();
    assert_eq!(json["status"], "completed");
    assert_eq!(json["algorithm"], "jacobi");
    assert_eq!(json["steps"], 2);
    assert_eq!(json["time"], 1.0);
    assert_eq!(json["signals"][0]["name"], "good.y");
    assert_eq!(json["signals"][0]["unit"], "m");
    assert_eq!(json["output"], "a.csv");
    assert_eq!(ended.code, 0);
}

#[test]
fn rows_before_a_failure_are_kept_and_it_says_where() {
    let folder = folder(&["error@0.5", "discard@0.5", "end@0.5"]);
    for (name, code, message) in [
        (
            "error",
            1,
            "error: `error` failed to step at 0.5 s: fmi2DoStep returned fmi2Error: the solver failed; the rows until 0.5 s are kept\n",
        ),
        (
            "discard",
            1,
            "error: `discard` discarded the step from 0.5 s, it came to 0.5 s; a shorter --step may help: --algorithm strong with --tolerance shortens steps by itself, if the FMUs save their states; the rows until 0.5 s are kept\n",
        ),
        ("end", 0, "note: `end` asked for the end at 0.5 s\n"),
    ] {
        let file = format!("{name}.fmu");
        let ended = folder.pilotage(&["cosim", &file, "--stop-time", "1", "--step", "0.25"]);
        assert_eq!((ended.stderr.as_str(), ended.code), (message, code));
        assert_eq!(folder.read("result.csv").lines().count(), 4, "{name}");
    }
}

/// Each text once and the first twenty, from another process too. The result is the same as without.
#[test]
fn warnings_of_an_fmu_are_shown() {
    let folder = folder(&["warn", "good"]);
    let run = |fmu: &str, step: &str, isolation: &[&str]| {
        let words = ["cosim", fmu, "--stop-time", "10", "--step", step, "--force"];
        let ended = folder.pilotage(&[&words, isolation].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        (ended.stderr, folder.read("result.csv"))
    };
    let warning = |text: &str| format!("warning: `warn`: {text}\n");
    let table = warning("the table ends at 100 %");
    let [first, second] = [0, 5].map(|time| warning(&format!("extrapolated at {time} s")));
    let expected = [table.clone(), first, second].concat();
    assert_eq!(run("warn.fmu", "5", &[]).0, expected);
    assert_eq!(run("warn.fmu", "5", &["--isolate", "all"]).0, expected);
    let (said, rows) = run("warn.fmu", "0.1", &[]);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 21, "{said}");
    assert_eq!(
        lines[20],
        "note: these were 20 different warnings of FMUs; further ones are not shown"
    );
    let (said, same) = run("good.fmu", "0.1", &[]);
    assert_eq!((said.as_str(), same), ("", rows.replace("warn.", "good.")));
}

#[test]
fn what_was_there_stays_if_the_initialization_fails() {
    let folder = folder(&["error-in-initialization"]);
    folder.write("result.csv", "time,a.b\n0,1\n");
    let arguments = [
        "cosim",
        "error-in-initialization.fmu",
        "--stop-time",
        "1",
        "--step",
        "0.25",
    ];
    assert_eq!(folder.pilotage(&arguments).code, 2);
    assert_eq!(folder.read("result.csv"), "time,a.b\n0,1\n");
    assert_eq!(
        folder.files(),
        ["error-in-initialization.fmu", "result.csv"]
    );
}

#[test]
fn info_shows_the_variables() {
    let folder = folder(&["good"]);
    let text = folder.pilotage(&["info", "good.fmu"]).stdout;
    for line in [
        "  interfaces    FMI 2.0, co-simulation\n",
        "  experiment    start 0 s, stop 1 s, step 0.1 s, tolerance 0.001\n",
        "k          parameter  fixed        Real     1/s   1.0\n",
        "text       output     discrete     String\n",
    ] {
        assert!(text.contains(line), "{line} in\n{text}");
    }
    let json = folder.pilotage(&["info", "good.fmu", "--json"]).json();
    assert_eq!(json["variables"][2]["name"], "k");
    assert_eq!(json["variables"][2]["start"], 1.0);
    assert_eq!(json["guid"], "good");
}

/// What `validate` says of a foreign FMU; its binary has fewer functions than the standard asks for.
fn validated(content: &[u8]) -> (i32, Vec<String>) {
    let folder = Folder::new();
    folder.write("a.fmu", content);
    let ended = folder.pilotage(&["validate", "a.fmu"]);
    assert_eq!(ended.stderr, "");
    let is_missing = |line: &&str| line.contains("it has no function");
    let lines = ended.stdout.lines().filter(|line| !is_missing(line));
    let without_entry = |line: &str| line.replace(&foreign::binary_entry(), "ENTRY");
    (ended.code, lines.map(without_entry).collect())
}

#[test]
fn validate_tells_the_verdict_first() {
    let (code, lines) = validated(&foreign::fmu("good"));
    assert_eq!((code, lines.len()), (0, 1), "{lines:?}");
    assert!(
        lines[0].starts_with("a.fmu: valid, and runs"),
        "{}",
        lines[0]
    );

    let description = foreign::DESCRIPTION.replace("unit=\"1/s\"", "unit=\"per second\"");
    let (code, lines) = validated(&foreign::fmu_of(&description, foreign::binary()));
    assert_eq!(code, 1);
    assert!(
        lines[0].starts_with("a.fmu: not valid (1 error"),
        "{}",
        lines[0]
    );
    let expected = "  error: modelDescription.xml, line 15, column 5: unit `per second` is not defined \
                    under <UnitDefinitions> (FMI 2.0, section 2.2.2) (variable `k`)";
    assert_eq!(lines[1], expected);
}

#[test]
#[cfg(target_os = "linux")]
fn validate_names_the_symbol_that_nobody_has() {
    let checked = |binary| validated(&foreign::fmu_of(foreign::DESCRIPTION, binary));
    let symbol = "undefined symbol: a_function_that_nobody_has (FMI 2.0, sections 2.1 and 4.2)";
    let advice = "no library here has the symbol `a_function_that_nobody_has` that it needs; the FMU was linked \
                  without the library that has it: start with LD_PRELOAD=LIBRARY, or ask who made the FMU \
                  (FMI 2.0, sections 2.1 and 4.2)";
    let (code, lines) = checked(foreign::binary_needing_nobody());
    assert_eq!((code, lines.len()), (1, 2), "{lines:?}");
    let start = "  error: co-simulation: while loading: a.fmu: `ENTRY` cannot be used: ";
    assert_eq!(lines[1], format!("{start}{advice}"));

    // This one loads, since an FMU may never call what is missing; but it does when it steps.
    let (code, lines) = checked(foreign::binary_needing_nobody_yet());
    assert_eq!(code, 1);
    let start = "  warning: co-simulation: a symbol is missing, calling it would end the process: ";
    assert!(
        lines[1].starts_with(start) && lines[1].ends_with(symbol),
        "{}",
        lines[1]
    );
    assert!(
        lines.iter().any(|line| line.contains(" while stepping (")),
        "{lines:?}"
    );
}

#[test]
fn validate_many_as_json() {
    let folder = folder(&["good", "error"]);
    let ended = folder.pilotage(&["validate", "good.fmu", "error.fmu", "--json"]);
    let json = ended.json();
    assert_eq!(json["fmus"][0]["valid"], true);
    assert_eq!(json["fmus"][1]["valid"], false);
    assert_eq!(ended.code, 1);
    let ended = folder.pilotage(&["validate", "good.fmu", "nothing.fmu"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.stderr.starts_with("error: cannot open nothing.fmu: "),
        "{}",
        ended.stderr
    );
}

#[test]
fn model_exchange_is_simulated_by_the_command() {
    let folder = Folder::new();
    folder.write("ball.fmu", foreign::model_exchange("ball@0.7", 2, 1));
    folder.write("good.fmu", foreign::fmu("good"));
    // The height of the ball feeds a filter; both kinds run side by side.
    let ended = folder.pilotage(&[
        "cosim",
        "ball.fmu",
        "good.fmu",
        "--set",
        "ball.p=0.5",
        "--stop-time",
        "2",
        "--step",
        "0.5",
        "--fmu-tolerance",
        "1e-8",
    ]);
    assert_eq!(
        (ended.code, ended.stderr.as_str()),
        (0, ""),
        "{}",
        ended.stdout
    );
    let csv = folder.read("result.csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["time", "ball.y", "ball.events"]);
    // It falls from 1 m: the first bounce is at 0.4515 s, and keeps half of the speed.
    const G: f64 = 9.81;
    let first = (2.0 / G).sqrt();
    let height = |t: f64| {
        let (after, v) = (t - first, 0.5 * G * first);
        v * after - 0.5 * G * after * after
    };
    let y: f64 = rows[2][1].parse().unwrap();
    assert_eq!(rows[2][2], "1");
    assert!((y - height(0.5)).abs() < 1e-7, "{y} {}", height(0.5));
}

#[test]
fn fmus_of_fmi_3_are_simulated_as_the_kind_that_is_wanted() {
    let folder = Folder::new();
    folder.write("a.fmu", foreign::fmu3("good"));
    let run = |arguments: &[&str]| {
        let common = [
            "cosim",
            "a.fmu",
            "--set",
            "a.k=2",
            "--set",
            "a.u=1",
            "--stop-time",
            "1",
            "--step",
            "0.25",
        ];
        let ended = folder.pilotage(&[&common, arguments].concat());
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let csv = folder.read("result.csv");
        let cells = |line: &str| -> Vec<String> { line.split(',').map(str::to_owned).collect() };
        let (names, last) = (csv.lines().next().unwrap(), csv.lines().last().unwrap());
        let pairs = cells(names).into_iter().zip(cells(last));
        pairs.collect::<std::collections::HashMap<String, String>>()
    };
    // Co-simulation: y follows u; each type has its output, the input plus one.
    let last = run(&[
        "--set",
        "a.u8_in=254",
        "--set",
        "a.i64_in=-9007199254740993",
        "--set",
        "a.f32_in=0.5",
    ]);
    let y: f64 = last["a.y"].parse().unwrap();
    assert!((y - (1.0 - (-2f64).exp())).abs() < 1e-12);
    let outputs =
        ["a.u8", "a.i64", "a.f32", "a.boolean", "a.count"].map(|name| last[name].as_str());
    // With the event iteration at the start.
    assert_eq!(outputs, ["255", "-9007199254740992", "1.5", "1", "1"]);
    // Model exchange: the event iteration at the start, where the input jumps, and where x falls below 1/2.
    let last = run(&["--kind", "me"]);
    assert_eq!((last["a.count"].as_str(), last["a.y"].as_str()), ("2", "0"));

    let ended = folder.pilotage(&[
        "cosim",
        "a.fmu",
        "--set",
        "a.u8_in=256",
        "--stop-time",
        "1",
        "--step",
        "0.25",
    ]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .stderr
            .contains("`a.u8_in` cannot be 256: it is from 0 to 255"),
        "{}",
        ended.stderr
    );
}
