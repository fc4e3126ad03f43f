//! States that runs set where they begin, and states to which runs add: doses.

use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use std::ops::ControlFlow;

/// A dose in the gut, that goes into the blood and leaves it.
const MODEL: &str = "[model]\nname = \"m\"\n[inputs]\nfood = {}\n[parameters]\nka = { start = 1, min = 0.01 }\n\
                     k = { start = 0.2, min = 0.001 }\nvolume = 2\n[states]\ngut.der = \"food - ka * gut\"\n\
                     blood.der = \"ka * gut / volume - k * blood\"\n";

const HEAD: &str = "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.blood\"\ncolumn = \"blood\"\n\
                    [parameters]\n\"m.ka\" = {}\n\"m.k\" = {}\n";

/// What a dose of 1 in the gut makes in the blood after some time, with ka 0.8 and k 0.3 (Bateman's function).
fn after(t: f64) -> f64 {
    let (ka, k) = (0.8_f64, 0.3_f64);
    match t >= 0.0 {
        true => ka / 2.0 / (ka - k) * ((-k * t).exp() - (-ka * t).exp()),
        false => 0.0,
    }
}

/// A run of 24 h with these doses.
fn run(doses: &[(f64, f64)]) -> String {
    let row = |k: u32| {
        let t = 0.5 * f64::from(k);
        let blood: f64 = doses.iter().map(|(at, dose)| dose * after(t - at)).sum();
        format!("{t},{blood}\n")
    };
    "time,blood\n".to_owned() + &(0..=48).map(row).collect::<String>()
}

/// The fit of the lines after [`HEAD`] to runs with these doses.
fn fitted(lines: &str, runs: &[&[(f64, f64)]]) -> Result<Fit, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.toml"), MODEL).unwrap();
    for (k, doses) in runs.iter().enumerate() {
        std::fs::write(folder.path().join(format!("{k}.csv")), run(doses)).unwrap();
    }
    let text = format!("{HEAD}{lines}[fit]\nstarts = 1\nmesh_tolerance = 1e-8\n");
    let shown = |error: pilotage_estimation::ProblemError| error.to_string();
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).map_err(shown)?;
    let posed = Posed::new(&file, &part::open).map_err(shown)?;
    Ok(fit(&posed, &mut |_| ControlFlow::Continue(())))
}

/// Whether the fit has these values, and a simulation the same objective.
fn assert_found(fit: &Fit, expected: &[(&str, f64)]) {
    assert!(fit.is_answer(), "{:?}", fit.diagnostics);
    for (name, value) in expected {
        let found = fit.value(name).unwrap();
        assert!((found - value).abs() < 1e-5 * value, "{name} = {found}");
    }
    assert!(fit.objective < 1e-8 && fit.agrees(), "{}", fit.objective);
}

const TRUE: [(&str, f64); 2] = [("m.ka", 0.8), ("m.k", 0.3)];

#[test]
fn doses_are_added_where_a_run_begins_at_samples_and_between_them() {
    let change = |time: f64, dose: f64| {
        format!("[[run.change]]\ntime = {time}\nadd = {{ \"m.gut\" = {dose} }}\n")
    };
    let doses = [
        [(0.0, 10.0), (8.0, 10.0), (12.25, 5.0)],
        [(0.0, 20.0), (6.3, 20.0), (7.0, 3.0)],
    ];
    let lines = doses.iter().enumerate().map(|(k, doses)| {
        let changes = doses.iter().map(|(time, dose)| change(*time, *dose));
        format!(
            "[[run]]\nfile = \"{k}.csv\"\n{}",
            changes.collect::<String>()
        )
    });
    let fit = fitted(&lines.collect::<String>(), &[&doses[0], &doses[1]]).unwrap();
    assert_found(&fit, &TRUE);
    // The state of a run is that of the model, which jumps: at the sample it is the new one.
    let gut = &fit.runs[0].states[0];
    let at = |time: f64| fit.runs[0].time.iter().rposition(|t| *t == time).unwrap();
    assert!((gut[at(0.0)] - 10.0).abs() < 1e-6);
    let expected = 10.0 * (-0.8_f64 * 8.0).exp() + 10.0;
    assert!((gut[at(8.0)] - expected).abs() < 1e-4, "{}", gut[at(8.0)]);
}

