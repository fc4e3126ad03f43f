//! Parameters of ordinary differential equations from data, by direct collocation.
//!
//! ```text
//! minimise    Σ w ℓ(y_k - h(x(t_k); θ))            over θ and the states x(t) of every run
//! subject to  ẋ = f(t, x, u; θ),  lb ≤ g(x(t_k); θ) ≤ ub,  c(θ) ≥ 0
//! ```
//!
//! Every state on a mesh is an unknown, so that nothing is integrated while θ is still wrong: unstable and
//! stiff models are fitted as calm ones are. Several runs share θ; inputs, measured and bounded outputs are
//! as many as one likes; a [bound](Bound) holds at all samples, or at the start or the end of each run, and equal
//! limits are an equation; samples need not stand on the mesh. The [schemes](Scheme) reach from Euler's to
//! pseudospectral ones. The nonlinear program goes to the SQP of `pilotage-sqp`, with a QP of its own that
//! eliminates the states at a cost linear in their number ([`Condensed`]).
//!
//! The loss ℓ of a recording is the square, or one for data with outliers; with the residual over an estimated
//! standard deviation as output, and [`Loss::Linear`], noise levels are estimated too.
//!
//! How good a mesh is, [`Collocation::mesh_errors`] tells; [`solve_refined`] divides intervals until their local errors
//! are below a tolerance.
//!
//! Three things are the caller's: weights that bring residuals to the order of one (`1/sd²`; the solver's
//! tolerance is absolute), scales of the right size (a parameter that starts at 0 tells [`Scales::of`] none, so write
//! one), and start states (those of [`Differentiated::simulate`], or from the data). A parameter that no measured
//! output depends on stays where it starts; the solution's `curvature` is then 0.
//!
//! Take it where a model is given by equations and data by samples. A single short fit of a model that can
//! be simulated safely from any θ is as well served by a simulation and a least-squares solver.
//!
//! ```
//! use pilotage_collocation::{Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme};
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
//! | module | what it holds |
//! | --- | --- |
//! | [`mesh`], [`grid`], [`tableau`] | runs, schemes, and what a scheme makes of a run |
//! | [`node`], [`constraints`] | the model and the conditions on θ, with derivatives |
//! | `bound`, `loss` | what outputs keep, and what residuals cost |
//! | [`collocation`], [`layout`] | the nonlinear program |
//! | `coarse` | the same with fewer intervals and samples, solved first |
//! | `course` | simulations with error control, and the meshes that they ask for |
//! | `refinement` | local errors, and meshes that make them small |
//! | [`condensed`] | its QP by elimination of the states, and what outputs make of parameters |
//! | [`simd`] | numbers of several points at once, for vector instructions |

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
pub use coarse::nearer;
pub use collocation::Collocation;
pub use condensed::{Condensed, Sensitivities, Sensitivity};
pub use constraints::ParameterConstraints;
pub use course::{Course, Quality};
pub use loss::Loss;
pub use mesh::{Recording, Run};
pub use node::{Differentiated, Scales};
pub use reference::Stop;
pub use refinement::{Refined, refined, solve_refined};
pub use simulate::rk4;
pub use solve::solve;
pub use tableau::Scheme;
