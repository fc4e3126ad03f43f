//! XML elements with their places.

use crate::error::{At, SspError};
use pilotage_cosim::description::Transformation;
use pilotage_fmi::description::{self, LineIndex};
use pilotage_text::document::Place;
use pilotage_text::printable::excerpt;
use pilotage_units::Conversion;

/// A parsed file.
pub(crate) struct Xml<'t> {
    file: &'t str,
    lines: LineIndex<'t>,
    document: roxmltree::Document<'t>,
}

/// The text of a file's bytes; without any, that of an empty element.
pub(crate) fn text_of(bytes: &[u8], file: &str) -> Result<String, SspError> {
    let text = description::text_of(bytes).map_err(|error| {
        let text = error.to_string();
        let fault = text.strip_prefix(pilotage_fmi::archive::DESCRIPTION);
        let fault = fault.unwrap_or(&text).trim_start_matches([',', ' ']);
        SspError::Malformed {
            file: file.to_owned(),
            position: None,
            fault: fault.to_owned(),
        }
    });
    Ok(text?.into_owned())
}

impl<'t> Xml<'t> {
    /// Parses a text; `file` is the name used in messages.
    pub(crate) fn parse(text: &'t str, file: &'t str) -> Result<Self, SspError> {
        let document = roxmltree::Document::parse(text).map_err(|error| {
            let at = error.pos();
            SspError::Malformed {
                file: file.to_owned(),
                position: Some((at.row, at.col)),
                fault: format!("not well-formed XML: {error}"),
            }
        })?;
        Ok(Self {
            file,
            lines: LineIndex::new(text),
            document,
        })
    }

    /// The root, which must have that name.
    pub(crate) fn root(&self, name: &'static str) -> Result<Node<'_, 't>, SspError> {
        let node = self.document.root_element();
        let root = Node { node, xml: self };
        match root.name() == name {
            true => Ok(root),
            false => Err(SspError::Element {
                place: root.place(),
                element: root.name().to_owned(),
                fault: format!("expected <{name}>"),
            }),
        }
    }
}

/// An element. Namespaces are not compared: within what is read, local names are unique, and tools err in them.
#[derive(Clone, Copy)]
pub(crate) struct Node<'a, 't> {
    node: roxmltree::Node<'a, 't>,
    xml: &'a Xml<'t>,
}

impl<'a, 't> Node<'a, 't> {
    pub(crate) fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    pub(crate) fn place(&self) -> Place {
        let at = self.xml.lines.place(self.node.range().start);
        Place {
            file: self.xml.file.to_owned(),
            line: at.line as usize,
            column: Some(at.column as usize),
        }
    }

    /// The element under this name, for messages.
    pub(crate) fn at(&self, element: &'static str) -> At {
        At {
            place: self.place(),
            element,
        }
    }

    pub(crate) fn fault(&self, fault: impl Into<String>) -> SspError {
        SspError::Element {
            place: self.place(),
            element: self.name().to_owned(),
            fault: fault.into(),
        }
    }

