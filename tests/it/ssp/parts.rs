//! Each part of the standard, against the same system as a file of pilotage: the rows are the same bytes.

use super::{notes, rows, ssd, ssv, write};
use crate::command::Folder;

/// Nested systems whose names are no identifiers, a dictionary, bindings on three levels with prefix and mapping, units,
/// transformations, connections in both directions, a default experiment.
pub const NESTED: &str = r#"
<ssd:Connectors>
  <ssd:Connector name="level" kind="parameter"><ssc:Real unit="cm"/></ssd:Connector>
  <ssd:Connector name="seen" kind="output"><ssc:Real unit="m"/></ssd:Connector>
</ssd:Connectors>
<ssd:ParameterBindings>
  <ssd:ParameterBinding source="resources/deep%20er/all.ssv">
    <ssd:ParameterMapping source="resources/map.ssm"/>
  </ssd:ParameterBinding>
  <ssd:ParameterBinding prefix="inner-1."><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>
    <ssv:Parameter name="second lag.gain"><ssv:Real value="3"/></ssv:Parameter>
  </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>
</ssd:ParameterBindings>
<ssd:Elements>
  <ssd:Component name="first" source="resources/lag.fmu" implementation="ModelExchange">
    <ssd:Connectors>
      <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="y" kind="output"><ssc:Real unit="m"/></ssd:Connector>
      <ssd:Connector name="level" kind="parameter"><ssc:Real unit="m"/></ssd:Connector>
    </ssd:Connectors>
    <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p">
      <ssv:Parameters>
        <ssv:Parameter name="gain"><ssv:Real value="7"/></ssv:Parameter>
        <ssv:Parameter name="u"><ssv:Real value="0.5"/></ssv:Parameter>
      </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
  </ssd:Component>
  <ssd:System name="inner-1">
    <ssd:Connectors>
      <ssd:Connector name="in" kind="input"><ssc:Real unit="m"/></ssd:Connector>
      <ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector>
    </ssd:Connectors>
    <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p">
      <ssv:Parameters>
        <ssv:Parameter name="second lag.gain"><ssv:Real value="5"/></ssv:Parameter>
        <ssv:Parameter name="second lag.tau"><ssv:Real value="200" unit="ms"/></ssv:Parameter>
      </ssv:Parameters>
      <ssv:Units><ssc:Unit name="ms"><ssc:BaseUnit s="1" factor="0.001"/></ssc:Unit></ssv:Units>
    </ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
    <ssd:Elements>
      <ssd:Component name="second lag" source="./resources/lag.fmu" implementation="CoSimulation">
        <ssd:Connectors>
          <ssd:Connector name="u" kind="input"><ssc:Real unit="m"/></ssd:Connector>
          <ssd:Connector name="y" kind="output"><ssc:Real unit="m"/></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
      <ssd:SignalDictionaryReference name="bus" dictionary="signals">
        <ssd:Connectors><ssd:Connector name="b" kind="inout"><ssc:Real/></ssd:Connector></ssd:Connectors>
      </ssd:SignalDictionaryReference>
      <ssd:Component name="third" source="resources/feet.fmu">
        <ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real unit="None"/></ssd:Connector></ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startConnector="in" endElement="second lag" endConnector="u">
        <ssc:LinearTransformation factor="2" offset="0.25"/>
      </ssd:Connection>
      <ssd:Connection startElement="second lag" startConnector="y" endConnector="out"/>
      <ssd:Connection startElement="second lag" startConnector="y" endElement="bus" endConnector="b"/>
      <ssd:Connection startElement="third" startConnector="u" endElement="bus" endConnector="b"/>
    </ssd:Connections>
  </ssd:System>
  <ssd:SignalDictionaryReference name="bus" dictionary="signals">
    <ssd:Connectors><ssd:Connector name="a" kind="inout"><ssc:Real/></ssd:Connector></ssd:Connectors>
  </ssd:SignalDictionaryReference>
  <ssd:Component name="last" source="resources/feet.fmu">
    <ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real unit="ft"/></ssd:Connector></ssd:Connectors>
  </ssd:Component>
