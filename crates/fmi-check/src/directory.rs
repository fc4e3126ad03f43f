//! The zip directory as stored in the file (PKWARE APPNOTE 6.3, sections 4.3 and 4.4), to list all its faults. For
//! reading, the archive is opened by [`Archive`](pilotage_fmi::archive).

use super::{Finding, Rule};
use pilotage_fmi::archive::{DESCRIPTION, NameFault, name_fault, plain_name};
use pilotage_fmi::description::FmiVersion;
use std::collections::HashMap;

/// An entry of the central directory.
struct Entry {
    name: String,
    is_text: bool,
    made_by: u16,
    needed: u16,
    flags: u16,
    method: u16,
    disk: u16,
    attributes: u32,
    /// The name in the local header; `None` if there is no such header.
    local: Option<Vec<u8>>,
    raw: Vec<u8>,
}

/// All findings about the archive's entries; empty if it has no directory, which
/// [`Archive::open`](pilotage_fmi::archive::Archive::open) reports.
pub(super) fn check(bytes: &[u8], version: Option<FmiVersion>) -> Vec<Finding> {
    let Some(entries) = read(bytes) else {
        return Vec::new();
    };
    // FMI 3.0 allows the features of ISO/IEC 21320-1, including Zip64; FMI 2.0 does not.
    let allowed = match version {
        Some(FmiVersion::V3) => 45,
        _ => 20,
    };
    let mut rules: Vec<Rule> = Vec::new();
    for entry in &entries {
        rules.extend(names(entry));
        rules.extend(storage(entry, allowed));
    }
    if entries.iter().any(|e| e.disk != 0) {
        rules.push(Rule::Split);
    }
    rules.extend(duplicates(&entries));
    rules.extend(description(&entries));
    (rules.into_iter())
        .map(|rule| Finding::archive(version, rule))
        .collect()
}

/// Checks that the entry's name is a plain relative path.
fn names(entry: &Entry) -> Option<Rule> {
    let name = entry.name.clone();
    let plain = plain_name(&name);
    match name_fault(&plain) {
        Some(NameFault::Traversal) => Some(Rule::Traversal { entry: name }),
        Some(NameFault::Absolute) => Some(Rule::Absolute { entry: name }),
        Some(NameFault::Odd) => Some(Rule::BadName { entry: name }),
        None if name.contains('\\') => Some(Rule::Backslash { entry: name }),
        None if plain != name => Some(Rule::Dot { entry: name }),
        None if !entry.is_text => Some(Rule::NotUtf8 { entry: name }),
        None => None,
    }
}

/// Checks how the entry is stored.
fn storage(entry: &Entry, allowed: u16) -> Vec<Rule> {
    const LINK: u32 = 0o120_000;
    const KIND: u32 = 0o170_000;
    const UNIX: u16 = 3;
    let name = || entry.name.clone();
    let mut rules = Vec::new();
    if entry.flags & 1 != 0 {
        rules.push(Rule::Encrypted { entry: name() });
    }
    if !matches!(entry.method, 0 | 8) {
        rules.push(Rule::Method {
            entry: name(),
            method: entry.method,
        });
    } else if entry.needed & 0xff > allowed {
        rules.push(Rule::Version {
            entry: name(),
            needed: entry.needed & 0xff,
            allowed,
        });
    }
    if entry.made_by >> 8 == UNIX && entry.attributes >> 16 & KIND == LINK {
        rules.push(Rule::Link { entry: name() });
    }
    if let Some(local) = entry.local.as_ref().filter(|local| **local != entry.raw) {
        rules.push(Rule::LocalName {
            entry: name(),
            local: String::from_utf8_lossy(local).into_owned(),
        });
    }
    rules
}

