//! What stands in an exported FMU, and what `pilotage export` says.

use crate::command::{Folder, example, written};
use pilotage::export::{Export, ExportError, Provenance};
use pilotage::fmi::description::{self, FmiVersion, ModelDescription};
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter};
use pilotage_sdk::Interface;
use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::io::{Cursor, Read};
use std::process::Command;

/// The bytes of a model's FMU.
pub fn package(model: &Model, provenance: &Provenance) -> Result<Vec<u8>, ExportError> {
    Export::new(model, provenance).bytes()
}

pub fn models() -> [(Model, Provenance); 4] {
    let second_order = Model::pilot(&[1.0, 2.0, 0.1, 0.2], 0.5);
    let heavy = Quadcopter {
        mass: 2.5,
        ..Quadcopter::default()
    };
    let fit = Provenance::fit(
        "converged = false # <best iterate>\n".into(),
        Some(false),
        Some("The fit did NOT converge: θ is its best iterate, not a solution.".into()),
    );
    [
        (Model::pilot(&PAPER_THETA, 1.0), Provenance::paper()),
        (second_order, fit),
        (
            Model::quadcopter(&Quadcopter::default()),
            Provenance::vehicle(None),
        ),
        (
            Model::quadcopter(&heavy),
            Provenance::vehicle(Some("mass = 2.5\n".into())),
        ),
    ]
}

pub fn files(fmu: &[u8]) -> BTreeMap<String, Vec<u8>> {
    let mut archive = zip::ZipArchive::new(Cursor::new(fmu)).unwrap();
    (0..archive.len())
        .map(|i| {
            let mut file = archive.by_index(i).unwrap();
            let mut content = Vec::new();
            file.read_to_end(&mut content).unwrap();
            (file.name().unwrap().into_owned(), content)
        })
        .collect()
}

pub fn text<'f>(files: &'f BTreeMap<String, Vec<u8>>, name: &str) -> &'f str {
    std::str::from_utf8(&files[name]).unwrap()
}

fn read(files: &BTreeMap<String, Vec<u8>>) -> ModelDescription {
    let reading = description::read(&files["modelDescription.xml"]).unwrap();
    assert_eq!(reading.findings, []);
    assert_eq!(pilotage::fmi_check::validate(&reading), []);
    reading.description
}

/// FMI rule 17: the same input gives the same bytes.
#[test]
fn equal_inputs_give_equal_bytes() {
    for (model, provenance) in models() {
        let once = package(&model, &provenance).unwrap();
        assert!(once == package(&model, &provenance).unwrap());
    }
}

/// FMI rule 18: the folders of the archive.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn archive_holds_what_the_standard_asks_for() {
    let names = models().map(|(model, provenance)| {
        let fmu = package(&model, &provenance).unwrap();
        files(&fmu).into_keys().collect::<Vec<_>>().join("\n")
    });
    insta::assert_snapshot!(names.join("\n\n"));
}

/// FMI rule 17: methods, versions and flags of zip.
#[test]
fn archive_keeps_to_zip_2_0() {
    let (model, provenance) = &models()[0];
    let fmu = package(model, provenance).unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(&fmu)).unwrap();
    let mut names = Vec::new();
    for i in 0..archive.len() {
        let file = archive.by_index(i).unwrap();
        let name = file.name().unwrap().into_owned();
        let header = &fmu[usize::try_from(file.header_start()).unwrap()..];
        let short = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
        assert!(short(4) <= 20, "{}: version needed {}", name, short(4));
        // Bit 11 marks names in UTF-8; encryption and streaming (bits 0 and 3) are not for FMUs.
        assert_eq!(short(6) & !(1 << 11), 0, "{}: flags", name);
        assert_eq!(short(8), 8, "{}: method", name);
        assert_eq!((short(10), short(12)), (0, 0x21), "{}: 1980-01-01", name);
        names.push(name);
    }
    assert!(names.is_sorted(), "{names:?}");
}

