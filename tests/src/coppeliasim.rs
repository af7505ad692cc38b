//! A stand-in for CoppeliaSim with an empty scene, for a program that builds one over the remote API: the built-in cell
//! answers what it supports, a record of CoppeliaSim 4.10's API the rest, and every call is recorded.
//!
//! Each object that the program creates is a frame of the cell, so that paths and poses are the cell's. What the cell does
//! not support (colours, ranges of joints, a file) is in the calls only.

use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use ciborium::Value;
use handeye_coppeliasim::{Connection, ConnectionOptions, Endpoint};
use handeye_wire::{self as wire, Reader as _};

use crate::CellProcess;

/// Longest wait for a program that builds a scene. Only a failure takes this long.
const PATIENCE: Duration = Duration::from_mins(2);
/// How often it is checked whether the program has ended \[ms\].
const LOOK_MS: i64 = 50;

/// Constants that the cell does not list, with CoppeliaSim 4.10's numbers.
const CONSTANTS: [(&str, i64); 4] = [
    ("stringparam_resourcesdir", RESOURCES),
    ("primitiveshape_plane", 1),
    ("shapeintparam_static", 3003),
    ("shapeintparam_respondable", 3004),
];
/// `sim.stringparam_resourcesdir`.
const RESOURCES: i64 = 141;
/// `sim.sceneobject_script`.
const SCRIPT: i64 = 17;

/// Functions that create an object, with its initial alias.
const MAKERS: [(&str, &str); 2] = [("createVisionSensor", "visionSensor"), ("createPrimitiveShape", "Plane")];
/// Functions that return nothing.
const SETTERS: [&str; 5] = ["setJointInterval", "setJointMode", "setObjectInt32Param", "setShapeColor", "saveScene"];

/// A call that the program made.
#[derive(Debug, Clone)]
pub struct Call {
    /// The function, with its namespace.
    pub function: String,
    pub args: Vec<Value>,
    /// The returned values.
    pub returned: Vec<Value>,
}

pub struct StandIn {
    /// The cell, for questions.
    pub cell: Connection,
    /// What the program has called, in order.
    pub calls: Vec<Call>,
    served: zmq::Socket,
    forwarded: zmq::Socket,
    port: u16,
    arm: i64,
    script: i64,
    _process: CellProcess,
}

impl StandIn {
    /// Connected to a cell, whose arm is the one that can be loaded. What else the program may create is renamed.
    ///
    /// # Panics
    /// When the cell is not one with a UR5.
    pub fn new(process: CellProcess) -> Self {
        let address = format!("tcp://127.0.0.1:{}", process.port());
        let endpoint: Endpoint = address.parse().expect("an address");
        let mut cell = Connection::connect(&endpoint, ConnectionOptions::default()).expect("the cell");
        let context = zmq::Context::new();
        let [served, forwarded] = [zmq::REP, zmq::REQ].map(|kind| {
            let socket = context.socket(kind).expect("a socket");
            socket.set_linger(0).expect("set");
            socket.set_rcvtimeo(PATIENCE.as_millis() as i32).expect("set");
            socket
        });
        served.bind("tcp://127.0.0.1:*").expect("a port");
        let bound = served.get_last_endpoint().expect("bound").expect("an address");
        let port = bound.rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");
        forwarded.connect(&address).expect("the cell");
        let arm = object(&mut cell, "/UR5");
        let script = frame(&mut cell, "Script").expect("made");
        ask(&mut cell, "setObjectParent", vec![script.into(), arm.into(), false.into()]).expect("under the arm");
        Self { cell, calls: Vec::new(), served, forwarded, port, arm, script, _process: process }
    }

    /// Empties the scene: nothing has the name of something that a program creates, and the arm has its model's initial
    /// pose.
    ///
    /// # Panics
    /// When the cell refuses.
    pub fn empty(&mut self) {
        for path in ["/UR5/Tip", "/UR5/Target", "/UR5/3D_camera", "/Plane"] {
            let object = object(&mut self.cell, path);
            ask(&mut self.cell, "setObjectAlias", vec![object.into(), "of the cell".into()]).expect("renamed");
        }
        let on_the_floor = wire::floats([0.0, 0.0, 0.01465, 0.0, 0.0, 0.0, 1.0]);
        ask(&mut self.cell, "setObjectPose", vec![self.arm.into(), (-1).into(), on_the_floor]).expect("placed");
        for joint in self.joints() {
            for function in ["setJointTargetPosition", "setJointPosition"] {
                ask(&mut self.cell, function, vec![joint.into(), 0.0.into()]).expect("straight up");
            }
        }
    }

    /// Where it listens on 127.0.0.1.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// The script that comes with the model of the arm.
    pub fn script(&self) -> i64 {
        self.script
    }

    /// The joints of the arm.
    ///
    /// # Panics
    /// When it has none.
    pub fn joints(&mut self) -> Vec<i64> {
        let joints = ask(&mut self.cell, "getObjectsInTree", vec![self.arm.into(), 1.into()]).expect("joints");
        joints[0].list().expect("a list").iter().filter_map(Value::integer).collect()
    }

