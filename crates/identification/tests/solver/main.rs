//! The solver under the fit, on random collocation problems and on problems with known answers. Here, where it is
//! optimised, the dense algebra that it is compared with takes a tenth of the time.

mod condensed;
mod curvature;
mod derivatives;
mod random_collocation;
mod sqp_problems;
