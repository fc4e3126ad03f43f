//! Input of the hand as received, and checks whether a run with it is valid.

use crate::distribution::Distribution;
use crate::joystick::Reading;
use pilotage_text::printable::shortened;
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum time without an input frame in a valid run.
pub const GAP: Duration = Duration::from_millis(50);
/// Maximum part of dropped frames in a valid run.
const DROPPED: f64 = 0.01;
/// A frame interval longer than the median by this factor means dropped frames.
const LONG: f64 = 1.5;

/// Input device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Device {
    /// A gamepad or joystick read by the page.
    Gamepad,
    /// A joystick read by the server.
    Joystick,
    /// A mouse as a stick: its position is the deflection.
    Mouse,
    /// A finger on a touch screen.
    Touch,
    /// Arrow keys with a rate limit.
    Keyboard,
    /// No device: it was lost.
    None,
}

impl std::fmt::Display for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Gamepad => "gamepad",
            Self::Joystick => "joystick",
            Self::Mouse => "mouse",
            Self::Touch => "touch",
            Self::Keyboard => "keyboard",
            Self::None => "none",
        })
    }
}

/// An input frame sent by the page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Input {
    /// Frame number, from 1.
    pub n: u64,
    /// Time of sampling by the page's clock \[ms\].
    pub t: f64,
    /// Deflection of each axis, -1 to 1.
    pub stick: Vec<f64>,
    /// The device.
    pub device: Device,
    /// The device's name.
    #[serde(default)]
    pub name: String,
    /// Time since the previous frame \[ms\].
    #[serde(default)]
    pub frame: f64,
    /// Whether the page is visible and focused.
    pub seen: bool,
    /// Simulation time last drawn \[s\], if any.
    #[serde(default)]
    pub drawn: Option<f64>,
    /// Time of that drawing by the page's clock \[ms\].
    #[serde(default)]
    pub drawn_at: Option<f64>,
}

/// An input frame of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Arrival time from the beginning of the run \[s\].
    pub time: f64,
    /// The frame.
    pub input: Input,
}

/// Latency of a drawn state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// Simulation time of the state \[s\].
    pub time: f64,
    /// Time from the last input included in this state to its drawing, both by the page's clock \[ms\].
    pub latency: f64,
}

/// The last input frame and the data of the current run.
#[derive(Debug)]
struct Latest {
    input: Input,
    arrived: Instant,
    begun: Option<Instant>,
    frames: Vec<Frame>,
    shown: Vec<Shown>,
    round_trips: Vec<f64>,
    is_lost: bool,
    /// Whether the input during the run has made it invalid.
    is_spoilt: bool,
    joystick: Option<Joystick>,
}

/// A joystick read by the server.
#[derive(Debug)]
struct Joystick {
    name: String,
    reading: Reading,
    /// Its axes and the time of the last motion, while it is connected.
    there: Option<(Vec<f64>, Instant)>,
    stick: Vec<f64>,
}

impl Joystick {
    fn read(&mut self) {
        let let_go = vec![0.0; self.stick.len()];
        self.stick = self
            .there
            .as_ref()
            .map_or(let_go, |(raw, _)| self.reading.of(raw));
    }
}

/// The hand's input: written by the socket or a joystick, read by the simulation.
#[derive(Debug)]
pub struct Hand {
    latest: Mutex<Latest>,
    axes: usize,
}

/// Data received during a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Heard {
    /// The input frames.
    pub frames: Vec<Frame>,
    /// The drawn states.
    pub shown: Vec<Shown>,
    /// Round trips of the socket \[ms\].
    pub round_trips: Vec<f64>,
    /// Whether the socket was disconnected.
    pub is_lost: bool,
}

impl Hand {
    /// A hand with that many axes, released.
    pub fn new(axes: usize) -> Self {
        let input = Input {
            n: 0,
            t: 0.0,
            stick: vec![0.0; axes],
            device: Device::None,
            name: String::new(),
            frame: 0.0,
            seen: false,
            drawn: None,
            drawn_at: None,
        };
        let latest = Latest {
            input,
            arrived: Instant::now(),
            begun: None,
            frames: Vec::new(),
            shown: Vec::new(),
            round_trips: Vec::new(),
            is_lost: false,
            is_spoilt: false,
            joystick: None,
        };
        Self {
            latest: Mutex::new(latest),
            axes,
        }
    }

