//! Bounds on outputs of the model.

/// Limits of an output in its units, along the whole path or at one end of each run.
///
/// Equal limits give an equation, for example a rate that is zero at the start, or a prescribed final state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Lower limit; `-∞` if there is none.
    pub lower: f64,
    /// Upper limit; `∞` if there is none.
    pub upper: f64,
    /// Samples at which the limits hold.
    pub at: BoundAt,
    /// Magnitude of the output, by which it is divided: the solver's tolerances are relative to it. A power of two rounds
    /// nothing.
    pub size: f64,
}

/// Samples of each run at which a [`Bound`] holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundAt {
    /// At all samples.
    Samples,
    /// At the first sample.
    Start,
    /// At the last sample.
    End,
}

impl Bound {
    /// Limits at all samples of an output of the order of one.
    pub fn at_samples(lower: f64, upper: f64) -> Self {
        Self {
            lower,
            upper,
            at: BoundAt::Samples,
            size: 1.0,
        }
    }

    /// The limits at each sample of a run, infinite where they do not apply.
    pub(super) fn limits(&self, samples: usize) -> impl Iterator<Item = (f64, f64)> {
        let own = *self;
        (0..samples).map(move |k| match own.holds_at(k, samples) {
            true => (own.lower, own.upper),
            false => (f64::NEG_INFINITY, f64::INFINITY),
        })
    }

    fn holds_at(&self, sample: usize, samples: usize) -> bool {
        match self.at {
            BoundAt::Samples => true,
            BoundAt::Start => sample == 0,
            BoundAt::End => sample + 1 == samples,
        }
    }
}
