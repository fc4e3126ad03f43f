//! Results as Parquet; that pandas reads them is checked by `tests/python/module/test_tables.py`.

use crate::command::Folder;
use pilotage_series::Series;

const PLANT: &str = "[model]\nname = \"plant\"\n[inputs]\nu = { start = 2 }\n\
                     [states]\ny = { der = \"u - y\", unit = \"m\" }\n[outputs]\ny = { unit = \"m\", description = \"how far it is\" }\n";
const RUN: [&str; 6] = ["cosim", "plant.toml", "--stop-time", "2", "--step", "0.1"];

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("plant.toml", PLANT);
    folder
}

/// The same table in both forms; what reads one reads the other.
#[test]
fn a_result_is_the_same_in_columns() {
    let folder = folder();
    for file in ["r.csv", "r.parquet"] {
        let ended = folder
            .pilotage(&[&RUN[..], &["-o", file, "--report", "page.html", "--force"]].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    let [csv, parquet] =
        ["r.csv", "r.parquet"].map(|file| Series::read_table(&folder.path(file)).unwrap());
    assert_eq!((&csv.time, &csv.columns), (&parquet.time, &parquet.columns));
    assert_eq!(csv.columns.len(), 1);
    // Feeding an input, and a figure.
    let mut results = Vec::new();
    for file in ["r.csv", "r.parquet"] {
        let input = format!("table={file}");
        let words = [
            &RUN[..],
            &["--input", &input, "--connect", "table.plant.y=plant.u"],
        ]
        .concat();
        let ended = folder.pilotage(&[&words[..], &["-o", "fed.csv", "--force"]].concat());
        assert_eq!(ended.code, 0, "{ended:?}");
        let plot = folder.pilotage(&[
            "plot", file, "--figure", "plant.y", "-o", "plot.csv", "--force",
        ]);
        assert_eq!(plot.code, 0, "{plot:?}");
        results.push((folder.read("fed.csv"), folder.read("plot.csv")));
    }
    assert_eq!(results[0], results[1]);
    assert!(
        !folder
            .files()
            .iter()
            .any(|own| own.contains(".part") || own.starts_with(".pilotage"))
    );
}

/// A file of another tool in its place is not overwritten; one of ours is.
#[test]
fn only_own_files_are_replaced() {
    let folder = folder();
    let run = |more: &[&str]| folder.pilotage(&[&RUN[..], &["-o", "r.parquet"], more].concat());
    assert_eq!(run(&[]).code, 0);
    assert_eq!(run(&[]).code, 0);
    let bytes = std::fs::read(folder.path("r.parquet")).unwrap();
    folder.write("r.parquet", &bytes[..bytes.len() - 20]);
    let ended = run(&[]);
    assert!(
        ended.code == 2 && ended.stderr.contains("r.parquet"),
        "{ended:?}"
    );
    let ended = folder.pilotage(&["plot", "r.parquet"]);
    assert!(
        ended.code == 2 && ended.stderr.starts_with("error: r.parquet: "),
        "{ended:?}"
    );
    assert_eq!(run(&["--force"]).code, 0);
    assert_eq!(std::fs::read(folder.path("r.parquet")).unwrap(), bytes);
}

/// A side file in the form of CSV on the Web.
#[test]
fn units_and_descriptions_stand_beside_a_csv() {
    let folder = folder();
    let ended = folder.pilotage(&[&RUN[..], &["--metadata"]].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    let json: serde_json::Value =
        serde_json::from_str(&folder.read("result.csv-metadata.json")).unwrap();
    assert_eq!(json["url"], "result.csv");
    let column = &json["tableSchema"]["columns"][1];
    assert_eq!(
        (
            &column["titles"],
            &column["schema:unitText"],
            &column["dc:description"]
        ),
        (&"plant.y [m]".into(), &"m".into(), &"how far it is".into())
    );
    // A file of somebody else in its place stays.
    folder.write("result.csv-metadata.json", "{}");
    let ended = folder.pilotage(&[&RUN[..], &["--metadata"]].concat());
    assert_eq!(
        (ended.code, folder.read("result.csv-metadata.json").as_str()),
        (2, "{}"),
        "{ended:?}"
    );
}

/// A flight is the same run in both forms.
#[test]
fn flights_are_read() {
    let folder = folder();
    let flight = crate::command::example("trials").join("10m-run1.csv");
    let series = Series::read(&flight).unwrap();
    folder.write("run.parquet", series.to_parquet().unwrap());
    folder.write("run.csv", std::fs::read(flight).unwrap());
    let objective = |file: &str| {
        let ended = folder.pilotage(&["fit", file, "--evaluate", "--json"]);
        assert_eq!(ended.code, 0, "{ended:?}");
        ended.json()["objective"].as_f64().unwrap().to_bits()
    };
    assert_eq!(objective("run.csv"), objective("run.parquet"));
    assert_eq!(folder.pilotage(&["trials", "check", "run.parquet"]).code, 0);
}
