//! Expressions as a list of instructions, evaluated at many points at once.

use super::curve::Curve;
use super::graph::{Graph, Node};
use super::opaque::{Call, Partial};
use super::operation::{Function, Operation, Operator};
use num_dual::DualNum;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Operation of an instruction on its registers. A sum with a product is one instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Code {
    Function(Function),
    Operator(Operator),
    /// `a b + c`.
    MultiplyAdd,
    /// `a b - c`.
    MultiplySubtract,
    /// `c - a b`.
    SubtractProduct,
    /// `b` if `a` is not 0, else `c`.
    Select,
    /// The curve with index `b`, evaluated at `a`.
    Lookup,
    /// The call with index `a`. It fills this register and those of the following instructions that are
    /// [`Self::Filled`].
    Call,
    /// Result of a previous call instruction.
    Filled,
}

/// An instruction; its result register follows that of the previous instruction.
#[derive(Debug, Clone, Copy)]
struct Instruction {
    code: Code,
    a: u32,
    b: u32,
    c: u32,
}

/// Instructions for some expressions, in stages.
///
/// Registers hold the variables, then the constants, then the result of each instruction. The first stage needs only
/// the variables known early; stage `k` computes what the `k`-th list of expressions additionally needs.
#[derive(Debug, Clone, Default)]
pub struct Tape {
    variables: usize,
    constants: Vec<f64>,
    instructions: Vec<Instruction>,
    /// Number of instructions up to the end of each stage.
    ends: Vec<usize>,
    /// Registers of each list's expressions.
    outputs: Vec<Vec<usize>>,
    /// True for expressions that depend only on early variables.
    early: Vec<Vec<bool>>,
    curves: Vec<Arc<Curve>>,
    calls: Vec<Called>,
}

/// A call, and its requested values.
#[derive(Debug, Clone)]
struct Called {
    call: Call,
    wanted: Vec<Partial>,
    /// Index and register of each argument on which a requested value depends.
    registers: Vec<(usize, u32)>,
}

impl Called {
    /// Writes the requested values at `B` points, of which adjacent ones are often equal.
    #[inline(never)]
    fn fill<const B: usize>(&self, known: &[[f64; B]], out: &mut [[f64; B]]) {
        let mut found = vec![0.0; self.wanted.len()];
        let point = |l: usize| -> Vec<(usize, f64)> {
            let own = self.registers.iter();
            own.map(|(place, register)| (*place, known[*register as usize][l]))
                .collect()
        };
        let mut before = None;
        for l in 0..B {
            let here = point(l);
            if before.as_ref() != Some(&here) {
                self.call.evaluate_at(&self.wanted, &here, &mut found);
            }
            out.iter_mut()
                .zip(&found)
                .for_each(|(out, found)| out[l] = *found);
            before = Some(here);
        }
    }

    /// Writes the requested values in any number type, by a Taylor series to the second order. The derivatives that
    /// dual numbers carry are exact.
    #[inline(never)]
    fn fill_numbers<T: DualNum<Primitive = f64> + Copy>(
        &self,
        values: &[Cell<T>],
        out: &[Cell<T>],
    ) {
        let value = |register: u32| values[register as usize].get();
        let point = self.registers.iter();
        let point: Vec<(usize, f64)> = point
            .map(|(place, register)| (*place, value(*register).re()))
            .collect();
        let mut found = vec![0.0; self.wanted.len()];
        self.call.evaluate_at(&self.wanted, &point, &mut found);
        for ((out, wanted), found) in out.iter().zip(&self.wanted).zip(found) {
            let mut sum = T::from(found);
            if T::NDERIV > 0 {
                let off = self.registers.iter();
                let off: Vec<(usize, T)> = off
                    .map(|(place, register)| {
                        (*place, value(*register) - T::from(value(*register).re()))
                    })
                    .collect();
                sum += self.change(*wanted, &point, &off);
            }
            out.set(sum);
        }
    }

    /// Change of a value or derivative if arguments differ from a point by dual numbers with real part 0.
    fn change<T: DualNum<Primitive = f64> + Copy>(
        &self,
        wanted: Partial,
        point: &[(usize, f64)],
        off: &[(usize, T)],
    ) -> T {
        let mut sum = T::from(0.0);
        for (i, by) in off {
            let Some(first) = wanted.by(*i) else { continue };
            sum += *by * self.call.at(point, first);
            for (j, other) in off {
                if let (Some(second), true) = (first.by(*j), T::NDERIV > 1) {
                    sum += *by * *other * (0.5 * self.call.at(point, second));
                }
            }
        }
        sum
    }
}

