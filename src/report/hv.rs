//! The page of a height–velocity map.

use super::figure::Figure;
use super::html::{self, Made, html};

/// Content of the page.
#[derive(Debug)]
pub struct HvPage<'a> {
    /// Heading.
    pub title: &'a str,
    /// What was found, in a sentence, and whether nothing is left open.
    pub verdict: (&'a str, bool),
    /// Large numbers.
    pub facts: &'a [(&'a str, String)],
    /// The map.
    pub figure: &'a Figure,
    /// Header and rows of the boundary's table.
    pub boundary: (Vec<&'a str>, Vec<Vec<String>>),
    /// What the map is, and what it is not.
    pub words: &'a [String],
    /// Where it comes from.
    pub made: &'a Made,
}

/// The page.
pub fn hv_page(page: &HvPage<'_>) -> String {
    let (words, is_whole) = page.verdict;
    let class = if is_whole { "good" } else { "doubtful" };
    let (header, rows) = &page.boundary;
    let numeric: Vec<usize> = (1..header.len()).collect();
    let cell = |text: &String| html! { (text) };
    let rows: Vec<Vec<_>> = rows
        .iter()
        .map(|row| row.iter().map(cell).collect())
        .collect();
    let body = html! {
        (html::header(page.title, class, words))
        (html::facts(page.facts))
        (html::choice())
        (html::figure(page.figure))
        @if !rows.is_empty() {
            (html::section("Boundary", &html::table(header, &numeric, &rows)))
        }
        (html::section("What this is", &html! { @for own in page.words { (html::paragraph(None, own)) } }))
    };
    html::whole(page.title, &body, page.made)
}
