//! `pilotage cosim --scenario`: against closed forms and a loop of its own.

use crate::command::{Ended, Folder, exported};

/// A lag of 0.5 s whose input is also an output.
const PLANT: &str = "[model]\nname = \"plant\"\n[inputs]\nu = { start = 2 }\n\
                     [parameters]\nlag = { start = 0.5, unit = \"s\", min = 0.01 }\n\
                     [states]\ny = { der = \"(u - y) / lag\" }\n[outputs]\ny = {}\necho = { value = \"u\" }\n";
/// What rises by 1 in a second.
const RAMP: &str = "[model]\nname = \"ramp\"\n[parameters]\nrate = { start = 1, unit = \"1/s\" }\n\
                    [outputs]\nout = { value = \"rate * time\" }\n";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("plant.toml", PLANT);
    folder.write("ramp.toml", RAMP);
    folder
}

fn pilotage(folder: &Folder, words: &str) -> Ended {
    folder.pilotage(&words.split_whitespace().collect::<Vec<_>>())
}

/// Times and values of a column of a run.
fn run(folder: &Folder, scenario: &str, words: &str, column: &str) -> Vec<(f64, f64)> {
    folder.write("what.toml", scenario);
    let ended = pilotage(
        folder,
        &format!("cosim {words} --scenario what.toml --force"),
    );
    assert_eq!(ended.code, 0, "{scenario} {words}: {ended:?}");
    let text = folder.read("result.csv");
    let mut lines = text.lines();
    let k = lines
        .next()
        .unwrap()
        .split(',')
        .position(|own| own == column)
        .unwrap();
    let number = |line: &str, k: usize| line.split(',').nth(k).unwrap().parse::<f64>().unwrap();
    lines
        .map(|line| (number(line, 0), number(line, k)))
        .collect()
}

const WIRED: &str = "plant.toml ramp.toml --connect ramp.out=plant.u --stop-time 3 --step 0.1";

/// Of an input that nothing feeds, steps are cut where it changes and where it becomes what it was.
#[test]
fn an_input_is_set_for_some_time_within_steps() {
    let folder = folder();
    let scenario = "[[event]]\ntime = 0.73\nduration = 1.11\ninput = \"plant.u\"\nset = 5\n";
    let free = "plant.toml --stop-time 3 --step 0.1";
    let lag = |from: f64, u: f64, t: f64| u + (from - u) * (-t / 0.5).exp();
    let exact = |t: f64| {
        let (first, last) = (lag(0.0, 2.0, 0.73), lag(lag(0.0, 2.0, 0.73), 5.0, 1.11));
        match t {
            t if t <= 0.73 => lag(0.0, 2.0, t),
            t if t <= 1.84 => lag(first, 5.0, t - 0.73),
            t => lag(last, 2.0, t - 1.84),
        }
    };
    for more in [
        "",
        "--algorithm gauss-seidel",
        "--algorithm strong",
        "--algorithm strong --tolerance 1e-7",
        "--parallel",
    ] {
        for (t, y) in run(&folder, scenario, &format!("{free} {more}"), "plant.y") {
            assert!((y - exact(t)).abs() < 1e-6, "{more} {t}: {y} {}", exact(t));
        }
    }
}