</ssd:Elements>
<ssd:Connections>
  <ssd:Connection startElement="first" startConnector="y" endElement="bus" endConnector="a"/>
  <ssd:Connection startElement="bus" startConnector="a" endElement="inner-1" endConnector="in"/>
  <ssd:Connection startElement="last" startConnector="u" endElement="inner-1" endConnector="out" suppressUnitConversion="true">
    <ssc:LinearTransformation factor="-0.5"/>
  </ssd:Connection>
  <ssd:Connection startElement="first" startConnector="y" endConnector="seen"/>
  <ssd:Connection startConnector="level" endElement="first" endConnector="level"/>
</ssd:Connections>
<ssd:SignalDictionaries><ssd:SignalDictionary name="signals" source="resources/signals.ssb"/></ssd:SignalDictionaries>
"#;

/// After the system.
pub const AFTER: &str = r#"<ssd:Units>
  <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit><ssc:Unit name="cm"><ssc:BaseUnit m="1" factor="0.01"/></ssc:Unit>
  <ssc:Unit name="ft"><ssc:BaseUnit m="1" factor="0.3048"/></ssc:Unit>
</ssd:Units>
<ssd:DefaultExperiment startTime="1" stopTime="4">
  <ssd:Annotations><ssc:Annotation type="org.example.solver"><x xmlns="urn:x" stepSize="9"/></ssc:Annotation></ssd:Annotations>
</ssd:DefaultExperiment>"#;

/// The files beside it.
pub const SIGNALS: &str = r#"<ssb:SignalDictionary xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0">
<ssb:DictionaryEntry name="a"><ssc:Real unit="m"/></ssb:DictionaryEntry>
<ssb:DictionaryEntry name="b"><ssc:Real unit="m"/></ssb:DictionaryEntry>
<ssb:Units><ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit></ssb:Units>
</ssb:SignalDictionary>
"#;
pub const MAP: &str = r#"<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0">
<ssm:MappingEntry source="k" target="first.gain"><ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>
<ssm:MappingEntry source="height" target="level"/>
<ssm:MappingEntry source="nothing" target="first.tau"/>
</ssm:ParameterMapping>
"#;

pub fn values() -> String {
    ssv(
        &[
            ("k", "<ssv:Real value=\"1.5\"/>"),
            ("height", "<ssv:Real value=\"25\" unit=\"cm\"/>"),
            ("first.tau", "<ssv:Real value=\"99\"/>"),
        ],
        "<ssv:Units><ssc:Unit name=\"cm\"><ssc:BaseUnit m=\"1\" factor=\"0.01\"/></ssc:Unit></ssv:Units>",
    )
}

/// The same as a file of pilotage.
const SAME: &str = r#"
[experiment]
start_time = 1
stop_time = 4
[system.first]
model = "nested/resources/lag.fmu"
kind = "me"
set = { gain = 4, u = 0.5, level = 0.25 }
[system."inner-1.second lag"]
model = "nested/resources/lag.fmu"
kind = "cs"
set = { gain = 3, tau = 0.2 }
[system."inner-1.third"]
model = "nested/resources/feet.fmu"
[system.last]
model = "nested/resources/feet.fmu"
[connect]
"first.y" = { to = "inner-1.second lag.u", factor = 2, offset = 0.25 }
"inner-1.second lag.y" = ["inner-1.third.u", { to = "last.u", factor = -0.5, convert_units = false }]
"#;

/// Writes `nested.ssp` and the folder `nested`.
pub fn nested(folder: &Folder) {
    let text = ssd("1.0", NESTED, AFTER);
    let values = values();
    let files = [
        ("SystemStructure.ssd", text.as_str()),
        ("resources/signals.ssb", SIGNALS),
        ("resources/map.ssm", MAP),
        ("resources/deep er/all.ssv", &values),
    ];
    write(folder, "nested", &files);
}

