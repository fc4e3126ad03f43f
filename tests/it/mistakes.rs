//! Commands as people type them who are wrong, or nearly right: what each is told, to the letter.
//!
//! `mistakes.txt` has a paragraph for each: the command line, the exit code in brackets, and what goes to stderr.

use crate::command::Folder;
use crate::foreign;
use crate::paragraphs::assert_same;

/// A good trial of twelve samples below that header.
fn trial(header: &str) -> String {
    let rows = (0..12).map(|k| format!("{},10,{k}\n", f64::from(k) * 0.5));
    format!("{header}\n{}", rows.collect::<String>())
}

/// What the commands find where they run.
fn folder() -> Folder {
    let folder = Folder::new();
    for command in [
        &["export", "pilot", "--preset", "paper"][..],
        &["export", "quadcopter"],
    ] {
        assert_eq!(folder.pilotage(command).code, 0);
    }
    let vehicle = folder.pilotage(&["vehicle", "show"]).stdout;
    let changed = |from: &str, to: &str| {
        assert!(vehicle.contains(from), "{from}");
        vehicle.replacen(from, to, 1)
    };
    let theta = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];
    let theta = theta
        .iter()
        .zip(1..)
        .map(|(value, i)| format!("theta{i} = {value}\n"));
    let pilot = format!("[theta]\n{}", theta.collect::<String>());
    let header = "time [s],target [m],position [m]";
    let good = trial(header);
    let vehicles = [
        ("comma.toml", changed("mass = 1.2", "mass = 1,2")),
        ("text.toml", changed("mass = 1.2", "mass = \"1.2 kg\"")),
        ("typo.toml", changed("mass", "mas")),
        ("heavy.toml", changed("mass = 1.2", "mass = -1.2")),
    ];
    let texts = [
        ("vehicle.toml", vehicle.clone()),
        ("pilot.toml", pilot.clone()),
        ("failed.toml", format!("converged = false\n{pilot}")),
        ("run.csv", good.clone()),
        ("copy/run.csv", good.clone()),
        ("capitals.csv", trial("Time [s],Target [m],Position [m]")),
        ("parentheses.csv", trial("time (s),target (m),position (m)")),
        ("z.csv", trial("t,goal,z")),
        ("typo.csv", trial("time [s],target [m],postion [m]")),
        ("volts.csv", trial("time [s],target [m],position [V]")),
        ("metres.csv", trial("time [m],target [m],position [m]")),
        (
            "semicolons.csv",
            good.replace(',', ";").replace("1.5;10;3", "1,5;10;3"),
        ),
        ("back.csv", good.replace("1.5,10,3", "0.2,10,3")),
        ("text.csv", good.replace("1.5,10,3", "1.5,10,lost")),
        (
            "short.csv",
            good.lines()
                .take(2)
                .map(|line| format!("{line}\n"))
                .collect(),
        ),
        ("empty.csv", String::new()),
        ("headless.csv", "0,10,1\n0.5,10,2\n".into()),
        ("runs.toml", "[[run]]\nfile = \"run.csv\"\n".into()),
        ("missing.toml", "[[run]]\nfile = \"run9.csv\"\n".into()),
        (
            "use.toml",
            "[[run]]\nfile = \"run.csv\"\nuse = \"train\"\n".into(),
        ),
        ("result.csv", "time,pilot.stick [1]\n0,0\n1,0.5\n".into()),
        ("course.csv", "time [s],altitude [m]\n0,0\n1,10\n".into()),
        ("values.toml", "[pilot]\ntheta7 = 1\n".into()),
        ("values.csv", "variable;value\npilot.theta1;1\n".into()),
        ("page.html", "<!DOCTYPE html>\n<html></html>\n".into()),
        ("library.so", "\u{7f}ELF\u{2}\u{1}\u{1}".into()),
        ("text.fmu", "not a zip\n".into()),
        (
            "unpacked/modelDescription.xml",
            "<fmiModelDescription/>".into(),
        ),
        ("mine.csv", "my own numbers\n".into()),
    ];
    for (name, text) in vehicles.iter().chain(&texts) {
        folder.write(name, text);
    }
    folder.write(
        "book.xlsx",
        foreign::archive(&[("xl/workbook.xml", b"<workbook/>")]),
    );
    folder
}

/// The words of a command line; those in single quotes stay together.
fn words(line: &str) -> Vec<String> {
    let parts = line.split('\'').enumerate();
    parts
        .flat_map(|(i, part)| match i % 2 {
            1 => vec![part.to_owned()],
            _ => part.split_whitespace().map(str::to_owned).collect(),
        })
        .collect()
}

/// Every command of the table, run; as the table would have it.
#[test]
fn what_each_mistake_is_told() {
    let expected = include_str!("mistakes.txt");
    let folder = folder();
    let commands: Vec<&str> = (expected.lines())
        .filter_map(|line| line.strip_prefix("$ pilotage "))
        .collect();
    assert!(commands.len() >= 60, "{}", commands.len());
    let mut found = Vec::new();
    for command in commands {
        let arguments = words(command);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let ended = folder.pilotage(&arguments);
        // Blank lines part the table's paragraphs.
        let message: String = (ended.stderr.lines().filter(|line| !line.trim().is_empty()))
            .map(|line| format!("{line}\n"))
            .collect();
        found.push(format!(
            "$ pilotage {command}\n[{}]\n{}",
            ended.code,
            message.trim_end()
        ));
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/mistakes.txt");
    assert_same(path, &found);
}
