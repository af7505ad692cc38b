//! What is served: the page, its connection, uploads and downloads.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use futures_util::StreamExt as _;
use http_body_util::{BodyExt as _, Full, StreamBody};
use hyper::body::{Bytes, Frame, Incoming};
use hyper::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderValue, LOCATION,
    REFERRER_POLICY, SEC_WEBSOCKET_ACCEPT, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_VERSION, SET_COOKIE, UPGRADE,
    X_CONTENT_TYPE_OPTIONS,
};
use hyper::{Method, Request, Response, StatusCode};
use percent_encoding::percent_decode_str;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_stream::wrappers::ReceiverStream;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;
use tonic::body::Body;

use super::access::{Access, Verdict};
use super::archive::{Contents, Pieces};
use super::hub::Hub;
use super::socket;
use super::upload::{UploadError, Uploads};
use handeye_http::door::{asked_from, plain};
use handeye_record::Relay;
use handeye_workbench::app::InBrowser;

/// What the browser may load and where it may connect to: this server, and nothing else.
const POLICY: &str = "default-src 'none'; script-src 'self'; worker-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A header that no form of another site can send.
const OURS: &str = "x-handeye";

/// Folders that are downloaded at a time: each keeps a thread and the disk busy.
const DOWNLOADS: usize = 1;

/// What is read of a recording at a time. A viewer has two that last; of the connections most are left for pages.
const RECORDINGS: usize = 16;

/// All that is served.
pub struct Site {
    access: Access,
    hub: Arc<Hub>,
    shown: InBrowser,
    recording: Arc<Relay>,
    uploads: Arc<Uploads>,
    downloads: Arc<Semaphore>,
    recordings: Arc<Semaphore>,
}

impl Site {
    /// For a window and its recording, with uploads into a folder of the sessions.
    pub fn new(access: Access, hub: Arc<Hub>, shown: InBrowser, recording: Arc<Relay>, sessions: &Path) -> Self {
        let uploads = Arc::new(Uploads::new(sessions));
        let [downloads, recordings] = [DOWNLOADS, RECORDINGS].map(|places| Arc::new(Semaphore::new(places)));
        Self { access, hub, shown, recording, uploads, downloads, recordings }
    }

    /// What a person opens.
    pub fn url(&self, address: std::net::SocketAddr) -> String {
        self.access.url(address)
    }