#[test]
fn nested_systems_dictionaries_and_bindings() {
    let folder = Folder::new();
    nested(&folder);
    folder.write("same.toml", SAME);
    let expected = rows(&folder, &["same.toml"]);
    // From 1 s to 4 s, and something moves.
    let last = expected.lines().last().unwrap();
    assert!(
        last.starts_with("4,") && expected.lines().count() == 32,
        "{expected}"
    );
    let header = expected.lines().next().unwrap();
    assert!(header.contains("inner-1.second lag.y [m]"), "{header}");
    let ends: Vec<f64> = last.split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!(ends[1..].iter().all(|end| end.abs() > 0.1), "{last}");
    for system in ["nested.ssp", "nested", "nested/SystemStructure.ssd"] {
        assert_eq!(rows(&folder, &[system]), expected, "{system}");
    }
    // Arguments go before the file.
    let more = [
        "--stop-time",
        "2",
        "--start-time",
        "0",
        "--set",
        "first.gain=1",
    ];
    let [theirs, ours] =
        ["nested.ssp", "same.toml"].map(|system| rows(&folder, &[&[system], &more[..]].concat()));
    assert_eq!(theirs, ours);
    // The unpacked files are gone, and the commands take it as they take a system file.
    let info = folder.pilotage(&["info", "nested.ssp", "--json"]).json();
    assert_eq!(info["annotations"][0], "org.example.solver");
    // A value that the mapping leaves out, and one of it that there is not.
    assert_eq!(info["notes"].as_array().unwrap().len(), 2, "{info}");
    let unpacked = info["instances"][0]["model"].as_str().unwrap();
    assert!(!std::path::Path::new(unpacked).exists(), "{unpacked}");
    let valid = folder.pilotage(&["validate", "nested.ssp", "--no-run"]);
    assert!(valid.stdout.contains("its 3 connections fit"), "{valid:?}");
    let linear = |system| folder.pilotage(&["linearize", system, "--json"]).json()["poles"].clone();
    assert_eq!(linear("nested.ssp"), linear("same.toml"));
}

