//! The discretisation of one run by a scheme: its unknowns, and the points at which the model is evaluated.
//!
//! The unknowns of a run are coefficient vectors `V_k` of `n` states each, in time order; for most schemes they are the
//! states at nodes. The model is evaluated at points `Y_i`, which are unknowns or combinations of unknowns and
//! derivatives at earlier points:
//!
//! ```text
//! Y_i = V_k    or    Y_i = Σ_k p_k V_k + Σ_l q_l f(Y_l)
//! ```
//!
//! Points are used for the defects (collocated), the samples (observed), or both; adjacent elements share the point at
//! their common boundary.

use super::mesh::Run;
use super::simd::LANES;
use super::tableau::{Row, Scheme, Tableau, Value};
use std::sync::Arc;

/// Unknowns, points and elements of one run.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Time of each coefficient vector \[s\]: that of a node, or of its largest influence.
    pub times: Vec<f64>,
    /// Points; combinations refer to earlier ones.
    pub points: Vec<Point>,
    /// Inputs at the points, `n_inputs` per point, each followed by the time \[s\].
    pub inputs: Vec<f64>,
    /// Elements in time order.
    pub elements: Vec<Element>,
    /// Indices of the points of all elements, in the order of their tableaus.
    pub element_points: Vec<u32>,
    /// Index of the point of each sample.
    pub observed: Vec<usize>,
    /// Number of points that are combinations.
    pub combinations: usize,
}

/// A point at which the model is evaluated.
#[derive(Debug, Clone)]
pub struct Point {
    /// The states at the point.
    pub state: PointState,
    /// The sample at its time, if any.
    pub sample: Option<u32>,
}

/// The states of a point.
#[derive(Debug, Clone)]
pub enum PointState {
    /// The states of an unknown.
    Node(usize),
    /// A combination.
    Combination(Box<Combination>),
}

/// The sample of each point of a group; None if there is none, and for excess lanes.
pub type Samples = [Option<u32>; LANES];

impl PointState {
    /// The values of this point for a quantity that has `size` values for each of the run's unknowns, in `nodes`, and
    /// for each of its combinations, in `combined`.
    #[inline]
    pub fn of<'a>(&self, nodes: &'a [f64], combined: &'a [f64], size: usize) -> &'a [f64] {
        match self {
            Self::Node(k) => &nodes[k * size..(k + 1) * size],
            Self::Combination(c) => &combined[c.index * size..(c.index + 1) * size],
        }
    }
}

/// `Σ_k p_k V_k + Σ_l q_l f(Y_l)`.
#[derive(Debug, Clone)]
pub struct Combination {
    /// Index among the combinations of the run.
    pub index: usize,
    /// Coefficients of the unknowns of the run.
    pub p: Row,
    /// Coefficients of the derivatives at the points of the run \[s\].
    pub q: Row,
}

/// One element: a part of the mesh with one polynomial or system of equations.
#[derive(Debug, Clone)]
pub struct Element {
    /// Index of the first unknown, shared with the previous element.
    pub first: usize,
    /// Start in [`Grid::element_points`].
    pub points: usize,
    /// Length \[s\].
    pub h: f64,
    /// Coefficients of the scheme.
    pub tableau: Arc<Tableau>,
}

impl Grid {
    /// The grid of a run with `n_inputs` exogenous inputs.
    pub fn new(scheme: Scheme, run: &Run, n_inputs: usize) -> Self {
        let mut grid = Self {
            times: vec![run.mesh[0]],
            points: Vec::new(),
            inputs: Vec::new(),
            elements: Vec::new(),
            element_points: Vec::new(),
            observed: Vec::new(),
            combinations: 0,
        };
        // Times of the points, and whether a point precedes a jump of the inputs at that time.
        let mut point_times: Vec<(f64, bool)> = Vec::new();
        // No element contains a jump, however many intervals it spans.
        let is_inner = |k: &usize| *k > 0 && k + 1 < run.mesh.len();
        let jumps = run.steps.time.iter().filter_map(|time| {
            let place = run.mesh.binary_search_by(|own| own.total_cmp(time));
            place.ok().filter(is_inner)
        });
        let mut first = 0;
        for last in jumps.chain([run.mesh.len() - 1]) {
            let mesh = &run.mesh[first..=last];
            for part in scheme.elements(mesh) {
                let ends = (mesh[part.first], mesh[part.first + part.intervals]);
                grid.add_element(ends, part.tableau, run, &mut point_times);
            }
            first = last;
        }
        grid.observe(run, &mut point_times);
        grid.inputs = vec![0.0; (n_inputs + 1) * grid.points.len()];
        let inputs = grid.inputs.chunks_exact_mut(n_inputs + 1);
        for (out, (time, is_before)) in inputs.zip(&point_times) {
            match is_before {
                true => run.inputs_before(*time, &mut out[..n_inputs]),
                false => run.inputs_at(*time, &mut out[..n_inputs]),
            }
            out[n_inputs] = *time;
        }
        if let Some(window) = run.steps.window {
            grid.open_windows(run, window, n_inputs);
        }
        // A sample is compared at its own inputs, also before a jump.
        for (sample, point) in grid.observed.iter().enumerate() {
            let first = point * (n_inputs + 1);
            grid.inputs[first..first + n_inputs].copy_from_slice(&run.inputs[sample]);
        }
        grid
    }

    /// The samples of the first `count` points of a group.
    #[inline(always)]
    pub fn samples(&self, members: [usize; LANES], count: usize) -> Samples {
        let of = |lane: usize| self.points[members[lane]].sample;
        std::array::from_fn(|lane| if lane < count { of(lane) } else { None })
    }

