//! Text of others (names, titles, cells, messages of FMUs) as it may be written into lines of ours.
//!
//! A terminal obeys control characters, and bidirectional marks show a line in another order than it has. A line end
//! in a comment, a header or a message begins a line that looks like one of ours. Each function here says which of these
//! its text cannot contain. What is printable stays as it is, in any script.
//!
//! A character that is not printable is written as `\u001b`: what JSON and TOML read back as that character, so that text in
//! these languages keeps its meaning.

use std::borrow::Cow;

/// The most characters that [`excerpt`] gives: a name or a cell is shorter, and a message with several stays readable.
const EXCERPT: usize = 200;

/// Whether a line end of some tool: those of ASCII, NEL, and the line and paragraph separators of Unicode.
fn ends_line(c: char) -> bool {
    matches!(c, '\n'..='\r' | '\u{85}' | '\u{2028}' | '\u{2029}')
}

/// Whether a character does something in place of being shown: control characters (C0, DEL, C1), line and paragraph separators,
/// and what Unicode calls `Bidi_Control`. All have four hexadecimal digits.
pub fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{61c}'
                | '\u{200e}'
                | '\u{200f}'
                | '\u{2028}'..='\u{202e}'
                | '\u{2066}'..='\u{2069}'
        )
}

/// The text with its [hidden](is_hidden) characters in visible form, but for line feeds and tabs: what a terminal may be given.
/// Giving it twice changes nothing.
pub fn visible(text: &str) -> Cow<'_, str> {
    let is_kept = |c: char| !is_hidden(c) || c == '\n' || c == '\t';
    replaced(text, is_kept)
}

/// The text on one line, without [hidden](is_hidden) characters: line ends and tabs, several in a row together, become a space,
/// others become visible. Giving it twice changes nothing; text without hidden characters is unchanged.
pub fn one_line(text: &str) -> Cow<'_, str> {
    let is_space = |c: char| ends_line(c) || c == '\t';
    if !text.contains(is_space) {
        return replaced(text, |c| !is_hidden(c));
    }
    let mut parts = text.split(is_space);
    let mut line = parts.next().unwrap_or_default().to_owned();
    let mut is_after = false;
    for part in parts {
        if !is_after {
            line.push(' ');
        }
        line += part;
        is_after = part.is_empty();
    }
    Cow::Owned(replaced(&line, |c| !is_hidden(c)).into_owned())
}

/// [`one_line`] of at most 200 characters: of longer text its beginning and its end, with `…` between them. For names and
/// cells in messages.
pub fn excerpt(text: &str) -> Cow<'_, str> {
    shortened(text, EXCERPT)
}

/// [`one_line`] of at most `most` characters: of longer text its beginning and its end, with `…` between them.
pub fn shortened(text: &str, most: usize) -> Cow<'_, str> {
    // The whole is never put on one line: it may be as long as a file.
    if text.char_indices().nth(most).is_none() {
        let line = one_line(text);
        if line.char_indices().nth(most).is_none() {
            return line;
        }
    }
    let begin: String = text.chars().take(most).collect();
    let end: Vec<char> = text.chars().rev().take(most).collect();
    let end: String = end.into_iter().rev().collect();
    let (begin, end) = (one_line(&begin), one_line(&end));
    let half = most / 2;
    let skipped = (end.chars().count() + half + 1).saturating_sub(most);
    let parts = begin.chars().take(half).chain(['…']);
    Cow::Owned(parts.chain(end.chars().skip(skipped)).collect())
}

/// A comment line of a CSV or TOML file, with its line end: the text on [one line](one_line) after `# `.
pub fn comment(text: &str) -> String {
    format!("# {}\n", one_line(text))
}

/// Any text as content or as the value of an attribute in HTML, XML and SVG. Hidden characters are [visible], since XML does not
/// allow most of them; line ends and tabs stay.
pub fn markup(text: &str) -> String {
    (visible(text).replace('&', "&amp;").replace('<', "&lt;"))
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// The text with what is not kept as `\u` and four digits.
fn replaced(text: &str, is_kept: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&is_kept) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_kept(c) {
            true => out.push(c),
            false => out += &escaped(c),
        }
    }
    Cow::Owned(out)
}

/// A hidden character in the form of JSON and TOML.
pub fn escaped(c: char) -> String {
    format!("\\u{:04x}", u32::from(c))
}
