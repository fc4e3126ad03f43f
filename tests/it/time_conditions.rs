//! A pulse between all steps and samples, in every way in which a model file is simulated: by itself, as an FMU of both versions
//! and both kinds, and evaluated in a problem.

use crate::command::Folder;

const MODEL: &str = "[model]\nname = \"m\"\n[parameters]\nk = 0.02\nbegin = 61.23\n[states]\n\
                     x = { start = 1, der = \"-k * x + if(time > begin, if(time < begin + 0.02, 50, 0), 0)\" }\n";

/// `∫ 50 e^(-k (t - s)) ds` over the pulse, beside the decay from 1.
fn solution(t: f64) -> f64 {
    let k: f64 = 0.02;
    let step = |from: f64| 50.0 / k * (1.0 - (-k * (t - from).max(0.0)).exp());
    (-k * t).exp() + step(61.23) - step(61.25)
}

/// The last `x` of a result.
fn last(folder: &Folder, result: &str) -> f64 {
    let text = folder.read(result);
    let (header, end) = (text.lines().next().unwrap(), text.lines().last().unwrap());
    let place = header
        .split(',')
        .position(|name| name.split(' ').next().unwrap().ends_with(".x"));
    let cell = end.split(',').nth(place.unwrap()).unwrap();
    cell.parse().unwrap()
}

#[test]
fn a_pulse_between_steps_is_met_by_simulations_and_fmus() {
    let folder = Folder::new();
    folder.write("m.toml", MODEL);
    let ended = folder.pilotage(&[
        "model",
        "simulate",
        "m.toml",
        "--stop-time",
        "100",
        "--step",
        "10",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!((last(&folder, "result.csv") - solution(100.0)).abs() < 1e-8);
    for version in ["2", "3"] {
        let fmu = format!("m{version}.fmu");
        let ended = folder.pilotage(&["export", "m.toml", "--fmi", version, "-o", &fmu]);
        assert_eq!(ended.code, 0, "{ended:?}");
        assert_eq!(folder.pilotage(&["validate", &fmu]).code, 0);
        for kind in ["cs", "me"] {
            let result = format!("{kind}{version}.csv");
            let own = format!("m={fmu}");
            let ended = folder.pilotage(&[
                "cosim",
                &own,
                "--kind",
                kind,
                "--stop-time",
                "100",
                "--step",
                "10",
                "--record",
                "m.*",
                "-o",
                &result,
            ]);
            assert_eq!(ended.code, 0, "{ended:?}");
            let error = last(&folder, &result) - solution(100.0);
            assert!(error.abs() < 1e-5, "{kind} {version}: {error:e}");
        }
    }
}

#[test]
fn a_pulse_between_samples_is_evaluated() {
    let folder = Folder::new();
    folder.write("m.toml", MODEL);
    let rows = (0..11).map(|n| format!("{},{}\n", 10 * n, solution(10.0 * f64::from(n))));
    folder.write(
        "run.csv",
        "time [s],x\n".to_owned() + &rows.collect::<String>(),
    );
    folder.write(
        "problem.toml",
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n[parameters]\n\"m.k\" = {}\n\
         [[run]]\nfile = \"run.csv\"\n",
    );
    let json = folder
        .pilotage(&["fit", "problem.toml", "--evaluate", "--json"])
        .json();
    assert!(json["objective"].as_f64().unwrap() < 1e-9, "{json}");
    assert_eq!(json["early_end"], serde_json::Value::Null);
}

/// A solution that is infinite at 2.5 s has no objective beyond, and says so.
#[test]
fn an_evaluation_without_a_simulation_is_no_answer() {
    let folder = Folder::new();
    folder.write(
        "m.toml",
        "[model]\nname = \"m\"\n[parameters]\nk = 0.4\n[states]\nx = { start = 1, der = \"k * x^2\" }\n",
    );
    folder.write("run.csv", "time [s],x\n0,1\n1,1.7\n2,5\n3,6\n");
    folder.write(
        "problem.toml",
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n[parameters]\n\"m.k\" = {}\n\
         [[run]]\nfile = \"run.csv\"\n",
    );
    let ended = folder.pilotage(&["fit", "problem.toml", "--evaluate"]);
    assert_eq!(ended.code, 1);
    let expected = "no objective at the start values: the simulation of run.csv ends at 2 s, since it grows without bound or takes \
                    too many steps; start elsewhere\n";
    assert!(ended.stdout.starts_with(expected), "{ended:?}");
}
