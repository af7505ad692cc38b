//! ROS as a driver reads it.

use std::time::{Duration, Instant};

use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::Isometry3;
use serde_json::Value;

use super::link::{Incoming, Link};
use super::scene::{News, Scene};
use crate::drivers::{Device, Fault, Outlet};
use crate::message::{
    Ability, ArmMessage, CameraMessage, Hello, JointMessage, LogLevel, PROTOCOL, PoseMessage, StateMessage,
};

/// How long topics may take to say something for the first time: less than the workbench waits for `hello`.
const FIRST: Duration = Duration::from_secs(7);
/// How long frames are collected before they are listed for the user.
const LISTING: Duration = Duration::from_secs(3);
/// How often a topic that nobody publishes yet is asked for again.
const AGAIN: Duration = Duration::from_secs(2);
/// How long at most until it is asked whether the workbench has gone, and states of an arm at rest.
const TICK: Duration = Duration::from_millis(50);
/// States are no closer than this: 500 a second.
const CLOSEST_S: f64 = 0.002;
/// A clock that goes back by more than this was set anew.
const RESET_S: f64 = 1.0;
/// So long without a new pose is worth a line in the log.
const STALE: Duration = Duration::from_secs(2);

/// What to read.
#[derive(Debug, Clone)]
pub struct RosbridgeOptions {
    /// `ws://HOST:9090`.
    pub url: String,
    /// tf's frame in which the tip is stated.
    pub base_frame: Option<String>,
    /// tf's frame of the tip.
    pub tip_frame: Option<String>,
    /// Topic of `sensor_msgs/JointState`.
    pub joints: Option<String>,
    /// Which joints, from the base up.
    pub arm_joints: Vec<JointMessage>,
    /// Topic of `sensor_msgs/Image` or `sensor_msgs/CompressedImage`.
    pub image: Option<String>,
    /// Topic of `sensor_msgs/CameraInfo`.
    pub camera_info: Option<String>,
    /// Whether the images are rectified: then the lens is the projection matrix, without distortion.
    pub is_rectified: bool,
    /// Topic of `sensor_msgs/Image` with depth, aligned to the image.
    pub depth: Option<String>,
    /// Most images a second that rosbridge is to send.
    pub image_rate_hz: f64,
    /// Longest message in bytes that is not cut into pieces; rosbridge's own limit where `None`.
    pub fragment_size: Option<u32>,
    /// Which arm the joints are, where that is known.
    pub arm: Option<ArmMessage>,
}

impl RosbridgeOptions {
    /// Nothing but the address, and ten images a second.
    pub fn new(url: impl Into<String>) -> Self {
        Self {
            url: url.into(),
            base_frame: None,
            tip_frame: None,
            joints: None,
            arm_joints: Vec::new(),
            image: None,
            camera_info: None,
            is_rectified: false,
            depth: None,
            image_rate_hz: 10.0,
            fragment_size: None,
            arm: None,
        }
    }

    fn frames(&self) -> Option<(&str, &str)> {
        Some((self.base_frame.as_deref()?, self.tip_frame.as_deref()?))
    }

    /// What can be said before there is a connection.
    fn check(&self) -> Result<(), Fault> {
        let needs = |given: bool, what: &str, needs: &str| {
            if given { Err(Fault(format!("{what} needs {needs}"))) } else { Ok(()) }
        };
        needs(self.depth.is_some() && self.image.is_none(), "--depth", "--image")?;
        needs(self.camera_info.is_some() && self.image.is_none(), "--camera-info", "--image")?;
        needs(self.joints.is_some() && self.frames().is_none(), "--joints", "--base-frame and --tip-frame")?;
        let image = self.image.as_deref().unwrap_or_default();
        if self.camera_info.is_some() && image.contains("rect") && !self.is_rectified {
            return Err(Fault(format!(
                "{image} looks like rectified images, whose lens is the projection matrix of camera info without distortion: \
                 give --rectified if they are, or name the raw images"
            )));
        }
        Ok(())
    }
}

/// Reads ROS through rosbridge. It ends when the connection breaks; the workbench starts it again.
#[derive(Debug)]
pub struct Rosbridge {
    options: RosbridgeOptions,
    open: Option<(Link, Scene)>,
}

impl Rosbridge {
    /// Nothing is connected yet.
    pub fn new(options: RosbridgeOptions) -> Self {
        Self { options, open: None }
    }

