//! What a check may find, with message and code.

use pilotage_text::number::{rounded, short};

/// A reason to doubt recorded flights or their vehicle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Check {
    /// The vehicle does not move in any run.
    #[error("the vehicle does not move in any run: nothing can be said of the pilot")]
    ConstantData,
    /// No run has a target away from its initial position, so that all motion is the pilot's own noise.
    #[error(
        "{}: what moves is the human's own noise, and no pilot can be identified from that; record runs to targets {}, or \
         to moving ones",
        targets(*.forcing, *.error),
        if *.forcing == 0.0 { "away from the start" } else { "farther away" }
    )]
    NoForcing {
        /// Largest distance of a target from the initial position of its run \[m\].
        forcing: f64,
        /// The largest error of a run \[m\].
        error: f64,
    },
    /// The positions follow the targets with a factor that no human produces.
    #[error(
        "{}the vehicle moves {factor:.3} times as far as its targets: position or target has {}",
        run.as_ref().map_or(String::new(), |run| format!("in {run}, unlike in other runs, ")),
        match *.factor < 0.0 {
            true => "the wrong sign, or another origin than the other",
            false => "the wrong unit; give the column its unit, as in `position [cm]`",
        }
    )]
    WrongScale {
        /// Slope of the positions over the targets, both relative to the start of the run.
        factor: f64,
        /// The run, if it is not so in all.
        run: Option<String>,
    },
    /// The positions follow the targets from another origin.
    #[error(
        "the positions of {run} follow its targets {} m beside them: one of the two may have another origin",
        short(*.offset, 3)
    )]
    Origin {
        /// Name of the first such run.
        run: String,
        /// Mean of positions minus targets \[m\].
        offset: f64,
    },
    /// The runs are so short, or their samples so sparse, that another time unit is likely.
    #[error(
        "the longest run takes {duration:.1} s with a sample every {} s: a pilot acts within tenths \
         of a second and takes seconds to a target, so the times may be in another unit; head the column \
         with it, as in `time [ms]`",
        short(*.step, 3)
    )]
    TimeScale {
        /// Duration of the longest run \[s\].
        duration: f64,
        /// Median time between its samples \[s\].
        step: f64,
    },
    /// The recorded stick keeps a value although the vehicle moves.
    #[error(
        "the recorded stick of {run} stays at {} while the vehicle moves: leave the column out",
        short(*.value, 4)
    )]
    DeadStick {
        /// Name of the first such run.
        run: String,
        /// The value.
        value: f64,
    },
    /// A run that is fitted from rest is in motion at its start.
    #[error(
        "{run} begins at {speed:.2} m/s, and full stick from rest gives {most:.2} m/s: it was in motion \
         before its first sample; begin the recording earlier, or fit with --initial-state free"
    )]
    Moving {
        /// Name of the run.
        run: String,
        /// Speed over the first samples [m/s].
        speed: f64,
        /// Speed that full stick from hover yields over the same time [m/s].
        most: f64,
    },
    /// A target that differs for one or two samples.
    #[error(
        "the target of {run} is {target} m at {time} s and {around} m before and after: if that is an error, \
         mend it, since the pilot is made to answer it"
    )]
    TargetOutlier {
        /// Name of the run.
        run: String,
        /// Time of the sample \[s\].
        time: f64,
        /// The target there \[m\].
        target: f64,
        /// The target before and after \[m\].
        around: f64,
    },
    /// The recording jumps and does not return.
    #[error(
        "{run} jumps by {} m at {} s and does not come back: part of it may have another origin or unit",
        short(*.size, 4),
        rounded(*.time, 9)
    )]
    Jump {
        /// Name of the run.
        run: String,
        /// Time of the first sample after the jump \[s\].
        time: f64,
        /// Size of the jump \[m\].
        size: f64,
    },
    /// The position or the target repeats a value while the vehicle moves on.
    #[error(
        "the {of} of {run} stays at {} m from {} s to {} s{}{}: the sensor or the recording stood still; {}",
        short(*.value, 6),
        rounded(*.from, 9),
        rounded(*.to, 9),
        afterwards(*.size),
        stretches(*.count),
        match *.of {
            "position" => "empty these cells",
            _ => "cut the run there",
        }
    )]
    Frozen {
        /// `position` or `target`.
        of: &'static str,
        /// Name of the run.
        run: String,
        /// The value \[m\].
        value: f64,
        /// Time of the first such sample \[s\].
        from: f64,
        /// Time of the last such sample \[s\].
        to: f64,
        /// The next sample relative to that \[m\]; none at the end of the run.
        size: Option<f64>,
        /// Number of such stretches, of which this is the longest.
        count: usize,
    },
    /// The position stays at an end of its range.
    #[error(
        "{:.0} % of the positions of {run} stay at the ends of what was recorded, such as {} m, which the vehicle reaches and \
         leaves at speed: the sensor measures no further, or there is a stop, which the vehicle of the fit has not; empty \
         these cells",
        100.0 * part,
        short(*.value, 6)
    )]
    Clipped {
        /// Name of the run with the largest part.
        run: String,
        /// The end \[m\].
        value: f64,
        /// The part, 0 to 1.
        part: f64,
    },
    /// The position is that of a sensor that is slower than the recording.
    #[error(
        "the position of {run} is new in one of {rows} rows alone, and repeated in the others: a fit takes every row for a \
         sample, and the vehicle comes out {} s late; empty the cells that repeat the one before",
        short(*.late, 2)
    )]
    SlowSensor {
        /// Name of the first such run.
        run: String,
        /// Number of rows for each value.
        rows: usize,
        /// By how much the values are late on average \[s\].
        late: f64,
    },
    /// A sample that is far from its neighbours.
    #[error(
        "the sample of {run} at {} s is {} m and far from its neighbours{}; empty the cell if it is an error",
        rounded(*.time, 9),
        short(*.value, 4),
        worst(*.count)
    )]
    Outlier {
        /// Name of the run.
        run: String,
        /// Time of the sample \[s\].
        time: f64,
        /// The position \[m\].
        value: f64,
        /// Number of such samples.
        count: usize,
    },
    /// The recorded stick has the opposite sign of what the vehicle's motion implies.
    #[error(
        "the recorded stick goes against the vehicle's motion (correlation {correlation:.2} with the \
         stick that the motion implies): forward is negative here, so its sign may be wrong"
    )]
    StickSign {
        /// Correlation of the recorded stick with that of the inverted vehicle.
        correlation: f64,
    },
    /// Mass, inertia and arm length are inconsistent.
    #[error(
        "the vehicle's radius of gyration √(inertia/mass) is {gyration:.3} m with an arm of {arm} m: \
         one of mass, inertia and arm_length may be in another unit"
    )]
    VehicleSize {
        /// Radius of gyration √(I/m) \[m\].
        gyration: f64,
        /// Arm length \[m\].
        arm: f64,
    },
    /// The vehicle's own pitch loop is unstable.
    #[error(
        "the vehicle's own pitch loop is unstable, so it cannot have been flown; see `pilotage vehicle \
         check`"
    )]
    VehicleUnstable,
    /// Two flights of the fit have the same samples.
    #[error(
        "{run} has the samples of {of}{}: what is in both counts twice, and intervals are too narrow; leave one out",
        others(*count)
    )]
    Copy {
        /// Name of the flight.
        run: String,
        /// Name of the first one with these samples.
        of: String,
        /// Number of such copies.
        count: usize,
    },
}

