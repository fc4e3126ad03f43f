//! Every rule of the validator: one fault put into a good description, and what is found.

use super::{faults2, faults3};
use pilotage::fmi::description::read;
use pilotage::fmi_check::validate;
use std::collections::BTreeMap;

pub(super) fn findings(xml: &str) -> Vec<String> {
    match read(xml.as_bytes()) {
        Ok(reading) => validate(&reading)
            .iter()
            .map(|f| match &f.variable {
                Some(variable) => format!("{variable}: {f}"),
                None => f.to_string(),
            })
            .collect(),
        Err(error) => vec![error.to_string()],
    }
}

#[test]
fn good_descriptions_have_no_finding() {
    assert_eq!(findings(faults2::GOOD), Vec::<String>::new());
    assert_eq!(findings(faults3::GOOD), Vec::<String>::new());
}

/// The pairs of texts that a file of faults has.
pub(super) fn pairs(faults: &str) -> Vec<(String, String)> {
    let table: BTreeMap<String, Vec<(String, String)>> = toml::from_str(faults).unwrap();
    table.into_values().flatten().collect()
}

/// Each fault, and the findings that it leads to; none of them more than once.
pub(super) fn report(
    good: &str,
    faults: &[(impl AsRef<str>, impl AsRef<str>)],
    findings: impl Fn(&str) -> Vec<String>,
) -> String {
    let mut report = String::new();
    for (number, (from, to)) in (1..).zip(faults) {
        let (from, to) = (from.as_ref(), to.as_ref());
        assert_eq!(good.matches(from).count(), 1, "ambiguous or absent: {from}");
        let found = findings(&good.replace(from, to));
        assert!(!found.is_empty(), "nothing found: {from} -> {to}");
        report.push_str(&format!("{number}. {from}\n-> {to}\n"));
        for finding in found {
            report.push_str(&format!("   {finding}\n"));
        }
    }
    report
}

#[test]
fn every_fault_of_fmi_2_is_found() {
    insta::assert_snapshot!(report(faults2::GOOD, &pairs(faults2::FAULTS), findings));
}

#[test]
fn every_fault_of_fmi_3_is_found() {
    insta::assert_snapshot!(report(faults3::GOOD, &pairs(faults3::FAULTS), findings));
}

#[test]
fn a_state_has_one_derivative() {
    let second = faults3::GOOD
        .replace(
            r#"<Float64 name="z" valueReference="6"/>"#,
            r#"<Float64 name="z" valueReference="6" derivative="4"><Dimension start="2"/></Float64>"#,
        )
        .replace(
            "<ClockedState",
            r#"<ContinuousStateDerivative valueReference="6" dependencies=""/><ClockedState"#,
        )
        .replace(
            r#"<InitialUnknown valueReference="17""#,
            r#"<InitialUnknown valueReference="6" dependencies=""/><InitialUnknown valueReference="17""#,
        );
    assert_eq!(
        findings(&second),
        [
            "error: line 44, column 5: <ContinuousStateDerivative> has two derivatives of `x`: `der(x)` and `z` (FMI 3.0, section 2.4.8)"
        ]
    );
}
