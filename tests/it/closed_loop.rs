//! The whole loop of exported FMUs: our master against the joint equations.

use crate::command::{Folder, exported};
use crate::joint_ode::Loop;
use pilotage::cosim::{
    Algorithm, Clock, Component, Control, Coupling, Ending, SeriesRecorder, System, fmu_component,
    native_component, run,
};
use pilotage::export::{Export, Provenance};
use pilotage::fmi::InterfaceType;
use pilotage::fmi::description::FmiVersion;
use pilotage::models::{AnyModel, Model, Quadcopter};
use pilotage::series::Series;

/// A pilot who brings the vehicle to its target.
const THETA: [f64; 6] = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];

pub fn folder_with_fmus() -> Folder {
    let folder = Folder::new();
    let provenance = Provenance::fit("nobody.toml".to_owned(), None, None);
    let pilot = Model::pilot(&THETA, 1.0);
    let export = Export::new(&pilot, &provenance);
    export.write(&folder.path("pilot.fmu")).unwrap();
    let (vehicle, provenance) = (
        Model::quadcopter(&Quadcopter::default()),
        Provenance::vehicle(None),
    );
    let export = Export::new(&vehicle, &provenance);
    export.write(&folder.path("quadcopter.fmu")).unwrap();
    folder
}

fn models() -> [Model; 2] {
    [
        Model::pilot(&THETA, 1.0),
        Model::quadcopter(&Quadcopter::default()),
    ]
}

/// Pilot and quadcopter of the folder's FMUs.
fn components(folder: &Folder, kind: InterfaceType) -> [Box<dyn Component>; 2] {
    ["pilot", "quadcopter"].map(|name| {
        let path = folder.path(&format!("{name}.fmu"));
        fmu_component::open(&path, name, Some(kind)).unwrap()
    })
}

fn wired([pilot, quadcopter]: [Box<dyn Component>; 2]) -> System {
    let mut system = System::new();
    system.add("pilot", pilot).unwrap();
    system.add("quadcopter", quadcopter).unwrap();
    system.connect("pilot.stick", "quadcopter.stick").unwrap();
    system.connect("quadcopter.z", "pilot.position").unwrap();
    system.set("pilot.target", "10").unwrap();
    system
}

/// Of the cubic with the exact values and slopes at the ends of each step of `4 k` parts, by how much its mean
/// is wrong, averaged over all steps. The exact mean is by Boole's rule.
fn error_of_cubics(points: &[[f64; 2]], h: f64) -> f64 {
    let steps = points.len() / 4;
    let error = |k: usize| {
        let p = &points[4 * k..=4 * k + 4];
        let weights = [7.0, 32.0, 12.0, 32.0, 7.0].into_iter();
        let exact: f64 = weights.zip(p).map(|(weight, p)| weight / 90.0 * p[0]).sum();
        let cubic = 0.5 * (p[0][0] + p[4][0]) + h / 12.0 * (p[0][1] - p[4][1]);
        (cubic - exact).abs()
    };
    (0..steps).map(error).sum::<f64>() / steps as f64
}

