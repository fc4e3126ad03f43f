//! Where the search for a landing begins: at a neighbour's, or along lines to the ground.

use super::helicopter::Trim;
use super::point::Landings;
use crate::program::{Duration, Program};

impl Landings {
    /// A neighbour's variables with this point's start: heights are moved along, and the duration by what falling through
    /// the difference takes.
    pub(super) fn moved(&self, program: &Program, near: &[f64], height: f64) -> Vec<f64> {
        const SINK: f64 = 8.0;
        let mut z = near.to_vec();
        let n = program.n();
        let h = self.places()[self.helicopter().places()[0]];
        let scale = self.posed.states[h].scale;
        let higher = height / scale - near[h];
        for k in 0..program.intervals() {
            z[program.node(k) + h] += (1.0 - program.mesh[k]) * higher;
            let middle = 0.5 * (program.mesh[k] + program.mesh[k + 1]);
            z[program.middle(k) + h] += (1.0 - middle) * higher;
        }
        if let Duration::Sought(d) = program.duration {
            let own = &mut z[program.theta() + d];
            let longer = higher * scale / SINK / program.model.scales.parameters[d];
            *own = (*own + longer).max(0.5 * *own);
        }
        for (own, value) in z.iter_mut().zip(&program.initial) {
            *own = value.unwrap_or(*own);
        }
        for (own, control) in z[n..].iter_mut().zip(&program.controls) {
            *own = control.first.unwrap_or(*own);
        }
        z
    }

    /// Where start `k` begins: states along lines to a landing, controls at their first values.
    pub(super) fn start(
        &self,
        program: &Program,
        (trim, x): (&Trim, &[f64]),
        k: usize,
    ) -> Vec<f64> {
        let [h, u, w, omega, _] = self.helicopter().places();
        let mut last = x.to_vec();
        let Aim { end, seconds } = Aim::of(k, x[h]);
        (last[h], last[w]) = (0.0, end[1]);
        last[u] = end[0];
        last[omega] = end[2] * x[omega];
        let mut theta = self.posed.theta();
        if let Duration::Sought(d) = self.posed.duration {
            let (low, high) = self.posed.parameters[d].limits;
            theta[d] = seconds.clamp(low, high);
        }
        let bound = theta.len() - 1;
        theta[bound] = self.settings().touched(last[u], last[w]);
        let states = |tau: f64| {
            let mut all: Vec<f64> = (program.initial.iter().zip(&self.posed.states))
                .map(|(own, state)| own.unwrap_or(0.0) * state.scale)
                .collect();
            for ((place, first), last) in self.places().iter().zip(x).zip(&last) {
                all[*place] = first + tau * (last - first);
            }
            all
        };
        let controls = vec![trim.cz, trim.alpha];
        self.posed
            .variables(program, &states, &|_| controls.clone(), &theta)
    }
}

/// Where a start aims: speed and sink rate at touch-down \[m/s\], rotor speed over that of trim, and the time until then \[s\].
struct Aim {
    end: [f64; 3],
    seconds: f64,
}

impl Aim {
    /// That of start `k` from a height \[m\]; no two are the same.
    fn of(k: usize, height: f64) -> Self {
        let known = [
            ([8.0, 2.0, 0.8], 1.0 + height / 8.0),
            ([3.0, 2.0, 0.7], 1.5 + height / 5.0),
            ([12.0, 3.0, 0.9], 0.7 + height / 12.0),
            ([0.0, 4.0, 0.6], 2.0 + height / 6.0),
        ];
        if let Some((end, seconds)) = known.get(k) {
            let (end, seconds) = (*end, *seconds);
            return Self { end, seconds };
        }
        // Fractions that fill their ranges evenly: the plastic sequence.
        let part = |step: f64| (0.5 + k as f64 * step).fract();
        let [fast, sink, long] = [0.819_172_513, 0.671_043_607, 0.549_700_478].map(part);
        Self {
            end: [14.0 * fast, 1.0 + 4.0 * sink, 0.6 + 0.3 * fast],
            seconds: 0.6 + 1.4 * long + height / (4.0 + 10.0 * sink),
        }
    }
}
