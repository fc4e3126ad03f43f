//! FMUs of "another tool": made here by rustc, so that the importer is tested against code that does
//! not share a line with the exporter.

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// The description that fits `fmu.rs`.
pub const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="good" variableNamingConvention="flat">
  <CoSimulation modelIdentifier="foreign" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/></Unit>
    <Unit name="ft"><BaseUnit m="1" factor="0.3048"/></Unit>
    <Unit name="1/s"><BaseUnit s="-1"/></Unit>
    <Unit name="Hz"><BaseUnit s="-1"/></Unit>
  </UnitDefinitions>
  <LogCategories><Category name="logStatusError"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="1" tolerance="0.001" stepSize="0.1"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real unit="m" start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" initial="exact"><Real unit="m" start="0"/></ScalarVariable>
    <ScalarVariable name="k" valueReference="2" causality="parameter" variability="fixed"><Real unit="1/s" start="1"/></ScalarVariable>
    <ScalarVariable name="tolerance" valueReference="3" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="start" valueReference="4" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="stop" valueReference="5" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="n_in" valueReference="0" causality="input" variability="discrete"><Integer start="0"/></ScalarVariable>
    <ScalarVariable name="n" valueReference="1" causality="output" variability="discrete" initial="exact"><Integer start="0"/></ScalarVariable>
    <ScalarVariable name="flag_in" valueReference="0" causality="input" variability="discrete"><Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="flag" valueReference="1" causality="output" variability="discrete" initial="exact"><Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="text_in" valueReference="0" causality="input" variability="discrete"><String start=""/></ScalarVariable>
    <ScalarVariable name="text" valueReference="1" causality="output" variability="discrete" initial="exact"><String start=""/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
      <Unknown index="2" dependencies=""/>
      <Unknown index="4" dependencies=""/>
      <Unknown index="5" dependencies=""/>
      <Unknown index="6" dependencies=""/>
      <Unknown index="8" dependencies=""/>
      <Unknown index="10" dependencies=""/>
      <Unknown index="12" dependencies=""/>
    </Outputs>
    <InitialUnknowns>
      <Unknown index="4" dependencies=""/>
      <Unknown index="5" dependencies=""/>
      <Unknown index="6" dependencies=""/>
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

/// Name of this machine's binary in the archive.
pub fn binary_entry() -> String {
    let folders = pilotage::fmi::platform::folders();
    let folder = folders.last().unwrap();
    let name = pilotage::fmi::platform::library_name("foreign");
    format!("binaries/{folder}/{name}")
}

/// The binary that `source` (a file beside this one) makes with these flags of rustc.
fn compile(source: &str, flags: &[&str]) -> Vec<u8> {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let library = folder.path().join("library");
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/foreign");
    let done = Command::new(Path::new(env!("CARGO")).with_file_name("rustc"))
        .args([
            "--edition=2024",
            "--crate-type=cdylib",
            "-Cpanic=abort",
            "-Copt-level=1",
            "-Cstrip=symbols",
            "-o",
        ])
        .arg(&library)
        .arg(sources.join(source))
        .args(flags)
        .output()
        .unwrap();
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    std::fs::read(library).unwrap()
}

