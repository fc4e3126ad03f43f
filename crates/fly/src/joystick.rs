//! A joystick read by the server: an event device of Linux (kernel documentation, `input/event-codes`), or else its
//! joystick interface, whose events have eight bytes: time \[ms\], value from -32767 to 32767, type and number of the
//! axis (`input/joydev/joystick-api`). The event device is preferred, since the joystick interface has a dead zone in
//! the middle unless configured otherwise.

use crate::hand::Hand;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Event type of an axis; with the bit 0x80 the event reports its initial position.
const AXIS: u8 = 2;
const BEGIN: u8 = 0x80;
/// Full deflection of the joystick interface.
const FULL: f64 = 32_767.0;
/// Interval between attempts to reopen a disconnected device.
const AGAIN: Duration = Duration::from_millis(500);
/// Maximum age of an event; older time stamps are from another clock.
const OLDEST: Duration = Duration::from_millis(100);

/// Calibration: conversion of a device's axes, each from -1 to 1, to deflections.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// For each hand axis, the number of the device's axis, from 0.
    pub axis: Vec<usize>,
    /// Whether the axis is inverted.
    pub invert: Vec<bool>,
    /// Its rest position.
    pub centre: Vec<f64>,
    /// Distances from the rest position to its lower and upper end.
    pub range: Vec<[f64; 2]>,
    /// Dead zone as a part of the full deflection.
    pub dead: f64,
}

impl Reading {
    /// Without calibration: the device's axes as reported.
    pub fn new(axis: Vec<usize>, invert: Vec<bool>) -> Self {
        let (centre, range) = (vec![0.0; axis.len()], vec![[1.0; 2]; axis.len()]);
        Self {
            axis,
            invert,
            centre,
            range,
            dead: 0.0,
        }
    }

    /// Whether it is valid for that many axes.
    pub fn is_of(&self, axes: usize) -> bool {
        let lengths = [
            self.axis.len(),
            self.invert.len(),
            self.centre.len(),
            self.range.len(),
        ];
        let is_way = |way: &f64| way.is_finite() && *way > 0.0;
        lengths == [axes; 4]
            && self.centre.iter().all(|centre| centre.is_finite())
            && self.range.iter().flatten().all(is_way)
            && (0.0..=0.5).contains(&self.dead)
    }

    /// Deflections of the hand, -1 to 1. An axis not yet reported by the device is at rest.
    pub fn of(&self, raw: &[f64]) -> Vec<f64> {
        let all = self.axis.iter().enumerate();
        all.map(|(k, axis)| {
            let off = raw.get(*axis).map_or(0.0, |value| value - self.centre[k]);
            let value = off / self.range[k][usize::from(off >= 0.0)];
            let beyond = (value.abs() - self.dead).max(0.0) / (1.0 - self.dead);
            let sign = if self.invert[k] { -1.0 } else { 1.0 };
            (sign * beyond.copysign(value)).clamp(-1.0, 1.0)
        })
        .collect()
    }
}

/// Starts a thread that reads a device, and reopens it after it was disconnected. Returns the name of the device, and a
/// note on it if there is one.
///
/// # Errors
/// If the device cannot be opened, is not a joystick, or lacks an axis.
pub fn listen(
    path: &Path,
    reading: Reading,
    hand: Arc<Hand>,
) -> io::Result<(String, Option<String>)> {
    let device = Device::open(path)?;
    let known = device.axes();
    let most = reading.axis.iter().copied().max().unwrap_or(0);
    if known.as_ref().is_some_and(|known| most >= known.len()) {
        let known = known.unwrap_or_default();
        let all = known
            .iter()
            .enumerate()
            .map(|(k, name)| format!("{k} {name}"));
        let all: Vec<String> = all.collect();
        let message = format!("it has no axis {most}, but {}", all.join(", "));
        return Err(io::Error::other(message));
    }
    let name = device.name(path);
    let note = known.is_none().then(|| {
        "read by Linux's joystick interface, which takes small deflections for none: its event device, if it can be read \
         (ls -l /dev/input/by-id/*-event-joystick), does not"
            .to_owned()
    });
    hand.hold(&name, reading);
    let device_name = name.clone();
    let path = path.to_owned();
    std::thread::Builder::new().spawn(move || {
        let mut device = Ok(device);
        loop {
            if let Ok(device) = &mut device {
                // Returns when the device is disconnected.
                let _ = device.hand_on(&hand);
                hand.lose_joystick();
            }
            std::thread::sleep(AGAIN);
            // Another device at the same path is not accepted.
            device = Device::open(&path).and_then(|device| match device.name(&path) == name {
                true => Ok(device),
                false => Err(io::ErrorKind::NotFound.into()),
            });
        }
    })?;
    Ok((device_name, note))
}

