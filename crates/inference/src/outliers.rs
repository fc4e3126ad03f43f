//! What stands out of a set of runs: samples that break away from their neighbours, and runs that are fitted far worse.

/// A break is so many times what values change by from sample to sample nearby.
const BREAK: f64 = 10.0;
/// Samples before and after a break that say what is usual.
const NEARBY: usize = 10;
/// Of residuals it is also more than this part of the spread of all ...
const LARGE: f64 = 0.3;
/// ... and so many times the resolution of the recording.
const STEPS: f64 = 4.0;
/// Part of the distances between recorded values that is smaller than the resolution, by chance or by hand.
const CHANCE: f64 = 0.02;
/// A model that breaks by this part of the residuals' break has made it.
const OWN: f64 = 0.2;
/// Outliers come back to within this part of the largest break.
const BACK: f64 = 0.2;
/// They do so within this part of the run.
const SOON: f64 = 0.25;
/// So many samples that break away at an end of a run are outliers too.
const FEW: usize = 2;
/// A run is fitted far worse when its rms residual is so many times the median of all runs.
const WORSE: f64 = 3.0;
/// Standard deviation of a normal distribution over its median magnitude.
const ROBUST: f64 = 1.4826;

/// What is looked at of a run: residuals, or recorded values. NaN where there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// Times of the samples \[s\].
    pub time: Vec<f64>,
    /// The values.
    pub values: Vec<f64>,
    /// The step in which the values were recorded, in their unit ([`resolution`]).
    pub resolution: f64,
    /// Of residuals, what the model says, in their unit: where it breaks too, it is the model that is wrong there, as the
    /// approximation of a delay is after a step. Empty where that is not looked at.
    pub modelled: Vec<f64>,
}

/// Whether values are what a model leaves over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Recorded minus modelled: what is large is so beside the spread of all.
    Residuals,
    /// As recorded: the vehicle's own motion is among the changes.
    Recorded,
}

/// What stands out of runs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Breaks {
    /// Run and samples that break away and come back.
    pub outliers: Vec<(usize, Vec<usize>)>,
    /// Run, first sample after a break that does not come back, and how far it is.
    pub jumps: Vec<(usize, usize, f64)>,
}

impl Breaks {
    /// Of these runs. A break is a change from one sample to the next that is far beyond the changes nearby, and beyond
    /// the spread of all residuals; of what was recorded, far beyond.
    pub fn of(runs: &[Values], kind: Kind) -> Self {
        let mut found = Self::default();
        let beyond = match kind {
            Kind::Residuals => LARGE,
            Kind::Recorded => BREAK,
        };
        let least = beyond * spread(runs);
        let usual = noise(runs) * 2.0_f64.sqrt();
        for (run, own) in runs.iter().enumerate() {
            found.of_run(own, run, least, usual);
        }
        found
    }

    /// Of one run: what is `least` counts, and `usual` is how all runs change from sample to sample.
    fn of_run(&mut self, own: &Values, run: usize, least: f64, usual: f64) {
        let finite = |k: &usize| own.values[*k].is_finite();
        let known: Vec<usize> = (0..own.values.len()).filter(finite).collect();
        let least = least.max(STEPS * own.resolution);
        let breaks = breaks(own, &known, least, usual);
        let soon = (SOON * known.len() as f64) as usize;
        let mut next = 0;
        while let Some(&(at, size)) = breaks.get(next) {
            let group = &breaks[next..];
            let group = &group[..group.partition_point(|(k, _)| *k <= at + soon)];
            match returns(group) {
                // From the first sample after the break to the last before the return.
                Some(last) => {
                    let samples = &known[at + 1..=group[last].0];
                    self.outliers.push((run, samples.to_vec()));
                    next += last + 1;
                }
                None if at < FEW => {
                    self.outliers.push((run, known[..=at].to_vec()));
                    next += 1;
                }
                None if at + 1 + FEW >= known.len() => {
                    self.outliers.push((run, known[at + 1..].to_vec()));
                    next += 1;
                }
                None => {
                    self.jumps.push((run, known[at + 1], size));
                    next += 1;
                }
            }
        }
    }

