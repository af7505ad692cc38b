use std::io::{Read as _, Write as _};
use std::time::Duration;

use ciborium::Value;

use super::*;
use handeye_wire::{self as wire, Reader};

/// How long a reply may take on a machine that is busy with other tests.
const PATIENCE_MS: i32 = 20_000;

struct Client {
    socket: zmq::Socket,
    uuid: String,
    _context: zmq::Context,
}

impl Client {
    fn new(endpoint: &str, uuid: &str) -> Self {
        let context = zmq::Context::new();
        let socket = context.socket(zmq::REQ).expect("socket");
        socket.set_linger(0).expect("option");
        socket.set_rcvtimeo(PATIENCE_MS).expect("option");
        socket.connect(endpoint).expect("connects");
        Self { socket, uuid: uuid.to_owned(), _context: context }
    }

    fn send(&self, func: &str, args: Vec<Value>) {
        let request = wire::map([
            ("func", Value::from(func)),
            ("args", Value::Array(args)),
            ("uuid", Value::from(self.uuid.as_str())),
        ]);
        self.socket.send(wire::encode(&request), 0).expect("sends");
    }

    fn receive(&self) -> Value {
        wire::decode(&self.socket.recv_bytes(0).expect("a reply in time")).expect("decodes")
    }

    /// The answer of a call, however long it is to be waited for.
    fn call(&self, func: &str, args: Vec<Value>) -> Value {
        self.send(func, args);
        loop {
            let reply = self.receive();
            if reply.get("func").and_then(|func| func.text()) != Some("_*wait*_") {
                return reply;
            }
            self.send("_*executed*_", Vec::new());
        }
    }

    fn time_s(&self) -> f64 {
        let reply = self.call("sim.getSimulationTime", vec![]);
        reply.get("ret").and_then(Reader::numbers).expect("a time")[0]
    }

    /// Asks until simulated time has passed a mark.
    fn wait_past(&self, time_s: f64) {
        while self.time_s() <= time_s {}
    }
}

fn server(real_time: bool) -> CellServer {
    let config = CellConfig { real_time: Some(real_time), ..CellConfig::new(Scene::default()) };
    CellServer::start(config).expect("starts")
}

fn ret(value: Value) -> Value {
    wire::map([("ret", Value::Array(vec![value]))])
}

#[test]
fn every_shape_of_reply_comes_over_a_socket() {
    let server = server(true);
    let client = Client::new(&server.endpoint(), "a");
    assert_eq!(client.call("zmqRemoteApi.require", vec![Value::from("sim")]), wire::map([("ret", Value::Map(vec![]))]));
    assert_eq!(client.call("sim.getSimulationState", vec![]), ret(Value::from(0)));
    assert!(client.call("sim.nope", vec![]).get("err").is_some());
    let called = client.call("sim.testCB", vec![Value::from(1), Value::from("f@func"), Value::from(2), Value::from(0)]);
    assert_eq!(called.get("func").and_then(|f| f.text()), Some("f"));
    assert_eq!(called.get("args"), Some(&wire::integers([1, 2])));
    assert_eq!(client.call("_*executed*_", vec![Value::from(42)]), ret(Value::from(42)));
    assert_eq!(client.call("_*end*_", vec![]), Value::Map(vec![]));
}

#[test]
fn a_port_in_use_is_a_typed_error_that_says_what_to_do() {
    let first = server(true);
    let port = first.endpoint().rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");
    let error = CellServer::start(CellConfig { port, ..CellConfig::new(Scene::default()) }).expect_err("in use");
    assert!(matches!(error, CellError::PortInUse { port: p, .. } if p == port));
    assert!(error.to_string().contains("another port"), "{error}");
    first.stop();
    CellServer::start(CellConfig { port, ..CellConfig::new(Scene::default()) }).expect("free again");
}

#[test]
fn an_address_of_another_machine_is_refused() {
    let config = CellConfig { bind: "203.0.113.7".to_owned(), ..CellConfig::new(Scene::default()) };
    assert!(matches!(CellServer::start(config), Err(CellError::Bind { .. })));
}

#[test]
fn a_killed_stepping_client_does_not_freeze_the_others() {
    let server = server(false);
    let watcher = Client::new(&server.endpoint(), "watcher");
    let killed = Client::new(&server.endpoint(), "killed");
    killed.call("sim.setStepping", vec![Value::from(true)]);
    killed.call("sim.startSimulation", vec![]);
    killed.call("sim.step", vec![]);
    assert_eq!(watcher.time_s(), 0.05);
    drop(killed);
    watcher.wait_past(0.1);
}

