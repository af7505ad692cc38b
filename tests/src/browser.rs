//! A real browser (headless Chromium), controlled over its DevTools protocol: pages, mouse, fingers, keys and images.

use std::cell::RefCell;
use std::io::{BufRead as _, BufReader, Read as _};
use std::net::TcpStream;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// Longest wait for an answer, on a busy machine.
const PATIENCE: Duration = Duration::from_mins(10);

/// A browser; it ends when it is dropped.
pub struct Browser {
    child: Child,
    devtools: RefCell<DevTools>,
    _profile: tempfile::TempDir,
}

struct DevTools {
    socket: WebSocket<TcpStream>,
    calls: u64,
    /// What the pages wrote to their consoles.
    reported: Vec<String>,
}

/// A page that is open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tab {
    session: String,
    target: String,
}

impl Browser {
    /// Starts it with a profile of its own.
    ///
    /// # Panics
    /// When it does not start.
    pub fn start() -> Self {
        let profile = tempfile::tempdir().expect("a folder");
        let mut child = Command::new("chromium")
            .args(["--headless=new", "--no-sandbox", "--no-first-run", "--disable-quic", "--remote-debugging-port=0"])
            .args(["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            // A page that is not visible on this machine may be in use.
            .args(["--disable-background-timer-throttling", "--disable-renderer-backgrounding"])
            .args(["--disable-backgrounding-occluded-windows"])
            .args(["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // All its processes can be stopped at once.
            .process_group(0)
            .spawn()
            .expect("chromium starts");
        let mut stderr = BufReader::new(child.stderr.take().expect("its messages"));
        let mut line = String::new();
        let url = loop {
            line.clear();
            assert!(stderr.read_line(&mut line).is_ok_and(|bytes| bytes > 0), "chromium has ended");
            if let Some(url) = line.trim().strip_prefix("DevTools listening on ") {
                break url.to_owned();
            }
        };
        std::thread::spawn(move || stderr.read_to_end(&mut Vec::new()));
        let address = url.strip_prefix("ws://").and_then(|rest| rest.split('/').next()).expect("an address");
        let stream = TcpStream::connect(address).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("set");
        let (socket, _) = tungstenite::client(url.as_str(), stream).expect("a connection");
        let devtools = RefCell::new(DevTools { socket, calls: 0, reported: Vec::new() });
        Self { child, devtools, _profile: profile }
    }

    /// Opens a page of a size in points. With `touch` it is one of a tablet.
    ///
    /// # Panics
    /// When the browser refuses.
    pub fn open(&self, url: &str, (width, height): (u32, u32), touch: bool) -> Tab {
        let made = self.call(None, "Target.createTarget", &json!({"url": "about:blank", "newWindow": true}));
        let target = made["targetId"].as_str().expect("a page").to_owned();
        let attached = self.call(None, "Target.attachToTarget", &json!({"targetId": target, "flatten": true}));
        let tab = Tab { session: attached["sessionId"].as_str().expect("a session").to_owned(), target };
        self.call(Some(&tab), "Runtime.enable", &json!({}));
        self.call(Some(&tab), "Page.enable", &json!({}));
        let screen = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": touch});
        self.call(Some(&tab), "Emulation.setDeviceMetricsOverride", &screen);
        if touch {
            self.call(Some(&tab), "Emulation.setTouchEmulationEnabled", &json!({"enabled": true, "maxTouchPoints": 5}));
        }
        self.call(Some(&tab), "Page.navigate", &json!({"url": url}));
        tab
    }

    /// Closes a page.
    pub fn close(&self, tab: &Tab) {
        self.call(None, "Target.closeTarget", &json!({"targetId": tab.target}));
    }

    /// The value of an expression in a page; a promise is awaited.
    ///
    /// # Panics
    /// When it throws.
    pub fn evaluate(&self, tab: &Tab, expression: &str) -> Value {
        let what = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let answer = self.call(Some(tab), "Runtime.evaluate", &what);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true in a page.
    ///
    /// # Panics
    /// When it does not become true.
    pub fn until(&self, tab: &Tab, expression: &str) {
        let deadline_ms = PATIENCE.as_millis() / 2;
        let waits = format!(
            "new Promise((resolve) => {{
                const began = performance.now();
                const look = () => {{
                    let is = false;
                    try {{ is = Boolean({expression}); }} catch {{ }}
                    if (is || performance.now() - began > {deadline_ms}) resolve(is); else setTimeout(look, 20);
                }};
                look();
            }})"
        );
        assert_eq!(self.evaluate(tab, &waits), Value::Bool(true), "waiting for {expression}");
    }

    /// Presses and releases the mouse.
    pub fn click(&self, tab: &Tab, place: (f64, f64)) {
        self.point(tab, place);
        self.mouse(tab, "mousePressed", place);
        self.mouse(tab, "mouseReleased", place);
    }

    /// Presses the mouse and holds it.
    pub fn hold(&self, tab: &Tab, place: (f64, f64)) {
        self.point(tab, place);
        self.mouse(tab, "mousePressed", place);
    }

    /// Releases the mouse.
    pub fn let_go(&self, tab: &Tab, place: (f64, f64)) {
        self.mouse(tab, "mouseReleased", place);
    }

    /// Moves the mouse.
    pub fn point(&self, tab: &Tab, place: (f64, f64)) {
        self.mouse(tab, "mouseMoved", place);
    }

    fn mouse(&self, tab: &Tab, kind: &str, (x, y): (f64, f64)) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        let event = json!({"type": kind, "x": x, "y": y, "button": button, "clickCount": 1});
        self.call(Some(tab), "Input.dispatchMouseEvent", &event);
    }

    /// Touches a place and lifts the finger.
    pub fn tap(&self, tab: &Tab, (x, y): (f64, f64)) {
        let finger = json!({"type": "touchStart", "touchPoints": [{"x": x, "y": y}]});
        self.call(Some(tab), "Input.dispatchTouchEvent", &finger);
        self.call(Some(tab), "Input.dispatchTouchEvent", &json!({"type": "touchEnd", "touchPoints": []}));
    }

    /// Draws a finger from one place to another.
    pub fn swipe(&self, tab: &Tab, from: (f64, f64), to: (f64, f64)) {
        let at = |kind: &str, (x, y): (f64, f64)| {
            self.call(Some(tab), "Input.dispatchTouchEvent", &json!({"type": kind, "touchPoints": [{"x": x, "y": y}]}));
        };
        at("touchStart", from);
        for step in 1..=10 {
            let part = f64::from(step) / 10.0;
            at("touchMove", (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1)));
        }
        self.call(Some(tab), "Input.dispatchTouchEvent", &json!({"type": "touchEnd", "touchPoints": []}));
    }

