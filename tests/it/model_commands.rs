//! `pilotage model`, `models` and `export MODEL`: a model file from its first look to an FMU.

use crate::command::Folder;
use pilotage::fmi::Fmu;

const DAMPED: &str = r#"[model]
name = "damped"
description = "A mass on a spring"
[inputs]
force = { unit = "N" }
[parameters]
mass = { start = 2, unit = "kg", min = 0.1 }
stiffness = { start = 8, unit = "N/m" }
damping = { start = 1.6, unit = "N.s/m" }
length = { start = 0.5, unit = "m" }
[states]
x = { unit = "m", der = "v", start = "2 * length" }
v = { unit = "m/s", der = "total / mass" }
[locals]
total = { unit = "N", value = "force - stiffness * x - damping * v" }
[outputs]
x = { description = "Position" }
effort = { unit = "N", value = "total", limit = [-5, 5] }
"#;

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("damped.toml", DAMPED);
    folder
}

#[test]
fn a_check_tells_what_was_understood() {
    let ended = folder().pilotage(&["model", "check", "damped.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let info = folder().pilotage(&["info", "damped.toml"]);
    assert_eq!(info.stdout, ended.stdout);
    insta::assert_snapshot!(ended.stdout);
}

/// Poles of `m s² + d s + k`: ωₙ = √(k/m), ζ = d/(2 √(k m)).
#[test]
fn the_json_of_a_check_has_the_poles() {
    let json = folder()
        .pilotage(&["model", "check", "damped.toml", "--json"])
        .json();
    let pole = &json["linear"]["poles"][0];
    let (re, im) = (pole[0].as_f64().unwrap(), pole[1].as_f64().unwrap());
    assert!((re + 0.4).abs() < 1e-12 && (re * re + im * im - 4.0).abs() < 1e-12);
    assert_eq!(json["is_linear"], true);
    assert_eq!(json["at_rest"], false);
    let x = &json["variables"].as_array().unwrap()[1];
    assert_eq!(
        (x["name"].as_str(), x["start"].as_f64()),
        (Some("x"), Some(1.0))
    );
}

/// Delays in series: each has the poles of the first, exactly, and what depends on what is found in one pass.
#[test]
fn a_long_chain_of_delays_is_checked() {
    const N: usize = 400;
    let folder = Folder::new();
    let begin = "[model]\nname = \"m\"\n[inputs]\nu = {}\n[locals]\nl0 = \"u\"\n".to_owned();
    let delays = (1..=N).map(|k| format!("l{k} = \"delay(l{}, 0.1, 5)\"\n", k - 1));
    folder.write("delays.toml", begin + &delays.collect::<String>());
    let json = folder
        .pilotage(&["model", "check", "delays.toml", "--json"])
        .json();
    assert_eq!(json["is_linear"], true);
    let poles = json["linear"]["poles"].as_array().unwrap();
    assert_eq!(poles.len(), 5 * N);
    let number = |pole: &serde_json::Value, part: usize| pole[part].as_f64().unwrap();
    for group in poles.chunks(N) {
        for pole in group {
            let error = (number(pole, 0) - number(&group[0], 0)).abs();
            assert!(
                error < 1e-9 * number(pole, 0).abs(),
                "{pole} is not {}",
                group[0]
            );
        }
    }
}

/// The steady state under a force F is F/k, the overshoot exp(-πζ/√(1-ζ²)).
#[test]
fn a_step_response_is_that_of_the_textbook() {
    let ended = folder().pilotage(&[
        "model",
        "step",
        "damped.toml",
        "--size",
        "4",
        "--json",
        "--csv",
        "step.csv",
        "--report",
        "step.html",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let json = ended.json();
    let response = &json["responses"][0];
    let end = response["end"].as_f64().unwrap();
    assert!((end - 0.5).abs() < 1e-3, "{end}");
    let zeta: f64 = 1.6 / (2.0 * 16_f64.sqrt());
    let overshoot = (-std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
    let found = response["overshoot"].as_f64().unwrap();
    assert!((found - overshoot).abs() < 0.01, "{found} {overshoot}");
}

/// A mode that decays within a second beside one of 300 s: poles, and so overshoot and rise, of the textbook.
#[test]
fn a_fast_step_response_beside_a_slow_one_is_resolved() {
    let folder = Folder::new();
    let model = "[model]\nname = \"two\"\n[inputs]\nu = {}\n[states]\ny = { der = \"v\" }\n\
                 v = { der = \"400 * (u - y) - 8 * v\" }\nslow = { der = \"(u - slow) / 300\" }\n\
                 [outputs]\ny = {}\nv = {}\nslow = {}\n";
    folder.write("two.toml", model);
    let ended = folder.pilotage(&["model", "step", "two.toml", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let json = ended.json();
    let number = |k: usize, name: &str| json["responses"][k][name].as_f64();
    let zeta: f64 = 0.2;
    let overshoot = (-std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
    assert!((number(0, "overshoot").unwrap() - overshoot).abs() < 1e-3);
    // `scipy.signal.step` of 400/(s² + 8 s + 400): 0.0602 s; ln 9 time constants of the lag.
    assert!((number(0, "rise_time").unwrap() - 0.0602).abs() < 1e-4);
    assert!((number(2, "rise_time").unwrap() / (300.0 * 9_f64.ln()) - 1.0).abs() < 0.01);
    // The speed has no final value.
    assert_eq!(number(1, "overshoot"), None);
    assert!(number(1, "peak").unwrap() > 10.0);
}

/// The step makes the model a thousand times as fast as it is at its start: `scipy.integrate.solve_ivp` with Radau and
/// rtol 1e-10 rises in 1.1184e-3 s. A square root of a negative number ends the command.
#[test]
fn a_step_response_is_resolved_where_the_step_makes_it_fast() {
    let folder = Folder::new();
    let model = "[model]\nname = \"cubic\"\n[inputs]\nu = {}\n[states]\n\
                 x = { der = \"10 * u - 0.01 * x - 1000 * x^3\" }\n[outputs]\nx = {}\n";
    folder.write("cubic.toml", model);
    let step = [
        "model",
        "step",
        "cubic.toml",
        "--size",
        "100",
        "--json",
        "--stop-time",
        "10",
    ];
    let ended = folder.pilotage(&step);
    assert_eq!(ended.code, 0, "{ended:?}");
    let rise = ended.json()["responses"][0]["rise_time"].as_f64().unwrap();
    assert!((rise / 1.1184e-3 - 1.0).abs() < 0.01, "{rise}");
    let root = "[model]\nname = \"root\"\n[inputs]\nu = {}\n[states]\nx = { der = \"u - x\" }\n[outputs]\n\
                y = { value = \"sqrt(x + 0.2)\" }\n";
    folder.write("root.toml", root);
    let ended = folder.pilotage(&["model", "step", "root.toml", "--size", "-0.9"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    assert!(ended.stderr.contains("`sqrt(x + 0.2)` is NaN"), "{ended:?}");
}

#[test]
fn a_simulation_records_all_signals() {
    let folder = folder();
    let ended = folder.pilotage(&[
        "model",
        "simulate",
        "damped.toml",
        "--stop-time",
        "1",
        "--step",
        "0.5",
        "--set",
        "force=4",
        "-o",
        "r.csv",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let result = folder.read("r.csv");
    let header = result.lines().next().unwrap();
    assert_eq!(
        header,
        "time,damped.force [N],damped.x [m],damped.effort [N],damped.v [m/s],damped.total [N],damped.der(x) [m/s],damped.der(v) [m/s2],damped.time [s]"
    );
    assert_eq!(result.lines().count(), 4);
}

#[test]
fn built_in_models_are_listed_and_shown() {
    let folder = folder();
    let list = folder.pilotage(&["models"]);
    assert_eq!(list.code, 0);
    insta::assert_snapshot!(list.stdout);
    let shown = folder.pilotage(&["models", "show", "linear", "--order", "4"]);
    folder.write("four.toml", &shown.stdout);
    let checked = folder
        .pilotage(&["model", "check", "four.toml", "--json"])
        .json();
    assert_eq!(checked["linear"]["states"].as_array().unwrap().len(), 4);
}

/// Every mistake of use has exit code 2 and says what to do.
#[test]
fn mistakes_of_use_are_told() {
    let folder = folder();
    folder.write(
        "broken.toml",
        DAMPED.replace("- damping * v", "- damping * w"),
    );
    folder.write(
        "trial.csv",
        "time [s],target [m],position [m]\n0,0,0\n1,1,0\n",
    );
    let messages: Vec<String> = [
        &["model", "check", "broken.toml"][..],
        &["model", "check", "nowhere.toml"],
        &["model", "check", "trial.csv"],
        &["model", "check", "crosover"],
        &["model", "check", "crossover", "--order", "2"],
        &["model", "check", "linear", "--order", "13"],
        &["model", "check", "damped.toml", "--order", "2"],
        &["model", "step", "damped.toml", "--input", "forse"],
        &["model", "step", "damped.toml", "--input", "x"],
        &["model", "step", "damped.toml", "--set", "mass=-1"],
        &["model", "step", "damped.toml", "--csv", "damped.toml"],
        &["model", "simulate", "damped.toml", "--set", "mas=1"],
        &["models", "show", "hes"],
        &["export", "broken.toml"],
        &["export", "damped.toml", "-o", "damped.toml"],
        &["export"],
    ]
    .iter()
    .map(|arguments| {
        let ended = folder.pilotage(arguments);
        assert_eq!(ended.code, 2, "{arguments:?} {ended:?}");
        format!("{}\n{}", arguments.join(" "), ended.stderr)
    })
    .collect();
    insta::assert_snapshot!(messages.join("\n"));
    assert_eq!(folder.read("damped.toml"), DAMPED);
    assert_eq!(folder.files(), ["broken.toml", "damped.toml", "trial.csv"]);
}

/// The FMU of a model file holds the file; a start value by a formula follows its parameters unless it is set.
#[test]
fn an_exported_model_holds_its_file_and_starts_by_its_formula() {
    let folder = folder();
    for version in ["2", "3"] {
        let name = format!("damped{version}.fmu");
        let ended = folder.pilotage(&["export", "damped.toml", "--fmi", version, "-o", &name]);
        assert_eq!(ended.code, 0, "{ended:?}");
        let checked = folder.pilotage(&["validate", &name]);
        assert_eq!(checked.code, 0, "{checked:?}");
        let fmu = Fmu::open(&folder.path(&name)).unwrap();
        assert_eq!(fmu.description().model_name, "damped");
    }
    let run = |settings: &[&str]| -> f64 {
        let mut arguments = vec![
            "cosim",
            "damped2.fmu",
            "--stop-time",
            "0.1",
            "--step",
            "0.1",
            "-o",
            "r.csv",
            "--force",
        ];
        for setting in settings {
            arguments.extend(["--set", setting]);
        }
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.code, 0, "{ended:?}");
        let result = folder.read("r.csv");
        let row = result.lines().nth(1).unwrap();
        row.split(',').nth(1).unwrap().parse().unwrap()
    };
    assert_eq!(run(&[]), 1.0);
    assert_eq!(run(&["damped2.length=3"]), 6.0);
    assert_eq!(run(&["damped2.x_start=4", "damped2.length=3"]), 4.0);
    assert_eq!(run(&["damped2.length=3", "damped2.x_start=4"]), 4.0);
}

/// What leaves its domain is named with expression, line and time, and an importer may try again.
#[test]
fn what_is_not_finite_is_named() {
    let folder = Folder::new();
    folder.write(
        "root.toml",
        "[model]\nname = \"root\"\n[states]\nx = { start = 1, der = \"-1 + 1e-9 * log(x)\" }\n[outputs]\ny = \"sqrt(x)\"\n",
    );
    let alone = folder.pilotage(&[
        "model",
        "simulate",
        "root.toml",
        "--stop-time",
        "2",
        "--step",
        "0.1",
    ]);
    assert_eq!(alone.code, 1, "{alone:?}");
    assert_eq!(folder.pilotage(&["export", "root.toml"]).code, 0);
    let fmu = folder.pilotage(&[
        "cosim",
        "root.fmu",
        "--stop-time",
        "2",
        "--step",
        "0.1",
        "--force",
    ]);
    assert_eq!(fmu.code, 1, "{fmu:?}");
    let exchanged = folder.pilotage(&[
        "cosim",
        "root.fmu",
        "--kind",
        "me",
        "--stop-time",
        "2",
        "--step",
        "0.1",
        "--force",
    ]);
    assert_eq!(exchanged.code, 1, "{exchanged:?}");
    insta::assert_snapshot!([alone.stderr, fmu.stderr, exchanged.stderr].join("\n"));
}

/// The last row of a simulation of a model, in columns by name.
fn ended_at(text: &str, stop: &str, column: &str) -> f64 {
    let folder = Folder::new();
    folder.write("model.toml", text);
    let run = [
        "model",
        "simulate",
        "model.toml",
        "--stop-time",
        stop,
        "--step",
        "0.1",
        "-o",
        "r.csv",
    ];
    let ended = folder.pilotage(&run);
    assert_eq!(ended.code, 0, "{ended:?}");
    let result = folder.read("r.csv");
    let header = result.lines().next().unwrap().split(',');
    let place = header.into_iter().position(|name| name == column).unwrap();
    let row = result.lines().last().unwrap();
    row.split(',').nth(place).unwrap().parse().unwrap()
}

/// A step has a slope of 0 on both sides and is no linear function: `ẋ = -sign(x) - x³ 0` comes to 0 in finite time,
/// and `ẋ = if(x > 1, -1, 0)` stays at 1.
#[test]
fn steps_are_not_taken_for_linear() {
    let falls =
        "[model]\nname = \"m\"\n[states]\nx = { start = 1.05, der = \"-0.5 * (1 + sign(x))\" }\n";
    let end = ended_at(falls, "2", "m.x");
    assert!(end.abs() < 1e-6, "{end}");
    let stays = "[model]\nname = \"m\"\n[states]\nx = { start = 2, der = \"if(x > 1, -1, 0)\" }\n";
    let end = ended_at(stays, "3", "m.x");
    assert!((end - 1.0).abs() < 1e-6, "{end}");
}

/// A generator of a signal has neither states nor inputs.
#[test]
fn a_model_without_states_runs_here_and_as_an_fmu() {
    let wave = "[model]\nname = \"m\"\n[parameters]\nw = { start = 2, unit = \"rad/s\" }\n[outputs]\ny = \"sin(w * time)\"\n";
    let end = ended_at(wave, "1", "m.y");
    assert!((end - 2_f64.sin()).abs() < 1e-15, "{end}");
    let folder = Folder::new();
    folder.write("m.toml", wave);
    for version in ["2", "3"] {
        let export = ["export", "m.toml", "--fmi", version, "--force"];
        assert_eq!(folder.pilotage(&export).code, 0);
        let checked = folder.pilotage(&["validate", "m.fmu"]);
        assert_eq!(checked.code, 0, "{checked:?}");
    }
    let states = "[model]\nname = \"m\"\n[states]\nx = { der = 1 }\n";
    folder.write("x.toml", states);
    let linear = folder.pilotage(&["linearize", "x.toml"]);
    assert!(linear.code < 2, "{linear:?}");
}

/// Outputs that are no numbers end a run of a model file as they end one of its FMU.
#[test]
fn outputs_that_are_no_numbers_end_a_run() {
    let folder = Folder::new();
    folder.write(
        "root.toml",
        "[model]\nname = \"root\"\n[inputs]\nu = { start = -1 }\n[outputs]\ny = \"sqrt(u)\"\n",
    );
    for model in ["root.toml", "root.fmu"] {
        let _ = folder.pilotage(&["export", "root.toml", "--force"]);
        let ended = folder.pilotage(&[
            "cosim",
            model,
            "--stop-time",
            "1",
            "--step",
            "0.5",
            "--force",
        ]);
        assert_ne!(ended.code, 0, "{ended:?}");
        let message = "line 6, column 6: `sqrt(u)` is NaN, where u = -1";
        assert!(ended.stderr.contains(message), "{ended:?}");
    }
}

/// At a kink the derivatives to both sides are right: no fault of an FMU.
#[test]
fn a_start_on_a_kink_is_no_fault() {
    let folder = Folder::new();
    for value in [
        "abs(u)",
        "max(u, 0)",
        "sat(u + 1, 1)",
        "deadzone(u - 1, 1)",
        "if(u > 0, u, 3 * u)",
    ] {
        let text =
            format!("[model]\nname = \"kink\"\n[inputs]\nu = 0\n[outputs]\ny = \"{value}\"\n");
        folder.write("kink.toml", text);
        assert_eq!(folder.pilotage(&["export", "kink.toml", "--force"]).code, 0);
        let checked = folder.pilotage(&["validate", "kink.fmu"]);
        assert_eq!(checked.code, 0, "{value}: {checked:?}");
    }
    // Nor is one at the border of its domain, beyond which calls are discarded.
    let tank = "[model]\nname = \"tank\"\n[inputs]\nu = 0\n[states]\nx = { der = \"u - x^1.5\" }\n";
    folder.write("tank.toml", tank);
    assert_eq!(folder.pilotage(&["export", "tank.toml"]).code, 0);
    let checked = folder.pilotage(&["validate", "tank.fmu"]);
    assert_eq!(checked.code, 0, "{checked:?}");
}

/// Turns and radians, kelvin and degrees: what is right passes, what is not does not.
#[test]
fn units_of_turns_and_temperatures() {
    let folder = Folder::new();
    let checked = |unit: &str, value: &str| {
        let text = format!(
            "[model]\nname = \"m\"\n[inputs]\nn = {{ unit = \"rpm\" }}\nf = {{ unit = \"Hz\" }}\nt = {{ unit = \"K\" }}\n\
             c = {{ unit = \"degC\" }}\nv = {{ unit = \"m/s\" }}\n[outputs]\ny = {{ unit = \"{unit}\", value = \"{value}\" }}\n"
        );
        folder.write("m.toml", text);
        folder.pilotage(&["model", "check", "m.toml"]).code
    };
    for (unit, value, code) in [
        ("Hz", "n / 60", 0),
        ("rpm", "60 * f", 0),
        ("rad/s", "2 * pi * f", 0),
        ("rad/s", "n", 2),
        ("degC", "t - 273.15", 0),
        ("K", "c + 273.15", 0),
        ("degC", "273.15 - c", 2),
        ("degC", "-c", 2),
        ("K", "273.15 - t", 0),
        ("K", "c", 2),
        ("degC", "t", 2),
        ("km/h", "3.6 * v", 0),
        ("km/h", "v", 2),
    ] {
        assert_eq!(checked(unit, value), code, "{value} in {unit}");
    }
}

/// `[model]` need not have a line of its own.
#[test]
fn a_model_whose_tables_are_written_inline_becomes_an_fmu() {
    let folder = Folder::new();
    let text = "model = { name = \"lag\" }\ninputs = { u = {} }\nstates = { x = { der = \"u - x\" } }\n\
                outputs.x = {}\n";
    folder.write("lag.toml", text);
    assert_eq!(folder.pilotage(&["export", "lag.toml"]).code, 0);
    let checked = folder.pilotage(&["validate", "lag.fmu"]);
    assert_eq!(checked.code, 0, "{}", checked.stdout);
}

#[test]
fn a_model_of_a_given_order_is_simulated_with_it() {
    let folder = folder();
    for (order, states) in [("2", 2), ("4", 4)] {
        let command = [
            "model",
            "simulate",
            "linear",
            "--order",
            order,
            "--stop-time",
            "1",
            "-o",
            "x.csv",
            "--force",
        ];
        let ended = folder.pilotage(&command);
        assert_eq!(ended.code, 0, "{ended:?}");
        let head = folder.read("x.csv").lines().next().unwrap().to_owned();
        assert_eq!(head.matches(",linear.x").count(), states, "{head}");
    }
    // What follows `--` is of `cosim`: its signals in place of all, its help, its mistakes.
    let more = |words: &[&str]| {
        let fixed = [
            "model",
            "simulate",
            "linear",
            "--stop-time",
            "1",
            "-o",
            "x.csv",
            "--force",
            "--",
        ];
        folder.pilotage(&[&fixed, words].concat())
    };
    assert_eq!(more(&["--record", "linear.x1"]).code, 0);
    assert_eq!(
        folder.read("x.csv").lines().next(),
        Some("time,linear.x1 [1]")
    );
    let help = more(&["--help"]);
    assert!(
        help.code == 0 && help.stdout.contains("Usage: pilotage cosim"),
        "{help:?}"
    );
    let ended = more(&["--bogus"]);
    assert!(
        ended.code == 2
            && ended
                .stderr
                .starts_with("error: unexpected argument '--bogus'"),
        "{ended:?}"
    );
}

/// Dual numbers have no derivative of √u + x by x where u is 0.
#[test]
fn a_slope_that_is_infinite_does_not_hide_those_beside_it() {
    let folder = Folder::new();
    folder.write(
        "root.toml",
        "[model]\nname = \"root\"\n[inputs]\nu = { start = 0 }\n[states]\nx = { start = 1, der = \"u - x\" }\n\
         [outputs]\ny = { value = \"sqrt(u) + x\" }\n",
    );
    assert_eq!(folder.pilotage(&["export", "root.toml"]).code, 0);
    let validated = folder.pilotage(&["validate", "--strict", "root.fmu"]);
    assert_eq!(validated.code, 0, "{validated:?}");
    let ended = folder.pilotage(&[
        "cosim",
        "root.toml",
        "--algorithm",
        "strong",
        "--step",
        "0.1",
        "--stop-time",
        "0.5",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let text = folder.read("result.csv");
    let last = text.lines().last().unwrap().split_once(',').unwrap().1;
    let error = last.parse::<f64>().unwrap() - (-0.5_f64).exp();
    assert!(error.abs() < 1e-7, "{text}");
}
