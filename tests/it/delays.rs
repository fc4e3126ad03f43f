//! Delays without an order, as the commands tell of them.

use crate::command::Folder;

/// The delayed integral of 2 t, (t - τ)², beside what no model has in it.
pub fn folder() -> Folder {
    let folder = Folder::new();
    folder.write(
        "m.toml",
        "[model]\nname = \"m\"\n[parameters]\ntau = { start = 0.5, unit = \"s\", min = 0.05, max = 2 }\n\
         [states]\na.der = \"2 * time\"\n[outputs]\ny.value = \"delay(a, tau)\"\n",
    );
    for (file, phase) in [("one.csv", 0.0), ("two.csv", 1.0)] {
        let row = |k: u32| {
            let t = 0.05 * f64::from(k);
            let y = (t - 0.8).max(0.0).powi(2) + 0.01 * (100.0 * t * t + phase).sin();
            format!("{t},{y}\n")
        };
        let rows: String = (0..=100).map(row).collect();
        folder.write(file, "time,y\n".to_owned() + &rows);
    }
    folder.write(
        "p.toml",
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.y\"\ncolumn = \"y\"\n[parameters]\n\"m.tau\" = {}\n\
         [[run]]\nfile = \"one.csv\"\n[[run]]\nfile = \"two.csv\"\nuse = \"validation\"\n[fit]\nstarts = 1\n",
    );
    folder
}

/// Text and JSON say the order; validation runs have the same, and so have fits of parts.
#[test]
fn a_fit_says_the_order_of_its_delays() {
    let folder = folder();
    let found = folder.pilotage(&["fit", "p.toml", "--json"]);
    assert_eq!(found.code, 0, "{found:?}");
    let found = found.json();
    let own = &found["delays"];
    let order = own["order"].as_u64().unwrap();
    assert!(
        order > 2 && own["before"].as_u64().unwrap() < order,
        "{own}"
    );
    assert!(
        own["moved"].as_f64().unwrap() < 0.1 && own["enough"] == true,
        "{own}"
    );
    assert_eq!(own["parameter"], "m.tau");
    let tau = &found["parameters"]["m.tau"];
    assert!(
        (tau["value"].as_f64().unwrap() - 0.8).abs() < 2.0 * tau["sd"].as_f64().unwrap(),
        "{tau}"
    );
    // Both runs are followed as closely.
    let rms = |k: usize| found["runs"][k]["measured"]["y"]["rms_residual"].as_f64();
    let (fitted, judged) = (rms(0).expect("of the fit"), rms(1).expect("of validation"));
    assert!(judged < 1.3 * fitted, "{fitted}, {judged}");
    let text = folder.pilotage(&["fit", "p.toml", "--force"]);
    let words = format!("Padé's approximation of order {order}: from order");
    assert!(text.stdout.contains(&words), "{text:?}");
    // Where it is given nothing is said.
    let given = folder.read("m.toml").replace("(a, tau)", "(a, tau, 3)");
    folder.write("m.toml", given);
    let given = folder.pilotage(&["fit", "p.toml", "--json", "--force"]);
    assert!(given.json()["delays"].is_null(), "{given:?}");
}

