//! `pilotage demo`: one command, from recorded flights to a report.

use crate::command::{Folder, example};
use pilotage::series::Series;

#[test]
fn the_demo_fills_one_folder_and_says_what_lies_where() {
    let folder = Folder::new();
    let ended = folder.pilotage(&["demo"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{ended:?}");
    assert_eq!(folder.files(), ["pilotage-demo"]);
    let made = |name: &str| folder.path("pilotage-demo").join(name);
    let mut files: Vec<_> = std::fs::read_dir(folder.path("pilotage-demo"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let expected = [
        "closed-loop-10m.csv",
        "closed-loop-20m.csv",
        "pilot.fmu",
        "pilot.toml",
        "quadcopter.fmu",
        "report.html",
        "trials",
        "vehicle.toml",
    ];
    assert_eq!(files, expected);
    for file in expected {
        assert!(
            ended.stdout.contains(file),
            "{file} is not mentioned: {}",
            ended.stdout
        );
    }
    for line in [
        "fit       converged, in doubt (1): 32460 unknowns, ",
        "validate  both FMUs follow FMI 2.0, and their binaries run\n",
    ] {
        assert!(ended.stdout.contains(line), "{line} {}", ended.stdout);
    }
    // The FMUs bring the vehicle to where the humans brought it.
    for (file, target) in [("closed-loop-10m.csv", 10.0), ("closed-loop-20m.csv", 20.0)] {
        let series = Series::read(&made(file)).unwrap();
        let z = &series.column("quadcopter.z").unwrap().values;
        assert_eq!(z.len(), 1501);
        assert!((z[1500] / target - 1.0).abs() < 0.03, "{file}: {}", z[1500]);
        let peak = z.iter().copied().fold(0.0, f64::max) / target;
        assert!((1.1..1.3).contains(&peak), "{file}: {peak}");
    }
    let page = std::fs::read_to_string(made("report.html")).unwrap();
    assert_eq!(page.matches("<figure>").count(), 9);
    assert!(page.contains("FMUs, 10 m") && page.contains("FMUs, 20 m"));
    // What README says of a column of its runs.
    let runs = page.split("<h2>Data</h2>").nth(1).unwrap();
    let runs = runs.split("</table>").next().unwrap().split("</tr>");
    let cell = |row: &str| -> Option<f64> {
        let own = row.rsplit_once("</td>")?.0;
        own.rsplit('>').next()?.parse().ok()
    };
    let all: Vec<f64> = runs.filter_map(cell).collect();
    assert_eq!(all.len(), 6);
    let [least, most] = [f64::min, f64::max].map(|of| all.iter().copied().reduce(of).unwrap());
    let said = format!("within {least:.2} to {most:.2} m (rms)");
    let readme = include_str!("../../README.md").replace('\n', " ");
    assert!(readme.contains(&said), "README does not say: {said}");
    for entry in std::fs::read_dir(example("trials")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let shipped = std::fs::read(example("trials").join(&name)).unwrap();
        assert!(
            std::fs::read(made("trials").join(&name)).unwrap() == shipped,
            "{name}"
        );
    }
}

#[test]
fn what_the_demo_says_to_type_next_works() {
    let folder = Folder::new();
    let ended = folder.pilotage(&["demo", "-o", "new"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let next = ended
        .stdout
        .split("next: ")
        .nth(1)
        .unwrap()
        .split("\n      ")
        .collect::<Vec<_>>();
    let command: String = next[..3].concat().replace('\\', " ");
    let arguments: Vec<&str> = command.split_whitespace().skip(1).collect();
    assert_eq!(arguments[0], "cosim", "{arguments:?}");
    let ended = folder.pilotage(&arguments);
    assert_eq!(ended.code, 0, "{ended:?}");
    let series = Series::read(&folder.path("result.csv")).unwrap();
    let z = &series.column("quadcopter.z").unwrap().values;
    assert!((z[z.len() - 1] - 15.0).abs() < 0.5);
}

#[test]
fn a_folder_with_something_in_it_is_left_alone() {
    let folder = Folder::new();
    folder.write("pilotage-demo/report.html", "mine");
    let ended = folder.pilotage(&["demo"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.stderr,
        "error: the folder pilotage-demo is not empty\n\
         hint: name another folder with -o, or overwrite with --force\n"
    );
    assert_eq!(folder.read("pilotage-demo/report.html"), "mine");
}
