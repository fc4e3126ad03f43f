//! Findings about [`Misuse`]s: their severities and the sections of the standard.

use super::Reporter;
use crate::Finding;
use pilotage_fmi::description::{FmiVersion, Severity};
use pilotage_fmi::{CATEGORY, INSTANCE_NAME, Misuse};

impl Reporter<'_> {
    /// Reports misuses, but for a null pointer as category where the standard wants it: where the description declares none.
    pub(super) fn misuses(&mut self, misuses: impl IntoIterator<Item = Misuse>) {
        let has_categories = !self.description.log_categories.is_empty();
        let is_allowed = |misuse: &Misuse| matches!(misuse, Misuse::Null { argument, .. } if *argument == CATEGORY && !has_categories);
        for misuse in misuses.into_iter().filter(|misuse| !is_allowed(misuse)) {
            let version = self.description.fmi_version;
            let finding = Finding {
                section: format!("FMI {version}, section {}", section(&misuse, version)),
                ..Finding::behaviour(
                    &self.description,
                    self.kind,
                    severity(&misuse),
                    misuse.to_string(),
                )
            };
            (self.report)(super::Report::Finding(finding));
        }
    }
}

/// Names of instances and categories are for people: a tool may show any, or none.
fn severity(misuse: &Misuse) -> Severity {
    match misuse {
        Misuse::Null { argument, .. } if [CATEGORY, INSTANCE_NAME].contains(argument) => {
            Severity::Warning
        }
        _ => Severity::Error,
    }
}

fn section(misuse: &Misuse, version: FmiVersion) -> &'static str {
    use Misuse::*;
    match (version, misuse) {
        (FmiVersion::V2, NotUtf8 { .. } | OtherText { .. }) => "2.1.2",
        (FmiVersion::V2, Status { .. } | Pending) => "2.1.3",
        (FmiVersion::V2, NoText { function }) => match *function {
            "fmi2GetVersion" | "fmi2GetTypesPlatform" => "2.1.4",
            _ => "2.1.7",
        },
        (FmiVersion::V2, _) => "2.1.5",
        // Later releases of 3.0 number its subsections anew.
        (FmiVersion::V3, NotUtf8 { .. } | OtherText { .. } | Status { .. } | NoText { .. }) => {
            "2.2"
        }
        (FmiVersion::V3, _) => "2.3.1",
    }
}
