//! `pilotage plot`: figures and tables of pages, pilots and results as files.

use crate::command::{Folder, example};
use roxmltree::Document;

/// The shipped flights, fitted.
fn fitted() -> Folder {
    let folder = Folder::new();
    let trials = example("trials").join("trials.toml").display().to_string();
    let vehicle = example("vehicles/quadcopter.toml").display().to_string();
    let words = [
        "fit",
        &trials,
        "--vehicle",
        &vehicle,
        "--initial-state",
        "at-rest",
        "--report",
        "fit.html",
    ];
    assert_eq!(folder.pilotage(&words).code, 0);
    folder
}

/// Every figure of a fit as a drawing that parses, of the width asked for, and as pixels of the resolution asked for.
#[test]
fn figures_of_a_fit_are_drawn() {
    let folder = fitted();
    let list = folder.pilotage(&["plot", "fit.html"]).stdout;
    let figures: Vec<&str> = (list.lines())
        .filter(|line| line.split_whitespace().nth(1) == Some("figure"))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(figures.len() >= 8, "{list}");
    for figure in &figures {
        let ended = folder.pilotage(&["plot", "fit.html", "--figure", figure, "--width", "85"]);
        assert_eq!(ended.code, 0, "{ended:?}");
        let svg = folder.read(&format!("{figure}.svg"));
        let document = Document::parse(&svg).unwrap();
        assert_eq!(document.root_element().attribute("width"), Some("85.00mm"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{figure}");
    }
    let words = [
        "plot",
        "fit.html",
        "--figure",
        "open-loop",
        "--width",
        "127",
        "--dpi",
        "100",
        "-o",
        "a.png",
    ];
    assert_eq!(folder.pilotage(&words).code, 0);
    let png = std::fs::read(folder.path("a.png")).unwrap();
    let width = u32::from_be_bytes([png[16], png[17], png[18], png[19]]);
    assert_eq!(
        (&png[1..4], width),
        (&b"PNG"[..], 500),
        "127 mm are 5 inches"
    );
}

/// The numbers of a figure of one run are those of its recording, and a table those of the pilot file.
#[test]
fn figures_and_tables_become_numbers() {
    let folder = fitted();
    let words = [
        "plot", "fit.html", "--figure", "response", "--run", "10m-run1", "-o", "r.csv",
    ];
    let ended = folder.pilotage(&words);
    assert_eq!(ended.code, 0, "{ended:?}");
    let recorded = std::fs::read_to_string(example("trials").join("10m-run1.csv")).unwrap();
    let last: Vec<f64> = recorded
        .lines()
        .last()
        .unwrap()
        .split(',')
        .map(|v| v.parse().unwrap())
        .collect();
    let mut lines = recorded.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| {
        header
            .iter()
            .position(|cell| cell.starts_with(name))
            .unwrap()
    };
    let csv = folder.read("r.csv");
    let row = csv
        .lines()
        .rfind(|line| line.contains(",recorded,"))
        .unwrap();
    let cells: Vec<&str> = row.split(',').collect();
    let drawn = [cells[3], cells[4]].map(|cell| cell.parse::<f64>().unwrap());
    for (drawn, recorded) in drawn
        .iter()
        .zip([last[place("time")], last[place("position")]])
    {
        assert!(
            (drawn - recorded).abs() < 1e-7 * (1.0 + recorded.abs()),
            "{row}"
        );
    }
    assert!(csv.lines().skip(1).all(|line| line.contains(",10m-run1,")));
    let words = ["plot", "fit.html", "--figure", "parameters", "-o", "p.csv"];
    assert_eq!(folder.pilotage(&words).code, 0);
    let pilot: toml::Table = folder.read("pilot.toml").parse().unwrap();
    for (k, line) in folder.read("p.csv").lines().skip(1).take(6).enumerate() {
        let value: f64 = line.split(',').nth(1).unwrap().parse().unwrap();
        let exact = pilot["parameters"][&format!("theta{}", k + 1)]["start"]
            .as_float()
            .unwrap();
        assert!((value / exact - 1.0).abs() < 1e-4, "{line} {exact}");
    }
}

/// It has all that its bands and ellipses are drawn of.
#[test]
fn a_fitted_pilot_is_drawn_with_its_bands() {
    let folder = fitted();
    for figure in ["bode", "poles"] {
        let words = [
            "plot",
            "pilot.toml",
            "--figure",
            figure,
            "-o",
            "x.csv",
            "--force",
        ];
        let ended = folder.pilotage(&words);
        assert_eq!(ended.code, 0, "{ended:?}");
        assert!(folder.read("x.csv").contains(",95 %,"), "{figure}");
    }
    // A file without covariance has no bands.
    let text = folder.read("pilot.toml");
    let (before, rest) = text.split_once("parameters = [\"theta1").unwrap();
    let (_, after) = rest.split_once("\n]\n").unwrap();
    folder.write("old.toml", format!("{before}{after}"));
    let words = ["plot", "old.toml", "--figure", "bode", "-o", "old.csv"];
    assert_eq!(folder.pilotage(&words).code, 0);
    assert!(!folder.read("old.csv").contains("95 %"));
}

/// The band of a problem's open loop, where its gain is 1, over the slope there, is the interval of the crossover frequency.
#[test]
fn bands_of_problems_are_those_of_their_margins() {
    let folder = Folder::new();
    let problem = example("problems/rate_limited/problem.toml");
    let problem = problem.display().to_string();
    let fit = ["fit", &problem, "--report", "fit.html", "--json"];
    let json = folder.pilotage(&fit).json();
    let plot = ["plot", "fit.html", "--figure", "open-loop", "-o", "o.csv"];
    assert_eq!(folder.pilotage(&plot).code, 0);
    let table = folder.read("o.csv");
    let of = |series: &str| -> Vec<[f64; 2]> {
        let rows = table
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let rows = rows.filter(|row| row[0] == "gain [dB]" && row[2] == series);
        rows.map(|row| [row[3], row[4]].map(|cell| cell.parse().unwrap()))
            .collect()
    };
    let (fitted, band) = (of("fitted"), of("95 %"));
    let after = fitted.iter().position(|[_, gain]| *gain < 0.0).unwrap();
    let [[w0, g0], [w1, g1]] = [fitted[after - 1], fitted[after]];
    // Along one end of the band and back along the other.
    let half = (band[after][1] - band[band.len() - 1 - after][1]).abs() / 2.0;
    let crossover = &json["derived"]["crossover_frequency"];
    let [low, high] = ["low", "high"].map(|key| crossover[key].as_f64().unwrap());
    let expected = (high - low) / 2.0;
    let found = half / ((g1 - g0) / (w1 - w0)).abs();
    assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
    let poles = ["plot", "fit.html", "--figure", "poles", "-o", "p.csv"];
    assert_eq!(folder.pilotage(&poles).code, 0);
    assert!(folder.read("p.csv").contains("95 %"));
}

/// Results lie over each other by the names of their columns, with units on the axes.
#[test]
fn results_are_laid_over_each_other() {
    let folder = Folder::new();
    folder.write("a.csv", "time,car.x [m],car.v [m/s]\n0,0,1\n1,1,1\n");
    folder.write("b.csv", "time,car.x [m]\n0,0\n2,4\n");
    let ended = folder.pilotage(&["plot", "a.csv", "b.csv", "--figure", "car.x"]);
    assert_eq!(
        (ended.code, ended.stdout.as_str()),
        (0, "wrote car.x.svg\n"),
        "{ended:?}"
    );
    let svg = folder.read("car.x.svg");
    for part in [
        ">car.x [m]</text>",
        ">time [s]</text>",
        ">car.x, a.csv</text>",
        ">car.x, b.csv</text>",
    ] {
        assert!(svg.contains(part), "{part} {svg}");
    }
    let list = folder.pilotage(&["plot", "a.csv"]).stdout;
    assert_eq!(list.lines().count(), 2, "{list}");
}

/// Signals of one unit share a figure; the name of each finds it.
#[test]
fn a_figure_is_found_by_the_name_of_a_signal() {
    let folder = Folder::new();
    for file in ["a.csv", "b.csv"] {
        folder.write(file, "time,pilot.error [m],car.z [m]\n0,0,1\n1,1,2\n");
    }
    let ended = folder.pilotage(&["plot", "a.csv", "b.csv", "--figure", "car.z"]);
    assert_eq!(
        (ended.stdout.as_str(), ended.code),
        ("wrote car.z.svg\n", 0)
    );
    assert!(folder.read("car.z.svg").contains(">car.z, b.csv</text>"));
}

#[test]
fn what_cannot_be_drawn_is_told() {
    let folder = Folder::new();
    folder.write("a.csv", "time,car.speed [m/s]\n0,0\n1,1\n");
    folder.write("page.html", "<!DOCTYPE html><p>mine");
    for (words, message) in [
        (
            "plot a.csv --figure car.sped",
            "error: there is no figure or table `car.sped`\nhint: did you mean `car.speed`?\n",
        ),
        (
            "plot a.csv --figure car.speed -o x.doc",
            "error: x.doc is no kind of file that is written\nhint: end its name in .svg, .png or .csv\n",
        ),
        (
            "plot a.csv --figure car.speed --run 1",
            "error: `car.speed` has no run `1`\nhint: it is not divided into runs\n",
        ),
        (
            "plot a.csv --figure car.speed -o page.html",
            "error: page.html ",
        ),
        (
            "plot a.csv --figure car.speed --width 39",
            "error: invalid value '39' for '--width <WIDTH>': expected a width from 40 to 2000 mm\n",
        ),
        (
            "plot a.csv --figure car.speed -o a.png --width 2000 --dpi 1200",
            "error: a drawing 94488 pixels wide\nhint: take a smaller --dpi or --width: up to 16000 pixels\n",
        ),
        (
            "plot a.csv page.html",
            "error: page.html is drawn alone\nhint: several files are results, .csv, in one figure\n",
        ),
        (
            "plot page.html",
            "error: page.html holds no figure\nhint: name a page that --report wrote\n",
        ),
    ] {
        let ended = folder.pilotage(&words.split(' ').collect::<Vec<_>>());
        assert_eq!(ended.code, 2, "{words}");
        assert!(
            ended.stderr.starts_with(message),
            "{words}: {}",
            ended.stderr
        );
    }
}