/// FMI rules 1, 3, 5 to 13: the description is valid, and its fingerprint is the model's.
#[test]
fn description_is_valid_and_says_what_the_model_is() {
    for (model, provenance) in models() {
        let files = files(&package(&model, &provenance).unwrap());
        let found = read(&files);
        let interface = Interface::of(&model);
        let expected = pilotage::export::description(&interface, &provenance, FmiVersion::V2);
        assert_eq!(found, expected);
        assert_eq!(found.guid, model.guid());
        assert_eq!(
            Model::from_file(text(&files, "resources/model.toml")),
            Ok(model.clone())
        );
        let about = found.description.unwrap();
        assert!(about.contains(&provenance.origin));
        if let Some(caveat) = &provenance.caveat {
            assert!(about.contains(caveat));
        }
    }
}

/// FMI rules 11, 14, 15 and 16: units, outputs, initial unknowns and dependencies.
#[test]
fn description_declares_dependencies_and_units() {
    let model = Model::pilot(&PAPER_THETA, 1.0);
    let found = read(&files(&package(&model, &Provenance::paper()).unwrap()));
    let names = |indices: &Option<Vec<u32>>| -> Vec<String> {
        let name = |i: &u32| found.variables[*i as usize - 1].name.clone();
        indices.as_ref().unwrap().iter().map(name).collect()
    };
    let structure = &found.structure;
    assert_eq!(
        names(&structure.outputs[0].dependencies),
        ["x1", "x2", "x3"]
    );
    assert_eq!(
        names(&structure.outputs[1].dependencies),
        ["target", "position"]
    );
    let initial = names(&structure.initial_unknowns[0].dependencies);
    let expected = [
        "theta4",
        "theta5",
        "theta6",
        "stick_limit",
        "x1_start",
        "x2_start",
        "x3_start",
    ];
    assert_eq!(initial, expected);
    let unit = |name: &str| {
        let units = found.units_of_variables();
        units(found.variable(name).unwrap().1).unwrap().to_owned()
    };
    let units = [
        "theta1", "theta3", "theta4", "theta6", "x1_start", "stick", "error",
    ]
    .map(unit);
    assert_eq!(
        units,
        ["1/s3", "1/s", "1/(m.s3)", "1/(m.s)", "m.s3", "1", "m"]
    );
}

/// `θ_i x_i` must have the unit of the error, and `θ_(n+i) x_i` that of the stick.
#[test]
fn units_of_the_pilot_fit_its_equations() {
    let model = Model::pilot(&[0.0; 10], 1.0);
    let exponents = |name: String| -> [i32; 8] {
        let unit = &model.variables()[model.index(&name).unwrap()].unit;
        unit.base.exponents
    };
    for i in 1..=5 {
        let state = exponents(format!("x{i}_start"));
        let sum = |theta: usize| -> [i32; 8] {
            let theta = exponents(format!("theta{theta}"));
            std::array::from_fn(|k| theta[k] + state[k])
        };
        assert_eq!(sum(i), exponents("error".into()), "theta{i}");
        assert_eq!(sum(5 + i), exponents("stick".into()), "theta{}", 5 + i);
    }
}

#[test]
fn documentation_tells_variables_equations_and_sources() {
    for (model, provenance) in models() {
        let files = files(&package(&model, &provenance).unwrap());
        let page = text(&files, "documentation/index.html");
        for v in model.variables() {
            assert!(
                page.contains(&format!("<code>{}</code>", v.name)),
                "{}",
                v.name
            );
        }
        if let Some(caveat) = &provenance.caveat {
            assert!(page.contains(&format!("<p class=\"caveat\">{caveat}</p>")));
        }
        // Well-formed, so that nothing of the user's text has escaped its quotes.
        let markup = closed(&page.replace("<!DOCTYPE html>", ""));
        assert!(roxmltree::Document::parse(&markup).is_ok(), "{markup}");
        if let Some((name, text_as_given)) = &provenance.source {
            assert_eq!(
                text(&files, &format!("extra/org.pilotage/{name}")),
                text_as_given
            );
            assert!(page.contains(&text_as_given.replace('<', "&lt;").replace('>', "&gt;")));
        }
        let provenance_text = text(&files, "extra/org.pilotage/provenance.txt");
        assert!(provenance_text.contains(&model.guid()));
        assert!(provenance_text.contains(&provenance.origin));
    }
}

