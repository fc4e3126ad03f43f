//! Building blocks of HTML pages. [`Html`] holds escaped text alone: `html!` escapes whatever is put into it, unless that
//! is `Html` itself. `PreEscaped`, which makes it of a string as it is, stands only where that string is a file of ours
//! (`tests/it/arrows.rs`).

use super::figure::Figure;
use super::palette;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use maud::{DOCTYPE, PreEscaped};
pub use maud::{Markup as Html, html};
use pilotage_text::printable::visible;
use sha2::{Digest, Sha256};

/// A table: header cells, then rows of cells; columns in `numeric` are right-aligned.
pub fn table(header: &[&str], numeric: &[usize], rows: &[Vec<Html>]) -> Html {
    let class = |i: usize| numeric.contains(&i).then_some("n");
    html! {
        div class="scroll" {
            table {
                thead {
                    tr { @for (i, head) in header.iter().enumerate() { th class=[class(i)] { (head) } } }
                }
                tbody {
                    @for row in rows {
                        tr { @for (i, cell) in row.iter().enumerate() { td class=[class(i)] { (cell) } } }
                        "\n"
                    }
                }
            }
        }
        "\n"
    }
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
    fn footer(&self) -> Html {
        let version = env!("CARGO_PKG_VERSION");
        html! {
            footer class="made" { "pilotage " (version) ", " (self.date) br; code { (self.command) } }
        }
    }
}

/// A section with a heading.
pub fn section(title: &str, content: &Html) -> Html {
    html! { section { h2 { (title) } (content) } "\n" }
}

/// A paragraph, of a class if it has one: `warning`, `caution`.
pub fn paragraph(class: Option<&str>, words: &str) -> Html {
    html! { p class=[class] { (words) } "\n" }
}

/// A diagnostic: its code, and its words without the full stop.
pub fn diagnostic(class: &str, code: &str, words: &str) -> Html {
    html! { p class=(class) { b { (code) } ": " (words) "." } "\n" }
}

/// The title of a page, and the verdict with class `good`, `doubtful` or `bad`.
pub fn header(title: &str, class: &str, verdict: &str) -> Html {
    html! { header { h1 { (title) } p class={ "verdict " (class) } { (verdict) } } "\n" }
}

/// The selector of a run for all figures below, and a hint on how to use figures.
pub fn choice() -> Html {
    html! {
        nav class="choice" id="choice" hidden {
            span { "Drag to zoom; point to read values; click the legend to hide." }
        }
    }
}

/// A row of large numbers.
pub fn facts(facts: &[(&str, String)]) -> Html {
    html! {
        dl class="facts" { @for (what, value) in facts { div { dt { (what) } dd { (value) } } } }
        "\n"
    }
}

/// A figure with heading and caption, as data that `page.js` draws.
pub fn figure(figure: &Figure) -> Html {
    let json = serde_json::to_string(&figure.thinned()).unwrap_or_default();
    // The data must not close the script element.
    let json = PreEscaped(json.replace('<', "\\u003c"));
    let content = html! {
        @if !figure.caption.is_empty() { p { (figure.caption) } }
        figure {
            script type="application/json" { (json) }
            noscript { "Figures are drawn by the script in this page." }
        }
    };
    section(&figure.title, &content)
}

/// A self-contained page.
pub fn whole(title: &str, body: &Html, made: &Made) -> String {
    let has_figures = body.0.contains("<figure>");
    let styles = [palette::css(), include_str!("style.css").to_owned()];
    let content = html! {
        main { (body) (made.footer()) }
        @if has_figures {
            style { (PreEscaped(include_str!("vendor/uPlot.min.css"))) (PreEscaped(include_str!("plot.css"))) }
            @for script in DRAWING { script { (PreEscaped(script)) } }
        }
    };
    document(&format!("pilotage: {title}"), &styles.concat(), &content)
}

/// A page with its policy. `style` is a file of ours.
fn document(title: &str, style: &str, content: &Html) -> String {
    let page = html! {
        (DOCTYPE) "\n"
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy());
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(style)) }
            }
            "\n"
            body { (content) }
        }
        "\n"
    };
    // Bidirectional marks in names would show a line in another order than it has.
    visible(&page.into_string()).into_owned()
}

/// The scripts that draw figures: uPlot with its licence, and `page.js`. uPlot formats numbers in the language of the
/// browser, which is invalid if the system's locale is `C`.
const DRAWING: [&str; 2] = [
    concat!(
        "try { new Intl.NumberFormat(navigator.language); } ",
        "catch { Object.defineProperty(navigator, 'language', { value: 'en' }); }\n/* ",
        include_str!("vendor/uPlot.LICENSE"),
        " */\n",
        include_str!("vendor/uPlot.iife.min.js")
    ),
    include_str!("page.js"),
];

/// Shows the pages of [`side_by_side`]: a server wants its token in their addresses, too.
const FRAMES: &str = "for (const own of document.querySelectorAll(\"iframe\")) \
                      own.src = encodeURIComponent(own.dataset.page) + location.search;";

/// The Content-Security-Policy of pages: these scripts alone run, nothing is fetched, and the frames are pages beside.
pub fn policy() -> String {
    let hash = |script: &&str| {
        format!(
            "'sha256-{}'",
            BASE64_STANDARD.encode(Sha256::digest(script))
        )
    };
    let scripts: Vec<String> = DRAWING.iter().chain([&FRAMES]).map(hash).collect();
    format!(
        "default-src 'none'; script-src {}; style-src 'unsafe-inline'; img-src data:; frame-src 'self'; base-uri 'none'; \
         form-action 'none'",
        scripts.join(" ")
    )
}

/// A page with other pages of its folder side by side, or stacked if space is short: name, a few words and file of each.
pub fn side_by_side(pages: &[(&str, String, String)]) -> String {
    let content = html! {
        @for (name, words, file) in pages {
            section {
                h1 { (name) " " small { (words) } }
                iframe data-page=(file) title=(name) {}
            }
        }
        script { (PreEscaped(FRAMES)) }
    };
    document("Side by side", include_str!("frames.css"), &content)
}
