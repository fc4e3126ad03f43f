//! Recording of equations in generic Rust as an expression graph.

use super::graph::{Graph, Node};
use super::operation::{Function, Operator};
use num_dual::{DualNum, DualStruct, Mappable};
use num_traits::{FromPrimitive, Inv, Num, One, Signed, Zero};
use std::cell::RefCell;
use std::cmp::Ordering;
use std::fmt;
use std::iter::{Product, Sum};
use std::ops::{
    Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign,
};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

thread_local! {
    static RECORDING: RefCell<Option<Recording>> = const { RefCell::new(None) };
}

struct Recording {
    graph: Graph,
    obstacle: Option<Obstacle>,
    /// Number of accesses to values that are not constant.
    looks: usize,
}

/// Number of such accesses after which the equations may never end.
const MOST_LOOKS: usize = 1000;

/// Why equations cannot be recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Obstacle {
    /// They use the value of a number, for example for a branch.
    #[error(
        "the equations compare numbers: what they compute would hold on one side alone. Write it with abs(), \
         signum(), or as smooth functions"
    )]
    Comparison,
    /// They use a function that graphs do not support.
    #[error("the equations use a spherical Bessel function, which cannot be taken down")]
    Bessel,
}

/// A number that records the operations on it while [`trace`] runs.
#[derive(Debug, Clone, Copy)]
pub struct Traced(Node);

/// Runs equations on variables, numbered from 0, and records them. Returns the graph and the returned expressions.
///
/// # Errors
/// If the equations perform an operation that a graph cannot represent.
pub fn trace(
    variables: usize,
    equations: impl FnOnce(&[Traced]) -> Vec<Traced>,
) -> Result<(Graph, Vec<Node>), Obstacle> {
    let mut graph = Graph::default();
    let variables: Vec<Traced> = (0..variables).map(|k| Traced(graph.variable(k))).collect();
    let recording = Recording {
        graph,
        obstacle: None,
        looks: 0,
    };
    let before = RECORDING.replace(Some(recording));
    let restore = Restore(before);
    let found = catch_unwind(AssertUnwindSafe(|| equations(&variables)));
    let recording = RECORDING.take();
    drop(restore);
    let Recording {
        graph, obstacle, ..
    } = recording.expect("set above");
    match (obstacle, found) {
        // Equations that use values of numbers may panic or loop because of them.
        (Some(obstacle), _) => Err(obstacle),
        (None, Ok(found)) => Ok((graph, found.into_iter().map(|own| own.0).collect())),
        (None, Err(panic)) => resume_unwind(panic),
    }
}

/// Restores the previous recording, also after a panic of the equations.
struct Restore(Option<Recording>);

impl Drop for Restore {
    fn drop(&mut self) {
        RECORDING.set(self.0.take());
    }
}

fn record<T>(act: impl FnOnce(&mut Recording) -> T) -> T {
    RECORDING.with_borrow_mut(|recording| act(recording.as_mut().expect("inside `trace`")))
}

impl Traced {
    fn unary(self, function: Function) -> Self {
        Self(record(|own| own.graph.unary(function, self.0)))
    }

    fn binary(self, operator: Operator, other: Self) -> Self {
        Self(record(|own| own.graph.binary(operator, self.0, other.0)))
    }

    /// Its value if it is a constant; otherwise records an obstacle and returns NaN.
    fn known(self) -> f64 {
        let (value, looks) = record(|own| {
            let value = own.graph.value(self.0);
            if value.is_none() {
                own.obstacle.get_or_insert(Obstacle::Comparison);
                own.looks += 1;
            }
            (value.unwrap_or(f64::NAN), own.looks)
        });
        if looks > MOST_LOOKS {
            // Leaves a loop that waits for a value; without a message, since `trace` returns the obstacle.
            resume_unwind(Box::new("a loop on numbers"));
        }
        value
    }

    fn missing(self) -> Self {
        record(|own| own.obstacle = own.obstacle.or(Some(Obstacle::Bessel)));
        self
    }
}

impl From<f64> for Traced {
    fn from(value: f64) -> Self {
        Self(record(|own| own.graph.constant(value)))
    }
}

/// Implements an operator for two traced numbers, and for a traced number with a reference or an `f64`.
macro_rules! operator {
    ($name:ident $method:ident, $assign:ident $assign_method:ident, $operator:expr) => {
        impl $name for Traced {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.binary($operator, other)
            }
        }

        impl $name<&Self> for Traced {
            type Output = Self;
            fn $method(self, other: &Self) -> Self {
                self.binary($operator, *other)
            }
        }

        impl $name<f64> for Traced {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                self.binary($operator, other.into())
            }
        }

        impl $assign for Traced {
            fn $assign_method(&mut self, other: Self) {
                *self = self.binary($operator, other);
            }
        }

        impl $assign<f64> for Traced {
            fn $assign_method(&mut self, other: f64) {
                *self = self.binary($operator, other.into());
            }
        }
    };
}