/// Whatever a pilot and a vehicle are exported as, the master gives their inputs lines and sees the slopes of
/// their outputs; and what it says of the inputs' errors is true.
#[test]
fn every_kind_of_fmu_is_coupled_to_a_micrometre_and_says_so() {
    let (h, stop) = (0.05, 15.0);
    let pilot = Loop {
        theta: THETA.to_vec(),
        limit: 1.0,
        target: 10.0,
    };
    let exact = pilot.solve(h / 4.0, stop);
    let signals = [
        ("pilot.stick", exact.iter().map(|p| p.stick).collect()),
        (
            "quadcopter.z",
            exact.iter().map(|p| p.z).collect::<Vec<_>>(),
        ),
    ];
    let folder = Folder::new();
    for version in [FmiVersion::V2, FmiVersion::V3] {
        for (name, model) in ["pilot", "quadcopter"].into_iter().zip(models()) {
            let path = folder.path(&format!("{name}.fmu"));
            let provenance = Provenance::default();
            let export = Export::new(&model, &provenance).version(version);
            export.write(&path).unwrap();
        }
        for kind in [InterfaceType::CoSimulation, InterfaceType::ModelExchange] {
            let clock = Clock::new(0.0, stop, h).unwrap();
            let mut recorder = SeriesRecorder::default();
            let system = wired(components(&folder, kind));
            let run = run(system, &clock, None, Algorithm::Strong, &mut recorder).unwrap();
            assert!(run.report.holding.is_empty());
            let z = &recorder.series.column("quadcopter.z").unwrap().values;
            for (z, exact) in z.iter().zip(exact.iter().step_by(4)) {
                let error = (z - exact.z[0]).abs();
                assert!(error < 1e-6, "FMI {version}, {kind:?}: {error}");
            }
            for connection in &run.report.connections {
                let (_, points) = signals.iter().find(|s| s.0 == connection.from).unwrap();
                let (reported, true_error) =
                    (connection.error.unwrap().mean, error_of_cubics(points, h));
                let ratio = reported / true_error;
                assert!(
                    (0.5..2.0).contains(&ratio),
                    "FMI {version}, {kind:?}, {}: {reported:e}, in truth {true_error:e}",
                    connection.from
                );
            }
        }
    }
}

/// Pilots of order 1 to 3 with all poles at about `-a`, as stiff as a fit may make them, in all four kinds of FMU. The
/// stick of those with a derivative begins with a pulse that is over within microseconds.
#[test]
fn poles_however_fast_are_flown_by_every_kind_of_fmu() {
    let (h, stop) = (0.05, 5.0);
    let folder = Folder::new();
    let [pilot_path, quadcopter_path] = ["pilot.fmu", "quadcopter.fmu"].map(|f| folder.path(f));
    for a in [1e3, 1e6] {
        let (b, c) = (1.3 * a, 1.7 * a);
        let pilots = [
            vec![a, -0.003 * a],
            vec![a * b, a + b, -0.003 * a * b, -0.02 * a * b],
            vec![
                a * b * c,
                a * b + b * c + c * a,
                a + b + c,
                -0.003 * a * b * c,
                -0.02 * a * b * c,
                0.0,
            ],
        ];
        for theta in pilots {
            let pilot = Loop {
                theta: theta.clone(),
                limit: 1.0,
                target: 10.0,
            };
            let exact = pilot.solve(h, stop);
            for version in [FmiVersion::V2, FmiVersion::V3] {
                let models = [
                    (Model::pilot(&theta, 1.0), &pilot_path),
                    (Model::quadcopter(&Quadcopter::default()), &quadcopter_path),
                ];
                for (model, path) in models {
                    let provenance = Provenance::default();
                    let export = Export::new(&model, &provenance).version(version);
                    export.write(path).unwrap();
                }
                for kind in [InterfaceType::CoSimulation, InterfaceType::ModelExchange] {
                    let clock = Clock::new(0.0, stop, h).unwrap();
                    let mut recorder = SeriesRecorder::default();
                    let system = wired(components(&folder, kind));
                    let run = run(system, &clock, None, Algorithm::Strong, &mut recorder).unwrap();
                    let case = format!("{} poles, -{a}, FMI {version}, {kind:?}", theta.len() / 2);
                    assert!(
                        matches!(run.ending, Ending::Completed),
                        "{case}: {:?}",
                        run.ending
                    );
                    let z = &recorder.series.column("quadcopter.z").unwrap().values;
                    let errors = z
                        .iter()
                        .zip(&exact)
                        .map(|(z, exact)| (z - exact.z[0]).abs());
                    let error = errors.fold(0.0, f64::max);
                    assert!(error < 0.02, "{case}: {error}");
                }
            }
        }
    }
}

