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
        ("a word", cell(2, "lost")),
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
        ("thousands", cell(2, "\"1,234\"")),
        (
            "commas and points",
            cell(2, "\"0,5\"")
                .replace("\"0,5\"", "0|5")
                .replace(',', ";")
                .replace('|', ","),
        ),
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

/// The rows of the file, cell by cell, with something else between them and in them.
fn written(head: &str, separator: char, cell: impl Fn(usize, usize, &str) -> String) -> String {
    let plain = file(HEAD, &|_, _| ());
    let rows = plain.lines().skip(1).enumerate().map(|(k, line)| {
        let cells = line.split(',').enumerate();
        let cells: Vec<String> = cells.map(|(i, own)| cell(k, i, own)).collect();
        cells.join(&separator.to_string()) + "\n"
    });
    head.replace(',', &separator.to_string()) + "\n" + &rows.collect::<String>()
}

/// The time of a clock so many seconds after 23:59:58.
fn clock(seconds: &str, sign: char) -> String {
    let milliseconds = (1e3 * seconds.parse::<f64>().unwrap()).round() as u64 + 86_398_000;
    let [hour, minute, second] = [3_600_000, 60_000, 1000].map(|unit| milliseconds / unit);
    let (hour, minute, second) = (hour % 24, minute % 60, second % 60);
    format!(
        "{hour:02}:{minute:02}:{second:02}{sign}{:03}",
        milliseconds % 1000
    )
}

/// A recording is the same numbers to the last bit, whatever program wrote it, and one line says how it was taken.
#[test]
fn each_dialect_gives_the_same_numbers() {
    let folder = Folder::new();
    let numbers = |text: &str| {
        folder.write("r.csv", text);
        let json = |words: &[&str]| {
            let ended = folder.pilotage(words);
            assert_eq!(ended.code, 0, "{text}\n{}", ended.stderr);
            let mut json = ended.json();
            let notes = json["notes"].take();
            let trials = json.get_mut("trials").and_then(|all| all.as_array_mut());
            trials
                .into_iter()
                .flatten()
                .for_each(|own| own["sha256"] = "".into());
            (json, notes)
        };
        let (check, note) = json(&["trials", "check", "r.csv", "--json"]);
        let (fit, of_fit) = json(&["fit", "r.csv", "--evaluate", "--json"]);
        let init = folder.pilotage(&["init", "r.csv", "-o", "p.toml", "--force"]);
        assert_eq!(init.code, 0, "{}", init.stderr);
        let (problem, of_problem) = json(&["fit", "p.toml", "--evaluate", "--json"]);
        assert_eq!(note, of_fit);
        assert_eq!(note, of_problem);
        let note = note[0].as_str().unwrap_or_default().to_owned();
        assert_eq!(
            init.stderr.contains(&format!("note: {note}")),
            !note.is_empty()
        );
        let note = note.strip_prefix("r.csv: read with ").unwrap_or_default();
        ([check, fit, problem], note.to_owned())
    };
    let same = |_: usize, _: usize, cell: &str| cell.to_owned();
    let comma = |_: usize, _: usize, cell: &str| cell.replace('.', ",");
    let (plain, nothing) = numbers(&written(HEAD, ',', same));
    assert_eq!(nothing, "");
    let bare = "time,target,position,stick";
    let of_clock = |k: usize, i: usize, cell: &str| match i {
        0 => clock(cell, '.'),
        _ => same(k, i, cell),
    };
    let stamped = |k: usize, i: usize, cell: &str| match i {
        0 if clock(cell, ',').as_str() < "1" => format!("2024-03-01T{}Z", clock(cell, ',')),
        0 => format!("2024-02-29 {}+00:00", clock(cell, ',')),
        _ => comma(k, i, cell),
    };
    for (text, note) in [
        (
            written(HEAD, ';', comma),
            "semicolons between cells; decimal commas",
        ),
        (
            written(HEAD, ';', same),
            "semicolons between cells; decimal points",
        ),
        (
            written(HEAD, '\t', comma),
            "tabs between cells; decimal commas",
        ),
        (written(HEAD, '\t', same), "tabs between cells"),
        (
            format!("\u{feff}sep=;\n# Lab 3\n{};;;\n", written(HEAD, ';', comma))
                .replace('\n', "\r\n"),
            "semicolons between cells; decimal commas",
        ),
        (
            written(HEAD, ',', |k, i, cell| format!("\"{}\"", comma(k, i, cell))),
            "decimal commas",
        ),
        (
            written(&format!("{bare}\ns,m,m,1"), ',', same),
            "units from the line below the header",
        ),
        (
            written(bare, ',', of_clock),
            "times of the clock as seconds since the first row, past midnight",
        ),
        (
            written(&bare.replace("time", "time [s]"), ';', stamped),
            "semicolons between cells; decimal commas; time stamps as seconds since the first row",
        ),
    ] {
        let (found, said) = numbers(&text);
        let of_time = |own: &serde_json::Value| own["doubts"].to_string();
        assert_eq!(of_time(&found[0]), of_time(&plain[0]), "{note}");
        assert_eq!(found, plain, "{note}");
        assert_eq!(said, note);
    }
    let missing = |word: &str| {
        written(HEAD, ',', |k, i, cell| match (k % 9, i) {
            (4, 2) => word.to_owned(),
            _ => cell.to_owned(),
        })
    };
    let (holes, nothing) = numbers(&missing(""));
    assert!(nothing.is_empty() && holes != plain);
    assert_eq!(numbers(&missing("nan")), (holes.clone(), String::new()));
    for word in ["NA", "n/a", "null", "-"] {
        let note = format!("`{word}` for no sample");
        assert_eq!(numbers(&missing(word)), (holes.clone(), note));
    }
}

