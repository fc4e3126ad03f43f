//! The text of the result file `pilot.toml`: θ and its provenance.

use super::{Diagnostic, Fit, FitOptions, Identification, Mesh, Trial, Uncertainty};
use nalgebra::Complex;
use pilotage_flights::vehicle::{ClosedLoop, Mode};
use pilotage_inference::Spread;
use pilotage_models::{COEFFICIENTS, Pilot};
use pilotage_text::document::{number, quoted};
use pilotage_text::printable::comment;
use pilotage_units::{power, pretty};

/// Text of a pilot file. An invalid fit is marked as such at the top.
pub fn to_toml(found: &Identification) -> String {
    let Identification { fit, options, .. } = found;
    let trials = &found.trials.fit;
    let mut text = String::from(
        "# A pilot: y_p/u_p = (θ2n s^(n-1) + ... + θn+1) / (s^n + θn s^(n-1) + ... + θ1),\n\
         # from the error u_p [m] to the stick y_p [-1 to 1].\n",
    );
    if !fit.converged {
        text += "# NOT CONVERGED: this is the best iterate of a solve that did not reach its tolerance.\n";
    }
    for diagnostic in fit
        .diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.is_fatal())
    {
        text += &comment(&format!("NO ANSWER: {diagnostic}."));
    }
    text += &format!(
        "tool = \"pilotage {}\"\nstatus = {}\nconverged = {}\nstick_limit = {}\n\n[theta]\n",
        env!("CARGO_PKG_VERSION"),
        quoted(fit.status.as_str()),
        fit.converged,
        number(options.stick_limit)
    );
    for (i, (value, unit)) in fit.theta.iter().zip(units(options.pilot)).enumerate() {
        let assignment = format!("theta{} = {}", i + 1, number(*value));
        text += &format!("{assignment:<34} # [{unit}]\n");
    }
    text += &fit
        .uncertainty
        .as_ref()
        .map_or_else(String::new, uncertainty);
    let closed_loop = fit
        .closed_loop
        .as_ref()
        .map_or_else(String::new, closed_loop);
    let diagnostics: String = fit.diagnostics.iter().map(diagnostic).collect();
    let pilot = poles("pole", &options.pilot.poles(&fit.theta));
    text + &diagnostics + &closed_loop + &pilot + &solve(fit, options) + &data(options, trials)
}

/// Units of the components of θ, in order (see [`pilotage_models::pilot`]), for display.
pub fn units(pilot: Pilot) -> Vec<String> {
    let n = pilot.order;
    let denominator = (0..n).map(|i| format!("1/{}", power("s", n - i)));
    let numerator = (0..n).map(|i| format!("1/(m.{})", power("s", n - i)));
    (denominator.chain(numerator))
        .map(|unit| pretty(&unit))
        .collect()
}

/// The table `[uncertainty]`, in the units of θ.
fn uncertainty(own: &Uncertainty) -> String {
    let mut text = format!(
        "\n[uncertainty]                      # 95 % intervals\nmethod = {}\n",
        quoted(own.spread.method.as_str())
    );
    text += &own.determined().map_or_else(String::new, covariance);
    for (i, own) in own.intervals.iter().enumerate() {
        text += &format!(
            "theta{} = {{ sd = {}, low = {}, high = {} }}\n",
            i + 1,
            number(own.sd),
            number(own.low),
            number(own.high)
        );
    }
    text
}

/// Its fields that are read again, except the method.
fn covariance(own: &Spread) -> String {
    let row = |row: Vec<f64>| -> String {
        let all: Vec<String> = row.into_iter().map(number).collect();
        format!("[{}]", all.join(", "))
    };
    let rows = own.covariance.row_iter();
    let rows: String = rows
        .map(|line| format!("    {},\n", row(line.iter().copied().collect())))
        .collect();
    format!(
        "degrees_of_freedom = {}\ncovariance = [                     # of theta1, theta2, ...\n{rows}]\n",
        row(own.degrees.clone())
    )
}

fn diagnostic(diagnostic: &Diagnostic) -> String {
    format!(
        "\n[[doubt]]\ncode = \"{}\"\nwords = {}\nfatal = {}\n",
        diagnostic.code(),
        quoted(&diagnostic.to_string()),
        diagnostic.is_fatal()
    )
}

