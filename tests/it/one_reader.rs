//! One CSV file is read in one way, whoever reads it: `trials check`, `init` with the fit of its problem, and `fit`.

use crate::command::{Folder, example};

const HEAD: &str = "time [s],target [m],position [m],stick [1]";

/// A change of the cells of a row, by its number.
type Change<'c> = &'c dyn Fn(usize, &mut Vec<String>);

/// The file with another header and other rows.
fn file(head: &str, change: Change<'_>) -> String {
    let shipped = std::fs::read_to_string(example("trials").join("10m-run1.csv")).unwrap();
    let lines = shipped
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .take(120);
    let row = |(k, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        change(k, &mut cells);
        cells.join(",") + "\n"
    };
    format!("{head}\n") + &lines.enumerate().map(row).collect::<String>()
}

/// What the commands make of the file: their exit codes, and whether the two fits begin at one objective.
fn is_read(folder: &Folder, name: &str, text: impl AsRef<[u8]>) -> bool {
    folder.write("r.csv", text);
    let code = |words: &[&str]| {
        let ended = folder.pilotage(words);
        assert!(
            ended.code == 0 || ended.stderr.starts_with("error: r.csv"),
            "{name}: {ended:?}"
        );
        ended.code
    };
    let check = code(&["trials", "check", "r.csv"]);
    let init = code(&["init", "r.csv", "-o", "p.toml", "--force"]);
    assert_eq!(check, init, "{name}");
    if check != 0 {
        assert_eq!(code(&["fit", "r.csv", "--evaluate"]), 2, "{name}");
        return false;
    }
    let objective = |file: &str| {
        let json = folder
            .pilotage(&["fit", file, "--evaluate", "--json"])
            .json();
        json["objective"]
            .as_f64()
            .unwrap_or_else(|| panic!("{name}: {json}"))
    };
    let [flights, problem] = ["r.csv", "p.toml"].map(objective);
    assert!(
        (flights - problem).abs() <= 1e-9 * flights,
        "{name}: {flights} {problem}"
    );
    true
}

/// Sets a cell in the 51st row.
fn cell(column: usize, value: &str) -> String {
    file(HEAD, &|k, cells| {
        if k == 50 {
            cells[column] = value.to_owned();
        }
    })
}

/// Multiplies a column.
fn scaled(head: &str, column: usize, factor: f64) -> String {
    file(head, &|_, cells| {
        let value: f64 = cells[column].parse().unwrap();
        cells[column] = (factor * value).to_string();
    })
}

#[test]
fn what_one_command_reads_all_read() {
    let folder = Folder::new();
    let same: Change<'_> = &|_, _| ();
    let plain = file(HEAD, same);
    let repeated = |by: f64| {
        file(HEAD, &|k, cells| {
            let target: f64 = cells[1].parse().unwrap();
            if k == 60 {
                let before = cells.join(",");
                cells[0] = format!("{before}\n{}", cells[0]);
            }
            if k >= 60 {
                cells[1] = (target + by).to_string();
            }
        })
    };
    let read = [
        ("plain", plain.clone()),
        ("NaN position", cell(2, "NaN")),
        ("nan target", cell(1, "nan")),
        ("NAN stick", cell(3, "NAN")),
        ("no position", cell(2, "")),
        ("no target", cell(1, " ")),
        (
            "no stick at all",
            file(HEAD, &|_, cells| cells[3] = "NaN".to_owned()),
        ),
        ("a row twice", repeated(0.0)),
        ("a jump", repeated(1.0)),
        (
            "brackets",
            file("Time (s),Target (m),Position (m),Stick", same),
        ),
        (
            "capitals",
            file("TIME [s],TARGET [m],POSITION [m],STICK [1]", same),
        ),
        ("no units", file("time,target,position,stick", same)),
        (
            "no spaces",
            file("time[s],target[m],position[m],stick[1]", same),
        ),
        (
            "spaces",
            file(" time [s] , target [m] , position [m] , stick ", same),
        ),
        (
            "quotes",
            file(
                "\"time [s]\",\"target [m]\",\"position [m]\",\"stick [1]\"",
                same,
            ),
        ),
        ("milliseconds", scaled(&HEAD.replace("[s]", "[ms]"), 0, 1e3)),
        (
            "centimetres",
            scaled(&HEAD.replace("position [m]", "position [cm]"), 2, 100.0),
        ),
        (
            "percent",
            scaled(&HEAD.replace("stick [1]", "stick [%]"), 3, 100.0),
        ),
        (
            "words",
            file(&format!("{HEAD},mode"), &|_, cells| {
                cells.push("AUTO".to_owned())
            }),
        ),
        ("a mark of the order of bytes", format!("\u{feff}{plain}")),
        ("lines of Windows", plain.replace('\n', "\r\n")),
        ("comments and blank lines", format!("# a\n\n{plain}\n\n")),
    ];
    let refused = [
        ("infinite", cell(2, "inf")),
        ("a word", cell(2, "n/a")),
        ("back in time", cell(0, "0.1")),
        ("no time", cell(0, "NaN")),
        (
            "a cell too few",
            file(HEAD, &|k, cells| cells.truncate(4 - usize::from(k == 70))),
        ),
        (
            "a gap",
            file(HEAD, &|k, cells| {
                if (30..60).contains(&k) {
                    cells[1].clear();
                }
            }),
        ),
        ("semicolons", plain.replace(',', ";")),
        ("tabs", plain.replace(',', "\t")),
        (
            "time is not first",
            file("target [m],time [s],position [m],stick", same),
        ),
        (
            "two positions",
            file("time [s],target [m],position [m],position [m]", same),
        ),
        (
            "kilograms",
            file(&HEAD.replace("position [m]", "position [kg]"), same),
        ),
        ("a header alone", format!("{HEAD}\n")),
    ];
    for (name, text) in &read {
        assert!(is_read(&folder, name, text), "{name} is not read");
    }
    for (name, text) in &refused {
        assert!(!is_read(&folder, name, text), "{name} is read");
    }
}
