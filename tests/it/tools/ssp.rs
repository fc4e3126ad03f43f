//! Systems that `pilotage convert` wrote, in FMPy and Ecos: read by the schemas, simulated, and compared with our Jacobi
//! coupling; systems of OSP in libcosim.

use super::python;
use crate::command::{Folder, exported};

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

/// libcosim runs a system of OSP with functions and variable groups.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libcosim_runs_a_system_of_osp_as_our_master_does() {
    let folder = crate::ssp::osp::osp();
    let file = folder.path("OspSystemStructure.xml");
    let printed = python::run("osp.py", [file.as_os_str(), "2".as_ref()]);
    let run = ["cosim", "OspSystemStructure.xml", "--step", "0.1"];
    let ended = folder.pilotage(&run);
    assert_eq!(ended.code, 0, "{ended:?}");
    let text = folder.read("result.csv");
    let cells = |line: &str| -> Vec<String> { line.split(',').map(str::to_owned).collect() };
    let (names, last) = (
        cells(text.lines().next().unwrap()),
        cells(text.lines().last().unwrap()),
    );
    let mut count = 0;
    for line in printed
        .lines()
        .filter_map(|line| line.strip_prefix("value "))
    {
        let (name, theirs) = line.split_once(' ').unwrap();
        let is_it = |own: &String| own.split(' ').next() == Some(name);
        let ours: f64 = last[names.iter().position(is_it).unwrap()].parse().unwrap();
        let theirs: f64 = theirs.parse().unwrap();
        assert!(
            (ours - theirs).abs() <= 1e-12 * theirs.abs().max(1.0),
            "{name}: {ours} {theirs}"
        );
        count += 1;
    }
    assert_eq!(count, 7, "{printed}");
}

/// Ecos applies transformations, and values of both instances.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn ecos_simulates_a_converted_system() {
    let folder = exported();
    folder.write(
        "loop.toml",
        "[system.pilot]\nmodel = \"pilot.fmu\"\nset = { target = 10 }\n\
         [system.quadcopter]\nmodel = \"quadcopter.fmu\"\nset = { mass = 1.5 }\n\
         [connect]\n\"pilot.stick\" = { to = \"quadcopter.stick\", factor = 0.5, offset = 0.001 }\n\
         \"quadcopter.z\" = \"pilot.position\"\n",
    );
    assert_eq!(
        folder.pilotage(&["convert", "loop.toml", "loop.ssp"]).code,
        0
    );
    let time = [
        "--stop-time",
        "15",
        "--step",
        "0.05",
        "--record",
        "quadcopter.z,quadcopter.phi,quadcopter.v",
    ];
    let ended = folder.pilotage(&[&["cosim", "loop.ssp"], &time[..]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let result = folder.read("result.csv");
    let ours = result.lines().last().unwrap().split(',').skip(1);
    let printed = python::run("ecos_ssp.py", [folder.path("loop.ssp")]);
    let theirs = printed
        .lines()
        .find_map(|line| line.strip_prefix("outputs "))
        .unwrap();
    let theirs = theirs.split(' ').map(|cell| cell.parse::<f64>().unwrap());
    for (ours, theirs) in ours.map(|cell| cell.parse::<f64>().unwrap()).zip(theirs) {
        assert!(
            ours != 0.0 && (ours - theirs).abs() <= 1e-12 * ours.abs().max(1.0),
            "{ours} {theirs}"
        );
    }
}
