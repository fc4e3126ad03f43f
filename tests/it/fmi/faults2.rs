//! A good description of FMI 2.0, and what can be wrong with it.

pub const GOOD: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="{1}" generationDateAndTime="2026-01-02T03:04:05Z" variableNamingConvention="structured" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/><DisplayUnit name="ft" factor="3.28"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Length"><Real unit="m" min="-100" max="100"/></SimpleType>
    <SimpleType name="Mode"><Enumeration><Item name="off" value="0"/><Item name="on" value="1"/></Enumeration></SimpleType>
  </TypeDefinitions>
  <LogCategories><Category name="logEvents"/><Category name="logStatusError"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="1" tolerance="1e-6" stepSize="0.1"/>
  <ModelVariables>
    <ScalarVariable name="time" valueReference="0" causality="independent"><Real/></ScalarVariable>
    <ScalarVariable name="k" valueReference="1" causality="parameter" variability="tunable"><Real unit="m" displayUnit="ft" min="0" max="2" start="1" nominal="1"/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="0" causality="parameter" variability="fixed"><Enumeration declaredType="Mode" start="1"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="2" causality="input"><Real declaredType="Length" start="0"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="3" causality="output" initial="exact"><Real unit="m" start="0"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="4" causality="local"><Real unit="m/s" derivative="5"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="5" causality="output"><Real unit="m"/></ScalarVariable>
    <ScalarVariable name="flag" valueReference="0" causality="output" variability="discrete" initial="exact"><Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="note" valueReference="0" causality="local" variability="constant"><String start="hello"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="5" dependencies="5"/><Unknown index="7" dependencies="4 5" dependenciesKind="dependent constant"/><Unknown index="8" dependencies=""/></Outputs>
    <Derivatives><Unknown index="6" dependencies="4"/></Derivatives>
    <InitialUnknowns><Unknown index="6" dependencies="4"/><Unknown index="7" dependencies="4 5"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

