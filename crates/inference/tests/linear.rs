//! Covariances of linear problems against formulas and refits written out in full.

use nalgebra::{DMatrix, DVector};
use pilotage_inference::{Data, Inference, Method, Obstacle, Run};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// A linear problem with unknowns of the runs' own.
struct Toy {
    /// For each run `∂h/∂[θ; own]` and the observations.
    runs: Vec<(DMatrix<f64>, DVector<f64>)>,
    p: usize,
    own: usize,
}

impl Toy {
    fn new(seed: u64, runs: usize, [rows, p, own]: [usize; 3]) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
        let run = |_| {
            let jacobian = DMatrix::from_fn(rows, p + own, |t, i| {
                (0.1 * (t * (i + 1)) as f64 + i as f64).sin() + 0.3 * gauss()
            });
            (jacobian, DVector::from_fn(rows, |_, _| gauss()))
        };
        let runs = (0..runs).map(run).collect();
        Self { runs, p, own }
    }

    /// Derivatives and observations of all runs over `[θ; own of run 1; own of run 2; ...]`.
    fn stacked(&self) -> (DMatrix<f64>, DVector<f64>) {
        let rows: usize = self.runs.iter().map(|(j, _)| j.nrows()).sum();
        let columns = self.p + self.own * self.runs.len();
        let (mut all, mut y) = (DMatrix::zeros(rows, columns), DVector::zeros(rows));
        let mut first = 0;
        for (g, (j, own)) in self.runs.iter().enumerate() {
            let n = j.nrows();
            all.view_mut((first, 0), (n, self.p))
                .copy_from(&j.columns(0, self.p));
            let place = (first, self.p + g * self.own);
            all.view_mut(place, (n, self.own))
                .copy_from(&j.columns(self.p, self.own));
            y.rows_mut(first, n).copy_from(own);
            first += n;
        }
        (all, y)
    }

    fn solution(&self) -> DVector<f64> {
        let (j, y) = self.stacked();
        j.svd(true, true).solve(&y, 1e-12).unwrap()
    }

    fn without(&self, run: usize) -> Self {
        let mut runs = self.runs.clone();
        runs.remove(run);
        Self { runs, ..*self }
    }

    /// The problem at its solution.
    fn data(&self) -> Data {
        let found = self.solution();
        let run = |(g, (j, y)): (usize, &(DMatrix<f64>, DVector<f64>))| {
            let own = found.rows(self.p + g * self.own, self.own);
            let shared = j.columns(0, self.p).into_owned();
            let e = y - &shared * found.rows(0, self.p) - j.columns(self.p, self.own) * own;
            Run {
                own: j.columns(self.p, self.own).into_owned(),
                own_scales: DVector::from_element(self.own, 1.0),
                active: DMatrix::zeros(0, self.p + self.own),
                ..Run::of(shared, e)
            }
        };
        Data::of(self.runs.iter().enumerate().map(run).collect())
    }
}

fn assert_close(a: &DMatrix<f64>, b: &DMatrix<f64>, tolerance: f64) {
    let scale = b.amax();
    assert!((a - b).amax() <= tolerance * scale, "{a} is not {b}");
}

#[test]
fn the_plain_covariance_is_that_of_all_unknowns_together() {
    let toy = Toy::new(1, 3, [20, 2, 2]);
    let data = toy.data();
    let inference = Inference::new(&data).unwrap();
    let found = inference.covariance(Some(Method::Plain)).unwrap();
    let (j, y) = toy.stacked();
    let e = y - &j * toy.solution();
    let all = (j.tr_mul(&j)).try_inverse().unwrap() * (e.norm_squared() / (60.0 - 8.0));
    assert_close(&found.matrix, &all.view((0, 0), (2, 2)).into_owned(), 1e-10);
    for run in 0..3 {
        let places: Vec<usize> = [0, 1, 2 + 2 * run, 3 + 2 * run].to_vec();
        let expected = all.select_rows(&places).select_columns(&places);
        let joint = inference.joint(&found, run);
        assert_close(&joint.matrix, &expected, 1e-10);
        // The level of the noise is that of all values: each unknown has their number minus that of all unknowns.
        assert_eq!(
            joint.degrees,
            vec![(j.nrows() - j.ncols()) as f64; joint.degrees.len()]
        );
    }
}

