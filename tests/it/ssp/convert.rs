//! SSP as system files and system files as SSP: read, written and read again it is the same.

use super::parts::nested;
use super::{rows, write};
use crate::command::{Folder, exported};

fn good(folder: &Folder, arguments: &[&str]) -> String {
    let ended = folder.pilotage(arguments);
    assert_eq!(ended.code, 0, "{arguments:?} {ended:?}");
    ended.stderr
}

#[test]
fn read_written_and_read_again_it_is_the_same() {
    let folder = Folder::new();
    nested(&folder);
    let expected = rows(&folder, &["nested.ssp"]);
    good(&folder, &["convert", "nested.ssp", "a.toml"]);
    good(&folder, &["convert", "a.toml", "b.ssp"]);
    good(&folder, &["convert", "b.ssp", "c.toml"]);
    good(&folder, &["convert", "c.toml", "d/e.ssd"]);
    good(&folder, &["convert", "d/e.ssd", "f.toml"]);
    let files = std::fs::read_dir(folder.path("a")).unwrap().count();
    assert_eq!(files, 2, "each FMU once");
    for system in ["a.toml", "b.ssp", "c.toml", "d/e.ssd", "f.toml"] {
        assert_eq!(rows(&folder, &[system]), expected, "{system}");
    }
    let first = folder.read("a.toml");
    assert!(first.contains("[system.\"inner-1.second lag\"]"), "{first}");
    assert_eq!(folder.read("c.toml").replace("\"c/", "\"a/"), first);
    assert_eq!(
        folder.read("f.toml").replace("\"d/resources/", "\"a/"),
        first
    );
    // What was written before is replaced, and nothing else.
    good(&folder, &["convert", "a.toml", "b.ssp"]);
    folder.write("mine.ssp", "not a zip");
    folder.write("mine.ssd", "<ssd/>");
    for mine in ["mine.ssp", "mine.ssd"] {
        let ended = folder.pilotage(&["convert", "a.toml", mine]);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains("--force"), "{ended:?}");
    }
    assert_eq!(folder.read("mine.ssp"), "not a zip");
    let ended = folder.pilotage(&["convert", "nested.ssp", "nested.ssp", "--force"]);
    assert_eq!(ended.code, 2, "{ended:?}");
}

/// Values and wires of all types.
#[test]
fn types_and_values_stay() {
    let folder = Folder::new();
    write(&folder, "fmus", &[]);
    folder.write("fmus/resources/typed3.fmu", crate::foreign::fmu3("good"));
    let text = "\
# A system of pilotage

[system.a]
model = \"fmus/resources/typed.fmu\"
[system.a.set]
u = 1.5
k = 2
flag_in = true
text_in = \"<a> & 'b'\\u000a\\\"c\\\"\"

[system.b]
model = \"fmus/resources/typed.fmu\"
[system.b.set]
flag_in = false

[system.c]
model = \"fmus/resources/typed3.fmu\"
[system.c.set]
\"array[1]\" = 0.5
\"array[2]\" = -1e-9
\"array[3]\" = 3

[system.d]
model = \"fmus/resources/typed.fmu\"

[connect]
\"c.sums[2]\" = \"d.u\"
\"a.y\" = { to = \"b.u\", factor = 0.1, offset = -3.0 }
\"a.n\" = \"b.n_in\"
\"a.text\" = \"b.text_in\"
";
    folder.write("a.toml", text);
    good(&folder, &["convert", "a.toml", "b.ssp"]);
    good(&folder, &["convert", "b.ssp", "c.toml"]);
    assert_eq!(
        folder.read("c.toml").replace("\"c/", "\"fmus/resources/"),
        text
    );
    let time = ["--stop-time", "1"];
    let [a, b] = ["a.toml", "b.ssp"].map(|system| rows(&folder, &[&[system], &time[..]].concat()));
    assert_eq!(a, b);
}

#[test]
fn what_ssp_cannot_say_is_refused() {
    let folder = exported();
    folder.write("course.csv", "time [s],target [m]\n0,0\n1,10\n");
    folder.write("lag.toml", super::LAG);
    for (system, message) in [
        (
            "[system.lag]\nmodel = \"lag.toml\"\n",
            "error: `lag` is a file of pilotage, lag.toml, and SSP has FMUs alone\n\
             hint: `pilotage export` makes FMUs of models, pilots and vehicles; tables stay beside: `cosim --input`\n",
        ),
        (
            "[system.pilot]\nmodel = \"pilot.fmu\"\n[system.course]\ntable = \"course.csv\"\n",
            "error: `course` is a table, course.csv, and SSP has FMUs alone\n\
             hint: `pilotage export` makes FMUs of models, pilots and vehicles; tables stay beside: `cosim --input`\n",
        ),
        (
            "[system.pilot]\nmodel = \"pilot.fmu\"\nset = { nothing = 3 }\n",
            "error: `nothing` is no variable of an instance\n",
        ),
    ] {
        folder.write("system.toml", system);
        let ended = folder.pilotage(&["convert", "system.toml", "system.ssp"]);
        assert_eq!((ended.code, ended.stderr.as_str()), (2, message));
        assert!(!folder.path("system.ssp").exists());
    }
    let ended = folder.pilotage(&["convert", "pilot.fmu", "system.ssp"]);
    assert!(
        ended.code == 2 && ended.stderr.contains("expected a system file"),
        "{ended:?}"
    );
    let ended = folder.pilotage(&["convert", "system.toml", "system.xml"]);
    assert!(
        ended.code == 2 && ended.stderr.contains("end its name with .toml"),
        "{ended:?}"
    );
}

#[test]
fn what_is_unpacked_for_a_run_is_not_saved() {
    let folder = Folder::new();
    nested(&folder);
    let ended = folder.pilotage(&[
        "cosim",
        "nested.ssp",
        "--step",
        "0.1",
        "--save-system",
        "s.toml",
    ]);
    assert!(
        ended.code == 2 && ended.stderr.contains("pilotage convert"),
        "{ended:?}"
    );
    assert!(!folder.path("s.toml").exists());
    rows(&folder, &["nested", "--save-system", "s.toml"]);
    assert!(
        folder
            .read("s.toml")
            .contains("model = \"nested/resources/lag.fmu\"")
    );
}
