//! What recordings give to doubt by themselves, before any fit or where one has no answer; after a fit, residuals tell more.
//!
//! | module | contents |
//! | --- | --- |
//! | `tracked` | whether what a person moves follows its target |

mod tracked;

use crate::posed::Posed;
use crate::posed::data::RunData;
use crate::problem::file::{Hold, Noise};
use crate::result::diagnostic::Diagnostic;
use crate::result::{Fit, RunFit};
use pilotage_cosim::description::Spanned;
use pilotage_inference::outliers::{
    Breaks, Frozen, Kind, Values, clipped, frozen, median, of_fresh, resolution, rows_per_value,
};
use pilotage_inference::sampling::{self, median_step, steps};
use pilotage_inference::statistics::{range, rms};
use tracked::Person;

/// A run is sampled regularly if this part of its steps is within half of the usual one.
const REGULAR: f64 = 0.8;
/// Number of rows from which on a run has a usual step.
const ROWS: usize = 50;
/// Ratio of residuals within a stretch to those outside that the stretch makes worse.
const WORSE: f64 = 1.5;
/// A column that moves by this part of its range moves others, ...
const DRIVES: f64 = 0.3;
/// ... at once within this number of rows.
const ANSWER: usize = 30;
/// By how much values must be late \[s\] to change a person's delay visibly.
const LATE: f64 = 0.02;
/// A column stands still whose range is below this part of its largest magnitude.
const STILL: f64 = 1e-9;
/// The instance that is a person.
pub const PILOT: &str = "pilot";

/// A recorded column, in the unit of its signal.
struct Column {
    name: String,
    unit: Option<String>,
    /// Its values in each run.
    runs: Vec<Vec<f64>>,
}

/// All that is recorded of a problem.
struct Recorded<'p> {
    posed: &'p Posed<'p>,
    /// Measured columns of numbers, and their noise.
    measured: Vec<(Noise, Column)>,
    /// Those that drive inputs.
    inputs: Vec<Column>,
    person: Option<Person>,
}

/// All that needs no fit, what makes any fit meaningless first. Where nothing moves, samples are of no interest.
pub fn before(posed: &Posed<'_>) -> Vec<Diagnostic> {
    let mut all = of_recordings(posed, None);
    if all.contains(&Diagnostic::ConstantData) {
        all.retain(Diagnostic::is_fatal);
    }
    all.sort_by_key(|own| !own.is_fatal());
    all
}

/// The same where they make any fit meaningless; otherwise none.
pub(crate) fn hopeless(posed: &Posed<'_>) -> Vec<Diagnostic> {
    if posed.is_hopeless.get() == Some(&false) {
        return Vec::new();
    }
    let mut all = before(posed);
    let is_hopeless = all.iter().any(Diagnostic::is_fatal);
    if !*posed.is_hopeless.get_or_init(|| is_hopeless) {
        all.clear();
    }
    all
}

/// All of these diagnostics, without those that the residuals of an answer tell better.
pub(super) fn of_recordings(posed: &Posed<'_>, answer: Option<&Fit>) -> Vec<Diagnostic> {
    let recorded = Recorded::of(posed);
    let person = recorded.person.as_ref();
    let mut all = Vec::new();
    all.extend(few_values(posed));
    all.extend(recorded.movement());
    all.extend(of_copies(posed));
    all.extend(recorded.time_scale());
    all.extend(posed.data.iter().find_map(|run| gap(posed, run)));
    for (noise, own) in recorded.measured.iter().filter(|_| answer.is_none()) {
        let is_expected =
            |own: &Diagnostic| matches!(own, Diagnostic::Outlier { .. }) && noise.has_tails();
        let found = recorded.of_column(own).into_iter();
        all.extend(found.filter(|own| !is_expected(own)));
    }
    // Nothing is fitted to the motion that a person alone sees.
    if let Some(seen) = person.filter(|own| own.sees_column) {
        all.extend(recorded.of_column(&seen.position));
    }
    all.extend(recorded.dead_stick());
    all.extend(recorded.flicker());
    all.extend(frozen_input(posed, answer));
    all
}

/// Fewer measured values than unknowns that no prior says anything of, and one more where their noise is unknown, too.
fn few_values(posed: &Posed<'_>) -> Option<Diagnostic> {
    let recorded = posed.quantities.recorded.iter().flatten().flatten();
    let values = recorded.filter(|own| own.is_finite()).count();
    let unknowns = posed.unknowns.iter();
    let told = unknowns.filter(|(own, _)| own.prior.is_some()).count();
    let unknowns = posed.count();
    let noise = posed.file.measured.iter().any(|own| own.sd.is_missing());
    (values + told < unknowns + usize::from(noise))
        .then_some(Diagnostic::FewValues { values, unknowns })
}

