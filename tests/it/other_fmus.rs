//! FMUs with traits that those of other tools have: what works in fmpy works here.

use crate::command::Folder;
use crate::foreign::{self, archive, fmu_of};

const RUN: [&str; 6] = ["cosim", "a.fmu", "b.fmu", "--stop-time", "1", "--step"];

/// Two foreign FMUs of FMI 2.0.
fn two() -> Folder {
    let folder = Folder::new();
    for name in ["a.fmu", "b.fmu"] {
        folder.write(name, foreign::fmu("good"));
    }
    folder
}

/// The values of a column of `result.csv`.
fn column(folder: &Folder, name: &str) -> Vec<f64> {
    let text = folder.read("result.csv");
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let header = rows.next().unwrap();
    let at = header.split(',').position(|cell| cell == name);
    let at = at.unwrap_or_else(|| panic!("no {name} in {header}"));
    rows.map(|row| row.split(',').nth(at).unwrap().parse().unwrap())
        .collect()
}

/// The foreign FMU's integer and boolean outputs are one more than, and the opposite of, its inputs.
#[test]
fn integers_and_booleans_feed_other_types() {
    let folder = two();
    let wires = ["0.5", "--connect", "a.n=b.u", "--connect", "a.flag=b.n_in"];
    let ended = folder.pilotage(&[&RUN[..], &wires, &["--set", "a.n_in=4"]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    // u is 0 in the first step and 5 in the second: y = 5 (1 - exp(-h)).
    let y = column(&folder, "b.y [m]");
    assert!(
        (y[2] - 5.0 * (1.0 - (-0.5_f64).exp())).abs() < 1e-12,
        "{y:?}"
    );
    assert_eq!(column(&folder, "b.n"), [0.0, 1.0, 2.0]);
}

#[test]
fn reals_feed_integers_while_they_are_whole() {
    let folder = two();
    let wires = ["0.5", "--connect", "a.y=b.n_in"];
    let ended = folder.pilotage(&[&RUN[..], &wires].concat());
    assert_eq!(ended.code, 0, "y stays 0: {ended:?}");
    let ended = folder.pilotage(&[&RUN[..], &wires, &["--set", "a.u=1"]].concat());
    assert_eq!(ended.code, 1, "{ended:?}");
    let why = "`a.y` -> `b.n_in`: 0.3934693402873666 is no whole number that an Integer can hold";
    assert!(ended.stderr.contains(why), "{ended:?}");
}

/// The foreign FMU of FMI 3.0 with other names for an input, an output and a parameter.
fn with_aliases() -> Vec<u8> {
    let mut xml = include_str!("foreign/fmi3.xml").to_owned();
    for (name, alias) in [("u", "plant.u"), ("y", "plant.x[1]"), ("k", "gain")] {
        let begin = xml.find(&format!("<Float64 name=\"{name}\"")).unwrap();
        let end = begin + xml[begin..].find("/>").unwrap();
        let inner = format!("><Alias name=\"{alias}\" description=\"as in the model\"/></Float64>");
        xml.replace_range(end..end + 2, &inner);
    }
    fmu_of(&xml, foreign::binary3())
}

#[test]
fn aliases_are_names_like_others() {
    let folder = Folder::new();
    folder.write("a.fmu", with_aliases());
    folder.write("b.fmu", with_aliases());
    let info = folder.pilotage(&["info", "a.fmu"]);
    let line = info.stdout.lines().find(|line| line.starts_with("gain "));
    let words: Vec<&str> = line.unwrap().split_whitespace().collect();
    assert_eq!(
        words.join(" "),
        "gain alias another name of k; as in the model"
    );
    let json = folder.pilotage(&["info", "a.fmu", "--json"]).json();
    assert_eq!(json["variables"][2]["aliases"][0], "plant.x[1]");

    let wires = [
        "0.5",
        "--connect",
        "a.plant.x[1]=b.plant.u",
        "--set",
        "a.gain=2",
        "--set",
        "a.plant.u=1",
        "--record",
        "a.plant.x[1],b.y,a.y,b.plant*",
    ];
    let ended = folder.pilotage(&[&RUN[..], &wires].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let text = folder.read("result.csv");
    let header = text.lines().find(|line| line.starts_with("time"));
    assert_eq!(
        header,
        Some("time,a.plant.x[1],b.y,a.y,b.plant.u,b.plant.x[1]")
    );
    let [a, own, b, fed] = ["a.plant.x[1]", "a.y", "b.y", "b.plant.u"].map(|n| column(&folder, n));
    assert_eq!((&a, &a), (&own, &fed));
    let first = 1.0 - (-1.0_f64).exp();
    assert!((a[1] - first).abs() < 1e-12, "{a:?}");
    // The second one gets that for the second step.
    assert!(
        (b[2] - first * (1.0 - (-0.5_f64).exp())).abs() < 1e-12,
        "{b:?}"
    );
    let twice = ["0.5", "--set", "a.gain=2", "--set", "a.k=3"];
    let ended = folder.pilotage(&[&RUN[..], &twice].concat());
    assert_eq!(
        (ended.code, ended.stderr.as_str()),
        (
            2,
            "error: `a.k` is set twice\nhint: leave one of the two values out\n"
        )
    );
}

/// `count` variables of as many types, an output that depends on all inputs, one very long text.
fn large(count: usize) -> Vec<u8> {
    let types: String = (0..count)
        .map(|i| format!("<SimpleType name=\"T{i}\"><Real unit=\"m\"/></SimpleType>"))
        .collect();
    let variables: String = (0..count)
        .map(|i| format!("<ScalarVariable name=\"model.signal{i}\" valueReference=\"{i}\" causality=\"input\"><Real declaredType=\"T{i}\" start=\"1e300\"/></ScalarVariable>"))
        .collect();
    let outputs: String = (count..count + 100)
        .map(|i| format!("<ScalarVariable name=\"y{i}\" valueReference=\"{i}\" causality=\"output\"><Real/></ScalarVariable>"))
        .collect();
    let all: String = (1..=count).map(|i| format!("{i} ")).collect();
    let unknowns: String = (count + 1..=count + 100)
        .map(|i| match i == count + 1 {
            true => format!("<Unknown index=\"{i}\" dependencies=\"{all}\"/>"),
            false => format!("<Unknown index=\"{i}\" dependencies=\"\"/>"),
        })
        .collect();
    let text = "x".repeat(100_000);
    let xml = format!(
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"large\" guid=\"g\"><CoSimulation modelIdentifier=\"m\"/><UnitDefinitions><Unit name=\"m\"><BaseUnit m=\"1\"/></Unit></UnitDefinitions><TypeDefinitions>{types}</TypeDefinitions><ModelVariables>{variables}{outputs}<ScalarVariable name=\"text\" valueReference=\"0\" causality=\"parameter\" variability=\"fixed\" description=\"a text\"><String start=\"{text}\"/></ScalarVariable></ModelVariables><ModelStructure><Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure></fmiModelDescription>"
    );
    archive(&[("modelDescription.xml", xml.as_bytes())])
}

/// Neither many types nor a long cell make more of the text than there is in the file.
#[test]
fn large_descriptions_are_shown_in_proportion() {
    let folder = Folder::new();
    let content = large(100_000);
    folder.write("a.fmu", content);
    let info = folder.pilotage(&["info", "a.fmu"]);
    assert_eq!(info.code, 0, "{}", info.stderr);
    assert!(info.stdout.len() < 30_000_000, "{}", info.stdout.len());
    let line = info
        .stdout
        .lines()
        .find(|line| line.contains("model.signal99999 "));
    let words: Vec<&str> = line.unwrap().split_whitespace().collect();
    assert_eq!(
        words,
        [
            "model.signal99999",
            "input",
            "continuous",
            "Real",
            "m",
            "1e+300"
        ]
    );
}

/// As the cross-check of FMI writes them.
#[test]
fn tables_of_a_single_fmu_have_bare_names() {
    let folder = two();
    folder.write("in.csv", "\"time\",\"u\",\"n_in\"\n0,1,3\n1,1,3\n");
    let single = ["cosim", "a.fmu", "--input", "in.csv", "--step", "0.5"];
    let ended = folder.pilotage(&single);
    assert_eq!(ended.code, 0, "{ended:?}");
    // Until the stop time that the description suggests.
    let y = column(&folder, "a.y [m]");
    assert_eq!(y.len(), 3);
    assert!((y[2] - (1.0 - (-1.0_f64).exp())).abs() < 1e-12, "{y:?}");
    assert_eq!(column(&folder, "a.n"), [0.0, 4.0, 4.0]);
    let ended = folder.pilotage(&[&RUN[..], &["0.5", "--input", "in.csv"]].concat());
    assert_eq!(
        (ended.code, ended.stderr.lines().next()),
        (2, Some("error: in.csv: no column is named like an input"))
    );
}

#[test]
fn the_stop_time_is_that_of_the_fmus_if_they_agree() {
    let folder = two();
    let ended = folder.pilotage(&["cosim", "a.fmu", "b.fmu", "--step", "0.5", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert_eq!(column(&folder, "time"), [0.0, 0.5, 1.0]);
    let later = foreign::DESCRIPTION.replace("stopTime=\"1\"", "stopTime=\"2\"");
    folder.write("b.fmu", fmu_of(&later, foreign::binary()));
    let ended = folder.pilotage(&["cosim", "a.fmu", "b.fmu", "--step", "0.5"]);
    let error = "error: no --stop-time, and the FMUs suggest none, or different ones";
    assert_eq!(
        (ended.code, ended.stderr.lines().next()),
        (2, Some(error)),
        "{ended:?}"
    );
    let ended = folder.pilotage(&["cosim", "b.fmu", "--step", "0.5"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert_eq!(column(&folder, "time").last(), Some(&2.0));
}

/// What such an FMU needs to run, and how bad it is that it is not here.
#[test]
#[cfg(target_os = "linux")]
fn what_a_binary_misses_is_named() {
    let run = |content: Vec<u8>, arguments: &[&str]| {
        let folder = Folder::new();
        folder.write("a.fmu", content);
        folder.pilotage(arguments)
    };
    let cosim = ["cosim", "a.fmu", "--step", "0.5"];
    let entry = foreign::binary_entry();
    let python = || fmu_of(foreign::DESCRIPTION, foreign::binary_needing_python());
    let symbol = "no library here has the symbol `_Py_NoneStruct` that it needs; it is of Python, in which such \
                  FMUs usually run: start with LD_PRELOAD=libpython3.12.so, or of the version that the FMU was \
                  made for";
    let ended = run(python(), &cosim);
    let error = format!("error: a.fmu: `{entry}` cannot be used: {symbol}\n");
    assert_eq!((ended.code, ended.stderr), (2, error));
    let judged = run(python(), &["validate", "a.fmu"]);
    assert_eq!(judged.code, 1, "{judged:?}");
    assert!(judged.stdout.contains(symbol), "{judged:?}");

    // A library of the system under a name that nobody has.
    let mut binary = foreign::binary().to_vec();
    let name = b"libgcc_s.so.1";
    let at = binary.windows(name.len()).position(|w| w == name).unwrap();
    binary[at..at + name.len()].copy_from_slice(b"libnobod.so.9");
    let ended = run(fmu_of(foreign::DESCRIPTION, &binary), &cosim);
    let library = "the library `libnobod.so.9` that it needs is not here; install the package that has it, or add \
                   its folder to LD_LIBRARY_PATH";
    let error = format!("error: a.fmu: `{entry}` cannot be used: {library}\n");
    assert_eq!((ended.code, ended.stderr), (2, error));
    let judged = run(
        fmu_of(foreign::DESCRIPTION, &binary),
        &["validate", "a.fmu"],
    );
    assert_eq!(judged.code, 0, "another machine may have it: {judged:?}");
    assert!(
        judged.stdout.starts_with("a.fmu: valid; not run"),
        "{judged:?}"
    );
    let note =
        format!("note: co-simulation: while loading: a.fmu: `{entry}` cannot be used: {library}");
    assert!(judged.stdout.contains(&note), "{judged:?}");
}

/// Co-simulation of FMI 3.0 with clocks: an importer without event mode is refused, ours is not.
#[test]
fn clocks_get_their_event_mode() {
    let findings = |behaviour| {
        let folder = Folder::new();
        folder.write("a.fmu", foreign::fmu3(behaviour));
        let judged = folder.pilotage(&["validate", "a.fmu"]);
        (judged.code, judged.stdout)
    };
    assert_eq!(findings("clocked"), findings("good"));
    assert!(
        !findings("clocked")
            .1
            .contains("clocks tick in event mode alone")
    );
}

/// Input clocks tick when the FMU says: half a second after the start.
#[test]
fn clocks_that_do_not_tick_are_found() {
    let judged = |behaviour| {
        let folder = Folder::new();
        folder.write("a.fmu", foreign::fmu3(behaviour));
        folder.pilotage(&["validate", "a.fmu"]).stdout
    };
    let words = ["ticking", "the clock ", "clocks"];
    assert!(
        !words.iter().any(|word| judged("good").contains(word)),
        "{}",
        judged("good")
    );
    for (behaviour, finding) in [
        ("stuck", "while ticking clock at 0.5 s: fmi3SetClock"),
        ("dead clock", "ticking clock at 0.5 s"),
        (
            "backwards",
            "the clock clock first ticks -1 s after the start",
        ),
        (
            "unknown",
            "the interval of the clock clock is not yet known",
        ),
    ] {
        for kind in ["co-simulation: ", "model exchange: "] {
            let findings = judged(behaviour);
            let mut lines = findings.lines();
            let is_it = |line: &str| line.contains(kind) && line.contains(finding);
            assert!(lines.any(is_it), "{behaviour}: {findings}");
        }
    }
}
