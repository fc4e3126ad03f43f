//! Allowed combinations of causality, variability, `initial` and start value (FMI 2.0, section 2.2.7; FMI 3.0, sections
//! 2.4.7.4 and 2.4.7.5).

use super::*;

/// The table of allowed combinations of causality, variability and initial.
pub(super) fn combination(variable: &ScalarVariable, version: FmiVersion) -> Option<Rule> {
    use Causality as C;
    use Initial as I;
    use Variability as V;
    let (causality, variability) = (variable.causality, variable.variability);
    let base = variable.kind.base_type();
    if variability == V::Continuous && !base.is_real() {
        let base = base.name(version);
        let is_default = version == FmiVersion::V2;
        return Some(Rule::ContinuousNotReal { base, is_default });
    }
    let allowed: &[I] = match (causality, variability) {
        (C::Parameter | C::StructuralParameter, V::Fixed | V::Tunable) => &[I::Exact],
        (C::CalculatedParameter, V::Fixed | V::Tunable) => &[I::Calculated, I::Approx],
        (C::Input, V::Discrete | V::Continuous) => match version {
            FmiVersion::V2 => &[],
            FmiVersion::V3 => &[I::Exact],
        },
        (C::Output | C::Local, V::Constant) => &[I::Exact],
        (C::Output | C::Local, V::Discrete | V::Continuous) => {
            &[I::Calculated, I::Exact, I::Approx]
        }
        (C::Local, V::Fixed | V::Tunable) => &[I::Calculated, I::Approx],
        (C::Independent, V::Continuous) => &[],
        // Clocks whose interval may be changed by the importer.
        (C::Input | C::Output, V::Tunable) if base == BaseType::Clock => &[],
        _ => {
            return Some(Rule::CausalityVariability {
                causality,
                variability,
            });
        }
    };
    let initial = variable.initial.filter(|i| !allowed.contains(i))?;
    Some(Rule::InitialNotAllowed {
        causality,
        variability,
        initial,
    })
}

/// Checks that a start value is present exactly if it is required.
pub(super) fn start_presence(variable: &ScalarVariable) -> Option<Rule> {
    if let VariableKind::Clock { .. } = variable.kind {
        return None;
    }
    let has_start = variable.kind.has_start();
    let causality = variable.causality;
    let by_causality = || format!("causality=\"{causality}\"");
    match (causality, variable.effective_initial()) {
        (Causality::Input | Causality::Parameter | Causality::StructuralParameter, _)
            if !has_start =>
        {
            Some(Rule::MissingStart {
                why: by_causality(),
            })
        }
        (Causality::Independent, _) if has_start => Some(Rule::ForbiddenStart {
            why: by_causality(),
        }),
        (_, Some(initial @ (Initial::Exact | Initial::Approx))) if !has_start => {
            Some(Rule::MissingStart {
                why: format!("initial=\"{initial}\""),
            })
        }
        (_, Some(initial @ Initial::Calculated)) if has_start => Some(Rule::ForbiddenStart {
            why: format!("initial=\"{initial}\""),
        }),
        _ => None,
    }
}
