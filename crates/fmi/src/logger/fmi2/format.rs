//! Which formats of `printf` may be handed to the C library.

use super::LONGEST;

/// Highest number of an argument that a conversion may name (`%2$s`), and of conversions: the C library takes 2 ms for a
/// `long double` of 5000 digits.
const MOST_ARGUMENTS: usize = 99;

/// Whether each conversion of a format is one that is known to read a value and to write text (ISO C17, section
/// 7.21.6.1; POSIX adds `C`, `S`, `m`, `'` and arguments by number), there are not too many of them, and all widths and
/// precisions together are below the maximum length of a message: the C library would take seconds for a width of 2147483647.
/// Whatever else there is, such as `n` and the extensions of some C library, is not harmless, nor is a width or precision
/// that is a value (`*`), but for the precision of a string.
pub(super) fn is_harmless(format: &[u8]) -> bool {
    let mut rest = format;
    let mut room = LONGEST;
    let mut conversions = 0;
    while let Some(at) = rest.iter().position(|&byte| byte == b'%') {
        rest = &rest[at + 1..];
        let Some(length) = conversion(&mut rest).filter(|&length| length < room) else {
            return false;
        };
        room -= length;
        conversions += 1;
    }
    conversions <= MOST_ARGUMENTS
}

/// Reads a conversion behind its `%`; returns the sum of its width and precision. `None` if it is not harmless.
fn conversion(rest: &mut &[u8]) -> Option<usize> {
    let behind = *rest;
    let argument = number(rest);
    match rest.strip_prefix(b"$") {
        Some(after) if (1..=MOST_ARGUMENTS).contains(&argument?) => *rest = after,
        Some(_) => return None,
        // It was the width, or a flag before it.
        None => *rest = behind,
    }
    skip(rest, |byte| b"#0- +'".contains(&byte));
    let mut length = number(rest)?;
    let mut is_given = false;
    if let Some(after) = rest.strip_prefix(b".") {
        *rest = after;
        match rest.strip_prefix(b"*") {
            Some(after) => (*rest, is_given) = (after, true),
            None => length += number(rest)?,
        }
    }
    let sizes = [&b"hh"[..], b"ll", b"h", b"l", b"j", b"z", b"t", b"L"];
    *rest = sizes
        .iter()
        .find_map(|size| rest.strip_prefix(*size))
        .unwrap_or(rest);
    let (kind, after) = rest.split_first()?;
    *rest = after;
    let kinds: &[u8] = match is_given {
        // A precision only shortens a string, whatever its value.
        true => b"sS",
        false => b"diouxXeEfFgGaAcCsSpm%",
    };
    kinds.contains(kind).then_some(length)
}

/// Skips bytes.
fn skip(rest: &mut &[u8], is_one: impl Fn(u8) -> bool) {
    let n = rest.iter().take_while(|&&byte| is_one(byte)).count();
    *rest = &rest[n..];
}

/// Reads a number of any length; 0 if there is none, `None` if it is not below the maximum length of a message.
fn number(rest: &mut &[u8]) -> Option<usize> {
    let behind = *rest;
    skip(rest, |byte| byte.is_ascii_digit());
    let digits = &behind[..behind.len() - rest.len()];
    digits.iter().try_fold(0, |value, digit| {
        Some(10 * value + usize::from(digit - b'0')).filter(|&value| value < LONGEST)
    })
}

#[cfg(test)]
mod tests;
