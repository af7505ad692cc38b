//! A page in a real browser that tries to command the cell of the user who views it.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use ciborium::Value;
use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use handeye_tests::{CellProcess, hostile};

/// Longer than a browser takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(4);

/// Length of the page's messages.
const BODY_BYTES: usize = 1024;

/// What the page does: it first shows what its requests look like, then sends each target a tailored one.
const SCRIPT: &str = "
    const post = (port, body) =>
        fetch(`http://127.0.0.1:${port}/`, { method: 'POST', mode: 'no-cors', body, signal: AbortSignal.timeout(20000) });
    (async () => {
        await post(RECORDER, new Uint8Array(1024));
        for (const port of TARGETS) {
            const body = await (await fetch('/body/' + port)).arrayBuffer();
            await post(port, new Uint8Array(body)).catch(() => {});
        }
        await fetch('/done');
    })();
";

struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ended = self.0.kill().and_then(|()| self.0.wait()).is_ok();
    }
}

fn listener() -> (TcpListener, u16) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("bound").port();
    (listener, port)
}

/// The first lines of a request, up to the empty one.
fn head(stream: &mut BufReader<TcpStream>) -> Option<Vec<u8>> {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        if stream.read_until(b'\n', &mut head).ok()? == 0 {
            return None;
        }
    }
    Some(head)
}

fn answer(stream: &mut BufReader<TcpStream>, kind: &str, body: &[u8]) {
    let head = format!(
        "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // The browser may have closed the connection.
    let _sent = stream.get_mut().write_all(head.as_bytes()).and_then(|()| stream.get_mut().write_all(body)).is_ok();
}

/// Serves the page and its requests, until it is done.
fn serve(pages: &TcpListener, recorder: (TcpListener, u16), targets: &[u16], request: &[u8], done: &Sender<()>) {
    let recorded = std::thread::spawn(move || {
        let (stream, _) = recorder.0.accept().expect("the page asks");
        let mut stream = BufReader::new(stream);
        let head = head(&mut stream).expect("a request");
        stream.read_exact(&mut [0; BODY_BYTES]).expect("its body");
        answer(&mut stream, "text/plain", b"");
        String::from_utf8(head).expect("text")
    });
    let mut recorded = Some(recorded);
    let mut post = String::new();
    loop {
        let (stream, _) = pages.accept().expect("the browser asks");
        let mut stream = BufReader::new(stream);
        let Some(head) = head(&mut stream) else { continue };
        let head = String::from_utf8_lossy(&head).into_owned();
        let path = head.split_whitespace().nth(1).unwrap_or_default();
        if let Some(port) = path.strip_prefix("/body/") {
            if let Some(recorded) = recorded.take() {
                post = recorded.join().expect("no panic");
            }
            let to_target = post.replace(&format!("127.0.0.1:{}", recorder.1), &format!("127.0.0.1:{port}"));
            answer(
                &mut stream,
                "application/octet-stream",
                &hostile::body_after(to_target.as_bytes(), request, BODY_BYTES),
            );
        } else if path == "/done" {
            answer(&mut stream, "text/plain", b"");
            done.send(()).expect("the test waits");
            return;
        } else if path == "/" {
            let script =
                SCRIPT.replace("RECORDER", &recorder.1.to_string()).replace("TARGETS", &format!("{targets:?}"));
            let page = format!("<!doctype html><title>A page</title><script>{script}</script>");
            answer(&mut stream, "text/html", page.as_bytes());
        } else {
            answer(&mut stream, "text/plain", b"");
        }
    }
}

#[test]
fn a_page_in_a_browser_moves_nothing() {
    let path = std::env::var_os("PATH").unwrap_or_default();
    if !std::env::split_paths(&path).any(|folder| folder.join("chromium").is_file()) {
        eprintln!("web page: skipped, not installed: chromium");
        return;
    }
    let cell = CellProcess::start(&[]);
    let endpoint = Endpoint::local(cell.port());
    let mut arm = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("a cell");
    let joint = arm.sim().get_object_index("/UR5/joint", 0).expect("a joint");
    let request = hostile::request("page", "sim.setJointPosition", vec![Value::from(joint.0), Value::Float(1.0)]);
    let before = arm.joint_values().expect("a call");
    // A socket of the library, which accepts the page as an old client: the attack is real.
    let router = zmq::Context::new().socket(zmq::ROUTER).expect("a socket");
    router.set_rcvtimeo(PATIENCE.as_millis() as i32).expect("an option");
    router.bind("tcp://127.0.0.1:*").expect("a port");
    let bound = router.get_last_endpoint().expect("an option").expect("text");
    let library = bound.rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");

    let (pages, page) = listener();
    let (recorder, recorder_port) = listener();
    let targets = [library, cell.port()];
    let (done, is_done) = channel();
    let body = request.clone();
    let server = std::thread::spawn(move || serve(&pages, (recorder, recorder_port), &targets, &body, &done));
    let profile = tempfile::tempdir().expect("a folder");
    let browser = Command::new("chromium")
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--remote-debugging-port=0"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("http://127.0.0.1:{page}/"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let _browser = Ends(browser.expect("chromium starts"));
    is_done.recv_timeout(PATIENCE).expect("the page comes to its end");
    server.join().expect("no panic");
    while router.recv_multipart(0).expect("the library takes it").pop().expect("a frame") != request {}
    assert_eq!(arm.joint_values(), Ok(before), "the page moved the arm");
}
