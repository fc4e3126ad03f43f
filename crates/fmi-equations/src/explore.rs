//! Compares an FMU's derivatives and dependencies with differences, at its start and near it, before they are used.

use crate::rates::Rates;

/// Number of points where they are compared, including the start.
const POINTS: usize = 3;
/// Maximum number of states and inputs to check; above it everything is assumed to depend on everything.
const MOST: usize = 150;
/// Maximum number of parameters whose step is selected; above it their differences use the usual step.
const MOST_PARAMETERS: usize = 40;
/// Steps of fourth-order differences, relative to the size, the usual one first. At the usual step, truncation and
/// rounding errors in double precision are about equal.
pub(crate) const STEPS: [f64; 4] = [2e-3, 2e-2, 2e-4, 2e-5];
/// Relative difference below which derivatives count as equal.
const SAME: f64 = 1e-4;
/// Relative change below which derivatives count as constant: of the FMU's own derivatives, and of differences.
const STRAIGHT: [f64; 2] = [1e-11, 1e-5];

/// Selects steps, checks the FMU's derivatives and determines dependencies. Returns the findings.
pub(crate) fn explore(rates: &mut Rates) -> Vec<String> {
    let known = rates.layout.parameter_arguments().start;
    let mut notes = Vec::new();
    if known > MOST {
        return notes;
    }
    let points: Vec<Vec<f64>> = (0..POINTS).map(|k| around(rates, k)).collect();
    find_steps(rates);
    for point in &points {
        for place in 1..known {
            check_column(rates, point, place, &mut notes);
        }
    }
    let mut curved = rates.curved.clone();
    for row in curved.iter_mut().take(known) {
        row[..known].fill(false);
    }
    for point in &points {
        find_curved(rates, point, &mut curved);
    }
    rates.curved = curved;
    notes
}

/// The start, or a point near it: states and inputs moved by fractions of their sizes.
fn around(rates: &Rates, k: usize) -> Vec<f64> {
    /// Its multiples modulo 1 fill the unit interval evenly.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let known = rates.layout.parameter_arguments().start;
    let mut point = rates.start.clone();
    if k == 0 {
        return point;
    }
    for (place, value) in point.iter_mut().enumerate().take(known).skip(1) {
        let part = ((place + 7 * k) as f64 * GOLDEN).fract() - 0.5;
        *value = rates.within(*value + part * rates.size(place), *value, place);
    }
    point
}

/// Selects for each argument the step whose differences change least when it is halved.
fn find_steps(rates: &mut Rates) {
    let parameters = rates.layout.parameter_arguments();
    let first = if rates.by_fmu { parameters.start } else { 1 };
    let last = match parameters.len() <= MOST_PARAMETERS {
        true => parameters.end,
        false => parameters.start,
    };
    let start = rates.start.clone();
    for place in first..last {
        let change = |step: f64| -> Option<f64> {
            let whole = rates.differences(&start, place, step).ok()?;
            let half = rates.differences(&start, place, 0.5 * step).ok()?;
            let size = whole
                .iter()
                .fold(f64::MIN_POSITIVE, |size, own| size.max(own.abs()));
            let changes = whole
                .iter()
                .zip(&half)
                .map(|(whole, half)| (whole - half).abs());
            let change = changes.fold(0.0, f64::max) / size;
            change.is_finite().then_some(change)
        };
        let all = STEPS
            .iter()
            .filter_map(|step| Some((change(*step)?, *step)));
        // The usual step is kept as long as it is good.
        let best = all.min_by(|a, b| a.0.max(1e-11).total_cmp(&b.0.max(1e-11)));
        if let Some((_, step)) = best {
            rates.steps[place] = step;
        }
    }
}

