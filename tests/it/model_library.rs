//! The built-in models against numbers that do not come from their files: transfer functions written by hand
//! (`model_library.txt`, printed by tests/python/library_reference.py), the compiled-in equations, closed forms.

use nalgebra::{Complex, DMatrix};
use num_dual::Dual64;
use pilotage::models::library::{self, BuiltIn, Kind, all, find};
use pilotage::models::{Model, Pilot, Table};
use pilotage_expression::Tape;
use pilotage_language::{Compiled, parse};
use pilotage_ode::{DormandPrince, Solver};
use pilotage_sdk::{At, Equations, Role};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeSet;
use std::convert::Infallible;

const TABLE: &str = include_str!("model_library.txt");

/// A model file that runs.
pub struct Running {
    pub compiled: Compiled,
    /// Derivatives, then outputs without their limits.
    tape: Tape,
    /// The parameters' values.
    p: Vec<f64>,
}

/// Matrices of a linearised model; the outputs are its signals, as [`Running::signals`].
struct Linear {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

impl Running {
    pub fn new(compiled: Compiled) -> Self {
        let system = &compiled.model.system;
        let lists: [&[_]; 2] = [&system.derivatives, &system.outputs];
        let tape = Tape::new(&system.graph, system.variables(), |_| false, &lists);
        let p = compiled.parameters();
        Self { compiled, tape, p }
    }

    /// A model without tables.
    fn text(text: &str) -> Self {
        let none = |file: &str| -> std::io::Result<String> { panic!("{file}: no table") };
        Self::new(parse(text, "model.toml", &none).unwrap_or_else(|error| panic!("{error}")))
    }

    fn built_in(name: &str) -> Self {
        Self::text(find(name).unwrap_or_else(|| panic!("{name}")).text)
    }

    /// With `a=1,b=2` set; `-` is nothing.
    fn with(mut self, settings: &str) -> Self {
        for setting in settings.split(',').filter(|setting| *setting != "-") {
            let (name, value) = setting.split_once('=').expect("a setting");
            let place = place(&self.compiled.model.parameters, name);
            self.p[place] = value.parse().expect("a number");
        }
        self
    }

    pub fn start(&self) -> Vec<f64> {
        self.compiled.start_values(&self.p)
    }

    /// The derivatives at a point, then the outputs.
    fn at(&self, t: f64, x: &[f64], u: &[f64]) -> Vec<f64> {
        self.tape.evaluate(&[&[t][..], x, u, &self.p].concat())
    }

    /// Names of the outputs, then of the states.
    fn signals(&self) -> Vec<String> {
        let model = &self.compiled.model;
        [model.outputs.clone(), model.states.clone()].concat()
    }

    fn input(&self, name: &str) -> usize {
        place(&self.compiled.model.inputs, name)
    }

    fn state(&self, name: &str) -> usize {
        place(&self.compiled.model.states, name)
    }

    /// About the start values, inputs 0, by dual numbers.
    fn linear(&self) -> Linear {
        let system = &self.compiled.model.system;
        let (n, m) = (system.states, system.inputs);
        let point = [vec![0.0], self.start(), vec![0.0; m], self.p.clone()].concat();
        let slope = |variable: usize| -> Vec<f64> {
            let seeded = point.iter().enumerate();
            let seeded = seeded.map(|(k, v)| Dual64::new(*v, f64::from(k == variable)));
            let values = self.tape.evaluate(&seeded.collect::<Vec<_>>());
            values.iter().map(|value| value.eps).collect()
        };
        let slopes: Vec<_> = (0..n + m).map(|k| slope(1 + k)).collect();
        let outputs = system.outputs.len();
        let part = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
                slopes[columns.start + j][rows.start + i]
            })
        };
        let signals = part(n..n + outputs, 0..n);
        let mut c = DMatrix::identity(outputs + n, n);
        c.rows_mut(0, outputs).copy_from(&signals);
        c.rows_mut(outputs, n).fill_with_identity();
        let mut d = DMatrix::zeros(outputs + n, m);
        d.rows_mut(0, outputs)
            .copy_from(&part(n..n + outputs, n..n + m));
        Linear {
            a: part(0..n, 0..n),
            b: part(0..n, n..n + m),
            c,
            d,
        }
    }

    /// The states at that time, from a time on with constant inputs.
    pub fn simulate(&self, from: f64, x: &[f64], u: &[f64], to: f64) -> Vec<f64> {
        let absolute = vec![1e-13; x.len()];
        let mut solver = Solver::with(DormandPrince::new(x.len()), 0, 1e-12, &absolute);
        solver.restart(from, x, true);
        while solver.time() < to {
            solver.advance(&mut Held { model: self, u }, to).unwrap();
        }
        solver.state().to_vec()
    }
}