/// The part of the residuals that the columns of all derivatives span, in standard deviations.
#[test]
fn the_offset_is_that_of_the_residuals_from_the_tangent_space() {
    let toy = Toy::new(6, 3, [20, 2, 2]);
    let mut data = toy.data();
    assert!(Inference::new(&data).unwrap().offset() < 1e-12);
    // As if all unknowns were 0.
    for (run, (_, y)) in data.runs.iter_mut().zip(&toy.runs) {
        run.residuals.copy_from(y);
    }
    let (j, y) = toy.stacked();
    let spanned = &j * toy.solution();
    let noise = y.norm_squared() / (60.0 - 8.0);
    let expected = (spanned.norm_squared() / 8.0 / noise).sqrt();
    let found = Inference::new(&data).unwrap().offset();
    assert!(
        (found - expected).abs() < 1e-10 * expected,
        "{found} {expected}"
    );
    // A prior is one more value of a parameter; it does not count where the level of the noise is estimated.
    data.prior = DMatrix::from_row_slice(1, 2, &[3.0, 0.0]);
    assert!(Inference::new(&data).unwrap().offset().is_nan());
    data.prior_residuals = vec![2.0];
    let mut rows = j.clone().insert_row(60, 0.0);
    rows[(60, 0)] = 3.0;
    let y = y.insert_row(60, 2.0);
    let step = rows.clone().svd(true, true).solve(&y, 1e-12).unwrap();
    let spanned = (rows * step).norm_squared();
    let expected = (spanned / 8.0 / noise).sqrt();
    let found = Inference::new(&data).unwrap().offset();
    assert!(
        (found - expected).abs() < 1e-10 * expected,
        "{found} {expected}"
    );
}

#[test]
fn cr3_is_the_jackknife_of_refits() {
    let toy = Toy::new(2, 7, [15, 3, 1]);
    let data = toy.data();
    let found = Inference::new(&data)
        .unwrap()
        .covariance(Some(Method::Cr3))
        .unwrap();
    let all = toy.solution();
    let mut sum = DMatrix::zeros(3, 3);
    for run in 0..7 {
        let moved = toy.without(run).solution().rows(0, 3) - all.rows(0, 3);
        sum += &moved * moved.transpose();
    }
    assert_close(&found.matrix, &(sum * (6.0 / 7.0)), 1e-9);
    assert_eq!(found.degrees, [6.0; 3]);
    assert_eq!(found.correlated_by, Method::Cr3);
}

#[test]
fn sidpac_sums_products_with_autocorrelations() {
    let toy = Toy::new(3, 2, [25, 2, 0]);
    let data = toy.data();
    let found = Inference::new(&data)
        .unwrap()
        .covariance(Some(Method::Sidpac))
        .unwrap();
    let r = |lag: usize| {
        let of = |run: &Run| {
            (lag..25)
                .map(|t| run.residuals[t] * run.residuals[t - lag])
                .sum::<f64>()
        };
        data.runs.iter().map(of).sum::<f64>() / 50.0
    };
    let (mut meat, mut h) = (DMatrix::zeros(2, 2), DMatrix::zeros(2, 2));
    for run in &data.runs {
        h += run.shared.tr_mul(&run.shared);
        for (i, j) in (0..25_usize).flat_map(|i| (0..25_usize).map(move |j| (i, j))) {
            if i.abs_diff(j) <= 5 {
                meat += run.shared.row(i).transpose() * run.shared.row(j) * r(i.abs_diff(j));
            }
        }
    }
    let inverse = h.try_inverse().unwrap();
    assert_close(&found.matrix, &(&inverse * meat * &inverse), 1e-10);
}

#[test]
fn without_enough_runs_correlations_have_full_rank() {
    let data = Toy::new(4, 4, [40, 6, 0]).data();
    let found = Inference::new(&data).unwrap().covariance(None).unwrap();
    assert_eq!(
        (found.method, found.correlated_by),
        (Method::Cr3, Method::Ar)
    );
    let least = found.correlations().symmetric_eigenvalues().min();
    assert!(least > 1e-6, "{least}");
    let jackknife = Inference::new(&data)
        .unwrap()
        .covariance(Some(Method::Cr3))
        .unwrap();
    assert_eq!(found.deviations(), jackknife.deviations());
}

