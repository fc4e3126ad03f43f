//! What delayed signals were, for delays that are exact.
//!
//! In each step of the integrator a signal is the polynomial of degree 5 with the values, first and second derivatives that it has at
//! both ends (Hermite's): its error is of order 6, one above that of the integrator's solution. Pieces do not need to fit together:
//! where a signal jumps, or its derivatives do, it is smooth on both sides.

use std::collections::VecDeque;
use std::sync::Arc;

/// A signal and its first two derivatives by time.
pub type Jet = [f64; 3];

/// The signals from one time to another.
#[derive(Debug, Clone, PartialEq)]
struct Piece {
    from: f64,
    to: f64,
    /// For each signal, at both ends.
    ends: Vec<[Jet; 2]>,
}

/// The delayed signals of a simulation, as far back as they are needed. Before the first piece they were 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct History {
    /// Shared with saved states: a master with a tolerance saves one in each step.
    pieces: VecDeque<Arc<Piece>>,
    /// Times at which a signal or one of its derivatives jumps \[s\].
    breaks: VecDeque<f64>,
    /// Whether older pieces were dropped.
    is_cut: bool,
}

/// Distance at which times are the same, relative to the present.
const SAME: f64 = 64.0 * f64::EPSILON;

/// What a jump changes at least within a piece, relative to the signal.
const JUMP: f64 = 1e-9;

impl Piece {
    fn jet(&self, signal: usize, time: f64) -> Jet {
        let h = self.to - self.from;
        let c = (time - self.from) / h;
        let [a, b] = self.ends[signal];
        // Taylor's polynomial at the begin, and what is missing at the end, in powers of c from the third on.
        let a = [a[0], a[1] * h, 0.5 * a[2] * h * h];
        let b = [b[0], b[1] * h, 0.5 * b[2] * h * h];
        let missing = [
            b[0] - a[0] - a[1] - a[2],
            b[1] - a[1] - 2.0 * a[2],
            b[2] - a[2],
        ];
        let high = [
            10.0 * missing[0] - 4.0 * missing[1] + missing[2],
            -15.0 * missing[0] + 7.0 * missing[1] - 2.0 * missing[2],
            6.0 * missing[0] - 3.0 * missing[1] + missing[2],
        ];
        let all = [a[0], a[1], a[2], high[0], high[1], high[2]];
        let mut jet = [0.0; 3];
        for own in all.iter().rev() {
            jet = [
                jet[0] * c + own,
                jet[1] * c + jet[0],
                jet[2] * c + 2.0 * jet[1],
            ];
        }
        [jet[0], jet[1] / h, jet[2] / (h * h)]
    }
}

/// Rounding of times that are differences from the present.
fn apart(now: f64) -> f64 {
    SAME * now.abs()
}

impl History {
    /// A signal `tau` before now, on the side where it was before if there are two.
    pub(super) fn before(&self, signal: usize, now: f64, tau: f64) -> Jet {
        let time = now - tau;
        let k = self
            .pieces
            .partition_point(|own| own.from < time - apart(now));
        let piece = k.checked_sub(1).and_then(|k| self.pieces.get(k));
        match (piece, self.pieces.front()) {
            (Some(piece), _) => piece.jet(signal, time.min(piece.to)),
            (None, Some(first)) if self.is_cut => [first.ends[signal][0][0], 0.0, 0.0],
            _ => [0.0; 3],
        }
    }

    /// The same on the side where it is after that time.
    pub(super) fn after(&self, signal: usize, now: f64, tau: f64) -> Jet {
        let time = now - tau;
        let k = self
            .pieces
            .partition_point(|own| own.from <= time + apart(now));
        match k.checked_sub(1).and_then(|k| self.pieces.get(k)) {
            Some(piece) => piece.jet(signal, time.clamp(piece.from, piece.to)),
            None => self.before(signal, now, tau),
        }
    }

    /// Adds the signals of a step.
    pub(super) fn push(&mut self, (from, to): (f64, f64), starts: &[Jet], ends: &[Jet]) {
        if to <= from {
            return;
        }
        let last = self.pieces.back();
        let h = last.map_or(0.0, |last| last.to - last.from).max(to - from);
        let jumps = |k: usize| {
            let before = last.map_or([0.0; 3], |last| last.ends[k][1]);
            let size = [before[0], starts[k][0], ends[k][0]];
            let size = size.iter().fold(0.0, |most: f64, own| most.max(own.abs()));
            let mut powers = [1.0, h, 0.5 * h * h]
                .into_iter()
                .zip(starts[k].iter().zip(before));
            powers.any(|(power, (own, before))| power * (own - before).abs() > JUMP * size)
        };
        if (0..starts.len()).any(jumps) {
            self.breaks.push_back(from);
        }
        let ends = starts.iter().zip(ends).map(|(a, b)| [*a, *b]);
        self.pieces.push_back(Arc::new(Piece {
            from,
            to,
            ends: ends.collect(),
        }));
    }

