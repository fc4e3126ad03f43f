//! Signals that go out and come in while a run goes on: packets over UDP, or lines on the standard streams.

use crate::cli::{Failure, interrupt, terminal};
use crate::cosim::Recorder;
use crate::cosim::recorder::Signal;
use crate::cosim::scenario::Inlets;
use crate::series::head;
use pilotage_text::counted;
use serde_json::{Value, json};
use std::io::{self, BufRead};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

/// First bytes of a packet.
pub const MAGIC: &[u8; 4] = b"PLT1";
/// Bytes before the values.
const HEAD: usize = 24;
/// Most values of a packet: what fits into a datagram.
const MOST: usize = (65_507 - HEAD) / 8;
/// How long a run that is not paced waits for values at a point.
const PATIENCE: Duration = Duration::from_secs(1);
/// How long it waits until Ctrl-C is asked for.
const PIECE: Duration = Duration::from_millis(50);
/// Most messages that are read at a point; the rest is for the next one.
const TOGETHER: usize = 10_000;

/// What goes out and comes in.
#[derive(Debug, clap::Args)]
pub struct LiveArgs {
    /// Inputs that are given what comes in, in this order; until then they have their values.
    #[arg(long, value_name = "INPUT,...", value_delimiter = ',', conflicts_with_all = ["save_state", "from_state"])]
    live: Vec<String>,
    /// Take values for --live from UDP packets to this address (docs/cosim.md has their form).
    #[arg(long, value_name = "ADDRESS:PORT", requires = "live")]
    udp_in: Option<String>,
    /// Send each row in a UDP packet to this address.
    #[arg(long, value_name = "ADDRESS:PORT")]
    udp_out: Option<String>,
    /// Write each row as a line on stdout (CSV), and take lines with a time and the values for --live from stdin; the summary goes
    /// to stderr.
    #[arg(long, conflicts_with_all = ["udp_in", "udp_out"])]
    pub stream: bool,
}

impl LiveArgs {
    /// Inputs that are given what comes in.
    pub fn inputs(&self) -> &[String] {
        &self.live
    }

    /// Opens what is asked for.
    pub fn open(&self) -> Result<Ends, Failure> {
        if !self.live.is_empty() && self.udp_in.is_none() && !self.stream {
            return Err(Failure::new("--live: nothing brings values")
                .hint("say from where: --udp-in ADDRESS:PORT, or --stream"));
        }
        let mut seen = std::collections::HashSet::new();
        if let Some(twice) = self.live.iter().find(|own| !seen.insert(*own)) {
            return Err(Failure::new(format!("--live names `{twice}` twice")));
        }
        if self.stream && crate::cli::call::is_on() {
            return Err(Failure::new(
                "--stream: the standard streams are those of another program",
            )
            .hint("take --udp-in and --udp-out"));
        }
        let socket = |address: SocketAddr| {
            UdpSocket::bind(address)
                .map_err(|error| Failure::new(format!("cannot open UDP {address}: {error}")))
        };
        let from = match &self.udp_in {
            Some(given) => Some(Inlet::Udp(
                socket(address("--udp-in", given)?)?,
                vec![0; 1 << 16],
            )),
            None if self.stream && !self.live.is_empty() => Some(Inlet::Lines(lines())),
            None => None,
        };
        let to = match &self.udp_out {
            Some(given) => {
                let to = address("--udp-out", given)?;
                let any = match to {
                    SocketAddr::V4(_) => "0.0.0.0:0",
                    SocketAddr::V6(_) => "[::]:0",
                };
                Some(Outlet::Udp(socket(address("--udp-out", any)?)?, to))
            }
            None if self.stream => Some(Outlet::Lines),
            None => None,
        };
        Ok(Ends {
            from,
            to,
            count: self.live.len(),
        })
    }
}