/// Registers of a tape for `B` points at once.
#[derive(Debug, Clone)]
pub struct Registers<const B: usize> {
    values: Vec<[f64; B]>,
}

impl Tape {
    /// The tape of lists of expressions over this number of variables; the variables for which `is_early` holds are
    /// known before the others.
    ///
    /// # Panics
    /// If an expression has a variable with a higher index.
    pub fn new(
        graph: &Graph,
        variables: usize,
        is_early: impl Fn(usize) -> bool,
        lists: &[&[Node]],
    ) -> Self {
        let late = graph.dependants(|index| !is_early(index));
        let mut writer = Writer::new(graph, variables, lists);
        let all: Vec<Node> = lists.concat();
        let needed = graph.ancestors(&all);
        writer.stage(|k| needed[k] && !late[k]);
        writer.reciprocals(|k, by| needed[k] && late[k] && !late[by]);
        for list in lists {
            let needed = graph.ancestors(list);
            writer.stage(|k| needed[k]);
        }
        let mut tape = writer.tape;
        tape.curves = graph.curves().to_vec();
        let register = |node: &Node| writer.registers[node.index()].expect("written") as usize;
        let outputs = lists.iter().map(|list| list.iter().map(register).collect());
        tape.outputs = outputs.collect();
        let is_early = |node: &Node| !late[node.index()];
        let early = lists.iter().map(|list| list.iter().map(is_early).collect());
        tape.early = early.collect();
        tape
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.instructions.len()
    }

    /// True if there are no instructions.
    pub fn is_empty(&self) -> bool {
        self.instructions.is_empty()
    }

    /// True for the expressions of a list that depend only on early variables.
    pub fn is_early(&self, list: usize) -> &[bool] {
        &self.early[list]
    }

    /// Registers initialised with the constants.
    pub fn registers<const B: usize>(&self) -> Registers<B> {
        let mut values = vec![[0.0; B]; self.variables];
        values.extend(self.constants.iter().map(|value| [*value; B]));
        values.resize(values.len() + self.instructions.len(), [0.0; B]);
        Registers { values }
    }

    /// Registers of the expressions of a list.
    #[inline(always)]
    pub fn outputs(&self, list: usize) -> &[usize] {
        &self.outputs[list]
    }

    /// Runs a stage. It is inlined so that it uses the vector instructions enabled in the caller.
    #[inline(always)]
    pub fn run<const B: usize>(&self, stage: usize, registers: &mut Registers<B>) {
        let first = stage.checked_sub(1).map_or(0, |before| self.ends[before]);
        let instructions = &self.instructions[first..self.ends[stage]];
        let begin = self.variables + self.constants.len() + first;
        assert_eq!(registers.values.len(), self.size(), "the tape's registers");
        for (instruction, at) in instructions.iter().zip(begin..) {
            // SAFETY: the list is as long as the tape's, and `at` is the register of one of its instructions.
            let (known, rest) = unsafe { registers.values.split_at_mut_unchecked(at) };
            match instruction.code {
                Code::Call => {
                    let call = &self.calls[instruction.a as usize];
                    call.fill(known, &mut rest[..call.wanted.len()]);
                }
                Code::Filled => {}
                // SAFETY: the register of the instruction comes after those before.
                _ => step(*instruction, &self.curves, known, unsafe {
                    rest.get_unchecked_mut(0)
                }),
            }
        }
    }

    /// Evaluates the expressions of all lists at one point, in any number type.
    ///
    /// # Panics
    /// If the number of variables differs from that of the tape.
    pub fn evaluate<T: DualNum<Primitive = f64> + Copy>(&self, variables: &[T]) -> Vec<T> {
        assert_eq!(variables.len(), self.variables, "the tape's variables");
        let mut values = vec![T::from(0.0); self.size()];
        values[..variables.len()].copy_from_slice(variables);
        self.compute(&mut values);
        let outputs = self.outputs.iter().flatten();
        outputs.map(|register| values[*register]).collect()
    }

    /// Number of registers.
    pub fn size(&self) -> usize {
        self.variables + self.constants.len() + self.len()
    }

    /// Runs all stages on registers of any number type, which hold the variables. The results are in the registers
    /// listed by [`outputs`](Self::outputs). It does not allocate.
    ///
    /// # Panics
    /// If the number of registers is not [`size`](Self::size).
    pub fn compute<T: DualNum<Primitive = f64> + Copy>(&self, registers: &mut [T]) {
        assert_eq!(registers.len(), self.size(), "the tape's registers");
        let first = self.variables + self.constants.len();
        let constants = &mut registers[self.variables..first];
        for (register, constant) in constants.iter_mut().zip(&self.constants) {
            *register = T::from(*constant);
        }
        // Cells, since every instruction reads from the list into which it writes.
        let cells = Cell::from_mut(registers).as_slice_of_cells();
        for (instruction, at) in self.instructions.iter().zip(first..) {
            match instruction.code {
                Code::Call => {
                    let call = &self.calls[instruction.a as usize];
                    call.fill_numbers(cells, &cells[at..at + call.wanted.len()]);
                }
                Code::Filled => {}
                _ => cells[at].set(number(*instruction, &self.curves, cells)),
            }
        }
    }
}

