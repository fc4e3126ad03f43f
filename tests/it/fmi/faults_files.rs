//! Good terminalsAndIcons.xml and buildDescription.xml beside the description of `faults3.rs`, and what can
//! be wrong with them.

use super::faults3;
use crate::foreign::archive;
use pilotage::fmi_check::check;

pub(super) const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
pub(super) const BUILD: &str = "sources/buildDescription.xml";

/// The icon is flipped, which is allowed.
pub(super) const GOOD_TERMINALS: &str = r##"<?xml version="1.0" encoding="UTF-8"?>
<fmiTerminalsAndIcons fmiVersion="3.0">
  <GraphicalRepresentation>
    <CoordinateSystem x1="-100" y1="-100" x2="100" y2="100" suggestedScalingFactorTo_mm="0.1"/>
    <Icon x1="80" y1="-80" x2="-80" y2="80"/>
  </GraphicalRepresentation>
  <Terminals>
    <Terminal name="flange" matchingRule="plug" terminalKind="org.example.flange">
      <TerminalMemberVariable memberName="s" variableKind="signal" variableName="x"/>
      <TerminalMemberVariable memberName="f" variableKind="inflow" variableName="position"/>
      <TerminalStreamMemberVariable inStreamMemberName="h_in" outStreamMemberName="h_out" inStreamVariableName="u" outStreamVariableName="y"/>
      <Terminal name="inner" matchingRule="none"/>
      <TerminalGraphicalRepresentation defaultConnectionColor="0 127 255" defaultConnectionStrokeSize="1" x1="-110" y1="-10" x2="-90" y2="10" iconBaseName="terminal"/>
    </Terminal>
    <Terminal name="other" matchingRule="bus"/>
  </Terminals>
</fmiTerminalsAndIcons>
"##;

pub(super) const TERMINAL_FAULTS: &[(&str, &str)] = &[
    (r#"fmiVersion="3.0""#, r#"fmiVersion="3.1""#),
    (r#" fmiVersion="3.0""#, ""),
    ("<GraphicalRepresentation>", "<GraphicalRepresentation"),
    ("<Terminals>", "<Terminals/><Terminals>"),
    (r#"x1="-100" "#, ""),
    (r#"x1="-100""#, r#"x1="left""#),
    (r#" suggestedScalingFactorTo_mm="0.1""#, ""),
    (
        r#"suggestedScalingFactorTo_mm="0.1""#,
        r#"suggestedScalingFactorTo_mm="0""#,
    ),
    (r#"y1="-100""#, r#"y1="100""#),
    (r#"y1="-80""#, r#"y1="80""#),
    (r#"x2="-80" "#, ""),
    (r#"name="flange" "#, ""),
    (r#"name="flange""#, r#"name="other""#),
    (r#"matchingRule="plug" "#, ""),
    (r#"variableKind="signal" "#, ""),
    (r#" variableName="x""#, ""),
    (r#"variableName="x""#, r#"variableName="nothing""#),
    (
        r#"inStreamVariableName="u""#,
        r#"inStreamVariableName="nothing""#,
    ),
    (
        r#"outStreamVariableName="y""#,
        r#"outStreamVariableName="nothing""#,
    ),
    (
        r#"<TerminalMemberVariable memberName="f" variableKind="inflow" variableName="position"/>"#,
        r#"<TerminalMemberVariable memberName="s" variableKind="inflow" variableName="x"/>"#,
    ),
    (r#"x2="-90""#, r#"x2="-110""#),
    (r#"y1="-10" "#, ""),
    (
        r#"defaultConnectionColor="0 127 255""#,
        r#"defaultConnectionColor="0 127 256""#,
    ),
    (
        r#"defaultConnectionStrokeSize="1""#,
        r#"defaultConnectionStrokeSize="0""#,
    ),
    (r#" iconBaseName="terminal""#, ""),
    (r#"<Terminal name="inner""#, r#"<Plug name="inner""#),
    (r#"terminalKind="org"#, r#"kind="org"#),
    (
        r#"<Icon x1="80" y1="-80" x2="-80" y2="80"/>"#,
        r#"<Icon x1="80" y1="-80" x2="-80" y2="80">icon</Icon>"#,
    ),
    ("  <Terminals>", "  <Annotations/><Terminals>"),
];

pub(super) const GOOD_BUILD: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="m" platform="x86_64-linux">
    <SourceFileSet name="all" language="C99" compiler="gcc" compilerOptions="-O2">
      <SourceFile name="a.c"/>
      <SourceFile name="b.c"/>
      <PreprocessorDefinition name="FAST" value="1" optional="true"><Option value="1" description="on"/></PreprocessorDefinition>
      <PreprocessorDefinition name="SMALL"/>
      <IncludeDirectory name="inc"/>
      <IncludeDirectory name="more"/>
    </SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
</fmiBuildDescription>
"#;

pub(super) const BUILD_FAULTS: &[(&str, &str)] = &[
    (r#"fmiVersion="3.0""#, r#"fmiVersion="2.0""#),
    (r#"modelIdentifier="m" "#, ""),
    (r#"modelIdentifier="m""#, r#"modelIdentifier="n""#),
    (r#"compiler="gcc" "#, ""),
    (r#"name="b.c""#, r#"name="a.c""#),
    (r#"name="SMALL""#, r#"name="FAST""#),
    (r#"name="more""#, r#"name="inc""#),
    (r#"<SourceFile name="a.c"/>"#, "<SourceFile/>"),
    (r#"external="true""#, r#"external="maybe""#),
    (r#"<Library name="m""#, r#"<Archive name="m""#),
    ("  <BuildConfiguration", "  text<BuildConfiguration"),
];

/// What is found in an FMU with that file beside the description, which is good.
pub(super) fn findings(file: &str, content: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fmu");
    let files = [
        ("modelDescription.xml", faults3::GOOD.as_bytes()),
        ("sources/a.c", b""),
        ("sources/b.c", b""),
        (file, content.as_bytes()),
    ];
    std::fs::write(&path, archive(&files)).unwrap();
    let checked = check(&path).unwrap();
    let of_file = checked.findings.iter().filter(|f| f.file == file);
    of_file.map(ToString::to_string).collect()
}

#[test]
fn good_files_have_no_finding() {
    assert_eq!(findings(TERMINALS, GOOD_TERMINALS), Vec::<String>::new());
    assert_eq!(findings(BUILD, GOOD_BUILD), Vec::<String>::new());
}

#[test]
fn every_fault_of_the_files_is_found() {
    let files = [
        (TERMINALS, GOOD_TERMINALS, TERMINAL_FAULTS),
        (BUILD, GOOD_BUILD, BUILD_FAULTS),
    ];
    let of_file = |(file, good, faults): (&str, &str, &[(&str, &str)])| {
        super::findings::report(good, faults, |xml| findings(file, xml))
    };
    insta::assert_snapshot!(files.map(of_file).concat());
}
