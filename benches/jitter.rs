//! How exactly `pilotage cosim --real-time` keeps steps of 1 ms: `cargo bench --bench jitter`. Takes 10 s.

use serde_json::Value;
use std::process::Command;

const SYSTEM: &str = "[system.pilot]\nmodel = \"crossover\"\nset = { target = 10 }\n[system.vehicle]\nmodel = \"quadcopter\"\n\
                      [connect]\n\"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.z\" = \"pilot.position\"\n";

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("loop.toml"), SYSTEM).expect("a file");
    let words = "cosim loop.toml --stop-time 10 --step 0.001 --real-time --json";
    let ended = Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .args(words.split(' '))
        .current_dir(folder.path())
        .output()
        .expect("pilotage");
    let json: Value = serde_json::from_slice(&ended.stdout).expect("the object of a run");
    let paced = &json["realTime"];
    let ms = |key: &str| 1e3 * paced[key].as_f64().unwrap_or(f64::NAN);
    println!("pilot and quadcopter, 10 s in steps of 1 ms by the clock");
    println!(
        "points begin {:.4} ms after their time on average, {:.3} ms at most",
        ms("wakeMean"),
        ms("wakeWorst")
    );
    println!(
        "{} of {} deadlines missed, by {:.3} ms at most",
        paced["missed"],
        paced["deadlines"],
        ms("worst")
    );
    for class in paced["delays"].as_array().into_iter().flatten() {
        let end = class["upTo"]
            .as_f64()
            .map_or("more".to_owned(), |end| format!("{} ms", 1e3 * end));
        println!("  up to {end:>7}: {}", class["count"]);
    }
}