impl Column {
    fn of(posed: &Posed<'_>, name: &Spanned<String>, unit: Option<&str>) -> Option<Self> {
        let runs = posed.data.iter().map(|run| run.column(name, unit).ok());
        Some(Self {
            name: name.value.clone(),
            unit: unit.map(str::to_owned),
            runs: runs.collect::<Option<_>>()?,
        })
    }

    fn is_still(&self) -> bool {
        self.runs.iter().all(|own| is_still(own))
    }
}

/// Whether values do not change.
fn is_still(values: &[f64]) -> bool {
    let [low, high] = range(values);
    high - low <= STILL * low.abs().max(high.abs())
}

/// Width of the range of some values.
fn width(values: &[f64]) -> f64 {
    let [low, high] = range(values);
    high - low
}

impl<'p> Recorded<'p> {
    fn of(posed: &'p Posed<'p>) -> Self {
        let signals = posed.file.measured.iter().enumerate();
        let measured = signals.filter_map(|(k, own)| {
            let column = Column::of(posed, &own.column, posed.unit_of(k))?;
            Some((own.noise, column))
        });
        let inputs = posed.file.inputs.iter();
        let inputs =
            inputs.map(|own| Column::of(posed, &own.column, posed.joint.unit(&own.signal.value)));
        Self {
            posed,
            measured: measured.collect(),
            inputs: inputs.flatten().collect(),
            person: Person::of(posed),
        }
    }

    fn time(&self, run: usize) -> &[f64] {
        &self.posed.data[run].series.time
    }

    fn name(&self, run: usize) -> String {
        self.posed.data[run].name()
    }

    /// Whether something moves, and as a person does.
    fn movement(&self) -> Vec<Diagnostic> {
        let moves = self.inputs.iter().any(|own| !own.is_still());
        // Without a loop a person may see a target alone, beside a position of zeros.
        let moved = self.person.as_ref().filter(|own| !own.sees_column);
        let seen = moved.map(|own| &own.position);
        let is_dead = seen.is_some_and(Column::is_still)
            || (!self.measured.is_empty()
                && self.measured.iter().all(|(_, own)| own.is_still())
                && (moves || seen.is_some()));
        // A simulation asks nothing.
        let is_asked = self.posed.count() > 0;
        match self.person.as_ref().filter(|_| is_asked) {
            _ if is_dead && is_asked => vec![Diagnostic::ConstantData],
            Some(person) => person.diagnostics(self),
            None => Vec::new(),
        }
    }

    fn time_scale(&self) -> Option<Diagnostic> {
        let mut parts = self.posed.joint.parts.iter();
        parts.find(|(name, _)| name == PILOT)?;
        let runs = self.posed.data.iter();
        let [duration, step] =
            sampling::time_scale(runs.clone().map(|run| run.series.time.as_slice()))?;
        let mut units = runs.map(|run| &run.series.time_unit);
        Some(Diagnostic::TimeScale {
            duration,
            step,
            is_stated: units.all(|unit| !unit.is_empty()),
        })
    }

    /// The checks of a column's samples.
    fn of_column(&self, own: &Column) -> Vec<Diagnostic> {
        let runs = own.runs.iter().enumerate();
        let values = runs.clone().map(|(run, values)| Values {
            time: self.time(run).to_vec(),
            values: of_fresh(values.clone(), values),
            resolution: resolution(values),
            modelled: Vec::new(),
        });
        let values: Vec<Values> = values.collect();
        let mut breaks = Breaks::of(&values, Kind::Recorded);
        let mut still: Vec<(usize, Frozen)> = Vec::new();
        for (run, values) in runs.clone() {
            let mut frozen = frozen(values);
            frozen.retain(|own| !own.is_end || self.is_driven(run, own));
            breaks.forget_after(run, &frozen);
            still.extend(frozen.into_iter().map(|own| (run, own)));
        }
        // What is driven may follow a step at once.
        (breaks.jumps).retain(|&(run, k, _)| !self.is_led(run, k));
        let ends = runs.clone();
        let ends = ends.filter_map(|(run, values)| Some((run, clipped(values, None)?)));
        let most = ends.max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let of_end = most.map(|(run, (part, value))| Diagnostic::Clipped {
            measured: own.name.clone(),
            run: self.name(run),
            value,
            unit: own.unit.clone(),
            part,
        });
        let slow = runs.clone().find_map(|(run, values)| {
            let rows = rows_per_value(values)?;
            let late = 0.5 * (rows - 1) as f64 * median_step(self.time(run))?;
            (late >= LATE).then(|| Diagnostic::SlowSensor {
                measured: own.name.clone(),
                run: self.name(run),
                rows,
            })
        });
        let all = [
            self.outlier(own, &breaks),
            self.jump(own, &breaks),
            self.longest(own, still),
            of_end,
            slow,
        ];
        all.into_iter().flatten().collect()
    }

