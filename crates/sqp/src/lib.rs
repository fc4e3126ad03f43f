//! A sparse SQP for nonlinear programs
//!
//! ```text
//! min f(z)   subject to   c(z) = 0,   lower ≤ g(z) ≤ upper
//! ```
//!
//! where `f`, `c` and `g` are twice continuously differentiable, not necessarily convex. It is made for programs with
//! exact sparse Jacobians and Hessian, scaled to the order of one, such as those of direct collocation. The
//! second-order condition is checked before a point counts as a solution. Without derivatives, or with integer
//! variables, use another solver.
//!
//! A program implements [`SparseProblem`]. The example is number 14 of Hock & Schittkowski (*Test Examples for
//! Nonlinear Programming Codes*, 1981):
//!
//! ```
//! use pilotage_sqp::{Hessian, SqpOptions, Problem, SparseProblem, SparseQp, Status, problem::Pattern, solve};
//! use std::ops::ControlFlow;
//!
//! /// min (x - 2)² + (y - 1)²   subject to   x - 2 y + 1 = 0,   0 ≤ 1 - x²/4 - y²
//! struct Hs14;
//!
//! impl Problem for Hs14 {
//!     fn n_variables(&self) -> usize { 2 }
//!     fn n_equalities(&self) -> usize { 1 }
//!     fn limits(&self) -> (&[f64], &[f64]) { (&[0.0], &[f64::INFINITY]) }
//!     fn damping_weights(&self) -> &[f64] { &[1.0, 1.0] }
//!     fn evaluate(&self, z: &[f64], c: &mut [f64], g: &mut [f64]) -> f64 {
//!         c[0] = z[0] - 2.0 * z[1] + 1.0;
//!         g[0] = 1.0 - z[0] * z[0] / 4.0 - z[1] * z[1];
//!         (z[0] - 2.0).powi(2) + (z[1] - 1.0).powi(2)
//!     }
//! }
//!
//! impl SparseProblem for Hs14 {
//!     fn gradient(&self, z: &[f64], df: &mut [f64]) {
//!         df.copy_from_slice(&[2.0 * (z[0] - 2.0), 2.0 * (z[1] - 1.0)]);
//!     }
//!     fn equality_pattern(&self) -> Pattern { vec![(0, 0), (0, 1)] }
//!     fn inequality_pattern(&self) -> Pattern { vec![(0, 0), (0, 1)] }
//!     fn jacobians(&self, z: &[f64], dc: &mut [f64], dg: &mut [f64]) {
//!         dc.copy_from_slice(&[1.0, -2.0]);
//!         dg.copy_from_slice(&[-z[0] / 2.0, -2.0 * z[1]]);
//!     }
//!     fn hessian_pattern(&self) -> Pattern { vec![(0, 0), (1, 1)] }
//!     fn hessian(&self, _: &[f64], _: &[f64], eta: &[f64], kind: Hessian, values: &mut [f64]) {
//!         let eta = if kind == Hessian::Exact { eta[0] } else { 0.0 };
//!         values.copy_from_slice(&[2.0 - 0.5 * eta, 2.0 - 2.0 * eta]);
//!     }
//! }
//!
//! let (start, options) = (vec![2.0, 2.0], SqpOptions::default());
//! let solution = solve(&Hs14, &mut SparseQp::default(), start, &options, &mut |_| ControlFlow::Continue(()));
//! let optimum = [(7f64.sqrt() - 1.0) / 2.0, (7f64.sqrt() + 1.0) / 4.0];
//! assert_eq!(solution.status, Status::Converged);
//! assert!((0..2).all(|i| (solution.iterate.z[i] - optimum[i]).abs() < 1e-8));
//! ```
//!
//! A structured problem can implement [`QpSolver`] instead of using [`SparseQp`], as `pilotage-collocation` does.
//!
//! The globalisation combines an augmented Lagrangian merit with Armijo backtracking, second-order corrections whose
//! length is tested, and a Levenberg–Marquardt term in the QP ([`solver`], [`globalisation`]). This term grows where
//! the model is unreliable, and also where a step left the region in which its linearisation is valid
//! ([`QpSolver::growth`]). A point counts as a solution if the second-order condition holds too ([`curvature`]); at a
//! saddle point the solve continues along a direction of negative curvature.
//!
//! | module | content |
//! | --- | --- |
//! | [`problem`](mod@problem) | the nonlinear program |
//! | [`options`](mod@options) | options of a solve |
//! | [`solver`](mod@solver) | the SQP loop |
//! | [`qp`](mod@qp) | interface to the solver of the QP in each iteration |
//! | [`sparse_qp`](mod@sparse_qp) | the QP of any sparse problem |
//! | [`convex`](mod@convex) | convex QPs by clarabel |
//! | `active_set` | convex QPs from a guess of their active set |
//! | [`globalisation`](mod@globalisation) | the merit function |
//! | `line_search` | backtracking on the merit |
//! | [`curvature`](mod@curvature) | the second-order condition |
//! | `negative_curvature` | a step from a saddle point |
//! | [`convergence`](mod@convergence) | the scaled KKT residual |
//! | [`iterate`](mod@iterate) | a point with its multipliers |
//! | [`solution`](mod@solution) | the result |
//! | [`status`](mod@status) | why a solve ended |
//! | [`vector`](mod@vector) | sums and maxima over long vectors |

mod active_set;
pub mod convergence;
pub mod convex;
pub mod curvature;
pub mod globalisation;
pub mod iterate;
mod line_search;
mod negative_curvature;
pub mod options;
pub mod problem;
pub mod qp;
pub mod solution;
pub mod solver;
pub mod sparse_qp;
pub mod status;
pub mod vector;

pub use convergence::Kkt;
pub use curvature::Curvature;
pub use iterate::Iterate;
pub use options::{Hessian, SqpOptions};
pub use problem::{Problem, SparseProblem};
pub use qp::{QpFailure, QpSolver, Step};
pub use solution::{Iteration, Solution, StepModel, Work};
pub use solver::{ACCEPTABLE, solve};
pub use sparse_qp::SparseQp;
pub use status::Status;
