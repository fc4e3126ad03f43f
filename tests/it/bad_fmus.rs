//! Broken FMUs: the exact message and exit code of each, through the command line.

use crate::command::{Ended, Folder};
use crate::foreign::{self, DESCRIPTION, archive, binary_entry, fmu_of};
use pilotage::fmi::platform;

/// A good FMU.
fn good() -> Vec<u8> {
    foreign::fmu("good")
}

/// The good description with one replacement.
fn with(from: &str, to: &str) -> Vec<u8> {
    assert_eq!(DESCRIPTION.matches(from).count(), 1, "{from}");
    fmu_of(&DESCRIPTION.replace(from, to), foreign::binary())
}

/// Bytes with every occurrence of some bytes replaced by as many others.
fn patched(mut bytes: Vec<u8>, from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let places: Vec<usize> = (0..bytes.len() - from.len())
        .filter(|&at| bytes[at..].starts_with(from))
        .collect();
    assert!(!places.is_empty());
    for at in places {
        bytes[at..at + to.len()].copy_from_slice(to);
    }
    bytes
}

/// An archive of a description and a file, whose name is then replaced by another one.
fn with_entry(name: &str) -> Vec<u8> {
    let placeholder = "x".repeat(name.len());
    let files = [
        ("modelDescription.xml", DESCRIPTION.as_bytes()),
        (&placeholder, b"evil"),
    ];
    patched(archive(&files), placeholder.as_bytes(), name.as_bytes())
}

/// A number in the first entry of the central directory, changed. The entry is the description.
fn with_field(mut bytes: Vec<u8>, at: usize, value: &[u8]) -> Vec<u8> {
    let entry = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    bytes[entry + at..entry + at + value.len()].copy_from_slice(value);
    bytes
}

fn with_link() -> Vec<u8> {
    use zip::write::SimpleFileOptions;
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default();
    zip.add_symlink("resources", "/etc", options).unwrap();
    zip.finish().unwrap().into_inner()
}

/// Runs a command on `a.fmu` with that content.
fn run(content: &[u8], arguments: &[&str]) -> Ended {
    let folder = Folder::new();
    folder.write("a.fmu", content);
    folder.pilotage(arguments)
}

const INFO: [&str; 2] = ["info", "a.fmu"];
const COSIM: [&str; 6] = ["cosim", "a.fmu", "--stop-time", "1", "--step", "0.1"];

fn refused(arguments: &[&str], cases: &[(&str, Vec<u8>, &str)]) {
    for (what, content, message) in cases {
        let ended = run(content, arguments);
        assert_eq!(ended.stderr, format!("error: {message}\n"), "{what}");
        assert_eq!((ended.code, ended.stdout.as_str()), (2, ""), "{what}");
    }
}

#[test]
fn archives() {
    let cases = [
        (
            "empty",
            vec![],
            "a.fmu is no zip archive, or a damaged one (copy it again, or name another file): invalid Zip archive: Could not find EOCD",
        ),
        (
            "text",
            b"hello".repeat(100).to_vec(),
            "a.fmu is no zip archive, or a damaged one (copy it again, or name another file): invalid Zip archive: Could not find EOCD",
        ),
        (
            "cut short",
            {
                let mut b = good();
                b.truncate(1000);
                b
            },
            "a.fmu is no zip archive, or a damaged one (copy it again, or name another file): invalid Zip archive: Could not find EOCD",
        ),
        (
            "traversal",
            with_entry("../evil"),
            "a.fmu: entry `../evil` leaves the archive's folder by `..`; nothing was unpacked",
        ),
        (
            "traversal inside",
            with_entry("resources/../../evil"),
            "a.fmu: entry `resources/../../evil` leaves the archive's folder by `..`; nothing was unpacked",
        ),
        (
            "absolute",
            with_entry("/tmp/evil"),
            "a.fmu: entry `/tmp/evil` has an absolute path; nothing was unpacked",
        ),
        (
            "drive",
            with_entry("C:evil"),
            "a.fmu: entry `C:evil` has an absolute path; nothing was unpacked",
        ),
        (
            "backslash",
            with_entry("..\\evil"),
            "a.fmu: entry `..\\evil` leaves the archive's folder by `..`; nothing was unpacked",
        ),
        (
            "control character",
            with_entry("resources/a\nb"),
            "a.fmu: entry `resources/a\\nb` is not a file name",
        ),
        (
            "empty part",
            with_entry("resources//a"),
            "a.fmu: entry `resources//a` is not a file name",
        ),
        (
            "link",
            with_link(),
            "a.fmu: entry `resources` is a link; nothing was unpacked",
        ),
        (
            "duplicate",
            with_entry("modelDescription.xml"),
            "a.fmu: entry `modelDescription.xml` is there twice",
        ),
        (
            "bomb by its own word",
            with_field(
                archive(&[("modelDescription.xml", DESCRIPTION.as_bytes())]),
                24,
                &0xffff_fff0_u32.to_le_bytes(),
            ),
            "a.fmu would unpack to 4294967280 bytes, more than the limit of 2147483648",
        ),
        (
            "another method",
            with_field(good(), 10, &12u16.to_le_bytes()),
            "a.fmu: entry `modelDescription.xml` is compressed by Bzip2; the standard allows `deflate` and `store`",
        ),
        (
            "encrypted",
            with_field(good(), 8, &1u16.to_le_bytes()),
            "a.fmu: entry `modelDescription.xml` is encrypted; FMUs must not be",
        ),
        (
            "more than declared",
            with_field(good(), 24, &100u32.to_le_bytes()),
            "a.fmu: entry `modelDescription.xml` cannot be unpacked: File is larger than its declared uncompressed size",
        ),
        (
            "damaged",
            with_field(good(), 16, &0u32.to_le_bytes()),
            "a.fmu: entry `modelDescription.xml` cannot be unpacked: Invalid checksum",
        ),
        (
            "no description",
            archive(&[("resources/a", b"")]),
            "a.fmu has no modelDescription.xml: it is not an FMU",
        ),
        (
            "description in a folder",
            archive(&[("model/modelDescription.xml", DESCRIPTION.as_bytes())]),
            "a.fmu has no modelDescription.xml: it is not an FMU",
        ),
    ];
    refused(&INFO, &cases);
}

