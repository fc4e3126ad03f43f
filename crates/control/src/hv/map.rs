//! The map: classes of points, and the boundary between them.

use super::band;
use super::point::{Landing, Landings};
use rayon::prelude::*;

/// Heights \[m\] and speeds \[m/s\], both ascending.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// The heights.
    pub heights: Vec<f64>,
    /// The speeds.
    pub speeds: Vec<f64>,
}

/// What is known of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// A flight within the limits exists, and was integrated again.
    Safe,
    /// All starts converged, to the same landing beyond the limits.
    Unsafe,
    /// Neither: a local solver's failure proves nothing.
    Unknown,
}

impl Class {
    /// Its name in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Safe => "safe",
            Self::Unsafe => "unsafe",
            Self::Unknown => "unknown",
        }
    }

    fn of(landing: Option<&Landing>) -> Self {
        landing.map_or(Self::Unknown, Landing::class)
    }
}

impl Landing {
    /// What it says of its point.
    pub fn class(&self) -> Class {
        match (self.is_certified, self.is_sure && self.s > 1.0) {
            (true, _) => Class::Safe,
            (false, true) => Class::Unsafe,
            (false, false) => Class::Unknown,
        }
    }
}

/// A point of the map.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Height \[m\].
    pub height: f64,
    /// What is known of it.
    pub class: Class,
    /// S of the optimiser, and of its replay; NaN where there is none.
    pub s: f64,
    /// That of the replay.
    pub replayed: f64,
    /// Duration of the landing from the end of the delay \[s\].
    pub duration: f64,
    /// Share of the drawn pilots that land within the limits; NaN without draws.
    pub chance: f64,
}

/// A height at which the class changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Height \[m\].
    pub height: f64,
    /// Whether it is unsafe above.
    pub opens: bool,
    /// Heights \[m\] between which 95 % of the drawn pilots have it; NaN without draws.
    pub range: [f64; 2],
}

/// All heights at a speed.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Speed \[m/s\].
    pub speed: f64,
    /// Its points, by height.
    pub cells: Vec<Cell>,
    /// Its boundary, by height.
    pub crossings: Vec<Crossing>,
}

/// A map.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    /// Its columns, by speed.
    pub columns: Vec<Column>,
    /// Speed \[m/s\] and height \[m\] of the knee: the fastest unsafe point of the region that begins at hover.
    pub knee: Option<[f64; 2]>,
}

/// Where the bisection of a boundary ends: relative and \[m\]; that of the knee \[m/s\].
const FINE: f64 = 0.005;
const FINE_HEIGHT: f64 = 0.05;
const FINE_SPEED: f64 = 0.05;