fn closed_loop(closed_loop: &ClosedLoop) -> String {
    format!(
        "\n[closed_loop]                      # with the vehicle below, linearised about hover\nstable = {}\n{}",
        closed_loop.is_stable(),
        poles("closed_loop.pole", &closed_loop.poles)
    )
}

fn poles(table: &str, poles: &[Complex<f64>]) -> String {
    let mut text = String::new();
    for mode in Mode::of_poles(poles) {
        text += &format!(
            "\n[[{table}]] # with its conjugate where im is not 0\n\
             re = {} # [1/s]\nim = {} # [1/s]\nfrequency = {} # [rad/s]\ndamping = {}\n",
            number(mode.pole.re),
            number(mode.pole.im),
            number(mode.frequency),
            number(mode.damping)
        );
    }
    text
}

fn solve(fit: &Fit, options: &FitOptions) -> String {
    let unit = match options.objective.unit() {
        "1" => "1",
        _ => "m²",
    };
    let mesh = match options.mesh {
        Mesh::Samples => "mesh = \"samples\"".into(),
        Mesh::Step(step) => format!("mesh_step = {} # [s]", number(step)),
    };
    format!(
        "\n[fit]\nobjective = \"{}\"\nscheme = \"{}\"\n{mesh}\ninitial_state = \"{}\"\ninitial_position = \"{}\"\n\
         stable_loop = {} # asked for\n\
         sum_of_squares = {} # [{unit}]\nkkt = {}\ntolerance = {}\niterations = {}\nseconds = {}\n",
        options.objective.as_str(),
        options.scheme,
        options.initial_state.as_str(),
        options.initial_position.as_str(),
        options.stable_loop,
        number(fit.objective),
        number(fit.kkt),
        number(options.tolerance),
        fit.iterations,
        number((1e3 * fit.seconds).round() / 1e3)
    )
}