impl<const B: usize> Registers<B> {
    /// Sets a variable.
    #[inline(always)]
    pub fn set(&mut self, variable: usize, value: [f64; B]) {
        self.values[variable] = value;
    }

    /// The value of a register.
    #[inline(always)]
    pub fn get(&self, register: usize) -> [f64; B] {
        self.values[register]
    }
}

/// Evaluates an instruction in any number type.
#[inline(always)]
fn number<T>(instruction: Instruction, curves: &[Arc<Curve>], values: &[Cell<T>]) -> T
where
    T: DualNum<Primitive = f64> + Copy,
{
    let Instruction { code, a, b, c } = instruction;
    let of = |register: u32| {
        debug_assert!((register as usize) < values.len(), "a register of the tape");
        // SAFETY: only `Writer` creates instructions, and it refers to registers that were filled before. All are below
        // `Tape::size`, which `Tape::compute` compares with the length of the list.
        unsafe { values.get_unchecked(register as usize) }.get()
    };
    match code {
        Code::Operator(Operator::Add) => of(a) + of(b),
        Code::Operator(Operator::Subtract) => of(a) - of(b),
        Code::Operator(Operator::Multiply) => of(a) * of(b),
        Code::MultiplyAdd => of(a) * of(b) + of(c),
        Code::MultiplySubtract => of(a) * of(b) - of(c),
        Code::SubtractProduct => of(c) - of(a) * of(b),
        Code::Operator(Operator::Divide) => of(a) / of(b),
        Code::Function(Function::Negate) => -of(a),
        Code::Function(Function::Sin) => of(a).sin(),
        Code::Function(Function::Cos) => of(a).cos(),
        Code::Function(function) => rare(function, of(a)),
        Code::Operator(operator) => joined(operator, of(a), of(b)),
        Code::Select if of(a).re() != 0.0 => of(b),
        Code::Select => of(c),
        Code::Lookup => looked_up(&curves[b as usize], of(a)),
        Code::Call | Code::Filled => unreachable!("calls fill several registers"),
    }
}

/// Rare and long operations are kept out of line, so that the loop over instructions stays small.
#[inline(never)]
fn rare<T: DualNum<Primitive = f64> + Copy>(function: Function, a: T) -> T {
    function.of(a)
}

#[inline(never)]
fn joined<T: DualNum<Primitive = f64> + Copy>(operator: Operator, a: T, b: T) -> T {
    operator.of(a, b)
}

#[inline(never)]
fn looked_up<T: DualNum<Primitive = f64> + Copy>(curve: &Curve, a: T) -> T {
    curve.of(a)
}

/// Evaluates an instruction at `B` points.
#[inline(always)]
fn step<const B: usize>(
    instruction: Instruction,
    curves: &[Arc<Curve>],
    known: &[[f64; B]],
    out: &mut [f64; B],
) {
    let Instruction { code, a, b, c } = instruction;
    let of = |register: u32| {
        debug_assert!((register as usize) < known.len(), "a register of the tape");
        // SAFETY: only `Writer` creates instructions, and it refers to registers that were filled before, which are
        // `known`.
        unsafe { known.get_unchecked(register as usize) }
    };
    match code {
        Code::Operator(Operator::Add) => two(of(a), of(b), out, |a, b| a + b),
        Code::Operator(Operator::Subtract) => two(of(a), of(b), out, |a, b| a - b),
        Code::Operator(Operator::Multiply) => two(of(a), of(b), out, |a, b| a * b),
        Code::Operator(Operator::Divide) => two(of(a), of(b), out, |a, b| a / b),
        Code::MultiplyAdd => three([of(a), of(b), of(c)], out, |a, b, c| a.mul_add(b, c)),
        Code::MultiplySubtract => three([of(a), of(b), of(c)], out, |a, b, c| a.mul_add(b, -c)),
        Code::SubtractProduct => three([of(a), of(b), of(c)], out, |a, b, c| (-a).mul_add(b, c)),
        Code::Function(Function::Negate) => two(of(a), of(a), out, |a, _| -a),
        Code::Function(Function::Reciprocal) => two(of(a), of(a), out, |a, _| a.recip()),
        Code::Function(Function::Sqrt) => two(of(a), of(a), out, |a, _| a.sqrt()),
        Code::Function(function) => apart(of(a), of(a), out, |a, _| function.of(a)),
        Code::Operator(operator) => apart(of(a), of(b), out, |a, b| operator.of(a, b)),
        Code::Select => three([of(a), of(b), of(c)], out, |a, b, c| match a != 0.0 {
            true => b,
            false => c,
        }),
        Code::Lookup => {
            let curve = &curves[b as usize];
            apart(of(a), of(a), out, |a, _| curve.at(a));
        }
        Code::Call | Code::Filled => unreachable!("calls fill several registers"),
    }
}

