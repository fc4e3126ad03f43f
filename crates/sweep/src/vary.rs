//! What is varied.

use crate::SweepError;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// A parameter or input, with the values that it takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Vary {
    /// `instance.variable`.
    pub name: String,
    /// Its values.
    pub law: Law,
}

/// Values of one variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// These values.
    List(Vec<f64>),
    /// Evenly between two.
    Uniform(f64, f64),
    /// With an evenly distributed logarithm between two.
    LogUniform(f64, f64),
    /// Mean and standard deviation.
    Normal(f64, f64),
    /// Median, and standard deviation of the logarithm.
    LogNormal(f64, f64),
    /// Least, most likely and largest value.
    Triangular(f64, f64, f64),
}

/// Parameters of a fit, with the covariance that it left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// `instance.variable` of each.
    pub names: Vec<String>,
    /// Their values.
    pub mean: Vec<f64>,
    /// A matrix whose product with its transpose is their covariance, row by row.
    pub root: Vec<Vec<f64>>,
}

/// Largest number of values of a list.
const MOST: usize = 1_000_000;

impl Vary {
    /// Reads `NAME=LOW:HIGH:COUNT`, `NAME=VALUE,VALUE...` or `NAME~law(numbers)`.
    ///
    /// # Errors
    /// When it is none of these, or a law's numbers make none.
    pub fn parse(given: &str) -> Result<Self, SweepError> {
        let fault = |words: &str| SweepError::Vary {
            given: given.to_owned(),
            words: words.to_owned(),
        };
        let (name, law) = if let Some((name, law)) = given.split_once('~') {
            (name, Law::parse(law.trim()).map_err(|words| fault(&words))?)
        } else if let Some((name, list)) = given.split_once('=') {
            (name, list_of(list.trim()).map_err(|words| fault(&words))?)
        } else {
            return Err(fault(
                "expected NAME=LOW:HIGH:COUNT, NAME=VALUE,VALUE or NAME~normal(mean, sd)",
            ));
        };
        match name.trim() {
            "" => Err(fault("there is no name before the values")),
            name => Ok(Self {
                name: name.to_owned(),
                law,
            }),
        }
    }
}

fn number(text: &str) -> Result<f64, String> {
    let value = text.trim().parse().ok();
    let value = value.filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("`{}` is no finite number", text.trim()))
}

fn list_of(text: &str) -> Result<Law, String> {
    let parts: Vec<&str> = text.split(':').collect();
    let [low, high, count] = parts[..] else {
        return text
            .split(',')
            .map(number)
            .collect::<Result<_, _>>()
            .map(Law::List);
    };
    let (low, high) = (number(low)?, number(high)?);
    let count: usize = count
        .trim()
        .parse()
        .map_err(|_| format!("`{count}` is no count"))?;
    match count {
        0 => Err("0 values are none".to_owned()),
        1 => Ok(Law::List(vec![low])),
        count if count > MOST => Err(format!("at most {MOST} values")),
        count => {
            let at = |k: usize| low + (high - low) * (k as f64 / (count - 1) as f64);
            Ok(Law::List((0..count).map(at).collect()))
        }
    }
}

impl Law {
    fn parse(text: &str) -> Result<Self, String> {
        const KNOWN: &str = "uniform(low, high), loguniform(low, high), normal(mean, sd), lognormal(median, sd of the logarithm), \
                             triangular(low, likely, high)";
        let inner = text
            .split_once('(')
            .and_then(|(name, rest)| Some((name.trim(), rest.strip_suffix(')')?)));
        let (name, numbers) =
            inner.ok_or_else(|| format!("`{text}` is no distribution; there are {KNOWN}"))?;
        let numbers: Vec<f64> = numbers.split(',').map(number).collect::<Result<_, _>>()?;
        let wrong = |words: &str| Err(format!("{name}: {words}"));
        match (name, &numbers[..]) {
            ("uniform", [a, b]) if a < b => Ok(Self::Uniform(*a, *b)),
            ("uniform", [..]) => wrong("expected two numbers, the second larger"),
            ("loguniform", [a, b]) if 0.0 < *a && a < b => Ok(Self::LogUniform(*a, *b)),
            ("loguniform", [..]) => wrong("expected two numbers above 0, the second larger"),
            ("normal", [m, s]) if *s > 0.0 => Ok(Self::Normal(*m, *s)),
            ("normal", [..]) => wrong("expected a mean and a standard deviation above 0"),
            ("lognormal", [m, s]) if *m > 0.0 && *s > 0.0 => Ok(Self::LogNormal(*m, *s)),
            ("lognormal", [..]) => {
                wrong("expected a median and a standard deviation of the logarithm, both above 0")
            }
            ("triangular", [a, c, b]) if a <= c && c <= b && a < b => {
                Ok(Self::Triangular(*a, *c, *b))
            }
            ("triangular", [..]) => wrong("expected three numbers, ascending"),
            _ => Err(format!("`{name}` is no distribution; there are {KNOWN}")),
        }
    }

    /// The values, if it is a list.
    pub fn list(&self) -> Option<&[f64]> {
        match self {
            Self::List(values) => Some(values),
            _ => None,
        }
    }

    /// The value below which a part `p` of them lies, `0 < p < 1`. Of a list each value has the same part.
    pub fn quantile(&self, p: f64) -> f64 {
        match self {
            Self::List(values) => {
                let last = values.len() - 1;
                values[((p * values.len() as f64) as usize).min(last)]
            }
            Self::Uniform(a, b) => a + p * (b - a),
            Self::LogUniform(a, b) => (a.ln() + p * (b / a).ln()).exp(),
            Self::Normal(m, s) => m + s * standard_normal(p),
            Self::LogNormal(m, s) => m * (s * standard_normal(p)).exp(),
            Self::Triangular(a, c, b) => match p * (b - a) <= c - a {
                true => a + (p * (b - a) * (c - a)).sqrt(),
                false => b - ((1.0 - p) * (b - a) * (b - c)).sqrt(),
            },
        }
    }
}

/// Quantile of the standard normal distribution.
pub fn standard_normal(p: f64) -> f64 {
    Normal::standard().inverse_cdf(p)
}

impl Joint {
    /// The values that these standard normal numbers stand for.
    pub fn values(&self, normal: &[f64]) -> Vec<f64> {
        let row = |row: &Vec<f64>| row.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>();
        self.mean
            .iter()
            .zip(&self.root)
            .map(|(mean, own)| mean + row(own))
            .collect()
    }
}
