//! Tables that several pages have.

use super::html::{Html, html, table};
use super::overlay::Parameters;
use crate::vehicle::Mode;
use pilotage_text::number::significant;

/// Poles, or conjugate pairs of poles.
pub fn modes(modes: &[Mode]) -> Parameters {
    let row = |mode: &Mode| {
        let imaginary = match mode.pole.im == 0.0 {
            true => String::new(),
            false => significant(mode.pole.im, 4),
        };
        let time = match mode.pole.re < 0.0 {
            true => significant(-1.0 / mode.pole.re, 4),
            false if mode.pole.re == 0.0 => "–".into(),
            false => "unstable".into(),
        };
        vec![
            significant(mode.pole.re, 4),
            imaginary,
            significant(mode.frequency, 4),
            significant(mode.damping, 3),
            time,
        ]
    };
    Parameters {
        header: vec![
            "pole [1/s]",
            "± i [1/s]",
            "frequency [rad/s]",
            "damping",
            "time constant [s]",
        ],
        numeric: vec![0, 1, 2, 3, 4],
        rows: modes.iter().map(row).collect(),
        notes: Vec::new(),
    }
}

/// Names of files with their SHA-256.
pub fn files<'a>(files: impl Iterator<Item = (&'a str, &'a str)>) -> Html {
    let rows: Vec<_> = files
        .map(|(name, sha256)| vec![html! { (name) }, html! { code { (sha256) } }])
        .collect();
    table(&["file", "SHA-256"], &[], &rows)
}
