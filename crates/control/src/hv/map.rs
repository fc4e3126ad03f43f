//! The map: classes of points, and the boundary between them.

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
        match landing {
            Some(own) if own.is_certified => Self::Safe,
            Some(own) if own.is_sure && own.s > 1.0 => Self::Unsafe,
            _ => Self::Unknown,
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
}

/// A height at which the class changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Height \[m\].
    pub height: f64,
    /// Whether it is unsafe above.
    pub opens: bool,
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
        let is_unsafe = |height: f64, near: &[f64]| {
            let landing = landings.from(height, speed, delay, Some(near));
            Class::of(landing.as_ref()) != Class::Safe
        };
        let (mut low, mut high) = (a.height, b.height);
        let opens = b.class == Class::Unsafe;
        while high - low > FINE_HEIGHT.max(FINE * high) {
            if stop() {
                return None;
            }
            let middle = 0.5 * (low + high);
            match is_unsafe(middle, &near[pair[0]]) == opens {
                true => high = middle,
                false => low = middle,
            }
        }
        crossings.push(Crossing {
            height: 0.5 * (low + high),
            opens,
        });
    }
    Some(Column {
        speed,
        cells,
        crossings,
    })
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

/// The middle of an unsafe range that begins above safe heights, as from hover.
fn inner(column: &Column) -> Option<f64> {
    let opens = column.crossings.iter().position(|own| own.opens)?;
    let closes = column.crossings.get(opens + 1)?;
    Some((column.crossings[opens].height * closes.height).sqrt())
}

/// The fastest unsafe point of the region that begins at hover, by bisection from its last column.
fn knee(landings: &Landings, columns: &[Column], delay: f64) -> Option<[f64; 2]> {
    let count = columns
        .iter()
        .take_while(|own| inner(own).is_some())
        .count();
    let last = columns.get(count.checked_sub(1)?)?;
    let height = inner(last)?;
    let Some(next) = columns.get(count) else {
        return Some([last.speed, height]);
    };
    let (mut low, mut high) = (last.speed, next.speed);
    while high - low > FINE_SPEED {
        let middle = 0.5 * (low + high);
        let landing = landings.from(height, middle, delay, None);
        match Class::of(landing.as_ref()) {
            Class::Safe => high = middle,
            Class::Unsafe | Class::Unknown => low = middle,
        }
    }
    Some([0.5 * (low + high), height])
}
