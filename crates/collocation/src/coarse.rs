//! The same problem on a coarser mesh with fewer samples. It is solved in a fraction of the time, and its solution is
//! close to that on the fine mesh (mesh continuation; Ascher, Mattheij & Russell, *Numerical Solution of Boundary Value
//! Problems for Ordinary Differential Equations*, section 9.4).

use crate::solve::solve;
use crate::{Collocation, Recording, Run};
use pilotage_sqp::{Iteration, SqpOptions, Status, Work};
use std::ops::ControlFlow;

/// Number of intervals that are merged into one, and of samples that are averaged. It is odd, so that the mean belongs
/// to the time of the middle sample.
const PARTS: usize = 5;

/// Minimum number of intervals and samples of a run for coarsening: smaller problems are solved in milliseconds anyway.
const FEWEST: usize = 200;

/// Variables closer to a solution than `z`: those of the coarser problem if there is one and it converges, otherwise
/// `z`. Also returns the work of that solve.
pub fn nearer(
    problem: &Collocation,
    z: Vec<f64>,
    options: &SqpOptions,
    see: &mut dyn FnMut(&Iteration) -> ControlFlow<Status>,
) -> (Vec<f64>, Work) {
    let Some(coarse) = coarser(problem) else {
        return (z, Work::default());
    };
    let solution = solve(&coarse, problem.carried(&z, &coarse), options, see);
    let z = match solution.status {
        Status::Converged => coarse.carried(&solution.iterate.z, problem),
        _ => z,
    };
    (z, solution.work)
}

/// The problem on a coarse mesh, or on a rough one where its inputs jump too often for that, with these variables carried there. None if
/// neither is much smaller.
pub fn reduced(problem: &Collocation, z: &[f64]) -> Option<(Collocation, Vec<f64>)> {
    let coarse = coarser(problem).or_else(|| rougher(problem))?;
    let z = problem.carried(z, &coarse);
    Some((coarse, z))
}

/// The problem with a fifth of its intervals and samples. None if it would not be much smaller or not nearly
/// equivalent: runs are short, inputs jump often, or a measured signal has values at few of the samples.
fn coarser(problem: &Collocation) -> Option<Collocation> {
    let runs = problem.runs.iter().map(thinned);
    Some(problem.with_runs(runs.collect::<Option<Vec<Run>>>()?))
}

/// Whether a run has many intervals and only a rough mesh stands for them, such as one whose inputs jump at each sample.
pub fn is_rough(run: &Run) -> bool {
    is_long(run) && thinned(run).is_none()
}

/// Whether a run has many intervals and no coarse mesh stands for them, such as one with conditions on time.
pub fn stays_long(run: &Run) -> bool {
    is_rough(run) && rough(run).is_none()
}

/// The problem with a fifth of its sample times, and means of inputs and measurements around them, whatever jumps in between: its
/// solution is a start for one whose inputs jump at each sample. None if runs are short.
fn rougher(problem: &Collocation) -> Option<Collocation> {
    let runs = problem.runs.iter().map(rough);
    Some(problem.with_runs(runs.collect::<Option<Vec<Run>>>()?))
}

