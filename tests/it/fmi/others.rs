//! Good descriptions as other tools write them: their habits are no faults.

use super::findings::findings;

/// Comments between the variables, states first and their derivatives after them, aliases without a
/// start value, kinds with every dependency, annotations of the vendor.
const MODELICA_COMPILER: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription
  fmiVersion="2.0"
  modelName="Package.Pendulum"
  guid="{0a1b2c3d-0000-4000-8000-000000000001}"
  description=""
  generationTool="a Modelica compiler v1.2.3~dev"
  generationDateAndTime="2026-01-02T03:04:05Z"
  variableNamingConvention="structured"
  numberOfEventIndicators="2">
  <ModelExchange
    modelIdentifier="Package_Pendulum"
    canNotUseMemoryManagementFunctions="true"
    completedIntegratorStepNotNeeded="true">
    <SourceFiles>
      <File name="Package_Pendulum.c" />
      <File name="sub/functions.c" />
    </SourceFiles>
  </ModelExchange>
  <CoSimulation
    modelIdentifier="Package_Pendulum"
    canHandleVariableCommunicationStepSize="true">
    <SourceFiles>
      <File name="Package_Pendulum.c" />
    </SourceFiles>
  </CoSimulation>
  <UnitDefinitions>
    <Unit name="rad"><BaseUnit rad="1" /><DisplayUnit name="deg" factor="57.29577951308232" /></Unit>
    <Unit name="rad/s"><BaseUnit s="-1" rad="1" /></Unit>
    <Unit name="degC"><BaseUnit K="1" offset="273.15" /></Unit>
    <Unit name="1"><BaseUnit /></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Modelica.Units.SI.Angle"><Real quantity="Angle" unit="rad" displayUnit="deg" /></SimpleType>
    <SimpleType name="Package.State"><Enumeration><Item name="rest" value="1" /><Item name="swing" value="2" /></Enumeration></SimpleType>
  </TypeDefinitions>
  <LogCategories>
    <Category name="logEvents" description="logEvents" />
    <Category name="logFmi2Call" />
  </LogCategories>
  <DefaultExperiment startTime="0.0" stopTime="1.0" tolerance="1e-06" stepSize="0.002"/>
  <VendorAnnotations>
    <Tool name="x"><x:settings xmlns:x="urn:x" deep="1"><y/>text</x:settings></Tool>
    <Tool name="y"/>
  </VendorAnnotations>
  <ModelVariables>
  <!-- Index of variable = "1" -->
  <ScalarVariable name="phi" valueReference="0" description="angle" variability="continuous" causality="local" initial="approx">
    <Real declaredType="Modelica.Units.SI.Angle" start="0.1" nominal="1e-3" unbounded="true"/>
  </ScalarVariable>
  <!-- Index of variable = "2" -->
  <ScalarVariable name="w" valueReference="1" causality="local" initial="exact">
    <Real start="-0.0" unit="rad/s" reinit="true"/>
  </ScalarVariable>
  <ScalarVariable name="der(phi)" valueReference="2" causality="local" initial="calculated"><Real derivative="1" unit="rad/s"/></ScalarVariable>
  <ScalarVariable name="der(w)" valueReference="3"><Real derivative="2"/></ScalarVariable>
  <ScalarVariable name="body.shape.R.T[1,2]" valueReference="4" variability="constant"><Real start="1"/></ScalarVariable>
  <ScalarVariable name="_cse1.'quoted name'" valueReference="5"><Real/></ScalarVariable>
  <ScalarVariable name="alias" valueReference="0" causality="output"><Real unit="rad"/></ScalarVariable>
  <ScalarVariable name="m" valueReference="6" causality="parameter" variability="fixed" initial="exact"><Real start="1" min="0.0"/></ScalarVariable>
  <ScalarVariable name="J" valueReference="7" causality="calculatedParameter" variability="fixed"><Real/></ScalarVariable>
  <ScalarVariable name="state" valueReference="0" variability="discrete"><Enumeration declaredType="Package.State"/></ScalarVariable>
  <ScalarVariable name="on" valueReference="0" causality="input" variability="discrete"><Boolean start="0"/></ScalarVariable>
  <ScalarVariable name="T" valueReference="8" causality="input"><Real start="20" unit="degC" relativeQuantity="false"/></ScalarVariable>
  <ScalarVariable name="file" valueReference="0" causality="parameter" variability="fixed"><String start=""/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
      <Unknown index="7" dependencies="1" dependenciesKind="dependent" />
    </Outputs>
    <Derivatives>
      <Unknown index="3" dependencies="2" dependenciesKind="dependent" />
      <Unknown index="4" dependencies="1 2 12" dependenciesKind="dependent fixed tunable" />
    </Derivatives>
    <InitialUnknowns>
      <Unknown index="1" dependencies="" />
      <Unknown index="3" dependencies="2" dependenciesKind="constant" />
      <Unknown index="4" dependencies="2 8" dependenciesKind="dependent dependent" />
      <Unknown index="7" dependencies="11 12" />
      <Unknown index="9" dependencies="8" />
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

