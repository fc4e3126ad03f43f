//! An XML element as seen by the reader: attributes are taken one by one, and those left over or not parsed become
//! findings.

use super::lexical::{
    BOOLEAN, integer_name, is_space, parse_boolean, parse_integer, parse_real, real_name, words,
};
use crate::description::text::LineIndex;
use crate::description::{Finding, FmiVersion, IntegerType, Place, Precision, Rule};
use roxmltree::Node;
use std::cell::RefCell;

/// Data collected during reading besides the values.
pub(super) struct Context<'t> {
    pub(super) version: FmiVersion,
    /// Namespace of the root, and so of all elements of the standard; there should be none.
    pub(super) namespace: Option<String>,
    pub(super) lines: LineIndex<'t>,
    pub(super) findings: RefCell<Vec<Finding>>,
}

impl<'t> Context<'t> {
    pub(super) fn new(text: &'t str, version: FmiVersion, namespace: Option<String>) -> Self {
        Self {
            version,
            namespace,
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
    /// Name of the element; empty, which matches no expected name, if its namespace is not the root's.
    pub(super) fn name(&self) -> &'t str {
        let tag = self.node.tag_name();
        if tag.namespace() == self.context.namespace.as_deref() {
            tag.name()
        } else {
            ""
        }
    }

    /// Version of the standard that the file follows.
    pub(super) fn version(&self) -> FmiVersion {
        self.context.version
    }

    /// Start of its start tag.
    pub(super) fn place(&self) -> Place {
        self.context.lines.place(self.node.range().start)
    }

    /// Records the violation of a rule at this element.
    pub(super) fn report(&self, rule: Rule) {
        self.report_at(self.place(), rule);
    }

    fn report_at(&self, place: Place, rule: Rule) {
        let is_variable = |node: &Node| {
            let parent = node.parent_element();
            parent.is_some_and(|p| p.has_tag_name("ModelVariables"))
        };
        let variable = (self.node.ancestors())
            .find(is_variable)
            .and_then(|n| n.attribute("name"))
            .map(str::to_owned);
        self.context.findings.borrow_mut().push(Finding {
            version: self.context.version,
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

    /// Child elements with that name; others are reported.
    pub(super) fn children_named(&self, name: &'static str) -> Vec<Element<'c, 't>> {
        self.children_in_order(&[&[name]])
    }

    /// Child elements with these names. Elements of one group may come in any order, the groups in the given order;
    /// elements out of order and those with other names are reported.
    pub(super) fn children_in_order(&self, groups: &[&[&'static str]]) -> Vec<Element<'c, 't>> {
        self.no_text();
        let mut last = (0, "");
        let mut children = Vec::new();
        for child in self.children() {
            let Some(group) = groups.iter().position(|g| g.contains(&child.name())) else {
                child.unexpected();
                continue;
            };
            if group < last.0 {
                child.report(Rule::MisplacedElement {
                    element: child.name().to_owned(),
                    after: last.1.to_owned(),
                });
            } else {
                last = (group, child.name());
            }
            children.push(child);
        }
        children
    }

    /// Reports a second element of a name, as the schema allows at most one; returns the first of each.
    pub(super) fn first_of_each(children: Vec<Self>) -> Vec<Self> {
        let mut seen: Vec<&str> = Vec::new();
        let mut first = Vec::new();
        for child in children {
            if seen.contains(&child.name()) {
                child.unexpected();
            } else {
                seen.push(child.name());
                first.push(child);
            }
        }
        first
    }

    /// Reports that this element is not allowed here.
    pub(super) fn unexpected(&self) {
        let parent = self.node.parent_element();
        self.report(Rule::UnexpectedElement {
            parent: parent.map_or("", |p| p.tag_name().name()).to_owned(),
            element: self.node.tag_name().name().to_owned(),
        });
    }

    /// Reports text between the tags, which no element of the standard has.
    pub(super) fn no_text(&self) {
        let text = self.node.children().filter(Node::is_text);
        let words = text.filter_map(|node| words(node.text().unwrap_or_default()).next());
        if let Some(word) = words.into_iter().next() {
            self.report(Rule::UnexpectedText {
                element: self.name().to_owned(),
                text: word.chars().take(20).collect(),
            });
        }
    }

    /// The attribute as written.
    pub(super) fn text(&self, name: &'static str) -> Option<String> {
        self.take(name).map(str::to_owned)
    }

    /// A required attribute; empty if missing.
    pub(super) fn required_text(&self, name: &'static str) -> String {
        self.required(name, self.text(name)).unwrap_or_default()
    }

    /// Reports `name` as missing if there is neither a value nor such an attribute.
    pub(super) fn required<T>(&self, name: &'static str, value: Option<T>) -> Option<T> {
        if value.is_none() && !self.node.has_attribute(name) {
            self.report(Rule::MissingAttribute {
                element: self.name().to_owned(),
                attribute: name,
            });
        }
        value
    }

    /// An attribute parsed by `parse`.
    pub(super) fn parsed<T>(
        &self,
        name: &'static str,
        expected: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Option<T> {
        let text = self.take(name)?;
        let value = parse(text.trim_matches(is_space));
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

    /// A list whose items are parsed by `parse`.
    pub(super) fn list<T>(
        &self,
        name: &'static str,
        expected: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Option<Vec<T>> {
        let expected = format!("a list, each item {expected}");
        self.parsed(name, &expected, |text| words(text).map(&parse).collect())
    }

    /// An `xs:double`.
    pub(super) fn real(&self, name: &'static str) -> Option<f64> {
        self.real_of(name, Precision::Double)
    }

    /// An `xs:double` or `xs:float`.
    pub(super) fn real_of(&self, name: &'static str, precision: Precision) -> Option<f64> {
        self.parsed(name, real_name(precision), |text| {
            parse_real(text, precision)
        })
    }

    /// An integer of that type.
    pub(super) fn integer(&self, name: &'static str, integer: IntegerType) -> Option<i128> {
        self.parsed(name, &integer_name(integer), |text| {
            parse_integer(text, integer)
        })
    }

    /// An `xs:int`.
    pub(super) fn int(&self, name: &'static str) -> Option<i32> {
        let value = self.integer(name, IntegerType::Int32)?;
        i32::try_from(value).ok()
    }

    /// An `xs:unsignedInt`.
    pub(super) fn unsigned(&self, name: &'static str) -> Option<u32> {
        let value = self.integer(name, IntegerType::UInt32)?;
        u32::try_from(value).ok()
    }

    /// An `xs:unsignedLong`.
    pub(super) fn unsigned_long(&self, name: &'static str) -> Option<u64> {
        let value = self.integer(name, IntegerType::UInt64)?;
        u64::try_from(value).ok()
    }

    /// An `xs:boolean`.
    pub(super) fn boolean(&self, name: &'static str) -> Option<bool> {
        self.parsed(name, BOOLEAN, parse_boolean)
    }

    /// An `xs:boolean` that is `false` by default.
    pub(super) fn flag(&self, name: &'static str) -> bool {
        self.boolean(name).unwrap_or(false)
    }

    /// The XML between the tags, unchanged.
    pub(super) fn inner_xml(&self) -> &'t str {
        match (self.node.first_child(), self.node.last_child()) {
            (Some(first), Some(last)) => {
                &self.node.document().input_text()[first.range().start..last.range().end]
            }
            _ => "",
        }
    }

    /// Reports the attributes that were not taken. Those of `xsi` belong to XML Schema; they refer to a schema, or
    /// declare a type that differs from the element's name.
    pub(super) fn finish(&self) {
        const XSI: &str = "http://www.w3.org/2001/XMLSchema-instance";
        let taken = self.taken.borrow();
        for attribute in self.node.attributes() {
            let (element, name) = (self.name().to_owned(), attribute.name().to_owned());
            match attribute.namespace() {
                None if taken.contains(&attribute.name()) => {}
                Some(XSI) if !matches!(attribute.name(), "nil" | "type") => {}
                Some(XSI) => self.report(Rule::SchemaInstance {
                    element,
                    attribute: name,
                }),
                _ => self.report(Rule::UnknownAttribute {
                    element,
                    attribute: name,
                }),
            }
        }
    }

    /// [`finish`](Self::finish) for an element on which the schema allows any attribute. This is meant for attributes
    /// of other standards, in a namespace; others are probably misspelled.
    pub(super) fn finish_open(&self) {
        let taken = self.taken.borrow();
        let plain = self.node.attributes().filter(|a| a.namespace().is_none());
        for attribute in plain.map(|a| a.name()).filter(|name| !taken.contains(name)) {
            let attribute = attribute.to_owned();
            self.report(Rule::UnknownCapability {
                element: self.name().to_owned(),
                attribute,
            });
        }
    }

    /// Whether the attribute exists.
    pub(super) fn has(&self, name: &str) -> bool {
        self.node.has_attribute(name)
    }

    fn take(&self, name: &'static str) -> Option<&'c str> {
        self.taken.borrow_mut().push(name);
        self.node.attribute(name)
    }
}
