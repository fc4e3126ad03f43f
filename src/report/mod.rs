//! Report pages: self-contained HTML with inline SVG, light or dark as the reader's system is.

mod axis;
mod figures;
mod frame;
mod html;
mod loops;
mod number;
mod overlay;
mod page;
mod plot;
mod simulation;
mod steps;
mod tables;
mod thin;

pub use figures::ClosedLoop;
pub use html::Made;
pub use loops::{LoopFigure, LoopPage, Stability, loop_page};
pub use number::{short, significant};
pub use overlay::{Overlay, Parameters, overlay_page};
pub use page::{Report, page};
pub use plot::{Axes, Line, Mark, Plot};
pub use simulation::{Simulation, simulation_page};
pub use steps::{StepFigure, step_page};
pub use tables::target_of;
