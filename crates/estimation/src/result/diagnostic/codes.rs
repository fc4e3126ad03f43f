//! What each code means.

/// Code and meaning of each diagnostic, of which a test makes the table of docs/diagnostics.md (`tests/it/codes.rs`).
pub const CODES: [(&str, &str); 48] = [
    (
        "not-converged",
        "the solver ended before its tolerance; with a violation, equations or constraints are not satisfied where it ended, and a simulation with the parameters does not satisfy them either: there is no objective, and there are no residuals",
    ),
    (
        "kinks",
        "the solve stalled at kinks of the equations (`min`, `abs`, a dead zone, a rate limit), and a Gauss–Newton step of all unknowns from there is longer than a twentieth of a standard deviation; up to a whole one counts as converged (Bates & Watts, Technometrics 23, 1981)",
    ),
    (
        "violated",
        "for a fit that ended as infeasible: one of the three most violated constraints",
    ),
    (
        "unstable-loop",
        "the system, wired or not, is unstable at its linearisation: at the end of the first run",
    ),
    (
        "loop-on-bound",
        "a condition of `[stability]` is on its bound: a pole of the wired system at -10⁻³ 1/s",
    ),
    (
        "model-on-bound",
        "the same of an instance alone: a pole at -10⁻⁶ 1/s",
    ),
    (
        "at-bound",
        "a parameter, estimated or tied, lies on the end of its range",
    ),
    (
        "few-lines",
        "the target's sines determine fewer numbers than are estimated ([uncertainty.md](uncertainty.md))",
    ),
    (
        "unidentifiable",
        "no measured signal changes along a direction of the parameters, at several starts, and the fit did not end",
    ),
    (
        "undetermined",
        "the interval of a parameter is as wide as its range, or it has none, and its standard deviation exceeds its value; or the objective has no curvature in some direction",
    ),
    (
        "open-loop",
        "an instance without unknowns whose inputs and outputs are recorded (the vehicle, if the runs have a column with the name of the stick, measured or not) does not answer its inputs as recorded: in pieces of the runs, each from the initial states that fit best, the response is another by a factor (sign, unit, gain) or a delay, or less than half of it is explained (dynamics, or something that is not recorded). Not of FMUs",
    ),
    (
        "describing-function",
        "pilot or loop lie outside the error bars of the describing function at a third of the lines, and at three or more; not of a pilot with kinks, which is not linear",
    ),
    (
        "poor-fit",
        "less than half of the variance of a measured signal within the runs is explained",
    ),
    (
        "nothing-explained",
        "less than 2 % of the variance of each measured signal within the runs is explained, or less than half where no input leaves its start value: the fit has no answer, and exit code 1. Not of fewer than 20 values, nor where the recordings are white noise about levels and nothing drives the system",
    ),
    (
        "input-left",
        "residuals are correlated with earlier values of an input: a path or a delay is missing ([uncertainty.md](uncertainty.md))",
    ),
    (
        "changes",
        "a parameter changes along the runs, in all at the same time, at times of their own or in one, or drifts: by a test of constant parameters (sup-LM, at 0.01), by a fifth of its value at least; let it change by `[[run.change]]`, or tie it to `time` ([uncertainty.md](uncertainty.md))",
    ),
    (
        "stepped-input",
        "a column that keeps its values and jumps drives an input, and the file does not say how: it is taken as linear between samples, which makes delays too long and lags and gains too small; say `hold = \"zero-order\"`, or `\"linear\"` if it is so",
    ),
    (
        "outlier",
        "residuals of a column deviate from their neighbours, by ten times the usual change nearby, by 0.3 of their spread, by more than the recording's resolution and beyond the tail of all changes (a gap that a tail like theirs has once in a thousand times), and come back (new values alone, if most repeat the one before); with Laplace's, Student's and Huber's noise they are expected, and not reported",
    ),
    (
        "jump",
        "the same without coming back for thirty samples, from one sample to the next",
    ),
    (
        "frozen",
        "a column repeats a value for at least eight times as many samples as usual while the model moves, and then changes at once by five times the usual change: the sensor or the recording stood still; empty these cells. Or one that drives an input along lines does so, and residuals are 1.5 times as large meanwhile: cut the run there",
    ),
    (
        "slow-sensor",
        "a column keeps each value for three rows or more, as a sensor does that is slower than the recording, and the repeated values are off by a fifth of the residuals: delays come out too long; empty the cells that repeat the one before",
    ),
    (
        "late",
        "without a pilot in a loop: a run fits best if its model is shifted in time, by five standard deviations and half a sample more than the others, which differ less among themselves: columns with different clocks",
    ),
    (
        "gap",
        "no rows for ten times the usual step, in a run that is sampled regularly else: its inputs are taken along lines there",
    ),
    (
        "time-scale",
        "with a pilot in a loop: the longest run takes less than a second, or has a sample every two seconds or less often: the times may be in another unit. With such samples and a header without unit the fit has no answer, and exit code 1",
    ),
    (
        "misfit",
        "among three or more runs, one has an rms residual of three times the median, both absolutely and relative to its recorded signal",
    ),
    (
        "clipped",
        "in a run, 5 % of a column's samples stay at the ends of its recorded range, for five samples or more, while the model moves",
    ),
    (
        "few-values",
        "fewer measured values than unknowns without priors, or as many without `sd`: the fit has no answer, and exit code 1",
    ),
    (
        "constant-data",
        "no measured column moves in any run, with a pilot or an input that moves: as `few-values`",
    ),
    (
        "no-forcing",
        "of an instance named `pilot`: no run has a target away from where it begins, and nothing else moves the loop: what moves is the human's own noise. As `few-values`",
    ),
    (
        "wrong-scale",
        "of an instance named `pilot`: the positions follow the targets with a factor that no human has, as with a wrong unit or sign. As `few-values`, unless it is so in one run alone",
    ),
    (
        "origin",
        "of an instance named `pilot`: the positions of a run follow its targets beside them",
    ),
    (
        "target-outlier",
        "of an instance named `pilot`: a target differs for one or two samples",
    ),
    (
        "mixed",
        "runs were flown with different kinds of sticks, with different vehicles, by different people, or are marked as not counting (`# device:`, `# vehicle:`, `# subject:`, `# valid:` at the top of a flight)",
    ),
    (
        "copy",
        "runs of different files have the same samples: they count twice",
    ),
    ("alone", "among three or more starts, only one ended here"),
    (
        "other-optimum",
        "a start ended at other parameters with an objective of which the data do not tell which is better, a 95 % region's edge away at most, by four standard deviations in what the data determine; as where two lags in series may be exchanged",
    ),
    (
        "mesh-error",
        "the mesh is not as fine as requested; on a given mesh (`mesh`, `mesh_step`) the states' estimated relative error is above 10⁻³ and a simulation with the estimates has another objective: parameters may be off by as much, and if the simulation is off by 0.3 of what was recorded, the fit has no answer. Or the last refinement moved a parameter by more than 10⁻³ of its size",
    ),
    (
        "simulation",
        "a simulation with the estimates has another objective, by a thousandth and by a hundredth of a standard deviation in each value: a coarse mesh, or an unstable system",
    ),
    (
        "undefined",
        "a value that is not finite at the start of the search",
    ),
    ("fmu-failed", "a call of an FMU that failed"),
    (
        "early-end",
        "the solver did not converge, and a simulation with the start values ends early: it diverges, or oscillates too often for a mesh",
    ),
    (
        "on-limit",
        "the limit of an output constrains the solution at samples: if the recorded output saturated there, parameters are wrong; leave out `limits = \"constrain\"`",
    ),
    (
        "coloured",
        "with process noise: innovations of a run are not white (Ljung and Box's test at 0.001, over all runs and columns)",
    ),
    (
        "unbounded",
        "with process noise: a sample is predicted a thousand times as accurately as the others; for example, with a free initial state and a noise level without a `min` the likelihood has no maximum",
    ),
    (
        "beyond-limit",
        "with process noise: the run without noise exceeds an output's limit",
    ),
    (
        "event",
        "an FMU would have an event in a run: the fit continues with the equations before it",
    ),
    (
        "fmu-description",
        "the description of an FMU has a wrong derivative or dependency",
    ),
    (
        "cut",
        "`--time-limit` or Ctrl-C ended the fit before all starts and refinements were done",
    ),
];