    fn latest(&self) -> MutexGuard<'_, Latest> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the run is already invalid: the device, the focus or the page was lost, or no frame arrived for too
    /// long.
    pub fn is_spoilt(&self) -> bool {
        let latest = self.latest();
        let since = latest.begun.map(|begun| begun.max(latest.arrived));
        latest.is_spoilt || latest.is_lost || since.is_some_and(|since| since.elapsed() > GAP)
    }

    /// Whether the chosen device is missing.
    pub fn is_without_device(&self) -> bool {
        let latest = self.latest();
        latest.input.n > 0 && latest.input.device == Device::None
    }

    /// The current device, given the one reported by the page: a joystick read by the server takes precedence.
    pub fn holds(&self, page: Device) -> Device {
        match self.latest().joystick {
            Some(_) => Device::Joystick,
            None => page,
        }
    }

    /// Accepts a frame; `false` if it is invalid: non-finite deflections, or the wrong number of axes.
    pub fn take(&self, mut input: Input) -> bool {
        let is_one = |value: &f64| value.is_finite();
        if input.stick.len() != self.axes || !input.stick.iter().all(is_one) || !input.t.is_finite()
        {
            return false;
        }
        input
            .stick
            .iter_mut()
            .for_each(|value| *value = value.clamp(-1.0, 1.0));
        input.name = shortened(&input.name, 80).into_owned();
        let mut latest = self.latest();
        latest.arrived = Instant::now();
        if let Some(joystick) = &latest.joystick {
            input.stick.clone_from(&joystick.stick);
            input.name.clone_from(&joystick.name);
            input.device = match joystick.there {
                Some(_) => Device::Joystick,
                None => Device::None,
            };
        }
        if let Some(begun) = latest.begun {
            let time = latest.arrived.duration_since(begun).as_secs_f64();
            let before = latest.frames.last().map_or(0.0, |frame| frame.time);
            latest.is_spoilt |=
                !input.seen || input.device == Device::None || time - before > GAP.as_secs_f64();
            latest.frames.push(Frame {
                time,
                input: input.clone(),
            });
        }
        latest.input = input;
        true
    }

    /// Uses the named joystick instead of the page's device from now on.
    pub fn hold(&self, name: &str, reading: Reading) {
        self.latest().joystick = Some(Joystick {
            name: name.to_owned(),
            reading,
            there: None,
            stick: vec![0.0; self.axes],
        });
    }

    /// Sets the raw values of the joystick's axes, each from -1 to 1, and the time of the motion.
    pub fn moved(&self, raw: &[f64], at: Instant) {
        if let Some(joystick) = &mut self.latest().joystick {
            joystick.there = Some((raw.to_vec(), at));
            joystick.read();
        }
    }

    /// Releases the stick because the joystick is disconnected.
    pub fn lose_joystick(&self) {
        if let Some(joystick) = &mut self.latest().joystick {
            joystick.there = None;
            joystick.read();
        }
    }

    /// Sets another calibration of the joystick if it is valid, and returns the current one; `None` without a joystick.
    pub fn calibrate(&self, reading: Option<Reading>) -> Option<Reading> {
        let mut latest = self.latest();
        let joystick = latest.joystick.as_mut()?;
        if let Some(reading) = reading.filter(|reading| reading.is_of(self.axes)) {
            joystick.reading = reading;
            joystick.read();
        }
        Some(joystick.reading.clone())
    }

    /// Name and calibration of the joystick read by the server.
    pub fn joystick(&self) -> Option<(String, Reading)> {
        let latest = self.latest();
        let joystick = latest.joystick.as_ref()?;
        Some((joystick.name.clone(), joystick.reading.clone()))
    }

    /// Raw values of its axes; `None` while it is disconnected.
    pub fn raw(&self) -> Option<Vec<f64>> {
        let latest = self.latest();
        let (raw, _) = latest.joystick.as_ref()?.there.as_ref()?;
        Some(raw.clone())
    }

    /// Records that a state with the input of page time `at` \[ms\] was drawn at page time `drawn`.
    pub fn shown(&self, time: f64, at: f64, drawn: f64) {
        let mut latest = self.latest();
        let latency = drawn - at;
        if latest.begun.is_some() && latency.is_finite() && time.is_finite() {
            latest.shown.push(Shown { time, latency });
        }
    }

