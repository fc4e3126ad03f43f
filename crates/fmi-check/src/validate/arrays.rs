//! Arrays and value references of FMI 3.0 (sections 2.4.7.2 and 2.4.7.4).

use super::*;

impl Checker<'_> {
    /// Checks that value references are unique.
    pub(super) fn references(&mut self) {
        let mut first: HashMap<u32, usize> = HashMap::new();
        for (position, variable) in self.description.variables.iter().enumerate() {
            let reference = variable.value_reference;
            let before = *first.entry(reference).or_insert(position);
            if before != position {
                let first = self.description.variables[before].name.clone();
                self.report_variable(position, Rule::DuplicateReference { reference, first });
            }
        }
    }

    pub(super) fn arrays(&mut self) {
        for (position, variable) in self.description.variables.iter().enumerate() {
            let mut rules: Vec<Rule> = Vec::new();
            let dimensions = variable.dimensions.iter();
            rules.extend(dimensions.filter_map(|d| self.dimension(d)));
            if variable.causality == Causality::StructuralParameter
                && !variable.dimensions.is_empty()
            {
                rules.push(Rule::StructuralArray);
            }
            if !self.doubtful.contains(variable.name.as_str()) {
                rules.extend(self.start_count(variable));
            }
            for rule in rules {
                self.report_variable(position, rule);
            }
        }
    }

    fn dimension(&self, dimension: &Dimension) -> Option<Rule> {
        let index = match dimension {
            Dimension::Fixed(size) => return (*size == 0).then_some(Rule::EmptyDimension),
            Dimension::Variable(index) => *index,
        };
        let size = self.at(index)?;
        let is_settled = size.causality == Causality::StructuralParameter
            || size.variability == Variability::Constant;
        match &size.kind {
            VariableKind::Integer {
                integer: IntegerType::UInt64,
                start,
                ..
            } if is_settled && size.dimensions.is_empty() => {
                (start.first() == Some(&0)).then_some(Rule::EmptyDimension)
            }
            _ => Some(Rule::BadDimension {
                name: size.name.clone(),
            }),
        }
    }
}
