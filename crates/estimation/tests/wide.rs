//! Rates of chemical and biological systems that range over many decades, as they are measured and published: the published
//! optimum is found from almost any start with the default settings, and fewer starts find nothing that more of them miss.

use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_sqp::Status;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Name, published objective, the tolerance of its digits, and the range of the rates in powers of ten.
const PROBLEMS: [(&str, f64, f64, [f64; 2]); 4] = [
    ("bodenstein", 21.867, 1e-4, [-9.0, 0.0]),
    ("gasoil", 5.2366e-3, 1e-4, [-5.0, 5.0]),
    ("pinene", 19.872, 1e-4, [-9.0, 1.0]),
    // A negative log likelihood of 138.22 with the constants of 48 normal values.
    ("stat5", 2.0 * 138.222 - 88.2181, 1e-3, [-5.0, 5.0]),
];

/// The fit of one of them, from a changed text.
fn solved(name: &str, change: impl FnOnce(String) -> String) -> Fit {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wide");
    let path = folder.join(name).with_extension("toml");
    let text = change(fs::read_to_string(&path).expect("a problem"));
    let file = ProblemFile::parse(&text, &path).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

#[test]
fn published_optima_are_found_from_almost_any_start() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    for (name, optimum, digits, [low, high]) in PROBLEMS {
        let is_found = |_: &u32| {
            let found = solved(name, |text| {
                let begun = text.lines().map(|line| {
                    let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
                    let start = 10f64.powf(low + (high - low) * share);
                    match line.starts_with("\"m.k") {
                        true => line.replace("{ scale", &format!("{{ start = {start:e}, scale")),
                        false => line.to_owned(),
                    }
                });
                begun.collect::<Vec<_>>().join("\n")
            });
            found.status == Status::Converged && (found.objective / optimum - 1.0).abs() < digits
        };
        let found = (0..10).filter(is_found).count();
        assert!(found >= 9, "{name}: {found} of 10");
    }
}

#[test]
fn more_starts_find_what_fewer_found() {
    let with = |starts: usize| {
        let found = solved("stat5", |text| format!("[fit]\nstarts = {starts}\n{text}"));
        assert_eq!(found.starts.len(), starts);
        found
    };
    let all: Vec<Fit> = [8, 16, 40].map(with).into_iter().collect();
    for pair in all.windows(2) {
        let [few, many] = pair else { unreachable!() };
        assert!(many.objective <= few.objective * (1.0 + 1e-6));
        for (a, b) in few.starts.iter().zip(&many.starts) {
            assert_eq!(
                (a.status, a.objective.to_bits()),
                (b.status, b.objective.to_bits())
            );
        }
    }
}