fn address(option: &str, given: &str) -> Result<SocketAddr, Failure> {
    let found = given.to_socket_addrs().map(|mut all| all.next());
    let wrong = |why: String| {
        Failure::new(format!("{option} {given}: {why}")).hint("such as 127.0.0.1:5001")
    };
    match found {
        Ok(Some(own)) => Ok(own),
        Ok(None) => Err(wrong("no such address".to_owned())),
        Err(error) => Err(wrong(error.to_string())),
    }
}

/// The lines of stdin, as they come.
fn lines() -> Receiver<Vec<u8>> {
    let (give, take) = sync_channel(TOGETHER);
    // It ends with the process: nothing wakes who reads there.
    std::thread::spawn(move || {
        for line in io::stdin().lock().split(b'\n') {
            if !line.is_ok_and(|line| give.send(line).is_ok()) {
                return;
            }
        }
    });
    take
}

/// What is open.
pub struct Ends {
    from: Option<Inlet>,
    to: Option<Outlet>,
    count: usize,
}

enum Inlet {
    Udp(UdpSocket, Vec<u8>),
    Lines(Receiver<Vec<u8>>),
}

enum Outlet {
    Udp(UdpSocket, SocketAddr),
    Lines,
}

/// What came and went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    sent: u64,
    taken: u64,
    lost: u64,
    out_of_order: u64,
    late: u64,
    bad: u64,
    /// Points without new values.
    held: u64,
}

impl Traffic {
    /// One line.
    pub fn words(&self) -> String {
        let Self {
            sent,
            taken,
            lost,
            out_of_order,
            late,
            bad,
            held,
        } = self;
        format!(
            "outside: {} sent; {taken} taken, {lost} lost, {out_of_order} out of order, {late} late, {bad} bad; \
             {} without new values",
            counted(*sent as usize, "row"),
            counted(*held as usize, "point")
        )
    }

    pub fn to_json(self) -> Value {
        json!({
            "sent": self.sent,
            "taken": self.taken,
            "lost": self.lost,
            "outOfOrder": self.out_of_order,
            "late": self.late,
            "bad": self.bad,
            "held": self.held,
        })
    }
}

/// Values with a time; lines have no number.
#[derive(Debug, Clone, PartialEq)]
struct Packet {
    number: Option<u64>,
    time: f64,
    values: Vec<f64>,
}

impl Packet {
    /// Reads so many values from a datagram.
    fn of_bytes(bytes: &[u8], count: usize) -> Option<Self> {
        let (magic, rest) = bytes.split_first_chunk::<4>()?;
        let (said, rest) = rest.split_first_chunk::<4>()?;
        let (number, rest) = rest.split_first_chunk::<8>()?;
        let (numbers, []) = rest.as_chunks::<8>() else {
            return None;
        };
        let mut numbers = numbers.iter().map(|own| f64::from_le_bytes(*own));
        let is_whole = magic == MAGIC && u32::from_le_bytes(*said) as usize == count;
        let (time, values) = (numbers.next()?, numbers.collect::<Vec<f64>>());
        let number = Some(u64::from_le_bytes(*number));
        Self {
            number,
            time,
            values,
        }
        .checked(count)
        .filter(|_| is_whole)
    }

    /// Reads a time and so many values from a line.
    fn of_line(line: &[u8], count: usize) -> Option<Self> {
        let mut cells = std::str::from_utf8(line).ok()?.trim().split(',');
        let time = cells.next()?.trim().parse().ok()?;
        let values = cells
            .map(|own| own.trim().parse().ok())
            .collect::<Option<_>>()?;
        Self {
            number: None,
            time,
            values,
        }
        .checked(count)
    }

    fn checked(self, count: usize) -> Option<Self> {
        let is_finite = self
            .values
            .iter()
            .chain([&self.time])
            .all(|own| own.is_finite());
        (is_finite && self.values.len() == count).then_some(self)
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend((self.values.len() as u32).to_le_bytes());
        bytes.extend(self.number.unwrap_or_default().to_le_bytes());
        let numbers = [self.time].into_iter().chain(self.values.iter().copied());
        bytes.extend(numbers.flat_map(f64::to_le_bytes));
        bytes
    }
}

