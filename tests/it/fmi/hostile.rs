//! Descriptions that nobody should write: each gives an error or is read right, and never a panic, an
//! overflow of the stack or hours of waiting.

use super::{faults2, faults3};
use pilotage::fmi::description::{ReadError, read};
use pilotage::fmi_check::validate;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use std::error::Error;

/// Reads and checks; the error with its sources, or how many findings there are.
fn outcome(bytes: &[u8]) -> Result<usize, String> {
    match read(bytes) {
        Ok(reading) => Ok(validate(&reading).len()),
        Err(error) => Err(message(&error)),
    }
}

fn message(error: &ReadError) -> String {
    match error.source() {
        Some(source) => format!("{error}: {source}"),
        None => error.to_string(),
    }
}

/// A description with `inside` between the tags of the root.
fn with(inside: &str) -> String {
    format!(
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\">{inside}</fmiModelDescription>"
    )
}

#[test]
fn deep_nesting_is_refused() {
    let deep = |depth: usize| with(&format!("{}{}", "<a>".repeat(depth), "</a>".repeat(depth)));
    // Not expected, interfaces, variables and structure: reported, not refused.
    assert_eq!(outcome(deep(900).as_bytes()), Ok(4));
    for depth in [1000, 1_000_000] {
        assert_eq!(
            outcome(deep(depth).as_bytes()).unwrap_err(),
            "modelDescription.xml, line 1: elements are nested deeper than 1000 levels"
        );
    }
    assert_eq!(
        outcome("<a>".repeat(1_000_000).as_bytes()).unwrap_err(),
        "modelDescription.xml, line 1: elements are nested deeper than 1000 levels"
    );
}

#[test]
fn many_attributes_are_refused() {
    let many = |count: usize| {
        let attributes: String = (0..count).map(|i| format!(" a{i}=\"\"")).collect();
        with(&format!(
            "\n<VendorAnnotations><Tool name=\"t\"><b{attributes}/></Tool></VendorAnnotations>"
        ))
    };
    assert_eq!(outcome(many(256).as_bytes()), Ok(3));
    assert_eq!(
        outcome(many(200_000).as_bytes()).unwrap_err(),
        "modelDescription.xml, line 2: an element has more than 256 attributes"
    );
}

#[test]
fn many_namespaces_are_refused() {
    let nested = |count: usize| {
        let open: String = (0..count)
            .map(|i| format!("<a xmlns:n{i}=\"u{i}\">"))
            .collect();
        with(&format!("{open}{}", "</a>".repeat(count)))
    };
    assert_eq!(outcome(nested(100).as_bytes()), Ok(4));
    assert_eq!(
        outcome(nested(900).as_bytes()).unwrap_err(),
        "modelDescription.xml, line 1: more than 100 namespaces are declared around an element"
    );
    // Beside each other they do no harm.
    let beside = "<a xmlns:n=\"u\"/>".repeat(10_000);
    assert_eq!(outcome(with(&beside).as_bytes()), Ok(10_003));
}

#[test]
fn document_types_are_refused() {
    let laughs = "<!DOCTYPE x [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\"><!ENTITY c \"&b;&b;&b;&b;&b;&b;&b;&b;\">]>";
    let outside = "<!DOCTYPE x SYSTEM \"file:///etc/passwd\">";
    for doctype in [laughs, outside, "<!DOCTYPE fmiModelDescription>"] {
        let xml = format!("{doctype}{}", with("&c;"));
        assert_eq!(
            outcome(xml.as_bytes()).unwrap_err(),
            "modelDescription.xml is not well-formed XML: XML with DTD detected"
        );
    }
    assert_eq!(
        outcome(with("&c;").as_bytes()).unwrap_err(),
        "modelDescription.xml is not well-formed XML: unknown entity reference 'c' at 1:62"
    );
}

/// Large, on one line, with a finding at each variable: what grows faster than the file takes hours.
#[test]
fn large_descriptions_are_read_in_proportion() {
    const COUNT: usize = 30_000;
    let variables: String = (0..COUNT)
        .map(|i| {
            format!("<ScalarVariable name=\"ä{i}\" valueReference=\"{i}\" causality=\"output\"><Real unit=\"u{i}\" declaredType=\"t{i}\"/></ScalarVariable>")
        })
        .collect();
    let units: String = (0..COUNT)
        .map(|i| format!("<Unit name=\"u{i}\"><BaseUnit/></Unit>"))
        .collect();
    let types: String = (0..COUNT)
        .map(|i| format!("<SimpleType name=\"t{i}\"><Real/></SimpleType>"))
        .collect();
    let xml = with(&format!(
        "<CoSimulation modelIdentifier=\"m\"/><UnitDefinitions>{units}</UnitDefinitions><TypeDefinitions>{types}</TypeDefinitions><ModelVariables>{variables}</ModelVariables><ModelStructure/>"
    ));
    // Each variable is missing in two lists.
    assert_eq!(outcome(xml.as_bytes()), Ok(2 * COUNT));
    let long = format!("x{}", "y".repeat(2_000_000));
    let xml = xml.replacen("name=\"ä0\"", &format!("name=\"{long}\""), 1);
    assert_eq!(outcome(xml.as_bytes()), Ok(2 * COUNT));
}

