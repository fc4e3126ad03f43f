//! Connections of the server. Those that have not shown the token are few: where another comes, the oldest of them is
//! closed. So however many are held open by someone without the token, who has it is served.

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::AbortHandle;

/// Maximum number of connections that have not shown the token.
const STRANGERS: usize = 128;
/// Time in which the header of a request must come, also of the next one on the same connection.
const HEADER: Duration = Duration::from_secs(5);
/// Interval between attempts to accept connections, if no descriptors are left for them: half of the strangers are closed.
const PAUSE: Duration = Duration::from_millis(100);

/// The connections that have not shown the token, by their number: oldest first.
type Strangers = Arc<Mutex<BTreeMap<u64, AbortHandle>>>;

/// The connection of a request.
#[derive(Clone)]
pub(crate) struct Connection {
    number: u64,
    strangers: Strangers,
}

impl Connection {
    /// Keeps the connection, whoever else comes.
    pub(crate) fn keep(&self) {
        let mut strangers = self
            .strangers
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        strangers.remove(&self.number);
    }
}

/// Closes the oldest connections of strangers until there are no more than that.
fn close_oldest(strangers: &mut BTreeMap<u64, AbortHandle>, most: usize) {
    while strangers.len() > most {
        strangers
            .pop_first()
            .into_iter()
            .for_each(|(_, oldest)| oldest.abort());
    }
}

/// Serves connections until it is dropped. Each request has its [`Connection`] as an extension.
pub(crate) async fn serve(listener: TcpListener, router: &Router) {
    let strangers = Strangers::default();
    let known = || strangers.lock().unwrap_or_else(PoisonError::into_inner);
    for number in 0_u64.. {
        let stream = loop {
            match listener.accept().await {
                Ok((stream, _)) => break stream,
                Err(_) => {
                    let half = known().len() / 2;
                    close_oldest(&mut known(), half);
                    tokio::time::sleep(PAUSE).await;
                }
            }
        };
        let own = Connection {
            number,
            strangers: strangers.clone(),
        };
        let service = TowerToHyperService::new(router.clone().layer(Extension(own.clone())));
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEADER)
            .serve_connection(TokioIo::new(stream), service)
            .with_upgrades();
        {
            let mut strangers = known();
            let task = tokio::spawn(async move {
                // It ends with an error if the other end breaks it off or is too slow.
                let _ = connection.await;
                own.keep();
            });
            strangers.insert(number, task.abort_handle());
            close_oldest(&mut strangers, STRANGERS);
        }
        // However many wait to be accepted, a request that has come with its connection is read before others replace it.
        tokio::task::yield_now().await;
    }
}
