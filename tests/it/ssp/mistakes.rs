//! What others stumbled over is a note; mistakes are told with file, line, column and element.

use super::parts::{AFTER, MAP, NESTED, SIGNALS, values};
use super::{notes, rows, ssd, write};
use crate::command::Folder;
use crate::foreign;

/// The nested system with a piece of its `.ssd` replaced, run.
fn changed(from: &str, to: &str) -> (i32, String) {
    let text = ssd("1.0", NESTED, AFTER);
    assert!(text.contains(from), "{from}");
    ended_with(&text.replacen(from, to, 1), MAP, &values())
}

fn ended_with(text: &str, map: &str, values: &str) -> (i32, String) {
    let folder = Folder::new();
    let files = [
        ("SystemStructure.ssd", text),
        ("resources/signals.ssb", SIGNALS),
        ("resources/map.ssm", map),
        ("resources/deep er/all.ssv", values),
    ];
    write(&folder, "s", &files);
    let ended = folder.pilotage(&["cosim", "s.ssp", "--step", "0.1"]);
    let said = notes(&ended).join("\n");
    (
        ended.code,
        if ended.code == 0 { said } else { ended.stderr },
    )
}

#[test]
fn what_matches_nothing_is_a_note() {
    let (code, said) = changed(
        "<ssd:Connector name=\"y\" kind=\"output\"><ssc:Real unit=\"m\"/></ssd:Connector>\n      <ssd:Connector name=\"level\"",
        "<ssd:Connector name=\"y\" kind=\"output\"><ssc:Real unit=\"m\"/></ssd:Connector><ssd:Connector name=\"ghost\" kind=\"output\"/>\n      <ssd:Connector name=\"level\"",
    );
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("`first.ghost`: no such name here"), "{said}");
    assert!(
        said.contains("map.ssm: `nothing`: no such name here"),
        "{said}"
    );
    let (code, said) = changed(
        "name=\"gain\"><ssv:Real value=\"7\"/>",
        "name=\"gone\"><ssv:Real value=\"7\"/>",
    );
    assert_eq!(code, 0, "{said}");
    assert!(
        said.contains("SystemStructure.ssd: `gone`: no such name here"),
        "{said}"
    );
}

#[test]
fn an_empty_mapping_is_a_note() {
    let text = ssd("1.0", NESTED, AFTER);
    for map in ["", " \n"] {
        let (code, said) = ended_with(&text, map, &values());
        assert_eq!(code, 0, "{said}");
        assert!(
            said.contains("map.ssm is empty: none of the values are applied"),
            "{said}"
        );
    }
    let bare =
        MAP.split_once("<ssm:MappingEntry").unwrap().0.to_owned() + "</ssm:ParameterMapping>";
    assert_eq!(ended_with(&text, &bare, &values()).0, 0);
    let (code, said) = changed(
        "<ssd:ParameterMapping source=\"resources/map.ssm\"/>",
        "<ssd:ParameterMapping/>",
    );
    assert_eq!(code, 0, "{said}");
    assert!(
        said.contains("the mapping is empty; the values keep their names"),
        "{said}"
    );
}

/// What is misspelled is left out, and this is said.
#[test]
fn names_that_are_not_in_the_standard_are_notes() {
    for (from, to, message) in [
        (
            "suppressUnitConversion=\"true\"",
            "supressUnitConversion=\"true\"",
            "`supressUnitConversion` of <Connection> is not in the standard; ignored; did you mean \
             `suppressUnitConversion`?",
        ),
        (
            "<ssc:LinearTransformation factor=\"2\"",
            "<ssc:LinearTransform factor=\"2\"",
            "<LinearTransform> is not in the standard; ignored; did you mean `LinearTransformation`?",
        ),
    ] {
        let (code, said) = changed(from, to);
        assert!(code == 0 && said.contains(message), "{said}");
    }
}

