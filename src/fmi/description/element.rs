//! One XML element as the reader sees it: attributes are taken one by one, and what is left over or
//! does not parse becomes a finding.

use super::text::LineIndex;
use super::{Finding, Place, Rule};
use roxmltree::Node;
use std::cell::RefCell;

/// What reading gathers besides the values.
pub(super) struct Context<'t> {
    pub(super) lines: LineIndex<'t>,
    pub(super) findings: RefCell<Vec<Finding>>,
}

impl<'t> Context<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Self {
            lines: LineIndex::new(text),
            findings: RefCell::new(Vec::new()),
        }
    }

    /// The element of a node.
    pub(super) fn element<'c>(&'c self, node: Node<'c, 't>) -> Element<'c, 't> {
        Element {
            context: self,
            node,
            taken: RefCell::new(Vec::new()),
        }
    }
}

/// An element whose attributes are being read.
pub(super) struct Element<'c, 't> {
    context: &'c Context<'t>,
    node: Node<'c, 't>,
    taken: RefCell<Vec<&'static str>>,
}

impl<'c, 't> Element<'c, 't> {
    /// Name of the element.
    pub(super) fn name(&self) -> &'t str {
        self.node.tag_name().name()
    }

    /// Where its start tag begins.
    pub(super) fn place(&self) -> Place {
        self.context.lines.place(self.node.range().start)
    }

    /// Notes a broken rule at this element.
    pub(super) fn report(&self, rule: Rule) {
        self.report_at(self.place(), rule);
    }

    fn report_at(&self, place: Place, rule: Rule) {
        let variable = self
            .node
            .ancestors()
            .find(|n| n.has_tag_name("ScalarVariable"))
            .and_then(|n| n.attribute("name"))
            .map(str::to_owned);
        self.context.findings.borrow_mut().push(Finding {
            place,
            variable,
            rule,
        });
    }

    /// Child elements.
    pub(super) fn children(&self) -> impl Iterator<Item = Element<'c, 't>> + use<'c, 't> {
        let context = self.context;
        self.node
            .children()
            .filter(Node::is_element)
            .map(|node| context.element(node))
    }

    /// Child elements of that name; others are reported.
    pub(super) fn children_named(&self, name: &'static str) -> Vec<Element<'c, 't>> {
        let (wanted, others): (Vec<_>, Vec<_>) = self.children().partition(|e| e.name() == name);
        others.iter().for_each(|other| other.unexpected());
        wanted
    }

    /// Reports that this element does not belong here.
    pub(super) fn unexpected(&self) {
        let parent = self.node.parent_element();
        self.report(Rule::UnexpectedElement {
            parent: parent.map_or("", |p| p.tag_name().name()).to_owned(),
            element: self.name().to_owned(),
        });
    }

    /// The attribute as it stands.
    pub(super) fn text(&self, name: &'static str) -> Option<String> {
        self.take(name).map(str::to_owned)
    }

    /// An attribute that must be there; empty if it is not.
    pub(super) fn required_text(&self, name: &'static str) -> String {
        self.required(name, self.text(name)).unwrap_or_default()
    }

    /// Reports `name` as missing if there is no value *and* no such attribute.
    pub(super) fn required<T>(&self, name: &'static str, value: Option<T>) -> Option<T> {
        if value.is_none() && !self.node.has_attribute(name) {
            self.report(Rule::MissingAttribute {
                element: self.name().to_owned(),
                attribute: name,
            });
        }
        value
    }

    /// An attribute that `parse` understands.
    pub(super) fn parsed<T>(
        &self,
        name: &'static str,
        expected: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Option<T> {
        let text = self.take(name)?;
        let value = parse(text.trim());
        if value.is_none() {
            let attribute = self.node.attribute_node(name);
            let place = attribute.map(|a| self.context.lines.place(a.range().start));
            self.report_at(
                place.unwrap_or_else(|| self.place()),
                Rule::BadValue {
                    element: self.name().to_owned(),
                    attribute: name.to_owned(),
                    found: text.to_owned(),
                    expected: expected.to_owned(),
                },
            );
        }
        value
    }

    /// An `xs:double`.
    pub(super) fn real(&self, name: &'static str) -> Option<f64> {
        self.parsed(name, "a number (xs:double)", parse_double)
    }

    /// An `xs:int`.
    pub(super) fn int(&self, name: &'static str) -> Option<i32> {
        self.parsed(name, "a 32-bit integer", |text| text.parse().ok())
    }

    /// An `xs:unsignedInt`.
    pub(super) fn unsigned(&self, name: &'static str) -> Option<u32> {
        self.parsed(name, "an unsigned 32-bit integer", |text| text.parse().ok())
    }

    /// An `xs:boolean`.
    pub(super) fn boolean(&self, name: &'static str) -> Option<bool> {
        self.parsed(name, "true or false", |text| match text {
            "true" | "1" => Some(true),
            "false" | "0" => Some(false),
            _ => None,
        })
    }

    /// An `xs:boolean` that is `false` by default.
    pub(super) fn flag(&self, name: &'static str) -> bool {
        self.boolean(name).unwrap_or(false)
    }

    /// The XML between the tags, as it stands.
    pub(super) fn inner_xml(&self) -> &'t str {
        match (self.node.first_child(), self.node.last_child()) {
            (Some(first), Some(last)) => {
                &self.node.document().input_text()[first.range().start..last.range().end]
            }
            _ => "",
        }
    }

    /// Reports the attributes that nobody took. Attributes of other namespaces are nobody's business.
    pub(super) fn finish(&self) {
        let taken = self.taken.borrow();
        for attribute in self.node.attributes() {
            if attribute.namespace().is_none() && !taken.contains(&attribute.name()) {
                self.report(Rule::UnknownAttribute {
                    element: self.name().to_owned(),
                    attribute: attribute.name().to_owned(),
                });
            }
        }
    }

    fn take(&self, name: &'static str) -> Option<&'c str> {
        self.taken.borrow_mut().push(name);
        self.node.attribute(name)
    }
}

/// Parses an `xs:double`: `INF`, `-INF`, `NaN` or a decimal. Rust's own parser would also accept
/// `inf` and `nan`.
fn parse_double(text: &str) -> Option<f64> {
    match text {
        "INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        _ if text
            .bytes()
            .any(|b| b.is_ascii_alphabetic() && !matches!(b, b'e' | b'E')) =>
        {
            None
        }
        _ => text.parse().ok(),
    }
}