/// Held inputs, step by step: what each effect makes of the values on a wire.
#[test]
fn effects_on_a_wire() {
    let folder = folder();
    type Rule = fn(f64) -> f64;
    let cases: [(&str, f64, Rule); 5] = [
        ("set = -3", 1.0, |_| -3.0),
        ("freeze = true", 1.0, |_| 1.0),
        ("bias = 0.25", 0.5, |u| u + 0.25),
        ("scale = -2", 0.8, |u| -2.0 * u),
        ("delay = 0.3", 1.5, |u| u - 0.3),
    ];
    for (effect, start, rule) in cases {
        let scenario =
            format!("[[event]]\ntime = {start}\nduration = 1\ninput = \"u\"\n{effect}\n")
                .replace("\"u\"", "\"plant.u\"");
        let rows = run(&folder, &scenario, WIRED, "plant.y");
        let mut y = 0.0;
        for (k, (t, found)) in rows.iter().enumerate() {
            assert!((found - y).abs() < 1e-6, "{effect} {t}: {found} {y}");
            let at = 0.1 * k as f64;
            let is_on = at > start - 1e-9 && at < start + 1.0 - 1e-9;
            let u = if is_on { rule(at) } else { at };
            y = u + (y - u) * (-0.1_f64 / 0.5).exp();
        }
        // Two at once: the second changes what the first makes.
        let both = format!("{scenario}[[event]]\ntime = 0\ninput = \"plant.u\"\nscale = 2\n");
        let rows = run(&folder, &both, WIRED, "plant.y");
        let mut y = 0.0;
        for (k, (t, found)) in rows.iter().enumerate() {
            assert!((found - y).abs() < 1e-6, "{effect} {t}: {found} {y}");
            let at = 0.1 * k as f64;
            let is_on = at > start - 1e-9 && at < start + 1.0 - 1e-9;
            let u = 2.0 * if is_on { rule(at) } else { at };
            y = u + (y - u) * (-0.1_f64 / 0.5).exp();
        }
    }
}

/// Strong coupling lets inputs change within a step: slopes are those of what the wire becomes.
#[test]
fn slopes_within_steps_are_those_of_the_effect() {
    let folder = folder();
    let scenario = "[[event]]\ntime = 0.73\ninput = \"plant.u\"\nscale = 3\n[[event]]\ntime = 2\ninput = \"plant.u\"\nset = 1\n";
    // y' = (s t - y) / 0.5 has the solution s (t - 0.5) + c exp(-2 t).
    let ramp = |from: (f64, f64), s: f64, t: f64| {
        s * (t - 0.5) + (from.1 - s * (from.0 - 0.5)) * (-2.0 * (t - from.0)).exp()
    };
    let first = ramp((0.0, 0.0), 1.0, 0.73);
    let second = ramp((0.73, first), 3.0, 2.0);
    for (t, y) in run(
        &folder,
        scenario,
        &format!("{WIRED} --algorithm strong"),
        "plant.y",
    ) {
        let exact = match t {
            t if t <= 0.73 => ramp((0.0, 0.0), 1.0, t),
            t if t <= 2.0 => ramp((0.73, first), 3.0, t),
            t => 1.0 + (second - 1.0) * (-2.0 * (t - 2.0)).exp(),
        };
        assert!((y - exact).abs() < 2e-6, "{t}: {y} {exact}");
    }
}

#[test]
fn conditions_begin_events_and_the_run_ends() {
    let folder = folder();
    let free = "plant.toml --stop-time 3 --step 0.1";
    // y = 2 (1 - exp(-2 t)) is above 1 from 0.35 s on.
    let scenario = "[[event]]\nwhen = \"plant.y > 1\"\nend = true\n";
    let rows = run(&folder, scenario, free, "plant.y");
    assert_eq!(rows.last().unwrap().0, 0.4);
    let scenario = "[[event]]\nwhen = \"plant.y > 1\"\ninput = \"u\"\nset = 0\n[[event]]\ntime = 1.25\nend = true\n";
    folder.write("what.toml", scenario);
    let ended = pilotage(
        &folder,
        &format!("cosim {free} --scenario what.toml --json --force"),
    );
    let (json, rows) = (ended.json(), run(&folder, scenario, free, "plant.y"));
    assert_eq!(json["status"], "end-requested");
    assert_eq!(json["time"], 1.25);
    let top = 2.0 * (1.0 - (-0.8_f64).exp());
    for (t, y) in &rows[..13] {
        let exact = match *t {
            t if t < 0.45 => 2.0 * (1.0 - (-2.0 * t).exp()),
            t => top * (-2.0 * (t - 0.4)).exp(),
        };
        assert!((y - exact).abs() < 1e-6, "{t}: {y} {exact}");
    }
}

