//! Report pages: self-contained HTML with inline SVG, light or dark as the reader's system is.

mod axis;
mod figures;
mod html;
mod loops;
mod number;
mod page;
mod plot;
mod tables;

pub use figures::ClosedLoop;
pub use loops::{LoopFigure, loop_page};
pub use number::{short, significant};
pub use page::{Report, page};
pub use plot::{Line, Plot};
pub use tables::{rms, target_of};