    /// The text inside.
    pub(crate) fn text(&self) -> &'a str {
        self.node.text().unwrap_or_default()
    }

    /// An attribute without namespace.
    pub(crate) fn attribute(&self, name: &str) -> Option<&'a str> {
        self.node.attribute(name)
    }

    /// Names of the attributes without namespace.
    pub(crate) fn attributes(&self) -> impl Iterator<Item = &'a str> + use<'a, 't> {
        let plain = self
            .node
            .attributes()
            .filter(|own| own.namespace().is_none());
        plain.map(|own| own.name())
    }

    pub(crate) fn required(&self, name: &str) -> Result<&'a str, SspError> {
        let value = self.attribute(name);
        value.ok_or_else(|| self.fault(format!("the attribute `{name}` is missing")))
    }

    /// A name: not empty.
    pub(crate) fn named(&self) -> Result<&'a str, SspError> {
        match self.required("name")? {
            "" => Err(self.fault("the attribute `name` is empty")),
            name => Ok(name),
        }
    }

    /// A number, or a default where there is none.
    pub(crate) fn number(&self, name: &str, default: f64) -> Result<f64, SspError> {
        let Some(text) = self.attribute(name) else {
            return Ok(default);
        };
        let number = text.trim().parse().ok().filter(|own: &f64| own.is_finite());
        number.ok_or_else(|| {
            let shown = excerpt(text);
            self.fault(format!("`{name}` is `{shown}`; expected a number"))
        })
    }

    pub(crate) fn boolean(&self, name: &str) -> Result<bool, SspError> {
        match self.attribute(name).map(str::trim) {
            None | Some("false" | "0") => Ok(false),
            Some("true" | "1") => Ok(true),
            Some(text) => {
                let shown = excerpt(text);
                Err(self.fault(format!("`{name}` is `{shown}`; expected true or false")))
            }
        }
    }

    pub(crate) fn children(&self) -> impl Iterator<Item = Node<'a, 't>> + use<'a, 't> {
        let xml = self.xml;
        let elements = self.node.children().filter(roxmltree::Node::is_element);
        elements.map(move |node| Node { node, xml })
    }

    /// Children of that name.
    pub(crate) fn all(
        &self,
        name: &'static str,
    ) -> impl Iterator<Item = Node<'a, 't>> + use<'a, 't> {
        self.children().filter(move |child| child.name() == name)
    }

    /// The first child of that name.
    pub(crate) fn child(&self, name: &'static str) -> Option<Node<'a, 't>> {
        self.all(name).next()
    }

    /// Children of that name in a list of another.
    pub(crate) fn listed(
        &self,
        list: &'static str,
        name: &'static str,
    ) -> impl Iterator<Item = Node<'a, 't>> + use<'a, 't> {
        self.all(list).flat_map(move |list| list.all(name))
    }

    /// The system with that id anywhere in the document.
    pub(crate) fn system_of_id(&self, id: &str) -> Option<Node<'a, 't>> {
        let xml = self.xml;
        let mut all = xml.document.descendants();
        let found =
            all.find(|node| node.tag_name().name() == "System" && node.attribute("id") == Some(id));
        found.map(|node| Node { node, xml })
    }

    /// The first element of that name anywhere below.
    pub(crate) fn below(&self, name: &str) -> Option<Node<'a, 't>> {
        let xml = self.xml;
        let mut all = self.node.descendants();
        let found = all.find(|node| node.tag_name().name() == name);
        found.map(|node| Node { node, xml })
    }

    /// Types of the annotations anywhere below.
    pub(crate) fn annotations(&self) -> impl Iterator<Item = &'a str> + use<'a, 't> {
        let all = self.node.descendants();
        let all = all.filter(|node| node.tag_name().name() == "Annotation");
        all.filter_map(|node| node.attribute("type"))
    }

    /// What a connection or a mapping does with values.
    pub(crate) fn transformation(&self) -> Result<Transformation, SspError> {
        Ok(Transformation {
            linear: self.linear()?,
            converts_units: !self.boolean("suppressUnitConversion")?,
            map: self.map()?,
        })
    }

    /// The Boolean, integer or enumeration mapping of a connection or a mapping (sections 4.5.2.2 to 4.5.2.4).
    fn map(&self) -> Result<Vec<(String, String)>, SspError> {
        let ending = "MappingTransformation";
        let Some(table) = self.children().find(|own| own.name().ends_with(ending)) else {
            return Ok(Vec::new());
        };
        let is_boolean = table.name() == "BooleanMappingTransformation";
        let plain = |text: &str| plain_value(text, is_boolean);
        let pair = |own: Node| {
            let (source, target) = (own.required("source")?, own.required("target")?);
            Ok((plain(source), plain(target)))
        };
        table.all("MapEntry").map(pair).collect()
    }

    /// The linear transformation of a connection or a mapping (section 4.5.2.1).
    fn linear(&self) -> Result<Conversion, SspError> {
        let Some(own) = self.child("LinearTransformation") else {
            return Ok(Conversion::NONE);
        };
        Ok(Conversion {
            factor: own.number("factor", 1.0)?,
            offset: own.number("offset", 0.0)?,
        })
    }
}

/// A Boolean as `true` or `false`, any other value as it is.
pub(crate) fn plain_value(text: &str, is_boolean: bool) -> String {
    match (is_boolean, text.trim()) {
        (true, "1") => "true".to_owned(),
        (true, "0") => "false".to_owned(),
        (_, text) => text.to_owned(),
    }
}
