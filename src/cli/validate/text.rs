//! Findings as text and as JSON.

use super::Report;
use crate::cli::terminal;
use crate::fmi::description::{Place, Severity};
use crate::fmi_check::Finding;
use serde_json::{Value, json};

/// The report as text: the verdict, then the findings.
pub(in crate::cli) fn to_text(report: &Report) -> String {
    let count = |severity, one: &str| match report.count(severity) {
        0 => None,
        1 => Some(format!("1 {one}")),
        n => Some(format!("{n} {one}s")),
    };
    let counts = [
        count(Severity::Error, "error"),
        count(Severity::Warning, "warning"),
        count(Severity::Note, "note"),
    ];
    let counts: Vec<String> = counts.into_iter().flatten().collect();
    let verdict = match (report.is_valid(), report.is_tried) {
        (true, true) => "valid, and runs",
        (true, false) => "valid; not run",
        (false, _) => "not valid",
    };
    let mut text = format!("{}: {verdict}", terminal::shown(&report.path));
    if !counts.is_empty() {
        text += &format!(" ({})", counts.join(", "));
    }
    text += "\n";
    for finding in &report.findings {
        text += &format!("  {}\n", terminal::line(&finding.to_string()));
    }
    text
}

pub(super) fn to_json(report: &Report) -> Value {
    json!({
        "file": report.path.display().to_string(),
        "valid": report.is_valid(),
        "run": report.is_tried,
        "errors": report.count(Severity::Error),
        "warnings": report.count(Severity::Warning),
        "notes": report.count(Severity::Note),
        "findings": report.findings.iter().map(finding_to_json).collect::<Vec<_>>(),
    })
}

/// A finding as JSON; null for a missing file, place or variable.
pub(super) fn finding_to_json(finding: &Finding) -> Value {
    let file = Some(&finding.file).filter(|file| !file.is_empty());
    json!({
        "severity": finding.severity.to_string(),
        "file": file,
        "line": finding.place.map(|place| place.line),
        "column": finding.place.map(|place| place.column),
        "variable": finding.variable,
        "message": finding.message,
        "section": finding.section,
    })
}

/// Reads a finding written by [`finding_to_json`].
pub(super) fn finding_from_json(value: &Value) -> Option<Finding> {
    let text = |key: &str| value[key].as_str().map(str::to_owned);
    let number = |key: &str| value[key].as_u64().and_then(|n| u32::try_from(n).ok());
    Some(Finding {
        severity: Severity::ALL
            .into_iter()
            .find(|s| text("severity").as_deref() == Some(&s.to_string()))?,
        file: text("file").unwrap_or_default(),
        place: number("line")
            .zip(number("column"))
            .map(|(line, column)| Place { line, column }),
        variable: text("variable"),
        message: text("message")?,
        section: text("section")?,
    })
}