#[test]
fn comments_and_cdata_are_where_they_may_be() {
    for (from, to) in [
        (
            "<LogCategories>",
            "<!-- <x> --><LogCategories><!-- a > b -->",
        ),
        ("<ModelVariables>", "<ModelVariables><?tool <data>?>"),
        ("<LogCategories>", "<LogCategories>&#32;&#x9;"),
        (
            "</fmiModelDescription>\n",
            "</fmiModelDescription><!-- end --> \n",
        ),
        ("<?xml", "\u{feff}<?xml"),
        ("  <LogCategories>", "\r\n\t<LogCategories>"),
    ] {
        let xml = faults2::GOOD.replacen(from, to, 1);
        assert_eq!(outcome(xml.as_bytes()), Ok(0), "{to}");
    }
    // CDATA is text, and no markup.
    let xml = faults2::GOOD.replacen("<LogCategories>", "<LogCategories><![CDATA[<x y='1'>]]>", 1);
    assert_eq!(outcome(xml.as_bytes()), Ok(1));
    for (from, to) in [
        ("<?xml", " <?xml"),
        ("<LogCategories>", "<!-- -- --><LogCategories>"),
        ("<LogCategories>", "<LogCategories>&#0;"),
        ("<LogCategories>", "<LogCategories>\u{1}"),
        ("guid=\"{1}\"", "guid=\"{1}\" guid=\"{1}\""),
        ("guid=\"{1}\"", "guid=\"<\""),
        ("guid=\"{1}\"", "guid={1}"),
        ("</fmiModelDescription>", "</fmiModelDescription><more/>"),
    ] {
        let xml = faults2::GOOD.replacen(from, to, 1);
        let error = outcome(xml.as_bytes()).expect_err(to);
        assert!(
            error.starts_with("modelDescription.xml is not well-formed XML: "),
            "{error}"
        );
    }
}

/// Pieces of XML, and of values that need care.
const PIECES: &[&str] = &[
    "<",
    ">",
    "/>",
    "</",
    "\"",
    "'",
    "=",
    "&",
    "&amp;",
    "&#x0;",
    "&#1114112;",
    "<!--",
    "-->",
    "<![CDATA[",
    "]]>",
    "<?",
    "?>",
    "<!DOCTYPE",
    "xmlns",
    ":",
    "\0",
    "\u{feff}",
    "\u{85}",
    "🚁",
    "NaN",
    "INF",
    "-INF",
    "-1",
    "0",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "1e999",
    "",
    " ",
    "\n",
    "true",
    "Real",
    "Float64",
    "Clock",
    "Dimension",
    "start",
    "valueReference",
    "clocks",
    "derivative",
    "previous",
    "dependencies",
    "9999999999999999999999",
];

/// What is done to a token.
#[derive(Debug, Clone)]
enum Mutation {
    Delete,
    Duplicate,
    Replace(&'static str),
    Insert(&'static str),
    /// With another token.
    Swap(Index),
    /// A byte of it becomes another one.
    Byte(Index, u8),
}

fn mutation() -> impl Strategy<Value = (Index, Mutation)> {
    let change = prop_oneof![
        Just(Mutation::Delete),
        Just(Mutation::Duplicate),
        select(PIECES).prop_map(Mutation::Replace),
        select(PIECES).prop_map(Mutation::Insert),
        any::<Index>().prop_map(Mutation::Swap),
        (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Mutation::Byte(at, byte)),
    ];
    (any::<Index>(), change)
}

/// Names, values and marks, each a token.
fn tokens(xml: &str) -> Vec<Vec<u8>> {
    let mut tokens: Vec<Vec<u8>> = Vec::new();
    let mut was_word = false;
    for byte in xml.bytes() {
        let is_word = byte.is_ascii_alphanumeric();
        match tokens.last_mut() {
            Some(token) if is_word && was_word => token.push(byte),
            _ => tokens.push(vec![byte]),
        }
        was_word = is_word;
    }
    tokens
}

fn mutate(xml: &str, mutations: &[(Index, Mutation)]) -> Vec<u8> {
    let mut tokens = tokens(xml);
    for (at, mutation) in mutations {
        if tokens.is_empty() {
            break;
        }
        let position = at.index(tokens.len());
        match mutation {
            Mutation::Delete => drop(tokens.remove(position)),
            Mutation::Duplicate => tokens.insert(position, tokens[position].clone()),
            Mutation::Replace(piece) => tokens[position] = piece.as_bytes().to_vec(),
            Mutation::Insert(piece) => tokens.insert(position, piece.as_bytes().to_vec()),
            Mutation::Swap(other) => {
                let other = other.index(tokens.len());
                tokens.swap(position, other);
            }
            Mutation::Byte(at, byte) => {
                let token = &mut tokens[position];
                if !token.is_empty() {
                    let at = at.index(token.len());
                    token[at] = *byte;
                }
            }
        }
    }
    tokens.concat()
}

/// The same cases on every run.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(2000))]

    /// Tokens changed here and there: no panic, and what can be used is written and read again as the
    /// same value.
    #[test]
    fn changed_tokens(good in select(&[faults2::GOOD, faults3::GOOD][..]), mutations in vec(mutation(), 1..8)) {
        let bytes = mutate(good, &mutations);
        if let Ok(reading) = read(&bytes) {
            let findings = validate(&reading);
            prop_assert!(findings.is_sorted_by_key(|finding| finding.place));
            for finding in &findings {
                prop_assert!(!finding.to_string().is_empty());
            }
            if let Ok(description) = reading.into_usable() {
                let again = read(description.to_xml().as_bytes()).unwrap();
                // NaN is not equal to itself.
                prop_assert_eq!(format!("{:?}", again.description), format!("{:?}", description));
            }
        }
    }

    /// Any bytes: an error, and no panic.
    #[test]
    fn any_bytes(bytes in vec(any::<u8>(), 0..200), start in select(&["", "<", "<?xml", "\u{feff}<a", "<fmiModelDescription fmiVersion=\"3.0\""][..])) {
        let bytes = [start.as_bytes(), &bytes].concat();
        prop_assert!(outcome(&bytes).is_err());
    }
}
