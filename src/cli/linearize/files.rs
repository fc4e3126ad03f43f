//! Exports a linear system for other programs.

use super::View;
use crate::cosim::{Linearization, Loop};
use crate::linear::{Mode, StateSpace};
use crate::series::cell;
use nalgebra::DMatrix;
use pilotage_text::printable::one_line;
use serde_json::{Value, json};

/// All results as one JSON object; angles in radians.
pub fn json(
    time: f64,
    system: &StateSpace,
    views: &[View],
    linearization: &Linearization,
) -> Value {
    let mut object = json!({
        "time": time,
        "states": system.states,
        "inputs": system.inputs,
        "outputs": system.outputs,
        "A": rows(&system.a),
        "B": rows(&system.b),
        "C": rows(&system.c),
        "D": rows(&system.d),
        "constant": linearization.constant,
        "notes": linearization.notes,
    });
    for view in views {
        let properties = json!({
            "stability": view.verdict().word(),
            "poles": view.modes.iter().map(mode).collect::<Vec<_>>(),
            "loops": view.loops.iter().map(looped).collect::<Vec<_>>(),
        });
        match view.step {
            None => {
                object["stability"] = properties["stability"].clone();
                object["poles"] = properties["poles"].clone();
                object["loops"] = properties["loops"].clone();
            }
            Some(step) => {
                object["inSteps"] = properties;
                object["inSteps"]["step"] = json!(step);
            }
        }
    }
    object
}

/// The rows of a matrix.
pub fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    (matrix.row_iter())
        .map(|row| row.iter().copied().collect())
        .collect()
}

fn mode(mode: &Mode) -> Value {
    json!({
        "real": mode.pole.re,
        "imaginary": mode.pole.im,
        "frequency": mode.frequency,
        "damping": mode.damping,
    })
}

fn looped((connection, looped): &(String, Loop)) -> Value {
    let gain_crossings: Vec<Value> = (looped.margins.gain_crossings.iter())
        .map(|crossing| {
            json!({
                "frequency": crossing.frequency,
                "phaseMargin": crossing.phase_margin,
                "delayMargin": crossing.delay_margin,
                "effectiveDelay": crossing.effective_delay,
            })
        })
        .collect();
    let phase_crossings: Vec<Value> = (looped.margins.phase_crossings.iter())
        .map(|crossing| {
            json!({ "frequency": crossing.frequency, "gainMargin": crossing.gain_margin })
        })
        .collect();
    let response = &looped.response;
    let (gain, power) = response.low();
    json!({
        "connection": connection,
        "steadyGain": (power == 0).then_some(gain),
        "lowFrequencyPower": power,
        "gainCrossings": gain_crossings,
        "phaseCrossings": phase_crossings,
        "response": {
            "frequency": response.frequency,
            "gain": response.value.iter().map(|value| value.norm()).collect::<Vec<_>>(),
            "phase": response.phase(),
        },
    })
}

/// A script that defines the matrices, and the names of states, inputs and outputs.
pub fn matlab(system: &StateSpace) -> String {
    let mut text = String::from("% dx/dt = A x + B u, y = C x + D u; made by pilotage linearize\n");
    for (name, matrix) in [
        ("A", &system.a),
        ("B", &system.b),
        ("C", &system.c),
        ("D", &system.d),
    ] {
        let rows: Vec<String> = (matrix.row_iter())
            .map(|row| {
                let cells: Vec<String> = row.iter().map(|value| format!("{value:?}")).collect();
                cells.join(" ")
            })
            .collect();
        // An empty matrix still has dimensions.
        text += &match matrix.is_empty() {
            true => format!("{name} = zeros({}, {});\n", matrix.nrows(), matrix.ncols()),
            false => format!("{name} = [\n{}\n];\n", rows.join("\n")),
        };
    }
    for (name, list) in [
        ("states", &system.states),
        ("inputs", &system.inputs),
        ("outputs", &system.outputs),
    ] {
        let quoted: Vec<String> = (list.iter())
            .map(|item| format!("'{}'", one_line(item).replace('\'', "''")))
            .collect();
        text += &format!("{name} = {{{}}};\n", quoted.join(", "));
    }
    text
}

/// The table `[A B; C D]`: a row for each state derivative and output, a column for each state and input.
pub fn table(system: &StateSpace) -> String {
    let columns = system.states.iter().chain(&system.inputs);
    let mut text: String = std::iter::once("row".to_owned())
        .chain(columns.map(|name| cell(name)))
        .collect::<Vec<_>>()
        .join(",")
        + "\n";
    let derivatives = system.states.iter().map(|state| format!("der({state})"));
    let names: Vec<String> = derivatives.chain(system.outputs.iter().cloned()).collect();
    let n = system.states.len();
    for (i, name) in names.iter().enumerate() {
        let (left, right, row) = match i < n {
            true => (&system.a, &system.b, i),
            false => (&system.c, &system.d, i - n),
        };
        text += &cell(name);
        for value in left.row(row).iter().chain(right.row(row).iter()) {
            text += &format!(",{value:?}");
        }
        text.push('\n');
    }
    text
}