/// A model under constant inputs.
struct Held<'a> {
    model: &'a Running,
    u: &'a [f64],
}

impl pilotage_ode::System for Held<'_> {
    type Error = Infallible;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        dx.copy_from_slice(&self.model.at(t, x, self.u)[..x.len()]);
        Ok(true)
    }
}

impl Linear {
    /// `C (s - A)⁻¹ B + D`.
    fn response(&self, s: Complex<f64>, from: usize, to: usize) -> Complex<f64> {
        if self.a.is_empty() {
            return self.d[(to, from)].into();
        }
        let inner = self.shifted(s).lu();
        let column = self.b.column(from).map(Complex::from);
        let states = inner.solve(&column).expect("s is no pole");
        let row = self.c.row(to).map(Complex::from);
        (row * states)[0] + self.d[(to, from)]
    }

    fn shifted(&self, s: Complex<f64>) -> DMatrix<Complex<f64>> {
        let n = self.a.nrows();
        DMatrix::from_diagonal_element(n, n, s) - self.a.map(Complex::from)
    }

    /// The poles where inputs are driven by signals: `(input, signal, factor)`.
    fn closed(&self, wires: &[(usize, usize, f64)]) -> Vec<Complex<f64>> {
        let mut k = DMatrix::zeros(self.b.ncols(), self.c.nrows());
        for &(input, signal, factor) in wires {
            k[(input, signal)] = factor;
        }
        let whole = DMatrix::identity(self.c.nrows(), self.c.nrows()) - &self.d * &k;
        let signals = whole.lu().solve(&self.c).expect("the loop is well posed");
        let a = &self.a + &self.b * k * signals;
        a.complex_eigenvalues().iter().copied().collect()
    }

    /// Both beside each other.
    fn beside(&self, other: &Self) -> Self {
        let join = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            let mut whole = DMatrix::zeros(a.nrows() + b.nrows(), a.ncols() + b.ncols());
            whole.view_mut((0, 0), a.shape()).copy_from(a);
            whole.view_mut(a.shape(), b.shape()).copy_from(b);
            whole
        };
        Self {
            a: join(&self.a, &other.a),
            b: join(&self.b, &other.b),
            c: join(&self.c, &other.c),
            d: join(&self.d, &other.d),
        }
    }
}

fn place(names: &[String], name: &str) -> usize {
    let place = names.iter().position(|own| own == name);
    place.unwrap_or_else(|| panic!("no {name} among {names:?}"))
}

/// Rows of the table that begin with a word, as words.
fn rows(kind: &str) -> impl Iterator<Item = Vec<&'static str>> {
    let rows = TABLE.lines().filter_map(move |row| row.strip_prefix(kind));
    rows.map(|row| row.split_whitespace().collect())
}

fn number(word: &str) -> f64 {
    word.parse().expect("a number")
}

fn complex(words: &[&str]) -> Complex<f64> {
    Complex::new(number(words[0]), number(words[1]))
}

#[track_caller]
fn assert_near(found: Complex<f64>, expected: Complex<f64>, tolerance: f64, what: &[&str]) {
    let error = (found - expected).norm() / expected.norm().max(1e-3);
    assert!(error < tolerance, "{what:?}: {found}, off by {error:e}");
}

#[test]
fn pilots_and_vehicles_have_the_signals_that_they_are_wired_by() {
    for BuiltIn {
        name, kind, text, ..
    } in all()
    {
        let running = Running::text(text);
        let file = &running.compiled.file;
        assert_eq!(file.name, *name);
        let ends: &[(&str, &str)] = match (kind, name.ends_with('2') || *name == "hover") {
            (Kind::Pilot, false) => &[("target", "stick"), ("position", "stick")],
            (Kind::Pilot, true) => &[("target2", "stick2"), ("position2", "stick2")],
            (Kind::Vehicle, true) => &[("stick", "position"), ("stick2", "position2")],
            (Kind::Vehicle, _) if *name == "quadcopter" => &[("stick", "z")],
            (Kind::Vehicle, _) => &[("stick", "position")],
            (Kind::Helicopter, _) => &[("cz", "h"), ("alpha", "u")],
        };
        for (from, to) in ends {
            running.input(from);
            assert!(
                file.outputs.iter().any(|own| own.name == *to),
                "{name} {to}"
            );
        }
        for (variable, role) in file.variables().filter(|(_, role)| *role != "a local") {
            let renamed = role == "an output" && variable.value.is_none();
            let is_described = !variable.description.is_empty() && variable.unit.is_some();
            assert!(renamed || is_described, "{name}: {}", variable.name);
        }
    }
}