#[test]
fn of_few_runs_the_noise_is_modelled() {
    let toy = Toy::new(5, 3, [40, 2, 0]);
    let data = toy.data();
    let inference = Inference::new(&data).unwrap();
    assert_eq!(inference.covariance(None).unwrap().method, Method::Ar);
    let one = Toy::new(5, 1, [40, 2, 0]).data();
    let one = Inference::new(&one).unwrap();
    assert_eq!(one.covariance(None).unwrap().method, Method::Ar);
    assert_eq!(
        one.covariance(Some(Method::Cr3)).unwrap_err(),
        Obstacle::FewRuns
    );
}

/// A parameter that one run alone tells, as one for each subject with a run, leaves no jackknife.
#[test]
fn what_one_run_alone_tells_is_modelled_too() {
    let mut data = Toy::new(6, 5, [30, 2, 0]).data();
    data.runs[1..]
        .iter_mut()
        .for_each(|run| run.shared.column_mut(1).fill(0.0));
    let found = Inference::new(&data).unwrap().covariance(None).unwrap();
    assert_eq!(found.method, Method::Ar);
    // Two of five runs: the jackknife exists, and is not believed.
    let mut data = Toy::new(6, 5, [30, 2, 0]).data();
    data.runs[2..]
        .iter_mut()
        .for_each(|run| run.shared.column_mut(1).fill(0.0));
    let found = Inference::new(&data).unwrap().covariance(None).unwrap();
    assert_eq!(found.methods, [Method::Cr3, Method::Ar]);
    assert_eq!(found.degrees[0], 4.0);
}

#[test]
fn active_constraints_take_their_direction_out() {
    let mut data = Toy::new(7, 5, [30, 3, 0]).data();
    // θ1 = const, so that the others are estimated as if it were known.
    data.active = DMatrix::from_row_slice(1, 3, &[2.0, 0.0, 0.0]);
    let mut known = data.clone();
    known.active = DMatrix::zeros(0, 2);
    known.prior = DMatrix::zeros(0, 2);
    known.scales = DVector::from_element(2, 1.0);
    for run in &mut known.runs {
        run.shared = run.shared.columns(1, 2).into_owned();
        run.active = DMatrix::zeros(0, 2);
    }
    for method in Method::ALL {
        let held = Inference::new(&data)
            .unwrap()
            .covariance(Some(method))
            .unwrap();
        let other = Inference::new(&known)
            .unwrap()
            .covariance(Some(method))
            .unwrap();
        assert_close(
            &held.matrix.view((1, 1), (2, 2)).into_owned(),
            &other.matrix,
            1e-8,
        );
        assert!(held.matrix.row(0).amax() < 1e-12 * other.matrix.amax());
    }
}

/// `3 μ + 2 θ1 = const` in each run: μ follows θ1, and nothing is left of it.
#[test]
fn a_constraint_of_a_run_is_balanced_by_its_own_unknowns() {
    let mut data = Toy::new(8, 5, [30, 2, 1]).data();
    let mut other = data.clone();
    for (run, without) in data.runs.iter_mut().zip(&mut other.runs) {
        run.active = DMatrix::from_row_slice(1, 3, &[2.0, 0.0, 3.0]);
        let by_own = run.own.column(0).into_owned();
        without.shared.column_mut(0).axpy(-2.0 / 3.0, &by_own, 1.0);
        without.own = DMatrix::zeros(30, 0);
        without.own_scales = DVector::zeros(0);
        without.active = DMatrix::zeros(0, 2);
    }
    let inference = Inference::new(&data).unwrap();
    let found = inference.covariance(Some(Method::Plain)).unwrap();
    // As many constraints as there are shared parameters, and nothing to balance them.
    let mut held = data.clone();
    held.runs.iter_mut().for_each(|run| run.own.fill(0.0));
    held.runs[0].active = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let held = Inference::new(&held).unwrap();
    assert_eq!(held.covariance(None).unwrap().matrix, DMatrix::zeros(2, 2));
    assert!(held.insensitivity().iter().all(|own| own.is_finite()));
    let expected = Inference::new(&other).unwrap();
    let expected = expected.covariance(Some(Method::Plain)).unwrap();
    assert_close(&found.matrix, &expected.matrix, 1e-9);
    let joint = inference.joint(&found, 0).matrix;
    assert!((joint[(2, 2)] - 4.0 / 9.0 * joint[(0, 0)]).abs() < 1e-9 * joint[(0, 0)]);
}

