//! The loops formed by the instances of a problem, each opened at a wire and linearised at the end of the first run.

use crate::posed::Posed;
use crate::problem::file::{Per, Quantity};
use crate::result::Found;
use crate::result::opened::Opened;
use crate::search::solved::Solved;
use nalgebra::Complex;
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::Wire;
use pilotage_linear::{Figure, LoopFigures, OpenLoop, eigenvalues};

/// The joint equations without one of the wires that close a loop.
pub(crate) struct Cut<'p>(Opened<'p>);

impl<'p> Cut<'p> {
    /// The equations of a problem without the wire of that number.
    fn new(posed: &'p Posed<'p>, cut: usize) -> Option<Self> {
        let wire = &posed.file.system.connections[cut];
        let is_input = |name: &str| name == wire.to.value;
        let signal = wire.from.value.clone();
        Opened::new(posed, &[cut], is_input, vec![signal]).map(Self)
    }

    /// The loop with these shared parameters and these states at the end of the first run. None if a derivative is not
    /// finite.
    fn at(
        &self,
        x: &[f64],
        theta: &[f64],
    ) -> Option<OpenLoop<impl Fn(f64) -> Complex<f64> + use<>>> {
        // `ẋ = A x + b w`, and the signal fed back to `w`.
        let mut open = self.0.linear(x, theta)?;
        let factor = -self.0.factor;
        open.c *= factor;
        open.d *= factor;
        let returned = 1.0 + open.d[(0, 0)];
        let closed = &open.a - &open.b * &open.c / returned;
        Some(OpenLoop {
            open: open.poles(),
            closed: eigenvalues(&closed),
            response: move |omega| open.transfer(0, 0, Complex::new(0.0, omega)),
        })
    }
}

/// A loop of a solution, with its figures.
struct Loop<'p> {
    /// The output at whose wire the loop is opened.
    output: String,
    /// Whether there are several loops.
    is_named: bool,
    cut: Cut<'p>,
    figures: LoopFigures,
}

impl Loop<'_> {
    /// Figures, named after the loop. Poles are common to all loops and keep their names.
    fn named(&self, figures: &LoopFigures) -> Vec<Figure> {
        let mut all = figures.named();
        if self.is_named {
            let own = all.iter_mut().filter(|own| !own.is_of_pole());
            own.for_each(|own| own.name = format!("{}({})", own.name, self.output));
        }
        all
    }
}

/// The loops of a solution. If there are parallel wires, as from a pilot's two sticks, each is opened with the others
/// closed (margins of one path at a time: MIL-F-9490D, 3.1.3.6).
pub(crate) struct Looped<'p> {
    loops: Vec<Loop<'p>>,
    /// The states at the end of the first run.
    x: Vec<f64>,
}

impl<'p> Looped<'p> {
    /// From a solution, at the end of its first run.
    pub fn of(posed: &'p Posed<'p>, solved: &Solved) -> Option<Self> {
        let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
        let x = problem.states_at_samples(z, 0).pop()?;
        Self::new(posed, &x, &problem.physical_theta(z))
    }

    /// From a problem with these states at the end of the first run and these shared parameters. None if no set of
    /// wires between two instances opens all loops, or if a loop cannot be linearised there.
    pub fn new(posed: &'p Posed<'p>, x: &[f64], theta: &[f64]) -> Option<Self> {
        let description = &posed.file.system;
        let wires = match pilots(posed) {
            wires if wires.is_empty() => openings(description),
            wires => wires,
        };
        let is_named = wires.len() > 1;
        let own = |wire: usize| {
            let cut = Cut::new(posed, wire)?;
            Some(Loop {
                output: description.connections[wire].from.value.clone(),
                is_named,
                figures: cut.at(x, theta)?.figures(),
                cut,
            })
        };
        let loops: Option<Vec<Loop<'p>>> = wires.into_iter().map(own).collect();
        Some(Self {
            loops: loops.filter(|own| !own.is_empty())?,
            x: x.to_vec(),
        })
    }

    /// The outputs at whose wires the loops are opened, in the order of the figures.
    pub fn cuts(&self) -> Vec<String> {
        self.loops.iter().map(|own| own.output.clone()).collect()
    }

