//! A session over its socket: a scripted hand flies it to the end; strangers and nonsense are sent away.

use futures_util::SinkExt;
use pilotage_cosim::component::ComponentError;
use pilotage_cosim::{Component, NativeComponent};
use pilotage_fly::craft::{Craft, Names};
use pilotage_fly::hand::Hand;
use pilotage_fly::joystick::Reading;
use pilotage_fly::message::JobKind;
use pilotage_fly::protocol::Protocol;
use pilotage_fly::server::{self, Server};
use pilotage_fly::session::{Board, Command, Place, Session, Works};
use pilotage_models::{Model, Quadcopter};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

struct Nothing;

impl Works for Nothing {
    fn can(&self, _subject: &str) -> Vec<JobKind> {
        Vec::new()
    }
    fn begin(&mut self, _kind: JobKind, _subject: &str, _board: &Arc<Board>) {}
    fn pilot(&self, _subject: &str) -> Option<Result<Box<dyn Component>, ComponentError>> {
        None
    }
}

const PROTOCOL: &str = "[training]\nleast = 0\nmost = 0\n[[task]]\nkind = \"step\"\ntarget = 4\nseconds = 1.5\nruns = 2\n";

/// A quadcopter's session of two short runs; its address without the scheme, and the token.
async fn session(folder: &Path) -> (String, String) {
    session_of(folder, Arc::new(Hand::new(1))).await
}

async fn session_of(folder: &Path, hand: Arc<Hand>) -> (String, String) {
    let make = || {
        Ok(Box::new(NativeComponent::new(Model::quadcopter(
            &Quadcopter::default(),
        ))) as _)
    };
    let craft = Craft::new(
        "quadcopter",
        "built in".into(),
        &Names::default(),
        Box::new(make),
    )
    .unwrap();
    let protocol = Protocol::parse(PROTOCOL, "p.toml", craft.shape()).unwrap();
    let (sender, commands) = channel();
    let place = Place {
        folder: folder.to_owned(),
        header: vec![("recorded by", "a test".into())],
        notes: Vec::new(),
    };
    let (session, board) = Session::new(
        craft,
        protocol,
        place,
        hand.clone(),
        commands,
        Box::new(Nothing),
    );
    std::thread::spawn(move || session.run());
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let token = server::token().unwrap();
    let server = Server {
        listener,
        token: token.clone(),
        is_open: false,
        made: folder.join("made"),
        policy: "script-src 'none'".to_owned(),
    };
    // Held until the end: a session whose commands have no sender ends.
    let keep: std::sync::mpsc::Sender<Command> = sender.clone();
    tokio::spawn(async move {
        let _keep = keep;
        server.serve(board, hand, sender).await
    });
    (address, token)
}

async fn open(address: &str, token: &str) -> Socket {
    connect_async(format!("ws://{address}/socket?token={token}"))
        .await
        .unwrap()
        .0
}

