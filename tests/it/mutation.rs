//! Mutations of descriptions and archives, and what they are fed to. `benches/fuzz.rs` uses this too, for hours.

use pilotage::fmi::Fmu;
use pilotage::fmi::archive::{Archive, Limits};
use pilotage::fmi::description::read;
use pilotage::fmi_check::validate;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use std::io::{Cursor, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Pieces of XML, numbers and names that readers stumble over.
const TOKENS: &[&str] = &[
    "",
    " ",
    "0",
    "-1",
    "1e999",
    "-1e-999",
    "NaN",
    "INF",
    "-INF",
    "inf",
    "0x10",
    "1_0",
    "+1",
    "1.",
    ".5",
    "--1",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "18446744073709551616",
    "-9223372036854775809",
    "1 2 3",
    "true",
    "false",
    "TRUE",
    "2.0",
    "3.0",
    "1.0",
    "3.0-beta",
    "\"",
    "'",
    "<",
    ">",
    "/>",
    "</",
    "&",
    "&amp;",
    "&#0;",
    "&#x10FFFF;",
    "&#xD800;",
    "&nbsp;",
    "<!--",
    "-->",
    "<![CDATA[",
    "]]>",
    "<?xml version=\"1.1\"?>",
    "<?x ",
    "<!DOCTYPE a [<!ENTITY b \"&b;&b;\">]>",
    "xmlns=\"a\"",
    "xmlns:b=\"c\"",
    "b:",
    "\u{feff}",
    "\u{0}",
    "\u{7f}",
    "ä",
    "\u{202e}",
    "𝕏",
    "der(",
    "der(der(x))",
    "a[0]",
    "a[1,1]",
    "'a b'",
    "..",
    "%s%n",
    "name=\"u\"",
    "valueReference=\"0\"",
    "index=\"1\"",
    "start=\"\"",
    "dependencies=\"\"",
    "dependencies=\"1 2 3 4 5 6 7 8 9\"",
    "declaredType=\"\"",
    "unit=\"m\"",
    "derivative=\"1\"",
    "causality=\"input\"",
    "variability=\"constant\"",
    "initial=\"exact\"",
    "<Real/>",
    "<Float64/>",
    "<Dimension start=\"0\"/>",
    "<Dimension valueReference=\"1\"/>",
    "<Dimension start=\"18446744073709551615\"/>",
    "<Unknown index=\"0\"/>",
    "<Unknown/>",
    "<Clock/>",
    "<Binary/>",
    "<Start value=\"0\"/>",
    "<Start/>",
    "<Alias name=\"x\"/>",
    "<ModelVariables>",
    "</ModelVariables>",
    "PK\u{1}\u{2}",
    "PK\u{3}\u{4}",
    "PK\u{5}\u{6}",
    "../",
    "C:",
    "\\",
];

/// A source of mutations, the same for the same seed.
pub struct Mutator(pub ChaCha8Rng);

impl Mutator {
    fn below(&mut self, end: usize) -> usize {
        match end {
            0 => 0,
            _ => (self.0.next_u64() % end as u64) as usize,
        }
    }

    fn range(&mut self, len: usize) -> Range<usize> {
        let start = self.below(len + 1);
        // Mostly short, sometimes as long as may be.
        let longest = match self.below(8) {
            0 => len - start,
            _ => (len - start).min(40),
        };
        start..start + self.below(longest + 1)
    }

    /// One to six mutations: of bytes, some with parts of `other`; or, half of the time, such as leave XML
    /// well-formed.
    pub fn mutate(&mut self, bytes: &mut Vec<u8>, other: &[u8]) {
        let is_rough = self.below(2) == 0;
        for _ in 0..=self.below(6) {
            match is_rough {
                true => self.once(bytes, other),
                false => self.tidily(bytes, other),
            }
            // Repetitions of repetitions would only fill the memory.
            bytes.truncate(1 << 20);
        }
    }

    fn once(&mut self, bytes: &mut Vec<u8>, other: &[u8]) {
        let range = self.range(bytes.len());
        match self.below(8) {
            0 => {
                let at = self.below(bytes.len());
                let bit = 1 << self.below(8);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= bit;
                }
            }
            1 => {
                let random: Vec<u8> = (0..self.below(8))
                    .map(|_| self.0.next_u32() as u8)
                    .collect();
                bytes.splice(range.start..range.start, random);
            }
            2 => drop(bytes.drain(range)),
            3 => {
                let copy = bytes[range].to_vec();
                let at = self.below(bytes.len() + 1);
                bytes.splice(at..at, copy);
            }
            4 => {
                let copy = bytes[range.clone()].to_vec();
                let times = 1 << self.below(11);
                bytes.splice(range, copy.repeat(times));
            }
            5 => {
                let from = self.range(other.len());
                bytes.splice(range, other[from].to_vec());
            }
            6 => {
                let token = TOKENS[self.below(TOKENS.len())];
                bytes.splice(range.start..range.start, token.bytes());
            }
            _ => self.tidily(bytes, other),
        }
    }

    /// Values between quotes and whole lines.
    fn tidily(&mut self, bytes: &mut Vec<u8>, other: &[u8]) {
        let (from, to) = (self.below(bytes.len()), self.below(bytes.len()));
        match self.below(5) {
            0 | 1 => {
                if let Some(value) = quoted(bytes, to) {
                    let token = TOKENS[self.below(TOKENS.len())];
                    bytes.splice(value, token.bytes());
                }
            }
            2 => {
                // One value in the place of another one.
                if let (Some(from), Some(to)) = (quoted(bytes, from), quoted(bytes, to)) {
                    let copy = bytes[from].to_vec();
                    bytes.splice(to, copy);
                }
            }
            3 => {
                let line = line(bytes, from);
                bytes.drain(line);
            }
            _ => {
                let at = self.below(other.len());
                let copy = match self.below(2) {
                    0 => bytes[line(bytes, from)].to_vec(),
                    _ => other[line(other, at)].to_vec(),
                };
                let end = line(bytes, to).end;
                bytes.splice(end..end, copy);
            }
        }
    }

    /// Changes numbers in the headers of an archive.
    pub fn mutate_archive(&mut self, bytes: &mut [u8]) {
        let signatures: Vec<usize> = (bytes.windows(2).enumerate())
            .filter(|(_, w)| *w == b"PK")
            .map(|(at, _)| at)
            .collect();
        for _ in 0..=self.below(3) {
            let header = signatures[self.below(signatures.len())];
            let at = (header + 4 + self.below(46)).min(bytes.len() - 1);
            bytes[at] = match self.below(4) {
                0 => 0,
                1 => 0xff,
                2 => bytes[at] ^ (1 << self.below(8)),
                _ => self.0.next_u32() as u8,
            };
        }
    }
}

