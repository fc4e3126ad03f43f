//! What VDMCheck, FMI Library and FMUComplianceChecker look at, by their sources, check by check: each has a
//! planted fault that `validate` finds, or a reason why it is no fault. The table is `peer_rules.txt`.

use super::faults_files::{BUILD, BUILD_FAULTS, GOOD_BUILD, GOOD_TERMINALS};
use super::faults_files::{TERMINAL_FAULTS, TERMINALS};
use super::{faults, faults_files, faults2, faults3, findings};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

const TABLE: &str = include_str!("peer_rules.txt");

/// A line of the table.
#[derive(Debug)]
struct Row<'a> {
    tool: &'a str,
    /// Where its faults are planted.
    corpus: &'a str,
    section: &'a str,
    what: &'a str,
    answer: Answer<'a>,
}

#[derive(Debug)]
enum Answer<'a> {
    /// Texts that a finding has, in one of the faults with that text in it.
    Found { parts: Vec<&'a str>, fault: &'a str },
    /// Why it is no fault.
    Reason(&'a str),
}

impl Row<'_> {
    /// Whether this is the finding of a fault.
    fn fits(&self, finding: &str) -> bool {
        let Answer::Found { parts, .. } = &self.answer else {
            return false;
        };
        let mut rest = finding;
        let has_parts = parts.iter().all(|part| match rest.split_once(part) {
            Some((_, after)) => {
                rest = after;
                true
            }
            None => false,
        });
        let section = format!("section {})", self.section);
        has_parts && (self.section.is_empty() || finding.contains(&section))
    }
}

/// The table, line by line.
fn rows() -> Vec<Row<'static>> {
    let (mut tool, mut corpus) = ("", "");
    let mut rows = Vec::new();
    for line in TABLE.lines() {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if let Some(heading) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            (tool, corpus) = heading.split_once(" | ").expect("a tool and a corpus");
            continue;
        }
        let mut cells = line.split(" | ").map(str::trim);
        let mut cell = || cells.next().unwrap_or_default();
        let (section, what, answer, fault) = (cell(), cell(), cell(), cell());
        let answer = match answer.strip_prefix("- ") {
            Some(reason) => Answer::Reason(reason),
            None => Answer::Found {
                parts: answer.split(" … ").collect(),
                fault,
            },
        };
        rows.push(Row {
            tool,
            corpus,
            section,
            what,
            answer,
        });
    }
    rows
}

/// A planted fault, as text, and its findings.
type Planted = (String, Vec<String>);

fn plant(good: &str, faults: &[(&str, &str)], find: impl Fn(&str) -> Vec<String>) -> Vec<Planted> {
    let planted = |(from, to): &(&str, &str)| {
        let found = find(&good.replace(from, to));
        (format!("{from} -> {to}"), found)
    };
    faults.iter().map(planted).collect()
}

/// All planted faults.
static CORPORA: LazyLock<BTreeMap<&'static str, Vec<Planted>>> = LazyLock::new(|| {
    let of_file = |file| move |xml: &str| faults_files::findings(file, xml);
    BTreeMap::from([
        (
            "FMI 2",
            plant(faults2::GOOD, faults2::FAULTS, findings::findings),
        ),
        (
            "FMI 3",
            plant(faults3::GOOD, faults3::FAULTS, findings::findings),
        ),
        (
            "terminalsAndIcons.xml",
            plant(GOOD_TERMINALS, TERMINAL_FAULTS, of_file(TERMINALS)),
        ),
        (
            "buildDescription.xml",
            plant(GOOD_BUILD, BUILD_FAULTS, of_file(BUILD)),
        ),
        // By name: `faults.rs` runs each of them and demands its finding.
        (
            "archives, files, binaries, behaviour",
            (faults::cases().into_iter())
                .map(|(name, _, finding)| (finding.to_owned(), vec![name.to_owned()]))
                .collect(),
        ),
    ])
});

/// The planted faults of `FMI 2` or `FMI 3`, counted from 1, with a finding that is a rule of that tool, too.
pub fn found_by_rules(tool: &str, corpus: &str) -> Vec<usize> {
    let rows: Vec<Row> = (rows().into_iter())
        .filter(|row| row.tool == tool && row.corpus == corpus)
        .collect();
    let is_found = |finding: &String| rows.iter().any(|row| row.fits(finding));
    (1..)
        .zip(&CORPORA[corpus])
        .filter(|(_, (_, findings))| findings.iter().any(is_found))
        .map(|(number, _)| number)
        .collect()
}

#[test]
fn each_check_of_the_others_has_a_planted_fault_that_is_found_or_a_reason() {
    let mut missing = Vec::new();
    for row in rows() {
        let is_complete = match &row.answer {
            Answer::Reason(reason) => reason.len() > 20,
            Answer::Found { parts, fault } => {
                let planted = &CORPORA[row.corpus];
                parts.iter().all(|part| !part.is_empty())
                    && (planted.iter())
                        .filter(|(text, _)| text.contains(fault))
                        .any(|(_, findings)| findings.iter().any(|finding| row.fits(finding)))
            }
        };
        if !is_complete {
            missing.push(format!("{row:?}"));
        }
    }
    assert!(missing.is_empty(), "\n{}", missing.join("\n"));
}

/// No check is listed twice, and as many as were found in the sources are there.
#[test]
fn the_table_is_whole() {
    let rows = rows();
    let mut counts = BTreeMap::<&str, (usize, usize)>::new();
    let mut seen = BTreeSet::new();
    for row in &rows {
        let is_new = seen.insert((row.tool, row.corpus, row.section, row.what));
        assert!(is_new, "twice: {row:?}");
        let (all, reasons) = counts.entry(row.tool).or_default();
        *all += 1;
        *reasons += usize::from(matches!(row.answer, Answer::Reason(_)));
    }
    // Of each tool: all checks, and those that are no faults by the standard.
    let counts: Vec<_> = counts.into_iter().collect();
    assert_eq!(
        counts,
        [
            ("FMI Library", (173, 6)),
            ("FMUComplianceChecker", (41, 2)),
            ("VDMCheck", (267, 9)),
        ]
    );
}
