//! `pilotage hv`: what it writes, and how it ends.

use crate::command::{Folder, example};

const SMALL: [&str; 7] = [
    "hv",
    "--speeds",
    "6:12:6",
    "--heights",
    "4:60:4",
    "--delay",
    "0.5",
];

#[test]
fn a_map_is_the_same_after_a_stop_and_for_any_threads() {
    let folder = Folder::new();
    let run = |output: &str, more: &[&str]| {
        let words = [&SMALL[..], &["-o", output], more].concat();
        folder.pilotage(&words)
    };
    let whole = run("whole", &[]);
    assert_eq!(whole.code, 0, "{whole:?}");
    assert!(whole.stdout.contains("no flight limitation"), "{whole:?}");
    // Stopped at once, it keeps what is done, and goes on.
    assert_eq!(run("again", &["--time-limit", "1e-3"]).code, 1);
    assert!(
        folder.path("again/progress.txt").exists() || folder.files().contains(&"again".to_owned())
    );
    assert_eq!(run("again", &["--force"]).code, 0);
    for file in ["map.csv", "boundary.csv", "hv.json", "hv.svg"] {
        assert_eq!(
            folder.read(&format!("whole/{file}")),
            folder.read(&format!("again/{file}")),
            "{file}"
        );
    }
    assert!(!folder.path("again/progress.txt").exists());
    let page = folder.read("whole/hv.html");
    assert!(page.contains("perfect") && page.contains("no flight limitation"));
    // Another map does not go over it.
    let other = folder.pilotage(&["hv", "--speeds", "3", "--heights", "4:60:2", "-o", "whole"]);
    assert_eq!(other.code, 2, "{other:?}");
}

#[test]
fn a_pilot_makes_the_region_larger() {
    let folder = Folder::new();
    let model = "[model]\nname = \"slow\"\n[inputs]\ntarget = {}\n[parameters]\nlag = { start = 0.4, unit = \"s\" }\n\
                 [states]\nstick = { der = \"(2 * target - stick) / lag\" }\n[outputs]\nstick = {}\n";
    folder.write("slow.toml", model);
    let words = [&SMALL[..], &["--pilot", "slow.toml", "--si", "--json"]].concat();
    let found = folder.pilotage(&words).json();
    let maps = found["maps"].as_array().unwrap();
    let count = |k: usize| maps[k]["unsafe"].as_u64().unwrap();
    assert!(count(1) > count(0), "{found}");
    // The static gain is divided out, and said.
    assert!((maps[1]["static_gains"][0].as_f64().unwrap() - 2.0).abs() < 1e-9);
    let bad = folder.pilotage(&["hv", "--pilot", "integrator", "-o", "bad"]);
    assert_eq!(bad.code, 2);
    assert!(bad.stderr.contains("no static gain"), "{bad:?}");
    let endless = folder.pilotage(&["hv", "--delay", "inf", "-o", "bad"]);
    assert_eq!(endless.code, 2);
    assert!(endless.stderr.contains("--delay"), "{endless:?}");
}

/// A landing is a flight, and its FMUs repeat it in the master: S within 0.02 of the optimiser's.
#[test]
fn a_landing_is_repeated_by_its_fmus() {
    let folder = Folder::new();
    let pilot = example("hv/butterworth.toml").display().to_string();
    let words = [
        "hv", "--at", "9:15", "--delay", "0.3", "--pilot", &pilot, "--json", "-o", "out",
    ];
    let ended = folder.pilotage(&words);
    let found = &ended.json()["landings"][0];
    let number = |key: &str| found[key].as_f64().unwrap();
    // As other code computed it, within 0.5 %.
    assert!((number("s") - 1.915).abs() < 0.01, "{found}");
    assert!(
        (number("co_simulated") - number("s")).abs() < 0.02,
        "{found}"
    );
    assert_eq!(found["class"], "unsafe");
    let valid = folder.pilotage(&["validate", "out/helicopter.fmu", "out/pilot.fmu"]);
    assert_eq!(valid.code, 0, "{valid:?}");
    let again = folder.pilotage(&[
        "cosim",
        "out/system.toml",
        "--step",
        "0.005",
        "--stop-time",
        "3.4",
        "-o",
        "result.csv",
    ]);
    assert_eq!(again.code, 0, "{again:?}");
    // A long descent is certified on a finer mesh, and it is that flight which is written.
    let long = folder.pilotage(&[
        "hv", "--at", "0:150", "--delay", "1", "--json", "-o", "long",
    ]);
    let found = &long.json()["landings"][0];
    let number = |key: &str| found[key].as_f64().unwrap();
    assert_eq!(found["class"], "safe");
    assert!(
        (number("co_simulated") - number("replayed")).abs() < 0.02,
        "{found}"
    );
    // Without a number for the delay there is no side of the knee.
    let which = folder.pilotage(&["hv", "--at", "9:15", "-o", "other"]);
    assert!(
        which.code == 2 && which.stderr.contains("--delay 0.5"),
        "{which:?}"
    );
}

