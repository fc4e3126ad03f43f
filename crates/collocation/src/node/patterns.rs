//! Which derivatives are ever other than zero, which are constant, and which are affine: found at random
//! points.

use super::derivatives::Evaluated;
use super::jet::Jet;
use super::{
    Affine, AffineValues, CURVED, Curved, CurvedPair, Linear, MAX_SIZE, NodeModel, PARTS,
    Quadratic, Values,
};
use crate::lanes::{LANES, side_by_side};
use pilotage_models::Dynamics;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Random points.
const PROBES: usize = 8;

/// Derivatives at a random point.
struct Probe {
    /// `[x̄; θ̄]`.
    variables: Vec<f64>,
    /// First derivatives, rows of `[f̄; measured; bounded]`.
    first: Vec<Vec<f64>>,
    /// Second derivatives of those rows, for each pair.
    second: Vec<Vec<f64>>,
}

impl<D: Dynamics> NodeModel<D> {
    /// Sets all patterns.
    pub(super) fn find_patterns(&mut self) {
        let (n, p) = (self.n_states(), self.n_parameters());
        let v = n + p;
        // Everything, at first.
        self.pairs = (0..v).flat_map(|i| (i..v).map(move |j| (i, j))).collect();
        self.curved = self.groups(&vec![true; self.pairs.len()]);
        let mut random = ChaCha8Rng::seed_from_u64(0x70696c6f74);
        let mut draw = |count: usize| -> Vec<f64> {
            let uniform = |v: u32| f64::from(v) / f64::from(u32::MAX) * 2.0 - 1.0;
            (0..count).map(|_| uniform(random.next_u32())).collect()
        };
        let inputs = self.dynamics.n_inputs();
        let mut probes: Vec<Probe> = Vec::new();
        for _ in 0..PROBES {
            let (x, input, theta) = (draw(n), draw(inputs), draw(p));
            probes.push(self.probe(&x, &input, &theta));
        }
        let origin = self.probe(&vec![0.0; n], &draw(inputs), &vec![0.0; p]);
        let used = |row: usize, column: usize| probes.iter().any(|o| o.first[row][column] != 0.0);
        let all = (0..v).flat_map(|j| (0..n).map(move |i| (i, j)));
        self.entries = all.filter(|&(i, j)| used(i, j)).collect();
        self.state_entries = self.entries.iter().filter(|(_, j)| *j < n).count();
        let start = |j: usize| self.entries.partition_point(|e| e.1 < j);
        self.column_starts = (0..=v).map(start).collect();
        self.outputs = [n, n + 1].map(|row| (0..v).filter(|&j| used(row, j)).collect());
        self.keep_pairs(&probes);
        self.find_affine(&origin, &probes);
    }

    fn probe(&self, x: &[f64], input: &[f64], theta: &[f64]) -> Probe {
        let (n, v) = (x.len(), x.len() + theta.len());
        let mut values = self.values(theta);
        let mut scaled = [[0.0; LANES]; MAX_SIZE];
        side_by_side([x; LANES], &mut scaled[..n]);
        values.set(&scaled, [input; LANES]);
        let mut first = vec![vec![0.0; v]; n + 2];
        let all: Vec<usize> = (0..v).collect();
        for columns in all.chunks(PARTS) {
            let rows: Vec<Linear> = self.rows(&values, theta, columns);
            for (row, value) in first.iter_mut().zip(rows) {
                let parts = columns.iter().zip(value.first);
                parts.for_each(|(&j, by)| row[j] = by[0]);
            }
        }
        let mut tensors = vec![vec![0.0; n + 2]; self.pairs.len()];
        for group in &self.curved {
            let rows: Vec<Quadratic> = self.rows(&values, theta, &group.variables);
            for own in &group.pairs {
                let values = rows.iter().map(|row| row.second[own.place][0]);
                tensors[own.pair] = values.collect();
            }
        }
        Probe {
            variables: [x, theta].concat(),
            first,
            second: tensors,
        }
    }

    /// `[f̄; measured; bounded]` with derivatives by some variables.
    fn rows<const N: usize, const M: usize>(
        &self,
        values: &Values<'_, D>,
        theta: &[f64],
        variables: &[usize],
    ) -> Vec<Jet<N, M>> {
        let mut at = Evaluated::of(self.jets(theta, variables));
        at.evaluate(values, true);
        let scaled = at.at.dx.iter().zip(&self.inverse);
        let rows = scaled.map(|(dx, inverse)| *dx * *inverse);
        rows.chain(at.outputs).collect()
    }

