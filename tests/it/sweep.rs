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

/// Trajectories: quantiles are those of the closed form, and the file is the same however the study is made.
#[test]
fn trajectories_are_kept() {
    let folder = folder();
    let levels = [
        "--vary",
        "level=1:3:21",
        "--measure",
        "final(plant.y)",
        "--trajectories",
    ];
    assert_eq!(
        folder
            .pilotage(&words(&[&levels[..], &["-o", "whole"]].concat()))
            .code,
        0
    );
    let ended = folder.pilotage(&[
        "plot",
        "whole/sweep.html",
        "--figure",
        "fan",
        "-o",
        "fan.csv",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let text = folder.read("fan.csv");
    let median = text.lines().filter(|line| line.contains("50 %"));
    let median: Vec<(f64, f64)> = median
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let [x, y] = [cells.len() - 3, cells.len() - 2].map(|k| cells[k].parse().unwrap());
            (x, y)
        })
        .collect();
    assert_eq!(median.len(), 41, "{text}");
    for (t, y) in median {
        assert!((y - 2.0 * (1.0 - (-t / 0.5).exp())).abs() < 1e-5, "{t} {y}");
    }
    for (part, output) in [("1/3", "a"), ("2/3", "b"), ("3/3", "c")] {
        let ended = folder.pilotage(&words(
            &[&levels[..], &["--shard", part, "-o", output]].concat(),
        ));
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    assert_eq!(
        folder
            .pilotage(&["merge", "c", "a", "b", "-o", "joined"])
            .code,
        0
    );
    // A study that was killed: lines of samples whose trajectories are cut off, or were never written.
    let again = words(&[&levels[..], &["--time-limit", "1e-6", "-o", "again"]].concat());
    assert_eq!(folder.pilotage(&again).code, 1);
    folder.write("again/progress.txt", folder.read("a/shard-1-of-3.txt"));
    let bytes = std::fs::read(folder.path("a/shard-1-of-3.bin")).unwrap();
    folder.write("again/progress.bin", &bytes[..bytes.len() * 2 / 3]);
    let again = words(&[&levels[..], &["-o", "again"]].concat());
    let ended = folder.pilotage_with(&again, &[("RAYON_NUM_THREADS", "1")]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let files = [
        "sweep.csv",
        "sweep.json",
        "sweep.parquet",
        "trajectories.parquet",
    ];
    for (output, file) in ["joined", "again"]
        .iter()
        .flat_map(|own| files.map(|file| (own, file)))
    {
        let [a, b] = ["whole", output]
            .map(|own| std::fs::read(folder.path(&format!("{own}/{file}"))).unwrap());
        assert!(a == b, "{output}/{file}");
    }
    assert!(!folder.path("again/progress.bin").exists());
    std::fs::remove_file(folder.path("b/shard-2-of-3.bin")).unwrap();
    let ended = folder.pilotage(&["merge", "a", "b", "c", "-o", "some"]);
    assert!(
        ended.code == 2 && ended.stderr.contains("trajectories"),
        "{ended:?}"
    );
}

/// An input is lost at a time that is varied: the closed form, single runs to the last bit, and nothing of it is left in the next
/// sample's instances, as models and as FMUs.
#[test]
fn events_are_varied() {
    let folder = folder();
    let event = "[[event]]\nname = \"failure\"\ntime = 1\ninput = \"plant.level\"\nset = 0\n";
    let end = "[[event]]\nname = \"end\"\nwhen = \"plant.y > 100\"\nend = true\n";
    folder.write("lost.toml", format!("{event}{end}"));
    assert_eq!(
        folder
            .pilotage(&["export", "plant.toml", "-o", "plant.fmu"])
            .code,
        0
    );
    let study = |system: &str, more: &[&str]| {
        let words = [
            "sweep",
            system,
            "--stop-time",
            "2",
            "--step",
            "0.05",
            "--scenario",
            "lost.toml",
            "--vary",
            "scenario.failure~uniform(0.2, 1.8)",
            "--vary",
            "scenario.failure.set~normal(0, 0.1)",
            "--vary",
            "plant.level~uniform(1, 2)",
            "--vary",
            "scenario.end.level~loguniform(0.5, 2)",
            "--samples",
            "40",
            "--measure",
            "last = final(plant.y)",
        ];
        folder.pilotage(&[&words[..], more].concat())
    };
    for (system, output) in [("loop.toml", "models"), ("plant.fmu", "fmus")] {
        let ended = study(system, &["-o", output]);
        assert_eq!(ended.code, 0, "{ended:?}");
        let ended = study(
            system,
            &["-o", &format!("{output}-shard"), "--shard", "2/2"],
        );
        assert_eq!(ended.code, 0, "{ended:?}");
        let table = folder.read(&format!("{output}/sweep.csv"));
        let (mut cut, mut whole) = (0, 0);
        for line in table.lines().skip(1) {
            let [k, failure, set, level, limit, last] = *line
                .split(',')
                .take(6)
                .map(|cell| cell.parse::<f64>().unwrap())
                .collect::<Vec<_>>()
            else {
                panic!("{line}")
            };
            let top = level * (1.0 - (-failure / 0.5).exp());
            if top < limit - 0.1 {
                let exact = set + (top - set) * (-(2.0 - failure) / 0.5).exp();
                assert!((last - exact).abs() < 1e-4, "{line}: {exact}");
                whole += 1;
            } else if top > limit + 0.1 {
                assert!(last > limit && last < limit + 0.2, "{line}");
                cut += 1;
            }
            if k % 8.0 == 3.0 {
                let text = event
                    .replace("time = 1", &format!("time = {failure:?}"))
                    .replace("set = 0", &format!("set = {set:?}"));
                folder.write(
                    "one.toml",
                    text + &end.replace("100", &format!("{limit:?}")),
                );
                let level = format!("plant.level={level:?}");
                let single = [
                    "cosim",
                    system,
                    "--set",
                    &level,
                    "--stop-time",
                    "2",
                    "--step",
                    "0.05",
                    "--scenario",
                    "one.toml",
                    "--force",
                ];
                assert_eq!(folder.pilotage(&single).code, 0);
                let row = folder
                    .read("result.csv")
                    .lines()
                    .last()
                    .unwrap()
                    .split(',')
                    .nth(1)
                    .unwrap()
                    .to_owned();
                assert_eq!(
                    row.parse::<f64>().unwrap().to_bits(),
                    last.to_bits(),
                    "{line}"
                );
            }
        }
        assert!(cut > 3 && whole > 3, "{cut} {whole}");
        let rows: Vec<String> = table
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(5).unwrap().to_owned())
            .collect();
        let part = folder.read(&format!("{output}-shard/shard-2-of-2.txt"));
        for line in part.lines().skip(1) {
            let cells: Vec<&str> = line.split('\t').collect();
            assert_eq!(cells[2], rows[cells[0].parse::<usize>().unwrap()]);
        }
    }
    for (vary, why) in [
        (
            "scenario.nothing=1,2",
            "no event of the scenario is called `nothing`",
        ),
        ("scenario.failure.noise=1,2", "has no `noise`"),
        ("scenario.end=1,2", "has no `time`"),
    ] {
        let ended = folder.pilotage(&words(&[
            "--scenario",
            "lost.toml",
            "--vary",
            vary,
            "-o",
            "wrong",
        ]));
        assert!(
            ended.code == 2 && ended.stderr.contains(why),
            "{vary}: {ended:?}"
        );
    }
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
