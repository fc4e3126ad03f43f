//! A problem as equations: one system whose states, inputs and parameters are those that are sought or recorded.
//!
//! What differs from run to run is an input that is constant in the run, or jumps where it changes. What is sought
//! for each run is a state whose derivative is zero and whose initial value is free, so that it is eliminated run by
//! run as the others are. An initial state that depends on sought parameters is added to its state, which then
//! begins at zero.

use crate::data::{RunData, Source};
use crate::error::ProblemError;
use crate::file::{Hold, Holds, Initial, Per, ProblemFile, Set};
use crate::joint::Joint;
use crate::names::{Named, Of, matching};
use crate::part::Part;
use crate::unknowns::{Meaning, Parameters, Unknown};
use pilotage_collocation::{Bound, BoundAt, Differentiated, ParameterConstraints, Run};
use pilotage_cosim::description::{InstanceDescription, Said};
use pilotage_expression::{Function, Graph, Node, System};
use std::collections::HashMap;
use std::sync::Arc;

/// A problem that is ready to be discretised.
#[derive(Debug)]
pub struct Posed<'f> {
    /// What the file says.
    pub file: &'f ProblemFile,
    /// The instances.
    pub joint: Joint,
    /// The equations: measured outputs first, then bounded ones.
    pub model: Arc<Differentiated>,
    /// Bounds of the latter.
    pub bounds: Vec<Bound>,
    /// What parameters must fulfil.
    pub constraints: ParameterConstraints,
    /// The runs that are fitted; their mesh is their samples.
    pub runs: Vec<Run>,
    /// What is sought, and where it stands.
    pub unknowns: Vec<(Unknown, Stands)>,
    /// Number of shared parameters.
    pub shared: usize,
    /// The states, those of the runs' own parameters behind.
    pub states: Vec<State>,
    /// What is told of a solution.
    pub told: Told,
    /// What was read, of each run that is fitted.
    pub data: Vec<RunData<'f>>,
}