#[test]
fn descriptions() {
    let xml = |text: &str| archive(&[("modelDescription.xml", text.as_bytes())]);
    let cases = [
        (
            "empty",
            xml(""),
            "a.fmu: modelDescription.xml is not well-formed XML: the document does not have a root node",
        ),
        (
            "not well-formed",
            with("</ModelVariables>", ""),
            "a.fmu: modelDescription.xml is not well-formed XML: expected 'ModelVariables' tag, not 'fmiModelDescription' at 42:1",
        ),
        (
            "unclosed",
            xml(&DESCRIPTION[..DESCRIPTION.len() / 2]),
            "a.fmu: modelDescription.xml is not well-formed XML: unexpected end of stream",
        ),
        (
            "document type",
            with(
                "<fmiModelDescription",
                "<!DOCTYPE x [<!ENTITY e \"e\">]>\n<fmiModelDescription",
            ),
            "a.fmu: modelDescription.xml is not well-formed XML: XML with DTD detected",
        ),
        (
            "unknown entity",
            with("modelName=\"foreign\"", "modelName=\"&nbsp;\""),
            "a.fmu: modelDescription.xml is not well-formed XML: unknown entity reference 'nbsp' at 2:50",
        ),
        (
            "attribute twice",
            with("modelName=\"foreign\"", "modelName=\"a\" modelName=\"b\""),
            "a.fmu: modelDescription.xml is not well-formed XML: attribute 'modelName' at 2:53 is already defined",
        ),
        (
            "another root",
            xml("<SystemStructureDescription/>"),
            "a.fmu: modelDescription.xml, line 1, column 1: the root element is <SystemStructureDescription>, expected <fmiModelDescription>",
        ),
        (
            "FMI 1",
            with("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\""),
            "a.fmu: FMI 1.0 is not supported: export the model as FMI 2.0 or FMI 3.0",
        ),
        (
            "FMI 3",
            with("fmiVersion=\"2.0\"", "fmiVersion=\"4.0\""),
            "a.fmu: this is an FMU of FMI 4.0; FMI 2.0 and FMI 3.0 can be used",
        ),
        (
            "no version",
            with("fmiVersion=\"2.0\" ", ""),
            "a.fmu: modelDescription.xml, line 2, column 1: <fmiModelDescription> lacks the attribute `fmiVersion`",
        ),
        (
            "no guid",
            with(" guid=\"good\"", ""),
            "a.fmu: modelDescription.xml, line 2, column 1: <fmiModelDescription> lacks the attribute `guid`",
        ),
        (
            "no identifier",
            with("modelIdentifier=\"foreign\" ", ""),
            "a.fmu: modelDescription.xml, line 3, column 3: <CoSimulation> lacks the attribute `modelIdentifier`",
        ),
        (
            "bad flag",
            with(
                "canGetAndSetFMUstate=\"true\"",
                "canGetAndSetFMUstate=\"yes\"",
            ),
            "a.fmu: modelDescription.xml, line 3, column 89: <CoSimulation> has canGetAndSetFMUstate=\"yes\", expected true or false",
        ),
        (
            "no reference",
            with("name=\"k\" valueReference=\"2\"", "name=\"k\""),
            "a.fmu: modelDescription.xml, line 15, column 5: <ScalarVariable> lacks the attribute `valueReference`",
        ),
        (
            "bad reference",
            with(
                "name=\"k\" valueReference=\"2\"",
                "name=\"k\" valueReference=\"-1\"",
            ),
            "a.fmu: modelDescription.xml, line 15, column 30: <ScalarVariable> has valueReference=\"-1\", expected an unsigned 32-bit integer",
        ),
        (
            "bad causality",
            with(
                "name=\"u\" valueReference=\"0\" causality=\"input\"",
                "name=\"u\" valueReference=\"0\" causality=\"Input\"",
            ),
            "a.fmu: modelDescription.xml, line 13, column 49: <ScalarVariable> has causality=\"Input\", expected parameter, calculatedParameter, input, output, local or independent",
        ),
        (
            "bad type",
            with(
                "<Integer start=\"0\"/></ScalarVariable>\n    <ScalarVariable name=\"n\"",
                "<Int32 start=\"0\"/></ScalarVariable>\n    <ScalarVariable name=\"n\"",
            ),
            "a.fmu: modelDescription.xml, line 19, column 5: <ScalarVariable> lacks the element <Real|Integer|Boolean|String|Enumeration>",
        ),
        (
            "bad start",
            with(
                "<Real unit=\"1/s\" start=\"1\"/>",
                "<Real unit=\"1/s\" start=\"1,5\"/>",
            ),
            "a.fmu: modelDescription.xml, line 15, column 108: <Real> has start=\"1,5\", expected a number (xs:double)",
        ),
        (
            "bad index",
            with("index=\"12\"", "index=\"twelve\""),
            "a.fmu: modelDescription.xml, line 34, column 16: <Unknown> has index=\"twelve\", expected an unsigned 32-bit integer",
        ),
        (
            "no structure",
            xml(
                &(DESCRIPTION[..DESCRIPTION.find("<ModelStructure>").unwrap()].to_owned()
                    + "</fmiModelDescription>"),
            ),
            "a.fmu: modelDescription.xml, line 2, column 1: <fmiModelDescription> lacks the element <ModelStructure>",
        ),
        (
            "not UTF-8",
            archive(&[(
                "modelDescription.xml",
                &[DESCRIPTION.as_bytes(), b"<!-- \xff -->"].concat(),
            )]),
            "a.fmu: modelDescription.xml, line 43: byte 0xff is not UTF-8; save the file as UTF-8",
        ),
    ];
    refused(&INFO, &cases);
}