/// Mean, deviation and independence of noise, which is that of the seed.
#[test]
fn noise_is_that_of_its_seed() {
    let folder = folder();
    let noise = |seed: u32| {
        let scenario =
            format!("[[event]]\ntime = 0\ninput = \"plant.u\"\nnoise = 0.5\nseed = {seed}\n");
        let words = "plant.toml --stop-time 40 --step 0.01";
        // Of a row is what was set in the step to it.
        let rows = run(&folder, &scenario, words, "plant.echo");
        rows.iter()
            .skip(1)
            .map(|own| own.1 - 2.0)
            .collect::<Vec<f64>>()
    };
    let (one, other) = (noise(1), noise(2));
    assert_eq!(one, noise(1));
    let n = one.len() as f64;
    let mean = |all: &mut dyn Iterator<Item = f64>| all.sum::<f64>() / n;
    let sd = mean(&mut one.iter().map(|own| own * own)).sqrt();
    let lag = mean(&mut one.windows(2).map(|own| own[0] * own[1]));
    let cross = mean(&mut one.iter().zip(&other).map(|(a, b)| a * b));
    // Three to four times what chance gives in 4,000 numbers.
    assert!(mean(&mut one.iter().copied()).abs() < 0.03, "{n}");
    assert!((sd - 0.5).abs() < 0.02, "{sd}");
    assert!(lag.abs() < 0.015 && cross.abs() < 0.015, "{lag} {cross}");
}

/// A run with all of it goes on from a state, and FMUs get what models get.
#[test]
fn states_and_fmus() {
    let folder = exported();
    let wires = "--connect pilot.stick=vehicle.stick --connect vehicle.z=pilot.position --set pilot.target=10";
    let scenario = "[[event]]\nwhen = \"vehicle.z > 2\"\ninput = \"vehicle.stick\"\ndelay = 0.12\n\
                    [[event]]\ntime = 1.42\nduration = 0.6\ninput = \"vehicle.stick\"\nfreeze = true\n\
                    [[event]]\ntime = 0.33\ninput = \"pilot.position\"\nnoise = 0.01\n";
    folder.write("what.toml", scenario);
    let result = |system: &str, more: &str| {
        let words =
            format!("cosim {system} {wires} --scenario what.toml --stop-time 4 --force {more}");
        let ended = pilotage(&folder, &words);
        assert_eq!(ended.code, 0, "{words}: {ended:?}");
        folder.read("result.csv")
    };
    let fmus = "pilot=pilot.fmu vehicle=quadcopter.fmu";
    for algorithm in ["", "--algorithm strong"] {
        let whole = result(
            fmus,
            &format!("{algorithm} --step 0.05 --save-state 1.5=s.state"),
        );
        let isolated = result(fmus, &format!("{algorithm} --step 0.05 --isolate all"));
        assert!(isolated == whole, "{algorithm}");
        let rest = result(fmus, &format!("{algorithm} --from-state s.state"));
        let tail = whole[whole.find("\n1.5,").unwrap() + 1..].to_owned();
        assert_eq!(rest.split_once('\n').unwrap().1, tail, "{algorithm}");
    }
    folder.write("what.toml", scenario.replace("0.6", "0.7"));
    let words = format!(
        "cosim {fmus} {wires} --scenario what.toml --algorithm strong --from-state s.state"
    );
    let ended = pilotage(&folder, &words);
    let why = "error: s.state is of a run with another coupling or scenario\n";
    assert!(
        ended.code == 2 && ended.stderr.starts_with(why),
        "{ended:?}"
    );
}