    /// Presses a key by its name, for example `space`, `Escape` or `ctrl+k`.
    pub fn press(&self, tab: &Tab, name: &str) {
        let (control, name) = name.strip_prefix("ctrl+").map_or((false, name), |name| (true, name));
        let (key, code, text) = match name {
            "space" => (" ".to_owned(), "Space".to_owned(), " ".to_owned()),
            letter if letter.len() == 1 => {
                (letter.to_owned(), format!("Key{}", letter.to_uppercase()), letter.to_owned())
            }
            name => (name.to_owned(), name.to_owned(), String::new()),
        };
        let modifiers = if control { 2 } else { 0 };
        let mut event = json!({"type": "keyDown", "key": key, "code": code, "modifiers": modifiers});
        if !control && !text.is_empty() {
            event["text"] = json!(text);
        }
        self.call(Some(tab), "Input.dispatchKeyEvent", &event);
        let event = json!({"type": "keyUp", "key": key, "code": code, "modifiers": modifiers});
        self.call(Some(tab), "Input.dispatchKeyEvent", &event);
    }

    /// Types text as an input method does.
    pub fn type_text(&self, tab: &Tab, text: &str) {
        self.call(Some(tab), "Input.insertText", &json!({"text": text}));
    }

    /// What a page looks like, as PNG.
    ///
    /// # Panics
    /// When it cannot be reported.
    pub fn photograph(&self, tab: &Tab) -> Vec<u8> {
        let answer = self.call(Some(tab), "Page.captureScreenshot", &json!({"format": "png"}));
        let base64 = answer["data"].as_str().expect("an image");
        data_encoding::BASE64.decode(base64.as_bytes()).expect("base 64")
    }

    /// What pages have written to their consoles, including warnings and errors.
    pub fn text(&self) -> Vec<String> {
        self.devtools.borrow().reported.clone()
    }

    /// Drops files and folders on a page, as from the file manager.
    pub fn drop_files(&self, tab: &Tab, (x, y): (f64, f64), files: &[&Path]) {
        for kind in ["dragEnter", "dragOver", "drop"] {
            let data = json!({"items": [], "files": files, "dragOperationsMask": 1});
            let event = json!({"type": kind, "x": x, "y": y, "data": data});
            self.call(Some(tab), "Input.dispatchDragEvent", &event);
        }
    }

    /// Freezes a page, as a browser does when it is in the background or the lid is closed, or resumes it.
    pub fn freeze(&self, tab: &Tab, is_frozen: bool) {
        let state = if is_frozen { "frozen" } else { "active" };
        self.call(Some(tab), "Page.setWebLifecycleState", &json!({"state": state}));
    }

    /// Stops all its processes where they are, or resumes them.
    ///
    /// # Panics
    /// When there are none.
    pub fn signal(&self, name: &str) {
        let group = format!("-{}", self.child.id());
        let sent = Command::new("kill").args(["-s", name, "--", &group]).status();
        assert!(sent.is_ok_and(|status| status.success()), "kill -s {name} {group}");
    }

    fn call(&self, tab: Option<&Tab>, method: &str, params: &Value) -> Value {
        let mut devtools = self.devtools.borrow_mut();
        devtools.calls += 1;
        let id = devtools.calls;
        let mut call = json!({"id": id, "method": method, "params": params});
        if let Some(tab) = tab {
            call["sessionId"] = json!(tab.session);
        }
        devtools.socket.send(Message::text(call.to_string())).expect("sent");
        loop {
            let Message::Text(text) = devtools.socket.read().expect("an answer") else { continue };
            let answer: Value = serde_json::from_str(&text).expect("JSON");
            if answer["id"] == json!(id) {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
            if answer["method"] == "Runtime.consoleAPICalled" || answer["method"] == "Runtime.exceptionThrown" {
                devtools.reported.push(answer["params"].to_string());
            }
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let group = format!("-{}", self.child.id());
        for signal in ["CONT", "KILL"] {
            let _sent = Command::new("kill").args(["-s", signal, "--", &group]).status().is_ok();
        }
        let _ended = self.child.wait().is_ok();
    }
}
