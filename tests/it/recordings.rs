//! What a fit of a vehicle says of recordings with faults of their own: clocks, slow sensors, holes, inputs that stand still.

use crate::command::Folder;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const MODEL: &str = "[model]\nname = \"vehicle\"\n[inputs]\nstick = {}\n[parameters]\nk = { start = 1, min = 0.01, max = 20 }\n\
                     tau = { start = 0.2, min = 0.01, max = 5 }\n[states]\nv = { der = \"(k*stick - v)/tau\" }\n";

const PROBLEM: &str = "[system.m]\nmodel = \"m.toml\"\n[inputs]\n\"m.stick\" = { column = \"stick\", hold = \"linear\" }\n[[measured]]\n\
                       signal = \"m.v\"\ncolumn = \"v\"\nsd = 0.02\n[parameters]\n\"m.*\" = {}\n[initial]\n\"m.v\" = \"free\"\n\
                       [[run]]\nfile = \"0.csv\"\n[[run]]\nfile = \"1.csv\"\n[[run]]\nfile = \"2.csv\"\n";

/// A row: time, stick and speed.
type Row = [f64; 3];

/// The speed of `0.4 v' = 2 u - v` for a sum of sines, each by its frequency response.
fn rows(run: u64) -> Vec<Row> {
    let mut random = ChaCha8Rng::seed_from_u64(run);
    let phase = run as f64;
    let sines = [(0.4, 0.5), (1.1, 0.4), (2.3, 0.3), (4.0, 0.15)];
    let sum = |t: f64, filtered: bool| -> f64 {
        let one = |(k, (w, a)): (usize, &(f64, f64))| {
            let angle = w * t + phase * (1.0 + k as f64);
            match filtered {
                false => a * angle.sin(),
                true => 2.0 * a / (0.4 * w).hypot(1.0) * (angle - (0.4 * w).atan()).sin(),
            }
        };
        sines.iter().enumerate().map(one).sum()
    };
    let row = |k: usize| {
        let t = 0.05 * k as f64;
        let noise: f64 = StandardNormal.sample(&mut random);
        [t, sum(t, false), sum(t, true) + 0.02 * noise]
    };
    (0..800).map(row).collect()
}

/// The codes and words of the doubts of a fit of three runs, the second with this fault.
fn doubts(fault: impl Fn(Vec<Row>) -> Vec<Row>) -> Vec<(String, String)> {
    let folder = Folder::new();
    folder.write("m.toml", MODEL);
    folder.write("problem.toml", PROBLEM);
    for run in 0..3 {
        let rows = match run {
            1 => fault(rows(run)),
            _ => rows(run),
        };
        let lines = rows
            .iter()
            .map(|[t, u, v]| format!("{t:.3},{u:.9},{v:.9}\n"));
        folder.write(
            &format!("{run}.csv"),
            "time,stick,v\n".to_owned() + &lines.collect::<String>(),
        );
    }
    let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let text = |own: &serde_json::Value| own.as_str().unwrap().to_owned();
    let json = ended.json();
    let all = json["doubts"].as_array().unwrap().iter();
    all.map(|own| (text(&own["code"]), text(&own["words"])))
        .collect()
}

#[test]
fn faults_of_one_recording_are_named_and_good_ones_are_not_doubted() {
    assert_eq!(doubts(|rows| rows), []);
    let find = |doubts: Vec<(String, String)>, code: &str| -> String {
        let found = doubts.iter().find(|own| own.0 == code);
        found
            .unwrap_or_else(|| panic!("{code}: {doubts:?}"))
            .1
            .clone()
    };
    // The stick is that of two rows before.
    let late = doubts(|rows| {
        let stick = |k: usize| rows[k.saturating_sub(2)][1];
        (0..rows.len())
            .map(|k| [rows[k][0], stick(k), rows[k][2]])
            .collect()
    });
    let late = find(late, "late");
    assert!(late.starts_with("v of 1.csv comes 0.1 s earlier"), "{late}");
    let slow = doubts(|rows| {
        let kept = |k: usize| rows[k / 10 * 10][2];
        (0..rows.len())
            .map(|k| [rows[k][0], rows[k][1], kept(k)])
            .collect()
    });
    let slow = find(slow, "slow-sensor");
    assert!(
        slow.starts_with("v of 1.csv is new in one of 10 rows"),
        "{slow}"
    );
    let frozen = doubts(|rows| {
        let own = |k: usize| if (300..340).contains(&k) { 300 } else { k };
        (0..rows.len())
            .map(|k| [rows[k][0], rows[own(k)][1], rows[k][2]])
            .collect()
    });
    let frozen = find(frozen, "frozen");
    assert!(
        frozen.starts_with(
            "stick of 1.csv, which drives an input, stands still from 15 s to 16.95 s"
        ),
        "{frozen}"
    );
    let hole = doubts(|mut rows| {
        rows.drain(400..420);
        rows
    });
    let hole = find(hole, "gap");
    assert!(
        hole.starts_with("1.csv has no rows from 19.95 s to 21 s"),
        "{hole}"
    );
}