#[test]
fn a_sweep_takes_it() {
    let folder = Folder::new();
    nested(&folder);
    folder.write("same.toml", SAME);
    let sweep = |system, to| {
        let vary = ["--vary", "first.gain=1:3:3", "--step", "0.1", "-o", to];
        let ended = folder.pilotage(&[&["sweep", system], &vary[..]].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        folder.read(&format!("{to}/sweep.csv"))
    };
    assert_eq!(sweep("nested.ssp", "a"), sweep("same.toml", "b"));
}

/// Values of all types, by mappings of all kinds; a set in an FMU; an enumeration by name would be one of its items.
#[test]
fn values_of_all_types() {
    let folder = Folder::new();
    let system = r#"<ssd:Elements><ssd:Component name="typed" source="resources/typed.fmu"><ssd:ParameterBindings>
      <ssd:ParameterBinding source="resources/values.ssv"><ssd:ParameterMapping><ssm:ParameterMapping version="1.0">
        <ssm:MappingEntry source="n" target="n_in"><ssc:IntegerMappingTransformation>
          <ssc:MapEntry source="1" target="5"/><ssc:MapEntry source="2" target="7"/>
        </ssc:IntegerMappingTransformation></ssm:MappingEntry>
        <ssm:MappingEntry source="flag" target="flag_in"><ssc:BooleanMappingTransformation>
          <ssc:MapEntry source="false" target="true"/>
        </ssc:BooleanMappingTransformation></ssm:MappingEntry>
        <ssm:MappingEntry source="text" target="text_in"/>
        <ssm:MappingEntry source="rate" target="k" suppressUnitConversion="true"/>
      </ssm:ParameterMapping></ssd:ParameterMapping></ssd:ParameterBinding>
      <ssd:ParameterBinding source="documentation/late.ssv" sourceBase="component"/>
    </ssd:ParameterBindings></ssd:Component></ssd:Elements>"#;
    let values = ssv(
        &[
            ("n", "<ssv:Integer value=\"2\"/>"),
            ("flag", "<ssv:Boolean value=\"0\"/>"),
            ("text", "<ssv:String value=\"a &amp; b\"/>"),
            ("rate", "<ssv:Real value=\"3\" unit=\"s\"/>"),
        ],
        "",
    );
    let text = ssd("2.0", system, "");
    write(
        &folder,
        "typed",
        &[
            ("SystemStructure.ssd", &text),
            ("resources/values.ssv", &values),
        ],
    );
    // The FMU with a parameter set inside.
    let late = ssv(&[("u", "<ssv:Real value=\"3\"/>")], "");
    let fmu = std::fs::read(folder.path("typed/resources/typed.fmu")).unwrap();
    let mut zip = zip::ZipWriter::new_append(std::io::Cursor::new(fmu)).unwrap();
    zip.start_file(
        "documentation/late.ssv",
        zip::write::SimpleFileOptions::default(),
    )
    .unwrap();
    std::io::Write::write_all(&mut zip, late.as_bytes()).unwrap();
    folder.write(
        "typed/resources/typed.fmu",
        zip.finish().unwrap().into_inner(),
    );
    folder.write(
        "same.toml",
        "[system.typed]\nmodel = \"typed/resources/typed.fmu\"\n\
         set = { n_in = 7, flag_in = true, text_in = \"a & b\", k = 3, u = 3 }\n",
    );
    let time = ["--stop-time", "1"];
    assert_eq!(
        rows(&folder, &[&["typed"], &time[..]].concat()),
        rows(&folder, &[&["same.toml"], &time[..]].concat())
    );
    let info = folder.pilotage(&["info", "typed", "--json"]).json();
    let set = serde_json::json!({ "n_in": "7", "flag_in": "true", "text_in": "a & b", "k": "3", "u": "3" });
    assert_eq!(info["instances"][0]["set"], set);
}

/// Systems by reference: of another archive with a variant, of an `.ssd`, and of an element with an id, twice.
#[test]
fn systems_of_other_files() {
    let folder = Folder::new();
    let lag = |name: &str, gain: &str, source: &str| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"{source}\"><ssd:ParameterBindings><ssd:ParameterBinding>\
             <ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\"><ssv:Parameters>\
             <ssv:Parameter name=\"level\"><ssv:Real value=\"{gain}\"/></ssv:Parameter>\
             </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>\
             </ssd:Component>"
        )
    };
    let inner = |level: &str| {
        ssd(
            "1.0",
            &format!(
                "<ssd:Elements>{}</ssd:Elements>",
                lag("lag", level, "resources/lag.fmu")
            ),
            "",
        )
    };
    let (one, two) = (
        inner("1"),
        inner("2").replace("\"Root-System\">\n<", "\"heavy\">\n<"),
    );
    write(
        &folder,
        "inner",
        &[("SystemStructure.ssd", &one), ("Heavy.ssd", &two)],
    );
    let archive = std::fs::read(folder.path("inner.ssp")).unwrap();
    let elements = format!(
        "<ssd:Elements>\
         <ssd:Component name=\"a\" type=\"application/x-ssp-package\" source=\"resources/inner.ssp#Heavy.ssd\"/>\
         <ssd:Component name=\"b\" type=\"application/x-ssp-definition\" source=\"Sub.ssd\"/>\
         <ssd:System name=\"c\" id=\"twice\"><ssd:Elements>{}</ssd:Elements></ssd:System>\
         <ssd:Component name=\"d\" source=\"#twice\"/></ssd:Elements>",
        lag("lag", "4", "resources/lag.fmu")
    );
    write(
        &folder,
        "outer",
        &[
            ("SystemStructure.ssd", &ssd("2.0", &elements, "")),
            ("Sub.ssd", &inner("3")),
        ],
    );
    folder.write("outer/resources/inner.ssp", archive);
    let instance = |name, level| {
        format!(
            "[system.\"{name}.lag\"]\nmodel = \"outer/resources/lag.fmu\"\nset = {{ level = {level} }}\n"
        )
    };
    folder.write(
        "same.toml",
        [("a", 2), ("b", 3), ("c", 4), ("d", 4)]
            .map(|(name, level)| instance(name, level))
            .concat(),
    );
    let time = ["--stop-time", "1"];
    let expected = rows(&folder, &[&["same.toml"], &time[..]].concat());
    assert_eq!(rows(&folder, &[&["outer"], &time[..]].concat()), expected);
    // Variants of one archive, by name and by file.
    let variant = |name| {
        rows(
            &folder,
            &[&["inner.ssp", "--variant", name], &time[..]].concat(),
        )
    };
    assert_eq!(variant("heavy"), variant("Heavy.ssd"));
    assert_ne!(variant("heavy"), variant("Root-System"));
    let info = folder.pilotage(&["info", "inner.ssp"]);
    assert!(
        info.stdout.contains("variants: heavy, Root-System"),
        "{info:?}"
    );
}

