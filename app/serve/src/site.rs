//! What is served: the page, its connection, uploads and downloads.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use axum::Router;
use axum::body::Body;
use axum::extract::{self, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderValue, LOCATION,
    ORIGIN, REFERRER_POLICY, SEC_WEBSOCKET_ACCEPT, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_VERSION, SET_COOKIE, UPGRADE,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use http_body_util::BodyExt as _;
use percent_encoding::percent_decode_str;
use tokio::sync::Semaphore;
use tokio_stream::wrappers::ReceiverStream;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use super::access::{Access, Verdict};
use super::archive::{Contents, Pieces};
use super::hub::Hub;
use super::socket;
use super::upload::{UploadError, Uploads};
use handeye_http::door::asked_from;
use handeye_workbench::app::InBrowser;

/// What the browser may load and where it may connect to: this server only.
const POLICY: &str = "default-src 'none'; script-src 'self'; worker-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A header that no form of another site can send.
const OURS: &str = "x-handeye";

/// Simultaneous downloads of folders: each keeps a thread and the disk busy.
const DOWNLOADS: usize = 1;

/// Simultaneous reads of a recording. A viewer has one that lasts; most of the connections are left for pages.
const RECORDINGS: usize = 16;

/// Everything that is served.
pub struct Site {
    access: Access,
    hub: Arc<Hub>,
    shown: InBrowser,
    uploads: Arc<Uploads>,
    downloads: Arc<Semaphore>,
    recordings: Arc<Semaphore>,
}

impl Site {
    /// For a window, with uploads into a folder of the sessions.
    pub fn new(access: Access, hub: Arc<Hub>, shown: InBrowser, sessions: &Path) -> Self {
        let uploads = Arc::new(Uploads::new(sessions));
        let [downloads, recordings] = [DOWNLOADS, RECORDINGS].map(|places| Arc::new(Semaphore::new(places)));
        Self { access, hub, shown, uploads, downloads, recordings }
    }

    /// The address that the user opens.
    pub fn url(&self, address: std::net::SocketAddr) -> String {
        self.access.url(address)
    }

    /// The routes, including the recording, for those who have access.
    pub fn routes(self: Arc<Self>, recording: Router) -> Router {
        let recording = recording.layer(middleware::from_fn_with_state(Arc::clone(&self), with_a_place));
        Router::new()
            .route("/", file("text/html; charset=utf-8", include_str!("page/index.html")))
            .route("/client.js", file("text/javascript; charset=utf-8", include_str!("page/client.js")))
            .route("/painter.js", file("text/javascript; charset=utf-8", include_str!("page/painter.js")))
            .route("/style.css", file("text/css; charset=utf-8", include_str!("page/style.css")))
            .route("/icon.svg", file("image/svg+xml", include_str!("page/icon.svg")))
            .route("/socket", get(connected))
            .route("/download", get(download))
            .route("/upload/{upload}/{*name}", post(upload))
            .with_state(Arc::clone(&self))
            .merge(recording)
            .layer(middleware::from_fn_with_state(self, judged))
    }
}

/// Checks access, and tells browsers what they may do with the response.
async fn judged(State(site): State<Arc<Site>>, request: Request, next: Next) -> Response {
    let mut response = match site.access.judge(&request, asked_from(&request), Instant::now()) {
        Verdict::Enter => next.run(request).await,
        Verdict::Refuse(status, why) => (status, why).into_response(),
        Verdict::Welcome(cookie) => {
            (StatusCode::SEE_OTHER, [(SET_COOKIE, cookie.as_str()), (LOCATION, "/")]).into_response()
        }
    };
    // The viewer of recordings sets its own.
    let policy = response.headers_mut().entry(CONTENT_SECURITY_POLICY);
    policy.or_insert(HeaderValue::from_static(POLICY));
    response.headers_mut().extend([
        (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ]);
    response
}

/// Keeps a slot for a read of a recording until its end was produced.
async fn with_a_place(State(site): State<Arc<Site>>, request: Request, next: Next) -> Response {
    let Ok(place) = Arc::clone(&site.recordings).try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "The recording is read by too many already.\n").into_response();
    };
    next.run(request).await.map(|body| {
        Body::new(body.map_frame(move |frame| {
            let _until_then = &place;
            frame
        }))
    })
}