    /// The largest of the samples that break away.
    fn outlier(&self, own: &Column, breaks: &Breaks) -> Option<Diagnostic> {
        let middle = |run: usize| {
            let known = own.runs[run].iter().copied().filter(|y| y.is_finite());
            median(known).unwrap_or(0.0)
        };
        let square = |(run, k): (usize, usize)| (own.runs[run][k] - middle(run)).powi(2);
        let samples = breaks.samples();
        let (run, k) = samples
            .clone()
            .max_by(|a, b| square(*a).total_cmp(&square(*b)))?;
        let all = (0..own.runs.len()).flat_map(|run| {
            let middle = middle(run);
            own.runs[run].iter().map(move |y| (y - middle).powi(2))
        });
        let total: f64 = all.filter(|own| own.is_finite()).sum();
        Some(Diagnostic::Outlier {
            measured: own.name.clone(),
            run: self.name(run),
            time: self.time(run)[k],
            value: own.runs[run][k],
            unit: own.unit.clone(),
            count: samples.clone().count(),
            // What nobody moves may be hit.
            share: match self.person {
                Some(_) => samples.map(square).sum::<f64>() / total,
                None => 0.0,
            },
            is_fitted: false,
        })
    }

    fn jump(&self, own: &Column, breaks: &Breaks) -> Option<Diagnostic> {
        let (run, k, size) = breaks.jump()?;
        Some(Diagnostic::Jump {
            measured: own.name.clone(),
            run: self.name(run),
            time: self.time(run)[k],
            size,
            unit: own.unit.clone(),
        })
    }

    /// The longest stretch in which a column stands still.
    fn longest(&self, own: &Column, all: Vec<(usize, Frozen)>) -> Option<Diagnostic> {
        let count = all.len();
        let (run, still) = (all.into_iter()).max_by_key(|(_, own)| own.samples.len())?;
        let (time, values) = (self.time(run), &own.runs[run]);
        let value = values[still.samples.start];
        Some(Diagnostic::Frozen {
            measured: own.name.clone(),
            run: self.name(run),
            value,
            from: time[still.samples.start],
            to: time[still.samples.end - 1],
            size: still.next.map(|next| values[next] - value),
            unit: own.unit.clone(),
            count,
        })
    }

    /// Whether an input or a person's stick moves meanwhile: what it drives does not rest then.
    fn is_driven(&self, run: usize, still: &Frozen) -> bool {
        let stick = self.person.iter().flat_map(|own| &own.stick);
        let mut all = self.inputs.iter().chain(stick).map(|own| &own.runs[run]);
        all.any(|own| width(&own[still.samples.clone()]) > DRIVES * width(own))
    }

    /// Whether an input jumps within the rows before.
    fn is_led(&self, run: usize, k: usize) -> bool {
        self.inputs.iter().any(|own| {
            let values = &own.runs[run];
            let mut steps = values[k.saturating_sub(ANSWER)..=k].windows(2);
            steps.any(|pair| (pair[1] - pair[0]).abs() > DRIVES * width(values))
        })
    }

    /// A stick that is not fitted and keeps one value while a person moves something.
    fn dead_stick(&self) -> Option<Diagnostic> {
        let person = self.person.as_ref()?;
        let stick = person.stick.as_ref()?;
        let is_dead = |run: &usize| {
            let known = stick.runs[*run].iter().filter(|own| own.is_finite());
            known.count() > 1
                && is_still(&stick.runs[*run])
                && !is_still(&person.position.runs[*run])
        };
        let run = (0..stick.runs.len()).find(is_dead)?;
        let whole = Frozen {
            samples: 0..self.time(run).len(),
            next: None,
            is_end: true,
        };
        self.longest(stick, vec![(run, whole)])
    }

