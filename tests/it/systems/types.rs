//! Wires between the types of FMI 2.0 and 3.0, in FMUs of another tool: what arrives, and what is refused.

use crate::command::Folder;
use crate::foreign;

/// The FMU of FMI 3.0 whose outputs are the inputs plus one; its `i64` is an enumeration of `names` values.
fn enumerated(names: usize) -> Vec<u8> {
    let items: String = (1..=names)
        .map(|k| format!("<Item name=\"v{k}\" value=\"{k}\"/>"))
        .collect();
    let types = format!(
        "<TypeDefinitions><EnumerationType name=\"Mode\">{items}</EnumerationType></TypeDefinitions>"
    );
    let mut text = include_str!("../foreign/fmi3.xml").to_owned();
    for (from, to) in [
        ("<LogCategories>", format!("{types}<LogCategories>")),
        (
            "<Int64 name=\"i64_in\" valueReference=\"17\" causality=\"input\" start=\"0\"/>",
            "<Enumeration name=\"mode_in\" valueReference=\"17\" causality=\"input\" declaredType=\"Mode\" start=\"1\"/>".into(),
        ),
        (
            "<Int64 name=\"i64\" valueReference=\"37\" causality=\"output\"/>",
            "<Enumeration name=\"mode\" valueReference=\"37\" causality=\"output\" declaredType=\"Mode\"/>".into(),
        ),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, &to);
    }
    foreign::fmu_of(&text, foreign::binary3())
}

fn folder() -> Folder {
    let folder = Folder::new();
    for (name, fmu) in [
        ("two.fmu", foreign::fmu("good")),
        ("three.fmu", foreign::fmu3("good")),
        ("modes.fmu", enumerated(5)),
    ] {
        folder.write(name, fmu);
    }
    folder
}

const INSTANCES: &str = "\
[system.two]
model = \"two.fmu\"
[system.a]
model = \"three.fmu\"
[system.b]
model = \"three.fmu\"
[system.m]
model = \"modes.fmu\"
[system.n]
model = \"modes.fmu\"
";

/// The last value of a signal of a run with these values and wires.
fn last(folder: &Folder, set: &str, wire: (&str, &str), signal: &str) -> f64 {
    let (name, value) = set.split_once(" = ").unwrap();
    let (from, to) = wire;
    folder.write(
        "s.toml",
        match to.starts_with('{') {
            true => format!("{INSTANCES}[connect]\n\"{from}\" = {to}\n"),
            false => format!("{INSTANCES}[connect]\n\"{from}\" = \"{to}\"\n"),
        },
    );
    let set = format!("{name}={value}");
    let ended = folder.pilotage(&[
        "cosim",
        "s.toml",
        "--set",
        &set,
        "--record",
        signal,
        "--stop-time",
        "1",
        "--step",
        "0.5",
    ]);
    assert_eq!(
        (ended.code, ended.stderr.as_str()),
        (0, ""),
        "{from} -> {to}"
    );
    let text = folder.read("result.csv");
    let line = text.lines().last().unwrap();
    line.split(',').nth(1).unwrap().parse().unwrap()
}

