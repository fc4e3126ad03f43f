//! What problem files can say, against analytic solutions and closed forms.

use crate::help::{Folder, near, noise, times, value};
use nalgebra::{Matrix3, Vector3};
use pilotage_estimation::Fit;

/// `ẋ = (u - a x) / mass`.
const RELAX: &str = r#"
[model]
name = "relax"
[inputs]
u = {}
[parameters]
a = { start = 1, min = 0.01, max = 20 }
mass = { start = 1 }
begin = { start = 1 }
[states]
x = { start = "begin", der = "(u - a * x) / mass" }
[outputs]
x = {}
"#;

/// `x = x₀ + b t + c t²/2`: linear in its parameters.
const LINE: &str = r#"
[model]
name = "line"
[parameters]
b = { start = 1 }
c = { start = 0 }
[states]
x = { der = "b + c * time" }
[outputs]
x = {}
"#;

/// A folder with both models, and these runs: columns without time, on these times.
fn folder(time: &[f64], runs: &[&[(&str, &[f64])]]) -> Folder {
    let folder = Folder::new();
    folder.text("relax.toml", RELAX);
    folder.text("line.toml", LINE);
    for (k, columns) in runs.iter().enumerate() {
        let mut all = vec![("time", time)];
        all.extend_from_slice(columns);
        folder.write(&format!("run{}.csv", k + 1), &all);
    }
    folder
}

fn system(model: &str) -> String {
    format!("[system.m]\nmodel = \"{model}.toml\"\n")
}

const X: &str = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"y\"\nsd = 0.1\n";
const A: &str = "[parameters]\n\"m.a\" = {}\n";
const B: &str = "[parameters]\n\"m.b\" = {}\n";
const RUN: &str = "[[run]]\nfile = \"run1.csv\"\n";
/// Fine enough for an analytic solution.
const FINE: &str = "[fit]\nmesh_tolerance = 1e-10\nstarts = 2\n";

fn fit(folder: &Folder, parts: &[&str]) -> Fit {
    let fit = folder.fit(&parts.concat());
    assert!(
        fit.is_answer(),
        "{:?} {:?} {:?}",
        fit.status,
        fit.kkt,
        fit.diagnostics
    );
    fit
}

fn map(time: &[f64], f: impl Fn(f64) -> f64) -> Vec<f64> {
    time.iter().map(|t| f(*t)).collect()
}

/// What residuals cost in all, over the parameter.
type Cost<'c> = &'c dyn Fn(f64) -> f64;

