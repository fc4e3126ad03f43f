//! Small random collocation problems: models with linear, bilinear and transcendental terms, one or two
//! measured outputs, none to two bounded ones, every family of schemes, irregular meshes on the samples or
//! apart from them, missing samples, every kind of initial state.

use crate::differences::SCHEMES;
use crate::draw::Draw;
use num_dual::DualNum;
use pilotage_collocation::{
    Bound, Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales,
};
use pilotage_expression::{Point, System};
use pilotage_sqp::{Iterate, Problem};
use std::sync::Arc;

/// `ẋ_i = Σ_l a_il x_l + b_i w + θ_{i mod p} x_{(i+1) mod n} + e sin(θ_0 x_i)`, a measured output with
/// a square in it, and a bounded signal bilinear in states and parameters; another measured output that
/// depends on time, and another bounded one, where there are two.
#[derive(Debug, Clone)]
pub struct Model {
    pub n: usize,
    pub p: usize,
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    nonlinear: f64,
    measured: usize,
    bounded: usize,
}

impl Model {
    fn system(&self) -> System {
        let (n, p) = (self.n, self.p);
        let equations = |Point {
                             time,
                             x,
                             u,
                             p: theta,
                         }: Point<'_>| {
            let rate = |i: usize| {
                let linear = (0..n).fold(u[0] * self.b[i], |sum, l| sum + x[l] * self.a[i * n + l]);
                linear + theta[i % p] * x[(i + 1) % n] + (theta[0] * x[i]).sin() * self.nonlinear
            };
            let measured = [
                x[0] + x[n - 1] * x[n - 1] * self.nonlinear + theta[0] * u[0] * 0.3,
                x[n - 1] * (time * 0.9).cos() - theta[p - 1] * time,
            ];
            let signal = (1..n).fold(x[0] * self.c[0], |sum, l| sum + x[l] * self.c[l]);
            let bounded = [signal + theta[p - 1] * x[0], x[n - 1] * x[0] - time * 0.2];
            let outputs = measured[..self.measured]
                .iter()
                .chain(&bounded[..self.bounded]);
            [(0..n).map(rate).collect(), outputs.copied().collect()]
        };
        System::trace([n, 1, p], equations).unwrap()
    }
}

/// `θ_0 + 2 ≥ 0` and `θ_0 θ_{p-1} + 1.5 ≥ 0`.
pub fn constraints(p: usize) -> ParameterConstraints {
    let values = ParameterConstraints::trace(p, |theta| {
        vec![theta[0] + 2.0, theta[0] * theta[p - 1] + 1.5]
    });
    values.unwrap()
}

/// One of each kind of scheme: explicit, implicit, with inner nodes, without a derivative at the start, with
/// stages, with coefficients that are no states, and with one element for a whole run.
pub type Random = Collocation;

/// A random problem.
pub fn problem(seed: u64) -> Random {
    with_mesh(seed, false)
}

/// A random problem whose mesh is its samples, so that no two bounded rows are of one interval: their
/// multipliers are unique more often.
pub fn problem_on_samples(seed: u64) -> Random {
    with_mesh(seed, true)
}

fn with_mesh(seed: u64, on_samples: bool) -> Random {
    let mut draw = Draw::new(seed);
    let (n, p) = (1 + draw.below(4), 1 + draw.below(3));
    let model = Model {
        n,
        p,
        a: draw.vector(n * n),
        b: draw.vector(n),
        c: draw.vector(n),
        nonlinear: [0.0, 0.7][draw.below(2)],
        measured: 1 + (seed % 2) as usize,
        bounded: [1, 2, 1, 0, 1][(seed % 5) as usize],
    };
    let mut runs: Vec<Run> = (0..draw.below(4)).map(|_| run(&mut draw, n)).collect();
    let mut others = Draw::new(!seed);
    for run in runs.iter_mut().filter(|_| model.measured == 2) {
        run.measured.push(Recording {
            values: others.vector(run.time.len()),
            weight: 1.3 + others.one(),
            loss: Loss::Square,
        });
    }
    if on_samples {
        runs.iter_mut()
            .for_each(|run| run.mesh.clone_from(&run.time));
    }
    let positive = |v: Vec<f64>| v.iter().map(|v| 1.5 + v).collect();
    let scales = Scales {
        states: positive(draw.vector(n)),
        parameters: positive(draw.vector(p)),
    };
    let limit = [0.4, 1.0, 50.0][draw.below(3)];
    Collocation::new(
        Arc::new(Differentiated::new(&model.system())),
        constraints(p),
        SCHEMES[draw.below(SCHEMES.len())],
        runs,
        scales,
        &[
            Bound::at_samples(-limit, limit),
            Bound::at_samples(-0.7 * limit, 1.2 * limit),
        ][..model.bounded],
    )
}

fn run(draw: &mut Draw, n: usize) -> Run {
    let boundaries = 2 + draw.below(5);
    let mut time = vec![0.3];
    for k in 1..boundaries {
        time.push(time[k - 1] + 0.2 + 0.1 * draw.one());
    }
    let initial = match draw.below(3) {
        0 => vec![None; n],
        1 => draw.vector(n).into_iter().map(Some).collect(),
        _ => draw
            .vector(n)
            .into_iter()
            .map(|v| (v > 0.0).then_some(v))
            .collect(),
    };
    let mesh = match draw.below(3) {
        0 => time.clone(),
        _ => mesh(draw, time[0], time[boundaries - 1]),
    };
    Run {
        mesh,
        inputs: (0..boundaries).map(|_| draw.vector(1)).collect(),
        measured: vec![Recording {
            values: draw
                .vector(boundaries)
                .into_iter()
                .map(|v| if v > 0.8 { f64::NAN } else { v })
                .collect(),
            weight: 1.1 + draw.one(),
            loss: Loss::Square,
        }],
        initial,
        time,
        steps: pilotage_collocation::Steps::default(),
    }
}

/// Boundaries between two times, finer or coarser than the samples.
fn mesh(draw: &mut Draw, start: f64, end: f64) -> Vec<f64> {
    let intervals = 1 + draw.below(5);
    let parts: Vec<f64> = draw.vector(intervals).iter().map(|v| 1.5 + v).collect();
    let total: f64 = parts.iter().sum();
    let mut sum = 0.0;
    let inner = parts[1..].iter().zip(&parts).map(|(_, part)| {
        sum += part;
        start + (end - start) * sum / total
    });
    let inner: Vec<f64> = inner.collect();
    [vec![start], inner, vec![end]].concat()
}

/// A random point with multipliers: η where the constraints of the problem might be active.
pub fn iterate(problem: &Random, seed: u64) -> Iterate {
    let mut draw = Draw::new(seed ^ 0xabcd);
    let mut at = Iterate::new(problem, draw.vector(problem.n_variables()));
    at.lambda = draw.vector(at.lambda.len());
    at.eta = draw
        .vector(at.eta.len())
        .into_iter()
        .map(|v| if v > 0.5 { v } else { 0.0 })
        .collect();
    at
}
