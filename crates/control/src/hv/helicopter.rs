//! A helicopter as a model, and its trim.

use crate::pose::bare_run;
use pilotage_collocation::{Differentiated, Quality};
use pilotage_estimation::ProblemError;
use pilotage_estimation::system::joint::unknown;
use pilotage_estimation::system::part::Part;
use pilotage_expression::System;
use pilotage_language::{Compiled, parse};
use pilotage_models::library;
use std::path::Path;
use std::sync::Arc;

/// Inputs and states that a helicopter's model has, as the built-in one; it may have more states, which begin at their starts.
pub const INPUTS: [&str; 2] = ["cz", "alpha"];
/// Height \[m\], speed forwards and downwards \[m/s\], rotor speed \[rad/s\], inflow \[m/s\].
pub const STATES: [&str; 5] = ["h", "u", "w", "omega", "inflow"];

/// A helicopter.
#[derive(Debug, Clone)]
pub struct Helicopter {
    /// Its model.
    pub part: Part,
    /// Parameters with other values than in the model.
    pub set: Vec<(String, f64)>,
    model: Arc<Differentiated>,
    /// Places of [`STATES`] among the states, and the starts of all.
    places: [usize; 5],
    starts: Vec<f64>,
    /// Whether its second input is the first of [`INPUTS`].
    is_swapped: bool,
    engine: Option<usize>,
}

/// Controls and states in steady level flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Trim {
    /// Thrust coefficient over solidity.
    pub cz: f64,
    /// Tilt of the rotor \[rad\].
    pub alpha: f64,
    /// All states.
    pub states: Vec<f64>,
}

impl Helicopter {
    /// The built-in one with other values of these parameters.
    ///
    /// # Errors
    /// When there is no parameter of a name.
    pub fn built_in(set: &[(String, f64)]) -> Result<Self, ProblemError> {
        let text = library::find("helicopter").map_or("", |own| own.text);
        let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        Self::of(parse(text, "helicopter", &none)?, set)
    }

    /// That of a model file.
    ///
    /// # Errors
    /// When it cannot be read, or lacks an input or a state.
    pub fn read(path: &Path, set: &[(String, f64)]) -> Result<Self, ProblemError> {
        Self::of(pilotage_language::read(path)?, set)
    }

    fn of(compiled: Compiled, set: &[(String, f64)]) -> Result<Self, ProblemError> {
        let file = compiled.file.file.clone();
        let fault = |what: &str, name: &str, known: &[String]| {
            ProblemError::Part(format!("{file}: {}", unknown(what, name, known)))
        };
        let names = compiled.model.parameters.clone();
        let mut values = compiled.parameters();
        for (name, value) in set {
            let place = names.iter().position(|own| own == name);
            values[place.ok_or_else(|| fault("parameter", name, &names))?] = *value;
        }
        let place = |of: &[String], name: &str, what: &str| {
            let found = of.iter().position(|own| own == name);
            found.ok_or_else(|| fault(what, name, of))
        };
        let (states, inputs) = (&compiled.model.states, &compiled.model.inputs);
        let mut places = [0; 5];
        for (own, name) in places.iter_mut().zip(STATES) {
            *own = place(states, name, "state")?;
        }
        for name in INPUTS {
            place(inputs, name, "input")?;
        }
        if let Some(other) = inputs.iter().find(|name| !INPUTS.contains(&name.as_str())) {
            let fault = format!(
                "{file}: the input `{other}` is driven by nothing; a helicopter here has cz and alpha alone"
            );
            return Err(ProblemError::Part(fault));
        }
        let fixed: Vec<Option<f64>> = values.iter().map(|value| Some(*value)).collect();
        let mut system = compiled.model.system.with_parameters(&fixed);
        let mut outputs = system.outputs.clone();
        let power = compiled
            .model
            .outputs
            .iter()
            .position(|name| name == "required_power");
        outputs = power.map_or(Vec::new(), |k| vec![outputs[k]]);
        system = System { outputs, ..system };
        Ok(Self {
            starts: compiled.start_values(&values),
            model: Arc::new(Differentiated::new(&system)),
            engine: states.iter().position(|name| name == "engine"),
            is_swapped: inputs[0] == INPUTS[1],
            places,
            set: set.to_vec(),
            part: Part::of_file(compiled),
        })
    }

    /// Whether its engine can run down: it has the state `engine`.
    pub fn runs_down(&self) -> bool {
        self.engine.is_some()
    }

    fn inputs(&self, cz: f64, alpha: f64) -> [f64; 2] {
        if self.is_swapped {
            [alpha, cz]
        } else {
            [cz, alpha]
        }
    }

    /// Places of [`STATES`] among all states.
    pub fn places(&self) -> [usize; 5] {
        self.places
    }