    /// Records a round trip of the socket.
    pub fn round_trip(&self, time: Duration) {
        let mut latest = self.latest();
        if latest.begun.is_some() {
            latest.round_trips.push(1e3 * time.as_secs_f64());
        }
    }

    /// Releases the stick because the socket is disconnected.
    pub fn lose(&self) {
        let mut latest = self.latest();
        latest.is_lost = true;
        latest.input.stick.fill(0.0);
        latest.input.device = Device::None;
    }

    /// The last input frame and its age.
    pub fn now(&self) -> (Input, Duration) {
        let latest = self.latest();
        (latest.input.clone(), latest.arrived.elapsed())
    }

    /// Copies the deflections; returns number and page time \[ms\] of the last frame, and the arrival time of the
    /// deflections: that of the frame, or of the joystick's last motion.
    pub fn read(&self, stick: &mut [f64]) -> (u64, f64, Instant) {
        let latest = self.latest();
        let (held, arrived) = match &latest.joystick {
            Some(own) => (
                &own.stick,
                own.there.as_ref().map_or(latest.arrived, |own| own.1),
            ),
            None => (&latest.input.stick, latest.arrived),
        };
        stick.copy_from_slice(held);
        (latest.input.n, latest.input.t, arrived)
    }

    /// Begins a run.
    pub fn begin(&self, begun: Instant) {
        let mut latest = self.latest();
        latest.begun = Some(begun);
        latest.is_lost = false;
        latest.is_spoilt = false;
        latest.frames.clear();
        latest.shown.clear();
        latest.round_trips.clear();
    }

    /// Ends the run and returns its data.
    pub fn end(&self) -> Heard {
        let mut latest = self.latest();
        latest.begun = None;
        Heard {
            frames: std::mem::take(&mut latest.frames),
            shown: std::mem::take(&mut latest.shown),
            round_trips: std::mem::take(&mut latest.round_trips),
            is_lost: latest.is_lost,
        }
    }
}

impl Heard {
    /// Distribution of the time between the page's frames \[ms\].
    pub fn display(&self) -> Distribution {
        Distribution::of(self.intervals())
    }

    fn intervals(&self) -> Vec<f64> {
        let pairs = self.frames.windows(2);
        pairs
            .map(|pair| pair[1].input.t - pair[0].input.t)
            .collect()
    }

    /// The part of dropped frames, estimated from intervals longer than the median.
    pub fn dropped(&self) -> f64 {
        let intervals = self.intervals();
        let usual = self.display().median;
        let lost = |interval: &f64| match *interval > LONG * usual {
            true => (interval / usual).round() - 1.0,
            false => 0.0,
        };
        let lost: f64 = intervals.iter().map(lost).sum();
        match intervals.is_empty() {
            true => 0.0,
            false => lost / (lost + intervals.len() as f64),
        }
    }

    /// The longest time without a frame in a run of that length \[s\].
    pub fn gap(&self, seconds: f64) -> f64 {
        let times = self.frames.iter().map(|frame| frame.time);
        let times: Vec<f64> = std::iter::once(0.0).chain(times).chain([seconds]).collect();
        times
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .fold(0.0, f64::max)
    }

    /// The last device used, ignoring its loss.
    pub fn device(&self) -> Option<(Device, &str)> {
        let held = |frame: &&Frame| frame.input.device != Device::None;
        let last = self.frames.iter().rfind(held).or(self.frames.last())?;
        Some((last.input.device, &last.input.name))
    }

    /// Events during the run, each with its time: focus or stick lost or regained, or no frame for too long.
    pub fn events(&self) -> Vec<String> {
        let mut all = Vec::new();
        for pair in self.frames.windows(2) {
            let [before, now] = [&pair[0], &pair[1]];
            let gap = now.time - before.time;
            let words = match (&before.input, &now.input) {
                (old, new) if !is_same(old, new) => format!("{} ({})", new.device, new.name),
                (old, new) if old.seen != new.seen => {
                    (if new.seen { "focus" } else { "no focus" }).to_owned()
                }
                _ if gap > GAP.as_secs_f64() => format!("{:.0} ms without a frame", 1e3 * gap),
                _ => continue,
            };
            all.push(format!("{:.3} s: {words}", now.time));
        }
        all
    }

