//! The page with the web viewer. It comes out of this program, for this machine only, and asks nobody else for anything:
//! what it loads and where it connects to is in the policy that is sent along, and the browser sees to it.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;
use std::time::Duration;

use re_web_viewer_server::WebViewerData;

/// Longest request that is read [bytes].
const MAX_REQUEST: usize = 16 * 1024;

/// A browser that sends or takes nothing for so long is given up.
const PATIENCE: Duration = Duration::from_secs(20);

/// The server of the page; it ends when this is dropped.
pub struct Page {
    url: String,
    address: SocketAddr,
    ended: Arc<AtomicBool>,
}

/// What is served.
struct Files {
    viewer: WebViewerData,
    index: String,
    policy: String,
}

impl Page {
    /// Serves the viewer on a free port of 127.0.0.1; it reads the recording from these addresses.
    ///
    /// # Errors
    /// When there is no port or no thread.
    pub fn start(urls: &[String]) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let viewer = WebViewerData::load(None).map_err(io::Error::other)?;
        let index = without_foreign_links(&String::from_utf8_lossy(viewer.index_html()));
        let files = Arc::new(Files { viewer, index, policy: policy(urls) });
        let ended = Arc::new(AtomicBool::new(false));
        let over = Arc::clone(&ended);
        Builder::new().name("rerun-page".to_owned()).spawn(move || {
            for client in listener.incoming() {
                if over.load(Ordering::Relaxed) {
                    return;
                }
                let Ok(client) = client else { continue };
                let files = Arc::clone(&files);
                // A browser asks for a handful of files, each over a line of its own.
                let answering = Builder::new().name("rerun-page-file".to_owned()).spawn(move || {
                    if let Err(error) = files.answer(client) {
                        tracing::debug!(%error, "a file of the web viewer was not sent");
                    }
                });
                if let Err(error) = answering {
                    tracing::warn!(%error, "a file of the web viewer was not sent");
                }
            }
        })?;
        let mut url = format!("http://{address}/?hide_welcome_screen=1");
        for source in urls {
            url.push_str("&url=");
            url.push_str(&encoded(source));
        }
        Ok(Self { url, address, ended })
    }

    /// What to open in a browser.
    pub fn url(&self) -> &str {
        &self.url
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        // Wakes the thread that waits for browsers.
        let _woken = TcpStream::connect(self.address).is_ok();
    }
}

impl Files {
    fn answer(&self, mut client: TcpStream) -> io::Result<()> {
        client.set_read_timeout(Some(PATIENCE))?;
        client.set_write_timeout(Some(PATIENCE))?;
        let request = read_request(&mut client)?;
        let mut words = request.split_whitespace();
        let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        let path = target.split('?').next().unwrap_or_default();
        let found = match path {
            "/" | "/index.html" => Some(("text/html; charset=utf-8", self.index.as_bytes())),
            "/favicon.ico" => Some(("image/x-icon", self.viewer.favicon())),
            "/apple-touch-icon.png" => Some(("image/png", self.viewer.apple_touch_icon())),
            "/re_viewer.js" => Some(("text/javascript", self.viewer.viewer_js())),
            "/re_viewer_bg.wasm" => Some(("application/wasm", self.viewer.viewer_wasm())),
            _ => None,
        };
        let (status, (kind, body)) = match (method, found) {
            ("GET" | "HEAD", Some(found)) => ("200 OK", found),
            ("GET" | "HEAD", None) => ("404 Not Found", ("text/plain", &b"not here"[..])),
            _ => ("405 Method Not Allowed", ("text/plain", &b"only GET"[..])),
        };
        // `rerun-final-length` is what the viewer's page reads its progress from.
        let head = format!(
            "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nrerun-final-length: {length}\r\n\
             Content-Security-Policy: {policy}\r\nReferrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\
             Cache-Control: no-store\r\nConnection: close\r\n\r\n",
            length = body.len(),
            policy = self.policy,
        );
        client.write_all(head.as_bytes())?;
        if method != "HEAD" {
            client.write_all(body)?;
        }
        client.flush()
    }
}

/// The head of a request.
fn read_request(client: &mut TcpStream) -> io::Result<String> {
    let mut request = Vec::new();
    let mut piece = [0; 1024];
    while !request.windows(4).any(|four| four == b"\r\n\r\n") {
        let count = client.read(&mut piece)?;
        if count == 0 || request.len() > MAX_REQUEST {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "no request"));
        }
        request.extend_from_slice(&piece[..count]);
    }
    Ok(String::from_utf8_lossy(&request).into_owned())
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
         blob:; base-uri 'none'; form-action 'none'"
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
fn encoded(value: &str) -> String {
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
    use super::*;

    fn get(page: &Page, path: &str) -> String {
        let mut client = TcpStream::connect(page.address).expect("the page listens");
        client.write_all(format!("GET {path} HTTP/1.1\r\nHost: here\r\n\r\n").as_bytes()).expect("sent");
        let mut answer = Vec::new();
        client.read_to_end(&mut answer).expect("an answer");
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn the_page_names_no_other_machine_and_forbids_the_browser_to_ask_one() {
        let page = Page::start(&["rerun+http://127.0.0.1:9876/proxy".to_owned()]).expect("a page");
        assert!(page.address.ip().is_loopback());
        assert!(page.url().ends_with("&url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9876%2Fproxy"), "{}", page.url());
        let index = get(&page, "/?url=x");
        let (head, html) = index.split_once("\r\n\r\n").expect("head and body");
        assert!(head.starts_with("HTTP/1.1 200"), "{head}");
        assert!(head.contains("default-src 'none'"), "{head}");
        assert!(head.contains("connect-src 'self' data: blob: http://127.0.0.1:9876;"), "{head}");
        assert!(html.contains("the_canvas_id") && html.contains("favicon.ico"));
        assert!(!html.contains("fonts.g"), "fonts are asked for elsewhere");
    }

    #[test]
    fn files_of_the_viewer_come_whole_and_others_are_not_there() {
        let page = Page::start(&[]).expect("a page");
        let wasm = get(&page, "/re_viewer_bg.wasm");
        assert!(wasm.contains("application/wasm") && wasm.len() > 1_000_000, "{} bytes", wasm.len());
        for path in ["/../Cargo.toml", "/etc/passwd", "/sw.js"] {
            assert!(get(&page, path).starts_with("HTTP/1.1 404"), "{path}");
        }
    }
}
