//! Pilot files give back what was written to them.

use pilotage_flights::pilot::{FittedPilot, PilotDiagnostic, PilotFile};
use proptest::prelude::*;

/// As an earlier version of the command wrote it: an answer that is none.
const EARLIER: &str = r#"
tool = "pilotage 0.1.0"
status = "iteration-limit"
converged = false
stick_limit = 1
[theta]
theta1 = 0.30000000000000004
theta2 = 1e-9
theta3 = -0.3333333333333333
theta4 = 0
[[doubt]]
code = "constant-data"
words = "nothing \"moves\""
fatal = true
[[data]]
file = "C:\\data\\a.csv"
"#;

#[test]
fn a_file_of_an_earlier_version_keeps_its_bits_and_its_mark() {
    let read = PilotFile::parse(EARLIER, "pilot.toml").unwrap();
    let expected = PilotFile {
        pilot: FittedPilot {
            theta: vec![0.1 + 0.2, 1e-9, -1.0 / 3.0, 0.0],
            stick_limit: 1.0,
        },
        converged: false,
        vehicle: None,
        spread: None,
        diagnostics: vec![PilotDiagnostic {
            code: "constant-data".into(),
            words: "nothing \"moves\"".into(),
            fatal: true,
        }],
    };
    assert_eq!(read, expected);
    assert_eq!(read.objection().as_deref(), Some("did not converge"));
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 64,
        rng_seed: proptest::test_runner::RngSeed::Fixed(6),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Any θ and any limit of the stick.
    #[test]
    fn a_model_file_of_a_pilot_is_read_again_to_the_same_bits(
        theta in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO, 6),
        stick_limit in f64::MIN_POSITIVE..f64::MAX,
    ) {
        let pilot = FittedPilot { theta, stick_limit };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pilot.toml");
        std::fs::write(&path, pilot.text("pilot.toml").unwrap()).unwrap();
        let read = PilotFile::of_model(&path).unwrap().expect("a linear pilot");
        prop_assert_eq!(read.pilot, pilot);
    }
}
