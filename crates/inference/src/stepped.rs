//! Signals of steps: targets that jump, switched inputs.

/// Most samples at which a signal of steps changes, as one in this number.
const STEPS: usize = 4;
/// Where all steps are alike, they are at least this part of the signal's range: smaller ones may be those of a quantised
/// signal.
const SIZE: f64 = 0.25;
/// Steps are not alike if the usual one is larger than the least by this factor: those of a quantised signal that keeps its
/// values are one quantum.
const UNLIKE: f64 = 2.5;

/// Whether a signal keeps its values and jumps, as a target of steps does: it changes at few of its samples, never at two
/// after each other, and either by a large part of its range or by more than what could be rounding. Changes between two
/// samples at one time are jumps already, and do not count.
pub fn is_stepped(time: &[f64], values: &[f64]) -> bool {
    let known: Vec<(f64, f64)> = time
        .iter()
        .copied()
        .zip(values.iter().copied())
        .filter(|(_, value)| value.is_finite())
        .collect();
    let pairs = known.windows(2).filter(|pair| pair[1].0 > pair[0].0);
    let changes: Vec<f64> = pairs.map(|pair| (pair[1].1 - pair[0].1).abs()).collect();
    let mut steps: Vec<f64> = changes.iter().copied().filter(|own| *own > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let [least, most] = known
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], own| {
            [a.min(own.1), b.max(own.1)]
        });
    let is_alone = changes
        .windows(2)
        .all(|pair| pair[0] == 0.0 || pair[1] == 0.0);
    let usual = steps.get(steps.len() / 2);
    is_alone
        && STEPS * steps.len() <= changes.len()
        && usual.is_some_and(|own| *own >= SIZE * (most - least) || *own >= UNLIKE * steps[0])
}

/// Whether signals, each with its times, keep their values or [jump](is_stepped), and at least one jumps.
pub fn are_stepped<'a>(signals: impl Iterator<Item = (&'a [f64], &'a [f64])> + Clone) -> bool {
    let is_constant = |values: &[f64]| {
        let mut known = values.iter().filter(|value| value.is_finite());
        let first = known.next();
        known.all(|value| Some(value) == first)
    };
    let mut all = signals.clone();
    let mut any = signals;
    all.all(|(time, values)| is_constant(values) || is_stepped(time, values))
        && any.any(|(time, values)| is_stepped(time, values))
}

#[cfg(test)]
mod tests {
    use super::is_stepped;

    #[test]
    fn steps_and_what_is_none() {
        let time: Vec<f64> = (0..100).map(f64::from).collect();
        let stepped = |at: &dyn Fn(f64) -> f64| {
            let values: Vec<f64> = time.iter().map(|t| at(*t)).collect();
            is_stepped(&time, &values)
        };
        assert!(stepped(&|t| (t / 30.0).floor()));
        assert!(stepped(&|t| if t == 7.0 {
            f64::NAN
        } else {
            f64::from(t > 50.0)
        }));
        assert!(!stepped(&|_| 1.0));
        assert!(!stepped(&|t| (0.1 * t).sin()));
        assert!(!stepped(&|t| (t / 5.0).floor()));
        // A ramp between two levels, and a signal that is rounded.
        assert!(!stepped(&|t| ((t - 20.0) / 8.0).clamp(0.0, 1.0)));
        assert!(!stepped(&|t| (5.0 * (0.03 * t).sin()).round()));
        // Levels without order, kept for five samples, and one for each two; a course that is held.
        let level = |k: f64| (100.0 * (12.9 * k * k).sin()).round() / 100.0;
        assert!(stepped(&|t| level((t / 5.0).floor())));
        assert!(!stepped(&|t| level((t / 2.0).floor())));
        assert!(stepped(&|t| (0.35 * (t / 5.0).floor()).sin()));
        // Rounded with a jump between.
        let rounded = |t: f64| (3.0 * (0.02 * t).sin() + if t > 60.0 { 5.0 } else { 0.0 }).round();
        assert!(!stepped(&|t| rounded(t)));
        // Two samples at the time of the jump.
        let mut twice = time.clone();
        twice[50] = twice[49];
        let values: Vec<f64> = (0..100).map(|k| f64::from(k >= 50)).collect();
        assert!(!is_stepped(&twice, &values) && is_stepped(&time, &values));
    }
}
