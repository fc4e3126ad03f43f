//! XML text built element by element: indentation, escaping and the lexical forms of XML Schema.

use quick_xml::Writer;
use quick_xml::events::attributes::Attribute;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use quick_xml::name::QName;
use std::fmt::{Display, LowerExp};

/// An XML document under construction.
pub struct Xml {
    writer: Writer<Vec<u8>>,
    open: Vec<&'static str>,
    /// The last start tag, to which attributes may still be added.
    pending: Option<BytesStart<'static>>,
}

impl Default for Xml {
    fn default() -> Self {
        Self::new()
    }
}

impl Xml {
    /// An empty document with the XML declaration.
    pub fn new() -> Self {
        let mut xml = Self {
            writer: Writer::new_with_indent(Vec::new(), b' ', 2),
            open: Vec::new(),
            pending: None,
        };
        xml.write(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
        xml
    }

    /// Opens an element.
    pub fn open(&mut self, name: &'static str) {
        self.finish_tag();
        self.open.push(name);
        self.pending = Some(BytesStart::new(name));
    }

    /// Closes the innermost element.
    pub fn close(&mut self) {
        let Some(name) = self.open.pop() else { return };
        match self.pending.take() {
            Some(start) => self.write(Event::Empty(start)),
            None => self.write(Event::End(BytesEnd::new(name))),
        }
    }

    /// Closes the innermost element, with `content` written unchanged between its tags.
    pub(super) fn close_with(&mut self, content: &str) {
        if !content.is_empty() {
            self.finish_tag();
            self.write(Event::Text(BytesText::from_escaped(content)));
        }
        self.close();
    }

    /// An attribute of the element that was opened last.
    pub fn text(&mut self, name: &str, value: &str) {
        if let Some(start) = &mut self.pending {
            start.push_attribute(Attribute {
                key: QName(name),
                value: escaped(value).into(),
            });
        }
    }

    /// An optional attribute.
    pub fn text_if(&mut self, name: &str, value: Option<&str>) {
        if let Some(value) = value {
            self.text(name, value);
        }
    }

    /// An optional `xs:double` attribute.
    pub fn real_if(&mut self, name: &str, value: Option<f64>) {
        if let Some(value) = value {
            self.text(name, &xs_float(value));
        }
    }

    /// An optional integer attribute.
    pub(super) fn int_if(&mut self, name: &str, value: Option<impl Into<i128>>) {
        if let Some(value) = value {
            self.text(name, &value.into().to_string());
        }
    }

    /// An optional `xs:boolean` attribute.
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
    pub fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        let mut text = String::from_utf8_lossy(self.writer.get_ref()).into_owned();
        text.push('\n');
        text
    }

    fn finish_tag(&mut self) {
        if let Some(start) = self.pending.take() {
            self.write(Event::Start(start));
        }
    }

    fn write(&mut self, event: Event<'_>) {
        // Writing to memory cannot fail.
        let _ = self.writer.write_event(event);
    }
}

/// `value` as `xs:double` or `xs:float`: `INF`, `-INF`, `NaN`, else the shortest decimal that reads back as the same
/// number of its type.
pub(super) fn xs_float<T: Copy + Into<f64> + Display + LowerExp>(value: T) -> String {
    let wide: f64 = value.into();
    if wide.is_nan() {
        "NaN".to_owned()
    } else if wide.is_infinite() {
        if wide > 0.0 { "INF" } else { "-INF" }.to_owned()
    } else if wide != 0.0 && !(1e-5..1e16).contains(&wide.abs()) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// Escapes the value of an attribute. White space other than a space becomes a character reference, since a reader
/// would turn it into a space; characters forbidden in XML 1.0 become U+FFFD.
fn escaped(value: &str) -> String {
    let mut out = String::with_capacity(value.len());
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
    out
}
