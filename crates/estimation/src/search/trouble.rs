//! Locates where a problem is not finite at its start.

use crate::posed::Posed;
use crate::posed::variables;
use crate::problem::file::Noise;
use crate::search::begin::begin;
use crate::search::starts::Start;
use crate::system::joint::Joint;
use crate::system::part::FmuPart;
use pilotage_expression::Node;

/// The first expression that is not finite where a search begins, with its instance, run and time. None if all are
/// finite.
pub fn at_start(posed: &Posed<'_>, start: &Start) -> Option<String> {
    let (problem, z) = begin(posed, start, &|| false);
    let theta = problem.physical_theta(&z);
    (0..posed.runs.len()).find_map(|j| {
        let states = problem.states_at_samples(&z, j);
        let mut samples = states.iter().enumerate();
        samples.find_map(|(sample, x)| {
            let at = variables(posed, j, sample, x, &theta);
            let found = at_sample(posed, &at).or_else(|| of_residuals(posed, (j, sample), &at))?;
            let time = posed.runs[j].time[sample] + posed.origins[j];
            Some(format!("{} at {time} s: {found}", posed.data[j].name()))
        })
    })
}

/// The measured signal at a sample (run and number) whose term of the objective is not finite.
fn of_residuals(posed: &Posed<'_>, (j, sample): (usize, usize), at: &[f64]) -> Option<String> {
    let (quantities, values) = (&posed.quantities, posed.model.system.graph.values(at));
    let mut measured = posed.file.measured.iter().enumerate();
    measured.find_map(|(k, own)| {
        let recorded = quantities.recorded[k][j][sample];
        let [predicted, sd] =
            [quantities.predicted[k], quantities.deviations[k]].map(|node| values[node.index()]);
        let square = own.noise.residual(recorded, predicted, sd).powi(2);
        let term = square * posed.data[j].line.weight;
        if recorded.is_nan() || term.is_finite() {
            return None;
        }
        let column = &own.column.value;
        let why = match own.noise {
            Noise::LogNormal if predicted <= 0.0 => {
                "log-normal noise has values above 0".to_owned()
            }
            _ => {
                format!(
                    "with the standard deviation {sd:?} the residual is too large to be squared"
                )
            }
        };
        Some(format!(
            "the column `{column}` has {recorded:?} where {predicted:?} is predicted; {why}"
        ))
    })
}

/// The first expression that is not finite at one point of the equations' variables.
fn at_sample(posed: &Posed<'_>, at: &[f64]) -> Option<String> {
    let values = posed.model.system.graph.values(at);
    let own: Vec<f64> = (posed.quantities.joint.iter())
        .map(|node| values[node.index()])
        .collect();
    let joint = &posed.joint.model;
    let of_instance = in_instances(posed, &own);
    let is_bad = |node: &Node| !values[node.index()].is_finite();
    let named = |kind: &str, name: &str, node: &Node| {
        format!("{kind} `{name}` is {}", values[node.index()])
    };
    let state = joint.states.iter().zip(&posed.model.system.derivatives);
    let of_state = || {
        let (name, node) = state.clone().find(|(_, node)| is_bad(node))?;
        Some(named("the derivative of", name, node))
    };
    let of_measured = || {
        let quantities = &posed.quantities;
        let lines = posed
            .file
            .measured
            .iter()
            .map(|line| line.column.value.as_str());
        let pairs = quantities.predicted.iter().zip(&quantities.deviations);
        lines
            .zip(pairs)
            .find_map(|(column, (predicted, deviation))| match is_bad(predicted) {
                true => Some(named("what should be measured in", column, predicted)),
                false => {
                    is_bad(deviation).then(|| named("the standard deviation of", column, deviation))
                }
            })
    };
    of_instance.or_else(of_state).or_else(of_measured)
}

/// The same within model files and FMUs, at a point of the joint model's variables.
fn in_instances(posed: &Posed<'_>, at: &[f64]) -> Option<String> {
    let joint = &posed.joint;
    let values = joint.model.system.graph.values(at);
    let mut first = 0;
    for (instance, part) in &joint.parts {
        let model = &part.model;
        let x = &at[1 + first..][..model.states.len()];
        first += model.states.len();
        if let Some(fmu) = &part.fmu {
            let prefix = format!("{instance}.");
            if let Some(text) = of_fmu(joint, fmu, &prefix, &values) {
                return Some(format!("`{instance}`, {text}"));
            }
        }
        let Some(file) = &part.file else { continue };
        let input = |name: &String| {
            let node = joint.signal(&format!("{instance}.{name}"));
            node.map_or(0.0, |node| values[node.index()])
        };
        let u: Vec<f64> = model.inputs.iter().map(input).collect();
        let offset = joint.model.system.parameter(0);
        let parameter = |name: &String| {
            let full = format!("{instance}.{name}");
            let place = joint.model.parameters.iter().position(|own| *own == full);
            place.map_or(0.0, |place| at[offset + place])
        };
        let p: Vec<f64> = model.parameters.iter().map(parameter).collect();
        if let Some(trouble) = file.trouble(at[0], x, &u, &p) {
            let name = std::path::Path::new(&file.file.file)
                .file_name()
                .unwrap_or_default();
            return Some(format!("`{instance}` ({}), {trouble}", name.display()));
        }
    }
    None
}

/// The message of an FMU about a derivative or an output that is not finite.
fn of_fmu(joint: &Joint, fmu: &FmuPart, prefix: &str, values: &[f64]) -> Option<String> {
    let (model, system) = (&joint.model, &joint.model.system);
    let states = model.states.iter().zip(&system.derivatives);
    let outputs = model.outputs.iter().zip(&system.outputs);
    let mut own = states
        .chain(outputs)
        .filter(|(name, _)| name.starts_with(prefix));
    own.find(|(_, node)| !values[node.index()].is_finite())?;
    let name = fmu.path.display();
    Some(format!("{name}, {}", fmu.function.trouble()?))
}
