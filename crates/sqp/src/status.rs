//! Why a solve ended. These are outcomes, not errors.

/// Why a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The scaled KKT residual reached the tolerance, and no direction has negative curvature, as far as that was
    /// checked ([`Solution::curvature`](super::Solution::curvature)).
    Converged,
    /// The iteration limit was reached.
    IterationLimit,
    /// The line search found no step that lowers the merit, at any damping.
    NoProgress,
    /// The constraints seem to be inconsistent: the point is stationary for their violation.
    Infeasible,
    /// Feasible iterates exceeded any size plausible in a scaled problem: the objective seems to have no lower bound.
    Unbounded,
    /// The scaled KKT residual reached the tolerance, but with negative curvature, and no point along that direction
    /// was better. At degenerate points, where multipliers are not unique, it may still be an optimum.
    SaddlePoint,
    /// The problem's values or derivatives are not finite at the start.
    UndefinedStart,
    /// Stopped by the caller's observer: time limit.
    TimeLimit,
    /// Stopped by the caller's observer: interrupted by the user.
    Interrupted,
    /// Stopped by the caller's observer for another reason.
    Stopped,
}

impl Status {
    /// The name as one word, as in result files.
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
