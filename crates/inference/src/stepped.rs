//! Signals of steps: targets that jump, switched inputs.

/// Most samples at which a signal of steps changes, as one in this number.
const STEPS: usize = 10;

/// Whether a signal keeps its values and jumps, as a target of steps does: it changes at few of its samples. Changes
/// between two samples at one time are jumps already, and do not count.
pub fn is_stepped(time: &[f64], values: &[f64]) -> bool {
    let known: Vec<(f64, f64)> = time
        .iter()
        .copied()
        .zip(values.iter().copied())
        .filter(|(_, value)| value.is_finite())
        .collect();
    let pairs = known.windows(2).filter(|pair| pair[1].0 > pair[0].0);
    let changes = pairs.clone().filter(|pair| pair[1].1 != pair[0].1).count();
    changes > 0 && STEPS * changes <= pairs.count()
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
        // Two samples at the time of the jump.
        let mut twice = time.clone();
        twice[50] = twice[49];
        let values: Vec<f64> = (0..100).map(|k| f64::from(k >= 50)).collect();
        assert!(!is_stepped(&twice, &values) && is_stepped(&time, &values));
    }
}
