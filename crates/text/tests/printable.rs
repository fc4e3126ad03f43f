//! What the functions for text of others promise, for any text.

use pilotage_text::document::{Document, key, quoted};
use pilotage_text::printable::{comment, excerpt, is_hidden, one_line, visible};
use proptest::prelude::*;
use std::borrow::Cow;

/// What a terminal, a reader of lines or TOML takes for more than a letter.
const ODD: &[char] = &[
    '\0', '\x07', '\x1b', '\n', '\r', '\t', '\x0b', '\x0c', '\x7f', '\u{85}', '\u{9b}', '\u{61c}',
    '\u{200e}', '\u{202e}', '\u{2066}', '\u{2069}', '\u{2028}', '\u{2029}', '\u{feff}', '"', '\'',
    '\\', '#', '=', '.', '[', ']', ',', ' ', 'u',
];

fn texts() -> impl Strategy<Value = String> {
    let letter = prop_oneof![any::<char>(), prop::sample::select(ODD)];
    prop::collection::vec(letter, 0..40).prop_map(String::from_iter)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2048,
        rng_seed: proptest::test_runner::RngSeed::Fixed(45),
        ..ProptestConfig::default()
    })]

    #[test]
    fn one_line_hides_nothing_and_is_done_once(text in texts()) {
        let line = one_line(&text);
        prop_assert!(!line.contains(is_hidden), "{line:?}");
        // Of all readers Python's knows the most line ends.
        let is_end = |c| matches!(c, '\n'..='\r' | '\x1c'..='\x1e' | '\u{85}' | '\u{2028}' | '\u{2029}');
        prop_assert!(!line.contains(is_end));
        prop_assert_eq!(&one_line(&line), &line);
        prop_assert_eq!(text.contains(is_hidden), line != text);
    }

    #[test]
    fn visible_text_keeps_its_lines(text in texts()) {
        let shown = visible(&text);
        prop_assert!(shown.chars().all(|c| !is_hidden(c) || c == '\n' || c == '\t'), "{shown:?}");
        prop_assert_eq!(shown.matches('\n').count(), text.matches('\n').count());
        prop_assert_eq!(&visible(&shown), &shown);
    }

    /// JSON that is made visible is the same JSON.
    #[test]
    fn what_becomes_visible_means_the_same_in_toml(text in texts()) {
        let plain: String = text.chars().filter(|c| !matches!(c, '\0'..='\x1f' | '\x7f' | '"' | '\\')).collect();
        let written = format!("a = \"{plain}\"");
        let shown = visible(&written);
        let document = Document::parse(&shown, "f.toml").unwrap();
        prop_assert_eq!(document.root().string("a").unwrap(), Some(plain.as_str()));
    }

    #[test]
    fn excerpts_are_short_lines(text in texts(), times in 1..400_usize) {
        let text = text.repeat(times);
        let short = excerpt(&text);
        prop_assert!(short.chars().count() <= 200 && !short.contains(is_hidden));
        if text.chars().count() <= 30 {
            prop_assert_eq!(short, one_line(&text));
        }
    }

    #[test]
    fn strings_and_keys_of_toml_read_back(text in texts(), other in texts()) {
        let written = format!("{}{} = {} {}", comment(&other), key(&text), quoted(&other), comment(&text));
        prop_assert_eq!(written.lines().count(), 2);
        prop_assert!(!written.contains(|c| is_hidden(c) && c != '\n'));
        let document = Document::parse(&written, "f.toml").unwrap();
        prop_assert_eq!(document.root().names(), [text.as_str()]);
        prop_assert_eq!(document.root().string(&text).unwrap(), Some(other.as_str()));
    }
}

#[test]
fn printable_text_of_any_script_is_as_it_was() {
    for text in [
        "Höhenänderung [m/s²]",
        "γωνία – θ",
        "机体 位置",
        "שלום",
        "مرحبا",
        "क्षेत्र",
        "👩‍✈️",
        "a\u{a0}b",
    ] {
        assert!(
            matches!(one_line(text), Cow::Borrowed(own) if own == text),
            "{text}"
        );
        assert!(
            matches!(excerpt(text), Cow::Borrowed(own) if own == text),
            "{text}"
        );
        assert_eq!(quoted(text), format!("\"{text}\""));
    }
}

#[test]
fn what_is_no_letter_is_seen() {
    let text = "My study\r\nday 1\t\u{1b}[2J\u{202e}x\u{9b}";
    assert_eq!(one_line(text), "My study day 1 \\u001b[2J\\u202ex\\u009b");
    assert_eq!(
        visible(text),
        "My study\\u000d\nday 1\t\\u001b[2J\\u202ex\\u009b"
    );
    assert_eq!(comment(text), format!("# {}\n", one_line(text)));
}

#[test]
fn of_long_text_both_ends_are_kept() {
    let cell = format!("begin{}\nend", "ä".repeat(1_000_000));
    let short = excerpt(&cell);
    assert_eq!(short.chars().count(), 200);
    assert!(
        short.starts_with("beginää") && short.ends_with("ää end") && short.contains("ä…ä"),
        "{short}"
    );
}
