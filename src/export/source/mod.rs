//! Models as C99 sources of FMUs (FMI 2.0.5, section 2.3; FMI 3.0, section 2.5.1.2).
//!
//! What differs between models is generated: their equations as straight-line code, and tables of their variables. All else is
//! one runtime, `c/core.h`, with the functions of a version of FMI in `c/fmi2.h` or `c/fmi3.h`. One file is compiled and includes
//! the others, so that nothing but functions of FMI is visible.

mod equations;
mod tables;

use super::ExportError;
use crate::fmi::description::FmiVersion;
use equations::{NoC, Target, Writer};
use pilotage_expression::{Curve, Node, System};
use pilotage_models::expressions::AllExpressions;
use pilotage_sdk::{Interface, Table};
use std::collections::BTreeMap;
use std::fmt::Write;

const CORE: &str = include_str!("c/core.h");
const FMI2: &str = include_str!("c/fmi2.h");
const FMI3: &str = include_str!("c/fmi3.h");

/// Derivative of a power.
const POWER1: &str = "
static double power1(double a, double b, double a1, double b1)
{
    if (a > 0.0) return b1 == 0.0 ? b * pow(a, b - 1.0) * a1 : pow(a, b) * (b1 * log(a) + b * a1 / a);
    if ((a == 0.0 && b > 1.0) || a1 == 0.0 || b == 0.0) return 0.0;
    return b * pow(a, b - 1.0) * a1;
}
";

/// Second derivative of a power.
const POWER2: &str = "
static double power2(double a, double b, double a1, double b1, double a2, double b2)
{
    if (a > 0.0) {
        double rate = b1 * log(a) + b * a1 / a;
        return pow(a, b) * (rate * rate + b2 * log(a) + (2.0 * b1 * a1 + b * a2) / a - b * a1 * a1 / (a * a));
    }
    if ((a == 0.0 && b > 1.0) || b == 0.0) return 0.0;
    return b * ((b - 1.0) * pow(a, b - 2.0) * a1 * a1 + pow(a, b - 1.0) * a2);
}
";

/// A model to be written as C.
#[derive(Debug)]
pub struct Subject<'s> {
    /// Its variables.
    pub table: &'s Table,
    /// Its interface.
    pub interface: &'s Interface,
    /// Its equations.
    pub equations: &'s AllExpressions,
    /// Whether derivatives are linear in states and inputs.
    pub is_linear: bool,
    /// Whether values that are not finite are refused when they are read, as those of model files are.
    pub is_text: bool,
}

/// The file that is compiled.
pub fn main_file(model_identifier: &str) -> String {
    format!("{model_identifier}.c")
}

/// The files in `sources` by name.
///
/// # Errors
/// If the equations have what C cannot express.
pub fn files(
    subject: &Subject<'_>,
    version: FmiVersion,
) -> Result<BTreeMap<String, Vec<u8>>, ExportError> {
    let name = &subject.interface.name;
    let equations = equations(subject).map_err(|NoC| ExportError::NoSource {
        model: name.clone(),
        reason: "they call functions of a binary".to_owned(),
    })?;
    let (skin, runtime, reference, order) = match version {
        FmiVersion::V2 => ("fmi2.h", FMI2, "unsigned", "int"),
        FmiVersion::V3 => ("fmi3.h", FMI3, "uint32_t", "int32_t"),
    };
    let main = format!(
        "/* The model {name}, written by pilotage {}. This file alone is compiled: C99, with the mathematical functions of the\n \
         * C library (-lm). With PILOTAGE_FIXED_STEP defined as a number of seconds, steps of the integrator have that length\n \
         * instead of one that follows from the tolerance. */\n\n\
         #include <stdint.h>\n\n/* Value references, and orders of derivatives. */\ntypedef {reference} Reference;\n\
         typedef {order} Order;\n\n#include \"core.h\"\n#include \"{skin}\"\n",
        env!("CARGO_PKG_VERSION")
    );
    let model = tables::header(subject, &equations, version);
    let mut files = BTreeMap::from([
        (main_file(name), main),
        ("core.h".to_owned(), CORE.to_owned()),
        (skin.to_owned(), runtime.to_owned()),
        ("model.h".to_owned(), model),
        ("equations.h".to_owned(), equations.text),
    ]);
    if version == FmiVersion::V3 {
        files.insert("buildDescription.xml".to_owned(), build_description(name));
    }
    Ok(files
        .into_iter()
        .map(|(name, text)| (name, text.into_bytes()))
        .collect())
}

