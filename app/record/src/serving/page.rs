//! The page with the web viewer. It comes out of this program, for this machine only, and asks nobody else for anything:
//! what it loads and where it connects to is in the policy that is sent along, and the browser sees to it.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io;
use std::sync::Arc;

use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{
    CACHE_CONTROL, CONTENT_LENGTH, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use hyper::{Method, Response, StatusCode};
use re_web_viewer_server::WebViewerData;
use tonic::body::Body;

use super::Engine;
use handeye_http::door::{Door, Limits, plain};

/// What the viewer's page reads its progress from.
const FINAL_LENGTH: HeaderName = HeaderName::from_static("rerun-final-length");

/// The server of the page; it ends when this is dropped.
pub struct Page {
    url: String,
    _door: Door,
    _engine: Arc<Engine>,
}

/// What is served.
pub(super) struct Files {
    viewer: Arc<WebViewerData>,
    index: Bytes,
    policy: HeaderValue,
}

/// A part of the viewer: it stands in the program itself and is not copied for a browser.
struct Part(Arc<WebViewerData>, fn(&WebViewerData) -> &[u8]);

impl AsRef<[u8]> for Part {
    fn as_ref(&self) -> &[u8] {
        self.1(&self.0)
    }
}

impl Page {
    /// Serves the viewer on a free port of 127.0.0.1; it reads the recording from these addresses.
    ///
    /// # Errors
    /// When there is no port.
    pub(super) fn start(engine: &Arc<Engine>, urls: &[String]) -> io::Result<Self> {
        let files = Arc::new(Files::load(urls)?);
        let door = Door::open(engine.handle()?, Limits::USUAL, move |request| {
            let answer = files.answer(request.method(), request.uri().path());
            async move { answer }
        })?;
        let mut url = format!("http://{}/?hide_welcome_screen=1", door.address());
        for source in urls {
            url.push_str("&url=");
            url.push_str(&encoded(source));
        }
        Ok(Self { url, _door: door, _engine: Arc::clone(engine) })
    }

    /// What to open in a browser.
    pub fn url(&self) -> &str {
        &self.url
    }
}

impl Files {
    /// The viewer, which may read recordings from these addresses and from where it comes from itself.
    pub(super) fn load(urls: &[String]) -> io::Result<Self> {
        let viewer = WebViewerData::load(None).map_err(io::Error::other)?;
        let index = without_foreign_links(&String::from_utf8_lossy(viewer.index_html())).into();
        let policy = HeaderValue::from_str(&policy(urls)).map_err(io::Error::other)?;
        Ok(Self { viewer: Arc::new(viewer), index, policy })
    }

    pub(super) fn answer(&self, method: &Method, path: &str) -> Response<Body> {
        if !matches!(*method, Method::GET | Method::HEAD) {
            return plain(StatusCode::METHOD_NOT_ALLOWED, "only GET\n");
        }
        let part = |part: fn(&WebViewerData) -> &[u8]| Bytes::from_owner(Part(Arc::clone(&self.viewer), part));
        let (kind, body) = match path {
            "/" | "/index.html" => ("text/html; charset=utf-8", self.index.clone()),
            "/favicon.ico" => ("image/x-icon", part(WebViewerData::favicon)),
            "/apple-touch-icon.png" => ("image/png", part(WebViewerData::apple_touch_icon)),
            "/re_viewer.js" => ("text/javascript", part(WebViewerData::viewer_js)),
            "/re_viewer_bg.wasm" => ("application/wasm", part(WebViewerData::viewer_wasm)),
            _ => return plain(StatusCode::NOT_FOUND, "not here\n"),
        };
        let length = HeaderValue::from(body.len());
        let body = if *method == Method::HEAD { Body::empty() } else { Body::new(Full::new(body)) };
        let mut response = Response::new(body);
        response.headers_mut().extend([
            (CONTENT_TYPE, HeaderValue::from_static(kind)),
            (CONTENT_LENGTH, length.clone()),
            (FINAL_LENGTH, length),
            (CONTENT_SECURITY_POLICY, self.policy.clone()),
            (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
            (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
            (CACHE_CONTROL, HeaderValue::from_static("no-store")),
        ]);
        response
    }
}

/// What the browser may load and where it may connect to: this page, and the servers of the recording.
fn policy(urls: &[String]) -> String {
    let servers = urls.iter().filter_map(|url| {
        let rest = url.strip_prefix("rerun+")?;
        rest.strip_suffix("/proxy").map(|origin| format!(" {origin}"))
    });
    let servers: String = servers.collect();
    format!(
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
         img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' data: blob:{servers}; worker-src 'self' \
         blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
}

/// The page asks for a font elsewhere; it looks the same without.
fn without_foreign_links(html: &str) -> String {
    let mut kept = String::with_capacity(html.len());
    let mut rest = html;
    while let Some(at) = rest.find("<link") {
        let length = rest[at..].find('>').map_or(rest.len() - at, |end| end + 1);
        let (before, link, after) = (&rest[..at], &rest[at..at + length], &rest[at + length..]);
        kept.push_str(before);
        if !link.contains("://") {
            kept.push_str(link);
        }
        rest = after;
    }
    kept.push_str(rest);
    kept
}

/// As a value in the query of an address.
pub(super) fn encoded(value: &str) -> String {
    let encode = |byte: u8| -> Cow<'static, str> {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string().into(),
            _ => {
                let mut code = String::new();
                // Writing to a string cannot fail.
                let _written = write!(code, "%{byte:02X}").is_ok();
                code.into()
            }
        }
    };
    value.bytes().map(encode).collect()
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;

    use super::*;

    fn page(urls: &[String]) -> Page {
        Page::start(&Arc::new(Engine::start().expect("threads")), urls).expect("a page")
    }

    fn get(page: &Page, path: &str) -> String {
        let address = page.url().strip_prefix("http://").and_then(|rest| rest.split('/').next()).expect("an address");
        let mut client = TcpStream::connect(address).expect("the page listens");
        let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        client.write_all(request.as_bytes()).expect("sent");
        let mut answer = Vec::new();
        client.read_to_end(&mut answer).expect("an answer");
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn the_page_names_no_other_machine_and_forbids_the_browser_to_ask_one() {
        let page = page(&["rerun+http://127.0.0.1:9876/proxy".to_owned()]);
        assert!(page.url().starts_with("http://127.0.0.1:"), "{}", page.url());
        assert!(page.url().ends_with("&url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9876%2Fproxy"), "{}", page.url());
        let index = get(&page, "/?url=x");
        let (head, html) = index.split_once("\r\n\r\n").expect("head and body");
        assert!(head.starts_with("HTTP/1.1 200"), "{head}");
        let head = head.to_ascii_lowercase();
        assert!(head.contains("default-src 'none'"), "{head}");
        assert!(head.contains("connect-src 'self' data: blob: http://127.0.0.1:9876;"), "{head}");
        assert!(html.contains("the_canvas_id") && html.contains("favicon.ico"));
        assert!(!html.contains("fonts.g"), "fonts are asked for elsewhere");
    }

    #[test]
    fn files_of_the_viewer_come_whole_and_others_are_not_there() {
        let page = page(&[]);
        let wasm = get(&page, "/re_viewer_bg.wasm");
        assert!(wasm.contains("application/wasm") && wasm.len() > 1_000_000, "{} bytes", wasm.len());
        for path in ["/../Cargo.toml", "/etc/passwd", "/sw.js"] {
            assert!(get(&page, path).starts_with("HTTP/1.1 404"), "{path}");
        }
    }
}
