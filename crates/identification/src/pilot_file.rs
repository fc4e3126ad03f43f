//! The result file `pilot.toml`: θ and its provenance.

use super::result::PilotDiagnostic;
use super::spread;
use super::{
    ClosedLoop, Diagnostic, Fit, FitOptions, Identification, Mesh, PilotFile, Trial, Uncertainty,
};
use nalgebra::Complex;
use pilotage_flights::pilot::{FittedPilot, PilotError};
use pilotage_flights::vehicle::{self, Mode, VehicleError};
use pilotage_models::{COEFFICIENTS, Pilot};
use pilotage_text::document::{self, Document, DocumentError, number, quoted};
use pilotage_text::printable::comment;
use pilotage_units::{power, pretty};
use std::path::Path;

/// Errors of a pilot file.
#[derive(Debug, thiserror::Error)]
pub enum PilotFileError {
    /// Not TOML, or a field of the wrong type.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Not the fields of a pilot, or θ is missing or out of range.
    #[error(transparent)]
    Pilot(#[from] PilotError),
    /// The vehicle is invalid.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// The table `[uncertainty]` is invalid.
    #[error("{file}:{line}: [uncertainty] {fault}")]
    Uncertainty {
        /// The file.
        file: String,
        /// Line of the field.
        line: usize,
        /// The field and its fault.
        fault: String,
    },
}

/// Code of the diagnostic for a loop that was allowed to be unstable.
const UNSTABLE: &str = "unstable-loop";

impl PilotFile {
    /// Reads a pilot file.
    ///
    /// # Errors
    /// If the file cannot be read, or θ is missing or not numeric.
    pub fn read(path: &Path) -> Result<Self, PilotFileError> {
        Self::parse(&document::read(path)?, &path.display().to_string())
    }

    /// Parses the text of a pilot file; `file` is its name in messages. If `converged` or `stick_limit` is missing, as
    /// in a file written by hand, it defaults to `true` or 1.
    ///
    /// # Errors
    /// As [`PilotFile::read`].
    pub fn parse(text: &str, file: &str) -> Result<Self, PilotFileError> {
        let document = Document::parse(text, file)?;
        let root = document.root();
        let FittedPilot { theta, stick_limit } = FittedPilot::of_table(root)?;
        let vehicle = match (root.table("closed_loop")?, root.table("vehicle")?) {
            (Some(_), Some(table)) => Some(vehicle::of_table(&table)?),
            _ => None,
        };
        Ok(Self {
            spread: match root.table("uncertainty")? {
                Some(table) => spread::of_table(&table, theta.len())?,
                None => None,
            },
            theta,
            stick_limit,
            converged: root.boolean("converged")?.unwrap_or(true),
            vehicle,
            diagnostics: (root.tables("doubt")?.iter())
                .map(PilotDiagnostic::read)
                .collect::<Result<_, _>>()?,
        })
    }

    /// Why the pilot is not a valid result; `None` if it is.
    pub fn objection(&self) -> Option<String> {
        if !self.converged {
            return Some("did not converge".into());
        }
        if let Some(diagnostic) = self.diagnostics.iter().find(|diagnostic| diagnostic.fatal) {
            return Some(format!("is no answer: {}", diagnostic.words));
        }
        let is_reported = self
            .diagnostics
            .iter()
            .any(|diagnostic| diagnostic.code == UNSTABLE);
        let unstable = self.is_stable_loop() == Some(false);
        (unstable && !is_reported).then(|| {
            "is no answer: the closed loop of [theta] with [vehicle] is unstable, and the file does not say so; it \
             may have been edited"
                .into()
        })
    }

    /// The closed loop with the vehicle of the fit, computed from θ in the file; `None` if the file does not specify
    /// the vehicle.
    pub fn closed_loop(&self) -> Option<ClosedLoop> {
        let pilot = Pilot {
            order: self.theta.len() / 2,
        };
        self.vehicle
            .map(|vehicle| ClosedLoop::of(vehicle, pilot, &self.theta))
    }

    /// Whether [`Self::closed_loop`] is stable.
    pub fn is_stable_loop(&self) -> Option<bool> {
        self.closed_loop().map(|known| known.is_stable())
    }