#[test]
fn mistakes_have_their_place() {
    let at = "s.ssp/SystemStructure.ssd:";
    for (from, to, message) in [
        (
            "source=\"resources/lag.fmu\"",
            "source=\"resources/log.fmu\"",
            "<Component>: there is no file `resources/log.fmu`",
        ),
        (
            "source=\"resources/lag.fmu\"",
            "source=\"../lag.fmu\"",
            "<Component>: `../lag.fmu` leaves the folder of the .ssd by `..`",
        ),
        (
            "source=\"resources/lag.fmu\"",
            "source=\"file:///lag.fmu\"",
            "<Component>: `file:///lag.fmu` is outside",
        ),
        (
            "\"ModelExchange\"",
            "\"ScheduledExecution\"",
            "<Component>: the implementation `ScheduledExecution` cannot be used",
        ),
        (
            "endElement=\"bus\" endConnector=\"a\"",
            "endElement=\"buz\" endConnector=\"a\"",
            "<Connection>: there is no element `buz`; did you mean `bus`?",
        ),
        (
            "endElement=\"bus\" endConnector=\"a\"",
            "endElement=\"first\" endConnector=\"v\"",
            "<Connection>: the FMU of `first` has no variable `v`",
        ),
        (
            "startConnector=\"in\"",
            "startConnector=\"inn\"",
            "<Connection>: there is no connector `inn`; did you mean `in`?",
        ),
        (
            "factor=\"2\"",
            "factor=\"two\"",
            "<LinearTransformation>: `factor` is `two`; expected a number",
        ),
        (
            "<ssc:LinearTransformation factor=\"2\" offset=\"0.25\"/>",
            "<ssc:BooleanMappingTransformation><ssc:MapEntry source=\"true\" target=\"false\"/></ssc:BooleanMappingTransformation>",
            "a map is for Booleans, integers and enumerations",
        ),
        (
            "dictionary=\"signals\"",
            "dictionary=\"signal\"",
            "<SignalDictionaryReference>: there is no signal dictionary `signal`; did you mean `signals`?",
        ),
        (
            "<ssd:Connector name=\"b\" kind",
            "<ssd:Connector name=\"c\" kind",
            "<Connector>: `c` is no entry of the signal dictionary",
        ),
        (
            "kind=\"parameter\"",
            "kind=\"params\"",
            "<Connector>: the kind `params` is not known",
        ),
        (
            "<ssd:Component name=\"last\"",
            "<ssd:Component name=\"first\"",
            "<Component>: two elements are named `first`",
        ),
        (
            "value=\"200\" unit=\"ms\"",
            "value=\"fast\" unit=\"ms\"",
            "<Parameter>: `fast` is no value of <Real>",
        ),
        (
            "<ssv:Real value=\"200\" unit=\"ms\"/>",
            "<ssv:Boolean value=\"2\"/>",
            "<Parameter>: `2` is no value of <Boolean>",
        ),
        (
            "<ssv:Real value=\"200\" unit=\"ms\"/>",
            "",
            "<Parameter>: it has no value",
        ),
        (
            "s=\"1\" factor=\"0.001\"",
            "kg=\"1\"",
            "<Parameter>: a value in ms cannot be converted into s",
        ),
        (
            "suppressUnitConversion=\"true\"",
            "suppressUnitConversion=\"maybe\"",
            "<Connection>: `suppressUnitConversion` is `maybe`; expected true or false",
        ),
        (
            "startElement=\"first\" startConnector=\"y\" endConnector=\"seen\"",
            "startElement=\"last\" startConnector=\"u\" endElement=\"first\" endConnector=\"u\"",
            "<Connection>: `u` and `u` both take values here",
        ),
        (
            "<ssd:Connection startElement=\"first\" startConnector=\"y\" endConnector=\"seen\"/>",
            "<ssd:Connection startElement=\"first\" startConnector=\"y\" endElement=\"last\" endConnector=\"u\"/>",
            "<Connection>: `u` is fed twice: in line ",
        ),
        (
            "startTime=\"1\"",
            "startTime=\"soon\"",
            "<DefaultExperiment>: `startTime` is `soon`; expected a number",
        ),
        (
            "version=\"1.0\" name=\"Root",
            "version=\"3.0\" name=\"Root",
            "<SystemStructureDescription>: the version is `3.0`; 1.0 and 2.0 are known",
        ),
    ] {
        let (code, said) = changed(from, to);
        assert!(
            code == 2 && said.starts_with(&format!("error: {at}")) && said.contains(message),
            "{to}: {said}"
        );
        // Line and column.
        let place = said.strip_prefix(&format!("error: {at}")).unwrap();
        let numbers = place
            .split([':', ' '])
            .take(2)
            .filter(|part| part.parse::<u32>().is_ok())
            .count();
        assert_eq!(numbers, 2, "{said}");
    }
    let (code, said) = changed("</ssd:Elements>", "</ssd:Element>");
    assert!(code == 2 && said.contains("not well-formed XML"), "{said}");
    let text = ssd("1.0", NESTED, AFTER);
    let (code, said) = ended_with(&text, &MAP.replace("level", "first.gain"), &values());
    assert!(
        code == 2
            && said.contains("map.ssm:4:1: <MappingEntry>: two values are mapped to `first.gain`"),
        "{said}"
    );
    let (code, said) = ended_with(
        &text,
        MAP,
        &values().replace("<ssv:Real value=\"1.5\"/>", "<ssv:String value=\"a\"/>"),
    );
    assert!(
        code == 2
            && said
                .contains("map.ssm:3:1: <MappingEntry>: `a` is no number, and is to be converted"),
        "{said}"
    );
}