#[test]
fn binaries() {
    let machine = platform::folders().join(", ");
    let entry = binary_entry();
    let binary = foreign::binary();
    let with_binary = |binary: &[u8]| fmu_of(DESCRIPTION, binary);
    let no_platform =
        format!("a.fmu has no binary for this machine (looked in {machine}); it has win99");
    let no_binaries =
        format!("a.fmu has no binary for this machine (looked in {machine}); it has none");
    let other = entry.replace("foreign.", "other.");
    let other_name = other.rsplit('/').next().unwrap();
    let no_library = format!(
        "a.fmu has no `{entry}`, which modelIdentifier=\"foreign\" names; beside it are {other_name}"
    );
    let xml = ("modelDescription.xml", DESCRIPTION.as_bytes());
    let at = format!("a.fmu: `{entry}` cannot be");
    let cases = [
        ("no function of model exchange", with("<CoSimulation modelIdentifier=\"foreign\" canHandleVariableCommunicationStepSize=\"true\"", "<ModelExchange modelIdentifier=\"foreign\""), format!("a.fmu: `{entry}` cannot be used: it has no function `fmi2NewDiscreteStates`")),
        ("another platform", archive(&[xml, ("binaries/win99/foreign.dll", b"")]), no_platform),
        ("no binaries", archive(&[xml]), no_binaries),
        ("another name", archive(&[xml, (&other, binary)]), no_library),
        ("no fmi2DoStep", with_binary(foreign::binary_without_do_step()), format!("{at} used: it has no function `fmi2DoStep`")),
        ("FMI 3.0", with_binary(foreign::binary_of_fmi3()), format!("{at} used: its FMI version is \"3.0\", expected \"2.0\"")),
        ("wrong guid", foreign::fmu("another!"), "a.fmu: fmi2Instantiate refused: the guid is wrong".to_owned()),
        ("no license", foreign::fmu("refuse"), "a.fmu: fmi2Instantiate refused: no license for 100 % of this model".to_owned()),
        ("no initial values", foreign::fmu("error-in-initialization"), "`a` failed to leave initialization: fmi2ExitInitializationMode returned fmi2Error: no initial values found".to_owned()),
    ];
    for (what, content, message) in cases {
        refused(&COSIM, &[(what, content, &message)]);
    }
    let elsewhere = archive(&[xml, ("binaries/win99/foreign.dll", b"")]);
    let told = run(&elsewhere, &INFO).stdout;
    let machine = platform::folders().join(" or ");
    let expected = format!("win99; none for this machine, which is {machine}\n");
    assert!(told.contains(&expected), "{told}");
}

