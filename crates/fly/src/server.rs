//! Server of the page and its socket, for this computer only: it requires a token in the address, checks Host and
//! Origin, limits size and rate of messages, and lets one page control the stick.

use crate::connections::{self, Connection};
use crate::hand::Hand;
use crate::message::{FromPage, ToPage};
use crate::session::{Board, Command, Listening};
use axum::body::Body;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path as UrlPath, Query, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::map_response;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use serde::Deserialize;
use std::net::SocketAddr;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::sync::{Notify, broadcast};

/// The page's files, embedded in the executable.
const FILES: [(&str, &str, &str); 7] = [
    (
        "",
        "text/html; charset=utf-8",
        include_str!("../page/index.html"),
    ),
    (
        "style.css",
        "text/css; charset=utf-8",
        include_str!("../page/style.css"),
    ),
    ("main.js", SCRIPT, include_str!("../page/main.js")),
    ("socket.js", SCRIPT, include_str!("../page/socket.js")),
    ("sticks.js", SCRIPT, include_str!("../page/sticks.js")),
    ("scene.js", SCRIPT, include_str!("../page/scene.js")),
    ("panel.js", SCRIPT, include_str!("../page/panel.js")),
];
const SCRIPT: &str = "text/javascript; charset=utf-8";
/// Maximum size of a page's message \[bytes\].
const LARGEST: usize = 4096;
/// Maximum number of messages from a page per second: twice the rate of the fastest display, including drawing reports.
const RATE: u32 = 600;
/// Number of invalid messages after which a page is disconnected.
const NONSENSE: u32 = 20;
/// Interval between measurements of the round trip.
const PING: Duration = Duration::from_millis(500);

/// State shared by all requests.
struct Shared {
    token: String,
    hosts: Vec<String>,
    board: Arc<Board>,
    hand: Arc<Hand>,
    commands: Mutex<Sender<Command>>,
    /// The page that controls the stick; 0 for none.
    writer: AtomicU64,
    pages: AtomicU64,
    changed: Notify,
    made: PathBuf,
    policy: String,
}

/// A server's listener and access rules.
#[derive(Debug)]
pub struct Server {
    /// The listener.
    pub listener: TcpListener,
    /// Token required in requests.
    pub token: String,
    /// Whether any host name is accepted, because the server is bound to an address of another interface.
    pub is_open: bool,
    /// Folder of files created by jobs.
    pub made: PathBuf,
    /// Content-Security-Policy of the pages among them.
    pub policy: String,
}

/// A random token of 128 bits.
///
/// # Errors
/// If the system provides no random numbers.
pub fn token() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| std::io::Error::other(error.to_string()))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

impl Server {
    /// Address of the page.
    ///
    /// # Errors
    /// If the listener has no address.
    pub fn address(&self) -> std::io::Result<String> {
        Ok(format!(
            "http://{}/?token={}",
            self.listener.local_addr()?,
            self.token
        ))
    }

    /// Serves until it is dropped.
    ///
    /// # Errors
    /// If the listener has no address.
    pub async fn serve(
        self,
        board: Arc<Board>,
        hand: Arc<Hand>,
        commands: Sender<Command>,
    ) -> std::io::Result<()> {
        let address = self.listener.local_addr()?;
        let shared = Arc::new(Shared {
            token: self.token,
            hosts: if self.is_open {
                Vec::new()
            } else {
                hosts(address)
            },
            board,
            hand,
            commands: Mutex::new(commands),
            writer: AtomicU64::new(0),
            pages: AtomicU64::new(0),
            changed: Notify::new(),
            made: self.made,
            policy: self.policy,
        });
        let router = Router::new()
            .route("/", get(page))
            .route("/{file}", get(file))
            .route("/made/{*file}", get(made))
            .route("/socket", get(socket))
            .layer(map_response(guarded))
            .with_state(shared);
        connections::serve(self.listener, &router).await;
        Ok(())
    }
}