/// What is replaced by what.
pub const FAULTS: &[(&str, &str)] = &[
    // The schema.
    (r#" guid="{1}""#, ""),
    (r#"guid="{1}""#, r#"guid="" colour="red""#),
    (r#"fmiVersion="2.0""#, r#"fmiVersion="2.0.4""#),
    (r#"05Z""#, r#"05""#),
    ("2026-01", "2026-13"),
    ("structured", "pretty"),
    (
        r#"numberOfEventIndicators="0""#,
        r#"numberOfEventIndicators="-1""#,
    ),
    ("<LogCategories>", "<Extra/><LogCategories>"),
    (
        r#"<Category name="logEvents"/><Category name="logStatusError"/>"#,
        "",
    ),
    (
        "</ModelVariables>",
        r#"</ModelVariables><DefaultExperiment/>"#,
    ),
    (r#"stepSize="0.1""#, r#"stepSize="inf""#),
    (
        r#"canGetAndSetFMUstate="true""#,
        r#"canGetAndSetFMUstate="yes""#,
    ),
    (r#"<Boolean start="false"/>"#, r#"<Boolean start="False"/>"#),
    (r#"<Boolean start="false"/>"#, r#"<Bool start="false"/>"#),
    (
        r#"<Boolean start="false"/>"#,
        r#"<Boolean start="false"/><Boolean/>"#,
    ),
    (r#"valueReference="2""#, ""),
    (r#"valueReference="2""#, r#"valueReference="2.5""#),
    (r#"causality="input""#, r#"causality="in""#),
    (r#"initial="exact"><Real"#, r#"initial="true"><Real"#),
    (
        r#"index="6" dependencies="4"/></Derivatives>"#,
        r#"dependencies="4"/></Derivatives>"#,
    ),
    (r#"dependencies="5""#, r#"dependencies="5,6""#),
    (r#""dependent constant""#, r#""dependent linear""#),
    // The whole.
    (
        r#"<CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>"#,
        "",
    ),
    (r#"modelIdentifier="m""#, r#"modelIdentifier="m-1""#),
    (
        r#"canGetAndSetFMUstate="true" "#,
        r#"needsExecutionTool="true" "#,
    ),
    (r#"stopTime="1""#, r#"stopTime="-1""#),
    (r#"tolerance="1e-6""#, r#"tolerance="0""#),
    (r#"stepSize="0.1""#, r#"stepSize="NaN""#),
    (r#""logEvents""#, r#""logStatusError""#),
    // Units and types.
    (
        r#"<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>"#,
        r#"<Unit name="m/s"/><Unit name="m"><BaseUnit/></Unit>"#,
    ),
    (
        r#"unit="m" displayUnit="ft""#,
        r#"unit="metre" displayUnit="ft""#,
    ),
    (
        r#"unit="m" displayUnit="ft""#,
        r#"unit="m" displayUnit="feet""#,
    ),
    (r#"unit="m" displayUnit="ft""#, r#"displayUnit="ft""#),
    (
        r#"<SimpleType name="Mode">"#,
        r#"<SimpleType name="Length"><Boolean/></SimpleType><SimpleType name="Mode">"#,
    ),
    (
        r#"<SimpleType name="Mode">"#,
        r#"<SimpleType name="k"><Boolean/></SimpleType><SimpleType name="Mode">"#,
    ),
    (
        r#"<SimpleType name="Mode">"#,
        r#"<SimpleType name="Odd"><Real min="1" max="0" unit="K"/></SimpleType><SimpleType name="Mode">"#,
    ),
    (
        r#"<Item name="on" value="1"/>"#,
        r#"<Item name="on" value="1"/><Item name="off" value="1"/>"#,
    ),
    (r#"declaredType="Length""#, r#"declaredType="Len""#),
    (r#"declaredType="Length""#, r#"declaredType="Mode""#),
    (r#"declaredType="Mode" start="1""#, r#"start="1""#),
    (
        r#"declaredType="Mode" start="1""#,
        r#"declaredType="Mode" start="2""#,
    ),
    // Variables.
    (r#"name="y""#, r#"name="x""#),
    (r#"name="y""#, r#"name="1 y""#),
    (r#"name="k""#, r#"name="k[""#),
    (r#"variability="discrete" "#, ""),
    (
        r#"causality="parameter" variability="tunable""#,
        r#"causality="parameter""#,
    ),
    (
        r#"causality="local"><Real"#,
        r#"causality="local" initial="exact"><Real"#,
    ),
    (
        r#"<ScalarVariable name="u" valueReference="2" causality="input">"#,
        r#"<ScalarVariable name="u" valueReference="2" causality="input" initial="exact">"#,
    ),
    (
        r#"<Real declaredType="Length" start="0"/>"#,
        r#"<Real declaredType="Length"/>"#,
    ),
    (
        r#"<Real declaredType="Length" start="0"/>"#,
        r#"<Real declaredType="Length" start="101"/>"#,
    ),
    (
        r#"initial="exact"><Real unit="m" start="0"/>"#,
        r#"initial="exact"><Real unit="m"/>"#,
    ),
    (
        r#"causality="independent"><Real/>"#,
        r#"causality="independent"><Real start="0"/>"#,
    ),
    (
        r#"causality="independent"><Real/>"#,
        r#"causality="independent" variability="discrete"><Integer/>"#,
    ),
    (
        r#"name="der(x)" valueReference="4" causality="local""#,
        r#"name="der(x)" valueReference="4" causality="independent""#,
    ),
    (
        r#"name="y" valueReference="5" causality="output"><Real unit="m"/>"#,
        r#"name="y" valueReference="5" causality="output"><Real unit="m" start="1"/>"#,
    ),
    (r#"min="0" max="2""#, r#"min="3" max="2""#),
    (r#"start="1" nominal="1""#, r#"start="-1" nominal="0""#),
    (r#"derivative="5""#, r#"derivative="5" reinit="true""#),
    (r#"derivative="5""#, r#"derivative="6""#),
    (r#"derivative="5""#, r#"derivative="50""#),
    (
        r#"<ScalarVariable name="u" "#,
        r#"<ScalarVariable name="u" canHandleMultipleSetPerTimeInstant="true" "#,
    ),
    (r#"valueReference="2""#, r#"valueReference="1""#),
    (r#"valueReference="3""#, r#"valueReference="1""#),
    (r#"valueReference="5""#, r#"valueReference="4""#),
    (
        r#"name="note" valueReference="0" causality="local" variability="constant"><String start="hello"/>"#,
        r#"name="note" valueReference="3" causality="local" variability="constant"><Real unit="m" start="0"/>"#,
    ),
    // The structure.
    (r#"<Unknown index="8" dependencies=""/>"#, ""),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependencies=""/><Unknown index="8" dependencies=""/><Unknown index="2" dependencies=""/>"#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependencies=""/><Unknown index="0" dependencies=""/><Unknown index="10" dependencies=""/>"#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8"/>"#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependenciesKind=""/>"#,
    ),
    (
        r#"dependencies="4 5" dependenciesKind="dependent constant""#,
        r#"dependencies="4 5" dependenciesKind="dependent""#,
    ),
    (
        r#"dependencies="4 5" dependenciesKind="dependent constant""#,
        r#"dependencies="5 4""#,
    ),
    (
        r#"dependencies="4 5" dependenciesKind="dependent constant""#,
        r#"dependencies="4 4 99""#,
    ),
    (
        r#"dependencies="4 5" dependenciesKind="dependent constant""#,
        r#"dependencies="2""#,
    ),
    (
        r#"<Derivatives><Unknown index="6" dependencies="4"/></Derivatives>"#,
        "",
    ),
    (
        r#"<Derivatives><Unknown index="6" dependencies="4"/></Derivatives>"#,
        r#"<Derivatives><Unknown index="7" dependencies=""/></Derivatives>"#,
    ),
    (
        r#"<InitialUnknowns><Unknown index="6" dependencies="4"/><Unknown index="7" dependencies="4 5"/>"#,
        r#"<InitialUnknowns><Unknown index="7" dependencies="4 5"/><Unknown index="6" dependencies="4" dependenciesKind="fixed"/>"#,
    ),
    (
        r#"<InitialUnknowns><Unknown index="6" dependencies="4"/>"#,
        r#"<InitialUnknowns><Unknown index="5" dependencies="7"/>"#,
    ),
    // The text and its markup.
    (r#"encoding="UTF-8""#, r#"encoding="ISO-8859-1""#),
    (
        r#"<fmiModelDescription "#,
        r#"<fmiModelDescription xmlns="urn:fmi" "#,
    ),
    (
        r#"<LogCategories>"#,
        r#"<x:Extra xmlns:x="urn:x"/><LogCategories>"#,
    ),
    (
        r#"<DefaultExperiment "#,
        r#"<DefaultExperiment xmlns:x="urn:x" x:note="1" "#,
    ),
    (r#"<LogCategories>"#, r#"<LogCategories>and"#),
    (r#"fmiVersion="2.0""#, r#"fmiVersion="2""#),
    // The schema: attributes and their types.
    (r#" modelName="m""#, r#""#),
    (r#"stopTime="1""#, r#"stopTime="1,5""#),
    (r#"tolerance="1e-6""#, r#"tolerance="1e-6s""#),
    (
        r#"<BaseUnit m="1" s="-1"/>"#,
        r#"<BaseUnit m="1" s="-1.0"/>"#,
    ),
    (r#"factor="3.28""#, r#"gain="3.28""#),
    (r#"<Item name="on" value="1"/>"#, r#"<Item name="on"/>"#),
    (
        r#"<Item name="on" value="1"/>"#,
        r#"<Item name="on" value="2147483648"/>"#,
    ),
    (
        r#"declaredType="Mode" start="1""#,
        r#"declaredType="Mode" start="2147483648""#,
    ),
    (r#"<Category name="logEvents"/>"#, r#"<Category/>"#),
    (r#"valueReference="3""#, r#"valueReference="4294967296""#),
    (r#"causality="input""#, r#"causality="structuralParameter""#),
    (
        r#"providesDirectionalDerivative="true""#,
        r#"providesDirectionalDerivatives="true""#,
    ),
    (
        r#"providesDirectionalDerivative="true""#,
        r#"canGetAndSetFMUState="true""#,
    ),
    (
        r#"unit="m" min="-100" max="100""#,
        r#"unit="m" min="-100" max="" "#,
    ),
    // The schema: elements.
    (
        r#"<CoSimulation "#,
        r#"<UnitDefinitions><Unit name="kg"><BaseUnit kg="1"/></Unit></UnitDefinitions><CoSimulation "#,
    ),
    (
        r#"<BaseUnit m="1"/><DisplayUnit name="ft" factor="3.28"/>"#,
        r#"<DisplayUnit name="ft" factor="3.28"/><BaseUnit m="1"/>"#,
    ),
    (
        r#"<BaseUnit m="1"/><DisplayUnit"#,
        r#"<BaseUnit m="1"/><BaseUnit m="1"/><DisplayUnit"#,
    ),
    (
        r#"<Enumeration><Item name="off" value="0"/><Item name="on" value="1"/></Enumeration>"#,
        r#"<Enumeration/>"#,
    ),
    (
        r#"<Enumeration><Item name="off" value="0"/><Item name="on" value="1"/></Enumeration>"#,
        r#""#,
    ),
    (
        r#"<Boolean start="false"/>"#,
        r#"<Annotations><Tool name="t"/></Annotations><Boolean start="false"/>"#,
    ),
    (
        r#"<Boolean start="false"/>"#,
        r#"<Boolean start="false"><Start value="true"/></Boolean>"#,
    ),
    (
        r#"<Derivatives><Unknown index="6" dependencies="4"/></Derivatives>"#,
        r#"<EventIndicators/><Derivatives><Unknown index="6" dependencies="4"/></Derivatives>"#,
    ),
    (
        r#"<InitialUnknowns><Unknown index="6" dependencies="4"/><Unknown index="7" dependencies="4 5"/></InitialUnknowns>"#,
        r#"<InitialUnknowns><Unknown index="6" dependencies="4"/><Unknown index="7" dependencies="4 5"/></InitialUnknowns><Outputs/>"#,
    ),
    (
        r#"<LogCategories>"#,
        r#"<VendorAnnotations/><LogCategories>"#,
    ),
    (
        r#"stepSize="0.1"/>"#,
        r#"stepSize="0.1"/><VendorAnnotations><Tool name="t"><a/><b/>text</Tool></VendorAnnotations>"#,
    ),
    // The whole, further.
    (r#"05Z""#, r#"05.5Z""#),
    (r#"2026-01-02"#, r#"2026-02-30"#),
    (r#"startTime="0""#, r#"startTime="NaN""#),
    (r#"stopTime="1""#, r#"stopTime="INF""#),
    (
        r#"<CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>"#,
        r#"<CoSimulation modelIdentifier="m"><SourceFiles><File name="a.c"/><File name="../b.c"/><File name="a.c"/></SourceFiles></CoSimulation>"#,
    ),
    (r#"modelIdentifier="m""#, r#"modelIdentifier="""#),
    (
        r#"<CoSimulation modelIdentifier="m" "#,
        r#"<ModelExchange modelIdentifier="1m"/><CoSimulation modelIdentifier="m" "#,
    ),
    // Units and types, further.
    (
        r#"<DisplayUnit name="ft" factor="3.28"/>"#,
        r#"<DisplayUnit name="ft" factor="3.28"/><DisplayUnit name="ft"/>"#,
    ),
    (r#"factor="3.28""#, r#"factor="0""#),
    (
        r#"<BaseUnit m="1" s="-1"/>"#,
        r#"<BaseUnit m="1" s="-1" factor="INF"/>"#,
    ),
    (r#"<Unit name="m/s">"#, r#"<Unit name="M/S">"#),
    (
        r#"unit="m" min="-100" max="100""#,
        r#"min="-100" max="100" displayUnit="m""#,
    ),
    // Variables, further.
    (r#"name="y""#, r#"name="""#),
    (r#"name="y""#, r#"name="a&#10;b""#),
    (r#"name="y""#, r#"name="a.b[1""#),
    (r#"name="y""#, r#"name="der(y""#),
    (r#"name="y""#, r#"name="größe""#),
    (
        r#"causality="output" variability="discrete" initial="exact""#,
        r#"causality="output" variability="fixed" initial="exact""#,
    ),
    (
        r#"causality="parameter" variability="fixed"><Enumeration"#,
        r#"causality="parameter" variability="fixed" initial="approx"><Enumeration"#,
    ),
    (
        r#"causality="local" variability="constant""#,
        r#"causality="parameter" variability="constant""#,
    ),
    (
        r#"causality="local" variability="constant""#,
        r#"causality="local" variability="constant" initial="calculated""#,
    ),
    (r#"<String start="hello"/>"#, r#"<String/>"#),
    (r#"min="0" max="2""#, r#"min="NaN" max="2""#),
    (
        r#"declaredType="Length" start="0""#,
        r#"declaredType="Length" start="0" max="-200""#,
    ),
    (
        r#"declaredType="Mode" start="1""#,
        r#"declaredType="Mode" start="1" min="2" max="3""#,
    ),
    (
        r#"name="x" valueReference="3" causality="output" initial="exact""#,
        r#"name="x" valueReference="3" causality="input""#,
    ),
    (
        r#"name="der(x)" valueReference="4" causality="local""#,
        r#"name="der(x)" valueReference="4" causality="local" variability="discrete""#,
    ),
    (
        r#"name="note" valueReference="0" causality="local" variability="constant"><String start="hello"/>"#,
        r#"name="note" valueReference="0" causality="local" variability="constant"><String start="hello"/></ScalarVariable><ScalarVariable name="same" valueReference="0" causality="local" variability="constant"><String start="bye"/>"#,
    ),
    // The structure, further.
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependencies="4" dependenciesKind="constant"/>"#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependencies="-4"/>"#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="-8" dependencies=""/>"#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependencies="" kinds=""/>"#,
    ),
    (
        r#"name="y" valueReference="5" causality="output"><Real unit="m"/>"#,
        r#"name="y" valueReference="5" causality="output"><Real unit="m/s" derivative="5"/></ScalarVariable><ScalarVariable name="second" valueReference="6" causality="local"><Real/>"#,
    ),
    (
        r#"<Derivatives><Unknown index="6" dependencies="4"/></Derivatives>"#,
        r#"<Derivatives><Unknown index="6" dependencies="4"/><Unknown index="6" dependencies="4"/></Derivatives>"#,
    ),
    (
        r#"<Unknown index="7" dependencies="4 5"/></InitialUnknowns>"#,
        r#"<Unknown index="7" dependencies="4 6"/></InitialUnknowns>"#,
    ),
    // Names, types and annotations.
    (
        r#"stepSize="0.1"/>"#,
        r#"stepSize="0.1"/><VendorAnnotations><Tool name="t"/><Tool name="t"/></VendorAnnotations>"#,
    ),
    (
        r#"<Boolean start="false"/>"#,
        r#"<Boolean start="false"/><Annotations><Tool name="t"/><Tool name="t"/></Annotations>"#,
    ),
    (r#"name="note""#, r#"name="der(note)""#),
    (
        r#"<Boolean start="false"/>"#,
        r#"<Boolean declaredType="Mode" start="false"/>"#,
    ),
    (
        r#"<String start="hello"/>"#,
        r#"<String declaredType="Length" start="hello"/>"#,
    ),
    (
        r#"unit="m" min="-100" max="100""#,
        r#"unit="m" min="-100" max="1e400""#,
    ),
    (
        r#"unit="m" min="-100" max="100""#,
        r#"unit="m" min="-100" max="100" nominal="0""#,
    ),
    (
        r#"unit="m" min="-100" max="100""#,
        r#"unit="m" displayUnit="mile" min="-100" max="100""#,
    ),
    (
        r#"<BaseUnit m="1" s="-1"/>"#,
        r#"<BaseUnit m="1" s="-1" factor="0"/>"#,
    ),
    // The experiment.
    (r#"stopTime="1""#, r#"stopTime="0""#),
    (r#"stepSize="0.1""#, r#"stepSize="2""#),
    // Aliases.
    (
        r#"<ScalarVariable name="time" valueReference="0" causality="independent"><Real/>"#,
        r#"<ScalarVariable name="time" valueReference="2" causality="independent"><Real declaredType="Length"/>"#,
    ),
    (
        r#"name="y" valueReference="5" causality="output"><Real unit="m"/>"#,
        r#"name="y" valueReference="3" causality="output" variability="discrete"><Real unit="m"/>"#,
    ),
    (
        r#"name="x" valueReference="3""#,
        r#"name="x" valueReference="3" previous="1""#,
    ),
    // The text and its markup, further.
    (r#"</ModelVariables>"#, r#""#),
    (r#"fmiVersion="2.0" "#, r#""#),
    (r#"fmiVersion="2.0""#, r#"fmiVersion="4.0""#),
    (
        r#"<DefaultExperiment "#,
        r#"<DefaultExperiment xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:nil="true" "#,
    ),
    (r#"valueReference="2""#, r#"valueReference="-2""#),
    (
        r#"<CoSimulation modelIdentifier="m" "#,
        r#"<ModelExchange modelIdentifier="m"><SourceFiles><File name="a.c"/><File name="a.c"/></SourceFiles></ModelExchange><CoSimulation modelIdentifier="m" "#,
    ),
    (
        r#"<Unknown index="8" dependencies=""/>"#,
        r#"<Unknown index="8" dependencies="0"/>"#,
    ),
    (
        r#"<SimpleType name="Length"><Real unit="m" min="-100" max="100"/>"#,
        r#"<SimpleType name="Length">"#,
    ),
    (r#"name="y""#, r#"name="'\z'""#),
    (r#"name="y""#, r#"name="der(-)""#),
    // Causality, variability and initial, further.
    (
        r#"<ScalarVariable name="u" valueReference="2" causality="input">"#,
        r#"<ScalarVariable name="u" valueReference="2" causality="input" variability="fixed">"#,
    ),
    (
        r#"causality="local" variability="constant""#,
        r#"causality="local" variability="fixed" initial="exact""#,
    ),
    (
        r#"name="y" valueReference="5" causality="output""#,
        r#"name="y" valueReference="5" causality="calculatedParameter""#,
    ),
    (
        r#"<ScalarVariable name="u" "#,
        r#"<ScalarVariable name="u" canHandleMultipleSetPerTimeInstant="false" "#,
    ),
];
