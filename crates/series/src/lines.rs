//! A reader that passes text on line by line.

use std::io::{self, BufRead, Read};

/// Passes on one line per read. A parser that reads from it has thus never seen more than line
/// [`number`](Self::number), so that error messages can refer to that line. A file of any length is read once; only one
/// line and the comments are kept in memory.
///
/// A read fails at bytes that are not UTF-8 and at lines that are too long. The byte-order mark that spreadsheets put
/// in front is skipped.
pub struct Lines<R> {
    from: R,
    line: Vec<u8>,
    handed: usize,
    /// Number of the last line passed on, from 1; 0 before the first.
    pub number: usize,
    /// Number of quotes so far, outside comments.
    pub quotes: usize,
    /// The first comment lines, at most ten thousand, without the leading `#` and surrounding space.
    pub comments: Vec<String>,
    /// The first byte of the last line that is not UTF-8, if any.
    pub wrong: Option<u8>,
    /// Whether reading stopped because the last line is longer than lines of a table are.
    pub is_endless: bool,
}

/// Maximum length of a line in bytes, enough for a million cells.
pub(crate) const LONGEST: u64 = 1 << 24;

/// Number of comment lines that are kept: headers have some ten, and a file of comments alone must not fill the memory.
pub(crate) const COMMENTS: usize = 10_000;

impl<R: BufRead> Lines<R> {
    /// Starts at the first line.
    pub fn new(from: R) -> Self {
        Self {
            from,
            line: Vec::new(),
            handed: 0,
            number: 0,
            quotes: 0,
            comments: Vec::new(),
            wrong: None,
            is_endless: false,
        }
    }

    /// What stands between cells: the first comma, semicolon or tab outside quotes in the first line with cells, which is then
    /// read next; comma if there is none. A line `sep=;` above, as spreadsheets write it, says so itself.
    ///
    /// # Errors
    /// As a read.
    pub(crate) fn separator(&mut self) -> io::Result<u8> {
        loop {
            self.next_line()?;
            let text = &self.line[self.handed..];
            if text.starts_with(b"#") || (!text.is_empty() && text.trim_ascii().is_empty()) {
                continue;
            }
            if let Some(said) = text.strip_prefix(b"sep=").map(|rest| rest.trim_ascii_end()) {
                let said = match (said, text.get(4)) {
                    (b"", Some(b'\t')) => Some(b'\t'),
                    (&[sign @ (b',' | b';')], _) => Some(sign),
                    _ => None,
                };
                if let Some(sign) = said {
                    self.handed = self.line.len();
                    return Ok(sign);
                }
            }
            // UTF-16 without its mark, in which every other byte of plain text is 0.
            if text.contains(&0) {
                self.wrong = Some(0);
                return Err(io::ErrorKind::InvalidData.into());
            }
            let mut is_quoted = false;
            let between = text.iter().find(|byte| {
                is_quoted ^= **byte == b'"';
                !is_quoted && b",;\t".contains(byte)
            });
            return Ok(between.copied().unwrap_or(b','));
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
            // The parser recognizes a comment only if its line is terminated.
            self.line.push(b'\n');
        }
        let text = std::str::from_utf8(&self.line).map_err(|error| {
            self.wrong = Some(self.line[error.valid_up_to()]);
            io::Error::from(io::ErrorKind::InvalidData)
        })?;
        if self.number == 1 && text.starts_with('\u{feff}') {
            self.handed = '\u{feff}'.len_utf8();
        }
        let is_kept = self.comments.len() < COMMENTS;
        match text[self.handed..].strip_prefix('#') {
            Some(comment) if is_kept => self.comments.push(comment.trim().to_owned()),
            Some(_) => {}
            None => self.quotes += text.bytes().filter(|own| *own == b'"').count(),
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