async fn hear(socket: &mut Socket) -> Option<Value> {
    use futures_util::StreamExt;
    loop {
        match socket.next().await? {
            Ok(Message::Text(text)) => return Some(serde_json::from_str(&text).unwrap()),
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

async fn send(socket: &mut Socket, message: Value) {
    // A server that has hung up is seen by who listens.
    let _ = socket.send(Message::text(message.to_string())).await;
}

/// Hears messages until one of that type has come that passes.
async fn until(socket: &mut Socket, kind: &str, passes: impl Fn(&Value) -> bool) -> Value {
    let heard = async {
        while let Some(message) = hear(socket).await {
            if message["type"] == kind && passes(&message) {
                return Some(message);
            }
        }
        None
    };
    let heard = tokio::time::timeout(Duration::from_secs(60), heard).await;
    heard.expect(kind).expect(kind)
}

fn begin() -> Value {
    json!({ "type": "begin", "subject": "T1", "consent": true, "device": "gamepad" })
}

/// Flies until so many runs are over: a hand that leans on error and rate, at 60 frames a second.
async fn fly(socket: &mut Socket, runs: usize) -> Vec<Value> {
    let mut results = Vec::new();
    let (mut n, mut state) = (0, json!({ "x": [0.0], "target": [0.0], "t": 0.0 }));
    let mut rate = 0.0;
    let mut ticks = tokio::time::interval(Duration::from_millis(16));
    let begun = Instant::now();
    while results.len() < runs {
        tokio::select! {
            message = hear(socket) => {
                let message = message.expect("a server");
                match (message["type"].as_str().unwrap(), message["phase"].as_str()) {
                    ("state", _) => {
                        let of = |state: &Value, key: &str| state[key][0].as_f64().unwrap();
                        let step = message["t"].as_f64().unwrap() - state["t"].as_f64().unwrap();
                        if step > 0.0 {
                            rate = (of(&message, "x") - of(&state, "x")) / step;
                        }
                        state = message;
                    }
                    ("phase", Some("ready")) => send(socket, json!({ "type": "go" })).await,
                    ("phase", Some("after")) => {
                        results.push(message["result"].clone());
                        send(socket, json!({ "type": "go" })).await;
                    }
                    _ => {}
                }
            }
            _ = ticks.tick() => {
                n += 1;
                let error = state["target"][0].as_f64().unwrap() - state["x"][0].as_f64().unwrap();
                // Nothing before the start.
                let flies = f64::from(u8::from(state["t"].as_f64() > Some(0.0)));
                let stick = flies * (0.06 * (error - 1.5 * rate)).clamp(-1.0, 1.0);
                let t = 1e3 * begun.elapsed().as_secs_f64();
                let input = json!({ "type": "input", "n": n, "t": t, "stick": [stick], "device": "gamepad", "name": "script",
                    "frame": 16.0, "seen": true });
                send(socket, input).await;
                send(socket, json!({ "type": "shown", "t": state["t"], "seen": t - 20.0, "at": t })).await;
            }
        }
    }
    results
}

/// Each run is a file, where it counts beside the others; what it says stands at its top, and the log has all steps.
#[tokio::test]
async fn a_hand_flies_a_session_and_its_runs_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let mut socket = open(&address, &token).await;
    let hello = until(&mut socket, "hello", |_| true).await;
    assert_eq!(hello["vehicle"]["axes"][0]["unit"], "m");
    assert_eq!(hello["protocol"]["tasks"][0]["title"], "4 m");
    send(&mut socket, begin()).await;
    let mut results = fly(&mut socket, 2).await;
    // On a busy machine frames come late, and a run is flown again.
    while !results.iter().any(|result| result["valid"] == true) {
        assert!(results.len() < 20, "{results:?}");
        results.extend(fly(&mut socket, 1).await);
    }
    for result in &results {
        // On a busy machine frames may be late, and the run says so.
        let file = folder.path().join(result["file"].as_str().unwrap());
        assert_eq!(
            result["valid"].as_bool().unwrap(),
            result["why"].is_null(),
            "{result}"
        );
        assert_eq!(
            file.parent() == Some(folder.path()),
            result["valid"].as_bool().unwrap()
        );
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(
            text.starts_with("# recorded by: a test\n# vehicle: quadcopter (built in)\n"),
            "{text}"
        );
        assert!(
            text.contains("\n# subject: T1\n") && text.contains("\n# device: gamepad (script)\n"),
            "{text}"
        );
        let rows: Vec<Vec<f64>> = (text
            .lines()
            .skip_while(|line| line.starts_with('#'))
            .skip(1))
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
        assert!(rows.iter().all(|row| row[1] == 4.0));
        // One that can no longer count has ended.
        if result["valid"].as_bool().unwrap() {
            assert_eq!(rows.len(), 31);
            assert_eq!((rows[0][0], rows[30][0]), (0.0, 1.5));
            assert!(rows[30][2] > 0.05, "it has moved forward: {:?}", rows[30]);
        }
        let name = file.file_stem().unwrap().to_string_lossy().into_owned();
        let log = std::fs::read(folder.path().join(format!("full-rate/{name}.parquet"))).unwrap();
        assert_eq!(
            (&log[..4], &log[log.len() - 4..]),
            (&b"PAR1"[..], &b"PAR1"[..])
        );
    }
    let left = pilotage_fly::record::unfinished(folder.path()).unwrap();
    assert_eq!(left, [] as [std::path::PathBuf; 0]);
}

/// A page that goes in the middle of a run, and comes back: the run does not count, and says why.
#[tokio::test]
async fn a_socket_that_breaks_costs_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let mut socket = open(&address, &token).await;
    send(&mut socket, begin()).await;
    until(&mut socket, "phase", |phase| phase["phase"] == "ready").await;
    send(&mut socket, json!({ "type": "go" })).await;
    until(&mut socket, "phase", |phase| phase["phase"] == "fly").await;
    drop(socket);
    let mut socket = open(&address, &token).await;
    let after = until(&mut socket, "phase", |phase| phase["phase"] == "after").await;
    assert_eq!(after["result"]["valid"], false);
    assert!(
        after["result"]["file"]
            .as_str()
            .unwrap()
            .starts_with("invalid"),
        "{after}"
    );
    send(&mut socket, json!({ "type": "go" })).await;
    let again = until(&mut socket, "phase", |phase| phase["phase"] == "countdown").await;
    assert_eq!(again["run"], 1, "the same run once more");
}

/// Another stick than the one that was chosen flies: its calibration would stand in the flight, and be false.
#[tokio::test]
async fn a_stick_that_was_not_chosen_costs_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let mut socket = open(&address, &token).await;
    let mut chosen = begin();
    chosen["device"] = "keyboard".into();
    send(&mut socket, chosen).await;
    let results = fly(&mut socket, 1).await;
    let why = results[0]["why"].as_str().unwrap();
    // On a busy machine another fault may come first.
    assert!(
        why == "the hand held a gamepad, and what was chosen is a keyboard"
            || why.contains("ms")
            || why.contains('%'),
        "{why}"
    );
    assert_eq!(results[0]["valid"], false);
    assert!(results[0]["best"].is_null(), "{results:?}");
}

