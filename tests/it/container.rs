//! `pilotage container`: one FMU of a system gives what `cosim` gives of its parts, to the last bit.

use crate::command::{CONNECTIONS, Folder, example, exported};
use crate::foreign;
use pilotage::fmi::description::{Causality, Variability};

/// A gain with a lag: the output depends on the input at once, and on a state.
fn gain(name: &str, gain: f64) -> String {
    format!(
        "[model]\nname = \"{name}\"\ndescription = \"A gain with a lag\"\n\
         [inputs]\nu = {{ unit = \"m\" }}\nd = {{ unit = \"m\", description = \"From outside\" }}\n\
         [parameters]\nk = {{ start = {gain}, unit = \"1\", description = \"Its gain\" }}\n\
         [states]\nx = {{ unit = \"m\", start = 1, der = \"(u - x) / (2 unit(s))\" }}\n\
         [outputs]\ny = {{ unit = \"m\", value = \"k * u + x / 4 + d\" }}\n"
    )
    .replace("(2 unit(s))", "tau")
    .replace("[states]", "tau = { start = 2, unit = \"s\" }\n[states]")
}

/// Three gains in a loop of outputs that depend on inputs at once.
const LOOP: [&str; 6] = [
    "--connect",
    "a.y=b.u",
    "--connect",
    "b.y=c.u",
    "--connect",
    "c.y=a.u",
];

fn done(folder: &Folder, arguments: &[&str]) -> String {
    let ended = folder.pilotage(arguments);
    assert_eq!(ended.code, 0, "{arguments:?}: {}", ended.stderr);
    ended.stdout
}

/// The columns of a result by name, without units; `prefix` is left out.
fn columns(folder: &Folder, file: &str, prefix: &str) -> Vec<(String, Vec<f64>)> {
    let text = folder.read(file);
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',');
    let mut columns: Vec<(String, Vec<f64>)> = names
        .map(|name| {
            let name = name.split(" [").next().unwrap();
            let name = name.strip_prefix(prefix).unwrap_or(name);
            (name.to_owned(), Vec::new())
        })
        .collect();
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.1.push(cell.parse().unwrap());
        }
    }
    columns.sort_by(|a, b| a.0.cmp(&b.0));
    columns
}

/// Whether two results have the same names and numbers, to within a difference.
fn assert_near(a: &[(String, Vec<f64>)], b: &[(String, Vec<f64>)], within: f64) {
    let names =
        |own: &[(String, Vec<f64>)]| own.iter().map(|own| own.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(a), names(b));
    assert!(a[0].1.len() > 10);
    for ((name, a), (_, b)) in a.iter().zip(b) {
        assert_eq!(a.len(), b.len(), "{name}");
        for (row, (a, b)) in a.iter().zip(b).enumerate() {
            assert!(
                (a - b).abs() <= within * (1.0 + b.abs()),
                "{name}[{row}]: {a} {b}"
            );
        }
    }
}

/// Makes a container of a system, and runs both.
fn assert_same(folder: &Folder, system: &[&str], coupling: &[&str], fmi: &str) {
    let (step, stop) = ("0.05", "3");
    let common = [system, coupling, &["--step", step]].concat();
    done(
        folder,
        &[
            &["cosim"],
            &common[..],
            &["--stop-time", stop, "-o", "parts.csv"],
        ]
        .concat(),
    );
    let made = ["--fmi", fmi, "-o", "one.fmu", "--force"];
    done(folder, &[&["container"], &common[..], &made].concat());
    let run = [
        "cosim",
        "one.fmu",
        "--step",
        step,
        "--stop-time",
        stop,
        "-o",
        "one.csv",
    ];
    done(folder, &run);
    let one = columns(folder, "one.csv", "one.");
    let mut parts = columns(folder, "parts.csv", "");
    // Inputs that tables feed are in the result of the parts alone.
    parts.retain(|(name, _)| one.iter().any(|own| own.0 == *name));
    assert_near(&one, &parts, 0.0);
    let checked = folder.pilotage(&["validate", "one.fmu"]);
    assert_eq!(checked.code, 0, "{}\n{}", checked.stdout, checked.stderr);
}

fn gains() -> Folder {
    let folder = Folder::new();
    for (name, k) in [("a", -0.5), ("b", 0.7), ("c", 0.9)] {
        folder.write(&format!("{name}.toml"), gain(name, k));
        done(
            &folder,
            &[
                "export",
                &format!("{name}.toml"),
                "-o",
                &format!("{name}.fmu"),
            ],
        );
    }
    folder
}

