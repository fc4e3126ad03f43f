//! FMU states (FMI 2.0.5, section 2.1.8; FMI 3.0, section 2.2.7): the complete state of an instance, in memory and as
//! bytes.
//!
//! Format of the bytes, little-endian: `"PILOTAGE"`, version of this format (u32), total number of bytes (u64), GUID
//! (38 bytes), version of FMI (u8), kind (u8), state (u16), whether the simulation has started and is stiff (u8 each), the clock (present, has stop, count, time, stop, anchor,
//! step), then time, tolerance, time of the last event, history of delayed signals (its number of numbers, u64, and these), values, slopes, slopes of the last
//! step, states, modes, and one byte for each event indicator. The model determines the number of each but those of the history.

use crate::Table;
use crate::clock::Clock;
use crate::instance::InterfaceType;
use crate::problem::Problem;
use crate::simulation::{History, Snapshot};

const MAGIC: &[u8; 8] = b"PILOTAGE";
const VERSION: u32 = 5;
/// Number of bytes of a GUID with its braces.
const GUID: usize = 38;

/// A copy of an instance, to which `fmi2FMUstate` and `fmi3FMUState` point.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// GUID of the FMU.
    pub guid: String,
    /// Version of FMI of the instance.
    pub version: u8,
    /// Interface type of the instance.
    pub kind: InterfaceType,
    /// State of the instance, as a number of that version.
    pub state: u16,
    /// Position in time; `None` before the experiment is set up.
    pub clock: Option<Clock>,
    /// Values, states and events.
    pub snapshot: Snapshot,
}

impl Checkpoint {
    /// The bytes; their number is the same for all checkpoints of a model without delayed signals.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(0_u64.to_le_bytes());
        bytes.extend(self.guid.as_bytes());
        bytes.extend([
            self.version,
            u8::from(self.kind == InterfaceType::ModelExchange),
        ]);
        bytes.extend(self.state.to_le_bytes());
        bytes.push(u8::from(self.snapshot.has_started));
        bytes.push(u8::from(self.snapshot.is_stiff));
        let clock = self.clock.unwrap_or_default();
        bytes.push(u8::from(self.clock.is_some()));
        bytes.push(u8::from(clock.stop.is_some()));
        bytes.extend(clock.count.to_le_bytes());
        let s = &self.snapshot;
        let numbers = [
            clock.time,
            clock.stop.unwrap_or(0.0),
            clock.anchor,
            clock.step,
            s.time,
            s.tolerance,
            s.handled,
        ];
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        let history = s.history.to_numbers();
        bytes.extend((history.len() as u64).to_le_bytes());
        for vector in [&history, &s.values, &s.slopes, &s.last_slopes, &s.states] {
            bytes.extend(vector.iter().flat_map(|number| number.to_le_bytes()));
        }
        bytes.extend(s.positive.iter().map(|positive| u8::from(*positive)));
        let length = bytes.len() as u64;
        bytes[12..20].copy_from_slice(&length.to_le_bytes());
        bytes
    }

    /// Reads bytes written by [`to_bytes`](Self::to_bytes) for an FMU with that table.
    ///
    /// # Errors
    /// If they are incomplete, have another format, or belong to another FMU.
    pub fn from_bytes(bytes: &[u8], table: &Table, guid: &str) -> Result<Self, Problem> {
        let mut reader = Reader { rest: bytes };
        reader.expect("the beginning", MAGIC)?;
        reader.expect("the version", &VERSION.to_le_bytes())?;
        let length = u64::from_le_bytes(reader.take()?);
        check("the number of bytes", length, bytes.len() as u64)?;
        let found = String::from_utf8_lossy(&reader.take::<GUID>()?).into_owned();
        check("the GUID", found.as_str(), guid)?;
        let [version, kind] = reader.take()?;
        let kind = match kind {
            0 => InterfaceType::CoSimulation,
            1 => InterfaceType::ModelExchange,
            _ => return Err(wrong("the kind", kind, "0 or 1")),
        };
        let state = u16::from_le_bytes(reader.take()?);
        let [has_started, is_stiff] = reader.take()?;
        let [has_clock, has_stop] = reader.take()?;
        let count = u64::from_le_bytes(reader.take()?);
        let [time, stop, anchor, step, now, tolerance, handled] = reader.numbers(7)?[..] else {
            return Err(reader.too_short());
        };
        let clock = Clock {
            time,
            stop: (has_stop == 1).then_some(stop),
            anchor,
            step,
            count,
        };
        let count = u64::from_le_bytes(reader.take()?);
        let history = reader.numbers(usize::try_from(count).unwrap_or(usize::MAX))?;
        let history = History::of_numbers(&history)
            .ok_or_else(|| wrong("the history", "numbers", "breaks and pieces"))?;
        let n_inputs = table.inputs().len();
        let snapshot = Snapshot {
            time: now,
            values: reader.numbers(table.starts().end)?,
            slopes: reader.numbers(n_inputs)?,
            last_slopes: reader.numbers(n_inputs)?,
            states: reader.numbers(table.n_x())?,
            positive: reader.flags(table.n_indicators())?,
            tolerance,
            has_started: has_started == 1,
            is_stiff: is_stiff == 1,
            handled,
            history,
        };
        check("the number of bytes left over", reader.rest.len(), 0)?;
        Ok(Self {
            guid: guid.to_owned(),
            version,
            kind,
            state,
            clock: (has_clock == 1).then_some(clock),
            snapshot,
        })
    }
}