    /// Warnings for users of the pilot; statements of the file about its loop are included only if they agree with θ.
    pub fn caveat(&self) -> Option<String> {
        let unconverged = "The fit did NOT converge: θ is its best iterate, not a solution.";
        let unconverged = (!self.converged).then(|| unconverged.to_owned());
        let is_true =
            |diagnostic: &&PilotDiagnostic| match (diagnostic.code.as_str(), self.is_stable_loop())
            {
                (UNSTABLE, Some(stable)) => !stable,
                ("loop-on-bound" | "slow-loop" | "leaves-target", Some(stable)) => stable,
                _ => true,
            };
        let diagnostics = (self.diagnostics.iter().filter(is_true))
            .map(|diagnostic| format!("Diagnostic: {}.", diagnostic.words));
        let all: Vec<String> = unconverged.into_iter().chain(diagnostics).collect();
        (!all.is_empty()).then(|| all.join(" "))
    }
}

impl PilotDiagnostic {
    fn read(table: &document::TomlTable) -> Result<Self, DocumentError> {
        Ok(Self {
            code: table.required("code", table.string("code")?)?.into(),
            words: table.required("words", table.string("words")?)?.into(),
            fatal: table.boolean("fatal")?.unwrap_or(false),
        })
    }
}

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
    text += &own.determined().map_or_else(String::new, spread::to_toml);
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
            diagnostics: vec![Diagnostic::ConstantData],
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
                theta: fit().theta,
                stick_limit: 1.0,
                converged: false,
                vehicle: Some(FitOptions::default().vehicle),
                spread: None,
                diagnostics: vec![PilotDiagnostic {
                    code: "constant-data".into(),
                    words: Diagnostic::ConstantData.to_string(),
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
                share: Some(1.0),
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
            prop_assert_eq!(read, PilotFile { theta: ended.theta, stick_limit, converged, vehicle, spread: None, diagnostics });
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

    const THREE: &str = "[theta]\ntheta1 = 1\ntheta2 = 2\n[uncertainty]\nmethod = \"cr3\"\n\
        degrees_of_freedom = [5, inf]\ncovariance = [[4, 1.9], [1.9, 1]]\ntheta1 = { sd = 2 }\n";

    #[test]
    fn how_sure_it_is_reads_back_to_the_same_bits() {
        let spread = PilotFile::parse(THREE, "pilot.toml")
            .unwrap()
            .spread
            .unwrap();
        assert_eq!(spread.covariance, nalgebra::dmatrix![4.0, 1.9; 1.9, 1.0]);
        assert_eq!(spread.degrees, [5.0, f64::INFINITY]);
        let odd = pilotage_inference::Spread {
            method: spread.method,
            covariance: nalgebra::dmatrix![0.1 + 0.2, 1e-151; 1e-151, 1e-300],
            degrees: vec![1.0 / 3.0, f64::INFINITY],
        };
        let text = format!(
            "[theta]\ntheta1 = 1\ntheta2 = 2\n[uncertainty]\nmethod = \"cr3\"\n{}",
            spread::to_toml(&odd)
        );
        assert_eq!(
            PilotFile::parse(&text, "pilot.toml").unwrap().spread,
            Some(odd)
        );
        // Older files contain only intervals.
        let lines = THREE.lines().filter(|line| !line.starts_with("covariance"));
        let text: String = lines.map(|line| format!("{line}\n")).collect();
        assert_eq!(PilotFile::parse(&text, "pilot.toml").unwrap().spread, None);
    }

    #[test]
    fn what_is_no_covariance_is_told() {
        for (old, new, message) in [
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 2.1], [2.1, 1]]",
                ":7: [uncertainty] covariance is not positive semidefinite",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 1.9], [1.8, 1]]",
                "is not symmetric",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 1.9], [nan, 1]]",
                "no finite number",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[-4, 0], [0, 1]]",
                "a variance below 0",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[[4, 1.9]]",
                "is not 2 rows of 2 numbers",
            ),
            (
                "[[4, 1.9], [1.9, 1]]",
                "[4, 1.9]",
                "an array of rows of numbers",
            ),
            (
                "[5, inf]",
                "[5, 0]",
                ":6: [uncertainty] degrees_of_freedom is not 2 numbers above 0",
            ),
            ("[5, inf]", "5", "an array of numbers"),
            ("cr3", "cr4", "known are plain, sidpac, ar, cr3"),
            ("theta1 = {", "theta3 = {", "theta3"),
            ("sd = 2", "sd = -2", ":8: [uncertainty] sd is -2, below 0"),
            (
                "sd = 2",
                "sd = 3",
                ":8: [uncertainty] theta1 has sd = 3, and the covariance says 2",
            ),
            (
                "sd = 2",
                "sd = 2, low = 3, high = 1",
                ":8: [uncertainty] low is 3, above high = 1",
            ),
            ("sd = 2", "sd = 2, foo = 1", "foo"),
        ] {
            let text = THREE.replace(old, new);
            assert_ne!(text, THREE, "{old}");
            let error = PilotFile::parse(&text, "pilot.toml")
                .unwrap_err()
                .to_string();
            assert!(error.contains(message), "{new}: {error}");
        }
    }
}