    /// The object at a path.
    ///
    /// # Panics
    /// When there is none.
    pub fn object(&mut self, path: &str) -> i64 {
        object(&mut self.cell, path)
    }

    /// Calls `sim.function` of the cell.
    ///
    /// # Panics
    /// When it is refused.
    pub fn ask(&mut self, function: &str, args: Vec<Value>) -> Vec<Value> {
        ask(&mut self.cell, function, args).expect("the cell answers")
    }

    /// Runs a program that connects to it.
    ///
    /// # Panics
    /// When the program does not run or does not end, or the cell does not answer.
    pub fn run(&mut self, program: &mut Command) -> Output {
        let mut child = program.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program runs");
        let deadline = Instant::now() + PATIENCE;
        loop {
            let served = self.serve();
            match served {
                Ok(false) if child.try_wait().expect("a child can be asked").is_some() => break,
                Ok(_) if Instant::now() < deadline => {}
                _ => {
                    child.kill().expect("it runs");
                    let reported = child.wait_with_output().expect("its words");
                    panic!("{served:?}, or too late: {}", String::from_utf8_lossy(&reported.stderr));
                }
            }
        }
        child.wait_with_output().expect("its words")
    }

    /// Answers one request; returns whether there was one.
    fn serve(&mut self) -> anyhow::Result<bool> {
        if self.served.poll(zmq::POLLIN, LOOK_MS)? == 0 {
            return Ok(false);
        }
        let request = self.served.recv_bytes(0)?;
        let message = wire::decode(&request)?;
        let function = message.get("func").and_then(|name| name.text()).context("a function")?.to_owned();
        let args = message.get("args").and_then(|args| args.list()).context("arguments")?.to_vec();
        let reply = match self.recorded(&function, &args)? {
            Some(returned) => wire::map([("ret", Value::Array(returned))]),
            None => self.forward(&function, &request)?,
        };
        let returned = reply.get("ret").and_then(|values| values.list()).unwrap_or_default().to_vec();
        self.calls.push(Call { function, args, returned });
        self.served.send(wire::encode(&reply), 0)?;
        Ok(true)
    }

    /// The cell's answer to a request.
    fn forward(&self, function: &str, request: &[u8]) -> anyhow::Result<Value> {
        self.forwarded.send(request, 0)?;
        let mut reply = wire::decode(&self.forwarded.recv_bytes(0)?)?;
        if function == "zmqRemoteApi.info" {
            add_record(&mut reply).context("a list of functions")?;
        }
        Ok(reply)
    }

    /// CoppeliaSim's return values if the cell does not support the call.
    fn recorded(&mut self, function: &str, args: &[Value]) -> anyhow::Result<Option<Vec<Value>>> {
        let Some(name) = function.strip_prefix("sim.") else { return Ok(None) };
        let asks_for = |at: usize, value| args.get(at).and_then(Value::integer) == Some(value);
        if let Some((_, alias)) = MAKERS.iter().find(|(maker, _)| *maker == name) {
            return Ok(Some(vec![frame(&mut self.cell, alias)?.into()]));
        }
        Ok(match name {
            "loadModel" => Some(vec![self.arm.into()]),
            "getStringParam" if asks_for(0, RESOURCES) => Some(vec!["/opt/CoppeliaSim".into()]),
            "getObjectsInTree" if asks_for(1, SCRIPT) => Some(vec![wire::integers([self.script])]),
            setter if SETTERS.contains(&setter) => Some(Vec::new()),
            _ => None,
        })
    }
}

/// Adds what is recorded to the cell's list of functions and constants, from which clients build their objects.
fn add_record(reply: &mut Value) -> Option<()> {
    let entries = reply.as_map_mut()?.iter_mut().find(|(key, _)| key.text() == Some("ret"))?.1.as_array_mut()?;
    let list = entries.first_mut()?.as_map_mut()?;
    let functions = MAKERS.iter().map(|(name, _)| *name).chain(SETTERS);
    list.extend(functions.map(|name| (Value::from(name), wire::map([("func", Value::Map(Vec::new()))]))));
    list.extend(CONSTANTS.iter().map(|&(name, value)| (Value::from(name), wire::map([("const", Value::from(value))]))));
    Some(())
}

fn ask(cell: &mut Connection, function: &str, args: Vec<Value>) -> anyhow::Result<Vec<Value>> {
    Ok(cell.call(&format!("sim.{function}"), args)?.values().to_vec())
}

fn object(cell: &mut Connection, path: &str) -> i64 {
    let found = ask(cell, "getObject", vec![path.into()]).unwrap_or_else(|error| panic!("{path}: {error}"));
    found[0].integer().expect("a handle")
}

/// A frame of the cell.
fn frame(cell: &mut Connection, alias: &str) -> anyhow::Result<i64> {
    let made = ask(cell, "createDummy", vec![0.01.into()])?;
    let handle = made.first().and_then(Value::integer).context("a handle")?;
    ask(cell, "setObjectAlias", vec![handle.into(), alias.into()])?;
    Ok(handle)
}
