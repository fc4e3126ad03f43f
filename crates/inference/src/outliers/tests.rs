//! Outliers, jumps and stretches that stand still in made-up recordings.

use super::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StudentT};

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

/// One change is too small for a break, so that the outlier before a larger one has one break alone.
#[test]
fn an_outlier_with_one_break_does_not_hide_those_after_it() {
    let mut run = white(1, 300);
    run.values[98..=102].copy_from_slice(&[0.0, 0.0, -13.0, 9.0, 0.0]);
    for (k, by) in [(120, 60.0), (160, -50.0), (250, 90.0)] {
        run.values[k] += by;
    }
    let found = Breaks::of(std::slice::from_ref(&run), Kind::Residuals);
    let samples: Vec<usize> = found.samples().map(|(_, k)| k).collect();
    assert_eq!(samples, [100, 120, 160, 250]);
    assert!(found.jumps.is_empty());
}

/// If the model jumps, the recording does not have to follow.
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

/// A sine of which `kept` samples from the 100th on repeat a value, in steps of `resolution`.
fn sine(kept: usize, resolution: f64) -> Vec<f64> {
    let at = |k: usize| {
        let k = if (100..100 + kept).contains(&k) {
            100
        } else {
            k
        };
        let value = 10.0 * (0.02 * k as f64).sin();
        (value / resolution).round() * resolution
    };
    (0..300).map(at).collect()
}

#[test]
fn a_recording_that_stands_still_and_catches_up_is_frozen() {
    let found = [Frozen {
        samples: 100..130,
        next: Some(130),
        is_end: false,
    }];
    assert_eq!(frozen(&sine(30, 1e-6)), found);
    assert_eq!(frozen(&sine(30, 0.05)), found);
    // Missing samples within.
    let mut values = sine(30, 1e-6);
    values[110] = f64::NAN;
    assert_eq!(frozen(&values), found);
    values[130] = f64::NAN;
    assert_eq!(frozen(&values)[0].next, Some(131));
    // Noise changes it at each sample.
    let noise = white(3, 300).values;
    let noisy = |k: usize| {
        let own = if (100..130).contains(&k) { 100 } else { k };
        sine(30, 1e-6)[own] + 0.05 * noise[own]
    };
    assert_eq!(frozen(&(0..300).map(noisy).collect::<Vec<_>>()), found);
}

#[test]
fn a_recording_that_stands_still_at_an_end_is_frozen() {
    let moving = sine(0, 1e-6);
    let dead = |samples: Range<usize>| {
        let kept = samples.start;
        let of = |k: usize| if samples.contains(&k) { kept } else { k };
        frozen(&(0..300).map(|k| moving[of(k)]).collect::<Vec<_>>())
    };
    let ends = |samples: Range<usize>, next: Option<usize>| {
        [Frozen {
            samples,
            next,
            is_end: true,
        }]
    };
    assert_eq!(dead(260..300), ends(260..300, None));
    assert_eq!(dead(0..40), ends(0..40, Some(40)));
    assert_eq!(frozen(&[2.0; 300]), ends(0..300, None));
    // It comes to rest, as no sensor does.
    let decays = |k: usize| (f64::exp(-0.1 * k as f64) * 1e4).round() / 1e4;
    assert_eq!(frozen(&(0..300).map(decays).collect::<Vec<_>>()), []);
}

/// A ball on the ground between its flights: the ground is no sensor that stood still.
#[test]
fn an_end_of_the_range_that_is_reached_again_is_a_stop() {
    let bounded = |k: usize| (10.0 * (0.05 * k as f64).sin()).max(-6.0);
    assert_eq!(frozen(&(0..600).map(bounded).collect::<Vec<_>>()), []);
}

/// A position at 2 Hz, recorded at 20 Hz, is no row of outliers.
#[test]
fn what_a_slow_sensor_repeats_is_not_fresh() {
    let seldom: Vec<f64> = (0..300).map(|k| sine(0, 1e-6)[k / 10 * 10]).collect();
    let expected: Vec<bool> = (0..300).map(|k| k % 10 == 0).collect();
    assert_eq!(fresh(&seldom), expected);
    // One stretch at rest, and a missing sample.
    let mut rests = sine(30, 1e-6);
    rests[7] = f64::NAN;
    assert_eq!(fresh(&rests), [true; 300]);
    assert_eq!(fresh(&[]), []);
}

#[test]
fn a_slow_sensor_is_told_from_coarse_steps_and_slow_motion() {
    let held = |rows: usize| -> Vec<f64> {
        let moving = sine(0, 1e-6);
        (0..300).map(|k| moving[k / rows * rows]).collect()
    };
    assert_eq!(rows_per_value(&held(10)), Some(10));
    assert_eq!(rows_per_value(&held(4)), Some(4));
    for others in [
        held(1),
        held(2),
        sine(0, 0.5),
        sine(0, 0.1),
        sine(30, 1e-6),
        vec![1.0; 300],
    ] {
        assert_eq!(rows_per_value(&others), None);
    }
    assert_eq!(rows_per_value(&[]), None);
    // With 10 samples of 0.1 s and a slope of 1/s: 0, 0.1 .. 0.9.
    let time: Vec<f64> = (0..300).map(|k| 0.1 * f64::from(k)).collect();
    let stairs: Vec<f64> = (0..300).map(|k| f64::from(k / 10)).collect();
    let error = error_of_repeats(&time, &stairs);
    assert!((error - 0.285_f64.sqrt()).abs() < 1e-9, "{error}");
    assert_eq!(error_of_repeats(&[], &[]), 0.0);
}

