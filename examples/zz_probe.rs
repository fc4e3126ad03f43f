use pilotage::identification::{Options, TrialSet, problem, start};
use pilotage::sqp;
use pilotage::transcription::{Condensed, Scheme};
use std::ops::ControlFlow;
use std::path::Path;
fn main() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/trials/trials.toml");
    let set = TrialSet::read(&[manifest]).unwrap();
    let verbose = std::env::args().nth(2).is_some();
    let scheme: Scheme = std::env::args().nth(1).unwrap().parse().unwrap();
    let options = Options {
        scheme,
        ..Options::default()
    };
    let trials = &set.fit;
    let sticks: Vec<_> = trials
        .iter()
        .map(|t| start::implied_stick(t, &options.vehicle))
        .collect();
    for theta in start::candidates(trials, &sticks, &options) {
        let states: Vec<_> = trials
            .iter()
            .map(|t| start::joint_states(t, &options, &theta))
            .collect();
        let p = problem::response(trials, &options, start::scales(&states, &theta));
        let z = start::variables(&p, &states, &theta);
        let clock = std::time::Instant::now();
        let o = sqp::Options {
            short_step: 0.01,
            ..sqp::Options::default()
        };
        let s = sqp::solve(&p, &mut Condensed::default(), z, &o, &mut |i| {
            if verbose {
                println!(
                    "{:3} f {:12.6} d {:9.2e} p {:9.2e} a {:5.3} mu {:8.1e} act {} ex {}",
                    i.number,
                    i.objective,
                    i.kkt.dual,
                    i.kkt.primal,
                    i.step,
                    i.damping,
                    i.active,
                    i.exact
                );
            }
            ControlFlow::Continue(())
        });
        println!(
            "{:?} f {} {:?} {:.1} ms",
            s.status,
            s.iterate.f,
            s.work,
            clock.elapsed().as_secs_f64() * 1e3
        );
    }
}
