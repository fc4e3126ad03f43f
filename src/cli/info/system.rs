//! A system: its instances, connections, free inputs and outputs.

use super::super::Failure;
use super::super::format::aligned;
use super::super::overwrite::{self, OutputKind, Overwrite};
use super::super::system::{Built, file, open};
use super::Args;
use crate::cli::terminal;
use crate::cosim::description::{InstanceDescription, InstanceSource, SystemDescription};
use crate::cosim::system::Link;
use crate::cosim::{Conversion, System, Variable};
use crate::report::diagram::{Arrow, Block, to_svg};
use crate::report::png::to_png;
use pilotage_systems::{is_foreign, is_ssp};
use serde_json::{Value, json};
use std::path::Path;

/// Pixels per inch of a .png.
const PIXELS: f32 = 200.0;

/// The system of a file as text or JSON.
pub(super) fn of(args: &Args) -> Result<String, Failure> {
    let file = args.fmu.as_path();
    let read = file::read(file, args.variant.as_deref())?;
    let variants = match is_ssp(file) {
        true => Some(pilotage_systems::variants(file)?),
        false => None,
    };
    let Built {
        system,
        description,
        ..
    } = open(read.description)?;
    let mut description = description;
    match &read.unpacked {
        Some(folder) => name_in(&mut description, file, folder),
        // The functions of OSP are models in files of ours.
        None if !description.kept.is_empty() => {
            name_in(&mut description, Path::new(""), &std::env::temp_dir())
        }
        None => {}
    }
    if let Some(figure) = &args.figure {
        draw(file, figure, &system, &description, &args.overwrite)?;
    }
    if args.json {
        let mut json = to_json(file, &system, &description);
        if is_foreign(file) {
            json["annotations"] = json!(read.annotations);
            json["notes"] = json!(read.notes);
        }
        if let Some(variants) = variants {
            json["variants"] = json!(variants);
        }
        return Ok(format!("{json:#}\n"));
    }
    for note in &read.notes {
        terminal::note(note);
    }
    let mut text = to_text(file, &system, &description);
    for (what, list) in [
        (
            "variants",
            variants.filter(|own| own.len() > 1).unwrap_or_default(),
        ),
        ("annotations", read.annotations),
    ] {
        if !list.is_empty() {
            text += &format!("\n{what}: {}\n", list.join(", "));
        }
    }
    Ok(text)
}

/// Draws the system into a file.
fn draw(
    file: &Path,
    figure: &Path,
    system: &System,
    description: &SystemDescription,
    overwrite: &Overwrite,
) -> Result<(), Failure> {
    overwrite.check(&[file.to_owned()], &[(figure, OutputKind::Figure)])?;
    let blocks: Vec<Block> = (description.instances.iter())
        .map(|own| {
            let what = source(own).1;
            let what = Path::new(&what)
                .file_name()
                .map_or(what.clone(), |own| own.to_string_lossy().into_owned());
            Block {
                lines: [own.name.clone(), what],
            }
        })
        .collect();
    let mut arrows: Vec<Arrow> = Vec::new();
    for Link { from, to, .. } in system.links() {
        let end = |name: &str| {
            let (instance, variable) = description.split(name)?;
            let number = description
                .instances
                .iter()
                .position(|own| own.name == instance)?;
            Some((number, variable.to_owned()))
        };
        let (Some((from, output)), Some((to, input))) = (end(&from.0), end(&to.0)) else {
            continue;
        };
        let line = if output == input {
            output
        } else {
            format!("{output} → {input}")
        };
        match arrows
            .iter_mut()
            .find(|own| (own.from, own.to) == (from, to))
        {
            Some(own) => own.lines.push(line),
            None => arrows.push(Arrow {
                from,
                to,
                lines: vec![line],
            }),
        }
    }
    let title = file.file_name().unwrap_or_default().to_string_lossy();
    let svg = to_svg(&title, &blocks, &arrows);
    let bytes = match figure.extension().and_then(|own| own.to_str()) {
        Some("svg") => svg.into_bytes(),
        Some("png") => to_png(&svg, PIXELS)?,
        _ => {
            return Err(Failure::new(format!(
                "{} is neither .svg nor .png",
                figure.display()
            )));
        }
    };
    overwrite::save(figure, bytes)
}

