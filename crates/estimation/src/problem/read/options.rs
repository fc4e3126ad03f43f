//! Reads stability conditions and options of the fit.

use super::Read;
use super::fields::{at, place, positive, tolerance, whole, word};
use crate::problem::file::{Limits, Mesh, Objective, Options, Stability};
use pilotage_collocation::Scheme;
use pilotage_cosim::description::Spanned;
use pilotage_inference::Method;
use pilotage_text::document::TomlTable;
use pilotage_text::suggestion::{did_you_mean, suggestion};

pub(super) fn stability(root: TomlTable<'_>) -> Read<Stability> {
    let Some(table) = root.table("stability")? else {
        return Ok(Stability::default());
    };
    table.only(&["models", "closed_loop"])?;
    let models = table.strings("models")?.unwrap_or_default();
    let models = models.into_iter().map(|(name, place)| Spanned {
        value: name.to_owned(),
        place: Some(place),
    });
    let closed = table.boolean("closed_loop")?.unwrap_or_default();
    Ok(Stability {
        models: models.collect(),
        closed_loop: closed.then(|| place(table, "closed_loop")),
    })
}

pub(super) fn options(root: TomlTable<'_>) -> Read<Options> {
    let mut options = Options::default();
    let Some(table) = root.table("fit")? else {
        return Ok(options);
    };
    let meshes = ["mesh_tolerance", "mesh_step", "mesh"];
    table.only(&[
        "objective",
        "scheme",
        meshes[0],
        meshes[1],
        meshes[2],
        "tolerance",
        "starts",
        "max_iterations",
        "limits",
        "covariance",
    ])?;
    let objectives = [
        ("response", Objective::Response),
        ("prediction-error", Objective::PredictionError),
    ];
    options.objective = word(table, "objective", &objectives, options.objective)?;
    if let Some(name) = table.string("scheme")? {
        let scheme: Result<Scheme, _> = name.parse();
        let known = ["euler", "trapezoid", "hermite-simpson"];
        let near = did_you_mean(suggestion(name, known));
        let scheme = scheme.map_err(|error| at(table, "scheme", format!("{error}{near}")));
        options.scheme = Some(scheme?);
    }
    let mut given = meshes.iter().filter(|field| table.has(field));
    if let (Some(first), Some(second)) = (given.next(), given.next()) {
        let fault = format!("`{first}` and `{second}` both say where the nodes are; leave one out");
        return Err(at(table, second, fault));
    }
    if let Some(tolerance) = tolerance(table, "mesh_tolerance")? {
        options.mesh = Mesh::Tolerance(tolerance);
    }
    if let Some(step) = positive(table, "mesh_step")? {
        options.mesh = Mesh::Step(step);
    }
    options.mesh = word(table, "mesh", &[("samples", Mesh::Samples)], options.mesh)?;
    options.tolerance = tolerance(table, "tolerance")?.unwrap_or(options.tolerance);
    if table.has("starts") {
        let starts = whole(table, "starts", Options::STARTS, Options::MOST_STARTS)?;
        options.starts = Some(starts);
    }
    let most = Options::MOST_ITERATIONS;
    options.max_iterations = whole(table, "max_iterations", options.max_iterations, most)?;
    let limits = Limits::ALL.map(|limits| (limits.as_str(), limits));
    options.limits = word(table, "limits", &limits, options.limits)?;
    let methods = Method::ALL.map(|method| (method.as_str(), Some(method)));
    options.covariance = word(table, "covariance", &methods, options.covariance)?;
    Ok(options)
}
