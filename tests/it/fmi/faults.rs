//! One fault planted in a good FMU's archive, files, binary or behaviour, and the finding that
//! `pilotage validate` must have. Faults of the description are in `findings.rs`.

use super::faults_files::{BUILD_FAULTS, TERMINAL_FAULTS};
use super::findings::pairs;
use super::{faults2, faults3};
use crate::command::{Folder, waiting};
use crate::foreign::{self, archive};
use pilotage::fmi::platform;
use rayon::prelude::*;
use std::io::{Cursor, Write};
use std::path::Path;
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// The description that fits `foreign/faulty.rs`; the GUID says its fault.
const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="faulty" guid="FAULT" variableNamingConvention="structured" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="faulty" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <CoSimulation modelIdentifier="faulty" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true" maxOutputDerivativeOrder="1"/>
  <UnitDefinitions>
    <Unit name="1/s"><BaseUnit s="-1"/></Unit>
  </UnitDefinitions>
  <LogCategories><Category name="logStatusWarning"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="1" tolerance="0.001" stepSize="0.1"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" initial="exact"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="k" valueReference="2" causality="parameter" variability="fixed"><Real unit="1/s" start="1"/></ScalarVariable>
    <ScalarVariable name="der(y)" valueReference="3" causality="local"><Real derivative="2"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies="2" dependenciesKind="constant"/></Outputs>
    <Derivatives><Unknown index="4" dependencies="1 2"/></Derivatives>
    <InitialUnknowns><Unknown index="4" dependencies="1 2 3"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

fn description(fault: &str) -> String {
    DESCRIPTION.replace("FAULT", fault)
}

/// Folder and name of this machine's binary.
fn binary_entry() -> String {
    foreign::binary_entry().replace("foreign", "faulty")
}

/// The files of the good FMU.
fn files() -> Vec<(String, Vec<u8>)> {
    vec![
        ("modelDescription.xml".into(), description("good").into()),
        (binary_entry(), foreign::faulty().to_vec()),
        ("documentation/index.html".into(), b"<p>good</p>".to_vec()),
    ]
}

fn packed(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let files: Vec<(&str, &[u8])> = (files.iter()).map(|(n, c)| (n.as_str(), &c[..])).collect();
    archive(&files)
}

/// The good FMU with one more file.
fn with_file(name: &str, content: &[u8]) -> Vec<u8> {
    let mut files = files();
    files.push((name.into(), content.into()));
    packed(&files)
}

/// The good FMU with a file renamed.
fn renamed(from: &str, to: &str) -> Vec<u8> {
    let mut files = files();
    let mut renamed = files.iter_mut().filter(|(name, _)| name == from);
    renamed.next().expect("the file is there").0 = to.into();
    packed(&files)
}

/// The good FMU without a file.
fn without(name: &str) -> Vec<u8> {
    let mut files = files();
    files.retain(|(other, _)| other != name);
    packed(&files)
}

/// The good FMU with another binary.
fn with_binary(content: &[u8]) -> Vec<u8> {
    let mut files = files();
    files[1].1 = content.to_vec();
    packed(&files)
}

/// The description of that fault with a replacement.
fn described_as(fault: &str, from: &str, to: &str) -> String {
    assert_eq!(DESCRIPTION.matches(from).count(), 1, "{from}");
    description(fault).replace(from, to)
}

/// The good FMU with a replacement in its description.
fn described(from: &str, to: &str) -> Vec<u8> {
    let mut files = files();
    files[0].1 = described_as("good", from, to).into();
    packed(&files)
}

/// The good FMU whose binary has that fault.
fn behaving(fault: &str) -> Vec<u8> {
    let mut files = files();
    files[0].1 = description(fault).into();
    packed(&files)
}

/// Every occurrence of a name in the archive replaced by one of the same length.
fn patched(mut bytes: Vec<u8>, from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let places: Vec<usize> = (0..bytes.len() - from.len())
        .filter(|&at| bytes[at..].starts_with(from.as_bytes()))
        .collect();
    assert!(!places.is_empty(), "{from}");
    for at in places {
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    }
    bytes
}

/// An entry named `name`, which an archive's writer would not allow.
fn with_entry(name: &str) -> Vec<u8> {
    let placeholder = "q".repeat(name.len());
    patched(with_file(&placeholder, b"x"), &placeholder, name)
}

