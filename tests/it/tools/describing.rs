//! Describing functions against NumPy's FFT.

use super::python;
use crate::describing::{RUNS, flown};
use serde_json::Value;

#[test]
fn describing_functions_are_those_of_numpy() {
    let folder = flown();
    for runs in [&RUNS[..], &RUNS[..1]] {
        let flags = ["--json", "--force"];
        let ended = folder.pilotage(&[&["fit"], runs, &flags].concat());
        folder.write("fit.json", ended.stdout);
        let files = std::iter::once("fit.json").chain(runs.iter().copied());
        let errors = python::run("describing.py", files.map(|name| folder.path(name)));
        let errors: Value = serde_json::from_str(&errors).unwrap();
        for (key, error) in errors.as_object().unwrap() {
            assert!(error.as_f64().unwrap() < 1e-8, "{key}: {error}");
        }
        assert_eq!(errors.as_object().unwrap().len(), 8);
    }
}
