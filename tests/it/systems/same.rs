//! A system is the same, whether arguments or a file say it; and arguments beside a file go before it.

use crate::command::{CONNECTIONS, Ended, Folder, exported};
use crate::foreign;
use serde_json::Value;

const RUN: [&str; 4] = ["--stop-time", "2", "--step", "0.05"];

const FLIGHT: &str = "\
[system.pilot]
model = \"pilot.fmu\"
set = { target = 10 }
[system.quadcopter]
model = \"quadcopter.fmu\"
[connect]
\"pilot.stick\" = \"quadcopter.stick\"
quadcopter.z = \"pilot.position\"
";

fn good(ended: Ended) -> Ended {
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{ended:?}");
    ended
}

/// Runs `cosim` and gives the result.
fn result(folder: &Folder, arguments: &[&str]) -> String {
    good(folder.pilotage(&[&["cosim"], arguments, &RUN].concat()));
    folder.read("result.csv")
}

#[test]
fn a_file_says_what_arguments_say() {
    let folder = exported();
    folder.write("flight.toml", FLIGHT);
    let models = ["pilot.fmu", "quadcopter.fmu"];
    let arguments = [&models[..], &CONNECTIONS, &["--set", "pilot.target=10"]].concat();
    assert_eq!(
        result(&folder, &["flight.toml"]),
        result(&folder, &arguments)
    );
    // From elsewhere too: files are beside the system file.
    folder.write("below/empty", "");
    folder.write(
        "below/flight.toml",
        FLIGHT.replace("model = \"", "model = \"../"),
    );
    assert_eq!(
        result(&folder, &["below/flight.toml"]),
        result(&folder, &arguments)
    );
    // A file of any length.
    folder.write(
        "long.toml",
        format!("{FLIGHT}{}", "# nothing\n".repeat(10_000)),
    );
    assert_eq!(result(&folder, &["long.toml"]), result(&folder, &arguments));
    let linear = ["--loop", "pilot.stick=quadcopter.stick", "--json"];
    let [of_file, of_flags] = [&["flight.toml"][..], &arguments]
        .map(|system| folder.pilotage(&[&["linearize"], system, &linear].concat()));
    assert_eq!(of_file.stdout, of_flags.stdout);
    assert_eq!(of_file.json()["loops"].as_array().unwrap().len(), 1);
}

/// Everything that arguments say about a system, saved and read again.
#[test]
fn what_is_saved_is_the_same_system() {
    let folder = exported();
    folder.write("foreign.fmu", foreign::fmu("good"));
    folder.write(
        "values.csv",
        "name,value,unit\nquadcopter.mass,1300,g\nother.n_in,3,\n",
    );
    folder.write("theta.toml", "[theta]\ntheta1 = 0.3\n");
    folder.write("deep/empty", "");
    let arguments = [
        "pilot.fmu",
        "quadcopter.fmu",
        "other=./foreign.fmu",
        "--kind",
        "me",
        "--connect",
        "pilot.stick=quadcopter.stick",
        "--connect",
        "quadcopter.z=pilot.position",
        "--connect",
        "course.altitude=pilot.target",
        "--connect",
        "quadcopter.z=other.u",
        "--parameters",
        "values.csv",
        "--set",
        "other.text_in=a \"b\" = 'c' # d",
        "--set",
        "other.flag_in=1",
    ];
    folder.write("course.csv", "time [s],altitude [ft]\n0,0\n1,30\n");
    let arguments = [&arguments[..], &["--input", "course.csv"]].concat();
    let of_flags = result(
        &folder,
        &[&arguments[..], &["--save-system", "deep/saved.toml"]].concat(),
    );
    assert_eq!(
        folder.read("deep/saved.toml"),
        "# A system of pilotage\n\
         \n[system.pilot]\nmodel = \"../pilot.fmu\"\nkind = \"me\"\n\
         \n[system.quadcopter]\nmodel = \"../quadcopter.fmu\"\nkind = \"me\"\n[system.quadcopter.set]\nmass = 1.3\n\
         \n[system.other]\nmodel = \"../foreign.fmu\"\nkind = \"me\"\n[system.other.set]\n\
         text_in = \"a \\\"b\\\" = 'c' # d\"\nflag_in = 1\nn_in = 3\n\
         \n[system.course]\ntable = \"../course.csv\"\n\
         \n[connect]\n\"pilot.stick\" = \"quadcopter.stick\"\n\
         \"quadcopter.z\" = [\"pilot.position\", \"other.u\"]\n\"course.altitude\" = \"pilot.target\"\n"
    );
    assert_eq!(result(&folder, &["deep/saved.toml"]), of_flags);
    // Saved again it is the same text, but for the folder.
    result(&folder, &["deep/saved.toml", "--save-system", "again.toml"]);
    let text = folder.read("deep/saved.toml").replace("\"../", "\"");
    assert_eq!(folder.read("again.toml"), text);
}

