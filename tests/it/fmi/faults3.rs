//! A good description of FMI 3.0, and what can be wrong with it.

pub const GOOD: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="{3}" generationDateAndTime="2026-01-02T03:04:05Z" variableNamingConvention="structured">
  <ModelExchange modelIdentifier="m" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"/>
  <CoSimulation modelIdentifier="m" hasEventMode="true" providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true" fixedInternalStepSize="0.01"/>
  <ScheduledExecution modelIdentifier="m"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/><DisplayUnit name="ft" factor="3.28"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/><DisplayUnit name="s/m" inverse="true"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <Float64Type name="Length" unit="m" min="-100" max="100"/>
    <EnumerationType name="Mode"><Item name="off" value="0"/><Item name="on" value="1"/></EnumerationType>
    <ClockType name="Sampling" intervalVariability="constant" intervalDecimal="0.1" priority="1"/>
  </TypeDefinitions>
  <LogCategories><Category name="logEvents"/><Category name="logStatusError"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="1" tolerance="1e-6" stepSize="0.1"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent"/>
    <UInt64 name="n" valueReference="1" causality="structuralParameter" start="3" max="10"/>
    <Float64 name="k" valueReference="2" causality="parameter" variability="tunable" unit="m" displayUnit="ft" min="0" max="2" start="1"/>
    <Float64 name="u" valueReference="3" causality="input" declaredType="Length" start="0 1 2"><Dimension valueReference="1"/></Float64>
    <Float64 name="x" valueReference="4" causality="output" initial="exact" unit="m" start="0" reinit="true"><Dimension start="2"/><Alias name="position" displayUnit="ft"/></Float64>
    <Float64 name="der(x)" valueReference="5" unit="m/s" derivative="4"><Dimension start="2"/></Float64>
    <Float64 name="z" valueReference="6"/>
    <Int8 name="gear" valueReference="7" causality="output" initial="exact" start="1" min="-1" max="5"/>
    <Enumeration name="mode" valueReference="8" causality="parameter" declaredType="Mode" start="1"/>
    <Boolean name="flag" valueReference="9" causality="output" initial="exact" start="false true"><Dimension start="2"/></Boolean>
    <String name="note" valueReference="10" causality="parameter"><Start value="hello"/></String>
    <Binary name="blob" valueReference="11" causality="input" maxSize="4"><Start value="CAFE"/></Binary>
    <Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"/>
    <Clock name="fired" valueReference="13" causality="output" intervalVariability="triggered"/>
    <Int32 name="count" valueReference="14" initial="exact" start="0" clocks="12" previous="15"/>
    <Int32 name="'count before'" valueReference="15" initial="exact" start="0" clocks="12"/>
    <Float32 name="y" valueReference="16" causality="output" intermediateUpdate="true"/>
    <Float64 name="c" valueReference="17" causality="calculatedParameter"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="4" dependencies="4"/>
    <Output valueReference="7" dependencies=""/>
    <Output valueReference="9" dependencies=""/>
    <Output valueReference="13" dependencies="12"/>
    <Output valueReference="16" dependencies="4 3 2" dependenciesKind="dependent constant constant"/>
    <ContinuousStateDerivative valueReference="5" dependencies="3"/>
    <ClockedState valueReference="14"/>
    <InitialUnknown valueReference="5" dependencies="3"/>
    <InitialUnknown valueReference="16" dependencies="2 3 4"/>
    <InitialUnknown valueReference="17" dependencies="2"/>
    <EventIndicator valueReference="6" dependencies="4"/>
  </ModelStructure>
  <Annotations><Annotation type="org.example.note">a note</Annotation></Annotations>
</fmiModelDescription>
"#;