/// What the native components' convergence to the joint equations shows (`cosim::joint`) then holds for the
/// FMUs.
#[test]
fn fmus_and_native_components_give_the_same_bits() {
    let folder = folder_with_fmus();
    let clock = Clock::new(0.0, 15.0, 0.05).unwrap();
    let controlled = Coupling {
        control: Some(Control::new(1e-6, &clock)),
        ..Algorithm::Strong.into()
    };
    let extrapolated = Coupling {
        extrapolation: Some(2),
        ..Algorithm::GaussSeidel.into()
    };
    for coupling in [
        Algorithm::Jacobi.into(),
        Algorithm::Strong.into(),
        extrapolated,
        controlled,
    ] {
        let both: [[Box<dyn Component>; 2]; 2] = [
            components(&folder, InterfaceType::CoSimulation),
            models().map(|model| native_component::of_model(AnyModel::BuiltIn(model))),
        ];
        let [fmus, natives] = both.map(|components| {
            let mut recorder = SeriesRecorder::default();
            let run = run(
                wired(components),
                &clock,
                Some(1e-9),
                coupling,
                &mut recorder,
            )
            .unwrap();
            assert_eq!(run.report.irrevocable, Vec::<String>::new());
            (run.report.steps, recorder.series)
        });
        assert_eq!(fmus.1.time.len(), 301);
        assert_eq!(fmus.0, natives.0, "{coupling:?}");
        if coupling.control.is_none() {
            assert_eq!(fmus.1, natives.1, "{coupling:?}");
        }
        // An FMU takes a step's length from its own clock, which rounds.
        for (fmu, native) in fmus.1.columns.iter().zip(&natives.1.columns) {
            for (fmu, native) in fmu.values.iter().zip(&native.values) {
                assert!((fmu - native).abs() < 1e-9, "{coupling:?}: {fmu} {native}");
            }
        }
    }
}

/// The same FMUs for model exchange, solved by the master's side: strong coupling goes back and repeats
/// there too, and comes to what the FMUs for co-simulation come to.
#[test]
fn model_exchange_is_coupled_as_tightly() {
    let folder = folder_with_fmus();
    let z = |kind| {
        let system = wired(components(&folder, kind));
        let clock = Clock::new(0.0, 5.0, 0.05).unwrap();
        let mut recorder = SeriesRecorder::default();
        let run = run(system, &clock, Some(1e-9), Algorithm::Strong, &mut recorder).unwrap();
        assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
        assert_eq!(run.report.irrevocable, Vec::<String>::new());
        assert_eq!(run.report.steps.unconverged, 0);
        recorder.series.column("quadcopter.z").unwrap().values[100]
    };
    let (exchange, co_simulation) = (
        z(InterfaceType::ModelExchange),
        z(InterfaceType::CoSimulation),
    );
    let difference = (exchange - co_simulation).abs();
    assert!(difference < 1e-8, "{exchange} {co_simulation}");
}