/// What has no landing is said, and nothing is written.
#[test]
fn a_point_without_a_landing_is_said() {
    let folder = Folder::new();
    let pole = "[model]\nname = \"grows\"\n[inputs]\ntarget = {}\n[states]\nstick = { der = \"target + stick\" }\n[outputs]\nstick = {}\n";
    folder.write("grows.toml", pole);
    for (more, code, words) in [
        (vec!["--set", "mass=6000"], 2, "level flight needs a thrust"),
        (vec!["--set", "mass=1", "--set", "mass=2"], 2, "twice"),
        (vec!["--pilot", "grows.toml"], 2, "unstable"),
        (
            vec!["--at", "9:5000"],
            1,
            "no start of the optimiser converged",
        ),
    ] {
        let ended = folder.pilotage(
            &[
                &["hv", "--at", "0:10", "--delay", "0.3", "-o", "out"],
                &more[..],
            ]
            .concat(),
        );
        assert!(
            ended.code == code && ended.stderr.contains(words),
            "{more:?} {ended:?}"
        );
        assert!(!folder.path("out").exists());
    }
}

/// Branches with their names: with a second's delay hover is unsafe from the ground on.
#[test]
fn branches_are_named() {
    let folder = Folder::new();
    let grid = [
        "hv",
        "--speeds",
        "0:15:5",
        "--heights",
        "3.2:80:8",
        "--delay",
        "1",
        "-o",
        "map",
    ];
    assert_eq!(folder.pilotage(&grid).code, 0);
    let rows = folder.read("map/boundary.csv");
    let branches: Vec<String> = rows
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .skip(1)
                .take(2)
                .collect::<Vec<_>>()
                .join(" ")
        })
        .collect();
    assert_eq!(
        branches[..4],
        ["high 0", "high 5.0000", "low 10.000", "high 10.000"].map(str::to_owned),
        "{rows}"
    );
    assert!(branches[4].starts_with("knee 13."), "{rows}");
}

/// Values of a parameter, delays, a curve over the map.
#[test]
fn families_and_curves_are_drawn() {
    let folder = Folder::new();
    folder.write(
        "manual.csv",
        "speed [kn],height [ft]\n0,10\n10,15\n25,40\n0,400\n",
    );
    let grid = [
        "hv",
        "--speeds",
        "6",
        "--heights",
        "1.5:100:6",
        "--overlay",
        "manual.csv",
        "-o",
    ];
    let more = [
        "--set",
        "mass=1200,1500",
        "--set",
        "density_altitude=1500",
        "--delay",
        "0.3/1,0",
        "--json",
    ];
    let found = folder
        .pilotage(&[&grid[..], &["map"], &more].concat())
        .json();
    let maps = found["maps"].as_array().unwrap();
    assert_eq!(maps.len(), 4);
    let height = |k: usize| {
        maps[k]["columns"][0]["boundary"][0]["height"]
            .as_f64()
            .unwrap()
    };
    // Heavier and later are unsafe from lower on.
    assert!(
        height(2) < height(0) && height(3) < height(1) && height(0) < height(1),
        "{found}"
    );
    assert_eq!(maps[2]["set"]["mass"], 1500.0);
    assert!(folder.read("map/hv.svg").contains("manual"));
    for (text, words) in [
        ("speed [kn],height [kg]\n0,10\n", "no unit of a height"),
        ("speed,altitude\n0,10\n", "no column `height`"),
        ("speed,height\n0,ten\n", "line 2"),
        ("speed,height\n", "no points"),
    ] {
        folder.write("manual.csv", text);
        let ended = folder.pilotage(&[&grid[..], &["other"]].concat());
        assert!(ended.code == 2 && ended.stderr.contains(words), "{ended:?}");
    }
}
