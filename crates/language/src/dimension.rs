//! Units of expressions, for the check of equations.

use pilotage_text::number::rounded;
use pilotage_units::Base;

/// Maximum number of constants whose products may convert one unit to another.
const MOST_NUMBERS: usize = 8;

/// Relative tolerance of conversion factors, which are often written with few digits.
const CLOSE: f64 = 2e-3;

/// The unit of the value of an expression.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Dimension {
    /// The expression contains a variable without unit.
    Unchecked,
    /// A number with its value; it takes any unit.
    Number(f64),
    /// A quantity with a unit.
    Of(Quantity),
}

/// The unit of a quantity.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quantity {
    /// Exponents of the base units, except the radian.
    exponents: [f64; 7],
    /// Factor to the base units.
    factor: f64,
    /// Offset to the base units, for temperatures in degrees.
    offset: f64,
    /// Numbers by which the quantity was multiplied; they may have converted it to another unit.
    numbers: Vec<f64>,
    /// Name of the unit, if it was declared.
    name: Option<String>,
}

impl Quantity {
    /// The unit of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let name = name.trim();
        Some(Self {
            name: Some(name.to_owned()),
            ..Self::of(&Base::of(name)?)
        })
    }

    /// The quantity of a unit.
    pub(crate) fn of(base: &Base) -> Self {
        Self {
            exponents: std::array::from_fn(|k| f64::from(base.exponents[k])),
            factor: base.factor,
            offset: base.offset,
            numbers: Vec::new(),
            name: None,
        }
    }

    /// The dimensionless quantity.
    pub(crate) fn one() -> Self {
        Self::of(&Base::default())
    }

    /// Seconds.
    pub(crate) fn second() -> Self {
        Self::of(&Base::of("s").unwrap_or_default())
    }

    /// Product with another quantity to the power 1 or -1.
    pub(crate) fn times(&self, other: &Self, power: f64) -> Result<Self, String> {
        self.absolute()?;
        other.absolute()?;
        let mut product = self.clone();
        for (exponent, by) in product.exponents.iter_mut().zip(other.exponents) {
            *exponent += power * by;
        }
        product.factor *= other.factor.powf(power);
        let numbers = other.numbers.iter().map(|number| number.powf(power));
        product.numbers.extend(numbers);
        product.numbers.truncate(MOST_NUMBERS);
        product.name = None;
        Ok(product)
    }

    /// Product with a number, which may convert the unit.
    pub(crate) fn scaled(&self, number: f64) -> Result<Self, String> {
        let mut scaled = self.clone();
        if number < 0.0 && self.offset != 0.0 {
            return Err(format!(
                "a temperature in {} has a minus sign; write it in K, or take it from another one",
                self.shown()
            ));
        }
        if number.abs() != 1.0 && !number.is_nan() {
            self.absolute()?;
            scaled.name = None;
            scaled.numbers.push(number.abs());
            scaled.numbers.truncate(MOST_NUMBERS);
        }
        Ok(scaled)
    }

    /// Power of the quantity.
    pub(crate) fn power(&self, power: f64) -> Result<Self, String> {
        self.absolute()?;
        Ok(Self {
            exponents: self.exponents.map(|exponent| exponent * power),
            factor: self.factor.powf(power),
            offset: 0.0,
            numbers: (self.numbers.iter())
                .map(|number| number.powf(power))
                .collect(),
            name: None,
        })
    }

    /// Checks that the quantity is dimensionless, with a factor of 1 after conversion by the numbers.
    pub(crate) fn check_plain(&self) -> Result<(), String> {
        self.check_same(&Self::one())
    }

    /// Rejects a different unit.
    pub(crate) fn check_same(&self, other: &Self) -> Result<(), String> {
        self.check_scale(other)?;
        match (self.offset - other.offset).abs() > 1e-9 {
            true => Err(format!(
                "{} and {} count from different zeros",
                self.shown(),
                other.shown()
            )),
            false => Ok(()),
        }
    }

    /// Rejects a unit whose differences do not equal those of the other one.
    fn check_scale(&self, other: &Self) -> Result<(), String> {
        let (left, right) = (self.shown(), other.shown());
        let mut exponents = self.exponents.iter().zip(&other.exponents);
        if exponents.any(|(a, b)| (a - b).abs() > 1e-9) {
            return Err(format!("{left} is not {right}"));
        }
        // The factor from this unit to the other.
        let ratio = self.factor / other.factor;
        if (ratio - 1.0).abs() <= 1e-9 {
            return Ok(());
        }
        if self.offset != 0.0 || other.offset != 0.0 {
            return Err(format!(
                "{left} and {right} differ in their zeros and their steps; use one unit for both"
            ));
        }
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < CLOSE;
        let conversions: Vec<f64> = (self.products().into_iter())
            .flat_map(|own| (other.products().into_iter()).map(move |theirs| own / theirs))
            .collect();
        // The radian counts as 1, so that a frequency may be given in turns or in radians per second.
        let turn = std::f64::consts::TAU;
        let turns: &[f64] = match self.is_rate() {
            true => &[1.0, turn, 1.0 / turn],
            false => &[1.0],
        };
        let fits = |number: &f64| turns.iter().any(|turns| close(number * turns, ratio));
        let is_inverse = |number: &f64| !self.is_rate() && close(*number, 1.0 / ratio);
        let is_converted = conversions.iter().any(fits);
        let is_reversed = conversions.iter().any(is_inverse) && !close(ratio, 1.0);
        match (is_converted, is_reversed) {
            (true, false) => Ok(()),
            (false, false) => {
                // A hertz is a turn per second, though its base unit is that of rad/s.
                let is_hertz = |name: &str| name.contains("Hz");
                let ratio = match (is_hertz(&left), is_hertz(&right)) {
                    (true, false) if self.is_rate() => ratio * turn,
                    (false, true) if self.is_rate() => ratio / turn,
                    _ => ratio,
                };
                Err(format!(
                    "{left} is {ratio} times {right}; multiply by {}, or use one unit for both",
                    Conversion(ratio),
                ))
            }
            (_, true) => Err(format!(
                "{left} is {ratio} times {right}, and {} converts the other way; multiply by {} in its place, or use one \
                 unit for both",
                Conversion(1.0 / ratio),
                Conversion(ratio)
            )),
        }
    }

    /// Sum or difference of quantities with the same unit; differences of temperatures in degrees are in kelvin.
    pub(crate) fn sum(&self, other: &Self, sign: f64) -> Result<Self, String> {
        self.check_scale(other)?;
        let both = self.offset != 0.0 && other.offset != 0.0;
        if both && sign > 0.0 {
            return Err(format!(
                "two temperatures in {} are added; write them in K, or add a difference of temperatures",
                self.shown()
            ));
        }
        if self.offset == 0.0 && other.offset != 0.0 && sign < 0.0 {
            return Err(format!(
                "a temperature in {} is taken from one in {}",
                other.shown(),
                self.shown()
            ));
        }
        let mut sum = self.clone();
        sum.offset = match both {
            true => 0.0,
            false => self.offset + other.offset,
        };
        if sum.offset != self.offset {
            sum.name = None;
        }
        Ok(sum)
    }

    /// True if the dimension is a power of 1/s.
    fn is_rate(&self) -> bool {
        let mut others = self.exponents.iter().enumerate();
        others.all(|(k, exponent)| (k == 2) == (*exponent != 0.0))
    }

    /// A temperature plus a number: 273.15 converts between K and degC.
    pub(crate) fn shifted(&self, number: f64) -> Self {
        let mut shifted = self.clone();
        let is_temperature = *self == Self::of(&Base::of("K").unwrap_or_default())
            || self.name.as_deref() == Some("K")
            || self.name.as_deref() == Some("degC");
        let offset = self.offset - number;
        let is_zero = |offset: f64| {
            [0.0, 273.15]
                .iter()
                .any(|zero| (offset - zero).abs() < 1e-9)
        };
        if is_temperature && number != 0.0 && is_zero(offset) {
            shifted.offset = if offset.abs() < 1e-9 { 0.0 } else { 273.15 };
            shifted.name = None;
        }
        shifted
    }

    /// Products of all subsets of the numbers.
    fn products(&self) -> Vec<f64> {
        let mut products = vec![1.0];
        for number in &self.numbers {
            for k in 0..products.len() {
                products.push(products[k] * number);
            }
        }
        products
    }

    /// Rejects a temperature in degrees, which is meaningless in a product.
    fn absolute(&self) -> Result<(), String> {
        match self.offset == 0.0 {
            true => Ok(()),
            false => Err(format!(
                "a temperature in {} stands in a product; write it in K",
                self.shown()
            )),
        }
    }

    /// A hint on how to make a quantity dimensionless.
    pub(crate) fn plain_hint(&self) -> Option<String> {
        let second = Self::second();
        if self.exponents == second.exponents && self.factor == second.factor {
            return Some(
                "; multiply it by a parameter in rad/s, or divide it by one in s".to_owned(),
            );
        }
        let has_dimension = self.exponents.iter().any(|exponent| *exponent != 0.0);
        has_dimension.then(|| format!("; divide it by a parameter in {}", self.shown()))
    }

    /// Description as part of a sentence.
    pub(crate) fn in_words(&self) -> String {
        format!("what is in {}", self.shown())
    }

    /// Representation in messages: base units with their factor.
    pub(crate) fn shown(&self) -> String {
        if let Some(name) = &self.name {
            return match name.as_str() {
                "1" => "a number without a unit".to_owned(),
                name => name.to_owned(),
            };
        }
        const SYMBOLS: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];
        let with = |sign: f64| -> Vec<String> {
            let all = SYMBOLS.iter().zip(self.exponents);
            let those = all.filter(|(_, exponent)| exponent * sign > 1e-9);
            those
                .map(
                    |(symbol, exponent)| match (exponent.abs() - 1.0).abs() < 1e-9 {
                        true => (*symbol).to_owned(),
                        false => format!("{symbol}{}", exponent.abs()),
                    },
                )
                .collect()
        };
        let (above, below) = (with(1.0), with(-1.0));
        let above = match above.is_empty() {
            true => "1".to_owned(),
            false => above.join("."),
        };
        let name = match &below[..] {
            [] if above == "1" && (self.factor - 1.0).abs() < 1e-12 => {
                return "a number without a unit".to_owned();
            }
            [] => above,
            [one] => format!("{above}/{one}"),
            several => format!("{above}/({})", several.join(".")),
        };
        match ((self.factor - 1.0).abs() < 1e-12, self.offset != 0.0) {
            (_, true) => "degC or degF".to_owned(),
            (true, _) => name,
            (false, _) => format!("{} {name}", Conversion(self.factor)),
        }
    }
}

/// A factor, shown with at most six digits.
struct Conversion(f64);

impl std::fmt::Display for Conversion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rounded = rounded(self.0, 6);
        match (1e-4..1e6).contains(&rounded.abs()) {
            true => write!(f, "{rounded}"),
            false => write!(f, "{rounded:e}"),
        }
    }
}