/// Files that are no libraries, or not of this machine.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libraries_that_cannot_be_loaded() {
    let with_binary = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut binary = foreign::binary().to_vec();
        change(&mut binary);
        fmu_of(DESCRIPTION, &binary)
    };
    let at = format!("a.fmu: `{}` cannot be loaded: ", binary_entry());
    let binary = foreign::binary();
    // e_type and e_machine of ELF are at 16 and 18.
    let cases = [
        (
            "empty file",
            fmu_of(DESCRIPTION, b""),
            "it is not a shared library: Could not read file magic",
        ),
        (
            "text",
            fmu_of(DESCRIPTION, b"#!/bin/sh\necho I am no library\n"),
            "it is not a shared library: Unknown file magic",
        ),
        (
            "cut short",
            fmu_of(DESCRIPTION, &binary[..binary.len() / 2]),
            "it is not a shared library: Invalid ELF section header offset/size/alignment",
        ),
        (
            "cut in its header",
            fmu_of(DESCRIPTION, &binary[..40]),
            "it is not a shared library: Invalid ELF header size or alignment",
        ),
        (
            "ARM",
            with_binary(&|b| b[18] = 183),
            "it is made for Aarch64, this process runs on X86_64",
        ),
        (
            "an executable",
            with_binary(&|b| b[16] = 2),
            "it is an object of kind Executable, not a shared library",
        ),
        (
            "an object",
            with_binary(&|b| b[16] = 1),
            "it is an object of kind Relocatable, not a shared library",
        ),
        (
            "Windows",
            fmu_of(DESCRIPTION, &dll()),
            "it is a library in Pe format, this machine loads Elf",
        ),
    ];
    for (what, content, message) in cases {
        refused(&COSIM, &[(what, content, &format!("{at}{message}"))]);
    }
}

/// A library whose segments lie beyond its end would crash when it is loaded.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_library_without_its_end() {
    let mut binary = foreign::binary().to_vec();
    // No sections, which would show that the end is missing: e_shoff at 40, e_shnum and e_shstrndx
    // at 60.
    binary[40..48].fill(0);
    binary[60..64].fill(0);
    binary.truncate(binary.len() / 2);
    let ended = run(&fmu_of(DESCRIPTION, &binary), &COSIM);
    let expected = format!(
        "error: a.fmu: `{}` cannot be loaded: it is cut short: {} bytes of at least ",
        binary_entry(),
        binary.len()
    );
    assert!(ended.stderr.starts_with(&expected), "{}", ended.stderr);
    assert_eq!(ended.code, 2);
}