    /// The first time after `time` at which a signal that jumped does so again `tau` later.
    pub(super) fn next_break(&self, time: f64, tau: f64) -> Option<f64> {
        let mut later = self.breaks.iter().map(|own| own + tau);
        later.find(|own| *own > time + apart(time))
    }

    /// Drops what is more than `longest` before now.
    pub(super) fn cut(&mut self, now: f64, longest: f64) {
        let time = now - longest - apart(now);
        while self.pieces.len() > 1 && self.pieces[0].to < time {
            self.pieces.pop_front();
            self.is_cut = true;
        }
        while self.breaks.front().is_some_and(|own| *own < time) {
            self.breaks.pop_front();
        }
    }

    /// Its numbers: how many breaks, signals and pieces there are and whether others were dropped, then breaks and pieces.
    pub(crate) fn to_numbers(&self) -> Vec<f64> {
        let signals = self.pieces.front().map_or(0, |own| own.ends.len());
        let counts = [
            self.breaks.len(),
            signals,
            self.pieces.len(),
            usize::from(self.is_cut),
        ];
        let mut numbers: Vec<f64> = counts.iter().map(|own| *own as f64).collect();
        numbers.extend(&self.breaks);
        for own in &self.pieces {
            numbers.extend([own.from, own.to]);
            numbers.extend(own.ends.iter().flatten().flatten());
        }
        numbers
    }

    /// Reads numbers written by [`to_numbers`](Self::to_numbers); None if they are none such.
    pub(crate) fn of_numbers(numbers: &[f64]) -> Option<Self> {
        let (counts, rest) = numbers.split_at_checked(4)?;
        let is_count = |own: &f64| own.fract() == 0.0 && (0.0..=numbers.len() as f64).contains(own);
        if !counts.iter().all(is_count) {
            return None;
        }
        let [breaks, signals, pieces, is_cut] = [0, 1, 2, 3].map(|k| counts[k] as usize);
        let (breaks, rest) = rest.split_at_checked(breaks)?;
        let size = 2 + 6 * signals;
        if rest.len() != size * pieces || is_cut > 1 {
            return None;
        }
        // Damaged bytes may not say that time goes back.
        let is_forward = |own: &[f64]| own[0].is_finite() && own[1].is_finite() && own[0] < own[1];
        let follows = |own: &[f64]| own[0] < own[size];
        let starts = rest.len().saturating_sub(size);
        let are_ordered = rest.chunks_exact(size).all(is_forward)
            && (0..starts).step_by(size).all(|at| follows(&rest[at..]));
        if !are_ordered || !breaks.is_sorted() {
            return None;
        }
        let piece = |own: &[f64]| Piece {
            from: own[0],
            to: own[1],
            ends: (own[2..].chunks_exact(6))
                .map(|own| [[own[0], own[1], own[2]], [own[3], own[4], own[5]]])
                .collect(),
        };
        Some(Self {
            pieces: rest.chunks_exact(size).map(piece).map(Arc::new).collect(),
            breaks: breaks.iter().copied().collect(),
            is_cut: is_cut == 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polynomials of degree 5 come back exactly, with their derivatives, and jumps have two sides.
    #[test]
    fn pieces_are_polynomials_of_degree_five() {
        let jet = |t: f64| [t.powi(5) - t, 5.0 * t.powi(4) - 1.0, 20.0 * t.powi(3)];
        let mut own = History::default();
        own.push((0.5, 1.25), &[jet(0.5)], &[jet(1.25)]);
        own.push((1.25, 2.0), &[[7.0, 0.0, 0.0]], &[[7.0, 0.0, 0.0]]);
        for t in [0.6, 1.0, 1.2] {
            for (found, expected) in own.after(0, t, 0.0).iter().zip(jet(t)) {
                assert!((found - expected).abs() < 1e-12, "{t}: {found}, {expected}");
            }
        }
        assert_eq!(own.before(0, 2.0, 0.75)[0], jet(1.25)[0]);
        assert_eq!(own.after(0, 2.0, 0.75), [7.0, 0.0, 0.0]);
        assert_eq!(own.before(0, 2.0, 1.5), [0.0; 3]);
        assert_eq!(own.next_break(1.0, 0.1), Some(1.35));
        assert_eq!(History::of_numbers(&own.to_numbers()), Some(own.clone()));
        assert_eq!(History::of_numbers(&own.to_numbers()[1..]), None);
        // Of damaged bytes: what ends before it begins, and what has no time.
        for wrong in [-0.5, f64::NAN] {
            let mut numbers = own.to_numbers();
            let end = numbers
                .iter()
                .position(|own| *own == 2.0 && own.is_finite());
            assert!(end.is_some());
            let last = numbers.iter().rposition(|own| *own == 2.0).unwrap();
            numbers[last] = wrong;
            assert_eq!(History::of_numbers(&numbers), None);
        }
        own.cut(2.0, 0.5);
        assert_eq!(own.before(0, 2.0, 1.3), [7.0, 0.0, 0.0]);
    }
}