/// The page as XML, which closes the elements that HTML leaves open.
fn closed(page: &str) -> String {
    let close = |page: String, element: &str| -> String {
        let mut parts = page.split(element);
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |page, part| {
            page + element + &part.replacen('>', "/>", 1)
        })
    };
    ["<meta", "<img"].into_iter().fold(page.to_owned(), close)
}

#[test]
fn each_model_has_a_picture_of_its_own() {
    let mut pictures = BTreeSet::new();
    for (model, provenance) in models() {
        let files = files(&package(&model, &provenance).unwrap());
        let (head, size) = files["model.png"][..24].split_at(16);
        assert_eq!(head, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR");
        assert_eq!(
            size,
            [480_u32.to_be_bytes(), 320_u32.to_be_bytes()].concat()
        );
        pictures.insert(files["model.png"].clone());
    }
    // Pilots and quadcopters.
    assert_eq!(pictures.len(), 2);
}

fn pilot_file(converged: bool) -> String {
    format!(
        "converged = {converged}\nstick_limit = 0.8\n\n[theta]\ntheta1 = 0.3\ntheta2 = 1.2\n\
         theta3 = 1.1\ntheta4 = -0.003\ntheta5 = -0.02\ntheta6 = -0.05\n"
    )
}

#[test]
fn a_fitted_pilot_is_exported_with_its_file() {
    let folder = Folder::new();
    folder.write("fit.toml", pilot_file(true));
    let ended = folder.pilotage(&["export", "pilot", "fit.toml", "-o", "p.fmu"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    let next = "next: pilotage validate p.fmu\n";
    assert_eq!(ended.stdout, written(&folder, "p.fmu") + next);
    let files = files(&std::fs::read(folder.path("p.fmu")).unwrap());
    assert_eq!(
        text(&files, "extra/org.pilotage/pilot.toml"),
        pilot_file(true)
    );
    let model = Model::from_file(text(&files, "resources/model.toml")).unwrap();
    let theta = [0.3, 1.2, 1.1, -0.003, -0.02, -0.05];
    assert_eq!(model, Model::pilot(&theta, 0.8));
    assert_eq!(folder.files(), ["fit.toml", "p.fmu"]);
}

#[test]
fn a_fit_that_did_not_converge_is_exported_only_on_demand_and_marked() {
    let folder = Folder::new();
    folder.write("fit.toml", pilot_file(false));
    let ended = folder.pilotage(&["export", "pilot", "fit.toml"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.stderr,
        "error: fit.toml: the fit did not converge\n\
         hint: fit again (more iterations, another --start), or pass --allow-unconverged to export \
         its best iterate\n"
    );
    assert_eq!(folder.files(), ["fit.toml"]);
    let ended = folder.pilotage(&["export", "pilot", "fit.toml", "--allow-unconverged"]);
    assert_eq!(ended.code, 0);
    assert!(ended.stdout.contains("\nnote: The fit did NOT converge: "));
    let files = files(&std::fs::read(folder.path("pilot.fmu")).unwrap());
    assert!(
        read(&files)
            .description
            .unwrap()
            .contains("The fit did NOT converge")
    );
}

/// The sign of the lead is turned in a file that says of its loop that it is stable.
#[test]
fn the_closed_loop_is_that_of_the_numbers_whatever_the_file_says() {
    let folder = Folder::new();
    let vehicle = std::fs::read_to_string(example("vehicles/quadcopter.toml")).unwrap();
    // The vehicle's gains are those of the project's own quadcopter: with this lead it is flown.
    let own = "converged = true\n[theta]\ntheta1 = 6.0\ntheta2 = 5.0\ntheta3 = -0.06\ntheta4 = -0.2\n[closed_loop]\n\
               stable = true\n[vehicle]\n";
    folder.write("pilot.toml", format!("{own}{vehicle}"));
    let description = |file: &str| {
        let ended = folder.pilotage(&[
            "export",
            "pilot",
            file,
            "-o",
            "p.fmu",
            "--allow-unconverged",
        ]);
        assert_eq!(ended.code, 0, "{ended:?}");
        let files = files(&std::fs::read(folder.path("p.fmu")).unwrap());
        read(&files).description.unwrap()
    };
    assert!(description("pilot.toml").contains("the vehicle of the fit is stable."));

    let turned = own.replace("theta3 = -", "theta3 = ");
    folder.write("turned.toml", format!("{turned}{vehicle}"));
    let ended = folder.pilotage(&["export", "pilot", "turned.toml", "-o", "turned.fmu"]);
    assert_eq!((ended.code, folder.path("turned.fmu").exists()), (2, false));
    let expected =
        "turned.toml: the fit is no answer: the closed loop of [theta] with [vehicle] is unstable";
    assert!(ended.stderr.contains(expected), "{ended:?}");
    assert!(description("turned.toml").contains("the vehicle of the fit is UNSTABLE."));
}

#[test]
fn a_vehicle_that_nobody_can_fly_is_marked() {
    let folder = Folder::new();
    let vehicle = example("vehicles").join("paper-gains.toml");
    let ended = folder.pilotage(&["export", "quadcopter", vehicle.to_str().unwrap()]);
    assert_eq!(ended.code, 0);
    assert_eq!(
        ended.stdout,
        written(&folder, "quadcopter.fmu")
            + "note: The pitch loop of this vehicle is unstable; `pilotage vehicle check` says why.\n\
         next: pilotage validate quadcopter.fmu\n"
    );
    let files = files(&std::fs::read(folder.path("quadcopter.fmu")).unwrap());
    let about = read(&files).description.unwrap();
    assert!(about.contains("The pitch loop of this vehicle is unstable"));
}

#[test]
fn what_cannot_be_exported_leaves_nothing_behind() {
    let folder = Folder::new();
    folder.write("good.toml", pilot_file(true));
    let thirteen: String = (1..=26).map(|i| format!("theta{i} = 1.0\n")).collect();
    folder.write("high.toml", format!("[theta]\n{thirteen}"));
    let vehicle = folder.pilotage(&["vehicle", "show"]).stdout;
    folder.write("light.toml", vehicle.replace("mass = 1.2 ", "mass = -1.2 "));
    let before = folder.files();
    let cases: &[(&[&str], &str)] = &[
        (
            &["pilot", "none.toml"],
            "error: cannot read none.toml: No such file or directory (os error 2)\n",
        ),
        (
            &["pilot", "high.toml"],
            "error: high.toml: a pilot of order 13 cannot be exported; the highest order is 12\n",
        ),
        (
            &["pilot", "good.toml", "-o", "missing/p.fmu"],
            "error: missing/p.fmu cannot be written: No such file or directory (os error 2)\n",
        ),
        (
            &["quadcopter", "good.toml"],
            "error: good.toml is a pilot file; expected a vehicle file (TOML)\nhint: a pilot belongs to \
             `pilotage export pilot good.toml` or `pilotage cosim good.toml`\n",
        ),
        (
            &["quadcopter", "light.toml"],
            "error: light.toml:2: mass = -1.2 kg is out of range; expected 0.001 to 10000 kg (mass m)\n",
        ),
    ];
    for (arguments, message) in cases {
        let ended = folder.pilotage(&[&["export"], *arguments].concat());
        assert_eq!((ended.stderr.as_str(), ended.code), (*message, 2));
        assert_eq!(folder.files(), before);
    }
    let ended = folder.pilotage(&["export", "pilot", "good.toml", "--preset", "paper"]);
    assert!(
        ended.stderr.contains("cannot be used with"),
        "{}",
        ended.stderr
    );
    assert_eq!(ended.code, 2);
}

/// An installed program alone: no compiler in reach, no file beside it.
#[test]
fn the_executable_exports_by_itself() {
    let folder = Folder::new();
    let name = format!("alone{}", std::env::consts::EXE_SUFFIX);
    std::fs::copy(env!("CARGO_BIN_EXE_pilotage"), folder.path(&name)).unwrap();
    let run = || {
        Command::new(folder.path(&name))
            .args(["export", "quadcopter", "-o", "q.fmu"])
            .current_dir(folder.path(""))
            .env_clear()
            .output()
    };
    let mut output = run();
    // A process that another test starts holds the copy open for writing until it is what it starts.
    while (output.as_ref()).is_err_and(|error| error.kind() == ErrorKind::ExecutableFileBusy) {
        std::thread::sleep(std::time::Duration::from_millis(10));
        output = run();
    }
    let output = output.unwrap();
    assert!(output.status.success(), "{output:?}");
    let expected = package(
        &Model::quadcopter(&Quadcopter::default()),
        &Provenance::vehicle(None),
    );
    assert!(std::fs::read(folder.path("q.fmu")).unwrap() == expected.unwrap());
}

/// Who made an FMU and when stands in it if wanted; the same wishes give the same bytes.
#[test]
fn author_and_date_are_those_that_are_given() {
    let folder = crate::command::Folder::new();
    let export = |name: &str, arguments: &[&str], variables: &[(&str, &str)]| {
        let begin = ["export", "quadcopter", "-o", name];
        folder.pilotage_with(&[&begin, arguments].concat(), variables)
    };
    let made = |name: &str| {
        let info = folder.pilotage(&["info", name, "--json"]).json();
        (
            info["author"].clone(),
            info["generationDateAndTime"].clone(),
        )
    };
    let (author, date) = ("A. N. Other & Co.", "2026-01-31T12:00:00Z");
    let epoch = [("SOURCE_DATE_EPOCH", "1769860800")];
    for (name, arguments, variables) in [
        (
            "flag.fmu",
            &["--author", author, "--date", date][..],
            &[][..],
        ),
        ("epoch.fmu", &["--author", author], &epoch),
    ] {
        let ended = export(name, arguments, variables);
        assert_eq!(ended.code, 0, "{ended:?}");
        assert_eq!(made(name), (author.into(), date.into()));
    }
    let bytes = ["flag.fmu", "epoch.fmu"].map(|name| std::fs::read(folder.path(name)).unwrap());
    assert_eq!(bytes[0], bytes[1]);
    assert_eq!(export("none.fmu", &[], &[]).code, 0);
    assert_eq!(
        made("none.fmu"),
        (serde_json::Value::Null, serde_json::Value::Null)
    );

    let ended = export("a.fmu", &["--date", "31.1.2026"], &[]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.stderr.contains("expected YYYY-MM-DDThh:mm:ssZ"),
        "{ended:?}"
    );
    let ended = export("a.fmu", &[], &[("SOURCE_DATE_EPOCH", "today")]);
    let error = "error: SOURCE_DATE_EPOCH is `today`; expected seconds since 1970\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, error));
}

/// Importers take 0 for none, or references of FMI 3.0 for positions from 1.
#[test]
fn value_references_are_the_positions_from_1() {
    for (model, provenance) in models() {
        for version in [FmiVersion::V2, FmiVersion::V3] {
            let interface = Interface::of(&model);
            let described = pilotage::export::description(&interface, &provenance, version);
            let references: Vec<u32> = described
                .variables
                .iter()
                .map(|v| v.value_reference)
                .collect();
            let positions: Vec<u32> = (1..).take(references.len()).collect();
            assert_eq!(references, positions);
        }
    }
}
