//! Traces connections from inputs of components to outputs, through systems and signal dictionaries (section 5.3.2).

use crate::error::{At, SspError};
use pilotage_cosim::description::Transformation;
use pilotage_units::{Conversion, Unit};
use std::collections::HashMap;

/// Who has a connector, each by number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Owner {
    Component(usize),
    System(usize),
    Dictionary(usize),
}

/// A connector: its owner, and its name with the indices of an array's element.
pub(crate) type Key = (Owner, String);

/// What feeds a connector.
#[derive(Debug, Clone)]
pub(crate) struct Hop {
    pub(crate) from: Key,
    pub(crate) step: Transformation,
    pub(crate) at: At,
}

/// Connectors and what feeds them.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    /// Units of connectors: of components, those of the FMU's variables before those of the connectors.
    units: HashMap<Key, Unit>,
    into: HashMap<Key, Hop>,
    /// Connectors of components that are fed, in order.
    pub(crate) sinks: Vec<Key>,
    /// The components' connectors whose unit the FMU does not say.
    foreign: Vec<Key>,
}

/// Where a trace ends: an output of a component, or a connector that nothing feeds; with the hops from there.
#[derive(Debug)]
pub(crate) struct Trace {
    pub(crate) from: Key,
    /// Each with the connector that it leads to.
    pub(crate) hops: Vec<(Hop, Key)>,
}

/// A value's way: the unit of where it comes, if any, what is done, and the connector.
pub(crate) struct Leg {
    pub(crate) unit: Option<Unit>,
    pub(crate) step: Transformation,
    pub(crate) at: At,
}

/// Factor and offset of a value that begins in a unit and takes these legs: each converts to its unit, then transforms.
///
/// # Errors
/// If a unit cannot be converted into the next.
pub(crate) fn composite(start: Option<Unit>, legs: &[Leg]) -> Result<Conversion, SspError> {
    let (mut unit, mut all) = (start, Conversion::NONE);
    for leg in legs {
        if let (Some(from), Some(to), true) = (&unit, &leg.unit, leg.step.converts_units) {
            let conversion = from.conversion(to).ok_or_else(|| {
                let (from, to) = (&from.name, &to.name);
                leg.at
                    .fault(format!("a value in {from} cannot be converted into {to}"))
            })?;
            all = all.then(conversion);
        }
        all = all.then(leg.step.linear);
        unit = leg.unit.clone().or(unit);
    }
    Ok(all)
}

/// The values that these legs together have in place of others.
pub(crate) fn composite_map(legs: &[Leg]) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for leg in legs {
        for (_, to) in &mut all {
            *to = mapped_value(&leg.step.map, to);
        }
        for (from, to) in &leg.step.map {
            if all.iter().all(|(known, _)| known != from) {
                all.push((from.clone(), to.clone()));
            }
        }
    }
    all
}

/// The value that a map has in place of a value, or this.
pub(crate) fn mapped_value(map: &[(String, String)], value: &str) -> String {
    let found = map.iter().find(|(from, _)| from == value.trim());
    found.map_or(value, |(_, to)| to).to_owned()
}

impl Graph {
    /// Adds a connector; `is_own` is whether the unit is that of the FMU's variable.
    pub(crate) fn add(&mut self, key: Key, unit: Option<Unit>, is_own: bool) {
        if let Some(unit) = unit {
            if !is_own {
                self.foreign.push(key.clone());
            }
            self.units.insert(key, unit);
        }
    }

    /// Feeds a connector from another.
    pub(crate) fn connect(
        &mut self,
        from: Key,
        to: Key,
        step: Transformation,
        at: &At,
    ) -> Result<(), SspError> {
        if let Some(known) = self.into.get(&to) {
            if known.from == from && known.step == step {
                return Ok(());
            }
            let (name, line) = (&to.1, known.at.place.line);
            return Err(at.fault(format!("`{name}` is fed twice: in line {line}, and here")));
        }
        if matches!(to.0, Owner::Component(_)) {
            self.sinks.push(to.clone());
        }
        let at = at.clone();
        self.into.insert(to, Hop { from, step, at });
        Ok(())
    }

    /// The unit of a connector.
    pub(crate) fn unit_of(&self, (owner, name): &Key) -> Option<Unit> {
        let whole = || name.rfind('[').map(|at| (*owner, name[..at].to_owned()));
        let own = self.units.get(&(*owner, name.clone()));
        own.or_else(|| self.units.get(&whole()?)).cloned()
    }

