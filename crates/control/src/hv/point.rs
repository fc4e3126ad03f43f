//! The softest landing from a height and a speed.

use super::helicopter::{Helicopter, Trim};
use super::pilot::Pilot;
use super::problem::problem;
use crate::interior::{self, Options, Status};
use crate::optimise::{self, even};
use crate::pose::Posed;
use crate::program::Program;
use pilotage_cosim::description::InstanceDescription;
use pilotage_estimation::system::part::Part;
use pilotage_estimation::{ProblemError, ProblemFile};
use pilotage_language::parse;
use std::path::Path;

/// What limits a landing and how it is computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Permitted sink rate \[m/s\] and speed \[m/s\] at touch-down.
    pub touch_down: [f64; 2],
    /// Limits of `cz` and its largest rate \[1/s\].
    pub cz: [f64; 3],
    /// Largest magnitude of `alpha` \[rad\] and of its rate \[rad/s\].
    pub alpha: [f64; 2],
    /// Limits of the rotor speed over that of trim.
    pub rotor: [f64; 2],
    /// Whether the engine runs down from trim's power, rather than being gone at once.
    pub runs_down: bool,
    /// Number of intervals.
    pub intervals: usize,
    /// Number of starts of a point.
    pub starts: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            touch_down: [2.4, 15.0],
            cz: [0.005, 0.15, 0.6],
            alpha: [30.0_f64.to_radians(), 1.5],
            rotor: [0.5, 1.1],
            runs_down: false,
            intervals: 50,
            starts: 3,
        }
    }
}

impl Settings {
    /// S of a touch-down with these speeds forwards and downwards \[m/s\].
    pub fn touched(&self, u: f64, w: f64) -> f64 {
        let [sink, fast] = self.touch_down;
        (w / sink).max(u.abs() / fast)
    }
}

/// Landings of a helicopter, with a pilot or without.
#[derive(Debug)]
pub struct Landings {
    helicopter: Helicopter,
    pilot: Option<Pilot>,
    settings: Settings,
    pub(super) posed: Posed,
    /// Places of the helicopter's states, and of the pilot's of both axes.
    places: Vec<usize>,
    hands: [usize; 2],
    /// The same with other pilots, as likely by a fit.
    drawn: Vec<Self>,
}

/// The softest landing from a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Landing {
    /// The larger of sink rate and speed at touch-down over what is permitted, of the best start.
    pub s: f64,
    /// The same of the replay; NaN where there is none.
    pub replayed: f64,
    /// Whether a flight of the replay lands within the limits.
    pub is_certified: bool,
    /// Whether as many starts as asked for converged, all beyond the limits and at least two to this value.
    pub is_sure: bool,
    /// Duration from the end of the delay \[s\].
    pub duration: f64,
    /// Iterations of all starts.
    pub iterations: usize,
    /// Variables of the program, for neighbours; empty where the ground came during the delay.
    pub z: Vec<f64>,
    /// Mesh and variables of the flight that was integrated again, where it is of a finer mesh.
    pub finer: Option<(Vec<f64>, Vec<f64>)>,
}

/// S of a flight that lands within the limits, with its mesh and variables.
type Certified = (f64, (Vec<f64>, Vec<f64>));

/// Values of S that differ less are the same.
const SAME: f64 = 0.005;
/// Number of further starts where some do not converge, or no two to the best.
const SPARE: usize = 5;
/// Time to the ground \[s\] within which no control changes the landing.
const SOON: f64 = 0.03;
/// Options of the solver: S is wanted to three digits.
const TOLERANCE: f64 = 1e-6;
const MOST_ITERATIONS: usize = 300;
/// First barrier from a neighbour's landing, and from elsewhere.
const WARM: f64 = 1e-3;
const COLD: f64 = 0.1;
/// Part of the range of a path's limits by which a flight that is to be certified stays within them.
const WITHIN: f64 = 0.02;
/// Largest violation of a certified flight, of the limits' sizes.
const VIOLATION: f64 = 1e-3;

impl Landings {
    /// Poses the problem once for all points.
    ///
    /// # Errors
    /// When the helicopter's model does not suit it.
    pub fn new(
        helicopter: Helicopter,
        pilot: Option<Pilot>,
        settings: Settings,
    ) -> Result<Self, ProblemError> {
        let text = problem(&helicopter, pilot.as_ref(), &settings)?;
        let file = ProblemFile::parse(&text, Path::new("hv.toml"))?;
        let open = |own: &InstanceDescription| match (own.name.as_str(), &pilot) {
            ("hand", Some(pilot)) => {
                let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
                Ok(Part::of_file(parse(&pilot.text(), "pilot", &none)?))
            }
            _ => Ok(helicopter.part.clone()),
        };
        let posed = Posed::new(&file, &open)?;
        let place = |name: String| posed.states.iter().position(|own| own.name == name);
        let names = &helicopter.part.model.states;
        let places = names
            .iter()
            .filter_map(|name| place(format!("helicopter.{name}")));
        let hands = ["hand.cz_0", "hand.alpha_0"].map(|name| place(name.into()).unwrap_or(0));
        Ok(Self {
            places: places.collect(),
            hands,
            helicopter,
            pilot,
            settings,
            posed,
            drawn: Vec::new(),
        })
    }

