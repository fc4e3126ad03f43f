//! Broken files and wrong uses: the exact message and exit code of each.

use crate::command::Folder;

/// A good trial of twelve samples.
fn trial() -> String {
    let rows: String = (0..12)
        .map(|k| format!("{},10,{}\n", f64::from(k) * 0.5, k))
        .collect();
    format!("time [s],target [m],position [m]\n{rows}")
}

/// The default vehicle's file with one replacement.
fn vehicle(from: &str, to: &str) -> String {
    let text = Folder::new().pilotage(&["vehicle", "show"]).stdout;
    assert!(text.contains(from), "{from}");
    text.replace(from, to)
}

/// Runs `pilotage <arguments> FILE` on a file of that content; expects exit code 2 and this message.
fn refused(arguments: &[&str], file: &str, content: impl AsRef<[u8]>, message: &str) {
    let folder = Folder::new();
    folder.write("good.csv", trial());
    folder.write(file, content);
    let ended = folder.pilotage(&[arguments, &[file]].concat());
    assert_eq!(ended.stderr, format!("error: {message}\n"));
    assert_eq!((ended.code, ended.stdout.as_str()), (2, ""));
}

#[test]
fn trials() {
    let check = ["trials", "check"];
    let good = trial();
    let cases: &[(&str, Vec<u8>, &str)] = &[
        (
            "empty file",
            b"".into(),
            "a.csv: empty: expected a header row such as `time [s],target [m],position [m]`",
        ),
        (
            "comments only",
            b"# pilot: A\n\n# date\n".into(),
            "a.csv: empty: expected a header row such as `time [s],target [m],position [m]`",
        ),
        (
            "header only",
            b"# pilot: A\ntime [s],target [m],position [m]\n".into(),
            "a.csv: a header but no samples below it",
        ),
        (
            "latin-1",
            b"# pilot: J\xf6rg\ntime [s],target [m],position [m]\n".into(),
            "a.csv:1: not UTF-8 text (byte 0xf6); save the file as CSV in UTF-8",
        ),
        (
            "utf-16",
            b"\xff\xfet\0i\0m\0e\0".into(),
            "a.csv:1: not UTF-8 text (byte 0xff); save the file as CSV in UTF-8",
        ),
        (
            "utf-16 without its mark",
            b"t\0i\0m\0e\0,\0x\0".into(),
            "a.csv:1: not UTF-8 text (byte 0x00); save the file as CSV in UTF-8",
        ),
        (
            "points and commas",
            good.replace(',', ";").replace("10;1\n", "10;1,5\n").into(),
            "a.csv:3: column `position`: `1,5` has a comma, but `0.5` on line 3 has a point; write all numbers with decimal \
             points, and nothing between thousands",
        ),
        (
            "thousands",
            b"time;target;position\n0;10;1,234\n1;10;2,345\n".into(),
            "a.csv:2: column `position`: `1,234` is 1.234 or 1234, and no number of the file tells which; write decimals with a \
             point and commas between cells, and nothing between thousands",
        ),
        (
            "semicolons above commas",
            good.replacen(',', ";", 2).into(),
            "a.csv:2: 1 cells; expected 3, as in the header, which has semicolons between cells",
        ),
        (
            "a date that is not ISO 8601",
            good.replacen("0,10,0", "01.03.2024 12:00,10,0", 1).into(),
            "a.csv:2: column `time`: `01.03.2024 12:00` is neither a number nor a time; times are numbers, 12:00:00.5 or \
             2024-03-01T12:00:00.5Z",
        ),
        (
            "no header",
            b"0,10,0\n0.5,10,1\n".into(),
            "a.csv:1: the first row holds numbers; expected a header such as `time [s],target [m],position [m]`",
        ),
        (
            "numbers for a header",
            b"0,10,1\n0.5,10,2\n".into(),
            "a.csv:1: the first row holds numbers; expected a header such as `time [s],target [m],position [m]`",
        ),
        (
            "nameless column",
            good.replace("target [m]", "").into(),
            "a.csv:1: column 2 is headed ``; expected `name` or `name [unit]`",
        ),
        (
            "bracket left open",
            good.replace("position [m]", "position [m").into(),
            "a.csv:1: column 3 is headed `position [m`; expected `name` or `name [unit]`",
        ),
        (
            "duplicate column",
            good.replace("target", "position").into(),
            "a.csv:1: columns 2 and 3 are both named `position`",
        ),
        (
            "time in hours",
            good.replace("time [s]", "time [kg]").into(),
            "a.csv:1: `time` is in `kg`; expected a unit of time, such as s, ms or min",
        ),
        (
            "ragged row",
            good.replacen("0.5,10,1", "0.5,10", 1).into(),
            "a.csv:3: 2 cells; expected 3, as in the header",
        ),
        (
            "decimal comma",
            good.replacen("0.5,10,1", "0,5,10,1", 1).into(),
            "a.csv:3: 4 cells; expected 3, as in the header: commas stand between cells, and decimals have a point",
        ),
        (
            "text in a cell",
            good.replacen("0.5,10,1", "0.5,10,one", 1).into(),
            "a.csv:3: column `position`: `one` is not a finite number; leave the cell empty where the sample is missing",
        ),
        (
            "infinity",
            good.replacen("0.5,10,1", "0.5,1e999,1", 1).into(),
            "a.csv:3: column `target`: `1e999` is not a finite number; leave the cell empty where the sample is missing",
        ),
        (
            "no time",
            good.replacen("0.5,10,1", ",10,1", 1).into(),
            "a.csv:3: no time; only signals may have missing samples",
        ),
        (
            "time runs back, after a comment",
            good.replacen("0.5,10,1", "# gust\n-1,10,1", 1).into(),
            "a.csv:4: time -1 s does not come after 0 s, the row before",
        ),
        (
            "misspelt column",
            good.replace("position", "postion").into(),
            "a.csv: no column `position`; did you mean `postion`?; the columns are target, postion\n\
             hint: --column position=NAME says which column it is",
        ),
        (
            "missing column",
            good.replace("target", "height").into(),
            "a.csv: no column `target`; the columns are height, position\n\
             hint: --column target=NAME says which column it is",
        ),
        (
            "wrong unit",
            good.replace("position [m]", "position [V]").into(),
            "a.csv: `position` is in `V`; expected a length, such as m, cm or ft",
        ),
        (
            "target missing",
            good.replace(",10,", ",,").into(),
            "a.csv: no target from 0 to 5.5 s, and it is needed all the time; fill it, end the run before or begin it after",
        ),
        (
            "nothing recorded",
            (good.lines().enumerate())
                .map(|(i, line)| {
                    if i == 0 {
                        format!("{line}\n")
                    } else {
                        format!("{},10,\n", i)
                    }
                })
                .collect::<String>()
                .into(),
            "a.csv: recorded positions at 0 different times; expected at least 2",
        ),
        (
            "stick beyond its stops",
            good.replace("position [m]", "position [m],stick")
                .replace('\n', ",1.5\n")
                .replacen("stick,1.5", "stick", 1)
                .into(),
            "a.csv: stick = 1.5 at 0 s; expected -1 to 1 (or give the column in %)",
        ),
    ];
    for (what, content, message) in cases {
        println!("{what}");
        refused(&check, "a.csv", content, message);
    }
}