#[test]
fn pilot_and_vehicle() {
    let folder = exported();
    let fmus = ["pilot.fmu", "quadcopter.fmu", "--set", "pilot.target=10"];
    let system = [&fmus[..], &CONNECTIONS].concat();
    for (coupling, fmi) in [
        (&["--algorithm", "strong"][..], "2"),
        (&["--algorithm", "strong", "--tolerance", "1e-4"], "3"),
        (&["--extrapolation", "1", "--parts", "quadcopter=2"], "2"),
    ] {
        assert_same(&folder, &system, coupling, fmi);
    }
}

#[test]
fn an_algebraic_loop_of_three_and_native_models() {
    let folder = gains();
    let fmus = [&["a.fmu", "b.fmu", "c.fmu", "--set", "b.d=0.3"], &LOOP[..]].concat();
    assert_same(&folder, &fmus, &["--algorithm", "strong"], "3");
    let native = [
        &["a.toml", "b.fmu", "c.toml", "--set", "c.k=0.8"],
        &LOOP[..],
    ]
    .concat();
    assert_same(&folder, &native, &["--algorithm", "gauss-seidel"], "2");
    assert_same(&folder, &native, &["--algorithm", "strong"], "2");
}

#[test]
fn systems_in_files_with_tables() {
    let folder = Folder::new();
    let hover = example("systems/hover.toml").display().to_string();
    assert_same(&folder, &[&hover], &["--algorithm", "strong"], "2");
    let fmus = gains();
    let system = "[system.a]\nmodel = \"a.fmu\"\nset = { d = 0.2 }\n[system.b]\nmodel = \"b.fmu\"\n\
                  [connect]\n\"a.y\" = { to = \"b.u\", factor = 0.5, offset = 0.1 }\n\"b.y\" = \"a.u\"\n";
    fmus.write("s.toml", system);
    done(&fmus, &["convert", "s.toml", "s.ssp"]);
    assert_same(&fmus, &["s.ssp"], &[], "3");
}

/// A container is a part like others: of a system, of another container, and with a master that goes back.
#[test]
fn containers_in_systems_and_in_containers() {
    let folder = gains();
    let two = [
        "a.fmu",
        "b.toml",
        "--connect",
        "a.y=b.u",
        "--algorithm",
        "strong",
        "--step",
        "0.05",
    ];
    done(
        &folder,
        &[&["container"], &two[..], &["-o", "two.fmu"]].concat(),
    );
    let system = [
        "two.fmu",
        "c.fmu",
        "--connect",
        "two.b.y=c.u",
        "--connect",
        "c.y=two.a.u",
    ];
    for algorithm in ["jacobi", "gauss-seidel", "strong"] {
        assert_same(&folder, &system, &["--algorithm", algorithm], "2");
    }
}

/// The state of a container as bytes, in the middle of a run with strong coupling.
#[test]
fn a_run_goes_on_from_the_state_of_a_container() {
    let folder = gains();
    let system = [&["container", "a.fmu", "b.toml", "c.fmu"], &LOOP[..]].concat();
    let strong = ["--algorithm", "strong", "--step", "0.05", "-o", "one.fmu"];
    done(&folder, &[&system[..], &strong].concat());
    let run = ["cosim", "one.fmu", "--step", "0.05", "--stop-time", "3"];
    done(
        &folder,
        &[
            &run[..],
            &["-o", "whole.csv", "--save-state", "1.5=s.state"],
        ]
        .concat(),
    );
    let rest = [
        "cosim",
        "one.fmu",
        "--from-state",
        "s.state",
        "--stop-time",
        "3",
        "-o",
        "rest.csv",
    ];
    done(&folder, &rest);
    let (whole, rest) = (folder.read("whole.csv"), folder.read("rest.csv"));
    let (whole, rest): (Vec<&str>, Vec<&str>) = (whole.lines().collect(), rest.lines().collect());
    assert_eq!(rest.len(), 32);
    assert_eq!(rest[1..], whole[31..]);
}

#[test]
fn steps_of_the_importer_are_multiples_or_cut() {
    let folder = gains();
    let system = [
        &["a.fmu", "b.toml", "c.fmu"],
        &LOOP[..],
        &["--algorithm", "strong"],
    ]
    .concat();
    let made = ["--step", "0.05", "-o", "one.fmu"];
    done(&folder, &[&["container"], &system[..], &made].concat());
    for (importer, own, within) in [("0.1", "0.05", 0.0), ("0.025", "0.025", 1e-9)] {
        let time = ["--stop-time", "3", "--record-every", "0.1"];
        let one = ["cosim", "one.fmu", "--step", importer, "-o", "one.csv"];
        done(&folder, &[&one[..], &time].concat());
        let parts = ["--step", own, "-o", "parts.csv"];
        done(&folder, &[&["cosim"], &system[..], &parts, &time].concat());
        let parts = columns(&folder, "parts.csv", "");
        assert_near(&columns(&folder, "one.csv", "one."), &parts, within);
    }
}

