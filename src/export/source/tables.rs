//! The tables of a model in C: sizes, variables, dependencies, and which functions may be called when.

use super::equations::number;
use super::{Equations, Subject};
use crate::fmi::description::FmiVersion;
use pilotage_abi::{Part, fmi2, fmi3};
use pilotage_sdk::structure::Unknown;
use pilotage_sdk::{Role, Table, Variable};
use std::fmt::Write;

/// The states of an instance, and for each function the states in which it may be called and its part of the interface.
macro_rules! calls {
    ($fmi:ident) => {{
        let states = $fmi::State::ALL;
        let mut names = vec![String::new(); 13];
        let mut text = String::new();
        for state in states {
            let _ = writeln!(text, "#define S_{state:?} 0x{:x}", state as u16);
            names[(state as u16).trailing_zeros() as usize] = string(state.name());
        }
        names.retain(|name| !name.is_empty());
        let _ = writeln!(text, "#define N_STATE_NAMES {}", names.len());
        for function in $fmi::Function::ALL {
            let legal = function
                .legal_states()
                .iter()
                .fold(0, |bits, state| bits | state as u16);
            let (name, part) = (&function.name()["fmi2".len()..], part(function.part()));
            let _ = writeln!(
                text,
                "#define MAY_{name} 0x{legal:x}\n#define PART_{name} {part}"
            );
        }
        text + "\n" + &list("const char *const calling_states", names, "\"\"")
    }};
}

/// The file `model.h`.
pub(super) fn header(subject: &Subject<'_>, equations: &Equations, version: FmiVersion) -> String {
    let mut text = "/* Sizes and variables of the model, and the order in which its functions may be called. */\n\n".to_owned();
    for (name, value) in sizes(subject, equations) {
        let _ = writeln!(text, "#define {name} {value}");
    }
    let _ = writeln!(
        text,
        "#define MODEL_GUID {}\n",
        string(&subject.interface.guid)
    );
    text += &variables(subject.table);
    text += &match version {
        FmiVersion::V2 => calls!(fmi2),
        FmiVersion::V3 => calls!(fmi3),
    };
    if version == FmiVersion::V3 {
        text += &dependencies(subject);
    }
    text
}

fn sizes(subject: &Subject<'_>, equations: &Equations) -> [(&'static str, usize); 16] {
    let (table, all) = (subject.table, subject.equations);
    let delays = all.exact.as_ref().map_or(0, |exact| exact.times.len());
    [
        ("N_STATES", table.n_states()),
        ("N_INPUTS", table.inputs().len()),
        ("N_PARAMETERS", table.parameters().len()),
        ("FIRST_PARAMETER", table.parameters().start),
        ("FIRST_START", table.starts().start),
        ("N_VALUES", table.starts().end),
        ("N_VARIABLES", table.variables().len()),
        ("N_COMPUTED", table.computed().count()),
        ("N_DELAYS", delays),
        ("N_TIMES", all.switches.len()),
        ("N_CURVES", equations.curves),
        (
            "HAS_SLOPES",
            usize::from(equations.text.contains("curve_slope(")),
        ),
        (
            "HAS_STARTS",
            usize::from(all.starts.iter().any(Option::is_some)),
        ),
        ("IS_LINEAR", usize::from(subject.is_linear && delays == 0)),
        ("IS_TEXT", usize::from(subject.is_text)),
        ("ALL_STATES", 0xffff),
    ]
}

/// A string in C.
fn string(text: &str) -> String {
    let mut out = "\"".to_owned();
    for own in text.chars() {
        match own {
            '"' | '\\' | '?' => out.extend(['\\', own]),
            own if own.is_control() => out.push(' '),
            own => out.push(own),
        }
    }
    out + "\""
}

fn variables(table: &Table) -> String {
    let mut places: Vec<(&str, usize)> = (0..table.variables().len())
        .map(|k| ("IN_VALUES", k))
        .collect();
    let lists: [(&str, Vec<usize>); 4] = [
        ("IN_OUTPUTS", table.computed().collect()),
        ("IN_STATES", table.x().collect()),
        ("IN_RATES", table.derivatives().collect()),
        ("IN_TIME", vec![table.time()]),
    ];
    for (place, indices) in lists {
        for (k, index) in indices.into_iter().enumerate() {
            places[index] = (place, k);
        }
    }
    let mut text = "static const Variable variables[N_VARIABLES] = {\n".to_owned();
    for (variable, (place, position)) in table.variables().iter().zip(places) {
        let [start, min, max] = [
            variable.start.unwrap_or(0.0),
            variable.min.unwrap_or(f64::NEG_INFINITY),
            variable.max.unwrap_or(f64::INFINITY),
        ]
        .map(number);
        let (label, role) = (string(&variable.label()), role(variable));
        let _ = writeln!(
            text,
            "    {{{label}, {role}, {place}, {position}, {start}, {min}, {max}}},"
        );
    }
    text += "};\n\n";
    let names = table
        .states()
        .map(|index| string(&table.variables()[index].name));
    text += &list("const char *const state_names", names.collect(), "\"\"");
    let nominals = table.nominals().into_iter().map(number);
    text + &list("const double nominals", nominals.collect(), "1.0")
}

/// A list with one element at least.
fn list(what: &str, mut elements: Vec<String>, other: &str) -> String {
    if elements.is_empty() {
        elements.push(other.to_owned());
    }
    format!(
        "static {what}[] = {{\n    {}}};\n\n",
        elements.join(",\n    ")
    )
}

fn role(variable: &Variable) -> &'static str {
    match variable.role {
        Role::Input => "INPUT",
        Role::Output => "OUTPUT",
        Role::Fixed => "FIXED",
        Role::Tunable => "TUNABLE",
        Role::State => "STATE",
        Role::Derivative => "DERIVATIVE",
        Role::Time => "CLOCK",
        // Models that are written as C have neither modes nor indicators.
        Role::Local | Role::Mode | Role::Indicator => "LOCAL",
    }
}

fn part(part: Part) -> &'static str {
    match part {
        Part::Common => "0",
        Part::CoSimulation => "CO_SIMULATION",
        Part::ModelExchange => "MODEL_EXCHANGE",
        Part::ScheduledExecution => "3",
    }
}

/// For each variable begin and end of its dependencies, -1 if it is no unknown; and these: index, and whether constant.
fn dependencies(subject: &Subject<'_>) -> String {
    let structure = &subject.interface.structure;
    let unknown = |index: usize| -> Option<&Unknown> {
        let initial = || structure.initial.iter().find(|own| own.index == index);
        structure.unknown(index).or_else(initial)
    };
    let (mut ends, mut all) = (Vec::new(), Vec::new());
    for index in 0..subject.table.variables().len() {
        let Some(unknown) = unknown(index) else {
            ends.push("{-1, -1}".to_owned());
            continue;
        };
        let begin = all.len();
        let own = unknown.dependencies.iter();
        all.extend(own.map(|own| format!("{{{}, {}}}", own.index, u8::from(own.constant))));
        ends.push(format!("{{{begin}, {}}}", all.len()));
    }
    let ends = list("const int dependency_ends", ends, "{-1, -1}").replacen("[]", "[][2]", 1);
    ends + &list("const int dependencies", all, "{0, 0}").replacen("[]", "[][2]", 1)
}
