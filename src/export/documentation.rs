//! documentation/index.html: the user documentation of the FMU on one page.

use super::package::{Contents, picture_path};
use super::{EXTRA, Provenance};
use crate::fmi::description::{FmiVersion, ScalarVariable};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use pilotage_language::ModelFile;
use pilotage_sdk::variable::reference;
use pilotage_sdk::{Interface, Variable};

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

/// What we have written about a model ourselves, as HTML.
pub(super) fn written(html: &'static str) -> Markup {
    PreEscaped(html.to_owned())
}

/// The equations of a model file.
pub(super) fn equations(file: &ModelFile) -> Markup {
    html! {
        h2 { "Equations" }
        pre { "\n" (file.equations()) }
        "\n" (written(include_str!("text.html")))
    }
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
    let body = html! {
        p { (interface.description) }
        @if let Some(caveat) = &provenance.caveat { p class="caveat" { (caveat) } }
        img src={ "../" (picture_path(*version)) } alt="" width="480";
        (about)
        h2 { "Variables" }
        (table(&interface.variables))
        h2 { "Where the numbers come from" }
        p { (provenance.origin) }
        @if let Some((file, text)) = &provenance.source {
            p { "The file " code { (EXTRA) "/" (file) } " reads:" }
            pre { "\n" (text) }
        }
        p {
            "Exported by pilotage " (env!("CARGO_PKG_VERSION")) ". Licences: "
            a href="licenses/license.txt" { "licenses" } "."
        }
    };
    framed(name, &body)
}

/// A page of that title.
fn framed(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE) "\n"
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                (body)
            }
        }
        "\n"
    };
    page.into_string()
}

/// The page and the licences of a system in one FMU.
pub(super) fn container(
    name: &str,
    about: &str,
    parts: &[(String, String)],
    variables: &[ScalarVariable],
    version: FmiVersion,
) -> Vec<(&'static str, String)> {
    let body = html! {
        p { (about) }
        img src={ "../" (picture_path(version)) } alt="" width="480";
        h2 { "Parts" }
        table {
            tr { th { "Name" } th { "Source" } }
            @for (name, source) in parts {
                "\n"
                tr { td { code { (name) } } td { (source) } }
            }
        }
        h2 { "Variables" }
        table {
            tr { th { "Name" } th { "Causality" } th { "Meaning" } }
            @for own in variables {
                "\n"
                tr {
                    td { code { (own.name) } }
                    td { (own.causality.as_str()) }
                    td { (own.description.as_deref().unwrap_or_default()) }
                }
            }
        }
        p {
            "Exported by pilotage " (env!("CARGO_PKG_VERSION")) ". Licences of its own library: "
            a href="licenses/license.txt" { "licenses" }
            "; the parts have theirs, in resources/parts."
        }
    };
    vec![
        ("index.html", framed(name, &body)),
        ("licenses/license.txt", LICENSES.into()),
        ("licenses/Apache-2.0.txt", APACHE.into()),
        ("licenses/MIT.txt", MIT.into()),
    ]
}

/// No script runs, and only the picture of the FMU is shown.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' file:; base-uri 'none'";

fn table(variables: &[Variable]) -> Markup {
    let header = [
        "Reference",
        "Name",
        "Unit",
        "Role",
        "Start",
        "Range",
        "Meaning",
    ];
    html! {
        table {
            tr { @for head in header { th { (head) } } }
            @for (index, v) in variables.iter().enumerate() {
                "\n"
                tr {
                    td { (reference(index)) }
                    td { code { (v.name) } }
                    td { (v.unit.symbol()) }
                    td { (v.role.name()) }
                    td { @if let Some(start) = v.start { (start) } }
                    td { (v.allowed().unwrap_or_default()) }
                    td { (v.description) }
                }
            }
        }
        "\n"
    }
}
