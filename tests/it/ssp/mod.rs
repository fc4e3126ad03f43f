//! Systems of other tools (SSP): what each part of the standard means, by the same system as a file of pilotage; what others
//! stumbled over; mistakes; conversion; mutations.

mod convert;
mod mistakes;
mod mutations;
pub mod osp;
mod parts;

use crate::command::{Ended, Folder};
use crate::foreign;
use std::sync::OnceLock;

/// First-order lags, of metres and of feet.
const LAG: &str = "\
[model]
name = \"lag\"
[inputs]
u = { unit = \"m\" }
[parameters]
gain = { start = 1, unit = \"1\" }
tau = { start = 0.5, unit = \"s\", min = 0.01 }
level = { start = 0, unit = \"m\" }
[states]
x = { unit = \"m\", der = \"(gain * u + level - x) / tau\" }
[outputs]
y = { unit = \"m\", value = \"x\" }
";

/// The FMUs `lag.fmu` and `feet.fmu`.
fn fmus() -> &'static [Vec<u8>; 2] {
    static MADE: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = Folder::new();
        let feet = LAG
            .replace("\"m\"", "\"ft\"")
            .replace("\"lag\"", "\"feet\"");
        [("lag", LAG.to_owned()), ("feet", feet)].map(|(name, text)| {
            folder.write(&format!("{name}.toml"), text);
            let ended = folder.pilotage(&["export", &format!("{name}.toml")]);
            assert_eq!(ended.code, 0, "{ended:?}");
            std::fs::read(folder.path(&format!("{name}.fmu"))).unwrap()
        })
    })
}

/// An `.ssd` of that version with this in its root system, and this after it.
fn ssd(version: &str, system: &str, after: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
  xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
  xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
  xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary" version="{version}" name="Root-System">
<ssd:System name="Root-System">
{system}
</ssd:System>
{after}
</ssd:SystemStructureDescription>
"#
    )
}

/// A parameter set.
fn ssv(parameters: &[(&str, &str)], after: &str) -> String {
    let one = |(name, value): &(&str, &str)| {
        format!("<ssv:Parameter name=\"{name}\">{value}</ssv:Parameter>\n")
    };
    let all: String = parameters.iter().map(one).collect();
    format!(
        "<ssv:ParameterSet xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
         xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" version=\"1.0\" name=\"set\">\n\
         <ssv:Parameters>\n{all}</ssv:Parameters>{after}\n</ssv:ParameterSet>\n"
    )
}

/// Writes these files and the FMUs into the folder `name` and into the archive `name.ssp`.
fn write(folder: &Folder, name: &str, files: &[(&str, &str)]) {
    let [lag, feet] = fmus();
    let typed = foreign::fmu("good");
    let mut all: Vec<(&str, &[u8])> = files
        .iter()
        .map(|(name, text)| (*name, text.as_bytes()))
        .collect();
    all.push(("resources/lag.fmu", lag));
    all.push(("resources/feet.fmu", feet));
    all.push(("resources/typed.fmu", &typed));
    for (file, bytes) in &all {
        folder.write(&format!("{name}/{file}"), bytes);
    }
    folder.write(&format!("{name}.ssp"), foreign::archive(&all));
}

/// Simulates a system and gives the rows.
fn rows(folder: &Folder, arguments: &[&str]) -> String {
    let ended = folder.pilotage(&[&["cosim"], arguments, &["--step", "0.1"]].concat());
    assert_eq!(ended.code, 0, "{arguments:?} {ended:?}");
    folder.read("result.csv")
}

fn notes(ended: &Ended) -> Vec<&str> {
    (ended.stderr.lines().chain(ended.stdout.lines()))
        .filter(|line| line.contains("note"))
        .collect()
}