/// A joystick that the server reads goes before what the page says: the page shows it, and calibrates it.
#[tokio::test]
async fn the_page_calibrates_a_joystick_of_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let hand = Arc::new(Hand::new(1));
    hand.hold("a stick", Reading::new(vec![1], vec![true]));
    hand.moved(&[0.7, 0.02], Instant::now());
    let (address, token) = session_of(folder.path(), hand.clone()).await;
    let mut socket = open(&address, &token).await;
    let hello = until(&mut socket, "hello", |_| true).await;
    let reading = json!({ "axis": [1], "invert": [true], "centre": [0.0], "range": [[1.0, 1.0]], "dead": 0.0 });
    assert_eq!(
        hello["joystick"],
        json!({ "name": "a stick", "reading": reading })
    );
    let state = until(&mut socket, "state", |_| true).await;
    assert_eq!(state["raw"], json!([0.7, 0.02]));
    let mut begin = begin();
    begin["calibration"] = reading;
    begin["calibration"]["centre"] = json!([0.02]);
    begin["calibration"]["range"] = json!([[0.5, 0.5]]);
    send(&mut socket, begin.clone()).await;
    until(&mut socket, "phase", |phase| phase["phase"] == "ready").await;
    send(&mut socket, json!({ "type": "go" })).await;
    let mut stick = [f64::NAN];
    hand.read(&mut stick);
    assert_eq!(stick, [0.0]);
    hand.moved(&[0.7, 0.27], Instant::now());
    hand.read(&mut stick);
    assert_eq!(stick, [-0.5]);
    // What is no calibration changes nothing.
    begin["calibration"]["range"] = json!([[0.0, 0.5]]);
    send(&mut socket, begin.clone()).await;
    begin["calibration"] = Value::Null;
    send(&mut socket, begin).await;
    hand.moved(&[0.7, 0.02], Instant::now());
    let results = fly(&mut socket, 1).await;
    let file = folder.path().join(results[0]["file"].as_str().unwrap());
    let text = std::fs::read_to_string(file).unwrap();
    assert!(text.contains("\n# device: joystick (a stick)\n"), "{text}");
    let calibration =
        r#"{"axis":[1],"centre":[0.02],"dead":0.0,"invert":[true],"range":[[0.5,0.5]]}"#;
    assert!(
        text.contains(&format!("\n# calibration: {calibration}\n")),
        "{text}"
    );
    // The page's own stick went nowhere.
    let last = text.lines().last().unwrap();
    assert_eq!(last.split(',').nth(3), Some("0"), "{last}");
    hand.lose_joystick();
    let state = until(&mut socket, "state", |state| state["raw"].is_null()).await;
    assert_eq!(state["stick"], json!([0.0]));
}

