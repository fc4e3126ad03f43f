//! Linear systems of several inputs, outputs and states, and random loops of them with exact solutions.

use nalgebra::{DMatrix, DVector};
use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{Abilities, Component, Progress, Role, System, ValueKind, Variable};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// `ẋ = A x + B u`, `y = C x + D u`, solved exactly for inputs that are ramps. Inputs `u0`, `u1`...,
/// outputs `y0`...
#[derive(Clone)]
pub struct Block {
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub c: DMatrix<f64>,
    pub d: DMatrix<f64>,
    pub x: DVector<f64>,
    u: DVector<f64>,
    slope: DVector<f64>,
    abilities: Abilities,
    variables: Vec<Variable>,
    saved: Vec<(DVector<f64>, DVector<f64>)>,
    /// For a step: how state, inputs and slopes make the next state.
    transition: (f64, DMatrix<f64>),
}

impl Block {
    fn new(matrices: [DMatrix<f64>; 4], x: DVector<f64>, abilities: Abilities) -> Self {
        let [a, b, c, d] = matrices;
        let (inputs, outputs) = (b.ncols(), c.nrows());
        let mut variables = Vec::new();
        for k in 0..inputs {
            let name = format!("u{k}");
            variables.push(Variable::new(name, k as u32, ValueKind::Real, Role::Input));
        }
        for k in 0..outputs {
            let handle = (inputs + k) as u32;
            let mut y = Variable::new(format!("y{k}"), handle, ValueKind::Real, Role::Output);
            y.feedthrough = (0..inputs).filter(|&j| d[(k, j)] != 0.0).collect();
            y.initial_feedthrough.clone_from(&y.feedthrough);
            variables.push(y);
        }
        Self {
            u: DVector::zeros(inputs),
            slope: DVector::zeros(inputs),
            saved: Vec::new(),
            transition: (0.0, DMatrix::zeros(0, 0)),
            a,
            b,
            c,
            d,
            x,
            abilities,
            variables,
        }
    }
}

impl Component for Block {
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        for (&handle, &value) in handles.iter().zip(values) {
            self.u[handle as usize] = value;
        }
        Ok(())
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        let y = &self.c * &self.x + &self.d * &self.u;
        for (&handle, value) in handles.iter().zip(values) {
            *value = y[handle as usize - self.u.len()];
        }
        Ok(())
    }

    fn step(&mut self, _t: f64, h: f64) -> Result<Progress, ComponentError> {
        let (n, m) = (self.x.len(), self.u.len());
        if self.transition.0 != h {
            let mut all = DMatrix::zeros(n + 2 * m, n + 2 * m);
            all.view_mut((0, 0), (n, n)).copy_from(&self.a);
            all.view_mut((0, n), (n, m)).copy_from(&self.b);
            all.view_mut((n, n + m), (m, m)).fill_with_identity();
            self.transition = (h, (all * h).exp().rows(0, n).into_owned());
        }
        let known = DVector::from_iterator(
            n + 2 * m,
            (self.x.iter().chain(&self.u).chain(&self.slope)).copied(),
        );
        self.x = &self.transition.1 * known;
        self.u += &self.slope * h;
        self.slope.fill(0.0);
        Ok(Progress::Done)
    }

    fn abilities(&self) -> Abilities {
        self.abilities
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        let now = (self.x.clone(), self.u.clone());
        self.saved
            .resize(self.saved.len().max(place + 1), now.clone());
        self.saved[place] = now;
        Ok(())
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        (self.x, self.u) = self.saved[place].clone();
        Ok(())
    }

    fn set_input_derivatives(
        &mut self,
        handles: &[u32],
        slopes: &[f64],
    ) -> Result<(), ComponentError> {
        for (&handle, &slope) in handles.iter().zip(slopes) {
            self.slope[handle as usize] = slope;
        }
        Ok(())
    }
}

/// Random stable blocks, some with direct feedthrough, that feed each other; the closed loop is stable.
pub struct RandomLoop {
    blocks: Vec<Block>,
    /// Output (block, number) and input (block, number).
    wires: Vec<[(usize, usize); 2]>,
}

