//! Doubts about the times of a recording.

use crate::outliers::median;

/// Multiple of the usual step from which on a time without rows is a gap.
const GAP: f64 = 10.0;
/// Duration of a run below which it is too short for a person's task \[s\], and longest plausible time between samples \[s\].
pub const SHORT: f64 = 1.0;
const SPARSE: f64 = 2.0;

/// Median step of these times; `None` for fewer than two.
pub fn median_step(time: &[f64]) -> Option<f64> {
    median(steps(time))
}

/// Steps between successive times.
pub fn steps(time: &[f64]) -> impl Iterator<Item = f64> {
    time.windows(2).map(|pair| pair[1] - pair[0])
}

/// The ends of the longest time without rows, if it is a gap.
pub fn gap(time: &[f64]) -> Option<[f64; 2]> {
    let usual = median_step(time)?;
    let longest = time
        .windows(2)
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
    (longest[1] - longest[0] > GAP * usual).then_some([longest[0], longest[1]])
}

/// Duration and median step of the longest of the runs of a person, if they are too short or too far apart to be seconds.
pub fn time_scale<'t>(runs: impl Iterator<Item = &'t [f64]>) -> Option<[f64; 2]> {
    let duration = |time: &[f64]| time[time.len() - 1] - time[0];
    let runs = runs.filter(|time| time.len() > 1);
    let longest = runs.max_by(|a, b| duration(a).total_cmp(&duration(b)))?;
    let (duration, step) = (duration(longest), median_step(longest)?);
    (duration < SHORT || step > SPARSE).then_some([duration, step])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_ten_times_the_usual_step() {
        let even: Vec<f64> = (0..20).map(|k| 0.1 * f64::from(k)).collect();
        assert_eq!(gap(&even), None);
        let [near, far] = [2.8, 3.1].map(|next| gap(&[&even[..], &[next]].concat()));
        assert_eq!((near, far), (None, Some([even[19], 3.1])));
        assert_eq!(gap(&[1.0]), None);
    }

    #[test]
    fn the_longest_run_decides_about_the_unit_of_time() {
        let run = |step: f64| -> Vec<f64> { (0..50).map(|k| step * f64::from(k)).collect() };
        // Powers of two, whose multiples are exact.
        let [fast, usual, slow] = [1.0 / 1024.0, 1.0 / 16.0, 4.0].map(run);
        let scale = |runs: &[&[f64]]| time_scale(runs.iter().copied());
        assert_eq!(scale(&[&fast, &usual]), None);
        assert_eq!(scale(&[&fast]).map(|found| found[1]), Some(1.0 / 1024.0));
        assert_eq!(scale(&[&usual, &slow]).map(|found| found[1]), Some(4.0));
    }
}
