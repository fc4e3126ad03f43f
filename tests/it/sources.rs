//! Models as C99 sources: compiled by `cc` with all warnings as errors, they give the results of the binary.

use crate::command::Folder;
use crate::export::{files, text};
use pilotage::export::compile::{Compiler, compile, plan};
use pilotage::export::{Export, Provenance};
use pilotage::fmi::description::{Causality, FmiVersion, VariableKind};
use pilotage::fmi::{Fmu, Instance, InterfaceType, Step};
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter, TextModel};
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

/// Delays of signals, conditions on time and states, a table, a power with a free exponent, a limit, a start value of parameters,
/// and a square root where it has no derivative.
const DELAYED: &str = r#"[model]
name = "delayed"
[inputs]
target = {}
position = {}
[parameters]
gain = { start = 0.8, min = 0 }
lag = { start = 0.2, min = 0.02, tunable = true }
tau = { start = 0.3, min = 0.01 }
begin = { start = 1.03 }
[states]
arm = { der = "(wish - arm) / lag" }
v = { start = "gain / 2", der = "-v + sqrt(abs(arm) + 0.01) * sign(arm) + table('t.csv', arm) ^ lag" }
[locals]
error = { value = "target - position + if(time > begin, 0.5, sin(3 * target))" }
wish = { value = "gain * delay(error, tau) + 0.1 * delay(arm, 0.11) - 0.2 * max(v, arm) ^ 3 + atan2(v, 1 + arm ^ 2)" }
[outputs]
stick = { value = "arm + 0.1 * exp(-v ^ 2) + 0.001 * sqrt(target ^ 2)", limit = [-1, 0.6] }
"#;
const TABLE: &str = "x,y\n-2,1\n-0.5,0.2\n0,0.1\n0.4,0.3\n2,2\n";

/// Warnings of these are errors.
const CC: [&str; 6] = ["cc", "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"];

/// Writes FMUs of a model: with its binary, and with the binary that a compiler makes of its sources.
fn both(
    folder: &Folder,
    name: &str,
    version: FmiVersion,
    bytes: &[u8],
    cc: &[&str],
) -> [PathBuf; 2] {
    let [binary, sources, compiled] = ["binary", "sources", "compiled"]
        .map(|own| folder.path(&format!("{name}{version}-{own}.fmu")));
    std::fs::write(&binary, bytes).unwrap();
    std::fs::write(&sources, stripped(bytes)).unwrap();
    let mut fmu = Fmu::open(&sources).unwrap();
    let compiler = Compiler {
        command: cc.iter().map(|own| (*own).to_owned()).collect(),
        limit: 100.0,
    };
    let builds = plan(&mut fmu).unwrap();
    let made = compile(&mut fmu, &builds, &compiler)
        .unwrap_or_else(|error| panic!("{name}: {error} {error:?}"));
    std::fs::write(&compiled, made).unwrap();
    [binary, compiled]
}

/// The FMU without its binaries.
pub fn stripped(bytes: &[u8]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files(bytes) {
        if !name.starts_with("binaries/") {
            zip.start_file(name, zip::write::SimpleFileOptions::default())
                .unwrap();
            zip.write_all(&content).unwrap();
        }
    }
    zip.finish().unwrap().into_inner()
}