    /// With other pilots of the same structure, for the band of the boundary.
    ///
    /// # Errors
    /// As [`Landings::new`].
    pub fn with_draws(mut self, pilots: Vec<Pilot>) -> Result<Self, ProblemError> {
        let one = |pilot| Self::new(self.helicopter.clone(), Some(pilot), self.settings.clone());
        self.drawn = pilots.into_iter().map(one).collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// Those with other pilots.
    pub fn drawn(&self) -> &[Self] {
        &self.drawn
    }

    /// The helicopter.
    pub fn helicopter(&self) -> &Helicopter {
        &self.helicopter
    }

    /// The pilot.
    pub fn pilot(&self) -> Option<&Pilot> {
        self.pilot.as_ref()
    }

    /// Places of the helicopter's states, in the order of its model.
    pub(super) fn places(&self) -> &[usize] {
        &self.places
    }

    /// Places of the first state of the pilot on both axes.
    pub(super) fn hands(&self) -> [usize; 2] {
        self.hands
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The softest landing from a height \[m\] and a speed \[m/s\], after a delay \[s\] in which the controls are those of
    /// trim. It begins from a neighbour's variables, too, if given. None if there is no trim within the controls'
    /// limits, or the equations cannot be integrated over the delay.
    pub fn from(
        &self,
        height: f64,
        speed: f64,
        delay: f64,
        near: Option<&[f64]>,
    ) -> Option<Landing> {
        let trim = self.trim(height, speed)?;
        let course = self
            .helicopter
            .frozen(&trim, delay, self.settings.runs_down);
        if !course.is_whole {
            return None;
        }
        let x = course.last();
        let [h, u, w, _, _] = self.helicopter.places();
        // Nothing that is left of the fall is long enough to be changed.
        if course.is_down || x[h] <= SOON * x[w] {
            let s = self.settings.touched(x[u], x[w]);
            return Some(Landing {
                s,
                replayed: s,
                is_certified: s <= 1.0,
                is_sure: true,
                duration: 0.0,
                iterations: 0,
                z: Vec::new(),
                finer: None,
            });
        }
        let program = self.program_on(even(self.settings.intervals), (&trim, x));
        let mut found: Vec<interior::Solution> = Vec::new();
        let (mut certified, mut finer) = (None, None);
        let near = near.filter(|near| near.len() == program.variables());
        let is_enough = |found: &[interior::Solution]| {
            let [converged, same] = agreeing(found);
            converged >= self.settings.starts && same >= 2.min(self.settings.starts)
        };
        for k in 0..self.settings.starts + SPARE {
            if is_enough(&found) {
                break;
            }
            let (z, barrier) = match (near, k) {
                (Some(near), 0) => (self.moved(&program, near, x[h]), WARM),
                (Some(_), k) => (self.start(&program, (&trim, x), k - 1), COLD),
                (None, k) => (self.start(&program, (&trim, x), k), COLD),
            };
            let own = solved(&program, z, barrier);
            let is_soft = own.status == Status::Converged && own.objective <= 1.0;
            let is_again = |other: &interior::Solution| {
                other.status == Status::Converged
                    && (other.objective - own.objective).abs() <= TOLERANCE
            };
            let is_soft = is_soft && !found.iter().any(is_again);
            found.push(own);
            // One flight that lands within the limits is enough.
            if is_soft {
                certified = self.certified(&program, &found[found.len() - 1].z);
                if certified.is_none()
                    && let Some((s, flight)) =
                        self.finer(&program, (&trim, x), &found[found.len() - 1].z)
                {
                    (certified, finer) = (Some(s), Some(flight));
                }
                if certified.is_some() {
                    break;
                }
            }
        }
        let iterations = found.iter().map(|own| own.iterations).sum();
        let converged = || found.iter().filter(|own| own.status == Status::Converged);
        let best = converged().min_by(|a, b| a.objective.total_cmp(&b.objective));
        let best = best.unwrap_or(&found[0]);
        let is_converged = best.status == Status::Converged;
        let replayed = match (certified, is_converged) {
            (Some(s), _) => s,
            (None, true) => optimise::replay(&self.posed, &program, &best.z, 1).objective,
            (None, false) => f64::NAN,
        };
        Some(Landing {
            s: if is_converged {
                best.objective
            } else {
                f64::NAN
            },
            replayed,
            is_certified: certified.is_some(),
            is_sure: is_enough(&found) && converged().all(|own| own.objective > 1.0),
            duration: self
                .posed
                .seconds(&optimise::theta(&self.posed, &program, &best.z)),
            iterations,
            z: if is_converged {
                best.z.clone()
            } else {
                Vec::new()
            },
            finer,
        })
    }

    /// S of the softest landing from the variables of another pilot's; NaN if the solver does not converge from these.
    pub fn softest(&self, height: f64, speed: f64, delay: f64, near: &[f64]) -> f64 {
        let program = self
            .program([height, speed, delay], even(self.settings.intervals))
            .map(|own| own.1);
        let Some(program) = program.filter(|own| own.variables() == near.len()) else {
            return f64::NAN;
        };
        let h = self.places[self.helicopter.places()[0]];
        let start = program.initial[h].unwrap_or_default() * self.posed.states[h].scale;
        let begin = self.moved(&program, near, start);
        let found = solved(&program, begin, WARM);
        match found.status {
            Status::Converged => found.objective,
            _ => f64::NAN,
        }
    }

    /// The same from finer meshes, a little within the limits of the path: a long descent on few intervals is a soft landing of
    /// the program alone, and may be beyond them between nodes.
    fn finer(&self, program: &Program, start: (&Trim, &[f64]), z: &[f64]) -> Option<Certified> {
        let (mut program, mut z) = (program.clone(), z.to_vec());
        for factor in [2, 4] {
            let mut next = self.program_on(even(factor * self.settings.intervals), start);
            for (low, high) in &mut next.limits[0] {
                // The height has no upper one, and ends on its lower one.
                if low.is_finite() && high.is_finite() {
                    let by = WITHIN * (*high - *low);
                    (*low, *high) = (*low + by, *high - by);
                }
            }
            let begin = optimise::carried(&self.posed, &program, &z, &next);
            let own = solved(&next, begin, WARM);
            if own.status != Status::Converged {
                return None;
            }
            if let Some(s) = self.certified(&next, &own.z) {
                return Some((s, (next.mesh, own.z)));
            }
            (program, z) = (next, own.z);
        }
        None
    }

    /// The figure of the replay, if that flight lands within the limits.
    fn certified(&self, program: &Program, z: &[f64]) -> Option<f64> {
        let replay = optimise::replay(&self.posed, program, z, 1);
        let lands = replay.is_whole && replay.violation <= VIOLATION;
        (lands && replay.objective <= 1.0 + VIOLATION).then_some(replay.objective)
    }

    /// Steady level flight with controls within their limits.
    pub fn trim(&self, height: f64, speed: f64) -> Option<Trim> {
        let [low, high, _] = self.settings.cz;
        let found = self.helicopter.trim(height, speed)?;
        let is_within =
            (low..=high).contains(&found.cz) && found.alpha.abs() <= self.settings.alpha[0];
        is_within.then_some(found)
    }

    /// The program of a point, with the problem that it is of. None if there is no trim.
    pub(super) fn program(
        &self,
        [height, speed, delay]: [f64; 3],
        mesh: Vec<f64>,
    ) -> Option<(&Posed, Program)> {
        let trim = self.helicopter.trim(height, speed)?;
        let course = self
            .helicopter
            .frozen(&trim, delay, self.settings.runs_down);
        let program = self.program_on(mesh, (&trim, course.last()));
        Some((&self.posed, program))
    }

    fn program_on(&self, mesh: Vec<f64>, (trim, x): (&Trim, &[f64])) -> Program {
        let mut program = self.posed.program(mesh);
        let mut set = |place: usize, value: f64| {
            program.initial[place] = Some(value / self.posed.states[place].scale);
        };
        for (place, value) in self.places.iter().zip(x) {
            set(*place, *value);
        }
        let commands = [trim.cz, trim.alpha];
        if let Some(pilot) = &self.pilot {
            for ((axis, first), command) in pilot.axes.iter().zip(self.hands).zip(commands) {
                let rest = axis.rest(command).unwrap_or_default();
                rest.iter()
                    .enumerate()
                    .for_each(|(k, value)| set(first + k, *value));
            }
        }
        for ((control, own), command) in program
            .controls
            .iter_mut()
            .zip(&self.posed.controls)
            .zip(commands)
        {
            // With a pilot, it is the pilot that limits how fast the rotor is moved.
            control.first = self.pilot.is_none().then_some(command / own.scale);
        }
        program
    }
}

/// Solves from variables, with this first barrier.
fn solved(program: &Program, z: Vec<f64>, barrier: f64) -> interior::Solution {
    let options = Options {
        tolerance: TOLERANCE,
        most_iterations: MOST_ITERATIONS,
        barrier,
    };
    interior::solve(program, z, &options, &mut |_| true)
}

/// Number of starts that converged, and of those that did to the best of them.
fn agreeing(found: &[interior::Solution]) -> [usize; 2] {
    let converged = || found.iter().filter(|own| own.status == Status::Converged);
    let best = converged()
        .map(|own| own.objective)
        .fold(f64::INFINITY, f64::min);
    let same = converged().filter(|own| own.objective - best <= SAME * best.abs().max(1.0));
    [converged().count(), same.count()]
}