#[test]
fn mistakes_are_told_with_their_line() {
    let folder = folder();
    for (scenario, line, why) in [
        (
            "time = 1\n",
            2,
            "an event has either `end = true`, or `input` and one of set, ",
        ),
        (
            "end = true\n",
            2,
            "an event has either `time` [s] or `when`",
        ),
        (
            "time = 1\ninput = \"plant.u\"\nset = 1\nbias = 2\n",
            5,
            "this one has `set` and `bias`",
        ),
        (
            "time = 1\ninput = \"plant.v\"\nset = 1\n",
            2,
            "`plant` has no variable `v`",
        ),
        (
            "time = 1\ninput = \"plant.y\"\nset = 1\n",
            2,
            "`plant.y` is an output; expected an input of an instance\n",
        ),
        (
            "when = \"plant.y\"\nend = true\n",
            2,
            "`when` is `plant.y`; expected an output",
        ),
        (
            "when = \"plant.u > 1\"\nend = true\n",
            2,
            "`plant.u` is an input; expected an output in a condition\n",
        ),
        (
            "time = 1\nduration = 0\nend = true\n",
            3,
            "`duration` is 0 s; expected a time above 0\n",
        ),
        (
            "time = 1\ninput = \"plant.u\"\ndelay = -1\n",
            4,
            "`delay` is -1, which cannot be\n",
        ),
        (
            "time = 1\ninput = \"plant.u\"\nfreeze = 1\n",
            4,
            "`freeze` is ",
        ),
        ("times = 1\n", 2, "`times`"),
        (
            "name = \"a b\"\ntime = 1\nend = true\n",
            2,
            "the name of the event is `a b`",
        ),
    ] {
        folder.write("what.toml", format!("[[event]]\n{scenario}"));
        let ended = pilotage(
            &folder,
            "cosim plant.toml --stop-time 1 --step 0.1 --scenario what.toml",
        );
        let is_there = ended
            .stderr
            .starts_with(&format!("error: what.toml:{line}:"));
        assert!(
            ended.code == 2 && is_there && ended.stderr.contains(why),
            "{scenario}: {ended:?}"
        );
    }
    folder.write("what.toml", "");
    let ended = pilotage(
        &folder,
        "cosim plant.toml --stop-time 1 --step 0.1 --scenario what.toml",
    );
    assert!(
        ended.code == 2
            && ended
                .stderr
                .starts_with("error: what.toml: nothing happens\n")
    );
    assert!(!folder.files().iter().any(|own| own.starts_with("result")));
}

/// The clock paces the run: not faster than it, and as long as there is time no deadline is missed by much.
#[test]
fn a_paced_run_takes_its_time() {
    let folder = folder();
    let begun = std::time::Instant::now();
    let words = "cosim plant.toml --stop-time 2 --step 0.1 --real-time 5 --json";
    let ended = pilotage(&folder, words);
    assert!(
        begun.elapsed().as_secs_f64() > 0.399,
        "faster than the clock"
    );
    let json = ended.json();
    let paced = &json["realTime"];
    assert_eq!(
        (&paced["factor"], &paced["deadlines"]),
        (&5.0.into(), &20.into())
    );
    let counts = paced["delays"].as_array().unwrap().iter();
    let sum: u64 = counts.map(|own| own["count"].as_u64().unwrap()).sum();
    assert_eq!(paced["missed"].as_u64(), Some(sum));
    let paced = folder.read("result.csv");
    // Nobody is as fast as this: all deadlines are missed.
    let ended = pilotage(
        &folder,
        "cosim plant.toml --stop-time 2 --step 0.1 --real-time 1e12 --force",
    );
    assert!(
        ended.stdout.contains(": 20 of 20 deadlines missed, by "),
        "{ended:?}"
    );
    assert_eq!(folder.read("result.csv"), paced);
    let ended = pilotage(
        &folder,
        "cosim plant.toml --stop-time 2 --step 0.1 --force --json",
    );
    assert!(ended.json()["realTime"].is_null());
    assert_eq!(folder.read("result.csv"), paced);
}