/// Where a function of one variable is least, by golden sections.
fn least(f: impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2]) -> f64 {
    let section = (5_f64.sqrt() - 1.0) / 2.0;
    for _ in 0..200 {
        let [a, b] = [high - section * (high - low), low + section * (high - low)];
        if f(a) < f(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

#[test]
fn parameters_of_runs_and_subjects() {
    let time = times(41, 0.1);
    let truth = [("A", 0.7, 2.0), ("B", 1.4, 1.5), ("A", 0.7, 0.8)];
    let data = truth.map(|(_, a, begin)| map(&time, |t| begin * (-a * t).exp()));
    let columns: Vec<[(&str, &[f64]); 1]> = data.iter().map(|own| [("y", &own[..])]).collect();
    let runs: Vec<&[(&str, &[f64])]> = columns.iter().map(|own| &own[..]).collect();
    let mut lines = String::new();
    for (k, (subject, ..)) in truth.iter().enumerate() {
        lines += &format!(
            "[[run]]\nfile = \"run{}.csv\"\nsubject = \"{subject}\"\n",
            k + 1
        );
    }
    let sought = "[parameters]\n\"m.a\" = { per = \"subject\" }\n\"m.begin\" = { per = \"run\" }\n";
    let found = fit(
        &folder(&time, &runs),
        &[&system("relax"), X, sought, &lines, FINE],
    );
    near(value(&found, "m.a", 0), 0.7, 1e-6);
    near(value(&found, "m.a", 1), 1.4, 1e-6);
    for (k, (.., begin)) in truth.iter().enumerate() {
        near(value(&found, "m.begin", k), *begin, 1e-6);
    }
}

#[test]
fn gain_and_offset_of_a_sensor() {
    let time = times(41, 0.1);
    let y = map(&time, |t| 1.3 * (-0.7 * t).exp() + 0.4);
    let sensor = "gain = \"free\"\noffset = \"free\"\n";
    let found = fit(
        &folder(&time, &[&[("y", &y)]]),
        &[&system("relax"), X, sensor, A, RUN, FINE],
    );
    near(value(&found, "m.a", 0), 0.7, 1e-6);
    near(value(&found, "gain(y)", 0), 1.3, 1e-6);
    near(value(&found, "offset(y)", 0), 0.4, 1e-6);
}

#[test]
fn values_of_runs_and_changes() {
    // The change lies between two samples.
    let (time, a, changed) = (times(31, 0.1), 0.7, 1.25);
    let x = |mass: f64, after: f64| {
        map(&time, |t| {
            (-a * (t.min(changed) / mass + (t - changed).max(0.0) / after)).exp()
        })
    };
    let (one, two) = (x(1.3, 0.6), x(0.5, 0.5));
    let lines = "[[run]]\nfile = \"run1.csv\"\nset = { \"m.mass\" = 1.3 }\n[[run.change]]\ntime = 1.25\nset = { \"m.mass\" = \
                 \"light\" }\n[[run]]\nfile = \"run2.csv\"\nset = { \"m.mass\" = 0.5 }\n";
    let sought = "[parameters]\n\"m.a\" = {}\nlight = { start = 1 }\n";
    let found = fit(
        &folder(&time, &[&[("y", &one)], &[("y", &two)]]),
        &[&system("relax"), X, sought, lines, FINE],
    );
    near(value(&found, "m.a", 0), a, 1e-6);
    near(value(&found, "light", 0), 0.6, 1e-6);
}

/// `x = exp(-∫a dt)` of a rate that goes along a sigmoid, and of one that is linear between knots, of which one is sought.
#[test]
fn parameters_tied_to_the_time() {
    let time = times(61, 0.1);
    let (p, q, g, m) = (0.2, 0.9, 4.0, 2.5);
    let sigmoid = map(&time, |t| {
        let grown = |t: f64| (g * (t - m)).exp().ln_1p();
        (-(p * t + (q - p) / g * (grown(t) - grown(0.0)))).exp()
    });
    let knots = map(&time, |t| {
        let [before, after] = [t.min(m), (t - m).clamp(0.0, 1.5)];
        let late = (t - m - 1.5).max(0.0);
        let ramp = p * after + 0.5 * (q - p) / 1.5 * after * after;
        (-(p * before + ramp + q * late)).exp()
    });
    let own = "[parameters]\np = { start = 0.3 }\nq = { start = 0.7 }\nlate = { start = 2, min = 0, max = 6, unit = \"s\" }\n";
    let of = |data: &[f64], value: &str, also: &str| {
        let tied = format!("{own}{also}\"m.a\" = {{ value = \"{value}\" }}\n");
        fit(
            &folder(&time, &[&[("y", data)]]),
            &[&system("relax"), X, &tied, RUN, FINE],
        )
    };
    let found = of(
        &sigmoid,
        "p + (q - p) / (1 + exp(-g * (time - late)))",
        "g = { start = 2, min = 0.1, max = 20, unit = \"1/s\" }\n",
    );
    for (name, truth) in [("p", p), ("q", q), ("g", g), ("late", m)] {
        near(value(&found, name, 0), truth, 1e-5);
    }
    // What is tied is told as it begins.
    near(
        value(&found, "m.a", 0),
        p + (q - p) / (1.0 + (g * m).exp()),
        1e-5,
    );
    let found = of(&knots, "p + (q - p) * sat((time - late) / 1.5, 0, 1)", "");
    for (name, truth) in [("p", p), ("q", q), ("late", m)] {
        near(value(&found, name, 0), truth, 1e-4);
    }
}

#[test]
fn what_is_constant_cannot_be_tied_to_the_time() {
    let tied = "[parameters]\np = { start = 0.3 }\n\"m.a\" = { value = \"p + 0.1 * time\" }\n";
    for (also, expected) in [
        (
            "[derived]\ntwice = \"2 * m.a\"\n",
            "`m.a` is tied to the time",
        ),
        (
            "[initial]\n\"m.x\" = \"m.a\"\n",
            "`m.a` is tied to the time",
        ),
    ] {
        let text = [&system("relax"), X, tied, also, RUN].concat();
        let time = times(5, 0.1);
        let folder = folder(&time, &[&[("y", &time)]]);
        let error = folder.refused(&text);
        assert!(error.contains(expected), "{also}: {error}");
    }
}

#[test]
fn initial_states() {
    // ẋ = u - a x with u = 1 + t: x = u/a - 1/a² + c e^(-a t).
    let (time, a) = (times(41, 0.1), 0.7);
    let u = map(&time, |t| 1.0 + t);
    let x = |begin: f64| {
        let c = begin - 1.0 / a + 1.0 / (a * a);
        map(&time, |t| {
            (1.0 + t) / a - 1.0 / (a * a) + c * (-a * t).exp()
        })
    };
    let input = "[inputs]\n\"m.u\" = \"u\"\n";
    for (line, begin) in [
        ("\"free\"", 2.3),
        ("\"first sample\"", 2.3),
        ("\"steady\"", 1.0 / a),
        ("\"3 * m.a + 0.2\"", 2.3),
        ("2.3", 2.3),
    ] {
        let initial = format!("[initial]\n\"m.x\" = {line}\n");
        let folder = folder(&time, &[&[("u", &u), ("y", &x(begin))]]);
        let found = fit(
            &folder,
            &[&system("relax"), input, X, A, &initial, RUN, FINE],
        );
        near(value(&found, "m.a", 0), a, 1e-6);
        near(found.runs[0].states[0][0], begin, 1e-6);
    }
}

#[test]
fn inputs_between_samples() {
    let (h, a) = (0.2, 1.7_f64);
    let time = times(60, h);
    let u = noise(1, time.len());
    let decay = (-a * h).exp();
    for (hold, is_linear) in [("zero-order", 0.0), ("linear", 1.0)] {
        let mut x = vec![1.0];
        for k in 1..time.len() {
            // Over a step u = u₀ + s τ gives x = e^(-a τ) x₀ + (1 - e^(-a τ)) (u₀/a - s/a²) + s τ/a.
            let slope = is_linear * (u[k] - u[k - 1]) / h;
            x.push(
                decay * x[k - 1] + (1.0 - decay) * (u[k - 1] / a - slope / (a * a)) + slope * h / a,
            );
        }
        let input = format!("[inputs]\n\"m.u\" = {{ column = \"u\", hold = \"{hold}\" }}\n");
        let folder = folder(&time, &[&[("u", &u), ("y", &x)]]);
        let found = fit(&folder, &[&system("relax"), &input, X, A, RUN, FINE]);
        near(value(&found, "m.a", 0), a, 1e-6);
    }
}

/// `e^(-0.7 t)` with noise of 0.05.
fn noisy(time: &[f64], seed: u64) -> Vec<f64> {
    let noise = noise(seed, time.len());
    time.iter()
        .zip(noise)
        .map(|(t, e)| (-0.7 * t).exp() + 0.05 * e)
        .collect()
}

#[test]
fn an_estimated_noise_level_is_the_mean_square() {
    let time = times(41, 0.1);
    let y = noisy(&time, 2);
    let measured = X.replace("0.1", "\"sigma\"");
    let sought = "[parameters]\n\"m.a\" = {}\nsigma = { start = 0.3, min = 0.001 }\n";
    let found = fit(
        &folder(&time, &[&[("y", &y)]]),
        &[&system("relax"), &measured, sought, RUN, FINE],
    );
    let square = |(y, h): (&f64, &f64)| (y - h).powi(2);
    let mean = y
        .iter()
        .zip(&found.runs[0].predicted[0])
        .map(square)
        .sum::<f64>()
        / y.len() as f64;
    near(value(&found, "sigma", 0), mean.sqrt(), 1e-6);
    near(found.chi2, y.len() as f64, 1e-6);
    // With the same level everywhere the other parameter is that of least squares.
    let squares = |a: f64| {
        y.iter()
            .zip(&time)
            .map(|(y, t)| (y - (-a * t).exp()).powi(2))
            .sum()
    };
    near(value(&found, "m.a", 0), least(squares, [0.1, 3.0]), 1e-6);
}

/// A sum of 20,000 logarithms is so large that its last digits are rounding.
#[test]
fn the_noise_level_of_many_samples_is_estimated() {
    let time = times(20_000, 0.0005);
    let measured = X.replace("0.1", "\"sigma\"");
    let sought = "[parameters]\n\"m.a\" = {}\nsigma = { start = 0.3, min = 0.001 }\n";
    let data = folder(&time, &[&[("y", &noisy(&time, 2))]]);
    let found = fit(
        &data,
        &[
            &system("relax"),
            &measured,
            sought,
            RUN,
            "[fit]\nstarts = 1\n",
        ],
    );
    near(found.chi2, time.len() as f64, 1e-6);
}

#[test]
fn tied_and_logarithmic_parameters_have_the_same_optimum() {
    let time = times(41, 0.1);
    let y = noisy(&time, 3);
    let squares = |a: f64| {
        y.iter()
            .zip(&time)
            .map(|(y, t)| (y - (-a * t).exp()).powi(2))
            .sum()
    };
    let expected = least(squares, [0.1, 3.0]);
    let tied = "\"m.a\" = { value = \"2 * half\" }\nhalf = { start = 0.5 }\n";
    for line in ["\"m.a\" = {}\n", "\"m.a\" = { scale = \"log\" }\n", tied] {
        let sought = format!("[parameters]\n{line}");
        let found = fit(
            &folder(&time, &[&[("y", &y)]]),
            &[&system("relax"), X, &sought, RUN, FINE],
        );
        near(value(&found, "m.a", 0), expected, 1e-6);
    }
}

/// `2 t` with noise, at a row of each time but the first.
fn scattered(time: &[f64], seed: u64) -> Vec<f64> {
    let noise = noise(seed, time.len());
    let value = |(t, e): (&f64, f64)| {
        if *t > 0.0 {
            t * (2.0 + 0.2 * e.tanh())
        } else {
            f64::NAN
        }
    };
    time.iter().zip(noise).map(value).collect()
}

#[test]
fn weights_replicates_missing_cells_and_priors() {
    // Rows of equal times, and empty cells.
    let time: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k / 2)).collect();
    let mut data = [scattered(&time, 4), scattered(&time, 5)];
    for k in [3, 8, 21] {
        data[1][k] = f64::NAN;
    }
    let folder = folder(&time, &[&[("y", &data[0])], &[("y", &data[1])]]);
    let lines = format!("{RUN}[[run]]\nfile = \"run2.csv\"\nweight = 2.5\n");
    let mut sums = [0.0; 2];
    for (y, weight) in data.iter().zip([1.0, 2.5]) {
        for (t, y) in time.iter().zip(y).filter(|(_, y)| y.is_finite()) {
            sums[0] += weight * t * y / 0.01;
            sums[1] += weight * t * t / 0.01;
        }
    }
    for (prior, [mean, sd]) in [
        ("", [0.0, f64::INFINITY]),
        ("prior = { normal = [1.5, 0.02] }", [1.5, 0.02]),
        (
            "scale = \"log\", prior = { normal = [1.5, 0.02] }",
            [1.5, 0.02],
        ),
    ] {
        let sought = format!("[parameters]\n\"m.b\" = {{ {prior} }}\n");
        let found = fit(&folder, &[&system("line"), X, &sought, &lines, FINE]);
        let weight = f64::powi(sd, -2);
        near(
            value(&found, "m.b", 0),
            (sums[0] + weight * mean) / (sums[1] + weight),
            1e-7,
        );
        assert_eq!(
            found.samples,
            data.iter().flatten().filter(|y| y.is_finite()).count()
        );
    }
}

#[test]
fn noise_levels_of_samples() {
    let time = times(25, 0.2);
    let y = scattered(&time, 8);
    let sd = map(&time, |t| 0.1 + 0.2 * t);
    let known = || (0..time.len()).filter(|k| y[*k].is_finite());
    let square = |b: f64, k: usize| ((y[k] - b * time[k]) / sd[k]).powi(2);
    let folder = folder(&time, &[&[("y", &y), ("sd", &sd)]]);
    let measured = X.replace("0.1", "{ column = \"sd\" }");
    let found = fit(&folder, &[&system("line"), &measured, B, RUN, FINE]);
    let squares = |b: f64| known().map(|k| square(b, k)).sum();
    near(value(&found, "m.b", 0), least(squares, [1.5, 2.5]), 1e-6);
    // A level in proportion to what is expected: Σ ((y - b t)/(s b t))² + 2 ln(s b t), least at s² = mean((y/(b t) - 1)²).
    let measured = X.replace("0.1", "\"s * abs(m.x)\"");
    let sought = format!("{B}s = {{ start = 0.2, min = 0.001 }}\n");
    let found = fit(&folder, &[&system("line"), &measured, &sought, RUN, FINE]);
    let count = known().count() as f64;
    let level = |b: f64| {
        (known()
            .map(|k| (y[k] / (b * time[k]) - 1.0).powi(2))
            .sum::<f64>()
            / count)
            .sqrt()
    };
    let deviance = |b: f64| count * (level(b) * b).ln();
    let b = least(deviance, [1.5, 2.5]);
    near(value(&found, "m.b", 0), b, 1e-5);
    near(value(&found, "s", 0), level(b), 1e-5);
}

#[test]
fn losses() {
    let time = times(25, 0.2);
    let y = scattered(&time, 6);
    let known = || time.iter().zip(&y).filter(|(_, y)| y.is_finite());
    let student = |b: f64| {
        known()
            .map(|(t, y)| 4.0 * (1.0 + ((y - b * t) / 0.1).powi(2) / 3.0).ln())
            .sum()
    };
    let laplace = |b: f64| known().map(|(t, y)| (y - b * t).abs()).sum();
    let logarithmic = |b: f64| known().map(|(t, y)| (y.ln() - (b * t).ln()).powi(2)).sum();
    let huber = |b: f64| {
        let cost = |r: f64| {
            if r < 0.8 {
                r * r
            } else {
                0.8 * (2.0 * r - 0.8)
            }
        };
        known().map(|(t, y)| cost(((y - b * t) / 0.1).abs())).sum()
    };
    let of: [(&str, Cost<'_>, f64); 4] = [
        ("\"huber\"\nthreshold = 0.8", &huber, 1e-7),
        ("\"student\"\ndof = 3", &student, 1e-6),
        // Its kinks are rounded off.
        ("\"laplace\"", &laplace, 1e-3),
        ("\"log-normal\"", &logarithmic, 1e-6),
    ];
    for (noise, loss, tolerance) in of {
        let measured = format!("{X}noise = {noise}\n");
        let found = fit(
            &folder(&time, &[&[("y", &y)]]),
            &[&system("line"), &measured, B, RUN, FINE],
        );
        near(value(&found, "m.b", 0), least(loss, [1.5, 2.5]), tolerance);
    }
}

#[test]
fn constraints() {
    let time = times(21, 0.1);
    let y = scattered(&time, 7);
    let known = || time.iter().zip(&y).filter(|(_, y)| y.is_finite());
    let solve = |lines: &str| {
        fit(
            &folder(&time, &[&[("y", &y)]]),
            &[&system("line"), X, lines, RUN, FINE],
        )
    };
    // 2 s long: the line may not go beyond 3.
    for at in ["samples", "end"] {
        let line = format!("{B}[[constraint]]\nexpression = \"m.x\"\nmax = 3\nat = \"{at}\"\n");
        near(value(&solve(&line), "m.b", 0), 1.5, 1e-7);
    }
    let start = format!(
        "{B}[initial]\n\"m.x\" = \"free\"\n[[constraint]]\nexpression = \"m.x\"\nmin = 0.5\nat = \"start\"\n"
    );
    let [ty, tt] = known().fold([0.0; 2], |[ty, tt], (t, y)| {
        [ty + t * (y - 0.5), tt + t * t]
    });
    near(value(&solve(&start), "m.b", 0), ty / tt, 1e-6);
    // Least squares of b t + c t²/2 under b + c = 1, by Lagrange's multiplier.
    let both = "[parameters]\n\"m.b\" = {}\n\"m.c\" = { nominal = 1 }\n[[constraint]]\nexpression = \"m.b + m.c\"\nmax = 1\nat = \
                \"parameters\"\n";
    let mut matrix = Matrix3::new(0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0);
    let mut right = Vector3::new(0.0, 0.0, 1.0);
    for (t, y) in known() {
        let row = [*t, t * t / 2.0];
        for i in 0..2 {
            right[i] += row[i] * y;
            (0..2).for_each(|j| matrix[(i, j)] += row[i] * row[j]);
        }
    }
    let expected = matrix.lu().solve(&right).expect("regular");
    assert!(expected[2] > 0.0, "the constraint is active");
    let found = solve(both);
    near(value(&found, "m.b", 0), expected[0], 1e-6);
    near(value(&found, "m.c", 0), expected[1], 1e-6);
}

#[test]
fn measured_expressions() {
    let time = times(21, 0.1);
    let y = map(&time, |t| (1.7 * t).powi(2) + 0.3 * 1.7 - t);
    let measured = "[[measured]]\nexpression = \"m.x^2 + 0.3 * m.b - column('time_too')\"\ncolumn = \"y\"\nsd = 0.1\n";
    let measured = measured.replace("('", "(\\\"").replace("')", "\\\")");
    let folder = folder(&time, &[&[("y", &y), ("time_too", &time)]]);
    near(
        value(
            &fit(&folder, &[&system("line"), &measured, B, RUN, FINE]),
            "m.b",
            0,
        ),
        1.7,
        1e-7,
    );
}

/// Largest real part of a pole.
fn slowest(fit: &Fit) -> f64 {
    fit.poles
        .iter()
        .map(|pole| pole[0])
        .fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn stability_of_an_instance_and_of_the_loop() {
    // An oscillation that grows: ẍ + d ẋ + 4 x = 0 with d = -0.2.
    let time = times(61, 0.1);
    let omega = (4.0_f64 - 0.01).sqrt();
    let y = map(&time, |t| {
        (0.1 * t).exp() * ((omega * t).cos() - 0.1 / omega * (omega * t).sin())
    });
    let folder = folder(&time, &[&[("y", &y)]]);
    folder.text("swing.toml", "[model]\nname = \"swing\"\n[parameters]\nd = { start = 0.5 }\n[states]\nx = { start = 1, der = \"v\" }\nv = { der = \"-4 * x - d * v\" }\n[outputs]\nx = {}\n");
    let sought = "[parameters]\n\"m.d\" = {}\n";
    let parts = [&system("swing"), X, sought, RUN, FINE];
    near(value(&fit(&folder, &parts), "m.d", 0), -0.2, 1e-6);
    let stable = fit(
        &folder,
        &[&parts.concat(), "[stability]\nmodels = [\"m\"]\n"],
    );
    assert!(
        (-2e-5..0.0).contains(&slowest(&stable)),
        "{:?}",
        stable.poles
    );

    // u = -g x through lags of 1 s and 0.5 s onto an integrator: s (s + 1) (s + 2) + 2 g; at g = 3 a pair is at ±i √2.
    folder.text("hand.toml", "[model]\nname = \"hand\"\n[inputs]\nx = {}\n[parameters]\ng = { start = 1 }\n[states]\np = { der = \"-g * x - p\" }\nu = { der = \"2 * (p - u)\" }\n[outputs]\nu = {}\n");
    folder.text("plant.toml", "[model]\nname = \"plant\"\n[inputs]\nu = {}\n[states]\nx = { start = 1, der = \"u\" }\n[outputs]\nx = {}\n");
    let wired = "[system.h]\nmodel = \"hand.toml\"\n[system.m]\nmodel = \"plant.toml\"\n[connect]\n\"h.u\" = \"m.u\"\n\"m.x\" = \"h.x\"\n";
    // Whatever stands there: these are its predictions.
    let known = "[parameters]\n\"h.g\" = { start = 4, fixed = true }\n";
    let truth = folder.fit(&[wired, X, known, RUN, FINE].concat());
    folder.write(
        "run1.csv",
        &[("time", &time), ("y", &truth.runs[0].predicted[0])],
    );
    let parts = [wired, X, "[parameters]\n\"h.g\" = {}\n", RUN, FINE];
    near(value(&fit(&folder, &parts), "h.g", 0), 4.0, 1e-6);
    let stable = fit(
        &folder,
        &[&parts.concat(), "[stability]\nclosed_loop = true\n"],
    );
    // The pair decays by 1e-3 1/s, as the loop must: roots r ± i ω and a with a + 2 r = -3, r² + ω² + 2 r a = 2.
    let (r, a) = (-1e-3, -3.0 + 2e-3);
    near(
        value(&stable, "h.g", 0),
        -0.5 * a * (2.0 - 2.0 * r * a),
        1e-5,
    );
    assert!(
        (-1.02e-3..-0.999e-3).contains(&slowest(&stable)),
        "{:?}",
        stable.poles
    );
}
