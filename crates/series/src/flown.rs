//! Metadata that flight recorders write at the top of a file as `# key: value`: pilot, device, vehicle and validity.

use std::collections::BTreeMap;

/// The value of a key in the comments of a series.
pub fn comment_value<'c>(comments: &'c [String], key: &str) -> Option<&'c str> {
    let value = |line: &'c String| line.strip_prefix(key)?.strip_prefix(':');
    let mut values = comments.iter().filter_map(value);
    values
        .next()
        .map(str::trim)
        .filter(|value| !value.is_empty())
}

/// The first digits of the hash of the flown vehicle, which follows its name.
pub fn vehicle(comments: &[String]) -> Option<&str> {
    let (_, hash) = comment_value(comments, "vehicle")?.split_once("sha256 ")?;
    hash.get(..DIGITS)
}

/// Number of digits of a hash that distinguish vehicles.
const DIGITS: usize = 12;

/// Reasons against fitting these flights together: runs marked as invalid, different kinds of sticks, different
/// vehicles or different people. Each flight is given by its name and its [comments](crate::Series::comments).
pub fn mixed<'c>(flights: impl IntoIterator<Item = (&'c str, &'c [String])>) -> Vec<String> {
    let mut notes = Vec::new();
    let (mut sticks, mut vehicles, mut people) =
        (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (name, comments) in flights {
        if let Some(why) =
            comment_value(comments, "valid").and_then(|valid| valid.strip_prefix("no"))
        {
            let why = why.trim_start_matches(':').trim();
            let why = if why.is_empty() {
                String::new()
            } else {
                format!(": {why}")
            };
            notes.push(format!("{name} says of itself that it does not count{why}"));
        }
        if comment_value(comments, "unfinished").is_some() {
            notes.push(format!(
                "{name} says of itself that it did not come to its end"
            ));
        }
        // `mouse (its name)`
        let device =
            comment_value(comments, "device").and_then(|text| text.split_whitespace().next());
        for (all, value) in [
            (&mut sticks, device),
            // By its name where a file has no hash.
            (
                &mut vehicles,
                vehicle(comments).or_else(|| comment_value(comments, "vehicle")),
            ),
            (&mut people, comment_value(comments, "subject")),
        ] {
            let of: &mut Vec<&str> = all.entry(value.unwrap_or("")).or_default();
            of.push(name);
        }
    }
    let kinds = |all: &BTreeMap<&str, Vec<&str>>| -> Option<String> {
        let known = all.iter().filter(|(kind, _)| !kind.is_empty());
        let words = known.map(|(kind, names)| match names.as_slice() {
            [name] => format!("{kind} ({name})"),
            [name, rest @ ..] => format!("{kind} ({name} and {} more)", rest.len()),
            [] => (*kind).to_owned(),
        });
        let words: Vec<String> = words.collect();
        (words.len() > 1).then(|| words.join(", "))
    };
    notes.extend(kinds(&sticks).map(|kinds| {
        format!(
            "the runs were flown with different kinds of sticks, {kinds}: one pilot for all mixes ways to move the hand"
        )
    }));
    notes.extend(kinds(&vehicles).map(|kinds| {
        format!(
            "the runs were flown with different vehicles, {kinds}: one of them is not that of the fit"
        )
    }));
    notes.extend(kinds(&people).map(|kinds| {
        format!("the runs were flown by different people, {kinds}: one pilot for all describes none of them")
    }));
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flights_that_do_not_go_together_are_told() {
        let flight = |device: &str, subject: &str, more: &str| -> Vec<String> {
            let lines = [
                format!("device: {device}"),
                format!("subject: {subject}"),
                more.to_owned(),
            ];
            lines.into()
        };
        let same = [
            flight("mouse (mouse)", "P1", "valid: yes"),
            flight("mouse (other)", "P1", ""),
            vec!["pilot: A".to_owned()],
        ];
        let of = |flights: &[Vec<String>]| {
            let names = ["a.csv", "b.csv", "c.csv"];
            mixed(names.into_iter().zip(flights.iter().map(Vec::as_slice)))
        };
        assert_eq!(of(&same), [""; 0]);
        let other = [
            flight(
                "mouse (mouse)",
                "P1",
                "valid: no: the page had not the focus at 3.0 s",
            ),
            flight("gamepad (pad)", "P2", "unfinished: yes"),
            flight("mouse (mouse)", "P1", ""),
        ];
        assert_eq!(
            of(&other),
            [
                "a.csv says of itself that it does not count: the page had not the focus at 3.0 s",
                "b.csv says of itself that it did not come to its end",
                "the runs were flown with different kinds of sticks, gamepad (b.csv), mouse (a.csv and 1 more): one pilot \
                 for all mixes ways to move the hand",
                "the runs were flown by different people, P1 (a.csv and 1 more), P2 (b.csv): one pilot for all describes none of them",
            ]
        );
    }
}
