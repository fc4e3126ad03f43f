//! Findings about a description, each with the violated rule of the standard.

use super::{Causality, FmiVersion, Place, Rule};
use thiserror::Error;

/// Severity of a [`Finding`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Conforming; for information only.
    Note,
    /// Conforming, but known to cause problems in other tools.
    Warning,
    /// Violates the standard.
    Error,
}

impl std::fmt::Display for Severity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// One finding and its place.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{severity}: {place}: {rule} (FMI {version}, section {section})", severity = self.severity(), section = self.section())]
pub struct Finding {
    /// The version of the standard that the file follows.
    pub version: FmiVersion,
    /// Place in modelDescription.xml.
    pub place: Place,
    /// Name of the variable concerned.
    pub variable: Option<String>,
    /// The violated rule, with its values.
    pub rule: Rule,
}

impl Severity {
    /// All severities, the most severe first.
    pub const ALL: [Self; 3] = [Self::Error, Self::Warning, Self::Note];
}

impl Finding {
    /// Its severity.
    pub fn severity(&self) -> Severity {
        use Rule::*;
        match self.rule {
            DependenciesNotDeclared { .. }
            | NeedsExecutionTool
            | UnitWithoutBase { .. }
            | DateFormat { .. } => Severity::Note,
            UnsortedDependencies { .. }
            // Importers ignore it; some exporters list parameters that way.
            | BadKnown {
                causality: Causality::Parameter,
                ..
            }
            | NominalNotPositive { .. }
            | NotANumber { .. }
            | NotUtf8 { .. }
            | KindNotReal { .. }
            | UnknownCapability { .. }
            | SchemaInstance { .. }
            | StopAtStart { .. }
            | StepBeyondStop { .. }
            | AliasVariability { .. }
            | UnusedPriority
            | DuplicateMember { .. }
            | ShiftWithoutInterval => Severity::Warning,
            _ => Severity::Error,
        }
    }

    /// Section of the standard that contains the rule: of FMI 2.0 (release 2.0.4) or of FMI 3.0.
    pub fn section(&self) -> &'static str {
        let (two, three) = self.rule.sections();
        match self.version {
            FmiVersion::V2 => two,
            FmiVersion::V3 => three,
        }
    }
}

impl Rule {
    /// The sections of FMI 2.0 and of FMI 3.0.
    fn sections(&self) -> (&'static str, &'static str) {
        use Rule::*;
        match self {
            MissingAttribute { .. }
            | UnknownAttribute { .. }
            | UnknownCapability { .. }
            | BadValue { .. }
            | MissingElement { .. }
            | UnexpectedElement { .. }
            | UnexpectedText { .. }
            | MisplacedElement { .. }
            | EmptyElement { .. }
            | SchemaInstance { .. }
            | Namespace { .. }
            | NotUtf8 { .. } => ("2.2", "2.4"),
            FmiVersion { .. }
            | DateFormat { .. }
            | NotADate { .. }
            | EmptyGuid { .. }
            | NoInterface { .. } => ("2.2.1", "2.4.1"),
            NotAnIdentifier { .. } | NeedsExecutionTool | FlagNeedsFlag { .. } => {
                ("4.3.1", "2.4.2")
            }
            DuplicateSource { .. } | SourceOutside { .. } => ("4.3.1", "2.5"),
            ClocksWithoutEventMode { .. } => ("4.3.1", "4.4"),
            NoPriority | UnusedPriority => ("2.2.3", "5.4"),
            DuplicateTool { .. } => ("2.2.6", "2.4"),
            WrongRoot { .. } | PartVersion { .. } => ("2.3", "2.5"),
            CoordinateOrder
            | EmptyArea { .. }
            | DuplicateTerminal { .. }
            | DuplicateMember { .. }
            | UnknownMember { .. } => ("2.3", "2.4.9"),
            UnknownIdentifier { .. } | OptionsWithoutCompiler | DuplicateInBuild { .. } => {
                ("2.3", "2.5")
            }
            DuplicateUnit { .. }
            | DuplicateDisplayUnit { .. }
            | BadConversion { .. }
            | InverseWithOffset { .. }
            | UnknownUnit { .. }
            | UnknownDisplayUnit { .. }
            | UnitWithoutBase { .. }
            | DisplayUnitWithoutUnit { .. } => ("2.2.2", "2.4.3"),
            DuplicateType { .. }
            | TypeNamedAsVariable { .. }
            | UnknownType { .. }
            | WrongType { .. }
            | DuplicateItem { .. }
            | NotAnItem { .. }
            | NoInterval { .. }
            | NotForInterval { .. }
            | ClockNeeds { .. }
            | ShiftWithoutInterval
            | NegativeShift { .. } => ("2.2.3", "2.4.4"),
            DuplicateCategory { .. } => ("2.2.4", "2.4.5"),
            NotPositive { attribute, .. } | NotFinite { attribute, .. } => match *attribute {
                "fixedInternalStepSize" => ("4.3.1", "4.4"),
                "suggestedScalingFactorTo_mm" | "defaultConnectionStrokeSize" => ("2.3", "2.4.9"),
                "intervalDecimal" | "intervalCounter" | "resolution" => ("2.2.3", "2.4.4"),
                _ => ("2.2.5", "2.4.6"),
            },
            StopBeforeStart { .. } | StopAtStart { .. } | StepBeyondStop { .. } => {
                ("2.2.5", "2.4.6")
            }
            NotStructured { .. } | EmptyName | ControlInName { .. } | DerivativeName { .. } => {
                ("2.2.9", "2.4.7.5.1")
            }
            MissingUnknown { .. }
            | DuplicateUnknown { .. }
            | NoSuchIndex { .. }
            | NotAnOutput { .. }
            | NotADerivative { .. }
            | NotContinuous { .. }
            | TwoDerivatives { .. }
            | NotAClockedState { .. }
            | NotInitial { .. }
            | UnorderedUnknowns { .. }
            | KindCount { .. }
            | KindsWithoutDependencies { .. }
            | InitialKind { .. }
            | KindNotReal { .. }
            | BadKnown { .. }
            | DuplicateKnown { .. }
            | UnsortedDependencies { .. }
            | DependenciesNotDeclared { .. } => ("2.2.8", "2.4.8"),
            DimensionSize | EmptyDimension | BadDimension { .. } | StructuralArray => {
                ("2.2.7", "2.4.7.2")
            }
            InitialNotAllowed { .. }
            | MissingStart { .. }
            | ForbiddenStart { .. }
            | StartOutside { .. }
            | StartCount { .. }
            | StartTooLong { .. }
            | BadDerivative { .. }
            | NotAState { .. }
            | DerivativeShape { .. }
            | Reinit => ("2.2.7", "2.4.7.5"),
            MinAboveMax { .. } | NotANumber { .. } | NominalNotPositive { .. } => {
                ("2.2.7", "2.4.4")
            }
            _ => ("2.2.7", "2.4.7.4"),
        }
    }
}
