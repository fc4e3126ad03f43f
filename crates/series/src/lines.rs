//! Text that is handed on line by line.

use std::io::{self, BufRead, Read};

/// Hands on one line at each read, so that a parser which reads from it has never seen more than line
/// [`number`](Self::number): where a message points to. A file is read once, whatever its length, and no
/// more than one line of it is kept, but for its comments.
///
/// A read fails at bytes that are not UTF-8 and at lines that do not end; the byte-order mark that spreadsheets put in front is left out.
pub struct Lines<R> {
    from: R,
    line: Vec<u8>,
    handed: usize,
    /// The line handed on last, counted from 1; 0 before the first.
    pub number: usize,
    /// Lines so far that begin with `#`, without it and the space around.
    pub comments: Vec<String>,
    /// The byte of the last line that is not UTF-8, if there is one.
    pub wrong: Option<u8>,
    /// Whether the last line was given up: it is longer than lines of a table are.
    pub is_endless: bool,
}

/// The longest line that is read, in bytes: a million cells.
pub(crate) const LONGEST: u64 = 1 << 24;

impl<R: BufRead> Lines<R> {
    /// From the first line on.
    pub fn new(from: R) -> Self {
        Self {
            from,
            line: Vec::new(),
            handed: 0,
            number: 0,
            comments: Vec::new(),
            wrong: None,
            is_endless: false,
        }
    }

    fn next_line(&mut self) -> io::Result<()> {
        self.line.clear();
        self.handed = 0;
        let mut from = self.from.by_ref().take(LONGEST);
        if from.read_until(b'\n', &mut self.line)? == 0 {
            return Ok(());
        }
        self.number += 1;
        self.is_endless = from.limit() == 0 && self.line.last() != Some(&b'\n');
        if self.is_endless {
            return Err(io::ErrorKind::InvalidData.into());
        }
        if self.line.last() != Some(&b'\n') {
            // The parser takes a comment for one where it ends.
            self.line.push(b'\n');
        }
        let text = std::str::from_utf8(&self.line).map_err(|error| {
            self.wrong = Some(self.line[error.valid_up_to()]);
            io::Error::from(io::ErrorKind::InvalidData)
        })?;
        if self.number == 1 && text.starts_with('\u{feff}') {
            self.handed = '\u{feff}'.len_utf8();
        }
        if let Some(comment) = text[self.handed..].strip_prefix('#') {
            self.comments.push(comment.trim().to_owned());
        }
        Ok(())
    }
}

impl<R: BufRead> Read for Lines<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.handed == self.line.len() {
            self.next_line()?;
        }
        let rest = &self.line[self.handed..];
        let n = rest.len().min(to.len());
        to[..n].copy_from_slice(&rest[..n]);
        self.handed += n;
        Ok(n)
    }
}
