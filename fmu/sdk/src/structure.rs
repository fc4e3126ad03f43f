//! Dependencies between variables (FMI 2.0.5, section 2.2.8; FMI 3.0, section 2.4.8), found by evaluating the
//! equations.
//!
//! A dual number whose derivative part is NaN marks a known; every unknown that depends on it through any chain of
//! operations then has NaN as its derivative part too, even where a factor is 0. This is done at the start values and
//! at many points around them, so that all branches of the equations are taken. A known with the same derivative at all
//! points is `constant`.

use crate::variable::{Role, Variable};
use crate::{At, Equations, Scalar, Table};
use num_dual::Dual64;
use std::borrow::Cow;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Number of points besides the start values.
const POINTS: usize = 48;

/// Dependency of an unknown on a known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Dependency {
    /// Index of the known in the table.
    pub index: usize,
    /// Whether the known enters linearly, with a constant factor.
    pub constant: bool,
}

/// An unknown and its dependencies, in ascending order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown {
    /// Index in the table.
    pub index: usize,
    /// The knowns.
    pub dependencies: Vec<Dependency>,
}

/// Quantity on which an expression may depend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Knowledge {
    /// Time.
    Time,
    /// A state, by its number.
    State(usize),
    /// An input, by its number.
    Input(usize),
    /// A parameter, by its number.
    Parameter(usize),
}

/// Dependencies of the equations, if they know them.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Influences {
    /// For each derivative, then each output and local that the equations write: its dependencies, and whether each
    /// enters linearly with a constant factor.
    pub rows: Vec<Vec<(Knowledge, bool)>>,
}

/// FMI's ModelStructure, indices from 0.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Structure {
    /// All outputs, on inputs, states and time.
    pub outputs: Vec<Unknown>,
    /// All derivatives, on inputs, states and time.
    pub derivatives: Vec<Unknown>,
    /// All event indicators, on inputs, states and time.
    pub indicators: Vec<Unknown>,
    /// Outputs except modes, states and derivatives by ascending index, on inputs, modes, parameters, start values and
    /// time.
    pub initial: Vec<Unknown>,
}

impl Structure {
    /// The structure of a model.
    pub fn of<E: Equations>(equations: &E, table: &Table) -> Self {
        let known = equations.influences().map(|known| by_known(&known, table));
        let mut unknowns: Vec<usize> = table.outputs().chain(table.locals()).collect();
        unknowns.extend(table.derivatives().chain(table.indicators()));
        let states: Vec<usize> = table.states().collect();
        let inputs: Vec<usize> = table.inputs().collect();
        // While the simulation runs, the states are knowns; their columns are those of the start values.
        let running: Vec<_> = (inputs.iter().map(|&i| (i, i)))
            .chain(table.starts().zip(states.iter().copied()))
            .chain([(table.time(), table.time())])
            .collect();
        let initial: Vec<_> = (inputs.iter().copied())
            .chain(table.parameters())
            .chain(table.starts())
            .chain(table.modes())
            .chain([table.time()])
            .map(|i| (i, i))
            .collect();
        let tracer = Tracer::new(equations, table);
        let of = |knowns: &[(usize, usize)]| -> Vec<Unknown> {
            let columns: Vec<_> = knowns
                .iter()
                .map(|&(seeded, index)| (index, tracer.column(seeded, known.as_ref())))
                .collect();
            let row = |&unknown: &usize| {
                let mut dependencies: Vec<_> = columns
                    .iter()
                    .filter_map(|(index, column)| {
                        let constant = column[unknown]?;
                        Some(Dependency {
                            index: *index,
                            constant,
                        })
                    })
                    .collect();
                dependencies.sort_unstable();
                Unknown {
                    index: unknown,
                    dependencies,
                }
            };
            unknowns.iter().map(row).collect()
        };
        let running = of(&running);
        let part = |is: fn(&Variable) -> bool| {
            let is = |u: &&Unknown| is(&table.variables()[u.index]);
            running.iter().filter(is).cloned().collect()
        };
        Self {
            outputs: part(Variable::is_output),
            derivatives: part(|v| v.role == Role::Derivative),
            indicators: part(|v| v.role == Role::Indicator),
            initial: {
                let mut initial = of(&initial);
                let is_set = |index: usize| table.variables()[index].is_boolean();
                initial.retain(|u| u.index < table.indicators().start && !is_set(u.index));
                initial
            },
        }
    }