    /// All outliers, each by its run and sample.
    pub fn samples(&self) -> impl Iterator<Item = (usize, usize)> + Clone {
        let all = self.outliers.iter();
        all.flat_map(|(run, samples)| samples.iter().map(move |k| (*run, *k)))
    }

    /// The largest jump.
    pub fn jump(&self) -> Option<(usize, usize, f64)> {
        let jumps = self.jumps.iter().copied();
        jumps.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))
    }
}

/// Changes that stand out: the place, in `known`, before each, and its size.
fn breaks(own: &Values, known: &[usize], least: f64, usual: f64) -> Vec<(usize, f64)> {
    let step = median(own.time.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or(0.0);
    let changes_of = |values: &[f64]| -> Vec<f64> {
        let pairs = known.windows(2);
        pairs
            .map(|pair| values[pair[1]] - values[pair[0]])
            .collect()
    };
    let changes = changes_of(&own.values);
    let modelled = (!own.modelled.is_empty()).then(|| changes_of(&own.modelled));
    // Over missing samples it may change by more.
    let time = |i: usize| own.time[known[i]];
    let wait = |i: usize| ((time(i + 1) - time(i)) / step).max(1.0);
    let stands_out = |&i: &usize| {
        let (change, around) = beyond(&changes, i);
        let is_own = (modelled.as_ref()).is_some_and(|own| beyond(own, i).0 > OWN * change);
        change > wait(i) * least.max(BREAK * around.max(usual)) && !is_own
    };
    (0..changes.len())
        .filter(stands_out)
        .map(|i| (i, changes[i]))
        .collect()
}

/// By how much a change differs from the usual one nearby, and the usual spread of those.
fn beyond(changes: &[f64], i: usize) -> (f64, f64) {
    let others = (i.saturating_sub(NEARBY)..changes.len().min(i + NEARBY + 1)).filter(|j| *j != i);
    let middle = median(others.clone().map(|j| changes[j])).unwrap_or(0.0);
    let around = median(others.map(|j| (changes[j] - middle).abs())).unwrap_or(0.0);
    ((changes[i] - middle).abs(), ROBUST * around)
}

/// Which break of a group brings it back to where it was before the first.
fn returns(group: &[(usize, f64)]) -> Option<usize> {
    let (mut sum, mut largest) = (0.0, 0.0_f64);
    for (i, (_, size)) in group.iter().enumerate() {
        sum += size;
        largest = largest.max(size.abs());
        if i > 0 && f64::abs(sum) <= BACK * largest {
            return Some(i);
        }
    }
    None
}

/// The run that is fitted worst, and its rms residual over the median of all, where it is far worse than the others both
/// in its unit and as a part of its task (the size of what it was to do).
pub fn misfit(rms: &[f64], tasks: &[f64]) -> Option<(usize, f64)> {
    let parts: Vec<f64> = rms
        .iter()
        .zip(tasks)
        .map(|(rms, task)| rms / task)
        .collect();
    let worst = (0..rms.len()).max_by(|a, b| rms[*a].total_cmp(&rms[*b]))?;
    let others = |values: &[f64]| median(values.iter().copied()).unwrap_or(0.0);
    let is_worse = |values: &[f64]| values[worst] > WORSE * others(values);
    (rms.len() > 2 && is_worse(rms) && is_worse(&parts)).then(|| (worst, rms[worst] / others(rms)))
}

/// The step in which values were recorded: the least distance between two of them, but for a few.
pub fn resolution(values: &[f64]) -> f64 {
    let mut values: Vec<f64> = values.iter().copied().filter(|z| z.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let distances = values.windows(2).map(|pair| pair[1] - pair[0]);
    let mut distances: Vec<f64> = distances.filter(|distance| *distance > 0.0).collect();
    distances.sort_by(f64::total_cmp);
    let few = (CHANCE * distances.len() as f64) as usize;
    distances.get(few).copied().unwrap_or(0.0)
}

/// Standard deviation of white noise in the values, by what each differs by from the one before; 0 of nothing.
pub fn noise(runs: &[Values]) -> f64 {
    let pairs = runs.iter().flat_map(|run| run.values.windows(2));
    let changes = pairs.map(|pair| (pair[1] - pair[0]).abs());
    ROBUST * median(changes.filter(|change| change.is_finite())).unwrap_or(0.0) / 2.0_f64.sqrt()
}

/// Standard deviation of all values, whatever the outliers are.
fn spread(runs: &[Values]) -> f64 {
    let all = runs.iter().flat_map(|run| &run.values);
    ROBUST * median(all.map(|r| r.abs()).filter(|r| r.is_finite())).unwrap_or(0.0)
}

/// The middle one, of an even number the upper one in the middle; none of none.
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// White normal noise of unit standard deviation.
    fn white(seed: u64, count: usize) -> Values {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        Values {
            time: (0..count).map(|k| 0.1 * k as f64).collect(),
            values: StandardNormal
                .sample_iter(&mut random)
                .take(count)
                .collect(),
            resolution: 0.0,
            modelled: Vec::new(),
        }
    }

    #[test]
    fn white_noise_has_no_breaks() {
        let runs: Vec<Values> = (0..200).map(|seed| white(seed, 300)).collect();
        assert_eq!(Breaks::of(&runs, Kind::Residuals), Breaks::default());
    }

    #[test]
    fn samples_that_come_back_are_outliers_and_others_a_jump() {
        let mut runs = [white(1, 300), white(2, 300), white(3, 300)];
        runs[0].values[100] += 30.0;
        runs[0].values[101] -= 40.0;
        runs[1].values[299] += 30.0;
        runs[2].values[200..].iter_mut().for_each(|z| *z += 30.0);
        let found = Breaks::of(&runs, Kind::Residuals);
        assert_eq!(found.outliers, [(0, vec![100, 101]), (1, vec![299])]);
        let (run, sample, size) = found.jump().unwrap();
        assert_eq!((run, sample), (2, 200));
        assert!((size - 30.0).abs() < 5.0, "{size}");
    }

    /// Where the model jumps, what is recorded does not have to follow.
    #[test]
    fn a_break_of_the_model_is_not_one_of_the_recording() {
        let mut run = white(5, 300);
        run.modelled = (0..300).map(|k| 0.1 * f64::from(k)).collect();
        for k in 100..300 {
            run.values[k] -= 30.0;
        }
        let found = |run: &Values| Breaks::of(std::slice::from_ref(run), Kind::Residuals);
        assert_eq!(found(&run).jump().map(|(_, sample, _)| sample), Some(100));
        run.modelled[100..].iter_mut().for_each(|h| *h += 30.0);
        assert_eq!(found(&run), Breaks::default());
    }

    /// What lies within the steps of a recording is none.
    #[test]
    fn a_coarse_recording_has_no_outliers() {
        let mut run = white(4, 300);
        run.values.iter_mut().for_each(|z| *z = 0.0);
        run.values[100] = 1.0;
        let found = |run: &Values| Breaks::of(std::slice::from_ref(run), Kind::Residuals);
        assert_eq!(found(&run).outliers, [(0, vec![100])]);
        run.resolution = resolution(&run.values);
        assert_eq!(found(&run), Breaks::default());
    }

    #[test]
    fn a_run_is_a_misfit_in_its_unit_and_by_its_task() {
        assert_eq!(misfit(&[1.0, 1.2, 7.2, 0.9], &[1.0; 4]), Some((2, 6.0)));
        assert_eq!(misfit(&[1.0, 1.2, 7.2, 0.9], &[1.0, 1.0, 6.0, 1.0]), None);
        assert_eq!(misfit(&[1.0, 7.2], &[1.0; 2]), None);
    }
}