#[inline(always)]
fn two<const B: usize>(
    a: &[f64; B],
    b: &[f64; B],
    out: &mut [f64; B],
    f: impl Fn(f64, f64) -> f64,
) {
    for l in 0..B {
        out[l] = f(a[l], b[l]);
    }
}

#[inline(always)]
fn three<const B: usize>(
    [a, b, c]: [&[f64; B]; 3],
    out: &mut [f64; B],
    f: impl Fn(f64, f64, f64) -> f64,
) {
    for l in 0..B {
        out[l] = f(a[l], b[l], c[l]);
    }
}

/// Rare and long operations are kept out of line, so that the loop over instructions stays small.
#[inline(never)]
fn apart<const B: usize>(
    a: &[f64; B],
    b: &[f64; B],
    out: &mut [f64; B],
    f: impl Fn(f64, f64) -> f64,
) {
    two(a, b, out, f);
}

/// Writes a tape, stage by stage.
struct Writer<'a> {
    graph: &'a Graph,
    /// Number of uses of each node by other nodes and by lists.
    uses: Vec<u32>,
    registers: Vec<Option<u32>>,
    /// Register of the reciprocal of each node from the first stage by which later stages divide.
    reciprocals: BTreeMap<Node, u32>,
    tape: Tape,
}

impl<'a> Writer<'a> {
    fn new(graph: &'a Graph, variables: usize, lists: &[&[Node]]) -> Self {
        let all: Vec<Node> = lists.concat();
        let needed = graph.ancestors(&all);
        let mut uses = vec![0; needed.len()];
        let operations = graph.operations().iter().zip(&needed);
        let users = operations.filter(|(_, needed)| **needed);
        let taken = users.flat_map(|(operation, _)| graph.arguments(*operation));
        taken.chain(all).for_each(|node| uses[node.index()] += 1);
        let mut writer = Self {
            graph,
            uses,
            registers: vec![None; needed.len()],
            reciprocals: BTreeMap::new(),
            tape: Tape {
                variables,
                ..Tape::default()
            },
        };
        for (k, operation) in graph.operations().iter().enumerate() {
            match operation {
                Operation::Variable(index) => {
                    let is_known = (*index as usize) < variables || !needed[k];
                    assert!(is_known, "variable {index} of {variables} variables");
                    writer.registers[k] = Some(*index);
                }
                Operation::Constant(bits) if needed[k] => {
                    let register = variables + writer.tape.constants.len();
                    writer.registers[k] = Some(register as u32);
                    writer.tape.constants.push(f64::from_bits(*bits));
                }
                _ => {}
            }
        }
        writer
    }

    /// Adds the instructions of the wanted nodes without a register.
    fn stage(&mut self, wanted: impl Fn(usize) -> bool) {
        let open = |own: &Self, k: usize| wanted(k) && own.registers[k].is_none();
        // Products fused into a sum of the same stage.
        let mut absorbed = vec![false; self.registers.len()];
        for k in 0..absorbed.len() {
            if open(self, k)
                && let Some((product, _)) = self.fused(k, |node| open(self, node))
            {
                absorbed[product] = true;
            }
        }
        for k in 0..absorbed.len() {
            if !open(self, k) || absorbed[k] {
                continue;
            }
            if let Operation::Call(call, _) = self.graph.operations()[k] {
                self.call(call, |own, k| open(own, k));
            } else {
                let instruction = match self.fused(k, |node| absorbed[node]) {
                    Some((_, instruction)) => instruction,
                    None => self.plain(k),
                };
                self.registers[k] = Some(self.push(instruction));
            }
        }
        self.tape.ends.push(self.tape.instructions.len());
    }

    /// Adds an instruction and returns its register.
    fn push(&mut self, instruction: Instruction) -> u32 {
        let register = self.tape.size() as u32;
        self.tape.instructions.push(instruction);
        register
    }