/// A schema's location, flat names with blanks and brackets, CoSimulation before ModelExchange, empty
/// dependencies of an output that changes in steps alone.
const BLOCK_DIAGRAM: &str = r#"<?xml version="1.0" encoding="utf-8" standalone="no"?><?tool version="3"?>
<fmiModelDescription xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="fmi2ModelDescription.xsd" fmiVersion="2.0" modelName="gain" guid="f0f1" author="Ä. Ö. &lt;a@b&gt;" version="1.7" copyright="©" license="-" generationTool="a block diagram tool" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="gain" canInterpolateInputs="true" maxOutputDerivativeOrder="1" canNotUseMemoryManagementFunctions="true"/>
  <ModelExchange modelIdentifier="gain"/>
  <DefaultExperiment stopTime="10"/>
  <ModelVariables>
    <ScalarVariable name="Sum of (a+b) [m/s²]" valueReference="1073741824" causality="output" variability="discrete" description="&quot;quoted&quot;&#10;second line"><Real/></ScalarVariable>
    <ScalarVariable name="In1.Bus[0]" valueReference="4294967295" causality="input" variability="discrete"><Integer start="-2147483648" min="-2147483648" max="2147483647"/></ScalarVariable>
    <ScalarVariable name="time" valueReference="2" causality="independent" variability="continuous"><Real/></ScalarVariable>
    <ScalarVariable name="p" valueReference="3" causality="parameter" variability="tunable"><Real start="1E-3" max="INF" min="-INF"/><Annotations><Tool name="t"><a/></Tool></Annotations></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="1" dependencies=""/></Outputs><InitialUnknowns><Unknown index="1" dependencies="" dependenciesKind=""/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"#;

/// Scheduled execution: partitions of a task, an output clock that others start.
const SCHEDULED: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0.2" modelName="tasks" instantiationToken="{t}" generationTool="reference">
  <ScheduledExecution modelIdentifier="tasks"/>
  <ModelVariables>
    <Float64 name="time" valueReference="7" causality="independent" variability="continuous" description="Simulation time"/>
    <Clock name="fast" valueReference="11" causality="input" intervalVariability="constant" intervalDecimal="0.01" shiftDecimal="0.5" priority="0"/>
    <Clock name="counted" valueReference="12" causality="input" intervalVariability="fixed" supportsFraction="true" resolution="1000" intervalCounter="10" shiftCounter="5" priority="1"/>
    <Clock name="aperiodic" valueReference="13" causality="input" intervalVariability="countdown" priority="2" clocks="11"/>
    <Clock name="changing" valueReference="14" causality="input" intervalVariability="changing" priority="4294967295"/>
    <Clock name="external" valueReference="15" causality="input" intervalVariability="triggered" priority="3" canBeDeactivated="true"/>
    <Clock name="done" valueReference="16" causality="output" intervalVariability="triggered" clocks="11 15"/>
    <Clock name="inner" valueReference="17" causality="local" intervalVariability="triggered"/>
    <Int32 name="ticks" valueReference="21" causality="output" clocks="11"/>
    <Int32 name="total" valueReference="22" causality="output" variability="discrete" initial="calculated"/>
    <UInt64 name="seed" valueReference="23" causality="parameter" start="18446744073709551615"/>
    <Int64 name="least" valueReference="24" causality="input" start="-9223372036854775808"/>
    <Boolean name="go" valueReference="25" causality="input" start="true"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="16" dependencies="11 15"/>
    <Output valueReference="21" dependencies="11"/>
    <Output valueReference="22" dependencies="25 24 21"/>
    <InitialUnknown valueReference="22" dependencies="23"/>
  </ModelStructure>