    /// Why a run of that length \[s\] is invalid, if it is.
    pub fn fault(&self, seconds: f64) -> Option<String> {
        let first = match self.frames.first() {
            Some(first) => &first.input,
            None => return Some("nothing came from the page".to_owned()),
        };
        if self.is_lost {
            return Some("the page was closed, or its connection broke".to_owned());
        }
        let at = |found: Option<&Frame>, what: &str| {
            found.map(|frame| format!("{what} at {:.1} s", frame.time))
        };
        let lost = self
            .frames
            .iter()
            .find(|frame| frame.input.device == Device::None);
        let other = self
            .frames
            .iter()
            .find(|frame| !is_same(&frame.input, first));
        let unseen = self.frames.iter().find(|frame| !frame.input.seen);
        let (gap, dropped) = (self.gap(seconds), self.dropped());
        at(lost, "the stick was lost")
            .or_else(|| at(other, "the stick was another one"))
            .or_else(|| at(unseen, "the page had not the focus"))
            .or_else(|| {
                let is_long = gap > GAP.as_secs_f64();
                is_long.then(|| format!("nothing came from the page for {:.0} ms", 1e3 * gap))
            })
            .or_else(|| {
                let is_much = dropped > DROPPED;
                is_much
                    .then(|| format!("the display dropped {:.1} % of its frames", 100.0 * dropped))
            })
    }
}

/// Whether two frames come from the same device.
fn is_same(a: &Input, b: &Input) -> bool {
    (a.device, &a.name) == (b.device, &b.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(count: usize, change: impl Fn(usize, &mut Frame)) -> Heard {
        let frame = |k: usize| {
            let input = Input {
                n: k as u64 + 1,
                t: 1000.0 + 16.0 * k as f64,
                stick: vec![0.5],
                device: Device::Mouse,
                name: "mouse".to_owned(),
                frame: 16.0,
                seen: true,
                drawn: None,
                drawn_at: None,
            };
            let mut frame = Frame {
                time: 0.016 * k as f64,
                input,
            };
            change(k, &mut frame);
            frame
        };
        Heard {
            frames: (0..count).map(frame).collect(),
            ..Heard::default()
        }
    }

    #[test]
    fn a_run_counts_unless_something_was_lost() {
        let fault = |change: &dyn Fn(usize, &mut Frame)| heard(1000, change).fault(16.0);
        assert_eq!(fault(&|_, _| ()), None);
        let unseen = fault(&|k, frame| frame.input.seen = k != 500);
        assert_eq!(unseen.unwrap(), "the page had not the focus at 8.0 s");
        let lost = fault(&|k, frame| {
            if k > 900 {
                frame.input.device = Device::None
            }
        });
        assert_eq!(lost.unwrap(), "the stick was lost at 14.4 s");
        let other = fault(&|k, frame| {
            if k > 900 {
                frame.input.device = Device::Keyboard
            }
        });
        assert_eq!(other.unwrap(), "the stick was another one at 14.4 s");
        let gap = fault(&|k, frame| frame.time += if k > 300 { 0.06 } else { 0.0 });
        assert_eq!(gap.unwrap(), "nothing came from the page for 76 ms");
        let dropped = fault(&|k, frame| frame.input.t += 16.0 * (k / 50) as f64);
        assert_eq!(dropped.unwrap(), "the display dropped 1.9 % of its frames");
        assert_eq!(
            Heard::default().fault(1.0).unwrap(),
            "nothing came from the page"
        );
        // The run ended too early.
        assert!(heard(1000, |_, _| ()).fault(17.0).is_some());
    }

    #[test]
    fn what_is_no_deflection_is_not_taken() {
        let hand = Hand::new(1);
        let input = |stick: Vec<f64>| Input {
            stick,
            ..heard(1, |_, _| ()).frames[0].input.clone()
        };
        assert!(!hand.take(input(vec![])));
        assert!(!hand.take(input(vec![0.0, 0.0])));
        assert!(!hand.take(input(vec![f64::NAN])));
        assert!(hand.take(input(vec![7.0])));
        let mut stick = [0.0];
        assert_eq!(hand.read(&mut stick).0, 1);
        assert_eq!(stick, [1.0]);
        hand.lose();
        hand.read(&mut stick);
        assert_eq!(stick, [0.0]);
    }
}
