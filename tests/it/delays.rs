//! Delays without an order, as the commands tell of them.

use crate::command::Folder;

/// The delayed integral of 2 t, (t - τ)², beside what no model has in it.
pub fn folder() -> Folder {
    let folder = Folder::new();
    folder.write(
        "m.toml",
        "[model]\nname = \"m\"\n[parameters]\ntau = { start = 0.5, unit = \"s\", min = 0.05, max = 2 }\n\
         [states]\na.der = \"2 * time\"\n[outputs]\ny.value = \"delay(a, tau)\"\n",
    );
    for (file, phase) in [("one.csv", 0.0), ("two.csv", 1.0)] {
        let row = |k: u32| {
            let t = 0.05 * f64::from(k);
            let y = (t - 0.8).max(0.0).powi(2) + 0.01 * (100.0 * t * t + phase).sin();
            format!("{t},{y}\n")
        };
        let rows: String = (0..=100).map(row).collect();
        folder.write(file, "time,y\n".to_owned() + &rows);
    }
    folder.write(
        "p.toml",
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nsignal = \"m.y\"\ncolumn = \"y\"\n[parameters]\n\"m.tau\" = {}\n\
         [[run]]\nfile = \"one.csv\"\n[[run]]\nfile = \"two.csv\"\nuse = \"validation\"\n[fit]\nstarts = 1\n",
    );
    folder
}

/// Text and JSON say the order; validation runs have the same, and so have fits of parts.
#[test]
fn a_fit_says_the_order_of_its_delays() {
    let folder = folder();
    let found = folder.pilotage(&["fit", "p.toml", "--json"]);
    assert_eq!(found.code, 0, "{found:?}");
    let found = found.json();
    let own = &found["delays"];
    let order = own["order"].as_u64().unwrap();
    assert!(
        order > 2 && own["before"].as_u64().unwrap() < order,
        "{own}"
    );
    assert!(
        own["moved"].as_f64().unwrap() < 0.1 && own["enough"] == true,
        "{own}"
    );
    assert_eq!(own["parameter"], "m.tau");
    let tau = &found["parameters"]["m.tau"];
    assert!(
        (tau["value"].as_f64().unwrap() - 0.8).abs() < 2.0 * tau["sd"].as_f64().unwrap(),
        "{tau}"
    );
    // Both runs are followed as closely.
    let rms = |k: usize| found["runs"][k]["measured"]["y"]["rms_residual"].as_f64();
    let (fitted, judged) = (rms(0).expect("of the fit"), rms(1).expect("of validation"));
    assert!(judged < 1.3 * fitted, "{fitted}, {judged}");
    let text = folder.pilotage(&["fit", "p.toml", "--force"]);
    let words = format!("Padé's approximation of order {order}: from order");
    assert!(text.stdout.contains(&words), "{text:?}");
    // Where it is given nothing is said.
    let given = folder.read("m.toml").replace("(a, tau)", "(a, tau, 3)");
    folder.write("m.toml", given);
    let given = folder.pilotage(&["fit", "p.toml", "--json", "--force"]);
    assert!(given.json()["delays"].is_null(), "{given:?}");
}
