//! How a solve ended. An outcome, not an error.

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The scaled KKT residual reached the tolerance.
    Converged,
    /// Iteration limit.
    IterationLimit,
    /// The line search found no shorter step that lowers the merit, at any damping.
    NoProgress,
    /// The constraints seem to have no common point: stationary for their violation.
    Infeasible,
    /// Feasible iterates left every bound that a scaled problem keeps: the objective seems to have no
    /// lower bound.
    Unbounded,
    /// The problem's values are not finite at the start.
    UndefinedStart,
    /// The caller's observer asked to stop.
    Stopped,
}

impl Status {
    /// One word, as in result files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::IterationLimit => "iteration-limit",
            Self::NoProgress => "no-progress",
            Self::Infeasible => "infeasible",
            Self::Unbounded => "unbounded",
            Self::UndefinedStart => "undefined-start",
            Self::Stopped => "stopped",
        }
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}
