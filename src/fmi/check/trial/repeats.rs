//! What must happen again in the same way: after a reset, from a saved state, beside other instances.

use super::subject::Subject;
use super::{Stop, Teller};
use crate::fmi::fmu::Library;

/// Steps that are compared.
const STEPS: u32 = 4;

impl Teller<'_> {
    /// A reset leads back to the state after instantiation (FMI 2.0.5, section 2.1.6).
    pub(super) fn reset(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::start(library, "trial", self)?;
        self.stage("stepping");
        let first = subject.trace(STEPS, self)?;
        self.stage("resetting");
        subject.instance.reset()?;
        subject.initialize(self)?;
        self.stage("stepping after a reset");
        let second = subject.trace(STEPS, self)?;
        self.compare(
            &first,
            &second,
            "after fmi2Reset, the same simulation gives other outputs",
        );
        Ok(())
    }

    /// A saved state holds everything (FMI 2.0.5, section 2.1.8).
    pub(super) fn state(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::start(library, "trial", self)?;
        self.stage("stepping");
        subject.step(self)?;
        self.stage("saving the state");
        let point = subject.save()?;
        self.stage("stepping from a saved state");
        let first = subject.trace(STEPS, self)?;
        self.stage("going back to a saved state");
        subject.restore(&point)?;
        self.stage("stepping from a restored state");
        let second = subject.trace(STEPS, self)?;
        self.compare(
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
            self.compare(&first, &third, what);
        }
        self.stage("freeing the state");
        subject.instance.free(point.saved)?;
        Ok(())
    }

    /// Instances share nothing (canBeInstantiatedOnlyOncePerProcess="false").
    pub(super) fn instances(&mut self, library: &Library) -> Result<(), Stop> {
        let mut alone = Subject::start(library, "alone", self)?;
        self.stage("stepping");
        let first = alone.trace(STEPS, self)?;
        drop(alone);
        self.stage("making a second instance");
        let mut one = Subject::start(library, "one", self)?;
        let mut other = Subject::start(library, "other", self)?;
        self.stage("stepping two instances in turn");
        // The other one goes ahead by a step, so that a value that both share shows.
        other.trace(1, self)?;
        let mut second = Vec::new();
        for _ in 0..STEPS {
            second.extend(one.trace(1, self)?);
            other.trace(1, self)?;
        }
        let what = "beside another instance, the same simulation gives other outputs, though the \
                    FMU may be instantiated more than once in a process";
        self.compare(&first, &second, what);
        Ok(())
    }

    fn compare(&mut self, first: &[u64], second: &[u64], what: &str) {
        if first != second {
            self.error(what.to_owned());
        }
    }
}