#[test]
fn manifests() {
    let check = ["trials", "check"];
    let cases = [
        (
            "not TOML",
            "[[run]\nfile = 1\n",
            "set.toml:1:7: not TOML: unclosed array table, expected `]`",
        ),
        (
            "no runs",
            "# nothing\n",
            "set.toml: lists no run; expected tables `[[run]]` with a `file`",
        ),
        (
            "unknown table",
            "[[runs]]\nfile = \"good.csv\"\n",
            "set.toml:1:3: unknown field `runs`; did you mean `run`?; known are run",
        ),
        (
            "unknown field",
            "[[run]]\nfile = \"good.csv\"\nwieght = 2\n",
            "set.toml:3:1: unknown field `wieght`; did you mean `weight`?; known are file, weight, use",
        ),
        (
            "no file",
            "# set\n[[run]]\nweight = 2\n",
            "set.toml:2:1: the field `file` is missing",
        ),
        (
            "file is a number",
            "[[run]]\nfile = 3\n",
            "set.toml:2:8: `file` is a number; expected a string",
        ),
        (
            "run is a table",
            "run = { file = \"good.csv\" }\n",
            "set.toml:1:7: `run` is a table; expected an array of tables",
        ),
        (
            "negative weight",
            "[[run]]\nfile = \"good.csv\"\nweight = -1\n",
            "set.toml:3: weight = -1; expected a finite number above 0",
        ),
        (
            "infinite weight",
            "[[run]]\nfile = \"good.csv\"\nweight = inf\n",
            "set.toml:3: weight = inf; expected a finite number above 0",
        ),
        (
            "unknown use",
            "[[run]]\nfile = \"good.csv\"\nuse = \"test\"\n",
            "set.toml:3: use = \"test\"; expected \"fit\" or \"validation\"",
        ),
        (
            "same trial twice",
            "[[run]]\nfile = \"good.csv\"\n[[run]]\nfile = \"good.csv\"\n",
            "two trials are named `good`: good.csv and good.csv; a trial is named after its file",
        ),
        (
            "missing trial",
            "[[run]]\nfile = \"gone.csv\"\n",
            "set.toml:2: `file` names gone.csv, which cannot be read: No such file or directory (os error 2)",
        ),
    ];
    for (what, content, message) in cases {
        println!("{what}");
        refused(&check, "set.toml", content, message);
    }
}

