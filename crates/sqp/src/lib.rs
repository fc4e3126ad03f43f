//! A sparse SQP for any nonlinear program. It has never heard of ODEs, pilots or FMI.
//!
//! The globalisation is an augmented Lagrangian merit with Armijo backtracking, second-order
//! corrections whose length is tested, and a Levenberg–Marquardt term in the QP that grows when the
//! model is not to be trusted ([`solver`], [`globalisation`]), also where a step left the region in which
//! its linearisation means something ([`QpSolver::growth`]). Quadratic programs are solved through
//! [`QpSolver`]. A point counts as a solution when the second-order condition holds too ([`curvature`]);
//! at a saddle the solve goes on along a direction of negative curvature.

mod active_set;
pub mod convergence;
pub mod convex;
pub mod curvature;
mod escape;
pub mod globalisation;
pub mod iterate;
mod line_search;
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
pub use options::{Hessian, Options};
pub use problem::{Problem, SparseProblem};
pub use qp::{QpFailure, QpSolver, Step};
pub use solution::{Iteration, Solution, StepModel, Work};
pub use solver::solve;
pub use sparse_qp::SparseQp;
pub use status::Status;