/// All that an instance of co-simulation tells in a run with inputs that jump and rise, parameters that are set, and a return to a
/// state that was saved as bytes.
fn stepped(path: &Path) -> Vec<f64> {
    let (mut own, lists) = begun(path, InterfaceType::CoSimulation);
    let Lists {
        inputs,
        all,
        unknowns,
        states,
    } = lists;
    own.exit_initialization_mode().unwrap();
    let (mut told, mut saved, mut time) = (Vec::new(), None, 0.0);
    for k in 0..90 {
        let h = [0.05, 0.02, 0.1][k / 30];
        for (i, input) in inputs.iter().enumerate() {
            own.set_real(
                &[*input],
                &[[1.0, -0.7, 0.2 * (k as f64).sin(), 0.0][(k / 7 + i) % 4]],
            )
            .unwrap();
            if own.version() == FmiVersion::V2 {
                own.set_input_derivatives(&[*input], &[1], &[0.3 * (k % 5) as f64])
                    .unwrap();
            }
        }
        match own.do_step_revocably(time, h).unwrap() {
            Step::Done => time += h,
            other => panic!("{k}: {other:?}"),
        }
        if k == 40 {
            let state = own.save().unwrap();
            saved = Some((own.serialize(state).unwrap(), time));
        }
        if let (60, Some((bytes, then))) = (k, saved.take()) {
            let state = own.deserialize(&bytes).unwrap();
            own.restore(state).unwrap();
            time = then;
        }
        told.extend(values(&mut own, &all));
        told.extend(directional(
            &mut own,
            &unknowns,
            &[&inputs[..], &states].concat(),
        ));
    }
    told
}

fn values(own: &mut Instance, all: &[u32]) -> Vec<f64> {
    let mut values = vec![0.0; all.len()];
    own.get_real(all, &mut values).unwrap();
    values
}

fn directional(own: &mut Instance, unknowns: &[u32], knowns: &[u32]) -> Vec<f64> {
    let mut told = Vec::new();
    for known in knowns {
        let mut result = vec![0.0; unknowns.len()];
        own.directional_derivative(unknowns, &[*known], &[1.5], &mut result)
            .unwrap();
        told.extend(result);
    }
    told
}

/// What an instance of model exchange tells at some points.
fn exchanged(path: &Path) -> Vec<f64> {
    let (mut own, lists) = begun(path, InterfaceType::ModelExchange);
    own.exit_initialization_mode().unwrap();
    let update = own.update_discrete_states().unwrap();
    let mut told = vec![update.next_time.unwrap_or(-1.0)];
    own.enter_continuous_time_mode().unwrap();
    let n = own.number_of_continuous_states().unwrap();
    for k in 0..10 {
        let at = |i: usize| ((3 * k + i) as f64).sin();
        own.set_time(0.3 * k as f64).unwrap();
        own.set_continuous_states(&(0..n).map(at).collect::<Vec<_>>())
            .unwrap();
        for (i, input) in lists.inputs.iter().enumerate() {
            own.set_real(&[*input], &[at(i + 7)]).unwrap();
        }
        let mut rates = vec![0.0; n];
        own.get_derivatives(&mut rates).unwrap();
        told.extend(rates);
        told.extend(values(&mut own, &lists.all));
        told.extend(directional(
            &mut own,
            &lists.unknowns,
            &[&lists.inputs[..], &lists.states].concat(),
        ));
        if own.version() == FmiVersion::V3 {
            let mut result = vec![0.0; lists.inputs.len()];
            let seed = vec![0.7; lists.unknowns.len()];
            own.adjoint_derivative(&lists.unknowns, &lists.inputs, &seed, &mut result)
                .unwrap();
            told.extend(result);
        }
    }
    let (mut nominals, mut states) = (vec![0.0; n], vec![0.0; n]);
    own.get_nominals(&mut nominals).unwrap();
    own.get_continuous_states(&mut states).unwrap();
    [told, nominals, states].concat()
}

/// Value references.
struct Lists {
    inputs: Vec<u32>,
    all: Vec<u32>,
    unknowns: Vec<u32>,
    states: Vec<u32>,
}