#[test]
fn vehicles() {
    let check = ["vehicle", "check"];
    let known = "known are mass, arm_length, inertia, gravity, hover_speed, propeller_lag, \
                 propeller_gain, attitude_gain, rate_gain, max_pitch";
    let cases = [
        ("not TOML", vehicle("mass = 1.2", "mass 1.2"), "v.toml:2:6: not TOML: key with no value, expected `=`".into()),
        ("unknown field", vehicle("rate_gain", "rate_gian"), format!("v.toml:10:1: unknown field `rate_gian`; did you mean `rate_gain`?; {known}")),
        ("missing field", vehicle("mass = ", "# "), "v.toml:1:1: the field `mass` is missing".into()),
        ("duplicate field", vehicle("arm_length", "mass"), "v.toml:3:1: not TOML: `mass` stands twice".into()),
        ("a string", vehicle("1.2", "\"1.2 kg\""), "v.toml:2:8: `mass` is a string; expected a number".into()),
        ("negative mass", vehicle("1.2", "-1.2"), "v.toml:2: mass = -1.2 kg is out of range; expected 0.001 to 10000 kg (mass m)".into()),
        ("grams", vehicle("mass = 1.2", "mass = 12000"), "v.toml:2: mass = 12000 kg is out of range; expected 0.001 to 10000 kg (mass m)".into()),
        ("not a number", vehicle("14.48", "nan"), "v.toml:7: propeller_lag = NaN 1/s is out of range; expected 0.1 to 1000 1/s (propeller lag a)".into()),
        ("the paper's sign", vehicle("22.96", "-76.37"), "v.toml:9: attitude_gain = -76.37 µs/rad is out of range; expected 0 to 100000 µs/rad (attitude gain k_φ, positive)".into()),
        ("degrees", vehicle("0.7853981633974483", "45"), "v.toml:11: max_pitch = 45 rad is out of range; expected 0.001 to 1.5707963267948966 rad (pitch angle that full stick commands, φ_max)".into()),
    ];
    for (what, content, message) in cases {
        println!("{what}");
        refused(&check, "v.toml", content, &message);
    }
}

