//! Archives that would harm whoever unpacks them, or mean different things to different tools.

use crate::command::Folder;
use crate::foreign;
use pilotage::fmi::archive::{Archive, ArchiveError, DESCRIPTION, Limits};
use pilotage::fmi::{Fmu, FmuError};
use std::io::{Cursor, Write};
use tempfile::tempdir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

fn opened(content: &[u8], limits: Limits) -> Result<Archive, ArchiveError> {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.fmu");
    std::fs::write(&path, content).unwrap();
    Archive::open(&path, limits)
}

/// The message about an archive with the description and these files.
fn refused(names: &[&str]) -> String {
    let description = (DESCRIPTION, foreign::DESCRIPTION.as_bytes());
    let files: Vec<(&str, &[u8])> = (names.iter().map(|name| (*name, &b"x"[..])))
        .chain([description])
        .collect();
    refusal(&foreign::archive(&files), Limits::default())
}

fn refusal(content: &[u8], limits: Limits) -> String {
    let message = opened(content, limits).unwrap_err().to_string();
    let (_, after) = message.split_once("a.fmu").unwrap();
    after.trim_start_matches([':', ' ']).to_owned()
}

/// Replaces the first or last occurrence of some bytes by as many others.
fn patched(mut bytes: Vec<u8>, from: &[u8], to: &[u8], is_last: bool) -> Vec<u8> {
    let mut windows = bytes.windows(from.len());
    let place = match is_last {
        true => windows.rposition(|w| w == from),
        false => windows.position(|w| w == from),
    };
    let place = place.unwrap();
    bytes[place..place + to.len()].copy_from_slice(to);
    bytes
}

#[test]
fn names_that_are_one_file_somewhere_are_refused() {
    assert_eq!(
        refused(&["resources/a", "resources/A"]),
        "entries `resources/a` and `resources/A` differ by upper and lower case alone; rename one of them"
    );
    assert_eq!(
        refused(&["ModelDescription.xml"]),
        "entries `ModelDescription.xml` and `modelDescription.xml` differ by upper and lower case alone; rename one of them"
    );
    assert_eq!(
        refused(&["Resources/ä", "resources/Ä"]),
        "entries `Resources/ä` and `resources/Ä` differ by upper and lower case alone; rename one of them"
    );
    assert_eq!(
        refused(&["resources", "resources/a"]),
        "entry `resources` is a file, and `resources/a` would lie in it"
    );
    assert_eq!(
        refused(&["Resources/b/c", "resources/B"]),
        "entry `resources/B` is a file, and `Resources/b/c` would lie in it"
    );
    // Folders in two spellings are only odd.
    let folders = foreign::archive(&[
        (DESCRIPTION, foreign::DESCRIPTION.as_bytes()),
        ("Resources/a", b""),
        ("resources/b", b""),
    ]);
    assert!(opened(&folders, Limits::default()).is_ok());
}

#[test]
fn names_that_no_file_system_holds_are_refused() {
    let long = "a".repeat(256);
    let begin = "a".repeat(60);
    assert_eq!(
        refused(&[&long]),
        format!("the name of an entry has 256 bytes, more than the limit of 255: `{begin}...`")
    );
    let deep = "a/".repeat(1100) + "b";
    assert!(
        refused(&[&deep])
            .starts_with("the name of an entry has 2201 bytes, more than the limit of 2048")
    );
    assert_eq!(
        refused(&["resources/a\0b"]),
        "entry `resources/a\\0b` is not a file name"
    );
    assert_eq!(
        refused(&["resources/a", "./resources\\a"]),
        "entry `resources/a` is there twice"
    );
}

/// The foreign FMU in an archive whose entries are named by `rename`, the folder `first` before them.
fn renamed(first: &str, rename: fn(&str) -> String) -> Folder {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default();
    zip.add_directory(first, options).unwrap();
    let files = [
        (
            DESCRIPTION.to_owned(),
            foreign::DESCRIPTION.as_bytes().to_vec(),
        ),
        (foreign::binary_entry(), foreign::binary().to_vec()),
    ];
    for (name, content) in files {
        zip.start_file(rename(&name), options).unwrap();
        zip.write_all(&content).unwrap();
    }
    let folder = Folder::new();
    folder.write("a.fmu", zip.finish().unwrap().into_inner());
    folder
}

/// As some tools and scripts write them; what they mean is beyond doubt.
#[test]
fn paths_of_other_tools_are_read() {
    let dot = renamed("./", |name| format!("./{name}"));
    let backslash = renamed("binaries/", |name| name.replace('/', "\\"));
    let cosim = ["cosim", "a.fmu", "--stop-time", "1", "--step", "0.5"];
    for folder in [&dot, &backslash] {
        let info = folder.pilotage(&["info", "a.fmu", "--json"]);
        assert_eq!(info.code, 0, "{info:?}");
        let files = &info.json()["files"];
        assert_eq!(
            files,
            &serde_json::json!([DESCRIPTION, foreign::binary_entry()])
        );
        let run = folder.pilotage(&cosim);
        assert_eq!(run.code, 0, "{run:?}");
    }
    let judged = dot.pilotage(&["validate", "a.fmu"]);
    assert_eq!(judged.code, 0, "{judged:?}");
    let found =
        "warning: entry `./modelDescription.xml` has a `.` in its path, which some tools refuse";
    assert!(judged.stdout.contains(found), "{judged:?}");
    assert!(
        judged.stdout.starts_with("a.fmu: valid, and runs"),
        "{judged:?}"
    );
    let judged = backslash.pilotage(&["validate", "a.fmu", "--json"]);
    let verdict = judged.json()["fmus"][0].clone();
    assert_eq!(verdict["valid"], false);
    assert_eq!(verdict["run"], true, "what can be run is tried: {verdict}");
    let errors: Vec<&serde_json::Value> = (verdict["findings"].as_array().unwrap().iter())
        .filter(|finding| finding["severity"] == "error")
        .collect();
    assert_eq!(errors.len(), 1, "{errors:?}");
    let message = errors[0]["message"].as_str().unwrap();
    assert!(
        message.contains("has a backslash in its path"),
        "{errors:?}"
    );
}