/// Inputs, values and tables of models are read as recordings are.
#[test]
fn inputs_values_and_tables_have_the_same_dialects() {
    let folder = Folder::new();
    let model = "[model]\nname = \"m\"\n[inputs]\nu = {}\n[parameters]\nk = { start = 1 }\n[states]\n\
                 x = { der = \"k*table('t.csv', u) - x\" }\n[outputs]\ny = \"x\"\n";
    folder.write("m.toml", model);
    let run = |input: &str, values: &str, table: &str| {
        folder.write("in.csv", input);
        folder.write("k.csv", values);
        folder.write("t.csv", table);
        let words = "cosim m.toml --input in.csv --parameters k.csv --stop-time 1 --step 0.1 -o o.csv --json";
        let ended = folder.pilotage(&words.split(' ').collect::<Vec<_>>());
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let check = folder
            .pilotage(&["model", "check", "m.toml", "--json"])
            .json();
        let notes = [&ended.json()["notes"], &check["notes"]].map(|own| own.to_string());
        (
            std::fs::read_to_string(folder.path("o.csv")).unwrap(),
            notes.concat(),
        )
    };
    let (plain, _) = run(
        "time [s],u\n0,0.25\n0.5,1.5\n1,0\n",
        "name,value\nk,1.25\n",
        "a [1],b [1]\n0,0.5\n1.5,2\n",
    );
    let (odd, notes) = run(
        "time;u\n12:00:00;0,25\n12:00:00,5;1,5\n12:00:01;0\n",
        "name;value;unit\nk;1,25;\n",
        "a\tb\n0\t0,5\n1,5\t2\n",
    );
    assert_eq!(odd, plain);
    for note in [
        "in.csv: read with semicolons between cells; decimal commas; times of the clock",
        "k.csv: read with semicolons between cells; decimal commas",
        "t.csv: read with tabs between cells; decimal commas",
    ] {
        assert!(notes.contains(note), "{notes}");
    }
    folder.write("t.csv", "a;b\n0;1,234\n1;2,345\n");
    let refuses = |words: &str, told: &str| {
        let ended = folder.pilotage(&words.split(' ').collect::<Vec<_>>());
        assert_eq!(ended.code, 2);
        assert!(ended.stderr.contains(told), "{}", ended.stderr);
    };
    refuses(
        "model check m.toml",
        "t.csv:2: column `b`: `1,234` is 1.234 or 1234",
    );
    folder.write("t.csv", "a,b\n0,1\n1,2\n");
    folder.write("k.csv", "name;value\nk;1,234\n");
    refuses(
        "cosim m.toml --input in.csv --parameters k.csv --stop-time 1 --step 0.1 -o o.csv",
        "k.csv:2: column `value`: `1,234` is 1.234 or 1234",
    );
}
