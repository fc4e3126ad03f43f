//! Numbers of a run: expressions of its signals, made to one number each by `rms`, `final` and others.

use crate::SweepError;
use pilotage_expression::Tape;
use pilotage_language::Expressions;
use pilotage_language::expressions::CompiledExpressions;
use pilotage_language::file::formula;
use pilotage_series::Series;
use pilotage_text::document::Document;
use pilotage_text::is_identifier;
use std::ops::Range;

/// What makes one number of a signal, with its number of arguments and its meaning.
pub const REDUCERS: [(&str, usize, &str); 14] = [
    ("initial", 1, "at the start"),
    ("final", 1, "at the end"),
    ("min", 1, "smallest"),
    ("max", 1, "largest"),
    ("peak", 1, "largest magnitude"),
    ("mean", 1, "mean over time"),
    ("sd", 1, "standard deviation over time"),
    ("rms", 1, "root of the mean square over time"),
    ("integral", 1, "integral over time"),
    ("at", 2, "at a time: at(x, 2)"),
    ("when", 1, "first time at which it is above 0: when(x - 5)"),
    (
        "settling",
        2,
        "time after which it stays within a part of its change from its last value: settling(x, 0.05)",
    ),
    (
        "overshoot",
        1,
        "how far it goes beyond its last value, in parts of its change",
    ),
    ("rise", 1, "time from 10 % to 90 % of its change"),
];

/// A number of a run.
#[derive(Debug, Clone)]
pub struct Measure {
    /// Its name.
    pub name: String,
    /// As it was given.
    pub given: String,
    /// What is reduced, innermost first.
    steps: Vec<Step>,
    last: Compiled,
    signals: Vec<String>,
}

#[derive(Debug, Clone)]
struct Step {
    reducer: &'static str,
    /// The signal, and the other argument.
    arguments: Vec<Compiled>,
}

#[derive(Debug, Clone)]
struct Compiled {
    tape: Tape,
}

impl Measure {
    /// Reads `EXPRESSION` or `NAME = EXPRESSION` over signals with these names and units.
    ///
    /// # Errors
    /// When it is no expression of these signals, or a signal in it is not made to one number.
    pub fn parse(given: &str, signals: &[(String, String)]) -> Result<Self, SweepError> {
        let fault = |words: String| SweepError::Measure {
            given: given.to_owned(),
            words,
        };
        const TAKEN: [&str; 3] = ["sample", "status", "reason"];
        let named = given
            .split_once('=')
            .filter(|(name, _)| is_identifier(name.trim()));
        let (name, text) = named.map_or((given.trim(), given), |(name, text)| (name.trim(), text));
        if TAKEN.contains(&name) {
            return Err(fault(format!(
                "`{name}` is a column of the table; give it another name"
            )));
        }
        if text.matches('(').count() != text.matches(')').count() {
            return Err(fault("its brackets do not match".to_owned()));
        }
        let mut rest = text.to_owned();
        let mut steps = Vec::new();
        while let Some((which, range, inner)) = last_call(&rest) {
            let (reducer, count, _) = REDUCERS[which];
            let arguments = split(&rest[inner]);
            if arguments.len() != count || arguments.iter().any(|own| own.trim().is_empty()) {
                return Err(fault(format!(
                    "{reducer} takes {count}, and is given {}",
                    arguments.len()
                )));
            }
            let known = steps.len();
            let compiled = arguments
                .iter()
                .enumerate()
                .map(|(k, own)| compiled(own, signals, known, k > 0));
            let arguments = compiled.collect::<Result<_, _>>().map_err(&fault)?;
            rest.replace_range(range, &format!("({})", known_name(steps.len())));
            steps.push(Step { reducer, arguments });
        }
        let last = compiled(&rest, signals, steps.len(), true).map_err(fault)?;
        Ok(Self {
            name: name.to_owned(),
            given: given.to_owned(),
            steps,
            last,
            signals: signals.iter().map(|own| own.0.clone()).collect(),
        })
    }

    /// Names of the signals of which it may be.
    pub fn signals(&self) -> &[String] {
        &self.signals
    }