    /// Number of coefficient vectors.
    #[inline]
    pub fn nodes(&self) -> usize {
        self.times.len()
    }

    /// The points of an element, in the order of its tableau.
    #[inline]
    pub fn points_of(&self, element: &Element) -> &[u32] {
        &self.element_points[element.points..element.points + element.tableau.points.len()]
    }

    /// True if a point uses derivatives at other points.
    pub fn has_nested(&self) -> bool {
        let takes = |point: &Point| match &point.state {
            PointState::Node(_) => false,
            PointState::Combination(c) => !c.q.is_empty(),
        };
        self.combinations > 0 && self.points.iter().any(takes)
    }

    fn add_element(
        &mut self,
        (start, end): (f64, f64),
        tableau: Arc<Tableau>,
        run: &Run,
        times: &mut Vec<(f64, bool)>,
    ) {
        let (first, h) = (self.nodes() - 1, end - start);
        // The exact end of the element, since inputs may jump there.
        let at = |c: f64| if c == 1.0 { end } else { start + c * h };
        self.times
            .extend(tableau.abscissae[1..].iter().map(|c| at(*c)));
        let element = Element {
            first,
            points: self.element_points.len(),
            h,
            tableau,
        };
        // The point at the common boundary exists if the previous element is collocated there too. Both share it unless
        // inputs jump there.
        let before = self.elements.last().filter(|_| !run.jumps_at(start));
        let shared = before.and_then(|last| {
            let mut own = self.points_of(last).iter().copied();
            own.rfind(
                |i| matches!(self.points[*i as usize].state, PointState::Node(k) if k == first),
            )
        });
        for point in &element.tableau.points {
            let state = match &point.value {
                Value::Unknown(0) if shared.is_some() => {
                    self.element_points.extend(shared);
                    continue;
                }
                Value::Unknown(j) => PointState::Node(first + j),
                Value::Combination(p) => {
                    let own = &self.element_points[element.points..];
                    combination(&mut self.combinations, &element, own, p, &Row::new())
                }
            };
            self.element_points.push(self.points.len() as u32);
            self.points.push(Point {
                state,
                sample: None,
            });
            times.push((at(point.c), point.c == 1.0));
        }
        self.elements.push(element);
    }

    /// Tells the points of each element where the part of the mesh that they stand for begins and ends: the element, or if it has many
    /// points, what is nearest to them.
    fn open_windows(&mut self, run: &Run, window: usize, n_inputs: usize) {
        const FEW: usize = 3;
        let mut inputs = vec![0.0; n_inputs];
        for element in &self.elements {
            let points = &element.tableau.points;
            let start = self.times[element.first];
            let middle = |k: usize| 0.5 * (points[k].c + points[k + 1].c);
            let ends = |k: usize| match points.len() {
                ..=FEW => [0.0, 1.0],
                count => [
                    if k == 0 { 0.0 } else { middle(k - 1) },
                    if k + 1 == count { 1.0 } else { middle(k) },
                ],
            };
            let own = &self.element_points[element.points..];
            for (k, point) in own[..points.len()].iter().enumerate() {
                for (place, c) in ends(k).into_iter().enumerate() {
                    run.inputs_at(start + c * element.h, &mut inputs);
                    let first = *point as usize * (n_inputs + 1);
                    self.inputs[first + window + place] = inputs[window + place];
                }
            }
        }
    }

    /// Determines or adds the point of each sample.
    fn observe(&mut self, run: &Run, times: &mut Vec<(f64, bool)>) {
        let mut point_of = vec![None; self.nodes()];
        for (i, point) in self.points.iter().enumerate() {
            if let PointState::Node(k) = point.state {
                point_of[k] = Some(i);
            }
        }
        let starts: Vec<f64> = self.elements.iter().map(|e| self.times[e.first]).collect();
        for (sample, &time) in run.time.iter().enumerate() {
            let element = starts.partition_point(|s| *s <= time).max(1) - 1;
            let element = &self.elements[element].clone();
            let (p, q) = place(element, time, self.times[element.first]);
            let node = match (p.as_slice(), q.as_slice()) {
                (&[(j, 1.0)], []) => Some(element.first + j),
                _ => None,
            };
            // Samples at the same time have separate points, since inputs may jump there.
            let is_alone = |_: &usize| !run.jumps_at(time);
            let found = node.and_then(|k| point_of[k]).filter(is_alone);
            let index = found.unwrap_or_else(|| {
                let own = &self.element_points[element.points..];
                let state = match node {
                    Some(k) => PointState::Node(k),
                    None => combination(&mut self.combinations, element, own, &p, &q),
                };
                self.points.push(Point {
                    state,
                    sample: None,
                });
                times.push((time, false));
                self.points.len() - 1
            });
            self.points[index].sample = Some(sample as u32);
            self.observed.push(index);
        }
    }
}

/// A combination over the unknowns and points of an element, numbered by `count`.
fn combination(
    count: &mut usize,
    element: &Element,
    points: &[u32],
    p: &Row,
    q: &Row,
) -> PointState {
    *count += 1;
    PointState::Combination(Box::new(Combination {
        index: *count - 1,
        p: p.iter().map(|&(j, v)| (element.first + j, v)).collect(),
        q: q.iter()
            .map(|&(i, v)| (points[i] as usize, element.h * v))
            .collect(),
    }))
}

/// The interpolant of the scheme at a time; at a node, the unknown itself.
pub(super) fn place(element: &Element, time: f64, start: f64) -> (Row, Row) {
    let c = (time - start) / element.h;
    element.tableau.interpolate(c.clamp(0.0, 1.0))
}
