//! `pilotage sweep` and `pilotage merge`: numbers of many runs, whole, in parts, after a stop.

use crate::command::Folder;
use crate::foreign;

const LOOP: &str = "[system.plant]\nmodel = \"plant.toml\"\nset = { level = 2 }\n";
const PLANT: &str = "[model]\nname = \"plant\"\n[inputs]\nlevel = {}\n[parameters]\nlag = { start = 0.5, unit = \"s\", min = 0.01 }\n\
                     [states]\ny = { der = \"(level - y) / lag\" }\n[outputs]\ny = {}\n";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("plant.toml", PLANT);
    folder.write("loop.toml", LOOP);
    folder
}

fn words<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [
        &["sweep", "loop.toml", "--stop-time", "2", "--step", "0.05"],
        more,
    ]
    .concat()
}

/// Each row is what the formula says, and what a single run gives.
#[test]
fn rows_are_single_runs() {
    let folder = folder();
    let more = [
        "--vary",
        "lag=0.2:1:5",
        "--vary",
        "level=1,3",
        "--measure",
        "last = final(plant.y)",
        "--measure",
        "when(plant.y - 0.5)",
    ];
    let ended = folder.pilotage(&words(&[&more[..], &["-o", "out"]].concat()));
    assert_eq!(ended.code, 0, "{ended:?}");
    let table = folder.read("out/sweep.csv");
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .take(5)
                .map(|cell| cell.parse().unwrap())
                .collect()
        })
        .collect();
    assert_eq!(rows.len(), 10);
    for row in &rows {
        let (lag, level) = (row[1], row[2]);
        assert!(
            (row[3] - level * (1.0 - (-2.0 / lag).exp())).abs() < 1e-5,
            "{row:?}"
        );
        // Rows are 0.05 s apart, and it is interpolated between.
        assert!(
            (row[4] + lag * (1.0 - 0.5 / level).ln()).abs() < 2e-3,
            "{row:?}"
        );
    }
    let single = folder.pilotage(&[
        "cosim",
        "loop.toml",
        "--set",
        "plant.lag=0.4",
        "--set",
        "plant.level=3",
        "--stop-time",
        "2",
        "--step",
        "0.05",
    ]);
    assert_eq!(single.code, 0);
    let last = folder
        .read("result.csv")
        .lines()
        .last()
        .unwrap()
        .split(',')
        .nth(1)
        .unwrap()
        .to_owned();
    assert_eq!(rows[3][3].to_bits(), last.parse::<f64>().unwrap().to_bits());
    assert!(folder.read("out/sweep.html").contains("rank correlation"));
}

/// Whole, in three parts, stopped and gone on, cut off, on one thread: the same bytes.
#[test]
fn parts_and_stops_change_nothing() {
    let folder = folder();
    let study = [
        "--vary",
        "lag~loguniform(0.1, 2)",
        "--vary",
        "level~normal(2, 0.5)",
        "--samples",
        "50",
        "--measure",
        "rms(plant.y)",
    ];
    let run = |more: &[&str]| folder.pilotage(&words(&[&study[..], more].concat()));
    assert_eq!(run(&["-o", "whole"]).code, 0);
    for (part, output) in [("1/3", "a"), ("2/3", "b"), ("3/3", "c")] {
        assert_eq!(run(&["--shard", part, "-o", output]).code, 0);
    }
    let missing = folder.pilotage(&["merge", "a", "c", "-o", "some"]);
    assert!(
        missing.code == 2 && missing.stderr.contains("missing"),
        "{missing:?}"
    );
    assert_eq!(
        folder
            .pilotage(&["merge", "c", "a", "b", "-o", "joined"])
            .code,
        0
    );
    // Stopped, and its file cut off within a line, as by a kill.
    assert_eq!(run(&["--time-limit", "1e-6", "-o", "again"]).code, 1);
    let header = folder.read("a/shard-1-of-3.txt");
    let kept: Vec<&str> = header.lines().take(6).collect();
    folder.write("again/progress.txt", &(kept.join("\n") + "\n3\tdone\t0.1"));
    assert_eq!(run(&["-o", "again"]).code, 0);
    for output in ["joined", "again"] {
        for file in ["sweep.csv", "sweep.json"] {
            assert_eq!(
                folder.read(&format!("whole/{file}")),
                folder.read(&format!("{output}/{file}")),
                "{output}/{file}"
            );
        }
    }
    // Another study does not go over it, nor is it joined with it.
    assert_eq!(run(&["--seed", "2", "-o", "whole"]).code, 2);
    assert_eq!(
        run(&["--seed", "2", "--shard", "2/3", "-o", "b", "--force"]).code,
        0
    );
    let mixed = folder.pilotage(&["merge", "a", "b", "c", "-o", "mixed"]);
    assert!(mixed.code == 2, "{mixed:?}");
}