impl Inlet {
    /// The next message, for which it waits so long. An error if there are no more.
    fn next(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, ()> {
        match self {
            Self::Udp(socket, room) => {
                let timeout = (!wait.is_zero()).then_some(wait);
                let ready = socket
                    .set_nonblocking(wait.is_zero())
                    .and_then(|()| socket.set_read_timeout(timeout));
                let read = ready.and_then(|()| socket.recv(room));
                Ok(read.ok().map(|count| room[..count].to_vec()))
            }
            Self::Lines(lines) => match lines.recv_timeout(wait) {
                Ok(line) => Ok(Some(line)),
                Err(RecvTimeoutError::Timeout) => Ok(None),
                Err(RecvTimeoutError::Disconnected) => Err(()),
            },
        }
    }

    fn read(&self, message: &[u8], count: usize) -> Option<Packet> {
        match self {
            Self::Udp(..) => Packet::of_bytes(message, count),
            Self::Lines(_) => Packet::of_line(message, count),
        }
    }
}

/// A recorder that sends each row, and then takes what has come.
pub struct Live<'r> {
    inner: &'r mut dyn Recorder,
    ends: Ends,
    inlets: Inlets,
    /// Whether it waits for values.
    waits: bool,
    /// Time between rows, and the end of the run \[s\].
    step: f64,
    stop: f64,
    /// Number of the next packet that is expected.
    next: u64,
    is_first_line: bool,
    traffic: Traffic,
}

impl<'r> Live<'r> {
    /// `waits`: whether the run is not paced, and so waits for values at each row; `step`: time between rows.
    pub fn new(
        inner: &'r mut dyn Recorder,
        ends: Ends,
        inlets: Inlets,
        waits: bool,
        [step, stop]: [f64; 2],
    ) -> Self {
        Self {
            inner,
            ends,
            inlets,
            waits,
            step,
            stop,
            next: 0,
            is_first_line: true,
            traffic: Traffic::default(),
        }
    }

    /// What came and went, if anything is open.
    pub fn traffic(&self) -> Option<Traffic> {
        (self.ends.from.is_some() || self.ends.to.is_some() || self.traffic != Traffic::default())
            .then_some(self.traffic)
    }

    fn send(&mut self, time: f64, values: &[f64]) {
        let is_sent = match &self.ends.to {
            None => return,
            Some(Outlet::Lines) => {
                let numbers = std::iter::once(&time).chain(values);
                let cells: Vec<String> = numbers.map(f64::to_string).collect();
                terminal::print(&(cells.join(",") + "\n")).is_ok()
            }
            Some(Outlet::Udp(socket, to)) => {
                let number = Some(self.traffic.sent);
                let packet = Packet {
                    number,
                    time,
                    values: values.to_vec(),
                };
                socket.send_to(&packet.to_bytes(), to).is_ok()
            }
        };
        self.traffic.sent += u64::from(is_sent);
    }

    fn receive(&mut self, time: f64) {
        let Some(mut from) = self.ends.from.take() else {
            // Nothing comes any more.
            self.traffic.held += u64::from(self.ends.count > 0);
            return;
        };
        let (begun, is_asked) = (Instant::now(), interrupt::flag());
        let (mut has_new, mut is_open) = (false, true);
        for _ in 0..TOGETHER {
            let may_wait = self.waits && !has_new && !is_asked.load(Ordering::Relaxed);
            let left = PATIENCE.saturating_sub(begun.elapsed());
            let wait = if may_wait {
                left.min(PIECE)
            } else {
                Duration::ZERO
            };
            match from.next(wait) {
                Ok(Some(message)) => {
                    let packet = from.read(&message, self.ends.count);
                    has_new |= self.take(packet, &message, time);
                }
                Ok(None) if wait.is_zero() => break,
                Ok(None) => {}
                Err(()) => {
                    is_open = false;
                    break;
                }
            }
        }
        self.traffic.held += u64::from(!has_new);
        self.ends.from = is_open.then_some(from);
    }

