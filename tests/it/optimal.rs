//! `pilotage optimise`: what it writes, and how it ends.

use crate::command::{Folder, example};

const CART: &str = "[model]\nname = \"cart\"\n[inputs]\npush = { unit = \"m/s2\" }\n[states]\n\
                    x = { unit = \"m\", der = \"v\" }\nv = { unit = \"m/s\", der = \"push\" }\n\
                    [outputs]\nx = {}\n";

const PROBLEM: &str = "[system.cart]\nmodel = \"cart.toml\"\n[[control]]\nsignal = \"cart.push\"\nmin = -1\nmax = 1\n\
                       [objective]\nminimise = \"duration\"\n[horizon]\nduration = { start = 1, min = 0.1, max = 9 }\n\
                       [final]\n\"cart.x\" = 1\n\"cart.v\" = 0\n";

fn folder(problem: &str) -> Folder {
    let folder = Folder::new();
    folder.write("cart.toml", CART);
    folder.write("problem.toml", problem);
    folder
}

#[test]
fn an_optimum_is_written_as_a_table_and_as_json() {
    let folder = folder(PROBLEM);
    let ended = folder.pilotage(&["optimise", "problem.toml", "-o", "flight.csv"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(ended.stdout.contains("a local optimum"), "{ended:?}");
    assert!(
        ended.stdout.contains("replay: objective 2.0000"),
        "{ended:?}"
    );
    let flight = folder.read("flight.csv");
    let header = flight.lines().next().unwrap();
    assert_eq!(header, "time [s],cart.x [m],cart.v [m/s],cart.push [m/s2]");
    let found = folder
        .pilotage(&["optimise", "problem.toml", "--json"])
        .json();
    assert_eq!(found["status"], "optimal");
    assert!((found["duration"].as_f64().unwrap() - 2.0).abs() < 1e-4);
    assert_eq!(found["starts"].as_array().unwrap().len(), 3);
    assert!(found["certificate"]["violation"].as_f64().unwrap() < 1e-6);
    // The trajectory drives the cart again.
    let ended = folder.pilotage(&[
        "cosim",
        "cart=cart.toml",
        "--input",
        "flight.csv",
        "--connect",
        "flight.cart.push=cart.push",
        "--stop-time",
        "2",
        "--step",
        "0.001",
        "-o",
        "again.csv",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let again = folder.read("again.csv");
    let last = again
        .lines()
        .next_back()
        .unwrap()
        .rsplit(',')
        .next()
        .unwrap();
    // The push is held over steps of a millisecond.
    assert!((last.parse::<f64>().unwrap() - 1.0).abs() < 2e-3, "{last}");
}

/// A trajectory as start: of the same problem with another end, with a parameter in its comments.
#[test]
fn an_earlier_answer_is_a_start() {
    let folder = folder(PROBLEM);
    let sought = CART.replace(
        "[states]",
        "[parameters]\nmass = { start = 1, unit = \"1\", min = 0.1 }\n[states]",
    );
    folder.write("cart.toml", sought.replace("\"push\"", "\"push / mass\""));
    let problem = PROBLEM.replace(
        "[objective]",
        "[parameters]\n\"cart.mass\" = { start = 1, min = 0.5, max = 2 }\n[objective]",
    );
    folder.write("problem.toml", &problem);
    let ended = folder.pilotage(&["optimise", "problem.toml", "-o", "flight.csv"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(folder.read("flight.csv").starts_with("# cart.mass: 0."));
    folder.write(
        "further.toml",
        problem.replace("\"cart.x\" = 1", "\"cart.x\" = 1.1"),
    );
    folder.write(
        "guessed.toml",
        "guess = \"flight.csv\"\n".to_owned() + &folder.read("further.toml"),
    );
    let first = |words: &[&str]| {
        let ended = folder.pilotage(&[&["optimise", "--no-refinement", "--json"], words].concat());
        let found = ended.json();
        assert_eq!(found["starts"][0]["status"], "converged", "{found}");
        let iterations = found["starts"][0]["iterations"].as_u64().unwrap();
        (iterations, found["objective"].as_f64().unwrap())
    };
    let (cold, expected) = first(&["further.toml"]);
    for words in [
        &["further.toml", "--from", "flight.csv"][..],
        &["guessed.toml"],
    ] {
        let (warm, objective) = first(words);
        assert!(warm < cold, "{warm} of {cold} iterations");
        assert!((objective - expected).abs() < 1e-6 * expected);
    }
    for (table, words) in [
        (
            "time [s],cart.x [ft]\n0,0\n1,1\n",
            "`cart.x` is in [ft] here and in [m]",
        ),
        (
            "time [s],other\n0,0\n1,1\n",
            "no column is a state or a control",
        ),
        (
            "time [s],cart.x [m]\n0,0\n1,\n",
            "`cart.x` has cells without a number",
        ),
        ("time [s],cart.x [m]\n0,0\n", "two rows at least"),
        (
            "# cart.mass: much\ntime [s],cart.x [m]\n0,0\n1,1\n",
            "`cart.mass: much` is no number",
        ),
    ] {
        folder.write("bad.csv", table);
        let ended = folder.pilotage(&["optimise", "further.toml", "--from", "bad.csv"]);
        assert_eq!(ended.code, 2, "{ended:?}");
        assert!(ended.stderr.contains("bad.csv"), "{ended:?}");
        assert!(ended.stderr.contains(words), "{ended:?}");
    }
}

/// A model that was exported gives the optimum of its file.
#[test]
fn an_fmu_has_the_optimum_of_its_model() {
    let folder = folder(PROBLEM);
    let ended = folder.pilotage(&["export", "cart.toml", "-o", "cart.fmu"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    folder.write("fmu.toml", PROBLEM.replace("cart.toml", "cart.fmu"));
    let [model, fmu] = ["problem.toml", "fmu.toml"].map(|problem| {
        let found = folder.pilotage(&["optimise", problem, "--json"]).json();
        assert_eq!(found["status"], "optimal", "{found}");
        found["objective"].as_f64().unwrap()
    });
    assert!((model - fmu).abs() < 1e-9 * model, "{model} and {fmu}");
}

/// The gearing with which a pilot has a phase margin of 45°, against the transfer functions: e^(-τs) by Padé's [2/2], the lags
/// of arm and roll, and an integrator; and against what `linearize` says of the loop.
#[test]
fn a_gearing_suits_a_pilot() {
    let file = |name: &str| example(&format!("gearing/{name}")).display().to_string();
    let folder = Folder::new();
    let ended = folder.pilotage(&["optimise", &file("gearing.toml"), "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let found = ended.json();
    let value = |name: &str| found["parameters"][name]["value"].as_f64().unwrap();
    let (gain, delay, arm, roll) = (2.0, 0.25, 0.1, 0.2_f64);
    let late = |w: f64| {
        let half = (w * delay / 2.0).atan2(1.0 - (w * delay).powi(2) / 12.0);
        90.0_f64.to_radians() + 2.0 * half + (w * arm).atan() + (w * roll).atan()
    };
    let (mut low, mut high) = (0.1_f64, 5.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match late(middle) < 135.0_f64.to_radians() {
            true => low = middle,
            false => high = middle,
        }
    }
    let gearing = low * (low * arm).hypot(1.0) * (low * roll).hypot(1.0) / gain;
    assert!((value("error.omega") / low - 1.0).abs() < 1e-6, "{found}");
    assert!((value("vehicle.gearing") / gearing - 1.0).abs() < 1e-6);
    let ended = folder.pilotage(&[
        "linearize",
        &format!("pilot={}", file("pilot.toml")),
        &format!("vehicle={}", file("vehicle.toml")),
        "--set",
        &format!("vehicle.gearing={}", value("vehicle.gearing")),
        "--connect",
        "pilot.stick=vehicle.stick",
        "--connect",
        "vehicle.roll=pilot.position",
        "--loop",
        "pilot.stick=vehicle.stick",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(ended.stdout.contains("phase margin 45.0 deg"), "{ended:?}");
}

#[test]
fn an_impossible_end_is_named() {
    let folder = folder(&PROBLEM.replace("max = 9 }", "max = 1.5 }"));
    let ended = folder.pilotage(&["optimise", "problem.toml"]);
    assert_eq!(ended.code, 1, "{ended:?}");
    assert!(ended.stdout.contains("infeasible"), "{ended:?}");
    assert!(
        ended
            .stdout
            .contains("violated most: the final value of cart."),
        "{ended:?}"
    );
}

#[test]
fn a_problem_goes_to_the_command_that_solves_it() {
    let folder = folder(PROBLEM);
    let ended = folder.pilotage(&["fit", "problem.toml"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .stderr
            .contains("problem.toml:8:12: nothing is measured here"),
        "{ended:?}"
    );
    let battery = example("problems/battery/problem.toml")
        .display()
        .to_string();
    let ended = folder.pilotage(&["optimise", &battery]);
    assert_eq!(ended.code, 2);
    assert!(ended.stderr.contains("nothing is optimised"), "{ended:?}");
    // Neither is the output an input.
    let ended = folder.pilotage(&["optimise", "problem.toml", "-o", "cart.toml"]);
    assert_eq!(ended.code, 2);
    assert_eq!(folder.read("cart.toml"), CART);
}