/// The output of each type is its input plus one, that of a Boolean its opposite.
#[test]
fn what_fits_arrives() {
    let folder = folder();
    for (set, from, to, signal, expected) in [
        // Sizes of integers, with sign and without, both ways.
        ("a.i8_in = -100", "a.i8", "b.i64_in", "b.i64", -98.0),
        ("a.i64_in = 125", "a.i64", "b.i8_in", "b.i8", 127.0),
        ("a.u8_in = 254", "a.u8", "b.i16_in", "b.i16", 256.0),
        ("a.i16_in = 253", "a.i16", "b.u8_in", "b.u8", 255.0),
        ("a.u64_in = 41", "a.u64", "b.i32_in", "b.i32", 43.0),
        ("a.i32_in = 41", "a.i32", "b.u64_in", "b.u64", 43.0),
        (
            "a.u32_in = 4294967293",
            "a.u32",
            "b.i64_in",
            "b.i64",
            4294967295.0,
        ),
        // Between versions of the standard.
        ("a.i64_in = -7", "a.i64", "two.n_in", "two.n", -5.0),
        ("two.n_in = 200", "two.n", "a.u8_in", "a.u8", 202.0),
        // Reals of both sizes, and from and to integers.
        ("a.f32_in = 0.5", "a.f32", "b.u", "b.u", 1.5),
        ("a.array[1] = 0.25", "a.sums[1]", "b.f32_in", "b.f32", 1.25),
        ("a.i32_in = 6", "a.i32", "b.u", "b.u", 7.0),
        ("a.i32_in = 6", "a.i32", "b.f32_in", "b.f32", 8.0),
        (
            "a.u64_in = 9007199254740991",
            "a.u64",
            "b.u",
            "b.u",
            9007199254740992.0,
        ),
        ("a.f32_in = 4", "a.f32", "b.i8_in", "b.i8", 6.0),
        // Booleans.
        ("a.boolean_in = true", "a.boolean", "b.i8_in", "b.i8", 1.0),
        ("two.flag_in = false", "two.flag", "b.u", "b.u", 1.0),
        (
            "a.boolean_in = false",
            "a.boolean",
            "two.flag_in",
            "two.flag",
            0.0,
        ),
        // Enumerations and integers, both ways.
        ("m.mode_in = 2", "m.mode", "b.i8_in", "b.i8", 4.0),
        ("m.mode_in = 2", "m.mode", "two.n_in", "two.n", 4.0),
        ("a.u8_in = 2", "a.u8", "m.mode_in", "m.mode", 4.0),
        ("m.mode_in = 2", "m.mode", "n.mode_in", "n.mode", 4.0),
        // Other values in place of some, by name and by number; what is not in the map stays.
        (
            "m.mode_in = 2",
            "m.mode",
            "{ to = \"n.mode_in\", map = { v3 = \"v1\", v1 = \"v4\" } }",
            "n.mode",
            2.0,
        ),
        (
            "m.mode_in = 1",
            "m.mode",
            "{ to = \"n.mode_in\", map = { v3 = \"v1\" } }",
            "n.mode",
            3.0,
        ),
        (
            "m.mode_in = 2",
            "m.mode",
            "{ to = \"b.i8_in\", map = { v3 = -9 } }",
            "b.i8",
            -8.0,
        ),
        (
            "a.i64_in = 41",
            "a.i64",
            "{ to = \"b.u\", map = { 42 = 0.25 } }",
            "b.u",
            0.25,
        ),
        (
            "a.boolean_in = false",
            "a.boolean",
            "{ to = \"two.flag_in\", map = { true = false, false = true } }",
            "two.flag",
            1.0,
        ),
    ] {
        let found = last(&folder, set, (from, to), signal);
        assert_eq!(found, expected, "{set}, {from} -> {to}");
    }
}

/// A mapped input is recorded with the value that it has at that time, as one without a map is.
#[test]
fn mapped_inputs_are_recorded_in_time() {
    let folder = folder();
    folder.write("t.csv", "time,x\n0,1\n0.5,2\n1,3\n");
    folder.write(
        "s.toml",
        format!(
            "{INSTANCES}[system.t]\ntable = \"t.csv\"\n[connect]\n\"t.x\" = \"a.i8_in\"\n\
             \"a.i8\" = [\"b.i8_in\", {{ to = \"two.n_in\", map = {{ 1 = 1 }} }}]\n"
        ),
    );
    let record = ["--record", "b.i8_in,two.n_in"];
    let times = ["--stop-time", "1", "--step", "0.5"];
    let ended = folder.pilotage(&[&["cosim", "s.toml"], &record[..], &times].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let text = folder.read("result.csv");
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    assert!(rows.len() == 3 && rows[0][1] != rows[2][1], "{text}");
    assert!(rows.iter().all(|row| row[1] == row[2]), "{text}");
}

/// What would lose something ends the run, at the start or on the way; both ends are named.
#[test]
fn what_does_not_fit_is_refused_with_both_ends() {
    let folder = folder();
    for (set, from, to, message) in [
        (
            "a.i16_in = 127",
            "a.i16",
            "b.i8_in",
            "`a.i16` -> `b.i8_in`: 128 does not fit into a variable of type Int8",
        ),
        (
            "a.i8_in = -2",
            "a.i8",
            "b.u64_in",
            "`a.i8` -> `b.u64_in`: -1 does not fit into a variable of type UInt64",
        ),
        (
            "a.i64_in = 3000000000",
            "a.i64",
            "two.n_in",
            "`a.i64` -> `two.n_in`: 3000000001 does not fit into a variable of type Integer",
        ),
        (
            "a.u64_in = 9007199254740992",
            "a.u64",
            "b.u",
            "`a.u64` -> `b.u`: 9007199254740993 has more digits than a Real can hold",
        ),
        (
            "a.f32_in = 0.5",
            "a.f32",
            "b.i8_in",
            "`a.f32` -> `b.i8_in`: 1.5 is no whole number that an Integer can hold",
        ),
        (
            "a.u8_in = 5",
            "a.u8",
            "m.mode_in",
            "`a.u8` -> `m.mode_in`: 6 is none of the values of the enumeration, which are [1, 2, 3, 4, 5]",
        ),
        (
            "a.array[1] = 1e39",
            "a.sums[1]",
            "b.f32_in",
            "`f32_in` is of type Float32, and 1e39 is too large for it",
        ),
    ] {
        let (name, value) = set.split_once(" = ").unwrap();
        folder.write(
            "s.toml",
            format!("{INSTANCES}[connect]\n\"{from}\" = \"{to}\"\n"),
        );
        let set = format!("{name}={value}");
        let ended = folder.pilotage(&[
            "cosim",
            "s.toml",
            "--set",
            &set,
            "--stop-time",
            "1",
            "--step",
            "0.5",
        ]);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains(message), "{}", ended.stderr);
    }
    for (wire, message) in [
        (
            "\"a.f32\" = { to = \"b.u\", map = { 1 = 2 } }",
            "`a.f32` -> `b.u`: a map is for Booleans, integers and enumerations",
        ),
        (
            "\"m.mode\" = { to = \"n.mode_in\", map = { v9 = \"v1\" } }",
            "`m.mode` is of type Enumeration, `v9` is not",
        ),
        (
            "\"m.mode\" = { to = \"n.mode_in\", map = { v1 = \"v2\", 1 = \"v3\" } }",
            "the map of a wire from `m.mode` names its value `1` twice",
        ),
        (
            "\"m.mode\" = { to = \"n.mode_in\", map = { v1 = [2] } }",
            "s.toml:12:45: `v1` is an array; expected a number, true, false or a string",
        ),
    ] {
        folder.write("s.toml", format!("{INSTANCES}[connect]\n{wire}\n"));
        let ended = folder.pilotage(&["cosim", "s.toml", "--stop-time", "1"]);
        let is_refused = ended.code == 2 && ended.stderr.contains(message);
        assert!(is_refused, "{ended:?}");
    }
    // On the way: a table feeds an Int8 from 1 s on with 200.
    folder.write("t.csv", "time,b.i8_in\n0,100\n1,200\n");
    folder.write(
        "s.toml",
        format!("{INSTANCES}[system.t]\ntable = \"t.csv\"\n"),
    );
    let ended = folder.pilotage(&["cosim", "s.toml", "--stop-time", "2", "--step", "0.5"]);
    let message = "`t.b.i8_in` -> `b.i8_in`: 200 does not fit into a variable of type Int8";
    assert!(
        ended.code == 1 && ended.stderr.contains(message),
        "{ended:?}"
    );
}