/// An instance in initialization mode, with the first parameter a little larger than at the start.
fn begun(path: &Path, kind: InterfaceType) -> (Instance, Lists) {
    let mut fmu = Fmu::open(path).unwrap();
    let d = fmu.description().clone();
    let of = |causality| {
        d.variables
            .iter()
            .filter(move |v| v.causality == causality)
            .map(|v| v.value_reference)
    };
    let derivatives = d.structure.derivatives.iter().map(|own| own.index);
    // Ours are listed by their value references, from 1.
    let variable = |index: u32| &d.variables[index as usize - 1];
    let derivatives: Vec<_> = derivatives.map(variable).collect();
    let states = derivatives.iter().filter_map(|v| match &v.kind {
        VariableKind::Real(own) => own.derivative,
        _ => None,
    });
    let states = states.map(|k| variable(k).value_reference);
    let lists = Lists {
        inputs: of(Causality::Input).collect(),
        all: d
            .variables
            .iter()
            .filter(|v| v.causality != Causality::Independent)
            .map(|v| v.value_reference)
            .collect(),
        unknowns: of(Causality::Output)
            .chain(derivatives.iter().map(|v| v.value_reference))
            .collect(),
        states: states.collect(),
    };
    let parameter = of(Causality::Parameter).next();
    let mut own = fmu.load().unwrap().instantiate("own", kind).unwrap();
    own.setup_experiment(Some(1e-8), 0.0, None).unwrap();
    own.enter_initialization_mode().unwrap();
    if let Some(parameter) = parameter {
        let start = values(&mut own, &[parameter])[0];
        own.set_real(&[parameter], &[1.05 * start]).unwrap();
    }
    (own, lists)
}

/// Compares what the binary and the compiled sources tell.
pub fn compare(name: &str, [binary, compiled]: &[PathBuf; 2]) {
    for told in [stepped, exchanged] {
        let [first, second] = [told(binary), told(compiled)];
        assert_eq!(first.len(), second.len());
        assert!(first.iter().any(|own| *own != 0.0), "{name}");
        for (k, (a, b)) in first.iter().zip(&second).enumerate() {
            // Differences of what is not smooth have eight digits.
            assert!(
                (a - b).abs() <= 1e-12 * (1.0 + a.abs()),
                "{name}, {k}: {a} {b}"
            );
        }
    }
}

/// FMUs with sources: name of the model, version, bytes.
pub fn exported(folder: &Folder) -> Vec<(&'static str, FmiVersion, Vec<u8>)> {
    folder.write("delayed.toml", DELAYED);
    folder.write("t.csv", TABLE);
    let provenance = Provenance::default();
    let delayed = TextModel::read(&folder.path("delayed.toml")).unwrap();
    let pilot = Model::pilot(&PAPER_THETA, 1.0);
    let quadcopter = Model::quadcopter(&Quadcopter::default());
    let mut all = Vec::new();
    for version in [FmiVersion::V2, FmiVersion::V3] {
        for (name, export) in [
            ("pilot", Export::new(&pilot, &provenance)),
            ("quadcopter", Export::new(&quadcopter, &provenance)),
            ("delayed", Export::text(&delayed, &provenance)),
        ] {
            let bytes = export.version(version).sources().bytes();
            all.push((name, version, bytes.expect("it is exported")));
        }
    }
    all
}

/// All models of the tests: FMUs with their binary, and with that which a compiler makes of their sources.
pub fn each(cc: &[&str], mut tell: impl FnMut(&str, [PathBuf; 2])) {
    let folder = Folder::new();
    for (name, version, bytes) in exported(&folder) {
        tell(name, both(&folder, name, version, &bytes, cc));
    }
}

#[test]
#[cfg(unix)]
fn sources_give_the_results_of_the_binary() {
    each(&CC, |name, fmus| compare(name, &fmus));
}

/// Steps of a given length, without control of their error: near the binary's results, and not these.
#[test]
#[cfg(unix)]
fn fixed_steps_come_near_the_binary() {
    let folder = Folder::new();
    let all = exported(&folder);
    let (name, version, bytes) = all.iter().find(|(name, ..)| *name == "quadcopter").unwrap();
    let cc = [&CC[..], &["-DPILOTAGE_FIXED_STEP=0.002"]].concat();
    let [first, second] = both(&folder, name, *version, bytes, &cc).map(|path| stepped(&path));
    let pairs = first.iter().zip(&second);
    let off = pairs.map(|(a, b)| (a - b).abs() / (1.0 + a.abs()));
    let off = off.fold(0.0, f64::max);
    assert!(off > 1e-13 && off < 1e-6, "{off:e}");
}