/// An answer with the headers that each has: nothing is guessed, kept or told to other sites, and what has no policy of
/// its own runs nothing.
async fn guarded(mut response: Response) -> Response {
    const ALL: [(HeaderName, &str); 4] = [
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'none'; frame-ancestors 'none'; base-uri 'none'",
        ),
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    for (name, value) in ALL {
        let own = response.headers_mut().entry(name);
        own.or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Host names of this computer with the port.
fn hosts(address: SocketAddr) -> Vec<String> {
    let port = address.port();
    let mut names = vec![address.to_string()];
    names.extend([
        format!("localhost:{port}"),
        format!("127.0.0.1:{port}"),
        format!("[::1]:{port}"),
    ]);
    names
}

/// Query of a request.
#[derive(Deserialize)]
struct Asked {
    token: Option<String>,
}

/// Response to a rejected request.
fn refused(words: &'static str) -> Response {
    (StatusCode::FORBIDDEN, format!("{words}\n")).into_response()
}

impl Shared {
    /// Whether `Host` is one of ours: another name that resolves to this address belongs to another site (DNS
    /// rebinding).
    fn is_ours(&self, headers: &HeaderMap) -> bool {
        let host = headers
            .get(header::HOST)
            .and_then(|host| host.to_str().ok());
        host.is_some_and(|host| self.hosts.is_empty() || self.hosts.iter().any(|own| own == host))
    }

    /// Whether the request for the socket comes from our page.
    fn is_own_page(&self, headers: &HeaderMap) -> bool {
        let of = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        match (of(header::ORIGIN), of(header::HOST)) {
            (Some(origin), Some(host)) => origin.strip_prefix("http://") == Some(host),
            // Not a browser.
            (None, _) => true,
            _ => false,
        }
    }

    /// Whether the token is correct; compared in constant time. A connection that has shown it is not closed for others.
    fn knows(&self, asked: &Asked, connection: &Connection) -> bool {
        let (own, given) = (
            self.token.as_bytes(),
            asked.token.as_deref().unwrap_or("").as_bytes(),
        );
        let differ = own.iter().zip(given).fold(0, |sum, (a, b)| sum | (a ^ b));
        let is_known = own.len() == given.len() && differ == 0;
        if is_known {
            connection.keep();
        }
        is_known
    }

    fn send(&self, command: Command) {
        let commands = self.commands.lock().unwrap_or_else(PoisonError::into_inner);
        // Fails only if the session has ended; the server then ends soon.
        let _ = commands.send(command);
    }
}

async fn page(
    State(shared): State<Arc<Shared>>,
    Query(asked): Query<Asked>,
    Extension(connection): Extension<Connection>,
    headers: HeaderMap,
) -> Response {
    if !shared.is_ours(&headers) {
        return refused(
            "Another name for this computer: open the address that pilotage fly has printed.",
        );
    }
    match shared.knows(&asked, &connection) {
        true => embedded("", &headers),
        false => refused(
            "The address has no token, or an old one: take the one that pilotage fly has printed.",
        ),
    }
}

async fn file(
    State(shared): State<Arc<Shared>>,
    UrlPath(name): UrlPath<String>,
    headers: HeaderMap,
) -> Response {
    match shared.is_ours(&headers) {
        true if name == "favicon.ico" => StatusCode::NO_CONTENT.into_response(),
        true => embedded(&name, &headers),
        false => refused("another name for this computer"),
    }
}

/// A file of the page. Its policy allows only resources and scripts of this server.
fn embedded(name: &str, headers: &HeaderMap) -> Response {
    let Some((_, kind, text)) = FILES.iter().find(|own| own.0 == name) else {
        return (StatusCode::NOT_FOUND, "no such file\n").into_response();
    };
    let host = headers
        .get(header::HOST)
        .and_then(|host| host.to_str().ok())
        .unwrap_or("");
    let policy = format!(
        "default-src 'self'; connect-src 'self' ws://{host}; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'"
    );
    let response_headers = [
        (header::CONTENT_TYPE, (*kind).to_owned()),
        (header::CONTENT_SECURITY_POLICY, policy),
    ];
    (response_headers, *text).into_response()
}

/// A file created by a job.
async fn made(
    State(shared): State<Arc<Shared>>,
    UrlPath(name): UrlPath<String>,
    Query(asked): Query<Asked>,
    Extension(connection): Extension<Connection>,
    headers: HeaderMap,
) -> Response {
    if !shared.is_ours(&headers) || !shared.knows(&asked, &connection) {
        return refused("the address has no token");
    }
    let Some(bytes) = own_file(&shared.made, Path::new(&name)) else {
        return (StatusCode::NOT_FOUND, "no such file\n").into_response();
    };
    let policy = format!("{}; frame-ancestors 'self'", shared.policy);
    let kind = match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("toml" | "csv" | "txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    };
    let response_headers = [
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, &policy),
    ];
    (response_headers, Body::from(bytes)).into_response()
}

/// The content of a file below a folder. Links are not followed, they may lead anywhere; nor are pipes read, which may
/// never end.
fn own_file(folder: &Path, name: &Path) -> Option<Vec<u8>> {
    let mut path = folder.to_owned();
    let mut kind = path.symlink_metadata().ok()?.file_type();
    for part in name.components() {
        let Component::Normal(part) = part else {
            return None;
        };
        if !kind.is_dir() {
            return None;
        }
        path.push(part);
        kind = path.symlink_metadata().ok()?.file_type();
    }
    kind.is_file().then(|| std::fs::read(path).ok())?
}

async fn socket(
    State(shared): State<Arc<Shared>>,
    Query(asked): Query<Asked>,
    Extension(connection): Extension<Connection>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let is_own = shared.is_ours(&headers) && shared.is_own_page(&headers);
    if !is_own || !shared.knows(&asked, &connection) {
        return refused("not of this page");
    }
    let upgrade = upgrade.max_message_size(LARGEST).max_frame_size(LARGEST);
    upgrade.on_upgrade(move |socket| async move {
        let page = shared.pages.fetch_add(1, Ordering::Relaxed) + 1;
        talk(socket, page, &shared).await;
        let was_writer = shared
            .writer
            .compare_exchange(page, 0, Ordering::AcqRel, Ordering::Acquire)
            .is_ok();
        if was_writer {
            shared.hand.lose();
            shared.changed.notify_waiters();
        }
    })
}

/// Counts of a page's messages.
struct Patience {
    since: Instant,
    messages: u32,
    nonsense: u32,
}

impl Patience {
    /// Counts a message; whether the rate is exceeded.
    fn is_over(&mut self) -> bool {
        if self.since.elapsed() > Duration::from_secs(1) {
            (self.since, self.messages) = (Instant::now(), 0);
        }
        self.messages += 1;
        self.messages > RATE
    }
}

/// Communicates with a page until it disconnects.
async fn talk(mut socket: WebSocket, page: u64, shared: &Shared) {
    let Listening {
        first,
        mut messages,
        mut states,
    } = shared.board.listen();
    let mut has_stick = shared
        .writer
        .compare_exchange(0, page, Ordering::AcqRel, Ordering::Acquire)
        .is_ok();
    for text in first {
        if send(&mut socket, &text).await.is_err() {
            return;
        }
    }
    if !has_stick && taken(&mut socket).await.is_err() {
        return;
    }
    let mut pings = tokio::time::interval(PING);
    let mut pinged = Instant::now();
    let mut patience = Patience {
        since: Instant::now(),
        messages: 0,
        nonsense: 0,
    };
    loop {
        // Notifications reach only pages that wait at that moment.
        if has_stick && shared.writer.load(Ordering::Acquire) != page {
            has_stick = false;
            if taken(&mut socket).await.is_err() {
                return;
            }
        }
        tokio::select! {
            came = socket.recv() => match came {
                Some(Ok(Message::Text(text))) => {
                    if patience.is_over() || patience.nonsense > NONSENSE {
                        return;
                    }
                    match serde_json::from_str::<FromPage>(&text) {
                        Ok(FromPage::Take) => {
                            shared.writer.store(page, Ordering::Release);
                            has_stick = true;
                            shared.changed.notify_waiters();
                        }
                        Ok(message) if shared.writer.load(Ordering::Acquire) == page => patience.nonsense += u32::from(!hear(shared, message)),
                        // Messages from pages without control of the stick are ignored.
                        Ok(_) => {}
                        Err(_) => patience.nonsense += 1,
                    }
                }
                Some(Ok(Message::Pong(_))) if has_stick => shared.hand.round_trip(pinged.elapsed()),
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => {}
            },
            received = messages.recv() => match received {
                Ok(text) => if send(&mut socket, &text).await.is_err() { return },
                Err(broadcast::error::RecvError::Lagged(_)) => {}
                Err(broadcast::error::RecvError::Closed) => return,
            },
            moved = states.changed() => {
                let state = ToPage::State(states.borrow_and_update().as_ref().clone());
                let text = serde_json::to_string(&state).unwrap_or_default();
                if moved.is_err() || send(&mut socket, &text).await.is_err() { return }
            }
            _ = pings.tick() => {
                pinged = Instant::now();
                if socket.send(Message::Ping(Vec::new().into())).await.is_err() { return }
            }
            () = shared.changed.notified() => {}
        }
    }
}

/// Handles a message from the page that controls the stick; `false` if it is invalid.
fn hear(shared: &Shared, message: FromPage) -> bool {
    match message {
        FromPage::Input(input) => shared.hand.take(input),
        FromPage::Shown { t, seen, at } => {
            shared.hand.shown(t, seen, at);
            true
        }
        other => {
            shared.send(Command::Page(other));
            true
        }
    }
}

async fn send(socket: &mut WebSocket, text: &str) -> Result<(), axum::Error> {
    socket.send(Message::Text(text.into())).await
}

async fn taken(socket: &mut WebSocket) -> Result<(), axum::Error> {
    let words = "Another page has the stick; this one watches.".to_owned();
    let text = serde_json::to_string(&ToPage::Taken { words }).unwrap_or_default();
    send(socket, &text).await
}