    /// The updated figures of all loops, with the poles listed once.
    fn all(&self, of: impl Fn(&Loop<'p>) -> Option<LoopFigures>) -> Vec<Figure> {
        let mut all = Vec::new();
        for (k, own) in self.loops.iter().enumerate() {
            let figures = of(own).unwrap_or_default();
            let named = own.named(&figures).into_iter();
            all.extend(named.filter(|own| k == 0 || !own.is_of_pole()));
        }
        // Poles come last, as for a single loop.
        all.sort_by_key(Figure::is_of_pole);
        all
    }

    fn figures(&self) -> Vec<Figure> {
        self.all(|own| Some(own.figures.clone()))
    }

    /// The figures, as derived quantities.
    pub fn found(&self) -> Vec<Found> {
        let figures = self.figures().into_iter();
        let found = figures.map(|figure| Found {
            name: figure.name,
            unit: Some(figure.unit.to_owned()),
            values: vec![(None, figure.value)],
            per: Per::All,
            is_tied: true,
            bound: None,
        });
        found.collect()
    }

    /// The same figures at other shared parameters, which may be far away.
    pub fn again(&self, theta: &[f64]) -> Vec<f64> {
        let found = self.all(|own| {
            let moved = own.cut.at(&self.x, theta)?;
            Some(moved.figures_with(&own.figures.poles))
        });
        let figures = self.figures();
        figures.iter().map(|own| own.value_in(&found)).collect()
    }

    /// The same figures at nearby shared parameters and with a changed state. The state is a run's own parameter, which
    /// is constant along the run. NaN if a figure no longer exists.
    pub fn moved(&self, theta: &[f64], (state, by): (usize, f64)) -> Vec<f64> {
        let mut x = self.x.clone();
        x[state] += by;
        let moved = self.all(|own| Some(own.cut.at(&x, theta)?.figures_near(&own.figures)));
        let figures = self.figures();
        figures.iter().map(|own| own.value_in(&moved)).collect()
    }
}

/// The instances at both ends of a wire.
pub(crate) fn ends(description: &SystemDescription, wire: &Wire) -> [String; 2] {
    [&wire.from.value, &wire.to.value].map(|end| instance(description, end))
}

/// The instance of a signal.
pub(crate) fn instance(description: &SystemDescription, signal: &str) -> String {
    let named = |own: &&str| {
        signal
            .strip_prefix(*own)
            .is_some_and(|rest| rest.starts_with('.'))
    };
    let names = description.instances.iter().map(|own| own.name.as_str());
    let longest = names.filter(named).max_by_key(|name| name.len());
    longest.unwrap_or_default().to_owned()
}

/// `L(jω)` of an open loop.
pub type Response = Box<dyn Fn(f64) -> Complex<f64>>;

/// The open loops of a solution as functions of the shared parameters, those of [`Fit::cuts`](crate::Fit::cuts).
pub struct OpenLoops<'p>(Looped<'p>);

impl std::fmt::Debug for OpenLoops<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("OpenLoops").field(&self.0.cuts()).finish()
    }
}

impl<'p> OpenLoops<'p> {
    /// Linearised at the end of the first run. None if there is no closed loop.
    pub fn new(posed: &'p Posed<'p>, solved: &Solved) -> Option<Self> {
        Looped::of(posed, solved).map(Self)
    }

    /// The response of each loop with these shared parameters, at the same states. None if a loop cannot be linearised
    /// there.
    pub fn with(&self, theta: &[f64]) -> Option<Vec<Response>> {
        let of = |own: &Loop<'p>| -> Option<Response> {
            Some(Box::new(own.cut.at(&self.0.x, theta)?.response))
        };
        self.0.loops.iter().map(of).collect()
    }
}

/// The instances driven by a column, such as a pilot by a target, and those with a measured signal.
fn ends_of(posed: &Posed<'_>) -> (Vec<String>, Vec<String>) {
    let (file, description) = (posed.file, &posed.file.system);
    let fed = file
        .inputs
        .iter()
        .map(|own| instance(description, &own.signal.value));
    let fed: Vec<String> = fed.collect();
    let names = description.instances.iter().map(|own| own.name.clone());
    let measured = file.measured.iter().filter_map(|own| match &own.of {
        Quantity::Signal(name) => Some(instance(description, name)),
        Quantity::Expression(..) => None,
    });
    (
        names.filter(|name| fed.contains(name)).collect(),
        measured.collect(),
    )
}

