//! Construction of the expression graph from parsed expressions.

use crate::error::{Fault, ModelFileError};
use crate::file::{Formula, ModelFile};
use crate::functions::Name;
use crate::scope::{Scope, Symbol};
use crate::syntax::{Comparison, Expression, Part, Term};
use crate::tables::Tables;
use pilotage_expression::{Function, Graph, Node, Operator};

/// Highest order of a delay.
const HIGHEST_ORDER: usize = 5;

/// What stands in the equations for a delay without an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delayed {
    /// Padé's approximation of this order.
    Pade(usize),
    /// An input of the model, after the declared ones, whose values whoever uses the model provides.
    Input,
}

impl Delayed {
    /// The order that stands for none, unless another is asked for.
    pub const ORDER: usize = 2;
    /// Highest order that is asked for.
    pub const HIGHEST: usize = 27;
}

/// Maximum number of operations of a model: a tape of that size still takes only milliseconds per step.
const MOST_OPERATIONS: usize = 200_000;

/// A model as expressions in one graph.
#[derive(Debug, Clone)]
pub(crate) struct Built {
    pub(crate) graph: Graph,
    /// The states of delays, which follow the declared ones.
    pub(crate) delays: Vec<DelayState>,
    /// Derivatives of all states.
    pub(crate) derivatives: Vec<Node>,
    /// Values of locals and outputs, including outputs that are another name of a state or local.
    pub(crate) computed: Vec<Node>,
    /// Limits of outputs.
    pub(crate) limits: Vec<Option<[Node; 2]>>,
    /// Start values of declared states.
    pub(crate) starts: Vec<Node>,
    /// Time of each delay, and its byte offset in the text.
    pub(crate) taus: Vec<(Node, usize)>,
    /// The delays without an order.
    pub(crate) free: Vec<FreeDelay>,
    /// For each formula, in order of computation, the nodes of its parts.
    pub(crate) parts: Vec<(Formula, Vec<Node>)>,
}

/// A state of a delay.
#[derive(Debug, Clone)]
pub(crate) struct DelayState {
    pub(crate) name: String,
    /// The variable whose expression contains the delay.
    pub(crate) of: String,
    pub(crate) signal: String,
}

/// A delay without an order.
#[derive(Debug, Clone)]
pub struct FreeDelay {
    /// The variable whose expression contains the delay.
    pub of: String,
    /// What stands for it.
    pub by: Delayed,
    /// Name of its input, or of its first state.
    pub name: String,
    /// The delayed signal.
    pub signal: Node,
    /// The delay \[s\].
    pub tau: Node,
}

/// Builds the graph of a checked file. `by` says what stands for each delay without an order, Padé's approximation of
/// [`Delayed::ORDER`] for those beyond its end.
pub(crate) fn build(
    file: &ModelFile,
    scope: &Scope<'_>,
    tables: &Tables,
    by: &[Delayed],
) -> Result<Built, ModelFileError> {
    let numbered = numbered(file, scope, by)?;
    let states = file.states.len() + numbered.states.len();
    let mut graph = Graph::default();
    let inputs = file.inputs.len() + numbered.inputs;
    let variables = 1 + states + inputs + file.parameters.len();
    let all: Vec<Node> = (0..variables).map(|k| graph.variable(k)).collect();
    let (x, rest) = all[1..].split_at(states);
    let (u, p) = rest.split_at(inputs);
    let count = file.locals.len() + file.outputs.len();
    let zero = graph.constant(0.0);
    let mut builder = Builder {
        file,
        scope,
        tables,
        time: all[0],
        x,
        u,
        p,
        places: Vec::new(),
        rates_of_delays: Vec::new(),
        computed: vec![zero; count],
        parts: Vec::new(),
        taus: Vec::new(),
        free: numbered.free,
        graph,
    };
    for &k in &scope.order {
        let variable = scope.computed(k);
        if let Some(formula) = &variable.value {
            builder.places = numbered.places[file.states.len() + k].clone();
            builder.computed[k] = builder.formula(formula)?;
        }
    }
    for k in 0..count {
        let variable = scope.computed(k);
        if variable.value.is_none() {
            let of = scope.symbol(&variable.name);
            builder.computed[k] = builder.of_symbol(of);
        }
    }
    let mut derivatives = Vec::new();
    for (k, state) in file.states.iter().enumerate() {
        builder.places = numbered.places[k].clone();
        if let Some(formula) = &state.value {
            derivatives.push(builder.formula(formula)?);
        }
    }
    builder.rates_of_delays.sort_by_key(|(state, _)| *state);
    derivatives.extend(builder.rates_of_delays.iter().map(|(_, rate)| *rate));
    let starts = file
        .states
        .iter()
        .map(|state| builder.formula(&state.start));
    let starts = starts.collect::<Result<Vec<_>, _>>()?;
    let limits = (0..count).map(|k| match &scope.computed(k).limit {
        Some([low, high]) => Ok(Some([builder.formula(low)?, builder.formula(high)?])),
        None => Ok(None),
    });
    let limits = limits.collect::<Result<Vec<_>, ModelFileError>>()?;
    Ok(Built {
        delays: numbered.states,
        free: builder.free,
        derivatives,
        computed: builder.computed,
        limits,
        starts,
        taus: builder.taus,
        parts: builder.parts,
        graph: builder.graph,
    })
}

