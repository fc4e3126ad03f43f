//! A joystick that the server reads itself, by Linux's joystick interface: events of eight bytes, the time \[ms\], the
//! value from -32767 to 32767, the kind and the number of the axis (kernel documentation, `input/joydev/joystick-api`).

use crate::hand::Hand;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

/// Kind of an event of an axis; with 0x80 it tells where the axis is at the begin.
const AXIS: u8 = 2;
const BEGIN: u8 = 0x80;
/// Full deflection.
const FULL: f64 = 32_767.0;

/// Which axes of the device are those of the hand.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    /// Numbers of the device's axes, from 0.
    pub numbers: Vec<u8>,
    /// Whether each is turned round.
    pub inverted: Vec<bool>,
}

/// Reads a device in a separate thread from now on.
///
/// # Errors
/// When it cannot be opened, or is another device.
pub fn listen(path: &Path, axes: Axes, hand: Arc<Hand>) -> io::Result<()> {
    let mut device = File::open(path)?;
    if is_other(&device)? {
        return Err(io::Error::other("it is another device, and no joystick"));
    }
    let name = path.display().to_string();
    let mut stick = vec![0.0; axes.numbers.len()];
    hand.replace(&stick, &name);
    std::thread::spawn(move || {
        let mut event = [0; 8];
        while device.read_exact(&mut event).is_ok() {
            if let Some((axis, value)) = deflection(event)
                && let Some(k) = axes.numbers.iter().position(|number| *number == axis)
            {
                stick[k] = if axes.inverted[k] { -value } else { value };
                hand.replace(&stick, &name);
            }
        }
        // It was pulled out.
        hand.lose_joystick();
    });
    Ok(())
}

/// Whether a device is none of input, which have the major number 13 (kernel documentation, `admin-guide/devices`).
#[cfg(unix)]
fn is_other(device: &File) -> io::Result<bool> {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    let told = device.metadata()?;
    let major = (told.rdev() >> 8) & 0xfff;
    Ok(told.is_file() || told.is_dir() || (told.file_type().is_char_device() && major != 13))
}

#[cfg(not(unix))]
fn is_other(_: &File) -> io::Result<bool> {
    Ok(false)
}

/// Number and deflection of an axis, where an event is of one.
fn deflection(event: [u8; 8]) -> Option<(u8, f64)> {
    let [_, _, _, _, low, high, kind, number] = event;
    let value = f64::from(i16::from_ne_bytes([low, high])) / FULL;
    (kind & !BEGIN == AXIS).then(|| (number, value.clamp(-1.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut pipe = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(&path)
            .unwrap();
        let hand = Arc::new(Hand::new(1));
        let axes = Axes {
            numbers: vec![3],
            inverted: vec![true],
        };
        listen(&path, axes, hand.clone()).unwrap();
        let event = |value: i16, kind: u8, number: u8| {
            let [low, high] = value.to_ne_bytes();
            [1, 0, 0, 0, low, high, kind, number]
        };
        let all = [event(32_767, 2, 0), event(1, 1, 3), event(-16_384, 0x82, 3)];
        pipe.write_all(&all.concat()).unwrap();
        let mut stick = [0.0];
        for _ in 0..500 {
            hand.read(&mut stick);
            if stick[0] != 0.0 {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert!((stick[0] - 0.5).abs() < 1e-4, "{stick:?}");
    }
}
