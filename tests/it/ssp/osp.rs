//! Systems of the Open Simulation Platform and of maestro. `tools::ssp` has them against libcosim.

use super::{LAG, notes};
use crate::command::Folder;
use crate::mutation::Mutator;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Two outputs and two inputs, in groups.
const TWO: &str = "\
[model]
name = \"two\"
[inputs]
u = {}
v = {}
[states]
a = { der = \"v - a + u\" }
b = { der = \"(u - b) / 0.3\" }
[outputs]
f = { value = \"a\" }
g = { value = \"b\" }
";

const GROUPS: &str = r#"<OspModelDescription xmlns="https://open-simulation-platform.com/OspModelDescription/1.0.0" version="1.0">
<VariableGroups>
<Generic name="outputs"><Variable ref="f"/><Variable ref="g"/></Generic>
<Generic name="inputs"><Variable ref="u"/><Variable ref="v"/></Generic>
</VariableGroups>
</OspModelDescription>
"#;

const SYSTEM: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
<StartTime>0.0</StartTime>
<EndTime>2.0</EndTime>
<BaseStepSize>0.1</BaseStepSize>
<Algorithm>fixedStep</Algorithm>
<Simulators>
<Simulator name="first" source="lag.fmu"><InitialValues>
<InitialValue variable="level"><Real value="3"/></InitialValue>
</InitialValues></Simulator>
<Simulator name="second" source="./feet.fmu"><InitialValues>
<InitialValue variable="tau"><Real value="0.2"/></InitialValue>
</InitialValues></Simulator>
<Simulator name="third" source="lag.fmu"/>
<Simulator name="p" source="two.fmu"/>
<Simulator name="q" source="two.fmu"/>
</Simulators>
<Functions>
<LinearTransformation name="scaled" factor="2" offset="0.5"/>
<Sum name="sum" inputCount="2"/>
<VectorSum name="both" inputCount="2" dimension="2"/>
</Functions>
<Connections>
<VariableConnection><Variable simulator="first" name="y"/><Variable simulator="second" name="u"/></VariableConnection>
<SignalConnection><Variable simulator="second" name="y"/><Signal function="scaled" name="in"/></SignalConnection>
<SignalConnection><Signal function="sum" name="in[0]"/><Variable simulator="first" name="y"/></SignalConnection>
<SignalConnection><Signal function="sum" name="in[1]"/><Variable simulator="third" name="y"/></SignalConnection>
<SignalConnection><Signal function="scaled" name="out"/><Variable simulator="third" name="u"/></SignalConnection>
<SignalConnection><Signal function="sum" name="out"/><Variable simulator="p" name="u"/></SignalConnection>
<SignalGroupConnection><VariableGroup simulator="p" name="outputs"/><SignalGroup function="both" name="in[0]"/></SignalGroupConnection>
<SignalGroupConnection><VariableGroup simulator="q" name="outputs"/><SignalGroup function="both" name="in[1]"/></SignalGroupConnection>
<SignalGroupConnection><SignalGroup function="both" name="out"/><VariableGroup simulator="q" name="inputs"/></SignalGroupConnection>
</Connections>
</OspSystemStructure>
"#;

/// A folder with the system of OSP in `OspSystemStructure.xml`, and its FMUs.
pub fn osp() -> Folder {
    let folder = Folder::new();
    let feet = LAG
        .replace("\"m\"", "\"ft\"")
        .replace("\"lag\"", "\"feet\"");
    for (name, text) in [("lag", LAG), ("feet", &feet), ("two", TWO)] {
        folder.write(&format!("{name}.toml"), text);
        let ended = folder.pilotage(&["export", &format!("{name}.toml")]);
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    folder.write("OspSystemStructure.xml", SYSTEM);
    folder.write("two_OspModelDescription.xml", GROUPS);
    folder
}

/// The same as a system file: values are passed as they are, and functions are models.
#[test]
fn a_system_of_osp_is_what_its_file_says() {
    let folder = osp();
    let run = |file: &str, step: &str| {
        let arguments = ["cosim", file, "--step", step, "--stop-time", "2"];
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.code, 0, "{ended:?}");
        folder.read("result.csv")
    };
    let theirs = run("OspSystemStructure.xml", "0.1");
    assert_eq!(theirs.lines().count(), 22);
    let sum =
        "[model]\nname = \"s\"\n[inputs]\na = {}\nb = {}\n[outputs]\nout = { value = \"a + b\" }\n";
    folder.write("sum.toml", sum);
    let gain =
        "[model]\nname = \"s\"\n[inputs]\nin = {}\n[outputs]\nout = { value = \"2 * in + 0.5\" }\n";
    folder.write("gain.toml", gain);
    let wire =
        |from: &str, to: &str| format!("\"{from}\" = {{ to = \"{to}\", convert_units = false }}\n");
    let wires: String = [
        ("second.y", "scaled.in"),
        ("third.y", "sum.b"),
        ("scaled.out", "third.u"),
        ("sum.out", "p.u"),
        ("p.f", "both0.a"),
        ("p.g", "both1.a"),
        ("q.f", "both0.b"),
        ("q.g", "both1.b"),
        ("both0.out", "q.u"),
        ("both1.out", "q.v"),
    ]
    .map(|(from, to)| wire(from, to))
    .concat();
    let at_once = |name: &str, model: &str| {
        format!("[system.{name}]\nmodel = \"{model}.toml\"\nat_once = true\n")
    };
    folder.write(
        "same.toml",
        "[system.first]\nmodel = \"lag.fmu\"\nset = { level = 3 }\n\
         [system.second]\nmodel = \"feet.fmu\"\nset = { tau = 0.2 }\n\
         [system.third]\nmodel = \"lag.fmu\"\n[system.p]\nmodel = \"two.fmu\"\n[system.q]\nmodel = \"two.fmu\"\n"
            .to_owned()
            + &at_once("scaled", "gain")
            + &at_once("sum", "sum")
            + &at_once("both0", "sum")
            + &at_once("both1", "sum")
            + "[connect]\n\"first.y\" = [{ to = \"second.u\", convert_units = false }, \"sum.a\"]\n"
            + &wires,
    );
    let ours = run("same.toml", "0.1");
    let values = |text: &str| -> Vec<String> { text.lines().skip(1).map(str::to_owned).collect() };
    assert_eq!(values(&ours), values(&theirs));
    let info = folder
        .pilotage(&["info", "OspSystemStructure.xml", "--json"])
        .json();
    assert_eq!(info["notes"], serde_json::json!([]), "{info}");
    let draw = |to: &str| folder.pilotage(&["info", "OspSystemStructure.xml", "--figure", to]);
    assert_eq!(draw("system.svg").code, 0);
    let svg = folder.read("system.svg");
    for name in ["third", "sum.toml", "in_0_1", "out_1 → v"] {
        assert!(svg.contains(name), "{name}: {svg}");
    }
    // An input stays as it is, and so does what is no figure.
    folder.write("notes.svg", "mine");
    for to in ["OspSystemStructure.xml", "notes.svg", "system.pdf"] {
        let ended = draw(to);
        assert_eq!(ended.code, 2, "{ended:?}");
    }
    assert_eq!(folder.read("notes.svg"), "mine");
    assert_eq!(folder.read("OspSystemStructure.xml"), SYSTEM);
}

#[test]
fn mistakes_in_a_system_of_osp_have_their_place() {
    let folder = osp();
    for (from, to, message) in [
        (
            "source=\"lag.fmu\"",
            "source=\"log.fmu\"",
            ":8:1: <Simulator>: there is no file `log.fmu`",
        ),
        (
            "source=\"lag.fmu\"",
            "source=\"proxyfmu://here?file=lag.fmu\"",
            "names no file; name the FMU itself",
        ),
        (
            "simulator=\"third\" name=\"u\"",
            "simulator=\"fourth\" name=\"u\"",
            "<Variable>: there is no `fourth`",
        ),
        (
            "simulator=\"third\" name=\"u\"",
            "simulator=\"third\" name=\"w\"",
            "the FMU of `third` has no variable `w`",
        ),
        (
            "simulator=\"third\" name=\"u\"",
            "simulator=\"third\" name=\"y\"",
            "`scaled.out` and `third.y` are both outputs",
        ),
        (
            "name=\"in[1]\"/><Var",
            "name=\"in[2]\"/><Var",
            "`sum` has no signal `in_2`; it has in_0, in_1, out",
        ),
        (
            "name=\"outputs\"",
            "name=\"output\"",
            "no variable group `output`; did you mean `outputs`?",
        ),
        (
            "inputCount=\"2\"/>",
            "inputCount=\"-2\"/>",
            "<Sum>: `inputCount` is `-2`; expected 1 to 1000",
        ),
        (
            "dimension=\"2\"",
            "dimension=\"3\"",
            "one end has 2 variables, the other 3",
        ),
        (
            "<Sum ",
            "<Product ",
            "expected <LinearTransformation>, <Sum> or <VectorSum>",
        ),
        (
            "<BaseStepSize>0.1<",
            "<BaseStepSize>-1<",
            "<BaseStepSize>: a communication step is above 0 s",
        ),
        (
            "<EndTime>2.0<",
            "<EndTime>soon<",
            "<EndTime>: `soon` is no number",
        ),
        (
            "variable=\"tau\"",
            "variable=\"tao\"",
            "`second` has no variable `tao`; did you mean `second.tau`?",
        ),
        ("<Real value=\"3\"/>", "", "<InitialValue>: it has no value"),
        (
            "name=\"third\" source",
            "name=\"first\" source",
            "two are named `first`",
        ),
    ] {
        assert!(SYSTEM.contains(from), "{from}");
        folder.write("OspSystemStructure.xml", SYSTEM.replacen(from, to, 1));
        let ended = folder.pilotage(&["cosim", "OspSystemStructure.xml", "--step", "0.1"]);
        let said = &ended.stderr;
        assert!(
            ended.code == 2 && said.contains("OspSystemStructure.xml:") && said.contains(message),
            "{to}: {said}"
        );
    }
    folder.write(
        "OspSystemStructure.xml",
        SYSTEM.replacen(
            "source=\"lag.fmu\"/>",
            "source=\"lag.fmu\" stepSize=\"0.2\"/>",
            1,
        ),
    );
    let run = ["cosim", "OspSystemStructure.xml", "--step", "0.1"];
    let ended = folder.pilotage(&run);
    assert!(
        notes(&ended)
            .iter()
            .any(|own| own.contains("step sizes of their own")),
        "{ended:?}"
    );
    // What is misspelled is left out, and this is said.
    for (from, to) in [
        (
            "source=\"lag.fmu\"/>",
            "source=\"lag.fmu\" stepsize=\"1\"/>",
        ),
        ("EndTime>", "Endtime>"),
    ] {
        folder.write("OspSystemStructure.xml", SYSTEM.replace(from, to));
        let ended = folder.pilotage(&[&run[..], &["--stop-time", "1"]].concat());
        let said = notes(&ended).join("\n");
        assert!(
            said.contains("is not in the standard; ignored; did you mean"),
            "{to}: {ended:?}"
        );
    }
    // The folder is the system, as for libcosim.
    folder.write("OspSystemStructure.xml", SYSTEM);
    assert_eq!(folder.pilotage(&["info", "."]).code, 0);
}

const MULTI_MODEL: &str = r#"{
"fmus": { "{l}": "lag.fmu", "{f}": "feet.fmu" },
"connections": { "{l}.first.y": ["{f}.second.u"], "{f}.second.y": ["{l}.third.u"] },
"parameters": { "{l}.first.level": 3, "{f}.second.tau": 0.2 },
"algorithm": { "type": "fixed-step", "size": 0.1 }
}
"#;

/// A multi-model of maestro, with times beside it, and as a system file.
#[test]
fn a_multi_model_of_maestro_is_what_its_file_says() {
    let folder = osp();
    folder.write("mm.json", MULTI_MODEL);
    folder.write("coe.json", r#"{ "startTime": 0, "endTime": 2 }"#);
    let run = |arguments: &[&str]| {
        let ended = folder.pilotage(&[&["cosim", "--step", "0.1"], arguments].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let text = folder.read("result.csv");
        let mut rows: Vec<Vec<String>> = text
            .lines()
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect();
        // Instances are in another order.
        let names = rows[0].clone();
        let mut order: Vec<usize> = (0..names.len()).collect();
        order.sort_by_key(|&k| names[k].clone());
        for row in &mut rows {
            *row = order.iter().map(|&k| row[k].clone()).collect();
        }
        rows
    };
    let theirs = run(&["mm.json"]);
    folder.write(
        "same.toml",
        "[experiment]\nstop_time = 2\n[system.first]\nmodel = \"lag.fmu\"\nset = { level = 3 }\n\
         [system.second]\nmodel = \"feet.fmu\"\nset = { tau = 0.2 }\n[system.third]\nmodel = \"lag.fmu\"\n\
         [connect]\n\"first.y\" = { to = \"second.u\", convert_units = false }\n\
         \"second.y\" = { to = \"third.u\", convert_units = false }\n",
    );
    assert_eq!(theirs, run(&["same.toml"]));
    assert_eq!(theirs.len(), 22);
    for (from, to, message) in [
        (
            "lag.fmu\"",
            "log.fmu\"",
            "`fmus.{l}`: there is no file `log.fmu`",
        ),
        (
            "{f}.second.u",
            "{g}.second.u",
            "`{g}.second.u`: `fmus` has no `{g}`",
        ),
        (
            "{f}.second.u",
            "second.u",
            "`second.u` is not of the form {fmu}.instance.variable",
        ),
        (
            "{f}.second.u",
            "{f}.second.w",
            "the FMU of `second` has no variable `w`",
        ),
        (
            "{f}.second.u",
            "{f}.second.y",
            "`first.y` -> `second.y` is not from an output to an input",
        ),
        (
            "{f}.second.u",
            "{l}.second.u",
            "`second` is an instance of `{f}` and of `{l}`",
        ),
        (
            "\"{l}.first.level\": 3",
            "\"{l}.first.level\": {}",
            "`first.level` is no value",
        ),
        ("\"parameters\": {", "\"parameters\": [", "mm.json:4:"),
        (
            "\"parameters\": {",
            "\"fmus\": {}, \"parameters\": {",
            "`fmus` stands twice",
        ),
    ] {
        assert!(MULTI_MODEL.contains(from), "{from}");
        folder.write("mm.json", MULTI_MODEL.replacen(from, to, 1));
        let ended = folder.pilotage(&["cosim", "mm.json", "--step", "0.1"]);
        assert!(
            ended.code == 2 && ended.stderr.contains("mm.json") && ended.stderr.contains(message),
            "{to}: {ended:?}"
        );
    }
}

/// A thousand mutations of each kind of file: nothing panics, and mistakes name a file.
#[test]
fn mutations_do_not_panic() {
    let folder = osp();
    folder.write("mm.json", MULTI_MODEL);
    let mut mutator = Mutator(ChaCha8Rng::seed_from_u64(49));
    for (name, read, good) in [
        ("OspSystemStructure.xml", "OspSystemStructure.xml", SYSTEM),
        (
            "two_OspModelDescription.xml",
            "OspSystemStructure.xml",
            GROUPS,
        ),
        ("mm.json", "mm.json", MULTI_MODEL),
    ] {
        let (mut fine, mut refused) = (0, 0);
        for _ in 0..1000 {
            let mut bytes = good.as_bytes().to_vec();
            mutator.mutate(&mut bytes, good.as_bytes());
            folder.write(name, &bytes);
            let path = folder.path(read);
            match pilotage_systems::is_foreign(&path).then(|| pilotage_systems::read(&path, None)) {
                None => {}
                Some(Ok(_)) => fine += 1,
                Some(Err(error)) => {
                    refused += 1;
                    let words = error.to_string();
                    assert!(words.contains(".xml") || words.contains(".json"), "{words}");
                }
            }
        }
        folder.write(name, good);
        assert!(
            // A line of JSON that stands twice is a key that does.
            fine > 30 && refused > 50,
            "{name}: {fine} read, {refused} refused"
        );
    }
}
