//! Pages in a browser: what readers see of fits, loops and co-simulations.

use super::python;
use crate::command::{CONNECTIONS, Folder, example};
use crate::times;
use std::path::Path;

/// The pages of a fit of the shipped flights, of a problem with several subjects, of one with a describing function, and of a loop.
fn pages(folder: &Folder) -> [&'static str; 4] {
    let trials = example("trials").join("trials.toml").display().to_string();
    let vehicle = example("vehicles/quadcopter.toml").display().to_string();
    let problem = example("problems/drug/problem.toml").display().to_string();
    let fit = [
        "fit",
        &trials,
        "--vehicle",
        &vehicle,
        "--initial-state",
        "at-rest",
    ];
    let ended = folder.pilotage(&[&fit[..], &["--report", "fit.html"]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let ended = folder.pilotage(&["fit", &problem, "--report", "problem.html"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let sines = example("problems/rate_limited/problem.toml");
    let sines = sines.display().to_string();
    let ended = folder.pilotage(&["fit", &sines, "--report", "sines.html"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let looped = ["linearize", "pilot.toml", &vehicle];
    let cut = [
        "--loop",
        "pilot.stick=quadcopter.stick",
        "--report",
        "loop.html",
    ];
    let ended = folder.pilotage(&[&looped[..], &CONNECTIONS, &cut].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    ["fit.html", "problem.html", "sines.html", "loop.html"]
}

/// In three widths, light and dark: no error, no request, all figures drawn, no small text, nothing outside; one run is
/// picked out of many, a part is zoomed.
#[test]
fn pages_are_right_in_a_browser() {
    let folder = Folder::new();
    let pages = pages(&folder).map(|name| folder.path(name));
    let temporary = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let mut arguments = vec![temporary.join("browsers"), folder.path(".")];
    arguments.extend(pages);
    let printed = python::run("pages.py", &arguments);
    match printed.trim() {
        "no browser" => times::missing("a browser (Chromium)", "pages are not looked at"),
        wrong => assert_eq!(wrong, ""),
    }
}
