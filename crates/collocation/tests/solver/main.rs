//! The QP of collocation, its curvature and its derivatives, on random problems: against dense algebra, the general path
//! and differences.

mod condensed;
mod curvature;
mod derivatives;
mod differences;
#[path = "../../../sqp/tests/problems/draw.rs"]
mod draw;
mod random_collocation;
