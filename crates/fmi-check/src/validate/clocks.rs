//! Clocks and clocked variables of FMI 3.0 (sections 2.2.8, 2.4.4 and 2.4.7.4).

use super::*;

impl Checker<'_> {
    pub(super) fn clocks(&mut self) {
        let description = self.description;
        let mut previous: HashMap<u32, &str> = HashMap::new();
        for (position, variable) in description.variables.iter().enumerate() {
            let index = position as u32 + 1;
            let mut rules = self.clocked(index, variable);
            rules.extend(self.previous(index, variable));
            if let Some(of) = variable.previous.filter(|&of| of != 0) {
                let first = *previous.entry(of).or_insert(&variable.name);
                if let (true, Some(of)) = (first != variable.name, self.at(of)) {
                    rules.push(Rule::SamePrevious {
                        name: of.name.clone(),
                        other: first.to_owned(),
                    });
                }
            }
            if let VariableKind::Clock { attributes, .. } = &variable.kind {
                rules.extend(attribute_rules(attributes, self.declared_clock(variable)));
                rules.extend(self.clock(variable, attributes));
            }
            for rule in rules {
                self.report_variable(position, rule);
            }
        }
    }

    fn clocked(&self, index: u32, variable: &ScalarVariable) -> Vec<Rule> {
        let mut rules = Vec::new();
        let variability = variable.variability;
        if !variable.clocks.is_empty()
            && !matches!(variability, Variability::Discrete | Variability::Tunable)
        {
            rules.push(Rule::ClockedVariability { variability });
        }
        for &of in &variable.clocks {
            match self.at(of) {
                Some(clock) if clock.kind.base_type() != BaseType::Clock => {
                    let name = clock.name.clone();
                    rules.push(Rule::NotAClock { name });
                }
                Some(_) if of == index => rules.push(Rule::ClockedByItself),
                _ => {}
            }
        }
        rules
    }

    fn previous(&self, index: u32, variable: &ScalarVariable) -> Vec<Rule> {
        let Some(of) = variable.previous else {
            return Vec::new();
        };
        let mut rules = Vec::new();
        if variable.clocks.is_empty() || variable.variability != Variability::Discrete {
            rules.push(Rule::PreviousNotClocked);
        }
        let is_good = |other: &ScalarVariable| {
            of != index
                && other.kind.base_type() == variable.kind.base_type()
                && other.variability == Variability::Discrete
                && other.causality != Causality::Input
        };
        if let Some(other) = self.at(of).filter(|other| !is_good(other)) {
            let name = other.name.clone();
            rules.push(Rule::BadPrevious { name });
        }
        rules
    }

    fn declared_clock(&self, variable: &ScalarVariable) -> Option<&ClockAttributes> {
        match self.declared(variable) {
            Some(TypeKind::Clock(declared)) => Some(declared),
            _ => None,
        }
    }

    fn clock(&self, variable: &ScalarVariable, attributes: &ClockAttributes) -> Vec<Rule> {
        let (causality, interval) = (variable.causality, attributes.interval_variability);
        let mut rules = Vec::new();
        match causality {
            Causality::Input | Causality::Local => {}
            Causality::Output if interval == IntervalVariability::Triggered => {}
            Causality::Output => rules.push(Rule::TimeBasedClock {
                interval,
                causality,
            }),
            _ => rules.push(Rule::ClockCausality { causality }),
        }
        let declared = self.declared_clock(variable);
        let has_interval = [Some(attributes), declared]
            .into_iter()
            .flatten()
            .any(|clock| clock.interval_decimal.is_some() || clock.interval_counter.is_some());
        let is_given = matches!(
            interval,
            IntervalVariability::Constant | IntervalVariability::Fixed
        );
        if is_given && !has_interval {
            rules.push(Rule::NoInterval { interval });
        }
        let inherited = declared.and_then(|c| c.priority);
        let has_priority = attributes.priority.or(inherited).is_some();
        match (&self.description.scheduled_execution, causality) {
            (Some(_), Causality::Input) if !has_priority => rules.push(Rule::NoPriority),
            (Some(_), Causality::Input | Causality::Local) => {}
            _ if has_priority => rules.push(Rule::UnusedPriority),
            _ => {}
        }
        rules
    }
}

/// Checks that the attributes of a clock are consistent, including those of the declared type; or those of a type.
pub(super) fn attribute_rules(
    clock: &ClockAttributes,
    declared: Option<&ClockAttributes>,
) -> Vec<Rule> {
    use IntervalVariability as I;
    let interval = clock.interval_variability;
    let is_periodic = matches!(interval, I::Constant | I::Fixed | I::Tunable);
    let has_resolution =
        clock.resolution.is_some() || declared.is_some_and(|d| d.resolution.is_some());
    let mut rules = Vec::new();
    for (attribute, is_present) in [
        ("intervalDecimal", clock.interval_decimal.is_some()),
        ("shiftDecimal", clock.shift_decimal != 0.0),
        ("resolution", clock.resolution.is_some()),
        ("intervalCounter", clock.interval_counter.is_some()),
        ("shiftCounter", clock.shift_counter != 0),
    ] {
        let is_counter = attribute.ends_with("Counter");
        if !is_present {
            continue;
        }
        if !is_periodic {
            rules.push(Rule::NotForInterval {
                attribute,
                interval,
            });
        } else if is_counter && !clock.supports_fraction {
            let needed = "supportsFraction=\"true\"";
            rules.push(Rule::ClockNeeds { attribute, needed });
        } else if is_counter && !has_resolution {
            let needed = "resolution";
            rules.push(Rule::ClockNeeds { attribute, needed });
        }
    }
    let has_counter =
        clock.interval_counter.is_some() || declared.is_some_and(|d| d.interval_counter.is_some());
    if clock.shift_counter != 0 && !has_counter {
        rules.push(Rule::ShiftWithoutInterval);
    }
    let interval = clock
        .interval_decimal
        .filter(|v| *v <= 0.0 || !v.is_finite());
    let counters = [
        ("intervalCounter", clock.interval_counter),
        ("resolution", clock.resolution),
    ];
    let zeros = counters.into_iter().filter(|(_, value)| *value == Some(0));
    let zeros = zeros.map(|(attribute, _)| (attribute, "0".to_owned()));
    for (attribute, found) in interval
        .map(|v| ("intervalDecimal", v.to_string()))
        .into_iter()
        .chain(zeros)
    {
        rules.push(Rule::NotPositive { attribute, found });
    }
    let found = clock.shift_decimal;
    if found < 0.0 || found.is_nan() {
        rules.push(Rule::NegativeShift { found });
    }
    rules
}
