//! Statistics of a run and estimates of its coupling error.

/// Statistics of a run and estimates of its coupling error.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// The communication steps.
    pub steps: Steps,
    /// The instances, in the order in which they were added.
    pub instances: Vec<InstanceReport>,
    /// The connections of reals.
    pub connections: Vec<ConnectionReport>,
    /// Names of instances with connected inputs but without rollback, if the coupling needs it: strong coupling gives
    /// them extrapolated inputs, and step-size control repeats no step.
    pub irrevocable: Vec<String>,
    /// Names of the instances without variable steps, if [jumps became ramps](Steps::ramps).
    pub fixed: Vec<String>,
    /// Names of the instances that hold inputs within each step or part of it although these could change: they support
    /// neither input derivatives (FMI 2.0) nor intermediate updates (FMI 3.0).
    pub holding: Vec<String>,
    /// Time of the stepping loop without calls to instances \[s\]: the master and the recorder. It is of little
    /// significance if components step concurrently.
    pub master_seconds: f64,
    /// Number of clock steps in which calls were timed; the components' times are estimated from these. With
    /// [`Coupling::measure`](super::Coupling::measure) all steps are timed.
    pub timed_steps: u64,
}

/// Counts of communication steps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Steps {
    /// Accepted steps.
    pub accepted: u64,
    /// Rejected steps: the error was too large (with strong coupling and fixed steps: an observed error of a hundredth
    /// of the signal, or a possible one of half of it), or a component could not complete the step.
    pub rejected: u64,
    /// Accepted steps whose error exceeded the tolerance, because they had the minimum length or a component has no
    /// rollback.
    pub over_tolerance: u64,
    /// Corrections of strong coupling, each of which repeats the step.
    pub corrections: u64,
    /// Number of matrices computed for these corrections.
    pub matrices: u64,
    /// Steps whose corrections did not converge.
    pub unconverged: u64,
    /// Steps repeated because non-real values changed within them.
    pub repeated: u64,
    /// Steps in which such values did not settle; their values at the beginning were used.
    pub unsettled: u64,
    /// Jumps of signals at which steps were cut, and jumps that became ramps over a step because a component has no
    /// variable steps.
    pub jumps: u64,
    /// See [`Self::jumps`].
    pub ramps: u64,
    /// Shortest accepted step \[s\].
    pub shortest: f64,
    /// Longest accepted step \[s\].
    pub longest: f64,
}

/// Calls to an instance after initialization.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Calls {
    /// Setting inputs or their derivatives.
    pub sets: u64,
    /// Steps.
    pub steps: u64,
    /// Getting outputs.
    pub gets: u64,
    /// Saving the state.
    pub saves: u64,
    /// Restoring a saved state.
    pub restores: u64,
}

/// Statistics of an instance.
#[derive(Debug, Clone, PartialEq)]
pub struct InstanceReport {
    /// Name.
    pub name: String,
    /// Its calls.
    pub calls: Calls,
    /// Time in these calls \[s\].
    pub seconds: f64,
}

/// Statistics of a connection.
#[derive(Debug, Clone, PartialEq)]
pub struct ConnectionReport {
    /// The output.
    pub from: String,
    /// The input.
    pub to: String,
    /// Unit of the output; empty if unknown.
    pub unit: String,
    /// Value given to the input while the output's next value was unknown.
    pub transfer: Transfer,
    /// Mean lag of the input's values over a step \[s\]; negative if early. Terms of second order in the step are part
    /// of the errors.
    pub lag: f64,
    /// Error of the input; `None` without a step.
    pub error: Option<CouplingError>,
    /// Divergence of the output, if detected.
    pub divergence: Option<Divergence>,
}

/// Value of an input within a communication step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transfer {
    /// The output's value at the beginning of the step.
    Held,
    /// The output's value at the end of the step.
    Ahead,
    /// A polynomial through the values up to the beginning of the step.
    Extrapolated,
    /// A polynomial through the values up to the end of the step.
    Interpolated,
    /// The output's value of the same time, for outputs that follow at once.
    AtOnce,
}

impl std::fmt::Display for Transfer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Held => "held",
            Self::Ahead => "ahead",
            Self::Extrapolated => "extrapolated",
            Self::AtOnce => "at once",
            Self::Interpolated => "interpolated",
        })
    }
}

/// Error of an input's mean over a step of the clock, in the unit of the feeding output.
///
/// In strong coupling the exact mean is observed if the FMU has rollback, linear inputs and output derivatives: it is
/// stepped to points within the step, which resolves even fast poles. Otherwise the mean is estimated from the
/// communication points: for an input held in a fixed step by a line; else by a polynomial of degree 2 or, if slopes
/// are known, 3. If the input was this polynomial, the polynomial's own error is used: from the fourth derivative if
/// slopes are known, otherwise from the next lower degree. These errors do not give the deviation of the outputs from
/// the exact solution over time, which results from all of them together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CouplingError {
    /// Magnitude, averaged over time.
    pub mean: f64,
    /// Largest magnitude.
    pub max: f64,
}

/// Kind of divergence of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Divergence {
    /// Alternating changes of growing size: caused by the coupling.
    Alternating,
    /// Changes that keep growing: caused by the coupling or by an unstable system.
    Growing,
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Alternating => "alternating",
            Self::Growing => "growing",
        })
    }
}