    /// Dependencies of a variable while the simulation runs; `None` if it is not an unknown.
    pub fn unknown(&self, index: usize) -> Option<&Unknown> {
        let all = [&self.outputs, &self.derivatives, &self.indicators];
        all.into_iter().flatten().find(|u| u.index == index)
    }
}

/// For each known, the variables that depend on it, and whether it enters each linearly with a constant factor.
type ByKnown = HashMap<Knowledge, Vec<(usize, bool)>>;

fn by_known(influences: &Influences, table: &Table) -> ByKnown {
    let mut all = ByKnown::new();
    let unknowns = table.derivatives().chain(table.computed());
    for (row, unknown) in influences.rows.iter().zip(unknowns) {
        for (known, is_constant) in row {
            all.entry(*known).or_default().push((unknown, *is_constant));
        }
    }
    all
}

/// All variables from the settable ones, and delayed signals if they are exact: the only place where a table is evaluated.
pub fn evaluate<E: Equations, T: Scalar>(
    (equations, table): (&E, &Table),
    time: T,
    values: &[T],
    states: &[T],
    delayed: &[T],
) -> Vec<T> {
    let inputs = &values[table.inputs()];
    let u = match delayed.is_empty() {
        true => Cow::Borrowed(inputs),
        false => Cow::Owned([inputs, delayed].concat()),
    };
    let at = At {
        time,
        x: states,
        u: &u[..],
        p: &values[table.parameters()],
    };
    // Importers ask for derivatives at many points: nothing grows here.
    let mut all = Vec::with_capacity(table.variables().len());
    all.extend_from_slice(&values[..table.starts().end]);
    all.resize(table.variables().len(), T::from(0.0));
    let mut computed = vec![T::from(0.0); table.computed().count()];
    equations.output(at, &mut computed);
    table.clip(&mut computed, at.p);
    for (index, y) in table.computed().zip(computed) {
        all[index] = y;
    }
    for (index, x) in table.x().zip(states) {
        all[index] = *x;
    }
    equations.derivative(at, &mut all[table.derivatives()]);
    equations.indicators(at, &mut all[table.indicators()]);
    all[table.time()] = time;
    all
}

/// Evaluates the equations with one known marked.
struct Tracer<'e, E> {
    equations: &'e E,
    table: &'e Table,
    /// Number of the point, and its values.
    points: Vec<(usize, Vec<f64>)>,
}

impl<'e, E: Equations> Tracer<'e, E> {
    fn new(equations: &'e E, table: &'e Table) -> Self {
        let variables = &table.variables()[..table.starts().end];
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let scales = Self::scales(table);
        let mut point = |k: usize| -> Vec<f64> {
            let size = 10_f64.powi((k % 5) as i32 - 2);
            variables
                .iter()
                .zip(&scales)
                .map(|(v, scale)| {
                    let start = v.start.unwrap_or(0.0);
                    let moved = match v.role {
                        Role::Mode => return f64::from(u8::from(random.next() > 0.0)),
                        // A scaled mass is still a valid mass; a negative one is not.
                        Role::Fixed | Role::Tunable if start != 0.0 && *scale == 0.0 => {
                            start * (1.0 + 0.5 * random.next())
                        }
                        _ => start + size * scale.max(1e-3) * random.next(),
                    };
                    moved.clamp(
                        v.min.unwrap_or(f64::NEG_INFINITY),
                        v.max.unwrap_or(f64::INFINITY),
                    )
                })
                .collect()
        };
        let starts = variables.iter().map(|v| v.start.unwrap_or(0.0)).collect();
        let points = std::iter::once(starts).chain((0..POINTS).map(&mut point));
        let points: Vec<_> = points.enumerate().collect();
        let mut tracer = Self {
            equations,
            table,
            points: Vec::new(),
        };
        // Equations may panic outside their domain; at the start values that is an error of the model.
        let holds = |(k, point): &(usize, Vec<f64>)| {
            let run = || tracer.run(*k, point, table.time(), 0.0);
            *k == 0 || catch_unwind(AssertUnwindSafe(run)).is_ok()
        };
        tracer.points = points.into_iter().filter(holds).collect();
        tracer
    }

