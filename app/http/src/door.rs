//! A port of this machine with a service behind it.
//!
//! Every program on this machine can connect, and so can every page in its browser. A door for this machine accepts
//! requests that use a name of it ([`names`]). Every door holds a bounded number of connections, and closes those
//! without requests or whose answers are not read.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::http::StatusCode;
use axum::middleware::{self, Next};
use axum::response::{IntoResponse as _, Response};
use http_body_util::BodyExt as _;
use hyper::body::Incoming;
use hyper::service::service_fn;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::task::{AbortHandle, JoinSet};
use tower::ServiceExt as _;

use super::names;

/// Limit of the head of a request, and of pending data before more of an answer is produced \[bytes\].
const BUFFER: usize = 64 * 1024;

/// Simultaneous requests on one connection.
const STREAMS: u32 = 16;

/// How often a reader is pinged, if the protocol supports it.
const PING: Duration = Duration::from_secs(10);

/// After the system has refused a connection, most likely for want of file descriptors.
const PAUSE: Duration = Duration::from_millis(50);

/// The limits of a door.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Simultaneous connections. A viewer has one, a browser up to six.
    pub connections: usize,
    /// How long a connection may be without a complete request.
    pub idle: Duration,
    /// How long an answer may remain unread.
    pub stalled: Duration,
    /// How long the start of an answer may take, including the rest of the request.
    pub answer: Duration,
}

impl Limits {
    /// For users and their viewers.
    pub const USUAL: Self = Self {
        connections: 32,
        idle: Duration::from_secs(10),
        stalled: Duration::from_secs(30),
        answer: Duration::from_secs(10),
    };
}

/// A listening port; closed, with all its connections, when this is dropped.
#[derive(Debug)]
pub struct Door {
    address: SocketAddr,
    listening: AbortHandle,
}

impl Door {
    /// Listens on a free port of 127.0.0.1 and passes requests under a name of this machine to `routes`.
    ///
    /// # Errors
    /// When there is no port.
    pub fn open(runtime: &Handle, limits: Limits, routes: Router) -> io::Result<Self> {
        let here = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        Self::at(here, runtime, limits, routes.layer(middleware::from_fn(by_our_name)))
    }

    /// Listens at an address and passes all requests to `routes`, which have to check access. A request may be upgraded
    /// to another protocol.
    ///
    /// # Errors
    /// When the address is not one of this machine or the port is taken.
    pub fn at(address: SocketAddr, runtime: &Handle, limits: Limits, routes: Router) -> io::Result<Self> {
        let listener = std::net::TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let _inside = runtime.enter();
        let listener = TcpListener::from_std(listener)?;
        let listening = runtime.spawn(listen(listener, limits, routes)).abort_handle();
        Ok(Self { address, listening })
    }

    /// Where it is.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

async fn by_our_name(request: Request, next: Next) -> Response {
    if names::are_of_this_machine(&request) {
        next.run(request).await
    } else {
        (StatusCode::FORBIDDEN, names::REFUSAL).into_response()
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        self.listening.abort();
    }
}

/// What happens on a connection.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Activity {
    /// Requests that are being answered.
    requests: usize,
    /// Whether the peer does not read what is sent.
    blocked: bool,
}

impl Activity {
    fn is_idle(self) -> bool {
        self.requests == 0 && !self.blocked
    }
}

/// A connection, as long as it lasts.
struct Guest {
    task: AbortHandle,
    activity: watch::Receiver<Activity>,
}

async fn listen(listener: TcpListener, limits: Limits, routes: Router) {
    // Oldest first.
    let mut guests: Vec<Guest> = Vec::new();
    let mut tasks = JoinSet::new();
    loop {
        let (client, from) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::debug!(%error, "a viewer was not let in");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        while tasks.try_join_next().is_some() {}
        guests.retain(|guest| !guest.task.is_finished());
        if guests.len() >= limits.connections {
            // The longest idle connection is closed first, so that idle ones lock nobody out.
            let Some(idle) = guests.iter().position(|guest| guest.activity.borrow().is_idle()) else {
                tracing::debug!("a viewer was not let in: {} are served already", guests.len());
                continue;
            };
            guests.remove(idle).task.abort();
        }
        let (sender, activity) = watch::channel(Activity::default());
        let task = tasks.spawn(attend(client, from.ip(), limits, Arc::new(sender), routes.clone()));
        guests.push(Guest { task, activity });
    }
}

