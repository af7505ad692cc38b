//! Who has access to `handeye serve`, and its limits for clients without access.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use handeye_tests::served::{SOON, Served, frame};
use serde_json::json;
use tungstenite::Message;

/// A request to upgrade to the connection of a page.
fn upgrade(host: &str, more: &str) -> String {
    format!(
        "GET /socket?page=x HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n{more}\r\n"
    )
}

#[test]
fn pages_of_other_sites_files_elsewhere_and_forms_are_refused() {
    let served = Served::start(&[]);
    let status = |request: &str| served.ask(request).split_whitespace().nth(1).unwrap_or_default().to_owned();
    assert_eq!(status("GET / HTTP/1.1\r\nHost: ADDRESS\r\n\r\n"), "200");
    assert_eq!(status(&upgrade("ADDRESS", "Origin: http://ADDRESS\r\n")), "101");
    for (host, more) in [
        ("ADDRESS", "Origin: http://evil.example\r\n"),
        ("ADDRESS", "Origin: null\r\n"),
        ("evil.example", "Origin: http://evil.example\r\n"),
        ("evil.example", ""),
    ] {
        assert_eq!(status(&upgrade(host, more)), "403", "{host} {more}");
    }
    // A program that is not a page.
    assert_eq!(status(&upgrade("ADDRESS", "")), "400");
    for path in ["/../Cargo.toml", "/client.js/../../etc/passwd", "/%2e%2e/etc/passwd", "/exports"] {
        assert_eq!(status(&format!("GET {path} HTTP/1.1\r\nHost: ADDRESS\r\n\r\n")), "404", "{path}");
    }
    for folder in ["/etc", "%2Fetc", "..", "/", ""] {
        let request = format!("GET /download?folder={folder} HTTP/1.1\r\nHost: ADDRESS\r\n\r\n");
        assert_eq!(status(&request), "403", "{folder}");
    }
    // What a form of another site can send, and names that lead out.
    let post = |path: &str, headers: &str| {
        status(&format!("POST {path} HTTP/1.1\r\nHost: ADDRESS\r\nContent-Length: 1\r\n{headers}\r\nx"))
    };
    assert_eq!(post("/upload/a/x.txt", "Origin: http://evil.example\r\nX-Handeye: 1\r\n"), "403");
    assert_eq!(post("/upload/a/x.txt", "Content-Type: text/plain\r\n"), "403");
    for path in ["/upload/a/..%2Fx", "/upload/a/%2Fetc%2Fx", "/upload/..%2Fa/x", "/upload/a/b%5Cx", "/upload/a/%ff"] {
        assert_eq!(post(path, "X-Handeye: 1\r\n"), "400", "{path}");
    }
    assert_eq!(post("/", ""), "405");
}

#[test]
fn from_elsewhere_nobody_enters_without_the_key() {
    let served = Served::start(&["--bind", "0.0.0.0"]);
    let head = |request: &str| served.ask(request);
    let key = served.url.split("handeye_key=").nth(1).expect("a key in the address");
    assert_eq!(key.len(), 32, "128 bits");
    assert!(head("GET / HTTP/1.1\r\nHost: ADDRESS\r\n\r\n").starts_with("HTTP/1.1 401"));
    assert!(head(&upgrade("ADDRESS", "Origin: http://ADDRESS\r\n")).starts_with("HTTP/1.1 401"));
    let welcome = head(&format!("GET /?handeye_key={key} HTTP/1.1\r\nHost: ADDRESS\r\n\r\n"));
    assert!(welcome.starts_with("HTTP/1.1 303") && welcome.contains("HttpOnly"), "{welcome}");
    let cookie = format!("Cookie: handeye_key={key}\r\n");
    assert!(head(&format!("GET / HTTP/1.1\r\nHost: ADDRESS\r\n{cookie}\r\n")).starts_with("HTTP/1.1 200"));
    assert!(head(&upgrade("ADDRESS", &format!("Origin: http://ADDRESS\r\n{cookie}"))).starts_with("HTTP/1.1 101"));
    assert!(head(&upgrade("ADDRESS", &format!("Origin: http://evil.example\r\n{cookie}"))).starts_with("HTTP/1.1 403"));
}