operator!(Add add, AddAssign add_assign, Operator::Add);
operator!(Sub sub, SubAssign sub_assign, Operator::Subtract);
operator!(Mul mul, MulAssign mul_assign, Operator::Multiply);
operator!(Div div, DivAssign div_assign, Operator::Divide);
operator!(Rem rem, RemAssign rem_assign, Operator::Remainder);

impl Neg for Traced {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(Function::Negate)
    }
}

impl Inv for Traced {
    type Output = Self;
    fn inv(self) -> Self {
        self.unary(Function::Reciprocal)
    }
}

impl Zero for Traced {
    fn zero() -> Self {
        Self::from(0.0)
    }

    fn is_zero(&self) -> bool {
        self.known() == 0.0
    }
}

impl One for Traced {
    fn one() -> Self {
        Self::from(1.0)
    }
}

impl Num for Traced {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self::from)
    }
}

impl Signed for Traced {
    fn abs(&self) -> Self {
        self.unary(Function::Abs)
    }

    fn abs_sub(&self, other: &Self) -> Self {
        let difference = *self - *other;
        (difference + difference.abs()) * 0.5
    }

    fn signum(&self) -> Self {
        self.unary(Function::Sign)
    }

    fn is_positive(&self) -> bool {
        self.known() > 0.0
    }

    fn is_negative(&self) -> bool {
        self.known() < 0.0
    }
}

impl Sum for Traced {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::zero(), |sum, own| sum + own)
    }
}

impl<'a> Sum<&'a Self> for Traced {
    fn sum<I: Iterator<Item = &'a Self>>(all: I) -> Self {
        all.copied().sum()
    }
}

impl Product for Traced {
    fn product<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::one(), |product, own| product * own)
    }
}

impl<'a> Product<&'a Self> for Traced {
    fn product<I: Iterator<Item = &'a Self>>(all: I) -> Self {
        all.copied().product()
    }
}

impl PartialEq for Traced {
    fn eq(&self, other: &Self) -> bool {
        self.known() == other.known()
    }
}

impl PartialEq<f64> for Traced {
    fn eq(&self, other: &f64) -> bool {
        self.known() == *other
    }
}

impl PartialOrd for Traced {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.known().partial_cmp(&other.known())
    }
}

impl PartialOrd<f64> for Traced {
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.known().partial_cmp(other)
    }
}

impl FromPrimitive for Traced {
    fn from_i64(n: i64) -> Option<Self> {
        f64::from_i64(n).map(Self::from)
    }

    fn from_u64(n: u64) -> Option<Self> {
        f64::from_u64(n).map(Self::from)
    }

    fn from_f64(n: f64) -> Option<Self> {
        Some(Self::from(n))
    }
}

impl fmt::Display for Traced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {}", self.0.index())
    }
}

impl DualStruct for Traced {
    type Real = f64;
    type Inner = f64;

    fn re(&self) -> f64 {
        self.known()
    }

    fn from_inner(inner: &f64) -> Self {
        Self::from(*inner)
    }
}

impl Mappable<Self> for Traced {
    type Output<O> = O;

    fn map_dual<G: Fn(Self) -> O, O>(self, g: G) -> O {
        g(self)
    }
}

/// Implements functions that graphs support.
macro_rules! functions {
    ($($name:ident $function:ident),*) => {$(
        fn $name(&self) -> Self {
            self.unary(Function::$function)
        }
    )*};
}

impl DualNum for Traced {
    type Primitive = f64;
    const NDERIV: usize = 0;
    type InnerDual = f64;

    functions! {
        recip Reciprocal, sqrt Sqrt, cbrt Cbrt, exp Exp, exp_m1 ExpM1, ln Ln, ln_1p Ln1p, sin Sin, cos Cos,
        tan Tan, asin Asin, acos Acos, atan Atan, sinh Sinh, cosh Cosh, tanh Tanh, asinh Asinh, acosh Acosh,
        atanh Atanh
    }

    fn from_re(re: f64) -> Self {
        Self::from(re)
    }

    fn scale(self, factor: &f64) -> Self {
        self * *factor
    }

    fn powi(&self, n: i32) -> Self {
        self.powf(f64::from(n))
    }

    fn powf(&self, n: f64) -> Self {
        self.binary(Operator::Power, n.into())
    }

    fn powd(&self, exponent: Self) -> Self {
        self.binary(Operator::Power, exponent)
    }

    fn exp2(&self) -> Self {
        (*self * std::f64::consts::LN_2).exp()
    }

    fn log(&self, base: f64) -> Self {
        self.ln() / base.ln()
    }

    fn log2(&self) -> Self {
        self.ln() / std::f64::consts::LN_2
    }

    fn log10(&self) -> Self {
        self.ln() / std::f64::consts::LN_10
    }

    fn sin_cos(&self) -> (Self, Self) {
        (self.sin(), self.cos())
    }

    fn atan2(&self, other: Self) -> Self {
        self.binary(Operator::Atan2, other)
    }

    fn sph_j0(&self) -> Self {
        self.missing()
    }

    fn sph_j1(&self) -> Self {
        self.missing()
    }

    fn sph_j2(&self) -> Self {
        self.missing()
    }
}
