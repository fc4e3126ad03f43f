//! Describing functions as JSON for scripts.

use crate::inference::spectrum::{Checked, Describing, Point};
use nalgebra::Complex;
use serde_json::{Value, json};

/// Nonparametric estimates of pilot and loop; `null` if the runs give none.
pub fn to_json(describing: &Describing) -> Value {
    let left_out = describing.left_out.iter();
    let left_out = left_out.map(|(run, why)| json!({ "run": run, "words": why.to_string() }));
    match describing.is_empty() {
        true => Value::Null,
        false => json!({
            "pilot": checked(&describing.pilot),
            "open_loop": checked(&describing.open_loop),
            "left_out": left_out.collect::<Vec<_>>(),
        }),
    }
}

/// An array for each figure, over the lines.
fn checked(own: &Checked) -> Value {
    let of = |of: &dyn Fn(&Point) -> f64| own.points.iter().map(of).collect::<Vec<_>>();
    let fitted = |of: fn(&Complex<f64>) -> f64| own.fitted.iter().map(of).collect::<Vec<_>>();
    let runs = own.points.iter().map(|point| point.runs);
    json!({
        "frequency_rad_per_s": of(&|point| point.frequency),
        "gain": of(&|point| point.response.norm()),
        "gain_sd": of(&|point| point.response.norm() * point.sd),
        "phase_deg": of(&|point| point.response.arg().to_degrees()),
        "phase_sd_deg": of(&|point| point.sd.to_degrees()),
        "coherence": of(&|point| point.coherence),
        "remnant_density": of(&|point| point.remnant),
        "amplitude": of(&|point| point.amplitude),
        "runs": runs.collect::<Vec<_>>(),
        "fitted_gain": fitted(|own| own.norm()),
        "fitted_phase_deg": fitted(|own| own.arg().to_degrees()),
        "outside": (0..own.points.len()).map(|line| own.is_outside(line)).collect::<Vec<_>>(),
    })
}