/// The text between the next quotes after a place.
fn quoted(bytes: &[u8], from: usize) -> Option<Range<usize>> {
    let next = |from: usize| Some(from + bytes.get(from..)?.iter().position(|&b| b == b'"')?);
    let start = next(from)? + 1;
    Some(start..next(start)?)
}

/// The line that holds a place, with its end.
fn line(bytes: &[u8], at: usize) -> Range<usize> {
    let is_end = |byte: &u8| *byte == b'\n';
    let start = bytes[..at]
        .iter()
        .rposition(is_end)
        .map_or(0, |end| end + 1);
    let end = bytes[at..].iter().position(is_end);
    start..end.map_or(bytes.len(), |end| at + end + 1)
}

/// An FMU around a description, without a binary that could be loaded.
pub fn archive_of(description: &[u8]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let files: [(&str, &[u8], _); 4] = [
        (
            "modelDescription.xml",
            description,
            SimpleFileOptions::default(),
        ),
        ("binaries/linux64/m.so", b"\x7fELF no library", stored),
        ("resources/table.txt", b"1 2 3", stored),
        (
            "documentation/index.html",
            b"<html/>",
            SimpleFileOptions::default(),
        ),
    ];
    for (name, content, options) in files {
        zip.start_file(name, options).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// How far an input came: not at all, read, usable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Depth {
    Refused,
    Read,
    Usable,
}

/// Reads and checks a description. Whatever it is, nothing may panic.
pub fn try_description(bytes: &[u8]) -> Depth {
    let Ok(reading) = read(bytes) else {
        return Depth::Refused;
    };
    let findings = validate(&reading);
    findings
        .iter()
        .for_each(|finding| drop(finding.to_string()));
    match reading.into_usable() {
        Ok(_) => Depth::Usable,
        Err(_) => Depth::Read,
    }
}

/// Opens and unpacks an archive in `folder`, which is otherwise empty; nothing may be written beside the place
/// that unpacking makes for itself.
pub fn try_archive(bytes: &[u8], folder: &Path) -> Depth {
    let path = folder.join("a.fmu");
    std::fs::write(&path, bytes).unwrap();
    let limits = Limits {
        bytes: 16 << 20,
        ..Limits::default()
    };
    let depth = match Archive::open(&path, limits) {
        Err(_) => Depth::Refused,
        Ok(mut archive) => match archive.unpack() {
            Err(_) => Depth::Read,
            Ok(unpacked) => {
                let inside = unpacked.path().canonicalize().unwrap();
                // Two folders are left out.
                let is_at_rest = |name: &&str| {
                    ["sources/", "documentation/"]
                        .iter()
                        .any(|folder| name.starts_with(folder))
                };
                let names = archive.files().filter(|name| !is_at_rest(name));
                for name in names.map(|name| inside.join(name)) {
                    assert!(
                        name.canonicalize().unwrap().starts_with(&inside),
                        "{name:?}"
                    );
                }
                Depth::Usable
            }
        },
    };
    // A whole FMU; its binary is none that could be loaded.
    if let Ok(mut fmu) = Fmu::open(&path) {
        assert!(fmu.load().is_err());
    }
    let beside = std::fs::read_dir(folder).unwrap().count();
    assert_eq!(beside, 1, "something was written beside the archive");
    depth
}

/// The kept descriptions, by name.
pub fn corpus() -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let read = |path: PathBuf| (name(&path), std::fs::read(&path).unwrap());
    paths.into_iter().map(read).collect()
}