/// A lag behind a delay of an input that steps at 0, and a delay of that lag: in `model simulate`, and as FMUs of both versions, which
/// are valid. An importer that solves the equations has an approximation.
#[test]
fn simulations_and_fmus_have_exact_delays() {
    let folder = Folder::new();
    folder.write(
        "m.toml",
        "[model]\nname = \"m\"\n[inputs]\nu = 0\n[parameters]\ntau = { start = 0.3, unit = \"s\" }\n\
         [states]\nx.der = \"(delay(u, tau) - x) / 0.2\"\n[outputs]\ny.value = \"delay(x, 2 * tau)\"\n",
    );
    let run = |words: &str| {
        let ended = folder.pilotage(&words.split(' ').collect::<Vec<_>>());
        assert_eq!(ended.code, 0, "{words}: {ended:?}");
    };
    let ends = |column: &str| -> [f64; 2] {
        let text = folder.read("r.csv");
        let rows: Vec<Vec<&str>> = text.lines().map(|row| row.split(',').collect()).collect();
        let is_it = |name: &&str| name.split(' ').next().unwrap().ends_with(column);
        let place = rows[0].iter().position(is_it).expect("a column");
        let last = rows.last().unwrap();
        [0, place].map(|k| last[k].parse().unwrap())
    };
    let exact = |t: f64| 1.0 - (-(t - 0.9) / 0.2).exp();
    let off = || {
        let [t, y] = ends("y");
        (y - exact(t)).abs()
    };
    // A delay shorter than the step, and longer ones.
    for step in ["0.7", "0.1", "0.05"] {
        run(&format!(
            "model simulate m.toml --set u=1 --stop-time 1.4 --step {step} -o r.csv --force"
        ));
        assert!(off() < 1e-8, "{step}: {}", off());
    }
    for version in ["2", "3"] {
        run(&format!("export m.toml -o m{version}.fmu --fmi {version}"));
        run(&format!("validate m{version}.fmu"));
        for step in ["0.7", "0.1"] {
            let words = format!(
                "cosim m{version}.fmu --set u=1 --stop-time 1.4 --step {step} -o r.csv --force"
            );
            run(&words);
            assert!(off() < 1e-8, "{version}, {step}: {}", off());
            run(&(words + " --kind me"));
            assert!((1e-4..0.1).contains(&off()), "{version}, {step}: {}", off());
        }
    }
}

/// The loop K e^(-jωτ)/(jω): crossover K, margins 90° - K τ and π/(2 K τ), of a model file; an FMU has an approximation of order 2.
#[test]
fn loops_have_delays_as_they_are() {
    let folder = Folder::new();
    folder.write(
        "pilot.toml",
        "[model]\nname = \"pilot\"\n[inputs]\nerror = 0\n[parameters]\ntau = { start = 0.4, unit = \"s\" }\n\
         [outputs]\nstick.value = \"1.5 * delay(-error, tau)\"\n",
    );
    folder.write(
        "vehicle.toml",
        "[model]\nname = \"vehicle\"\n[inputs]\nstick = 0\n[states]\nz.der = \"stick\"\n[outputs]\nplace.value = \"z\"\n",
    );
    let found = |pilot: &str| {
        let words = format!(
            "linearize {pilot} vehicle.toml --connect pilot.stick=vehicle.stick --connect vehicle.place=pilot.error \
             --loop pilot.stick=vehicle.stick --json"
        );
        let ended = folder.pilotage(&words.split(' ').collect::<Vec<_>>());
        assert_eq!(ended.code, 0, "{ended:?}");
        let own = ended.json()["loops"][0].clone();
        let number = |list: &str, key: &str| own[list][0][key].as_f64().unwrap();
        [
            number("gainCrossings", "frequency"),
            number("gainCrossings", "phaseMargin"),
            number("phaseCrossings", "gainMargin"),
        ]
    };
    let pi = std::f64::consts::PI;
    let exact = [1.5, pi / 2.0 - 0.6, pi / 1.2];
    let [file, fmu] = ["pilot.toml", "pilot.fmu"].map(|name| {
        if name.ends_with("fmu") {
            assert_eq!(
                folder
                    .pilotage(&["export", "pilot.toml", "-o", "pilot.fmu"])
                    .code,
                0
            );
        }
        let found = found(name);
        [0, 1, 2].map(|k| (found[k] - exact[k]).abs())
    });
    assert!(file.iter().all(|off| *off < 1e-9), "{file:?}");
    assert!(
        fmu[2] > 0.01 && fmu.iter().all(|off| *off < 0.05),
        "{fmu:?}"
    );
}
