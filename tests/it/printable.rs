//! Text of others: what is written with it reads back, and none of it reaches a terminal as more than letters.

use crate::command::{Ended, Folder, example, exported};
use pilotage::document::{Document, quoted};
use pilotage::series::Series;
use pilotage_text::printable::is_hidden;
use std::ffi::OsStr;
use std::process::Command;

/// It clears the screen, colours, rings, turns the line round and says something in our name.
const EVIL: &str = "u\u{1b}]0;pwn\u{7}\u{1b}[2J\u{9b}31m\u{202e}\u{2028}error: forged";

/// Whether a terminal shows this text as its letters.
fn is_plain(text: &str) -> bool {
    text.chars()
        .all(|c| !is_hidden(c) || c == '\n' || c == '\t')
}

/// What was printed, of which no line is one of those that were smuggled in.
fn assert_plain(ended: &Ended) {
    for text in [&ended.stdout, &ended.stderr] {
        assert!(is_plain(text), "{text:?}");
        let forged = |line: &str| line.starts_with("error: forged") || line.starts_with("[evil]");
        assert!(!text.lines().any(forged), "{text}");
    }
}

/// Flights are written by the page on which a person flies.
#[cfg(feature = "fly")]
mod flights {
    use super::Folder;
    use pilotage::series::Series;
    use pilotage::series::flown::comment_value;
    use pilotage_fly::record::Growing;
    use pilotage_fly::run::Table;
    use pilotage_text::printable::one_line;
    use proptest::prelude::*;
    use std::time::Duration;

    /// Letters, and what readers of CSV take for more than a letter.
    fn texts() -> impl Strategy<Value = String> {
        let odd = "\0\u{7}\u{1b}\n\r\t\u{85}\u{202e}\u{2028}\u{feff}\"',;#=:[]() m1";
        let odd: Vec<char> = odd.chars().collect();
        let letter = prop_oneof![any::<char>(), prop::sample::select(odd)];
        prop::collection::vec(letter, 0..16).prop_map(String::from_iter)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 128,
            rng_seed: proptest::test_runner::RngSeed::Fixed(46),
            ..ProptestConfig::default()
        })]
        /// Nothing that a protocol, a page or a vehicle calls itself loses a flight.
        #[test]
        fn flights_read_back_whatever_their_header_says(
            (title, subject, name, unit) in (texts(), texts(), texts(), texts()),
        ) {
            let folder = Folder::new();
            let path = folder.path("f.csv");
            let header = vec![("protocol", title.clone()), ("subject", subject.clone()), ("valid", "yes".to_owned())];
            let own = |name: &str, unit: &str| (name.to_owned(), unit.to_owned());
            let names = vec![own("time", "s"), own("target", "m"), (name.clone(), unit)];
            let columns = vec![vec![0.0, 1.0], vec![10.0, 10.0], vec![0.5, 1.5]];
            let flight = Growing::create(&path, &header, &names, Duration::ZERO).unwrap();
            flight.finish(None, &header, &Table { names, columns }).unwrap();
            let read = Series::read(&path).unwrap();
            prop_assert_eq!(read.comments.len(), 3);
            for (key, said) in [("protocol", &title), ("subject", &subject)] {
                let line = one_line(said);
                let said = Some(line.trim()).filter(|said| !said.is_empty());
                prop_assert_eq!(comment_value(&read.comments, key), said);
            }
            prop_assert_eq!(comment_value(&read.comments, "valid"), Some("yes"));
            let name = one_line(&name);
            prop_assert_eq!(read.columns[1].name.trim_matches('_'), name.trim().trim_matches('_'));
            prop_assert_eq!(&read.columns[1].values, &[0.5, 1.5]);
        }
    }
}

