//! Conditions on time where noise drives the system: a filter takes equations as they are, and each step of it is one
//! linearisation. So samples without measurements are added just before and after the times at which conditions change, and no
//! step contains such a time.

use crate::posed::assembly::Made;
use pilotage_collocation::Run;

/// Distance of these samples from the time, relative to it and to the length of the run.
const APART: f64 = 1e-12;

impl Made {
    /// Adds these samples for times that do not depend on what is sought. `is_constant` tells inputs that are constant in each
    /// run between changes.
    pub fn add_stops(&mut self, is_constant: impl Fn(usize) -> bool) {
        let system = &mut self.system;
        let rows = [&system.derivatives[..], &system.outputs].concat();
        let (first, last) = (system.input(0), system.parameter(0));
        let is_steady =
            |variable| (first..last).contains(&variable) && is_constant(variable - first);
        let found = system.graph.switches(&rows, is_steady);
        if found.times.is_empty() {
            return;
        }
        for j in 0..self.runs.len() {
            let run = &self.runs[j];
            let is_new = |k: &usize| {
                let mut inputs = 0..run.inputs[*k].len();
                let differs = |i| run.inputs[*k][i] != run.inputs[k - 1][i];
                *k == 0 || inputs.any(|i| is_constant(i) && differs(i))
            };
            let begins: Vec<usize> = (0..run.time.len()).filter(is_new).collect();
            let end = run.time[run.time.len() - 1];
            let mut times = Vec::new();
            for (k, row) in begins.iter().enumerate() {
                let from = run.time[*row];
                let to = begins.get(k + 1).map_or(end, |next| run.time[*next]);
                let mut at = vec![0.0; self.system.variables()];
                at[first..last].copy_from_slice(&run.inputs[*row]);
                let values = self.system.graph.values(&at);
                let own = found.times.iter().map(|node| values[node.index()]);
                let length = end - run.time[0];
                for time in own {
                    let apart = APART * (length + time.abs());
                    let ends = [time - apart, time + apart];
                    times.extend(ends.into_iter().filter(|own| from < *own && *own < to));
                }
            }
            times.into_iter().for_each(|time| self.add_sample(j, time));
        }
    }

    /// Adds a sample without measurements to a run, unless it has one then.
    fn add_sample(&mut self, j: usize, time: f64) {
        let run = &mut self.runs[j];
        let row = run.time.partition_point(|own| *own < time);
        if run.time.get(row) == Some(&time) {
            return;
        }
        let mut inputs = vec![0.0; run.inputs[0].len()];
        run.inputs_at(time, &mut inputs);
        let Run {
            mesh,
            time: times,
            inputs: all,
            measured,
            ..
        } = run;
        mesh.insert(mesh.partition_point(|own| *own < time), time);
        times.insert(row, time);
        all.insert(row, inputs);
        let recorded = self.quantities.recorded.iter_mut().map(|own| &mut own[j]);
        let values = measured.iter_mut().map(|own| &mut own.values);
        values
            .chain(recorded)
            .for_each(|own| own.insert(row, f64::NAN));
    }
}
