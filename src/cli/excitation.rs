//! The excitation of flights, for people and for scripts.

use super::format::aligned;
use crate::inference::spectrum::{Excitation, Excited};
use pilotage_text::number::significant;
use serde_json::{Value, json};

/// The excitation as a JSON object; `null` if unknown.
pub fn to_json(excitation: Option<&Excitation>) -> Value {
    let Some(own) = excitation else {
        return Value::Null;
    };
    let of = |of: &dyn Fn(&Excited) -> Option<f64>| own.rows.iter().map(of).collect::<Vec<_>>();
    json!({
        "kind": if own.has_lines { "lines" } else { "bands" },
        "signal": signal(own),
        "frequency_rad_per_s": of(&|row| Some(row.frequency)),
        "forcing": of(&|row| Some(row.forcing)),
        "coherence": of(&|row| row.coherence),
        "by_chance": of(&|row| row.chance),
        "remnant_density": of(&|row| row.remnant),
        "phase_sd_deg": of(&|row| row.sd.map(f64::to_degrees)),
        "coherent_up_to_rad_per_s": own.highest(),
        "most_parameters": own.most_parameters(),
        "least_delay_s": own.least_delay(),
        "words": words(own),
    })
}

/// The conclusions, with advice for better flights.
pub fn words(own: &Excitation) -> Vec<String> {
    let advice = own.advice().map(str::to_owned);
    std::iter::once(own.to_string()).chain(advice).collect()
}

/// The conclusions as text, for the first lines of a fit.
pub fn first_lines(own: &Excitation) -> String {
    words(own)
        .iter()
        .map(|words| format!("{words}\n"))
        .collect()
}

/// A table of lines or bands, and the conclusions.
pub fn to_text(own: &Excitation) -> String {
    let forcing = if own.has_lines {
        "target [m]"
    } else {
        "target [m s]"
    };
    let remnant = match own.of_stick {
        true => "remnant [1/(rad/s)]",
        false => "remnant [m²/(rad/s)]",
    };
    let header = [
        "frequency [rad/s]",
        forcing,
        "coherence",
        remnant,
        "phase sd [deg]",
    ];
    let mut rows = vec![header.map(str::to_owned)];
    let shown = |own: Option<f64>| own.map_or("-".to_owned(), |own| significant(own, 3));
    for row in &own.rows {
        rows.push([
            significant(row.frequency, 4),
            significant(row.forcing, 3),
            row.coherence
                .map_or("-".to_owned(), |own| format!("{own:.3}")),
            shown(row.remnant),
            shown(row.sd.map(f64::to_degrees)),
        ]);
    }
    let kind = if own.has_lines { "lines" } else { "octaves" };
    format!(
        "\n{kind} of the target, and what of them comes back in the {}\n{}",
        signal(own),
        aligned(&rows)
    ) + &first_lines(own)
}

fn signal(own: &Excitation) -> &'static str {
    if own.of_stick { "stick" } else { "position" }
}