#[test]
fn directions_that_are_open_are_told_in_the_parameters() {
    let mut data = Toy::new(9, 2, [30, 4, 0]).data();
    for run in &mut data.runs {
        // h depends on θ2 - 2.1 θ1 alone, and on θ4 not at all.
        let second = run.shared.column(1) * -2.1;
        run.shared.set_column(0, &second);
        run.shared.column_mut(3).fill(0.0);
    }
    let inference = Inference::new(&data).unwrap();
    assert_eq!(inference.flat, [true, true, false, true]);
    let mut directions: Vec<Vec<f64>> = inference
        .directions
        .iter()
        .map(|own| own.0.clone())
        .collect();
    directions.sort_by(|a, b| b[0].abs().total_cmp(&a[0].abs()));
    let ratio = directions[0][1] / directions[0][0];
    assert!((ratio - 2.1).abs() < 1e-6, "{directions:?}");
    assert_eq!(directions[1], [0.0, 0.0, 0.0, 1.0]);
    assert!(inference.cramer_rao()[3].is_infinite() && inference.insensitivity()[3].is_infinite());
    let sure = inference.covariance(None).unwrap().deviations()[2];
    assert!(sure > 0.0 && sure.is_finite());
}

#[test]
fn cramer_rao_and_insensitivity_are_those_of_the_information() {
    let toy = Toy::new(10, 1, [30, 2, 0]);
    let data = toy.data();
    let inference = Inference::new(&data).unwrap();
    let (j, _) = toy.stacked();
    let h = j.tr_mul(&j) / (data.runs[0].residuals.norm_squared() / 28.0);
    let inverse = h.clone().try_inverse().unwrap();
    for i in 0..2 {
        assert!((inference.cramer_rao()[i] / (2.0 * inverse[(i, i)].sqrt()) - 1.0).abs() < 1e-10);
        assert!((inference.insensitivity()[i] * h[(i, i)].sqrt() - 1.0).abs() < 1e-10);
    }
}

#[test]
fn priors_count_as_rows_of_unit_variance() {
    let toy = Toy::new(11, 1, [10, 2, 0]);
    let mut data = toy.data();
    data.is_scaled = true;
    data.prior = DMatrix::from_row_slice(1, 2, &[0.0, 1.0 / 0.01]);
    let found = Inference::new(&data)
        .unwrap()
        .covariance(Some(Method::Plain))
        .unwrap();
    let (j, _) = toy.stacked();
    let h = j.tr_mul(&j) + data.prior.tr_mul(&data.prior);
    assert_close(&found.matrix, &h.try_inverse().unwrap(), 1e-9);
}

#[test]
fn what_no_residual_tells_is_refused() {
    let data = Toy::new(12, 1, [3, 3, 0]).data();
    let error = Inference::new(&data).unwrap_err();
    assert_eq!(
        error,
        Obstacle::TooFew {
            residuals: 3,
            unknowns: 3
        }
    );
    let mut data = Toy::new(12, 1, [9, 3, 0]).data();
    data.runs[0].shared[(4, 1)] = f64::NAN;
    assert_eq!(Inference::new(&data).unwrap_err(), Obstacle::NotFinite);
}

#[test]
fn without_noise_there_is_no_variance() {
    let mut data = Toy::new(13, 5, [20, 2, 1]).data();
    data.runs.iter_mut().for_each(|run| run.residuals.fill(0.0));
    for method in Method::ALL {
        let found = Inference::new(&data)
            .unwrap()
            .covariance(Some(method))
            .unwrap();
        assert!(found.matrix.amax() < 1e-100, "{method}");
    }
}

