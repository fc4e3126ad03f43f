//! Solves a problem file.
use std::ops::ControlFlow;
fn main() {
    for path in std::env::args().skip(1) {
        let file = match pilotage_estimation::ProblemFile::read(path.as_ref()) {
            Ok(f) => f,
            Err(e) => {
                println!("{e}");
                continue;
            }
        };
        let posed = match pilotage_estimation::Posed::new(&file, &pilotage_estimation::part::open) {
            Ok(p) => p,
            Err(e) => {
                println!("{e}");
                continue;
            }
        };
        let verbose = std::env::var("V").is_ok();
        let fit = pilotage_estimation::fit(&posed, &mut |p| {
            if verbose {
                println!("{} {} {:?}", p.start, p.refinement, p.iteration);
            }
            ControlFlow::Continue(())
        });
        println!(
            "== {path}: {:?} f={:.12} chi2={:.9} n={} it={} {:.3}s kkt {:?}",
            fit.status, fit.objective, fit.chi2, fit.samples, fit.iterations, fit.seconds, fit.kkt
        );
        for p in &fit.parameters {
            println!(
                "  {} [{:?}] {:?} bound {:?}",
                p.name, p.unit, p.values, p.bound
            );
        }
        for s in &fit.starts {
            println!("   start {:?} {}", s.0, s.1);
        }
        println!("  {:?}", fit.refinement);
        println!("  poles {:?}", fit.poles);
    }
}
