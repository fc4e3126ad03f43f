//! Bounds on outputs of the model.

/// Limits of an output, in its units: on the whole path, or at one end of each run.
///
/// Equal limits make it an equation, such as a rate that is zero at the start, or a state that the end must reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Lower limit; `-∞` for none.
    pub lower: f64,
    /// Upper limit; `∞` for none.
    pub upper: f64,
    /// Where they hold.
    pub at: BoundAt,
}

/// Samples of each run at which a [`Bound`] holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundAt {
    /// All of them.
    Samples,
    /// The first.
    Start,
    /// The last.
    End,
}

impl Bound {
    /// Limits at all samples.
    pub fn at_samples(lower: f64, upper: f64) -> Self {
        Self {
            lower,
            upper,
            at: BoundAt::Samples,
        }
    }

    /// Its limits at each of a run's samples, infinite where it does not hold.
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
