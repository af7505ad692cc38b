//! `handeye serve` as a program of its own, and pages that are not browsers.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;

/// Longer than anything takes on a busy machine.
pub const SOON: Duration = Duration::from_mins(2);

/// The served workbench; it ends when it is dropped.
pub struct Served {
    /// Its process.
    pub child: Child,
    /// Where it listens.
    pub address: String,
    /// The same with the key, where there is one.
    pub url: String,
    _home: tempfile::TempDir,
}

impl Served {
    /// Starts it with these arguments, without any user's settings.
    ///
    /// # Panics
    /// When it does not start.
    pub fn start(arguments: &[&str]) -> Self {
        let home = tempfile::tempdir().expect("a folder");
        let mut child = Command::new(crate::handeye_binary())
            .args(["serve", "--quiet", "--port", "0", "--rerun", "off"])
            .args(arguments)
            .env("RUST_LOG", "warn,re_=error")
            .env("HOME", home.path())
            .env("XDG_CONFIG_HOME", home.path().join("config"))
            .env("XDG_DATA_HOME", home.path().join("data"))
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("its output")).read_line(&mut line).expect("a line");
        let url = line.trim().strip_prefix("the workbench is at ").expect("an address").to_owned();
        let port = url.trim_start_matches("http://").split('/').next().and_then(|host| host.rsplit(':').next());
        let address = format!("127.0.0.1:{}", port.expect("a port"));
        Self { child, address, url, _home: home }
    }

    /// The head of the answer to a request.
    ///
    /// # Panics
    /// When nobody listens.
    pub fn ask(&self, request: &str) -> String {
        let mut socket = TcpStream::connect(&self.address).expect("it listens");
        socket.set_read_timeout(Some(SOON)).expect("set");
        socket.write_all(request.replace("ADDRESS", &self.address).as_bytes()).expect("sent");
        let mut answer = Vec::new();
        let mut piece = [0; 4096];
        while !String::from_utf8_lossy(&answer).contains("\r\n\r\n") {
            match socket.read(&mut piece) {
                Ok(count) if count > 0 => answer.extend_from_slice(&piece[..count]),
                _ => break,
            }
        }
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// A page of it, by its name.
    ///
    /// # Panics
    /// When access is refused.
    pub fn page(&self, name: &str) -> tungstenite::WebSocket<TcpStream> {
        let mut request = format!("ws://{}/socket?page={name}", self.address).into_client_request().expect("a request");
        let origin = HeaderValue::from_str(&format!("http://{}", self.address)).expect("a header");
        request.headers_mut().insert("origin", origin);
        let stream = TcpStream::connect(&self.address).expect("it listens");
        stream.set_read_timeout(Some(SOON)).expect("set");
        tungstenite::client(request, stream).expect("a page").0
    }

    /// Memory that it uses \[MB\].
    ///
    /// # Panics
    /// When it has ended.
    pub fn megabytes(&self) -> f64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("it runs");
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).expect("its memory");
        line.split_whitespace().nth(1).and_then(|kilobytes| kilobytes.parse::<f64>().ok()).expect("a number") / 1024.0
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ended = self.child.kill().and_then(|()| self.child.wait()).is_ok();
    }
}

/// Reads until a frame has arrived, and reports that it is shown.
///
/// # Panics
/// When the connection ends.
pub fn frame(page: &mut tungstenite::WebSocket<TcpStream>) -> u64 {
    loop {
        let Message::Binary(bytes) = page.read().expect("an answer") else { continue };
        let end = 4 + u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
        let head: Value = serde_json::from_slice(&bytes[4..end]).expect("JSON");
        let number = head["number"].as_u64().expect("a number");
        page.send(Message::text(json!({"t": "shown", "number": number}).to_string())).expect("sent");
        return number;
    }
}
