//! The name that somebody probably meant.

/// The candidate nearest to `name` (Damerau–Levenshtein, without regard to case), if any is near: at
/// most a third of its letters differ, or one contains the other.
pub fn suggestion<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let wanted = name.to_lowercase();
    let near = |candidate: &'a str| {
        let other = candidate.to_lowercase();
        let distance = strsim::damerau_levenshtein(&wanted, &other);
        let length = wanted.chars().count().max(other.chars().count());
        let contained = wanted.len() > 2 && (other.contains(&wanted) || wanted.contains(&other));
        (contained || 3 * distance <= length).then_some((distance, candidate))
    };
    (candidates.into_iter().filter_map(near))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// `; did you mean ...?`, or nothing: the end of a message about an unknown name.
pub fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

#[cfg(test)]
mod tests {
    use super::suggestion;

    #[test]
    fn near_names_are_found_and_far_ones_are_not() {
        let names = ["time", "target", "position", "stick"];
        assert_eq!(suggestion("postion", names), Some("position"));
        assert_eq!(suggestion("Position", names), Some("position"));
        assert_eq!(suggestion("stick_position", names), Some("position"));
        assert_eq!(suggestion("altitude", names), None);
        assert_eq!(suggestion("", names), None);
    }
}
