//! The name that was probably meant.

/// The candidate nearest to `name` (Damerau–Levenshtein, ignoring case), if any is near: at most a third of the letters
/// differ, or one contains the other.
pub fn suggestion<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let candidates: Vec<&str> = candidates.into_iter().collect();
    let before = name.rfind('.').map_or("", |dot| &name[..=dot]);
    let is_beside = |candidate: &&str| !before.is_empty() && candidate.starts_with(before);
    // In `pilot.gian` the instance is correct: only the rest is compared.
    let skipped = match candidates.iter().any(is_beside) {
        true => before,
        false => "",
    };
    let wanted = name[skipped.len()..].to_lowercase();
    let near = |candidate: &'a str| {
        let other = candidate.strip_prefix(skipped)?.to_lowercase();
        let [own, theirs] = [&wanted, &other].map(|text| text.chars().count());
        let length = own.max(theirs);
        let contained = wanted.len() > 2 && (other.contains(&wanted) || wanted.contains(&other));
        // The distance is at least the difference of the lengths, but computing it costs their product.
        if !contained && 3 * own.abs_diff(theirs) > length {
            return None;
        }
        let distance = strsim::damerau_levenshtein(&wanted, &other);
        (contained || 3 * distance <= length).then_some((distance, candidate))
    };
    (candidates.into_iter().filter_map(near))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// `; did you mean ...?` or nothing: the end of a message about an unknown name.
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

    #[test]
    fn of_dotted_names_the_last_part_is_compared_where_the_others_are_right() {
        let names = ["pilot.gain", "pilot.lag", "vehicle.gain"];
        assert_eq!(suggestion("pilot.gian", names), Some("pilot.gain"));
        assert_eq!(suggestion("pilt.gain", names), Some("pilot.gain"));
        assert_eq!(suggestion("pilot.arm", names), None);
    }
}