    /// Its value in a run; NaN where there is none, as of a signal that never rises above 0.
    pub fn of(&self, run: &Series) -> f64 {
        let columns: Vec<Option<&[f64]>> = (self.signals.iter())
            .map(|name| {
                run.columns
                    .iter()
                    .find(|own| own.name == *name)
                    .map(|own| &own.values[..])
            })
            .collect();
        let mut known = vec![f64::NAN; self.steps.len()];
        let mut point = vec![0.0; 1 + columns.len()];
        let mut at = |compiled: &Compiled, row: usize, known: &[f64]| {
            point[0] = run.time.get(row).copied().unwrap_or(f64::NAN);
            for (own, column) in point[1..].iter_mut().zip(&columns) {
                *own = column
                    .and_then(|own| own.get(row).copied())
                    .unwrap_or(f64::NAN);
            }
            point.truncate(1 + columns.len());
            point.extend(known);
            compiled.tape.evaluate(&point)[0]
        };
        for (k, step) in self.steps.iter().enumerate() {
            let rows = 0..run.time.len();
            let signal: Vec<f64> = rows
                .map(|row| at(&step.arguments[0], row, &known[..k]))
                .collect();
            let other = step
                .arguments
                .get(1)
                .map_or(f64::NAN, |own| at(own, 0, &known[..k]));
            known[k] = reduced(step.reducer, &run.time, &signal, other);
        }
        at(&self.last, 0, &known)
    }
}

/// Name of the number of a step in the expressions around it.
fn known_name(k: usize) -> String {
    format!("reduced_{k}")
}

/// An expression of signals, or with `is_constant` of numbers alone, and of what `known` steps gave.
fn compiled(
    text: &str,
    signals: &[(String, String)],
    known: usize,
    is_constant: bool,
) -> Result<Compiled, String> {
    let file = format!("measure = {}\n", quoted(text));
    let document = Document::parse(&file, "--measure").map_err(|error| error.to_string())?;
    let formula = formula(("--measure", &file), document.root(), "measure")
        .map_err(|error| error.to_string())?;
    let formula = formula.ok_or("there is no expression")?;
    let mut all = Expressions::new("--measure", &file);
    for (name, unit) in signals {
        all.add_signal(name, (!unit.is_empty()).then_some(unit));
    }
    for k in 0..known {
        all.add_parameter(&known_name(k), None);
    }
    let words =
        "a signal outside of final(), rms() and the like, or where a number is expected: it";
    all.add("the measure", None, &formula, is_constant.then_some(words));
    let compiled = all.compile().map_err(|error| words_of(&error.to_string()));
    let CompiledExpressions { graph, nodes } = compiled.map_err(|words| match words.contains("changes in time") {
        true => format!("`{}` is a signal over time where one number is expected; write final(x), rms(x) or the like", text.trim()),
        false => words,
    })?;
    let count = 1 + signals.len() + known;
    Ok(Compiled {
        tape: Tape::new(&graph, count, |_| false, &[&nodes]),
    })
}

/// What an error says after its place in the text, which nobody has written.
fn words_of(error: &str) -> String {
    let rest = error
        .strip_prefix("--measure:")
        .and_then(|own| own.split_once(": "));
    rest.map_or(error, |own| own.1).to_owned()
}

/// A string of TOML.
fn quoted(text: &str) -> String {
    format!(
        "\"{}\"",
        text.trim()
            .replace('\\', "\\\\")
            .replace('"', "\\\"")
            .replace('\n', " ")
    )
}

/// The last call of a reducer, in which there is no other: which, and the ranges of it and of its arguments. `min` and `max` of
/// several arguments are those of model files.
fn last_call(text: &str) -> Option<(usize, Range<usize>, Range<usize>)> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let calls = REDUCERS.iter().enumerate().flat_map(|(which, (word, ..))| {
        text.match_indices(word).filter_map(move |(start, _)| {
            let before = text[..start].chars().next_back();
            let after = text[start + word.len()..].trim_start();
            let open = text.len() - after.len();
            let is_call = after.starts_with('(') && !before.is_some_and(is_name);
            let inner = is_call.then(|| open + 1..open + closing(after).unwrap_or(after.len()));
            let inner = inner?;
            let is_pointwise =
                matches!(*word, "min" | "max") && split(&text[inner.clone()]).len() > 1;
            (!is_pointwise).then(|| (which, start..(inner.end + 1).min(text.len()), inner))
        })
    });
    calls.max_by_key(|(_, range, _)| range.start)
}

