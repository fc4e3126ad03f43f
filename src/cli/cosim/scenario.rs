//! Reads the file of `--scenario`.

use crate::cli::Failure;
use crate::cli::system::{full_name, only};
use crate::cosim::scenario::{Effect, Event, Start, Triggers, What};
use crate::cosim::{Scenario, System};
use pilotage_text::document::{self, Document, Place, TomlTable};
use std::path::Path;

/// Keys of what happens to an input, of which an event has one.
const EFFECTS: [&str; 6] = ["set", "freeze", "bias", "scale", "delay", "noise"];

/// How names of its numbers begin where they are varied.
pub const PREFIX: &str = "scenario.";

/// A scenario that was read.
#[derive(Clone, Default)]
pub struct Read {
    pub scenario: Scenario,
    names: Vec<Option<String>>,
    places: Vec<Option<Place>>,
}

impl Read {
    /// Reads a file.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let text = document::read(path)?;
        let file = path.display().to_string();
        let document = Document::parse(&text, &file)?;
        let root = document.root();
        root.only(&["event"])?;
        let mut own = Self::default();
        for table in root.tables("event")? {
            own.places
                .push(table.place(table.names().first().copied().unwrap_or_default()));
            own.scenario.events.push(event(table)?);
            own.names.push(own.name(table)?);
        }
        match own.scenario.events.is_empty() {
            true => Err(Failure::new(format!("{file}: nothing happens"))
                .hint("write [[event]] with `time` or `when`, and what happens: docs/cosim.md")),
            false => Ok(own),
        }
    }

    /// The name of an event.
    fn name(&self, table: TomlTable) -> Result<Option<String>, Failure> {
        let Some(name) = table.string("name")? else {
            return Ok(None);
        };
        let is_sign = |sign: char| sign.is_alphanumeric() || sign == '_' || sign == '-';
        let words = match name.chars().all(is_sign) && !name.is_empty() {
            false => "expected letters, digits, `_` and `-`",
            true if self.names.iter().flatten().any(|own| own == name) => "another event has it",
            true => return Ok(Some(name.to_owned())),
        };
        let shown = pilotage_text::printable::excerpt(name);
        let message = format!("the name of the event is `{shown}`; {words}");
        Err(Failure::new(message).at(table.place("name").as_ref()))
    }

    /// Sets a number of an event that has a name: `failure.scale`; `failure` alone is its time.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), Failure> {
        let (event, key) = name.split_once('.').unwrap_or((name, "time"));
        let position = self
            .names
            .iter()
            .position(|own| own.as_deref() == Some(event));
        let Some(position) = position else {
            let all: Vec<&str> = self.names.iter().flatten().map(String::as_str).collect();
            let hint = match all.is_empty() {
                true => format!("write `name = \"{event}\"` into its [[event]]"),
                false => format!("there are {}", all.join(", ")),
            };
            let message = format!("no event of the scenario is called `{event}`");
            return Err(Failure::new(message).hint(hint));
        };
        let Event {
            start,
            duration,
            what,
        } = &mut self.scenario.events[position];
        let effect = match what {
            What::Input(_, effect) => Some(effect),
            What::End => None,
        };
        let number = match (key, start, effect) {
            ("time", Start::Time(own), _) | ("level", Start::When { level: own, .. }, _) => own,
            ("duration", ..) if value > 0.0 => duration,
            ("set", _, Some(Effect::Set(own)))
            | ("bias", _, Some(Effect::Bias(own)))
            | ("scale", _, Some(Effect::Scale(own))) => own,
            ("delay", _, Some(Effect::Delay(own)))
            | ("noise", _, Some(Effect::Noise { sd: own, .. }))
                if value >= 0.0 =>
            {
                own
            }
            ("seed", _, Some(Effect::Noise { seed, .. })) if is_seed(value) => {
                *seed = value as u64;
                return Ok(());
            }
            (key, ..) => {
                let message = format!("the event `{event}` has no `{key}` that can be {value}");
                return Err(Failure::new(message)
                    .hint("vary its time, level, duration, seed, or the number of what happens"));
            }
        };
        *number = value;
        Ok(())
    }

    /// Inputs that are given what comes from outside, from a time on.
    pub fn add_live(&mut self, inputs: &[String], start: f64) {
        for (number, input) in inputs.iter().enumerate() {
            self.scenario.events.push(Event {
                start: Start::Time(start),
                duration: f64::INFINITY,
                what: What::Input(input.clone(), Effect::Live(number)),
            });
            self.names.push(None);
            self.places.push(None);
        }
    }

    /// Lets it happen in a system.
    pub fn apply(mut self, system: &mut System) -> Result<Triggers, Failure> {
        for event in &mut self.scenario.events {
            let full = |name: &String| full_name(system, name, only(system));
            if let What::Input(name, _) = &mut event.what {
                *name = full(name);
            }
            if let Start::When { output, .. } = &mut event.start {
                *output = full(output);
            }
        }
        let inputs = self
            .scenario
            .events
            .iter()
            .filter_map(|own| match &own.what {
                What::Input(name, effect) => Some((name, matches!(effect, Effect::Live(_)))),
                What::End => None,
            });
        let (live, changed): (Vec<_>, Vec<_>) = inputs.partition(|(_, is_live)| *is_live);
        let is_changed = |name: &String| changed.iter().any(|(other, _)| *other == name);
        if let Some((name, _)) = live.iter().find(|(name, _)| is_changed(name)) {
            let message = format!("--live and an event of the scenario both change `{name}`");
            return Err(
                Failure::new(message).hint("let the sender of the values do what the event does")
            );
        }
        (self.scenario.apply(system))
            .map_err(|(event, error)| Failure::from(error).at(self.places[event].as_ref()))
    }
}