</fmiModelDescription>
"#;

/// Matrices sized by structural parameters, Float32, enumerations of 64 bits, a state that is an
/// output, parameters as knowns, an event indicator that is a state.
const ARRAYS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="linear" instantiationToken="token with blanks">
  <ModelExchange modelIdentifier="linear" needsCompletedIntegratorStep="false" providesAdjointDerivatives="true" x:extra="1" xmlns:x="urn:x"/>
  <CoSimulation modelIdentifier="linear_cs" maxOutputDerivativeOrder="2" recommendedIntermediateInputSmoothness="1" mightReturnEarlyFromDoStep="true"/>
  <TypeDefinitions>
    <Float32Type name="Ratio" min="0" max="1"><Annotations><Annotation type="a.b"/></Annotations></Float32Type>
    <EnumerationType name="Big" min="-4" max="5000000000"><Item name="low" value="-4"/><Item name="high" value="5000000000"/></EnumerationType>
    <BooleanType name="Switch"/><StringType name="Text" description="any"/>
    <BinaryType name="Image" mimeType="image/png" maxSize="1000000"/>
  </TypeDefinitions>
  <LogCategories><Category name="logStatusError"><Annotations><Annotation type="a.b"><c/></Annotation></Annotations></Category></LogCategories>
  <ModelVariables>
    <Float64 name="t" valueReference="0" causality="independent"/>
    <UInt64 name="n" valueReference="1" causality="structuralParameter" variability="tunable" start="2" min="0" max="5"/>
    <UInt64 name="three" valueReference="2" variability="constant" start="3"/>
    <Float64 name="A" valueReference="3" causality="parameter" variability="tunable" start="1 0 0 1"><Dimension valueReference="1"/><Dimension valueReference="1"/></Float64>
    <Float64 name="B" valueReference="4" causality="parameter" start="0.5"><Dimension valueReference="1"/><Dimension valueReference="2"/></Float64>
    <Float64 name="u" valueReference="5" causality="input" initial="exact" start="1
 2	3"><Annotations><Annotation type="a.b">text</Annotation></Annotations><Dimension valueReference="2"/></Float64>
    <Float64 name="x" valueReference="6" causality="output" initial="exact" start="0 0"><Dimension valueReference="1"/><Alias name="state" description="the same"/></Float64>
    <Float64 name="der(x)" valueReference="7" derivative="6"><Dimension valueReference="1"/></Float64>
    <Float32 name="ratio" valueReference="8" causality="parameter" declaredType="Ratio" start="0.1"/>
    <Enumeration name="big" valueReference="9" causality="parameter" declaredType="Big" start="5000000000 -4"><Dimension start="2"/></Enumeration>
    <Boolean name="switch" valueReference="10" causality="input" declaredType="Switch" start="0 1 true"><Dimension start="3"/></Boolean>
    <String name="texts" valueReference="11" causality="parameter" declaredType="Text"><Dimension start="2"/><Start value="a b"/><Start value=""/></String>
    <Binary name="image" valueReference="12" causality="input" declaredType="Image"><Start value=""/></Binary>
    <UInt8 name="byte" valueReference="13" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="6" dependencies="6"/>
    <Output valueReference="13" dependencies="9 8"/>
    <ContinuousStateDerivative valueReference="7" dependencies="3 4 5 6"/>
    <InitialUnknown valueReference="13" dependencies="8"/>
    <InitialUnknown valueReference="7" dependencies="3 4 5 6"/>
    <EventIndicator valueReference="6"/>
  </ModelStructure>
</fmiModelDescription>
"#;

#[test]
fn habits_of_other_tools_are_no_faults() {
    for good in [MODELICA_COMPILER, BLOCK_DIAGRAM, SCHEDULED, ARRAYS] {
        assert_eq!(findings(good), Vec::<String>::new(), "{good}");
    }
}