/// Place of the bracket that closes the first one.
fn closing(text: &str) -> Option<usize> {
    let mut depth = 0;
    text.char_indices().find_map(|(k, c)| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        (depth == 0).then_some(k)
    })
}

/// Arguments, at commas outside of brackets.
fn split(text: &str) -> Vec<&str> {
    let (mut depth, mut from, mut all) = (0, 0, Vec::new());
    for (k, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            ',' if depth == 0 => {
                all.push(&text[from..k]);
                from = k + 1;
            }
            _ => {}
        }
    }
    all.push(&text[from..]);
    all
}

/// Integral of a piecewise linear signal.
fn integral(time: &[f64], y: &[f64]) -> f64 {
    let pairs = time.windows(2).zip(y.windows(2));
    pairs
        .map(|(t, y)| 0.5 * (y[0] + y[1]) * (t[1] - t[0]))
        .sum()
}

/// Integral of the square of a piecewise linear signal.
fn integral_of_square(time: &[f64], y: &[f64]) -> f64 {
    let pairs = time.windows(2).zip(y.windows(2));
    pairs
        .map(|(t, y)| (y[0] * y[0] + y[0] * y[1] + y[1] * y[1]) / 3.0 * (t[1] - t[0]))
        .sum()
}

/// First time at which a signal is at a level or beyond it in the direction of `sign`, interpolated.
fn reached(time: &[f64], y: &[f64], level: f64, sign: f64) -> f64 {
    let is_there = |own: &f64| sign * (own - level) >= 0.0;
    match y.iter().position(is_there) {
        None => f64::NAN,
        Some(0) => time[0],
        Some(k) => {
            let part = (level - y[k - 1]) / (y[k] - y[k - 1]);
            time[k - 1] + part * (time[k] - time[k - 1])
        }
    }
}

/// First time at which a signal is above 0, interpolated from where it is not.
fn above(time: &[f64], y: &[f64]) -> f64 {
    match y.iter().position(|own| *own > 0.0) {
        None => f64::NAN,
        Some(0) => time[0],
        Some(k) => {
            let part = -y[k - 1] / (y[k] - y[k - 1]);
            time[k - 1] + part * (time[k] - time[k - 1])
        }
    }
}

