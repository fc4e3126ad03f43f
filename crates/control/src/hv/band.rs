//! What the covariance of a fitted pilot means for a map: chances of points, and ranges of the boundary.

use super::map::Column;
use super::point::Landings;
use pilotage_inference::sample::quantile;

/// S below which a column without unsafe points is far from having any.
const NEAR: f64 = 0.8;
/// Quantiles of the boundary's heights.
const QUANTILES: [f64; 2] = [0.025, 0.975];

/// Adds chances and ranges to a column. A drawn pilot's S is computed at the points around the boundary, outwards until it
/// crosses 1; elsewhere the drawn pilots are taken to land as the fitted one does. `near` are the fitted pilot's variables at
/// the points. None if it was stopped.
pub fn add(
    landings: &Landings,
    column: &mut Column,
    near: &[Vec<f64>],
    delay: f64,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<()> {
    if landings.drawn().is_empty() {
        return Some(());
    }
    let mut shares = vec![[0.0; 2]; column.cells.len()];
    let mut edges = vec![Vec::new(); column.crossings.len()];
    for other in landings.drawn() {
        if stop() {
            return None;
        }
        let mut known = vec![None; column.cells.len()];
        let mut s = |k: usize| {
            let own = &column.cells[k];
            *known[k].get_or_insert_with(|| match near[k].is_empty() {
                // The ground comes before the pilot reacts, or nothing is known.
                true => own.s,
                false => other.softest(own.height, column.speed, delay, &near[k]),
            })
        };
        for (own, found) in column.crossings.iter().zip(&mut edges) {
            found.extend(crossing(column, (own.height, own.opens), &mut s));
        }
        if column.crossings.is_empty() {
            let all = (0..column.cells.len()).filter(|k| column.cells[*k].s >= NEAR);
            let highest = all.max_by(|a, b| column.cells[*a].s.total_cmp(&column.cells[*b].s));
            if let Some(k) = highest.filter(|k| s(*k) > 1.0) {
                outwards(k, column.cells.len(), &mut s);
            }
        }
        for (share, s) in shares.iter_mut().zip(known) {
            if let Some(s) = s.filter(|s| s.is_finite()) {
                share[0] += f64::from(u8::from(s <= 1.0));
                share[1] += 1.0;
            }
        }
    }
    let all = landings.drawn().len() as f64;
    for (own, [safe, tried]) in column.cells.iter_mut().zip(shares) {
        // Those that were not tried land as the fitted one.
        let others = f64::from(u8::from(own.s <= 1.0)) * (all - tried);
        own.chance = if own.s.is_finite() {
            (safe + others) / all
        } else {
            f64::NAN
        };
    }
    for (own, mut heights) in column.crossings.iter_mut().zip(edges) {
        heights.sort_by(f64::total_cmp);
        let [low, high] = QUANTILES.map(|part| quantile(&heights, part));
        own.range = [low.min(own.height), high.max(own.height)];
    }
    Some(())
}

/// Computes S up and down from a point beyond the limits until both ends are within them.
fn outwards(from: usize, count: usize, s: &mut dyn FnMut(usize) -> f64) {
    (from + 1..count).find(|k| s(*k) <= 1.0);
    (0..from).rev().find(|k| s(*k) <= 1.0);
}

/// The height at which a drawn pilot's S crosses 1, near that of the fitted one: interpolated between points in the logarithm of
/// the height, and moved by what the same interpolation is off for the fitted pilot. None if it does not cross.
fn crossing(
    column: &Column,
    (height, opens): (f64, bool),
    s: &mut dyn FnMut(usize) -> f64,
) -> Option<f64> {
    let cells = &column.cells;
    let above = cells.iter().position(|own| own.height > height)?;
    let mut pair = [above.checked_sub(1)?, above];
    let between = |pair: [usize; 2], s: [f64; 2]| {
        let [low, high] = pair.map(|k| cells[k].height.ln());
        low + (1.0 - s[0]) / (s[1] - s[0]) * (high - low)
    };
    let fitted = between(pair, pair.map(|k| cells[k].s));
    loop {
        let found = pair.map(&mut *s);
        let is_over = found.map(|own| own > 1.0);
        match (is_over, found.iter().all(|own| own.is_finite())) {
            (_, false) => return None,
            ([true, true], _) if opens => pair = [pair[0].checked_sub(1)?, pair[0]],
            ([true, true], _) => pair = [pair[1], pair[1] + 1],
            ([false, false], _) if opens => pair = [pair[1], pair[1] + 1],
            ([false, false], _) => pair = [pair[0].checked_sub(1)?, pair[0]],
            _ => {
                let off = if fitted.is_finite() {
                    height.ln() - fitted
                } else {
                    0.0
                };
                return Some((between(pair, found) + off).exp());
            }
        }
        if pair[1] >= cells.len() {
            return None;
        }
    }
}