/// Source of events.
enum Device {
    #[cfg(target_os = "linux")]
    Events(Box<event::Device>),
    Joydev(File),
}

impl Device {
    fn open(path: &Path) -> io::Result<Self> {
        if is_other(path)? {
            return Err(io::Error::other("it is another device, and no joystick"));
        }
        #[cfg(target_os = "linux")]
        if let Some(device) = event::Device::of(path)? {
            return Ok(Self::Events(Box::new(device)));
        }
        File::open(path).map(Self::Joydev)
    }

    fn name(&self, path: &Path) -> String {
        match self {
            #[cfg(target_os = "linux")]
            Self::Events(device) => device.name.clone(),
            Self::Joydev(_) => path.display().to_string(),
        }
    }

    /// Names of its axes, if available.
    fn axes(&self) -> Option<Vec<String>> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Events(device) => Some(device.axes()),
            Self::Joydev(_) => None,
        }
    }

    /// Passes the axes to `hand` as they move.
    fn hand_on(&mut self, hand: &Hand) -> io::Result<()> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Events(device) => device.hand_on(hand),
            Self::Joydev(file) => {
                let mut raw = Vec::new();
                hand.moved(&raw, Instant::now());
                let mut event = [0; 8];
                loop {
                    file.read_exact(&mut event)?;
                    if let Some((axis, value)) = deflection(event) {
                        raw.resize(raw.len().max(axis + 1), 0.0);
                        raw[axis] = value;
                        hand.moved(&raw, Instant::now());
                    }
                }
            }
        }
    }
}

