//! What a fit leaves in the model file of an instance: the uncertainty of its parameters, and how the fit ended.

use crate::cli::made::with_sums;
use crate::document::{key, number, quoted};
use crate::estimation::uncertainty::Uncertainty;
use crate::estimation::{Fit, Posed};
use crate::inference::Interval;

/// The table `[fit]`: how the fit ended, the diagnostics, and the data with their SHA-256. The time it took is left out, so that
/// the same fit gives the same bytes.
pub fn provenance(posed: &Posed<'_>, fit: &Fit, instance: &str) -> String {
    let options = &posed.file.options;
    let mut text = format!(
        "[fit]                              # where the start values are from\ntool = \"pilotage {}\"\nproblem = {}\n\
         instance = {}\nstatus = {}\nconverged = {}\n",
        env!("CARGO_PKG_VERSION"),
        quoted(&posed.file.file),
        quoted(instance),
        quoted(fit.ending()),
        fit.is_answer(),
    );
    // Flights pose their problem in memory: vehicle, initial states, stability and options are nowhere else.
    if posed.file.runs.iter().any(|run| run.recorded.is_some()) {
        text += &match posed.file.text.contains("'''") {
            true => format!("posed = {}\n", quoted(&posed.file.text)),
            false => format!("posed = '''\n{}'''\n", posed.file.text),
        };
    }
    if fit.is_met() {
        text += &format!(
            "objective = {}\nchi2 = {}\nnllh = {}\n",
            number(fit.objective),
            number(fit.chi2),
            number(fit.nllh)
        );
    }
    text += &format!(
        "samples = {}\nkkt = {}\ntolerance = {}\nscheme = {}\niterations = {}\n",
        fit.samples,
        number(fit.kkt.residual()),
        number(options.tolerance),
        quoted(&fit.refinement.scheme.to_string()),
        fit.refinement.iterations,
    );
    let poles = fit
        .poles
        .iter()
        .map(|[re, im]| format!("[{}, {}]", number(*re), number(*im)));
    let poles: Vec<String> = poles.collect();
    if !poles.is_empty() {
        text += &format!(
            "stable = {}                      # the whole system, linearised where the first run ends\npoles = [{}] # [1/s]\n",
            fit.is_stable(),
            poles.join(", ")
        );
    }
    for own in &fit.diagnostics {
        text += &format!(
            "\n[[fit.doubt]]\ncode = {}\nwords = {}\n",
            quoted(own.code()),
            quoted(&own.to_string())
        );
    }
    for run in &posed.file.runs {
        let sum = with_sums(std::slice::from_ref(&run.file)).remove(0).1;
        text += &format!(
            "\n[[fit.data]]\nfile = {}\nsha256 = {}\nuse = \"{}\"\nweight = {}\n",
            quoted(&run.file.display().to_string()),
            quoted(&sum),
            if run.fits { "fit" } else { "validation" },
            number(run.weight)
        );
        text += &run
            .subject
            .as_ref()
            .map_or(String::new(), |own| format!("subject = {}\n", quoted(own)));
    }
    text
}

/// The table `[uncertainty]` of the instance whose variables have this prefix; `None` if no uncertainty is known.
pub fn table(fit: &Fit, prefix: &str) -> Option<String> {
    let own = fit.uncertainty.as_ref().ok()?;
    let intervals: Vec<(&str, f64, Interval)> = (fit.parameters.iter().zip(&own.intervals))
        .filter(|(found, _)| found.values.len() == 1)
        .filter_map(|(found, all)| {
            let name = found.name.strip_prefix(prefix)?;
            Some((name, found.values[0].1, *all.first()?))
        })
        // Parameters held fixed have no interval.
        .filter(|(.., own)| !own.sd.is_nan())
        .collect();
    if intervals.is_empty() {
        return None;
    }
    let mut text = format!(
        "[uncertainty]                      # 95 % intervals\nmethod = {}\ncorrelated_by = {}\n",
        quoted(own.method.as_str()),
        quoted(own.correlated_by.as_str())
    );
    text += &covariance(own, prefix, &intervals);
    text += "\n[uncertainty.intervals]\n";
    for (name, _, own) in &intervals {
        let [sd, low, high] = [own.sd, own.low, own.high].map(number);
        let name = key(name);
        text += &format!("{name} = {{ sd = {sd}, low = {low}, high = {high} }}\n");
    }
    Some(text)
}

/// The covariance of the parameters that the data determine, in their own units.
fn covariance(own: &Uncertainty, prefix: &str, intervals: &[(&str, f64, Interval)]) -> String {
    let mut known: Vec<(&str, usize, f64)> = Vec::new();
    for (k, name) in own.names.iter().enumerate() {
        let plain = name.strip_prefix("ln ");
        let Some(plain) = plain.unwrap_or(name).strip_prefix(prefix) else {
            continue;
        };
        let found = intervals.iter().find(|(own, ..)| *own == plain);
        if let Some((_, value, _)) = found.filter(|(.., interval)| interval.sd.is_finite()) {
            // d x = x d ln x.
            let slope = if name.starts_with("ln ") { *value } else { 1.0 };
            known.push((plain, k, slope));
        }
    }
    if known.is_empty() {
        return String::new();
    }
    let names: Vec<String> = known.iter().map(|own| quoted(own.0)).collect();
    let list = |all: Vec<f64>| {
        let all: Vec<String> = all.into_iter().map(number).collect();
        format!("[{}]", all.join(", "))
    };
    let matrix = &own.covariance.matrix;
    let row = |(_, i, a): &(&str, usize, f64)| {
        let row = (known.iter())
            .map(|(_, j, b)| a * b * f64::midpoint(matrix[(*i, *j)], matrix[(*j, *i)]));
        format!("    {},\n", list(row.collect()))
    };
    let rows: String = known.iter().map(row).collect();
    format!(
        "parameters = [{}]\ndegrees_of_freedom = {}\ncovariance = [                     # of these parameters\n{rows}]\n",
        names.join(", "),
        list(
            known
                .iter()
                .map(|known| own.covariance.degrees[known.1])
                .collect()
        )
    )
}
