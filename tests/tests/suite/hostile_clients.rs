//! Malicious clients, against `handeye cell` as a process.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ciborium::Value;
use handeye_coppeliasim::cell::{Arm, CameraFeed, CellClient, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use handeye_tests::{CellProcess, handeye_binary, hostile};

/// Longer than anything here takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(2);

fn connect(cell: &CellProcess) -> (Arm, CameraFeed) {
    let endpoint = Endpoint::local(cell.port());
    let client = CellClient::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default());
    client.expect("the cell serves").split()
}

fn dial(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("an option");
    stream
}

/// Moves the first joint to one radian.
fn move_the_arm(arm: &mut Arm) -> Vec<u8> {
    let joint = arm.sim().get_object_index("/UR5/joint", 0).expect("a joint");
    hostile::request("page", "sim.setJointPosition", vec![Value::from(joint.0), Value::Float(1.0)])
}

/// What a web page can send, and what sockets of ZeroMQ before version 4 send.
fn old_ways(request: &[u8]) -> [(&'static str, Vec<u8>); 3] {
    let head = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 300\r\n\r\n";
    let post = [&head[..], &hostile::body_after(head, request, 300)].concat();
    let unversioned = [&[1, 0][..], &hostile::unversioned(request)].concat();
    // Version 2: signature, revision, socket type, an empty identity; then frames as today.
    let version_2 = [&b"\xff\0\0\0\0\0\0\0\x01\x7f\x01\x03\0\0"[..], &hostile::framed(request)].concat();
    [("HTTP", post), ("unversioned", unversioned), ("version 2", version_2)]
}

#[test]
fn nothing_but_a_zeromq_socket_of_version_3_commands_the_cell() {
    let cell = CellProcess::start(&[]);
    let (mut arm, _camera) = connect(&cell);
    let request = move_the_arm(&mut arm);
    let before = arm.joint_values().expect("a call");
    // A socket of the library accepts all of them as requests.
    let router = zmq::Context::new().socket(zmq::ROUTER).expect("a socket");
    router.set_rcvtimeo(PATIENCE.as_millis() as i32).expect("an option");
    router.bind("tcp://127.0.0.1:*").expect("a port");
    let bound = router.get_last_endpoint().expect("an option").expect("text");
    let taken_by_all = bound.rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");
    for (what, bytes) in old_ways(&request) {
        let mut naive = dial(taken_by_all);
        naive.write_all(&bytes).expect("sent");
        while router.recv_multipart(0).expect(what).pop().expect("a frame") != request {}

        let mut refused = dial(cell.port());
        // The cell may have closed the connection at the first byte.
        let _sent = refused.write_all(&bytes).is_ok();
        let mut answer = Vec::new();
        let _reset = refused.read_to_end(&mut answer).is_err();
        assert!(answer.len() <= 64, "{what}: it got more than a greeting");
        assert_eq!(arm.joint_values(), Ok(before), "{what}");
    }
    let mut today = dial(cell.port());
    hostile::introduce(&mut today);
    today.write_all(&hostile::framed(&request)).expect("sent");
    let began = Instant::now();
    while arm.joint_values().expect("a call")[0] != 1.0 {
        assert!(began.elapsed() < PATIENCE, "the request itself is good");
    }
}

/// A number of `/proc/PID/status` \[bytes\].
fn memory(pid: u32, key: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).expect("the process lives");
    let line = status.lines().find_map(|line| line.strip_prefix(key)).expect("a line");
    line.split_whitespace().find_map(|number| number.parse::<u64>().ok()).expect("a number") * 1024
}

fn sockets(pid: u32) -> usize {
    let files = std::fs::read_dir(format!("/proc/{pid}/fd")).expect("the process lives").flatten();
    files
        .filter(|file| std::fs::read_link(file.path()).is_ok_and(|link| link.to_string_lossy().contains("socket")))
        .count()
}