/// Names files of an unpacked archive as those of the archive.
fn name_in(description: &mut SystemDescription, archive: &Path, folder: &Path) {
    for own in &mut description.instances {
        if let InstanceSource::Model(file) = &mut own.source.value
            && let Ok(inside) = file.strip_prefix(folder)
        {
            *file = archive.join(inside);
        }
    }
}

fn unit(variable: &Variable) -> &str {
    variable.unit.as_ref().map_or("", |unit| unit.name.as_str())
}

/// `model` or `table`, and its name or path.
fn source(instance: &InstanceDescription) -> (&'static str, String) {
    match &instance.source.value {
        InstanceSource::BuiltIn(name) => ("model", name.clone()),
        InstanceSource::Model(file) => ("model", file.display().to_string()),
        InstanceSource::Table(file) => ("table", file.display().to_string()),
    }
}

fn to_json(file: &Path, system: &System, description: &SystemDescription) -> Value {
    let instances = description.instances.iter().map(|instance| {
        let (key, source) = source(instance);
        let set: serde_json::Map<String, Value> = (description.settings_of(&instance.name))
            .map(|(variable, value)| (variable.to_owned(), json!(value)))
            .collect();
        json!({ "name": instance.name, key: source, "set": set })
    });
    let connections = system.links().map(
        |Link {
             from,
             to,
             conversion,
             map,
         }| {
            let map = map
                .iter()
                .map(|(from, to)| [from.to_string(), to.to_string()]);
            json!({
                "from": from.0,
                "fromUnit": unit(from.1),
                "fromType": from.1.kind.to_string(),
                "to": to.0,
                "toUnit": unit(to.1),
                "toType": to.1.kind.to_string(),
                "factor": conversion.factor,
                "offset": conversion.offset,
                "map": map.collect::<Vec<_>>(),
            })
        },
    );
    let listed = |(name, v): (String, &Variable)| json!({ "name": name, "unit": unit(v), "type": v.kind.to_string() });
    json!({
        "file": file.display().to_string(),
        "instances": instances.collect::<Vec<_>>(),
        "connections": connections.collect::<Vec<_>>(),
        "inputs": system.free_inputs().map(listed).collect::<Vec<_>>(),
        "outputs": system.outputs().map(listed).collect::<Vec<_>>(),
    })
}

fn to_text(file: &Path, system: &System, description: &SystemDescription) -> String {
    let instances = description.instances.iter().map(|instance| {
        let set = description.settings_of(&instance.name);
        let set: Vec<String> = set
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        [instance.name.clone(), source(instance).1, set.join(", ")]
    });
    let own = |v: &Variable| match unit(v) {
        "" => v.kind.to_string(),
        unit => unit.to_owned(),
    };
    let connections = system.links().map(
        |Link {
             from,
             to,
             conversion,
             map,
         }| {
            let is_same =
                conversion == Conversion::NONE && map.is_empty() && from.1.kind == to.1.kind;
            let converted = if is_same { "" } else { "converted" };
            let (from, to) = ((from.0, own(from.1)), (to.0, own(to.1)));
            [from.0, from.1, to.0, to.1, converted.to_owned()]
        },
    );
    let listed = |(name, v): (String, &Variable)| [name, v.kind.to_string(), unit(v).to_owned()];
    let tables = [
        table(["instance", "model", "set"], instances),
        table(["from", "unit", "to", "unit", ""], connections),
        table(
            ["free input", "type", "unit"],
            system.free_inputs().map(listed),
        ),
        table(["output", "type", "unit"], system.outputs().map(listed)),
    ];
    let tables: Vec<String> = tables.into_iter().flatten().collect();
    format!("{}\n\n{}", terminal::shown(file), tables.join("\n"))
}

/// A table with header; `None` if it has no rows.
fn table<const N: usize>(
    header: [&str; N],
    rows: impl Iterator<Item = [String; N]>,
) -> Option<String> {
    let rows: Vec<[String; N]> = std::iter::once(header.map(str::to_owned))
        .chain(rows)
        .collect();
    (rows.len() > 1).then(|| aligned(&rows))
}
