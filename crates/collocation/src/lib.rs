//! Parameter estimation for ordinary differential equations by direct collocation.
//!
//! ```text
//! minimise    Σ w ℓ(y_k - h(x(t_k); θ))            over θ and the states x(t) of every run
//! subject to  ẋ = f(t, x, u; θ),  lb ≤ g(x(t_k); θ) ≤ ub,  c(θ) ≥ 0
//! ```
//!
//! All states on a mesh are unknowns, so nothing is integrated while θ is still wrong: unstable and stiff models can be
//! fitted like stable ones. Several runs share θ, with any number of inputs and of measured and bounded outputs. A
//! [bound](Bound) holds at all samples, or at the start or the end of each run, and equal limits form an equation.
//! Samples need not coincide with mesh points. The [schemes](Scheme) range from Euler to pseudospectral ones. The SQP
//! of `pilotage-sqp` solves the nonlinear program, with a dedicated QP solver that eliminates the states at a cost
//! linear in their number ([`Condensed`]).
//!
//! The loss ℓ of a recording is the square, or a robust one for data with outliers. With the residual divided by an
//! estimated standard deviation as an output, and [`Loss::Linear`], noise levels can be estimated too.
//!
//! [`Collocation::mesh_errors`] estimates the accuracy of a mesh; [`solve_refined`] divides intervals until their local
//! errors are below a tolerance.
//!
//! The caller provides three things: weights that bring residuals to the order of one (`1/sd²`; the tolerance of the
//! solver is absolute), scales of the right magnitude ([`Scales::of`] cannot derive one from a parameter that starts at
//! 0, so set it explicitly), and start states (from [`Differentiated::simulate`] or from the data). A parameter that
//! affects no measured output keeps its start value; the `curvature` of the solution is then 0.
//!
//! Collocation suits models given by equations and data given by samples. For a single short fit of a model that can be
//! simulated safely with any θ, a simulation with a least-squares solver is just as good.
//!
//! ```
//! use pilotage_collocation::{Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme, Steps};
//! use pilotage_expression::System;
//! use std::{ops::ControlFlow, sync::Arc};
//!
//! // Logistic growth, ẋ = r x (1 - x/K), measured directly: x(t) = K / (1 + (K/x₀ - 1) e^(-r t)).
//! let growth = System::trace([1, 0, 2], |at| {
//!     let (x, r, k) = (at.x[0], at.p[0], at.p[1]);
//!     [vec![r * x * (-x / k + 1.0)], vec![x]]
//! })?;
//! let model = Arc::new(Differentiated::new(&growth));
//! let time: Vec<f64> = (0..41).map(|k| 0.25 * f64::from(k)).collect();
//! let run = Run {
//!     mesh: time.clone(),
//!     inputs: vec![vec![]; time.len()],
//!     measured: vec![Recording {
//!         values: time.iter().map(|t| 3.0 / (1.0 + 5.0 * (-0.9 * t).exp())).collect(),
//!         weight: 1.0,
//!         loss: Loss::Square,
//!     }],
//!     initial: vec![None],
//!     time,
//!     steps: Steps::default(),
//! };
//! let start = [0.5, 2.0];
//! let states = vec![model.simulate(&run, &start, &[0.4])];
//! let (scheme, free) = (Scheme::Gauss(3), ParameterConstraints::default());
//! let problem = Collocation::new(model, free, scheme, vec![run], Scales::of(&states, &start), &[]);
//! let z = problem.variables(&states, &start);
//! let options = pilotage_sqp::SqpOptions::default();
//! let solution = pilotage_collocation::solve(&problem, z, &options, &mut |_| ControlFlow::Continue(()));
//! let found = problem.physical_theta(&solution.iterate.z);
//! assert!((found[0] - 0.9).abs() < 1e-6 && (found[1] - 3.0).abs() < 1e-6, "{found:?}");
//! # Ok::<(), pilotage_expression::Obstacle>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`mesh`], [`grid`], [`tableau`] | runs, schemes, and the discretisation of a run |
//! | [`node`], [`constraints`] | the model and the constraints on θ, with derivatives |
//! | `bound`, `loss` | limits of outputs, and losses of residuals |
//! | [`collocation`], [`layout`] | the nonlinear program |
//! | `coarse` | the same problem with fewer intervals and samples, solved first |
//! | `course` | simulations with error control, and meshes derived from them |
//! | `refinement` | local errors and mesh refinement |
//! | [`condensed`] | its QP by elimination of the states, and sensitivities of the outputs |
//! | [`simd`] | groups of points for vector instructions |
//! | `parallel` | work on all runs at once |
//! | `path` | the states of a run as functions of time, and variables on another mesh |
//! | `reference` | solution of the equations with error control, as a reference |
//! | `simulate` | simulated states as a start |
//! | [`solve`](mod@solve) | start variables and solution, and the choice of the QP solver |
//! | `sparse` | the same program with sparse derivatives, for the general QP solver |

mod bound;
mod coarse;
pub mod collocation;
pub mod condensed;
pub mod constraints;
mod course;
pub mod grid;
pub mod layout;
mod loss;
pub mod mesh;
pub mod node;
mod parallel;
mod path;
mod reference;
mod refinement;
pub mod simd;
mod simulate;
pub mod solve;
mod sparse;
pub mod tableau;

pub use bound::{Bound, BoundAt};
pub use coarse::{is_rough, nearer, reduced, stays_long};
pub use collocation::Collocation;
pub use condensed::{Condensed, Sensitivities, Sensitivity};
pub use constraints::ParameterConstraints;
pub use course::{Course, Quality};
pub use loss::Loss;
pub use mesh::{Recording, Run, Steps};
pub use node::{Differentiated, Scales};
pub use parallel::{start_threads, threads};
pub use reference::Stop;
pub use refinement::{Refined, refined, solve_refined};
pub use simulate::rk4;
pub use solve::solve;
pub use tableau::Scheme;
