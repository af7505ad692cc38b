//! How fast the built-in cell answers over its socket: `cargo run --release --example cell_rates`.

use std::time::{Duration, Instant};

use ciborium::Value;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::ConnectionOptions;
use handeye_coppeliasim::cell::{CameraFeed, CellPaths};
use handeye_server::{CellConfig, CellServer};
use handeye_wire::{self as wire, Reader as _};

type Failure = Box<dyn std::error::Error>;

struct Client {
    socket: zmq::Socket,
    _context: zmq::Context,
}

impl Client {
    fn new(endpoint: &str) -> Result<Self, Failure> {
        let context = zmq::Context::new();
        let socket = context.socket(zmq::REQ)?;
        socket.set_linger(0)?;
        socket.set_rcvtimeo(10_000)?;
        socket.connect(endpoint)?;
        Ok(Self { socket, _context: context })
    }

    fn call(&self, func: &str, args: Vec<Value>) -> Result<Value, Failure> {
        let request = [("func", Value::from(func)), ("args", Value::Array(args)), ("uuid", Value::from("rates"))];
        self.socket.send(wire::encode(&wire::map(request)), 0)?;
        let reply = wire::decode(&self.socket.recv_bytes(0)?)?;
        reply.get("ret").cloned().ok_or_else(|| format!("{func}: {reply:?}").into())
    }

    fn handle(&self, path: &str) -> Result<Value, Failure> {
        let found = self.call("sim.getObject", vec![Value::from(path)])?;
        found.list().and_then(|list| list.first()).cloned().ok_or_else(|| "no handle".into())
    }
}

/// How fast calls are.
struct Rate {
    per_second: f64,
    slowest: Duration,
    /// What the cell's thread had of the processor per call; where the kernel does not tell (Linux does), nothing.
    processor: Option<Duration>,
}

fn rate(seconds: f64, mut call: impl FnMut(u32) -> Result<(), Failure>) -> Result<Rate, Failure> {
    let (start, mut count, mut slowest) = (Instant::now(), 0, Duration::ZERO);
    let processor = processor_of_cell();
    while start.elapsed().as_secs_f64() < seconds {
        let before = Instant::now();
        call(count)?;
        slowest = slowest.max(before.elapsed());
        count += 1;
    }
    let processor = processor_of_cell().zip(processor).map(|(after, before)| after.saturating_sub(before) / count);
    Ok(Rate { per_second: f64::from(count) / start.elapsed().as_secs_f64(), slowest, processor })
}

/// Processor time of the thread that serves the cell, which other programs on the machine do not lengthen.
fn processor_of_cell() -> Option<Duration> {
    let is_cell =
        |task: &std::path::Path| std::fs::read_to_string(task.join("comm")).is_ok_and(|name| name == "cell\n");
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let task = tasks.filter_map(Result::ok).map(|entry| entry.path()).find(|task| is_cell(task))?;
    let text = std::fs::read_to_string(task.join("schedstat")).ok()?;
    text.split_whitespace().next()?.parse().ok().map(Duration::from_nanos)
}

fn main() -> Result<(), Failure> {
    for (name, scene) in
        [("reference", Scene::reference()?), ("realistic", Scene::realistic()?), ("tracking", Scene::tracking()?)]
    {
        let server = CellServer::start(CellConfig { real_time: Some(false), ..CellConfig::new(scene) })?;
        let client = Client::new(&server.endpoint())?;
        let (camera, depth) = (client.handle("/UR5/3D_camera")?, client.handle("/UR5/3D_camera/depth")?);
        let joint = client.handle("/UR5/joint")?;
        client.call("sim.setStepping", vec![Value::from(true)])?;
        client.call("sim.startSimulation", vec![])?;
        client.call("sim.step", vec![])?;
        let report = |what: &str, Rate { per_second, slowest, processor }: Rate| {
            let used = processor.map(|used| format!(", {used:.2?} of the cell's processor")).unwrap_or_default();
            println!("{name}: {what}: {per_second:.0}/s, {:.3} ms each, slowest {slowest:.1?}{used}", 1e3 / per_second);
        };
        report("getJointPosition", rate(2.0, |_| client.call("sim.getJointPosition", vec![joint.clone()]).map(drop))?);
        report("step", rate(2.0, |_| client.call("sim.step", vec![]).map(drop))?);
        let image = || client.call("sim.getVisionSensorImg", vec![camera.clone()]).map(drop);
        let depths = || client.call("sim.getVisionSensorDepth", vec![depth.clone(), Value::from(1)]).map(drop);
        report("getVisionSensorImg, nothing moves", rate(2.0, |_| image())?);
        let step = |count: u32| -> Result<(), Failure> {
            let angle = 0.1 * (f64::from(count) * 0.05).sin();
            client.call("sim.setJointPosition", vec![joint.clone(), Value::from(angle)])?;
            client.call("sim.step", vec![]).map(drop)
        };
        report("setJointPosition + step + getVisionSensorImg", rate(4.0, |count| step(count).and_then(|()| image()))?);
        let mut feed =
            CameraFeed::connect(&server.endpoint().parse()?, &ConnectionOptions::default(), &CellPaths::default())?;
        let both = |count: u32| step(count).and_then(|()| image()).and_then(|()| depths());
        report("the same with both images", rate(4.0, both)?);
        let mut grab = || feed.grab().map(drop).map_err(Failure::from);
        report("the same as a frame of the client", rate(4.0, |count| step(count).and_then(|()| grab()))?);
        report("a frame of the client, nothing new", rate(2.0, |_| grab())?);
        report("the same with getVisionSensorDepth", rate(4.0, |count| step(count).and_then(|()| depths()))?);
    }
    Ok(())
}