/// Elements of an array of FMI 3.0, by indices and as a whole, and a value for each.
#[test]
fn arrays() {
    let folder = Folder::new();
    folder.write("a/resources/typed.fmu", crate::foreign::fmu3("good"));
    let text = |values: &str| {
        let system = format!(
            "<ssd:Elements><ssd:Component name=\"a\" source=\"resources/typed.fmu\"><ssd:ParameterBindings>\
             <ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version=\"2.0\" name=\"p\"><ssv:Parameters>\
             <ssv:Parameter name=\"array\"><ssv:Float64 value=\"{values}\"/><ssc:Dimension size=\"3\"/></ssv:Parameter>\
             </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>\
             </ssd:Component><ssd:Component name=\"b\" source=\"resources/typed.fmu\"/></ssd:Elements>\
             <ssd:Connections>\
             <ssd:Connection startElement=\"a\" startConnector=\"sums\" endElement=\"b\" endConnector=\"array\"/>\
             <ssd:Connection startElement=\"b\" startConnector=\"sums\" startIndices=\"2\" endElement=\"a\" \
             endConnector=\"array\" endIndices=\"1\"/></ssd:Connections>"
        );
        ssd("2.0", &system, "")
    };
    folder.write("a/SystemStructure.ssd", text("1 2 3"));
    folder.write(
        "same.toml",
        "[system.a]\nmodel = \"a/resources/typed.fmu\"\nset = { \"array[2]\" = 2, \"array[3]\" = 3 }\n\
         [system.b]\nmodel = \"a/resources/typed.fmu\"\n\
         [connect]\n\"a.sums\" = \"b.array\"\n\"b.sums[2]\" = \"a.array[1]\"\n",
    );
    let time = ["--stop-time", "1"];
    let run = |system| rows(&folder, &[&[system], &time[..]].concat());
    let expected = run("same.toml");
    assert!(
        expected
            .lines()
            .last()
            .unwrap()
            .split(',')
            .any(|cell| cell.parse::<f64>().unwrap() > 2.0)
    );
    assert_eq!(run("a"), expected);
    let converted = folder.pilotage(&["convert", "same.toml", "b.ssp"]);
    assert_eq!(converted.code, 0, "{converted:?}");
    assert_eq!(run("b.ssp"), expected);
    for (values, message) in [
        ("1 2", "2 values for `a.array`, which has other dimensions"),
        ("1 x 3", "<Parameter>: `x` is no value of <Float64>"),
    ] {
        folder.write("a/SystemStructure.ssd", text(values));
        let ended = folder.pilotage(&["cosim", "a", "--stop-time", "1", "--step", "0.1"]);
        assert!(
            ended.code == 2 && ended.stderr.contains(message),
            "{ended:?}"
        );
    }
}

/// An enumeration by an item's name, mapped from another, and by a number.
#[test]
fn enumerations() {
    let folder = Folder::new();
    let types = "<TypeDefinitions><SimpleType name=\"E\"><Enumeration><Item name=\"one\" value=\"1\"/>\
                 <Item name=\"two\" value=\"2\"/></Enumeration></SimpleType></TypeDefinitions><LogCategories>";
    let description = crate::foreign::DESCRIPTION
        .replacen("<LogCategories>", types, 1)
        .replacen(
            "<Integer start=\"0\"/>",
            "<Enumeration declaredType=\"E\" start=\"1\"/>",
            1,
        );
    let fmu = crate::foreign::fmu("good");
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(fmu)).unwrap();
    let entry = crate::foreign::binary_entry();
    let mut binary = Vec::new();
    std::io::Read::read_to_end(&mut zip.by_name(&entry).unwrap(), &mut binary).unwrap();
    let changed = crate::foreign::archive(&[
        ("modelDescription.xml", description.as_bytes()),
        (&entry, &binary),
    ]);
    folder.write("s/resources/e.fmu", changed);
    let one = |name: &str, value: &str, mapping: &str| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"resources/e.fmu\"><ssd:ParameterBindings><ssd:ParameterBinding>\
             <ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\"><ssv:Parameters>\
             <ssv:Parameter name=\"n_in\">{value}</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>\
             </ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings></ssd:Component>"
        )
    };
    let mapping = "<ssd:ParameterMapping><ssm:ParameterMapping version=\"1.0\"><ssm:MappingEntry source=\"n_in\" \
                   target=\"n_in\"><ssc:EnumerationMappingTransformation><ssc:MapEntry source=\"deux\" target=\"two\"/>\
                   </ssc:EnumerationMappingTransformation></ssm:MappingEntry></ssm:ParameterMapping></ssd:ParameterMapping>";
    let elements = [
        one("a", "<ssv:Enumeration value=\"two\"/>", ""),
        one("b", "<ssv:Enumeration value=\"deux\"/>", mapping),
        one("c", "<ssv:Integer value=\"2\"/>", ""),
    ];
    let system = format!("<ssd:Elements>{}</ssd:Elements>", elements.concat());
    folder.write("s/SystemStructure.ssd", ssd("1.0", &system, ""));
    let run = |system| rows(&folder, &[system, "--stop-time", "1"]);
    let found = run("s");
    let header: Vec<&str> = found.lines().next().unwrap().split(',').collect();
    let last: Vec<&str> = found.lines().last().unwrap().split(',').collect();
    for name in ["a.n", "b.n", "c.n"] {
        let place = header.iter().position(|own| *own == name).unwrap();
        // It counts one on.
        assert_eq!(last[place], "3", "{name}");
    }
    for (from, to) in [("s", "a.toml"), ("a.toml", "b.ssp"), ("b.ssp", "c.toml")] {
        assert_eq!(folder.pilotage(&["convert", from, to]).code, 0);
    }
    assert_eq!(
        folder.read("c.toml").replace("\"c/", "\"s/resources/"),
        folder.read("a.toml")
    );
    assert_eq!(run("b.ssp"), found);
}

