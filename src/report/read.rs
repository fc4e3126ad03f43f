//! Reads figures and tables back from a page, so that they can be exported without repeating the fit.

use super::figure::Figure;

/// A table on a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Name on the command line: the heading in lower case, with `-` for spaces.
    pub name: String,
    /// Header and rows as plain text.
    pub rows: Vec<Vec<String>>,
}

/// The figures of a page; empty for a file without figures.
pub fn figures(page: &str) -> Vec<Figure> {
    let parts = page.split("<script type=\"application/json\">").skip(1);
    let json = parts.filter_map(|part| part.split("</script>").next());
    json.filter_map(|json| serde_json::from_str(json).ok())
        .collect()
}

/// The tables of a page.
pub fn tables(page: &str) -> Vec<Table> {
    let sections = page.split("<section>").skip(1);
    let table = |section: &str| {
        let heading = section.trim_start().strip_prefix("<h2>")?;
        let (title, rest) = heading.split_once("</h2>")?;
        let (_, table) = rest.split_once("<table>")?;
        let (table, _) = table.split_once("</table>")?;
        let name = plain(title).to_lowercase().replace(' ', "-");
        Some(Table {
            name,
            rows: table.split("<tr>").skip(1).map(cells).collect(),
        })
    };
    sections.filter_map(table).collect()
}

/// The cells of a row.
fn cells(row: &str) -> Vec<String> {
    // Matches `<td>` and `<th>`, but neither `<tbody>` nor `<thead>`.
    let is_cell = |part: &&str| {
        ["d>", "d ", "h>", "h "]
            .iter()
            .any(|begin| part.starts_with(begin))
    };
    let cells = row.split("<t").skip(1).filter(is_cell);
    let text = cells.filter_map(|cell| {
        let (_, content) = cell.split_once('>')?;
        content.split("</t").next().map(plain)
    });
    text.collect()
}

/// Plain text of HTML, with numbers in a form that programs can read.
fn plain(html: &str) -> String {
    let html = html.replace("\u{b7}10<sup>", "e");
    let html = html.replace("<sup>", "^").replace("<br>", "; ");
    let mut text = String::new();
    let mut is_mark = false;
    for c in html.chars() {
        match c {
            '<' => is_mark = true,
            '>' if is_mark => is_mark = false,
            c if !is_mark => text.push(c),
            _ => {}
        }
    }
    (text
        .replace('\u{2212}', "-")
        .replace("&lt;", "<")
        .replace("&gt;", ">"))
    .replace("&quot;", "\"")
    .replace("&amp;", "&")
}

impl Table {
    /// The table as CSV.
    pub fn to_csv(&self) -> String {
        super::csv(&self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::{Panel, Series};
    use crate::report::html::{figure, html, section, table};
    use crate::report::number;

    #[test]
    fn what_is_written_is_read_again() {
        let line = Series::line("a </script> <b>", "data", &[0.0, 1.0], &[2.0, 3.5]);
        let panel = Panel {
            series: vec![line],
            ..Panel::default()
        };
        let own = Figure::of("response", "Response", "", panel);
        let rows = [vec![number::html(-3.21e-9, 3), html! { "a < b & \"c\"" }]];
        let table = table(&["value", "name"], &[0], &rows);
        let page = html! { (figure(&own)) (section("Two Words", &table)) }.into_string();
        assert_eq!(figures(&page), [own]);
        let found = tables(&page);
        assert_eq!(found[0].name, "two-words");
        assert_eq!(
            found[0].to_csv(),
            "value,name\n-3.21e-9,\"a < b & \"\"c\"\"\"\n"
        );
    }
}