/// What `--details` says in words; times and errors are numbers that the tests of the master check.
#[test]
fn the_report_tells_lag_error_calls_and_times() {
    let folder = folder_with_fmus();
    let report = |arguments: &[&str]| {
        let mut all = vec!["cosim", "pilot.fmu", "quadcopter.fmu"];
        all.extend(["--connect", "pilot.stick=quadcopter.stick"]);
        all.extend([
            "--connect",
            "quadcopter.z=pilot.position",
            "--set",
            "pilot.target=10",
        ]);
        all.extend([
            "--stop-time",
            "1",
            "--step",
            "0.05",
            "-o",
            "result.csv",
            "--details",
        ]);
        all.extend(arguments);
        let ended = folder.pilotage(&all);
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
        ended.stdout
    };
    let text = report(&[]);
    for line in [
        "20 communication steps of 0.050000 to 0.050000 s, 0 rejected, 0 corrections, 0 matrices",
        "pilot.stick -> quadcopter.stick: held, lag 0.025000 s, error ",
        "quadcopter.z -> pilot.position: held, lag 0.025000 s, error ",
        "pilot: 20 set, 20 step, 21 get, 0 save, 0 restore, ",
        "master and recorder: ",
    ] {
        assert!(text.contains(line), "no `{line}` in\n{text}");
    }
    let text = report(&["--algorithm", "strong", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let report = &json["report"];
    assert_eq!(report["steps"]["accepted"], 20);
    assert_eq!(report["steps"]["unconverged"], 0);
    assert_eq!(report["irrevocable"].as_array().unwrap().len(), 0);
    for connection in report["connections"].as_array().unwrap() {
        assert_eq!(connection["transfer"], "interpolated");
        assert_eq!(connection["lag"], 0.0);
        assert!(
            connection["error"]["max"].as_f64().unwrap() < 1e-3,
            "{connection}"
        );
    }
    let restores = &report["slaves"][0]["calls"]["restore"];
    assert!(restores.as_u64().unwrap() > 20, "{report}");
}

/// The page of a co-simulation: its signals, grouped by unit, and what the master tells.
#[test]
fn the_page_of_a_co_simulation_shows_signals_connections_and_origin() {
    let folder = folder_with_fmus();
    let run = |output: &str| {
        let wires = "--connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position";
        let rest = "--set pilot.target=10 --stop-time 1 --step 0.05 --report run.html -o";
        let command = format!("cosim pilot.fmu quadcopter.fmu {wires} {rest} {output}");
        let arguments: Vec<&str> = command.split(' ').collect();
        folder.pilotage_with(&arguments, &[("SOURCE_DATE_EPOCH", "951782400")])
    };
    let ended = run("result.csv");
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let page = folder.read("run.html");
    let [stick, z] = ["pilot.stick", "quadcopter.z"].map(|name| {
        let series = Series::read_table(&folder.path("result.csv")).unwrap();
        *series.column(name).unwrap().values.last().unwrap()
    });
    assert!(stick != 0.0 && z != 0.0);
    for part in [
        "<p class=\"verdict good\">completed</p>",
        "<dt>communication steps</dt><dd>20</dd>",
        "<h2>pilot.stick</h2>",
        "<h2>Signals in m</h2>",
        "\"label\":\"quadcopter.z\"",
        "<td>pilot.stick</td><td>quadcopter.stick</td><td>held</td><td class=\"n\">0.0250</td>",
        "<td>master and result</td>",
        "<td>pilot.fmu</td><td><code>",
        "2000-02-29 00:00 UTC",
        "--set pilot.target=10 --stop-time 1 --step 0.05 --report run.html -o result.csv</code>",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // Eight outputs with six units.
    assert_eq!(page.matches("<figure>").count(), 6);
    assert_eq!(page.matches("\"look\":\"line\"").count(), 8);
    let ended = run("/dev/null");
    assert_eq!(
        (ended.code, ended.stderr.as_str()),
        (
            2,
            "error: --report draws what the result holds, and nothing can be read back from /dev/null\n\
             hint: give the result a file with -o\n"
        )
    );
}

#[test]
fn exported_fmus_are_valid_and_run() {
    let folder = folder_with_fmus();
    let ended = folder.pilotage(&["validate", "pilot.fmu", "quadcopter.fmu"]);
    assert_eq!(
        ended.stdout,
        "pilot.fmu: valid, and runs\nquadcopter.fmu: valid, and runs\n"
    );
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
}

/// 200 FMUs in one system, 100 loops: the first flies as it does alone, to the last bit.
#[test]
fn two_hundred_fmus_in_one_system() {
    let folder = exported();
    let fly = |loops: usize, output: &str| {
        let mut arguments: Vec<String> = vec!["cosim".into()];
        for k in 0..loops {
            arguments.extend([format!("p{k}=pilot.fmu"), format!("q{k}=quadcopter.fmu")]);
            for wire in [
                format!("p{k}.stick=q{k}.stick"),
                format!("q{k}.z=p{k}.position"),
            ] {
                arguments.extend(["--connect".into(), wire]);
            }
            arguments.extend(["--set".into(), format!("p{k}.target={}", 10 + k)]);
        }
        let rest = ["--stop-time", "1", "--step", "0.05", "-o", output];
        arguments.extend(rest.map(str::to_owned));
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        folder.read(output)
    };
    let (alone, many) = (fly(1, "alone.csv"), fly(100, "many.csv"));
    assert_eq!(many.lines().next().unwrap().split(',').count(), 1 + 100 * 8);
    assert_eq!(alone.lines().count(), many.lines().count());
    for (alone, many) in alone.lines().zip(many.lines()) {
        assert!(many.starts_with(&format!("{alone},")), "{alone}");
    }
}
