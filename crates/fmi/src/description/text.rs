//! Decoding of bytes, and conversion of byte offsets to lines and columns.

use super::ReadError;
use std::borrow::Cow;

/// Maximum size of a description [bytes]: some hundred thousand variables.
const MAX_BYTES: usize = 256 << 20;

/// A place in the file; line and column start at 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column, in characters.
    pub column: u32,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Decodes UTF-8 (with or without byte order mark), UTF-16 with one, ISO-8859-1 and US-ASCII. Also returns the name of
/// the encoding if it is not UTF-8, as required by the standard.
pub(super) fn decode(bytes: &[u8]) -> Result<(Cow<'_, str>, Option<&'static str>), ReadError> {
    if bytes.len() > MAX_BYTES {
        return Err(ReadError::TooLarge {
            bytes: bytes.len(),
            limit: MAX_BYTES,
        });
    }
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => Ok((utf8(rest)?, None)),
        [0xff, 0xfe, rest @ ..] => Ok((utf16(rest, u16::from_le_bytes)?, Some("UTF-16"))),
        [0xfe, 0xff, rest @ ..] => Ok((utf16(rest, u16::from_be_bytes)?, Some("UTF-16"))),
        _ => match declared_encoding(bytes).as_deref() {
            None | Some("utf-8" | "utf8") => Ok((utf8(bytes)?, None)),
            // ASCII is a subset of UTF-8.
            Some("us-ascii" | "ascii") => Ok((utf8(bytes)?, None)),
            Some("iso-8859-1" | "latin1") => {
                let text = bytes.iter().map(|&b| char::from(b)).collect();
                Ok((text, Some("ISO-8859-1")))
            }
            Some(other) => Err(ReadError::UnknownEncoding {
                encoding: other.to_owned(),
            }),
        },
    }
}

fn utf8(bytes: &[u8]) -> Result<Cow<'_, str>, ReadError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count() as u32;
        ReadError::NotUtf8 {
            line,
            byte: bytes[error.valid_up_to()],
        }
    })?;
    Ok(Cow::Borrowed(text))
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<Cow<'static, str>, ReadError> {
    let units = bytes.chunks(2).map(|pair| match *pair {
        [a, b] => unit([a, b]),
        // A single byte at the end: replaced by a lone surrogate, which the decoder rejects.
        _ => 0xd800,
    });
    char::decode_utf16(units)
        .collect::<Result<String, _>>()
        .map(Cow::Owned)
        .map_err(|_| ReadError::NotUtf16)
}

/// The encoding named in the XML declaration, in lower case.
fn declared_encoding(bytes: &[u8]) -> Option<String> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]);
    let declaration = head.strip_prefix("<?xml")?.split_once("?>")?.0;
    let value = declaration.split_once("encoding")?.1.trim_start();
    let value = value.strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    let name = value[1..].split_once(quote)?.0;
    Some(name.to_ascii_lowercase())
}

/// Bytes between two entries of [`LineIndex`].
const BLOCK: usize = 1024;

/// Starts of lines, and cumulative character counts per block of bytes, so that the time to convert an offset to a
/// place does not depend on the length of a line.
pub struct LineIndex<'t> {
    text: &'t str,
    starts: Vec<usize>,
    /// Characters before each multiple of [`BLOCK`], excluding those that start there.
    characters: Vec<usize>,
}

impl<'t> LineIndex<'t> {
    /// The index of a text.
    pub fn new(text: &'t str) -> Self {
        let after_breaks = text.match_indices('\n').map(|(i, _)| i + 1);
        let mut total = 0;
        let mut characters = vec![0];
        for block in text.as_bytes().chunks(BLOCK) {
            total += starts_of_characters(block);
            characters.push(total);
        }
        Self {
            text,
            starts: std::iter::once(0).chain(after_breaks).collect(),
            characters,
        }
    }

    /// The place of a byte offset.
    pub fn place(&self, offset: usize) -> Place {
        let line = self.starts.partition_point(|&start| start <= offset) - 1;
        let column = self.characters_before(offset) - self.characters_before(self.starts[line]);
        Place {
            line: line as u32 + 1,
            column: column as u32 + 1,
        }
    }

    fn characters_before(&self, offset: usize) -> usize {
        let offset = offset.min(self.text.len());
        let block = offset / BLOCK;
        self.characters[block] + starts_of_characters(&self.text.as_bytes()[block * BLOCK..offset])
    }
}

/// Number of UTF-8 characters that start in these bytes.
fn starts_of_characters(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&byte| byte & 0xc0 != 0x80).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_lines_and_characters() {
        let text = format!("{}\näß{}中\n\nx", "é".repeat(700), "a".repeat(3000));
        let index = LineIndex::new(&text);
        let (mut line, mut column) = (1, 1);
        for (offset, c) in text.char_indices() {
            assert_eq!(index.place(offset), Place { line, column });
            (line, column) = if c == '\n' {
                (line + 1, 1)
            } else {
                (line, column + 1)
            };
        }
        assert_eq!(index.place(text.len()), Place { line, column });
    }
}