    /// Waits until all that was asked for has come, or says what has not.
    fn first(&self, link: &mut Link, scene: &mut Scene, outlet: &Outlet) -> Result<(), Fault> {
        let start = Instant::now();
        let mut topics = Vec::new();
        let mut complaints: Vec<String> = Vec::new();
        let mut asked = start;
        link.call("/rosapi/topics", "topics").map_err(Fault::of)?;
        loop {
            let missing = self.missing(scene);
            let lists = self.options.frames().is_none() && self.options.image.is_none();
            if !lists && missing.is_none() {
                return Ok(());
            }
            let waited = start.elapsed();
            if lists && waited > LISTING || waited > FIRST {
                return Err(if lists {
                    list_frames(scene)
                } else {
                    Self::absent(missing.as_deref(), &topics, &complaints)
                });
            }
            if asked.elapsed() > AGAIN {
                asked = Instant::now();
                for subscription in scene.subscriptions() {
                    if !scene.has_heard(&subscription.topic) {
                        link.subscribe(&subscription).map_err(Fault::of)?;
                    }
                }
            }
            if outlet.has_ended() {
                return Err(Fault("the workbench has gone".into()));
            }
            match link.receive(Instant::now() + TICK).map_err(Fault::of)? {
                Some(Incoming::Publish { topic, text }) => {
                    pass_on(scene.take(&topic, &text).map_err(Fault::of)?, outlet);
                }
                Some(Incoming::Status { text, .. }) if complaints.len() < 10 && !complaints.contains(&text) => {
                    complaints.push(text);
                }
                Some(Incoming::Response { id, values }) if id == "topics" => topics = pairs(&values),
                _ => {}
            }
        }
    }

    /// What has not come yet.
    fn missing(&self, scene: &Scene) -> Option<String> {
        let options = &self.options;
        if let Some((base, tip)) = options.frames()
            && let Err(error) = scene.tree.newest(base, tip)
        {
            return Some(format!("{error}. Its frames are:\n{}", scene.tree.describe()));
        }
        if let Some(topic) = &options.joints
            && scene.joints.last_s().is_none()
        {
            let seen = scene.joints.seen().join(",");
            return Some(if seen.is_empty() {
                format!("nothing comes on {topic}")
            } else if scene.joints.names().is_empty() {
                format!(
                    "which joints of {topic} are the arm's, from the base up? It has {seen}: give --joint-names, or --urdf"
                )
            } else {
                format!("{topic} has the joints {seen}, and not all of {}", scene.joints.names().join(","))
            });
        }
        for topic in [&options.image, &options.depth, &options.camera_info].into_iter().flatten() {
            if !scene.has_heard(topic) {
                return Some(format!("nothing comes on {topic}"));
            }
        }
        None
    }

    fn absent(missing: Option<&str>, topics: &[(String, String)], complaints: &[String]) -> Fault {
        const READ: [&str; 5] = ["/Image", "/CompressedImage", "/CameraInfo", "/JointState", "/TFMessage"];
        const MOST: usize = 50;
        let mut lines = vec![format!("after {} s: {}", FIRST.as_secs(), missing.unwrap_or("nothing is missing"))];
        let is_read = |(_, kind): &&(String, String)| READ.iter().any(|end| kind.ends_with(end));
        let mut of_use = topics.iter().filter(is_read).take(MOST).peekable();
        if of_use.peek().is_some() {
            lines.push("Topics that can be read:".into());
            lines.extend(of_use.map(|(topic, kind)| format!("  {topic} ({kind})")));
        }
        lines.extend(complaints.iter().map(|complaint| format!("rosbridge says: {complaint}")));
        Fault(lines.join("\n"))
    }

    fn hello(&self, scene: &Scene) -> Result<Hello, Fault> {
        let options = &self.options;
        let mut can = Vec::new();
        if options.frames().is_some() {
            can.push(Ability::State);
        }
        if options.joints.is_some() {
            can.push(Ability::Joints);
        }
        let camera = match scene.size {
            Some((width, height)) if options.image.is_some() => {
                can.push(Ability::Image);
                let intrinsics = scene.lens().transpose().map_err(Fault::of)?;
                Some(CameraMessage { width, height, intrinsics })
            }
            _ => None,
        };
        if options.depth.is_some() {
            can.push(Ability::Depth);
        }
        let joints = if options.joints.is_some() { options.arm_joints.clone() } else { Vec::new() };
        Ok(Hello {
            protocol: PROTOCOL,
            name: format!("ROS through rosbridge at {}", options.url),
            version: env!("CARGO_PKG_VERSION").into(),
            clock: "ROS".into(),
            can,
            joints,
            arm: options.arm.clone().filter(|_| options.joints.is_some()),
            base_from_arm: None,
            camera,
            depth_limits_m: None,
        })
    }
}