/// How the sources are compiled (FMI 3.0, section 2.5.1.2.1).
fn build_description(name: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  \
         <BuildConfiguration modelIdentifier=\"{name}\">\n    <SourceFileSet language=\"C99\">\n      \
         <SourceFile name=\"{}\"/>\n    </SourceFileSet>\n    <Library name=\"m\" external=\"true\"/>\n  \
         </BuildConfiguration>\n</fmiBuildDescription>\n",
        main_file(name)
    )
}

/// The file of the equations, and what it has.
struct Equations {
    text: String,
    curves: usize,
}

fn equations(subject: &Subject<'_>) -> Result<Equations, NoC> {
    let all = subject.equations;
    let own = &all.equations;
    let writer = |of: &'static str| Functions::new(own, of, None, 0);
    let mut code = writer("model").equations()?;
    if all.starts.iter().any(Option::is_some) {
        let starts = all.starts.iter().enumerate();
        let targets = starts.filter_map(|(k, node)| Some((format!("start[{k}]"), (*node)?, 0)));
        code += &writer("model").of_parameters(
            "starts",
            "const double *p, double *start",
            targets.collect(),
        )?;
    }
    if !all.switches.is_empty() {
        let targets = listed("times", &all.switches);
        let arguments = "const double *u, const double *p, double *times";
        code += &writer("model").of_parameters("switches", arguments, targets)?;
    }
    let mut curves: Vec<&Curve> = own.graph.curves().iter().map(|curve| &**curve).collect();
    if let Some(exact) = &all.exact {
        let functions =
            Functions::new(&exact.equations, "exact", Some(&exact.states), curves.len());
        let functions = Functions {
            all_states: all.equations.states,
            ..functions
        };
        code += &functions.equations()?;
        code += &functions.signals(&exact.signals)?;
        let times = listed("tau", &exact.times);
        let delays = Functions {
            prefix: "delay",
            ..functions
        };
        code += &delays.of_parameters("times", "const double *p, double *tau", times)?;
        curves.extend(exact.equations.graph.curves().iter().map(|curve| &**curve));
    }
    let mut text = "/* The equations of the model: t time, x states, u inputs, p parameters; 1 and 2 after a name are for derivatives\n \
                    * along a direction, as are d and e before a number. */\n"
        .to_owned();
    for (k, curve) in curves.iter().enumerate() {
        text += &table(k, curve);
    }
    let helpers = [("power1(", POWER1), ("power2(", POWER2)];
    text.extend(
        helpers
            .into_iter()
            .filter(|(call, _)| code.contains(call))
            .map(|(_, helper)| helper),
    );
    Ok(Equations {
        text: text + &code,
        curves: curves.len(),
    })
}

/// A curve as constants.
fn table(k: usize, curve: &Curve) -> String {
    let [x, y] = curve.points();
    let list = |values: &[f64]| {
        let values: Vec<String> = values.iter().map(|own| equations::number(*own)).collect();
        let lines: Vec<String> = values.chunks(8).map(|line| line.join(", ")).collect();
        lines.join(",\n    ")
    };
    let steps = u8::from(y.len() < x.len());
    format!(
        "\n#define CURVE{k} {}, {steps}\nstatic const double curve{k}_x[] = {{\n    {}}};\nstatic const double curve{k}_y[] = {{\n    {}}};\n",
        x.len(),
        list(x),
        list(y)
    )
}

/// An element of a list for each expression.
fn listed(place: &str, nodes: &[Node]) -> Vec<Target> {
    let nodes = nodes.iter().enumerate();
    nodes
        .map(|(k, node)| (format!("{place}[{k}]"), *node, 0))
        .collect()
}

/// The functions of some equations.
#[derive(Clone, Copy)]
struct Functions<'e> {
    own: &'e System,
    prefix: &'static str,
    /// Places of the states in a list that has others, too.
    places: Option<&'e [usize]>,
    all_states: usize,
    first_curve: usize,
}

const VALUES: [&str; 4] = ["t", "x", "u", "p"];
const NONE: [&str; 4] = [""; 4];

