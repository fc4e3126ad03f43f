//! Pages with a verdict, figures, tables and words.

use super::figure::Figure;
use super::html::{self, Made, html};

/// Header and rows of a table.
pub type Table<'a> = (Vec<&'a str>, Vec<Vec<String>>);

/// Content of a page.
#[derive(Debug)]
pub struct PlainPage<'a> {
    /// Heading.
    pub title: &'a str,
    /// What was found, in a sentence, and whether nothing is left open.
    pub verdict: (&'a str, bool),
    /// Large numbers.
    pub facts: &'a [(&'a str, String)],
    /// Figures.
    pub figures: &'a [Figure],
    /// Tables: heading, header and rows; without rows it is left out.
    pub tables: Vec<(&'a str, Table<'a>)>,
    /// Heading and paragraphs of what it is, and what it is not.
    pub words: (&'a str, &'a [String]),
    /// Where it comes from.
    pub made: &'a Made,
}

/// The page.
pub fn plain_page(page: &PlainPage<'_>) -> String {
    let (words, is_whole) = page.verdict;
    let class = if is_whole { "good" } else { "doubtful" };
    let cell = |text: &String| html! { (text) };
    let table = |header: &[&str], rows: &[Vec<String>]| {
        let numeric: Vec<usize> = (1..header.len()).collect();
        let row = |row: &Vec<String>| row.iter().map(cell).collect();
        let rows: Vec<Vec<_>> = rows.iter().map(row).collect();
        html::table(header, &numeric, &rows)
    };
    let body = html! {
        (html::header(page.title, class, words))
        (html::facts(page.facts))
        (html::choice())
        @for own in page.figures { (html::figure(own)) }
        @for (title, (header, rows)) in page.tables.iter().filter(|own| !own.1.1.is_empty()) {
            (html::section(title, &table(header, rows)))
        }
        (html::section(page.words.0, &html! { @for own in page.words.1 { (html::paragraph(None, own)) } }))
    };
    html::whole(page.title, &body, page.made)
}
