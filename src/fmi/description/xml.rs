//! XML text made element by element: indentation, escaping and the lexical forms of XML Schema.

use std::fmt::Write;

/// An XML document under construction.
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
    /// The last start tag still lacks its `>` or `/>`.
    pending: bool,
}

impl Xml {
    /// An empty document with its XML declaration.
    pub(super) fn new() -> Self {
        Self {
            text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned(),
            open: Vec::new(),
            pending: false,
        }
    }

    /// Opens an element.
    pub(super) fn open(&mut self, name: &'static str) {
        self.finish_tag("\n");
        self.indent();
        self.text.push('<');
        self.text.push_str(name);
        self.open.push(name);
        self.pending = true;
    }

    /// Closes the innermost element.
    pub(super) fn close(&mut self) {
        let Some(name) = self.open.pop() else { return };
        if self.pending {
            self.pending = false;
            self.text.push_str("/>\n");
        } else {
            self.indent();
            let _ = writeln!(self.text, "</{name}>");
        }
    }

    /// Closes the innermost element with `content` as it stands between its tags.
    pub(super) fn close_with(&mut self, content: &str) {
        if content.is_empty() {
            return self.close();
        }
        self.finish_tag("");
        self.text.push_str(content);
        if let Some(name) = self.open.pop() {
            let _ = writeln!(self.text, "</{name}>");
        }
    }

    /// An attribute of the element opened last.
    pub(super) fn text(&mut self, name: &str, value: &str) {
        let _ = write!(self.text, " {name}=\"");
        escape_into(&mut self.text, value);
        self.text.push('"');
    }

    /// An attribute that may be absent.
    pub(super) fn text_if(&mut self, name: &str, value: Option<&str>) {
        if let Some(value) = value {
            self.text(name, value);
        }
    }

    /// An `xs:double` attribute that may be absent.
    pub(super) fn real_if(&mut self, name: &str, value: Option<f64>) {
        if let Some(value) = value {
            self.text(name, &xs_double(value));
        }
    }

    /// An integer attribute that may be absent.
    pub(super) fn int_if(&mut self, name: &str, value: Option<impl Into<i64>>) {
        if let Some(value) = value {
            self.text(name, &value.into().to_string());
        }
    }

    /// An `xs:boolean` attribute that may be absent.
    pub(super) fn bool_if(&mut self, name: &str, value: Option<bool>) {
        if let Some(value) = value {
            self.text(name, if value { "true" } else { "false" });
        }
    }

    /// An `xs:boolean` attribute whose default is `false`, written only if `true`.
    pub(super) fn flag(&mut self, name: &str, value: bool) {
        self.bool_if(name, value.then_some(true));
    }

    /// The finished document.
    pub(super) fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        self.text
    }

    fn finish_tag(&mut self, after: &str) {
        if std::mem::take(&mut self.pending) {
            self.text.push('>');
            self.text.push_str(after);
        }
    }

    fn indent(&mut self) {
        for _ in &self.open {
            self.text.push_str("  ");
        }
    }
}

/// `value` as `xs:double`: `INF`, `-INF`, `NaN`, else the shortest decimal that reads back as the
/// same number.
pub(super) fn xs_double(value: f64) -> String {
    if value.is_nan() {
        "NaN".to_owned()
    } else if value.is_infinite() {
        if value > 0.0 { "INF" } else { "-INF" }.to_owned()
    } else if value != 0.0 && !(1e-5..1e16).contains(&value.abs()) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// Appends an attribute's value. White space other than a blank is written as a reference, since a
/// reader would turn it into a blank; characters that XML 1.0 forbids become U+FFFD.
fn escape_into(out: &mut String, value: &str) {
    for c in value.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' => out.push_str("&#9;"),
            '\n' => out.push_str("&#10;"),
            '\r' => out.push_str("&#13;"),
            '\0'..='\x1f' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
}