#[test]
fn a_client_killed_inside_its_callback_does_not_freeze_the_others() {
    let server = server(false);
    let watcher = Client::new(&server.endpoint(), "watcher");
    let killed = Client::new(&server.endpoint(), "killed");
    let args = vec![Value::from(1), Value::from("f@func"), Value::from(2)];
    assert!(killed.call("sim.testCB", args).get("func").is_some());
    watcher.call("sim.startSimulation", vec![]);
    assert_eq!(watcher.time_s(), 0.0);
    drop(killed);
    watcher.wait_past(0.1);
}

#[test]
fn a_connection_with_the_number_of_a_closed_one_is_another_client() {
    let server = server(false);
    let watcher = Client::new(&server.endpoint(), "watcher");
    watcher.call("sim.startSimulation", vec![]);
    for round in 0..20 {
        let before = watcher.time_s();
        let client = Client::new(&server.endpoint(), &format!("client {round}"));
        client.call("sim.acquireLock", vec![]);
        let stepped = client.call("sim.step", vec![]);
        assert!(stepped.get("ret").is_some());
        client.call("sim.releaseLock", vec![]);
        drop(client);
        watcher.wait_past(before);
    }
}

#[test]
fn garbage_is_answered_with_an_error_and_does_not_end_the_service() {
    let server = server(true);
    let client = Client::new(&server.endpoint(), "a");
    for bytes in [vec![], vec![0xff; 100], vec![0x9b, 0xff, 0xff, 0xff, 0xff], vec![0; (1 << 20) + 1]] {
        client.socket.send(bytes, 0).expect("sends");
        assert!(client.receive().get("err").is_some());
    }
    // Without the empty frame a reply has no address.
    let context = zmq::Context::new();
    let dealer = context.socket(zmq::DEALER).expect("socket");
    dealer.set_linger(0).expect("option");
    dealer.connect(&server.endpoint()).expect("connects");
    dealer.send("no delimiter", 0).expect("sends");
    dealer.send_multipart(vec![b"a".to_vec(); 20], 0).expect("sends");
    // Not even ZeroMQ.
    let address = server.endpoint().trim_start_matches("tcp://").to_owned();
    let mut stream = std::net::TcpStream::connect(&address).expect("connects");
    stream.set_read_timeout(Some(Duration::from_secs(5))).expect("option");
    stream.write_all(b"GET / HTTP/1.1\r\n\r\n").expect("writes");
    let mut answer = [0; 64];
    assert!(stream.read(&mut answer).is_ok());
    assert_eq!(client.call("sim.getSimulationState", vec![]), ret(Value::from(0)));
}

#[test]
fn a_request_that_no_memory_should_be_spent_on_ends_its_connection_only() {
    let server = server(true);
    let client = Client::new(&server.endpoint(), "a");
    let greedy = Client::new(&server.endpoint(), "greedy");
    greedy.socket.set_rcvtimeo(200).expect("option");
    greedy.socket.send(vec![0_u8; 17 << 20], 0).expect("sends");
    assert!(greedy.socket.recv_bytes(0).is_err());
    assert_eq!(client.call("sim.getSimulationState", vec![]), ret(Value::from(0)));
}

#[test]
fn dropping_the_server_closes_its_socket_at_once() {
    let server = server(true);
    let client = Client::new(&server.endpoint(), "a");
    client.call("sim.startSimulation", vec![]);
    let before = std::time::Instant::now();
    drop(server);
    assert!(before.elapsed() < Duration::from_secs(2));
}

#[test]
fn a_server_can_be_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<CellServer>();
}

#[test]
fn thousands_of_calls_in_a_row_are_all_answered() {
    // The queue of a connection holds 16 replies; it must not matter how late the news comes that they were read.
    let server = server(false);
    let client = Client::new(&server.endpoint(), "a");
    for _ in 0..5000 {
        assert_eq!(client.call("sim.getSimulationState", vec![]), ret(Value::from(0)));
    }
}

#[test]
fn whoever_asks_for_images_and_reads_none_keeps_nobody_else_waiting() {
    let server = server(true);
    let client = Client::new(&server.endpoint(), "a");
    let camera = client.call("sim.getObject", vec![Value::from("/UR5/3D_camera")]);
    let camera = camera.get("ret").and_then(Reader::list).expect("a handle")[0].clone();
    let context = zmq::Context::new();
    let greedy = context.socket(zmq::DEALER).expect("socket");
    greedy.set_linger(0).expect("option");
    greedy.set_rcvhwm(1).expect("option");
    greedy.connect(&server.endpoint()).expect("connects");
    let request = wire::encode(&wire::map([
        ("func", Value::from("sim.getVisionSensorImg")),
        ("args", Value::Array(vec![camera])),
        ("uuid", Value::from("greedy")),
    ]));
    for _ in 0..300 {
        greedy.send_multipart([&b""[..], &request], 0).expect("sends");
    }
    for _ in 0..20 {
        assert_eq!(client.call("sim.getSimulationState", vec![]), ret(Value::from(0)));
    }
}
