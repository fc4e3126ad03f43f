//! A linear system as text for people.

use super::View;
use crate::cli::format;
use crate::cli::terminal;
use crate::cosim::Linearization;
use crate::linear::{Margins, Response, StateSpace};
use nalgebra::DMatrix;
use pilotage_text::number::significant;

/// The results as text: first the matrices if requested, last the verdicts.
pub fn summary(
    time: f64,
    coupled: &StateSpace,
    shown: Option<&StateSpace>,
    views: &[View],
    linearization: &Linearization,
) -> String {
    let mut text = format!(
        "linear at {time} s; states {}, inputs {}, outputs {}\n",
        coupled.states.len(),
        coupled.inputs.len(),
        coupled.outputs.len()
    );
    text += &shown.map_or_else(String::new, matrices);
    for view in views {
        text += &poles(view);
        for (connection, looped) in &view.loops {
            let connection = terminal::line(&connection.to_string());
            text += &format!("\nloop at {connection}{}\n", view.in_steps());
            text += &low(&looped.response);
            text += &margins(&looped.margins);
        }
    }
    text.push('\n');
    for note in super::notes(linearization) {
        text += &terminal::labelled("note", &note);
    }
    let verdicts = views
        .iter()
        .map(|view| terminal::line(&view.words()) + "\n");
    text + &verdicts.collect::<String>()
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

fn poles(view: &View) -> String {
    let mut text = format!("\npoles of the closed loop{}\n", view.in_steps());
    text += "  pole [1/s]            frequency [rad/s]  damping\n";
    text + &view.modes.iter().map(format::mode).collect::<String>()
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
    let rows: Vec<String> = rows.iter().map(|row| terminal::line(row)).collect();
    let width = rows
        .iter()
        .map(|row| row.chars().count())
        .max()
        .unwrap_or(0);
    let mut text = format!(
        "\n{name}, columns {}\n",
        terminal::line(&columns.join(", "))
    );
    for (i, row) in rows.iter().enumerate() {
        text += &format!("  {row:<width$}");
        for value in matrix.row(i).iter() {
            text += &format!(" {:>10}", significant(*value, 4));
        }
        text.push('\n');
    }
    text
}
