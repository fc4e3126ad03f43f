//! Meshes: their local errors, finer ones, and variables on another.

use super::replay::ends;
use super::replay::integrated;
use super::theta;
use crate::pose::Posed;
use crate::program::Program;
use crate::program::Shape;
use rayon::prelude::*;

/// Second difference of a control, relative to its range, from which an interval is divided: it jumps there, or bends.
const BENT: f64 = 0.02;

/// Nodes at equal distances.
pub fn even(intervals: usize) -> Vec<f64> {
    (0..=intervals)
        .map(|k| k as f64 / intervals as f64)
        .collect()
}

/// Local error of each interval: the largest difference at its end from what error control finds from its start, relative
/// to the state's largest magnitude.
pub fn mesh_errors(posed: &Posed, program: &Program, z: &[f64]) -> Vec<f64> {
    let n = program.n();
    let theta = theta(posed, program, z);
    let scales = &program.model.scales.states;
    let largest = |i: usize| {
        let all = (0..=program.intervals()).map(|k| z[program.node(k) + i].abs());
        scales[i] * all.fold(1e-3, f64::max)
    };
    let sizes: Vec<f64> = (0..n).map(largest).collect();
    let error = |k: usize| {
        let [first, last] = ends(program, z, k);
        match integrated(
            posed,
            program,
            (z, &theta),
            (k, 1),
            &first[..n],
            &mut |_, _| {},
        ) {
            Some(x) => (0..n).fold(0.0_f64, |m, i| m.max((x[i] - last[i]).abs() / sizes[i])),
            None => f64::INFINITY,
        }
    };
    (0..program.intervals())
        .into_par_iter()
        .map(error)
        .collect()
}

/// A mesh with more nodes where errors are large or controls bend.
pub(super) fn finer(program: &Program, z: &[f64], errors: &[f64], tolerance: f64) -> Vec<f64> {
    let (n, count) = (program.n(), program.intervals());
    let mut parts: Vec<usize> = errors
        .iter()
        .map(|error| match error / tolerance {
            ratio if ratio <= 1.0 => 1,
            ratio => ((2.0 * ratio).powf(0.25).ceil() as usize).clamp(2, 4),
        })
        .collect();
    for (c, control) in program.controls.iter().enumerate() {
        let value = |k: usize| z[program.node(k) + n + c];
        let (low, high) = control.limits;
        let all = (0..=count).map(value);
        let spread =
            all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min);
        let range = if (high - low).is_finite() {
            high - low
        } else {
            spread
        };
        let from = usize::from(control.shape == Shape::Constant);
        for k in from..count {
            // A jump of a constant control is at a node, and both its intervals are divided.
            let bend = match control.shape {
                Shape::Constant => value(k + 1) - value(k),
                Shape::Linear if k > 0 => {
                    let before = (value(k) - value(k - 1)) / program.h(k - 1);
                    let after = (value(k + 1) - value(k)) / program.h(k);
                    (after - before) * program.h(k - 1).min(program.h(k))
                }
                Shape::Linear => 0.0,
            };
            if bend.abs() > BENT * range && range > 0.0 {
                for own in &mut parts[k.saturating_sub(1)..=k] {
                    *own = (*own).max(2);
                }
            }
        }
    }
    if parts.iter().all(|own| *own == 1) {
        // Nothing stands out: the objective must not change on a finer mesh all the same.
        parts.fill(2);
    }
    let mut mesh = vec![0.0];
    for (k, own) in parts.iter().enumerate() {
        let (from, h) = (program.mesh[k], program.h(k));
        mesh.extend((1..*own).map(|part| from + h * part as f64 / *own as f64));
        mesh.push(program.mesh[k + 1]);
    }
    mesh
}

/// Variables on another mesh.
pub fn carried(posed: &Posed, program: &Program, z: &[f64], onto: &Program) -> Vec<f64> {
    let (n, m) = (program.n(), program.m());
    let scales = &program.model.scales.states;
    let interval = |tau: f64| {
        let k = program
            .mesh
            .partition_point(|own| *own <= tau)
            .clamp(1, program.intervals())
            - 1;
        (k, (tau - program.mesh[k]) / program.h(k))
    };
    let states = |tau: f64| -> Vec<f64> {
        let (k, t) = interval(tau);
        let [a, b, middle] = [program.node(k), program.node(k + 1), program.middle(k)];
        let weights = [
            (1.0 - t) * (1.0 - 2.0 * t),
            4.0 * t * (1.0 - t),
            t * (2.0 * t - 1.0),
        ];
        let of = |i: usize| {
            scales[i] * (weights[0] * z[a + i] + weights[1] * z[middle + i] + weights[2] * z[b + i])
        };
        (0..n).map(of).collect()
    };
    let controls = |tau: f64| -> Vec<f64> {
        let (k, t) = interval(tau);
        let of = |c: usize| {
            let [a, b] = [k, k + 1].map(|k| z[program.node(k) + n + c]);
            // At a node, that of the interval before: a program has the value of an interval at its end.
            scales[n + c]
                * match program.controls[c].shape {
                    Shape::Linear => a + t * (b - a),
                    Shape::Constant if t == 0.0 && k > 0 => a,
                    Shape::Constant => b,
                }
        };
        (0..m).map(of).collect()
    };
    posed.variables(onto, &states, &controls, &theta(posed, program, z))
}