    /// Keeps the pairs whose second derivatives are not zero at every probe, and sets those apart that
    /// are the same at all of them.
    fn keep_pairs(&mut self, probes: &[Probe]) {
        let (mut pairs, mut varying, mut rows) = (Vec::new(), Vec::new(), Vec::new());
        for (k, pair) in self.pairs.iter().enumerate() {
            let first = &probes[0].second[k];
            let used = |row: &usize| probes.iter().any(|probe| probe.second[k][*row] != 0.0);
            let own: Vec<usize> = (0..first.len()).filter(used).collect();
            if own.is_empty() {
                continue;
            }
            let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-13 * a.abs().max(b.abs());
            let same = |probe: &Probe| probe.second[k].iter().zip(first).all(near);
            let constant = probes.iter().all(same);
            if constant {
                let rows = own.iter().map(|&row| (row, first[row])).collect();
                self.constant.push((pairs.len(), rows));
            }
            varying.push(!constant);
            pairs.push(*pair);
            rows.push(own);
        }
        self.pairs = pairs;
        self.curved = self.groups(&varying);
        for own in self.curved.iter_mut().flat_map(|group| &mut group.pairs) {
            own.rows.clone_from(&rows[own.pair]);
        }
    }

    /// Groups of variables that contain the wanted pairs: with a pair that no group has so far goes the
    /// variable that brings most others.
    fn groups(&self, wanted: &[bool]) -> Vec<Curved> {
        let mut open: Vec<usize> = (0..wanted.len()).filter(|k| wanted[*k]).collect();
        let mut groups = Vec::new();
        while let Some(&pair) = open.first() {
            let (i, j) = self.pairs[pair];
            let mut variables = vec![i, j];
            variables.dedup();
            while variables.len() < CURVED {
                let gain = |v: &usize| {
                    let with = [&variables[..], &[*v]].concat();
                    let brings = |pair: &(usize, usize)| {
                        (pair.0 == *v || pair.1 == *v)
                            && with.contains(&pair.0)
                            && with.contains(&pair.1)
                    };
                    open.iter().filter(|k| brings(&self.pairs[**k])).count()
                };
                let others = (0..self.n_states() + self.n_parameters()).rev();
                let new = others.filter(|v| !variables.contains(v));
                // Of several the first.
                match new.max_by_key(gain).filter(|v| gain(v) > 0) {
                    Some(variable) => variables.push(variable),
                    None => break,
                }
            }
            variables.sort_unstable();
            let place = |j: usize| variables.iter().position(|own| *own == j);
            let mut pairs = Vec::new();
            open.retain(|&pair| {
                let (i, j) = self.pairs[pair];
                let places = place(i).zip(place(j));
                let place = places.and_then(|at| Quadratic::PAIRS.iter().position(|p| *p == at));
                let rows = Vec::new();
                pairs.extend(place.map(|place| CurvedPair { place, pair, rows }));
                place.is_none()
            });
            groups.push(Curved { variables, pairs });
        }
        groups
    }

    /// Sets the columns apart that are affine: their values at the origin and the constant second
    /// derivatives give them at every probe, whatever its input.
    fn find_affine(&mut self, origin: &Probe, probes: &[Probe]) {
        let (n, v) = (self.n_states(), origin.variables.len());
        // Row, column, variable, factor.
        let mut terms: Vec<(usize, usize, usize, f64)> = Vec::new();
        for (pair, rows) in &self.constant {
            let (a, b) = self.pairs[*pair];
            for &(row, value) in rows {
                terms.push((row, a, b, value));
                if a != b {
                    terms.push((row, b, a, value));
                }
            }
        }
        let predicted = |probe: &Probe, row: usize, column: usize| {
            let own = terms.iter().filter(|t| (t.0, t.1) == (row, column));
            own.fold(origin.first[row][column], |sum, t| {
                sum + t.3 * probe.variables[t.2]
            })
        };
        let groups = self.curved.iter();
        let curved: Vec<usize> = groups.flat_map(|own| own.variables.clone()).collect();
        let is_affine = |column: &usize| {
            let near = |probe: &Probe, row: usize| {
                let (exact, found) = (probe.first[row][*column], predicted(probe, row, *column));
                (exact - found).abs() <= 1e-12 * (exact.abs() + origin.first[row][*column].abs())
            };
            !curved.contains(column) && probes.iter().all(|p| (0..n + 2).all(|i| near(p, i)))
        };
        let (affine, others): (Vec<usize>, Vec<usize>) = (0..v).partition(is_affine);
        // Places of the Jacobian, then of each gradient.
        let places: [Vec<(usize, usize)>; 3] = [
            self.entries.clone(),
            self.outputs[0].iter().map(|j| (n, *j)).collect(),
            self.outputs[1].iter().map(|j| (n + 1, *j)).collect(),
        ];
        let values = places.map(|places| {
            let constants = places.iter().map(|&(i, j)| origin.first[i][j]).collect();
            let mut out = AffineValues {
                constants,
                ..AffineValues::default()
            };
            for &(row, column, variable, factor) in &terms {
                let place = places.iter().position(|at| *at == (row, column));
                let Some(place) = place.filter(|_| affine.contains(&column)) else {
                    continue;
                };
                match variable.checked_sub(n) {
                    None => out.states.push((place, variable, factor)),
                    Some(j) => out.parameters.push((place, j, factor)),
                }
            }
            out
        });
        let moves = |entry: usize| values[0].states.iter().any(|term| term.0 == entry);
        let columns = self.entries.iter().map(|(_, j)| affine.contains(j));
        self.shared = (columns.enumerate())
            .map(|(entry, affine)| affine && !moves(entry))
            .collect();
        self.affine = Affine { values, others };
    }
}