    /// What feeds a connector in the end.
    ///
    /// # Errors
    /// If connections form a circle, or an array is fed by its elements and taken as a whole.
    pub(crate) fn trace(&self, sink: &Key) -> Result<Trace, SspError> {
        let (mut key, mut hops, mut index) = (sink.clone(), Vec::new(), String::new());
        loop {
            let found = match self.into.get(&key) {
                Some(hop) => Some(hop),
                // An element of what is connected as a whole.
                None => key.1.rfind('[').and_then(|at| {
                    let hop = self.into.get(&(key.0, key.1[..at].to_owned()))?;
                    index = key.1[at..].to_owned();
                    Some(hop)
                }),
            };
            let Some(hop) = found else { break };
            hops.push((hop.clone(), key));
            if hops.len() > self.into.len() {
                return Err(hop
                    .at
                    .fault("these connections form a circle without a component"));
            }
            key = hop.from.clone();
            if matches!(key.0, Owner::Component(_)) {
                break;
            }
            if !index.is_empty() {
                key.1 += &std::mem::take(&mut index);
            }
        }
        key.1 += &index;
        let is_element = |(owner, name): &&Key| {
            *owner == key.0
                && name
                    .strip_prefix(&*key.1)
                    .is_some_and(|end| end.starts_with('['))
        };
        let is_open = !matches!(key.0, Owner::Component(_));
        if let Some((hop, _)) = hops.last()
            && is_open
            && self.into.keys().any(|own| is_element(&own))
        {
            let name = &key.1;
            return Err(hop.at.fault(format!(
                "`{name}` is fed by its elements; connect these one by one here too"
            )));
        }
        hops.reverse();
        Ok(Trace { from: key, hops })
    }

    /// The legs of a trace.
    pub(crate) fn legs(&self, trace: &Trace) -> Vec<Leg> {
        let leg = |(hop, to): &(Hop, Key)| Leg {
            unit: self.unit_of(to),
            step: hop.step.clone(),
            at: hop.at.clone(),
        };
        trace.hops.iter().map(leg).collect()
    }

    /// What a wire in place of a trace does with values. It says nothing of units that the FMUs do not say themselves, and of
    /// those between the ends: then all is in factor and offset.
    pub(crate) fn transformation(&self, trace: &Trace) -> Result<Transformation, SspError> {
        let start = self.unit_of(&trace.from);
        let legs = self.legs(trace);
        let whole = composite(start, &legs)?;
        let ends = [Some(&trace.from), trace.hops.last().map(|(_, to)| to)];
        let is_foreign = ends
            .into_iter()
            .flatten()
            .any(|key| self.foreign.contains(key));
        let is_plain = legs.iter().all(|leg| leg.step == Transformation::default());
        Ok(match legs.as_slice() {
            [leg] if !is_foreign => leg.step.clone(),
            _ if is_plain && (!is_foreign || whole == Conversion::NONE) => {
                Transformation::default()
            }
            _ => Transformation {
                linear: whole,
                converts_units: false,
                map: composite_map(&legs),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_text::document::Place;

    fn at(line: usize) -> At {
        let place = Place {
            file: "s.ssd".into(),
            line,
            column: None,
        };
        let element = "Connection";
        At { place, element }
    }

    fn key(owner: Owner, name: &str) -> Key {
        (owner, name.to_owned())
    }

    /// 2 ft as 0.6096 m, tripled, as centimetres, plus 1: 183.88 cm.
    #[test]
    fn each_leg_converts_and_then_transforms() {
        let (a, s, b) = (Owner::Component(0), Owner::System(0), Owner::Component(1));
        let mut graph = Graph::default();
        graph.add(key(a, "y"), Some(Unit::named("ft")), true);
        graph.add(key(s, "x"), Some(Unit::named("m")), false);
        graph.add(key(b, "u"), Some(Unit::named("cm")), true);
        let by = |factor, offset| Transformation {
            linear: Conversion { factor, offset },
            ..Transformation::default()
        };
        graph
            .connect(key(a, "y"), key(s, "x"), by(3.0, 0.0), &at(1))
            .unwrap();
        graph
            .connect(key(s, "x"), key(b, "u"), by(1.0, 1.0), &at(2))
            .unwrap();
        let trace = graph.trace(&key(b, "u")).unwrap();
        assert_eq!(trace.from, key(a, "y"));
        let found = graph.transformation(&trace).unwrap();
        assert!(!found.converts_units);
        assert!((found.linear.apply(2.0) - 183.88).abs() < 1e-10);
        let twice = graph.connect(key(b, "z"), key(s, "x"), Transformation::default(), &at(3));
        let message = twice.unwrap_err().to_string();
        assert_eq!(
            message,
            "s.ssd:3: <Connection>: `x` is fed twice: in line 1, and here"
        );
    }

    #[test]
    fn a_circle_ends() {
        let (s, t, b) = (Owner::System(0), Owner::System(1), Owner::Component(0));
        let mut graph = Graph::default();
        for (from, to) in [
            ((s, "x"), (t, "x")),
            ((t, "x"), (s, "x")),
            ((s, "x"), (b, "u")),
        ] {
            let (from, to) = (key(from.0, from.1), key(to.0, to.1));
            graph
                .connect(from, to, Transformation::default(), &at(1))
                .unwrap();
        }
        assert!(
            graph
                .trace(&key(b, "u"))
                .unwrap_err()
                .to_string()
                .contains("circle")
        );
    }
}
