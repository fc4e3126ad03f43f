//! Report pages: self-contained HTML in light or dark mode, as set in the reader's system, and figures as files. A
//! [`Figure`] holds the data of a drawing; pages draw it with uPlot (`vendor/`), papers use [`svg::to_svg`].

mod axis;
pub mod certainty;
pub mod describing;
pub mod diagram;
pub mod figure;
mod formula;
mod frame;
pub mod frequency;
mod html;
mod loops;
mod number;
mod overlay;
pub mod palette;
mod plain;
#[cfg(feature = "png")]
pub mod png;
#[cfg(not(feature = "png"))]
#[path = "png/left_out.rs"]
pub mod png;
pub mod poles;
pub mod read;
pub mod residuals;
mod simulation;
mod steps;
pub mod svg;
mod tables;
mod thin;

use crate::series::cell;

pub use figure::Figure;
pub use html::{Made, policy, side_by_side};
pub use loops::{LoopFigure, LoopPage, Stability, loop_page};
pub use overlay::{Overlay, Parameters, overlay_page};
pub use plain::{PlainPage, plain_page};
pub use simulation::{Simulation, result_figures, simulation_page};
pub use steps::{StepFigure, step_page};
pub use tables::modes;

/// A table as CSV, with quotes where required (RFC 4180).
fn csv<R: AsRef<[String]>>(rows: &[R]) -> String {
    let row = |row: &R| {
        let cells: Vec<String> = row.as_ref().iter().map(|own| cell(own)).collect();
        cells.join(",") + "\n"
    };
    rows.iter().map(row).collect()
}
