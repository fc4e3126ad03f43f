//! The problem of the shipped flights with some vehicle, for the tests and the benchmark of FMUs in a fit.

use std::io::{Cursor, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

const RUNS: [&str; 6] = [
    "10m-run1", "10m-run2", "10m-run3", "20m-run1", "20m-run2", "20m-run3",
];

/// Samples as mesh and one start, so that nothing but the vehicle differs.
pub fn problem(vehicle: &str) -> String {
    let trials = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/trials");
    let run = |name: &&str| {
        let file = trials.join(name).with_extension("csv");
        format!("[[run]]\nfile = {:?}\n", file.display().to_string())
    };
    let runs: String = RUNS.iter().map(run).collect();
    format!(
        r#"
[system.pilot]
model = "linear"
order = 3
[system.vehicle]
model = "{vehicle}"
[connect]
"pilot.stick" = "vehicle.stick"
"vehicle.z" = "pilot.position"
[inputs]
"pilot.target" = "target"
[[measured]]
signal = "vehicle.z"
column = "position"
[parameters]
"pilot.*" = {{}}
"pilot.stick_limit" = {{ fixed = true }}
[stability]
models = ["pilot"]
closed_loop = true
{runs}[fit]
mesh = "samples"
starts = 1
"#
    )
}

/// The same FMU, whose description says that it has no directional derivatives.
pub fn without_derivatives(fmu: &[u8]) -> Vec<u8> {
    let mut archive = ZipArchive::new(Cursor::new(fmu)).unwrap();
    let mut plain = ZipWriter::new(Cursor::new(Vec::new()));
    for k in 0..archive.len() {
        let mut file = archive.by_index(k).unwrap();
        let name = file.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        if name == "modelDescription.xml" {
            let text = String::from_utf8(bytes).unwrap();
            let without = text.replace("providesDirectionalDerivative=\"true\"", "");
            assert_ne!(text, without);
            bytes = without.into_bytes();
        }
        if !name.ends_with('/') {
            plain
                .start_file(name, SimpleFileOptions::default())
                .unwrap();
            plain.write_all(&bytes).unwrap();
        }
    }
    plain.finish().unwrap().into_inner()
}