/// Reads values from the front of the bytes.
struct Reader<'b> {
    rest: &'b [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        let (part, rest) = self
            .rest
            .split_first_chunk()
            .ok_or_else(|| self.too_short())?;
        self.rest = rest;
        Ok(*part)
    }

    fn expect<const N: usize>(
        &mut self,
        what: &'static str,
        expected: &[u8; N],
    ) -> Result<(), Problem> {
        let found = self.take::<N>()?;
        check(what, found.escape_ascii(), expected.escape_ascii())
    }

    fn numbers(&mut self, n: usize) -> Result<Vec<f64>, Problem> {
        (0..n)
            .map(|_| {
                let number = f64::from_le_bytes(self.take()?);
                match number.is_finite() {
                    true => Ok(number),
                    false => Err(wrong("a number", number, "a finite one")),
                }
            })
            .collect()
    }

    fn flags(&mut self, n: usize) -> Result<Vec<bool>, Problem> {
        (0..n)
            .map(|_| match self.take()? {
                [0] => Ok(false),
                [1] => Ok(true),
                [other] => Err(wrong("the sign of an event indicator", other, "0 or 1")),
            })
            .collect()
    }

    fn too_short(&self) -> Problem {
        wrong("the end", "too early", "more bytes")
    }
}

fn wrong(what: &'static str, found: impl ToString, expected: impl ToString) -> Problem {
    Problem::Bytes {
        what,
        found: found.to_string(),
        expected: expected.to_string(),
    }
}

fn check<T: ToString>(what: &'static str, found: T, expected: T) -> Result<(), Problem> {
    let (found, expected) = (found.to_string(), expected.to_string());
    match found == expected {
        true => Ok(()),
        false => Err(wrong(what, found, expected)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{At, Equations, Scalar, Simulation};

    /// A mass on a spring, driven by a force, with a wall.
    struct Spring(f64);

    impl Equations for Spring {
        fn table(&self) -> Table {
            Table::new("spring", "A mass on a spring")
                .input("force", "N", "What pushes it")
                .parameter("mass", "kg", self.0, "Mass")
                .output_state("x", "m", 0.0, "Place")
                .state("v", "m/s", 0.0, "Velocity")
                .indicator("gap", "m", "Distance to the wall")
        }

        fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
            dx[0] = at.x[1];
            dx[1] = (at.u[0] - at.x[0]) / at.p[0];
        }

        fn indicators<T: Scalar>(&self, at: At<T>, z: &mut [T]) {
            z[0] = at.x[0] + 1.0;
        }
    }

    fn checkpoint() -> (Table, Checkpoint) {
        let mut simulation = Simulation::new(Spring(2.0));
        simulation.set(0, 10.0).expect("the force");
        simulation.set_slope(0, 0.25).expect("the force");
        simulation.step(0.1).expect("a step");
        simulation.set_slope(0, -0.5).expect("the force");
        let (_, clock) = Clock::new(0.0, Some(15.0))
            .advance(0.0, 0.1)
            .expect("a step");
        let table = simulation.table().clone();
        let checkpoint = Checkpoint {
            guid: table.guid(),
            version: 2,
            kind: InterfaceType::CoSimulation,
            state: 8,
            clock: Some(clock),
            snapshot: simulation.snapshot().clone(),
        };
        (table, checkpoint)
    }

    /// FMI rule 27: bytes of an FMU state, and which are rejected.
    #[test]
    fn bytes_read_back_as_they_were_written() {
        let (table, checkpoint) = checkpoint();
        let bytes = checkpoint.to_bytes();
        let back = Checkpoint::from_bytes(&bytes, &table, &table.guid());
        assert_eq!(back.expect("they are its own"), checkpoint);
    }

    #[test]
    fn damage_is_found() {
        let (table, checkpoint) = checkpoint();
        let good = checkpoint.to_bytes();
        let read = |bytes: &[u8]| Checkpoint::from_bytes(bytes, &table, &table.guid());
        for n in 0..good.len() {
            assert!(read(&good[..n]).is_err(), "cut after {n} bytes");
        }
        assert!(read(&[&good[..], &[0]].concat()).is_err());
        // Magic, version, length, GUID.
        for i in 0..58 {
            let mut bytes = good.clone();
            bytes[i] ^= 0x55;
            assert!(read(&bytes).is_err(), "byte {i} changed");
        }
        let mut sign = good.clone();
        *sign.last_mut().expect("a byte") = 2;
        assert!(read(&sign).is_err());
        let mut nan = good.clone();
        let last = nan.len() - 9;
        nan[last..last + 8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(read(&nan).is_err());
        let other = Simulation::new(Spring(3.0)).table().clone();
        assert!(Checkpoint::from_bytes(&good, &other, &other.guid()).is_err());
    }
}