impl<'e> Functions<'e> {
    fn new(
        own: &'e System,
        prefix: &'static str,
        places: Option<&'e [usize]>,
        first_curve: usize,
    ) -> Self {
        Self {
            own,
            prefix,
            places,
            all_states: own.states,
            first_curve,
        }
    }

    fn function(
        &self,
        name: &str,
        arguments: &str,
        names: equations::Names,
        targets: &[Target],
    ) -> Result<String, NoC> {
        let writer = Writer {
            graph: &self.own.graph,
            sizes: [self.own.states, self.own.inputs, self.own.parameters],
            places: self.places,
            first_curve: self.first_curve,
            names,
        };
        let body = writer.body(targets)?;
        Ok(format!(
            "\nstatic void {}_{name}({arguments})\n{{\n{body}}}\n",
            self.prefix
        ))
    }

    /// Derivatives and outputs, and both with their derivatives along a direction.
    fn equations(&self) -> Result<String, NoC> {
        let (rates, outputs) = (self.rates("dx", 0), self.outputs("y", 0));
        let values = [VALUES, NONE, NONE];
        let point = "double t, const double *x, const double *u, const double *p";
        let mut text = self.unset(
            "rates",
            "dx",
            &format!("{point}, double *dx"),
            values,
            &rates,
        )?;
        text += &self.unset(
            "outputs",
            "y",
            &format!("{point}, double *y"),
            values,
            &outputs,
        )?;
        let all = [rates, self.rates("dx1", 1), outputs, self.outputs("y1", 1)].concat();
        let arguments = "double t, double t1, const double *x, const double *x1, const double *u,\n    const double *u1, \
                         const double *p, const double *p1, double *dx, double *dx1, double *y, double *y1";
        let first = [VALUES, ["t1", "x1", "u1", "p1"], NONE];
        text += &self.unset("forward", "dx, dx1, y, y1", arguments, first, &all)?;
        Ok(text)
    }

    /// A function with results that may be none; states of approximations do not change.
    fn unset(
        &self,
        name: &str,
        results: &str,
        arguments: &str,
        names: equations::Names,
        targets: &[Target],
    ) -> Result<String, NoC> {
        let mut text = self.function(name, arguments, names, targets)?;
        let mut end = String::new();
        for result in results.split(", ") {
            let _ = writeln!(end, "    (void){result};");
            let still =
                (0..self.all_states).filter(|k| self.places.is_some_and(|own| !own.contains(k)));
            for state in still.filter(|_| result.starts_with("dx")) {
                let _ = writeln!(end, "    {result}[{state}] = 0.0;");
            }
        }
        text.insert_str(text.len() - 2, &end);
        Ok(text)
    }

    fn rates(&self, list: &str, part: usize) -> Vec<Target> {
        let place = |k: usize| self.places.map_or(k, |places| places[k]);
        let rates = self.own.derivatives.iter().enumerate();
        rates
            .map(|(k, node)| (format!("{list}[{}]", place(k)), *node, part))
            .collect()
    }

    fn outputs(&self, list: &str, part: usize) -> Vec<Target> {
        let outputs = self.own.outputs.iter().enumerate();
        outputs
            .map(|(k, node)| (format!("{list}[{k}]"), *node, part))
            .collect()
    }

    /// The delayed signals with two derivatives along the solution.
    fn signals(&self, signals: &[Node]) -> Result<String, NoC> {
        let jet = |(k, node): (usize, &Node)| {
            [0, 1, 2].map(|part| (format!("jets[{k}][{part}]"), *node, part))
        };
        let targets: Vec<Target> = signals.iter().enumerate().flat_map(jet).collect();
        let names = [VALUES, ["1.0", "x1", "u1", ""], ["", "x2", "u2", ""]];
        let arguments = "double t, const double *x, const double *x1, const double *x2, const double *u,\n    \
                         const double *u1, const double *u2, const double *p, double (*jets)[3]";
        self.function("signals", arguments, names, &targets)
    }

    /// A function of inputs and parameters alone.
    fn of_parameters(
        &self,
        name: &str,
        arguments: &str,
        targets: Vec<Target>,
    ) -> Result<String, NoC> {
        let has = |own: &'static str| {
            if arguments.contains(&format!("*{own},")) {
                own
            } else {
                ""
            }
        };
        self.function(
            name,
            arguments,
            [["", "", has("u"), has("p")], NONE, NONE],
            &targets,
        )
    }
}
