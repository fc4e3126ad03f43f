//! FMU states (FMI 2.0.5, section 2.1.8): all that an instance is, in memory and as bytes.
//!
//! Bytes, little-endian: `"PILOTAGE"`, version (u32), number of bytes in all (u64), GUID (38 bytes),
//! state (u16), the clock (time, has stop, stop, anchor, step, count), the tolerance, then the values,
//! slopes, travelled slopes and states, whose numbers the model knows.

use crate::clock::Clock;
use crate::problem::Problem;
use pilotage_abi::fmi2::State;
use pilotage_models::Model;
use pilotage_models::simulation::Snapshot;

const MAGIC: &[u8; 8] = b"PILOTAGE";
const VERSION: u32 = 1;
/// Bytes of a GUID with its braces.
const GUID: usize = 38;

/// A copy of an instance: what `fmi2FMUstate` points to.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// GUID of the FMU that it belongs to.
    pub guid: String,
    /// The state of the instance.
    pub state: State,
    /// Where it stands in time; `None` before `fmi2SetupExperiment`.
    pub clock: Option<Clock>,
    /// Values and states.
    pub snapshot: Snapshot,
}

impl Checkpoint {
    /// The bytes; their number is the same for all checkpoints of a model.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(0_u64.to_le_bytes());
        bytes.extend(self.guid.as_bytes());
        bytes.extend((self.state as u16).to_le_bytes());
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
            s.tolerance,
        ];
        let vectors = [&s.values, &s.slopes, &s.travelled, &s.states];
        for number in numbers.iter().chain(vectors.into_iter().flatten()) {
            bytes.extend(number.to_le_bytes());
        }
        let length = bytes.len() as u64;
        bytes[12..20].copy_from_slice(&length.to_le_bytes());
        bytes
    }

    /// Reads bytes of [`to_bytes`](Self::to_bytes) for an FMU of that model.
    ///
    /// # Errors
    /// When they are not of this version, this FMU, or complete.
    pub fn from_bytes(bytes: &[u8], model: &Model, guid: &str) -> Result<Self, Problem> {
        let mut reader = Reader { rest: bytes };
        reader.expect("the beginning", MAGIC)?;
        reader.expect("the version", &VERSION.to_le_bytes())?;
        let length = u64::from_le_bytes(reader.take()?);
        check("the number of bytes", length, bytes.len() as u64)?;
        let found = String::from_utf8_lossy(&reader.take::<GUID>()?).into_owned();
        check("the GUID", found.as_str(), guid)?;
        let bits = u16::from_le_bytes(reader.take()?);
        let state = State::ALL
            .into_iter()
            .find(|s| *s as u16 == bits && !matches!(s, State::StartEnd | State::Fatal))
            .ok_or_else(|| wrong("the state", bits, "that of an instance"))?;
        let [has_clock, has_stop] = reader.take()?;
        let count = u64::from_le_bytes(reader.take()?);
        let [time, stop, anchor, step, tolerance] = reader.numbers(5)?[..] else {
            return Err(reader.too_short());
        };
        let clock = Clock {
            time,
            stop: (has_stop == 1).then_some(stop),
            anchor,
            step,
            count,
        };
        let n_inputs = model.inputs().len();
        let snapshot = Snapshot {
            values: reader.numbers(model.variables().len())?,
            slopes: reader.numbers(n_inputs)?,
            travelled: reader.numbers(n_inputs)?,
            states: reader.numbers(model.n_states())?,
            tolerance,
        };
        check("the number of bytes left over", reader.rest.len(), 0)?;
        Ok(Self {
            guid: guid.to_owned(),
            state,
            clock: (has_clock == 1).then_some(clock),
            snapshot,
        })
    }
}

/// Takes parts from the front.
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
    use pilotage_models::Simulation;
    use pilotage_models::pilot::PAPER_THETA;

    fn checkpoint() -> (Model, Checkpoint) {
        let model = Model::pilot(&PAPER_THETA, 1.0);
        let mut simulation = Simulation::new(model.clone());
        simulation.set(0, 10.0).expect("the target");
        simulation.set_slope(1, 0.25).expect("the position");
        simulation.step(0.1).expect("a step");
        simulation.set_slope(1, -0.5).expect("the position");
        let (_, clock) = Clock::new(0.0, Some(15.0))
            .advance(0.0, 0.1)
            .expect("a step");
        let checkpoint = Checkpoint {
            guid: model.guid(),
            state: State::StepComplete,
            clock: Some(clock),
            snapshot: simulation.snapshot().clone(),
        };
        (model, checkpoint)
    }

    #[test]
    fn bytes_read_back_as_they_were_written() {
        let (model, checkpoint) = checkpoint();
        let bytes = checkpoint.to_bytes();
        let back = Checkpoint::from_bytes(&bytes, &model, &model.guid());
        assert_eq!(back.expect("they are its own"), checkpoint);
    }

    #[test]
    fn damage_is_found() {
        let (model, checkpoint) = checkpoint();
        let good = checkpoint.to_bytes();
        let read = |bytes: &[u8]| Checkpoint::from_bytes(bytes, &model, &model.guid());
        for n in 0..good.len() {
            assert!(read(&good[..n]).is_err(), "cut after {n} bytes");
        }
        assert!(read(&[&good[..], &[0]].concat()).is_err());
        // Magic, version, length, GUID, state.
        for i in 0..60 {
            let mut bytes = good.clone();
            bytes[i] ^= 0x55;
            assert!(read(&bytes).is_err(), "byte {i} changed");
        }
        let mut nan = good.clone();
        let last = nan.len() - 8;
        nan[last..].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(read(&nan).is_err());
        let other = Model::pilot(&PAPER_THETA, 0.5);
        assert!(Checkpoint::from_bytes(&good, &other, &other.guid()).is_err());
    }
}
