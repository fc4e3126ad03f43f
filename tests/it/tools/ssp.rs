//! Systems that `pilotage convert` wrote, in FMPy: read by its schemas, simulated, and compared with our Jacobi coupling.

use super::python;
use crate::command::Folder;

/// Two lags in a loop whose outputs are 0 at first, as FMPy's connectors are. FMPy sets values of a set that it is given.
#[test]
fn fmpy_simulates_a_converted_system() {
    let folder = Folder::new();
    let model = |name: &str, der: &str| {
        format!(
            "[model]\nname = \"{name}\"\n[inputs]\nu = {{ unit = \"m\" }}\n[parameters]\np = {{ start = 1, unit = \"m\" }}\ns = {{ start = 1, unit = \"s\" }}\n\
             [states]\nx = {{ unit = \"m\", der = \"{der}\" }}\n[outputs]\ny = {{ unit = \"m\", value = \"x\" }}\n"
        )
    };
    for (name, der) in [
        ("plant", "(u - 0.3 * x) / s"),
        ("control", "(2 * (p - u) - x) / s"),
    ] {
        folder.write(&format!("{name}.toml"), model(name, der));
        let ended = folder.pilotage(&["export", &format!("{name}.toml")]);
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    folder.write(
        "loop.toml",
        "[experiment]\nstop_time = 5\n[system.control]\nmodel = \"control.fmu\"\nset = { p = 3 }\n\
         [system.\"sub.plant\"]\nmodel = \"plant.fmu\"\n\
         [connect]\n\"control.y\" = \"sub.plant.u\"\n\"sub.plant.y\" = \"control.u\"\n",
    );
    let ended = folder.pilotage(&["convert", "loop.toml", "loop.ssp"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let run = [
        "cosim",
        "loop.ssp",
        "--step",
        "0.05",
        "--algorithm",
        "jacobi",
    ];
    let ended = folder.pilotage(&run);
    assert_eq!(ended.code, 0, "{ended:?}");
    let ours: Vec<Vec<f64>> = (folder.read("result.csv").lines().skip(1))
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let printed = python::run("ssp.py", [folder.path("loop.ssp")]);
    let theirs: Vec<Vec<f64>> = (printed.lines())
        .map(|line| line.split(' ').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!((ours.len(), theirs.len()), (101, 100), "{printed}");
    assert!(ours[100][1].abs() > 0.5, "{:?}", ours[100]);
    // FMPy notes the values after a step under the time before it.
    for (ours, theirs) in ours[1..].iter().zip(&theirs) {
        for (a, b) in ours[1..].iter().zip(theirs) {
            assert!((a - b).abs() <= 1e-12, "{ours:?} {theirs:?}");
        }
    }
}