/// A number in the central directory's entry of the last file, changed.
fn with_field(at: usize, value: &[u8]) -> Vec<u8> {
    let mut bytes = packed(&files());
    let entry = (0..bytes.len() - 4)
        .rev()
        .find(|&at| bytes[at..].starts_with(b"PK\x01\x02"))
        .expect("a directory");
    bytes[entry + at..entry + at + value.len()].copy_from_slice(value);
    bytes
}

fn stored(name: &str, method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (file, content) in files() {
        let method = match file == name {
            true => method,
            false => CompressionMethod::Deflated,
        };
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file(file, options).unwrap();
        zip.write_all(&content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn with_link() -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default();
    for (name, content) in files() {
        zip.start_file(name, options).unwrap();
        zip.write_all(&content).unwrap();
    }
    zip.add_symlink("resources", "/etc", options).unwrap();
    zip.finish().unwrap().into_inner()
}

/// What `validate` says of an FMU: the exit code and the findings, this machine's folder as `ENTRY`.
fn validated(content: &[u8]) -> (i32, Vec<String>) {
    let folder = Folder::new();
    folder.write("a.fmu", content);
    let ended = folder.pilotage(&["validate", "--time-limit", "3", "a.fmu"]);
    assert_eq!(ended.stderr, "");
    let lines = ended.stdout.lines().skip(1);
    let plain = |line: &str| line.trim().replace(&binary_entry(), "ENTRY");
    (ended.code, lines.map(plain).collect())
}

/// A fault's name, the FMU that has it, and how the finding begins.
type Case = (&'static str, Vec<u8>, &'static str);

/// All of them. `docs/peers.md` refers to their names.
fn cases() -> Vec<Case> {
    [
        archives(),
        files_beside_the_description(),
        binaries(),
        behaviour(),
    ]
    .concat()
}

#[test]
fn each_fault_is_found() {
    check(&cases());
}

/// The numbers in the chapters are those of the lists.
#[test]
fn the_chapters_count_the_faults() {
    let [of2, of3] = [faults2::FAULTS, faults3::FAULTS].map(|faults| pairs(faults).len());
    let others = cases().len() + TERMINAL_FAULTS.len() + BUILD_FAULTS.len();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = |file: &str| {
        std::fs::read_to_string(root.join(file))
            .unwrap()
            .replace('\n', " ")
    };
    let chapter = text("docs/fmus.md");
    for said in [
        format!(
            "each of {of2} faults planted in a good description of FMI 2.0 and {of3} in one of FMI 3.0"
        ),
        format!("It finds {others} more in archives"),
    ] {
        assert!(chapter.contains(&said), "docs/fmus.md does not say: {said}");
    }
    let peers = text("docs/peers.md");
    for said in [format!("| FMI 2 | {of2} |"), format!("| FMI 3 | {of3} |")] {
        assert!(peers.contains(&said), "docs/peers.md does not say: {said}");
    }
}

/// Each fault gives the expected finding, and the exit code fits its severity.
fn check(cases: &[(&str, Vec<u8>, &str)]) {
    let wrong = cases.par_iter().filter_map(|(what, content, expected)| {
        let (code, findings) = validated(content);
        let is_error = findings.iter().any(|f| f.starts_with("error"));
        let is_found = findings.iter().any(|f| f.starts_with(expected));
        let is_right = is_found && code == i32::from(is_error);
        let found = findings.join("\n  ");
        (!is_right).then(|| format!("{what}: code {code}, expected {expected}\n  {found}"))
    });
    let wrong: Vec<String> = waiting(|| wrong.collect());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The FMU that the faults are planted in has none.
#[test]
fn the_good_fmu_is_clean() {
    assert_eq!(validated(&packed(&files())), (0, vec![]));
    assert_eq!(
        validated(&stored(
            "documentation/index.html",
            CompressionMethod::Stored
        )),
        (0, vec![])
    );
}

/// FMI rule 17: methods, versions, encryption, links, backslashes; and names that would leave the folder.
fn archives() -> Vec<Case> {
    vec![
        (
            "traversal",
            with_entry("../evil"),
            "error: entry `../evil` leaves the archive's folder by `..`",
        ),
        (
            "traversal inside",
            with_entry("resources/../../evil"),
            "error: entry `resources/../../evil` leaves",
        ),
        (
            "absolute",
            with_entry("/tmp/evil"),
            "error: entry `/tmp/evil` has an absolute path",
        ),
        (
            "drive",
            with_entry("C:evil"),
            "error: entry `C:evil` has an absolute path",
        ),
        (
            "backslash",
            with_entry("resources\\a"),
            "error: entry `resources\\a` has a backslash in its path",
        ),
        (
            "control character",
            with_entry("extra/a.b/\n"),
            "error: entry `extra/a.b/\\n` is not a file name",
        ),
        (
            "empty part",
            with_entry("resources//a"),
            "error: entry `resources//a` is not a file name",
        ),
        (
            "twice",
            with_entry("documentation/index.html"),
            "error: entry `documentation/index.html` is there twice",
        ),
        (
            "twice but for case",
            with_file("Documentation/index.html", b""),
            "warning: entries `documentation/index.html` and `Documentation/index.html` differ by case alone",
        ),
        ("link", with_link(), "error: entry `resources` is a link"),
        (
            "encrypted",
            with_field(8, &1_u16.to_le_bytes()),
            "error: entry `documentation/index.html` is encrypted",
        ),
        (
            "method",
            with_field(10, &12_u16.to_le_bytes()),
            "error: entry `documentation/index.html` uses compression method 12",
        ),
        (
            "version",
            with_field(6, &45_u16.to_le_bytes()),
            "error: entry `documentation/index.html` needs version 4.5 of zip, more than 2.0",
        ),
        (
            "split",
            with_field(34, &1_u16.to_le_bytes()),
            "error: the archive is split over several files",
        ),
        (
            "checksum",
            with_field(16, &7_u32.to_le_bytes()),
            "error: documentation/index.html: a.fmu: entry `documentation/index.html` cannot be unpacked",
        ),
        (
            "another local name",
            with_field(46, b"documentatiom/"),
            "error: entry `documentatiom/index.html` has another name in its local header: `documentation/index.html`",
        ),
        (
            "no archive",
            b"text".repeat(50),
            "error: a.fmu is no zip archive",
        ),
        (
            "cut short",
            packed(&files())[..2000].to_vec(),
            "error: a.fmu is no zip archive",
        ),
        (
            "in a folder",
            renamed("modelDescription.xml", "faulty/modelDescription.xml"),
            "error: modelDescription.xml is in the folder `faulty`",
        ),
        (
            "in other case",
            renamed("modelDescription.xml", "ModelDescription.xml"),
            "error: it is named `ModelDescription.xml`",
        ),
        (
            "no description",
            without("modelDescription.xml"),
            "error: it has no modelDescription.xml",
        ),
    ]
}

/// FMI rules 4 and 18: the binary's name and folder; and the other files.
fn files_beside_the_description() -> Vec<Case> {
    let entry = binary_entry();
    let (prefix, name) = entry.rsplit_once('/').unwrap();
    let other = format!("{prefix}/lib{name}");
    vec![
        (
            "a file at the top",
            with_file("notes.txt", b""),
            "warning: the standard knows no `notes.txt` at the top",
        ),
        (
            "an unknown platform",
            with_file("binaries/beos/faulty.so", b""),
            "warning: binaries/beos/: `beos` is no platform of FMI 2.0",
        ),
        (
            "the name of cargo",
            renamed(&entry, &other),
            "error: binaries/",
        ),
        (
            "another identifier",
            described(
                r#"<CoSimulation modelIdentifier="faulty""#,
                r#"<CoSimulation modelIdentifier="falty""#,
            ),
            "error: binaries/",
        ),
        (
            "nothing to run",
            without(&entry),
            "error: there is neither a binary nor source code",
        ),
        (
            "a missing source",
            described(
                r#"canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true" maxOutputDerivativeOrder="1"/>
  <UnitDefinitions>"#,
                r#"canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"><SourceFiles><File name="a.c"/></SourceFiles></CoSimulation>
  <UnitDefinitions>"#,
            ),
            "error: sources/: <SourceFiles> names `a.c`",
        ),
        (
            "no picture",
            with_file("model.png", b"GIF89a"),
            "warning: model.png: it is no PNG image",
        ),
        (
            "no index",
            renamed("documentation/index.html", "documentation/main.html"),
            "warning: documentation/: documentation/ has no index.html",
        ),
        (
            "extra",
            with_file("extra/mine/a.txt", b""),
            "warning: extra/: `extra/mine` is not named by a reverse domain",
        ),
    ]
}

/// FMI rules 18 and 20: binaries of their platform, with all functions; here of any platform.
fn binaries() -> Vec<Case> {
    let elf = foreign::faulty();
    // `e_machine` and `e_type` of the ELF header.
    let changed = |at: usize, value: u8| {
        let mut bytes = elf.to_vec();
        bytes[at] = value;
        bytes
    };
    vec![
        (
            "no library",
            with_binary(b"text"),
            "error: ENTRY: it is not a shared library",
        ),
        ("cut short", with_binary(&elf[..elf.len() / 3]), "error: "),
        (
            "a library of Linux for Windows",
            with_file("binaries/win64/faulty.dll", elf),
            "error: binaries/win64/faulty.dll: it is a library in Elf format for X86_64, which is not what the folder `win64` is for",
        ),
        (
            "a library of another processor",
            with_binary(&changed(18, 183)),
            "error: ENTRY: it is a library in Elf format for Aarch64",
        ),
        (
            "no shared object",
            with_binary(&changed(16, 1)),
            "error: ENTRY: it is an object of kind Relocatable",
        ),
        (
            "a function is missing",
            with_binary(foreign::faulty_without_do_step()),
            "error: ENTRY: it has no function `fmi2DoStep`",
        ),
        (
            "an unused function is missing",
            with_binary(foreign::faulty_without_cancel_step()),
            "warning: ENTRY: it has no function `fmi2CancelStep`",
        ),
        (
            "other types",
            with_binary(foreign::faulty_with_odd_platform()),
            "error: co-simulation: while loading: ",
        ),
        (
            "another version",
            with_binary(foreign::faulty_with_odd_version()),
            "error: co-simulation: while loading: ",
        ),
        (
            "no version",
            with_binary(foreign::faulty_without_texts()),
            "error: co-simulation: fmi2GetVersion returned a null pointer, expected text (FMI 2.0, section 2.1.4)",
        ),
        (
            "no types",
            with_binary(foreign::faulty_without_texts()),
            "error: co-simulation: fmi2GetTypesPlatform returned a null pointer, expected text (FMI 2.0, section 2.1.4)",
        ),
        (
            "no version of FMI 3.0",
            foreign::fmu3_of("good", foreign::binary3_without_version()),
            "error: co-simulation: fmi3GetVersion returned a null pointer, expected text (FMI 3.0, section 2.2)",
        ),
    ]
}

/// What the binary does, against its description and the standard. FMI rules 3, 9, 22, 23, 26, 27, 28, 29.
fn behaviour() -> Vec<Case> {
    let with_enumeration = |fault: &str| {
        let variable = r#"<ScalarVariable name="mode" valueReference="9" variability="discrete"><Enumeration declaredType="Mode"/></ScalarVariable></ModelVariables>"#;
        let types = r#"<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="on" value="1"/></Enumeration></SimpleType></TypeDefinitions><LogCategories>"#;
        let xml = described_as(fault, "</ModelVariables>", variable);
        let mut files = files();
        files[0].1 = xml.replace("<LogCategories>", types).into();
        packed(&files)
    };
    let of_enumeration = [
        (
            "odd-item",
            "error: co-simulation: `mode` is 7, which is no item of its type",
        ),
        (
            "error-in-fmi2GetInteger",
            "error: co-simulation: `mode` cannot be read: fmi2GetInteger returned fmi2Error",
        ),
    ];
    let of_enumeration = of_enumeration.map(|(fault, expected)| {
        let content = with_enumeration(fault);
        (fault, content, expected)
    });
    let with_text = |fault: &str| {
        let variable = r#"<ScalarVariable name="text" valueReference="9" variability="discrete"><String/></ScalarVariable></ModelVariables>"#;
        let mut all = files();
        all[0].1 = described_as(fault, "</ModelVariables>", variable).into();
        packed(&all)
    };
    let of_text = [
        (
            "no-text",
            "error: co-simulation: fmi2GetString returned a null pointer, expected text (FMI 2.0, section 2.1.7)",
        ),
        (
            "latin1-text",
            "error: co-simulation: fmi2GetString returned text that is not UTF-8 (FMI 2.0, section 2.1.2)",
        ),
    ];
    let of_text = of_text.map(|(fault, expected)| (fault, with_text(fault), expected));
    // `y` decays from 1 to 0.37.
    let mut files = files();
    files[0].1 = described_as(
        "min",
        "<Real start=\"1\"/></ScalarVariable>\n    <ScalarVariable name=\"k\"",
        "<Real start=\"1\" min=\"0.5\"/></ScalarVariable>\n    <ScalarVariable name=\"k\"",
    )
    .into();
    let below_its_min = (
        "min",
        packed(&files),
        "warning: co-simulation: `y` is 0.496585303791409",
    );
    static FAULTS: LazyLock<Vec<(String, String)>> =
        LazyLock::new(|| pairs(include_str!("behaviour.toml")));
    static FAULTS3: LazyLock<Vec<(String, String)>> =
        LazyLock::new(|| pairs(include_str!("behaviour3.toml")));
    let of_fmi3 = FAULTS3.iter().map(|(fault, expected)| {
        let behaviour = fault.trim_end_matches(" of FMI 3.0");
        (&**fault, foreign::fmu3(behaviour), &**expected)
    });
    (FAULTS.iter())
        .map(|(fault, expected)| (&**fault, behaving(fault), &**expected))
        .chain(of_enumeration)
        .chain(of_text)
        .chain(of_fmi3)
        .chain([below_its_min])
        .collect()
}

/// What looks like a fault and is none: an FMU may do nothing after the stop time that it was given, and refuse inputs below
/// their minimum; a check of a stiff model, or of one with a domain, takes short steps.
#[test]
fn what_is_no_fault_is_not_told() {
    let folder = Folder::new();
    let with = |name: &str, changes: &[(&str, &str)]| {
        let mut text = description(name);
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        let mut files = files();
        files[0].1 = text.into();
        folder.write(&format!("{name}.fmu"), packed(&files));
    };
    let decaying = "<Real start=\"1\"/></ScalarVariable>\n    <ScalarVariable name=\"k\"";
    let bounded = decaying.replace("/>", " min=\"0.3\" max=\"1\"/>");
    with(
        "strict-stop",
        &[
            ("stepSize=\"0.1\"", "stepSize=\"0.5\""),
            (decaying, &bounded),
        ],
    );
    let input = "causality=\"input\"><Real start=\"0\"";
    let bounded = format!("{input} min=\"0\"");
    with("discards-below", &[(input, &bounded)]);
    let model = |name: &str, text: &str| {
        folder.write(
            &format!("{name}.toml"),
            format!("[model]\nname = \"{name}\"\n[inputs]\nu = 1e-5\n{text}"),
        );
        let ended = folder.pilotage(&[
            "export",
            &format!("{name}.toml"),
            "-o",
            &format!("{name}.fmu"),
        ]);
        assert_eq!(ended.code, 0, "{ended:?}");
    };
    model(
        "stiff",
        "[states]\nx = { start = 2, der = \"-20000*(x - u)\" }\n[outputs]\ny = \"x\"\n",
    );
    model(
        "emptied",
        "[states]\nh = { start = 1e-4, der = \"u - 0.1*sqrt(h)\" }\n[outputs]\ny = \"h\"\n",
    );
    for name in ["strict-stop", "discards-below", "stiff", "emptied"] {
        let ended = folder.pilotage(&["validate", "--strict", &format!("{name}.fmu")]);
        assert_eq!(ended.code, 0, "{name}: {ended:?}");
    }
}

/// `--strict` makes warnings matter; `--no-run` leaves the binary alone; the findings as JSON.
#[test]
fn options_of_the_command() {
    let folder = Folder::new();
    folder.write("warned.fmu", with_file("notes.txt", b""));
    folder.write("crash.fmu", behaving("crash-in-step"));
    let code = |arguments: &[&str]| folder.pilotage(arguments).code;
    assert_eq!(code(&["validate", "warned.fmu"]), 0);
    assert_eq!(code(&["validate", "--strict", "warned.fmu"]), 1);
    assert_eq!(code(&["validate", "crash.fmu"]), 1);
    assert_eq!(code(&["validate", "--no-run", "crash.fmu"]), 0);
    assert_eq!(code(&["validate", "--time-limit", "0", "crash.fmu"]), 2);
    assert_eq!(code(&["validate", "nothing.fmu"]), 2);
    let json = folder
        .pilotage(&["validate", "--json", "warned.fmu", "crash.fmu"])
        .json();
    let warned = &json["fmus"][0];
    assert_eq!(
        (&warned["valid"], &warned["warnings"]),
        (&true.into(), &1.into())
    );
    let finding = &warned["findings"][0];
    assert_eq!(finding["severity"], "warning");
    assert_eq!(finding["section"], "FMI 2.0, section 2.3");
    assert_eq!(json["fmus"][1]["valid"], false);
}

/// Platforms that this test knows the folder of.
#[test]
fn this_machines_folder_is_known() {
    assert!(
        platform::folders()
            .iter()
            .any(|f| binary_entry().contains(f))
    );
}