fn event(table: TomlTable) -> Result<Event, Failure> {
    let keys = [
        &["name", "time", "when", "duration", "input", "end", "seed"],
        &EFFECTS[..],
    ]
    .concat();
    table.only(&keys)?;
    let at = |key: &str, message: String| Failure::new(message).at(table.place(key).as_ref());
    let first = table.names().first().copied().unwrap_or_default();
    let start = match (table.number("time")?, table.string("when")?) {
        (Some(time), None) if time.is_finite() => Start::Time(time),
        (None, Some(when)) => condition(when).map_err(|message| at("when", message))?,
        _ => {
            let message = "an event has either `time` [s] or `when`, such as \"vehicle.z > 3\"";
            return Err(at(first, message.to_owned()));
        }
    };
    let duration = table.number("duration")?.unwrap_or(f64::INFINITY);
    if duration.is_nan() || duration <= 0.0 {
        return Err(at(
            "duration",
            format!("`duration` is {duration} s; expected a time above 0"),
        ));
    }
    let given: Vec<&str> = EFFECTS.into_iter().filter(|key| table.has(key)).collect();
    let what = match (table.string("input")?, table.boolean("end")?, &given[..]) {
        (None, Some(true), []) => What::End,
        (Some(input), None, [key]) => What::Input(input.to_owned(), effect(table, key)?),
        (Some(_), None, [first, second, ..]) => {
            let message = format!(
                "an event changes its input in one way, and this one has `{first}` and `{second}`"
            );
            return Err(at(second, message)
                .hint("write one [[event]] for each; they are applied in their order"));
        }
        _ => {
            let message = format!(
                "an event has either `end = true`, or `input` and one of {}",
                EFFECTS.join(", ")
            );
            return Err(at(first, message));
        }
    };
    Ok(Event {
        start,
        duration,
        what,
    })
}

fn effect(table: TomlTable, key: &str) -> Result<Effect, Failure> {
    let refused = |message: String| Failure::new(message).at(table.place(key).as_ref());
    if key == "freeze" {
        return match table.boolean(key)? {
            Some(true) => Ok(Effect::Freeze),
            _ => Err(refused(
                "`freeze` is false; expected true, or leave it out".to_owned(),
            )),
        };
    }
    let number = table.required(key, table.number(key)?)?;
    let is_good = number.is_finite() && (number >= 0.0 || !["delay", "noise"].contains(&key));
    if !is_good {
        return Err(refused(format!("`{key}` is {number}, which cannot be")));
    }
    let seed = table.number("seed")?.unwrap_or(1.0);
    if !is_seed(seed) {
        return Err(refused(format!(
            "`seed` is {seed}; expected a whole number from 0"
        )));
    }
    Ok(match key {
        "set" => Effect::Set(number),
        "bias" => Effect::Bias(number),
        "scale" => Effect::Scale(number),
        "delay" => Effect::Delay(number),
        _ => Effect::Noise {
            sd: number,
            seed: seed as u64,
        },
    })
}

fn is_seed(value: f64) -> bool {
    (0.0..=2_f64.powi(53)).contains(&value) && value.fract() == 0.0
}

/// Reads `instance.output > 3`.
fn condition(text: &str) -> Result<Start, String> {
    let parts = text.split_once('>').map(|parts| (parts, true));
    let parts = parts.or_else(|| text.split_once('<').map(|parts| (parts, false)));
    let read = parts.and_then(|((output, level), is_above)| {
        let level: f64 = level.trim().parse().ok()?;
        level.is_finite().then(|| Start::When {
            output: output.trim().to_owned(),
            is_above,
            level,
        })
    });
    read.ok_or_else(|| {
        let shown = pilotage_text::printable::excerpt(text);
        format!(
            "`when` is `{shown}`; expected an output, `>` or `<`, and a number: \"vehicle.z > 3\""
        )
    })
}
