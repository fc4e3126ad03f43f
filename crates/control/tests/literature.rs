//! Problems of `examples/optimal_control` against the optima that were published, and small ones with exact optima.

use pilotage_control::interior::{self, Options, Status};
use pilotage_control::optimise::{Answer, Effort, Verdict, even, optimise, start};
use pilotage_control::pose::Posed;
use pilotage_control::program::Place;
use pilotage_estimation::{ProblemFile, part};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn example(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/optimal_control");
    folder.join(name).with_extension("toml")
}

fn solved(file: &ProblemFile) -> (Posed, Answer) {
    let posed = Posed::new(file, &part::open).unwrap_or_else(|error| panic!("{error}"));
    let answer = optimise(&posed, &Effort::default(), &mut |_| {
        ControlFlow::Continue(())
    });
    (posed, answer)
}

/// A problem in a folder of its own.
fn written(model: &str, problem: &str) -> Result<(Posed, Answer), String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("plant.toml"), model).expect("written");
    let file = ProblemFile::parse(problem, &folder.path().join("problem.toml"));
    let file = file.map_err(|error| error.to_string())?;
    let posed = Posed::new(&file, &part::open).map_err(|error| error.to_string())?;
    posed.check().map_err(|error| error.to_string())?;
    let answer = optimise(&posed, &Effort::default(), &mut |_| {
        ControlFlow::Continue(())
    });
    Ok((posed, answer))
}

/// The published optimum, within half of its last digit or the given tolerance.
#[track_caller]
fn assert_optimum(name: &str, published: f64, tolerance: f64) -> Answer {
    let file = ProblemFile::read(&example(name)).unwrap_or_else(|error| panic!("{error}"));
    let (_, answer) = solved(&file);
    let (found, replayed) = (answer.objective, answer.certificate.objective);
    assert_eq!(answer.verdict, Verdict::Optimal, "{name}: {answer:?}");
    assert!((found - published).abs() <= tolerance, "{name}: {found}");
    assert!(
        (found - replayed).abs() <= 1e-5 * found.abs(),
        "{name}: {replayed}"
    );
    answer
}

