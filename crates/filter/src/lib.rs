//! Extended Kalman filter with exact derivatives: one-step predictions of a model with process noise.
//!
//! A system `ẋ = f(t, x, u; θ) + Σ g_k(t, x, u; θ) w_k` has white noises `w_k` of densities `q_k(θ)`,
//! `E w(t) w(s) = q δ(t - s)`. At samples, `y_i = h_i(t, x, u; θ) + v_i` is measured, where `v_i` has the standard
//! deviation `s_i(t, x, u; θ)`. Mean and covariance of the state are propagated between samples and updated at samples
//! (Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, sections 7.2 and 8.3; exact for a linear system). The
//! innovations `e` and their variances `s` give `-2 ln L = Σ ln s + e²/s + ln 2π` (Schweppe, IEEE Trans. Inf. Theory
//! 11, 1965), which is minimised over θ: the prediction-error method (Ljung, *System Identification*, 2nd ed., chapter
//! 7).
//!
//! ```
//! use pilotage_expression::Graph;
//! use pilotage_filter::{Equations, Filter, Record};
//!
//! // A random walk of density q, measured with unit variance: variables are time, the state, q.
//! let mut graph = Graph::default();
//! let nodes: Vec<_> = (0..3).map(|k| graph.variable(k)).collect();
//! let (zero, one) = (graph.constant(0.0), graph.constant(1.0));
//! let filter = Filter::new(&Equations {
//!     graph: &graph,
//!     variables: 3,
//!     derivatives: &[zero],
//!     noises: &[(vec![one], nodes[2])],
//!     outputs: &[(nodes[1], one)],
//! });
//! let record = Record { time: &[0.0, 2.0], inputs: &[vec![], vec![]], measured: &[vec![f64::NAN, 3.0]] };
//! let course = filter.run(&record, &[0.0], &[0.5], 1);
//! // The variance of the state has grown by 0.5 · 2, and the sensor adds 1.
//! let found = &course.innovations[0];
//! assert_eq!((found.error.value, found.variance.value), (3.0, 2.0));
//! ```
//!
//! | module | contents |
//! | --- | --- |
//! | [`jet`], [`matrix`] | numbers with derivatives, and small matrices of them |
//! | [`transition`] | transition of a linear system with noise |
//! | [`filter`] | the filter |
//! | `solve` | linear systems of jets |

pub mod filter;
pub mod jet;
pub mod matrix;
mod solve;
pub mod transition;

pub use filter::{Course, Equations, Filter, Innovation, Record, SLOPES};
pub use jet::Jet;
pub use matrix::Matrix;
pub use transition::Transition;
