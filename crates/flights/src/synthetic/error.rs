//! Errors of synthetic flights.

use pilotage_linear::NotFinite;

/// Why flights cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SyntheticError {
    /// A parameter is out of range.
    #[error("{name} = {value} is out of range; expected {min} to {max}")]
    Range {
        /// Name of the parameter, as on the command line.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Minimum value.
        min: f64,
        /// Maximum value.
        max: f64,
    },
    /// A target is given twice: its runs would have the same names.
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
        /// Command that checks the vehicle.
        command: &'static str,
    },
    /// The loop of human and vehicle is unstable about the start.
    #[error("human and vehicle swing up: about the start their loop is unstable")]
    Unstable,
    /// More sines, ramps or steps than fit into a run.
    #[error("{count} of them do not fit into a run of {samples} samples: {needed} are needed")]
    Crowded {
        /// Requested number.
        count: usize,
        /// Number of samples of a run.
        samples: usize,
        /// Number of samples required.
        needed: usize,
    },
    /// The model has no stick.
    #[error("`{vehicle}` has no input `stick`, by which a vehicle is flown")]
    NoStick {
        /// Name of the model.
        vehicle: String,
    },
    /// A position is not among the outputs.
    #[error("`{vehicle}` has no output `{output}`; its outputs are {}", .outputs.join(", "))]
    NoOutput {
        /// Name of the model.
        vehicle: String,
        /// The missing output.
        output: String,
        /// The outputs.
        outputs: Vec<String>,
    },
    /// The numbers of positions and sticks differ.
    #[error("the vehicle has {sticks} stick(s), and {measured} position(s) are named")]
    Axes {
        /// Number of sticks.
        sticks: usize,
        /// Number of positions.
        measured: usize,
    },
    /// The vehicle has no linearisation at the start.
    #[error(transparent)]
    NotSmooth(#[from] NotFinite),
    /// No gain and lead are found for the vehicle.
    #[error(
        "no gain and lead are found with which a human holds axis {axis} of this vehicle: with a lead of three over the \
         crossover frequency the phase margin stays below 45 degrees"
    )]
    Unsuited {
        /// The axis, from 1.
        axis: usize,
    },
}
