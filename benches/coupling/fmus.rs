//! Compiles and packs the FMUs.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use zip::write::SimpleFileOptions;

/// Controller and integrator with `outputs` outputs each.
pub fn make(folder: &Path, outputs: usize) -> [PathBuf; 2] {
    ["controller", "integrator"].map(|name| {
        let library = folder.join(format!("{name}.so"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/coupling/fmu.c");
        let mut compiler = Command::new("cc");
        compiler
            .args(["-O2", "-shared", "-fPIC", "-w", "-o"])
            .arg(&library);
        if name == "integrator" {
            compiler.arg("-DINTEGRATOR");
        }
        let ended = compiler
            .arg(source)
            .status()
            .expect("a C compiler named cc");
        assert!(ended.success(), "the C compiler failed");
        let path = folder.join(format!("{name}{outputs}.fmu"));
        pack(
            &path,
            name,
            &std::fs::read(&library).expect("it is there"),
            outputs,
        );
        path
    })
}

/// The loop in C over these libraries, compiled on the first call.
pub fn bare_loop(folder: &Path) -> Command {
    let program = folder.join("loop");
    if !program.exists() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/coupling/loop.c");
        let mut compiler = Command::new("cc");
        compiler
            .args(["-O2", "-o"])
            .arg(&program)
            .arg(source)
            .arg("-ldl");
        let ended = compiler.status().expect("a C compiler named cc");
        assert!(ended.success(), "the C compiler failed");
    }
    let mut command = Command::new(program);
    command.args(["controller.so", "integrator.so"].map(|name| folder.join(name)));
    command
}

fn pack(path: &Path, name: &str, library: &[u8], outputs: usize) {
    let mut zip = zip::ZipWriter::new(File::create(path).expect("a file"));
    // The last folder has the name of FMI 2.0, which all tools know.
    let folders = pilotage::fmi::platform::folders();
    let folder = folders.last().expect("a platform");
    let binary = format!("binaries/{folder}/{name}.so");
    for (entry, bytes) in [
        (
            "modelDescription.xml",
            description(name, outputs).as_bytes(),
        ),
        (&binary, library),
    ] {
        zip.start_file(entry, SimpleFileOptions::default())
            .expect("an entry");
        zip.write_all(bytes).expect("room");
    }
    zip.finish().expect("room");
}

fn description(name: &str, outputs: usize) -> String {
    // The integrator starts at 0; the controller calculates its output.
    let is_integrator = name == "integrator";
    let (initial, start) = match is_integrator {
        true => ("exact", " start=\"0\""),
        false => ("calculated", ""),
    };
    let dependencies = if is_integrator { "" } else { "1" };
    let names = (0..outputs).map(|k| {
        if k == 0 {
            "y".to_owned()
        } else {
            format!("y{k}")
        }
    });
    let variables: String = names
        .zip(1..)
        .map(|(name, reference)| {
            format!(
                "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" causality=\"output\" \
                 variability=\"continuous\" initial=\"{initial}\"><Real{start}/></ScalarVariable>"
            )
        })
        .collect();
    let unknowns: String = (0..outputs)
        .map(|k| {
            format!(
                "<Unknown index=\"{}\" dependencies=\"{dependencies}\"/>",
                k + 2
            )
        })
        .collect();
    let initial_unknowns = match is_integrator {
        true => String::new(),
        false => format!("<InitialUnknowns>{unknowns}</InitialUnknowns>"),
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{name}\">\
         <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\"/>\
         <ModelVariables><ScalarVariable name=\"u\" valueReference=\"0\" causality=\"input\" \
         variability=\"continuous\"><Real start=\"0\"/></ScalarVariable>{variables}</ModelVariables>\
         <ModelStructure><Outputs>{unknowns}</Outputs>{initial_unknowns}</ModelStructure>\
         </fmiModelDescription>"
    )
}