/// Declares binaries that are compiled once.
macro_rules! binaries {
    ($($(#[$doc:meta])* $name:ident: $source:literal, $flags:expr;)*) => {
        $($(#[$doc])*
        pub fn $name() -> &'static [u8] {
            static BINARY: OnceLock<Vec<u8>> = OnceLock::new();
            BINARY.get_or_init(|| compile($source, &$flags))
        })*
    };
}

binaries! {
    /// Everything is in it.
    binary: "fmu.rs", [];
    /// `fmi2DoStep` is missing.
    binary_without_do_step: "fmu.rs", ["--cfg", "without_do_step"];
    /// It says that it is of FMI 3.0.
    binary_of_fmi3: "fmu.rs", ["--cfg", "fmi3"];
    /// One fault each, for co-simulation and model exchange.
    faulty: "faulty.rs", [];
    /// `fmi2DoStep` is missing.
    faulty_without_do_step: "faulty.rs", ["--cfg", "without_do_step"];
    /// It says that its types are others.
    faulty_with_odd_platform: "faulty.rs", ["--cfg", "odd_platform"];
    /// It says that it is of another version.
    faulty_with_odd_version: "faulty.rs", ["--cfg", "odd_version"];
    /// It returns null pointers as its version and types.
    faulty_without_texts: "faulty.rs", ["--cfg", "no_texts"];
    /// `fmi2CancelStep` is missing.
    faulty_without_cancel_step: "faulty.rs", ["--cfg", "without_cancel_step"];
    /// Models for model exchange.
    binary_of_model_exchange: "me.rs", [];
    /// All kinds of FMI 3.0.
    binary3: "fmi3.rs", [];
    /// It returns a null pointer as its version.
    binary3_without_version: "fmi3.rs", ["--cfg", "no_version"];
    /// It uses `tanh` and is linked with nothing.
    binary_needing_libm: "libm.rs", ["-Clink-arg=-nostdlib"];
    /// It uses a function that nobody has.
    binary_needing_nobody: "libm.rs", ["-Clink-arg=-nostdlib", "--cfg", "unresolved"];
    /// It uses what PythonFMU does.
    binary_needing_python: "libm.rs", ["-Clink-arg=-nostdlib", "--cfg", "python"];
    /// As that one of nobody, but it asks for the function when it calls it.
    binary_needing_nobody_yet: "libm.rs",
        ["-Clink-arg=-nostdlib", "--cfg", "unresolved", "-Crelro-level=off"];
}

/// The binary of `hostile.c`. What links Rust's programs also compiles C.
#[cfg(target_os = "linux")]
fn hostile_binary() -> &'static [u8] {
    static BINARY: OnceLock<Vec<u8>> = OnceLock::new();
    BINARY.get_or_init(|| {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        let library = folder.path().join("library");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/foreign/hostile.c");
        let done = Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden", "-o"])
            .arg(&library)
            .arg(source)
            .args(["-lm", "-lpthread", "-ldl"])
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{errors}");
        std::fs::read(library).unwrap()
    })
}

/// The FMU of `hostile.c` that does that: `ACT@FUNCTION`.
#[cfg(target_os = "linux")]
pub fn hostile(act: &str) -> Vec<u8> {
    let variable = |name: &str, reference: u32, causality: &str, start: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\"{start}</Real></ScalarVariable>"
        )
    };
    let u = variable("u", 0, "input", "><Real start=\"0\">");
    let x = variable("x", 1, "output", " initial=\"exact\"><Real start=\"1\">");
    let description = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiModelDescription fmiVersion=\"2.0\" modelName=\"hostile\" guid=\"{act}\">
<CoSimulation modelIdentifier=\"foreign\" canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\"/>
<LogCategories><Category name=\"logStatusWarning\"/></LogCategories>
<DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"0.1\"/>
<ModelVariables>{u}{x}</ModelVariables>
<ModelStructure><Outputs><Unknown index=\"2\" dependencies=\"\"/></Outputs></ModelStructure>
</fmiModelDescription>"
    );
    archive(&[
        ("modelDescription.xml", description.as_bytes()),
        (&binary_entry(), hostile_binary()),
        ("resources/act", act.as_bytes()),
    ])
}

/// A zip archive of these files.
pub fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// The foreign FMU with a description and a binary.
pub fn fmu_of(description: &str, binary: &[u8]) -> Vec<u8> {
    let entry = binary_entry();
    archive(&[
        ("modelDescription.xml", description.as_bytes()),
        (&entry, binary),
    ])
}

/// y' = u - k y from 1 on, with a fault of `faulty.rs`.
pub fn faulty_fmu(fault: &str) -> Vec<u8> {
    let variable = |name: &str, reference: u8, more: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {more}</ScalarVariable>"
        )
    };
    let description = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<fmiModelDescription fmiVersion=\"2.0\" modelName=\"foreign\" guid=\"{fault}\">