/// Compares derivatives by a state or an input with differences; if they differ, differences are used from now on.
fn check_column(rates: &mut Rates, point: &[f64], place: usize, notes: &mut Vec<String>) {
    let step = rates.steps[place];
    let found = [step, 0.3 * step].map(|step| rates.differences(point, place, step));
    let [Ok(whole), Ok(finer)] = found else {
        return;
    };
    let slopes = rates.by_fmu.then(|| rates.slopes(point, place));
    let Some(known) = rates.layout.argument(place) else {
        return;
    };
    let known = known.name.clone();
    let name = |row: usize| {
        let (states, outputs) = (&rates.layout.states, &rates.layout.outputs);
        match row.checked_sub(states.len()) {
            None => format!("the derivative of `{}`", states[row].name),
            Some(output) => format!("`{}`", outputs[output].name),
        }
    };
    let size = whole.iter().fold(0.0, |size: f64, own| size.max(own.abs()));
    let is_same = |a: f64, b: f64| (a - b).abs() <= SAME * size.max(a.abs()).max(1e-6);
    let sides = [true, false].map(|up| rates.one_sided(point, place, step, up));
    let has_kink = |row: usize| match &sides {
        [Ok(above), Ok(below)] => {
            // At a bound of the range there is one side only.
            let are_two = above[row].is_finite() && below[row].is_finite();
            are_two && !is_same(above[row], below[row])
        }
        _ => false,
    };
    let mut is_wrong = false;
    let mut depends = Vec::new();
    for row in 0..whole.len() {
        if !is_same(whole[row], finer[row]) {
            // A kink, or noise.
            continue;
        }
        match &slopes {
            Some(Ok(slopes)) if is_same(slopes[row], whole[row]) => {}
            // At a kink, e.g. a knot of a table, the derivative is one-sided, and differences lie between both sides.
            Some(Ok(_)) if has_kink(row) => {}
            Some(Ok(slopes)) if !is_wrong => {
                is_wrong = true;
                notes.push(format!(
                    "it says that {} changes with `{known}` by {}, and it changes by {}: differences are used",
                    name(row),
                    slopes[row],
                    whole[row]
                ));
            }
            Some(Err(error)) if !is_wrong => {
                is_wrong = true;
                notes.push(format!(
                    "its directional derivatives fail ({error}): differences are used"
                ));
            }
            _ => {}
        }
        if !rates.layout.depends[row][place] && !is_same(whole[row], 0.0) {
            notes.push(format!(
                "its ModelStructure does not say that {} depends on `{known}`, and it does",
                name(row)
            ));
            depends.push(row);
        }
    }
    rates.by_fmu &= !is_wrong;
    depends
        .into_iter()
        .for_each(|row| rates.layout.depends[row][place] = true);
}

/// Marks pairs of states and inputs where the derivative by one changes with the other.
fn find_curved(rates: &Rates, point: &[f64], curved: &mut [Vec<bool>]) {
    let known = rates.layout.parameter_arguments().start;
    let straight = STRAIGHT[usize::from(!rates.by_fmu)];
    let columns = |at: &[f64]| -> Vec<Option<Vec<f64>>> {
        (1..known)
            .map(|place| rates.slopes(at, place).ok())
            .collect()
    };
    let here = columns(point);
    for second in 1..known {
        let mut moved = point.to_vec();
        let [up, down] = [0.3, -0.3].map(|part| {
            let to = point[second] + part * rates.size(second);
            rates.within(to, point[second], second)
        });
        moved[second] = if up > point[second] { up } else { down };
        let there = columns(&moved);
        for first in 1..=second {
            let is_same = match (&here[first - 1], &there[first - 1]) {
                (Some(here), Some(there)) => {
                    let size = here
                        .iter()
                        .chain(there)
                        .fold(0.0, |size: f64, own| size.max(own.abs()));
                    let mut pairs = here.iter().zip(there);
                    pairs.all(|(a, b)| (a - b).abs() <= straight * size.max(1e-300))
                }
                _ => false,
            };
            curved[first][second] |= !is_same;
        }
    }
}
