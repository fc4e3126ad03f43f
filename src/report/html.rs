//! Building blocks of HTML pages.

use super::figure::Figure;
use super::palette;

pub use pilotage_text::printable::markup as escape;

/// A table: header cells, then rows of cells. Cells are already HTML; columns in `numeric` are right-aligned.
pub fn table(header: &[&str], numeric: &[usize], rows: &[Vec<String>]) -> String {
    let class = |i: &usize| {
        if numeric.contains(i) {
            " class=\"n\""
        } else {
            ""
        }
    };
    let mut html = String::from("<div class=\"scroll\"><table>\n<thead><tr>");
    for (i, head) in header.iter().enumerate() {
        html += &format!("<th{}>{head}</th>", class(&i));
    }
    html += "</tr></thead>\n<tbody>\n";
    for row in rows {
        html += "<tr>";
        for (i, cell) in row.iter().enumerate() {
            html += &format!("<td{}>{cell}</td>", class(&i));
        }
        html += "</tr>\n";
    }
    html + "</tbody></table></div>\n"
}

/// Origin of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// The command, as it can be typed again.
    pub command: String,
    /// Date and time.
    pub date: String,
}

impl Made {
    fn footer(&self) -> String {
        let (version, date) = (env!("CARGO_PKG_VERSION"), escape(&self.date));
        let command = escape(&self.command);
        format!(
            "<footer class=\"made\">pilotage {version}, {date}<br><code>{command}</code></footer>\n"
        )
    }
}

/// A section with a heading; the content is already HTML.
pub fn section(title: &str, content: &str) -> String {
    format!("<section>\n<h2>{title}</h2>\n{content}</section>\n")
}

/// The title of a page, and the verdict with class `good`, `doubtful` or `bad`.
pub fn header(title: &str, class: &str, verdict: &str) -> String {
    let verdict = escape(verdict);
    format!("<header>\n<h1>{title}</h1>\n<p class=\"verdict {class}\">{verdict}</p>\n</header>\n")
}

/// The selector of a run for all figures below, and a hint on how to use figures.
pub fn choice() -> &'static str {
    "<nav class=\"choice\" id=\"choice\" hidden><span>Drag to zoom; point to read values; click the legend to hide.</span></nav>\n"
}

/// A row of large numbers.
pub fn facts(facts: &[(&str, String)]) -> String {
    let items: String = (facts.iter())
        .map(|(what, value)| format!("<div><dt>{what}</dt><dd>{}</dd></div>", escape(value)))
        .collect();
    format!("<dl class=\"facts\">{items}</dl>\n")
}

/// A figure with heading and caption, as data that `page.js` draws.
pub fn figure(figure: &Figure) -> String {
    let json = serde_json::to_string(&figure.thinned()).unwrap_or_default();
    // The data must not close the script element.
    let json = json.replace('<', "\\u003c");
    let caption = match figure.caption.is_empty() {
        true => String::new(),
        false => format!("<p>{}</p>\n", escape(&figure.caption)),
    };
    let content = format!(
        "{caption}<figure>\n<script type=\"application/json\">{json}</script>\n\
         <noscript>Figures are drawn by the script in this page.</noscript>\n</figure>\n"
    );
    section(&escape(&figure.title), &content)
}

/// A self-contained page.
pub fn whole(title: &str, body: &str, made: &Made) -> String {
    let has_figures = body.contains("<figure>");
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>pilotage: {}</title>\n<style>\n{}{}</style>\n</head>\n<body>\n<main>\n{body}{}\
         </main>\n{}</body>\n</html>\n",
        escape(title),
        palette::css(),
        include_str!("style.css"),
        made.footer(),
        if has_figures {
            scripts()
        } else {
            String::new()
        }
    )
}

/// uPlot formats numbers in the language of the browser, which is invalid if the system's locale is `C`.
const LANGUAGE: &str = "try { new Intl.NumberFormat(navigator.language); } \
                        catch { Object.defineProperty(navigator, 'language', { value: 'en' }); }";

/// The scripts that draw figures: uPlot with its licence, and `page.js`.
fn scripts() -> String {
    format!(
        "<style>\n{}\n{}</style>\n<script>\n{LANGUAGE}\n/* {} */\n{}\n</script>\n<script>\n{}</script>\n",
        include_str!("vendor/uPlot.min.css"),
        include_str!("plot.css"),
        include_str!("vendor/uPlot.LICENSE"),
        include_str!("vendor/uPlot.iife.min.js"),
        include_str!("page.js")
    )
}
