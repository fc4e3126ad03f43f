//! Opaque functions, such as those of an FMU, which are not expressions: they map numbers to values and derivatives.

use super::graph::Node;
use std::fmt;
use std::sync::Arc;

/// A vector-valued function with first and second derivatives that is used in expressions without being one.
pub trait Opaque: fmt::Debug + Send + Sync {
    /// A neutral value for each argument, used if nothing requested depends on it.
    fn neutral(&self) -> &[f64];

    /// True if a value or a derivative is not zero everywhere.
    fn depends(&self, partial: Partial) -> bool;

    /// Writes values and derivatives at a point; NaN if they are undefined.
    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]);

    /// Why the last point had no values, if it had none.
    fn trouble(&self) -> Option<String> {
        None
    }
}

/// A value of an [`Opaque`] function, or a first or second derivative of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Partial {
    /// Index of the value.
    pub value: u32,
    /// Indices of the arguments with respect to which it is differentiated, in ascending order.
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

    /// Its derivative with respect to an argument; `None` beyond the second derivative.
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

    /// Indices of the arguments with respect to which it is differentiated.
    pub fn arguments(self) -> impl Iterator<Item = usize> {
        self.by.into_iter().flatten().map(|own| own as usize)
    }
}

/// An opaque function with its arguments.
#[derive(Debug, Clone)]
pub struct Call {
    /// The function.
    pub function: Arc<dyn Opaque>,
    /// The node of each argument; `None` if nothing depends on it.
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

    /// The arguments on which a value, and so each of its derivatives, depends: indices and nodes.
    ///
    /// # Panics
    /// If one of them has no node.
    pub fn taken(&self, partial: Partial) -> impl Iterator<Item = (usize, Node)> {
        let value = Partial::of(partial.value as usize);
        let all = self.arguments.iter().enumerate();
        all.filter_map(move |(place, node)| {
            let depends = self.function.depends(value.by(place)?);
            depends.then(|| (place, node.expect("an argument that the value depends on")))
        })
    }

    /// Values and derivatives, given the values of the argument nodes.
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

    /// Values and derivatives, given the values of some arguments by index.
    pub(super) fn evaluate_at(&self, wanted: &[Partial], point: &[(usize, f64)], out: &mut [f64]) {
        let mut at = self.function.neutral().to_vec();
        point.iter().for_each(|(place, value)| at[*place] = *value);
        self.function.evaluate(&at, wanted, out);
    }

    /// A single value or derivative.
    pub(super) fn at(&self, point: &[(usize, f64)], partial: Partial) -> f64 {
        if !self.function.depends(partial) {
            return 0.0;
        }
        let mut out = [0.0];
        self.evaluate_at(&[partial], point, &mut out);
        out[0]
    }
}