<CoSimulation modelIdentifier=\"foreign\" canHandleVariableCommunicationStepSize=\"true\"/>
<ModelVariables>{}{}{}</ModelVariables>
<ModelStructure><Outputs><Unknown index=\"2\"/></Outputs></ModelStructure>
</fmiModelDescription>",
        variable("u", 0, "causality=\"input\"><Real start=\"0\"/>"),
        variable(
            "y",
            1,
            "causality=\"output\" initial=\"exact\"><Real start=\"1\"/>"
        ),
        variable(
            "k",
            2,
            "causality=\"parameter\" variability=\"fixed\"><Real start=\"1\"/>"
        ),
    );
    fmu_of(&description, faulty())
}

/// The foreign FMU with that behaviour.
pub fn fmu(behaviour: &str) -> Vec<u8> {
    let description = DESCRIPTION.replace("guid=\"good\"", &format!("guid=\"{behaviour}\""));
    fmu_of(&description, binary())
}

/// The foreign FMU with that behaviour, as a file in a folder of the test.
pub fn file(folder: &Path, behaviour: &str) -> PathBuf {
    let path = folder.join("foreign.fmu");
    std::fs::write(&path, fmu(behaviour)).unwrap();
    path
}

/// The foreign FMU of FMI 3.0 with that behaviour.
pub fn fmu3(behaviour: &str) -> Vec<u8> {
    fmu3_of(behaviour, binary3())
}

/// The same with that binary.
pub fn fmu3_of(behaviour: &str, binary: &[u8]) -> Vec<u8> {
    let good = "instantiationToken=\"good\"";
    let description = include_str!("fmi3.xml");
    let token = format!("instantiationToken=\"{behaviour}\"");
    fmu_of(&description.replace(good, &token), binary)
}

/// An FMU for model exchange of `me.rs`: which model, with how many states and event indicators.
pub fn model_exchange(model: &str, states: usize, indicators: usize) -> Vec<u8> {
    model_exchange_with(model, states, indicators, "")
}

/// The same with more variables behind its own.
pub fn model_exchange_with(model: &str, states: usize, indicators: usize, more: &str) -> Vec<u8> {
    let has_jacobian = ["decay@", "decay-kinked", "decay-wrongly", "van-der-pol"]
        .iter()
        .any(|own| model.starts_with(own));
    let state = |i: usize| {
        format!(
            "<ScalarVariable name=\"x{i}\" valueReference=\"{i}\" causality=\"local\" initial=\"exact\"><Real start=\"1\"/></ScalarVariable>"
        )
    };
    let derivative = |i: usize| {
        format!(
            "<ScalarVariable name=\"der(x{i})\" valueReference=\"{}\" causality=\"local\"><Real derivative=\"{}\"/></ScalarVariable>",
            10 + i,
            i + 1
        )
    };
    let [of_p, of_u] = match model.starts_with("ranged") {
        true => [" max=\"1.2\"", " min=\"0\""],
        false => [""; 2],
    };
    let all: String = (0..states)
        .map(state)
        .chain((0..states).map(derivative))
        .collect();
    let unknown = |index: usize| format!("<Unknown index=\"{index}\"/>");
    let derivatives: String = (states + 1..=2 * states).map(unknown).collect();
    let derivatives = match states {
        0 => String::new(),
        _ => format!("<Derivatives>{derivatives}</Derivatives>"),
    };
    let (y, n) = (2 * states + 3, 2 * states + 4);
    let initial: String = (states + 1..=2 * states)
        .chain([y, n])
        .map(unknown)
        .collect();
    let description = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="{model}" variableNamingConvention="structured" numberOfEventIndicators="{indicators}">
  <ModelExchange modelIdentifier="foreign" providesDirectionalDerivative="{has_jacobian}"/>
  <ModelVariables>
    {all}
    <ScalarVariable name="p" valueReference="20" causality="parameter" variability="fixed"><Real start="1"{of_p}/></ScalarVariable>
    <ScalarVariable name="u" valueReference="21" causality="input"><Real start="0"{of_u}/></ScalarVariable>
    <ScalarVariable name="y" valueReference="22" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="events" valueReference="0" causality="output" variability="discrete"><Integer/></ScalarVariable>
    {more}
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="{y}"/><Unknown index="{n}" dependencies=""/></Outputs>
    {derivatives}
    <InitialUnknowns>{initial}</InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#
    );
    fmu_of(&description, binary_of_model_exchange())
}