#[test]
fn columns_and_cells_are_shown_as_letters() {
    let folder = Folder::new();
    folder.write(
        "esc.csv",
        format!("time [s],\"{EVIL}\" [1],y [{EVIL}]\n0,0,0\n1,1,1\n"),
    );
    folder.write(
        "cell.csv",
        format!("time [s],target [m],position [m]\n0,1,\"{EVIL}\n\"\n"),
    );
    folder.write("key.toml", format!("{} = 1\n", quoted(EVIL)));
    for arguments in [
        &["trials", "check", "esc.csv"][..],
        &["fit", "esc.csv", "--column", "position=z"],
        &["trials", "check", "cell.csv"],
        &["vehicle", "check", "key.toml"],
        &["fit", EVIL],
        &["fit", "esc.csv", &format!("--{EVIL}")],
    ] {
        let ended = folder.pilotage(arguments);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains("\\u202e"), "{ended:?}");
        assert_plain(&ended);
    }
}

/// In JSON they are escapes, which read back as what they were.
#[test]
fn json_means_what_it_meant() {
    let folder = Folder::new();
    let name = format!("{EVIL}\n.csv").replace('/', "");
    std::fs::copy(example("trials/10m-run1.csv"), folder.path(&name)).unwrap();
    let ended = folder.pilotage(&["trials", "check", &name, "--json"]);
    assert_plain(&ended);
    assert_eq!(ended.json()["trials"][0]["file"], name);
    let ended = folder.pilotage(&["trials", "check", &name]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(ended.stdout.contains("\\u001b[2J"));
    assert_plain(&ended);
}

#[test]
fn a_cell_as_long_as_its_file_is_not_repeated() {
    let folder = Folder::new();
    let long = "7x".repeat(1 << 18);
    folder.write(
        "cell.csv",
        format!("time [s],target [m],position [m]\n0,1,2\n1,1,{long}\n"),
    );
    folder.write(
        "name.csv",
        format!("time [s],target [m],{long} [m]\n0,1,2\n"),
    );
    folder.write("long.toml", format!("{long} = 1\n"));
    for arguments in [
        ["trials", "check", "cell.csv"],
        ["trials", "check", "name.csv"],
        ["vehicle", "check", "long.toml"],
        ["fit", "long.toml", "--order=2"],
    ] {
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.code, 2);
        assert!(ended.stderr.len() < 10_000, "{} bytes", ended.stderr.len());
        assert!(ended.stderr.contains('…'), "{}", ended.stderr);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn names_of_files_that_are_no_text_are_shown() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let name = OsStr::from_bytes(b"\xff\n\x1b[31merror: forged.csv");
    for command in ["fit", "validate", "info", "plot", "cosim"] {
        let output = Command::new(env!("CARGO_BIN_EXE_pilotage"))
            .arg(command)
            .arg(name)
            .current_dir(folder.path(""))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(is_plain(&stderr), "{stderr:?}");
        assert!(
            stderr
                .lines()
                .filter(|line| line.contains("forged"))
                .all(|line| !line.starts_with("error: forged")),
            "{stderr}"
        );
    }
}

/// The shell gives names of files as arguments, and some of these begin like options.
#[test]
fn arguments_with_lines_add_none_to_what_is_said_of_them() {
    let folder = Folder::new();
    let evil = format!("x{EVIL}\nerror: forged");
    let option = format!("--{evil}");
    for arguments in [
        vec!["trials", "check", option.as_str()],
        vec![option.as_str()],
        vec![evil.as_str()],
        vec!["models", evil.as_str()],
        vec!["cosim", "--step", evil.as_str(), "a.fmu"],
        vec!["fit", "--scheme", evil.as_str(), "a.csv"],
    ] {
        let ended = folder.pilotage(&arguments);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains("forged"), "{ended:?}");
        assert_plain(&ended);
    }
}

/// Runs whose files have one name are named after their folders too.
#[cfg(unix)]
#[test]
fn a_folder_with_lines_adds_none_to_a_table_of_runs() {
    let folder = Folder::new();
    let runs = ["a\nerror: forged/run.csv", "b/run.csv"];
    for (run, rate) in runs.iter().zip([0.2, 0.3]) {
        let position = |k: i32| 10.0 - 10.0 * (-rate * 0.1 * f64::from(k)).exp();
        let rows = (0..100).map(|k| format!("{},10,{}\n", 0.1 * f64::from(k), position(k)));
        let path = folder.path(run);
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        folder.write(
            run,
            format!("time,target,position\n{}", rows.collect::<String>()),
        );
    }
    let ended = folder.pilotage(&["trials", "check", runs[0], runs[1]]);
    assert!(ended.stdout.contains("a error: forged/run"), "{ended:?}");
    assert_plain(&ended);
}

