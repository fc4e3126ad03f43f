//! Operations of the nodes of a graph.

use super::graph::Node;
use super::opaque::Partial;
use num_dual::DualNum;

/// A node's operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Operation {
    /// The number with these bits.
    Constant(u64),
    /// The variable with this index.
    Variable(u32),
    /// A function of an expression.
    Unary(Function, Node),
    /// A binary operator applied to two expressions.
    Binary(Operator, Node, Node),
    /// The second expression if the first is not 0, else the third.
    Select(Node, Node, Node),
    /// The curve with this index, evaluated at an expression.
    Lookup(u32, Node),
    /// A value of the call with this index, or a derivative of it.
    Call(u32, Partial),
}

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "they are called as mathematics calls them")]
pub enum Function {
    Negate,
    Reciprocal,
    Sqrt,
    Cbrt,
    Exp,
    ExpM1,
    Ln,
    Ln1p,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Acosh,
    Atanh,
    Abs,
    /// 1 or -1 as in `f64::signum`: 1 at 0.
    Sign,
}

impl Function {
    /// The value of the function.
    pub fn of<T: DualNum<Primitive = f64> + Copy>(self, x: T) -> T {
        match self {
            Self::Negate => -x,
            Self::Reciprocal => x.recip(),
            Self::Sqrt => x.sqrt(),
            Self::Cbrt => x.cbrt(),
            Self::Exp => x.exp(),
            Self::ExpM1 => x.exp_m1(),
            Self::Ln => x.ln(),
            Self::Ln1p => x.ln_1p(),
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Sinh => x.sinh(),
            Self::Cosh => x.cosh(),
            Self::Tanh => x.tanh(),
            Self::Asinh => x.asinh(),
            Self::Acosh => x.acosh(),
            Self::Atanh => x.atanh(),
            Self::Abs => match x.re() < 0.0 {
                true => -x,
                false => x,
            },
            Self::Sign => T::from(x.re().signum()),
        }
    }
}

/// A binary operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "they are called as mathematics calls them")]
pub enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    /// The first to the power of the second.
    Power,
    /// The angle of the point with the first as ordinate and the second as abscissa.
    Atan2,
    /// The remainder of the first divided by the second, with the sign of the first.
    Remainder,
    /// 1 if the first is less than the second, else 0.
    Less,
    /// 1 if both are equal, else 0.
    Equal,
}

impl Operator {
    /// The value of the operator.
    pub fn of<T: DualNum<Primitive = f64> + Copy>(self, a: T, b: T) -> T {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Power => power(a, b),
            Self::Atan2 => a.atan2(b),
            Self::Remainder => a - b * T::from((a.re() / b.re()).trunc()),
            Self::Less => T::from(f64::from(a.re() < b.re())),
            Self::Equal => T::from(f64::from(a.re() == b.re())),
        }
    }
}

/// `aᵇ`. If `a` is not positive, only the derivatives with respect to `a` exist.
fn power<T: DualNum<Primitive = f64> + Copy>(a: T, b: T) -> T {
    match a.re() {
        positive if positive > 0.0 => a.powd(b),
        // The formulas for dual numbers would divide by 0.
        0.0 if b.re() > 1.0 => T::from(0.0),
        _ => a.powf(b.re()),
    }
}
