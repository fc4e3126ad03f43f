//! A linear system for people.

use super::View;
use crate::cli::format;
use crate::cosim::Linearization;
use crate::linear::{Margins, Response, StateSpace};
use crate::report::significant;
use nalgebra::DMatrix;

/// Systems with more states than this are not printed as matrices.
const PRINTED: usize = 16;

/// All that is told.
pub fn summary(
    time: f64,
    coupled: &StateSpace,
    views: &[View],
    linearization: &Linearization,
) -> String {
    let mut text = format!(
        "linear at {time} s; states {}, inputs {}, outputs {}\n",
        coupled.states.len(),
        coupled.inputs.len(),
        coupled.outputs.len()
    );
    for view in views {
        text += &poles(view);
        for (connection, looped) in &view.loops {
            text += &format!("\nloop at {connection}{}\n", in_steps(view));
            text += &low(&looped.response);
            text += &margins(&looped.margins);
        }
    }
    if coupled.states.len() <= PRINTED {
        text += &matrices(coupled);
    }
    for connection in &linearization.constant {
        text += &format!("note: `{connection}` carries no real; it counts as constant\n");
    }
    for note in &linearization.notes {
        text += &format!("note: {note}\n");
    }
    text
}

/// The gain at low frequencies.
fn low(response: &Response) -> String {
    let (gain, power) = response.low();
    let number = significant(gain, 4);
    match power {
        0 => format!("  steady gain        {number}\n"),
        power => {
            let first = significant(response.frequency[0], 3);
            format!("  gain at {first} rad/s  {number}, going as ω^{power}\n")
        }
    }
}

fn in_steps(view: &View) -> String {
    (view.step).map_or_else(String::new, |step| format!(", in steps of {step} s"))
}

fn poles(view: &View) -> String {
    let mut text = format!("\npoles of the closed loop{}\n", in_steps(view));
    text += "  pole [1/s]            frequency [rad/s]  damping\n";
    text += &view.modes.iter().map(format::mode).collect::<String>();
    let unstable = view.modes.iter().filter(|mode| mode.pole.re > 0.0).count();
    if unstable > 0 {
        text += &format!(
            "  unstable: {unstable} of them in the right half-plane; margins mean little then\n"
        );
    }
    text
}

fn margins(margins: &Margins) -> String {
    let mut text = String::new();
    for crossing in &margins.gain_crossings {
        text += &format!(
            "  gain 1 at          {} rad/s: phase margin {:.1} deg, delay margin {} s, effective delay {} s\n",
            significant(crossing.frequency, 4),
            crossing.phase_margin.to_degrees(),
            significant(crossing.delay_margin, 3),
            significant(crossing.effective_delay, 3)
        );
    }
    for crossing in &margins.phase_crossings {
        text += &format!(
            "  phase -180° at     {} rad/s: gain margin {} ({:.1} dB)\n",
            significant(crossing.frequency, 4),
            significant(crossing.gain_margin, 4),
            20.0 * crossing.gain_margin.log10()
        );
    }
    match text.is_empty() {
        true => "  neither crosses gain 1 nor phase -180°\n".to_owned(),
        false => text,
    }
}

fn matrices(system: &StateSpace) -> String {
    let (states, inputs) = (&system.states, &system.inputs);
    [
        ("A", &system.a, states, states),
        ("B", &system.b, states, inputs),
        ("C", &system.c, &system.outputs, states),
        ("D", &system.d, &system.outputs, inputs),
    ]
    .map(|(name, matrix, rows, columns)| matrix_table(name, matrix, rows, columns))
    .concat()
}

fn matrix_table(name: &str, matrix: &DMatrix<f64>, rows: &[String], columns: &[String]) -> String {
    if matrix.is_empty() {
        return String::new();
    }
    let width = rows
        .iter()
        .map(|row| row.chars().count())
        .max()
        .unwrap_or(0);
    let mut text = format!("\n{name}, columns {}\n", columns.join(", "));
    for (i, row) in rows.iter().enumerate() {
        text += &format!("  {row:<width$}");
        for value in matrix.row(i).iter() {
            text += &format!(" {:>10}", significant(*value, 4));
        }
        text.push('\n');
    }
    text
}