#[test]
fn arguments_go_before_the_file() {
    let folder = exported();
    folder.write("flight.toml", FLIGHT);
    let models = ["pilot.fmu", "quadcopter.fmu"];
    let target = |target| ["--set", target];
    let flags = |target| {
        result(
            &folder,
            &[&models[..], &CONNECTIONS, &["--set", target]].concat(),
        )
    };
    // A value.
    let beside = result(
        &folder,
        &[&["flight.toml"][..], &target("pilot.target=20")].concat(),
    );
    assert_eq!(beside, flags("pilot.target=20"));
    folder.write("values.toml", "pilot.target = 30\n");
    let beside = result(&folder, &["flight.toml", "--parameters", "values.toml"]);
    assert_eq!(beside, flags("pilot.target=30"));
    // A wire that is a value now, and one from elsewhere.
    let cut = result(&folder, &["flight.toml", "--set", "quadcopter.stick=0"]);
    let wire = ["--connect", "quadcopter.z=pilot.position"];
    let values = ["--set", "pilot.target=10", "--set", "quadcopter.stick=0"];
    assert_eq!(
        cut,
        result(&folder, &[&models[..], &wire, &values].concat())
    );
    let other = ["--connect", "pilot.error=pilot.position"];
    let moved = result(&folder, &[&["flight.toml"][..], &other].concat());
    let wires = ["--connect", "pilot.stick=quadcopter.stick"];
    let arguments = [&models[..], &wires, &other, &["--set", "pilot.target=10"]].concat();
    assert_eq!(moved, result(&folder, &arguments));
    // An instance in the place of another, and one more.
    let heavy = good(folder.pilotage(&["vehicle", "show"])).stdout;
    folder.write("heavy.toml", heavy.replace("mass = 1.2", "mass = 1.5"));
    let replaced = result(&folder, &["flight.toml", "quadcopter=heavy.toml"]);
    let arguments = [
        "pilot.fmu",
        "quadcopter=heavy.toml",
        "--set",
        "pilot.target=10",
    ];
    assert_eq!(
        replaced,
        result(&folder, &[&arguments[..], &CONNECTIONS].concat())
    );
    let header = |text: String| text.lines().next().unwrap().to_owned();
    let more = header(result(&folder, &["flight.toml", "second=pilot.fmu"]));
    assert!(more.contains("second.stick"), "{more}");
}

