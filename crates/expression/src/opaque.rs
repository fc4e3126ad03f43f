//! Functions that are no expressions, such as those of an FMU: numbers in, numbers and their derivatives out.

use super::graph::Node;
use std::fmt;
use std::sync::Arc;

/// Values of some numbers, with first and second derivatives, that an expression takes as they are.
pub trait Opaque: fmt::Debug + Send + Sync {
    /// For each argument what stands for it where nothing wanted depends on it.
    fn neutral(&self) -> &[f64];

    /// Whether a value or a derivative can be other than zero, at any point.
    fn depends(&self, partial: Partial) -> bool;

    /// Writes values and derivatives at a point; NaN where there are none.
    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]);

    /// Why the last point had no values, if any had none.
    fn trouble(&self) -> Option<String> {
        None
    }
}

/// A value of an [`Opaque`] function, or a first or second derivative of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Partial {
    /// Number of the value.
    pub value: u32,
    /// Numbers of the arguments by which it is differentiated, the lower one first.
    by: [Option<u32>; 2],
}

impl Partial {
    /// A value.
    pub fn of(value: usize) -> Self {
        Self {
            value: value as u32,
            by: [None; 2],
        }
    }

    /// Its derivative by an argument; `None` beyond the second.
    #[must_use]
    pub fn by(self, argument: usize) -> Option<Self> {
        let other = argument as u32;
        let by = match self.by {
            [None, _] => [Some(other), None],
            [Some(first), None] => [Some(first.min(other)), Some(first.max(other))],
            _ => return None,
        };
        Some(Self { by, ..self })
    }

    /// The arguments by which it is differentiated.
    pub fn arguments(self) -> impl Iterator<Item = usize> {
        self.by.into_iter().flatten().map(|own| own as usize)
    }
}

/// A function with what it is given.
#[derive(Debug, Clone)]
pub struct Call {
    /// The function.
    pub function: Arc<dyn Opaque>,
    /// For each argument its node; `None` where nothing depends on it.
    pub arguments: Vec<Option<Node>>,
}

impl PartialEq for Call {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.function, &other.function) && self.arguments == other.arguments
    }
}

impl Call {
    pub(super) fn new(function: &Arc<dyn Opaque>, arguments: &[Option<Node>]) -> Self {
        Self {
            function: function.clone(),
            arguments: arguments.to_vec(),
        }
    }

    /// The arguments that a value, and so each of its derivatives, depends on: places and nodes.
    ///
    /// # Panics
    /// Where one of them has no node.
    pub fn taken(&self, partial: Partial) -> impl Iterator<Item = (usize, Node)> {
        let value = Partial::of(partial.value as usize);
        let all = self.arguments.iter().enumerate();
        all.filter_map(move |(place, node)| {
            let depends = self.function.depends(value.by(place)?);
            depends.then(|| (place, node.expect("an argument that the value depends on")))
        })
    }

    /// Values and derivatives where each argument that they depend on has the value of its node.
    pub(super) fn evaluate(
        &self,
        wanted: &[Partial],
        value: impl Fn(Node) -> f64,
        out: &mut [f64],
    ) {
        let taken = wanted.iter().flat_map(|partial| self.taken(*partial));
        let point: Vec<(usize, f64)> = taken.map(|(place, node)| (place, value(node))).collect();
        self.evaluate_at(wanted, &point, out);
    }

    /// The same where some arguments have these values.
    pub(super) fn evaluate_at(&self, wanted: &[Partial], point: &[(usize, f64)], out: &mut [f64]) {
        let mut at = self.function.neutral().to_vec();
        point.iter().for_each(|(place, value)| at[*place] = *value);
        self.function.evaluate(&at, wanted, out);
    }

    /// One of them.
    pub(super) fn at(&self, point: &[(usize, f64)], partial: Partial) -> f64 {
        if !self.function.depends(partial) {
            return 0.0;
        }
        let mut out = [0.0];
        self.evaluate_at(&[partial], point, &mut out);
        out[0]
    }
}