fn duplicates(entries: &[Entry]) -> Vec<Rule> {
    let mut seen: HashMap<String, String> = HashMap::new();
    let mut rules = Vec::new();
    for entry in entries {
        let name = plain_name(&entry.name);
        let name = name.trim_end_matches('/').to_owned();
        match seen.insert(name.to_lowercase(), name.clone()) {
            Some(first) if first == name => rules.push(Rule::Duplicate { entry: name }),
            Some(first) => rules.push(Rule::CaseDuplicate {
                first,
                second: name,
            }),
            None => {}
        }
    }
    rules
}

/// Checks that the description is in the right place; if not, reports where it is.
fn description(entries: &[Entry]) -> Option<Rule> {
    let plain: Vec<String> = entries.iter().map(|e| plain_name(&e.name)).collect();
    let mut names = plain.iter().map(String::as_str);
    if names.clone().any(|name| name == DESCRIPTION) {
        return None;
    }
    if let Some(found) = names.clone().find(|n| n.eq_ignore_ascii_case(DESCRIPTION)) {
        return Some(Rule::DescriptionCase {
            found: found.to_owned(),
        });
    }
    let folder = names.find_map(|name| name.strip_suffix(DESCRIPTION)?.strip_suffix('/'));
    Some(match folder {
        Some(folder) => Rule::Nested {
            folder: folder.to_owned(),
        },
        None => Rule::NoDescription,
    })
}

/// Little-endian numbers at offsets in a record.
struct Record<'a>(&'a [u8]);

impl Record<'_> {
    fn u16(&self, at: usize) -> Option<u16> {
        let bytes = self.0.get(at..at + 2)?;
        Some(u16::from_le_bytes(bytes.try_into().ok()?))
    }

    fn u32(&self, at: usize) -> Option<u32> {
        let bytes = self.0.get(at..at + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    }

    fn length(&self, at: usize) -> Option<usize> {
        self.u16(at).map(usize::from)
    }
}

/// The entries of the central directory; `None` if there is none.
fn read(bytes: &[u8]) -> Option<Vec<Entry>> {
    const END: &[u8] = b"PK\x05\x06";
    const HEADER: &[u8] = b"PK\x01\x02";
    const END_SIZE: usize = 22;
    // The end record comes last, followed only by a comment of at most 65,535 bytes.
    let last = bytes.len().checked_sub(END_SIZE)?;
    let first = last.saturating_sub(usize::from(u16::MAX));
    let end = (first..=last)
        .rev()
        .find(|&at| bytes[at..].starts_with(END))?;
    let end = Record(&bytes[end..]);
    let mut rest = bytes.get(usize::try_from(end.u32(16)?).ok()?..)?;
    let mut entries = Vec::new();
    while rest.starts_with(HEADER) {
        let record = Record(rest);
        let (name, extra, comment) = (record.length(28)?, record.length(30)?, record.length(32)?);
        let raw = rest.get(46..46 + name)?.to_vec();
        let flags = record.u16(8)?;
        let is_utf8 = flags & 1 << 11 != 0;
        entries.push(Entry {
            name: String::from_utf8_lossy(&raw).into_owned(),
            is_text: raw.is_ascii() || (is_utf8 && std::str::from_utf8(&raw).is_ok()),
            made_by: record.u16(4)?,
            needed: record.u16(6)?,
            flags,
            method: record.u16(10)?,
            disk: record.u16(34)?,
            attributes: record.u32(38)?,
            local: local_name(bytes, record.u32(42)?),
            raw,
        });
        rest = rest.get(46 + name + extra + comment..)?;
    }
    (!entries.is_empty()).then_some(entries)
}

/// The name in the local header at that offset.
fn local_name(bytes: &[u8], offset: u32) -> Option<Vec<u8>> {
    let header = bytes.get(usize::try_from(offset).ok()?..)?;
    let length = Record(header).length(26)?;
    let is_header = header.starts_with(b"PK\x03\x04");
    is_header
        .then(|| header.get(30..30 + length).map(<[u8]>::to_vec))
        .flatten()
}
