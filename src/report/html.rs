//! Small pieces of HTML.

use super::figure::Figure;
use super::palette;

/// Text with the characters that mean something to HTML replaced.
pub fn escape(text: &str) -> String {
    (text.replace('&', "&amp;").replace('<', "&lt;"))
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A table: header cells, then rows of cells. Cells are HTML already; columns in `numeric` are aligned
/// to the right.
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

/// What made a page, and when.
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

/// A part of a page with a heading; the content is HTML already.
pub fn section(title: &str, content: &str) -> String {
    format!("<section>\n<h2>{title}</h2>\n{content}</section>\n")
}

/// A page's title, and beside it the verdict in the class `good`, `doubtful` or `bad`.
pub fn header(title: &str, class: &str, verdict: &str) -> String {
    let verdict = escape(verdict);
    format!("<header>\n<h1>{title}</h1>\n<p class=\"verdict {class}\">{verdict}</p>\n</header>\n")
}

/// Where one run is chosen of many, for all figures below, and what figures can do.
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

/// A figure with a heading and a sentence above it: its data, which `page.js` draws.
pub fn figure(figure: &Figure) -> String {
    let json = serde_json::to_string(&figure.thinned()).unwrap_or_default();
    // Nothing in it may end the element.
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

/// A page that needs nothing beside it.
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

/// uPlot asks for numbers in the language of the browser, which is none where that of the system is `C`.
const LANGUAGE: &str = "try { new Intl.NumberFormat(navigator.language); } \
                        catch { Object.defineProperty(navigator, 'language', { value: 'en' }); }";

/// What draws figures: uPlot, with its licence, and our script.
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
