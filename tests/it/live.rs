//! `pilotage cosim --live`: values that come in packets and lines, against a loop of its own.

use crate::command::Folder;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::process::{Command, Stdio};
use std::time::Duration;

/// An integrator: over a step with a held input it rises by step times input.
const PLANT: &str = "[model]\nname = \"plant\"\n[inputs]\nu = { start = 0.5, unit = \"m/s\" }\nv = {}\n\
                     [states]\ny = { der = \"u\", unit = \"m\" }\n[outputs]\ny = { unit = \"m\", description = \"how far it is\" }\n";

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("plant.toml", PLANT);
    folder
}

fn packet(number: u64, time: f64, values: &[f64]) -> Vec<u8> {
    let numbers = [time].into_iter().chain(values.iter().copied());
    let head = [
        &b"PLT1"[..],
        &(values.len() as u32).to_le_bytes(),
        &number.to_le_bytes(),
    ]
    .concat();
    head.into_iter()
        .chain(numbers.flat_map(f64::to_le_bytes))
        .collect()
}

fn read(bytes: &[u8]) -> (u64, f64, Vec<f64>) {
    assert_eq!(&bytes[..4], b"PLT1");
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let values: Vec<f64> = (24..bytes.len())
        .step_by(8)
        .map(|at| f64::from_bits(number(at)))
        .collect();
    assert_eq!(
        u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize,
        values.len()
    );
    (number(8), f64::from_bits(number(16)), values)
}

/// y over the steps when each is given 2 (1 - y) of its beginning.
fn expected(steps: usize, h: f64) -> Vec<f64> {
    (0..=steps)
        .scan(0.0, |y, _| {
            Some(std::mem::replace(y, *y + h * 2.0 * (1.0 - *y)))
        })
        .collect()
}

fn column(folder: &Folder) -> Vec<f64> {
    let text = folder.read("result.csv");
    text.lines()
        .skip(1)
        .map(|line| line.split(',').nth(1).unwrap().parse().unwrap())
        .collect()
}

fn assert_near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{found:?} {expected:?}");
    }
}

/// A controller behind a socket closes the loop without a lag; what is none of its packets is counted and has no effect.
#[test]
fn packets_close_a_loop() {
    let folder = folder();
    let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
    peer.set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    let free = UdpSocket::bind("127.0.0.1:0").unwrap();
    let (to, out) = (free.local_addr().unwrap(), peer.local_addr().unwrap());
    drop(free);
    let steps = 20;
    let answer = move || {
        let mut seen = Vec::new();
        let mut bytes = [0; 1 << 12];
        for k in 0..=steps {
            let count = peer.recv(&mut bytes).unwrap();
            let (number, time, values) = read(&bytes[..count]);
            assert_eq!((number, values.len()), (k, 1));
            seen.push(values[0]);
            let send = |bytes: &[u8]| {
                peer.send_to(bytes, to).unwrap();
            };
            if k == 3 {
                send(b"");
                send(b"nonsense");
                send(&packet(3, time, &[7.0]));
                send(&packet(3, time, &[f64::NAN, 0.0]));
                send(&packet(1, time, &[7.0, 0.0]));
            }
            // One number is left out, and the time of one is long ago.
            let number = if k < 10 { k } else { k + 1 };
            let time = if k == 12 { 0.0 } else { time };
            if k < steps {
                send(&packet(number, time, &[2.0 * (1.0 - values[0]), 0.0]));
            }
        }
        seen
    };
    let peer = std::thread::spawn(answer);
    let (to, out) = (to.to_string(), out.to_string());
    let ended = folder.pilotage(&[
        "cosim",
        "plant.toml",
        "--stop-time",
        "2",
        "--step",
        "0.1",
        "--live",
        "u,plant.v",
        "--udp-in",
        &to,
        "--udp-out",
        &out,
        "--json",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let seen = peer.join().unwrap();
    assert_near(&seen, &expected(20, 0.1));
    assert_near(&column(&folder), &expected(20, 0.1));
    let outside = &ended.json()["outside"];
    let counts = ["sent", "taken", "lost", "outOfOrder", "late", "bad", "held"]
        .map(|key| outside[key].as_u64().unwrap());
    assert_eq!(counts, [21, 20, 1, 1, 1, 4, 0], "{outside}");
}

/// The same over lines; at their end the last values stay.
#[test]
fn lines_close_a_loop() {
    let folder = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_pilotage"))
        .args([
            "cosim",
            "plant.toml",
            "--stop-time",
            "2",
            "--step",
            "0.1",
            "--live",
            "plant.u",
            "--stream",
        ])
        .current_dir(folder.path("."))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut to = child.stdin.take();
    let mut from = BufReader::new(child.stdout.take().unwrap()).lines();
    assert_eq!(from.next().unwrap().unwrap(), "time,plant.y [m]");
    to.as_mut()
        .unwrap()
        .write_all(b"time,plant.u\nx,y\n")
        .unwrap();
    let mut seen = Vec::new();
    for line in from {
        let line = line.unwrap();
        let (time, y) = line.split_once(',').unwrap();
        seen.push(y.parse::<f64>().unwrap());
        if seen.len() > 10 {
            to = None;
        }
        if let Some(to) = &mut to {
            writeln!(to, "{time},{}", 2.0 * (1.0 - seen[seen.len() - 1])).unwrap();
        }
    }
    let ended = child.wait_with_output().unwrap();
    let words = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.success(), "{words}");
    let first = expected(10, 0.1);
    let rise = first[10] - first[9];
    let rest = (1..=10).map(|k| first[10] + rise * k as f64);
    assert_near(
        &seen,
        &first.iter().copied().chain(rest).collect::<Vec<f64>>(),
    );
    assert!(words.contains("21 rows sent; 10 taken, 0 lost, 0 out of order, 0 late, 1 bad; 10 points without new values"), "{words}");
}

/// Without anybody at the other end a paced run keeps its time and its values.
#[test]
fn nobody_is_waited_for_by_the_clock() {
    let folder = folder();
    folder.write(
        "set.toml",
        "[[event]]\ntime = 0.5\ninput = \"u\"\nset = 2\n",
    );
    let words = [
        "cosim",
        "plant.toml",
        "--stop-time",
        "1",
        "--step",
        "0.1",
        "--real-time",
        "10",
        "--live",
        "u",
        "--udp-in",
        "127.0.0.1:0",
    ];
    let ended = folder.pilotage(&words);
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(ended.stdout.contains("0 taken"), "{ended:?}");
    assert!((column(&folder)[10] - 0.5).abs() < 1e-12);
    for (more, why) in [
        (&["--live", "u"][..], "nothing brings values"),
        (
            &["--live", "plant.y", "--udp-in", "127.0.0.1:0"],
            "`plant.y` is an output",
        ),
        (&["--live", "u", "--udp-in", "nowhere"], "--udp-in nowhere"),
        (&["--live", "u,u", "--stream"], "--live names `u` twice"),
        (
            &["--live", "u", "--stream", "--scenario", "set.toml"],
            "--live and an event of the scenario both change `plant.u`",
        ),
        (
            &["--live", "u", "--stream", "--save-state", "x.state"],
            "cannot be used with",
        ),
        (
            &["--stream", "--udp-out", "127.0.0.1:9"],
            "cannot be used with",
        ),
    ] {
        let ended = folder.pilotage(&[&words[..6], more].concat());
        assert!(
            ended.code == 2 && ended.stderr.contains(why),
            "{more:?}: {ended:?}"
        );
    }
}
