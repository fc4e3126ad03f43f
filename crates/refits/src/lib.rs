//! Refits of a solved problem with small changes: profile likelihoods and bootstraps.
//!
//! Intervals from a covariance are those of a linear model. They are inaccurate if a parameter's interval is wide
//! compared with its value. A profile, which solves again with the parameter fixed ([`profile()`]), and a bootstrap,
//! which solves again with other data ([`bootstrap`]), are then more reliable. Each refit starts from its neighbour's
//! solution, on the mesh of the original fit, and needs only a few SQP iterations.
//!
//! ```
//! use pilotage_collocation::{Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme, Steps};
//! use pilotage_expression::System;
//! use pilotage_refits::{Coordinate, End, Solved, Sought, Threshold, Watch, profile};
//! use pilotage_sqp::SqpOptions;
//! use std::{ops::ControlFlow, sync::Arc};
//!
//! // ẋ = p, x(0) = 0: the mean of y/t. The objective is Σ (y - p t)², its profile a parabola.
//! let line = System::trace([1, 0, 1], |at| [vec![at.p[0]], vec![at.x[0]]])?;
//! let (time, values) = (vec![0.0, 1.0, 2.0], vec![0.0, 1.1, 1.9]);
//! let measured = vec![Recording { values, weight: 1.0, loss: Loss::Square }];
//! let (mesh, inputs, initial) = (time.clone(), vec![vec![]; 3], vec![Some(0.0)]);
//! let run = Run { mesh, time, inputs, measured, initial, steps: Steps::default() };
//! let scales = Scales { states: vec![1.0], parameters: vec![1.0] };
//! let (model, free) = (Arc::new(Differentiated::new(&line)), ParameterConstraints::default());
//! let problem = Collocation::new(model, free, Scheme::Trapezoid, vec![run], scales, &[]);
//! let z = vec![0.0; 4];
//! let solution = pilotage_collocation::solve(&problem, z, &SqpOptions::default(), &mut |_| ControlFlow::Continue(()));
//! let solved = Solved { problem, at: solution.iterate, options: SqpOptions::default() };
//! let slope = Sought { at: Coordinate::Shared(0), step: 0.1, range: [f64::NEG_INFINITY, f64::INFINITY] };
//! let threshold = Threshold { noise: 1.0, root: 1.96 };
//! let found = profile(&solved, &[slope], threshold, &Watch::default());
//! // The information is Σ t² = 5.
//! let End::Crossed(high) = found[0].ends[1] else { panic!("a parabola crosses every level") };
//! assert!((high - (4.9 / 5.0 + 1.96 / 5.0_f64.sqrt())).abs() < 1e-6);
//! # Ok::<(), pilotage_expression::Obstacle>(())
//! ```
//!
//! | module | contents |
//! | --- | --- |
//! | [`refit`] | problems that can be solved again, with a coordinate fixed or with other data |
//! | `solved` | a collocation problem as such a problem |
//! | `fixed` | the same with a parameter or an initial state fixed |
//! | [`mod@profile`] | profile likelihoods |
//! | [`study`] | input from a fit: unknowns by name, data, noise |
//! | [`bootstrap`] | other data, and the spread of refits to them |
//! | [`profile`](mod@profile) | profile likelihoods |

pub mod bootstrap;
mod fixed;
pub mod profile;
pub mod refit;
mod solved;
pub mod study;

pub use bootstrap::{Replicate, Spread, resampled, spread};
pub use profile::{End, Point, Profile, Sought, Threshold, profile};
pub use refit::{Coordinate, Data, Fixed, Found, Refit, Resample};
pub use solved::{Collocated, Solved, Watch};
pub use study::{Kind, Study, Unknown};