/// Wrong tokens, hosts and origins are refused; what is no message ends the connection, and harms no one.
#[tokio::test]
async fn strangers_and_nonsense_are_sent_away() {
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let status = |url: String, headers: &'static [(&'static str, &'static str)]| async move {
        let mut request = url.into_client_request().unwrap();
        for (name, value) in headers {
            request.headers_mut().insert(*name, value.parse().unwrap());
        }
        match connect_async(request).await {
            Ok(_) => 101,
            Err(Error::Http(response)) => response.status().as_u16(),
            Err(error) => panic!("{error}"),
        }
    };
    let right = format!("ws://{address}/socket?token={token}");
    assert_eq!(status(right.clone(), &[]).await, 101);
    assert_eq!(status(format!("ws://{address}/socket"), &[]).await, 403);
    assert_eq!(
        status(format!("ws://{address}/socket?token={}", &token[1..]), &[]).await,
        403
    );
    assert_eq!(
        status(right.clone(), &[("origin", "http://elsewhere.example")]).await,
        403
    );
    assert_eq!(
        status(right.clone(), &[("host", "elsewhere.example")]).await,
        403
    );
    // A hundred messages of a page that has the stick, each from a seed.
    let valid = json!({ "type": "input", "n": 1, "t": 1.0, "stick": [0.5], "device": "mouse", "seen": true }).to_string();
    let mut seed = 7_u32;
    for k in 0..100 {
        let mut socket = open(&address, &token).await;
        until(&mut socket, "phase", |_| true).await;
        let mut bytes = valid.clone().into_bytes();
        for _ in 0..=k % 5 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let at = seed as usize % bytes.len();
            bytes[at] = (seed >> 24) as u8;
        }
        let message = match k % 4 {
            0 => Message::binary(bytes),
            1 => Message::text("[".repeat(1 + k)),
            2 => Message::text(valid.replace("[0.5]", &format!("[{}]", "1e999,".repeat(k)))),
            _ => Message::text(String::from_utf8_lossy(&bytes).into_owned()),
        };
        let _ = socket.send(message).await;
    }
    // One that is too large, and too many: the connection ends.
    let mut socket = open(&address, &token).await;
    send(&mut socket, json!({ "type": "x".repeat(10_000) })).await;
    let ended = async { while hear(&mut socket).await.is_some() {} };
    tokio::time::timeout(Duration::from_secs(10), ended)
        .await
        .expect("an end");
    let mut socket = open(&address, &token).await;
    for _ in 0..2000 {
        send(&mut socket, json!({ "type": "go" })).await;
    }
    let ended = async { while hear(&mut socket).await.is_some() {} };
    tokio::time::timeout(Duration::from_secs(10), ended)
        .await
        .expect("an end");
    // The session is as it was.
    let mut socket = open(&address, &token).await;
    let phase = until(&mut socket, "phase", |_| true).await;
    assert_eq!(phase["phase"], "welcome");
    send(
        &mut socket,
        json!({ "type": "begin", "subject": "../x", "consent": true, "device": "mouse" }),
    )
    .await;
    let trouble = until(&mut socket, "trouble", |_| true).await;
    assert!(
        trouble["words"]
            .as_str()
            .unwrap()
            .contains("letters, digits")
    );
    send(
        &mut socket,
        json!({ "type": "begin", "subject": "T1", "consent": false, "device": "mouse" }),
    )
    .await;
    let trouble = until(&mut socket, "trouble", |_| true).await;
    assert!(trouble["words"].as_str().unwrap().contains("consent"));
}

/// The answer to a request without a body.
async fn answer(address: &str, path: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer
}

