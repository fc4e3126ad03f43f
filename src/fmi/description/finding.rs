//! What is wrong with a description: findings, each by its rule of the standard.

use super::{Causality, DependencyKind, FmiVersion, Initial, Place, Variability};
use thiserror::Error;

/// How bad a [`Finding`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Legal, but known to trouble other tools.
    Warning,
    /// Against the standard.
    Error,
}

impl std::fmt::Display for Severity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// One thing that is wrong, and where.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{severity}: {place}: {rule} (FMI {version}, section {section})", severity = self.severity(), section = self.section())]
pub struct Finding {
    /// The version of the standard that the file follows.
    pub version: FmiVersion,
    /// Where in modelDescription.xml.
    pub place: Place,
    /// Name of the variable it is about.
    pub variable: Option<String>,
    /// The rule that is broken, with the numbers.
    pub rule: Rule,
}

impl Finding {
    /// How bad it is.
    pub fn severity(&self) -> Severity {
        use Rule::*;
        match self.rule {
            DependenciesNotDeclared { .. }
            | NeedsExecutionTool
            | UnsortedDependencies { .. }
            | NominalNotPositive { .. }
            | UnitWithoutBase { .. }
            | DateFormat { .. } => Severity::Warning,
            _ => Severity::Error,
        }
    }

    /// Section of FMI 2.0 (release 2.0.4) that the rule stands in.
    pub fn section(&self) -> &'static str {
        use Rule::*;
        match self.rule {
            MissingAttribute { .. }
            | UnknownAttribute { .. }
            | BadValue { .. }
            | MissingElement { .. }
            | UnexpectedElement { .. }
            | MisplacedElement { .. }
            | EmptyElement { .. } => "2.2",
            FmiVersion { .. } | DateFormat { .. } | EmptyGuid | NoInterface => "2.2.1",
            DuplicateUnit { .. }
            | UnknownUnit { .. }
            | UnknownDisplayUnit { .. }
            | UnitWithoutBase { .. }
            | DisplayUnitWithoutUnit { .. } => "2.2.2",
            DuplicateType { .. }
            | TypeNamedAsVariable { .. }
            | UnknownType { .. }
            | WrongType { .. }
            | DuplicateItem { .. }
            | NotAnItem { .. } => "2.2.3",
            DuplicateCategory { .. } => "2.2.4",
            StopBeforeStart { .. } | NotPositive { .. } => "2.2.5",
            NotStructured { .. } => "2.2.9",
            MissingUnknown { .. }
            | DuplicateUnknown { .. }
            | NoSuchIndex { .. }
            | NotAnOutput { .. }
            | NotADerivative { .. }
            | NotInitial { .. }
            | UnorderedUnknowns { .. }
            | KindCount { .. }
            | KindsWithoutDependencies { .. }
            | InitialKind { .. }
            | BadKnown { .. }
            | DuplicateKnown { .. }
            | UnsortedDependencies { .. }
            | DependenciesNotDeclared { .. } => "2.2.8",
            NotAnIdentifier { .. } | NeedsExecutionTool | SerializeWithoutGet => "4.3.1",
            _ => "2.2.7",
        }
    }
}

