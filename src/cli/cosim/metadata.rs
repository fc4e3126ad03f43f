//! The side file of a CSV result: units and descriptions of its columns, as "CSV on the Web" has them (W3C, Metadata Vocabulary for
//! Tabular Data, sections 5.3 and 5.5).

use crate::cosim::recorder::Signal;
use crate::series::head;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// What each such file names.
pub const CONTEXT: &str = "http://www.w3.org/ns/csvw";

/// Its path, which those who read the table look for (section 5.3.2 there).
pub fn beside(result: &Path) -> PathBuf {
    let mut name = result.as_os_str().to_owned();
    name.push("-metadata.json");
    name.into()
}

/// Its content.
pub fn of(result: &Path, signals: &[Signal]) -> String {
    let column = |own: &Signal| -> Value {
        let mut column =
            json!({ "name": own.name, "titles": head(&own.name, &own.unit), "datatype": "double" });
        if !own.unit.is_empty() {
            column["schema:unitText"] = json!(own.unit);
        }
        if !own.description.is_empty() {
            column["dc:description"] = json!(own.description);
        }
        column
    };
    let time =
        json!({ "name": "time", "titles": "time", "datatype": "double", "schema:unitText": "s" });
    let columns: Vec<Value> = std::iter::once(time)
        .chain(signals.iter().map(column))
        .collect();
    let url = result.file_name().unwrap_or_default().to_string_lossy();
    let all = json!({ "@context": CONTEXT, "url": url, "tableSchema": { "columns": columns } });
    format!("{all:#}\n")
}