/// What is wrong beside a file, or with where a system is saved.
#[test]
fn uses_that_make_no_sense() {
    let folder = exported();
    folder.write("flight.toml", FLIGHT);
    folder.write("second.toml", FLIGHT);
    folder.write(
        "my-pilot .fmu",
        std::fs::read(folder.path("pilot.fmu")).unwrap(),
    );
    for (arguments, message) in [
        (
            &["flight.toml", "second.toml"][..],
            "error: flight.toml and second.toml are system files; expected one\n\
             hint: copy the tables of one into the other\n",
        ),
        (
            &["f=flight.toml"],
            "error: flight.toml is a system file, which has no name\n\
             hint: leave what stands before the `=` out\n",
        ),
        (
            &["flight.toml", "a=pilot.fmu", "a=pilot.fmu"],
            "error: two instances are named `a`; give one another name\n",
        ),
        (
            &["flight.toml", "--save-system", "flight.toml"],
            "error: flight.toml is an input of this command, and would be overwritten\n\
             hint: give the output another name\n",
        ),
        (
            &["flight.toml", "--save-system", "./pilot.fmu", "--force"],
            "error: ./pilot.fmu is an input of this command (as pilot.fmu), and would be overwritten\n\
             hint: give the output another name\n",
        ),
        (
            &["flight.toml", "--save-system", "result.csv"],
            "error: two outputs go to result.csv\nhint: give each output a name of its own\n",
        ),
        (
            &["pilot.fmu", "--save-system", "second.toml"],
            "error: second.toml exists and is not a saved system of pilotage\n\
             hint: give the output another name, or overwrite that file with --force\n",
        ),
        (
            &["pilot.fmu", "--save-system", "none/a.toml"],
            "error: cannot write none/a.toml: No such file or directory (os error 2)\n",
        ),
        (
            &["my-pilot .fmu", "--save-system", "a.toml"],
            "error: `my-pilot ` cannot name an instance in a system file: expected visible characters, and no space \
             at an end\nhint: name the instance otherwise: NAME=FILE instead of FILE\n",
        ),
        (
            &["pilot"],
            "error: there is no built-in model `pilot`; did you mean the file `pilot.fmu`?\n",
        ),
    ] {
        let ended = folder.pilotage(&[&["cosim"], arguments, &RUN].concat());
        assert_eq!(
            (ended.code, ended.stderr.as_str()),
            (2, message),
            "{arguments:?}"
        );
    }
    assert_eq!(folder.read("flight.toml"), FLIGHT);
    assert_eq!(folder.read("second.toml"), FLIGHT);
    for command in [
        &["fit", "flight.toml"][..],
        &["vehicle", "show", "flight.toml"],
    ] {
        let ended = folder.pilotage(command);
        let hint =
            "hint: a system belongs to `pilotage cosim flight.toml`, `linearize` or `info`\n";
        assert!(ended.code == 2 && ended.stderr.ends_with(hint), "{ended:?}");
    }
}

#[test]
fn info_tells_what_a_system_is_made_of() {
    let folder = exported();
    folder.write("course.csv", "time [s],altitude [ft]\n0,0\n1,30\n");
    let course = "[system.course]\ntable = \"course.csv\"\n[connect]\n\"course.altitude\" = \"pilot.target\"\n";
    let flight = FLIGHT.replace("set = { target = 10 }\n", "set = { theta1 = 0.5 }\n");
    let flight = flight.replace("[connect]\n", course);
    folder.write(
        "flight.toml",
        flight.replace("quadcopter.z = \"pilot.position\"\n", ""),
    );
    let shown = good(folder.pilotage(&["info", "flight.toml"])).stdout;
    let expected = "\
flight.toml

instance    model           set
pilot       pilot.fmu       theta1 = 0.5
quadcopter  quadcopter.fmu
course      course.csv

from             unit  to                unit
course.altitude  ft    pilot.target      m     converted
pilot.stick      1     quadcopter.stick  1

free input      type  unit
pilot.position  Real  m

output              type  unit
pilot.stick         Real  1
pilot.error         Real  m
quadcopter.z        Real  m
quadcopter.phi      Real  rad
quadcopter.v        Real  m/s
quadcopter.q        Real  rad/s
quadcopter.omega_f  Real  krad/s
quadcopter.omega_b  Real  krad/s
course.altitude     Real  ft
";
    assert_eq!(shown, expected);
    let json: Value = good(folder.pilotage(&["info", "flight.toml", "--json"])).json();
    assert_eq!(json["instances"][0]["set"]["theta1"], "0.5");
    assert_eq!(json["instances"][2]["table"], "course.csv");
    let wire = &json["connections"][0];
    assert_eq!(wire["from"], "course.altitude");
    assert_eq!(
        (&wire["fromUnit"], &wire["toUnit"]),
        (&"ft".into(), &"m".into())
    );
    assert_eq!(wire["factor"].as_f64(), Some(0.3048));
    assert_eq!(json["inputs"].as_array().unwrap().len(), 1);
    let valid = good(folder.pilotage(&["validate", "flight.toml"])).stdout;
    let begin = "flight.toml: its 2 connections fit\npilot.fmu: ";
    assert!(
        valid.starts_with(begin) && valid.contains("\nquadcopter.fmu: "),
        "{valid}"
    );
}
