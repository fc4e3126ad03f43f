//! FMU states of a container (FMI 2.0.5, section 2.1.8; FMI 3.0, section 2.2.7): in memory the parts keep their own, each in
//! a slot; as bytes everything is in them.

use crate::grid::Grid;
use crate::unit::{Container, inside, of_master};
use pilotage_cosim::master::Kept;
use pilotage_sdk::SimulationUnit;
use pilotage_sdk::clock::Clock;
use pilotage_sdk::problem::Problem;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// First slot; the master uses those before.
const FIRST: usize = 3;

/// First bytes of a state.
const MAGIC: &str = "pilotage container 1";

/// The slots of the parts of one instance.
#[derive(Default)]
pub struct Slots(Arc<Mutex<Free>>);

#[derive(Default)]
struct Free {
    /// Number of slots that were ever in use.
    used: usize,
    free: Vec<usize>,
    /// Counts how often the parts were opened: their slots are lost then.
    generation: u64,
}

impl Slots {
    fn lock(&self) -> MutexGuard<'_, Free> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self) -> Slot {
        let mut own = self.lock();
        let place = own.free.pop().unwrap_or_else(|| {
            own.used += 1;
            FIRST + own.used - 1
        });
        Slot {
            place,
            generation: own.generation,
            of: Slots(Arc::clone(&self.0)),
        }
    }

    /// The parts are others now.
    pub fn forget(&self) {
        let mut own = self.lock();
        own.generation += 1;
        (own.used, own.free) = (0, Vec::new());
    }
}

/// A slot in use.
struct Slot {
    place: usize,
    generation: u64,
    of: Slots,
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut own = self.of.lock();
        if own.generation == self.generation {
            own.free.push(self.place);
        }
    }
}

/// A state.
pub struct Saved {
    version: u8,
    state: u16,
    clock: Option<Clock>,
    grid: Grid,
    kept: Kept,
    /// None of a state that was read from bytes.
    slot: Option<Slot>,
    bytes: OnceCell<Vec<u8>>,
}

/// What the bytes hold.
#[derive(Serialize, Deserialize)]
struct Written {
    magic: String,
    guid: String,
    version: u8,
    state: u16,
    clock: Option<(f64, Option<f64>, f64, f64, u64)>,
    grid: Grid,
    kept: Kept,
}

impl Saved {
    /// The state of an instance.
    pub fn of(own: &mut Container, version: u8, state: u16) -> Result<Self, Problem> {
        let slot = own.slots.take();
        let kept = own
            .session
            .save(slot.place)
            .map_err(|why| of_master(&why))?;
        Ok(Self {
            version,
            state,
            clock: own.clock,
            grid: own.grid,
            kept,
            slot: Some(slot),
            bytes: OnceCell::new(),
        })
    }

    /// Version of FMI and state of the calling order.
    pub fn origin(&self) -> (u8, u16) {
        (self.version, self.state)
    }

    /// Restores it.
    pub fn restore(&self, own: &mut Container) -> Result<(), Problem> {
        let generation = own.slots.lock().generation;
        let place = match &self.slot {
            Some(slot) if slot.generation != generation => {
                let why = "the FMU state is older than a reset, in which parts were opened again";
                return Err(inside(why.to_owned()));
            }
            slot => slot.as_ref().map(|slot| slot.place),
        };
        let restored = own.session.restore(&self.kept, place);
        restored.map_err(|why| of_master(&why))?;
        (own.clock, own.grid) = (self.clock, self.grid);
        Ok(())
    }

    /// The bytes. The parts write their current state alone, so that it is restored for a moment.
    pub fn to_bytes(&self, own: &mut Container) -> Result<Vec<u8>, Problem> {
        if let Some(bytes) = self.bytes.get() {
            return Ok(bytes.clone());
        }
        let before = Self::of(own, self.version, self.state)?;
        self.restore(own)?;
        let kept = own.session.serialize().map_err(|why| of_master(&why));
        before.restore(own)?;
        let kept = kept?.ok_or_else(|| {
            inside("a state before the end of initialization has no bytes; take one after".into())
        })?;
        let clock = self.clock;
        let written = Written {
            magic: MAGIC.to_owned(),
            guid: own.guid().to_owned(),
            version: self.version,
            state: self.state,
            clock: clock.map(|own| (own.time, own.stop, own.anchor, own.step, own.count)),
            grid: self.grid,
            kept,
        };
        let bytes = postcard::to_stdvec(&written).map_err(|why| inside(why.to_string()))?;
        Ok(self.bytes.get_or_init(|| bytes).clone())
    }

    /// A state from its bytes.
    pub fn from_bytes(bytes: &[u8], guid: &str) -> Result<Self, Problem> {
        let wrong = |what, found: String, expected: &str| Problem::Bytes {
            what,
            found,
            expected: expected.to_owned(),
        };
        let (written, rest): (Written, _) = postcard::take_from_bytes(bytes)
            .map_err(|why| wrong("what they say", why.to_string(), "a state"))?;
        if written.magic != MAGIC {
            return Err(wrong("the beginning", written.magic, MAGIC));
        }
        if written.guid != guid {
            return Err(wrong("the GUID", written.guid, guid));
        }
        if !rest.is_empty() {
            let found = format!("{} bytes too many", rest.len());
            return Err(wrong("the end", found, "none"));
        }
        let clock = written.clock;
        Ok(Self {
            version: written.version,
            state: written.state,
            clock: clock.map(|(time, stop, anchor, step, count)| Clock {
                time,
                stop,
                anchor,
                step,
                count,
            }),
            grid: written.grid,
            kept: written.kept,
            slot: None,
            bytes: OnceCell::from(bytes.to_vec()),
        })
    }
}