/// The cycloid from the origin to (2, 2): its angle θ solves (θ - sin θ)/(1 - cos θ) = 1, and the time is θ √(r/g).
#[test]
fn the_brachistochrone_is_a_cycloid() {
    let (mut low, mut high) = (1.0_f64, 4.0_f64);
    for _ in 0..100 {
        let middle: f64 = 0.5 * (low + high);
        match (middle - middle.sin()) / (1.0 - middle.cos()) < 1.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    let radius = 2.0 / (1.0 - low.cos());
    assert_optimum("brachistochrone", low * (radius / 9.81).sqrt(), 1e-7);
}

#[test]
fn a_double_integrator_touches_its_limit() {
    let answer = assert_optimum("bounded_double_integrator", 4.0, 1e-6);
    assert!(
        answer
            .active
            .iter()
            .any(|own| own.name == "cart.x" && own.is_upper)
    );
}

#[test]
fn a_cart_takes_half_a_minute() {
    assert_optimum("minimum_time_cart", 30.0, 5e-5);
}

#[test]
fn the_van_der_pol_oscillator_is_damped() {
    assert_optimum("van_der_pol", 2.867_259_5, 5e-6);
}

#[test]
fn goddards_rocket_has_a_singular_arc() {
    let answer = assert_optimum("goddard", 1.012_83, 1e-5);
    assert_eq!(answer.singular, ["rocket.thrust"]);
}

#[test]
fn the_particle_is_steered() {
    assert_optimum("particle_steering", 0.554_570, 1.5e-6);
}

#[test]
fn the_catalysts_are_mixed() {
    let answer = assert_optimum("catalyst_mixing", -0.048_055_7, 1e-7);
    assert_eq!(answer.singular, ["reactor.mixture"]);
}

#[test]
fn the_hang_glider_flies_far() {
    assert_optimum("hang_glider", 1248.03, 5e-3);
}

#[test]
fn the_robot_arm_moves_fast() {
    assert_optimum("robot_arm", 9.140_93, 3e-5);
}

#[test]
fn the_tumour_is_small_when_the_inhibitor_is_used_up() {
    let answer = assert_optimum("tumour", 7_571.671_58, 2e-4);
    // Where p is least it would grow again: its carrying capacity is the same.
    let last = &answer.trajectory[answer.trajectory.len() - 1];
    assert!((last.states[0] / last.states[1] - 1.0).abs() < 2e-3);
    assert!((last.states[2] - 15.0).abs() < 1e-6);
    assert!(
        (answer.duration - 1.1961).abs() < 3e-4,
        "{}",
        answer.duration
    );
}

/// Iterations of the first start on the first mesh, which no change should raise by much.
#[test]
fn few_iterations_are_taken() {
    for (name, most) in [
        ("brachistochrone", 34),
        ("bounded_double_integrator", 17),
        ("minimum_time_cart", 13),
        ("van_der_pol", 15),
        ("goddard", 22),
        ("particle_steering", 13),
        ("catalyst_mixing", 15),
        ("hang_glider", 18),
        ("robot_arm", 21),
        ("tumour", 22),
    ] {
        let file = ProblemFile::read(&example(name)).unwrap();
        let posed = Posed::new(&file, &part::open).unwrap();
        let program = posed.program(even(posed.intervals));
        let begin = start(&posed, &program, 0);
        let found = interior::solve(&program, begin, &Options::default(), &mut |_| true);
        assert_eq!(found.status, Status::Converged, "{name}");
        assert!(found.iterations <= most, "{name}: {}", found.iterations);
    }
}

/// At the solution the gradient of the Lagrangian vanishes, by differences of the program's own values: neither Jacobians nor
/// the structured elimination are used.
#[test]
fn multipliers_are_those_of_the_lagrangian() {
    // With jumps, limits along the path at the ends of intervals, a rate, and one state that is free at the start.
    let steps = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\nshape = \"constant\"\nmin = -8\n\
                 max = 8\nrate = 60\nfirst = \"free\"\n[initial]\n\"cart.v\" = \"free\"\n[objective]\n\
                 minimise = \"integral(cart.push^2) + duration^2 + initial(cart.v)^2\"\n[horizon]\n\
                 duration = { start = 1, min = 0.5, max = 2 }\n[final]\n\"cart.x\" = 1\n\"cart.v\" = 0\n\
                 [[constraint]]\nexpression = \"cart.v^2 + 0.1 * cart.push\"\nmax = 1.5\n";
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plant.toml"), CART).unwrap();
    let steps = ProblemFile::parse(steps, &folder.path().join("steps.toml")).unwrap();
    let published = ["van_der_pol", "goddard", "particle_steering"];
    let mut files: Vec<(&str, ProblemFile)> = published
        .iter()
        .map(|name| (*name, ProblemFile::read(&example(name)).unwrap()))
        .collect();
    files.push(("steps", steps));
    for (name, file) in files {
        let posed = Posed::new(&file, &part::open).unwrap();
        let program = posed.program(even(12));
        let begin = start(&posed, &program, 0);
        let found = interior::solve(&program, begin, &Options::default(), &mut |_| true);
        assert_eq!(found.status, Status::Converged, "{name}");
        let lagrangian = |z: &[f64]| {
            let values = program.values(z);
            let sum = |multipliers: &[f64], values: &[f64]| -> f64 {
                multipliers.iter().zip(values).map(|(l, v)| l * v).sum()
            };
            values.f
                + sum(&found.costates, &values.c)
                + sum(&found.ends, &values.e)
                + sum(&found.multipliers, &values.g)
        };
        let (n, m) = (program.n(), program.m());
        let is_known = |i: usize| match i {
            i if i < n => program.initial[i].is_some(),
            i if i < n + m => program.controls[i - n].first.is_some() || name == "steps",
            _ => false,
        };
        for i in (0..program.variables()).filter(|i| !is_known(*i)) {
            let step = 1e-5;
            let at = |d: f64| {
                let mut z = found.z.clone();
                z[i] += d;
                lagrangian(&z)
            };
            let slope = (at(step) - at(-step)) / (2.0 * step);
            assert!(slope.abs() < 1e-5, "{name}: {i}: {slope}");
        }
    }
}

const CART: &str = "[model]\nname = \"cart\"\n[inputs]\npush = {}\n[parameters]\nmass = { start = 1, min = 0.1 }\n\
                    [states]\nx = { der = \"v\" }\nv = { der = \"push / mass\" }\n";

/// To a distance of 1 at rest in a second: x = 3t² - 2t³, whose squared push has the integral 12.
#[test]
fn least_effort_is_a_cubic() {
    let problem = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\n\
                   [objective]\nminimise = \"integral(cart.push^2)\"\n[horizon]\nduration = 1\nintervals = 10\n\
                   [final]\n\"cart.x\" = 1\n\"cart.v\" = 0\n";
    let (_, answer) = written(CART, problem).unwrap();
    assert_eq!(answer.verdict, Verdict::Optimal);
    assert!(
        (answer.objective - 12.0).abs() < 1e-6,
        "{}",
        answer.objective
    );
    for at in &answer.trajectory {
        let t = at.time;
        assert!((at.states[0] - t * t * (3.0 - 2.0 * t)).abs() < 1e-7);
    }
}

/// A maximum of final values: of |x| and |v|/2 after 1 s with |push| ≤ 1 from x = 0, v = 1, the least of the larger. With
/// push -1 throughout v ends at 0 and x at 1/2; braking later is no better for x, and 1/2 is the least that x can be.
#[test]
fn a_maximum_of_magnitudes_is_exact() {
    let problem = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\nmin = -1\nmax = 1\n\
                   [initial]\n\"cart.v\" = 1\n\
                   [objective]\nminimise = \"max(abs(final(cart.x)), abs(final(cart.v)) / 2)\"\n\
                   [horizon]\nduration = 1\nintervals = 10\n";
    let (_, answer) = written(CART, problem).unwrap();
    assert_eq!(answer.verdict, Verdict::Optimal);
    assert!(
        (answer.objective - 0.5).abs() < 1e-6,
        "{}",
        answer.objective
    );
    assert!((answer.certificate.objective - 0.5).abs() < 1e-6);
}

/// With the rate of the push limited to 1/s and a push that begins at rest, x = t³/6 at most.
#[test]
fn rates_and_first_values_are_kept() {
    let problem = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\nmin = -9\nmax = 9\nrate = 1\n\
                   [objective]\nmaximise = \"final(cart.x)\"\n[horizon]\nduration = 2\nintervals = 8\n";
    let (_, answer) = written(CART, problem).unwrap();
    assert!(
        (answer.objective - 8.0 / 6.0).abs() < 1e-6,
        "{}",
        answer.objective
    );
    assert!(
        answer
            .active
            .iter()
            .any(|own| own.name == "the rate of cart.push")
    );
}

/// Held over intervals, a push for the least effort has the values of a discrete problem: to x = 1 from rest with two pushes
/// of half a second each, x = (3 p₀ + p₁)/8 and p₀²/2 + p₁²/2 is least at p = (2.4, 0.8).
#[test]
fn constant_controls_jump_at_nodes() {
    let problem = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\nshape = \"constant\"\n\
                   [objective]\nminimise = \"integral(cart.push^2)\"\n[horizon]\nduration = 1\nintervals = 2\n\
                   [final]\n\"cart.x\" = 1\n";
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plant.toml"), CART).unwrap();
    let file = ProblemFile::parse(problem, &folder.path().join("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    let effort = Effort {
        rounds: 0,
        ..Effort::default()
    };
    let answer = optimise(&posed, &effort, &mut |_| ControlFlow::Continue(()));
    assert!(
        (answer.objective - 0.5 * (2.4 * 2.4 + 0.8 * 0.8)).abs() < 1e-7,
        "{}",
        answer.objective
    );
    let pushes: Vec<f64> = [1, 4]
        .map(|k: usize| answer.trajectory[k].controls[0])
        .into();
    assert!(
        (pushes[0] - 2.4).abs() < 1e-5 && (pushes[1] - 0.8).abs() < 0.9,
        "{pushes:?}"
    );
    assert!(answer.certificate.distance < 1e-8);
}

/// A parameter as unknown: the mass for which the least effort is least, at its lower limit.
#[test]
fn parameters_are_sought_with_controls() {
    let problem = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\n\
                   [parameters]\n\"cart.mass\" = { start = 1, min = 0.5, max = 3 }\n\
                   [objective]\nminimise = \"integral(cart.push^2) + 0 * initial(cart.v)\"\n\
                   [horizon]\nduration = 1\nintervals = 10\n[final]\n\"cart.x\" = 1\n\"cart.v\" = 0\n";
    let (posed, answer) = written(CART, problem).unwrap();
    let k = posed
        .parameters
        .iter()
        .position(|own| own.name == "cart.mass")
        .unwrap();
    assert!((answer.parameters[k] - 0.5).abs() < 1e-5);
    assert!(
        (answer.objective - 3.0).abs() < 1e-5,
        "{}",
        answer.objective
    );
}

#[test]
fn what_cannot_be_met_is_named() {
    let base = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\nmin = -1\nmax = 1\n\
                [objective]\nminimise = \"integral(cart.push^2)\"\n[horizon]\nduration = 1\nintervals = 10\n";
    let limit = |expression: &str, more: &str| {
        format!("[[constraint]]\nexpression = \"{expression}\"\n{more}\n")
    };
    let last = |x: f64| format!("[final]\n\"cart.x\" = {x}\n");
    for (more, named) in [
        // Out of reach.
        (last(5.0), "the final value of cart.x"),
        (
            "[final]\n\"cart.v\" = 3\n".into(),
            "the final value of cart.v",
        ),
        // Within reach, but not within the limit of the path.
        (
            last(0.4) + &limit("cart.v", "max = 0.2"),
            "the final value of cart.x",
        ),
        // Two that exclude each other.
        (
            last(0.1) + &limit("cart.x", "at = \"end\"\nmin = 0.3"),
            "cart.x at the end",
        ),
        (
            "[initial]\n\"cart.x\" = \"free\"\n".to_owned()
                + &limit("cart.x", "min = 1")
                + &limit("cart.x + 0 * cart.push", "max = 0.5"),
            "cart.x",
        ),
        // A control beyond its own limits, a parameter beyond its range.
        (
            limit("cart.push", "at = \"end\"\nmin = 2"),
            "cart.push at the end",
        ),
        (
            "[parameters]\n\"cart.mass\" = { start = 1, min = 0.5, max = 2 }\n".to_owned()
                + &limit("cart.mass", "at = \"parameters\"\nmin = 3"),
            "cart.mass",
        ),
    ] {
        let (_, answer) = written(CART, &(base.to_owned() + &more)).unwrap();
        assert_eq!(answer.verdict, Verdict::Infeasible, "{more}");
        assert_eq!(answer.violated.as_deref(), Some(named), "{more}");
    }
    let start = base.to_owned() + &limit("cart.x", "min = 1");
    let error = written(CART, &start).expect_err("a mistake");
    assert!(
        error.contains("problem.toml:13:14: `cart.x` is 0 at the start, which is known, and not within 1 to inf"),
        "{error}"
    );
}

#[test]
fn mistakes_have_a_place() {
    let base = "[system.cart]\nmodel = \"plant.toml\"\n[[control]]\nsignal = \"cart.push\"\n[objective]\n\
                minimise = \"final(cart.x)\"\n[horizon]\nduration = 1\n";
    for (old, new, place, words) in [
        (
            "cart.push",
            "cart.pull",
            "problem.toml:4:10",
            "there are cart.push",
        ),
        (
            "final(cart.x)",
            "final(cart.y)",
            "problem.toml:6:19",
            "unknown name `cart.y`",
        ),
        (
            "final(cart.x)",
            "cart.x",
            "problem.toml:6:13",
            "outside final(...)",
        ),
        (
            "final(cart.x)",
            "final()",
            "problem.toml:6:12",
            "names nothing",
        ),
        (
            "duration = 1",
            "duration = -1",
            "problem.toml:8:12",
            "above 0",
        ),
        ("[horizon]\n", "", "problem.toml", "horizon"),
        ("[objective]", "[goal]", "problem.toml", "goal"),
    ] {
        let error = written(CART, &base.replace(old, new)).expect_err("a mistake");
        assert!(error.contains(place) && error.contains(words), "{error}");
    }
    let path = base.to_owned() + "[[constraint]]\nexpression = \"cart.x\"\nmin = 0\nmax = 0\n";
    let error = written(CART, &path).expect_err("a mistake");
    assert!(
        error.contains("problem.toml:10:14") && error.contains("leaves no control free"),
        "{error}"
    );
}

/// Each row of a program has a name in results.
#[test]
fn rows_are_where_the_file_says() {
    let file = ProblemFile::read(&example("bounded_double_integrator")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    let program = posed.program(even(4));
    let (limited, equations) = program.rows();
    // Two of each interval and the end; the final states.
    assert_eq!(limited.len(), 9);
    assert!(
        limited
            .iter()
            .all(|row| matches!(row.place, Place::Path { .. }))
    );
    assert_eq!(equations.len(), 2);
}