    /// Answers a request.
    pub async fn answer(&self, request: Request<Incoming>) -> Response<Body> {
        let mut response = match self.access.judge(&request, asked_from(&request), Instant::now()) {
            Verdict::Enter => self.enter(request).await,
            Verdict::Refuse(status, why) => plain(status, why),
            Verdict::Welcome(cookie) => {
                let mut response = plain(StatusCode::SEE_OTHER, "");
                if let Ok(cookie) = HeaderValue::from_str(&cookie) {
                    response.headers_mut().insert(SET_COOKIE, cookie);
                }
                response.headers_mut().insert(LOCATION, HeaderValue::from_static("/"));
                response
            }
        };
        // The viewer of recordings brings its own.
        let policy = response.headers_mut().entry(CONTENT_SECURITY_POLICY);
        policy.or_insert(HeaderValue::from_static(POLICY));
        response.headers_mut().extend([
            (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
            (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
            (CACHE_CONTROL, HeaderValue::from_static("no-store")),
        ]);
        response
    }

    async fn enter(&self, request: Request<Incoming>) -> Response<Body> {
        if Relay::is_for(&request) {
            let Ok(place) = Arc::clone(&self.recordings).try_acquire_owned() else {
                return plain(StatusCode::SERVICE_UNAVAILABLE, "The recording is read by too many already.\n");
            };
            return until_its_end(self.recording.answer(request).await, place);
        }
        let path = request.uri().path().to_owned();
        match (request.method(), path.as_str()) {
            (&Method::GET, "/") => file("text/html; charset=utf-8", include_str!("page/index.html")),
            (&Method::GET, "/client.js") => file("text/javascript; charset=utf-8", include_str!("page/client.js")),
            (&Method::GET, "/painter.js") => file("text/javascript; charset=utf-8", include_str!("page/painter.js")),
            (&Method::GET, "/style.css") => file("text/css; charset=utf-8", include_str!("page/style.css")),
            (&Method::GET, "/icon.svg") => file("image/svg+xml", include_str!("page/icon.svg")),
            (&Method::GET, "/socket") => self.socket(request),
            (&Method::GET, "/download") => self.download(&request).await,
            (&Method::POST, path) if path.starts_with("/upload/") => self.upload(path, request).await,
            (&Method::GET, _) => plain(StatusCode::NOT_FOUND, "There is nothing here.\n"),
            _ => plain(StatusCode::METHOD_NOT_ALLOWED, "This cannot be done here.\n"),
        }
    }

    /// Makes the connection of a page out of a request.
    fn socket(&self, mut request: Request<Incoming>) -> Response<Body> {
        let headers = request.headers();
        let says = |name, word: &str| {
            let value = headers.get(&name).and_then(|value: &HeaderValue| value.to_str().ok()).unwrap_or_default();
            value.split(',').any(|part| part.trim().eq_ignore_ascii_case(word))
        };
        let is_websocket =
            says(UPGRADE, "websocket") && says(CONNECTION, "upgrade") && says(SEC_WEBSOCKET_VERSION, "13");
        // Browsers say where a page is from; who says nothing is no page, and has no business here either.
        let is_page = headers.contains_key(hyper::header::ORIGIN);
        let (true, true, Some(key)) = (is_websocket, is_page, headers.get(SEC_WEBSOCKET_KEY)) else {
            return plain(StatusCode::BAD_REQUEST, "This is for the connection of a page.\n");
        };
        let Ok(accept) = HeaderValue::from_str(&derive_accept_key(key.as_bytes())) else {
            return plain(StatusCode::BAD_REQUEST, "This is for the connection of a page.\n");
        };
        let name = query(&request, "page").unwrap_or_default();
        if name.is_empty() || name.len() > 64 {
            return plain(StatusCode::BAD_REQUEST, "The page has no name.\n");
        }
        let (hub, uploads) = (Arc::clone(&self.hub), Arc::clone(&self.uploads));
        let upgrade = hyper::upgrade::on(&mut request);
        tokio::spawn(async move {
            match upgrade.await {
                Ok(upgraded) => socket::attend(upgraded, name, hub, uploads).await,
                Err(error) => tracing::debug!(%error, "a page did not connect"),
            }
        });
        let mut response = Response::new(Body::empty());
        *response.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
        response.headers_mut().extend([
            (UPGRADE, HeaderValue::from_static("websocket")),
            (CONNECTION, HeaderValue::from_static("upgrade")),
            (SEC_WEBSOCKET_ACCEPT, accept),
        ]);
        response
    }

    async fn upload(&self, path: &str, request: Request<Incoming>) -> Response<Body> {
        if !request.headers().contains_key(OURS) {
            return plain(StatusCode::FORBIDDEN, "Only the page uploads.\n");
        }
        let rest = path.strip_prefix("/upload/").unwrap_or_default();
        let Some((upload, name)) = rest.split_once('/') else {
            return plain(StatusCode::BAD_REQUEST, "A file has a name.\n");
        };
        let Ok(name) = percent_decode_str(name).decode_utf8() else {
            return plain(StatusCode::BAD_REQUEST, "A name is in UTF-8.\n");
        };
        match self.uploads.take(upload, &name, request.into_body()).await {
            Ok(()) => plain(StatusCode::NO_CONTENT, ""),
            Err(error) => {
                tracing::warn!(%error, file = %name, "an upload was refused");
                match error {
                    UploadError::Name => plain(StatusCode::BAD_REQUEST, "The name of a file may not lead out.\n"),
                    UploadError::TooMuch => plain(StatusCode::PAYLOAD_TOO_LARGE, "That is too much.\n"),
                    UploadError::Busy => plain(
                        StatusCode::SERVICE_UNAVAILABLE,
                        "Other files are coming; try again when they are here.\n",
                    ),
                    UploadError::Stalled => plain(StatusCode::REQUEST_TIMEOUT, "Nothing came of the file.\n"),
                    UploadError::Io(_) => plain(StatusCode::INTERNAL_SERVER_ERROR, "The file could not be kept.\n"),
                }
            }
        }
    }

    async fn download(&self, request: &Request<Incoming>) -> Response<Body> {
        let Some(folder) = query(request, "folder").map(PathBuf::from).filter(|folder| self.shown.reach.has(folder))
        else {
            return plain(StatusCode::FORBIDDEN, "This folder is not for browsers.\n");
        };
        let Ok(place) = Arc::clone(&self.downloads).try_acquire_owned() else {
            let why = "Another folder is being downloaded; try again when it is done.\n";
            return plain(StatusCode::SERVICE_UNAVAILABLE, why);
        };
        let name = archive_name(&folder);
        let listed = tokio::task::spawn_blocking(move || Contents::of(&folder)).await;
        let contents = match listed.map_err(std::io::Error::other).flatten() {
            Ok(contents) => contents,
            Err(error) => {
                tracing::warn!(%error, "a folder could not be downloaded");
                return plain(StatusCode::INTERNAL_SERVER_ERROR, "The folder could not be read.\n");
            }
        };
        let (mut pieces, taken) = Pieces::new();
        // Not waited for: it ends with the last piece, or when nobody takes any more.
        drop(tokio::task::spawn_blocking(move || {
            let _until_then = place;
            if let Err(error) = contents.write(&mut pieces) {
                tracing::debug!(%error, "a download has ended early");
                pieces.fail(error);
            }
        }));
        let frames = ReceiverStream::new(taken).map(|piece| piece.map(Frame::data));
        let mut response = Response::new(Body::new(StreamBody::new(frames.boxed())));
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/zip"));
        if let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{name}\"")) {
            headers.insert(CONTENT_DISPOSITION, value);
        }
        response
    }
}

/// Keeps a place until the last of an answer was made.
fn until_its_end(response: Response<Body>, place: OwnedSemaphorePermit) -> Response<Body> {
    response.map(|body| {
        Body::new(body.map_frame(move |frame| {
            let _until_then = &place;
            frame
        }))
    })
}

/// The name of a folder's archive, with letters that every system takes.
fn archive_name(folder: &Path) -> String {
    let parent = folder.parent().and_then(Path::file_name);
    let parts = parent.into_iter().chain(folder.file_name()).map(|part| part.to_string_lossy().into_owned());
    let name = parts.collect::<Vec<_>>().join("-");
    let safe = |letter: char| if letter.is_ascii_alphanumeric() || "-_.".contains(letter) { letter } else { '_' };
    format!("{}.zip", name.chars().map(safe).collect::<String>())
}

fn query<B>(request: &Request<B>, wanted: &str) -> Option<String> {
    let pairs = request.uri().query()?.split('&').filter_map(|pair| pair.split_once('='));
    let value = pairs.into_iter().find(|(name, _)| *name == wanted)?.1;
    Some(percent_decode_str(value).decode_utf8().ok()?.into_owned())
}

fn file(kind: &'static str, text: &'static str) -> Response<Body> {
    let mut response = Response::new(Body::new(Full::new(Bytes::from_static(text.as_bytes()))));
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}