/// Whether a file is neither an input device, which has the major number 13 (kernel documentation,
/// `admin-guide/devices`), nor a pipe in place of one.
#[cfg(unix)]
fn is_other(path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    let metadata = std::fs::metadata(path)?;
    let is_input = metadata.file_type().is_char_device() && (metadata.rdev() >> 8) & 0xfff == 13;
    Ok(!is_input && !metadata.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_other(_: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Number and deflection of an axis, if the joystick-interface event is for an axis.
fn deflection(event: [u8; 8]) -> Option<(usize, f64)> {
    let [_, _, _, _, low, high, kind, number] = event;
    let value = f64::from(i16::from_ne_bytes([low, high])) / FULL;
    (kind & !BEGIN == AXIS).then(|| (usize::from(number), value.clamp(-1.0, 1.0)))
}

#[cfg(target_os = "linux")]
mod event {
    use super::OLDEST;
    use crate::hand::Hand;
    use evdev::{AbsInfo, AbsoluteAxisCode, EventSummary, InputEvent};
    use std::io;
    use std::os::unix::fs::FileTypeExt;
    use std::path::{Path, PathBuf};
    use std::time::{Instant, SystemTime};

    /// An axis with its values at the lower and upper end.
    struct Axis {
        code: AbsoluteAxisCode,
        ends: [i32; 2],
        value: f64,
    }

    impl Axis {
        fn new(code: AbsoluteAxisCode, info: AbsInfo) -> Self {
            let ends = [info.minimum(), info.maximum()];
            let mut own = Self {
                code,
                ends,
                value: 0.0,
            };
            own.take(info.value());
            own
        }

        fn take(&mut self, value: i32) {
            let [low, high] = self.ends.map(f64::from);
            let part = (f64::from(value) - low) / (high - low);
            self.value = match part.is_finite() {
                true => (2.0 * part - 1.0).clamp(-1.0, 1.0),
                false => 0.0,
            };
        }
    }

    pub struct Device {
        device: evdev::Device,
        pub name: String,
        axes: Vec<Axis>,
    }

    impl Device {
        /// The event device at a path, or the one that belongs to the path's `js` device; `None` if it cannot be read.
        pub fn of(path: &Path) -> io::Result<Option<Self>> {
            if std::fs::metadata(path)?.file_type().is_fifo() {
                return Ok(None);
            }
            let real = std::fs::canonicalize(path)?;
            let file = real.file_name().unwrap_or_default().to_string_lossy();
            match file.starts_with("js") {
                true => Ok(beside(&file).and_then(|beside| Self::open(&beside).ok())),
                false => Self::open(&real).map(Some),
            }
        }

        fn open(path: &Path) -> io::Result<Self> {
            let device = evdev::Device::open(path)?;
            let axes: Vec<Axis> = device
                .get_absinfo()?
                .map(|(code, info)| Axis::new(code, info))
                .collect();
            if axes.is_empty() {
                return Err(io::Error::other("it has no axes; it is no joystick"));
            }
            let name = device.name().map(str::trim).filter(|name| !name.is_empty());
            let name = name.map_or_else(|| path.display().to_string(), str::to_owned);
            Ok(Self { device, name, axes })
        }

        pub fn axes(&self) -> Vec<String> {
            let names = self.axes.iter().map(|axis| format!("{:?}", axis.code));
            names.collect()
        }

        pub fn hand_on(&mut self, hand: &Hand) -> io::Result<()> {
            let Self { device, axes, .. } = self;
            hand.moved(&values(axes), Instant::now());
            loop {
                // If events were lost because they were not read in time, the state is resynchronized.
                let events: Vec<InputEvent> = device.fetch_events()?.collect();
                let mut last = None;
                for event in events {
                    if let EventSummary::AbsoluteAxis(_, code, value) = event.destructure()
                        && let Some(axis) = axes.iter_mut().find(|axis| axis.code == code)
                    {
                        axis.take(value);
                        last = Some(event.timestamp());
                    }
                }
                if let Some(last) = last {
                    hand.moved(&values(axes), instant(last));
                }
            }
        }
    }

    fn values(axes: &[Axis]) -> Vec<f64> {
        axes.iter().map(|axis| axis.value).collect()
    }

    /// The event device of the same joystick.
    fn beside(name: &str) -> Option<PathBuf> {
        let folder = Path::new("/sys/class/input").join(name).join("device");
        let entries = std::fs::read_dir(folder).ok()?;
        let mut names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let name = names.find(|name| name.starts_with("event"))?;
        Some(Path::new("/dev/input").join(name))
    }

    /// Time at which the kernel received the event, by the simulation's clock.
    fn instant(stamp: SystemTime) -> Instant {
        let now = Instant::now();
        let age = stamp.elapsed().ok().filter(|age| *age < OLDEST);
        age.and_then(|age| now.checked_sub(age)).unwrap_or(now)
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        /// Ends as reported by the kernel, not necessarily symmetric about zero.
        #[test]
        fn an_axis_goes_from_end_to_end() {
            let code = AbsoluteAxisCode::ABS_X;
            let at =
                |value, low, high| Axis::new(code, AbsInfo::new(value, low, high, 0, 15, 0)).value;
            assert_eq!(at(0, 0, 255), -1.0);
            assert_eq!(at(255, 0, 255), 1.0);
            assert!((at(128, 0, 255) - 1.0 / 255.0).abs() < 1e-12);
            assert_eq!(at(0, -32768, 32767).signum(), 1.0);
            // Beyond an end, and without ends.
            assert_eq!(at(300, 0, 255), 1.0);
            assert_eq!(at(7, 7, 7), 0.0);
            // The whole range of `i32`.
            assert_eq!(at(i32::MIN, i32::MIN, i32::MAX), -1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_knows_centre_ends_and_dead_zone() {
        let mut reading = Reading::new(vec![1, 0], vec![true, false]);
        assert_eq!(reading.of(&[0.25, 0.5]), [-0.5, 0.25]);
        // A missing axis.
        assert_eq!(reading.of(&[0.25]), [0.0, 0.25]);
        reading.centre = vec![0.1, 0.0];
        reading.range = vec![[1.1, 0.9], [0.5, 0.25]];
        assert_eq!(reading.of(&[0.25, 0.1]), [0.0, 1.0]);
        assert_eq!(reading.of(&[-0.25, 1.0]), [-1.0, -0.5]);
        reading.dead = 0.2;
        assert!((reading.of(&[-0.25, 0.1])[1] + 0.375).abs() < 1e-12);
        assert_eq!(reading.of(&[-0.1, 0.1])[1], 0.0);
        assert!(reading.is_of(2) && !reading.is_of(1));
        reading.range[0] = [0.0, 1.0];
        assert!(!reading.is_of(2));
    }

    #[cfg(unix)]
    #[test]
    fn a_device_moves_the_stick_until_it_is_pulled_out() {
        use std::io::Write;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("js0");
        let made = std::process::Command::new("mkfifo")
            .arg(&path)
            .status()
            .unwrap();
        assert!(made.success());
        // Open for reading too, so that opening does not wait for the other end.
        let open = || {
            let mut options = std::fs::OpenOptions::new();
            options.read(true).write(true).open(&path).unwrap()
        };
        let mut pipe = open();
        let hand = Arc::new(Hand::new(1));
        let reading = Reading::new(vec![3], vec![true]);
        let (name, note) = listen(&path, reading, hand.clone()).unwrap();
        assert_eq!(name, path.display().to_string());
        assert!(
            note.unwrap()
                .starts_with("read by Linux's joystick interface")
        );
        let event = |value: i16, kind: u8, number: u8| {
            let [low, high] = value.to_ne_bytes();
            [1, 0, 0, 0, low, high, kind, number]
        };
        let stick = |wanted: f64| {
            let mut stick = [f64::NAN];
            for _ in 0..500 {
                hand.read(&mut stick);
                if (stick[0] - wanted).abs() < 1e-4 {
                    break;
                }
                std::thread::sleep(Duration::from_millis(10));
            }
            assert!((stick[0] - wanted).abs() < 1e-4, "{stick:?} for {wanted}");
        };
        let all = [event(32_767, 2, 0), event(1, 1, 3), event(-16_384, 0x82, 3)];
        pipe.write_all(&all.concat()).unwrap();
        stick(0.5);
        // A disconnected joystick releases the stick; then it is connected again.
        drop(pipe);
        stick(0.0);
        let mut pipe = open();
        pipe.write_all(&event(32_767, 2, 3)).unwrap();
        stick(-1.0);
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_device_of_input_is_refused() {
        let hand = || Arc::new(Hand::new(1));
        let refused = |path: &Path| {
            let reading = Reading::new(vec![0], vec![false]);
            listen(path, reading, hand()).unwrap_err().to_string()
        };
        let other = "it is another device, and no joystick";
        assert_eq!(refused(Path::new("/dev/null")), other);
        assert_eq!(refused(Path::new("/")), other);
        assert_eq!(refused(Path::new("Cargo.toml")), other);
        assert!(refused(Path::new("/dev/input/none")).starts_with("No such file"));
    }
}