/// What is replaced by what.
pub const FAULTS: &[(&str, &str)] = &[
    // The schema.
    (r#"fmiVersion="3.0""#, r#"fmiVersion="3""#),
    (r#"fmiVersion="3.0""#, r#"fmiVersion="3.00""#),
    (r#" instantiationToken="{3}""#, r#""#),
    (r#"instantiationToken="{3}""#, r#"instantiationToken="""#),
    (
        r#"instantiationToken="{3}""#,
        r#"instantiationToken="{3}" guid="{3}""#,
    ),
    (
        r#"instantiationToken="{3}""#,
        r#"instantiationToken="{3}" numberOfEventIndicators="1""#,
    ),
    (r#"05Z""#, r#"05 Z""#),
    (
        r#"canGetAndSetFMUState="true""#,
        r#"canGetAndSetFMUstate="true""#,
    ),
    (
        r#"providesDirectionalDerivatives="true""#,
        r#"providesDirectionalDerivative="true""#,
    ),
    (
        r#"fixedInternalStepSize="0.01""#,
        r#"fixedInternalStepSize="10 ms""#,
    ),
    (
        r#"<ScheduledExecution modelIdentifier="m"/>"#,
        r#"<ScheduledExecution/>"#,
    ),
    (
        r#"<CoSimulation modelIdentifier="m" hasEventMode="true" providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true" fixedInternalStepSize="0.01"/>"#,
        r#"<ScheduledExecution modelIdentifier="m"/><CoSimulation modelIdentifier="m" hasEventMode="true" providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true" fixedInternalStepSize="0.01"/>"#,
    ),
    (
        r#"<CoSimulation modelIdentifier="m" hasEventMode="true" providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true" fixedInternalStepSize="0.01"/>"#,
        r#"<CoSimulation modelIdentifier="m" hasEventMode="true" providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true" fixedInternalStepSize="0.01"><SourceFiles><File name="a.c"/></SourceFiles></CoSimulation>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<SimpleType name="Length"><Real unit="m"/></SimpleType>"#,
    ),
    (
        r#"<Item name="on" value="1"/>"#,
        r#"<Item name="on" value="9223372036854775808"/>"#,
    ),
    (
        r#"<ClockType name="Sampling" intervalVariability="constant" "#,
        r#"<ClockType name="Sampling" "#,
    ),
    (
        r#"intervalVariability="triggered""#,
        r#"intervalVariability="sometimes""#,
    ),
    (
        r#"<LogCategories><Category name="logEvents"/>"#,
        r#"<LogCategories><Category name="logEvents" level="1"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Real name="z" valueReference="6"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" size="2"/>"#,
    ),
    (r#"start="1" min="-1""#, r#"start="128" min="-1""#),
    (r#"start="1" min="-1""#, r#"start="1" min="-129""#),
    (
        r#"causality="structuralParameter" start="3""#,
        r#"causality="structuralParameter" start="-3""#,
    ),
    (r#"start="0 1 2""#, r#"start="0, 1, 2""#),
    (r#"start="0 1 2""#, r#"start="0 1 inf""#),
    (r#"start="false true""#, r#"start="false True""#),
    (r#"<Start value="CAFE"/>"#, r#"<Start value="CAF"/>"#),
    (r#"<Start value="CAFE"/>"#, r#"<Start value="CAFÉ"/>"#),
    (
        r#"<Start value="hello"/>"#,
        r#"<Alias name="remark"/><Start value="hello"/>"#,
    ),
    (
        r#"<Binary name="blob" valueReference="11" causality="input" maxSize="4">"#,
        r#"<Binary name="blob" valueReference="11" causality="input" maxSize="-4">"#,
    ),
    (
        r#"<Dimension valueReference="1"/>"#,
        r#"<Dimension valueReference="1" start="3"/>"#,
    ),
    (r#"<Dimension valueReference="1"/>"#, r#"<Dimension/>"#),
    (
        r#"<Enumeration name="mode" valueReference="8" causality="parameter" declaredType="Mode" start="1"/>"#,
        r#"<Enumeration name="mode" valueReference="8" causality="parameter" start="1"/>"#,
    ),
    (
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"/>"#,
        r#"<Clock name="tick" valueReference="12" causality="input" initial="exact" declaredType="Sampling" intervalVariability="constant"/>"#,
    ),
    (
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"/>"#,
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"><Dimension start="2"/></Clock>"#,
    ),
    (
        r#"<Alias name="position" displayUnit="ft"/>"#,
        r#"<Alias displayUnit="ft"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Unknown valueReference="7" dependencies=""/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output index="7" dependencies=""/>"#,
    ),
    (
        r#"<ClockedState valueReference="14"/>
    <InitialUnknown valueReference="5" dependencies="3"/>"#,
        r#"<InitialUnknown valueReference="5" dependencies="3"/>
    <ClockedState valueReference="14"/>"#,
    ),
    (r#"<Annotation type="org.example.note">"#, r#"<Annotation>"#),
    // The whole.
    (r#"providesIntermediateUpdate="true" "#, r#""#),
    (r#"hasEventMode="true" "#, r#""#),
    (
        r#"fixedInternalStepSize="0.01""#,
        r#"fixedInternalStepSize="0""#,
    ),
    (
        r#"fixedInternalStepSize="0.01""#,
        r#"fixedInternalStepSize="INF""#,
    ),
    (r#"canGetAndSetFMUState="true" "#, r#""#),
    (
        r#"<ScheduledExecution modelIdentifier="m"/>"#,
        r#"<ScheduledExecution modelIdentifier="my model"/>"#,
    ),
    (r#"priority="1""#, r#""#),
    (r#"stopTime="1""#, r#"stopTime="-1""#),
    // Units and types.
    (
        r#"<DisplayUnit name="s/m" inverse="true"/>"#,
        r#"<DisplayUnit name="s/m" inverse="true" offset="1"/>"#,
    ),
    (
        r#"unit="m" displayUnit="ft" min="0""#,
        r#"unit="m" displayUnit="s/m" min="0""#,
    ),
    (
        r#"<Alias name="position" displayUnit="ft"/>"#,
        r#"<Alias name="position" displayUnit="yd"/>"#,
    ),
    (
        r#"<EnumerationType name="Mode">"#,
        r#"<EnumerationType name="k">"#,
    ),
    (r#"declaredType="Length""#, r#"declaredType="Mode""#),
    (r#"intervalDecimal="0.1""#, r#"intervalDecimal="-0.1""#),
    (
        r#"intervalDecimal="0.1""#,
        r#"intervalDecimal="0.1" intervalCounter="1""#,
    ),
    (
        r#"intervalDecimal="0.1""#,
        r#"intervalDecimal="0.1" supportsFraction="true" intervalCounter="0""#,
    ),
    (
        r#"intervalDecimal="0.1""#,
        r#"intervalDecimal="0.1" shiftDecimal="-1""#,
    ),
    // Variables.
    (
        r#"name="y" valueReference="16""#,
        r#"name="y" valueReference="4""#,
    ),
    (r#"name="z""#, r#"name="position""#),
    (
        r#"<Alias name="position" displayUnit="ft"/>"#,
        r#"<Alias name="x" displayUnit="ft"/>"#,
    ),
    (
        r#"<Alias name="position" displayUnit="ft"/>"#,
        r#"<Alias name="the position" displayUnit="ft"/>"#,
    ),
    (
        r#"<Float64 name="time" valueReference="0" causality="independent"/>"#,
        r#"<Float64 name="time" valueReference="0"/>"#,
    ),
    (
        r#"<Float64 name="time" valueReference="0" causality="independent"/>"#,
        r#"<Int64 name="time" valueReference="0" causality="independent" variability="continuous"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" causality="independent"/>"#,
    ),
    (
        r#"<Float64 name="time" valueReference="0" causality="independent"/>"#,
        r#"<Float64 name="time" valueReference="0" causality="independent" initial="exact" start="0"/>"#,
    ),
    (
        r#"causality="parameter" variability="tunable""#,
        r#"causality="parameter" variability="continuous""#,
    ),
    (
        r#"causality="input" declaredType="Length""#,
        r#"causality="input" initial="approx" declaredType="Length""#,
    ),
    (
        r#"<Int8 name="gear" valueReference="7" causality="output""#,
        r#"<Int8 name="gear" valueReference="7" causality="output" variability="continuous""#,
    ),
    (r#"<Start value="hello"/>"#, r#""#),
    (r#"start="3" max="10""#, r#"max="10""#),
    (
        r#"<Float64 name="c" valueReference="17" causality="calculatedParameter"/>"#,
        r#"<Float64 name="c" valueReference="17" causality="calculatedParameter" start="1"/>"#,
    ),
    (r#"start="0 1 2""#, r#"start="0 1""#),
    (r#"start="0 1 2""#, r#"start="0 1 200""#),
    (
        r#"<Start value="hello"/>"#,
        r#"<Start value="hello"/><Start value="world"/>"#,
    ),
    (r#"<Start value="CAFE"/>"#, r#"<Start value="CAFECAFECA"/>"#),
    (
        r#"declaredType="Mode" start="1""#,
        r#"declaredType="Mode" start="2""#,
    ),
    (r#"start="3" max="10""#, r#"start="11" max="10""#),
    (r#"start="3" max="10""#, r#"start="0" max="10""#),
    (r#"<UInt64 name="n""#, r#"<UInt32 name="n""#),
    (
        r#"causality="structuralParameter" start"#,
        r#"causality="parameter" start"#,
    ),
    (
        r#"start="3" max="10"/>"#,
        r#"start="3" max="10"><Dimension start="1"/></UInt64>"#,
    ),
    (
        r#"<Dimension valueReference="1"/>"#,
        r#"<Dimension valueReference="99"/>"#,
    ),
    (
        r#"<Dimension valueReference="1"/>"#,
        r#"<Dimension start="0"/>"#,
    ),
    (
        r#"causality="parameter" variability="tunable""#,
        r#"causality="parameter" variability="tunable" intermediateUpdate="true""#,
    ),
    (
        r#"causality="parameter" variability="tunable""#,
        r#"causality="parameter" variability="tunable" canHandleMultipleSetPerTimeInstant="false""#,
    ),
    // States.
    (r#"derivative="4""#, r#"derivative="5""#),
    (r#"derivative="4""#, r#"derivative="8""#),
    (r#"derivative="4""#, r#"derivative="99""#),
    (
        r#"derivative="4"><Dimension start="2"/>"#,
        r#"derivative="4"><Dimension start="3"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" reinit="true"/>"#,
    ),
    (
        r#"<Float64 name="x" valueReference="4" causality="output" initial="exact""#,
        r#"<Float64 name="x" valueReference="4" causality="parameter" initial="exact""#,
    ),
    // Clocks.
    (
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"/>"#,
        r#"<Clock name="tick" valueReference="12" causality="parameter" declaredType="Sampling" intervalVariability="constant"/>"#,
    ),
    (
        r#"causality="output" intervalVariability="triggered""#,
        r#"causality="output" intervalVariability="countdown""#,
    ),
    (
        r#"causality="output" intervalVariability="triggered""#,
        r#"causality="output" intervalVariability="triggered" intervalDecimal="1""#,
    ),
    (
        r#"causality="output" intervalVariability="triggered""#,
        r#"causality="input" priority="1" intervalVariability="fixed""#,
    ),
    (
        r#"causality="output" intervalVariability="triggered""#,
        r#"causality="output" intervalVariability="triggered" clocks="13""#,
    ),
    (
        r#"clocks="12" previous="15""#,
        r#"clocks="11" previous="15""#,
    ),
    (
        r#"clocks="12" previous="15""#,
        r#"clocks="98" previous="15""#,
    ),
    (r#"clocks="12" previous="15""#, r#"previous="15""#),
    (
        r#"clocks="12" previous="15""#,
        r#"clocks="12" previous="14""#,
    ),
    (
        r#"clocks="12" previous="15""#,
        r#"clocks="12" previous="9""#,
    ),
    (
        r#"clocks="12" previous="15""#,
        r#"clocks="12" previous="15" variability="constant""#,
    ),
    (
        r#"<Float64 name="c" valueReference="17" causality="calculatedParameter"/>"#,
        r#"<Float64 name="c" valueReference="17" causality="calculatedParameter"/><Int32 name="again" valueReference="18" initial="exact" start="0" clocks="12" previous="15"/>"#,
    ),
    // The structure.
    (r#"<Output valueReference="7" dependencies=""/>"#, r#""#),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies=""/><Output valueReference="7" dependencies=""/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies=""/><Output valueReference="6" dependencies=""/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies=""/><Output valueReference="77" dependencies=""/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="78"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="17"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="3" dependenciesKind="fixed"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7"/>"#,
    ),
    (
        r#"dependencies="4 3 2" dependenciesKind="dependent constant constant""#,
        r#"dependencies="4 3 2" dependenciesKind="dependent""#,
    ),
    (
        r#"dependencies="4 3 2" dependenciesKind="dependent constant constant""#,
        r#"dependencies="4 3 4""#,
    ),
    (
        r#"dependencies="4 3 2" dependenciesKind="dependent constant constant""#,
        r#"dependenciesKind="dependent""#,
    ),
    (
        r#"<ContinuousStateDerivative valueReference="5" dependencies="3"/>"#,
        r#"<ContinuousStateDerivative valueReference="6" dependencies="3"/>"#,
    ),
    (r#"<ClockedState valueReference="14"/>"#, r#""#),
    (
        r#"<ClockedState valueReference="14"/>"#,
        r#"<ClockedState valueReference="14"/><ClockedState valueReference="15"/>"#,
    ),
    (
        r#"<InitialUnknown valueReference="5" dependencies="3"/>"#,
        r#""#,
    ),
    (
        r#"<InitialUnknown valueReference="17" dependencies="2"/>"#,
        r#"<InitialUnknown valueReference="17" dependencies="6"/>"#,
    ),
    (
        r#"<InitialUnknown valueReference="17" dependencies="2"/>"#,
        r#"<InitialUnknown valueReference="17" dependencies="2" dependenciesKind="tunable"/>"#,
    ),
    (
        r#"<InitialUnknown valueReference="17" dependencies="2"/>"#,
        r#"<InitialUnknown valueReference="17" dependencies="2"/><InitialUnknown valueReference="6" dependencies="2"/>"#,
    ),
    (
        r#"<EventIndicator valueReference="6" dependencies="4"/>"#,
        r#"<EventIndicator valueReference="7" dependencies="4"/>"#,
    ),
    // Units and types, further.
    (r#"<Unit name="m/s">"#, r#"<Unit name="m">"#),
    (
        r#"<DisplayUnit name="ft" factor="3.28"/>"#,
        r#"<DisplayUnit name="ft" factor="3.28"/><DisplayUnit name="ft"/>"#,
    ),
    (r#"factor="3.28""#, r#"factor="0""#),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><BooleanType name="Length"/>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><Float32Type name="T" min="1" max="0"/>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><Int8Type name="T" min="1" max="0"/>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><Int8Type name="T" max="128"/>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><Float32Type name="T" max="1e39"/>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><Float64Type name="T" displayUnit="ft"/>"#,
    ),
    (
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/>"#,
        r#"<Float64Type name="Length" unit="m" min="-100" max="100"/><Float64Type name="T" unit="kg"/>"#,
    ),
    (
        r#"<Item name="on" value="1"/>"#,
        r#"<Item name="on" value="0"/>"#,
    ),
    (
        r#"<Category name="logStatusError"/>"#,
        r#"<Category name="logEvents"/>"#,
    ),
    (
        r#"intervalDecimal="0.1""#,
        r#"intervalDecimal="0.1" supportsFraction="true" resolution="10" shiftCounter="1""#,
    ),
    (
        r#"intervalVariability="constant" intervalDecimal="0.1""#,
        r#"intervalVariability="triggered" resolution="10""#,
    ),
    (
        r#"intervalDecimal="0.1""#,
        r#"intervalDecimal="0.1" supportsFraction="true" intervalCounter="1""#,
    ),
    // The experiment.
    (r#"stopTime="1""#, r#"stopTime="0""#),
    (r#"stepSize="0.1""#, r#"stepSize="2""#),
    (r#"tolerance="1e-6""#, r#"tolerance="-1""#),
    // Variables, further.
    (r#"name="flag""#, r#"name="der(flag)""#),
    (
        r#"name="y" valueReference="16""#,
        r#"name="y" valueReference="16" max="1e39""#,
    ),
    (
        r#"<Dimension valueReference="1"/>"#,
        r#"<Dimension valueReference="3"/>"#,
    ),
    (
        r#"min="-1" max="5"/>"#,
        r#"min="-1" max="5"><Alias name="g" displayUnit="ft"/></Int8>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6"><Alias name="zz" displayUnit="ft"/></Float64>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" nominal="0"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" min="1" max="0"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" displayUnit="ft"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" unit="kg"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" declaredType="Len"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" initial="exact"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" variability="constant"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" initial="approx"/>"#,
    ),
    (r#"<Float64 name="z" valueReference="6"/>"#, r#""#),
    (r#"<Start value="hello"/>"#, r#"<Start/>"#),
    (r#"<Start value="CAFE"/>"#, r#""#),
    (r#"start="1" min="-1""#, r#"start="1.5" min="-1""#),
    // Clocks, further.
    (r#"<ScheduledExecution modelIdentifier="m"/>"#, r#""#),
    (
        r#"causality="output" intervalVariability="triggered""#,
        r#"causality="output" intervalVariability="triggered" priority="2""#,
    ),
    (
        r#"clocks="12" previous="15""#,
        r#"clocks="a" previous="15""#,
    ),
    (r#"previous="15""#, r#"previous="99""#),
    (
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"/>"#,
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant" intermediateUpdate="true"/>"#,
    ),
    (
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant"/>"#,
        r#"<Clock name="tick" valueReference="12" causality="input" declaredType="Sampling" intervalVariability="constant" previous="13"/>"#,
    ),
    // The structure, further.
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="-1"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="a"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependenciesKind="constant"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="" dependenciesKind="constant"/>"#,
    ),
    (
        r#"<Output valueReference="7" dependencies=""/>"#,
        r#"<Output valueReference="7" dependencies="3 3"/>"#,
    ),
    (
        r#"<ContinuousStateDerivative valueReference="5" dependencies="3"/>"#,
        r#"<ContinuousStateDerivative valueReference="99" dependencies="3"/>"#,
    ),
    (
        r#"<ContinuousStateDerivative valueReference="5" dependencies="3"/>"#,
        r#"<ContinuousStateDerivative valueReference="16" dependencies="3"/>"#,
    ),
    (
        r#"<ClockedState valueReference="14"/>"#,
        r#"<ClockedState valueReference="14"/><ClockedState valueReference="14"/>"#,
    ),
    (
        r#"<ClockedState valueReference="14"/>"#,
        r#"<ClockedState valueReference="13"/>"#,
    ),
    (
        r#"<InitialUnknown valueReference="17" dependencies="2"/>"#,
        r#"<InitialUnknown valueReference="17" dependencies="2"/><InitialUnknown valueReference="17" dependencies="2"/>"#,
    ),
    (
        r#"<InitialUnknown valueReference="17" dependencies="2"/>"#,
        r#"<InitialUnknown valueReference="17" dependencies="5"/>"#,
    ),
    (
        r#"<InitialUnknown valueReference="17" dependencies="2"/>"#,
        r#"<InitialUnknown valueReference="7" dependencies=""/><InitialUnknown valueReference="17" dependencies="2"/>"#,
    ),
    (
        r#"<EventIndicator valueReference="6" dependencies="4"/>"#,
        r#"<EventIndicator valueReference="99" dependencies="4"/>"#,
    ),
    (r#"</ModelVariables>"#, r#""#),
    // What VDMCheck looks at beside these.
    (
        r#"  <ModelExchange modelIdentifier="m" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"/>
  <CoSimulation modelIdentifier="m" hasEventMode="true" providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true" fixedInternalStepSize="0.01"/>
  <ScheduledExecution modelIdentifier="m"/>
"#,
        "",
    ),
    (r#"05Z""#, r#"05""#),
    (
        r#"<Item name="on" value="1"/>"#,
        r#"<Item name="off" value="1"/>"#,
    ),
    (
        r#"causality="output" intervalVariability="triggered""#,
        r#"causality="output" intervalVariability="triggered" supportsFraction="true" resolution="10" intervalCounter="1""#,
    ),
    (
        r#"<Float64 name="der(x)" "#,
        r#"<Float64 name="der(x)" variability="discrete" "#,
    ),
    (
        r#"causality="calculatedParameter"/>"#,
        r#"causality="calculatedParameter" variability="continuous"/>"#,
    ),
    (
        r#"<Float64 name="z" valueReference="6"/>"#,
        r#"<Float64 name="z" valueReference="6" variability="fixed" initial="exact" start="1"/>"#,
    ),
];