    /// Adds the reciprocals of the divisors of these nodes to the stage written last: a division takes as long as
    /// several products, and would be repeated at every point.
    fn reciprocals(&mut self, wanted: impl Fn(usize, usize) -> bool) {
        for (k, operation) in self.graph.operations().iter().enumerate() {
            let Operation::Binary(Operator::Divide, _, by) = *operation else {
                continue;
            };
            let known = self.registers[by.index()];
            if let (true, Some(a), None) = (wanted(k, by.index()), known, self.reciprocals.get(&by))
            {
                let code = Code::Function(Function::Reciprocal);
                let register = self.push(Instruction {
                    code,
                    a,
                    b: a,
                    c: a,
                });
                self.reciprocals.insert(by, register);
            }
        }
        let end = self.tape.ends.last_mut();
        *end.expect("a stage is written") = self.tape.instructions.len();
    }

    /// A sum or difference with a product that has no other use: the index of the product, and the fused instruction.
    fn fused(&self, k: usize, may: impl Fn(usize) -> bool) -> Option<(usize, Instruction)> {
        let Operation::Binary(operator, left, right) = self.graph.operations()[k] else {
            return None;
        };
        let product = |node: Node| match self.graph.operation(node) {
            Operation::Binary(Operator::Multiply, a, b)
                if self.uses[node.index()] == 1 && may(node.index()) =>
            {
                Some((a, b))
            }
            _ => None,
        };
        let (code, place, (a, b), other) = match operator {
            Operator::Add | Operator::Subtract if left == right => return None,
            Operator::Add => match (product(left), product(right)) {
                (Some(factors), _) => (Code::MultiplyAdd, left, factors, right),
                (_, Some(factors)) => (Code::MultiplyAdd, right, factors, left),
                _ => return None,
            },
            Operator::Subtract => match (product(left), product(right)) {
                (_, Some(factors)) => (Code::SubtractProduct, right, factors, left),
                (Some(factors), _) => (Code::MultiplySubtract, left, factors, right),
                _ => return None,
            },
            _ => return None,
        };
        let [a, b, c] = [a, b, other].map(|node| self.registers[node.index()].unwrap_or_default());
        Some((place.index(), Instruction { code, a, b, c }))
    }

    /// Adds the instructions for all wanted values of a call whose arguments are known.
    fn call(&mut self, number: u32, open: impl Fn(&Self, usize) -> bool) {
        let call = &self.graph.calls()[number as usize];
        let mut called = Called {
            call: call.clone(),
            wanted: Vec::new(),
            registers: Vec::new(),
        };
        let mut nodes = Vec::new();
        for (k, operation) in self.graph.operations().iter().enumerate() {
            let partial = match *operation {
                Operation::Call(own, partial) if own == number && open(self, k) => partial,
                _ => continue,
            };
            let register =
                |(place, node): (usize, Node)| Some((place, self.registers[node.index()]?));
            let registers: Option<Vec<(usize, u32)>> = call.taken(partial).map(register).collect();
            if let Some(registers) = registers {
                nodes.push(k);
                called.wanted.push(partial);
                called.registers.extend(registers);
            }
        }
        called.registers.sort_unstable();
        called.registers.dedup();
        let a = self.tape.calls.len() as u32;
        self.tape.calls.push(called);
        let base = self.tape.variables + self.tape.constants.len();
        for (n, k) in nodes.into_iter().enumerate() {
            let code = if n == 0 { Code::Call } else { Code::Filled };
            self.registers[k] = Some((base + self.tape.instructions.len()) as u32);
            self.tape.instructions.push(Instruction {
                code,
                a,
                b: 0,
                c: 0,
            });
        }
    }

    fn plain(&self, k: usize) -> Instruction {
        let of = |node: Node| self.registers[node.index()].expect("arguments stand before");
        let (code, a, b, c) = match self.graph.operations()[k] {
            Operation::Unary(function, a) => (Code::Function(function), of(a), of(a), of(a)),
            Operation::Binary(Operator::Divide, a, b) if self.reciprocals.contains_key(&b) => {
                let product = Code::Operator(Operator::Multiply);
                (product, of(a), self.reciprocals[&b], of(a))
            }
            Operation::Binary(operator, a, b) => (Code::Operator(operator), of(a), of(b), of(a)),
            Operation::Select(a, b, c) => (Code::Select, of(a), of(b), of(c)),
            Operation::Lookup(curve, a) => (Code::Lookup, of(a), curve, of(a)),
            Operation::Call(..) => unreachable!("calls have instructions of their own"),
            Operation::Constant(_) | Operation::Variable(_) => unreachable!("it has a register"),
        };
        Instruction { code, a, b, c }
    }
}