impl Check {
    /// Code for scripts.
    pub fn code(&self) -> &'static str {
        match self {
            Self::ConstantData => "constant-data",
            Self::NoForcing { .. } => "no-forcing",
            Self::WrongScale { .. } => "wrong-scale",
            Self::Origin { .. } => "origin",
            Self::TimeScale { .. } => "time-scale",
            Self::DeadStick { .. } => "dead-stick",
            Self::Moving { .. } => "moving-start",
            Self::TargetOutlier { .. } => "target-outlier",
            Self::Jump { .. } => "jump",
            Self::Frozen { .. } => "frozen",
            Self::Clipped { .. } => "clipped",
            Self::SlowSensor { .. } => "slow-sensor",
            Self::Outlier { .. } => "outlier",
            Self::StickSign { .. } => "stick-sign",
            Self::VehicleSize { .. } => "vehicle-size",
            Self::VehicleUnstable => "vehicle-unstable",
            Self::Copy { .. } => "copy",
        }
    }

    /// Whether the recordings contain no information about a pilot, whatever a fit is.
    pub fn is_fatal(&self) -> bool {
        matches!(
            self,
            Self::ConstantData | Self::NoForcing { .. } | Self::WrongScale { run: None, .. }
        )
    }
}

/// Distance of the targets from the start of the runs \[m\].
fn targets(forcing: f64, error: f64) -> String {
    match forcing {
        0.0 => "every run begins at its target, which stays there".to_owned(),
        _ => format!(
            "no target is more than {forcing:.3} m from where its run begins, and the vehicle strays up to \
             {error:.3} m from it"
        ),
    }
}

/// Number of copies, if there is more than one.
fn others(count: usize) -> String {
    match count {
        1 => String::new(),
        _ => format!(" ({count} flights are such copies)"),
    }
}

/// What a position does after it stood still.
fn afterwards(size: Option<f64>) -> String {
    match size {
        Some(size) => format!(" and is {} m away at the next sample", short(size, 4)),
        None => " while target or stick move".to_owned(),
    }
}

/// Number of such stretches, if there is more than one.
fn stretches(count: usize) -> String {
    match count {
        1 => String::new(),
        _ => format!(" (the longest of {count} such stretches)"),
    }
}

/// Number of outliers, if there is more than one.
fn worst(count: usize) -> String {
    match count {
        1 => String::new(),
        _ => format!(", the worst of {count} such samples"),
    }
}
