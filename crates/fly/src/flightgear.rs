//! FlightGear as display: sends the vehicle's pose in packets of its native FDM protocol, and the marker's as lines of
//! its generic protocol.
//!
//! The layout is that of `FGNetFDM` in FlightGear's `src/Network/net_fdm.hxx`: 408 bytes in version 24, 552 in version
//! 25, both big-endian.

use crate::message::StateMessage;
use std::net::{SocketAddr, UdpSocket};

/// Packets per second, FlightGear's frame rate.
pub const RATE: f64 = 60.0;
/// Mean radius of the earth \[m\]; near a runway the ellipsoid can be neglected.
const EARTH: f64 = 6_371_008.8;
/// Displayed height of a vehicle that moves along the ground \[m\].
const HEIGHT: f64 = 3.0;
const FEET: f64 = 0.3048;

/// Initial position and forward direction of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Runway {
    /// Latitude \[deg\].
    pub latitude: f64,
    /// Longitude \[deg\].
    pub longitude: f64,
    /// True heading \[deg\].
    pub heading: f64,
    /// Elevation \[m\].
    pub elevation: f64,
}

impl Default for Runway {
    /// Runway 28R of San Francisco, which is included in FlightGear.
    fn default() -> Self {
        Self {
            latitude: 37.613_534,
            longitude: -122.357_141,
            heading: 297.9,
            elevation: 4.0,
        }
    }
}

/// Position, attitude and speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Longitude and latitude \[rad\], height above sea level \[m\].
    pub place: [f64; 3],
    /// Roll, pitch and heading \[rad\].
    pub attitude: [f64; 3],
    /// Northward and eastward speed \[m/s\].
    pub speed: [f64; 2],
}

impl Runway {
    /// The pose for a displacement forward and to the right \[m\], and pitch forward and roll to the right \[rad\].
    pub fn pose(&self, moved: [f64; 2], lean: [f64; 2], speed: [f64; 2]) -> Pose {
        let heading = self.heading.to_radians();
        let turned = |[ahead, right]: [f64; 2]| {
            let (sin, cos) = heading.sin_cos();
            [ahead * cos - right * sin, ahead * sin + right * cos]
        };
        let [north, east] = turned(moved);
        let latitude = self.latitude.to_radians() + north / EARTH;
        let longitude = self.longitude.to_radians() + east / (EARTH * latitude.cos());
        Pose {
            place: [longitude, latitude, self.elevation + HEIGHT],
            // Leaning forward is nose down.
            attitude: [lean[1], -lean[0], heading],
            speed: turned(speed),
        }
    }
}

/// Versions of the packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// Up to FlightGear 2020.3.
    V24,
    /// Later versions, with more data on tanks.
    V25,
}

/// The packet for a pose; `now` is the time in seconds since 1970.
pub fn packet(version: Version, pose: &Pose, now: u32) -> Vec<u8> {
    let mut bytes = Bytes::default();
    bytes.integers(&[if version == Version::V24 { 24 } else { 25 }, 0]);
    bytes.doubles(&pose.place);
    bytes.floats(&[HEIGHT]);
    bytes.floats(&pose.attitude);
    bytes.floats(&[0.0; 5]); // alpha, beta, and the rates of the attitude
    let [north, east] = pose.speed.map(|speed| speed / FEET);
    bytes.floats(&[
        north.hypot(east) * FEET * 3600.0 / 1852.0,
        0.0,
        north,
        east,
        0.0,
    ]);
    bytes.floats(&[0.0; 3 + 3 + 2]); // speeds in the body, accelerations of the pilot, stall, slip
    bytes.integers(&[1, 2, 0, 0, 0]); // one engine, which runs
    bytes.floats(&[0.0; 9 * 4]);
    bytes.integers(&[1]);
    bytes.floats(&[0.0; 4]);
    if version == Version::V25 {
        bytes.integers(&[0; 4]);
        bytes.doubles(&[0.0; 4 * 4]);
    }
    bytes.integers(&[0; 1 + 3]); // no wheels
    bytes.floats(&[0.0; 3 * 3]);
    bytes.integers(&[now, 0]);
    bytes.floats(&[20_000.0]); // visibility
    bytes.floats(&[0.0; 10]);
    bytes.0
}

#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn integers(&mut self, all: &[u32]) {
        all.iter()
            .for_each(|value| self.0.extend(value.to_be_bytes()));
    }

    fn floats(&mut self, all: &[f64]) {
        all.iter()
            .for_each(|value| self.0.extend((*value as f32).to_be_bytes()));
    }

    fn doubles(&mut self, all: &[f64]) {
        all.iter()
            .for_each(|value| self.0.extend(value.to_be_bytes()));
    }
}

/// Sends states to FlightGear: the vehicle to its address, the marker to the next port.
#[derive(Debug)]
pub struct Sender {
    socket: UdpSocket,
    vehicle: SocketAddr,
    marker: SocketAddr,
    runway: Runway,
    version: Version,
    before: Option<(f64, [f64; 2])>,
}

impl Sender {
    /// Sends to that address.
    ///
    /// # Errors
    /// If no socket can be opened.
    pub fn new(vehicle: SocketAddr, runway: Runway, version: Version) -> std::io::Result<Self> {
        let any: SocketAddr = if vehicle.is_ipv4() {
            ([0, 0, 0, 0], 0).into()
        } else {
            ([0_u16; 8], 0).into()
        };
        let mut marker = vehicle;
        marker.set_port(vehicle.port().wrapping_add(1));
        Ok(Self {
            socket: UdpSocket::bind(any)?,
            vehicle,
            marker,
            runway,
            version,
            before: None,
        })
    }

    /// Sends a state, whether or not there is a receiver.
    ///
    /// # Errors
    /// If the system cannot send.
    pub fn send(&mut self, state: &StateMessage, now: u32) -> std::io::Result<()> {
        let two = |values: &[f64]| [0, 1].map(|k| values.get(k).copied().unwrap_or(0.0));
        let place = two(&state.x);
        let speed = match self.before {
            Some((time, before)) if state.t > time => {
                [0, 1].map(|k| (place[k] - before[k]) / (state.t - time))
            }
            _ => [0.0, 0.0],
        };
        self.before = Some((state.t, place));
        let pose = self.runway.pose(place, two(&state.tilt), speed);
        self.socket
            .send_to(&packet(self.version, &pose, now), self.vehicle)?;
        let [longitude, latitude, height] = self
            .runway
            .pose(two(&state.target), [0.0; 2], [0.0; 2])
            .place;
        let line = format!(
            "{:.9},{:.9},{:.3}\n",
            latitude.to_degrees(),
            longitude.to_degrees(),
            height / FEET
        );
        self.socket.send_to(line.as_bytes(), self.marker).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_have_their_sizes_and_forward_is_along_the_runway() {
        let runway = Runway::default();
        let pose = runway.pose([1000.0, 0.0], [0.1, 0.0], [5.0, 0.0]);
        assert_eq!(packet(Version::V24, &pose, 0).len(), 408);
        assert_eq!(packet(Version::V25, &pose, 0).len(), 552);
        let north = (pose.place[1] - runway.latitude.to_radians()) * EARTH;
        assert!((north - 1000.0 * runway.heading.to_radians().cos()).abs() < 1e-6);
        assert!(pose.speed[1] < 0.0, "to the west");
    }
}
