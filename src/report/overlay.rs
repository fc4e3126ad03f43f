//! The report page of a fit: verdict, figures of recorded and modelled signals, tables.

use super::figure::Figure;
use super::formula::transfer_function;
use super::html::{self, Html, Made, html, paragraph};

/// Contents of the report page of a fit.
#[derive(Debug, Clone)]
pub struct Overlay<'a> {
    /// Title of the page.
    pub title: &'a str,
    /// CSS class (`good`, `doubtful` or `bad`) and text of the verdict.
    pub ending: (&'a str, &'a str),
    /// Code and text of each diagnostic.
    pub diagnostics: Vec<(String, String)>,
    /// Names and values of the main figures.
    pub facts: Vec<(&'a str, String)>,
    /// θ of a linear pilot, shown as its transfer function.
    pub formula: Option<Vec<f64>>,
    /// A sentence about the uncertainty.
    pub sureness: String,
    /// The figures, in page order.
    pub figures: Vec<Figure>,
    /// Tables after the figures, the parameters first.
    pub tables: Vec<(&'a str, Parameters)>,
}

/// A table on a page.
#[derive(Debug, Clone)]
pub struct Parameters {
    /// Column headings.
    pub header: Vec<&'static str>,
    /// Indices of the numeric columns.
    pub numeric: Vec<usize>,
    /// Cells of the rows.
    pub rows: Vec<Vec<String>>,
    /// Notes below the table.
    pub notes: Vec<String>,
}

/// The page as a self-contained HTML file.
pub fn overlay_page(page: &Overlay<'_>, made: &Made) -> String {
    let (class, verdict) = page.ending;
    let body = html! {
        (html::header(page.title, class, verdict))
        @for (code, words) in &page.diagnostics { (html::diagnostic("caution", code, words)) }
        @if let Some(theta) = &page.formula { div class="formula" { (transfer_function(theta)) } }
        (html::facts(&page.facts))
        (paragraph(None, &page.sureness))
        (html::choice())
        @for figure in &page.figures { (html::figure(figure)) }
        @for (title, own) in &page.tables { (html::section(title, &table(own))) }
    };
    html::whole(page.title, &body, made)
}

/// A table with its notes; numbers have a true minus sign, and exponents as superscripts.
pub(super) fn table(own: &Parameters) -> Html {
    let cell = |(k, text): (usize, &String)| match own.numeric.contains(&k) {
        true => super::number::marked_up(text),
        false => html! { (text) },
    };
    let rows: Vec<Vec<Html>> = (own.rows.iter())
        .map(|row| row.iter().enumerate().map(cell).collect())
        .collect();
    html! {
        (html::table(&own.header, &own.numeric, &rows))
        @for note in &own.notes { (paragraph(None, note)) }
    }
}
