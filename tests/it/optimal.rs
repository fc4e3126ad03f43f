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