    /// Steady level flight at a height \[m\] and a speed \[m/s\]: `cz`, `alpha` and the inflow by Newton's method. None if
    /// there is none, as where the rotor cannot carry the weight.
    pub fn trim(&self, height: f64, speed: f64) -> Option<Trim> {
        const STEPS: usize = 50;
        const DONE: f64 = 1e-11;
        let [h, u, w, _, inflow] = self.places;
        let mut states = self.starts.clone();
        (states[h], states[u], states[w]) = (height, speed, 0.0);
        let mut unknowns = [0.06, 0.0, states[inflow].max(1.0)];
        let residual = |at: &[f64; 3]| {
            let mut x = states.clone();
            x[inflow] = at[2];
            let dx = self
                .model
                .evaluate(0.0, &x, &self.inputs(at[0], at[1]), &[]);
            [dx[u], dx[w], dx[inflow]]
        };
        let mut left = residual(&unknowns);
        for _ in 0..STEPS {
            let mut rows = [[0.0; 3]; 3];
            for k in 0..3 {
                let step = 1e-6 * unknowns[k].abs().max(1e-2);
                let (mut up, mut down) = (unknowns, unknowns);
                up[k] += step;
                down[k] -= step;
                let (up, down) = (residual(&up), residual(&down));
                for (i, row) in rows.iter_mut().enumerate() {
                    row[k] = (up[i] - down[i]) / (2.0 * step);
                }
            }
            let mut right = crate::dense::Matrix::zeros(3, 1);
            right.values = left.to_vec();
            let mut matrix = crate::dense::Matrix::zeros(3, 3);
            matrix.values = rows.concat();
            crate::dense::Lu::of(matrix)?.solve(&mut right);
            let size = |r: &[f64; 3]| r.iter().fold(0.0_f64, |m, r| m.max(r.abs()));
            let mut part = 1.0;
            let before = size(&left);
            loop {
                let next = [0, 1, 2].map(|k| unknowns[k] - part * right.values[k]);
                let reached = residual(&next);
                if next[0] > 0.0 && next[2] > 0.0 && size(&reached) < before || part < 1e-4 {
                    (unknowns, left) = (next, reached);
                    break;
                }
                part *= 0.5;
            }
            if size(&left) < DONE || (before < 1e-8 && size(&left) >= before) {
                break;
            }
        }
        let is_found = left.iter().all(|r| r.abs() < 1e-7);
        states[inflow] = unknowns[2];
        let [cz, alpha, _] = unknowns;
        is_found.then_some(Trim { cz, alpha, states })
    }

    /// Power that keeps the rotor speed \[W\]: the output `required_power`.
    pub fn required_power(&self, at: &Trim) -> f64 {
        let inputs = self.inputs(at.cz, at.alpha);
        let all = self.model.evaluate(0.0, &at.states, &inputs, &[]);
        all.get(at.states.len()).copied().unwrap_or(f64::NAN)
    }

    /// The states from a failure on, with the controls of trim and the engine's power gone, or running down from what trim takes:
    /// after a time \[s\], or until the ground if it comes before.
    pub fn frozen(&self, trim: &Trim, seconds: f64, runs_down: bool) -> Frozen {
        let mut x = trim.states.clone();
        if let (Some(engine), true) = (self.engine, runs_down) {
            x[engine] = self.required_power(trim);
        }
        let mut all = Frozen {
            time: vec![0.0],
            states: vec![x],
            is_down: false,
            is_whole: true,
        };
        let quality = Quality {
            tolerance: 1e-10,
            magnitudes: self
                .starts
                .iter()
                .map(|start| start.abs().max(1.0))
                .collect(),
            most_steps: 5000,
        };
        let [h, _, w, ..] = self.places;
        while !all.is_down && all.is_whole && all.end() < seconds {
            let (from, x) = (all.end(), all.last().to_vec());
            // Short of the ground, below which the model is none.
            let short = x[h].max(0.0) / (4.0 * x[w].max(0.5));
            let to = seconds.min(from + short.clamp(1e-3, 0.1));
            let inputs = self.inputs(trim.cz, trim.alpha).to_vec();
            let run = bare_run([from, to], inputs, x.len());
            let course = self.model.course(&run, &[], &x, &quality, &|| false);
            all.is_whole = course.time.last().is_some_and(|last| *last >= to);
            for (time, state) in course.time.into_iter().zip(course.states).skip(1) {
                all.add(time, state, h);
            }
        }
        all
    }
}

/// A flight with the controls of trim.
#[derive(Debug, Clone, PartialEq)]
pub struct Frozen {
    /// Times \[s\].
    pub time: Vec<f64>,
    /// All states at these.
    pub states: Vec<Vec<f64>>,
    /// Whether it ends at the ground.
    pub is_down: bool,
    /// Whether the equations could be integrated to its end.
    pub is_whole: bool,
}

impl Frozen {
    /// When it ends \[s\].
    pub fn end(&self) -> f64 {
        self.time[self.time.len() - 1]
    }

    /// Adds a state, or that on the way to it at which the height, state `h`, is 0.
    fn add(&mut self, time: f64, state: Vec<f64>, h: usize) {
        if self.is_down {
            return;
        }
        self.is_down = state[h] < 0.0;
        if !self.is_down {
            self.time.push(time);
            self.states.push(state);
            return;
        }
        let (from, before) = (self.end(), self.last());
        let part = before[h] / (before[h] - state[h]);
        let between = |a: f64, b: f64| a + part * (b - a);
        let ground = before.iter().zip(&state).map(|(a, b)| between(*a, *b));
        let ground = ground.collect();
        self.time.push(between(from, time));
        self.states.push(ground);
    }

    /// The states at the end.
    pub fn last(&self) -> &[f64] {
        &self.states[self.states.len() - 1]
    }
}
