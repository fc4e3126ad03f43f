//! Problem files with one mistake each: what their author is told, to the letter.
//!
//! `mistakes.txt` has a paragraph for each. Its first lines are a patch of the good file: `- ` a line that is left
//! out, `+ ` what stands there instead, or at the end of the file where no line is left out. The other lines are the
//! message.

#[path = "../../../tests/paragraphs.rs"]
mod paragraphs;

use paragraphs::assert_same;
use pilotage_estimation::{Posed, ProblemError, ProblemFile, fit, part};
use pilotage_text::error_chain::error_chain;
use std::ops::ControlFlow;
use std::path::Path;

/// A problem without a mistake: a pilot steers a trolley to a target.
const GOOD: &str = r#"[system.pilot]
model = "crossover"
set = { lag = 0.2 }
[system.vehicle]
model = "trolley.toml"
[connect]
"pilot.stick" = "vehicle.stick"
"vehicle.z" = "pilot.position"
[inputs]
"pilot.target" = { column = "target", hold = "linear" }
[[measured]]
signal = "vehicle.z"
column = "position"
sd = "noise * (1 + abs(y))"
gain = "free"
offset = 0.1
noise = "normal"
[parameters]
"pilot.gain" = { start = 0.1, min = 0, max = 5, nominal = 0.1 }
"pilot.delay" = { scale = "log", prior = { log-normal = [-1, 0.5] } }
"vehicle.mass" = { value = "2 * half" }
half = { start = 0.5, min = 0.1, unit = "kg" }
noise = { start = 0.05, min = 0.001 }
[initial]
"vehicle.z" = "free"
"pilot.*" = "steady"
[[constraint]]
expression = "vehicle.v"
min = -10
max = 10
at = "samples"
[stability]
models = ["pilot"]
closed_loop = false
[[run]]
file = "run.csv"
use = "fit"
weight = 1
subject = "A"
set = { "vehicle.gust" = 0.3 }
[[run.change]]
time = 2
set = { "vehicle.gust" = 0.1 }
[[run]]
file = "run.csv"
subject = "B"
[fit]
scheme = "hermite-simpson"
mesh = "samples"
tolerance = 1e-8
starts = 1
max_iterations = 100
"#;

const TROLLEY: &str = r#"[model]
name = "trolley"
[inputs]
stick = { unit = "1" }
gust = { unit = "N" }
[parameters]
mass = { start = 1, unit = "kg", min = 0.1 }
thrust = { start = 1, unit = "N", min = 0 }
drag = { start = 2, unit = "N.s/m", min = 0 }
colour = 7
[states]
z = { unit = "m", der = "v" }
v = { unit = "m/s", der = "(thrust * stick + gust - drag * v) / mass" }
[outputs]
power = { unit = "W", value = "thrust * stick * v" }
"#;

/// A model that takes a stick and has no state.
const LEVER: &str = r#"[model]
name = "lever"
[inputs]
stick = { unit = "1" }
gust = { unit = "N" }
[parameters]
arm = { start = 0.2, unit = "m" }
[outputs]
z = { unit = "m", value = "arm * stick" }
v = { value = "arm * gust" }
"#;

/// What other files stand beside the problem.
fn files() -> Vec<(&'static str, String)> {
    let row = |k: usize, time: f64| {
        let position = 1.0 - (-0.1 * time).exp() + 0.01 * (7 * k % 5) as f64;
        format!("{time},1,{position:.4},5,{k},,nan,-1\n")
    };
    let header = "time [s],target [m],position [m],spread [cm],torque [N.m],empty,missing,below\n";
    let rows = |from: f64| (0..12).map(move |k| row(k, from + 0.5 * k as f64));
    let run = |from: f64| header.to_owned() + &rows(from).collect::<String>();
    let good = run(0.0);
    vec![
        ("trolley.toml", TROLLEY.into()),
        ("lever.toml", LEVER.into()),
        ("torn.toml", TROLLEY.replace("drag * v)", "drag * w)")),
        (
            "system.toml",
            "[system.vehicle]\nmodel = \"trolley.toml\"\n".into(),
        ),
        (
            "infinite.csv",
            good.replace("1,5,0.5", "1,5,inf")
                .replace(",5,3,", ",inf,3,"),
        ),
        (
            "late.csv",
            good.replacen(&row(0, 0.0), "0,1,,5,0,,nan,-1\n", 1),
        ),
        ("back.csv", good.replace("\n1.5,", "\n0.2,")),
        ("word.csv", good.replace("\n1.5,1,", "\n1.5,lost,")),
        ("header.csv", header.into()),
        ("one_row.csv", header.to_owned() + &row(0, 0.0)),
        ("no_header.csv", "0,1,2\n1,2,3\n".into()),
        ("empty.csv", String::new()),
        ("run.csv", good),
    ]
}

/// A folder with the files.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files() {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

/// Poses a problem in that folder, and solves it where it is asked to; paths in messages begin in the folder.
fn pose(text: &str, folder: &Path, then: &dyn Fn(&Posed<'_>)) -> Result<(), String> {
    let shown =
        |error: ProblemError| error_chain(&error).replace(&format!("{}/", folder.display()), "");
    let file = ProblemFile::parse(text, &folder.join("problem.toml")).map_err(shown)?;
    let posed = Posed::new(&file, &part::open).map_err(shown)?;
    then(&posed);
    Ok(())
}

/// The good file, changed as the lines say: of lines to leave out, as many at once as stand together.
fn patched(patch: &[&str]) -> String {
    let joined = |lines: &[&str]| -> String {
        let lines = lines.iter().map(|line| format!("{}\n", &line[2..]));
        lines.collect()
    };
    let mut text = GOOD.to_owned();
    let mut rest = patch;
    while let Some(first) = rest.first() {
        let signs = |sign: char, lines: &[&str]| {
            let own = lines.iter().take_while(|line| line.starts_with(sign));
            own.count()
        };
        let mut olds = signs('-', rest);
        while olds > 0 && !text.contains(&joined(&rest[..olds])) {
            olds -= 1;
        }
        assert!(olds > 0 || first.starts_with('+'), "not there: {first}");
        let news = signs('+', &rest[olds..]);
        let new = joined(&rest[olds..][..news]);
        match joined(&rest[..olds]).as_str() {
            "" => text += &new,
            old => text = text.replacen(old, &new, 1),
        }
        rest = &rest[olds + news..];
    }
    text
}

#[test]
fn the_problem_without_a_mistake_is_solved() {
    let solve = |posed: &Posed<'_>| {
        let found = fit(posed, &mut |_| ControlFlow::Continue(()));
        assert!(found.is_answer(), "{:?}", found.status);
    };
    pose(GOOD, folder().path(), &solve).expect("it is good");
}

#[test]
fn what_each_mistake_is_told() {
    let expected = include_str!("mistakes.txt");
    let folder = folder();
    let mut paragraphs = Vec::new();
    for paragraph in expected.trim_end().split("\n\n") {
        let is_patch = |line: &&str| line.starts_with("- ") || line.starts_with("+ ");
        let patch: Vec<&str> = paragraph.lines().take_while(is_patch).collect();
        let posed = pose(&patched(&patch), folder.path(), &|_| ());
        let message = posed.err().unwrap_or("no mistake".into());
        paragraphs.push(format!("{}\n{message}", patch.join("\n")));
    }
    assert!(paragraphs.len() >= 80, "{}", paragraphs.len());
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/mistakes.txt");
    assert_same(path, &paragraphs);
}