fn rough(run: &Run) -> Option<Run> {
    let mut times = run.time.clone();
    times.dedup();
    if !is_long(run) || times.len() < FEWEST || !run.steps.time.is_empty() {
        return None;
    }
    let time: Vec<f64> = every(times.len()).map(|k| times[k]).collect();
    // The rows nearer to this time than to its neighbours.
    let middles: Vec<f64> = time
        .windows(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .collect();
    let before = |end: Option<&f64>| end.map(|end| run.time.partition_point(|t| t < end));
    let rows = |k: usize| {
        let first = before(k.checked_sub(1).map(|k| &middles[k])).unwrap_or(0);
        first..before(middles.get(k)).unwrap_or(run.time.len())
    };
    let inputs = |k: usize| -> Vec<f64> {
        let own = 0..run.inputs[0].len();
        own.map(|u| mean(run.inputs[rows(k)].iter().map(|row| row[u])))
            .collect()
    };
    let measured = run.measured.iter().map(|own| {
        let values = (0..time.len()).map(|k| mean(own.values[rows(k)].iter().copied()));
        standing_for(own, values.collect())
    });
    Some(Run {
        mesh: time.clone(),
        inputs: (0..time.len()).map(inputs).collect(),
        measured: measured.collect(),
        steps: run.steps.clone(),
        initial: run.initial.clone(),
        time,
    })
}

fn is_long(run: &Run) -> bool {
    run.mesh.len() > FEWEST && run.time.len() > FEWEST
}

fn thinned(run: &Run) -> Option<Run> {
    let rows = left(run);
    if !is_long(run) || 2 * rows.len() > run.time.len() {
        return None;
    }
    let measured = run.measured.iter().map(|own| averaged(own, &rows));
    let mesh: Vec<f64> = every(run.mesh.len()).map(|k| run.mesh[k]).collect();
    Some(Run {
        mesh: run.steps.on(&mesh),
        steps: run.steps.clone(),
        time: rows.iter().map(|k| run.time[*k]).collect(),
        inputs: rows.iter().map(|k| run.inputs[*k].clone()).collect(),
        measured: measured.collect::<Option<Vec<Recording>>>()?,
        initial: run.initial.clone(),
    })
}

/// Every fifth of `count` indices, and the last.
fn every(count: usize) -> impl Iterator<Item = usize> {
    (0..count).filter(move |k| k.is_multiple_of(PARTS) || k + 1 == count)
}

/// The samples that are kept: every fifth, the last, and all at which inputs jump.
fn left(run: &Run) -> Vec<usize> {
    let is_jump =
        |k: &usize| run.time[*k] == run.time[k + 1] && run.inputs[*k] != run.inputs[k + 1];
    let jumps = (0..run.time.len() - 1).filter(is_jump);
    let mut rows: Vec<usize> = jumps.flat_map(|k| [k, k + 1]).collect();
    rows.extend(every(run.time.len()));
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// A recording at these samples, each the mean of the neighbouring measurements, with the weight of all samples. None
/// if fewer than half of them have a value.
fn averaged(own: &Recording, rows: &[usize]) -> Option<Recording> {
    let around = |k: &usize| {
        let ends = k.saturating_sub(PARTS / 2)..(k + PARTS / 2 + 1).min(own.values.len());
        mean(own.values[ends].iter().copied())
    };
    let values: Vec<f64> = rows.iter().map(around).collect();
    (2 * known(&values) >= rows.len()).then(|| standing_for(own, values))
}

/// The recording with these means for its values, which have the weight of all.
fn standing_for(own: &Recording, values: Vec<f64>) -> Recording {
    let left = known(&values).max(1);
    Recording {
        weight: own.weight * known(&own.values) as f64 / left as f64,
        loss: own.loss,
        values,
    }
}

fn known(values: &[f64]) -> usize {
    values.iter().filter(|y| y.is_finite()).count()
}

/// Mean of the values that are known; NaN if none is.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let known = values.filter(|own| own.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), own| (sum + own, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Loss, Steps};

    fn run(inputs: impl Fn(usize) -> f64, values: impl Fn(usize) -> f64) -> Run {
        let time: Vec<f64> = (0..402).map(|k| 0.1 * (k - k / 401) as f64).collect();
        Run {
            mesh: time[..401].to_vec(),
            inputs: (0..402).map(|k| vec![inputs(k)]).collect(),
            measured: vec![Recording {
                values: (0..402).map(values).collect(),
                weight: 2.0,
                loss: Loss::Square,
            }],
            initial: vec![None],
            time,
            steps: Steps::default(),
        }
    }

    /// Where an input jumps at each sample, no mesh keeps the jumps; means of inputs and values stand for their neighbourhoods.
    #[test]
    fn means_stand_for_inputs_that_jump_at_each_sample() {
        let mut own = run(|k| if k % 2 == 0 { 1.0 } else { 3.0 }, |k| k as f64);
        own.time = (0..802).map(|k| own.time[k / 2]).collect();
        own.inputs = (0..802).map(|k| vec![[1.0, 3.0][k % 2]]).collect();
        own.measured[0].values = (0..802).map(|k| (k / 2) as f64).collect();
        assert!(is_rough(&own) && !stays_long(&own));
        let rough = rough(&own).expect("a rough mesh");
        assert_eq!(rough.time.len(), 81);
        assert!(rough.inputs.iter().all(|row| row == &[2.0]));
        let middle = 40;
        assert_eq!(rough.measured[0].values[middle], (5 * middle) as f64);
        assert_eq!(
            rough.measured[0].weight,
            own.measured[0].weight * 802.0 / 81.0
        );
    }

    /// Averaging preserves straight lines; a jump keeps both of its samples; the weight is that of all samples.
    #[test]
    fn a_fifth_is_left_with_the_weight_of_all() {
        let level = |k: usize| if k > 400 { 1.0 } else { 0.0 };
        let coarse = thinned(&run(level, |k| 3.0 * k as f64)).expect("a long run");
        assert_eq!((coarse.mesh.len(), coarse.time.len()), (81, 82));
        assert_eq!(coarse.time[80..], [40.0, 40.0]);
        assert_eq!(coarse.inputs[80..], [[0.0], [1.0]]);
        assert_eq!(
            coarse.measured[0].values[1..80],
            (1..80).map(|k| 15.0 * k as f64).collect::<Vec<_>>()
        );
        assert_eq!(coarse.measured[0].weight, 2.0 * 402.0 / 82.0);
    }

    #[test]
    fn what_would_be_another_problem_stays_as_it_is() {
        let is_thinned = |inputs: &dyn Fn(usize) -> f64, values: &dyn Fn(usize) -> f64| {
            thinned(&run(inputs, values)).is_some()
        };
        let (smooth, measured) = (|k: usize| k as f64, |_| 1.0);
        assert!(is_thinned(&smooth, &measured));
        let seldom = |k: usize| if k.is_multiple_of(30) { 1.0 } else { f64::NAN };
        assert!(!is_thinned(&smooth, &seldom));
        let mut stairs = run(smooth, measured);
        stairs.time = (0..402).map(|k| 0.2 * (k / 2) as f64).collect();
        assert!(thinned(&stairs).is_none());
        stairs = run(smooth, measured);
        stairs.mesh = vec![0.0, 40.0];
        assert!(thinned(&stairs).is_none());
    }
}
