//! Limits that keep the parsing time proportional to the size of the text.
//!
//! The parser compares each attribute of an element with those before it, and each namespace in scope with the others;
//! with limits on both the cost per byte is bounded.

use super::ReadError;

/// Maximum nesting depth of elements. Descriptions have five levels plus those of annotations.
const MAX_DEPTH: usize = 1000;

/// Maximum number of attributes of an element, including namespace declarations. Descriptions have at most 20.
const MAX_ATTRIBUTES: usize = 256;

/// Maximum number of namespaces declared by an element and its ancestors.
const MAX_NAMESPACES: usize = 100;

/// Checks the limits. Text that is not well-formed may pass: the parser rejects it.
pub(in crate::description) fn check(text: &str) -> Result<(), ReadError> {
    let mut at = 0;
    // Namespaces declared by each open element.
    let mut open: Vec<usize> = Vec::new();
    let mut in_scope = 0;
    while let Some(start) = find(text, at, "<") {
        let rest = &text[start..];
        if let Some(end) = markup_end(rest) {
            at = start + end;
            continue;
        }
        let tag = Tag::scan(rest);
        let line = || 1 + text[..start].bytes().filter(|&b| b == b'\n').count() as u32;
        if tag.attributes > MAX_ATTRIBUTES {
            let limit = MAX_ATTRIBUTES;
            return Err(ReadError::TooManyAttributes {
                line: line(),
                limit,
            });
        }
        if in_scope + tag.namespaces > MAX_NAMESPACES {
            let limit = MAX_NAMESPACES;
            return Err(ReadError::TooManyNamespaces {
                line: line(),
                limit,
            });
        }
        if rest.starts_with("</") {
            in_scope -= open.pop().unwrap_or(0);
        } else if !rest[..tag.length].ends_with("/>") {
            open.push(tag.namespaces);
            in_scope += tag.namespaces;
        }
        if open.len() > MAX_DEPTH {
            let limit = MAX_DEPTH;
            return Err(ReadError::TooDeep {
                line: line(),
                limit,
            });
        }
        at = start + tag.length;
    }
    Ok(())
}

/// End of the comment, CDATA section, declaration or processing instruction that starts the text, if any.
fn markup_end(text: &str) -> Option<usize> {
    for (start, end) in [
        ("<!--", "-->"),
        ("<![CDATA[", "]]>"),
        ("<?", "?>"),
        ("<!", ">"),
    ] {
        if text.starts_with(start) {
            let end = find(text, start.len(), end).map(|position| position + end.len());
            return Some(end.unwrap_or(text.len()));
        }
    }
    None
}

fn find(text: &str, from: usize, wanted: &str) -> Option<usize> {
    text[from..].find(wanted).map(|position| from + position)
}

/// Counts of a tag.
struct Tag {
    /// Bytes from `<` to `>`, or to the end of the text.
    length: usize,
    attributes: usize,
    namespaces: usize,
}

impl Tag {
    fn scan(text: &str) -> Self {
        let mut tag = Self {
            length: text.len(),
            attributes: 0,
            namespaces: 0,
        };
        let mut quote = None;
        let mut word = 0;
        for (position, byte) in text.bytes().enumerate() {
            match (quote, byte) {
                (Some(open), _) if byte == open => quote = None,
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'>') => {
                    tag.length = position + 1;
                    break;
                }
                (None, b'=') => {
                    tag.attributes += 1;
                    let name = text.get(word..position).unwrap_or_default();
                    tag.namespaces += usize::from(name.starts_with("xmlns"));
                }
                (None, b' ' | b'\t' | b'\r' | b'\n') => word = position + 1,
                _ => {}
            }
        }
        tag
    }
}