impl RandomLoop {
    /// With or without algebraic loops between the blocks.
    pub fn new(seed: u64, n: usize, abilities: Abilities, has_algebraic_loops: bool) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        loop {
            let mut system = Self::draw(&mut random, n, abilities);
            if !has_algebraic_loops {
                system.cut_algebraic_loops();
            }
            let poles = system.closed_loop().0.complex_eigenvalues();
            if poles
                .iter()
                .all(|pole| pole.re < -0.05 && pole.norm() < 8.0)
            {
                return system;
            }
        }
    }

    fn draw(random: &mut ChaCha8Rng, n: usize, abilities: Abilities) -> Self {
        let mut uniform = |scale: f64| {
            scale * (2.0 * (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 - 1.0)
        };
        let mut blocks = Vec::new();
        for _ in 0..n {
            let states = 1 + (uniform(1.0).abs() * 2.0) as usize;
            let inputs = 1 + (uniform(1.0).abs() * 2.0) as usize;
            let outputs = 1 + (uniform(1.0).abs() * 2.0) as usize;
            let mut matrix =
                |rows, columns, scale| DMatrix::from_fn(rows, columns, |_, _| uniform(scale));
            let a = matrix(states, states, 1.0) - DMatrix::identity(states, states) * 1.5;
            let b = matrix(states, inputs, 1.0);
            let c = matrix(outputs, states, 1.0);
            let d = matrix(outputs, inputs, 0.4);
            let x = matrix(states, 1, 1.0).column(0).into_owned();
            let d = if uniform(1.0) > 0.0 { d } else { d * 0.0 };
            blocks.push(Block::new([a, b, c, d], x, abilities));
        }
        let mut wires = Vec::new();
        for to in 0..n {
            for input in 0..blocks[to].b.ncols() {
                // A ring, so that all hang together, and other wires at random.
                let any = (uniform(1.0).abs() * n as f64) as usize;
                let from = if input == 0 {
                    (to + n - 1) % n
                } else {
                    any.min(n - 1)
                };
                let outputs = blocks[from].c.nrows();
                let output = (uniform(1.0).abs() * outputs as f64) as usize;
                wires.push([(from, output.min(outputs - 1)), (to, input)]);
            }
        }
        Self { blocks, wires }
    }

    /// Leaves feedthrough only to inputs that earlier blocks feed.
    fn cut_algebraic_loops(&mut self) {
        for [(from, _), (to, input)] in &self.wires {
            if from >= to {
                self.blocks[*to].d.column_mut(*input).fill(0.0);
            }
        }
        for block in &mut self.blocks {
            let matrices = [&block.a, &block.b, &block.c, &block.d].map(Clone::clone);
            *block = Block::new(matrices, block.x.clone(), block.abilities);
        }
    }

    pub fn system(&self) -> System {
        let mut system = System::new();
        for (k, block) in self.blocks.iter().enumerate() {
            system
                .add(format!("b{k}"), Box::new(block.clone()))
                .unwrap();
        }
        for [(from, output), (to, input)] in &self.wires {
            let from = format!("b{from}.y{output}");
            system.connect(&from, &format!("b{to}.u{input}")).unwrap();
        }
        system
    }

    /// `A` and `C` of `ẋ = A x`, `y = C x` for all states and all outputs.
    fn closed_loop(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let starts = |size: &dyn Fn(&Block) -> usize| -> Vec<usize> {
            let sums = self.blocks.iter().scan(0, |sum, block| {
                *sum += size(block);
                Some(*sum)
            });
            std::iter::once(0).chain(sums).collect()
        };
        let (xs, us, ys) = (
            starts(&|b| b.a.nrows()),
            starts(&|b| b.b.ncols()),
            starts(&|b| b.c.nrows()),
        );
        let n = self.blocks.len();
        let mut a = DMatrix::zeros(xs[n], xs[n]);
        let mut b = DMatrix::zeros(xs[n], us[n]);
        let mut c = DMatrix::zeros(ys[n], xs[n]);
        let mut d = DMatrix::zeros(ys[n], us[n]);
        for (k, block) in self.blocks.iter().enumerate() {
            a.view_mut((xs[k], xs[k]), block.a.shape())
                .copy_from(&block.a);
            b.view_mut((xs[k], us[k]), block.b.shape())
                .copy_from(&block.b);
            c.view_mut((ys[k], xs[k]), block.c.shape())
                .copy_from(&block.c);
            d.view_mut((ys[k], us[k]), block.d.shape())
                .copy_from(&block.d);
        }
        let mut wires = DMatrix::zeros(us[n], ys[n]);
        for [(from, output), (to, input)] in &self.wires {
            wires[(us[*to] + input, ys[*from] + output)] = 1.0;
        }
        let algebraic = DMatrix::identity(ys[n], ys[n]) - &d * &wires;
        let y = algebraic.try_inverse().expect("no singular algebraic loop") * c;
        (a + b * wires * &y, y)
    }

    /// All outputs at a time, by the matrix exponential.
    pub fn exact(&self, time: f64) -> DVector<f64> {
        let (a, c) = self.closed_loop();
        let starts = self.blocks.iter().flat_map(|b| b.x.iter().copied());
        let x = DVector::from_iterator(a.nrows(), starts);
        c * (a * time).exp() * x
    }
}
