//! FMUs of model files in fmpy, a tool that is not ours: the examples and built-in models, both versions, both kinds.

use super::fmpy::simulated;
use super::python;
use pilotage::export::{Export, Provenance};
use pilotage::fmi::description::FmiVersion;
use pilotage::models::{TextModel, library};
use pilotage_sdk::Simulation;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const VERSIONS: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];

/// The examples' models and the built-in ones.
fn models() -> Vec<TextModel> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/models");
    let entries = std::fs::read_dir(folder).expect("the examples");
    let files = entries.map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> = files
        .filter(|file| {
            file.extension()
                .is_some_and(|extension| extension == "toml")
        })
        .collect();
    files.sort();
    let read = |file: &PathBuf| TextModel::read(file).expect("a model");
    let built_in = library::all().iter();
    let built_in = built_in.map(|model| TextModel::parse(model.text, model.name).expect("a model"));
    files.iter().map(read).chain(built_in).collect()
}

fn exported(folder: &TempDir, model: &TextModel, version: FmiVersion) -> PathBuf {
    let name = &model.compiled().file.name;
    let path = folder.path().join(format!("{name}-{version}.fmu"));
    let provenance = Provenance::default();
    let export = Export::text(model, &provenance).version(version);
    export.write(&path).expect("it is exported");
    path
}

#[test]
fn fmpy_finds_nothing_wrong_with_fmus_of_model_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let (models, mut fmus) = (models(), Vec::new());
    for version in VERSIONS {
        fmus.extend(models.iter().map(|model| exported(&folder, model, version)));
    }
    let printed = python::run("validate.py", &fmus);
    let numbers = printed.lines().filter(|line| line.parse::<u32>().is_ok());
    assert_eq!(numbers.count(), fmus.len(), "{printed}");
}

/// fmpy simulates the FMUs as our own simulation does: all outputs, with a step in each input.
#[test]
fn fmpy_simulates_models_of_files_as_we_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let (stop, step) = (2.0, 0.1);
    for (k, model) in models().iter().enumerate() {
        let table = model.variables();
        let settings: Vec<(&str, f64)> = (table.inputs())
            .map(|index| {
                let input = &table.variables()[index];
                (input.name.as_str(), input.start.unwrap_or(0.0) + 0.05)
            })
            .collect();
        let mut simulation = Simulation::new(model.clone());
        for (name, value) in &settings {
            let index = table.index(name).expect("the input");
            simulation.set(index, *value).expect("it can be set");
        }
        let mut ours: Vec<Vec<f64>> = Vec::new();
        for _ in 0..=20 {
            ours.push(table.outputs().map(|index| simulation.get(index)).collect());
            simulation.step(step).expect("the step is possible");
        }
        // Each model in one version and kind of each: all four in turn.
        let kinds = [("CoSimulation", 1e-9), ("ModelExchange", 1e-4)];
        let (version, (kind, tolerance)) = (VERSIONS[k % 2], kinds[k / 2 % 2]);
        let fmu = exported(&folder, model, version);
        let rows = simulated(&fmu, kind, [stop, step], &settings);
        let name = table.name();
        for (row, ours) in rows.iter().zip(&ours) {
            assert_eq!(row.len(), 1 + ours.len(), "{name}");
            for (theirs, own) in row[1..].iter().zip(ours) {
                assert!(
                    (theirs - own).abs() <= tolerance * own.abs().max(1.0),
                    "{name}, FMI {version} {kind} at {} s: {theirs} {own}",
                    row[0]
                );
            }
        }
    }
}