/// Of each model the sticks are held, and the bounds are numbers.
#[test]
fn each_stick_has_its_limit() {
    for model in all().iter().filter(|model| model.kind == Kind::Pilot) {
        let running = Running::text(model.text);
        let system = &running.compiled.model.system;
        let point = [
            vec![0.0; system.variables() - running.p.len()],
            running.p.clone(),
        ]
        .concat();
        let values = system.graph.values(&point);
        let names = running.compiled.model.outputs.iter();
        for (name, limit) in names.zip(&running.compiled.limits) {
            let ends = limit.map(|ends| ends.map(|node| values[node.index()]));
            let expected = name.starts_with("stick").then_some([-1.0, 1.0]);
            assert_eq!(ends, expected, "{} {name}", model.name);
        }
    }
}

/// Of each model there is something in the literature's words, but for one that has no transfer function.
#[test]
fn no_model_is_without_a_reference() {
    let compared = ["pole ", "static ", "response "].map(|kind| rows(kind).map(|row| row[0]));
    let compared: BTreeSet<&str> = compared.into_iter().flatten().collect();
    let all = all().iter().map(|model| model.name);
    let missing: Vec<&str> = all.filter(|name| !compared.contains(name)).collect();
    // The helicopter's figures are in crates/control/tests/helicopter.rs.
    assert_eq!(missing, ["dead_zone", "helicopter"]);
}

/// Through the characteristic polynomial, which does not mind poles that stand twice.
#[test]
fn poles_are_those_of_the_transfer_functions() {
    let mut sets: Vec<(Vec<&str>, Vec<Complex<f64>>)> = Vec::new();
    for row in rows("pole ") {
        let pole = complex(&row[2..]);
        match sets.last_mut().filter(|(head, _)| *head == row[..2]) {
            Some((_, poles)) => poles.push(pole),
            None => sets.push((row[..2].to_vec(), vec![pole])),
        }
    }
    assert_eq!(sets.len(), 15);
    for (head, poles) in sets {
        let linear = Running::built_in(head[0]).with(head[1]).linear();
        assert_eq!(linear.a.nrows(), poles.len(), "{head:?}: {poles:?}");
        for s in [Complex::new(1.3, 2.0), Complex::new(0.2, 11.0)] {
            let found = linear.shifted(s).determinant();
            let expected: Complex<f64> = poles.iter().map(|pole| s - pole).product();
            assert_near(found / expected, Complex::from(1.0), 1e-11, &head);
        }
    }
}

#[test]
fn static_gains_and_frequency_responses_are_those_of_the_transfer_functions() {
    let mut compared = 0;
    for kind in ["static ", "response "] {
        for row in rows(kind) {
            let running = Running::built_in(row[0]).with(row[1]);
            let (from, to) = (running.input(row[2]), place(&running.signals(), row[3]));
            let (frequency, expected) = match kind {
                "static " => (0.0, Complex::from(number(row[4]))),
                _ => (number(row[4]), complex(&row[5..])),
            };
            let s = Complex::new(0.0, frequency);
            let found = running.linear().response(s, from, to);
            assert_near(found, expected, 1e-11, &row);
            compared += 1;
        }
    }
    assert_eq!(compared, 234);
}