#[test]
fn what_is_added_may_be_sought() {
    let lines = "dose = { start = 4 }\n[[run]]\nfile = \"0.csv\"\n[[run.change]]\ntime = 0\nadd = { m = { gut = 7 } }\n\
                 [[run.change]]\ntime = 5.1\nadd = { \"m.gut\" = \"2 * dose\", \"m.blood\" = \"dose - dose\" }\n\
                 [[run.change]]\ntime = 9\nadd = { \"m.gut\" = \"2 * dose\" }\n";
    let fit = fitted(lines, &[&[(0.0, 7.0), (5.1, 12.0), (9.0, 12.0)]]).unwrap();
    assert_found(&fit, &[TRUE[0], TRUE[1], ("dose", 6.0)]);
}

/// In each run another value: a number, a sought one, and where none is set what `[initial]` or the model says.
#[test]
fn runs_set_where_their_states_begin() {
    let runs: [&[(f64, f64)]; 3] = [&[(0.0, 10.0)], &[(0.0, 6.0)], &[(0.0, 8.0)]];
    let lines = |initial: &str| {
        format!(
            "half = {{ start = 1 }}\n{initial}[[run]]\nfile = \"0.csv\"\nset = {{ \"m.gut\" = 10 }}\n[[run]]\nfile = \"1.csv\"\n\
             set = {{ m = {{ gut = \"2 * half\" }} }}\n[[run]]\nfile = \"2.csv\"\n"
        )
    };
    for initial in [
        "[initial]\n\"m.gut\" = 8\n",
        "[initial]\n\"m.gut\" = \"free\"\n",
    ] {
        let fit = fitted(&lines(initial), &runs).unwrap();
        assert_found(&fit, &[TRUE[0], TRUE[1], ("half", 3.0)]);
        let begins: Vec<f64> = fit.runs.iter().map(|run| run.states[0][0]).collect();
        for (found, expected) in begins.iter().zip([10.0, 6.0, 8.0]) {
            assert!((found - expected).abs() < 1e-4, "{begins:?}");
        }
    }
    // Numbers alone, and a state that others begin at the first sample.
    let lines = "[initial]\n\"m.blood\" = \"first sample\"\n\"m.gut\" = 8\n[[run]]\nfile = \"0.csv\"\n\
                 set = { \"m.gut\" = 10, \"m.blood\" = 0 }\n[[run]]\nfile = \"1.csv\"\nset = { \"m.gut\" = 6 }\n[[run]]\n\
                 file = \"2.csv\"\n";
    assert_found(&fitted(lines, &runs).unwrap(), &TRUE);
}

/// A change where the run begins is one of the whole run, but for how states begin.
#[test]
fn a_change_where_a_run_begins_is_one_of_the_whole_run() {
    let of = |lines: &str| {
        fitted(
            &format!("[[run]]\nfile = \"0.csv\"\n{lines}"),
            &[&[(0.0, 10.0)]],
        )
    };
    let begun =
        of("[[run.change]]\ntime = 0\nset = { \"m.food\" = 0.1 }\nadd = { \"m.gut\" = 10 }\n")
            .unwrap();
    let whole = of("set = { \"m.food\" = 0.1, \"m.gut\" = 10 }\n").unwrap();
    let [found, expected] = [&begun, &whole].map(|fit| fit.value("m.ka").unwrap());
    assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    assert!((begun.value("m.ka").unwrap() - 0.8).abs() > 1e-3);
    for (lines, why) in [
        (
            "[[run.change]]\ntime = -1\nset = { \"m.food\" = 0.1 }\n",
            "a change at -1 s is not within",
        ),
        (
            "[[run.change]]\ntime = 24\nadd = { \"m.gut\" = 1 }\n",
            "a change at 24 s is not within",
        ),
        (
            "[[run.change]]\ntime = 1\nadd = { \"m.food\" = 1 }\n",
            "`m.food` is no state; `set` changes it",
        ),
        (
            "[[run.change]]\ntime = 1\nset = { \"m.gut\" = 1 }\n",
            "and a change moves it by `add`",
        ),
        ("[[run.change]]\ntime = 1\n", "nothing changes; write `set`"),
        (
            "[[run.change]]\ntime = 1\nadd = { \"m.gutt\" = 1 }\n",
            "did you mean `m.gut`?",
        ),
        (
            "set = { \"m.gut\" = \"m.blood\" }\n",
            "an initial state is computed once",
        ),
    ] {
        let error = of(lines).unwrap_err();
        assert!(error.contains(why), "{error}");
    }
}