/// All points and the boundary at a speed. Each begins from the landing of the point before.
pub fn column(
    landings: &Landings,
    heights: &[f64],
    speed: f64,
    delay: f64,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Column> {
    let mut cells: Vec<Cell> = Vec::new();
    let mut near: Vec<Vec<f64>> = Vec::new();
    for height in heights {
        if stop() {
            return None;
        }
        let before = near.iter().rev().find(|z| !z.is_empty());
        let landing = landings.from(*height, speed, delay, before.map(Vec::as_slice));
        cells.push(Cell {
            height: *height,
            class: Class::of(landing.as_ref()),
            s: landing.as_ref().map_or(f64::NAN, |own| own.s),
            replayed: landing.as_ref().map_or(f64::NAN, |own| own.replayed),
            duration: landing.as_ref().map_or(f64::NAN, |own| own.duration),
            chance: f64::NAN,
        });
        near.push(landing.map_or(Vec::new(), |own| own.z));
    }
    let mut crossings = Vec::new();
    let known: Vec<usize> = (0..cells.len())
        .filter(|k| cells[*k].class != Class::Unknown)
        .collect();
    for pair in known.windows(2) {
        let (a, b) = (&cells[pair[0]], &cells[pair[1]]);
        if a.class == b.class {
            continue;
        }
        let opens = b.class == Class::Unsafe;
        let mut ends = [(a.height, a.s), (b.height, b.s)];
        let mut moved = 0;
        while ends[1].0 - ends[0].0 > FINE_HEIGHT.max(FINE * ends[1].0) {
            if stop() {
                return None;
            }
            let height = between(ends, moved);
            let landing = landings.from(height, speed, delay, Some(&near[pair[0]]));
            let is_unsafe = Class::of(landing.as_ref()) != Class::Safe;
            moved = usize::from(is_unsafe == opens);
            ends[moved] = (height, landing.map_or(f64::NAN, |own| own.s));
        }
        let [(low, _), (high, _)] = ends;
        crossings.push(Crossing {
            height: 0.5 * (low + high),
            opens,
            range: [f64::NAN; 2],
        });
    }
    let mut column = Column {
        speed,
        cells,
        crossings,
    };
    band::add(landings, &mut column, &near, delay, stop)?;
    Some(column)
}

/// Where to look for S = 1 next between two heights with their S: where a line through both has it, and a little further from the
/// end that moved last, so that both close in; the middle where S says nothing.
fn between([(low, s_low), (high, s_high)]: [(f64, f64); 2], moved: usize) -> f64 {
    const EDGE: f64 = 0.1;
    let part = (1.0 - s_low) / (s_high - s_low);
    if !(0.0..=1.0).contains(&part) {
        return 0.5 * (low + high);
    }
    let further = 0.4 * FINE_HEIGHT.max(FINE * high) / (high - low);
    let part = part + if moved == 0 { further } else { -further };
    low + part.clamp(EDGE, 1.0 - EDGE) * (high - low)
}

/// The map, on all threads; the same for any number of them. `known` are columns of an earlier run, `done` sees each new
/// one. None if it was stopped.
pub fn map(
    landings: &Landings,
    grid: &Grid,
    delay: f64,
    known: &[Column],
    done: &(dyn Fn(&Column) + Sync),
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Map> {
    let one = |speed: &f64| {
        if let Some(own) = known.iter().find(|own| own.speed == *speed) {
            return Some(own.clone());
        }
        let own = column(landings, &grid.heights, *speed, delay, stop)?;
        done(&own);
        Some(own)
    };
    let columns: Option<Vec<Column>> = grid.speeds.par_iter().map(one).collect();
    let columns = columns?;
    let knee = knee(landings, &columns, delay);
    Some(Map { columns, knee })
}

/// Whether a column is unsafe at a height, by its boundary.
fn is_unsafe_at(column: &Column, height: f64) -> bool {
    let below = column
        .crossings
        .iter()
        .rev()
        .find(|own| own.height < height);
    let lowest = column.cells.iter().find(|own| own.class != Class::Unknown);
    match below {
        Some(own) => own.opens,
        None => lowest.is_some_and(|own| own.class == Class::Unsafe),
    }
}

/// The map with one delay below a height \[m\] and with another above it, of maps of one grid.
pub fn joined(below: &Map, above: &Map, height: f64) -> Map {
    let column = |(low, high): (&Column, &Column)| {
        let is_low = |own: f64| own < height;
        let cells = low.cells.iter().filter(|own| is_low(own.height));
        let cells = cells.chain(high.cells.iter().filter(|own| !is_low(own.height)));
        let ends = [low, high].map(|own| is_unsafe_at(own, height));
        let step = (ends[0] != ends[1]).then_some(Crossing {
            height,
            opens: ends[1],
            range: [f64::NAN; 2],
        });
        let crossings = low
            .crossings
            .iter()
            .filter(|own| is_low(own.height))
            .copied()
            .chain(step);
        let crossings = crossings.chain(
            high.crossings
                .iter()
                .filter(|own| !is_low(own.height))
                .copied(),
        );
        Column {
            speed: low.speed,
            cells: cells.cloned().collect(),
            crossings: crossings.collect(),
        }
    };
    Map {
        columns: below
            .columns
            .iter()
            .zip(&above.columns)
            .map(column)
            .collect(),
        knee: above.knee,
    }
}

/// Unsafe heights at a speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Where they begin; none if the lowest height is one of them.
    pub low: Option<Crossing>,
    /// Where they end; none if the highest is one of them.
    pub high: Option<Crossing>,
    /// The lowest and the highest of them \[m\], of those that were looked at.
    pub heights: [f64; 2],
}

impl Range {
    /// The ratio of the heights that both have; 1 or less if there are none.
    fn common(&self, other: &Self) -> f64 {
        let [a, b] = [self.heights, other.heights];
        a[1].min(b[1]) / a[0].max(b[0])
    }
}

impl Column {
    /// All unsafe heights, by height.
    pub fn ranges(&self) -> Vec<Range> {
        let known = || self.cells.iter().filter(|own| own.class != Class::Unknown);
        let (Some(lowest), Some(highest)) = (known().next(), known().next_back()) else {
            return Vec::new();
        };
        let mut all = Vec::new();
        let mut open = (lowest.class == Class::Unsafe).then_some((None, lowest.height));
        for own in &self.crossings {
            if own.opens {
                open = Some((Some(*own), own.height));
            } else if let Some((low, from)) = open.take() {
                all.push(Range {
                    low,
                    high: Some(*own),
                    heights: [from, own.height],
                });
            }
        }
        if let Some((low, from)) = open {
            all.push(Range {
                low,
                high: None,
                heights: [from, highest.height],
            });
        }
        all
    }
}

impl Map {
    /// The unsafe region that begins at the lowest speed: of the first columns, the range in common with that of the column
    /// before, beginning with the largest of the first.
    pub fn region(&self) -> Vec<(f64, Range)> {
        region(&self.columns)
    }

    /// Unsafe heights from the lowest on that are not of the region, as over the ground at high speed.
    pub fn strip(&self) -> Vec<(f64, Range)> {
        let region = self.region();
        // Bands that are not known are no numbers, which are not equal to themselves.
        let is_own = |at: &(f64, Range), speed: f64, own: &Range| {
            at.0 == speed && at.1.heights == own.heights
        };
        let is_other = |speed: f64, own: &Range| !region.iter().any(|at| is_own(at, speed, own));
        let of = |own: &Column| {
            let first = own
                .ranges()
                .into_iter()
                .next()
                .filter(|own| own.low.is_none());
            first
                .filter(|range| is_other(own.speed, range))
                .map(|range| (own.speed, range))
        };
        self.columns.iter().filter_map(of).collect()
    }
}

fn region(columns: &[Column]) -> Vec<(f64, Range)> {
    let mut all: Vec<(f64, Range)> = Vec::new();
    for own in columns {
        let size = |range: &Range| match all.last() {
            Some((_, before)) => range.common(before),
            None => range.heights[1] / range.heights[0],
        };
        let ranges = own.ranges();
        let largest = ranges.iter().max_by(|a, b| size(a).total_cmp(&size(b)));
        match largest.filter(|range| all.is_empty() || size(range) > 1.0) {
            Some(range) => all.push((own.speed, *range)),
            None => break,
        }
    }
    all
}

/// The fastest unsafe point of the region that begins at hover, beyond the grid if need be: in turn the height of the largest S at
/// a speed within the region, and the speed at which S is 1 at that height.
fn knee(landings: &Landings, columns: &[Column], delay: f64) -> Option<[f64; 2]> {
    /// Step of the search for a safe speed, where it ends, and how far within the region the height is sought \[m/s\].
    const STEP: f64 = 3.0;
    const FASTEST: f64 = 90.0;
    const WITHIN: f64 = 0.3;
    const TURNS: usize = 3;
    let region = region(columns);
    let (speed, range) = region.last()?;
    let mut height = highest(landings, *speed, delay, range.heights);
    let is_safe = |speed: f64, height: f64| {
        let landing = landings.from(height, speed, delay, None);
        Class::of(landing.as_ref()) == Class::Safe
    };
    let mut low = *speed;
    for turn in 0..TURNS {
        let mut high = low + STEP;
        while !is_safe(high, height) {
            (low, high) = (high, high + STEP);
            if high > FASTEST {
                return None;
            }
        }
        while high - low > FINE_SPEED {
            let middle = 0.5 * (low + high);
            match is_safe(middle, height) {
                true => high = middle,
                false => low = middle,
            }
        }
        if turn + 1 < TURNS {
            let within = (low - WITHIN).max(*speed);
            height = highest(landings, within, delay, [0.6 * height, height / 0.6]);
        }
    }
    Some([low, height])
}

/// The height of the largest S between two at a speed, by golden sections in its logarithm.
fn highest(landings: &Landings, speed: f64, delay: f64, between: [f64; 2]) -> f64 {
    const SECTIONS: usize = 8;
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let s = |at: f64| {
        let landing = landings.from(at.exp(), speed, delay, None);
        landing.map_or(f64::NEG_INFINITY, |own| {
            if own.s.is_finite() {
                own.s
            } else {
                f64::NEG_INFINITY
            }
        })
    };
    let [mut low, mut high] = between.map(f64::ln);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_a, mut at_b) = (s(a), s(b));
    for _ in 0..SECTIONS {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - golden * (high - low);
            at_a = s(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + golden * (high - low);
            at_b = s(b);
        }
    }
    (0.5 * (low + high)).exp()
}