#[test]
#[cfg(target_os = "linux")]
fn a_hundred_clients_that_never_read_share_64_mib_and_leave_nothing_behind() {
    const CLIENTS: usize = 100;
    // Memory of the cell in addition to waiting replies: replies in preparation, and what an allocator keeps.
    const BESIDE: u64 = 24 << 20;
    let cell = CellProcess::start(&[]);
    let (mut arm, mut camera) = connect(&cell);
    let sensor = arm.sim().get_object("/UR5/3D_camera").expect("a camera");
    let request = hostile::request("reads nothing", "sim.getVisionSensorImg", vec![Value::from(sensor.0)]);
    camera.grab().expect("a frame");
    let (before, others) = (memory(cell.id(), "VmRSS:"), sockets(cell.id()));
    let readers: Vec<TcpStream> = (0..CLIENTS)
        .map(|_| {
            let mut stream = dial(cell.port());
            hostile::introduce(&mut stream);
            // More than the system itself buffers.
            stream.write_all(&hostile::framed(&request).repeat(20)).expect("sent");
            stream
        })
        .collect();
    let began = Instant::now();
    // By then all requests have arrived, and some connections are closed.
    for _ in 0..100 {
        camera.grab().expect("whoever reads is served");
        assert!(memory(cell.id(), "VmRSS:") < before + (64 << 20) + BESIDE, "{}", memory(cell.id(), "VmRSS:"));
    }
    while sockets(cell.id()) >= others + CLIENTS {
        camera.grab().expect("whoever reads is served");
        assert!(began.elapsed() < PATIENCE, "no connection was closed");
    }
    let most = memory(cell.id(), "VmHWM:");
    println!("resident before {} MB, at most {} MB", before / 1_000_000, most / 1_000_000);
    assert!(most < before + (64 << 20) + BESIDE, "{most} bytes");
    let left = sockets(cell.id()) - others;
    assert!(left > 10, "{left} connections: only as many as have to be are closed");

    drop(readers);
    while sockets(cell.id()) > others {
        camera.grab().expect("a frame");
        assert!(began.elapsed() < PATIENCE, "{} connections stay", sockets(cell.id()) - others);
    }
    // And their memory is returned to the system.
    while memory(cell.id(), "VmRSS:") >= before + BESIDE {
        camera.grab().expect("a frame");
        let kept = memory(cell.id(), "VmRSS:");
        assert!(began.elapsed() < PATIENCE, "{kept} bytes stay of {before} before and {most} at most");
    }
    println!("resident afterwards {} MB", memory(cell.id(), "VmRSS:") / 1_000_000);
}

/// Sends a signal, by its name.
#[cfg(target_os = "linux")]
fn signal(pid: u32, name: &str) {
    let status = Command::new("kill").args(["-s", name, &pid.to_string()]).status().expect("kill is there");
    assert!(status.success(), "{name}");
}

#[test]
#[cfg(target_os = "linux")]
fn unfinished_requests_that_come_all_in_one_turn_share_64_mib_too() {
    const CLIENTS: usize = 200;
    const REQUEST: usize = 1 << 20;
    // What the allocator keeps when one connection is closed for the next. Without a bound it is 200 MiB and more.
    const BESIDE: u64 = 40 << 20;
    let cell = CellProcess::start(&[]);
    let (mut arm, _camera) = connect(&cell);
    let before = memory(cell.id(), "VmRSS:");
    let mut clients: Vec<TcpStream> = (0..CLIENTS).map(|_| dial(cell.port())).collect();
    clients.iter_mut().for_each(hostile::introduce);
    let head = [&[1, 0, 2][..], &(REQUEST as u64).to_be_bytes()].concat();
    let unfinished = [head, vec![0; REQUEST - 1]].concat();
    // A cell that is stopped finds all of them when it resumes.
    signal(cell.id(), "STOP");
    for client in &mut clients {
        client.set_write_timeout(Some(PATIENCE)).expect("an option");
        client.write_all(&unfinished).expect("the system takes it");
    }
    signal(cell.id(), "CONT");
    arm.joint_values().expect("whoever finishes a request is served");
    let most = memory(cell.id(), "VmHWM:");
    assert!(most < before + (64 << 20) + BESIDE, "{most} bytes, {before} before");
}

/// Ends a process with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ended = self.0.kill().and_then(|()| self.0.wait()).is_ok();
    }
}

#[test]
fn a_cell_that_others_can_reach_says_so_in_one_line() {
    let said_by = |bind: &str| {
        let child = Command::new(handeye_binary())
            .args(["cell", "--quiet", "--port", "0", "--bind", bind])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut cell = Ends(child.expect("the binary is built: cargo build -p handeye_app"));
        let mut line = String::new();
        BufReader::new(cell.0.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        assert!(line.starts_with("listening on tcp://"), "{line}");
        let stderr = cell.0.stderr.take().expect("piped");
        drop(cell);
        std::io::read_to_string(stderr).expect("text")
    };
    assert_eq!(said_by("127.0.0.1"), "");
    assert_eq!(said_by("localhost"), "");
    let reported = said_by("0.0.0.0");
    assert_eq!(reported.lines().count(), 1, "{reported}");
    for word in ["warning", "network", "move the arm", "no password", "127.0.0.1"] {
        assert!(reported.contains(word), "{word}: {reported}");
    }
}