/// The delays of an expression: the part of each call, and the part of its order if it has one.
fn delays(expression: &Expression) -> impl Iterator<Item = (Part, Option<Part>)> {
    let terms = expression.terms.iter().enumerate();
    terms.filter_map(|(part, term)| match term {
        Term::Call(Name::Delay, arguments) => Some((part, arguments.get(2).copied())),
        _ => None,
    })
}

/// Place of a delay among the states or inputs.
#[derive(Debug, Clone, Copy)]
struct Place {
    by: Delayed,
    /// Index of its first state, or of its input.
    first: usize,
    /// Number of the delay among those without an order.
    free: Option<usize>,
}

/// The delays of a file.
#[derive(Default)]
struct Numbered {
    /// States of all delays, in the order of states, locals and outputs.
    states: Vec<DelayState>,
    /// Number of delays that are inputs.
    inputs: usize,
    /// For each state, local and output the places of its delays.
    places: Vec<Vec<Place>>,
    /// Those without an order.
    free: Vec<FreeDelay>,
}

/// Numbers all delays, in the order of states, locals and outputs.
fn numbered(
    file: &ModelFile,
    scope: &Scope<'_>,
    by: &[Delayed],
) -> Result<Numbered, ModelFileError> {
    let count = file.locals.len() + file.outputs.len();
    let computed = (0..count).map(|k| scope.computed(k));
    let mut found = Numbered::default();
    for variable in file.states.iter().chain(computed) {
        found.places.push(Vec::new());
        let Some(formula) = &variable.value else {
            continue;
        };
        let expression = &formula.expression;
        let mut number = 0;
        for (part, order) in delays(expression) {
            let mut free = None;
            let own = match order {
                Some(order) => Delayed::Pade(given_order(file, formula, order)?),
                None => {
                    free = Some(found.free.len());
                    let asked = by.get(found.free.len()).copied();
                    asked.unwrap_or(Delayed::Pade(Delayed::ORDER))
                }
            };
            let mut name = || {
                number += 1;
                let name = format!("{}_delay_{number}", variable.name);
                if file.variables().any(|(own, _)| own.name == name) {
                    let of = variable.name.clone();
                    return Err(file.at(variable.byte, Fault::Clash { name, of }));
                }
                Ok(name)
            };
            let (first, first_name) = match own {
                Delayed::Input => {
                    found.inputs += 1;
                    (file.inputs.len() + found.inputs - 1, name()?)
                }
                Delayed::Pade(order) => {
                    let first = found.states.len();
                    let signal = match &expression.terms[part] {
                        Term::Call(_, arguments) => expression.shown(arguments[0]),
                        _ => "",
                    };
                    for _ in 0..order {
                        found.states.push(DelayState {
                            name: name()?,
                            of: variable.name.clone(),
                            signal: signal.to_owned(),
                        });
                    }
                    (file.states.len() + first, found.states[first].name.clone())
                }
            };
            if free.is_some() {
                // Its nodes follow when it is built.
                let unknown = Graph::default().constant(0.0);
                found.free.push(FreeDelay {
                    of: variable.name.clone(),
                    by: own,
                    name: first_name,
                    signal: unknown,
                    tau: unknown,
                });
            }
            let place = Place {
                by: own,
                first,
                free,
            };
            found
                .places
                .last_mut()
                .into_iter()
                .for_each(|own| own.push(place));
        }
    }
    Ok(found)
}