/// Every answer says that nothing is guessed, told to other sites or run, but for what its own policy allows; no link
/// and nothing above the folder is followed, and no pipe is waited for.
#[tokio::test]
async fn each_answer_is_guarded_and_no_link_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let made = folder.path().join("made");
    std::fs::create_dir(&made).unwrap();
    std::fs::write(made.join("own.html"), "own").unwrap();
    std::fs::write(folder.path().join("secret.html"), "secret").unwrap();
    let mut paths = vec![
        ("/".to_owned(), 403),
        (format!("/?token={token}"), 200),
        ("/main.js".to_owned(), 200),
        ("/nothing".to_owned(), 404),
        ("/made/own.html".to_owned(), 403),
        (format!("/made/own.html?token={token}"), 200),
        (format!("/made/%2e%2e/secret.html?token={token}"), 404),
        (format!("/made/own.html/x?token={token}"), 404),
        (format!("/made/.?token={token}"), 404),
        (format!("/socket?token={token}"), 400),
        (format!("/socket?token={token}&token="), 400),
    ];
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        symlink(folder.path().join("secret.html"), made.join("link.html")).unwrap();
        symlink(folder.path(), made.join("up")).unwrap();
        let mut pipe = std::process::Command::new("mkfifo");
        assert!(pipe.arg(made.join("pipe")).status().unwrap().success());
        for name in ["link.html", "up/secret.html", "up/made/own.html", "pipe"] {
            paths.push((format!("/made/{name}?token={token}"), 404));
        }
    }
    for (path, status) in paths {
        let answer = answer(&address, &path).await;
        let begin = format!("HTTP/1.1 {status} ");
        assert!(answer.starts_with(&begin), "{path}: {answer}");
        for header in [
            "content-security-policy: ",
            "x-content-type-options: nosniff\r\n",
            "referrer-policy: no-referrer\r\n",
        ] {
            assert!(answer.contains(header), "{path}: {header}: {answer}");
        }
        let is_own = path.starts_with("/made") && status == 200;
        let policy = "content-security-policy: script-src 'none'; frame-ancestors 'self'\r\n";
        assert_eq!(answer.contains(policy), is_own, "{path}: {answer}");
    }
}

/// Requests that never end are closed: the oldest as soon as many others come, and all after some seconds. Meanwhile the
/// page goes on, and another is opened.
#[tokio::test]
async fn half_open_requests_keep_nobody_out() {
    const KEPT: usize = 128;
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let mut page = open(&address, &token).await;
    until(&mut page, "phase", |_| true).await;
    let mut halves = Vec::new();
    for k in 0..4 * KEPT {
        let mut half = TcpStream::connect(&address).await.unwrap();
        let begin: &[u8] = match k % 3 {
            0 => b"GET / HTTP/1.1\r\nX-a: ",
            1 => b"",
            _ => b"POST / HTTP/1.1\r\nContent-Length: 1000000\r\n",
        };
        // It may be closed already.
        let _ = half.write_all(begin).await;
        halves.push(half);
    }
    let answer = answer(&address, &format!("/?token={token}")).await;
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
    send(
        &mut page,
        json!({ "type": "begin", "subject": "../x", "consent": true, "device": "mouse" }),
    )
    .await;
    until(&mut page, "trouble", |_| true).await;
    let ended = async |half: &mut TcpStream| {
        let mut rest = Vec::new();
        let end = half.read_to_end(&mut rest);
        let end = tokio::time::timeout(Duration::from_secs(60), end);
        let _ = end.await.expect("a server that hangs up");
    };
    let (old, new) = halves.split_at_mut(3 * KEPT);
    for half in old {
        ended(half).await;
    }
    let newest = new.last_mut().unwrap();
    let is_open = matches!(newest.try_read(&mut [0; 1]), Err(error) if error.kind() == std::io::ErrorKind::WouldBlock);
    assert!(is_open, "the newest has its time");
    for half in new {
        ended(half).await;
    }
    send(
        &mut page,
        json!({ "type": "begin", "subject": "../x", "consent": true, "device": "mouse" }),
    )
    .await;
    until(&mut page, "trouble", |_| true).await;
}

/// Of two pages one has the stick; the other takes it when it asks.
#[tokio::test]
async fn one_page_has_the_stick() {
    let folder = tempfile::tempdir().unwrap();
    let (address, token) = session(folder.path()).await;
    let mut first = open(&address, &token).await;
    until(&mut first, "phase", |_| true).await;
    let mut second = open(&address, &token).await;
    until(&mut second, "taken", |_| true).await;
    // What it says is not heard.
    send(&mut second, begin()).await;
    send(&mut second, json!({ "type": "take" })).await;
    until(&mut first, "taken", |_| true).await;
    send(&mut second, begin()).await;
    let ready = until(&mut second, "phase", |phase| phase["phase"] == "ready").await;
    assert_eq!(ready["of"], 2);
    drop(second);
}