    /// A target that shows another value for one or two rows.
    fn flicker(&self) -> Option<Diagnostic> {
        let target = self.person.as_ref()?.target.as_ref()?;
        let mut runs = target.runs.iter().enumerate();
        runs.find_map(|(run, values)| {
            let k = tracked::flicker(values)?;
            Some(Diagnostic::TargetOutlier {
                column: target.name.clone(),
                run: self.name(run),
                time: self.time(run)[k],
                target: values[k],
                around: values[k - 1],
                unit: target.unit.clone(),
            })
        })
    }
}

/// Runs of different files with the same samples. The same file with other settings is intended.
fn of_copies(posed: &Posed<'_>) -> Option<Diagnostic> {
    let bits = |run: usize| -> Vec<u64> {
        let recorded = posed.quantities.recorded.iter().flat_map(|own| &own[run]);
        let inputs = posed.file.inputs.iter();
        let inputs = inputs.filter_map(|own| posed.data[run].series.column(&own.column.value));
        let inputs = inputs.flat_map(|own| &own.values);
        let all = posed.data[run].series.time.iter().chain(recorded);
        all.chain(inputs).map(|value| value.to_bits()).collect()
    };
    let is_measured = |run: usize| {
        let mut signals = posed.quantities.recorded.iter();
        signals.any(|own| own[run].iter().any(|y| y.is_finite()))
    };
    let all: Vec<Vec<u64>> = (0..posed.data.len()).map(bits).collect();
    let of = |run: usize| {
        let file = |run: usize| &posed.data[run].line.file;
        (0..run).find(|first| file(*first) != file(run) && all[*first] == all[run])
    };
    let copies = (0..all.len()).filter(|run| is_measured(*run));
    let copies: Vec<(usize, usize)> = copies.filter_map(|run| Some((run, of(run)?))).collect();
    let &(run, first) = copies.first()?;
    Some(Diagnostic::Copy {
        run: posed.data[run].name(),
        of: posed.data[first].name(),
        count: copies.len(),
    })
}

/// The columns that drive inputs along lines.
fn lines<'p>(posed: &'p Posed<'_>) -> impl Iterator<Item = &'p str> {
    let inputs = posed.file.inputs.iter();
    let along = inputs.filter(|own| own.hold != Some(Hold::Zero));
    along.map(|own| own.column.value.as_str())
}

/// The longest stretch in which an input stands still that moves before and afterwards. It may well have rested if all measured
/// signals are fitted as well there.
fn frozen_input(posed: &Posed<'_>, answer: Option<&Fit>) -> Option<Diagnostic> {
    let of_run = |(j, data): (usize, &RunData<'_>)| {
        let of_column = |column: &str| {
            let time = &data.series.time;
            let mut all = frozen(&data.series.column(column)?.values);
            all.retain(|own| !own.is_end);
            let own = all.into_iter().max_by_key(|own| own.samples.len())?;
            let [from, to] = [own.samples.start, own.samples.end - 1].map(|k| time[k]);
            let is_worse =
                |fit: &Fit, k: usize| is_worse_within(posed, &fit.runs[j], k, [from, to]);
            let is_doubted =
                answer.is_none_or(|fit| (0..posed.file.measured.len()).any(|k| is_worse(fit, k)));
            is_doubted.then(|| Diagnostic::FrozenInput {
                column: column.to_owned(),
                run: data.name(),
                from,
                to,
                is_worse: answer.is_some(),
            })
        };
        lines(posed).find_map(of_column)
    };
    posed.data.iter().enumerate().find_map(of_run)
}

/// Whether the residuals of a measured signal are larger within these times than outside.
fn is_worse_within(posed: &Posed<'_>, run: &RunFit, k: usize, [from, to]: [f64; 2]) -> bool {
    let residuals = run.residuals(k, posed.file.measured[k].noise);
    let pairs = run.time.iter().zip(residuals);
    let (inside, outside): (Vec<_>, Vec<_>) = pairs.partition(|(t, _)| (from..=to).contains(*t));
    let size = |all: Vec<(&f64, f64)>| rms(&all.iter().map(|own| own.1).collect::<Vec<_>>());
    size(inside) > WORSE * size(outside)
}

/// A time without rows in a run that is sampled regularly else.
fn gap(posed: &Posed<'_>, run: &RunData<'_>) -> Option<Diagnostic> {
    let time = &run.series.time;
    let usual = median_step(time)?;
    let regular = steps(time).filter(|step| (step - usual).abs() <= 0.5 * usual);
    let is_regular = time.len() >= ROWS && regular.count() as f64 >= REGULAR * time.len() as f64;
    lines(posed).next().filter(|_| is_regular)?;
    let [from, to] = sampling::gap(time)?;
    Some(Diagnostic::Gap {
        run: run.name(),
        from,
        to,
    })
}