/// The order that a delay gives.
fn given_order(file: &ModelFile, formula: &Formula, part: Part) -> Result<usize, ModelFileError> {
    let expression = &formula.expression;
    match expression.terms[part] {
        Term::Number(order)
            if order.fract() == 0.0 && (1.0..=HIGHEST_ORDER as f64).contains(&order) =>
        {
            Ok(order as usize)
        }
        _ => {
            let fault = Fault::DelayOrder {
                found: expression.shown(part).to_owned(),
                limit: HIGHEST_ORDER,
            };
            Err(file.at(formula.byte(part), fault))
        }
    }
}

struct Builder<'f> {
    file: &'f ModelFile,
    scope: &'f Scope<'f>,
    tables: &'f Tables,
    graph: Graph,
    time: Node,
    x: &'f [Node],
    u: &'f [Node],
    p: &'f [Node],
    /// Places of the delays of the next formula that are left.
    places: Vec<Place>,
    rates_of_delays: Vec<(usize, Node)>,
    computed: Vec<Node>,
    parts: Vec<(Formula, Vec<Node>)>,
    taus: Vec<(Node, usize)>,
    free: Vec<FreeDelay>,
}

/// A condition, and whether it must hold or must not hold.
type Branch = (Part, bool);

impl Builder<'_> {
    /// Builds the node of an expression.
    fn formula(&mut self, formula: &Formula) -> Result<Node, ModelFileError> {
        let expression = &formula.expression;
        let branches = branches(expression);
        let mut nodes: Vec<Node> = Vec::with_capacity(expression.terms.len());
        for (part, branches) in branches.iter().enumerate() {
            let node = self.term(expression, part, &nodes, branches);
            nodes.push(node);
            let found = self.graph.operations().len();
            if found > MOST_OPERATIONS {
                let limit = MOST_OPERATIONS;
                return Err(self
                    .file
                    .at(formula.byte(part), Fault::TooLarge { found, limit }));
            }
        }
        for term in &expression.terms {
            if let Term::Call(Name::Delay, arguments) = term {
                self.taus
                    .push((nodes[arguments[1]], formula.byte(arguments[1])));
            }
        }
        let whole = nodes[expression.whole()];
        self.parts.push((formula.clone(), nodes));
        Ok(whole)
    }

    fn term(
        &mut self,
        expression: &Expression,
        part: Part,
        nodes: &[Node],
        branches: &[Branch],
    ) -> Node {
        let of = |part: &Part| nodes[*part];
        let graph = &mut self.graph;
        match &expression.terms[part] {
            Term::Number(number) => graph.constant(*number),
            Term::Text(_) => graph.constant(0.0),
            Term::Name(name) => self.of_symbol(self.scope.symbol(name)),
            Term::Negate(a) => graph.negate(of(a)),
            Term::Add(a, b) => graph.add(of(a), of(b)),
            Term::Subtract(a, b) => graph.subtract(of(a), of(b)),
            Term::Multiply(a, b) => graph.multiply(of(a), of(b)),
            Term::Divide(a, b) => {
                let below = self.guarded(of(b), nodes, branches);
                self.graph.divide(of(a), below)
            }
            Term::Power(a, b) => {
                let base = self.guarded(of(a), nodes, branches);
                self.graph.binary(Operator::Power, base, of(b))
            }
            Term::Compare(comparison, a, b) => self.compare(*comparison, of(a), of(b)),
            Term::Call(name, arguments) => {
                let file = match &expression.terms[arguments[0]] {
                    Term::Text(file) => Some(file.as_str()),
                    _ => None,
                };
                let mut taken: Vec<Node> = arguments.iter().map(of).collect();
                let is_infinite_somewhere = matches!(
                    name,
                    Name::Sqrt
                        | Name::Log
                        | Name::Asin
                        | Name::Acos
                        | Name::Exp
                        | Name::Sinh
                        | Name::Cosh
                        | Name::Tan
                );
                if is_infinite_somewhere {
                    taken[0] = self.guarded(taken[0], nodes, branches);
                }
                match (name, file) {
                    (Name::Table, Some(file)) => {
                        let curve = self.tables.curve(file);
                        self.graph.lookup(&curve, taken[1])
                    }
                    (Name::Delay, _) => {
                        let place = self.places.remove(0);
                        if let Some(own) = place.free {
                            (self.free[own].signal, self.free[own].tau) = (taken[0], taken[1]);
                        }
                        match place.by {
                            Delayed::Pade(order) => {
                                self.delay(taken[0], taken[1], (place.first, order))
                            }
                            Delayed::Input => self.u[place.first],
                        }
                    }
                    _ => self.call(*name, &taken),
                }
            }
        }
    }

    /// An argument of a function that is not defined or not finite everywhere, replaced by a harmless value if its branch is not
    /// taken. Otherwise its derivative there, which is not a number, would spoil that of the branch taken.
    fn guarded(&mut self, argument: Node, nodes: &[Node], branches: &[Branch]) -> Node {
        if branches.is_empty() || self.graph.value(argument).is_some() {
            return argument;
        }
        let harmless = self.graph.constant(0.5);
        branches
            .iter()
            .fold(argument, |argument, (condition, holds)| {
                let condition = nodes[*condition];
                match holds {
                    true => self.graph.select(condition, argument, harmless),
                    false => self.graph.select(condition, harmless, argument),
                }
            })
    }

    fn of_symbol(&mut self, symbol: Symbol) -> Node {
        match symbol {
            Symbol::Time => self.time,
            Symbol::Pi => self.graph.constant(std::f64::consts::PI),
            Symbol::Input(k) => self.u[k],
            Symbol::Parameter(k) => self.p[k],
            Symbol::State(k) => self.x[k],
            Symbol::Computed(k) => self.computed[k],
        }
    }

    /// 1 if the comparison holds, else 0.
    fn compare(&mut self, comparison: Comparison, a: Node, b: Node) -> Node {
        match comparison {
            Comparison::Less => self.graph.binary(Operator::Less, a, b),
            Comparison::Greater => self.graph.binary(Operator::Less, b, a),
            Comparison::Equal => self.graph.binary(Operator::Equal, a, b),
            Comparison::NotEqual => {
                let equal = self.graph.binary(Operator::Equal, a, b);
                self.not(equal)
            }
            // Not the opposite of the other direction, which would hold for what is not a number.
            Comparison::LessEqual => self.less_or_equal(a, b),
            Comparison::GreaterEqual => self.less_or_equal(b, a),
        }
    }

    fn less_or_equal(&mut self, a: Node, b: Node) -> Node {
        let less = self.graph.binary(Operator::Less, a, b);
        let equal = self.graph.binary(Operator::Equal, a, b);
        self.graph.add(less, equal)
    }

    fn not(&mut self, condition: Node) -> Node {
        let (zero, one) = (self.graph.constant(0.0), self.graph.constant(1.0));
        self.graph.select(condition, zero, one)
    }

    fn call(&mut self, name: Name, taken: &[Node]) -> Node {
        let first = taken[0];
        let graph = &mut self.graph;
        match name {
            Name::Sin => graph.unary(Function::Sin, first),
            Name::Cos => graph.unary(Function::Cos, first),
            Name::Tan => graph.unary(Function::Tan, first),
            Name::Asin => graph.unary(Function::Asin, first),
            Name::Acos => graph.unary(Function::Acos, first),
            Name::Atan => graph.unary(Function::Atan, first),
            Name::Sinh => graph.unary(Function::Sinh, first),
            Name::Cosh => graph.unary(Function::Cosh, first),
            Name::Tanh => graph.unary(Function::Tanh, first),
            Name::Exp => graph.unary(Function::Exp, first),
            Name::Log => graph.unary(Function::Ln, first),
            Name::Sqrt => graph.unary(Function::Sqrt, first),
            Name::Abs => graph.unary(Function::Abs, first),
            Name::Atan2 => graph.binary(Operator::Atan2, first, taken[1]),
            Name::Sign => self.sign(first),
            Name::Min => self.extreme(taken, true),
            Name::Max => self.extreme(taken, false),
            Name::Sat => {
                let [low, high] = self.range(taken);
                let above = self.extreme(&[first, low], false);
                self.extreme(&[above, high], true)
            }
            Name::Deadzone => {
                let [low, high] = self.range(taken);
                let above = self.graph.subtract(first, high);
                let below = self.graph.subtract(first, low);
                let zero = self.graph.constant(0.0);
                let is_above = self.graph.binary(Operator::Less, high, first);
                let is_below = self.graph.binary(Operator::Less, first, low);
                let lower = self.graph.select(is_below, below, zero);
                self.graph.select(is_above, above, lower)
            }
            Name::If => self.graph.select(first, taken[1], taken[2]),
            Name::Delay | Name::Table => unreachable!("they are built elsewhere"),
        }
    }

    fn sign(&mut self, a: Node) -> Node {
        let zero = self.graph.constant(0.0);
        let one = self.graph.constant(1.0);
        let minus = self.graph.constant(-1.0);
        let is_above = self.graph.binary(Operator::Less, zero, a);
        let is_below = self.graph.binary(Operator::Less, a, zero);
        let lower = self.graph.select(is_below, minus, zero);
        self.graph.select(is_above, one, lower)
    }

    /// The minimum or the maximum.
    fn extreme(&mut self, taken: &[Node], least: bool) -> Node {
        taken[1..]
            .iter()
            .fold(taken[0], |found, &other| match least {
                true => self.graph.smaller(found, other),
                false => self.graph.larger(found, other),
            })
    }

    /// The range of `f(x, limit)` and `f(x, low, high)`.
    fn range(&mut self, taken: &[Node]) -> [Node; 2] {
        match taken[1..] {
            [limit] => [self.graph.negate(limit), limit],
            _ => [taken[1], taken[2]],
        }
    }

    /// A signal delayed by `tau`, by a Padé approximation of order `n` in numerator and denominator. With
    /// `Q(s) = Σ c_k (τ s)^k` the delayed signal is `Q(-s)/Q(s) u`; the states are `w_k = c_{k-1} (τ s)^{k-1}/Q(s) u`,
    /// all in the unit of the signal.
    fn delay(&mut self, signal: Node, tau: Node, (first, order): (usize, usize)) -> Node {
        let graph = &mut self.graph;
        let states = &self.x[first..first + order];
        let sum = states
            .iter()
            .copied()
            .reduce(|sum, own| graph.add(sum, own));
        let rest = graph.subtract(signal, sum.expect("one state at least"));
        let mut delayed = match order % 2 {
            0 => rest,
            _ => graph.negate(rest),
        };
        for (k, &state) in states.iter().enumerate() {
            delayed = match k % 2 {
                0 => graph.add(delayed, state),
                _ => graph.subtract(delayed, state),
            };
            // c_{k}/c_{k+1}, with k from 0.
            let (n, number) = (order as f64, k as f64 + 1.0);
            let ratio = number * (2.0 * n - number + 1.0) / (n - number + 1.0);
            let following = states.get(k + 1).copied().unwrap_or(rest);
            let rate = graph.scale(ratio, following);
            let rate = graph.divide(rate, tau);
            self.rates_of_delays.push((first + k, rate));
        }
        delayed
    }
}

/// For each part, the conditions of the branches that contain it.
fn branches(expression: &Expression) -> Vec<Vec<Branch>> {
    let terms = &expression.terms;
    let mut found: Vec<Vec<Branch>> = vec![Vec::new(); terms.len()];
    for k in (0..terms.len()).rev() {
        let own = found[k].clone();
        let mut pass = |part: Part, more: Option<Branch>| {
            found[part] = own.iter().copied().chain(more).collect();
        };
        match &terms[k] {
            Term::Call(Name::If, arguments) => {
                let condition = arguments[0];
                pass(condition, None);
                pass(arguments[1], Some((condition, true)));
                pass(arguments[2], Some((condition, false)));
            }
            other => other.parts().into_iter().for_each(|part| pass(part, None)),
        }
    }
    found
}
