//! What a run did, and how far its coupling is to be trusted.

/// What a run did, and how far its coupling is to be trusted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// The communication steps.
    pub steps: Steps,
    /// Each instance, in the order in which they were added.
    pub instances: Vec<InstanceReport>,
    /// Each connection of reals.
    pub connections: Vec<ConnectionReport>,
    /// Names of the instances that feed on others and cannot go back to a saved state, where the
    /// coupling would need it: strong coupling gives them extrapolated inputs, and with step-size
    /// control no step is repeated.
    pub irrevocable: Vec<String>,
    /// Names of the instances that cannot vary their steps, where [jumps became ramps](Steps::ramps).
    pub fixed: Vec<String>,
    /// Names of the instances that hold their inputs within each step, or part of it, where these could change:
    /// they take no input derivatives (FMI 2.0) and no intermediate updates (FMI 3.0).
    pub holding: Vec<String>,
    /// Time of the stepping loop without the calls to the instances \[s\]: the master and the recorder. With
    /// components that step at the same time, it says little.
    pub master_seconds: f64,
    /// Steps of the clock in which calls were timed; the components' times are estimates from these. All of
    /// them with [`Coupling::measure`](super::Coupling::measure).
    pub timed_steps: u64,
}

/// Communication steps, counted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Steps {
    /// Steps that count.
    pub accepted: u64,
    /// Steps that were taken back, since their error was too large (of strong coupling in steps of fixed length: seen to
    /// be a hundredth of the signal, or else, it may be half of it) or a component could not do them.
    pub rejected: u64,
    /// Accepted steps whose error was larger than the tolerance, since they were the shortest allowed
    /// or a component could not go back.
    pub over_tolerance: u64,
    /// Corrections of strong coupling, each of which repeats the step.
    pub corrections: u64,
    /// How often the matrix of these corrections was made anew.
    pub matrices: u64,
    /// Steps in which the corrections were ended before they had converged.
    pub unconverged: u64,
    /// Steps that were repeated, since values that are no reals had changed within them.
    pub repeated: u64,
    /// Steps in which such values did not settle; those of their begin were passed on.
    pub unsettled: u64,
    /// Jumps of signals at which steps were cut, and those that became ramps over a step, since a component
    /// cannot vary its steps.
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
    /// Going back to a saved one.
    pub restores: u64,
}

/// What an instance did.
#[derive(Debug, Clone, PartialEq)]
pub struct InstanceReport {
    /// Name.
    pub name: String,
    /// Its calls.
    pub calls: Calls,
    /// Time in these calls \[s\].
    pub seconds: f64,
}

/// What a connection did.
#[derive(Debug, Clone, PartialEq)]
pub struct ConnectionReport {
    /// The output.
    pub from: String,
    /// The input.
    pub to: String,
    /// Unit of the output; empty if unknown.
    pub unit: String,
    /// What the input got while the output's next value was not known.
    pub transfer: Transfer,
    /// How late the input's values are, averaged over a step \[s\]; negative if early. Parts of second
    /// order in the step are left to the errors.
    pub lag: f64,
    /// By how much the input was wrong; `None` without a step.
    pub error: Option<CouplingError>,
    /// Whether the output ran away from step to step.
    pub divergence: Option<Divergence>,
}

/// What an input gets within a communication step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transfer {
    /// The output's value at the begin of the step.
    Held,
    /// The output's value at the end of the step.
    Ahead,
    /// A polynomial through the values until the begin of the step.
    Extrapolated,
    /// A polynomial through the values until the end of the step.
    Interpolated,
}

impl std::fmt::Display for Transfer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Held => "held",
            Self::Ahead => "ahead",
            Self::Extrapolated => "extrapolated",
            Self::Interpolated => "interpolated",
        })
    }
}

/// By how much the mean of an input over a step of the clock was wrong, in the unit of the feeding output.
///
/// In strong coupling, what it should have been is seen: an FMU that can go back, follows lines and tells slopes steps
/// to points within the step, so that what two fast poles do between its ends is found. Else it is estimated from the communication points:
/// of an input that is held in a fixed step, by a straight line; else by a polynomial of degree 2 or, where the slopes
/// are known, 3. Where the input was just that, it is the polynomial's own error: from the fourth derivative where
/// slopes are known, else by what the next lower degree makes of it. How far the outputs stray from the exact ones in the course of time
/// is another matter: that is what all these errors make together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CouplingError {
    /// Magnitude, averaged over time.
    pub mean: f64,
    /// Largest magnitude.
    pub max: f64,
}

/// How an output ran away.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Divergence {
    /// Up and down in turn, each time further: this comes from the coupling.
    Alternating,
    /// Each few steps ten times as far: this comes from the coupling, or the system is unstable.
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
