//! The built-in models as texts in the language of `docs/models.md`. This module does not parse them.

use pilotage_units::power;
use std::fmt::Write;

/// Purpose of a built-in model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Moves the stick: inputs `target` and `position`, output `stick`.
    Pilot,
    /// Is moved by the stick: input `stick`, with a position among the outputs.
    Vehicle,
    /// Is steered by an optimiser, for `pilotage hv`: inputs `cz` and `alpha`.
    Helicopter,
}

/// A built-in model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuiltIn {
    /// Name.
    pub name: &'static str,
    /// Purpose.
    pub kind: Kind,
    /// The model file; if the model has an order, the file for order 3.
    pub text: &'static str,
    /// Whether the model has an order; [`linear`] then writes its file.
    pub has_order: bool,
}

impl BuiltIn {
    /// One-line description: the `description` of the model file.
    pub fn about(&self) -> &'static str {
        let value = |line: &'static str| line.strip_prefix("description = \"")?.strip_suffix('"');
        self.text.lines().find_map(value).unwrap_or_default()
    }
}

macro_rules! model {
    ($kind:ident, $name:literal) => {
        BuiltIn {
            name: $name,
            kind: Kind::$kind,
            text: include_str!(concat!("../library/", $name, ".toml")),
            has_order: false,
        }
    };
}

const ALL: &[BuiltIn] = &[
    model!(Pilot, "tustin"),
    model!(Pilot, "crossover"),
    model!(Pilot, "lead_lag"),
    model!(Pilot, "precision"),
    model!(Pilot, "extended_crossover"),
    model!(Pilot, "hess"),
    BuiltIn {
        has_order: true,
        ..model!(Pilot, "linear")
    },
    model!(Pilot, "dead_zone"),
    model!(Pilot, "rate_limit"),
    model!(Pilot, "crossover2"),
    model!(Vehicle, "quadcopter"),
    model!(Vehicle, "gain"),
    model!(Vehicle, "integrator"),
    model!(Vehicle, "double_integrator"),
    model!(Vehicle, "lag_integrator"),
    model!(Vehicle, "short_period"),
    model!(Vehicle, "hover"),
    model!(Helicopter, "helicopter"),
];

/// The built-in models: pilots, then vehicles.
pub fn all() -> &'static [BuiltIn] {
    ALL
}

/// The built-in model with that name.
pub fn find(name: &str) -> Option<&'static BuiltIn> {
    ALL.iter().find(|model| model.name == name)
}

/// Highest order of [`linear`].
pub const MAX_ORDER: usize = crate::Model::MAX_ORDER;

/// Static gain of [`linear`]'s start values [1/m].
const GAIN: f64 = 0.1;

/// The model file of the linear pilot of that order, see [`crate::pilot`]. The start values are `order` equal lags,
/// half a second in total, with a static gain of 0.1 1/m.
///
/// # Panics
/// When the order is not from 1 to [`MAX_ORDER`].
pub fn linear(order: usize) -> String {
    assert!(
        (1..=MAX_ORDER).contains(&order),
        "order {order} of the linear pilot is not from 1 to {MAX_ORDER}"
    );
    let mut text = HEAD.replace("ORDER", &order.to_string());
    // Writing to a String cannot fail.
    for i in 0..2 * order {
        let _ = writeln!(text, "{}", parameter(order, i));
    }
    text += LIMIT;
    for i in 0..order {
        let _ = writeln!(text, "{}", state(order, i));
    }
    text + OUTPUTS
}

const HEAD: &str = r#"# The linear pilot of order ORDER in observable canonical form; theta are the coefficients of stick / error, first
# those of the denominator, from s^0 up, then those of the numerator. The first state is the stick: where that is about
# known the equations are about linear in theta, so that a fit takes few steps.
[model]
name = "linear"
description = "Linear pilot of any order: all coefficients of its transfer function are free"
source = "Bonner & Kirchner, Human as an Actuator Dynamic Model Identification, IEEE Aerospace Conference, 2026"

[inputs]
target = { unit = "m", description = "Position to go to" }
position = { unit = "m", description = "Position of the vehicle" }

[parameters]
"#;

const LIMIT: &str = r#"stick_limit = { start = 1, unit = "1", min = 0, tunable = false, description = "Largest magnitude of the stick" }

[states]
"#;

/// θ_{i+1}, with the units that [`crate::pilot`] derives.
fn parameter(n: usize, i: usize) -> String {
    let (unit, start, part) = match i < n {
        true => (format!("1/{}", power("s", n - i)), lag(n, i), "denominator"),
        false => {
            let gain = if i == n { lag(n, 0) * GAIN } else { 0.0 };
            (
                format!("1/(m.{})", power("s", 2 * n - i)),
                gain,
                "numerator",
            )
        }
    };
    format!(
        r#"theta{} = {{ start = {start}, unit = "{unit}", tunable = true, description = "Coefficient of the {part} at s^{}" }}"#,
        i + 1,
        i % n
    )
}

/// Coefficient of `s^i` in `(s + 2n)^n`.
fn lag(n: usize, i: usize) -> f64 {
    let binomial = (0..i).fold(1, |value, k| value * (n - k) / (k + 1));
    binomial as f64 * (2.0 * n as f64).powi((n - i) as i32)
}

/// State `x_{i+1}`: the stick, and what is behind it.
fn state(n: usize, i: usize) -> String {
    let next = match i + 1 == n {
        true => String::new(),
        false => format!("x{} + ", i + 2),
    };
    let unit = match i {
        0 => "1".to_owned(),
        _ => format!("1/{}", power("s", i)),
    };
    format!(
        r#"x{} = {{ unit = "{unit}", der = "{next}theta{} * error - theta{} * x1", description = "State x_{} of the pilot" }}"#,
        i + 1,
        2 * n - i,
        n - i,
        i + 1
    )
}

const OUTPUTS: &str = r#"
[outputs]
stick = { unit = "1", value = "x1", limit = ["-stick_limit", "stick_limit"], description = "Stick" }
error = { unit = "m", value = "target - position", description = "Error that the pilot sees, target minus position" }
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_the_linear_pilot_is_that_of_order_3() {
        assert_eq!(linear(3), find("linear").unwrap().text);
    }

    #[test]
    fn each_file_is_called_as_its_model_and_says_what_it_is_in_a_line() {
        for model in all() {
            let name = format!("\nname = \"{}\"\n", model.name);
            assert!(model.text.contains(&name), "{}", model.name);
            assert!(model.text.contains("\nsource = \""), "{}", model.name);
            assert!(model.about().len() > 20, "{}", model.name);
            assert_eq!(find(model.name), Some(model));
        }
        assert_eq!(find("linaer"), None);
        let files = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/library")).unwrap();
        assert_eq!(files.count(), all().len(), "each file is a model");
    }

    /// `(s + 2n)^n` at s = 1, and at s = 0.
    #[test]
    fn the_start_values_are_equal_lags() {
        for n in 1..=MAX_ORDER {
            let sum: f64 = (0..n).map(|i| lag(n, i)).sum::<f64>() + 1.0;
            let expected = (2.0 * n as f64 + 1.0).powi(n as i32);
            assert!((sum / expected - 1.0).abs() < 1e-14, "order {n}");
            assert_eq!(lag(n, 0), (2.0 * n as f64).powi(n as i32));
        }
    }

    #[test]
    #[should_panic(expected = "order 13 of the linear pilot is not from 1 to 12")]
    fn the_order_has_an_end() {
        linear(13);
    }
}