#[test]
fn its_description_has_what_the_parts_have() {
    let folder = gains();
    folder.write("good.fmu", foreign::fmu("good"));
    let system = [
        "a.toml",
        "good.fmu",
        "--connect",
        "a.y=good.u",
        "--set",
        "a.k=0.25",
    ];
    let made = ["--step", "0.1", "--outputs", "good.*,a.x", "-o", "one.fmu"];
    done(&folder, &[&["container"], &system[..], &made].concat());
    let fmu = pilotage::fmi::Fmu::open(&folder.path("one.fmu")).unwrap();
    let description = fmu.description();
    let of = |causality| -> Vec<&str> {
        let all = description.variables.iter();
        let own = all.filter(|own| own.causality == causality);
        own.map(|own| own.name.as_str()).collect()
    };
    let inputs = ["a.u", "a.d", "good.n_in", "good.flag_in", "good.text_in"];
    assert_eq!(of(Causality::Input), inputs);
    assert_eq!(
        of(Causality::Parameter),
        ["a.k", "a.tau", "a.x_start", "good.k"]
    );
    let outputs = [
        "good.y",
        "good.tolerance",
        "good.start",
        "good.stop",
        "good.n",
        "good.flag",
        "a.x",
    ];
    assert_eq!(of(Causality::Output), outputs);
    let (_, k) = description.variable("a.k").unwrap();
    assert_eq!(k.description.as_deref(), Some("Its gain"));
    assert_eq!(k.variability, Variability::Fixed);
    let xml = String::from_utf8(
        pilotage::fmi::archive::Archive::open(&folder.path("one.fmu"), Default::default())
            .unwrap()
            .read("modelDescription.xml")
            .unwrap(),
    )
    .unwrap();
    assert!(xml.contains("unit=\"1\" start=\"0.25\""), "{xml}");
    let cs = description.co_simulation.as_ref().unwrap();
    assert!(cs.can_handle_variable_communication_step_size && cs.can_get_and_set_fmu_state);
    // The foreign FMU does not say that it writes its state.
    assert!(!cs.can_serialize_fmu_state);
}

#[test]
fn mistakes_are_said_before_anything_is_written() {
    let folder = gains();
    for (arguments, words) in [
        (
            &["a.toml"][..],
            "error: no --step, and the FMUs suggest none\nhint: say the communication step",
        ),
        (
            &["a.toml", "--step", "0.1", "--outputs", "a.z"],
            "error: no variable is named like `a.z`",
        ),
        (
            &["a.toml", "--step", "0.1", "--outputs", "a.k"],
            "error: no output or local is named like a.k",
        ),
        (
            &["a.toml", "--step", "0.1", "--isolate", "all"],
            "error: --isolate is not for `container`",
        ),
        (
            &["a.toml", "--step", "1e-300"],
            "error: steps of 1e-300 s are too short",
        ),
        (
            &["a.toml", "--step", "0.1", "--parallel"],
            "error: --parallel is not for `container`",
        ),
        (
            &["a.toml", "--step", "0.1", "--connect", "a.y=a.z"],
            "error: ",
        ),
        (&["nowhere.fmu", "--step", "0.1"], "error: "),
        (
            &[
                "a.toml",
                "b.toml",
                "--connect",
                "a.y=b.u",
                "--connect",
                "b.y=a.u",
                "--set",
                "a.k=1",
                "--set",
                "b.k=1",
                "--step",
                "0.1",
            ],
            "error: the initial values of ",
        ),
        (&["a.toml", "--step", "0.1", "-o", "a.toml"], "error: "),
    ] {
        let ended = folder.pilotage(&[&["container"], arguments].concat());
        assert_eq!(ended.code, 2, "{arguments:?} {}", ended.stderr);
        assert!(
            ended.stderr.starts_with(words),
            "{arguments:?} {}",
            ended.stderr
        );
        assert!(!folder.path("container.fmu").exists(), "{arguments:?}");
    }
}

/// Faults of a part have its name, whoever runs the container.
#[test]
fn what_a_part_does_and_says_has_its_name() {
    for (behaviour, code, words) in [
        ("error@1", 1, "`error`"),
        ("discard@1", 1, "`discard`"),
        ("end@1", 0, "end"),
        ("warn", 0, "`warn`"),
    ] {
        let folder = Folder::new();
        let name = behaviour.split('@').next().unwrap();
        folder.write(&format!("{name}.fmu"), foreign::fmu(behaviour));
        let made = [
            "container",
            &format!("{name}.fmu"),
            "--step",
            "0.5",
            "-o",
            "one.fmu",
        ];
        done(&folder, &made);
        let ended = folder.pilotage(&["cosim", "one.fmu", "--step", "0.5", "--stop-time", "2"]);
        assert_eq!(ended.code, code, "{behaviour}: {ended:?}");
        let said = format!("{}{}", ended.stdout, ended.stderr);
        assert!(said.contains(words), "{behaviour}: {said}");
    }
}