/// The output wires of a problem's pilots.
pub(crate) fn pilots(posed: &Posed<'_>) -> Vec<usize> {
    let (driven, measured) = ends_of(posed);
    of_pilots(&posed.file.system, &driven, &measured)
}

/// The output wires of driven instances that close loops: those of the first such instance, and of others without a
/// measured signal. An inner loop, such as a stability augmentation, stays closed.
fn of_pilots(
    description: &SystemDescription,
    driven: &[String],
    measured: &[String],
) -> Vec<usize> {
    let wires = description.connections.iter();
    let edges: Vec<[String; 2]> = wires.map(|wire| ends(description, wire)).collect();
    let closes = |[from, to]: &[String; 2]| {
        let mut reached = vec![to];
        let mut next = 0;
        while next < reached.len() {
            let here = reached[next];
            let onward = edges
                .iter()
                .filter(|own| own[0] == *here)
                .map(|own| &own[1]);
            let new: Vec<&String> = onward.filter(|own| !reached.contains(own)).collect();
            reached.extend(new);
            next += 1;
        }
        reached.contains(&from)
    };
    let mut cut: Vec<usize> = Vec::new();
    for name in driven {
        let own = (0..edges.len()).filter(|k| edges[*k][0] == *name && closes(&edges[*k]));
        let own: Vec<usize> = own.collect();
        if cut.is_empty() || !measured.contains(name) {
            cut.extend(own);
        }
    }
    cut
}

/// The only wire that opens all loops, if there are loops and one wire suffices.
pub(crate) fn opening(description: &SystemDescription) -> Option<usize> {
    match openings(description)[..] {
        [own] => Some(own),
        _ => None,
    }
}

/// The first wire that opens all loops, or else the first set of parallel wires from one instance to another that does.
fn openings(description: &SystemDescription) -> Vec<usize> {
    let wires = description.connections.iter();
    let edges: Vec<[String; 2]> = wires.map(|wire| ends(description, wire)).collect();
    let is_open = |cut: &[usize]| {
        let kept = edges.iter().enumerate();
        let kept = kept.filter(|(k, _)| !cut.contains(k));
        !has_circle(&kept.map(|(_, edge)| edge).collect::<Vec<_>>())
    };
    if is_open(&[]) {
        return Vec::new();
    }
    let beside = |k: usize| -> Vec<usize> {
        let others = edges.iter().enumerate();
        let beside = others.filter(|(_, own)| **own == edges[k]);
        beside.map(|(k, _)| k).collect()
    };
    let single = (0..edges.len()).map(|k| vec![k]);
    let all = single.chain((0..edges.len()).map(beside));
    all.into_iter().find(|cut| is_open(cut)).unwrap_or_default()
}

/// Whether a directed graph has a cycle: edges from nodes that no edge leads to are removed until none remain.
fn has_circle(edges: &[&[String; 2]]) -> bool {
    let mut left = edges.to_vec();
    loop {
        let ends: Vec<&String> = left.iter().map(|edge| &edge[1]).collect();
        let kept: Vec<&[String; 2]> = left
            .iter()
            .copied()
            .filter(|edge| ends.contains(&&edge[0]))
            .collect();
        if kept.len() == left.len() {
            return !left.is_empty();
        }
        left = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_are_found() {
        let edges = |all: &[(&str, &str)]| -> Vec<[String; 2]> {
            all.iter()
                .map(|(a, b)| [(*a).to_owned(), (*b).to_owned()])
                .collect()
        };
        for (all, expected) in [
            (vec![], false),
            (vec![("a", "b"), ("b", "c"), ("a", "c")], false),
            (vec![("a", "b"), ("b", "a")], true),
            (vec![("x", "a"), ("a", "b"), ("b", "c"), ("c", "b")], true),
            (vec![("a", "a")], true),
        ] {
            let all = edges(&all);
            assert_eq!(
                has_circle(&all.iter().collect::<Vec<_>>()),
                expected,
                "{all:?}"
            );
        }
    }
}
