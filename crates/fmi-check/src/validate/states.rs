//! Continuous-time states and derivatives (FMI 2.0, sections 2.2.7 and 2.2.8; FMI 3.0, sections 2.4.7.5 and 2.4.8).

use super::*;

/// Indices (from 1) of the continuous states: the variables whose derivatives are listed.
pub(super) fn states(description: &ModelDescription) -> BTreeSet<u32> {
    let derivatives = &description.structure.derivatives;
    derivatives
        .iter()
        .filter_map(|u| {
            let position = (u.index as usize).checked_sub(1)?;
            derivative_of(description.variables.get(position)?)
        })
        .collect()
}

/// The attribute `derivative` of a variable.
pub(super) fn derivative_of(variable: &ScalarVariable) -> Option<u32> {
    match &variable.kind {
        VariableKind::Real(real) => real.derivative,
        _ => None,
    }
}

/// Whether a variable may be a state or the derivative of a state.
pub(super) fn is_continuous_real(variable: &ScalarVariable) -> bool {
    variable.variability == Variability::Continuous && variable.kind.base_type().is_real()
}

impl Checker<'_> {
    pub(super) fn states(&mut self) {
        let description = self.description;
        for (position, variable) in description.variables.iter().enumerate() {
            let index = position as u32 + 1;
            let mut rules: Vec<Rule> = self.derivative(index, variable).into_iter().collect();
            let is_state = self.states.contains(&index);
            let (causality, may_be_state) = (
                variable.causality,
                matches!(variable.causality, Causality::Local | Causality::Output),
            );
            if is_state && is_continuous_real(variable) && !may_be_state {
                rules.push(Rule::StateCausality { causality });
            }
            let is_reset = matches!(&variable.kind, VariableKind::Real(real) if real.reinit);
            // FMI 3.0 ignores the attribute without model exchange.
            let is_without_use = !self.is_v3() && description.model_exchange.is_none();
            if is_reset && (is_without_use || !is_state) {
                rules.push(Rule::Reinit);
            }
            for rule in rules {
                self.report_variable(position, rule);
            }
        }
    }

    fn derivative(&self, index: u32, variable: &ScalarVariable) -> Option<Rule> {
        // 0 in FMI 3.0: already reported by the reader.
        let of = derivative_of(variable).filter(|&of| !self.is_v3() || of != 0)?;
        let state = self
            .at(of)
            .filter(|state| of != index && is_continuous_real(state));
        match (state, self.version) {
            (None, FmiVersion::V2) => Some(Rule::BadDerivative {
                index: of,
                count: self.description.variables.len(),
            }),
            (None, FmiVersion::V3) => Some(Rule::NotAState {
                name: self.at(of)?.name.clone(),
            }),
            (Some(state), _) => {
                let is_alike = state.kind.base_type() == variable.kind.base_type()
                    && state.dimensions == variable.dimensions;
                (!is_alike).then(|| Rule::DerivativeShape {
                    name: state.name.clone(),
                })
            }
        }
    }
}
