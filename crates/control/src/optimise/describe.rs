//! What a solution says: its trajectory, what is active and what is singular.

use super::replay::ends;
use super::replay::outputs;
use super::theta;
use crate::interior::Solution;
use crate::interior::Status;
use crate::pose::Posed;
use crate::program::Place;
use crate::program::Program;

/// A point of a trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time \[s\].
    pub time: f64,
    /// The states.
    pub states: Vec<f64>,
    /// The controls.
    pub controls: Vec<f64>,
    /// The other signals.
    pub signals: Vec<f64>,
}

/// A constraint that the solution touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Active {
    /// Its name.
    pub name: String,
    /// At its upper limit rather than its lower.
    pub is_upper: bool,
    /// Number of places.
    pub count: usize,
    /// Sum of the magnitudes of its multipliers, of the scaled program.
    pub multiplier: f64,
}

pub(super) fn name_of(posed: &Posed, place: Place) -> String {
    match place {
        Place::Path { output, .. } => posed.limited[0][output].name.clone(),
        Place::Control { control, .. } => posed.controls[control].name.clone(),
        Place::Rate { control, .. } => format!("the rate of {}", posed.controls[control].name),
        Place::Parameter(k) => posed.parameters[k].name.clone(),
        Place::Start(k) => posed.limited[1][k].name.clone(),
        Place::End(k) => posed.limited[2][k - 1].name.clone(),
    }
}

/// The limits that the solution touches, in the order of the rows.
pub(super) fn active(posed: &Posed, program: &Program, found: &Solution) -> Vec<Active> {
    const TOUCHED: f64 = 1e-6;
    let mut all: Vec<Active> = Vec::new();
    for (row, multiplier) in program.rows().0.iter().zip(&found.multipliers) {
        let (name, is_upper) = (name_of(posed, row.place), *multiplier > 0.0);
        if multiplier.abs() <= TOUCHED || name == "the objective" {
            continue;
        }
        let known = all
            .iter_mut()
            .find(|own| own.name == name && own.is_upper == is_upper);
        match known {
            Some(own) => {
                own.count += 1;
                own.multiplier += multiplier.abs();
            }
            None => all.push(Active {
                name,
                is_upper,
                count: 1,
                multiplier: multiplier.abs(),
            }),
        }
    }
    all
}

/// Controls that enter the equations linearly and lie between their limits over a tenth of the path or more.
pub(super) fn singular(posed: &Posed, program: &Program, found: &Solution) -> Vec<String> {
    const PART: f64 = 0.1;
    const ROOM: f64 = 1e-3;
    let (n, m) = (program.n(), program.m());
    let pairs = posed.equations[0].pairs();
    let is_linear = |c: &usize| !pairs.contains(&(n + c, n + c));
    let (z, mesh) = (&found.z, &program.mesh);
    let inner = |c: usize| -> f64 {
        let (low, high) = program.controls[c].limits;
        let room = ROOM * (high - low);
        let inside = |k: &usize| {
            let u = z[program.node(*k) + n + c];
            room.is_finite() && u > low + room && u < high - room
        };
        let whole = |k: &usize| inside(k) && inside(&(k + 1));
        (0..program.intervals())
            .filter(whole)
            .map(|k| mesh[k + 1] - mesh[k])
            .sum()
    };
    let limited = (0..m).filter(is_linear).filter(|c| {
        found.status == Status::Converged
            && program.controls[*c].rate.is_infinite()
            && inner(*c) >= PART
    });
    limited.map(|c| posed.controls[c].name.clone()).collect()
}

pub(super) fn costates(program: &Program, found: &Solution) -> Vec<Vec<f64>> {
    let n = program.n();
    let own = |k: usize| found.costates[2 * n * k + n..2 * n * (k + 1)].to_vec();
    (0..program.intervals()).map(own).collect()
}

/// The trajectory at nodes and midpoints.
pub(crate) fn trajectory(posed: &Posed, program: &Program, z: &[f64]) -> Vec<Moment> {
    let n = program.n();
    let theta = theta(posed, program, z);
    let seconds = posed.seconds(&theta);
    let scales = &program.model.scales.states;
    let instant = |tau: f64, x: Vec<f64>| Moment {
        time: tau * seconds,
        signals: outputs(&posed.shown, tau, &x, &theta),
        controls: x[n..].to_vec(),
        states: x[..n].to_vec(),
    };
    let mut all = Vec::new();
    for k in 0..program.intervals() {
        let [first, last] = ends(program, z, k);
        let middle = &z[program.middle(k)..][..n];
        let mut x: Vec<f64> = middle
            .iter()
            .zip(scales)
            .map(|(x, scale)| x * scale)
            .collect();
        x.extend(
            first[n..]
                .iter()
                .zip(&last[n..])
                .map(|(a, b)| 0.5 * (a + b)),
        );
        all.push(instant(program.mesh[k], first));
        all.push(instant(0.5 * (program.mesh[k] + program.mesh[k + 1]), x));
        if k + 1 == program.intervals() {
            all.push(instant(1.0, last));
        }
    }
    all
}
