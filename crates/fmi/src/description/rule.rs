//! Rules of the standard that a description may violate.

use super::{Causality, DependencyKind, FmiVersion, Initial, IntervalVariability, Variability};
use thiserror::Error;

/// The rules, each with the data needed to correct the file.
#[allow(missing_docs)] // The message of each variant is its documentation, the fields are in it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Rule {
    #[error("<{element}> lacks the attribute `{attribute}`")]
    MissingAttribute {
        element: String,
        attribute: &'static str,
    },
    #[error("<{element}> has no attribute `{attribute}` in the schema")]
    UnknownAttribute { element: String, attribute: String },
    #[error("<{element}> has {attribute}=\"{found}\", expected {expected}")]
    BadValue {
        element: String,
        attribute: String,
        found: String,
        expected: String,
    },
    #[error("<{parent}> lacks the element <{element}>")]
    MissingElement {
        parent: String,
        element: &'static str,
    },
    #[error("<{element}> is not expected in <{parent}>")]
    UnexpectedElement { parent: String, element: String },
    #[error("<{element}> stands after <{after}>, the schema wants it before")]
    MisplacedElement { element: String, after: String },
    #[error("the elements are in the namespace `{namespace}`; those of the standard have none")]
    Namespace { namespace: String },
    #[error("<{element}> is empty: leave it out")]
    EmptyElement { element: String },
    #[error("<{element}> has the text `{text}` between its tags, where only elements may stand")]
    UnexpectedText { element: String, text: String },
    #[error(
        "<{element}> has the attribute `{attribute}`, which the schema lets pass and the standard does not know"
    )]
    UnknownCapability { element: String, attribute: String },

    #[error("<{element}> has xsi:{attribute}, which readers of FMUs ignore")]
    SchemaInstance { element: String, attribute: String },
    #[error("tool `{name}` has annotations twice")]
    DuplicateTool { name: String },

    #[error("the root element is <{found}>, expected <{expected}>")]
    WrongRoot {
        found: String,
        expected: &'static str,
    },
    #[error("fmiVersion=\"{found}\", while modelDescription.xml says \"{expected}\"")]
    PartVersion { found: String, expected: String },
    #[error("<CoordinateSystem> goes from its lower left to its upper right: x1 < x2 and y1 < y2")]
    CoordinateOrder,
    #[error("<{element}> has no area: x1 equals x2, or y1 equals y2")]
    EmptyArea { element: String },
    #[error("terminal `{name}` is defined twice")]
    DuplicateTerminal { name: String },
    #[error("`{name}` is a member of the terminal twice under the same name")]
    DuplicateMember { name: String },
    #[error("<{element}> names `{name}`, which no variable is called")]
    UnknownMember { element: String, name: String },
    #[error("modelIdentifier=\"{found}\" is that of no interface in modelDescription.xml")]
    UnknownIdentifier { found: String },
    #[error("compilerOptions without compiler: it is unknown whose options these are")]
    OptionsWithoutCompiler,
    #[error("<{element}> `{name}` is listed twice")]
    DuplicateInBuild { element: String, name: String },

    #[error("fmiVersion=\"{found}\", expected \"{expected}\"")]
    FmiVersion { found: String, expected: FmiVersion },
    #[error("generationDateAndTime=\"{found}\" is not of the form YYYY-MM-DDThh:mm:ssZ")]
    DateFormat { found: String },
    #[error("generationDateAndTime=\"{found}\" is no date with time (xs:dateTime)")]
    NotADate { found: String },
    #[error("the {attribute} is empty")]
    EmptyGuid { attribute: &'static str },
    #[error("none of {expected} is there")]
    NoInterface { expected: &'static str },
    #[error("the file is encoded in {encoding}, the standard wants UTF-8")]
    NotUtf8 { encoding: &'static str },
    #[error("modelIdentifier=\"{found}\" is not a C identifier")]
    NotAnIdentifier { found: String },
    #[error(
        "needsExecutionTool=\"true\": the FMU does not run by itself and several tools refuse it"
    )]
    NeedsExecutionTool,
    #[error("{flag}=\"true\" needs {needed}=\"true\"")]
    FlagNeedsFlag {
        flag: &'static str,
        needed: &'static str,
    },
    #[error("<CoSimulation> needs hasEventMode=\"true\", since there are clocks (`{clock}`)")]
    ClocksWithoutEventMode { clock: String },
    #[error("source file `{name}` is listed twice")]
    DuplicateSource { name: String },
    #[error("source file `{name}` is not a path below `sources`")]
    SourceOutside { name: String },

    #[error("unit `{name}` is defined twice")]
    DuplicateUnit { name: String },
    #[error("unit `{name}` has no <BaseUnit>, so that it cannot be checked or converted")]
    UnitWithoutBase { name: String },
    #[error("unit `{unit}` is not defined under <UnitDefinitions>")]
    UnknownUnit { unit: String },
    #[error("display unit `{display_unit}` is not defined under unit `{unit}`")]
    UnknownDisplayUnit { display_unit: String, unit: String },
    #[error("unit `{unit}` has the display unit `{name}` twice")]
    DuplicateDisplayUnit { name: String, unit: String },
    #[error("unit `{name}` has {attribute}={found}, by which nothing can be converted")]
    BadConversion {
        name: String,
        attribute: &'static str,
        found: f64,
    },
    #[error("display unit `{name}` has an offset, which does not go with inverse=\"true\"")]
    InverseWithOffset { name: String },
    #[error("display unit `{display_unit}` without a unit")]
    DisplayUnitWithoutUnit { display_unit: String },
    #[error("type `{name}` is defined twice")]
    DuplicateType { name: String },
    #[error("type `{name}` has the name of a variable")]
    TypeNamedAsVariable { name: String },
    #[error("declaredType=\"{name}\" is not defined under <TypeDefinitions>")]
    UnknownType { name: String },
    #[error("declaredType=\"{name}\" is of base type {found}, expected {expected}")]
    WrongType {
        name: String,
        found: &'static str,
        expected: &'static str,
    },
    #[error("enumeration `{name}` has the item {item} twice")]
    DuplicateItem { name: String, item: String },
    #[error("start={start} is not an item of the enumeration `{name}`")]
    NotAnItem { start: i128, name: String },
    #[error("log category `{name}` is defined twice")]
    DuplicateCategory { name: String },
    #[error("stopTime={stop} is before startTime={start}")]
    StopBeforeStart { start: f64, stop: f64 },
    #[error("stopTime={stop} is the start time, so that nothing is simulated")]
    StopAtStart { stop: f64 },
    #[error("stepSize={step} is longer than the experiment, which lasts {duration} s")]
    StepBeyondStop { step: f64, duration: f64 },
    #[error("{attribute}={found} is not positive")]
    NotPositive {
        attribute: &'static str,
        found: String,
    },
    #[error("{attribute}={found} is not finite")]
    NotFinite { attribute: &'static str, found: f64 },
    #[error("{attribute} is not a number")]
    NotANumber { attribute: &'static str },

    #[error("variable `{name}` is defined twice, first on line {first}")]
    DuplicateVariable { name: String, first: u32 },
    #[error("the name is empty")]
    EmptyName,
    #[error("name {name:?} has a {character}, which no name may have")]
    ControlInName {
        name: String,
        character: &'static str,
    },
    #[error("valueReference {reference} is that of `{first}` too; in FMI 3.0 it is unique")]
    DuplicateReference { reference: u32, first: String },
    #[error("name `{name}` does not follow variableNamingConvention=\"structured\"")]
    NotStructured { name: String },
    #[error("name `{name}` is that of a derivative, which nothing of base type {base} is")]
    DerivativeName { name: String, base: &'static str },
    #[error(
        "variability=\"continuous\" is for reals, not for {base}: say `discrete`, `fixed` or `tunable`{}",
        if *.is_default { " (the default is `continuous`)" } else { "" }
    )]
    ContinuousNotReal {
        base: &'static str,
        is_default: bool,
    },
    #[error("causality=\"{causality}\" does not go with variability=\"{variability}\"")]
    CausalityVariability {
        causality: Causality,
        variability: Variability,
    },
    #[error(
        "causality=\"{causality}\" with variability=\"{variability}\" does not go with initial=\"{initial}\""
    )]
    InitialNotAllowed {
        causality: Causality,
        variability: Variability,
        initial: Initial,
    },
    #[error("the start value is missing ({why})")]
    MissingStart { why: String },
    #[error("a start value is not allowed ({why})")]
    ForbiddenStart { why: String },
    #[error("min={min} is greater than max={max}")]
    MinAboveMax { min: String, max: String },
    #[error("start={start} is outside min={min}, max={max}")]
    StartOutside {
        start: String,
        min: String,
        max: String,
    },
    #[error(
        "there are {found} start values, expected {}",
        if *.expected == 1 { "1".to_owned() } else { format!("1 or {expected}, the size of the array") }
    )]
    StartCount { found: usize, expected: u64 },
    #[error("a start value has {found} bytes, more than maxSize={limit}")]
    StartTooLong { found: usize, limit: u64 },
    #[error("nominal={found} is not positive")]
    NominalNotPositive { found: f64 },
    #[error("a second independent variable; the first is `{first}`")]
    SecondIndependent { first: String },
    #[error("no variable has causality=\"independent\"; exactly one must")]
    NoIndependent,
    #[error("the independent variable is of base type {base}, expected {expected}")]
    IndependentNotReal {
        base: &'static str,
        expected: &'static str,
    },
    #[error("reinit is for continuous-time states of Model Exchange")]
    Reinit,
    #[error("canHandleMultipleSetPerTimeInstant is for inputs{}", if *.model_exchange { " of Model Exchange" } else { "" })]
    MultipleSet { model_exchange: bool },
    #[error("{attribute} does not go with causality=\"{causality}\"")]
    NotForCausality {
        attribute: &'static str,
        causality: Causality,
    },
    #[error("{from} refers to valueReference {reference}, which no variable has")]
    NoSuchReference { from: &'static str, reference: u32 },
    #[error("<Dimension> needs one of `start` and `valueReference`")]
    DimensionSize,
    #[error("a <Dimension> is 0; no array is empty at the start")]
    EmptyDimension,
    #[error(
        "a <Dimension> refers to `{name}`, which is no UInt64 that is a structural parameter or a constant"
    )]
    BadDimension { name: String },
    #[error("a structural parameter is no array")]
    StructuralArray,
    #[error("derivative=\"{index}\" is not the index of another continuous real (1 to {count})")]
    BadDerivative { index: u32, count: usize },
    #[error("is the derivative of `{name}`, which is no other continuous floating-point variable")]
    NotAState { name: String },
    #[error("is the derivative of `{name}`, which has another base type or other dimensions")]
    DerivativeShape { name: String },
    #[error(
        "is a continuous-time state and has causality=\"{causality}\", expected local or output"
    )]
    StateCausality { causality: Causality },
    #[error("clocks refers to `{name}`, which is no clock")]
    NotAClock { name: String },
    #[error("a clock cannot be clocked by itself")]
    ClockedByItself,
    #[error("is clocked and has variability=\"{variability}\", expected discrete or tunable")]
    ClockedVariability { variability: Variability },
    #[error("previous is for clocked variables of variability discrete, which have `clocks`")]
    PreviousNotClocked,
    #[error(
        "previous refers to `{name}`, which is no other discrete variable of the same base type and not an input"
    )]
    BadPrevious { name: String },
    #[error("previous refers to `{name}`, as that of `{other}` does")]
    SamePrevious { name: String, other: String },
    #[error("a clock has causality=\"{causality}\", expected input, output or local")]
    ClockCausality { causality: Causality },
    #[error(
        "a clock of intervalVariability=\"{interval}\" has causality=\"{causality}\", expected input"
    )]
    TimeBasedClock {
        interval: IntervalVariability,
        causality: Causality,
    },
    #[error("intervalVariability=\"{interval}\" needs intervalDecimal or intervalCounter")]
    NoInterval { interval: IntervalVariability },
    #[error("{attribute} does not go with intervalVariability=\"{interval}\"")]
    NotForInterval {
        attribute: &'static str,
        interval: IntervalVariability,
    },
    #[error("{attribute} needs {needed}")]
    ClockNeeds {
        attribute: &'static str,
        needed: &'static str,
    },
    #[error("shiftDecimal={found} is negative")]
    NegativeShift { found: f32 },
    #[error("<ScheduledExecution> needs the attribute `priority` of every input clock")]
    NoPriority,
    #[error("priority is for input clocks of <ScheduledExecution>; it is unused here")]
    UnusedPriority,
    #[error("shiftCounter without intervalCounter: there are no ticks to count")]
    ShiftWithoutInterval,
    #[error("shares valueReference {reference} with `{other}`: only one of them may be settable")]
    SettableAlias { reference: u32, other: String },
    #[error(
        "shares valueReference {reference} with `{other}`, which can be set: the independent variable cannot"
    )]
    SettableIndependent { reference: u32, other: String },
    #[error(
        "shares valueReference {reference} with `{other}` and has variability=\"{variability}\", expected \"{expected}\""
    )]
    AliasVariability {
        reference: u32,
        other: String,
        variability: Variability,
        expected: Variability,
    },
    #[error(
        "shares valueReference {reference} with `{other}`: only one of them may have a start value"
    )]
    AliasStart { reference: u32, other: String },
    #[error(
        "shares valueReference {reference} with `{other}`, whose unit is `{other_unit}`, not `{unit}`"
    )]
    AliasUnit {
        reference: u32,
        other: String,
        unit: String,
        other_unit: String,
    },
    #[error(
        "shares valueReference {reference} with `{other}`: either all of them are constants or none"
    )]
    AliasConstant { reference: u32, other: String },
    #[error("shares valueReference {reference} with `{other}`, a constant of another start value")]
    AliasValue { reference: u32, other: String },

    #[error("<{list}> lacks {variable}, `{name}`")]
    MissingUnknown {
        list: &'static str,
        variable: Handle,
        name: String,
    },
    #[error("<{list}> has {variable} twice")]
    DuplicateUnknown {
        list: &'static str,
        variable: Handle,
    },
    #[error("<{list}> refers to index {index}, expected 1 to {count}")]
    NoSuchIndex {
        list: &'static str,
        index: u32,
        count: usize,
    },
    #[error("<{list}> has {variable}, `{name}`, which has causality=\"{causality}\"")]
    NotAnOutput {
        list: &'static str,
        variable: Handle,
        name: String,
        causality: Causality,
    },
    #[error("<{list}> has {variable}, `{name}`, which has no attribute `derivative`")]
    NotADerivative {
        list: &'static str,
        variable: Handle,
        name: String,
    },
    #[error("<{list}> has {variable}, `{name}`, which is no continuous floating-point variable")]
    NotContinuous {
        list: &'static str,
        variable: Handle,
        name: String,
    },
    #[error("<{list}> has two derivatives of `{state}`: `{first}` and `{second}`")]
    TwoDerivatives {
        list: &'static str,
        state: String,
        first: String,
        second: String,
    },
    #[error("<{list}> has {variable}, `{name}`, which has no attribute `previous`")]
    NotAClockedState {
        list: &'static str,
        variable: Handle,
        name: String,
    },
    #[error("<{list}> has {variable}, `{name}`, which is not computed at initialization")]
    NotInitial {
        list: &'static str,
        variable: Handle,
        name: String,
    },
    #[error("<{list}> has {variable} after {previous}, expected ascending order")]
    UnorderedUnknowns {
        list: &'static str,
        variable: Handle,
        previous: u32,
    },
    #[error("{variable} has {dependencies} dependencies and {kinds} dependenciesKind")]
    KindCount {
        variable: Handle,
        dependencies: usize,
        kinds: usize,
    },
    #[error("{variable} has dependenciesKind without dependencies")]
    KindsWithoutDependencies { variable: Handle },
    #[error("<{list}> has dependenciesKind \"{kind}\", expected `dependent` or `constant`")]
    InitialKind {
        list: &'static str,
        kind: DependencyKind,
    },
    #[error(
        "{variable}, `{name}`, has dependenciesKind \"{kind}\", which is for floating-point unknowns; expected `dependent`"
    )]
    KindNotReal {
        variable: Handle,
        name: String,
        kind: DependencyKind,
    },
    #[error(
        "{variable} depends on {known}, `{name}`, which is not a known there (causality {causality})"
    )]
    BadKnown {
        variable: Handle,
        known: u32,
        name: String,
        causality: Causality,
    },
    #[error("{variable} depends on {known} twice")]
    DuplicateKnown { variable: Handle, known: u32 },
    #[error("the dependencies of {variable} are not in ascending order")]
    UnsortedDependencies { variable: Handle },
    #[error(
        "<{list}> does not declare the dependencies of {count} of its unknowns, so that other tools assume that they depend on everything"
    )]
    DependenciesNotDeclared { list: &'static str, count: usize },
}

impl Rule {
    /// Whether a default was substituted for the value, so that the FMU cannot be used.
    pub fn leaves_value_unknown(&self) -> bool {
        matches!(
            self,
            Self::MissingAttribute { .. }
                | Self::BadValue { .. }
                | Self::MissingElement { .. }
                | Self::NoSuchReference { .. }
                | Self::DimensionSize
        )
    }
}

/// How `<ModelStructure>` refers to a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handle {
    /// Its index in `<ModelVariables>`, from 1 (FMI 2.0).
    Index(u32),
    /// Its value reference (FMI 3.0).
    Reference(u32),
}

impl std::fmt::Display for Handle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Index(index) => write!(f, "index {index}"),
            Self::Reference(reference) => write!(f, "valueReference {reference}"),
        }
    }
}