    /// Takes a message; returns whether its values are new.
    fn take(&mut self, packet: Option<Packet>, message: &[u8], time: f64) -> bool {
        let is_header = std::mem::take(&mut self.is_first_line) && message.starts_with(b"time");
        let Some(packet) = packet else {
            self.traffic.bad += u64::from(!is_header);
            return false;
        };
        if let Some(number) = packet.number {
            // Who begins again, begins at 0.
            if number < self.next && number > 0 {
                self.traffic.out_of_order += 1;
                // It was taken for lost.
                self.traffic.lost = self.traffic.lost.saturating_sub(1);
                return false;
            }
            // The first one may have any number.
            if self.traffic.taken > 0 {
                let lost = number.saturating_sub(self.next);
                self.traffic.lost = self.traffic.lost.saturating_add(lost);
            }
            self.next = number.saturating_add(1);
        }
        self.traffic.taken += 1;
        self.traffic.late += u64::from(packet.time < time - self.step * (1.0 + 1e-6));
        self.inlets.set(&packet.values);
        true
    }
}

impl Recorder for Live<'_> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        match self.ends.to {
            Some(Outlet::Lines) => {
                let names = signals.iter().map(|own| head(&own.name, &own.unit));
                let header: Vec<String> = std::iter::once("time".to_owned()).chain(names).collect();
                terminal::print(&(header.join(",") + "\n"))
                    .map_err(|failure| io::Error::other(failure.message().to_owned()))?;
            }
            Some(Outlet::Udp(..)) if signals.len() > MOST => {
                let words = format!("a packet has at most {MOST} values; record fewer: --record");
                return Err(io::Error::other(words));
            }
            _ => {}
        }
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        self.inner.row(time, values)?;
        self.send(time, values);
        if time < self.stop - 1e-9 * self.step {
            self.receive(time);
        }
        Ok(())
    }

    fn end_rows(&mut self) -> io::Result<()> {
        self.inner.end_rows()
    }

    fn is_stop_asked(&mut self) -> bool {
        self.inner.is_stop_asked()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_is_what_the_table_of_the_chapter_says() {
        let own = Packet {
            number: Some(258),
            time: 0.5,
            values: vec![-2.0, 1e-3],
        };
        let bytes = own.to_bytes();
        assert_eq!(bytes.len(), HEAD + 16);
        assert_eq!(&bytes[..16], b"PLT1\x02\0\0\0\x02\x01\0\0\0\0\0\0");
        assert_eq!(&bytes[16..24], &0.5_f64.to_le_bytes());
        assert_eq!(Packet::of_bytes(&bytes, 2), Some(own));
        // With another number of values, longer, cut off anywhere, or with a value that is no number.
        assert_eq!(Packet::of_bytes(&bytes, 3), None);
        assert_eq!(Packet::of_bytes(&[&bytes[..], &[0]].concat(), 2), None);
        assert!((0..bytes.len()).all(|k| Packet::of_bytes(&bytes[..k], 2).is_none()));
        let nan = Packet {
            number: Some(0),
            time: 0.0,
            values: vec![f64::NAN],
        };
        assert_eq!(Packet::of_bytes(&nan.to_bytes(), 1), None);
        let line = |text: &str| Packet::of_line(text.as_bytes(), 2).map(|own| own.values);
        assert_eq!(line("0.1, 2,-3e1\r"), Some(vec![2.0, -30.0]));
        for wrong in ["", "0.1,2", "0.1,2,3,4", "0.1,2,x", "0.1,2,inf", "time,a,b"] {
            assert_eq!(line(wrong), None, "{wrong}");
        }
    }
}