    /// Variation of inputs and states; 0 for parameters with a start value other than 0.
    fn scales(table: &Table) -> Vec<f64> {
        let mut scales: Vec<f64> = table.variables()[..table.starts().end]
            .iter()
            .map(|v| match v.role {
                Role::Input => v.nominal.unwrap_or(1.0),
                _ if v.start == Some(0.0) => 1.0,
                _ => 0.0,
            })
            .collect();
        for (start, nominal) in table.starts().zip(table.nominals()) {
            scales[start] = nominal;
        }
        scales
    }

    /// For each variable: `None` if it does not depend on the known, else whether the factor is constant.
    fn column(&self, known: usize, exact: Option<&ByKnown>) -> Vec<Option<bool>> {
        if let Some(exact) = exact {
            return self.exact(known, exact);
        }
        if self.table.variables()[known].is_boolean() {
            return self.switched(known);
        }
        let mut column = vec![None; self.table.variables().len()];
        let mut factors = vec![None; column.len()];
        for (k, point) in &self.points {
            let marked = self.run(*k, point, known, f64::NAN);
            let real = self.run(*k, point, known, 1.0);
            for (i, (mark, real)) in marked.iter().zip(&real).enumerate() {
                // Outside the domain of a function all values are NaN and give no information.
                if real.re.is_nan() {
                    continue;
                }
                let factor = *factors[i].get_or_insert(real.eps);
                if mark.eps.is_nan() || real.eps != 0.0 {
                    column[i].get_or_insert(true);
                }
                // 0 and -0 compare equal: they are one factor.
                if real.eps != factor {
                    column[i] = Some(false);
                }
            }
        }
        column
    }

    /// As [`column`](Self::column), from the dependencies that the equations give.
    fn exact(&self, known: usize, exact: &ByKnown) -> Vec<Option<bool>> {
        let table = self.table;
        let mut column = vec![None; table.variables().len()];
        let place = match table.starts().contains(&known) {
            true => Knowledge::State(known - table.starts().start),
            false if table.inputs().contains(&known) => Knowledge::Input(known),
            false if known == table.time() => Knowledge::Time,
            false => Knowledge::Parameter(known - table.parameters().start),
        };
        for (unknown, is_constant) in exact.get(&place).into_iter().flatten() {
            column[*unknown] = Some(*is_constant);
        }
        if let Knowledge::State(state) = place
            && let Some(own) = table.states().nth(state)
        {
            column[own] = Some(true);
        }
        column
    }

    /// As [`column`](Self::column), for a Boolean: the variables that change with it.
    fn switched(&self, known: usize) -> Vec<Option<bool>> {
        let mut column = vec![None; self.table.variables().len()];
        for (k, point) in &self.points {
            let [off, on] = [0.0, 1.0].map(|value| {
                let mut point = point.clone();
                point[known] = value;
                self.run(*k, &point, known, 0.0)
            });
            for (i, (off, on)) in off.iter().zip(&on).enumerate() {
                let is_known = !off.re.is_nan() && !on.re.is_nan();
                if is_known && off.re != on.re {
                    column[i] = Some(false);
                }
            }
        }
        column
    }

    /// All variables at the k-th point.
    fn run(&self, k: usize, point: &[f64], known: usize, part: f64) -> Vec<Dual64> {
        let mut values: Vec<Dual64> = point.iter().map(|&v| Dual64::from_re(v)).collect();
        let mut time = Dual64::from_re(0.37 * k as f64);
        match values.get_mut(known) {
            Some(value) => value.eps = part,
            None => time.eps = part,
        }
        let states = self.table.start_of_x(&values);
        evaluate((self.equations, self.table), time, &values, &states, &[])
    }
}

/// Numbers in ±1, the same in every run (G. Marsaglia, "Xorshift RNGs", 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