/// FMI 2.0.5, section 2.2.4; FMI 3.0, section 2.5.1.2.1.
#[test]
fn descriptions_name_the_file_that_is_compiled() {
    let provenance = Provenance::default();
    let quadcopter = Model::quadcopter(&Quadcopter::default());
    let of = |version| {
        let export = Export::new(&quadcopter, &provenance)
            .version(version)
            .sources();
        files(&export.bytes().unwrap())
    };
    let [second, third] = [FmiVersion::V2, FmiVersion::V3].map(of);
    let list = "<SourceFiles>\n      <File name=\"quadcopter.c\"/>\n    </SourceFiles>";
    assert_eq!(
        text(&second, "modelDescription.xml").matches(list).count(),
        2
    );
    assert!(!text(&third, "modelDescription.xml").contains("SourceFiles"));
    assert!(
        text(&third, "sources/buildDescription.xml")
            .contains("<SourceFile name=\"quadcopter.c\"/>")
    );
    assert!(
        third.contains_key("sources/quadcopter.c") && second.contains_key("sources/quadcopter.c")
    );
}

/// `pilotage compile`: says what it compiles, and what the compiler said; `info` and `cosim` say what to do.
#[test]
#[cfg(unix)]
fn an_fmu_with_sources_alone_is_compiled_by_command() {
    let folder = Folder::new();
    assert_eq!(
        folder
            .pilotage(&["export", "quadcopter", "--source", "-o", "q.fmu"])
            .code,
        0
    );
    let bytes = stripped(&std::fs::read(folder.path("q.fmu")).unwrap());
    folder.write("alone.fmu", &bytes);
    let info = folder.pilotage(&["info", "alone.fmu"]);
    assert!(
        info.stdout
            .contains("; sources, of which `pilotage compile` makes one"),
        "{}",
        info.stdout
    );
    let cosim = folder.pilotage(&["cosim", "alone.fmu", "--stop-time", "1", "-o", "r.csv"]);
    assert_eq!(cosim.code, 2);
    assert!(
        cosim
            .stderr
            .contains("it has sources, of which `pilotage compile` makes one"),
        "{}",
        cosim.stderr
    );
    let made = folder.pilotage(&["compile", "alone.fmu", "-o", "made.fmu"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    assert!(
        made.stderr
            .contains("compiling quadcopter.c of alone.fmu with `"),
        "{}",
        made.stderr
    );
    let valid = folder.pilotage(&["validate", "made.fmu"]);
    assert_eq!(valid.code, 0, "{}{}", valid.stdout, valid.stderr);
    let refused = folder.pilotage(&["compile", "made.fmu", "-o", "made.fmu"]);
    assert_eq!(refused.code, 2);

    let mut broken = files(&bytes);
    broken.insert(
        "sources/quadcopter.c".to_owned(),
        b"#include \"fmi2Functions.h\"\nint f( {\n".to_vec(),
    );
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in broken {
        zip.start_file(name, zip::write::SimpleFileOptions::default())
            .unwrap();
        zip.write_all(&content).unwrap();
    }
    folder.write("broken.fmu", zip.finish().unwrap().into_inner());
    let failed = folder.pilotage(&["compile", "broken.fmu", "-o", "no.fmu"]);
    assert_eq!(failed.code, 2);
    assert!(
        failed
            .stderr
            .contains("error: compiling `quadcopter.c` failed"),
        "{}",
        failed.stderr
    );
    assert!(
        failed.stderr.contains("sources/quadcopter.c:2"),
        "{}",
        failed.stderr
    );
    assert!(!folder.path("no.fmu").exists());
    let missing = folder.pilotage(&["compile", "alone.fmu", "--cc", "no-such-compiler"]);
    assert!(
        missing.stderr.contains("cannot be started") && missing.stderr.contains("hint: "),
        "{}",
        missing.stderr
    );
}
