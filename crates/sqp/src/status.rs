//! How a solve ended. An outcome, not an error.

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The scaled KKT residual reached the tolerance, and no direction has negative curvature, as far as
    /// that was checked ([`Solution::curvature`](super::Solution::curvature)).
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
    /// The scaled KKT residual reached the tolerance, but with negative curvature, and no point along its
    /// direction was better. At degenerate points, where multipliers are not unique, it may be an
    /// optimum all the same.
    SaddlePoint,
    /// The problem's values or derivatives are not finite at the start.
    UndefinedStart,
    /// Stopped by the caller's observer: its time was up.
    TimeLimit,
    /// Stopped by the caller's observer: the user wanted so.
    Interrupted,
    /// Stopped by the caller's observer for another reason.
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
            Self::SaddlePoint => "saddle-point",
            Self::TimeLimit => "time-limit",
            Self::Interrupted => "interrupted",
            Self::Stopped => "stopped",
        }
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}
