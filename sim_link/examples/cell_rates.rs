//! How fast the built-in cell answers over its socket: `cargo run --release --example cell_rates`.

use std::time::{Duration, Instant};

use ciborium::Value;
use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::cell::server::{CellConfig, CellServer};
use handeye_sim_link::wire::{self, Reader as _};

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

/// Calls per second and the slowest call.
fn rate(seconds: f64, mut call: impl FnMut(u32) -> Result<(), Failure>) -> Result<(f64, Duration), Failure> {
    let (start, mut count, mut slowest) = (Instant::now(), 0, Duration::ZERO);
    while start.elapsed().as_secs_f64() < seconds {
        let before = Instant::now();
        call(count)?;
        slowest = slowest.max(before.elapsed());
        count += 1;
    }
    Ok((f64::from(count) / start.elapsed().as_secs_f64(), slowest))
}

fn main() -> Result<(), Failure> {
    for (name, scene) in [("reference", Scene::reference()?), ("realistic", Scene::realistic()?)] {
        let server = CellServer::start(CellConfig { real_time: Some(false), ..CellConfig::new(scene) })?;
        let client = Client::new(&server.endpoint())?;
        let (camera, depth) = (client.handle("/UR5/3D_camera")?, client.handle("/UR5/3D_camera/depth")?);
        let joint = client.handle("/UR5/joint")?;
        client.call("sim.setStepping", vec![Value::from(true)])?;
        client.call("sim.startSimulation", vec![])?;
        client.call("sim.step", vec![])?;
        let report = |what: &str, (rate, slowest): (f64, Duration)| {
            println!("{name}: {what}: {rate:.0}/s, {:.3} ms each, slowest {slowest:?}", 1e3 / rate);
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
        report("the same with getVisionSensorDepth", rate(4.0, |count| step(count).and_then(|()| depths()))?);
    }
    Ok(())
}