#[test]
fn pilots() {
    let export = ["export", "pilot"];
    let good = "converged = true\nstick_limit = 1.0\n\n[theta]\ntheta1 = 1.0\ntheta2 = 2.0\n";
    let known = "known are tool, status, converged, stick_limit, theta, uncertainty, pole, closed_loop, doubt, fit, vehicle, data";
    let cases: &[(&str, String, String)] = &[
        ("not TOML", good.replace("[theta]", "[theta"), "p.toml:4:7: not TOML: unclosed table, expected `]`".into()),
        ("unknown field", good.replace("converged", "convergd"), format!("p.toml:1:1: unknown field `convergd`; did you mean `converged`?; {known}")),
        ("no theta", "converged = true\n".into(), "p.toml:1:1: the field `theta` is missing".into()),
        ("theta is a list", "theta = [1, 2]\n".into(), "p.toml:1:9: `theta` is an array; expected a table".into()),
        ("no parameters", "[theta]\n".into(), "p.toml:1: [theta] has 0 parameters; a pilot of order n has 2n: theta1 to theta2n".into()),
        ("an odd number", good.replace("theta2 = 2.0\n", ""), "p.toml:4: [theta] has 1 parameters; a pilot of order n has 2n: theta1 to theta2n".into()),
        ("a gap in the numbers", good.replace("theta2", "theta3"), "p.toml:6:1: unknown field `theta3`; did you mean `theta1`?; known are theta1, theta2".into()),
        ("a string", good.replace("2.0", "\"2\""), "p.toml:6:10: `theta2` is a string; expected a number".into()),
        ("not a number", good.replace("2.0", "nan"), "p.toml:6: theta2 = NaN; expected a finite number".into()),
        ("no stick", good.replace("stick_limit = 1.0", "stick_limit = 0"), "p.toml:2: stick_limit = 0; expected a finite number above 0".into()),
        ("converged is a word", good.replace("true", "\"yes\""), "p.toml:1:13: `converged` is a string; expected true or false".into()),
        ("not converged", good.replace("true", "false"), "p.toml: the fit did not converge\nhint: fit again (more iterations, another --start), or pass --allow-unconverged to export its best iterate".into()),
    ];
    for (what, content, message) in cases {
        println!("{what}");
        refused(&export, "p.toml", content, message);
    }
    let folder = Folder::new();
    folder.write("p.toml", good);
    let ended = folder.pilotage(&["export", "pilot", "p.toml"]);
    assert_eq!(
        ended.code, 0,
        "the file that the others are made of is good: {ended:?}"
    );
}

#[test]
fn uses() {
    let cases: &[(&[&str], &str)] = &[
        (
            &["trials", "check", "gone.csv"],
            "error: cannot read gone.csv: No such file or directory (os error 2)\n",
        ),
        (
            &["trials", "check", "."],
            "error: . is a folder; expected recorded flights (CSV) or lists of them (TOML)\n\
             hint: name the files in it: ./*\n",
        ),
        (
            &["vehicle", "check", "gone.toml"],
            "error: cannot read gone.toml: No such file or directory (os error 2)\n",
        ),
        (
            &["trials", "synth", "-o", "good.csv"],
            "error: good.csv is a file; expected a folder to fill\n",
        ),
        (
            &["trials", "synth", "--delay=-1"],
            "error: delay = -1 is out of range; expected 0 to 2\n",
        ),
        (
            &["trials", "synth", "--targets", "0"],
            "error: |targets| = 0 is out of range; expected 0.1 to 100000\n",
        ),
        (
            &["trials", "synth", "--rate", "nan"],
            "error: rate = NaN is out of range; expected 1 to 10000\n",
        ),
        (
            &["fit", "good.csv", "--mesh-step", "1e-9"],
            "error: the runs last 5.5 s, which is more than 400000 such steps; write 1.4e-5 or more\n",
        ),
    ];
    for (arguments, message) in cases {
        let folder = Folder::new();
        folder.write("good.csv", trial());
        let ended = folder.pilotage(arguments);
        assert_eq!(
            (ended.code, ended.stderr.as_str()),
            (2, *message),
            "{arguments:?}"
        );
        assert_eq!(
            folder.files(),
            ["good.csv"],
            "{arguments:?} left something behind"
        );
    }
}

#[test]
fn wrong_arguments_end_with_code_2_and_a_usage_line() {
    for arguments in [
        &["flyy"][..],
        &["trials", "chek", "a.csv"],
        &["vehicle", "check"],
        &["trials", "synth", "--runs", "many"],
    ] {
        let ended = Folder::new().pilotage(arguments);
        assert_eq!(ended.code, 2, "{arguments:?}");
        assert!(ended.stderr.starts_with("error: "), "{ended:?}");
    }
}