/// Turns a request into the connection of a page.
async fn connected(State(site): State<Arc<Site>>, mut request: Request) -> Response {
    let headers = request.headers();
    let says = |name, word: &str| {
        let value = headers.get(&name).and_then(|value: &HeaderValue| value.to_str().ok()).unwrap_or_default();
        value.split(',').any(|part| part.trim().eq_ignore_ascii_case(word))
    };
    let is_websocket = says(UPGRADE, "websocket") && says(CONNECTION, "upgrade") && says(SEC_WEBSOCKET_VERSION, "13");
    // Browsers send where a page is from; a client that sends nothing is not a page, and is refused.
    let is_page = headers.contains_key(ORIGIN);
    let (true, true, Some(key)) = (is_websocket, is_page, headers.get(SEC_WEBSOCKET_KEY)) else {
        return (StatusCode::BAD_REQUEST, "This is for the connection of a page.\n").into_response();
    };
    let accept = derive_accept_key(key.as_bytes());
    let name = query(&request, "page").unwrap_or_default();
    if name.is_empty() || name.len() > 64 {
        return (StatusCode::BAD_REQUEST, "The page has no name.\n").into_response();
    }
    let (hub, uploads) = (Arc::clone(&site.hub), Arc::clone(&site.uploads));
    let upgrade = hyper::upgrade::on(&mut request);
    tokio::spawn(async move {
        match upgrade.await {
            Ok(upgraded) => socket::attend(upgraded, name, hub, uploads).await,
            Err(error) => tracing::debug!(%error, "a page did not connect"),
        }
    });
    let headers = [(UPGRADE, "websocket"), (CONNECTION, "upgrade"), (SEC_WEBSOCKET_ACCEPT, accept.as_str())];
    (StatusCode::SWITCHING_PROTOCOLS, headers).into_response()
}

async fn upload(
    State(site): State<Arc<Site>>,
    extract::Path((upload, name)): extract::Path<(String, String)>,
    headers: HeaderMap,
    body: Body,
) -> Response {
    if !headers.contains_key(OURS) {
        return (StatusCode::FORBIDDEN, "Only the page uploads.\n").into_response();
    }
    match site.uploads.take(&upload, &name, body).await {
        Ok(()) => StatusCode::NO_CONTENT.into_response(),
        Err(error) => {
            tracing::warn!(%error, file = %name, "an upload was refused");
            let (status, why) = match error {
                UploadError::Name => (StatusCode::BAD_REQUEST, "The name of a file may not lead out.\n"),
                UploadError::TooMuch => (StatusCode::PAYLOAD_TOO_LARGE, "That is too much.\n"),
                UploadError::Busy => {
                    (StatusCode::SERVICE_UNAVAILABLE, "Other files are coming; try again when they are here.\n")
                }
                UploadError::Stalled => (StatusCode::REQUEST_TIMEOUT, "Nothing came of the file.\n"),
                UploadError::Io(_) => (StatusCode::INTERNAL_SERVER_ERROR, "The file could not be kept.\n"),
            };
            (status, why).into_response()
        }
    }
}

async fn download(State(site): State<Arc<Site>>, request: Request) -> Response {
    let Some(folder) = query(&request, "folder").map(PathBuf::from).filter(|folder| site.shown.reach.has(folder))
    else {
        return (StatusCode::FORBIDDEN, "This folder is not for browsers.\n").into_response();
    };
    let Ok(place) = Arc::clone(&site.downloads).try_acquire_owned() else {
        let why = "Another folder is being downloaded; try again when it is done.\n";
        return (StatusCode::SERVICE_UNAVAILABLE, why).into_response();
    };
    let name = archive_name(&folder);
    let listed = tokio::task::spawn_blocking(move || Contents::of(&folder)).await;
    let contents = match listed.map_err(std::io::Error::other).flatten() {
        Ok(contents) => contents,
        Err(error) => {
            tracing::warn!(%error, "a folder could not be downloaded");
            return (StatusCode::INTERNAL_SERVER_ERROR, "The folder could not be read.\n").into_response();
        }
    };
    let (mut pieces, taken) = Pieces::new();
    // Not waited for: it ends with the last piece, or when the receiver is gone.
    drop(tokio::task::spawn_blocking(move || {
        let _until_then = place;
        if let Err(error) = contents.write(&mut pieces) {
            tracing::debug!(%error, "a download has ended early");
            pieces.fail(error);
        }
    }));
    let attached = format!("attachment; filename=\"{name}\"");
    let headers = [(CONTENT_TYPE, "application/zip"), (CONTENT_DISPOSITION, attached.as_str())];
    (headers, Body::from_stream(ReceiverStream::new(taken))).into_response()
}

/// The name of a folder's archive, with letters that every system accepts.
fn archive_name(folder: &Path) -> String {
    let parent = folder.parent().and_then(Path::file_name);
    let parts = parent.into_iter().chain(folder.file_name()).map(|part| part.to_string_lossy().into_owned());
    let name = parts.collect::<Vec<_>>().join("-");
    let safe = |letter: char| if letter.is_ascii_alphanumeric() || "-_.".contains(letter) { letter } else { '_' };
    format!("{}.zip", name.chars().map(safe).collect::<String>())
}

fn query(request: &Request, wanted: &str) -> Option<String> {
    let pairs = request.uri().query()?.split('&').filter_map(|pair| pair.split_once('='));
    let value = pairs.into_iter().find(|(name, _)| *name == wanted)?.1;
    Some(percent_decode_str(value).decode_utf8().ok()?.into_owned())
}

fn file<S: Clone + Send + Sync + 'static>(kind: &'static str, text: &'static str) -> axum::routing::MethodRouter<S> {
    get(move || async move { ([(CONTENT_TYPE, kind)], text) })
}