fn data(options: &FitOptions, trials: &[Trial]) -> String {
    let mut text = String::from("\n[vehicle]\n");
    for field in &COEFFICIENTS {
        text += &format!(
            "{} = {} # [{}]\n",
            field.name,
            number((field.get)(&options.vehicle)),
            pretty(field.unit)
        );
    }
    for trial in trials {
        text += &format!(
            "\n[[data]]\nfile = {}\nsha256 = \"{}\"\nsamples = {}\nweight = {}\n",
            quoted(&trial.origin),
            trial.sha256,
            trial.time.len(),
            number(trial.weight)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TrialSet;
    use pilotage_flights::Check;
    use pilotage_flights::pilot::{FittedPilot, PilotDiagnostic, PilotFile};
    use pilotage_inference::Method;
    use pilotage_sqp::Status;
    use proptest::prelude::*;

    fn fit() -> Fit {
        Fit {
            theta: vec![0.1 + 0.2, 1.0, 1e-9, -0.5, 0.0, -1.0 / 3.0],
            objective: 6.5,
            converged: false,
            status: Status::IterationLimit,
            kkt: 1e-3,
            iterations: 7,
            seconds: 0.25,
            unknowns: 16_260,
            starts: Vec::new(),
            tried: 0,
            skipped: 0,
            curvature: None,
            violation: 0.0,
            runs: Vec::new(),
            closed_loop: Some(ClosedLoop {
                poles: vec![
                    Complex::new(-1.0, 2.0),
                    Complex::new(-1.0, -2.0),
                    Complex::new(1e-3, 0.0),
                ],
            }),
            unbounded: None,
            uncertainty: None,
            diagnostics: vec![Check::ConstantData.into()],
        }
    }

    /// The text for a fit of these trials.
    fn written(fit: Fit, options: FitOptions, trials: Vec<Trial>) -> String {
        let trials = TrialSet {
            fit: trials,
            validation: Vec::new(),
            notes: Vec::new(),
            files: Vec::new(),
        };
        to_toml(&Identification::of(fit, options, trials))
    }

    fn trial() -> Trial {
        Trial {
            name: "a".into(),
            origin: "C:\\data\\\"a\"\n.csv".into(),
            sha256: "00".into(),
            time: vec![0.0],
            target: vec![1.0],
            position: vec![0.0],
            stick: None,
            weight: 1.0,
        }
    }

    #[test]
    fn what_is_written_reads_back_to_the_same_bits_and_keeps_the_mark() {
        let text = written(fit(), FitOptions::default(), vec![trial()]);
        assert!(text.contains("# NOT CONVERGED"));
        let read = PilotFile::parse(&text, "pilot.toml").unwrap();
        assert_eq!(
            read,
            PilotFile {
                pilot: FittedPilot {
                    theta: fit().theta,
                    stick_limit: 1.0
                },
                converged: false,
                vehicle: Some(FitOptions::default().vehicle),
                spread: None,
                diagnostics: vec![PilotDiagnostic {
                    code: "constant-data".into(),
                    words: Check::ConstantData.to_string(),
                    fatal: true,
                }],
            }
        );
        let table: toml::Table = text.parse().unwrap();
        assert_eq!(
            table["data"][0]["file"].as_str(),
            Some(trial().origin.as_str())
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 256,
            rng_seed: proptest::test_runner::RngSeed::Fixed(6),
            ..ProptestConfig::default()
        })]
        /// For any outcome of a solve, θ, its limit and the mark are read back, and the rest is valid TOML.
        #[test]
        fn whatever_is_written_is_read_again(
            theta in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO, 6),
            [objective, kkt, seconds, tolerance] in prop::array::uniform4(prop::num::f64::ANY),
            stick_limit in f64::MIN_POSITIVE..f64::MAX,
            converged: bool,
            status in prop::sample::select(vec![Status::Converged, Status::Infeasible, Status::TimeLimit]),
            origins in prop::collection::vec("(?s).*", 0..3),
            step in prop::option::of(prop::num::f64::POSITIVE),
        ) {
            let diagnostics = vec![Diagnostic::Outlier {
                run: origins.first().cloned().unwrap_or_default(),
                time: kkt,
                value: objective,
                unit: "m",
                count: 1,
                share: 1.0,
            }];
            let ended = Fit { theta, objective, converged, status, kkt, seconds, diagnostics, ..fit() };
            let mesh = step.map_or(Mesh::Samples, Mesh::Step);
            let options = FitOptions { stick_limit, tolerance, mesh, ..FitOptions::default() };
            let trials: Vec<Trial> = (origins.iter())
                .map(|origin| Trial { origin: origin.clone(), weight: objective, ..trial() })
                .collect();
            let text = written(ended.clone(), options.clone(), trials);
            let read = PilotFile::parse(&text, "pilot.toml").unwrap();
            let diagnostics = vec![PilotDiagnostic {
                code: "outlier".into(),
                words: ended.diagnostics[0].to_string(),
                fatal: true,
            }];
            let vehicle = Some(options.vehicle);
            prop_assert_eq!(read, PilotFile { pilot: FittedPilot { theta: ended.theta, stick_limit }, converged, vehicle, spread: None, diagnostics });
            let table: toml::Table = text.parse().unwrap();
            prop_assert_eq!(table["status"].as_str(), Some(ended.status.as_str()));
            let found = table["fit"]["kkt"].as_float().unwrap();
            prop_assert!(found == kkt || (found.is_nan() && kkt.is_nan()));
            for (k, origin) in origins.iter().enumerate() {
                prop_assert_eq!(table["data"][k]["file"].as_str(), Some(origin.as_str()));
            }
        }
    }

    #[test]
    fn units_of_theta_follow_from_metres_in_and_stick_out() {
        let expected = ["1/s³", "1/s²", "1/s", "1/(m·s³)", "1/(m·s²)", "1/(m·s)"];
        assert_eq!(units(Pilot { order: 3 }), expected);
        assert_eq!(units(Pilot { order: 12 })[12], "1/(m·s¹²)");
    }

    #[test]
    fn how_sure_it_is_reads_back_to_the_same_bits() {
        let odd = Spread {
            method: Method::Cr3,
            covariance: nalgebra::dmatrix![0.1 + 0.2, 1e-151; 1e-151, 1e-300],
            degrees: vec![1.0 / 3.0, f64::INFINITY],
        };
        let text = format!(
            "[theta]\ntheta1 = 1\ntheta2 = 2\n[uncertainty]\nmethod = \"cr3\"\n{}",
            covariance(&odd)
        );
        assert_eq!(
            PilotFile::parse(&text, "pilot.toml").unwrap().spread,
            Some(odd)
        );
    }
}
