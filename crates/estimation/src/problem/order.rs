//! The order of a problem's linear model.

use super::error::ProblemError;
use super::file::{Calibration, Deviation, Initial, Per, ProblemFile, Quantity, Sought};
use pilotage_cosim::description::{InstanceSource, Spanned};
use pilotage_language::file::Formula;
use pilotage_models::library;

/// The only instance whose model has an order.
pub(crate) fn instance(file: &ProblemFile) -> Result<String, ProblemError> {
    let has_order = |source: &InstanceSource| match source {
        InstanceSource::BuiltIn(name) => library::find(name).is_some_and(|own| own.has_order),
        InstanceSource::Model(_) | InstanceSource::Table(_) => false,
    };
    let instances = file.system.instances.iter();
    let found: Vec<&String> = instances
        .filter(|own| has_order(&own.source.value))
        .map(|own| &own.name)
        .collect();
    match found[..] {
        [one] => Ok(one.clone()),
        ref all => Err(ProblemError::Part(format!(
            "{}: {} instances have a model with an order; one must have it, such as model = \"linear\"",
            file.file,
            all.len()
        ))),
    }
}

impl ProblemFile {
    /// The order of an instance's model, if the file says it.
    pub(crate) fn order_of(&self, instance: &str) -> Option<u32> {
        let mut instances = self.system.instances.iter();
        let own = instances.find(|own| own.name == instance)?;
        own.order.as_ref().map(|own| own.value)
    }
}

/// Rejects settings of a coefficient other than that it is sought.
pub(crate) fn check(file: &ProblemFile, instance: &str) -> Result<(), ProblemError> {
    let is_meant = |name: &str| number(name, instance).is_some();
    let fault = |name: &str| {
        format!(
            "`{name}` has another meaning in each order: where orders are compared it is free, without range, prior or other \
             settings"
        )
    };
    let is_special = |line: &&Sought| {
        let is_bounded = line.min.is_some() || line.max.is_some() || line.prior.is_some();
        is_bounded || line.fixed || line.value.is_some() || line.per != Per::All || line.log
    };
    let lines = file
        .parameters
        .iter()
        .filter(|line| is_meant(&line.name.value));
    if let Some(line) = lines.clone().find(is_special) {
        let name = &line.name;
        return Err(ProblemError::maybe_at(
            name.place.as_ref(),
            fault(&name.value),
        ));
    }
    for formula in formulas(file) {
        if let Some(name) = formula.names().find(|name| is_meant(name)) {
            return Err(ProblemError::at(&file.place(formula), fault(name)));
        }
    }
    let set = file.runs.iter().flat_map(|run| run.sets());
    match set.map(|set| &set.name).find(|name| is_meant(&name.value)) {
        Some(name) => Err(ProblemError::maybe_at(
            name.place.as_ref(),
            fault(&name.value),
        )),
        None => Ok(()),
    }
}

/// All expressions of a file.
fn formulas(file: &ProblemFile) -> Vec<&Formula> {
    let mut all: Vec<&Formula> = Vec::new();
    for own in &file.measured {
        if let Deviation::Formula(formula) = &own.sd {
            all.push(formula);
        }
        if let Quantity::Expression(formula, _) = &own.of {
            all.push(formula);
        }
        for calibrated in [&own.gain, &own.offset] {
            if let Calibration::Formula(formula) = calibrated {
                all.push(formula);
            }
        }
    }
    all.extend(file.process_noise.iter().map(|own| &own.density));
    all.extend(file.parameters.iter().filter_map(|own| own.value.as_ref()));
    all.extend(file.initial.iter().filter_map(|(_, own)| match own {
        Initial::Formula(formula) => Some(formula),
        Initial::Free | Initial::Steady | Initial::FirstSample => None,
    }));
    all.extend(file.constraints.iter().map(|own| &own.formula));
    all.extend(file.derived.iter().map(|(_, formula)| formula));
    all.extend(
        file.runs
            .iter()
            .flat_map(|run| run.sets().chain(run.added()))
            .map(|set| &set.value),
    );
    all
}

/// Number, from 1, of the coefficient of an instance with this name.
pub(crate) fn number(name: &str, instance: &str) -> Option<usize> {
    let own = name.strip_prefix(instance)?.strip_prefix(".theta")?;
    own.parse().ok()
}

/// The problem with another order. All coefficients are sought, from these values or those of the model.
pub(crate) fn with_order(
    file: &ProblemFile,
    instance: &str,
    order: u32,
    start: Option<&[f64]>,
) -> ProblemFile {
    let mut file = file.clone();
    let mut is_own = false;
    for own in file
        .system
        .instances
        .iter_mut()
        .filter(|own| own.name == instance)
    {
        is_own = own.order.as_ref().is_some_and(|own| own.value == order);
        own.order = Some(Spanned::from(order));
    }
    if is_own && start.is_none() {
        return file;
    }
    let lines = file.parameters.iter();
    let first = lines
        .clone()
        .position(|line| number(&line.name.value, instance).is_some());
    let first = first.unwrap_or(file.parameters.len());
    file.parameters
        .retain(|line| number(&line.name.value, instance).is_none());
    let lines = (0..2 * order as usize).map(|k| Sought {
        name: Spanned::from(format!("{instance}.theta{}", k + 1)),
        start: start.map(|start| start[k]),
        min: None,
        max: None,
        nominal: None,
        unit: None,
        fixed: false,
        value: None,
        per: Per::All,
        log: false,
        prior: None,
    });
    let place = first.min(file.parameters.len());
    file.parameters.splice(place..place, lines);
    file
}

/// The coefficients of almost the same transfer function with one more pole, at this multiple of the magnitude of its poles, and a
/// zero that is `apart` times as far from 0, with which the pole cancels if that is 1. Coefficients are those of the denominator in
/// ascending powers of s without the leading 1, then those of the numerator.
pub(crate) fn with_pair(theta: &[f64], place: f64, apart: f64) -> Vec<f64> {
    let order = theta.len() / 2;
    let (below, above) = theta.split_at(order);
    let size = below[0].abs().powf(1.0 / order as f64);
    let pole = place * if size > 0.0 { size } else { 1.0 };
    // (s + a) times a polynomial with its leading coefficient last.
    let times = |own: &[f64], a: f64| -> Vec<f64> {
        let shifted = std::iter::once(0.0).chain(own.iter().copied());
        let scaled = own.iter().map(|c| a * c).chain(std::iter::once(0.0));
        scaled.zip(shifted).map(|(a, b)| a + b).collect()
    };
    let mut all = times(&[below, &[1.0]].concat(), pole);
    all.truncate(order + 1);
    let numerator = times(above, apart * pole);
    all.extend(numerator.iter().map(|c| c / apart));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3/(s + 2) is 3 (s + 4)/((s + 2)(s + 4)).
    #[test]
    fn a_pair_changes_nothing() {
        assert_eq!(with_pair(&[2.0, 3.0], 2.0, 1.0), [8.0, 6.0, 12.0, 3.0]);
    }

    /// 1/(s + 2) becomes (s + 6.6)/1.1 / ((s + 2)(s + 6)), with the same static gain.
    #[test]
    fn a_grown_transfer_function_is_nearly_the_same() {
        let found = with_pair(&[2.0, 1.0], 3.0, 1.1);
        let expected = [12.0, 8.0, 6.0, 1.0 / 1.1];
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert!(found.iter().zip(&expected).all(is_near), "{found:?}");
    }
}