/// The rules, each with what is needed to mend the file.
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
    #[error("<{element}> is empty: leave it out")]
    EmptyElement { element: String },

    #[error("fmiVersion=\"{found}\", expected \"{expected}\"")]
    FmiVersion { found: String, expected: FmiVersion },
    #[error("generationDateAndTime=\"{found}\" is not of the form YYYY-MM-DDThh:mm:ssZ")]
    DateFormat { found: String },
    #[error("the guid is empty")]
    EmptyGuid,
    #[error("neither <ModelExchange> nor <CoSimulation> is there")]
    NoInterface,
    #[error("modelIdentifier=\"{found}\" is not a C identifier")]
    NotAnIdentifier { found: String },
    #[error(
        "needsExecutionTool=\"true\": the FMU does not run by itself and several tools refuse it"
    )]
    NeedsExecutionTool,
    #[error("canSerializeFMUstate=\"true\" needs canGetAndSetFMUstate=\"true\"")]
    SerializeWithoutGet,

    #[error("unit `{name}` is defined twice")]
    DuplicateUnit { name: String },
    #[error("unit `{name}` has no <BaseUnit>, so that nobody can check or convert it")]
    UnitWithoutBase { name: String },
    #[error("unit `{unit}` is not defined under <UnitDefinitions>")]
    UnknownUnit { unit: String },
    #[error("display unit `{display_unit}` is not defined under unit `{unit}`")]
    UnknownDisplayUnit { display_unit: String, unit: String },
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
    #[error("{attribute}={found} is not positive")]
    NotPositive { attribute: &'static str, found: f64 },

    #[error("variable `{name}` is defined twice, first on line {first}")]
    DuplicateVariable { name: String, first: u32 },
    #[error("name `{name}` does not follow variableNamingConvention=\"structured\"")]
    NotStructured { name: String },
    #[error(
        "variability=\"continuous\" is for reals, not for {base}: say `discrete`, `fixed` or `tunable` (the default is `continuous`)"
    )]
    ContinuousNotReal { base: &'static str },
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
    MinAboveMax { min: f64, max: f64 },
    #[error("start={start} is outside min={min}, max={max}")]
    StartOutside { start: f64, min: f64, max: f64 },
    #[error("nominal={found} is not positive")]
    NominalNotPositive { found: f64 },
    #[error("a second independent variable; the first is `{first}`")]
    SecondIndependent { first: String },
    #[error("the independent variable is of base type {base}, expected Real")]
    IndependentNotReal { base: &'static str },
    #[error("reinit is for continuous-time states of Model Exchange")]
    Reinit,
    #[error("canHandleMultipleSetPerTimeInstant is for inputs of Model Exchange")]
    MultipleSet,
    #[error("{attribute} refers to valueReference {reference}, which no variable has")]
    NoSuchReference {
        attribute: &'static str,
        reference: u32,
    },
    #[error("<Dimension> needs one of `start` and `valueReference`")]
    DimensionSize,
    #[error("derivative=\"{index}\" is not the index of another continuous real (1 to {count})")]
    BadDerivative { index: u32, count: usize },
    #[error("shares valueReference {reference} with `{other}`: only one of them may be settable")]
    SettableAlias { reference: u32, other: String },
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

    #[error("<{list}> lacks index {index}, `{name}`")]
    MissingUnknown {
        list: &'static str,
        index: u32,
        name: String,
    },
    #[error("<{list}> has index {index} twice")]
    DuplicateUnknown { list: &'static str, index: u32 },
    #[error("<{list}> refers to index {index}, expected 1 to {count}")]
    NoSuchIndex {
        list: &'static str,
        index: u32,
        count: usize,
    },
    #[error("<Outputs> has index {index}, `{name}`, which has causality=\"{causality}\"")]
    NotAnOutput {
        index: u32,
        name: String,
        causality: Causality,
    },
    #[error("<Derivatives> has index {index}, `{name}`, which has no attribute `derivative`")]
    NotADerivative { index: u32, name: String },
    #[error(
        "<InitialUnknowns> has index {index}, `{name}`, which is not computed at initialization"
    )]
    NotInitial { index: u32, name: String },
    #[error("<InitialUnknowns> has index {index} after {previous}, expected ascending order")]
    UnorderedUnknowns { index: u32, previous: u32 },
    #[error("index {index} has {dependencies} dependencies and {kinds} dependenciesKind")]
    KindCount {
        index: u32,
        dependencies: usize,
        kinds: usize,
    },
    #[error("index {index} has dependenciesKind without dependencies")]
    KindsWithoutDependencies { index: u32 },
    #[error(
        "<InitialUnknowns> has dependenciesKind \"{kind}\", expected `dependent` or `constant`"
    )]
    InitialKind { kind: DependencyKind },
    #[error(
        "index {index} depends on {known}, `{name}`, which is not a known there (causality {causality})"
    )]
    BadKnown {
        index: u32,
        known: u32,
        name: String,
        causality: Causality,
    },
    #[error("index {index} depends on {known} twice")]
    DuplicateKnown { index: u32, known: u32 },
    #[error("the dependencies of index {index} are not in ascending order")]
    UnsortedDependencies { index: u32 },
    #[error(
        "<{list}> does not declare the dependencies of {count} of its unknowns, so that other tools assume that they depend on everything"
    )]
    DependenciesNotDeclared { list: &'static str, count: usize },
}

impl Rule {
    /// Whether the value read in its place is a guess, so that the FMU cannot be used.
    pub(super) fn leaves_value_unknown(&self) -> bool {
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
