//! Tests of repeatability: after a reset, from a saved state, next to other instances.

use super::subject::{Subject, Trace};
use super::{Reporter, Stop};
use pilotage_fmi::description::Severity;
use pilotage_fmi::fmu::Library;

/// Number of steps compared.
const STEPS: u32 = 4;

/// Relative tolerance of an FMU that declares none.
const TOLERANCE: f64 = 1e-4;

/// Accepted difference between two runs, in multiples of the tolerance: a restarted solver takes other steps, with
/// other errors.
const TOLERANCES: f64 = 10.0;

impl Reporter<'_> {
    /// A reset restores the state after instantiation (FMI 2.0.5, section 2.1.6).
    pub(super) fn reset(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::start(library, "check", self)?;
        self.stage("stepping");
        let first = subject.trace(STEPS, self)?;
        self.stage("resetting");
        subject.instance.reset()?;
        subject.initialize(self)?;
        self.stage("stepping after a reset");
        let second = subject.trace(STEPS, self)?;
        self.compare(
            &subject,
            &first,
            &second,
            "after a reset, the same simulation gives other outputs",
        );
        Ok(())
    }

    /// A saved state is complete (FMI 2.0.5, section 2.1.8).
    pub(super) fn state(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::start(library, "check", self)?;
        self.stage("stepping");
        if !subject.step(self)? {
            return Ok(());
        }
        self.stage("saving the state");
        let point = subject.save()?;
        self.stage("stepping from a saved state");
        let first = subject.trace(STEPS, self)?;
        self.stage("going back to a saved state");
        subject.restore(&point)?;
        self.stage("stepping from a restored state");
        let second = subject.trace(STEPS, self)?;
        self.compare(
            &subject,
            &first,
            &second,
            "from a restored state, the same steps give other outputs",
        );
        if subject.facts.can_serialize {
            self.stage("serializing the state");
            let bytes = subject.instance.serialize(point.saved)?;
            self.stage("deserializing the state");
            let copy = subject.with_bytes(&point, &bytes)?;
            subject.restore(&copy)?;
            self.stage("stepping from a deserialized state");
            let third = subject.trace(STEPS, self)?;
            let what = "from a state that went through bytes, the same steps give other outputs";
            self.compare(&subject, &first, &third, what);
        }
        self.stage("freeing the state");
        subject.instance.free(point.saved)?;
        Ok(())
    }

    /// Instances share no state (canBeInstantiatedOnlyOncePerProcess="false").
    pub(super) fn instances(&mut self, library: &Library) -> Result<(), Stop> {
        let mut alone = Subject::start(library, "alone", self)?;
        self.stage("stepping");
        let first = alone.trace(STEPS, self)?;
        drop(alone);
        self.stage("making a second instance");
        let mut one = Subject::start(library, "one", self)?;
        let mut other = Subject::start(library, "other", self)?;
        self.stage("stepping two instances in turn");
        // The other instance is one step ahead, so that shared values are detected.
        let mut other_goes_on = other.step(self)?;
        let mut second = Trace::new();
        for _ in 0..STEPS {
            let goes_on = one.step(self)?;
            second.push(one.outputs()?);
            other_goes_on = other_goes_on && other.step(self)?;
            if !goes_on {
                break;
            }
        }
        let what = "beside another instance, the same simulation gives other outputs, though the \
                    FMU may be instantiated more than once in a process";
        self.compare(&one, &first, &second, what);
        Ok(())
    }

    /// Compares the outputs of two runs. The standard does not guarantee identical bits: a difference within the error
    /// of a solver is a warning.
    fn compare(&mut self, subject: &Subject, first: &Trace, second: &Trace, what: &str) {
        if first.len() != second.len() {
            let (found, expected) = (second.len(), first.len());
            self.error(format!(
                "{what}: they end after {found} steps, not {expected}"
            ));
            return;
        }
        let allowed = TOLERANCES * subject.plan.tolerance.unwrap_or(TOLERANCE);
        let worst = (subject.names.iter().enumerate())
            .filter_map(|(k, name)| Some((name, Difference::of(k, first, second)?)))
            .max_by(|(_, a), (_, b)| a.relative().total_cmp(&b.relative()));
        let Some((name, difference)) = worst else {
            return;
        };
        let severity = match difference.relative() <= allowed {
            true => Severity::Warning,
            false => Severity::Error,
        };
        let Difference { size, scale } = difference;
        let what = format!("{what}: `{name}` by up to {size:.1e}, where it is up to {scale:.1e}");
        self.find(what, severity, Some(name));
    }
}

/// Difference of an output between two runs.
#[derive(Debug, Clone, Copy)]
struct Difference {
    /// Largest difference.
    size: f64,
    /// Largest magnitude.
    scale: f64,
}

impl Difference {
    /// The difference of the `k`th output; `None` if all bits are the same.
    fn of(k: usize, first: &Trace, second: &Trace) -> Option<Self> {
        let mut pairs = first.iter().zip(second).map(|(a, b)| (a[k], b[k]));
        if pairs.clone().all(|(a, b)| a.to_bits() == b.to_bits()) {
            return None;
        }
        let size = |(a, b): (f64, f64)| match (a - b).abs() {
            // One of the two is not a number, or infinite.
            size if size.is_nan() => f64::INFINITY,
            size => size,
        };
        Some(Self {
            size: pairs.clone().map(size).fold(0.0, f64::max),
            scale: pairs
                .by_ref()
                .fold(0.0, |max, (a, b)| a.abs().max(b.abs()).max(max)),
        })
    }

    fn relative(self) -> f64 {
        match self.size == 0.0 {
            true => 0.0,
            false => self.size / self.scale,
        }
    }
}
