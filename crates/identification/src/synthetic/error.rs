//! Why a human cannot fly.

use pilotage_linear::NotFinite;

/// Why a human cannot fly.
#[derive(Debug, thiserror::Error)]
pub enum SyntheticError {
    /// A parameter that no human or experiment has.
    #[error("{name} = {value} is out of range; expected {min} to {max}")]
    Range {
        /// Name of the parameter, as on the command line.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// A target that is asked for twice: its runs would have the same names.
    #[error("target {target} m is given twice; `runs` says how often each is flown to")]
    Twice {
        /// The target \[m\].
        target: f64,
    },
    /// Human and vehicle together are unstable.
    #[error(
        "in run {run} human and vehicle swing up without bound: {position:e} {unit} at {time} s; \
         look at the vehicle with `{command}`"
    )]
    Diverged {
        /// Name of the run.
        run: String,
        /// Time of the first sample out of bounds \[s\].
        time: f64,
        /// Position there.
        position: f64,
        /// Its unit.
        unit: String,
        /// The command that looks at the vehicle.
        command: &'static str,
    },
    /// Human and vehicle are unstable from the start on.
    #[error("human and vehicle swing up: about the start their loop is unstable")]
    Unstable,
    /// More sines, ramps or steps than a run has room for.
    #[error("{count} of them do not fit into a run of {samples} samples: {needed} are needed")]
    Crowded {
        /// How many were asked for.
        count: usize,
        /// Samples of a run.
        samples: usize,
        /// Samples that they need.
        needed: usize,
    },
    /// A model that nobody can move.
    #[error("`{vehicle}` has no input `stick`, by which a vehicle is flown")]
    NoStick {
        /// Name of the model.
        vehicle: String,
    },
    /// A position that is none of the outputs.
    #[error("`{vehicle}` has no output `{output}`; its outputs are {}", .outputs.join(", "))]
    NoOutput {
        /// Name of the model.
        vehicle: String,
        /// What is not among them.
        output: String,
        /// The outputs.
        outputs: Vec<String>,
    },
    /// Another number of positions than of sticks.
    #[error("the vehicle has {sticks} stick(s), and {measured} position(s) are named")]
    Axes {
        /// Number of sticks.
        sticks: usize,
        /// Number of positions.
        measured: usize,
    },
    /// A start at which the vehicle has no linearisation.
    #[error(transparent)]
    NotSmooth(#[from] NotFinite),
    /// A vehicle for which no gain and lead are found.
    #[error(
        "no gain and lead are found with which a human holds axis {axis} of this vehicle: with a lead of three over the \
         crossover frequency the phase margin stays below 45 degrees"
    )]
    Unsuited {
        /// The axis, from 1.
        axis: usize,
    },
}