/// AR(1) noise: its covariance with the process known, and the process found in the residuals of many sets without the
/// bias that those have as they are.
#[test]
fn the_noise_of_residuals_is_found_without_their_bias() {
    let (phi, n) = (0.9, 100);
    let mut variances = 0.0;
    let sets = 60;
    let design = DMatrix::from_fn(n, 2, |t, i| ((i as f64 + 1.0) * 0.04 * t as f64).cos());
    for seed in 0..sets {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
        let mut e = gauss();
        let noise = DVector::from_fn(n, |_, _| {
            let now = e;
            e = phi * e + f64::sqrt(1.0 - phi * phi) * gauss();
            now
        });
        let toy = Toy {
            runs: vec![(design.clone(), noise)],
            p: 2,
            own: 0,
        };
        let data = toy.data();
        let found = Inference::new(&data)
            .unwrap()
            .covariance(Some(Method::Ar))
            .unwrap();
        variances += found.matrix[(0, 0)].ln() / sets as f64;
    }
    let sigma = DMatrix::from_fn(n, n, |i, j| f64::powi(phi, i.abs_diff(j) as i32));
    let inverse = design.tr_mul(&design).try_inverse().unwrap();
    let truth = &inverse * (design.transpose() * sigma * &design) * &inverse;
    let ratio = (variances - truth[(0, 0)].ln()).exp();
    assert!((0.75..1.35).contains(&ratio), "{ratio}");
}

/// A limit that holds long after the start holds the parameters, not an initial state that has faded by then: it would have
/// to change by a trillion to balance them.
#[test]
fn what_has_faded_balances_no_constraint() {
    let with = |faded: f64| {
        let mut data = Toy::new(4, 3, [40, 3, 1]).data();
        for run in &mut data.runs {
            run.own = DMatrix::from_fn(40, 1, |t, _| (-(t as f64)).exp());
        }
        data.runs[1].active = DMatrix::from_row_slice(1, 4, &[0.4, -0.3, 0.9, faded]);
        let inference = Inference::new(&data).unwrap();
        let found = inference.covariance(Some(Method::Plain)).unwrap();
        assert!(inference.directions.is_empty(), "{faded}");
        found.matrix
    };
    let (gone, held) = (with(1e-13), with(0.0));
    assert_close(&gone, &held, 1e-9);
    // What is held does not vary.
    let gradient = DVector::from_row_slice(&[0.4, -0.3, 0.9]);
    let along = (gradient.transpose() * &gone * &gradient)[0];
    assert!(along < 1e-12 * gone.amax(), "{along}");
}

/// Runs with unknowns of their own alone, and parameters that constraints hold altogether.
/// A noise level has rows of its own, and changes no location but by rounding, which may be of the residuals' shape.
#[test]
fn what_is_rounding_in_a_signal_takes_nothing_from_its_residuals() {
    let toy = Toy::new(9, 1, [60, 2, 0]).data();
    let (shared, e) = (&toy.runs[0].shared, &toy.runs[0].residuals);
    let levels = e.map(|e| (e * e - 1.0) / 2_f64.sqrt());
    let processes = |rounding: f64| {
        let j = DMatrix::from_fn(120, 3, |t, i| match (t < 60, i < 2) {
            (true, true) => shared[(t, i)],
            (true, false) => rounding * e[t],
            (false, level) => f64::from(u8::from(!level)) * 2_f64.sqrt(),
        });
        let both = e.iter().chain(&levels).copied();
        let mut run = Run::of(j, DVector::from_iterator(120, both));
        run.time = (0..120).map(|t| f64::from(t % 60)).collect();
        run.signals = vec![0..60, 60..120];
        Inference::new(&Data::of(vec![run])).unwrap().coloured()
    };
    let (exact, rounded) = (processes(0.0), processes(1e-14));
    for (exact, rounded) in exact.iter().zip(&rounded) {
        assert!((exact.variance - rounded.variance).abs() < 1e-9 * exact.variance);
        assert_eq!(exact.order(), rounded.order());
    }
}

#[test]
fn nothing_shared_is_a_problem_too() {
    let data = Toy::new(14, 2, [30, 0, 2]).data();
    let inference = Inference::new(&data).unwrap();
    let found = inference.covariance(None).unwrap();
    assert_eq!(found.matrix.shape(), (0, 0));
    let plain = inference.covariance(Some(Method::Plain)).unwrap();
    let own = &data.runs[1].own;
    let expected = own.tr_mul(own).try_inverse().unwrap() * inference.noise();
    assert_close(&inference.joint(&plain, 1).matrix, &expected, 1e-9);

    let mut data = Toy::new(15, 5, [30, 2, 0]).data();
    data.active = DMatrix::identity(2, 2);
    for method in Method::ALL {
        let found = Inference::new(&data)
            .unwrap()
            .covariance(Some(method))
            .unwrap();
        assert_eq!(found.matrix, DMatrix::zeros(2, 2), "{method}");
    }
}