/// An archive whose files would go elsewhere, and systems in themselves.
#[test]
fn hostile_archives_end_with_a_message() {
    let folder = Folder::new();
    let own = ssd(
        "1.0",
        "<ssd:Elements><ssd:Component name=\"a\" source=\"SystemStructure.ssd\"/></ssd:Elements>",
        "",
    );
    folder.write(
        "self.ssp",
        foreign::archive(&[("SystemStructure.ssd", own.as_bytes())]),
    );
    let twice = "<ssd:Elements><ssd:System name=\"s\" id=\"s\"><ssd:Elements><ssd:Component name=\"a\" source=\"#s\"/>\
                 <ssd:Component name=\"b\" source=\"#s\"/></ssd:Elements></ssd:System></ssd:Elements>";
    folder.write("twice/SystemStructure.ssd", ssd("2.0", twice, ""));
    folder.write(
        "out.ssp",
        foreign::archive(&[("SystemStructure.ssd", own.as_bytes()), ("../x", b"x")]),
    );
    folder.write("none.ssp", foreign::archive(&[("resources/x", b"x")]));
    folder.write("text.ssp", "text");
    folder.write("empty.ssd", "");
    folder.write("nothing.ssd", ssd("1.0", "", ""));
    let deep = "<ssd:Elements><ssd:System name=\"s\">".repeat(450);
    folder.write(
        "deep.ssd",
        ssd(
            "1.0",
            &(deep + &"</ssd:System></ssd:Elements>".repeat(450)),
            "",
        ),
    );
    for (system, message) in [
        ("self.ssp", "nested deeper than"),
        ("twice", "nested deeper than"),
        ("deep.ssd", "nested deeper than"),
        ("out.ssp", "leaves the archive's folder"),
        ("none.ssp", "SystemStructure.ssd"),
        ("text.ssp", "no zip archive"),
        ("empty.ssd", "not well-formed XML"),
        ("nothing.ssd", "<System>: no component has an FMU"),
    ] {
        let ended = folder.pilotage(&["cosim", system, "--stop-time", "1", "--step", "0.1"]);
        assert!(
            ended.code == 2 && ended.stderr.contains(message),
            "{system}: {ended:?}"
        );
    }
}

#[test]
fn variants_that_are_none() {
    let folder = Folder::new();
    super::parts::nested(&folder);
    let run = |arguments: &[&str]| {
        let time = ["--stop-time", "2", "--step", "0.1"];
        let ended = folder.pilotage(&[&["cosim"], arguments, &time].concat());
        assert_eq!(ended.code, 2, "{ended:?}");
        ended.stderr
    };
    assert_eq!(
        run(&["nested.ssp", "--variant", "heavy"]),
        "error: nested.ssp has no variant `heavy`; there are `Root-System`\n"
    );
    assert!(
        run(&["nested/resources/lag.fmu", "--variant", "heavy"])
            .starts_with("error: --variant is given, and there is no SSP")
    );
    rows(&folder, &["nested.ssp", "--variant", "Root-System"]);
}