/// An FMU that forgets to reset something, in an instance or for all of them, is loaded for each sample.
#[test]
fn resets_are_not_trusted() {
    let folder = folder();
    for behaviour in ["good", "reset-forgets", "shared"] {
        std::fs::write(folder.path("fmu.fmu"), foreign::faulty_fmu(behaviour)).unwrap();
        let mut words = vec!["sweep", "fmu=fmu.fmu", "--vary", "fmu.k=0.5:2:7"];
        words.extend([
            "--measure",
            "final(fmu.y)",
            "--stop-time",
            "1",
            "--step",
            "0.1",
        ]);
        words.extend(["-o", "out", "--force"]);
        let ended = folder.pilotage(&words);
        assert_eq!(ended.code, 0, "{ended:?}");
        let table = folder.read("out/sweep.csv");
        assert_eq!(table.lines().count(), 8);
        for line in table.lines().skip(1) {
            let cells: Vec<f64> = line
                .split(',')
                .map_while(|cell| cell.parse().ok())
                .collect();
            let right = (-cells[1]).exp();
            assert!((cells[2] - right).abs() < 1e-9, "{behaviour}: {table}");
        }
    }
}

#[test]
fn a_failed_sample_is_a_row_with_its_reason() {
    let folder = folder();
    folder.write("samples.csv", "plant.lag,level\n0.5,1\n0,1\n0.25,2\n");
    let ended = folder.pilotage(&words(&["--table", "samples.csv", "--json", "-o", "out"]));
    assert_eq!(ended.code, 1, "{ended:?}");
    assert_eq!(ended.json()["failed"], 1);
    let table = folder.read("out/sweep.csv");
    let failed = table.lines().nth(2).unwrap();
    assert!(
        failed.contains("failed") && failed.contains("lag"),
        "{failed}"
    );
    // The default measure is the last value of each output.
    assert!(
        table.starts_with("sample,plant.lag,plant.level,final(plant.y),status,reason\n"),
        "{table}"
    );
}

/// Draws of a fit have its covariance.
#[test]
fn parameters_of_a_fit_are_drawn_together() {
    let folder = folder();
    let sure = "[uncertainty]\nparameters = [\"lag\", \"gain\"]\ndegrees_of_freedom = [9, 9]\ncovariance = [[4e-4, 3e-4], [3e-4, 1e-3]]\n";
    let plant = PLANT
        .replace("[states]", "gain = { start = 1 }\n[states]")
        .replace("level - y", "gain * level - y");
    folder.write("plant.toml", format!("{plant}{sure}"));
    let ended = folder.pilotage(&words(&[
        "--vary",
        "plant~fit",
        "--method",
        "sobol",
        "--samples",
        "256",
        "-o",
        "out",
    ]));
    assert_eq!(ended.code, 0, "{ended:?}");
    let table = folder.read("out/sweep.csv");
    let rows = table.lines().skip(1).map(|line| {
        line.split(',')
            .skip(1)
            .take(2)
            .map(|cell| cell.parse::<f64>().unwrap())
            .collect::<Vec<_>>()
    });
    let rows: Vec<Vec<f64>> = rows.collect();
    let mean = |k: usize| rows.iter().map(|own| own[k]).sum::<f64>() / 256.0;
    let covariance = |i: usize, j: usize| {
        rows.iter()
            .map(|own| (own[i] - mean(i)) * (own[j] - mean(j)))
            .sum::<f64>()
            / 255.0
    };
    assert!((mean(0) - 0.5).abs() < 1e-3 && (mean(1) - 1.0).abs() < 1e-3);
    for (i, j, expected) in [(0, 0, 4e-4), (0, 1, 3e-4), (1, 1, 1e-3)] {
        assert!(
            (covariance(i, j) / expected - 1.0).abs() < 0.05,
            "{i} {j} {}",
            covariance(i, j)
        );
    }
}

#[test]
fn mistakes_are_said_before_anything_is_written() {
    let folder = folder();
    for (more, expected) in [
        (vec![], "nothing is varied"),
        (vec!["--vary", "plant.lg=1,2"], "did you mean `plant.lag`"),
        (
            vec!["--vary", "lag=1,2", "--measure", "rms(plant.z)"],
            "plant.z",
        ),
        (
            vec!["--vary", "lag=1,2", "--measure", "plant.y"],
            "one number is expected",
        ),
        (
            vec![
                "--vary",
                "lag=1,2",
                "--measure",
                "max(plant.y)",
                "--measure",
                "max(plant.y)",
            ],
            "two measures",
        ),
        (vec!["--vary", "plant~fit"], "covariance of a fit"),
        (vec!["--vary", "other~fit"], "no instance"),
        (
            vec!["--vary", "lag~normal(1, 2)", "--method", "grid"],
            "distribution",
        ),
        (vec!["--table", "none.csv"], "none.csv"),
        (vec!["--vary", "lag=1", "--shard", "3/2"], "I/N"),
    ] {
        let ended = folder.pilotage(&words(&more));
        assert!(
            ended.code == 2 && ended.stderr.contains(expected),
            "{more:?} {ended:?}"
        );
    }
    assert!(!folder.files().contains(&"sweep".to_owned()));
}