/// With the start values of both, each pilot flies a vehicle of the library.
#[test]
fn loops_are_stable_and_their_poles_known() {
    for row in rows("loop ") {
        let (pilot, vehicle) = (Running::built_in(row[0]), Running::built_in(row[1]));
        let (inputs, signals) = (pilot.compiled.model.inputs.len(), pilot.signals());
        let mut wires = Vec::new();
        for axis in ["", "2"] {
            let own = |name: &str| format!("{name}{axis}");
            if pilot.compiled.model.inputs.contains(&own("target")) {
                let position = place(&vehicle.signals(), &own("position")) + signals.len();
                wires.push((pilot.input(&own("target")), position, -1.0));
                let stick = inputs + vehicle.input(&own("stick"));
                wires.push((stick, place(&signals, &own("stick")), 1.0));
            }
        }
        let poles = pilot.linear().beside(&vehicle.linear()).closed(&wires);
        let rightmost = poles.iter().map(|s| s.re).fold(f64::MIN, f64::max);
        assert!(rightmost < -0.1, "{row:?}: {rightmost}");
        assert_near(rightmost.into(), number(row[2]).into(), 1e-8, &row);
    }
}

/// The derivatives of two degrees of freedom against the mode of all four, of the same published matrix: speed and
/// gravity, which the short period leaves out, move it by a quarter of a per cent.
#[test]
fn the_short_period_is_the_published_mode() {
    let row = rows("published short_period").next().unwrap();
    let published = complex(&row[1..]);
    let poles = Running::built_in("short_period").linear().closed(&[]);
    let mode = poles.into_iter().find(|s| s.im > 0.1).unwrap();
    assert_near(mode, published, 2.5e-3, &row);
}

/// By the known coefficients, for any delay: the approximant is one function of s tau.
#[test]
fn delays_are_pades_approximants() {
    for row in rows("pade ") {
        for tau in [1.0, 0.07] {
            let text = format!(
                "[model]\nname = \"d\"\n[inputs]\nu = 0\n[outputs]\ny = \"delay(u, {tau}, {})\"",
                row[0]
            );
            let linear = Running::text(&text).linear();
            assert_eq!(linear.a.nrows().to_string(), row[0]);
            let found = linear.response(Complex::new(0.0, 1.0 / tau), 0, 0);
            assert_near(found, complex(&row[2..]), 1e-13, &row);
        }
    }
}

