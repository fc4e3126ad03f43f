//! The page of a fitted problem: the verdict, figures of what was recorded and what the model says, tables.

use super::figure::Figure;
use super::html::{self, Made};

/// What the page of a fit says.
#[derive(Debug, Clone)]
pub struct Overlay<'a> {
    /// What was fitted.
    pub title: &'a str,
    /// How it ended, and the class of that: `good`, `doubtful` or `bad`.
    pub ending: (&'a str, &'a str),
    /// What speaks against it: code, words.
    pub diagnostics: Vec<(String, String)>,
    /// A few numbers with their names.
    pub facts: Vec<(&'a str, String)>,
    /// How sure it is, in a sentence.
    pub sureness: String,
    /// The figures, in this order.
    pub figures: Vec<Figure>,
    /// Tables behind the figures, the parameters first.
    pub tables: Vec<(&'a str, Parameters)>,
}

/// A table of a page.
#[derive(Debug, Clone)]
pub struct Parameters {
    /// What the columns are.
    pub header: Vec<&'static str>,
    /// Which of them are numbers.
    pub numeric: Vec<usize>,
    /// Their cells.
    pub rows: Vec<Vec<String>>,
    /// What is said below.
    pub notes: Vec<String>,
}

/// The section of a fit that was solved again; nothing where it was not.
pub(super) fn refits(own: Option<&Parameters>) -> String {
    own.map_or(String::new(), |own| {
        html::section("Profiles and bootstrap", &table(own))
    })
}

/// The page, one file that needs nothing beside it.
pub fn overlay_page(page: &Overlay<'_>, made: &Made) -> String {
    let (class, verdict) = page.ending;
    let mut body = html::header(&html::escape(page.title), class, verdict);
    for (code, words) in &page.diagnostics {
        let words = html::escape(words);
        body += &format!("<p class=\"caution\"><b>{code}</b>: {words}.</p>\n");
    }
    body += &html::facts(&page.facts);
    body += &format!("<p>{}</p>\n", html::escape(&page.sureness));
    body += html::choice();
    body += &page.figures.iter().map(html::figure).collect::<String>();
    for (title, own) in &page.tables {
        body += &html::section(title, &table(own));
    }
    html::whole(page.title, &body, made)
}

/// A table with its notes; numbers have a true minus sign and powers of ten as such.
fn table(own: &Parameters) -> String {
    let cell = |(k, text): (usize, &String)| match own.numeric.contains(&k) {
        true => super::number::marked_up(text),
        false => html::escape(text),
    };
    let rows: Vec<Vec<String>> = (own.rows.iter())
        .map(|row| row.iter().enumerate().map(cell).collect())
        .collect();
    let notes = own
        .notes
        .iter()
        .map(|note| format!("<p>{}</p>\n", html::escape(note)));
    html::table(&own.header, &own.numeric, &rows) + &notes.collect::<String>()
}