/// A sine of 200 samples, in steps of 0.001, that is cut at 0.8, and one that is not; a response that comes to rest at an
/// end of its range.
#[test]
fn cut_recordings_are_clipped_and_resting_ones_are_not() {
    let sine = |limit: f64| -> Vec<f64> {
        let at = |k: usize| (0.05 * k as f64).sin().clamp(-limit, limit);
        (0..200)
            .map(|k| (1000.0 * at(k)).round() / 1000.0)
            .collect()
    };
    let (part, end) = clipped(&sine(0.8), None).unwrap();
    // asin(0.8) = 0.927: of a half wave, 0.410 is beyond, and of 200 samples 3.2 half waves are there.
    assert!((0.35..0.45).contains(&part) && end == 0.8, "{part} {end}");
    assert_eq!(clipped(&sine(1.0), None), None);
    let resting: Vec<f64> = (0..400)
        .map(|k| (if k < 200 { k } else { 400 - k }) as f64)
        .map(|k| ((1.0 - (-0.05 * k).exp()) * 1000.0).round() / 1000.0)
        .collect();
    assert_eq!(clipped(&resting, None), None);
    assert_eq!(clipped(&[], None), None);
    // In steps of its resolution: only a model tells a stop of the vehicle from the end of what is measured.
    let ramps = |limit: f64| -> Vec<f64> {
        let at = |k: usize| f64::min(limit, (k % 120).min(120 - k % 120).min(40) as f64);
        (0..480).map(at).collect()
    };
    let (cut, whole) = (ramps(25.0), ramps(50.0));
    assert!(clipped(&cut, Some(&whole)).is_some());
    assert_eq!(clipped(&whole, Some(&whole)), None);
}

#[test]
fn what_rests_or_is_recorded_seldom_or_coarsely_is_not_frozen() {
    assert_eq!(frozen(&sine(0, 1e-6)), []);
    // Two samples more than usual; in steps of 1 it stays for long at its crests.
    assert_eq!(frozen(&sine(3, 1e-6)), []);
    assert_eq!(frozen(&sine(0, 1.0)), []);
    // Each tenth sample is new.
    let seldom: Vec<f64> = (0..300).map(|k| sine(0, 1e-6)[k / 10 * 10]).collect();
    assert_eq!(frozen(&seldom), []);
    // At rest, then moving: nothing is made up for.
    let rests: Vec<f64> = (0..300)
        .map(|k| sine(0, 1e-6)[usize::max(k, 150) - 150])
        .collect();
    assert_eq!(frozen(&rests), []);
    let pauses: Vec<f64> = (0..300)
        .map(|k| sine(0, 1e-6)[if k < 80 { k } else { usize::max(k, 150) - 70 }])
        .collect();
    assert_eq!(frozen(&pauses), []);
    assert_eq!(frozen(&[1.0; 5]), []);
    assert_eq!(frozen(&[]), []);
}

/// Changes within the resolution of a recording are not outliers.
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

/// Noise of a hand, Student's with three degrees of freedom, in which a lag of ten samples leaves its memory.
fn remnant(seed: u64, count: usize) -> Values {
    let mut run = white(seed, count);
    let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
    let steps = StudentT::new(3.0).unwrap().sample_iter(&mut random);
    let mut state = 0.0;
    for (value, step) in run.values.iter_mut().zip(steps) {
        state = 0.9 * state + step;
        *value = state;
    }
    run
}

#[test]
fn long_tails_and_a_memory_have_no_outliers_and_no_jumps() {
    let is_told = |seed: u64| {
        let runs: Vec<Values> = (0..5).map(|run| remnant(10 * seed + run, 600)).collect();
        Breaks::of(&runs, Kind::Residuals) != Breaks::default()
    };
    let told = (0..100).filter(|seed| is_told(*seed)).count();
    assert!(told <= 2, "{told} of 100");
}

#[test]
fn outliers_and_jumps_stand_out_of_long_tails() {
    for seed in 0..20 {
        let mut runs: Vec<Values> = (0..5).map(|run| remnant(10 * seed + run, 600)).collect();
        let largest = runs.iter().flat_map(|run| run.values.windows(2));
        let largest = largest
            .map(|pair| (pair[1] - pair[0]).abs())
            .fold(0.0, f64::max);
        let size = 6.0 * largest;
        runs[1].values[200] += size;
        runs[2].values[300] -= size;
        runs[3].values[250..]
            .iter_mut()
            .for_each(|own| *own += size);
        let found = Breaks::of(&runs, Kind::Residuals);
        assert_eq!(found.outliers, [(1, vec![200]), (2, vec![300])], "{seed}");
        let jump = found.jump().map(|(run, sample, _)| (run, sample));
        assert_eq!(jump, Some((3, 250)), "{seed}");
    }
}

/// A hand that rests and then moves within four samples has moved, and has not jumped.
#[test]
fn a_movement_over_some_samples_is_no_jump() {
    let mut run = white(7, 300);
    let moved = |k: usize| 40.0 * ((k.clamp(100, 104) - 100) as f64) / 4.0;
    let back = |k: usize| 40.0 * ((k.clamp(140, 144) - 140) as f64) / 4.0;
    for k in 0..300 {
        run.values[k] = 0.1 * run.values[k] + moved(k) - back(k);
    }
    let found = Breaks::of(std::slice::from_ref(&run), Kind::Residuals);
    assert_eq!(found, Breaks::default());
}
