//! The programs in `examples/` do what their first lines say.

use std::path::Path;
use std::process::Command;

/// Runs an example from the repository's folder and returns its stdout. `cargo test` builds the
/// examples beside the command; `cargo test --test it` alone does not.
fn run(name: &str, arguments: &[&str]) -> String {
    let beside = Path::new(env!("CARGO_BIN_EXE_pilotage")).with_file_name("examples");
    let program = beside
        .join(name)
        .with_extension(std::env::consts::EXE_EXTENSION);
    assert!(
        program.exists(),
        "{name} is not built; run `cargo build --examples` in this profile"
    );
    let output = Command::new(program)
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The numbers of each row below the line that begins with `head`.
fn rows(text: &str, head: &str) -> Vec<Vec<f64>> {
    (text
        .lines()
        .skip_while(|line| !line.starts_with(head))
        .skip(1))
    .map(|line| {
        line.split([' ', ','])
            .filter_map(|cell| cell.parse().ok())
            .collect()
    })
    .collect()
}

#[test]
fn closed_loop_converges_to_the_joint_ode_at_first_order() {
    let rows = rows(&run("closed_loop", &[]), "step");
    assert_eq!(rows.len(), 4);
    for pair in rows.windows(2) {
        for algorithm in [1, 2] {
            let ratio = pair[0][algorithm] / pair[1][algorithm];
            assert!((1.9..2.3).contains(&ratio), "{rows:?}");
        }
    }
    assert!(
        rows.iter().all(|row| row[2].abs() < 0.05 * row[1].abs()),
        "{rows:?}"
    );
}

#[test]
fn flyable_gains_draws_the_line_where_routh_does() {
    let text = run("flyable_gains", &[]);
    let rows = rows(&text, "rate_gain");
    let unstable = text
        .lines()
        .filter(|line| line.ends_with("unstable"))
        .count();
    // Stable when rate_gain exceeds 22.96 / 14.48 = 1.586.
    assert_eq!((rows.len(), unstable), (7, 2), "{text}");
    assert!(
        rows.iter().all(|row| (row[2] < 0.0) == (row[0] < 1.586)),
        "{text}"
    );
}

#[test]
fn identify_shows_that_the_response_fit_flies_nearest_to_the_recordings() {
    let text = run("identify", &["examples/trials/trials.toml"]);
    let squares = |objective: &str| -> f64 {
        let block = text.split(objective).nth(1).unwrap();
        let flown = block.lines().skip(1).take(6);
        let rms = |line: &str| {
            line.split(' ')
                .rev()
                .nth(1)
                .unwrap()
                .parse::<f64>()
                .unwrap()
        };
        flown.map(|line| rms(line).powi(2)).sum()
    };
    let (response, stick) = (
        squares("response fit: converged"),
        squares("stick fit: converged"),
    );
    assert!(response < stick && stick < 2.0, "{response} {stick} {text}");
}

#[test]
fn a_model_of_ones_own_is_fitted_and_flown() {
    let text = run("own_model", &[]);
    for (name, truth) in [
        ("theta1", 9.0),
        ("theta2", 5.0),
        ("theta3", 3.0),
        ("theta4", 4.5),
        ("drag", 0.25),
    ] {
        let line = text.lines().find(|line| line.starts_with(name)).unwrap();
        let found: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!((found / truth - 1.0).abs() < 0.01, "{line}");
    }
    let end = text.lines().last().unwrap().split_whitespace();
    let end: f64 = end.rev().nth(1).unwrap().parse().unwrap();
    assert!((end - 1.0).abs() < 0.01, "{end} m");
}
