//! The page with the web viewer. It is embedded in this program and uses no other server: what it may load and where it may
//! connect to is in the policy that is sent along, which the browser enforces.

use std::io;
use std::sync::Arc;

use axum::body::Bytes;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse as _, Response};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use re_web_viewer_server::WebViewerData;

use handeye_workbench::recording::BROWSER_PATH;

/// The header that the viewer's page reads its progress from.
const FINAL_LENGTH: HeaderName = HeaderName::from_static("rerun-final-length");

/// What the browser may load and where it may connect to: the server of this page only.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
     img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' data: blob:; worker-src 'self' blob:; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);

/// What need not be encoded in the query of an address.
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// What is served.
pub(super) struct Files {
    viewer: Arc<WebViewerData>,
    index: Bytes,
}

/// A part of the viewer: it is embedded in the program and is not copied for a browser.
struct Part(Arc<WebViewerData>, fn(&WebViewerData) -> &[u8]);

impl AsRef<[u8]> for Part {
    fn as_ref(&self) -> &[u8] {
        self.1(&self.0)
    }
}

impl Files {
    /// The viewer.
    ///
    /// # Errors
    /// When this build does not contain it.
    pub(super) fn load() -> io::Result<Self> {
        let viewer = WebViewerData::load(None).map_err(io::Error::other)?;
        let index = without_foreign_links(&String::from_utf8_lossy(viewer.index_html())).into();
        Ok(Self { viewer: Arc::new(viewer), index })
    }

    /// A file of the viewer; the page itself has no name.
    pub(super) fn answer(&self, uri: &Uri) -> Response {
        let part = |part: fn(&WebViewerData) -> &[u8]| Bytes::from_owner(Part(Arc::clone(&self.viewer), part));
        let (kind, body) = match uri.path().strip_prefix(BROWSER_PATH).unwrap_or_default() {
            "" | "index.html" => ("text/html; charset=utf-8", self.index.clone()),
            "favicon.ico" => ("image/x-icon", part(WebViewerData::favicon)),
            "apple-touch-icon.png" => ("image/png", part(WebViewerData::apple_touch_icon)),
            "re_viewer.js" => ("text/javascript", part(WebViewerData::viewer_js)),
            "re_viewer_bg.wasm" => ("application/wasm", part(WebViewerData::viewer_wasm)),
            _ => return (StatusCode::NOT_FOUND, "not here\n").into_response(),
        };
        let headers = [
            (CONTENT_TYPE, HeaderValue::from_static(kind)),
            (FINAL_LENGTH, HeaderValue::from(body.len())),
            (CONTENT_SECURITY_POLICY, POLICY),
            (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
            (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
            (CACHE_CONTROL, HeaderValue::from_static("no-store")),
        ];
        (headers, body).into_response()
    }
}

/// The page requests a font from another server; it looks the same without.
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
    utf8_percent_encode(value, ESCAPED).to_string()
}