#[test]
fn residuals_that_change_move_the_solution_of_a_linear_problem_at_once() {
    let toy = Toy::new(16, 3, [20, 2, 1]);
    let data = toy.data();
    let changes: Vec<DVector<f64>> = (0..3)
        .map(|g| DVector::from_fn(20, |t, _| ((g + t) as f64).cos()))
        .collect();
    let mut other = Toy::new(16, 3, [20, 2, 1]);
    let runs = other.runs.iter_mut().zip(&changes);
    runs.for_each(|((_, y), change)| *y += change);
    let expected = other.solution().rows(0, 2) - toy.solution().rows(0, 2);
    let moved = Inference::new(&data).unwrap().moved(&changes);
    assert!((moved - expected).amax() < 1e-10);
}

/// Those of the Jacobian with columns of length 1, by its own decomposition; a column that repeats another has none.
#[test]
fn singular_values_are_those_of_the_jacobian() {
    let toy = Toy::new(5, 1, [40, 3, 0]);
    let (jacobian, y) = &toy.runs[0];
    let repeated = DMatrix::from_fn(40, 4, |i, k| match k {
        3 => -2.0 * jacobian[(i, 1)],
        _ => jacobian[(i, k)],
    });
    let mut unit = repeated.clone();
    unit.column_iter_mut().for_each(|mut own| own /= own.norm());
    let data = Data::of(vec![Run::of(repeated, y.clone())]);
    let inference = Inference::new(&data).unwrap();
    let mut expected: Vec<f64> = unit
        .svd(false, false)
        .singular_values
        .iter()
        .copied()
        .collect();
    expected.sort_by(|a, b| b.total_cmp(a));
    assert_eq!(inference.singular_values.len(), 4);
    for (found, expected) in inference.singular_values.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-7, "{found} {expected}");
    }
    assert_eq!(inference.directions.len(), 1);
}

/// The shared offset and each run's own level balance each other; their sum is determined, and so is θ2.
#[test]
fn what_is_undetermined_is_what_changes_along_open_directions() {
    let toy = Toy::new(12, 2, [30, 2, 1]);
    let mut data = toy.data();
    for run in &mut data.runs {
        let own = run.own.column(0).into_owned();
        run.shared.set_column(0, &(3.0 * own));
    }
    let inference = Inference::new(&data).unwrap();
    assert_eq!(inference.flat, [true, false]);
    assert_eq!(inference.own_flat(1), [true]);
    let open = inference.open_with(1);
    let moves = |gradient: [f64; 3]| open.moves(&DVector::from_row_slice(&gradient), 1e-3);
    assert!(!moves([3.0, 0.0, 1.0]) && !moves([3.0, 5.0, 1.0]) && !moves([0.0, 1.0, 0.0]));
    assert!(moves([3.0, 0.0, 1.01]) && moves([1.0, 0.0, 0.0]) && moves([0.0, 1.0, 0.01]));
    // What is determined has the variance of the problem without the offset.
    let covariance = inference.covariance(Some(Method::Plain)).unwrap();
    let joint = inference.joint(&covariance, 1);
    let found = joint.along(&DVector::from_row_slice(&[3.0, 0.0, 1.0])).0;
    let mut without = data.clone();
    without
        .runs
        .iter_mut()
        .for_each(|run| run.shared.column_mut(0).fill(0.0));
    without
        .runs
        .iter_mut()
        .for_each(|run| run.shared = run.shared.columns(1, 1).into_owned());
    without
        .runs
        .iter_mut()
        .for_each(|run| run.active = run.active.columns(1, 2).into_owned());
    (without.prior, without.active) = (DMatrix::zeros(0, 1), DMatrix::zeros(0, 1));
    without.scales = DVector::from_element(1, 1.0);
    let other = Inference::new(&without).unwrap();
    let expected = other
        .joint(&other.covariance(Some(Method::Plain)).unwrap(), 1)
        .matrix[(1, 1)];
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}