/// Addresses in the dynamic section that the loader would follow.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_library_whose_dynamic_section_points_to_nowhere() {
    let good = foreign::binary();
    let at = |at: usize| u64::from_le_bytes(good[at..at + 8].try_into().unwrap());
    // Program headers of 56 bytes from e_phoff on, e_phnum of them; PT_DYNAMIC is 2.
    let headers = (0..usize::from(good[56])).map(|k| at(32) as usize + 56 * k);
    let header = headers.into_iter().find(|own| good[*own] == 2).unwrap();
    let (begin, length) = (at(header + 8) as usize, at(header + 32) as usize);
    let entries = (begin..begin + length).step_by(16);
    let entries: Vec<usize> = entries.take_while(|own| at(*own) != 0).collect();
    // DT_NEEDED, DT_HASH, DT_STRTAB, DT_SYMTAB, DT_RELA, DT_STRSZ, DT_INIT, DT_FINI, DT_JMPREL, DT_INIT_ARRAY,
    // DT_FINI_ARRAY, DT_GNU_HASH, DT_VERSYM, DT_VERNEED.
    let followed = [
        1,
        4,
        5,
        6,
        7,
        10,
        12,
        13,
        23,
        25,
        26,
        0x6fff_fef5,
        0x6fff_fff0,
        0x6fff_fffe,
    ];
    let mut tried = 0;
    for entry in entries
        .into_iter()
        .filter(|own| followed.contains(&at(*own)))
    {
        for value in [0x7fff_0000_0000_u64, u64::MAX] {
            let mut binary = good.to_vec();
            binary[entry + 8..entry + 16].copy_from_slice(&value.to_le_bytes());
            let ended = run(&fmu_of(DESCRIPTION, &binary), &COSIM);
            let what = format!("{:#x} = {value:#x}: {ended:?}", at(entry));
            assert_eq!(ended.code, 2, "{what}");
            let words = "cannot be loaded: its dynamic section is damaged: ";
            assert!(ended.stderr.contains(words), "{what}");
            tried += 1;
        }
    }
    assert!(tried >= 16, "{tried}");
}

/// The least that is a DLL of 64-bit Windows: headers without sections.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn dll() -> Vec<u8> {
    let mut bytes = vec![0u8; 0x40 + 4 + 20 + 240];
    bytes[..2].copy_from_slice(b"MZ");
    bytes[0x3c] = 0x40;
    bytes[0x40..0x44].copy_from_slice(b"PE\0\0");
    bytes[0x44..0x46].copy_from_slice(&0x8664u16.to_le_bytes());
    // Size of the optional header, flags: executable image, DLL.
    bytes[0x54..0x56].copy_from_slice(&240u16.to_le_bytes());
    bytes[0x56..0x58].copy_from_slice(&0x2022u16.to_le_bytes());
    bytes[0x58..0x5a].copy_from_slice(&0x20bu16.to_le_bytes());
    // Number of data directories.
    bytes[0x58 + 108] = 16;
    bytes
}

#[test]
fn wrong_use_of_good_fmus() {
    let cases: [(&[&str], &str); 12] = [
        (
            &["--connect", "a.y=b.u"],
            "`b.u`: there is no instance `b`, known are `a`",
        ),
        (&["--connect", "a.y=a.w"], "`a.w`: `a` has no variable `w`"),
        (
            &["--connect", "a.u=a.y"],
            "`a.u` -> `a.y`: `a.u` is an input, a connection begins at an output; did you mean `a.y` -> `a.u`?",
        ),
        (
            &["--connect", "a.k=a.u"],
            "`a.k` -> `a.u`: `a.k` is a parameter, a connection begins at an output",
        ),
        (
            &["--connect", "a.n=a.flag_in"],
            "`a.n` -> `a.flag_in`: Integer cannot feed Boolean",
        ),
        (
            &["--connect", "a.tolerance=a.u", "--connect", "a.y=a.u"],
            "`a.u` is fed twice: by `a.tolerance` and by `a.y`",
        ),
        (
            &["--set", "a.y=1"],
            "`a` failed to take the value of `y`: fmi2SetReal returned fmi2Error without a message",
        ),
        (
            &["--set", "a.k=fast"],
            "`a.k` is of type Real, `fast` is not",
        ),
        (
            &["--set", "a.flag_in=maybe"],
            "`a.flag_in` is of type Boolean, `maybe` is not",
        ),
        (
            &["--step", "0.3"],
            "1 s are 3.33333333 steps of 0.3 s, expected a whole number: stop at 0.9 s or 1.2 s, or change the step",
        ),
        (
            &["--start-time", "2"],
            "the simulation would run from 2 s to 1 s, expected a stop after the start",
        ),
        (
            &["-o", "nowhere/result.csv"],
            "cannot write nowhere/result.csv: No such file or directory (os error 2)",
        ),
    ];
    for (arguments, message) in cases {
        // What is given last counts.
        let mut all = vec!["cosim", "a.fmu"];
        for default in [["--stop-time", "1"], ["--step", "0.1"]] {
            if !arguments.contains(&default[0]) {
                all.extend(default);
            }
        }
        all.extend(arguments);
        let ended = run(&good(), &all);
        let error = ended.stderr.split("\nhint: ").next().unwrap().trim_end();
        assert_eq!(error, format!("error: {message}"), "{arguments:?}");
        assert_eq!(
            (ended.code, ended.stdout.as_str()),
            (2, ""),
            "{arguments:?}"
        );
    }
}