fn reduced(reducer: &str, time: &[f64], y: &[f64], other: f64) -> f64 {
    let (Some(first), Some(last)) = (y.first(), y.last()) else {
        return f64::NAN;
    };
    if y.iter().any(|own| own.is_nan()) {
        return f64::NAN;
    }
    let seconds = time[time.len() - 1] - time[0];
    let mean = |y: &[f64]| integral(time, y) / seconds;
    let change = last - first;
    match reducer {
        "initial" => *first,
        "final" => *last,
        "min" => y.iter().copied().fold(f64::INFINITY, f64::min),
        "max" => y.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        "peak" => y.iter().fold(0.0, |most, own| own.abs().max(most)),
        "mean" => mean(y),
        "rms" => (integral_of_square(time, y) / seconds).sqrt(),
        "sd" => {
            let centre = mean(y);
            let off: Vec<f64> = y.iter().map(|own| own - centre).collect();
            (integral_of_square(time, &off) / seconds).sqrt()
        }
        "integral" => integral(time, y),
        "at" => {
            let k = time.partition_point(|own| *own < other);
            match (k, time.get(k)) {
                (0, Some(begin)) if *begin > other => f64::NAN,
                (0, Some(_)) => *first,
                (k, Some(after)) => {
                    y[k - 1] + (other - time[k - 1]) / (after - time[k - 1]) * (y[k] - y[k - 1])
                }
                (_, None) => f64::NAN,
            }
        }
        "when" => above(time, y),
        "settling" => {
            let band = (other * change).abs();
            let Some(k) = y.iter().rposition(|own| (own - last).abs() > band) else {
                return 0.0;
            };
            // The last value is within the band, so that there is a next one.
            let [from, to] = [y[k] - last, y[k + 1] - last];
            let part = (from.abs() - band) / (from.abs() - from.signum() * to);
            time[k] + part * (time[k + 1] - time[k]) - time[0]
        }
        "overshoot" => {
            let beyond = y.iter().map(|own| (own - last) / change);
            beyond.fold(0.0, f64::max)
        }
        "rise" => {
            let [low, high] =
                [0.1, 0.9].map(|part| reached(time, y, first + part * change, change.signum()));
            high - low
        }
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_series::Column;

    /// The step response of a second-order system with damping 0.5 and frequency 2.
    fn response() -> Series {
        let time: Vec<f64> = (0..=4000).map(|k| 0.005 * f64::from(k)).collect();
        let (damping, frequency) = (0.5_f64, 2.0_f64);
        let fast = frequency * (1.0 - damping * damping).sqrt();
        let value = |t: &f64| {
            1.0 - (-damping * frequency * t).exp()
                * ((fast * t).cos() + damping * frequency / fast * (fast * t).sin())
        };
        let values = time.iter().map(value).collect();
        let (name, unit) = ("plant.y".to_owned(), "m".to_owned());
        Series {
            columns: vec![Column { name, unit, values }],
            time,
            ..Series::default()
        }
    }

    fn parsed(given: &str) -> Result<Measure, String> {
        let signals = [("plant.y".to_owned(), "m".to_owned())];
        Measure::parse(given, &signals).map_err(|error| error.to_string())
    }

    #[test]
    fn measures_of_a_step_response_are_known() {
        let run = response();
        let of = |given: &str| parsed(given).unwrap().of(&run);
        let near = |given: &str, expected: f64, tolerance: f64| {
            assert!(
                (of(given) - expected).abs() < tolerance,
                "{given}: {}, expected {expected}",
                of(given)
            );
        };
        // exp(-π ζ/√(1-ζ²)).
        near("overshoot(plant.y)", 0.163_033_534_8, 1e-5);
        near("100 * (max(plant.y) - final(plant.y))", 16.303_353_48, 1e-3);
        near("final(plant.y)", 1.0, 1e-6);
        // From a root finder: 0.81879 s, and 2.64454 s to 5 %.
        near("rise(plant.y)", 0.818_79, 1e-3);
        near("settling(plant.y, 0.05)", 2.644_54, 1e-3);
        near("rms(plant.y - 1)", (0.5 / 20.0_f64).sqrt(), 1e-5);
        near(
            "when(plant.y - 0.5)",
            of("at(time, when(plant.y - 0.5))"),
            1e-12,
        );
        near("at(plant.y, when(plant.y - 0.5))", 0.5, 1e-4);
        near("mean(max(plant.y, 2))", 2.0, 1e-12);
        near(
            "sd(plant.y) ^ 2 + mean(plant.y) ^ 2 - rms(plant.y) ^ 2",
            0.0,
            1e-9,
        );
        near("rms(plant.y - mean(plant.y)) - sd(plant.y)", 0.0, 1e-12);
        assert_eq!(parsed("best = peak(plant.y)").unwrap().name, "best");
        assert!(of("when(plant.y - 5)").is_nan() && of("when(0 * plant.y)").is_nan());
    }

    #[test]
    fn what_is_no_number_of_a_run_is_refused() {
        for (given, words) in [
            ("plant.y", "where one number is expected"),
            ("rms(plant.x)", "plant.x"),
            ("at(plant.y)", "at takes 2"),
            ("rms()", "rms takes 1"),
            ("rms(plant.y", "brackets"),
            ("settling(plant.y, plant.y)", "one number is expected"),
            ("", ""),
        ] {
            let found = parsed(given).unwrap_err();
            assert!(
                found.contains(words) && found.starts_with("--measure"),
                "{given}: {found}"
            );
        }
    }
}