/// Other values on connections, through a system's connector: 1 is 5, and 5 is 7; true is false. The FMU counts one on, and
/// negates. Values of connectors go the same way.
#[test]
fn maps_on_connections() {
    let folder = Folder::new();
    let map = |kind: &str, pairs: &[[&str; 2]]| {
        let entry =
            |[from, to]: &[&str; 2]| format!("<ssc:MapEntry source=\"{from}\" target=\"{to}\"/>");
        let entries: String = pairs.iter().map(entry).collect();
        format!("<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>")
    };
    let first = map("Integer", &[["1", "5"], ["2", "2"]]);
    let second = map("Integer", &[["5", "7"], ["2", "3"]]);
    let third = map("Boolean", &[["1", "0"]]);
    let system = format!(
        r#"<ssd:Elements>
  <ssd:Component name="a" source="resources/typed.fmu"/>
  <ssd:System name="s">
    <ssd:Connectors><ssd:Connector name="n" kind="input"/><ssd:Connector name="m" kind="input"/></ssd:Connectors>
    <ssd:Elements><ssd:Component name="b" source="resources/typed.fmu"/><ssd:Component name="c" source="resources/typed.fmu"/></ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startConnector="n" endElement="b" endConnector="n_in">{second}</ssd:Connection>
      <ssd:Connection startConnector="m" endElement="c" endConnector="n_in">{second}</ssd:Connection>
      <ssd:Connection startElement="b" startConnector="flag" endElement="c" endConnector="flag_in">{third}</ssd:Connection>
    </ssd:Connections>
  </ssd:System>
</ssd:Elements>
<ssd:Connections>
  <ssd:Connection startElement="a" startConnector="n" endElement="s" endConnector="n">{first}</ssd:Connection>
</ssd:Connections>
<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>
  <ssv:Parameter name="s.m"><ssv:Integer value="5"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"#
    );
    let oms = r#"<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:Annotations xmlns:oms="x">
        <oms:SimulationInformation><oms:FixedStepMaster description="oms-ma" stepSize="0.25"/></oms:SimulationInformation>
        </oms:Annotations></ssc:Annotation></ssd:Annotations>"#;
    let experiment = r#"<ssd:DefaultExperiment startTime="0" stopTime="1"/>"#;
    let text = ssd("1.0", &(system + oms), experiment);
    write(&folder, "s", &[("SystemStructure.ssd", &text)]);
    for (from, to) in [("s", "a.toml"), ("a.toml", "b.ssp")] {
        assert_eq!(folder.pilotage(&["convert", from, to]).code, 0);
    }
    let last = |system: &str, start: &str| -> Vec<f64> {
        let record = ["--record", "s.b.n,s.c.n,s.c.flag"];
        let ended = folder.pilotage(&[&["cosim", system, "--set", start], &record[..]].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let text = folder.read("result.csv");
        let rows: Vec<&str> = text.lines().collect();
        // The step is OMSimulator's.
        assert_eq!(rows.len(), 6, "{text}");
        let last = rows[5].split(',').skip(1);
        last.map(|number| number.parse().unwrap()).collect()
    };
    // `b.flag` is true, so that `c.flag` is too.
    for system in ["s", "s.ssp", "a.toml", "b.ssp"] {
        assert_eq!(last(system, "a.n_in=0"), [8.0, 8.0, 1.0], "{system}");
        assert_eq!(last(system, "a.n_in=1"), [4.0, 8.0, 1.0], "{system}");
        assert_eq!(last(system, "a.n_in=10"), [12.0, 8.0, 1.0], "{system}");
    }
}

/// The system of a problem file: the time constant is found again, and the FMU lies beside the fitted system.
#[test]
fn a_fit_takes_it() {
    let folder = Folder::new();
    let system = "<ssd:Elements><ssd:Component name=\"lag\" source=\"resources/lag.fmu\"><ssd:ParameterBindings>\
        <ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\"><ssv:Parameters>\
        <ssv:Parameter name=\"level\"><ssv:Real value=\"2\"/></ssv:Parameter>\
        </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>\
        </ssd:Component></ssd:Elements>";
    write(
        &folder,
        "s",
        &[("SystemStructure.ssd", &ssd("1.0", system, ""))],
    );
    let recorded = rows(
        &folder,
        &["s.ssp", "--stop-time", "2", "--set", "lag.tau=0.3"],
    );
    folder.write("run.csv", recorded.replace("lag.y [m]", "y [m]"));
    folder.write(
        "problem.toml",
        "system = \"s.ssp\"\n[[run]]\nfile = \"run.csv\"\n[[measured]]\ncolumn = \"y\"\nsignal = \"lag.y\"\n\
         [parameters]\n\"lag.tau\" = {}\n",
    );
    let ended = folder.pilotage(&["fit", "problem.toml", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let found = ended.json()["parameters"]["lag.tau"]["value"]
        .as_f64()
        .unwrap();
    assert!((found - 0.3).abs() < 1e-3, "{found}");
    rows(&folder, &["lag-fitted.toml", "--stop-time", "2"]);
    assert!(
        folder
            .read("lag-fitted.toml")
            .contains("model = \"lag-fitted.fmu\"")
    );
    // A mistake in the SSP is told with both places.
    folder.write("s.ssp", "no archive");
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert!(
        ended.code == 2 && ended.stderr.starts_with("error: problem.toml:1:10: "),
        "{ended:?}"
    );
}

/// Values come in the unit of the FMU's variable, whether its component lists it as a connector or not, and a mapping says what it
/// leaves out.
#[test]
fn connectors_that_are_not_listed_have_units() {
    let folder = Folder::new();
    let system = r#"<ssd:Connectors>
  <ssd:Connector name="height" kind="parameter"><ssc:Real unit="ft"/></ssd:Connector>
</ssd:Connectors>
<ssd:ParameterBindings><ssd:ParameterBinding source="resources/v.ssv"><ssd:ParameterMapping><ssm:ParameterMapping version="1.0">
  <ssm:MappingEntry source="h" target="height"/>
</ssm:ParameterMapping></ssd:ParameterMapping></ssd:ParameterBinding></ssd:ParameterBindings>
<ssd:Elements><ssd:Component name="lag" type="application/x-fmu-sharedlibrary" source="resources/lag.fmu"/></ssd:Elements>
<ssd:Connections><ssd:Connection startConnector="height" endElement="lag" endConnector="level"/></ssd:Connections>"#;
    let set = ssv(
        &[
            ("h", "<ssv:Real value=\"10\" unit=\"ft\"/>"),
            ("other", "<ssv:Real value=\"1\"/>"),
        ],
        "<ssv:Units><ssc:Unit name=\"ft\"><ssc:BaseUnit m=\"1\" factor=\"0.3048\"/></ssc:Unit></ssv:Units>",
    );
    let files = [
        ("SystemStructure.ssd", ssd("1.0", system, AFTER)),
        ("resources/v.ssv", set),
    ];
    let files: Vec<(&str, &str)> = files
        .iter()
        .map(|(name, text)| (*name, text.as_str()))
        .collect();
    write(&folder, "plain", &files);
    let ended = folder.pilotage(&["info", "plain.ssp"]);
    assert!(ended.stdout.contains("level = 3.048"), "{ended:?}");
    let said = notes(&ended);
    assert!(
        said.iter()
            .any(|line| line.contains("does not name `other`")),
        "{said:?}"
    );
}
