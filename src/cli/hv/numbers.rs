//! Numbers in the arguments: lists of speeds and heights, delays, parameters and points.

use crate::cli::number;

/// A list of numbers as one argument.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbers(pub Vec<f64>);

/// When the pilot reacts \[s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delay {
    /// After the same time everywhere.
    Everywhere(f64),
    /// After one time below the height of the knee, and another above it.
    ByKnee([f64; 2]),
}

/// A parameter with all its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    pub name: String,
    pub values: Vec<f64>,
}

/// Most speeds, and most heights.
const MOST: usize = 500;

fn split(text: &str, by: char) -> Result<Vec<f64>, String> {
    let number = |part: &str| {
        let value = part.trim().parse().ok();
        value.filter(|value: &f64| value.is_finite())
    };
    let all: Option<Vec<f64>> = text.split(by).map(number).collect();
    all.ok_or_else(|| format!("expected numbers with `{by}` between them"))
}

/// `FIRST:LAST:STEP`, or one.
pub fn speeds(text: &str) -> Result<Numbers, String> {
    match split(text, ':')?[..] {
        [first, last, step] if first >= 0.0 && last >= first && step > 0.0 => {
            let count = ((last - first) / step + 1e-9) as usize;
            match count < MOST {
                true => Ok(Numbers(
                    (0..=count).map(|k| first + step * k as f64).collect(),
                )),
                false => Err(format!("at most {MOST} speeds")),
            }
        }
        [only] if only >= 0.0 => Ok(Numbers(vec![only])),
        _ => Err("expected FIRST:LAST:STEP, from 0 up".to_owned()),
    }
}

/// `LOW:HIGH[:COUNT]`, at equal ratios, or one.
pub fn heights(text: &str) -> Result<Numbers, String> {
    let numbers = split(text, ':')?;
    let (low, high, count) = match numbers[..] {
        [only] if only > 0.0 => return Ok(Numbers(vec![only])),
        [low, high] => (low, high, 24.0),
        [low, high, count] => (low, high, count),
        _ => return Err("expected LOW:HIGH or LOW:HIGH:COUNT".to_owned()),
    };
    if !(low > 0.0 && high > low && count >= 2.0 && count <= MOST as f64 && count.fract() == 0.0) {
        return Err(format!(
            "expected 0 < LOW < HIGH, and a COUNT from 2 to {MOST}"
        ));
    }
    let ratio = |k: usize| (high / low).powf(k as f64 / (count - 1.0));
    Ok(Numbers(
        (0..count as usize).map(|k| low * ratio(k)).collect(),
    ))
}

/// `SECONDS`, or `BELOW/ABOVE`.
pub fn delay(text: &str) -> Result<Delay, String> {
    let one = |text: &str| {
        let value = number::number(text.trim())?;
        match value >= 0.0 && value.is_finite() {
            true => Ok(value),
            false => Err("expected a finite number, 0 or more".to_owned()),
        }
    };
    match text.split_once('/') {
        Some((below, above)) => Ok(Delay::ByKnee([one(below)?, one(above)?])),
        None => Ok(Delay::Everywhere(one(text)?)),
    }
}

/// `NAME=VALUE[,VALUE...]`.
pub fn setting(text: &str) -> Result<Setting, String> {
    let (name, values) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    let values = split(values, ',').map_err(|_| format!("`{name}` needs a number"))?;
    Ok(Setting {
        name: name.trim().to_owned(),
        values,
    })
}

/// `SPEED:HEIGHT`.
pub fn point(text: &str) -> Result<[f64; 2], String> {
    match split(text, ':')?[..] {
        [speed, height] if speed >= 0.0 && height > 0.0 => Ok([speed, height]),
        _ => Err("expected SPEED:HEIGHT, the speed from 0 and the height above 0".to_owned()),
    }
}

impl Delay {
    /// Its times.
    pub fn times(self) -> Vec<f64> {
        match self {
            Self::Everywhere(time) => vec![time],
            Self::ByKnee([below, above]) => vec![below, above],
        }
    }
}

impl std::fmt::Display for Delay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Everywhere(time) => write!(f, "{time} s"),
            Self::ByKnee([below, above]) => write!(f, "{below} s below the knee, {above} s above"),
        }
    }
}
