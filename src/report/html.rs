//! Small pieces of HTML.

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

/// A page that needs nothing beside it.
pub fn whole(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>pilotage: {}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n{body}\
         </main>\n</body>\n</html>\n",
        escape(title),
        include_str!("style.css")
    )
}