#[test]
fn broken_messages_and_a_thousand_silent_connections_leave_the_driving_page_alone() {
    let served = Served::start(&[]);
    let mut driver = served.page("driver");
    let screen = json!({"t": "screen", "width": 1440.0, "height": 900.0, "scale": 1.0, "touch": false});
    driver.send(Message::text(screen.to_string())).expect("sent");
    let first = frame(&mut driver);
    let before = served.megabytes();

    let silent: Vec<TcpStream> = (0..1000).filter_map(|_| TcpStream::connect(&served.address).ok()).collect();
    // Each of these ends its own connection only.
    let broken: Vec<Message> = vec![
        Message::text("{"),
        Message::text("[]"),
        Message::text(r#"{"t":"input","events":[{"e":"move","at":[1]}]}"#),
        Message::text(r#"{"t":"screen","width":1e9,"height":1,"scale":1}"#),
        Message::text(r#"{"t":"screen","width":null,"height":900,"scale":1}"#),
        Message::binary(vec![0; 1000]),
        Message::text("x".repeat(2 << 20)),
        Message::text(format!(r#"{{"t":"input","events":[{}]}}"#, vec![r#"{"e":"leave"}"#; 20_000].join(","))),
    ];
    for (number, message) in broken.into_iter().enumerate() {
        let mut page = served.page(&format!("broken{number}"));
        // It may be closed while it still sends.
        let _sent = page.send(message).is_ok();
        if number != 7 {
            while page.read().is_ok() {}
        }
    }
    let now = frame(&mut driver);
    assert!(now > first);
    drop(silent);
    let grown = served.megabytes() - before;
    println!("1,000 silent connections and 8 broken pages: {grown:.0} MB more");
    assert!(grown < 100.0, "{grown} MB");
}

#[test]
fn however_many_uploads_there_were_another_is_taken_and_slow_ones_lock_no_page_out() {
    let served = Served::start(&[]);
    let post = |upload: &str, length: usize, body: &str| {
        format!(
            "POST /upload/{upload}/x.txt HTTP/1.1\r\nHost: ADDRESS\r\nX-Handeye: 1\r\nContent-Length: {length}\r\n\r\n{body}"
        )
    };
    for number in 0..80 {
        let answer = served.ask(&post(&format!("quick{number}"), 1, "x"));
        assert!(answer.starts_with("HTTP/1.1 204"), "{number}: {answer}");
    }
    // More than the number of connections; only the beginning of each.
    let slow: Vec<TcpStream> = (0..100)
        .filter_map(|number| {
            let mut socket = TcpStream::connect(&served.address).ok()?;
            let request = post(&format!("slow{number}"), 1000, "x").replace("ADDRESS", &served.address);
            socket.write_all(request.as_bytes()).ok()?;
            Some(socket)
        })
        .collect();
    assert!(slow.len() >= 64, "{}", slow.len());
    assert!(served.ask("GET / HTTP/1.1\r\nHost: ADDRESS\r\n\r\n").starts_with("HTTP/1.1 200"));
    let mut page = served.page("new");
    let screen = json!({"t": "screen", "width": 1440.0, "height": 900.0, "scale": 1.0, "touch": false});
    page.send(Message::text(screen.to_string())).expect("sent");
    frame(&mut page);
    drop(slow);
}

#[test]
fn a_folder_is_downloaded_by_one_at_a_time_and_for_no_other_site() {
    let folder = tempfile::tempdir().expect("a folder");
    // More than the system buffers for a client that does not read.
    std::fs::write(folder.path().join("large.png"), vec![7; 64 << 20]).expect("written");
    std::fs::write(folder.path().join("result.json"), "{}").expect("written");
    let name = folder.path().display().to_string();
    let served = Served::start(&["--allow", &name]);
    let get = |more: &str| {
        format!("GET /download?folder={name} HTTP/1.1\r\nHost: ADDRESS\r\nConnection: close\r\n{more}\r\n")
    };
    for site in ["cross-site", "same-site"] {
        for mode in ["no-cors", "navigate"] {
            let answer = served.ask(&get(&format!("Sec-Fetch-Site: {site}\r\nSec-Fetch-Mode: {mode}\r\n")));
            assert!(answer.starts_with("HTTP/1.1 403"), "{site} {mode}: {answer}");
        }
    }
    let before = served.megabytes();
    let mut first = TcpStream::connect(&served.address).expect("it listens");
    first.set_read_timeout(Some(SOON)).expect("set");
    first
        .write_all(get("Sec-Fetch-Site: same-origin\r\n").replace("ADDRESS", &served.address).as_bytes())
        .expect("sent");
    let mut begun = vec![0; 4096];
    let count = first.read(&mut begun).expect("an answer");
    assert!(begun[..count].starts_with(b"HTTP/1.1 200"), "{}", String::from_utf8_lossy(&begun[..count]));
    assert!(served.ask(&get("")).starts_with("HTTP/1.1 503"), "another while the first is under way");
    let grown = served.megabytes() - before;
    assert!(grown < 32.0, "{grown} MB are kept of 64 that nobody takes");
    // The first read may hold the start of the archive after the header.
    begun.truncate(count);
    first.read_to_end(&mut begun).expect("the whole archive");
    assert!(begun.len() > 64 << 20, "{} bytes", begun.len());
    // Its slot is free when the end was read.
    let deadline = std::time::Instant::now() + SOON;
    while !served.ask(&get("")).starts_with("HTTP/1.1 200") {
        assert!(std::time::Instant::now() < deadline, "its place is not given back");
    }
}

#[test]
fn wrong_keys_are_looked_at_no_more_after_some_and_an_open_port_is_warned_of() {
    let mut served = Served::start(&["--bind", "0.0.0.0"]);
    let key = served.url.split("handeye_key=").nth(1).expect("a key in the address").to_owned();
    let guess = |key: &str| served.ask(&format!("GET /?handeye_key={key} HTTP/1.1\r\nHost: ADDRESS\r\n\r\n"));
    let answers: Vec<String> = (0..30).map(|number| guess(&format!("{number:032x}"))).collect();
    assert!(answers[0].starts_with("HTTP/1.1 401"), "{}", answers[0]);
    assert!(answers[29].starts_with("HTTP/1.1 429"), "{}", answers[29]);
    assert!(guess(&key).starts_with("HTTP/1.1 429"), "one who waits learns nothing");
    served.child.kill().expect("it runs");
    let mut reported = String::new();
    served.child.stderr.take().expect("its messages").read_to_string(&mut reported).expect("text");
    assert!(reported.contains("warning: everybody on the network"), "{reported}");
}

#[test]
fn it_ends_soon_after_it_was_asked_to_and_warns_of_nothing() {
    let mut served = Served::start(&[]);
    let mut page = served.page("driver");
    let screen = json!({"t": "screen", "width": 1440.0, "height": 900.0, "scale": 1.0, "touch": false});
    page.send(Message::text(screen.to_string())).expect("sent");
    frame(&mut page);
    let asked = std::time::Instant::now();
    handeye_tests::process::signal(&served.child, "INT");
    let status = handeye_tests::process::end_of(&mut served.child);
    println!("ended by SIGINT after {:.2?}", asked.elapsed());
    let mut reported = String::new();
    served.child.stderr.take().expect("its messages").read_to_string(&mut reported).expect("text");
    assert!(status.success(), "{status}: {reported}");
    assert!(!reported.contains("WARN") && !reported.contains("ERROR"), "{reported}");
}
