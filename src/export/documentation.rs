//! documentation/index.html: the user documentation of the FMU on one page.

use super::package::{Contents, picture_path};
use super::{EXTRA, Provenance};
use pilotage_language::ModelFile;
use pilotage_sdk::variable::reference;
use pilotage_sdk::{Interface, Variable};
use pilotage_text::printable::markup;

const APACHE: &str = include_str!("licenses/Apache-2.0.txt");
const MIT: &str = include_str!("licenses/MIT.txt");
const LICENSES: &str = include_str!("licenses/README.txt");
const STYLE: &str = include_str!("style.css");

/// Names and contents of the files in `documentation/`.
pub(super) fn files(contents: &Contents<'_>) -> Vec<(&'static str, String)> {
    vec![
        ("index.html", page(contents)),
        ("licenses/license.txt", LICENSES.into()),
        ("licenses/Apache-2.0.txt", APACHE.into()),
        ("licenses/MIT.txt", MIT.into()),
    ]
}

/// The text of `provenance.txt` in [`EXTRA`].
pub(super) fn provenance(interface: &Interface, provenance: &Provenance) -> String {
    let mut lines = vec![
        format!("tool: pilotage {}", env!("CARGO_PKG_VERSION")),
        format!("model: {}", interface.name),
        format!("guid: {}", interface.guid),
        format!("origin: {}", provenance.origin),
    ];
    lines.extend(provenance.caveat.iter().map(|c| format!("caveat: {c}")));
    lines.extend(
        provenance
            .source
            .iter()
            .map(|(name, _)| format!("source: {name}")),
    );
    lines.join("\n") + "\n"
}

/// The equations of a model file, as HTML.
pub(super) fn equations(file: &ModelFile) -> String {
    format!(
        "<h2>Equations</h2>\n<pre>\n{}</pre>\n{}",
        markup(&file.equations()),
        include_str!("text.html")
    )
}

fn page(contents: &Contents<'_>) -> String {
    let Contents {
        name,
        interface,
        provenance,
        version,
        about,
        ..
    } = contents;
    let name = markup(name);
    let place = picture_path(*version);
    let picture = format!("<img src=\"../{place}\" alt=\"\" width=\"480\"/>\n");
    let caveat = match &provenance.caveat {
        Some(caveat) => format!("<p class=\"caveat\">{}</p>\n", markup(caveat)),
        None => String::new(),
    };
    let source = match &provenance.source {
        Some((file, text)) => format!(
            "<p>The file <code>{EXTRA}/{}</code> reads:</p>\n<pre>{}</pre>\n",
            markup(file),
            markup(text)
        ),
        None => String::new(),
    };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <title>{name}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>{name}</h1>\n<p>{}</p>\n{caveat}{picture}{about}\
         <h2>Variables</h2>\n{}\
         <h2>Where the numbers come from</h2>\n<p>{}</p>\n{source}\
         <p>Exported by pilotage {}. Licences: <a href=\"licenses/license.txt\">licenses</a>.</p>\n\
         </body>\n</html>\n",
        markup(&interface.description),
        table(&interface.variables),
        markup(&provenance.origin),
        env!("CARGO_PKG_VERSION"),
    )
}

fn table(variables: &[Variable]) -> String {
    let mut html = String::from(
        "<table>\n<tr><th>Reference</th><th>Name</th><th>Unit</th><th>Role</th><th>Start</th>\
         <th>Range</th><th>Meaning</th></tr>\n",
    );
    for (index, v) in variables.iter().enumerate() {
        let cells = [
            reference(index).to_string(),
            format!("<code>{}</code>", markup(&v.name)),
            v.unit.symbol(),
            v.role.name().to_owned(),
            v.start.map_or(String::new(), |start| start.to_string()),
            v.allowed().unwrap_or_default(),
            markup(&v.description),
        ];
        html += &format!("<tr><td>{}</td></tr>\n", cells.join("</td><td>"));
    }
    html + "</table>\n"
}