impl Device for Rosbridge {
    fn open(&mut self, outlet: &Outlet) -> Result<Hello, Fault> {
        self.options.check()?;
        let mut link = Link::connect(&self.options.url, self.options.fragment_size).map_err(Fault::of)?;
        let mut scene = Scene::new(self.options.clone());
        for subscription in scene.subscriptions() {
            link.subscribe(&subscription).map_err(Fault::of)?;
        }
        self.first(&mut link, &mut scene, outlet)?;
        let hello = self.hello(&scene)?;
        self.open = Some((link, scene));
        Ok(hello)
    }

    fn run(&mut self, outlet: &Outlet) -> Result<(), Fault> {
        let Some((mut link, mut scene)) = self.open.take() else { return Err(Fault("ROS was not opened".into())) };
        let mut arm = Arm::new(self.options.frames());
        while !outlet.has_ended() {
            match link.receive(Instant::now() + TICK).map_err(Fault::of)? {
                Some(Incoming::Publish { topic, text }) => {
                    pass_on(scene.take(&topic, &text).map_err(Fault::of)?, outlet);
                }
                Some(Incoming::Status { level, text }) => {
                    let level = if level == "error" { LogLevel::Error } else { LogLevel::Info };
                    outlet.log(level, format!("rosbridge says: {text}"));
                }
                Some(Incoming::Response { .. }) | None => {}
            }
            for remark in std::mem::take(&mut scene.remarks) {
                outlet.log(LogLevel::Warn, remark);
            }
            arm.publish(&scene, outlet)?;
        }
        Ok(())
    }
}

/// Frames go to the outlet, stamps to its clock.
fn pass_on(news: News, outlet: &Outlet) {
    match news {
        News::None => {}
        News::Moved(stamp_s) => outlet.heard(stamp_s),
        News::Frame(frame) => {
            outlet.heard(frame.stamp);
            outlet.frame(*frame);
        }
    }
}

/// Where the arm was when it was last said.
struct Arm<'a> {
    frames: Option<(&'a str, &'a str)>,
    last_s: f64,
    said: Instant,
    is_stale: bool,
}

impl<'a> Arm<'a> {
    fn new(frames: Option<(&'a str, &'a str)>) -> Self {
        Self { frames, last_s: f64::NEG_INFINITY, said: Instant::now(), is_stale: false }
    }

    /// Says where the arm is, if that is newer than what was said.
    fn publish(&mut self, scene: &Scene, outlet: &Outlet) -> Result<(), Fault> {
        let Some((base, tip)) = self.frames else { return Ok(()) };
        let limit_s = if scene.joints.names().is_empty() { None } else { scene.joints.last_s() };
        let Ok((instant, pose)) = scene.tree.newest_until(base, tip, limit_s.unwrap_or(f64::INFINITY)) else {
            return Ok(());
        };
        let stamp = match instant.or(limit_s) {
            Some(stamp) => stamp,
            // Nothing moves and nothing is stamped: it is there now.
            None if self.said.elapsed() >= TICK => outlet.device_time(),
            None => return Ok(()),
        };
        if stamp < self.last_s - RESET_S {
            return Err(Fault("the clock of ROS went back: was a recording played again?".into()));
        }
        if stamp - self.last_s < CLOSEST_S {
            if !self.is_stale && self.said.elapsed() > STALE {
                self.is_stale = true;
                outlet.log(
                    LogLevel::Warn,
                    format!("tf has said nothing new of {tip} in {base} for {} s", STALE.as_secs()),
                );
            }
            return Ok(());
        }
        let joints_rad = if scene.joints.names().is_empty() { None } else { scene.joints.at(stamp) };
        if joints_rad.is_none() && !scene.joints.names().is_empty() {
            return Ok(());
        }
        outlet.state(&StateMessage {
            stamp,
            joints_rad,
            base_from_flange: None,
            flange_from_tcp: None,
            base_from_tip: Some(tip_message(pose)),
            moving: None,
        });
        (self.last_s, self.said, self.is_stale) = (stamp, Instant::now(), false);
        Ok(())
    }
}

fn tip_message(pose: Isometry3<f64>) -> PoseMessage {
    PoseMessage::of(&Pose::<Base, Tip>::from_isometry(pose))
}

fn list_frames(scene: &Scene) -> Fault {
    let frames = scene.tree.describe();
    if frames.is_empty() {
        return Fault(format!(
            "nothing comes on /tf within {} s: is robot_state_publisher running? Give --image for a camera alone",
            LISTING.as_secs()
        ));
    }
    Fault(format!(
        "which frames are the robot's base and its tip? Give --base-frame and --tip-frame (often base_link and tool0). tf has:\n{frames}"
    ))
}

/// Topics with their types, as rosapi lists them.
fn pairs(values: &Value) -> Vec<(String, String)> {
    let texts = |key: &str| {
        let list = values[key].as_array().into_iter().flatten();
        list.map(|value| value.as_str().unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    texts("topics").into_iter().zip(texts("types")).collect()
}