/// The name of the problem file stands in the first line of the fitted model.
#[test]
fn a_name_with_lines_adds_none_to_a_fitted_model() {
    let folder = Folder::new();
    let model = "[model]\nname = \"m\"\n[parameters]\nk = { start = 1, min = 0.1, max = 9 }\n[states]\nx = { start = 1, der = \"-k*x\" }\n";
    let rows: String = (0..20)
        .map(|k| format!("{},{}\n", 0.1 * f64::from(k), (-0.2 * f64::from(k)).exp()))
        .collect();
    let name = "p\n[evil]\nx=1 # .toml";
    folder.write("m.toml", model);
    folder.write("run.csv", format!("time [s],x [1]\n{rows}"));
    folder.write(
        name,
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = 0.01\n[parameters]\n\"m.k\" = {}\n\
         [[run]]\nfile = \"run.csv\"\n",
    );
    let ended = folder.pilotage(&["fit", name, "-o", "fitted.toml"]);
    assert!(ended.code < 2, "{ended:?}");
    assert_plain(&ended);
    let fitted = folder.read("fitted.toml");
    let document = Document::parse(&fitted, "fitted.toml").unwrap();
    assert!(!document.root().has("evil"), "{fitted}");
    assert_eq!(folder.pilotage(&["model", "check", "fitted.toml"]).code, 0);
}

/// What an FMU says of its variables becomes comments and keys of a problem file.
#[test]
fn a_description_with_lines_adds_none_to_a_problem_file() {
    let folder = exported();
    let file = std::fs::File::open(folder.path("quadcopter.fmu")).unwrap();
    zip::ZipArchive::new(file)
        .unwrap()
        .extract(folder.path("own"))
        .unwrap();
    let description = folder.read("own/modelDescription.xml");
    let forged = description
        .replace(
            "description=\"",
            "description=\"a&#10;[evil]&#10;x = 1 # &#x202e;",
        )
        .replace("name=\"mass\"", "name=\"ma&quot;ss = 2&#10;[evil]\"")
        .replace("name=\"v\"", "name=\"v'&#10;[evil]\"");
    assert!(forged.matches("[evil]").count() > 3);
    folder.write("own/modelDescription.xml", forged);
    folder.write("run.csv", "time [s],stick [1],z [m]\n0,0,0\n1,0,0\n2,0,0\n");
    let ended = folder.pilotage(&["init", "run.csv", "--model", "own", "-o", "problem.toml"]);
    assert_plain(&ended);
    assert_eq!(ended.code, 0, "{ended:?}");
    let problem = folder.read("problem.toml");
    assert!(
        !problem.lines().any(|line| line.starts_with("[evil]")),
        "{problem}"
    );
    assert!(problem.contains("a [evil] x = 1 # \\u202e"), "{problem}");
    let linearize = "linearize own --matrices --csv l.csv --matlab l.m";
    let cosim = "cosim own --stop-time 1 --step 0.1 --details -o r.csv --save-system s.toml";
    for command in ["info own", "validate own", linearize, cosim] {
        let words: Vec<&str> = command.split(' ').collect();
        let ended = folder.pilotage(&words);
        assert!(
            ended.stdout.contains("[evil]") || command == cosim,
            "{ended:?}"
        );
        assert_plain(&ended);
    }
    for file in ["l.csv", "l.m", "r.csv", "s.toml"] {
        let text = folder.read(file);
        assert!(
            !text.lines().any(|line| line.starts_with("[evil]")),
            "{text}"
        );
    }
    let result = Series::read_table(&folder.path("r.csv")).unwrap();
    assert!(result.column("own.v' [evil]").is_some());
}