/// A number from -1 to 1.
fn random(generator: &mut ChaCha8Rng) -> f64 {
    f64::from(generator.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// The compiled-in model of that name, and the model file that says the same.
fn assert_same(model: &Model, running: &mut Running) {
    let (table, system) = (model.variable_table(), &running.compiled.model.system);
    let (n, m) = (system.states, system.inputs);
    let mut generator = ChaCha8Rng::seed_from_u64(20);
    for _ in 0..50 {
        let mut draw =
            |count: usize| -> Vec<f64> { (0..count).map(|_| random(&mut generator)).collect() };
        let (x, u) = (draw(n), draw(m));
        // Away from 0: masses divide.
        running.p = draw(running.p.len()).iter().map(|p| p + 2.5).collect();
        let found = running.at(0.0, &x, &u);
        let at = At {
            time: 0.0,
            x: &x,
            u: &u,
            p: &running.p,
        };
        let mut dx = vec![0.0; n];
        model.derivative(at, &mut dx);
        let mut y = vec![0.0; table.computed().count()];
        model.output(at, &mut y);
        let names = running.signals();
        let outputs = table.computed().map(|k| &table.variables()[k].name);
        let outputs = outputs.map(|name| found[n + place(&names, name)]);
        for (found, expected) in found[..n]
            .iter()
            .copied()
            .chain(outputs)
            .zip(dx.iter().chain(&y))
        {
            let error = (found - expected).abs() / expected.abs().max(1.0);
            assert!(error < 1e-13, "{found} {expected}");
        }
    }
}

/// Name, unit, range and typical magnitude of each input, output, parameter and state are those of the compiled-in
/// model; the state that is an output stands among the outputs, too.
/// Those of a role in `others` are not compared.
fn assert_same_variables(table: &Table, compiled: &Compiled, others: &str) {
    let names = |variables: Vec<usize>| -> Vec<String> {
        let name = |k: usize| table.variables()[k].name.clone();
        variables.into_iter().map(name).collect()
    };
    let (file, model) = (&compiled.file, &compiled.model);
    assert_eq!(names(table.inputs().collect()), model.inputs);
    assert_eq!(names(table.parameters().collect()), model.parameters);
    assert_eq!(names(table.states().collect()), model.states);
    let outputs: Vec<_> = file.outputs.iter().map(|own| own.name.clone()).collect();
    assert_eq!(names(table.outputs().collect()), outputs);
    for (own, _) in file
        .variables()
        .filter(|(own, role)| *role != "a local" && !(*role == "an output" && own.value.is_none()))
        .filter(|(_, role)| *role != others)
    {
        let other = &table.variables()[table.index(&own.name).unwrap()];
        assert_eq!(own.unit.as_deref(), Some(other.unit.name.as_str()));
        assert_eq!((own.min, own.max), (other.min, other.max), "{}", own.name);
        assert_eq!(own.nominal, other.nominal, "{}", own.name);
        assert_eq!(own.tunable, other.role == Role::Tunable, "{}", own.name);
    }
}

#[test]
fn the_quadcopter_is_the_compiled_in_one() {
    let mut running = Running::built_in("quadcopter");
    let model = Model::quadcopter(&Default::default());
    let table = model.variable_table();
    assert_same_variables(table, &running.compiled, "");
    let starts = table.parameters().map(|k| table.variables()[k].start);
    let own: Vec<_> = running.p.iter().copied().map(Some).collect();
    assert_eq!(own, starts.collect::<Vec<_>>());
    assert_eq!(running.start(), [0.0; 6]);
    assert_same(&model, &mut running);
}

/// The states are others: those of the file suit fits, those of the compiled-in pilot simulations of fast poles.
#[test]
fn the_linear_pilot_of_every_order_has_the_transfer_function_of_the_compiled_in_one() {
    let mut generator = ChaCha8Rng::seed_from_u64(5);
    for order in 1..=library::MAX_ORDER {
        let mut running = Running::text(&library::linear(order));
        let model = Model::pilot(&vec![0.0; 2 * order], 1.0);
        assert_same_variables(model.variable_table(), &running.compiled, "a state");
        for theta in &mut running.p[..2 * order] {
            *theta = random(&mut generator);
        }
        let theta = running.p.clone();
        let poly = |c: &[f64], s: Complex<f64>| {
            c.iter()
                .rev()
                .fold(Complex::from(0.0), |sum, c| sum * s + c)
        };
        let pilot = Pilot { order };
        for frequency in [0.3, 1.0, 4.0] {
            let s = Complex::new(0.0, frequency);
            let denominator = poly(&theta[..order], s) + s.powu(order as u32);
            let expected = poly(&theta[order..2 * order], s) / denominator;
            let (from, to) = (running.input("target"), place(&running.signals(), "stick"));
            let found = running.linear().response(s, from, to);
            assert!(
                (found - expected).norm() < 1e-10 * expected.norm(),
                "{order}"
            );
            // One column of the compiled-in equations at a time.
            let column = |x: &[f64], u: f64| {
                let mut dx = vec![0.0; order];
                pilot.derivative(x, u, &theta[..2 * order], &mut dx);
                dx
            };
            let unit = |j: usize| (0..order).map(|i| f64::from(i == j)).collect::<Vec<_>>();
            let columns: Vec<_> = (0..order).map(|j| column(&unit(j), 0.0)).collect();
            let a = DMatrix::from_fn(order, order, |i, j| {
                s * f64::from(i == j) - Complex::from(columns[j][i])
            });
            let b = column(&vec![0.0; order], 1.0);
            let b = DMatrix::from_fn(order, 1, |i, _| Complex::from(b[i]));
            let x = a.lu().solve(&b).unwrap();
            let outputs = (0..order).map(|j| pilot.output(&unit(j), &theta[..2 * order]));
            let found: Complex<f64> = outputs.zip(x.iter()).map(|(c, x)| x * c).sum();
            assert!(
                (found - expected).norm() < 1e-10 * expected.norm(),
                "{order}"
            );
        }
    }
}

/// Pilots see the error: what the position does is what the target does, with the other sign.
#[test]
fn positions_act_as_targets_the_other_way_round() {
    for model in all().iter().filter(|model| model.kind == Kind::Pilot) {
        let running = Running::text(model.text);
        let (linear, signals) = (running.linear(), running.signals());
        for axis in ["", "2"] {
            let own = |name: &str| format!("{name}{axis}");
            if !running.compiled.model.inputs.contains(&own("target")) {
                continue;
            }
            let from = |name: &str| {
                let (input, error) = (running.input(&own(name)), place(&signals, &own("error")));
                let states: Vec<f64> = linear.b.column(input).iter().copied().collect();
                (states, linear.d[(error, input)])
            };
            let ((target, seen), (position, hidden)) = (from("target"), from("position"));
            assert_eq!((seen, hidden), (1.0, -1.0), "{}", model.name);
            let opposite: Vec<f64> = position.iter().map(|b| -b).collect();
            assert_eq!(target, opposite, "{}", model.name);
        }
    }
}

/// What the crossover pilot wants and how fast its arm goes, with the threshold or the limit put on by hand. The
/// three have the same start values else.
#[test]
fn threshold_and_rate_limit_are_put_on_the_crossover_pilot() {
    let [crossover, dead, slow] = ["crossover", "dead_zone", "rate_limit"].map(Running::built_in);
    let (gain, lag, threshold, limit) = (0.1, 0.1, 0.2, 3.0);
    let (arm, wish) = (
        crossover.state("arm"),
        3 + place(&crossover.signals(), "wish"),
    );
    let mut generator = ChaCha8Rng::seed_from_u64(21);
    let mut cases = [0; 6];
    for _ in 0..200 {
        let x: Vec<f64> = (0..3).map(|_| 0.6 * random(&mut generator)).collect();
        let u = [random(&mut generator), random(&mut generator)];
        let free = crossover.at(0.0, &x, &u);
        let seen = free[wish] / gain;
        let (case, beyond) = match seen {
            seen if seen > threshold => (0, seen - threshold),
            seen if seen < -threshold => (1, seen + threshold),
            _ => (2, 0.0),
        };
        cases[case] += 1;
        let found = dead.at(0.0, &x, &u);
        assert_eq!(found[1..3], free[1..3], "the delay");
        assert!((found[wish] - gain * beyond).abs() < 1e-13);
        assert!((found[arm] - (gain * beyond - x[arm]) / lag).abs() < 1e-12);
        let (case, rate) = match free[arm] {
            rate if rate > limit => (3, limit),
            rate if rate < -limit => (4, -limit),
            rate => (5, rate),
        };
        cases[case] += 1;
        assert!((slow.at(0.0, &x, &u)[arm] - rate).abs() < 1e-12);
    }
    assert!(cases.iter().all(|count| *count > 10), "{cases:?}");
}

/// A constant error has long passed the delay. The arm then moves at its limit until `lag rate` is left to go, and
/// comes in as an exponential: `wish - lag rate exp(-(t - t1) / lag)`, `t1 = wish / rate - lag`.
#[test]
fn a_stick_that_is_limited_in_rate_moves_as_it_does_on_paper() {
    let running = Running::built_in("rate_limit");
    let (gain, rate, lag) = (0.1, 3.0, 0.1);
    let (error, u) = (20.0, [20.0, 0.0]);
    let linear = running.linear();
    let arm = running.state("arm");
    // The states of the delay at rest; those of the arm do not act on them.
    let rest = linear.a.clone().lu().solve(&(linear.b.column(0) * -error));
    let mut x = rest
        .expect("the pilot has no integrator")
        .as_slice()
        .to_vec();
    x[arm] = 0.0;
    let wish = gain * error;
    let meets = wish / rate - lag;
    assert!((running.simulate(0.0, &x, &u, 0.3)[arm] - 0.3 * rate).abs() < 1e-10);
    let late = running.simulate(0.0, &x, &u, 0.8)[arm];
    let expected = wish - lag * rate * (-(0.8 - meets) / lag).exp();
    assert!((late - expected).abs() < 1e-10, "{late} {expected}");
}

/// With the thrust that holds the height, tilt makes `g tan(pitch)` and `g tan(roll) / cos(pitch)`: the horizontal
/// part of a thrust along the body's axis, here by turning that axis.
#[test]
fn the_hover_accelerates_along_its_turned_thrust() {
    let running = Running::built_in("hover").with("drag=0");
    let (pitch, roll) = (0.3_f64, -0.4_f64);
    let mut x = running.start();
    x[running.state("pitch")] = pitch;
    x[running.state("roll")] = roll;
    let rotation = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::y_axis(), pitch)
        * nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::x_axis(), roll);
    // x forward, y to the left, z up.
    let thrust = rotation * nalgebra::Vector3::z();
    let found = running.at(0.0, &x, &[0.0, 0.0]);
    let expected = [thrust.x / thrust.z, -thrust.y / thrust.z].map(|part| part * 9.80665);
    for (name, expected) in ["velocity", "velocity2"].iter().zip(expected) {
        let found = found[running.state(name)];
        assert!(
            (found - expected).abs() < 1e-14,
            "{name}: {found} {expected}"
        );
    }
}