#[test]
fn paths_of_other_tools_lead_nowhere_else() {
    for (name, why) in [
        (
            "..\\up",
            "leaves the archive's folder by `..`; nothing was unpacked",
        ),
        (
            "./../up",
            "leaves the archive's folder by `..`; nothing was unpacked",
        ),
        ("\\up", "has an absolute path; nothing was unpacked"),
        (".//up", "has an absolute path; nothing was unpacked"),
        ("./c:\\up", "has an absolute path; nothing was unpacked"),
    ] {
        assert_eq!(refused(&[name]), format!("entry `{name}` {why}"));
    }
}

// FMI rule 17: how an archive is stored.
#[test]
fn directory_and_entries_must_agree() {
    let names = [
        (DESCRIPTION, foreign::DESCRIPTION.as_bytes()),
        ("resources/good", b"x"),
    ];
    let archive = foreign::archive(&names);
    // The first occurrence is where the entry stands, the last one in the directory.
    let local = patched(archive.clone(), b"resources/good", b"../../../../up", false);
    assert_eq!(
        refusal(&local, Limits::default()),
        "entry `resources/good` has another name where it stands: `../../../../up`"
    );
    let central = patched(archive, b"resources/good", b"../../../../up", true);
    assert_eq!(
        refusal(&central, Limits::default()),
        "entry `../../../../up` leaves the archive's folder by `..`; nothing was unpacked"
    );
}

#[test]
fn what_is_larger_than_the_limits_is_refused_before_it_is_unpacked() {
    let archive = foreign::archive(&[
        (DESCRIPTION, foreign::DESCRIPTION.as_bytes()),
        ("resources/zeros", &vec![0; 1 << 20]),
    ]);
    assert!(archive.len() < 10_000, "a bomb of ratio 100");
    let limits = Limits {
        bytes: 1 << 20,
        ..Limits::default()
    };
    let bytes = (1 << 20) + foreign::DESCRIPTION.len();
    assert_eq!(
        refusal(&archive, limits),
        format!("would unpack to {bytes} bytes, more than the limit of 1048576")
    );
    let limits = Limits {
        entries: 1,
        ..Limits::default()
    };
    assert_eq!(
        refusal(&archive, limits),
        "has 2 entries, more than the limit of 1"
    );
    let limits = Limits {
        read: 1000,
        ..Limits::default()
    };
    let error = opened(&archive, limits)
        .unwrap()
        .read(DESCRIPTION)
        .unwrap_err();
    let found = foreign::DESCRIPTION.len();
    assert!(
        matches!(error, ArchiveError::EntryTooLarge { found: f, limit: 1000, .. } if f == found as u64)
    );
}

#[test]
fn damaged_data_are_named() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.fmu");
    let entry = foreign::binary_entry();
    let archive = foreign::archive(&[
        (DESCRIPTION, foreign::DESCRIPTION.as_bytes()),
        (&entry, b"no library at all"),
        ("resources/a", b"some text that is stored"),
    ]);
    // The checksum in the directory (at 16 of the entry's header, its name at 46).
    let mut bytes = archive;
    let name = bytes
        .windows(11)
        .rposition(|w| w == b"resources/a")
        .unwrap();
    bytes[name - 46 + 16] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let error = Fmu::open(&path).unwrap().load().unwrap_err();
    let FmuError::Archive(ArchiveError::Unreadable { entry, source, .. }) = error else {
        panic!("{error}");
    };
    assert_eq!(
        (entry.as_str(), source.to_string().as_str()),
        ("resources/a", "Invalid checksum")
    );
}

/// Sources may be hundreds of files, which nothing reads while the FMU runs (FMI 3.0.2, section 2.5).
#[test]
fn sources_and_documentation_are_not_unpacked() {
    let archive = foreign::archive(&[
        (DESCRIPTION, foreign::DESCRIPTION.as_bytes()),
        ("documentation/index.html", b"<p>"),
        ("resources/sources/a", b"1"),
        ("sources/model.c", b"int x;"),
        ("extra/b", b"2"),
    ]);
    let mut archive = opened(&archive, Limits::default()).unwrap();
    let unpacked = archive.unpack().unwrap();
    let is_there = |name: &str| unpacked.path().join(name).exists();
    assert!(
        [DESCRIPTION, "resources/sources/a", "extra/b"]
            .iter()
            .all(|name| is_there(name))
    );
    assert!(!is_there("documentation") && !is_there("sources"));
}

#[test]
fn an_fmu_of_version_1_is_named_so() {
    let xml = foreign::DESCRIPTION.replace("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\"");
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.fmu");
    std::fs::write(&path, foreign::fmu_of(&xml, b"")).unwrap();
    let error = Fmu::open(&path).unwrap_err();
    let mut text = error.to_string();
    let mut source = std::error::Error::source(&error);
    while let Some(cause) = source {
        text += &format!(": {cause}");
        source = cause.source();
    }
    assert!(text.contains("FMI 1.0 is not supported"), "{text}");
}