/// An enumeration is set by number or by name, in system files and by flags; of a single FMU without the instance. A wrong
/// name is answered with the right ones, which `info` lists too.
#[test]
fn enumerations_are_set_by_name() {
    let folder = folder();
    folder.write(
        "set.toml",
        "[system.m]\nmodel = \"modes.fmu\"\nset = { mode_in = \"v3\" }\n",
    );
    folder.write("values.toml", "mode_in = \"v3\"\n");
    for arguments in [
        vec!["set.toml"],
        vec!["m=modes.fmu", "--set", "m.mode_in=v3"],
        vec!["m=modes.fmu", "--set", "mode_in=v3"],
        vec!["m=modes.fmu", "--set", "mode_in=3"],
        vec!["m=modes.fmu", "--parameters", "values.toml"],
        vec![
            "m=modes.fmu",
            "--parameters",
            "values.toml",
            "--set",
            "mode_in= v3 ",
        ],
    ] {
        let run = ["--record", "m.mode", "--stop-time", "1", "--step", "0.5"];
        let all = [vec!["cosim"], arguments.clone(), run.to_vec()].concat();
        let ended = folder.pilotage(&all);
        assert_eq!(
            (ended.code, ended.stderr.as_str()),
            (0, ""),
            "{arguments:?}"
        );
        let text = folder.read("result.csv");
        assert!(
            text.lines().skip(1).all(|line| line.ends_with(",4")),
            "{arguments:?}: {text}"
        );
    }
    let wrong = folder.pilotage(&[
        "cosim",
        "modes.fmu",
        "--set",
        "mode_in=v6",
        "--stop-time",
        "1",
        "--step",
        "0.5",
    ]);
    let named = "hint: write the name or the number of one: `v1` (1), `v2` (2), `v3` (3), `v4` (4), `v5` (5)";
    assert!(wrong.code == 2 && wrong.stderr.contains(named), "{wrong:?}");
    let two = folder.pilotage(&[
        "cosim",
        "m=modes.fmu",
        "n=modes.fmu",
        "--set",
        "mode_in=v3",
        "--stop-time",
        "1",
        "--step",
        "0.5",
    ]);
    assert!(
        two.code == 2 && two.stderr.contains("`mode_in` names no variable"),
        "{two:?}"
    );

    let info = folder.pilotage(&["info", "modes.fmu"]).stdout;
    for line in ["Enumeration Mode", "Mode         5      v5", "Float64["] {
        assert!(info.contains(line), "{line}: {info}");
    }
    let info = folder.pilotage(&["info", "modes.fmu", "--json"]).stdout;
    let info: serde_json::Value = serde_json::from_str(&info).unwrap();
    assert_eq!(info["enumerations"]["Mode"][4]["name"], "v5");
}