/// Serves a connection until it ends or is closed.
async fn attend(
    client: TcpStream,
    from: IpAddr,
    limits: Limits,
    activity: Arc<watch::Sender<Activity>>,
    routes: Router,
) {
    // Small live data should not be delayed.
    let _set = client.set_nodelay(true).is_ok();
    let given_up = is_given_up(limits, activity.subscribe());
    let watched = Watched { client, activity: Arc::clone(&activity) };
    let service = service_fn(move |request: axum::http::Request<Incoming>| {
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(Peer(from));
        let busy = Busy::new(&activity);
        let answered = tokio::time::timeout(limits.answer, routes.clone().oneshot(request));
        async move {
            let late = |_elapsed| Ok((StatusCode::REQUEST_TIMEOUT, "The request took too long.\n").into_response());
            // A request counts as being answered until the end of the answer was produced.
            answered.await.unwrap_or_else(late).map(|response| {
                response.map(|body| {
                    Body::new(body.map_frame(move |frame| {
                        let _until_then = &busy;
                        frame
                    }))
                })
            })
        }
    });
    let mut http = auto::Builder::new(TokioExecutor::new());
    http.http1().timer(TokioTimer::new()).max_buf_size(BUFFER);
    http.http2()
        .timer(TokioTimer::new())
        .keep_alive_interval(PING)
        .keep_alive_timeout(limits.stalled.saturating_sub(PING).max(PING))
        .max_concurrent_streams(STREAMS);
    tokio::select! {
        ended = http.serve_connection_with_upgrades(TokioIo::new(watched), service) => {
            if let Err(error) = ended {
                tracing::debug!(%error, "a connection of a viewer has ended");
            }
        }
        () = given_up => tracing::debug!("a connection on which nothing happened was given up"),
    }
}

/// Ends when a connection is no longer worth waiting for.
async fn is_given_up(limits: Limits, mut activity: watch::Receiver<Activity>) {
    loop {
        let now = *activity.borrow_and_update();
        let changed = activity.changed();
        let patience = match now {
            Activity { blocked: true, .. } => limits.stalled,
            Activity { requests: 0, .. } => limits.idle,
            // A live answer may last as long as the reader likes.
            _ => Duration::MAX,
        };
        match tokio::time::timeout(patience, changed).await {
            Ok(Ok(())) => {}
            // Too late, or the connection is gone already.
            Ok(Err(_)) | Err(_) => return,
        }
    }
}

/// The other end of the connection of a request.
#[derive(Debug, Clone, Copy)]
struct Peer(IpAddr);

/// The address of the client of a request.
pub fn asked_from(request: &Request) -> IpAddr {
    request.extensions().get::<Peer>().map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |peer| peer.0)
}

/// Counts a request as long as it is held.
struct Busy(Arc<watch::Sender<Activity>>);

impl Busy {
    fn new(activity: &Arc<watch::Sender<Activity>>) -> Self {
        activity.send_modify(|now| now.requests += 1);
        Self(Arc::clone(activity))
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.0.send_modify(|now| now.requests -= 1);
    }
}

/// A connection that notes when the peer does not read what is sent.
struct Watched {
    client: TcpStream,
    activity: Arc<watch::Sender<Activity>>,
}

impl Watched {
    fn noted<T>(&self, written: Poll<T>) -> Poll<T> {
        let blocked = written.is_pending();
        self.activity.send_if_modified(|now| std::mem::replace(&mut now.blocked, blocked) != blocked);
        written
    }
}

impl AsyncRead for Watched {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.client).poll_read(cx, buffer)
    }
}

impl AsyncWrite for Watched {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.client).poll_write(cx, bytes);
        self.noted(written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.client).poll_write_vectored(cx, pieces);
        self.noted(written)
    }

    fn is_write_vectored(&self) -> bool {
        self.client.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.client).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.client).poll_shutdown(cx)
    }
}

#[cfg(test)]
#[path = "door_tests.rs"]
mod tests;
