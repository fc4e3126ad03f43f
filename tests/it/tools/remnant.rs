//! The likelihood of what is predicted from sample to sample, against a textbook Kalman filter in NumPy.

use super::python;
use crate::command::{Folder, example};
use serde_json::Value;

/// The example with a second noise, at a state, in a file of its own.
#[test]
fn the_likelihood_is_that_of_a_textbook_filter() {
    let folder = Folder::new();
    let here = example("problems/remnant");
    for name in ["hand.toml", "vehicle.toml", "run1.csv", "run2.csv"] {
        folder.write(name, std::fs::read_to_string(here.join(name)).unwrap());
    }
    let text = std::fs::read_to_string(here.join("problem.toml")).unwrap();
    let text = text.replace(
        "[process_noise]\n",
        "[process_noise]\n\"vehicle.v\" = { density = 0.02 }\n",
    );
    let (text, _) = text.split_once("[[run]]\nfile = \"run3.csv\"").unwrap();
    folder.write("problem.toml", text);
    let ended = folder.pilotage(&["fit", "problem.toml", "--evaluate", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let own: Value = serde_json::from_str(&ended.stdout).unwrap();
    let runs = ["run1.csv", "run2.csv"].map(|name| folder.path(name));
    let reference: Value = serde_json::from_str(&python::run("remnant.py", runs)).unwrap();
    let [found, expected] = [&own, &reference].map(|all| all["objective"].as_f64().unwrap());
    assert!(
        (found - expected).abs() < 1e-8 * expected.abs(),
        "{found} {expected}"
    );
    let mut compared = 0;
    for run in 0..2 {
        for (k, name) in ["position", "stick"].into_iter().enumerate() {
            let found = own["runs"][run]["residuals"][name].as_array().unwrap();
            let expected = reference["runs"][run][k].as_array().unwrap();
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(expected) {
                assert_eq!(found.is_null(), expected.is_null());
                if let (Some(found), Some(expected)) = (found.as_f64(), expected.as_f64()) {
                    assert!(
                        (found - expected).abs() < 1e-8 * (1.0 + expected.abs()),
                        "{found} {expected}"
                    );
                    compared += 1;
                }
            }
        }
    }
    // Of the position every other sample is missing.
    assert_eq!(compared, 2 * (301 + 601));
}
